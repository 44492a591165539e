//! The kernel of laws by itself: baseline registers against those of this processor, and independence of contacts from their
//! neighbours in a register.

use dem_mpi::contact::{Geometry, Pair, Patch, Previous, StateColumn};
use dem_mpi::ids::{MaterialId, ShapeId, Slot};
use dem_mpi::lanes::Registers;
use dem_mpi::law::linear::{Constants, Settings};
use dem_mpi::law::{Choice, Dashpots, ForceLaw, Interactions, Last, Sums, Work};
use dem_mpi::math::Vec3;
use dem_mpi::particles::Particles;
use dem_mpi::particles::crowd::crowd;
use dem_mpi::random::Random;
use dem_mpi::shape::{Polyhedron, Shape};

/// Contacts with their memory.
#[derive(Clone, Default)]
struct Touching {
    pairs: Vec<Pair>,
    now: Vec<Geometry>,
    points: Vec<Vec3>,
    from: Vec<Previous>,
    geometry: Vec<Geometry>,
    state: Vec<f64>,
    patches: Vec<Patch>,
}

/// Result of a law.
struct Found {
    state: Vec<f64>,
    forces: Vec<Vec3>,
    /// Particles with their force sums.
    particles: Particles,
}

impl Touching {
    fn of(&self, place: usize) -> Self {
        Self {
            pairs: vec![self.pairs[place]],
            now: vec![self.now[place]],
            points: self.points.get(place).copied().into_iter().collect(),
            from: vec![self.from[place]],
            patches: self.patches.get(place).copied().into_iter().collect(),
            ..self.clone()
        }
    }

    fn apply(&self, law: &dyn ForceLaw, particles: &Particles) -> Found {
        let count = self.pairs.len();
        let mut particles = particles.clone();
        let mut sums = Sums::default();
        sums.begin(&mut particles);
        let mut state = vec![f64::NAN; count * stride(law)];
        let mut forces = vec![Vec3::zeros(); count];
        let mut work = Work {
            pairs: &self.pairs,
            geometry: &self.now,
            points: &self.points,
            patches: &self.patches,
            curvatures: &[],
            shares: &[],
            from: &self.from,
            last: Last { pairs: &self.pairs, geometry: &self.geometry, state: &self.state },
            separated: &[],
            state: &mut state,
            forces: &mut forces,
        };
        law.apply(&mut work, &particles, 1e-5, &mut sums);
        sums.end(&mut particles);
        Found { state, forces, particles }
    }

    fn apply_anywhere(&self, law: &dyn ForceLaw, particles: &Particles) -> Found {
        assert!(Registers::widest() > Registers::Any, "this processor has wider ones");
        Registers::Any.at_most(|| self.apply(law, particles))
    }
}

/// Count of remembered numbers per contact.
fn stride(law: &dyn ForceLaw) -> usize {
    StateColumn::total_width(law.state())
}

/// Count of the model's own numbers among them.
fn width(law: &dyn ForceLaw) -> usize {
    let of_model = |column: &&StateColumn| ["spring", "normal_force"].contains(&&*column.name);
    law.state().iter().filter(of_model).map(|column| column.width).sum()
}

impl Found {
    fn bits(&self, place: usize, width: usize) -> Vec<u64> {
        let state = &self.state[place * width..][..width];
        self.forces[place].iter().chain(state).map(|x| x.to_bits()).collect()
    }

    fn bits_of_sums(&self) -> Vec<u64> {
        let torque = &self.particles.spin.as_ref().unwrap().torque;
        let sums = self.particles.force.iter().chain(torque);
        sums.flat_map(|sum| {
            sum.vector.iter().chain([&sum.number]).map(|x| x.to_bits()).collect::<Vec<_>>()
        })
        .collect()
    }
}

/// Identical bits with and without vector registers and next to any other contacts. Cases: sliding and sticking, with and without
/// friction and dashpots, first and later steps of a contact.
#[test]
fn lanes_give_the_same_bits_everywhere() {
    for sized in [false, true] {
        same_bits(&crowd(40, sized));
    }
}

