//! Makes a [`Scene`] from the parsed file.
//!
//! Every function here reads one part, reports all errors in it, and returns `None` if there are any. The valid parts are
//! still read, so that all errors are reported at once.

use super::before;
use super::element;
use super::fills::Fills;
use super::flows;
use super::form;
use super::groups;
use super::jumps;
use super::laws;
use super::matter::{Materials, Shapes};
use super::mistakes::Mistakes;
use super::parts::{Need, Whole};
use super::reader::{Given, Section};
use super::room::Room;
use super::walls::Walls;
use super::{Control, Fill, FreeWall, Inlet, Method, Mix, Outlet, Rain, Scene, Servo, Stop};
use crate::cell::{AXES, Cell, Shear};
use crate::contact::{Epa, ErodedGjk};
use crate::domain::halo_width;
use crate::drive::groups::{Group, held_of};
use crate::drive::inlet::Amount;
use crate::ids::ShapeId;
use crate::law::Choice;
use crate::law::stability::{TimeStepLimit, own_step, time_step_limit};
use crate::math::{Mat3, Vec3, printed_limit};
use crate::population::Library;
use crate::sim::audit::Settings as Audit;
use crate::sim::steps_of;
use crate::sim::stop::When;
use crate::text::{MOST_NAMED, listed};
use std::path::{Path, PathBuf};

/// Default skin, in largest bounding radii.
const SKIN: f64 = 0.1;
/// Smallest skin, in smallest bounding radii: a pair that parts in a step must still be listed, because otherwise its
/// stored energy would be lost from the balance.
const LEAST_SKIN: f64 = 0.02;
/// Default work of the busiest rank over the mean above which the domain is cut again.
const IMBALANCE: f64 = 1.1;
/// Default steps between renewals of the order. A list of pairs takes as long as 6 to 13 steps (20,000 and 980,000 spheres,
/// by hand), which is negligible here.
const ORDER_EVERY: u64 = 5000;

/// Largest number of shapes and walls, by their ids.
const MOST_IDS: usize = 1 << u16::BITS;

/// The checked scene; `None` if there are errors.
pub(super) fn scene(
    Whole { root, folder, text }: Whole,
    mistakes: &Mistakes,
    file: &str,
    need: Need,
) -> Option<Scene> {
    let root = Given::root(&root, mistakes);
    form::check(&root);
    let root = root.section()?;
    let general = General::read(&root, file, need);
    let snapshot = snapshot_before(general.start.as_ref(), need);
    let mut bodies = Bodies::read(&root, &folder, general.gravity, snapshot);
    let mut grains = Grains::read(&root, &folder, &mut bodies, &general);
    let before = sizes_before(&mut bodies.shapes.library, snapshot, need);
    let groups = read_groups(&root, &folder, &mut bodies, &mut grains, general.gravity);
    let course = Course::read(&root, &mut bodies, general.seed, &grains);
    if let (Some(groups), Some(time), true) = (&groups, &course.time, bodies.shapes.complete) {
        groups::check_speeds(&root, groups, &bodies.shapes.library, time.dt);
    }
    check_room(&root, &general, &bodies, &mut grains);
    check_together(&root, &general, &mut bodies, &course);
    if !mistakes.is_empty() {
        return None;
    }

    let Bodies { materials, shapes, walls, free_walls, domain, cell, law, .. } = bodies;
    let mut library = shapes.library;
    let law = law?;
    let jumps = before.and_then(|before| jumps::jumps(&before, &materials, &law, &library));
    let walls = walls.into_library(&mut library)?;
    let left_out = laws::left_out(&root, &materials, &library);
    let Neighbours { skin, imbalance, order_every } = course.neighbours?;
    let (initial, rain) = grains.fills?;
    let Time { dt, own_step, steps, duration, allow_unstable } = course.time?;
    let Output { directory: out, snapshot_every, snapshot_every_minutes, history_every } =
        course.output?;
    Some(Scene {
        title: general.title?,
        seed: general.seed?,
        domain: domain?,
        cell: cell?,
        materials: materials.items.into_iter().collect::<Option<_>>()?,
        law,
        left_out,
        jumps,
        doubtful: mistakes.warnings(),
        library,
        walls,
        servos: course.servos?,
        free_walls,
        method: general.method?,
        gravity: general.gravity?,
        global_damping: general.global_damping?,
        initial,
        rain,
        inlets: grains.inlets?,
        outlets: grains.outlets?,
        groups: groups?,
        dt,
        own_step,
        steps,
        duration,
        allow_unstable,
        stop: course.stop?,
        skin,
        imbalance,
        order_every,
        snapshot_every,
        snapshot_every_minutes,
        history_every,
        audit: course.audit?,
        out,
        start: general.start?,
        text,
    })
}

