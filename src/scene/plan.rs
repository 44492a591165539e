//! Contents and cost of a scene, printed before it runs: `dem-mpi --plan`.

use super::bed::Share;
use super::doubts::doubts;
use super::element;
use super::packing;
use super::pieces;
use super::workload::Workload;
use super::{Control, Fill, Goal, Mix, Scene, Servo, Stop};
use crate::cell::{AXES, Face, Shear};
use crate::contact::{ContactResolver, Patch, StateColumn, table};
use crate::contacts::CONTACT_COLUMNS;
use crate::domain::halo_width;
use crate::drive::groups;
use crate::drive::ledger::Ledger;
use crate::drive::rain::{LOOKED_AT, Within};
use crate::ids::{MaterialId, ShapeId};
use crate::math::{ExactSum, Vec3};
use crate::output::header::Header;
use crate::output::snapshot::{Reader, contact_bytes, particle_bytes};
use crate::output::tables::PARTICLE_COLUMNS;
use crate::shape::moments::Placement;
use crate::shape::{Convex as _, Kind, Shape, Union};
use crate::sim::run::Pace;
use crate::text::{counted, listed};
use crate::walls::{Mesh, Wall};
use indicatif::HumanDuration;
use std::collections::BTreeSet;
use std::fmt::Display;
use std::time::Duration;

/// Contacts over particles in a bed, in estimates.
const CONTACTS_PER_PARTICLE: u64 = 4;

/// Estimated time to make a cell behind a triangle, and to check another triangle for it [s].
const SECONDS_PER_CELL: f64 = 1e-5;
const SECONDS_PER_LOOK: f64 = 5e-8;
/// Number of shapes and pairs of materials that are listed; the others are counted.
const SHOWN: usize = 50;

/// Parts of the model in use and left out, with reasons, and the resulting bytes, messages and time
/// steps on this number of ranks. Numbers of particles per rank are estimates for the settled bed.
pub fn plan(scene: &Scene, ranks: u32) -> String {
    let mut page = Page(format!("{}\n", scene.title));
    what_is_in(scene, &mut page);
    what_is_left_out(scene, &mut page);
    what_it_costs(scene, ranks, &mut page);
    time(scene, &mut page);
    page.0
}

/// Checks that this number of ranks can hold the initial particles.
///
/// # Errors
/// If one rank needs more than the memory of a machine [bytes] for their columns alone.
pub fn fits(scene: &Scene, ranks: u32, memory: f64) -> Result<(), String> {
    let count = scene.initial.iter().map(Fill::count).sum::<u64>();
    let needed = count as f64 / f64::from(ranks.max(1)) * scene.needs().column_bytes() as f64;
    if needed <= memory {
        return Ok(());
    }
    Err(format!(
        "fill: {count} particles need at least {} on each rank, and a machine has {}; use fewer particles, a wider \
         `spacing`, a smaller domain, or more machines",
        size(needed),
        size(memory)
    ))
}

/// Lines of text in sections, labels in one column.
struct Page(String);

impl Page {
    fn section(&mut self, title: &str) {
        self.0.extend(["\n", title, "\n"]);
    }

    fn text(&mut self, text: &str) {
        self.0.extend(["  ", text, "\n"]);
    }

    fn line(&mut self, label: &str, text: impl Display) {
        self.text(&format!("{label:<16}{text}"));
    }
}

