//! The tree of cuts that gives each rank its subdomain: the same tree on every rank.

use crate::cell::Cell;
use crate::comm::Comm;
use crate::ids::Rank;
use crate::math::Vec3;
use std::ops::Range;

/// A box. Points beyond an outer face of all boxes belong to the rank inside it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Subdomain {
    /// Lowest corner [m].
    pub low: Vec3,
    /// Highest corner [m].
    pub high: Vec3,
}

impl Subdomain {
    /// Distance of a point from the box, the nearest of its images [m].
    pub fn distance(&self, point: &Vec3, cell: &Cell) -> f64 {
        cell.gap([&self.low, &self.high], [point, point])
    }

    /// Distance of two boxes, the nearest of their images [m].
    pub fn gap(&self, other: &Self, cell: &Cell) -> f64 {
        cell.gap([&self.low, &self.high], [&other.low, &other.high])
    }
}

/// A part of the tree: one rank, or a cut with its two sides.
#[derive(Clone, Copy, Debug)]
enum Node {
    Leaf(Rank),
    Cut { axis: usize, at: f64, below: usize, above: usize },
}

/// The tree of cuts.
#[derive(Clone, Debug)]
pub struct Cuts {
    /// The whole space.
    space: Subdomain,
    nodes: Vec<Node>,
    subdomains: Vec<Subdomain>,
}

/// A part of space with more than one rank, still to be cut.
struct Part {
    node: usize,
    ranks: Range<u32>,
    space: Subdomain,
}

/// Number of halvings of a cut: to 2⁻⁴⁰ of its side.
const HALVINGS: usize = 40;

impl Cuts {
    /// Cuts of equal volumes, for a domain whose particles are still to come.
    pub fn even(low: Vec3, high: Vec3, ranks: u32) -> Self {
        Self::build(low, high, ranks, |parts| parts.iter().map(even_cut).collect())
    }

    /// Cuts of equal work: `work[i]` belongs to the particle at `positions[i]`. Collective.
    pub fn balanced(
        low: Vec3,
        high: Vec3,
        positions: &[Vec3],
        work: &[i64],
        comm: &mut dyn Comm,
    ) -> Self {
        let mut workload = Workload::new(positions, work, comm.size());
        Self::build(low, high, comm.size(), |parts| {
            let ranges = workload.ranges(parts, comm);
            let chosen = workload.halve(parts, ranges, comm);
            workload.divide(parts, &chosen);
            chosen
        })
    }

    /// Builds the tree level by level; `choose` returns axis and place of each part's cut.
    fn build(
        low: Vec3,
        high: Vec3,
        ranks: u32,
        mut choose: impl FnMut(&[Part]) -> Vec<(usize, f64)>,
    ) -> Self {
        let mut nodes = vec![Node::Leaf(Rank(0))];
        let mut subdomains = vec![Subdomain { low, high }; ranks as usize];
        let mut parts = vec![Part { node: 0, ranks: 0..ranks, space: Subdomain { low, high } }];
        loop {
            let mut undivided = Vec::new();
            for part in parts {
                if part.ranks.len() == 1 {
                    nodes[part.node] = Node::Leaf(Rank(part.ranks.start));
                    subdomains[part.ranks.start as usize] = part.space;
                } else {
                    undivided.push(part);
                }
            }
            if undivided.is_empty() {
                break;
            }
            parts = Vec::new();
            for (part, (axis, at)) in undivided.iter().zip(choose(&undivided)) {
                let [lower_ranks, upper_ranks] = halves(&part.ranks);
                let (below, above) = (nodes.len(), nodes.len() + 1);
                nodes[part.node] = Node::Cut { axis, at, below, above };
                nodes.extend([Node::Leaf(Rank(0)); 2]);
                let (mut lower, mut upper) = (part.space, part.space);
                lower.high[axis] = at;
                upper.low[axis] = at;
                parts.push(Part { node: below, ranks: lower_ranks, space: lower });
                parts.push(Part { node: above, ranks: upper_ranks, space: upper });
            }
        }
        Self { space: Subdomain { low, high }, nodes, subdomains }
    }

    /// The whole space.
    pub const fn space(&self) -> Subdomain {
        self.space
    }

    /// Moves all cuts with the sides of the space.
    pub fn stretch(&mut self, space: Subdomain) {
        let before = self.space;
        let times = (space.high - space.low).component_div(&(before.high - before.low));
        let moved = |axis: usize, at: f64| {
            // Outer faces must stay exact.
            match () {
                () if at == before.low[axis] => space.low[axis],
                () if at == before.high[axis] => space.high[axis],
                () => space.low[axis] + (at - before.low[axis]) * times[axis],
            }
        };
        for node in &mut self.nodes {
            if let Node::Cut { axis, at, .. } = node {
                *at = moved(*axis, *at);
            }
        }
        for one in &mut self.subdomains {
            for axis in 0..3 {
                one.low[axis] = moved(axis, one.low[axis]);
                one.high[axis] = moved(axis, one.high[axis]);
            }
        }
        self.space = space;
    }

