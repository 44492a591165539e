//! Plots of a run's history: related curves share a panel, and unknown columns get a small one each.

use super::draw::{
    Axes, BLUE, GREEN, INK, MUTED, Mark, ORANGE, PURPLE, PlotError, SIZE, Series, VERMILION, chart,
    decades, span, tick,
};
use super::plots::{Plot, Width};
use crate::cell::AXES;
use crate::drive::servo::Target;
use crate::output::header::WallRow;
use crate::post::history::{Curve, History};
use plotters::style::RGBColor;
use std::collections::BTreeSet;
use std::convert::Infallible;

/// Colours of curves in a panel, in order.
const PALETTE: [RGBColor; 6] = [BLUE, ORANGE, VERMILION, GREEN, PURPLE, INK];

/// Approximate number of points drawn per curve.
const POINTS: usize = 800;

/// Smallest value on a logarithmic axis, over the largest. The energies of a run span some seven decades; smaller values
/// are rounding.
const NOISE: f64 = 1e-10;

/// Largest magnitude drawn; its inverse is the smallest on a logarithmic axis. Axes have room around their values, which
/// must stay finite.
const LARGEST: f64 = 1e100;

/// Scale of the values.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Scale {
    Linear,
    /// Magnitudes; zeros are left out.
    Logarithmic,
}

use Scale::{Linear, Logarithmic};

/// A panel and the columns in it, each with its name in the legend.
#[derive(Clone, Copy)]
struct Panel<'a> {
    name: &'a str,
    title: &'a str,
    caption: &'a str,
    y_label: &'a str,
    scale: Scale,
    columns: &'a [(&'a str, &'a str)],
}

const PANELS: [Panel; 9] = [
    Panel {
        name: "counts",
        title: "Particles and contacts",
        caption: "Particles and contacts over the run.",
        y_label: "count",
        scale: Linear,
        columns: &[
            ("particles", "particles"),
            ("contacts", "contacts between them"),
            ("wall_contacts", "with walls"),
        ],
    },
    Panel {
        name: "coordination",
        title: "Coordination number",
        caption: "Mean number of contacts of a particle over the run, walls counted.",
        y_label: "contacts per particle",
        scale: Linear,
        columns: &[("coordination", "")],
    },
    Panel {
        name: "energy",
        title: "Energies",
        caption: "Kinetic energy, energy stored in contacts, dissipated energy, and energy error.",
        y_label: "energy (J)",
        scale: Logarithmic,
        columns: &[
            ("kinetic_J", "kinetic"),
            ("stored_J", "stored"),
            ("dissipated_J", "dissipated"),
            ("missing_J", "|missing|"),
        ],
    },
    Panel {
        name: "losses",
        title: "Dissipated energy by cause",
        caption: "Energy dissipated so far by each mechanism. Friction includes torsion of faces.",
        y_label: "energy (J)",
        scale: Logarithmic,
        columns: &[
            ("dissipated_by_normal_dashpots_J", "normal dashpots"),
            ("dissipated_by_tangential_dashpots_J", "tangential dashpots"),
            ("dissipated_by_friction_J", "friction"),
            ("dissipated_by_turning_J", "rolling and twisting"),
            ("dissipated_by_damping_J", "global damping"),
            ("dissipated_by_adhesion_J", "adhesion"),
        ],
    },
    Panel {
        name: "largest_overlap",
        title: "Largest overlap",
        caption: "Largest overlap of a contact over the shortest axis of its smaller particle.",
        y_label: "overlap / shortest axis",
        scale: Logarithmic,
        columns: &[("largest_overlap", "")],
    },
    Panel {
        name: "mean_normal_force",
        title: "Mean normal force",
        caption: "Mean normal force of a contact over the run.",
        y_label: "force (N)",
        scale: Linear,
        columns: &[("mean_normal_force_N", "")],
    },
    Panel {
        name: "largest_speed",
        title: "Largest speed",
        caption: "Speed of the fastest particle over the run.",
        y_label: "speed (m/s)",
        scale: Logarithmic,
        columns: &[("largest_speed_m_per_s", "")],
    },
    Panel {
        name: "top",
        title: "Height of the top",
        caption: "Height of the highest particle over the run.",
        y_label: "z (m)",
        scale: Linear,
        columns: &[("top_m", "")],
    },
    Panel {
        name: "unbalanced",
        title: "Unbalanced force",
        caption: "Mean resultant force of a particle over the mean contact force: distance from equilibrium.",
        y_label: "resultant / contact force",
        scale: Logarithmic,
        columns: &[("unbalanced", "")],
    },
];

