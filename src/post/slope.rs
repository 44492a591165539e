//! Angle of the free surface of a heap.
//!
//! Seen from above, the packing is divided into square columns, one diameter of the largest shape wide. The height of the surface
//! in a column is the top of the highest particle with its centre there; a column without particles has no surface. Columns are
//! combined into strips one diameter wide, along an axis or around the vertical through the centre of mass. A line is fitted by
//! least squares to the columns of some strips: those with a mean height between 20 and 80 % of the way from the lowest to the
//! highest strip. Foot and top, which are round, are left out. The angle is `atan` of the slope, positive where the surface rises
//! along the axis, or for a cone towards the middle. Particles without contacts are in flight and left out, unless no particle
//! has any.

use super::check;
use super::errors::MeasureError;
use super::pieces;
use super::region::{Margin, Region, Turned};
use crate::math::Vec3;
use crate::output::snapshot::Reader;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Direction in which the surface falls.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Direction {
    /// A plane that rises or falls along x.
    X,
    /// A plane that rises or falls along y.
    Y,
    /// A cone around the vertical through the centre of mass.
    Radial,
}

/// Surface of a snapshot.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Slope {
    /// Step of the snapshot.
    pub step: u64,
    /// Time of the snapshot [s].
    pub time_s: f64,
    /// Angle to the horizontal [degrees].
    pub angle_degrees: f64,
    /// Height from the lowest to the highest strip [m].
    pub height_m: f64,
    /// Root mean square distance of the columns from the line [m].
    pub scatter_m: f64,
    /// Number of columns of the fit.
    pub columns: u64,
}

/// Shares of the height between which the line is fitted.
const FITTED: [f64; 2] = [0.2, 0.8];

/// Columns of a surface with the fitted line. The first number is x, y, or the distance from the middle [m], the second the
/// height [m].
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// Numbers of the surface.
    pub slope: Slope,
    /// Top of each column.
    pub columns: Vec<(f64, f64)>,
    /// Both ends of the line.
    pub line: [(f64, f64); 2],
}

impl Surface {
    /// Surface of a snapshot; with a region, of the particles with centres in it.
    ///
    /// # Errors
    /// If a file cannot be read or is invalid, gravity is not along -z, or there are too few columns.
    pub fn of(reader: &Reader, region: Region, along: Direction) -> Result<Self, MeasureError> {
        let header = reader.header();
        region.check(header)?;
        let gravity = header.gravity;
        if !(gravity.z < 0.0 && gravity.x == 0.0 && gravity.y == 0.0) {
            return Err(MeasureError::NoVertical { gravity });
        }
        let width = Margin::Diameters(1.0).metres(reader)?;
        let any_touches = any_touches(reader)?;
        // For each column, the highest point and the centre of its particle.
        let mut tops: BTreeMap<[i64; 2], (f64, Vec3)> = BTreeMap::new();
        let (mut moment, mut mass) = (Vec3::zeros(), 0.0);
        for rows in pieces(reader.particle_count()) {
            let particles = reader.particles(rows)?;
            check::check_particles(header, &particles)?;
            for (row, place) in particles.position.iter().enumerate() {
                if let Region::Box(bounds) = region
                    && !bounds.contains(place)
                {
                    continue;
                }
                if any_touches && particles.coordination[row] == 0 {
                    continue;
                }
                let shape = &header.shapes[particles.shape[row].index()];
                let heavy = shape.mass * particles.volume_ratio(row);
                moment += place * heavy;
                mass += heavy;
                let top = place.z + Turned::of(header, &particles, row).support(&Vec3::z()).z;
                let column = [place.x, place.y].map(|x| (x / width).floor() as i64);
                let highest = tops.entry(column).or_insert((top, *place));
                if top > highest.0 {
                    *highest = (top, *place);
                }
            }
        }
        if mass == 0.0 {
            return Err(MeasureError::NobodyThere);
        }
        let middle = moment / mass;
        let points = tops.into_values().map(|(top, place)| {
            let at = match along {
                Direction::X => place.x,
                Direction::Y => place.y,
                Direction::Radial => (place.x - middle.x).hypot(place.y - middle.y),
            };
            (at, top)
        });
        let columns: Vec<_> = points.collect();
        let fit = Fit::of(&columns, width)?;
        // Rising towards the middle is positive.
        let sign = if along == Direction::Radial { -1.0 } else { 1.0 };
        let slope = Slope {
            step: header.step,
            time_s: header.time,
            angle_degrees: (sign * fit.slope).atan().to_degrees(),
            height_m: fit.height,
            scatter_m: fit.scatter,
            columns: fit.columns as u64,
        };
        Ok(Self { slope, columns, line: fit.line })
    }
}

/// True if any particle has a contact, so that those without are in flight.
fn any_touches(reader: &Reader) -> Result<bool, MeasureError> {
    for rows in pieces(reader.particle_count()) {
        if reader.particles(rows)?.coordination.iter().any(|&contacts| contacts > 0) {
            return Ok(true);
        }
    }
    Ok(false)
}

struct Fit {
    slope: f64,
    height: f64,
    scatter: f64,
    columns: usize,
    /// Both ends.
    line: [(f64, f64); 2],
}

impl Fit {
    /// Fit to columns, each a position along the surface and a height [m].
    fn of(columns: &[(f64, f64)], width: f64) -> Result<Self, MeasureError> {
        let mut strips: BTreeMap<i64, Vec<(f64, f64)>> = BTreeMap::new();
        for &column in columns {
            strips.entry((column.0 / width).floor() as i64).or_default().push(column);
        }
        let mean = |strip: &[(f64, f64)]| {
            strip.iter().map(|column| column.1).sum::<f64>() / strip.len() as f64
        };
        let heights: Vec<f64> = strips.values().map(|strip| mean(strip)).collect();
        let low = heights.iter().copied().fold(f64::INFINITY, f64::min);
        let high = heights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let [from, to] = FITTED.map(|share| low + share * (high - low));
        let in_reach = strips.into_values().zip(heights).filter(|(_, h)| (from..=to).contains(h));
        let mut strips_fitted = 0;
        let fitted: Vec<(f64, f64)> = in_reach
            .flat_map(|(strip, _)| {
                strips_fitted += 1;
                strip
            })
            .collect();
        if strips_fitted < 3 {
            return Err(MeasureError::NoSurface { strips: strips_fitted });
        }
        let (slope, offset) = line(&fitted);
        let off = fitted.iter().map(|(x, y)| (y - offset - slope * x).powi(2));
        let scatter = (off.sum::<f64>() / fitted.len() as f64).sqrt();
        let ends = |of: fn(f64, f64) -> f64| fitted.iter().map(|column| column.0).reduce(of);
        let line = [ends(f64::min), ends(f64::max)].map(Option::unwrap_or_default);
        let line = line.map(|at| (at, offset + slope * at));
        Ok(Self { slope, height: high - low, scatter, columns: fitted.len(), line })
    }
}

/// Slope and offset of the least-squares line through points.
pub(super) fn line(points: &[(f64, f64)]) -> (f64, f64) {
    let count = points.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / count;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let (mut above, mut below) = (0.0, 0.0);
    for point in points {
        above += (point.0 - x) * (point.1 - y);
        below += (point.0 - x).powi(2);
    }
    let slope = above / below;
    (slope, y - slope * x)
}
