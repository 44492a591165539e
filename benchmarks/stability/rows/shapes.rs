//! Aspect ratios, exponents, sizes.

use crate::cell::{Cell, Deviation};
use crate::scene::{DENSITY, Grain, Length, MASS, RADIUS, Scene, Step, cuboid, material, shape};
use dem_mpi::math::Vec3;
use dem_mpi::random::Random;

/// Kind and keys of a shape, from its aspect ratio.
type Solid = fn(f64) -> (&'static str, String);

/// Solids by their aspect ratio, with the volume of a ball of [`RADIUS`].
const SOLIDS: [(&str, Solid); 5] = [
    ("needles", |ratio| {
        semi_axes([ratio.powf(2.0 / 3.0), ratio.powf(-1.0 / 3.0), ratio.powf(-1.0 / 3.0)])
    }),
    ("discs", |ratio| {
        semi_axes([ratio.powf(1.0 / 3.0), ratio.powf(1.0 / 3.0), ratio.powf(-2.0 / 3.0)])
    }),
    ("rods", |ratio| {
        // Length between the centres of the ends over the diameter is `ratio` - 1.
        let radius = RADIUS * (1.0 + 1.5 * (ratio - 1.0)).powf(-1.0 / 3.0);
        (
            "spherocylinder",
            format!("radius = {radius:e}\nlength = {:e}", 2.0 * (ratio - 1.0) * radius),
        )
    }),
    ("plates", |ratio| {
        let thin = 1.6 * RADIUS * ratio.powf(-2.0 / 3.0);
        ("polyhedron", cuboid([thin * ratio, thin * ratio, thin]))
    }),
    ("bricks", |ratio| {
        let thin = 1.6 * RADIUS * ratio.powf(-1.0 / 3.0);
        ("polyhedron", cuboid([thin * ratio, thin, thin]))
    }),
];

const FREE: [&str; 5] =
    ["needles, free", "discs, free", "rods, free", "plates, free", "bricks, free"];
const PACKED: [&str; 5] =
    ["needles, packed", "discs, packed", "rods, packed", "plates, packed", "bricks, packed"];

fn semi_axes(over_radius: [f64; 3]) -> (&'static str, String) {
    let [a, b, c] = over_radius.map(|x| x * RADIUS);
    ("ellipsoid", format!("semi_axes = [{a:e}, {b:e}, {c:e}]"))
}

pub(super) fn cells() -> Vec<Cell> {
    let mut cells = Vec::new();
    for (kind, (_, solid)) in SOLIDS.into_iter().enumerate() {
        for ratio in [1.5, 10.0, 100.0, 1000.0] {
            cells.push(tumbling(FREE[kind], ratio, solid(ratio)));
        }
        for ratio in [1.5, 3.0, 10.0, 100.0, 1000.0] {
            cells.push(packed(PACKED[kind], ratio, solid(ratio)));
        }
    }
    for exponents in [
        [0.02; 2],
        [0.1; 2],
        [0.5; 2],
        [1.0; 2],
        [1.5; 2],
        [1.9; 2],
        [2.0; 2],
        [0.1, 1.9],
        [1.9, 0.1],
    ] {
        cells.push(collision(exponents));
    }
    for exponent in 0..=3 {
        cells.push(unequal_sizes(10_f64.powi(exponent)));
    }
    for exponent in 0..=3 {
        cells.push(on_a_bed(10_f64.powi(exponent)));
    }
    cells
}

/// A particle rotates freely.
fn tumbling(row: &'static str, ratio: f64, (kind, keys): (&str, String)) -> Cell {
    let tables = material("m", DENSITY, 1e4, "") + &shape("grain", kind, &keys);
    let turn = Random::of(3, 0).rotation();
    let grains = vec![Grain::at("grain", [0.0; 3]).spinning([10.0, 20.0, 30.0]).turned(turn)];
    let mut scene = Scene::free(tables, grains);
    scene.step = Step::Seconds(1e-5);
    scene.length = Length::Steps(20_000);
    let cell = Cell::new(row, ratio, scene, |ran| {
        let kinetic = ran.last("kinetic_J");
        let came = ran.last("received_J");
        vec![Deviation::of("energy", kinetic, came, came, 1e-3)]
    });
    if ratio == 1000.0 { cell.quick() } else { cell }
}

/// 27 particles in random orientations fall into a box.
fn packed(row: &'static str, ratio: f64, (kind, keys): (&str, String)) -> Cell {
    let tables = material("m", DENSITY, 1e4, "friction = 0.3\nrestitution = 0.3")
        + &shape("grain", kind, &keys);
    // The spacing exceeds the length of the longest particle.
    let wide = 2.9 * RADIUS * ratio.powf(2.0 / 3.0);
    let mut random = Random::of(5, 0);
    let place = |k: u32| {
        Vec3::new(f64::from(k % 3), f64::from(k / 3 % 3), f64::from(k / 9)).add_scalar(0.5) * wide
    };
    let grains = (0..27)
        .map(|k| Grain::at("grain", place(k)).turned(random.rotation()).moving([0.0, 0.0, -1.0]))
        .collect();
    let mut scene = Scene::free(tables, grains).heavy();
    (scene.low, scene.high) = (Vec3::zeros(), Vec3::repeat(3.0 * wide));
    "walls = [\"-x\", \"+x\", \"-y\", \"+y\", \"-z\", \"+z\"]".clone_into(&mut scene.domain);
    scene.step = Step::OfLimit(0.3);
    scene.length = Length::Steps(10_000);
    Cell::new(row, ratio, scene, |_| Vec::new())
}

/// Two rotating superellipsoids collide without loss of energy.
fn collision(exponents: [f64; 2]) -> Cell {
    let [e, n] = exponents;
    let keys = format!(
        "semi_axes = [{RADIUS}, {:e}, {:e}]\nexponents = [{e}, {n}]",
        0.8 * RADIUS,
        0.7 * RADIUS
    );
    let tables = material("m", DENSITY, 1e5, "") + &shape("grain", "superellipsoid", &keys);
    let mut random = Random::of(7, 0);
    let mut grain = |side: f64| {
        let at = Vec3::new(1.75 * side, 0.2 * side, 0.1 * side) * RADIUS;
        Grain::at("grain", at).moving([-0.5 * side, 0.0, 0.0]).turned(random.rotation())
    };
    let grains = vec![grain(1.0), grain(-1.0)];
    let mut scene = Scene::free(tables, grains);
    scene.step = Step::OfLimit(0.05);
    scene.length = Length::Seconds(0.06);
    let cell = Cell::new("exponents of superellipsoids", format!("{e} {n}"), scene, |ran| {
        let (now, came) = (ran.last("kinetic_J"), ran.last("received_J"));
        let momentum: Vec3 = ran.particles.velocity.iter().sum();
        vec![
            Deviation::of("energy", now, came, came, 1e-3),
            Deviation { what: "momentum", is: momentum.norm(), allowed: 1e-12 },
        ]
    });
    if e == 0.02 { cell.quick() } else { cell }
}

/// A ball hits a larger one head on, like two point masses.
fn unequal_sizes(ratio: f64) -> Cell {
    let small = RADIUS / ratio;
    let tables = material("m", DENSITY, 1e5, "")
        + &shape("small", "sphere", &format!("radius = {small:e}"))
        + &shape("large", "sphere", &format!("radius = {RADIUS}"));
    let speed = 0.1;
    let mut scene = Scene::free(tables, Vec::new());
    let gap = 20.0 * scene.dt() * speed;
    scene.grains = vec![
        Grain::at("large", [0.0; 3]),
        Grain::at("small", [RADIUS + small + gap, 0.0, 0.0]).moving([-speed, 0.0, 0.0]),
    ];
    let lighter = ratio.powi(-3);
    let reduced = 4.0 / 3.0 * std::f64::consts::PI * small.powi(3) * DENSITY / (1.0 + lighter);
    let contact = std::f64::consts::PI * (reduced / 1e5).sqrt();
    scene.length = Length::Seconds(gap / speed + 2.0 * contact);
    let [large, after] = [2.0 * lighter, lighter - 1.0].map(|x| -speed * x / (1.0 + lighter));
    let cell = Cell::new("size ratio of two", ratio, scene, move |ran| {
        let [one, other] = [0, 1].map(|k| ran.particles.velocity[k].x);
        vec![
            Deviation::of("velocity of the small one", other, after, speed, 0.01),
            Deviation::of("velocity of the large one", one, large, large.abs(), 0.01),
        ]
    });
    if ratio == 1000.0 { cell.quick() } else { cell }
}

/// A ball hits a bed of 25 smaller ones on the floor.
fn on_a_bed(ratio: f64) -> Cell {
    let (stiffness, small) = (1e4, RADIUS / ratio);
    let tables = material("m", DENSITY, stiffness, "friction = 0.3\nrestitution = 0.5")
        + &shape("small", "sphere", &format!("radius = {small:e}"))
        + &shape("large", "sphere", &format!("radius = {RADIUS}"));
    let place =
        |k: u32| Vec3::new(f64::from(k % 5) - 2.0, f64::from(k / 5) - 2.0, 0.0) * (2.1 * small);
    let up = Vec3::new(0.0, 0.0, small);
    let mut grains: Vec<Grain> = (0..25).map(|k| Grain::at("small", place(k) + up)).collect();
    // Fast enough to overlap each by some per cent of its radius.
    let speed = 0.04 * small * (25.0 * stiffness / MASS).sqrt();
    let above = Vec3::new(0.0, 0.0, 2.1 * small + RADIUS);
    grains.push(Grain::at("large", above).moving([0.0, 0.0, -speed]));
    let mut scene = Scene::on_floor(tables, grains);
    scene.step = Step::OfLimit(0.3);
    scene.length = Length::Seconds(0.1 * small / speed + 8.0 * (MASS / stiffness).sqrt());
    Cell::new("size ratio, large on small", ratio, scene, |ran| {
        let up = ran.particles.velocity[25].z;
        vec![Deviation { what: "large ball goes down [m/s]", is: (-up).max(0.0), allowed: 0.0 }]
    })
}
