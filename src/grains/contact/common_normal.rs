//! The common normal of two ellipsoids (or spheres) by Newton's method on the unit sphere.
//!
//! Minimises `δ(n) = h_A(n) + h_B(-n) - n·r` over unit vectors `n` with the exact Riemannian Hessian. A shift keeps the Hessian
//! positive definite, and a line search makes the iteration robust. This is the first choice for smooth shapes: it takes a few
//! evaluations, is accurate to rounding, and costs a small part of the time of erosion. Shapes with edges have no curvature and use
//! GJK-erosion or EPA.
//!
//! The formulas and the search are in `newton`, for any number of lanes. Pairs are processed eight at once in up to three stages:
//!
//! - A pair that touched at the last step takes one step and a correction from its last normal. This is enough for particles that turn
//!   by a thousandth of a radian per step.
//! - For new pairs, the plane across a first direction shows that most are apart.
//! - The other pairs, and those that needed more than one step, are searched. A lane that has converged rests.
//!
//! Pairs that the lanes cannot resolve (very long or very deep) are searched alone, if necessary from every axis.
//!
//! *Condition for the global minimum.* Let ϱ be the least radius of curvature of a body's surface. A sphere of radius ϱ_A + ϱ_B
//! tangent to the difference A − B at a critical point lies inside it (Blaschke's rolling theorem). If `δ < ϱ_A + ϱ_B`, no other point
//! of the boundary is therefore nearer to the origin. Deeper contacts compete with starts from all principal axes.
//!
//! Only `+ - * / √` are used, and every parenthesis is intended: lanes of a vector unit give the same bits.

#![expect(clippy::inline_always, reason = "see `lanes`")]

use super::eroded_gjk::ErodedGjk;
use super::in_lanes::{self, InLanes};
use super::newton::Ellipsoids;
use super::{
    Batch, Bodies, ContactResolver, Found, Outcome, Pair, Posed, Touch, Why, unit_of_length,
    vectors,
};
use crate::ids::Slot;
use crate::lanes::{Eight, Gather, Lanes, RowPairs, Symmetric, Triple, WIDTH};
use crate::math::{Mat3, Vec3};
use crate::shape::Form;

/// Limit of directions tried: ellipsoids of 1:2 take 5 at most, of 1:10 10, needles of 1:100 up to 60.
const EVALUATIONS: u32 = 100;
/// Limit for lanes, where the slowest one delays seven others: ellipsoids of 1:10 seldom take more.
const EVALUATIONS_IN_LANES: u32 = 12;

/// Largest change of the squared length of a normal in the fast path: up to it, the series that normalises leaves an error of 1e-16.
const SHORT: f64 = 2e-4;
/// Largest product of the squared lengths of step and correction for which the fast path is used.
///
/// The error of the normal is about ten times the product of the lengths at 1:10, and less than that product at 1:2.
const TRUSTED: f64 = 4e-23;

/// Resolves ellipsoids and spheres by their common normal.
#[derive(Clone, Copy, Debug, Default)]
pub struct CommonNormal;

impl ContactResolver for CommonNormal {
    fn name(&self) -> &'static str {
        "common-normal"
    }

    /// # Panics
    /// If a body is neither an ellipsoid nor a sphere, that is, if the table of resolvers is wrong.
    #[inline]
    fn touch(&self, a: &Posed, b: &Posed, r: &Vec3, warm: Option<&Vec3>) -> Outcome {
        Search::of([a, b], None, r, warm)
    }

    fn resolve(&self, batch: &Batch, found: &mut Found) {
        in_lanes::resolve(self, batch, found);
    }
}

impl InLanes for CommonNormal {
    #[inline(always)]
    fn resolve_eights<L: Eight>(&self, batch: &Batch, found: &mut Found) {
        resolve_with::<L>(batch, found);
    }
}

