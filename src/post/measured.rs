//! Results of requested measures, and means over a window, for `report.json` and the page.

use super::flow::Flow;
use super::means::Mean;
use super::mixing::Mixing;
use super::rows::{Group, Row, readable, rows};
use super::slope::Slope;
use serde::{Deserialize, Serialize};

/// Results at a snapshot. Results of the whole run stand at the last snapshot.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// Free surface of the snapshot, with `--slope`.
    pub slope: Option<Slope>,
    /// Mixing of the snapshot, with `--mixing`.
    pub mixing: Option<Mixing>,
    /// Fields of the last snapshot, with `--fields`.
    pub fields: Option<FieldsMade>,
    /// Rates of the run, with `--flow`.
    pub flow: Option<Flow>,
    /// Means over a window of the run.
    pub means: Vec<Mean>,
    /// Notes on the measures, one or more sentences each.
    pub notes: Vec<String>,
}

/// Grid and mass of fields.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FieldsMade {
    /// Number of cells along x, y and z.
    pub cells: [usize; 3],
    /// Width of the weight.
    pub width_m: f64,
    /// Integral of the density.
    pub mass_kg: f64,
}

impl Measured {
    /// The numbers in groups, for the page.
    pub fn groups(&self) -> Vec<Group> {
        let surface = self.slope.map(|slope| Group {
            title: "Free surface".into(),
            rows: rows([
                Some(Row::text("slope", format!("{:.1}", slope.angle_degrees), "degrees")),
                Row::number("height", Some(slope.height_m), "m"),
                Row::number("mean distance of columns from the line", Some(slope.scatter_m), "m"),
            ]),
        });
        let mixing = self.mixing.map(|mixing| Group {
            title: "Mixing".into(),
            rows: rows([
                mixing.index.map(|index| Row::text("Lacey's index", format!("{index:.3}"), "")),
                Some(Row::count("particles of a group", mixing.grains as f64)),
                Some(Row::count("cells with particles", mixing.cells as f64)),
            ]),
        });
        let flow = self.flow.map(|Flow { rate, .. }| Group {
            title: format!("Flow, {}", rate.window.words(rate.rows)),
            rows: rows([
                Row::number("mass rate", Some(rate.mass), "kg/s"),
                Row::number("mass rate in the first half", rate.halves.map(|h| h[0]), "kg/s"),
                Row::number("mass rate in the second half", rate.halves.map(|h| h[1]), "kg/s"),
                Row::number("number rate", Some(rate.grains), "particles/s"),
            ]),
        });
        let of_window = |means: &[Mean]| Group {
            title: format!("Mean ± scatter, {}", means[0].window.words(means[0].rows)),
            rows: means.iter().map(Mean::row).collect(),
        };
        let same = |a: &Mean, b: &Mean| a.window == b.window;
        let means = self.means.chunk_by(same).map(of_window);
        [surface, mixing, flow].into_iter().flatten().chain(means).collect()
    }
}

impl Mean {
    /// The mean with its scatter.
    fn row(&self) -> Row {
        let value = format!("{} ± {}", readable(self.mean), readable(self.scatter));
        Row::text(&self.quantity, value, &self.unit)
    }

    /// A line for the terminal.
    pub fn line(&self) -> String {
        let (mean, scatter) = (readable(self.mean), readable(self.scatter));
        let unit = if self.unit.is_empty() { String::new() } else { format!(" {}", self.unit) };
        let window = self.window.words(self.rows);
        format!("{}: {mean} ± {scatter}{unit}, mean and scatter {window}\n", self.quantity)
    }
}
