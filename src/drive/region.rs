//! Regions of space in which particles come or go.

use crate::cell::Cell;
use crate::math::Vec3;
use crate::random::Random;
use serde::{Deserialize, Serialize};

/// A part of space.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Region {
    /// Half space behind a plane.
    Behind {
        /// A point of the plane [m].
        point: Vec3,
        /// Unit normal, towards the particles.
        normal: Vec3,
    },
    /// A box; as an inlet it may be flat.
    Box {
        /// Lowest corner [m].
        low: Vec3,
        /// Highest corner [m].
        high: Vec3,
    },
    /// A cylinder.
    Cylinder {
        /// Centres of its two ends [m].
        axis: [Vec3; 2],
        /// Radius [m].
        radius: f64,
    },
}

impl Region {
    /// Is a place in the region, or the nearest of its periodic images?
    pub fn holds(&self, position: &Vec3, cell: &Cell) -> bool {
        match self {
            Self::Behind { point, normal } => normal.dot(&(position - point)) < 0.0,
            Self::Box { low, high } => {
                let (middle, half) = ((low + high) * 0.5, (high - low) * 0.5);
                let apart = cell.nearest(position - middle).abs();
                (0..3).all(|axis| apart[axis] <= half[axis])
            }
            Self::Cylinder { axis: [from, to], radius } => {
                let (middle, half) = ((from + to) * 0.5, (to - from) * 0.5);
                let apart = cell.nearest(position - middle);
                let along = apart.dot(&half) / half.norm_squared();
                along.abs() <= 1.0 && (apart - half * along).norm_squared() <= radius * radius
            }
        }
    }

    /// Distance of a place, or of the nearest of its periodic images, to the region [m]; inside, minus the distance to the
    /// border.
    pub fn distance(&self, position: &Vec3, cell: &Cell) -> f64 {
        // Outside the ends and outside the side, each where positive.
        let of_parts = |beyond: Vec3| beyond.max().min(0.0) + beyond.sup(&Vec3::zeros()).norm();
        match self {
            Self::Behind { point, normal } => normal.dot(&(position - point)),
            Self::Box { low, high } => {
                let (middle, half) = ((low + high) * 0.5, (high - low) * 0.5);
                of_parts(cell.nearest(position - middle).abs() - half)
            }
            Self::Cylinder { axis: [from, to], radius } => {
                let (middle, half) = ((from + to) * 0.5, (to - from) * 0.5);
                let apart = cell.nearest(position - middle);
                let (direction, length) = (half.normalize(), half.norm());
                let along = apart.dot(&direction);
                let across = (apart - direction * along).norm() - radius;
                of_parts(Vec3::new(along.abs() - length, across, f64::NEG_INFINITY))
            }
        }
    }