// --- parts, in the order of their dependence ---

/// Settings for all particles, and the contact method.
struct General {
    title: Option<String>,
    seed: Option<u64>,
    /// Gravity [m/s²].
    gravity: Option<Vec3>,
    /// Global damping [1/s].
    global_damping: Option<f64>,
    #[expect(clippy::option_option, reason = "wrong, none, or one")]
    start: Option<Option<PathBuf>>,
    method: Option<Method>,
}

impl General {
    fn read(root: &Section, file: &str, need: Need) -> Self {
        Self {
            title: root.read_or("title", file.to_owned(), |given| given.text().map(str::to_owned)),
            seed: root.whole_or("seed", 1),
            gravity: root.vector_or("gravity", Vec3::zeros()),
            global_damping: root.number_or("global_damping", 0.0),
            start: root.optional("start", |given| start(given, need)),
            method: root.read_or("contact", Method::Auto, |given| contact(&given.section()?)),
        }
    }
}

/// Materials with their law, shapes, the domain and walls.
struct Bodies<'a> {
    materials: Materials,
    law: Option<Choice>,
    shapes: Shapes,
    domain_section: Option<Section<'a>>,
    domain: Option<Cell>,
    #[expect(clippy::option_option, reason = "wrong, none, or one")]
    cell: Option<Option<Control>>,
    walls: Walls<'a>,
    free_walls: Vec<FreeWall>,
}

impl<'a> Bodies<'a> {
    fn read(
        root: &Section<'a>,
        folder: &Path,
        gravity: Option<Vec3>,
        before: Option<&Path>,
    ) -> Self {
        let kind = laws::kind(root);
        let (materials, law) = laws::materials(root, kind);
        let shapes = Shapes::read(root, &materials, folder, before);
        let domain_section = root.section("domain");
        let domain = element::domain(root, domain_section.as_ref().and_then(domain).as_ref());
        let cell = element::control(root, folder);
        let walls = Walls::read(root, domain_section.as_ref(), domain.as_ref(), &materials, folder);
        let free_walls = walls.free(gravity.unwrap_or_else(Vec3::zeros));
        let of_free = walls.stress_of_free(&free_walls, domain.as_ref());
        let law = law.map(|law| laws::under_free_walls(law, kind, of_free));
        Self { materials, law, shapes, domain_section, domain, cell, walls, free_walls }
    }

    /// Stable limit of the time step, if law and shapes are compatible.
    fn limit(&self, root: &Section) -> Option<Limit> {
        let (law, shapes) = (self.law.as_ref()?, &self.shapes);
        if !shapes.complete || !laws::check_shapes(root, law, &shapes.library) {
            return None;
        }
        let mut library = shapes.library.clone();
        self.walls.stand_in(&mut library);
        Some(Limit::of(law, &library))
    }
}

/// Particles at the start, that come and that leave.
struct Grains {
    fills: Option<(Vec<Fill>, Option<Rain>)>,
    inlets: Option<Vec<Inlet>>,
    outlets: Option<Vec<Outlet>>,
}

