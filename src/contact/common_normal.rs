//! The common normal of two ellipsoids (or spheres) by Newton's method on the unit sphere.
//!
//! Minimises `δ(n) = h_A(n) + h_B(-n) - n·r` over unit vectors `n` with the exact Riemannian Hessian,
//! made safe by a shift that keeps it positive definite and by a line search. The first choice for smooth
//! shapes: a few evaluations, rounding accuracy, a small part of the time of erosion. It needs curvature: shapes with edges go to GJK-erosion or EPA.
//!
//! The formulas stand in `newton`, for any number of lanes. A pair that touched at the last step
//! takes one step and a correction from its last normal, eight pairs at once; that is enough for grains that
//! turn by a thousandth of a radian in a step. All others, and those for which it is not, go one by one through
//! the search below.
//!
//! *When a minimum is the global one.* Let ϱ be the least radius of curvature of a body's surface. A
//! ball of radius ϱ_A + ϱ_B tangent to the difference A − B at a critical point lies inside it
//! (Blaschke's rolling theorem), so that no other point of the boundary is nearer to the origin if
//! `δ < ϱ_A + ϱ_B`. Deeper contacts compete with starts from all principal axes.
//!
//! Only `+ - * / √` are used, and every parenthesis is meant: lanes of a vector unit give the same bits.

#![expect(clippy::inline_always, reason = "see `lanes`")]

use super::eroded_gjk::ErodedGjk;
use super::lanes::{self, Eight, Lanes, Symmetric, Triple, WIDTH};
use super::newton::{Ellipsoids, Evaluation, Hessian};
use super::{Batch, Bodies, ContactResolver, Found, Outcome, Posed, Touch, Why, unit_of_length};
use crate::ids::Slot;
use crate::math::{Mat3, Vec3};
use crate::shape::{Form, Shape};

/// Directions tried before giving up: ellipsoids of 1:2 take 5 at most, of 1:10 10, needles of 1:100 up to 60.
const EVALUATIONS: u32 = 100;
/// Longest step [rad].
const LONGEST_STEP: f64 = 0.5;
/// A step shorter than this [rad] is the last: quadratic convergence leaves 1e-12, the closing correction
/// nothing.
const LAST_STEP: f64 = 1e-6;
/// Part of the predicted decrease that a step must bring (Armijo).
const SUFFICIENT: f64 = 1e-4;
/// Rounding of the Hessian's determinant at a flat minimum, relative to the square of its trace.
const FLAT: f64 = 1e-12;
/// Rounding of `δ`, in units of the pair's length.
const ROUNDING: f64 = 4e-15;

/// A step of the fast path may change the squared length of a normal by this: the series that makes it
/// unit again leaves 1e-16.
const SHORT: f64 = 2e-4;
/// The product of the squared lengths of step and correction up to which the fast path trusts itself: the
/// normal's error is about the product of the lengths, 1e-11 rad.
const TRUSTED: f64 = 1e-22;

/// Resolves ellipsoids and spheres by their common normal.
#[derive(Clone, Copy, Debug, Default)]
pub struct CommonNormal;

impl ContactResolver for CommonNormal {
    fn name(&self) -> &'static str {
        "common-normal"
    }

    /// # Panics
    /// If a body is neither an ellipsoid nor a sphere: the table of resolvers was filled wrongly.
    #[inline]
    fn touch(&self, a: &Posed, b: &Posed, r: &Vec3, warm: Option<&Vec3>) -> Outcome {
        Search::of([a.shape, b.shape], [a.frame, b.frame], None, r, warm)
    }

    fn resolve(&self, batch: &Batch, found: &mut Found) {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx") {
            // SAFETY: the processor has AVX.
            #[expect(unsafe_code, reason = "compiled for a processor that was just asked for")]
            unsafe {
                resolve_with_avx(batch, found);
            }
            return;
        }
        resolve_with::<lanes::Portable>(batch, found);
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx")]
fn resolve_with_avx(batch: &Batch, found: &mut Found) {
    resolve_with::<lanes::Avx>(batch, found);
}

