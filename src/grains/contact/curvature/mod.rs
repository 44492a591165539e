//! Curvature of two bodies at their contact, as Hertz's law needs it.
//!
//! # The radius of a contact
//!
//! `h` is the support function of a body. Its second derivatives `H` on the plane across the normal are the inverse of the shape
//! operator: radii of curvature in place of curvatures. `H` of both bodies is taken in one frame of that plane. The relative
//! curvature is `K = H_A⁻¹ + H_B⁻¹`, or `H_A⁻¹` for a body on a plane. Its eigenvalues are `1/R'` and `1/R''` (Johnson 1985,
//! *Contact Mechanics*, DOI 10.1017/CBO9781139171731, section 4.1). The contact is as stiff as that of a sphere of radius
//! `R = √(R' R'') / F2³` on a plane ([`stiffening_of_ratio`]). This holds for any angle between the axes of both bodies.
//!
//! # The rest of the gradient
//!
//! The elastic energy `U = 8/15 E* √R δ^(5/2)` depends on the position of the contact, not on the overlap alone. Without the forces
//! of that dependence, an oblique impact of ellipsoids would gain or lose `1.5 δ/R` of its energy at any time step. With the
//! derivatives of `H` along the surface these forces have closed forms:
//!
//! - `c_A`, `c_B` are the changes of `ln √R` through `H_A` and `H_B` when the normal turns with both bodies at rest; `c` is their sum;
//! - `q = W⁻¹ c` with `W = H_A + H_B - δ`: the normal turns by `W⁻¹ dr` when the centres move by `dr` across it. `H` is that at the
//!   normal here and in `d`, also where `R` follows from an average;
//! - `d = ((c_B - H_B q) - (c_A - H_A q)) / 2`;
//! - `w = -2 (N H_B⁻¹ - H_B⁻¹ N)₁₂` with `N = ∂ ln √R / ∂K`: twisting one ellipse against the other.
//!
//! In addition to the force along the normal, the force `-U q` acts on B in the contact point, and the moment `U (n × d - w n)` about
//! it. A receives the opposite. On a plane `q = 0`, `d = -c` and `w = 0`. The force is of the order of `0.2 δ/R` of the normal force.
//! Momentum and angular momentum are conserved; energy is conserved to the accuracy of the integrator.
//!
//! # Shapes
//!
//! Ellipsoids and spheres are computed eight at once, with exact derivatives. With `v` the part of the support point across the
//! normal, `∂H_ij/∂k = -(H_ij v_k + H_jk v_i + H_ik v_j) / h`.
//!
//! Superellipsoids and their octants have flat sides and sharp crests, where radii of curvature change a thousandfold within a
//! thousandth of a radian. A contact is wider than that, so their `H` is an average over 0.1 rad around the normal:
//! `H = 2 / (N sin τ) Σ x(n cos τ + u sin τ) ⊗ u` over eight directions `u` across the normal, with `x` the support point. The average
//! is exact for a sphere and a plane. Its derivatives follow from those of `x`. It bounds the radii to some ten bounding radii;
//! `√(H² + s²)` keeps them above [`SHARPEST`] of the bounding radius.

#![expect(clippy::inline_always, reason = "see `lanes`")]

mod elliptic;

pub use elliptic::{LARGEST_RATIO, stiffening_of_ratio};

use super::{Bodies, Geometry, Pair, Posed};
use crate::ids::Slot;
use crate::lanes::{
    self, Eight, Gather, Kernel, Lanes, Row as _, RowPairs, Symmetric, Triple, WIDTH,
};
use crate::math::{Mat3, Vec3, directions};
use crate::shape::{Ellipsoid, Form, Shape};

/// Least radius of curvature of bodies with edges or crests, over their bounding radius.
pub const SHARPEST: f64 = 0.01;

/// Data of a contact that Hertz's law needs in addition to its overlap.
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Curvature {
    /// Root of the radius of a sphere that would be as stiff on a plane [√m].
    pub root_of_radius: f64,
    /// Force on B in addition to that along the normal, over the elastic energy [1/m].
    pub force: Vec3,
    /// Moment on B about the contact point, over the elastic energy [-].
    pub moment: Vec3,
    /// Padding to two rows of four.
    rest: f64,
}

