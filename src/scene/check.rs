//! From the file as written to the [`Scene`] that it means.
//!
//! Every function here reads one part, tells the report all that is wrong with it, and returns
//! `None` if anything was; the parts that are right are read on, so that all mistakes come at once.

use super::fills::Fills;
use super::input::Node;
use super::matter::{Materials, Names, Shapes, interactions};
use super::reader::{Given, Range, Section};
use super::report::Report;
use super::{DomainSpec, Method, Scene};
use crate::contact::{Epa, ErodedGjk};
use crate::ids::MaterialId;
use crate::law::Interactions;
use crate::law::stability::time_step_limit;
use crate::math::Vec3;
use crate::particles::Library;
use crate::particles::walls::Wall;
use crate::shape::{HalfSpace, Shape};
use std::path::{Path, PathBuf};

/// Skin, in largest bounding radii, if the file does not say.
const SKIN: f64 = 0.1;

pub(super) const AXES: [&str; 3] = ["x", "y", "z"];

/// The checked scene, or `None` if the report has mistakes.
pub(super) fn scene(
    root: &Node,
    report: &Report,
    file: &str,
    folder: &Path,
    text: String,
) -> Option<Scene> {
    let root = Given::root(root, report).section()?;
    let title = root.read_or("title", file.to_owned(), |given| given.text().map(str::to_owned));
    let seed = root.read_or("seed", 1, |given| given.whole(0));
    let gravity = root.vector_or("gravity", Vec3::zeros(), "m/s2");
    let global_damping = root.number_or("global_damping", 0.0, Range::NotNegative, "1/s");
    let start = root.read_or("start", None, |given| existing_file(given).map(Some));

    let contact = root.read_or("contact", (Method::Auto, true), |given| contact(&given.section()?));
    let limit_damping = contact.is_none_or(|(_, limit)| limit);

    let materials = Materials::read(&root, limit_damping);
    let interactions = interactions(&root, &materials, limit_damping);
    let shapes = Shapes::read(&root, &materials, folder);
    let domain_section = root.section("domain", "the box of particles, `low` and `high` [m]");
    let domain = domain_section.as_ref().and_then(domain);
    let planes = planes(&root, domain_section.as_ref(), domain.as_ref(), &materials);

    let time_section = root.section("time", "`step` [s] and `steps`");
    let time = time_section.as_ref().and_then(Time::read);
    let rest = root.read_or("stop", None, |given| {
        let stop = given.section()?;
        let rest = stop.number("rest", Range::BelowOne, "");
        stop.finish();
        rest.map(Some)
    });
    let largest = shapes.library.largest_radius();
    let neighbours = root.read_or("neighbours", (SKIN * largest, 1.2), |given| {
        let neighbours = given.section()?;
        let skin = neighbours.number_or("skin", SKIN * largest, Range::NotNegative, "m");
        let imbalance = neighbours.number_or("imbalance", 1.2, Range::FromOne, "");
        neighbours.finish();
        Some((skin?, imbalance?))
    });
    let output = root.section("output", "`directory`").as_ref().and_then(Output::read);
    let fills = Fills {
        shapes: &shapes,
        domain: domain.as_ref(),
        gravity: gravity.unwrap_or_else(Vec3::zeros),
        folder,
    }
    .read(&root);
    root.finish();

    if let (Some(domain), Some(section), Some((skin, _))) = (&domain, &domain_section, neighbours) {
        check_periods(section, domain, 2.0 * largest + skin);
    }
    if let (Some(time), Some(section), Some(interactions)) = (&time, &time_section, &interactions)
        && shapes.complete
    {
        check_step(section, time, &shapes.library, interactions);
    }
    if let (Some(time), Some(ξ), Some(given)) = (&time, global_damping, root.get("global_damping"))
        && ξ * time.dt >= 2.0
    {
        given.fail("turns every velocity round in one step; must be less than 2 / time.step");
    }
    if let Some((Method::CommonNormal, _)) = contact {
        check_smooth(&root, &shapes.library);
    }
    if !report.is_empty() {
        return None;
    }

    let mut library = shapes.library;
    let walls = planes?.into_iter().map(|plane| plane.into_wall(&mut library)).collect();
    let (skin, imbalance) = neighbours?;
    let (initial, rain) = fills?;
    let Time { dt, steps, allow_unstable } = time?;
    let Output { directory: out, snapshot_every, history_every } = output?;
    Some(Scene {
        title: title?,
        seed: seed?,
        domain: domain?,
        materials: materials.items.into_iter().collect::<Option<_>>()?,
        interactions: interactions?,
        library,
        walls,
        method: contact?.0,
        limit_damping,
        gravity: gravity?,
        global_damping: global_damping?,
        initial,
        rain,
        dt,
        steps,
        allow_unstable,
        rest: rest?,
        skin,
        imbalance,
        snapshot_every,
        history_every,
        out,
        start: start?,
        text,
    })
}

