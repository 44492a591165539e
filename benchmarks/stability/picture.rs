//! The map as SVG: a row of boxes for each quantity, coloured by outcome.

use crate::cell::{Cell, Finding, Outcome};
use std::fmt::Write;
use std::path::Path;

/// Size of a box, and position of the first one.
const BOX: [usize; 2] = [62, 20];
const LEFT: usize = 300;
/// Largest number of boxes side by side.
const ALONG: usize = 10;

/// Colours that red-green blind readers can distinguish (Okabe and Ito).
const fn colour(outcome: Outcome) -> &'static str {
    match outcome {
        Outcome::Right => "#009E73",
        Outcome::RightAndWarned => "#56B4E9",
        Outcome::Warned => "#F0E442",
        Outcome::Stopped => "#E69F00",
        Outcome::Refused => "#BBBBBB",
        Outcome::Wrong => "#000000",
    }
}

/// Draws the map.
pub(crate) fn draw(path: &Path, cells: &[Cell], findings: &[Finding]) -> anyhow::Result<()> {
    let mut body = String::new();
    let mut y = 40;
    for (k, outcome) in Outcome::ALL.into_iter().enumerate() {
        let x = 10 + 150 * k;
        write!(
            body,
            "<rect x=\"{x}\" y=\"10\" width=\"14\" height=\"14\" fill=\"{}\"/>",
            colour(outcome)
        )?;
        writeln!(body, "<text x=\"{}\" y=\"21\">{}</text>", x + 20, outcome.name())?;
    }
    let all: Vec<(&Cell, &Finding)> = cells.iter().zip(findings).collect();
    for row in all.chunk_by(|(a, _), (b, _)| a.row == b.row) {
        writeln!(body, "<text x=\"10\" y=\"{}\">{}</text>", y + 14, escaped(row[0].0.row))?;
        for (line, cells) in row.chunks(ALONG).enumerate() {
            y += if line == 0 { 0 } else { BOX[1] + 2 };
            for (k, (cell, finding)) in cells.iter().enumerate() {
                let x = LEFT + k * (BOX[0] + 2);
                let text = if finding.outcome == Outcome::Wrong { "#FFFFFF" } else { "#000000" };
                let value = escaped(&cell.value);
                writeln!(
                    body,
                    "<g><title>{value}: {}. {}</title><rect x=\"{x}\" y=\"{y}\" width=\"{}\" height=\"{}\" fill=\"{}\"/>\
                     <text x=\"{}\" y=\"{}\" text-anchor=\"middle\" font-size=\"{}\" fill=\"{text}\">{value}</text></g>",
                    finding.outcome.name(),
                    escaped(&finding.why),
                    BOX[0],
                    BOX[1],
                    colour(finding.outcome),
                    x + BOX[0] / 2,
                    y + 14,
                    (100 / cell.value.chars().count().max(1)).clamp(5, 11),
                )?;
            }
        }
        y += BOX[1] + 6;
    }
    let width = LEFT + ALONG * (BOX[0] + 2) + 10;
    let svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{}\" font-family=\"sans-serif\" font-size=\"12\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#FFFFFF\"/>\n{body}</svg>\n",
        y + 10
    );
    Ok(std::fs::write(path, svg)?)
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
