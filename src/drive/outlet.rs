//! Outlets: regions in which particles leave the simulation.
//!
//! A particle leaves when its centre is in the region at a check, `every` so many steps. The state of its contacts is
//! dropped. Its energy is recorded ([`crate::measure::Departed`]), so that the balance still closes. Counts and masses are
//! summed in the order of the ids, so they do not depend on the number of ranks.

use super::lists::Lists;
use super::region::Region;
use super::{
    Drive, DriveError, Moment, Observer, Reporter, Restart, Row, SavedColumn, Standing, Takes,
};
use crate::cell::Cell;
use crate::comm::Comm;
use crate::contact::StateColumn;
use crate::ids::ShapeId;
use crate::math::Vec3;
use crate::particles::Particles;
use crate::particles::records::Particle;
use crate::population::Library;
use crate::population::census::Census;
use crate::walls::Wall;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

/// Region in which particles leave.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outlet {
    /// Its name in the scene.
    pub name: String,
    /// Region of the centres of leaving particles.
    pub region: Region,
    /// Steps between checks.
    pub every: u64,
    /// Does it keep a list of its particles?
    pub list: bool,
}

impl Outlet {
    /// Does it check at this moment?
    const fn is_due(&self, moment: &Moment) -> bool {
        moment.stage_step.is_multiple_of(self.every)
    }
}

/// An outlet with its counts in this stage.
#[derive(Clone, Debug)]
struct Running {
    outlet: Outlet,
    /// Number of particles.
    count: u64,
    /// Their mass [kg].
    mass: f64,
    /// Has a warning been given that particles may pass it undetected?
    warned: bool,
}

/// The outlets of a running simulation.
#[derive(Clone, Debug)]
pub struct Outlets {
    all: Vec<Running>,
    warnings: Vec<String>,
    lists: Lists,
    /// By shape with a law of sizes: its name, and the sizes of its particles that have left by outlet.
    sizes: BTreeMap<ShapeId, (String, Vec<Census>)>,
}

// Columns in a snapshot: a row for each outlet.
const NAMES: StateColumn = StateColumn::new("name", 1, "1");
const COUNT: StateColumn = StateColumn::new("left", 1, "1");
const MASS: StateColumn = StateColumn::new("left_mass", 1, "kg");

impl Outlets {
    /// Outlets before any particle has left.
    pub fn new(outlets: Vec<Outlet>) -> Self {
        let list = |Outlet { name, list, .. }: &Outlet| list.then(|| format!("left_{name}"));
        let lists = Lists::new(outlets.iter().map(list));
        let running = |outlet| Running { outlet, count: 0, mass: 0.0, warned: false };
        let all = outlets.into_iter().map(running).collect();
        Self { all, warnings: Vec::new(), lists, sizes: BTreeMap::new() }
    }

    /// Sizes of a shape by outlet; `None` if it has no law of sizes.
    fn sizes_of(&mut self, shape: ShapeId, library: &Library) -> Option<&mut Vec<Census>> {
        let (_, sizes) = match self.sizes.entry(shape) {
            Entry::Occupied(known) => known.into_mut(),
            Entry::Vacant(new) => {
                let nobody = Census::of_shape(shape, library)?;
                new.insert((library.names[shape.index()].clone(), vec![nobody; self.all.len()]))
            }
        };
        Some(sizes)
    }

    /// Columns of the limits and the sums of the [`Census`] of a shape.
    fn sizes_columns(shape: &str) -> [StateColumn; 2] {
        let named = |column, kind: &str| StateColumn {
            name: format!("left_{kind}_of_{shape}").into(),
            ..column
        };
        [
            named(StateColumn::new("", 2, "1"), "limits"),
            named(StateColumn::new("", Census::SUMS, "1"), "sizes"),
        ]
    }
}

impl Drive for Outlets {
    fn takes(&self, moment: &Moment) -> Takes {
        let is_due = self.all.iter().any(|running| running.outlet.is_due(moment));
        if is_due { Takes::Inside } else { Takes::Outside }
    }

    fn reaches(&self, moment: &Moment, position: &Vec3, cell: &Cell) -> bool {
        let takes = |Running { outlet, .. }: &Running| {
            outlet.is_due(moment) && outlet.region.holds(position, cell)
        };
        self.all.iter().any(takes)
    }

    /// If several outlets check at this moment, the first one in the scene takes the particle. A particle outside the
    /// domain cannot wait: without a check, the first outlet that holds it takes it.
    fn take(&mut self, moment: &Moment, leaver: &Particle, particles: &Particles) -> bool {
        let Particles { cell, library, .. } = particles;
        let holds = |running: &Running| running.outlet.region.holds(&leaver.position, cell);
        let looks = |running: &Running| running.outlet.is_due(moment) && holds(running);
        let first = self.all.iter().position(looks).or_else(|| self.all.iter().position(holds));
        let Some(index) = first else { return false };
        self.all[index].count += 1;
        self.all[index].mass += library.mass_at(leaver.shape, leaver.scale);
        if let Some(sizes) = self.sizes_of(leaver.shape, library) {
            sizes[index].add(leaver.scale);
        }
        self.lists.note(moment.step, index, std::slice::from_ref(leaver));
        true
    }
}

