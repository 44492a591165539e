//! Fields, mixing, slopes and flows against known values.

use super::{arrays, close, close_matrix};
use crate::support::packings::{Snapshot, header, particles_at, push, push_force, store};
use crate::support::random::Draw;
use dem_mpi::cell::Shear;
use dem_mpi::ids::{GlobalId, ShapeId};
use dem_mpi::math::{Mat3, Vec3};
use dem_mpi::output::snapshot::Reader;
use dem_mpi::output::tables::ContactTable;
use dem_mpi::post::errors::MeasureError;
use dem_mpi::post::fields::{Fields, Smoothing, Weight};
use dem_mpi::post::flow::{CumulativeFlow, Plane, Rate, Window, through_plane};
use dem_mpi::post::mixing::{Groups, Members, Mixing};
use dem_mpi::post::region::{Bounds, Margin, Region};
use dem_mpi::post::slope::{Direction, Surface};
use dem_mpi::post::{Settings, analyse};
use dem_mpi::random::Random;
use std::f64::consts::PI;
use std::process::Command;
use tempfile::TempDir;

const DIAMETER: f64 = 2e-3;

fn stored(snapshot: &Snapshot) -> (TempDir, Reader) {
    let folder = tempfile::tempdir().unwrap();
    store(folder.path(), snapshot);
    let reader = Reader::open(&folder.path().join("last.vtkhdf")).unwrap();
    (folder, reader)
}

/// Balls at these positions in a box, without contacts.
fn balls(high: Vec3, periodic: bool, position: Vec<Vec3>) -> Snapshot {
    let semi_axes = Vec3::repeat(0.5 * DIAMETER);
    let mut header = header(Vec3::zeros(), high, periodic, semi_axes, position.len());
    header.gravity = Vec3::new(0.0, 0.0, -9.81);
    header.shapes[0].mass = 1e-5;
    Snapshot { header, particles: particles_at(position), contacts: ContactTable::default() }
}

/// Disordered balls in a periodic box, with forces between near balls, across the faces, too.
fn crowd() -> Snapshot {
    let mut dice = Random::of(5, 0);
    let high = Vec3::new(0.020, 0.016, 0.018);
    let position = (0..300).map(|_| Vec3::from_fn(|k, _| dice.between(0.0, high[k]))).collect();
    let mut snapshot = balls(high, true, position);
    let Snapshot { header, particles, contacts } = &mut snapshot;
    particles.velocity.iter_mut().for_each(|v| *v = dice.vector(-1.0, 1.0));
    for a in 0..300 {
        for b in a + 1..300 {
            let place = particles.position[a];
            let branch = header.cell.nearest(particles.position[b] - place);
            if branch.norm() < DIAMETER {
                push(contacts, (a as u64, GlobalId(b as u64)), place, branch, branch * 0.5);
                let (normal, side) = (branch.normalize(), dice.direction());
                let shear = side - normal * side.dot(&normal);
                push_force(contacts, normal, 1e-6, dice.between(0.0, 1.0), shear);
            }
        }
    }
    snapshot
}

fn smoothing(weight: Weight) -> Smoothing {
    Smoothing { weight, width: 0.5 * DIAMETER, side: 0.5 * DIAMETER }
}

#[test]
fn fields_add_up_to_the_sums_over_all_grains() {
    let (_folder, reader) = stored(&crowd());
    let particles = reader.particles(0..300).unwrap();
    let mass = reader.header().shapes[0].mass;
    let stress = analyse(&reader, "crowd", Settings::default()).unwrap().report.stress_pa.unwrap();
    for weight in [Weight::Lucy, Weight::Gauss] {
        let fields = Fields::of(&reader, Region::Whole, smoothing(weight)).unwrap();
        assert_eq!(fields.grid.cells, [20, 16, 18]);
        let cell = fields.grid.volume();
        close(fields.mass() / (300.0 * mass), 1.0, 1e-13, "mass");
        let solid = fields.solid_fraction.iter().sum::<f64>() * cell;
        close(solid / (300.0 * reader.header().shapes[0].volume), 1.0, 1e-13, "volume");
        let momentum: Vec3 =
            fields.density.iter().zip(&fields.velocity).map(|(rho, v)| v * *rho * cell).sum();
        let expected: Vec3 = particles.velocity.iter().map(|v| v * mass).sum();
        assert!((momentum - expected).norm() < 1e-13 * 300.0 * mass, "{momentum} {expected}");
        // Mean stress, which the report has, too.
        let sum: Mat3 = fields.contact_stress.iter().sum();
        let mean = sum / fields.grid.len() as f64;
        close_matrix(
            &(mean / stress.tensor.amax()),
            &(stress.tensor / stress.tensor.amax()),
            1e-12,
            "stress",
        );
        // Fluctuations and mean motion add up to the whole.
        let kinetic: Mat3 = fields.kinetic_stress.iter().sum::<Mat3>() * cell;
        let of_mean: Mat3 = fields
            .density
            .iter()
            .zip(&fields.velocity)
            .map(|(rho, v)| v * v.transpose() * (rho * cell))
            .sum();
        let whole: Mat3 = particles.velocity.iter().map(|v| v * v.transpose() * mass).sum();
        close_matrix(
            &((kinetic + of_mean) / whole.amax()),
            &(whole / whole.amax()),
            1e-12,
            "motion",
        );
        assert!(kinetic.trace() > 0.2 * whole.trace());
    }
}

