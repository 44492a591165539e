//! All statements of Lai et al. (2021) with their verdicts. Sections 2 and 3 follow from the findings of
//! [`crate::single_contact`] and [`crate::triaxial`]. The predictions of section 3.4 follow from the tables of the
//! sensitivity study. The conclusions of section 4 follow from the others.
//!
//! Advice (the choice of the erosion ratio) and visual similarity (to curves of medium dense sand) are left out.
//!
//! | file | content |
//! |---|---|
//! | [`predictions`] | predictions of section 3.4 on softer particles |
//! | [`conclusions`] | section 4 |

pub mod conclusions;
pub mod predictions;

use crate::findings::{Kind, Reading, Row, Verdict};
use dem_mpi::post::report::csv;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Errors of the table of statements.
#[derive(Debug, thiserror::Error)]
pub enum StatementsError {
    /// There are no findings.
    #[error(
        "no findings.csv in {}: lai2021 section-2 and section-3 write one",
        folders.iter().map(|folder| folder.display().to_string()).collect::<Vec<_>>().join(", ")
    )]
    Nothing {
        /// Searched folders.
        folders: Vec<PathBuf>,
    },
    /// An existing table cannot be read.
    #[error("cannot read {path}: {cause}", path = path.display())]
    Unreadable {
        /// Path of the table.
        path: PathBuf,
        /// Cause of the error.
        cause: csv::Error,
    },
    /// The table could not be written.
    #[error("cannot write a table: {0}")]
    Table(#[from] csv::Error),
}

/// Names and contents of `statements.csv` and `statements.md`, from folders with `findings.csv` or tables of the
/// sensitivity study.
///
/// # Errors
/// See [`StatementsError`].
pub fn regenerate(folders: &[PathBuf]) -> Result<Vec<(String, String)>, StatementsError> {
    let mut rows = Vec::new();
    for folder in folders {
        rows.extend(table::<Row>(&folder.join("findings.csv"))?);
    }
    if rows.is_empty() {
        return Err(StatementsError::Nothing { folders: folders.to_vec() });
    }
    let mut packings = Vec::new();
    let mut responses = Vec::new();
    for folder in folders {
        packings.extend(table(&folder.join("erosion_means.csv"))?);
        responses.extend(table(&folder.join("response_means.csv"))?);
    }
    rows.extend(predictions::rows(&packings, &responses));
    let conclusions = conclusions::rows(&rows);
    rows.extend(conclusions);
    // By section; within a section in the order of its own report.
    rows.sort_by_key(|row| section(row).to_string());
    Ok(vec![("statements.csv".into(), csv(&rows)?), ("statements.md".into(), page(&rows))])
}

/// Rows of a table; empty if the file does not exist.
fn table<T: serde::de::DeserializeOwned>(path: &Path) -> Result<Vec<T>, StatementsError> {
    let unreadable = |cause| StatementsError::Unreadable { path: path.to_path_buf(), cause };
    if !path.exists() {
        return Ok(Vec::new());
    }
    let mut reader = csv::Reader::from_path(path).map_err(unreadable)?;
    reader.deserialize().collect::<Result<_, _>>().map_err(unreadable)
}

/// Section of the paper: the digits before the first point or blank. Checks of this code have none.
fn section(row: &Row) -> &str {
    let end = row.part.find(|c: char| !c.is_ascii_digit()).unwrap_or(row.part.len());
    &row.part[..end]
}

/// Number of statements with each verdict, the best first.
pub fn counts<'a>(rows: impl Iterator<Item = &'a Row>) -> [usize; 4] {
    let mut counts = [0; 4];
    for row in rows {
        counts[row.verdict as usize] += 1;
    }
    counts
}

const HEAD: &str = "\
# Every statement of Lai et al. (2021), and what came of it

Z. Lai, S. Zhao, J. Zhao, L. Huang, *Revisiting the GJK and shape erosion method for contact resolution in DEM*, Powder \
Technology (2021). Written by `lai2021 statements` from the findings of both sections (`findings.csv`) and the sensitivity study; \
the same as a table: `statements.csv`.

The paper can be read in two ways. Its table 1 says *GJK + GJK-erosion*: erosion is asked only about bodies that GJK finds touching. Its fig. 3 \
has pairs of small clearance found touching, which only erosion *alone* does. No way of reading makes both true, so every \
statement is judged with each. *Alone*, erosion is a method whose force begins at zero; after GJK the force jumps at touch, and packings do not come to rest.
";
const SETTINGS: &str = "\
Conditions that the paper sets (particles, strain, confining pressure) hold by construction; they are listed and not counted. So are checks of this \
code's own runs, in the reports. Section 4 repeats sections 2 and 3: a conclusion has the worst verdict of what it rests on.
";

fn page(rows: &[Row]) -> String {
    let mut page = format!(
        "{HEAD}\n| | erosion | reproduce | nearly | do not | no data |\n|---|---|---|---|---|---|\n"
    );
    let mut told = |name: &str, wanted: &dyn Fn(&Row) -> bool| {
        for reading in Reading::ALL {
            let of =
                |row: &&Row| row.kind == Kind::Statement && row.reading == reading && wanted(row);
            let [yes, nearly, no, untold] = counts(rows.iter().filter(of));
            let words = words(reading);
            let _ = writeln!(page, "| {name} | {words} | {yes} | {nearly} | {no} | {untold} |");
        }
    };
    told("section 2", &|row| section(row) == "2");
    told("section 3", &|row| section(row) == "3");
    told("**both sections**", &|row| ["2", "3"].contains(&section(row)));
    told("section 4, conclusions", &|row| section(row) == "4");
    let _ = writeln!(page, "\n{SETTINGS}");
    let mut parts: Vec<&str> = Vec::new();
    for row in rows.iter().filter(|row| row.kind != Kind::Check) {
        if !parts.contains(&row.part.as_str()) {
            parts.push(&row.part);
        }
    }
    for part in parts {
        let _ = writeln!(
            page,
            "## {part}\n\n| | the paper | here, with GJK + erosion | verdict | here, with erosion alone | verdict |\n|---|---|---|---|---|---|"
        );
        let of = |reading| {
            let listed = move |row: &&Row| row.part == part && row.reading == reading;
            rows.iter().filter(|row| row.kind != Kind::Check).filter(listed)
        };
        for row in of(Reading::Checked) {
            let alone = of(Reading::Alone).find(|other| other.name == row.name);
            let (here, verdict) = match alone {
                None => ("–", Verdict::Untold),
                Some(other) if other.here == row.here => ("the same", other.verdict),
                Some(other) => (other.here.as_str(), other.verdict),
            };
            let Row { figure, statement, .. } = row;
            let (own, words) = (row.verdict.words(), verdict.words());
            let _ = writeln!(
                page,
                "| {figure} | {statement} | {} | {own} | {here} | {words} |",
                row.here
            );
        }
        page.push('\n');
    }
    page
}

const fn words(reading: Reading) -> &'static str {
    match reading {
        Reading::Checked => "GJK + erosion",
        Reading::Alone => "alone",
    }
}
