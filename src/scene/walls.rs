//! Walls and their motions, from the parsed file.

mod servos;

pub(super) use servos::{highest_stress, stress_of_force};

use super::matter::{Materials, Names};
use super::mistakes::suggestion;
use super::motions::{Motions, axis_of_turn};
use super::pieces::turn;
use super::reader::{Given, Section};
use crate::cell::{AXES, Cell, SIDES};
use crate::contact::Method;
use crate::drive::free::FreeWall;
use crate::ids::MaterialId;
use crate::math::{Quat, Vec3, printed_limit};
use crate::population::Library;
use crate::shape::triangle_mesh::TriangleMesh;
use crate::shape::{HalfSpace, Kind, LENGTHS, Shape, mesh};
use crate::text::{MOST_NAMED, listed};
use crate::walls::{TorqueAbout, Wall};
use std::collections::BTreeSet;
use std::path::Path;

/// Largest motion of a wall in a step, over the shortest axis of any particle.
pub(super) const LONGEST_MOVE: f64 = 0.05;

/// Error for a wall of this speed [m/s], if it moves too far in a step of `dt` [s].
fn too_fast(speed: f64, dt: Option<f64>, library: &Library) -> Option<String> {
    let most = too_far(speed, dt, library)?;
    Some(format!(
        "({speed:?} m/s) moves a wall by {:.2e} m per step, over {} % of the shortest particle axis; must be at most \
         {:.2e} m/s",
        speed * dt?,
        100.0 * LONGEST_MOVE,
        printed_limit(most) / dt?
    ))
}

/// Largest motion of a wall in a step [m], if one of this speed [m/s] exceeds it in a step of `dt` [s].
pub(super) fn too_far(speed: f64, dt: Option<f64>, library: &Library) -> Option<f64> {
    let (dt, most) = (dt?, LONGEST_MOVE * 2.0 * library.least_inscribed_radius());
    (speed * dt > most).then_some(most)
}

/// Factor by which a wall with this motion in a step [m] is too fast for the largest allowed one [m].
fn slower_by(way: f64, most: f64) -> f64 {
    1.005 * way / most
}

/// A wall that is not yet in the library.
struct Planned {
    wall: Wall,
    material: MaterialId,
    has_servo: bool,
}

impl Planned {
    fn moves(&self) -> bool {
        moves(&self.wall, self.has_servo)
    }
}

fn moves(wall: &Wall, has_servo: bool) -> bool {
    has_servo
        || wall.velocity != Vec3::zeros()
        || wall.turns()
        || wall.course.is_some()
        || wall.mass.is_finite()
}

/// Walls on sides of the domain, then all others; `None` for invalid ones.
pub(super) struct Walls<'a> {
    names: Names,
    motions: Motions<'a>,
    all: Vec<Option<Planned>>,
}

impl<'a> Walls<'a> {
    pub(super) fn read(
        root: &Section<'a>,
        domain_section: Option<&Section>,
        domain: Option<&Cell>,
        materials: &Materials,
        folder: &Path,
    ) -> Self {
        let motions = Motions::read(root, domain, folder);
        let mut walls = Self { names: Names::of("wall"), motions, all: Vec::new() };
        if let Some(section) = domain_section {
            walls.read_sides(section, domain, materials);
            walls.read_velocities(section);
        }
        for section in root.sections("wall") {
            walls.names.add(&section);
            let name = walls.names.all.last().cloned().unwrap_or_default();
            walls.all.push(planned(name, &section, domain, materials, folder));
        }
        walls.motions.check(|given, name| {
            if walls.names.index(name).is_none() {
                let hint = suggestion(name, walls.names.listing(), "there are");
                given.fail(format!("no such wall{hint}"));
            }
        });
        for (name, planned) in walls.names.all.iter().zip(&mut walls.all) {
            if let Some(Planned { wall, .. }) = planned {
                if let Some(about) = walls.motions.about(name) {
                    wall.refer_to(about);
                }
                if wall.mesh.is_some() {
                    let along = |given: &Given, along: &Vec3| stays_in_period(given, along, domain);
                    walls.motions.ways_along(name, along);
                }
                walls.motions.move_wall(name, wall);
            }
        }
        walls
    }

