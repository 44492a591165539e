//! Sizes of new particles.

use crate::random::Random;
use serde::{Deserialize, Serialize};
use std::f64::consts::SQRT_2;

/// Distribution of the scales of the particles of a shape.
///
/// A scale is the ratio of a particle's lengths to those of its shape. Mass goes with its cube, moments of inertia with its fifth power.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum Sizes {
    /// All particles have the size of their shape.
    #[default]
    One,
    /// All scales between these two are equally likely.
    Uniform([f64; 2]),
    /// A law between limits.
    Drawn(Distribution),
}

impl Sizes {
    /// Draws the scale of a new particle. No random number is used for a single size.
    pub fn draw(&self, random: &mut Random) -> f64 {
        match self {
            Self::One => 1.0,
            Self::Uniform([least, largest]) => least + (largest - least) * random.unit(),
            Self::Drawn(distribution) => distribution.quantile(By::Number, random.unit()),
        }
    }

    /// Least and largest scale.
    pub fn scales(&self) -> [f64; 2] {
        match self {
            Self::One => [1.0; 2],
            Self::Uniform(scales) => *scales,
            Self::Drawn(distribution) => distribution.limits(),
        }
    }

    /// Description for `--plan`; empty for a single size.
    pub fn words(&self) -> String {
        match self {
            Self::One => String::new(),
            Self::Uniform(_) => self.distribution().map_or_else(String::new, |all| all.words()),
            Self::Drawn(distribution) => distribution.words(),
        }
    }

    /// Mean cube of scales: mean volume of particles over that of their shape.
    pub fn mean_volume(&self) -> f64 {
        match self {
            Self::One => 1.0,
            Self::Uniform([a, b]) => 0.25 * (a + b) * (a * a + b * b),
            Self::Drawn(distribution) => distribution.mean_volume,
        }
    }

    /// Distribution, if particles differ in size.
    pub fn distribution(&self) -> Option<Distribution> {
        match self {
            Self::One => None,
            Self::Uniform(limits) => Distribution::new(&Law::Uniform, By::Number, *limits),
            Self::Drawn(distribution) => Some(distribution.clone()),
        }
    }
}

/// Weight of shares.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum By {
    /// The number of particles.
    Number,
    /// The mass of particles.
    Mass,
}

impl By {
    /// Name in a scene.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Number => "number",
            Self::Mass => "mass",
        }
    }
}

/// A law of sizes, before it is cut off at limits.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Law {
    /// Equal shares of equal lengths.
    Uniform,
    /// Gauss' law.
    Normal {
        /// Mean.
        mean: f64,
        /// Standard deviation.
        deviation: f64,
    },
    /// Gauss' law of the logarithm.
    Lognormal {
        /// Scale below which half of the particles are.
        median: f64,
        /// Standard deviation of the natural logarithm.
        sigma: f64,
    },
    /// The share below s is `1 - exp(-(s / scale)^shape)` (Rosin and Rammler 1933, if by mass).
    Weibull {
        /// Scale below which 63.2 % are.
        scale: f64,
        /// Exponent.
        shape: f64,
    },
    /// Scales in rising order, each with the share below it, from 0 to 1; linear in between.
    Table(Vec<[f64; 2]>),
}

impl Law {
    /// Share below `s`, without limits; for [`Law::Uniform`], which has no bounds otherwise, between the given limits.
    pub fn below(&self, s: f64, [least, largest]: [f64; 2]) -> f64 {
        // `erfc` keeps the digits of values far below the mean.
        let normal = |deviations: f64| 0.5 * libm::erfc(-deviations / SQRT_2);
        match self {
            Self::Uniform => (s - least) / (largest - least),
            Self::Normal { mean, deviation } => normal((s - mean) / deviation),
            Self::Lognormal { median, sigma } => normal(libm::log(s / median) / sigma),
            Self::Weibull { scale, shape } => -libm::expm1(-libm::pow(s / scale, *shape)),
            Self::Table(rows) => {
                let above = rows.partition_point(|row| row[0] <= s);
                match (rows.get(above.wrapping_sub(1)), rows.get(above)) {
                    (Some([a, low]), Some([b, high])) => low + (high - low) * (s - a) / (b - a),
                    (None, _) => 0.0,
                    (_, None) => 1.0,
                }
            }
        }
    }

    fn words(&self) -> String {
        match self {
            Self::Uniform => "uniform".to_owned(),
            Self::Normal { mean, deviation } => {
                format!("normal of mean {mean:?} and deviation {deviation:?}")
            }
            Self::Lognormal { median, sigma } => {
                format!("lognormal of median {median:?} and sigma {sigma:?}")
            }
            Self::Weibull { scale, shape } => {
                format!("Weibull of scale {scale:?} and shape {shape:?}")
            }
            Self::Table(rows) => format!("a table of {} rows", rows.len()),
        }
    }
}

