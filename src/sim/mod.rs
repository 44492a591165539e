//! The simulation: all data of a rank, and the step.

pub mod audit;
pub mod capture;
pub mod floor;
mod history;
mod images;
mod leavers;
pub mod report;
pub mod run;
pub mod sizes;
pub mod start;
mod stiffening;
pub mod stop;
pub mod trace;
pub mod watch;

use crate::comm::{Comm, agree};
use crate::contact::{ContactRecords, Found, Pair, Table, Touch, Why};
use crate::contacts::{Contacts, Loaded};
use crate::domain::{Domain, DomainError};
use crate::drive::{
    Acting, Drive, DriveError, Moment, Newcomers, Observer, Reporter, Steering, View, all_observers,
};
use crate::ids::GlobalId;
use crate::law::{ForceLaw, Sums};
use crate::math::Vec3;
use crate::measure::{self, COMPONENTS, Departed, Measures};
use crate::motion::{self, Field};
use crate::particles::Particles;
use crate::particles::columns::Quantity;
use crate::particles::records::Particle;
use crate::search::{self, PairList};
use crate::timing::{Clock, Phase};
use audit::Auditor;
use images::WorkOfImages;
use std::collections::BTreeSet;
use watch::{Fault, Watch};

/// All data of a rank. Made by `scene::assemble`.
///
/// Sixty-four balls fall freely for a hundredth of a second:
///
/// ```
/// use dem_mpi::comm::alone::Alone;
/// use dem_mpi::scene::{Scene, assemble};
/// use std::path::Path;
///
/// let scene = Scene::read(Path::new("run/first/scene.toml"), &[]).unwrap();
/// let mut comm = Alone::default();
/// let mut sim = assemble::assemble(&scene, &comm);
/// assemble::fill(&mut sim, &scene, &comm);
/// sim.begin(&mut comm).unwrap();
/// while sim.time() < 0.01 {
///     sim.step(&mut comm).unwrap();
/// }
/// let speed = 9.81 * sim.time();
/// let owned = &sim.particles.velocity[..sim.particles.owned];
/// assert!(owned.iter().all(|v| (v.z + speed).abs() < 1e-12 && v.x == 0.0));
/// let kinetic = 64.0 * 0.5 * scene.library.mass[0] * speed * speed;
/// assert!((sim.measure(&mut comm).kinetic() / kinetic - 1.0).abs() < 1e-12);
/// ```
pub struct Simulation {
    /// Owned particles, ghosts, walls.
    pub particles: Particles,
    /// Pairs that may touch.
    pub pairs: PairList,
    /// Pairs that touch.
    pub contacts: Contacts,
    /// Sums of forces and losses of the particles, while they are found.
    pub sums: Sums,
    /// Subdomains and owners of particles.
    pub domain: Domain,
    /// Contact method for each pair of kinds.
    pub resolvers: Table,
    /// Force law.
    pub law: Box<dyn ForceLaw>,
    /// Gravity and global damping.
    pub field: Field,
    /// Drives, in the order in which they act.
    pub drives: Vec<Box<dyn Drive>>,
    /// Observers that are not drives.
    pub observers: Vec<Box<dyn Observer>>,
    /// Detects steps with too large motions or overlaps.
    pub watch: Watch,
    /// Results of the resolvers for a few pairs, and the number of pairs resolved by each resolver of a chain.
    pub found: Found,
    /// Numbers of the pairs to resolve.
    pub active: Vec<u32>,
    /// Time step [s].
    pub dt: f64,
    /// Steps since the first stage began.
    pub step: u64,
    /// Step and time [s] at which this stage began.
    pub stage_begin: (u64, f64),
    /// Time offset from earlier parts of the stage that used another time step [s].
    pub stage_shift: f64,
    /// Id of the next new particle.
    pub next_id: u64,
    /// Energies of particles that were taken out; the same on all ranks.
    pub departed: Departed,
    /// Largest sum of kinetic and elastic energy measured on schedule in this stage [J].
    pub most_moving: f64,
    /// Distance between bounding spheres within which a pair is listed [m].
    pub skin: f64,
    /// Largest gap of a contact [m]; pairs are listed over this additional distance.
    pub reach: f64,
    /// Work of the busiest rank over the mean, above which the domain is cut again.
    pub imbalance: f64,
    /// Steps after which the spatial order is renewed.
    pub order_every: u64,
    /// Neighbour lists rebuilt since the last repartition.
    pub lists_since_cut: u32,
    /// Results of the audit of contacts.
    pub audit: Auditor,
    /// Time by phase.
    pub clock: Clock,
}

