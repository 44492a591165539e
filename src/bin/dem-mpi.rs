//! `dem-mpi SCENE`: arguments → scene → simulation → run.

use clap::Parser;
use dem_mpi::comm::{Comm, alone::Alone, wire, world};
use dem_mpi::output;
use dem_mpi::scene::assemble::{self, From};
use dem_mpi::scene::{Scene, plan};
use dem_mpi::sim::run::{self, Progress, RunError, Schedule};
use dem_mpi::sim::{Simulation, report::report};
use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Discrete element method for non-spherical grains, on one rank or many.
#[derive(Parser, Debug)]
#[command(
    version,
    // Under mpirun standard output looks like a terminal even where it ends in a file.
    color = clap::ColorChoice::Never,
    after_help = "\
Examples:
  dem-mpi run/packing/scene.toml                     one rank, to try or to debug
  mpirun -n 2 dem-mpi run/packing/scene.toml         two ranks, the same bits
  dem-mpi run/packing/scene.toml --plan              what the scene uses, and what it leaves out
  dem-mpi run/packing/scene.toml --set contact.method=epa --set material.glass.friction=0.5
  mpirun -n 4 dem-mpi run/packing/scene.toml --start out/packing/last.vtkhdf
                                                     go on where a run stopped, on any number of ranks

Exit status: 0 the run did what was asked; 1 it failed; 2 the scene or an argument is wrong."
)]
struct Arguments {
    /// The scene: what to simulate, a TOML file
    scene: PathBuf,
    /// Where output goes, instead of the scene's output.directory
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Do this many steps, from wherever the run starts, instead of all that are left of the stage
    #[arg(long, value_name = "N")]
    steps: Option<u64>,
    /// Go on from this snapshot of the same stage (a particles file, or a directory with last.vtkhdf)
    #[arg(long, value_name = "SNAPSHOT")]
    start: Option<PathBuf>,
    /// Change a value of the scene: path.to.key=value (may be repeated)
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Only look for errors in the scene
    #[arg(long)]
    check: bool,
    /// Only say what the run would use, need and leave out
    #[arg(long)]
    plan: bool,
}

/// The scene or an argument is wrong: all ranks know, rank 0 has the message.
const WRONG_INPUT: u8 = 2;
/// The run failed.
const FAILED: u8 = 1;

fn main() -> ExitCode {
    let mut comm: Box<dyn Comm> =
        if world::launched() { Box::new(world::World::new()) } else { Box::<Alone>::default() };
    let comm = &mut *comm;
    let status = match Arguments::try_parse() {
        Ok(arguments) => start(&arguments, comm),
        Err(error) => {
            if comm.is_root() {
                let _ = error.print();
            }
            if error.use_stderr() { WRONG_INPUT } else { 0 }
        }
    };
    ExitCode::from(status)
}

/// Says something once, however many ranks there are.
fn say(comm: &dyn Comm, text: impl std::fmt::Display) {
    if comm.is_root() {
        eprintln!("{text}");
    }
}

/// Reads the scene on rank 0 and hands it, or the errors in it, to all.
fn read_scene(arguments: &Arguments, comm: &mut dyn Comm) -> Result<Scene, String> {
    let mut bytes = Vec::new();
    if comm.is_root() {
        let scene = Scene::read(&arguments.scene, &arguments.set).map_err(|e| e.to_string());
        bytes = wire::encode(&scene);
    }
    comm.broadcast(&mut bytes);
    wire::decode(&bytes)
}