/// Curvatures of several contacts.
#[derive(Clone, Copy)]
pub struct Curvatures<L> {
    /// See [`Curvature::root_of_radius`].
    pub root_of_radius: L,
    /// See [`Curvature::force`].
    pub force: Triple<L>,
    /// See [`Curvature::moment`].
    pub moment: Triple<L>,
}

impl<L: Eight> Curvatures<L> {
    /// Loads eight curvatures from memory.
    #[inline(always)]
    pub fn of(rows: &[&Curvature; WIDTH]) -> Self {
        let mut halves = [[&[0.0; 4]; WIDTH]; 2];
        for (lane, row) in rows.iter().enumerate() {
            let row: &[[f64; 4]; 2] = bytemuck::cast_ref(*row);
            [halves[0][lane], halves[1][lane]] = [&row[0], &row[1]];
        }
        let [root_of_radius, x, y, z] = L::columns_of_4(&halves[0]);
        let moment = Triple::of_four(&halves[1]);
        Self { root_of_radius, force: Triple { x, y, z }, moment }
    }
}

/// Finds the curvature of touching pairs in their order, one entry of `into` each. Either all pairs are with walls or none is.
pub fn find(bodies: &Bodies, pairs: &[Pair], geometry: &[Geometry], into: &mut Vec<Curvature>) {
    into.resize(pairs.len(), Curvature::default());
    lanes::dispatch(All { bodies, pairs, geometry, into });
}

/// Curvature of one pair of smooth bodies, or of one and a plane, for their common normal and overlap [m]; NaN for other bodies.
pub fn of_pair(a: &Posed, b: &Posed, normal: &Vec3, overlap: f64) -> Curvature {
    let frame = Frame::of(Triple { x: normal.x, y: normal.y, z: normal.z });
    let on_a = surface_of(a, normal, &frame, 1.0);
    let on_b = match b.shape {
        Shape::HalfSpace(_) | Shape::TriangleMesh(_) => None,
        _ => Some(surface_of(b, normal, &frame, -1.0)),
    };
    let Curvatures { root_of_radius, force, moment } =
        relative(&on_a, on_b.as_ref(), overlap, &frame);
    let vector = |t: Triple<f64>| Vec3::new(t.x, t.y, t.z);
    Curvature { root_of_radius, force: vector(force), moment: vector(moment), rest: 0.0 }
}

/// Root of the radius of the stiffest contact of a shape, at its flattest point on a plane [√m]; NaN for shapes that are not smooth.
pub fn flattest(shape: &Shape) -> f64 {
    let frame = Mat3::identity();
    let body = Posed::new(shape, &frame);
    let plane = Shape::HalfSpace(crate::shape::HalfSpace::at_reference(Vec3::z()));
    let plane = Posed { shape: &plane, ..body };
    let root = |normal: &Vec3| of_pair(&body, &plane, normal, 0.0).root_of_radius;
    let axes = (0..3).flat_map(|k| [Vec3::ith(k, 1.0), Vec3::ith(k, -1.0)]);
    if matches!(shape, Shape::Sphere(_) | Shape::Ellipsoid(_)) {
        return axes.map(|axis| root(&axis)).fold(f64::NAN, f64::max);
    }
    axes.chain(directions()).map(|normal| root(&normal)).fold(f64::NAN, f64::max)
}

/// Two unit vectors across a normal that form a right-handed frame with it.
///
/// For the opposite normal the second of them is reversed, bit by bit.
#[derive(Clone, Copy)]
struct Frame<L> {
    normal: Triple<L>,
    across: [Triple<L>; 2],
}

impl<L: Lanes> Frame<L> {
    /// Orthonormal frame by Duff et al. (2017), "Building an orthonormal basis, revisited".
    #[inline(always)]
    fn of(normal: Triple<L>) -> Self {
        let (zero, one) = (L::all(0.0), L::all(1.0));
        let Triple { x, y, z } = normal;
        let sign = L::all(-1.0).or(one, z.less(zero));
        let a = L::all(-1.0) / (sign + z);
        let b = x * y * a;
        let across = [
            Triple { x: one + sign * (x * x * a), y: sign * b, z: zero - sign * x },
            Triple { x: b, y: sign + y * y * a, z: zero - y },
        ];
        Self { normal, across }
    }

    /// The vector with these components across the normal.
    #[inline(always)]
    fn vector(&self, [x, y]: [L; 2]) -> Triple<L> {
        self.across[0].times(x).plus(self.across[1].times(y))
    }
}

