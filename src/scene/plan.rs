//! What a scene will cost, printed before it runs: `dem-mpi --plan`.

use super::doubts::doubts;
use super::{Fill, Mix, Scene, Stop};
use crate::cell::{AXES, SIDES, Shear};
use crate::contact::{ContactResolver, Patch, StateColumn, table};
use crate::contacts::CONTACT_COLUMNS;
use crate::domain::halo_width;
use crate::ids::MaterialId;
use crate::math::{ExactSum, Vec3};
use crate::output::snapshot::{contact_bytes, particle_bytes};
use crate::output::tables::PARTICLE_COLUMNS;
use crate::particles::walls::{Mesh, Wall};
use crate::shape::moments::Placement;
use crate::shape::{Kind, Shape};
use std::collections::BTreeSet;
use std::f64::consts::PI;
use std::fmt::Display;

/// Volume of particles over volume of the bed, in estimates.
const PACKING_FRACTION: f64 = 0.6;
/// Contacts over particles in a bed, in estimates.
const CONTACTS_PER_PARTICLE: u64 = 4;

/// What is in, what is left out and why, and the bytes, messages and time steps that follow, for a run
/// on so many ranks. Numbers of particles per rank are estimates for the settled bed.
pub fn plan(scene: &Scene, ranks: u32) -> String {
    let mut page = Page(format!("{}\n", scene.title));
    what_is_in(scene, &mut page);
    what_is_left_out(scene, &mut page);
    what_it_costs(scene, ranks, &mut page);
    time(scene, &mut page);
    page.0
}

/// Whether so many ranks can hold the particles of the start.
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
        "fill: {count} particles need at least {} on each rank, and a machine has {}; take fewer, a wider `spacing`, a smaller domain, or more \
         machines",
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
        page.line("start", format!("the particles of {}", start.display()));
    }
    for fill in &scene.initial {
        let how = match fill {
            Fill::Lattice(lattice) => format!("on a lattice of {:?}", lattice.count),
            Fill::Listed(_) => "from a file".to_owned(),
        };
        page.line("fill", format!("{} particles {how}", fill.count()));
    }
    if let Some(rain) = &scene.rain {
        page.line(
            "rain",
            format!(
                "{} particles in {} layers of {}, one in {} steps",
                rain.count,
                rain.layers(),
                rain.per_layer(),
                rain.interval(&scene.gravity, scene.domain.periodic(), scene.dt)
                    .unwrap_or(rain.every)
            ),
        );
    }
    for inlet in &scene.inlets {
        page.line("inlet", format!("{}: {}", inlet.name, inlet.words()));
    }
    for outlet in &scene.outlets {
        let every = format!("looked at every {} steps", outlet.every);
        page.line("outlet", format!("{}: {}, {every}", outlet.name, outlet.region.words()));
    }
    shapes(scene, page);
    walls(scene, page);
    let law = scene.force_law();
    page.line("law", law.name());
    for (a, b) in pairs_of_materials(scene) {
        let words = law.words(a, b);
        let [a, b] = [a, b].map(|id| &*scene.materials[id.index()].name);
        page.line("constants", format!("{a}-{b}: {words}"));
    }
    for limit in law.limits() {
        page.line("bounds", limit);
    }
    for (a, b) in pairs_of_kinds(scene) {
        page.line("contacts", format!("{}-{}: {}", a.name(), b.name(), resolver(scene, a, b)));
    }
    if scene.audit.every > 0 {
        page.line("audit", scene.audit.words());
    }
    let needs = scene.needs();
    let columns = [
        (true, "position, velocity, force"),
        (needs.spin, "angular velocity, torque"),
        (needs.orientation, "orientation, angular momentum"),
        (needs.image, "counts of periods"),
        (needs.scale, "scales"),
    ];
    let columns: Vec<&str> =
        columns.iter().filter(|(is_in, _)| *is_in).map(|&(_, name)| name).collect();
    page.line("columns", columns.join("; "));
}

fn shapes(scene: &Scene, page: &mut Page) {
    let library = &scene.library;
    for (index, shape) in library.shapes[..library.particle_shapes].iter().enumerate() {
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
        if let Some(Placement { centre, axes }) = shape.placement() {
            let ([x, y, z], q): ([f64; 3], _) = ((*centre).into(), axes.quaternion());
            page.line(
                "",
                format!(
                    "its centre lies at [{x:.4e}, {y:.4e}, {z:.4e}] m of its file, its axes turned \
                     by the quaternion [{:.6}, {:.6}, {:.6}, {:.6}]",
                    q.w, q.i, q.j, q.k
                ),
            );
        }
    }
}

