//! Tables, on the screen and in files, with a description of the machine.

use crate::measure::{Contacts, Entry, Rejections, Spread, Time};
use anyhow::Context;
use benchmarking::machine;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

/// Prints the results on one shape.
pub(crate) fn print(contacts: &[Contacts], rejections: &[Rejections]) {
    println!(
        "\n{:<22} {:<4} {:<25} {:>8} {:>17}  {:>26}  {:>26}  {:>26}  missed failed  {:>9} spurious",
        "grain",
        "",
        "method",
        "ns",
        "quartiles",
        "overlap median p99 max",
        "normal [rad]",
        "point",
        "apart ns"
    );
    for (c, apart) in contacts.iter().zip(rejections) {
        let spread = |s: &Spread| format!("{:8.1e} {:8.1e} {:8.1e}", s.median, s.p99, s.max);
        println!(
            "{:<22} {:<4} {:<25} {:8.1} {:>8.1} {:>8.1}  {}  {}  {}  {:>6} {:>6}  {:>9.1} {:>8}",
            c.entry.grain,
            c.entry.start.name(),
            c.entry.method,
            c.time.median,
            c.time.quartiles[0],
            c.time.quartiles[1],
            spread(&c.overlap),
            spread(&c.normal),
            spread(&c.point),
            c.missed,
            c.failed,
            apart.time.median,
            apart.spurious,
        );
    }
}

/// Writes `contacts.csv`, `rejections.csv` and `machine.txt`.
pub(crate) fn write(
    folder: &Path,
    contacts: &[Contacts],
    rejections: &[Rejections],
    load_before: &str,
) -> anyhow::Result<()> {
    // Before the tables are written: they count as changes to the commit.
    let machine = machine();
    let mut table =
        String::from("grain,start,method,settings,ns_median,ns_quartile_1,ns_quartile_3");
    for error in ["overlap", "relative_overlap", "normal_rad", "point"] {
        for which in ["median", "p99", "max"] {
            write!(table, ",{error}_{which}")?;
        }
    }
    table += ",missed,failed\n";
    for c in contacts {
        table += &row_start(&c.entry, &c.time);
        for s in [&c.overlap, &c.relative_overlap, &c.normal, &c.point] {
            write!(table, ",{:.3e},{:.3e},{:.3e}", s.median, s.p99, s.max)?;
        }
        writeln!(table, ",{},{}", c.missed, c.failed)?;
    }
    write_file(folder, "contacts.csv", &table)?;

    let mut table = String::from(
        "grain,start,method,settings,ns_median,ns_quartile_1,ns_quartile_3,spurious,failed\n",
    );
    for r in rejections {
        writeln!(table, "{},{},{}", row_start(&r.entry, &r.time), r.spurious, r.failed)?;
    }
    write_file(folder, "rejections.csv", &table)?;
    write_file(folder, "machine.txt", &format!("{machine}load before: {load_before}\n"))
}

fn row_start(entry: &Entry, time: &Time) -> String {
    format!(
        "{},{},{},{},{:.1},{:.1},{:.1}",
        entry.grain,
        entry.start.name(),
        entry.family.name(),
        entry.settings,
        time.median,
        time.quartiles[0],
        time.quartiles[1]
    )
}

pub(crate) fn write_file(folder: &Path, name: &str, text: &str) -> anyhow::Result<()> {
    fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))?;
    let path = folder.join(name);
    fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))
}

/// Processor, kernel, compiler, commit and present load.
pub(crate) fn machine() -> String {
    let field = |name: &str| machine::processor(name).unwrap_or_else(|| "unknown".into());
    let said = |program, arguments: &[&str]| {
        machine::said(program, arguments).unwrap_or_else(|| "unknown".into())
    };
    let cores = machine::cores();
    let features = ["avx", "avx2", "fma", "avx512f"];
    let flags = field("flags");
    let has = features.iter().filter(|f| flags.split(' ').any(|flag| flag == **f));
    format!(
        "processor: {}, {cores} cores, {}\nkernel: {}\ncompiler: {}\ncommit: {}\nload now: {}\n",
        field("model name"),
        has.copied().collect::<Vec<_>>().join(" "),
        said("uname", &["-sr"]),
        said("rustc", &["--version"]),
        said("git", &["describe", "--always", "--dirty"]),
        machine::load(3),
    )
}
