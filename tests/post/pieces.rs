//! Tables in pieces, damaged tables, and counts.

use super::fabric::contacts_with;
use super::{ROUNDING, close};
use crate::support::packings::{Snapshot, ellipsoids, header, particles_at, push, push_force};
use dem_mpi::ids::{GlobalId, ShapeId};
use dem_mpi::math::Vec3;
use dem_mpi::output::tables::{ContactTable, ParticleTable};
use dem_mpi::particles::columns::{Accumulated, Quantity};
use dem_mpi::post::draw::{BLUE, Mark};
use dem_mpi::post::fabric::Among;
use dem_mpi::post::forces::Histogram;
use dem_mpi::post::region::{Bounds, Region};
use dem_mpi::post::{ParticlePass, Report, Settings, plots};

/// Rows of a table, in the given order.
pub(super) fn some_particles(table: &ParticleTable, rows: &[usize]) -> ParticleTable {
    fn pick<T: Copy>(column: &[T], rows: &[usize]) -> Vec<T> {
        rows.iter().filter_map(|&r| column.get(r).copied()).collect()
    }
    let mut accumulated = Accumulated::default();
    for quantity in Quantity::ALL {
        accumulated[quantity] = pick(&table.accumulated[quantity], rows);
    }
    ParticleTable {
        id: pick(&table.id, rows),
        shape: pick(&table.shape, rows),
        scale: pick(&table.scale, rows),
        group: pick(&table.group, rows),
        position: pick(&table.position, rows),
        velocity: pick(&table.velocity, rows),
        force: pick(&table.force, rows),
        coordination: pick(&table.coordination, rows),
        rank: pick(&table.rank, rows),
        accumulated,
        standing: pick(&table.standing, rows),
        image: pick(&table.image, rows),
        quaternion: pick(&table.quaternion, rows),
        angular_momentum: pick(&table.angular_momentum, rows),
        angular_velocity: pick(&table.angular_velocity, rows),
        torque: pick(&table.torque, rows),
        velocity_ahead: pick(&table.velocity_ahead, rows),
        angular_velocity_ahead: pick(&table.angular_velocity_ahead, rows),
    }
}

fn some_contacts(table: &ContactTable, rows: &[usize]) -> ContactTable {
    ContactTable {
        a: rows.iter().map(|&r| table.a[r]).collect(),
        b: rows.iter().map(|&r| table.b[r]).collect(),
        centre: rows.iter().map(|&r| table.centre[r]).collect(),
        branch: rows.iter().map(|&r| table.branch[r]).collect(),
        point: rows.iter().map(|&r| table.point[r]).collect(),
        normal: rows.iter().map(|&r| table.normal[r]).collect(),
        overlap: rows.iter().map(|&r| table.overlap[r]).collect(),
        normal_force: rows.iter().map(|&r| table.normal_force[r]).collect(),
        shear_force: rows.iter().map(|&r| table.shear_force[r]).collect(),
    }
}

#[test]
fn pieces_in_any_order_give_the_same_digits_as_the_whole() {
    let snapshot = ellipsoids(7, 1);
    let box_of = Region::Box(Bounds { low: Vec3::repeat(2e-3), high: Vec3::repeat(13e-3) });
    for region in [Region::Whole, box_of] {
        let settings = Settings { region, among: Among::ParticlesAndWalls };
        let whole = snapshot.analyse(settings).unwrap();
        // Pieces in the order of four ranks.
        let order = |rows: usize| {
            (0..4).map(move |rank| (0..rows).rev().filter(|r| r % 4 == rank).collect::<Vec<_>>())
        };
        let mut particles = ParticlePass::new(&snapshot.header, settings).unwrap();
        for rows in order(snapshot.particles.id.len()) {
            particles.add(&some_particles(&snapshot.particles, &rows)).unwrap();
        }
        let mut contacts = particles.finish();
        for rows in order(snapshot.contacts.a.len()) {
            contacts.add_contacts(&some_contacts(&snapshot.contacts, &rows)).unwrap();
        }
        let mut forces = contacts.finish();
        for rows in order(snapshot.contacts.a.len()) {
            forces.add_contacts(&some_contacts(&snapshot.contacts, &rows)).unwrap();
        }
        let pieces = forces.finish("in memory");
        let text = |report: &Report| serde_json::to_string(report).unwrap();
        assert_eq!(text(&whole.report), text(&pieces.report));
        assert_eq!(whole.picture.svg(None), pieces.picture.svg(None));
    }
}

#[test]
fn mechanical_coordination_leaves_out_rattlers() {
    // A triangle 0-1-2, particle 3 with one contact at 0, and particle 4 alone on the floor.
    let centres: Vec<Vec3> = (0..5).map(|i| Vec3::x() * f64::from(i)).collect();
    let header = header(Vec3::zeros(), Vec3::repeat(5.0), false, Vec3::repeat(0.5), 5);
    let mut contacts = ContactTable::default();
    for (a, b) in [(0, 1), (0, 2), (1, 2), (0, 3)] {
        push(&mut contacts, (a, GlobalId(b)), centres[a as usize], Vec3::x(), Vec3::x() * 0.5);
        push_force(&mut contacts, Vec3::x(), 0.0, 1.0, Vec3::zeros());
    }
    push(&mut contacts, (4, GlobalId::wall(0)), centres[4], -Vec3::z() * 0.5, -Vec3::z() * 0.5);
    push_force(&mut contacts, -Vec3::z(), 0.0, 1.0, Vec3::zeros());
    let snapshot = Snapshot { header, particles: particles_at(centres), contacts };
    let s = snapshot.report().summary;
    assert_eq!(s.coordination, Some(8.0 / 5.0));
    assert_eq!(s.coordination_with_walls, Some(9.0 / 5.0));
    // (2 · 4 - 1) / (5 - 1 - 1) and (9 - 2) / (5 - 0 - 2).
    assert_eq!(s.mechanical_coordination, Some(7.0 / 3.0));
    assert_eq!(s.mechanical_coordination_with_walls, Some(7.0 / 3.0));
    assert_eq!((s.rattlers, s.rattlers_with_walls), (2, 2));
}

