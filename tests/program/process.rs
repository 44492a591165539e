//! Programs started from the command line, with and without mpirun. Each has a time limit and leaves no
//! process behind, so these tests cannot hang.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{Read, Seek};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// Time limit of a call; the slowest takes ten seconds on two idle cores.
const TIME_LIMIT: Duration = Duration::from_secs(240);
/// Time limit for the end of all processes of a call, after it has ended or has been killed.
const SOON: Duration = Duration::from_secs(5);
/// Interval of polling.
const POLL: Duration = Duration::from_millis(10);
/// Environment variable that identifies the processes of a call.
const CALL: &str = "DEM_MPI_TEST_CALL";

/// Launch method of a program.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Launch {
    /// Without a launcher.
    Alone,
    /// With `mpirun -n`.
    Ranks(u32),
}

/// A program with its arguments, working directory and time limit.
pub(super) struct Call {
    words: Vec<OsString>,
    directory: PathBuf,
    limit: Duration,
}

/// `dem-mpi` with these arguments.
pub(super) fn dem_mpi<S: Into<OsString>>(
    launch: Launch,
    arguments: impl IntoIterator<Item = S>,
) -> Call {
    let launcher = match launch {
        Launch::Alone => vec![],
        Launch::Ranks(n) => vec![mpirun(), "-n".into(), n.to_string().into()],
    };
    Call::new(launcher, env!("CARGO_BIN_EXE_dem-mpi"), arguments)
}

/// Launcher of the MPI that the program was built with: `mpirun`, or the value of the variable `MPIRUN`.
pub(super) fn mpirun() -> OsString {
    std::env::var_os("MPIRUN").unwrap_or("mpirun".into())
}

/// `dem-post` with these arguments.
pub(super) fn dem_post<S: Into<OsString>>(arguments: impl IntoIterator<Item = S>) -> Call {
    Call::new(vec![], env!("CARGO_BIN_EXE_dem-post"), arguments)
}

impl Call {
    pub(super) fn new<S: Into<OsString>>(
        launcher: Vec<OsString>,
        program: &str,
        arguments: impl IntoIterator<Item = S>,
    ) -> Self {
        let mut words = launcher;
        words.push(program.into());
        words.extend(arguments.into_iter().map(Into::into));
        Self { words, directory: env!("CARGO_MANIFEST_DIR").into(), limit: TIME_LIMIT }
    }

    /// Sets a working directory other than the package's.
    pub(super) fn from(self, directory: &Path) -> Self {
        Self { directory: directory.to_owned(), ..self }
    }

    /// Sets another time limit.
    pub(super) fn within(self, limit: Duration) -> Self {
        Self { limit, ..self }
    }

    /// Runs the program to its end, with any status.
    pub(super) fn end(self) -> Ended {
        self.start().end()
    }

    /// Runs the program to its end and checks that it succeeded.
    pub(super) fn succeed(self) -> Ended {
        let ended = self.end();
        assert_eq!(ended.status.code(), Some(0), "{ended}");
        ended
    }

    /// Starts the program.
    pub(super) fn start(self) -> Running {
        static CALLS: AtomicU32 = AtomicU32::new(0);
        let name = format!("{}-{}", std::process::id(), CALLS.fetch_add(1, Ordering::Relaxed));
        // These scripts and sweeps call mpirun themselves.
        let several = |word: &OsString| {
            *word == mpirun() || ["run/slurm", "run/demo", "--ranks"].iter().any(|w| word == w)
        };
        let turn = self.words.iter().any(several).then(wait_for_turn);
        let file = || tempfile::tempfile().expect("a file for what the program says");
        let (output, errors) = (file(), file());
        let same = |file: &File| file.try_clone().expect("a second handle of the file");
        let child = Command::new(&self.words[0])
            .args(&self.words[1..])
            .current_dir(&self.directory)
            .env(CALL, &name)
            // For any user and number of cores.
            .env("OMPI_ALLOW_RUN_AS_ROOT", "1")
            .env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1")
            .env("OMPI_MCA_rmaps_base_oversubscribe", "1")
            .env("OMPI_MCA_mpi_yield_when_idle", "1")
            // The values of `run/environment`.
            .env("OMPI_MCA_odls_base_sigkill_timeout", "4")
            .env("OMPI_MCA_hwloc_base_binding_policy", "none")
            .stdin(Stdio::null())
            .stdout(same(&output))
            .stderr(same(&errors))
            .spawn()
            .unwrap_or_else(|e| panic!("{} cannot be started: {e}", self.words[0].display()));
        Running { call: self, name, child, begin: Instant::now(), output, errors, _turn: turn }
    }
}

/// Waits until no other test, of this or another test program, runs mpirun. With more ranks than cores,
/// two concurrent runs would slow each other. The lock ends when the file is closed.
fn wait_for_turn() -> File {
    let turn = File::create(Path::new(env!("CARGO_TARGET_TMPDIR")).join("mpirun.lock"))
        .expect("the lock's file can be made");
    turn.lock().expect("the file can be locked");
    turn
}

/// A started call. Its remaining processes are killed when it is dropped.
pub(super) struct Running {
    call: Call,
    name: String,
    child: Child,
    begin: Instant,
    output: File,
    errors: File,
    _turn: Option<File>,
}