impl Grains {
    /// Reads them; the library gets the sizes and numbers of all.
    fn read(root: &Section, folder: &Path, bodies: &mut Bodies, general: &General) -> Self {
        let Bodies { shapes, domain, .. } = bodies;
        let (domain, gravity) = (domain.as_ref(), general.gravity.unwrap_or_else(Vec3::zeros));
        let seed = general.seed.unwrap_or_default();
        let any_held = groups::any_held(root);
        let fills = Fills { shapes: &*shapes, domain, gravity, folder, any_held, seed };
        let inlets = flows::inlets(root, &fills);
        let fills = fills.read(root);
        let outlets = flows::outlets(root, domain);
        let rain = fills.as_ref().and_then(|(_, rain)| rain.as_ref());
        let rain = rain.map(|rain| (rain, &shapes.library));
        flows::check_apart(root, (inlets.as_ref(), rain), outlets.as_ref(), domain);
        admit_listed(&mut shapes.library, fills.as_ref(), inlets.as_deref().unwrap_or_default());
        limit_numbers(&mut shapes.library, fills.as_ref(), inlets.as_deref());
        Self { fills, inlets, outlets }
    }
}

/// Adds the sizes of listed particles to the library. A shape without `size` that only these have has no other sizes.
fn admit_listed(
    library: &mut Library,
    fills: Option<&(Vec<Fill>, Option<Rain>)>,
    inlets: &[Inlet],
) {
    let Some((initial, rain)) = fills else { return };
    let of_lattices = initial.iter().filter_map(|fill| match fill {
        Fill::Lattice(lattice) => Some(&lattice.mix),
        Fill::Listed(_) => None,
    });
    let others = rain.iter().map(|rain| &rain.mix).chain(inlets.iter().map(|inlet| &inlet.mix));
    let by_law = library.sizes.iter().map(|sizes| sizes.distribution().is_some());
    let mut has_sizes: Vec<bool> = by_law.collect();
    for shape in of_lattices.chain(others).flat_map(Mix::shapes) {
        has_sizes[shape.index()] = true;
    }
    for row in initial.iter().flat_map(Fill::listed) {
        if !std::mem::replace(&mut has_sizes[row.shape.index()], true) {
            library.scales[row.shape.index()] = [row.scale; 2];
        }
        library.admit(row.shape, row.scale);
    }
}

/// Reads the groups of particles. The library gets shapes for held ones, and inlets the numbers of their groups.
fn read_groups(
    root: &Section,
    folder: &Path,
    bodies: &mut Bodies,
    grains: &mut Grains,
    gravity: Option<Vec3>,
) -> Option<Vec<Group>> {
    let Bodies { shapes, domain, walls, .. } = bodies;
    let around = groups::Around {
        shapes: &*shapes,
        walls: &*walls,
        domain: domain.as_ref(),
        rain: grains.fills.as_ref().and_then(|(_, rain)| rain.as_ref()),
        gravity: gravity.unwrap_or_else(Vec3::zeros),
        folder,
    };
    let all = groups::read(root, &around, grains.inlets.as_deref_mut());
    if let Some(all) = all.as_deref()
        && all.iter().any(Group::is_held)
    {
        shapes.library.add_held(|shape| held_of(all, shape));
    }
    shapes.library.add_pieces();
    all
}

/// Snapshot with which the run begins or from which it continues.
fn snapshot_before<'a>(start: Option<&'a Option<PathBuf>>, need: Need<'a>) -> Option<&'a Path> {
    match need {
        Need::Snapshot(own) => Some(own),
        Need::AllFiles => start?.as_deref(),
    }
}

/// Extends the library to the particles of that snapshot. Returns its scene.
fn sizes_before(library: &mut Library, snapshot: Option<&Path>, need: Need) -> Option<String> {
    let before = match (need, snapshot) {
        (Need::Snapshot(own), _) => before::admit_to_go_on(library, own),
        (Need::AllFiles, Some(path)) => before::admit(library, path),
        (Need::AllFiles, None) => None,
    };
    if library.most.iter().sum::<f64>() <= 1.0 {
        // A single particle stands for any number, because a program may add others.
        library.most.fill(f64::INFINITY);
    }
    before
}

/// Steps, stop conditions and output.
struct Course<'a> {
    limit: Option<Limit>,
    time_section: Option<Section<'a>>,
    time: Option<Time>,
    servos: Option<Vec<Servo>>,
    stop: Option<Stop>,
    neighbours: Option<Neighbours>,
    audit: Option<Audit>,
    output: Option<Output>,
}

