//! Pairs of Lai et al. (2021), section 2.1: A at the origin, with its axes along x, y, z; B placed for the
//! requested overlap. Lengths are in metres, the short axis is 1 m (semi-axis 0.5 m).

use dem_mpi::contact::{CommonNormal, ContactResolver, Posed};
use dem_mpi::math::{Mat3, Quat, Vec3};
use dem_mpi::pairs::{Body, Pairs, signed};
use dem_mpi::random::Random;
use dem_mpi::shape::{Ellipsoid, Shape, Sphere};

/// Offset of the centre of B along y in Cases I and II [m].
pub const OFFSET: f64 = 0.35;

/// Sampling of the random pairs of Case III, which the paper does not specify.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sampling {
    /// The direction from centre to centre is uniform.
    CentreLine,
    /// The contact normal is uniform.
    Normal,
}

/// A prolate ellipsoid with this long axis [m] (full length, along its own x) and short axes of 1 m.
fn grain(long_axis: f64) -> Shape {
    Shape::Ellipsoid(Ellipsoid { semi_axes: Vec3::new(0.5 * long_axis, 0.5, 0.5) })
}

/// Position of the centre of B relative to the centre of A [m]. It lies on the line from `foot`, its point nearest
/// to A, along the unit vector `along`, where the overlap has the requested value (negative: a clearance).
///
/// The difference of the bodies is convex, so that the overlap is a concave function of the place on the line,
/// with slope `-n · along`. Newton's method from outside therefore converges from one side only.
fn place(a: &Posed, b: &Posed, foot: &Vec3, along: &Vec3, overlap: f64) -> Vec3 {
    const STEPS: usize = 100;
    let reach = a.shape.bounding_radius() + b.shape.bounding_radius();
    let mut at = reach + (-overlap).max(0.0);
    for _ in 0..STEPS {
        let r = foot + along * at;
        let Ok(touch) = signed(CommonNormal.touch(a, b, &r, None), a, b, &r) else { break };
        let step = (touch.overlap - overlap) / touch.normal.dot(along);
        at += step;
        if step > -1e-15 * reach {
            break;
        }
    }
    foot + along * at
}

/// Adds a pair, A at the origin and B at `r`.
fn add(pairs: &mut Pairs, name: String, shape: &Shape, rotation: Quat, r: Vec3) {
    let a = Body { shape: shape.clone(), centre: Vec3::zeros(), rotation: Quat::identity() };
    let b = Body { shape: shape.clone(), centre: r, rotation };
    pairs.push(name, a, b).expect("a case has few shapes");
}

/// Adds a pair whose long axes lie in the plane of x and y at an angle of `degrees`.
fn add_in_plane(
    pairs: &mut Pairs,
    name: String,
    long_axis: f64,
    degrees: f64,
    y: f64,
    overlap: f64,
) {
    let shape = grain(long_axis);
    let rotation = Quat::from_axis_angle(&Vec3::z_axis(), degrees.to_radians());
    let frame = rotation.to_rotation_matrix();
    let upright = Mat3::identity();
    let a = Posed::new(&shape, &upright);
    let b = Posed::new(&shape, frame.matrix());
    let r = place(&a, &b, &(Vec3::y() * y), &Vec3::x(), overlap);
    add(pairs, name, &shape, rotation, r);
}

/// Case I: parallel 1:2 ellipsoids, with the centre of B at `y` [m], one pair for each overlap [m] (negative: a
/// clearance).
pub fn case_1(y: f64, overlaps: &[f64]) -> Pairs {
    let mut pairs = Pairs::default();
    for overlap in overlaps {
        add_in_plane(&mut pairs, format!("I_{overlap:?}"), 2.0, 0.0, y, *overlap);
    }
    pairs
}

/// Overlaps of Case I from 0 to 0.05 in steps of 0.002 [m].
pub fn overlaps_of_case_1() -> Vec<f64> {
    (0..=25).map(|k| f64::from(k) / 500.0).collect()
}

/// Case II: B rotated about z by each angle [°], for each long axis [m], at an overlap of 0.02 m. The angles of
/// one long axis are consecutive.
pub fn case_2(long_axes: &[f64], degrees: &[f64]) -> Pairs {
    let mut pairs = Pairs::default();
    for long_axis in long_axes {
        for angle in degrees {
            let name = format!("II_{long_axis:?}_{angle:?}");
            add_in_plane(&mut pairs, name, *long_axis, *angle, OFFSET, 0.02);
        }
    }
    pairs
}

/// Numbers from `first` to `last` in equal steps.
pub fn steps(first: f64, last: f64, count: u32) -> Vec<f64> {
    (0..=count).map(|k| first + (last - first) * f64::from(k) / f64::from(count)).collect()
}

/// Kind of random pairs: touching or separate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Meeting {
    /// Overlap uniform in 0 to 0.05 m.
    Contact,
    /// Clearance uniform in 0 to 1 m.
    NonContact,
}

impl Meeting {
    /// An overlap of zero is excluded: relative errors have no meaning there.
    fn overlap(self, random: &mut Random) -> f64 {
        let part = 1.0 - random.unit();
        match self {
            Self::Contact => 0.05 * part,
            Self::NonContact => -part,
        }
    }
}

/// Case III: 1:2 ellipsoids, B in a random orientation. A pair depends on the seed and its number alone.
pub fn case_3(meeting: Meeting, sampling: Sampling, count: usize, seed: u64) -> Pairs {
    let shape = grain(2.0);
    let upright = Mat3::identity();
    let a = Posed::new(&shape, &upright);
    let mut pairs = Pairs::default();
    for id in 0..count {
        let mut random = Random::of(seed, id as u64);
        let rotation = random.rotation();
        let direction = random.rotation() * Vec3::x();
        let overlap = meeting.overlap(&mut random);
        let frame = rotation.to_rotation_matrix();
        let b = Posed::new(&shape, frame.matrix());
        let r = match sampling {
            Sampling::CentreLine => place(&a, &b, &Vec3::zeros(), &direction, overlap),
            // With an overlap below the least radii of curvature, this normal remains that of least overlap.
            Sampling::Normal => {
                a.support(&direction) - b.support(&-direction) - direction * overlap
            }
        };
        add(&mut pairs, format!("III_{id}"), &shape, rotation, r);
    }
    pairs
}

/// Balls of 1 m diameter, with the overlaps and clearances of Case III.
pub fn spheres(meeting: Meeting, count: usize, seed: u64) -> Pairs {
    let shape = Shape::Sphere(Sphere { radius: 0.5 });
    let mut pairs = Pairs::default();
    for id in 0..count {
        let mut random = Random::of(seed, id as u64);
        let direction = random.rotation() * Vec3::x();
        let r = direction * (1.0 - meeting.overlap(&mut random));
        add(&mut pairs, format!("sphere_{id}"), &shape, Quat::identity(), r);
    }
    pairs
}
