//! Cost of each feature of a scene: time, memory and instructions, rung by rung, beside a hand-written loop for the lowest rung
//! alone.
//!
//! ```text
//! cargo bench --bench ladder                        time and memory
//! cargo bench --bench ladder -- --count             instructions, too: by callgrind, of valgrind
//! cargo bench --bench ladder -- --check             instructions and bytes against the record: what CI does
//! cargo bench --bench ladder -- --time COMMIT       times beside those of the build of another commit, in turns
//! cargo bench --bench ladder -- --million           a million spheres beside 20,000, per contact, and nothing else
//! cargo bench --bench ladder -- --record FOLDER     the tables as CSV into this folder
//! ```
//!
//! 8,000 bodies on a cubic lattice, each in contact with its neighbours; the motion is too small for a contact to be lost or a
//! list to be rebuilt. One rank. Times are medians over rounds in which all rungs take turns.
//!
//! Instructions are also counted by phase, beside the floor of [`dem_mpi::sim::floor`]. The floor assumes AVX2, which callgrind
//! knows: an instruction does four operations or moves 32 bytes.

mod against;
mod check;
mod million;
mod phases;
mod plain;

use anyhow::{Context, anyhow, ensure};
use benchmarking::median;
use clap::Parser;
use dem_mpi::comm::Comm;
use dem_mpi::comm::alone::Alone;
use dem_mpi::scene::{Scene, assemble};
use dem_mpi::sim::Simulation;
use plain::Plain;
use std::fmt::Write;
use std::path::PathBuf;
use std::process::Command;
use std::time::Instant;

#[derive(Parser)]
#[expect(clippy::struct_excessive_bools, reason = "each is asked for on its own")]
struct Arguments {
    /// Count instructions, too.
    #[arg(long)]
    count: bool,
    /// Count instructions and bytes, and fail where they differ from the record; with a folder, write a new record.
    #[arg(long)]
    check: bool,
    /// Time each rung beside the build of another commit, which stays under target/ladder.
    #[arg(long, value_name = "COMMIT")]
    time: Option<String>,
    /// Time a million spheres beside 20,000.
    #[arg(long)]
    million: bool,
    /// Write the tables into this folder.
    #[arg(long, value_name = "FOLDER")]
    record: Option<PathBuf>,
    /// Only time a round of one rung.
    #[arg(long, hide = true)]
    round: Option<usize>,
    /// Only do steps of one rung, to be counted: 0 is the hand-written loop.
    #[arg(long, hide = true)]
    one: Option<usize>,
    /// Number of steps.
    #[arg(long, hide = true, default_value_t = 0)]
    steps: u32,
    /// Number of threads.
    #[arg(long, hide = true, default_value_t = 1)]
    ranks: u32,
    /// Cargo passes this.
    #[arg(long, hide = true)]
    bench: bool,
}

/// Bodies along each axis.
const ALONG: u32 = 20;
/// Half the shortest axis [m].
const SIZE: f64 = 1e-3;
/// Distance of neighbours over their size.
const TIGHT: f64 = 1.0 - 1e-4;
/// Normal stiffness [N/m].
const STIFFNESS: f64 = 1e4;
/// Density [kg/m³].
const DENSITY: f64 = 2500.0;
/// Young's modulus of elastic spheres [Pa].
const YOUNGS_MODULUS: f64 = 1e9;
/// A floor under all bodies, as OBJ.
const FLOOR: &str = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1 2 3\nf 1 3 4\n";
/// Time step [s].
const STEP: f64 = 1e-7;
/// Number of steps of a round.
const STEPS: u32 = 20;
const ROUNDS: usize = 9;

/// Shapes of a scene.
#[derive(Clone, Copy)]
enum Grains {
    Spheres,
    /// Lines of the kind, and semi-axes over [`SIZE`].
    Ellipsoidal(&'static str, [f64; 3]),
    Boxes,
    /// Spheres, ellipsoids, superellipsoids, spherocylinders and boxes, all about as long along each axis.
    FiveKinds,
}

/// Length along x of some shapes of a mixture, relative to the others.
const LONGER: f64 = 1.001;

impl Grains {
    /// Semi-axes over [`SIZE`].
    const fn axes(self) -> [f64; 3] {
        match self {
            Self::Spheres | Self::FiveKinds => [1.0; 3],
            Self::Ellipsoidal(_, axes) => axes,
            Self::Boxes => [1.2, 1.1, 1.0],
        }
    }

