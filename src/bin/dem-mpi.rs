//! `dem-mpi SCENE`: arguments → scene → simulation → run.

use clap::{CommandFactory, Parser};
// A wrong scene or argument is known on all ranks; the message is on rank 0.
use dem_mpi::arguments::{self, About, FAILED, STOPPED, UNMET, WRONG as WRONG_INPUT};
use dem_mpi::comm::{Comm, agree, alone::Alone, linked, threads, wire, world};
use dem_mpi::ids::GlobalId;
use dem_mpi::output::performance::Performance;
use dem_mpi::output::report::{Origin, commit, version};
use dem_mpi::output::{self, snapshot};
use dem_mpi::scene::assemble::{self, RestartInfo};
use dem_mpi::scene::one_shape;
use dem_mpi::scene::probe::{ProbeError, probe};
use dem_mpi::scene::self_test::{Results, self_test};
use dem_mpi::scene::suggest::{self, Question, Suggestion, TrialError};
use dem_mpi::scene::workload::Workload;
use dem_mpi::scene::{Fill, Scene, Stop, keys, plan, schema};
use dem_mpi::sim::report::{machine_bytes, report};
use dem_mpi::sim::run::{self, Ending, Finish, Progress, RunError, Schedule};
use dem_mpi::sim::{Simulation, StepError};
use dem_mpi::sweep::Sweep;
use dem_mpi::text::{MOST_NAMED, counted, listed, print_error, printable};
use indicatif::{HumanDuration, ProgressBar, ProgressState, ProgressStyle};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGUSR1, SIGUSR2};
use std::fmt::Write as _;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, AtomicUsize};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

/// Discrete element method for non-spherical grains, on one rank or many.
#[derive(Parser, Debug)]
#[command(
    version = version(),
    // Under mpirun standard output looks like a terminal even where it ends in a file.
    color = clap::ColorChoice::Never,
    after_help = "\
Examples:
  dem-mpi run/packing/scene.toml                     one rank, to try or to debug
  mpirun -n 2 dem-mpi run/packing/scene.toml         two ranks, the same bits
  dem-mpi run/packing/scene.toml --plan              what the scene uses, and what it leaves out
  dem-mpi --keys material                            the keys of a table of the scene; without a name, of all
  dem-mpi --schema > scene.schema.json               for an editor; the first line of a scene is then
                                                     #:schema ./scene.schema.json
  dem-mpi run/jacks/fill.toml --shape jack           volume, centre, inertia and pieces of a shape
  dem-mpi run/first/scene.toml --suggest --error 1%  which step and method keep an error
  dem-mpi sweep run/packing/scene.toml --vary material.grain.friction=0.1,0.3,0.5 --vary seed=1..3 --measure coordination
                                                     all nine runs, and one table of what came out: `dem-mpi sweep --help`
  dem-mpi run/packing/scene.toml --set contact.method=epa --set material.grain.friction=0.5
  mpirun -n 4 dem-mpi run/packing/scene.toml --start out/packing/last.vtkhdf
                                                     go on where a run stopped, on any number of ranks
  mpirun -n 4 dem-mpi run/packing/scene.toml --start out/packing
                                                     from its newest snapshot that is whole
  dem-mpi run/packing/scene.toml --start out/packing --steps 100 --trace-particle 17
                                                     repeat steps of a run, and look at a particle

SIGTERM, SIGUSR1, SIGUSR2, SIGHUP (a terminal that closes; not under nohup) and SIGINT (Ctrl-C), on any rank, end the step:
the run writes a snapshot, says how to go on, and exits. A second SIGINT ends it at once, and so does any of them before the
first step.

