//! Orientations of new particles.

use crate::math::{Quat, Vec3};
use crate::random::Random;
use nalgebra::Quaternion;
use serde::{Deserialize, Serialize};

/// A distribution of orientations.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Orientations {
    /// All orientations are equally likely.
    Random,
    /// Own axes along x, y, z.
    Upright,
    /// An own axis along a direction, with a random tilt and a random rotation about itself.
    Along {
        /// Index of the own axis: 0, 1 or 2.
        own: usize,
        /// Direction, a unit vector.
        axis: Vec3,
        /// 1 less the cosine of the largest tilt: the height of a cap of the unit sphere.
        ///
        /// The own axis ends on that cap, with equal likelihood at all points.
        cap: f64,
    },
}

impl Orientations {
    /// Draws an orientation.
    pub fn draw(&self, random: &mut Random) -> Quat {
        let (own, axis, cap) = match self {
            Self::Random => return random.rotation(),
            Self::Upright => return Quat::identity(),
            Self::Along { own, axis, cap } => (*own, axis, *cap),
        };
        // Areas of caps are in proportion to their heights (Archimedes): 1 - cos θ is uniform, and half of it is the square of sin θ/2.
        let square = 0.5 * cap * random.unit();
        let [x, y] = random.on_circle();
        let mut about = Vec3::zeros();
        (about[(own + 1) % 3], about[(own + 2) % 3]) = (x, y);
        let tilt = quaternion((1.0 - square).sqrt(), about * square.sqrt());
        let [half_cosine, half_sine] = random.on_circle();
        let turn = quaternion(half_cosine, Vec3::ith(own, 1.0) * half_sine);
        let all = shortest_turn(own, axis) * tilt * turn;
        Quat::new_normalize(all.into_inner())
    }
}

fn quaternion(real: f64, imaginary: Vec3) -> Quat {
    Quat::new_unchecked(Quaternion::from_parts(real, imaginary))
}

/// Rotation by the least angle from a coordinate axis to a direction.
///
/// It uses only square roots, so the bits are the same on every machine.
fn shortest_turn(own: usize, direction: &Vec3) -> Quat {
    let cosine = direction[own];
    let across = Vec3::ith(own, 1.0).cross(direction);
    let sine = across.norm();
    if sine == 0.0 {
        let half_turn = quaternion(0.0, Vec3::ith((own + 1) % 3, 1.0));
        return if cosine > 0.0 { Quat::identity() } else { half_turn };
    }
    // The larger of sine and cosine of half the angle first, which loses no digits.
    let larger = (0.5 * (1.0 + cosine.abs())).sqrt();
    let smaller = 0.5 * sine / larger;
    let [half_cosine, half_sine] = if cosine > 0.0 { [larger, smaller] } else { [smaller, larger] };
    quaternion(half_cosine, across * (half_sine / sine))
}

#[cfg(test)]
mod tests {
    use super::{Orientations, shortest_turn};
    use crate::math::Vec3;
    use crate::random::Random;

    /// Every own axis to directions beside it, across it, opposite to it and nearly so.
    #[test]
    fn the_shortest_turn_takes_an_axis_to_a_direction() {
        for own in 0..3 {
            let (along, across) = (Vec3::ith(own, 1.0), Vec3::ith((own + 1) % 3, 1.0));
            for part in [0.0, 1e-12, 1e-6, 0.3, 1.0, 1e3] {
                for sign in [1.0, -1.0] {
                    let direction: Vec3 = (along * sign + across * part).normalize();
                    let turn = shortest_turn(own, &direction);
                    assert!((turn.norm() - 1.0).abs() < 2e-15);
                    assert!((turn * along - direction).norm() < 2e-15, "{own} {part} {sign}");
                    // By the least angle: there is no rotation about the own axis.
                    assert_eq!(turn.imag()[own], 0.0);
                }
            }
        }
    }

    /// Statistics of tilts on a cap, within five standard errors.
    ///
    /// For a half angle s, the mean cosine of the tilt is (1 + cos s)/2 and its variance (1 - cos s)²/12. All rotations around the direction and about
    /// the own axis are equally likely: the mean of a unit vector is 0, with a deviation of √(1/2) of each component.
    #[test]
    fn tilts_are_uniform_on_a_cap() {
        let count = 4000_u32;
        let axis = Vec3::new(0.3, -0.5, 0.7).normalize();
        let error = 5.0 / f64::from(count).sqrt();
        for own in 0..3 {
            for half_angle in [0.0_f64, 10.0, 90.0, 180.0] {
                let least = half_angle.to_radians().cos();
                let law = Orientations::Along { own, axis, cap: 1.0 - least };
                let (mut cosines, mut square, mut around, mut turned) =
                    (0.0, 0.0, Vec3::zeros(), Vec3::zeros());
                for id in 0..count {
                    let turn = law.draw(&mut Random::of(5, id.into()));
                    let (end, side) =
                        (turn * Vec3::ith(own, 1.0), turn * Vec3::ith((own + 1) % 3, 1.0));
                    let cosine = end.dot(&axis);
                    assert!(cosine >= least - 1e-14, "{own} {half_angle}: {cosine}");
                    cosines += cosine;
                    square += cosine * cosine;
                    around += (end - axis * cosine).try_normalize(1e-9).unwrap_or_default();
                    turned += side;
                }
                let count = f64::from(count);
                let (mean, variance) = (0.5 * (1.0 + least), (1.0 - least).powi(2) / 12.0);
                let off = cosines / count - mean;
                assert!(
                    off.abs() <= error * variance.sqrt() + 1e-14,
                    "{own} {half_angle}: {off:e}"
                );
                // A square of a uniform number deviates from its mean by less than its range.
                let off = square / count - (variance + mean * mean);
                assert!(off.abs() <= error * (1.0 - least) + 1e-14, "{own} {half_angle}: {off:e}");
                assert!((around / count).amax() < error, "{own} {half_angle}: {around}");
                assert!((turned / count).amax() < error, "{own} {half_angle}: {turned}");
            }
        }
    }
}
