//! Repetition of a case in ways that must not matter: on two ranks, with exchanged ids, in a rotated frame.

use super::{Case, Frame, Setup};
use dem_mpi::math::{Quat, Vec3};

/// Differences between the ways, by case.
#[derive(Clone, Debug)]
pub(crate) struct Ways {
    split: Case,
    swapped: Case,
    turned: Case,
}

/// Rounding of positions (1e-16 of a radius) over the least overlap (1e-6 of it), times a hundred for 400 steps.
const ROUNDING: f64 = 1e-8;

/// Rotation about an axis without symmetry.
fn turn() -> Quat {
    Quat::new(Vec3::new(1.0, 2.0, -0.5).normalize() * 0.7)
}

impl Ways {
    /// Ways for the cases of this source.
    pub(crate) fn new(source: &'static str) -> Self {
        let why = "rounding of positions over the overlap, 400 steps";
        Self {
            split: Case::new(
                source,
                "every impact on two ranks, pairs split between them",
                "numbers with other bits",
                0.0,
                "the same bits on any number of ranks",
            ),
            swapped: Case::new(
                source,
                "every pair with its ids swapped",
                "end of motion (relative)",
                ROUNDING,
                why,
            ),
            turned: Case::new(
                source,
                "every impact in a turned frame",
                "end of motion (relative)",
                ROUNDING,
                why,
            ),
        }
    }

    /// Runs a setup on one rank, and in all other ways; returns the frames of one rank.
    pub(crate) fn run(&mut self, name: &str, setup: &Setup, steps: u64, every: u64) -> Vec<Frame> {
        let frames = setup.run(steps, every);
        let split = setup.run_on(2, steps, every);
        let pairs = setup.grains.len() > 1;
        let was_split = |frame: &Frame| {
            frame.is_touching() && frame.bodies.iter().any(|b| b.rank != frame.bodies[0].rank)
        };
        assert!(!pairs || split.iter().any(was_split), "{name}: the pair was not split");
        let differing = frames.iter().zip(&split).map(|(a, b)| other_bits(a, b)).sum::<usize>();
        self.split.absolute(name, 0.0, differing as f64);

        if pairs {
            let mut swapped = setup.clone();
            swapped.grains.reverse();
            let mut end = swapped.run(steps, steps).pop().expect("an end");
            end.bodies.reverse();
            self.swapped.absolute(name, 0.0, difference(&frames, &end));
        }

        let q = turn();
        let mut turned = setup.clone();
        turned.gravity = q * setup.gravity;
        for plane in &mut turned.planes {
            (plane.point, plane.normal) = (q * plane.point, q * plane.normal);
        }
        for grain in &mut turned.grains {
            grain.position = q * grain.position;
            grain.velocity = q * grain.velocity;
            grain.orientation = q * grain.orientation;
            grain.spin = q * grain.spin;
        }
        let mut end = turned.run(steps, steps).pop().expect("an end");
        for body in &mut end.bodies {
            body.position = q.inverse() * body.position;
            body.velocity = q.inverse() * body.velocity;
            body.spin = q.inverse() * body.spin;
        }
        self.turned.absolute(name, 0.0, difference(&frames, &end));
        frames
    }

    /// Cases of the table.
    pub(crate) fn into_cases(self) -> impl Iterator<Item = Case> {
        let all = [self.split, self.swapped, self.turned];
        all.into_iter().filter(|case| !case.rows.is_empty())
    }
}

/// Number of values with different bits in two frames.
fn other_bits(a: &Frame, b: &Frame) -> usize {
    let numbers = |frame: &Frame| -> Vec<u64> {
        let of_body = |body: &super::Body| {
            let vectors = [body.position, body.velocity, body.spin];
            let numbers = vectors.iter().flat_map(|v| v.iter().copied());
            let all: Vec<u64> =
                numbers.chain(body.orientation.coords.iter().copied()).map(f64::to_bits).collect();
            all
        };
        frame.bodies.iter().flat_map(of_body).collect()
    };
    let (a, b) = (numbers(a), numbers(b));
    assert_eq!(a.len(), b.len(), "no particle is lost");
    a.iter().zip(&b).filter(|(a, b)| a != b).count()
}

/// Largest difference of the last frame from another end, over the largest change of position, velocity or spin on
/// the way.
fn difference(frames: &[Frame], end: &Frame) -> f64 {
    let (first, last) = (&frames[0], &frames[frames.len() - 1]);
    let larger = |a: f64, b: f64| if b > a || b.is_nan() { b } else { a };
    let apart = |a: &Frame, b: &Frame, what: &dyn Fn(&super::Body) -> Vec3| {
        let pairs = a.bodies.iter().zip(&b.bodies);
        pairs.map(|(a, b)| (what(a) - what(b)).norm()).fold(0.0, larger)
    };
    let changed = |what: &dyn Fn(&super::Body) -> Vec3| {
        frames.iter().map(|frame| apart(frame, first, what)).fold(0.0, larger)
    };
    let over = |off: f64, all: f64| if all > 0.0 { off / all } else { off };
    let of = |what: &dyn Fn(&super::Body) -> Vec3| over(apart(last, end, what), changed(what));
    // Without rotation, the spin that would move the surface as fast as the velocity of the body has changed.
    let size = first.bodies.iter().map(|b| b.position.norm()).fold(0.0, larger);
    let as_fast = over(changed(&|b| b.velocity), size);
    let spin = over(apart(last, end, &|b| b.spin), larger(changed(&|b| b.spin), as_fast));
    of(&|b| b.position).max(of(&|b| b.velocity)).max(spin)
}
