//! Rain of a running simulation: particles that have fallen, and when more are due.

use super::{Layer, Rain, Site, Within, of_layer};
use crate::comm::Comm;
use crate::contact::StateColumn;
use crate::drive::region::Region;
use crate::drive::{
    Drive, DriveError, Moment, Newcomers, Observer, Outcome, Reporter, Restart, SavedColumn,
    SavedState, Standing,
};
use crate::math::Vec3;
use crate::particles::Particles;
use crate::particles::records::Particle;
use crate::population::Library;
use crate::walls::Wall;

/// Inserts layers of rain.
#[derive(Clone, Debug)]
pub struct RainGauge {
    rain: Rain,
    seed: u64,
    /// Particles that have fallen in this stage.
    fallen: u64,
    /// Has a warning been given that no place is clear?
    warned: bool,
    warnings: Vec<String>,
}

/// Name of [`RainGauge`] among the drives.
const NAME: &str = "rain";
/// Particles that have fallen in this stage.
const FALLEN: StateColumn = StateColumn::new("fallen", 1, "1");

/// State in a snapshot after this number of fallen particles.
pub fn saved(fallen: u64) -> SavedState {
    let columns = vec![SavedColumn::counts(FALLEN, std::iter::once(fallen))];
    SavedState { drive: NAME.to_owned(), columns }
}

impl RainGauge {
    /// Rain before the first layer.
    pub const fn new(rain: Rain, seed: u64) -> Self {
        Self { rain, seed, fallen: 0, warned: false, warnings: Vec::new() }
    }

    /// May a layer fall after this number of steps of the stage?
    const fn is_due(&self, stage_step: u64) -> bool {
        !self.is_over() && stage_step.is_multiple_of(self.rain.every)
    }

    /// Have all particles fallen?
    const fn is_over(&self) -> bool {
        self.fallen >= self.rain.count
    }

    /// Is an owned particle where a layer would appear, or a wall that has moved in and is not left out?
    fn is_blocked(&self, particles: &Particles) -> bool {
        if let Some(Within { region, .. }) = &self.rain.within {
            let distance =
                |slot: usize| region.distance(&particles.position[slot], &particles.cell);
            return (0..particles.owned).any(|slot| distance(slot) < particles.radius(slot));
        }
        let Rain { low, high, .. } = self.rain;
        let (middle, half) = ((low + high) * 0.5, (high - low) * 0.5);
        let mut owned = 0..particles.owned;
        let by_particle = owned.any(|slot| particles.comes_into(slot, &middle, &half));
        let by_wall = |wall: &Wall| self.rain.is_through(wall);
        by_particle || particles.walls.iter().any(by_wall)
    }

    /// Inserts `count` particles of the next layer, the first with the id `first_id`. `places` are given if the layer
    /// leaves places out.
    fn fall(&mut self, count: u64, first_id: u64, places: Option<Vec<Vec3>>) -> Newcomers {
        self.fallen += count;
        let (rain, seed) = (self.rain.clone(), self.seed);
        let make = move |k, library: &Library| {
            let particle = of_layer(&rain, seed, first_id, k, library);
            let position = places.as_ref().map_or(particle.position, |places| places[k as usize]);
            Particle { position, ..particle }
        };
        Newcomers { count, make: Box::new(make) }
    }

    /// Places of the next layer within a region.
    fn places(
        &mut self,
        region: &Region,
        moment: &Moment,
        first_id: u64,
        particles: &Particles,
    ) -> Vec<Vec3> {
        let Self { rain, seed, .. } = self;
        let most = rain.in_next_layer(self.fallen);
        let layer = Layer { seed: *seed, look: moment.stage_step / rain.every, first_id, most };
        let Particles { cell, library, walls, .. } = particles;
        let walls: Vec<&Wall> = walls.iter().collect();
        let places = Site { rain, region, cell, walls: &walls }.places(layer, library);
        if places.is_empty() && !std::mem::replace(&mut self.warned, true) {
            self.warnings.push(format!(
                "rain: at step {} no place of a layer is clear of the walls, {}; it waits until one is",
                moment.step,
                region.words()
            ));
        }
        places
    }
}

impl Drive for RainGauge {
    /// Next layer, if one is due and its place is free on all ranks.
    fn insert(
        &mut self,
        moment: &Moment,
        first_id: u64,
        particles: &Particles,
        comm: &mut dyn Comm,
    ) -> Option<Newcomers> {
        if !self.is_due(moment.stage_step) || comm.any(self.is_blocked(particles)) {
            return None;
        }
        let Some(Within { region, .. }) = self.rain.within.clone() else {
            return Some(self.fall(self.rain.in_next_layer(self.fallen), first_id, None));
        };
        let places = self.places(&region, moment, first_id, particles);
        (!places.is_empty()).then(|| self.fall(places.len() as u64, first_id, Some(places)))
    }
}

impl Observer for RainGauge {}

