//! Tables as SVG plots.

use super::table::{Table, general};
use anyhow::{Context, Result};
use std::fmt::Write;

/// Plot of a column over another, with a line for each value of a third.
#[derive(Clone, Copy, Debug)]
pub struct Plot<'a> {
    /// Column of the horizontal axis.
    pub x: &'a str,
    /// Column of the vertical axis; with a column `y_deviation` each point has an error bar of this length on either
    /// side.
    pub y: &'a str,
    /// Column whose values distinguish the lines.
    pub by: &'a str,
    /// Range of the vertical axis.
    pub range: [f64; 2],
    /// Interval of the labels of a linear horizontal axis, without marks at the points; otherwise the axis is
    /// logarithmic, with labels at the points.
    pub curve: Option<f64>,
}

const SIZE: [f64; 2] = [560.0, 360.0];
const LEFT: f64 = 70.0;
const RIGHT: f64 = 540.0;
const TOP: f64 = 36.0;
const BOTTOM: f64 = 310.0;
const COLOURS: [&str; 4] = ["#0072B2", "#E69F00", "#009E73", "#D55E00"];

impl Plot<'_> {
    /// Plot of a table.
    ///
    /// # Errors
    /// If a column is missing, or a cell is not a number.
    pub fn svg(&self, table: &Table) -> Result<String> {
        let numbers = |name: &str| -> Result<Vec<f64>> {
            let cells = table.numbers(name)?.into_iter().collect::<Option<Vec<f64>>>();
            cells.with_context(|| format!("{name}: a cell without a number"))
        };
        let (xs, ys) = (numbers(self.x)?, numbers(self.y)?);
        let deviation = format!("{}_deviation", self.y);
        let deviations =
            if table.at(&deviation).is_ok() { numbers(&deviation)? } else { vec![0.0; xs.len()] };
        let labels: Vec<&str> = table.column(self.x)?.collect();
        let mut groups: Vec<(&str, Vec<usize>)> = Vec::new();
        for (row, name) in table.column(self.by)?.enumerate() {
            match groups.iter_mut().find(|(known, _)| *known == name) {
                Some((_, rows)) => rows.push(row),
                None => groups.push((name, vec![row])),
            }
        }
        let first = xs.iter().copied().fold(f64::INFINITY, f64::min);
        let last = xs.iter().copied().fold(0.0, f64::max);
        let ticks: Vec<(f64, String)> = if let Some(every) = self.curve {
            let multiples = (0..=(last / every) as u32).map(|k| f64::from(k) * every);
            multiples.map(|x| (x, general(x, 6))).collect()
        } else {
            let rows = groups.first().into_iter().flat_map(|(_, rows)| rows);
            rows.map(|&row| (xs[row], labels[row].to_owned())).collect()
        };
        let share = |x: f64| match self.curve {
            Some(_) => (x - first) / (last - first),
            None => (x / first).ln() / (last / first).ln(),
        };
        let across = |x: f64| LEFT + 12.0 + (RIGHT - LEFT - 24.0) * share(x);
        let [low, high] = self.range;
        let up = |y: f64| BOTTOM - (BOTTOM - TOP) * (y - low) / (high - low);

        let mut svg = Svg(String::new());
        svg.begin();
        for k in 0..=5 {
            let value = low + f64::from(k) * (high - low) / 5.0;
            svg.line([LEFT, up(value)], [RIGHT, up(value)], "#E3E7EB");
            svg.words(&general(value, 4), LEFT - 8.0, up(value) + 4.0, "end");
        }
        for (x, label) in ticks {
            svg.line([across(x), BOTTOM], [across(x), BOTTOM + 5.0], "#5B6672");
            svg.words(&label, across(x), BOTTOM + 19.0, "middle");
        }
        svg.line([LEFT, BOTTOM], [RIGHT, BOTTOM], "#5B6672");
        let [x, y, by] = [self.x, self.y, self.by].map(|name| name.replace('_', " "));
        svg.words(&x, 0.5 * (LEFT + RIGHT), SIZE[1] - 8.0, "middle");
        svg.up_the_axis(&y);
        for (k, (name, rows)) in groups.iter().enumerate() {
            let colour = COLOURS.get(k).copied().unwrap_or_default();
            svg.polyline(rows.iter().map(|&row| [across(xs[row]), up(ys[row])]), colour);
            for &row in rows.iter().filter(|&&row| deviations[row] > 0.0) {
                let (x, y, deviation) = (across(xs[row]), ys[row], deviations[row]);
                svg.line([x, up(y - deviation)], [x, up(y + deviation)], colour);
            }
            for &row in rows.iter().filter(|_| self.curve.is_none()) {
                svg.circle(across(xs[row]), up(ys[row]), colour);
            }
            svg.legend(k, &format!("{by} {name}"), colour);
        }
        Ok(svg.0 + "</svg>\n")
    }
}

struct Svg(String);

impl Svg {
    fn begin(&mut self) {
        let [width, height] = SIZE;
        let _ = writeln!(
            self.0,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" font-family=\"sans-serif\" font-size=\"12\" fill=\"#1F2933\">\n\
             <rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>"
        );
    }

    fn words(&mut self, text: &str, x: f64, y: f64, anchor: &str) {
        let _ =
            writeln!(self.0, r#"<text x="{x:.1}" y="{y:.1}" text-anchor="{anchor}">{text}</text>"#);
    }

    fn up_the_axis(&mut self, text: &str) {
        let middle = 0.5 * (TOP + BOTTOM);
        let _ = writeln!(
            self.0,
            r#"<text transform="translate(20 {middle}) rotate(-90)" text-anchor="middle">{text}</text>"#
        );
    }

    fn line(&mut self, [x1, y1]: [f64; 2], [x2, y2]: [f64; 2], stroke: &str) {
        let _ = writeln!(
            self.0,
            r#"<line x1="{x1:.1}" y1="{y1:.1}" x2="{x2:.1}" y2="{y2:.1}" stroke="{stroke}"/>"#
        );
    }

    fn polyline(&mut self, points: impl Iterator<Item = [f64; 2]>, stroke: &str) {
        let _ = write!(
            self.0,
            r#"<polyline fill="none" stroke="{stroke}" stroke-width="1.5" points=""#
        );
        for [x, y] in points {
            let _ = write!(self.0, "{x:.1},{y:.1} ");
        }
        self.0.push_str("\"/>\n");
    }

    fn circle(&mut self, x: f64, y: f64, fill: &str) {
        let _ = writeln!(self.0, r#"<circle cx="{x:.1}" cy="{y:.1}" r="3" fill="{fill}"/>"#);
    }

    fn legend(&mut self, k: usize, text: &str, fill: &str) {
        let left = LEFT + 130.0 * k as f64;
        let _ =
            writeln!(self.0, r#"<rect x="{left}" y="14" width="10" height="10" fill="{fill}"/>"#);
        self.words(text, left + 15.0, 23.0, "start");
    }
}
