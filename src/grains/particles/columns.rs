//! Columns of particles that a scene needs, and quantities that accumulate over the life of a particle.

use super::{Particles, held};
use crate::ids::{GlobalId, ShapeId, Standing};
use crate::math::{Quat, Vec3, Vec3AndNumber};
use crate::shape::Form;
use serde::{Deserialize, Serialize};
use std::ops::{Index, IndexMut};

/// Columns that a scene needs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[expect(clippy::struct_excessive_bools, reason = "each column is there or not, on its own")]
pub struct Needs {
    /// Velocities of ghosts: for a law with friction or damping.
    pub velocity: bool,
    /// Angular velocity and torque: for a law with moments, or a wall that rotates.
    pub spin: bool,
    /// Orientation and angular momentum, for any shape but the sphere, and contact points. Implies `spin`.
    ///
    /// Contact points of spheres follow from their overlaps.
    pub orientation: bool,
    /// Matrices of ellipsoids, for the common-normal method. Implies `orientation`.
    pub form: bool,
    /// Counts of whole periods: a periodic domain.
    pub image: bool,
    /// Scales: particles of other sizes than their shapes.
    pub scale: bool,
    /// Patches of contacts: for bodies with faces. Implies `orientation`.
    pub patches: bool,
    /// Curvature of bodies at their contacts: for a law whose stiffness depends on it, with bodies other than spheres. Implies `orientation`.
    pub curvature: bool,
    /// Energy dissipated by friction: for a law with friction.
    pub friction: bool,
    /// Energy dissipated by tangential damping: for a law with tangential damping.
    pub tangential_dashpots: bool,
    /// Energy dissipated by resistance to rolling and twisting: for a law with such moments.
    pub turning: bool,
    /// Energy dissipated by global damping.
    pub damping: bool,
    /// Energy taken by adhesion where contacts begin and end: for a law that loses energy there.
    pub adhesion: bool,
    /// Numbers of groups: for particles that are held or pushed.
    pub group: bool,
    /// Foreseen gains of velocities ([`crate::motion::ahead`]): for a law whose damping foresees. Implies `velocity`.
    pub ahead: bool,
}

impl Needs {
    /// Number of `f64` per ghost in the message of each step.
    pub const fn halo_values(&self) -> usize {
        3 + if self.velocity { 3 } else { 0 }
            + if self.spin && self.velocity { 3 } else { 0 }
            + if self.ahead { 3 } else { 0 }
            + if self.spin && self.ahead { 3 } else { 0 }
            + if self.orientation { 4 } else { 0 }
    }

    /// Bytes per owned particle in the columns, without contacts.
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

/// All fields. Sorting, removal, trimming and counts of bytes use this list.
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
    /// Removes the rows from this one on.
    fn truncate(&mut self, rows: usize);
    /// Removes a row if it exists; the last one moves to its place.
    fn take_out(&mut self, row: usize);
    /// Rearranges the rows to this order, if there are any.
    fn sort(&mut self, rows: &[u32]);
    /// Frees memory that more rows have needed.
    fn shrink_to_fit(&mut self);
    /// Memory that the column holds [bytes].
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
    /// Calls `act` for each column.
    pub(super) fn each_column(&mut self, act: impl Fn(&mut dyn Column)) {
        for field in &FIELDS {
            if let Some(column) = (field.get_mut)(self) {
                act(column);
            }
        }
        self.accumulated.0.iter_mut().for_each(|column| act(column));
    }

    /// Memory that the columns hold [bytes].
    pub fn bytes(&self) -> usize {
        let fields = FIELDS.iter().filter_map(|field| (field.get)(self));
        let accumulated = self.accumulated.0.iter().map(held);
        fields.map(Column::held).chain(accumulated).sum()
    }
}

/// Condition for the presence of a column.
#[derive(Clone, Copy, Debug)]
pub enum Presence {
    /// Present in every scene.
    Always,
    /// Present where the scene needs it.
    If(fn(&Needs) -> bool),
}

impl Presence {
    /// Whether the column is present in a scene with these needs.
    pub fn holds(self, needs: &Needs) -> bool {
        match self {
            Self::Always => true,
            Self::If(is_needed) => is_needed(needs),
        }
    }
}

/// A quantity that accumulates over the life of a particle, with one value per particle.
///
/// This is the only declaration: transfer to another owner, snapshots, restart, comparison and the bytes of `--plan` follow from it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Energy dissipated at the particle.
    Dissipated,
    /// Part dissipated by tangential damping, in contacts that stick.
    OfTangentialDashpots,
    /// Part dissipated by friction: of contacts that slide, and torsion of faces.
    OfFriction,
    /// Part dissipated by resistance to rolling and twisting.
    OfTurning,
    /// Part dissipated by global damping.
    OfDamping,
    /// Part taken by adhesion, where contacts begin and end.
    OfAdhesion,
    /// Energy at insertion, and energy received from moving walls.
    Received,
}

/// Number of quantities.
const QUANTITIES: usize = Quantity::ALL.len();

impl Quantity {
    /// All quantities, in the order of their columns.
    pub const ALL: [Self; 7] = [
        Self::Dissipated,
        Self::OfTangentialDashpots,
        Self::OfFriction,
        Self::OfTurning,
        Self::OfDamping,
        Self::OfAdhesion,
        Self::Received,
    ];

    /// Parts of the dissipated energy. The rest is due to normal damping.
    pub const CHANNELS: [Self; 5] = [
        Self::OfTangentialDashpots,
        Self::OfFriction,
        Self::OfTurning,
        Self::OfDamping,
        Self::OfAdhesion,
    ];

    /// Channels that laws sum separately. The friction channel is stored with the torque.
    pub const OF_CONTACTS: [Self; 3] =
        [Self::OfTangentialDashpots, Self::OfTurning, Self::OfAdhesion];

    /// Name in snapshots, unit and presence of the column.
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

    /// Name in snapshots.
    pub const fn name(self) -> &'static str {
        self.column().0
    }

    /// Unit of the values.
    pub const fn unit(self) -> &'static str {
        self.column().1
    }

    /// Scenes that have the quantity.
    pub const fn presence(self) -> Presence {
        self.column().2
    }

    /// Number of quantities in a scene with these needs.
    fn count(needs: Needs) -> usize {
        Self::ALL.iter().filter(|quantity| quantity.presence().holds(&needs)).count()
    }
}

/// Accumulated values: a number for each [`Quantity`], or a column of numbers.
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
    /// Adds the energy that global damping takes from a particle [J].
    #[inline]
    pub fn damp(&mut self, slot: usize, energy: f64) {
        self[Quantity::Dissipated][slot] += energy;
        if let Some(damped) = self[Quantity::OfDamping].get_mut(slot) {
            *damped += energy;
        }
    }

    /// Values of one particle; 0 for columns that do not exist.
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
