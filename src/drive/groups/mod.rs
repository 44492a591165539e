//! Groups: particles that are held on a course, or pushed.
//!
//! A particle belongs to the first group of the scene that names it. This is decided where a stage begins, or where the
//! particle appears. The particle then keeps the number of the group ([`Particle::group`]).
//!
//! # Held particles
//!
//! They stand still, or move as one rigid body by a [`Course`]. Positions come from those of the step before and from
//! differences of the course, so a particle that stands still keeps its bits. Like walls they have velocities that are
//! means over a step, have no gravity, damping or energy. Their work on other particles is received, half of it in each
//! half of a step: minus force times velocity, and torque times angular velocity.
//!
//! Contact laws use an infinite mass: a held particle has a separate shape in the library
//! ([`crate::population::Library::add_held`]). Pairs of two held particles, or of one and a wall, are never listed.
//!
//! # Pushed particles
//!
//! A force, a torque and the drag of a fluid ([`push`]) are added to those of the contacts, and then act in both halves of
//! the step. The work of force and torque is received. Drag `D` on a particle of velocity `v` in a fluid of velocity `u`
//! dissipates `-D · (v - u)`, which counts as damping; the rest, `D · u`, is received.

mod idle;
pub mod push;

pub use push::{Drag, DragLaw, Load, Push};

use super::region::Region;
use super::{Acting, Drive, DriveError, Observer, Reporter, Restart, SavedColumn, Steering, View};
use crate::cell::Cell;
use crate::comm::Comm;
use crate::contact::StateColumn;
use crate::ids::ShapeId;
use crate::math::{Quat, Vec3};
use crate::motion::{self, Farthest};
use crate::particles::Particles;
use crate::particles::columns::Quantity;
use crate::particles::records::Particle;
use crate::population::Library;
use crate::shape::Kind;
use crate::walls::Wall;
use crate::walls::courses::Course;
use idle::Idle;
use serde::{Deserialize, Serialize};

/// Name of the drive, and of its state in snapshots.
pub const NAME: &str = "groups";
/// Names of the groups in a snapshot.
pub const NAMES: StateColumn = StateColumn::new("name", 1, "1");
/// 1 for held groups, 0 for others.
pub const HELD: StateColumn = StateColumn::new("held", 1, "1");

/// Particles with a common prescribed motion or push.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Group {
    /// Its name in the scene.
    pub name: String,
    /// The particles.
    pub who: Selection,
    /// Their motion.
    pub what: GroupMotion,
}

/// Conditions that select the particles of a group; all must hold.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Selection {
    /// Shapes; any if empty.
    pub shapes: Vec<ShapeId>,
    /// Region of the centres when the stage begins.
    pub region: Option<Region>,
    /// First and last ids; any if empty.
    pub ids: Vec<[u64; 2]>,
    /// Does it select the particles of its inlets, and no others? An [`Inlet`](super::inlet::Inlet) knows its group.
    pub by_inlet: bool,
}

/// The motion of the particles of a group.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum GroupMotion {
    /// Held on a course, regardless of forces.
    Held(Path),
    /// Free, with a push.
    Pushed(Push),
}

impl GroupMotion {
    /// Description for the plan.
    pub fn words(&self) -> String {
        match self {
            Self::Held(path) if path.is_still() => "fixed".to_owned(),
            Self::Held(path) => format!("moved {}", path.course.summary()),
            Self::Pushed(push) => push.words(),
        }
    }
}

/// Motion of a rigid body as a function of the time since the stage began.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Path {
    /// Shifts of the reference point, and the turn about it.
    pub course: Course,
    /// Reference point when the stage begins [m].
    pub about: Vec3,
}

impl Path {
    /// Does it never move?
    pub const fn is_still(&self) -> bool {
        self.course.shifts.is_empty() && self.course.turn.is_none()
    }

    /// Reference point at a time of the stage [s], in m.
    fn about(&self, time: f64) -> Vec3 {
        self.about + self.course.shift(time)
    }
}

impl Group {
    /// Is the group held?
    pub const fn is_held(&self) -> bool {
        matches!(self.what, GroupMotion::Held(_))
    }

