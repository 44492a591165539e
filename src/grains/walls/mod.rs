//! Walls: rigid bodies with facets, all of which every rank has.
//!
//! A facet is a plane, or a face, an edge or a corner of a triangle mesh. Only this module and the resolvers of facets depend on that. All
//! planes have slots; of a mesh only the facets near the particles of a rank have. Other modules ask for:
//!
//! - the distance of a point from a plane ([`facets`]),
//! - the facets of a mesh near a point ([`Wall::facets_near`]),
//! - the distance by which a wall has come nearer to particles ([`Wall::nearer_since_listed`]) and its way in a step ([`Wall::way`]),
//! - the depth of a box behind a wall ([`Wall::depth`]),
//! - the bound that it sets to the space of the particles ([`Across`]).
//!
//! A wall has a pose, which is that of its reference point and axes, and a motion. The pose follows in closed form from the number of steps
//! since the wall began its present motion. A million steps have the rounding of one, and a run that continues from a snapshot has the same
//! bits.
//!
//! A scene moves a wall with constant velocities or a motion prescribed in time ([`courses`]). A drive sets the velocities of a wall in each
//! step (`drive::servo`, `drive::free`).

pub mod courses;
mod saved;

pub use saved::{Saved, StageSoFar};

use crate::cell::Cell;
use crate::contact::FacetInPlace;
use crate::ids::{GlobalId, MaterialId, ShapeId};
use crate::math::{Mat3, Quat, Vec3, larger_or_infinite, rotation_about};
use crate::population::Library;
use crate::shape::triangle_mesh::{MeshFacet, NoSolid};
use crate::shape::{HalfSpace, Shape, TriangleMesh};
use courses::Course;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Lowest and highest corner of a box [m].
pub type Corners = (Vec3, Vec3);

/// Components of normals along a wall's direction below this are rounding.
const SQUARE_ON: f64 = 1e-9;
/// Rotations below this are rounding [rad].
const LEAST_TURN: f64 = 1e-9;

/// A rigid body that particles cannot pass.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Wall {
    /// Name in the scene.
    pub name: String,
    /// Reference point, the origin of the wall's axes [m].
    pub point: Vec3,
    /// Rotation from the wall's axes to the world.
    pub orientation: Quat,
    /// Reference point in the scene [m].
    of_scene: Vec3,
    /// Velocity of the reference point [m/s].
    pub velocity: Vec3,
    /// Angular velocity about the reference point [rad/s].
    pub angular_velocity: Vec3,
    /// Velocity of the surface relative to the wall, as of a conveyor belt, in the wall's axes [m/s].
    ///
    /// Its part in the plane of a contact takes effect.
    pub surface_velocity: Vec3,
    /// Mass felt in contacts [kg]; infinite unless contacts depend on it.
    pub mass: f64,
    /// Direction along which the wall has this mass, a unit vector. Across it the wall is held.
    pub free_along: Vec3,
    /// Whether the scene moves the wall, by velocities, a prescribed motion or a servo.
    pub moves: bool,
    /// Point about which the torque on the wall is written, if it is.
    pub torque: Option<TorqueAbout>,
    /// Whether the action of particles on the wall is summed, by triangles if it has any.
    pub wears: bool,
    /// Plane facets of the surface, in the wall's axes.
    pub facets: Vec<Facet>,
    /// Triangle mesh of the surface, in the wall's axes, if it has one.
    pub mesh: Option<Mesh>,
    /// Prescribed motion, if the wall has neither constant velocities nor a drive. Times count from the beginning of the stage.
    pub course: Option<Course>,
    /// Motion with the present velocities; `None` before the first step, or for a wall that does not move.
    steady: Option<Steady>,
    /// State of the prescribed motion; `None` before the first step, or without such a motion.
    following: Option<Following>,
    /// Pose when the pairs were listed.
    listed: Pose,
}

/// Point about which the torque on a wall is computed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum TorqueAbout {
    /// Reference point, which moves with the wall.
    Reference,
    /// A fixed point [m].
    Fixed(Vec3),
}

/// Triangle mesh of a wall.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mesh {
    /// Geometry in the wall's axes. Messages between ranks contain it once, in the library of shapes.
    #[serde(skip)]
    pub surface: Arc<TriangleMesh>,
    /// Index of the geometry in the library of shapes, once it is there.
    pub shape: ShapeId,
    /// Origin of the axes of its file, or of its cylinder [m].
    origin: Vec3,
}

impl Mesh {
    /// Sets the mesh's own origin to a place in the wall's axes [m].
    fn set_origin(&mut self, origin: Vec3) {
        let place = self.origin - origin;
        if place != Vec3::zeros() {
            Arc::make_mut(&mut self.surface).see_from(&place);
        }
        self.origin = origin;
    }
}

/// A plane facet of a wall.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Facet {
    /// Geometry in the wall's axes.
    pub geometry: HalfSpace,
    /// Index of the geometry in the library of shapes, once it is there.
    pub shape: ShapeId,
}

/// Position and orientation of a wall.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Pose {
    point: Vec3,
    orientation: Quat,
}

