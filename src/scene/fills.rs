//! Initial particles and rain, from the parsed file to [`Fill`] and [`Rain`].

use super::listed::{Format, Source};
use super::matter::Shapes;
use super::orientations::orientations;
use super::reader::{Given, Section};
use super::regions::region;
use super::room::least_volume;
use super::sizes::by;
use super::{Fill, Lattice, Listed, Mix, Rain, listed};
use crate::cell::{AXES, Beyond, Cell};
use crate::drive::rain::{Within, cells_along};
use crate::ids::ShapeId;
use crate::math::Vec3;
use crate::population::Library;
use crate::population::sizes::By;
use crate::sim::start::DEEPEST_START;
use std::collections::HashMap;
use std::path::Path;

/// Default width of a cell of rain or lattice, in largest bounding diameters.
const ROOMY: f64 = 1.1;
/// Largest number of listed particles within others for which the start is still checked pair by pair.
const MOST_CROWDED: u64 = 1000;
/// Upper limit of the particle count; larger values are taken for typing errors.
const MOST: f64 = 1e12;

/// Data for reading fills.
pub(super) struct Fills<'a> {
    pub(super) shapes: &'a Shapes,
    pub(super) domain: Option<&'a Cell>,
    pub(super) gravity: Vec3,
    /// Folder of the scene's file.
    pub(super) folder: &'a Path,
    /// May particles be held, and so overlap?
    pub(super) any_held: bool,
    pub(super) seed: u64,
}