/// Reason why a step could not be done, with place and advice.
#[derive(Clone, Debug, thiserror::Error)]
pub enum StepError {
    /// A particle is at an invalid position. Known on all ranks.
    #[error("step {step}: {error}")]
    Domain {
        /// Steps done.
        step: u64,
        /// Particle and reason.
        error: DomainError,
    },
    /// A motion or overlap of a step was too large. Known on all ranks.
    #[error("step {step}: {fault}")]
    Fault {
        /// Steps done.
        step: u64,
        /// Body and size of the motion or overlap.
        fault: Fault,
    },
    /// A drive cannot go on. Known on all ranks.
    #[error("step {step}: {error}")]
    Drive {
        /// Steps done.
        step: u64,
        /// Drive and reason.
        error: DriveError,
    },
    /// A pair that no contact method could resolve. Known on one rank only.
    #[error(
        "step {step}: the contact of particle {a}, at ({x:e}, {y:e}, {z:e}) m, with {b}, {distance:e} m apart, is not \
         converged ({why:?}). Check for coincident particles, or reduce the time step"
    )]
    Contact {
        /// Steps done.
        step: u64,
        /// The lower id.
        a: GlobalId,
        /// Other particle, or wall.
        b: String,
        /// Position of A along x [m].
        x: f64,
        /// Position of A along y [m].
        y: f64,
        /// Position of A along z [m].
        z: f64,
        /// Distance of the centres [m].
        distance: f64,
        /// Reason why the last method failed.
        why: Why,
    },
}

impl StepError {
    /// Do all ranks have this error?
    pub const fn is_agreed(&self) -> bool {
        matches!(self, Self::Domain { .. } | Self::Fault { .. } | Self::Drive { .. })
    }
}

/// Results of the first resolution of all pairs.
#[derive(Default)]
struct FirstLook {
    /// Touches that did not exist at the end of the previous stage.
    new: Vec<(Pair, Touch)>,
    /// Pairs that no method can resolve.
    unresolved: Vec<(Pair, Why)>,
}

/// Number of steps of `dt` that last at least `duration`; both in s.
pub(crate) fn steps_of(duration: f64, dt: f64) -> u64 {
    // Rounding may put a whole number slightly above it.
    (duration / dt * (1.0 - 1e-12)).ceil() as u64
}

/// Largest number of bodies whose columns stay in a cache from step to step. For more, memory is prefetched.
const MOST_CACHED: usize = 1 << 16;

/// Rebuilt neighbour lists before the next repartition.
const LISTS_BETWEEN_CUTS: u32 = 5;

impl Simulation {
    /// Advances by a step of `dt`: kick, drift, kick. Before and after, forces and velocities belong to the positions.
    ///
    /// # Errors
    /// The reason. Unless [`StepError::is_agreed`], the other ranks do not know it yet, so the caller must abort them.
    pub fn step(&mut self, comm: &mut dyn Comm) -> Result<(), StepError> {
        // Moves bodies while the sums of drives are added up.
        self.clock.restart();
        let asked = self.start_sums(comm);
        self.particles.move_cell(self.dt);
        self.act(|drive, acting| drive.lead(acting));
        let reach = self.domain.halo() + self.skin;
        motion::affine::carry(&mut self.particles, &self.field, self.dt, reach);
        let mut farthest = motion::kick_and_drift(&mut self.particles, &self.field, self.dt);
        self.act(|drive, acting| drive.place(acting, &mut farthest));
        self.clock.lap(Phase::Move);
        self.steer_walls(&asked, comm)?;
        self.clock.lap(Phase::Agree);
        self.check_cell()?;
        self.particles.move_walls(self.step + 1, self.dt);
        self.watch.note(&farthest, &self.particles, self.dt);
        self.step += 1;
        self.clock.lap(Phase::Move);

        // Finds contacts and their forces.
        let newcomers = self.newcomers(comm);
        if newcomers.is_empty() {
            self.exchange(comm)?;
        } else {
            self.list_pairs(&newcomers, self.dt, comm)?;
        }
        self.find_forces(self.dt)?;
        self.watch.note_depths(&self.particles, &self.contacts);
        self.count_work_of_images(0.5 * self.dt, 0.5 * self.dt);
        self.show_forces(self.dt);
        self.clock.lap(Phase::Forces);
        self.act(|drive, acting| drive.push(acting));
        motion::kick(&mut self.particles, &self.field, self.dt);
        self.act(|drive, acting| drive.settle(acting));
        motion::affine::settle(&mut self.particles, self.dt);
        self.clock.lap(Phase::Move);
        Ok(())
    }