/// A motion with constant velocities.
///
/// A drive that changes the velocity of the reference point restarts the translation, but not the rotation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Steady {
    /// Steps at which translation and rotation began.
    since: [u64; 2],
    /// Pose at those steps.
    from: Pose,
    /// Velocity of the reference point [m/s].
    velocity: Vec3,
    /// Angular velocity about the reference point [rad/s].
    angular_velocity: Vec3,
}

/// A prescribed motion in progress.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Following {
    /// Step at which it began.
    since: u64,
    /// Time of the prescribed motion at that step [s].
    time: f64,
    /// Pose at that step.
    from: Pose,
}

impl Following {
    /// Time of the prescribed motion after a step, for steps of `dt` [s].
    fn time_at(&self, step: u64, dt: f64) -> f64 {
        self.time + (step - self.since) as f64 * dt
    }

    /// Pose by the prescribed motion at a time [s].
    fn pose_at(&self, course: &Course, time: f64) -> Pose {
        Pose {
            point: self.from.point + (course.shift(time) - course.shift(self.time)),
            orientation: course.rotation(self.time, time) * self.from.orientation,
        }
    }
}

impl Steady {
    /// Pose at a step, for steps of `dt` [s].
    fn pose(&self, step: u64, dt: f64) -> Pose {
        let [way, turn] = self.since.map(|since| (step - since) as f64 * dt);
        let Pose { point, orientation } = self.from;
        let rate = self.angular_velocity.norm();
        let turned = if rate > 0.0 {
            rotation_about(&(self.angular_velocity / rate), rate * turn) * orientation
        } else {
            orientation
        };
        Pose { point: point + self.velocity * way, orientation: turned }
    }
}

/// Cosine of 0.001, the largest angle between walls that count as lying in each other.
pub const PARALLEL: f64 = 1.0 - 5e-7;

/// A plane in place: points `p` with `(p - point) · normal = offset`.
#[derive(Clone, Copy, Debug)]
pub struct InPlace {
    point: Vec3,
    normal: Vec3,
    offset: f64,
}

impl InPlace {
    /// Distance of a point in front of the plane [m].
    #[inline]
    pub fn distance(&self, point: &Vec3) -> f64 {
        (point - self.point).dot(&self.normal) - self.offset
    }

    /// Whether the plane coincides with another one within a distance [m].
    fn is_same(&self, other: &Self, tolerance: f64) -> bool {
        let on_other = other.point + other.normal * other.offset;
        self.normal.dot(&other.normal) > PARALLEL && self.distance(&on_other).abs() <= tolerance
    }

    /// Largest change of the distance from a point within `room` since the facet was at `before` [m].
    fn moved(&self, before: &Self, room: &Corners) -> f64 {
        if self.normal == before.normal {
            let along = (self.point - before.point).dot(&self.normal);
            return (along + (self.offset - before.offset)).abs();
        }
        // The change of the distance is linear in the position of the point, so it is largest at a corner.
        let moved = |corner: Vec3| (before.distance(&corner) - self.distance(&corner)).abs();
        corners(room).into_iter().map(moved).fold(0.0, larger_or_infinite)
    }
}

impl Pose {
    /// Wall's axes in the world, as columns. An axis along that of the rotation stays the same to the last bit.
    fn frame(&self) -> Mat3 {
        let turned = |axis: Vec3| self.orientation.transform_vector(&axis);
        Mat3::from_columns(&[turned(Vec3::x()), turned(Vec3::y()), turned(Vec3::z())])
    }

    fn place(&self, facet: &Facet) -> InPlace {
        let HalfSpace { normal, offset } = facet.geometry;
        InPlace { point: self.point, normal: self.frame() * normal, offset }
    }
}

/// A wall across an axis, like one of a box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Across {
    /// The axis.
    pub axis: usize,
    /// Component of the normal, 1 or -1.
    pub inwards: f64,
    /// Position along the axis [m].
    pub place: f64,
}

impl Wall {
    /// A wall of planes at rest.
    ///
    /// Each plane is given by a point [m] and a unit normal towards the particles; `reference` is the reference point [m].
    pub fn of_planes(name: String, reference: Vec3, planes: &[(Vec3, Vec3)]) -> Self {
        let facet = |&(point, normal): &(Vec3, Vec3)| Facet {
            geometry: HalfSpace { normal, offset: (point - reference).dot(&normal) },
            shape: ShapeId(0),
        };
        let pose = Pose { point: reference, orientation: Quat::identity() };
        Self {
            name,
            point: pose.point,
            orientation: pose.orientation,
            of_scene: pose.point,
            velocity: Vec3::zeros(),
            angular_velocity: Vec3::zeros(),
            surface_velocity: Vec3::zeros(),
            mass: f64::INFINITY,
            free_along: Vec3::zeros(),
            moves: false,
            torque: None,
            wears: false,
            facets: planes.iter().map(facet).collect(),
            mesh: None,
            course: None,
            steady: None,
            following: None,
            listed: pose,
        }
    }

    /// A wall of one plane at rest, with the reference point in it.
    pub fn plane(name: String, point: Vec3, normal: Vec3) -> Self {
        Self::of_planes(name, point, &[(point, normal)])
    }

