//! Linked cells: every pair of bodies whose bounding spheres are closer than the skin.
//!
//! Cells are as wide as the largest reach, so partners stand in the same or in touching cells. Along a
//! periodic axis the cells go round the whole period.

use crate::contact::{Pair, nearest_image};
use crate::ids::Slot;
use crate::math::Vec3;
use crate::particles::Particles;
use crate::shape::Shape;

/// A grid of cells over all particles, owned and ghosts.
struct Grid {
    low: Vec3,
    width: Vec3,
    count: [usize; 3],
    wraps: [bool; 3],
    /// Slots by cell; those of cell `c` are `slots[first[c]..first[c + 1]]`.
    first: Vec<u32>,
    slots: Vec<u32>,
}

/// All pairs with at least one owned particle and less than `skin` between bounding spheres [m].
pub(super) fn close_pairs(particles: &Particles, skin: f64) -> Vec<Pair> {
    let radius: Vec<f64> = particles.library.shapes.iter().map(Shape::bounding_radius).collect();
    let reach_of = |slot: usize| radius[particles.shape[slot].index()];
    let mut pairs = Vec::new();

    let bodies = particles.first_wall();
    if bodies > 0 {
        let reach = 2.0 * particles.library.largest_radius() + skin;
        let grid = Grid::new(&particles.position[..bodies], &particles.period, reach);
        grid.for_each_candidate(|i, j| {
            if i >= particles.owned && j >= particles.owned {
                return;
            }
            let difference =
                nearest_image(particles.position[j] - particles.position[i], &particles.period);
            let limit = reach_of(i) + reach_of(j) + skin;
            if difference.norm_squared() < limit * limit {
                let (a, b) = if particles.id[i] < particles.id[j] { (i, j) } else { (j, i) };
                pairs.push(Pair { a: Slot(a as u32), b: Slot(b as u32) });
            }
        });
    }

    for slot in 0..particles.owned {
        for (k, wall) in particles.walls.iter().enumerate() {
            let height = (particles.position[slot] - wall.point).dot(&wall.normal);
            if height < reach_of(slot) + skin {
                pairs.push(Pair { a: Slot(slot as u32), b: Slot((bodies + k) as u32) });
            }
        }
    }
    pairs
}

impl Grid {
    fn new(positions: &[Vec3], period: &Vec3, reach: f64) -> Self {
        let mut low = positions[0];
        let mut high = positions[0];
        for p in positions {
            low = low.inf(p);
            high = high.sup(p);
        }
        let wraps = [0, 1, 2].map(|axis| period[axis].is_finite());
        let mut width = Vec3::repeat(reach);
        let mut count = [1; 3];
        for axis in 0..3 {
            let extent = if wraps[axis] { period[axis] } else { high[axis] - low[axis] };
            // A sparse cloud must not cost more cells than it has particles.
            let most = (4.0 * positions.len() as f64).cbrt().ceil().max(64.0);
            let cells = (extent / reach).floor().clamp(1.0, most);
            count[axis] = cells as usize;
            if wraps[axis] && count[axis] < 3 {
                // With two cells round the period each would be both neighbours of the other.
                count[axis] = 1;
            }
            width[axis] =
                if count[axis] == 1 { f64::INFINITY } else { extent / count[axis] as f64 };
        }
        let mut grid =
            Self { low, width, count, wraps, first: Vec::new(), slots: vec![0; positions.len()] };
        let cells: Vec<usize> = positions.iter().map(|p| grid.index(grid.cell(p))).collect();
        let mut first = vec![0u32; count.iter().product::<usize>() + 1];
        for &cell in &cells {
            first[cell + 1] += 1;
        }
        for cell in 1..first.len() {
            first[cell] += first[cell - 1];
        }
        let mut next = first.clone();
        for (slot, &cell) in cells.iter().enumerate() {
            grid.slots[next[cell] as usize] = slot as u32;
            next[cell] += 1;
        }
        grid.first = first;
        grid
    }

    fn cell(&self, position: &Vec3) -> [usize; 3] {
        [0, 1, 2].map(|axis| {
            let cells = (position[axis] - self.low[axis]) / self.width[axis];
            // Positions of a periodic axis may lie below `low` by rounding only: clamped.
            (cells as usize).min(self.count[axis] - 1)
        })
    }

