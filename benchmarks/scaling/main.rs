//! Strong and weak scaling: wall time on the available cores, counted cost on more ranks, and predictions from both.
//!
//! ```text
//! cargo bench --bench scaling                        prints; tables and plots go to target/
//! cargo bench --bench scaling -- --record FOLDER     the same into this folder
//! cargo bench --bench scaling -- --times             steps alone; with --snapshots, snapshots alone
//! cargo bench --bench scaling -- --latency 5e-6 --bandwidth 2e9     for another network
//! ```
//!
//! Measured under mpirun: the time of steps on 1 and 2 ranks, of two simultaneous runs that share only the machine,
//! and of a snapshot. Counted: particles, ghosts, contacts, messages, bytes, reductions and migrations of every rank
//! on 1 to 64 ranks, as threads of one process. Predicted by `model.rs`: everything beyond.

mod counted;
mod measured;
mod model;
mod packing;

use benchmarking::lines::{self, Line};
use clap::Parser;
use counted::{BYTES, CONTACTS, GHOSTS, MESSAGES, MIGRATED, NAMES, PARTICLES, REDUCTIONS, Run};
use dem_mpi::comm::threads;
use measured::{PHASES, Task, Timed};
use model::{Costs, Laws, Surface};
use packing::{CELL, Packing, arranged, settled};
use plotters::prelude::IntoLogRange;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

#[derive(Parser)]
struct Arguments {
    /// Write the tables and the plots into this folder.
    #[arg(long, value_name = "FOLDER", default_value = "target/scaling")]
    record: PathBuf,
    /// Time of a message on the network [s]. The default is typical of InfiniBand, not measured.
    #[arg(long, default_value_t = 1.5e-6)]
    latency: f64,
    /// Bandwidth of the network, for each rank [B/s]. The default is typical of InfiniBand, not measured.
    #[arg(long, default_value_t = 10e9)]
    bandwidth: f64,
    /// Only time steps.
    #[arg(long)]
    times: bool,
    /// Only time snapshots.
    #[arg(long)]
    snapshots: bool,
    /// Task of a rank of mpirun.
    #[arg(long, hide = true)]
    task: Option<Task>,
    /// Cargo passes this.
    #[arg(long, hide = true)]
    bench: bool,
}

/// Numbers of ranks with counts.
const RANKS: [u32; 7] = [1, 2, 4, 8, 16, 32, 64];
/// Number of ranks at which all axes are divided.
const MOST: u32 = RANKS[RANKS.len() - 1];
/// Particles per rank with counted weak scaling; `OTHERS` are counted on [`MOST`] ranks alone.
const WEAK: [u32; 2] = [1000, 8000];
const OTHERS: [u32; 5] = [125, 250, 500, 2000, 4000];
/// Number of counted steps: about three rebuilds of the pair list.
const STEPS: u32 = 42;
/// Predicted numbers of particles, per rank for weak scaling and in total for strong scaling.
const PREDICTED: [[f64; 3]; 2] = [[1e3, 1e4, 1e5], [1e6, 1e7, 1e8]];
const LARGEST: f64 = 1e5;

/// Counts on all numbers of ranks.
fn count_all() -> anyhow::Result<Vec<Run>> {
    let packing = Packing::new()?;
    let mut runs = Vec::new();
    for ranks in RANKS {
        let ranks = threads::run(ranks, |comm| {
            let mut sim = settled(comm);
            counted::count(&mut sim, STEPS, comm)
        });
        runs.push(Run { scene: "settled", ranks });
    }
    let weak = WEAK.iter().flat_map(|&each| RANKS.map(|ranks| (each, ranks)));
    for (each, ranks) in weak.chain(OTHERS.map(|each| (each, MOST))) {
        let cells = arranged(each * ranks / CELL);
        let ranks = threads::run(ranks, |comm| {
            let mut sim = packing.begun(cells, comm);
            counted::count(&mut sim, STEPS, comm)
        });
        runs.push(Run { scene: "packed", ranks });
    }
    Ok(runs)
}

