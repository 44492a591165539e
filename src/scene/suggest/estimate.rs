//! Errors expected from the results of trials. See [`super`].

use super::trial::Answer;

/// Factor on the largest difference from shorter steps.
const MARGIN: f64 = 2.0;

/// Student's factor of 95 %, both sides, of 1 to 6 degrees of freedom (Student 1908, DOI 10.1093/biomet/6.1.1).
const STUDENT: [f64; 6] = [12.706, 4.303, 3.182, 2.776, 2.571, 2.447];

/// The runs of one step.
#[derive(Clone, Debug)]
pub(super) struct Rung {
    /// The unmoved run, then the copies; empty if one of them failed.
    pub(super) runs: Vec<Answer>,
    /// Reason for a failure.
    pub(super) why_not: Option<String>,
}

impl Rung {
    /// Stress and coordination number, as means over the runs.
    fn mean(&self) -> Option<[f64; 2]> {
        let count = self.runs.len() as f64;
        let mean = |of: fn(&Answer) -> f64| self.runs.iter().map(of).sum::<f64>() / count;
        (count > 0.0).then(|| [mean(|run| run.stress), mean(|run| run.coordination)])
    }
}

/// Relative difference that two runs with nearly equal starts do not exceed with a probability of 95 % [-].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Floor {
    /// For the mean stress.
    pub stress: f64,
    /// For the coordination number.
    pub contacts: f64,
}

impl Floor {
    pub(super) const NONE: Self = Self { stress: 0.0, contacts: 0.0 };

    /// Floor from the copies of all steps.
    pub(super) fn of(rungs: &[Rung]) -> Self {
        let (mut squares, mut freedom) = ([0.0; 2], 0);
        for rung in rungs.iter().filter(|rung| rung.runs.len() > 1) {
            let Some(mean) = rung.mean() else { continue };
            freedom += rung.runs.len() - 1;
            for run in &rung.runs {
                let values = [run.stress, run.coordination];
                for (sum, (value, mean)) in squares.iter_mut().zip(values.iter().zip(mean)) {
                    *sum += (value / mean - 1.0).powi(2);
                }
            }
        }
        let Some(factor) = STUDENT.get(freedom.clamp(1, STUDENT.len()) - 1) else {
            return Self::NONE;
        };
        if freedom == 0 {
            return Self { stress: f64::INFINITY, contacts: f64::INFINITY };
        }
        let [stress, contacts] = squares.map(|sum| factor * (2.0 * sum / freedom as f64).sqrt());
        Self { stress, contacts }
    }

    /// Larger of the two.
    pub fn largest(&self) -> f64 {
        self.stress.max(self.contacts)
    }
}

/// Relative difference of a step from shorter ones [-].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Difference {
    pub(super) stress: f64,
    pub(super) contacts: f64,
}

impl Difference {
    fn between(values: [f64; 2], others: [f64; 2]) -> Self {
        let [stress, contacts] = [0, 1].map(|k| (values[k] / others[k] - 1.0).abs());
        Self { stress, contacts }
    }

    pub(super) fn is_within(&self, floor: &Floor) -> bool {
        self.stress <= floor.stress && self.contacts <= floor.contacts
    }

    fn expected(&self, missing: f64, floor: &Floor) -> Expected {
        let both = |difference: f64, floor: f64| libm::hypot(MARGIN * difference, floor);
        Expected {
            stress: both(self.stress, floor.stress),
            contacts: both(self.contacts, floor.contacts),
            energy: missing.abs(),
        }
    }
}

/// Expected relative errors [-].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expected {
    /// For the mean stress.
    pub stress: f64,
    /// For the coordination number.
    pub contacts: f64,
    /// Energy error.
    pub energy: f64,
}

impl Expected {
    /// Largest of the three.
    pub fn largest(&self) -> f64 {
        self.stress.max(self.contacts).max(self.energy)
    }

    /// Is none larger? False for NaN.
    pub(super) fn is_at_most(&self, error: f64) -> bool {
        [self.stress, self.contacts, self.energy].into_iter().all(|part| part <= error)
    }
}

/// Stress and coordination number of the shortest step.
pub(super) fn best(rungs: &[Rung]) -> Option<[f64; 2]> {
    rungs.iter().rev().find_map(Rung::mean)
}

/// Largest difference of a step from shorter ones.
pub(super) fn difference(rungs: &[Rung], k: usize) -> Option<Difference> {
    let mine = rungs[k].mean()?;
    let others = rungs[k + 1..].iter().filter_map(Rung::mean);
    others.map(|other| Difference::between(mine, other)).reduce(|a, b| Difference {
        stress: a.stress.max(b.stress),
        contacts: a.contacts.max(b.contacts),
    })
}

/// Expected errors of a step.
pub(super) fn expected(rungs: &[Rung], k: usize, floor: &Floor) -> Option<Expected> {
    let missing = rungs[k].runs.iter().map(|run| run.missing.abs()).fold(0.0, f64::max);
    Some(difference(rungs, k)?.expected(missing, floor))
}

/// Expected errors of a run against the result of the shortest step.
pub(super) fn from(run: &Answer, best: &[f64; 2], floor: &Floor) -> Expected {
    let difference = Difference::between([run.stress, run.coordination], *best);
    difference.expected(run.missing, floor)
}