/// A symmetric matrix on the plane across the normal: 11, 12, 22.
type Flat<L> = [L; 3];

/// Curvature of a body along a normal.
#[derive(Clone, Copy)]
struct Surface<L> {
    /// Radii of curvature `H` [m], averaged for a body with crests.
    radii: Flat<L>,
    /// Displacement of the support point per turn of the normal [m]: `H` at the normal.
    moves: Flat<L>,
    /// Changes of the radii when the normal turns towards the first and the second vector across it [m].
    change: [Flat<L>; 2],
}

impl<L: Lanes> Surface<L> {
    /// Curvature of an ellipsoid from its matrix [m²]; NaN for other shapes.
    #[inline(always)]
    fn of_form(form: &Symmetric<L>, frame: &Frame<L>) -> Self {
        let Frame { normal, across: [first, second] } = frame;
        let point = form.times(*normal);
        let inverse = L::all(1.0) / normal.dot(point).sqrt();
        let v = [first.dot(point) * inverse, second.dot(point) * inverse];
        let (along_first, along_second) = (form.times(*first), form.times(*second));
        let radii = [
            (first.dot(along_first) - v[0] * v[0]) * inverse,
            (first.dot(along_second) - v[0] * v[1]) * inverse,
            (second.dot(along_second) - v[1] * v[1]) * inverse,
        ];
        let minus = L::all(0.0) - inverse;
        let (u, w) = (minus * v[0], minus * v[1]);
        let (two, three) = (L::all(2.0), L::all(3.0));
        let mixed = [two * radii[1] * u + radii[0] * w, radii[2] * u + two * radii[1] * w];
        let change = [
            [three * radii[0] * u, mixed[0], mixed[1]],
            [mixed[0], mixed[1], three * radii[2] * w],
        ];
        Self { radii, moves: radii, change }
    }

    /// `Σ s_ij ∂H_ij/∂k`
    #[inline(always)]
    fn contracted(&self, [s11, s12, s22]: Flat<L>) -> [L; 2] {
        let two = L::all(2.0);
        let [[a, b, c], [d, e, f]] = self.change;
        [s11 * a + two * s12 * b + s22 * c, s11 * d + two * s12 * e + s22 * f]
    }
}

#[inline(always)]
fn determinant<L: Lanes>([a, b, c]: Flat<L>) -> L {
    a * c - b * b
}

/// Inverse of a matrix, from the inverse of its determinant.
#[inline(always)]
fn inverse<L: Lanes>([a, b, c]: Flat<L>, by: L) -> Flat<L> {
    [c * by, (L::all(0.0) - b) * by, a * by]
}

/// Product with a vector.
#[inline(always)]
fn times<L: Lanes>([a, b, c]: Flat<L>, [x, y]: [L; 2]) -> [L; 2] {
    [a * x + b * y, b * x + c * y]
}

/// `A (p + q K) A`
#[inline(always)]
fn between<L: Lanes>(a: Flat<L>, [p, q]: [L; 2], k: Flat<L>) -> Flat<L> {
    let middle = [p + q * k[0], q * k[1], p + q * k[2]];
    let [first, second] = [times(middle, [a[0], a[1]]), times(middle, [a[1], a[2]])];
    [
        a[0] * first[0] + a[1] * first[1],
        a[0] * second[0] + a[1] * second[1],
        a[1] * second[0] + a[2] * second[1],
    ]
}