/// Sums over the cells of each column, in the table and in the image, for three particles and the force of one contact. The kinetic stress κ
/// and the mean motion add up to `Σ (κ + ρ v v) V = Σ m v v`.
#[test]
fn columns_of_fields_hold_what_their_names_say() {
    let places = [[4.0, 7.0, 11.0], [5.5, 7.5, 10.2], [5.0, 6.4, 12.0]];
    let places = places.map(|place| Vec3::from(place) * 1e-3);
    let mut three = balls(Vec3::repeat(0.02), false, places.to_vec());
    let velocity = [[1.0, -2.0, 4.0], [-3.0, 0.5, 1.0], [0.3, 0.7, -2.5]].map(Vec3::from);
    three.particles.velocity = velocity.to_vec();
    let branch = places[1] - places[0];
    let (force, normal) = (Vec3::new(5.0, 1.0, 6.0), Vec3::new(2.0, 3.0, 6.0) / 7.0);
    push(&mut three.contacts, (0, GlobalId(1)), places[0], branch, 0.5 * branch);
    push_force(&mut three.contacts, normal, 1e-6, 7.0, force - 7.0 * normal);
    let (mass, volume) = (three.header.shapes[0].mass, three.header.shapes[0].volume);
    let (_folder, reader) = stored(&three);
    let fields = Fields::of(&reader, Region::Whole, smoothing(Weight::Lucy)).unwrap();
    let cell = fields.grid.volume();
    let (mut table, mut image) = (Vec::new(), Vec::new());
    fields.write_csv(&mut table).unwrap();
    fields.image_data().write(&mut image).unwrap();
    let mut table = csv::Reader::from_reader(&*table);
    let names = table.headers().unwrap().clone();
    let rows: Vec<Vec<f64>> = table.deserialize().map(Result::unwrap).collect();
    let place = |name: &str| names.iter().position(|of| of == name).expect(name);
    let whole = |of: &dyn Fn(&[f64]) -> f64| rows.iter().map(|row| of(row)).sum::<f64>() * cell;
    let sum = |name: &str| whole(&|row: &[f64]| row[place(name)]);
    let expect = |found: f64, expected: f64, what: &str| close(found / expected, 1.0, 1e-11, what);
    expect(sum("density_kg_per_m3"), 3.0 * mass, "mass");
    expect(sum("solid_fraction"), 3.0 * volume, "volume");
    let in_image = arrays::<f64>(&image);
    let of_image = |name: &str, width: usize, k: usize| {
        in_image(name).chunks(width).map(|row| row[k]).sum::<f64>() * cell
    };
    expect(of_image("density", 1, 0), 3.0 * mass, "mass");
    expect(of_image("solid_fraction", 1, 0), 3.0 * volume, "volume");
    let (in_density, in_velocity) = (in_image("density"), in_image("velocity"));
    let axes = ["x", "y", "z"];
    let density = place("density_kg_per_m3");
    let speeds = axes.map(|axis| place(&format!("v{axis}_m_per_s")));
    let mut moving = 0.0;
    for i in 0..3 {
        let moment = |k: usize| whole(&|row: &[f64]| row[density] * row[k]);
        let at = moment(place(&format!("{}_m", axes[i]))) / (3.0 * mass);
        let middle = places.iter().map(|place| place[i]).sum::<f64>() / 3.0;
        assert!((at - middle).abs() < 0.3e-3, "{at} {middle}");
        expect(moment(speeds[i]), mass * velocity.iter().map(|v| v[i]).sum::<f64>(), "momentum");
        let momentum: f64 =
            in_density.iter().zip(in_velocity.chunks(3)).map(|(rho, v)| rho * v[i] * cell).sum();
        expect(momentum, moment(speeds[i]), "momentum");
        for j in 0..3 {
            expect(of_image("contact_stress", 9, 3 * i + j), force[i] * branch[j], "contacts");
            let of_mean = whole(&|row: &[f64]| row[density] * row[speeds[i]] * row[speeds[j]]);
            let motion = mass * velocity.iter().map(|v| v[i] * v[j]).sum::<f64>() - of_mean;
            expect(of_image("kinetic_stress", 9, 3 * i + j), motion, "motion");
            if i <= j {
                let component = format!("{}{}_pa", axes[i], axes[j]);
                let contacts = 0.5 * (force[i] * branch[j] + force[j] * branch[i]);
                expect(sum(&format!("contact_{component}")), contacts, &component);
                expect(sum(&format!("kinetic_{component}")), motion, &component);
            }
            moving += if i == j { motion } else { 0.0 };
        }
    }
    let pressure = (force.dot(&branch) + moving) / 3.0;
    expect(sum("pressure_pa"), pressure, "pressure");
    expect(of_image("pressure", 1, 0), pressure, "pressure");
    assert!(moving > 1e-3 * force.dot(&branch), "{moving}");
}

/// Without periods the grid reaches as far as the weights. A region shows a part of the same field.
#[test]
fn a_grain_is_spread_as_lucy_s_polynomial() {
    let (mass, width) = (1e-5, 1e-3);
    let alone = balls(Vec3::repeat(0.02), false, vec![Vec3::repeat(0.01)]);
    let (_folder, reader) = stored(&alone);
    let how = Smoothing { weight: Weight::Lucy, width, side: 0.1 * width };
    let fields = Fields::of(&reader, Region::Whole, how).unwrap();
    close(fields.mass() / mass, 1.0, 1e-13, "mass");
    let range: f64 = 2e-3;
    let peak = mass * 105.0 / (16.0 * PI * range.powi(3));
    for (cell, density) in fields.density.iter().enumerate() {
        let q = (fields.grid.centre(cell) - Vec3::repeat(0.01)).norm() / range;
        let expected = if q < 1.0 { peak * (1.0 + 3.0 * q) * (1.0 - q).powi(3) } else { 0.0 };
        close(density / peak, expected / peak, 1e-3, "density");
    }
    let half = Bounds { low: Vec3::repeat(0.005), high: Vec3::new(0.01, 0.015, 0.015) };
    let part = Fields::of(&reader, Region::Box(half), how).unwrap();
    close(part.mass() / mass, 0.5, 1e-12, "half");
}

