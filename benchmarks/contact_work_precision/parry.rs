//! `parry3d-f64`, asked through its own interface for shapes that it does not know.

use dem_mpi::contact::{ContactResolver, Outcome, Posed, Touch};
use dem_mpi::math::{Mat3, Vec3};
use dem_mpi::shape::Shape;
use parry3d_f64::glamx::DQuat;
use parry3d_f64::math::{Pose, Vector};
use parry3d_f64::query::details::contact_support_map_support_map_with_params;
use parry3d_f64::query::gjk::{GJKResult, VoronoiSimplex};
use parry3d_f64::shape::SupportMap;

/// GJK and EPA of parry. Its tolerances are constants.
pub(crate) struct Parry;

/// A shape in its own frame.
struct Local<'a>(&'a Shape);

impl SupportMap for Local<'_> {
    fn local_support_point(&self, direction: Vector) -> Vector {
        theirs(&self.0.support(&ours(direction)))
    }
}

impl ContactResolver for Parry {
    fn name(&self) -> &'static str {
        "parry"
    }

    fn touch(&self, a: &Posed, b: &Posed, r: &Vec3, warm: Option<&Vec3>) -> Outcome {
        let (turn_a, turn_b) = (quaternion(a.frame), quaternion(b.frame));
        let back = turn_a.inverse();
        let pose = Pose::from_parts(back * theirs(r), back * turn_b);
        let mut simplex = VoronoiSimplex::new();
        let found = contact_support_map_support_map_with_params(
            &pose,
            &Local(a.shape),
            &Local(b.shape),
            0.0,
            &mut simplex,
            warm.map(|normal| back * theirs(normal)),
        );
        match found {
            GJKResult::ClosestPoints(on_a, on_b, normal) => {
                let overlap = (on_a - on_b).dot(normal);
                if overlap <= 0.0 {
                    return Outcome::Apart(0.0);
                }
                Outcome::Touching(Touch {
                    overlap,
                    normal: ours(turn_a * normal),
                    point: ours(turn_a * (on_a + on_b)) * 0.5,
                })
            }
            // A failure of EPA looks the same.
            _ => Outcome::Apart(0.0),
        }
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