/// The batch: pairs that touched go in lanes, the others one by one.
#[inline(always)]
fn resolve_with<L: Eight>(batch: &Batch, found: &mut Found) {
    let mut warm = WarmPairs::default();
    for &index in batch.active {
        let history = &batch.history[index as usize];
        let pair = batch.pairs[index as usize];
        let r = batch.bodies.relative(pair);
        if history.touched() {
            warm.push(index, &batch.bodies, [pair.a, pair.b], &r, &history.normal);
            if warm.count == WIDTH {
                warm.resolve::<L>(batch, found);
            }
        } else {
            found.note(index, search(&batch.bodies, [pair.a, pair.b], &r, None));
        }
    }
    if warm.count > 0 {
        warm.resolve::<L>(batch, found);
    }
}

/// The matrix of a body, computed if the caller of the batch does not keep it.
#[inline(always)]
fn form_of(bodies: &Bodies, slot: Slot) -> Form {
    match bodies.form {
        Some(form) => form[slot.index()],
        None => bodies.shape_of(slot).form(bodies.posed(slot).frame),
    }
}

/// One pair of a batch on its own.
fn search(bodies: &Bodies, [a, b]: [Slot; 2], r: &Vec3, warm: Option<&Vec3>) -> Outcome {
    let (posed_a, posed_b) = (bodies.posed(a), bodies.posed(b));
    let forms = bodies.form.map(|form| [form[a.index()], form[b.index()]]);
    Search::of([posed_a.shape, posed_b.shape], [posed_a.frame, posed_b.frame], forms, r, warm)
}

/// Up to eight pairs that touched at the last step, number by number.
#[derive(Default)]
struct WarmPairs {
    count: usize,
    index: [u32; WIDTH],
    a: [[f64; WIDTH]; 6],
    b: [[f64; WIDTH]; 6],
    r: [[f64; WIDTH]; 3],
    normal: [[f64; WIDTH]; 3],
    /// An overlap below this is certainly the least.
    certain: [f64; WIDTH],
}

impl WarmPairs {
    #[inline(always)]
    fn push(&mut self, index: u32, bodies: &Bodies, [a, b]: [Slot; 2], r: &Vec3, normal: &Vec3) {
        let lane = self.count;
        let (form_a, form_b) = (form_of(bodies, a), form_of(bodies, b));
        for k in 0..6 {
            self.a[k][lane] = form_a[k];
            self.b[k][lane] = form_b[k];
        }
        for k in 0..3 {
            self.r[k][lane] = r[k];
            self.normal[k][lane] = normal[k];
        }
        self.certain[lane] =
            least_curvature_radius(bodies.shape_of(a)) + least_curvature_radius(bodies.shape_of(b));
        self.index[lane] = index;
        self.count += 1;
    }

    /// One step of Newton's method and a correction with the same Hessian (together of third order), then
    /// a look at each lane. Empties the lanes.
    #[inline(always)]
    fn resolve<L: Eight>(&mut self, batch: &Batch, found: &mut Found) {
        let pair = Ellipsoids {
            a: Symmetric::load(&self.a),
            b: Symmetric::load(&self.b),
            r: Triple::load(&self.r),
        };

        let before = pair.evaluate(Triple::load(&self.normal));
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

        // Comparisons that a number which is not one fails.
        let zero = L::all(0.0);
        let downhill = zero.less(determinant) & (before.delta + before.delta).less(hessian.trace);
        let short = change.less(L::all(SHORT));
        let trusted = (step.dot(step) * correction.dot(correction)).less(L::all(TRUSTED));
        let certain = overlap.less(L::load(&self.certain));
        let touching = zero.less(before.delta) & zero.less(overlap);
        let good = downhill & short & trusted & certain & touching;

        let overlap = overlap.store();
        let [nx, ny, nz] = [normal.x.store(), normal.y.store(), normal.z.store()];
        let [px, py, pz] = [point.x.store(), point.y.store(), point.z.store()];
        for lane in 0..self.count {
            let index = self.index[lane];
            let outcome = if good >> lane & 1 == 1 {
                Outcome::Touching(Touch {
                    overlap: overlap[lane],
                    normal: Vec3::new(nx[lane], ny[lane], nz[lane]),
                    point: Vec3::new(px[lane], py[lane], pz[lane]),
                })
            } else {
                let pair = batch.pairs[index as usize];
                let r = batch.bodies.relative(pair);
                let warm = &batch.history[index as usize].normal;
                search(&batch.bodies, [pair.a, pair.b], &r, Some(warm))
            };
            found.note(index, outcome);
        }
        self.count = 0;
    }
}