/// A force of 1 N along a branch much longer than the weight leaves no holes along it. In its middle the stress is `f ∫ φ dx` over the
/// weight's range h. With Lucy's `φ = 105 / (16 π h³) (1 + 3q) (1 - q)³` the integral is `2 h (1/4 + 3/20)` times the prefactor.
#[test]
fn a_long_branch_has_no_holes() {
    let (width, length): (f64, f64) = (0.5e-3, 6e-3);
    let middle = Vec3::repeat(0.01);
    let half = Vec3::x() * 0.5 * length;
    let mut two = balls(Vec3::repeat(0.02), false, vec![middle - half, middle + half]);
    push(&mut two.contacts, (0, GlobalId(1)), middle - half, half * 2.0, half);
    push_force(&mut two.contacts, Vec3::x(), 1e-6, 1.0, Vec3::zeros());
    let (_folder, reader) = stored(&two);
    // Cells have a tenth of the width and their centres on the branch.
    let side = 0.1 * width;
    let exact = 0.8 * 105.0 / (16.0 * PI * (2.0 * width).powi(2));
    for part in -10..=10 {
        let centre = middle + Vec3::x() * (f64::from(part) * 0.1 * width);
        let around = Vec3::repeat(0.5 * side);
        let bounds = Bounds { low: centre - around, high: centre + around };
        let how = Smoothing { weight: Weight::Lucy, width, side };
        let fields = Fields::of(&reader, Region::Box(bounds), how).unwrap();
        assert_eq!(fields.grid.len(), 1);
        close(fields.contact_stress[0].m11 / exact, 1.0, 5e-4, "stress");
        // No particle is near, but the cell has a row for its stress.
        assert_eq!(fields.density, [0.0]);
        let mut table = Vec::new();
        fields.write_csv(&mut table).unwrap();
        assert_eq!(String::from_utf8(table).unwrap().lines().count(), 2);
    }
    let aside = Bounds { low: Vec3::repeat(0.001), high: Vec3::repeat(0.002) };
    let how = Smoothing { weight: Weight::Lucy, width, side: width };
    let nobody = Fields::of(&reader, Region::Box(aside), how);
    assert!(matches!(nobody, Err(MeasureError::NobodyThere)));
}

/// A box has whole cells of at most the requested size, so that they resolve the weight.
#[test]
fn cells_of_fields_are_as_large_as_asked_at_most() {
    let one = balls(Vec3::repeat(0.02), false, vec![Vec3::repeat(0.01)]);
    let (_folder, reader) = stored(&one);
    let how = Smoothing { weight: Weight::Lucy, width: 1e-3, side: 1e-3 };
    let low = Vec3::repeat(0.01);
    let high = low + Vec3::new(1.4e-3, 3e-3, 2.2e-3);
    let fields = Fields::of(&reader, Region::Box(Bounds { low, high }), how).unwrap();
    assert_eq!(fields.grid.cells, [2, 3, 3]);
    assert!(fields.grid.sides.max() <= how.side * (1.0 + 1e-8));
}

/// Images in a sheared cell move with the flow: balls that follow it have almost no fluctuations.
#[test]
fn a_sheared_cell_is_smooth_across_its_faces() {
    let mut snapshot = crowd();
    let shear = Shear { along: 0, across: 2, rate: 30.0, strain: 0.0 };
    let mut cell = snapshot.header.cell.with_shear(shear).unwrap();
    (0..7).for_each(|_| cell.advance(1e-3));
    snapshot.header.cell = cell;
    // Branches across the faces add up, too.
    let branches = &snapshot.contacts;
    let moments = (0..branches.a.len()).map(|k| branches.force(k) * branches.branch[k].transpose());
    let moment: Mat3 = moments.sum();
    let (_folder, reader) = stored(&snapshot);
    for weight in [Weight::Lucy, Weight::Gauss] {
        let fields = Fields::of(&reader, Region::Whole, smoothing(weight)).unwrap();
        close(fields.mass() / (300.0 * 1e-5), 1.0, 1e-13, "mass");
        let sum = fields.contact_stress.iter().sum::<Mat3>() * fields.grid.volume();
        close_matrix(&(sum / moment.amax()), &(moment / moment.amax()), 1e-12, "moment");
    }
    snapshot.contacts = ContactTable::default();
    for (v, place) in snapshot.particles.velocity.iter_mut().zip(&snapshot.particles.position) {
        *v = cell.flow_at(place);
    }
    let (_folder, reader) = stored(&snapshot);
    let fields = Fields::of(&reader, Region::Whole, smoothing(Weight::Lucy)).unwrap();
    close(fields.mass() / (300.0 * 1e-5), 1.0, 1e-13, "mass");
    for (number, velocity) in fields.velocity.iter().enumerate() {
        if fields.density[number] > 0.0 {
            let expected = cell.flow_at(&fields.grid.centre(number));
            // The range of the weight is one diameter.
            assert!((velocity - expected).norm() < 30.0 * DIAMETER, "{velocity} {expected}");
        }
    }
}

