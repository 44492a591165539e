//! Volume, centre of mass and inertia of the points in any of several pieces.
//!
//! | pieces | |
//! |---|---|
//! | disjoint | sum, exact |
//! | polyhedra | by inclusion and exclusion of their shared volumes, exact ([`crate::shape::clip`]) |
//! | balls, no three of which overlap | less the lens of each two, exact |
//! | others that overlap | along lines in a grid, exact along each; the error is the change from half the number of lines |

use super::{Piece, UnionError};
use crate::math::{Mat3, Vec3, bounds};
use crate::shape::clip::{Clipped, inside};
use crate::shape::facets::Plane;
use crate::shape::moments::{Moments, Principal};
use crate::shape::{Ellipsoid, Shape};
use std::f64::consts::PI;

/// A volume shared by two polyhedra counts as none below this part of the smaller one.
const SLIVER: f64 = 1e-12;
/// Lines along each side of the grid.
const LINES: usize = 256;
/// Samples of a line for its entry into a body without a closed form.
const LOOKS: usize = 64;

/// Moments of the body, and the relative error of the volume.
pub(super) fn of(pieces: &[Piece]) -> Result<(Principal, f64), UnionError> {
    let origin = pieces.iter().map(|piece| piece.centre).sum::<Vec3>() / pieces.len() as f64;
    let mut sum = Moments::none(origin);
    for piece in pieces {
        sum.add(&of_piece(piece, &origin), 1.0);
    }
    let touching = near_pairs(pieces);
    let error = if touching.is_empty() {
        0.0
    } else if pieces.iter().all(|piece| has_corners(&piece.shape)) {
        less_shared_by_polyhedra(pieces, &mut sum)?;
        0.0
    } else if let Some(balls) = balls_in_twos(pieces, &touching) {
        for [one, other] in balls {
            sum.add(&lens(pieces, [one, other], &origin)?, -1.0);
        }
        0.0
    } else {
        let coarse = along_lines(pieces, &origin, LINES / 2);
        sum = along_lines(pieces, &origin, LINES);
        (coarse.volume / sum.volume - 1.0).abs()
    };
    Ok((sum.principal(), error))
}

fn of_piece(piece: &Piece, origin: &Vec3) -> Moments {
    let turn = piece.rotation.to_rotation_matrix().into_inner();
    let (volume, gyration) = (piece.shape.volume(), piece.shape.gyration());
    let squares = gyration.map(|about| 0.5 * gyration.sum() - about);
    let at = piece.centre - origin;
    let second = turn * Mat3::from_diagonal(&squares) * turn.transpose() + at * at.transpose();
    Moments { volume, first: at * volume, second: second * volume, origin: *origin }
}

fn has_corners(shape: &Shape) -> bool {
    shape.facets().is_some() && shape.margin() <= 0.0
}

/// Pairs of pieces whose bounding balls overlap.
fn near_pairs(pieces: &[Piece]) -> Vec<[usize; 2]> {
    let is_near = |&[one, other]: &[usize; 2]| {
        let reach = pieces[one].shape.bounding_radius() + pieces[other].shape.bounding_radius();
        (pieces[one].centre - pieces[other].centre).norm() < reach
    };
    let pairs = (0..pieces.len()).flat_map(|one| (0..one).map(move |other| [other, one]));
    pairs.filter(is_near).collect()
}