Exit status: 0 the run did what was asked; 1 it failed; 2 the scene or an argument is wrong;
3 a signal stopped it, and it can go on; 4 the stage has done all its steps, but what [stop] asks for does not hold,
or --suggest has found no step that keeps the error."
)]
#[expect(clippy::struct_excessive_bools, reason = "each is a flag of its own")]
struct Arguments {
    /// The scene to simulate, a TOML file
    #[arg(required = true)]
    scene: Option<PathBuf>,
    /// List the keys of a scene with units, defaults and meaning: all, or those of a table such as `domain`
    #[arg(long, value_name = "TABLE", exclusive = true)]
    #[expect(clippy::option_option, reason = "not asked for, asked for all, or for one table")]
    keys: Option<Option<String>>,
    /// Print a JSON schema of scenes, for completion and checks in editors
    #[arg(long, exclusive = true)]
    schema: bool,
    /// Only compare small runs with closed forms and with the bits of the developers' machine, in a few seconds. Files go
    /// into a new folder in DIR, which all ranks see, and are removed; without DIR, into the machine's folder for these
    #[arg(long, value_name = "DIR", exclusive = true)]
    #[expect(clippy::option_option, reason = "not asked for, asked for, or with a folder")]
    self_test: Option<Option<PathBuf>>,
    #[command(flatten)]
    about: About,
    /// Only print volume, centre, moments of inertia, balls and pieces of this shape of the scene. With --out it is also
    /// drawn, from four sides into DIR/NAME.svg and as a surface into DIR/NAME.vtp, in its principal axes
    #[arg(
        long,
        value_name = "NAME",
        conflicts_with_all = ["overwrite", "steps", "start", "threads", "trace_particle", "check", "plan", "suggest", "verbose"]
    )]
    shape: Option<String>,
    /// Output directory, instead of the scene's output.directory
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Remove snapshots, tables, lists and reports of an earlier run from the output directory; otherwise such a directory
    /// is rejected. Output of dem-post there stays
    #[arg(long)]
    overwrite: bool,
    /// Do this many steps from the start of the run, instead of all that are left of the stage. If the stage is over
    /// because its [stop] holds, [stop] is ignored
    #[arg(long, value_name = "N", value_parser = steps, allow_negative_numbers = true)]
    steps: Option<u64>,
    /// Continue from this snapshot of the same stage (a particles file, or a directory for its newest good one). If it is
    /// not in the scene's output.directory, --out sets the output directory
    #[arg(long, value_name = "SNAPSHOT")]
    start: Option<PathBuf>,
    /// Run as N ranks in threads of this process, without mpirun: slower, for debuggers
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=64), allow_negative_numbers = true)]
    threads: Option<u32>,
    /// Print the state and the contacts of this particle at every step (may be repeated)
    #[arg(long, value_name = "ID", allow_negative_numbers = true)]
    trace_particle: Vec<u64>,
    /// Change a value of the scene: path.to.key=value (may be repeated)
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Only check the scene for errors
    #[arg(long)]
    check: bool,
    /// Only print the models, the cost and the parts left out of the run
    #[arg(long)]
    plan: bool,
    /// Only print the stiffness of a periodic cell, 6 x 6: of the state of --start, of the scene's start, or of its fill. Each
    /// component is strained by STRAIN both ways, and the particles come to rest. The snapshot must be at rest. Writes no file
    #[arg(
        long,
        value_name = "STRAIN",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "1e-6",
        value_parser = share,
        conflicts_with_all = ["out", "overwrite", "steps", "trace_particle", "check", "plan", "suggest", "verbose", "shape"]
    )]
    probe: Option<f64>,
    /// Only propose a step and a contact method that keep an error, from trials on one rank; with --start, from that state.
    ///
    /// The error is that of a trial against the same trial with converged settings, the largest of three: the mean stress
    /// of the contacts and the mean coordination number, both relative and averaged over the trial's last fifth, and the
    /// energy error at its end, over the dissipated energy (or over the largest kinetic and elastic energy, if that is
    /// more).
    ///
    /// A trial lasts 20000 steps of the stable limit, or 4e6 over the number of particles if that is less, but at least
    /// 400; or the whole stage, if that is shorter. Some 15 trials run, each shorter step twice as long as the one before.
    /// They also give the difference between runs with nearly equal starts (the floor): no step can promise a smaller error
    /// for single values.
    ///
    /// Prints lines for the scene, with the expected error and run time. Writes no file
    #[arg(long, conflicts_with_all = ["out", "overwrite", "steps", "threads", "trace_particle", "check", "plan", "verbose"])]
    suggest: bool,
    /// Accepted error of --suggest: 1% or 0.01
    #[arg(long, value_name = "SHARE", default_value = "1%", requires = "suggest", value_parser = share, allow_hyphen_values = true)]
    error: f64,
    /// Print the whole report at the end, instead of its first four lines; report.json always has all of it
    #[arg(long)]
    verbose: bool,
}

impl Arguments {
    /// The scene's file; empty with the options that only print.
    fn scene(&self) -> &Path {
        self.scene.as_deref().unwrap_or_else(|| Path::new(""))
    }
}

/// A number of steps in the notation of a scene: 20000, 20_000 or 2e4.
fn steps(given: &str) -> Result<u64, String> {
    let plain = given.replace('_', "");
    let whole = |number: &f64| number.fract() == 0.0 && (0.0..2.0_f64.powi(53)).contains(number);
    plain
        .parse()
        .or_else(|_| plain.parse().ok().filter(whole).map(|number: f64| number as u64).ok_or(()))
        .map_err(|()| "must be a whole number, such as 20000, 20_000 or 2e4".to_owned())
}

/// A share of one: 1% or 0.01.
fn share(given: &str) -> Result<f64, String> {
    let (number, of) = given.trim().strip_suffix('%').map_or((given, 1.0), |part| (part, 100.0));
    let share = number.trim().parse().ok().map(|number: f64| number / of);
    share
        .filter(|share| *share > 0.0 && *share < 1.0)
        .ok_or_else(|| "must be more than 0 and less than 1, such as 1% or 0.01".to_owned())
}

/// Time that a rank waits for the owner of a particle to report its fault first.
const OTHERS_FIRST: Duration = Duration::from_secs(3);

fn main() -> ExitCode {
    arguments::outlive_limits_of_files();
    if let Err(error) = linked::one_mpi() {
        if linked::speaks() {
            print_error(error);
        }
        return ExitCode::from(FAILED);
    }
    if std::env::args_os().nth(1).is_some_and(|word| word == "sweep") {
        return ExitCode::from(swept(Sweep::try_parse_from(std::env::args_os().skip(1))));
    }
    let arguments = Arguments::try_parse();
    if !world::launched()
        && let Ok(given @ Arguments { threads: Some(ranks), .. }) = &arguments
    {
        return ExitCode::from(threads::run(*ranks, |comm| start(given, comm))[0]);
    }
    let mut comm: Box<dyn Comm> =
        if world::launched() { Box::new(world::World::new()) } else { Box::<Alone>::default() };
    ExitCode::from(on_this_rank(arguments, &mut *comm))
}

