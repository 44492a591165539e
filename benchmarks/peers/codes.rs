//! Input and output of each code.

use crate::case::Case;
use anyhow::{Context, bail, ensure};
use dem_mpi::math::Vec3;
use dem_mpi::output::snapshot;
use dem_mpi::random::Random;
use serde_json::Value;
use std::fmt::Write;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// A program, with its contact law.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Code {
    /// This program.
    Own,
    /// This program with `foresee`.
    OwnForesees,
    /// This program, with the spheres in a random order.
    OwnShuffled,
    /// This program without AVX-512.
    OwnAvx,
    /// This program with registers that every processor has.
    OwnAny,
    /// `gran/hooke/history`.
    Lammps,
    /// `granular`, with `hooke` and `linear_history`.
    LammpsGranular,
    /// `hooke/stiffness` with `tangential history`.
    Liggghts,
}

impl Code {
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Own => "dem-mpi",
            Self::OwnForesees => "dem-mpi foresee",
            Self::OwnShuffled => "dem-mpi shuffled",
            Self::OwnAvx => "dem-mpi avx",
            Self::OwnAny => "dem-mpi any",
            Self::Lammps => "lammps",
            Self::LammpsGranular => "lammps granular",
            Self::Liggghts => "liggghts",
        }
    }

    /// Whether the code is this program.
    pub(crate) const fn is_own(self) -> bool {
        !matches!(self, Self::Lammps | Self::LammpsGranular | Self::Liggghts)
    }

    /// Widest registers that it may use, see `dem_mpi::lanes::Registers`.
    const fn registers(self) -> &'static str {
        match self {
            Self::OwnAvx => "avx",
            Self::OwnAny => "any",
            _ => "avx512",
        }
    }

    const fn program(self) -> &'static str {
        match self {
            Self::Lammps | Self::LammpsGranular => "lmp",
            Self::Liggghts => "liggghts",
            _ => env!("CARGO_BIN_EXE_dem-mpi"),
        }
    }

    const fn deck(self) -> &'static str {
        match self {
            Self::Lammps => "lammps.in",
            Self::LammpsGranular => "lammps_granular.in",
            Self::Liggghts => "liggghts.in",
            _ => "",
        }
    }

    /// Whether the program is installed.
    pub(crate) fn is_installed(self) -> bool {
        let mut command = Command::new(self.program());
        // LIGGGHTS writes a log in its current directory.
        command.current_dir(std::env::temp_dir());
        command.arg("-help").stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        !command.status().is_err_and(|error| error.kind() == ErrorKind::NotFound)
    }

    /// The line with its version.
    pub(crate) fn version(self) -> anyhow::Result<String> {
        let (argument, word) = match self {
            Self::Lammps | Self::LammpsGranular => ("-help", "Parallel Simulator"),
            Self::Liggghts => ("-help", "LIGGGHTS"),
            _ => return Ok(concat!("dem-mpi ", env!("CARGO_PKG_VERSION")).to_owned()),
        };
        let output = Command::new(self.program())
            .arg(argument)
            .current_dir(std::env::temp_dir())
            .stdin(Stdio::null())
            .output()?;
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        let line = text.lines().find(|line| line.contains(word)).unwrap_or("unknown");
        Ok(line.trim().to_owned())
    }
}

/// Length of a run.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Steps {
    /// Time step [s].
    pub(crate) step: f64,
    pub(crate) count: u64,
    pub(crate) ranks: u32,
}

impl Steps {
    /// Steps on one rank for this time [s].
    pub(crate) fn until(time: f64, step: f64) -> Self {
        Self { step, count: (time / step).round() as u64, ranks: 1 }
    }
}

/// Results of a run.
pub(crate) struct Run {
    /// Final centres, in the order of the start [m].
    pub(crate) end: Vec<Vec3>,
    /// Wall time of the steps, by the clock of the code [s].
    pub(crate) seconds: f64,
    /// CPU time of all processes, including start and reading [s].
    pub(crate) cpu: f64,
}

