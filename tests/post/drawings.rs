//! Drawings are read back like by a viewer. Ticks give the scale of an axis, the legend gives the meaning of a colour, and the drawn values must
//! be the input.

use super::fabric::contacts_with;
use super::plots::views;
use super::region::add_wall;
use crate::support::packings::{Snapshot, ellipsoids, header, particles_at, plane_row};
use crate::support::random::Draw;
use dem_mpi::math::{Quat, Vec3};
use dem_mpi::output::tables::ContactTable;
use dem_mpi::post::draw::{Axes, BLUE, GREEN, Mark, ORANGE, SIZE, Series, chart, linear};
use dem_mpi::post::fabric::Rose;
use dem_mpi::post::history::History;
use dem_mpi::post::picture::side_by_side;
use dem_mpi::post::region::Bounds;
use dem_mpi::post::{Report, Settings, panels, plots, rose};
use dem_mpi::random::Random;
use dem_mpi::shape::triangle_mesh::TriangleMesh;
use dem_mpi::walls::Wall;
use std::fmt::Write;

const BLUE_OF_SVG: &str = "#0072B2";
const ORANGE_OF_SVG: &str = "#E69F00";
const VERMILION_OF_SVG: &str = "#D55E00";
const GREEN_OF_SVG: &str = "#009E73";

/// An element of a drawing with its text.
struct Element<'a> {
    tag: &'a str,
    line: &'a str,
    text: &'a str,
}

impl<'a> Element<'a> {
    fn attribute(&self, name: &str) -> &'a str {
        let (_, rest) = self.line.split_once(&format!(" {name}=\"")).unwrap_or(("", ""));
        rest.split('"').next().unwrap_or("")
    }

    fn number(&self, name: &str) -> f64 {
        self.attribute(name).parse().unwrap_or_else(|_| panic!("{name} of {}", self.line))
    }

    /// Corners of a line or an area.
    fn points(&self) -> Vec<(f64, f64)> {
        let pair = |pair: &str| {
            let (x, y) = pair.split_once(',').unwrap();
            (x.parse().unwrap(), y.parse().unwrap())
        };
        self.attribute("points").split_whitespace().map(pair).collect()
    }
}

fn element(part: &str) -> Option<Element<'_>> {
    let (line, text) = part.split_once('>')?;
    Some(Element { tag: line.split([' ', '/']).next()?, line, text: text.trim() })
}

fn elements(svg: &str) -> Vec<Element<'_>> {
    svg.split('<').filter(|part| !part.starts_with('/')).filter_map(element).collect()
}

/// Parses the number in a label.
fn label(text: &str) -> f64 {
    let raised = |text: &str| -> i32 {
        let digits = "⁰¹²³⁴⁵⁶⁷⁸⁹";
        let digit = |c: char| {
            digits.chars().position(|other| other == c).map_or('-', |d| char::from(b'0' + d as u8))
        };
        text.chars().map(digit).collect::<String>().parse().unwrap()
    };
    match (text.split_once("·10"), text.strip_prefix("10")) {
        (Some((mantissa, power)), _) => {
            mantissa.parse::<f64>().unwrap() * 10f64.powi(raised(power))
        }
        (None, Some(power)) if !power.is_empty() && !power.starts_with(|c: char| c.is_ascii()) => {
            10f64.powi(raised(power))
        }
        _ => text.parse().unwrap(),
    }
}

/// An axis: pixel positions and values of two ticks.
struct Scale {
    ticks: [(f64, f64); 2],
    is_logarithmic: bool,
}

impl Scale {
    fn of(labels: &[(f64, &str)]) -> Self {
        let is_logarithmic = labels.iter().all(|(_, text)| {
            text.strip_prefix("10").is_some_and(|power| !power.is_empty() && !power.is_ascii())
        });
        let tick = |&(at, text): &(f64, &str)| {
            let value = label(text);
            (at, if is_logarithmic { value.log10() } else { value })
        };
        let ticks = [tick(&labels[0]), tick(&labels[labels.len() - 1])];
        assert!(ticks[0].0 != ticks[1].0, "two ticks");
        Self { ticks, is_logarithmic }
    }

    fn value(&self, at: f64) -> f64 {
        let [(first, low), (last, high)] = self.ticks;
        let value = low + (at - first) / (last - first) * (high - low);
        if self.is_logarithmic { 10f64.powf(value) } else { value }
    }

    /// Largest error of a value, from the rounding of positions.
    fn tolerance(&self, value: f64) -> f64 {
        let [(first, low), (last, high)] = self.ticks;
        let per_unit = 2.0 * ((high - low) / (last - first)).abs();
        if self.is_logarithmic { value.abs() * (10f64.powf(per_unit) - 1.0) } else { per_unit }
    }
}

