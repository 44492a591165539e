//! A picture of the packing from the side: an orthographic view along +y (x to the right, z up), in
//! which every grain is drawn as its exact silhouette.
//!
//! An ellipsoid `{ c + D u : |u| <= 1 }` has the half-width `|Dᵀ n|` along `n`, so its projection to the
//! plane (x, z) is the ellipse of the 2 × 2 block of `D Dᵀ`. Written as SVG ellipses by hand: a
//! polygon per grain would be ten times the file.

use super::PostError;
use super::region::{Bounds, Members, axes_of};
use crate::ids::GlobalId;
use crate::math::Vec3;
use crate::output::tables::{Header, ParticleTable};
use nalgebra::Matrix2;
use std::fmt::Write;

/// The grains nearest to the viewer.
#[derive(Clone, Debug, Default)]
pub struct Picture {
    grains: Vec<Grain>,
}

#[derive(Clone, Copy, Debug)]
struct Grain {
    id: GlobalId,
    centre: Vec3,
    /// Semi-axes of the silhouette [m].
    semi_axes: [f64; 2],
    /// From x to the first of them, towards z [degrees].
    angle: f64,
    contacts: i32,
}

impl Grain {
    /// Depth first, then id, so that a picture does not depend on the order of rows.
    fn nearer(&self, other: &Self) -> std::cmp::Ordering {
        self.centre.y.total_cmp(&other.centre.y).then(self.id.cmp(&other.id))
    }
}

impl Picture {
    /// Grains drawn at most: those with the smallest y.
    pub const LIMIT: usize = 5000;

    /// Adds these particles if they are in the region.
    ///
    /// # Errors
    /// A particle that `members` does not know.
    pub fn add(
        &mut self,
        header: &Header,
        particles: &ParticleTable,
        members: &Members,
    ) -> Result<(), PostError> {
        for (row, &id) in particles.id.iter().enumerate() {
            if !members.holds(id)? {
                continue;
            }
            let axes = axes_of(header, particles, row);
            let spread = axes * axes.transpose();
            let (xx, xz, zz) = (spread.m11, spread.m13, spread.m33);
            let mut eigen = Matrix2::new(xx, xz, xz, zz).symmetric_eigenvalues();
            if eigen.x < eigen.y {
                eigen.swap_rows(0, 1);
            }
            self.grains.push(Grain {
                id,
                centre: particles.position[row],
                semi_axes: [eigen.x.max(0.0).sqrt(), eigen.y.max(0.0).sqrt()],
                angle: 0.5 * (2.0 * xz).atan2(xx - zz).to_degrees(),
                contacts: particles.coordination.get(row).copied().unwrap_or(0),
            });
            if self.grains.len() >= 2 * Self::LIMIT {
                self.keep_nearest();
            }
        }
        Ok(())
    }

    fn keep_nearest(&mut self) {
        if self.grains.len() > Self::LIMIT {
            self.grains.select_nth_unstable_by(Self::LIMIT, Grain::nearer);
            self.grains.truncate(Self::LIMIT);
        }
    }