/// A chain of particles, each in contact with the next; every fifth contact is new.
fn touching(
    particles: &Particles,
    law: &dyn ForceLaw,
    interactions: &Interactions<Constants>,
    all_spheres: bool,
) -> Touching {
    let has = |column: &str| law.state().iter().any(|state| state.name == column);
    let mut random = Random::of(5, 0);
    let mut vector = |size: f64| Vec3::from_fn(|_, _| size * random.signed());
    let mut other = Random::of(6, 0);
    let mut acted = |size: f64| Vec3::from_fn(|_, _| size * other.signed());
    let mut before = Touching::default();
    for k in 0..particles.owned as u32 - 1 {
        let pair = Pair { a: Slot(k), b: Slot(k + 1) };
        before.pairs.push(pair);
        let normal = vector(1.0).normalize();
        before.now.push(Geometry { normal, overlap: 1e-5 });
        if !all_spheres {
            before.points.push(vector(1e-3));
        }
        if k % 5 == 0 {
            before.from.push(Previous::NONE);
            continue;
        }
        before.from.push(Previous::at(before.geometry.len()));
        let last = (normal + vector(1e-3)).normalize();
        before.geometry.push(Geometry { normal: last, overlap: 9e-6 });
        let across = vector(5e-6 * f64::from(k % 3));
        let mut spring = across - last * across.dot(&last);
        let of = |slot| particles.material(slot);
        if !interactions.of(of(pair.a), of(pair.b)).is_frictional() {
            spring = Vec3::zeros();
        }
        if has("spring") {
            before.state.extend(spring.iter());
        }
        if has("normal_force") {
            before.state.push(9e-3);
        }
        if law.needs().patches {
            before.state.extend(vec![1e-7; stride(law) - width(law)]);
        } else {
            before.state.extend(acted(1e-3).iter());
            if has("viscous_force") {
                before.state.extend(acted(1e-4).iter());
            }
        }
    }
    before
}

fn linear(interactions: &Interactions<Constants>, particles: &Particles) -> Box<dyn ForceLaw> {
    let dashpots = Dashpots { foreseen: true, ..Dashpots::default() };
    let settings = Settings { interactions: interactions.clone(), dashpots };
    Choice::Linear(settings).law(&particles.library)
}