    /// Lets drives act on the particles, if any particle may be held or pushed.
    fn act(&mut self, act: impl FnMut(&mut dyn Drive, Acting)) {
        self.act_after(self.dt, act);
    }

    /// Lets drives act on forces found a time `dt` [s] after the previous ones: 0 at the start of a stage.
    fn act_after(&mut self, dt: f64, mut act: impl FnMut(&mut dyn Drive, Acting)) {
        if !self.particles.needs.group {
            return;
        }
        let moment = Moment { dt, ..self.moment() };
        let Self { drives, particles, field, .. } = self;
        for drive in drives {
            act(&mut **drive, Acting { moment, field, particles });
        }
    }

    /// Is a strained cell wide enough?
    fn check_cell(&self) -> Result<(), StepError> {
        let (cell, least) = (&self.particles.cell, 2.0 * self.domain.halo());
        let Some(strained) = cell.strained() else { return Ok(()) };
        let Some((axis, width)) = cell.thin(least).next() else { return Ok(()) };
        let strains = COMPONENTS.map(|[i, j]| format!("{:.4}", -strained.strain[(i, j)]));
        let error = DriveError(format!(
            "the cell is {width:.4e} m wide across {axis}, at strains xx, yy, zz, xy, xz, yz of {}; it must stay at \
             least {least:.4e} m, twice the largest bounding diameter and the skin. Use more particles, or end the \
             stage before",
            strains.join(", ")
        ));
        Err(StepError::Drive { step: self.step, error })
    }

    /// Starts the sums that drives ask for; returns the number of values of each drive. Collective, if there are any.
    fn start_sums(&self, comm: &mut dyn Comm) -> Vec<usize> {
        let moment = self.moment();
        let Self { drives, particles, contacts, law, sums, .. } = self;
        let view = View { moment, particles, contacts, law: &**law, sums };
        let (mut asked, mut all) = (Vec::new(), Vec::new());
        for numbers in drives.iter().map(|drive| drive.sums(&view)) {
            asked.push(numbers.len());
            all.extend(numbers);
        }
        if !all.is_empty() {
            comm.start_sum(all);
        }
        asked
    }

    /// Lets drives set the velocities of walls, each with the sums that it has `asked` for. Collective, if there are any.
    fn steer_walls(&mut self, asked: &[usize], comm: &mut dyn Comm) -> Result<(), StepError> {
        let moment = self.moment();
        let all = if asked.iter().any(|&count| count > 0) { comm.finish_sum() } else { Vec::new() };
        let mut rest = &*all;
        for (drive, &count) in self.drives.iter_mut().zip(asked) {
            let (sums, others) = rest.split_at(count);
            rest = others;
            let Particles { cell, library, walls, .. } = &mut self.particles;
            let steered = drive.steer(Steering { moment, sums, cell, library, walls });
            steered.map_err(|error| StepError::Drive { step: moment.step, error })?;
        }
        Ok(())
    }

    /// Passes forces found `dt` [s] after the previous ones to all observers.
    fn show_forces(&mut self, dt: f64) {
        let moment = Moment { dt, ..self.moment() };
        let Self { drives, observers, particles, contacts, law, sums, .. } = self;
        let view = View { moment, particles, contacts, law: &**law, sums };
        all_observers(drives, observers).for_each(|observer| observer.after_forces(&view));
    }

