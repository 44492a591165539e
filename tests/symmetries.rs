//! Symmetries of mechanics, for all shapes and laws: grains that are thrown into a corner of two walls go the same way backwards, and for observers
//! who stand otherwise, move, look into a mirror, number the grains otherwise, or measure in other units.

use crate::support::{Bench, scene};
use dem_mpi::ids::{GlobalId, ShapeId};
use dem_mpi::math::{Quat, Vec3};
use dem_mpi::particles::records::Particle;
use dem_mpi::scene::Scene;

const STEP: f64 = 1e-3;
const STEPS: u64 = 600;

/// What differs between two who see the same.
#[derive(Clone, Copy)]
struct Observer {
    turn: Quat,
    /// Is x the other way round?
    mirror: bool,
    /// [m/s]
    drift: Vec3,
    ids: [u64; 3],
    /// Powers of two by which numbers of metres, seconds and kilograms are larger.
    units: [i32; 3],
}

impl Observer {
    fn usual() -> Self {
        let (turn, drift) = (Quat::identity(), Vec3::zeros());
        Self { turn, mirror: false, drift, ids: [0, 1, 2], units: [0; 3] }
    }

    /// A unit with these powers of metre, second and kilogram.
    fn unit(&self, powers: [i32; 3]) -> f64 {
        2f64.powi(self.units.iter().zip(powers).map(|(unit, power)| unit * power).sum())
    }

    /// A vector of a direction, as a place has, or of a turn, as a spin has.
    fn seen(&self, vector: [f64; 3], is_spin: bool) -> Vec3 {
        let [x, y, z] = vector;
        let side = if self.mirror { -1.0 } else { 1.0 };
        self.turn * (Vec3::new(side * x, y, z) * if is_spin { side } else { 1.0 })
    }

    fn back(&self, vector: Vec3, is_spin: bool) -> Vec3 {
        let turned = self.turn.inverse() * vector;
        Self { turn: Quat::identity(), ..*self }.seen(turned.into(), is_spin)
    }
}

/// All of them are their own mirror images along their own x, but have no centre where that is possible.
const KINDS: &str = "sphere ellipsoid superellipsoid poly-superellipsoid spherocylinder polyhedron rounded-polyhedron";

fn list(vector: Vec3, unit: f64) -> String {
    format!("{:?}", (vector * unit).as_slice())
}

/// A shape, some `size` long.
fn shape(name: &str, kind: &str, size: f64) -> String {
    let list = |numbers: [f64; 3]| list(numbers.into(), size);
    let corners = [(-0.5, 0.9, 0.7), (0.6, 0.5, 0.4)]
        .into_iter()
        .flat_map(|(z, x, y)| [[x, y, z], [-x, y, z], [x, -y, z], [-x, -y, z]].map(list));
    let corners = corners.collect::<Vec<_>>().join(", ");
    let own = match kind {
        "sphere" => format!("radius = {:?}", 0.9 * size),
        "ellipsoid" => format!("semi_axes = {}", list([1.0, 0.8, 0.6])),
        "superellipsoid" => {
            format!("semi_axes = {}\nexponents = [0.8, 1.1]", list([0.9, 0.8, 0.7]))
        }
        "poly-superellipsoid" => format!(
            "semi_axes_positive = {}\nsemi_axes_negative = {}\nexponents = [0.9, 1.1]",
            list([1.0, 0.8, 0.6]),
            list([1.0, 0.8, 0.9])
        ),
        "spherocylinder" => format!("length = {:?}\nradius = {:?}", 0.9 * size, 0.6 * size),
        "polyhedron" => format!("vertices = [{corners}]"),
        _ => format!("vertices = [{corners}]\nradius = {:?}", 0.2 * size),
    };
    format!("[[shape]]\nname = \"{name}\"\nkind = \"{kind}\"\n{own}\n")
}

/// Models of forces; the last two are of spheres.
const LAWS: [&str; 5] = ["linear", "hertz", "rolling", "dmt", "jkr"];