/// Resolves the batch, eight pairs at once.
#[inline(always)]
fn resolve_with<L: Eight>(batch: &Batch, found: &mut Found) {
    let (mut touched, mut new) = (Octet::default(), Octet::default());
    let mut open = Vec::new();
    // Walls have no form and do not occur here.
    let bodies = batch.bodies.form.map_or(batch.bodies.position.len(), <[_]>::len);
    let slots = batch.slots(bodies);
    for &index in batch.active {
        if batch.last_normal(index).is_some() {
            touched.push(index);
            if touched.count == WIDTH {
                touched.follow::<L>(batch, slots, found, &mut open);
            }
        } else {
            new.push(index);
            if new.count == WIDTH {
                new.part::<L>(batch, slots, found, &mut open);
            }
        }
    }
    touched.follow::<L>(batch, slots, found, &mut open);
    new.part::<L>(batch, slots, found, &mut open);
    let mut searched = Octet::default();
    for eight in open.chunks(WIDTH) {
        let mut starts = [eight[0].1; WIDTH];
        for (start, (index, of_this)) in starts.iter_mut().zip(eight) {
            searched.push(*index);
            *start = *of_this;
        }
        searched.search::<L>(batch, slots, &starts, found);
    }
}

/// Searches one pair of a batch alone, from a unit vector.
#[cold]
fn search(batch: &Batch, index: u32, start: &Vec3) -> Outcome {
    let pair = batch.pairs[index as usize];
    let bodies = &batch.bodies;
    let forms = bodies.form.map(|form| [form[pair.a.index()], form[pair.b.index()]]);
    let (frames, r) = (bodies.frames(pair), bodies.relative(pair));
    let (a, b) = bodies.posed(pair, &frames);
    Search::of([&a, &b], forms, &r, Some(start))
}

/// Up to eight pairs of a batch, by their index in it. Unused lanes repeat the first pair.
#[derive(Default)]
struct Octet {
    count: usize,
    index: [u32; WIDTH],
}

impl Octet {
    #[inline(always)]
    fn push(&mut self, index: u32) {
        if self.count == 0 {
            self.index = [index; WIDTH];
        }
        self.index[self.count % WIDTH] = index; // spares the check of bounds
        self.count += 1;
    }

    /// Bodies of the pairs, in metres.
    #[inline(always)]
    fn pairs<L: Eight>(&self, batch: &Batch, slots: RowPairs) -> Ellipsoids<L> {
        let Bodies { position, form, cell, .. } = batch.bodies;
        let mut room = [[0; 2]; WIDTH];
        let [from, to] = slots.picked(&self.index, &mut room);
        let r = vectors::<L>(position, to).minus(vectors(position, from));
        let r = cell.nearest_of(r);
        let [a, b] = if let Some(form) = form {
            [Symmetric::of(&from.rows(form)), Symmetric::of(&to.rows(form))]
        } else {
            [forms_made(&batch.bodies, from), forms_made(&batch.bodies, to)]
        };
        Ellipsoids { a, b, r }
    }

    /// Bodies of the pairs, in units of each pair's length, and these units [m].
    #[inline(always)]
    fn pairs_in_units<L: Eight>(&self, batch: &Batch, slots: RowPairs) -> (Ellipsoids<L>, L) {
        let mut units = [1.0; WIDTH];
        for (unit, index) in units.iter_mut().zip(&self.index[..self.count]) {
            let Pair { a, b } = batch.pairs[*index as usize];
            let [a, b] = [a, b].map(|slot| {
                batch.bodies.shape_of(slot).bounding_radius() * batch.bodies.scale_of(slot)
            });
            *unit = unit_of_length(a, b);
        }
        let unit = L::load(&units);
        (self.pairs(batch, slots).scaled(L::all(1.0) / unit), unit)
    }

    /// Overlaps below which a minimum is certainly the global one [m].
    #[inline(always)]
    fn certain<L: Eight>(&self, batch: &Batch) -> L {
        let Bodies { shape, curvature_radius, scale, .. } = batch.bodies;
        let mut certain = [0.0; WIDTH];
        let lanes = certain.iter_mut().zip(&self.index[..self.count]);
        // One loop for both cases would look up the scale of each body.
        if scale.is_some() {
            for (certain, index) in lanes {
                let Pair { a, b } = batch.pairs[*index as usize];
                let [a, b] = [a, b].map(|slot| batch.bodies.curvature_radius_of(slot));
                *certain = a + b;
            }
        } else {
            for (certain, index) in lanes {
                let Pair { a, b } = batch.pairs[*index as usize];
                let [a, b] = [shape[a.index()], shape[b.index()]];
                *certain = curvature_radius[a.index()] + curvature_radius[b.index()];
            }
        }
        L::load(&certain)
    }