impl Fills<'_> {
    pub(super) fn read(&self, root: &Section) -> Option<(Vec<Fill>, Option<Rain>)> {
        let start = root.get("start");
        let kinds = "[fill.rain], [[fill.lattice]], [[fill.random]] or [[fill.file]]";
        let Some(given) = root.get("fill") else {
            if start.is_none() && root.get("inlet").is_none() {
                root.fail(format!("nothing to simulate: give {kinds}, or `start` = a snapshot"));
            }
            return Some((Vec::new(), None));
        };
        let fill = given.section()?;
        let rain = fill.optional("rain", |given| self.rain(&given.section()?));
        let mut initial: Vec<Option<Fill>> =
            fill.sections("lattice").iter().map(|s| self.lattice(s).map(Fill::Lattice)).collect();
        for section in fill.sections("file") {
            let first_id = initial.iter().flatten().fold(0, |first, fill| fill.end(first));
            initial.push(self.file(&section, first_id));
        }
        for section in fill.sections("random") {
            let scattered = self.scattered(&section, &initial);
            initial.push(scattered.map(Fill::Listed));
        }
        if let Some(crowd) = self.crowd(&initial) {
            fill.fail(crowd);
        }
        if initial.is_empty() && matches!(rain, Some(None)) {
            fill.fail(format!("has nothing in it; give {kinds}"));
        }
        if start.is_some() && !initial.is_empty() {
            fill.fail("the particles come from `start`; only rain may add to them");
        }
        Some((initial.into_iter().collect::<Option<_>>()?, rain?))
    }

    pub(super) fn mix(&self, section: &Section) -> Option<Mix> {
        let names = &self.shapes.names;
        let given = section.get("shapes");
        let by = section.read_or("shares", By::Number, by);
        let Some(given) = given else {
            let only = names.find_in(section, "shapes")?;
            return by.map(|_| Mix::new(&[(ShapeId(only as u16), 1.0)]));
        };
        let shares: Vec<Option<(ShapeId, f64)>> = match given.entries() {
            Some(entries) => entries
                .iter()
                .map(|(name, share)| {
                    let (index, share) = (names.find(share, name), share.number());
                    Some((ShapeId(index? as u16), share?))
                })
                .collect(),
            None => given
                .list()?
                .iter()
                .map(|item| Some((ShapeId(names.find(item, item.text()?)? as u16), 1.0)))
                .collect(),
        };
        let mut shares: Vec<(ShapeId, f64)> = shares.into_iter().collect::<Option<_>>()?;
        if shares.is_empty() {
            return None;
        }
        shares.sort_by_key(|&(shape, _)| shape);
        if shares.windows(2).any(|pair| pair[0].0 == pair[1].0) {
            given.fail("names a shape twice");
            return None;
        }
        let library = &self.shapes.library;
        // A shape with an error has no mass.
        Some(if by? == By::Mass && self.shapes.complete {
            Mix::by_mass(&shares, |shape| library.mean_mass(shape))
        } else {
            Mix::new(&shares)
        })
    }

    /// Largest bounding diameter, if all shapes are known.
    fn diameter(&self, mix: Option<&Mix>) -> Option<f64> {
        mix.filter(|_| self.shapes.complete).map(|mix| 2.0 * self.shapes.largest_radius(mix))
    }

    fn rain(&self, section: &Section) -> Option<Rain> {
        let mix = self.mix(section);
        let count = section
            .require("count")
            .and_then(|given| given.whole().filter(|&count| is_possible(section, count as f64)));
        let every = section.whole_or("every", 100);
        let velocity = section.vector_or("velocity", Vec3::zeros());
        let diameter = self.diameter(mix.as_ref());
        let spacing = section.read_or("spacing", diameter.map(|d| ROOMY * d), |given| {
            let spacing = given.number()?;
            if diameter.is_some_and(|d| spacing < d) {
                let least = diameter.unwrap_or_default();
                given
                    .fail(format!("must be at least the largest bounding diameter, {least:.4e} m"));
                return None;
            }
            Some(Some(spacing))
        });
        let corner = |key| section.optional(key, Given::vector);
        let orientations = orientations(section);
        let is_round = section.get("axis").or_else(|| section.get("radius")).is_some();
        let cylinder = is_round.then(|| region(section, false));
        let (low, high) = (corner("low"), corner("high"));
        let (velocity, domain, spacing) = (velocity?, self.domain?, spacing??);
        let (low, high) = match &cylinder {
            Some(cylinder) => cylinder.as_ref()?.bounds()?,
            None => self.slab(domain, spacing, low?, high?),
        };
        // The free places are counted once the walls are known.
        let within = cylinder.flatten().map(|region| Within { region, places: 0, free: 0 });
        let (mix, count, every, orientations) = (mix?, count?, every?, orientations?);
        let rain = Rain { mix, count, every, low, high, spacing, velocity, orientations, within };

        if let Some(beyond) = domain.beyond(&low, &high) {
            let what = format!("the slab {}", reaching(&beyond));
            let key = match &rain.within {
                Some(_) => "axis",
                None if beyond.is_above() => "high",
                None => "low",
            };
            section.get(key).map_or_else(|| section.fail(&what), |given| given.fail(&what));
        }
        cells_between(section, rain.within.is_some(), &low, &high, &Vec3::repeat(spacing))?;
        self.check_room(section, &rain, domain);
        if self.gravity == Vec3::zeros() && velocity == Vec3::zeros() {
            section.fail("does not fall: gravity and `velocity` are 0");
        }
        Some(rain)
    }

    /// Checks that the domain has room for the rain. Particles count with the smallest size of the mix.
    fn check_room(&self, section: &Section, rain: &Rain, domain: &Cell) {
        let least = least_volume(&rain.mix, &self.shapes.library);
        let room = domain.volume();
        if self.shapes.complete && rain.count as f64 * least > room {
            section.fail(format!(
                "`count` = {}: so many particles have at least {:.3e} m3, the domain has {room:.3e} m3; it holds fewer than {:.3e}",
                rain.count,
                rain.count as f64 * least,
                room / least
            ));
        }
    }

    /// Slab of a layer: by default one cell thick, on the side from which gravity pulls (the top, without gravity).
    fn slab(
        &self,
        domain: &Cell,
        thickness: f64,
        low: Option<Vec3>,
        high: Option<Vec3>,
    ) -> (Vec3, Vec3) {
        let axis = if self.gravity == Vec3::zeros() { 2 } else { self.gravity.iamax() };
        let upwards = self.gravity[axis] > 0.0;
        let is_thin = if upwards { high.is_none() } else { low.is_none() };
        let (lowest, highest) = domain.corners();
        let (mut low, mut high) = (low.unwrap_or(lowest), high.unwrap_or(highest));
        if is_thin && upwards {
            high[axis] = low[axis] + thickness;
        } else if is_thin {
            low[axis] = high[axis] - thickness;
        }
        (low, high)
    }

    fn lattice(&self, section: &Section) -> Option<Lattice> {
        let mix = self.mix(section);
        let velocity = section.vector_or("velocity", Vec3::zeros());
        let orientations = orientations(section);
        let diameter = self.diameter(mix.as_ref());
        let spacing =
            section.read_or("spacing", diameter.map(|d| Vec3::repeat(ROOMY * d)), |given| {
                given.number().map_or_else(|| given.vector(), |x| Some(Vec3::repeat(x))).map(Some)
            });
        let corner = |key| section.optional(key, Given::vector);
        let (low, high) = (corner("low"), corner("high"));
        let first = corner("first");
        let count = section.optional("count", |given| given.list_of(count));
        let jitter = section.number_or("jitter", 0.0);
        let (spacing, domain, jitter) = (spacing??, self.domain?, jitter?);
        let (first, count) = match (low?, high?, first?, count?) {
            (low, high, None, None) => {
                let (lowest, highest) = domain.corners();
                let (low, high) = (low.unwrap_or(lowest), high.unwrap_or(highest));
                let cells = cells_between(section, false, &low, &high, &spacing)?;
                // In the middle of the box.
                let span = Vec3::from_fn(|axis, _| f64::from(cells[axis] - 1) * spacing[axis]);
                ((low + high - span) * 0.5, cells)
            }
            (None, None, Some(first), Some(count)) => {
                is_possible(section, product(&count)).then_some((first, count))?
            }
            _ => {
                section.fail("give either `low` and `high`, or both of `first` and `count`");
                return None;
            }
        };
        if let Some(mix) = &mix {
            self.check_spacing(section, mix, &spacing, &count, jitter);
        }
        let last = first + Vec3::from_fn(|axis, _| f64::from(count[axis] - 1) * spacing[axis]);
        let around = Vec3::repeat(jitter);
        for (name, position) in [("first", first - around), ("last", last + around)] {
            if let Some(Beyond { axis, ends: [low, high], .. }) =
                domain.beyond(&position, &position)
            {
                section.fail(format!(
                    "its {name} particle, at {}, is outside the domain along {axis}: {low:?} to {high:?} m",
                    written(&position),
                ));
            }
        }
        Some(Lattice {
            mix: mix?,
            first,
            spacing,
            count,
            orientations: orientations?,
            jitter,
            velocity: velocity?,
        })
    }

    /// Rejects a spacing at which neighbours on a lattice overlap in any orientation, because their inscribed spheres do.
    fn check_spacing(
        &self,
        section: &Section,
        mix: &Mix,
        spacing: &Vec3,
        count: &[u32; 3],
        jitter: f64,
    ) {
        let Library { shapes, sizes, .. } = &self.shapes.library;
        let thinnest = mix.shapes().map(|id| {
            let [scale, _] = sizes[id.index()].scales();
            2.0 * shapes[id.index()].inscribed_radius() * scale
        });
        let least = (1.0 - DEEPEST_START) * thinnest.fold(f64::INFINITY, f64::min);
        let narrow = |axis: &usize| count[*axis] > 1 && spacing[*axis] - 2.0 * jitter < least;
        if self.shapes.complete
            && !self.any_held
            && let Some(axis) = (0..3).find(narrow)
        {
            section.fail(format!(
                "`spacing` ({:.4e} m along {}{}) is less than the shortest axis of the smallest particle, {:.4e} m: \
                 neighbours overlap",
                spacing[axis],
                AXES[axis],
                if jitter > 0.0 { ", less twice the `jitter`" } else { "" },
                least / (1.0 - DEEPEST_START)
            ));
        }
    }

    fn file(&self, section: &Section, first_id: u64) -> Option<Fill> {
        let rows = section.require("path").and_then(|given| {
            let path = self.folder.join(given.text()?);
            let source = self.source(section, first_id)?;
            let wrong = |row: &Listed| {
                let library = &self.shapes.library;
                if self.shapes.complete && !library.has_mass_at(row.shape, row.scale) {
                    return Some(format!(
                        "of scale {:?}: its mass or moment of inertia leave the range of numbers",
                        row.scale
                    ));
                }
                let domain = self.domain?;
                let Beyond { axis, ends: [low, high], .. } =
                    domain.beyond(&row.position, &row.position)?;
                Some(format!("outside the domain along {axis}: {low:?} to {high:?} m"))
            };
            match source.read(&path, &wrong) {
                Ok((rows, doubts)) => {
                    for doubt in doubts {
                        given.warn(doubt);
                    }
                    Some(rows)
                }
                Err(mistakes) => {
                    for mistake in &mistakes {
                        given.fail(mistake);
                    }
                    None
                }
            }
        });
        rows.map(Fill::Listed)
    }

    /// Settings of a file of particles.
    fn source<'a>(&'a self, section: &Section<'a>, first_id: u64) -> Option<Source<'a>> {
        let Shapes { names, library, complete } = self.shapes;
        let words = [
            ("csv", Format::Commas),
            ("text", Format::Blanks),
            ("lammps-data", Format::LammpsData),
            ("lammps-dump", Format::LammpsDump),
            ("ondem", Format::OnDem),
        ];
        let format = section.optional("format", |given| given.one_of(&words));
        let frame = section.optional("frame", Given::whole);
        let entries = |key| section.get(key).and_then(|given| given.entries()).unwrap_or_default();
        let types = entries("types").into_iter().map(|(kind, shape)| {
            let name = shape.text()?;
            Some((kind, names.find(&shape, name)?))
        });
        let types: Option<_> = types.collect();
        let columns = entries("columns").into_iter().map(|(of_file, own)| {
            let name = own.text()?;
            if !listed::is_column(name) {
                own.fail(format!("no such column{}", listed::like(name)));
                return None;
            }
            Some((of_file, name))
        });
        let columns: Option<_> = columns.collect();
        let shapes: Vec<&str> = names.all.iter().map(String::as_str).collect();
        // Missing shapes have been reported.
        (!shapes.is_empty()).then_some(Source {
            format: format?,
            frame: frame?,
            types: types?,
            columns: columns?,
            shapes,
            library: complete.then_some(library),
            domain: self.domain,
            first_id,
        })
    }

    /// Error for listed particles with more overlaps than can be checked pair by pair, for example by a wrong unit. Their
    /// places are sorted into cells so small that two particles of like size in one cell overlap too deeply.
    fn crowd(&self, initial: &[Option<Fill>]) -> Option<String> {
        let shapes = Some(&self.shapes.library.shapes).filter(|_| self.shapes.complete)?;
        let mut first_in: HashMap<(i32, [u64; 3]), u64> = HashMap::new();
        let (mut crowded, mut example) = (0, None);
        for fill in initial.iter().flatten() {
            for row in fill.listed() {
                let radius = shapes[row.shape.index()].inscribed_radius() * row.scale;
                let class = libm::log2(radius).floor();
                let side = (1.0 - DEEPEST_START) * 2.0 * libm::exp2(class) / 3f64.sqrt();
                let cell = (row.position / side).map(|place| (place.floor() + 0.0).to_bits());
                if let Some(first) = first_in.insert((class as i32, cell.into()), row.id) {
                    crowded += 1;
                    example = example.or(Some((first, row.id, row.position)));
                }
            }
        }
        let (first, second, place) = example.filter(|_| crowded > MOST_CROWDED)?;
        Some(format!(
            "{crowded} listed particles and more lie within others, such as {second} and {first} at {}: are places in m, as lengths of shapes are?",
            written(&place)
        ))
    }
}

