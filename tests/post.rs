//! What is computed from a snapshot, against closed forms and the independent reference.

use crate::packings::{
    Dice, Snapshot, boxed, closed, ellipsoids, header, particles_at, push, push_force, store,
};
use crate::support::{begun, scene};
use dem_mpi::cell::Cell;
use dem_mpi::comm::alone::Alone;
use dem_mpi::comm::{Comm, threads};
use dem_mpi::contact::{Histories, StateColumn};
use dem_mpi::drive::{SavedColumn, SavedState, Values, servo};
use dem_mpi::ids::{GlobalId, ShapeId};
use dem_mpi::math::{Mat3, Quat, Vec3};
use dem_mpi::output::snapshot::{self, Reader};
use dem_mpi::output::table;
use dem_mpi::output::tables::{ContactTable, Header, ParticleTable, WallRow};
use dem_mpi::post::diff::{Difference, State};
use dem_mpi::post::fabric::{Among, FabricSum, ForceFabricSum, Rose, degree};
use dem_mpi::post::forces::Histogram;
use dem_mpi::post::history::{Curve, History};
use dem_mpi::post::region::{Bounds, Extent, Margin, Members, Region, SampledSolid, Strain};
use dem_mpi::post::stress::{Stress, StressSum};
use dem_mpi::post::{
    ParticlePass, Report, Settings, analyse, inside, lammps, page, panels, plots, series,
};
use dem_mpi::shape::{
    Ellipsoid, Kind, PolySuperellipsoid, Polyhedron, RoundedPolyhedron, Shape, Sphere,
    Spherocylinder, Superellipsoid,
};
use nalgebra::Quaternion;
use rand_chacha::ChaCha8Rng;
use rand_core::SeedableRng;
use serde_json::Value;
use std::f64::consts::PI;
use std::fs::File;
use std::path::Path;
use std::process::Command;

/// Sums are exact; what is left is the rounding of each term and of the reference.
const ROUNDING: f64 = 1e-12;

fn close(value: f64, expected: f64, tolerance: f64, what: &str) {
    let scale = expected.abs().max(1.0);
    assert!((value - expected).abs() <= tolerance * scale, "{what}: {value} but {expected}");
}

fn close_matrix(value: &Mat3, expected: &Mat3, tolerance: f64, what: &str) {
    let scale = expected.amax().max(1.0);
    assert!((value - expected).amax() <= tolerance * scale, "{what}: {value} but {expected}");
}

fn reference(name: &str) -> String {
    let path = format!("{}/tests/reference/{name}", env!("CARGO_MANIFEST_DIR"));
    std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{path}: {e}"))
}

fn json(name: &str) -> Value {
    serde_json::from_str(&reference(name)).expect("the reference is JSON")
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is not a number"))
}

fn matrix(value: &Value) -> Mat3 {
    Mat3::from_fn(|i, j| number(&value[i][j]))
}

fn members(snapshot: &Snapshot) -> Members {
    let mut members = Members::new(Region::Whole);
    members.add(&snapshot.header, &snapshot.particles).expect("sound ids");
    members
}

/// Equal spheres on a lattice: `basis` in cells of these sides, three cells per side. `k` [N/m].
fn lattice(basis: &[Vec3], cell: Vec3, radius: f64, k: f64, box_offset: Option<f64>) -> Snapshot {
    let mut position = Vec::new();
    let first = box_offset.unwrap_or(0.0);
    for i in 0..27 {
        let corner = Vec3::new(f64::from(i % 3), f64::from(i / 3 % 3), f64::from(i / 9));
        position
            .extend(basis.iter().map(|b| (corner + b).component_mul(&cell) + Vec3::repeat(first)));
    }
    let side = match box_offset {
        None => cell * 3.0,
        Some(first) => cell * 2.0 + Vec3::repeat(2.0 * first),
    };
    let mut header =
        header(Vec3::zeros(), side, box_offset.is_none(), Vec3::repeat(radius), position.len());
    let mut contacts = ContactTable::default();
    for a in 0..position.len() {
        for b in a + 1..position.len() {
            let mut branch = position[b] - position[a];
            if box_offset.is_none() {
                branch = branch.zip_map(&side, |x, period| x - period * (x / period).round());
            }
            let (distance, overlap) = (branch.norm(), 2.0 * radius - branch.norm());
            // Contacts overlap by more than the rounding of the lattice.
            if overlap > 1e-9 {
                let pair = (a as u64, GlobalId(b as u64));
                push(&mut contacts, pair, position[a], branch, branch * 0.5);
                push_force(&mut contacts, branch / distance, overlap, k * overlap, Vec3::zeros());
            }
        }
    }
    if box_offset.is_some() {
        for axis in 0..3 {
            for up in [true, false] {
                let mut normal = Vec3::zeros();
                normal[axis] = if up { 1.0 } else { -1.0 };
                let point = if up { Vec3::zeros() } else { side };
                let wall = GlobalId::wall(header.walls.len());
                header.walls.push(WallRow {
                    name: format!("{axis} {up}"),
                    point,
                    normal,
                    velocity: Vec3::zeros(),
                    force: Vec3::zeros(),
                });
                for (a, centre) in position.iter().enumerate() {
                    let overlap = radius - (centre - point).dot(&normal);
                    if overlap > 1e-9 {
                        let arm = normal * (0.5 * overlap - radius);
                        push(&mut contacts, (a as u64, wall), *centre, arm, arm);
                        push_force(&mut contacts, -normal, overlap, k * overlap, Vec3::zeros());
                    }
                }
            }
        }
    }
    Snapshot { header, particles: particles_at(position), contacts }
}

fn lattice_of(case: &Value) -> Option<Snapshot> {
    let inputs = &case["inputs"];
    let half = |x, y, z| Vec3::new(x, y, z) * 0.5;
    let origin = Vec3::zeros();
    let basis = match case["name"].as_str()? {
        "BCC_periodic" => vec![origin, half(1.0, 1.0, 1.0)],
        "FCC_periodic" => {
            vec![origin, half(1.0, 1.0, 0.0), half(1.0, 0.0, 1.0), half(0.0, 1.0, 1.0)]
        }
        _ => vec![origin],
    };
    let radius = number(&inputs["R"]);
    Some(match case["name"].as_str()? {
        "SC_in_rigid_box" => lattice(
            &basis,
            Vec3::repeat(number(&inputs["spacing"])),
            radius,
            number(&inputs["k_particle"]),
            Some(number(&inputs["first_centre"])),
        ),
        "SC_periodic_anisotropic" => {
            let cell = Vec3::from_fn(|i, _| number(&inputs["spacing"][i]));
            lattice(&basis, cell, radius, number(&inputs["k"]), None)
        }
        _ => {
            let cell = Vec3::repeat(number(&inputs["cubic_cell"]));
            lattice(&basis, cell, radius, number(&inputs["k"]), None)
        }
    })
}

fn lattice_case(name: &str) -> (Value, Snapshot) {
    let all = json("dem_lattices.json");
    let cases = all["cases"].as_array().expect("a list");
    let case = cases.iter().find(|c| c["name"] == name).expect("the case").clone();
    let snapshot = lattice_of(&case).expect("a lattice");
    (case, snapshot)
}

/// The overlap of a lattice is a small difference of large numbers.
fn lattice_tolerance(case: &Value) -> f64 {
    let overlap = case["inputs"]["overlap"].as_f64().unwrap_or(1e-4);
    ROUNDING * 1e-4 / overlap * 10.0
}

#[test]
fn lattices_have_the_reference_stress_coordination_and_density() {
    let mut compared = 0;
    for case in json("dem_lattices.json")["cases"].as_array().expect("a list") {
        let name = &case["name"];
        if name == "SC_in_rigid_box" || name == "SC_periodic_anisotropic" {
            continue;
        }
        let tolerance = lattice_tolerance(case);
        let report = lattice_of(case).expect("a lattice").report();
        let s = &report.summary;
        assert_eq!(s.contacts_between_particles, number(&case["contacts"]), "{name}");
        assert_eq!(s.coordination, Some(number(&case["coordination"])), "{name}");
        assert_eq!(s.mechanical_coordination, s.coordination, "{name}");
        let p = number(&case["mean_stress_p"]);
        close(s.p_pa.unwrap(), p, tolerance, "p");
        close(s.q_pa.unwrap() / p, 0.0, tolerance, "q");
        let stress = report.stress_pa.unwrap();
        close_matrix(&(stress.tensor / p), &(matrix(&case["stress_tensor"]) / p), tolerance, "σ");
        close(s.solid_fraction.unwrap(), number(&case["solid_fraction"]), ROUNDING, "solid");
        close_matrix(&report.fabric.unwrap().tensor, &matrix(&case["fabric"]), ROUNDING, "Φ");
        close(s.a_c.unwrap(), 0.0, ROUNDING, "a_c");
        compared += 1;
    }
    assert_eq!(compared, 6);
}

