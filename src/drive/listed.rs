//! Grains that have come or gone at a moment, one by one, for the lists that drives keep of them ([`super::Drive::lists`]).

use crate::particles::records::Particle;

/// Those of the last moment at which there were any.
#[derive(Clone, Debug, Default)]
pub struct Listed {
    step: u64,
    grains: Vec<(usize, Particle)>,
}

impl Listed {
    /// Notes a grain for the list of a number. What is left of a step before goes: nobody has asked for it.
    pub fn note(&mut self, step: u64, list: usize, grain: Particle) {
        if self.step != step {
            self.grains.clear();
            self.step = step;
        }
        self.grains.push((list, grain));
    }

    /// All that it has, in the order in which they were noted.
    pub fn take(&mut self) -> Vec<(usize, Particle)> {
        std::mem::take(&mut self.grains)
    }
}

#[cfg(test)]
mod tests {
    use super::Listed;
    use crate::ids::{GlobalId, ShapeId};
    use crate::math::Vec3;
    use crate::particles::records::Particle;

    /// A simulation of which nobody writes lists does not keep all that has ever passed.
    #[test]
    fn what_nobody_asks_for_goes_with_the_next_step() {
        let grain = |id| Particle::at_rest(GlobalId(id), ShapeId(0), Vec3::zeros());
        let mut listed = Listed::default();
        listed.note(0, 0, grain(7));
        listed.note(0, 1, grain(9));
        assert_eq!(listed.take(), [(0, grain(7)), (1, grain(9))]);
        assert_eq!(listed.take(), []);
        listed.note(3, 0, grain(1));
        listed.note(5, 0, grain(2));
        listed.note(5, 0, grain(3));
        assert_eq!(listed.take(), [(0, grain(2)), (0, grain(3))]);
    }
}
