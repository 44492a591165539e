//! Separate pairs of bodies: read from a file, resolved by a method, and timed.
//!
//! They serve to check a contact by hand, without a simulation around it.
//!
//! | file | content |
//! |---|---|
//! | [`read`] | pairs from CSV and JSON Lines |
//! | [`write`] | pairs and answers as CSV |

pub mod read;
pub mod write;

use crate::cell::Cell;
use crate::contact::{
    Batch, Bodies, ContactResolver, Found, Geometry, Method, Outcome, Pair, Posed, Previous, Table,
    Tally, Touch, Why, clearance, directions_tried, ordered, table,
};
use crate::ids::{ShapeId, Slot};
use crate::math::{Mat3, Quat, Vec3};
use crate::random::Random;
use crate::shape::union::Piece;
use crate::shape::{Form, Kind, Shape};
use std::collections::BTreeMap;
use std::hint::black_box;
use std::time::{Duration, Instant};

/// A body in the world.
#[derive(Clone, Debug)]
pub struct Body {
    /// Geometry.
    pub shape: Shape,
    /// Centre [m].
    pub centre: Vec3,
    /// Rotation from its own axes to the world.
    pub rotation: Quat,
}

impl Body {
    /// Pieces of a union, in place; for any other body the body itself.
    fn pieces(&self) -> Vec<Self> {
        let Shape::Union(union) = &self.shape else { return vec![self.clone()] };
        let place = |piece: &Piece| Self {
            shape: piece.shape.clone(),
            centre: self.centre + self.rotation * piece.centre,
            rotation: self.rotation * piece.rotation,
        };
        union.pieces().iter().map(place).collect()
    }
}

/// Any number of pairs, each with two bodies of its own, in the columns that resolvers read.
#[derive(Clone, Debug, Default)]
pub struct Pairs {
    names: Vec<String>,
    slots: Vec<Pair>,
    position: Vec<Vec3>,
    rotation: Vec<Quat>,
    frame: Vec<Mat3>,
    form: Vec<Form>,
    shape: Vec<ShapeId>,
    library: Vec<Shape>,
    curvature_radius: Vec<f64>,
    /// Shapes of the library by kind, and by bits of semi-axes and volume: hardly ever more than one.
    alike: BTreeMap<(Kind, [u64; 4]), Vec<ShapeId>>,
}

/// Error for more different shapes than a [`ShapeId`] can number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("more than 65,536 different shapes: split the file")]
pub struct TooManyShapes;

impl Pairs {
    /// Adds a pair.
    ///
    /// # Errors
    /// See [`TooManyShapes`].
    pub fn push(&mut self, name: String, a: Body, b: Body) -> Result<(), TooManyShapes> {
        let first = Slot(self.position.len() as u32);
        for body in [a, b] {
            let shape = self.shape_id(body.shape)?;
            self.position.push(body.centre);
            self.rotation.push(body.rotation);
            let frame = body.rotation.to_rotation_matrix().into_inner();
            self.form.push(self.library[shape.index()].form(&frame));
            self.frame.push(frame);
            self.shape.push(shape);
        }
        self.names.push(name);
        self.slots.push(Pair { a: first, b: Slot(first.0 + 1) });
        Ok(())
    }

    /// Id of a shape. Equal shapes are stored once.
    fn shape_id(&mut self, shape: Shape) -> Result<ShapeId, TooManyShapes> {
        let lengths = shape.semi_axes();
        let sizes = [lengths.x, lengths.y, lengths.z, shape.volume()].map(f64::to_bits);
        let alike = self.alike.entry((shape.kind(), sizes)).or_default();
        if let Some(known) = alike.iter().find(|id| self.library[id.index()] == shape) {
            return Ok(*known);
        }
        let id = u16::try_from(self.library.len()).map(ShapeId).map_err(|_| TooManyShapes)?;
        alike.push(id);
        self.curvature_radius.push(shape.smallest_curvature_radius());
        self.library.push(shape);
        Ok(id)
    }

    /// Number of pairs.
    pub const fn len(&self) -> usize {
        self.slots.len()
    }