    /// Rank that owns a point, inside or outside.
    pub fn owner(&self, point: &Vec3) -> Rank {
        let mut node = 0;
        loop {
            match self.nodes[node] {
                Node::Leaf(rank) => return rank,
                Node::Cut { axis, at, below, above } => {
                    node = if point[axis] < at { below } else { above };
                }
            }
        }
    }

    /// Box of a rank.
    pub fn subdomain(&self, rank: Rank) -> Subdomain {
        self.subdomains[rank.index()]
    }

    /// Other ranks whose boxes are closer than `reach` to that of a rank [m], in rising order. The relation is
    /// symmetric. Descends the tree of cuts.
    pub fn ranks_near(&self, me: Rank, cell: &Cell, reach: f64) -> Vec<Rank> {
        let here = self.subdomain(me);
        let mut near = Vec::new();
        let mut open = vec![(0, self.space)];
        while let Some((node, space)) = open.pop() {
            match self.nodes[node] {
                Node::Leaf(rank) if rank == me => {}
                Node::Leaf(rank) => {
                    // Both sides compute the gap in one order, so that rounding is equal.
                    let (first, second) = if rank < me { (space, here) } else { (here, space) };
                    if first.gap(&second, cell) < reach {
                        near.push(rank);
                    }
                }
                Node::Cut { axis, at, below, above } => {
                    let (mut lower, mut upper) = (space, space);
                    lower.high[axis] = at;
                    upper.low[axis] = at;
                    for (node, space) in [(below, lower), (above, upper)] {
                        if space.gap(&here, cell) < reach * (1.0 + 1e-9) {
                            open.push((node, space));
                        }
                    }
                }
            }
        }
        near.sort_unstable();
        near
    }
}

/// Particles of this rank while they are divided into parts with one rank each.
struct Workload<'a> {
    positions: &'a [Vec3],
    work: &'a [i64],
    /// Part of each particle; `None` once the part has one rank.
    part_of: Vec<Option<usize>>,
}

/// Range of places for the cut of a part along an axis [m].
#[derive(Clone, Copy)]
struct CutRange {
    axis: usize,
    lowest: f64,
    highest: f64,
    /// Work of all particles in the part.
    work: i64,
}

impl<'a> Workload<'a> {
    fn new(positions: &'a [Vec3], work: &'a [i64], ranks: u32) -> Self {
        let part_of = vec![(ranks > 1).then_some(0); positions.len()];
        Self { positions, work, part_of }
    }

    /// Particles in parts that are still to be cut: part, position, work.
    fn undivided(&self) -> impl Iterator<Item = (usize, &Vec3, i64)> {
        let particles = self.part_of.iter().zip(self.positions).zip(self.work);
        particles.filter_map(|((part, position), &work)| Some(((*part)?, position, work)))
    }

    /// Extent of the particles in each part along its longest axis; an even cut for a part without work. Collective.
    fn ranges(&self, parts: &[Part], comm: &mut dyn Comm) -> Vec<CutRange> {
        // Bounding box of the particles in each part, as maxima of -low and high.
        let mut extent = vec![f64::NEG_INFINITY; 6 * parts.len()];
        let mut total = vec![0i64; parts.len()];
        for (part, position, work) in self.undivided() {
            total[part] += work;
            let extent = &mut extent[6 * part..];
            for axis in 0..3 {
                extent[axis] = extent[axis].max(-position[axis]);
                extent[3 + axis] = extent[3 + axis].max(position[axis]);
            }
        }
        comm.max(&mut extent);
        comm.sum(&mut total);
        let boxes = extent.chunks_exact(6).zip(total);
        let range = |(part, (extent, work)): (&Part, (&[f64], i64))| {
            if work == 0 {
                let (axis, at) = even_cut(part);
                return CutRange { axis, lowest: at, highest: at, work };
            }
            let lowest = -Vec3::from_column_slice(&extent[..3]);
            let highest = Vec3::from_column_slice(&extent[3..]);
            let axis = (highest - lowest).imax();
            CutRange { axis, lowest: lowest[axis], highest: highest[axis], work }
        };
        parts.iter().zip(boxes).map(range).collect()
    }

    /// Axis and place of each part's cut, found by halving its range. Collective.
    fn halve(
        &self,
        parts: &[Part],
        mut ranges: Vec<CutRange>,
        comm: &mut dyn Comm,
    ) -> Vec<(usize, f64)> {
        for _ in 0..HALVINGS {
            let mut below = vec![0i64; parts.len()];
            for (part, position, work) in self.undivided() {
                let CutRange { axis, lowest, highest, .. } = ranges[part];
                if position[axis] < 0.5 * (lowest + highest) {
                    below[part] += work;
                }
            }
            comm.sum(&mut below);
            for ((part, range), below) in parts.iter().zip(&mut ranges).zip(below) {
                let middle = 0.5 * (range.lowest + range.highest);
                if below as f64 >= range.work as f64 * share_below(part) {
                    range.highest = middle;
                } else {
                    range.lowest = middle;
                }
            }
        }
        // A particle may be slightly outside, a cut may not.
        let inside = |(range, part): (CutRange, &Part)| {
            let CutRange { axis, highest, .. } = range;
            (axis, highest.max(part.space.low[axis]).min(part.space.high[axis]))
        };
        ranges.into_iter().zip(parts).map(inside).collect()
    }

