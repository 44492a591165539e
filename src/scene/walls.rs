//! Walls and what moves them: from the file as written.

use super::matter::{Materials, Names};
use super::reader::{Given, Range, Section};
use super::report::suggestion;
use crate::cell::{AXES, Cell};
use crate::drive::rain::Rain;
use crate::drive::servo::Servo;
use crate::ids::MaterialId;
use crate::math::Vec3;
use crate::particles::Library;
use crate::particles::walls::Wall;
use crate::shape::{HalfSpace, Shape};

/// The most that a wall may move in a step, over the shortest axis of any grain.
const LONGEST_MOVE: f64 = 0.05;

/// What is wrong with a wall of this speed [m/s], if it moves too far in a step of `dt` [s].
fn too_fast(speed: f64, dt: Option<f64>, library: &Library) -> Option<String> {
    let (dt, most) = (dt?, LONGEST_MOVE * 2.0 * library.least_inscribed_radius());
    (speed * dt > most).then(|| {
        format!(
            "({speed:?} m/s) moves a wall by {:.2e} m in a step, more than {} % of the shortest axis of \
             the smallest grain; must be at most {:.2e} m/s",
            speed * dt,
            100.0 * LONGEST_MOVE,
            0.995 * most / dt
        )
    })
}

/// A wall on its way into the library.
struct Plane {
    point: Vec3,
    normal: Vec3,
    velocity: Vec3,
    material: MaterialId,
    has_servo: bool,
}

/// The walls on sides of the domain, then all others; `None` for what is wrong.
pub(super) struct Walls {
    names: Names,
    planes: Vec<Option<Plane>>,
}

impl Walls {
    pub(super) fn read(
        root: &Section,
        domain_section: Option<&Section>,
        domain: Option<&Cell>,
        materials: &Materials,
    ) -> Self {
        let mut walls = Self { names: Names::of("wall"), planes: Vec::new() };
        if let Some(section) = domain_section {
            walls.read_sides(section, domain, materials);
            walls.read_velocities(section);
            section.finish();
        }
        for section in root.sections("wall") {
            walls.names.add(&section);
            walls.planes.push(plane(&section, domain, materials));
        }
        walls
    }

    fn read_sides(&mut self, section: &Section, domain: Option<&Cell>, materials: &Materials) {
        let Some(given) = section.get("walls") else {
            if let Some(material) = section.get("wall_material") {
                material.fail("there are no `walls` in [domain] for it");
            }
            return;
        };
        let material = materials.find_in(section, "wall_material");
        let words = ["-x", "+x", "-y", "+y", "-z", "+z"].map(|word| (word, word));
        let items = given.list("a list of sides: \"-x\", \"+x\", \"-y\", \"+y\", \"-z\", \"+z\"");
        for item in items.unwrap_or_default() {
            let name = item.one_of(&words);
            if name.is_some_and(|name| self.names.names.iter().any(|n| n == name)) {
                item.fail("this side has a wall already");
            }
            self.names.names.push(name.unwrap_or_default().to_owned());
            self.planes.push(name.zip(domain).and_then(|(name, domain)| {
                let axis = AXES.iter().position(|axis| name.ends_with(axis))?;
                if domain.period(axis).is_some() {
                    item.fail(format!("{} is periodic, it has no walls", AXES[axis]));
                }
                let low = name.starts_with('-');
                let mut normal = Vec3::zeros();
                normal[axis] = if low { 1.0 } else { -1.0 };
                Some(Plane {
                    point: if low { domain.low() } else { domain.high() },
                    normal,
                    velocity: Vec3::zeros(),
                    material: material?,
                    has_servo: false,
                })
            }));
        }
    }

    fn read_velocities(&mut self, section: &Section) {
        let Some(given) = section.get("wall_velocity") else { return };
        let Some(entries) = given.entries() else {
            given.fail("must be a table, as in { \"+z\" = [0, 0, -0.001] } [m/s]");
            return;
        };
        for (name, given) in entries {
            let velocity = given.vector(Range::Any, "m/s");
            let Some(k) = self.names.names.iter().position(|n| n == name) else {
                let hint = suggestion(name, self.names.listing(), "there are");
                given.fail(format!("no such wall in `domain.walls`{hint}"));
                continue;
            };
            if let (Some(plane), Some(velocity)) = (&mut self.planes[k], velocity) {
                plane.velocity = velocity;
            }
        }
    }

    /// Looks whether walls go too fast along their normals for the grains and a time step of `dt` [s].
    pub(super) fn check_speeds(
        &self,
        root: &Section,
        domain_section: Option<&Section>,
        library: &Library,
        dt: Option<f64>,
    ) {
        let sides = domain_section.and_then(|section| section.get("wall_velocity"));
        let mut places = sides.and_then(|given| given.entries()).unwrap_or_default();
        let others = root.sections("wall");
        let velocities = others.iter().map(|section| section.get("velocity"));
        let names = self.names.names[self.planes.len() - others.len()..].iter();
        places.extend(
            names.zip(velocities).filter_map(|(name, given)| Some((name.as_str(), given?))),
        );
        for (name, given) in places {
            let k = self.names.names.iter().position(|known| known == name);
            let Some(plane) = k.and_then(|k| self.planes[k].as_ref()) else { continue };
            let speed = plane.velocity.dot(&plane.normal).abs();
            if let Some(wrong) = too_fast(speed, dt, library) {
                given.fail(wrong);
            }
        }
    }

