//! Shared helpers of the tests: simulations from a scene's text on one rank, and shapes in another unit.

pub(crate) mod kept;
pub(crate) mod made_up;
pub(crate) mod packings;
pub(crate) mod placed;
pub(crate) mod random;

use dem_mpi::comm::alone::Alone;
use dem_mpi::comm::{Comm, threads};
use dem_mpi::contact::{ContactRecords, StateColumn};
use dem_mpi::drive::{Reporter, SavedState};
use dem_mpi::ids::{GlobalId, ShapeId};
use dem_mpi::math::{Mat3, Quat, Vec3};
use dem_mpi::output::snapshot;
use dem_mpi::output::tables::ParticleTable;
use dem_mpi::particles::columns::Quantity;
use dem_mpi::particles::records::Particle;
use dem_mpi::random::Random;
use dem_mpi::scene::Scene;
use dem_mpi::scene::assemble::{self, Continuation};
use dem_mpi::shape::union::Piece;
use dem_mpi::shape::{
    Ellipsoid, PolySuperellipsoid, Polyhedron, RoundedPolyhedron, Shape, Sphere, Spherocylinder,
    Superellipsoid, Union,
};
use dem_mpi::sim::run::Schedule;
use dem_mpi::sim::{Simulation, StepError};
use random::Draw;
use serde_json::Value;
use std::ffi::OsStr;
use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;

/// A material with friction and dashpots.
pub(crate) const MATERIAL: &str = r#"[[material]]
name = "grain"
density = 265000.0
normal_stiffness = 1.5e5
friction = 0.3
restitution = 0.5
tangential_damping_ratio = 0.05"#;

/// Tables that every scene needs, added where a text has none.
const BASE: [(&str, &str); 5] = [
    ("[domain]", "low = [-1, -1, 0]\nhigh = [1, 1, 1]\nwalls = [\"-z\"]"),
    ("[[material]]", "name = \"glass\"\ndensity = 2500\nnormal_stiffness = 1e4"),
    ("[[shape]]", "name = \"ball\"\nkind = \"sphere\"\nradius = 0.01"),
    ("[time]", "step = 1e-5"),
    ("[output]", ""),
];

/// Completes a scene's text. The defaults are a floor, a glass ball at the origin, one step of 1e-5 s and an output folder.
pub(crate) fn completed(text: &str) -> String {
    let mut text = text.to_owned();
    for (table, keys) in BASE {
        if !text.contains(table) {
            write!(text, "\n{table}\n{keys}\n").unwrap();
        }
    }
    if !["fill.", "[[inlet]]", "start ="].iter().any(|source| text.contains(source)) {
        let (_, shape) =
            text.split_once("[[shape]]\nname = ").expect("a shape begins with its name");
        let name = shape.lines().next().unwrap().to_owned();
        let origin = "first = [0, 0, 0]\ncount = [1, 1, 1]";
        write!(text, "\n[[fill.lattice]]\nshapes = [{name}]\n{origin}\n").unwrap();
    }
    if !["steps =", "duration ="].iter().any(|end| text.contains(end)) {
        text = text.replacen("[time]\n", "[time]\nsteps = 1\n", 1);
    }
    if !text.contains("directory =") {
        text = text.replacen("[output]\n", "[output]\ndirectory = \"out\"\n", 1);
    }
    text
}

/// Parses a scene's text, completed.
pub(crate) fn scene(text: &str) -> Scene {
    Scene::parse(&completed(text), "test", Path::new(""), &[])
        .unwrap_or_else(|errors| panic!("{errors}"))
}

/// Checks that a scene is rejected after a replacement in its text, with `said` in the message.
pub(crate) fn expect_refused(good: &str, from: &str, to: &str, said: &str) {
    assert!(good.contains(from), "{from}");
    let text = completed(&good.replacen(from, to, 1));
    let Err(mistakes) = Scene::parse(&text, "test", Path::new(""), &[]) else {
        panic!("accepted: {to}");
    };
    let mistakes = mistakes.to_string();
    assert!(mistakes.contains(said), "{to}: {mistakes}");
}