    /// Whether there are no pairs.
    pub const fn is_empty(&self) -> bool {
        self.slots.is_empty()
    }

    /// Name of a pair.
    pub fn name(&self, pair: usize) -> &str {
        &self.names[pair]
    }

    /// A pair for a resolver: A, B, and `r` from the centre of A to the centre of B [m].
    pub fn posed(&self, pair: usize) -> (Posed<'_>, Posed<'_>, Vec3) {
        let pair = self.slots[pair];
        let posed = |slot: Slot| {
            let shape = &self.library[self.shape[slot.index()].index()];
            Posed::new(shape, &self.frame[slot.index()])
        };
        (posed(pair.a), posed(pair.b), self.bodies().relative(pair))
    }

    /// Bodies A and B of a pair.
    pub fn bodies_of(&self, pair: usize) -> [Body; 2] {
        let Pair { a, b } = self.slots[pair];
        [a, b].map(|slot| {
            let k = slot.index();
            let shape = self.library[self.shape[k].index()].clone();
            Body { shape, centre: self.position[k], rotation: self.rotation[k] }
        })
    }

    /// Whether one of the bodies of a pair is a union.
    pub fn has_union(&self, pair: usize) -> bool {
        let (a, b) = self.kinds(pair);
        [a, b].contains(&Kind::Union)
    }

    /// All pairs of a piece of A and a piece of B, if one of the bodies is a union.
    fn in_pieces(&self, pair: usize) -> Option<Self> {
        if !self.has_union(pair) {
            return None;
        }
        let [of_a, of_b] = self.bodies_of(pair).map(|body| body.pieces());
        let mut pairs = Self::default();
        for a in &of_a {
            for b in &of_b {
                let pushed = pairs.push(String::new(), a.clone(), b.clone());
                pushed.expect("a body has few pieces");
            }
        }
        Some(pairs)
    }

    /// Centre of A [m].
    pub fn centre_of_a(&self, pair: usize) -> Vec3 {
        self.position[self.slots[pair].a.index()]
    }

    fn bodies(&self) -> Bodies<'_> {
        Bodies {
            position: &self.position,
            quaternion: Some(&self.rotation),
            facets: &[],
            form: Some(&self.form),
            shape: &self.shape,
            library: &self.library,
            curvature_radius: &self.curvature_radius,
            scale: None,
            cell: &Cell::OPEN,
        }
    }

    fn kinds(&self, pair: usize) -> (Kind, Kind) {
        let (a, b, _) = self.posed(pair);
        ordered((a.shape.kind(), b.shape.kind()))
    }
}

/// A contact of two bodies of which one is a union, at one of the places where they touch.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    /// Overlap, normal, and contact point relative to the centre of A.
    pub touch: Touch,
    /// For a stiffness of 1 N/m: force of A on B [N], its moment about the centre of A [N m] and energy [J].
    pub acting: [f64; 7],
    /// The corresponding values by the law of a scene.
    pub by_law: Option<[f64; 7]>,
}

/// Result of a method for a pair.
///
/// For unions it is that of the pair of pieces that overlaps the most, or is the nearest. The places are added by callers that know contacts of
/// bodies.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    /// Contact geometry. For bodies that are apart, it is that of their nearest points with a negative overlap (see [`signed`]).
    pub touch: Result<Touch, Why>,
    /// Whether the bodies touch by this method: erosion reports contacts for some that do not.
    pub touching: bool,
    /// Stage of the method's chain that answered; empty without an answer.
    pub stage: &'static str,
    /// Number of directions that all stages tried, see [`directions_tried`].
    pub iterations: u64,
    /// For unions the contact at each place; empty for other bodies, and where nothing touches.
    pub places: Vec<Place>,
}