fn start(arguments: &Arguments, comm: &mut dyn Comm) -> u8 {
    let scene = match read_scene(arguments, comm) {
        Ok(scene) => scene,
        Err(errors) => {
            say(comm, errors);
            return WRONG_INPUT;
        }
    };
    if arguments.plan {
        if comm.is_root() {
            println!("{}", plan::plan(&scene, comm.size()));
        }
        return 0;
    }
    if arguments.check {
        if comm.is_root() {
            println!("{}: no errors found", arguments.scene.display());
        }
        return 0;
    }

    let out = arguments.out.clone().unwrap_or_else(|| scene.out.clone());
    if let Err(error) = output::make_directory(&out, comm) {
        say(comm, error);
        return WRONG_INPUT;
    }
    let mut sim = assemble::assemble(&scene, comm);
    let from = arguments
        .start
        .as_ref()
        .map(|path| (path, From::Middle))
        .or_else(|| scene.start.as_ref().map(|path| (path, From::Beginning)));
    match from {
        None => assemble::fill(&mut sim, &scene, comm),
        Some((path, from)) => {
            if let Err(error) = assemble::take_up(&mut sim, &scene, path, from, comm) {
                say(comm, error);
                return WRONG_INPUT;
            }
        }
    }
    let resumed = arguments.start.is_some();

    let last_step = match arguments.steps {
        Some(steps) => sim.step + steps,
        None => sim.stage_begin.0 + scene.steps,
    };
    if resumed && last_step <= sim.step {
        say(
            comm,
            format!(
                "nothing left to do: the snapshot is at step {}, and the stage ends at step {last_step}. \
             Ask for more with --steps N or --set time.steps=N",
                sim.step
            ),
        );
        return WRONG_INPUT;
    }
    let schedule = Schedule {
        last_step,
        snapshot_every: scene.snapshot_every,
        history_every: scene.history_every,
        rest: scene.rest,
        out,
        scene: scene.text.clone(),
        resumed,
    };
    run(&mut sim, &scene, &schedule, comm)
}

fn run(sim: &mut Simulation, scene: &Scene, schedule: &Schedule, comm: &mut dyn Comm) -> u8 {
    let ranks = comm.size();
    say(
        comm,
        format!(
            "{}: {} on {ranks} rank{}, steps {} to {}",
            scene.title,
            scene.method.name(),
            if ranks == 1 { "" } else { "s" },
            sim.step,
            schedule.last_step,
        ),
    );
    let mut display = Display::new(comm.is_root(), schedule.last_step - sim.step);
    let finish = match run::run(sim, schedule, comm, &mut |progress| display.show(progress)) {
        Ok(finish) => finish,
        Err(RunError::Step(error)) if error.is_agreed() => {
            say(comm, error);
            return FAILED;
        }
        Err(error @ (RunError::Step(_) | RunError::History(_))) => {
            // Only this rank knows: it speaks, and ends the others.
            eprintln!("rank {}: {error}", comm.rank().0);
            comm.abort(i32::from(FAILED));
        }
        Err(error @ RunError::Overlap(_)) => {
            say(comm, error);
            return WRONG_INPUT;
        }
        Err(error @ RunError::Snapshot(_)) => {
            say(comm, error);
            return FAILED;
        }
    };
    display.end();
    let text = report(sim, &finish, comm);
    if comm.is_root() {
        print!("\n{text}\nsnapshot   {}\n", finish.snapshot.display());
    }
    0
}

/// A bar on a terminal, a line now and then elsewhere; nothing on ranks other than 0.
struct Display {
    bar: Option<ProgressBar>,
    lines: bool,
    last_line: Instant,
    last_state: String,
}

/// How often a line is printed where there is no terminal.
const LINE_EVERY: Duration = Duration::from_secs(10);

impl Display {
    fn new(is_root: bool, steps: u64) -> Self {
        let bar = (is_root && std::io::stderr().is_terminal()).then(|| {
            let style = "{elapsed_precise} [{bar:30}] {percent}% {pos}/{len} steps, {per_sec}, {eta} left  {msg}";
            let style = ProgressStyle::with_template(style).unwrap_or_else(|_| ProgressStyle::default_bar());
            ProgressBar::new(steps).with_style(style)
        });
        let lines = is_root && bar.is_none();
        Self { bar, lines, last_line: Instant::now(), last_state: String::new() }
    }

    fn show(&mut self, progress: &Progress) {
        if self.bar.is_none() && !self.lines {
            return;
        }
        if let Some(m) = progress.measures {
            self.last_state = format!(
                "{} particles, {:.2} contacts each, kinetic {:.1e} J, dissipated {:.1e} J",
                m.particles,
                m.coordination(),
                m.kinetic(),
                m.dissipated
            );
        }
        if let Some(bar) = &self.bar {
            if progress.done.is_multiple_of(32) || progress.done == progress.of {
                bar.set_position(progress.done);
                bar.set_message(self.last_state.clone());
            }
        } else if self.last_line.elapsed() > LINE_EVERY {
            self.last_line = Instant::now();
            eprintln!("step {} of {}: {}", progress.done, progress.of, self.last_state);
        }
    }

    fn end(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