    /// The drawing, far grains first. Lightness goes with the number of contacts.
    pub fn svg(mut self, bounds: Option<&Bounds>) -> String {
        self.keep_nearest();
        self.grains.sort_by(|a, b| b.nearer(a));
        let frame = Frame::around(&self.grains, bounds);
        let mut out = String::new();
        frame.open(&mut out);
        for grain in &self.grains {
            let (x, y) = frame.place(grain.centre.x, grain.centre.z);
            let [long, short] = grain.semi_axes.map(|s| s * frame.scale);
            let tone = tone_of(grain.contacts);
            // The y of SVG points down, so angles change sign.
            let turn = -grain.angle;
            let _ =
                write!(out, r#"<ellipse rx="{long:.1}" ry="{short:.1}" fill="url(#tone{tone})" "#);
            let _ = writeln!(out, r#"transform="translate({x:.1} {y:.1}) rotate({turn:.0})"/>"#);
        }
        out.push_str("</g>\n");
        frame.legend(&mut out);
        out.push_str("</svg>\n");
        out
    }
}

/// Tones, each for two numbers of contacts: 0-1 (rattlers), 2-3, and so on to 12 and more.
const TONES: [(&str, &str); 7] = [
    ("#FDE9B8", "#E3B23C"),
    ("#DDEBF5", "#A9CBE3"),
    ("#BBD6EA", "#7FB0D4"),
    ("#93BEDD", "#5593C2"),
    ("#69A1CC", "#3275AB"),
    ("#4483B5", "#1D5A8E"),
    ("#2B6598", "#0F3F69"),
];

fn tone_of(contacts: i32) -> usize {
    (contacts.max(0) as usize / 2).min(TONES.len() - 1)
}

/// From metres to the units of the drawing, which are pixels.
struct Frame {
    /// Lowest x and highest z [m].
    left: f64,
    top: f64,
    /// Pixels per metre.
    scale: f64,
    /// Room on the left, which sets a narrow packing in the middle [px].
    inset: f64,
    width: f64,
    height: f64,
    /// Sides of the region, if any, in metres: x and z.
    sides: Option<[[f64; 2]; 2]>,
}

impl Frame {
    const MARGIN: f64 = 12.0;
    const LEGEND: f64 = 46.0;
    const LONGEST: f64 = 720.0;
    /// The legend needs as much.
    const NARROWEST: f64 = 500.0;

    fn around(grains: &[Grain], bounds: Option<&Bounds>) -> Self {
        let mut low = [f64::INFINITY; 2];
        let mut high = [f64::NEG_INFINITY; 2];
        for grain in grains {
            for (k, centre) in [grain.centre.x, grain.centre.z].into_iter().enumerate() {
                low[k] = low[k].min(centre - grain.semi_axes[0]);
                high[k] = high[k].max(centre + grain.semi_axes[0]);
            }
        }
        let sides = bounds.map(|b| [[b.low.x, b.high.x], [b.low.z, b.high.z]]);
        for (k, [from, to]) in sides.into_iter().flatten().enumerate() {
            low[k] = low[k].min(from);
            high[k] = high[k].max(to);
        }
        if !(low[0] < high[0] && low[1] < high[1]) {
            (low, high) = ([0.0; 2], [1.0; 2]);
        }
        let (wide, tall) = (high[0] - low[0], high[1] - low[1]);
        let scale = Self::LONGEST / wide.max(tall);
        let width = (wide * scale + 2.0 * Self::MARGIN).max(Self::NARROWEST);
        Self {
            left: low[0],
            top: high[1],
            scale,
            inset: 0.5 * (width - wide * scale),
            width,
            height: tall * scale + 2.0 * Self::MARGIN + Self::LEGEND,
            sides,
        }
    }

    fn place(&self, x: f64, z: f64) -> (f64, f64) {
        ((x - self.left) * self.scale + self.inset, (self.top - z) * self.scale + Self::MARGIN)
    }

    fn open(&self, out: &mut String) {
        let (w, h) = (self.width, self.height);
        let _ = writeln!(
            out,
            r##"<svg xmlns="http://www.w3.org/2000/svg" width="{w:.0}" height="{h:.0}" viewBox="0 0 {w:.1} {h:.1}">
<rect width="100%" height="100%" fill="#FFFFFF"/>
<defs>"##
        );
        for (k, (light, dark)) in TONES.iter().enumerate() {
            let _ = writeln!(
                out,
                r#"<radialGradient id="tone{k}"><stop offset="0.35" stop-color="{light}"/><stop offset="1" stop-color="{dark}"/></radialGradient>"#
            );
        }
        out.push_str("</defs>\n");
        if let Some([[x0, x1], [z0, z1]]) = self.sides {
            let (left, top) = self.place(x0, z1);
            let (right, bottom) = self.place(x1, z0);
            let (w, h) = (right - left, bottom - top);
            let _ = writeln!(
                out,
                r##"<rect x="{left:.1}" y="{top:.1}" width="{w:.1}" height="{h:.1}" fill="none" stroke="#A9B2BC"/>"##
            );
        }
        out.push_str("<g stroke=\"#12324F\" stroke-width=\"0.5\" stroke-opacity=\"0.75\">\n");
    }

    fn legend(&self, out: &mut String) {
        let y = self.height - Self::LEGEND + 14.0;
        let _ = writeln!(
            out,
            r##"<g font-family="sans-serif" font-size="12" fill="#5B6672"><text x="{:.0}" y="{:.1}">contacts</text>"##,
            Self::MARGIN,
            y + 11.0
        );
        for k in 0..TONES.len() {
            let x = Self::MARGIN + 66.0 + 58.0 * k as f64;
            let label = match k {
                0 => "0–1".to_string(),
                k if k + 1 == TONES.len() => format!("{}+", 2 * k),
                k => format!("{}–{}", 2 * k, 2 * k + 1),
            };
            let _ = writeln!(
                out,
                r##"<circle cx="{:.0}" cy="{:.1}" r="6.5" fill="url(#tone{k})" stroke="#12324F" stroke-width="0.5"/><text x="{:.0}" y="{:.1}">{label}</text>"##,
                x,
                y + 7.0,
                x + 10.0,
                y + 11.0
            );
        }
        out.push_str("</g>\n");
    }
}
