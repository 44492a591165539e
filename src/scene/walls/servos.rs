//! Walls with a servo and their targets, from the parsed file.

use super::{LONGEST_MOVE, Planned, Walls, slower_by, stays_in_period, too_far, too_fast};
use crate::cell::{AXES, Cell};
use crate::drive::servo::{Goal, Servo};
use crate::math::Vec3;
use crate::population::Library;
use crate::scene::mistakes::CELL;
use crate::scene::reader::{Given, Section};
use crate::walls::{Across, Wall};

/// Smallest relevant part of velocities along a direction, and of turns out of a plane; below it is rounding.
const ROUNDING: f64 = 1e-9;

/// Settings of a servo of force for its walls, as far as they are valid.
struct Push<'a> {
    /// The key `along`, if it is given.
    given: Option<Given<'a>>,
    /// Unit vector of `along`.
    along: Option<Vec3>,
    /// May walls stand elsewhere than in the scene, after an earlier stage?
    is_later: bool,
}

/// Stress of a servo of force [N] where the contact area of its walls is unknown [Pa]: over the smallest side of a domain
/// with sides of these lengths [m].
pub(in crate::scene) fn stress_of_force(force: f64, sides: &Vec3) -> f64 {
    force * sides.max() / sides.product()
}

/// Highest stress of all servos [Pa]. Errors in them are reported where servos are read.
pub(in crate::scene) fn highest_stress(root: &Section) -> f64 {
    let corners = || {
        let domain = root.section("domain")?;
        Some((domain.get("low")?.vector()?, domain.get("high")?.vector()?))
    };
    let of_servo = |servo: &Section| match servo.get("force") {
        Some(force) => {
            let (low, high) = corners()?;
            Some(stress_of_force(force.number()?, &(high - low)))
        }
        None => servo.get("stress")?.number(),
    };
    root.sections("servo").iter().filter_map(of_servo).fold(0.0, f64::max)
}

impl Walls<'_> {
    /// Reads the servos and marks their walls. `dt` is the time step [s], if it and all shapes are known.
    pub(in crate::scene) fn read_servos(
        &mut self,
        root: &Section,
        domain: Option<&Cell>,
        library: &Library,
        dt: Option<f64>,
    ) -> Option<Vec<Servo>> {
        let sections = root.sections("servo");
        let is_later = root.get("start").is_some();
        let servo = |section| self.servo(section, is_later, domain, library, dt);
        let servos: Vec<_> = sections.iter().map(servo).collect();
        Some(servos.into_iter().collect::<Option<Vec<_>>>()?.concat())
    }

    /// Servos of one `[[servo]]`: one for all its walls, or one for each.
    fn servo(
        &mut self,
        section: &Section,
        is_later: bool,
        domain: Option<&Cell>,
        library: &Library,
        dt: Option<f64>,
    ) -> Option<Vec<Servo>> {
        let names = section.require("walls").and_then(|given| given.list());
        let (push, goal) = goal(section, is_later);
        let walls = names.and_then(|names| {
            let walls = names.iter().map(|name| self.steered(name, domain, push.as_ref()));
            walls.collect::<Vec<_>>().into_iter().collect::<Option<Vec<usize>>>()
        });
        let max_speed = section.number_or("max_speed", 1.0);
        let gain = section.number_or("gain", 1.0);
        let coupled = section.boolean_or("coupled", false);
        if let Some(wrong) = max_speed.and_then(|speed| too_fast(speed, dt, library)) {
            section.fail(format!("`max_speed` {wrong}"));
        } else if let (Some(goal), Some(walls), Some(speed)) = (&goal, &walls, max_speed)
            && let Some(wrong) = self.too_fast_together(walls, goal, speed, (domain, library, dt))
        {
            section.fail(wrong);
        }
        let (walls, goal, max_speed, gain) = (walls?, goal?, max_speed?, gain?);
        let servo = |walls| Servo { walls, goal, max_speed, gain };
        if !coupled? {
            return Some(walls.into_iter().map(|wall| servo(vec![wall])).collect());
        }
        if walls.len() == 1 {
            section.get("coupled")?.fail("needs two or more walls");
        }
        Some(vec![servo(walls)])
    }

    /// A wall for a servo, of force if there is a `push`.
    fn steered(
        &mut self,
        given: &Given,
        domain: Option<&Cell>,
        push: Option<&Push>,
    ) -> Option<usize> {
        let name = given.text()?;
        let faces = domain.map(Cell::faces);
        let face = faces.iter().flatten().find(|face| face.name == name && face.repeats);
        if let Some(face) = face {
            let axis = AXES[face.axis];
            given.fail(format!("is no wall: domain.periodic is true along {axis}; {CELL}"));
            return None;
        }
        let k = self.names.find(given, name)?;
        let across: Vec<Across> =
            self.all.iter().flatten().filter_map(|planned| planned.wall.across()).collect();
        let Planned { wall, has_servo, .. } = self.all[k].as_mut()?;
        if std::mem::replace(has_servo, true) {
            given.fail("this wall has a servo already");
        }
        let has_motion = wall.course.is_some() || wall.mass.is_finite();
        if has_motion {
            given.fail("this wall has a `[[motion]]`; leave out the motion or the servo");
        }
        if let Some(push) = push {
            check_push(given, wall, has_motion, push, domain);
            return Some(k);
        }
        if !has_motion && wall.speed_inwards() != 0.0 {
            given.fail(
                "this wall has a velocity along its normal; leave out the velocity or the servo",
            );
        }
        let Some(Across { axis: own, .. }) = wall.across() else {
            given.fail(if wall.mesh.is_some() {
                "this wall has triangles; a servo of `stress` needs one plane, with a normal along x, y or z; a servo \
                 of `force` works with any wall"
            } else if wall.facets.len() > 1 {
                "this wall has several planes; a servo of `stress` needs one, with a normal along x, y or z; a servo \
                 of `force` works with any wall"
            } else if wall.turns() {
                "this wall is tilted, or rotates out of its plane; a servo needs a constant normal along x, y or z"
            } else {
                "this wall is tilted; a servo of `stress` needs a normal along x, y or z; a servo of `force` works \
                 with any wall"
            });
            return None;
        };
        for axis in [(own + 1) % 3, (own + 2) % 3] {
            let stands = |side: f64| across.iter().any(|w| w.axis == axis && w.inwards == side);
            let closed = stands(1.0) && stands(-1.0);
            if !closed && domain?.open_axes().any(|open| open == axis) {
                given.fail(format!(
                    "its area is not known, as the domain is open along {}; add walls on both sides, make it \
                     periodic, or give a `force`",
                    AXES[axis]
                ));
            }
        }
        Some(k)
    }

    /// Error for a servo of force that moves a wall too far in a step together with its other motion, although each alone
    /// is slow enough.
    fn too_fast_together(
        &self,
        walls: &[usize],
        goal: &Goal,
        max_speed: f64,
        (domain, library, dt): (Option<&Cell>, &Library, Option<f64>),
    ) -> Option<String> {
        if matches!(goal, Goal::Stress(_)) {
            // Its other velocities lie in its plane.
            return None;
        }
        let (domain, dt) = (domain?, dt?);
        let room = domain.corners();
        walls.iter().find_map(|&k| {
            let wall = &self.all[k].as_ref()?.wall;
            let mut moved = wall.clone();
            moved.velocity = goal.velocity(wall, &wall.velocity, max_speed);
            let speed = moved.way(1.0, &room);
            let most = too_far(speed, Some(dt), library)?;
            Some(format!(
                "`max_speed` ({max_speed:?} m/s) with the other motion moves wall \"{}\" by up to {:.2e} m per step, \
                 over {} % of the shortest particle axis; reduce both by a factor {:.2e}, or `step`",
                wall.name,
                speed * dt,
                100.0 * LONGEST_MOVE,
                slower_by(speed * dt, most)
            ))
        })
    }
}

