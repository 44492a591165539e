//! Snapshots as VTP: surfaces of particles and walls, and rows as points and lines.

use super::surface::{Detail, Surface};
use super::vtp::{Array, Cells, NORMALS, PolyData};
use super::{PostError, check, pieces, region::Turned};
use crate::drive::ledger::{Worn, worn};
use crate::math::Vec3;
use crate::output::header::WallRow;
use crate::output::snapshot::{self, Reader};
use crate::output::tables::{CONTACT_COLUMNS, ContactTable, PARTICLE_COLUMNS};

/// Surfaces of all particles. Each point has `id`, `shape`, `velocity` [m/s] and `coordination` of its particle.
///
/// # Errors
/// If a file cannot be read or is invalid.
pub fn grains(reader: &Reader, detail: Detail) -> Result<PolyData, PostError> {
    let header = reader.header();
    let surfaces: Vec<Surface> =
        header.shapes.iter().map(|row| Surface::of(&row.body(), detail)).collect();
    let (mut points, mut normals): (Vec<[f32; 3]>, Vec<[f32; 3]>) = (Vec::new(), Vec::new());
    let (mut members, mut ends) = (Vec::new(), Vec::new());
    let (mut ids, mut shapes): (Vec<i64>, Vec<i32>) = (Vec::new(), Vec::new());
    let (mut velocities, mut contacts): (Vec<[f32; 3]>, Vec<i32>) = (Vec::new(), Vec::new());
    for rows in pieces(reader.particle_count()) {
        let particles = reader.particles(rows)?;
        check::check_particles(header, &particles)?;
        for (row, centre) in particles.position.iter().enumerate() {
            let (shape, body) = (particles.shape[row], Turned::of(header, &particles, row));
            let surface = &surfaces[shape.index()];
            let (first, before) = (points.len() as i64, members.len() as i64);
            let size = particles.scale_of(row);
            let place = |point: &Vec3| single(&(centre + body.frame * (point * size)));
            points.extend(surface.points.iter().map(place));
            normals.extend(surface.normals.iter().map(|normal| single(&(body.frame * normal))));
            members.extend(surface.members.iter().map(|&member| first + i64::from(member)));
            ends.extend(surface.ends.iter().map(|&end| before + i64::from(end)));
            let count = surface.points.len();
            ids.extend(std::iter::repeat_n(particles.id[row].to_file(), count));
            shapes.extend(std::iter::repeat_n(i32::from(shape.0), count));
            velocities.extend(std::iter::repeat_n(single(&particles.velocity[row]), count));
            contacts.extend(std::iter::repeat_n(particles.coordination[row], count));
        }
    }
    Ok(PolyData {
        time: header.time,
        point_count: points.len(),
        points: Array::new("Points", 3, points.as_flattened()),
        cells: Cells::Polygons,
        members,
        ends,
        of_points: vec![
            Array::new(NORMALS, 3, normals.as_flattened()),
            Array::new("id", 1, &ids),
            Array::new("shape", 1, &shapes),
            Array::new("velocity", 3, velocities.as_flattened()),
            Array::new("coordination", 1, &contacts),
        ],
        of_cells: Vec::new(),
    })
}

/// The vector in single precision, enough for pictures with many points.
fn single(vector: &Vec3) -> [f32; 3] {
    [vector.x as f32, vector.y as f32, vector.z as f32]
}

