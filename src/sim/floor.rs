//! Lower bound of a step by phase: the arithmetic and the bytes that its formulas need. The difference to the run's time is
//! the cost of the implementation.
//!
//! An addition, subtraction, multiplication, division, root or comparison of `f64` is one operation. A phase reads and
//! writes each number that it needs once, as if all reused numbers stayed in registers. Not counted are features that not
//! every scene has (gravity, damping, images across periods, scales), and work that no force needs: the order of sums,
//! energies by channel, the record of each contact's force. Access to the bodies of a pair is not counted either: no order
//! of the list makes all of them neighbours in memory.
//!
//! | phase | for each | operations | bytes |
//! |---|---|---|---|
//! | move | particle | kicks `v + (h/m) F` twice, `x + dt v`: 18; moved farther than half the skin? 9 | `x` 48, `v` 96, `F` 48, place of listing 24 |
//! | | that spins | kicks of `ω`: 12 | `ω` 96, moment 48 |
//! | | that turns | kicks of `L` 12, into the body's axes and back 60, the midpoint rule once 21, quaternion times quaternion 28, normalised 13 | `L` 96, moment 48, quaternion 64, `ω` 24 |
//! | contacts | particle | | `x` 24 |
//! | | that turns | | quaternion 32 |
//! | | ellipsoid | its matrix `R diag(a²) Rᵀ`: 63 | |
//! | | listed pair of spheres | `\|x_B - x_A\|² < (r_A + r_B)²`: 9 | two slots 8 |
//! | | other listed pair | travel of both against the clearance: 2 | two slots 8, clearance 4 |
//! | | contact of spheres | root, overlap, `r / \|r\|`: 5 | normal and overlap 32 |
//! | | of ellipsoids | support function, point and residual 62, twice; a step of Newton's method between 143; contact point 9 | last normal 24, normal and overlap 32, point 24 |
//! | | of superellipsoids | for both bodies, twice: 5 powers of 30 each, 30 for the axes, 10 for the point; 14 for the residual, twice; a step 143; contact point 9 | the same |
//! | forces | particle | | `F` 24; with velocities `v` 24; with spin the moment 24, and with both `ω` 24 |
//! | | contact | `k δ n` 4, added to both 6 | two slots 8, normal and overlap 32 |
//! | | with velocities | `v_B - v_A`, and along `n`: 8 | |
//! | | with spin, too | velocity of the surfaces 21, moments on both 21 | |
//! | | with a spring (three numbers remembered) | sliding 6, spring into the new plane 11, stretched 6, its force 3, against Coulomb's limit 8, added 3 | what is remembered, read and written |
//! | | of bodies that turn | | point 24 |
//!
//! A power is a logarithm and an exponential. Each needs a polynomial of degree 5 at least with small tables (as in fdlibm,
//! <https://www.netlib.org/fdlibm/>), and the reduction of the argument: 15. A contact with a plane counts like one of two
//! particles.

use super::Simulation;
use crate::contact::StateColumn;
use crate::particles::Needs;
use crate::shape::{Kind, Shape};
use crate::timing::Phase;
use std::ops::{Add, Mul};

/// Arithmetic and memory traffic.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Needed {
    /// Operations on `f64`.
    pub operations: f64,
    /// Bytes read and written.
    pub bytes: f64,
}

impl Needed {
    const fn new(operations: f64, bytes: f64) -> Self {
        Self { operations, bytes }
    }
}

impl Add for Needed {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self::new(self.operations + other.operations, self.bytes + other.bytes)
    }
}

impl Mul<f64> for Needed {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        Self::new(self.operations * factor, self.bytes * factor)
    }
}

/// Lower bound of a phase in each step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Floor {
    /// Per owned particle.
    pub particle: Needed,
    /// Per pair on the neighbour list.
    pub listed: Needed,
    /// Per touching contact.
    pub contact: Needed,
}

impl Floor {
    /// Phases that have a floor.
    pub const PHASES: [Phase; 3] = [Phase::Move, Phase::Contacts, Phase::Forces];

    /// Floor of a phase. `kind` is the kind of all particles, if there is only one; `width` is the number of state values
    /// per contact. `None` where no floor is known: other phases, mixtures, forces with faces or curvature, and bodies
    /// whose methods iterate.
    pub fn of(phase: Phase, needs: Needs, kind: Option<Kind>, width: usize) -> Option<Self> {
        match phase {
            Phase::Move => Some(Self { particle: motion(needs), ..Self::default() }),
            Phase::Contacts => Self::of_contacts(needs, kind?),
            Phase::Forces if !(needs.patches || needs.curvature) => {
                Some(Self::of_forces(needs, width))
            }
            Phase::Forces
            | Phase::Rebuild
            | Phase::Exchange
            | Phase::Agree
            | Phase::Audit
            | Phase::Output => None,
        }
    }