/// Target of a servo, with its settings for walls if it is a force.
fn goal<'a>(section: &Section<'a>, is_later: bool) -> (Option<Push<'a>>, Option<Goal>) {
    let stress = section.get("stress");
    let (force, given) = (section.get("force"), section.get("along"));
    let Some(force) = force else {
        if let Some(along) = given {
            along.fail("needs a servo of `force`; a stress acts along the normal");
        }
        let goal = if let Some(stress) = stress {
            stress.number().map(Goal::Stress)
        } else {
            section.fail("`stress` [Pa] or `force` [N] is missing: a number greater than 0");
            None
        };
        return (None, goal);
    };
    if let Some(stress) = stress {
        stress.fail("not with `force`; a servo has one target");
    }
    let newtons = force.number();
    let along = given.as_ref().and_then(Given::direction);
    let is_wrong = given.is_some() && along.is_none();
    let goal = newtons.filter(|_| !is_wrong).map(|newtons| Goal::Force { newtons, along });
    (Some(Push { given, along, is_later }), goal)
}

/// Checks that a servo of force can move a wall.
fn check_push(given: &Given, wall: &Wall, has_motion: bool, push: &Push, domain: Option<&Cell>) {
    let is_plane = wall.facets.len() == 1;
    let (_, normal) = wall.surface();
    let along = match (&push.given, push.along) {
        (Some(_), Some(along)) => along,
        (None, _) if is_plane => normal,
        (None, _) => {
            given.fail(
                "this wall has no single normal; a servo of `force` needs `along`, [x, y, z], the direction of the \
                 force",
            );
            return;
        }
        // The error has been reported.
        (Some(_), None) => return,
    };
    let (velocity, turn) = (&wall.velocity, &wall.angular_velocity);
    if !has_motion && velocity.dot(&along).abs() > ROUNDING * velocity.norm() {
        given.fail("this wall has a velocity along the direction of its servo; leave out the velocity or the servo");
    }
    if wall.mesh.is_some()
        && let Some(given) = &push.given
    {
        stays_in_period(given, &along, domain);
    }
    if is_plane && turn.cross(&normal).norm() > ROUNDING * turn.norm() {
        given.fail("this wall rotates out of its plane; a servo needs a constant normal");
    } else if !push.is_later && !wall.leads(&along) && (is_plane || !wall.may_turn()) {
        given.fail(
            "`along` is in the plane of this wall, or away from the particles; it needs a component along the normal, \
             which points towards them",
        );
    }
}
