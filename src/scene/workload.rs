//! Run time that is left of a stage, from the time of its steps so far.

use super::Scene;

/// Parts of a stage, in each of which the number of particles is constant.
const PARTS: u32 = 64;

/// Particle-steps of a stage up to the end of each of its parts. Particles of rain and inlets add to them while they
/// come, and none leave.
#[derive(Clone, Debug)]
pub struct Workload(Vec<f64>);

impl Workload {
    /// Workload of the steps from this one of the stage on, which begins with `held` particles.
    pub fn new(scene: &Scene, held: u64, begin: u64, steps: u64) -> Self {
        let before = scene.come_by(begin);
        let part = steps as f64 / f64::from(PARTS);
        let mut all = 0.0;
        let done = (0..PARTS).map(|k| {
            let middle = begin.saturating_add(((f64::from(k) + 0.5) * part) as u64);
            all += part * (held + (scene.come_by(middle) - before)) as f64;
            all
        });
        Self(done.collect())
    }

    /// Particle-steps of all steps.
    pub fn all(&self) -> f64 {
        self.0.last().copied().unwrap_or(0.0)
    }

    /// Time of the steps that are left after a part of them, over the time of this part; infinite before the first.
    pub fn left(&self, part: f64) -> f64 {
        let at = part.clamp(0.0, 1.0) * f64::from(PARTS);
        let whole = (at as usize).min(self.0.len() - 1);
        let begin = whole.checked_sub(1).map_or(0.0, |before| self.0[before]);
        let done = begin + (at - whole as f64) * (self.0[whole] - begin);
        ((self.all() - done) / done).max(0.0)
    }
}

impl Scene {
    /// Approximate number of particles that rain and inlets have let in by this step of the stage.
    fn come_by(&self, step: u64) -> u64 {
        let rain = self.rain.iter().map(|rain| {
            let every = rain.interval(&self.gravity, &self.domain, self.dt).unwrap_or(rain.every);
            rain.count.min(step.div_ceil(every.max(1)).saturating_mul(rain.in_layer()))
        });
        let seconds = step as f64 * self.dt;
        let inlets = self.inlets.iter().map(|inlet| inlet.expected(seconds, &self.library));
        rain.chain(inlets).sum()
    }
}