/// In a list with face contacts, the others have the bits that they have without any. Cases: normal and sliding, first and later
/// steps, more than a window of them. Face contacts have identical bits next to any others, too.
#[test]
fn contacts_without_a_patch_do_not_see_those_with_one() {
    let box_of = |size: f64| {
        let corner = |k: u32| Vec3::from_fn(|i, _| if k >> i & 1 == 1 { size } else { -size });
        Polyhedron::new(&(0..8).map(corner).collect::<Vec<_>>()).expect("a box")
    };
    let rough = Constants {
        normal_stiffness: 1e3,
        tangential_stiffness: 800.0,
        friction: 0.3,
        normal_damping_ratio: 0.2,
        tangential_damping_ratio: 0.0,
    };
    let smooth = Constants { friction: 0.0, ..rough };
    // With faces, the record of tangential dashpot losses is in other numbers than without.
    let damped = Constants { tangential_damping_ratio: 0.1, ..rough };
    for (sized, own, other) in [
        (false, rough, rough),
        (true, rough, rough),
        (false, rough, smooth),
        (false, damped, damped),
    ] {
        let has_dashpots = own.tangential_damping_ratio > 0.0;
        let interactions = Interactions::new(&[own, other]);
        let plain = crowd(300, sized);
        let law = linear(&interactions, &plain);
        let without = touching(&plain, &*law, &interactions, false).apply(&*law, &plain);
        let without_faces = stride(&*law);

        let mut particles = crowd(300, sized);
        let solid = Shape::Polyhedron(Box::new(box_of(1e-3)));
        particles.library.push("box", solid, MaterialId(1), 2500.0);
        particles.library.particle_shapes += 1;
        let is_box = |slot: usize| slot % 7 >= 5 || (100..140).contains(&slot);
        for slot in 0..particles.owned {
            if is_box(slot) {
                particles.shape[slot] = ShapeId(2);
            }
        }
        let law = linear(&interactions, &particles);
        let (width, stride) = (width(&*law), stride(&*law));
        assert_eq!(stride, width + 11);
        let mut before = touching(&particles, &*law, &interactions, false);
        let covariance = [2e-7, 3e-7, 1e-7, 1e-8, -2e-8, 3e-8];
        let of_faces = Patch { gain: 0.9, lever: Vec3::z() * 1e-6, covariance };
        let has_patch = |pair: &Pair| is_box(pair.a.index()) && is_box(pair.b.index());
        before.patches = before
            .pairs
            .iter()
            .map(|p| if has_patch(p) { of_faces } else { Patch::POINT })
            .collect();

        let found = before.apply(&*law, &particles);
        let portable = before.apply_anywhere(&*law, &particles);
        assert_eq!(found.bits_of_sums(), portable.bits_of_sums());
        let mut compared = 0;
        for (place, pair) in before.pairs.iter().enumerate() {
            let bits = found.bits(place, stride);
            assert_eq!(bits, portable.bits(place, stride), "pair {place}");
            let alone = before.of(place).apply(&*law, &particles);
            assert_eq!(bits, alone.bits(0, stride), "pair {place} alone");
            if !is_box(pair.a.index()) && !is_box(pair.b.index()) {
                let of_model = 3 + width;
                let without = without.bits(place, without_faces);
                assert!(has_dashpots || bits[..of_model] == without[..of_model], "{place}");
                compared += 1;
            }
        }
        assert!(compared > 128 && compared + 40 < before.pairs.len(), "{compared}");
        // Particles of which neither contact involves a box.
        for slot in (1..299).filter(|slot| (slot - 1..=slot + 1).all(|k| !is_box(k))) {
            // Energies depend on the remembered last force, which differs.
            let sums = [&found, &without].map(|Found { particles, .. }| {
                let torque = &particles.spin.as_ref().unwrap().torque;
                [particles.force[slot].vector, torque[slot].vector]
            });
            assert!(has_dashpots || sums[0] == sums[1], "{slot}");
        }
    }
}

fn same_bits(particles: &Particles) {
    let rough = Constants {
        normal_stiffness: 1e3,
        tangential_stiffness: 800.0,
        friction: 0.3,
        ..Constants::default()
    };
    let smooth = Constants { friction: 0.0, ..rough };
    let damped = Constants { normal_damping_ratio: 0.2, tangential_damping_ratio: 0.1, ..rough };
    let damped_only = Constants { friction: 0.0, ..damped };
    for (name, mixed, own, other, all_spheres, width) in [
        ("plain", smooth, rough, rough, false, 3),
        ("damped", smooth, damped, rough, false, 4),
        ("without friction", smooth, damped_only, damped_only, false, 1),
        ("springs alone", smooth, smooth, smooth, false, 0),
        ("spheres", smooth, rough, rough, true, 3),
    ] {
        let mut interactions = Interactions::new(&[own, other]);
        interactions.set(MaterialId(0), MaterialId(1), mixed);
        let law = linear(&interactions, particles);
        assert_eq!(self::width(&*law), width, "{name}");
        let before = touching(particles, &*law, &interactions, all_spheres);
        let dispatched = before.apply(&*law, particles);
        let portable = before.apply_anywhere(&*law, particles);
        assert_eq!(dispatched.bits_of_sums(), portable.bits_of_sums(), "{name}");
        let width = stride(&*law);
        for place in 0..before.pairs.len() {
            let bits = dispatched.bits(place, width);
            assert_eq!(bits, portable.bits(place, width), "{name}, pair {place}");
            let alone = before.of(place).apply(&*law, particles);
            assert_eq!(bits, alone.bits(0, width), "{name}, pair {place} alone");
        }
    }
}