    /// Updates the ghosts, and checks on all ranks whether the list holds for these positions; if not, makes a new one.
    /// Collective.
    fn exchange(&mut self, comm: &mut dyn Comm) -> Result<(), StepError> {
        self.domain.start_halo(&self.particles, comm);
        self.clock.lap(Phase::Exchange);
        // Overlaps with the transfer of ghosts.
        comm.start_vote(self.list_is_stale() || self.watch.has_fault() || self.has_leaver());
        self.clock.lap(Phase::Agree);
        self.domain.finish_halo(&mut self.particles, comm);
        self.particles.place_pieces();
        self.clock.lap(Phase::Exchange);
        let stale = comm.finish_vote();
        self.clock.lap(Phase::Agree);
        if stale || self.has_to_order() { self.list_pairs(&[], self.dt, comm) } else { Ok(()) }
    }

    /// Lists pairs and finds the forces at the start of a stage. Collective.
    ///
    /// # Errors
    /// See [`Simulation::step`].
    pub fn begin(&mut self, comm: &mut dyn Comm) -> Result<(), StepError> {
        self.list_first(comm)?;
        self.find_first_forces()
    }

    /// First half of [`Simulation::begin`]. Collective.
    ///
    /// # Panics
    /// If two drives or observers have one name: their saved states could not be distinguished.
    fn list_first(&mut self, comm: &mut dyn Comm) -> Result<(), StepError> {
        let mut names = BTreeSet::new();
        for name in self.all_observers().map(Reporter::name) {
            assert!(names.insert(name), "two drives are called {name}");
        }
        self.lists_since_cut = LISTS_BETWEEN_CUTS;
        self.watch.note_ahead(&self.particles, self.dt);
        // No time has passed, so nothing happens within a step.
        self.list_pairs(&[], 0.0, comm)
    }

    /// Second half of [`Simulation::begin`].
    fn find_first_forces(&mut self) -> Result<(), StepError> {
        // No time has passed, so springs do not stretch.
        self.find_forces(0.0)?;
        self.show_forces(0.0);
        self.act_after(0.0, |drive, acting| drive.push(acting));
        self.count_initial_energy();
        self.count_work_of_images(0.0, 0.5 * self.dt);
        Ok(())
    }

    /// Rebuilds subdomains, ghosts and pairs, after removing particles that drives take out. Adds the `newcomers` whose
    /// places this rank then owns. `dt` [s] is 0 at the start of a stage. Collective.
    fn list_pairs(
        &mut self,
        newcomers: &[Newcomers],
        dt: f64,
        comm: &mut dyn Comm,
    ) -> Result<(), StepError> {
        let step = self.step;
        self.agree_on_fault(comm)?;
        self.domain.follow(&self.particles.cell);
        let taken = self.take_leavers(dt, comm);
        let checked = self.domain.check(&self.particles, &taken);
        agree(comm, checked).map_err(|error| StepError::Domain { step, error })?;
        self.recut_if_unbalanced(comm);
        let carried = self.domain.migrate(&mut self.particles, &self.contacts, &taken, comm);
        let me = comm.rank();
        for Newcomers { count, make } in newcomers {
            for k in 0..*count {
                let mut particle = make(k, &self.particles.library);
                if self.particles.needs.group {
                    self.drives.iter().for_each(|drive| drive.admit(&mut particle));
                }
                if self.domain.owner(&particle.position) == me {
                    self.insert_within_step(&particle);
                }
            }
        }
        if self.has_to_order() {
            self.particles.forget_order();
        }
        self.relist(&carried, comm);
        self.clock.lap(Phase::Rebuild);
        Ok(())
    }

    /// A fault that any rank has recorded or finds now, as an error. Collective.
    pub(crate) fn agree_on_fault(&self, comm: &mut dyn Comm) -> Result<(), StepError> {
        let checked = self.watch.check(&self.particles, &self.contacts);
        agree(comm, checked).map_err(|fault| StepError::Fault { step: self.step, fault })
    }

