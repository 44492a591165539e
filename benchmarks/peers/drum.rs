//! A rotating drum of triangles, full of spheres: the same flow by this program and by LIGGGHTS, and the time of a step.

use crate::case::Apart;
use crate::codes::{self, Code, Run};
use crate::speed::Turns;
use anyhow::{Context, ensure};
use dem_mpi::math::Vec3;
use dem_mpi::output::snapshot;
use dem_mpi::scene::Scene;
use dem_mpi::shape::Shape;
use std::f64::consts::{PI, TAU};
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

const SCENE: &str = "benchmarks/peers/drum.toml";
/// Deck for LIGGGHTS: `hertz` with `tangential history`.
const DECK: &str = "liggghts_drum.in";
/// Number of strips, each with four triangles: two of the tube, one of each end.
const STRIPS: usize = 300;
/// Radius of the drum [m].
const RADIUS: f64 = 0.1;
/// Half the length of the drum [m].
const HALF: f64 = 0.03;
/// Largest accepted median distance between the final positions of both codes, over the median displacement.
const ALLOWED: f64 = 0.02;

#[derive(clap::Args)]
pub(crate) struct Options {
    #[command(flatten)]
    turns: Turns,
    /// Steps before the measurement in which the spheres come to flow.
    #[arg(long)]
    flow: Option<u64>,
}

/// A sphere in the flowing bed.
struct Sphere {
    position: Vec3,
    velocity: Vec3,
    spin: Vec3,
}

/// Common input of both codes.
struct Drum {
    folder: PathBuf,
    /// Text of the scene, without its fill.
    head: String,
    scene: Scene,
    start: Vec<Sphere>,
}

/// Writes `drum.csv` and prints the medians.
pub(crate) fn time(options: &Options, record: &Path) -> anyhow::Result<()> {
    let mut codes = [Code::Own, Code::Liggghts];
    ensure!(codes[1].is_installed(), "LIGGGHTS is not installed");
    let folder = std::env::temp_dir().join(format!("dem-mpi-peers-drum-{}", std::process::id()));
    fs::create_dir_all(&folder)?;
    let drum = Drum::flowing(folder, options.flow)?;
    drum.compare()?;
    let run = |code, steps, ranks| drum.run(code, steps, ranks);
    options.turns.time(&mut codes, drum.start.len(), &record.join("drum.csv"), run)?;
    fs::remove_dir_all(&drum.folder)?;
    Ok(())
}

impl Drum {
    /// Simulates the spheres until they flow.
    fn flowing(folder: PathBuf, steps: Option<u64>) -> anyhow::Result<Self> {
        let [obj, stl] = surfaces();
        fs::write(folder.join("drum.obj"), obj)?;
        fs::write(folder.join("drum.stl"), stl)?;
        let text = fs::read_to_string(SCENE)?;
        let (head, _) = text.split_once("[[fill").context("no fill")?;
        let (head, file) = (head.to_owned(), folder.join("flow.toml"));
        fs::write(&file, &text)?;
        let scene = Scene::read(&file, &[]).map_err(|errors| anyhow::anyhow!("{errors}"))?;
        let steps = steps.unwrap_or(scene.steps);
        println!("{steps} steps until the spheres flow");
        codes::own(Code::Own, &file, &[("time.steps", steps.to_string())], 2, &folder)?;
        let last = snapshot::Reader::open(&folder.join("own/last.vtkhdf"))?;
        let table = last.particles(0..last.particle_count())?;
        let start = (0..table.id.len()).map(|k| Sphere {
            position: table.position[k],
            velocity: table.velocity[k],
            spin: table.angular_velocity[k],
        });
        Ok(Self { start: start.collect(), folder, head, scene })
    }

    /// Checks that both codes agree, as far as their laws are the same.
    fn compare(&self) -> anyhow::Result<()> {
        let steps = 1000;
        let own = self.run(Code::Own, steps, 1)?.end;
        let start: Vec<Vec3> = self.start.iter().map(|sphere| sphere.position).collect();
        let way = Apart::of(&start, &own).median;
        for ranks in [1, 2] {
            let apart = Apart::of(&own, &self.run(Code::Liggghts, steps, ranks)?.end);
            println!(
                "liggghts on {ranks} is {:.1e} m from dem-mpi after {steps} steps (median), {:.2} % of the way; at most {:.1e} m",
                apart.median,
                100.0 * apart.median / way,
                apart.largest
            );
            ensure!(apart.median < ALLOWED * way, "it does something else");
        }
        println!();
        Ok(())
    }

    fn run(&self, code: Code, steps: u64, ranks: u32) -> anyhow::Result<Run> {
        let run = if code == Code::Own { self.own(steps, ranks) } else { self.peer(steps, ranks) };
        run.with_context(|| format!("{}, {steps} steps, {ranks} ranks", code.name()))
    }