/// Share of a uniform shear in the kinetic stress, without fluctuations; the values are those of the guide.
#[test]
fn motion_holds_the_shear_across_a_weight() {
    let places = (0..12 * 12 * 12)
        .map(|k| Vec3::new((k % 12).into(), (k / 12 % 12).into(), (k / 144).into()));
    let places: Vec<Vec3> = places.map(|place: Vec3| place.add_scalar(0.5) * DIAMETER).collect();
    let mut lattice = balls(Vec3::repeat(12.0 * DIAMETER), true, places.clone());
    let rate = 40.0;
    for (v, place) in lattice.particles.velocity.iter_mut().zip(&places) {
        v.x = rate * place.z;
    }
    let (_folder, reader) = stored(&lattice);
    for (weight, width, share) in [(Weight::Lucy, 1.5, 1.0 / 3.0), (Weight::Gauss, 1.0, 0.92)] {
        let width = width * DIAMETER;
        let how = Smoothing { weight, width, side: 0.25 * DIAMETER };
        let fields = Fields::of(&reader, Region::Whole, how).unwrap();
        let middle = fields.grid.cell_at(&Vec3::repeat(6.1 * DIAMETER)).unwrap();
        let stress = fields.kinetic_stress[middle];
        let scale = fields.density[middle] * (rate * width).powi(2);
        close(stress.m11 / scale, share, 0.03, "along the flow");
        assert!(
            stress.m12.abs().max(stress.m13.abs()).max(stress.m33.abs()) < 1e-12 * scale,
            "{stress}"
        );
    }
}

#[test]
fn mixing_is_nothing_apart_and_one_at_random() {
    let apart = Mixing::of_counts(0, 0.0, &[[7, 7], [0, 0], [5, 0], [9, 9]]).unwrap();
    assert_eq!((apart.cells, apart.grains), (3, 21));
    close(apart.index.unwrap(), 0.0, 1e-15, "apart");
    close(apart.variance_apart, 16.0 / 21.0 * 5.0 / 21.0, 1e-15, "apart");
    // Shuffled among 60 cells of unequal numbers: the mean over many trials is 1.
    let mut dice = Random::of(3, 1);
    let (mut sum, tries) = (0.0, 400);
    for _ in 0..tries {
        let mut left = [600_u64, 240];
        let counts: Vec<[u64; 2]> = (0..60)
            .map(|k| {
                let mut cell = [4 + k % 13, 0];
                for _ in 0..cell[0] {
                    let is_first = dice.unit() * (left[0] as f64) < left[1] as f64;
                    cell[1] += u64::from(is_first);
                    left = [left[0] - 1, left[1] - u64::from(is_first)];
                }
                cell
            })
            .collect();
        sum += Mixing::of_counts(0, 0.0, &counts).unwrap().index.unwrap();
    }
    close(sum / f64::from(tries), 1.0, 2e-3, "mean of random mixtures");
    let one = Mixing::of_counts(0, 0.0, &[[3, 3], [2, 2]]);
    assert!(matches!(one, Err(MeasureError::OneGroup { grains: 5 })));
}

/// Groups by position in the first snapshot and by shape, in periodic boxes and others.
#[test]
fn groups_stay_what_they_were() {
    let places: Vec<Vec3> = (0..64)
        .map(|k| Vec3::new(f64::from(k % 4), f64::from(k / 4 % 4), f64::from(k / 16)))
        .map(|place| place.add_scalar(0.5) * DIAMETER)
        .collect();
    let first = balls(Vec3::repeat(4.0 * DIAMETER), false, places.clone());
    let (_folder, start) = stored(&first);
    let members = Members::of(&Groups::Half(0), &start).unwrap();
    let index = |reader: &Reader, members: &Members| {
        Mixing::of(reader, members, Region::Whole, 2.0 * DIAMETER).unwrap().index.unwrap()
    };
    assert!(index(&start, &members).abs() < 1e-15);
    // Every other layer along y moves to the other side, so each cell has four of both.
    let mut later = first.clone();
    for (place, was) in later.particles.position.iter_mut().zip(&places) {
        if (was.y / DIAMETER) as u32 % 2 == 1 {
            place.x = 4.0 * DIAMETER - was.x;
        }
    }
    let (_later, end) = stored(&later);
    close(index(&end, &members), 1.0 / (1.0 - 7.0 / 63.0), 1e-12, "even");
    // Identical groups by shape.
    later.header.shapes.push(later.header.shapes[0].clone());
    later.header.shapes[1].name = "red".into();
    for (shape, was) in later.particles.shape.iter_mut().zip(&places) {
        *shape = ShapeId(u16::from(was.x > 2.0 * DIAMETER));
    }
    let (_shapes, end) = stored(&later);
    let red = Members::of(&Groups::Shape("red".into()), &end).unwrap();
    close(index(&end, &red), 1.0 / (1.0 - 7.0 / 63.0), 1e-12, "by shape");
    let unknown = Members::of(&Groups::Shape("blue".into()), &end).unwrap_err().to_string();
    assert!(unknown.contains("no shape `blue`; it has: grain, red"), "{unknown}");
    // The series begins with particles of one group.
    let mut begin = later.clone();
    begin.particles.shape.fill(ShapeId(0));
    later.header.step = begin.header.step + 1;
    later.header.time = begin.header.time + 1e-3;
    let folder = tempfile::tempdir().unwrap();
    let post = || {
        let mut dem_post = Command::new(env!("CARGO_BIN_EXE_dem-post"));
        dem_post.arg(folder.path()).args(["--series", "--mixing", "shape:red", "--grid", "2d"]);
        let output = dem_post.output().unwrap();
        [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap())
    };
    store(folder.path(), &begin);
    let [_, refused] = post();
    assert!(refused.contains("all 64 particles of the region are in one group"), "{refused}");
    store(folder.path(), &later);
    let [made, _] = post();
    assert!(made.contains("mixing: 1 of 2 snapshots are left out"), "{made}");
    assert!(made.contains("Lacey's index 1.125"), "{made}");
}