    /// A wall of triangles at rest, with corners relative to the reference point [m].
    pub fn of_mesh(name: String, reference: Vec3, surface: TriangleMesh) -> Self {
        let surface = Arc::new(surface);
        let mesh = Some(Mesh { surface, shape: ShapeId(0), origin: Vec3::zeros() });
        Self { mesh, ..Self::of_planes(name, reference, &[]) }
    }

    /// Adds the cells behind the triangles, for particles with faces that reach this far at most [m].
    ///
    /// # Errors
    /// If the surface does not have two sides.
    pub fn add_cells(&mut self, farthest: f64) -> Result<(), NoSolid> {
        if let Some(Mesh { surface, .. }) = &mut self.mesh {
            Arc::make_mut(surface).add_cells(farthest)?;
        }
        Ok(())
    }

    /// Extends the cells behind the triangles, if there are any, for particles with faces that reach this far [m].
    ///
    /// # Panics
    /// If the surface has cells but not two sides, which cannot occur.
    pub fn deepen_cells(&mut self, farthest: f64, library: &mut Library) {
        if let Some(Mesh { surface, shape, .. }) = &mut self.mesh
            && surface.has_cells()
        {
            Arc::make_mut(surface)
                .add_cells(farthest)
                .expect("that it has two sides does not depend on how far grains reach");
            library.shapes[shape.index()] = Shape::TriangleMesh(Arc::clone(surface));
        }
    }

    /// Number of shapes that the facets need in a library.
    pub fn shapes(&self) -> usize {
        self.facets.len() + usize::from(self.mesh.is_some())
    }

    /// Name of a facet in messages; empty if it is the only one.
    pub fn facet_name(&self, facet: usize) -> String {
        let is_there = |mesh: &&Mesh| facet < mesh.surface.facet_count();
        let mesh = self.mesh.as_ref().filter(is_there);
        match mesh.map(|mesh| mesh.surface.facet(facet as u32)) {
            Some(MeshFacet::Face { .. }) => format!("face {facet} of "),
            Some(MeshFacet::Edge { .. }) => format!("edge {facet} of "),
            Some(MeshFacet::Strip(_)) => format!("strip {facet} of "),
            Some(MeshFacet::Rim(_)) => format!("rim {facet} of "),
            Some(MeshFacet::Corner { .. }) => format!("corner {facet} of "),
            None if self.facets.len() > 1 => format!("plane {facet} of "),
            None => String::new(),
        }
    }

    /// Adds the facets to a library of shapes, with their material and the mass along their normals.
    pub fn enter(&mut self, library: &mut Library, material: MaterialId) {
        let along = self.frame().tr_mul(&self.free_along);
        let mass = self.mass;
        // Held across its direction, the wall is heavier the more the normal deviates from that direction.
        let mass_against = |along_normal: f64| {
            if along_normal.abs() > SQUARE_ON {
                mass / (along_normal * along_normal)
            } else {
                f64::INFINITY
            }
        };
        for facet in &mut self.facets {
            let shape = Shape::HalfSpace(facet.geometry);
            facet.shape = library.push(&self.name, shape, material, f64::INFINITY);
            library.mass_felt[facet.shape.index()] =
                mass_against(facet.geometry.normal.dot(&along));
        }
        if let Some(mesh) = &mut self.mesh {
            let shape = Shape::TriangleMesh(mesh.surface.clone());
            mesh.shape = library.push(&self.name, shape, material, f64::INFINITY);
            let felt = mass_against(mesh.surface.most_along(&along));
            library.mass_felt[mesh.shape.index()] = felt;
        }
    }

    /// Takes the triangle mesh, which messages do not contain, from the library.
    pub fn take_surface(&mut self, library: &Library) {
        if let Some(mesh) = &mut self.mesh
            && let Shape::TriangleMesh(surface) = &library.shapes[mesh.shape.index()]
        {
            mesh.surface = Arc::clone(surface);
        }
    }

    /// Lowest and highest corner of the triangles in place [m], if there are any.
    pub fn extent(&self) -> Option<Corners> {
        let corners = self.corners().map(|corner| (corner, corner));
        corners.reduce(|(low, high), (l, h)| (low.inf(&l), high.sup(&h)))
    }

    /// Corners of the triangles in place [m].
    fn corners(&self) -> impl Iterator<Item = Vec3> {
        let of_mesh = self.mesh.iter().flat_map(|mesh| mesh.surface.triangles().flatten());
        of_mesh.map(|corner| self.point + self.orientation.transform_vector(&corner))
    }

    /// Whether all triangles are outside the domain by more than its extent.
    pub fn is_far_out_of(&self, cell: &Cell) -> bool {
        let Some(Mesh { surface, .. }) = &self.mesh else { return false };
        let ((low, high), reach) = (cell.corners(), surface.reach());
        (0..3).any(|k| {
            let width = high[k] - low[k];
            self.point[k] - reach > high[k] + width || self.point[k] + reach < low[k] - width
        })
    }

    const fn pose(&self) -> Pose {
        Pose { point: self.point, orientation: self.orientation }
    }

    /// Wall's axes in the world, as columns.
    pub fn frame(&self) -> Mat3 {
        self.pose().frame()
    }

    fn in_place(&self) -> impl Iterator<Item = InPlace> {
        let pose = self.pose();
        self.facets.iter().map(move |facet| pose.place(facet))
    }