/// Checks a number against the expected one, to a relative tolerance.
pub(crate) fn close(found: f64, expected: f64, tolerance: f64, what: &str) {
    let off = (found / expected - 1.0).abs();
    println!("{what}: {found:e}, expected {expected:e}, off by {off:.1e}");
    assert!(off <= tolerance, "{what}: {found:e}, expected {expected:e}, off by {off:.1e}");
}

/// The text of a file in `tests/reference`.
pub(crate) fn reference(name: &str) -> String {
    let path = format!("{}/tests/reference/{name}", env!("CARGO_MANIFEST_DIR"));
    std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{path}: {e}"))
}

/// Parses a JSON file in `tests/reference`.
pub(crate) fn json(name: &str) -> Value {
    serde_json::from_str(&reference(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// A number of a JSON text.
pub(crate) fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is not a number"))
}

/// A moving, non-rotating particle of the first shape.
pub(crate) fn at(id: u64, position: Vec3, velocity: Vec3) -> Particle {
    ball(id, 0, position, velocity)
}

/// A moving, non-rotating particle of a shape.
pub(crate) fn ball(id: u64, shape: u16, position: Vec3, velocity: Vec3) -> Particle {
    Particle { velocity, ..Particle::at_rest(GlobalId(id), ShapeId(shape), position) }
}

/// The scene's simulation on the ranks of `comm`, with all particles, listed pairs and known forces.
pub(crate) fn begun(scene: &Scene, comm: &mut dyn Comm) -> Simulation {
    let mut sim = assemble::assemble(scene, comm);
    assemble::fill(&mut sim, scene, comm);
    sim.begin(comm).expect("the scene begins well");
    sim
}

pub(crate) fn schedule(scene: &Scene, last_step: u64, out: &Path) -> Schedule {
    Schedule {
        last_step,
        ends_stage: true,
        snapshot_every: 0,
        snapshot_every_minutes: None,
        history_every: scene.history_every,
        stop: scene.stop.clone(),
        out: out.to_owned(),
        scene: scene.text.clone(),
        resumed: false,
        signal: Arc::default(),
        traced: Vec::new(),
        duration: scene.duration,
        over: scene.over_the_limit(),
    }
}

/// Writes a snapshot of the current state. Collective.
pub(crate) fn save(sim: &Simulation, directory: &Path, scene: &Scene, comm: &mut dyn Comm) {
    let forces = sim.measure(comm).wall_forces;
    let header = sim.header(&scene.text, &forces, comm);
    let particles = sim.particle_table(comm.rank());
    let (contacts, records) = (sim.contact_table(), sim.contact_records());
    snapshot::write(directory, &header, &particles, &contacts, &records, comm).unwrap();
}

/// Bits of the state of motion of each particle, with its id.
pub(crate) fn motion(table: &ParticleTable) -> impl Iterator<Item = (u64, Vec<u64>)> + '_ {
    (0..table.id.len()).map(move |k| {
        let columns = [
            &table.position,
            &table.velocity,
            &table.force,
            &table.angular_momentum,
            &table.angular_velocity,
            &table.torque,
        ];
        // Spheres may have no orientation and, without friction, no angular velocity.
        let vectors = columns.iter().filter_map(|column| column.get(k)).flatten().copied();
        let turn = table.quaternion.get(k).into_iter().flatten().copied();
        let row: Vec<f64> = vectors.chain(turn).collect();
        let id = table.id[k].0;
        assert!(row.iter().all(|x| x.is_finite()), "particle {id}");
        (id, row.into_iter().map(f64::to_bits).collect())
    })
}

/// Bits of all columns of each particle, with its id.
pub(crate) fn all_bits(table: &ParticleTable) -> impl Iterator<Item = (u64, Vec<u64>)> + '_ {
    motion(table).enumerate().map(|(k, (id, mut row))| {
        let accumulated = table.accumulated.row(k);
        row.extend(Quantity::ALL.map(|quantity| accumulated[quantity].to_bits()));
        row.extend([table.scale_of(k).to_bits(), table.coordination[k] as u64]);
        row.push(table.standing[k].0);
        row.extend(table.image.get(k).into_iter().flatten().map(|&n| n as u64));
        (id, row)
    })
}