impl<'a> Course<'a> {
    fn read(root: &Section<'a>, bodies: &mut Bodies, seed: Option<u64>, grains: &Grains) -> Self {
        let limit = bodies.limit(root);
        let Bodies { walls, domain, domain_section, shapes, .. } = bodies;
        let (domain, library) = (domain.as_ref(), &shapes.library);
        let time_section = root.section("time");
        let time = time_section.as_ref().and_then(|section| Time::read(section, limit.as_ref()));
        let dt = time.as_ref().filter(|_| shapes.complete).map(|time| time.dt);
        let servos = walls.read_servos(root, domain, library, dt);
        walls.check_speeds(root, domain_section.as_ref(), domain, library, dt);
        let stop = root.read_or("stop", Stop::default(), |given| {
            let targets = bodies.cell.iter().flatten().any(Control::has_target);
            stop(&given.section()?, grains, [root.get("servo").is_some(), targets])
        });
        let [least, skin] = skins(library);
        let default = Neighbours { skin, imbalance: IMBALANCE, order_every: ORDER_EVERY };
        let neighbours =
            root.read_or("neighbours", default, |given| default.read(&given.section()?, least));
        let audit = audit(root, seed.unwrap_or_default());
        let output = root.section("output").as_ref().and_then(Output::read);
        Self { limit, time_section, time, servos, stop, neighbours, audit, output }
    }
}

/// Checks that there is room for the particles to come.
fn check_room(root: &Section, general: &General, bodies: &Bodies, grains: &mut Grains) {
    let Bodies { walls, shapes, .. } = bodies;
    let count = shapes.library.shapes.len() + walls.count();
    if count > MOST_IDS {
        root.fail(format!("has {count} shapes and walls; must be at most {MOST_IDS}"));
    }
    let (Some(cell), Some(start), true) = (&bodies.domain, &general.start, shapes.complete) else {
        return;
    };
    let (library, has_start) = (&shapes.library, start.is_some());
    let seed = general.seed.unwrap_or_default();
    let room = Room { root, cell, walls, library, seed, has_start };
    if let Some((_, Some(rain))) = &mut grains.fills {
        room.for_rain(rain);
    }
    if let Some(inlets) = &grains.inlets {
        room.for_inlets(inlets);
        room.for_amounts(inlets);
    }
}

/// Checks that involve several parts.
fn check_together(root: &Section, general: &General, bodies: &mut Bodies, course: &Course) {
    let Bodies { domain, domain_section, cell, law, shapes, walls, .. } = bodies;
    let library = &shapes.library;
    element::check_others(root, walls.count());
    if let (Some(domain), Some(section), Some(Neighbours { skin, .. })) =
        (&*domain, &*domain_section, course.neighbours)
    {
        let reach = law.as_ref().map_or(0.0, |law| law.reach(library.largest_radius()));
        let halo = halo_width(library, skin, reach);
        check_periods(section, domain, halo);
        if let (Some(Some(control)), Some(Time { dt, steps, duration, .. })) =
            (&*cell, &course.time)
        {
            let lasts = duration.unwrap_or(*steps as f64 * dt);
            element::check_course(root, control, domain, (*dt, lasts), 2.0 * halo);
        }
    }
    if let Some(domain) = &*domain {
        check_shear(root, domain, general.gravity, walls.count());
    }
    if let (Some(time), Some(section), Some(limit)) =
        (&course.time, &course.time_section, &course.limit)
    {
        limit.check(section, time, library);
    }
    if let (Some(time), Some(ξ)) = (&course.time, general.global_damping) {
        check_damping(root, ξ, time.dt);
    }
    walls.check_surfaces(root, library, &general.method.unwrap_or(Method::Auto));
    if general.method == Some(Method::CommonNormal) {
        check_smooth(root, library);
    }
}

