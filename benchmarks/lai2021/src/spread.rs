//! What chance does to numbers of the same kind.

use dem_mpi::post::report::readable;
use std::fmt::{self, Display};

/// Mean and standard deviation.
#[derive(Clone, Copy, Debug)]
pub struct Spread {
    /// The mean.
    pub mean: f64,
    /// The standard deviation, 0 of one value.
    pub deviation: f64,
    /// Of how many values.
    pub count: usize,
}

impl Spread {
    /// Of at least one value.
    pub fn of(values: &[f64]) -> Self {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let squares: f64 = values.iter().map(|x| x * x).sum();
        let variance = if n > 1.0 { (squares - n * mean * mean) / (n - 1.0) } else { 0.0 };
        Self { mean, deviation: variance.max(0.0).sqrt(), count: values.len() }
    }
}

/// The mean, and the deviation of several values.
impl Display for Spread {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&readable(self.mean))?;
        if self.count > 1 { write!(f, " ± {}", readable(self.deviation)) } else { Ok(()) }
    }
}