    /// Shapes of a scene as text, with their names. A mixture has seven, two of them twice, so that each touches several kinds on
    /// a lattice of 20.
    fn shapes(self) -> (String, Vec<String>) {
        let axes = self.axes().map(|axis| axis * SIZE);
        let longer = [LONGER * SIZE, SIZE, SIZE];
        let length = 2.0 * (LONGER - 1.0) * SIZE;
        let corners: Vec<[f64; 3]> = (0..8)
            .map(|k| std::array::from_fn(|i| if k >> i & 1 == 1 { axes[i] } else { -axes[i] }))
            .collect();
        let sphere = format!("kind = \"sphere\"\nradius = {SIZE:e}");
        let brick = format!("kind = \"polyhedron\"\nvertices = {corners:?}");
        let blunt = "kind = \"superellipsoid\"\nexponents = [0.8, 0.8]";
        let egg = format!("kind = \"ellipsoid\"\nsemi_axes = {longer:?}");
        let all = match self {
            Self::Spheres => vec![sphere],
            Self::Ellipsoidal(kind, _) => vec![format!("{kind}\nsemi_axes = {axes:?}")],
            Self::Boxes => vec![brick],
            Self::FiveKinds => vec![
                sphere.clone(),
                egg.clone(),
                format!("{blunt}\nsemi_axes = {longer:?}"),
                format!("kind = \"spherocylinder\"\nlength = {length:e}\nradius = {SIZE:e}"),
                brick,
                sphere,
                egg,
            ],
        };
        let names: Vec<String> = (0..all.len()).map(|k| k.to_string()).collect();
        let named = names.iter().zip(&all);
        let text = named.map(|(name, lines)| format!("[[shape]]\nname = \"{name}\"\n{lines}\n"));
        (text.collect(), names)
    }
}

/// Features of a scene.
#[derive(Clone, Copy)]
#[expect(clippy::struct_excessive_bools, reason = "each feature is there or not, on its own")]
struct Rung {
    name: &'static str,
    grains: Grains,
    dashpots: bool,
    friction: bool,
    floor: bool,
    periodic: bool,
    servo: bool,
    rolling: bool,
    hertz: bool,
    sizes: bool,
    /// A square of two triangles instead of the plane floor.
    mesh: bool,
    /// Dashpots use predicted velocities.
    foresee: bool,
}

const RUNGS: [Rung; 15] = {
    let spheres = Rung {
        name: "spheres with springs alone",
        grains: Grains::Spheres,
        dashpots: false,
        friction: false,
        floor: false,
        periodic: false,
        servo: false,
        rolling: false,
        hertz: false,
        sizes: false,
        mesh: false,
        foresee: false,
    };
    let dashpots = Rung { name: "and dashpots", dashpots: true, ..spheres };
    let friction = Rung { name: "and friction", friction: true, ..dashpots };
    let floor = Rung { name: "and a floor", floor: true, ..friction };
    let periodic = Rung { name: "and periods along x and y", periodic: true, ..floor };
    let servo = Rung { name: "and a lid with a servo", servo: true, ..periodic };
    let rolling = Rung { name: "and springs against rolling", rolling: true, ..servo };
    let hertz = Rung { name: "of elastic spheres, with a servo", hertz: true, ..servo };
    let sizes = Rung { name: "of spheres of many sizes", sizes: true, ..servo };
    let mesh = Rung { name: "and friction, on triangles", mesh: true, ..friction };
    let foresee = Rung { name: "and friction, foreseen", foresee: true, ..friction };
    let ellipsoids = Rung {
        name: "the same of ellipsoids",
        grains: Grains::Ellipsoidal("kind = \"ellipsoid\"", [1.2, 1.1, 1.0]),
        ..servo
    };
    let superellipsoids = Rung {
        name: "the same of superellipsoids",
        grains: Grains::Ellipsoidal(
            "kind = \"superellipsoid\"\nexponents = [0.8, 0.8]",
            [1.2, 1.1, 1.0],
        ),
        ..servo
    };
    let five_kinds =
        Rung { name: "the same of five kinds (one has faces)", grains: Grains::FiveKinds, ..servo };
    let boxes = Rung { name: "the same of boxes", grains: Grains::Boxes, ..servo };
    [
        spheres,
        dashpots,
        friction,
        floor,
        periodic,
        servo,
        rolling,
        hertz,
        sizes,
        mesh,
        ellipsoids,
        superellipsoids,
        five_kinds,
        boxes,
        foresee,
    ]
};

impl Rung {
    /// Scene with this number of bodies along each axis.
    fn scene(&self, along: u32) -> anyhow::Result<Scene> {
        let spacing = self.grains.axes().map(|axis| 2.0 * TIGHT * axis * SIZE);
        let (mut shapes, names) = self.grains.shapes();
        if self.sizes {
            // Nearly equal sizes, so that neighbours touch.
            shapes += "size = { lognormal = { median = 1, sigma = 1e-5 }, limits = [0.99999, 1.00001], by = \"number\" }\n";
        }
        let walls = match (self.floor, self.servo) {
            (false, _) => "[]",
            (true, false) => "[\"-z\"]",
            (true, true) => "[\"-z\", \"+z\"]",
        };
        let elastic = format!("youngs_modulus = {YOUNGS_MODULUS:e}\npoisson_ratio = 0.3");
        let springs = format!("normal_stiffness = {STIFFNESS}");
        let law = match (self.hertz, self.rolling) {
            (true, _) => "[law]\nnormal = \"hertz\"\n",
            (false, true) => "[law]\nrolling = \"spring\"\n",
            (false, false) if self.foresee => "[law]\nforesee = true\n",
            (false, false) => "",
        };
        let folder = tempfile::tempdir()?;
        let mesh = if self.mesh {
            std::fs::write(folder.path().join("floor.obj"), FLOOR)?;
            "[[wall]]\nname = \"floor\"\nmesh = \"floor.obj\"\n"
        } else {
            ""
        };
        let text = format!(
            "[domain]\nlow = [0, 0, 0]\nhigh = {high:?}\nperiodic = [{p}, {p}, false]\nwalls = {walls}\n\
             {mesh}{law}[[material]]\nname = \"glass\"\ndensity = {DENSITY}\n{stiffness}\n\
             friction = {friction}\nrestitution = {restitution}\n{more}\
             {shapes}\
             [[fill.lattice]]\nshapes = {names:?}\nfirst = {first:?}\ncount = [{along}, {along}, {along}]\nspacing = {spacing:?}\n\
             orientation = \"upright\"\n\
             [time]\nstep = {STEP:e}\nsteps = 1\n[output]\ndirectory = \"none\"\n{servo}",
            high = spacing.map(|spacing| spacing * f64::from(along)),
            first = spacing.map(|spacing| 0.5 * spacing),
            p = self.periodic,
            friction = if self.friction { 0.3 } else { 0.0 },
            restitution = if self.dashpots { 0.7 } else { 1.0 },
            stiffness = if self.hertz { elastic } else { springs },
            more = match (self.dashpots && self.friction && !self.hertz, self.rolling) {
                (false, _) => "",
                (true, false) => "tangential_damping_ratio = 0.1\n",
                (true, true) => "tangential_damping_ratio = 0.1\nrolling_friction = 0.1\n",
            },
            servo = if self.servo { "[[servo]]\nwalls = [\"+z\"]\nstress = 500\n" } else { "" },
        );
        Scene::parse(&text, self.name, folder.path(), &[]).map_err(|e| anyhow!("{e}"))
    }

