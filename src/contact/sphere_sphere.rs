//! Two spheres: the closed form.
//!
//! Always chosen for this pair: exact, and ten times cheaper than any iteration.

use super::{ContactResolver, Outcome, Posed, Touch, Why, touch_of_ball};
use crate::math::Vec3;
use crate::shape::Shape;

/// Resolves a sphere against a sphere.
#[derive(Clone, Copy, Debug, Default)]
pub struct SphereSphere;

impl ContactResolver for SphereSphere {
    fn name(&self) -> &'static str {
        "sphere-sphere"
    }

    /// # Panics
    /// If a body is not a sphere: the table of resolvers was filled wrongly.
    #[inline]
    fn touch(&self, a: &Posed, b: &Posed, r: &Vec3, _warm: Option<&Vec3>) -> Outcome {
        let (Shape::Sphere(a), Shape::Sphere(b)) = (a.shape, b.shape) else {
            unreachable!("a batch of spheres holds spheres only")
        };
        let reach = a.radius + b.radius;
        let squared = r.norm_squared();
        if squared > reach * reach {
            return Outcome::Apart(squared.sqrt() - reach);
        }
        if squared == 0.0 {
            // Every direction is a normal: none can be preferred.
            return Outcome::Failed(Why::TooDeep);
        }
        let distance = squared.sqrt();
        let overlap = reach - distance;
        let normal = r / distance;
        Touch { overlap, normal, point: touch_of_ball(a.radius, &normal, overlap) }.outcome()
    }
}