    fn own(&self, steps: u64, ranks: u32) -> anyhow::Result<Run> {
        let mut text = String::from("x,y,z,vx,vy,vz,wx,wy,wz\n");
        for Sphere { position, velocity, spin } in &self.start {
            let values = [position, velocity, spin].into_iter().flatten().map(f64::to_string);
            writeln!(text, "{}", values.collect::<Vec<_>>().join(","))?;
        }
        fs::write(self.folder.join("spheres.csv"), text)?;
        let file = self.folder.join("timed.toml");
        fs::write(&file, format!("{}[[fill.file]]\npath = \"spheres.csv\"\n", self.head))?;
        let keys = [("time.steps", steps.to_string())];
        codes::own(Code::Own, &file, &keys, ranks, &self.folder)
    }

    fn peer(&self, steps: u64, ranks: u32) -> anyhow::Result<Run> {
        let file = |name: &str| self.folder.join(name);
        let library = &self.scene.library;
        let Shape::Sphere(sphere) = library.shapes[0] else { anyhow::bail!("no spheres") };
        let density = library.mass[0] / (4.0 / 3.0 * PI * sphere.radius.powi(3));
        fs::write(file("start.data"), self.data_file(sphere.radius, density)?)?;
        let of_scene: toml::Table = self.head.parse()?;
        let material = |key: &str| {
            let value = of_scene["material"][0].get(key).and_then(toml::Value::as_float);
            value.with_context(|| format!("no {key}")).map(|value| value.to_string())
        };
        let rate = self.scene.walls[0].angular_velocity.norm();
        let variables = [
            ("start", file("start.data").display().to_string()),
            ("end", file("end.dump").display().to_string()),
            ("mesh", file("drum.stl").display().to_string()),
            ("step", format!("{:e}", self.scene.dt)),
            ("steps", steps.to_string()),
            ("skin", self.scene.skin.to_string()),
            ("gravity", self.scene.gravity.norm().to_string()),
            ("period", (TAU / rate).to_string()),
            ("e", material("youngs_modulus")?),
            ("nu", material("poisson_ratio")?),
            ("cor", material("restitution")?),
            ("mu", material("friction")?),
        ];
        codes::peer((Code::Liggghts, DECK), &variables, ranks, &file("end.dump"), self.start.len())
    }

    /// Initial state in the format of LIGGGHTS; ids count from 1.
    fn data_file(&self, radius: f64, density: f64) -> anyhow::Result<String> {
        let (low, high) = (self.scene.domain.corners().0, self.scene.domain.corners().1);
        let mut text = format!("\n{} atoms\n2 atom types\n", self.start.len());
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            writeln!(text, "{} {} {name}lo {name}hi", low[axis], high[axis])?;
        }
        let join = |values: &Vec3| values.iter().map(f64::to_string).collect::<Vec<_>>().join(" ");
        text += "\nAtoms\n\n";
        for (k, sphere) in self.start.iter().enumerate() {
            writeln!(text, "{} 1 {} {density} {}", k + 1, 2.0 * radius, join(&sphere.position))?;
        }
        text += "\nVelocities\n\n";
        for (k, sphere) in self.start.iter().enumerate() {
            writeln!(text, "{} {} {}", k + 1, join(&sphere.velocity), join(&sphere.spin))?;
        }
        Ok(text)
    }
}

/// The drum as OBJ and as STL.
fn surfaces() -> [String; 2] {
    let mut corners = vec![[0.0, -HALF, 0.0], [0.0, HALF, 0.0]];
    for k in 0..STRIPS {
        let angle = TAU * k as f64 / STRIPS as f64;
        corners.extend([-HALF, HALF].map(|y| [RADIUS * angle.cos(), y, RADIUS * angle.sin()]));
    }
    let triangles = (0..STRIPS).flat_map(|k| {
        let [low, high, next_low, next_high] =
            [2 * k + 2, 2 * k + 3, 2 * ((k + 1) % STRIPS) + 2, 2 * ((k + 1) % STRIPS) + 3];
        [
            [low, high, next_high],
            [low, next_high, next_low],
            [0, low, next_low],
            [1, next_high, high],
        ]
    });
    let (mut obj, mut stl) = (String::new(), "solid drum\n".to_owned());
    for [x, y, z] in &corners {
        writeln!(obj, "v {x} {y} {z}").expect("text");
    }
    for triangle in triangles {
        let [a, b, c] = triangle.map(|k| k + 1);
        writeln!(obj, "f {a} {b} {c}").expect("text");
        // The reader computes the normals.
        stl += "facet normal 0 0 0\nouter loop\n";
        for [x, y, z] in triangle.map(|k| corners[k]) {
            writeln!(stl, "vertex {x} {y} {z}").expect("text");
        }
        stl += "endloop\nendfacet\n";
    }
    [obj, stl + "endsolid drum\n"]
}