fn what_is_in(scene: &Scene, page: &mut Page) {
    page.section("In");
    if let Some(start) = &scene.start {
        let place = start.display();
        page.line(
            "start",
            Reader::open(start).map_or_else(
                |_| format!("the particles of {place}"),
                |held| {
                    let (count, Header { step, time, .. }) = (held.particle_count(), held.header());
                    format!("{count} particles of {place}, step {step}, {time:.6} s")
                },
            ),
        );
    }
    for fill in &scene.initial {
        let how = match fill {
            Fill::Lattice(lattice) => format!("on a lattice of {:?}", lattice.count),
            Fill::Listed(_) => "from a file".to_owned(),
        };
        page.line("fill", format!("{} particles {how}", fill.count()));
        if let Fill::Lattice(lattice) = fill {
            shares(scene, &lattice.mix, page);
        }
    }
    if let Some(rain) = &scene.rain {
        let interval = rain.interval(&scene.gravity, &scene.domain, scene.dt);
        page.line(
            "rain",
            format!(
                "{} particles in {} layers of {}, one in {} steps",
                rain.count,
                rain.layers(),
                rain.in_layer(),
                interval.unwrap_or(rain.every)
            ),
        );
        shares(scene, &rain.mix, page);
        if let Some(Within { region, places, free }) = &rain.within {
            let words = region.words();
            let free = if rain.per_layer() > LOOKED_AT {
                format!("{places} cells in a layer, too many to check")
            } else {
                format!("about {free} of {places} places are clear of walls")
            };
            page.line("", format!("{words}: {free}"));
        }
    }
    for inlet in &scene.inlets {
        page.line("inlet", format!("{}: {}", inlet.name, inlet.words()));
        shares(scene, &inlet.mix, page);
    }
    for outlet in &scene.outlets {
        let every = format!("checked every {} steps", outlet.every);
        page.line("outlet", format!("{}: {}, {every}", outlet.name, outlet.region.words()));
    }
    groups(scene, page);
    shapes(scene, page);
    walls(scene, page);
    contacts(scene, page);
    if scene.audit.every > 0 {
        page.line("audit", scene.audit.words());
        if !scene.library.pieces.is_empty() {
            page.line("", "without contacts of unions");
        }
    }
    let needs = scene.needs();
    let columns = [
        (true, "position, velocity, force"),
        (needs.spin, "angular velocity, torque"),
        (needs.orientation, "orientation, angular momentum"),
        (needs.image, "period counts"),
        (needs.scale, "scales"),
        (needs.ahead, "predicted velocity increments"),
    ];
    let columns: Vec<&str> =
        columns.iter().filter(|(is_in, _)| *is_in).map(|&(_, name)| name).collect();
    page.line("columns", columns.join("; "));
}

/// Law of the contacts, its constants, and the method for each pair of kinds.
fn contacts(scene: &Scene, page: &mut Page) {
    let law = scene.force_law();
    page.line("law", law.about().name());
    let pairs = pairs_of_materials(scene);
    for &(a, b) in pairs.iter().take(SHOWN) {
        let words = law.about().words(a, b);
        let [a, b] = [a, b].map(|id| &*scene.materials[id.index()].name);
        page.line("constants", format!("{a}-{b}: {words}"));
    }
    if pairs.len() > SHOWN {
        page.line("", format!("and {} more pairs of materials", pairs.len() - SHOWN));
    }
    for limit in law.about().limits() {
        page.line("bounds", limit);
    }
    for (a, b) in pairs_of_kinds(scene) {
        let how = resolver(scene, a, b);
        let mut line = |name: &str, how: &str| {
            page.line("contacts", format!("{}-{name}: {how}", a.name()));
        };
        if b != Kind::TriangleMesh {
            line(b.name(), how);
            continue;
        }
        let surfaces = || scene.walls.iter().filter_map(|wall| wall.mesh.as_ref());
        if surfaces().any(|mesh| !mesh.surface.is_exact()) {
            line(b.name(), how);
        }
        if surfaces().any(|mesh| mesh.surface.is_exact()) {
            line("round-wall", if how == FACETS { "side and ends" } else { how });
        }
    }
}

/// Held and pushed groups.
fn groups(scene: &Scene, page: &mut Page) {
    if scene.groups.is_empty() {
        return;
    }
    let mut counts = vec![0_u64; scene.groups.len() + 1];
    for mut particle in packing::initial(scene) {
        groups::join(&scene.groups, &mut particle, &scene.library, &scene.domain);
        counts[usize::from(particle.group)] += 1;
    }
    for (group, count) in scene.groups.iter().zip(&counts[1..]) {
        let beside = if scene.start.is_some() { ", and those of the snapshot" } else { "" };
        let later = if group.who.by_inlet { ", and those of its inlets" } else { beside };
        let (name, does) = (&group.name, group.what.words());
        page.line("group", format!("{name}: {count} particles{later}; {does}"));
    }
}

/// Shares of a mix, by number and by mass.
fn shares(scene: &Scene, mix: &Mix, page: &mut Page) {
    if mix.shapes().count() < 2 {
        return;
    }
    let library = &scene.library;
    let mean = library.mean_over(mix, |shape| library.mass[shape.index()]);
    let all = |of_share: &dyn Fn(ShapeId, f64) -> f64| {
        let one = |(shape, share): (ShapeId, f64)| {
            format!("{} {:.2} %", library.names[shape.index()], 100.0 * of_share(shape, share))
        };
        listed(mix.shares().map(one), SHOWN)
    };
    let by_number = all(&|_, share| share);
    let by_mass = all(&|shape, share| share * library.mean_mass(shape) / mean);
    page.line("", format!("shares by number: {by_number}; by mass: {by_mass}"));
}