/// Limits the number of particles of each shape to the initial ones and those that come.
fn limit_numbers(
    library: &mut Library,
    fills: Option<&(Vec<Fill>, Option<Rain>)>,
    inlets: Option<&[Inlet]>,
) {
    let (Some((initial, rain)), Some(inlets)) = (fills, inlets) else { return };
    library.most.fill(0.0);
    let mut add = |shape: ShapeId, count: f64| library.most[shape.index()] += count;
    for fill in initial {
        match fill {
            Fill::Listed(rows) => rows.iter().for_each(|row| add(row.shape, 1.0)),
            Fill::Lattice(lattice) => {
                lattice.mix.shapes().for_each(|shape| add(shape, fill.count() as f64));
            }
        }
    }
    if let Some(rain) = rain {
        rain.mix.shapes().for_each(|shape| add(shape, rain.count as f64));
    }
    for inlet in inlets {
        let most = match inlet.until {
            Some(Amount::Count(count)) => count,
            _ => f64::INFINITY,
        };
        inlet.mix.shapes().for_each(|shape| add(shape, most));
    }
}

fn start(given: &Given, need: Need) -> Option<PathBuf> {
    let path = PathBuf::from(given.text()?);
    if need == Need::AllFiles && !path.exists() {
        given
            .fail("no such file or directory in the working directory; run the stage before first");
        return None;
    }
    Some(path)
}

/// Smallest and default skin [m]. The default is no wider than lets small particles list their near neighbours only.
fn skins(library: &Library) -> [f64; 2] {
    let radius = |(shape, scale): (ShapeId, f64)| library.radius[shape.index()] * scale;
    let smallest = library.extremes().map(radius).fold(f64::INFINITY, f64::min);
    let least = if smallest.is_finite() { LEAST_SKIN * smallest } else { 0.0 };
    [least, (SKIN * library.largest_radius()).min(smallest)]
}

// --- domain ---

fn domain(section: &Section) -> Option<Cell> {
    let low = section.vector("low");
    if let Some(edges) = section.get("edges") {
        return tilted(section, low?, &edges);
    }
    let high = section.require("high").and_then(|high| high.vector());
    let periodic = section.read_or("periodic", [false; 3], |given| given.list_of(Given::boolean));
    let sheared = section.get("shear");
    let (low, high) = (low?, high?);
    let flat: Vec<&str> =
        (0..3).filter(|&axis| high[axis] <= low[axis]).map(|axis| AXES[axis]).collect();
    if !flat.is_empty() {
        section.get("high")?.fail(format!("must be above `low` along {}", flat.join(", ")));
        return None;
    }
    let cell = Cell::new(low, high, periodic?);
    match sheared {
        None => Some(cell),
        Some(given) => cell.with_shear(shear(&given, &cell)?),
    }
}

/// A cell with edges that lean from their axes.
fn tilted(section: &Section, low: Vec3, given: &Given) -> Option<Cell> {
    for key in ["high", "shear", "walls"] {
        section.refuse(key, "is not together with `edges`");
    }
    let edges = Mat3::from_columns(&given.list_of::<3, _>(Given::vector)?);
    let periodic = section.read_or("periodic", [true; 3], |given| given.list_of(Given::boolean))?;
    if periodic != [true; 3] {
        section.get("periodic")?.fail("must be true for all axes with `edges`");
        return None;
    }
    let cell = Cell::of_edges(low, edges);
    if cell.is_none() {
        given.fail(
            "must be [a, 0, 0], [b, c, 0] and [d, e, f] with a, c and f above 0: the first edge is along x, the second in the plane \
             of x and y",
        );
    }
    cell
}

/// Sliding of the images of a cell.
fn shear(given: &Given, cell: &Cell) -> Option<Shear> {
    let section = given.section()?;
    let words = [("x", 0), ("y", 1), ("z", 2)];
    let axis = |key| {
        section.require(key).and_then(|given| {
            let axis = given.one_of(&words)?;
            if cell.open_axes().any(|open| open == axis) {
                given.fail(format!(
                    "domain.periodic is false along {}; images slide only along and across periodic axes",
                    AXES[axis]
                ));
                return None;
            }
            Some(axis)
        })
    };
    let along = axis("along");
    let across = axis("across");
    let rate = section.number("rate");
    let (along, across, rate) = (along?, across?, rate?);
    if along == across {
        section.get("across")?.fail("must be another axis than `along`");
        return None;
    }
    Some(Shear { along, across, rate, strain: 0.0 })
}

