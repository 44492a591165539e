//! Simple shear of spheres without walls: pressure of a granular gas, and yield of a dense packing at a constant volume and at a constant
//! pressure.

use super::setup::{begun, parse};
use super::{Case, Effort, Findings};
use dem_mpi::comm::alone::Alone;
use dem_mpi::measure::Bulk;
use dem_mpi::random::Random;
use std::f64::consts::PI;
use std::fmt::Write;

const LUN: &str = "Lun et al. 1984, 10.1017/S0022112084000586";
const CHIALVO: &str = "Chialvo, Sun and Sundaresan 2012, 10.1103/PhysRevE.85.021305";

/// Diameter [m].
const DIAMETER: f64 = 1e-3;
/// Density [kg/m³].
const DENSITY: f64 = 2500.0;

/// Runs all cases.
pub(crate) fn run(effort: Effort) -> Findings {
    let mut cases = vec![gas(effort)];
    if effort == Effort::Full {
        cases.push(yielding());
        cases.extend(under_pressure());
    }
    Findings { cases, ..Findings::default() }
}

/// Spheres in a sheared cell.
struct Flow {
    /// Positions of the spheres over the edge of the cell.
    places: Vec<[f64; 3]>,
    /// Volume of the spheres over that of the cell at the beginning.
    fraction: f64,
    by: By,
    /// Shear rate: velocity over height [1/s].
    rate: f64,
    /// Largest component of the initial velocities relative to the flow, over rate times diameter.
    agitation: f64,
    stiffness: f64,
    friction: f64,
    restitution: f64,
    dt: f64,
    /// Strain until the steady state, and until the end.
    strains: [f64; 2],
}

/// Cause of a flow.
#[derive(Clone, Copy)]
enum By {
    /// Images that slide.
    Images,
    /// A cell whose edges lean, with its volume.
    Cell,
    /// A cell with a pressure in place of a volume [Pa].
    Pressure(f64),
}

impl By {
    /// Text of the scene after the corners of its domain, for a shear rate [1/s].
    fn text(self, rate: f64) -> String {
        match self {
            Self::Images => {
                format!("shear = {{ along = \"x\", across = \"y\", rate = {rate:e} }}\n")
            }
            Self::Cell => format!("[cell]\nxy = {{ rate = {:e} }}\n", -rate),
            Self::Pressure(pressure) => {
                let max = 2.0 * rate;
                format!(
                    "[cell]\nisotropic = {{ stress = {pressure:e} }}\nxy = {{ rate = {:e} }}\nmax_rate = {max:e}\n",
                    -rate
                )
            }
        }
    }
}

/// Means of a steady flow, compression positive [Pa].
struct Steady {
    /// Pressure of the motion, and total pressure: means of the normal stresses.
    pressure: [f64; 2],
    /// Total shear stress.
    shear: f64,
    /// Volume of the spheres over that of the cell.
    fraction: f64,
}

impl Flow {
    fn steady(&self) -> Steady {
        let count = self.places.len() as f64;
        let edge = DIAMETER * (count * PI / (6.0 * self.fraction)).cbrt();
        let Self { by, rate, stiffness, friction, restitution, dt, .. } = self;
        let text = format!(
            "title = \"shear\"\n[domain]\nlow = [0, 0, 0]\nhigh = [{edge:e}, {edge:e}, {edge:e}]\nperiodic = [true, true, true]\n\
             {}[[material]]\nname = \"m\"\ndensity = {DENSITY}\n\
             normal_stiffness = {stiffness:e}\ntangential_stiffness = {:e}\nfriction = {friction}\nrestitution = {restitution}\n\
             [[shape]]\nname = \"ball\"\nkind = \"sphere\"\ndiameter = {DIAMETER:e}\n[[fill.file]]\npath = \"grains.csv\"\n\
             [time]\nstep = {dt:e}\nsteps = 1\n[output]\ndirectory = \"out\"\n",
            by.text(*rate),
            stiffness * 2.0 / 7.0
        );
        let mut random = Random::of(11, 0);
        let mut grains = "x,y,z,vx,vy,vz\n".to_owned();
        for place in &self.places {
            let [x, y, z] = place.map(|x| x * edge);
            let [u, v, w] = [0; 3].map(|_| self.agitation * rate * DIAMETER * random.signed());
            writeln!(grains, "{x:e},{y:e},{z:e},{u:e},{v:e},{w:e}").expect("text");
        }
        let mut sim = begun(&parse(&text, &grains), &mut Alone::default());
        let [from, to] = self.strains.map(|strain| (strain / (rate * dt)) as u64);
        let mut all: Vec<Bulk> = Vec::new();
        for step in 0..to {
            sim.step(&mut Alone::default()).expect("a sound step");
            if step >= from && step % 50 == 0 {
                all.extend(sim.measure(&mut Alone::default()).bulk);
            }
        }
        let mean = |of: &dyn Fn(&Bulk) -> f64| all.iter().map(of).sum::<f64>() / all.len() as f64;
        let normal = |stress: &[f64; 6]| stress[..3].iter().sum::<f64>() / 3.0;
        Steady {
            pressure: [
                mean(&|bulk| normal(&bulk.of_motion)),
                mean(&|bulk| normal(&bulk.of_motion) + normal(&bulk.of_contacts)),
            ],
            shear: mean(&|bulk| bulk.of_motion[3] + bulk.of_contacts[3]).abs(),
            fraction: mean(&|bulk| bulk.solid_fraction),
        }
    }
}

