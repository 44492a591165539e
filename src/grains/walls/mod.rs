//! Walls: rigid bodies with facets, of which every rank has all.
//!
//! Here, and in the resolvers of facets, stands all that knows what a facet is: a plane, or a face, an edge or a corner of a mesh of
//! triangles. All planes have slots; of a mesh only the facets near a rank's particles have. Other rooms ask how far a point
//! is from a plane ([`facets`]), which facets of a mesh are near it ([`Wall::facets_near`]), how far a wall has come towards grains ([`Wall::nearer_since_listed`]), how fast it does
//! ([`Wall::way`]), how deep a box lies behind it ([`Wall::depth`]), where it ends the room of the particles ([`Across`]).
//!
//! A wall has a pose, which is that of its reference point and axes, and a motion. The pose comes from the number of steps since
//! the wall began to move as it does, in closed form: a million steps have the rounding of one, and a run that goes on from a
//! snapshot has the same bits.
//!
//! What moves a wall: its scene, with constant velocities or a course ([`courses`]), or a drive, which sets its velocities in each step
//! (`drive::servo`, `drive::free`).

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

/// The lowest and the highest corner of a box [m].
pub type Corners = (Vec3, Vec3);

/// Components of normals along a wall's direction that are less than this are rounding.
const SQUARE_ON: f64 = 1e-9;
/// Turns by less than this are rounding [rad].
const LEAST_TURN: f64 = 1e-9;

/// A rigid body that particles do not pass.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Wall {
    /// Its name in the scene.
    pub name: String,
    /// Reference point, where its axes begin [m].
    pub point: Vec3,
    /// Rotation from its axes to the world.
    pub orientation: Quat,
    /// Where its scene has the reference point [m].
    of_scene: Vec3,
    /// Velocity of the reference point [m/s].
    pub velocity: Vec3,
    /// Angular velocity, about the reference point [rad/s].
    pub angular_velocity: Vec3,
    /// Velocity of its surface against itself, as of a conveyor belt, in its axes: what of it lies in the plane of a contact [m/s].
    pub surface_velocity: Vec3,
    /// Mass, infinite unless contacts are to feel that it is not [kg].
    pub mass: f64,
    /// The direction along which it moves as one of this mass, a unit vector; across that it is held.
    pub free_along: Vec3,
    /// Does the scene move it, at given velocities, by a course or by a servo?
    pub moves: bool,
    /// About what the torque on it is written, if that is to be.
    pub torque: Option<TorqueAbout>,
    /// Is what grains do to it to be summed, by triangles if it has any?
    pub wears: bool,
    /// Its surface, in its axes, if that is of planes.
    pub facets: Vec<Facet>,
    /// Its surface, in its axes, if that is of triangles.
    pub mesh: Option<Mesh>,
    /// How it moves, if not with constant velocities or by a drive. Times count from the beginning of the stage.
    pub course: Option<Course>,
    /// Since when it has the velocities that it has; `None` before its first step, or if it does not move.
    steady: Option<Steady>,
    /// Since when it follows its course; `None` before its first step, or if it has none.
    following: Option<Following>,
    /// Where it stood when the pairs were listed.
    listed: Pose,
}

/// About what the torque on a wall is taken.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum TorqueAbout {
    /// Its reference point, which moves with it.
    Reference,
    /// A point that stays where it is [m].
    Fixed(Vec3),
}

/// The surface of a wall of triangles.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mesh {
    /// Its geometry, in the axes of the wall. Messages between ranks have it once, in the library of shapes.
    #[serde(skip)]
    pub surface: Arc<TriangleMesh>,
    /// The same in the library of shapes, once it is there.
    pub shape: ShapeId,
    /// Where the axes of its file, or of its cylinder, begin [m].
    origin: Vec3,
}

impl Mesh {
    /// Lets its own origin be at a place in the axes of the wall [m].
    fn set_origin(&mut self, origin: Vec3) {
        let place = self.origin - origin;
        if place != Vec3::zeros() {
            Arc::make_mut(&mut self.surface).see_from(&place);
        }
        self.origin = origin;
    }
}

/// A piece of the surface of a wall.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Facet {
    /// Its geometry, in the axes of the wall.
    pub geometry: HalfSpace,
    /// The same in the library of shapes, once it is there.
    pub shape: ShapeId,
}

/// Where a wall stands.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Pose {
    point: Vec3,
    orientation: Quat,
}

