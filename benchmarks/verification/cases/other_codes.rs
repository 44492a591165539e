//! Results of other codes on the same state.
//!
//! To add a code, write a function that gives a [`Case`], and name it in [`CODES`].

use super::setup::begun;
use super::{Case, Effort, Findings};
use dem_mpi::comm::alone::Alone;
use dem_mpi::scene::Scene;
use std::path::Path;

/// Cases of states that other codes have run, and that this program can also begin with.
const CODES: [fn(Effort) -> Vec<Case>; 1] = [contacts_of_settled_ellipsoids];

/// Runs all cases.
pub(crate) fn run(effort: Effort) -> Findings {
    let cases = CODES.iter().flat_map(|code| code(effort)).collect();
    Findings { cases, ..Findings::default() }
}

/// Restitution [-] from which the program computes this damping ratio, if dashpots may pull.
fn restitution(damping_ratio: f64) -> f64 {
    (-std::f64::consts::PI * damping_ratio / (1.0 - damping_ratio * damping_ratio).sqrt()).exp()
}

/// 5,120 settled ellipsoids (`benchmarks/settled`) fall for 20 steps of 10 µs from rest. waLBerla (GJK and EPA) and
/// MercuryDPM (superquadrics) find the same number of contacts. Their dashpots may pull.
fn contacts_of_settled_ellipsoids(_: Effort) -> Vec<Case> {
    let (stiffness, normal, tangential) = (1.5e5, 12.0, 6.0);
    let [a, b] = [2.381_101_577_952_299_4e-3, 1.190_550_788_976_149_7e-3];
    let mass = 265_000.0 * 4.0 / 3.0 * std::f64::consts::PI * a * b * b;
    // The reduced mass of two particles is half of a mass, that of a particle and a wall the whole.
    let material = |reduced: f64| {
        let critical = 2.0 * (reduced * stiffness).sqrt();
        format!(
            "restitution = {:e}\ntangential_damping_ratio = {:e}",
            restitution(normal / critical),
            tangential / critical
        )
    };
    let text = format!(
        r#"
gravity = [0.0, 0.0, -9.81]
[domain]
low = [0.0, 0.0, 0.0]
high = [0.04, 0.04, 0.2]
walls = ["-x", "+x", "-y", "+y", "-z"]
wall_material = "wall"
[[material]]
name = "grain"
density = 265000.0
normal_stiffness = {stiffness:e}
friction = 0.3
{}
[[material]]
name = "wall"
density = 265000.0
normal_stiffness = {stiffness:e}
friction = 0.3
[[interaction]]
between = ["grain", "wall"]
normal_stiffness = {stiffness:e}
friction = 0.3
{}
[[shape]]
name = "grain"
material = "grain"
kind = "ellipsoid"
semi_axes = [{a:e}, {b:e}, {b:e}]
[[fill.file]]
path = "ellipsoids_5120.csv"
[law]
limit_damping = false
[time]
step = 1e-5
steps = 20
allow_unstable = true
[output]
directory = "out"
"#,
        material(0.5 * mass),
        material(mass)
    );
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("benchmarks/settled");
    let scene =
        Scene::parse(&text, "settled", &folder, &[]).unwrap_or_else(|errors| panic!("{errors}"));
    let mut case = Case::new(
        "waLBerla mesa_pd and MercuryDPM on benchmarks/settled (2026-11)",
        "5,120 settled ellipsoids, 20 steps of 10 µs from rest",
        "contacts among grains",
        2.0,
        "what a step changes: 3 at the end; a code that knows no force before its first step begins with half a kick",
    );
    let set = "k 1.5e5 N/m, c 12 and 6 kg/s, friction 0.3";
    case.absolute(set, 13_864.0, contacts_after(&scene, 20, false));
    case.absolute(
        format!("{set}; half a kick, then 19 steps"),
        13_864.0,
        contacts_after(&scene, 19, true),
    );
    vec![case]
}

/// Contacts between particles after this number of steps; if `kicked`, the first half kick counts twice.
fn contacts_after(scene: &Scene, steps: u32, kicked: bool) -> f64 {
    let mut sim = begun(scene, &mut Alone::default());
    if kicked {
        let half = 0.5 * sim.dt;
        for slot in 0..sim.particles.owned {
            let force = sim.field.force(&sim.particles, slot);
            sim.particles.velocity[slot] = force * (half / sim.particles.mass(slot));
            let spin = sim.particles.spin.as_mut().expect("grains turn");
            spin.angular_momentum[slot] = spin.torque[slot].vector * half;
        }
    }
    for _ in 0..steps {
        sim.step(&mut Alone::default()).unwrap_or_else(|error| panic!("{error}"));
    }
    sim.measure(&mut Alone::default()).contacts as f64
}
