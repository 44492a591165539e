//! VTP and VTI, the XML files of VTK for points, lines and polygons, and for grids. ParaView since 5.0, VTK, pyvista and `meshio`
//! read them.
//!
//! Numbers are in base64, each array after its length (`header_type="UInt64"`), little-endian, not compressed.

use crate::output::columns::Numbers;
use crate::output::hdf5::Element;
use base64::engine::general_purpose::STANDARD;
use base64::write::EncoderWriter;
use std::io::{self, Write};

/// A named array of rows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Array {
    name: String,
    /// VTK's name of the type.
    kind: &'static str,
    /// Number of values in a row.
    width: usize,
    bytes: Vec<u8>,
}

impl Array {
    /// An array of rows of `width` numbers, one after the other.
    pub fn new<T: Element>(name: &str, width: usize, values: &[T]) -> Self {
        let bytes = bytemuck::cast_slice(values).to_vec();
        Self { name: name.to_owned(), kind: T::VTK, width, bytes }
    }

    /// A column of a snapshot, in its form in the file.
    pub fn of_column(name: &str, column: &dyn Numbers) -> Self {
        let (kind, width) = (column.vtk_name(), column.labels().len());
        Self { name: name.to_owned(), kind, width, bytes: column.bytes() }
    }
}

/// Kind of cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cells {
    /// Single points.
    Vertices,
    /// Lines of several points.
    Lines,
    /// Polygons, counter-clockwise seen from outside.
    Polygons,
}

/// Points and cells of one kind, with their data.
#[derive(Clone, Debug)]
pub struct PolyData {
    /// Time of the snapshot [s].
    pub time: f64,
    /// Coordinates, in rows of three.
    pub points: Array,
    /// Number of points.
    pub point_count: usize,
    /// Kind of the cells.
    pub cells: Cells,
    /// Points of all cells, one cell after the other.
    pub members: Vec<i64>,
    /// End of each cell in `members`.
    pub ends: Vec<i64>,
    /// Data of each point.
    pub of_points: Vec<Array>,
    /// Data of each cell.
    pub of_cells: Vec<Array>,
}

impl PolyData {
    /// Writes a file.
    ///
    /// # Errors
    /// If the writer fails.
    pub fn write(&self, out: &mut impl Write) -> io::Result<()> {
        let counts = [Cells::Vertices, Cells::Lines, Cells::Polygons]
            .map(|kind| if kind == self.cells { self.ends.len() } else { 0 });
        let [vertices, lines, polygons] = counts;
        write!(
            out,
            r#"<?xml version="1.0"?>
<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64">
<PolyData>
<FieldData>
<DataArray type="Float64" Name="TimeValue" NumberOfTuples="1" format="ascii">{:e}</DataArray>
</FieldData>
<Piece NumberOfPoints="{}" NumberOfVerts="{vertices}" NumberOfLines="{lines}" NumberOfStrips="0" NumberOfPolys="{polygons}">
"#,
            self.time, self.point_count
        )?;
        section(out, "PointData", &self.of_points)?;
        section(out, "CellData", &self.of_cells)?;
        section(out, "Points", std::slice::from_ref(&self.points))?;
        let name = match self.cells {
            Cells::Vertices => "Verts",
            Cells::Lines => "Lines",
            Cells::Polygons => "Polys",
        };
        section(
            out,
            name,
            &[indices("connectivity", &self.members), indices("offsets", &self.ends)],
        )?;
        out.write_all(b"</Piece>\n</PolyData>\n</VTKFile>\n")
    }
}

/// Data of the cells of a grid.
#[derive(Clone, Debug)]
pub struct ImageData {
    /// Time of the snapshot [s].
    pub time: f64,
    /// Number of cells along x, y, z.
    pub cells: [usize; 3],
    /// Lowest corner of the grid [m].
    pub origin: [f64; 3],
    /// Sides of a cell [m].
    pub spacing: [f64; 3],
    /// Data of each cell, x fastest.
    pub of_cells: Vec<Array>,
}

impl ImageData {
    /// Writes a file, `.vti`.
    ///
    /// # Errors
    /// If the writer fails.
    pub fn write(&self, out: &mut impl Write) -> io::Result<()> {
        let [x, y, z] = self.cells;
        let extent = format!("0 {x} 0 {y} 0 {z}");
        let three = |[x, y, z]: [f64; 3]| format!("{x:e} {y:e} {z:e}");
        write!(
            out,
            r#"<?xml version="1.0"?>
<VTKFile type="ImageData" version="1.0" byte_order="LittleEndian" header_type="UInt64">
<ImageData WholeExtent="{extent}" Origin="{}" Spacing="{}">
<FieldData>
<DataArray type="Float64" Name="TimeValue" NumberOfTuples="1" format="ascii">{:e}</DataArray>
</FieldData>
<Piece Extent="{extent}">
"#,
            three(self.origin),
            three(self.spacing),
            self.time
        )?;
        section(out, "CellData", &self.of_cells)?;
        out.write_all(b"</Piece>\n</ImageData>\n</VTKFile>\n")
    }
}

/// Array of indices in 32 bits if they fit, otherwise in 64.
fn indices(name: &str, values: &[i64]) -> Array {
    let narrow: Result<Vec<i32>, _> = values.iter().map(|&value| value.try_into()).collect();
    narrow.map_or_else(|_| Array::new(name, 1, values), |narrow| Array::new(name, 1, &narrow))
}

fn section(out: &mut impl Write, name: &str, arrays: &[Array]) -> io::Result<()> {
    // With this attribute VTK uses the normals for shading.
    let is_normal = |array: &&Array| array.name == NORMALS;
    let normals = if name == "PointData" { arrays.iter().find(is_normal) } else { None };
    let attribute = normals.map_or(String::new(), |_| format!(" Normals=\"{NORMALS}\""));
    writeln!(out, "<{name}{attribute}>")?;
    for Array { name, kind, width, bytes } in arrays {
        write!(
            out,
            r#"<DataArray type="{kind}" Name="{name}" NumberOfComponents="{width}" format="binary">"#
        )?;
        let mut encoder = EncoderWriter::new(&mut *out, &STANDARD);
        encoder.write_all(&(bytes.len() as u64).to_le_bytes())?;
        encoder.write_all(bytes)?;
        encoder.finish()?;
        drop(encoder);
        out.write_all(b"</DataArray>\n")?;
    }
    writeln!(out, "</{name}>")
}

/// Unit normals of points: with them a viewer shades curved surfaces smoothly.
pub const NORMALS: &str = "Normals";

/// Files of a series, one for each snapshot, with their times [s].
pub type Files = Vec<(String, f64)>;

/// Writes a list of files with their times, a `.pvd`, for ParaView. Several series of the same snapshots are shown together at
/// each time, as parts 0, 1, ...
///
/// # Errors
/// If the writer fails.
pub fn write_list(out: &mut impl Write, parts: &[Files]) -> io::Result<()> {
    out.write_all(
        b"<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n<Collection>\n",
    )?;
    let snapshots = parts.iter().map(Vec::len).max().unwrap_or_default();
    for row in 0..snapshots {
        for (part, files) in parts.iter().enumerate() {
            let Some((file, time)) = files.get(row) else { continue };
            writeln!(out, r#"<DataSet timestep="{time:e}" part="{part}" file="{file}"/>"#)?;
        }
    }
    out.write_all(b"</Collection>\n</VTKFile>\n")
}