/// Subtracts the volumes that polyhedra share, so that all points count once.
fn less_shared_by_polyhedra(pieces: &[Piece], sum: &mut Moments) -> Result<(), UnionError> {
    let planes: Vec<Vec<Plane>> =
        pieces.iter().map(|piece| planes_of(piece, &sum.origin)).collect();
    for (k, piece) in pieces.iter().enumerate() {
        let radius = (piece.centre - sum.origin).norm() + piece.shape.bounding_radius();
        let Some(body) = inside(&planes[k], 2.0 * radius) else { continue };
        let mut whole = Clipped::default();
        whole.begin(&body);
        let least = SLIVER * piece.shape.volume();
        exclude(&whole, &planes, k + 1, (-1.0, least), sum);
        for (other, cuts) in planes.iter().enumerate().filter(|(other, _)| *other != k) {
            let mut rest = whole.clone();
            let shares_all = cuts.iter().all(|plane| rest.cut(plane)) && {
                rest.end();
                Moments::of_cut(&rest, &Vec3::zeros()).volume
                    >= (1.0 - SLIVER) * piece.shape.volume()
            };
            let holds_it = other < k || pieces[other].shape.volume() > piece.shape.volume();
            if shares_all && holds_it {
                return Err(UnionError::Within { inner: k + 1, outer: other + 1 });
            }
        }
    }
    Ok(())
}

/// Adds the volume that a body shares with each of the others from a number on, and subtracts what these share with those after them.
fn exclude(
    body: &Clipped,
    others: &[Vec<Plane>],
    from: usize,
    (sign, least): (f64, f64),
    sum: &mut Moments,
) {
    for (k, planes) in others.iter().enumerate().skip(from) {
        let mut shared = body.clone();
        if !planes.iter().all(|plane| shared.cut(plane)) {
            continue;
        }
        let mut ended = shared.clone();
        ended.end();
        let moments = Moments::of_cut(&ended, &sum.origin);
        if moments.volume > least {
            sum.add(&moments, sign);
            exclude(&shared, others, k + 1, (-sign, least), sum);
        }
    }
}

/// Planes of a piece's faces, relative to an origin.
fn planes_of(piece: &Piece, origin: &Vec3) -> Vec<Plane> {
    let at = piece.centre - origin;
    let place = |plane: &Plane| {
        let normal = piece.rotation * plane.normal;
        Plane { normal, offset: plane.offset + normal.dot(&at) }
    };
    piece.shape.facets().map_or_else(Vec::new, |facets| facets.planes().iter().map(place).collect())
}

/// Pairs of overlapping balls, if all pieces are balls and no three of them overlap each other.
fn balls_in_twos(pieces: &[Piece], touching: &[[usize; 2]]) -> Option<Vec<[usize; 2]>> {
    let all_balls = pieces.iter().all(|piece| matches!(piece.shape, Shape::Sphere(_)));
    let overlap = |a: usize, b: usize| touching.contains(&[a.min(b), a.max(b)]);
    let is_in_three = |&[a, b]: &[usize; 2]| {
        (0..pieces.len()).any(|c| c != a && c != b && overlap(a, c) && overlap(b, c))
    };
    (all_balls && !touching.iter().any(is_in_three)).then(|| touching.to_vec())
}

/// Moments of the lens of two balls, as a cap of each.
fn lens(pieces: &[Piece], [one, other]: [usize; 2], origin: &Vec3) -> Result<Moments, UnionError> {
    let way = pieces[other].centre - pieces[one].centre;
    let distance = way.norm();
    let [r, s] = [one, other].map(|k| pieces[k].shape.bounding_radius());
    if distance <= (r - s).abs() {
        let (inner, outer) = if r < s { (one, other) } else { (other, one) };
        return Err(UnionError::Within { inner: inner + 1, outer: outer + 1 });
    }
    let axis = way / distance;
    let cut = 0.5 * (distance + (r - s) * (r + s) / distance);
    let mut sum = Moments::none(*origin);
    sum.add(&cap(r, cut, &axis, &(pieces[one].centre - origin), origin), 1.0);
    sum.add(&cap(s, distance - cut, &-axis, &(pieces[other].centre - origin), origin), 1.0);
    Ok(sum)
}