/// Number along an axis.
fn count(given: &Given) -> Option<u32> {
    let count = u32::try_from(given.whole()?).ok();
    if count.is_none() {
        given.fail("is too large");
    }
    count
}

/// Number of cells between two corners, or in the cylinder that they enclose, at least one along each axis.
fn cells_between(
    section: &Section,
    is_round: bool,
    low: &Vec3,
    high: &Vec3,
    cell: &Vec3,
) -> Option<[u32; 3]> {
    let extent = high - low;
    let cells = [0, 1, 2].map(|axis| cells_along(extent[axis], cell[axis]));
    if let Some(axis) = cells.iter().position(|&count| count == 0) {
        let (name, extent, cell) = (AXES[axis], extent[axis], cell[axis]);
        section.fail(if is_round {
            format!(
                "no particle fits into the cylinder of `axis` and `radius` along {name}: it is {extent:.4e} m wide there, a cell is \
                 {cell:.4e} m wide (`spacing`)"
            )
        } else if extent <= 0.0 {
            format!("`high` must be above `low` along {name}")
        } else {
            format!(
                "no particle fits between `low` and `high` along {name}: they are {extent:.4e} m \
                 apart, a cell is {cell:.4e} m wide (`spacing`)"
            )
        });
        return None;
    }
    is_possible(section, product(&cells)).then_some(cells)
}

fn product(counts: &[u32; 3]) -> f64 {
    counts.iter().map(|&count| f64::from(count)).product()
}

fn is_possible(section: &Section, count: f64) -> bool {
    if count > MOST {
        section.fail(format!("{count:.1e} particles are more than the {MOST:.0e} that can be"));
    }
    count <= MOST
}

/// Message for a box that reaches out of the domain.
pub(super) fn reaching(Beyond { axis, place, ends }: &Beyond) -> String {
    let ([from, to], [low, high]) = (place, ends);
    format!(
        "reaches out of the domain along {axis}: from {from:?} to {to:?} m, the domain from {low:?} to {high:?} m"
    )
}

/// A place in messages.
fn written(position: &Vec3) -> String {
    format!("[{:?}, {:?}, {:?}] m", position.x, position.y, position.z)
}
