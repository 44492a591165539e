//! Predictions of section 3.4 on particles of reduced stiffness, tested on means over packings: `erosion_means.csv` and
//! `response_means.csv` of `run/paper/sensitivity/run`.

use crate::findings::{Kind, Reading, Row, Verdict};
use dem_mpi::post::report::readable;
use serde::Deserialize;

/// A row of `erosion_means.csv`.
#[derive(Clone, Debug, Deserialize)]
pub struct Packing {
    /// Method, named like the folders of runs.
    pub method: String,
    /// First erosion ratio; 0 without erosion.
    pub erosion_ratio: f64,
    /// Stiffness of contacts [N/m].
    pub stiffness_n_per_m: f64,
    /// Number of packings of this kind.
    pub packings: u32,
    /// Mean coordination number.
    pub coordination: f64,
    /// Standard deviation of the coordination number between packings.
    pub coordination_deviation: f64,
}

/// A row of `response_means.csv`.
#[derive(Clone, Debug, Deserialize)]
pub struct Response {
    /// Method, named like the folders of runs.
    pub method: String,
    /// First erosion ratio; 0 without erosion.
    pub erosion_ratio: f64,
    /// Stiffness of contacts [N/m].
    pub stiffness_n_per_m: f64,
    /// Largest `q/p`.
    pub peak_q_over_p: f64,
    /// Mean `q/p` over axial strains of 25 to 36 %.
    pub plateau_q_over_p: f64,
    /// Mean volumetric strain over axial strains of 25 to 36 %.
    pub plateau_volumetric_strain: f64,
    /// Anisotropy of contact normals at the peak.
    pub peak_a_c: f64,
}

/// First erosion ratio of the paper.
const RATIO: f64 = 0.05;
const EXACT: &str = "common-normal";
const PART: &str = "3.4 Reduced stiffness (predicted)";

const fn folder(reading: Reading) -> &'static str {
    match reading {
        Reading::Checked => "gjk-gjk-erosion",
        Reading::Alone => "gjk-erosion",
    }
}

/// Predictions with both readings of erosion.
pub fn rows(packings: &[Packing], responses: &[Response]) -> Vec<Row> {
    let mut rows = Vec::new();
    for reading in Reading::ALL {
        let mut add =
            |name: &str, figure: &str, statement: &str, found: Option<(String, Verdict)>| {
                let (here, verdict) = found.unwrap_or(("–".into(), Verdict::Untold));
                rows.push(Row {
                    part: PART.into(),
                    name: name.into(),
                    kind: Kind::Statement,
                    figure: figure.into(),
                    statement: statement.into(),
                    reading,
                    here,
                    verdict,
                });
            };
        add(
            "softer_coordination",
            "3.4",
            "with reduced stiffness Z decreases less",
            coordination(packings, reading),
        );
        add(
            "softer_response",
            "3.4",
            "with reduced stiffness the effects on fabric and stress-strain behaviour are still negligible",
            response(responses, reading),
        );
    }
    rows
}

/// The smallest and the largest stiffness, if there are two.
fn ends(stiffnesses: impl Iterator<Item = f64> + Clone) -> Option<(f64, f64)> {
    let low = stiffnesses.clone().reduce(f64::min)?;
    let high = stiffnesses.reduce(f64::max)?;
    (low < high).then_some((low, high))
}

fn coordination(packings: &[Packing], reading: Reading) -> Option<(String, Verdict)> {
    let (soft, hard) = ends(packings.iter().map(|row| row.stiffness_n_per_m))?;
    // Loss of contacts per particle, and its standard error.
    let loss = |stiffness: f64| {
        let of = |method: &str, ratio: f64| {
            let is = |row: &&Packing| {
                row.method == method
                    && row.erosion_ratio == ratio
                    && row.stiffness_n_per_m == stiffness
            };
            packings.iter().find(is)
        };
        let (truth, eroded) = (of(EXACT, 0.0)?, of(folder(reading), RATIO)?);
        let variance = |row: &Packing| row.coordination_deviation.powi(2) / f64::from(row.packings);
        let error = (variance(truth) + variance(eroded)).sqrt();
        Some((truth.coordination - eroded.coordination, error))
    };
    let ((first, error), (then, error_then)) = (loss(hard)?, loss(soft)?);
    let here = format!(
        "by {first:.2} ± {error:.2} at {hard:.1e} N/m, by {then:.2} ± {error_then:.2} at {soft:.1e} N/m"
    );
    let verdict = match then.abs() / first.abs() {
        // Then there is no loss that could become smaller.
        _ if first < 0.1 => Verdict::No,
        ..=0.5 => Verdict::Yes,
        ..1.0 => Verdict::Nearly,
        _ => Verdict::No,
    };
    Some((here, verdict))
}

fn response(responses: &[Response], reading: Reading) -> Option<(String, Verdict)> {
    // Limits of relative differences that are negligible, and nearly so, as for the stiffness of the paper. A volumetric
    // strain near zero is compared with one of 5 %.
    type Pick = fn(&Response) -> f64;
    const VOLUMETRIC: &str = "volumetric strain there";
    const QUANTITIES: [(&str, Pick, f64, f64); 4] = [
        ("peak q/p", |row| row.peak_q_over_p, 0.05, 0.1),
        ("plateau", |row| row.plateau_q_over_p, 0.05, 0.1),
        (VOLUMETRIC, |row| row.plateau_volumetric_strain, 0.1, 0.2),
        ("a_c at the peak", |row| row.peak_a_c, 0.1, 0.2),
    ];
    let (soft, _) = ends(responses.iter().map(|row| row.stiffness_n_per_m))?;
    let of = |method: &str, ratio: f64| {
        let is = |row: &&Response| {
            row.method == method && row.erosion_ratio == ratio && row.stiffness_n_per_m == soft
        };
        responses.iter().find(is)
    };
    let (truth, eroded) = (of(EXACT, 0.0)?, of(folder(reading), RATIO)?);
    let found = QUANTITIES.map(|(name, pick, yes, nearly)| {
        let (e, t) = (pick(eroded), pick(truth));
        let scale = if name == VOLUMETRIC { t.abs().max(0.05) } else { t.abs() };
        let off = (e - t) / scale;
        let words = format!("{name} {} and {}: {:+.1} %", readable(e), readable(t), 100.0 * off);
        (words, Verdict::small(off, yes, nearly))
    });
    let verdict = Verdict::worst(found.iter().map(|f| f.1));
    let words = found.map(|f| f.0).join(", ");
    Some((format!("at {soft:.1e} N/m: {words}"), verdict))
}
