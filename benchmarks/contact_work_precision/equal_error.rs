//! Comparison of one method in this program and in parry at equal error: the fastest settings of this program with errors
//! no larger than those of parry, which has one setting.

use crate::measure::{Contacts, Spread, Start};
use crate::methods::Family;
use crate::record;
use std::fmt::Write as _;
use std::path::Path;

/// Ratio below which errors count as equal: a percentile of 1,024 contacts is not known better.
const EQUAL: f64 = 1.05;
/// Erosion as large as parry's, with tolerances at which packings come to rest: with 1e-4 and more they keep shaking.
const EROSION: [&str; 2] = ["5 % 1e-6", "5 % 5e-8"];
/// Errors below are rounding.
const ROUNDING: f64 = 4e-15;

/// Prints the ratios and writes `equal_error.csv`.
pub(crate) fn write(folder: &Path, contacts: &[Contacts]) -> anyhow::Result<()> {
    let mut table =
        String::from("grain,start,ours,theirs,ours_ns_quartile_1,theirs_ns_quartile_1,ratio");
    for error in ["overlap", "normal_rad"] {
        for which in ["median", "p99"] {
            write!(table, ",ours_{error}_{which},theirs_{error}_{which}")?;
        }
    }
    table += ",ours_lost,theirs_lost\n";
    println!("\nat equal error:");
    for theirs in contacts {
        let rivals = Family::RIVALS.iter().find(|(_, rival)| *rival == theirs.entry.family);
        let Some((family, _)) = rivals else { continue };
        let is_rival = |c: &&Contacts| {
            let (entry, rival) = (&c.entry, &theirs.entry);
            let is_same = *family != Family::Erosion || EROSION.contains(&entry.settings.as_str());
            is_same
                && entry.family == *family
                && entry.grain == rival.grain
                && entry.start == rival.start
        };
        let equal = contacts.iter().filter(is_rival).filter(|ours| no_worse(ours, theirs));
        let fastest = equal.min_by(|a, b| a.time.quartiles[0].total_cmp(&b.time.quartiles[0]));
        let (grain, start) = (&theirs.entry.grain, theirs.entry.start.name());
        let Some(ours) = fastest else {
            println!("{grain:<22} {start:<4} {:<20} no setting of ours", theirs.entry.method);
            writeln!(table, "{grain},{start},none,{}", theirs.entry.method)?;
            continue;
        };
        // Lower quartiles, which other work on the machine disturbs least. A start that slows a method down is not used
        // for it.
        let is_same = |c: &&Contacts| {
            c.entry.method == theirs.entry.method && c.entry.grain == theirs.entry.grain
        };
        let starts = contacts.iter().filter(is_same);
        let starts =
            starts.filter(|c| c.entry.start == theirs.entry.start || c.entry.start == Start::Cold);
        let theirs_ns = starts.map(|c| c.time.quartiles[0]).fold(f64::INFINITY, f64::min);
        let ratio = theirs_ns / ours.time.quartiles[0];
        println!(
            "{grain:<22} {start:<4} {:<20} {:>8.0} ns  {:<25} {:>8.0} ns  {ratio:>5.1} times as fast; \
             normal, 99th percentile: ours {:.1e}, theirs {:.1e} rad; lost: {}, {}",
            ours.entry.method,
            ours.time.quartiles[0],
            theirs.entry.method,
            theirs_ns,
            ours.normal.p99,
            theirs.normal.p99,
            lost(ours),
            lost(theirs),
        );
        write!(
            table,
            "{grain},{start},{},{},{:.1},{:.1},{ratio:.2}",
            ours.entry.method, theirs.entry.method, ours.time.quartiles[0], theirs_ns
        )?;
        for [ours, theirs] in [[&ours.overlap, &theirs.overlap], [&ours.normal, &theirs.normal]] {
            for [ours, theirs] in [[ours.median, theirs.median], [ours.p99, theirs.p99]] {
                write!(table, ",{ours:.3e},{theirs:.3e}")?;
            }
        }
        writeln!(table, ",{},{}", lost(ours), lost(theirs))?;
    }
    record::write_file(folder, "equal_error.csv", &table)
}

/// Number of contacts without a result.
fn lost(c: &Contacts) -> usize {
    c.missed + c.failed
}

fn no_worse(ours: &Contacts, theirs: &Contacts) -> bool {
    let within = |a: f64, b: f64| a <= ROUNDING.max(EQUAL * b);
    let both = |a: &Spread, b: &Spread| within(a.median, b.median) && within(a.p99, b.p99);
    lost(ours) <= lost(theirs)
        && both(&ours.overlap, &theirs.overlap)
        && both(&ours.normal, &theirs.normal)
}
