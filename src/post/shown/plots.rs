//! Plots of a snapshot and of a series; each is a file of its own and also on the page.

use super::draw::{
    Axes, BLUE, INK, Mark, ORANGE, PlotError, SIZE, Series, VERMILION, chart, decades, linear,
    rule, span,
};
use crate::post::coordination::{Coordination, CoordinationNumbers};
use crate::post::forces::Histogram;
use crate::post::report::{Report, Summary, readable};
use plotters::style::RGBColor;

/// Share of the width of a page that a plot takes; on a narrow page every plot takes all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Width {
    /// One third.
    Third,
    /// One half.
    Half,
    /// Full width.
    Full,
}

/// A finished plot.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Plot {
    /// Name of its file, without the ending.
    pub name: String,
    /// Title, in a few words.
    pub title: String,
    /// Caption of one sentence.
    pub caption: String,
    /// Share of the width of the page.
    pub width: Width,
    /// The drawing as SVG.
    pub svg: String,
}

/// Distribution of the number of contacts per particle (fig. 11 of Lai et al. 2021).
///
/// # Errors
/// See [`PlotError`].
pub fn coordination(coordination: &Coordination) -> Result<Plot, PlotError> {
    let (all, pairs) = (&coordination.with_walls, &coordination.without_walls);
    let mut counted = vec![("between particles", BLUE, pairs)];
    if all != pairs {
        counted.push(("with walls", ORANGE, all));
    }
    let (axes, mut series) = bars(&counted);
    if let Some(mean) = pairs.mean() {
        series.push(Series { name: format!("mean {}", readable(mean)), ..rule(INK, mean) });
    }
    Ok(Plot {
        name: "coordination".into(),
        title: "Coordination number".into(),
        caption:
            "Share of particles by number of contacts; the line is the mean between particles."
                .into(),
        width: Width::Half,
        svg: chart(SIZE, &axes, &series)?,
    })
}

/// Shares of particles by number of contacts, several distributions beside each other.
pub fn bars(counted: &[(&str, RGBColor, &CoordinationNumbers)]) -> (Axes, Vec<Series>) {
    let width = 0.84 / counted.len().max(1) as f64;
    let left = -0.5 * (counted.len() as f64 - 1.0);
    let of_one =
        |(k, &(name, colour, numbers)): (usize, &(&str, RGBColor, &CoordinationNumbers))| {
            let shares =
                (0i32..).zip(numbers.shares()).map(|(n, share)| (f64::from(n), 100.0 * share));
            let mark = Mark::Bars(width, (left + k as f64) * width);
            Series { name: name.into(), colour, mark, points: shares.collect() }
        };
    let series: Vec<Series> = counted.iter().enumerate().map(of_one).collect();
    let highest = series.iter().flat_map(|s| &s.points).map(|p| p.1).fold(1.0, f64::max);
    let most = counted.iter().map(|c| c.2.histogram.len()).fold(2, usize::max) as f64;
    (
        linear("contacts of a particle", "particles (%)", -0.6..most - 0.4, 0.0..1.08 * highest),
        series,
    )
}

/// Probability density of forces over the mean normal force, semi-logarithmic.
///
/// # Errors
/// See [`PlotError`].
pub fn force_distribution(normal: &Histogram, shear: &Histogram) -> Result<Plot, PlotError> {
    let (axes, series) = densities(&both(normal, shear), Mark::Dots);
    let caption = "Probability density of normal and tangential contact forces, both over the mean \
                   normal force; a straight tail is an exponential distribution of strong forces.";
    let left_out =
        beyond(&[("normal forces", normal), ("tangential forces", shear)], " times the mean");
    Ok(Plot {
        name: "force_distribution".into(),
        title: "Contact forces".into(),
        caption: format!("{caption}{left_out}"),
        width: Width::Half,
        svg: chart(SIZE, &axes, &series)?,
    })
}

/// A sentence on values above the last bin of histograms with the same edges; empty without such values.
fn beyond(histograms: &[(&str, &Histogram)], unit: &str) -> String {
    let share = |&(what, histogram): &(&str, &Histogram)| {
        Some(format!("{} % of the {what}", readable(100.0 * histogram.share_above()?)))
    };
    let shares: Vec<String> = histograms.iter().filter_map(share).collect();
    let edge = histograms.first().and_then(|(_, histogram)| histogram.edges.last());
    match edge {
        Some(edge) if !shares.is_empty() => {
            format!(" Beyond the plot, at {edge}{unit} and above: {}.", shares.join(", "))
        }
        _ => String::new(),
    }
}