/// Runs a code.
pub(crate) fn run(code: Code, case: &Case, steps: Steps) -> anyhow::Result<Run> {
    // A folder of this process: two calls of this program do not interfere.
    let folder = std::env::temp_dir().join(format!("dem-mpi-peers-{}", std::process::id()));
    fs::create_dir_all(&folder)?;
    let run = if code.is_own() {
        own_case(code, case, steps, &folder)
    } else {
        peer_case(code, case, steps, &folder)
    };
    fs::remove_dir_all(&folder)?;
    run.with_context(|| format!("{}, {steps:?}", code.name()))
}

fn own_case(code: Code, case: &Case, steps: Steps, folder: &Path) -> anyhow::Result<Run> {
    let mut order: Vec<usize> = (0..case.start.len()).collect();
    if code == Code::OwnShuffled {
        order.sort_by_key(|&k| Random::of(1, k as u64).unit().to_bits());
    }
    let mut text = String::from("x,y,z\n");
    for &k in &order {
        let [x, y, z] = case.start[k].into();
        writeln!(text, "{x},{y},{z}")?;
    }
    let spheres = folder.join("spheres.csv");
    fs::write(&spheres, text)?;
    let [x, y, z] = case.high.into();
    let keys = [
        ("domain.high", format!("[{x}, {y}, {z}]")),
        ("fill.file.0.path", spheres.display().to_string()),
        ("time.step", format!("{:e}", steps.step)),
        ("time.steps", steps.count.to_string()),
        ("law.foresee", (code == Code::OwnForesees).to_string()),
    ];
    let mut run = own(code, &case.file, &keys, steps.ranks, folder)?;
    let mut end = vec![Vec3::zeros(); order.len()];
    order.iter().zip(&run.end).for_each(|(&k, place)| end[k] = *place);
    run.end = end;
    Ok(run)
}

/// Runs this program on a scene with these keys changed, with output in the subfolder `own`; positions are
/// in the order of the ids.
pub(crate) fn own(
    code: Code,
    scene: &Path,
    keys: &[(&str, String)],
    ranks: u32,
    folder: &Path,
) -> anyhow::Result<Run> {
    let out = folder.join("own");
    if out.exists() {
        fs::remove_dir_all(&out)?;
    }
    let mut arguments = vec![scene.display().to_string()];
    arguments.extend(keys.iter().map(|(key, value)| format!("--set={key}={value}")));
    arguments.push(format!("--out={}", out.display()));
    let (_, cpu) = say(code, &arguments, ranks)?;

    let report: Value = serde_json::from_str(&fs::read_to_string(out.join("report.json"))?)?;
    let number = |place| report.pointer(place).and_then(Value::as_f64).context(place);
    // Output includes the snapshot at the end, which is not part of the steps.
    let output = number("/phases/output/total_s")? / f64::from(ranks);
    let seconds = number("/run/wall_s")? - output;

    let last = snapshot::Reader::open(&out.join("last.vtkhdf"))?;
    let table = last.particles(0..last.particle_count())?;
    let mut end = vec![None; table.id.len()];
    for (id, position) in table.id.iter().zip(&table.position) {
        end[id.0 as usize] = Some(*position);
    }
    Ok(Run { end: all(end)?, seconds, cpu })
}

fn peer_case(code: Code, case: &Case, steps: Steps, folder: &Path) -> anyhow::Result<Run> {
    let (start, end) = (folder.join("start.data"), folder.join("end.dump"));
    fs::write(&start, data_file(case)?)?;
    let path = |path: &Path| path.display().to_string();
    let [(gn, gt), (gnw, gtw)] = [case.damping, case.wall_damping].map(|d| (d[0], d[1]));
    let variables = [
        ("start", path(&start)),
        ("end", path(&end)),
        ("step", format!("{:e}", steps.step)),
        ("steps", steps.count.to_string()),
        ("skin", case.skin.to_string()),
        ("side", case.high.x.to_string()),
        ("gravity", case.gravity.to_string()),
        ("kn", case.stiffness[0].to_string()),
        ("kt", case.stiffness[1].to_string()),
        ("mu", case.friction.to_string()),
        ("gn", gn.to_string()),
        ("gt", gt.to_string()),
        ("gnw", gnw.to_string()),
        ("gtw", gtw.to_string()),
        ("xt", (gt / gn).to_string()),
    ];
    peer((code, code.deck()), &variables, steps.ranks, &end, case.start.len())
}