    fn read_sides(&mut self, section: &Section, domain: Option<&Cell>, materials: &Materials) {
        let Some(given) = section.get("walls") else {
            if let Some(material) = section.get("wall_material") {
                material.fail("needs `walls` in [domain]");
            }
            return;
        };
        let material = materials.find_in(section, "wall_material");
        let sides = SIDES.map(|(name, ..)| (name, name));
        let items = given.list();
        for item in items.unwrap_or_default() {
            let side = item.one_of(&sides);
            let name = side.unwrap_or_default();
            if side.is_some() && self.names.index(name).is_some() {
                item.fail("this side has a wall already");
            }
            self.names.push(name);
            self.all.push(side.zip(domain).and_then(|(name, domain)| {
                let face = domain.faces().into_iter().find(|face| face.name == name)?;
                if face.repeats {
                    item.fail(format!("{} is periodic, so it has no walls", AXES[face.axis]));
                }
                let wall = Wall::plane(name.to_owned(), face.point, face.normal);
                Some(Planned { wall, material: material?, has_servo: false })
            }));
        }
    }

    fn read_velocities(&mut self, section: &Section) {
        let Some(given) = section.get("wall_velocity") else { return };
        for (name, given) in given.entries().unwrap_or_default() {
            let velocity = given.vector();
            let Some(k) = self.names.index(name) else {
                let hint = suggestion(name, self.names.listing(), "there are");
                given.fail(format!("no such wall in `domain.walls`{hint}"));
                continue;
            };
            if let (Some(planned), Some(velocity)) = (&mut self.all[k], velocity) {
                planned.wall.velocity = velocity;
            }
        }
    }

    /// Checks that walls are not too fast towards or from the particles for a time step of `dt` [s].
    pub(super) fn check_speeds(
        &self,
        root: &Section,
        domain_section: Option<&Section>,
        domain: Option<&Cell>,
        library: &Library,
        dt: Option<f64>,
    ) {
        let sides = domain_section.and_then(|section| section.get("wall_velocity"));
        let mut places = sides.and_then(|given| given.entries()).unwrap_or_default();
        let others = root.sections("wall");
        let velocities = others.iter().map(|section| section.get("velocity"));
        let names = self.names.all[self.all.len() - others.len()..].iter();
        places.extend(
            names.zip(velocities).filter_map(|(name, given)| Some((name.as_str(), given?))),
        );
        self.check_courses(domain, library, dt);
        let rotations = others.iter().map(|section| section.get("rotation"));
        for (planned, given) in self.all[self.all.len() - others.len()..].iter().zip(rotations) {
            let (Some(Planned { wall, .. }), Some(given), Some(domain)) = (planned, given, domain)
            else {
                continue;
            };
            if wall.course.is_some() {
                continue;
            }
            let mut turning = wall.clone();
            turning.velocity = Vec3::zeros();
            let room = domain.corners();
            let (rate, speed) = (wall.angular_velocity.norm(), turning.way(1.0, &room));
            let both = wall.way(1.0, &room);
            if let (Some(dt), Some(most)) = (dt, too_far(speed, dt, library)) {
                given.fail(format!(
                    "({rate:?} rad/s) moves the wall by up to {:.2e} m per step within the domain, over {} % of the \
                     shortest particle axis; `rate` must be at most {:.2e} rad/s",
                    speed * dt,
                    100.0 * LONGEST_MOVE,
                    printed_limit(rate) * most / (speed * dt)
                ));
            } else if let (Some(dt), Some(most)) = (dt, too_far(both, dt, library))
                && too_far(wall.speed_inwards().abs(), Some(dt), library).is_none()
            {
                given.fail(format!(
                    "with `velocity` it moves the wall by up to {:.2e} m per step within the domain, over {} % of the \
                     shortest particle axis; reduce both by a factor {:.2e}, or `step`",
                    both * dt,
                    100.0 * LONGEST_MOVE,
                    slower_by(both * dt, most)
                ));
            }
        }
        for (name, given) in places {
            let k = self.names.index(name);
            let Some(planned) = k.and_then(|k| self.all[k].as_ref()) else { continue };
            if planned.wall.course.is_some() {
                // Checked above.
                continue;
            }
            if let Some(wrong) = too_fast(planned.wall.speed_inwards().abs(), dt, library) {
                given.fail(wrong);
            }
        }
    }