/// The contents of a chart, read back.
struct Chart {
    x: Scale,
    y: Scale,
    labels: Vec<String>,
    /// Colours by the names of the legend.
    legend: Vec<(String, String)>,
    lines: Vec<(String, Vec<(f64, f64)>)>,
    dots: Vec<(String, (f64, f64))>,
    /// Colour with start, end and height of each bar.
    bars: Vec<(String, [f64; 3])>,
}

impl Chart {
    fn read(svg: &str) -> Self {
        let all = elements(svg);
        let texts = |anchor: &str| -> Vec<(f64, f64, &str)> {
            let of = all.iter().filter(|e| e.tag == "text" && e.attribute("anchor") != "none");
            of.filter(|e| e.line.contains(&format!("text-anchor=\"{anchor}\"")))
                .filter(|e| e.line.contains("font-size=\"96\""))
                .map(|e| (e.number("x"), e.number("y"), e.text))
                .collect()
        };
        let [along, up] = ["middle", "end"].map(texts);
        let x = Scale::of(&along.iter().map(|&(x, _, text)| (x, text)).collect::<Vec<_>>());
        let y = Scale::of(&up.iter().map(|&(_, y, text)| (y, text)).collect::<Vec<_>>());
        let value = |(at, above): (f64, f64)| (x.value(at), y.value(above));
        let (mut legend, mut lines) = (Vec::new(), Vec::new());
        let (mut dots, mut bars, mut in_chart) = (Vec::new(), Vec::new(), false);
        for (element, next) in all.iter().zip(all.iter().skip(1).map(Some).chain([None])) {
            let fill = element.attribute("fill").to_owned();
            in_chart |= element.tag == "line";
            match element.tag {
                "rect" if !in_chart && fill != "#FFFFFF" => {
                    legend.push((next.expect("a name follows").text.to_owned(), fill));
                }
                "rect" if in_chart => {
                    let [left, top, wide, tall] =
                        ["x", "y", "width", "height"].map(|name| element.number(name));
                    let (from, high) = value((left, top));
                    let (to, low) = value((left + wide, top + tall));
                    assert!(low.abs() <= 2.0 * y.tolerance(0.0), "bars begin at 0: {low}");
                    bars.push((fill, [from, to, high]));
                }
                "circle" => {
                    dots.push((fill, value((element.number("cx"), element.number("cy")))));
                }
                // Axes have thinner lines.
                "polyline" if element.attribute("stroke-width") == "12" => {
                    let points = element.points().into_iter().map(value).collect();
                    lines.push((element.attribute("stroke").to_owned(), points));
                }
                _ => {}
            }
        }
        let labels = all.iter().map(|e| e.text.to_owned()).collect();
        Self { x, y, labels, legend, lines, dots, bars }
    }

    /// Checks that the line of this colour has these points.
    fn has_line(&self, colour: &str, points: &[(f64, f64)]) {
        let (_, found) = self.lines.iter().find(|(of, _)| of == colour).expect("a line");
        self.are(found, points);
    }

    fn has_dots(&self, colour: &str, points: &[(f64, f64)]) {
        let of = self.dots.iter().filter(|(of, _)| of == colour);
        self.are(&of.map(|(_, at)| *at).collect::<Vec<_>>(), points);
    }

    fn are(&self, found: &[(f64, f64)], expected: &[(f64, f64)]) {
        assert_eq!(found.len(), expected.len(), "{found:?} {expected:?}");
        for (found, expected) in found.iter().zip(expected) {
            let off = [(found.0 - expected.0).abs(), (found.1 - expected.1).abs()];
            let most = [self.x.tolerance(expected.0), self.y.tolerance(expected.1)];
            assert!(off[0] <= most[0] && off[1] <= most[1], "{found:?} {expected:?}: {most:?}");
        }
    }

    fn colour_of(&self, name: &str) -> &str {
        let found = self.legend.iter().find(|(of, _)| of == name);
        &found.unwrap_or_else(|| panic!("{name} in {:?}", self.legend)).1
    }
}

