//! Measures on request: fields, mixing, slope, flow. Each writes a table, and a curve for the page.

use super::draw::{
    Axes, BLUE, Mark, ORANGE, PlotError, SIZE, Series, VERMILION, chart, linear, span,
};
use super::errors::MeasureError;
use super::fields::{Fields, Smoothing, Weight};
use super::flow::{
    CumulativeFlow, Flow, Gate, Rate, ThroughPlane, Window, through_outlet, through_plane,
};
use super::history::History;
use super::means::{Mean, means, stress_path};
use super::measured::{FieldsMade, Measured};
use super::mixing::{Groups, Members, Mixing};
use super::plots::{Plot, Width};
use super::region::{Margin, Region};
use super::report::{Report, readable};
use super::series::{Choice, Snapshot};
use super::slope::{Direction, Slope, Surface};
use super::{inside, vtp};
use crate::files;
use crate::output::header::WallRow;
use crate::output::series;
use crate::output::snapshot::Reader;
use serde::Serialize;
use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, BufWriter};
use std::path::Path;

/// Requested measures.
#[derive(clap::Args, Clone, Debug)]
#[command(next_help_heading = "Measures for process equipment")]
pub struct Requested {
    /// Also write density, solid fraction, velocity and stress on a grid, fields_STEP.vtkhdf and .csv, by coarse graining
    /// with this width, in metres or diameters of the largest shape: rho = sum of m phi(r - x)
    #[arg(long, value_name = "WIDTH")]
    fields: Option<Margin>,

    /// Weight of --fields: Lucy's polynomial up to twice the width, or a Gaussian up to three times
    #[arg(long, value_enum, default_value = "lucy", requires = "fields")]
    weight: Weight,

    /// Side of the cells of --fields, at most [default: its width], and of --mixing [default: 4d], in metres or diameters of the largest shape
    #[arg(long, value_name = "LENGTH", allow_hyphen_values = true)]
    grid: Option<Margin>,

    /// Also write Lacey's mixing index of two groups, mixing.csv: M = (s0^2 - s^2) / (s0^2 - sr^2). The first group is a shape,
    /// shape:NAME, or the half that is lower in the first snapshot, half:x
    #[arg(long, value_name = "GROUP")]
    mixing: Option<Groups>,

    /// Also write the angle of the free surface against the horizontal, slope.csv, in degrees
    #[arg(long, value_enum)]
    slope: Option<Direction>,

    /// Also write what passes a plane, in a series of snapshots, or leaves through an outlet, flow.csv, and print the rates in particles/s and kg/s:
    /// -z=0.05 is the plane z = 0.05 m, downwards
    #[arg(long, value_name = "GATE", allow_hyphen_values = true)]
    flow: Option<Gate>,

    /// Take the rates of --flow [default: all], and the means of torque, power and stress [default: the last half], between
    /// these times, in seconds
    #[arg(long, value_name = "t0,t1", allow_hyphen_values = true)]
    window: Option<Window>,
}

/// Data for the measures.
#[derive(Clone, Copy, Debug)]
pub struct Source<'a> {
    /// At least one snapshot, by step.
    pub snapshots: &'a [Snapshot],
    /// Scalars of the run.
    pub history: &'a History,
    /// Walls of the run.
    pub walls: &'a [WallRow],
    /// Region and contacts to measure.
    pub choice: &'a Choice,
    /// Whether to write XML files, too.
    pub as_xml: bool,
}

/// Results to show.
#[derive(Debug, Default)]
pub struct Shown {
    /// Plots for the page.
    pub plots: Vec<Plot>,
    /// Results as text for a terminal.
    pub text: String,
    /// Notes on the measures for a terminal, each with an end of line.
    pub notes: Vec<String>,
    /// Free surface of each snapshot.
    slopes: Vec<Slope>,
    /// Mixing of each snapshot.
    mixings: Vec<Mixing>,
    /// Results of the whole run.
    of_run: Measured,
    /// Errors of requested measures that failed.
    pub failed: Vec<MeasureError>,
}

