//! Data of a wall in a snapshot, and how a wall continues from it.

use super::{Corners, Following, Mesh, Steady, Wall, most_moved};
use crate::math::{Quat, Vec3};
use crate::population::Library;
use crate::shape::{HalfSpace, Shape};
use serde::{Deserialize, Serialize};

/// Data of a wall in a snapshot, unless the wall is a plane through its reference point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Saved {
    point: Vec3,
    /// Reference point in the scene [m].
    #[serde(default)]
    of_scene: Option<Vec3>,
    orientation: Quat,
    angular_velocity: Vec3,
    /// Whether the scene rotated the wall.
    #[serde(default)]
    turns: Option<bool>,
    #[serde(default)]
    steady: Option<Steady>,
    /// State of the prescribed motion.
    #[serde(default)]
    following: Option<Following>,
    facets: Vec<HalfSpace>,
    /// Triangles of the wall, if it has any.
    #[serde(default)]
    mesh: Option<SavedMesh>,
}

/// Data of a wall's triangles in a snapshot, in addition to their corners.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct SavedMesh {
    checksum: u64,
    triangles: u64,
    /// [`Mesh::origin`] [m].
    #[serde(default)]
    origin: Vec3,
}

impl SavedMesh {
    fn of(mesh: &Mesh) -> Self {
        let triangles = mesh.surface.len() as u64;
        Self { checksum: mesh.surface.checksum(), triangles, origin: mesh.origin }
    }
}

impl Saved {
    /// Whether the wall has one plane.
    pub const fn is_one_plane(&self) -> bool {
        self.facets.len() == 1
    }

    /// Number of triangles.
    pub fn triangles(&self) -> usize {
        self.mesh.map_or(0, |mesh| mesh.triangles as usize)
    }

    /// A triangle in place, from its corners in the wall's axes [m].
    pub fn in_place(&self, corners: &[f64; 9]) -> [Vec3; 3] {
        [0, 3, 6].map(|k| {
            let corner = Vec3::new(corners[k], corners[k + 1], corners[k + 2]);
            self.point + self.orientation.transform_vector(&corner)
        })
    }

    /// Rotates a direction from the wall's axes to the world.
    pub fn turned(&self, direction: &Vec3) -> Vec3 {
        self.orientation.transform_vector(direction)
    }

    /// Velocity of a point of the wall in place [m/s], from that of its reference point [m/s].
    pub fn velocity_at(&self, place: &Vec3, of_reference: &Vec3) -> Vec3 {
        of_reference + self.angular_velocity.cross(&(place - self.point))
    }

    /// Planes in place, each as a point [m] and the unit normal towards the particles.
    pub fn planes(&self) -> impl Iterator<Item = (Vec3, Vec3)> {
        self.facets.iter().map(|facet| {
            let normal = self.orientation.transform_vector(&facet.normal);
            (self.point + normal * facet.offset, normal)
        })
    }
}

/// State of a stage that continues.
#[derive(Clone, Copy, Debug)]
pub struct StageSoFar {
    /// Length of its previous steps [s].
    pub dt: f64,
    /// Time since it began [s].
    pub time: f64,
}

impl Wall {
    /// Data for a snapshot in addition to [`Wall::surface`] and the velocity, if needed.
    pub fn saved(&self) -> Option<Saved> {
        let is_plain = self.course.is_none()
            && self.steady.is_none()
            && self.orientation == Quat::identity()
            && self.angular_velocity == Vec3::zeros()
            && self.facets.len() == 1
            && self.facets[0].geometry.offset == 0.0;
        (!is_plain).then(|| Saved {
            point: self.point,
            of_scene: Some(self.of_scene),
            orientation: self.orientation,
            angular_velocity: self.angular_velocity,
            turns: Some(self.may_turn()),
            steady: self.steady,
            following: self.following,
            facets: self.facets.iter().map(|facet| facet.geometry).collect(),
            mesh: self.mesh.as_ref().map(SavedMesh::of),
        })
    }

