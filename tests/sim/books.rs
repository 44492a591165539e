//! Booked energies add up, for all shapes and laws.

use crate::sim::symmetries::{Cloud, Law, SHAPES, cases};
use crate::support::{Bench, begun, close, scene};
use dem_mpi::comm::alone::Alone;
use dem_mpi::ids::ShapeId;
use dem_mpi::math::Vec3;
use dem_mpi::measure::Measures;
use dem_mpi::particles::columns::Quantity;

const STEPS: u32 = 2000;
const DT: f64 = 1e-5;

/// Runs a cloud that falls on its plane with these keys, both in a moving frame. Returns the final measures, the work of the plane's forces and
/// torques averaged over each step, and the energy received in the same time [J].
fn after(cloud: &Cloud, keys: &str, drift: Vec3, spin: Vec3) -> (Measures, [f64; 2]) {
    let text = cloud
        .text()
        .replace("name = \"plane\"", &format!("name = \"plane\"\n{keys}"))
        .replace("step = 2e-5", &format!("step = {DT:e}"));
    let mut grains = cloud.grains.clone();
    for grain in &mut grains {
        grain.velocity += drift;
    }
    let mut bench = Bench::of(&scene(&text), &grains);
    let power = |measures: &Measures| {
        -(measures.wall_forces[0].dot(&drift) + measures.wall_torques[0].dot(&spin))
    };
    let mut measures = bench.measure();
    let before = measures.received;
    let (mut work, mut met) = (0.0, 0);
    for _ in 0..STEPS {
        let last = power(&measures);
        bench.step();
        measures = bench.measure();
        work += 0.5 * DT * (last + power(&measures));
        met += measures.wall_contacts;
    }
    assert!(met > 100, "{:?} {}", cloud.law, cloud.shape);
    let received = measures.received - before;
    (measures, [work, received])
}

/// The work of a moving or rotating plane is that of its forces. In the plane's frame the losses of each cause and the energy error are equal. The
/// energy error is rounding for spheres, and at most 1e-4 of the losses for others.
#[test]
fn walls_do_the_work_of_their_forces() {
    for cloud in cases() {
        let case = format!("{:?} {}", cloud.law, cloud.shape.replace('\n', " "));
        let (still, _) = after(&cloud, "", Vec3::zeros(), Vec3::zeros());
        let drift = Vec3::new(0.3, -0.2, 0.5);
        let keys = format!("velocity = {:?}", drift.as_slice());
        let (moved, [work, received]) = after(&cloud, &keys, drift, Vec3::zeros());
        assert!(work.abs() > 1e-4, "{case}: {work:e}");
        println!("{case}: missing {:e}, lost {:e}", still.missing(), still.dissipated);
        close(received, work, 1e-9, &format!("{case}, moved"));
        let most = 1e-9 * still.dissipated;
        assert!((moved.dissipated - still.dissipated).abs() < most, "{case}");
        assert!((moved.missing() - still.missing()).abs() < most, "{case}");
        for (now, before) in moved.channels.iter().zip(still.channels) {
            assert!((now - before).abs() < most, "{case}");
        }
        let rounded = cloud.shape.starts_with("kind = \"sphere\"");
        let missing = still.missing().abs() / still.dissipated;
        println!("part missing: {missing:e}");
        // Round pieces that act as one share a quadratic energy, which Hertz's law does not have. Crossed bars are at the limit of their step.
        let is_union = cloud.shape.contains("union");
        let most = match (rounded, is_union, cloud.law == Law::Hertz) {
            (true, ..) => 1e-11,
            (_, true, true) => 2e-2,
            (_, true, false) => 1e-3,
            _ => 1e-4,
        };
        assert!(missing < most, "{case}: {missing:e}");

        let spin = Vec3::new(0.0, 0.1, 1.0).normalize() * 20.0;
        let keys = format!(
            "rotation = {{ about = [0.001, 0.002, -0.031], axis = [0, 0.1, 1], rate = {} }}",
            spin.norm()
        );
        let (_, [work, received]) = after(&cloud, &keys, Vec3::zeros(), spin);
        assert!(cloud.law == Law::Jkr || work.abs() > 1e-7, "{case}: {work:e}");
        // Pieces move on arcs, and a step uses the chord.
        let most = if cloud.shape.contains("union") { 1e-6 } else { 1e-7 };
        close(received, work, most, &format!("{case}, turned"));
    }
}

