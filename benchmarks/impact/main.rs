//! A steel ball strikes a bed of spheres: the third case of Dosta et al. (2024), "Comparing open-source DEM frameworks for
//! simulations of common bulk processes", DOI 10.1016/j.cpc.2023.109066. The height of the ball is compared with that of LIGGGHTS
//! and MUSEN.
//!
//! ```text
//! cargo bench --bench impact -- --state FILE       from the paper's bed of 25,000 spheres: 4 minutes on one core
//! cargo bench --bench impact -- --grains N         from a bed of its own
//! cargo bench --bench impact -- --state FILE --set domain.low='[-0.1, -0.1, -0.1]' --reference FILE     another bed
//! cargo bench --bench impact -- --ranks 2          on so many ranks
//! cargo bench --bench impact -- --runs 5           the mean of so many: all but the first begin after 20 ms, or earlier where the bed is
//!                                                  higher, with the bed shifted by 1e-9 m
//! cargo bench --bench impact -- --record FOLDER    the table and the picture into this folder
//! ```
//!
//! The state is `Case3_PenetrationTest_25000_Particles.txt` of the paper's data, DOI 10.5281/zenodo.8252892: a header line, then
//! `radius x y z` of each sphere. A CSV file `x,y,z` is also accepted. If the file has a sphere as large as the ball, the ball
//! begins at its height. The benchmark fails if the ball is more than 1 mm off the height of another code. An interrupted run
//! continues when it is called again with the same arguments; a folder with a run of another bed or with other keys is rejected.
//!
//! The motion is chaotic once the ball meets the floor. Runs of this program whose beds differ only in the last digit of the data
//! differ by up to 1.5 mm until 35 ms. One run therefore cannot distinguish two codes there; the paper takes the mean of ten,
//! `--runs` that of any number.

use anyhow::{Context, ensure};
use benchmarking::lines::{self, Line};
use benchmarking::simulate;
use clap::Parser;
use dem_mpi::math::Vec3;
use dem_mpi::output::snapshot::Reader;
use dem_mpi::post::series;
use dem_mpi::random::Random;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

#[derive(Parser)]
struct Arguments {
    /// File with the centres of the settled particles.
    #[arg(long, value_name = "FILE", conflicts_with = "grains")]
    state: Option<PathBuf>,
    /// Number of particles to pack first.
    #[arg(long, value_name = "N", default_value_t = 25_000)]
    grains: u64,
    /// Heights to compare with: time [s], and one column or more [m]; default: those for 25,000 particles.
    #[arg(long, value_name = "FILE")]
    reference: Option<PathBuf>,
    /// Initial height of the ball [m]; default: that in the file of the bed, or 0.06.
    #[arg(long, value_name = "Z", allow_hyphen_values = true)]
    height: Option<f64>,
    /// Simulated time [s].
    #[arg(long, default_value_t = 0.035)]
    until: f64,
    #[arg(long, default_value_t = 1)]
    ranks: u32,
    /// Number of runs, each with the bed shifted a little.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    runs: u32,
    /// Change a key of the scene, as with dem-mpi, for example the box of another bed. May be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Folder of the run.
    #[arg(long, value_name = "FOLDER", default_value = "target/impact")]
    out: PathBuf,
    /// Write the table and the picture into this folder.
    #[arg(long, value_name = "FOLDER")]
    record: Option<PathBuf>,
    /// Cargo passes this.
    #[arg(long, hide = true)]
    bench: bool,
}

const PROGRAM: &str = env!("CARGO_BIN_EXE_dem-mpi");
const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/benchmarks/impact");
/// Time step of the scene [s].
const STEP: f64 = 5e-7;
/// Gravity of the scene [m/s²].
const GRAVITY: f64 = 9.81;
/// Radius of a particle [m].
const RADIUS: f64 = 1e-3;
/// Default initial height of the ball [m].
const HEIGHT: f64 = 0.06;
/// Velocity of the ball [m/s].
const VELOCITY: f64 = -5.0;
/// Radius of the ball [m].
const BALL_RADIUS: f64 = 0.01;
/// Latest begin of runs after the first, with the ball in free fall until then [s].
const LATE: f64 = 0.02;
/// Interval of the written heights [s].
const EVERY: f64 = 1e-3;
/// Times that differ by less count as equal [s].
const SAME: f64 = 1e-6;
/// Largest shift of the particles along each axis in runs after the first: the last digit of the data [m].
const SHIFT: f64 = 1e-9;
/// Largest accepted difference of the height from that of any other code [m].
const TOLERANCE: f64 = 1e-3;

