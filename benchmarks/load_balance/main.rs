//! Work of the busiest rank over the mean while particles rain into a box, with and without dividing
//! the domain again.
//!
//! ```text
//! cargo bench --bench load_balance                        prints; a table and a plot go to target/
//! cargo bench --bench load_balance -- --record FOLDER     the same into this folder
//! ```
//!
//! Ranks are threads of one process. Work is counted (particles and listed pairs), not timed, and is
//! the same under MPI.

use benchmarking::lines::{self, Line};
use clap::Parser;
use dem_mpi::comm::{Comm, threads};
use dem_mpi::scene::{Scene, assemble};
use std::fmt::Write;
use std::path::PathBuf;

#[derive(Parser)]
struct Arguments {
    /// The scene.
    #[arg(long, default_value = "run/packing/scene.toml")]
    scene: PathBuf,
    /// Number of steps.
    #[arg(long, default_value_t = 40_000)]
    steps: u64,
    /// Write the table and the plot into this folder.
    #[arg(long, value_name = "FOLDER", default_value = "target/load-balance")]
    record: PathBuf,
    /// Cargo passes this.
    #[arg(long, hide = true)]
    bench: bool,
}

const RANKS: [u32; 2] = [4, 8];
/// Points of each curve.
const POINTS: u64 = 120;

/// State of a run at one time.
struct Row {
    time: f64,
    particles: u64,
    imbalance: f64,
}

/// Rows seen by rank 0 of a run, and the number of divisions of the domain.
fn follow(scene: &Scene, steps: u64, ranks: u32) -> (Vec<Row>, u64) {
    let mut all = threads::run(ranks, |comm| {
        let mut sim = assemble::assemble(scene, comm);
        assemble::fill(&mut sim, scene, comm);
        sim.begin(comm).expect("the scene begins well");
        let mut rows = Vec::new();
        for step in 1..=steps {
            sim.step(comm).expect("the step is done");
            if step % (steps / POINTS).max(1) == 0 {
                let imbalance = sim.work_imbalance(comm);
                let mut particles = [sim.particles.owned as i64];
                comm.sum(&mut particles);
                rows.push(Row { time: sim.time(), particles: particles[0] as u64, imbalance });
            }
        }
        (rows, sim.domain.traffic.recuts)
    });
    all.swap_remove(0)
}

fn main() -> anyhow::Result<()> {
    let Arguments { scene, steps, record, .. } = Arguments::parse();
    std::fs::create_dir_all(&record)?;
    let balanced = Scene::read(&scene, &[])?;
    let never = Scene { imbalance: f64::INFINITY, ..balanced.clone() };
    let mut table = "ranks,rebalanced,time_s,particles,imbalance\n".to_owned();
    let mut lines = Vec::new();
    for ranks in RANKS {
        for (scene, how) in [(&never, "cut once"), (&balanced, "cut anew")] {
            let (rows, cuts) = follow(scene, steps, ranks);
            let mean = rows.iter().map(|row| row.imbalance).sum::<f64>() / rows.len() as f64;
            let last = rows.last().map_or(1.0, |row| row.imbalance);
            println!(
                "{ranks} ranks, {how} ({cuts} times): busiest over mean {mean:.3} on average, {last:.3} at the end"
            );
            for row in &rows {
                let Row { time, particles, imbalance } = row;
                writeln!(
                    table,
                    "{ranks},{},{time:.5},{particles},{imbalance:.4}",
                    how == "cut anew"
                )?;
            }
            let points = rows.iter().map(|row| (row.time, row.imbalance)).collect();
            lines.push(Line { name: format!("{ranks} ranks, {how}"), points });
        }
    }
    std::fs::write(record.join("load_balance.csv"), table)?;
    let (path, names) =
        (record.join("load_balance.svg"), ["time (s)", "work of the busiest rank over the mean"]);
    lines::draw(&path, names, 0.0..steps as f64 * balanced.dt, 0.0..f64::from(RANKS[1]), &lines)
}
