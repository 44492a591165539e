//! The tree of cuts that gives each rank its subdomain: the same tree on every rank.

use crate::comm::Comm;
use crate::ids::Rank;
use crate::math::Vec3;

/// A box. Outer faces of the domain lie at infinity: nobody else owns what is beyond.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Subdomain {
    /// Lowest corner [m].
    pub low: Vec3,
    /// Highest corner [m].
    pub high: Vec3,
}

impl Subdomain {
    /// Distance of a point from the box, the nearest of its images under the periods [m].
    pub fn distance(&self, point: &Vec3, period: &Vec3) -> f64 {
        self.gap(&Self { low: *point, high: *point }, period)
    }

    /// Distance of two boxes, the nearest of their images [m].
    pub fn gap(&self, other: &Self, period: &Vec3) -> f64 {
        let along = |axis: usize| {
            let gap = |shift: f64| {
                let below = self.low[axis] - (other.high[axis] + shift);
                let above = other.low[axis] + shift - self.high[axis];
                below.max(above).max(0.0)
            };
            let length = period[axis];
            if length.is_finite() { gap(0.0).min(gap(length)).min(gap(-length)) } else { gap(0.0) }
        };
        Vec3::new(along(0), along(1), along(2)).norm()
    }
}

/// A part of the tree: one rank, or a cut with what lies on either side.
#[derive(Clone, Copy, Debug)]
enum Node {
    Leaf(Rank),
    Cut { axis: usize, at: f64, below: usize, above: usize },
}

/// The tree of cuts.
#[derive(Clone, Debug)]
pub struct Cuts {
    nodes: Vec<Node>,
    subdomains: Vec<Subdomain>,
}

/// A part of space with more than one rank, on its way to being cut.
struct Part {
    node: usize,
    ranks: std::ops::Range<u32>,
    space: Subdomain,
}

/// How often a cut is halved: to 2⁻⁴⁰ of its side.
const HALVINGS: usize = 40;

impl Cuts {
    /// Equal volumes, for a domain whose particles are still to come.
    pub fn even(low: Vec3, high: Vec3, ranks: u32) -> Self {
        Self::build(low, high, ranks, |parts| parts.iter().map(even_cut).collect())
    }

    /// Equal work: `work[i]` belongs to the particle at `positions[i]`. Collective.
    pub fn balanced(
        low: Vec3,
        high: Vec3,
        positions: &[Vec3],
        work: &[i64],
        comm: &mut dyn Comm,
    ) -> Self {
        let ranks = comm.size();
        // Which part each particle is in, found anew for each generation of parts.
        Self::build(low, high, ranks, |parts| {
            let within = |part: &Part, p: &Vec3| {
                (0..3).all(|axis| {
                    let bounds = (part.space.low[axis], part.space.high[axis]);
                    (p[axis] >= bounds.0 || bounds.0 <= low[axis])
                        && (p[axis] < bounds.1 || bounds.1 >= high[axis])
                })
            };
            let part_of: Vec<Option<usize>> =
                positions.iter().map(|p| parts.iter().position(|part| within(part, p))).collect();

            // The box of the particles in each part, as maxima of -low and high.
            let mut extent = vec![f64::NEG_INFINITY; 6 * parts.len()];
            let mut total = vec![0i64; parts.len()];
            for ((position, &part), &work) in positions.iter().zip(&part_of).zip(work) {
                let Some(part) = part else { continue };
                total[part] += work;
                for axis in 0..3 {
                    let extent = &mut extent[6 * part..];
                    extent[axis] = extent[axis].max(-position[axis]);
                    extent[3 + axis] = extent[3 + axis].max(position[axis]);
                }
            }
            comm.max(&mut extent);
            comm.sum(&mut total);

            let mut search: Vec<(usize, f64, f64)> = parts
                .iter()
                .enumerate()
                .map(|(k, part)| {
                    if total[k] == 0 {
                        let (axis, at) = even_cut(part);
                        return (axis, at, at);
                    }
                    let lowest = -Vec3::from_column_slice(&extent[6 * k..6 * k + 3]);
                    let highest = Vec3::from_column_slice(&extent[6 * k + 3..6 * k + 6]);
                    let axis = (highest - lowest).imax();
                    (axis, lowest[axis], highest[axis])
                })
                .collect();
            for _ in 0..HALVINGS {
                let mut below = vec![0i64; parts.len()];
                for ((position, &part), &work) in positions.iter().zip(&part_of).zip(work) {
                    let Some(part) = part else { continue };
                    let (axis, lowest, highest) = search[part];
                    if position[axis] < 0.5 * (lowest + highest) {
                        below[part] += work;
                    }
                }
                comm.sum(&mut below);
                for (k, part) in parts.iter().enumerate() {
                    let (_, lowest, highest) = &mut search[k];
                    let middle = 0.5 * (*lowest + *highest);
                    if below[k] as f64 >= total[k] as f64 * share_below(part) {
                        *highest = middle;
                    } else {
                        *lowest = middle;
                    }
                }
            }
            search.iter().map(|&(axis, _, highest)| (axis, highest)).collect()
        })
    }

    /// Builds the tree generation by generation; `choose` gives axis and place of each part's cut.
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
                let middle = part.ranks.start + part.ranks.len() as u32 / 2;
                let (below, above) = (nodes.len(), nodes.len() + 1);
                nodes[part.node] = Node::Cut { axis, at, below, above };
                nodes.extend([Node::Leaf(Rank(0)); 2]);
                let (mut lower, mut upper) = (part.space, part.space);
                lower.high[axis] = at;
                upper.low[axis] = at;
                parts.push(Part { node: below, ranks: part.ranks.start..middle, space: lower });
                parts.push(Part { node: above, ranks: middle..part.ranks.end, space: upper });
            }
        }
        Self { nodes, subdomains }
    }

    /// The rank that owns a point, wherever it lies.
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

    /// The box of a rank.
    pub fn subdomain(&self, rank: Rank) -> Subdomain {
        self.subdomains[rank.index()]
    }

    /// The ranks whose boxes come closer than `reach` to a box [m].
    pub fn ranks_near(&self, space: &Subdomain, period: &Vec3, reach: f64) -> Vec<Rank> {
        (0..self.subdomains.len())
            .filter(|&rank| self.subdomains[rank].gap(space, period) < reach)
            .map(|rank| Rank(rank as u32))
            .collect()
    }
}

/// Axis and place of the cut that gives both sides volume in proportion to their ranks.
fn even_cut(part: &Part) -> (usize, f64) {
    let side = part.space.high - part.space.low;
    let axis = side.imax();
    (axis, part.space.low[axis] + side[axis] * share_below(part))
}

/// The share of a part's ranks that lie below its cut.
fn share_below(part: &Part) -> f64 {
    let ranks = part.ranks.len() as u32;
    f64::from(ranks / 2) / f64::from(ranks)
}

#[cfg(test)]
mod tests {
    use super::Cuts;
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
