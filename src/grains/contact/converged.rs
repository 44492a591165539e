//! Converged answer for one pair at any cost, the reference for the methods.
//!
//! | definition of the method | converged answer |
//! |---|---|
//! | a closed form | the same closed form |
//! | the least overlap, exact or approximate | the common normal: the direction of EPA to 1e-10, which proves that no other overlap is less, then Newton's method until it stagnates; between points, segments and polyhedra with margins, the distance of these cores; for a curved body and one with edges or a margin, and for edges, EPA to 1e-12 |
//! | the thickness of the volume that bodies with faces share | the same, for two bodies with A and B exchanged, which shows any dependence on the order of coinciding faces |
//!
//! All other pairs are rotated in space first, which shows rounding errors where the run uses the same formulas. The answer does not
//! depend on the last normal, unlike that of a method in a run.

use super::common_normal::CommonNormal;
use super::cores::Cores;
use super::epa::Epa;
use super::half_space::AgainstHalfSpace;
use super::overlap::{OverlapWithSurface, thickness};
use super::smooth_common_normal::SmoothCommonNormal;
use super::sphere_sphere::SphereSphere;
use super::triangle_mesh::AgainstTriangleMesh;
use super::{ContactResolver, Outcome, Posed, Touch, Why};
use crate::math::{Mat3, Vec3};
use crate::shape::Kind;

/// Definition of the overlap that a method computes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Definition {
    /// Overlap along the direction of least overlap.
    #[default]
    LeastOverlap,
    /// Thickness of the volume that bodies with faces share.
    Thickness,
}

/// Method of the converged answer, by the kinds of the pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Converged {
    /// Two spheres.
    Spheres,
    /// Any body and a plane.
    Plane,
    /// Any body and a facet of a triangle mesh.
    Facet,
    /// Two ellipsoids or spheres.
    Ellipsoids,
    /// Other bodies without edges.
    Smooth,
    /// Two bodies of which one has a margin and neither is curved except by its margin. The distance of the cores is exact.
    Cores,
    /// A body with a margin and a curved one.
    CurvedCores,
    /// Bodies with edges.
    Edges,
    /// Volume shared by bodies with faces.
    Shared,
    /// Volume that a body with faces shares with the space behind a plane.
    SharedWithPlane,
    /// Volume that a body with faces shares with the space behind triangles.
    SharedWithSurface,
}

/// Tolerances of EPA for bodies with edges; the second one is used where the first is not reached.
const WITH_EDGES: [f64; 2] = [1e-12, 1e-8];
const SMOOTH: [f64; 2] = [1e-10, 1e-8];
/// A refined overlap may exceed that of EPA by this part of the size, which is rounding.
const ROUNDING: f64 = 1e-14;

impl Converged {
    /// Method for pairs of these kinds, the second of which may be a wall, and for this definition.
    pub fn of((a, b): (Kind, Kind), definition: Definition) -> Self {
        match (a, b, definition) {
            (_, Kind::HalfSpace, Definition::Thickness) => Self::SharedWithPlane,
            (_, Kind::TriangleMesh, Definition::Thickness) => Self::SharedWithSurface,
            (_, _, Definition::Thickness) => Self::Shared,
            (_, Kind::HalfSpace, _) => Self::Plane,
            (_, Kind::TriangleMesh, _) => Self::Facet,
            (Kind::Sphere, Kind::Sphere, _) => Self::Spheres,
            _ if a.is_ellipsoidal() && b.is_ellipsoidal() => Self::Ellipsoids,
            _ if a.is_smooth() && b.is_smooth() => Self::Smooth,
            _ if a.has_margin() || b.has_margin() => {
                let is_curved = |kind: Kind| !kind.has_margin() && !kind.has_faces();
                if is_curved(a) || is_curved(b) { Self::CurvedCores } else { Self::Cores }
            }
            _ => Self::Edges,
        }
    }

    /// Name in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Spheres | Self::Plane => "the closed form",
            Self::Ellipsoids | Self::Smooth => "the common normal",
            Self::Facet => "faces, edges, corners",
            Self::Cores => "the distance of the cores",
            Self::CurvedCores | Self::Edges => "EPA to 1e-12",
            Self::Shared => "the thickness, A and B exchanged",
            Self::SharedWithPlane | Self::SharedWithSurface => "the thickness",
        }
    }

    /// Resolves a pair. `r` points from the centre of A to the centre of B [m].
    pub fn touch(self, a: &Posed, b: &Posed, r: &Vec3) -> Outcome {
        match self {
            Self::Shared => exchanged(a, b, r),
            _ => turned(a, b, r, |a, b, r| self.resolve(a, b, r)),
        }
    }

    fn resolve(self, a: &Posed, b: &Posed, r: &Vec3) -> Outcome {
        match self {
            Self::Spheres => SphereSphere.touch(a, b, r, None),
            Self::Plane => AgainstHalfSpace.touch(a, b, r, None),
            Self::Facet => AgainstTriangleMesh::default().touch(a, b, r, None),
            Self::Shared | Self::SharedWithPlane => shared(a, b, r),
            Self::SharedWithSurface => OverlapWithSurface.touch(a, b, r, None),
            Self::Ellipsoids => by_epa(a, b, r, SMOOTH, |start| CommonNormal.touch(a, b, r, start)),
            Self::Smooth => {
                by_epa(a, b, r, SMOOTH, |start| SmoothCommonNormal.touch(a, b, r, start))
            }
            Self::Cores => match Cores.touch(a, b, r, None) {
                // The cores intersect.
                Outcome::Failed(why) => by_epa(a, b, r, WITH_EDGES, |_| Outcome::Failed(why)),
                outcome => outcome,
            },
            Self::CurvedCores => by_epa(a, b, r, WITH_EDGES, |start| Cores.touch(a, b, r, start)),
            Self::Edges => by_epa(a, b, r, WITH_EDGES, |_| Outcome::Failed(Why::NotSmooth)),
        }
    }
}