/// Distribution by the logarithm of the force, which shows the weak contacts (fig. 13 of Lai et al. 2021).
///
/// # Errors
/// See [`PlotError`].
pub fn weak_forces(normal: &Histogram, shear: &Histogram) -> Result<Plot, PlotError> {
    let (axes, series) = shares_per_decade(&both(normal, shear), Mark::Dots);
    Ok(Plot {
        name: "weak_forces".into(),
        title: "Weak and strong contacts".into(),
        caption: "The same forces per decade: shares of weak contacts.".into(),
        width: Width::Half,
        svg: chart(SIZE, &axes, &series)?,
    })
}

/// A histogram with its name and colour.
pub type Named<'a> = (&'a str, RGBColor, &'a Histogram);

fn both<'a>(normal: &'a Histogram, shear: &'a Histogram) -> [Named<'a>; 2] {
    [("normal", BLUE, normal), ("tangential", ORANGE, shear)]
}

/// Densities of forces over the mean, semi-logarithmic.
pub fn densities(histograms: &[Named], mark: Mark) -> (Axes, Vec<Series>) {
    let series = force_series(histograms, mark, |histogram| histogram.density().collect());
    let values = || series.iter().flat_map(|s| &s.points);
    let farthest = values().map(|p| p.0).fold(3.0, f64::max);
    let y = decades(values().map(|p| p.1));
    let axes = linear("force / mean normal force", "probability density", 0.0..1.03 * farthest, y);
    (Axes { log_y: true, ..axes }, series)
}

/// Shares of forces by decade; the bins are logarithmic.
pub fn shares_per_decade(histograms: &[Named], mark: Mark) -> (Axes, Vec<Series>) {
    let series = force_series(histograms, mark, |histogram| histogram.share_per_decade().collect());
    let values = || series.iter().flat_map(|s| &s.points);
    let (x, y) = (decades(values().map(|p| p.0)), 0.0..span(values().map(|p| p.1)).end);
    let axes = linear("force / mean normal force", "share of contacts per decade", x, y);
    (Axes { log_x: true, ..axes }, series)
}

fn force_series(
    histograms: &[Named],
    mark: Mark,
    heights: impl Fn(&Histogram) -> Vec<(f64, f64)>,
) -> Vec<Series> {
    let points = |histogram: &Histogram| {
        heights(histogram).into_iter().filter(|&(_, height)| height > 0.0).collect()
    };
    let of_one = |&(name, colour, histogram): &Named| Series {
        name: name.into(),
        colour,
        mark,
        points: points(histogram),
    };
    histograms.iter().map(of_one).collect()
}

/// Distribution of mobilised friction.
///
/// # Errors
/// See [`PlotError`].
pub fn friction(used: &Histogram) -> Result<Plot, PlotError> {
    let total = used.total_halves().max(1) as f64;
    let width = used.edges.get(1).copied().unwrap_or(1.0);
    let points: Vec<(f64, f64)> = (used.halves.iter().zip(&used.edges))
        .map(|(&halves, edge)| (edge + 0.5 * width, 100.0 * halves as f64 / total))
        .collect();
    let filled = points.iter().filter(|p| p.1 > 0.0);
    let (end, highest) = filled.fold((0.1, 1.0), |(end, high), p| (p.0.max(end), p.1.max(high)));
    let (x, y) = (0.0..end + 2.0 * width, 0.0..1.08 * highest);
    let axes = linear("tangential / normal force of a contact", "contacts (%)", x, y);
    let bars =
        Series { name: String::new(), colour: BLUE, mark: Mark::Bars(0.85 * width, 0.0), points };
    let caption =
        "Ratio of tangential to normal force; sliding contacts are at the coefficient of friction.";
    Ok(Plot {
        name: "friction".into(),
        title: "Friction used".into(),
        caption: format!("{caption}{}", beyond(&[("contacts", used)], "")),
        width: Width::Half,
        svg: chart(SIZE, &axes, &[bars])?,
    })
}

/// A number of a summary.
pub(super) type Pick = fn(&Summary) -> Option<f64>;

