//! Groups of held or pushed particles, from the parsed file to [`Group`].

use super::Inlet;
use super::Mix;
use super::Rain;
use super::matter::{Names, Shapes};
use super::mistakes::suggestion;
use super::motions::table;
use super::reader::{Given, Section};
use super::regions::region;
use super::walls::{LONGEST_MOVE, Walls, rotation, too_far};
use crate::cell::Cell;
use crate::drive::groups::{
    Drag, DragLaw, Group, GroupMotion, Load, Path as GroupPath, Push, Selection,
};
use crate::ids::ShapeId;
use crate::math::{Vec3, printed_limit};
use crate::population::Library;
use std::path::Path;

/// Largest number of groups, by their numbers.
const MOST_GROUPS: usize = u16::MAX as usize;

/// Other parts of the scene.
pub(super) struct Around<'a, 'b> {
    pub(super) shapes: &'a Shapes,
    pub(super) walls: &'a Walls<'b>,
    pub(super) domain: Option<&'a Cell>,
    pub(super) rain: Option<&'a Rain>,
    /// Gravity [m/s²].
    pub(super) gravity: Vec3,
    pub(super) folder: &'a Path,
}

/// Is any group held?
pub(super) fn any_held(root: &Section) -> bool {
    let says = |section: &Section, keys: &[&str]| keys.iter().any(|key| section.get(key).is_some());
    root.sections("group").iter().any(|group| says(group, &["fixed", "velocity", "rotation"]))
        || root.sections("motion").iter().any(|motion| says(motion, &["groups"]))
}

/// Reads all `[[group]]`. Inlets get the numbers of the groups that name them.
pub(super) fn read(
    root: &Section,
    around: &Around,
    mut inlets: Option<&mut [Inlet]>,
) -> Option<Vec<Group>> {
    let sections = root.sections("group");
    let mut names = Names::of("group");
    let mut all = Vec::new();
    for section in &sections {
        names.add(section);
        let name = names.all.last().cloned().unwrap_or_default();
        if around.walls.has(&name)
            && let Some(given) = section.get("name")
        {
            given.fail(
                "is also the name of a wall, and both have forces in `history.csv`; use another",
            );
        }
        let inlets = inlets.as_deref_mut().unwrap_or_default();
        let who = who(section, around, inlets, names.all.len());
        let what = what(section, around, &name);
        let group = who.zip(what).map(|(who, what)| Group { name, who, what });
        if let Some(group) = &group {
            check_newcomers(section, group, around, inlets);
        }
        all.push(group);
    }
    if sections.len() > MOST_GROUPS {
        root.fail(format!("has {} groups; must be at most {MOST_GROUPS}", sections.len()));
    }
    around.walls.motions().check_groups(|given, name| {
        if names.index(name).is_none() {
            let hint = suggestion(name, names.listing(), "there are");
            given.fail(format!("no such group{hint}"));
        }
    });
    all.into_iter().collect()
}

/// Particles of a group; `number` is that of the group.
fn who(
    section: &Section,
    around: &Around,
    inlets: &mut [Inlet],
    number: usize,
) -> Option<Selection> {
    let shapes = section.read_or("shapes", Vec::new(), |given| {
        let items = if given.text().is_some() { vec![given.clone()] } else { given.list()? };
        let shape = |item: &Given| around.shapes.names.find(item, item.text()?);
        let found: Vec<Option<usize>> = items.iter().map(shape).collect();
        found.into_iter().map(|index| Some(ShapeId(index? as u16))).collect()
    });
    let within = section.optional("region", |given| region(&given.section()?, false));
    let ids = ids(section);
    let by_inlet = section.get("inlets");
    if let Some(given) = &by_inlet {
        for key in ["shapes", "region", "ids", "id_ranges"] {
            section
                .refuse(key, "not with `inlets`: a group contains particles of inlets, or others");
        }
        for item in given.list().unwrap_or_default() {
            let Some(name) = item.text() else { continue };
            let Some(inlet) = inlets.iter_mut().find(|inlet| inlet.name == name) else {
                let there = inlets.iter().map(|inlet| &*inlet.name);
                item.fail(format!("no such inlet{}", suggestion(name, there, "there are")));
                continue;
            };
            if inlet.group != 0 {
                item.fail("belongs to another group already");
            }
            inlet.group = number as u16;
        }
    }
    Some(Selection { shapes: shapes?, region: within?, ids: ids?, by_inlet: by_inlet.is_some() })
}

/// First and last ids.
fn ids(section: &Section) -> Option<Vec<[u64; 2]>> {
    let single = section.read_or("ids", Vec::new(), |given| {
        given.list()?.iter().map(|id| id.whole().map(|id| [id, id])).collect::<Option<Vec<_>>>()
    });
    let range = |given: &Given| {
        let [first, last] = given.list_of(Given::whole)?;
        if first > last {
            given.fail("must be [first, last]");
            return None;
        }
        Some([first, last])
    };
    let ranges = section.read_or("id_ranges", Vec::new(), |given| {
        given.list()?.iter().map(range).collect::<Option<Vec<_>>>()
    });
    Some([single?, ranges?].concat())
}

