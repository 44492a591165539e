//! Which columns particles have: those that a scene needs, and quantities that accumulate over the life of a particle.

use serde::{Deserialize, Serialize};
use std::ops::{Index, IndexMut};

/// Which columns a scene needs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[expect(clippy::struct_excessive_bools, reason = "each column is there or not, on its own")]
pub struct Needs {
    /// Velocities of ghosts: a law with friction or dashpots.
    pub velocity: bool,
    /// Angular velocity, torque: a law that finds moments, or a wall that turns.
    pub spin: bool,
    /// Orientation and angular momentum, for any shape but the sphere, and contact points, which of spheres follow from
    /// their overlaps. Implies `spin`.
    pub orientation: bool,
    /// Matrices of ellipsoids, for the common-normal method. Implies `orientation`.
    pub form: bool,
    /// Counts of whole periods: a periodic domain.
    pub image: bool,
    /// Scales: particles of other sizes than their shapes.
    pub scale: bool,
    /// What contacts of faces have beside overlap, normal and point: bodies with faces. Implies `orientation`.
    pub patches: bool,
    /// How curved bodies are where they touch: a law whose stiffness depends on it, of other bodies than spheres. Implies
    /// `orientation`.
    pub curvature: bool,
    /// What friction has dissipated: a law with friction.
    pub friction: bool,
    /// What tangential dashpots have dissipated: a law that has them.
    pub tangential_dashpots: bool,
    /// What resistance to rolling and twisting has dissipated: a law with moments of its own.
    pub turning: bool,
    /// What global damping has dissipated.
    pub damping: bool,
    /// What adhesion has taken where contacts begin and end: a law that loses energy there.
    pub adhesion: bool,
}

impl Needs {
    /// `f64` per ghost in the message of each step.
    pub const fn halo_values(&self) -> usize {
        3 + if self.velocity { 3 } else { 0 }
            + if self.spin && self.velocity { 3 } else { 0 }
            + if self.orientation { 4 } else { 0 }
    }

    /// Bytes per owned particle in the columns, contacts left out.
    pub fn column_bytes(&self) -> usize {
        // id, shape, standing, position, velocity, force, position at the last listing, travel
        8 + 2
            + 8
            + 4 * 24
            + 8
            + 8
            + 8 * Quantity::count(*self)
            + if self.spin { 56 } else { 0 }
            + if self.orientation { 24 + 32 } else { 0 }
            + if self.form { 48 } else { 0 }
            + if self.image { 12 } else { 0 }
            + if self.scale { 8 } else { 0 }
    }
}

/// When a column is there.
#[derive(Clone, Copy, Debug)]
pub enum Presence {
    /// In every scene.
    Always,
    /// Where the scene needs it.
    If(fn(&Needs) -> bool),
}

impl Presence {
    /// Is it there in a scene with these needs?
    pub fn holds(self, needs: &Needs) -> bool {
        match self {
            Self::Always => true,
            Self::If(is_needed) => is_needed(needs),
        }
    }
}

/// A quantity that accumulates over the life of a particle, one number of each. Declared here once: handing it over to another
/// owner, snapshots, restart, comparison and the bytes of `--plan` follow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Energy dissipated at the particle.
    Dissipated,
    /// The part of that which tangential dashpots have taken, in contacts that stick.
    OfTangentialDashpots,
    /// The part of friction: of contacts that slide, and torsion of faces.
    OfFriction,
    /// The part of resistance to rolling and twisting.
    OfTurning,
    /// The part of global damping.
    OfDamping,
    /// The part of adhesion, where contacts begin and end.
    OfAdhesion,
    /// Energy it had at its insertion and was given by moving walls.
    Received,
}

/// How many there are.
const QUANTITIES: usize = Quantity::ALL.len();

impl Quantity {
    /// All of them, in the order of their columns.
    pub const ALL: [Self; 7] = [
        Self::Dissipated,
        Self::OfTangentialDashpots,
        Self::OfFriction,
        Self::OfTurning,
        Self::OfDamping,
        Self::OfAdhesion,
        Self::Received,
    ];