impl Shown {
    /// Adds the results to the reports of their snapshots, those of the whole run to the last.
    pub fn add_to(&self, reports: &mut [Report]) {
        if let Some(last) = reports.last_mut() {
            let notes = self.notes.iter().map(|note| note.trim_end().to_owned()).collect();
            *last.measured = Measured { notes, ..self.of_run.clone() };
        }
        for report in reports {
            let step = report.summary.step;
            report.measured.slope = self.slopes.iter().find(|slope| slope.step == step).copied();
            report.measured.mixing = self.mixings.iter().find(|row| row.step == step).copied();
        }
    }
}

impl Requested {
    /// Makes the requested measures and writes their tables into a folder. A failure does not affect the others.
    pub fn make(&self, source: Source, out: &Path) -> Shown {
        let mut shown = Shown::default();
        let shown_by = &mut shown;
        let made = [
            self.fields.map(|width| self.make_fields(width, source, out, shown_by)),
            self.mixing.as_ref().map(|groups| self.make_mixing(groups, source, out, shown_by)),
            self.slope.map(|along| make_slope(along, source, out, shown_by)),
            self.flow.as_ref().map(|gate| self.make_flow(gate, source, out, shown_by)),
            Some(self.make_means(source, shown_by)),
        ];
        shown.failed = made.into_iter().flatten().filter_map(Result::err).collect();
        shown
    }

    fn make_fields(
        &self,
        width: Margin,
        source: Source,
        out: &Path,
        shown: &mut Shown,
    ) -> Result<(), MeasureError> {
        let (mut images, mut xml) = (Vec::new(), Vec::new());
        let (mut widths, mut sides) = (None, None);
        let all = of_each(source, "fields", shown, |reader, region| {
            let header = reader.header();
            let width = once(&mut widths, width, reader)?;
            let side = self.grid.map_or(Ok(width), |side| once(&mut sides, side, reader))?;
            let how = Smoothing { weight: self.weight, width, side };
            let fields = Fields::of(reader, region, how)?;
            let name = |ending: &str| format!("fields_{:09}.{ending}", header.step);
            fields.write_vtkhdf(&out.join(name("vtkhdf")))?;
            images.push((name("vtkhdf"), fields.time));
            write(&out.join(name("csv")), |file| fields.write_csv(file).map_err(io::Error::from))?;
            if source.as_xml {
                write(&out.join(name("vti")), |file| fields.image_data().write(file))?;
                xml.push((name("vti"), fields.time));
            }
            Ok((fields.grid, fields.mass(), width))
        })?;
        let list = "fields.vtkhdf.series";
        series::write(out, list, images).map_err(|cause| unwritten(&out.join(list), cause))?;
        if source.as_xml {
            write(&out.join("fields.pvd"), |file| vtp::write_list(file, &[xml]))?;
        }
        if let Some((grid, mass, width)) = all.last() {
            let [x, y, z] = grid.cells;
            shown.of_run.fields =
                Some(FieldsMade { cells: grid.cells, width_m: *width, mass_kg: *mass });
            let _ = writeln!(
                shown.text,
                "fields: {x} x {y} x {z} cells, width {} m, mass {} kg",
                readable(*width),
                readable(*mass)
            );
        }
        Ok(())
    }