fn walls(scene: &Scene, page: &mut Page) {
    let walls = |moving: bool| {
        let names = scene.walls.iter().filter(|wall| wall.moves == moving);
        names.map(|wall| wall.name.as_str()).collect::<Vec<_>>().join(", ")
    };
    for (label, names) in [("fixed walls", walls(false)), ("moving walls", walls(true))] {
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
        page.line("triangles", format!("{}: {}", wall.name, surface.summary()));
        if let Some((low, high)) = wall.extent() {
            let [low, high] =
                [low, high].map(|v| format!("[{:.3e}, {:.3e}, {:.3e}]", v.x, v.y, v.z));
            page.line("", format!("from {low} to {high} m"));
        }
    }
    if let Some(Shear { along, across, rate, .. }) = scene.domain.shear() {
        let axes = format!("along {}, faster the farther up {}", AXES[along], AXES[across]);
        page.line("images slide", format!("{axes}: {rate} 1/s; at the faces bodies change velocity, and each contact looks for it"));
    }
    for servo in &scene.servos {
        page.line(
            "servo",
            format!(
                "{}: {:e} Pa, at most {:e} m/s, gain {}",
                servo.names(&scene.walls),
                servo.stress,
                servo.max_speed,
                servo.gain
            ),
        );
    }
}

/// How a wall moves that no servo drives, in words.
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
        .then(|| format!("turns with {} rad/s about {} m", at(w), at(&wall.point)));
    let parts: Vec<String> = shift.into_iter().chain(turn).collect();
    (!parts.is_empty()).then(|| parts.join(", "))
}

/// Which materials can meet.
fn pairs_of_materials(scene: &Scene) -> BTreeSet<(MaterialId, MaterialId)> {
    let (grains, all) =
        (&scene.library.materials[..scene.library.particle_shapes], &scene.library.materials);
    let with = |&a: &MaterialId| all.iter().map(move |&b| (a.min(b), a.max(b)));
    grains.iter().flat_map(with).collect()
}

/// Which kinds of shapes can meet.
fn pairs_of_kinds(scene: &Scene) -> Vec<(Kind, Kind)> {
    let present: Vec<Kind> = Kind::ALL
        .into_iter()
        .filter(|kind| scene.library.shapes.iter().any(|shape| shape.kind() == *kind))
        .collect();
    let mut pairs = Vec::new();
    for (k, &a) in present.iter().enumerate() {
        pairs.extend(present[k..].iter().map(|&b| (a, b)));
    }
    pairs.retain(|&(a, _)| !a.is_of_walls());
    pairs
}

fn resolver(scene: &Scene, a: Kind, b: Kind) -> &'static str {
    match (a, b, scene.method) {
        (_, _, method) if method.is_by_thickness((a, b)) && a.has_side() => {
            "thickness along straight sides; of the normal stiffness sides that lie flat have all, crossing ones 0.69, round ends half"
        }
        (_, _, method) if method.is_by_thickness((a, b)) => {
            "thickness of what they share; of the normal stiffness faces have all, edges half, the corner of a box 0.3, the tip of \
             a regular tetrahedron 0.15"
        }
        (Kind::Sphere, Kind::Sphere, _) | (_, Kind::HalfSpace, _) => "closed form",
        (_, Kind::TriangleMesh, _) => "faces, edges, corners",
        (_, _, method) => table(&method, &[a, b]).get((a, b)).map_or("none", ContactResolver::name),
    }
}