/// Rejects settings that have no meaning where images slide, or are not supported there.
fn check_shear(root: &Section, domain: &Cell, gravity: Option<Vec3>, walls: usize) {
    let Some(Shear { along, .. }) = domain.shear() else { return };
    if gravity.is_some_and(|gravity| gravity[along] != 0.0)
        && let Some(given) = root.get("gravity")
    {
        given.fail(format!(
            "must be 0 along {}, the axis of the shear: it would accelerate the particles for ever",
            AXES[along]
        ));
    }
    if let Some(given) = root.get("global_damping") {
        given.fail(
            "would stop the flow of a sheared domain, as it acts on velocities relative to the box; damp contacts by \
             restitution",
        );
    }
    if walls > 0
        && let Some(given) = root.get("domain")
    {
        given.fail(
            "has walls and `shear`, so a wall would slide against its images: leave the walls out, or shear by moving \
             walls instead of `shear`",
        );
    }
    if let Some(given) = root.section("fill").and_then(|fill| fill.get("rain")) {
        given.fail("not in a sheared domain: use [[fill.lattice]], [[fill.random]] or [[fill.file]], or `start` from \
             a stage without `shear`");
    }
}

/// Rejects periods in which a particle could meet two images of the same particle.
fn check_periods(section: &Section, domain: &Cell, reach: f64) {
    let Some(given) = section.get("periodic").or_else(|| section.get("edges")) else { return };
    for (axis, width) in domain.thin(2.0 * reach) {
        given.fail(format!(
            "the domain is {width:?} m wide along {axis}; a period must be at least {:.4e} m, twice the largest bounding diameter and \
             the skin",
            2.0 * reach
        ));
    }
}

// --- contact, time, output ---

/// Contact method.
fn contact(section: &Section) -> Option<Method> {
    let words = ["auto", "common-normal", "gjk-erosion", "epa"].map(|word| (word, word));
    let word = section.read_or("method", "auto", |given| given.one_of(&words));
    // `None` if the key is given and the method has no such setting.
    let setting = |key, methods: &[&str]| match section.get(key) {
        Some(given) if word.is_some_and(|word| !methods.contains(&word)) => {
            given.fail(format!("only for method = \"{}\"", methods.join("\" or \"")));
            None
        }
        given => Some(given),
    };
    let option = |key, default, methods: &[&str]| {
        setting(key, methods)?.map_or(Some(default), |given| given.number())
    };
    let flag = |key, method| setting(key, &[method])?.map_or(Some(true), |given| given.boolean());
    let ratio = option("erosion_ratio", ErodedGjk::default().ratio, &["gjk-erosion"]);
    let increment = option("erosion_increment", ErodedGjk::default().increment, &["gjk-erosion"]);
    let default_tolerance =
        if word == Some("epa") { Epa::default().tolerance } else { ErodedGjk::default().tolerance };
    let tolerance = option("tolerance", default_tolerance, &["gjk-erosion", "epa"]);
    let (spurious, polish) = (flag("spurious", "gjk-erosion"), flag("polish", "epa"));
    let (ratio, increment, tolerance) = (ratio?, increment?, tolerance?);
    let (spurious, polish) = (spurious?, polish?);
    Some(match word? {
        "gjk-erosion" => Method::GjkErosion(ErodedGjk { ratio, increment, tolerance, spurious }),
        "epa" => Method::Epa(Epa { tolerance, polish }),
        "common-normal" => Method::CommonNormal,
        _ => Method::Auto,
    })
}

/// Rejects shapes without curvature for the method `common-normal`, if it is set explicitly.
fn check_smooth(root: &Section, library: &Library) {
    let edged: Vec<String> = library
        .names
        .iter()
        .zip(&library.shapes)
        .take(library.own_shapes())
        .filter(|(_, shape)| !shape.kind().is_smooth())
        .map(|(name, shape)| format!("`{name}` ({})", shape.kind().name()))
        .collect();
    if !edged.is_empty()
        && let Some(method) = root.section("contact").and_then(|contact| contact.get("method"))
    {
        method.fail(format!(
            "not for {}, which have edges or flat sides; use \"auto\", \"gjk-erosion\" or \"epa\"",
            listed(edged, MOST_NAMED)
        ));
    }
}

