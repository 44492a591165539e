//! How walls and groups of particles move by `[[motion]]`: from the file as written.

use super::cells;
use super::reader::{Given, Section};
use crate::cell::{AXES, Cell};
use crate::math::Vec3;
use crate::text::{Lines, shown};
use crate::walls::Wall;
use crate::walls::courses::{Course, Table, Way};
use std::path::Path;

/// The `[[motion]]` tables.
pub(super) struct Motions<'a> {
    all: Vec<Motion<'a>>,
}

/// One of them.
struct Motion<'a> {
    /// Which walls, with their names.
    walls: Vec<(Given<'a>, &'a str)>,
    /// Groups of particles, with their names.
    groups: Vec<(Given<'a>, &'a str)>,
    kind: Kind,
    how: How,
}

/// What decides where the wall is.
enum How {
    /// Time.
    By(Way),
    /// Forces: on a mass [kg], along its direction, with this one besides [N].
    Freely { mass: f64, force: f64 },
}

/// Along what, or about what.
#[derive(Clone, Copy)]
enum Kind {
    Along(Vec3),
    /// A point [m] and an axis.
    About(Vec3, Vec3),
}

impl<'a> Motions<'a> {
    pub(super) fn read(root: &Section<'a>, domain: Option<&Cell>, folder: &Path) -> Self {
        let sections = root.sections("motion");
        let read = |section: &Section<'a>| motion(section, domain, folder);
        Self { all: sections.iter().filter_map(read).collect() }
    }

    /// The point about which they turn a wall [m], if they do.
    pub(super) fn about(&self, name: &str) -> Option<Vec3> {
        self.of(name).find_map(|(_, motion)| match motion.kind {
            Kind::About(point, _) => Some(point),
            Kind::Along(_) => None,
        })
    }

    /// Gives a wall the course that it shall have, with the constant velocities that it has.
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

    /// The course of a group of particles, with the constant velocities that it has, and the point about which motions turn it [m], if they
    /// do.
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
            given.fail("a motion with a `mass` is of a wall; push a group with a `force`");
        }
        let about = all.clone().find_map(|(_, motion)| match motion.kind {
            Kind::About(point, _) => Some(point),
            Kind::Along(_) => None,
        });
        (course(all, velocity, turning), about)
    }

    /// Looks at each name of a group as it is given.
    pub(super) fn check_groups(&self, look: impl Fn(&Given, &str)) {
        for (given, name) in self.all.iter().flat_map(|motion| &motion.groups) {
            look(given, name);
        }
    }

    /// Gives a wall its mass, if nothing but forces moves it.
    fn free_alone(&self, name: &str, wall: &mut Wall) {
        for (given, motion) in self.of(name) {
            match (&motion.how, motion.kind) {
                (How::Freely { mass, .. }, Kind::Along(along)) if wall.mass.is_infinite() => {
                    (wall.mass, wall.free_along) = (*mass, along);
                }
                _ => given.fail("this wall moves freely, with a `mass`, and has another motion; leave out one of them"),
            }
            if wall.turns() {
                given.fail("this wall has a `rotation`, and a motion with a `mass`, which cannot turn it; leave out one of them");
            }
        }
    }

    /// Looks at each direction along which a wall moves.
    pub(super) fn ways_along(&self, name: &str, look: impl Fn(&Given, &Vec3)) {
        for (given, motion) in self.of(name) {
            if let Kind::Along(along) = &motion.kind {
                look(given, along);
            }
        }
    }

    /// Along what direction a wall moves freely, with what mass [kg] and under what force along it [N], if it does.
    pub(super) fn free(&self, name: &str) -> Option<(Vec3, f64, f64)> {
        self.of(name).find_map(|(_, motion)| match (motion.kind, &motion.how) {
            (Kind::Along(along), &How::Freely { mass, force }) => Some((along, mass, force)),
            _ => None,
        })
    }

    /// Looks at each name of a wall as it is given.
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

/// The course of a body that has these constant velocities [m/s, rad/s] and motions.
fn course<'a, 'b: 'a>(
    motions: impl Iterator<Item = (&'a Given<'b>, &'a Motion<'b>)>,
    velocity: &Vec3,
    turning: &Vec3,
) -> Course {
    let mut course = Course { shifts: Vec::new(), turn: None };
    let (speed, rate) = (velocity.norm(), turning.norm());
    if speed > 0.0 {
        course.shifts.push((velocity / speed, Way::Steady(speed)));
    }
    if rate > 0.0 {
        course.turn = Some((turning / rate, Way::Steady(rate)));
    }
    for (given, motion) in motions {
        let How::By(way) = &motion.how else { continue };
        match motion.kind {
            Kind::Along(along) => course.shifts.push((along, way.clone())),
            Kind::About(..) if course.turn.is_some() => {
                given.fail("turns already, by its `rotation` or another motion; a body turns about one axis");
            }
            Kind::About(_, axis) => course.turn = Some((axis, way.clone())),
        }
    }
    course
}

