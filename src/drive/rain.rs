//! Rain: layers of particles that appear in a slab and fall.
//!
//! The slab is cut into equal cells, at least one spacing wide. A particle stands in the middle of
//! its cell, moved by a random step that leaves its bounding sphere inside: no two particles of a
//! layer can overlap, not even across a periodic border, and none leaves the slab.
//!
//! A layer [`Within`] a region leaves out the cells where a particle would reach out of the region or meet a wall: it stands in the
//! next cell, and those behind it after that, so large ones do not become fewer. All ranks know all walls, and find the same.

use super::region::Region;
use super::{Drive, DriveError, Moment, Newcomers, SavedColumn, SavedState, Values};
use crate::cell::Cell;
use crate::comm::Comm;
use crate::contact::StateColumn;
use crate::ids::GlobalId;
use crate::math::Vec3;
use crate::particles::mix::Mix;
use crate::particles::orientations::Orientations;
use crate::particles::walls::{Wall, met_by};
use crate::particles::{Library, Particles, records::Particle};
use crate::random::{Random, mixed};
use serde::{Deserialize, Serialize};

/// Layers of more cells than this are not looked at before the run.
pub const LOOKED_AT: u64 = 20_000;
/// How often a particle looks for a place in a cell.
const TRIES: usize = 50;
/// Names the random numbers of these places.
const STREAM: u64 = 0x7261_696e;
/// A particle may reach out of a region by so much of a cell, for rounding.
const ROUNDING: f64 = 1e-6;

/// Where the particles of a layer are that leaves places out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Within {
    /// They are in it with their whole bounding spheres, and clear of walls.
    pub region: Region,
    /// How many of a layer are within the region, about.
    pub places: u64,
    /// How many of these are clear of walls that stand as at the beginning, about; not 0.
    pub free: u64,
}

/// Layers of particles that fall in at intervals.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rain {
    /// Which shapes, and their share of the particles.
    pub mix: Mix,
    /// How many particles in all.
    pub count: u64,
    /// Steps between layers; a layer waits until its place is free.
    pub every: u64,
    /// Lowest corner of the slab in which a layer appears [m].
    pub low: Vec3,
    /// Highest corner of the slab [m].
    pub high: Vec3,
    /// Least width of a particle's cell, which no particle exceeds [m].
    pub spacing: f64,
    /// Velocity at the start [m/s].
    pub velocity: Vec3,
    /// Orientations.
    pub orientations: Orientations,
    /// The region in the slab to which particles keep, clear of walls; `None`: the whole slab, of which walls are clear.
    pub within: Option<Within>,
}

impl Rain {
    /// Cells along each axis.
    pub fn cells(&self) -> [u32; 3] {
        let extent = self.high - self.low;
        [0, 1, 2].map(|axis| cells_along(extent[axis], self.spacing))
    }

    /// Particles in a full layer.
    pub fn per_layer(&self) -> u64 {
        self.cells().iter().fold(1, |all: u64, &n| all.saturating_mul(n.into()))
    }

    /// Particles in a layer, about, if it leaves places out.
    pub fn in_layer(&self) -> u64 {
        self.within.as_ref().map_or_else(|| self.per_layer(), |within| within.free.max(1))
    }

    /// Particles in the next layer, if so many have fallen; at most, if it leaves places out.
    pub fn in_next_layer(&self, fallen: u64) -> u64 {
        self.count.saturating_sub(fallen).min(self.per_layer())
    }

    /// Does the slab reach behind a wall? Rounding is forgiven.
    pub fn is_through(&self, wall: &Wall) -> bool {
        wall.depth(&(self.low, self.high)) / self.spacing > ROUNDING
    }

    /// Layers in all; the last one may be partly filled.
    pub fn layers(&self) -> u64 {
        self.count.div_ceil(self.in_layer())
    }

