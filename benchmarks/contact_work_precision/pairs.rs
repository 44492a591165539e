//! Random pairs whose overlap, normal and contact point are known by construction.

use crate::facets;
use dem_mpi::cell::Cell;
use dem_mpi::contact::{
    Batch, Bodies, CommonNormal, ContactResolver, Geometry, Outcome, Pair, Posed, Previous,
    SmoothCommonNormal, Touching, touch_along,
};
use dem_mpi::ids::{ShapeId, Slot};
use dem_mpi::math::{Mat3, Quat, Vec3};
use dem_mpi::random::Random;
use dem_mpi::shape::{Ellipsoid, Form, Kind, Polyhedron, Shape, Superellipsoid};

/// A named shape.
pub(crate) struct Grain {
    pub(crate) name: String,
    pub(crate) shape: Shape,
}

/// Short axis of every shape: the unit of length.
const SHORT_AXIS: f64 = 1.0;

/// Shapes of the benchmark, all with a short axis of 1 (about 1 for polyhedra).
pub(crate) fn grains() -> Vec<Grain> {
    let half = 0.5 * SHORT_AXIS;
    let grain = |name: String, axes: [f64; 3]| Grain {
        name,
        shape: Shape::Ellipsoid(Ellipsoid { semi_axes: Vec3::from(axes) * half }),
    };
    let mut all = vec![grain("sphere".into(), [1.0, 1.0, 1.0])];
    for ratio in [2.0, 4.0, 10.0] {
        all.push(grain(format!("prolate {ratio}"), [ratio, 1.0, 1.0]));
        all.push(grain(format!("oblate {ratio}"), [ratio, ratio, 1.0]));
    }
    for [e1, e2] in [[0.5, 0.5], [1.0, 0.5], [1.5, 1.5]] {
        let semi_axes = Vec3::new(2.0, 1.0, 1.0) * half;
        let shape = Shape::Superellipsoid(Superellipsoid::new(semi_axes, [e1, e2]));
        all.push(Grain { name: format!("superellipsoid {e1} {e2}"), shape });
    }
    all.extend(
        [("box", corners_of_box()), ("icosahedron", corners_of_icosahedron())].map(polyhedron),
    );
    let mut random = Random::of(40, 0);
    let round = (0..40).map(|_| direction(&mut random).component_mul(&Vec3::new(2.0, 1.0, 1.0)));
    all.push(polyhedron(("hull of 40", round.map(|p| p * half).collect())));
    all
}

pub(crate) fn polyhedron((name, points): (&str, Vec<Vec3>)) -> Grain {
    let polyhedron = Polyhedron::new(&points).expect("these points are corners of a body");
    Grain { name: name.into(), shape: Shape::Polyhedron(Box::new(polyhedron)) }
}

pub(crate) fn corners_of_box() -> Vec<Vec3> {
    let sign = |k: u32, bit: u32| f64::from(k >> bit & 1) - 0.5;
    (0..8).map(|k| Vec3::new(2.0 * sign(k, 0), 1.5 * sign(k, 1), sign(k, 2))).collect()
}

/// Corners with edges of 0.66: a distance of 1 between opposite faces.
pub(crate) fn corners_of_icosahedron() -> Vec<Vec3> {
    let golden = 0.5 * (1.0 + 5f64.sqrt());
    let signs = [-1.0, 1.0];
    let rectangle = signs.into_iter().flat_map(|i| signs.map(|j| [0.0, i, j * golden]));
    let turned = rectangle.flat_map(|[x, y, z]| [[x, y, z], [y, z, x], [z, x, y]]);
    turned.map(|p| Vec3::from(p) * (0.5 / 1.511_522_628_152_341)).collect()
}

/// Known geometry of a pair.
#[derive(Clone, Copy)]
pub(crate) struct Truth {
    /// Overlap, or clearance if negative [short axes].
    pub(crate) overlap: f64,
    pub(crate) normal: Vec3,
    /// Contact point from the centre of A.
    pub(crate) point: Vec3,
}

/// Pairs of separate bodies, in the form in which a rank stores them.
#[derive(Default)]
pub(crate) struct Pairs {
    position: Vec<Vec3>,
    quaternion: Vec<Quat>,
    frame: Vec<Mat3>,
    form: Vec<Form>,
    shape: Vec<ShapeId>,
    library: Vec<Shape>,
    curvature_radius: Vec<f64>,
    slots: Vec<Pair>,
    active: Vec<u32>,
    previous: Vec<Previous>,
    pub(crate) truth: Vec<Truth>,
}

impl Pairs {
    pub(crate) fn of(library: Vec<Shape>) -> Self {
        let curvature_radius = library.iter().map(Shape::smallest_curvature_radius).collect();
        Self { library, curvature_radius, ..Self::default() }
    }

    /// Adds two bodies with this overlap along this normal.
    ///
    /// The normal is the common one, because it is that of both support points. No other direction has a smaller overlap
    /// if the bodies do not touch, or touch by less than their least radii of curvature.
    pub(crate) fn push(
        &mut self,
        shapes: [ShapeId; 2],
        quaternions: [Quat; 2],
        overlap: f64,
        normal: Vec3,
    ) {
        let frames = frames(quaternions);
        let [a, b] =
            [0, 1].map(|side| Posed::new(&self.library[shapes[side].index()], &frames[side]));
        let on_a = a.support(&normal);
        let r = on_a - b.support(&-normal) - normal * overlap;
        let truth = Truth { overlap, normal, point: on_a - normal * (0.5 * overlap) };
        self.push_known(shapes, quaternions, r, truth);
    }