    /// Normals at the last step.
    #[inline(always)]
    fn normals<L: Eight>(&self, batch: &Batch) -> Triple<L> {
        let mut normals = [batch.normal(self.index[0]).as_ref(); WIDTH];
        for (normal, index) in normals.iter_mut().zip(&self.index) {
            *normal = batch.normal(*index).as_ref();
        }
        Triple::of(&normals)
    }

    /// A bit for each lane in use.
    #[inline(always)]
    fn lanes(&self) -> u8 {
        u8::MAX.unbounded_shr((WIDTH - self.count) as u32)
    }

    /// Pairs that touched at the last step: one step of Newton's method and a correction with the same Hessian, together of third order.
    ///
    /// Each lane is then checked. Empties the lanes.
    #[inline(always)]
    fn follow<L: Eight>(
        &mut self,
        batch: &Batch,
        slots: RowPairs,
        found: &mut Found,
        open: &mut Vec<(u32, Vec3)>,
    ) {
        if self.count == 0 {
            return;
        }
        let pair = self.pairs::<L>(batch, slots);
        let before = pair.evaluate(self.normals(batch));
        let apart = before.delta.at_most(L::all(0.0));
        if apart == u8::MAX {
            self.part_all(before.delta, found);
            return;
        }
        let hessian = pair.hessian(&before);
        let determinant = hessian.determinant(before.delta);
        let inverse = L::all(1.0) / determinant;
        let step = hessian.scaled_step(before.gradient, before.delta).times(inverse);
        let (normal, change) = unit(before.normal.plus(step));
        let after = pair.evaluate(normal);
        let correction = hessian.scaled_step(after.gradient, before.delta).times(inverse);
        let point = pair.point_after(&after, correction);
        let overlap = after.delta + L::all(0.5) * after.gradient.dot(correction);
        let (normal, _) = unit(after.normal.plus(correction));

        // These comparisons are false for NaN.
        let zero = L::all(0.0);
        let downhill = zero.less(determinant) & (before.delta + before.delta).less(hessian.trace);
        let short = change.less(L::all(SHORT));
        let trusted = (step.dot(step) * correction.dot(correction)).less(L::all(TRUSTED));
        let certain = overlap.less(self.certain(batch));
        let touching = zero.less(before.delta) & zero.less(overlap);
        let good = downhill & short & trusted & certain & touching;
        if good == u8::MAX && self.count == WIDTH {
            found.contacts.push_eight(&self.index, overlap, normal, point);
            self.count = 0;
            return;
        }

        let touches = Touches::of(overlap, normal, point);
        let delta = before.delta.store();
        for (lane, delta) in delta.iter().enumerate().take(self.count) {
            let index = self.index[lane];
            if good >> lane & 1 == 1 {
                found.note(index, Outcome::Touching(touches.of_lane(lane)));
            } else if apart >> lane & 1 == 1 {
                found.note(index, Outcome::Apart(-delta));
            } else {
                open.push((index, *batch.normal(index)));
            }
        }
        self.count = 0;
    }

    /// New pairs: those separated by the plane across the first direction are apart. Empties the lanes.
    #[inline(always)]
    fn part<L: Eight>(
        &mut self,
        batch: &Batch,
        slots: RowPairs,
        found: &mut Found,
        open: &mut Vec<(u32, Vec3)>,
    ) {
        if self.count == 0 {
            return;
        }
        // In metres: a pair whose values overflow or underflow is not found apart, and is searched.
        let pair = self.pairs::<L>(batch, slots);
        let start = pair.cold_start().unit();
        let delta = pair.delta(start);
        let apart = delta.at_most(L::all(0.0));
        if apart == u8::MAX {
            self.part_all(delta, found);
            return;
        }
        let delta = delta.store();
        let [x, y, z] = start.store();
        for (lane, delta) in delta.iter().enumerate().take(self.count) {
            let index = self.index[lane];
            if apart >> lane & 1 == 1 {
                found.note(index, Outcome::Apart(-delta));
            } else {
                open.push((index, Vec3::new(x[lane], y[lane], z[lane])));
            }
        }
        self.count = 0;
    }

