//! Clearance of two bodies that do not touch.
//!
//! A force needs no clearance, so every method stops once it knows that a pair is apart. Checks of a single pair need the distance
//! and the direction: GJK on the bodies themselves, iterated to rounding.

use super::gjk::{Difference, Separation, separate};
use super::{Posed, Touch, touch_along};
use crate::math::Vec3;

/// Ratios of erosion and tolerances, tried in order until GJK finds the bodies apart.
///
/// Erosion parts bodies that GJK cannot distinguish from touching. It changes the direction by about the ratio, and `δ` by its square.
/// The tolerance is relaxed where rounding keeps GJK from converging.
const TRIES: [(f64, f64); 7] =
    [(0.0, 0.0), (3e-8, 0.0), (1e-6, 0.0), (0.0, 1e-9), (0.0, 1e-6), (1e-6, 1e-4), (1e-4, 1e-6)];

/// Nearest points of two bodies, as a [`Touch`] with `overlap = -clearance` [m].
///
/// This is the least `δ(n)`, which is continuous through touching. `r` points from the centre of A to the centre of B [m]. The
/// clearance is exact to 1e-14 of the larger body, the normal to 1e-7. The result is `None` if the bodies overlap. An overlap below
/// 1e-6 of the larger body cannot be distinguished, and the returned overlap may be positive.
pub fn clearance(a: &Posed, b: &Posed, r: &Vec3) -> Option<Touch> {
    let bodies = Difference::new(a, b, r);
    TRIES.into_iter().find_map(|(ratio, tolerance)| {
        match separate(&bodies.eroded(ratio), &bodies.r, tolerance, f64::INFINITY) {
            Separation::Apart(normal) => Some(touch_along(a, b, r, &normal)),
            _ => None,
        }
    })
}

#[cfg(test)]
mod tests {
    use super::clearance;
    use crate::contact::Posed;
    use crate::math::{Mat3, Vec3};
    use crate::shape::{Ellipsoid, Polyhedron, Shape};

    /// A small cube in contact with a face of a large one.
    #[test]
    fn faces_that_touch() {
        let cube = |half: f64| {
            let sides = [-half, half];
            let corners = sides.into_iter().flat_map(|x| {
                sides.into_iter().flat_map(move |y| sides.map(move |z| Vec3::new(x, y, z)))
            });
            let polyhedron = Polyhedron::new(&corners.collect::<Vec<_>>()).expect("a cube");
            Shape::Polyhedron(Box::new(polyhedron))
        };
        let (large, small, frame) = (cube(1.0), cube(0.5), Mat3::identity());
        let [a, b] = [&large, &small].map(|shape| Posed::new(shape, &frame));
        let touch = clearance(&a, &b, &Vec3::new(1.5, 0.25, 0.125)).expect("they do not overlap");
        assert!(touch.overlap.abs() < 1e-9, "{touch:?}");
        assert!((touch.normal - Vec3::x()).norm() < 1e-6, "{touch:?}");
    }

    #[test]
    fn a_known_gap() {
        let shape = Shape::Ellipsoid(Ellipsoid { semi_axes: Vec3::new(1.0, 0.5, 0.25) });
        let frame = Mat3::identity();
        let body = Posed::new(&shape, &frame);
        let normal = Vec3::new(0.36, 0.48, -0.8);
        for gap in [2.0, 1e-3, 1e-9] {
            let r = 2.0 * body.support(&normal) + gap * normal;
            let touch = clearance(&body, &body, &r).expect("the bodies are apart");
            assert!((touch.overlap + gap).abs() < 1e-14, "{gap:e}: {:e}", touch.overlap);
            assert!((touch.normal - normal).norm() < 2e-6, "{gap:e}: {}", touch.normal);
        }
        assert_eq!(clearance(&body, &body, &Vec3::new(0.5, 0.0, 0.0)), None);
    }
}