impl Reporter for RainGauge {
    fn name(&self) -> &'static str {
        NAME
    }

    fn warnings(&mut self) -> Vec<String> {
        std::mem::take(&mut self.warnings)
    }

    fn standing(&self) -> Standing {
        let unfinished = (!self.is_over()).then_some("rain still falls");
        Standing { unfinished, ..Standing::default() }
    }

    fn outcome(&self, _walls: &[Wall], has_stopped: bool) -> Outcome {
        let is_short = !has_stopped && !self.is_over();
        let warning = is_short.then(|| {
            format!(
                "only {} of {} particles of rain have fallen: too few steps, or the slab was never free",
                self.fallen, self.rain.count
            )
        });
        Outcome { warnings: warning.into_iter().collect(), ..Outcome::default() }
    }

    fn save(&self, _walls: &[Wall], _comm: &mut dyn Comm) -> Vec<SavedColumn> {
        saved(self.fallen).columns
    }

    /// A new stage starts with no fallen particles.
    fn resume(&mut self, restart: &Restart, _walls: &mut [Wall]) -> Result<(), DriveError> {
        if !restart.is_new_stage {
            self.fallen = restart.saved.counts(&FALLEN)?.iter().sum();
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::{Rain, RainGauge};
    use crate::cell::Cell;
    use crate::ids::{GlobalId, MaterialId, ShapeId};
    use crate::math::Vec3;
    use crate::particles::records::Particle;
    use crate::particles::{Needs, Particles};
    use crate::population::Library;
    use crate::population::mix::Mix;
    use crate::population::orientations::Orientations;
    use crate::shape::{Shape, Sphere};
    use crate::walls::Wall;

    /// A slab at the low end of x, at the top of a box that repeats along x.
    fn rain(count: u64) -> RainGauge {
        let (low, high) = (Vec3::new(0.0, 0.0, 0.8), Vec3::new(0.3, 1.0, 1.0));
        let mix = Mix::new(&[(ShapeId(0), 1.0)]);
        let (velocity, orientations) = (-Vec3::z(), Orientations::Random);
        let rain = Rain {
            mix,
            count,
            every: 1,
            low,
            high,
            spacing: 0.1,
            velocity,
            orientations,
            within: None,
        };
        RainGauge::new(rain, 1)
    }

    fn library() -> Library {
        let mut library = Library::default();
        library.push("sphere", Shape::Sphere(Sphere { radius: 0.05 }), MaterialId(0), 1.0);
        library.particle_shapes = 1;
        library
    }

    fn is_blocked(places: &[Vec3], wall: Option<(Vec3, Vec3)>) -> bool {
        let mut library = library();
        let walls = wall.into_iter().map(|(point, normal)| {
            let mut wall = Wall::plane("wall".to_owned(), point, normal);
            wall.enter(&mut library, MaterialId(0));
            wall
        });
        let walls = walls.collect();
        let cell = Cell::new(Vec3::zeros(), Vec3::repeat(1.0), [true, false, false]);
        let mut particles = Particles::new(Needs::default(), library, walls, cell);
        particles.strip_to_owned();
        for (id, place) in (0..).zip(places) {
            particles.push_owned(&Particle::at_rest(GlobalId(id), ShapeId(0), *place));
        }
        particles.append_pieces_and_walls();
        rain(1).is_blocked(&particles)
    }

    #[test]
    fn a_layer_waits_for_grains_in_its_place_across_a_period_too() {
        for (x, z, blocks) in
            [(0.1, 0.9, true), (0.5, 0.9, false), (0.98, 0.9, true), (0.98, 0.7, false)]
        {
            assert_eq!(is_blocked(&[Vec3::new(x, 0.5, z)], None), blocks, "{x} {z}");
        }
    }

    /// Positions from which a particle of radius 0.05 reaches into a side of the slab.
    #[test]
    fn a_layer_waits_for_grains_at_each_side() {
        let middle = Vec3::new(0.15, 0.5, 0.9);
        for (axis, sides) in [(0, [-0.05, 0.35]), (1, [-0.05, 1.05]), (2, [0.75, 1.05])] {
            for (side, out) in sides.into_iter().zip([-1.0, 1.0]) {
                for blocks in [true, false] {
                    let mut place = middle;
                    place[axis] = side + if blocks { -1e-3 } else { 1e-3 } * out;
                    assert_eq!(is_blocked(&[place], None), blocks, "{place:?}");
                }
            }
        }
    }

    #[test]
    fn a_layer_waits_for_a_wall_in_its_place() {
        for (z, blocks) in [(1.0, false), (0.95, true)] {
            assert_eq!(is_blocked(&[], Some((Vec3::z() * z, -Vec3::z()))), blocks, "{z}");
        }
    }

    /// A layer holds 60 particles; 100 had fallen when 200 were requested.
    #[test]
    fn more_rain_than_there_was_falls_in_full() {
        let mut rain = rain(200);
        assert_eq!(rain.rain.per_layer(), 60);
        rain.fallen = 100;
        let mut layers = Vec::new();
        while !rain.is_over() {
            layers.push(rain.fall(rain.rain.in_next_layer(rain.fallen), 100, None).count);
        }
        assert_eq!(layers, [60, 40]);
    }
}