    /// Whether the wall has triangles, or a plane against which this direction leads.
    pub fn holds_against(&self, direction: &Vec3) -> bool {
        self.mesh.is_some() || self.in_place().any(|plane| plane.normal.dot(direction) < 0.0)
    }

    /// Whether a part of the wall coincides with another wall within a distance [m].
    ///
    /// The other wall may be the wall itself: then the part coincides with another face. Cylinders and cones never coincide.
    pub fn lies_in(&self, other: &Self, tolerance: f64) -> bool {
        let planes: Vec<InPlace> = other.in_place().collect();
        let is_itself = std::ptr::eq(self, other);
        let in_plane = |corners: &[Vec3; 3]| {
            let is_on = |plane: &InPlace| {
                corners.iter().all(|corner| plane.distance(corner).abs() <= tolerance)
            };
            planes.iter().any(is_on)
        };
        let mut of_planes = self.in_place();
        if !is_itself && of_planes.any(|one| planes.iter().any(|two| one.is_same(two, tolerance))) {
            return true;
        }
        let Some(Mesh { surface, .. }) = &self.mesh else { return false };
        if surface.is_round() {
            return false;
        }
        if is_itself {
            return surface.lies_in_itself(tolerance);
        }
        let (frame, other_frame) = (self.frame(), other.frame());
        let triangles = surface.triangles().map(|t| t.map(|corner| frame * corner + self.point));
        let in_mesh = |corners: &[Vec3; 3]| {
            let seen = corners.map(|corner| other_frame.tr_mul(&(corner - other.point)));
            let mesh = other.mesh.as_ref();
            mesh.is_some_and(|mesh| mesh.surface.lies_in(&seen, None, tolerance))
        };
        triangles.into_iter().any(|corners| in_plane(&corners) || in_mesh(&corners))
    }

    /// A point of the first facet, and its unit normal towards the particles, as written to files.
    pub fn surface(&self) -> (Vec3, Vec3) {
        let first = self.in_place().next();
        first.map_or((self.point, Vec3::zeros()), |InPlace { point, normal, offset }| {
            (point + normal * offset, normal)
        })
    }

    /// Torque about the point of `TorqueAbout` [N m], from that about the reference point and the force on the wall [N].
    pub fn torque_of(&self, about_reference: &Vec3, force: &Vec3) -> Vec3 {
        match self.torque {
            Some(TorqueAbout::Fixed(point)) => about_reference + (self.point - point).cross(force),
            _ => *about_reference,
        }
    }

    /// Power of the wall on the particles [W], from the force on it [N] and the torque about its reference point [N m].
    pub fn power(&self, force: &Vec3, torque: &Vec3) -> f64 {
        -(force.dot(&self.velocity) + torque.dot(&self.angular_velocity))
    }

    /// Whether the wall is a conveyor belt.
    pub fn is_belt(&self) -> bool {
        self.surface_velocity != Vec3::zeros()
    }

    /// Whether the wall can do work on the particles, because it moves or is a belt.
    pub fn may_work(&self) -> bool {
        self.moves || self.is_belt()
    }

    /// Whether the wall moves now, or has a prescribed motion.
    pub fn is_moving(&self) -> bool {
        self.course.is_some()
            || self.velocity != Vec3::zeros()
            || self.angular_velocity != Vec3::zeros()
    }

    /// Whether the scene rotates the wall, now or later.
    pub fn may_turn(&self) -> bool {
        self.angular_velocity != Vec3::zeros() || self.turn_of_course().is_some()
    }

    /// Axis of rotation of the prescribed motion.
    fn turn_of_course(&self) -> Option<Vec3> {
        let (axis, _) = self.course.as_ref()?.turn.as_ref()?;
        Some(*axis)
    }

    /// Sets a prescribed motion in place of constant velocities.
    pub fn follow(&mut self, course: Course) {
        (self.velocity, self.angular_velocity) = course.first_velocities();
        self.course = Some(course);
    }

    /// Whether the wall rotates, or has rotated since the pairs were listed.
    pub fn turns(&self) -> bool {
        self.may_turn() || self.orientation != self.listed.orientation
    }

    /// Position across an axis, if the wall always stays in that plane.
    ///
    /// Returns `None` if the wall is tilted, rotates out of its plane or has several facets.
    pub fn across(&self) -> Option<Across> {
        let [facet] = &*self.facets else { return None };
        let InPlace { point, normal, offset } = self.pose().place(facet);
        let (axis, inwards) =
            (0..3).map(|axis| (axis, normal[axis])).find(|&(_, along)| along.abs() == 1.0)?;
        let stays = [Some(self.angular_velocity), self.turn_of_course()]
            .into_iter()
            .flatten()
            .all(|turn| turn.cross(&normal) == Vec3::zeros());
        stays.then(|| Across { axis, inwards, place: point[axis] + inwards * offset })
    }

    /// Whether the orientation differs from that in the scene.
    pub fn is_turned(&self) -> bool {
        self.orientation != Quat::identity()
    }

    /// Records the pose when the pairs are listed.
    pub(crate) const fn note_listing(&mut self) {
        self.listed = self.pose();
    }