/// Unmixed groups have the index 0 for any position of the plane between them, with cells of the usual size.
#[test]
fn what_is_apart_has_the_index_zero() {
    const SEED: u64 = 5;
    let mut random = Random::of(SEED, 0);
    let size = Vec3::new(13.3, 7.1, 9.7) * DIAMETER;
    let scattered: Vec<Vec3> =
        (0..800).map(|_| Vec3::from_fn(|k, _| size[k] * random.unit())).collect();
    // With five layers, the middle one belongs to one group.
    let layers: Vec<Vec3> = (0..125)
        .map(|k| Vec3::new(f64::from(k % 5), f64::from(k / 5 % 5), f64::from(k / 25)))
        .map(|place| place.add_scalar(0.5) * DIAMETER)
        .collect();
    let inside = Region::Box(Bounds { low: size * 0.1, high: size * 0.9 });
    for (size, places) in [(size, scattered), (Vec3::repeat(5.0 * DIAMETER), layers)] {
        let mut packing = balls(size, false, places);
        packing.header.shapes.push(packing.header.shapes[0].clone());
        packing.header.shapes[1].name = "red".into();
        let upper = |place: &Vec3| u16::from(place.y > 0.45 * size.y);
        packing.particles.shape =
            packing.particles.position.iter().map(|p| ShapeId(upper(p))).collect();
        let (_folder, reader) = stored(&packing);
        let red = Groups::Shape("red".into());
        for groups in [Groups::Half(0), Groups::Half(1), Groups::Half(2), red] {
            let members = Members::of(&groups, &reader).unwrap();
            for side in [2.0, 3.0, 4.0, 5.3, 6.0] {
                for region in [Region::Whole, inside] {
                    let Ok(mixing) = Mixing::of(&reader, &members, region, side * DIAMETER) else {
                        continue;
                    };
                    let index = mixing.index.unwrap();
                    assert!(
                        index.abs() < 1e-12,
                        "seed {SEED}, {groups:?}, {side} d, {region:?}: {index}"
                    );
                }
            }
        }
    }
}

/// Cells are identical in all snapshots: their size follows the particles of the first, and their position the domain.
#[test]
fn cells_of_mixing_stay_where_they_are() {
    let places: Vec<Vec3> = (0..64)
        .map(|k| Vec3::new(f64::from(k % 4), f64::from(k / 4 % 4), f64::from(k / 16)))
        .map(|place| place.add_scalar(0.5) * DIAMETER)
        .collect();
    let first = balls(Vec3::repeat(4.0 * DIAMETER), false, places);
    let (_folder, start) = stored(&first);
    let members = Members::of(&Groups::Half(0), &start).unwrap();
    // Walls that have moved out leave room beyond the domain.
    for (axis, way) in [(0, 2.0), (0, -2.0), (1, 2.0), (2, -4.0), (2, 6.0)] {
        let mut moved = first.clone();
        moved.particles.position.iter_mut().for_each(|place| place[axis] += way * DIAMETER);
        let (_moved, reader) = stored(&moved);
        let mixing = Mixing::of(&reader, &members, Region::Whole, 2.0 * DIAMETER).unwrap();
        assert_eq!((mixing.grains, mixing.cells), (64, 8), "{axis} {way}");
        assert!(mixing.index.unwrap().abs() < 1e-15, "{axis} {way}");
    }
    let mut smaller = first.clone();
    smaller.particles.scale = vec![0.5; 64];
    smaller.header.step = first.header.step + 1;
    smaller.header.time = first.header.time + 1e-3;
    let folder = tempfile::tempdir().unwrap();
    store(folder.path(), &first);
    store(folder.path(), &smaller);
    let mut dem_post = Command::new(env!("CARGO_BIN_EXE_dem-post"));
    let measures = ["--series", "--mixing", "half:x", "--grid", "2d", "--fields", "2d"];
    let made = dem_post.arg(folder.path()).args(measures).output().unwrap();
    assert_eq!(made.status.code(), Some(0), "{made:?}");
    let said = String::from_utf8(made.stdout).unwrap();
    assert!(said.contains("cells, width 0.004000 m"), "{said}");
    let table = std::fs::read_to_string(folder.path().join("post_series/mixing.csv")).unwrap();
    let cells: Vec<_> = table.lines().map(|line| line.split(',').nth(3).unwrap()).collect();
    assert_eq!(cells, ["cells", "8", "8"]);
}