fn existing_file(given: &Given) -> Option<PathBuf> {
    let path = PathBuf::from(given.text()?);
    if !path.exists() {
        given.fail(
            "no such file or directory in the working directory; has the stage before been run?",
        );
        return None;
    }
    Some(path)
}

// --- domain and walls ---

fn domain(section: &Section) -> Option<DomainSpec> {
    let low = section.vector("low", "m");
    let high = section.vector("high", "m");
    let periodic = section.read_or("periodic", [false; 3], Given::three_booleans);
    let (low, high) = (low?, high?);
    let flat: Vec<&str> =
        (0..3).filter(|&axis| high[axis] <= low[axis]).map(|axis| AXES[axis]).collect();
    if !flat.is_empty() {
        section.get("high")?.fail(format!("must be above `low` along {}", flat.join(", ")));
        return None;
    }
    Some(DomainSpec { low, high, periodic: periodic? })
}

/// A periodic image must never meet the same particle, or another of its images.
fn check_periods(section: &Section, domain: &DomainSpec, reach: f64) {
    let extent = domain.high - domain.low;
    for axis in (0..3).filter(|&axis| domain.periodic[axis]) {
        if extent[axis] < 2.0 * reach
            && let Some(given) = section.get("periodic")
        {
            given.fail(format!(
                "the domain is {:?} m wide along {}; a period must be at least {:.4e} m, twice \
                 the largest bounding diameter and the skin",
                extent[axis],
                AXES[axis],
                2.0 * reach
            ));
        }
    }
}

/// A wall on its way into the library.
struct Plane {
    name: String,
    point: Vec3,
    normal: Vec3,
    velocity: Vec3,
    material: MaterialId,
}

impl Plane {
    fn into_wall(self, library: &mut Library) -> Wall {
        let Self { name, point, normal, velocity, material } = self;
        let half_space = Shape::HalfSpace(HalfSpace { normal });
        let shape = library.push(&name, half_space, material, f64::INFINITY);
        Wall { name, point, normal, velocity, shape, listed_at: point }
    }
}

/// The walls on sides of the domain, then all others.
fn planes(
    root: &Section,
    section: Option<&Section>,
    domain: Option<&DomainSpec>,
    materials: &Materials,
) -> Option<Vec<Plane>> {
    let mut planes = Vec::new();
    let mut names = Names::of("wall");
    if let Some(section) = section {
        planes.extend(sides(section, domain, materials, &mut names));
        section.finish();
    }
    for section in root.sections("wall") {
        names.add(&section);
        let name = names.names.last().cloned().unwrap_or_default();
        let point = section.vector("point", "m");
        let normal = section.require("normal", "[x, y, z], towards the particles", |given| {
            let normal = given.vector(Range::Any, "")?;
            if normal.amax() == 0.0 {
                given.fail("must have a length greater than 0");
                return None;
            }
            let along =
                |axis: &usize| domain.is_some_and(|d| d.periodic[*axis]) && normal[*axis] != 0.0;
            if let Some(axis) = (0..3).find(along) {
                given.fail(format!("must be 0 along {}, which is periodic", AXES[axis]));
            }
            // Scaled first, because the squares of tiny components vanish.
            Some((normal / normal.amax()).normalize())
        });
        let velocity = section.vector_or("velocity", Vec3::zeros(), "m/s");
        let material = materials.find_in(&section, "material");
        section.finish();
        planes.push((|| {
            Some(Plane {
                name,
                point: point?,
                normal: normal?,
                velocity: velocity?,
                material: material?,
            })
        })());
    }
    planes.into_iter().collect()
}

fn sides(
    section: &Section,
    domain: Option<&DomainSpec>,
    materials: &Materials,
    names: &mut Names,
) -> Vec<Option<Plane>> {
    let Some(given) = section.get("walls") else {
        if let Some(material) = section.get("wall_material") {
            material.fail("there are no `walls` in [domain] for it");
        }
        return Vec::new();
    };
    let material = materials.find_in(section, "wall_material");
    let words = ["-x", "+x", "-y", "+y", "-z", "+z"].map(|word| (word, word));
    let items = given.list("a list of sides: \"-x\", \"+x\", \"-y\", \"+y\", \"-z\", \"+z\"");
    items
        .unwrap_or_default()
        .iter()
        .map(|item| {
            let name = item.one_of(&words)?;
            if names.names.iter().any(|n| n == name) {
                item.fail("this side has a wall already");
            }
            names.names.push(name.to_owned());
            let axis = AXES.iter().position(|axis| name.ends_with(axis))?;
            let domain = domain?;
            if domain.periodic[axis] {
                item.fail(format!("{} is periodic, it has no walls", AXES[axis]));
            }
            let low = name.starts_with('-');
            let mut normal = Vec3::zeros();
            normal[axis] = if low { 1.0 } else { -1.0 };
            Some(Plane {
                name: name.to_owned(),
                point: if low { domain.low } else { domain.high },
                normal,
                velocity: Vec3::zeros(),
                material: material?,
            })
        })
        .collect()
}

