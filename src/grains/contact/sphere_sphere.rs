//! Closed form of two spheres.
//!
//! It is always chosen for this pair: exact, and ten times cheaper than any iteration.

#![expect(clippy::inline_always, reason = "see `lanes`")]

use super::in_lanes::{self, ClosedForm, Touches, sphere_radii};
use super::{
    Batch, Bodies, ContactResolver, Found, Outcome, Posed, Touch, Why, touch_of_sphere, vectors,
};
use crate::lanes::{Eight, Gather};
use crate::math::Vec3;
use crate::shape::Shape;

/// Resolver of two spheres.
#[derive(Clone, Copy, Debug, Default)]
pub struct SphereSphere;

impl ContactResolver for SphereSphere {
    fn name(&self) -> &'static str {
        "sphere-sphere"
    }

    /// # Panics
    /// If a body is not a sphere, that is, if the table of resolvers is wrong.
    #[inline]
    fn touch(&self, a: &Posed, b: &Posed, r: &Vec3, _warm: Option<&Vec3>) -> Outcome {
        let (Shape::Sphere(of_a), Shape::Sphere(of_b)) = (a.shape, b.shape) else {
            unreachable!("a batch of spheres holds spheres only")
        };
        let (radius_a, radius_b) = (of_a.radius * a.scale, of_b.radius * b.scale);
        let reach = radius_a + radius_b;
        let squared = r.norm_squared();
        if squared > reach * reach {
            return Outcome::Apart(squared.sqrt() - reach);
        }
        if squared == 0.0 {
            // Every direction is a normal, and none can be preferred.
            return Outcome::Failed(Why::TooDeep);
        }
        let distance = squared.sqrt();
        let overlap = reach - distance;
        let normal = r * (1.0 / distance);
        Touch { overlap, normal, point: touch_of_sphere(radius_a, &normal, overlap) }.outcome()
    }

    fn resolve(&self, batch: &Batch, found: &mut Found) {
        in_lanes::resolve(self, batch, found);
    }
}

impl ClosedForm for SphereSphere {
    #[inline(always)]
    fn touch_eight<L: Eight>(bodies: &Bodies, [of_a, of_b]: [Gather; 2]) -> Touches<L> {
        let r = vectors::<L>(bodies.position, of_b).minus(vectors(bodies.position, of_a));
        let r = bodies.cell.nearest_of(r);
        let radius = sphere_radii::<L>(bodies, of_a);
        let reach = radius + sphere_radii(bodies, of_b);
        let distance = r.dot(r).sqrt();
        let overlap = reach - distance;
        let normal = r.over(distance);
        let point = normal.times(radius - L::all(0.5) * overlap);
        let zero = L::all(0.0);
        let touching = zero.less(overlap) & zero.less(distance);
        Touches { touching, overlap, normal, point }
    }
}

#[cfg(test)]
mod tests {
    use super::SphereSphere;
    use crate::cell::Cell;
    use crate::contact::in_lanes::InLanes;
    use crate::contact::{Batch, Bodies, ContactResolver, Found, Outcome, Pair, Previous};
    use crate::ids::{ShapeId, Slot};
    use crate::lanes::Portable;
    use crate::math::Vec3;
    use crate::random::Random;
    use crate::shape::{Shape, Sphere};

    /// Outcomes of a batch, by pair.
    fn outcomes(found: &Found, pairs: usize) -> Vec<Outcome> {
        let mut outcomes = vec![None; pairs];
        let touching = found.contacts.iter().map(|c| (c.pair, Outcome::Touching(c.touch)));
        let apart = found.apart.iter().map(|&(pair, clearance)| (pair, Outcome::Apart(clearance)));
        let failed = found.failed.iter().map(|&(pair, why)| (pair, Outcome::Failed(why)));
        for (pair, outcome) in touching.chain(apart).chain(failed) {
            let before = outcomes[pair as usize].replace(outcome);
            assert_eq!(before, None, "pair {pair} twice");
        }
        outcomes.into_iter().map(|outcome| outcome.expect("every pair is answered")).collect()
    }

    /// With and without vector registers: equal and different radii, across a periodic boundary, coincident centres and NaN.
    #[test]
    fn lanes_say_what_one_pair_is_told() {
        let library = [1.0, 0.4].map(|radius| Shape::Sphere(Sphere { radius }));
        let radii = [1.0, 0.4];
        let mut random = Random::of(7, 0);
        let mut position: Vec<Vec3> =
            (0..80).map(|_| Vec3::from_fn(|_, _| 4.0 * random.unit())).collect();
        position[11] = position[10];
        position[21].x = f64::NAN;
        let pairs: Vec<Pair> = (0..79).map(|k| Pair { a: Slot(k), b: Slot(k + 1) }).collect();
        let active: Vec<u32> = (0..79).collect();
        let previous = vec![Previous::NONE; pairs.len()];
        let mut met = [0; 3];
        let scale: Vec<f64> = (0..80).map(|k| 0.7 + 0.01 * f64::from(k % 50)).collect();
        for (sizes, scales) in [(1, None), (2, None), (2, Some(&scale[..]))] {
            let shape: Vec<ShapeId> = (0..80).map(|k| ShapeId(k / 3 % sizes)).collect();
            let bodies = Bodies {
                position: &position,
                quaternion: None,
                facets: &[],
                form: None,
                shape: &shape,
                library: &library,
                curvature_radius: &radii,
                scale: scales,
                cell: &Cell::new(Vec3::zeros(), Vec3::repeat(4.0), [true, false, false]),
            };
            let batch = Batch {
                pairs: &pairs,
                previous: &previous,
                geometry: &[],
                active: &active,
                bodies,
            };
            let mut found = [Found::default(), Found::default()];
            SphereSphere.resolve(&batch, &mut found[0]);
            SphereSphere.resolve_eights::<Portable>(&batch, &mut found[1]);
            for found in found {
                for (pair, outcome) in pairs.iter().zip(outcomes(&found, pairs.len())) {
                    let frames = bodies.frames(*pair);
                    let (a, b) = bodies.posed(*pair, &frames);
                    let alone = SphereSphere.touch(&a, &b, &bodies.relative(*pair), None);
                    assert_eq!(outcome, alone, "{pair:?}");
                    met[match outcome {
                        Outcome::Touching(_) => 0,
                        Outcome::Apart(_) => 1,
                        Outcome::Failed(_) => 2,
                    }] += 1;
                }
            }
        }
        assert!(met[0] > 40 && met[1] > 40 && met[2] == 18, "{met:?} of each are a poor test");
    }
}