    /// Checks the speeds of walls that follow a course.
    fn check_courses(&self, domain: Option<&Cell>, library: &Library, dt: Option<f64>) {
        self.motions.check(|given, name| {
            let k = self.names.index(name);
            let (Some(Planned { wall, .. }), Some(domain)) = (k.and_then(|k| self.all[k].as_ref()), domain) else {
                return;
            };
            let Some(course) = &wall.course else { return };
            let (shifts, turn) = course.fastest();
            let (mut wall, room) = (wall.clone(), domain.corners());
            wall.angular_velocity = Vec3::zeros();
            let mut speed = 0.0;
            for shift in shifts {
                wall.velocity = shift;
                speed += wall.way(1.0, &room);
            }
            (wall.velocity, wall.angular_velocity) = (Vec3::zeros(), turn);
            speed += wall.way(1.0, &room);
            if let (Some(dt), Some(most)) = (dt, too_far(speed, dt, library)) {
                given.fail(format!(
                    "moves by up to {:.2e} m per step along its normal within the domain, over {} % of the shortest \
                     particle axis; reduce motions by a factor {:.2e}, or `step`",
                    speed * dt,
                    100.0 * LONGEST_MOVE,
                    slower_by(speed * dt, most)
                ));
            }
        });
    }

    /// Walls that move freely, under gravity [m/s²].
    pub(super) fn free(&self, gravity: Vec3) -> Vec<FreeWall> {
        let free = |(wall, name): (usize, &String)| {
            let (along, mass, force) = self.motions.free(name)?;
            Some(FreeWall { wall, along, mass, load: force + mass * gravity.dot(&along) })
        };
        self.names.all.iter().enumerate().filter_map(free).collect()
    }

    /// Highest stress of walls that move freely, as far as it is known [Pa].
    pub(super) fn stress_of_free(&self, free: &[FreeWall], domain: Option<&Cell>) -> f64 {
        let wall = |planned: &Option<Planned>| planned.as_ref().map(|p| p.wall.clone());
        let walls: Option<Vec<Wall>> = self.all.iter().map(wall).collect();
        let (Some(walls), Some(domain)) = (walls, domain) else { return 0.0 };
        free.iter().filter_map(|free| free.stress(&walls, domain)).fold(0.0, f64::max)
    }

    /// Checks that surfaces have contacts with the shapes of the particles, and prepares triangle meshes for particles with
    /// faces.
    pub(super) fn check_surfaces(&mut self, root: &Section, library: &Library, method: &Method) {
        let all = || library.names.iter().zip(&library.shapes).take(library.own_shapes());
        let all_names = |is: fn(Kind) -> bool| {
            let of = all().filter(|(_, shape)| is(shape.kind()));
            let name =
                |(name, shape): (&String, &Shape)| format!("`{name}` ({})", shape.kind().name());
            listed(of.map(name), MOST_NAMED)
        };
        let faces = all_names(Kind::has_faces);
        // Shapes whose contacts have an extent.
        let extended = all_names(|kind| kind.extended()[0] > 0);
        let farthest = library.longest_with_faces();
        let sections = root.sections("wall");
        let first = self.all.len() - sections.len();
        let given = sections.iter().enumerate().flat_map(|(k, section)| {
            SURFACES.map(|key| section.get(key).map(|given| (first + k, key, given)))
        });
        for (planned, key, given) in given.flatten() {
            if extended.is_empty() {
                continue;
            }
            if key != "mesh" && !faces.is_empty() {
                given.fail(format!(
                    "is in a scene with {faces}: cylinders and cones have no contacts with particles that have faces. \
                     Use a `mesh`, as `run/revolve` writes it, or planes"
                ));
                continue;
            }
            // The method treats all such pairs alike.
            let pair = (Kind::Polyhedron, Kind::TriangleMesh);
            if !method.is_by_thickness(pair) {
                given.fail(format!(
                    "is in a scene with {extended}: its contacts with particles that have faces or straight sides \
                     need the method \"auto\", not \"{}\"",
                    method.name()
                ));
                continue;
            }
            if faces.is_empty() {
                continue;
            }
            let wall = self.all.get_mut(planned).and_then(Option::as_mut);
            if let Some(Err(error)) = wall.map(|planned| planned.wall.add_cells(farthest)) {
                given.fail(format!(
                    "{error}; particles with faces ({faces}) need a surface with two sides"
                ));
            }
        }
    }

