//! Arch of seven voussoirs: it stands above, and falls below, the friction and the thickness of limit analysis.
//!
//! The thrust in the crown of a symmetric arch is horizontal, `H`, and acts at some height. The part between the crown and a
//! joint has a known weight, so that `H` and the height determine the force in every joint. The arch can stand if for some
//! `H` and height the force lies within all joints, and within the friction of all of them (Heyman 1966,
//! 10.1016/0020-7683(66)90018-7; joints that slide: Cocchetti and Rizzi 2020, 10.3221/IGF-ESIS.51.26). These conditions are
//! linear, and pairs of them leave conditions on `H` alone: an interval.

use super::faces::{G, Solid, at_share, places, rough_with, step, steps};
use super::setup::{begun, seen};
use super::{Case, Drawing, Effort, Findings, Grain, Plane, Setup};
use dem_mpi::comm::alone::Alone;
use dem_mpi::math::{Vec3, rotation_about};
use dem_mpi::post::picture::side_by_side;
use dem_mpi::sim::Simulation;
use std::f64::consts::FRAC_PI_2;

const HEYMAN: &str = "limit analysis (Heyman 1966, 10.1016/0020-7683(66)90018-7; Cocchetti and Rizzi 2020, 10.3221/IGF-ESIS.51.26)";

/// Runs all cases.
pub(crate) fn run(effort: Effort) -> Findings {
    let (by_friction, drawings) = friction(effort);
    let mut cases = vec![theory(), by_friction];
    if effort == Effort::Full {
        cases.push(thickness(effort));
    }
    Findings { cases, drawings, ..Findings::default() }
}

/// Semicircular arch of an odd number of voussoirs, with a middle line of radius 1 m.
#[derive(Clone, Copy)]
struct Arch {
    voussoirs: u32,
    /// Length of a joint [m].
    thickness: f64,
}

/// A joint of the right half, and the part between the crown and it; a voussoir has the weight 1.
struct Joint {
    /// Angle from the crown.
    angle: f64,
    weight: f64,
    /// Weight times the distance of its centre from the middle of the arch [m].
    moment: f64,
}

impl Arch {
    /// Half the angle of a voussoir.
    fn half_angle(self) -> f64 {
        FRAC_PI_2 / f64::from(self.voussoirs)
    }

    /// Inner and outer radius [m].
    fn radii(self) -> [f64; 2] {
        [1.0 - 0.5 * self.thickness, 1.0 + 0.5 * self.thickness]
    }

    /// Half the lower and half the upper edge of the keystone's front, and the height of its centroid above the lower edge
    /// [m].
    fn front(self) -> [f64; 3] {
        let [low, high] = self.radii().map(|radius| radius * self.half_angle().sin());
        let height = self.thickness * self.half_angle().cos();
        [low, high, height * (low + 2.0 * high) / (3.0 * (low + high))]
    }

    /// Distance of the centroids of voussoirs from the middle of the arch [m].
    fn centroid(self) -> f64 {
        self.radii()[0] * self.half_angle().cos() + self.front()[2]
    }

    fn joints(self) -> Vec<Joint> {
        let [low, high, _] = self.front();
        let half_keystone = (low * low + low * high + high * high) / (3.0 * (low + high));
        let mut joint =
            Joint { angle: self.half_angle(), weight: 0.5, moment: 0.5 * half_keystone };
        let mut joints = Vec::new();
        while joints.len() < self.voussoirs.div_ceil(2) as usize {
            let Joint { angle, weight, moment } = joint;
            let next = angle + self.half_angle();
            joint = Joint {
                angle: next + self.half_angle(),
                weight: weight + 1.0,
                moment: moment + self.centroid() * next.sin(),
            };
            joints.push(Joint { angle, weight, moment });
        }
        joints
    }

    /// Whether the arch can stand with this coefficient of friction.
    fn can_stand(self, friction: f64) -> bool {
        let joints = self.joints();
        // Conditions `slope H >= bound`, first those of friction.
        let mut conditions = Vec::new();
        for joint in &joints {
            let (sin, cos) = joint.angle.sin_cos();
            conditions.push((sin + friction * cos, joint.weight * (cos - friction * sin)));
            conditions.push((friction * cos - sin, -joint.weight * (cos + friction * sin)));
        }
        // Upper and lower limit of the moment of the thrust about the middle of the arch: value at H = 0, and slope.
        let limits = |sign: f64| {
            joints.iter().map(move |joint| {
                let (sin, cos) = joint.angle.sin_cos();
                let radius = 1.0 + sign * 0.5 * self.thickness;
                (radius * joint.weight * sin - joint.moment, radius * cos)
            })
        };
        for (least, least_slope) in limits(-1.0) {
            conditions.extend(limits(1.0).map(|(most, slope)| (slope - least_slope, least - most)));
        }
        let bound = |is_lower: bool| {
            let of_sign = conditions.iter().filter(move |(slope, _)| (*slope > 0.0) == is_lower);
            of_sign.map(|(slope, bound)| bound / slope)
        };
        let low = bound(true).fold(f64::NEG_INFINITY, f64::max);
        low <= bound(false).fold(f64::INFINITY, f64::min)
    }

    /// Smallest coefficient of friction with which the arch can stand.
    fn least_friction(self) -> f64 {
        least(0.0, 2.0, |friction| self.can_stand(friction))
    }

    /// Smallest thickness with which an arch of this number of voussoirs can stand without sliding.
    fn least_thickness(voussoirs: u32) -> f64 {
        least(0.0, 1.0, |thickness| Self { voussoirs, thickness }.can_stand(100.0))
    }

