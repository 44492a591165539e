//! One packing in nanometres, millimetres and kilometres: no number in the program has a fixed length.

use crate::support::{begun, scene};
use dem_mpi::comm::Comm;
use dem_mpi::comm::alone::Alone;

/// Particles of every kind fall into a box. Seconds and kilograms are unchanged, so stiffness (N/m = kg/s²) is,
/// too. All lengths, in millimetres here, are multiplied by `millimetre`, a power of two.
fn text(method: &str, millimetre: f64) -> String {
    let l = |millimetres: f64| format!("{:?}", millimetres * millimetre);
    let v = |x: f64, y: f64, z: f64| format!("[{}, {}, {}]", l(x), l(y), l(z));
    let corners = |half: f64| {
        let all = (0..8).map(|k| {
            let side = |bit: i32| if k >> bit & 1 == 1 { half } else { -half };
            v(side(0), side(1), side(2))
        });
        all.collect::<Vec<_>>().join(", ")
    };
    let density = 0.000_265 / (millimetre * millimetre * millimetre);
    let [gravity, low, high, full, thrown] = [
        v(1000.0, 500.0, -9810.0),
        v(0.0, 0.0, 0.0),
        v(18.6, 18.6, 100.0),
        v(18.6, 18.6, 26.0),
        v(300.0, -200.0, -2000.0),
    ];
    let [egg, bean, shard_x, shard_y, shard_z, shard_tip] = [
        v(1.6, 1.4, 0.8),
        v(1.5, 1.0, 0.8),
        v(2.5, 0.0, 0.0),
        v(0.0, 2.4, 0.0),
        v(0.4, 0.6, 2.2),
        v(1.6, 1.6, 1.0),
    ];
    let die = corners(0.8);
    let [ball, rod_length, rod_radius, die_radius, spacing] =
        [l(1.1), l(2.0), l(0.7), l(0.2), l(3.7)];
    format!(
        r#"
gravity = {gravity}
[domain]
low = {low}
high = {high}
walls = ["-x", "+x", "-y", "+y", "-z"]
[[material]]
name = "grain"
density = {density:?}
normal_stiffness = 1.5e5
friction = 0.3
restitution = 0.8
tangential_damping_ratio = 0.02
[[shape]]
name = "ball"
kind = "sphere"
radius = {ball}
[[shape]]
name = "egg"
kind = "ellipsoid"
semi_axes = {egg}
[[shape]]
name = "bean"
kind = "superellipsoid"
semi_axes = {bean}
exponents = [0.7, 0.9]
[[shape]]
name = "rod"
kind = "spherocylinder"
length = {rod_length}
radius = {rod_radius}
[[shape]]
name = "die"
kind = "rounded-polyhedron"
radius = {die_radius}
vertices = [{die}]
[[shape]]
name = "shard"
kind = "polyhedron"
vertices = [{low}, {shard_x}, {shard_y}, {shard_z}, {shard_tip}]
[[fill.lattice]]
shapes = ["ball", "egg", "bean", "rod", "die", "shard"]
low = {low}
high = {full}
spacing = {spacing}
velocity = {thrown}
[contact]
method = "{method}"
[time]
step = 7e-6
"#
    )
}

/// Every number of every particle, with lengths converted back to millimetres.
fn digits(method: &str, millimetre: f64, steps: u64) -> (Vec<Vec<u64>>, usize) {
    let mut comm = Alone::default();
    let mut sim = begun(&scene(&text(method, millimetre)), &mut comm);
    for _ in 0..steps {
        sim.step(&mut comm).unwrap();
    }
    let table = sim.particle_table(comm.rank());
    let row = |k: usize| {
        let (once, twice) = (1.0 / millimetre, 1.0 / millimetre / millimetre);
        let columns = [
            (&table.position, once),
            (&table.velocity, once),
            (&table.force, once),
            (&table.angular_velocity, 1.0),
            (&table.angular_momentum, twice),
            (&table.torque, twice),
        ];
        let numbers = columns.iter().flat_map(|(column, unit)| <[f64; 3]>::from(column[k] * *unit));
        numbers.chain(table.quaternion[k]).map(f64::to_bits).collect()
    };
    ((0..table.id.len()).map(row).collect(), sim.contact_records().len())
}

#[test]
fn a_packing_has_the_same_digits_in_nanometres_and_kilometres() {
    for (method, steps) in [("auto", 2000), ("epa", 500)] {
        let (here, contacts) = digits(method, 2f64.powi(-10), steps);
        assert!(here.len() >= 150 && contacts > 20, "{} with {contacts}", here.len());
        for exponent in [-30, 10] {
            let (there, _) = digits(method, 2f64.powi(exponent), steps);
            let differing: Vec<usize> = (0..here.len()).filter(|&k| here[k] != there[k]).collect();
            assert!(differing.is_empty(), "{method}, mm = 2^{exponent} m: {differing:?} differ");
        }
    }
}
