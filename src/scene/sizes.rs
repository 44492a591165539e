//! Particle sizes of a shape, from the parsed file to [`Sizes`].

use super::reader::Given;
use crate::population::sizes::{By, Distribution, Law, Sizes};

/// Allowed values of `limits` and `uniform`.
const TWO: &str = "a list of two numbers greater than 0: the smallest scale and the largest";
/// Allowed values of `table`.
const ROWS: &str =
    "a list of two or more [scale, smaller share], both increasing, shares from 0 to 1";

/// Distribution of sizes: scales of all lengths of the shape.
pub(super) fn sizes(given: &Given) -> Option<Sizes> {
    let section = given.section()?;
    let by = section.read_or("by", By::Number, by);
    let limits = section.get("limits");
    let given_limits = limits.as_ref().map(two);
    let laws = [
        section.get("uniform").map(|given| two(&given).map(|limits| (Law::Uniform, Some(limits)))),
        section.get("table").map(|given| table(&given)),
        section.get("normal").map(|given| {
            let [mean, deviation] = parameters(&given, ["mean", "deviation"])?;
            Some((Law::Normal { mean, deviation }, None))
        }),
        section.get("lognormal").map(|given| {
            let [median, sigma] = parameters(&given, ["median", "sigma"])?;
            Some((Law::Lognormal { median, sigma }, None))
        }),
        section.get("weibull").map(|given| {
            let [scale, shape] = parameters(&given, ["scale", "shape"])?;
            Some((Law::Weibull { scale, shape }, None))
        }),
    ];
    let mut laws = laws.into_iter().flatten();
    let (Some(law), None) = (laws.next(), laws.next()) else {
        section.fail("give one of `uniform`, `normal`, `lognormal`, `weibull`, `table`");
        return None;
    };
    let (law, own_limits) = law?;
    let limits = match (own_limits, given_limits) {
        (Some(own), None) => own,
        (Some(_), Some(_)) => {
            limits?.fail("`uniform` and `table` have their own limits");
            return None;
        }
        (None, Some(limits)) => limits?,
        (None, None) => {
            section.fail(format!("`limits` is missing: {TWO}"));
            return None;
        }
    };
    let by = by?;
    if law == Law::Uniform && (by == By::Number || limits[0] == limits[1]) {
        return Some(Sizes::Uniform(limits));
    }
    let inside = law.below(limits[1], limits) - law.below(limits[0], limits);
    let distribution = Distribution::new(&law, by, limits);
    if distribution.is_none() {
        let least = Distribution::LEAST_INSIDE;
        section.fail(format!(
            "the limits {:?} and {:?} contain a share of {inside:.1e} of this distribution, less than {least:e}: \
             change the limits, or the distribution",
            limits[0], limits[1]
        ));
    }
    distribution.map(Sizes::Drawn)
}

/// Quantity of shares.
pub(super) fn by(given: &Given) -> Option<By> {
    given.one_of(&[By::Number, By::Mass].map(|by| (by.name(), by)))
}

/// The two numbers of a law.
fn parameters(given: &Given, keys: [&'static str; 2]) -> Option<[f64; 2]> {
    let section = given.section()?;
    let [first, second] = keys.map(|key| section.number(key));
    Some([first?, second?])
}

/// Smallest and largest scale.
fn two(given: &Given) -> Option<[f64; 2]> {
    let [least, largest] = given.list_of(Given::number)?;
    if least > largest {
        given.fail(format!("{least:?} is more than {largest:?}; must be {TWO}"));
        return None;
    }
    Some([least, largest])
}

/// A cumulative curve, with its ends.
fn table(given: &Given) -> Option<(Law, Option<[f64; 2]>)> {
    let rows: Option<Vec<[f64; 2]>> =
        given.list()?.iter().map(|row| row.list_of(Given::number)).collect();
    let rows = rows?;
    let rises = rows.windows(2).all(|pair| pair[0][0] < pair[1][0] && pair[0][1] <= pair[1][1]);
    let (Some(first), Some(last)) = (rows.first(), rows.last()) else {
        given.fail(format!("is empty; must be {ROWS}"));
        return None;
    };
    let limits = [first[0], last[0]];
    if !rises || rows.len() < 2 || (first[1], last[1]) != (0.0, 1.0) {
        given.fail(format!("must be {ROWS}"));
        return None;
    }
    Some((Law::Table(rows), Some(limits)))
}