    /// Does the group turn?
    pub const fn turns(&self) -> bool {
        matches!(&self.what, GroupMotion::Held(path) if path.course.turn.is_some())
    }

    /// Push of the group; `None` if it is held.
    pub const fn push(&self) -> Option<&Push> {
        if let GroupMotion::Pushed(push) = &self.what { Some(push) } else { None }
    }

    /// Can it have particles of a shape when a stage begins?
    pub fn may_have(&self, shape: ShapeId) -> bool {
        !self.who.by_inlet && (self.who.shapes.is_empty() || self.who.shapes.contains(&shape))
    }

    /// Does it take new particles within the stage by their shapes?
    pub const fn takes_newcomers(&self) -> bool {
        !self.who.by_inlet && self.who.region.is_none() && self.who.ids.is_empty()
    }

    /// Does it select a particle that exists when the stage begins?
    fn names(&self, particle: &Particle, cell: &Cell) -> bool {
        let Selection { region, ids, .. } = &self.who;
        let id = particle.id.0;
        self.may_have(particle.shape)
            && region.as_ref().is_none_or(|region| region.holds(&particle.position, cell))
            && (ids.is_empty() || ids.iter().any(|&[first, last]| (first..=last).contains(&id)))
    }
}

/// Flags of a shape: some of its particles may be held, and all of them are.
pub fn held_of(groups: &[Group], shape: ShapeId) -> [bool; 2] {
    let mut naming = groups.iter().filter(|group| group.may_have(shape)).peekable();
    let mut may_be = false;
    while let Some(group) = naming.next_if(|group| group.is_held()) {
        may_be = true;
        if group.takes_newcomers() {
            return [true, true];
        }
    }
    [may_be || naming.any(Group::is_held), false]
}

/// Replaces a particle's shape of the scene by the one that it has in its group.
pub fn take_shape(groups: &[Group], particle: &mut Particle, library: &Library) {
    let group = groups.get(usize::from(particle.group).wrapping_sub(1));
    if group.is_some_and(Group::is_held) {
        particle.shape = library.held(particle.shape);
    }
}

/// Puts a particle into the first group that selects it where a stage begins. A held one gets the velocities of its course.
pub fn join(groups: &[Group], particle: &mut Particle, library: &Library, cell: &Cell) {
    let found = groups.iter().position(|group| group.names(particle, cell));
    particle.group = found.map_or(0, |k| k as u16 + 1);
    take_shape(groups, particle, library);
    if let Some(GroupMotion::Held(path)) = found.map(|k| &groups[k].what) {
        let (velocity, turning) = path.course.first_velocities();
        particle.velocity = velocity + turning.cross(&(particle.position - path.about));
        *particle = particle.clone().spinning(turning, library);
    }
}

/// The groups of a running simulation.
#[derive(Clone, Debug)]
pub struct Groups {
    all: Vec<Group>,
    /// Held particles of this rank during the kick of the others.
    idle: Vec<Idle>,
    /// Has it been checked that each group has particles?
    counted: bool,
}

impl Groups {
    /// Groups of a stage that begins.
    pub const fn new(groups: Vec<Group>) -> Self {
        Self { all: groups, idle: Vec::new(), counted: false }
    }

    /// Slots of this rank's particles that belong to groups, with their motion.
    fn members<'a>(
        &'a self,
        particles: &Particles,
    ) -> impl Iterator<Item = (usize, &'a GroupMotion)> + use<'a> {
        let groups: Vec<(usize, usize)> = (0..particles.owned)
            .filter_map(|slot| Some((slot, particles.group_of(slot)?)))
            .collect();
        groups.into_iter().map(|(slot, group)| (slot, &self.all[group].what))
    }

    /// Motion of the reference point and the axes of each group in a step of `dt` [s] from a time of the stage [s].
    fn strides(&self, time: f64, dt: f64) -> Vec<Option<Stride>> {
        let of = |group: &Group| match &group.what {
            GroupMotion::Held(path) if !path.is_still() => Some(Stride::of(path, time, dt)),
            _ => None,
        };
        self.all.iter().map(of).collect()
    }
}

