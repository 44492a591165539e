//! The exchange file of the ON-DEM action: particles, shapes, materials, walls and contacts for other codes.
//!
//! It is VTKHDF `PolyData` with a group `/ONDEM`, as the exporter of the action for Yade writes it
//! (<https://github.com/ON-DEM/ON-DEM-WG3-FileFormat>). Quaternions are (x, y, z, w); normal forces are positive in traction.
//!
//! | place | content |
//! |---|---|
//! | `/VTKHDF/PointData` | state of each body, particles by id and then the pieces of unions; `radius` is that of the sphere of equal volume |
//! | `/ONDEM/Scene`, `/ONDEM/Materials/<id>` | time, gravity, domain; constants of the scene's materials |
//! | `/ONDEM/Bodies/<kind>` | parameters of the shape of each body |
//! | `/ONDEM/Bodies/Walls`, `Planes`, `Facets` | walls across an axis, other planes, triangles; all parts of a wall have its `body_id` |
//! | `/ONDEM/Interactions` | contacts; the normal and the shear force are those from body 1 on body 2 |
//!
//! The schema has spheres, boxes and polyhedra. Other kinds are written under their own names. A union is a clump: its own
//! `clump_id` is its `body_id`, and its pieces are bodies with that `clump_id`.
//!
//! Only this program writes `shape` and `scale` of each body, and `/ONDEM/Shapes/<shape>` with the name and the exact geometry.

mod bodies;
mod materials;

use super::PostError;
use super::check::{check_contacts, check_particles};
use crate::comm::alone::Alone;
use crate::ids::GlobalId;
use crate::math::{Mat3, Vec3};
use crate::output::SnapshotError;
use crate::output::hdf5::{Column, SnapshotFile};
use crate::output::header::{Header, WallRow};
use crate::output::report::version;
use crate::output::snapshot::{Reader, cells, points_of_cells, vtk_version};
use crate::output::tables::ContactTable;
use crate::shape::Shape;
use bodies::{Body, Parameter, bodies, parameters};
use materials::Materials;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::Path;

/// Room for the names and small datasets of a group [bytes].
const PAGE: usize = 1 << 14;

type Written = Result<(), SnapshotError>;

/// Data of the bodies.
pub const POINT_DATA: &str = "/VTKHDF/PointData";

/// Constants of a material in the file, with their keys in a scene.
const CONSTANTS: [(&str, &str); 7] = [
    ("density", "density"),
    ("young", "youngs_modulus"),
    ("poisson", "poisson_ratio"),
    ("normal_stiffness", "normal_stiffness"),
    ("shear_stiffness", "tangential_stiffness"),
    ("friction_coefficient", "friction"),
    ("restitution_coefficient", "restitution"),
];

fn flat(vectors: impl Iterator<Item = Vec3>) -> Vec<f64> {
    vectors.flat_map(|v| v.data.0[0]).collect()
}

/// A file that is written by one rank.
struct Out<'a>(SnapshotFile<'a>);