/// A motion with constant velocities. A drive that changes that of the reference point begins the way anew, not the turn.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Steady {
    /// The steps at which way and turn began.
    since: [u64; 2],
    /// Where the reference point was, and the orientation, then.
    from: Pose,
    /// Of the reference point [m/s].
    velocity: Vec3,
    /// About it [rad/s].
    angular_velocity: Vec3,
}

/// A course that is followed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Following {
    /// The step at which it began.
    since: u64,
    /// The time of the course then [s].
    time: f64,
    /// Where the wall stood then.
    from: Pose,
}

impl Following {
    /// The time of the course after a step of those of `dt` [s].
    fn time_at(&self, step: u64, dt: f64) -> f64 {
        self.time + (step - self.since) as f64 * dt
    }

    /// Where a course has the wall at a time [s].
    fn pose_at(&self, course: &Course, time: f64) -> Pose {
        Pose {
            point: self.from.point + (course.shift(time) - course.shift(self.time)),
            orientation: course.rotation(self.time, time) * self.from.orientation,
        }
    }
}

impl Steady {
    /// Where it has the wall at a step of `dt` [s].
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

/// Cosine of the angle by which walls that lie in each other differ at most, of 0.001.
pub const PARALLEL: f64 = 1.0 - 5e-7;

/// A plane in place: points `p` with `(p - point) · normal = offset`.
#[derive(Clone, Copy, Debug)]
pub struct InPlace {
    point: Vec3,
    normal: Vec3,
    offset: f64,
}

impl InPlace {
    /// How far a point is in front of it [m].
    #[inline]
    pub fn distance(&self, point: &Vec3) -> f64 {
        (point - self.point).dot(&self.normal) - self.offset
    }

    /// Is it another, nearer than a distance [m]?
    fn is_same(&self, other: &Self, tolerance: f64) -> bool {
        let on_other = other.point + other.normal * other.offset;
        self.normal.dot(&other.normal) > PARALLEL && self.distance(&on_other).abs() <= tolerance
    }

    /// How much nearer it is to a point than the same facet was `before`, or farther, where that is most within `room` [m].
    fn moved(&self, before: &Self, room: &Corners) -> f64 {
        if self.normal == before.normal {
            let along = (self.point - before.point).dot(&self.normal);
            return (along + (self.offset - before.offset)).abs();
        }
        // The change of the distance is linear in the place of the point: the most is at a corner.
        let moved = |corner: Vec3| (before.distance(&corner) - self.distance(&corner)).abs();
        corners(room).into_iter().map(moved).fold(0.0, larger_or_infinite)
    }
}

impl Pose {
    /// Columns are the wall's axes in the world; what lies along the axis of the turn stays as it is, to the last bit.
    fn frame(&self) -> Mat3 {
        let turned = |axis: Vec3| self.orientation.transform_vector(&axis);
        Mat3::from_columns(&[turned(Vec3::x()), turned(Vec3::y()), turned(Vec3::z())])
    }

    fn place(&self, facet: &Facet) -> InPlace {
        let HalfSpace { normal, offset } = facet.geometry;
        InPlace { point: self.point, normal: self.frame() * normal, offset }
    }
}

/// A wall that stands across an axis, as one of a box does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Across {
    /// The axis.
    pub axis: usize,
    /// Component of its normal, 1 or -1.
    pub inwards: f64,
    /// Where it stands [m].
    pub place: f64,
}

impl Wall {
    /// A wall at rest that is to have planes, each through a point [m] and with a unit normal towards the particles; its
    /// reference point, too, in m.
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

    /// The same of one plane, with the reference point in it.
    pub fn plane(name: String, point: Vec3, normal: Vec3) -> Self {
        Self::of_planes(name, point, &[(point, normal)])
    }

    /// A wall at rest of triangles, whose corners are seen from the reference point [m].
    pub fn of_mesh(name: String, reference: Vec3, surface: TriangleMesh) -> Self {
        let surface = Arc::new(surface);
        let mesh = Some(Mesh { surface, shape: ShapeId(0), origin: Vec3::zeros() });
        Self { mesh, ..Self::of_planes(name, reference, &[]) }
    }

    /// Gives a surface of triangles the cells behind them, for grains with faces that reach so far at most [m].
    ///
    /// # Errors
    /// If the surface has no two sides.
    pub fn add_cells(&mut self, farthest: f64) -> Result<(), NoSolid> {
        if let Some(Mesh { surface, .. }) = &mut self.mesh {
            Arc::make_mut(surface).add_cells(farthest)?;
        }
        Ok(())
    }