    /// Corners of the bounding box [m]; `None` if the region is unbounded.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        match self {
            Self::Behind { .. } => None,
            Self::Box { low, high } => Some((*low, *high)),
            Self::Cylinder { axis: [from, to], radius } => {
                let along = (to - from).normalize();
                // Extent of a disk across the axis.
                let reach = along.map(|part| radius * (1.0 - part * part).max(0.0).sqrt());
                Some((from.inf(to) - reach, from.sup(to) + reach))
            }
        }
    }

    /// Shortest extent [m]; infinite if the region is unbounded.
    pub fn thickness(&self) -> f64 {
        match self {
            Self::Behind { .. } => f64::INFINITY,
            Self::Box { low, high } => (high - low).min(),
            Self::Cylinder { axis: [from, to], radius } => (to - from).norm().min(2.0 * radius),
        }
    }

    /// Random place in the region, uniformly distributed; `None` if the region is unbounded.
    pub fn draw(&self, random: &mut Random) -> Option<Vec3> {
        match self {
            Self::Behind { .. } => None,
            Self::Box { low, high } => {
                Some(Vec3::from_fn(|axis, _| low[axis] + (high[axis] - low[axis]) * random.unit()))
            }
            Self::Cylinder { axis: [from, to], radius } => {
                let along = (to - from).normalize();
                let first = along.cross(&Vec3::ith(along.iamin(), 1.0)).normalize();
                let second = along.cross(&first);
                let (x, y) = loop {
                    let (x, y) = (random.signed(), random.signed());
                    if x * x + y * y <= 1.0 {
                        break (x, y);
                    }
                };
                Some(from + (to - from) * random.unit() + (first * x + second * y) * *radius)
            }
        }
    }

    /// Description for `--plan`.
    pub fn words(&self) -> String {
        let list = |v: &Vec3| format!("[{:?}, {:?}, {:?}]", v.x, v.y, v.z);
        match self {
            Self::Behind { point, normal } => {
                format!("behind the plane at {} m with normal {}", list(point), list(normal))
            }
            Self::Box { low, high } => format!("in the box from {} to {} m", list(low), list(high)),
            Self::Cylinder { axis: [from, to], radius } => {
                format!(
                    "in the cylinder of radius {radius:?} m from {} to {} m",
                    list(from),
                    list(to)
                )
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Region;
    use crate::cell::Cell;
    use crate::math::Vec3;
    use crate::random::Random;

    /// Drawn places are in the region and fill it evenly: means and variances along the axis and across, within five
    /// standard errors.
    #[test]
    fn places_fill_a_cylinder() {
        let (from, to) = (Vec3::new(0.1, 0.2, 0.3), Vec3::new(0.3, 0.5, 0.2));
        let region = Region::Cylinder { axis: [from, to], radius: 0.1 };
        let cell = Cell::new(Vec3::zeros(), Vec3::repeat(1.0), [false; 3]);
        let (low, high) = region.bounds().unwrap();
        let count = 20_000;
        let (mut along_all, mut square) = (0.0, 0.0);
        for id in 0..count {
            let place = region.draw(&mut Random::of(9, id)).unwrap();
            assert!(region.holds(&place, &cell));
            assert!((0..3).all(|k| (low[k]..=high[k]).contains(&place[k])));
            let axis = to - from;
            let along = (place - from).dot(&axis) / axis.norm_squared();
            along_all += along;
            square += (place - from - axis * along).norm_squared();
        }
        let error = 5.0 / f64::from(count as u32).sqrt();
        assert!((along_all / count as f64 - 0.5).abs() < error * 0.29);
        // Mean square of the distance to the middle of a disk: r²/2, with a deviation of r²/√12.
        assert!((square / count as f64 / 0.01 - 0.5).abs() < error * 0.29);
    }

    /// The nearest of many places on the border is as far away as the distance, up to the mesh of these places. Places that
    /// the region holds have a negative distance.
    #[test]
    fn distances_are_those_to_the_border() {
        const MESH: u32 = 120;
        let cell = Cell::new(Vec3::zeros(), Vec3::repeat(1.0), [false; 3]);
        let (from, to, radius) = (Vec3::new(0.4, 0.5, 0.45), Vec3::new(0.55, 0.6, 0.65), 0.12);
        let pipe = Region::Cylinder { axis: [from, to], radius };
        let along: Vec3 = (to - from).normalize();
        let first = along.cross(&Vec3::x()).normalize();
        let second = along.cross(&first);
        let (low, high) = (Vec3::new(0.3, 0.4, 0.35), Vec3::new(0.6, 0.65, 0.8));
        let slab = Region::Box { low, high };
        let part = |k: u32| f64::from(k) / f64::from(MESH);
        let (mut of_pipe, mut of_slab) = (Vec::new(), Vec::new());
        for k in 0..(MESH + 1) * (MESH + 1) {
            let parts = [part(k % (MESH + 1)), part(k / (MESH + 1))];
            let (sine, cosine) = (std::f64::consts::TAU * parts[0]).sin_cos();
            let out = (first * cosine + second * sine) * radius;
            of_pipe.extend([
                from + (to - from) * parts[1] + out,
                from + out * parts[1],
                to + out * parts[1],
            ]);
            for (axis, end) in (0..3).flat_map(|axis| [(axis, low), (axis, high)]) {
                let mut place = end;
                for (other, part) in [(axis + 1) % 3, (axis + 2) % 3].into_iter().zip(parts) {
                    place[other] = low[other] + (high[other] - low[other]) * part;
                }
                of_slab.push(place);
            }
        }
        for (region, border) in [(pipe, of_pipe), (slab, of_slab)] {
            let mut inside = 0;
            for id in 0..200 {
                let mut random = Random::of(4, id);
                let place = Vec3::from_fn(|_, _| 0.2 + 0.6 * random.unit());
                let found = region.distance(&place, &cell);
                let nearest =
                    border.iter().map(|p| (p - place).norm()).fold(f64::INFINITY, f64::min);
                let off = nearest - found.abs();
                assert!((-1e-12..0.008).contains(&off), "{region:?} {place:?}: {found} {nearest}");
                assert_eq!(found < 0.0, region.holds(&place, &cell), "{place:?}");
                inside += u32::from(found < 0.0);
            }
            assert!((2..150).contains(&inside), "{inside}");
        }
        let plane = Region::Behind { point: Vec3::z() * 0.3, normal: Vec3::z() };
        assert!((plane.distance(&Vec3::repeat(0.5), &cell) - 0.2).abs() < 1e-15);
    }

    #[test]
    fn a_box_across_a_period_holds_both_sides() {
        let cell = Cell::new(Vec3::zeros(), Vec3::repeat(1.0), [true, false, false]);
        let region = Region::Box { low: Vec3::new(0.8, 0.0, 0.0), high: Vec3::repeat(1.0) };
        assert!(region.holds(&Vec3::new(-0.1, 0.5, 0.5), &cell));
        assert!(!region.holds(&Vec3::new(0.1, 0.5, 0.5), &cell));
    }
}
