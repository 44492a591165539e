//! Prescribed wall motion: oscillations, tables and constant velocities as functions of time.
//!
//! A pose is computed from the time alone, never from the previous pose. The rounding of a million steps is that of one, and a run that
//! continues from a snapshot has the same bits. The velocity in a step is the mean of the exact motion over it: displacement over time.
//! Damping forces, the stretch of springs and the work of the wall are thus consistent with the displacement of the wall.

use crate::math::{Quat, Vec3, rotation_about};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Wall motion as a function of time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Course {
    /// Displacements of the reference point, each along a unit vector [m].
    pub shifts: Vec<(Vec3, TimeFunction)>,
    /// Rotation about an axis through the reference point [rad].
    pub turn: Option<(Vec3, TimeFunction)>,
}

impl Course {
    /// Displacement of the reference point since time 0 [m].
    pub fn shift(&self, time: f64) -> Vec3 {
        self.shifts.iter().map(|(along, way)| along * way.at(time)).sum()
    }

    /// Rotation between two times.
    pub fn rotation(&self, from: f64, to: f64) -> Quat {
        self.turn.as_ref().map_or_else(Quat::identity, |(axis, way)| {
            rotation_about(axis, way.at(to) - way.at(from))
        })
    }

    /// Mean velocity of the reference point [m/s] and mean angular velocity [rad/s] over the time `dt` [s] before `time`.
    pub fn mean_velocities(&self, time: f64, dt: f64) -> (Vec3, Vec3) {
        let of = |way: &TimeFunction| way.mean_rate(time, dt);
        self.velocities(of)
    }

    /// Velocity [m/s] and angular velocity [rad/s] at time 0.
    pub fn first_velocities(&self) -> (Vec3, Vec3) {
        self.velocities(TimeFunction::first_rate)
    }

    /// The largest velocity of each displacement [m/s] and the largest angular velocity [rad/s], at any time.
    pub fn fastest(&self) -> (Vec<Vec3>, Vec3) {
        let shifts = self.shifts.iter().map(|(along, way)| along * way.fastest());
        let turn = self.turn.as_ref();
        (shifts.collect(), turn.map_or_else(Vec3::zeros, |(axis, way)| axis * way.fastest()))
    }

    /// Period of the fastest oscillation, if there is one [s].
    pub fn shortest_period(&self) -> Option<f64> {
        self.ways().filter_map(TimeFunction::period).reduce(f64::min)
    }

    /// Whether the motion has no end.
    pub fn is_endless(&self) -> bool {
        self.ways().any(|way| !matches!(way, TimeFunction::Table(_)))
    }

    /// End of the last table [s]; `None` without tables.
    pub fn end(&self) -> Option<f64> {
        self.ways().filter_map(TimeFunction::end).reduce(f64::max)
    }

    fn ways(&self) -> impl Iterator<Item = &TimeFunction> {
        let turn = self.turn.iter().map(|(_, way)| way);
        self.shifts.iter().map(|(_, way)| way).chain(turn)
    }

    /// Description for the plan of a run.
    pub fn summary(&self) -> String {
        let shifts = self.shifts.iter().map(|(along, way)| way.summary("along", along, "m"));
        let turn = self.turn.iter().map(|(axis, way)| way.summary("about", axis, "rad"));
        shifts.chain(turn).collect::<Vec<_>>().join("; ")
    }

    fn velocities(&self, rate: impl Fn(&TimeFunction) -> f64) -> (Vec3, Vec3) {
        let velocity = self.shifts.iter().map(|(along, way)| along * rate(way)).sum();
        let turn = self.turn.as_ref();
        (velocity, turn.map_or_else(Vec3::zeros, |(axis, way)| axis * rate(way)))
    }
}

/// A displacement [m] or angle [rad] as a function of time, 0 at time 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum TimeFunction {
    /// Constant rate [m/s, rad/s].
    Steady(f64),
    /// `amplitude (sin(2π frequency t + phase) - sin(phase))`.
    Oscillation {
        /// Amplitude [m, rad].
        amplitude: f64,
        /// Frequency [1/s].
        frequency: f64,
        /// Phase at time 0 [rad].
        phase: f64,
    },
    /// Values from a table.
    Table(Table),
}