/// Bits of each contact's record with the ids of both partners; the overlap is last.
fn remembered(records: &ContactRecords) -> impl Iterator<Item = (u64, u64, Vec<u64>)> + '_ {
    records.iter().map(|named| {
        let normal = named.geometry.normal.iter();
        let numbers = normal.chain(named.state).chain([&named.geometry.overlap]);
        (named.a.0, named.b.0, numbers.map(|x| x.to_bits()).collect())
    })
}

/// Saved state of the servos.
pub(crate) fn of_servos(drives: &[SavedState]) -> &SavedState {
    drives.iter().find(|saved| saved.drive == "servos").expect("there are servos")
}

/// Complete state of a simulation on all its ranks.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct State {
    /// Bits of each particle, with its id.
    pub(crate) bits: Vec<(u64, Vec<u64>)>,
    /// Bits of each contact with the ids of both partners; the overlap is last.
    pub(crate) records: Vec<(u64, u64, Vec<u64>)>,
    /// Energies [J], positions of walls, forces on them, and counts of the drives.
    scalars: Vec<(String, u64)>,
    pub(crate) drives: Vec<SavedState>,
}

impl State {
    /// State of one rank. Collective.
    pub(crate) fn of(sim: &Simulation, comm: &mut dyn Comm) -> Self {
        let m = sim.measure(comm);
        let mut scalars: Vec<(String, f64)> = [
            ("kinetic", m.kinetic()),
            ("gravity", m.gravity),
            ("stored", m.stored),
            ("dissipated", m.dissipated),
            ("received", m.received),
            ("missing", m.missing()),
            ("mean_normal_force", m.mean_normal_force),
            ("largest_overlap", m.largest_overlap),
            ("largest_speed", m.largest_speed),
            ("unbalanced", m.unbalanced),
            ("top", m.top),
            ("contacts", m.contacts as f64),
            ("wall_contacts", m.wall_contacts as f64),
        ]
        .map(|(name, number)| (name.to_owned(), number))
        .into();
        scalars.extend(m.channels.map(|x| ("channel".to_owned(), x)));
        for wall in &sim.particles.walls {
            scalars
                .extend(wall.velocity.iter().map(|&x| (format!("velocity of {}", wall.name), x)));
            let place = wall.point.iter().chain(wall.orientation.coords.iter());
            scalars.extend(place.map(|&x| (format!("place of {}", wall.name), x)));
        }
        let forces = m.wall_forces.iter().flat_map(|force| force.iter());
        scalars.extend(forces.map(|&x| ("force".to_owned(), x)));
        scalars.extend(sim.all_observers().flat_map(Reporter::counted));
        Self {
            bits: all_bits(&sim.particle_table(comm.rank())).collect(),
            records: remembered(&sim.contact_records()).collect(),
            scalars: scalars.into_iter().map(|(name, x)| (name, x.to_bits())).collect(),
            drives: sim.header("", &m.wall_forces, comm).drives,
        }
    }

    /// Joins the states of all ranks.
    pub(crate) fn joined(ranks: Vec<Self>) -> Self {
        let mut ranks = ranks.into_iter();
        let mut all = ranks.next().expect("a rank");
        for other in ranks {
            assert_eq!((&other.scalars, &other.drives), (&all.scalars, &all.drives));
            all.bits.extend(other.bits);
            all.records.extend(other.records);
        }
        all.bits.sort();
        all.records.sort();
        all
    }

    /// Panics with the first difference from another state.
    pub(crate) fn expect(&self, other: &Self, what: &str) {
        assert_eq!(self.bits.len(), other.bits.len(), "{what}: number of particles");
        let rows = self.bits.iter().zip(&other.bits);
        let differing: Vec<u64> = rows.filter(|(a, b)| a != b).map(|(a, _)| a.0).collect();
        assert!(differing.is_empty(), "{what}: particles {differing:?} differ");
        assert_eq!(self.records.len(), other.records.len(), "{what}: number of contacts");
        assert!(self.records == other.records, "{what}: a contact's geometry differs");
        assert_eq!(self.scalars, other.scalars, "{what}: energies and walls");
        assert_eq!(self.drives, other.drives, "{what}: drives");
    }

