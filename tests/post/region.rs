//! Bodies and regions: extents, volumes, silhouettes, strains.

use super::stress::lattice_case;
use super::{ROUNDING, arrays, close, number};
use crate::support::packings::{
    Snapshot, boxed, closed, ellipsoids, header, particles_at, plane_row, store,
};
use crate::support::random::Draw;
use dem_mpi::cell::Cell;
use dem_mpi::math::{Quat, Vec3};
use dem_mpi::output::header::{Header, WallRow};
use dem_mpi::output::snapshot::Reader;
use dem_mpi::output::tables::{ContactTable, ParticleTable};
use dem_mpi::post::region::{Bounds, Extent, Margin, Region, SampledSolid, Strain};
use dem_mpi::post::surface::Detail;
use dem_mpi::post::{Settings, export, inside, plots, series};
use dem_mpi::random::Random;
use dem_mpi::shape::{
    Ellipsoid, Kind, PolySuperellipsoid, Polyhedron, RoundedPolyhedron, Shape, Sphere,
    Spherocylinder, Superellipsoid, TriangleMesh,
};
use dem_mpi::walls::Wall;
use nalgebra::Quaternion;
use std::f64::consts::PI;

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
    // The innermost wall across an axis bounds the box; a period takes precedence over walls.
    for (z, up) in [(3.2, 1.0), (3.5, 1.0), (3.0, 1.0), (6.5, -1.0)] {
        header.walls.push(plane_row(format!("wall at {z}"), Vec3::z() * z, Vec3::z() * up));
    }
    // A wall of several planes bounds nothing.
    let planes = [(Vec3::z() * 3.9, Vec3::z()), (Vec3::x() * 2.0, Vec3::x())];
    let drum = Wall::of_planes("drum".to_owned(), Vec3::zeros(), &planes);
    let (point, normal) = drum.surface();
    assert_eq!((point.z, normal), (3.9, Vec3::z()));
    let zeros = Vec3::zeros();
    let (name, body) = (drum.name.clone(), drum.saved());
    header.walls.push(WallRow { name, point, normal, velocity: zeros, force: zeros, body });
    header.cell = Cell::new(header.cell.corners().0, header.cell.corners().1, [true, false, false]);
    let found = extent.finish(&header).unwrap();
    assert_eq!((found.low.z, found.high.z), (3.5, 6.5));
    assert_eq!((found.low.x, found.high.x), (0.0, 9.0));
    assert_eq!(Extent::default().finish(&Header { walls: Vec::new(), ..header }), None);
}