    /// Number of shapes that they need.
    pub(super) fn count(&self) -> usize {
        let shapes = |planned: &Option<Planned>| planned.as_ref().map_or(1, |p| p.wall.shapes());
        self.all.iter().map(shapes).sum()
    }

    /// Motions of walls and of groups of particles.
    pub(super) const fn motions(&self) -> &Motions<'a> {
        &self.motions
    }

    /// Is this the name of a wall?
    pub(super) fn has(&self, name: &str) -> bool {
        self.names.index(name).is_some()
    }

    /// All valid walls.
    pub(super) fn known(&self) -> impl Iterator<Item = &Wall> {
        self.all.iter().flatten().map(|planned| &planned.wall)
    }

    /// All valid walls that do not move.
    pub(super) fn still(&self) -> impl Iterator<Item = &Wall> {
        self.all.iter().flatten().filter(|planned| !planned.moves()).map(|planned| &planned.wall)
    }

    /// Adds a plane of each material of the walls to a library that has none yet.
    pub(super) fn stand_in(&self, library: &mut Library) {
        let materials = self.all.iter().flatten().map(|planned| planned.material);
        for material in materials.collect::<BTreeSet<_>>() {
            let plane = Shape::HalfSpace(HalfSpace::at_reference(Vec3::z()));
            library.push("", plane, material, f64::INFINITY);
        }
    }

    /// Walls, with their shapes added to the library.
    pub(super) fn into_library(self, library: &mut Library) -> Option<Vec<Wall>> {
        let all: Option<Vec<Planned>> = self.all.into_iter().collect();
        let wall = |Planned { mut wall, material, has_servo }| {
            wall.enter(library, material);
            wall.moves = moves(&wall, has_servo);
            if wall.torque.is_none() && wall.may_turn() {
                wall.torque = Some(TorqueAbout::Reference);
            }
            wall
        };
        Some(all?.into_iter().map(wall).collect())
    }
}

/// Is a wall driven by something other than forces?
pub(super) fn are_driven(root: &Section) -> bool {
    let has = |section: &Section, key| section.get(key).is_some();
    root.section("domain").is_some_and(|domain| has(&domain, "wall_velocity"))
        || root.sections("wall").iter().any(|wall| has(wall, "velocity"))
        || root.sections("motion").iter().any(|motion| !has(motion, "mass"))
}

/// Planes of a wall, one or several: a point [m] and a normal each.
fn planes(section: &Section, domain: Option<&Cell>) -> Option<Vec<(Vec3, Vec3)>> {
    if section.get("planes").is_none() {
        return plane(section, domain).map(|plane| vec![plane]);
    }
    for key in ["point", "normal"] {
        if let Some(given) = section.get(key) {
            given.fail("not with `planes`; write it as one of them");
        }
    }
    let planes = section.sections("planes");
    let read: Vec<_> = planes.iter().map(|section| plane(section, domain)).collect();
    read.into_iter().collect()
}

/// Facets of a surface, with its images in a periodic domain.
fn meshed(surface: Surface, domain: Option<&Cell>) -> Option<TriangleMesh> {
    match surface {
        Surface::Triangles(given, Triangles { mut corners, shift, rounded, weld, smooth }) => {
            let own = corners.len();
            add_images(&given, &mut corners, (&shift, rounded), domain);
            let mesh = TriangleMesh::with_images(&corners, own, weld, smooth);
            mesh.map_err(|error| given.fail(error)).ok()
        }
        Surface::OfRevolution { given, from, to, radii } => {
            let surface = TriangleMesh::of_revolution(&Vec3::zeros(), &(to - from), radii);
            Some(surface.going_on(beyond_ends(&given, (&from, &to), radii, domain)))
        }
    }
}