/// A vector that is nearly unit made so by a series, and how far its squared length was off.
#[inline(always)]
fn unit<L: Lanes>(v: Triple<L>) -> (Triple<L>, L) {
    let off = v.dot(v) - L::all(1.0);
    let series = L::all(0.5) - off * (L::all(0.375) - off * L::all(0.3125));
    let factor = L::all(1.0) - off * series;
    (v.times(factor), off * off)
}

/// The common normal started from the direction of GJK-erosion: dearer, but started within a few
/// degrees of the answer. For pairs at which [`CommonNormal`] gives up.
#[derive(Clone, Copy, Debug, Default)]
pub struct SeededCommonNormal {
    /// Gives the start.
    pub seed: ErodedGjk,
}

impl ContactResolver for SeededCommonNormal {
    fn name(&self) -> &'static str {
        "common-normal from gjk-erosion"
    }

    fn touch(&self, a: &Posed, b: &Posed, r: &Vec3, warm: Option<&Vec3>) -> Outcome {
        match self.seed.touch(a, b, r, warm) {
            Outcome::Touching(seed) => CommonNormal.touch(a, b, r, Some(&seed.normal)),
            // Erosion misses no contact: apart is apart.
            other => other,
        }
    }
}

impl Outcome {
    /// The outcome of a pair whose lengths were divided by `unit`.
    fn in_metres(self, unit: f64) -> Self {
        match self {
            Self::Apart(clearance) => Self::Apart(clearance * unit),
            Self::Touching(t) => {
                Self::Touching(Touch { overlap: t.overlap * unit, point: t.point * unit, ..t })
            }
            Self::Failed(why) => Self::Failed(why),
        }
    }
}

/// Where Newton's method ended.
enum Minimum {
    /// With this clearance.
    Apart(f64),
    At(Touch),
    Failed(Why),
}

/// The safeguarded search for one pair, in units of the pair's length.
struct Search<'a> {
    frames: [&'a Mat3; 2],
    pair: Ellipsoids<f64>,
    /// `ϱ_A + ϱ_B`: a minimum below this is the global one.
    certain: f64,
}

