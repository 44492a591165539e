//! Two spheres: the closed form.
//!
//! Always chosen for this pair: exact, and ten times cheaper than any iteration.

#![expect(clippy::inline_always, reason = "see `lanes`")]

use super::{
    Batch, Bodies, Contact, ContactResolver, Found, Outcome, Posed, Touch, Why, nearest_images,
    touch_of_ball, vectors,
};
use crate::ids::Slot;
use crate::lanes::{self, Eight, Kernel, WIDTH, row};
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

    fn resolve(&self, batch: &Batch, found: &mut Found) {
        lanes::dispatch(Resolution { batch, found });
    }
}

/// The pairs of a batch to be resolved.
struct Resolution<'a, 'b> {
    batch: &'a Batch<'b>,
    found: &'a mut Found,
}

impl Kernel for Resolution<'_, '_> {
    #[inline(always)]
    fn run<L: Eight>(self) {
        for eight in self.batch.active.chunks(WIDTH) {
            touch_eight::<L>(self.batch, eight, self.found);
        }
    }
}

/// [`SphereSphere::touch`] of up to eight pairs; the other lanes repeat the first.
#[inline(always)]
fn touch_eight<L: Eight>(batch: &Batch, indices: &[u32], found: &mut Found) {
    let Batch { pairs, bodies, .. } = batch;
    let first = pairs[indices[0] as usize];
    let (mut a, mut b) = ([first.a; WIDTH], [first.b; WIDTH]);
    for (lane, &index) in indices.iter().enumerate() {
        (a[lane], b[lane]) = (pairs[index as usize].a, pairs[index as usize].b);
    }
    let r = vectors::<L>(bodies.position, &b).minus(vectors(bodies.position, &a));
    let r = nearest_images(r, &bodies.period);
    let radius = radii::<L>(bodies, &a);
    let reach = radius + radii(bodies, &b);
    let distance = r.dot(r).sqrt();
    let overlap = reach - distance;
    let normal = r.over(distance);
    let point = normal.times(radius - L::all(0.5) * overlap);
    let zero = L::all(0.0);
    let (touching, apart) = (zero.less(overlap) & zero.less(distance), overlap.at_most(zero));

    let (overlap, normal, point) = (overlap.store(), normal.store(), point.store());
    for (lane, &pair) in indices.iter().enumerate() {
        if touching >> lane & 1 == 1 {
            let touch = Touch {
                overlap: overlap[lane],
                normal: row(&normal, lane).into(),
                point: row(&point, lane).into(),
            };
            found.contacts.push(Contact { pair, touch });
        } else if apart >> lane & 1 == 1 {
            found.apart.push((pair, -overlap[lane]));
        } else {
            let coincide = bodies.relative(pairs[pair as usize]) == Vec3::zeros();
            found.failed.push((pair, if coincide { Why::TooDeep } else { Why::NotFinite }));
        }
    }
}

/// The radii of spheres [m].
#[inline(always)]
fn radii<L: Eight>(bodies: &Bodies, slots: &[Slot; WIDTH]) -> L {
    let first = bodies.shape[slots[0].index()];
    let mut alike = true;
    for slot in slots {
        alike &= bodies.shape[slot.index()] == first;
    }
    if alike {
        return L::all(bodies.curvature_radius[first.index()]);
    }
    let mut radii = [0.0; WIDTH];
    for (radius, slot) in radii.iter_mut().zip(slots) {
        *radius = bodies.curvature_radius[bodies.shape[slot.index()].index()];
    }
    L::load(&radii)
}
