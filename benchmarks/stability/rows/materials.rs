//! Time step, stiffness, friction and damping of balls, whose collisions have closed forms.

use crate::cell::{Cell, Deviation};
use crate::scene::{DENSITY, G, Grain, Length, MASS, RADIUS, Scene, Step, balls, material, shape};
use dem_mpi::math::Vec3;

pub(super) fn cells() -> Vec<Cell> {
    let mut cells = Vec::new();
    for share in [0.01, 0.1, 0.5, 0.99, 1.01, 2.0] {
        cells.push(heap("step over the limit", share, ""));
    }
    for share in [1.01, 1.5, 2.0] {
        cells.push(heap("step over the limit, allow_unstable", share, "allow_unstable = true"));
    }
    for exponent in [1, 2, 3, 4, 6, 8, 10, 12] {
        let stiffness = 10_f64.powi(exponent);
        cells.push(bounce("stiffness [N/m]", format!("1e{exponent}"), stiffness, 0.5));
    }
    for restitution in [0.01, 0.1, 0.3, 0.5, 0.9, 1.0] {
        cells.push(bounce("restitution", restitution.to_string(), 1e5, restitution));
    }
    for exponent in 0..=6 {
        cells.push(unequal_stiffness(exponent));
    }
    for exponent in 0..=6 {
        cells.push(heavy_on_top(exponent));
    }
    for friction in [0.0, 0.01, 0.1, 0.3, 1.0, 10.0, 1000.0] {
        cells.push(bowling(friction));
    }
    for damping in [0.0, 1.0, 1e2, 1e4, 1e5, 1.9e5, 2.1e5] {
        cells.push(slowed(damping));
    }
    cells
}

/// 27 balls fall into a box.
fn heap(row: &'static str, share: f64, time: &str) -> Cell {
    let place = |k: u32| {
        let (i, j, l) = (k % 3, k / 3 % 3, k / 9);
        // Layers are shifted so that no ball is exactly above another.
        let aside = 0.1 * f64::from(l);
        Vec3::new(
            1.3 + aside + 2.3 * f64::from(i),
            1.2 + aside + 2.3 * f64::from(j),
            1.1 + 2.2 * f64::from(l),
        ) * RADIUS
    };
    let grains = (0..27).map(|k| Grain::at("ball", place(k))).collect();
    let tables = balls(1e4, "friction = 0.3\nrestitution = 0.5");
    let scene = Scene {
        low: Vec3::zeros(),
        high: Vec3::new(8.0, 8.0, 10.0) * RADIUS,
        domain: "walls = [\"-x\", \"+x\", \"-y\", \"+y\", \"-z\"]".to_owned(),
        time: time.to_owned(),
        ..Scene::free(tables, grains)
    };
    let scene = scene.heavy().lasting(Step::OfLimit(share), Length::Seconds(0.3));
    let cell = Cell::new(row, share, scene, |_| Vec::new());
    if matches!(share, 0.5 | 1.01) { cell.quick() } else { cell }
}

/// A ball hits the floor at 1 m/s, without gravity.
fn bounce(row: &'static str, value: String, stiffness: f64, restitution: f64) -> Cell {
    let tables = balls(stiffness, &format!("restitution = {restitution}"));
    let mut scene = Scene::on_floor(tables, Vec::new());
    let gap = 20.0 * scene.dt();
    let above = Vec3::new(0.0, 0.0, RADIUS + gap);
    scene.grains = vec![Grain::at("ball", above).moving([0.0, 0.0, -1.0])];
    // A contact takes at most half a period, or some periods with the strongest dashpot.
    let period = 2.0 * std::f64::consts::PI * (MASS / stiffness).sqrt();
    scene.length = Length::Seconds(gap + 8.0 * period);
    let quick = matches!(stiffness, 10.0 | 1e12) || restitution == 0.01;
    let cell = Cell::new(row, value, scene, move |ran| {
        let up = ran.particles.velocity[0].z;
        vec![Deviation::of("speed after the bounce", up, restitution, 1.0, 0.01)]
    });
    if quick { cell.quick() } else { cell }
}