/// Motion of a group.
fn what(section: &Section, around: &Around, name: &str) -> Option<GroupMotion> {
    let Around { domain, walls, .. } = around;
    let fixed = section.boolean_or("fixed", false);
    let velocity = section.vector_or("velocity", Vec3::zeros());
    let rotation =
        section.read_or("rotation", None, |given| rotation(&given.section()?, *domain).map(Some));
    let pushed = push(section, around);
    let rotation = rotation?;
    let turning = rotation.map_or_else(Vec3::zeros, |(_, rate)| rate);
    let (course, of_motion) = walls.motions().of_group(name, &velocity?, &turning);
    let about = rotation.map(|(about, _)| about).or(of_motion).unwrap_or_else(Vec3::zeros);
    let path = GroupPath { course, about };
    let moves = ["velocity", "rotation"].iter().any(|key| section.get(key).is_some());
    let is_held = fixed? || moves || !path.is_still();
    if fixed? && (moves || !path.is_still()) {
        section.get("fixed")?.fail(
            "not with a `velocity`, a `rotation` or a [[motion]] of the group; leave out one \
             of them",
        );
    }
    if is_held {
        for key in ["force", "force_by", "torque", "torque_by", "drag"] {
            section.refuse(key, "needs freely moving particles, but these have `fixed`, `velocity`, `rotation` or a \
                 [[motion]]");
        }
    }
    if domain.is_some_and(Cell::moves) && (is_held || section.get("drag").is_some()) {
        section.fail("has prescribed motion or drag, which are undefined in the flow of a sheared or strained domain; \
             leave out `shear` or [cell], or the group");
    }
    if is_held { Some(GroupMotion::Held(path)) } else { pushed.map(GroupMotion::Pushed) }
}

fn push(section: &Section, around: &Around) -> Option<Push> {
    let load = |keys: [&str; 2], column: &str| {
        let [constant, by] = keys;
        if section.get(constant).is_some() {
            section.refuse(by, &format!("not with `{constant}`; leave out one of them"));
        }
        match section.section(by) {
            None => section.optional(constant, |given| given.vector().map(Load::Constant)),
            Some(by) => {
                let along = by.require("along").and_then(|given| given.direction());
                let table = table(&by, around.folder, (column, 1.0));
                Some(Some(Load::By(along?, table?)))
            }
        }
    };
    let force = load(["force", "force_by"], "force_N");
    let torque = load(["torque", "torque_by"], "torque_N_m");
    let drag = section.optional("drag", |given| drag(&given.section()?, around.gravity));
    Some(Push { force: force?, torque: torque?, drag: drag? })
}

fn drag(section: &Section, gravity: Vec3) -> Option<Drag> {
    let words = [("stokes", DragLaw::Stokes), ("schiller-naumann", DragLaw::SchillerNaumann)];
    let law = section.require("law").and_then(|given| given.one_of(&words));
    let viscosity = section.number("viscosity");
    let velocity = section.vector_or("velocity", Vec3::zeros());
    let buoyancy = section.boolean_or("buoyancy", false);
    let needs_density = law == Some(DragLaw::SchillerNaumann) || buoyancy == Some(true);
    let density =
        if needs_density { section.number("density") } else { section.number_or("density", 0.0) };
    if !needs_density {
        section.refuse("density", "needs `law = \"schiller-naumann\"` or `buoyancy = true`");
    }
    let lift = if buoyancy? { gravity * -density? } else { Vec3::zeros() };
    Some(Drag { law: law?, viscosity: viscosity?, density: density?, velocity: velocity?, lift })
}

/// Rejects held groups of particles that come within the stage: they would stay where they appear.
fn check_newcomers(section: &Section, group: &Group, around: &Around, inlets: &[Inlet]) {
    if !group.is_held() {
        return;
    }
    if group.who.by_inlet {
        section.refuse(
            "inlets",
            "insert particles, so their motion cannot be prescribed; use a force, or leave them \
             out",
        );
    } else if group.takes_newcomers() {
        let mixes = inlets.iter().map(|inlet| &inlet.mix).chain(around.rain.map(|rain| &rain.mix));
        if mixes.flat_map(Mix::shapes).any(|shape| group.may_have(shape)) {
            section.fail("prescribes the motion of shapes that rain or inlets insert; name a `region` or `ids`, or \
                 use a separate shape");
        }
    }
}

/// Checks that groups do not move too far in a step of `dt` [s], and that drag is not too strong
/// for it.
pub(super) fn check_speeds(root: &Section, groups: &[Group], library: &Library, dt: f64) {
    for (section, group) in root.sections("group").iter().zip(groups) {
        match &group.what {
            GroupMotion::Held(path) => {
                let (shifts, _) = path.course.fastest();
                let speed = shifts.iter().map(Vec3::norm).sum::<f64>();
                if let Some(most) = too_far(speed, Some(dt), library) {
                    section.fail(format!(
                        "moves by up to {:.2e} m per step, over {} % of the shortest particle axis; must be at most \
                         {:.2e} m/s",
                        speed * dt,
                        100.0 * LONGEST_MOVE,
                        printed_limit(most) / dt
                    ));
                }
            }
            GroupMotion::Pushed(push) => {
                let rate = |(shape, scale): (ShapeId, f64)| {
                    push.drag.map_or(0.0, |drag| drag.rate_at_rest(library, shape, scale))
                };
                let shapes = library.extremes().filter(|&(shape, _)| group.may_have(shape));
                let fastest = shapes.map(rate).fold(0.0, f64::max);
                if fastest * dt >= 2.0
                    && let Some(given) = section.get("drag")
                {
                    given.fail(format!(
                        "reverses velocities in one step; the time step must be less than {:.2e} s",
                        printed_limit(2.0 / fastest)
                    ));
                }
            }
        }
    }
}