/// Runs a scene many times, in processes of their own.
fn swept(sweep: Result<Sweep, clap::Error>) -> u8 {
    if world::launched() {
        if linked::speaks() {
            print_error(
                "a sweep starts mpirun itself: leave it out, and give the ranks of each run by --ranks N",
            );
        }
        return WRONG_INPUT;
    }
    match sweep {
        Err(error) => arguments::ended_by(&error),
        Ok(sweep) => sweep.run(&stop_signals()).unwrap_or_else(|error| {
            print_error(error);
            WRONG_INPUT
        }),
    }
}

/// Holds the number of the signal that asks the run to stop. A second Ctrl-C does not wait for the step. Before the first
/// call, signals end the program at once: a run that has not begun loses nothing.
fn stop_signals() -> Arc<AtomicUsize> {
    static STOP: OnceLock<Arc<AtomicUsize>> = OnceLock::new();
    Arc::clone(STOP.get_or_init(noted_signals))
}

/// Records signals from now on.
fn noted_signals() -> Arc<AtomicUsize> {
    let stop = Arc::default();
    let interrupted = Arc::<AtomicBool>::default();
    for signal in [SIGTERM, SIGUSR1, SIGUSR2, SIGHUP, SIGINT] {
        // Under nohup a run continues after its terminal closes.
        if signal == SIGHUP && is_ignored(signal) {
            continue;
        }
        let twice = if signal == SIGINT {
            // In this order: the first handler must find the flag unset.
            signal_hook::flag::register_conditional_default(signal, Arc::clone(&interrupted))
                .and_then(|_| signal_hook::flag::register(signal, Arc::clone(&interrupted)))
                .map(drop)
        } else {
            Ok(())
        };
        let set = twice.and_then(|()| {
            signal_hook::flag::register_usize(signal, Arc::clone(&stop), signal as usize)
        });
        if let Err(error) = set {
            print_error(format_args!("signal {signal} will end the run at once: {error}"));
        }
    }
    stop
}

/// Was a signal ignored by the parent process?
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}

fn on_this_rank(arguments: Result<Arguments, clap::Error>, comm: &mut dyn Comm) -> u8 {
    match arguments {
        Ok(arguments) if arguments.threads.is_some() => {
            print_once(comm, "--threads N replaces mpirun: leave one of them out");
            WRONG_INPUT
        }
        Ok(arguments) => start(&arguments, comm),
        Err(error) if comm.is_root() => arguments::ended_by(&error),
        Err(error) => u8::from(error.use_stderr()) * WRONG_INPUT,
    }
}

/// Prints a message once, on rank 0.
fn print_once(comm: &dyn Comm, text: impl std::fmt::Display) {
    if comm.is_root() {
        print_error(text);
    }
}

/// Reads the scene on rank 0 and sends it, or its errors, to all ranks.
fn read_scene(arguments: &Arguments, comm: &mut dyn Comm) -> Result<Scene, String> {
    let mut bytes = Vec::new();
    if comm.is_root() {
        let Arguments { set, start, out, .. } = arguments;
        let read = match start {
            Some(snapshot) => Scene::read_to_go_on(arguments.scene(), set, snapshot),
            None => Scene::read(arguments.scene(), set),
        };
        let read = read.map_err(|e| e.to_string());
        let of_this_stage = |scene: Scene| match start.as_ref().zip(scene.start.as_ref()) {
            // Stages may share a folder.
            Some((given, before))
                if folder(given).is_some_and(|f| Some(f) == folder(before))
                    && folder(given) != folder(out.as_ref().unwrap_or(&scene.out)) =>
            {
                Err(format!(
                    "--start {}: this is the stage before, the scene's `start`. Omit --start to begin from its end, \
                     or give a snapshot of this stage",
                    given.display()
                ))
            }
            _ => Ok(scene),
        };
        bytes = wire::encode(&read.and_then(of_this_stage));
    }
    comm.broadcast(&mut bytes);
    wire::decode(&bytes)
}

/// Text to print instead of a run, if any.
fn printed(arguments: &Arguments) -> Option<Result<String, String>> {
    if let Some(table) = &arguments.keys {
        return Some(keys::text(table.as_deref()));
    }
    if arguments.schema {
        return Some(Ok(format!("{:#}\n", schema::schema())));
    }
    arguments.about.text(Arguments::command().subcommand(Sweep::command())).map(Ok)
}

/// Prints a text on rank 0, and returns the exit status: `status`, unless it cannot be printed.
fn print(comm: &dyn Comm, text: impl std::fmt::Display, status: u8) -> u8 {
    if !comm.is_root() {
        return status;
    }
    match arguments::print(&text.to_string()) {
        Ok(()) => status,
        Err(error) => {
            print_error(unprinted(&error));
            if status == 0 { FAILED } else { status }
        }
    }
}

fn unprinted(error: &std::io::Error) -> String {
    format!("cannot write to standard output: {error}")
}

/// Folder of a snapshot, or the folder itself, if it exists.
fn folder(snapshot: &Path) -> Option<PathBuf> {
    let folder = if snapshot.is_dir() { snapshot } else { snapshot.parent()? };
    let folder = if folder == Path::new("") { Path::new(".") } else { folder };
    folder.canonicalize().ok()
}