impl<'a> Search<'a> {
    /// Resolves a pair. The matrices of the bodies are computed if the caller does not have them.
    #[inline]
    fn of(
        shapes: [&Shape; 2],
        frames: [&'a Mat3; 2],
        forms: Option<[Form; 2]>,
        r: &Vec3,
        warm: Option<&Vec3>,
    ) -> Outcome {
        let radii = shapes.map(Shape::bounding_radius);
        let reach = radii[0] + radii[1];
        let squared = r.norm_squared();
        if squared > reach * reach {
            return Outcome::Apart(squared.sqrt() - reach);
        }
        let unit = unit_of_length(radii[0], radii[1]);
        let per_metre = 1.0 / unit;
        let forms = forms.unwrap_or_else(|| [shapes[0].form(frames[0]), shapes[1].form(frames[1])]);
        let [a, b] = forms.map(|form| {
            let [xx, yy, zz, xy, xz, yz] = form.map(|entry| entry * per_metre * per_metre);
            Symmetric { xx, yy, zz, xy, xz, yz }
        });
        let certain = shapes.map(|shape| least_curvature_radius(shape) * per_metre);
        let search = Self {
            frames,
            pair: Ellipsoids { a, b, r: triple(&(r * per_metre)) },
            certain: certain[0] + certain[1],
        };
        let start = warm.copied().or_else(|| {
            let along = vector(search.pair.cold_start());
            let squared = along.norm_squared();
            (squared > 0.0).then(|| along / squared.sqrt())
        });
        // Without a start the centres coincide.
        start.map_or(Outcome::Failed(Why::TooDeep), |n| search.resolve(&n).in_metres(unit))
    }

    fn resolve(&self, start: &Vec3) -> Outcome {
        let mut best = match self.minimise(start) {
            Minimum::Apart(clearance) => return Outcome::Apart(clearance),
            Minimum::At(touch) if touch.overlap < self.certain => return touch.outcome(),
            Minimum::At(touch) => Ok(touch),
            Minimum::Failed(why) => Err(why),
        };
        for frame in self.frames {
            for axis in frame.column_iter() {
                for start in [axis.into_owned(), -axis] {
                    match self.minimise(&start) {
                        Minimum::Apart(clearance) => return Outcome::Apart(clearance),
                        Minimum::At(touch) if best.is_ok_and(|b| b.overlap <= touch.overlap) => {}
                        Minimum::At(touch) => best = Ok(touch),
                        Minimum::Failed(_) => {}
                    }
                }
            }
        }
        best.map_or_else(Outcome::Failed, Touch::outcome)
    }

    /// Goes downhill from `start`, a unit vector.
    fn minimise(&self, start: &Vec3) -> Minimum {
        let mut here = self.pair.evaluate(triple(start));
        let mut evaluations = 1;
        if here.delta <= 0.0 {
            return Minimum::Apart(-here.delta);
        }
        if !here.delta.is_finite() {
            return Minimum::Failed(Why::NotFinite);
        }
        loop {
            let hessian = self.pair.hessian(&here);
            let mut step = newton_step(&hessian, here.gradient, shift(&hessian, here.delta));
            let squared = step.norm_squared();
            if squared > LONGEST_STEP * LONGEST_STEP {
                step *= LONGEST_STEP / squared.sqrt();
            }
            let mut slope = vector(here.gradient).dot(&step);
            here = loop {
                if evaluations == EVALUATIONS {
                    return Minimum::Failed(Why::NoConvergence);
                }
                let there = (vector(here.normal) + step).normalize();
                let there = self.pair.evaluate(triple(&there));
                evaluations += 1;
                if there.delta <= 0.0 {
                    return Minimum::Apart(-there.delta);
                }
                if there.delta <= (here.delta + SUFFICIENT * slope) + ROUNDING {
                    break there;
                }
                step *= 0.5;
                slope *= 0.5;
            };
            if step.norm_squared() < LAST_STEP * LAST_STEP {
                return if exceeds(&hessian, here.delta, FLAT) {
                    Minimum::At(self.corrected(&here, &hessian))
                } else {
                    // A saddle or a maximum: the bodies are too deep in each other for this start.
                    Minimum::Failed(Why::TooDeep)
                };
            }
        }
    }

    /// The touch after one more step with the last Hessian.
    fn corrected(&self, e: &Evaluation<f64>, hessian: &Hessian<f64>) -> Touch {
        let newton = newton_step(hessian, e.gradient, e.delta);
        // A minimum that is flat to rounding has no better point.
        let small = newton.norm_squared() < LAST_STEP * LAST_STEP;
        let step = if small { newton } else { Vec3::zeros() };
        Touch {
            overlap: e.delta + 0.5 * vector(e.gradient).dot(&step),
            normal: (vector(e.normal) + step).normalize(),
            point: vector(self.pair.point_after(e, triple(&step))),
        }
    }
}

/// Newton's step `-(H - shift)⁻¹ g` on the tangent plane.
#[inline]
fn newton_step(hessian: &Hessian<f64>, gradient: Triple<f64>, shift: f64) -> Vec3 {
    vector(hessian.scaled_step(gradient, shift)) / hessian.determinant(shift)
}

/// Newton's own shift is `δ`, wherever its step leads downhill. Elsewhere a little less than the product
/// over the sum of the eigenvalues, which is below both of them.
#[inline]
fn shift(hessian: &Hessian<f64>, delta: f64) -> f64 {
    if exceeds(hessian, delta, 0.0) { delta } else { 0.9 * (hessian.product / hessian.trace) }
}

/// Are both eigenvalues of `H - shift` on the tangent plane positive? `slack`, a small number, lets
/// the product be that much below zero relative to the square of the sum.
#[inline]
fn exceeds(hessian: &Hessian<f64>, shift: f64, slack: f64) -> bool {
    hessian.determinant(shift) > -slack * (hessian.trace * hessian.trace)
        && 2.0 * shift < hessian.trace
}

#[inline]
fn triple(v: &Vec3) -> Triple<f64> {
    Triple { x: v.x, y: v.y, z: v.z }
}

#[inline]
fn vector(t: Triple<f64>) -> Vec3 {
    Vec3::new(t.x, t.y, t.z)
}

/// Smallest radius of curvature anywhere on an ellipsoid or sphere [m]: shortest² / longest.
fn least_curvature_radius(shape: &Shape) -> f64 {
    let shortest = shape.inscribed_radius();
    shortest * shortest / shape.bounding_radius()
}

#[cfg(test)]
mod tests {
    use super::{CommonNormal, resolve_with};
    use crate::contact::lanes::Portable;
    use crate::contact::{Batch, Bodies, ContactResolver, Found, History, Outcome, Pair, Touch};
    use crate::ids::{ShapeId, Slot};
    use crate::math::{Mat3, Vec3};
    use crate::random::Random;
    use crate::shape::{Ellipsoid, Form, Shape, Sphere};

