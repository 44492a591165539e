//! Advice on the choice of settings, derived from the results.

use super::{COMPARED_AT, Errors, Kind, Row};
use std::fmt::Write;

/// Relative energy error from which the program warns.
const MAY_MISS: f64 = 2e-3;

/// A paragraph on a kind of particles, from its rows alone.
pub(crate) fn of(kind: Kind, rows: &[Row], spread: &Errors) -> String {
    let of_what = |what: &'static str| rows.iter().filter(move |row| row.variant.what == what);
    let mut told = format!("**{}**: ", kind.name());
    // Two packings differ by this much in half of all cases. The largest of five differences is
    // larger by itself.
    let fits = |row: &&Row| is_within(&row.median, spread);
    let mut steps: Vec<&Row> = of_what("step").collect();
    steps.sort_by(|a, b| b.variant.setting.step.total_cmp(&a.variant.setting.step));
    let keeps = steps.iter().find(|row| fits(row) && row.largest.missing < MAY_MISS);
    let of_step = match keeps {
        Some(row) => format!(
            "a step of {} of the limit is enough: the median error is within the spread of the packings (stress {:.1} %, \
             contacts {:.1} %, a_c {:.3}), and at most {:.4} % of the energy is missing.",
            row.variant.value,
            100.0 * spread.stress,
            100.0 * spread.coordination,
            spread.a_c,
            100.0 * row.largest.missing
        ),
        None => "no step that was tried keeps the median error within the spread of the packings and all but 0.2 % of the energy."
            .to_owned(),
    };
    told.push_str(&of_step);
    let plain = steps.iter().find(|row| row.variant.setting.step == COMPARED_AT);
    for row in of_what("method").chain(of_what("stiffness")) {
        let times = plain.map_or(f64::NAN, |plain| row.seconds / plain.seconds);
        let verdict = if fits(&row) { "within" } else { "outside" };
        let missing = if row.largest.missing > MAY_MISS {
            format!(", and up to {:.0} % of the energy is missing", 100.0 * row.largest.missing)
        } else {
            String::new()
        };
        let compared = format!(
            " {} {}: {times:.2} times the time; stress off by {:.2} (at most {:.2}) %, contacts by {:.1} ({:.1}) %, a_c by \
             {:.3} ({:.3}): {verdict} the spread{missing}.",
            capital(row.variant.what),
            row.variant.value,
            100.0 * row.median.stress,
            100.0 * row.largest.stress,
            100.0 * row.median.coordination,
            100.0 * row.largest.coordination,
            row.median.a_c,
            row.largest.a_c,
        );
        told.push_str(&compared);
    }
    let skins: Vec<String> = of_what("skin")
        .filter_map(|row| {
            Some(format!("{} of it {:.2}", row.variant.value, row.seconds / plain?.seconds))
        })
        .collect();
    if !skins.is_empty() {
        let _ = write!(told, " Skin, times the time of the default: {}.", skins.join(", "));
    }
    told
}

/// True if no error exceeds the difference between two packings.
fn is_within(errors: &Errors, spread: &Errors) -> bool {
    errors.stress <= spread.stress
        && errors.coordination <= spread.coordination
        && errors.a_c <= spread.a_c
}

fn capital(word: &str) -> String {
    let mut letters = word.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}
