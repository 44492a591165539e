//! Motions of walls and groups of particles from `[[motion]]` in the parsed file.

use super::cells;
use super::reader::{Given, Section};
use crate::cell::{AXES, Cell};
use crate::math::Vec3;
use crate::text::{Lines, shown};
use crate::walls::Wall;
use crate::walls::courses::{Course, Table, TimeFunction};
use std::path::Path;

/// All `[[motion]]` tables.
pub(super) struct Motions<'a> {
    all: Vec<Motion<'a>>,
}

/// One `[[motion]]`.
struct Motion<'a> {
    /// Walls, with their names.
    walls: Vec<(Given<'a>, &'a str)>,
    /// Groups of particles, with their names.
    groups: Vec<(Given<'a>, &'a str)>,
    kind: Kind,
    how: How,
}

/// Origin of the motion.
enum How {
    /// A function of time.
    By(TimeFunction),
    /// Forces: on a mass [kg], along its direction, with this additional one [N].
    Freely { mass: f64, force: f64 },
}

/// Direction or axis of the motion.
#[derive(Clone, Copy)]
enum Kind {
    Along(Vec3),
    /// Rotation about a point [m] and an axis.
    About(Vec3, Vec3),
}

impl<'a> Motions<'a> {
    pub(super) fn read(root: &Section<'a>, domain: Option<&Cell>, folder: &Path) -> Self {
        let sections = root.sections("motion");
        let read = |section: &Section<'a>| motion(section, domain, folder);
        Self { all: sections.iter().filter_map(read).collect() }
    }

    /// Point about which they turn a wall [m], if they do.
    pub(super) fn about(&self, name: &str) -> Option<Vec3> {
        self.of(name).find_map(|(_, motion)| match motion.kind {
            Kind::About(point, _) => Some(point),
            Kind::Along(_) => None,
        })
    }

    /// Sets the course of a wall, including its constant velocities.
    pub(super) fn move_wall(&self, name: &str, wall: &mut Wall) {
        if self.of(name).next().is_none() {
            return;
        }
        if self.free(name).is_some() {
            self.free_alone(name, wall);
            return;
        }
        wall.follow(course(self.of(name), &wall.velocity, &wall.angular_velocity));
    }

    /// Course of a group of particles, including its constant velocities, and the point about which motions turn it [m], if
    /// they do.
    pub(super) fn of_group(
        &self,
        name: &str,
        velocity: &Vec3,
        turning: &Vec3,
    ) -> (Course, Option<Vec3>) {
        let all = self.all.iter().flat_map(|motion| {
            let named = motion.groups.iter().filter(|(_, group)| *group == name);
            named.map(move |(given, _)| (given, motion))
        });
        for (given, _) in all.clone().filter(|(_, motion)| matches!(motion.how, How::Freely { .. }))
        {
            given.fail("a motion with a `mass` is for a wall; for a group use a `force`");
        }
        let about = all.clone().find_map(|(_, motion)| match motion.kind {
            Kind::About(point, _) => Some(point),
            Kind::Along(_) => None,
        });
        (course(all, velocity, turning), about)
    }

    /// Calls `look` for each named group.
    pub(super) fn check_groups(&self, look: impl Fn(&Given, &str)) {
        for (given, name) in self.all.iter().flat_map(|motion| &motion.groups) {
            look(given, name);
        }
    }

    /// Sets the mass of a wall that only forces move.
    fn free_alone(&self, name: &str, wall: &mut Wall) {
        for (given, motion) in self.of(name) {
            match (&motion.how, motion.kind) {
                (How::Freely { mass, .. }, Kind::Along(along)) if wall.mass.is_infinite() => {
                    (wall.mass, wall.free_along) = (*mass, along);
                }
                _ => given.fail("this wall moves freely, with a `mass`, and has another motion; leave out one of them"),
            }
            if wall.turns() {
                given.fail("this wall has a `rotation`, but a motion with a `mass` cannot rotate; leave out one of \
                     them");
            }
        }
    }

    /// Calls `look` for each direction along which a wall moves.
    pub(super) fn ways_along(&self, name: &str, look: impl Fn(&Given, &Vec3)) {
        for (given, motion) in self.of(name) {
            if let Kind::Along(along) = &motion.kind {
                look(given, along);
            }
        }
    }