/// Prints and writes the counts.
fn tell_counts(runs: &[Run], record: &Path) -> anyhow::Result<()> {
    let mut table = "scene,ranks".to_owned();
    for name in NAMES {
        write!(table, ",{name}_mean,{name}_most")?;
    }
    table.push('\n');
    println!("counted, per step and rank, mean (most)");
    println!(
        "{:<8} {:>5} {:>15} {:>15} {:>17} {:>13} {:>17} {:>15} {:>10}",
        "scene",
        "ranks",
        "particles",
        "ghosts",
        "contacts",
        "messages",
        "bytes",
        "migrated",
        "reductions"
    );
    for run in runs {
        write!(table, "{},{}", run.scene, run.ranks.len())?;
        for which in 0..NAMES.len() {
            write!(table, ",{:.3},{:.3}", run.mean(which), run.most(which))?;
        }
        table.push('\n');
        let cell =
            |which, digits| format!("{:.digits$} ({:.digits$})", run.mean(which), run.most(which));
        println!(
            "{:<8} {:>5} {:>15} {:>15} {:>17} {:>13} {:>17} {:>15} {:>10.2}",
            run.scene,
            run.ranks.len(),
            cell(PARTICLES, 0),
            cell(GHOSTS, 0),
            cell(CONTACTS, 0),
            cell(MESSAGES, 1),
            cell(BYTES, 0),
            cell(MIGRATED, 2),
            run.mean(REDUCTIONS),
        );
    }
    fs::write(record.join("counts.csv"), table)?;
    Ok(())
}

/// Times steps, prints and writes the times; returns those of one rank with 20,000 particles.
fn time_all(record: &Path) -> anyhow::Result<Timed> {
    let mut table =
        "scene,ranks,particles,step_s,ns_per_particle_step_and_rank,strong_efficiency".to_owned();
    for phase in PHASES {
        write!(table, ",{}_ns", phase.name())?;
    }
    table.push('\n');
    println!("\nmeasured under mpirun: fastest of several rounds");
    let mut tell = |task: Task, ranks: u32, timed: &Timed, alone: &Timed| -> anyhow::Result<()> {
        let each = 1e9 * timed.step * f64::from(ranks) / timed.particles;
        let efficiency = alone.step / timed.step / f64::from(ranks);
        println!(
            "{:<8} {:>6} particles, {ranks} ranks: {:>9.3} ms per step, {each:.0} ns per particle-step and rank, efficiency {efficiency:.3}",
            task.name(),
            timed.particles,
            1e3 * timed.step,
        );
        write!(
            table,
            "{},{ranks},{},{:.6e},{each:.1},{efficiency:.4}",
            task.name(),
            timed.particles,
            timed.step
        )?;
        print!("        ");
        for (phase, seconds) in PHASES.into_iter().zip(timed.phases) {
            let of_each = each * seconds / timed.step;
            print!(" {} {of_each:.0} ns", phase.name());
            write!(table, ",{of_each:.1}")?;
        }
        println!();
        table.push('\n');
        Ok(())
    };
    let mut ones = Vec::new();
    let mut twos = Vec::new();
    for task in [Task::Settled, Task::Packed10, Task::Packed20] {
        let one = measured::steps(task, 1)?;
        let two = measured::steps(task, 2)?;
        tell(task, 1, &one, &one)?;
        tell(task, 2, &two, &one)?;
        ones.push(one);
        twos.push(two);
    }
    println!(
        "weak, 10,000 on one rank to 20,000 on two: efficiency {:.3}",
        ones[1].step / twos[2].step
    );
    let apart = measured::steps(Task::Apart, 2)?;
    let alone = Timed { step: 2.0 * ones[1].step, ..ones[1] };
    tell(Task::Apart, 2, &Timed { particles: 2.0 * apart.particles, ..apart }, &alone)?;
    println!(
        "two runs of 10,000 at once keep {:.3} of the speed of one: no program can scale better here; \
         20,000 on two ranks keep {:.3} of the speed of those two",
        ones[1].step / apart.step,
        apart.step / twos[2].step
    );
    fs::write(record.join("times.csv"), table)?;
    Ok(ones[2])
}

/// A quantity of a run.
type Of<'a> = &'a dyn Fn(&Run) -> f64;

