//! Bodies of several pieces move as rigid bodies.

use super::verification::cases::free_motion::half_period;
use crate::shape::unions::JACK;
use crate::support::{Bench, at, close, scene};
use dem_mpi::comm::alone::Alone;
use dem_mpi::ids::{GlobalId, ShapeId};
use dem_mpi::math::{Quat, Vec3};
use dem_mpi::particles::records::Particle;
use dem_mpi::scene::plan::plan;
use std::fmt::Write as _;

const BALL: &str = "[[shape]]\nname = \"ball\"\nkind = \"sphere\"\nradius = 0.01\n";
const CUBE: &str =
    "[[shape]]\nname = \"cube\"\nkind = \"polyhedron\"\nedges = [0.02, 0.02, 0.02]\n";

/// Scene of a union of one shape at positions [m].
fn of_pieces(piece: &str, places: &[[f64; 3]], rest: &str) -> String {
    let name = if piece == BALL { "ball" } else { "cube" };
    let mut text = "[[shape]]\nname = \"body\"\nkind = \"union\"\npieces = [".to_owned();
    for at in places {
        write!(text, "{{ shape = \"{name}\", at = {at:?} }}, ").unwrap();
    }
    format!("{text}]\n{piece}{rest}")
}

/// Bodies that land on one to four feet at once, and flat on faces. Each foot has its spring, and the body has the requested restitution.
/// Feet that overlap press nearly as one, and the body has the requested restitution, too. Blocks in steps of 1/100 of the contact deviate
/// by the time step's error of the dashpots.
#[test]
fn bodies_bounce_alike_on_any_number_of_feet() {
    let feet = |apart: f64| {
        [
            vec![[0.0; 3]],
            vec![[0.0; 3], [apart, 0.0, 0.0]],
            vec![[0.0; 3], [apart, 0.0, 0.0], [2.0 * apart, 0.0, 0.0]],
            vec![[0.0; 3], [apart, 0.0, 0.0], [0.0, apart, 0.0], [apart, apart, 0.0]],
        ]
    };
    let blocks = vec![[0.0; 3], [0.02, 0.0, 0.0], [0.0, 0.02, 0.0]];
    for restitution in [0.9, 0.5, 0.2] {
        let rest = format!(
            "gravity = [0, 0, 0]\n[[material]]\nname = \"m\"\ndensity = 2500\nnormal_stiffness = 1e4\nrestitution = {restitution}\n\
             [time]\nstep = 2e-6\n"
        );
        let rebound = |text: &str| {
            let (gravity, rest) = rest.split_once('\n').unwrap();
            let scene = scene(&format!("{gravity}\n{text}{rest}"));
            let mut bench = Bench::of(&scene, &[at(0, Vec3::z() * 0.0102, Vec3::z() * -0.1)]);
            for _ in 0..7000 {
                bench.step();
            }
            let velocity = bench.sim.particles.velocity[0];
            assert!(Vec3::new(velocity.x, velocity.y, 0.0).norm() < 1e-12, "{velocity}");
            velocity.z / 0.1
        };
        let single = rebound(BALL);
        close(single, restitution, 6e-3, "a ball");
        for places in &feet(0.022) {
            let found = rebound(&of_pieces(BALL, places, ""));
            close(found, single, 1e-9, &format!("on {} feet", places.len()));
        }
        for apart in [0.005, 0.01, 0.015] {
            for places in &feet(apart) {
                let found = rebound(&of_pieces(BALL, places, ""));
                close(found, single, 6e-3, &format!("on {} feet {apart} m apart", places.len()));
            }
        }
        let single = rebound(CUBE);
        close(single, restitution, 6e-3, "a block");
        let found = rebound(&of_pieces(CUBE, &blocks, ""));
        close(found, restitution, 6e-3, "three blocks flat");
        close(found, single, 3e-3, "three blocks beside one");
    }
}