/// Relative curvature from the surfaces of A and B, or of A on a plane, at an overlap [m].
#[inline(always)]
fn relative<L: Lanes>(
    a: &Surface<L>,
    b: Option<&Surface<L>>,
    overlap: L,
    frame: &Frame<L>,
) -> Curvatures<L> {
    let (zero, one, two, half) = (L::all(0.0), L::all(1.0), L::all(2.0), L::all(0.5));
    // Divisions are the slowest operation here: one is shared by both determinants.
    let of_a = determinant(a.radii);
    let (curved_a, curved_b) = if let Some(b) = b {
        let of_b = determinant(b.radii);
        let by = one / (of_a * of_b);
        (inverse(a.radii, by * of_b), inverse(b.radii, by * of_a))
    } else {
        (inverse(a.radii, one / of_a), [zero; 3])
    };
    let sum = [curved_a[0] + curved_b[0], curved_a[1] + curved_b[1], curved_a[2] + curved_b[2]];
    let trace = sum[0] + sum[2];
    let mean = determinant(sum).sqrt();
    let radius = one / mean;
    let [stiffening, by_m] = elliptic::stiffening(L::all(4.0) / (radius * trace + two));
    let root_of_radius = stiffening * radius.sqrt();

    // N = p + q K
    let by_mean = half * by_m * radius;
    let q = (L::all(0.25) + half * by_mean * trace) * (radius * radius);
    let p = by_mean - q * trace;
    let from_a = a.contracted(between(curved_a, [p, q], sum));
    let Some(b) = b else {
        let [x, y] = from_a;
        // The moment is n × d with d = -c, and `from_a` is -c.
        return Curvatures {
            root_of_radius,
            force: Triple::zero(),
            moment: frame.vector([zero - y, x]),
        };
    };
    let from_b = b.contracted(between(curved_b, [p, q], sum));
    // With the opposite sign, as H⁻¹ decreases when H grows.
    let total = [from_a[0] + from_b[0], from_a[1] + from_b[1]];
    let w = [
        a.moves[0] + b.moves[0] - overlap,
        a.moves[1] + b.moves[1],
        a.moves[2] + b.moves[2] - overlap,
    ];
    let slope = times(inverse(w, one / determinant(w)), total);
    let [by_a, by_b] = [times(a.moves, slope), times(b.moves, slope)];
    let d = [
        half * ((from_a[0] - by_a[0]) - (from_b[0] - by_b[0])),
        half * ((from_a[1] - by_a[1]) - (from_b[1] - by_b[1])),
    ];
    let twist = two
        * q
        * ((curved_a[0] * curved_b[1] + curved_a[1] * curved_b[2])
            - (curved_b[0] * curved_a[1] + curved_b[1] * curved_a[2]));
    let moment = frame.vector([zero - d[1], d[0]]).plus(frame.normal.times(twist));
    Curvatures { root_of_radius, force: frame.vector(slope), moment }
}

/// Matrix of an ellipsoid, also of a superellipsoid that is one [m²]; NaN for other shapes.
fn form_of(body: &Posed) -> Form {
    let square = body.scale * body.scale;
    let form = match body.shape {
        Shape::Superellipsoid(shape) => match shape.as_ellipsoid() {
            Some(Ellipsoid { semi_axes }) => {
                Shape::Ellipsoid(Ellipsoid { semi_axes }).form(body.frame)
            }
            None => body.shape.form(body.frame),
        },
        shape => shape.form(body.frame),
    };
    form.map(|entry| entry * square)
}

/// Angle around the normal over which radii of curvature are averaged [rad]: the turn of the surface across a contact with an overlap of a hundredth.
pub const WIDTH_OF_CONTACT: f64 = 0.1;
/// `√½`
const DIAGONAL: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// Directions around the normal.
const AROUND: [[f64; 2]; 8] = [
    [1.0, 0.0],
    [DIAGONAL, DIAGONAL],
    [0.0, 1.0],
    [-DIAGONAL, DIAGONAL],
    [-1.0, 0.0],
    [-DIAGONAL, -DIAGONAL],
    [0.0, -1.0],
    [DIAGONAL, -DIAGONAL],
];
/// Relative step of the finite differences of `bounded`.
const SMALL: f64 = 1e-4;
/// Size of the fourth power below which a normal counts as a corner of the cube, see [`fourfold`] [-].
const AT_CORNER: f64 = 1e-9;

/// Surface of one body along the normal, or against it with a `side` of -1.
fn surface_of(body: &Posed, normal: &Vec3, frame: &Frame<f64>, side: f64) -> Surface<f64> {
    let form @ [xx, yy, zz, xy, xz, yz] = form_of(body);
    if form.iter().all(|entry| entry.is_finite()) {
        return Surface::of_form(&Symmetric { xx, yy, zz, xy, xz, yz }, frame);
    }
    let local = |t: Triple<f64>| body.frame.tr_mul(&Vec3::new(t.x, t.y, t.z));
    let across = frame.across.map(local);
    let direction = body.frame.tr_mul(normal) * side;
    let [radii, along_first, along_second] = averaged(body, &direction, &across, side);
    let least = SHARPEST * body.bounding_radius();
    let change = [along_first, along_second].map(|change| {
        let beside = |part: f64| bounded([0, 1, 2].map(|k| radii[k] + change[k] * part), least);
        let (more, less) = (beside(SMALL), beside(-SMALL));
        [0, 1, 2].map(|k| (more[k] - less[k]) * (0.5 * side / SMALL))
    });
    Surface { radii: bounded(radii, least), moves: moves(body, &direction, &across), change }
}

