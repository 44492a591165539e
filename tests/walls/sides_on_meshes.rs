//! Spherocylinders on walls of triangles: planes with any triangulation, force and moment as the gradient of an energy, identical
//! bits.

use crate::contact::sides::rod;
use crate::support::Frame;
use crate::walls::faces_on_meshes::{
    Lying, above, does_not_feel_the_edges_of_a_plane, is_the_same_in_the_drum, lowered, ragged,
    relief, surface, surfaces,
};
use crate::walls::meshes;
use dem_mpi::contact::Posed;
use dem_mpi::math::{Mat3, Vec3, rotation_about};
use dem_mpi::random::Random;
use dem_mpi::shape::{HalfSpace, Shape};

/// Rods from nearly a ball to a needle.
fn rods() -> [Shape; 4] {
    [rod(0.2, 0.6), rod(1.2, 0.4), rod(1.6, 0.1), rod(2.0, 0.02)]
}

fn plane() -> Shape {
    Shape::HalfSpace(HalfSpace { normal: Vec3::z(), offset: 0.0 })
}

#[test]
fn a_plane_of_triangles_is_the_plane() {
    let plane = plane();
    let mut random = Random::of(20_261_126, 1);
    let (mut worst, mut met) = (0.0_f64, 0);
    for count in [1, 2, 4, 8, 16, 64] {
        let flat = surface(&ragged(count, 8.0, 0.24, |_, _| 0.0));
        for body in &rods() {
            for k in 0..120 {
                let scale = 0.5 + random.unit();
                // A third of the rods is along the borders of squares, a third lies in the plane, a third is random.
                let tilt = libm::pow(10.0, -8.0 * random.unit());
                let frame = match k % 3 {
                    0 => rotation_about(&Vec3::y(), tilt).to_rotation_matrix().into_inner(),
                    1 => {
                        let turn = rotation_about(&Vec3::z(), 3.0 * random.signed());
                        (turn * rotation_about(&Vec3::y(), tilt)).to_rotation_matrix().into_inner()
                    }
                    _ => random.frame(),
                };
                let wall = random.frame();
                let mut lying =
                    Lying { body, frame: wall * frame, wall, scale, centre: Vec3::zeros() };
                let posed = Posed { scale, ..Posed::new(body, &lying.frame) };
                let up = wall * Vec3::z();
                let below = -posed.support(&-up).dot(&up);
                let depth = posed.inscribed_radius() * libm::pow(10.0, -6.0 * random.unit()) * 0.8;
                // Some are over the corner of a square or along its border.
                let mut place = Vec3::new(random.signed(), random.signed(), below - depth);
                if k % 4 == 0 {
                    place.y = 0.0;
                }
                lying.centre = wall * place;
                worst = worst.max(lying.off_the_plane(&flat, &plane, [count, k]));
                met += 1;
            }
        }
    }
    assert_eq!(met, 2880);
    println!("worst {worst:.1e}");
    assert!(worst < 1e-12, "{worst:e}");
}

#[test]
fn force_and_moment_are_the_gradient_of_the_energy() {
    let mut random = Random::of(20_261_126, 2);
    for (name, triangles) in surfaces() {
        let surface = surface(&triangles);
        let (mut worst, mut met, mut several) = (0.0_f64, 0, 0);
        for body in &rods() {
            let size = Posed::new(body, &Mat3::identity()).inscribed_radius();
            for _ in 0..60 {
                let depth = size * libm::pow(10.0, -1.5 * random.unit()) * 0.1;
                let lying = lowered(body, &surface, &mut random, (above(name), depth));
                let Some(lying) = lying else { continue };
                worst = worst.max(lying.error_of_gradient(&surface));
                met += 1;
                several += usize::from(lying.on(&surface).len() > 1);
            }
        }
        println!("{name}: {met} poses, {several} of several contacts, worst {worst:.1e}");
        assert!(met > 100, "{name}: only {met}");
        assert!(worst < 1e-6, "{name}: {worst:e}");
    }
}

#[test]
fn a_rod_does_not_feel_the_edges_of_a_plane() {
    does_not_feel_the_edges_of_a_plane(meshes::ROD);
}

/// Rods that tumble in the drum of the ready scene.
#[test]
fn a_drum_of_rods_is_the_same_on_any_number_of_ranks_and_after_a_restart() {
    is_the_same_in_the_drum([
        "kind = \"spherocylinder\"\nlength = 2e-3\nradius = 1e-3",
        "kind = \"spherocylinder\"\nlength = 1e-3\nradius = 1.2e-3",
    ]);
}