fn stop(section: &Section, grains: &Grains, [has_servo, has_target]: [bool; 2]) -> Option<Stop> {
    let limit = |key| section.optional(key, Given::number);
    let (rest, unbalanced) = (limit("rest"), limit("unbalanced"));
    let (servo, cell) = (limit("servo"), limit("cell"));
    let count = |key| section.optional(key, Given::whole);
    let (left, remaining) = (count("left"), count("remaining"));
    let after = section.number_or("after", 0.0);
    let when = section.read_or("when", Vec::new(), |given| {
        given.list()?.iter().map(|given| within(&given.section()?)).collect()
    });
    let is_endless = |inlet: &Inlet| inlet.until.is_none();
    if let Some(given) = section.get("remaining")
        && grains.inlets.iter().flatten().any(is_endless)
    {
        given.fail("is never reached: an [[inlet]] without `count` or `mass` never ends");
    }
    for key in ["left", "remaining"] {
        if let (Some(given), Some([])) = (section.get(key), grains.outlets.as_deref()) {
            given.fail("there is no [[outlet]]");
        }
    }
    if let (Some(given), false) = (section.get("servo"), has_servo) {
        given.fail("there is no [[servo]]");
    }
    if let (Some(given), false) = (section.get("cell"), has_target) {
        given.fail("there is no [cell] with a stress");
    }
    let drives = [("servo", servo?), ("cell", cell?)].into_iter();
    let drives = drives.filter_map(|(key, limit)| Some((key.to_owned(), limit?))).collect();
    let (left, remaining, when, after) = (left?, remaining?, when?, after?);
    let stop = Stop { rest: rest?, unbalanced: unbalanced?, drives, left, remaining, when, after };
    if stop == (Stop { after, ..Stop::default() }) {
        section.fail(
            "give at least one of `rest`, `unbalanced`, `servo`, `cell`, `left`, `remaining` and `when`",
        );
    }
    Some(stop)
}

/// An entry of `when` in `[stop]`.
fn within(section: &Section) -> Option<When> {
    let column = section.require("column").and_then(|given| given.text());
    let limit = |key| section.optional(key, Given::number);
    let (above, below) = (limit("above")?, limit("below")?);
    if above.is_none() && below.is_none() {
        section.fail("give `above`, `below`, or both");
        return None;
    }
    Some(When { column: column?.to_owned(), above, below })
}

/// `[neighbours]`.
#[derive(Clone, Copy)]
struct Neighbours {
    /// Skin [m].
    skin: f64,
    imbalance: f64,
    order_every: u64,
}

impl Neighbours {
    /// Reads the section; the skin is at least this large [m].
    fn read(self, section: &Section, least: f64) -> Option<Self> {
        let skin = section.number_or("skin", self.skin);
        let imbalance = section.number_or("imbalance", self.imbalance);
        let order_every = section.whole_or("order_every", self.order_every);
        Some(Self { skin: skin?.max(least), imbalance: imbalance?, order_every: order_every? })
    }
}

/// Settings of the audit; `seed` is that of the scene.
fn audit(root: &Section, seed: u64) -> Option<Audit> {
    let default = Audit { every: Audit::EVERY, contacts: None, seed };
    root.read_or("audit", default, |given| {
        let section = given.section()?;
        let every = section.whole_or("every", default.every);
        let contacts = section.optional("contacts", Given::whole);
        let seed = section.whole_or("seed", seed);
        if let (Some(0), Some(given)) = (every, section.get("contacts")) {
            given.fail("there is no audit: `every` is 0");
        }
        Some(Audit { every: every?, contacts: contacts?, seed: seed? })
    })
}

/// Checks the global damping; `damping` in 1/s, `dt` in s.
fn check_damping(root: &Section, damping: f64, dt: f64) {
    if damping * dt >= 2.0
        && let Some(given) = root.get("global_damping")
    {
        given.fail("reverses every velocity in one step; must be less than 2 / time.step");
    }
}

