//! Lists that drives keep of individual particles that have come or gone at a moment ([`super::Observer::lists`]).

use crate::particles::records::Particle;

/// Lists of a drive, with the particles of the last moment that had any.
#[derive(Clone, Debug, Default)]
pub struct Lists {
    /// By place: the name of its list, if it keeps one, and its particles.
    of_place: Vec<(Option<String>, Vec<Particle>)>,
    step: u64,
}

impl Lists {
    /// Empty lists of places in order, each with a name if it keeps one.
    pub fn new(names: impl Iterator<Item = Option<String>>) -> Self {
        Self { of_place: names.map(|name| (name, Vec::new())).collect(), step: 0 }
    }

    /// Names of the lists.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.of_place.iter().filter_map(|(name, _)| name.as_deref())
    }

    /// Records particles at a place, if it keeps a list. Particles of an earlier step that were not taken are dropped.
    pub fn note(&mut self, step: u64, place: usize, particles: &[Particle]) {
        if self.step != step {
            self.of_place.iter_mut().for_each(|(_, noted)| noted.clear());
            self.step = step;
        }
        if let (Some(_), noted) = &mut self.of_place[place] {
            noted.extend_from_slice(particles);
        }
    }

    /// Empties the lists and returns their particles, in the order in which they were recorded.
    pub fn take(&mut self) -> impl Iterator<Item = Vec<Particle>> {
        let lists = self.of_place.iter_mut().filter(|(name, _)| name.is_some());
        lists.map(|(_, noted)| std::mem::take(noted))
    }
}

#[cfg(test)]
mod tests {
    use super::Lists;
    use crate::ids::{GlobalId, ShapeId};
    use crate::math::Vec3;
    use crate::particles::records::Particle;

    /// Lists that are never written do not keep all particles that have passed.
    #[test]
    fn what_nobody_asks_for_goes_with_the_next_step() {
        let grain = |id| Particle::at_rest(GlobalId(id), ShapeId(0), Vec3::zeros());
        let taken = |lists: &mut Lists| lists.take().collect::<Vec<_>>();
        let name = |name: &str| Some(name.to_owned());
        let mut lists = Lists::new([name("in"), None, name("out")].into_iter());
        assert!(lists.names().eq(["in", "out"]));
        lists.note(0, 0, &[grain(7)]);
        lists.note(0, 1, &[grain(8)]);
        lists.note(0, 2, &[grain(9)]);
        assert_eq!(taken(&mut lists), [vec![grain(7)], vec![grain(9)]]);
        assert!(lists.take().all(|of_one| of_one.is_empty()));
        lists.note(3, 0, &[grain(1)]);
        lists.note(5, 0, &[grain(2)]);
        lists.note(5, 0, &[grain(3)]);
        assert_eq!(taken(&mut lists), [vec![grain(2), grain(3)], vec![]]);
    }
}