/// Two grains of a kind, a ball, and two walls.
fn corner(kind: &str, law: &str, with_losses: bool, observer: &Observer) -> Scene {
    let unit = |metre, second, kilogram| observer.unit([metre, second, kilogram]);
    let wall = |name: &str, point: [f64; 3], normal: [f64; 3]| {
        format!(
            "[[wall]]\nname = \"{name}\"\npoint = {}\nnormal = {}\nvelocity = {}\n",
            list(observer.seen(point, false), unit(1, 0, 0)),
            list(observer.seen(normal, false), 1.0),
            list(observer.drift, unit(1, -1, 0))
        )
    };
    let own = match law {
        "hertz" => "normal = \"hertz\"\nlargest_overlap = 0.1",
        "rolling" => "rolling = \"spring\"\ntwisting = \"spring\"",
        "dmt" => "adhesion = \"dmt\"",
        "jkr" => "normal = \"hertz\"\nadhesion = \"jkr\"\nlargest_overlap = 0.1",
        _ => "",
    };
    let is_hertz = own.contains("hertz");
    let mut material = format!("density = {:?}\n", unit(-3, 0, 1));
    let stiffness = if is_hertz {
        format!("youngs_modulus = {:?}\npoisson_ratio = 0.3\n", 5e3 * unit(-1, -2, 1))
    } else {
        format!("normal_stiffness = {:?}\n", 2e3 * unit(0, -2, 1))
    };
    material += &stiffness;
    if law == "dmt" || law == "jkr" {
        let energy = format!("surface_energy = {:?}\n", unit(0, -2, 1));
        material += &energy;
    }
    if with_losses {
        material += "friction = 0.4\nrestitution = 0.7\n";
        material += if is_hertz { "" } else { "tangential_damping_ratio = 0.1\n" };
        if law == "rolling" {
            material += "rolling_friction = 0.2\ntwisting_friction = 0.1\n";
        }
    }
    let wide = Vec3::repeat(100.0 * unit(1, 0, 0));
    scene(&format!(
        "gravity = {}\n[law]\n{own}\n[domain]\nlow = {}\nhigh = {}\n{}{}[[material]]\nname = \"m\"\n{material}{}{}{}\
         [[fill.lattice]]\nshapes = [\"large\"]\nfirst = {}\ncount = [1, 1, 1]\nspacing = 1\n[time]\nstep = {:?}\nsteps = 1\n\
         [output]\ndirectory = \"out\"\n",
        list(observer.seen([0.3, -0.2, -2.0], false), unit(1, -2, 0)),
        list(-wide, 1.0),
        list(wide, 1.0),
        wall("floor", [0.0; 3], [0.0, 0.0, 1.0]),
        wall("side", [-1.2, 0.0, 0.0], [0.8, 0.0, 0.6]),
        shape("large", kind, unit(1, 0, 0)),
        shape("small", kind, 0.7 * unit(1, 0, 0)),
        shape("ball", "sphere", 0.6 * unit(1, 0, 0)),
        list(wide, 0.5),
        STEP * unit(0, 1, 0),
    ))
}

/// Place, velocity, spin and turn of a grain.
const THROWN: [[[f64; 3]; 4]; 3] = [
    [[0.1, 0.0, 1.05], [-1.2, 0.2, -1.0], [0.5, -1.0, 0.7], [0.3, 0.5, -0.2]],
    [[0.3, 0.3, 2.9], [-0.4, 0.1, -2.2], [-0.3, 0.4, 1.1], [-0.7, 0.2, 0.4]],
    [[1.9, -0.3, 1.1], [-2.2, 0.1, -0.4], [2.0, 1.0, -1.5], [0.0, 0.0, 0.0]],
];

fn thrown(scene: &Scene, observer: &Observer) -> Vec<Particle> {
    let grain = |(k, [place, velocity, spin, turn]): (usize, [[f64; 3]; 4])| {
        let position = observer.seen(place, false) * observer.unit([1, 0, 0]);
        let velocity =
            (observer.seen(velocity, false) + observer.drift) * observer.unit([1, -1, 0]);
        // A turn by a vector is seen as a turn by what is seen of that.
        let quaternion = Quat::from_scaled_axis(observer.seen(turn, true)) * observer.turn;
        let still = Particle::at_rest(GlobalId(observer.ids[k]), ShapeId(k as u16), position);
        let spin = observer.seen(spin, true) * observer.unit([0, -1, 0]);
        Particle { velocity, quaternion, ..still }.spinning(spin, &scene.library)
    };
    THROWN.into_iter().enumerate().map(grain).collect()
}