    /// Pairs of touching bodies far from each other, with the normals of a step before.
    struct Crowd {
        position: Vec<Vec3>,
        frame: Vec<Mat3>,
        form: Vec<Form>,
        shape: Vec<ShapeId>,
        library: Vec<Shape>,
        pairs: Vec<Pair>,
        history: Vec<History>,
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
                frame: Vec::new(),
                form: Vec::new(),
                shape: Vec::new(),
                library,
                pairs: Vec::new(),
                history: Vec::new(),
            };
            for k in 0..pairs {
                let mut random = Random::of(7, u64::from(k));
                let shapes = [k % 4, k / 4 % 4].map(|s| ShapeId(s as u16));
                let frames = [(); 2].map(|()| *random.rotation().to_rotation_matrix().matrix());
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
                    crowd.frame.push(frames[side]);
                    crowd.form.push(crowd.library[shapes[side].index()].form(&frames[side]));
                    crowd.shape.push(shapes[side]);
                }
                crowd.pairs.push(Pair { a: Slot(2 * k), b: Slot(2 * k + 1) });
                let normal = (normal + tilt * turned).normalize();
                crowd.history.push(History { normal, ..History::default() });
            }
            crowd
        }

        fn bodies(&self) -> Bodies<'_> {
            Bodies {
                position: &self.position,
                frame: Some(&self.frame),
                form: Some(&self.form),
                shape: &self.shape,
                library: &self.library,
                period: Vec3::repeat(f64::INFINITY),
            }
        }

        /// What a resolver finds, by pair.
        fn touches(&self, resolve: impl Fn(&Batch, &mut Found)) -> Vec<Touch> {
            let active: Vec<u32> = (0..self.pairs.len() as u32).collect();
            let mut found = Found::default();
            let bodies = self.bodies();
            let batch =
                Batch { pairs: &self.pairs, history: &self.history, active: &active, bodies };
            resolve(&batch, &mut found);
            assert_eq!(found.contacts.len(), self.pairs.len(), "every pair touches");
            found.contacts.sort_by_key(|contact| contact.pair);
            found.contacts.iter().map(|contact| contact.touch).collect()
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

    /// With and without vector registers, in nanometres and kilometres.
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

    /// The fast path's answers are those of the search: overlap to 4e-15, normal to 1e-10 rad.
    #[test]
    fn the_fast_path_agrees_with_the_search() {
        for turned in [0.0, 1e-8, 1e-5, 1e-4, 1e-3] {
            let crowd = Crowd::new(4001, turned, 1.0);
            let fast = crowd.touches(|batch, found| CommonNormal.resolve(batch, found));
            let bodies = crowd.bodies();
            for (pair, fast) in crowd.pairs.iter().zip(&fast) {
                let r = bodies.relative(*pair);
                let (a, b) = (bodies.posed(pair.a), bodies.posed(pair.b));
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
