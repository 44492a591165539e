//! Checks of the room for the particles to come.

use super::reader::Section;
use super::walls::Walls;
use super::{Inlet, Mix, Rain};
use crate::cell::Cell;
use crate::drive::inlet::Amount;
use crate::drive::rain::{LOOKED_AT, Layer, Site, Within};
use crate::drive::region::Region;
use crate::ids::ShapeId;
use crate::population::Library;
use crate::random::Random;
use crate::walls::{Wall, met_by};

/// Number of places of an inlet that are checked.
const PLACES: u64 = 1000;

/// Data for the checks.
pub(super) struct Room<'a> {
    pub(super) root: &'a Section<'a>,
    pub(super) cell: &'a Cell,
    pub(super) walls: &'a Walls<'a>,
    /// All shapes of the particles.
    pub(super) library: &'a Library,
    pub(super) seed: u64,
    /// Is there an earlier stage, after which walls may stand elsewhere?
    pub(super) has_start: bool,
}

impl Room<'_> {
    /// Lets a layer of rain leave places out if walls are in its slab, and counts the free places. Rejects rain without any
    /// free place.
    pub(super) fn for_rain(&self, rain: &mut Rain) {
        if rain.per_layer() == 0 {
            return;
        }
        if rain.within.is_none() {
            if !self.walls.known().any(|wall| rain.is_through(wall)) {
                return;
            }
            let region = Region::Box { low: rain.low, high: rain.high };
            rain.within = Some(Within { region, places: 0, free: 0 });
        }
        let Some(Within { region, .. }) = rain.within.clone() else { return };
        if rain.per_layer() > LOOKED_AT {
            rain.within = Some(Within { region, places: rain.per_layer(), free: rain.per_layer() });
            return;
        }
        let layer = Layer { seed: self.seed, look: 0, first_id: 0, most: rain.per_layer() };
        let count = |walls: &[&Wall]| {
            let site = Site { rain, region: &region, cell: self.cell, walls };
            site.places(layer, self.library).len() as u64
        };
        let still: Vec<&Wall> = self.walls.still().collect();
        let all: Vec<&Wall> = self.walls.known().collect();
        let (places, beside_still, free) = (count(&[]), count(&still), count(&all));
        let largest = largest_radius(&rain.mix, self.library);
        let fits = |walls: &[&Wall]| {
            Site { rain, region: &region, cell: self.cell, walls }.has_place(largest)
        };
        let problem = if !fits(&[]) {
            Some(format!(
                "the largest particle, with a bounding radius of {largest:.4e} m, fits in none of the {} cells of a \
                 layer. Give the region a larger `radius` or a longer `axis`, or the layer a `spacing` as wide as the \
                 region",
                rain.per_layer()
            ))
        } else if !self.has_start && !fits(&still) {
            let wall = in_the_way(&region, largest, &still, self.cell).unwrap_or_default();
            Some(format!(
                "walls leave none of the {places} places of a layer free for the largest particle, most often \
                 `{wall}`; give another region by `low` and `high`, or `axis` and `radius`"
            ))
        } else {
            None
        };
        if let Some(problem) = problem
            && let Some(given) = self.root.section("fill").and_then(|fill| fill.get("rain"))
        {
            given.fail(problem);
        }
        // If no place is free now, a wall has moved, or will.
        let free = match free {
            _ if self.has_start => places,
            0 => beside_still,
            free => free,
        };
        rain.within = Some(Within { region, places, free: free.max(1) });
    }

    /// Rejects inlets without a place that is clear of the resting walls for their largest particle: the others would wait
    /// behind it.
    pub(super) fn for_inlets(&self, inlets: &[Inlet]) {
        if self.has_start {
            return;
        }
        let still: Vec<&Wall> = self.walls.still().collect();
        for (section, inlet) in self.root.sections("inlet").iter().zip(inlets) {
            let radius = largest_radius(&inlet.mix, self.library);
            let is_free = |k| {
                let place = inlet.region.draw(&mut Random::of(0, k));
                place.is_some_and(|place| {
                    met_by(still.iter().copied(), self.cell, &place, radius).is_none()
                })
            };
            if (0..PLACES).any(is_free) {
                continue;
            }
            let wall = in_the_way(&inlet.region, radius, &still, self.cell).unwrap_or_default();
            section.fail(format!(
                "none of {PLACES} places is free for the largest particle, with a bounding radius of {radius:.4e} m, \
                 because of walls, most often `{wall}`. It would block all others: move the region, make it wider, or \
                 the particles smaller"
            ));
        }
    }

    /// Rejects inlets that end after more than the domain holds, unless particles can leave.
    pub(super) fn for_amounts(&self, inlets: &[Inlet]) {
        if self.root.get("outlet").is_some() {
            return;
        }
        let room = self.cell.volume();
        for (section, inlet) in self.root.sections("inlet").iter().zip(inlets) {
            let Library { shapes, mass, .. } = self.library;
            let volume = |shape: usize| shapes[shape].volume();
            // Volume of the smallest, mass of the densest.
            let densities = inlet.mix.shapes().map(|id| mass[id.index()] / volume(id.index()));
            let (key, most, unit, of_one) = match inlet.until {
                None => continue,
                Some(Amount::Count(count)) => {
                    ("count", count, "", least_volume(&inlet.mix, self.library))
                }
                Some(Amount::Mass(mass)) => {
                    ("mass", mass, " kg", 1.0 / densities.fold(0.0, f64::max))
                }
            };
            if most * of_one > room
                && let Some(given) = section.get(key)
            {
                given.fail(format!(
                    "needs a volume of {:.3e} m3, but the domain has {room:.3e} m3 and no [[outlet]], so it holds \
                     less than {:.3e}{unit}. Leave `{key}` out if the steps end it",
                    most * of_one,
                    room / of_one
                ));
            }
        }
    }
}

/// Volume of the smallest particle of a mix [m³].
pub(super) fn least_volume(mix: &Mix, library: &Library) -> f64 {
    let of = |id: ShapeId| {
        let [scale, _] = library.sizes[id.index()].scales();
        library.shapes[id.index()].volume() * scale.powi(3)
    };
    mix.shapes().map(of).fold(f64::INFINITY, f64::min)
}

/// Largest bounding radius of a mix [m].
fn largest_radius(mix: &Mix, library: &Library) -> f64 {
    let of = |id: ShapeId| {
        let [_, scale] = library.sizes[id.index()].scales();
        library.radius[id.index()] * scale
    };
    mix.shapes().map(of).fold(0.0, f64::max)
}

/// Wall that blocks most places of a region.
fn in_the_way<'a>(
    region: &Region,
    radius: f64,
    walls: &[&'a Wall],
    cell: &Cell,
) -> Option<&'a str> {
    let places = (0..PLACES).filter_map(|k| region.draw(&mut Random::of(0, k)));
    let mut taken = vec![0_u64; walls.len()];
    for place in places {
        for (wall, taken) in walls.iter().zip(&mut taken) {
            *taken += u64::from(met_by([*wall], cell, &place, radius).is_some());
        }
    }
    let most = walls.iter().zip(&taken).filter(|(_, taken)| **taken > 0);
    // The first one if several block equally many.
    let most = most.rev().max_by_key(|(_, taken)| **taken)?;
    Some(&most.0.name)
}
