//! Shape erosion: GJK on bodies scaled down about their centres gives the direction, the unscaled bodies give the overlap
//! (Lai et al. 2021, section 1.3 (2), radial scheme).
//!
//! It is for every convex shape, and it is the method of the paper that this code reproduces. It costs less than EPA, but its normal is
//! not the common normal: for 1:2 ellipsoids it is off by up to 3°. The overlap is too large by 1e-4 to 1e-3 of the size, however small
//! it is (ratio 5 %). A pair whose clearance is less than that error is reported as touching: this *spurious contact* is part of the
//! method. The common-normal method is better for smooth shapes, and EPA is more accurate for sharp ones.

use super::gjk::{Difference, Separation, separate};
use super::{ContactResolver, Outcome, Posed, Touch, Why, touch_along};
use crate::math::Vec3;
use serde::{Deserialize, Serialize};

/// Resolves two convex bodies by radial erosion and GJK.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ErodedGjk {
    /// Both bodies are scaled about their centres by `1 - ratio`.
    pub ratio: f64,
    /// Increment of the ratio, added until the scaled bodies are apart.
    pub increment: f64,
    /// Relative duality gap of the distance at which GJK stops.
    ///
    /// The errors of direction and overlap grow with its square root, as the direction is not that of least overlap.
    pub tolerance: f64,
    /// Whether bodies that are apart, but have a positive overlap by this method, touch.
    ///
    /// Without spurious contacts, as in the paper's two steps "GJK + GJK-erosion", the force jumps at touch. Packings then lose weak contacts
    /// and never come to rest.
    pub spurious: bool,
}

impl Default for ErodedGjk {
    /// The paper's 5 % and 1 %, and a tolerance of 1e-6.
    ///
    /// With a tolerance of 1e-4, overlaps would jump between steps by 1e-5 of the size, a tenth of those in a packing, and keep it shaking.
    /// The finer tolerance costs a tenth more time.
    fn default() -> Self {
        Self { ratio: 0.05, increment: 0.01, tolerance: 1e-6, spurious: true }
    }
}

impl ErodedGjk {
    /// Least increment; with a smaller one the loop would not end.
    pub const LEAST_INCREMENT: f64 = 1e-4;
}

impl ContactResolver for ErodedGjk {
    fn name(&self) -> &'static str {
        "gjk-erosion"
    }

    #[inline]
    fn touch(&self, a: &Posed, b: &Posed, r: &Vec3, warm: Option<&Vec3>) -> Outcome {
        let m = Difference::new(a, b, r);
        // With distance D of the cores, the overlap along their direction n is
        // ratio (h_A(n) + h_B(-n)) - D <= ratio · reach - D. GJK's direction is the best within its tolerance, so beyond this distance
        // the overlap is negative.
        let beyond = |ratio: f64| ratio * m.reach / (1.0 - self.tolerance);
        let squared = m.r.norm_squared();
        if squared > m.reach * m.reach {
            let cores_apart = squared.sqrt() - (1.0 - self.ratio) * m.reach;
            return Outcome::Apart((cores_apart - beyond(self.ratio)).max(0.0) * m.unit);
        }
        if squared == 0.0 {
            // Scaled about one point, the bodies intersect at every ratio.
            return Outcome::Failed(Why::TooDeep);
        }
        let start = warm.unwrap_or(&m.r);
        let mut ratio = self.ratio;
        // A core thinner than half an increment is a point within rounding.
        while 1.0 - ratio > 0.5 * self.increment {
            match separate(&m.eroded(ratio), start, self.tolerance, beyond(ratio)) {
                // Near touch the direction decides, and it moves with the bodies: no clearance is certain.
                Separation::Apart(normal) => {
                    let touch = touch_along(a, b, r, &normal);
                    return match touch.outcome() {
                        // The contact point of most touching bodies is in both of them, which is the fastest check.
                        Outcome::Touching(_) if !self.spurious && !m.holds(&touch.point) => {
                            if_intersecting(touch, separate(&m, start, 0.0, 0.0))
                        }
                        Outcome::Apart(_) => Outcome::Apart(0.0),
                        outcome => outcome,
                    };
                }
                Separation::Beyond(distance) => {
                    return Outcome::Apart((distance - beyond(ratio)) * m.unit);
                }
                Separation::Intersecting => ratio += self.increment,
                Separation::NotConverged => return Outcome::Failed(Why::NoConvergence),
            }
        }
        Outcome::Failed(Why::TooDeep)
    }
}

/// Result of a contact if only intersecting bodies may touch; failed if GJK cannot decide.
fn if_intersecting(touch: Touch, told: Separation) -> Outcome {
    match told {
        Separation::Intersecting => Outcome::Touching(touch),
        Separation::Apart(_) | Separation::Beyond(_) => Outcome::Apart(0.0),
        Separation::NotConverged => Outcome::Failed(Why::NoConvergence),
    }
}

