//! The table: on the screen, as Markdown, and with all sub-cases as CSV.

use crate::cases::{Case, Verdict};
use anyhow::Context;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

/// A number with a sensible number of digits.
fn short(x: f64) -> String {
    if x == 0.0 {
        "0".to_owned()
    } else if (1e-2..1e5).contains(&x.abs()) {
        let digits = (4 - x.abs().log10().floor() as i32).clamp(0, 6) as usize;
        format!("{x:.digits$}")
    } else {
        format!("{x:.2e}")
    }
}

/// Prints one line per case, with its worst sub-case.
pub(crate) fn print(cases: &[Case]) {
    for case in cases {
        let worst = case.worst();
        println!(
            "  {:<12} {} | {} | worst of {}: {} | {} | {} | off {:.2e} of {:e}",
            case.verdict().name(),
            case.name,
            case.quantity,
            case.rows.len(),
            worst.what,
            short(worst.published),
            short(worst.own),
            worst.deviation(),
            case.tolerance,
        );
    }
}

/// Writes `report.md`, with images given by file without ending and title, and `cases.csv`.
pub(crate) fn write(
    folder: &Path,
    command: &str,
    cases: &[Case],
    images: &[(&str, &str)],
    notes: &[String],
) -> anyhow::Result<()> {
    let report = report(command, cases, images, notes)?;
    fs::write(folder.join("report.md"), report).context("cannot write report.md")?;
    write_rows(&folder.join("cases.csv"), cases)
}

/// All cases, each with its worst sub-case, as Markdown.
fn report(
    command: &str,
    cases: &[Case],
    images: &[(&str, &str)],
    notes: &[String],
) -> Result<String, std::fmt::Error> {
    let count = |verdict: Verdict| cases.iter().filter(|case| case.verdict() == verdict).count();
    let mut report = format!(
        "# Verification\n\n```\n{command}\n```\n\n{} cases with {} sub-cases: {} hold, {} fall short as is known, {} fail. \
         Each line shows the worst of its sub-cases ([all of them](cases.csv)).\n",
        cases.len(),
        cases.iter().map(|case| case.rows.len()).sum::<usize>(),
        count(Verdict::Holds),
        count(Verdict::FallsShort),
        count(Verdict::Fails) + count(Verdict::HoldsNow),
    );
    for note in notes {
        writeln!(report, "\n{note}")?;
    }
    let mut source = "";
    for case in cases {
        if case.source != source {
            source = case.source;
            write!(
                report,
                "\n## {source}\n\n| case | quantity | worst of | sub-case | published | here | deviation | tolerance | its reason | |\n\
                 |---|---|---|---|---|---|---|---|---|---|\n"
            )?;
        }
        let worst = case.worst();
        let verdict = match (case.verdict(), case.short_until) {
            (Verdict::FallsShort, Some(why)) => format!("**falls short**: {why}"),
            (verdict, _) => verdict.name().to_owned(),
        };
        writeln!(
            report,
            "| {} | {} | {} | {} | {} | {} | {:.1e} | {:e} | {} | {verdict} |",
            case.name,
            case.quantity,
            case.rows.len(),
            worst.what,
            short(worst.published),
            short(worst.own),
            worst.deviation(),
            case.tolerance,
            case.reason,
        )?;
    }
    if !images.is_empty() {
        report += "\n## Pictures\n\n";
    }
    for (file, title) in images {
        writeln!(report, "![{title}]({file}.svg)")?;
    }
    Ok(report)
}

/// Writes all sub-cases.
fn write_rows(path: &Path, cases: &[Case]) -> anyhow::Result<()> {
    let mut table = csv::Writer::from_path(path)?;
    table.write_record([
        "source",
        "case",
        "quantity",
        "sub_case",
        "published",
        "here",
        "deviation",
        "tolerance",
        "verdict",
    ])?;
    for case in cases {
        for row in &case.rows {
            let numbers =
                [row.published, row.own, row.deviation(), case.tolerance].map(|x| format!("{x:e}"));
            let texts = [case.source, &case.name, &case.quantity, &row.what];
            let verdict = [case.verdict().name()];
            table.write_record(
                texts.into_iter().chain(numbers.iter().map(String::as_str)).chain(verdict),
            )?;
        }
    }
    table.flush()?;
    Ok(())
}
