//! Volume, centre and inertia of bodies of several pieces.

use crate::support::close;
use benchmarking::solids;
use dem_mpi::math::{Quat, Vec3, rotation_about};
use dem_mpi::shape::union::Piece;
use dem_mpi::shape::{Convex as _, Ellipsoid, Polyhedron, Shape, Sphere, Union};
use std::f64::consts::PI;
use std::fmt::Write as _;

/// An upright piece at a position.
pub(crate) fn piece(shape: &Shape, at: [f64; 3]) -> Piece {
    Piece { shape: shape.clone(), centre: Vec3::from(at), rotation: Quat::identity() }
}

pub(crate) fn ball(radius: f64) -> Shape {
    Shape::Sphere(Sphere { radius })
}

/// Unit cubes at these positions.
pub(crate) fn cubes(places: &[[f64; 3]]) -> Union {
    let corners = solids::cuboid(Vec3::repeat(1.0));
    let cube = Shape::Polyhedron(Box::new(Polyhedron::new(&corners).expect("a cube")));
    Union::new(places.iter().map(|&at| piece(&cube, at)).collect()).expect("a body")
}

/// OBJ text of the surface of unit cubes at these positions, without the squares that two cubes
/// share.
pub(crate) fn obj_of_cubes(places: &[[f64; 3]]) -> String {
    let mut obj = String::new();
    let mut corners = 0;
    for at in places {
        for axis in 0..3 {
            for sign in [-1.0, 1.0] {
                let mut beside = *at;
                beside[axis] += sign;
                if places.contains(&beside) {
                    continue;
                }
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                for [p, q] in [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]] {
                    let mut corner = *at;
                    corner[axis] += 0.5 * sign;
                    corner[u] += p * sign;
                    corner[v] += q;
                    let [x, y, z] = corner;
                    writeln!(obj, "v {x} {y} {z}").unwrap();
                }
                let [a, b, c, d] = [1, 2, 3, 4].map(|k| corners + k);
                writeln!(obj, "f {a} {b} {c}\nf {a} {c} {d}").unwrap();
                corners += 4;
            }
        }
    }
    obj
}