/// Fits, prints the residuals, predicts and draws.
fn foretell(runs: &[Run], costs: &Costs, record: &Path) -> anyhow::Result<()> {
    let packed = |run: &&Run| run.scene == "packed";
    let of_ranks = |ranks: u32| move |run: &&Run| run.ranks.len() == ranks as usize;
    let mut fitted: Vec<&Run> = runs.iter().filter(packed).filter(of_ranks(MOST)).collect();
    fitted.sort_by(|x, y| x.mean(PARTICLES).total_cmp(&y.mean(PARTICLES)));
    let alone = runs.iter().filter(packed).find(of_ranks(1)).expect("one rank is counted");
    let laws = Laws::fit(&fitted, alone);
    show_fit(&fitted, &laws, record)?;

    let Costs { particle, contact, latency, bandwidth } = costs;
    println!(
        "\npredicted with {:.1} ns per particle or ghost and {:.1} ns per contact (measured on one rank), {:.2} µs per message, {:.1} GB/s (stated); {:.1} messages and {:.2} reductions per step",
        1e9 * particle,
        1e9 * contact,
        1e6 * latency,
        1e-9 * bandwidth,
        laws.messages,
        laws.reductions,
    );
    let fewest = fitted[0].mean(PARTICLES);
    let mut table = "scaling,particles,ranks,particles_per_rank,efficiency,from\n".to_owned();
    for (scaling, sizes) in ["weak", "strong"].into_iter().zip(PREDICTED) {
        let mut lines = by_model(scaling, &sizes, &laws, costs, fewest, &mut table)?;
        lines.extend(by_counts(scaling, runs, costs, &mut table)?);
        let (across, names) = ((1.0..LARGEST).log_scale(), ["ranks", "parallel efficiency"]);
        lines::draw(&record.join(format!("{scaling}.svg")), names, across, 0.0..1.6, &lines)?;
    }
    fs::write(record.join("prediction.csv"), table)?;
    Ok(())
}

/// Prints, writes and draws the counts beside the fitted laws.
fn show_fit(fitted: &[&Run], laws: &Laws, record: &Path) -> anyhow::Result<()> {
    println!("\nfitted to {MOST} ranks: a n^(2/3) + b");
    let mut table = "quantity,particles_per_rank,counted,fitted,residual_percent\n".to_owned();
    let mut lines = Vec::new();
    let quantities: [(&str, Surface, Of); 3] = [
        ("ghosts", laws.ghosts, &|run| run.mean(GHOSTS)),
        ("bytes", laws.bytes, &|run| run.mean(BYTES)),
        ("contacts with ghosts", laws.shared, &|run| model::shared(run, laws.contacts)),
    ];
    for (name, law, of) in quantities {
        println!("{name}: a = {:.4e}, b = {:.4e}", law.a, law.b);
        let mut points = Vec::new();
        for run in fitted {
            let (n, counted) = (run.mean(PARTICLES), of(run));
            let residual = 100.0 * (law.at(n) / counted - 1.0);
            println!("  n = {n:>6.0}: counted {counted:>9.1}, residual {residual:>+6.2} %");
            writeln!(table, "{name},{n:.1},{counted:.2},{:.2},{residual:.2}", law.at(n))?;
            points.push((n, counted));
        }
        lines.push(Line { name: format!("{name}, counted"), points });
        let fit = decades(100.0, LARGEST).map(|n| (n, law.at(n))).collect();
        lines.push(Line { name: format!("{name}, fitted"), points: fit });
    }
    fs::write(record.join("laws.csv"), table)?;
    let (across, up) = ((100.0..LARGEST).log_scale(), (10.0..1e10).log_scale());
    let names = ["particles per rank", "per step and rank"];
    lines::draw(&record.join("laws.svg"), names, across, up, &lines)?;
    Ok(())
}