/// Name of the panel of stresses on walls, which also has their targets.
const STRESSES: &str = "wall_stresses";

/// Panels with a curve for each wall: loads, stresses, and displacements across an axis.
const OF_WALLS: [Panel; 3] = [
    Panel {
        name: "wall_loads",
        title: "Loads on walls",
        caption: "Force of the particles on each wall along its normal, pressure positive.",
        y_label: "load (N)",
        scale: Linear,
        columns: &[],
    },
    Panel {
        name: STRESSES,
        title: "Stresses on walls",
        caption: "Stress of the particles on each wall, compression positive.",
        y_label: "stress (Pa)",
        scale: Linear,
        columns: &[],
    },
    Panel {
        name: "wall_ways",
        title: "Displacements of walls",
        caption: "Inward displacement of each wall since the first row, negative outwards.",
        y_label: "way (m)",
        scale: Linear,
        columns: &[],
    },
];

/// Prefixes of the columns of a sheared cell, with their panels.
const OF_THE_CELL: [(&str, Panel); 2] = [
    (
        "contact",
        Panel {
            name: "contact_stress",
            title: "Stress of contacts",
            caption: "Components of the stress of contacts in the whole cell, compression positive.",
            y_label: "stress (Pa)",
            scale: Linear,
            columns: &[],
        },
    ),
    (
        "kinetic",
        Panel {
            name: "kinetic_stress",
            title: "Stress of motion",
            caption: "Components of the stress of velocity fluctuations in the whole cell, compression positive.",
            y_label: "stress (Pa)",
            scale: Linear,
            columns: &[],
        },
    ),
];

/// Columns without a panel: parts of the kinetic energy, an alternating part of the balance, and energies with an
/// arbitrary zero.
const LEFT_OUT: [&str; 5] =
    ["translation_J", "rotation_J", "step_energy_J", "gravity_J", "received_J"];

/// Panels of a history, without those in which nothing changes. `walls` give the direction of the load on a wall,
/// `targets` the requested stresses.
///
/// # Errors
/// See [`PlotError`].
pub fn panels(
    history: &History,
    walls: &[WallRow],
    targets: &[Target],
) -> Result<Vec<Plot>, PlotError> {
    let mut plots = Vec::new();
    visit::<PlotError>(history, walls, &mut |panel, curves| {
        plots.extend(match panel.name {
            STRESSES => wall_stresses(panel, curves, targets)?,
            _ => draw(panel, curves, &[])?,
        });
        Ok(())
    })?;
    tell_apart(&mut plots);
    Ok(plots)
}

/// A curve of a panel with the words of its own chart.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Quantity {
    /// Name of a file.
    pub(super) name: String,
    pub(super) title: String,
    pub(super) y_label: String,
    pub(super) is_logarithmic: bool,
    pub(super) points: Vec<(f64, f64)>,
}

/// The curves of all panels of a history.
pub(super) fn quantities(history: &History, walls: &[WallRow]) -> Vec<Quantity> {
    let mut all = Vec::new();
    let Ok(()) = visit::<Infallible>(history, walls, &mut |panel, curves| {
        all.extend(curves.iter().map(|Curve { name, points }| {
            let of = |between: &str, own: &str| {
                if name.is_empty() { String::new() } else { format!("{between}{own}") }
            };
            Quantity {
                name: format!("{}{}", panel.name, of("_", &file_name(name))),
                title: format!("{}{}", panel.title, of(": ", name)),
                y_label: panel.y_label.to_owned(),
                is_logarithmic: panel.scale == Logarithmic,
                points: points.clone(),
            }
        }));
        Ok(())
    });
    all
}

impl Quantity {
    /// Whether both are one quantity in one unit.
    pub(super) fn is_like(&self, other: &Self) -> bool {
        let words = |of: &Self| (of.name.clone(), of.title.clone(), of.y_label.clone());
        words(self) == words(other)
    }

