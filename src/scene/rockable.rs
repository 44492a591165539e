//! Bodies of Rockable and exaDEM: name, radius, corners and faces of a convex one in a `.shp` file.
//!
//! A body stands between `<` and `>`. Words such as `name` and `radius` have their value behind them; `nv`, `ne` and `nf`
//! have the number of corners, edges and faces, then these (<https://github.com/richefeu/rockable>). The body is all that is
//! within the radius of the corners, edges and faces. Mass and inertia of the file are not read.

use crate::math::Vec3;
use crate::text::{self, shown};
use std::path::Path;
use std::str::FromStr;

/// Distance by which corners may be before a face, over the size of the body: digits of files.
const DIGITS: f64 = 1e-5;

/// A body of a file, in its units.
#[derive(Default)]
pub(super) struct Body<'a> {
    name: &'a str,
    pub(super) radius: f64,
    pub(super) corners: Vec<Vec3>,
    edges: usize,
    faces: Vec<Vec<usize>>,
}

/// Radius and corners of the body with this name, or of the only one of a file.
pub(super) fn body(path: &Path, name: &str) -> Result<(f64, Vec<Vec3>), String> {
    let text = text::read(path).map_err(|error| error.to_string())?;
    let mut bodies = bodies(&text)?;
    let named = bodies.iter().position(|body| body.name == name);
    let Some(index) = named.or((bodies.len() == 1).then_some(0)) else {
        let names: Vec<String> = bodies.iter().take(20).map(|body| shown(body.name)).collect();
        return Err(format!(
            "has {} bodies, and none is called {}; give the shape the name of one: {}",
            bodies.len(),
            shown(name),
            names.join(", ")
        ));
    };
    let Body { radius, corners, .. } = bodies.swap_remove(index).convex()?;
    Ok((radius, corners))
}

/// Words of a text with their lines.
struct Words<'a>(Box<dyn Iterator<Item = (usize, &'a str)> + 'a>);

impl<'a> Words<'a> {
    fn of(text: &'a str) -> Self {
        let words =
            |(line, words): (usize, &'a str)| words.split_whitespace().map(move |w| (line, w));
        Self(Box::new((1..).zip(text.lines()).flat_map(words)))
    }

    fn next(&mut self) -> Result<(usize, &'a str), String> {
        self.0.next().ok_or_else(|| "the file ends within a body: was it cut off?".to_owned())
    }

    fn read<T: FromStr>(&mut self, what: &str) -> Result<T, String> {
        let (line, word) = self.next()?;
        word.parse().map_err(|_| format!("line {line}: `{}` is not {what}", shown(word)))
    }

    fn count(&mut self) -> Result<usize, String> {
        self.read("a number of things, or the number of one")
    }

    fn point(&mut self) -> Result<Vec3, String> {
        Ok(Vec3::new(self.read("a number")?, self.read("a number")?, self.read("a number")?))
    }
}

fn bodies(text: &str) -> Result<Vec<Body<'_>>, String> {
    let mut words = Words::of(text);
    let mut bodies = Vec::new();
    while let Some((_, word)) = words.0.next() {
        if word != "<" {
            continue;
        }
        let mut body = Body::default();
        loop {
            match words.next()?.1 {
                ">" => break,
                "name" => body.name = words.next()?.1,
                "radius" => body.radius = words.read("a radius")?,
                "nv" => {
                    let corners = (0..words.count()?).map(|_| words.point());
                    body.corners = corners.collect::<Result<_, _>>()?;
                }
                "ne" => {
                    body.edges = words.count()?;
                    (0..body.edges.saturating_mul(2)).try_for_each(|_| words.count().map(drop))?;
                }
                "nf" => {
                    let face =
                        |words: &mut Words| (0..words.count()?).map(|_| words.count()).collect();
                    let faces = (0..words.count()?).map(|_| face(&mut words));
                    body.faces = faces.collect::<Result<_, String>>()?;
                }
                _ => {}
            }
        }
        bodies.push(body);
    }
    Ok(bodies)
}

impl Body<'_> {
    /// This body, if its faces close and no corner is before one of them.
    fn convex(self) -> Result<Self, String> {
        let Self { radius, corners, edges, faces, .. } = &self;
        match corners[..] {
            [_] => {
                return Err(format!(
                    "is a sphere: write kind = \"sphere\" and radius = {radius:?}"
                ));
            }
            [a, b] => {
                let length = (b - a).norm();
                return Err(format!(
                    "is a rod: write kind = \"spherocylinder\", length = {length:?} and radius = {radius:?}"
                ));
            }
            _ => {}
        }
        if corners.len() + faces.len() != edges.saturating_add(2) {
            return Err("its faces do not enclose a body".to_owned());
        }
        let size = corners.iter().flatten().fold(0.0, |most, x| f64::max(most, x.abs()));
        for face in faces {
            let points: Option<Vec<Vec3>> = face.iter().map(|&k| corners.get(k).copied()).collect();
            let points = points.ok_or("a face has a corner that is not there")?;
            let Some(first) = points.first() else { continue };
            let pairs = points.windows(2).map(|pair| (pair[0] - first).cross(&(pair[1] - first)));
            let Some(normal) = pairs.sum::<Vec3>().try_normalize(1e-6 * size * size) else {
                continue;
            };
            let heights = corners.iter().map(|corner| normal.dot(&(corner - first)));
            let [low, high] =
                heights.fold([0.0_f64; 2], |[low, high], h| [low.min(h), high.max(h)]);
            let depth = f64::min(-low, high);
            if depth > DIGITS * size {
                return Err(format!(
                    "is not convex: corners are up to {depth:.4e} before a face. Write it as OBJ, for a union of pieces"
                ));
            }
        }
        Ok(self)
    }
}