/// Names of what moves.
fn named<'a>(section: &Section<'a>, key: &str) -> Option<Vec<(Given<'a>, &'a str)>> {
    section.read_or(key, Vec::new(), |given| {
        let mut names: Vec<(Given, &str)> = Vec::new();
        for item in given.list()? {
            let name = item.text()?;
            if names.iter().any(|(_, known)| *known == name) {
                item.fail("stands there twice");
            }
            names.push((item, name));
        }
        Some(names)
    })
}

fn motion<'a>(section: &Section<'a>, domain: Option<&Cell>, folder: &Path) -> Option<Motion<'a>> {
    let (walls, groups) = (named(section, "walls"), named(section, "groups"));
    if section.get("walls").is_none() && section.get("groups").is_none() {
        section.fail("`walls` or `groups` is missing: a list of names of what moves so");
    }
    let kind = if let Some(given) = section.get("along") {
        for key in ["about", "axis"] {
            section.refuse(
                key,
                "stands beside `along`; a motion goes along a direction or turns about an axis",
            );
        }
        given.direction().map(Kind::Along)
    } else if section.get("about").is_some() || section.get("axis").is_some() {
        let (about, axis) = axis_of_turn(section, domain);
        about.zip(axis).map(|(about, axis)| Kind::About(about, axis))
    } else {
        section.fail("`along` is missing: [x, y, z], the direction in which walls move; or `about` and `axis`, about which they turn");
        None
    };
    let turns = section.get("along").is_none();
    let how = if let Some(given) = section.get("mass") {
        if turns {
            given.fail("is of a motion `along` a direction");
        }
        for key in ["amplitude", "frequency", "phase", "table", "interpolation"] {
            section.refuse(key, "stands beside `mass`; a wall moves by time or by forces");
        }
        if walls.as_ref().is_some_and(|walls| walls.len() > 1) {
            given.fail("is of one wall; give each a motion of its own, or make one wall of several `planes`");
        }
        let mass = section.number("mass");
        let force = section.number_or("force", 0.0);
        mass.zip(force).map(|(mass, force)| How::Freely { mass, force })
    } else {
        section.refuse("force", "is of a wall with a `mass`, which forces move");
        way(section, turns, folder).map(How::By)
    };
    Some(Motion { walls: walls?, groups: groups?, kind: kind?, how: how? })
}

/// An oscillation or a table; the scene has angles in degrees.
fn way(section: &Section, turns: bool, folder: &Path) -> Option<Way> {
    let to_si = if turns { 1f64.to_radians() } else { 1.0 };
    if section.get("table").is_some() {
        for key in ["amplitude", "frequency", "phase"] {
            section.refuse(key, "stands beside `table`; a motion is an oscillation or a table");
        }
        let column = if turns { "angle_deg" } else { "displacement_m" };
        return table(section, folder, (column, to_si)).map(Way::Table);
    }
    section.refuse("interpolation", "is of a `table`");
    let amplitude = section.number("amplitude");
    let frequency = section.number("frequency");
    let phase = section.number_or("phase", 0.0);
    Some(Way::Oscillation {
        amplitude: amplitude? * to_si,
        frequency: frequency?,
        phase: phase?.to_radians(),
    })
}

/// The `table` of a section, with values of this column, each times a factor.
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
        let numbers = record.iter().map(|cell| {
            let number = cell.parse::<f64>().ok().filter(|number| number.is_finite());
            number.ok_or_else(|| format!("line {line}: `{}` is not a number", shown(cell)))
        });
        match numbers.collect::<Result<Vec<_>, _>>() {
            Err(what) => mistakes.push(what),
            Ok(numbers) => {
                match (&*numbers, rows.last()) {
                    (&[time, _], None) if time != 0.0 => {
                        mistakes.push(format!("line {line}: the first time must be 0, when the stage begins, not {time:?}"));
                        rows.push((time, 0.0));
                    }
                    (&[time, _], Some((before, _))) if time <= *before => mistakes.push(format!(
                        "line {line}: time {time:?} does not come after {before:?}; times must rise"
                    )),
                    (&[time, value], _) => rows.push((time, value)),
                    _ => mistakes.push(format!("line {line} has {} numbers, not 2", numbers.len())),
                }
            }
        }
    }
    if mistakes.is_empty() && rows.len() < 2 {
        mistakes.push("must have two rows at least".to_owned());
    }
    if mistakes.is_empty() {
        return Ok(rows);
    }
    Err(cells::few(mistakes))
}

/// The point about which a wall turns [m], and the direction of the axis.
pub(super) fn axis_of_turn(
    section: &Section,
    domain: Option<&Cell>,
) -> (Option<Vec3>, Option<Vec3>) {
    let about = section.vector("about");
    let axis = section.require("axis").and_then(|given| {
        let direction = given.direction()?;
        // A period must go with the turn.
        let across = |&axis: &usize| direction[axis].abs() != 1.0;
        if let Some(axis) = domain.and_then(|domain| domain.repeating_axes().find(across)) {
            given.fail(format!("must lie along {}, which is periodic", AXES[axis]));
        }
        Some(direction)
    });
    (about, axis)
}