pub(crate) const ELL: [[f64; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
pub(crate) const JACK: [[f64; 3]; 7] = [
    [0.0, 0.0, 0.0],
    [1.0, 0.0, 0.0],
    [-1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, -1.0, 0.0],
    [0.0, 0.0, 1.0],
    [0.0, 0.0, -1.0],
];

pub(crate) fn has(body: &Union, volume: f64, mut moments: [f64; 3], tolerance: f64, name: &str) {
    close(body.volume(), volume, tolerance, name);
    let mut found: [f64; 3] = (body.gyration() * body.volume()).into();
    found.sort_by(f64::total_cmp);
    moments.sort_by(f64::total_cmp);
    for (found, moment) in found.into_iter().zip(moments) {
        close(found, moment, tolerance, name);
    }
}

/// Closed forms of unions of unit cubes.
#[test]
fn blocks_of_cubes_have_their_moments() {
    let tee = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let corner = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    has(&cubes(&ELL), 3.0, [5.0 / 6.0, 1.5, 11.0 / 6.0], 1e-12, "L");
    has(&cubes(&tee), 4.0, [17.0 / 12.0, 8.0 / 3.0, 41.0 / 12.0], 1e-12, "T");
    has(&cubes(&corner), 4.0, [23.0 / 12.0, 23.0 / 12.0, 8.0 / 3.0], 1e-12, "corner");
    has(&cubes(&JACK), 7.0, [31.0 / 6.0; 3], 1e-12, "jack");
    let centre = cubes(&ELL).placement().expect("axes").centre;
    assert!((centre - Vec3::new(1.0 / 3.0, 1.0 / 3.0, 0.0)).norm() < 1e-14);
    // Far from the origin of its file.
    let far = ELL.map(|at| at.map(|x| x + 1e3));
    has(&cubes(&far), 3.0, [5.0 / 6.0, 1.5, 11.0 / 6.0], 1e-12, "L far away");
}

/// Common parts of pieces count once: two cubes that overlap by half, and three that share a corner.
#[test]
fn overlaps_of_polyhedra_count_once() {
    let two = cubes(&[[0.0; 3], [0.5, 0.0, 0.0]]);
    let moment = |a: f64, b: f64| 1.5 * (a * a + b * b) / 12.0;
    let across = moment(1.5, 1.0);
    has(&two, 1.5, [moment(1.0, 1.0), across, across], 1e-12, "bar of two");
    assert_eq!(two.error(), 0.0);
    // A bar of 1.5 by 1.5 by 1 without the quarter cube at its corner.
    let three = cubes(&[[0.0; 3], [0.5, 0.0, 0.0], [0.0, 0.5, 0.0]]);
    close(three.volume(), 1.5 * 1.5 - 0.25, 1e-12, "three that overlap");
    let turned = rotation_about(&Vec3::z(), 0.25 * PI);
    let cube = cubes(&[[0.0; 3]]).pieces()[0].shape.clone();
    let star = vec![piece(&cube, [0.0; 3]), Piece { rotation: turned, ..piece(&cube, [0.0; 3]) }];
    // A square and one rotated by 45 degrees share an octagon of area 2√2 - 2.
    let star = Union::new(star).expect("a body");
    close(star.volume(), 4.0 - 2.0 * 2.0_f64.sqrt(), 1e-12, "star");
}

#[test]
fn two_balls_have_their_lens_once() {
    let pair = |apart: f64| {
        Union::new(vec![piece(&ball(1.0), [0.0; 3]), piece(&ball(1.0), [apart, 0.0, 0.0])])
    };
    let one = pair(1.0).expect("a body");
    has(&one, 2.25 * PI, [3.004_148, 5.213_080, 5.213_080], 1e-6, "1 apart");
    let half = pair(0.5).expect("a body");
    close(half.volume(), 5.726_862, 1e-6, "0.5 apart");
    has(&half, half.volume(), [2.428_803, 3.131_877, 3.131_877], 1e-6, "0.5 apart");
    assert_eq!(one.error(), 0.0);
    // Balls of two sizes at a distance at which they only touch.
    let unlike = vec![piece(&ball(1.0), [0.0; 3]), piece(&ball(0.5), [1.5, 0.0, 0.0])];
    let unlike = Union::new(unlike).expect("a body");
    close(unlike.volume(), 4.0 / 3.0 * PI * 1.125, 1e-14, "that touch");
    let mistake = Union::new(vec![piece(&ball(1.0), [0.0; 3]), piece(&ball(0.4), [0.5, 0.0, 0.0])]);
    assert!(mistake.unwrap_err().to_string().contains("piece 2 is within piece 1"));
}

/// Volumes from lines through a grid agree with closed forms within their reported error.
#[test]
fn other_overlaps_tell_their_error() {
    let egg = Shape::Ellipsoid(Ellipsoid { semi_axes: Vec3::new(1.0, 1.0, 1.0) });
    let pieces = vec![piece(&egg, [0.0; 3]), piece(&ball(1.0), [1.0, 0.0, 0.0])];
    let body = Union::new(pieces).expect("a body");
    assert!(body.error() > 0.0 && body.error() < 1e-4, "{:e}", body.error());
    close(body.volume(), 2.25 * PI, 2.0 * body.error(), "by lines");
    has(&body, body.volume(), [3.004_148, 5.213_080, 5.213_080], 1e-4, "by lines");
}

/// Pieces of a box count as one everywhere; arms of an L do not.
#[test]
fn pieces_are_one_where_nothing_is_between_them() {
    let row = cubes(&[[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]);
    assert_eq!(row.oneness(0, 2), 1.0);
    let ell = cubes(&ELL);
    assert_eq!((ell.oneness(0, 1), ell.oneness(0, 2), ell.oneness(1, 2)), (1.0, 1.0, 0.0));
    let block: Vec<[f64; 3]> = (0..8).map(|k| [k & 1, k >> 1 & 1, k >> 2].map(f64::from)).collect();
    let block = cubes(&block);
    assert!((0..8).all(|i| (0..8).all(|j| block.oneness(i, j) == 1.0)));
    let jack = cubes(&JACK);
    assert_eq!((jack.oneness(1, 2), jack.oneness(1, 3), jack.oneness(0, 5)), (1.0, 0.0, 1.0));
}