/// A wall from a `[[wall]]`.
fn planned(
    name: String,
    section: &Section,
    domain: Option<&Cell>,
    materials: &Materials,
    folder: &Path,
) -> Option<Planned> {
    let chosen = SURFACES.into_iter().find_map(|key| Some((key, section.get(key)?)));
    let surface = chosen.map(|chosen| surface(section, chosen, folder));
    let planes = if surface.is_some() { Some(Vec::new()) } else { self::planes(section, domain) };
    let velocity = section.vector_or("velocity", Vec3::zeros());
    let rotation =
        section.read_or("rotation", None, |given| rotation(&given.section()?, domain).map(Some));
    let surface_velocity = section.vector_or("surface_velocity", Vec3::zeros());
    let material = materials.find_in(section, "material");
    let torque_about = section.read_or("torque_about", None, |given| {
        given.vector().map(|point| Some(TorqueAbout::Fixed(point)))
    });
    let wears = section.boolean_or("wear", false);

    let torque = torque_about?;
    let wears = wears?;
    let (planes, rotation, surface_velocity) = (planes?, rotation?, surface_velocity?);
    if let Some(given) = section.get("surface_velocity")
        && !planes.is_empty()
        && surface_velocity != Vec3::zeros()
        && planes.iter().all(|(_, normal)| is_across(&surface_velocity, normal))
    {
        given.fail("has no component in the plane: a surface moves in its own plane; for other motion use `velocity`");
    }
    if let Some(surface) = surface {
        let surface = surface?;
        let origin = surface.origin();
        let surface = meshed(surface, domain)?;
        if let Some(given) = section.get("velocity") {
            stays_in_period(&given, &velocity?, domain);
        }
        let mut wall = Wall::of_mesh(name, origin, surface);
        if let Some((about, _)) = rotation {
            wall.refer_to(about);
        }
        wall.velocity = velocity?;
        wall.angular_velocity = rotation.map_or_else(Vec3::zeros, |(_, velocity)| velocity);
        wall.surface_velocity = surface_velocity;
        (wall.torque, wall.wears) = (torque, wears);
        return Some(Planned { wall, material: material?, has_servo: false });
    }
    let reference = match (rotation, &*planes) {
        (Some((about, _)), _) => about,
        (None, [(point, _), ..]) => *point,
        (None, []) => return None,
    };
    let mut wall = Wall::of_planes(name, reference, &planes);
    wall.velocity = velocity?;
    wall.angular_velocity = rotation.map_or_else(Vec3::zeros, |(_, velocity)| velocity);
    wall.surface_velocity = surface_velocity;
    (wall.torque, wall.wears) = (torque, wears);
    Some(Planned { wall, material: material?, has_servo: false })
}

/// Is a velocity along this normal, except for rounding?
fn is_across(velocity: &Vec3, normal: &Vec3) -> bool {
    velocity.cross(normal).norm() <= 1e-9 * velocity.norm()
}

/// A surface that does not consist of planes.
enum Surface<'a> {
    Triangles(Given<'a>, Triangles),
    /// Cylinder or cone: the ends of its axis [m], and the radii there [m].
    OfRevolution {
        given: Given<'a>,
        from: Vec3,
        to: Vec3,
        radii: [f64; 2],
    },
}

impl Surface<'_> {
    /// Origin of the wall's axes, unless it is set otherwise [m].
    const fn origin(&self) -> Vec3 {
        match self {
            Self::Triangles(_, Triangles { shift, .. }) => *shift,
            Self::OfRevolution { from, .. } => *from,
        }
    }
}

/// Keys of surfaces that do not consist of planes.
const SURFACES: [&str; 3] = ["mesh", "cylinder", "cone"];

/// All surfaces of a scene that do not consist of planes.
pub(super) fn surfaces<'a>(root: &Section<'a>) -> Vec<Given<'a>> {
    let walls = root.sections("wall");
    walls.iter().flat_map(|wall| SURFACES.map(|key| wall.get(key))).flatten().collect()
}

/// Surface of a wall that does not consist of planes, from its key.
fn surface<'a>(
    section: &Section<'a>,
    (key, given): (&str, Given<'a>),
    folder: &Path,
) -> Option<Surface<'a>> {
    for other in
        ["point", "normal", "planes"].into_iter().chain(SURFACES).filter(|other| *other != key)
    {
        if let Some(other) = section.get(other) {
            other.fail(format!("not with `{key}`; a wall has one surface"));
        }
    }
    if key == "mesh" {
        return triangles(&given, section, folder)
            .map(|of_file| Surface::Triangles(given, of_file));
    }
    for of_files in ["scale", "turn", "shift", "weld", "smooth"] {
        section.refuse(of_files, "needs a `mesh`");
    }
    of_revolution(given, key == "cone")
}

