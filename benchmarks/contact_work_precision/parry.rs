//! `parry3d-f64` through its own interface: polyhedra as its convex polyhedra, other shapes by support
//! points.

use dem_mpi::contact::{ContactResolver, ErodedGjk, Outcome, Posed, Touch, Why, touch_along};
use dem_mpi::math::{Mat3, Vec3};
use dem_mpi::shape::{Core, Shape};
use parry3d_f64::glamx::DQuat;
use parry3d_f64::math::{Pose, Vector};
use parry3d_f64::query::details::contact_support_map_support_map_with_params;
use parry3d_f64::query::gjk::{self, CsoPoint, GJKResult, VoronoiSimplex};
use parry3d_f64::shape::{ConvexPolyhedron, SupportMap};

/// GJK and EPA of parry, with its constant tolerances.
pub(crate) struct Parry {
    polyhedron: Option<ConvexPolyhedron>,
}

/// Erosion as in [`ErodedGjk`], but with parry's GJK.
pub(crate) struct ParryErosion {
    shape: Parry,
    settings: ErodedGjk,
}

/// A shape in its own frame.
struct Local<'a>(&'a Shape);

impl SupportMap for Local<'_> {
    fn local_support_point(&self, direction: Vector) -> Vector {
        theirs(&self.0.support(&ours(direction)))
    }
}

/// A shape scaled about its centre.
struct Scaled<'a, S>(&'a S, f64);

impl<S: SupportMap> SupportMap for Scaled<'_, S> {
    fn local_support_point(&self, direction: Vector) -> Vector {
        self.0.local_support_point(direction) * self.1
    }
}

/// Description of a pair for parry.
struct Question {
    turn_a: DQuat,
    /// Pose of B relative to A.
    pose: Pose,
    warm: Option<Vector>,
}

impl Question {
    fn of(a: &Posed, b: &Posed, r: &Vec3, warm: Option<&Vec3>) -> Self {
        let (turn_a, turn_b) = (quaternion(a.frame), quaternion(b.frame));
        let back = turn_a.inverse();
        let pose = Pose::from_parts(back * theirs(r), back * turn_b);
        Self { turn_a, pose, warm: warm.map(|normal| back * theirs(normal)) }
    }

    fn contact(&self, a: &impl SupportMap, b: &impl SupportMap) -> Outcome {
        let mut simplex = VoronoiSimplex::new();
        let found = contact_support_map_support_map_with_params(
            &self.pose,
            a,
            b,
            0.0,
            &mut simplex,
            self.warm,
        );
        match found {
            GJKResult::ClosestPoints(on_a, on_b, normal) => {
                let overlap = (on_a - on_b).dot(normal);
                if overlap <= 0.0 {
                    return Outcome::Apart(0.0);
                }
                Outcome::Touching(Touch {
                    overlap,
                    normal: ours(self.turn_a * normal),
                    point: ours(self.turn_a * (on_a + on_b)) * 0.5,
                })
            }
            // A failure of EPA is indistinguishable from this.
            _ => Outcome::Apart(0.0),
        }
    }

    /// Distance by GJK alone.
    fn distance(&self, a: &impl SupportMap, b: &impl SupportMap, most: f64) -> GJKResult {
        let start = self.warm.unwrap_or_else(|| self.pose.translation.normalize());
        let mut simplex = VoronoiSimplex::new();
        simplex.reset(CsoPoint::from_shapes(&self.pose, a, b, start));
        gjk::closest_points(&self.pose, a, b, most, true, &mut simplex)
    }
}

impl Parry {
    pub(crate) fn of(shape: &Shape) -> Self {
        let Core::Hull(hull) = shape.core() else { return Self { polyhedron: None } };
        let vertices = hull.vertices().iter().map(theirs).collect();
        let triangles: Vec<_> = hull.triangles().iter().map(|t| t.corners).collect();
        let polyhedron = ConvexPolyhedron::from_convex_mesh(vertices, &triangles);
        Self { polyhedron: Some(polyhedron.expect("a convex hull is a convex mesh")) }
    }
}

impl ContactResolver for Parry {
    fn name(&self) -> &'static str {
        "parry"
    }

    fn touch(&self, a: &Posed, b: &Posed, r: &Vec3, warm: Option<&Vec3>) -> Outcome {
        let question = Question::of(a, b, r, warm);
        match &self.polyhedron {
            Some(polyhedron) => question.contact(polyhedron, polyhedron),
            None => question.contact(&Local(a.shape), &Local(b.shape)),
        }
    }
}

impl ParryErosion {
    pub(crate) fn of(shape: &Shape) -> Self {
        Self { shape: Parry::of(shape), settings: ErodedGjk::default() }
    }
}

impl ContactResolver for ParryErosion {
    fn name(&self) -> &'static str {
        "parry erosion"
    }

    fn touch(&self, a: &Posed, b: &Posed, r: &Vec3, warm: Option<&Vec3>) -> Outcome {
        let question = Question::of(a, b, r, warm);
        let reach = a.shape.bounding_radius() + b.shape.bounding_radius();
        let mut ratio = self.settings.ratio;
        while ratio < 1.0 {
            let (left, most) = (1.0 - ratio, ratio * reach);
            let found = if let Some(p) = &self.shape.polyhedron {
                question.distance(&Scaled(p, left), &Scaled(p, left), most)
            } else {
                let (a, b) = (Local(a.shape), Local(b.shape));
                question.distance(&Scaled(&a, left), &Scaled(&b, left), most)
            };
            match found {
                GJKResult::ClosestPoints(_, _, normal) => {
                    let touch = touch_along(a, b, r, &ours(question.turn_a * normal));
                    let touches = touch.overlap > 0.0;
                    return if touches { Outcome::Touching(touch) } else { Outcome::Apart(0.0) };
                }
                GJKResult::Intersection => ratio += self.settings.increment,
                _ => return Outcome::Apart(0.0),
            }
        }
        Outcome::Failed(Why::TooDeep)
    }
}

fn quaternion(frame: &Mat3) -> DQuat {
    let [x, y, z] = [0, 1, 2].map(|k| theirs(&frame.column(k).into_owned()));
    DQuat::from_rotation_axes(x, y, z)
}

fn theirs(v: &Vec3) -> Vector {
    Vector::new(v.x, v.y, v.z)
}

fn ours(v: Vector) -> Vec3 {
    Vec3::new(v.x, v.y, v.z)
}