fn start(arguments: &Arguments, comm: &mut dyn Comm) -> u8 {
    match printed(arguments) {
        Some(Ok(text)) => return print(comm, text, 0),
        Some(Err(error)) => {
            print_once(comm, error);
            return WRONG_INPUT;
        }
        None => {}
    }
    if let Some(within) = &arguments.self_test {
        return self_tested(within.as_deref(), comm);
    }
    if arguments.suggest {
        return suggested(arguments, comm);
    }
    let scene = match read_scene(arguments, comm) {
        Ok(scene) => scene,
        Err(errors) => {
            print_once(comm, errors);
            return WRONG_INPUT;
        }
    };
    if let Some(name) = &arguments.shape {
        return shape(name, &scene, arguments.out.as_deref(), comm);
    }
    if arguments.plan {
        return planned(arguments, &scene, comm);
    }
    if let Some(strain) = arguments.probe {
        return probed(arguments, &scene, strain, comm);
    }
    if arguments.check && scene.start.is_none() && arguments.start.is_none() {
        let tried = tried(arguments, &scene, comm);
        return tried.map_or_else(|status| status, |_| checked(arguments, comm));
    }
    simulated(arguments, &scene, comm).unwrap_or_else(|status| status)
}

/// Prints the plan, checks that the scene can begin, and measures the time of its first steps.
fn planned(arguments: &Arguments, scene: &Scene, comm: &mut dyn Comm) -> u8 {
    let page = comm.is_root().then(|| plan::plan(scene, comm.size()));
    let printed = print(comm, page.unwrap_or_default(), 0);
    if let Err(status) = agree(comm, if printed == 0 { Ok(()) } else { Err(printed) }) {
        return status;
    }
    // Restoring the state checks that it fits the scene.
    let begun = if scene.start.is_some() || arguments.start.is_some() {
        state(arguments, scene, comm).and_then(|(mut sim, _)| {
            begins(arguments, scene, &mut sim, comm)?;
            Ok(Some(sim))
        })
    } else {
        tried(arguments, scene, comm)
    };
    let timed = begun.and_then(|sim| sim.map_or(Ok(()), |sim| timed(arguments, scene, sim, comm)));
    timed.err().unwrap_or(printed)
}

/// Particle-steps of the next steps.
fn workload(scene: &Scene, sim: &Simulation, steps: u64, comm: &mut dyn Comm) -> Workload {
    let mut held = [sim.particles.owned as i64];
    comm.sum(&mut held);
    Workload::new(scene, held[0].unsigned_abs(), sim.step - sim.stage_begin.0, steps)
}

/// Prints the expected run time, by the pace of the first steps.
fn timed(
    arguments: &Arguments,
    scene: &Scene,
    mut sim: Simulation,
    comm: &mut dyn Comm,
) -> Result<(), u8> {
    let done = sim.step - sim.stage_begin.0;
    let steps = arguments.steps.unwrap_or_else(|| scene.steps_of(&sim).saturating_sub(done));
    let workload = workload(scene, &sim, steps, comm);
    let pace = run::pace(&mut sim, steps, comm);
    let pace = pace.map_err(|error| failed(&error, "", owned(&sim), false, comm))?;
    print(comm, plan::run_time(scene, &workload, &pace, comm.size()), 0);
    Ok(())
}

/// Prints the stiffness of a cell, and returns the exit status.
fn probed(arguments: &Arguments, scene: &Scene, strain: f64, comm: &mut dyn Comm) -> u8 {
    let start = arguments.start.as_deref().or(scene.start.as_deref());
    match probe(scene, start, strain, comm) {
        Ok(probe) => print(comm, probe.words(), 0),
        Err(ProbeError::Step(error)) => failed(&error.into(), "", &[], false, comm),
        Err(error) => rejected(comm, error),
    }
}

/// Tests this program, and returns the exit status.
fn self_tested(within: Option<&Path>, comm: &mut dyn Comm) -> u8 {
    let within = within.map_or_else(std::env::temp_dir, Path::to_owned);
    let mut id = std::process::id().to_string().into_bytes();
    comm.broadcast(&mut id);
    let folder = within.join(format!("dem-mpi-self-test-{}", String::from_utf8_lossy(&id)));
    let results = output::claim(&folder, comm)
        .map_err(|error| error.to_string())
        .and_then(|_held| self_test(&folder, comm).map_err(|error| error.to_string()));
    if comm.is_root() {
        // A folder that stays is no fault of the program.
        let _ = std::fs::remove_dir_all(&folder);
    }
    match results {
        Ok(Results { text, passed }) => {
            let verdict = if passed { "all tests passed" } else { "TESTS FAILED" };
            let status = if passed { 0 } else { FAILED };
            let ranks = counted(comm.size(), "rank");
            print(comm, format!("Self-test on {ranks}\n{text}{verdict}\n"), status)
        }
        Err(error) => {
            print_once(comm, error);
            FAILED
        }
    }
}

/// Prints an error of the input, and returns its exit status.
fn rejected(comm: &dyn Comm, error: impl std::fmt::Display) -> u8 {
    print_once(comm, error);
    WRONG_INPUT
}

