//! Drives from outside the library: a spout that inserts particles and an outlet that removes those that fall through the
//! bottom.

use crate::support::{MATERIAL, OnRanks, State, scene};
use dem_mpi::comm::alone::Alone;
use dem_mpi::comm::{Comm, threads};
use dem_mpi::contact::StateColumn;
use dem_mpi::drive::{
    Drive, DriveError, Moment, Newcomers, Observer, Reporter, Restart, SavedColumn, SavedState,
    Takes, Values,
};
use dem_mpi::ids::{GlobalId, ShapeId};
use dem_mpi::math::Vec3;
use dem_mpi::output::snapshot::Reader;
use dem_mpi::particles::Particles;
use dem_mpi::particles::records::Particle;
use dem_mpi::population::Library;
use dem_mpi::scene::Scene;
use dem_mpi::scene::assemble;
use dem_mpi::sim::{Simulation, StepError};
use dem_mpi::walls::Wall;

const COUNT: StateColumn = StateColumn::new("count", 1, "1");

fn saved(count: u64) -> Vec<SavedColumn> {
    vec![SavedColumn::new(COUNT, Values::Counts(vec![count]))]
}

/// Inserts a particle every 150 steps, at four places in turn.
struct Spout {
    count: u64,
}

impl Drive for Spout {
    fn insert(
        &mut self,
        moment: &Moment,
        first_id: u64,
        _particles: &Particles,
        _comm: &mut dyn Comm,
    ) -> Option<Newcomers> {
        if !moment.stage_step.is_multiple_of(150) {
            return None;
        }
        let place = Vec3::new(0.004 + 0.004 * (self.count % 4) as f64, 0.01, 0.038);
        let grain = Particle::at_rest(GlobalId(first_id), ShapeId(0), place);
        self.count += 1;
        Some(Newcomers::of(vec![Particle { velocity: Vec3::new(0.2, 0.1, -1.0), ..grain }]))
    }
}

impl Observer for Spout {}

impl Reporter for Spout {
    fn name(&self) -> &'static str {
        "spout"
    }

    fn save(&self, _walls: &[Wall], _comm: &mut dyn Comm) -> Vec<SavedColumn> {
        saved(self.count)
    }

    fn resume(&mut self, restart: &Restart, _walls: &mut [Wall]) -> Result<(), DriveError> {
        self.count = restart.saved.counts(&COUNT)?[0];
        Ok(())
    }
}

/// Removes particles that leave through the bottom.
struct Outlet {
    count: u64,
}

impl Drive for Outlet {
    fn takes(&self, _moment: &Moment) -> Takes {
        Takes::Outside
    }

    fn take(&mut self, _moment: &Moment, leaver: &Particle, particles: &Particles) -> bool {
        let takes = leaver.position.z < particles.cell.corners().0.z;
        self.count += u64::from(takes);
        takes
    }
}

impl Observer for Outlet {}

impl Reporter for Outlet {
    fn name(&self) -> &'static str {
        "outlet"
    }

    fn save(&self, _walls: &[Wall], _comm: &mut dyn Comm) -> Vec<SavedColumn> {
        saved(self.count)
    }

    fn resume(&mut self, restart: &Restart, _walls: &mut [Wall]) -> Result<(), DriveError> {
        if !restart.is_new_stage {
            self.count = restart.saved.counts(&COUNT)?[0];
        }
        Ok(())
    }
}

/// Ellipsoids that fall through a box without a bottom.
const SHAFT: &str = r#"
gravity = [0.5, 0.2, -9.81]
global_damping = 2.0
[domain]
low = [0, 0, 0]
high = [0.02, 0.02, 0.04]
walls = ["-x", "+x", "-y", "+y"]
MATERIAL
[[shape]]
name = "egg"
kind = "ellipsoid"
semi_axes = [0.001, 0.0008, 0.0009]
[[fill.lattice]]
low = [0, 0, 0.001]
high = [0.02, 0.02, 0.03]
spacing = 0.0021
velocity = [0.4, -0.3, -0.5]
[time]
step = 1e-5
steps = 4000
[neighbours]
imbalance = 1.05
[output]
directory = "out"
"#;

fn shaft() -> Scene {
    scene(&SHAFT.replace("MATERIAL", MATERIAL))
}

fn assembled(scene: &Scene, comm: &dyn Comm) -> Simulation {
    let mut sim = assemble::assemble(scene, comm);
    sim.drives.push(Box::new(Spout { count: 0 }));
    sim.drives.push(Box::new(Outlet { count: 0 }));
    sim
}

fn on_ranks(scene: &Scene) -> OnRanks<'_> {
    OnRanks { scene, assembled: |scene, comm| assembled(scene, comm) }
}

fn count_of(state: &State, drive: &str) -> u64 {
    let saved = state.drives.iter().find(|saved| saved.drive == drive).unwrap();
    saved.counts(&COUNT).unwrap()[0]
}