#[test]
fn an_anisotropic_lattice_has_the_reference_deviator() {
    let (case, snapshot) = lattice_case("SC_periodic_anisotropic");
    let report = snapshot.report();
    let tolerance = lattice_tolerance(&case);
    let stress = report.stress_pa.unwrap();
    for k in 0..3 {
        close(stress.tensor[(k, k)], number(&case["stress_diag"][k]), tolerance, "σ");
    }
    close(stress.p(), number(&case["p"]), tolerance, "p");
    close(stress.q(), number(&case["q"]), tolerance, "q");
    close(stress.ratio().unwrap(), number(&case["q_over_p"]), tolerance, "q/p");
    let largest = stress.principal()[0];
    close(largest.value, number(&case["stress_diag"][2]), tolerance, "σ1");
    close(largest.direction.z, 1.0, ROUNDING, "its direction");
    // Six contacts per particle along the axes: isotropic fabric, anisotropic forces.
    close(report.summary.a_c.unwrap(), 0.0, ROUNDING, "a_c");
    assert!(report.summary.a_n.unwrap() > 0.0);
}

#[test]
fn a_rigid_box_tells_the_conventions_of_wall_contacts_apart() {
    let (case, snapshot) = lattice_case("SC_in_rigid_box");
    let tolerance = lattice_tolerance(&case);
    let report = snapshot.report();
    let s = &report.summary;
    close(s.height_m.unwrap(), number(&case["inputs"]["box_inner"]), ROUNDING, "height");
    let to_point = number(&case["christoffersen_with_wall_branch_to_mid_overlap"]);
    close(s.p_pa.unwrap(), to_point, tolerance, "branch to the contact point");
    assert_eq!(s.coordination, Some(number(&case["coordination_without_walls"])));
    assert_eq!(s.coordination_with_walls, Some(number(&case["coordination_with_walls"])));
    assert_eq!(s.contacts_between_particles, number(&case["contacts_particle"]));
    assert_eq!(s.contacts_with_walls as f64, number(&case["contacts_wall"]));

    let members = members(&snapshot);
    let stress_of = |contacts: &ContactTable| {
        let mut sum = StressSum::default();
        sum.add_contacts(contacts, &members).unwrap();
        sum.finish(s.volume_m3.unwrap()).p()
    };
    let mut to_plane = snapshot.contacts.clone();
    for row in 0..to_plane.a.len() {
        if to_plane.b[row].wall_index().is_some() {
            to_plane.branch[row] -= to_plane.normal[row] * (0.5 * to_plane.overlap[row]);
        }
    }
    let on_wall = number(&case["christoffersen_with_wall_branch_to_wall_plane"]);
    close(stress_of(&to_plane), on_wall, tolerance, "branch to the wall");
    for row in 0..to_plane.a.len() {
        if to_plane.b[row].wall_index().is_some() {
            to_plane.normal_force[row] = 0.0;
        }
    }
    let without = number(&case["christoffersen_without_wall_contacts"]);
    close(stress_of(&to_plane), without, tolerance, "no walls");
}

/// Contacts between two particles with these normals and forces.
fn contacts_with(normals: &[Vec3], forces: &[(f64, Vec3)]) -> (Members, ContactTable) {
    let header = header(Vec3::zeros(), Vec3::repeat(1.0), false, Vec3::repeat(0.1), 2);
    let mut members = Members::new(Region::Whole);
    let two = particles_at(vec![Vec3::zeros(), Vec3::repeat(0.2)]);
    members.add(&header, &two).unwrap();
    let mut contacts = ContactTable::default();
    for (normal, &(force, shear)) in normals.iter().zip(forces) {
        // Like the force, so that branches have its anisotropy.
        let branch = normal * force + shear;
        push(&mut contacts, (0, GlobalId(1)), Vec3::zeros(), branch, normal * 0.5);
        push_force(&mut contacts, *normal, 1e-3, force, shear);
    }
    (members, contacts)
}

#[test]
fn simple_fabrics_have_the_reference_anisotropy() {
    let diagonal = 0.5_f64.sqrt();
    let sets: [(&str, Vec<Vec3>); 5] = [
        ("uniaxial_column", vec![Vec3::z(), -Vec3::z()]),
        (
            "planar_isotropic",
            vec![
                Vec3::x(),
                Vec3::y(),
                Vec3::new(diagonal, diagonal, 0.0),
                Vec3::new(diagonal, -diagonal, 0.0),
            ],
        ),
        ("two_axes", vec![Vec3::x(), Vec3::z()]),
        ("isotropic", vec![Vec3::x(), Vec3::y(), -Vec3::z()]),
        ("single_normal_123", vec![Vec3::new(1.0, 2.0, 3.0) / 14.0_f64.sqrt()]),
    ];
    let all = json("dem_fabric.json");
    for (name, normals) in sets {
        let exact = all["exact"].as_array().unwrap().iter().find(|e| e["name"] == name).unwrap();
        let (members, contacts) =
            contacts_with(&normals, &vec![(1.0, Vec3::zeros()); normals.len()]);
        let mut sum = FabricSum::default();
        sum.add_contacts(&contacts, &members).unwrap();
        let fabric = sum.finish().expect("contacts");
        close_matrix(&fabric.tensor, &matrix(&exact["fabric"]), ROUNDING, name);
        close_matrix(&fabric.anisotropy(), &matrix(&exact["a"]), ROUNDING, name);
        close(degree(&fabric.anisotropy(), None), number(&exact["a_c"]), ROUNDING, name);
    }
}

#[test]
fn sampled_normals_and_forces_have_the_reference_anisotropies() {
    let text = reference("normals_synthetic.csv");
    let rows: Vec<(String, Vec<f64>)> = text
        .lines()
        .skip(1)
        .map(|line| {
            let mut cells = line.split(',');
            let set = cells.next().unwrap().to_string();
            (set, cells.map(|c| c.parse().unwrap()).collect())
        })
        .collect();
    let all = json("dem_fabric.json");
    let sets = all["synthetic"].as_array().unwrap();
    assert_eq!(sets.len(), 4);
    for set in sets {
        let name = set["name"].as_str().unwrap();
        let of_set: Vec<&Vec<f64>> =
            rows.iter().filter(|(s, _)| s == name).map(|(_, r)| r).collect();
        assert_eq!(of_set.len(), 500, "{name}");
        let normals: Vec<Vec3> = of_set.iter().map(|r| Vec3::new(r[0], r[1], r[2])).collect();
        let forces: Vec<(f64, Vec3)> =
            of_set.iter().map(|r| (r[3], Vec3::new(r[4], r[5], r[6]))).collect();
        let (members, contacts) = contacts_with(&normals, &forces);
        let mut sum = FabricSum::default();
        sum.add_contacts(&contacts, &members).unwrap();
        let fabric = sum.finish().unwrap();
        let a = fabric.anisotropy();
        close_matrix(&fabric.tensor, &matrix(&set["fabric_of_sample"]), ROUNDING, name);
        close_matrix(&a, &matrix(&set["a_of_sample"]), ROUNDING, name);
        close(degree(&a, None), number(&set["a_c_of_sample"]), ROUNDING, name);

        let mut sum = ForceFabricSum::new(Among::Particles, &fabric);
        sum.add_contacts(&contacts, &members).unwrap();
        let found = sum.finish().unwrap();
        let exact = &set["forces"];
        close(found.mean_force, matrix(&exact["sample_chi_n"]).trace(), ROUNDING, name);
        let (a_n, a_t) = (found.normal_anisotropy, found.shear_anisotropy);
        close_matrix(&a_n, &matrix(&exact["sample_a_n_tensor"]), ROUNDING, name);
        close_matrix(&a_t, &matrix(&exact["sample_a_t_tensor"]), ROUNDING, name);
        close(degree(&a_n, None), number(&exact["sample_a_n"]), ROUNDING, name);
        close(degree(&a_t, None), number(&exact["sample_a_t"]), ROUNDING, name);
        close_matrix(&found.branch_normal_anisotropy, &a_n, ROUNDING, name);
        close_matrix(&found.branch_shear_anisotropy, &a_t, ROUNDING, name);
    }
}

