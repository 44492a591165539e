//! Drawings from the side, along +y: x to the right, z up, with a scale bar.

use super::draw::{scientific, tick};
use super::walls::Walls;
use crate::post::region::Bounds;
use std::fmt::Write;

/// Conversion from metres to pixels, around a box.
pub(super) struct Side {
    /// Lower and upper ends along x and z [m].
    ranges: [[f64; 2]; 2],
    /// Pixels per metre.
    pub(super) scale: f64,
    size: [f64; 2],
    /// Space on the left that centres a narrow box [px].
    inset: f64,
}

impl Side {
    const MARGIN: f64 = 14.0;
    const FOOT: f64 = 34.0;
    const LONGEST: f64 = 420.0;
    const NARROWEST: f64 = 360.0;

    /// Conversion around a box and the walls.
    pub(super) fn around(bounds: &Bounds, walls: &Walls) -> Self {
        let (mut low, mut high) = ([bounds.low.x, bounds.low.z], [bounds.high.x, bounds.high.z]);
        walls.around(&mut low, &mut high);
        let lengths = [high[0] - low[0], high[1] - low[1]];
        let scale = Self::LONGEST / lengths[0].max(lengths[1]);
        let wide = lengths[0] * scale + 2.0 * Self::MARGIN;
        let width = wide.max(Self::NARROWEST);
        let height = lengths[1] * scale + 2.0 * Self::MARGIN + Self::FOOT;
        let inset = 0.5 * (width - wide);
        Self { ranges: [low, high], scale, size: [width, height], inset }
    }

    /// Pixels from the left and from the top.
    pub(super) fn place(&self, x: f64, z: f64) -> [f64; 2] {
        [
            (x - self.ranges[0][0]) * self.scale + self.inset + Self::MARGIN,
            (self.ranges[1][1] - z) * self.scale + Self::MARGIN,
        ]
    }

    /// Begins a drawing with the outlines of the box and the walls.
    pub(super) fn open(&self, bounds: &Bounds, walls: &Walls, out: &mut String) {
        let [width, height] = self.size;
        let [x, y] = self.place(bounds.low.x, bounds.high.z);
        let [right, bottom] = self.place(bounds.high.x, bounds.low.z);
        let _ = writeln!(
            out,
            r##"<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0}" height="{height:.0}" viewBox="0 0 {width:.1} {height:.1}">
<rect width="100%" height="100%" fill="#FFFFFF"/>
<rect x="{x:.1}" y="{y:.1}" width="{:.1}" height="{:.1}" fill="none" stroke="#A9B2BC"/>"##,
            right - x,
            bottom - y
        );
        walls.draw(self.ranges, |x, z| self.place(x, z), out);
    }

    /// Ends the drawing with a scale bar, and words beside it.
    pub(super) fn close(&self, words: &str, out: &mut String) {
        let [width, height] = self.size;
        let y = height - 14.0;
        let end = scale_bar(self.scale, 0.25 * width, [Self::MARGIN, y], out);
        let _ = writeln!(
            out,
            r##"<text x="{:.1}" y="{:.1}" font-family="sans-serif" font-size="12" fill="#5B6672">{words}</text>
</svg>"##,
            end + 22.0,
            y + 4.0
        );
    }
}

/// Draws a bar of a round length, at most `most` pixels long, from this point to the right, followed by its length. Returns
/// about where the text ends.
pub(super) fn scale_bar(scale: f64, most: f64, [x, y]: [f64; 2], out: &mut String) -> f64 {
    let (mantissa, exponent) = scientific(most / scale);
    let step = [5.0, 2.0, 1.0].into_iter().find(|step| *step <= mantissa).unwrap_or(1.0);
    let metres = step * 10f64.powi(exponent);
    let end = x + metres * scale;
    let words = length(metres);
    let (above, below) = (y - 4.0, y + 4.0);
    let _ = writeln!(
        out,
        r##"<polyline points="{x:.1} {above:.1} {x:.1} {below:.1} {x:.1} {y:.1} {end:.1} {y:.1} {end:.1} {above:.1} {end:.1} {below:.1}" fill="none" stroke="#1F2933" stroke-width="1.5"/><text x="{:.1}" y="{below:.1}" font-family="sans-serif" font-size="12" fill="#1F2933">{words}</text>"##,
        end + 7.0,
    );
    end + 7.0 + 7.0 * words.chars().count() as f64
}

/// A length in the unit that suits it.
fn length(metres: f64) -> String {
    let units = [(1e3, "km"), (1.0, "m"), (1e-2, "cm"), (1e-3, "mm"), (1e-6, "µm"), (1e-9, "nm")];
    let fits = |(unit, _): &&(f64, &str)| metres >= 0.999 * unit;
    let (unit, name) = units.iter().find(fits).unwrap_or(&units[5]);
    // Rounded: a quotient of powers of ten is not exactly whole.
    format!("{} {name}", tick((metres / unit * 1e6).round() / 1e6))
}