    /// Assigns each particle to a side of its part's cut.
    fn divide(&mut self, parts: &[Part], chosen: &[(usize, f64)]) {
        // Both sides of each cut, and their numbers among the parts to be cut next.
        let sides = parts.iter().flat_map(|part| halves(&part.ranks));
        let mut undivided = 0;
        let number: Vec<Option<usize>> = sides
            .map(|ranks| {
                undivided += usize::from(ranks.len() > 1);
                (ranks.len() > 1).then(|| undivided - 1)
            })
            .collect();
        for (position, part) in self.positions.iter().zip(&mut self.part_of) {
            if let Some(k) = *part {
                let (axis, at) = chosen[k];
                *part = number[2 * k + usize::from(position[axis] >= at)];
            }
        }
    }
}

/// Axis and place of the cut that divides the volume in proportion to the ranks.
fn even_cut(part: &Part) -> (usize, f64) {
    let side = part.space.high - part.space.low;
    let axis = side.imax();
    (axis, part.space.low[axis] + side[axis] * share_below(part))
}

/// Ranks below and above a part's cut.
fn halves(ranks: &Range<u32>) -> [Range<u32>; 2] {
    let middle = ranks.start + ranks.len() as u32 / 2;
    [ranks.start..middle, middle..ranks.end]
}

/// Share of a part's ranks that lie below its cut.
fn share_below(part: &Part) -> f64 {
    let ranks = part.ranks.len() as u32;
    f64::from(ranks / 2) / f64::from(ranks)
}

#[cfg(test)]
mod tests {
    use super::Cuts;
    use crate::cell::Cell;
    use crate::comm::threads;
    use crate::ids::Rank;
    use crate::math::Vec3;

    #[test]
    fn every_rank_gets_its_share_of_the_work() {
        // Ten times as dense at the bottom.
        let points: Vec<Vec3> = (0..4000)
            .map(|i| {
                let f = |k: f64| (f64::from(i) * k).fract();
                let z = f(0.549_700_5);
                Vec3::new(f(0.819_172_5), f(0.671_043_6), z * z * z * 3.0)
            })
            .collect();
        for ranks in [1, 2, 3, 4, 7, 8] {
            let owned = threads::run(ranks, |comm| {
                let size = ranks as usize;
                let me = crate::comm::Comm::rank(comm).index();
                let mine: Vec<Vec3> = points.iter().skip(me).step_by(size).copied().collect();
                let high = Vec3::new(1.0, 1.0, 3.0);
                let cuts = Cuts::balanced(Vec3::zeros(), high, &mine, &vec![1; mine.len()], comm);
                points.iter().filter(|p| cuts.owner(p) == Rank(me as u32)).count()
            });
            assert_eq!(owned.iter().sum::<usize>(), points.len());
            let fair = points.len() / ranks as usize;
            assert!(owned.iter().all(|&n| n.abs_diff(fair) <= 8), "{ranks} ranks: {owned:?}");
        }
    }

    #[test]
    fn the_tree_finds_the_same_neighbours_as_a_look_at_all() {
        let high = Vec3::new(1.0, 2.0, 3.0);
        for periodic in [[false; 3], [true; 3], [true, false, true]] {
            let cell = Cell::new(Vec3::zeros(), high, periodic);
            for ranks in [1, 2, 3, 8, 13, 64] {
                let cuts = Cuts::even(Vec3::zeros(), high, ranks);
                for me in (0..ranks).map(Rank) {
                    let near = cuts.ranks_near(me, &cell, 0.2);
                    let all = (0..ranks).map(Rank).filter(|&rank| {
                        let gap = cuts.subdomain(rank).gap(&cuts.subdomain(me), &cell);
                        rank != me && gap < 0.2
                    });
                    assert_eq!(near, all.collect::<Vec<_>>());
                    assert!(near.iter().all(|&r| cuts.ranks_near(r, &cell, 0.2).contains(&me)));
                }
            }
        }
    }

    #[test]
    fn a_domain_without_particles_is_cut_too() {
        threads::run(5, |comm| {
            let cuts = Cuts::balanced(Vec3::zeros(), Vec3::repeat(1.0), &[], &[], comm);
            let volumes: Vec<f64> = (0..5)
                .map(|r| {
                    let s = cuts.subdomain(Rank(r));
                    (s.high - s.low).product()
                })
                .collect();
            assert!(volumes.iter().all(|v| (v - 0.2).abs() < 1e-9), "{volumes:?}");
        });
    }
}