    /// Makes ghosts and pairs for particles that are all with their owners; `carried` are the records of their touching
    /// contacts. Collective.
    pub fn relist(&mut self, carried: &ContactRecords, comm: &mut dyn Comm) {
        self.particles.complete_order();
        self.particles.sort_owned();
        self.domain.offer_ghosts(&mut self.particles, comm);
        let listed = self.skin + self.reach;
        let with_meshes = search::note_near_facets(&mut self.particles, listed);
        let mut found = search::close_pairs(&self.particles, listed);
        found.extend(with_meshes);
        search::drop_held(&mut found, &self.particles);
        self.domain.keep_paired_ghosts(&mut self.particles, &mut found);
        self.domain.start_halo(&self.particles, comm);
        self.domain.finish_halo(&mut self.particles, comm);
        self.particles.place_pieces();
        let found = search::with_pieces(&self.particles, found, listed);
        let places = self.particles.places();
        self.pairs.rebuild(&mut self.particles, found, &places);
        self.contacts.rebuild(&self.pairs, &self.particles, &places, carried);
        self.particles.trim();
        self.domain.traffic.rebuilds += 1;
    }

    /// All observers: drives first, then those that are not drives.
    pub fn all_observers(&self) -> impl Iterator<Item = &dyn Observer> {
        let of_drives = self.drives.iter().map(|drive| -> &dyn Observer { &**drive });
        of_drives.chain(self.observers.iter().map(|observer| &**observer))
    }

    /// All observers, mutable.
    pub fn all_observers_mut(&mut self) -> impl Iterator<Item = &mut dyn Observer> {
        all_observers(&mut self.drives, &mut self.observers)
    }

    /// Time since the first stage began [s].
    pub fn time(&self) -> f64 {
        self.stage_begin.1 + self.stage_time()
    }

    /// Time since this stage began [s].
    pub fn stage_time(&self) -> f64 {
        (self.step - self.stage_begin.0) as f64 * self.dt + self.stage_shift
    }

    /// Present step and time.
    fn moment(&self) -> Moment {
        let (step, stage_step) = (self.step, self.step - self.stage_begin.0);
        let (time, stage_time) = (self.time(), self.stage_time());
        Moment { step, stage_step, time, stage_time, dt: self.dt }
    }

    /// Scalar measures at this moment. Collective.
    pub fn measure(&self, comm: &mut dyn Comm) -> Measures {
        let Self { particles, contacts, law, field, dt, departed, sums, .. } = self;
        let moments = sums.moments_at_walls();
        let mut measures = measure::measure(particles, contacts, &**law, moments, field, *dt, comm);
        measures.received += departed.received;
        measures.dissipated += departed.dissipated;
        for (energy, of_departed) in measures.channels.iter_mut().zip(departed.channels) {
            *energy += of_departed;
        }
        measures
    }

    /// Resolves a sample of the contacts again, if an audit is due. Collective at steps on which all ranks agree.
    pub fn audit(&mut self, comm: &mut dyn Comm) {
        if self.audit.is_due(self.step) {
            let mut audit = self.audit.take();
            audit.look(self, comm);
            self.audit = audit;
            self.clock.lap(Phase::Audit);
        }
    }

    /// Particles that drives insert now, the same on all ranks. Collective.
    fn newcomers(&mut self, comm: &mut dyn Comm) -> Vec<Newcomers> {
        let moment = self.moment();
        let mut newcomers = Vec::new();
        for drive in &mut self.drives {
            let inserted = drive.insert(&moment, self.next_id, &self.particles, comm);
            self.next_id += inserted.as_ref().map_or(0, |inserted| inserted.count);
            newcomers.extend(inserted);
        }
        newcomers
    }

    /// Adds a particle that this rank shall own, with its energy. Ghosts and walls must be stripped.
    pub fn insert(&mut self, particle: &Particle) {
        self.particles.push_owned(particle);
        let slot = self.particles.owned - 1;
        self.particles.accumulated[Quantity::Received][slot] +=
            measure::free_energy(&self.particles, slot, &self.field);
    }

    /// Adds a particle that appears after the first kick of a step and touches nothing.
    fn insert_within_step(&mut self, particle: &Particle) {
        let velocity = self.field.before_last_kick(&particle.velocity, self.dt);
        self.insert(&Particle { velocity, ..particle.clone() });
        let Self { particles, field, dt, .. } = self;
        let slot = particles.owned - 1;
        particles.accumulated[Quantity::Received][slot] +=
            motion::last_work(particles, slot, field, *dt);
    }

    /// Is the spatial order renewed at this step? The same on all ranks, and in all runs of a scene.
    const fn has_to_order(&self) -> bool {
        self.step.is_multiple_of(self.order_every)
    }

