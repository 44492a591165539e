//! Random scatter of numbers of one kind.

use dem_mpi::post::report::readable;
use std::fmt::{self, Display};

/// Mean and standard deviation.
#[derive(Clone, Copy, Debug)]
pub struct Spread {
    /// The mean.
    pub mean: f64,
    /// Standard deviation, 0 for one value.
    pub deviation: f64,
    /// Number of values.
    pub count: usize,
}

impl Spread {
    /// Spread of at least one value.
    pub fn of(values: &[f64]) -> Self {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let squares: f64 = values.iter().map(|x| x * x).sum();
        let variance = if n > 1.0 { (squares - n * mean * mean) / (n - 1.0) } else { 0.0 };
        Self { mean, deviation: variance.max(0.0).sqrt(), count: values.len() }
    }
}

/// Writes the mean, with the deviation of several values.
impl Display for Spread {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&readable(self.mean))?;
        if self.count > 1 { write!(f, " ± {}", readable(self.deviation)) } else { Ok(()) }
    }
}