/// Motion of a rigid body in a step.
struct Stride {
    dt: f64,
    /// Reference point before the step [m].
    about: Vec3,
    /// Shift [m].
    shift: Vec3,
    /// Rotation about the reference point; `None` if it does not turn.
    turn: Option<Quat>,
    /// Mean velocity of the reference point [m/s], and mean angular velocity [rad/s].
    velocities: (Vec3, Vec3),
}

impl Stride {
    fn of(path: &Path, time: f64, dt: f64) -> Self {
        let Path { course, .. } = path;
        Self {
            dt,
            about: path.about(time),
            shift: course.shift(time + dt) - course.shift(time),
            turn: course.turn.is_some().then(|| course.rotation(time, time + dt)),
            velocities: course.mean_velocities(time + dt, dt),
        }
    }

    /// Moves a particle and sets its velocities to their means over the step.
    fn carry(&self, particles: &mut Particles, slot: usize, farthest: &mut Farthest) {
        let (mut velocity, turning) = self.velocities;
        let from = particles.position[slot];
        let mut way = self.shift;
        if let Some(spin) = &mut particles.spin {
            spin.angular_velocity[slot] = turning;
        }
        if let Some(turn) = &self.turn {
            let arm = from - self.about;
            let swing = turn * arm - arm;
            way += swing;
            velocity += swing / self.dt;
            self.turn(particles, slot, turn, farthest);
        }
        let to = from + way;
        particles.position[slot] = to;
        particles.velocity[slot] = velocity;
        let moved = (to - from).norm();
        particles.travel[slot] += moved;
        if moved > farthest.moved.0 {
            farthest.moved = (moved, slot);
        }
    }

    fn turn(&self, particles: &mut Particles, slot: usize, turn: &Quat, farthest: &mut Farthest) {
        let (_, turning) = self.velocities;
        let (scale, inertia) = (particles.scale_of(slot), particles.inertia(slot));
        let Particles { spin, orientation, library, shape, travel, .. } = particles;
        let (Some(spin), Some(orientation)) = (spin, orientation) else { return };
        let turned = (turn * orientation.quaternion[slot]).into_inner();
        let quaternion = Quat::new_normalize(turned);
        let kind = &library.shapes[shape[slot].index()];
        orientation.set(slot, quaternion, kind, scale);
        let local = quaternion.inverse_transform_vector(&turning);
        spin.angular_momentum[slot] = quaternion * inertia.component_mul(&local);
        if kind.kind() != Kind::Sphere {
            let angle = turning.norm() * self.dt;
            travel[slot] += library.radius[shape[slot].index()] * scale * angle;
            if angle > farthest.turned.0 {
                farthest.turned = (angle, slot);
            }
        }
    }
}

/// Counts the work of a held particle on its partners in a time [s] as received.
fn count_work_of_held(particles: &mut Particles, slot: usize, time: f64) {
    let mut power = particles.force[slot].vector.dot(&particles.velocity[slot]);
    if let Some(spin) = &particles.spin {
        power += spin.torque[slot].vector.dot(&spin.angular_velocity[slot]);
    }
    particles.accumulated[Quantity::Received][slot] -= time * power;
}

impl Drive for Groups {
    fn sums(&self, view: &View) -> Vec<i64> {
        if self.counted {
            return Vec::new();
        }
        let mut counts = vec![0; self.all.len()];
        let particles = view.particles;
        for group in (0..particles.owned).filter_map(|slot| particles.group_of(slot)) {
            counts[group] += 1;
        }
        counts
    }

    fn steer(&mut self, steering: Steering) -> Result<(), DriveError> {
        self.counted = true;
        for (Group { name, who, .. }, count) in self.all.iter().zip(steering.sums) {
            if *count == 0 && !who.by_inlet {
                return Err(DriveError(format!(
                    "group `{name}` has no particle at the start of the stage: none matches its `shapes`, `region` \
                     and `ids`, or all that match are in earlier groups"
                )));
            }
        }
        Ok(())
    }