fn main() -> anyhow::Result<()> {
    let arguments = Arguments::parse();
    let Arguments { state: bed, grains, out, until, ranks, runs, set, .. } = &arguments;
    std::fs::create_dir_all(out)?;
    let begin = Instant::now();
    let (centres, of_file) = match bed {
        Some(path) => read_bed(path)?,
        None => (pack(*grains, *ranks, &out.join(format!("packing_{grains}")))?, None),
    };
    let height = arguments.height.or(of_file).unwrap_or(HEIGHT);
    println!(
        "{} grains, known after {:.0} s; the ball begins at {height} m",
        centres.len(),
        begin.elapsed().as_secs_f64()
    );
    let late = while_it_falls(&centres, height);
    let step = step_of(set)?;
    ensure!(*runs == 1 || *until > late, "with --runs the heights from {late} s on are compared");
    let mut all = Vec::new();
    for run in 0..*runs {
        let (folder, begins) =
            if run == 0 { (out.clone(), 0.0) } else { (out.join(format!("run_{run}")), late) };
        let state = state(&shifted(&centres, run), height, begins);
        begin_or_go_on(&folder, &state, &set.join("\n"))?;
        let scene = folder.join("scene.toml");
        std::fs::copy(Path::new(FOLDER).join("scene.toml"), &scene)?;
        let begin = Instant::now();
        let steps = ((until - begins) / step).round() as u64;
        let steps_only = format!("time.steps={steps}");
        let keys: Vec<&str> = set.iter().chain([&steps_only]).map(String::as_str).collect();
        simulate(PROGRAM, &scene, &folder.join("out"), *ranks, &keys)?;
        println!("{steps} steps on {ranks} ranks: {:.0} s", begin.elapsed().as_secs_f64());
        all.push(heights(&folder.join("out"), begins)?);
    }

    let (own, deviations) = mean(&all);
    let of_25_000 = Path::new(FOLDER).join("reference_25000.csv");
    let (codes, reference) = read_reference(arguments.reference.as_ref().unwrap_or(&of_25_000))?;
    let table = table(&codes, &reference, &own, &deviations)?;
    print!("{}", table.text);
    let record = arguments.record.as_ref().unwrap_or(out);
    std::fs::create_dir_all(record)?;
    std::fs::write(record.join("impact.csv"), &table.text)?;
    draw(&record.join("impact.svg"), &codes, &reference, &own)?;
    for (code, worst) in codes.iter().zip(&table.worst) {
        println!("largest difference to {code}: {:.3} mm", 1e3 * worst);
    }
    let comparable = bed.is_some() && (arguments.reference.is_some() || centres.len() == 25_000);
    if !comparable {
        println!("the bed is not that of the reference: nothing is judged");
        return Ok(());
    }
    ensure!(
        table.worst.iter().all(|&worst| worst < TOLERANCE),
        "the ball is off by more than {:.0} mm",
        1e3 * TOLERANCE
    );
    Ok(())
}