/// Triangles and planes of walls, cut to the domain and to the space that other walls leave free. Each polygon has `wall`, the
/// index in the snapshot; `velocity` of its middle, the mean of its corners [m/s]; and `wall_force` on the whole wall [N].
///
/// Triangles of walls with `wear` also have energies over their area since the stage began: `lost` and `rubbed` [J/m²]. They have
/// means over that time [Pa]: `mean_traction`, the force over the area at the present place of the triangle, and `mean_pressure`,
/// its normal part. For other polygons of such a snapshot these values are not numbers.
///
/// # Errors
/// If a file cannot be read or is invalid.
pub fn walls(reader: &Reader) -> Result<PolyData, PostError> {
    let header = reader.header();
    let room = room(reader)?;
    let planes: Vec<(usize, Vec3, Vec3)> = header
        .walls
        .iter()
        .enumerate()
        .flat_map(|(k, wall)| wall.planes().into_iter().map(move |(p, normal)| (k, p, normal)))
        .collect();
    let (mut points, mut members, mut ends) = (Vec::new(), Vec::new(), Vec::new());
    let (mut numbers, mut velocities, mut forces) = (Vec::new(), Vec::new(), Vec::new());
    let worn = worn(&header.drives)?;
    let mut wear: Vec<Wear> = Vec::new();
    let mut add = |wall: usize, corners: &[Vec3]| {
        let first = points.len() as i64;
        points.extend(corners.iter().map(|corner| [corner.x, corner.y, corner.z]));
        members.extend(first..points.len() as i64);
        ends.push(points.len() as i64);
        numbers.push(wall as i32);
        let row = &header.walls[wall];
        let middle = corners.iter().sum::<Vec3>() / corners.len() as f64;
        velocities.extend_from_slice(row.velocity_at(&middle).as_slice());
        forces.extend_from_slice(row.force.as_slice());
    };
    for (this, (wall, point, normal)) in planes.iter().enumerate() {
        let others = planes.iter().enumerate().filter(|(other, _)| *other != this);
        let others = others.map(|(_, (_, point, normal))| (*point, *normal));
        let polygon = cut(square(point, normal, &room), others.chain(sides(&room)), &room);
        if polygon.len() >= 3 {
            add(*wall, &polygon);
            wear.push(Wear::default());
        }
    }
    let mut triangles_of = vec![0; header.walls.len()];
    for (wall, corners) in header.triangles_in_place() {
        add(wall, &corners);
        let triangle = triangles_of[wall];
        triangles_of[wall] += 1;
        let row = worn.get(&(&*header.walls[wall].name, triangle));
        wear.push(
            row.map_or_else(Wear::default, |row| Wear::of(row, &header.walls[wall], &corners)),
        );
    }
    let mut of_cells = vec![
        Array::new("wall", 1, &numbers),
        Array::new("velocity", 3, &velocities),
        Array::new("wall_force", 3, &forces),
    ];
    if !worn.is_empty() {
        let numbers = |which: fn(&Wear) -> f64| wear.iter().map(which).collect::<Vec<_>>();
        let tractions: Vec<f64> = wear.iter().flat_map(|wear| wear.traction.data.0[0]).collect();
        of_cells.extend([
            Array::new("lost", 1, &numbers(|wear| wear.lost)),
            Array::new("rubbed", 1, &numbers(|wear| wear.rubbed)),
            Array::new("mean_pressure", 1, &numbers(|wear| wear.pressure)),
            Array::new("mean_traction", 3, &tractions),
        ]);
    }
    Ok(PolyData {
        time: header.time,
        point_count: points.len(),
        points: Array::new("Points", 3, points.as_flattened()),
        cells: Cells::Polygons,
        members,
        ends,
        of_points: Vec::new(),
        of_cells,
    })
}

/// Wear of a triangle, over its area.
struct Wear {
    /// Energy [J/m²].
    lost: f64,
    rubbed: f64,
    /// Mean over time [Pa].
    pressure: f64,
    traction: Vec3,
}

/// Unknown values, not numbers.
impl Default for Wear {
    fn default() -> Self {
        let [lost, rubbed, pressure] = [f64::NAN; 3];
        Self { lost, rubbed, pressure, traction: Vec3::repeat(f64::NAN) }
    }
}

impl Wear {
    fn of(worn: &Worn, wall: &WallRow, [a, b, c]: &[Vec3; 3]) -> Self {
        let twice = (b - a).cross(&(c - a));
        let area = 0.5 * twice.norm();
        let impulse = wall.body.as_ref().map_or(worn.impulse, |body| body.turned(&worn.impulse));
        // There is no mean before the first step.
        let time = if worn.time > 0.0 { worn.time } else { f64::NAN };
        let traction = impulse / (time * area);
        let pressure = traction.dot(&twice.normalize()).abs();
        Self { lost: worn.lost / area, rubbed: worn.rubbed / area, pressure, traction }
    }
}

/// Two opposite corners of the drawn box [m].
type Room = [Vec3; 2];

/// Box of the domain, and of all particles and walls outside it; along periodic axes the domain alone.
fn room(reader: &Reader) -> Result<Room, PostError> {
    let header = reader.header();
    let (mut low, mut high) = header.cell.corners();
    let mut hold = |point: &Vec3, reach: f64| {
        for k in header.cell.open_axes() {
            low[k] = low[k].min(point[k] - reach);
            high[k] = high[k].max(point[k] + reach);
        }
    };
    for (point, _) in header.walls.iter().flat_map(WallRow::planes) {
        hold(&point, 0.0);
    }
    for rows in pieces(reader.particle_count()) {
        let particles = reader.particles(rows)?;
        check::check_particles(header, &particles)?;
        for (row, centre) in particles.position.iter().enumerate() {
            let shape = header.shapes[particles.shape[row].index()].body();
            hold(centre, shape.bounding_radius() * particles.scale_of(row));
        }
    }
    Ok([low, high])
}

