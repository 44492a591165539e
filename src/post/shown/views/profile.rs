//! Averages by height, in layers across the box.
//!
//! The volume of a body is distributed over layers as that of an ellipsoid of the same height: exactly for spheres and
//! ellipsoids. The stress of a layer of volume V is `1/V Σ f ⊗ l s`. Here `s` is the share in the layer of the line between the
//! centres, or from a centre to the foot on a wall. The mean over all layers is the stress of the whole packing. If an upright
//! side of a region is between two particles, the line is the arm of the particle inside. It runs from the centre to the
//! contact point, as in the stress of the region.

use crate::math::{Mat3, Vec3};
use crate::output::header::Header;
use crate::post::draw::{BLUE, MUTED, Mark, ORANGE, PlotError, SIZE, Series, chart, linear, span};
use crate::post::plots::{Plot, Width};
use crate::post::region::{Bounds, Turned};

/// Averages of layers, the lowest first.
#[derive(Clone, Debug)]
pub struct Profile {
    low: f64,
    high: f64,
    area: f64,
    /// Downward gravity [m/s²].
    gravity: f64,
    /// Period of the domain along z [m].
    period: Option<f64>,
    /// Mass above the box [kg].
    mass_above: f64,
    volume: Vec<f64>,
    mass: Vec<f64>,
    moment: Vec<Mat3>,
}

/// Averages of a layer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Layer {
    /// Height of its middle [m].
    pub height: f64,
    /// Volume of bodies over that of the layer [-].
    pub solid_fraction: f64,
    /// Stress, compression positive [Pa].
    pub stress: Mat3,
    /// Weight of the bodies above its middle over the area of the box, in a vertical gravity [Pa].
    pub weight_above: f64,
}

impl Profile {
    pub(super) fn new(header: &Header, bounds: &Bounds, diameter: f64) -> Self {
        let lengths = bounds.lengths();
        let layers = (lengths.z / diameter).floor().clamp(4.0, 40.0);
        // Without any shape the diameter is zero or not a number.
        let layers = if layers.is_finite() { layers as usize } else { 4 };
        Self {
            low: bounds.low.z,
            high: bounds.high.z,
            area: lengths.x * lengths.y,
            gravity: -header.gravity.z,
            period: Some(header.cell.periods().z).filter(|period| period.is_finite()),
            mass_above: 0.0,
            volume: vec![0.0; layers],
            mass: vec![0.0; layers],
            moment: vec![Mat3::zeros(); layers],
        }
    }

    fn thickness(&self) -> f64 {
        (self.high - self.low) / self.volume.len() as f64
    }

    /// Calls `add` with the share in each layer of a body or line between two heights, the lower first. `below` is its share
    /// below a height, from 0 at -1 to 1 at 1. Parts beyond a period are on the other side.
    fn share(
        &self,
        low: f64,
        high: f64,
        below: impl Fn(f64) -> f64,
        mut add: impl FnMut(usize, f64),
    ) {
        let (half, thickness) = (0.5 * (high - low), self.thickness());
        let period = self.period.unwrap_or(0.0);
        let shifts = if self.period.is_some() { &[-period, 0.0, period][..] } else { &[0.0] };
        for shift in shifts {
            let [low, high] = [low + shift, high + shift];
            let layer = |z: f64| (z - self.low) / thickness;
            let last = self.volume.len() as f64 - 1.0;
            let [first, end] = [layer(low).floor(), layer(high).floor()];
            if !(first <= last && end >= 0.0) {
                continue;
            }
            for k in first.max(0.0) as usize..=end.min(last) as usize {
                if half <= 0.0 {
                    add(k, 1.0);
                    continue;
                }
                let edge = |k: usize| self.low + k as f64 * thickness;
                let share = |z: f64| below(((z - low) / half - 1.0).clamp(-1.0, 1.0));
                add(k, share(edge(k + 1)) - share(edge(k)));
            }
        }
    }

