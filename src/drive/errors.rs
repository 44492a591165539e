//! Errors of a servo or a cell against its target: over steps, over a stage, and swings about the target.

use super::CHECK_EVERY;

/// Statistics of errors over consecutive steps. An error is (stress - target) / target, or the equivalent for
/// forces.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Errors {
    /// Number of steps, a whole number.
    pub(super) steps: f64,
    /// Sum of the errors.
    sum: f64,
    /// Sum of their magnitudes.
    sizes: f64,
    /// Largest magnitude.
    pub(super) largest: f64,
}

impl Errors {
    /// Values for a snapshot.
    pub(super) const fn numbers(&self) -> [f64; 4] {
        let Self { steps, sum, sizes, largest } = *self;
        [steps, sum, sizes, largest]
    }

    /// Errors from the values of a snapshot.
    pub(super) const fn of(numbers: &[f64; 4]) -> Self {
        let [steps, sum, sizes, largest] = *numbers;
        Self { steps, sum, sizes, largest }
    }

    fn and(self, other: Self) -> Self {
        Self {
            steps: self.steps + other.steps,
            sum: self.sum + other.sum,
            sizes: self.sizes + other.sizes,
            largest: self.largest.max(other.largest),
        }
    }

    /// Mean magnitude of the errors.
    pub(super) fn mean_size(&self) -> f64 {
        self.sizes / self.steps
    }

    /// Error of the mean stress.
    pub(super) fn of_mean(&self) -> f64 {
        self.sum / self.steps
    }
}

/// Largest number of intervals of a stage with separate errors.
pub(super) const PARTS: usize = 40;

/// Errors of a stage in equal parts, the last of which may still grow. When there are [`PARTS`], each two are
/// merged.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Course(Vec<Errors>);

impl Course {
    /// Course from the [`PARTS`] of a snapshot; parts without steps are dropped.
    pub(super) fn of(parts: &[[f64; 4]]) -> Self {
        Self(parts.iter().map(Errors::of).filter(|part| part.steps > 0.0).collect())
    }

    /// Values for a snapshot.
    pub(super) fn numbers(&self) -> Vec<f64> {
        let mut parts: Vec<_> = self.0.iter().map(Errors::numbers).collect();
        parts.resize(PARTS, [0.0; 4]);
        parts.into_flattened()
    }

    fn add(&mut self, step: Errors) {
        let Self(parts) = self;
        let full = parts.first().map_or(0.0, |part| part.steps);
        if let Some(last) = parts.last_mut().filter(|part| part.steps < full) {
            *last = last.and(step);
            return;
        }
        if parts.len() == PARTS {
            *parts = parts.chunks(2).map(|two| two[0].and(two[1])).collect();
        }
        parts.push(step);
    }

    /// Errors over the last fifth of the stage so far, rounded up to whole parts.
    pub(super) fn last_fifth(&self) -> Errors {
        let steps: f64 = self.0.iter().map(|part| part.steps).sum();
        let mut late = Errors::default();
        for part in self.0.iter().rev() {
            if 5.0 * late.steps >= steps {
                break;
            }
            late = part.and(late);
        }
        late
    }
}

/// Errors of a servo in a stage.
#[derive(Clone, Debug, Default)]
pub(super) struct Record {
    /// Since the stage began.
    pub(super) course: Course,
    /// Errors since the last multiple of [`CHECK_EVERY`] steps.
    pub(super) recent: Errors,
    swings: Swings,
}

impl Record {
    /// Records the error of a step; true once, when a warning of swings is due.
    pub(super) fn note(&mut self, step: u64, error: f64) -> bool {
        let now = Errors { steps: 1.0, sum: error, sizes: error.abs(), largest: error.abs() };
        self.course.add(now);
        let before = if step.is_multiple_of(CHECK_EVERY) { Errors::default() } else { self.recent };
        self.recent = before.and(now);
        self.swings.note(error)
    }
}

/// Consecutive steps in which the stress must change sides of its target without smaller jumps, before a warning
/// that the servo oscillates.
pub(super) const SWINGS: u32 = 100;
/// Smallest error that counts as a swing, over the target.
const QUIET: f64 = 1e-3;

/// Detects swings of the stress about its target.
#[derive(Clone, Copy, Debug, Default)]
struct Swings {
    /// Error at the last step, over the target.
    error: f64,
    count: u32,
    /// The error with which the swings began.
    first: f64,
    /// Has the warning been given?
    warned: bool,
}

impl Swings {
    /// Records the error of a step; true once, when a warning is due.
    fn note(&mut self, error: f64) -> bool {
        let swings = error * self.error < 0.0 && error.abs() > QUIET;
        if !swings {
            (self.count, self.first) = (0, error.abs());
        }
        self.count += 1;
        self.error = error;
        let warn = !self.warned && self.count > SWINGS && error.abs() >= self.first;
        self.warned |= warn;
        warn
    }
}

#[cfg(test)]
mod tests {
    use super::{Course, Errors};

    /// Parts merge without loss: the mean over the last fifth of errors that grow by one a step has a closed form.
    #[test]
    fn means_outlast_the_merging_of_parts() {
        let mut course = Course::default();
        for step in 1..=1000 {
            let error = -f64::from(step);
            course.add(Errors { steps: 1.0, sum: error, sizes: -error, largest: -error });
        }
        let late = course.last_fifth();
        assert!((200.0..240.0).contains(&late.steps), "{}", late.steps);
        let mean = 1000.0 - 0.5 * (late.steps - 1.0);
        assert_eq!([late.of_mean(), late.mean_size(), late.largest], [-mean, mean, 1000.0]);
    }
}