    /// Its chart with a curve of each run, in the colours; `None` if no curve changes.
    pub(super) fn drawn(
        &self,
        curves: &[Curve],
        colours: &[RGBColor],
        x_label: &str,
    ) -> Result<Option<Plot>, PlotError> {
        let panel = Panel {
            name: &self.name,
            title: &self.title,
            caption: &format!("{} of each run, from history.csv.", self.title),
            y_label: &self.y_label,
            scale: if self.is_logarithmic { Logarithmic } else { Linear },
            columns: &[],
        };
        draw_over(x_label, &panel, curves, colours, &[])
    }
}

/// Receives a panel and its curves.
type Each<'a, E> = dyn FnMut(&Panel, &[Curve]) -> Result<(), E> + 'a;

/// Calls `each` with every panel of a history and its curves.
fn visit<E>(history: &History, walls: &[WallRow], each: &mut Each<E>) -> Result<(), E> {
    let mut rest: Vec<&Curve> = history.curves.iter().collect();
    for panel in &PANELS {
        let curves = panel.columns.iter().filter_map(|&(column, name)| {
            let curve = take(&mut rest, column)?;
            Some(Curve { name: name.into(), points: curve.points.clone() })
        });
        each(panel, &curves.collect::<Vec<_>>())?;
    }
    rest.retain(|curve| !LEFT_OUT.contains(&curve.name.as_str()));

    let loads: Vec<Curve> = walls.iter().filter_map(|wall| wall_load(wall, &mut rest)).collect();
    let stress = |wall: &WallRow| {
        let curve = take(&mut rest, &format!("stress_{}_Pa", wall.name))?;
        Some(Curve { name: wall.name.clone(), points: curve.points.clone() })
    };
    let stresses: Vec<Curve> = walls.iter().filter_map(stress).collect();
    let ways: Vec<Curve> = walls.iter().filter_map(|wall| wall_way(wall, &mut rest)).collect();
    for (panel, curves) in OF_WALLS.iter().zip([loads, stresses, ways]) {
        // Walls in excess of the colours continue in a further panel.
        for curves in curves.chunks(PALETTE.len()) {
            each(panel, curves)?;
        }
    }
    for (kind, panel) in &OF_THE_CELL {
        let components = ["xx", "yy", "zz", "xy", "xz", "yz"];
        let stress = |component: &str| {
            let curve = take(&mut rest, &format!("{kind}_stress_{component}_Pa"))?;
            Some(Curve { name: component.into(), points: curve.points.clone() })
        };
        let curves: Vec<Curve> = components.into_iter().filter_map(stress).collect();
        each(panel, &curves)?;
    }
    rest.into_iter().try_for_each(|curve| unknown(curve, each))
}

/// Removes the curve of this name from the remaining ones.
fn take<'a>(rest: &mut Vec<&'a Curve>, name: &str) -> Option<&'a Curve> {
    let place = rest.iter().position(|curve| curve.name == name)?;
    Some(rest.remove(place))
}

/// Load on a wall [N], if all components of its force remain: against its normal, which points towards the particles.
/// Walls that turn, and walls of triangles or several planes, have none.
fn wall_load(wall: &WallRow, rest: &mut Vec<&Curve>) -> Option<Curve> {
    let turned = format!("turned_{}_x_rad", wall.name);
    let turns = rest.iter().any(|curve| curve.name == turned);
    if !wall.is_one_plane() || turns {
        return None;
    }
    let column = |axis| format!("force_{}_{axis}_N", wall.name);
    let columns = AXES.map(column);
    if !columns.iter().all(|name| rest.iter().any(|curve| curve.name == *name)) {
        return None;
    }
    let mut points: Vec<(f64, f64)> = Vec::new();
    for (k, name) in columns.iter().enumerate() {
        let component = &take(rest, name)?.points;
        points.resize(component.len(), (0.0, 0.0));
        for (sum, &(time, force)) in points.iter_mut().zip(component) {
            *sum = (time, sum.1 - force * wall.normal[k]);
        }
    }
    Some(Curve { name: wall.name.clone(), points })
}

/// Inward displacement of a wall across an axis [m].
fn wall_way(wall: &WallRow, rest: &mut Vec<&Curve>) -> Option<Curve> {
    let curve = take(rest, &format!("place_{}_m", wall.name))?;
    let (_, first) = *curve.points.first()?;
    let inwards = wall.normal[wall.normal.iamax()].signum();
    let points = curve.points.iter().map(|&(time, place)| (time, inwards * (place - first)));
    Some(Curve { name: wall.name.clone(), points: points.collect() })
}