#[test]
fn the_sign_of_an_anisotropy_goes_with_the_stress() {
    let vertical = Mat3::from_diagonal(&Vec3::new(-0.1, -0.1, 0.2));
    let compressed = Stress { tensor: Mat3::from_diagonal(&Vec3::new(1.0, 1.0, 3.0)) };
    let extended = Stress { tensor: Mat3::from_diagonal(&Vec3::new(3.0, 3.0, 1.0)) };
    close(degree(&vertical, Some(&compressed)), 0.3, ROUNDING, "with");
    close(degree(&vertical, Some(&extended)), -0.3, ROUNDING, "against");
}

/// Some rows of a table, in this order.
fn some_particles(table: &ParticleTable, rows: &[usize]) -> ParticleTable {
    fn pick<T: Copy>(column: &[T], rows: &[usize]) -> Vec<T> {
        rows.iter().filter_map(|&r| column.get(r).copied()).collect()
    }
    ParticleTable {
        id: pick(&table.id, rows),
        shape: pick(&table.shape, rows),
        position: pick(&table.position, rows),
        velocity: pick(&table.velocity, rows),
        force: pick(&table.force, rows),
        coordination: pick(&table.coordination, rows),
        rank: pick(&table.rank, rows),
        dissipated: pick(&table.dissipated, rows),
        received: pick(&table.received, rows),
        image: pick(&table.image, rows),
        quaternion: pick(&table.quaternion, rows),
        angular_momentum: pick(&table.angular_momentum, rows),
        angular_velocity: pick(&table.angular_velocity, rows),
        torque: pick(&table.torque, rows),
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
        // As four ranks might have written them.
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
fn the_stress_of_regions_adds_up_to_the_whole() {
    let snapshot = ellipsoids(6, 2);
    let whole = snapshot.report();
    let bounds = whole.bounds_m.unwrap();
    let expected = whole.stress_pa.unwrap().tensor * bounds.volume();
    let cut = 0.37 * bounds.low.x + 0.63 * bounds.high.x;
    let (mut left, mut right) = (bounds, bounds);
    (left.high.x, right.low.x) = (cut, cut);
    let parts: Vec<Report> = [left, right]
        .iter()
        .map(|b| {
            let settings = Settings { region: Region::Box(*b), ..Settings::default() };
            snapshot.analyse(settings).unwrap().report
        })
        .collect();
    let sum = |i: usize, b: &Bounds| parts[i].stress_pa.unwrap().tensor * b.volume();
    let total = sum(0, &left) + sum(1, &right);
    assert!((total - expected).amax() <= ROUNDING * expected.amax(), "{total} but {expected}");
    // Counts too: half a contact on each side of the cut.
    let count = |f: &dyn Fn(&Report) -> f64| f(&parts[0]) + f(&parts[1]);
    assert_eq!(count(&|r| r.summary.particles as f64), whole.summary.particles as f64);
    assert_eq!(
        count(&|r| r.summary.contacts_between_particles),
        whole.summary.contacts_between_particles
    );
    assert_eq!(count(&|r| r.fabric.unwrap().contacts), whole.fabric.unwrap().contacts);
}

#[test]
fn half_arms_add_up_to_branches() {
    let snapshot = ellipsoids(5, 3);
    let contacts = &snapshot.contacts;
    // The definition, per particle: its force on the partner times the arm from its own centre.
    let mut by_particle = Mat3::zeros();
    for row in 0..contacts.a.len() {
        let force = contacts.force(row);
        let from_a = contacts.point[row] - contacts.centre[row];
        by_particle += force * from_a.transpose();
        if contacts.b[row].wall_index().is_none() {
            by_particle += -force * (from_a - contacts.branch[row]).transpose();
        }
    }
    let mut sum = StressSum::default();
    sum.add_contacts(contacts, &members(&snapshot)).unwrap();
    let by_branch = sum.sum();
    assert!((by_particle - by_branch).amax() <= ROUNDING * by_branch.amax());
}

#[test]
fn mechanical_coordination_leaves_out_rattlers() {
    // A triangle 0-1-2, a hanger-on 3 at 0, a loner 4 on the floor.
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
    assert_eq!(forces.shear_logarithmic.halves_below, 6, "three contacts without shear");
}

#[test]
fn histograms_put_values_on_edges_into_the_upper_bin() {
    let histogram = Histogram::logarithmic(1, -1, 1);
    assert_eq!(histogram.edges, [0.1, 1.0, 10.0]);
    assert_eq!(Histogram::linear(2, 1.0).edges, [0.0, 0.5, 1.0]);
}

#[test]
fn extents_of_turned_ellipsoids_are_exact() {
    let mut header = header(Vec3::zeros(), Vec3::repeat(9.0), false, Vec3::new(2.0, 1.0, 1.0), 1);
    let mut one = particles_at(vec![Vec3::new(5.0, 5.0, 5.0)]);
    // 45° about z: the half-width along x is √((4 + 1)/2).
    let half_turn: f64 = PI / 8.0;
    one.quaternion = vec![[half_turn.cos(), 0.0, 0.0, half_turn.sin()]];
    let mut extent = Extent::default();
    extent.add(&header, &one);
    let found = extent.finish(&header).unwrap();
    let half = 2.5_f64.sqrt();
    for (value, expected) in [
        (found.low.x, 5.0 - half),
        (found.high.y, 5.0 + half),
        (found.low.z, 4.0),
        (found.high.z, 6.0),
    ] {
        close(value, expected, ROUNDING, "side");
    }
    // A wall across an axis ends the box, the innermost counts; a period goes before both.
    for (z, up) in [(3.5, 1.0), (3.0, 1.0), (6.5, -1.0)] {
        header.walls.push(WallRow {
            name: format!("wall at {z}"),
            point: Vec3::z() * z,
            normal: Vec3::z() * up,
            velocity: Vec3::zeros(),
            force: Vec3::zeros(),
        });
    }
    header.cell = Cell::new(header.cell.low(), header.cell.high(), [true, false, false]);
    let found = extent.finish(&header).unwrap();
    assert_eq!((found.low.z, found.high.z), (3.5, 6.5));
    assert_eq!((found.low.x, found.high.x), (0.0, 9.0));
    assert_eq!(Extent::default().finish(&Header { walls: Vec::new(), ..header }), None);
}

/// One of each kind, about 1 m in size.
fn bodies() -> Vec<Shape> {
    let (long, short) = (Vec3::new(1.0, 0.7, 0.5), Vec3::new(0.6, 0.8, 0.9));
    let mut dice = Dice(ChaCha8Rng::seed_from_u64(11));
    let points: Vec<Vec3> = (0..40).map(|_| dice.direction().component_mul(&long)).collect();
    let mut bodies = vec![
        Shape::Sphere(Sphere { radius: 0.8 }),
        Shape::Ellipsoid(Ellipsoid { semi_axes: long }),
        Shape::Spherocylinder(Spherocylinder { length: 0.9, radius: 0.4 }),
        Shape::Polyhedron(Box::new(Polyhedron::new(&points).unwrap())),
        Shape::RoundedPolyhedron(Box::new(RoundedPolyhedron::new(&points, 0.2).unwrap())),
        Shape::RoundedPolyhedron(Box::new(RoundedPolyhedron::new(&box_of(&short), 0.3).unwrap())),
    ];
    for exponents in [[0.5, 0.5], [0.2, 1.0], [1.0, 1.0], [1.4, 0.7], [2.0, 2.0]] {
        bodies.push(Shape::Superellipsoid(Superellipsoid::new(long, exponents)));
        let octants = PolySuperellipsoid::new(long, short, exponents);
        bodies.push(Shape::PolySuperellipsoid(Box::new(octants)));
    }
    bodies
}

/// The corners of a box about the origin.
fn box_of(half: &Vec3) -> Vec<Vec3> {
    let sign = |set: bool| if set { 1.0 } else { -1.0 };
    let corner = |k: u32| Vec3::new(sign(k & 1 > 0), sign(k & 2 > 0), sign(k & 4 > 0));
    (0..8).map(|k| corner(k).component_mul(half)).collect()
}

fn snapshot_of(shape: &Shape, quaternion: [f64; 4], side: f64) -> (Header, ParticleTable) {
    let mut header = header(Vec3::repeat(-side), Vec3::repeat(side), false, shape.semi_axes(), 1);
    header.shapes[0].geometry = Some(shape.clone());
    let particles = particles_at(vec![Vec3::zeros()]);
    (header, ParticleTable { quaternion: vec![quaternion], ..particles })
}

#[test]
fn bodies_contain_what_is_below_their_surface() {
    let mut dice = Dice(ChaCha8Rng::seed_from_u64(12));
    for body in bodies() {
        for _ in 0..500 {
            let direction = dice.direction();
            let end = body.support(&direction);
            assert!(body.contains(&(end * (1.0 - 1e-9))), "{direction} {body:?}");
            assert!(!body.contains(&(end + direction * 1e-9)), "{direction} {body:?}");
        }
    }
}

/// The volume within a region against closed forms: of a whole body, and of the half of one that a plane through its
/// centre cuts.
#[test]
fn volumes_of_bodies_in_a_region() {
    let mut dice = Dice(ChaCha8Rng::seed_from_u64(13));
    let side = 1.7;
    let whole = Bounds { low: Vec3::repeat(-side), high: Vec3::repeat(side) };
    let half = Bounds { low: Vec3::new(0.0, -side, -side), high: Vec3::repeat(side) };
    let (mut largest, mut halves) = (0.0_f64, 0);
    for body in bodies() {
        let turn = dice.direction() * dice.unit();
        let attitude = [(1.0 - turn.norm_squared()).sqrt(), turn.x, turn.y, turn.z];
        let (header, particles) = snapshot_of(&body, attitude, side);
        let mut check = |bounds: Bounds, expected: f64| {
            let mut sampled = SampledSolid::new(bounds);
            sampled.add(&header, &particles);
            let error = sampled.finish() * bounds.volume() / expected - 1.0;
            largest = largest.max(error.abs());
            assert!(error.abs() < 3e-4, "{error:e} {body:?}");
        };
        check(whole, body.volume());
        if matches!(
            body.kind(),
            Kind::Sphere | Kind::Ellipsoid | Kind::Superellipsoid | Kind::Spherocylinder
        ) {
            check(half, 0.5 * body.volume());
            halves += 1;
        }
    }
    assert_eq!(halves, 8);
    println!("largest relative error of a body's volume: {largest:.1e}");
    // A box cut by planes across its edges: between them is the rest of one edge times the face.
    let half = Vec3::new(1.0, 0.5, 0.25);
    let body = Shape::Polyhedron(Box::new(Polyhedron::new(&box_of(&half)).unwrap()));
    let axis = (0..3).find(|&k| (body.half_lengths()[k] - 1.0).abs() < 1e-12).unwrap();
    let (header, particles) = snapshot_of(&body, [1.0, 0.0, 0.0, 0.0], side);
    let mut bounds = whole;
    bounds.low[axis] = 0.3;
    let mut sampled = SampledSolid::new(bounds);
    sampled.add(&header, &particles);
    let error = sampled.finish() * bounds.volume() / (0.7 * 1.0 * 0.5) - 1.0;
    // Up to half a cell at each of five faces.
    let cells = bounds.lengths() / 256.0;
    let share = Vec3::from_fn(|k, _| {
        let faces = if k == axis { 0.5 } else { 1.0 };
        faces * cells[k] / if k == axis { 0.7 } else { 2.0 * body.half_lengths()[k] }
    });
    assert!(error.abs() <= share.sum(), "{error:e} of {share}");
}

#[test]
fn extents_of_turned_solids_are_exact() {
    let body = Shape::Polyhedron(Box::new(Polyhedron::new(&box_of(&Vec3::repeat(1.0))).unwrap()));
    let half_turn: f64 = PI / 8.0;
    let attitude = [half_turn.cos(), 0.0, half_turn.sin(), 0.0];
    let (header, particles) = snapshot_of(&body, attitude, 2.0);
    let mut extent = Extent::default();
    extent.add(&header, &particles);
    let found = extent.finish(&header).unwrap();
    let half = Vec3::new(2.0_f64.sqrt(), 1.0, 2.0_f64.sqrt());
    assert!((found.high - half).amax() < ROUNDING && (found.low + half).amax() < ROUNDING);
    // And its silhouette is a square that stands on a corner.
    let snapshot = Snapshot { header, particles, contacts: ContactTable::default() };
    let svg = snapshot.analyse(Settings::default()).unwrap().picture.svg(None);
    let path = r#"d="M732 372l-360 -360 -360 360 360 360z""#;
    assert!(svg.contains(path), "{svg}");
}

/// Each corner of a drawn silhouette is on it, and no part of it is farther out than a hundredth of the size.
#[test]
fn silhouettes_are_those_of_the_bodies() {
    let mut dice = Dice(ChaCha8Rng::seed_from_u64(14));
    let frame = Bounds { low: Vec3::repeat(-2.0), high: Vec3::repeat(2.0) };
    // Pixels per metre, and where the centre is.
    let (scale, middle) = (180.0, 372.0);
    let mut corners = 0;
    let mut drawn = 0;
    for body in bodies() {
        let turn = dice.direction() * dice.unit();
        let attitude = [(1.0 - turn.norm_squared()).sqrt(), turn.x, turn.y, turn.z];
        let (header, particles) = snapshot_of(&body, attitude, 1.0);
        let snapshot = Snapshot { header, particles, contacts: ContactTable::default() };
        let svg = snapshot.analyse(Settings::default()).unwrap().picture.svg(Some(&frame));
        let ellipses = svg.matches("<ellipse").count();
        assert_eq!(ellipses, usize::from(body.kind().is_ellipsoidal()), "{body:?}");
        let Some((_, path)) = svg.split_once(r#"d="M"#) else { continue };
        let (path, _) = path.split_once('z').unwrap();
        let numbers: Vec<f64> = path.split([' ', 'l']).map(|n| n.parse().unwrap()).collect();
        let mut outline: Vec<[f64; 2]> = Vec::new();
        for step in numbers.chunks(2) {
            let [x, y] = *outline.last().unwrap_or(&[0.0; 2]);
            outline.push([x + step[0], y + step[1]]);
        }
        let [w, x, y, z] = attitude;
        let turn = Quat::from_quaternion(Quaternion::new(w, x, y, z)).to_rotation_matrix();
        let support = |x: f64, z: f64| {
            let direction = Vec3::new(x, 0.0, z);
            (turn * body.support(&turn.inverse_transform_vector(&direction))).dot(&direction)
        };
        let least = scale * 0.01 * body.bounding_radius();
        for angle in (0..720).map(|k| f64::from(k) * PI / 360.0) {
            let (x, z) = (angle.cos(), angle.sin());
            let along = outline.iter().map(|[px, py]| (px - middle) * x - (py - middle) * z);
            let missing = scale * support(x, z) - along.fold(f64::NEG_INFINITY, f64::max);
            // Corners are drawn to tenths of pixels.
            assert!((-0.1..least + 0.1).contains(&missing), "{missing} px of {least} {body:?}");
        }
        corners += outline.len();
        drawn += 1;
    }
    println!("{} corners on average", corners / drawn);
}

#[test]
fn sampled_solid_fraction_of_a_periodic_lattice() {
    let (case, snapshot) = lattice_case("SC_periodic");
    // The whole period, moved by nothing: images must be counted.
    let bounds = Bounds { low: snapshot.header.cell.low(), high: snapshot.header.cell.high() };
    let mut sampled = SampledSolid::new(bounds);
    sampled.add(&snapshot.header, &snapshot.particles);
    // Sampling error, and the lenses of overlap which the exact sum counts twice.
    close(sampled.finish(), number(&case["solid_fraction"]), 5e-4, "solid fraction");
    let settings = Settings { region: Region::Box(bounds), ..Settings::default() };
    let report = snapshot.analyse(settings).unwrap().report;
    assert_eq!(report.summary.particles, 27);
    close(report.summary.p_pa.unwrap(), number(&case["mean_stress_p"]), 1e-11, "p of the box");
}

#[test]
fn strains_are_logarithmic_and_positive_in_compression() {
    let first = Bounds { low: Vec3::zeros(), high: Vec3::new(1.0, 1.0, 2.0) };
    let now = Bounds { low: Vec3::zeros(), high: Vec3::new(1.1, 1.1, 1.8) };
    let strain = Strain::between(&first, &now).unwrap();
    close(strain.axial, (2.0_f64 / 1.8).ln(), ROUNDING, "axial");
    close(strain.volumetric, (2.0_f64 / (1.21 * 1.8)).ln(), ROUNDING, "volumetric");
    assert!(strain.axial > 0.0 && strain.volumetric < 0.0, "shorter, and dilated");
}

#[test]
fn roses_of_a_known_density() {
    // An isotropic set and its mean: every bin near one, and their weighted mean exactly one.
    let mut dice = Dice(ChaCha8Rng::seed_from_u64(4));
    let normals: Vec<Vec3> = (0..40_000).map(|_| dice.direction()).collect();
    let a = Mat3::from_diagonal(&Vec3::new(-0.2, -0.2, 0.4));
    let forces: Vec<(f64, Vec3)> = normals
        .iter()
        .map(|n| {
            let an = n.dot(&(a * n));
            (2.0 * (1.0 + an), (a * n - n * an) * 2.0)
        })
        .collect();
    let (_, contacts) = contacts_with(&normals, &forces);
    let header = header(Vec3::zeros(), Vec3::repeat(1.0), false, Vec3::repeat(0.1), 2);
    let particles = particles_at(vec![Vec3::zeros(), Vec3::repeat(0.2)]);
    let rose = Snapshot { header, particles, contacts }.report().rose;
    for (k, ((density, normal), shear)) in
        rose.density.iter().zip(&rose.normal_force).zip(&rose.shear_force).enumerate()
    {
        // The mean of a fit over the bin's ring of the sphere.
        let mean = |fit: &dyn Fn(f64) -> f64| {
            let angles = (0..100).map(|i| (k as f64 + (f64::from(i) + 0.5) / 100.0) * Rose::STEP);
            let (sum, weight) = angles.fold((0.0, 0.0), |(sum, weight), angle| {
                (sum + fit(angle) * angle.sin(), weight + angle.sin())
            });
            sum / weight
        };
        // 600 contacts in the smallest bin: four standard errors.
        close(density.unwrap(), 1.0, 0.16, "density");
        let (normal, shear) = (normal.unwrap() / 2.0, shear.unwrap() / 2.0);
        close(normal, mean(&|angle| Rose::normal_fit(&a, angle)), 3e-3, "normal force");
        close(shear, mean(&|angle| Rose::shear_fit(&a, angle)), 3e-3, "shear force");
    }
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
    assert!(says(&broken).contains("particle 0 stands twice"));
    let mut broken = sound.clone();
    broken.header.next_id = 20;
    assert!(says(&broken).contains("never given"));
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

#[test]
fn a_diff_finds_what_was_planted() {
    let first = ellipsoids(3, 6);
    let rows: Vec<usize> = (0..27).rev().collect();
    let mut second = first.clone();
    second.particles = some_particles(&first.particles, &rows);
    second.particles.rank = vec![3; 27];
    let compare = |a: &Snapshot, b: &Snapshot| {
        let state = |s: &Snapshot| State {
            header: s.header.clone(),
            particles: s.particles.clone(),
            histories: Histories::default(),
        };
        Difference::between(&state(a), &state(b))
    };
    let equal = compare(&first, &second);
    assert!(equal.is_empty(), "order and owner are not state: {equal}");
    assert_eq!(equal.compared, 27);
    assert!(equal.to_string().starts_with("equal bit for bit"));

    let mut rains = [70, 80].map(|fallen| {
        let fallen = Values::Counts(vec![fallen]);
        let columns = vec![SavedColumn::new(StateColumn::new("fallen", 1, "1"), fallen)];
        let mut rains = first.clone();
        rains.header.drives = vec![SavedState { drive: "rain".into(), columns }];
        rains
    });
    assert_eq!(compare(&rains[0], &rains[1]).header, ["rain, fallen: [70] and [80]"]);
    assert_eq!(compare(&first, &rains[1]).header, ["rain, fallen: nothing and [80]"]);
    rains[0].header.drives[0].drive = "snow".into();
    let names = ["rain, fallen: [80] and nothing", "snow, fallen: nothing and [70]"];
    assert_eq!(compare(&rains[1], &rains[0]).header, names);

    let z = &mut second.particles.position[0].z; // id 26, in its last place
    *z = f64::from_bits(z.to_bits() + 1);
    second.particles.velocity[0].x = 0.5;
    second.particles.velocity[20].x = -0.25; // id 6
    second.particles.velocity[20].y = -0.0;
    second.header.time = 0.02;
    let found = compare(&first, &second);
    assert!(!found.is_empty());
    assert_eq!((found.differing, found.compared), (2, 27));
    assert_eq!(found.columns["velocity"].rows, 2);
    assert_eq!(found.columns["velocity"].largest, 0.5);
    assert_eq!(found.columns["position"].rows, 1);
    let named: Vec<(u64, &str)> = found.first.iter().map(|d| (d.id.0, d.column.as_str())).collect();
    let expected = [(6, "velocity.x"), (6, "velocity.y"), (26, "position.z"), (26, "velocity.x")];
    assert_eq!(named, expected);
    assert_eq!(found.header.len(), 1);

    let rows: Vec<usize> = (0..20).collect();
    let mut fewer = first.clone();
    fewer.particles = some_particles(&first.particles, &rows);
    fewer.particles.quaternion.clear();
    let found = compare(&first, &fewer);
    assert_eq!(found.only_first.len(), 7);
    assert!(found.only_second.is_empty());
    assert_eq!(found.only_one_column, ["quaternion"]);
    assert!(found.to_string().contains("7 particles only in the first: 20, 21"));
}

#[test]
fn history_columns_are_read_whatever_they_are() {
    let text = "step,time_s,kinetic_energy_j,note,overlap_m\n0,0,1,start,\n10,0.1,0.5,,2e-6\n20,0.2,0.25,,2e-6\n";
    let history = History::read(text.as_bytes()).unwrap();
    let names: Vec<&str> = history.curves.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["kinetic_energy_j", "overlap_m"], "no step, no words");
    assert_eq!(history.curves[0].points, [(0.0, 1.0), (0.1, 0.5), (0.2, 0.25)]);
    let changing: Vec<bool> = history.curves.iter().map(Curve::changes).collect();
    assert_eq!(changing, [true, false], "the overlap is constant");
    let error = History::read("a,b\n1,2\n".as_bytes()).unwrap_err().to_string();
    assert!(error.contains("a, b"), "{error}");

    let mut long = history.curves[0].clone();
    long.points = (0..100_000).map(|i| (f64::from(i), f64::from(i % 7))).collect();
    long.points[54_321].1 = 99.0;
    let thin = long.thinned(1000);
    assert!(thin.len() <= 1100 && thin.contains(&(54_321.0, 99.0)));
    assert_eq!((thin[0], *thin.last().unwrap()), (long.points[0], long.points[99_999]));
}

#[test]
fn lammps_dump_has_diameters_and_the_real_part_last() {
    let mut snapshot = ellipsoids(2, 7);
    snapshot.particles.quaternion[0] = [0.5, -0.5, 0.25, 0.125];
    snapshot.particles.position[0] = Vec3::new(0.1, 0.2, 0.3);
    let mut out = Vec::new();
    lammps::write_header(&mut out, &snapshot.header, 8).unwrap();
    lammps::write_particles(&mut out, &snapshot.header, &snapshot.particles).unwrap();
    let text = String::from_utf8(out).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(
        lines[..5],
        ["ITEM: TIMESTEP", "1000", "ITEM: NUMBER OF ATOMS", "8", "ITEM: BOX BOUNDS ff ff ff"]
    );
    assert_eq!(lines.len(), 9 + 8);
    let first =
        "0 1 1e-1 2e-1 3e-1 -5e-1 2.5e-1 1.25e-1 5e-1 4.7622e-3 2.3811e-3 2.3811e-3 0e0 0e0 0e0";
    assert_eq!(lines[9], first);
}

/// Every plot and the page of a snapshot.
fn drawn(snapshot: &Snapshot, history: &str) -> Vec<(String, String)> {
    let analysis = snapshot.analyse(Settings::default()).unwrap();
    let mut later = analysis.report.clone();
    later.strain_against(&analysis.report);
    let picture = analysis.picture.svg(analysis.report.bounds_m.as_ref());
    let reports = [analysis.report, later];
    let history = History::read(history.as_bytes()).unwrap();
    let plots = page::plots(&reports, picture, &history, &snapshot.header.walls, &[]).unwrap();
    let mut drawings: Vec<_> = plots.iter().map(|p| (p.name.clone(), p.svg.clone())).collect();
    drawings.push(("page".into(), page::page("a <title>", &reports, &plots)));
    drawings
}

#[test]
fn plots_are_finite_for_empty_tiny_and_usual_snapshots() {
    let nothing = Snapshot {
        header: header(Vec3::zeros(), Vec3::repeat(1.0), false, Vec3::repeat(0.1), 0),
        particles: ParticleTable::default(),
        contacts: ContactTable::default(),
    };
    let (_, contacts) = contacts_with(&[Vec3::z()], &[(0.0, Vec3::zeros())]);
    let two = particles_at(vec![Vec3::zeros(), Vec3::repeat(0.2)]);
    let one_contact = Snapshot {
        header: header(Vec3::zeros(), Vec3::repeat(1.0), false, Vec3::repeat(0.1), 2),
        particles: two,
        contacts,
    };
    let mut with_force = one_contact.clone();
    with_force.contacts.normal_force[0] = 1.0;
    let usual = ellipsoids(5, 8);
    let flat = "time,energy\n0,0\n1,0\n";
    let steep = "time,energy\n0,1e9\n1,1e-3\n2,1e-12\n";
    let odd = "time,kinetic_J,missing_J,largest_overlap,top_m,other\n\
               0,0,-1e-17,0,-inf,1e300\n1,1,0,-1,NaN,-1e300\n2,1e-320,1e-3,0,0.1,inf\n3,1e300,-2,0,0.2,1\n";
    for (name, snapshot) in
        [("nothing", &nothing), ("one", &one_contact), ("force", &with_force), ("usual", &usual)]
    {
        for history in [flat, steep, odd] {
            for (plot, svg) in drawn(snapshot, history) {
                for bad in ["NaN", "nan\"", "inf\"", "Infinity", "-inf"] {
                    assert!(!svg.contains(bad), "{name}: {plot} holds {bad}");
                }
                // plotters would saturate a coordinate that is not finite.
                assert!(
                    !svg.contains("2147483647") && !svg.contains("-2147483648"),
                    "{name}: {plot}"
                );
            }
        }
    }
    let (_, page) = drawn(&usual, steep).pop().unwrap();
    assert!(page.contains("<title>a &lt;title&gt;</title>"));
    assert!(!page.contains("<script") && !page.contains("href="));
}

#[test]
fn columns_that_belong_together_share_a_panel() {
    let walls = ["-x", "lid"].map(|name| WallRow {
        name: name.into(),
        point: Vec3::zeros(),
        normal: Vec3::new(0.6, 0.0, -0.8),
        velocity: Vec3::zeros(),
        force: Vec3::zeros(),
    });
    let table = "time_s,particles,contacts,kinetic_J,translation_J,gravity_J,missing_J,\
                 force_-x_x_N,force_-x_y_N,force_-x_z_N,force_+x_x_N,force_-x_x-N,still\n\
                 0,1,0,0,0,1,0,0,0,0,0,0,3\n1,2,1,0.5,0.5,0,-1e-9,-3,5,4,1,1,3\n";
    let history = History::read(table.as_bytes()).unwrap();
    let names = |walls: &[WallRow]| -> Vec<String> {
        let plots = panels::panels(&history, walls, &[]).unwrap();
        plots.into_iter().map(|plot| plot.name.replace("history_", "")).collect()
    };
    let unknown = ["force_plus_x_x_n", "force_minus_x_x_n"];
    let (plus, minus) = (unknown[0], unknown[1]);
    assert_eq!(names(&walls), ["counts", "energy", "wall_loads", plus, minus]);
    let twice = format!("{minus}_2");
    let components = [minus, "force_minus_x_y_n", "force_minus_x_z_n"];
    let alone = [&["counts", "energy"][..], &components, &[plus, &twice]].concat();
    assert_eq!(names(&[]), alone, "without walls each component stands alone");
    let plots = panels::panels(&history, &walls, &[]).unwrap();
    // -(-3 · 0.6 + 4 · (-0.8)) = 5 N
    assert!(plots[2].svg.contains("-x") && !plots[2].svg.contains("lid"));
    assert!(plots[2].svg.contains(">\n5\n<"), "{}", plots[2].svg);
}

/// Stresses on walls share a panel, with a level line at each target.
#[test]
fn targets_of_servos_are_drawn() {
    let walls = ["-x", "+x", "lid"].map(|name| WallRow {
        name: name.into(),
        point: Vec3::zeros(),
        normal: Vec3::x(),
        velocity: Vec3::zeros(),
        force: Vec3::zeros(),
    });
    let walls_with_servo = ["-x", "+x", "gone"].map(str::to_owned).to_vec();
    let wall = StateColumn::new("wall", 1, "");
    let stresses = StateColumn::new("target", 1, "Pa");
    let columns = vec![
        SavedColumn::new(wall, Values::Texts(walls_with_servo)),
        SavedColumn::new(stresses, Values::Reals(vec![750.0, 750.0, 5e3])),
    ];
    let targets = servo::targets(&[SavedState { drive: "servos".into(), columns }]);
    assert_eq!(targets.len(), 3);
    let table = "time_s,stress_-x_Pa,stress_+x_Pa,stress_lid_Pa\n0,1,2,3\n1,640,650,900\n";
    let history = History::read(table.as_bytes()).unwrap();
    let plots = panels::panels(&history, &walls, &targets).unwrap();
    assert_eq!(plots.len(), 1);
    assert_eq!(plots[0].name, "history_wall_stresses");
    assert_eq!(plots[0].svg.matches("target 750 Pa").count(), 1);
    assert!(plots[0].svg.contains("lid") && !plots[0].svg.contains("target 5000 Pa"));
    // Three curves, and one line that is level.
    let polylines = plots[0].svg.split("<polyline").skip(1);
    let points = polylines.filter_map(|text| {
        let (_, points) = text.split_once("points=\"")?;
        let ends = points.split_once('"')?.0.split_whitespace().map(|end| end.split_once(','));
        ends.collect::<Option<Vec<_>>>()
    });
    let curves: Vec<_> = points.filter(|ends| ends.len() == 2 && ends[0].0 != ends[1].0).collect();
    assert!(curves.iter().any(|ends| ends[0].1 == ends[1].1), "{}", plots[0].svg);
    let without = panels::panels(&history, &walls, &[]).unwrap();
    assert!(!without[0].svg.contains("target"));
}

/// Ellipsoids thrown onto the floor of a closed box.
const FALLING: &str = r#"
title = "falling"
gravity = [0.0, 0.0, -9.81]
[domain]
low = [0.0, 0.0, 0.0]
high = [0.02, 0.02, 0.02]
walls = ["-x", "+x", "-y", "+y", "-z", "+z"]
[[material]]
name = "grain"
density = 265000.0
normal_stiffness = 1.5e5
friction = 0.3
restitution = 0.5
[[shape]]
name = "long"
kind = "ellipsoid"
diameter = 0.003
aspect_ratio = 2.0
[[fill.lattice]]
shapes = ["long"]
low = [0.0, 0.0, 0.0]
high = [0.02, 0.02, 0.02]
spacing = 0.0049
velocity = [0.5, 0.3, -3.0]
[time]
step = 1e-5
steps = 300
[output]
directory = "out"
"#;

/// Runs [`FALLING`], and leaves a snapshot of its end and its history in `directory`.
fn fall(directory: &Path, comm: &mut dyn Comm) {
    let scene = scene(FALLING);
    let mut sim = begun(&scene, comm);
    let (walls, cell) = (sim.particles.walls.clone(), sim.domain.cell);
    let mut history = comm
        .is_root()
        .then(|| table::History::open(directory, &walls, cell, |_| false).expect("a new table"));
    for _ in 0..scene.steps {
        sim.step(comm).expect("the step is done");
        let measures = sim.measure(comm);
        if let Some(history) = &mut history {
            history
                .push(sim.step, sim.time(), &measures, &measures.wall_forces, &sim.particles.walls)
                .expect("a row");
        }
    }
    let header = sim.header("", &sim.measure(comm).wall_forces, comm);
    let (particles, contacts) = (sim.particle_table(comm.rank()), sim.contact_table());
    snapshot::write(directory, &header, &particles, &contacts, &sim.histories(), comm)
        .expect("a snapshot");
}

#[test]
fn a_run_s_files_give_its_numbers_and_its_page_whoever_wrote_them() {
    let (one, three) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    fall(one.path(), &mut Alone::default());
    threads::run(3, |comm| fall(three.path(), comm));
    let reader = Reader::open(one.path()).unwrap();
    let analysis = analyse(&reader, "falling", Settings::default()).unwrap();
    let report = analysis.report;
    let s = &report.summary;

    let header = reader.header();
    let particles = reader.particles(0..reader.particle_count()).unwrap();
    let contacts = reader.contacts(0..reader.contact_count().unwrap()).unwrap();
    assert_eq!((s.step, s.particles), (300, 64));
    let with_walls = contacts.b.iter().filter(|b| b.wall_index().is_some()).count();
    let between = contacts.b.len() - with_walls;
    assert!(between > 20 && with_walls > 10, "{between} contacts, {with_walls} with walls");
    assert_eq!(s.contacts_between_particles, between as f64);
    assert_eq!(s.contacts_with_walls, with_walls as u64);
    assert_eq!(s.coordination, Some(2.0 * between as f64 / 64.0));
    let ends: i32 = particles.coordination.iter().sum();
    assert_eq!(s.coordination_with_walls, Some(f64::from(ends) / 64.0));

    let volume = (header.cell.high() - header.cell.low()).product();
    close(s.volume_m3.unwrap() / volume, 1.0, ROUNDING, "volume");
    let solid = 64.0 * header.shapes[0].volume / volume;
    close(s.solid_fraction.unwrap(), solid, ROUNDING, "solid fraction");
    let rows = 0..contacts.a.len();
    let products = rows.map(|row| contacts.force(row) * contacts.branch[row].transpose());
    let stress = products.fold(Mat3::zeros(), |sum, product| sum + product) / volume;
    close_matrix(&report.stress_pa.unwrap().tensor, &stress, ROUNDING, "stress");
    let forces = contacts.normal_force.iter().zip(&contacts.b);
    let pair_forces = forces.filter(|(_, b)| b.wall_index().is_none()).map(|(force, _)| force);
    let mean_force = pair_forces.sum::<f64>() / between as f64;
    close(s.mean_normal_force_n.unwrap() / mean_force, 1.0, ROUNDING, "mean normal force");

    let of_three = Reader::open(three.path()).unwrap();
    let other = analyse(&of_three, "falling", Settings::default()).unwrap();
    let text = |report: &Report| serde_json::to_string(report).unwrap();
    assert_eq!(text(&report), text(&other.report));
    let picture = analysis.picture.svg(report.bounds_m.as_ref());
    assert_eq!(picture, other.picture.svg(report.bounds_m.as_ref()));

    let history = |place: &Path| History::read(File::open(place.join("history.csv")).unwrap());
    let run = history(one.path()).unwrap();
    assert_eq!(run, history(three.path()).unwrap());
    let targets = servo::targets(&header.drives);
    let plots = page::plots(&[report], picture, &run, &header.walls, &targets).unwrap();
    let names: Vec<&str> = plots.iter().map(|plot| plot.name.as_str()).collect();
    let of_snapshot =
        ["packing", "roses", "coordination", "force_distribution", "weak_forces", "friction"];
    let of_run = [
        "counts",
        "coordination",
        "energy",
        "largest_overlap",
        "mean_normal_force",
        "largest_speed",
        "top",
        "unbalanced",
        "wall_loads",
    ]
    .map(|name| format!("history_{name}"));
    let expected = of_snapshot.into_iter().chain(of_run.iter().map(String::as_str));
    assert_eq!(names, expected.collect::<Vec<_>>());
    let page = page::page("falling", &[other.report], &plots);
    for plot in &plots {
        assert!(page.contains(&format!("<h2>{}</h2>", plot.title)), "{}", plot.name);
    }
    assert!(plots.last().unwrap().svg.contains("+z"), "walls stand in the legend");
}

#[test]
fn the_table_has_one_row_per_snapshot_and_names_units() {
    let report = ellipsoids(3, 9).report();
    let mut table = csv::Writer::from_writer(Vec::new());
    table.serialize(&report.summary).unwrap();
    table.serialize(&report.summary).unwrap();
    let text = String::from_utf8(table.into_inner().unwrap()).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), 3);
    for key in ["time_s", "p_pa", "q_over_p", "height_m", "mean_normal_force_n", "a_c"] {
        assert!(lines[0].split(',').any(|k| k == key), "{key}");
    }
    // As many digits as give the same bits back.
    let text = serde_json::to_string(&report).unwrap();
    let p = text.split("\"p_pa\":").nth(1).and_then(|t| t.split(',').next()).unwrap();
    assert_eq!(p.parse::<f64>().ok(), report.summary.p_pa);
    // Tensors by rows.
    let rows = &serde_json::from_str::<Value>(&text).unwrap()["stress_pa"];
    close(number(&rows[0][2]), report.summary.stress_xz_pa.unwrap(), ROUNDING, "σ_xz");
}

#[test]
fn wrong_arguments_end_in_one_message_and_status_2() {
    let directory = tempfile::tempdir().unwrap();
    let empty = directory.path().to_str().unwrap();
    for (arguments, expected) in [
        (vec!["no/such/file.vtkhdf"], "no snapshot no/such/file.vtkhdf"),
        (vec![empty], "holds no snapshot"),
        (vec!["out/contacts_000000001.vtkhdf"], "only contact files"),
        (vec!["--diff", "Cargo.toml"], "--diff takes two snapshots, not 1"),
        (vec!["Cargo.toml", "--region", "0,1,0"], "six numbers"),
        (vec!["Cargo.toml", "--region", "0,1,0,1,0,high"], "'high'"),
        (vec![], "<SNAPSHOT>"),
        (vec![empty, "--series"], "holds no snapshot"),
        (vec!["Cargo.toml", "--margin", "wide"], "grain diameters"),
    ] {
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_dem-post"))
            .args(&arguments)
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .output()
            .unwrap();
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
        assert!(message.contains(expected), "{arguments:?}: {message}");
        assert!(!message.contains("panicked"), "{message}");
    }
}

fn ended(command: &mut Command) -> (Option<i32>, String) {
    let output = command.output().expect("the program can be started");
    (output.status.code(), String::from_utf8(output.stderr).expect("text"))
}

#[test]
fn two_snapshots_of_one_step_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let runs = ["one", "two"].map(|name| folder.path().join(name));
    for run in &runs {
        store(run, &ellipsoids(2, 7));
    }
    let dem_post = || Command::new(env!("CARGO_BIN_EXE_dem-post"));
    let (status, message) = ended(dem_post().args(&runs));
    assert_eq!(status, Some(2), "{message}");
    assert_eq!(message.lines().count(), 1, "{message}");
    for text in ["one/particles_000001000", "two/particles_000001000", "of step 1000", "--diff"] {
        assert!(message.contains(text), "{message}");
    }
    assert!(!runs[1].join("post").exists(), "nothing is written");
    // One file named twice is one snapshot.
    let (status, message) = ended(dem_post().args([&runs[0], &runs[0]]));
    assert_eq!(status, Some(0), "{message}");
}