    fn of_contacts(needs: Needs, kind: Kind) -> Option<Self> {
        const EVALUATION: f64 = 62.0;
        const STEP: f64 = 143.0;
        const POINT: f64 = 9.0;
        const POWER: f64 = 30.0;
        let place = Needed::new(0.0, if needs.orientation { 24.0 + 32.0 } else { 24.0 });
        let listed = Needed::new(2.0, 8.0 + 4.0);
        let by_newton = |operations| Needed::new(operations + STEP + POINT, 24.0 + 32.0 + 24.0);
        match kind {
            Kind::Sphere => Some(Self {
                particle: place,
                listed: Needed::new(9.0, 8.0),
                contact: Needed::new(5.0, 32.0),
            }),
            Kind::Ellipsoid => Some(Self {
                particle: place + Needed::new(63.0, 0.0),
                listed,
                contact: by_newton(2.0 * EVALUATION),
            }),
            Kind::Superellipsoid => {
                let body = 5.0 * POWER + 30.0 + 10.0;
                let contact = by_newton(2.0 * (2.0 * body + 14.0));
                Some(Self { particle: place, listed, contact })
            }
            _ => None,
        }
    }

    fn of_forces(needs: Needs, width: usize) -> Self {
        let turns = needs.velocity && needs.spin;
        let columns = [true, needs.velocity, needs.spin, turns];
        let columns = columns.iter().filter(|&&is_there| is_there).count() as f64;
        let mut contact = Needed::new(10.0, 8.0 + 32.0 + 16.0 * width as f64);
        for (is_there, needed) in [
            (needs.velocity, Needed::new(8.0, 0.0)),
            (turns, Needed::new(42.0, 0.0)),
            (width >= 3, Needed::new(37.0, 0.0)),
            (needs.orientation, Needed::new(0.0, 24.0)),
        ] {
            if is_there {
                contact = contact + needed;
            }
        }
        Self { particle: Needed::new(0.0, 24.0 * columns), contact, ..Self::default() }
    }

    /// Sum for these numbers of particles, listed pairs and contacts.
    pub fn total(&self, particles: f64, listed: f64, contacts: f64) -> Needed {
        self.particle * particles + self.listed * listed + self.contact * contacts
    }
}

impl Simulation {
    /// Lower bound of a phase of its step, if it is known.
    pub fn floor(&self, phase: Phase) -> Option<Floor> {
        let library = &self.particles.library;
        let mut kinds = library.shapes[..library.particle_shapes].iter().map(Shape::kind);
        let first = kinds.next();
        let kind = first.filter(|&first| kinds.all(|other| other == first));
        let width = StateColumn::total_width(self.law.state());
        Floor::of(phase, self.particles.needs, kind, width)
    }
}

fn motion(needs: Needs) -> Needed {
    let translation = Needed::new(18.0 + 9.0, 48.0 + 96.0 + 48.0 + 24.0);
    let rotation = if needs.orientation {
        Needed::new(12.0 + 60.0 + 21.0 + 28.0 + 13.0, 96.0 + 48.0 + 64.0 + 24.0)
    } else if needs.spin {
        Needed::new(12.0, 96.0 + 48.0)
    } else {
        Needed::default()
    };
    translation + rotation
}

#[cfg(test)]
mod tests {
    use super::{Floor, Needed};
    use crate::particles::Needs;
    use crate::shape::Kind;
    use crate::timing::Phase;

    #[test]
    fn what_a_scene_does_not_have_does_not_raise_its_floor() {
        let spheres = Needs::default();
        let dashpots = Needs { velocity: true, ..spheres };
        let friction = Needs { spin: true, ..dashpots };
        let ellipsoids = Needs { orientation: true, form: true, ..friction };
        let cases = [
            (spheres, Kind::Sphere, 0),
            (dashpots, Kind::Sphere, 0),
            (friction, Kind::Sphere, 3),
            (ellipsoids, Kind::Ellipsoid, 3),
            (ellipsoids, Kind::Superellipsoid, 3),
        ];
        for phase in Floor::PHASES {
            let of = |(needs, kind, width): (Needs, Kind, usize)| {
                Floor::of(phase, needs, Some(kind), width).unwrap().total(1.0, 3.0, 3.0)
            };
            for pair in cases.windows(2) {
                let [less, more] = [of(pair[0]), of(pair[1])];
                assert!(
                    less.operations <= more.operations && less.bytes <= more.bytes,
                    "{phase:?}"
                );
            }
        }
    }

    #[test]
    fn spheres_with_springs_alone_need_what_the_table_says() {
        let of = |phase| Floor::of(phase, Needs::default(), Some(Kind::Sphere), 0).unwrap();
        assert_eq!(of(Phase::Move).total(1.0, 3.0, 2.0), Needed::new(27.0, 216.0));
        assert_eq!(of(Phase::Contacts).total(1.0, 3.0, 2.0), Needed::new(37.0, 24.0 + 24.0 + 64.0));
        assert_eq!(of(Phase::Forces).total(1.0, 3.0, 2.0), Needed::new(20.0, 24.0 + 80.0));
        assert_eq!(Floor::of(Phase::Contacts, Needs::default(), None, 0), None);
        let faces = Needs { patches: true, ..Needs::default() };
        assert_eq!(Floor::of(Phase::Forces, faces, None, 11), None);
        assert_eq!(Floor::of(Phase::Output, Needs::default(), Some(Kind::Sphere), 0), None);
    }
}
