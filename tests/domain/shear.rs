//! A sheared cell: contacts with moving images equal contacts with the bodies themselves in a space without periods.

use crate::support::{begun, save, scene};
use dem_mpi::cell::{Cell, Shear};
use dem_mpi::comm::alone::Alone;
use dem_mpi::math::Vec3;
use dem_mpi::scene::Scene;
use dem_mpi::scene::assemble::{self, Continuation, StartError};
use dem_mpi::sim::Simulation;

/// Edge of the cell [m].
const SIDE: f64 = 0.02;
/// Shear rate [1/s].
const RATE: f64 = 60.0;

const BALL: &str = "kind = \"sphere\"\nradius = 0.0013";
const EGG: &str = "kind = \"ellipsoid\"\nsemi_axes = [0.0016, 0.0014, 0.0009]";
const BOX: &str = "kind = \"polyhedron\"\nvertices = [[-0.0013, -0.0012, -0.0011], [-0.0013, -0.0012, 0.0011], \
    [-0.0013, 0.0012, -0.0011], [-0.0013, 0.0012, 0.0011], [0.0013, -0.0012, -0.0011], [0.0013, -0.0012, 0.0011], \
    [0.0013, 0.0012, -0.0011], [0.0013, 0.0012, 0.0011]]";
const ROD: &str = "kind = \"spherocylinder\"\nlength = 0.001\nradius = 0.0009";

/// Friction, and dashpots in both directions.
const LOSSY: &str = "friction = 0.4\nrestitution = 0.6\ntangential_damping_ratio = 0.1";

fn text(domain: &str, shape: &str, material: &str, fill: &str, step: f64) -> Scene {
    scene(&format!(
        "[domain]\n{domain}\n[[material]]\nname = \"grain\"\ndensity = 2600.0\nnormal_stiffness = 2e4\n\
         tangential_stiffness = 1.5e4\n{material}\n[[shape]]\nname = \"grain\"\n{shape}\n{fill}\n[time]\nstep = {step:e}\n"
    ))
}

fn sheared(periodic: &str, along: &str, across: &str) -> String {
    format!(
        "low = [0.0, 0.0, 0.0]\nhigh = [{SIDE}, {SIDE}, {SIDE}]\nperiodic = {periodic}\n\
         shear = {{ along = \"{along}\", across = \"{across}\", rate = {RATE} }}"
    )
}

/// One particle.
fn one(at: Vec3, velocity: Vec3) -> String {
    let list = |v: &Vec3| format!("[{:?}, {:?}, {:?}]", v.x, v.y, v.z);
    format!(
        "[[fill.lattice]]\ncount = [1, 1, 1]\nfirst = {}\nvelocity = {}\n",
        list(&at),
        list(&velocity)
    )
}

/// Position and velocity in the space without periods, and spin, of a particle that began `up` images above.
fn unfolded(sim: &Simulation, id: u64, up: i32) -> [Vec3; 3] {
    let particles = &sim.particles;
    let slot = particles.id.iter().position(|other| other.0 == id).expect("a grain");
    if !particles.needs.image {
        return [particles.position[slot], particles.velocity[slot], spin(sim, slot)];
    }
    let shear = particles.cell.shear().expect("a sheared cell");
    let mut image = particles.image[slot];
    image[shear.across] += up;
    let place = particles.cell.unwrapped(particles.position[slot], &image);
    let above = particles.cell.velocity_above() * f64::from(image[shear.across]);
    [place, particles.velocity[slot] + above, spin(sim, slot)]
}

fn spin(sim: &Simulation, slot: usize) -> Vec3 {
    sim.particles.angular_velocity(slot)
}

/// Axes along and across, in cyclic order.
const FLOWS: [(&str, usize, &str, usize); 3] =
    [("x", 0, "y", 1), ("y", 1, "z", 2), ("z", 2, "x", 0)];