/// Particles that enter after the first snapshot belong to neither half, and the result reports them.
#[test]
fn mixing_says_who_is_left_out() {
    let places: Vec<Vec3> = (0..64)
        .map(|k| Vec3::new(f64::from(k % 4), f64::from(k / 4 % 4), f64::from(k / 16)))
        .map(|place| place.add_scalar(0.5) * DIAMETER)
        .collect();
    let all = balls(Vec3::repeat(4.0 * DIAMETER), false, places.clone());
    let first = balls(Vec3::repeat(4.0 * DIAMETER), false, places[..40].to_vec());
    let mut later = all;
    later.header.step = first.header.step + 1;
    later.header.time = first.header.time + 1e-3;
    let folder = tempfile::tempdir().unwrap();
    store(folder.path(), &first);
    store(folder.path(), &later);
    let mut dem_post = Command::new(env!("CARGO_BIN_EXE_dem-post"));
    let made = dem_post.arg(folder.path()).args(["--series", "--mixing", "half:x", "--grid", "2d"]);
    let made = made.output().unwrap();
    let said = String::from_utf8(made.stdout).unwrap();
    assert!(said.contains("mixing: 24 of 64 particles at "), "{said}");
    let table = std::fs::read_to_string(folder.path().join("post_series/mixing.csv")).unwrap();
    let last: Vec<_> = table.lines().map(|line| line.rsplit(',').next().unwrap()).collect();
    assert_eq!(last, ["left_out", "0", "24"]);
}

/// For particles of many sizes, the diameter is that of a ball of their mean volume.
#[test]
fn a_diameter_is_that_of_the_grains() {
    let mut sized = balls(Vec3::repeat(0.02), false, vec![Vec3::repeat(0.01); 3]);
    sized.particles.scale = vec![0.2, 0.3, 0.4];
    let mean: f64 = (0.008 + 0.027 + 0.064) / 3.0;
    let (_folder, reader) = stored(&sized);
    close(
        Margin::Diameters(2.0).metres(&reader).unwrap(),
        2.0 * DIAMETER * mean.cbrt(),
        1e-14,
        "2d",
    );
}

/// A cone, and a wedge that rises along y, of balls on a lattice under a surface of a known angle.
#[test]
fn the_slope_of_a_cone_is_found() {
    let steep = |degrees: f64, height: &dyn Fn(f64, f64, f64) -> f64| {
        let tangent = degrees.to_radians().tan();
        let mut dice = Random::of(11, 0);
        let mut places = Vec::new();
        for k in 0..61 * 61 * 30 {
            let lattice = Vec3::new(f64::from(k % 61), f64::from(k / 61 % 61), f64::from(k / 3721));
            let place = (lattice + dice.vector(0.3, 0.7)) * (0.5 * DIAMETER);
            if place.z < height(place.x, place.y, tangent) {
                places.push(place);
            }
        }
        balls(Vec3::repeat(0.07), false, places)
    };
    for degrees in [15.0, 25.0, 35.0] {
        let middle = 30.5e-3;
        let cone =
            steep(degrees, &|x, y, tangent| (28e-3 - (x - middle).hypot(y - middle)) * tangent);
        let (_cone, reader) = stored(&cone);
        let slope = Surface::of(&reader, Region::Whole, Direction::Radial).unwrap().slope;
        assert!((slope.angle_degrees - degrees).abs() < 0.7, "{degrees}: {slope:?}");
        let wedge = steep(degrees, &|_, y, tangent| (2e-3 + y).min(0.03) * tangent);
        let (_wedge, reader) = stored(&wedge);
        let slope = Surface::of(&reader, Region::Whole, Direction::Y).unwrap().slope;
        assert!((slope.angle_degrees - degrees).abs() < 0.7, "{degrees}: {slope:?}");
    }
    // A ball in the air beyond the foot does not belong to the surface.
    let cone = steep(25.0, &|x, y, tangent| (28e-3 - (x - 30.5e-3).hypot(y - 30.5e-3)) * tangent);
    let slope_with = |thrown: Option<Vec3>| {
        let places = cone.particles.position.iter().copied().chain(thrown).collect();
        let mut heap = balls(Vec3::repeat(0.07), false, places);
        heap.particles.coordination = vec![3; cone.particles.id.len()];
        heap.particles.coordination.extend(thrown.map(|_| 0));
        Surface::of(&stored(&heap).1, Region::Whole, Direction::Radial).unwrap().slope
    };
    let alone = slope_with(None);
    assert!((alone.angle_degrees - 25.0).abs() < 0.7, "{alone:?}");
    assert_eq!(slope_with(Some(Vec3::new(5e-3, 5e-3, 0.06))), alone);
    // The series begins with a flat surface.
    let folder = tempfile::tempdir().unwrap();
    let flat = balls(Vec3::repeat(0.07), false, vec![Vec3::repeat(0.01)]);
    let mut heap =
        steep(25.0, &|x, y, tangent| (28e-3 - (x - 30.5e-3).hypot(y - 30.5e-3)) * tangent);
    heap.header.step = flat.header.step + 1;
    heap.header.time = flat.header.time + 1e-3;
    let post = || {
        let mut dem_post = Command::new(env!("CARGO_BIN_EXE_dem-post"));
        dem_post.arg(folder.path()).args(["--series", "--slope", "radial"]).output().unwrap()
    };
    store(folder.path(), &flat);
    let refused = post();
    assert_eq!(refused.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("too flat"), "{refused:?}");
    store(folder.path(), &heap);
    let made = post();
    let said = String::from_utf8_lossy(&made.stdout);
    assert!(said.contains("slope: 1 of 2 snapshots are left out"), "{made:?}");
    assert!(said.contains("slope: 25."), "{made:?}");
    // The newest snapshot alone has its angle on the page, above its picture, and in the report.
    let mut dem_post = Command::new(env!("CARGO_BIN_EXE_dem-post"));
    let made = dem_post.arg(folder.path()).args(["--slope", "radial"]).output().unwrap();
    let said = String::from_utf8_lossy(&made.stdout);
    let read = |file| std::fs::read_to_string(folder.path().join("post").join(file)).unwrap();
    let (reports, page) = (read("report.json"), read("index.html"));
    let reports: serde_json::Value = serde_json::from_str(&reports).unwrap();
    let angle = reports[0]["measured"]["slope"]["angle_degrees"].as_f64().unwrap();
    assert!(said.contains(&format!("slope: {angle:.1} degrees")), "{said}");
    let place = |text: &str| page.find(text).unwrap_or_else(|| panic!("no {text}"));
    let row = place(&format!("slope</th><td>{angle:.1}</td><td>degrees</td>"));
    assert!(row < place("id=\"surface\"") && place("id=\"surface\"") < place("id=\"packing\""));
    assert!(page.contains(&format!("\n{angle:.1} degrees\n</text>")), "the line has its angle");
    let mut tilted = balls(Vec3::repeat(0.07), false, vec![Vec3::repeat(0.01)]);
    tilted.header.gravity.x = 1.0;
    let refused = Surface::of(&stored(&tilted).1, Region::Whole, Direction::X).unwrap_err();
    assert!(refused.to_string().contains("along -z"), "{refused}");
}