    /// Panics unless the commit before had the same bits after these steps of the scene.
    #[track_caller]
    pub(crate) fn is_kept(&self, scene: &Scene, steps: u64) {
        let Self { bits, records, scalars, drives } = self;
        let test = Path::new(std::panic::Location::caller().file());
        // Folders differ from machine to machine, those of a test alone from run to run; names of files do not.
        let without_folders = |part| match Path::new(part).file_name().and_then(OsStr::to_str) {
            Some(file) if Path::new(part).is_absolute() && file.starts_with(".tmp") => "",
            Some(file) if Path::new(part).is_absolute() => file,
            _ => part,
        };
        let text: Vec<&str> = scene.text.split('"').map(without_folders).collect();
        let text = text.join("\"");
        let name = format!("{} {:016x} {steps}", test.display(), kept::hash(text.as_bytes()));
        let all = format!("{bits:?}{records:?}{scalars:?}{drives:?}");
        kept::expect(&name, kept::hash(all.as_bytes()));
    }

    /// Work of all walls on the particles [J].
    pub(crate) fn work_of_walls(&self) -> f64 {
        let ledger = self.drives.iter().find(|saved| saved.drive == "ledger").expect("walls work");
        ledger.reals(&StateColumn::new("work", 1, "J")).unwrap().iter().sum()
    }

    /// The first scalar with this name.
    pub(crate) fn number(&self, name: &str) -> f64 {
        *self.numbers(name).first().unwrap_or_else(|| panic!("no {name}"))
    }

    /// All scalars with this name. The position of a wall has three coordinates and a quaternion (x, y, z, w).
    pub(crate) fn numbers(&self, name: &str) -> Vec<f64> {
        let found = self.scalars.iter().filter(|(of, _)| of == name);
        found.map(|(_, bits)| f64::from_bits(*bits)).collect()
    }
}

/// A scene that runs on ranks that are threads.
pub(crate) struct OnRanks<'a> {
    pub(crate) scene: &'a Scene,
    /// Assembles the simulation, without particles.
    pub(crate) assembled: fn(&Scene, &mut dyn Comm) -> Simulation,
}

impl<'a> OnRanks<'a> {
    pub(crate) fn of(scene: &'a Scene) -> Self {
        Self { scene, assembled: |scene, comm| assemble::assemble(scene, comm) }
    }

    /// State after a number of steps from the start.
    pub(crate) fn run(&self, ranks: u32, steps: u64) -> State {
        self.run_and_look(ranks, steps, |_| ()).0
    }

    /// State after a number of steps, and the result of `look` on each rank.
    pub(crate) fn run_and_look<T: Send>(
        &self,
        ranks: u32,
        steps: u64,
        look: impl Fn(&Simulation) -> T + Sync,
    ) -> (State, Vec<T>) {
        let parts = threads::run(ranks, |comm| {
            let sim = self.began(steps, comm);
            (State::of(&sim, comm), look(&sim))
        });
        let (states, seen) = parts.into_iter().unzip();
        (State::joined(states), seen)
    }

    /// State after a run that was saved after some steps and restarted on another number of ranks.
    pub(crate) fn restarted(
        &self,
        [before, after]: [u32; 2],
        [saved, steps]: [u64; 2],
        folder: &Path,
    ) -> State {
        threads::run(before, |comm| {
            save(&self.began(saved, comm), folder, self.scene, comm);
        });
        assert_eq!(snapshot::Reader::open(folder).unwrap().header().step, saved);
        State::joined(threads::run(after, |comm| {
            let mut sim = (self.assembled)(self.scene, comm);
            assemble::take_up(&mut sim, self.scene, folder, Continuation::SameStage, comm)
                .expect("it goes on");
            to_step(&mut sim, steps, comm);
            State::of(&sim, comm)
        }))
    }