/// Centres of particles, and the height of the ball if present, from a file of numbers below a header line [m].
fn read_bed(path: &Path) -> anyhow::Result<(Vec<Vec3>, Option<f64>)> {
    let text =
        std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    let (mut centres, mut ball) = (Vec::new(), None);
    let is = |radius: f64, expected: f64| (radius / expected - 1.0).abs() < 0.01;
    for (line, number) in text.lines().zip(1..).skip(1) {
        let words = line.split([',', ' ', '\t']).filter(|word| !word.is_empty());
        let numbers: Vec<f64> = words
            .map(str::parse)
            .collect::<Result<_, _>>()
            .with_context(|| format!("{}:{number}: not all are numbers", path.display()))?;
        match numbers[..] {
            [x, y, z] => centres.push(Vec3::new(x, y, z)),
            [radius, x, y, z] if is(radius, RADIUS) => centres.push(Vec3::new(x, y, z)),
            [radius, _, _, z] if is(radius, BALL_RADIUS) => ball = Some(z),
            [] | [_, _, _, _] => {}
            _ => anyhow::bail!("{}:{number}: neither x y z nor radius x y z", path.display()),
        }
    }
    ensure!(!centres.is_empty(), "{} has no grains of radius {RADIUS} m", path.display());
    Ok((centres, ball))
}

/// Bed of a run; that of the first is not shifted.
fn shifted(centres: &[Vec3], run: u32) -> Vec<Vec3> {
    let shift = if run == 0 { 0.0 } else { SHIFT };
    let mut random = Random::of(u64::from(run), 0);
    centres.iter().map(|centre| centre + Vec3::from_fn(|_, _| shift * random.signed())).collect()
}

/// Mean height at each time, and the standard deviation of several runs [s, m].
fn mean(all: &[Vec<(f64, f64)>]) -> (Vec<(f64, f64)>, Vec<Option<f64>>) {
    let of_time = |&(time, _): &(f64, f64)| {
        let now = |(then, _): &&(f64, f64)| (then - time).abs() < SAME;
        let heights: Vec<f64> = all.iter().flatten().filter(now).map(|(_, z)| *z).collect();
        let count = heights.len() as f64;
        let mean = heights.iter().sum::<f64>() / count;
        let squares: f64 = heights.iter().map(|z| (z - mean).powi(2)).sum();
        let deviation = (heights.len() > 1).then(|| (squares / (count - 1.0)).sqrt());
        ((time, mean), deviation)
    };
    all[0].iter().map(of_time).unzip()
}

/// Lets soft particles rain into the box until they rest.
fn pack(grains: u64, ranks: u32, out: &Path) -> anyhow::Result<Vec<Vec3>> {
    let count = format!("fill.rain.count={grains}");
    simulate(PROGRAM, &Path::new(FOLDER).join("packing.toml"), out, ranks, &[&count])?;
    let reader = Reader::open(&series::newest(out)?)?;
    Ok(reader.particles(0..reader.particle_count())?.position)
}

/// Time step: that of the scene unless these keys set it [s].
fn step_of(set: &[String]) -> anyhow::Result<f64> {
    let set = set.iter().rev().find_map(|key| key.strip_prefix("time.step="));
    set.map_or(Ok(STEP), |text| text.parse().with_context(|| format!("time.step={text}")))
}

/// Time for which the ball falls before it comes near the bed, at most [`LATE`] [s].
fn while_it_falls(centres: &[Vec3], height: f64) -> f64 {
    let top = centres.iter().map(|centre| centre.z).fold(f64::NEG_INFINITY, f64::max) + RADIUS;
    let times = (0..=(LATE / EVERY).round() as u32).rev().map(|k| EVERY * f64::from(k));
    let is_above = |time: &f64| after_fall(height, *time) - BALL_RADIUS > top + RADIUS;
    times.into_iter().find(is_above).unwrap_or(0.0)
}

/// Height of a ball in free fall from an initial height [m].
fn after_fall(height: f64, time: f64) -> f64 {
    height + VELOCITY * time - 0.5 * GRAVITY * time * time
}

/// Particles at rest, and the ball after some time of free fall from a height [m, s], as a file of particles.
fn state(centres: &[Vec3], height: f64, fallen: f64) -> String {
    let grains = centres.iter().map(|c| format!("{:?},{:?},{:?},0,0,0,grain\n", c.x, c.y, c.z));
    let (z, velocity) = (after_fall(height, fallen), VELOCITY - GRAVITY * fallen);
    let ball = format!("0,0,{z:?},0,0,{velocity:?},ball\n");
    let head = "x,y,z,vx,vy,vz,shape\n".to_owned();
    std::iter::once(head).chain(grains).chain([ball]).collect()
}

