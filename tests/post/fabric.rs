//! Fabric, its anisotropies and roses.

use super::{ROUNDING, close, close_matrix, json, matrix, number};
use crate::support::packings::{Snapshot, header, particles_at, push, push_force};
use crate::support::random::Draw;
use crate::support::reference;
use dem_mpi::ids::GlobalId;
use dem_mpi::math::{Mat3, Vec3};
use dem_mpi::output::tables::ContactTable;
use dem_mpi::post::fabric::{Among, Degrees, FabricSum, ForceFabricSum, Rose, degree};
use dem_mpi::post::region::{Members, Region};
use dem_mpi::post::stress::Stress;
use dem_mpi::random::Random;

/// Contacts between two particles with the given normals and forces.
pub(super) fn contacts_with(normals: &[Vec3], forces: &[(f64, Vec3)]) -> (Members, ContactTable) {
    let header = header(Vec3::zeros(), Vec3::repeat(1.0), false, Vec3::repeat(0.1), 2);
    let mut members = Members::new(Region::Whole);
    let two = particles_at(vec![Vec3::zeros(), Vec3::repeat(0.2)]);
    members.add(&header, &two).unwrap();
    let mut contacts = ContactTable::default();
    for (normal, &(force, shear)) in normals.iter().zip(forces) {
        // Branches are parallel to the forces, so that they have the same anisotropy.
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

#[test]
fn roses_of_a_known_density() {
    // An isotropic set: every bin is near one, and the weighted mean is exactly one.
    let mut dice = Random::of(4, 0);
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
        // Mean of a fit over the bin's ring on the sphere.
        let mean = |fit: &dyn Fn(f64) -> f64| {
            let angles = (0..100).map(|i| (k as f64 + (f64::from(i) + 0.5) / 100.0) * Rose::STEP);
            let (sum, weight) = angles.fold((0.0, 0.0), |(sum, weight), angle| {
                (sum + fit(angle) * angle.sin(), weight + angle.sin())
            });
            sum / weight
        };
        // The smallest bin has 600 contacts: four standard errors.
        close(density.unwrap(), 1.0, 0.16, "density");
        let (normal, shear) = (normal.unwrap() / 2.0, shear.unwrap() / 2.0);
        close(normal, mean(&|angle| Rose::normal_fit(&a, angle)), 3e-3, "normal force");
        close(shear, mean(&|angle| Rose::shear_fit(&a, angle)), 3e-3, "shear force");
    }
}

/// `q/p = 2/5 (a_c + a_n + a_bn + 3/2 (a_t + a_bt))`, see [`dem_mpi::post::fabric`].
#[test]
fn each_anisotropy_has_its_part_of_the_stress() {
    let degrees = Degrees { a_c: 1.0, a_n: 2.0, a_t: 4.0, a_bn: 8.0, a_bt: 16.0 };
    assert!((degrees.stress_ratio() - 16.4).abs() < 1e-14, "{}", degrees.stress_ratio());
}