/// Averaged radii of curvature of a body along a unit vector in its own axes, and their changes when it turns towards `across` [m].
///
/// The radii follow from support points around the direction. The direction and `across` form a right-handed frame, or a left-handed
/// one with a `side` of -1. The result is NaN for bodies with edges.
fn averaged(body: &Posed, direction: &Vec3, across: &[Vec3; 2], side: f64) -> [Flat<f64>; 3] {
    let (sine, cosine) = (libm::sin(WIDTH_OF_CONTACT), libm::cos(WIDTH_OF_CONTACT));
    let (around, twists) = fourfold(direction, across, side);
    let mut found = [[0.0; 3]; 3];
    for [first, second] in AROUND {
        let beside = around[0] * first + around[1] * second;
        let after = around[1] * first - around[0] * second;
        let Some(support) = body.shape.curved_support(&(direction * cosine + beside * sine)) else {
            return [[f64::NAN; 3]; 3];
        };
        let part = |v: &Vec3| across.map(|t| v.dot(&t));
        let (point, beside, after) = (part(&support.point), part(&beside), part(&after));
        let both = |[a, b]: [f64; 2], [c, d]: [f64; 2]| [2.0 * a * c, a * d + b * c, 2.0 * b * d];
        let mut add = |into: usize, of: Flat<f64>| (0..3).for_each(|k| found[into][k] += of[k]);
        add(0, both(point, beside));
        for k in 0..2 {
            let turned = across[k] * cosine - direction * (sine * beside[k])
                + (across[0] * after[0] + across[1] * after[1]) * (sine * twists[k]);
            let mut moved = part(&support.hessian_times(&turned));
            moved[k] -= support.point.dot(direction);
            add(1 + k, both(moved, beside));
            add(1 + k, both(point, after.map(|x| x * twists[k])));
        }
    }
    let factor = body.scale / (AROUND.len() as f64 * sine);
    found.map(|of| of.map(|sum| sum * factor))
}

/// Two unit vectors across a normal in the axes of a body, and their turns about it when it turns towards each of `across` [-].
///
/// When `u` turns around the normal by `φ`, `Σ (u·e_i)⁴` over the axes `e_i` has a part with `cos 4φ`. The first vector is at a maximum
/// of that part, so the eight directions do not depend on the names of the axes. They change smoothly with the normal, except at the
/// eight corners of a cube, where that part is 0.
fn fourfold(normal: &Vec3, across: &[Vec3; 2], side: f64) -> ([Vec3; 2], [f64; 2]) {
    // τ_i are the parts of the axes as complex numbers. Σ τ_i⁴ has four times the angle; its derivatives are -4 Σ τ_i³ n_i and i times that.
    let times = |[a, b]: [f64; 2], [c, d]: [f64; 2]| [a * c - b * d, a * d + b * c];
    let (mut fourth, mut slope) = ([0.0; 2], [0.0; 2]);
    for axis in 0..3 {
        let part = [across[0][axis], across[1][axis]];
        let cube = times(times(part, part), part);
        let power = times(cube, part);
        for k in 0..2 {
            fourth[k] += power[k];
            slope[k] += cube[k] * normal[axis];
        }
    }
    let size = fourth[0] * fourth[0] + fourth[1] * fourth[1];
    if size < AT_CORNER * AT_CORNER {
        return ([across[0], across[1] * side], [0.0; 2]);
    }
    let (sine, cosine) = libm::sincos(0.25 * libm::atan2(fourth[1], fourth[0]));
    let second = (across[1] * cosine - across[0] * sine) * side;
    let [real, imaginary] = times(slope, [fourth[0], -fourth[1]]);
    let twists = [imaginary, real].map(|part| -side * part / size);
    ([across[0] * cosine + across[1] * sine, second], twists)
}

