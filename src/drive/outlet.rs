//! Outlets: regions in which grains leave the simulation.
//!
//! A grain is gone once its centre is in the region, at the next look, `every` so many steps. What its contacts knew goes with
//! it; what it had of energy is booked ([`crate::measure::Departed`]), so that the balance still closes. Counts and masses are
//! summed in the order of the ids: the same on any number of ranks.

use super::listed::Listed;
use super::region::Region;
use super::{Drive, DriveError, Moment, SavedColumn, SavedState, Values};
use crate::cell::Cell;
use crate::comm::Comm;
use crate::contact::StateColumn;
use crate::ids::ShapeId;
use crate::math::Vec3;
use crate::particles::Library;
use crate::particles::census::Census;
use crate::particles::records::Particle;
use crate::particles::walls::Wall;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// Where grains leave.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outlet {
    /// Its name in the scene.
    pub name: String,
    /// Where.
    pub region: Region,
    /// Steps between looks.
    pub every: u64,
    /// Does it keep a list of its grains?
    pub list: bool,
}

impl Outlet {
    /// Does it look at this moment?
    const fn is_due(&self, moment: &Moment) -> bool {
        moment.stage_step.is_multiple_of(self.every)
    }
}

/// What has left through an outlet in this stage.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Left {
    /// Grains.
    pub count: u64,
    /// Their mass [kg].
    pub mass: f64,
}

/// The outlets of a running simulation.
#[derive(Clone, Debug)]
pub struct Outlets {
    all: Vec<Outlet>,
    left: Vec<Left>,
    /// Which have already warned.
    warned: Vec<bool>,
    warnings: Vec<String>,
    listed: Listed,
    /// Sizes of what has left through each in this stage, of each shape with a law of sizes.
    sizes: Vec<Vec<(ShapeId, Census)>>,
    /// The names of these shapes.
    sized: Vec<String>,
}

/// Names [`Outlets`] among the drives.
const NAME: &str = "outlets";
const NAMES: StateColumn = StateColumn::new("name", 1, "1");
const COUNT: StateColumn = StateColumn::new("left", 1, "1");
const MASS: StateColumn = StateColumn::new("left_mass", 1, "kg");

impl Outlets {
    /// Before anything has left.
    pub fn new(outlets: Vec<Outlet>, library: &Library) -> Self {
        let (left, warned) = (vec![Left::default(); outlets.len()], vec![false; outlets.len()]);
        let (warnings, listed) = (Vec::new(), Listed::default());
        let (sizes, sized) = (Vec::new(), Vec::new());
        let mut new = Self { all: outlets, left, warned, warnings, listed, sizes, sized };
        new.admit(library);
        new
    }

    /// The columns of the limits and the sums of the [`Census`] of a shape.
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

    /// Of each outlet the sizes of a shape that have left.
    fn of_shape(&self, number: usize) -> impl Iterator<Item = &Census> + Clone {
        self.sizes.iter().map(move |of_outlet| &of_outlet[number].1)
    }

    /// What has left through each, in the order of the scene.
    pub fn left(&self) -> &[Left] {
        &self.left
    }
}