    /// All lanes have a negative `delta`. Empties the lanes.
    #[inline(always)]
    fn part_all<L: Eight>(&mut self, delta: L, found: &mut Found) {
        let clearances = (L::all(0.0) - delta).store();
        found.apart.extend(self.index.into_iter().zip(clearances).take(self.count));
        self.count = 0;
    }

    /// Searches all other pairs from unit vectors. Empties the lanes.
    #[inline(always)]
    fn search<L: Eight>(
        &mut self,
        batch: &Batch,
        slots: RowPairs,
        starts: &[Vec3; WIDTH],
        found: &mut Found,
    ) {
        let (pair, unit) = self.pairs_in_units::<L>(batch, slots);
        let mut rows = [starts[0].as_ref(); WIDTH];
        for (row, start) in rows.iter_mut().zip(starts) {
            *row = start.as_ref();
        }
        let ends = pair.descend(Triple::of(&rows), self.lanes(), EVALUATIONS_IN_LANES);
        let overlap = ends.overlap * unit;
        let certain = ends.minimum & L::all(0.0).less(overlap) & overlap.less(self.certain(batch));
        let touches = Touches::of(overlap, ends.normal, ends.point.times(unit));
        for (lane, start) in starts.iter().enumerate().take(self.count) {
            let index = self.index[lane];
            let outcome = if certain >> lane & 1 == 1 {
                Outcome::Touching(touches.of_lane(lane))
            } else if ends.apart >> lane & 1 == 1 {
                Outcome::Apart(-touches.overlap[lane])
            } else {
                search(batch, index, start)
            };
            found.note(index, outcome);
        }
        self.count = 0;
    }
}

/// Forms of eight bodies [m²], for callers that do not store them.
#[inline(always)]
fn forms_made<L: Eight>(bodies: &Bodies, slots: Gather) -> Symmetric<L> {
    let mut made = [[0.0; 6]; WIDTH];
    for (lane, made) in made.iter_mut().enumerate() {
        let slot = Slot(slots.at(lane) as u32);
        *made = bodies.posed_body(slot, &bodies.frame(slot)).form();
    }
    Symmetric::of(&made.each_ref())
}

/// Eight contact geometries, by component [m].
struct Touches {
    overlap: [f64; WIDTH],
    normal: [[f64; WIDTH]; 3],
    point: [[f64; WIDTH]; 3],
}

impl Touches {
    #[inline(always)]
    fn of<L: Eight>(overlap: L, normal: Triple<L>, point: Triple<L>) -> Self {
        Self { overlap: overlap.store(), normal: normal.store(), point: point.store() }
    }

    #[inline(always)]
    fn of_lane(&self, lane: usize) -> Touch {
        let [nx, ny, nz] = &self.normal;
        let [px, py, pz] = &self.point;
        Touch {
            overlap: self.overlap[lane],
            normal: Vec3::new(nx[lane], ny[lane], nz[lane]),
            point: Vec3::new(px[lane], py[lane], pz[lane]),
        }
    }
}

/// Normalises a nearly unit vector by a series. Also returns the square of the deviation of its squared length from 1.
#[inline(always)]
fn unit<L: Lanes>(v: Triple<L>) -> (Triple<L>, L) {
    let off = v.dot(v) - L::all(1.0);
    let series = L::all(0.5) - off * (L::all(0.375) - off * L::all(0.3125));
    let factor = L::all(1.0) - off * series;
    (v.times(factor), off * off)
}

/// The common normal, started from the direction of GJK-erosion, for pairs for which [`CommonNormal`] fails.
///
/// The start costs more but lies within a few degrees of the answer.
#[derive(Clone, Copy, Debug, Default)]
pub struct SeededCommonNormal {
    /// Method that gives the start.
    pub seed: ErodedGjk,
}

impl ContactResolver for SeededCommonNormal {
    fn name(&self) -> &'static str {
        "common-normal from gjk-erosion"
    }

    fn touch(&self, a: &Posed, b: &Posed, r: &Vec3, warm: Option<&Vec3>) -> Outcome {
        match self.seed.touch(a, b, r, warm) {
            Outcome::Touching(seed) => CommonNormal.touch(a, b, r, Some(&seed.normal)),
            // Erosion misses no contact, so a pair found apart is apart.
            other => other,
        }
    }
}