    /// Steps from one layer to the next, if nothing else holds them up: as many as a layer needs to fall out of the slab,
    /// rounded up to a multiple of `every`. `None` if it does not fall out. Gravity in m/s², the step in s.
    pub fn interval(&self, gravity: &Vec3, periodic: [bool; 3], dt: f64) -> Option<u64> {
        let extent = self.high - self.low;
        let out = (0..3)
            .filter(|&axis| !periodic[axis])
            .filter_map(|axis| time_to_go(extent[axis], self.velocity[axis], gravity[axis]))
            .reduce(f64::min)?;
        let steps = ((out / dt).ceil() as u64).max(1);
        Some(steps.div_ceil(self.every).saturating_mul(self.every))
    }

    /// How many steps a particle needs to fall from the slab to a bed of this depth [m] on the far side of the box from `low`
    /// to `high` [m]. `None` if it does not get there. Gravity in m/s², the step in s.
    pub fn fall(&self, low: &Vec3, high: &Vec3, bed: f64, gravity: &Vec3, dt: f64) -> Option<u64> {
        let axis = if *gravity == Vec3::zeros() { self.velocity.iamax() } else { gravity.iamax() };
        let (speed, pull) = (self.velocity[axis], gravity[axis]);
        let is_down = pull < 0.0 || (pull == 0.0 && speed < 0.0);
        let distance =
            if is_down { self.low[axis] - low[axis] } else { high[axis] - self.high[axis] };
        Some((time_to_go((distance - bed).max(0.0), speed, pull)? / dt).ceil() as u64)
    }
}

/// When a body that starts at a velocity [m/s] under an acceleration [m/s²] is first a distance [m] away; `None` for never [s].
fn time_to_go(distance: f64, velocity: f64, acceleration: f64) -> Option<f64> {
    // Against the acceleration it may get there before it turns.
    let before_it_turns = velocity * velocity - 2.0 * acceleration.abs() * distance;
    let is_braked = velocity * acceleration < 0.0;
    let speed = velocity.abs();
    if acceleration == 0.0 || (is_braked && before_it_turns >= 0.0) {
        let later = if acceleration == 0.0 { speed } else { before_it_turns.sqrt() };
        return (speed > 0.0).then(|| 2.0 * distance / (speed + later));
    }
    let towards = if is_braked { -speed } else { speed };
    let there = 2.0f64.mul_add(acceleration.abs() * distance, speed * speed).sqrt();
    Some((there - towards) / acceleration.abs())
}

/// How many cells of at least this width fit into a length, rounding forgiven.
pub fn cells_along(length: f64, width: f64) -> u32 {
    (length / width * (1.0 + 1e-9)).floor() as u32
}

/// The particle of a number `k` of a layer, whose first one has the id `first_id`. Shape, size, orientation and place are those of its id
/// under the scene's `seed`.
pub fn of_layer(rain: &Rain, seed: u64, first_id: u64, k: u64, library: &Library) -> Particle {
    let id = first_id + k;
    let mut random = Random::of(seed, id);
    let shape = rain.mix.pick(random.unit());
    let scale = library.sizes[shape.index()].draw(&mut random);
    let radius = library.radius[shape.index()] * scale;
    let position = place_in_cell(rain, k, radius, &mut random);
    Particle {
        scale,
        velocity: rain.velocity,
        quaternion: rain.orientations.draw(&mut random),
        ..Particle::at_rest(GlobalId(id), shape, position)
    }
}

/// A place in a cell of the slab that leaves a sphere inside.
fn place_in_cell(rain: &Rain, k: u64, radius: f64, random: &mut Random) -> Vec3 {
    let [nx, ny, nz] = rain.cells().map(u64::from);
    let cell = (rain.high - rain.low).component_div(&Vec3::new(nx as f64, ny as f64, nz as f64));
    let place = [k % nx, k / nx % ny, k / (nx * ny)];
    Vec3::from_fn(|axis, _| {
        let room = (0.5 * cell[axis] - radius).max(0.0);
        rain.low[axis] + (place[axis] as f64 + 0.5) * cell[axis] + room * random.signed()
    })
}

/// A layer that leaves places out: under which seed, at which look, from which id on, and how many particles at most.
#[derive(Clone, Copy, Debug)]
pub struct Layer {
    /// Of the scene.
    pub seed: u64,
    /// The number of the time at which it was looked for; another one has other places.
    pub look: u64,
    /// Of its first particle.
    pub first_id: u64,
    /// So many particles are to come.
    pub most: u64,
}