    /// The parts of what is dissipated. The rest is of normal dashpots.
    pub const CHANNELS: [Self; 5] = [
        Self::OfTangentialDashpots,
        Self::OfFriction,
        Self::OfTurning,
        Self::OfDamping,
        Self::OfAdhesion,
    ];

    /// The channels that laws sum on their own. That of friction stands with the torque.
    pub const OF_CONTACTS: [Self; 3] =
        [Self::OfTangentialDashpots, Self::OfTurning, Self::OfAdhesion];

    /// As snapshots name it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Dissipated => "dissipated",
            Self::OfTangentialDashpots => "dissipated_by_tangential_dashpots",
            Self::OfFriction => "dissipated_by_friction",
            Self::OfTurning => "dissipated_by_turning",
            Self::OfDamping => "dissipated_by_damping",
            Self::OfAdhesion => "dissipated_by_adhesion",
            Self::Received => "received",
        }
    }

    /// Unit of its numbers.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::Dissipated
            | Self::OfTangentialDashpots
            | Self::OfFriction
            | Self::OfTurning
            | Self::OfDamping
            | Self::OfAdhesion
            | Self::Received => "J",
        }
    }

    /// Which scenes have it.
    pub const fn presence(self) -> Presence {
        match self {
            Self::Dissipated | Self::Received => Presence::Always,
            Self::OfTangentialDashpots => Presence::If(|needs| needs.tangential_dashpots),
            Self::OfFriction => Presence::If(|needs| needs.friction),
            Self::OfTurning => Presence::If(|needs| needs.turning),
            Self::OfDamping => Presence::If(|needs| needs.damping),
            Self::OfAdhesion => Presence::If(|needs| needs.adhesion),
        }
    }

    /// How many of them a scene with these needs has.
    fn count(needs: Needs) -> usize {
        Self::ALL.iter().filter(|quantity| quantity.presence().holds(&needs)).count()
    }
}

/// What has accumulated: a number of each [`Quantity`], or a column of numbers.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Accumulated<T>([T; QUANTITIES]);

impl<T> Index<Quantity> for Accumulated<T> {
    type Output = T;

    fn index(&self, quantity: Quantity) -> &T {
        &self.0[quantity as usize]
    }
}

impl<T> IndexMut<Quantity> for Accumulated<T> {
    fn index_mut(&mut self, quantity: Quantity) -> &mut T {
        &mut self.0[quantity as usize]
    }
}

impl Accumulated<Vec<f64>> {
    /// Adds what global damping takes from a particle [J].
    #[inline]
    pub fn damp(&mut self, slot: usize, energy: f64) {
        self[Quantity::Dissipated][slot] += energy;
        if let Some(damped) = self[Quantity::OfDamping].get_mut(slot) {
            *damped += energy;
        }
    }

    /// The numbers of one particle; 0 of columns that are not there.
    pub fn row(&self, row: usize) -> Accumulated<f64> {
        Accumulated(std::array::from_fn(|k| self.0[k].get(row).copied().unwrap_or_default()))
    }

    /// Adds a particle to the columns that a scene needs.
    pub(super) fn push(&mut self, row: &Accumulated<f64>, needs: Needs) {
        for quantity in Quantity::ALL.into_iter().filter(|q| q.presence().holds(&needs)) {
            self[quantity].push(row[quantity]);
        }
    }

    /// Takes a particle out; the last one moves to its row.
    pub(super) fn swap_remove(&mut self, row: usize) {
        for column in self.0.iter_mut().filter(|column| !column.is_empty()) {
            column.swap_remove(row);
        }
    }

    /// All columns.
    pub(super) fn columns_mut(&mut self) -> impl Iterator<Item = &mut Vec<f64>> {
        self.0.iter_mut()
    }

    /// Bytes that they hold.
    pub(super) fn bytes(&self) -> usize {
        self.0.iter().map(super::held).sum()
    }
}