    fn make_mixing(
        &self,
        groups: &Groups,
        source: Source,
        out: &Path,
        shown: &mut Shown,
    ) -> Result<(), MeasureError> {
        let (mut members, mut sides) = (None, None);
        let rows = of_each(source, "mixing", shown, |reader, region| {
            if members.is_none() {
                members = Some(Members::of(groups, reader)?);
            }
            let Some(members) = &members else { return Err(MeasureError::NobodyThere) };
            let side = self.grid.unwrap_or(Margin::Diameters(4.0));
            let side = once(&mut sides, side, reader)?;
            Mixing::of(reader, members, region, side)
        })?;
        write_rows(&out.join("mixing.csv"), &rows)?;
        let points: Vec<(f64, f64)> =
            rows.iter().filter_map(|row| Some((row.time_s, row.index?))).collect();
        if let (Some(first), Some(last)) = (points.first(), points.last()) {
            let _ = writeln!(
                shown.text,
                "mixing: Lacey's index {:.3} at {} s, {:.3} at {} s",
                first.1,
                readable(first.0),
                last.1,
                readable(last.0)
            );
        }
        if let Some(last) = rows.last().filter(|last| last.left_out > 0) {
            shown.notes.push(format!(
                "mixing: {} of {} particles at {} s came after the first snapshot: they are in neither half and are \
                 left out. For streams that follow each other, give each its own shape and use shape:NAME\n",
                last.left_out,
                last.left_out + last.grains,
                readable(last.time_s)
            ));
        }
        if matches!(groups, Groups::Half(_)) && rows.len() == 1 {
            let note = "mixing: the halves of a single snapshot are separate by definition: give --series, or \
                        several snapshots, to see how they mix\n";
            shown.notes.push(note.to_owned());
        }
        if points.len() > 1 {
            let cells = rows.last().map_or(0, |row| row.cells);
            // A mixture more even than random has an index above 1.
            let highest = points.iter().map(|point| point.1).fold(1.0, f64::max);
            shown.plots.push(curve(
                "mixing",
                "Mixing",
                format!("Lacey's index: 0 separate, 1 mixed at random. {cells} cells contain particles in the last \
                     snapshot."),
                ("Lacey's index", 0.0..1.05 * highest),
                points,
            )?);
        }
        shown.mixings = rows;
        Ok(())
    }

    fn make_flow(
        &self,
        gate: &Gate,
        source: Source,
        out: &Path,
        shown: &mut Shown,
    ) -> Result<(), MeasureError> {
        let ThroughPlane { rows, new_behind, gone_before } = match gate {
            Gate::Outlet(name) => {
                ThroughPlane { rows: through_outlet(source.history, name)?, ..Default::default() }
            }
            Gate::Plane(plane) => through_plane(source.snapshots.iter().map(opened), *plane)?,
        };
        let rate = Rate::of(&rows, self.window)?;
        write_rows(&out.join("flow.csv"), &rows)?;
        let _ = write!(
            shown.text,
            "flow: {} particles/s, {} kg/s from {} s to {} s ({} rows)",
            readable(rate.grains),
            readable(rate.mass),
            readable(rate.window.from),
            readable(rate.window.to),
            rate.rows
        );
        if let Some([early, late]) = rate.halves {
            let _ =
                write!(shown.text, "; per half {} and {} kg/s", readable(early), readable(late));
        }
        shown.text.push('\n');
        if new_behind > 0 {
            shown.notes.push(format!(
                "flow: {new_behind} particles were first seen behind the plane and are not counted. With an inlet \
                 before the plane, they crossed it between two snapshots: write snapshots more often \
                 (output.snapshot_every). {gone_before} particles were last seen before the plane and are counted\n"
            ));
        }
        shown.of_run.flow = Some(Flow { rate, new_behind, gone_before });
        shown.plots.push(flow_plot(&rows, &rate)?);
        Ok(())
    }

    /// Means of the history; none without a wall that turns and without stresses.
    fn make_means(&self, source: Source, shown: &mut Shown) -> Result<(), MeasureError> {
        let found = means(source.history, source.walls, self.window);
        // The window may be meant for the flow alone.
        let found = if self.flow.is_some() { found.unwrap_or_default() } else { found? };
        shown.text.extend(found.iter().map(Mean::line));
        shown.of_run.means = found;
        let path = stress_path(source.history, source.walls);
        if path.iter().any(|at| at != &path[0]) {
            shown.plots.push(path_plot(&path)?);
        }
        Ok(())
    }
}

