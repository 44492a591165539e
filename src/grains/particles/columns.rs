//! Which columns particles have: those that a scene needs, and quantities that accumulate over the life of a particle.

use super::{Particles, held};
use crate::ids::{GlobalId, ShapeId, Standing};
use crate::math::{Quat, Vec3, Vec3AndNumber};
use crate::shape::Form;
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
    /// Numbers of groups: particles that are held or pushed.
    pub group: bool,
    /// Foreseen gains of velocities ([`crate::motion::ahead`]): a law whose dashpots foresee. Implies `velocity`.
    pub ahead: bool,
}

impl Needs {
    /// `f64` per ghost in the message of each step.
    pub const fn halo_values(&self) -> usize {
        3 + if self.velocity { 3 } else { 0 }
            + if self.spin && self.velocity { 3 } else { 0 }
            + if self.ahead { 3 } else { 0 }
            + if self.spin && self.ahead { 3 } else { 0 }
            + if self.orientation { 4 } else { 0 }
    }

    /// Bytes per owned particle in the columns, contacts left out.
    pub fn column_bytes(&self) -> usize {
        let fields = FIELDS.iter().filter(|field| field.presence.holds(self));
        fields.map(|field| field.width).sum::<usize>() + size_of::<f64>() * Quantity::count(*self)
    }
}

/// A column of [`Particles`] with a field of its own.
pub(super) struct Field {
    presence: Presence,
    /// Bytes per body.
    width: usize,
    get: fn(&Particles) -> Option<&dyn Column>,
    get_mut: fn(&mut Particles) -> Option<&mut dyn Column>,
}

const fn field<T>(
    presence: Presence,
    get: fn(&Particles) -> Option<&dyn Column>,
    get_mut: fn(&mut Particles) -> Option<&mut dyn Column>,
) -> Field {
    Field { presence, width: size_of::<T>(), get, get_mut }
}

/// All of them. Sorting, taking out, stripping, trimming and counting bytes follow.
static FIELDS: [Field; 18] = [
    field::<GlobalId>(Presence::Always, |p| Some(&p.id), |p| Some(&mut p.id)),
    field::<ShapeId>(Presence::Always, |p| Some(&p.shape), |p| Some(&mut p.shape)),
    field::<f64>(Presence::If(|needs| needs.scale), |p| Some(&p.scale), |p| Some(&mut p.scale)),
    field::<u16>(Presence::If(|needs| needs.group), |p| Some(&p.group), |p| Some(&mut p.group)),
    field::<Standing>(Presence::Always, |p| Some(&p.standing), |p| Some(&mut p.standing)),
    field::<Vec3>(Presence::Always, |p| Some(&p.position), |p| Some(&mut p.position)),
    field::<Vec3>(Presence::Always, |p| Some(&p.velocity), |p| Some(&mut p.velocity)),
    field::<Vec3>(
        Presence::If(|needs| needs.ahead),
        |p| Some(&p.ahead.velocity),
        |p| Some(&mut p.ahead.velocity),
    ),
    field::<Vec3>(
        Presence::If(|needs| needs.ahead && needs.spin),
        |p| Some(&p.ahead.angular_velocity),
        |p| Some(&mut p.ahead.angular_velocity),
    ),
    field::<Vec3AndNumber>(Presence::Always, |p| Some(&p.force), |p| Some(&mut p.force)),
    field::<Vec3>(Presence::Always, |p| Some(&p.listed_at), |p| Some(&mut p.listed_at)),
    field::<f64>(Presence::Always, |p| Some(&p.travel), |p| Some(&mut p.travel)),
    field::<[i32; 3]>(
        Presence::If(|needs| needs.image),
        |p| Some(&p.image),
        |p| Some(&mut p.image),
    ),
    field::<Vec3>(
        TURNS,
        |p| Some(&p.spin.as_ref()?.angular_velocity),
        |p| Some(&mut p.spin.as_mut()?.angular_velocity),
    ),
    field::<Vec3AndNumber>(
        TURNS,
        |p| Some(&p.spin.as_ref()?.torque),
        |p| Some(&mut p.spin.as_mut()?.torque),
    ),
    field::<Vec3>(
        ORIENTED,
        |p| Some(&p.spin.as_ref()?.angular_momentum),
        |p| Some(&mut p.spin.as_mut()?.angular_momentum),
    ),
    field::<Quat>(
        ORIENTED,
        |p| Some(&p.orientation.as_ref()?.quaternion),
        |p| Some(&mut p.orientation.as_mut()?.quaternion),
    ),
    field::<Form>(
        Presence::If(|needs| needs.form),
        |p| Some(&p.orientation.as_ref()?.form),
        |p| Some(&mut p.orientation.as_mut()?.form),
    ),
];

