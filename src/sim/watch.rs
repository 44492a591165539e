//! Limits of a step beyond which contacts are missed: translation, rotation and overlap of particles.
//!
//! The rank that finds a fault has the neighbour list rebuilt, where all ranks agree on it.

use crate::contact::Pair;
use crate::contacts::Contacts;
use crate::ids::GlobalId;
use crate::math::{larger_number, printed_limit};
use crate::measure::shortest_axis;
use crate::motion::Farthest;
use crate::particles::Particles;
use crate::shape::Kind;
use serde::{Deserialize, Serialize};

/// Largest translation of a body in a step, over the smallest inscribed radius of a particle.
const FARTHEST: f64 = 1.0;
/// Largest rotation of a particle in a step [rad].
const WIDEST: f64 = 1.0;
/// Deepest overlap, over the shortest axis of the smaller body. Published cases reach a half (MFIX DEM01 with its softest
/// spring). At 1 the smaller of two equal spheres, or of a sphere and a wall, has passed through.
const DEEPEST: f64 = 0.75;
/// Deepest overlap on triangles, cylinders and cones, which push a body to the side of its centre. With its centre on the
/// surface a sphere overlaps by a half and a flat cube by 0.41; both cannot be deeper. From this limit to there is at least
/// a tenth of the axis, twice the motion of a step with a warning. So no valid step passes from below the limit to the
/// other side.
pub(super) const DEEPEST_ON_SURFACE: f64 = 0.35;
/// Fractions of the limits above which a run warns; valid steps stay below the first.
const WARNED: [f64; 2] = [0.1, 0.5];

/// A step exceeded a limit.
#[derive(Clone, Debug, PartialEq, thiserror::Error, Serialize, Deserialize)]
pub enum Fault {
    /// A body may have passed through others undetected.
    #[error(
        "{body} moves by {moved:.3e} m in a step, {:.3} times the smallest radius ({radius:.3e} m), so contacts may \
         be missed. With a time step of {works:.2e} s it would move by a tenth of that radius",
        moved / radius
    )]
    Moved {
        /// Name of the body.
        body: String,
        /// Its translation in the step [m].
        moved: f64,
        /// Smallest inscribed radius of a particle [m].
        radius: f64,
        /// Step with which it would move by a tenth of the radius [s].
        works: f64,
    },
    /// A particle turns too fast for its orientation to be resolved.
    #[error(
        "particle {id} rotates by {angle:.3} rad in a step, so its orientation is not resolved. With a time step of \
         {works:.2e} s it would rotate by a tenth of a radian"
    )]
    Turned {
        /// Id of the particle.
        id: GlobalId,
        /// Rotation in the step [rad].
        angle: f64,
        /// Step with which it would turn by a tenth of a radian [s].
        works: f64,
    },
    /// Two bodies overlap so deeply that their contact is meaningless.
    #[error(
        "particle {a} and {b} overlap by {:.1} % of the shortest axis of the smaller body, more than {:.0} %{}. \
         Contacts are too soft for the load, walls enclose a particle, or the time step is too long: use stiffer \
         contacts, or reduce load, speed or time step",
        100.0 * depth,
        100.0 * most,
        if *most < DEEPEST { ": once its centre is through, the surface pushes it out on the other side" } else { "" }
    )]
    Deep {
        /// The lower id.
        a: GlobalId,
        /// Other particle, or wall.
        b: String,
        /// Overlap over the shortest axis.
        depth: f64,
        /// Limit of that ratio.
        most: f64,
    },
    /// Contacts that stiffen with load have become too stiff for the step.
    #[error("{}", over_the_limit(*dt, *limit, *overlap))]
    Stiff {
        /// The time step [s].
        dt: f64,
        /// Stable limit now [s].
        limit: f64,
        /// Largest overlap over the radius of the smaller body.
        overlap: f64,
    },
}

/// Record of the motions and faults of all steps.
#[derive(Clone, Debug)]
pub struct Watch {
    /// Smallest inscribed radius of a particle [m].
    radius: f64,
    /// Largest translation and rotation on this rank, as fractions of the limits.
    largest: [f64; 2],
    /// Number of [`WARNED`] levels already reported.
    warned: [usize; 2],
    fault: Option<Fault>,
}

impl Watch {
    /// Watch for particles with this smallest inscribed radius [m].
    pub const fn new(radius: f64) -> Self {
        Self { radius, largest: [0.0; 2], warned: [0; 2], fault: None }
    }

    /// Records the motions of a step of `dt` [s], including those of the walls.
    pub fn note(&mut self, farthest: &Farthest, particles: &Particles, dt: f64) {
        let Farthest { moved: (moved, mover), turned: (angle, turner) } = *farthest;
        self.note_move(moved, dt, || particles.body_name(particles.id[mover]));
        self.largest[1] = larger_number(self.largest[1], angle / WIDEST);
        if angle > WIDEST {
            let works = dt * WARNED[0] * WIDEST / angle;
            self.fault = Some(Fault::Turned { id: particles.id[turner], angle, works });
        }
        let room = particles.room_of_turning();
        for wall in &particles.walls {
            let body = || format!("wall \"{}\"", wall.name);
            self.note_move(wall.way(dt, &room), dt, body);
        }
    }

