//! Other codes beside this one, from the same state with the same constants: agreement of the motion, and time. They
//! are started by name (`lmp`, `liggghts`: Debian's packages `lammps`, `liggghts`).
//!
//! ```text
//! cargo bench --bench peers -- converge               steps towards zero: each code against its finest step, and the
//!                                                     finest steps against each other
//! cargo bench --bench peers -- time                   time of a step, in turns, on 1 and 2 ranks
//! cargo bench --bench peers -- time --steps 100 --rounds 1       the same, to try
//! cargo bench --bench peers -- time --tiles 7 --shuffled --steps 100 --rounds 1  the same of 980,000 spheres
//! cargo bench --bench peers -- drum                   the same in a drum of 1,200 triangles, beside LIGGGHTS
//! cargo bench --bench peers -- settled                5,120 settled ellipsoids, by this program alone
//! cargo bench --bench peers -- answer FILE            where LAMMPS' finest step brings the spheres of --scene, as CSV
//! ```
//!
//! Tables go to target/peers, or into the folder of `--record`. All constants come from the scene file; the decks
//! beside this file have none.

mod case;
mod codes;
mod converge;
mod drum;
mod speed;

use case::Case;
use clap::{Parser, Subcommand};
use std::path::PathBuf;

#[derive(Parser)]
struct Arguments {
    #[command(subcommand)]
    task: Task,
    /// Equal spheres in a box without a lid.
    #[arg(long, global = true, default_value = "benchmarks/peers/spheres.toml")]
    scene: PathBuf,
    /// Write the tables into this folder.
    #[arg(long, global = true, value_name = "FOLDER", default_value = "target/peers")]
    record: PathBuf,
    /// Cargo passes this.
    #[arg(long, hide = true, global = true)]
    bench: bool,
}

#[derive(Subcommand)]
enum Task {
    /// Compare positions after a millisecond.
    Converge(converge::Options),
    /// Compare times.
    Time(speed::Options),
    /// Compare times in a drum of triangles.
    Drum(drum::Options),
    /// Time settled ellipsoids.
    Settled(speed::Turns),
    /// Write LAMMPS' positions after a millisecond.
    Answer {
        /// CSV: start and end of each sphere [m].
        file: PathBuf,
        /// Time step [s].
        #[arg(long, default_value_t = 1e-7)]
        finest: f64,
        /// Only this number of spheres, those nearest to the corner of the box.
        #[arg(long)]
        corner: Option<usize>,
    },
}

fn main() -> anyhow::Result<()> {
    let arguments = Arguments::parse();
    std::fs::create_dir_all(&arguments.record)?;
    let case = || Case::read(&arguments.scene);
    match arguments.task {
        Task::Converge(options) => converge::converge(&case()?, &options, &arguments.record),
        Task::Time(options) => speed::time(case()?, &options, &arguments.record),
        Task::Settled(turns) => speed::settled(&turns, &arguments.record),
        Task::Drum(options) => drum::time(&options, &arguments.record),
        Task::Answer { file, finest, corner } => {
            let mut case = case()?;
            case.cut(corner.unwrap_or(usize::MAX));
            converge::answer(&case, finest, &file)
        }
    }
}
