//! What a snapshot holds, as plain tables: the meeting point of the run that writes, the restart
//! that reads and the post-processor that computes.
//!
//! # Files
//!
//! A snapshot is two HDF5 files, each valid VTKHDF `PolyData` with one part per writing rank:
//! `particles_<step>.vtkhdf` (vertices) and `contacts_<step>.vtkhdf` (lines). Both carry the groups
//! `/run`, `/domain`, `/walls`, `/shapes` and, for each drive that saves its state, one of the drive's name, such as `/rain`
//! ([`Header`]); the first also carries `/restart`, all that a restart needs and a picture does not. A column that the scene
//! does not need is not there. The geometry of a shape is a JSON text, `/shapes/geometry`. So is, of walls that turn or have several
//! planes, `/walls/body`: reference point, orientation (i, j, k, w), angular velocity, planes in the axes of the wall.
//!
//! | place | rows | content |
//! |---|---|---|
//! | particles `/VTKHDF/Points` | particles × 3 | centres [m] |
//! | particles `/VTKHDF/PointData/<name>` | particles | the other columns of [`ParticleTable`] that a picture shows |
//! | particles `/restart/particles/<name>` | particles | `angular_momentum`, `image`, and each [`crate::particles::columns::Quantity`] under its name |
//! | particles `/restart/contacts/<name>` | touching pairs | `a`, `b`, `normal`, `overlap`, and what the law remembers under its names |
//! | contacts `/VTKHDF/Points` | 2 per contact × 3 | centre of A; centre of B's nearest image, or the foot on the wall [m] |
//! | contacts `/VTKHDF/CellData/<name>` | contacts | the columns of [`ContactTable`] |

use crate::cell::Cell;
use crate::contact::{Histories, NamedHistory, StateColumn};
use crate::drive::SavedState;
use crate::ids::{GlobalId, ShapeId};
use crate::math::Vec3;
use crate::measure::Departed;
use crate::particles::columns::Accumulated;
use crate::particles::walls::Saved;
use crate::shape::{Ellipsoid, Shape};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// What a snapshot says once: when, where, with what walls and shapes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// Steps since the very first stage began.
    pub step: u64,
    /// Time since then [s].
    pub time: f64,
    /// Time step [s].
    pub dt: f64,
    /// The step at which this stage began, and the time then [s].
    pub stage_begin: (u64, f64),
    /// The id that the next new particle gets.
    pub next_id: u64,
    /// What particles that were taken out have left behind in the balance of energies [J].
    pub departed: Departed,
    /// The scene's `[stop]`, if it holds at this moment and the stage is over; else empty.
    pub stop: String,
    /// The domain, and how it repeats.
    pub cell: Cell,
    /// Gravity [m/s²].
    pub gravity: Vec3,
    /// The walls, in the order of their ids.
    pub walls: Vec<WallRow>,
    /// What drives have saved, by name.
    pub drives: Vec<SavedState>,
    /// The shapes, in the order of their ids.
    pub shapes: Vec<ShapeRow>,
    /// The scene as it ran, as TOML.
    pub scene: String,
}

impl Header {
    /// The walls of one plane, which may end a packing.
    pub fn planes(&self) -> impl Iterator<Item = &WallRow> {
        self.walls.iter().filter(|wall| wall.body.as_ref().is_none_or(Saved::is_one_plane))
    }
}

/// One wall.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WallRow {
    /// Its name in the scene.
    pub name: String,
    /// A point of its first plane [m].
    pub point: Vec3,
    /// Unit normal there, towards the particles.
    pub normal: Vec3,
    /// Velocity of its reference point [m/s].
    pub velocity: Vec3,
    /// Force of the particles on it [N].
    pub force: Vec3,
    /// What else there is to it, if it turns, has turned or has several planes.
    pub body: Option<Saved>,
}

/// One shape of the scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ShapeRow {
    /// Its name in the scene.
    pub name: String,
    /// Name of its kind, as in the scene file.
    pub kind: String,
    /// Semi-axes of an ellipsoid; of other kinds half the lengths, along the principal axes, of the
    /// box about the centre of mass [m].
    pub semi_axes: Vec3,
    /// Volume [m³].
    pub volume: f64,
    /// Mass [kg].
    pub mass: f64,
    /// Principal moments of inertia [kg m²].
    pub inertia: Vec3,
    /// The body itself. `None` for kind `other`: a program's own type cannot be stored.
    pub geometry: Option<Shape>,
}

impl ShapeRow {
    /// The body; of one that is not known, the ellipsoid in the box around it.
    pub fn body(&self) -> Cow<'_, Shape> {
        match &self.geometry {
            Some(shape) => Cow::Borrowed(shape),
            None => Cow::Owned(Shape::Ellipsoid(Ellipsoid { semi_axes: self.semi_axes })),
        }
    }
}