    /// Simulation of the voussoirs, which stand on the floor.
    fn simulation(self, friction: f64, stiffness: f64) -> Simulation {
        let [low, high, up] = self.front();
        let height = self.thickness * self.half_angle().cos();
        let corners = (0..8).map(|k: u32| {
            let (half, z) = if k & 1 == 0 { (low, -up) } else { (high, height - up) };
            let side = |bit: u32| if k >> bit & 1 == 0 { -1.0 } else { 1.0 };
            Vec3::new(side(1) * half, side(2) * 0.15, z)
        });
        let voussoir = Solid { name: "voussoir", corners: corners.collect(), radius: 0.0 };
        let grains = (0..self.voussoirs).map(|k| {
            let angle = f64::from(2 * k + 1) * self.half_angle() - FRAC_PI_2;
            let turn = rotation_about(&Vec3::y(), angle);
            Grain::at("solid", turn * Vec3::z() * self.centroid()).turned(turn)
        });
        let setup = Setup {
            gravity: Vec3::z() * -G,
            text: rough_with(stiffness, 0.3, friction) + &voussoir.text(),
            planes: vec![Plane::floor("m")],
            grains: grains.collect(),
            dt: 0.0,
        };
        begun(&at_share(&setup, 0.8), &mut Alone::default())
    }

    /// Settlement of the keystone [m], at most [`FALLEN`], after a second in which the joints are loaded with damping; and
    /// the final state.
    fn sinks(self, friction: f64, effort: Effort) -> (f64, Simulation) {
        let mut sim = self.simulation(friction, effort.pick(1e8, 1e9));
        sim.field.damping = 20.0;
        steps(&mut sim, 1.0);
        sim.field.damping = 0.0;
        let keystone = |sim: &Simulation| {
            let places = places(sim);
            places[places.len() / 2].1.z
        };
        let (before, end) = (keystone(&sim), sim.time() + effort.pick(1.0, 5.0));
        while sim.time() < end && before - keystone(&sim) < FALLEN {
            step(&mut sim);
        }
        ((before - keystone(&sim)).min(FALLEN), sim)
    }
}

/// The smallest number between `low` and `high` for which `holds` is true.
fn least(mut low: f64, mut high: f64, holds: impl Fn(f64) -> bool) -> f64 {
    while high - low > 1e-9 {
        let middle = 0.5 * (low + high);
        if holds(middle) { high = middle } else { low = middle }
    }
    high
}

/// Settlement of the keystone at which an arch counts as fallen [m].
const FALLEN: f64 = 0.05;

/// Limit analysis of many voussoirs against published values.
fn theory() -> Case {
    let mut case = Case::new(
        HEYMAN,
        "limit analysis of 2001 voussoirs, as used below for seven",
        "least friction of a thick arch; least thickness without sliding",
        1e-4,
        "published for infinitely many; their weight on the middle line",
    );
    let thick = Arch { voussoirs: 2001, thickness: 0.3 };
    case.absolute("friction", 0.309_215, thick.least_friction());
    case.absolute("thickness", 0.107_426, Arch::least_thickness(2001));
    case
}

/// Tests arches slightly below and above a limit: those below fall. The result is the settlement of the keystone over
/// [`FALLEN`].
fn bracket(
    case: &mut Case,
    what: &str,
    effort: Effort,
    arch: impl Fn(f64) -> (Arch, f64),
) -> [Simulation; 2] {
    [(0.97, 1.0), (1.03, 0.0)].map(|(share, falls)| {
        let (arch, friction) = arch(share);
        let (sunk, sim) = arch.sinks(friction, effort);
        case.absolute(format!("{what}, {share} of the least"), falls, sunk / FALLEN);
        sim
    })
}

fn bracketed(name: &'static str) -> Case {
    Case::new(
        HEYMAN,
        name,
        "way of the keystone in 5 s, over 5 % of the radius",
        1e-6,
        "one that stands is at rest; one that falls is watched until it has gone 1",
    )
}

fn friction(effort: Effort) -> (Case, Vec<Drawing>) {
    let mut case = bracketed(
        "seven voussoirs on a rough floor, friction just below and above the least of limit analysis",
    );
    let mut drawings = Vec::new();
    for thickness in effort.pick(vec![0.3], vec![0.3, 0.15]) {
        let arch = Arch { voussoirs: 7, thickness };
        let least = arch.least_friction();
        let what = format!("thickness {thickness} of the radius, least friction {least:.4}");
        let [mut falls, stands] = bracket(&mut case, &what, effort, |share| (arch, share * least));
        if drawings.is_empty() {
            steps(&mut falls, 0.7);
            let titled = |share: f64, sim: &Simulation| {
                (format!("friction {:.3}", share * least), seen(sim), None)
            };
            drawings.push(Drawing {
                file: "arch",
                title: "Arches of seven voussoirs with friction just above and below the least",
                svg: side_by_side(vec![titled(1.03, &stands), titled(0.97, &falls)]),
            });
        }
    }
    (case, drawings)
}

fn thickness(effort: Effort) -> Case {
    let mut case = bracketed(
        "seven voussoirs that do not slide, thickness just below and above the least of limit analysis",
    );
    let least = Arch::least_thickness(7);
    let what = format!("least thickness {least:.4} of the radius");
    bracket(&mut case, &what, effort, |share| {
        (Arch { voussoirs: 7, thickness: share * least }, 1.0)
    });
    case
}