/// Has any cell of a layer a place for a sphere within a region and clear of these walls?
pub fn has_place(
    (rain, region): (&Rain, &Region),
    radius: f64,
    cell: &Cell,
    walls: &[&Wall],
) -> bool {
    let is_clear = |place: Vec3| is_clear_in((rain, region), radius, cell, walls, &place);
    (0..rain.per_layer()).any(|k| {
        let mut random = Random::of(STREAM, k);
        (0..4 * TRIES).any(|_| is_clear(place_in_cell(rain, k, radius, &mut random)))
    })
}

/// Is a sphere there within a region, and clear of these walls?
fn is_clear_in(
    (rain, region): (&Rain, &Region),
    radius: f64,
    cell: &Cell,
    walls: &[&Wall],
    place: &Vec3,
) -> bool {
    region.distance(place, cell) + radius <= ROUNDING * rain.spacing
        && met_by(walls.iter().copied(), cell, place, radius).is_none()
}

/// Where the particles of a layer within a region stand, in the order of their ids: as many as find places clear of these walls.
pub fn places_within(
    (rain, region): (&Rain, &Region),
    layer: Layer,
    cell: &Cell,
    walls: &[&Wall],
    library: &Library,
) -> Vec<Vec3> {
    let Layer { seed, look, first_id, most } = layer;
    let radius_of = |id: u64| {
        let grain = of_layer(rain, seed, id, 0, library);
        library.radius[grain.shape.index()] * grain.scale
    };
    let mut places = Vec::new();
    let mut radius = radius_of(first_id);
    for k in 0..rain.per_layer() {
        if places.len() as u64 == most {
            break;
        }
        let id = first_id + places.len() as u64;
        let mut random = Random::of(mixed(&[seed, STREAM, look, id]), k);
        let is_clear = |place: &Vec3| is_clear_in((rain, region), radius, cell, walls, place);
        let mut tries = (0..TRIES).map(|_| place_in_cell(rain, k, radius, &mut random));
        if let Some(place) = tries.find(is_clear) {
            places.push(place);
            radius = radius_of(id + 1);
        }
    }
    places
}

/// The rain of a running simulation: what has fallen and when more is due.
#[derive(Clone, Debug)]
pub struct RainGauge {
    rain: Rain,
    seed: u64,
    /// Particles that have fallen in this stage.
    fallen: u64,
    /// Has it warned that no place is clear?
    warned: bool,
    warnings: Vec<String>,
}

/// Names [`RainGauge`] among the drives.
const NAME: &str = "rain";
/// Particles that have fallen in this stage.
const FALLEN: StateColumn = StateColumn::new("fallen", 1, "1");

/// What a snapshot holds when so many particles have fallen.
pub fn saved(fallen: u64) -> SavedState {
    let columns = vec![SavedColumn::new(FALLEN, Values::Counts(vec![fallen]))];
    SavedState { drive: NAME.to_owned(), columns }
}

impl RainGauge {
    /// Before the first layer.
    pub const fn new(rain: Rain, seed: u64) -> Self {
        Self { rain, seed, fallen: 0, warned: false, warnings: Vec::new() }
    }

    /// May a layer fall after this many steps of the stage?
    const fn is_due(&self, stage_step: u64) -> bool {
        !self.is_over() && stage_step.is_multiple_of(self.rain.every)
    }

    /// Has everything fallen?
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

    /// The next layer; its first particle gets the id `first_id`.
    fn next_layer(&mut self, first_id: u64) -> Newcomers {
        let count = self.rain.in_next_layer(self.fallen);
        self.fallen += count;
        let (rain, seed) = (self.rain.clone(), self.seed);
        let make = move |k, library: &Library| of_layer(&rain, seed, first_id, k, library);
        Newcomers { count, make: Box::new(make) }
    }