/// Runs the scene, or checks that it continues from its snapshot. Returns the exit status; as an error if nothing has run.
fn simulated(arguments: &Arguments, scene: &Scene, comm: &mut dyn Comm) -> Result<u8, u8> {
    let out = arguments.out.clone().unwrap_or_else(|| scene.out.clone());
    if let Some(elsewhere) = goes_on_elsewhere(arguments, &out) {
        return Err(rejected(comm, elsewhere));
    }
    // A check writes nothing.
    let claimed = (!arguments.check).then(|| output::claim(&out, comm)).transpose();
    let _held_until_the_end = claimed.map_err(|error| rejected(comm, error))?;
    let (mut sim, held) = state(arguments, scene, comm)?;
    has_columns(arguments, scene, &sim, comm)?;
    if arguments.check {
        begins(arguments, scene, &mut sim, comm)?;
        return Ok(checked(arguments, comm));
    }
    let resumed = arguments.start.is_some();
    let stage_end = sim.stage_begin.0.saturating_add(scene.steps_of(&sim));
    let last_step = arguments.steps.map_or(stage_end, |steps| sim.step.saturating_add(steps));
    if resumed && let Some((why, status)) = nothing_left(arguments, scene, &sim, &held, last_step) {
        print_once(comm, format!("nothing left to do: {why}"));
        return Err(status);
    }
    let is_over = resumed && is_over(scene, &sim, &held);
    make_room(arguments, scene, sim.step, &out, comm)?;
    let schedule = Schedule {
        last_step,
        ends_stage: last_step == stage_end,
        snapshot_every: scene.snapshot_every,
        snapshot_every_minutes: scene.snapshot_every_minutes,
        history_every: scene.history_every,
        // More steps were requested than [stop] leaves.
        stop: if is_over { Stop::default() } else { scene.stop.clone() },
        out,
        scene: scene.text.clone(),
        resumed,
        signal: stop_signals(),
        traced: arguments.trace_particle.iter().map(|&id| GlobalId(id)).collect(),
        // A requested number of steps is kept.
        duration: scene.duration.filter(|_| arguments.steps.is_none()),
        over: scene.over_the_limit(),
    };
    let finish = run(&mut sim, scene, &schedule, arguments, comm)?;
    if !finish.unmet.is_empty() {
        return Ok(UNMET);
    }
    Ok(ended(arguments, &finish, sim.step, last_step, comm))
}

/// Makes sure that the folder has no later snapshots, which `--overwrite` removes, and warns of pages of the run before.
fn make_room(
    arguments: &Arguments,
    scene: &Scene,
    step: u64,
    out: &Path,
    comm: &mut dyn Comm,
) -> Result<(), u8> {
    let Arguments { overwrite, start, .. } = arguments;
    let before = if start.is_some() { None } else { scene.start.as_deref() };
    let kept = snapshot::none_later(out, step, *overwrite, start.as_deref(), before, comm);
    kept.map_err(|error| rejected(comm, error))?;
    if *overwrite && start.is_none() {
        for post in ["post", "post_series"].map(|name| out.join(name)).iter().filter(|p| p.exists())
        {
            let post = post.display();
            print_once(comm, format!("warning: {post} is of the run before: run dem-post again"));
        }
    }
    Ok(())
}

/// Prints the page of a shape, and draws it into a folder, if one is given.
fn shape(name: &str, scene: &Scene, folder: Option<&Path>, comm: &dyn Comm) -> u8 {
    let id = match scene.shape(name) {
        Ok(id) => id,
        Err(error) => {
            print_once(comm, error);
            return WRONG_INPUT;
        }
    };
    let mut text = one_shape::page(scene, id);
    if let Some(folder) = folder.filter(|_| comm.is_root()) {
        match one_shape::draw(scene, id, folder) {
            Ok([svg, vtp]) => {
                let _ = writeln!(text, "drawn in {} and {}", svg.display(), vtp.display());
            }
            Err(error) => {
                print_error(error);
                return FAILED;
            }
        }
    }
    print(comm, text, 0)
}

/// Prints the suggestion from trials.
fn suggested(arguments: &Arguments, comm: &dyn Comm) -> u8 {
    if comm.size() > 1 {
        print_once(comm, "--suggest uses one rank: leave mpirun out");
        return WRONG_INPUT;
    }
    let (scene, Arguments { set, start, error, .. }) = (arguments.scene(), arguments);
    let start = start.as_deref();
    let signal = &*stop_signals();
    let question = Question { scene, overrides: set, start, error: *error, signal };
    match suggest::suggest(&question, &mut |line| print_error(line)) {
        Ok(Suggestion { text, is_kept, .. }) => {
            print(comm, format_args!("{text}\n"), if is_kept { 0 } else { UNMET })
        }
        Err(unanswered) => {
            print_error(&unanswered);
            match unanswered {
                TrialError::Input(_) => WRONG_INPUT,
                TrialError::Signal(_) => STOPPED,
                TrialError::Trial(_) | TrialError::Slower => FAILED,
            }
        }
    }
}

/// Simulation at its start, and the `[stop]` that held there.
fn state(
    arguments: &Arguments,
    scene: &Scene,
    comm: &mut dyn Comm,
) -> Result<(Simulation, String), u8> {
    let from = assemble::first_snapshot(scene, arguments.start.as_deref());
    if from.is_none() {
        fits(scene, comm)?;
    }
    let (sim, taken) =
        assemble::started(scene, from, comm).map_err(|error| rejected(comm, error))?;
    if let Some(taken) = &taken {
        print_taken_up(taken, comm);
    }
    Ok((sim, taken.map(|taken| taken.stop).unwrap_or_default()))
}

