//! Closed form of a convex shape against a plane facet of a wall.
//!
//! The normal is that of the wall, and the deepest point is the support point against it. This is exact for every shape with a
//! support function. Where an edge or a face lies on the wall, the contact point is the centroid.

#![expect(clippy::inline_always, reason = "see `lanes`")]

use super::in_lanes::{self, ClosedForm, Touches, sphere_radii};
use super::{
    Batch, Bodies, ContactResolver, Found, Outcome, Posed, Touch, patch, resolve_each, triple,
    vectors,
};
use crate::ids::Slot;
use crate::lanes::{Eight, Gather, WIDTH};
use crate::math::Vec3;
use crate::shape::{HalfSpace, Shape};

/// Resolver of any convex shape (A) against a half-space (B).
///
/// The relative position points from the centre of A to the reference point of the wall. The plane is given in the axes of the wall.
#[derive(Clone, Copy, Debug, Default)]
pub struct AgainstHalfSpace;

impl ContactResolver for AgainstHalfSpace {
    fn name(&self) -> &'static str {
        "half-space"
    }

    /// # Panics
    /// If B is not a half-space: the table of resolvers was filled wrongly.
    #[inline]
    fn touch(&self, a: &Posed, b: &Posed, r: &Vec3, _warm: Option<&Vec3>) -> Outcome {
        let Shape::HalfSpace(plane) = b.shape else {
            unreachable!("a facet is the second body of its pairs")
        };
        let normal = -(b.frame * plane.normal);
        let deepest = a.support(&normal);
        let overlap = (deepest - r).dot(&normal) + plane.offset;
        // P_B is the foot of P_A on the plane; the contact point is half way.
        let mut point = deepest - normal * (0.5 * overlap);
        if overlap > 0.0 && !a.is_curved() {
            point = patch::centre_on_plane(a, &normal, overlap) + normal * point.dot(&normal);
        }
        Touch { overlap, normal, point }.outcome()
    }

    fn resolve(&self, batch: &Batch, found: &mut Found) {
        let Bodies { quaternion, scale, .. } = batch.bodies;
        if quaternion.is_none() && scale.is_none() {
            in_lanes::resolve(self, batch, found);
        } else {
            resolve_each(self, batch, found);
        }
    }
}

/// For spheres at a scale of 1.
impl ClosedForm for AgainstHalfSpace {
    #[inline(always)]
    fn touch_eight<L: Eight>(bodies: &Bodies, [of_a, of_b]: [Gather; 2]) -> Touches<L> {
        let (mut normals, mut offsets) = ([Vec3::zeros(); WIDTH], [0.0; WIDTH]);
        for lane in 0..WIDTH {
            (normals[lane], offsets[lane]) = plane_of(bodies, of_b.at(lane));
        }
        let (normal, offset) = (triple::<L>(&normals.each_ref()), L::load(&offsets));
        let r = vectors::<L>(bodies.position, of_b).minus(vectors(bodies.position, of_a));
        let r = bodies.cell.nearest_of(r);
        let deepest = normal.times(sphere_radii::<L>(bodies, of_a) / normal.dot(normal).sqrt());
        let overlap = deepest.minus(r).dot(normal) + offset;
        let point = deepest.minus(normal.times(L::all(0.5) * overlap));
        Touches { touching: L::all(0.0).less(overlap), overlap, normal, point }
    }
}

/// Normal of a facet into its wall, and distance of its plane in front of the wall's reference point [m].
#[inline]
fn plane_of(bodies: &Bodies, slot: usize) -> (Vec3, f64) {
    let slot = Slot(slot as u32);
    let Shape::HalfSpace(HalfSpace { normal, offset }) = bodies.shape_of(slot) else {
        unreachable!("a facet is the second body of its pairs")
    };
    (-(bodies.frame(slot) * normal), *offset)
}

#[cfg(test)]
mod tests {
    use super::AgainstHalfSpace;
    use crate::cell::Cell;
    use crate::contact::in_lanes::InLanes;
    use crate::contact::{Batch, Bodies, ContactResolver, FacetInPlace, Found, Pair, resolve_each};
    use crate::ids::{ShapeId, Slot};
    use crate::lanes::Portable;
    use crate::math::{Mat3, Vec3};
    use crate::random::Random;
    use crate::shape::{HalfSpace, Shape, Sphere};

    /// Results in the order of the pairs.
    fn sorted(found: &Found) -> (Vec<String>, [usize; 3]) {
        let Found { contacts, apart, failed, .. } = found;
        let touching = contacts.iter().map(|c| (c.pair, format!("{:?}", c.touch)));
        let apart_by = apart.iter().map(|(pair, clearance)| (*pair, format!("{clearance:?}")));
        let unknown = failed.iter().map(|(pair, why)| (*pair, format!("{why:?}")));
        let mut all: Vec<_> = touching.chain(apart_by).chain(unknown).collect();
        all.sort();
        let text = all.into_iter().map(|(pair, text)| format!("{pair}: {text}")).collect();
        (text, [contacts.len(), apart.len(), failed.len()])
    }

    /// With and without vector registers, for two sizes, rotated facets and a position that is not a number.
    #[test]
    fn lanes_say_what_one_sphere_is_told() {
        let plane = |normal: Vec3, offset| Shape::HalfSpace(HalfSpace { normal, offset });
        let library = [
            Shape::Sphere(Sphere { radius: 1.0 }),
            Shape::Sphere(Sphere { radius: 0.4 }),
            plane(Vec3::z(), 0.0),
            plane(Vec3::new(0.6, 0.0, 0.8), 0.3),
        ];
        let mut random = Random::of(11, 0);
        let mut position: Vec<Vec3> =
            (0..40).map(|_| Vec3::from_fn(|_, _| 3.0 * random.unit())).collect();
        position[21].z = f64::NAN;
        position.extend([Vec3::zeros(), Vec3::new(0.1, 0.2, 0.3)]);
        let mut shape: Vec<ShapeId> = (0..40).map(|k| ShapeId(k / 3 % 2)).collect();
        shape.extend([ShapeId(2), ShapeId(3)]);
        let turned = crate::math::Quat::from_euler_angles(0.3, -0.2, 0.9);
        let bodies = Bodies {
            position: &position,
            quaternion: None,
            facets: &[Mat3::identity(), turned.to_rotation_matrix().into_inner()]
                .map(|frame| FacetInPlace { frame, number: 0 }),
            form: None,
            shape: &shape,
            library: &library,
            curvature_radius: &[1.0, 0.4, f64::INFINITY, f64::INFINITY],
            scale: None,
            cell: &Cell::new(Vec3::zeros(), Vec3::repeat(4.0), [false; 3]),
        };
        let pairs: Vec<Pair> =
            (0..79).map(|k| Pair { a: Slot(k % 40), b: Slot(40 + k % 2) }).collect();
        let active: Vec<u32> = (0..79).collect();
        let batch = Batch { pairs: &pairs, previous: &[], geometry: &[], active: &active, bodies };
        let mut found = [(); 3].map(|()| Found::default());
        resolve_each(&AgainstHalfSpace, &batch, &mut found[0]);
        AgainstHalfSpace.resolve(&batch, &mut found[1]);
        AgainstHalfSpace.resolve_eights::<Portable>(&batch, &mut found[2]);
        let (alone, met) = sorted(&found[0]);
        assert!(met[0] > 15 && met[1] > 15 && met[2] == 2, "{met:?} of each are a poor test");
        for found in &found[1..] {
            assert_eq!(sorted(found).0, alone);
        }
    }
}