impl Outcome {
    /// The outcome of a pair whose lengths were divided by `unit`.
    pub(super) fn in_metres(self, unit: f64) -> Self {
        match self {
            Self::Apart(clearance) => Self::Apart(clearance * unit),
            Self::Touching(t) => {
                Self::Touching(Touch { overlap: t.overlap * unit, point: t.point * unit, ..t })
            }
            Self::Failed(why) => Self::Failed(why),
        }
    }
}

/// Safeguarded search for one pair, in units of the pair's length.
struct Search<'a> {
    frames: [&'a Mat3; 2],
    pair: Ellipsoids<f64>,
    /// `ϱ_A + ϱ_B`: a minimum below this is the global one.
    certain: f64,
}

impl<'a> Search<'a> {
    /// Resolves a pair. The matrices of the bodies are computed if `forms` is `None`.
    #[inline]
    fn of(
        bodies: [&Posed<'a>; 2],
        forms: Option<[Form; 2]>,
        r: &Vec3,
        warm: Option<&Vec3>,
    ) -> Outcome {
        let radii = bodies.map(Posed::bounding_radius);
        let reach = radii[0] + radii[1];
        let squared = r.norm_squared();
        if squared > reach * reach {
            return Outcome::Apart(squared.sqrt() - reach);
        }
        let unit = unit_of_length(radii[0], radii[1]);
        let per_metre = 1.0 / unit;
        let forms = forms.unwrap_or_else(|| bodies.map(Posed::form));
        let [a, b] = forms.map(|form| {
            let [xx, yy, zz, xy, xz, yz] = form.map(|entry| entry * per_metre * per_metre);
            Symmetric { xx, yy, zz, xy, xz, yz }
        });
        let certain = bodies.map(|body| body.smallest_curvature_radius() * per_metre);
        let search = Self {
            frames: bodies.map(|body| body.frame),
            pair: Ellipsoids { a, b, r: triple(&(r * per_metre)) },
            certain: certain[0] + certain[1],
        };
        let start = warm.copied().unwrap_or_else(|| vector(search.pair.cold_start().unit()));
        if !start.iter().all(|x| x.is_finite()) {
            // The centres coincide: there is no first direction.
            return Outcome::Failed(Why::TooDeep);
        }
        search.resolve(&start).in_metres(unit)
    }

    fn resolve(&self, start: &Vec3) -> Outcome {
        let mut best = match self.minimise(start) {
            Outcome::Touching(touch) if touch.overlap >= self.certain => Ok(touch),
            Outcome::Failed(why) => Err(why),
            certain => return certain,
        };
        for frame in self.frames {
            for axis in frame.column_iter() {
                for start in [axis.into_owned(), -axis] {
                    match self.minimise(&start) {
                        apart @ Outcome::Apart(_) => return apart,
                        Outcome::Touching(touch)
                            if best.is_ok_and(|b| b.overlap <= touch.overlap) => {}
                        Outcome::Touching(touch) => best = Ok(touch),
                        Outcome::Failed(_) => {}
                    }
                }
            }
        }
        best.map_or_else(Outcome::Failed, Outcome::Touching)
    }

    /// Minimises from `start`, a unit vector.
    fn minimise(&self, start: &Vec3) -> Outcome {
        let end = self.pair.descend(triple(start), 1, EVALUATIONS);
        if end.apart == 1 {
            Outcome::Apart(-end.overlap)
        } else if end.minimum == 1 {
            let (normal, point) = (vector(end.normal), vector(end.point));
            Touch { overlap: end.overlap, normal, point }.outcome()
        } else if end.saddle == 1 {
            Outcome::Failed(Why::TooDeep)
        } else if end.overlap.is_finite() {
            Outcome::Failed(Why::NoConvergence)
        } else {
            Outcome::Failed(Why::NotFinite)
        }
    }
}

#[inline]
fn triple(v: &Vec3) -> Triple<f64> {
    Triple { x: v.x, y: v.y, z: v.z }
}

#[inline]
fn vector(t: Triple<f64>) -> Vec3 {
    Vec3::new(t.x, t.y, t.z)
}

#[cfg(test)]
mod tests {
    use super::{CommonNormal, resolve_with};
    use crate::cell::Cell;
    use crate::contact::{
        Batch, Bodies, ContactResolver, Found, Geometry, Outcome, Pair, Previous, Touch,
    };
    use crate::ids::{ShapeId, Slot};
    use crate::lanes::Portable;
    use crate::math::{Quat, Vec3};
    use crate::random::Random;
    use crate::shape::{Ellipsoid, Form, Shape, Sphere};