/// Exit status of a run that ended normally; prints how to continue after a signal.
fn ended(arguments: &Arguments, finish: &Finish, step: u64, last_step: u64, comm: &dyn Comm) -> u8 {
    let Ending::Signal(signal) = finish.ending else { return 0 };
    let name = signal_hook::low_level::signal_name(signal as i32).unwrap_or("a signal");
    let left = arguments.steps.map(|_| last_step - step);
    let again = again(arguments, &finish.snapshot, left);
    print_once(comm, format!("stopped by {name} at step {step}; to continue: {again}"));
    STOPPED
}

/// Prints the snapshots that were passed over, and the walls that are not where the scene puts them.
fn print_taken_up(taken: &RestartInfo, comm: &dyn Comm) {
    for error in &taken.passed_over {
        print_once(comm, format!("skipped: {error}"));
    }
    if !taken.walls_elsewhere.is_empty() {
        let off = |(name, off): &(String, f64)| format!("{name} by {off:.4e} m");
        let all = listed(taken.walls_elsewhere.iter().map(off), MOST_NAMED);
        print_once(
            comm,
            format!(
                "walls are where the stage before ended, at a distance from the scene's places: {all}"
            ),
        );
    }
    if !taken.forgotten.is_empty() {
        let all = taken.forgotten.join(", ");
        print_once(
            comm,
            format!("warning: contact state that the scene's law does not use is lost: {all}"),
        );
    }
    if !taken.other_walls.is_empty() {
        print_once(
            comm,
            format!(
                "warning: these walls differ from walls of the same names in the snapshot; their places are as in the \
                 scene, and their contacts start anew: {}",
                listed(&taken.other_walls, MOST_NAMED)
            ),
        );
    }
}

/// Checks that every machine has the memory for the initial particles.
fn fits(scene: &Scene, comm: &mut dyn Comm) -> Result<(), u8> {
    let mut least = [-machine_bytes()];
    comm.max(&mut least);
    plan::fits(scene, comm.size(), -least[0]).map_err(|text| {
        print_once(comm, text);
        WRONG_INPUT
    })
}

/// Largest number of particles that are placed when a run is only planned or checked.
const TRIED: u64 = 1_000_000;

/// Places the initial particles of a scene and checks for overlaps, like the run; `None` if they are too many.
fn tried(
    arguments: &Arguments,
    scene: &Scene,
    comm: &mut dyn Comm,
) -> Result<Option<Simulation>, u8> {
    fits(scene, comm)?;
    let count: u64 = scene.initial.iter().map(Fill::count).sum();
    if count > TRIED {
        print_once(
            comm,
            format!("{count} particles are too many for a check of overlaps without a run"),
        );
        return Ok(None);
    }
    let mut sim = assemble::assemble(scene, comm);
    has_columns(arguments, scene, &sim, comm)?;
    assemble::fill(&mut sim, scene, comm);
    run::begin(&mut sim, comm).map_err(|error| failed(&error, "", owned(&sim), false, comm))?;
    Ok(Some(sim))
}

/// Checks that the columns named by `[stop]` exist.
fn has_columns(
    arguments: &Arguments,
    scene: &Scene,
    sim: &Simulation,
    comm: &dyn Comm,
) -> Result<(), u8> {
    scene.stop.check(sim).map_err(|words| {
        print_once(comm, format!("{}: {words}", arguments.scene().display()));
        WRONG_INPUT
    })
}

/// Checks overlaps where a stage begins with a snapshot, and their effect on its step. Continued stages are not checked.
fn begins(
    arguments: &Arguments,
    scene: &Scene,
    sim: &mut Simulation,
    comm: &mut dyn Comm,
) -> Result<(), u8> {
    if arguments.start.is_some() {
        return Ok(());
    }
    run::begin(sim, comm).map_err(|error| failed(&error, "", owned(sim), false, comm))?;
    if let Some(words) = run::follow_limit(sim, scene.over_the_limit(), comm) {
        print_once(comm, format!("warning: {words}"));
    }
    Ok(())
}

/// Reports that no errors were found.
fn checked(arguments: &Arguments, comm: &dyn Comm) -> u8 {
    print(comm, format_args!("{}: no errors found\n", arguments.scene().display()), 0)
}

/// Error for the output folder of a run that continues from a snapshot in another folder, if it was not set explicitly.
fn goes_on_elsewhere(arguments: &Arguments, out: &Path) -> Option<String> {
    let Arguments { start, out: given, set, check, .. } = arguments;
    let start = start.as_deref()?;
    let is_named = given.is_some() || set.iter().any(|change| change.starts_with("output"));
    let before = folder(start).filter(|_| start.exists())?;
    (!is_named && !check && out.canonicalize().ok() != Some(before)).then(|| {
        let named = if start.is_dir() { Some(start) } else { start.parent() };
        let named = named.unwrap_or(start).display();
        format!(
            "--start {}: the scene's output.directory is another folder, {}. Add --out {named} to continue in the \
             folder of the snapshot, or --out {} to begin a new history there",
            start.display(),
            out.display(),
            out.display()
        )
    })
}

/// Is the stage over because its `[stop]` held (`held`) when its snapshot was written?
fn is_over(scene: &Scene, sim: &Simulation, held: &str) -> bool {
    // Additional rain is still to come.
    let all_there = sim.all_observers().all(|drive| drive.standing().unfinished.is_none());
    all_there && !held.is_empty() && held == scene.stop.to_string()
}

