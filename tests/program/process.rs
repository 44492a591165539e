//! Programs started as a user starts them, with and without mpirun. Each has a time limit, and leaves
//! no process behind: nothing that these tests start can hang.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{Read, Seek};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// A call that takes longer hangs: the slowest takes ten seconds on two cores that nobody else uses.
const TIME_LIMIT: Duration = Duration::from_secs(240);
/// How soon all processes of a call must be gone once it has ended, or has been killed.
const SOON: Duration = Duration::from_secs(5);
/// Between looks at what is waited for.
const POLL: Duration = Duration::from_millis(10);
/// Names a call to the processes that it starts.
const CALL: &str = "DEM_MPI_TEST_CALL";

/// How a program is started.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Launch {
    /// As it is.
    Alone,
    /// `mpirun -n`.
    Ranks(u32),
}

/// A program, its arguments, and where and how it is started.
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

/// The launcher of the MPI that the program was built with: `mpirun`, or what the variable `MPIRUN` says.
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

    /// From this working directory, instead of the package's.
    pub(super) fn from(self, directory: &Path) -> Self {
        Self { directory: directory.to_owned(), ..self }
    }

    /// With another time limit.
    pub(super) fn within(self, limit: Duration) -> Self {
        Self { limit, ..self }
    }

    /// Starts it and waits for its end, whatever that is.
    pub(super) fn end(self) -> Ended {
        self.start().end()
    }

    /// Starts it and waits for its end, which must be good.
    pub(super) fn succeed(self) -> Ended {
        let ended = self.end();
        assert_eq!(ended.status.code(), Some(0), "{ended}");
        ended
    }

    /// Starts it.
    pub(super) fn start(self) -> Running {
        static CALLS: AtomicU32 = AtomicU32::new(0);
        let name = format!("{}-{}", std::process::id(), CALLS.fetch_add(1, Ordering::Relaxed));
        // They call mpirun themselves.
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
            // Whatever the user and the number of cores.
            .env("OMPI_ALLOW_RUN_AS_ROOT", "1")
            .env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1")
            .env("OMPI_MCA_rmaps_base_oversubscribe", "1")
            .env("OMPI_MCA_mpi_yield_when_idle", "1")
            // As `run/environment` has it.
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

/// Waits until no other test, of this or another test program, runs mpirun: with more ranks than cores,
/// two at a time would only get in each other's way. The turn ends when the file is closed.
fn wait_for_turn() -> File {
    let turn = File::create(Path::new(env!("CARGO_TARGET_TMPDIR")).join("mpirun.lock"))
        .expect("the lock's file can be made");
    turn.lock().expect("the file can be locked");
    turn
}

/// A started call. What is still there of it when it is dropped is killed.
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

    /// Polls until something is the case; fails if the call ends before, or at its time limit.
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

    /// The process that was started.
    pub(super) fn id(&self) -> u32 {
        self.child.id()
    }

    /// The process of a rank.
    pub(super) fn rank(&self, rank: u32) -> Option<u32> {
        let is_it = |environment: &&Process| {
            // Of Open MPI, of MPICH.
            let [of_open_mpi, of_mpich] =
                ["OMPI_COMM_WORLD_RANK", "PMI_RANK"].map(|name| environment.variables.get(name));
            of_open_mpi.or(of_mpich) == Some(&rank.to_string())
        };
        self.processes().iter().find(is_it).map(|process| process.id)
    }

    /// All processes that the call has started, and that have not ended.
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

/// A process and the variables with which it was started.
struct Process {
    id: u32,
    variables: BTreeMap<String, String>,
}

impl Process {
    /// `None` if it has ended, or is somebody else's.
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
    // It may be gone by now: then there is nothing to complain about.
    let _ = Command::new("sh").args(["-c", &kill]).stderr(Stdio::null()).status();
}

/// Polls until something is so; false if it is not within the limit.
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

/// How a call ended, and what it said.
pub(super) struct Ended {
    words: Vec<OsString>,
    pub(super) status: ExitStatus,
    pub(super) took: Duration,
    pub(super) output: String,
    pub(super) errors: String,
}

impl Ended {
    /// Everything that it said.
    pub(super) fn said(&self) -> String {
        format!("{}{}", self.output, self.errors)
    }

    /// It said this, and not twice.
    pub(super) fn said_once(&self, text: &str) {
        // A warning stands in the report, too.
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