    /// State on one rank. Checks that runs on other numbers of ranks, restarts half-way between two such numbers, and the
    /// commit before give identical bits.
    #[track_caller]
    pub(crate) fn the_same_on(&self, steps: u64, others: &[u32], restarts: &[[u32; 2]]) -> State {
        let alone = self.run(1, steps);
        alone.is_kept(self.scene, steps);
        for &ranks in others {
            alone.expect(&self.run(ranks, steps), &format!("{ranks} ranks"));
        }
        let folder = tempfile::tempdir().unwrap();
        self.leaves_no_trace(&alone, steps, restarts, folder.path());
        alone
    }

    /// Checks that restarts half-way, each from one number of ranks to another, give identical bits. Snapshots go to the folder.
    pub(crate) fn leaves_no_trace(
        &self,
        alone: &State,
        steps: u64,
        restarts: &[[u32; 2]],
        folder: &Path,
    ) {
        for &[before, after] in restarts {
            let again = self.restarted([before, after], [steps / 2, steps], folder);
            alone.expect(&again, &format!("{before} ranks, then {after}"));
        }
    }

    /// State on one rank. Checks that 2, 3, 4 and 8 ranks give identical bits, and restarts from 3 ranks to 2, from the start and from half-way.
    /// The snapshot of half-way stays in the folder.
    #[track_caller]
    pub(crate) fn the_same_everywhere(&self, steps: u64, folder: &Path) -> State {
        let alone = self.the_same_on(steps, &[2, 3, 4, 8], &[]);
        for saved in [0, steps / 2] {
            let again = self.restarted([3, 2], [saved, steps], folder);
            alone.expect(&again, &format!("from step {saved}"));
        }
        alone
    }

    fn began(&self, steps: u64, comm: &mut dyn Comm) -> Simulation {
        let mut sim = (self.assembled)(self.scene, comm);
        assemble::fill(&mut sim, self.scene, comm);
        sim.begin(comm).expect("the scene begins well");
        to_step(&mut sim, steps, comm);
        sim
    }
}

fn to_step(sim: &mut Simulation, step: u64, comm: &mut dyn Comm) {
    while sim.step < step {
        sim.step(comm).unwrap_or_else(|error| panic!("{error}"));
    }
}

/// A simulation on one rank with the given particles; the scene's own particles are left out.
pub(crate) struct Bench {
    pub(crate) sim: Simulation,
    comm: Alone,
}

impl Bench {
    pub(crate) fn new(text: &str, particles: &[Particle]) -> Self {
        Self::of(&scene(text), particles)
    }

    pub(crate) fn of(scene: &Scene, particles: &[Particle]) -> Self {
        let mut comm = Alone::default();
        let mut sim = assemble::assemble(scene, &comm);
        sim.particles.strip_to_owned();
        for particle in particles {
            sim.insert(particle);
            sim.next_id = sim.next_id.max(particle.id.0 + 1);
        }
        sim.begin(&mut comm).expect("the scene begins well");
        Self { sim, comm }
    }

    /// A simulation with moments of inertia so large that no particle rotates.
    pub(crate) fn heavy_to_turn(scene: &Scene, particles: &[Particle]) -> Self {
        let mut scene = scene.clone();
        for inertia in &mut scene.library.inertia {
            *inertia *= 1e9;
        }
        Self::of(&scene, particles)
    }

    /// Treats the given velocities as those half a step earlier, as some references list them.
    pub(crate) fn with_middle_velocities(mut self) -> Self {
        let (half, damping) = (0.5 * self.sim.dt, self.sim.field.damping);
        for slot in 0..self.sim.particles.owned {
            let particles = &self.sim.particles;
            let force = self.sim.field.force(particles, slot) / particles.mass(slot);
            let given = particles.velocity[slot];
            self.sim.particles.velocity[slot] = (given + force * half) / (1.0 + half * damping);
        }
        self
    }

    /// The velocity in the middle of the last step.
    pub(crate) fn middle_velocity(&self, slot: usize) -> Vec3 {
        let (half, damping) = (0.5 * self.sim.dt, self.sim.field.damping);
        let particles = &self.sim.particles;
        let force = self.sim.field.force(particles, slot) / particles.mass(slot);
        particles.velocity[slot] * (1.0 + half * damping) - force * half
    }