    /// Lets the cells behind its triangles, if it has some, do for grains with faces that reach so far [m].
    ///
    /// # Panics
    /// If it has some and no two sides, which cannot be.
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

    /// How many shapes its facets need in a library.
    pub fn shapes(&self) -> usize {
        self.facets.len() + usize::from(self.mesh.is_some())
    }

    /// What messages call one of its facets; nothing if it is the only one.
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

    /// Adds its facets to a library of shapes, which say what it is made of and its mass along their normals.
    pub fn enter(&mut self, library: &mut Library, material: MaterialId) {
        let along = self.frame().tr_mul(&self.free_along);
        let mass = self.mass;
        // Held across its direction, it is as heavy against a normal as more of it lies across.
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

    /// Takes its surface of triangles, of which a message has none, from the library.
    pub fn take_surface(&mut self, library: &Library) {
        if let Some(mesh) = &mut self.mesh
            && let Shape::TriangleMesh(surface) = &library.shapes[mesh.shape.index()]
        {
            mesh.surface = Arc::clone(surface);
        }
    }

    /// The lowest and highest corner of its triangles where it stands [m], if it has some.
    pub fn extent(&self) -> Option<Corners> {
        let corners = self.corners().map(|corner| (corner, corner));
        corners.reduce(|(low, high), (l, h)| (low.inf(&l), high.sup(&h)))
    }

    /// The corners of its triangles where it stands, if it has some [m].
    fn corners(&self) -> impl Iterator<Item = Vec3> {
        let of_mesh = self.mesh.iter().flat_map(|mesh| mesh.surface.triangles().flatten());
        of_mesh.map(|corner| self.point + self.orientation.transform_vector(&corner))
    }

    /// Are all of its triangles outside the domain by more than its extent?
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

    /// Columns are its axes in the world.
    pub fn frame(&self) -> Mat3 {
        self.pose().frame()
    }

    fn in_place(&self) -> impl Iterator<Item = InPlace> {
        let pose = self.pose();
        self.facets.iter().map(move |facet| pose.place(facet))
    }

    /// Has it a plane against which this direction leads, or a surface of triangles?
    pub fn holds_against(&self, direction: &Vec3) -> bool {
        self.mesh.is_some() || self.in_place().any(|plane| plane.normal.dot(direction) < 0.0)
    }

    /// Does a part of it lie in another wall, nearer to it than a distance [m]? The other may be itself: then in another face. Cylinders and cones
    /// do not.
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

    /// A point of its first facet, and the unit normal there towards the particles: what files say of it.
    pub fn surface(&self) -> (Vec3, Vec3) {
        let first = self.in_place().next();
        first.map_or((self.point, Vec3::zeros()), |InPlace { point, normal, offset }| {
            (point + normal * offset, normal)
        })
    }

    /// The torque on it about the point that it says [N m], from that about its reference point and the force on it [N].
    pub fn torque_of(&self, about_reference: &Vec3, force: &Vec3) -> Vec3 {
        match self.torque {
            Some(TorqueAbout::Fixed(point)) => about_reference + (self.point - point).cross(force),
            _ => *about_reference,
        }
    }

    /// What it does on the particles with a force on it [N] and a torque about its reference point [N m], in W.
    pub fn power(&self, force: &Vec3, torque: &Vec3) -> f64 {
        -(force.dot(&self.velocity) + torque.dot(&self.angular_velocity))
    }

    /// Is it a conveyor belt?
    pub fn is_belt(&self) -> bool {
        self.surface_velocity != Vec3::zeros()
    }

    /// Can it work on the particles, as it moves or is a belt?
    pub fn may_work(&self) -> bool {
        self.moves || self.is_belt()
    }

    /// Does it move now, or follow a course?
    pub fn is_moving(&self) -> bool {
        self.course.is_some()
            || self.velocity != Vec3::zeros()
            || self.angular_velocity != Vec3::zeros()
    }

    /// Does its scene turn it, now or at any time?
    pub fn may_turn(&self) -> bool {
        self.angular_velocity != Vec3::zeros() || self.turn_of_course().is_some()
    }

    /// The axis about which its course turns it.
    fn turn_of_course(&self) -> Option<Vec3> {
        let (axis, _) = self.course.as_ref()?.turn.as_ref()?;
        Some(*axis)
    }

    /// Gives it a course, in place of constant velocities.
    pub fn follow(&mut self, course: Course) {
        (self.velocity, self.angular_velocity) = course.first_velocities();
        self.course = Some(course);
    }

    /// Does it turn, or has it since the pairs were listed?
    pub fn turns(&self) -> bool {
        self.may_turn() || self.orientation != self.listed.orientation
    }

    /// How it stands across an axis and always will; `None` if it is tilted, turns out of its plane or has several facets.
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

    /// Does it stand otherwise than the scene says?
    pub fn is_turned(&self) -> bool {
        self.orientation != Quat::identity()
    }

    /// Takes note of where it stands when the pairs are listed.
    pub(crate) const fn note_listing(&mut self) {
        self.listed = self.pose();
    }

    /// Moves it to where it stands after `step` steps, of which the last took `dt` [s]. Returns how much nearer any of its
    /// points can have come to a grain [m]; all grains have their centres within `room`.
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
        // What does not lead here, as after a pause or with another step, is over.
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

    /// Goes on with another step after so many, of which the last took `before` [s].
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

    /// How much nearer its surface can have come to a grain since the pairs were listed [m]; all grains have their centres
    /// within `room`. What slides along itself comes no nearer.
    pub fn nearer_since_listed(&self, room: &Corners) -> f64 {
        self.moved_since(&self.listed, room)
    }

    /// The numbers of the facets of a mesh within a distance of a point [m].
    pub fn facets_near(&self, point: &Vec3, distance: f64) -> Vec<u32> {
        let Some(Mesh { surface, .. }) = &self.mesh else { return Vec::new() };
        surface.near(&self.frame().tr_mul(&(point - self.point)), distance)
    }

    fn moved_since(&self, before: &Pose, room: &Corners) -> f64 {
        if let Some(Mesh { surface, .. }) = &self.mesh {
            let turn = (self.orientation * before.orientation.inverse()).scaled_axis();
            // The axis of a turn that is rounding is not known.
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

    /// How far its surface goes along its normal in a step of `dt` [s] with its velocities, where that is most within `room`
    /// [m]. Along itself it may slide as fast as it likes.
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

    /// Speed of its reference point towards the particles; of several facets, the largest; of triangles, in any direction [m/s].
    pub fn speed_inwards(&self) -> f64 {
        if self.mesh.is_some() {
            return self.velocity.norm();
        }
        let speeds = self.in_place().map(|facet| self.velocity.dot(&facet.normal));
        speeds.reduce(|a, b| if b.abs() > a.abs() { b } else { a }).unwrap_or(0.0)
    }

    /// Its velocity if it goes towards the particles at a speed and along itself as it does [m/s]; of a wall of one plane.
    pub fn velocity_inwards(&self, speed: f64) -> Vec3 {
        let (_, normal) = self.surface();
        let along = self.velocity - normal * normal.dot(&self.velocity);
        normal * speed + along
    }

    /// What a force on a wall of one plane [N] presses with, in N.
    pub fn press(&self, force: &Vec3) -> f64 {
        let (_, normal) = self.surface();
        -force.dot(&normal)
    }

    /// Is a part of a ball at, or behind, its surface? [m]
    pub fn meets_ball(&self, centre: &Vec3, radius: f64) -> bool {
        if let Some(Mesh { surface, .. }) = &self.mesh {
            return surface.meets_ball(&self.frame().tr_mul(&(centre - self.point)), radius);
        }
        self.in_place().any(|facet| facet.distance(centre) < radius)
    }

    /// How deep a box lies behind a facet, where it does most [m]; not positive if it does not.
    pub fn depth(&self, &(low, high): &Corners) -> f64 {
        let half = (high - low) * 0.5;
        if let Some(Mesh { surface, .. }) = &self.mesh {
            // The box about the box, in the axes of the wall: the triangles behind which it lies.
            let frame = self.frame();
            let centre = frame.tr_mul(&(low + half - self.point));
            let reach = frame.transpose().abs() * half;
            let comes_in = surface.comes_into(&(centre - reach), &(centre + reach));
            return if comes_in { half.min() } else { f64::NEG_INFINITY };
        }
        let behind = |facet: InPlace| half.dot(&facet.normal.abs()) - facet.distance(&(low + half));
        self.in_place().map(behind).fold(f64::NEG_INFINITY, larger_or_infinite)
    }

    /// How much of a box is before its planes, before all of which particles are: how far the farthest corner is before the plane
    /// that leaves least [m]; `None` of triangles.
    pub fn room_before(&self, &(low, high): &Corners) -> Option<f64> {
        let half = (high - low) * 0.5;
        let before = |facet: InPlace| half.dot(&facet.normal.abs()) + facet.distance(&(low + half));
        self.in_place().map(before).reduce(f64::min)
    }

    /// Does one of its planes come towards the particles where it goes in this direction, a unit vector? Triangles do in any.
    pub fn leads(&self, along: &Vec3) -> bool {
        self.mesh.is_some() || self.in_place().any(|facet| facet.normal.dot(along) > SQUARE_ON)
    }

    /// Takes another reference point [m], that of its scene, and stays where it is.
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

/// The first wall, or image of a wall of triangles, that a ball is at or behind [m].
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

/// How far any facet has moved along its normal: now and before of each, where that is most within `room` [m].
fn most_moved(facets: impl Iterator<Item = (InPlace, InPlace)>, room: &Corners) -> f64 {
    facets.map(|(now, before)| now.moved(&before, room)).fold(0.0, larger_or_infinite)
}

/// The planes of all walls in place, in the order of their slots.
pub fn facets(walls: &[Wall]) -> Vec<InPlace> {
    walls.iter().flat_map(Wall::in_place).collect()
}

/// The ids of the planes of all walls, in the order of their slots, which come before those of the facets of meshes.
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

/// Where the room of the particles ends along an axis: at the innermost walls that stand across it [m];
/// `None` on a side without one.
pub fn ends(walls: &[Wall], axis: usize) -> [Option<f64>; 2] {
    let places = |inwards: f64| {
        let stands = walls.iter().filter_map(Wall::across);
        let facing = stands.filter(move |wall| wall.axis == axis && wall.inwards == inwards);
        facing.map(|wall| wall.place)
    };
    [places(1.0).reduce(f64::max), places(-1.0).reduce(f64::min)]
}

/// Area on which the particles press against a wall across an axis: periods, or distances of walls, along
/// both other axes [m²]; `None` if a side is open.
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

/// The box in which particles may be: the cell, and as far as walls have moved out of it [m].
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

/// Do any two planes of walls face the same way?
pub(super) fn any_parallel(walls: &[Wall]) -> bool {
    let normals: Vec<Vec3> = walls.iter().flat_map(Wall::in_place).map(|p| p.normal).collect();
    (1..normals.len()).any(|k| normals[..k].iter().any(|other| normals[k].dot(other) > PARALLEL))
}

/// Columns of the slots of facets, besides those that all bodies have. Length: facets.
#[expect(clippy::struct_excessive_bools, reason = "each is asked for by itself")]
#[derive(Clone, Debug, Default)]
pub struct FacetColumns {
    /// Index of the wall.
    pub wall: Vec<u32>,
    /// Where each stands.
    pub place: Vec<FacetInPlace>,
    /// Velocities of their surfaces against the walls, see [`Wall::surface_velocity`], world axes [m/s]; empty if no wall is a belt.
    pub belts: Vec<Vec3>,
    /// Did any wall move when they were placed?
    pub any_moves: bool,
    /// Does any wall turn?
    pub any_turns: bool,
    /// Do any two planes face the same way, so that they may lie in each other?
    pub any_parallel: bool,
    /// Must torques on walls be known: does any wall turn, or say about what?
    pub any_torque: bool,
}

#[cfg(test)]
mod tests {
    use super::{Across, Corners, Wall};
    use crate::math::{Quat, Vec3, rotation_about};
    use crate::random::Random;

    const ROOM: Corners = (Vec3::new(-1.0, -2.0, -0.5), Vec3::new(0.5, 1.0, 1.0));

    /// A wall of two planes somewhere, which moves and turns.
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

    /// Against planes that are moved as the rotation of their wall says.
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

    /// No grain in the room comes nearer than reported, and some come as near.
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

    /// A way and a turn come from the number of their steps, whatever was saved and taken up on the way; others begin where
    /// they end.
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
        // A drive changes the velocity in each step; the turn goes on.
        for step in 502..=1000 {
            wall.velocity.x += 1e-3;
            wall.advance(step, 1e-3, &ROOM);
        }
        assert_eq!(wall.orientation, rotation_about(&Vec3::z(), 500.0 * 1e-3) * turned);
        // After a pause in which nobody looked it goes on from where it stands.
        let stood = wall.point;
        wall.advance(2000, 1e-3, &ROOM);
        assert_eq!(wall.point, stood + wall.velocity * 1e-3);
    }

    /// After ten million steps a wall is where its velocity says, to rounding. Steps added up are a million times as far off.
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
