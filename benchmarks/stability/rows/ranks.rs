//! Few particles on many ranks, narrow periods, and stages that differ from the one before.

use crate::cell::{Cell, Deviation};
use crate::scene::{Grain, Length, RADIUS, Scene, Step, balls};
use dem_mpi::math::Vec3;

pub(super) fn cells() -> Vec<Cell> {
    let mut cells = Vec::new();
    for count in 0..=2 {
        cells.push(few(count));
    }
    for width in [3.9, 4.19, 4.21, 4.5, 8.0] {
        cells.push(narrow(width));
    }
    let stage = |value: &str, change: fn(&mut Scene)| another_stage(value, change);
    cells.push(stage("a tenth of the step", |scene| scene.step = Step::OfLimit(0.02)));
    cells.push(stage("four times the step", |scene| scene.step = Step::OfLimit(0.8)));
    cells.push(stage("ten times the step", |scene| scene.step = Step::OfLimit(2.0)));
    cells.push(stage("no skin", |scene| scene.tables += "[neighbours]\nskin = 0\n"));
    cells.push(stage("a wide skin", |scene| scene.tables += "[neighbours]\nskin = 0.02\n"));
    cells.push(stage("epa", |scene| scene.tables += "[contact]\nmethod = \"epa\"\n"));
    cells.push(stage("gjk-erosion", |scene| {
        scene.tables += "[contact]\nmethod = \"gjk-erosion\"\n";
    }));
    cells.push(stage("ten times the stiffness", |scene| {
        scene.tables = scene.tables.replace("normal_stiffness = 1e4", "normal_stiffness = 1e5");
    }));
    cells
}

/// `count` balls on eight ranks.
fn few(count: u32) -> Cell {
    let place = |k: u32| Vec3::new(2.1 * f64::from(k), 0.0, 3.0) * RADIUS;
    let grains = (0..count).map(|k| Grain::at("ball", place(k))).collect();
    let scene = Scene::on_floor(balls(1e4, "friction = 0.3\nrestitution = 0.5"), grains).heavy();
    let scene = scene.lasting(Step::OfLimit(0.2), Length::Steps(3000));
    let cell = Cell::new("particles on 8 ranks", count, scene, |_| Vec::new());
    Cell { ranks: 8, ..cell }.quick()
}

/// Two balls collide head on through a period of `width` radii along x.
fn narrow(width: f64) -> Cell {
    let grains = vec![
        Grain::at("ball", [0.5 * RADIUS, 0.0, 0.0]).moving([-0.5, 0.0, 0.0]),
        Grain::at("ball", [(0.5 * width + 0.7) * RADIUS, 0.0, 0.0]).moving([0.5, 0.0, 0.0]),
    ];
    let mut scene = Scene::free(balls(1e4, ""), grains);
    "periodic = [true, false, false]".clone_into(&mut scene.domain);
    (scene.low.x, scene.high.x) = (0.0, width * RADIUS);
    scene.step = Step::OfLimit(0.05);
    scene.length = Length::Steps(20_000);
    let cell = Cell::new("period over the radius", width, scene, |ran| {
        let (now, came) = (ran.last("kinetic_J") + ran.last("stored_J"), ran.last("received_J"));
        let momentum: Vec3 = ran.particles.velocity.iter().sum();
        vec![
            Deviation::of("energy", now, came, came, 1e-2),
            Deviation { what: "momentum over mass [m/s]", is: momentum.norm(), allowed: 1e-10 },
        ]
    });
    if matches!(width, 4.19 | 4.21) { cell.quick() } else { cell }
}

/// Ellipsoids fall, and continue in a stage with other settings.
fn another_stage(value: &str, change: fn(&mut Scene)) -> Cell {
    let tables = crate::scene::material("m", 2500.0, 1e4, "friction = 0.3\nrestitution = 0.5")
        + &crate::scene::shape("grain", "ellipsoid", "semi_axes = [0.013, 0.01, 0.008]");
    let place = |k: u32| {
        Vec3::new(f64::from(k % 3), f64::from(k / 3 % 3), f64::from(k / 9)).add_scalar(0.5) * 0.027
    };
    let mut random = dem_mpi::random::Random::of(13, 0);
    let grains = (0..27).map(|k| Grain::at("grain", place(k)).turned(random.rotation())).collect();
    let mut first = Scene::free(tables, grains).heavy();
    (first.low, first.high) = (Vec3::zeros(), Vec3::repeat(0.081));
    "walls = [\"-x\", \"+x\", \"-y\", \"+y\", \"-z\"]".clone_into(&mut first.domain);
    first = first.lasting(Step::OfLimit(0.2), Length::Seconds(0.1));
    let mut second = first.clone();
    change(&mut second);
    let mut cell = Cell::new("a stage after another", value, first, |_| Vec::new());
    cell.stages.push(second);
    if value == "ten times the step" || value == "epa" { cell.quick() } else { cell }
}