/// Cylinder, or cone with a radius at each end.
fn of_revolution(given: Given, is_cone: bool) -> Option<Surface> {
    let section = given.section()?;
    let (from, to) = (section.vector("from"), section.vector("to"));
    let radii = if is_cone {
        section.require("radius").and_then(|given| given.list_of(Given::number))
    } else {
        section.number("radius").map(|radius| [radius; 2])
    };
    let (from, to, radii) = (from?, to?, radii?);
    if from == to {
        given.fail("`from` and `to`, the ends of its axis, are the same point");
        return None;
    }
    if radii == [0.0; 2] {
        given.fail("needs a radius at one end");
        return None;
    }
    Some(Surface::OfRevolution { given, from, to, radii })
}

/// Distance over the period below which a corner counts as lying on a periodic border.
const ON_BORDER: f64 = 1e-9;
/// Largest relative rounding of numbers in STL, which have 24 bits or seven digits.
const ROUNDED_IN_STL: f64 = 5e-7;
/// Largest distance for welding corners, over the median side of the triangles.
const WIDEST_WELD: f64 = 0.1;

/// Adds the images of triangles beyond the periods of the domain, as far as the shortest distance between two particles can
/// reach. Corners are shifted into the domain [m]. Corners within the rounding of the file [m] of a border are put on it
/// exactly, so that images are connected.
fn add_images(
    given: &Given,
    corners: &mut Vec<[Vec3; 3]>,
    (shift, rounded): (&Vec3, Vec3),
    domain: Option<&Cell>,
) {
    let Some(domain) = domain.filter(|domain| domain.repeats()) else { return };
    corners.iter_mut().flatten().for_each(|corner| *corner += shift);
    let (lowest, highest) = domain.corners();
    for axis in domain.repeating_axes() {
        let (low, high) = (lowest[axis], highest[axis]);
        let period = high - low;
        let near = rounded[axis].max(ON_BORDER * period);
        let places = || corners.iter().flatten().map(|corner| corner[axis]);
        let (from, to) =
            places().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
        if from < low - near || to > high + near {
            given.fail(format!(
                "reaches from {from:e} to {to:e} m along {}, beyond the period from {low:e} to {high:e} m: cut it \
                 there, so that its ends match across the period",
                AXES[axis]
            ));
            continue;
        }
        for corner in corners.iter_mut().flatten() {
            for border in [low, high] {
                if (corner[axis] - border).abs() <= near {
                    corner[axis] = border;
                }
            }
        }
        let shifted = |x: f64, up: bool| match up {
            true if x == low => high,
            false if x == high => low,
            true => x + period,
            false => x - period,
        };
        let reaches = |triangle: &[Vec3; 3], up: bool| {
            triangle.iter().any(|corner| {
                if up {
                    corner[axis] < high + 0.5 * period
                } else {
                    corner[axis] > low - 0.5 * period
                }
            })
        };
        let mut images = Vec::new();
        for up in [true, false] {
            let image = |triangle: &[Vec3; 3]| {
                triangle.map(|mut corner| {
                    corner[axis] = shifted(corner[axis], up);
                    corner
                })
            };
            images.extend(corners.iter().map(image).filter(|triangle| reaches(triangle, up)));
        }
        corners.extend(images);
    }
    corners.iter_mut().flatten().for_each(|corner| *corner -= shift);
}

/// Length by which a cylinder continues beyond its ends [m], if it spans a period.
fn beyond_ends(
    given: &Given,
    (from, to): (&Vec3, &Vec3),
    radii: [f64; 2],
    domain: Option<&Cell>,
) -> f64 {
    let Some(domain) = domain else { return 0.0 };
    let Some(axis) = domain.repeating_axes().next() else { return 0.0 };
    let (lowest, highest) = domain.corners();
    let (low, high) = (lowest[axis], highest[axis]);
    let way = to - from;
    let goes_through = way[axis].abs() == way.norm()
        && (from[axis].min(to[axis]) - low).abs() <= ON_BORDER * (high - low)
        && (from[axis].max(to[axis]) - high).abs() <= ON_BORDER * (high - low);
    let is_alone = domain.repeating_axes().count() == 1;
    if radii[0] != radii[1] || !goes_through || !is_alone {
        given.fail(format!(
            "the domain is periodic along {}: a cylinder must span this period, from {low:e} to {high:e} m, and no \
             other axis may be periodic; cones are not possible. Use a `mesh`",
            AXES[axis]
        ));
    }
    0.5 * (high - low)
}