/// A collision with the moving image of B equals the collision of the same pair in free space, in place and time.
#[test]
fn a_collision_with_an_image_that_slides_is_that_of_free_bodies() {
    for (shape, at) in
        [(BALL, 0.0), (EGG, 0.0), (BOX, 0.0), (ROD, 0.0), (BALL, 0.017), (BOX, 0.017)]
    {
        for (along, flow, across, up) in FLOWS {
            let axis = |k: usize| Vec3::from_fn(|i, _| f64::from(u8::from(i == k)));
            let third = axis(3 - flow - up);
            let (ahead, height) = (axis(flow), axis(up));
            // B lies above the upper face, and in the cell above the lower one.
            let a = ahead * (0.002 + at) + height * (SIDE - 0.0021) + third * 0.010;
            let b = ahead * (0.0012 + at) + height * 0.0022 + third * 0.0104;
            let (of_a, of_b) = (height * 0.8 + third * 0.1, height * -0.4);
            let fill = format!("{}{}", one(a, of_a), one(b, of_b));
            let periodic = sheared("[true, true, true]", along, across);
            let step = 2e-6;
            let in_cell = text(&periodic, shape, LOSSY, &fill, step);
            let cell = in_cell.domain;
            let flows = |place: &Vec3| cell.flow_at(place);
            let free = "low = [-0.1, -0.1, -0.1]\nhigh = [0.2, 0.2, 0.2]";
            let fill = format!(
                "{}{}",
                one(a, of_a + flows(&a)),
                one(b + height * SIDE, of_b + flows(&b) + cell.velocity_above())
            );
            let in_space = text(free, shape, LOSSY, &fill, step);

            let (mut here, mut there) =
                (begun(&in_cell, &mut Alone::default()), begun(&in_space, &mut Alone::default()));
            let mut touched = 0;
            for _ in 0..1500 {
                here.step(&mut Alone::default()).unwrap();
                there.step(&mut Alone::default()).unwrap();
                touched += here.contacts.iter().count();
                assert_eq!(here.contacts.iter().count(), there.contacts.iter().count(), "{shape}");
            }
            assert!(
                touched > 20 && here.contacts.iter().count() == 0,
                "{shape}: {touched} touches"
            );
            for (id, images) in [(0, 0), (1, 1)] {
                let [place, velocity, spin] = unfolded(&here, id, images);
                let [free_place, free_velocity, free_spin] = unfolded(&there, id, 0);
                let errors = [
                    (place - free_place).norm() / 0.001,
                    (velocity - free_velocity).norm(),
                    (spin - free_spin).norm() / 1000.0,
                ];
                assert!(errors.iter().all(|error| *error < 1e-10), "{shape}, {along}: {errors:?}");
            }
            // The moving images supply the additional energy of the bodies in the cell.
            let [here, there] = [&here, &there].map(|sim| sim.measure(&mut Alone::default()));
            let missing = (here.missing() - there.missing()).abs() / here.received;
            assert!(missing < 1e-11, "{shape}, {along}: {missing:e} of the energy is missing");
        }
    }
}

/// Particles of one shape, with room for any orientation.
fn crowd(shape: &str, material: &str, step: f64) -> Scene {
    // Two halves are thrown at each other, because layers that only shear would never touch.
    let half = |first: f64, velocity: f64| {
        format!(
            "[[fill.lattice]]\ncount = [6, 6, 3]\nfirst = [0.0017, 0.0017, {first}]\nspacing = 0.00333\njitter = 0.0001\n\
             velocity = [0.0, {:?}, {velocity:?}]\n",
            0.5 * velocity
        )
    };
    let fill = half(0.0017, 0.3) + &half(0.01169, -0.3);
    text(&sheared("[true, true, true]", "x", "y"), shape, material, &fill, step)
}

/// The work of the cell equals dissipated, kinetic and stored energy; the dissipation of contacts is exact.
#[test]
fn nothing_is_missing_from_the_energy_of_a_sheared_crowd() {
    let rough = "friction = 0.4\nrestitution = 0.6";
    for (shape, material, most) in
        [(BALL, rough, 1e-12), (EGG, LOSSY, 1e-5), (ROD, LOSSY, 1e-3), (BOX, rough, 1e-3)]
    {
        let mut sim = begun(&crowd(shape, material, 2e-6), &mut Alone::default());
        let before = sim.measure(&mut Alone::default());
        for _ in 0..10_000 {
            sim.step(&mut Alone::default()).unwrap();
        }
        let after = sim.measure(&mut Alone::default());
        let given = after.received - before.received;
        let is_alive = after.dissipated > 0.1 * after.kinetic() && given > 0.1 * before.kinetic();
        assert!(is_alive, "{shape}: {after:?}");
        let missing = after.missing().abs() / after.dissipated;
        assert!(missing < most, "{shape}: {missing:e} of the dissipated is missing");
    }
}

/// Without friction and dashpots the energy error falls with the square of the step.
#[test]
fn the_balance_of_an_elastic_crowd_is_of_second_order() {
    for shape in [EGG, ROD] {
        let errors = [2e-6, 5e-7].map(|step: f64| {
            let mut sim = begun(&crowd(shape, "", step), &mut Alone::default());
            let mut largest = 0.0_f64;
            for k in 0..(0.012 / step) as usize {
                sim.step(&mut Alone::default()).unwrap();
                if k % 100 == 0 {
                    let measures = sim.measure(&mut Alone::default());
                    largest = largest.max(measures.missing().abs() / measures.kinetic());
                }
            }
            largest
        });
        assert!(errors[0] < 1e-3 && errors[1] < errors[0] / 8.0, "{shape}: {errors:?}");
    }
}