/// Two particles that strike the moving plane and separate, one of the shape and one a ball: point contacts and face contacts with their ends.
#[test]
fn walls_do_their_work_until_bodies_part() {
    for shape in SHAPES {
        let both = format!("{shape}\n[[shape]]\nname = \"ball\"\n{}", SHAPES[0]);
        // With dashpots the last force of a contact would be 0.
        let mut cloud = Cloud::new(&both, Law::LinearWithoutDashpots);
        cloud.gravity = Vec3::zeros();
        cloud.grains.truncate(2);
        for (k, grain) in cloud.grains.iter_mut().enumerate() {
            grain.shape = ShapeId(k as u16);
            grain.velocity = Vec3::new(0.3, -0.2, -3.0);
        }
        let drift = Vec3::new(0.3, -0.2, 0.5);
        let keys = format!("velocity = {:?}", drift.as_slice());
        let (end, [work, received]) = after(&cloud, &keys, drift, Vec3::zeros());
        assert!(end.wall_contacts == 0 && work.abs() > 1e-3, "{shape}: {work:e}");
        close(received, work, 1e-9, shape);
    }
}

/// Without dashpots no loss is booked to them. The loss of normal dashpots is the remainder after all other causes.
#[test]
fn no_dashpot_takes_anything_where_there_is_none() {
    for shape in SHAPES {
        for law in [Law::LinearWithoutDashpots, Law::HertzWithoutDashpots] {
            let (end, _) = after(&Cloud::new(shape, law), "", Vec3::zeros(), Vec3::zeros());
            let [normal, tangential] =
                [end.of_normal_dashpots(), end.taken_by(Quantity::OfTangentialDashpots)];
            let [friction, turning] =
                [Quantity::OfFriction, Quantity::OfTurning].map(|cause| end.taken_by(cause));
            println!("{law:?} {shape}: {normal:e} {tangential:e} {friction:e} {turning:e}");
            assert!(friction > 1e-5 && turning > 1e-5, "{law:?} {shape}");
            assert!(normal.abs() < 1e-12 * end.dissipated, "{law:?} {shape}: {normal:e}");
            assert!(tangential.abs() < 1e-12 * end.dissipated, "{law:?} {shape}: {tangential:e}");
        }
    }
}

/// A particle takes its energy along through an outlet: a fall has no energy error at any step.
#[test]
fn a_grain_that_leaves_takes_its_energy_along() {
    let scene = scene(
        "gravity = [0.5, 0, -9.81]\n[domain]\nlow = [0, 0, 0]\nhigh = [1, 1, 1]\n[[material]]\nname = \"m\"\ndensity = 2500\nnormal_stiffness = 1e3\n\
         [[shape]]\nname = \"ball\"\nkind = \"sphere\"\nradius = 0.01\n\
         [[fill.lattice]]\nfirst = [0.5, 0.5, 0.9]\ncount = [1, 1, 1]\nvelocity = [0, 0, -1]\n\
         [[outlet]]\nname = \"drain\"\npoint = [0, 0, 0.5]\nnormal = [0, 0, 1]\nevery = 1\n\
         [time]\nstep = 1e-3\n",
    );
    let mut comm = Alone::default();
    let mut sim = begun(&scene, &mut comm);
    let had = sim.measure(&mut comm).mechanical();
    while sim.particles.owned > 0 {
        sim.step(&mut comm).unwrap();
        let missing = sim.measure(&mut comm).missing();
        assert!(missing.abs() < 1e-13 * had, "step {}: {missing:e} of {had:e} J", sim.step);
    }
    assert!((200..400).contains(&sim.step), "{}", sim.step);
}
