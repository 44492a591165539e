//! Speed of the domino effect, against the theory of van Leeuwen (2010, Am. J. Phys. 78, 721, 10.1119/1.3406154).
//!
//! In this theory dominoes rotate about their front edges and do not slip on the floor. Collisions are inelastic, so that all
//! fallen dominoes lean on each other as a train, which slides along their backs with friction. One angle describes the train,
//! that of its head. Between collisions it follows one equation of motion, and a collision changes its speed by a factor. The
//! theory is solved here by quadrature for the steady speed.

use super::faces::{G, Solid, at_share, cuboid, step};
use super::setup::begun;
use super::{Case, Effort, Findings, Grain, Plane, Setup};
use dem_mpi::comm::alone::Alone;
use dem_mpi::math::Vec3;
use dem_mpi::sim::Simulation;

const VAN_LEEUWEN: &str = "van Leeuwen 2010, 10.1119/1.3406154";

/// Runs all cases.
pub(crate) fn run(effort: Effort) -> Findings {
    let mut smooth = Case::new(
        VAN_LEEUWEN,
        "row of dominoes 0.179 times as thick as high, without friction among them, on a floor on which they do not slip",
        "speed of toppling over the root of gravity times height",
        0.03,
        "the row is finite: where gaps are small, it takes many dominoes until the speed is steady",
    );
    let mut rough = Case::new(
        VAN_LEEUWEN,
        "the same with friction 0.2 among them",
        "speed of toppling over the root of gravity times height",
        0.06,
        "faster than the theory, which lets every contact of the train press and slide at all times; which of them do here was not measured",
    );
    for gap in effort.pick(vec![0.3], vec![0.15, 0.3, 0.5]) {
        for (friction, case) in [(0.0, &mut smooth), (0.2, &mut rough)] {
            if friction == 0.0 || effort == Effort::Full {
                let row = Row { thickness: 0.179, gap, friction };
                let own = row.measured(if gap < 0.2 { 40 } else { 24 });
                case.relative(format!("gaps {gap} of the height"), row.speed(), own);
            }
        }
    }
    let cases = effort.pick(vec![smooth.clone()], vec![smooth, rough]);
    Findings { cases, ..Findings::default() }
}

/// A row of dominoes of height 1 m.
#[derive(Clone, Copy)]
struct Row {
    /// Thickness of a domino [m].
    thickness: f64,
    /// Gap between the faces of neighbours [m].
    gap: f64,
    /// Coefficient of friction between dominoes.
    friction: f64,
}

/// Coefficients of the equation of motion `inertia θ'' + change θ'² = moment` of a train at an angle of its head, over the moment
/// of inertia of a domino.
#[derive(Clone, Copy, Default)]
struct Train {
    inertia: f64,
    change: f64,
    moment: f64,
}

impl Row {
    /// Distance from one domino to the next [m].
    fn pitch(self) -> f64 {
        self.gap + self.thickness
    }

    /// Angle at which a domino meets the next.
    fn meets(self) -> f64 {
        self.gap.asin()
    }

    /// Moment of inertia about an edge, over the mass [m²].
    fn inertia(self) -> f64 {
        (1.0 + self.thickness * self.thickness) / 3.0
    }

    /// Angle of the domino that leans on one with this angle.
    fn behind(self, angle: f64) -> f64 {
        angle + (self.pitch() * angle.cos() - self.thickness).clamp(-1.0, 1.0).asin()
    }

    /// Derivative of the angle of the domino that leans on one with this angle.
    fn follows(self, angle: f64) -> f64 {
        1.0 - self.pitch() * angle.sin() / (self.behind(angle) - angle).cos()
    }

    /// Ratio of the moment on a domino to the opposite moment on the domino that leans on it.
    fn passes(self, angle: f64) -> f64 {
        let (sin, cos) = (self.behind(angle) - angle).sin_cos();
        let height = cos - self.pitch() * angle.sin();
        (height - self.friction * self.thickness) / (cos + self.friction * sin)
    }

    /// Angle, speed over that of the head, and weight in the equation of motion for each domino of a train.
    fn speeds(self, head: f64) -> impl Iterator<Item = [f64; 3]> {
        let (mut angle, mut speed, mut weight) = (head, 1.0, 1.0);
        (0..60).map(move |_| {
            let here = [angle, speed, weight];
            speed *= self.follows(angle);
            weight *= self.passes(angle);
            angle = self.behind(angle);
            here
        })
    }