    fn begun(&self, along: u32) -> anyhow::Result<Simulation> {
        self.begun_on(along, &mut Alone::default())
    }

    /// Simulation with the share of one rank. Collective.
    fn begun_on(&self, along: u32, comm: &mut dyn Comm) -> anyhow::Result<Simulation> {
        let scene = self.scene(along)?;
        let mut sim = assemble::assemble(&scene, comm);
        assemble::fill(&mut sim, &scene, comm);
        sim.begin(comm)?;
        Ok(sim)
    }
}

/// Bytes of the data of a simulation for particles, pairs and contacts.
fn bytes(sim: &Simulation) -> usize {
    let Simulation { particles, pairs, contacts, sums, .. } = sim;
    particles.bytes() + pairs.bytes() + contacts.bytes() + sums.bytes()
}

/// Timed program: the loop, or a rung.
enum Runner {
    Plain(Plain),
    Rung(Box<Simulation>),
}

impl Runner {
    fn of(number: usize) -> anyhow::Result<Self> {
        if number == 0 {
            let sim = RUNGS[0].begun(ALONG)?;
            let pairs = sim.pairs.pairs.iter().map(|pair| [pair.a.0, pair.b.0]).collect();
            let (mass, skin) = (sim.particles.mass(0), sim.skin);
            let particles = &sim.particles;
            return Ok(Self::Plain(Plain::new(particles.position.clone(), pairs, mass, skin)));
        }
        Ok(Self::Rung(Box::new(RUNGS[number - 1].begun(ALONG)?)))
    }

    fn steps(&mut self, count: u32) -> anyhow::Result<()> {
        for _ in 0..count {
            match self {
                Self::Plain(plain) => ensure!(plain.step(), "the list is too old"),
                Self::Rung(sim) => sim.step(&mut Alone::default())?,
            }
        }
        Ok(())
    }

    /// Time of a step, averaged over a round [s].
    fn round(&mut self) -> anyhow::Result<f64> {
        self.steps(3)?;
        let begin = Instant::now();
        self.steps(STEPS)?;
        Ok(begin.elapsed().as_secs_f64() / f64::from(STEPS))
    }