    /// Whether the wall has the same facets, in its axes, as a wall in a snapshot.
    ///
    /// The snapshot has a surface as [`Wall::surface`] gives it, and possibly more data.
    pub fn is_same(&self, (_, normal): &(Vec3, Vec3), saved: Option<&Saved>) -> bool {
        let mine = self.facets.iter().map(|facet| facet.geometry.normal);
        let triangles = |mesh: SavedMesh| (mesh.checksum, mesh.triangles);
        let of_saved = saved.and_then(|saved| saved.mesh).map(triangles);
        if self.mesh.as_ref().map(|mesh| triangles(SavedMesh::of(mesh))) != of_saved {
            return false;
        }
        match saved {
            Some(saved) => mine.eq(saved.facets.iter().map(|facet| facet.normal)),
            None => mine.eq([*normal]),
        }
    }

    /// Continues from the state in a snapshot of step `step`, with the velocities or the prescribed motion of the scene.
    ///
    /// On entry the wall stands as in the scene. `goes_on` means that steps are counted on and have the same length. A prescribed motion continues
    /// within a stage, which `before` describes. The wall keeps the reference point of the snapshot, except if it begins to rotate or its scene has
    /// another reference point than before; then it takes that of the scene.
    ///
    /// Returns the largest distance from the pose in the scene within `room` [m], 0 within rounding. Returns `None` if it is another wall, which
    /// stands as in the scene.
    pub fn go_on(
        &mut self,
        surface: &(Vec3, Vec3),
        saved: Option<&Saved>,
        goes_on: bool,
        (step, before): (u64, Option<StageSoFar>),
        library: &mut Library,
        room: &Corners,
    ) -> Option<f64> {
        let is_same = self.is_same(surface, saved);
        let (planes_were, about) = (self.in_place().collect::<Vec<_>>(), self.point);
        let corners_were: Vec<Vec3> = self.corners().collect();
        let (mut is_another, mut begins_to_turn) = (false, true);
        match saved {
            Some(saved) if is_same => {
                self.point = saved.point;
                self.orientation = saved.orientation;
                self.steady = saved.steady.filter(|_| goes_on);
                // A changed motion continues from the present pose, as does one with another length of the step.
                let leads_here = |following: &Following| {
                    let (course, stage) = self.course.as_ref().zip(before)?;
                    let pose = following.pose_at(course, following.time_at(step, stage.dt));
                    Some(pose.point == saved.point && pose.orientation == saved.orientation)
                };
                self.following = saved
                    .following
                    .filter(|following| goes_on && leads_here(following) == Some(true));
                for (facet, geometry) in self.facets.iter_mut().zip(&saved.facets) {
                    facet.geometry = *geometry;
                }
                let turned = saved.turns.unwrap_or(saved.angular_velocity != Vec3::zeros());
                begins_to_turn = !turned || saved.of_scene.is_some_and(|point| point != about);
                let turns_about_another = self.may_turn() && begins_to_turn;
                let (frame, shift) = (self.frame(), self.point - about);
                if let (Some(mesh), Some(of_saved)) = (&mut self.mesh, saved.mesh) {
                    // In one operation, not through the previous point: the continued run then has the same bits.
                    let moved =
                        if turns_about_another { frame.tr_mul(&shift) } else { Vec3::zeros() };
                    mesh.set_origin(of_saved.origin + moved);
                    if turns_about_another {
                        (self.point, self.steady, self.following) = (about, None, None);
                    }
                }
            }
            None if is_same && self.facets.len() == 1 => {
                self.facets[0].geometry.offset = 0.0;
                self.point = surface.0;
            }
            _ => is_another = true,
        }
        if self.may_turn() && begins_to_turn && self.mesh.is_none() {
            self.refer_to(about);
            self.following = None;
        }
        if self.course.is_some() && self.following.is_none() {
            let followed = saved.and_then(|saved| saved.following);
            // A motion that is new within a stage also keeps the time of the stage.
            let time = before.map_or(0.0, |stage| {
                followed.map_or(stage.time, |before| before.time_at(step, stage.dt))
            });
            self.following = Some(Following { since: step, time, from: self.pose() });
        }
        for facet in &self.facets {
            library.shapes[facet.shape.index()] = Shape::HalfSpace(facet.geometry);
        }
        if let Some(Mesh { surface, shape, .. }) = &self.mesh {
            library.shapes[shape.index()] = Shape::TriangleMesh(surface.clone());
        }
        self.note_listing();
        let ways = self.corners().zip(corners_were).map(|(now, was)| (now - was).norm());
        let off = ways.fold(most_moved(self.in_place().zip(planes_were), room), f64::max);
        let is_off = off > 1e-12 * about.amax().max(self.point.amax());
        (!is_another).then_some(if is_off { off } else { 0.0 })
    }
}