fn make_slope(
    along: Direction,
    source: Source,
    out: &Path,
    shown: &mut Shown,
) -> Result<(), MeasureError> {
    let mut last = None;
    let rows = of_each(source, "slope", shown, |reader, region| {
        let surface = Surface::of(reader, region, along)?;
        Ok(last.insert(surface).slope)
    })?;
    write_rows(&out.join("slope.csv"), &rows)?;
    if let Some(surface) = &last {
        shown.plots.push(surface_plot(surface, along)?);
    }
    if let Some(last) = rows.last() {
        let _ = writeln!(
            shown.text,
            "slope: {:.1} degrees, {} m high, mean distance of columns from the line {} m",
            last.angle_degrees,
            readable(last.height_m),
            readable(last.scatter_m)
        );
    }
    if rows.len() > 1 {
        let points: Vec<_> = rows.iter().map(|row| (row.time_s, row.angle_degrees)).collect();
        let reach = span(points.iter().map(|point| point.1));
        shown.plots.push(curve(
            "slope",
            "Slope",
            "Angle of the free surface to the horizontal.".to_owned(),
            ("angle (degrees)", reach),
            points,
        )?);
    }
    shown.slopes = rows;
    Ok(())
}

/// Columns of a surface, and the line whose slope is the angle, both axes at one scale.
fn surface_plot(surface: &Surface, along: Direction) -> Result<Plot, PlotError> {
    /// Largest number of columns drawn.
    const MOST: usize = 1500;
    /// Width over height of the area between the axes [-].
    const SHAPE: f64 = 472.0 / 274.0;
    let x_label = match along {
        Direction::X => "x (m)",
        Direction::Y => "y (m)",
        Direction::Radial => "distance from the middle (m)",
    };
    let columns = &surface.columns;
    let points: Vec<_> =
        columns.iter().step_by(columns.len().div_ceil(MOST).max(1)).copied().collect();
    let [x, z] = [span(columns.iter().map(|at| at.0)), span(columns.iter().map(|at| at.1))];
    let half = (0.5 * (z.end - z.start)).max(0.5 * (x.end - x.start) / SHAPE);
    let around = |range: std::ops::Range<f64>, half: f64| {
        let middle = 0.5 * (range.start + range.end);
        middle - half..middle + half
    };
    let axes = linear(x_label, "z (m)", around(x, half * SHAPE), around(z, half));
    let tops = Series { name: "tops of columns".into(), colour: BLUE, mark: Mark::Dots, points };
    let line = Series {
        name: format!("{:.1} degrees", surface.slope.angle_degrees),
        colour: VERMILION,
        mark: Mark::Line,
        points: surface.line.to_vec(),
    };
    Ok(Plot {
        name: "surface".into(),
        title: "Free surface".into(),
        caption: "Tops of the columns of the last snapshot. The line is fitted between foot and top. Both axes have one \
                  scale."
            .into(),
        width: Width::Half,
        svg: chart(SIZE, &axes, &[tops, line])?,
    })
}

/// Deviatoric against mean stress over the run.
fn path_plot(path: &[(f64, f64)]) -> Result<Plot, PlotError> {
    /// Largest number of points drawn.
    const MOST: usize = 800;
    let points: Vec<_> =
        path.iter().step_by(path.len().div_ceil(MOST)).chain(path.last()).copied().collect();
    let axes = linear(
        "mean stress p (Pa)",
        "deviatoric stress q (Pa)",
        span(path.iter().map(|at| at.0)),
        span(path.iter().map(|at| at.1)),
    );
    let end = Series {
        name: "end".into(),
        colour: VERMILION,
        mark: Mark::Dots,
        points: path.last().into_iter().copied().collect(),
    };
    let line = Series { name: String::new(), colour: BLUE, mark: Mark::Line, points };
    Ok(Plot {
        name: "stress_path".into(),
        title: "Stress path".into(),
        caption: "Deviatoric against mean stress, from history.csv.".into(),
        width: Width::Half,
        svg: chart(SIZE, &axes, &[line, end])?,
    })
}