    /// Direction, mass [kg] and additional force [N] of a wall that moves freely; `None` for others.
    pub(super) fn free(&self, name: &str) -> Option<(Vec3, f64, f64)> {
        self.of(name).find_map(|(_, motion)| match (motion.kind, &motion.how) {
            (Kind::Along(along), &How::Freely { mass, force }) => Some((along, mass, force)),
            _ => None,
        })
    }

    /// Calls `look` for each named wall.
    pub(super) fn check(&self, look: impl Fn(&Given, &str)) {
        for (given, name) in self.all.iter().flat_map(|motion| &motion.walls) {
            look(given, name);
        }
    }

    fn of<'b>(&'b self, name: &'b str) -> impl Iterator<Item = (&'b Given<'a>, &'b Motion<'a>)> {
        self.all.iter().flat_map(move |motion| {
            let named = motion.walls.iter().filter(move |(_, wall)| *wall == name);
            named.map(move |(given, _)| (given, motion))
        })
    }
}

/// Course of a body with these constant velocities [m/s, rad/s] and motions.
fn course<'a, 'b: 'a>(
    motions: impl Iterator<Item = (&'a Given<'b>, &'a Motion<'b>)>,
    velocity: &Vec3,
    turning: &Vec3,
) -> Course {
    let mut course = Course { shifts: Vec::new(), turn: None };
    let (speed, rate) = (velocity.norm(), turning.norm());
    if speed > 0.0 {
        course.shifts.push((velocity / speed, TimeFunction::Steady(speed)));
    }
    if rate > 0.0 {
        course.turn = Some((turning / rate, TimeFunction::Steady(rate)));
    }
    for (given, motion) in motions {
        let How::By(way) = &motion.how else { continue };
        match motion.kind {
            Kind::Along(along) => course.shifts.push((along, way.clone())),
            Kind::About(..) if course.turn.is_some() => {
                given.fail("rotates already, by its `rotation` or another motion; a body rotates about one axis");
            }
            Kind::About(_, axis) => course.turn = Some((axis, way.clone())),
        }
    }
    course
}

/// Names of moving bodies.
fn named<'a>(section: &Section<'a>, key: &str) -> Option<Vec<(Given<'a>, &'a str)>> {
    section.read_or(key, Vec::new(), |given| {
        let mut names: Vec<(Given, &str)> = Vec::new();
        for item in given.list()? {
            let name = item.text()?;
            if names.iter().any(|(_, known)| *known == name) {
                item.fail("occurs twice");
            }
            names.push((item, name));
        }
        Some(names)
    })
}

fn motion<'a>(section: &Section<'a>, domain: Option<&Cell>, folder: &Path) -> Option<Motion<'a>> {
    let (walls, groups) = (named(section, "walls"), named(section, "groups"));
    if section.get("walls").is_none() && section.get("groups").is_none() {
        section.fail("`walls` or `groups` is missing: a list of names of bodies to move");
    }
    let kind = if let Some(given) = section.get("along") {
        for key in ["about", "axis"] {
            section.refuse(key, "not with `along`; a motion has a direction or an axis");
        }
        given.direction().map(Kind::Along)
    } else if section.get("about").is_some() || section.get("axis").is_some() {
        let (about, axis) = axis_of_turn(section, domain);
        about.zip(axis).map(|(about, axis)| Kind::About(about, axis))
    } else {
        section.fail("`along` is missing: [x, y, z], the direction of motion; or `about` and `axis`, the axis of \
             rotation");
        None
    };
    let turns = section.get("along").is_none();
    let how = if let Some(given) = section.get("mass") {
        if turns {
            given.fail("needs a motion `along` a direction");
        }
        for key in ["amplitude", "frequency", "phase", "table", "interpolation"] {
            section.refuse(key, "not with `mass`; a wall moves by time or by forces");
        }
        if walls.as_ref().is_some_and(|walls| walls.len() > 1) {
            given.fail("needs a single wall; give each wall its own motion, or make one wall of several `planes`");
        }
        let mass = section.number("mass");
        let force = section.number_or("force", 0.0);
        mass.zip(force).map(|(mass, force)| How::Freely { mass, force })
    } else {
        section.refuse("force", "needs a wall with a `mass`");
        let column = if turns { ("angle_deg", 1f64.to_radians()) } else { ("displacement_m", 1.0) };
        way(section, column, folder).map(How::By)
    };
    Some(Motion { walls: walls?, groups: groups?, kind: kind?, how: how? })
}