    /// Moves the wall to its pose after `step` steps, of which the last took `dt` [s].
    ///
    /// Returns the largest distance by which it can have come nearer to a particle [m]. All particles have their centres within `room`.
    pub(crate) fn advance(&mut self, step: u64, dt: f64, room: &Corners) -> f64 {
        let before = self.pose();
        if let Some(course) = &self.course {
            let begin = Following { since: step - 1, time: 0.0, from: before };
            let following = *self.following.get_or_insert(begin);
            let time = following.time_at(step, dt);
            (self.velocity, self.angular_velocity) = course.mean_velocities(time, dt);
            self.stand(following.pose_at(course, time));
            return self.moved_since(&before, room);
        }
        if !self.is_moving() {
            self.steady = None;
            return 0.0;
        }
        let (velocity, angular_velocity) = (self.velocity, self.angular_velocity);
        let mut steady = Steady { since: [step - 1; 2], from: before, velocity, angular_velocity };
        // A motion that does not lead to the present pose, as after a pause or with another step, has ended.
        if let Some(so_far) = &self.steady {
            let there = so_far.pose(step - 1, dt);
            if so_far.velocity == velocity && there.point == before.point {
                (steady.since[0], steady.from.point) = (so_far.since[0], so_far.from.point);
            }
            if so_far.angular_velocity == angular_velocity
                && there.orientation == before.orientation
            {
                steady.since[1] = so_far.since[1];
                steady.from.orientation = so_far.from.orientation;
            }
        }
        self.steady = Some(steady);
        self.stand(steady.pose(step, dt));
        if angular_velocity == Vec3::zeros() {
            return (self.point - before.point).norm();
        }
        self.moved_since(&before, room)
    }

    /// Continues with another length of the step after `step` steps of `before` [s].
    pub fn change_step(&mut self, step: u64, before: f64) {
        let from = self.pose();
        self.steady = None;
        if let Some(following) = &mut self.following {
            *following = Following { since: step, time: following.time_at(step, before), from };
        }
    }

    const fn stand(&mut self, Pose { point, orientation }: Pose) {
        (self.point, self.orientation) = (point, orientation);
    }

    /// Largest distance by which the surface can have come nearer to a particle since the pairs were listed [m].
    ///
    /// All particles have their centres within `room`. A surface that slides along itself comes no nearer.
    pub fn nearer_since_listed(&self, room: &Corners) -> f64 {
        self.moved_since(&self.listed, room)
    }

    /// Numbers of the facets of a mesh within a distance of a point [m].
    pub fn facets_near(&self, point: &Vec3, distance: f64) -> Vec<u32> {
        let Some(Mesh { surface, .. }) = &self.mesh else { return Vec::new() };
        surface.near(&self.frame().tr_mul(&(point - self.point)), distance)
    }

    fn moved_since(&self, before: &Pose, room: &Corners) -> f64 {
        if let Some(Mesh { surface, .. }) = &self.mesh {
            let turn = (self.orientation * before.orientation.inverse()).scaled_axis();
            // The axis of a rotation within rounding is not known.
            let reach = if turn.norm() > LEAST_TURN {
                surface.reach_about(&self.frame().tr_mul(&turn))
            } else {
                surface.reach()
            };
            return (self.point - before.point).norm() + turn.norm() * reach;
        }
        let before = self.facets.iter().map(|facet| before.place(facet));
        most_moved(self.in_place().zip(before), room)
    }

    /// Largest displacement of the surface along its normal within `room` in a step of `dt` [s] at the present velocities [m].
    ///
    /// Sliding of the surface along itself does not count.
    pub fn way(&self, dt: f64, room: &Corners) -> f64 {
        let mut largest = 0.0;
        if let Some(Mesh { surface, .. }) = &self.mesh {
            let turn = self.frame().tr_mul(&self.angular_velocity);
            let turning = turn.norm() * surface.reach_about(&turn);
            largest = larger_or_infinite(0.0, (self.velocity.norm() + turning) * dt);
        }
        for InPlace { point, normal, .. } in self.in_place() {
            let speed = self.velocity.dot(&normal);
            if self.angular_velocity == Vec3::zeros() {
                largest = larger_or_infinite(largest, (speed * dt).abs());
                continue;
            }
            let turning = self.angular_velocity.cross(&normal);
            for corner in corners(room) {
                largest = larger_or_infinite(
                    largest,
                    ((speed - (corner - point).dot(&turning)) * dt).abs(),
                );
            }
        }
        largest
    }

    /// Speed of the reference point towards the particles [m/s]: the largest of several facets; in any direction for triangles.
    pub fn speed_inwards(&self) -> f64 {
        if self.mesh.is_some() {
            return self.velocity.norm();
        }
        let speeds = self.in_place().map(|facet| self.velocity.dot(&facet.normal));
        speeds.reduce(|a, b| if b.abs() > a.abs() { b } else { a }).unwrap_or(0.0)
    }

    /// Velocity with this speed towards the particles and the present velocity along the surface [m/s], for a wall of one plane.
    pub fn velocity_inwards(&self, speed: f64) -> Vec3 {
        let (_, normal) = self.surface();
        let along = self.velocity - normal * normal.dot(&self.velocity);
        normal * speed + along
    }

    /// Normal part of a force on a wall of one plane [N], positive away from the particles.
    pub fn press(&self, force: &Vec3) -> f64 {
        let (_, normal) = self.surface();
        -force.dot(&normal)
    }

