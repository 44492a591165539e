//! Bodies with faces or straight sides: elastic collisions, rest on slopes, restitution, a rocking block, stacks at rest.

use super::setup::{begun, poured};
use super::{Case, Effort, Findings, Grain, Plane, Setup};
pub(super) use benchmarking::solids::cuboid;
use benchmarking::solids::{icosahedron, tetrahedron};
use dem_mpi::comm::alone::Alone;
use dem_mpi::contact::Posed;
use dem_mpi::math::{Quat, Vec3, rotation_about};
use dem_mpi::random::Random;
use dem_mpi::scene::Scene;
use dem_mpi::shape::Shape;
use dem_mpi::sim::Simulation;
use std::f64::consts::FRAC_PI_4;

pub(super) const ENERGY: &str = "conservation of energy, momentum and angular momentum";
pub(super) const COULOMB: &str = "closed form (Coulomb)";
const HOUSNER: &str = "Housner 1963, 10.1785/BSSA0530020403";
pub(super) const G: f64 = 9.81;

/// Runs all cases.
pub(crate) fn run(effort: Effort) -> Findings {
    let mut cases = Vec::from(collisions(effort));
    cases.extend(slopes(effort));
    cases.push(restitution(effort));
    cases.push(rocking_block());
    cases.extend(rest(effort));
    Findings { cases, ..Findings::default() }
}

/// A solid: its name, its corners, and the rounding radius around it [m]. A spherocylinder has two corners, on x.
pub(super) struct Solid {
    pub(super) name: &'static str,
    pub(super) corners: Vec<Vec3>,
    pub(super) radius: f64,
}

pub(super) fn boxes() -> Solid {
    Solid { name: "boxes", corners: cuboid(Vec3::new(1.0, 0.8, 0.6)), radius: 0.0 }
}

pub(super) fn rods() -> Solid {
    Solid { name: "rods 3:1", corners: vec![-0.5 * Vec3::x(), 0.5 * Vec3::x()], radius: 0.25 }
}

pub(super) fn solids() -> Vec<Solid> {
    let sharp = |name, corners| Solid { name, corners, radius: 0.0 };
    let octahedron = (0..6).map(|k| Vec3::ith(k % 3, if k < 3 { 0.7 } else { -0.7 })).collect();
    vec![
        boxes(),
        sharp("tetrahedra", tetrahedron()),
        sharp("octahedra", octahedron),
        sharp("icosahedra", icosahedron()),
        sharp("plates 10:1", cuboid(Vec3::new(1.0, 1.0, 0.1))),
        rods(),
        Solid { name: "rounded boxes", corners: cuboid(Vec3::new(0.8, 0.6, 0.4)), radius: 0.1 },
    ]
}

impl Solid {
    /// Table in a scene.
    pub(super) fn text(&self) -> String {
        self.text_as("solid")
    }

    /// Table in a scene under another name.
    pub(super) fn text_as(&self, name: &str) -> String {
        if let [one, other] = &self.corners[..] {
            return format!(
                "[[shape]]\nname = \"{name}\"\nkind = \"spherocylinder\"\nlength = {:e}\nradius = {:e}\n",
                (other - one).norm(),
                self.radius
            );
        }
        let corners: Vec<String> =
            self.corners.iter().map(|c| format!("[{:e}, {:e}, {:e}]", c.x, c.y, c.z)).collect();
        let kind = if self.radius > 0.0 {
            format!("\"rounded-polyhedron\"\nradius = {}", self.radius)
        } else {
            "\"polyhedron\"".to_owned()
        };
        format!(
            "[[shape]]\nname = \"{name}\"\nkind = {kind}\nvertices = [{}]\n",
            corners.join(", ")
        )
    }
}

/// A scene with its step at this share of the stable limit.
pub(super) fn at_share(setup: &Setup, share: f64) -> Scene {
    // A step so short that it is accepted for any limit.
    let mut scene = Setup { dt: 1e-12, ..setup.clone() }.scene(1);
    scene.dt = share * scene.time_step_limit().expect("something pushes").dt;
    scene
}

pub(super) fn step(sim: &mut Simulation) {
    sim.step(&mut Alone::default()).unwrap_or_else(|error| panic!("{error}"));
}