/// A cubic lattice with `along` places along each edge, each displaced at random by at most `jitter` of the
/// spacing.
fn lattice(along: u32, first: f64, jitter: f64, random: &mut Random) -> Vec<[f64; 3]> {
    let mut places = Vec::new();
    for i in 0..along {
        for j in 0..along {
            for k in 0..along {
                let at = |n: u32, by: f64| (f64::from(n) + first + jitter * by) / f64::from(along);
                places.push([i, j, k].map(|n| at(n, random.signed())));
            }
        }
    }
    places
}

/// Smooth inelastic spheres: the pressure over that of a gas without contacts.
fn gas(effort: Effort) -> Case {
    let mut case = Case::new(
        LUN,
        "sheared gas of smooth spheres, restitution 0.9",
        "pressure over density times granular temperature",
        0.05,
        "the theory is of first order in gradients and in losses; DIRT allows 0.15",
    );
    let (restitution, along) = (0.9, effort.pick(8, 11));
    for fraction in effort.pick(&[0.3][..], &[0.1, 0.2, 0.3, 0.4, 0.45]) {
        // Touching spheres on the lattice fill 0.52.
        let room = 1.0 - (fraction * 6.0 / PI).cbrt();
        let flow = Flow {
            places: lattice(along, 0.5, 0.45 * room, &mut Random::of(3, u64::from(along))),
            fraction: *fraction,
            by: By::Images,
            rate: 100.0,
            agitation: 1.0,
            stiffness: 1e3,
            friction: 0.0,
            restitution,
            dt: 3e-6,
            strains: effort.pick([4.0, 14.0], [10.0, 50.0]),
        };
        let Steady { pressure: [of_motion, all], .. } = flow.steady();
        let at_contact = (2.0 - fraction) / (2.0 * (1.0 - fraction).powi(3));
        // Density times temperature is the pressure of the motion over the volume fraction.
        let own = all / of_motion * fraction;
        let theory = fraction * (1.0 + 2.0 * (1.0 + restitution) * fraction * at_contact);
        case.relative(format!("volume fraction {fraction}"), theory, own);
    }
    case
}

/// Friction, and the published ratio of shear stress and pressure and solid fraction of jamming.
const PUBLISHED: [[f64; 3]; 5] = [
    [0.0, 0.105, 0.636],
    [0.1, 0.268, 0.613],
    [0.3, 0.357, 0.596],
    [0.5, 0.382, 0.587],
    [1.0, 0.405, 0.581],
];

/// 1,024 spheres that flow slowly.
fn slow(by: By, friction: f64, fraction: f64, rate: f64) -> Steady {
    let mut random = Random::of(5, 1);
    let mut places = lattice(8, 0.25, 0.01, &mut random);
    places.extend(lattice(8, 0.75, 0.01, &mut random));
    let flow = Flow {
        places,
        fraction,
        by,
        rate,
        agitation: 0.0,
        stiffness: 1e4,
        friction,
        restitution: 0.7,
        dt: 4e-6,
        strains: [2.0, 5.0],
    };
    flow.steady()
}

/// Frictional spheres above the solid fraction of jamming: shear stress over pressure of slow flow.
fn yielding() -> Case {
    let mut case = Case::new(
        CHIALVO,
        "dense spheres sheared slowly, restitution 0.7, tangential over normal stiffness 2/7",
        "shear stress over pressure",
        0.02,
        "1,024 spheres, one seed each, strain 2 to 5 at an inertial number of 1e-3; published are limits of no inertia, by fits",
    );
    for (name, by) in [("", By::Images), (", in a cell", By::Cell)] {
        // Solid fractions above jamming.
        for ([friction, ratio, _], fraction) in PUBLISHED[1..].iter().zip([0.64, 0.62, 0.61, 0.61])
        {
            let Steady { pressure: [_, all], shear, .. } = slow(by, *friction, fraction, 6.0);
            case.absolute(format!("friction {friction}{name}"), *ratio, shear / all);
        }
    }
    case
}

/// Such spheres under a pressure: shear stress, and the solid fraction to which they dilate.
fn under_pressure() -> [Case; 2] {
    const PRESSURE: f64 = 3e3;
    const INERTIAL: f64 = 1e-3;
    let case = |quantity: &str, tolerance| {
        Case::new(
            CHIALVO,
            "dense spheres sheared slowly in a cell under a pressure of 3e-4 of the stiffness over the diameter",
            quantity,
            tolerance,
            "1,024 spheres, one seed each, strain 2 to 5 at an inertial number of 1e-3; published are limits of no inertia and no overlap, by fits",
        )
    };
    let mut cases = [case("shear stress over pressure", 0.02), case("solid fraction", 0.01)];
    let rate = INERTIAL / DIAMETER * (PRESSURE / DENSITY).sqrt();
    for [friction, ratio, jammed] in PUBLISHED {
        let by = By::Pressure(PRESSURE);
        let Steady { pressure: [_, all], shear, fraction } = slow(by, friction, 0.55, rate);
        cases[0].absolute(format!("friction {friction}"), ratio, shear / all);
        cases[1].absolute(format!("friction {friction}"), jammed, fraction);
    }
    cases
}