fn what_is_left_out(scene: &Scene, page: &mut Page) {
    let needs = scene.needs();
    let law = scene.force_law();
    let open: Vec<&str> = SIDES
        .into_iter()
        .filter(|&(_, axis, inwards)| {
            let mut across = scene.walls.iter().filter_map(Wall::across);
            let closed = across.any(|wall| wall.axis == axis && wall.inwards == inwards);
            scene.domain.period(axis).is_none() && !closed
        })
        .map(|(name, _, _)| name)
        .collect();
    let could_slide = scene.domain.periodic().into_iter().filter(|periodic| *periodic).count() > 1;
    let not_saved = PARTICLE_COLUMNS.iter().filter(|column| !column.is_there(&needs));
    let not_saved: Vec<&str> = not_saved.map(|column| column.name).collect();
    let reasons = [
        (!needs.orientation, "no orientation: all shapes are spheres".to_owned()),
        (!needs.spin, "no rotation: spheres without friction feel no moment".to_owned()),
        (!needs.velocity, "no velocities of ghosts: no friction, no dashpots".to_owned()),
        (!needs.image, "no counts of periods: no axis is periodic".to_owned()),
        (
            could_slide && scene.domain.shear().is_none(),
            "no images that slide: no domain.shear".to_owned(),
        ),
        (!needs.scale, "no scales: all particles are as large as their shapes".to_owned()),
        (scene.global_damping == 0.0, "no global damping".to_owned()),
        (scene.gravity == Vec3::zeros(), "no gravity".to_owned()),
        (scene.stop == Stop::default(), "no stop criterion: all steps are taken".to_owned()),
        (scene.audit.every == 0, "no audit of contacts: audit.every = 0".to_owned()),
        (
            scene.servos.is_empty() && scene.free_walls.is_empty(),
            "no sum over all ranks in each step: no servos".to_owned(),
        ),
        (
            scene.rain.is_none() && scene.inlets.is_empty(),
            "no insertion: no rain, no inlet".to_owned(),
        ),
        (!scene.walls.iter().any(|wall| wall.moves), "no work of walls: none moves".to_owned()),
        (!not_saved.is_empty(), format!("not in snapshots: {}", not_saved.join(", "))),
        (!open.is_empty(), format!("no walls on these sides of the domain: {}", open.join(", "))),
    ];
    page.section("Left out");
    let reasons = reasons.into_iter().filter(|(is_out, _)| *is_out).map(|(_, reason)| reason);
    let of_law = law.left_out().into_iter().map(str::to_owned);
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
    let count = scene.particle_count();
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
    // Force and stiffness of walls that forces move.
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
    let ranks_seen = format!("({ranks} rank{})", if ranks == 1 { "" } else { "s" });
    if count == 0 || scene.start.is_some() {
        page.line("particles", format!("known when the start snapshot is read {ranks_seen}"));
        return;
    }
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
    let particles = count * particle_bytes(&scene.needs()) as u64;
    let contacts = count * CONTACTS_PER_PARTICLE * contact_bytes(scene.force_law().state()) as u64;
    // One at the start, those on schedule, and one at the end.
    let snapshots = match scene.snapshot_every {
        0 => 2,
        every => 1 + scene.steps.div_ceil(every),
    };
    page.line(
        "snapshot",
        format!(
            "about {} of particles, {} of contacts; {snapshots} in all",
            size(particles as f64),
            size(contacts as f64)
        ),
    );
}

/// The share of the busiest of several ranks in the settled bed.
struct Share {
    owned: f64,
    ghosts: f64,
    neighbours: usize,
}

impl Share {
    fn estimate(scene: &Scene, ranks: u32, reach: f64) -> Self {
        let bed = Block::bed(scene);
        let count = scene.particle_count() as f64;
        let sizes = Sizes::of(scene, &bed);
        let mut blocks = Vec::new();
        bed.cut(ranks.max(1), &mut blocks);
        let periodic = scene.domain.periodic();
        let mut share = Self { owned: count / f64::from(ranks.max(1)), ghosts: 0.0, neighbours: 0 };
        // A sample is enough where there are very many.
        for block in blocks.iter().step_by(1 + blocks.len() / 1024) {
            let halo = block.grown(reach, &bed, periodic);
            let ghosts = sizes.ghosts(block, &bed, periodic);
            let neighbours = blocks
                .iter()
                .filter(|other| !std::ptr::eq(*other, block) && halo.meets(other, &bed, periodic))
                .count();
            share.ghosts = share.ghosts.max(ghosts);
            share.neighbours = share.neighbours.max(neighbours);
        }
        share
    }
}

/// How the sizes of the particles are mixed in the bed.
struct Sizes {
    /// Bounding radius [m], and particles per volume [1/m³].
    classes: Vec<(f64, f64)>,
    skin: f64,
}

