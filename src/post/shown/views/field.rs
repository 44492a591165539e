//! Mean velocities in cells of the side view.

use crate::math::Vec3;
use crate::post::plots::{Plot, Width};
use crate::post::region::Bounds;
use crate::post::report::readable;
use crate::post::shown::side::Side;
use crate::post::shown::walls::Walls;
use std::fmt::Write;

/// Momentum and mass by cell.
#[derive(Clone, Debug)]
pub(super) struct Field {
    low: [f64; 2],
    /// Side of a cell [m].
    side: f64,
    cells: [usize; 2],
    /// Momentum along x and z [kg m/s], mass [kg].
    sums: Vec<[f64; 3]>,
}

impl Field {
    /// Largest number of cells along the longer side.
    const MOST: f64 = 24.0;

    pub(super) fn new(bounds: &Bounds, diameter: f64) -> Self {
        let lengths = [bounds.lengths().x, bounds.lengths().z];
        let longest = lengths[0].max(lengths[1]);
        // At least as wide as a particle, but several cells in any box.
        let side = (longest / Self::MOST).max(diameter.min(longest / 4.0));
        let cells = lengths.map(|length| ((length / side).ceil() as usize).max(1));
        let sums = vec![[0.0; 3]; cells[0] * cells[1]];
        Self { low: [bounds.low.x, bounds.low.z], side, cells, sums }
    }

    pub(super) fn add(&mut self, centre: &Vec3, velocity: &Vec3, mass: f64) {
        let place = [centre.x, centre.z];
        let cell: [f64; 2] =
            std::array::from_fn(|k| ((place[k] - self.low[k]) / self.side).floor());
        if (0..2).all(|k| cell[k] >= 0.0 && cell[k] < self.cells[k] as f64) {
            let sum = &mut self.sums[cell[1] as usize * self.cells[0] + cell[0] as usize];
            let more = [mass * velocity.x, mass * velocity.z, mass];
            (0..3).for_each(|k| sum[k] += more[k]);
        }
    }

    pub(super) fn plot(&self, bounds: &Bounds, walls: &Walls) -> Option<Plot> {
        let means: Vec<Option<[f64; 2]>> = self
            .sums
            .iter()
            .map(|&[x, z, mass]| (mass > 0.0).then(|| [x / mass, z / mass]))
            .collect();
        let speeds = means.iter().flatten().map(|[x, z]| x.hypot(*z));
        let fastest = speeds.fold(0.0, f64::max);
        if !(fastest > 0.0 && fastest.is_finite()) {
            return None;
        }
        let view = Side::around(bounds, walls);
        let longest = self.side * view.scale;
        let mut svg = String::new();
        view.open(bounds, walls, &mut svg);
        svg.push_str(
            "<g fill=\"none\" stroke=\"#0072B2\" stroke-width=\"1.3\" stroke-linecap=\"round\">\n",
        );
        for (k, mean) in means.iter().enumerate() {
            let Some([vx, vz]) = mean else { continue };
            let [column, row] =
                [k % self.cells[0], k / self.cells[0]].map(|cell| cell as f64 + 0.5);
            let [x, y] =
                view.place(self.low[0] + column * self.side, self.low[1] + row * self.side);
            arrow([x, y], [vx / fastest * longest, -vz / fastest * longest], &mut svg);
        }
        svg.push_str("</g>\n");
        view.close(&format!("longest arrow: {} m/s", readable(fastest)), &mut svg);
        Some(Plot {
            name: "velocity_field".into(),
            title: "Velocities".into(),
            caption:
                "Side view: velocity of the centre of mass of the particles in each cell, averaged over the depth."
                    .into(),
            width: Width::Half,
            svg,
        })
    }
}

/// Draws an arrow about its middle [px], or a dot if it is too short to see.
fn arrow([x, y]: [f64; 2], [dx, dy]: [f64; 2], out: &mut String) {
    let length = dx.hypot(dy);
    if length < 0.6 {
        let _ = writeln!(out, r#"<path d="M{x:.1} {y:.1}h0.01"/>"#);
        return;
    }
    let (tip, head) = ([x + 0.5 * dx, y + 0.5 * dy], (0.35 * length).min(4.0) / length);
    let barb = |turn: f64| [-head * (dx - turn * 0.7 * dy), -head * (dy + turn * 0.7 * dx)];
    let [[ax, ay], [bx, by]] = [barb(1.0), barb(-1.0)];
    let _ = writeln!(
        out,
        r#"<path d="M{:.1} {:.1}L{:.1} {:.1}m{ax:.1} {ay:.1}L{:.1} {:.1}l{bx:.1} {by:.1}"/>"#,
        x - 0.5 * dx,
        y - 0.5 * dy,
        tip[0],
        tip[1],
        tip[0],
        tip[1]
    );
}
