//! Other codes on the same state.
//!
//! To add a code, write a function that gives a [`Case`], and name it in [`CODES`].

use super::setup::begun;
use super::{Case, Effort, Findings};
use dem_mpi::comm::alone::Alone;
use dem_mpi::scene::Scene;
use std::path::Path;

/// What was run elsewhere on a state that this program can begin with, too.
const CODES: [fn(Effort) -> Vec<Case>; 1] = [contacts_of_settled_ellipsoids];

/// All of them.
pub(crate) fn run(effort: Effort) -> Findings {
    let cases = CODES.iter().flat_map(|code| code(effort)).collect();
    Findings { cases, ..Findings::default() }
}

/// The restitution [-] of which the program makes this damping ratio, if dashpots do not pull (Schwager and Pöschel
/// 2007, DOI 10.1007/s10035-007-0065-z).
fn restitution(damping_ratio: f64) -> f64 {
    let angle = damping_ratio.asin();
    (-(std::f64::consts::PI - 2.0 * angle) * angle.tan()).exp()
}

/// 5,120 settled ellipsoids (`benchmarks/settled`) fall for 20 steps of 10 µs from rest. waLBerla (GJK and EPA) and
/// MercuryDPM (superquadrics) find the same number of contacts.
fn contacts_of_settled_ellipsoids(_: Effort) -> Vec<Case> {
    let (stiffness, normal, tangential) = (1.5e5, 12.0, 6.0);
    let [a, b] = [2.381_101_577_952_299_4e-3, 1.190_550_788_976_149_7e-3];
    let mass = 265_000.0 * 4.0 / 3.0 * std::f64::consts::PI * a * b * b;
    // Two grains have half of the mass, a grain and a wall all of it.
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
    let mut sim = begun(&scene, &mut Alone::default());
    for _ in 0..20 {
        sim.step(&mut Alone::default()).unwrap_or_else(|error| panic!("{error}"));
    }
    let measures = sim.measure(&mut Alone::default());
    let mut case = Case::new(
        "waLBerla mesa_pd and MercuryDPM on benchmarks/settled (2026-11)",
        "5,120 settled ellipsoids, 20 steps of 10 µs from rest",
        "contacts among grains",
        1.0,
        "a pair that just touches or just does not",
    );
    case.absolute("k 1.5e5 N/m, c 12 and 6 kg/s, friction 0.3", 13_864.0, measures.contacts as f64);
    vec![case]
}