/// The six sides of a box, each with a point and the inward normal.
fn sides([low, high]: &Room) -> impl Iterator<Item = (Vec3, Vec3)> {
    [(*low, 1.0), (*high, -1.0)]
        .into_iter()
        .flat_map(|(corner, sign)| (0..3).map(move |k| (corner, Vec3::ith(k, sign))))
}

/// A square in the plane that covers its section with a box; counter-clockwise seen from the tip of the normal.
fn square(point: &Vec3, normal: &Vec3, [low, high]: &Room) -> Vec<Vec3> {
    let middle = (low + high) * 0.5;
    let centre = middle - normal * (middle - point).dot(normal);
    let reach = (high - low).norm();
    let across = normal.cross(&Vec3::ith(normal.iamin(), 1.0)).normalize() * reach;
    let along = normal.cross(&across);
    vec![
        centre - across - along,
        centre + across - along,
        centre + across + along,
        centre - across + along,
    ]
}

/// The part of a polygon in front of all planes, or on them.
fn cut(
    polygon: Vec<Vec3>,
    planes: impl Iterator<Item = (Vec3, Vec3)>,
    [low, high]: &Room,
) -> Vec<Vec3> {
    // A plane that coincides with another up to rounding cuts nothing off it.
    let rounding = 1e-9 * (high - low).norm();
    planes.fold(polygon, |polygon, (point, normal)| {
        let height = |corner: &Vec3| (corner - point).dot(&normal) + rounding;
        let mut left = Vec::new();
        for (k, corner) in polygon.iter().enumerate() {
            let next = &polygon[(k + 1) % polygon.len()];
            let (here, there) = (height(corner), height(next));
            if here >= 0.0 {
                left.push(*corner);
            }
            if (here < 0.0) != (there < 0.0) {
                left.push(corner + (next - corner) * (here / (here - there)));
            }
        }
        left
    })
}

/// Particles as points with the columns that a picture shows.
///
/// # Errors
/// If a file cannot be read.
pub fn particles(reader: &Reader) -> Result<PolyData, PostError> {
    let table = reader.particles(0..reader.particle_count())?;
    let header = reader.header();
    check::check_particles(header, &table)?;
    let is_shown = |place: &str| place.starts_with("/VTKHDF/PointData/");
    let columns = PARTICLE_COLUMNS.iter().filter(|column| is_shown(&column.place));
    let there = columns.filter(|column| column.of(&table).rows() == table.id.len());
    let mut of_points: Vec<Array> =
        there.map(|column| Array::of_column(column.name, column.of(&table))).collect();
    of_points.push(Array::of_column("semi_axes", &snapshot::semi_axes(header, &table)));
    let count = table.id.len() as i64;
    Ok(PolyData {
        time: header.time,
        point_count: table.id.len(),
        points: Array::of_column("Points", &table.position),
        cells: Cells::Vertices,
        members: (0..count).collect(),
        ends: (1..=count).collect(),
        of_points,
        of_cells: Vec::new(),
    })
}

/// Contacts as lines from centre to centre, or to the foot on a wall, with all columns and `force`, the magnitude of the total
/// force [N].
///
/// # Errors
/// If a file cannot be read.
pub fn contacts(reader: &Reader) -> Result<PolyData, PostError> {
    let table: ContactTable = reader.contacts(0..reader.contact_count()?)?;
    check::check_contacts(&table)?;
    let count = table.a.len();
    let ends = table.centre.iter().zip(&table.branch);
    let points: Vec<Vec3> = ends.flat_map(|(centre, branch)| [*centre, centre + branch]).collect();
    let mut of_cells: Vec<Array> = CONTACT_COLUMNS
        .iter()
        .map(|column| Array::of_column(column.name, column.of(&table)))
        .collect();
    let forces: Vec<f64> = (0..count).map(|contact| table.force(contact).norm()).collect();
    of_cells.push(Array::new("force", 1, &forces));
    Ok(PolyData {
        time: reader.header().time,
        point_count: points.len(),
        points: Array::of_column("Points", &points),
        cells: Cells::Lines,
        members: (0..2 * count as i64).collect(),
        ends: (1..=count as i64).map(|line| 2 * line).collect(),
        of_points: Vec::new(),
        of_cells,
    })
}