/// Stresses on walls, with the targets of walls that have one.
fn wall_stresses(
    panel: &Panel,
    stresses: &[Curve],
    targets: &[Target],
) -> Result<Option<Plot>, PlotError> {
    let is_here = |target: &&Target| stresses.iter().any(|curve| curve.name == target.wall);
    let mut targets: Vec<f64> =
        targets.iter().filter(is_here).map(|target| target.stress).collect();
    targets.sort_by(f64::total_cmp);
    targets.dedup();
    let means = if targets.is_empty() {
        ""
    } else {
        " For walls with a servo, each point is the mean since the previous one; grey lines are their targets."
    };
    let caption = format!("{}{means}", panel.caption);
    draw(&Panel { caption: &caption, ..*panel }, stresses, &targets)
}

/// A panel with these curves, and level lines at `targets`; `None` if no curve changes or nothing can be drawn.
fn draw(panel: &Panel, curves: &[Curve], targets: &[f64]) -> Result<Option<Plot>, PlotError> {
    draw_over("time (s)", panel, curves, &PALETTE, targets)
}

/// Draws the curves in their colours over the values of this label.
fn draw_over(
    x_label: &str,
    panel: &Panel,
    curves: &[Curve],
    colours: &[RGBColor],
    targets: &[f64],
) -> Result<Option<Plot>, PlotError> {
    if !curves.iter().any(Curve::changes) {
        return Ok(None);
    }
    let log_y = panel.scale == Logarithmic;
    let magnitudes = curves.iter().flat_map(|c| &c.points).map(|p| p.1.abs());
    let largest = magnitudes.filter(|&size| size <= LARGEST).fold(0.0, f64::max);
    let smallest = (NOISE * largest).max(LARGEST.recip());
    let drawn = |&(time, value): &(f64, f64)| {
        let value = if log_y { value.abs() } else { value };
        let fits = time.abs() <= LARGEST && value.abs() <= LARGEST && (!log_y || value >= smallest);
        fits.then_some((time, value))
    };
    let mut series: Vec<Series> = curves
        .iter()
        .zip(colours)
        .map(|(curve, &colour)| {
            let points = curve.points.iter().filter_map(drawn).collect();
            let visible = Curve { name: curve.name.clone(), points };
            let points = visible.thinned(POINTS);
            Series { name: visible.name, colour, mark: Mark::Line, points }
        })
        .filter(|series| !series.points.is_empty())
        .collect();
    if series.is_empty() {
        return Ok(None);
    }
    // All panels have the same times below them, including times of values left out.
    let times = curves.iter().flat_map(|c| &c.points).map(|p| p.0).filter(|t| t.abs() <= LARGEST);
    let (first, last) = times
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(first, last), t| (t.min(first), t.max(last)));
    // Drawn first: the curves may hide the levels where a servo keeps its target.
    let levels = targets.iter().filter(|level| level.abs() <= LARGEST).map(|&level| Series {
        name: format!("target {} Pa", tick(level)),
        colour: MUTED,
        mark: Mark::Line,
        points: vec![(first, level), (last, level)],
    });
    series.splice(0..0, levels);
    let values = || series.iter().flat_map(|s| &s.points).map(|p| p.1);
    let axes = Axes {
        x_label: x_label.into(),
        y_label: panel.y_label.into(),
        x: span([first, last].into_iter()),
        y: if log_y { decades(values()) } else { span(values()) },
        log_x: false,
        log_y,
    };
    Ok(Some(Plot {
        name: format!("history_{}", panel.name),
        title: panel.title.into(),
        caption: panel.caption.into(),
        width: Width::Half,
        svg: chart(SIZE, &axes, &series)?,
    }))
}

/// Panel of an unknown column; logarithmic if it is positive over four decades or more.
fn unknown<E>(curve: &Curve, each: &mut Each<E>) -> Result<(), E> {
    let (low, high) = (curve.points.iter())
        .fold((f64::INFINITY, 0.0_f64), |(low, high), p| (low.min(p.1), high.max(p.1)));
    let wide = low > 0.0 && high >= 1e4 * low;
    let (words, unit) = words_and_unit(&curve.name);
    let title = sentence(&words);
    let panel = Panel {
        name: &file_name(&curve.name),
        title: &title,
        caption: &format!("{title} over the run, from history.csv."),
        y_label: &unit.map_or(words.clone(), |unit| format!("{words} ({unit})")),
        scale: if wide { Logarithmic } else { Linear },
        columns: &[],
    };
    each(&panel, &[Curve { name: String::new(), points: curve.points.clone() }])
}