#[test]
fn charts_show_what_they_are_given() {
    let series = |name: &str, colour, mark, points: &[(f64, f64)]| Series {
        name: name.into(),
        colour,
        mark,
        points: points.to_vec(),
    };
    let rising = [(0.5, 0.03), (2.0, 0.4), (3.5, 7.0), (7.0, 55.0)];
    let falling = [(0.6, 80.0), (1.0, 9.0), (5.0, 0.02)];
    for (log_x, log_y) in [(false, false), (false, true), (true, false), (true, true)] {
        let ranges = [
            if log_x { 0.1..10.0 } else { 0.0..8.0 },
            if log_y { 0.01..100.0 } else { 0.0..100.0 },
        ];
        let [x, y] = ranges;
        let axes = Axes { log_x, log_y, ..linear("way (m)", "force (N)", x, y) };
        let all = [
            series("rising", BLUE, Mark::Line, &rising),
            series("falling", ORANGE, Mark::Dots, &falling),
            series("", GREEN, Mark::Rule, &[(4.0, 0.0)]),
        ];
        let chart = Chart::read(&chart(SIZE, &axes, &all).unwrap());
        assert_eq!([chart.x.is_logarithmic, chart.y.is_logarithmic], [log_x, log_y]);
        chart.has_line(BLUE_OF_SVG, &rising);
        chart.has_dots(ORANGE_OF_SVG, &falling);
        let (low, high) = if log_y { (0.01, 100.0) } else { (0.0, 100.0) };
        chart.has_line(GREEN_OF_SVG, &[(4.0, low), (4.0, high)]);
        assert_eq!(chart.colour_of("rising"), BLUE_OF_SVG);
        assert_eq!(chart.colour_of("falling"), ORANGE_OF_SVG);
        assert_eq!(chart.legend.len(), 2);
        assert!(
            ["way (m)", "force (N)"].iter().all(|l| chart.labels.iter().any(|other| other == l))
        );
    }
    // Points show their values, also those of a bar; lines across a chart and crowded charts do not.
    let (axes, many) =
        (linear("way (m)", "force (N)", 0.0..8.0, 0.0..100.0), vec![(1.0, 2.0); 501]);
    let one = chart(SIZE, &axes, &[series("up", BLUE, Mark::Line, &rising)]).unwrap();
    let titles: Vec<&str> =
        elements(&one).iter().filter(|e| e.tag == "title").map(|e| e.text).collect();
    assert_eq!(titles.len(), 4);
    assert_eq!(titles[1], "up: way (m) 2.000, force (N) 0.4000");
    let circles = Chart::read(&one).dots;
    for ((_, found), expected) in circles.iter().zip(rising) {
        Chart::read(&one).are(&[*found], &[expected]);
    }
    for unmarked in [series("", BLUE, Mark::Line, &many), series("", BLUE, Mark::Rule, &rising)] {
        assert!(!chart(SIZE, &axes, &[unmarked]).unwrap().contains("<title>"));
    }
    let bars = series("", BLUE, Mark::Bars(0.5, 0.25), &[(1.0, 3.0), (2.0, 8.0)]);
    let drawn = Chart::read(&chart(SIZE, &linear("x", "y", 0.0..4.0, 0.0..10.0), &[bars]).unwrap());
    let expected = [[1.0, 1.5, 3.0], [2.0, 2.5, 8.0]];
    assert_eq!(drawn.bars.len(), 2);
    for ((_, found), expected) in drawn.bars.iter().zip(expected) {
        drawn.are(
            &[(found[0], found[2]), (found[1], found[2])],
            &[(expected[0], expected[2]), (expected[1], expected[2])],
        );
    }
}

/// Energies by decade, loads along the normals of walls, displacements inwards.
#[test]
fn histories_are_drawn_to_scale() {
    let wall = |name: &str, normal| plane_row(name, Vec3::zeros(), normal);
    let walls = [wall("low", Vec3::x()), wall("high", -Vec3::x())];
    let mut table = "time_s,kinetic_J,stored_J,missing_J,top_m,place_low_m,place_high_m,\
                     force_low_x_N,force_low_y_N,force_low_z_N\n"
        .to_owned();
    let rows = [
        [0.0, 2e-3, 0.0, 0.0, 0.3, 0.1, 0.9, -4.0, 9.0, 9.0],
        [0.4, 5e-2, 3e-4, -2e-5, 0.25, 0.15, 0.9, -6.5, 9.0, 9.0],
        [1.0, 1e-4, 8e-3, 6e-4, 0.2, 0.15, 0.7, 1.5, 9.0, 9.0],
    ];
    for row in rows {
        let row = row.map(|number| format!("{number:e}"));
        writeln!(table, "{}", row.join(",")).unwrap();
    }
    let drawn = panels::panels(&History::read(table.as_bytes()).unwrap(), &walls, &[]).unwrap();
    let chart = |name: &str| {
        Chart::read(&drawn.iter().find(|plot| plot.name == format!("history_{name}")).unwrap().svg)
    };
    let column = |k: usize| rows.map(|row| (row[0], row[k]));
    let energy = chart("energy");
    assert!(energy.y.is_logarithmic && !energy.x.is_logarithmic);
    energy.has_line(energy.colour_of("kinetic"), &column(1));
    energy.has_line(energy.colour_of("stored"), &column(2)[1..]);
    energy.has_line(energy.colour_of("|missing|"), &column(3).map(|(t, e)| (t, e.abs()))[1..]);
    let top = chart("top");
    assert!(!top.y.is_logarithmic && top.labels.contains(&"z (m)".to_owned()));
    top.has_line(BLUE_OF_SVG, &column(4));
    let ways = chart("wall_ways");
    ways.has_line(ways.colour_of("low"), &[(0.0, 0.0), (0.4, 0.05), (1.0, 0.05)]);
    ways.has_line(ways.colour_of("high"), &[(0.0, 0.0), (0.4, 0.0), (1.0, 0.2)]);
    let loads = chart("wall_loads");
    loads.has_line(loads.colour_of("low"), &[(0.0, 4.0), (0.4, 6.5), (1.0, -1.5)]);
}