const TURNS: Presence = Presence::If(|needs| needs.spin);
const ORIENTED: Presence = Presence::If(|needs| needs.orientation);

/// A column in memory, of any type.
pub(super) trait Column {
    /// Drops the rows from this one on.
    fn truncate(&mut self, rows: usize);
    /// Drops a row, if it is there; the last one moves to its place.
    fn take_out(&mut self, row: usize);
    /// Takes its rows from these, if it has any.
    fn sort(&mut self, rows: &[u32]);
    /// Gives back room that more rows have needed.
    fn shrink_to_fit(&mut self);
    /// Bytes that it holds.
    fn held(&self) -> usize;
}

impl<T: Copy> Column for Vec<T> {
    fn truncate(&mut self, rows: usize) {
        self.truncate(rows);
    }

    fn take_out(&mut self, row: usize) {
        if row < self.len() {
            self.swap_remove(row);
        }
    }

    fn sort(&mut self, rows: &[u32]) {
        if !self.is_empty() {
            *self = rows.iter().map(|&row| self[row as usize]).collect();
        }
    }

    fn shrink_to_fit(&mut self) {
        self.shrink_to_fit();
    }

    fn held(&self) -> usize {
        held(self)
    }
}

impl Particles {
    /// Does the same with each column.
    pub(super) fn each_column(&mut self, act: impl Fn(&mut dyn Column)) {
        for field in &FIELDS {
            if let Some(column) = (field.get_mut)(self) {
                act(column);
            }
        }
        self.accumulated.0.iter_mut().for_each(|column| act(column));
    }

    /// Bytes that the columns hold.
    pub fn bytes(&self) -> usize {
        let fields = FIELDS.iter().filter_map(|field| (field.get)(self));
        let accumulated = self.accumulated.0.iter().map(held);
        fields.map(Column::held).chain(accumulated).sum()
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

    /// Its column: name in snapshots, unit, which scenes have it.
    const fn column(self) -> (&'static str, &'static str, Presence) {
        match self {
            Self::Dissipated => ("dissipated", "J", Presence::Always),
            Self::OfTangentialDashpots => (
                "dissipated_by_tangential_dashpots",
                "J",
                Presence::If(|needs| needs.tangential_dashpots),
            ),
            Self::OfFriction => {
                ("dissipated_by_friction", "J", Presence::If(|needs| needs.friction))
            }
            Self::OfTurning => ("dissipated_by_turning", "J", Presence::If(|needs| needs.turning)),
            Self::OfDamping => ("dissipated_by_damping", "J", Presence::If(|needs| needs.damping)),
            Self::OfAdhesion => {
                ("dissipated_by_adhesion", "J", Presence::If(|needs| needs.adhesion))
            }
            Self::Received => ("received", "J", Presence::Always),
        }
    }

    /// As snapshots name it.
    pub const fn name(self) -> &'static str {
        self.column().0
    }

    /// Unit of its numbers.
    pub const fn unit(self) -> &'static str {
        self.column().1
    }

    /// Which scenes have it.
    pub const fn presence(self) -> Presence {
        self.column().2
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
}
