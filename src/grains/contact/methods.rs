//! Which resolver serves which pair: the one place that names them all.

use super::{
    AgainstHalfSpace, AgainstTriangleMesh, Chain, CommonNormal, ContactResolver, Cores, Epa,
    ErodedGjk, Overlap, OverlapWithSurface, SeededCommonNormal, SmoothCommonNormal, SphereSphere,
    Table,
};
use crate::shape::Kind;
use serde::{Deserialize, Serialize};

/// How pairs without a closed form are resolved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum Method {
    /// [`Overlap`] for two shapes with faces or with straight sides, and for one on a plane, [`OverlapWithSurface`] for one on
    /// triangles. Of others [`CommonNormal`] for two smooth shapes,
    /// [`Cores`] if one of them has a margin, [`Epa`] for all the rest: beside an edge, erosion takes more of a polyhedron
    /// than the overlap is wide, and answers with another direction.
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

    /// Does it find what two shapes of these kinds share, and not how deep they are in each other?
    pub fn is_by_thickness(&self, (a, b): (Kind, Kind)) -> bool {
        let is_extended = a.extended()[0] & b.extended()[1] != 0;
        is_extended && matches!(self, Self::Auto | Self::CommonNormal)
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

/// The resolvers for all pairs of the kinds that a scene has, all of which find a depth. Spheres with each other and
/// everything with a wall have closed forms, whatever the method; walls do not meet each other.
pub fn table(method: &Method, kinds: &[Kind]) -> Table {
    table_of(kinds, |a, b| by_depth(method, a, b))
}

/// The same for laws that know of patches: of bodies with faces or straight sides the thickness of what they share, unless
/// a method is asked for by name.
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