    /// Whether a part of a ball is at or behind the surface [m].
    pub fn meets_ball(&self, centre: &Vec3, radius: f64) -> bool {
        if let Some(Mesh { surface, .. }) = &self.mesh {
            return surface.meets_ball(&self.frame().tr_mul(&(centre - self.point)), radius);
        }
        self.in_place().any(|facet| facet.distance(centre) < radius)
    }

    /// Largest depth of a box behind a facet [m]; not positive if the box is in front.
    pub fn depth(&self, &(low, high): &Corners) -> f64 {
        let half = (high - low) * 0.5;
        if let Some(Mesh { surface, .. }) = &self.mesh {
            // The box around the box, in the wall's axes: whether triangles enter it.
            let frame = self.frame();
            let centre = frame.tr_mul(&(low + half - self.point));
            let reach = frame.transpose().abs() * half;
            let comes_in = surface.comes_into(&(centre - reach), &(centre + reach));
            return if comes_in { half.min() } else { f64::NEG_INFINITY };
        }
        let behind = |facet: InPlace| half.dot(&facet.normal.abs()) - facet.distance(&(low + half));
        self.in_place().map(behind).fold(f64::NEG_INFINITY, larger_or_infinite)
    }

    /// Distance of a box's farthest corner in front of the planes, for the plane that leaves the least [m]; `None` for triangles.
    ///
    /// Particles are in front of all planes.
    pub fn room_before(&self, &(low, high): &Corners) -> Option<f64> {
        let half = (high - low) * 0.5;
        let before = |facet: InPlace| half.dot(&facet.normal.abs()) + facet.distance(&(low + half));
        self.in_place().map(before).reduce(f64::min)
    }

    /// Whether one of the planes moves towards the particles in this direction, a unit vector. Always true for triangles.
    pub fn leads(&self, along: &Vec3) -> bool {
        self.mesh.is_some() || self.in_place().any(|facet| facet.normal.dot(along) > SQUARE_ON)
    }

    /// Takes another reference point [m], that of the scene, without a change of the pose.
    pub fn refer_to(&mut self, point: Vec3) {
        let (frame, shift) = (self.frame(), self.point - point);
        for Facet { geometry, .. } in &mut self.facets {
            geometry.offset += shift.dot(&(frame * geometry.normal));
        }
        if let Some(mesh) = &mut self.mesh {
            mesh.set_origin(mesh.origin + frame.tr_mul(&shift));
        }
        (self.point, self.of_scene) = (point, point);
        self.steady = None;
    }
}

/// First wall, or image of a wall of triangles, that a ball reaches or is behind [m].
pub fn met_by<'a>(
    walls: impl IntoIterator<Item = &'a Wall>,
    cell: &Cell,
    centre: &Vec3,
    radius: f64,
) -> Option<&'a Wall> {
    let meets = |wall: &&Wall| {
        wall.meets_ball(centre, radius)
            || wall.mesh.is_some()
                && cell
                    .images_of_ball(centre, radius)
                    .iter()
                    .any(|image| wall.meets_ball(image, radius))
    };
    walls.into_iter().find(meets)
}

/// Largest displacement of a facet along its normal within `room` [m], from the present and the previous plane of each.
fn most_moved(facets: impl Iterator<Item = (InPlace, InPlace)>, room: &Corners) -> f64 {
    facets.map(|(now, before)| now.moved(&before, room)).fold(0.0, larger_or_infinite)
}

/// Planes of all walls in place, in the order of their slots.
pub fn facets(walls: &[Wall]) -> Vec<InPlace> {
    walls.iter().flat_map(Wall::in_place).collect()
}

/// Ids of the planes of all walls, in the order of their slots, which come before those of the facets of meshes.
pub fn ids(walls: &[Wall]) -> impl Iterator<Item = GlobalId> {
    let facets = walls.iter().map(|wall| 0..wall.facets.len()).enumerate();
    facets.flat_map(|(wall, facets)| facets.map(move |facet| GlobalId::facet(wall, facet)))
}

/// The eight corners of a box.
fn corners(&(low, high): &Corners) -> [Vec3; 8] {
    std::array::from_fn(|k| {
        Vec3::from_fn(|axis, _| if k >> axis & 1 == 0 { low[axis] } else { high[axis] })
    })
}

/// Ends of the space of the particles along an axis: positions of the innermost walls across it [m].
///
/// `None` on a side without such a wall.
pub fn ends(walls: &[Wall], axis: usize) -> [Option<f64>; 2] {
    let places = |inwards: f64| {
        let stands = walls.iter().filter_map(Wall::across);
        let facing = stands.filter(move |wall| wall.axis == axis && wall.inwards == inwards);
        facing.map(|wall| wall.place)
    };
    [places(1.0).reduce(f64::max), places(-1.0).reduce(f64::min)]
}

/// Area on which the particles press against a wall across an axis [m²]; `None` if a side is open.
///
/// It is the product of the periods, or distances of walls, along the other axes.
pub fn area(walls: &[Wall], cell: &Cell, axis: usize) -> Option<f64> {
    let between_walls = |axis| match ends(walls, axis) {
        [Some(low), Some(high)] => Some(high - low),
        _ => None,
    };
    let periods = cell.periods();
    let width = |axis: usize| {
        let period = periods[axis];
        if period.is_finite() { Some(period) } else { between_walls(axis) }
    };
    Some(width((axis + 1) % 3)? * width((axis + 2) % 3)?)
}