/// Contact geometry with a negative overlap for bodies that are apart.
///
/// The methods only determine *that* a pair is apart, with a lower bound of the clearance. Overlap and normal of such a pair are therefore
/// those of [`clearance`], whatever the method.
///
/// # Errors
/// The reason, if the method did not answer.
pub fn signed(outcome: Outcome, a: &Posed, b: &Posed, r: &Vec3) -> Result<Touch, Why> {
    match outcome {
        Outcome::Touching(touch) => Ok(touch),
        // Both are upper bounds of the overlap. Near touch, where GJK's direction is least certain, that of the method may be better.
        Outcome::Apart(bound) => {
            let nearest = clearance(a, b, r).ok_or(Why::NoConvergence)?;
            Ok(Touch { overlap: nearest.overlap.min(0.0 - bound), ..nearest })
        }
        Outcome::Failed(why) => Err(why),
    }
}

/// Checks an answer. Bodies so far apart that squares of their distance overflow have none.
fn finite(touch: Touch) -> Result<Touch, Why> {
    let all = touch.normal.iter().chain(touch.point.iter()).chain([&touch.overlap]);
    if all.into_iter().all(|x| x.is_finite()) { Ok(touch) } else { Err(Why::NotFinite) }
}

/// Resolver for pairs of particles; the table has one for all kinds.
fn serving(table: &Table, kinds: (Kind, Kind)) -> &dyn ContactResolver {
    table.get(kinds).expect("the table serves every pair of grains")
}

/// Resolves each pair by itself, without a warm start, in the order of the pairs.
pub fn resolve(pairs: &Pairs, method: &Method) -> Vec<Answer> {
    let table = table(method, &Kind::ALL);
    let mut found = Found::default();
    let one = |index: usize| {
        if let Some(pieces) = pairs.in_pieces(index) {
            return deepest(&pieces, &resolve(&pieces, method), &pairs.centre_of_a(index));
        }
        let resolver = serving(&table, pairs.kinds(index));
        found.clear();
        found.tally = Tally::default();
        let batch = Batch {
            pairs: &pairs.slots[index..=index],
            previous: &[Previous::NONE],
            geometry: &[],
            active: &[0],
            bodies: pairs.bodies(),
        };
        let before = directions_tried();
        resolver.resolve(&batch, &mut found);
        let iterations = directions_tried() - before;
        let contact = found.contacts.iter().next();
        let outcome = match (contact, &found.apart[..], &found.failed[..]) {
            (Some(contact), [], []) => Outcome::Touching(contact.touch),
            (None, [(_, clearance)], []) => Outcome::Apart(*clearance),
            (None, [], [(_, why)]) => Outcome::Failed(*why),
            _ => unreachable!("a pair goes into one of the lists"),
        };
        let (a, b, r) = pairs.posed(index);
        let touch = signed(outcome, &a, &b, &r).and_then(finite);
        // The tally counts pairs that the first stage passed on.
        let stage = found.tally.fallbacks.iter().position(|&n| n > 0).map_or(0, |k| k + 1);
        Answer {
            // A stage may find the pair apart, and the clearance may still fail.
            stage: if touch.is_ok() { resolver.stages()[stage] } else { "" },
            touch,
            touching: matches!(outcome, Outcome::Touching(_)),
            iterations,
            places: Vec::new(),
        }
    };
    (0..pairs.len()).map(one).collect()
}

/// The answer of the pair of pieces that overlaps the most, relative to the centre of A; without an answer if any pair has none.
fn deepest(pieces: &Pairs, answers: &[Answer], centre_of_a: &Vec3) -> Answer {
    let overlap = |answer: &Answer| answer.touch.map_or(f64::INFINITY, |touch| touch.overlap);
    let all = answers.iter().enumerate();
    let deepest = all.max_by(|(_, one), (_, other)| overlap(one).total_cmp(&overlap(other)));
    let (index, answer) = deepest.expect("a body has a piece");
    let from = pieces.centre_of_a(index) - centre_of_a;
    Answer {
        touch: answer.touch.map(|touch| Touch { point: touch.point + from, ..touch }),
        iterations: answers.iter().map(|answer| answer.iterations).sum(),
        ..answer.clone()
    }
}

/// Time per pair [ns]: the mean over blocks of pairs of the median over repeats.
///
/// The median reduces the influence of other activity of the machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timing {
    /// One pair after the other, without a warm start.
    pub cold: f64,
    /// One pair after the other, from the normals of a first pass, each changed by 1e-4 in a random direction, as after a time step.
    ///
    /// Pairs that are apart have no normal to start from.
    pub warm: f64,
    /// A block at once, from the same normals, as in a simulation.
    pub batched: f64,
}