/// A rod across a sharp ridge: `δ` is a parabola, like for crossed rods.
#[test]
fn a_rod_crosses_a_ridge_in_closed_form() {
    let slope = libm::tan(1.2);
    let ridge = surface(&relief(8, 8.0, |x, _| -slope * x.abs()));
    let (body, depth) = (rod(2.0, 0.4), 1e-4);
    for turn in [0.0, 0.5, 1.0] {
        let frame = rotation_about(&Vec3::z(), turn).to_rotation_matrix().into_inner();
        let centre = Vec3::new(0.2, 0.1, 0.4 - depth);
        let lying = Lying { body: &body, frame, wall: Mat3::identity(), scale: 1.0, centre };
        let found = lying.on(&ridge);
        let [(_, found)] = &found[..] else { panic!("{} contacts", found.len()) };
        let squared = 24.0 / 35.0 * depth * depth;
        assert!((found.thickness.powi(2) / squared - 1.0).abs() < 1e-3, "{turn}: {found:?}");
        let force = 24.0 / 35.0 * depth;
        assert!((found.force() + Vec3::z() * force).norm() < 1e-3 * depth, "{turn}: {found:?}");
        // The point at which the axis crosses the ridge.
        let place = Vec3::new(-0.2, -0.2 * libm::tan(turn), found.point.z);
        assert!((found.point - place).norm() < 1e-6, "{turn}: {found:?}");
    }
}

/// A plate with square holes: rods are pushed over it and rotated, through all positions of their axes, and the energy has no jump.
#[test]
fn energy_has_no_jump_over_holes_and_folds() {
    let mut random = Random::of(20_261_126, 3);
    let wave = |x: f64, y: f64| 0.01 * libm::cos(9.0 * x) * libm::cos(7.0 * y);
    let whole = relief(24, 4.8, |_, _| 0.0);
    let is_hole = |t: &[Vec3; 3]| {
        let middle = (t[0] + t[1] + t[2]) / 3.0;
        [middle.x, middle.y].iter().all(|x| (x / 0.2 + 100.0).floor() as i64 % 3 == 0)
    };
    let plate: meshes::Triangles = whole.into_iter().filter(|t| !is_hole(t)).collect();
    for (name, triangles) in [("plate with holes", plate), ("folds", ragged(24, 4.8, 0.24, wave))] {
        let surface = surface(&triangles);
        let (mut worst, mut met) = (0.0_f64, 0);
        for body in &[rod(1.6, 0.1), rod(0.8, 0.3)] {
            let size = Posed::new(body, &Mat3::identity()).inscribed_radius();
            for _ in 0..60 {
                let frame = (rotation_about(&Vec3::z(), 3.0 * random.signed())
                    * rotation_about(&Vec3::y(), 2e-3 * random.signed()))
                .to_rotation_matrix()
                .into_inner();
                let top = if name == "folds" { 0.009 } else { 0.0 };
                let height = top + size * (1.0 - 5e-3 * (0.2 + random.unit()));
                let centre = Vec3::new(0.6 * random.signed(), 0.6 * random.signed(), height);
                let lying = Lying { body, frame, wall: Mat3::identity(), scale: 1.0, centre };
                let way = rotation_about(&Vec3::z(), 3.0 * random.signed()) * Vec3::x() * 0.4;
                let energy = |part: f64| {
                    lying.moved(way * part).turned(&Vec3::z(), 0.5 * part).energy(&surface)
                };
                // Refines repeatedly the step in which the energy changes most.
                let (mut from, mut step, mut change) = (0.0, 1.0, 0.0);
                while step > 1e-9 {
                    step /= 400.0;
                    let all: Vec<f64> =
                        (0..=400).map(|k| energy(from + step * f64::from(k))).collect();
                    let of = |k: usize| (all[k + 1] - all[k]).abs();
                    let most = (0..400).max_by(|&k, &l| of(k).total_cmp(&of(l))).unwrap();
                    change = of(most);
                    from += step * most as f64;
                }
                worst = worst.max(change / lying.energy(&surface).max(energy(from)).max(1e-9));
                met += 1;
            }
        }
        println!("{name}: {met} ways, jumps of {worst:.1e} of the energy");
        assert!(worst < 1e-5, "{name}: {worst:e}");
    }
}