pub(super) fn steps(sim: &mut Simulation, time: f64) {
    for _ in 0..(time / sim.dt) as u64 {
        step(sim);
    }
}

/// Total momentum and angular momentum.
fn momenta(sim: &Simulation) -> [Vec3; 2] {
    let particles = &sim.particles;
    let (mut momentum, mut angular) = (Vec3::zeros(), Vec3::zeros());
    for slot in 0..particles.owned {
        let of_one = particles.velocity[slot] * particles.mass(slot);
        momentum += of_one;
        angular += particles.position[slot].cross(&of_one) + particles.angular_momentum(slot);
    }
    [momentum, angular]
}

/// Changes by a collision of energy (relative), momentum and angular momentum.
struct Change {
    energy: f64,
    momenta: [f64; 2],
}

/// Two bodies for collisions, with their names in a scene.
pub(super) struct Pair {
    names: [&'static str; 2],
    shapes: [Shape; 2],
    /// Materials and shapes of the scene.
    text: String,
}

impl Pair {
    /// Two equal solids.
    fn of(solid: &Solid) -> Self {
        Self::with(&solid.text(), ["solid", "solid"])
    }

    /// Two different solids.
    pub(super) fn of_two(one: &Solid, other: &Solid) -> Self {
        Self::with(&(one.text_as("one") + &other.text_as("other")), ["one", "other"])
    }