impl Observer for Outlets {
    /// Warns if particles can cross a region between two checks.
    fn row(&mut self, row: &mut Row, _comm: &mut dyn Comm) {
        let Row { fastest, dt, .. } = *row;
        for Running { outlet, warned, .. } in &mut self.all {
            let Outlet { name, region, every, .. } = outlet;
            let way = fastest * dt * *every as f64;
            if way > region.thickness() && !std::mem::replace(warned, true) {
                self.warnings.push(format!(
                    "outlet `{name}` checks every {every} steps, in which a particle at {fastest:.3e} m/s moves \
                     {way:.3e} m: it may cross its {:.3e} m undetected. Make the outlet thicker, or `every` smaller",
                    region.thickness()
                ));
            }
        }
    }

    fn lists(&mut self) -> Option<&mut Lists> {
        Some(&mut self.lists)
    }
}

impl Reporter for Outlets {
    fn name(&self) -> &'static str {
        "outlets"
    }

    fn counted(&self) -> Vec<(String, f64)> {
        let of_one = |Running { outlet: Outlet { name, .. }, count, mass, .. }: &Running| {
            [(format!("left_{name}"), *count as f64), (format!("left_{name}_kg"), *mass)]
        };
        self.all.iter().flat_map(of_one).collect()
    }

    fn warnings(&mut self) -> Vec<String> {
        std::mem::take(&mut self.warnings)
    }

    fn standing(&self) -> Standing {
        let gone = self.all.iter().map(|running| running.count).sum();
        Standing { gone, ..Standing::default() }
    }

    fn sizes_left(&self, shape: ShapeId) -> Vec<&Census> {
        self.sizes.get(&shape).map_or_else(Vec::new, |(_, sizes)| sizes.iter().collect())
    }

    fn save(&self, _walls: &[Wall], _comm: &mut dyn Comm) -> Vec<SavedColumn> {
        let all = || self.all.iter();
        let mut columns = vec![
            SavedColumn::texts(NAMES, all().map(|running| running.outlet.name.clone())),
            SavedColumn::counts(COUNT, all().map(|running| running.count)),
            SavedColumn::reals(MASS, all().map(|running| running.mass)),
        ];
        for (shape, sizes) in self.sizes.values() {
            if sizes.iter().any(|census| census.count() > 0) {
                let [limits, sums] = Self::sizes_columns(shape);
                columns.push(SavedColumn::reals(limits, sizes.iter().flat_map(Census::limits)));
                let of_sizes = sizes.iter().flat_map(Census::sums).copied();
                columns.push(SavedColumn::integers(sums, of_sizes));
            }
        }
        columns
    }

    /// A new stage counts from 0.
    fn resume(&mut self, restart: &Restart, _walls: &mut [Wall]) -> Result<(), DriveError> {
        if restart.is_new_stage {
            return Ok(());
        }
        let &Restart { saved, library, .. } = restart;
        let (names, counts, masses) =
            (saved.texts(&NAMES)?, saved.counts(&COUNT)?, saved.reals(&MASS)?);
        let row_of = |running: &Running| names.iter().position(|name| *name == running.outlet.name);
        let rows: Vec<Option<usize>> = self.all.iter().map(row_of).collect();
        for (running, row) in self.all.iter_mut().zip(&rows) {
            if let &Some(row) = row {
                (running.count, running.mass) = (counts[row], masses[row]);
            }
        }
        for shape in (0..library.particle_shapes).map(|shape| ShapeId(shape as u16)) {
            let name = &library.names[shape.index()];
            let [limits, sums] = Self::sizes_columns(name);
            // These columns are absent if no particle of the shape had left.
            let (Ok(limits), Ok(sums)) = (saved.reals(&limits), saved.integers(&sums)) else {
                continue;
            };
            let Some(sizes) = self.sizes_of(shape, library) else { continue };
            let mut is_lost = false;
            for (census, row) in sizes.iter_mut().zip(&rows) {
                let &Some(row) = row else { continue };
                if limits[2 * row..][..2] == census.limits() {
                    census.add_all(&sums[row * Census::SUMS..][..Census::SUMS]);
                } else {
                    is_lost = true;
                }
            }
            if is_lost {
                self.warnings.push(format!(
                    "the limits of `size` of shape `{name}` have changed at this restart: the report of sizes omits \
                     its particles that left before"
                ));
            }
        }
        Ok(())
    }
}