/// Place, velocity, spin, force and an axis of each grain at the end, as the usual observer has them, and how many contacts were seen between
/// grains and with walls.
fn end(kind: &str, law: &str, observer: &Observer) -> (Vec<[Vec3; 5]>, [u64; 2]) {
    let scene = corner(kind, law, true, observer);
    let mut bench = Bench::of(&scene, &thrown(&scene, observer));
    let mut contacts = [0; 2];
    for step in 0..STEPS {
        bench.step();
        if step % 20 == 0 {
            let found = bench.measure();
            contacts[0] += found.contacts;
            contacts[1] += found.wall_contacts;
        }
    }
    let time = STEPS as f64 * STEP;
    let seen = |id: u64| {
        let grain = bench.sim.particles.owned_particle(bench.slot(id));
        let of = |v: Vec3, powers: [i32; 3]| v / observer.unit(powers);
        let local = grain.quaternion.inverse_transform_vector(&grain.angular_momentum);
        let inertia = scene.library.inertia_at(grain.shape, grain.scale);
        let spin = grain.quaternion * local.component_div(&inertia);
        [
            observer.back(of(grain.position, [1, 0, 0]) - observer.drift * time, false),
            observer.back(of(grain.velocity, [1, -1, 0]) - observer.drift, false),
            observer.back(of(spin, [0, -1, 0]), true),
            observer.back(of(grain.force, [1, -2, 1]), false),
            observer.back(grain.quaternion * Vec3::z(), false),
        ]
    };
    (observer.ids.map(seen).into(), contacts)
}

/// The largest difference, over sizes, speeds, spins and forces of about 1 or more.
fn off(one: &[[Vec3; 5]], other: &[[Vec3; 5]]) -> f64 {
    let all = one.as_flattened().iter().zip(other.as_flattened());
    all.map(|(a, b)| (a - b).norm() / a.norm().max(1.0)).fold(0.0, f64::max)
}

fn cases() -> impl Iterator<Item = (&'static str, &'static str)> {
    let all = KINDS.split(' ').flat_map(|kind| LAWS.map(|law| (kind, law)));
    all.filter(|&(kind, law)| kind == "sphere" || !["dmt", "jkr"].contains(&law))
}

/// Other axes, with the walls; a mirror; a constant velocity; other ids; other units, to the last bit.
#[test]
fn observers_see_the_same() {
    let usual = Observer::usual();
    let turn = Quat::from_scaled_axis(Vec3::new(1.0, -2.0, 0.5));
    let others = [
        ("turned", Observer { turn, ..usual }, 1e-9),
        ("mirrored", Observer { mirror: true, ..usual }, 1e-9),
        ("moving", Observer { drift: Vec3::new(3.0, -2.0, 1.0), ..usual }, 1e-9),
        ("with other ids", Observer { ids: [2, 0, 1], ..usual }, 1e-9),
        // Roots of units are powers of two, too.
        ("with other units", Observer { units: [-12, 6, 18], ..usual }, 0.0),
    ];
    for (kind, law) in cases() {
        let (seen, contacts) = end(kind, law, &usual);
        assert!(contacts.iter().all(|count| *count > 2), "{kind}, {law}: {contacts:?}");
        for (who, observer, most) in &others {
            let off = off(&seen, &end(kind, law, observer).0);
            println!("{kind}, {law}, {who}: off by {off:.1e}");
            assert!(off <= *most, "{kind}, {law}, {who}: off by {off:.1e}");
        }
    }
}

/// Without friction and dashpots grains whose velocities are reversed go back to where they were. Soft spheres by JKR lose energy as they part.
#[test]
fn reversed_grains_go_back() {
    let observer = Observer::usual();
    for (kind, law) in cases().filter(|(_, law)| !["rolling", "jkr"].contains(law)) {
        let scene = corner(kind, law, false, &observer);
        let mut grains = thrown(&scene, &observer);
        let first = grains.clone();
        for _ in 0..2 {
            let mut bench = Bench::of(&scene, &grains);
            (0..STEPS).for_each(|_| bench.step());
            grains = (0..3).map(|id| bench.sim.particles.owned_particle(bench.slot(id))).collect();
            for grain in &mut grains {
                grain.velocity = -grain.velocity;
                grain.angular_velocity = -grain.angular_velocity;
                grain.angular_momentum = -grain.angular_momentum;
            }
        }
        for (grain, first) in grains.iter().zip(&first) {
            let axis = |grain: &Particle| grain.quaternion * Vec3::z();
            let (far, fast) = (grain.position - first.position, grain.velocity - first.velocity);
            let off = far.norm().max(fast.norm()).max((axis(grain) - axis(first)).norm());
            println!("{kind}, {law}, grain {}: off by {off:.1e}", grain.id.0);
            assert!(off < 1e-9, "{kind}, {law}, grain {}: off by {off:.1e}", grain.id.0);
        }
    }
}