fn shapes(scene: &Scene, page: &mut Page) {
    let library = &scene.library;
    let own = &library.shapes[..library.own_shapes()];
    for (index, shape) in own.iter().enumerate().take(SHOWN) {
        let size = if let Shape::Sphere(sphere) = shape {
            format!("radius {:.4e} m", sphere.radius)
        } else {
            let [a, b, c]: [f64; 3] = shape.semi_axes().into();
            let what = if shape.kind() == Kind::Ellipsoid { "semi-axes" } else { "half lengths" };
            format!("{what} {a:.4e}, {b:.4e}, {c:.4e} m")
        };
        let (name, mass) = (&library.names[index], library.mass[index]);
        let material = &scene.materials[library.materials[index].index()].name;
        let kind = shape.kind().name();
        page.line("shape", format!("{name}: {kind} of {material}, {size}, {mass:.4e} kg"));
        let [least, largest] = library.scales[index];
        if [least, largest] != [1.0; 2] {
            let words = library.sizes[index].words();
            let drawn = if words.is_empty() { words } else { format!("; drawn: {words}") };
            page.line("", format!("lengths from {least:?} to {largest:?} times these{drawn}"));
        }
        if let Shape::Union(body) = shape {
            page.line("", pieces_of(body));
        }
        if let Some(Placement { centre, axes }) = shape.placement() {
            let ([x, y, z], q): ([f64; 3], _) = ((*centre).into(), axes.quaternion());
            page.line(
                "",
                format!(
                    "its centre is at [{x:.4e}, {y:.4e}, {z:.4e}] m in its file, its axes are rotated by the \
                     quaternion [{:.6}, {:.6}, {:.6}, {:.6}]",
                    q.w, q.i, q.j, q.k
                ),
            );
        }
    }
    if own.len() > SHOWN {
        page.line("", format!("and {} more shapes", own.len() - SHOWN));
    }
}

/// Number of pieces, and their accuracy.
pub(super) fn pieces_of(body: &Union) -> String {
    let (count, error) = (body.pieces().len(), body.error());
    let volume = body.volume();
    if body.far() > 0.0 {
        return format!(
            "{count} pieces approximate a mesh of {volume:.4e} m3: volume error {:+.2} %, distance up to {:.3e} m \
             ({})",
            100.0 * error,
            body.far(),
            pieces::cut_by()
        );
    }
    let known = if error > 0.0 { format!("to {error:.1e}") } else { "exact".to_owned() };
    format!("{count} pieces of {volume:.4e} m3, {known}")
}

fn walls(scene: &Scene, page: &mut Page) {
    let walls = |moving: bool| {
        let names = scene.walls.iter().filter(|wall| wall.moves == moving);
        listed(names.map(|wall| wall.name.as_str()), SHOWN)
    };
    let belts = scene.walls.iter().filter(|wall| wall.is_belt());
    let belts = belts.map(|wall| format!("{}: {:?} m/s", wall.name, wall.surface_velocity.norm()));
    let belts = listed(belts, SHOWN);
    let wearing = scene.walls.iter().filter(|wall| wall.wears).map(|wall| {
        let triangles = wall.mesh.as_ref().map_or(0, |mesh| mesh.surface.len());
        let bytes = Ledger::BYTES * (triangles + 1);
        format!("{}: {} kB on every rank", wall.name, bytes.div_ceil(1000))
    });
    let wearing = listed(wearing, SHOWN);
    for (label, names) in [
        ("fixed walls", walls(false)),
        ("moving walls", walls(true)),
        ("belts", belts),
        ("wear", wearing),
    ] {
        if !names.is_empty() {
            page.line(label, names);
        }
    }
    for wall in &scene.walls {
        if let Some(motion) = motion(wall) {
            page.line("motion", format!("{}: {motion}", wall.name));
        }
    }
    for wall in &scene.walls {
        let Some(Mesh { surface, .. }) = &wall.mesh else { continue };
        let label = if surface.is_exact() { "round wall" } else { "triangles" };
        page.line(label, format!("{}: {}", wall.name, surface.summary()));
        let [cells, looked_at] = surface.cells_made();
        let seconds = SECONDS_PER_CELL * cells as f64 + SECONDS_PER_LOOK * looked_at as f64;
        if seconds >= 1.0 {
            page.line(
                "",
                format!(
                    "{cells} cells behind them are built at each start, in about {seconds:.0} s"
                ),
            );
        }
        if let Some((low, high)) = wall.extent() {
            let [low, high] =
                [low, high].map(|v| format!("[{:.3e}, {:.3e}, {:.3e}]", v.x, v.y, v.z));
            page.line("", format!("from {low} to {high} m"));
        }
    }
    if let Some(Shear { along, across, rate, .. }) = scene.domain.shear() {
        let axes = format!("along {}, velocity increases with {}", AXES[along], AXES[across]);
        page.line(
            "images slide",
            format!(
                "{axes}: {rate} 1/s; velocities change at the faces, and each contact \
             checks this"
            ),
        );
    }
    if let Some(control) = &scene.cell {
        page.line("cell", element::words(control));
    }
    for servo in &scene.servos {
        page.line("servo", steered(scene, servo));
    }
}