    /// Two solids of these `[[shape]]` tables, with these names.
    pub(super) fn with(shapes: &str, names: [&'static str; 2]) -> Self {
        let material = "[[material]]\nname = \"m\"\ndensity = 1.0\nnormal_stiffness = 1e3\n";
        let text = material.to_owned() + shapes;
        let mut setup = Setup {
            gravity: Vec3::zeros(),
            text,
            planes: Vec::new(),
            grains: names.map(|name| Grain::at(name, Vec3::zeros())).to_vec(),
            dt: 1e-12,
        };
        setup.grains[1].position.x = 10.0;
        let library = setup.scene(1).library;
        let shapes = names.map(|name| {
            let index = library.names.iter().position(|of| of == name).expect("the scene has it");
            library.shapes[index].clone()
        });
        Self { names, shapes, text: setup.text }
    }

    /// Lets them collide with rotation; `None` if they miss.
    fn collide(&self, share: f64, random: &mut Random) -> Option<Change> {
        let turns = [random.rotation(), random.rotation()];
        let frames = turns.map(|turn| turn.to_rotation_matrix().into_inner());
        let mut vector = || Vec3::from_fn(|_, _| random.signed());
        let direction = vector().normalize();
        let spins = [vector() * 0.5, vector() * 0.5];
        let [a, b] = [0, 1].map(|k| Posed::new(&self.shapes[k], &frames[k]));
        let apart = a.support(&direction) - b.support(&-direction) + direction * 0.05;
        let grain = |k: usize, position, velocity| {
            Grain::at(self.names[k], position).moving(velocity).turned(turns[k]).spinning(spins[k])
        };
        let setup = Setup {
            gravity: Vec3::zeros(),
            text: self.text.clone(),
            planes: Vec::new(),
            grains: vec![
                grain(0, Vec3::zeros(), direction * 0.5),
                grain(1, apart, direction * -0.5),
            ],
            dt: 0.0,
        };
        let mut sim = begun(&at_share(&setup, share), &mut Alone::default());
        let energy = |sim: &Simulation| sim.measure(&mut Alone::default()).kinetic();
        let (energy_before, before) = (energy(&sim), momenta(&sim));
        let (mut met, mut since) = (false, 0.0);
        while since < 0.3 && sim.time() < 3.0 {
            step(&mut sim);
            met |= !sim.contacts.is_empty();
            since = if met && sim.contacts.is_empty() { since + sim.dt } else { 0.0 };
        }
        let after = momenta(&sim);
        (met && sim.contacts.is_empty()).then(|| Change {
            energy: (energy(&sim) / energy_before - 1.0).abs(),
            momenta: [0, 1].map(|k| (after[k] - before[k]).norm()),
        })
    }

    /// Largest changes of energy (relative), momentum and angular momentum in `count` collisions.
    pub(super) fn changes(&self, count: usize, share: f64) -> [f64; 3] {
        let mut random = Random::of(17, 0);
        let mut changes = Vec::new();
        while changes.len() < count {
            changes.extend(self.collide(share, &mut random));
        }
        let largest = |of: &dyn Fn(&Change) -> f64| changes.iter().map(of).fold(0.0, f64::max);
        [
            largest(&|change| change.energy),
            largest(&|change| change.momenta[0]),
            largest(&|change| change.momenta[1]),
        ]
    }
}

fn collisions(effort: Effort) -> [Case; 3] {
    let mut coarse = Case::new(
        ENERGY,
        "random collisions of solids without friction, a twenty-fifth of the stable step",
        "largest change of the kinetic energy (relative)",
        2e-4,
        "the leapfrog at 30 to 50 steps of a contact",
    );
    let mut fine = Case::new(
        ENERGY,
        "the same, a hundredth of the stable step",
        "largest change of the kinetic energy (relative)",
        2e-5,
        "it falls with the square of the step",
    );
    let mut kept = Case::new(
        ENERGY,
        "the same",
        "largest change of momentum and angular momentum (kg m/s, kg m2/s)",
        1e-12,
        "rounding of some 1e4 steps",
    );
    let count = effort.pick(8, 30);
    for solid in &solids() {
        let pair = Pair::of(solid);
        for (share, case) in [(0.04, &mut coarse), (0.01, &mut fine)] {
            let [energy, momentum, angular] = pair.changes(count, share);
            case.absolute(solid.name, 0.0, energy);
            kept.absolute(format!("{}, momentum", solid.name), 0.0, momentum);
            kept.absolute(format!("{}, angular momentum", solid.name), 0.0, angular);
        }
    }
    [coarse, fine, kept]
}

const FRICTION: f64 = 0.3;

fn rough(stiffness: f64, restitution: f64) -> String {
    rough_with(stiffness, restitution, FRICTION)
}

/// Text of a material.
pub(super) fn rough_with(stiffness: f64, restitution: f64, friction: f64) -> String {
    format!(
        "[[material]]\nname = \"m\"\ndensity = 1000.0\nnormal_stiffness = {stiffness:e}\ntangential_stiffness = {stiffness:e}\n\
         friction = {friction}\nrestitution = {restitution}\ntangential_damping_ratio = 0.1\n"
    )
}

/// A solid with its lowest face on a floor with this slope.
fn on_slope(solid: &Solid, tangent: f64, share: f64, restitution: f64) -> Simulation {
    let angle = tangent.atan();
    let height = -solid.corners.iter().map(|c| c.z).fold(0.0, f64::min) + solid.radius;
    let setup = Setup {
        gravity: Vec3::new(G * angle.sin(), 0.0, -G * angle.cos()),
        text: rough(1e6, restitution) + &solid.text(),
        planes: vec![Plane::floor("m")],
        grains: vec![Grain::at("solid", Vec3::z() * height)],
        dt: 0.0,
    };
    begun(&at_share(&setup, share), &mut Alone::default())
}

fn slopes(effort: Effort) -> [Case; 2] {
    let mut rests = Case::new(
        COULOMB,
        "solids on a slope of 0.96 of friction's tangent, with steps up to the limit",
        "velocity after they have come to rest (m/s)",
        1e-9,
        "solids of a metre",
    );
    let mut slides = Case::new(
        COULOMB,
        "the same on a slope of 1.01 of friction's tangent",
        "acceleration (relative)",
        0.05,
        "mean of two seconds, after two",
    );
    let rests_flat = |solid: &Solid| solid.name.contains("boxes") || solid.name == rods().name;
    for solid in solids().into_iter().filter(rests_flat) {
        for share in effort.pick(vec![1.0], vec![0.1, 0.3, 0.8, 1.0]) {
            let what = format!("{}, {share} of the limit", solid.name);
            let mut sim = on_slope(&solid, 0.96 * FRICTION, share, 0.3);
            steps(&mut sim, 4.0);
            let (before, since) = (sim.particles.position[0], sim.time());
            steps(&mut sim, 2.0);
            let moved = (sim.particles.position[0] - before).norm();
            rests.absolute(what.clone(), 0.0, moved / (sim.time() - since));

            let tangent = 1.01 * FRICTION;
            let mut sim = on_slope(&solid, tangent, share, 0.3);
            steps(&mut sim, 2.0);
            let (before, since) = (sim.particles.velocity[0], sim.time());
            steps(&mut sim, 2.0);
            let gained = (sim.particles.velocity[0] - before).x;
            let published = G * (tangent - FRICTION) * tangent.atan().cos();
            slides.relative(what, published, gained / (sim.time() - since));
        }
    }
    [rests, slides]
}

/// A cube falls on a face, an edge and a corner, none of which makes it rotate.
fn restitution(effort: Effort) -> Case {
    let mut case = Case::new(
        "closed form (Schwager and Poeschel 2007, 10.1007/s10035-007-0065-z)",
        "cube dropped on a face, an edge and a corner",
        "restitution",
        effort.pick(5e-3, 1e-3),
        "a hundred steps of the limit in a contact",
    );
    let cube = Solid { name: "cube", corners: cuboid(Vec3::repeat(1.0)), radius: 0.0 };
    let diagonal = (1.0 / 3_f64.sqrt()).acos();
    let on_edge = rotation_about(&Vec3::y(), FRAC_PI_4);
    let corner = Vec3::new(1.0, -1.0, 0.0).normalize();
    for (feature, turn, height) in [
        ("face", Quat::identity(), 0.5),
        ("edge", on_edge, 0.5 * 2_f64.sqrt()),
        ("corner", rotation_about(&corner, diagonal), 0.5 * 3_f64.sqrt()),
    ] {
        for e in [0.2, 0.5, 0.9] {
            let setup = Setup {
                gravity: Vec3::zeros(),
                text: rough(1e6, e) + &cube.text(),
                planes: vec![Plane::floor("m")],
                grains: vec![
                    Grain::at("solid", Vec3::z() * (height + 1e-6))
                        .turned(turn)
                        .moving(Vec3::z() * -0.1),
                ],
                dt: 0.0,
            };
            let mut sim = begun(&at_share(&setup, effort.pick(0.05, 0.01)), &mut Alone::default());
            while sim.particles.velocity[0].z < 0.0 || !sim.contacts.is_empty() {
                step(&mut sim);
            }
            case.absolute(format!("{feature}, {e}"), e, sim.particles.velocity[0].z / 0.1);
        }
    }
    case
}

/// A slender block that rocks from edge to edge on a rough floor.
fn rocking_block() -> Case {
    let mut case = Case::new(
        HOUSNER,
        "slender block that rocks on a rough floor from 0.4 of its critical angle",
        "quarter of the first period; energy left by an impact (relative)",
        0.02,
        "a floor that gives way a little, and dashpots that keep it from bouncing",
    );
    let (width, height) = (0.2, 0.8);
    let block =
        Solid { name: "block", corners: cuboid(Vec3::new(width, width, height)), radius: 0.0 };
    let half_diagonal: f64 = 0.5 * f64::hypot(width, height);
    let critical = (width / height).atan();
    let start = 0.4 * critical;
    // It stands on the edge at +x, rotated about it.
    let arm = Vec3::new(
        -half_diagonal * (critical - start).sin(),
        0.0,
        half_diagonal * (critical - start).cos(),
    );
    let setup = Setup {
        gravity: Vec3::z() * -G,
        text: format!(
            "[[material]]\nname = \"m\"\ndensity = 1000.0\nnormal_stiffness = 1e8\ntangential_stiffness = 1e8\nfriction = 5.0\n\
             restitution = 0.05\ntangential_damping_ratio = 0.3\n{}",
            block.text()
        ),
        planes: vec![Plane::floor("m")],
        grains: vec![Grain::at("solid", arm).turned(rotation_about(&Vec3::y(), start))],
        dt: 0.0,
    };
    let mut sim = begun(&at_share(&setup, 0.5), &mut Alone::default());
    let tilt = |sim: &Simulation| {
        let turn = sim.particles.orientation.as_ref().expect("a block turns").quaternion[0];
        (turn * Vec3::z()).x
    };
    let kinetic = |sim: &Simulation| sim.measure(&mut Alone::default()).kinetic();
    while tilt(&sim) > 0.0 {
        step(&mut sim);
    }
    let frequency = (0.75 * G / half_diagonal).sqrt();
    let quarter = (1.0 / (1.0 - start / critical)).acosh() / frequency;
    case.relative("quarter period", quarter, sim.time());
    let before = kinetic(&sim);
    // Up to the highest point on the other side, where all energy is potential.
    let floor = sim.particles.position[0].z;
    let mut top = floor;
    let end = 2.0 * sim.time();
    while sim.time() < end {
        step(&mut sim);
        top = top.max(sim.particles.position[0].z);
    }
    let left = sim.particles.mass(0) * G * (top - floor) / before;
    let published = (1.0 - 1.5 * critical.sin().powi(2)).powi(2);
    case.relative("energy left", published, left);
    case
}

/// Solids that fall into a box.
pub(super) fn pouring(solid: &Solid, side: u32, high: u32, share: f64) -> Simulation {
    let reach = solid.corners.iter().map(Vec3::norm).fold(0.0, f64::max) + solid.radius;
    let spacing = 1.909 * reach;
    let tables = rough(1e7, 0.3) + &solid.text();
    let mut scene = poured(&tables, "solid", spacing, [side, high], &mut Random::of(5, 3));
    scene.dt = share * scene.time_step_limit().expect("something pushes").dt;
    begun(&scene, &mut Alone::default())
}

/// Boxes one on the other, with clearances of a millimetre.
pub(super) fn stack(count: u32) -> Simulation {
    let solid = boxes();
    let mut random = Random::of(3, 3);
    let grains = (0..count).map(|k| {
        let height = 0.6 * (f64::from(k) + 0.5) + 1e-3 * (f64::from(k) + 1.0);
        let place = Vec3::new(0.03 * random.signed(), 0.03 * random.signed(), height);
        Grain::at("solid", place).turned(rotation_about(&Vec3::z(), 0.1 * random.signed()))
    });
    let setup = Setup {
        gravity: Vec3::z() * -G,
        text: rough(1e7, 0.3) + &solid.text(),
        planes: vec![Plane::floor("m")],
        grains: grains.collect(),
        dt: 0.0,
    };
    begun(&at_share(&setup, 0.8), &mut Alone::default())
}

/// Bodies brought to rest stay at rest without further damping.
fn rest(effort: Effort) -> [Case; 2] {
    let mut moves = Case::new(
        ENERGY,
        "stack and piles of boxes and rods, brought to rest and then left without damping",
        "way of the one that moves farthest (bounding radii), in 1e6 steps each",
        1e-6,
        "at rest",
    );
    let mut balance =
        Case::new(ENERGY, "the same", "unbalanced force over mean contact force", 1e-3, "at rest");
    let count = effort.pick(3, 10);
    let mut left = vec![("stack of boxes", stack(count))];
    if effort == Effort::Full {
        left.push(("pile of boxes", pouring(&boxes(), 3, 6, 0.8)));
    }
    left.push(("pile of rods", pouring(&rods(), effort.pick(2, 3), effort.pick(2, 6), 0.8)));
    for (what, mut sim) in left {
        steps(&mut sim, 2.0);
        sim.field.damping = 10.0;
        steps(&mut sim, effort.pick(6.0, 20.0));
        sim.field.damping = 0.0;
        let before: Vec<(u64, Vec3)> = places(&sim);
        for _ in 0..effort.pick(10_000, 1_000_000) {
            step(&mut sim);
        }
        let ways = places(&sim).into_iter().zip(before).map(|(now, then)| (now.1 - then.1).norm());
        let what = format!("{what}, {}", sim.particles.owned);
        moves.absolute(&*what, 0.0, ways.fold(0.0, f64::max) / sim.particles.radius(0));
        balance.absolute(what, 0.0, sim.measure(&mut Alone::default()).unbalanced);
    }
    [moves, balance]
}

/// Centres, by rising ids [m].
pub(super) fn places(sim: &Simulation) -> Vec<(u64, Vec3)> {
    let particles = &sim.particles;
    let mut all: Vec<_> =
        (0..particles.owned).map(|k| (particles.id[k].0, particles.position[k])).collect();
    all.sort_by_key(|(id, _)| *id);
    all
}