#[cfg(test)]
mod tests {
    use super::{Difference, ErodedGjk, Separation, if_intersecting, separate, touch_along};
    use crate::contact::{ContactResolver, Outcome, Posed, Touch, Why, orientations};
    use crate::math::{Mat3, Vec3};
    use crate::shape::{Ellipsoid, Shape, Sphere};

    /// A pair that GJK cannot decide is not reported as apart: the next resolver of the chain must answer.
    #[test]
    fn unknown_is_not_apart() {
        let touch = Touch { overlap: 1e-3, normal: Vec3::x(), point: Vec3::x() };
        let failed = Outcome::Failed(Why::NoConvergence);
        assert_eq!(if_intersecting(touch, Separation::NotConverged), failed);
        assert_eq!(if_intersecting(touch, Separation::Intersecting), Outcome::Touching(touch));
        assert_eq!(if_intersecting(touch, Separation::Apart(Vec3::x())), Outcome::Apart(0.0));
        assert_eq!(if_intersecting(touch, Separation::Beyond(0.1)), Outcome::Apart(0.0));
    }

    /// Pairs rejected early are those that the rule rejects: the overlap along the direction of the eroded bodies decides.
    #[test]
    fn early_rejection_follows_the_rule() {
        let method = ErodedGjk::default();
        let shape = Shape::Ellipsoid(Ellipsoid { semi_axes: Vec3::new(1.0, 0.5, 0.4) });
        let mut met = [0, 0];
        for i in 0..4000 {
            let k = f64::from(i);
            let ([frame, other], toward) = orientations(k);
            let a = Posed::new(&shape, &frame);
            let b = Posed::new(&shape, &other);
            // About the size of the spurious overlaps, of both signs.
            let clearance = 0.01 * (0.9 * k).sin();
            let r = a.support(&toward) - b.support(&-toward) + toward * clearance;
            let m = Difference::new(&a, &b, &r);
            let rule =
                match separate(&m.eroded(method.ratio), &m.r, method.tolerance, f64::INFINITY) {
                    Separation::Apart(normal) => touch_along(&a, &b, &r, &normal).outcome(),
                    other => panic!("pair {i}: {other:?}"),
                };
            let is_apart = |outcome: &Outcome| matches!(outcome, Outcome::Apart(_));
            met[usize::from(is_apart(&rule))] += 1;
            let found = method.touch(&a, &b, &r, None);
            assert!(found == rule || is_apart(&found) && is_apart(&rule), "pair {i}: {found:?}");
        }
        assert!(met[0] > 1000 && met[1] > 1000, "{met:?} of each are a poor test");
    }

    /// Without spurious contacts, all bodies that overlap touch, and no others.
    #[test]
    fn spurious_contacts_can_be_left_out() {
        let method = ErodedGjk::default();
        let shape = Shape::Ellipsoid(Ellipsoid { semi_axes: Vec3::new(1.0, 0.5, 0.4) });
        let mut met = 0;
        for i in 0..2000 {
            let k = f64::from(i);
            let ([frame, other], toward) = orientations(k);
            let a = Posed::new(&shape, &frame);
            let b = Posed::new(&shape, &other);
            let overlap = 1e-3 * (0.9 * k).sin();
            let r = a.support(&toward) - b.support(&-toward) - toward * overlap;
            let paper = ErodedGjk { spurious: false, ..method };
            let (all, true_ones) = (method.touch(&a, &b, &r, None), paper.touch(&a, &b, &r, None));
            if overlap > 0.0 {
                assert_eq!(true_ones, all, "pair {i}");
            } else {
                assert!(matches!(true_ones, Outcome::Apart(_)), "pair {i}: {true_ones:?}");
                met += u32::from(matches!(all, Outcome::Touching(_)));
            }
        }
        assert!(met > 250, "{met} spurious contacts are a poor test");
    }

    /// Cores that touch within rounding, for which GJK has no direction, are eroded further.
    #[test]
    fn cores_that_just_touch() {
        let method = ErodedGjk::default();
        let shape = Shape::Sphere(Sphere { radius: 1.0 });
        let frame = Mat3::identity();
        let body = Posed::new(&shape, &frame);
        for i in 0..400 {
            let k = f64::from(i);
            let toward = Vec3::new((1.3 * k).sin(), (2.9 * k).sin(), (0.7 * k).cos()).normalize();
            let gap = 0.1_f64.powi(3 + i % 15) * if i % 2 == 0 { 1.0 } else { -1.0 };
            let overlap = 2.0 * method.ratio - gap;
            let Outcome::Touching(touch) =
                method.touch(&body, &body, &(toward * (2.0 - overlap)), None)
            else {
                panic!("pair {i}, cores {gap:e} apart, was not resolved")
            };
            // Along any direction near the line of centres, errors are of second order.
            assert!((touch.overlap - overlap).abs() < 1e-3, "pair {i}, {gap:e}: {touch:?}");
        }
    }
}