/// Displacement of the support point across a unit vector in the body's axes when that turns [m]; NaN if the body has edges.
fn moves(body: &Posed, direction: &Vec3, across: &[Vec3; 2]) -> Flat<f64> {
    let Some(support) = body.shape.curved_support(direction) else { return [f64::NAN; 3] };
    let [first, second] = across.map(|t| support.hessian_times(&t) * body.scale);
    [first.dot(&across[0]), first.dot(&across[1]), second.dot(&across[1])]
}

/// `√(H² + s²)`, with `s` the least radius [m].
fn bounded([a, b, c]: Flat<f64>, least: f64) -> Flat<f64> {
    let [p, q, r] = [a * a + b * b + least * least, b * (a + c), b * b + c * c + least * least];
    let root = (p * r - q * q).sqrt();
    let by = 1.0 / (p + r + 2.0 * root).sqrt();
    [(p + root) * by, q * by, (r + root) * by]
}

/// Touching pairs.
struct All<'a, 'b> {
    bodies: &'a Bodies<'b>,
    pairs: &'a [Pair],
    geometry: &'a [Geometry],
    into: &'a mut [Curvature],
}

impl Kernel for All<'_, '_> {
    type Home = Self;

    #[inline(always)]
    fn run<L: Eight>(self) {
        let Self { bodies, pairs, geometry, into } = self;
        let first_facet = bodies.shape.len() - bodies.facets.len();
        let with_walls = pairs.first().is_some_and(|pair| pair.b.index() >= first_facet);
        let slots = if with_walls { bodies.shape.len() } else { first_facet };
        let rows = RowPairs::new(bytemuck::cast_slice(pairs), slots);
        let eights = geometry.chunks(WIDTH).zip(into.chunks_mut(WIDTH));
        for ((geometry, into), first) in eights.zip((0..).step_by(WIDTH)) {
            let mut room = [[0; 2]; WIDTH];
            let [a, b] = rows.eight(first, &mut room);
            let forms = match bodies.form {
                Some(forms) if !with_walls => {
                    [Symmetric::of(&a.rows(forms)), Symmetric::of(&b.rows(forms))]
                }
                _ => {
                    let of_a = Symmetric::of(&forms_in_place(bodies, a).each_ref());
                    let of_b = if with_walls { a } else { b };
                    [of_a, Symmetric::of(&forms_in_place(bodies, of_b).each_ref())]
                }
            };
            let mut touches: [&[f64; 4]; WIDTH] = [bytemuck::cast_ref(&geometry[0]); WIDTH];
            for (touch, of_lane) in touches.iter_mut().zip(geometry) {
                *touch = bytemuck::cast_ref(of_lane);
            }
            let [x, y, z, overlap] = L::columns_of_4(&touches);
            let frame = Frame::of(Triple { x, y, z });
            let on_a = Surface::of_form(&forms[0], &frame);
            let found = if with_walls {
                relative(&on_a, None, overlap, &frame)
            } else {
                let on_b = Surface::of_form(&forms[1], &frame);
                relative(&on_a, Some(&on_b), overlap, &frame)
            };
            let Triple { x, y, z } = found.force;
            let halves =
                [L::rows_of_4([found.root_of_radius, x, y, z]), found.moment.rows(L::all(0.0))];
            for (lane, into) in into.iter_mut().enumerate() {
                let row: &mut [[f64; 4]; 2] = bytemuck::cast_mut(into);
                halves[0][lane].write(&mut row[0]);
                halves[1][lane].write(&mut row[1]);
            }
            let known = L::all(0.0).less(found.root_of_radius);
            if known != u8::MAX {
                for (lane, into) in into.iter_mut().enumerate() {
                    if known >> lane & 1 == 0 {
                        *into = alone(bodies, pairs[first + lane], &geometry[lane]);
                    }
                }
            }
        }
    }
}

/// Matrices of eight ellipsoids or spheres in place [m²], computed where none are stored; NaN for other shapes.
#[inline(never)]
fn forms_in_place(bodies: &Bodies, slots: Gather) -> [Form; WIDTH] {
    let mut all = [[f64::NAN; 6]; WIDTH];
    for (lane, form) in all.iter_mut().enumerate() {
        let slot = slots.at(lane);
        *form = if let Some(kept) = bodies.form.and_then(|forms| forms.get(slot)) {
            *kept
        } else {
            let slot = Slot(slot as u32);
            bodies.posed_body(slot, &bodies.frame(slot)).form()
        };
    }
    all
}

