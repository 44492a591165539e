//! Two bodies in place, for contact resolvers.

use super::random::Draw;
use dem_mpi::contact::{ContactResolver, Outcome, Posed};
use dem_mpi::math::{Mat3, Vec3};
use dem_mpi::random::Random;
use dem_mpi::shape::Shape;

/// Two bodies with their orientations, and the vector from the first centre to the second.
#[derive(Clone)]
pub(crate) struct Case {
    pub(crate) a: (Shape, Mat3),
    pub(crate) b: (Shape, Mat3),
    pub(crate) r: Vec3,
}

impl Case {
    /// Overlap along a random normal, or clearance if negative; the least overlap may be less.
    pub(crate) fn of(
        a: (Shape, Mat3),
        b: (Shape, Mat3),
        random: &mut Random,
        overlap: f64,
    ) -> Self {
        let mut case = Self { a, b, r: Vec3::zeros() };
        let normal = random.direction();
        case.r = case.a().support(&normal) - case.b().support(&-normal) - normal * overlap;
        case
    }

    pub(crate) fn a(&self) -> Posed<'_> {
        Posed::new(&self.a.0, &self.a.1)
    }

    pub(crate) fn b(&self) -> Posed<'_> {
        Posed::new(&self.b.0, &self.b.1)
    }

    pub(crate) fn resolve(&self, resolver: &dyn ContactResolver, warm: Option<&Vec3>) -> Outcome {
        resolver.touch(&self.a(), &self.b(), &self.r, warm)
    }
}
