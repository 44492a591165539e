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

#[cfg(test)]
mod tests {
    use super::Chain;
    use crate::contact::{
        Bodies, ContactResolver, History, Outcome, Pair, Posed, SphereSphere, Tally, Why,
    };
    use crate::ids::{ShapeId, Slot};
    use crate::math::Vec3;
    use crate::shape::{Shape, Sphere};

    /// Gives up on every pair.
    struct Helpless;

    impl ContactResolver for Helpless {
        fn name(&self) -> &'static str {
            "helpless"
        }

        fn touch(&self, _: &Posed, _: &Posed, _: &Vec3, _: Option<&Vec3>) -> Outcome {
            Outcome::Failed(Why::NoConvergence)
        }
    }

    fn resolve(chain: &Chain, centres: &[Vec3]) -> (Result<usize, Why>, Tally) {
        let bodies = Bodies {
            position: centres,
            frame: None,
            shape: &vec![ShapeId(0); centres.len()],
            library: &[Shape::Sphere(Sphere { radius: 1.0 })],
            period: Vec3::repeat(f64::INFINITY),
        };
        let pairs: Vec<_> =
            (1..centres.len() as u32).map(|b| Pair { a: Slot(0), b: Slot(b) }).collect();
        let history = vec![History::default(); pairs.len()];
        let (mut out, mut tally) = (Vec::new(), Tally::default());
        let result = chain.resolve(0, &pairs, &history, &bodies, &mut out, &mut tally);
        (result.map(|()| out.len()).map_err(|e| e.why), tally)
    }

    #[test]
    fn the_stage_that_answers_is_counted() {
        let fallbacks: Vec<Box<dyn ContactResolver>> =
            vec![Box::new(Helpless), Box::new(SphereSphere)];
        let chain = Chain::new(Box::new(Helpless), fallbacks);
        let (found, tally) =
            resolve(&chain, &[Vec3::zeros(), Vec3::x() * 1.9, Vec3::y() * 2.1, Vec3::z()]);
        assert_eq!(found, Ok(2));
        assert_eq!(tally, Tally { pairs: 3, contacts: 2, fallbacks: [0, 3, 0, 0] });
    }

    #[test]
    fn nobody_left_is_an_error() {
        let chain = Chain::new(Box::new(Helpless), vec![Box::new(SphereSphere)]);
        assert_eq!(resolve(&chain, &[Vec3::zeros(), Vec3::zeros()]).0, Err(Why::TooDeep));
    }

    #[test]
    fn a_position_that_is_not_finite_is_an_error() {
        let chain = Chain::new(Box::new(SphereSphere), Vec::new());
        let lost = Vec3::new(f64::INFINITY, 0.0, 0.0);
        assert_eq!(resolve(&chain, &[Vec3::zeros(), lost]).0, Err(Why::NotFinite));
    }
}