/// One body of each kind, about 1 m in size.
fn bodies() -> Vec<Shape> {
    let (long, short) = (Vec3::new(1.0, 0.7, 0.5), Vec3::new(0.6, 0.8, 0.9));
    let mut dice = Random::of(11, 0);
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

/// Corners of a box about the origin.
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

/// The surface of a body from `--surfaces`. Its polygons are counter-clockwise from outside and enclose the body's volume except for the parts
/// that triangles cut off. Normals point outwards, and all points are the support points along their normals.
#[test]
fn surfaces_face_outwards_and_lie_on_the_body() {
    let mut dice = Random::of(13, 0);
    for body in bodies() {
        let turn = Quat::from_scaled_axis(dice.vector(-2.0, 2.0));
        let [x, y, z, w]: [f64; 4] = turn.coords.into();
        let (header, mut particles) = snapshot_of(&body, [w, x, y, z], 9.0);
        let centre = Vec3::new(1.0, -2.0, 3.0);
        particles.position = vec![centre];
        let folder = tempfile::tempdir().unwrap();
        let contacts = ContactTable::default();
        store(folder.path(), &Snapshot { header, particles, contacts });
        let reader = Reader::open(&folder.path().join("last.vtkhdf")).unwrap();
        let mut file = Vec::new();
        export::grains(&reader, Detail::default()).unwrap().write(&mut file).unwrap();
        let vectors = |name: &str| -> Vec<Vec3> {
            let numbers = arrays::<f32>(&file)(name);
            numbers.chunks(3).map(|row| Vec3::from_fn(|k, _| f64::from(row[k]))).collect()
        };
        let (points, normals) = (vectors("Points"), vectors("Normals"));
        for (point, normal) in points.iter().zip(&normals) {
            let end = centre + turn * body.support(&(turn.inverse() * normal));
            // Single precision; a face ends in all of its points.
            let off = (point - end).dot(normal).abs();
            assert!(off < 1e-5, "{off:e} m: {body:?}");
        }
        let (members, ends) =
            (arrays::<i32>(&file)("connectivity"), arrays::<i32>(&file)("offsets"));
        let (mut first, mut volume) = (0, 0.0);
        for end in ends {
            let polygon: Vec<usize> =
                members[first..end as usize].iter().map(|&k| k as usize).collect();
            first = end as usize;
            for k in 1..polygon.len() - 1 {
                let corners = [polygon[0], polygon[k], polygon[k + 1]];
                let [a, b, c] = corners.map(|k| points[k] - centre);
                let area = (b - a).cross(&(c - a));
                // At sharp edges normals differ from those of polygons; with reversed orientation they would be opposite.
                let most = 0.5 * area.norm() + 1e-6;
                assert!(corners.iter().all(|&k| normals[k].dot(&area) > -most), "{body:?}");
                volume += a.dot(&area) / 6.0;
            }
        }
        let part = volume / body.volume();
        assert!((0.5..1.0 + 1e-5).contains(&part), "{part}: {body:?}");
    }
}

#[test]
fn bodies_contain_what_is_below_their_surface() {
    let mut dice = Random::of(12, 0);
    for body in bodies() {
        for _ in 0..500 {
            let direction = dice.direction();
            let end = body.support(&direction);
            assert!(body.contains(&(end * (1.0 - 1e-9))), "{direction} {body:?}");
            assert!(!body.contains(&(end + direction * 1e-9)), "{direction} {body:?}");
        }
    }
}

/// Volume within a region against closed forms: a whole body, and the half of one that a plane through its centre cuts.
#[test]
fn volumes_of_bodies_in_a_region() {
    let mut dice = Random::of(13, 0);
    let side = 1.7;
    let whole = Bounds { low: Vec3::repeat(-side), high: Vec3::repeat(side) };
    let half = Bounds { low: Vec3::new(0.0, -side, -side), high: Vec3::repeat(side) };
    let (mut largest, mut halves) = (0.0_f64, 0);
    for body in bodies() {
        let turn = dice.direction() * dice.unit();
        let orientation = [(1.0 - turn.norm_squared()).sqrt(), turn.x, turn.y, turn.z];
        let (header, particles) = snapshot_of(&body, orientation, side);
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
    // A box cut by a plane across its edges keeps the rest of one edge times the face.
    let half = Vec3::new(1.0, 0.5, 0.25);
    let body = Shape::Polyhedron(Box::new(Polyhedron::new(&box_of(&half)).unwrap()));
    let axis = (0..3).find(|&k| (body.half_lengths()[k] - 1.0).abs() < 1e-12).unwrap();
    let (header, particles) = snapshot_of(&body, [1.0, 0.0, 0.0, 0.0], side);
    let mut bounds = whole;
    bounds.low[axis] = 0.3;
    let mut sampled = SampledSolid::new(bounds);
    sampled.add(&header, &particles);
    let error = sampled.finish() * bounds.volume() / (0.7 * 1.0 * 0.5) - 1.0;
    // Errors of up to half a cell at each of five faces.
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
    let orientation = [half_turn.cos(), 0.0, half_turn.sin(), 0.0];
    let (header, particles) = snapshot_of(&body, orientation, 2.0);
    let mut extent = Extent::default();
    extent.add(&header, &particles);
    let found = extent.finish(&header).unwrap();
    let half = Vec3::new(2.0_f64.sqrt(), 1.0, 2.0_f64.sqrt());
    assert!((found.high - half).amax() < ROUNDING && (found.low + half).amax() < ROUNDING);
    // Its silhouette is a square that stands on a corner.
    let snapshot = Snapshot { header, particles, contacts: ContactTable::default() };
    let svg = snapshot.analyse(Settings::default()).unwrap().picture.svg(None);
    let path = r#"d="M732 372l-360 -360 -360 360 360 360z""#;
    assert!(svg.contains(path), "{svg}");
}

/// A cube seen from the front, rotated about z, and with a corner to the front shows one, two and three faces. They cover its silhouette, which
/// is exact to a hundredth.
#[test]
fn faces_that_are_seen_cover_the_silhouette() {
    let body = Shape::Polyhedron(Box::new(Polyhedron::new(&box_of(&Vec3::repeat(1.0))).unwrap()));
    let frame = Bounds { low: Vec3::repeat(-2.0), high: Vec3::repeat(2.0) };
    let about_z = Quat::from_axis_angle(&Vec3::z_axis(), 0.6);
    let corner = Quat::from_axis_angle(&Vec3::x_axis(), 0.5) * about_z;
    for (turn, seen) in [(Quat::identity(), 1), (about_z, 2), (corner, 3)] {
        let (header, particles) = snapshot_of(&body, [turn.w, turn.i, turn.j, turn.k], 1.0);
        let snapshot = Snapshot { header, particles, contacts: ContactTable::default() };
        let svg = snapshot.analyse(Settings::default()).unwrap().picture.svg(Some(&frame));
        let areas: Vec<f64> = svg.split(r#"d="M"#).skip(1).map(area_of).collect();
        assert_eq!(areas.len(), 1 + seen, "{svg}");
        let faces: f64 = areas[1..].iter().sum();
        assert!((faces / areas[0] - 1.0).abs() < 0.02, "{areas:?}");
    }
}

/// Twice the area of a drawn path [px²].
fn area_of(path: &str) -> f64 {
    let (path, _) = path.split_once('z').unwrap();
    let numbers: Vec<f64> = path.split([' ', 'l']).map(|n| n.parse().unwrap()).collect();
    let mut here = [0.0; 2];
    let mut area = 0.0;
    for step in numbers[2..].chunks(2) {
        area += here[0] * step[1] - here[1] * step[0];
        here = [here[0] + step[0], here[1] + step[1]];
    }
    area.abs()
}

/// All corners of a drawn silhouette are inside the body's silhouette, which extends at most a hundredth of the size beyond them.
#[test]
fn silhouettes_are_those_of_the_bodies() {
    let mut dice = Random::of(14, 0);
    let frame = Bounds { low: Vec3::repeat(-2.0), high: Vec3::repeat(2.0) };
    // Pixels per metre, and pixel position of the centre.
    let (scale, middle) = (180.0, 372.0);
    let mut corners = 0;
    let mut drawn = 0;
    for body in bodies() {
        let turn = dice.direction() * dice.unit();
        let orientation = [(1.0 - turn.norm_squared()).sqrt(), turn.x, turn.y, turn.z];
        let (header, particles) = snapshot_of(&body, orientation, 1.0);
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
        let [w, x, y, z] = orientation;
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
            // Corners are rounded to tenths of pixels.
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
    // The region is the whole period, so periodic images must count.
    let bounds =
        Bounds { low: snapshot.header.cell.corners().0, high: snapshot.header.cell.corners().1 };
    let mut sampled = SampledSolid::new(bounds);
    sampled.add(&snapshot.header, &snapshot.particles);
    // The difference is the sampling error, and lenses of overlap that the exact sum counts twice.
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

/// Without a wall or a period at its end, a packing has no strain from a particle that is thrown up.
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

    // A packing between a floor and a lid, first without sides, then with periods.
    let between = |mut snapshot: Snapshot, periodic: bool| {
        snapshot.header.walls.retain(|wall| wall.normal.z != 0.0);
        let cell = snapshot.header.cell;
        snapshot.header.cell =
            Cell::new(cell.corners().0, cell.corners().1, [periodic, periodic, false]);
        snapshot
    };
    let plates =
        |periodic| both(&between(closed(0.02), periodic), &between(closed(0.019), periodic));
    assert_eq!(plates(false).0, (true, false));
    assert_eq!(plates(true).0, (true, true));
}

/// Adds a wall to the header, with its triangles if it has some.
pub(super) fn add_wall(header: &mut Header, wall: &Wall) {
    let (point, normal) = wall.surface();
    let (velocity, force) = (Vec3::zeros(), Vec3::zeros());
    let (name, body) = (wall.name.clone(), wall.saved());
    header.walls.push(WallRow { name, point, normal, velocity, force, body });
    let triangles = wall.mesh.iter().flat_map(|mesh| mesh.surface.triangles());
    header.triangles.extend(triangles.map(|t| std::array::from_fn(|k| t[k / 3][k % 3])));
}

fn pipe(from: Vec3, radius: f64) -> Wall {
    let surface = TriangleMesh::of_revolution(&from, &(from + Vec3::z() * 0.05), [radius; 2]);
    Wall::of_mesh("pipe".to_owned(), Vec3::zeros(), surface)
}

/// Boundaries of the packing's box other than periods and planes across axes give a warning.
#[test]
fn a_box_that_no_plane_ends_is_doubtful() {
    let doubts = |snapshot: &Snapshot| snapshot.report().doubts;
    let (low, high) = (Vec3::repeat(-0.01), Vec3::new(0.01, 0.01, 0.05));
    let mut ball = Snapshot {
        header: header(low, high, false, Vec3::repeat(1e-3), 1),
        particles: particles_at(vec![Vec3::zeros()]),
        contacts: ContactTable::default(),
    };
    add_wall(&mut ball.header, &pipe(Vec3::zeros(), 0.01));
    let told = doubts(&ball);
    assert_eq!(told.len(), 2, "{told:?}");
    assert!(told[0].contains("towards -x, +x, -y, +y, -z, +z the box"), "{told:?}");
    assert!(
        told[1].starts_with("wall \"pipe\" is not a plane across an axis and limits"),
        "{told:?}"
    );
    let volume = ball.report().summary.volume_m3.unwrap();
    close(volume / 8e-9, 1.0, ROUNDING, "the box about the ball");
    ball.header.cell = Cell::new(low, high, [true; 3]);
    ball.header.walls.clear();
    assert_eq!(doubts(&ball), Vec::<String>::new());

    // One particle in the air makes the box of an open packing higher.
    let open = ellipsoids(3, 9);
    let mut thrown = open.clone();
    thrown.particles.position[26].z += 0.01;
    let volume = |snapshot: &Snapshot| snapshot.report().summary.volume_m3.unwrap();
    assert!(volume(&thrown) > 1.5 * volume(&open));
    for snapshot in [&open, &thrown] {
        let told = doubts(snapshot);
        assert!(matches!(&told[..], [one] if one.contains("towards +z the box")), "{told:?}");
    }

    // In a closed box, walls that enter it are reported; for a region, walls that enter the region.
    let closed = boxed(0.02, 1);
    assert_eq!(doubts(&closed), Vec::<String>::new());
    let slope = |x: f64| {
        let normal = Vec3::new(0.6, 0.0, 0.8);
        Wall::plane("slope".to_owned(), Vec3::x() * x, normal)
    };
    let corner = [(Vec3::z() * 1e-3, Vec3::z()), (Vec3::x() * 1e-3, Vec3::x())];
    let corner = Wall::of_planes("corner".to_owned(), Vec3::zeros(), &corner);
    for (wall, is_in) in [
        (pipe(Vec3::new(0.0065, 0.0065, 0.0), 0.0065), true),
        (pipe(Vec3::new(0.0065, 0.0065, 0.02), 0.0065), false),
        (pipe(Vec3::new(1.0, 0.0, 0.0), 0.0065), false),
        (slope(1e-3), true),
        (slope(-1e-3), false),
        (corner, true),
    ] {
        let mut walled = closed.clone();
        add_wall(&mut walled.header, &wall);
        let told = doubts(&walled);
        let is_told = told.iter().any(|told| told.contains(&format!("wall \"{}\" is", wall.name)));
        assert_eq!((told.len(), is_told), (usize::from(is_in), is_in), "{} {told:?}", wall.name);
    }
    let mut walled = closed;
    for wall in &[slope(1e-3), pipe(Vec3::new(0.0065, 0.0065, 0.0), 0.002)] {
        add_wall(&mut walled.header, wall);
    }
    assert!(doubts(&walled)[0].starts_with("walls \"slope\", \"pipe\" are not planes"));
    let of_region = |low: Vec3| {
        let bounds = Bounds { low, high: low + Vec3::repeat(4e-3) };
        let settings = Settings { region: Region::Box(bounds), ..Settings::default() };
        walled.analyse(settings).unwrap().report.doubts
    };
    assert_eq!(of_region(Vec3::new(0.0088, 0.0088, 0.003)), Vec::<String>::new());
    let told = of_region(Vec3::new(0.005, 0.005, 0.003));
    assert!(matches!(&told[..], [one] if one.starts_with("wall \"pipe\" is")), "{told:?}");
}

#[test]
fn a_margin_follows_the_walls_and_strains_stay_those_of_the_whole() {
    let folder = tempfile::tempdir().unwrap();
    // Beyond the lid is another one.
    let boxed = |height: f64, step| {
        let mut snapshot = boxed(height, step);
        let beyond = plane_row("beyond", Vec3::z() * (1.5 * height), -Vec3::z());
        snapshot.header.walls.push(beyond);
        snapshot
    };
    for (step, height) in [(1, 0.02), (2, 0.018)] {
        store(folder.path(), &boxed(height, step));
    }
    let files = series::all(folder.path()).unwrap();
    assert_eq!(files.len(), 2);
    let choice =
        series::Choice { margin: Some("0.001".parse().unwrap()), ..series::Choice::default() };
    let analysed = series::reports(&series::open(&files).unwrap(), &choice).unwrap();
    let reports = analysed.reports;
    let side = 5.0 * 2.6e-3;
    for (report, height) in reports.iter().zip([0.02, 0.018]) {
        let Bounds { low, high } = report.bounds_m.unwrap();
        assert!((low - Vec3::repeat(1e-3)).amax() < 1e-15, "{low}");
        let expected = Vec3::new(side - 1e-3, side - 1e-3, height - 1e-3);
        assert!((high - expected).amax() < 1e-15, "{high}");
        assert!(report.summary.particles < 125);
    }
    // A snapshot with nothing left inside the margin is left out, except the last.
    for (step, height) in [(0, 0.0019), (3, 0.0019)] {
        store(folder.path(), &boxed(height, step));
        let files = series::all(folder.path()).unwrap();
        let analysed = series::reports(&series::open(&files).unwrap(), &choice);
        if step == 0 {
            let analysed = analysed.unwrap();
            assert_eq!(analysed.reports.len(), 2);
            let times: Vec<&str> = analysed.earlier.iter().map(|one| one.0.as_str()).collect();
            assert_eq!(times.len(), 1, "the other one is the last: {times:?}");
            let told = "reports: 1 of 3 snapshots are left out";
            let left_out = analysed.left_out.unwrap();
            assert!(left_out.starts_with(told), "{left_out}");
        } else {
            let error = analysed.unwrap_err().to_string();
            assert!(error.contains("no length along z"), "{error}");
        }
    }
    let strain = reports[1].summary.axial_strain.unwrap();
    assert!((strain - (0.02_f64 / 0.018).ln()).abs() < 1e-12, "{strain}");

    // The diameter is that of the ball of equal volume.
    let reader = Reader::open(&files[0]).unwrap();
    let region = inside(&reader, Margin::Diameters(0.5)).unwrap();
    let Region::Box(bounds) = region else { panic!("{region:?}") };
    let semi_axes = reader.header().shapes[0].semi_axes;
    assert!((bounds.low.x - semi_axes.product().cbrt()).abs() < 1e-12, "{bounds:?}");
    let error = inside(&reader, Margin::Metres(1.0)).unwrap_err().to_string();
    assert!(error.contains("the region has no length along x"), "{error}");
    assert!("1.5d".parse() == Ok(Margin::Diameters(1.5)) && "-1".parse::<Margin>().is_err());
}
