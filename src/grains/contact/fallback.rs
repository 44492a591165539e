//! Chains of resolvers: a pair that one resolver cannot resolve goes to the next.
//!
//! A contact lost because a solver failed is a lost force. The tally counts the pairs that each fallback resolved. A run whose
//! first stage fails often should choose another method.

use super::{Batch, ContactResolver, Definition, Found, Outcome, Posed, Tally, Why};
use crate::math::Vec3;

/// A first resolver and up to four to fall back on.
pub struct Chain {
    first: Box<dyn ContactResolver>,
    fallbacks: Vec<Box<dyn ContactResolver>>,
}

impl Chain {
    /// A chain that tries `first`, then `fallbacks` in order.
    ///
    /// # Panics
    /// If there are more fallbacks than a [`Tally`] counts.
    pub fn new(first: Box<dyn ContactResolver>, fallbacks: Vec<Box<dyn ContactResolver>>) -> Self {
        let counted = Tally::default().fallbacks.len();
        assert!(fallbacks.len() <= counted, "a chain has at most {counted} fallbacks");
        Self { first, fallbacks }
    }
}

impl ContactResolver for Chain {
    fn name(&self) -> &'static str {
        self.first.name()
    }

    fn stages(&self) -> Vec<&'static str> {
        let fallbacks = self.fallbacks.iter().map(|fallback| fallback.name());
        std::iter::once(self.first.name()).chain(fallbacks).collect()
    }

    fn definition(&self) -> Definition {
        self.first.definition()
    }

    fn touch(&self, a: &Posed, b: &Posed, r: &Vec3, warm: Option<&Vec3>) -> Outcome {
        // No method can use such a position, and some would report the bodies as apart.
        if !r.iter().all(|x| x.is_finite()) {
            return Outcome::Failed(Why::NotFinite);
        }
        let mut outcome = self.first.touch(a, b, r, warm);
        for fallback in &self.fallbacks {
            let Outcome::Failed(_) = outcome else { break };
            outcome = fallback.touch(a, b, r, warm);
        }
        outcome
    }

    fn resolve(&self, batch: &Batch, found: &mut Found) {
        self.first.resolve(batch, found);
        for (stage, fallback) in self.fallbacks.iter().enumerate() {
            if found.failed.is_empty() {
                break;
            }
            let failed: Vec<u32> = found.failed.drain(..).map(|(pair, _)| pair).collect();
            fallback.resolve(&Batch { active: &failed, ..*batch }, found);
            found.tally.fallbacks[stage] += (failed.len() - found.failed.len()) as u64;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Chain;
    use crate::cell::Cell;
    use crate::contact::{
        Batch, Bodies, ContactResolver, Found, Outcome, Pair, Posed, Previous, SphereSphere, Tally,
        Why,
    };
    use crate::ids::{ShapeId, Slot};
    use crate::math::{Mat3, Vec3};
    use crate::shape::{Shape, Sphere};

    /// Fails for every pair.
    struct Helpless;

    impl ContactResolver for Helpless {
        fn name(&self) -> &'static str {
            "helpless"
        }

        fn touch(&self, _: &Posed, _: &Posed, _: &Vec3, _: Option<&Vec3>) -> Outcome {
            Outcome::Failed(Why::NoConvergence)
        }
    }

    fn resolve(chain: &Chain, centres: &[Vec3]) -> Found {
        let bodies = Bodies {
            position: centres,
            quaternion: None,
            facets: &[],
            form: None,
            shape: &vec![ShapeId(0); centres.len()],
            library: &[Shape::Sphere(Sphere { radius: 1.0 })],
            curvature_radius: &[1.0],
            scale: None,
            cell: &Cell::OPEN,
        };
        let pairs: Vec<_> =
            (1..centres.len() as u32).map(|b| Pair { a: Slot(0), b: Slot(b) }).collect();
        let active: Vec<u32> = (0..pairs.len() as u32).collect();
        let mut found = Found::default();
        let previous = vec![Previous::NONE; pairs.len()];
        let batch =
            Batch { pairs: &pairs, previous: &previous, geometry: &[], active: &active, bodies };
        chain.resolve(&batch, &mut found);
        found
    }

    #[test]
    fn the_stage_that_answers_is_counted() {
        let fallbacks: Vec<Box<dyn ContactResolver>> =
            vec![Box::new(Helpless), Box::new(SphereSphere)];
        let chain = Chain::new(Box::new(Helpless), fallbacks);
        let found = resolve(&chain, &[Vec3::zeros(), Vec3::x() * 1.9, Vec3::y() * 2.1, Vec3::z()]);
        assert_eq!((found.contacts.len(), found.apart.len(), found.failed.len()), (2, 1, 0));
        assert_eq!(found.tally, Tally { fallbacks: [0, 3, 0, 0], ..Tally::default() });
    }

    #[test]
    fn nobody_left_is_an_error() {
        let chain = Chain::new(Box::new(Helpless), vec![Box::new(SphereSphere)]);
        let found = resolve(&chain, &[Vec3::zeros(), Vec3::zeros()]);
        assert_eq!(found.failed, [(0, Why::TooDeep)]);
    }

    #[test]
    fn a_position_that_is_not_finite_is_an_error() {
        let chain = Chain::new(Box::new(SphereSphere), Vec::new());
        let (shape, frame) = (Shape::Sphere(Sphere { radius: 1.0 }), Mat3::identity());
        let body = Posed::new(&shape, &frame);
        let lost = Vec3::new(f64::INFINITY, 0.0, 0.0);
        assert_eq!(chain.touch(&body, &body, &lost, None), Outcome::Failed(Why::NotFinite));
    }
}