/// Text about the target of a servo and its motion.
fn steered(scene: &Scene, servo: &Servo) -> String {
    let kept = match servo.goal {
        Goal::Stress(stress) => format!("{stress:e} Pa"),
        Goal::Force { newtons, along: Some(a) } => {
            format!("{newtons:e} N along [{}, {}, {}]", a.x, a.y, a.z)
        }
        Goal::Force { newtons, along: None } => format!("{newtons:e} N along the normal"),
    };
    let over = match servo.goal {
        Goal::Stress(_) => {
            let area = servo.area(&scene.walls, &scene.domain);
            let place = if scene.start.is_some() { " if walls are as in the scene" } else { "" };
            format!(", over {area:.4e} m2{place}")
        }
        Goal::Force { .. } => String::new(),
    };
    let names = servo.names(&scene.walls);
    format!("{names}: {kept}, at most {:e} m/s, gain {}{over}", servo.max_speed, servo.gain)
}

/// Text about the motion of a wall without a servo.
fn motion(wall: &Wall) -> Option<String> {
    if let Some(course) = &wall.course {
        return Some(course.summary());
    }
    if wall.mass.is_finite() {
        return Some(format!("freely, {} kg", wall.mass));
    }
    let at = |v: &Vec3| format!("[{}, {}, {}]", v.x, v.y, v.z);
    let (v, w) = (&wall.velocity, &wall.angular_velocity);
    let shift = (*v != Vec3::zeros()).then(|| format!("velocity {} m/s", at(v)));
    let turn = (*w != Vec3::zeros())
        .then(|| format!("rotates at {} rad/s about {} m", at(w), at(&wall.point)));
    let parts: Vec<String> = shift.into_iter().chain(turn).collect();
    (!parts.is_empty()).then(|| parts.join(", "))
}

/// Pairs of materials that can meet.
fn pairs_of_materials(scene: &Scene) -> Vec<(MaterialId, MaterialId)> {
    let library = &scene.library;
    let grains: BTreeSet<_> = library.materials[..library.particle_shapes].iter().collect();
    let all: BTreeSet<_> = library.materials.iter().collect();
    let with = |&a: &MaterialId| all.range(a..).map(move |&&b| (a, b));
    let mut pairs: Vec<_> = all.iter().copied().flat_map(with).collect();
    pairs.retain(|(a, b)| grains.contains(a) || grains.contains(b));
    pairs
}

/// Pairs of kinds of shapes that can meet.
fn pairs_of_kinds(scene: &Scene) -> Vec<(Kind, Kind)> {
    let mut present = scene.particle_kinds();
    present.extend(scene.facet_kinds());
    let mut pairs = Vec::new();
    for (k, &a) in present.iter().enumerate() {
        pairs.extend(present[k..].iter().map(|&b| (a, b)));
    }
    pairs.retain(|&(a, _)| !a.is_of_walls());
    pairs
}

/// Parts of triangles that particles touch.
const FACETS: &str = "faces, edges, corners";

