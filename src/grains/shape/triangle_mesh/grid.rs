//! Grid for the search of triangles.

use crate::math::{Vec3, bounds};
use serde::{Deserialize, Serialize};

/// Cells with the triangles that enter them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Grid {
    low: Vec3,
    width: Vec3,
    count: [usize; 3],
    first: Vec<u32>,
    triangles: Vec<u32>,
}

impl Grid {
    pub(super) fn of(vertices: &[Vec3], corners: &[[u32; 3]]) -> Self {
        let (low, high) = bounds(vertices);
        let extent = high - low;
        // Largest number of cells, about four for each triangle.
        let most = 4.0 * corners.len() as f64 + 64.0;
        let mut side = extent.max() / most.sqrt().max(4.0);
        let cells = |side: f64| extent.map(|along| (along / side).floor().clamp(1.0, 1e6));
        while cells(side).product() > most {
            side *= 1.1;
        }
        let count = [0, 1, 2].map(|axis| cells(side)[axis] as usize);
        let width =
            Vec3::from_fn(|axis, _| (extent[axis] / count[axis] as f64).max(f64::MIN_POSITIVE));
        let mut grid = Self { low, width, count, first: Vec::new(), triangles: Vec::new() };
        let mut filled: Vec<(u32, u32)> = Vec::new();
        for (corners, triangle) in corners.iter().zip(0..) {
            let corners = corners.map(|k| vertices[k as usize]);
            let (low, high) = bounds(&corners);
            let [a, b, c] = &corners;
            let normal = (b - a).cross(&(c - a)).normalize();
            let reach = |along: &Vec3| 0.5 * width.dot(&along.abs()) + 1e-9 * extent.norm();
            let outwards = [(a, b), (b, c), (c, a)].map(|(from, to)| {
                let along = (to - from).cross(&normal).normalize();
                (from, along, reach(&along))
            });
            let thickness = reach(&normal);
            // Cells overlap a little, so that a search by a rounded point finds its triangles.
            let leeway = Vec3::repeat(1e-9 * extent.norm());
            grid.for_each_cell(&(low - leeway), &(high + leeway), |cell, middle| {
                // A long thin triangle stays out of most cells of its bounding box.
                let beside =
                    outwards.iter().any(|(on, along, reach)| (middle - *on).dot(along) > *reach);
                if (middle - a).dot(&normal).abs() <= thickness && !beside {
                    filled.push((cell as u32, triangle));
                }
            });
        }
        filled.sort_unstable();
        grid.first = vec![0; count.iter().product::<usize>() + 1];
        for &(cell, _) in &filled {
            grid.first[cell as usize + 1] += 1;
        }
        for cell in 1..grid.first.len() {
            grid.first[cell] += grid.first[cell - 1];
        }
        grid.triangles = filled.into_iter().map(|(_, triangle)| triangle).collect();
        grid
    }

    /// Calls `visit` for every cell that a box touches, with its middle; for none if the box is outside.
    fn for_each_cell(&self, low: &Vec3, high: &Vec3, mut visit: impl FnMut(usize, Vec3)) {
        let mut ranges = [(0, 0); 3];
        for axis in 0..3 {
            let cell = |place: f64| ((place - self.low[axis]) / self.width[axis]).floor();
            let (from, to, last) =
                (cell(low[axis]), cell(high[axis]), self.count[axis] as f64 - 1.0);
            // A surface in a plane has no width.
            let flat = self.width[axis] == f64::MIN_POSITIVE;
            if !flat && (to < -1.0 || from > last + 1.0) {
                return;
            }
            ranges[axis] = if flat {
                (0, 0)
            } else {
                (from.clamp(0.0, last) as usize, to.clamp(0.0, last) as usize)
            };
        }
        let [xs, ys, zs] = ranges;
        for z in zs.0..=zs.1 {
            for y in ys.0..=ys.1 {
                for x in xs.0..=xs.1 {
                    let at = Vec3::new(x as f64 + 0.5, y as f64 + 0.5, z as f64 + 0.5);
                    let middle = self.low + at.component_mul(&self.width);
                    visit((z * self.count[1] + y) * self.count[0] + x, middle);
                }
            }
        }
    }

    /// Calls `visit` for every triangle in the cells that a box touches, for some of them several times.
    pub(super) fn for_each_in(&self, low: &Vec3, high: &Vec3, mut visit: impl FnMut(u32)) {
        self.for_each_cell(low, high, |cell, _| {
            let range = self.first[cell] as usize..self.first[cell + 1] as usize;
            self.triangles[range].iter().for_each(|&triangle| visit(triangle));
        });
    }

    /// Moves the origin of the axes to this place [m].
    pub(super) fn see_from(&mut self, place: &Vec3) {
        self.low -= place;
    }

    /// Memory that it holds [bytes].
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&*self.first) + size_of_val(&*self.triangles)
    }
}