/// Particles of a snapshot, or a piece of them: columns of one length. An optional column that the
/// scene does not need is empty.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ParticleTable {
    /// Name for life.
    pub id: Vec<GlobalId>,
    /// Shape, an index into [`Header::shapes`].
    pub shape: Vec<ShapeId>,
    /// Lengths over those of the shape [-]. Optional: absent if all particles are as large as their shapes.
    pub scale: Vec<f64>,
    /// Centre [m].
    pub position: Vec<Vec3>,
    /// Velocity at the time of `position` [m/s].
    pub velocity: Vec<Vec3>,
    /// Sum of the contact forces at `position`; gravity and damping are not in it [N].
    pub force: Vec<Vec3>,
    /// Contacts with particles and walls, a count.
    pub coordination: Vec<i32>,
    /// Rank that owned the particle.
    pub rank: Vec<i32>,
    /// What has accumulated over the life of each. Optional where a [`crate::particles::columns::Quantity`] is.
    pub accumulated: Accumulated<Vec<f64>>,
    /// Whole periods added to `position` to follow the particle through a periodic domain. Optional.
    pub image: Vec<[i32; 3]>,
    /// Orientation (w, x, y, z), body to world. Optional: absent if all are spheres.
    pub quaternion: Vec<[f64; 4]>,
    /// Angular momentum at the time of `position`, world axes [kg m²/s]. Optional.
    pub angular_momentum: Vec<Vec3>,
    /// Angular velocity at the time of `position`, world axes [rad/s]. Optional, with `angular_momentum`.
    pub angular_velocity: Vec<Vec3>,
    /// Moment at `position`, world axes [N m]. Optional, with `angular_momentum`.
    pub torque: Vec<Vec3>,
}

impl ParticleTable {
    /// Lengths of a particle over those of its shape [-].
    pub fn scale_of(&self, row: usize) -> f64 {
        self.scale.get(row).copied().unwrap_or(1.0)
    }

    /// Volume of a particle over that of its shape, as its mass [-].
    pub fn volume_ratio(&self, row: usize) -> f64 {
        self.scale_of(row).powi(3)
    }
}

/// Contacts of a snapshot, or a piece of them: columns of one length. Each contact stands once, with the
/// owner of A.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ContactTable {
    /// The lower id.
    pub a: Vec<GlobalId>,
    /// The higher id; in the file a wall `k` is `-(k + 1)`.
    pub b: Vec<GlobalId>,
    /// Centre of A [m].
    pub centre: Vec<Vec3>,
    /// From the centre of A to the centre of B's nearest image; for a wall to the contact point [m].
    pub branch: Vec<Vec3>,
    /// Contact point [m].
    pub point: Vec<Vec3>,
    /// Unit normal from A to B.
    pub normal: Vec<Vec3>,
    /// Overlap [m].
    pub overlap: Vec<f64>,
    /// Magnitude of the normal force, compression positive [N].
    pub normal_force: Vec<f64>,
    /// Tangential force that A exerts on B [N].
    pub shear_force: Vec<Vec3>,
}

/// A row of a [`ContactTable`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactRow {
    /// The lower id.
    pub a: GlobalId,
    /// The higher id, or a wall's.
    pub b: GlobalId,
    /// See [`ContactTable::centre`] [m].
    pub centre: Vec3,
    /// See [`ContactTable::branch`] [m].
    pub branch: Vec3,
    /// See [`ContactTable::point`] [m].
    pub point: Vec3,
    /// See [`ContactTable::normal`].
    pub normal: Vec3,
    /// See [`ContactTable::overlap`] [m].
    pub overlap: f64,
    /// See [`ContactTable::normal_force`] [N].
    pub normal_force: f64,
    /// See [`ContactTable::shear_force`] [N].
    pub shear_force: Vec3,
}

impl ContactRow {
    /// The whole force that A exerts on B [N].
    pub fn force(&self) -> Vec3 {
        self.normal * self.normal_force + self.shear_force
    }
}

/// Rows that are visited one by one, as often as needed: a snapshot is written column by column, and the rows of all its
/// columns at once would be most of what a run ever holds.
pub trait Rows<Row> {
    /// How many.
    fn count(&self) -> usize;

    /// Visits each, always in the same order.
    fn each(&self, take: &mut dyn FnMut(&Row));

    /// A column of another length than the first, and its length. Only what is stored in columns can have one.
    fn uneven(&self) -> Option<(&'static str, usize)> {
        None
    }
}

/// The same of histories of touching contacts.
pub trait HistoryRows {
    /// What the law remembers.
    fn columns(&self) -> &[StateColumn];

    /// How many.
    fn count(&self) -> usize;

    /// Visits each, always in the same order.
    fn each(&self, take: &mut dyn FnMut(&NamedHistory));
}

impl HistoryRows for Histories {
    fn columns(&self) -> &[StateColumn] {
        self.columns()
    }

    fn count(&self) -> usize {
        self.len()
    }

    fn each(&self, take: &mut dyn FnMut(&NamedHistory)) {
        self.iter().for_each(|named| take(&named));
    }
}

impl ContactTable {
    /// Adds a contact.
    pub fn push(&mut self, row: &ContactRow) {
        self.a.push(row.a);
        self.b.push(row.b);
        self.centre.push(row.centre);
        self.branch.push(row.branch);
        self.point.push(row.point);
        self.normal.push(row.normal);
        self.overlap.push(row.overlap);
        self.normal_force.push(row.normal_force);
        self.shear_force.push(row.shear_force);
    }

    /// The whole force that A exerts on B [N].
    pub fn force(&self, contact: usize) -> Vec3 {
        self.normal[contact] * self.normal_force[contact] + self.shear_force[contact]
    }
}