/// Reason why a stage does not continue from the restored snapshot, if it does not, and the exit status: a job that is
/// queued once more has done its work. `held` is the `[stop]` that held then.
fn nothing_left(
    arguments: &Arguments,
    scene: &Scene,
    sim: &Simulation,
    held: &str,
    last_step: u64,
) -> Option<(String, u8)> {
    let step = sim.step;
    let is_over = is_over(scene, sim, held);
    if last_step <= step {
        let why = format!(
            "the snapshot is at step {step}, and the stage ends at step {last_step}. For more steps use --steps N or \
             --set time.{}=N",
            if scene.duration.is_some() { "duration" } else { "steps" }
        );
        let status = if last_step < step {
            WRONG_INPUT
        } else if is_over || scene.stop == Stop::default() {
            0
        } else {
            UNMET
        };
        return Some((why, status));
    }
    (arguments.steps.is_none() && is_over).then(|| {
        let why = format!(
            "the stage ended at step {step} by its [stop]: {held}. For more steps use --steps N or a lower limit"
        );
        (why, 0)
    })
}

/// Command, without mpirun, that continues from a snapshot.
fn again(arguments: &Arguments, snapshot: &Path, left: Option<u64>) -> String {
    let (scene, Arguments { out, threads, set, verbose, .. }) = (arguments.scene(), arguments);
    // Quoted, so that a shell reads it as one word.
    let word = |value: String| {
        let plain = |c: char| c.is_ascii_alphanumeric() || "_-+=./,:@".contains(c);
        let is_plain = !value.is_empty() && value.chars().all(plain);
        if is_plain { value } else { format!("'{}'", value.replace('\'', r"'\''")) }
    };
    // A name with a leading dash would be an option.
    let named = |path: &Path| {
        let name = path.display().to_string();
        word(if name.starts_with('-') { format!("./{name}") } else { name })
    };
    let mut words = vec!["dem-mpi".to_owned(), named(scene)];
    let mut add = |name: &str, value: String| words.extend([name.to_owned(), value]);
    for change in set {
        add("--set", word(change.clone()));
    }
    if let Some(out) = out {
        add("--out", named(out));
    }
    if let Some(threads) = threads {
        add("--threads", threads.to_string());
    }
    if let Some(left) = left {
        add("--steps", left.to_string());
    }
    add("--start", named(snapshot));
    if *verbose {
        words.push("--verbose".to_owned());
    }
    words.join(" ")
}

fn run(
    sim: &mut Simulation,
    scene: &Scene,
    schedule: &Schedule,
    arguments: &Arguments,
    comm: &mut dyn Comm,
) -> Result<Finish, u8> {
    print_once(comm, heading(scene, schedule, sim, comm.size()));
    let origin = origin(scene);
    for doubt in &origin.doubts {
        print_once(comm, format!("warning: {doubt}"));
    }
    let steps = schedule.last_step - sim.step;
    let workload = workload(scene, sim, steps, comm);
    let mut display =
        Display::new(comm.is_root(), steps, workload, schedule.stop != Stop::default());
    let finish = run::run(sim, schedule, comm, &mut |progress| display.show(progress));
    let finish = finish.map_err(|error| {
        let before = before_fault(&error, sim.step, schedule, arguments);
        failed(&error, &before, owned(sim), arguments.threads.is_some(), comm)
    })?;
    display.end();
    let unprinted = display.unprinted.take();
    let report = report(sim, &finish, &origin, comm);
    let mut stored = Ok(());
    if comm.is_root() {
        let details =
            if arguments.verbose { format!("\n{}", report.details()) } else { String::new() };
        let summary = report.summary(&schedule.out);
        let printed = arguments::print(&format!("\n{summary}{details}"));
        let row = Performance::of(&report);
        stored = report
            .store(&schedule.out)
            .and_then(|()| row.store(&schedule.out, schedule.resumed))
            .map_err(|error| error.to_string())
            .and_then(|()| {
                printed.err().or(unprinted).map_or(Ok(()), |e| Err(self::unprinted(&e)))
            });
    }
    if let Err(error) = agree(comm, stored) {
        print_once(comm, error);
        return Err(FAILED);
    }
    Ok(finish)
}

/// Title, method, number of ranks and steps of the run.
fn heading(scene: &Scene, schedule: &Schedule, sim: &Simulation, ranks: u32) -> String {
    let limit = scene.time_step_limit().map_or(String::new(), |limit| {
        let share = 100.0 * sim.dt / limit.dt;
        let warning = if share > 100.0 { ": OVER THE LIMIT, the run may be unstable" } else { "" };
        format!(", {share:.0} % of the stable limit{warning}")
    });
    format!(
        "{}: contact method {}, {}, steps {} to {} of {:e} s{limit}",
        scene.title,
        scene.method.name(),
        counted(ranks, "rank"),
        sim.step,
        schedule.last_step,
        sim.dt,
    )
}

/// Line with the command that stops one step before a fault in this step, with a snapshot.
fn before_fault(error: &RunError, step: u64, schedule: &Schedule, arguments: &Arguments) -> String {
    let newest = std::fs::read_link(schedule.out.join("last.vtkhdf")).ok();
    let at = newest.as_deref().and_then(snapshot::step_of);
    match (error, newest, at.and_then(|at| step.checked_sub(at + 1))) {
        (RunError::Step(_) | RunError::Particle { .. }, Some(newest), Some(left)) if left > 0 => {
            let command = again(arguments, &schedule.out.join(newest), Some(left));
            format!("\nTo repeat all steps except the last, and write a snapshot: {command}")
        }
        _ => String::new(),
    }
}