/// Rejects motions that take a surface out of the period; its images move with it.
fn stays_in_period(given: &Given, along: &Vec3, domain: Option<&Cell>) {
    if let Some(axis) = domain.and_then(|domain| domain.repeats_along(along)) {
        given.fail(format!(
            "must be 0 along {}, which is periodic: only walls of planes can leave the period",
            AXES[axis]
        ));
    }
}

/// Triangles of a wall from a file.
struct Triangles {
    /// Corners, scaled and turned, not yet shifted [m].
    corners: Vec<[Vec3; 3]>,
    /// Shift [m].
    shift: Vec3,
    /// Largest error of the corners from the digits of the file [m].
    rounded: Vec3,
    /// Distance within which corners are joined [m].
    weld: f64,
    /// Largest angle of smooth edges [rad].
    smooth: f64,
}

/// Default for the largest angle of smooth edges [°]: that of a cylinder of 36 strips.
const SMOOTH: f64 = 10.0;

fn triangles(given: &Given, section: &Section, folder: &Path) -> Option<Triangles> {
    let scale = section.number_or("scale", 1.0);
    let turn = section.read_or("turn", Quat::identity(), turn);
    let shift = section.vector_or("shift", Vec3::zeros());
    let weld = section.number_or("weld", 0.0);
    let smooth = section.number_or("smooth", SMOOTH);
    let path = folder.join(given.text()?);
    let corners = mesh::triangles(&path).map_err(|error| given.fail(error)).ok()?;
    if let Some(lost) = mesh::lost_digits(&path, &corners) {
        given.warn(format!("{lost}, and shift the wall by `shift`"));
    }
    let (scale, turn) = (scale?, turn?);
    let placed = |corner: Vec3| {
        let corner = corner * scale;
        if turn == Quat::identity() { corner } else { turn * corner }
    };
    let corners: Vec<_> = corners.into_iter().map(|triangle| triangle.map(placed)).collect();
    if corners
        .iter()
        .flatten()
        .any(|corner| corner.iter().any(|x| x.is_nan() || x.abs() > *LENGTHS.end()))
    {
        given.fail(format!(
            "has corners farther than {:e} m from the origin, with `scale`",
            LENGTHS.end()
        ));
        return None;
    }
    if let (Some(weld), Some(given)) = (weld, section.get("weld")) {
        let side = median_side(&corners);
        if weld > WIDEST_WELD * side {
            given.fail(format!(
                "must be far less than the sides of the triangles, or separate corners merge: at most {:e} m, a tenth \
                 of their median",
                printed_limit(WIDEST_WELD * side)
            ));
        }
    }
    let is_stl = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("stl"));
    let mut largest = corners.iter().flatten().fold(Vec3::zeros(), |all, one| all.sup(&one.abs()));
    if turn != Quat::identity() {
        largest.fill(largest.amax());
    }
    let rounded = if is_stl { largest * ROUNDED_IN_STL } else { Vec3::zeros() };
    Some(Triangles { corners, shift: shift?, rounded, weld: weld?, smooth: smooth?.to_radians() })
}

/// Median side of triangles [m].
fn median_side(corners: &[[Vec3; 3]]) -> f64 {
    let side = |[a, b, c]: &[Vec3; 3]| [(b - a).norm(), (c - b).norm(), (a - c).norm()];
    let mut sides: Vec<f64> = corners.iter().flat_map(side).collect();
    let middle = sides.len() / 2;
    if sides.is_empty() { 0.0 } else { *sides.select_nth_unstable_by(middle, f64::total_cmp).1 }
}

/// A point of a plane [m] and its unit normal.
fn plane(section: &Section, domain: Option<&Cell>) -> Option<(Vec3, Vec3)> {
    let point = section.vector("point");
    let normal = section.require("normal").and_then(|given| {
        let normal = given.direction()?;
        if let Some(axis) = domain.and_then(|domain| domain.repeats_along(&normal)) {
            given.fail(format!("must be 0 along {}, which is periodic", AXES[axis]));
        }
        Some(normal)
    });
    Some((point?, normal?))
}

/// Point about which a wall turns [m], and its angular velocity [rad/s].
pub(super) fn rotation(section: &Section, domain: Option<&Cell>) -> Option<(Vec3, Vec3)> {
    let (about, axis) = axis_of_turn(section, domain);
    let rate = section.number("rate");
    Some((about?, axis? * rate?))
}
