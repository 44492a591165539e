//! Runs of dem-mpi under mpirun, which end with a snapshot when this program is stopped.

use benchmarking::machine::cores;
use signal_hook::consts::{SIGINT, SIGTERM};
use std::fs::File;
use std::io::{self, PipeReader, Read, Write};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// The checkout from which this program was built, the current directory of all runs. Their scenes are in it; the default
/// output is in its `out`.
pub const CHECKOUT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");

/// A path independent of the current directory.
///
/// # Errors
/// If the system cannot make it absolute.
pub fn absolute(path: &str) -> io::Result<PathBuf> {
    std::path::absolute(path)
}

/// Exit status of a program that SIGTERM ended, as a shell reports it.
pub const STOPPED: u8 = 143;

/// Reasons for which a run did not do all its steps.
#[derive(Debug, thiserror::Error)]
pub enum SimulationError {
    /// dem-mpi or mpirun failed.
    #[error("{what} has not ended well, {status}: see {log}", log = log.display())]
    Failed {
        /// Name of the run.
        what: String,
        /// Exit status of mpirun.
        status: ExitStatus,
        /// File with the cause.
        log: PathBuf,
    },
    /// A signal asked this program to end; the run has written a snapshot.
    #[error("{what} was stopped by a signal; the same command goes on with it")]
    Stopped {
        /// Name of the run.
        what: String,
    },
    /// mpirun could not be started, or its output not be written.
    #[error("{what}: {cause}")]
    System {
        /// The attempted action.
        what: String,
        /// Error of the operating system.
        cause: io::Error,
    },
}

/// SIGTERM and SIGINT. They end this program at once, except while dem-mpi runs, when they are passed on to it.
pub struct Signals {
    end_at_once: Arc<AtomicBool>,
    received: Arc<AtomicBool>,
    /// Number of active runs.
    runs: Mutex<usize>,
}

impl Signals {
    /// Handles both signals from now on.
    ///
    /// # Errors
    /// If the handlers cannot be installed.
    pub fn take() -> io::Result<Self> {
        let signals = Self {
            end_at_once: Arc::new(AtomicBool::new(true)),
            received: Arc::new(AtomicBool::new(false)),
            runs: Mutex::new(0),
        };
        for signal in [SIGTERM, SIGINT] {
            let (end, received) = (&signals.end_at_once, &signals.received);
            signal_hook::flag::register_conditional_shutdown(
                signal,
                i32::from(STOPPED),
                Arc::clone(end),
            )?;
            signal_hook::flag::register(signal, Arc::clone(received))?;
        }
        Ok(signals)
    }

    /// Ends all runs as after a signal.
    pub fn stop(&self) {
        self.received.store(true, Ordering::SeqCst);
    }

    fn is_received(&self) -> bool {
        self.received.load(Ordering::SeqCst)
    }

    /// Changes the number of active runs by one.
    fn count(&self, change: isize) {
        let mut runs = self.runs.lock().unwrap_or_else(PoisonError::into_inner);
        *runs = runs.saturating_add_signed(change);
        self.end_at_once.store(*runs == 0, Ordering::SeqCst);
    }
}

/// Path of a program of dem-mpi, beside this one.
///
/// # Errors
/// If the path of this program is unknown.
pub fn program(name: &str) -> io::Result<PathBuf> {
    Ok(std::env::current_exe()?.with_file_name(name))
}

/// Command for dem-mpi with a scene on this number of ranks, by the mpirun of the environment.
///
/// # Errors
/// If the path of this program is unknown.
pub fn dem_mpi(ranks: u32, scene: &str, arguments: &[String]) -> io::Result<Command> {
    let mut command = Command::new(std::env::var_os("MPIRUN").unwrap_or("mpirun".into()));
    command.args(["-n", &ranks.to_string()]).arg(program("dem-mpi")?).arg(scene);
    command.args(arguments);
    if ranks as usize > cores() {
        // A waiting rank must yield its core, as in run/environment.
        command.env("OMPI_MCA_mpi_yield_when_idle", "1");
    }
    Ok(command)
}

/// Runs `command` to its end. Its output is appended to `log` and, if `aloud`, printed. `what` names the run in errors.
///
/// # Errors
/// See [`SimulationError`].
pub fn run(
    mut command: Command,
    what: &str,
    log: &Path,
    aloud: bool,
    signals: &Signals,
) -> Result<(), SimulationError> {
    let failed = |cause| SimulationError::System { what: what.to_owned(), cause };
    let stopped = || SimulationError::Stopped { what: what.to_owned() };
    if signals.is_received() {
        return Err(stopped());
    }
    let (from, to) = io::pipe().map_err(failed)?;
    let file = File::options().create(true).append(true).open(log).map_err(|cause| {
        SimulationError::System { what: format!("cannot write {}", log.display()), cause }
    })?;
    command.stdin(Stdio::null()).stdout(to.try_clone().map_err(failed)?).stderr(to);
    // In its own process group: Ctrl-C in a terminal reaches only this program, which asks for a snapshot.
    command.process_group(0);
    signals.count(1);
    let child = command.spawn().map_err(|cause| SimulationError::System {
        what: format!("cannot start {}", command.get_program().display()),
        cause,
    });
    // Drops the command's ends of the pipe.
    drop(command);
    let ended = child.and_then(|child| {
        let copy = std::thread::spawn(move || copied(from, file, aloud));
        let status = ended(child, signals).map_err(failed)?;
        let copied = copy.join().unwrap_or_else(|_| Err(io::ErrorKind::Other.into()));
        copied.map_err(failed).map(|()| status)
    });
    signals.count(-1);
    match ended? {
        _ if signals.is_received() => Err(stopped()),
        status if status.success() || status.code() == Some(UNMET) => Ok(()),
        status => {
            let (what, log) = (what.to_owned(), log.to_path_buf());
            Err(SimulationError::Failed { what, status, log })
        }
    }
}

/// Exit status of dem-mpi for a stage whose `[stop]` was not reached: some packings of the paper's methods never rest.
const UNMET: i32 = 4;

/// Waits for the end of the run, and passes a signal on.
fn ended(mut child: Child, signals: &Signals) -> io::Result<ExitStatus> {
    const EVERY: Duration = Duration::from_millis(50);
    let mut is_told = false;
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(status);
        }
        if !is_told && signals.is_received() {
            is_told = true;
            Command::new("kill").args(["-TERM", &child.id().to_string()]).status()?;
        }
        std::thread::sleep(EVERY);
    }
}

/// Copies everything from a pipe to the file.
fn copied(mut from: PipeReader, mut file: File, aloud: bool) -> io::Result<()> {
    let mut bytes = [0; 1 << 13];
    loop {
        let count = from.read(&mut bytes)?;
        if count == 0 {
            return Ok(());
        }
        file.write_all(&bytes[..count])?;
        if aloud {
            // Printing may fail: nobody has to read it.
            let _ = io::stdout().write_all(&bytes[..count]);
        }
    }
}
