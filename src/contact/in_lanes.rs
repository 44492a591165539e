//! Resolvers whose batches go through vector registers, eight pairs at once.

#![expect(clippy::inline_always, reason = "see `lanes`")]

use super::{Batch, Bodies, Found};
use crate::lanes::{self, Eight, Gather, Kernel, WIDTH};

/// What such a resolver does with a batch. To be inlined always.
pub(super) trait InLanes {
    /// Resolves the active pairs of a batch.
    fn resolve_eights<L: Eight>(&self, batch: &Batch, found: &mut Found);
}

/// Resolves a batch with the widest registers that this processor has.
pub(super) fn resolve(resolver: &impl InLanes, batch: &Batch, found: &mut Found) {
    lanes::dispatch(Resolution { resolver, batch, found });
}

struct Resolution<'a, 'b, R> {
    resolver: &'a R,
    batch: &'a Batch<'b>,
    found: &'a mut Found,
}

impl<R: InLanes> Kernel for Resolution<'_, '_, R> {
    #[inline(always)]
    fn run<L: Eight>(self) {
        self.resolver.resolve_eights::<L>(self.batch, self.found);
    }
}

/// The radii of spheres [m].
#[inline(always)]
pub(super) fn sphere_radii<L: Eight>(bodies: &Bodies, slots: Gather) -> L {
    let Bodies { shape, curvature_radius, scale, .. } = bodies;
    let shapes = slots.rows(shape);
    let mut alike = true;
    for shape in shapes {
        alike &= shape == shapes[0];
    }
    if alike && scale.is_none() {
        return L::all(curvature_radius[shapes[0].index()]);
    }
    let mut radii = [0.0; WIDTH];
    for (lane, radius) in radii.iter_mut().enumerate() {
        let scale = scale.map_or(1.0, |scale| scale[slots.at(lane)]);
        *radius = curvature_radius[shapes[lane].index()] * scale;
    }
    L::load(&radii)
}