/// A plot over a series: name, title, label, and the curves with their names.
pub(super) type SeriesPlot =
    (&'static str, &'static str, &'static str, &'static [(&'static str, Pick)]);

pub(super) const OVER_A_SERIES: [SeriesPlot; 6] = [
    ("stress_ratio", "Stress ratio", "q / p", &[("", |s| s.q_over_p)]),
    (
        "volumetric_strain",
        "Volumetric strain",
        "volumetric strain (%)",
        &[("", |s| s.volumetric_strain.map(|e| 100.0 * e))],
    ),
    ("mean_stress", "Stress", "stress (Pa)", &[("p", |s| s.p_pa), ("q", |s| s.q_pa)]),
    ("solid_fraction", "Solid fraction", "solid fraction", &[("", |s| s.solid_fraction)]),
    (
        "mean_coordination",
        "Coordination number",
        "contacts per particle",
        &[("mean", |s| s.coordination), ("mechanical", |s| s.mechanical_coordination)],
    ),
    (
        "anisotropy",
        "Anisotropy of normals, normal and shear forces",
        "degree of anisotropy",
        &[("a_c", |s| s.a_c), ("a_n", |s| s.a_n), ("a_t", |s| s.a_t)],
    ),
];

/// Horizontal axis of plots over a series.
pub(super) struct Along {
    pub(super) label: &'static str,
    pub(super) words: &'static str,
    /// Value that must differ from zero in a snapshot.
    value: Pick,
    /// Value on the axis.
    pub(super) x: Pick,
}

/// Horizontal axes, best first; every series has the last.
pub(super) const ALONG: [Along; 3] = [
    Along {
        label: "shear strain",
        words: "shear strain",
        value: |s| s.shear_strain,
        // The first snapshot has no shear strain.
        x: |s| Some(s.shear_strain.unwrap_or_default()),
    },
    Along {
        label: "axial strain (%)",
        words: "axial strain",
        value: |s| s.axial_strain,
        x: |s| s.axial_strain.map(|strain| 100.0 * strain),
    },
    Along { label: "time (s)", words: "time", value: |_| Some(1.0), x: |s| Some(s.time_s) },
];

impl Along {
    /// Whether a series can be drawn along this axis.
    pub(super) fn fits(&self, reports: &[Report]) -> bool {
        reports.iter().any(|r| (self.value)(&r.summary).is_some_and(|value| value.abs() > 1e-9))
    }
}

/// Stress, strain, density, coordination and anisotropy over a series of snapshots (fig. 10 of Lai et al. 2021). They are drawn
/// against the shear strain if the packing is sheared, otherwise against axial strain if it is strained, otherwise against time.
///
/// # Errors
/// See [`PlotError`].
pub fn series(reports: &[Report]) -> Result<Vec<Plot>, PlotError> {
    let Some(along) = ALONG.iter().find(|along| along.fits(reports)) else { return Ok(Vec::new()) };
    let mut plots = Vec::new();
    for (name, title, y_label, picks) in OVER_A_SERIES {
        let of_one = |(&(curve, pick), colour): (&(&str, Pick), RGBColor)| {
            let points = reports.iter().filter_map(|r| (along.x)(&r.summary).zip(pick(&r.summary)));
            (curve.to_owned(), colour, points.collect())
        };
        let curves = picks.iter().zip([BLUE, ORANGE, VERMILION]).map(of_one).collect();
        let svg = of_snapshots(along.label, y_label, curves)?;
        plots.extend(svg.map(|svg| Plot {
            name: name.into(),
            title: title.into(),
            caption: format!("{title} of each snapshot against {}.", along.words),
            width: Width::Half,
            svg,
        }));
    }
    Ok(plots)
}

/// A curve with its name and colour.
pub(super) type Coloured = (String, RGBColor, Vec<(f64, f64)>);

/// Chart of curves through dots; `None` without points.
pub(super) fn of_snapshots(
    x_label: &str,
    y_label: &str,
    curves: Vec<Coloured>,
) -> Result<Option<String>, PlotError> {
    let mut series = Vec::new();
    for (name, colour, points) in curves {
        let line = Series { name, colour, mark: Mark::Line, points };
        let dots =
            Series { name: String::new(), mark: Mark::Dots, points: line.points.clone(), ..line };
        series.extend([line, dots]);
    }
    let points = || series.iter().flat_map(|s| &s.points);
    if points().count() == 0 {
        return Ok(None);
    }
    let (x, y) = (span(points().map(|p| p.0)), span(points().map(|p| p.1)));
    chart(SIZE, &linear(x_label, y_label, x, y), &series).map(Some)
}