    /// Has any body on this rank moved so far that an unlisted pair might touch?
    fn list_is_stale(&self) -> bool {
        if search::all_within(&self.particles, 0.5 * self.skin) {
            return false;
        }
        // Written so that a NaN position makes the list stale, and is found.
        let still_good = search::moved_squared(&self.particles) <= 0.25 * self.skin * self.skin;
        !still_good
    }

    /// Cuts the domain again if one rank has too much work. Collective.
    fn recut_if_unbalanced(&mut self, comm: &mut dyn Comm) {
        self.lists_since_cut += 1;
        if self.lists_since_cut < LISTS_BETWEEN_CUTS {
            return;
        }
        if self.work_imbalance(comm) > self.imbalance {
            let work = self.work();
            self.domain.recut(&self.particles, &work, comm);
            self.lists_since_cut = 0;
        }
    }

    /// Work of each owned particle: itself and its pairs.
    fn work(&self) -> Vec<i64> {
        self.pairs.listed_for_each(&self.particles).iter().map(|listed| 1 + listed).collect()
    }

    /// Work of the busiest rank over the mean of all; 1 without particles. Collective.
    pub fn work_imbalance(&self, comm: &mut dyn Comm) -> f64 {
        let mine: i64 = self.work().iter().sum();
        let mut total = [mine];
        let mut most = [mine as f64];
        comm.sum(&mut total);
        comm.max(&mut most);
        if total[0] == 0 { 1.0 } else { most[0] * f64::from(comm.size()) / total[0] as f64 }
    }

    /// Finds contacts and their forces, stretch by stretch of the list of pairs. `dt` [s] is 0 at the start of a stage.
    fn find_forces(&mut self, dt: f64) -> Result<(), StepError> {
        self.sums.begin(&mut self.particles);
        let stretches = self.pairs.stretches.len();
        let are_far = self.particles.slots() > MOST_CACHED;
        let found = (0..stretches).try_for_each(|stretch| {
            if are_far && stretch + 1 < stretches {
                self.contacts.prefetch(stretch + 1);
                self.sums.prefetch(self.pairs.prefetch(stretch + 1), &self.particles);
            }
            self.find_contacts(stretch);
            if let Some(&(number, why)) = self.found.failed.first() {
                let start = self.pairs.stretches[stretch].range.start;
                return Err(self.unresolved(self.pairs.pairs[start + number as usize], why));
            }
            self.clock.lap(Phase::Contacts);
            self.contacts.compute_forces(stretch, &*self.law, &self.particles, dt, &mut self.sums);
            self.clock.lap(Phase::Forces);
            Ok(())
        });
        self.sums.end(&mut self.particles);
        found
    }

    /// Finds the contacts of a stretch, with one virtual call per kind of pair, and puts them in order.
    fn find_contacts(&mut self, stretch: usize) {
        let Self { pairs, contacts, particles, resolvers, law, found, active, .. } = self;
        found.clear();
        let listed = &pairs.stretches[stretch];
        let in_stretch = &pairs.pairs[listed.range.clone()];
        contacts.prepare(stretch, in_stretch.len(), &mut found.contacts, particles.needs);
        for group in &listed.groups {
            let Some(resolver) = resolvers.get(group.kinds) else { continue };
            let active = pairs.active(listed, group, particles, active);
            let mut failed = std::mem::take(&mut found.failed);
            resolver.resolve(&contacts.batch(stretch, in_stretch, active, particles), found);
            // Kept apart, so that the methods of the next group do not try them.
            found.failed.append(&mut failed);
            found.tally.pairs += active.len() as u64;
        }
        if self.reach > 0.0 {
            contacts.keep_outliving(stretch, in_stretch, found, &**law, particles);
        }
        found.tally.listed += in_stretch.len() as u64;
        found.tally.contacts += found.contacts.len() as u64;
        contacts.arrange(stretch, in_stretch, &mut found.contacts, particles);
        pairs.rest(stretch, &found.apart, particles);
    }