    /// Pairs of touching bodies far from each other, with the normals of a previous step.
    struct Crowd {
        position: Vec<Vec3>,
        quaternion: Vec<Quat>,
        form: Vec<Form>,
        shape: Vec<ShapeId>,
        library: Vec<Shape>,
        curvature_radius: Vec<f64>,
        pairs: Vec<Pair>,
        geometry: Vec<Geometry>,
    }

    impl Crowd {
        /// Normals are off by about `turned` rad; the unit of length is `unit` m.
        fn new(pairs: u32, turned: f64, unit: f64) -> Self {
            let axes = [[1.0, 0.5, 0.5], [0.9, 0.7, 0.4], [1.0, 1.0, 0.5]];
            let mut library: Vec<_> = axes
                .iter()
                .map(|&a| Shape::Ellipsoid(Ellipsoid { semi_axes: Vec3::from(a) * unit }))
                .collect();
            library.push(Shape::Sphere(Sphere { radius: 0.6 * unit }));
            let mut crowd = Self {
                position: Vec::new(),
                quaternion: Vec::new(),
                form: Vec::new(),
                shape: Vec::new(),
                curvature_radius: library.iter().map(Shape::smallest_curvature_radius).collect(),
                library,
                pairs: Vec::new(),
                geometry: Vec::new(),
            };
            for k in 0..pairs {
                let mut random = Random::of(7, u64::from(k));
                let shapes = [k % 4, k / 4 % 4].map(|s| ShapeId(s as u16));
                let quaternions = [(); 2].map(|()| random.rotation());
                let frames = quaternions.map(|q| q.to_rotation_matrix().into_inner());
                let mut direction = || random.rotation() * Vec3::x();
                let (normal, tilt) = (direction(), direction());
                let support = |side: usize, way: &Vec3| {
                    let shape = &crowd.library[shapes[side].index()];
                    frames[side] * shape.support(&frames[side].tr_mul(way))
                };
                let overlap = 0.05 * unit * f64::from(k % 97 + 1) / 97.0;
                let r = support(0, &normal) - support(1, &-normal) - normal * overlap;
                for side in 0..2 {
                    crowd.position.push(r * side as f64);
                    crowd.quaternion.push(quaternions[side]);
                    crowd.form.push(crowd.library[shapes[side].index()].form(&frames[side]));
                    crowd.shape.push(shapes[side]);
                }
                crowd.pairs.push(Pair { a: Slot(2 * k), b: Slot(2 * k + 1) });
                let normal = (normal + tilt * turned).normalize();
                crowd.geometry.push(Geometry { normal, ..Geometry::default() });
            }
            crowd
        }

        fn bodies(&self) -> Bodies<'_> {
            Bodies {
                position: &self.position,
                quaternion: Some(&self.quaternion),
                facets: &[],
                form: Some(&self.form),
                shape: &self.shape,
                library: &self.library,
                curvature_radius: &self.curvature_radius,
                scale: None,
                cell: &Cell::OPEN,
            }
        }

        /// Results of a resolver, by pair.
        fn touches(&self, resolve: impl Fn(&Batch, &mut Found)) -> Vec<Touch> {
            let active: Vec<u32> = (0..self.pairs.len() as u32).collect();
            let previous: Vec<Previous> = (0..self.pairs.len()).map(Previous::at).collect();
            let mut found = Found::default();
            let bodies = self.bodies();
            let batch = Batch {
                pairs: &self.pairs,
                previous: &previous,
                geometry: &self.geometry,
                active: &active,
                bodies,
            };
            resolve(&batch, &mut found);
            assert_eq!(found.contacts.len(), self.pairs.len(), "every pair touches");
            let mut contacts: Vec<_> = found.contacts.iter().collect();
            contacts.sort_by_key(|contact| contact.pair);
            contacts.iter().map(|contact| contact.touch).collect()
        }
    }