/// Box of the particles: the cell, extended by walls that have moved out of it [m].
pub fn room(walls: &[Wall], cell: &Cell) -> Corners {
    let (mut low, mut high) = cell.corners();
    for Across { axis, inwards, place } in walls.iter().filter_map(Wall::across) {
        if inwards > 0.0 {
            low[axis] = low[axis].min(place);
        } else {
            high[axis] = high[axis].max(place);
        }
    }
    (low, high)
}

/// Whether any two planes of walls face the same way.
pub(super) fn any_parallel(walls: &[Wall]) -> bool {
    let normals: Vec<Vec3> = walls.iter().flat_map(Wall::in_place).map(|p| p.normal).collect();
    (1..normals.len()).any(|k| normals[..k].iter().any(|other| normals[k].dot(other) > PARALLEL))
}

/// Additional columns for the slots of facets. Length: facets.
#[expect(clippy::struct_excessive_bools, reason = "each is asked for by itself")]
#[derive(Clone, Debug, Default)]
pub struct FacetColumns {
    /// Index of the wall.
    pub wall: Vec<u32>,
    /// Pose and number of each facet.
    pub place: Vec<FacetInPlace>,
    /// Velocities of the surfaces relative to their walls, see [`Wall::surface_velocity`], world axes [m/s]; empty if no wall is a belt.
    pub belts: Vec<Vec3>,
    /// Whether any wall moved when the columns were filled.
    pub any_moves: bool,
    /// Whether any wall rotates.
    pub any_turns: bool,
    /// Whether any two planes face the same way, so that they may coincide.
    pub any_parallel: bool,
    /// Whether torques on walls are needed: any wall rotates or writes its torque.
    pub any_torque: bool,
}

#[cfg(test)]
mod tests {
    use super::{Across, Corners, Wall};
    use crate::math::{Quat, Vec3, rotation_about};
    use crate::random::Random;

    const ROOM: Corners = (Vec3::new(-1.0, -2.0, -0.5), Vec3::new(0.5, 1.0, 1.0));

    /// A wall of two random planes, which moves and rotates.
    fn moving(random: &mut Random) -> Wall {
        let mut vector = |size: f64| Vec3::from_fn(|_, _| size * random.signed());
        let planes = [0, 1].map(|_| (vector(1.0), vector(1.0).normalize()));
        let mut wall = Wall::of_planes("wall".to_owned(), vector(1.0), &planes);
        (wall.velocity, wall.angular_velocity) = (vector(1.0), vector(3.0));
        wall
    }

    fn distances(wall: &Wall, point: &Vec3) -> Vec<f64> {
        wall.in_place().map(|facet| facet.distance(point)).collect()
    }

    /// Comparison with planes moved by the rotation of their wall.
    #[test]
    fn planes_go_with_their_wall() {
        for id in 0..100 {
            let mut random = Random::of(1, id);
            let planes = [0, 1].map(|_| {
                let mut vector = || Vec3::from_fn(|_, _| random.signed());
                (vector(), vector().normalize())
            });
            let mut vector = || Vec3::from_fn(|_, _| random.signed());
            let (reference, velocity, turn, point) = (vector(), vector(), vector(), vector());
            let mut wall = Wall::of_planes("wall".to_owned(), reference, &planes);
            (wall.velocity, wall.angular_velocity) = (velocity, turn);
            let (steps, dt) = (1000, 2e-3);
            (1..=steps).for_each(|step| {
                wall.advance(step, dt, &ROOM);
            });
            let time = steps as f64 * dt;
            let rotation = Quat::from_scaled_axis(turn * time);
            let moved = |point: Vec3| reference + velocity * time + rotation * (point - reference);
            for ((through, normal), distance) in planes.iter().zip(distances(&wall, &point)) {
                let expected = (point - moved(*through)).dot(&(rotation * normal));
                assert!((distance - expected).abs() < 1e-12, "{id}: {distance} {expected}");
            }
            let (through, normal) = wall.surface();
            assert!((normal - rotation * planes[0].1).norm() < 1e-14);
            assert!((through - moved(planes[0].0)).dot(&normal).abs() < 1e-12);
        }
    }

    /// No particle in the room comes nearer than reported, and some come as near.
    #[test]
    fn nothing_comes_nearer_than_walls_say() {
        for id in 0..200 {
            let mut random = Random::of(2, id);
            let mut wall = moving(&mut random);
            wall.note_listing();
            let before = wall.clone();
            let dt = 1e-3;
            let way = wall.way(dt, &ROOM);
            let steps = (1..=20).map(|step| wall.advance(step, dt, &ROOM)).collect::<Vec<_>>();
            let nearer = wall.nearer_since_listed(&ROOM);
            assert!(nearer <= steps.iter().sum::<f64>() + 1e-12);
            assert!((way / steps[0] - 1.0).abs() < 0.02, "{way} {}", steps[0]);
            let corners = super::corners(&ROOM);
            let any = std::iter::repeat_with(|| {
                let parts = Vec3::from_fn(|_, _| random.unit());
                ROOM.0 + parts.component_mul(&(ROOM.1 - ROOM.0))
            });
            let came = |point: &Vec3| {
                let both = distances(&before, point).into_iter().zip(distances(&wall, point));
                both.map(|(then, now)| (then - now).abs()).fold(0.0, f64::max)
            };
            let most = any.take(200).map(|point| came(&point)).fold(0.0, f64::max);
            assert!(most <= nearer + 1e-14 && most > 0.3 * nearer, "{id}: {most} {nearer}");
            let at_corners = corners.iter().map(came).fold(0.0, f64::max);
            assert!((at_corners / nearer - 1.0).abs() < 1e-12);
        }
    }