    /// Bytes, listed pairs and contacts.
    fn size(&self) -> [usize; 3] {
        match self {
            Self::Plain(plain) => [plain.bytes(), plain.pairs.len(), plain.touching()],
            Self::Rung(sim) => [bytes(sim), sim.pairs.pairs.len(), sim.contacts.len()],
        }
    }
}

/// Instructions of a step, or of a function in it, from two runs of different length. `None` if the program has an instruction
/// unknown to valgrind (3.19: `vmovq` between registers), which the bodies with faces may need in `registers` with AVX.
fn instructions(
    number: usize,
    ranks: u32,
    function: Option<&str>,
    registers: &str,
) -> anyhow::Result<Option<f64>> {
    let of = |steps: u32| {
        let program = std::env::current_exe()?;
        let output = Command::new("valgrind")
            .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
            .args(function.map(|name| format!("--toggle-collect={name}")))
            .arg(program)
            .args(["--one", &number.to_string(), "--steps", &steps.to_string()])
            .args(["--ranks", &ranks.to_string()])
            .env("DEM_MPI_REGISTERS", registers)
            .output()
            .context("valgrind, which counts instructions, does not start")?;
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        if told.contains("Unrecognised instruction") {
            return Ok(None);
        }
        let counted = told.lines().find_map(|line| line.split("Collected :").nth(1));
        let counted = counted.with_context(|| format!("valgrind counted nothing:\n{told}"))?;
        Ok::<Option<f64>, anyhow::Error>(Some(counted.trim().parse()?))
    };
    let (few, many) = (2, 6);
    let (Some(of_few), Some(of_many)) = (of(few)?, of(many)?) else { return Ok(None) };
    Ok(Some((of_many - of_few) / f64::from(many - few)))
}

fn main() -> anyhow::Result<()> {
    let Arguments { count, check, time, million, record, round, one, steps, ranks, .. } =
        Arguments::parse();
    if let Some(rung) = round {
        println!("{}", Runner::of(rung)?.round()?);
        return Ok(());
    }
    if let Some(number) = one {
        return if ranks == 1 {
            Runner::of(number)?.steps(steps)
        } else {
            check::steps_of(&RUNGS[number - 1], steps, ranks)
        };
    }
    if let Some(record) = &record {
        std::fs::create_dir_all(record)?;
    }
    if check {
        return check::check(record.as_deref());
    }
    if let Some(commit) = time {
        return against::time(&commit, record.as_deref());
    }
    if million {
        return million::time(record.as_deref());
    }
    let names = ["a loop for the first rung alone"].into_iter().chain(RUNGS.map(|rung| rung.name));
    let names: Vec<&str> = names.collect();
    let mut times = vec![Vec::new(); names.len()];
    let mut sizes = Vec::new();
    for _ in 0..ROUNDS {
        sizes.clear();
        for (number, times) in times.iter_mut().enumerate() {
            let mut runner = Runner::of(number)?;
            times.push(runner.round()?);
            sizes.push(runner.size());
        }
    }

    let bodies = f64::from(ALONG.pow(3));
    let mut table =
        "rung,listed_pairs,contacts,bytes,nanoseconds,over_the_loop,instructions\n".to_owned();
    println!("one rank, per particle (and step): median over {ROUNDS} rounds");
    println!(
        "{:<34} {:>6} {:>9} {:>6} {:>7} {:>10} {:>13}",
        "", "listed", "contacts", "bytes", "ns", "over loop", "instructions"
    );
    let mut over_the_loop = Vec::new();
    for (number, name) in names.iter().enumerate() {
        let mut ratios: Vec<f64> =
            times[number].iter().zip(&times[0]).map(|(time, of_loop)| time / of_loop).collect();
        let (time, ratio) =
            (1e9 * median(&mut times[number].clone()) / bodies, median(&mut ratios));
        over_the_loop.push(ratio);
        let [bytes, listed, contacts] = sizes[number].map(|size| size as f64 / bodies);
        let counted = if count { instructions(number, 1, None, "avx")? } else { None };
        let counted =
            counted.map_or_else(String::new, |counted| format!("{:.0}", counted / bodies));
        println!(
            "{name:<34} {listed:>6.2} {contacts:>9.2} {bytes:>6.0} {time:>7.1} {ratio:>10.2} {counted:>13}"
        );
        writeln!(
            table,
            "{name:?},{listed:.3},{contacts:.3},{bytes:.0},{time:.2},{ratio:.3},{counted}"
        )?;
    }
    if let Some(record) = &record {
        std::fs::write(record.join("ladder.csv"), table)?;
    }
    if count { phases::count(record.as_deref()) } else { Ok(()) }
}