impl Sizes {
    fn of(scene: &Scene, bed: &Block) -> Self {
        // Of a shape of many sizes, all have the mean volume.
        let class = |(of_shape, &radius): (OfShape, &f64)| {
            (radius * of_shape.mean_volume().cbrt(), of_shape.count / bed.volume())
        };
        let classes = counts(scene).into_iter().zip(&scene.library.radius).map(class).collect();
        Self { classes, skin: scene.skin }
    }

    /// The particles around a block that are in a pair with one in it, as if all lay at random: of a layer
    /// at some distance, those that find at least one partner in the part of their reach beyond its face.
    fn ghosts(&self, block: &Block, bed: &Block, periodic: [bool; 3]) -> f64 {
        const LAYERS: u32 = 32;
        let largest = self.classes.iter().map(|&(radius, _)| radius).fold(0.0, f64::max);
        let of_class = |&(radius, density): &(f64, f64)| {
            let width = (radius + largest + self.skin) / f64::from(LAYERS);
            let volume = |layers| block.grown(f64::from(layers) * width, bed, periodic).volume();
            let in_layer = |layer| {
                let distance = (f64::from(layer) + 0.5) * width;
                let partners: f64 = (self.classes.iter())
                    .map(|&(other, density)| (radius + other + self.skin, density))
                    .filter(|&(reach, _)| reach > distance)
                    .map(|(reach, density)| density * cap(reach, reach - distance))
                    .sum();
                density * (volume(layer + 1) - volume(layer)) * (1.0 - (-partners).exp())
            };
            (0..LAYERS).map(in_layer).sum::<f64>()
        };
        self.classes.iter().map(of_class).sum()
    }
}

/// Volume of a spherical cap of this height [m³].
fn cap(radius: f64, height: f64) -> f64 {
    PI * height * height * (3.0 * radius - height) / 3.0
}

/// A box.
#[derive(Clone, Copy)]
struct Block {
    low: Vec3,
    high: Vec3,
}

impl Block {
    /// Where the particles will lie: on the side to which gravity pulls, or in the whole domain.
    fn bed(scene: &Scene) -> Self {
        let mut bed = Self { low: scene.domain.low(), high: scene.domain.high() };
        if scene.gravity != Vec3::zeros() {
            let axis = scene.gravity.iamax();
            let extent = bed.high[axis] - bed.low[axis];
            let full = bed.volume() / extent;
            let height = (solid_volume(scene) / PACKING_FRACTION / full).min(extent);
            if scene.gravity[axis] < 0.0 {
                bed.high[axis] = bed.low[axis] + height;
            } else {
                bed.low[axis] = bed.high[axis] - height;
            }
        }
        bed
    }

    fn volume(&self) -> f64 {
        (self.high - self.low).product()
    }

    /// Halves along the longest side until each rank has one.
    fn cut(self, ranks: u32, blocks: &mut Vec<Self>) {
        if ranks == 1 {
            blocks.push(self);
            return;
        }
        let extent = self.high - self.low;
        let axis = extent.imax();
        let lower_ranks = ranks / 2;
        let at = self.low[axis] + extent[axis] * f64::from(lower_ranks) / f64::from(ranks);
        let (mut lower, mut upper) = (self, self);
        lower.high[axis] = at;
        upper.low[axis] = at;
        lower.cut(lower_ranks, blocks);
        upper.cut(ranks - lower_ranks, blocks);
    }

    /// Wider by `by` on all sides, but not beyond the bed where that does not repeat, and nowhere wider than it.
    fn grown(&self, by: f64, bed: &Self, periodic: [bool; 3]) -> Self {
        let mut grown = Self { low: self.low.add_scalar(-by), high: self.high.add_scalar(by) };
        for (axis, repeats) in periodic.into_iter().enumerate() {
            let (low, high) = (bed.low[axis], bed.high[axis]);
            if !repeats {
                grown.low[axis] = grown.low[axis].max(low);
                grown.high[axis] = grown.high[axis].min(high);
            } else if grown.high[axis] - grown.low[axis] > high - low {
                (grown.low[axis], grown.high[axis]) = (low, high);
            }
        }
        grown
    }

    /// Does it overlap another or one of the other's periodic images?
    fn meets(&self, other: &Self, bed: &Self, periodic: [bool; 3]) -> bool {
        (0..3).all(|axis| {
            let period = if periodic[axis] { bed.high[axis] - bed.low[axis] } else { 0.0 };
            [-period, 0.0, period].into_iter().any(|shift| {
                other.low[axis] + shift < self.high[axis]
                    && other.high[axis] + shift > self.low[axis]
            })
        })
    }
}