/// Bars and dots count the contacts in their interval of force.
#[test]
fn distributions_count_contacts() {
    let mut dice = Random::of(20, 3);
    let forces: Vec<(f64, Vec3)> = (0..400)
        .map(|_| {
            let normal = -(1.0 - dice.unit()).ln();
            (normal, Vec3::z() * (0.5 * normal * dice.unit()))
        })
        .collect();
    let (_, contacts) = contacts_with(&vec![Vec3::x(); forces.len()], &forces);
    let particles = particles_at(vec![Vec3::zeros(), Vec3::repeat(0.2)]);
    let header = header(Vec3::zeros(), Vec3::repeat(1.0), false, Vec3::repeat(0.1), 2);
    let found = Snapshot { header, particles, contacts }.report().forces.unwrap();
    let mean = forces.iter().map(|(force, _)| force).sum::<f64>() / 400.0;
    let share = |[low, high]: [f64; 2], of: &dyn Fn(&(f64, Vec3)) -> f64| {
        forces.iter().filter(|force| (low..high).contains(&of(force))).count() as f64 / 400.0
    };
    let used = |(force, shear): &(f64, Vec3)| shear.norm() / force;
    let friction = Chart::read(&plots::friction(&found.friction_used).unwrap().svg);
    let mut counted = 0.0;
    for (colour, [from, to, high]) in friction.bars.iter().filter(|(_, [.., high])| *high > 0.1) {
        let middle = 0.5 * (from + to);
        let bin = |edges: &&[f64]| edges[0] <= middle && middle < edges[1];
        let edges = found.friction_used.edges.windows(2).find(bin).expect("a bin");
        assert!(
            (middle - 0.5 * (edges[0] + edges[1])).abs() < friction.x.tolerance(0.0),
            "{middle} {edges:?}"
        );
        let share = 100.0 * share([edges[0], edges[1]], &used);
        assert!((high - share).abs() < friction.y.tolerance(*high), "{edges:?}: {high} {share}");
        assert_eq!(colour, BLUE_OF_SVG);
        counted += high;
    }
    assert!((counted - 100.0).abs() < 1.0, "{counted}");

    let packing = ellipsoids(5, 8).report().coordination;
    let drawn = Chart::read(&plots::coordination(&packing).unwrap().svg);
    let mut all = 0.0;
    for (_, [from, to, high]) in drawn.bars.iter().filter(|(colour, _)| colour == BLUE_OF_SVG) {
        let count = (0.5 * (from + to)).round() as usize;
        let share =
            100.0 * packing.without_walls.shares().nth(count).expect("a number of contacts");
        assert!((high - share).abs() < drawn.y.tolerance(*high), "{count}: {high} {share}");
        all += high;
    }
    assert!((all - 100.0).abs() < 2.0, "{all}");

    let plot = plots::force_distribution(&found.normal, &found.shear).unwrap();
    let densities = Chart::read(&plot.svg);
    assert!(densities.y.is_logarithmic && !densities.x.is_logarithmic);
    let width = found.normal.edges[1] - found.normal.edges[0];
    let normal = |(force, _): &(f64, Vec3)| force / mean;
    let shear = |(_, shear): &(f64, Vec3)| shear.norm() / mean;
    for (name, of) in [("normal", &normal as &dyn Fn(&(f64, Vec3)) -> f64), ("tangential", &shear)]
    {
        let colour = densities.colour_of(name);
        let dots: Vec<_> = densities.dots.iter().filter(|(of, _)| of == colour).collect();
        assert!(dots.len() > 3, "{name}");
        for (_, (x, y)) in dots {
            let middle = ((x / width - 0.5).round() + 0.5) * width;
            assert!((x - middle).abs() < densities.x.tolerance(0.0), "{x} {middle}");
            let share = share([middle - 0.5 * width, middle + 0.5 * width], of);
            assert!(
                (share / width / y - 1.0).abs() < 0.02,
                "{name} at {x}: {y}, {}",
                share / width
            );
        }
    }
}