/// Strips of two columns, one above the line and one below by the same height. Strips between 20 and 80 % of the height lie along the line,
/// the others do not.
#[test]
fn a_slope_is_fitted_between_foot_and_top() {
    let (height, off) = (0.02, 1e-4);
    let shares = [0.0, 0.19, 0.21, 0.355, 0.5, 0.645, 0.79, 0.81, 1.0];
    let places = (0..18_usize).map(|k| {
        let (strip, side) = (k / 2, (k % 2) as f64);
        let z = 5e-3 + height * shares[strip] + off * (2.0 * side - 1.0);
        Vec3::new((strip as f64 + 0.5) * DIAMETER, (side + 0.5) * DIAMETER, z)
    });
    let (_folder, reader) = stored(&balls(Vec3::repeat(0.07), false, places.collect()));
    let slope = Surface::of(&reader, Region::Whole, Direction::X).unwrap().slope;
    assert_eq!(slope.columns, 10);
    close(slope.angle_degrees.to_radians().tan(), 0.145 * height / DIAMETER, 1e-12, "slope");
    close(slope.height_m / height, 1.0, 1e-12, "height");
    close(slope.scatter_m / off, 1.0, 1e-9, "scatter");
}

/// Balls fall in a row at 3 per ms and are removed below, so the flow is known.
#[test]
fn flow_is_counted_through_a_plane() {
    let folder = tempfile::tempdir().unwrap();
    let mut readers = Vec::new();
    for step in 0..10_u32 {
        let heights = (0..40).map(|k| 0.0005 + 0.001 * f64::from(k) - 0.003 * f64::from(step));
        let there: Vec<(u64, f64)> = heights
            .enumerate()
            .map(|(k, z)| (k as u64, z + 0.01))
            .filter(|(_, z)| *z > 0.0)
            .collect();
        let places = there.iter().map(|&(_, z)| Vec3::new(0.01, 0.01, z)).collect();
        let mut snapshot = balls(Vec3::new(0.02, 0.02, 0.06), false, places);
        snapshot.particles.id = there.iter().map(|&(k, _)| GlobalId(k)).collect();
        snapshot.header.next_id = 40;
        snapshot.header.step = 100 * u64::from(step);
        snapshot.header.time = 1e-3 * f64::from(step);
        store(folder.path(), &snapshot);
        readers.push(Reader::open(&folder.path().join("last.vtkhdf")).map_err(MeasureError::from));
    }
    let plane = Plane { axis: 2, at: 0.01, up: false };
    let through = through_plane(readers.into_iter(), plane).unwrap();
    // Balls removed by the outlet were behind the plane.
    assert_eq!((through.new_behind, through.gone_before), (0, 0));
    let rows = through.rows;
    assert_eq!(
        rows.iter().map(|row| row.grains).collect::<Vec<_>>(),
        (0..10).map(|k| 3.0 * f64::from(k)).collect::<Vec<_>>()
    );
    let rate = Rate::of(&rows, Some(Window { from: 2e-3, to: 7e-3 })).unwrap();
    assert_eq!(rate.rows, 6);
    close(rate.grains, 3000.0, 1e-9, "rate");
    close(rate.mass, 0.03, 1e-9, "mass rate");
    let row = |time_s: f64, mass_kg: f64| CumulativeFlow { time_s, grains: 0.0, mass_kg };
    // The halves of an unsteady flow cover all of its time, so their mean is the whole.
    let unsteady: Vec<_> = [0.0, 1.0, 3.0, 9.0, 12.0]
        .into_iter()
        .zip(0..)
        .map(|(mass, k)| row(f64::from(k), mass))
        .collect();
    let [early, late] = Rate::of(&unsteady, None).unwrap().halves.unwrap();
    assert_eq!([early, late], [1.5, 4.5]);
    assert_eq!(Rate::of(&unsteady[..2], None).unwrap().halves, None, "each half needs two rows");
    let back = [row(1.0, 0.0), row(0.0, 1.0), row(0.0, 2.0)];
    assert_eq!(Rate::of(&back, None).unwrap().halves, None, "times that go back");
    assert!(
        Rate::of(&[row(0.0, 0.0)], None).unwrap_err().to_string().contains("1 rows in the window")
    );
}

