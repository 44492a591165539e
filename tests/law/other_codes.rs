//! Comparisons with stored results of other codes, which need not be installed.

use crate::support::Bench;
use dem_mpi::ids::{GlobalId, ShapeId};
use dem_mpi::math::Vec3;
use dem_mpi::particles::records::Particle;
use dem_mpi::scene::Scene;
use std::path::Path;

/// Initial and final positions of each sphere [m], from a file in `tests/reference`.
fn answer(file: &str) -> Vec<[Vec3; 2]> {
    let path = format!("{}/tests/reference/{file}", env!("CARGO_MANIFEST_DIR"));
    let mut rows = csv::Reader::from_path(&path).unwrap_or_else(|e| panic!("{path}: {e}"));
    rows.deserialize()
        .map(|row| {
            let [x, y, z, end_x, end_y, end_z]: [f64; 6] = row.unwrap();
            [Vec3::new(x, y, z), Vec3::new(end_x, end_y, end_z)]
        })
        .collect()
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Final positions of these spheres after a millisecond of the scene in `benchmarks/peers` [m].
fn ends(start: impl Iterator<Item = Vec3>, dt: f64) -> Vec<Vec3> {
    let path = format!("{}/benchmarks/peers/spheres.toml", env!("CARGO_MANIFEST_DIR"));
    let scene = Scene::read(Path::new(&path), &[format!("time.step={dt:e}")])
        .unwrap_or_else(|errors| panic!("{errors}"));
    let spheres: Vec<Particle> = start
        .zip(0..)
        .map(|(position, id)| Particle::at_rest(GlobalId(id), ShapeId(0), position))
        .collect();
    let mut bench = Bench::of(&scene, &spheres);
    for _ in 0..(1e-3 / dt).round() as u32 {
        bench.step();
    }
    (0..spheres.len() as u64).map(|id| bench.sim.particles.position[bench.slot(id)]).collect()
}

/// A corner of a settled packing after removal of two sides: most contacts slide. The remaining difference between both codes is
/// the lever arm of a contact (radius there, radius less half the overlap here). When the spring of a sliding contact had the
/// length of the whole limit, dashpot included, the difference was eight times larger at any step.
#[test]
fn sliding_spheres_go_where_lammps_brings_them() {
    let rows = answer("lammps_corner_500.csv");
    assert_eq!(rows.len(), 500);
    let [start, end] = [0, 1].map(|k| rows.iter().map(move |row| row[k]));
    let apart = |a: &[Vec3], b: &[Vec3]| median(a.iter().zip(b).map(|(a, b)| (a - b).norm()));
    let (start, end): (Vec<Vec3>, Vec<Vec3>) = (start.collect(), end.collect());
    let way = apart(&start, &end);
    let [coarse, fine] = [1e-5, 1e-6].map(|dt| ends(start.iter().copied(), dt));
    let (off, between) = (apart(&fine, &end) / way, apart(&coarse, &fine) / way);
    println!("off {off:.2e} of the way, a tenth of the step {between:.2e}");
    assert!(off < 2e-3, "{off:.2e} of the way off LAMMPS");
    assert!(between < 4e-3, "a tenth of the step changes {between:.2e} of the way");
}