/// Curvature of a pair that is not of two ellipsoids.
#[inline(never)]
fn alone(bodies: &Bodies, pair: Pair, geometry: &Geometry) -> Curvature {
    let frames = bodies.frames(pair);
    let (a, b) = bodies.posed(pair, &frames);
    of_pair(&a, &b, &geometry.normal, geometry.overlap)
}

#[cfg(test)]
mod tests {
    use super::{All, Curvature, find, of_pair};
    use crate::cell::Cell;
    use crate::contact::{Bodies, FacetInPlace, Geometry, Pair};
    use crate::ids::{ShapeId, Slot};
    use crate::lanes::{Kernel, Portable};
    use crate::math::{Mat3, Vec3};
    use crate::random::Random;
    use crate::shape::{Ellipsoid, Form, HalfSpace, Shape, Sphere, Superellipsoid};

    fn bits(all: &[Curvature]) -> Vec<u64> {
        bytemuck::cast_slice(all).to_vec()
    }

    /// Same bits with and without vector registers, in any company, and with stored or computed matrices. With A and B exchanged, forces
    /// and moments are the opposite, bit by bit.
    #[test]
    fn lanes_give_the_same_bits_everywhere() {
        let library = [
            Shape::Ellipsoid(Ellipsoid { semi_axes: Vec3::new(1.0, 0.5, 0.7) }),
            Shape::Sphere(Sphere { radius: 0.6 }),
            Shape::Superellipsoid(Superellipsoid::new(Vec3::new(1.0, 0.8, 0.7), [0.8, 1.1])),
            Shape::HalfSpace(HalfSpace::at_reference(Vec3::z())),
        ];
        for (kinds, on_wall) in [(2, false), (3, false), (2, true), (3, true)] {
            let mut random = Random::of(9, 0);
            let count = 61;
            let quaternion: Vec<_> = (0..count).map(|_| random.rotation()).collect();
            let facets = [FacetInPlace { frame: Mat3::identity(), number: 0 }];
            let position = vec![Vec3::zeros(); count + 1];
            let shape: Vec<_> =
                (0..count).map(|k| k % kinds).chain([3]).map(|k| ShapeId(k as u16)).collect();
            let form: Vec<Form> = (0..count)
                .map(|k| library[k % kinds].form(quaternion[k].to_rotation_matrix().matrix()))
                .collect();
            let pairs: Vec<_> = (0..count as u32 - 1)
                .map(|k| Pair { a: Slot(k), b: Slot(if on_wall { count as u32 } else { k + 1 }) })
                .collect();
            let normals = (0..pairs.len()).map(|_| random.rotation() * Vec3::x());
            let geometry: Vec<_> =
                normals.map(|normal| Geometry { normal, overlap: 0.02 }).collect();
            let bodies = Bodies {
                position: &position,
                quaternion: Some(&quaternion),
                facets: &facets,
                form: Some(&form),
                shape: &shape,
                library: &library,
                curvature_radius: &[],
                scale: None,
                cell: &Cell::OPEN,
            };
            let mut found = Vec::new();
            find(&bodies, &pairs, &geometry, &mut found);
            assert!(found.iter().all(|one| one.root_of_radius > 0.0));
            let mut into = vec![Curvature::default(); pairs.len()];
            All { bodies: &bodies, pairs: &pairs, geometry: &geometry, into: &mut into }
                .run::<Portable>();
            assert_eq!(bits(&found), bits(&into), "{kinds} kinds, on a wall: {on_wall}");
            let mut made = Vec::new();
            find(&Bodies { form: None, ..bodies }, &pairs, &geometry, &mut made);
            assert_eq!(bits(&found), bits(&made));
            for (k, pair) in pairs.iter().enumerate() {
                let frames = bodies.frames(*pair);
                let (a, b) = bodies.posed(*pair, &frames);
                let Geometry { normal, overlap } = geometry[k];
                let alone = of_pair(&a, &b, &normal, overlap);
                assert_eq!(bits(&found[k..=k]), bits(&[alone]), "{pair:?} alone");
                if !on_wall {
                    let swapped = of_pair(&b, &a, &-normal, overlap);
                    assert_eq!(alone.root_of_radius, swapped.root_of_radius);
                    assert_eq!((alone.force, alone.moment), (-swapped.force, -swapped.moment));
                }
            }
        }
    }
}