/// Curves over a series have the numbers of the summaries.
#[test]
fn series_are_drawn_to_scale() {
    let report = |time: f64, scale: f64| -> Report {
        let forces =
            [(scale, Vec3::z() * (0.2 * scale)), (2.0, Vec3::zeros()), (1.0, Vec3::zeros())];
        let (_, contacts) = contacts_with(&[Vec3::x(), Vec3::y(), Vec3::z()], &forces);
        let mut header = header(Vec3::zeros(), Vec3::repeat(1.0), false, Vec3::repeat(0.1), 2);
        header.time = time;
        let particles = particles_at(vec![Vec3::zeros(), Vec3::repeat(0.2)]);
        Snapshot { header, particles, contacts }.report()
    };
    let reports = [report(0.1, 1.0), report(0.4, 5.0), report(0.5, 3.0)];
    let drawn = plots::series(&reports).unwrap();
    let chart = |name: &str| {
        Chart::read(&drawn.iter().find(|plot| plot.name == name).expect("it is drawn").svg)
    };
    let points = |pick: &dyn Fn(&Report) -> Option<f64>| {
        reports.iter().map(|r| (r.summary.time_s, pick(r).unwrap())).collect::<Vec<_>>()
    };
    let stress = chart("mean_stress");
    for (name, pick) in [
        ("p", &(|r: &Report| r.summary.p_pa) as &dyn Fn(&Report) -> Option<f64>),
        ("q", &|r: &Report| r.summary.q_pa),
    ] {
        stress.has_line(stress.colour_of(name), &points(pick));
        stress.has_dots(stress.colour_of(name), &points(pick));
    }
    let ratio = chart("stress_ratio");
    ratio.has_line(BLUE_OF_SVG, &points(&|r: &Report| r.summary.q_over_p));
    assert!(ratio.labels.contains(&"time (s)".to_owned()));
}

/// Petals have the lengths given by the rings, in four quadrants. Shear forces towards the horizontal are orange.
#[test]
fn roses_are_drawn_to_scale() {
    let mut dice = Random::of(21, 0);
    let normals: Vec<Vec3> = (0..4000)
        .map(|_| {
            let normal = dice.direction();
            (normal + Vec3::z() * (0.8 * normal.z)).normalize()
        })
        .collect();
    let forces: Vec<(f64, Vec3)> = normals
        .iter()
        .map(|normal| {
            let meridian = (Vec3::z() - normal * normal.z).normalize() * normal.z.signum();
            (1.0 + normal.z * normal.z, meridian * (0.3 - 0.5 * normal.z.abs()))
        })
        .collect();
    let (_, contacts) = contacts_with(&normals, &forces);
    let header = header(Vec3::zeros(), Vec3::repeat(1.0), false, Vec3::repeat(0.1), 2);
    let particles = particles_at(vec![Vec3::zeros(), Vec3::repeat(0.2)]);
    let report = Snapshot { header, particles, contacts }.report();
    let forces_of = report.force_fabric.unwrap();
    let mean = forces_of.mean_force;
    let over = |bins: &[Option<f64>], by: f64| bins.iter().map(|b| b.unwrap() / by).collect();
    let Rose { density, normal_force, shear_force } = &report.rose;
    let expected: [(&str, Vec<f64>); 3] = [
        ("rose_normals", over(density, 1.0)),
        ("rose_normal_forces", over(normal_force, mean)),
        ("rose_shear_forces", over(shear_force, mean)),
    ];
    for (plot, (name, bins)) in rose::roses(&report).unwrap().iter().zip(expected) {
        assert_eq!(plot.name, name);
        let all = elements(&plot.svg);
        let rings: Vec<_> = all.iter().filter(|e| e.tag == "circle").collect();
        let centre = (rings[0].number("cx"), rings[0].number("cy"));
        let grey = |e: &&&Element| e.attribute("stroke") == "#E3E7EB";
        let radii: Vec<f64> = rings.iter().filter(grey).map(|e| e.number("r")).collect();
        let labels: Vec<f64> =
            (all.iter().filter(|e| e.tag == "text")).filter_map(|e| e.text.parse().ok()).collect();
        assert_eq!(radii.len(), labels.len(), "{labels:?}");
        let scale = radii[0] / labels[0];
        for (radius, label) in radii.iter().zip(&labels) {
            assert!((radius - scale * label).abs() < 2.0, "{radius} {label}");
        }
        // A separate ring marks the mean.
        let means: Vec<f64> = (rings.iter().filter(|e| e.attribute("stroke") == "#5B6672"))
            .map(|e| e.number("r"))
            .collect();
        if name == "rose_shear_forces" {
            assert!(means.is_empty());
        } else {
            assert!(means.len() == 1 && (means[0] - scale).abs() < 2.0, "{means:?} {scale}");
        }
        let petals: Vec<_> = all.iter().filter(|e| e.tag == "polygon").collect();
        assert_eq!(petals.len(), 4 * bins.len());
        for (k, petal) in petals.iter().enumerate() {
            let bin = bins[k % bins.len()];
            let colour = if bin < 0.0 { ORANGE_OF_SVG } else { BLUE_OF_SVG };
            assert_eq!(petal.attribute("fill"), colour, "{name} {k}: {bin}");
            let (right, up) = [(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0)][k / bins.len()];
            let from = (k % bins.len()) as f64 * Rose::STEP;
            let corners = petal.points();
            let farthest = [1, corners.len() - 1].map(|at| corners[at]);
            for ((x, y), angle) in farthest.into_iter().zip([from, from + Rose::STEP]) {
                let radius = bin.abs() * scale;
                let (along, above) = (right * radius * angle.sin(), up * radius * angle.cos());
                assert!((x - centre.0 - along).abs() < 2.0, "{name} {k}: {x} {along}");
                assert!((centre.1 - y - above).abs() < 2.0, "{name} {k}: {y} {above}");
            }
        }
        let fit = all.iter().find(|e| e.attribute("stroke") == VERMILION_OF_SVG).unwrap().points();
        for (k, (x, y)) in fit.iter().enumerate() {
            let angle = std::f64::consts::FRAC_PI_2 * k as f64 / (fit.len() - 1) as f64;
            let radius = match name {
                "rose_normals" => Rose::normal_fit(&report.fabric.unwrap().anisotropy(), angle),
                "rose_normal_forces" => Rose::normal_fit(&forces_of.normal_anisotropy, angle),
                _ => Rose::shear_fit(&forces_of.shear_anisotropy, angle),
            };
            let radius = scale * radius.abs();
            let (along, above) = (radius * angle.sin(), radius * angle.cos());
            assert!((x - centre.0 - along).abs() < 2.0, "{name} {k}: {x} {along}");
            assert!((centre.1 - y - above).abs() < 2.0, "{name} {k}: {y} {above}");
        }
    }
}