/// The origin of new particles is unknown, so new ones behind the plane are reported.
#[test]
fn grains_first_seen_behind_a_plane_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let mut readers = Vec::new();
    let (before, behind) = (0.02, 0.005);
    let states: [&[(u64, f64)]; 3] = [
        &[(0, before), (1, behind)],
        &[(0, behind), (1, behind), (2, before), (3, behind), (4, behind)],
        &[(3, behind), (5, before)],
    ];
    for (step, state) in (1_u32..).zip(states) {
        let places = state.iter().map(|&(id, z)| Vec3::new(1e-3 * id as f64, 0.01, z)).collect();
        let mut snapshot = balls(Vec3::new(0.02, 0.02, 0.06), false, places);
        snapshot.particles.id = state.iter().map(|&(id, _)| GlobalId(id)).collect();
        snapshot.header.next_id = 6;
        snapshot.header.step = u64::from(step);
        snapshot.header.time = 1e-3 * f64::from(step);
        store(folder.path(), &snapshot);
        readers.push(Reader::open(&folder.path().join("last.vtkhdf")).map_err(MeasureError::from));
    }
    let plane = Plane { axis: 2, at: 0.01, up: false };
    let through = through_plane(readers.into_iter(), plane).unwrap();
    assert_eq!(through.rows.iter().map(|row| row.grains).collect::<Vec<_>>(), [0.0, 1.0, 2.0]);
    assert_eq!((through.new_behind, through.gone_before), (2, 1));
    let mut dem_post = Command::new(env!("CARGO_BIN_EXE_dem-post"));
    let made =
        dem_post.arg(folder.path()).args(["--series", "--flow", "-z=0.01"]).output().unwrap();
    let said = String::from_utf8(made.stdout).unwrap();
    assert!(
        said.contains("flow: 2 particles were first seen behind the plane and are not counted."),
        "{said}"
    );
    assert!(
        said.contains("1 particles were last seen before the plane and are counted\n"),
        "{said}"
    );
}

/// Errors of the program for impossible measures, and its output for the others.
#[test]
fn the_program_makes_measures_and_refuses_what_is_none() {
    let folder = tempfile::tempdir().unwrap();
    store(folder.path(), &crowd());
    let table = "step,time,left_below,left_below_kg\n0,0,0,0\n1,0.1,5,0.05\n2,0.2,10,0.1\n";
    std::fs::write(folder.path().join("history.csv"), table).unwrap();
    let run = |arguments: &[&str]| {
        let mut dem_post = Command::new(env!("CARGO_BIN_EXE_dem-post"));
        let output = dem_post.arg(folder.path()).args(arguments).output().unwrap();
        let text = |bytes| String::from_utf8(bytes).unwrap();
        (output.status.code(), text(output.stdout), text(output.stderr))
    };
    for (arguments, says) in [
        (&["--fields", "3d"][..], "more than half of the period along x"),
        (&["--fields", "0.5d", "--grid", "1d"], "make --grid smaller"),
        (&["--fields", "0"], "above 0"),
        (&["--fields", "1e-7"], ": make --grid larger"),
        (&["--mixing", "left"], "shape:NAME"),
        (&["--mixing", "shape:red"], "no shape `red`"),
        (&["--mixing", "shape:grain"], "all 300 particles of the region are in one group"),
        (&["--mixing", "half:x", "--region", "0,1e-9,0,1e-9,0,1e-9"], "no "),
        (&["--slope", "x", "--region", "0,1e-9,0,1e-9,0,1e-9"], "no "),
        (&["--flow", "z=0.1"], "-z=0.05"),
        (&["--flow", "-z=0.01"], "z is periodic"),
        (&["--flow", "outlet:up"], "no outlet `up`; it has: below"),
        (&["--flow", "outlet:below", "--window", "0.2,0.1"], "the earlier first"),
        (&["--flow", "outlet:below", "--window", "0.15,0.3"], "1 rows in the window"),
        (&["--window", "0,1"], "nothing to average in the window"),
    ] {
        let (status, _, message) = run(arguments);
        assert_eq!(status, Some(2), "{arguments:?}: {message}");
        assert!(message.contains(says), "{arguments:?}: {message}");
    }
    // An impossible measure does not affect the others.
    let out = folder.path().join("post");
    let _ = std::fs::remove_dir_all(&out);
    let (status, said, message) = run(&["--mixing", "half:x", "--flow", "-z=0.01", "--slope", "x"]);
    assert_eq!(status, Some(2), "{message}");
    assert!(message.contains("z is periodic") && said.contains("mixing: "), "{said}{message}");
    for file in ["mixing.csv", "report.json", "report.csv", "index.html"] {
        assert!(out.join(file).exists(), "{file}");
    }
    let all = ["--fields", "0.5d", "--vtp", "--mixing", "half:x", "--flow", "outlet:below"];
    let (status, said, message) = run(&all);
    assert_eq!(status, Some(0), "{message}");
    assert!(
        said.contains("flow: 50.00 particles/s, 0.5000 kg/s from 0 s to 0.2000 s (3 rows)"),
        "{said}"
    );
    assert!(said.contains("20 x 16 x 18 cells"), "{said}");
    for file in [
        "fields_000001000.vtkhdf",
        "fields_000001000.vti",
        "fields.pvd",
        "fields.vtkhdf.series",
        "mixing.csv",
    ] {
        assert!(out.join(file).exists(), "{file}");
    }
    let lines = |file: &str| std::fs::read_to_string(out.join(file)).unwrap().lines().count();
    assert_eq!((lines("mixing.csv"), lines("flow.csv")), (2, 4));
    assert!(lines("fields_000001000.csv") > 4000);
    assert!(std::fs::read_to_string(out.join("index.html")).unwrap().contains("id=\"flow\""));
}