/// A law between limits, by number or by mass, as a table of bins.
///
/// In a bin its density is constant, by number or by mass like the law. Bins are so narrow that this changes no share by more than `STRAIGHT` of
/// a bin's. Uniform laws and tables are represented exactly. A draw uses only `+ - * /` and square roots, so its bits are the same on every
/// machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Distribution {
    law: Law,
    by: By,
    /// Edges of the bins, in rising order.
    edges: Vec<f64>,
    /// Share by number below each edge.
    number: Vec<f64>,
    /// Share by mass below each edge.
    mass: Vec<f64>,
    /// Mean cube of scales.
    mean_volume: f64,
}

impl Distribution {
    /// Largest deviation of the cumulative curve from a straight line in a bin, over the bin's share.
    const STRAIGHT: f64 = 5e-4;
    /// Bins with a smaller share are not divided.
    const LEAST_SHARE: f64 = 1e-12;
    /// Least share of a law between the limits.
    pub const LEAST_INSIDE: f64 = 1e-6;

    /// A law cut off at limits, `0 < least <= largest`; `None` if it has almost no share between them.
    pub fn new(law: &Law, by: By, limits: [f64; 2]) -> Option<Self> {
        let [least, largest] = limits;
        let [first, last] = limits.map(|s| law.below(s, limits));
        let inside = last - first;
        if least == largest || inside.is_nan() || inside < Self::LEAST_INSIDE {
            return None;
        }
        let below = |s: f64| (law.below(s, limits) - first) / inside;
        let mut edges = vec![least];
        let own: Vec<f64> = match law {
            Law::Table(rows) => rows.iter().map(|row| row[0]).collect(),
            _ => Vec::new(),
        };
        let inner = own.into_iter().filter(|s| (least..largest).contains(s) && *s > least);
        for end in inner.chain([largest]) {
            let start = edges[edges.len() - 1];
            divide([start, end], [below(start), below(end)], &below, 0, &mut edges);
        }
        Some(Self::of_bins(law.clone(), by, edges, &below))
    }

    fn of_bins(law: Law, by: By, edges: Vec<f64>, below: &dyn Fn(f64) -> f64) -> Self {
        let (mut number, mut mass) = (vec![0.0], vec![0.0]);
        let (mut all_number, mut all_mass) = (0.0, 0.0);
        for bin in edges.windows(2) {
            let share = (below(bin[1]) - below(bin[0])).max(0.0);
            let volume = mean_volume_in(by, [bin[0], bin[1]]);
            let (of_number, of_mass) = match by {
                By::Number => (share, share * volume),
                By::Mass => (share / volume, share),
            };
            all_number += of_number;
            all_mass += of_mass;
            number.push(all_number);
            mass.push(all_mass);
        }
        for share in &mut number {
            *share /= all_number;
        }
        for share in &mut mass {
            *share /= all_mass;
        }
        Self { law, by, edges, number, mass, mean_volume: all_mass / all_number }
    }

    /// Least and largest scale.
    pub fn limits(&self) -> [f64; 2] {
        [self.edges[0], self.edges[self.edges.len() - 1]]
    }

    /// Share below this scale, by number or by mass.
    pub fn below(&self, by: By, s: f64) -> f64 {
        let bin = self.edges.partition_point(|edge| *edge <= s);
        if bin == 0 {
            return 0.0;
        }
        let shares = self.shares(by);
        let Some(&share) = shares.get(bin) else { return 1.0 };
        let (before, [a, b]) = (shares[bin - 1], [self.edges[bin - 1], self.edges[bin]]);
        let part = match (self.by, by) {
            (By::Number, By::Number) | (By::Mass, By::Mass) => (s - a) / (b - a),
            (By::Number, By::Mass) => (s.powi(4) - a.powi(4)) / (b.powi(4) - a.powi(4)),
            (By::Mass, By::Number) => (a.powi(-2) - s.powi(-2)) / (a.powi(-2) - b.powi(-2)),
        };
        before + (share - before) * part
    }

    /// Scale below which this share is, by number or by mass.
    pub fn quantile(&self, by: By, share: f64) -> f64 {
        let shares = self.shares(by);
        // Bins without a share are skipped.
        let bin = shares.partition_point(|below| *below <= share).clamp(1, shares.len() - 1);
        let of_bin = shares[bin] - shares[bin - 1];
        // Only the last bin can be without a share here.
        let part = if of_bin > 0.0 { (share - shares[bin - 1]) / of_bin } else { 1.0 };
        let part = part.clamp(0.0, 1.0);
        let [a, b] = [self.edges[bin - 1], self.edges[bin]];
        let s = match (self.by, by) {
            (By::Number, By::Number) | (By::Mass, By::Mass) => a + (b - a) * part,
            (By::Number, By::Mass) => {
                let [a, b] = [a, b].map(|s| (s * s) * (s * s));
                (a + (b - a) * part).sqrt().sqrt()
            }
            (By::Mass, By::Number) => {
                let [a, b] = [a, b].map(|s| 1.0 / (s * s));
                1.0 / (a - (a - b) * part).sqrt()
            }
        };
        s.clamp(a, b)
    }