/// Picture of particles with positions, rotations about y [rad] and numbers of contacts.
fn pictured(semi_axes: Vec3, grains: &[(Vec3, f64, i32)], bounds: Option<&Bounds>) -> String {
    let high = Vec3::new(8.0, 4.0, 6.0);
    let mut snapshot = Snapshot {
        header: header(Vec3::zeros(), high, false, semi_axes, grains.len()),
        particles: particles_at(grains.iter().map(|grain| grain.0).collect()),
        contacts: ContactTable::default(),
    };
    let turn = |angle: f64| {
        let turn = Quat::from_axis_angle(&Vec3::y_axis(), angle);
        [turn.w, turn.i, turn.j, turn.k]
    };
    snapshot.particles.quaternion = grains.iter().map(|grain| turn(grain.1)).collect();
    snapshot.particles.coordination = grains.iter().map(|grain| grain.2).collect();
    snapshot.analyse(Settings::default()).unwrap().picture.svg(bounds)
}

/// Position, semi-axes [px], rotation [degrees] and fill of each ellipse.
fn ellipses(svg: &str) -> Vec<([f64; 5], String)> {
    let all = elements(svg);
    let ellipse = |e: &Element| {
        let place = e.attribute("transform").replace("translate(", "").replace(") rotate(", " ");
        let place: Vec<f64> =
            place.trim_end_matches(')').split(' ').map(|n| n.parse().unwrap()).collect();
        let numbers = [place[0], place[1], e.number("rx"), e.number("ry"), place[2]];
        (numbers, e.attribute("fill").to_owned())
    };
    all.iter().filter(|e| e.tag == "ellipse").map(ellipse).collect()
}

/// An ellipse has the position and inclination of its particle, and the nearest is drawn last. Tones follow the number of contacts, as in the
/// legend.
#[test]
fn pictures_show_grains_to_scale() {
    let bounds = Bounds { low: Vec3::zeros(), high: Vec3::new(8.0, 4.0, 6.0) };
    // A rotation about y by 0.5 lowers the long axis, which points along x, by 0.5.
    let grains = [
        (Vec3::new(2.0, 1.0, 4.5), 0.5, 0),
        (Vec3::new(5.0, 3.0, 1.5), -0.3, 5),
        (Vec3::new(6.0, 2.0, 4.0), 0.0, 13),
    ];
    let svg = pictured(Vec3::new(1.0, 0.5, 0.4), &grains, Some(&bounds));
    // 720 pixels are 8 m, with a border of 12.
    let scale = 90.0;
    let all = elements(&svg);
    let outline = all.iter().find(|e| e.tag == "rect" && e.attribute("fill") == "none").unwrap();
    let sides = ["x", "y", "width", "height"].map(|name| outline.number(name));
    assert_eq!(sides, [12.0, 12.0, 720.0, 540.0]);
    let drawn = ellipses(&svg);
    assert_eq!(drawn.len(), 3);
    let far_first = [1, 2, 0];
    for ((numbers, fill), k) in drawn.iter().zip(far_first) {
        let (place, turn, contacts) = grains[k];
        let expected = [
            12.0 + scale * place.x,
            12.0 + scale * (6.0 - place.z),
            scale,
            0.4 * scale,
            turn.to_degrees(),
        ];
        for (found, expected) in numbers.iter().zip(expected) {
            assert!((found - expected).abs() < 0.51, "{numbers:?} {expected:?}");
        }
        let tone = (contacts / 2).min(6);
        assert_eq!(fill, &format!("url(#tone{tone})"));
        let (low, high) = (2 * tone, 2 * tone + 1);
        let name = if tone == 6 { "12+".to_owned() } else { format!("{low}–{high}") };
        let at = all.iter().position(|e| e.tag == "circle" && e.attribute("fill") == fill).unwrap();
        assert_eq!(all[at + 1].text, name);
    }
    // More contacts have a darker tone, and all tones differ.
    let brightness = |k: usize| {
        let gradient = all.iter().position(|e| e.attribute("id") == format!("tone{k}")).unwrap();
        let colour = all[gradient + 1].attribute("stop-color");
        (0..3).map(|k| i64::from_str_radix(&colour[1 + 2 * k..3 + 2 * k], 16).unwrap()).sum::<i64>()
    };
    assert!((1..6).all(|k| brightness(k) > brightness(k + 1)));
    is_a_true_bar(&all, scale);
}