    fn bits(touches: &[Touch]) -> Vec<u64> {
        touches
            .iter()
            .flat_map(|t| {
                let numbers = [t.overlap, t.normal.x, t.normal.y, t.normal.z];
                numbers.into_iter().chain(t.point.iter().copied()).map(f64::to_bits)
            })
            .collect()
    }

    /// Same bits with and without vector registers, in nanometres and kilometres.
    #[test]
    fn lanes_give_the_same_bits_everywhere() {
        for turned in [1e-6, 1e-4, 1e-2] {
            let crowd = Crowd::new(1003, turned, 1.0);
            let dispatched = crowd.touches(|batch, found| CommonNormal.resolve(batch, found));
            let portable = crowd.touches(resolve_with::<Portable>);
            assert_eq!(bits(&dispatched), bits(&portable), "turned {turned}");
            for exponent in [-30, 30] {
                let unit = 2f64.powi(exponent);
                let scaled = Crowd::new(1003, turned, unit)
                    .touches(|batch, found| CommonNormal.resolve(batch, found));
                let back: Vec<_> = scaled
                    .iter()
                    .map(|t| Touch {
                        overlap: t.overlap / unit,
                        normal: t.normal,
                        point: t.point / unit,
                    })
                    .collect();
                assert_eq!(bits(&back), bits(&dispatched), "unit 2^{exponent}");
            }
        }
    }

    /// New pairs, eight at once in any company, give the same bits as each pair alone.
    #[test]
    fn lanes_search_as_one_alone() {
        let mut crowd = Crowd::new(1003, 0.0, 1.0);
        crowd.geometry.fill(Geometry::default());
        let bodies = crowd.bodies();
        let alone: Vec<_> = (crowd.pairs.iter())
            .map(|pair| {
                let frames = bodies.frames(*pair);
                let (a, b) = bodies.posed(*pair, &frames);
                match CommonNormal.touch(&a, &b, &bodies.relative(*pair), None) {
                    Outcome::Touching(touch) => touch,
                    other => panic!("{pair:?}: {other:?}"),
                }
            })
            .collect();
        let together = crowd.touches(|batch, found| CommonNormal.resolve(batch, found));
        assert_eq!(bits(&together), bits(&alone));
        assert_eq!(bits(&crowd.touches(resolve_with::<Portable>)), bits(&alone));
        let reversed = crowd.touches(|batch, found| {
            let active: Vec<u32> = batch.active.iter().rev().copied().collect();
            CommonNormal.resolve(&Batch { active: &active, ..*batch }, found);
        });
        assert_eq!(bits(&reversed), bits(&alone));
    }

    /// The fast path agrees with the search: overlap to 4e-15, normal to 1e-10 rad.
    #[test]
    fn the_fast_path_agrees_with_the_search() {
        for turned in [0.0, 1e-8, 1e-5, 1e-4, 1e-3] {
            let crowd = Crowd::new(4001, turned, 1.0);
            let fast = crowd.touches(|batch, found| CommonNormal.resolve(batch, found));
            let bodies = crowd.bodies();
            for (pair, fast) in crowd.pairs.iter().zip(&fast) {
                let r = bodies.relative(*pair);
                let frames = bodies.frames(*pair);
                let (a, b) = bodies.posed(*pair, &frames);
                let Outcome::Touching(exact) = CommonNormal.touch(&a, &b, &r, None) else {
                    panic!("{pair:?} touches")
                };
                let (overlap, angle, point) = (
                    (fast.overlap - exact.overlap).abs(),
                    fast.normal.cross(&exact.normal).norm(),
                    (fast.point - exact.point).norm(),
                );
                assert!(overlap < 4e-15, "{pair:?}, turned {turned}: overlap off by {overlap:e}");
                assert!(angle < 1e-10, "{pair:?}, turned {turned}: normal off by {angle:e}");
                assert!(point < 1e-10, "{pair:?}, turned {turned}: point off by {point:e}");
                assert!((fast.normal.norm() - 1.0).abs() < 4e-16, "unit normals");
            }
        }
    }
}