/// Writes the initial files of a run. A folder with a run of another bed, or with other keys, is rejected.
fn begin_or_go_on(folder: &Path, state: &str, keys: &str) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder)?;
    let is_begun = folder.join("out").exists();
    for (name, text) in [("state.csv", state), ("keys.txt", keys)] {
        let path = folder.join(name);
        ensure!(
            !is_begun || std::fs::read_to_string(&path).unwrap_or_default() == text,
            "{} has a run of another bed or with other keys: remove it, or take another --out",
            folder.display()
        );
        std::fs::write(path, text)?;
    }
    Ok(())
}

/// Heights of the ball by time, for a run that begins at some time; the ball is the last particle [s, m].
fn heights(out: &Path, begins: f64) -> anyhow::Result<Vec<(f64, f64)>> {
    let of = |path: &PathBuf| {
        let reader = Reader::open(path)?;
        let last = reader.particle_count() - 1;
        let ball = reader.particles(last..last + 1)?;
        anyhow::Ok((begins + reader.header().time, ball.position[0].z))
    };
    series::all(out)?.iter().map(of).collect()
}

/// Heights of all codes at each time [s, m].
type Heights = Vec<(f64, Vec<f64>)>;

/// Names of codes, and their heights.
fn read_reference(path: &Path) -> anyhow::Result<(Vec<String>, Heights)> {
    let mut reader = csv::Reader::from_path(path)?;
    let names = reader.headers()?.iter().skip(1);
    let codes = names.map(|name| name.rsplit('_').next().unwrap_or(name).to_owned()).collect();
    let mut rows = Vec::new();
    for row in reader.deserialize() {
        let numbers: Vec<f64> = row?;
        rows.push((numbers[0], numbers[1..].to_vec()));
    }
    Ok((codes, rows))
}

struct Table {
    text: String,
    /// Largest difference from each code [m].
    worst: Vec<f64>,
}

/// All heights at the times common to both.
fn table(
    codes: &[String],
    reference: &[(f64, Vec<f64>)],
    own: &[(f64, f64)],
    deviations: &[Option<f64>],
) -> anyhow::Result<Table> {
    let mut text = "time_s,z_m".to_owned();
    let has_deviations = deviations.iter().any(Option::is_some);
    if has_deviations {
        text += ",deviation_m";
    }
    codes.iter().try_for_each(|code| write!(text, ",z_m_{code}"))?;
    text.push('\n');
    let mut worst = vec![0.0; codes.len()];
    let mut shared = 0;
    for ((time, z), deviation) in own.iter().zip(deviations) {
        let Some((_, others)) = reference.iter().find(|(then, _)| (then - time).abs() < SAME)
        else {
            continue;
        };
        shared += 1;
        write!(text, "{time:.4},{z:.7}")?;
        if has_deviations {
            let number = deviation.map_or_else(String::new, |deviation| format!("{deviation:.7}"));
            write!(text, ",{number}")?;
        }
        for (other, worst) in others.iter().zip(&mut worst) {
            write!(text, ",{other:.7}")?;
            *worst = f64::max(*worst, (z - other).abs());
        }
        text.push('\n');
    }
    ensure!(shared > 1, "the run and the reference have no times in common");
    Ok(Table { text, worst })
}

fn draw(
    path: &Path,
    codes: &[String],
    reference: &[(f64, Vec<f64>)],
    own: &[(f64, f64)],
) -> anyhow::Result<()> {
    let in_mm = |&(time, z): &(f64, f64)| (1e3 * time, 1e3 * z);
    let mut lines: Vec<Line> = Vec::new();
    for (k, code) in codes.iter().enumerate() {
        let points = reference.iter().map(|(time, z)| in_mm(&(*time, z[k]))).collect();
        lines.push(Line { name: code.clone(), points });
    }
    lines.push(Line { name: "dem-mpi".to_owned(), points: own.iter().map(in_mm).collect() });
    let last = own.last().map_or(0.0, |&(time, _)| 1e3 * time);
    lines::draw(path, ["time (ms)", "height of the ball (mm)"], 0.0..last, -90.0..65.0, &lines)
}
