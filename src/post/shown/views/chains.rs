//! Force chains: the strongest contacts as lines, wider for larger forces.

use crate::math::Vec3;
use crate::post::plots::{Plot, Width};
use crate::post::region::Bounds;
use crate::post::report::readable;
use crate::post::shown::side::Side;
use crate::post::shown::walls::Walls;
use std::fmt::Write;

/// The strongest contacts.
#[derive(Clone, Debug)]
pub(super) struct Chains {
    /// Approximate diameter of a particle [m].
    diameter: f64,
    lines: Vec<Line>,
    /// Sum of all forces [N], and number of contacts.
    sum: (f64, u64),
}

#[derive(Clone, Copy, Debug)]
struct Line {
    /// x and z of both ends [m].
    ends: [[f64; 2]; 2],
    /// Normal force [N].
    force: f64,
}

impl Chains {
    /// Largest number of lines drawn.
    const LIMIT: usize = 4000;

    /// Limits of the width of the widest line [px], which is proportional to the size of the
    /// particles.
    const WIDEST: [f64; 2] = [1.5, 6.0];

    /// No contacts yet; particles have about this diameter [m].
    pub(super) fn new(diameter: f64) -> Self {
        Self { diameter, lines: Vec::new(), sum: (0.0, 0) }
    }

    pub(super) fn add(&mut self, centre: &Vec3, branch: &Vec3, force: f64) {
        self.sum.0 += force;
        self.sum.1 += 1;
        let other = centre + branch;
        self.lines.push(Line { ends: [[centre.x, centre.z], [other.x, other.z]], force });
        if self.lines.len() >= 2 * Self::LIMIT {
            self.keep_strongest();
        }
    }

    /// Keeps the strongest contacts, in descending order. The sort is stable: of equal ones the
    /// first stay.
    fn keep_strongest(&mut self) {
        self.lines.sort_by(|one, other| other.force.total_cmp(&one.force));
        self.lines.truncate(Self::LIMIT);
    }

    pub(super) fn plot(&self, bounds: &Bounds, walls: &Walls) -> Option<Plot> {
        let mut chains = self.clone();
        chains.keep_strongest();
        let strongest = chains.lines.first()?.force;
        let mean = self.sum.0 / self.sum.1 as f64;
        if !(strongest > 0.0 && strongest.is_finite()) {
            return None;
        }
        let side = Side::around(bounds, walls);
        let mut svg = String::new();
        side.open(bounds, walls, &mut svg);
        svg.push_str("<g stroke-linecap=\"round\">\n");
        // The strongest two in a hundred have the full width.
        let full = chains.lines[chains.lines.len() / 50].force;
        // A quarter of a particle, so that chains in front leave those behind visible.
        let [narrow, wide] = Self::WIDEST;
        let widest = (0.25 * self.diameter * side.scale).max(narrow).min(wide);
        for line in chains.lines.iter().rev().filter(|line| line.force > 0.0) {
            let [[x0, y0], [x1, y1]] = line.ends.map(|[x, z]| side.place(x, z));
            let width = widest * (line.force / full).min(1.0);
            let colour = if line.force >= mean { "#0072B2" } else { "#A9B2BC" };
            let _ = writeln!(
                svg,
                r#"<path d="M{x0:.1} {y0:.1}L{x1:.1} {y1:.1}" stroke="{colour}" stroke-width="{:.2}"/>"#,
                width.max(0.3)
            );
        }
        svg.push_str("</g>\n");
        let words = format!("mean {} N, strongest {} N", readable(mean), readable(strongest));
        side.close(&words, &mut svg);
        let left_out = match self.sum.1 as usize {
            all if all > Self::LIMIT => format!(", the {} strongest of {all}", Self::LIMIT),
            _ => String::new(),
        };
        Some(Plot {
            name: "force_chains".into(),
            title: "Force chains".into(),
            caption: format!(
                "Side view: one line per contact{left_out}, width proportional to the normal force; blue above the \
                 mean."
            ),
            width: Width::Half,
            svg,
        })
    }
}
