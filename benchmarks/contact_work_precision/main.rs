//! Work against precision of contact resolution: cost and error of each method.
//!
//! ```text
//! cargo bench --bench contact_work_precision                         prints; writes to target/
//! cargo bench --bench contact_work_precision -- --quick              a few seconds, for CI
//! cargo bench --bench contact_work_precision -- --record FOLDER      tables, plots and the machine
//! cargo bench --bench contact_work_precision -- --count 10000000     is the common normal ever wrong?
//! cargo bench --bench contact_work_precision -- --faces              what contacts of faces cost, beside EPA
//! ```
//!
//! To add a shape, name it in [`pairs::grains`]; to add a method, in [`methods::contestants`].

mod count;
mod equal_error;
mod faces;
mod facets;
mod measure;
mod methods;
mod pairs;
mod parry;
mod plot;
mod record;

use benchmarking::machine::load;
use clap::Parser;
use measure::Effort;
use std::path::PathBuf;

#[derive(Parser)]
struct Arguments {
    /// Few pairs and few repeats.
    #[arg(long)]
    quick: bool,
    /// Write the tables, the plots and a description of the machine into this folder.
    #[arg(long, value_name = "FOLDER")]
    record: Option<PathBuf>,
    /// Instead, count the failures of the common normal over this number of random pairs.
    #[arg(long, value_name = "PAIRS")]
    count: Option<u64>,
    /// Instead, time contacts of faces and packings of solids.
    #[arg(long)]
    faces: bool,
    /// Only these shapes (part of the name).
    #[arg(long, value_name = "NAME", default_value = "")]
    grain: String,
    /// Only these methods (part of the name), to profile them.
    #[arg(long, value_name = "NAME", default_value = "")]
    method: String,
    /// Cargo passes this for benchmarks, but not for tests.
    #[arg(long, hide = true)]
    bench: bool,
}

fn main() -> anyhow::Result<()> {
    let arguments = Arguments::parse();
    if let Some(pairs) = arguments.count {
        return count::run(pairs, arguments.record.as_deref());
    }
    let effort = if arguments.quick || !arguments.bench { Effort::QUICK } else { Effort::FULL };
    let folder = arguments.record.unwrap_or_else(|| {
        PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("target/contact-work-precision")
    });

    if arguments.faces {
        return faces::run(&effort, &folder);
    }
    let before = load(3);
    let mut contacts = Vec::new();
    let mut rejections = Vec::new();
    for grain in pairs::grains().iter().filter(|grain| grain.name.contains(&arguments.grain)) {
        let mut contestants = methods::contestants(&grain.shape);
        contestants.retain(|contestant| contestant.name().contains(&arguments.method));
        let (touching, apart) = measure::grain(grain, &contestants, &effort);
        record::print(&touching, &apart);
        contacts.extend(touching);
        rejections.extend(apart);
    }
    equal_error::write(&folder, &contacts)?;
    record::write(&folder, &contacts, &rejections, &before)?;
    plot::write(&folder, &contacts)?;
    println!("written to {}", folder.display());
    Ok(())
}