/// Ids of the particles of this rank.
fn owned(sim: &Simulation) -> &[GlobalId] {
    &sim.particles.id[..sim.particles.owned]
}

/// Reports why a run could not go on, and returns the exit status. If only this rank knows, it ends all ranks.
fn failed(
    error: &RunError,
    before: &str,
    owned: &[GlobalId],
    in_threads: bool,
    comm: &dyn Comm,
) -> u8 {
    match error {
        RunError::Step(error) if error.is_agreed() => {
            print_once(comm, format_args!("{error}{before}"));
        }
        RunError::Step(_) | RunError::Table(_) => {
            // Other ranks do not know the error: this one reports it, and ends them.
            if let RunError::Step(StepError::Contact { a, .. }) = error
                && !owned.contains(a)
            {
                // The rank that owns A has the same error, and reports it.
                std::thread::sleep(OTHERS_FIRST);
            }
            print_error(format_args!("rank {}: {error}{before}", comm.rank().0));
            if in_threads {
                std::process::exit(i32::from(FAILED));
            }
            comm.abort(i32::from(FAILED));
        }
        RunError::Start(_) => {
            print_once(comm, error);
            return WRONG_INPUT;
        }
        RunError::Snapshot(_) | RunError::Particle { .. } => {
            print_once(comm, format_args!("{error}{before}"));
        }
    }
    FAILED
}

/// Origin of the run for the report: program and scene.
fn origin(scene: &Scene) -> Origin {
    Origin { commit: commit().map(str::to_owned), ..scene.origin() }
}

/// Progress display: a bar on a terminal, lines at intervals elsewhere, nothing on ranks other than 0.
struct Display {
    bar: Option<ProgressBar>,
    lines: bool,
    workload: Workload,
    /// Words behind the time that is left.
    unless: &'static str,
    begin: Instant,
    last_line: Instant,
    last_state: String,
    /// Reason why lines about traced particles are missing, if any are.
    unprinted: Option<std::io::Error>,
}

/// Time for the rest of a run, after this part of its steps in this time.
fn time_left(workload: &Workload, part: f64, past: Duration) -> HumanDuration {
    let seconds = past.as_secs_f64() * workload.left(part);
    HumanDuration(Duration::from_secs(seconds.clamp(0.0, 1e15) as u64))
}

/// Interval of lines without a terminal.
const LINE_EVERY: Duration = Duration::from_secs(10);

impl Display {
    fn new(is_root: bool, steps: u64, workload: Workload, may_stop: bool) -> Self {
        let unless = if may_stop { " or less, by [stop]" } else { "" };
        let bar = (is_root && std::io::stderr().is_terminal()).then(|| {
            // The message is shortened if the terminal is narrow.
            let style =
                "{elapsed} [{bar:12}] {percent} % of {len} steps, {rate}, {left}; {wide_msg}";
            let style = ProgressStyle::with_template(style)
                .unwrap_or_else(|_| ProgressStyle::default_bar());
            let rate = |state: &ProgressState, text: &mut dyn std::fmt::Write| {
                let _ = write!(text, "{:.0} steps/s", state.per_sec());
            };
            let of_bar = workload.clone();
            let left = move |state: &ProgressState, text: &mut dyn std::fmt::Write| {
                let _ = write!(
                    text,
                    "{} left{unless}",
                    time_left(&of_bar, state.fraction().into(), state.elapsed())
                );
            };
            let style = style.with_key("rate", rate).with_key("left", left);
            ProgressBar::new(steps).with_style(style)
        });
        let lines = is_root && bar.is_none();
        let now = Instant::now();
        let last_state = String::new();
        Self {
            bar,
            lines,
            workload,
            unless,
            begin: now,
            last_line: now,
            last_state,
            unprinted: None,
        }
    }

    fn show(&mut self, progress: &Progress) {
        if !progress.trace.is_empty() {
            // The run continues; its exit status reports the error.
            self.unprinted = arguments::print(progress.trace).err().or(self.unprinted.take());
        }
        if self.bar.is_none() && !self.lines {
            return;
        }
        for warning in progress.warnings {
            let text = format!("warning: {warning}");
            self.bar
                .as_ref()
                .map_or_else(|| print_error(&text), |bar| bar.println(printable(&text)));
        }
        if let Some(m) = progress.measures {
            self.last_state = format!(
                "{} particles, {:.2} contacts each, kinetic {:.1e} J",
                m.particles,
                m.coordination(),
                m.kinetic()
            );
        }
        if let Some(bar) = &self.bar {
            if progress.done.is_multiple_of(32) || progress.done == progress.of {
                bar.set_length(progress.of);
                bar.set_position(progress.done);
                bar.set_message(self.last_state.clone());
            }
        } else if self.last_line.elapsed() > LINE_EVERY {
            self.last_line = Instant::now();
            let Progress { done, of, .. } = *progress;
            // The time per step is unknown before the first step.
            let pace = if done == 0 {
                "remaining time not yet known".to_owned()
            } else {
                let past = self.begin.elapsed();
                let left = time_left(&self.workload, done as f64 / of as f64, past);
                let unless = self.unless;
                format!("{:.1} steps/s, {left} left{unless}", done as f64 / past.as_secs_f64())
            };
            let percent = 100.0 * done as f64 / of as f64;
            print_error(format_args!(
                "{done} of {of} steps, {percent:.1} %, {pace}; {}",
                self.last_state
            ));
        }
    }

    fn end(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