/// Efficiencies from the fitted laws, from the number of ranks at which all axes are divided down to the fewest
/// counted particles per rank.
fn by_model(
    scaling: &str,
    sizes: &[f64],
    laws: &Laws,
    costs: &Costs,
    fewest: f64,
    table: &mut String,
) -> anyhow::Result<Vec<Line>> {
    let mut lines = Vec::new();
    for &size in sizes {
        let each = |ranks: f64| if scaling == "weak" { size } else { size / ranks };
        let points: Vec<_> = decades(f64::from(MOST), LARGEST)
            .filter(|&ranks| each(ranks) >= fewest)
            .map(|ranks| (ranks, laws.efficiency(costs, each(ranks), ranks)))
            .collect();
        for &(ranks, efficiency) in &points {
            let n = each(ranks);
            writeln!(table, "{scaling},{:.0},{ranks:.0},{n:.0},{efficiency:.4},model", n * ranks)?;
        }
        if let Some((ranks, efficiency)) = points.last() {
            println!("{scaling} {size:.0e}: efficiency {efficiency:.3} on {ranks:.0} ranks");
        }
        let what = if scaling == "weak" { "per rank" } else { "in all" };
        lines.push(Line { name: format!("{size:.0e} {what}, model"), points });
    }
    Ok(lines)
}

/// Efficiencies from the counts of runs.
fn by_counts(
    scaling: &str,
    runs: &[Run],
    costs: &Costs,
    table: &mut String,
) -> anyhow::Result<Vec<Line>> {
    let counted: Vec<(String, Vec<&Run>)> = if scaling == "weak" {
        let packed = |run: &&Run| run.scene == "packed";
        let of_size = |each: u32| move |run: &&Run| run.mean(PARTICLES).round() == f64::from(each);
        WEAK.iter()
            .map(|&each| {
                let name = format!("{each} per rank, counted");
                (name, runs.iter().filter(packed).filter(of_size(each)).collect())
            })
            .collect()
    } else {
        let settled = runs.iter().filter(|run| run.scene == "settled");
        vec![("5120 in all (settled), counted".to_owned(), settled.collect())]
    };
    let mut lines = Vec::new();
    for (name, runs) in counted {
        let alone = runs[0];
        let mut points = Vec::new();
        for run in runs {
            let (ranks, efficiency) = (run.ranks.len(), costs.efficiency(run, alone));
            let (all, n) = (run.total(PARTICLES), run.mean(PARTICLES));
            println!("{scaling} {n:.0} per rank, {ranks} ranks: {efficiency:.3} from the counts");
            writeln!(table, "{scaling},{all:.0},{ranks},{n:.0},{efficiency:.4},counts")?;
            points.push((ranks as f64, efficiency));
        }
        lines.push(Line { name, points });
    }
    Ok(lines)
}

/// Ten points per decade, both ends included.
fn decades(from: f64, to: f64) -> impl Iterator<Item = f64> {
    let count = (10.0 * (to / from).log10()).ceil() as u32;
    (0..=count).map(move |k| from * (to / from).powf(f64::from(k) / f64::from(count)))
}

/// Prints and writes the time of snapshots.
fn time_snapshots(record: &Path) -> anyhow::Result<()> {
    let mut table = "ranks,bytes,snapshot_s,plain_write_s\n".to_owned();
    println!("\nsnapshot of 1,000,000 ellipsoids, and a plain write of as many bytes");
    for ranks in [1, 2] {
        let measured::Written { bytes, snapshot, plain } = measured::snapshots(ranks)?;
        println!(
            "ranks {ranks}: {:.0} MB, {snapshot:.2} s, {:.0} MB/s; plain {plain:.2} s, {:.0} MB/s; ratio {:.2}",
            1e-6 * bytes,
            1e-6 * bytes / snapshot,
            1e-6 * bytes / plain,
            plain / snapshot,
        );
        writeln!(table, "{ranks},{bytes},{snapshot:.4},{plain:.4}")?;
    }
    Ok(fs::write(record.join("snapshot.csv"), table)?)
}

fn main() -> anyhow::Result<()> {
    let Arguments { record, latency, bandwidth, times, snapshots, task, .. } = Arguments::parse();
    if let Some(task) = task {
        return measured::work(task);
    }
    fs::create_dir_all(&record)?;
    if times {
        return time_all(&record).map(|_| ());
    }
    if snapshots {
        return time_snapshots(&record);
    }
    let runs = count_all()?;
    tell_counts(&runs, &record)?;
    let Timed { particle, contact, .. } = time_all(&record)?;
    let costs = Costs { particle, contact, latency, bandwidth };
    foretell(&runs, &costs, &record)?;
    time_snapshots(&record)
}