impl Drive for Outlets {
    fn name(&self) -> &'static str {
        NAME
    }

    fn admit(&mut self, library: &Library) {
        let shapes = (0..library.particle_shapes).map(|shape| ShapeId(shape as u16));
        let of_one = shapes.filter_map(|shape| Some((shape, Census::of_shape(shape, library)?)));
        let of_one: Vec<(ShapeId, Census)> = of_one.collect();
        self.sized = of_one.iter().map(|(shape, _)| library.names[shape.index()].clone()).collect();
        self.sizes = vec![of_one; self.all.len()];
    }

    fn is_outlet(&self) -> bool {
        true
    }

    fn looks(&self, moment: &Moment) -> bool {
        self.all.iter().any(|outlet| outlet.is_due(moment))
    }

    fn reaches(&self, moment: &Moment, position: &Vec3, cell: &Cell) -> bool {
        let takes = |outlet: &Outlet| outlet.is_due(moment) && outlet.region.holds(position, cell);
        self.all.iter().any(takes)
    }

    /// Of several that look at this moment the first one in the scene. What has left the domain cannot wait: the first one that
    /// holds it takes it.
    fn take(&mut self, moment: &Moment, leaver: &Particle, mass: f64, cell: &Cell) -> bool {
        let holds = |outlet: &Outlet| outlet.region.holds(&leaver.position, cell);
        let looks = |outlet: &Outlet| outlet.is_due(moment) && holds(outlet);
        let first = self.all.iter().position(looks).or_else(|| self.all.iter().position(holds));
        let Some(index) = first else { return false };
        let left = &mut self.left[index];
        left.count += 1;
        left.mass += mass;
        if let Some((_, census)) =
            self.sizes[index].iter_mut().find(|(shape, _)| *shape == leaver.shape)
        {
            census.add(leaver.scale);
        }
        if self.all[index].list {
            let list = self.all[..index].iter().filter(|before| before.list).count();
            self.listed.note(moment.step, list, leaver.clone());
        }
        true
    }

    fn counted(&self) -> Vec<(String, f64)> {
        let of_one = |(Outlet { name, .. }, left): (&Outlet, &Left)| {
            [(format!("left_{name}"), left.count as f64), (format!("left_{name}_kg"), left.mass)]
        };
        self.all.iter().zip(&self.left).flat_map(of_one).collect()
    }

    /// Grains that go through a region between two looks are not seen.
    fn note_speed(&mut self, fastest: f64, dt: f64) {
        for (Outlet { name, region, every, .. }, warned) in self.all.iter().zip(&mut self.warned) {
            let way = fastest * dt * *every as f64;
            if way > region.thickness() && !std::mem::replace(warned, true) {
                self.warnings.push(format!(
                    "outlet `{name}` looks every {every} steps, in which a grain at {fastest:.3e} m/s goes {way:.3e} m: it may go through its \
                     {:.3e} m unseen. Make it thicker, or `every` smaller",
                    region.thickness()
                ));
            }
        }
    }

    fn lists(&self) -> Vec<String> {
        let listing = self.all.iter().filter(|outlet| outlet.list);
        listing.map(|Outlet { name, .. }| format!("left_{name}")).collect()
    }

    fn listed(&mut self) -> Vec<(usize, Particle)> {
        self.listed.take()
    }

    fn warnings(&mut self) -> Vec<String> {
        std::mem::take(&mut self.warnings)
    }

    fn sizes_left(&self, shape: ShapeId) -> Vec<&Census> {
        let of_shape = self.sizes.iter().flatten().filter(|(of, _)| *of == shape);
        of_shape.map(|(_, census)| census).collect()
    }

    fn gone(&self) -> u64 {
        self.left.iter().map(|left| left.count).sum()
    }

    fn save(&self, _walls: &[Wall], _comm: &mut dyn Comm) -> Vec<SavedColumn> {
        let names = self.all.iter().map(|outlet| outlet.name.clone()).collect();
        let counts = self.left.iter().map(|left| left.count).collect();
        let masses = self.left.iter().map(|left| left.mass).collect();
        let mut columns = vec![
            SavedColumn::new(NAMES, Values::Texts(names)),
            SavedColumn::new(COUNT, Values::Counts(counts)),
            SavedColumn::new(MASS, Values::Reals(masses)),
        ];
        for (number, shape) in self.sized.iter().enumerate() {
            let all = self.of_shape(number);
            if all.clone().any(|census| census.count() > 0) {
                let [limits, sizes] = Self::sizes_columns(shape);
                let of_limits = all.clone().flat_map(Census::limits).collect();
                let sums = all.flat_map(Census::sums).copied().collect();
                columns.push(SavedColumn::new(limits, Values::Reals(of_limits)));
                columns.push(SavedColumn::new(sizes, Values::Integers(sums)));
            }
        }
        columns
    }

    /// A new stage counts from 0.
    fn resume(
        &mut self,
        saved: &SavedState,
        is_new_stage: bool,
        _walls: &mut [Wall],
        _is_root: bool,
    ) -> Result<(), DriveError> {
        if is_new_stage {
            return Ok(());
        }
        let rows = saved.texts(&NAMES)?.iter().zip(saved.counts(&COUNT)?).zip(saved.reals(&MASS)?);
        let (mut rows_of, mut lost) = (vec![None; self.all.len()], BTreeSet::new());
        for (row, ((name, &count), &mass)) in rows.enumerate() {
            let index = self.all.iter().position(|outlet| outlet.name == *name);
            if let Some(index) = index {
                self.left[index] = Left { count, mass };
                rows_of[index] = Some(row);
            }
        }
        for (number, shape) in self.sized.iter().enumerate() {
            let [limits, sizes] = Self::sizes_columns(shape);
            // They are not there if none of the shape had left.
            let (Ok(limits), Ok(sums)) = (saved.reals(&limits), saved.integers(&sizes)) else {
                continue;
            };
            for (of_outlet, row) in self.sizes.iter_mut().zip(&rows_of) {
                let census = &mut of_outlet[number].1;
                let Some(row) = row else { continue };
                if limits[2 * row..][..2] == census.limits() {
                    census.add_all(&sums[row * Census::SUMS..][..Census::SUMS]);
                } else {
                    lost.insert(shape.clone());
                }
            }
        }
        for shape in lost {
            self.warnings.push(format!(
                "shape `{shape}` had other limits of `size` before this restart: the report of sizes leaves out its particles that left before"
            ));
        }
        Ok(())
    }
}
