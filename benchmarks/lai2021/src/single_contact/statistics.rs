//! Statistics of errors.

use serde::Serialize;

/// Mean, percentiles and extremes of errors, in their own unit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Sampling of the pairs.
    pub sampling: &'static str,
    /// Method of contact resolution.
    pub method: &'static str,
    /// Quantity with the error.
    pub quantity: &'static str,
    /// Number of pairs.
    pub count: usize,
    /// 10 to the mean decimal logarithm of the errors that are not zero.
    pub log_mean: f64,
    /// Skewness of the decimal logarithms: 0 for a log-normal distribution.
    pub log_skewness: f64,
    /// Arithmetic mean.
    pub mean: f64,
    /// 0.1th percentile.
    pub p0_1: f64,
    /// 1st percentile.
    pub p1: f64,
    /// Median.
    pub p50: f64,
    /// 99th percentile.
    pub p99: f64,
    /// 99.9th percentile.
    pub p99_9: f64,
    /// Largest error.
    pub max: f64,
}

impl Summary {
    /// Summary of these errors, none of them negative.
    pub fn of(
        sampling: &'static str,
        method: &'static str,
        quantity: &'static str,
        errors: &[f64],
    ) -> Self {
        let mut sorted = errors.to_vec();
        sorted.sort_by(f64::total_cmp);
        let logarithms: Vec<f64> = sorted.iter().filter(|e| **e > 0.0).map(|e| e.log10()).collect();
        let log_mean = mean(logarithms.iter().copied());
        let moment = |power| mean(logarithms.iter().map(|l| (l - log_mean).powi(power)));
        Self {
            sampling,
            method,
            quantity,
            count: sorted.len(),
            log_mean: 10_f64.powf(log_mean),
            log_skewness: moment(3) / moment(2).powf(1.5),
            mean: mean(sorted.iter().copied()),
            p0_1: percentile(&sorted, 0.1),
            p1: percentile(&sorted, 1.0),
            p50: percentile(&sorted, 50.0),
            p99: percentile(&sorted, 99.0),
            p99_9: percentile(&sorted, 99.9),
            max: percentile(&sorted, 100.0),
        }
    }
}

/// Arithmetic mean; NaN without values.
pub fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0_usize), |(sum, count), v| (sum + v, count + 1));
    sum / count as f64
}

/// Percentile of sorted values: the value at or below that place; NaN without values.
pub fn percentile(sorted: &[f64], percent: f64) -> f64 {
    let last = sorted.len().saturating_sub(1);
    sorted.get((percent / 100.0 * last as f64).floor() as usize).copied().unwrap_or(f64::NAN)
}

/// Share of values within `low..=high`.
pub fn share(values: &[f64], low: f64, high: f64) -> f64 {
    let inside = values.iter().filter(|v| (low..=high).contains(*v)).count();
    inside as f64 / values.len() as f64
}

/// Share of positive values per decade: centre and density of each non-empty bin of a tenth of a decade.
pub fn per_decade(values: &[f64]) -> Vec<(f64, f64)> {
    const BINS: f64 = 10.0;
    let mut counts = std::collections::BTreeMap::<i32, usize>::new();
    for value in values.iter().filter(|v| **v > 0.0) {
        *counts.entry((value.log10() * BINS).floor() as i32).or_default() += 1;
    }
    counts
        .into_iter()
        .map(|(bin, count)| {
            let middle = 10_f64.powf((f64::from(bin) + 0.5) / BINS);
            (middle, BINS * count as f64 / values.len() as f64)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::{Summary, per_decade, percentile, share};

    #[test]
    fn of_a_few_numbers() {
        let errors = [1e-4, 0.0, 1e-2];
        let summary = Summary::of("", "", "", &errors);
        assert!((summary.log_mean - 1e-3).abs() < 1e-15, "zeros have no logarithm");
        assert_eq!((summary.count, summary.p50, summary.max), (3, 1e-4, 1e-2));
        assert!(summary.log_skewness.abs() < 1e-12);
        assert_eq!(percentile(&[0.0, 1.0, 4.0], 75.0), 1.0);
        assert_eq!(share(&errors, 1e-4, 1e-3), 1.0 / 3.0);
        let density: f64 = per_decade(&errors).iter().map(|(_, d)| d / 10.0).sum();
        assert!((density - 2.0 / 3.0).abs() < 1e-15);
    }
}