    /// Means of scales, of their squares and of their cubes by number, in closed form for each bin.
    pub fn mean_powers(&self) -> [f64; 3] {
        let mut means = [0.0; 3];
        for (shares, bin) in self.number.windows(2).zip(self.edges.windows(2)) {
            let of_bin = mean_powers_in(self.by, [bin[0], bin[1]]);
            for (mean, power) in means.iter_mut().zip(of_bin) {
                *mean += (shares[1] - shares[0]) * power;
            }
        }
        means
    }

    fn shares(&self, by: By) -> &[f64] {
        match by {
            By::Number => &self.number,
            By::Mass => &self.mass,
        }
    }

    fn words(&self) -> String {
        let [least, largest] = self.limits();
        let tenths = |by| [0.1, 0.5, 0.9].map(|share| format!("{:.4}", self.quantile(by, share)));
        format!(
            "{} by {}, from {least:?} to {largest:?}; 10, 50 and 90 % are below {} by number, {} by mass",
            self.law.words(),
            self.by.name(),
            tenths(By::Number).join(", "),
            tenths(By::Mass).join(", "),
        )
    }
}

/// Adds the edges of bins from `start` (already present) to `end`, in which the share `below` is nearly straight.
fn divide(
    [start, end]: [f64; 2],
    [low, high]: [f64; 2],
    below: &dyn Fn(f64) -> f64,
    depth: u32,
    edges: &mut Vec<f64>,
) {
    let share = high - low;
    let at = |part: f64| start + part * (end - start);
    let is_bent = |part: f64| {
        let off = below(at(part)) - (low + part * share);
        off.abs() > Distribution::STRAIGHT * share
    };
    let middle = at(0.5);
    // Points other than halves also find a narrow law in the middle of wide limits.
    let is_divided = depth < 48 && share > Distribution::LEAST_SHARE;
    if is_divided && start < middle && middle < end && [0.29, 0.5, 0.71].into_iter().any(is_bent) {
        let half = below(middle);
        divide([start, middle], [low, half], below, depth + 1, edges);
        divide([middle, end], [half, high], below, depth + 1, edges);
    } else {
        edges.push(end);
    }
}

/// Means of scales, of their squares and cubes by number, in a bin with a constant density by number or by mass.
fn mean_powers_in(by: By, [a, b]: [f64; 2]) -> [f64; 3] {
    let volume = mean_volume_in(by, [a, b]);
    match by {
        By::Number => [0.5 * (a + b), (a * a + a * b + b * b) / 3.0, volume],
        By::Mass => {
            // By number, the density goes with the inverse cube of the scale.
            let width = (b - a) / a;
            let per_width = if width > 0.0 { libm::log1p(width) / width } else { 1.0 };
            [2.0 * a * b / (a + b), 2.0 * a * b * b / (a + b) * per_width, volume]
        }
    }
}

/// Mean cube of scales by number, in a bin with a constant density by number or by mass.
fn mean_volume_in(by: By, [a, b]: [f64; 2]) -> f64 {
    match by {
        By::Number => 0.25 * (a + b) * (a * a + b * b),
        By::Mass => 2.0 * (a * b) * (a * b) / (a + b),
    }
}

#[cfg(test)]
mod tests {
    use super::{By, Distribution, Law};

    const LIMITS: [f64; 2] = [0.2, 5.0];

    fn laws() -> [Law; 5] {
        [
            Law::Uniform,
            Law::Normal { mean: 1.0, deviation: 0.3 },
            Law::Lognormal { median: 0.9, sigma: 0.4 },
            Law::Weibull { scale: 1.2, shape: 2.5 },
            Law::Table(vec![[0.3, 0.0], [0.5, 0.2], [0.8, 0.2], [1.9, 1.0]]),
        ]
    }

    /// The bins agree with their law, cut off at the limits, and quantile and share are inverse.
    #[test]
    fn bins_have_the_law_between_its_limits() {
        for law in laws() {
            for by in [By::Number, By::Mass] {
                let limits = if let Law::Table(_) = law { [0.3, 1.9] } else { LIMITS };
                let sizes = Distribution::new(&law, by, limits).unwrap();
                let [first, last] = limits.map(|s| law.below(s, limits));
                for k in 0..=1000 {
                    let s = limits[0] + (limits[1] - limits[0]) * f64::from(k) / 1000.0;
                    let closed = (law.below(s, limits) - first) / (last - first);
                    let off = (sizes.below(by, s) - closed).abs();
                    assert!(off < 5e-5, "{law:?} by {by:?} at {s}: {off:e}");
                    for other in [By::Number, By::Mass] {
                        let share = sizes.below(other, s);
                        let again = sizes.below(other, sizes.quantile(other, share));
                        assert!((share - again).abs() < 1e-12, "{law:?} {by:?} {other:?} {s}");
                    }
                }
                assert!(sizes.edges.len() < 10_000, "{law:?}: {} bins", sizes.edges.len());
            }
        }
    }