struct Time {
    dt: f64,
    /// Is the step automatic?
    own_step: bool,
    steps: u64,
    duration: Option<f64>,
    allow_unstable: bool,
}

impl Time {
    fn read(section: &Section, limit: Option<&Limit>) -> Option<Self> {
        let step = section.get("step");
        let own_step = step.as_ref().is_some_and(|given| given.text().is_some());
        let dt =
            step.and_then(|given| if own_step { limit?.own_step(&given) } else { given.number() });
        let mut duration = None;
        let steps = match (section.get("steps"), section.get("duration")) {
            (Some(steps), None) => steps.whole(),
            (None, Some(given)) => {
                duration = given.number();
                let steps = duration.zip(dt).map(|(duration, dt)| steps_of(duration, dt));
                if steps.is_some_and(|steps| steps > MOST_STEPS) {
                    given.fail("is more steps than the maximum");
                }
                steps
            }
            (None, None) => {
                section.fail("`steps` is missing: a whole number; or `duration` [s]");
                None
            }
            (Some(_), Some(_)) => {
                section.fail("give either `steps` or `duration`, not both");
                None
            }
        };
        let allow_unstable = section.boolean_or("allow_unstable", false);
        let (dt, steps, allow_unstable) = (dt?, steps?, allow_unstable?);
        Some(Self { dt, own_step, steps, duration, allow_unstable })
    }
}

/// Largest number of steps.
const MOST_STEPS: u64 = 1_000_000_000_000_000_000;

/// Stable limit of the time step, if any contact can push.
struct Limit {
    found: Option<TimeStepLimit>,
    /// Name of the shape that sets it.
    shape: String,
    /// Addition to the message about its stiffness.
    with: &'static str,
}

impl Limit {
    fn of(law: &Choice, library: &Library) -> Self {
        let with = if law.resists_turning() { ", including rotation on springs" } else { "" };
        let found = time_step_limit(library, &*law.law(library));
        let shape = found.as_ref().map(|limit| library.names[limit.shape.index()].clone());
        Self { found, shape: shape.unwrap_or_default(), with }
    }

    /// Automatic step [s].
    fn own_step(&self, given: &Given) -> Option<f64> {
        let Some(limit) = &self.found else {
            given
                .fail("no contact has a stiffness, so there is no stable limit: give a number [s]");
            return None;
        };
        let step = own_step(limit.dt);
        if step.is_normal() {
            return Some(step);
        }
        given.fail(self.out_of_range(limit));
        None
    }

    /// Error for a limit that is no positive number.
    fn out_of_range(&self, limit: &TimeStepLimit) -> String {
        format!(
            "the stable limit of shape `{}` is {:e} s, out of the range of numbers: check its `density`, size and stiffness",
            self.shape, limit.dt
        )
    }

    fn check(&self, section: &Section, time: &Time, library: &Library) {
        let (Some(limit), Some(given), false) =
            (&self.found, section.get("step"), time.allow_unstable)
        else {
            return;
        };
        if !limit.dt.is_normal() {
            given.fail(self.out_of_range(limit));
        } else if time.dt > limit.dt {
            given.fail(format!(
                "over the stable limit of {:.2e} s, set by shape `{}` ({}{}); use step = \"auto\", a shorter step, \
                 more mass or less stiffness, or set time.allow_unstable = true",
                // Rounded down, so that the number itself is allowed.
                printed_limit(limit.dt),
                self.shape,
                limit.words(library),
                self.with
            ));
        }
    }
}

struct Output {
    directory: PathBuf,
    snapshot_every: u64,
    snapshot_every_minutes: Option<f64>,
    history_every: u64,
}

impl Output {
    fn read(section: &Section) -> Option<Self> {
        let directory = section.require("directory").and_then(|given| given.text());
        let snapshot_every = section.whole_or("snapshot_every", 0);
        let snapshot_every_minutes = section.optional("snapshot_every_minutes", Given::number);
        let history_every = section.whole_or("history_every", 100);
        Some(Self {
            directory: directory?.into(),
            snapshot_every: snapshot_every?,
            snapshot_every_minutes: snapshot_every_minutes?,
            history_every: history_every?,
        })
    }
}
