//! What a snapshot holds of a wall, and how a wall goes on from it.

use super::{Corners, Following, Mesh, Steady, Wall, most_moved};
use crate::math::{Quat, Vec3};
use crate::population::Library;
use crate::shape::{HalfSpace, Shape};
use serde::{Deserialize, Serialize};

/// What a snapshot holds of a wall that is more than a plane through its reference point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Saved {
    point: Vec3,
    /// Where the scene has it [m].
    #[serde(default)]
    of_scene: Option<Vec3>,
    orientation: Quat,
    angular_velocity: Vec3,
    /// Did its scene turn it?
    #[serde(default)]
    turns: Option<bool>,
    #[serde(default)]
    steady: Option<Steady>,
    /// Of a course.
    #[serde(default)]
    following: Option<Following>,
    facets: Vec<HalfSpace>,
    /// Of its triangles, if it has any.
    #[serde(default)]
    mesh: Option<SavedMesh>,
}

/// What a snapshot holds of the triangles of a wall besides their corners.
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
    /// Is it the body of a wall of one plane?
    pub const fn is_one_plane(&self) -> bool {
        self.facets.len() == 1
    }

    /// How many triangles it has.
    pub fn triangles(&self) -> usize {
        self.mesh.map_or(0, |mesh| mesh.triangles as usize)
    }

    /// A triangle in place, from its corners in the axes of the wall [m].
    pub fn in_place(&self, corners: &[f64; 9]) -> [Vec3; 3] {
        [0, 3, 6].map(|k| {
            let corner = Vec3::new(corners[k], corners[k + 1], corners[k + 2]);
            self.point + self.orientation.transform_vector(&corner)
        })
    }

    /// A direction in the axes of the wall as it is in place.
    pub fn turned(&self, direction: &Vec3) -> Vec3 {
        self.orientation.transform_vector(direction)
    }

    /// How fast a point of it goes in place [m], of a wall whose reference point has a velocity [m/s].
    pub fn velocity_at(&self, place: &Vec3, of_reference: &Vec3) -> Vec3 {
        of_reference + self.angular_velocity.cross(&(place - self.point))
    }

    /// Its planes in place, each a point of it [m] and its unit normal, towards the particles.
    pub fn planes(&self) -> impl Iterator<Item = (Vec3, Vec3)> {
        self.facets.iter().map(|facet| {
            let normal = self.orientation.transform_vector(&facet.normal);
            (self.point + normal * facet.offset, normal)
        })
    }
}

/// Of a stage that goes on.
#[derive(Clone, Copy, Debug)]
pub struct StageSoFar {
    /// Its steps until now [s].
    pub dt: f64,
    /// The time since it began [s].
    pub time: f64,
}

impl Wall {
    /// What a snapshot must hold of it besides [`Wall::surface`] and its velocity, if anything.
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

    /// Has it, in its axes, the facets of the wall of which a snapshot has a surface, as [`Wall::surface`] gives it, and perhaps
    /// more?
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

    /// Goes on from where a snapshot of step `step` has it, with the velocities or the course of the scene, in which it stands now;
    /// `goes_on` if steps are counted on and are as long as before. A course goes on within a
    /// stage, of which `before` tells. If it begins to turn, or its scene has another reference point than before, that of
    /// the scene is its own from here; else it keeps the one that it has. Returns how far it stands from where the scene has it, at most within
    /// `room` [m], 0 for rounding; `None` if it is another wall, which stands where the scene says.
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
                // Another course than before goes on from where the wall stands, like one of other steps.
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
                    // At once, not by way of the point before: what goes on from here has the same bits.
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
            // One that is new within a stage keeps the time of the stage, too.
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
