//! Data that a snapshot has once: step, time, domain, walls, drives and shapes.

use crate::cell::Cell;
use crate::drive::SavedState;
use crate::math::Vec3;
use crate::measure::Departed;
use crate::shape::{Ellipsoid, Shape};
use crate::walls::Saved;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// Data that a snapshot has once: step, time, domain, walls, drives and shapes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// Number of steps since the very first stage began.
    pub step: u64,
    /// Time since the very first stage began [s].
    pub time: f64,
    /// Time step [s].
    pub dt: f64,
    /// Step and time at which this stage began [-, s].
    pub stage_begin: (u64, f64),
    /// Time offset from earlier parts of the stage that used another time step [s].
    pub stage_shift: f64,
    /// Id of the next new particle.
    pub next_id: u64,
    /// Contribution of removed particles to the energy balance [J].
    pub departed: Departed,
    /// Largest sum of kinetic and elastic energy at the scheduled steps of the stage [J].
    pub most_moving: f64,
    /// The scene's `[stop]`, if its conditions hold now and the stage is over; otherwise empty.
    pub stop: String,
    /// Domain, with its periodicity.
    pub cell: Cell,
    /// Gravity [m/s²].
    pub gravity: Vec3,
    /// The walls, in the order of their ids.
    pub walls: Vec<WallRow>,
    /// Triangles of all walls, one wall after the other: the corners of each, in the axes of its wall [m].
    pub triangles: Vec<[f64; 9]>,
    /// Saved states of drives, by name.
    pub drives: Vec<SavedState>,
    /// The shapes, in the order of their ids.
    pub shapes: Vec<ShapeRow>,
    /// Scene as it ran, as TOML.
    pub scene: String,
}

impl Header {
    /// Title of the scene, if it has one.
    pub fn title(&self) -> Option<String> {
        let scene: toml::Table = self.scene.parse().ok()?;
        let title = scene.get("title")?.as_str()?.trim();
        (!title.is_empty()).then(|| title.to_owned())
    }

    /// Index of the wall and corners in place [m] for every triangle.
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

    /// Walls of one plane, which can bound a packing.
    pub fn planes(&self) -> impl Iterator<Item = &WallRow> {
        self.walls.iter().filter(|wall| wall.is_one_plane())
    }
}

/// State of one wall.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WallRow {
    /// Name in the scene.
    pub name: String,
    /// A point of its first plane [m].
    pub point: Vec3,
    /// Unit normal at that point, towards the particles.
    pub normal: Vec3,
    /// Velocity of its reference point [m/s].
    pub velocity: Vec3,
    /// Force of the particles on it [N].
    pub force: Vec3,
    /// Further state of a wall that turns, has turned or has several planes.
    pub body: Option<Saved>,
}

impl WallRow {
    /// Planes of the wall in place: a point [m] and the unit normal of each, towards the particles.
    pub fn planes(&self) -> Vec<(Vec3, Vec3)> {
        match &self.body {
            Some(body) => body.planes().collect(),
            None => vec![(self.point, self.normal)],
        }
    }

    /// Velocity of the wall at a point of space [m] [m/s].
    pub fn velocity_at(&self, place: &Vec3) -> Vec3 {
        let turning = |body: &Saved| body.velocity_at(place, &self.velocity);
        self.body.as_ref().map_or(self.velocity, turning)
    }

    /// True if the wall is one plane, without triangles.
    pub fn is_one_plane(&self) -> bool {
        self.body.as_ref().is_none_or(Saved::is_one_plane)
    }
}

/// Data of one shape of the scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ShapeRow {
    /// Name in the scene.
    pub name: String,
    /// Name of the kind, as in the scene file.
    pub kind: String,
    /// Semi-axes of an ellipsoid [m]. For other kinds, half the lengths of the box about the centre of mass, along the
    /// principal axes.
    pub semi_axes: Vec3,
    /// Volume [m³].
    pub volume: f64,
    /// Mass [kg].
    pub mass: f64,
    /// Principal moments of inertia [kg m²].
    pub inertia: Vec3,
    /// Smallest and largest scale for which the stage has made room: lengths of a particle over those of its shape [-]. Such
    /// particles need not exist.
    pub scales: [f64; 2],
    /// Largest possible number of particles of the shape in the stage; infinite if unknown.
    pub most: f64,
    /// Geometry. `None` for kind `other`: a type defined by a program cannot be stored.
    pub geometry: Option<Shape>,
}

impl ShapeRow {
    /// Geometry of the shape; if it is unknown, the ellipsoid with its semi-axes.
    pub fn body(&self) -> Cow<'_, Shape> {
        match &self.geometry {
            Some(shape) => Cow::Borrowed(shape),
            None => Cow::Owned(Shape::Ellipsoid(Ellipsoid { semi_axes: self.semi_axes })),
        }
    }
}