#[test]
fn forces_are_counted_over_their_mean() {
    let normals = [Vec3::x(), Vec3::y(), Vec3::z(), Vec3::x()];
    let forces = [0.2, 0.6, 1.2, 2.0].map(|f| (f, Vec3::zeros()));
    let (_, contacts) = contacts_with(&normals, &forces);
    let header = header(Vec3::zeros(), Vec3::repeat(1.0), false, Vec3::repeat(0.1), 2);
    let mut contacts = contacts;
    contacts.shear_force[1] = Vec3::z() * 0.3;
    let particles = particles_at(vec![Vec3::zeros(), Vec3::repeat(0.2)]);
    let report = Snapshot { header, particles, contacts }.report();
    let forces = report.forces.unwrap();
    close(report.summary.mean_normal_force_n.unwrap(), 1.0, ROUNDING, "mean");
    assert_eq!(forces.weak_share, Some(0.25));
    assert_eq!(forces.below_mean_share, Some(0.5));
    assert_eq!(forces.largest_normal_force, 2.0);
    close(forces.mean_friction_used.unwrap(), 0.125, ROUNDING, "friction used");
    let area: f64 = forces.normal.density().map(|(_, d)| d * 0.1).sum();
    close(area, 1.0, ROUNDING, "area under the density");
    // Ten bins per decade, drawn at their middles on a logarithmic axis.
    let shown = ("normal", BLUE, &forces.normal_logarithmic);
    let (_, drawn) = plots::shares_per_decade(&[shown], Mark::Dots);
    let area: f64 = drawn[0].points.iter().map(|(_, share)| share * 0.1).sum();
    close(area, 1.0, ROUNDING, "area under the shares by decade");
    for (force, _) in &drawn[0].points {
        let middle = 10.0 * force.log10() - 0.5;
        assert!((middle - middle.round()).abs() < 1e-9, "{force}");
    }
    assert_eq!(forces.shear_logarithmic.halves_below, 6, "three contacts without shear");
}

/// With attraction on average, forces over the mean are meaningless and left out.
#[test]
fn forces_that_pull_have_no_shares_of_their_mean() {
    let normals = [Vec3::x(), Vec3::y(), Vec3::z()];
    let forces = [-0.2, -0.9, 0.5].map(|f| (f, Vec3::z() * 0.1));
    let (_, contacts) = contacts_with(&normals, &forces);
    let header = header(Vec3::zeros(), Vec3::repeat(1.0), false, Vec3::repeat(0.1), 2);
    let particles = particles_at(vec![Vec3::zeros(), Vec3::repeat(0.2)]);
    let report = Snapshot { header, particles, contacts }.report();
    close(report.summary.mean_normal_force_n.unwrap(), -0.2, ROUNDING, "mean");
    assert_eq!(report.summary.share_below_0_3_mean, None);
    assert_eq!(report.summary.share_below_mean, None);
    let forces = report.forces.unwrap();
    assert_eq!(forces.normal.total_halves() + forces.shear_logarithmic.total_halves(), 0);
    assert_eq!(forces.largest_normal_force, 0.5);
    close(forces.mean_friction_used.unwrap(), 0.2, ROUNDING, "friction used");
}

#[test]
fn histograms_put_values_on_edges_into_the_upper_bin() {
    let histogram = Histogram::logarithmic(1, -1, 1);
    assert_eq!(histogram.edges, [0.1, 1.0, 10.0]);
    assert_eq!(Histogram::linear(2, 1.0).edges, [0.0, 0.5, 1.0]);
}

#[test]
fn damaged_tables_are_named() {
    let sound = ellipsoids(3, 5);
    let says = |snapshot: &Snapshot| {
        snapshot.analyse(Settings::default()).expect_err("a damaged snapshot").to_string()
    };
    let mut broken = sound.clone();
    broken.particles.position[4].y = f64::NAN;
    assert!(says(&broken).contains("position of particle 4"));
    let mut broken = sound.clone();
    broken.particles.id[1] = GlobalId(0);
    assert!(says(&broken).contains("particle 0 appears twice"));
    let mut broken = sound.clone();
    broken.header.next_id = 20;
    assert!(says(&broken).contains("never assigned"));
    let mut broken = sound.clone();
    broken.contacts.b[0] = GlobalId(1000);
    assert!(says(&broken).contains("names particle 1000"));
    let mut broken = sound.clone();
    broken.particles.shape[2] = ShapeId(7);
    assert!(says(&broken).contains("shape 7"));
    let mut broken = sound.clone();
    broken.contacts.normal_force[0] = f64::INFINITY;
    assert!(says(&broken).contains("normal force"));

    let flat = Bounds { low: Vec3::zeros(), high: Vec3::new(1.0, 0.0, 1.0) };
    let settings = Settings { region: Region::Box(flat), ..Settings::default() };
    let error = sound.analyse(settings).expect_err("no volume").to_string();
    assert!(error.contains("no length along y"), "{error}");
}