    /// The servos; the walls hear of them. `dt` is the time step [s], if that and all shapes are known.
    pub(super) fn read_servos(
        &mut self,
        root: &Section,
        domain: Option<&Cell>,
        library: &Library,
        dt: Option<f64>,
    ) -> Option<Vec<Servo>> {
        let sections = root.sections("servo");
        let servos: Vec<_> = sections.iter().map(|s| self.servo(s, domain, library, dt)).collect();
        Some(servos.into_iter().collect::<Option<Vec<_>>>()?.concat())
    }

    /// The servos of one `[[servo]]`: one of all its walls, or one of each.
    fn servo(
        &mut self,
        section: &Section,
        domain: Option<&Cell>,
        library: &Library,
        dt: Option<f64>,
    ) -> Option<Vec<Servo>> {
        let walls = section.require("walls", "names of walls, as in [\"-x\", \"+x\"]", |given| {
            let items = given.list("a list of names of walls, as in [\"-x\", \"+x\"]")?;
            if items.is_empty() {
                given.fail("must have at least one wall");
            }
            let walls = items.iter().map(|item| self.steered(item, domain));
            walls.collect::<Vec<_>>().into_iter().collect::<Option<Vec<usize>>>()
        });
        let stress = section.number("stress", Range::Positive, "Pa");
        let max_speed = section.number_or("max_speed", 1.0, Range::Positive, "m/s");
        let gain = section.number_or("gain", 1.0, Range::Positive, "");
        let coupled = section.read_or("coupled", false, Given::boolean);
        section.finish();
        if let Some(wrong) = max_speed.and_then(|speed| too_fast(speed, dt, library)) {
            section.fail(format!("`max_speed` {wrong}"));
        }
        let (walls, stress, max_speed, gain) = (walls?, stress?, max_speed?, gain?);
        let servo = |walls| Servo { walls, stress, max_speed, gain };
        if !coupled? {
            return Some(walls.into_iter().map(|wall| servo(vec![wall])).collect());
        }
        if walls.len() == 1 {
            section.get("coupled")?.fail("needs two walls or more");
        }
        Some(vec![servo(walls)])
    }

    /// A wall that shall have a servo.
    fn steered(&mut self, given: &Given, domain: Option<&Cell>) -> Option<usize> {
        let k = self.names.find(given, given.text()?)?;
        let normals: Vec<Vec3> = self.planes.iter().flatten().map(|plane| plane.normal).collect();
        let plane = self.planes[k].as_mut()?;
        if plane.has_servo {
            given.fail("this wall has a servo already");
        }
        if plane.velocity.dot(&plane.normal) != 0.0 {
            given.fail("this wall has a velocity along its normal; leave out that, or the servo");
        }
        plane.has_servo = true;
        let Some(across) = (0..3).find(|&axis| plane.normal[axis].abs() == 1.0) else {
            given.fail("this wall is tilted; a servo needs a normal along x, y or z");
            return None;
        };
        for axis in [(across + 1) % 3, (across + 2) % 3] {
            let closed = [1.0, -1.0].iter().all(|side| normals.iter().any(|n| n[axis] == *side));
            if !closed && domain?.period(axis).is_none() {
                given.fail(format!(
                    "its area is not known: the domain is open along {}; add walls on both sides, or make it periodic",
                    AXES[axis]
                ));
            }
        }
        Some(k)
    }

    pub(super) const fn count(&self) -> usize {
        self.planes.len()
    }

    /// A wall behind which some of the slab of rain is.
    pub(super) fn through(&self, rain: &Rain) -> Option<&str> {
        let mut walls = self.planes.iter().zip(&self.names.names);
        let is_through = |plane: &Plane| rain.behind(&plane.point, &plane.normal) > 0.0;
        let found = walls.find(|(plane, _)| plane.as_ref().is_some_and(is_through));
        found.map(|(_, name)| name.as_str())
    }

    /// The walls, with their shapes added to the library.
    pub(super) fn into_library(self, library: &mut Library) -> Option<Vec<Wall>> {
        let planes: Option<Vec<Plane>> = self.planes.into_iter().collect();
        let wall = |(plane, name): (Plane, String)| {
            let Plane { point, normal, velocity, material, has_servo } = plane;
            let half_space = Shape::HalfSpace(HalfSpace { normal });
            let shape = library.push(&name, half_space, material, f64::INFINITY);
            let moves = has_servo || velocity != Vec3::zeros();
            Wall { name, point, normal, velocity, moves, shape, listed_at: point }
        };
        Some(planes?.into_iter().zip(self.names.names).map(wall).collect())
    }
}

/// A `[[wall]]`.
fn plane(section: &Section, domain: Option<&Cell>, materials: &Materials) -> Option<Plane> {
    let point = section.vector("point", "m");
    let normal = section.require("normal", "[x, y, z], towards the particles", |given| {
        let normal = given.vector(Range::Any, "")?;
        if normal.amax() == 0.0 {
            given.fail("must have a length greater than 0");
            return None;
        }
        let along = |axis: &usize| {
            domain.is_some_and(|d| d.period(*axis).is_some()) && normal[*axis] != 0.0
        };
        if let Some(axis) = (0..3).find(along) {
            given.fail(format!("must be 0 along {}, which is periodic", AXES[axis]));
        }
        // Scaled first, because the squares of tiny components vanish.
        Some((normal / normal.amax()).normalize())
    });
    let velocity = section.vector_or("velocity", Vec3::zeros(), "m/s");
    let material = materials.find_in(section, "material");
    section.finish();
    Some(Plane {
        point: point?,
        normal: normal?,
        velocity: velocity?,
        material: material?,
        has_servo: false,
    })
}