    pub(super) fn add_body(&mut self, centre: &Vec3, body: &Turned, volume: f64, mass: f64) {
        let [low, high] = [-1.0, 1.0].map(|up| centre.z + body.support(&Vec3::new(0.0, 0.0, up)).z);
        let mut shares = Vec::new();
        let below = |u: f64| 0.25 * (2.0 + 3.0 * u - u.powi(3));
        self.share(low, high, below, |k, share| shares.push((k, share)));
        if self.period.is_none() && high > self.high {
            let half = 0.5 * (high - low);
            self.mass_above += mass * (1.0 - below(((self.high - low) / half - 1.0).max(-1.0)));
        }
        for (k, share) in shares {
            self.volume[k] += share * volume;
            self.mass[k] += share * mass;
        }
    }

    pub(super) fn add_contact(&mut self, centre: &Vec3, branch: &Vec3, force: &Vec3) {
        let other = centre.z + branch.z;
        let mut shares = Vec::new();
        let below = |u: f64| 0.5 * (1.0 + u);
        let [low, high] = [centre.z.min(other), centre.z.max(other)];
        self.share(low, high, below, |k, share| shares.push((k, share)));
        let moment = force * branch.transpose();
        for (k, share) in shares {
            self.moment[k] += moment * share;
        }
    }

    /// Layers, the lowest first.
    pub fn layers(&self) -> Vec<Layer> {
        let (thickness, volume) = (self.thickness(), self.thickness() * self.area);
        let mut above = self.mass_above * self.gravity / self.area;
        let layer = |k: usize| {
            let weight = self.mass[k] * self.gravity / self.area;
            above += weight;
            Layer {
                height: self.low + (k as f64 + 0.5) * thickness,
                solid_fraction: self.volume[k] / volume,
                stress: self.moment[k] / volume,
                weight_above: above - 0.5 * weight,
            }
        };
        let mut layers: Vec<Layer> = (0..self.volume.len()).rev().map(layer).collect();
        layers.reverse();
        layers
    }

    pub(super) fn plots(&self) -> Result<Vec<Plot>, PlotError> {
        let layers = self.layers();
        let curve = |name: &str, colour, of: &dyn Fn(&Layer) -> f64| Series {
            name: name.into(),
            colour,
            mark: Mark::Line,
            points: layers.iter().map(|layer| (of(layer), layer.height)).collect(),
        };
        let heights = || span([self.low, self.high].into_iter());
        let mut plots = Vec::new();
        if layers.iter().any(|layer| layer.solid_fraction > 0.0) {
            let solid = curve("", BLUE, &|layer| layer.solid_fraction);
            let most = solid.points.iter().map(|p| p.0).fold(0.1, f64::max);
            let axes = linear("solid fraction", "z (m)", 0.0..1.08 * most, heights());
            plots.push(Plot {
                name: "profile_density".into(),
                title: "Density by height".into(),
                caption: format!("Solid fraction of {} layers of the packing.", layers.len()),
                width: Width::Half,
                svg: chart(SIZE, &axes, &[solid])?,
            });
        }
        if self.moment.iter().any(|moment| moment.norm() > 0.0) {
            let mut curves = vec![
                curve("vertical", BLUE, &|layer| layer.stress[(2, 2)]),
                curve("horizontal", ORANGE, &|layer| {
                    0.5 * (layer.stress[(0, 0)] + layer.stress[(1, 1)])
                }),
            ];
            let mut weight = "";
            if self.gravity > 0.0 && self.period.is_none() {
                curves.insert(0, curve("weight above", MUTED, &|layer| layer.weight_above));
                weight = " Without wall friction, the vertical stress of a bed at rest equals the weight above.";
            }
            let values = curves.iter().flat_map(|c| &c.points).map(|p| p.0);
            let axes = linear("stress (Pa)", "z (m)", span(values.chain([0.0])), heights());
            plots.push(Plot {
                name: "profile_stress".into(),
                title: "Stress by height".into(),
                caption: format!(
                    "Stress of contacts in the layers, compression positive: vertical, and the mean \
                     of the horizontal ones.{weight}"
                ),
                width: Width::Half,
                svg: chart(SIZE, &axes, &curves)?,
            });
        }
        Ok(plots)
    }
}