    /// The next layer if it leaves places out; `None` if none is left.
    fn next_within(
        &mut self,
        region: &Region,
        moment: &Moment,
        first_id: u64,
        particles: &Particles,
    ) -> Option<Newcomers> {
        let (rain, seed) = (self.rain.clone(), self.seed);
        let look = moment.stage_step / rain.every;
        let layer = Layer { seed, look, first_id, most: rain.in_next_layer(self.fallen) };
        let Particles { cell, library, walls, .. } = particles;
        let walls: Vec<&Wall> = walls.iter().collect();
        let places = places_within((&rain, region), layer, cell, &walls, library);
        if places.is_empty() {
            if !std::mem::replace(&mut self.warned, true) {
                self.warnings.push(format!(
                    "rain: at step {} no place of a layer is clear of the walls, {}; it falls when one is",
                    moment.step,
                    region.words()
                ));
            }
            return None;
        }
        let count = places.len() as u64;
        self.fallen += count;
        let make = move |k, library: &Library| Particle {
            position: places[k as usize],
            ..of_layer(&rain, seed, first_id, k, library)
        };
        Some(Newcomers { count, make: Box::new(make) })
    }
}

impl Drive for RainGauge {
    fn name(&self) -> &'static str {
        NAME
    }

    /// The next layer, if one is due and its place is free on all ranks.
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
        match self.rain.within.clone() {
            None => Some(self.next_layer(first_id)),
            Some(Within { region, .. }) => self.next_within(&region, moment, first_id, particles),
        }
    }

    fn warnings(&mut self) -> Vec<String> {
        std::mem::take(&mut self.warnings)
    }

    fn unfinished(&self) -> Option<&'static str> {
        (!self.is_over()).then_some("rain still falls")
    }

    fn last_warnings(&self, _walls: &[Wall], has_stopped: bool) -> Vec<String> {
        if has_stopped || self.is_over() {
            return Vec::new();
        }
        vec![format!(
            "only {} of {} particles of rain have fallen: too few steps, or the slab was never free",
            self.fallen, self.rain.count
        )]
    }

    fn save(&self, _walls: &[Wall], _comm: &mut dyn Comm) -> Vec<SavedColumn> {
        saved(self.fallen).columns
    }

    /// In a new stage all of it falls again.
    fn resume(
        &mut self,
        saved: &SavedState,
        is_new_stage: bool,
        _walls: &mut [Wall],
        _is_root: bool,
    ) -> Result<(), DriveError> {
        if !is_new_stage {
            self.fallen = saved.counts(&FALLEN)?.iter().sum();
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::{Rain, RainGauge, time_to_go};
    use crate::cell::Cell;
    use crate::ids::{GlobalId, MaterialId, ShapeId};
    use crate::math::Vec3;
    use crate::particles::mix::Mix;
    use crate::particles::orientations::Orientations;
    use crate::particles::records::Particle;
    use crate::particles::walls::Wall;
    use crate::particles::{Library, Needs, Particles};
    use crate::shape::{Shape, Sphere};

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
        particles.append_walls();
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

    /// From where a grain of 0.05 would reach into a side of the slab.
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

    /// The way after the time is the distance, and half as long before it is not, whichever way it started.
    #[test]
    fn the_time_out_of_the_slab_is_that_of_a_fall() {
        for (velocity, acceleration) in
            [(0.0, -9.81), (-2.0, -9.81), (2.0, -9.81), (3.0, -1.0), (-0.5, 0.0), (0.1, 0.3)]
        {
            let way = |t: f64| (velocity * t + 0.5 * acceleration * t * t).abs();
            let time = time_to_go(0.7, velocity, acceleration).unwrap();
            assert!((way(time) - 0.7).abs() < 1e-14, "{velocity} {acceleration}: {}", way(time));
            for k in 1..1000 {
                assert!(way(time * f64::from(k) / 1000.0) < 0.7, "{velocity} {acceleration} {k}");
            }
        }
        assert_eq!(time_to_go(0.7, 0.0, 0.0), None);
    }

    /// Sixty particles fit into a layer; a hundred had fallen when two hundred were asked for.
    #[test]
    fn more_rain_than_there_was_falls_in_full() {
        let mut rain = rain(200);
        assert_eq!(rain.rain.per_layer(), 60);
        rain.fallen = 100;
        let mut layers = Vec::new();
        while !rain.is_over() {
            layers.push(rain.next_layer(100).count);
        }
        assert_eq!(layers, [60, 40]);
    }
}
