//! Distances and sections of triangles.

use crate::math::Vec3;

pub(super) fn nearest_on_segment(from: &Vec3, to: &Vec3, point: &Vec3) -> Vec3 {
    let along = to - from;
    from + along * ((point - from).dot(&along) / along.norm_squared()).clamp(0.0, 1.0)
}

pub(super) fn nearest_on(corners: &[Vec3; 3], point: &Vec3) -> Vec3 {
    let [a, b, c] = corners;
    if is_over(corners, point, 0.0) {
        let normal = (b - a).cross(&(c - a)).normalize();
        return point - normal * (point - a).dot(&normal);
    }
    let sides = [(a, b), (b, c), (c, a)].map(|(from, to)| nearest_on_segment(from, to, point));
    let nearer = |one: &&Vec3, other: &&Vec3| {
        (*one - point).norm_squared().total_cmp(&(*other - point).norm_squared())
    };
    sides.iter().min_by(nearer).copied().unwrap_or(*a)
}

/// Whether the foot of a point on the plane of a triangle is in the triangle, within a tolerance [m].
pub fn is_over(corners: &[Vec3; 3], point: &Vec3, tolerance: f64) -> bool {
    let [a, b, c] = corners;
    let normal = (b - a).cross(&(c - a));
    [(a, b), (b, c), (c, a)].iter().all(|(from, to)| {
        let inwards = normal.cross(&(*to - *from));
        (point - *from).dot(&inwards) >= -tolerance * inwards.norm()
    })
}

/// Whether two triangles have an area in common if one is moved by at most `tolerance` [m].
///
/// They have none if a side of one separates them.
pub(super) fn lie_in_each_other(one: &[Vec3; 3], other: &[Vec3; 3], tolerance: f64) -> bool {
    let sides = |[a, b, c]: &[Vec3; 3]| [(*a, *b, *c), (*b, *c, *a), (*c, *a, *b)];
    let normal = (one[1] - one[0]).cross(&(one[2] - one[0])).normalize();
    let lies_in = other.iter().all(|corner| (corner - one[0]).dot(&normal).abs() <= tolerance);
    let is_apart = |of: &[Vec3; 3], from: &[Vec3; 3]| {
        sides(of).iter().any(|(a, b, c)| {
            let across = normal.cross(&(b - a)).normalize();
            let inwards = across * (c - a).dot(&across).signum();
            from.iter().all(|corner| (corner - a).dot(&inwards) <= tolerance)
        })
    };
    lies_in && !is_apart(one, other) && !is_apart(other, one)
}

/// Whether a triangle enters a box with this middle and these half sides [m].
///
/// It does not if an axis separates them: one of the box, the normal of the triangle, or one at right angles to a side of both
/// (Akenine-Möller 2001, DOI 10.1080/10867651.2001.10487535).
pub(super) fn comes_into(corners: &[Vec3; 3], middle: &Vec3, half: &Vec3) -> bool {
    let [a, b, c] = corners.map(|corner| corner - middle);
    let sides = [b - a, c - b, a - c];
    let of_box = [0, 1, 2].map(|k| Vec3::ith(k, 1.0));
    let crossed = sides.iter().flat_map(|side| of_box.iter().map(move |axis| side.cross(axis)));
    let mut axes = of_box.iter().copied().chain([sides[0].cross(&sides[1])]).chain(crossed);
    axes.all(|axis| {
        let reach = half.dot(&axis.abs());
        let places = [a, b, c].map(|corner| corner.dot(&axis));
        let (least, most) =
            (places[0].min(places[1]).min(places[2]), places[0].max(places[1]).max(places[2]));
        // An axis of no length separates nothing.
        axis == Vec3::zeros() || least < reach && most > -reach
    })
}
