//! Resolvers by pair of kinds: the one place that names all of them.

use super::{
    AgainstHalfSpace, AgainstTriangleMesh, Chain, CommonNormal, ContactResolver, Cores, Epa,
    ErodedGjk, Overlap, OverlapWithSurface, SeededCommonNormal, SmoothCommonNormal, SphereSphere,
    Table,
};
use crate::shape::Kind;
use serde::{Deserialize, Serialize};

/// Resolution of pairs without a closed form.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum Method {
    /// Default choice by pair:
    ///
    /// - [`Overlap`] for two shapes with faces or straight sides, and for one on a plane; [`OverlapWithSurface`] for one on triangles;
    /// - [`CommonNormal`] for two smooth shapes;
    /// - [`Cores`] if one of the two has a margin;
    /// - [`Epa`] for all others. Erosion is not used there: beside an edge it removes more of a polyhedron than the width of the
    ///   overlap and gives another direction.
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
    /// Name in the scene file and in reports.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::CommonNormal => "common-normal",
            Self::GjkErosion(_) => "gjk-erosion",
            Self::Epa(_) => "epa",
        }
    }

    /// Whether the method computes the thickness of the shared volume for these kinds, and not a depth.
    pub fn is_by_thickness(&self, (a, b): (Kind, Kind)) -> bool {
        let is_extended = a.extended()[0] & b.extended()[1] != 0;
        is_extended && matches!(self, Self::Auto | Self::CommonNormal)
    }

    /// Resolver with fallbacks for pairs of two kinds.
    fn chain(&self, a: Kind, b: Kind) -> Chain {
        // A tight tolerance cannot be met for a continuum of normals, as of crossed cylinders. An overlap that is too large by
        // the error of erosion is better than a run that ends.
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

/// Whether the resolvers of [`table`] need the matrices of ellipsoids in place ([`super::Bodies::form`]).
pub fn needs_form(method: &Method, kinds: &[Kind]) -> bool {
    matches!(method, Method::Auto | Method::CommonNormal) && kinds.contains(&Kind::Ellipsoid)
}

/// Resolvers for all pairs of the kinds in a scene, all of which compute a depth.
///
/// Two spheres, and anything with a wall, have closed forms whatever the method. Walls do not meet each other.
pub fn table(method: &Method, kinds: &[Kind]) -> Table {
    table_of(kinds, |a, b| by_depth(method, a, b))
}

/// Resolvers for laws that use patches: those of [`table`], except for bodies with faces or straight sides.
///
/// For these they compute the thickness of the shared volume, unless a method is asked for by name.
pub fn table_with_patches(method: &Method, kinds: &[Kind]) -> Table {
    table_of(kinds, |a, b| {
        let by_depth = by_depth(method, a, b);
        if !method.is_by_thickness((a, b)) {
            by_depth
        } else if b == Kind::TriangleMesh {
            Box::new(OverlapWithSurface)
        } else {
            Box::new(Chain::new(Box::new(Overlap), vec![by_depth]))
        }
    })
}

fn table_of(kinds: &[Kind], resolver: impl Fn(Kind, Kind) -> Box<dyn ContactResolver>) -> Table {
    let mut table = Table::new();
    for (i, &a) in Kind::ALL.iter().enumerate().filter(|(_, kind)| kinds.contains(kind)) {
        for &b in Kind::ALL[i..].iter().filter(|kind| kinds.contains(kind)) {
            if !(a.is_of_walls() && b.is_of_walls()) {
                table.insert((a, b), resolver(a, b));
            }
        }
    }
    table
}

fn by_depth(method: &Method, a: Kind, b: Kind) -> Box<dyn ContactResolver> {
    match (a, b) {
        (_, Kind::HalfSpace) => Box::new(AgainstHalfSpace),
        (_, Kind::TriangleMesh) => Box::new(AgainstTriangleMesh::default()),
        (Kind::Sphere, Kind::Sphere) => Box::new(SphereSphere),
        _ => Box::new(method.chain(a, b)),
    }
}