/// EPA, then `refine` from its normal. Where the bodies do not touch, `refine` gives the better distance.
fn by_epa(
    a: &Posed,
    b: &Posed,
    r: &Vec3,
    tolerances: [f64; 2],
    refine: impl Fn(Option<&Vec3>) -> Outcome,
) -> Outcome {
    let mut proved = Outcome::Failed(Why::NoConvergence);
    for tolerance in tolerances {
        proved = Epa::new(tolerance).touch(a, b, r, None);
        if !matches!(proved, Outcome::Failed(_)) {
            break;
        }
    }
    match proved {
        Outcome::Touching(found) => {
            let most = found.overlap + ROUNDING * a.bounding_radius().max(b.bounding_radius());
            match refine(Some(&found.normal)) {
                Outcome::Touching(touch) if touch.overlap <= most => Outcome::Touching(touch),
                _ => proved,
            }
        }
        Outcome::Apart(_) | Outcome::Failed(_) => match refine(None) {
            Outcome::Failed(_) => proved,
            refined => refined,
        },
    }
}

fn shared(a: &Posed, b: &Posed, r: &Vec3) -> Outcome {
    thickness(a, b, r).map_or(Outcome::Apart(0.0), |found| {
        Outcome::Touching(Touch {
            overlap: found.thickness,
            normal: found.normal,
            point: found.point,
        })
    })
}

/// Resolves the shared volume with A and B exchanged.
fn exchanged(a: &Posed, b: &Posed, r: &Vec3) -> Outcome {
    match shared(b, a, &-r) {
        Outcome::Touching(Touch { overlap, normal, point }) => {
            Outcome::Touching(Touch { overlap, normal: -normal, point: point + r })
        }
        outcome => outcome,
    }
}

/// Resolves a pair after a rotation in space and rotates the result back.
fn turned(
    a: &Posed,
    b: &Posed,
    r: &Vec3,
    touch: impl Fn(&Posed, &Posed, &Vec3) -> Outcome,
) -> Outcome {
    let turn = turn();
    let frames = [turn * a.frame, turn * b.frame];
    let (a, b) = (Posed { frame: &frames[0], ..*a }, Posed { frame: &frames[1], ..*b });
    match touch(&a, &b, &(turn * r)) {
        Outcome::Touching(Touch { overlap, normal, point }) => Outcome::Touching(Touch {
            overlap,
            normal: turn.tr_mul(&normal),
            point: turn.tr_mul(&point),
        }),
        outcome => outcome,
    }
}

/// A rotation that maps no axis to an axis.
fn turn() -> Mat3 {
    Mat3::new(2.0, -5.0, 14.0, 11.0, 10.0, 2.0, -10.0, 10.0, 5.0) / 15.0
}

#[cfg(test)]
mod tests {
    use super::{Converged, Definition, Outcome, Posed, turn};
    use crate::contact::{ContactResolver, ErodedGjk, Touch, orientations};
    use crate::math::{Mat3, Vec3};
    use crate::shape::{Ellipsoid, Kind, Shape, Superellipsoid};

    #[test]
    fn a_turn_is_a_rotation() {
        let turn = turn();
        assert!((turn.tr_mul(&turn) - Mat3::identity()).amax() < 1e-15);
        assert!((turn.determinant() - 1.0).abs() < 1e-15);
    }

    /// For pairs placed along their common normal, the converged answer is that normal and erosion differs from it.
    #[test]
    fn pairs_built_from_their_normal_have_it() {
        let semi_axes = Vec3::new(1.0, 0.5, 0.4);
        let ellipsoid = Shape::Ellipsoid(Ellipsoid { semi_axes });
        let blunt = Shape::Superellipsoid(Superellipsoid::new(semi_axes, [0.8, 0.8]));
        let mut eroded = [0.0_f64; 2];
        for (shape, within) in [(&ellipsoid, 1e-14), (&blunt, 1e-12)] {
            let converged = Converged::of((shape.kind(), shape.kind()), Definition::LeastOverlap);
            for i in 0..100 {
                let ([one, other], normal) = orientations(f64::from(i));
                let (a, b) = (Posed::new(shape, &one), Posed::new(shape, &other));
                let overlap = 1e-3;
                let r = a.support(&normal) - b.support(&-normal) - normal * overlap;
                let Outcome::Touching(touch) = converged.touch(&a, &b, &r) else {
                    panic!("pair {i} was not resolved")
                };
                // Superellipsoids may overlap less along another normal.
                assert!(touch.overlap <= overlap + within, "pair {i}: {:e}", touch.overlap);
                if shape.kind() == Kind::Ellipsoid {
                    let Touch { overlap: found, normal: along, .. } = touch;
                    assert!((found - overlap).abs() < within, "pair {i}: {found:e}");
                    assert!((along - normal).norm() < 1e-9, "pair {i}: {along}");
                    let outcome = ErodedGjk::default().touch(&a, &b, &r, None);
                    let Outcome::Touching(rough) = outcome else { panic!("pair {i}") };
                    eroded[0] = eroded[0].max((rough.overlap - found).abs());
                    eroded[1] = eroded[1].max((rough.normal - along).norm());
                }
            }
        }
        assert!(eroded[0] > 1e-5 && eroded[1] > 1e-2, "{eroded:?}");
    }
}
