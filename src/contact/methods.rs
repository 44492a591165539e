//! Which resolver serves which pair: the one place that names them all.

use super::{
    AgainstHalfSpace, Chain, CommonNormal, ContactResolver, Cores, Epa, ErodedGjk,
    SeededCommonNormal, SmoothCommonNormal, SphereSphere, Table,
};
use crate::shape::Kind;
use serde::{Deserialize, Serialize};

/// How pairs without a closed form are resolved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum Method {
    /// [`CommonNormal`] for two smooth shapes, [`Cores`] if one of them has a margin, [`Epa`] for all others: beside an
    /// edge, erosion takes more of a polyhedron than the overlap is wide, and answers with another direction.
    #[default]
    Auto,
    /// [`CommonNormal`]; for smooth shapes only. Other pairs are resolved as by `Auto`.
    CommonNormal,
    /// [`ErodedGjk`].
    GjkErosion(ErodedGjk),
    /// [`Epa`].
    Epa(Epa),
}

impl Method {
    /// As the scene file and reports name it.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::CommonNormal => "common-normal",
            Self::GjkErosion(_) => "gjk-erosion",
            Self::Epa(_) => "epa",
        }
    }

    /// The method for pairs of two kinds, with something to fall back on.
    fn chain(&self, a: Kind, b: Kind) -> Chain {
        // A tight tolerance asks too much of a continuum of normals, as of crossed cylinders; and an overlap that
        // is too large by what erosion costs is better than a run that ends.
        let last_resorts = || -> Vec<Box<dyn ContactResolver>> {
            vec![
                Box::new(Epa::new(1e-10)),
                Box::new(Epa::default()),
                Box::new(ErodedGjk::default()),
            ]
        };
        let by_epa = |epa: Epa| -> (Box<dyn ContactResolver>, Vec<Box<dyn ContactResolver>>) {
            (Box::new(epa), vec![Box::new(ErodedGjk::default())])
        };
        let (first, fallbacks): (Box<dyn ContactResolver>, Vec<Box<dyn ContactResolver>>) =
            match *self {
                Self::Auto | Self::CommonNormal if a.is_ellipsoidal() && b.is_ellipsoidal() => {
                    let mut fallbacks = last_resorts();
                    fallbacks.insert(0, Box::new(SeededCommonNormal::default()));
                    (Box::new(CommonNormal), fallbacks)
                }
                Self::Auto | Self::CommonNormal if a.is_smooth() && b.is_smooth() => {
                    (Box::new(SmoothCommonNormal), last_resorts())
                }
                Self::Auto | Self::CommonNormal if a.has_margin() || b.has_margin() => {
                    (Box::new(Cores), last_resorts())
                }
                Self::GjkErosion(erosion) => (Box::new(erosion), last_resorts()),
                Self::Auto | Self::CommonNormal => by_epa(Epa::default()),
                Self::Epa(epa) => by_epa(epa),
            };
        Chain::new(first, fallbacks)
    }
}

/// Do the resolvers of [`table`] want the matrices of ellipsoids in place ([`super::Bodies::form`])?
pub fn needs_form(method: &Method, kinds: &[Kind]) -> bool {
    matches!(method, Method::Auto | Method::CommonNormal) && kinds.contains(&Kind::Ellipsoid)
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
                _ => Box::new(method.chain(a, b)),
            };
            table.insert((a, b), resolver);
        }
    }
    table
}