/// Cumulative flow, and the line whose slope is the rate.
fn flow_plot(rows: &[CumulativeFlow], rate: &Rate) -> Result<Plot, PlotError> {
    let points: Vec<_> = rows.iter().map(|row| (row.time_s, row.mass_kg)).collect();
    let axes = time_axes("mass passed (kg)", &points, span(points.iter().map(|p| p.1)));
    let in_window =
        points.iter().filter(|p| (rate.window.from..=rate.window.to).contains(&p.0)).copied();
    let (slope, offset) = super::slope::line(&in_window.collect::<Vec<_>>());
    let ends = [rate.window.from, rate.window.to].map(|t| (t, offset + slope * t));
    let all = Series { name: String::new(), colour: BLUE, mark: Mark::Line, points };
    let fit = Series {
        name: format!("{} kg/s", readable(slope)),
        colour: ORANGE,
        mark: Mark::Line,
        points: ends.to_vec(),
    };
    Ok(Plot {
        name: "flow".into(),
        title: "Flow".into(),
        caption: format!(
            "Mass passed. Line: least squares, {} particles per second.",
            readable(rate.grains)
        ),
        width: Width::Half,
        svg: chart(SIZE, &axes, &[all, fit])?,
    })
}

fn time_axes(label: &str, points: &[(f64, f64)], reach: std::ops::Range<f64>) -> Axes {
    linear("time (s)", label, span(points.iter().map(|point| point.0)), reach)
}

fn curve(
    name: &str,
    title: &str,
    caption: String,
    (label, reach): (&str, std::ops::Range<f64>),
    points: Vec<(f64, f64)>,
) -> Result<Plot, PlotError> {
    let axes = time_axes(label, &points, reach);
    let line = Series { name: String::new(), colour: BLUE, mark: Mark::Line, points };
    Ok(Plot {
        name: name.into(),
        title: title.into(),
        caption,
        width: Width::Half,
        svg: chart(SIZE, &axes, &[line])?,
    })
}

/// A length in metres, taken from the first snapshot of a series: cells stay the same when particles come and go.
fn once(known: &mut Option<f64>, length: Margin, reader: &Reader) -> Result<f64, MeasureError> {
    if let Some(metres) = *known {
        return Ok(metres);
    }
    let metres = length.metres(reader)?;
    *known = Some(metres);
    Ok(metres)
}

fn opened(snapshot: &Snapshot) -> Result<Reader, MeasureError> {
    Ok(Reader::open(&snapshot.path)?)
}

/// Measures each snapshot in turn; errors carry the name of the file. Snapshots without anything to measure, for example before
/// an inlet begins, are skipped and counted.
fn of_each<T>(
    source: Source,
    name: &str,
    shown: &mut Shown,
    mut of: impl FnMut(&Reader, Region) -> Result<T, MeasureError>,
) -> Result<Vec<T>, MeasureError> {
    let (mut made, mut left_out) = (Vec::new(), Vec::new());
    for snapshot in source.snapshots {
        let mut one = || {
            let reader = opened(snapshot)?;
            if reader.particle_count() == 0 {
                return Err(MeasureError::NobodyThere);
            }
            let region = match source.choice.margin {
                Some(margin) => inside(&reader, margin)?,
                None => source.choice.settings.region,
            };
            of(&reader, region)
        };
        match one() {
            Ok(one) => made.push(one),
            Err(error) => {
                let is_of_one_state = error.is_of_one_state(source.choice.margin.is_some());
                let file = snapshot.path.display().to_string();
                let error = MeasureError::In { file, error: Box::new(error) };
                if !is_of_one_state {
                    return Err(error);
                }
                left_out.push(error);
            }
        }
    }
    if made.is_empty()
        && let Some(error) = left_out.pop()
    {
        return Err(error);
    }
    shown.notes.extend(super::series::left_out(name, &left_out, source.snapshots.len()));
    Ok(made)
}

fn unwritten(path: &Path, cause: io::Error) -> MeasureError {
    MeasureError::Unwritten { path: path.to_owned(), cause }
}

fn write(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<(), MeasureError> {
    files::replace(path, write).map(drop).map_err(|cause| unwritten(path, cause))
}

fn write_rows<T: Serialize>(path: &Path, rows: &[T]) -> Result<(), MeasureError> {
    write(path, |file| {
        let mut table = csv::Writer::from_writer(file);
        rows.iter().try_for_each(|row| table.serialize(row)).map_err(io::Error::from)?;
        table.flush()
    })
}