/// Checks that the scale bar has the length in its label.
fn is_a_true_bar(all: &[Element], scale: f64) {
    let at = all.iter().position(|e| e.tag == "polyline").expect("a bar");
    let numbers: Vec<f64> =
        all[at].attribute("points").split(' ').map(|n| n.parse().unwrap()).collect();
    let [least, most] =
        [f64::min, f64::max].map(|of| numbers.iter().step_by(2).copied().reduce(of).unwrap());
    let words = all[at + 1].text;
    let (number, unit) = words.split_once(' ').unwrap();
    let unit = [("m", 1.0), ("cm", 1e-2), ("mm", 1e-3), ("km", 1e3)]
        .into_iter()
        .find(|(name, _)| *name == unit)
        .unwrap()
        .1;
    let metres = label(number) * unit;
    assert!(((most - least) / scale - metres).abs() < 0.2 / scale, "{words}: {least} {most}");
}

#[test]
fn bars_are_as_long_as_they_say() {
    for (length, scale) in [(8.0, 52.5), (0.03, 14_000.0), (700.0, 0.6)] {
        let (low, high) = (Vec3::zeros(), Vec3::new(length, 1.0, 0.5 * length));
        let mut snapshot = Snapshot {
            header: header(low, high, false, Vec3::repeat(0.1 * length), 1),
            particles: particles_at(vec![Vec3::new(0.2 * length, 0.5, 0.2 * length)]),
            contacts: ContactTable::default(),
        };
        snapshot.particles.velocity = vec![Vec3::x()];
        let plots = views(&snapshot, &Bounds { low, high }).plots().unwrap();
        let field = plots.iter().find(|plot| plot.name == "velocity_field").expect("it moves");
        is_a_true_bar(&elements(&field.svg), scale);
    }
}

/// Adjacent pictures have one scale.
#[test]
fn pictures_side_by_side_have_one_scale() {
    let picture = |length: f64| {
        let places = vec![Vec3::new(0.25 * length, 0.0, 0.5), Vec3::new(0.75 * length, 0.0, 0.5)];
        let high = Vec3::new(length, 1.0, 1.0);
        let snapshot = Snapshot {
            header: header(Vec3::zeros(), high, false, Vec3::repeat(0.25), 2),
            particles: particles_at(places),
            contacts: ContactTable::default(),
        };
        let picture = snapshot.analyse(Settings::default()).unwrap().picture;
        (format!("{length} m"), picture, Some(Bounds { low: Vec3::zeros(), high }))
    };
    let svg = side_by_side(vec![picture(4.0), picture(9.0)]);
    let drawn = ellipses(&svg);
    // 720 pixels are 9 m.
    let distances = [drawn[0].0[0] - drawn[1].0[0], drawn[2].0[0] - drawn[3].0[0]];
    assert!((distances[0].abs() - 160.0).abs() < 0.2, "{distances:?}");
    assert!((distances[1].abs() - 360.0).abs() < 0.2, "{distances:?}");
    assert!(drawn.iter().all(|(numbers, _)| (numbers[2] - 20.0).abs() < 0.06), "{drawn:?}");
    let titles: Vec<_> = elements(&svg)
        .iter()
        .filter(|e| e.text.ends_with(" m") && e.attribute("font-size") == "14")
        .map(|e| e.text.to_owned())
        .collect();
    assert_eq!(titles, ["4 m", "9 m"]);
}

