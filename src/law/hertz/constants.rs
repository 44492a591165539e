//! Constants of Hertzian contacts, and their mixing for two materials.

use crate::law::Mixing;
use serde::{Deserialize, Serialize};

/// Constants of a contact between two materials; by default all are zero.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Constants {
    /// `E*`, with `1/E* = (1 - ν_A²)/E_A + (1 - ν_B²)/E_B` [Pa].
    pub modulus: f64,
    /// `G*`, with `1/G* = (2 - ν_A)/G_A + (2 - ν_B)/G_B` [Pa].
    pub shear_modulus: f64,
    /// Coefficient of friction [-].
    pub friction: f64,
    /// Damping ratio `β` of both dashpots [-].
    pub damping_ratio: f64,
}

impl Mixing for Constants {
    /// Both moduli as for half spaces in series, which is their definition; the lower friction, the mean damping
    /// ratio.
    fn mixed(a: &Self, b: &Self) -> Self {
        let series = |x: f64, y: f64| if x + y > 0.0 { 2.0 * x * y / (x + y) } else { 0.0 };
        Self {
            modulus: series(a.modulus, b.modulus),
            shear_modulus: series(a.shear_modulus, b.shear_modulus),
            friction: if a.friction < b.friction { a.friction } else { b.friction },
            damping_ratio: 0.5 * (a.damping_ratio + b.damping_ratio),
        }
    }
}

impl Constants {
    /// Constants of a material with itself, from Young's modulus [Pa], Poisson's ratio, friction and damping ratio.
    pub fn of_material(youngs: f64, poisson: f64, friction: f64, damping_ratio: f64) -> Self {
        let shear = 0.5 * youngs / (1.0 + poisson);
        Self {
            modulus: 0.5 * youngs / (1.0 - poisson * poisson),
            shear_modulus: 0.5 * shear / (2.0 - poisson),
            friction,
            damping_ratio,
        }
    }
}