/// Number of pairs timed together: their time is well below a time slice of the system.
const BLOCK: usize = 256;
/// Least duration of a measurement, which repeats its block until then.
const SHORTEST: Duration = Duration::from_micros(50);
/// Perturbation of the normals of warm starts.
const PERTURBATION: f64 = 1e-4;

/// Measures the time of a method for pairs whose `answers` are known, with `repeats` measurements of each block.
///
/// The time of clearances is not included. Pairs with unions are left out.
pub fn time(pairs: &Pairs, answers: &[Answer], method: &Method, repeats: usize) -> Timing {
    let table = table(method, &Kind::ALL);
    let mut groups: BTreeMap<(Kind, Kind), Vec<u32>> = BTreeMap::new();
    for pair in (0..pairs.len()).filter(|&pair| !pairs.has_union(pair)) {
        groups.entry(pairs.kinds(pair)).or_default().push(pair as u32);
    }
    let geometry: Vec<Geometry> =
        (0_u64..).zip(answers).map(|(id, answer)| last_step(id, answer)).collect();

    // Mean over pairs [ns], from the seconds of each block.
    let mean = |taken: &mut dyn FnMut(&dyn ContactResolver, &[u32]) -> f64| {
        let mut seconds = 0.0;
        for (kinds, group) in &groups {
            let resolver = serving(&table, *kinds);
            seconds += group.chunks(BLOCK).map(|block| taken(resolver, block)).sum::<f64>();
        }
        1e9 * seconds / groups.values().map(Vec::len).sum::<usize>() as f64
    };
    let one_by_one = |warm: bool| {
        mean(&mut |resolver, block| {
            median(repeats, || {
                for &index in block {
                    let (a, b, r) = pairs.posed(index as usize);
                    let last = &geometry[index as usize];
                    let start = (warm && last.touched()).then_some(&last.normal);
                    black_box(resolver.touch(&a, &b, &r, start));
                }
            })
        })
    };
    let mut found = Found::default();
    Timing {
        cold: one_by_one(false),
        warm: one_by_one(true),
        batched: mean(&mut |resolver, block| {
            // A separate list, because the resolution of a batch reads the whole list once.
            let slots: Vec<Pair> = block.iter().map(|&k| pairs.slots[k as usize]).collect();
            let geometry: Vec<Geometry> = block.iter().map(|&k| geometry[k as usize]).collect();
            let previous: Vec<Previous> = (0..block.len()).map(Previous::at).collect();
            let active: Vec<u32> = (0..block.len() as u32).collect();
            median(repeats, || {
                found.clear();
                let batch = Batch {
                    pairs: &slots,
                    previous: &previous,
                    geometry: &geometry,
                    active: &active,
                    bodies: pairs.bodies(),
                };
                resolver.resolve(&batch, &mut found);
                black_box(&found);
            })
        }),
    }
}

/// Geometry of a pair that has moved a little since it was resolved.
fn last_step(id: u64, answer: &Answer) -> Geometry {
    match &answer.touch {
        Ok(touch) if answer.touching => {
            let off = Random::of(1, id).rotation() * Vec3::x() * PERTURBATION;
            Geometry { normal: (touch.normal + off).normalize(), ..Geometry::default() }
        }
        _ => Geometry::default(),
    }
}

/// Median over `repeats` of the time of a pass [s].
fn median(repeats: usize, mut pass: impl FnMut()) -> f64 {
    let mut samples: Vec<f64> = (0..repeats)
        .map(|_| {
            let start = Instant::now();
            let mut passes = 0.0;
            while passes == 0.0 || start.elapsed() < SHORTEST {
                pass();
                passes += 1.0;
            }
            start.elapsed().as_secs_f64() / passes
        })
        .collect();
    samples.sort_by(f64::total_cmp);
    samples.get(samples.len() / 2).copied().unwrap_or(f64::NAN)
}