/// Ends of the drawn lines of walls [px].
fn walls_of(svg: &str) -> Vec<[f64; 4]> {
    let all = elements(svg);
    let drawn = all.iter().filter(|e| e.attribute("class") == "walls");
    let lines = drawn.flat_map(|e| e.attribute("d").split('M').skip(1));
    let line = |line: &str| {
        let numbers = line.split([' ', 'L']).map(|number| number.parse().unwrap());
        numbers.collect::<Vec<f64>>().try_into().unwrap()
    };
    lines.map(line).collect()
}

/// A ball with a wall, in a box that is smaller than the wall: the picture and the view of its velocities.
fn beside_a_wall(wall: &Wall, bounds: &Bounds) -> [String; 2] {
    let mut snapshot = Snapshot {
        header: header(Vec3::repeat(-0.5), Vec3::repeat(0.5), false, Vec3::repeat(1e-3), 1),
        particles: particles_at(vec![Vec3::new(0.0, 0.0, -5e-3)]),
        contacts: ContactTable::default(),
    };
    snapshot.particles.velocity = vec![Vec3::x()];
    add_wall(&mut snapshot.header, wall);
    let picture = snapshot.analyse(Settings::default()).unwrap().picture.svg(Some(bounds));
    let plots = views(&snapshot, bounds).plots().unwrap();
    let field = plots.into_iter().find(|plot| plot.name == "velocity_field").expect("it moves");
    [picture, field.svg]
}

/// Outlines of cylinders are at their places: a circle seen along the axis, else two sides and both rims.
#[test]
fn walls_are_drawn_where_they_are() {
    let cylinder = |half: Vec3| {
        let surface = TriangleMesh::of_revolution(&-half, &half, [0.01; 2]);
        Wall::of_mesh("drum".to_owned(), Vec3::zeros(), surface)
    };
    let bounds = Bounds { low: Vec3::repeat(-0.01), high: Vec3::new(0.01, 0.01, 0.0) };
    // 2 cm are 720 pixels beside 12, or 420 beside 14.
    let views = [(36_000.0, 372.0), (21_000.0, 224.0)];
    for (svg, (scale, middle)) in
        beside_a_wall(&cylinder(Vec3::y() * 0.03), &bounds).iter().zip(views)
    {
        let lines = walls_of(svg);
        assert!(lines.len() > 50, "{}", lines.len());
        let mut highest: f64 = 0.0;
        for [x, y] in lines.as_flattened().as_chunks::<2>().0 {
            assert!(((x - middle).hypot(y - middle) - 0.01 * scale).abs() < 0.1, "{x} {y}");
            highest = highest.max(middle - y);
        }
        assert!((highest - 0.01 * scale).abs() < 0.1, "the drawing reaches to the top: {highest}");
    }
    for (svg, (scale, middle)) in
        beside_a_wall(&cylinder(Vec3::z() * 0.008), &bounds).iter().zip(views)
    {
        // The drawing is 2 cm wide and 1.8 cm high.
        let [top, bottom] = [0.0, 0.016].map(|z| z * scale + middle - 0.01 * scale);
        let [left, right] = [-0.01, 0.01].map(|x| middle + x * scale);
        let near = |a: f64, b: f64| (a - b).abs() < 0.1;
        let mut sides = Vec::new();
        for [x0, y0, x1, y1] in walls_of(svg) {
            let is_rim = near(y0, y1) && (near(y0, top) || near(y0, bottom));
            if !is_rim {
                assert!(
                    near(x0, x1) && near((y1 - y0).abs(), 0.016 * scale),
                    "{x0} {y0} {x1} {y1}"
                );
                sides.push(x0);
            }
        }
        sides.sort_by(f64::total_cmp);
        assert!(sides.len() == 2 && near(sides[0], left) && near(sides[1], right), "{sides:?}");
    }
    // Two slanted planes of a trough meet at its bottom; a plane that faces the viewer is not a line.
    let planes = [Vec3::new(0.6, 0.0, 0.8), Vec3::new(-0.6, 0.0, 0.8), Vec3::new(0.0, 0.6, 0.8)];
    let planes = planes.map(|normal| (Vec3::z() * -8e-3, normal));
    let trough = Wall::of_planes("trough".to_owned(), Vec3::zeros(), &planes);
    let [svg, _] = beside_a_wall(&trough, &bounds);
    let scale = 36_000.0;
    let lines = walls_of(&svg);
    assert_eq!(lines.len(), 2);
    for [x0, y0, x1, y1] in lines {
        let at = |x: f64, y: f64| [x - 372.0, 12.0 - y].map(|pixels| pixels / scale);
        let mut ends = [at(x0, y0), at(x1, y1)];
        ends.sort_by(|a, b| a[1].total_cmp(&b[1]));
        let [low, high] = ends;
        assert!(low[0].abs() < 1e-5 && (low[1] + 8e-3).abs() < 1e-5, "{low:?}");
        assert!((high[1] - low[1] - 0.75 * high[0].abs()).abs() < 1e-5, "{high:?}");
    }
}