fn resolver(scene: &Scene, a: Kind, b: Kind) -> &'static str {
    match (a, b, scene.method) {
        (_, _, method) if method.is_by_thickness((a, b)) && a.has_side() => {
            "thickness along straight sides; share of the normal stiffness: parallel sides 1, crossing sides 0.69, \
             round ends 0.5"
        }
        (_, _, method) if method.is_by_thickness((a, b)) => {
            "thickness of the overlap; share of the normal stiffness: faces 1, edges 0.5, corner of a box 0.3, tip of \
             a regular tetrahedron 0.15"
        }
        (Kind::Sphere, Kind::Sphere, _) | (_, Kind::HalfSpace, _) => "closed form",
        (_, Kind::TriangleMesh, _) => FACETS,
        (_, _, method) => table(&method, &[a, b]).get((a, b)).map_or("none", ContactResolver::name),
    }
}

fn what_is_left_out(scene: &Scene, page: &mut Page) {
    let needs = scene.needs();
    let law = scene.force_law();
    let is_open = |face: &Face| {
        let mut across = scene.walls.iter().filter_map(Wall::across);
        let closed =
            across.any(|wall| wall.axis == face.axis && wall.inwards == face.normal[face.axis]);
        !face.repeats && !closed
    };
    let open = scene.domain.faces().into_iter().filter(is_open);
    let open: Vec<&str> = open.map(|face| face.name).collect();
    let could_slide = scene.domain.repeating_axes().count() > 1;
    let not_saved = PARTICLE_COLUMNS.iter().filter(|column| !column.is_there(&needs));
    let not_saved: Vec<&str> = not_saved.map(|column| column.name).collect();
    let reasons = [
        (!needs.orientation, "no orientation: all shapes are spheres".to_owned()),
        (!needs.spin, "no rotation: spheres without friction have no moment".to_owned()),
        (!needs.velocity, "no velocities of ghosts: no friction, no dashpots".to_owned()),
        (!needs.image, "no period counts: no axis is periodic".to_owned()),
        (could_slide && !scene.domain.moves(), "no sliding images: no domain.shear".to_owned()),
        (!needs.scale, "no scales: all particles are as large as their shapes".to_owned()),
        (scene.global_damping == 0.0, "no global damping".to_owned()),
        (scene.gravity == Vec3::zeros(), "no gravity".to_owned()),
        (scene.stop == Stop::default(), "no stop criterion: the stage runs all steps".to_owned()),
        (scene.audit.every == 0, "no audit of contacts: audit.every = 0".to_owned()),
        (
            scene.servos.is_empty()
                && scene.free_walls.is_empty()
                && !scene.cell.as_ref().is_some_and(Control::has_target),
            "no sum over all ranks in each step: no servos".to_owned(),
        ),
        (
            scene.rain.is_none() && scene.inlets.is_empty(),
            "no insertion: no rain, no inlet".to_owned(),
        ),
        (!scene.walls.iter().any(Wall::may_work), "no work of walls: no moving walls".to_owned()),
        (!not_saved.is_empty(), format!("not in snapshots: {}", not_saved.join(", "))),
        (!open.is_empty(), format!("no walls on these sides of the domain: {}", open.join(", "))),
    ];
    page.section("Left out");
    let reasons = reasons.into_iter().filter(|(is_out, _)| *is_out).map(|(_, reason)| reason);
    let of_law = law.about().left_out().into_iter().map(str::to_owned);
    let mut reasons = of_law.chain(reasons).peekable();
    if reasons.peek().is_none() {
        page.text("nothing");
    }
    for reason in reasons {
        page.text(&reason);
    }
}