#[test]
fn a_series_may_be_longer_than_a_process_may_open_files() {
    let folder = tempfile::tempdir().unwrap();
    let mut snapshot = ellipsoids(2, 7);
    for step in 0..30 {
        snapshot.header.step = step;
        store(folder.path(), &snapshot);
    }
    let limited = ["-c", r#"ulimit -n 28; exec "$0" "$@""#, env!("CARGO_BIN_EXE_dem-post")];
    let mut dem_post = Command::new("sh");
    dem_post.args(limited).arg(folder.path()).args(["--series", "--lammps"]);
    let (status, message) = ended(&mut dem_post);
    assert_eq!(status, Some(0), "{message}");
    let written = folder.path().join("post");
    let table = std::fs::read_to_string(written.join("report.csv")).unwrap();
    assert_eq!(table.lines().count(), 31);
    let dumps = written
        .read_dir()
        .unwrap()
        .flatten()
        .filter(|entry| entry.path().extension().is_some_and(|extension| extension == "dump"));
    assert_eq!(dumps.count(), 30);
}

/// Where no wall and no period ends a packing, a grain that is thrown up is no strain.
#[test]
fn an_open_packing_has_no_strain() {
    let both = |first: &Snapshot, now: &Snapshot| {
        let reports = [first, now].map(|snapshot| {
            let mut report = snapshot.report();
            report.strain_against(&first.report());
            report
        });
        let s = &reports[1].summary;
        (
            (s.axial_strain.is_some(), s.volumetric_strain.is_some()),
            plots::series(&reports).unwrap(),
        )
    };
    let open = ellipsoids(3, 9);
    let mut thrown = open.clone();
    thrown.particles.position[26].z += 0.01;
    let (strained, drawn) = both(&open, &thrown);
    assert_eq!(strained, (false, false));
    assert!(drawn.iter().all(|plot| plot.caption.ends_with("against time.")));
    assert!(drawn.iter().all(|plot| plot.name != "volumetric_strain"));

    let (high, low) = (closed(0.02), closed(0.019));
    let (strained, drawn) = both(&high, &low);
    assert_eq!(strained, (true, true));
    assert!(drawn.iter().all(|plot| plot.caption.ends_with("against axial strain.")));
    assert_eq!(both(&open, &low).0, (false, false), "the first has no lid");
    assert_eq!(both(&high, &open).0, (false, false), "the second has none");

    // Between a floor and a lid, first without sides, then with periods.
    let between = |mut snapshot: Snapshot, periodic: bool| {
        snapshot.header.walls.retain(|wall| wall.normal.z != 0.0);
        let cell = snapshot.header.cell;
        snapshot.header.cell = Cell::new(cell.low(), cell.high(), [periodic, periodic, false]);
        snapshot
    };
    let plates =
        |periodic| both(&between(closed(0.02), periodic), &between(closed(0.019), periodic));
    assert_eq!(plates(false).0, (true, false));
    assert_eq!(plates(true).0, (true, true));
}

#[test]
fn half_a_line_at_the_end_of_a_history_is_passed_over() {
    let whole = "step,time_s,top_m,overlap\n0,0,1,0.5\n10,0.1,2,2e-6\n";
    let history = History::read(whole.as_bytes()).unwrap();
    assert_eq!(history.curves.len(), 2);
    // In the middle of a cell, after the last comma, in half a number.
    for cut in ["20,0.2,1", "20,0.2,", "20,0.2,3,2e", "20,0.2,3,2e-6", "\u{0}\u{0}"] {
        let read = History::read(format!("{whole}{cut}").as_bytes());
        assert_eq!(read.expect(cut), history, "{cut}");
    }
}

#[test]
fn captions_tell_what_is_beyond_a_plot() {
    let captions = |forces: &[(f64, Vec3)]| {
        let (_, contacts) = contacts_with(&vec![Vec3::x(); forces.len()], forces);
        let header = header(Vec3::zeros(), Vec3::repeat(1.0), false, Vec3::repeat(0.1), 2);
        let particles = particles_at(vec![Vec3::zeros(), Vec3::repeat(0.2)]);
        let forces = Snapshot { header, particles, contacts }.report().forces.unwrap();
        [
            plots::force_distribution(&forces.normal, &forces.shear).unwrap().caption,
            plots::friction(&forces.friction_used).unwrap().caption,
        ]
    };
    let mut forces = vec![(1.0, Vec3::zeros()); 21];
    assert!(captions(&forces).iter().all(|caption| !caption.contains("eyond")));
    // One of 21 twenty times as strong as the mean; one that uses more friction than fits.
    forces[3].0 = 400.0;
    forces[7].1 = Vec3::z() * 1.5;
    let [distribution, friction] = captions(&forces);
    assert!(distribution.ends_with("at 8 times the mean and above: 4.762 % of the normal forces."));
    assert!(friction.ends_with("at 1 and above: 4.762 % of the contacts."), "{friction}");
    forces[3].1 = Vec3::z() * 200.0;
    let [distribution, _] = captions(&forces);
    assert!(
        distribution.ends_with("4.762 % of the normal forces, 4.762 % of the tangential forces.")
    );
}

#[test]
fn a_margin_follows_the_walls_and_strains_stay_those_of_the_whole() {
    let folder = tempfile::tempdir().unwrap();
    for (step, height) in [(1, 0.02), (2, 0.018)] {
        store(folder.path(), &boxed(height, step));
    }
    let files = series::all(folder.path()).unwrap();
    assert_eq!(files.len(), 2);
    let choice =
        series::Choice { margin: Some("0.001".parse().unwrap()), ..series::Choice::default() };
    let (reports, _) = series::reports(&series::open(&files).unwrap(), &choice).unwrap();
    let side = 5.0 * 2.6e-3;
    for (report, height) in reports.iter().zip([0.02, 0.018]) {
        let Bounds { low, high } = report.bounds_m.unwrap();
        assert!((low - Vec3::repeat(1e-3)).amax() < 1e-15, "{low}");
        let expected = Vec3::new(side - 1e-3, side - 1e-3, height - 1e-3);
        assert!((high - expected).amax() < 1e-15, "{high}");
        assert!(report.summary.particles < 125);
    }
    let strain = reports[1].summary.axial_strain.unwrap();
    assert!((strain - (0.02_f64 / 0.018).ln()).abs() < 1e-12, "{strain}");

    // A diameter is that of the ball of equal volume.
    let reader = Reader::open(&files[0]).unwrap();
    let region = inside(&reader, Margin::Diameters(0.5)).unwrap();
    let Region::Box(bounds) = region else { panic!("{region:?}") };
    let semi_axes = reader.header().shapes[0].semi_axes;
    assert!((bounds.low.x - semi_axes.product().cbrt()).abs() < 1e-12, "{bounds:?}");
    let error = inside(&reader, Margin::Metres(1.0)).unwrap_err().to_string();
    assert!(error.contains("the region has no length along x"), "{error}");
    assert!("1.5d".parse() == Ok(Margin::Diameters(1.5)) && "-1".parse::<Margin>().is_err());
}

#[test]
fn walls_tell_stress_and_inertial_number() {
    let mut snapshot = boxed(0.02, 1);
    for wall in &mut snapshot.header.walls {
        // Twice the load on the floor, as under weight.
        let load = if wall.normal.z > 0.0 { 20.0 } else { 10.0 };
        wall.force = wall.normal * -load;
    }
    snapshot.header.walls.last_mut().unwrap().velocity = Vec3::z() * -0.1;
    let report = snapshot.report();
    let s = &report.summary;
    let side: f64 = 5.0 * 2.6e-3;
    let close = |found: Option<f64>, expected: f64| {
        assert!((found.unwrap() / expected - 1.0).abs() < 1e-12, "{found:?} but {expected}");
    };
    close(s.wall_stress_xx_pa, 10.0 / (side * 0.02));
    close(s.wall_stress_yy_pa, 10.0 / (side * 0.02));
    close(s.wall_stress_zz_pa, 15.0 / (side * side));
    let shape = &snapshot.header.shapes[0];
    let diameter = (6.0 / PI * shape.volume).cbrt();
    let inertia = 0.1 / 0.02 * diameter * (shape.mass / shape.volume / s.p_pa.unwrap()).sqrt();
    close(s.inertial_number, inertia);
    let relation = s.q_over_p_from_fabric.unwrap() / s.q_over_p.unwrap() - 1.0;
    close(s.fabric_relation_error, relation);

    // A wall beyond the lid does not bound the packing.
    let lid = snapshot.header.walls.pop().unwrap();
    let beyond = WallRow { point: Vec3::z() * 0.03, velocity: Vec3::zeros(), ..lid.clone() };
    snapshot.header.walls.extend([beyond, lid]);
    close(snapshot.report().summary.inertial_number, inertia);

    // Without a lid the load on the floor is not the stress in between.
    let open = ellipsoids(5, 8);
    let s = open.analyse(Settings::default()).unwrap().report.summary;
    assert_eq!((s.wall_stress_zz_pa, s.inertial_number), (None, None));
    assert!(s.wall_stress_xx_pa.is_some());
}