    const fn index(&self, cell: [usize; 3]) -> usize {
        (cell[2] * self.count[1] + cell[1]) * self.count[0] + cell[0]
    }

    fn slots_in(&self, cell: usize) -> &[u32] {
        &self.slots[self.first[cell] as usize..self.first[cell + 1] as usize]
    }

    /// The cell `offset` away along an axis, if there is one.
    fn neighbour(&self, axis: usize, cell: usize, offset: isize) -> Option<usize> {
        let count = self.count[axis] as isize;
        let there = cell as isize + offset;
        if (0..count).contains(&there) {
            Some(there as usize)
        } else if self.wraps[axis] && count > 1 {
            Some(there.rem_euclid(count) as usize)
        } else {
            None
        }
    }

    /// Calls `visit` once for every pair of slots in the same cell or in touching ones.
    fn for_each_candidate(&self, mut visit: impl FnMut(usize, usize)) {
        for z in 0..self.count[2] {
            for y in 0..self.count[1] {
                for x in 0..self.count[0] {
                    let here = self.slots_in(self.index([x, y, z]));
                    if here.is_empty() {
                        continue;
                    }
                    for (k, &i) in here.iter().enumerate() {
                        for &j in &here[k + 1..] {
                            visit(i as usize, j as usize);
                        }
                    }
                    for [dx, dy, dz] in HALF_OF_NEIGHBOURS {
                        let (Some(x), Some(y), Some(z)) = (
                            self.neighbour(0, x, dx),
                            self.neighbour(1, y, dy),
                            self.neighbour(2, z, dz),
                        ) else {
                            continue;
                        };
                        for &j in self.slots_in(self.index([x, y, z])) {
                            for &i in here {
                                visit(i as usize, j as usize);
                            }
                        }
                    }
                }
            }
        }
    }
}

/// One of each two opposite neighbours of a cell.
const HALF_OF_NEIGHBOURS: [[isize; 3]; 13] = [
    [1, 0, 0],
    [-1, 1, 0],
    [0, 1, 0],
    [1, 1, 0],
    [-1, -1, 1],
    [0, -1, 1],
    [1, -1, 1],
    [-1, 0, 1],
    [0, 0, 1],
    [1, 0, 1],
    [-1, 1, 1],
    [0, 1, 1],
    [1, 1, 1],
];

#[cfg(test)]
mod tests {
    use super::Grid;
    use crate::contact::nearest_image;
    use crate::math::Vec3;
    use std::collections::BTreeSet;

    /// A sequence that fills the unit cube evenly (Roberts' R3), for positions without a generator.
    fn point(i: usize) -> Vec3 {
        let i = i as f64;
        Vec3::new((i * 0.819_172_5).fract(), (i * 0.671_043_6).fract(), (i * 0.549_700_5).fract())
    }

    #[test]
    fn cells_find_what_brute_force_finds() {
        let infinite = f64::INFINITY;
        for period in [
            Vec3::repeat(infinite),
            Vec3::new(1.0, infinite, 0.5),
            Vec3::new(1.0, 0.5, 2.0),
            Vec3::new(0.25, 1.0, 1.0),
        ] {
            for reach in [0.05, 0.11, 0.12] {
                let scale = period.map(|p| if p.is_finite() { p } else { 1.0 });
                let positions: Vec<_> = (0..500).map(|i| point(i).component_mul(&scale)).collect();
                let close = |i: usize, j: usize| {
                    nearest_image(positions[j] - positions[i], &period).norm() < reach
                };
                let mut found = BTreeSet::new();
                Grid::new(&positions, &period, reach).for_each_candidate(|i, j| {
                    if close(i, j) {
                        assert!(found.insert((i.min(j), i.max(j))), "pair {i}, {j} twice");
                    }
                });
                let expected: BTreeSet<_> = (0..positions.len())
                    .flat_map(|j| (0..j).map(move |i| (i, j)))
                    .filter(|&(i, j)| close(i, j))
                    .collect();
                assert_eq!(found, expected, "period {period}, reach {reach}");
            }
        }
    }
}