/// A box, whole and in eight blocks, slides down a slope, tumbles over and comes to rest. Both move alike, on a plane and on triangles.
#[test]
fn a_cut_box_moves_as_the_whole() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("slope.obj");
    // Heights of a plane with the normal (0.3, 0.1, 1).
    let mut square = String::new();
    for [x, y] in [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [0.013, 0.007]] {
        writeln!(square, "v {x} {y} {}", -0.3 * x - 0.1 * y).unwrap();
    }
    square.push_str("f 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n");
    std::fs::write(&file, square).unwrap();
    moves_as_the_whole("point = [0, 0, 0]\nnormal = [0.3, 0.1, 1]");
    moves_as_the_whole(&format!("mesh = {:?}", file.display().to_string()));
}

fn moves_as_the_whole(wall: &str) {
    let rest = |shape: &str| {
        format!(
            "gravity = [0, 0, -9.81]\n{shape}[[wall]]\nname = \"slope\"\n{wall}\n\
             [[material]]\nname = \"m\"\ndensity = 2500\nnormal_stiffness = 1e4\ntangential_stiffness = 7e3\nfriction = 0.4\n\
             restitution = 0.4\ntangential_damping_ratio = 0.2\n[domain]\nlow = [-1, -1, -1]\nhigh = [1, 1, 1]\n\
             [time]\nstep = 1e-5\n"
        )
    };
    let half = [-0.01, 0.01];
    let places: Vec<[f64; 3]> =
        (0..8).map(|k| [half[k & 1], half[k >> 1 & 1], half[k >> 2]]).collect();
    let whole = CUBE.replace("0.02, 0.02, 0.02", "0.04, 0.04, 0.04");
    let start = Particle {
        quaternion: Quat::from_scaled_axis(Vec3::new(0.4, 0.3, 0.2)),
        ..at(0, Vec3::z() * 0.05, Vec3::new(0.3, 0.0, -0.5))
    };
    let benches = [rest(&whole), rest(&of_pieces(CUBE, &places, ""))];
    let mut benches = benches.map(|text| Bench::of(&scene(&text), std::slice::from_ref(&start)));
    let mut touched = 0;
    for step in 0..12_000 {
        benches.iter_mut().for_each(Bench::step);
        if step % 100 == 0 {
            let [one, other] = [&benches[0], &benches[1]].map(|bench| &bench.sim.particles);
            let place = (one.position[0] - other.position[0]).norm();
            let turn = [one, other].map(|p| p.orientation.as_ref().unwrap().quaternion[0]);
            assert!(place < 1e-9, "{place:e} m at step {step}");
            assert!(turn[0].angle_to(&turn[1]) < 1e-7, "step {step}");
            assert_eq!(benches[0].sim.contacts.len(), benches[1].sim.contacts.len());
            touched += benches[1].sim.contacts.len();
        }
    }
    assert!(touched > 20, "{touched}");
    let [one, other] = benches.each_mut().map(Bench::measure);
    // When another piece takes over a contact, its point refers to that piece from then on.
    close(other.dissipated, one.dissipated, 1e-4, "dissipated");
}

/// A body in free flight conserves its energy and its angular momentum. Near its middle axis it flips, with the period of Euler's equations
/// (Landau and Lifshitz 1, section 37). A jack with equal moments spins stably about any axis.
#[test]
fn a_body_of_blocks_turns_freely() {
    let tee = [[0.0; 3], [0.02, 0.0, 0.0], [-0.02, 0.0, 0.0], [0.0, 0.02, 0.0]];
    let jack = JACK.map(|at| at.map(|x| 0.02 * x));
    for (places, flips) in [(&tee[..], true), (&jack[..], false)] {
        let text = of_pieces(CUBE, places, "[time]\nstep = 1e-5\n");
        let scene = scene(&format!("gravity = [0, 0, 0]\n{text}"));
        let inertia = scene.library.inertia[0];
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| inertia[a].total_cmp(&inertia[b]));
        // Moments a < b < c.
        let mut spin = Vec3::zeros();
        spin[order[1]] = 50.0;
        spin[order[0]] = 5.0;
        let spun = at(0, Vec3::z() * 0.5, Vec3::zeros()).spinning(spin, &scene.library);
        let mut bench = Bench::of(&scene, &[spun]);
        let before = bench.sim.particles.angular_momentum(0);
        let energy = |bench: &mut Bench| bench.measure().kinetic();
        let first = energy(&mut bench);
        let along = |bench: &Bench| {
            let turn = bench.sim.particles.orientation.as_ref().unwrap().quaternion[0];
            turn.inverse_transform_vector(&before)[order[1]]
        };
        let (mut crossings, mut last) = (Vec::new(), along(&bench));
        for step in 0..100_000 {
            bench.step();
            let now = along(&bench);
            if now * last < 0.0 {
                crossings.push((f64::from(step) + last / (last - now)) * bench.sim.dt);
            }
            last = now;
        }
        assert_eq!(bench.sim.particles.angular_momentum(0), before);
        close(energy(&mut bench), first, 1e-12, "energy");
        if flips {
            let count = crossings.len() - 1;
            let found = (crossings[count] - crossings[0]) / count as f64;
            let moments = Vec3::from(order.map(|k| inertia[k]));
            let expected = half_period(&moments, &Vec3::from(order.map(|k| spin[k])));
            assert!(count >= 2, "{crossings:?}");
            close(found, expected, 1e-6, "time between flips");
        } else {
            assert!(crossings.is_empty(), "a jack tumbles");
        }
    }
}