    /// A turntable stays across its axis to the last bit and comes no nearer; a flap does not stay.
    #[test]
    fn a_turntable_stays_in_its_plane() {
        let mut table = Wall::plane("table".to_owned(), Vec3::new(0.3, 0.2, 0.1), -Vec3::z());
        table.angular_velocity = Vec3::z() * 7.0;
        table.note_listing();
        for step in 1..=1000 {
            table.advance(step, 1e-3, &ROOM);
        }
        assert_eq!(table.across(), Some(Across { axis: 2, inwards: -1.0, place: 0.1 }));
        assert_eq!((table.nearer_since_listed(&ROOM), table.way(1e-3, &ROOM)), (0.0, 0.0));
        table.angular_velocity = Vec3::x();
        assert_eq!(table.across(), None);
        assert!(table.way(1e-3, &ROOM) > 1e-3);
    }

    /// Translation and rotation follow from the number of their steps, even if saved and restored on the way. Other motions begin where
    /// these end.
    #[test]
    fn a_motion_is_counted_in_steps() {
        let axis = Vec3::new(0.48, 0.6, 0.64);
        let mut wall = Wall::plane("wall".to_owned(), Vec3::zeros(), Vec3::x());
        wall.angular_velocity = axis * 2.0;
        wall.velocity = Vec3::new(0.1, -0.3, 0.7);
        for step in 11..=500 {
            wall.advance(step, 1e-3, &ROOM);
            if step == 300 {
                let text = serde_json::to_string(&wall.saved()).unwrap();
                let saved: Option<super::Saved> = serde_json::from_str(&text).unwrap();
                assert_eq!(saved, wall.saved());
                let mut library = crate::population::Library::default();
                let mut again = Wall::plane("wall".to_owned(), Vec3::zeros(), Vec3::x());
                again.enter(&mut library, super::MaterialId(0));
                (again.velocity, again.angular_velocity) = (wall.velocity, wall.angular_velocity);
                let now = (300, Some(super::StageSoFar { dt: 1e-3, time: 0.3 }));
                again.go_on(&wall.surface(), saved.as_ref(), true, now, &mut library, &ROOM);
                wall = again;
            }
        }
        let rate = wall.angular_velocity.norm();
        let turned = rotation_about(&(wall.angular_velocity / rate), rate * (490.0 * 1e-3));
        assert_eq!(wall.orientation, turned);
        let place = wall.velocity * (490.0 * 1e-3);
        assert_eq!(wall.point, place);
        wall.angular_velocity = Vec3::z();
        wall.advance(501, 1e-3, &ROOM);
        assert_eq!(wall.orientation, rotation_about(&Vec3::z(), 1e-3) * turned);
        assert_eq!(wall.point, wall.velocity * (491.0 * 1e-3));
        // A drive changes the velocity in each step; the rotation continues.
        for step in 502..=1000 {
            wall.velocity.x += 1e-3;
            wall.advance(step, 1e-3, &ROOM);
        }
        assert_eq!(wall.orientation, rotation_about(&Vec3::z(), 500.0 * 1e-3) * turned);
        // After a pause the motion continues from the present pose.
        let stood = wall.point;
        wall.advance(2000, 1e-3, &ROOM);
        assert_eq!(wall.point, stood + wall.velocity * 1e-3);
    }

    /// After ten million steps the wall is where its velocity leads, within rounding. A sum of steps has a million times the error.
    #[test]
    fn a_wall_does_not_drift() {
        let mut wall = Wall::plane("wall".to_owned(), Vec3::x() * 0.1, Vec3::x());
        wall.velocity = Vec3::x() * 1e-3;
        (1..=10_000_000).for_each(|step| {
            wall.advance(step, 1e-7, &ROOM);
        });
        assert!((wall.point.x - 0.101).abs() < 1e-16, "{}", wall.point.x - 0.101);
    }

    /// Half a box behind a plane, and a box before it.
    #[test]
    fn depths_of_boxes() {
        let normal = Vec3::new(0.6, 0.0, 0.8);
        let wall = Wall::plane("wall".to_owned(), Vec3::zeros(), normal);
        let half = 0.5 * (0.6 + 0.8);
        let cube = |centre: Vec3| (centre - Vec3::repeat(0.5), centre + Vec3::repeat(0.5));
        assert!((wall.depth(&cube(Vec3::zeros())) - half).abs() < 1e-15);
        assert!((wall.depth(&cube(normal * 2.0)) + 2.0 - half).abs() < 1e-15);
    }
}