/// The energy that enters through images equals stress times rate times volume (Hill's condition). The difference stays in
/// the contents of the cell.
#[test]
fn the_work_of_the_cell_is_that_of_its_stress() {
    let mut sim = begun(&crowd(BALL, LOSSY, 4e-6), &mut Alone::default());
    let cell = sim.particles.cell;
    let (mut work, mut begin) = (0.0, None);
    for k in 0..60_000 {
        sim.step(&mut Alone::default()).unwrap();
        if k >= 10_000 && k % 10 == 0 {
            let measures = sim.measure(&mut Alone::default());
            let bulk = measures.bulk.expect("of a sheared cell");
            begin.get_or_insert(measures.received);
            work -=
                (bulk.of_contacts[3] + bulk.of_motion[3]) * RATE * cell.volume() * 10.0 * sim.dt;
        }
    }
    let given = sim.measure(&mut Alone::default()).received - begin.unwrap();
    let error = (work / given - 1.0).abs();
    assert!(error < 0.02, "stress gives {work:e} J, images give {given:e} J");
}

#[test]
fn the_nearest_image_is_the_shortest_and_wrapping_keeps_it() {
    let mut cell = Cell::new(Vec3::zeros(), Vec3::new(4.0, 3.0, 5.0), [true, true, false]);
    cell = cell
        .with_shear(Shear { along: 0, across: 1, rate: 2.0, strain: 0.0 })
        .expect("both repeat");
    for step in 0..200 {
        cell.advance(0.013);
        let turn = f64::from(step);
        let place = Vec3::new((turn * 0.37) % 4.0, (turn * 0.71) % 3.0, 1.0);
        for shift in
            [Vec3::new(0.9, 1.1, 0.3), Vec3::new(-0.8, -1.2, 0.0), Vec3::new(0.2, 0.1, 0.0)]
        {
            let (mut other, mut velocity, mut image) = (place + shift, Vec3::zeros(), [0; 3]);
            let out = other;
            let (_, is_far) = cell.wrap(&mut other, &mut velocity, &mut image);
            assert!(!is_far && (0.0..4.0).contains(&other.x) && (0.0..3.0).contains(&other.y));
            assert!((cell.nearest(other - place) - shift).norm() < 1e-13, "step {step}");
            assert!((cell.unwrapped(other, &image) - out).norm() < 1e-12, "step {step}");
            assert!((cell.inside(out) - other).norm() < 1e-13);
            let images = cell.shifts().into_iter().map(|by| (other + by - place).norm());
            assert!((images.fold(f64::INFINITY, f64::min) - shift.norm()).abs() < 1e-13);
            let gap = cell.gap([&place, &place], [&other, &other]);
            assert!((gap - shift.norm()).abs() < 1e-13, "{gap}");
            // Wrapping subtracts the shear velocity of the images that it passes, and the nearest image adds it back.
            let seen = cell.velocity_of_nearest(&(other - place)) + velocity;
            assert!(seen.norm() < 1e-13, "{seen}");
        }
    }
}

/// A new stage continues from the images' positions, and rate zero keeps them in place. A stage without shear or along
/// other axes is rejected.
#[test]
fn a_new_stage_takes_the_flow_and_the_images_over() {
    let scene_of = |shear: &str| {
        let domain = format!(
            "low = [0.0, 0.0, 0.0]\nhigh = [{SIDE}, {SIDE}, {SIDE}]\nperiodic = [true, true, true]\n{shear}"
        );
        text(&domain, BALL, "", &one(Vec3::new(0.01, 0.015, 0.01), Vec3::zeros()), 1e-5)
    };
    let flow = |rate: f64| format!("shear = {{ along = \"x\", across = \"y\", rate = {rate} }}");
    let first = scene_of(&flow(RATE));
    let mut sim = begun(&first, &mut Alone::default());
    assert!((sim.particles.velocity[0] - Vec3::new(RATE * 0.005, 0.0, 0.0)).norm() < 1e-15);
    for _ in 0..1000 {
        sim.step(&mut Alone::default()).unwrap();
    }
    let folder = tempfile::tempdir().unwrap();
    save(&sim, folder.path(), &first, &mut Alone::default());
    let begin = |scene: &Scene, how| {
        let mut comm = Alone::default();
        let mut sim = assemble::assemble(scene, &comm);
        assemble::take_up(&mut sim, scene, folder.path(), how, &mut comm).map(|_| sim)
    };
    let before = sim.particles.cell.shear().unwrap();
    assert!((before.strain - RATE * 0.01).abs() < 1e-12);
    for (rate, velocity) in [(RATE, 0.3), (-20.0, -0.1), (0.0, 0.0)] {
        let sim = begin(&scene_of(&flow(rate)), Continuation::NewStage).unwrap();
        assert_eq!(sim.particles.cell.shear(), Some(Shear { rate, ..before }));
        assert!((sim.particles.velocity[0].x - velocity).abs() < 1e-12);
    }
    for other in [String::new(), "shear = { along = \"z\", across = \"y\", rate = 1.0 }".to_owned()]
    {
        let error = begin(&scene_of(&other), Continuation::NewStage).err().expect("refused");
        assert!(matches!(error, StartError::Sheared { .. }), "{error}");
        assert!(error.to_string().contains("along x across y"), "{error}");
    }
}
