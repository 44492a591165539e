//! Random distributions for tests, from the program's own generator.

use dem_mpi::math::Vec3;
use dem_mpi::random::Random;

/// Distributions used only by tests.
pub(crate) trait Draw {
    /// Uniform in a range.
    fn between(&mut self, low: f64, high: f64) -> f64;

    /// Each component uniform in a range.
    fn vector(&mut self, low: f64, high: f64) -> Vec3;

    /// Uniform on the unit sphere.
    fn direction(&mut self) -> Vec3;
}

impl Draw for Random {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    fn vector(&mut self, low: f64, high: f64) -> Vec3 {
        Vec3::from_fn(|_, _| self.between(low, high))
    }

    fn direction(&mut self) -> Vec3 {
        loop {
            let v = self.vector(-1.0, 1.0);
            if (0.01..1.0).contains(&v.norm()) {
                return v.normalize();
            }
        }
    }
}