impl Out<'_> {
    fn reals<const N: usize>(&mut self, group: &str, columns: [Parameter; N]) -> Written {
        for (name, unit, width, values) in columns {
            let place = format!("{group}/{name}");
            self.0.rows(&Column { place: &place, width, unit }, &values)?;
        }
        Ok(())
    }

    /// Writes integers in 32 bits, as the layout has them, if they fit.
    fn integers(&mut self, group: &str, name: &str, values: impl Iterator<Item = i64>) -> Written {
        let column = Column { place: &format!("{group}/{name}"), width: 1, unit: "" };
        let values: Vec<i64> = values.collect();
        let narrow: Result<Vec<i32>, _> = values.iter().map(|&value| value.try_into()).collect();
        match narrow {
            Ok(narrow) => self.0.rows(&column, &narrow),
            Err(_) => self.0.rows(&column, &values),
        }
    }

    /// Creates a group with a row for each of these bodies and materials.
    fn owned(&mut self, group: &str, kind: &str, rows: &[(u64, usize)]) -> Written {
        self.0.group(group)?;
        self.0.numbers(group, "count", &[rows.len() as i64])?;
        self.0.text(group, "shape_type", kind)?;
        self.integers(group, "body_id", rows.iter().map(|(body, _)| *body as i64))?;
        self.integers(group, "material_id", rows.iter().map(|(_, material)| *material as i64))
    }

    fn points(&mut self, bodies: &[Body]) -> Written {
        self.0.group("/VTKHDF")?;
        vtk_version(&mut self.0)?;
        points_of_cells(&mut self.0, bodies.len(), 1)?;
        cells(&mut self.0, "Vertices", bodies.len(), 1)?;
        for category in ["Lines", "Polygons", "Strips"] {
            cells(&mut self.0, category, 0, 1)?;
        }
        self.0.group(POINT_DATA)?;
        let all = || bodies.iter();
        self.integers(POINT_DATA, "body_id", all().map(|body| body.id as i64))?;
        self.integers(POINT_DATA, "clump_id", all().map(Body::clump_id))?;
        self.integers(POINT_DATA, "material_id", all().map(|body| body.material as i64))?;
        self.integers(POINT_DATA, "shape", all().map(|body| i64::from(body.shape)))?;
        let position = flat(all().map(|body| body.position));
        self.reals("/VTKHDF", [("Points", "m", 3, position.clone())])?;
        let inertia = all().flat_map(|body| Mat3::from_diagonal(&body.inertia).data.0);
        let columns = [
            ("position", "m", 3, position),
            ("velocity", "m/s", 3, flat(all().map(|body| body.velocity))),
            ("angular_velocity", "rad/s", 3, flat(all().map(|body| body.spin))),
            ("orientation", "1", 4, all().flat_map(|body| body.turn.coords.data.0[0]).collect()),
            ("inertia", "kg m^2", 9, inertia.flatten().collect()),
            ("mass", "kg", 1, all().map(|body| body.mass).collect()),
            ("volume", "m^3", 1, all().map(Body::volume).collect()),
            ("radius", "m", 1, all().map(Body::radius).collect()),
            ("scale", "1", 1, all().map(|body| body.scale).collect()),
        ];
        self.reals(POINT_DATA, columns)
    }

    fn scene(&mut self, header: &Header) -> Written {
        let group = "/ONDEM/Scene";
        self.0.group(group)?;
        self.0.numbers(group, "time", &[header.time])?;
        self.0.numbers(group, "timestep", &[header.dt])?;
        let (low, high) = header.cell.corners();
        self.0.numbers(group, "low", low.as_slice())?;
        self.0.numbers(group, "high", high.as_slice())?;
        self.0.numbers(group, "periodic", &header.cell.periodic().map(u8::from))?;
        self.0.array("/ONDEM/Scene/gravity", "m/s^2", &[3], header.gravity.as_slice())?;
        self.0.words("/ONDEM/Scene/units", &[3], &["second", "meter", "kilogram"])
    }

    fn materials(&mut self, materials: &Materials) -> Written {
        self.0.group("/ONDEM/Materials")?;
        for (id, table) in materials.all.iter().enumerate() {
            let group = format!("/ONDEM/Materials/{id}");
            self.0.group(&group)?;
            self.0.array(&format!("{group}/id"), "", &[], &[id as i32])?;
            let label = table.get("name").and_then(toml::Value::as_str).unwrap_or_default();
            self.0.words(&format!("{group}/label"), &[], &[label])?;
            let number = |key: &str| {
                let value = table.get(key)?;
                value.as_float().or_else(|| value.as_integer().map(|number| number as f64))
            };
            let friction = number("friction").unwrap_or_default();
            let angle = ("friction_angle_rad", Some(libm::atan(friction)));
            let constants = CONSTANTS.map(|(name, key)| match key {
                "friction" => (name, Some(friction)),
                "tangential_stiffness" => (name, number(key).or(number("normal_stiffness"))),
                _ => (name, number(key)),
            });
            for (name, value) in constants.into_iter().chain([angle]) {
                if let Some(value) = value {
                    self.0.array(&format!("{group}/{name}"), "", &[], &[value])?;
                }
            }
        }
        Ok(())
    }

    /// Writes the parameters of the bodies by kind.
    fn bodies(&mut self, bodies: &[Body]) -> Written {
        let mut by_kind: BTreeMap<&str, Vec<&Body>> = BTreeMap::new();
        for body in bodies {
            by_kind.entry(parameters(body.geometry, 1.0).0).or_default().push(body);
        }
        self.0.group("/ONDEM/Bodies")?;
        for (kind, bodies) in by_kind {
            let group = format!("/ONDEM/Bodies/{kind}");
            let owners: Vec<_> = bodies.iter().map(|body| (body.id, body.material)).collect();
            let name = bodies[0].geometry.kind().name();
            self.owned(&group, if kind == "Clump" { "clump" } else { name }, &owners)?;
            let each = |body: &&Body| parameters(body.geometry, body.scale).1;
            for (k, (name, unit, width, _)) in each(&bodies[0]).into_iter().enumerate() {
                let (mut all, mut ends) = (Vec::new(), vec![0]);
                for body in &bodies {
                    all.extend(&each(body)[k].3);
                    ends.push((all.len() / width) as i64);
                }
                self.reals(&group, [(name, unit, width, all)])?;
                if name == "vertices" {
                    self.integers(&group, "vertex_offsets", ends.into_iter())?;
                }
            }
        }
        Ok(())
    }

    /// Writes names and exact geometries.
    fn shapes(&mut self, header: &Header, geometries: &[String]) -> Written {
        self.0.group("/ONDEM/Shapes")?;
        for (k, (shape, geometry)) in header.shapes.iter().zip(geometries).enumerate() {
            let group = format!("/ONDEM/Shapes/{k}");
            self.0.group(&group)?;
            self.0.words(&format!("{group}/label"), &[], &[&shape.name])?;
            self.0.words(&format!("{group}/geometry"), &[], &[geometry])?;
        }
        Ok(())
    }

    /// Writes the walls; that of index `k` is body `first + k`.
    fn walls(&mut self, header: &Header, materials: &Materials, first: u64) -> Written {
        let owner = |wall: &usize| (first + *wall as u64, materials.of_walls[*wall]);
        let facets = header.triangles_in_place();
        let planes = header.walls.iter().map(WallRow::planes).enumerate();
        let has_triangles =
            |wall: usize| header.walls[wall].body.as_ref().is_some_and(|body| body.triangles() > 0);
        let planes = planes.filter(|(wall, _)| !has_triangles(*wall));
        let planes = planes.flat_map(|(k, planes)| planes.into_iter().map(move |p| (k, p.0, p.1)));
        let (across, others): (Vec<_>, Vec<_>) =
            planes.partition(|(.., normal)| normal.amax() == 1.0);
        for (group, kind, planes) in [("Walls", "wall", across), ("Planes", "plane", others)] {
            if planes.is_empty() {
                continue;
            }
            let group = &format!("/ONDEM/Bodies/{group}");
            let owners: Vec<_> = planes.iter().map(|(wall, ..)| owner(wall)).collect();
            self.owned(group, kind, &owners)?;
            let normals = || planes.iter().map(|(.., normal)| *normal);
            let points = flat(planes.iter().map(|(_, point, _)| *point));
            self.reals(group, [("position", "m", 3, points), ("normal", "1", 3, flat(normals()))])?;
            if kind == "wall" {
                self.integers(group, "axis", normals().map(|n| n.iamax() as i64))?;
                self.integers(group, "sense", normals().map(|n| n[n.iamax()] as i64))?;
            }
        }
        if facets.is_empty() {
            return Ok(());
        }
        let group = "/ONDEM/Bodies/Facets";
        let owners: Vec<_> = facets.iter().map(|(wall, _)| owner(wall)).collect();
        self.owned(group, "facet", &owners)?;
        let of_each = |of: fn(&[Vec3; 3]) -> Vec3| flat(facets.iter().map(|(_, facet)| of(facet)));
        let normals = of_each(|[a, b, c]| (b - a).cross(&(c - a)).normalize());
        let middles = of_each(|[a, b, c]| (a + b + c) / 3.0);
        self.reals(group, [("position", "m", 3, middles), ("normal", "1", 3, normals)])?;
        let (place, shape) = (format!("{group}/vertices"), [facets.len(), 3, 3]);
        self.0.array(&place, "m", &shape, &flat(facets.iter().flat_map(|(_, facet)| *facet)))
    }

    fn interactions(&mut self, contacts: &ContactTable, first_wall: u64) -> Written {
        let group = "/ONDEM/Interactions";
        self.0.group(group)?;
        self.0.numbers(group, "count", &[contacts.a.len() as i64])?;
        let body = |id: &GlobalId| id.wall_index().map_or(id.0, |wall| first_wall + wall as u64);
        self.integers(group, "id1", contacts.a.iter().map(|id| body(id) as i64))?;
        self.integers(group, "id2", contacts.b.iter().map(|id| body(id) as i64))?;
        self.integers(group, "virtual", contacts.a.iter().map(|_| 0))?;
        let vectors = |of: &[Vec3]| flat(of.iter().copied());
        let columns = [
            ("normal", "1", 3, vectors(&contacts.normal)),
            ("normal_force", "N", 1, contacts.normal_force.iter().map(|force| -force).collect()),
            ("shear_force", "N", 3, vectors(&contacts.shear_force)),
            ("contact_point", "m", 3, vectors(&contacts.point)),
            ("overlap", "m", 1, contacts.overlap.clone()),
        ];
        self.reals(group, columns)
    }
}

