//! Mean forces on walls over the steps from one row of the history to the next.

use crate::comm::Comm;
use crate::drive::{Row, View, load};
use crate::math::{ExactSum, Vec3};
use std::collections::BTreeMap;

/// Sum over steps of the force of the particles on a wall.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct ForceSum {
    /// Sums along x, y, z [N].
    pub(super) axes: [ExactSum; 3],
    /// Number of steps.
    pub(super) steps: u64,
}

/// Sums by wall index since the last row of the history, over the contacts of one rank.
#[derive(Clone, Debug, Default)]
pub(super) struct Means(pub(super) BTreeMap<usize, ForceSum>);

impl Means {
    /// Sums of these walls before the first step.
    pub(super) fn of(walls: impl Iterator<Item = usize>) -> Self {
        Self(walls.map(|wall| (wall, ForceSum::default())).collect())
    }

    /// Adds the forces of a step.
    pub(super) fn add(&mut self, view: &View) {
        for (wall, force) in load::forces(view) {
            let Some(sum) = self.0.get_mut(&wall) else { continue };
            if force.iter().all(|component| component.is_finite()) {
                for (axis, &component) in sum.axes.iter_mut().zip(force) {
                    axis.add(component);
                }
            }
        }
        for sum in self.0.values_mut() {
            sum.steps += 1;
            // Room for the terms of the next step.
            sum.axes.iter_mut().for_each(ExactSum::carry);
        }
    }

    /// Sums over all ranks. Collective.
    pub(super) fn of_all_ranks(&self, comm: &mut dyn Comm) -> BTreeMap<usize, ForceSum> {
        let axes = self.0.values().flat_map(|sum| &sum.axes);
        let mut axes = load::of_all_ranks(axes, comm).into_iter();
        let sum = |(&wall, &ForceSum { steps, .. }): (&usize, &ForceSum)| {
            let axes = std::array::from_fn(|_| axes.next().unwrap_or_default());
            (wall, ForceSum { axes, steps })
        };
        self.0.iter().map(sum).collect()
    }

    /// Writes the mean forces into a row, if there were steps since the previous one. Collective.
    pub(super) fn fill(&mut self, row: &mut Row, comm: &mut dyn Comm) {
        for (wall, sum) in self.of_all_ranks(comm) {
            if sum.steps > 0 {
                let force = Vec3::from(sum.axes.each_ref().map(ExactSum::value));
                row.wall_forces[wall] = force / sum.steps as f64;
            }
        }
        if row.scheduled {
            *self = Self::of(self.0.keys().copied());
        }
    }
}