    pub(crate) fn step(&mut self) {
        self.try_step().expect("the step is done");
    }

    pub(crate) fn try_step(&mut self) -> Result<(), StepError> {
        self.sim.step(&mut self.comm)
    }

    pub(crate) fn measure(&mut self) -> dem_mpi::measure::Measures {
        self.sim.measure(&mut self.comm)
    }

    /// Current slot of a particle.
    pub(crate) fn slot(&self, id: u64) -> usize {
        let ids = &self.sim.particles.id[..self.sim.particles.owned];
        ids.iter().position(|&other| other == GlobalId(id)).expect("the particle is there")
    }
}

/// Checks that a ball pulled along x sticks below the limit of friction [m/s²] and slides beyond it, slowed by friction. The pull is `part` times
/// the limit.
pub(crate) fn slides_beyond(mut bench: Bench, part: f64, limit: f64, steps: u32) {
    let mut after_steps = || {
        (0..steps).for_each(|_| bench.step());
        bench.sim.particles.velocity[0].x
    };
    let before = after_steps();
    let gained = after_steps() - before;
    let all = limit * f64::from(steps) * bench.sim.dt;
    if part > 1.0 {
        close(gained, (part - 1.0) * all, 1e-3, "acceleration");
    } else {
        assert!(gained.abs() < 1e-3 * all, "{gained:e} m/s");
    }
}

/// Random rotations as matrices.
pub(crate) trait Frame {
    /// One rotation, from a distribution that is not quite uniform.
    fn frame(&mut self) -> Mat3;
}

impl Frame for Random {
    fn frame(&mut self) -> Mat3 {
        let four = nalgebra::Vector4::from_fn(|_, _| self.between(-1.0, 1.0));
        Quat::from_quaternion(four.into()).to_rotation_matrix().into_inner()
    }
}

/// A random integer in `0..limit`.
pub(crate) fn below(random: &mut Random, limit: u64) -> u64 {
    (random.unit() * limit as f64) as u64
}

/// The shape with all lengths times `unit`. Solids are rebuilt from their corners, which changes the last bits. Compare with `scaled(shape,
/// 1.0)`.
pub(crate) fn scaled(shape: &Shape, unit: f64) -> Shape {
    let times = |points: &[Vec3]| points.iter().map(|p| p * unit).collect::<Vec<_>>();
    match shape {
        Shape::Sphere(s) => Shape::Sphere(Sphere { radius: s.radius * unit }),
        Shape::Ellipsoid(e) => Shape::Ellipsoid(Ellipsoid { semi_axes: e.semi_axes * unit }),
        Shape::Superellipsoid(s) => {
            Shape::Superellipsoid(Superellipsoid::new(s.semi_axes() * unit, s.exponents()))
        }
        Shape::PolySuperellipsoid(p) => {
            let [positive, negative] = p.semi_axes().map(|axes| axes * unit);
            let scaled = PolySuperellipsoid::new(positive, negative, p.exponents());
            Shape::PolySuperellipsoid(Box::new(scaled))
        }
        Shape::Spherocylinder(s) => Shape::Spherocylinder(Spherocylinder {
            length: s.length * unit,
            radius: s.radius * unit,
        }),
        Shape::Polyhedron(p) => {
            let solid = Polyhedron::new(&times(p.hull().vertices()));
            Shape::Polyhedron(Box::new(solid.expect("a body")))
        }
        Shape::RoundedPolyhedron(p) => {
            let solid = RoundedPolyhedron::new(&times(p.core().vertices()), p.radius() * unit);
            Shape::RoundedPolyhedron(Box::new(solid.expect("a body")))
        }
        Shape::Union(body) => {
            let piece = |piece: &Piece| Piece {
                shape: scaled(&piece.shape, unit),
                centre: piece.centre * unit,
                rotation: piece.rotation,
            };
            let body = Union::new(body.pieces().iter().map(piece).collect());
            Shape::Union(Box::new(body.expect("a body")))
        }
        Shape::Other(_) | Shape::HalfSpace(_) | Shape::TriangleMesh(_) => {
            unreachable!("no grain of a scene")
        }
    }
}