/// Inserted and removed particles are identical on any number of ranks, and the energy error is small.
#[test]
fn grains_come_and_go_the_same_on_any_number_of_ranks() {
    let (scene, steps) = (shaft(), 4000);
    let alone = on_ranks(&scene).run(1, steps);
    let (sent, taken) = (count_of(&alone, "spout"), count_of(&alone, "outlet"));
    let first = scene.particle_count();
    assert!(first > 500 && sent == 26, "{first} {sent}");
    assert!(taken > 300 && alone.bits.len() as u64 == first + sent - taken, "{taken} are gone");
    // The work of a leaving particle on its partners in its last step is not counted.
    let [missing, dissipated] = ["missing", "dissipated"].map(|name| alone.number(name));
    println!("{taken} of {first} are gone, {missing:e} J of {dissipated:e} J is missing");
    assert!(missing.abs() < 1e-4 * dissipated, "{missing:e} J of {dissipated:e} J is missing");
    let text = SHAFT.replace("MATERIAL", MATERIAL);
    let deep = crate::support::scene(&text.replace("low = [0, 0, 0]\n", "low = [0, 0, -1]\n"));
    let deep = on_ranks(&deep).run(1, steps);
    assert_eq!((deep.bits.len() as u64, count_of(&deep, "outlet")), (first + sent, 0));
    let [missing, dissipated] = ["missing", "dissipated"].map(|name| deep.number(name));
    println!("{missing:e} J of {dissipated:e} J is missing if none leaves");
    assert!(missing.abs() < 5e-6 * dissipated, "{missing:e} J of {dissipated:e} J");
    assert!(alone == on_ranks(&scene).run(3, steps), "three ranks");
    let folder = tempfile::tempdir().unwrap();
    let again = on_ranks(&scene).restarted([3, 2], [steps / 2, steps], folder.path());
    let half_way = Reader::open(folder.path()).unwrap().header().clone();
    assert!(half_way.departed.dissipated > 0.0, "{:?}", half_way.departed);
    assert!(alone == again, "a restart");
}

/// The skin of the pair list decides when the list is rebuilt, but not when a particle leaves.
#[test]
fn the_skin_does_not_show_in_what_leaves() {
    let scene = shaft();
    let usual = on_ranks(&scene).run(2, 1500);
    assert!(count_of(&usual, "outlet") > 50);
    let wide = Scene { skin: 3.0 * scene.skin, ..scene.clone() };
    assert!(usual == on_ranks(&wide).run(2, 1500));
}

/// One damped, rotating ellipsoid without contacts: the energy balance holds to rounding.
#[test]
fn a_free_grain_takes_its_energy_with_it() {
    let text = SHAFT
        .replace("MATERIAL", MATERIAL)
        .replace("low = [0, 0, 0.001]\nhigh = [0.02, 0.02, 0.03]", "first = [0.01, 0.01, 0.002]")
        .replace("spacing = 0.0021", "count = [1, 1, 1]");
    let scene = scene(&text);
    let mut comm = Alone::default();
    let mut sim = assemble::assemble(&scene, &comm);
    sim.drives.push(Box::new(Outlet { count: 0 }));
    let momentum = Vec3::new(1e-9, -2e-9, 3e-9);
    let grain = Particle::at_rest(GlobalId(0), ShapeId(0), Vec3::new(0.01, 0.01, 0.002));
    let velocity = Vec3::new(0.1, 0.2, -0.5);
    sim.particles.strip_to_owned();
    sim.insert(&Particle { velocity, angular_momentum: momentum, ..grain });
    sim.begin(&mut comm).unwrap();
    let mut before = sim.measure(&mut comm);
    while sim.particles.owned > 0 {
        before = sim.measure(&mut comm);
        sim.step(&mut comm).unwrap();
        assert!(sim.step < 1000, "it does not leave");
    }
    let after = sim.measure(&mut comm);
    assert!(sim.step > 100 && before.kinetic() > 0.0 && before.rotation > 0.0);
    assert_eq!((after.particles, after.kinetic(), after.gravity), (0, 0.0, 0.0));
    assert!(after.dissipated > 0.0 && after.received > 0.0);
    let missing = [before.missing(), after.missing()].map(|missing| missing / before.kinetic());
    assert!((missing[0] - missing[1]).abs() < 1e-12, "{missing:?}");
    // A step with an empty box.
    sim.step(&mut comm).unwrap();
}

/// A particle that no drive removes is lost, as without an outlet.
#[test]
fn an_outlet_takes_only_what_is_its_own() {
    let open = SHAFT
        .replace("MATERIAL", MATERIAL)
        .replace(r#"walls = ["-x", "+x", "#, r#"walls = ["-x", "#)
        .replace("gravity = [0.5, 0.2, -9.81]", "gravity = [300.0, 0.0, 0.0]");
    let scene = scene(&open);
    let errors = threads::run(2, |comm| {
        let mut sim = assembled(&scene, comm);
        assemble::fill(&mut sim, &scene, comm);
        sim.begin(comm).unwrap();
        loop {
            if let Err(error) = sim.step(comm) {
                break error;
            }
            assert!(sim.step < 4000, "it goes on");
        }
    });
    for error in &errors {
        assert!(matches!(error, StepError::Domain { .. }), "{error}");
        assert!(error.to_string().contains("has left the domain"), "{error}");
        assert_eq!(error.to_string(), errors[0].to_string());
    }
}

/// A saved state with other columns is rejected, with the drive's name and advice.
#[test]
fn a_state_that_does_not_fit_is_refused() {
    let columns = vec![SavedColumn::new(COUNT, Values::Reals(vec![7.0]))];
    let saved = SavedState { drive: "outlet".to_owned(), columns };
    let mut outlet = Outlet { count: 0 };
    let restart =
        Restart { saved: &saved, is_new_stage: false, library: &Library::default(), is_root: true };
    let error = outlet.resume(&restart, &mut []).unwrap_err().to_string();
    assert!(error.contains("`outlet` has no column `count` of 1 numbers"), "{error}");
    assert!(error.contains("run the scene again"), "{error}");
}