    fn note_move(&mut self, moved: f64, dt: f64, body: impl Fn() -> String) {
        let part = moved / (FARTHEST * self.radius);
        self.largest[0] = larger_number(self.largest[0], part);
        if part > 1.0 {
            let (radius, works) = (self.radius, dt * WARNED[0] / part);
            self.fault = Some(Fault::Moved { body: body(), moved, radius, works });
        }
    }

    /// Records the motions that a step of `dt` [s] would have with the present velocities.
    pub fn note_ahead(&mut self, particles: &Particles, dt: f64) {
        let mut farthest = Farthest::default();
        for slot in 0..particles.owned {
            let moved = particles.velocity[slot].norm() * dt;
            if moved > farthest.moved.0 {
                farthest.moved = (moved, slot);
            }
            let shape = &particles.library.shapes[particles.shape[slot].index()];
            let angle = particles.angular_velocity(slot).norm() * dt;
            if angle > farthest.turned.0 && shape.kind() != Kind::Sphere {
                farthest.turned = (angle, slot);
            }
        }
        self.note(&farthest, particles, dt);
    }

    /// Records contacts on triangles, cylinders and cones that are too deep after a step: some steps later they may be on
    /// the other side.
    pub fn note_depths(&mut self, particles: &Particles, contacts: &Contacts) {
        if particles.walls.iter().all(|wall| wall.mesh.is_none()) {
            return;
        }
        let too_deep = contacts
            .on_walls(particles)
            .find_map(|(pair, geometry)| check_depth(particles, pair, geometry.overlap).err());
        if too_deep.is_some() {
            self.fault = too_deep;
        }
    }

    /// Has this rank recorded a fault?
    pub const fn has_fault(&self) -> bool {
        self.fault.is_some()
    }

    /// Checks for a recorded fault, and for overlaps that are too deep now.
    ///
    /// # Errors
    /// The fault.
    pub fn check(&self, particles: &Particles, contacts: &Contacts) -> Result<(), Fault> {
        self.fault.clone().map_or(Ok(()), Err)?;
        let mut own = contacts.iter().filter(|(pair, _)| particles.is_owned(pair.a));
        own.try_for_each(|(pair, geometry)| check_depth(particles, pair, geometry.overlap))
    }

    /// Largest motions so far as fractions of the limits; warnings need the largest over all ranks.
    pub const fn largest(&self) -> [f64; 2] {
        self.largest
    }

    /// Largest motions, given as fractions of the limits, in the units of a report: translation in a step over the smallest
    /// inscribed radius, and rotation in a step [rad].
    pub const fn in_units([moved, turned]: [f64; 2]) -> [f64; 2] {
        [FARTHEST * moved, WIDEST * turned]
    }

    /// Warnings about the largest motions over all ranks, as fractions of the limits: once at a tenth and once at a half.
    /// `dt` in s.
    pub fn warnings(&mut self, largest: [f64; 2], dt: f64) -> Vec<String> {
        let mut warnings = Vec::new();
        for (kind, part) in largest.into_iter().enumerate() {
            let passed = WARNED.iter().filter(|&&level| part > level).count();
            if passed > self.warned[kind] {
                self.warned[kind] = passed;
                let works = dt * WARNED[0] / part;
                let what = if kind == 0 {
                    format!(
                        "the fastest body has moved by {part:.2} of the smallest radius in a step"
                    )
                } else {
                    format!(
                        "the fastest rotation of a particle was {:.2} rad in a step",
                        part * WIDEST
                    )
                };
                warnings.push(format!(
                    "{what}, more than a tenth: collisions are poorly resolved, and a run stops at {:.0}. Use a time \
                     step of {works:.2e} s",
                    if kind == 0 { FARTHEST } else { WIDEST },
                ));
            }
        }
        warnings
    }
}

/// Checks that a contact with this overlap [m] is not too deep.
fn check_depth(particles: &Particles, pair: Pair, overlap: f64) -> Result<(), Fault> {
    let depth = overlap / shortest_axis(particles, pair.a, pair.b);
    let most = || {
        let wall = particles.wall_of(pair.b).map(|wall| &particles.walls[wall]);
        let on_surface = wall.is_some_and(|wall| wall.mesh.is_some());
        if on_surface { DEEPEST_ON_SURFACE } else { DEEPEST }
    };
    // Most contacts are far from any limit.
    if depth > DEEPEST_ON_SURFACE && depth > most() {
        let [a, b] = [pair.a, pair.b].map(|slot| particles.id[slot.index()]);
        return Err(Fault::Deep { a, b: particles.body_name(b), depth, most: most() });
    }
    Ok(())
}

/// Text that the step [s] is above the limit [s].
pub(super) fn over_the_limit(dt: f64, limit: f64, overlap: f64) -> String {
    format!(
        "the time step of {dt:.3e} s is {:.1} % over the stable limit, which fell to {limit:.3e} s at an overlap of \
         {overlap:.3} of the radius. Set law.largest_overlap to the expected overlap and step = \"auto\", or use a \
         step of {:.2e} s, or reduce load or speed, or set time.allow_unstable = true",
        100.0 * (dt / limit - 1.0),
        printed_limit(limit)
    )
}
