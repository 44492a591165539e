//! Which resolver serves which pair: the one place that names them all.

use super::{
    AgainstHalfSpace, Chain, CommonNormal, ContactResolver, Epa, ErodedGjk, SeededCommonNormal,
    SmoothCommonNormal, SphereSphere, Table,
};
use crate::shape::Kind;
use serde::{Deserialize, Serialize};

/// How pairs without a closed form are resolved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum Method {
    /// The common normal for smooth pairs, which all shapes so far are.
    #[default]
    Auto,
    /// [`CommonNormal`].
    CommonNormal,
    /// [`ErodedGjk`].
    GjkErosion {
        /// See [`ErodedGjk::ratio`].
        ratio: f64,
        /// See [`ErodedGjk::increment`].
        increment: f64,
        /// See [`ErodedGjk::tolerance`].
        tolerance: f64,
    },
    /// [`Epa`].
    Epa {
        /// See [`Epa::tolerance`].
        tolerance: f64,
    },
}

impl Method {
    /// As the scene file and reports name it.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::CommonNormal => "common-normal",
            Self::GjkErosion { .. } => "gjk-erosion",
            Self::Epa { .. } => "epa",
        }
    }

    /// The method for two kinds, with something to fall back on.
    fn chain(&self, kinds: [Kind; 2]) -> Chain {
        let super_quadric =
            |kind: &Kind| matches!(kind, Kind::Superellipsoid | Kind::PolySuperellipsoid);
        let last_resort = Epa { tolerance: 1e-10 };
        let (first, fallbacks): (Box<dyn ContactResolver>, Vec<Box<dyn ContactResolver>>) =
            match *self {
                Self::Auto | Self::CommonNormal if kinds.iter().any(super_quadric) => {
                    (Box::new(SmoothCommonNormal), vec![Box::new(last_resort)])
                }
                Self::Auto | Self::CommonNormal => (
                    Box::new(CommonNormal),
                    vec![Box::new(SeededCommonNormal::default()), Box::new(last_resort)],
                ),
                Self::GjkErosion { ratio, increment, tolerance } => (
                    Box::new(ErodedGjk { ratio, increment, tolerance }),
                    vec![Box::new(last_resort)],
                ),
                // An overlap that is too large by what erosion costs is better than a run that ends.
                Self::Epa { tolerance } => {
                    (Box::new(Epa { tolerance }), vec![Box::new(ErodedGjk::default())])
                }
            };
        Chain::new(first, fallbacks)
    }
}

/// The resolvers for all pairs of the kinds that a scene has. Spheres with each other and everything with a
/// wall have closed forms, whatever the method; walls do not meet each other.
pub fn table(method: &Method, kinds: &[Kind]) -> Table {
    let mut table = Table::new();
    for (i, &a) in Kind::ALL.iter().enumerate().filter(|(_, kind)| kinds.contains(kind)) {
        for &b in Kind::ALL[i..].iter().filter(|kind| kinds.contains(kind)) {
            let resolver: Box<dyn ContactResolver> = match (a, b) {
                (Kind::HalfSpace, Kind::HalfSpace) => continue,
                (_, Kind::HalfSpace) => Box::new(AgainstHalfSpace),
                (Kind::Sphere, Kind::Sphere) => Box::new(SphereSphere),
                _ => Box::new(method.chain([a, b])),
            };
            table.insert((a, b), resolver);
        }
    }
    table
}