    fn train(self, head: f64) -> Train {
        const SMALL: f64 = 1e-5;
        let near = self.speeds(head - SMALL).zip(self.speeds(head + SMALL));
        let mut train = Train::default();
        for ([angle, speed, weight], (before, after)) in self.speeds(head).zip(near) {
            let moment = 0.5 * G * (angle.sin() - self.thickness * angle.cos());
            train.inertia += weight * speed;
            train.change += weight * (after[1] - before[1]) / (2.0 * SMALL);
            train.moment += weight * moment / self.inertia();
        }
        train
    }

    /// Speed of the row over `√(g height)`.
    fn speed(self) -> f64 {
        const PARTS: usize = 400;
        let part = self.meets() / PARTS as f64;
        let trains: Vec<Train> = (0..=PARTS).map(|k| self.train(part * k as f64)).collect();
        let last = trains[PARTS].inertia;
        let meets = self.meets();
        let lever = (meets.cos() + self.friction * meets.sin())
            / (meets.cos() - self.friction * self.thickness);
        let kept = last / (last + lever);
        // Square of the speed of a domino when a collision makes it the head.
        let mut start: f64 = G;
        let mut time = 0.0;
        for _ in 0..200 {
            let mut squared = start;
            time = 0.0;
            for two in trains.windows(2) {
                let slope = |train: &Train, squared: f64| {
                    2.0 * (train.moment - train.change * squared) / train.inertia
                };
                let first = slope(&two[0], squared);
                let second = slope(&two[1], squared + part * first);
                let next = squared + 0.5 * part * (first + second);
                time += 2.0 * part / (squared.sqrt() + next.sqrt());
                squared = next;
            }
            start = squared * kept * kept;
        }
        self.pitch() / time / G.sqrt()
    }

    fn simulation(self, count: u32) -> Simulation {
        let domino = Solid {
            name: "domino",
            corners: cuboid(Vec3::new(self.thickness, 0.5, 1.0)),
            radius: 0.0,
        };
        let constants = "density = 1000.0\nnormal_stiffness = 1e8\nrestitution = 0.02\ntangential_damping_ratio = 0.3\n";
        let text = format!(
            "[[material]]\nname = \"m\"\nfriction = {}\n{constants}[[material]]\nname = \"floor\"\nfriction = 5.0\n{constants}\
             [[interaction]]\nbetween = [\"m\", \"floor\"]\nfriction = 5.0\n{}material = \"m\"\n",
            self.friction,
            domino.text()
        );
        let arm = Vec3::new(-0.5 * self.thickness, 0.0, 0.5);
        let grains = (0..count).map(|k| {
            let grain =
                Grain::at("solid", Vec3::x() * (f64::from(k) * self.pitch()) + Vec3::z() * 0.5);
            // The first domino is pushed.
            let spin = if k == 0 { Vec3::y() * 2.0 * G.sqrt() } else { Vec3::zeros() };
            grain.moving(spin.cross(&arm)).spinning(spin)
        });
        let setup = Setup {
            gravity: Vec3::z() * -G,
            text,
            planes: vec![Plane::floor("floor")],
            grains: grains.collect(),
            dt: 0.0,
        };
        begun(&at_share(&setup, 0.8), &mut Alone::default())
    }

    /// Speed of the last third of the row, without its very last dominoes, over `√(g height)`.
    fn measured(self, count: u32) -> f64 {
        let mut sim = self.simulation(count);
        let (from, to) = (2 * count / 3, count - 3);
        let mut times = [None; 2];
        while times[1].is_none() && sim.time() < 10.0 {
            step(&mut sim);
            for (time, of) in times.iter_mut().zip([from, to]) {
                let slot = sim.particles.id.iter().position(|id| id.0 == u64::from(of));
                let turns = sim.particles.orientation.as_ref().expect("dominoes turn");
                let up = turns.quaternion[slot.expect("it is there")] * Vec3::z();
                if time.is_none() && up.x > 0.5 * self.gap {
                    *time = Some(sim.time());
                }
            }
        }
        match times {
            [Some(start), Some(end)] => {
                f64::from(to - from) * self.pitch() / (end - start) / G.sqrt()
            }
            _ => f64::NAN,
        }
    }
}