/// Writes the file of a snapshot.
///
/// # Errors
/// If a file of the snapshot cannot be read or the new one cannot be written.
pub fn write(path: &Path, reader: &Reader) -> Result<(), PostError> {
    let header = reader.header();
    let particles = reader.particles(0..reader.particle_count())?;
    check_particles(header, &particles)?;
    let contacts = reader.contacts(0..reader.contact_count()?)?;
    check_contacts(&contacts)?;
    let shapes: Vec<_> = header.shapes.iter().map(|shape| shape.body()).collect();
    let materials = Materials::of(header);
    let bodies = bodies(header, &particles, &shapes, &materials);
    let first_wall = header.next_id.max(bodies.last().map_or(0, |body| body.id + 1));

    // A kind that a program defines has no text.
    let text = |shape: &Cow<Shape>| serde_json::to_string(&**shape).unwrap_or_default();
    let geometries: Vec<String> = shapes.iter().map(text).collect();

    let numbers = |body: &Body| {
        let own = parameters(body.geometry, 1.0).1;
        48 + own.iter().map(|(.., values)| values.len()).sum::<usize>()
    };
    let of_bodies: usize = bodies.iter().map(numbers).sum();
    let others = contacts.a.len() + header.triangles.len() + header.walls.len();
    let texts: usize = geometries.iter().map(|text| PAGE + 2 * text.len()).sum();
    let room = 8 * (of_bodies + 20 * others) + texts + PAGE * materials.all.len();
    let mut alone = Alone::default();
    let mut out = Out(SnapshotFile::create(path, room as u64, &mut alone)?);
    out.0.text("/", "file_format", "ON-DEM VTKHDF")?;
    out.0.text("/", "file_format_version", "0.1-draft")?;
    out.0.text("/", "source_code", &format!("dem-mpi {}", version()))?;
    out.points(&bodies)?;
    out.0.group("/ONDEM")?;
    out.scene(header)?;
    out.materials(&materials)?;
    out.bodies(&bodies)?;
    out.shapes(header, &geometries)?;
    out.walls(header, &materials, first_wall)?;
    out.interactions(&contacts, first_wall)?;
    Ok(out.0.close()?)
}