    /// Adds two bodies with known geometry, with `r` from A to B.
    pub(crate) fn push_known(
        &mut self,
        shapes: [ShapeId; 2],
        quaternions: [Quat; 2],
        r: Vec3,
        truth: Truth,
    ) {
        let frames = frames(quaternions);
        let [a, b] =
            [0, 1].map(|side| Posed::new(&self.library[shapes[side].index()], &frames[side]));
        self.truth.push(truth);
        self.form.extend([a.shape.form(a.frame), b.shape.form(b.frame)]);
        self.position.extend([Vec3::zeros(), r]);
        self.quaternion.extend(quaternions);
        self.frame.extend(frames);
        self.shape.extend(shapes);
        let pair = self.slots.len() as u32;
        self.slots.push(Pair { a: Slot(2 * pair), b: Slot(2 * pair + 1) });
        self.active.push(pair);
        self.previous.push(Previous::at(pair as usize));
    }

    /// Pairs of case III of Lai et al. (2021): both rotations and the line of centres are uniform. `overlap` gives the
    /// overlap (a clearance if negative) from a number uniform in (0, 1].
    pub(crate) fn case_3(grain: &Grain, count: u64, overlap: impl Fn(f64) -> f64) -> Self {
        let mut pairs = Self::of(vec![grain.shape.clone()]);
        for id in 0..count {
            let mut random = Random::of(2021, id);
            let quaternions = [(); 2].map(|()| random.rotation());
            let frames = frames(quaternions);
            let towards = direction(&mut random);
            let overlap = overlap(1.0 - random.unit());
            if grain.shape.kind() == Kind::Polyhedron {
                let [a, b] = frames.each_ref().map(|frame| Posed::new(&grain.shape, frame));
                let (r, normal) = facets::placed(&a, &b, &towards, overlap);
                let point = touch_along(&a, &b, &r, &normal).point;
                pairs.push_known([ShapeId(0); 2], quaternions, r, Truth { overlap, normal, point });
            } else {
                let normal = normal_along(&grain.shape, &frames, &towards);
                pairs.push([ShapeId(0); 2], quaternions, overlap, normal);
            }
        }
        pairs
    }

    pub(crate) fn bodies(&self) -> Bodies<'_> {
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

    pub(crate) fn batch<'a>(&'a self, geometry: &'a [Geometry]) -> Batch<'a> {
        Batch {
            pairs: &self.slots,
            previous: &self.previous,
            geometry,
            active: &self.active,
            bodies: self.bodies(),
        }
    }

    /// One pair in place.
    pub(crate) fn pair(&self, index: usize) -> (Posed<'_>, Posed<'_>, Vec3) {
        let pair = self.slots[index];
        let posed = |slot: Slot| {
            let shape = &self.library[self.shape[slot.index()].index()];
            Posed::new(shape, &self.frame[slot.index()])
        };
        (posed(pair.a), posed(pair.b), self.bodies().relative(pair))
    }

    /// Empty memory of the last step for every pair.
    pub(crate) fn strangers(&self) -> Vec<Geometry> {
        vec![Geometry::default(); self.slots.len()]
    }

    /// Normals of the previous step: those that a method found, off by `turned` rad in a random direction; for separate
    /// pairs, the true ones.
    pub(crate) fn acquaintances(&self, found: &Touching, turned: f64) -> Vec<Geometry> {
        let unless_it_touches =
            |truth: &Truth| if truth.overlap > 0.0 { Vec3::zeros() } else { truth.normal };
        let mut normals: Vec<Vec3> = self.truth.iter().map(unless_it_touches).collect();
        for contact in found.iter() {
            normals[contact.pair as usize] = contact.touch.normal;
        }
        let remembered = |(id, normal): (u64, Vec3)| {
            if normal == Vec3::zeros() {
                return Geometry::default();
            }
            let aside = normal.cross(&direction(&mut Random::of(1, id))).normalize();
            Geometry { normal: (normal + aside * turned).normalize(), ..Geometry::default() }
        };
        (0..).zip(normals).map(remembered).collect()
    }
}

pub(crate) fn frames(quaternions: [Quat; 2]) -> [Mat3; 2] {
    quaternions.map(|q| q.to_rotation_matrix().into_inner())
}

/// A direction uniform on the sphere.
pub(crate) fn direction(random: &mut Random) -> Vec3 {
    random.rotation() * Vec3::x()
}

/// The common normal from a given start, or from the method's own; for smooth bodies only.
pub(crate) fn common_normal(a: &Posed, b: &Posed, r: &Vec3, start: Option<&Vec3>) -> Outcome {
    if a.shape.kind().is_ellipsoidal() && b.shape.kind().is_ellipsoidal() {
        CommonNormal.touch(a, b, r, start)
    } else {
        SmoothCommonNormal.touch(a, b, r, start)
    }
}

/// The common normal of two bodies that touch by a hundredth of the short axis, with B in this direction from A. The
/// distance is found by bisection.
fn normal_along(shape: &Shape, frames: &[Mat3; 2], towards: &Vec3) -> Vec3 {
    let [a, b] = frames.each_ref().map(|frame| Posed::new(shape, frame));
    let mut normal = *towards;
    let (mut near, mut far) = (shape.inscribed_radius(), 2.0 * shape.bounding_radius());
    for _ in 0..20 {
        let middle = 0.5 * (near + far);
        match common_normal(&a, &b, &(towards * middle), None) {
            Outcome::Touching(touch) if touch.overlap > 0.01 * SHORT_AXIS => {
                near = middle;
                normal = touch.normal;
            }
            _ => far = middle,
        }
    }
    normal
}