    /// First resolution of all pairs, before any force.
    fn look_first(&mut self) -> FirstLook {
        let mut first = FirstLook::default();
        let tally = self.found.tally;
        for stretch in 0..self.pairs.stretches.len() {
            self.find_contacts(stretch);
            first.new.extend(self.contacts.new_touches(&self.particles));
            let start = self.pairs.stretches[stretch].range.start;
            let pair = |k: u32| self.pairs.pairs[start + k as usize];
            first.unresolved.extend(self.found.failed.iter().map(|&(k, why)| (pair(k), why)));
        }
        // These pairs are resolved again later, so they do not count.
        self.found.tally = tally;
        first
    }

    fn unresolved(&self, pair: Pair, why: Why) -> StepError {
        let at = self.particles.position[pair.a.index()];
        StepError::Contact {
            step: self.step,
            a: self.particles.id[pair.a.index()],
            b: self.particles.body_name(self.particles.id[pair.b.index()]),
            x: at.x,
            y: at.y,
            z: at.z,
            distance: self.particles.bodies().relative(pair).norm(),
            why,
        }
    }

    /// Counts the energy that all owned particles bring into a stage, contacts left out, as received.
    pub fn count_free_energy(&mut self) {
        for slot in 0..self.particles.owned {
            // It includes the changes from their return through periodic borders.
            self.particles.accumulated[Quantity::Received][slot] =
                measure::free_energy(&self.particles, slot, &self.field);
        }
    }

    /// Counts as received the change of potential and step energies from the previous step [s] and gravity [m/s²] to the
    /// present ones.
    pub fn change_step_or_gravity(&mut self, step: f64, gravity: Vec3) {
        let Self { particles, field, dt, .. } = self;
        let before = Field { gravity, ..*field };
        for slot in 0..particles.owned {
            let [old, new] = [(&before, step), (&*field, *dt)].map(|(field, dt)| {
                measure::free_energy(particles, slot, field)
                    + motion::step_energy(particles, slot, field, dt)
            });
            particles.accumulated[Quantity::Received][slot] += new - old;
        }
    }

    /// Continues with another step [s] and the same positions, velocities and time.
    pub(crate) fn change_step(&mut self, dt: f64) {
        let before = std::mem::replace(&mut self.dt, dt);
        self.stage_shift += (self.step - self.stage_begin.0) as f64 * (before - dt);
        for wall in &mut self.particles.walls {
            wall.change_step(self.step, before);
        }
        self.change_step_or_gravity(before, self.field.gravity);
        // The work for the half step ahead with the previous step is counted already.
        self.count_work_of_images(0.0, 0.5 * (dt - before));
    }

    /// Counts as received the work of sliding images, or of a flow, through the contacts, half on each body. Both times are
    /// in s: `before` in the previous step, `ahead` in the next one. Forces act in the halves of both steps. The latter is
    /// counted ahead, and [`measure::measure`] leaves it out.
    fn count_work_of_images(&mut self, before: f64, ahead: f64) {
        if !self.particles.cell.moves_now() {
            return;
        }
        let mut received = std::mem::take(&mut self.particles.accumulated[Quantity::Received]);
        let particles = &self.particles;
        let times = [before, ahead];
        self.contacts.visit(
            particles,
            &mut WorkOfImages { particles, times, received: &mut received[..particles.owned] },
        );
        self.particles.accumulated[Quantity::Received] = received;
    }

    /// Counts as received the energy of the contacts at the start, for each particle in the order of its partners' ids.
    fn count_initial_energy(&mut self) {
        let particles = &mut self.particles;
        let mut brought: Vec<(usize, GlobalId, f64)> = Vec::new();
        for contact in self.contacts.loaded(&*self.law, particles) {
            let Loaded { pair, geometry, state, .. } = contact;
            let Pair { a, b } = pair;
            let stored = self.law.stored(pair, particles, geometry, state);
            let share = if b.index() >= particles.first_facet() { stored } else { 0.5 * stored };
            for (me, partner) in [(a, b), (b, a)] {
                if particles.is_owned(me) {
                    let me = particles.body_of(me).index();
                    brought.push((me, particles.id[partner.index()], share));
                }
            }
        }
        brought.sort_unstable_by_key(|&(me, partner, _)| (me, partner));
        for (me, _, energy) in brought {
            particles.accumulated[Quantity::Received][me] += energy;
        }
        for slot in 0..particles.owned {
            particles.accumulated[Quantity::Received][slot] +=
                motion::step_energy(particles, slot, &self.field, self.dt);
        }
    }
}