/// Words for a column of a wall along or about an axis: its beginning, and the words before the wall and the axis.
const OF_AXES: [(&str, &str, &str); 6] = [
    ("force_", "force on", "along"),
    ("torque_", "torque on", "about"),
    ("velocity_", "velocity of", "along"),
    ("point_", "place of", "along"),
    ("angular_velocity_", "angular velocity of", "about"),
    ("turned_", "rotation of", "about"),
];

/// Words for other columns of a wall, an inlet or an outlet.
const OF_THINGS: [(&str, &str); 8] = [
    ("power_", "power of"),
    ("work_", "work of"),
    ("place_", "place of"),
    ("lost_at_", "energy lost at"),
    ("rubbed_at_", "energy lost to friction at"),
    ("entered_", "entered through"),
    ("left_", "left through"),
    ("missing_", "due at"),
];

/// Name of a column as words, and its unit: `torque_drum_y_N_m` is "torque on drum about y" in "N m".
fn words_and_unit(name: &str) -> (String, Option<&'static str>) {
    const UNITS: [(&str, &str); 15] = [
        ("_m_per_s", "m/s"),
        ("_kg_m_per_s", "kg m/s"),
        ("_rad_per_s", "rad/s"),
        ("_per_s", "1/s"),
        ("_rad", "rad"),
        ("_n_m", "N m"),
        ("_w", "W"),
        ("_m2", "m²"),
        ("_m3", "m³"),
        ("_pa", "Pa"),
        ("_kg", "kg"),
        ("_j", "J"),
        ("_n", "N"),
        ("_m", "m"),
        ("_s", "s"),
    ];
    let small = name.to_ascii_lowercase();
    let of = UNITS.iter().filter(|(end, _)| small.ends_with(end));
    // The longest matching ending leaves the shortest name.
    let (end, unit) =
        of.max_by_key(|(end, _)| end.len()).map_or(("", None), |&(end, unit)| (end, Some(unit)));
    (words(&name[..name.len() - end.len()], unit), unit)
}

/// Name of a column without its unit as words.
fn words(stem: &str, unit: Option<&str>) -> String {
    let plain = |text: &str| text.replace('_', " ");
    let of_axis = |&(begin, of, along): &(&str, &str, &str)| {
        let (wall, axis) = stem.strip_prefix(begin)?.rsplit_once('_')?;
        AXES.contains(&axis).then(|| format!("{of} {} {along} {axis}", plain(wall)))
    };
    let of_thing = |&(begin, of): &(&str, &str)| {
        let thing = plain(stem.strip_prefix(begin)?);
        Some(match (begin, unit) {
            ("entered_" | "left_" | "missing_", Some("kg")) => format!("mass {of} {thing}"),
            ("entered_" | "left_" | "missing_", _) => format!("particles {of} {thing}"),
            _ => format!("{of} {thing}"),
        })
    };
    let found = OF_AXES.iter().find_map(of_axis).or_else(|| OF_THINGS.iter().find_map(of_thing));
    found.unwrap_or_else(|| plain(&stem.to_lowercase()))
}

/// Words with a capital first letter.
fn sentence(words: &str) -> String {
    let mut letters = words.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}

/// A name valid on every file system: `force_-x_x_N` becomes `force_minus_x_x_n`.
fn file_name(column: &str) -> String {
    let mut name = String::new();
    for letter in column.chars() {
        let begins = name.is_empty() || name.ends_with('_');
        match letter {
            '-' if begins => name.push_str("minus_"),
            '+' if begins => name.push_str("plus_"),
            c if c.is_ascii_alphanumeric() => name.push(c.to_ascii_lowercase()),
            _ => name.push('_'),
        }
    }
    name
}

/// Numbers plots of one name: the second is `name_2`.
pub(super) fn tell_apart(plots: &mut [Plot]) {
    let mut taken = BTreeSet::new();
    for plot in plots {
        let name = plot.name.clone();
        let mut number = 1;
        while !taken.insert(plot.name.clone()) {
            number += 1;
            plot.name = format!("{name}_{number}");
        }
    }
}
