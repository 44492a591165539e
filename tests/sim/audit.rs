//! The audit of contacts: the reported errors are those of the run, and identical on any number of ranks.

use crate::support::{MATERIAL, begun, scene};
use dem_mpi::comm::alone::Alone;
use dem_mpi::comm::{Comm, threads};
use dem_mpi::contact::{CommonNormal, ContactResolver, Outcome};
use dem_mpi::output::report::audit::Audit;
use dem_mpi::scene::Scene;
use dem_mpi::shape::Kind;

/// Ellipsoids and balls on a floor, on a lattice so narrow that they touch, with the given resolver and audit.
fn lattice(contact: &str, audit: &str) -> Scene {
    scene(&format!(
        r#"
gravity = [0.0, 0.0, -9.81]
[domain]
low = [0.0, 0.0, 0.0]
high = [0.04, 0.04, 0.02]
periodic = [true, true, false]
walls = ["-z"]
{MATERIAL}
[[shape]]
name = "egg"
kind = "ellipsoid"
semi_axes = [1.15e-3, 1e-3, 0.9e-3]
[[shape]]
name = "ball"
kind = "sphere"
radius = 1e-3
[[fill.lattice]]
shapes = {{ egg = 3, ball = 1 }}
first = [1e-3, 1e-3, 0.97e-3]
spacing = [1.99e-3, 1.99e-3, 1.99e-3]
count = [20, 20, 4]
[time]
step = 1e-6
steps = 100
[contact]
{contact}
[audit]
{audit}
"#
    ))
}

/// The audit after a number of steps on a number of ranks, and the state of all particles.
fn audited(scene: &Scene, ranks: u32, steps: u64) -> (Audit, Vec<(u64, Vec<u64>)>) {
    let mut of_ranks = threads::run(ranks, |comm| {
        let mut sim = begun(scene, comm);
        for _ in 0..steps {
            sim.step(comm).expect("the step is done");
            sim.audit(comm);
        }
        let motion: Vec<_> = crate::support::motion(&sim.particle_table(comm.rank())).collect();
        (sim.audit.figures(&sim, comm), motion)
    });
    let mut motion: Vec<_> =
        of_ranks.iter_mut().flat_map(|(_, motion)| std::mem::take(motion)).collect();
    motion.sort_unstable();
    (of_ranks.swap_remove(0).0, motion)
}

/// Errors against common normals that the test computes for every contact.
#[test]
fn errors_are_those_of_the_contacts() {
    let scene = lattice("method = \"gjk-erosion\"", "every = 1\ncontacts = 1_000_000");
    let mut comm = Alone::default();
    let mut sim = begun(&scene, &mut comm);
    sim.step(&mut comm).expect("the step is done");
    sim.audit(&mut comm);
    let audit = sim.audit.figures(&sim, &mut comm);
    let is_egg = |kinds: &[&str; 2]| *kinds == ["ellipsoid", "ellipsoid"];
    let found = audit.of_kinds.iter().find(|of| is_egg(&of.kinds)).expect("eggs touch");

    let bodies = sim.particles.bodies();
    let (mut overlaps, mut angles, mut points, mut spurious) = (vec![], vec![], vec![], 0);
    for (pair, touch) in sim.contacts.touches(&sim.particles) {
        let eggs =
            [pair.a, pair.b].map(|slot| bodies.shape_of(slot).kind()) == [Kind::Ellipsoid; 2];
        if !eggs || pair.a.index() >= sim.particles.owned {
            continue;
        }
        let frames = bodies.frames(pair);
        let (a, b) = bodies.posed(pair, &frames);
        let Outcome::Touching(truth) = CommonNormal.touch(&a, &b, &bodies.relative(pair), None)
        else {
            spurious += 1;
            continue;
        };
        overlaps.push((touch.overlap - truth.overlap).abs() / 1.8e-3);
        angles.push((touch.normal - truth.normal).norm());
        points.push((touch.point - truth.point).norm() / 1.8e-3);
    }
    assert!(overlaps.len() > 500, "{} contacts", overlaps.len());
    assert_eq!((found.contacts, found.spurious), (overlaps.len() as u64 + spurious, spurious));
    assert_eq!(found.unresolved, 0);
    let near = |found: f64, expected: f64| (found / expected - 1.0).abs() < 1e-3;
    assert_eq!(spurious, 0, "or overlaps have other errors than normals");
    let all = [(&found.overlap, overlaps), (&found.normal_rad, angles), (&found.point, points)];
    for (figures, mut expected) in all {
        expected.sort_by(f64::total_cmp);
        let at = |percent: usize| expected[(expected.len() - 1) * percent / 100];
        let all = [(figures.median, at(50)), (figures.p99, at(99)), (figures.max, at(100))];
        assert!(all.iter().all(|&(found, expected)| near(found, expected)), "{all:?}");
    }
    // The law is linear, so errors of forces are proportional to those of overlaps.
    let (force, overlap) = (&found.force, &found.overlap);
    assert!(near(force.max / force.median, overlap.max / overlap.median), "{found:?}");
    assert!(found.mean_force_n > 0.0);
    assert!(found.normal_rad.median > 1e-4, "erosion is off: {found:?}");
}

const STEPS: u64 = 24;

/// More errors than the audit keeps, so that several ranks keep others than one. The trajectory is independent of the
/// audit.
#[test]
fn an_audit_is_the_same_on_any_number_of_ranks_and_leaves_no_trace() {
    for contact in ["method = \"auto\"", "method = \"gjk-erosion\""] {
        let all = lattice(contact, "every = 3\ncontacts = 1_000_000\nseed = 3");
        let some = lattice(contact, "every = 2\ncontacts = 60");
        let none = lattice(contact, "every = 0");
        let (alone, motion) = audited(&all, 1, STEPS);
        let most = alone.of_kinds.iter().map(|of| of.contacts).max().unwrap_or_default();
        assert!(most > 2 * 4096, "{most} contacts are a poor test: {alone:#?}");
        assert!(alone.of_kinds.len() == 5, "eggs, balls and a floor: {alone:#?}");
        let (some_alone, of_some) = audited(&some, 1, STEPS);
        assert_eq!(some_alone.audits, 12);
        // 60 among thousands at each audit: five standard deviations.
        assert!(some_alone.contacts.abs_diff(12 * 60) < 135, "{}", some_alone.contacts);
        assert_eq!(motion, of_some);
        for ranks in [2, 3, 4] {
            assert_eq!(
                audited(&all, ranks, STEPS),
                (alone.clone(), motion.clone()),
                "{ranks} ranks"
            );
            assert_eq!(audited(&some, ranks, STEPS).0, some_alone, "{ranks} ranks");
        }
        let (nothing, of_none) = audited(&none, 2, STEPS);
        assert_eq!((nothing.audits, nothing.contacts, nothing.of_kinds.len()), (0, 0, 0));
        assert_eq!(motion, of_none);
    }
}
