//! Resolvers in a row: what one cannot tell goes to the next.
//!
//! A contact that is lost because a solver gave up is a force that is lost. Every stage that fails says
//! so, the next one answers, and the tally shows how often: a run whose first stage is often passed over
//! should choose another method.

use super::{
    Bodies, Contact, ContactResolver, History, Outcome, Pair, Posed, ResolveError, Tally, Why,
    resolve_each,
};
use crate::math::Vec3;

/// A first resolver and up to four to fall back on.
pub struct Chain {
    first: Box<dyn ContactResolver>,
    fallbacks: Vec<Box<dyn ContactResolver>>,
}

impl Chain {
    /// Asks `first`, then `fallbacks` in their order.
    ///
    /// # Panics
    /// If there are more fallbacks than a [`Tally`] counts.
    pub fn new(first: Box<dyn ContactResolver>, fallbacks: Vec<Box<dyn ContactResolver>>) -> Self {
        let counted = Tally::default().fallbacks.len();
        assert!(fallbacks.len() <= counted, "a chain has at most {counted} fallbacks");
        Self { first, fallbacks }
    }

    fn touch_counting(
        &self,
        (a, b): (&Posed, &Posed),
        r: &Vec3,
        warm: Option<&Vec3>,
        tally: &mut Tally,
    ) -> Outcome {
        // No method can do anything with such a position, and some would say "apart".
        if !r.iter().all(|x| x.is_finite()) {
            return Outcome::Failed(Why::NotFinite);
        }
        let mut outcome = self.first.touch(a, b, r, warm);
        for (fallback, answered) in self.fallbacks.iter().zip(&mut tally.fallbacks) {
            let Outcome::Failed(_) = outcome else { break };
            outcome = fallback.touch(a, b, r, warm);
            if !matches!(outcome, Outcome::Failed(_)) {
                *answered += 1;
            }
        }
        outcome
    }
}

impl ContactResolver for Chain {
    fn name(&self) -> &'static str {
        self.first.name()
    }

    fn touch(&self, a: &Posed, b: &Posed, r: &Vec3, warm: Option<&Vec3>) -> Outcome {
        self.touch_counting((a, b), r, warm, &mut Tally::default())
    }

    fn resolve(
        &self,
        first: u32,
        pairs: &[Pair],
        history: &[History],
        bodies: &Bodies,
        out: &mut Vec<Contact>,
        tally: &mut Tally,
    ) -> Result<(), ResolveError> {
        resolve_each(first, pairs, history, bodies, out, tally, |a, b, r, warm, tally| {
            self.touch_counting((a, b), r, warm, tally)
        })
    }
}