/// Volume of all particles [m³].
fn solid_volume(scene: &Scene) -> f64 {
    let counts = counts(scene);
    counts.iter().zip(&scene.library.shapes).map(|(of, shape)| of.volume * shape.volume()).sum()
}

/// The particles of a shape.
#[derive(Clone, Copy, Default)]
struct OfShape {
    count: f64,
    /// Volume of all of them over that of the shape.
    volume: f64,
}

impl OfShape {
    /// Mean volume over that of the shape.
    fn mean_volume(self) -> f64 {
        if self.count > 0.0 { self.volume / self.count } else { 1.0 }
    }
}

/// How many particles of each shape there will be; of a mix, as its shares say.
fn counts(scene: &Scene) -> Vec<OfShape> {
    let mut counts = vec![OfShape::default(); scene.library.particle_shapes];
    let mut mixes: Vec<(&Mix, u64)> = scene.to_come().collect();
    for fill in &scene.initial {
        match fill {
            Fill::Lattice(lattice) => mixes.push((&lattice.mix, fill.count())),
            Fill::Listed(list) => {
                for row in list {
                    let of_shape = &mut counts[row.shape.index()];
                    of_shape.count += 1.0;
                    of_shape.volume += row.scale.powi(3);
                }
            }
        }
    }
    for (mix, count) in mixes {
        for (shape, share) in mix.shares() {
            let of_shape = &mut counts[shape.index()];
            let number = share * count as f64;
            of_shape.count += number;
            of_shape.volume += number * scene.library.sizes[shape.index()].mean_volume();
        }
    }
    counts
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
                limit.words()
            ),
        );
        if scene.dt > limit.dt {
            page.line("", "OVER THE LIMIT: the run may blow up");
        }
    }
    for doubt in doubts(scene) {
        page.line("warning", doubt);
    }
    page.line("steps", format!("{}, {:.4} s", scene.steps, scene.steps as f64 * scene.dt));
}

/// Bytes, as people read them.
fn size(bytes: f64) -> String {
    match bytes {
        b if b < 1e3 => format!("{b:.0} bytes"),
        b if b < 1e6 => format!("{:.1} kB", b / 1e3),
        b if b < 1e9 => format!("{:.1} MB", b / 1e6),
        b => format!("{:.1} GB", b / 1e9),
    }
}

#[cfg(test)]
mod tests {
    use super::{Block, Sizes};
    use crate::cell::Cell;
    use crate::math::Vec3;
    use crate::random::Random;

    /// Two sizes, 1:5, at random in a box that two ranks share and that repeats along their border: ghosts
    /// counted one by one.
    #[test]
    fn ghosts_of_unequal_sizes_are_as_many_as_counted() {
        let bed = Block { low: Vec3::zeros(), high: Vec3::repeat(1.0) };
        let mut block = bed;
        block.high.x = 0.5;
        let (classes, skin) = ([(0.03, 600), (0.15, 20)], 0.01);
        let sizes =
            Sizes { classes: classes.map(|(radius, n)| (radius, f64::from(n))).to_vec(), skin };
        let estimate = sizes.ghosts(&block, &bed, [false, true, true]);

        let (mut counted, draws) = (0, 400);
        for draw in 0..draws {
            let mut random = Random::of(3, draw);
            let mut bodies = Vec::new();
            for (radius, n) in classes {
                for _ in 0..n {
                    bodies.push((Vec3::from_fn(|_, _| random.unit()), radius));
                }
            }
            let (here, there): (Vec<_>, Vec<_>) = bodies.into_iter().partition(|(p, _)| p.x < 0.5);
            let cell = Cell::new(Vec3::zeros(), Vec3::repeat(1.0), [false, true, true]);
            let is_paired = |(p, r): &&(Vec3, f64)| {
                here.iter().any(|(q, s)| cell.nearest(p - q).norm() < r + s + skin)
            };
            counted += there.iter().filter(is_paired).count();
        }
        let counted = counted as f64 / draws as f64;
        assert!((estimate / counted - 1.0).abs() < 0.05, "{estimate} but {counted}");
        let within_the_largest_reach = 0.31 * 620.0;
        assert!(estimate < 0.5 * within_the_largest_reach, "{estimate}");
    }
}