/// An oscillation or a table, with values of this column, times a factor.
pub(super) fn way(section: &Section, column: (&str, f64), folder: &Path) -> Option<TimeFunction> {
    if section.get("table").is_some() {
        for key in ["amplitude", "frequency", "phase"] {
            section.refuse(key, "not with `table`; a motion is an oscillation or a table");
        }
        return table(section, folder, column).map(TimeFunction::Table);
    }
    section.refuse("interpolation", "needs a `table`");
    let amplitude = section.number("amplitude");
    let frequency = section.number("frequency");
    let phase = section.number_or("phase", 0.0);
    Some(TimeFunction::Oscillation {
        amplitude: amplitude? * column.1,
        frequency: frequency?,
        phase: phase?.to_radians(),
    })
}

/// The `table` of a section, with values of this column, times a factor.
pub(super) fn table(
    section: &Section,
    folder: &Path,
    (column, to_si): (&str, f64),
) -> Option<Table> {
    let words = [("linear", false), ("smooth", true)];
    let is_smooth = section.read_or("interpolation", false, |given| given.one_of(&words));
    let given = section.get("table")?;
    match rows(&folder.join(given.text()?), column) {
        Ok(rows) => {
            let rows: Vec<_> =
                rows.into_iter().map(|(time, value)| (time, value * to_si)).collect();
            Some(Table::new(&rows, is_smooth?))
        }
        Err(mistakes) => {
            for mistake in &mistakes {
                given.fail(mistake);
            }
            None
        }
    }
}

/// Times [s] and values of a table.
fn rows(path: &Path, value: &str) -> Result<Vec<(f64, f64)>, Vec<String>> {
    let text = cells::text(path)?;
    let lines = Lines::of(&text);
    let mut reader = cells::reader(&text, true);
    let header = cells::header(&mut reader)?;
    if header.iter().ne(["time_s", value]) {
        let found = shown(header.iter().collect::<Vec<_>>().join(","));
        return Err(vec![format!("must have the columns time_s,{value}; it has {found}")]);
    }
    let mut rows: Vec<(f64, f64)> = Vec::new();
    let mut mistakes = Vec::new();
    for record in reader.records() {
        let record = match record {
            Ok(record) => record,
            Err(error) => {
                mistakes.push(error.to_string());
                continue;
            }
        };
        let line = cells::line_of(&record, &text, &lines);
        let numbers = record
            .iter()
            .map(|cell| cells::number(cell).map_err(|what| format!("line {line}: {what}")));
        match numbers.collect::<Result<Vec<_>, _>>() {
            Err(what) => mistakes.push(what),
            Ok(numbers) => match (&*numbers, rows.last()) {
                (&[time, _], None) if time != 0.0 => {
                    mistakes.push(format!(
                        "line {line}: the first time must be 0, the start of the stage, not \
                             {time:?}"
                    ));
                    rows.push((time, 0.0));
                }
                (&[time, _], Some((before, _))) if time <= *before => mistakes.push(format!(
                    "line {line}: time {time:?} is not after {before:?}; times must increase"
                )),
                (&[time, value], _) => rows.push((time, value)),
                _ => mistakes.push(format!("line {line} has {} numbers, not 2", numbers.len())),
            },
        }
    }
    if mistakes.is_empty() && rows.len() < 2 {
        mistakes.push("must have at least two rows".to_owned());
    }
    if mistakes.is_empty() {
        return Ok(rows);
    }
    Err(cells::few(mistakes))
}

/// Point about which a wall turns [m], and the direction of the axis.
pub(super) fn axis_of_turn(
    section: &Section,
    domain: Option<&Cell>,
) -> (Option<Vec3>, Option<Vec3>) {
    let about = section.vector("about");
    let axis = section.require("axis").and_then(|given| {
        let direction = given.direction()?;
        // The turn must map the periodic domain onto itself.
        let across = |&axis: &usize| direction[axis].abs() != 1.0;
        if let Some(axis) = domain.and_then(|domain| domain.repeating_axes().find(across)) {
            given.fail(format!("must lie along {}, which is periodic", AXES[axis]));
        }
        Some(direction)
    });
    (about, axis)
}