/// A trace names the contacts of a body with feet by their bodies, and their forces and torques add up to those of the body.
#[test]
fn a_trace_has_the_contacts_of_pieces() {
    let feet = [[0.0; 3], [0.022, 0.0, 0.0], [0.0, 0.022, 0.0]];
    let scene = scene(&of_pieces(BALL, &feet, ""));
    let pose = |id, height| Particle {
        quaternion: Quat::from_scaled_axis(Vec3::new(0.0, 0.0, 0.1 * f64::from(id as u32))),
        ..at(id, Vec3::z() * height, Vec3::zeros())
    };
    let bench = Bench::of(&scene, &[pose(0, 0.0099), pose(1, 0.0292)]);
    let mut comm = Alone::default();
    for id in [0, 1] {
        let text = bench.sim.trace(GlobalId(id), &mut comm);
        let vector = |line: &str, name: &str| {
            let (_, rest) = line.split_once(&format!(" {name}=")).expect(name);
            let numbers = rest.split(' ').next().unwrap().trim().split(',');
            Vec3::from_iterator(numbers.map(|x| x.parse::<f64>().unwrap()))
        };
        let mut lines = text.lines();
        let state = lines.next().unwrap();
        let all: Vec<&str> = lines.collect();
        assert!(all.len() >= 3, "{text}");
        for name in ["force", "torque"] {
            let sum: Vec3 = all.iter().map(|line| vector(line, name)).sum();
            let whole = vector(state, name);
            assert!(
                (sum - whole).norm() <= 1e-12 * (whole.norm() + 1.0),
                "{name}: {sum} but {whole}"
            );
        }
        let partner = format!("contact={}", 1 - id);
        assert!(all.iter().any(|line| line.contains(&partner)), "{text}");
        assert!(bench.sim.touched_by(GlobalId(id), &mut comm).contains(&GlobalId(1 - id)));
    }
}

/// An audit leaves out contacts of unions, and reports it.
#[test]
fn audits_say_that_they_leave_out_unions() {
    let feet = [[0.0; 3], [0.022, 0.0, 0.0]];
    let text = of_pieces(BALL, &feet, "[audit]\nevery = 1\ncontacts = 1000\n");
    let scene = scene(&text);
    let beside =
        Particle { shape: ShapeId(1), ..at(1, Vec3::new(0.1, 0.0, 0.0099), Vec3::zeros()) };
    let mut bench = Bench::of(&scene, &[at(0, Vec3::z() * 0.0099, Vec3::zeros()), beside]);
    bench.step();
    let mut comm = Alone::default();
    bench.sim.audit(&mut comm);
    assert_eq!(bench.sim.contacts.len(), 3);
    let audit = bench.sim.audit.figures(&bench.sim, &mut comm);
    assert!((audit.contacts, audit.without_unions) == (1, true), "{audit:?}");
    assert!(plan(&scene, 1).contains("without contacts of unions"));
}
