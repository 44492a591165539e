//! Stress, coordination and density of lattices, boxes and parts of packings.

use super::{ROUNDING, close, close_matrix, json, matrix, members, number};
use crate::support::packings::{
    Snapshot, boxed, ellipsoids, header, particles_at, plane_row, push, push_force,
};
use dem_mpi::cell::Cell;
use dem_mpi::ids::GlobalId;
use dem_mpi::math::{Mat3, Vec3};
use dem_mpi::output::header::WallRow;
use dem_mpi::output::tables::ContactTable;
use dem_mpi::post::region::{Bounds, Region};
use dem_mpi::post::stress::StressSum;
use dem_mpi::post::{Report, Settings};
use serde_json::Value;
use std::f64::consts::PI;

/// Equal spheres on a lattice: `basis` in units of the cell's sides, three cells per side, contact stiffness `k`
/// [N/m].
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
            // Overlaps below this are rounding of the lattice.
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
                header.walls.push(plane_row(format!("{axis} {up}"), point, normal));
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

pub(super) fn lattice_case(name: &str) -> (Value, Snapshot) {
    let all = json("dem_lattices.json");
    let cases = all["cases"].as_array().expect("a list");
    let case = cases.iter().find(|c| c["name"] == name).expect("the case").clone();
    let snapshot = lattice_of(&case).expect("a lattice");
    (case, snapshot)
}

/// Tolerance of a lattice, whose overlap is a small difference of large numbers.
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
    // Counts add up, too: half a contact on each side of the cut.
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
    // By definition, per particle: its force on the partner times the arm from its own centre.
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
fn walls_tell_stress_and_inertial_number() {
    let mut snapshot = boxed(0.02, 1);
    for wall in &mut snapshot.header.walls {
        // Twice the load on the floor, like under weight.
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
    assert_eq!(s.wall_shear_over_normal, None, "a lid that comes down");
    let principal = report.principal_stress_pa.as_ref().unwrap();
    close(s.major_over_minor_stress, principal[0].value / principal[2].value);
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

    // A new innermost wall has not slid, and walls at rest do not shear.
    let mut other = boxed(0.02, 1);
    let lid = other.header.walls.last().unwrap().clone();
    let inner =
        WallRow { name: "plate".into(), point: lid.point + Vec3::new(0.003, 0.0, -1e-3), ..lid };
    other.header.walls.push(inner);
    let mut now = other.report();
    now.strain_against(&boxed(0.02, 1).report());
    assert_eq!((now.summary.shear_strain, now.summary.inertial_number), (None, None));

    // A sliding wall shears at its velocity and by its displacement over the distance.
    for axis in 0..3 {
        let mut sliding = boxed(0.02, 1);
        let along = Vec3::ith((axis + 1) % 3, 1.0);
        for wall in &mut sliding.header.walls {
            wall.force = wall.normal * -10.0;
        }
        let last = &mut sliding.header.walls[2 * axis + 1];
        last.velocity = along * 0.1;
        last.point += along * 0.003;
        last.force += along * 3.0;
        let mut now = sliding.report();
        now.strain_against(&boxed(0.02, 1).report());
        let length = if axis == 2 { 0.02 } else { side };
        close(now.summary.inertial_number, inertia * 0.02 / length);
        close(now.summary.shear_strain, 0.003 / length);
        close(now.summary.wall_shear_over_normal, 1.5 / 10.0);
    }

    // Without a lid the load on the floor is not the stress in between.
    let open = ellipsoids(5, 8);
    let s = open.analyse(Settings::default()).unwrap().report.summary;
    assert_eq!((s.wall_stress_zz_pa, s.inertial_number), (None, None));
    // The walls at the sides have no area.
    assert_eq!((s.wall_stress_xx_pa, s.wall_stress_yy_pa), (None, None));
    let mut periodic = open;
    let cell = periodic.header.cell;
    periodic.header.cell = Cell::new(cell.corners().0, cell.corners().1, [false, false, true]);
    periodic.header.walls.iter_mut().for_each(|wall| wall.force = wall.normal * -10.0);
    let s = periodic.report().summary;
    close(s.wall_stress_xx_pa, 10.0 / (side * (cell.corners().1.z - cell.corners().0.z)));
}

/// Shear stresses in the summary are means of both components, which differ while particles rotate: `σ = f ⊗ l / V`
/// for one contact.
#[test]
fn shear_stresses_are_means_of_both() {
    let side = Vec3::repeat(0.1);
    let header = header(Vec3::zeros(), side, true, Vec3::repeat(0.01), 2);
    let position = vec![Vec3::repeat(0.04), Vec3::repeat(0.04) + Vec3::x() * 0.02];
    let branch = Vec3::x() * 0.02;
    let mut contacts = ContactTable::default();
    push(&mut contacts, (0, GlobalId(1)), position[0], branch, branch * 0.5);
    push_force(&mut contacts, Vec3::x(), 1e-6, 30.0, Vec3::new(0.0, 6.0, -4.0));
    let report = Snapshot { header, particles: particles_at(position), contacts }.report();
    let volume: f64 = side.product();
    let [xy, yx] = [report.summary.stress_xy_pa.unwrap(), report.summary.stress_yx_pa.unwrap()];
    assert!((xy + yx).abs() > 0.99 * 6.0 * 0.02 / volume && xy * yx == 0.0, "{xy} {yx}");
    let groups = report.groups();
    let row = |label: &str| {
        let row = groups.iter().flat_map(|group| &group.rows).find(|row| row.label == label);
        row.map(|row| format!("{} {}", row.value, row.unit)).unwrap()
    };
    // Half of 6 N and of -4 N over 0.02 m in 0.001 m³.
    assert_eq!((row("σxy"), row("σxz")), ("60.00 Pa".into(), "-40.00 Pa".into()));
}