/// Runs another code on a deck beside this file. The deck writes the positions of its spheres into the file
/// `end`.
pub(crate) fn peer(
    (code, deck): (Code, &str),
    variables: &[(&str, String)],
    ranks: u32,
    end: &Path,
    count: usize,
) -> anyhow::Result<Run> {
    let deck = PathBuf::from("benchmarks/peers").join(deck).display().to_string();
    let mut arguments = vec!["-in".to_owned(), deck, "-log".to_owned(), "none".to_owned()];
    for (name, value) in variables {
        arguments.extend(["-var".to_owned(), (*name).to_owned(), value.clone()]);
    }
    let (said, cpu) = say(code, &arguments, ranks)?;
    let at = said.find("Loop time of").with_context(|| format!("no loop time:\n{said}"))?;
    let seconds = said[at..].split_whitespace().nth(3).context("no loop time")?.parse()?;
    Ok(Run { end: read_dump(&fs::read_to_string(end)?, count)?, seconds, cpu })
}

/// Runs the code, under `mpirun` on more than one rank. Returns its output and CPU time [s].
fn say(code: Code, arguments: &[String], ranks: u32) -> anyhow::Result<(String, f64)> {
    let mut command = Command::new("bash");
    // The `time` of bash includes the CPU time of child processes.
    command.args(["-c", "TIMEFORMAT='cpu %U %S'; time \"$@\"", "bash"]);
    if ranks > 1 {
        command.args(["mpirun", "--oversubscribe", "-n", &ranks.to_string()]);
    }
    let output = command
        .arg(code.program())
        .args(arguments)
        .env("OMPI_ALLOW_RUN_AS_ROOT", "1")
        .env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1")
        .env("OMP_NUM_THREADS", "1")
        .env("DEM_MPI_REGISTERS", code.registers())
        .stdin(Stdio::null())
        .output()?;
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    ensure!(output.status.success(), "{}\n{said}\n{errors}", output.status);
    let cpu = errors.lines().rev().find_map(|line| line.strip_prefix("cpu ")).context("no time")?;
    let cpu: Result<Vec<f64>, _> = cpu.split_whitespace().map(str::parse).collect();
    Ok((said, cpu?.iter().sum()))
}

/// Initial state in the format of LAMMPS and LIGGGHTS; ids count from 1. The second type is that of
/// LIGGGHTS' walls.
fn data_file(case: &Case) -> anyhow::Result<String> {
    let [x, y, z] = case.high.into();
    let mut text = format!("\n{} atoms\n2 atom types\n", case.start.len());
    write!(text, "0 {x} xlo xhi\n0 {y} ylo yhi\n0 {z} zlo zhi\n\nAtoms\n\n")?;
    for (k, position) in case.start.iter().enumerate() {
        let [x, y, z] = (*position).into();
        writeln!(text, "{} 1 {} {} {x} {y} {z}", k + 1, 2.0 * case.radius, case.density)?;
    }
    Ok(text)
}

/// Positions of a dump of one frame, in the order of the ids.
fn read_dump(text: &str, count: usize) -> anyhow::Result<Vec<Vec3>> {
    let (_, rows) = text.split_once("ITEM: ATOMS id x y z").context("no atoms in the dump")?;
    let mut end = vec![None; count];
    for row in rows.lines().filter(|row| !row.trim().is_empty()) {
        let numbers: Result<Vec<f64>, _> = row.split_whitespace().map(str::parse).collect();
        let [id, x, y, z] = numbers?[..] else { bail!("a row of the dump: {row}") };
        end[id as usize - 1] = Some(Vec3::new(x, y, z));
    }
    all(end)
}

fn all(places: Vec<Option<Vec3>>) -> anyhow::Result<Vec<Vec3>> {
    places.into_iter().collect::<Option<_>>().context("a sphere is missing at the end")
}
