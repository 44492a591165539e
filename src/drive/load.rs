//! Loads of walls that drives move, from the contacts of this rank. Exact sums: the bits do not depend on the number of
//! ranks.

use super::View;
use crate::comm::Comm;
use crate::contact::{Geometry, Pair};
use crate::math::{ExactSum, Vec3};

/// Number of a wall's sum, and the direction in which forces count, a unit vector.
pub(super) type Line = (usize, Vec3);

/// Contacts with walls: number of the wall, bodies, geometry and normal force [N]. Also known after a restart, before
/// forces are found.
pub(super) fn pressing<'a>(
    view: &View<'a>,
) -> impl Iterator<Item = (usize, Pair, &'a Geometry, f64)> {
    let &View { particles, contacts, law, .. } = view;
    let pressing = contacts.pressing_on_walls(law, particles);
    // A state that is not a number is reported when the list of pairs is rebuilt.
    let finite = pressing.filter(|(.., force)| force.is_finite());
    finite.filter_map(|(pair, geometry, force)| {
        Some((particles.wall_of(pair.b)?, pair, geometry, force))
    })
}

/// Contacts with walls, once forces are found: number of the wall, and force on it [N].
pub(super) fn forces<'a>(view: &View<'a>) -> impl Iterator<Item = (usize, &'a Vec3)> {
    let &View { particles, contacts, .. } = view;
    let forces = contacts.forces_on_walls(particles);
    forces.filter_map(|(pair, force)| Some((particles.wall_of(pair.b)?, force)))
}

/// Sums of the forces on walls along their lines [N], `count` of them.
pub(super) fn along(count: usize, lines: &[Option<Line>], view: &View) -> Vec<ExactSum> {
    let mut sums = vec![ExactSum::default(); count];
    for (wall, force) in forces(view) {
        let Some((sum, direction)) = lines[wall] else { continue };
        let term = force.dot(&direction);
        if term.is_finite() {
            sums[sum].add(term);
        }
    }
    sums
}

/// Sums over all ranks, with carried digits, so that equal sums have equal limbs. Collective.
pub(super) fn of_all_ranks<'a>(
    sums: impl Iterator<Item = &'a ExactSum>,
    comm: &mut dyn Comm,
) -> Vec<ExactSum> {
    let carried = |mut sum: ExactSum| {
        sum.carry();
        sum
    };
    let mut limbs: Vec<i64> = sums.flat_map(|sum| *carried(sum.clone()).limbs()).collect();
    comm.sum(&mut limbs);
    limbs.chunks(ExactSum::LIMBS).map(|limbs| carried(ExactSum::from_limbs(limbs))).collect()
}