    fn lead(&mut self, Acting { moment, field, particles }: Acting) {
        let half = 0.5 * moment.dt;
        let mut idle = Vec::new();
        for (slot, what) in self.members(particles) {
            match what {
                GroupMotion::Held(_) => idle.push(Idle::begin(particles, slot, field)),
                GroupMotion::Pushed(push) if !push.is_nothing() => {
                    let acts =
                        push.on(particles, slot, &particles.velocity[slot], moment.stage_time);
                    let (velocity, turning) = push::after_first_kick(particles, slot, field, half);
                    acts.count_work(particles, slot, (velocity, turning), half);
                }
                GroupMotion::Pushed(_) => {}
            }
        }
        self.idle = idle;
    }

    fn place(&mut self, Acting { moment, particles, .. }: Acting, farthest: &mut Farthest) {
        let strides = self.strides(moment.stage_time, moment.dt);
        for idle in std::mem::take(&mut self.idle) {
            let slot = idle.end(particles);
            let group = particles.group_of(slot).unwrap_or_default();
            if let Some(stride) = &strides[group] {
                stride.carry(particles, slot, farthest);
                count_work_of_held(particles, slot, 0.5 * moment.dt);
            } else {
                idle::stop(particles, slot);
            }
        }
        if strides.iter().any(Option::is_some) {
            motion::wrap(particles);
        }
    }

    fn push(&mut self, Acting { moment, field, particles }: Acting) {
        let half = 0.5 * moment.dt;
        for (group, place) in self.all.iter().zip(&mut particles.groups) {
            if let GroupMotion::Held(path) = &group.what {
                place.about = group.turns().then(|| path.about(moment.stage_time));
            }
        }
        let mut idle = Vec::new();
        for (slot, what) in self.members(particles) {
            match what {
                // At the start of a stage there is no kick.
                GroupMotion::Held(_) if moment.dt > 0.0 => {
                    count_work_of_held(particles, slot, half);
                    idle.push(Idle::begin(particles, slot, field));
                }
                GroupMotion::Pushed(push) if !push.is_nothing() => {
                    let before = particles.velocity[slot];
                    let after =
                        push.velocity_after(particles, slot, field, (moment.stage_time, half));
                    let acts = push.on(particles, slot, &after, moment.stage_time);
                    if moment.dt > 0.0 {
                        let turning = (particles.spin.as_ref())
                            .map_or_else(Vec3::zeros, |spin| spin.angular_velocity[slot]);
                        acts.count_work(particles, slot, (before, turning), half);
                    }
                    acts.add_to(particles, slot);
                }
                _ => {}
            }
        }
        self.idle = idle;
    }

    fn settle(&mut self, Acting { particles, .. }: Acting) {
        for idle in std::mem::take(&mut self.idle) {
            idle.end(particles);
        }
    }

    fn admit(&self, newcomer: &mut Particle) {
        if newcomer.group == 0 {
            let takes = |group: &Group| group.takes_newcomers() && group.may_have(newcomer.shape);
            newcomer.group = self.all.iter().position(takes).map_or(0, |k| k as u16 + 1);
        }
    }
}

impl Observer for Groups {}

impl Reporter for Groups {
    fn name(&self) -> &'static str {
        NAME
    }

    fn save(&self, _walls: &[Wall], _comm: &mut dyn Comm) -> Vec<SavedColumn> {
        vec![
            SavedColumn::texts(NAMES, self.all.iter().map(|group| group.name.clone())),
            SavedColumn::counts(HELD, self.all.iter().map(|group| u64::from(group.is_held()))),
        ]
    }

    fn resume(&mut self, restart: &Restart, _walls: &mut [Wall]) -> Result<(), DriveError> {
        if restart.is_new_stage {
            return Ok(());
        }
        self.counted = true;
        let names = restart.saved.texts(&NAMES)?;
        if names.iter().ne(self.all.iter().map(|group| &group.name)) {
            return Err(other_groups(&names.join(", ")));
        }
        Ok(())
    }

    fn joins(&mut self) -> Result<(), DriveError> {
        Err(other_groups("none"))
    }
}

/// Error for a stage that began with other groups, named in `before`.
pub fn other_groups(before: &str) -> DriveError {
    DriveError(format!(
        "the stage began with other groups: {before}. Particles join groups when a stage begins: give the scene the \
         same [[group]] names, or begin a new stage with the snapshot, `start` in the scene"
    ))
}
