//! Ownership of particles: a tree of cuts, ghosts of neighbours' particles, and migration.
//!
//! Space is cut in two repeatedly, each time across the longest side of its content. Both halves get work in proportion
//! to their ranks (recursive bisection; Berger and Bokhari 1987, DOI 10.1109/TC.1987.1676942). A packing fills from the
//! bottom, and the cuts follow it. The owner of a particle never affects the physics.

mod cuts;
mod ghosts;
mod migrate;

use crate::cell::Cell;
use crate::comm::Comm;
use crate::ids::{GlobalId, Rank};
use crate::math::Vec3;
use crate::particles::Particles;
use crate::population::Library;
use crate::walls::{Corners, room};
pub use cuts::{Cuts, Subdomain};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::ops::Range;

/// Distance beyond its subdomain that a rank must see, for a skin and a gap over which contacts outlive their overlap
/// [m].
pub fn halo_width(library: &Library, skin: f64, outlives: f64) -> f64 {
    2.0 * library.largest_radius() + skin + outlives
}

/// A rank with which this one shares particles.
#[derive(Clone, Debug)]
struct Neighbour {
    rank: Rank,
    /// Slots of owned particles that are ghosts there.
    sent: Vec<u32>,
    /// Slots of ghosts that it owns.
    received: Range<usize>,
}

/// A particle at an invalid position.
#[derive(Clone, Debug, thiserror::Error, Serialize, Deserialize)]
pub enum DomainError {
    /// It left the domain.
    #[error(
        "particle {id} has left the domain: it is at ({x:e}, {y:e}, {z:e}) m with velocity {speed:e} m/s"
    )]
    Outside {
        /// Id of the particle.
        id: GlobalId,
        /// Position along x [m].
        x: f64,
        /// Position along y [m].
        y: f64,
        /// Position along z [m].
        z: f64,
        /// Speed [m/s].
        speed: f64,
    },
    /// Its state is not finite.
    #[error(
        "particle {id} has a position or velocity that is not finite. The run is unstable: reduce the time step, or \
         check for deep overlaps at the start"
    )]
    NotFinite {
        /// Id of the particle.
        id: GlobalId,
    },
}

/// Communication so far, on this rank.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Halo messages sent.
    pub messages: u64,
    /// Their bytes.
    pub bytes: u64,
    /// Ghosts received, summed over steps.
    pub ghosts: u64,
    /// Particles of other ranks within the halo width, summed over steps: the least number of ghosts that a halo without
    /// knowledge of the pairs would have.
    pub offered: u64,
    /// Particles owned, summed over the same steps.
    pub owned: u64,
    /// Lists of pairs rebuilt.
    pub rebuilds: u64,
    /// Number of times that the domain was cut again.
    pub recuts: u64,
    /// Particles handed to another rank.
    pub migrated: u64,
}

/// The domain as one rank sees it.
#[derive(Clone, Debug)]
pub struct Domain {
    /// Halo width [m]. A particle of the largest size is offered to every rank whose subdomain is within this distance;
    /// for smaller ones the distance is less by the difference of the radii.
    halo: f64,
    cuts: Cuts,
    /// Ranks within the halo width, in rising order.
    neighbours: Vec<Neighbour>,
    /// Do `neighbours` belong to these cuts? The same on all ranks.
    knows_neighbours: bool,
    /// Particles of other ranks within the halo width when the pairs were listed.
    offered: usize,
    /// Communication so far.
    pub traffic: Traffic,
}

impl Domain {
    /// A cell cut evenly among all ranks; `halo` is the halo width, largest reach plus skin [m].
    pub fn new(cell: &Cell, halo: f64, comm: &dyn Comm) -> Self {
        let (low, high) = cell.corners();
        let cuts = Cuts::even(low, high, comm.size());
        Self {
            halo,
            cuts,
            neighbours: Vec::new(),
            knows_neighbours: false,
            offered: 0,
            traffic: Traffic::default(),
        }
    }

    /// Largest distance of bodies that see each other [m].
    pub const fn halo(&self) -> f64 {
        self.halo
    }

    /// Moves the cuts with the sides of a cell carried by a flow. Particles must migrate afterwards.
    pub fn follow(&mut self, cell: &Cell) {
        let (low, high) = cell.corners();
        let space = Subdomain { low, high };
        if cell.strained().is_some() && self.cuts.space() != space {
            self.cuts.stretch(space);
            self.neighbours.clear();
            self.knows_neighbours = false;
        }
    }

    /// Sets another halo width [m], before the first list of pairs.
    pub fn widen(&mut self, halo: f64) {
        self.halo = halo;
    }

    /// Rank that owns a point.
    pub fn owner(&self, point: &Vec3) -> Rank {
        self.cuts.owner(point)
    }

    /// Nearest point of the space that is cut; along a periodic axis every point is inside.
    fn clamped(&self, point: &Vec3, cell: &Cell) -> Vec3 {
        let Subdomain { low, high } = self.cuts.space();
        cell.clamped(point, &low, &high)
    }

    /// Box of a rank [m].
    pub fn subdomain(&self, rank: Rank) -> Subdomain {
        self.cuts.subdomain(rank)
    }

    /// Cuts again, so that every rank gets an equal share of the work. Particles stay where they are until they migrate.
    /// `work` has one number per owned particle. Collective.
    pub fn recut(&mut self, particles: &Particles, work: &[i64], comm: &mut dyn Comm) {
        let (low, high) = room(&particles.walls, &particles.cell);
        self.cuts = Cuts::balanced(low, high, &particles.position[..particles.owned], work, comm);
        self.neighbours.clear();
        self.knows_neighbours = false;
        self.traffic.recuts += 1;
    }

    /// Is an owned particle outside of the room between two corners?
    fn is_outside(particles: &Particles, slot: usize, (low, high): &Corners) -> bool {
        // Walls yield a little: a particle has left once its centre is outside by its radius.
        let slack = particles.radius(slot);
        !particles.cell.has_within(&particles.position[slot], low, high, slack)
    }

    /// Slots of the owned particles that have left the domain.
    pub fn leavers(&self, particles: &Particles) -> impl Iterator<Item = usize> {
        let room = room(&particles.walls, &particles.cell);
        (0..particles.owned).filter(move |&slot| Self::is_outside(particles, slot, &room))
    }

    /// Checks every owned particle except those that are `taken` out.
    ///
    /// # Errors
    /// The first particle that has left the domain or is not finite.
    pub fn check(
        &self,
        particles: &Particles,
        taken: &BTreeSet<GlobalId>,
    ) -> Result<(), DomainError> {
        let room = room(&particles.walls, &particles.cell);
        for slot in 0..particles.owned {
            let (id, p) = (particles.id[slot], particles.position[slot]);
            let speed = particles.velocity[slot].norm();
            if !(p.norm().is_finite() && speed.is_finite()) {
                return Err(DomainError::NotFinite { id });
            }
            if Self::is_outside(particles, slot, &room) && !taken.contains(&id) {
                return Err(DomainError::Outside { id, x: p.x, y: p.y, z: p.z, speed });
            }
        }
        Ok(())
    }
}