/// A ball hits a stiffer one: they exchange their velocities.
fn unequal_stiffness(exponent: i32) -> Cell {
    let ratio = 10_f64.powi(exponent);
    let radius = format!("radius = {RADIUS}");
    let tables = [("soft", 1e4), ("hard", 1e4 * ratio)]
        .map(|(name, k)| {
            material(name, DENSITY, k, "")
                + &shape(name, "sphere", &format!("{radius}\nmaterial = \"{name}\""))
        })
        .concat();
    let mut scene = Scene::free(tables, Vec::new());
    scene.step = Step::OfLimit(0.1);
    scene.grains = vec![
        Grain::at("soft", [-1.001 * RADIUS, 0.0, 0.0]).moving([0.5, 0.0, 0.0]),
        Grain::at("hard", [1.001 * RADIUS, 0.0, 0.0]),
    ];
    // Contact time of the soft ball, the longest.
    scene.length = Length::Seconds(2e-3 * RADIUS / 0.5 + 8.0 * (MASS / 1e4).sqrt());
    let cell = Cell::new("stiffness ratio of two", format!("1e{exponent}"), scene, |ran| {
        let [a, b] = [0, 1].map(|k| ran.particles.velocity[k].x);
        vec![
            Deviation::of("velocity of the first", a, 0.0, 0.5, 0.01),
            Deviation::of("momentum", a + b, 0.5, 0.5, 1e-12),
        ]
    });
    if exponent == 6 { cell.quick() } else { cell }
}

/// A ball rests on a lighter one: the floor carries both.
fn heavy_on_top(exponent: i32) -> Cell {
    let ratio = 10_f64.powi(exponent);
    let stiffness = 1e8;
    let radius = format!("radius = {RADIUS}");
    let tables = [("light", 1.0), ("heavy", ratio)]
        .map(|(name, factor)| {
            material(name, DENSITY * factor, stiffness, "restitution = 0.1")
                + &shape(name, "sphere", &format!("{radius}\nmaterial = \"{name}\""))
        })
        .concat();
    let grains =
        vec![Grain::at("light", [0.0, 0.0, RADIUS]), Grain::at("heavy", [0.0, 0.0, 3.0 * RADIUS])];
    let mut scene = Scene::on_floor(tables, grains).heavy();
    "walls = [\"-z\"]\nwall_material = \"light\"".clone_into(&mut scene.domain);
    scene.step = Step::OfLimit(0.5);
    // The dashpot is tuned to the lighter body; the heavy one needs another damping.
    let period = 2.0 * std::f64::consts::PI * (2.0 * MASS * ratio / stiffness).sqrt();
    scene.keys = format!("global_damping = {:e}", 4.0 / period);
    scene.length = Length::Seconds(10.0 * period);
    let weight = MASS * (1.0 + ratio) * G;
    let cell =
        Cell::new("density ratio, heavy on top", format!("1e{exponent}"), scene, move |ran| {
            vec![Deviation::of(
                "force on the floor",
                -ran.last("force_-z_z_N"),
                weight,
                weight,
                0.01,
            )]
        });
    if exponent == 6 { cell.quick() } else { cell }
}

/// A ball slides over the floor until it rolls at 5/7 of its speed.
fn bowling(friction: f64) -> Cell {
    let tables = balls(
        1e4,
        &format!("restitution = 0.5\nfriction = {friction}\ntangential_damping_ratio = 0.3"),
    );
    let sunk = MASS * G / 1e4;
    let grains = vec![Grain::at("ball", [0.0, 0.0, RADIUS - sunk]).moving([1.0, 0.0, 0.0])];
    let mut scene = Scene::on_floor(tables, grains).heavy();
    scene.step = Step::OfLimit(0.1);
    scene.length = Length::Seconds(4.0);
    let speed: f64 = if friction > 0.0 { 5.0 / 7.0 } else { 1.0 };
    let cell = Cell::new("friction", friction, scene, move |ran| {
        vec![Deviation::of("speed", ran.particles.velocity[0].x, speed, 1.0, 0.01)]
    });
    if friction == 1000.0 { cell.quick() } else { cell }
}

/// A free ball under global damping.
fn slowed(damping: f64) -> Cell {
    let dt = 1e-5;
    let grains = vec![Grain::at("ball", [0.0; 3]).moving([1.0, 0.0, 0.0])];
    let mut scene = Scene::free(balls(1e4, ""), grains);
    scene.keys = format!("global_damping = {damping:e}");
    scene.step = Step::Seconds(dt);
    let speed = (-damping * 1000.0 * dt).exp();
    let cell = Cell::new("global damping [1/s]", format!("{damping:e}"), scene, move |ran| {
        vec![Deviation::of("speed", ran.particles.velocity[0].x, speed, 1.0, 0.01)]
    });
    if damping > 2e5 { cell.quick() } else { cell }
}