// --- contact, time, output ---

/// The method, and whether dashpots are kept from attracting.
fn contact(section: &Section) -> Option<(Method, bool)> {
    let words = ["auto", "common-normal", "gjk-erosion", "epa"].map(|word| (word, word));
    let word = section.read_or("method", "auto", |given| given.one_of(&words));
    let option = |key, default, methods: &[&str]| match section.get(key) {
        Some(given) if word.is_some_and(|word| !methods.contains(&word)) => {
            given.fail(format!("only for method = \"{}\"", methods.join("\" or \"")));
            None
        }
        Some(given) => given.number(Range::BelowOne, ""),
        None => Some(default),
    };
    let ratio = option("erosion_ratio", ErodedGjk::default().ratio, &["gjk-erosion"]);
    let increment = option("erosion_increment", ErodedGjk::default().increment, &["gjk-erosion"]);
    let default_tolerance =
        if word == Some("epa") { Epa::default().tolerance } else { ErodedGjk::default().tolerance };
    let tolerance = option("tolerance", default_tolerance, &["gjk-erosion", "epa"]);
    let limit_damping = section.read_or("limit_damping", true, Given::boolean);
    section.finish();
    let (ratio, increment, tolerance) = (ratio?, increment?, tolerance?);
    let method = match word? {
        "gjk-erosion" => Method::GjkErosion { ratio, increment, tolerance },
        "epa" => Method::Epa { tolerance },
        "common-normal" => Method::CommonNormal,
        _ => Method::Auto,
    };
    Some((method, limit_damping?))
}

/// A common normal that the user insists on needs curvature everywhere.
fn check_smooth(root: &Section, library: &Library) {
    let edged: Vec<String> = library
        .names
        .iter()
        .zip(&library.shapes)
        .filter(|(_, shape)| !shape.kind().is_smooth())
        .map(|(name, shape)| format!("`{name}` ({})", shape.kind().name()))
        .collect();
    if let (false, Some(given)) = (edged.is_empty(), root.get("contact"))
        && let Some((_, method)) =
            given.entries().and_then(|all| all.into_iter().find(|(key, _)| *key == "method"))
    {
        method.fail(format!(
            "not for {}, which have edges or flat sides; take \"auto\", \"gjk-erosion\" or \"epa\"",
            edged.join(", ")
        ));
    }
}

struct Time {
    dt: f64,
    steps: u64,
    allow_unstable: bool,
}

impl Time {
    fn read(section: &Section) -> Option<Self> {
        let dt = section.number("step", Range::Positive, "s");
        let steps = section.require("steps", "a whole number", |given| given.whole(0));
        let allow_unstable = section.read_or("allow_unstable", false, Given::boolean);
        section.finish();
        Some(Self { dt: dt?, steps: steps?, allow_unstable: allow_unstable? })
    }
}

fn check_step(section: &Section, time: &Time, library: &Library, interactions: &Interactions) {
    let Some(limit) = time_step_limit(library, interactions) else { return };
    if time.dt > limit.dt
        && !time.allow_unstable
        && let Some(given) = section.get("step")
    {
        given.fail(format!(
            "over the stable limit of {:.2e} s, set by shape `{}` ({:.3e} kg, stiffness {:.3e} N/m); \
             take a shorter step, more mass or less stiffness, or set time.allow_unstable = true",
            // Rounded down, so that the number itself is allowed.
            0.995 * limit.dt,
            library.names[limit.shape.index()],
            limit.mass,
            limit.stiffness
        ));
    }
}

struct Output {
    directory: PathBuf,
    snapshot_every: u64,
    history_every: u64,
}

impl Output {
    fn read(section: &Section) -> Option<Self> {
        let directory = section.require("directory", "where files go", Given::text);
        let snapshot_every = section.read_or("snapshot_every", 0, |given| given.whole(0));
        let history_every = section.read_or("history_every", 100, |given| given.whole(0));
        section.finish();
        Some(Self {
            directory: directory?.into(),
            snapshot_every: snapshot_every?,
            history_every: history_every?,
        })
    }
}