impl Running {
    /// Waits for the end.
    pub(super) fn end(mut self) -> Ended {
        let limit = self.call.limit.saturating_sub(self.begin.elapsed());
        let mut status = None;
        let in_time = is_soon(limit, || {
            status = self.child.try_wait().expect("a child can be waited for");
            status.is_some()
        });
        let took = self.begin.elapsed();
        if !in_time {
            self.kill_all();
        }
        let ended = Ended {
            words: self.call.words.clone(),
            status: status.unwrap_or_default(),
            took,
            output: text_of(&mut self.output),
            errors: text_of(&mut self.errors),
        };
        assert!(in_time, "hangs, killed after {took:?}. {ended}");
        let all_gone = is_soon(SOON, || self.processes().is_empty());
        assert!(all_gone, "{} processes outlive {ended}", self.processes().len());
        ended
    }

    /// Polls until a condition holds; fails if the call ends before, or at its time limit.
    pub(super) fn until(&mut self, what: &str, mut is_so: impl FnMut() -> bool) {
        let limit = self.call.limit.saturating_sub(self.begin.elapsed());
        let child = &mut self.child;
        let in_time = is_soon(limit, || {
            let has_ended = child.try_wait().expect("a child can be waited for").is_some();
            assert!(!has_ended, "ended before {what}");
            is_so()
        });
        assert!(in_time, "{limit:?} passed before {what}");
    }

    /// Id of the started process.
    pub(super) fn id(&self) -> u32 {
        self.child.id()
    }

    /// Process id of a rank.
    pub(super) fn rank(&self, rank: u32) -> Option<u32> {
        let is_it = |environment: &&Process| {
            // Variables of Open MPI and of MPICH.
            let [of_open_mpi, of_mpich] =
                ["OMPI_COMM_WORLD_RANK", "PMI_RANK"].map(|name| environment.variables.get(name));
            of_open_mpi.or(of_mpich) == Some(&rank.to_string())
        };
        self.processes().iter().find(is_it).map(|process| process.id)
    }

    /// All running processes of the call.
    fn processes(&self) -> Vec<Process> {
        let all = fs::read_dir("/proc").expect("a system with /proc");
        let ids = all.filter_map(|entry| entry.ok()?.file_name().to_str()?.parse().ok());
        ids.filter_map(Process::read)
            .filter(|process| process.variables.get(CALL) == Some(&self.name))
            .collect()
    }

    fn kill_all(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
        is_soon(SOON, || {
            let left = self.processes();
            for process in &left {
                kill(process.id);
            }
            left.is_empty()
        });
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.kill_all();
    }
}

/// A process with its environment variables.
struct Process {
    id: u32,
    variables: BTreeMap<String, String>,
}

impl Process {
    /// `None` if it has ended, or belongs to another user.
    fn read(id: u32) -> Option<Self> {
        let bytes = fs::read(format!("/proc/{id}/environ")).ok()?;
        let variables = String::from_utf8_lossy(&bytes)
            .split('\0')
            .filter_map(|entry| entry.split_once('='))
            .map(|(name, value)| (name.to_owned(), value.to_owned()))
            .collect();
        Some(Self { id, variables })
    }
}

/// `kill -9`.
pub(super) fn kill(process: u32) {
    signal(process, "KILL");
}

/// Sends a signal by its name.
pub(super) fn signal(process: u32, name: &str) {
    let kill = format!("kill -s {name} {process}");
    // An error is ignored, as the process may have ended.
    let _ = Command::new("sh").args(["-c", &kill]).stderr(Stdio::null()).status();
}

/// Polls until a condition holds; false at the time limit.
fn is_soon(limit: Duration, mut is_so: impl FnMut() -> bool) -> bool {
    let begin = Instant::now();
    loop {
        if is_so() {
            return true;
        }
        if begin.elapsed() > limit {
            return false;
        }
        sleep(POLL);
    }
}

fn text_of(file: &mut File) -> String {
    let mut bytes = Vec::new();
    file.rewind().and_then(|()| file.read_to_end(&mut bytes)).expect("the file can be read");
    String::from_utf8_lossy(&bytes).into_owned()
}

/// Result of a call: status, duration and output.
pub(super) struct Ended {
    words: Vec<OsString>,
    pub(super) status: ExitStatus,
    pub(super) took: Duration,
    pub(super) output: String,
    pub(super) errors: String,
}

impl Ended {
    /// Standard output and standard error.
    pub(super) fn said(&self) -> String {
        format!("{}{}", self.output, self.errors)
    }

    /// Checks that a text occurs exactly once in the output.
    pub(super) fn said_once(&self, text: &str) {
        // A warning is in both outputs: once as it arises and once in the report.
        let times = [&self.errors, &self.output].map(|said| said.matches(text).count());
        let times = times.into_iter().max().unwrap_or_default();
        assert_eq!(times, 1, "`{text}` {times} times in the output of {self}");
    }
}

impl std::fmt::Display for Ended {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for word in &self.words {
            write!(f, "{} ", word.display())?;
        }
        write!(f, "({}, {:?})", self.status, self.took)?;
        write!(f, "\n--- output\n{}\n--- errors\n{}", self.output, self.errors)
    }
}
