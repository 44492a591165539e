//! Cutting of triangles until all share whole sides. A corner within a side of another triangle would act as a corner beside that side.

use super::building::{Building, Side, has_area, sides_of};
use super::grid::Grid;
use super::nearest::nearest_on_segment;
use super::{Findings, SurfaceError};
use crate::math::Vec3;

/// Largest number of rounds of cutting. Two are enough unless sheets lie on each other.
const ROUNDS: usize = 16;

/// Corners within the sides of a triangle, each list in the order along the side.
type Within = [Vec<u32>; 3];

impl Building {
    /// Cuts triangles at the corners of open edges that lie within their sides.
    ///
    /// # Errors
    /// If pieces of pieces still have such corners.
    pub(super) fn share_sides(&mut self, findings: &mut Findings) -> Result<(), SurfaceError> {
        for _ in 0..ROUNDS {
            let within = self.corners_within_sides();
            if within.is_empty() {
                return Ok(());
            }
            let mut rest = within.into_iter().peekable();
            let (mut pieces, mut own) = (Vec::new(), self.own);
            for (k, triangle) in self.corners.iter().enumerate() {
                if k == self.own {
                    own = pieces.len();
                }
                match rest.next_if(|(number, _)| *number == k) {
                    None => pieces.push(*triangle),
                    Some((_, within)) => {
                        findings.cut += usize::from(k < self.own);
                        self.cut(triangle, &within, &mut pieces);
                    }
                }
            }
            if self.own == self.corners.len() {
                own = pieces.len();
            }
            self.take(pieces, own);
        }
        match self.corners_within_sides().first() {
            None => Ok(()),
            Some((triangle, _)) => {
                Err(SurfaceError::Tangled { corner: self.vertex(self.corners[*triangle][0]) })
            }
        }
    }

    /// Triangles with corners within their sides, by number.
    fn corners_within_sides(&self) -> Vec<(usize, Within)> {
        let sides = sides_of(self.corners.iter().copied());
        let open = sides.chunk_by(Side::is_same).filter(|of| of.len() == 1).flatten();
        let mut ends: Vec<u32> = open.flat_map(|side| side.ends).collect();
        ends.sort_unstable();
        ends.dedup();
        if ends.is_empty() {
            return Vec::new();
        }
        let grid = Grid::of(&self.vertices, &self.corners);
        let mut found = Vec::new();
        for end in ends {
            let corner = self.vertex(end);
            let around = Vec3::repeat(self.near);
            grid.for_each_in(&(corner - around), &(corner + around), |triangle| {
                let corners = self.corners[triangle as usize];
                for side in 0..3 {
                    let (a, b) = (corners[side], corners[(side + 1) % 3]);
                    let [from, to] = [a, b].map(|k| self.vertex(k));
                    let foot = nearest_on_segment(&from, &to, &corner);
                    let is_within = [from, to].iter().all(|p| (foot - p).norm() > self.near);
                    if !corners.contains(&end) && is_within && (foot - corner).norm() <= self.near {
                        let place = (foot - from).norm();
                        found.push((triangle as usize, side, place, end));
                    }
                }
            });
        }
        found.sort_by_key(|found| (found.0, found.1, found.3));
        found.dedup();
        found.sort_by(|a, b| (a.0, a.1).cmp(&(b.0, b.1)).then(a.2.total_cmp(&b.2)));
        let of_triangle = |of: &[(usize, usize, f64, u32)]| {
            let on = |side| of.iter().filter(|found| found.1 == side).map(|f| f.3).collect();
            (of[0].0, [on(0), on(1), on(2)])
        };
        found.chunk_by(|a, b| a.0 == b.0).map(of_triangle).collect()
    }

    /// Pieces with an area of a triangle that is cut at corners within its sides.
    fn cut(&self, triangle: &[u32; 3], within: &Within, pieces: &mut Vec<[u32; 3]>) {
        let Some(side) = (0..3).find(|&side| !within[side].is_empty()) else {
            if has_area(&triangle.map(|k| self.vertex(k))) {
                pieces.push(*triangle);
            }
            return;
        };
        let [a, b, c] = [0, 1, 2].map(|k| triangle[(side + k) % 3]);
        let [along, next, last] = [0, 1, 2].map(|k| &within[(side + k) % 3]);
        let chain: Vec<u32> = [a].into_iter().chain(along.iter().copied()).chain([b]).collect();
        for ends in chain.windows(2) {
            let of = |is_there: bool, on: &Vec<u32>| if is_there { on.clone() } else { Vec::new() };
            let within = [Vec::new(), of(ends[1] == b, next), of(ends[0] == a, last)];
            self.cut(&[ends[0], ends[1], c], &within, pieces);
        }
    }
}