fn what_it_costs(scene: &Scene, ranks: u32, page: &mut Page) {
    let needs = scene.needs();
    let held = scene.start.as_ref().map(|start| Reader::open(start).map(|r| r.particle_count()));
    page.section("Memory and messages");
    page.line("owned particle", format!("{} bytes in columns", needs.column_bytes()));
    let remembered = scene.force_law();
    let state = remembered.state();
    let mut words = vec![format!("{CONTACT_COLUMNS} bytes of bodies, normal, overlap and force")];
    if needs.orientation {
        words.push("24 of the point".to_owned());
    }
    if needs.patches {
        words.push(format!("{} of the patch", size_of::<Patch>()));
    }
    for StateColumn { name, width, .. } in state {
        words.push(format!("{} of `{name}`", width * size_of::<f64>()));
    }
    page.line("contact", words.join(", "));
    page.line("ghost", format!("{} bytes in the message of each step", 8 * needs.halo_values()));
    let outlives = scene.law.reach(scene.library.largest_radius());
    let reach = halo_width(&scene.library, scene.skin, outlives);
    // Force and stiffness of walls moved by forces.
    let sums = 2 * (scene.servos.len() + scene.free_walls.len());
    if sums > 0 {
        let bytes = sums * 8 * ExactSum::LIMBS;
        page.line("sums", format!("a sum of {bytes} bytes over all ranks in each step"));
    }
    let gap = if outlives > 0.0 {
        format!(", and {outlives:.3e} m over which contacts outlive their overlap")
    } else {
        String::new()
    };
    page.line("halo width", format!("{reach:.4e} m, largest bounding diameter and skin{gap}"));
    let ranks_seen = format!("({})", counted(ranks, "rank"));
    let mut count = scene.particle_count();
    if let Some(held) = held {
        count += held.unwrap_or_default() as u64;
        page.line("particles", format!("{count} in all {ranks_seen}"));
    } else {
        let share = Share::estimate(scene, ranks, reach);
        page.line(
            "rank",
            format!(
                "about {:.0} owned and {:.0} ghost particles, {} neighbours {ranks_seen}",
                share.owned, share.ghosts, share.neighbours,
            ),
        );
        page.line(
            "step",
            format!(
                "about {} sent by the busiest rank",
                size(share.ghosts * 8.0 * needs.halo_values() as f64)
            ),
        );
    }
    let particles = count * particle_bytes(&scene.needs()) as u64;
    let contacts = count * CONTACTS_PER_PARTICLE * contact_bytes(scene.force_law().state()) as u64;
    // One at the start, the scheduled ones, and one at the end.
    let snapshots = match scene.snapshot_every {
        0 => 2,
        every => 1 + scene.steps.div_ceil(every),
    };
    page.line(
        "snapshot",
        format!(
            "about {} of particles, {} of contacts; {snapshots} in all, about {}{}",
            size(particles as f64),
            size(contacts as f64),
            size((particles + contacts) as f64 * snapshots as f64),
            (scene.snapshot_every_minutes)
                .map_or_else(String::new, |most| format!(", and more every {most} minutes"))
        ),
    );
}

fn time(scene: &Scene, page: &mut Page) {
    page.section("Time");
    if let Some(limit) = scene.time_step_limit() {
        let name = &scene.library.names[limit.shape.index()];
        page.line(
            "step",
            format!(
                "{:e} s, {:.0} % of the stable limit {:.2e} s (set by shape {name}, {})",
                scene.dt,
                100.0 * scene.dt / limit.dt,
                limit.dt,
                limit.words(&scene.library)
            ),
        );
        if scene.dt > limit.dt {
            page.line("", "OVER THE LIMIT: the run may be unstable");
        }
    }
    for doubt in doubts(scene) {
        page.line("warning", doubt);
    }
    page.line("steps", format!("{}, {:.4} s", scene.steps, scene.steps as f64 * scene.dt));
}

/// Line with the expected run time, by the pace of its first steps on this number of ranks.
pub fn run_time(scene: &Scene, workload: &Workload, pace: &Pace, ranks: u32) -> String {
    let mut page = Page(String::new());
    if pace.particle_steps > 0.0 && workload.all() > 0.0 {
        let seconds = workload.all() * pace.seconds / pace.particle_steps;
        // A drum and a hopper took 4.6 and 3.3 times the time of free particles, settled spheres in a box 2.2 times.
        let is_loose = pace.coordination < 1.0;
        let time = HumanDuration(Duration::from_secs_f64(seconds.clamp(1.0, 1e15)));
        page.line(
            "run time",
            format!(
                "{} {time} on {} here, by {} steps of {:.2e} s; a particle has {:.1} contacts{}{}",
                if is_loose { "at least" } else { "about" },
                counted(ranks, "rank"),
                pace.steps,
                pace.seconds / pace.steps as f64,
                pace.coordination,
                if is_loose {
                    ", and settled particles take two to five times as long"
                } else {
                    ""
                },
                if scene.stop == Stop::default() { "" } else { ". [stop] may end it earlier" }
            ),
        );
    }
    page.0.push('\n');
    page.0
}

/// Bytes with a readable unit.
fn size(bytes: f64) -> String {
    match bytes {
        b if b < 1e3 => format!("{b:.0} bytes"),
        b if b < 1e6 => format!("{:.1} kB", b / 1e3),
        b if b < 1e9 => format!("{:.1} MB", b / 1e6),
        b => format!("{:.1} GB", b / 1e9),
    }
}
