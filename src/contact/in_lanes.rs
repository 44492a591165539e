//! Resolvers whose batches go through vector registers, eight pairs at once.

#![expect(clippy::inline_always, reason = "see `lanes`")]

use super::{Batch, Found};
use crate::lanes::{self, Eight, Kernel};

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