    /// Hatch and Choate 1929: a lognormal law by number is one by mass with the same sigma and a median larger by exp(3 sigma^2).
    #[test]
    fn number_and_mass_of_a_lognormal_law_are_hatch_and_choates() {
        let (median, sigma) = (1.0, 0.25);
        let limits = [0.05, 20.0];
        let by_number =
            Distribution::new(&Law::Lognormal { median, sigma }, By::Number, limits).unwrap();
        let of_mass = median * (3.0 * sigma * sigma).exp();
        let by_mass =
            Distribution::new(&Law::Lognormal { median: of_mass, sigma }, By::Mass, limits)
                .unwrap();
        let volume = (4.5 * sigma * sigma).exp();
        for sizes in [&by_number, &by_mass] {
            assert!((sizes.quantile(By::Number, 0.5) - median).abs() < 1e-5);
            assert!((sizes.quantile(By::Mass, 0.5) - of_mass).abs() < 1e-5);
            assert!((sizes.mean_volume / volume - 1.0).abs() < 1e-5, "{}", sizes.mean_volume);
        }
        for k in 1..100 {
            let s = f64::from(k) * 0.03;
            for by in [By::Number, By::Mass] {
                let off = (by_number.below(by, s) - by_mass.below(by, s)).abs();
                assert!(off < 1e-5, "{by:?} at {s}: {off:e}");
            }
        }
    }

    /// Uniform laws between 0.001 and 1 in closed form; others compared with sums over many equal parts of their logarithm.
    #[test]
    fn means_of_powers_are_those_of_the_law() {
        let limits: [f64; 2] = [1e-3, 1.0];
        let [a, b] = limits;
        let of = |law: &Law, by| Distribution::new(law, by, limits).unwrap().mean_powers();
        let is_near = |found: [f64; 3], expected: [f64; 3], part: f64| {
            for (found, expected) in found.into_iter().zip(expected) {
                assert!((found / expected - 1.0).abs() < part, "{found:e} {expected:e}");
            }
        };
        let by_number =
            [1, 2, 3].map(|n| (b.powi(n + 1) - a.powi(n + 1)) / (f64::from(n + 1) * (b - a)));
        is_near(of(&Law::Uniform, By::Number), by_number, 1e-12);
        // For a density with the inverse cube of the scale.
        let all = 0.5 * (a.powi(-2) - b.powi(-2));
        let by_mass = [(1.0 / a - 1.0 / b) / all, (b / a).ln() / all, (b - a) / all];
        let found = of(&Law::Uniform, By::Mass);
        is_near(found, by_mass, 1e-12);
        assert!((found[2] / found[1] - 0.1446).abs() < 1e-4, "Sauter's mean");
        for law in [
            Law::Normal { mean: 0.4, deviation: 0.3 },
            Law::Lognormal { median: 0.1, sigma: 1.0 },
            Law::Weibull { scale: 0.3, shape: 1.3 },
        ] {
            for by in [By::Number, By::Mass] {
                const PARTS: u32 = 200_000;
                let edge = |k: u32| a * (b / a).powf(f64::from(k) / f64::from(PARTS));
                let (mut number, mut sums) = (0.0, [0.0; 3]);
                for k in 0..PARTS {
                    let (low, high) = (edge(k), edge(k + 1));
                    let share = law.below(high, limits) - law.below(low, limits);
                    let middle = (low * high).sqrt();
                    let count = if by == By::Mass { share / middle.powi(3) } else { share };
                    number += count;
                    for (sum, n) in sums.iter_mut().zip(1..) {
                        *sum += count * middle.powi(n);
                    }
                }
                is_near(of(&law, by), sums.map(|sum| sum / number), 1e-3);
            }
        }
    }

    #[test]
    fn a_narrow_law_in_wide_limits_is_found() {
        let law = Law::Normal { mean: 50.005, deviation: 1e-3 };
        let sizes = Distribution::new(&law, By::Number, [0.01, 100.0]).unwrap();
        assert!((sizes.quantile(By::Number, 0.5) - 50.005).abs() < 1e-6);
        let far = Law::Normal { mean: 1.0, deviation: 0.01 };
        assert_eq!(Distribution::new(&far, By::Number, [2.0, 3.0]), None);
    }
}
