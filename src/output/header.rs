//! What a snapshot says once: when, where, with what walls and shapes.

use crate::cell::Cell;
use crate::drive::SavedState;
use crate::math::Vec3;
use crate::measure::Departed;
use crate::shape::{Ellipsoid, Shape};
use crate::walls::Saved;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// What a snapshot says once: when, where, with what walls and shapes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// Steps since the very first stage began.
    pub step: u64,
    /// Time since then [s].
    pub time: f64,
    /// Time step [s].
    pub dt: f64,
    /// The step at which this stage began, and the time then [s].
    pub stage_begin: (u64, f64),
    /// By how much steps of another length before make this stage longer than its steps are now [s].
    pub stage_shift: f64,
    /// The id that the next new particle gets.
    pub next_id: u64,
    /// What particles that were taken out have left behind in the balance of energies [J].
    pub departed: Departed,
    /// The largest kinetic and elastic energy together that the stage has had at steps of its schedule [J].
    pub most_moving: f64,
    /// The scene's `[stop]`, if it holds at this moment and the stage is over; else empty.
    pub stop: String,
    /// The domain, and how it repeats.
    pub cell: Cell,
    /// Gravity [m/s²].
    pub gravity: Vec3,
    /// The walls, in the order of their ids.
    pub walls: Vec<WallRow>,
    /// The triangles of all walls that have any, one wall after the other: the corners of each, in the axes of its wall [m].
    pub triangles: Vec<[f64; 9]>,
    /// What drives have saved, by name.
    pub drives: Vec<SavedState>,
    /// The shapes, in the order of their ids.
    pub shapes: Vec<ShapeRow>,
    /// The scene as it ran, as TOML.
    pub scene: String,
}

impl Header {
    /// The title of the scene, if it has one.
    pub fn title(&self) -> Option<String> {
        let scene: toml::Table = self.scene.parse().ok()?;
        let title = scene.get("title")?.as_str()?.trim();
        (!title.is_empty()).then(|| title.to_owned())
    }

    /// The triangles of each wall in place [m].
    pub fn triangles_in_place(&self) -> Vec<(usize, [Vec3; 3])> {
        let mut rest = self.triangles.iter();
        let mut all = Vec::new();
        for (k, body) in
            self.walls.iter().enumerate().filter_map(|(k, w)| Some((k, w.body.as_ref()?)))
        {
            let own = rest.by_ref().take(body.triangles());
            all.extend(own.map(|corners| (k, body.in_place(corners))));
        }
        all
    }

    /// The walls of one plane, which may end a packing.
    pub fn planes(&self) -> impl Iterator<Item = &WallRow> {
        self.walls.iter().filter(|wall| wall.is_one_plane())
    }
}

/// One wall.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WallRow {
    /// Its name in the scene.
    pub name: String,
    /// A point of its first plane [m].
    pub point: Vec3,
    /// Unit normal there, towards the particles.
    pub normal: Vec3,
    /// Velocity of its reference point [m/s].
    pub velocity: Vec3,
    /// Force of the particles on it [N].
    pub force: Vec3,
    /// What else there is to it, if it turns, has turned or has several planes.
    pub body: Option<Saved>,
}

impl WallRow {
    /// Its planes in place, each a point of it [m] and its unit normal, towards the particles.
    pub fn planes(&self) -> Vec<(Vec3, Vec3)> {
        match &self.body {
            Some(body) => body.planes().collect(),
            None => vec![(self.point, self.normal)],
        }
    }

    /// How fast a point of it goes in place [m], in m/s.
    pub fn velocity_at(&self, place: &Vec3) -> Vec3 {
        let turning = |body: &Saved| body.velocity_at(place, &self.velocity);
        self.body.as_ref().map_or(self.velocity, turning)
    }

    /// Is it one plane, and not triangles?
    pub fn is_one_plane(&self) -> bool {
        self.body.as_ref().is_none_or(Saved::is_one_plane)
    }
}

/// One shape of the scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ShapeRow {
    /// Its name in the scene.
    pub name: String,
    /// Name of its kind, as in the scene file.
    pub kind: String,
    /// Semi-axes of an ellipsoid; of other kinds half the lengths, along the principal axes, of the
    /// box about the centre of mass [m].
    pub semi_axes: Vec3,
    /// Volume [m³].
    pub volume: f64,
    /// Mass [kg].
    pub mass: f64,
    /// Principal moments of inertia [kg m²].
    pub inertia: Vec3,
    /// The least and the largest scale for which the stage has made room: lengths of a particle over those of its shape [-].
    /// Such particles need not be there.
    pub scales: [f64; 2],
    /// How many such particles the stage can have at most; infinite if nothing is known.
    pub most: f64,
    /// The body itself. `None` for kind `other`: a program's own type cannot be stored.
    pub geometry: Option<Shape>,
}

impl ShapeRow {
    /// The body; of one that is not known, the ellipsoid in the box around it.
    pub fn body(&self) -> Cow<'_, Shape> {
        match &self.geometry {
            Some(shape) => Cow::Borrowed(shape),
            None => Cow::Owned(Shape::Ellipsoid(Ellipsoid { semi_axes: self.semi_axes })),
        }
    }
}