impl TimeFunction {
    fn at(&self, time: f64) -> f64 {
        match self {
            Self::Steady(rate) => rate * time,
            Self::Oscillation { amplitude, frequency, phase } => {
                // The difference of two sines, without loss of digits near time 0.
                let half = 0.5 * TAU * frequency * time;
                2.0 * amplitude * libm::cos(half + phase) * libm::sin(half)
            }
            Self::Table(table) => table.at(time),
        }
    }

    /// Mean rate over the step of `dt` that ends at this time [s].
    pub fn mean_rate(&self, time: f64, dt: f64) -> f64 {
        match self {
            Self::Steady(rate) => *rate,
            Self::Oscillation { amplitude, frequency, phase } => {
                let middle = TAU * frequency * (time - 0.5 * dt) + phase;
                let half = 0.5 * TAU * frequency * dt;
                2.0 * amplitude * libm::cos(middle) * libm::sin(half) / dt
            }
            Self::Table(table) => (table.at(time) - table.at(time - dt)) / dt,
        }
    }

    fn first_rate(&self) -> f64 {
        match self {
            Self::Steady(rate) => *rate,
            Self::Oscillation { amplitude, frequency, phase } => {
                amplitude * TAU * frequency * libm::cos(*phase)
            }
            Self::Table(table) => table.first_rate(),
        }
    }

    fn summary(&self, along: &str, axis: &Vec3, unit: &str) -> String {
        let direction = format!("{along} [{}, {}, {}]", axis.x, axis.y, axis.z);
        match self {
            Self::Steady(rate) => format!("{rate} {unit}/s {direction}"),
            Self::Oscillation { amplitude, frequency, .. } => {
                let fastest = self.fastest();
                format!(
                    "{amplitude} {unit} {direction} at {frequency} 1/s, at most {fastest:.3e} {unit}/s"
                )
            }
            Self::Table(_) => {
                format!("by a table {direction}, at most {:.3e} {unit}/s", self.fastest())
            }
        }
    }

    const fn period(&self) -> Option<f64> {
        if let Self::Oscillation { frequency, .. } = self { Some(1.0 / *frequency) } else { None }
    }

    /// Time of the last row, after which the value is constant [s]; `None` for a motion without end.
    pub fn end(&self) -> Option<f64> {
        if let Self::Table(table) = self { table.times.last().copied() } else { None }
    }

    /// Largest rate at any time [m/s, rad/s].
    pub fn fastest(&self) -> f64 {
        match self {
            Self::Steady(rate) => rate.abs(),
            Self::Oscillation { amplitude, frequency, .. } => (amplitude * TAU * frequency).abs(),
            Self::Table(table) => table.fastest(),
        }
    }
}

/// Displacements [m] or angles [rad] at times [s]. After the last row the value is constant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Table {
    times: Vec<f64>,
    values: Vec<f64>,
    /// Rate at each row of a smooth table [m/s, rad/s].
    rates: Option<Vec<f64>>,
}

impl Table {
    /// A table of two rows or more, whose times rise from 0, with straight lines between the rows.
    ///
    /// If `is_smooth`, the lines are cubic polynomials that do not exceed their rows. The rates at rows are harmonic means of the adjacent slopes
    /// (Fritsch and Butland 1984, DOI 10.1137/0905021). The motion then begins and ends at rest, and reverses at rows only.
    ///
    /// # Panics
    /// If there are fewer than two rows, or their times do not rise from 0.
    pub fn new(rows: &[(f64, f64)], is_smooth: bool) -> Self {
        assert!(rows.len() > 1 && rows[0].0 == 0.0 && rows.is_sorted_by(|a, b| a.0 < b.0));
        let (times, values): (Vec<f64>, Vec<f64>) = rows.iter().copied().unzip();
        let mut table = Self { times, values, rates: None };
        if is_smooth {
            let slopes: Vec<f64> = (1..rows.len()).map(|k| table.slope(k)).collect();
            let inner = slopes.windows(2).enumerate().map(|(k, two)| {
                let [before, after] = [two[0], two[1]];
                if before * after <= 0.0 {
                    return 0.0;
                }
                let [h, next] = [table.width(k + 1), table.width(k + 2)];
                let part = (h + 2.0 * next) / (3.0 * (h + next));
                before * after / (part * after + (1.0 - part) * before)
            });
            table.rates = Some([0.0].into_iter().chain(inner).chain([0.0]).collect());
        }
        table
    }

    /// Width of the interval before row `k` [s].
    fn width(&self, k: usize) -> f64 {
        self.times[k] - self.times[k - 1]
    }

