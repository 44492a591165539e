//! Resolvers whose batches go through vector registers, eight pairs at once.

#![expect(clippy::inline_always, reason = "see `lanes`")]

use super::{Batch, Bodies, ContactResolver, Found, resolve_one};
use crate::lanes::{self, Eight, Gather, Kernel, Triple, WIDTH};

/// Resolution of a batch in lanes. To be inlined always.
pub(super) trait InLanes {
    /// Resolves the active pairs of a batch.
    fn resolve_eights<L: Eight>(&self, batch: &Batch, found: &mut Found);
}

/// Contact geometries of eight pairs.
pub(super) struct Touches<L> {
    /// Bit mask of the touching lanes; the others are apart, unless their overlap is positive or NaN.
    pub(super) touching: u8,
    /// Overlaps [m].
    pub(super) overlap: L,
    pub(super) normal: Triple<L>,
    /// Contact points relative to the centres of A [m].
    pub(super) point: Triple<L>,
}

/// A resolver with a closed form for eight pairs. To be inlined always.
pub(super) trait ClosedForm: ContactResolver {
    /// [`ContactResolver::touch`] of eight pairs of bodies A and B.
    fn touch_eight<L: Eight>(bodies: &Bodies, slots: [Gather; 2]) -> Touches<L>;
}

impl<R: ClosedForm> InLanes for R {
    #[inline(always)]
    fn resolve_eights<L: Eight>(&self, batch: &Batch, found: &mut Found) {
        let slots = batch.slots(batch.bodies.position.len());
        for eight in batch.active.chunks(WIDTH) {
            let mut room = [[0; 2]; WIDTH];
            let touches = R::touch_eight::<L>(&batch.bodies, slots.picked(eight, &mut room));
            let others = found.note_eight(eight, &touches);
            if others != 0 {
                // Rare: resolved alone to get the reason.
                for (lane, &pair) in eight.iter().enumerate() {
                    if others >> lane & 1 == 1 {
                        found.note(pair, resolve_one(self, batch, pair));
                    }
                }
            }
        }
    }
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
    type Home = R;

    #[inline(always)]
    fn run<L: Eight>(self) {
        self.resolver.resolve_eights::<L>(self.batch, self.found);
    }
}

/// Radii of spheres [m].
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