/// Moments of the cap of a ball of radius `r` beyond a plane at this distance from its centre, along an axis [m].
fn cap(r: f64, from: f64, axis: &Vec3, centre: &Vec3, origin: &Vec3) -> Moments {
    // ∫ zⁿ dz from the plane to the pole.
    let power = |n: i32| (r.powi(n + 1) - from.powi(n + 1)) / f64::from(n + 1);
    let square = r * r;
    let volume = PI * (square * power(0) - power(2));
    let height = PI * (square * power(1) - power(3));
    let along = PI * (square * power(2) - power(4));
    let across = 0.25 * PI * (square * square * power(0) - 2.0 * square * power(2) + power(4));
    let own = Mat3::identity() * across + axis * axis.transpose() * (along - across);
    let first = axis * height;
    Moments {
        volume,
        first: first + centre * volume,
        second: own
            + centre * first.transpose()
            + first * centre.transpose()
            + centre * centre.transpose() * volume,
        origin: *origin,
    }
}

/// Moments along lines in z through the middles of a grid with this number of squares along each side.
fn along_lines(pieces: &[Piece], origin: &Vec3, count: usize) -> Moments {
    let corners: Vec<Vec3> = pieces
        .iter()
        .flat_map(|piece| {
            let half = |axis: Vec3| (piece.support(&axis) - origin).dot(&axis);
            let high = Vec3::from_fn(|i, _| half(Vec3::ith(i, 1.0)));
            let low = Vec3::from_fn(|i, _| -half(Vec3::ith(i, -1.0)));
            [low, high]
        })
        .collect();
    let (low, high) = bounds(&corners);
    let width = (high - low) / count as f64;
    let area = width.x * width.y;
    let mut sum = Moments::none(*origin);
    let mut chords: Vec<[f64; 2]> = Vec::new();
    for square in 0..count * count {
        let x = low.x + (0.5 + (square % count) as f64) * width.x;
        let y = low.y + (0.5 + (square / count) as f64) * width.y;
        chords.clear();
        chords.extend(
            pieces.iter().filter_map(|piece| {
                chord(piece, &(origin + Vec3::new(x, y, low.z)), high.z - low.z)
            }),
        );
        chords.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let mut reached = f64::NEG_INFINITY;
        for [from, to] in chords.drain(..) {
            let (from, to) = (from.max(reached), to.max(reached));
            reached = to;
            let [a, b] = [low.z + from, low.z + to];
            let length = (b - a) * area;
            let z = 0.5 * (a + b);
            let square = (a * a + a * b + b * b) / 3.0;
            sum.volume += length;
            sum.first += Vec3::new(x, y, z) * length;
            let (xz, yz) = (x * z, y * z);
            sum.second += Mat3::new(x * x, x * y, xz, x * y, y * y, yz, xz, yz, square) * length;
        }
    }
    sum
}

/// Entry and exit of a line of this length, along z from a point, in a piece [m]; `None` if it misses the piece.
fn chord(piece: &Piece, from: &Vec3, length: f64) -> Option<[f64; 2]> {
    let start = piece.rotation.inverse_transform_vector(&(from - piece.centre));
    let way = piece.rotation.inverse_transform_vector(&Vec3::z());
    let by_axes = |axes: &Vec3| {
        let (p, d) = (start.component_div(axes), way.component_div(axes));
        let (a, b, c) = (d.norm_squared(), p.dot(&d), p.norm_squared() - 1.0);
        let root = b * b - a * c;
        (root > 0.0).then(|| [(-b - root.sqrt()) / a, (-b + root.sqrt()) / a])
    };
    match &piece.shape {
        Shape::Sphere(ball) => by_axes(&Vec3::repeat(ball.radius)),
        Shape::Ellipsoid(Ellipsoid { semi_axes }) => by_axes(semi_axes),
        shape => {
            let is_in = |at: f64| shape.contains(&(start + way * at));
            let step = length / LOOKS as f64;
            let inside: Vec<f64> =
                (0..=LOOKS).map(|k| step * k as f64).filter(|&at| is_in(at)).collect();
            let end = |mut within: f64, mut without: f64| {
                for _ in 0..40 {
                    let middle = 0.5 * (within + without);
                    if is_in(middle) { within = middle } else { without = middle }
                }
                within
            };
            let (&first, &last) = (inside.first()?, inside.last()?);
            Some([end(first, first - step), end(last, last + step)])
        }
    }
}
