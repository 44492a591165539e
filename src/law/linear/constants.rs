//! Constants of linear contacts, their mixing for two materials, and the damping ratio for a restitution.

use crate::law::Mixing;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Constants of a contact between two materials; by default all are zero.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Constants {
    /// Normal stiffness of a contact [N/m].
    pub normal_stiffness: f64,
    /// Tangential stiffness of a contact [N/m].
    pub tangential_stiffness: f64,
    /// Coefficient of friction [-].
    pub friction: f64,
    /// Damping ratio of the normal dashpot, as a fraction of critical damping of the pair [-].
    pub normal_damping_ratio: f64,
    /// Damping ratio of the tangential dashpot [-].
    pub tangential_damping_ratio: f64,
}

impl Mixing for Constants {
    /// Stiffnesses as for two half springs in series (the harmonic mean), the lower friction, the mean damping
    /// ratios.
    fn mixed(a: &Self, b: &Self) -> Self {
        let series = |x: f64, y: f64| if x + y > 0.0 { 2.0 * x * y / (x + y) } else { 0.0 };
        Self {
            normal_stiffness: series(a.normal_stiffness, b.normal_stiffness),
            tangential_stiffness: series(a.tangential_stiffness, b.tangential_stiffness),
            friction: if a.friction < b.friction { a.friction } else { b.friction },
            normal_damping_ratio: 0.5 * (a.normal_damping_ratio + b.normal_damping_ratio),
            tangential_damping_ratio: 0.5
                * (a.tangential_damping_ratio + b.tangential_damping_ratio),
        }
    }
}

impl Constants {
    /// Does a contact feel tangential motion?
    pub fn is_frictional(&self) -> bool {
        self.friction > 0.0 && self.tangential_stiffness > 0.0
    }
}

/// Damping ratio `ζ` of a linear dashpot that gives a head-on collision this coefficient of restitution, in (0, 1].
///
/// If the dashpot may attract until the overlap is zero, `e = exp(-π ζ / √(1 - ζ²))`. If `limited`, the contact ends
/// when the force does. Then `e = exp(-(π - 2θ) tan θ)` with `ζ = sin θ`, and beyond critical damping
/// `e = exp(-2u coth u)` with `ζ = cosh u` (Schwager and Pöschel 2007, DOI 10.1007/s10035-007-0065-z).
pub fn damping_ratio_of_restitution(restitution: f64, limited: bool) -> f64 {
    let wanted = -libm::log(restitution);
    if !limited {
        return wanted / (PI * PI + wanted * wanted).sqrt();
    }
    if wanted == 0.0 {
        return 0.0;
    }
    // At critical damping the exponent is 2.
    if wanted < 2.0 {
        libm::sin(bisect(0.0, 0.5 * PI, |angle| (PI - 2.0 * angle) * libm::tan(angle) < wanted))
    } else {
        // u coth u lies between u and u + 1.
        libm::cosh(bisect(0.0, 0.5 * wanted, |u| u == 0.0 || 2.0 * u / libm::tanh(u) < wanted))
    }
}

/// Largest place between `low` and `high` at which `below` holds.
fn bisect(mut low: f64, mut high: f64, below: impl Fn(f64) -> bool) -> f64 {
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if below(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}