    fn slope(&self, k: usize) -> f64 {
        (self.values[k] - self.values[k - 1]) / self.width(k)
    }

    fn at(&self, time: f64) -> f64 {
        let k = self.times.partition_point(|&row| row <= time);
        if k == 0 {
            return 0.0;
        }
        let begin = self.values[k - 1];
        let first = self.values[0];
        if k == self.times.len() {
            return begin - first;
        }
        let width = self.width(k);
        let part = (time - self.times[k - 1]) / width;
        let rise = self.values[k] - begin;
        let Some(rates) = &self.rates else { return begin - first + part * rise };
        let [from, to] = [rates[k - 1] * width, rates[k] * width];
        let cubic =
            part * (from + part * (3.0 * rise - 2.0 * from - to + part * (from + to - 2.0 * rise)));
        begin - first + cubic
    }

    /// Value of the table at a time [s]; that of the last row after it.
    pub fn value(&self, time: f64) -> f64 {
        self.values[0] + self.at(time)
    }

    fn first_rate(&self) -> f64 {
        self.rates.as_ref().map_or_else(|| self.slope(1), |rates| rates[0])
    }

    fn fastest(&self) -> f64 {
        let of_row = |k: usize| {
            let slope = self.slope(k);
            let Some(rates) = &self.rates else { return slope.abs() };
            // The rate is a parabola, so its extremes are at the ends and the vertex.
            let [from, to] = [rates[k - 1], rates[k]];
            let (half, square) = (3.0 * slope - 2.0 * from - to, 3.0 * (from + to - 2.0 * slope));
            let vertex = -half / square;
            let top = if (0.0..1.0).contains(&vertex) { from + half * vertex } else { 0.0 };
            [from, to, top].into_iter().fold(0.0, |most: f64, rate| most.max(rate.abs()))
        };
        (1..self.times.len()).map(of_row).fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::{Table, TimeFunction};
    use crate::random::Random;

    fn ways() -> Vec<TimeFunction> {
        let rows = [(0.0, 0.2), (0.5, 0.3), (0.6, 1.1), (1.5, 1.4), (1.7, 0.1), (2.0, 0.1)];
        vec![
            TimeFunction::Steady(0.3),
            TimeFunction::Oscillation { amplitude: 0.7, frequency: 1.3, phase: 0.4 },
            TimeFunction::Table(Table::new(&rows, false)),
            TimeFunction::Table(Table::new(&rows, true)),
        ]
    }

    /// Rates are the derivatives of the motion, the largest is reached and not exceeded, and a motion begins at 0.
    #[test]
    fn rates_belong_to_ways() {
        for (k, way) in ways().iter().enumerate() {
            assert_eq!(way.at(0.0), 0.0);
            let mut random = Random::of(1, k as u64);
            let mut largest: f64 = 0.0;
            for _ in 0..20_000 {
                let (time, dt) = (0.001 + 2.0 * random.unit(), 1e-4);
                let rate = way.mean_rate(time, dt);
                assert!((way.at(time) - way.at(time - dt) - rate * dt).abs() < 1e-14);
                largest = largest.max(rate.abs());
            }
            let fastest = way.fastest();
            assert!(
                largest <= fastest * (1.0 + 1e-9) && largest > 0.98 * fastest,
                "{k}: {largest} {fastest}"
            );
            let first = way.mean_rate(1e-7, 1e-7);
            assert!((first - way.first_rate()).abs() < 1e-5 * fastest, "{k}: {first}");
        }
    }

    /// A smooth table passes through its rows, not beyond them, and its rate does not jump.
    #[test]
    fn smooth_tables_stay_between_their_rows() {
        let rows = [(0.0, 0.0), (0.5, 0.1), (0.6, 0.9), (1.5, 1.2), (1.7, -0.1)];
        let way = TimeFunction::Table(Table::new(&rows, true));
        for two in rows.windows(2) {
            let [(begin, from), (end, to)] = [two[0], two[1]];
            assert!((way.at(end) - to).abs() < 1e-15);
            for k in 0..=100 {
                let now = way.at(begin + (end - begin) * f64::from(k) / 100.0);
                assert!(now >= from.min(to) - 1e-15 && now <= from.max(to) + 1e-15);
            }
            let [before, after] = [end, end + 1e-6].map(|time| way.mean_rate(time, 1e-6));
            assert!((before - after).abs() < 1e-3, "{before} {after}");
        }
        assert_eq!(way.at(5.0), -0.1);
    }
}
