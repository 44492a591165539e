//! Many spheres: Haff's law of cooling, and frictionless jamming.

use super::setup::{begun, parse};
use super::{Case, Curve, Effort, Findings, Picture, least_squares};
use dem_mpi::comm::alone::Alone;
use dem_mpi::math::Vec3;
use dem_mpi::random::Random;
use dem_mpi::sim::Simulation;
use std::f64::consts::PI;
use std::fmt::Write;

const HAFF: &str =
    "Haff 1983, 10.1017/S0022112083003419; rate of van Noije and Ernst 1998, 10.1007/s100350050009";
const JAMMING: &str = "O'Hern et al. 2003, 10.1103/PhysRevE.68.011306";

/// Runs all cases.
pub(crate) fn run(effort: Effort) -> Findings {
    let mut findings = Findings::default();
    cooling(effort, &mut findings);
    jamming(effort, &mut findings);
    findings
}

/// A box that repeats in all directions, with its spheres.
struct Crowd {
    side: f64,
    radius: f64,
    /// Further TOML of the scene, such as `global_damping`.
    scene: String,
    /// TOML of the only material, without its name.
    material: String,
    dt: f64,
    positions: Vec<Vec3>,
    velocities: Vec<Vec3>,
}

impl Crowd {
    fn begun(&self) -> Simulation {
        let Self { side, radius, scene, material, dt, .. } = self;
        let text = format!(
            r#"{scene}
[domain]
low = [0, 0, 0]
high = [{side:e}, {side:e}, {side:e}]
periodic = [true, true, true]
[[material]]
name = "m"
{material}
[[shape]]
name = "ball"
kind = "sphere"
radius = {radius:e}
[[fill.file]]
path = "grains.csv"
[time]
step = {dt:e}
steps = 1
[output]
directory = "out"
"#
        );
        let mut grains = "x,y,z,vx,vy,vz\n".to_owned();
        for (x, v) in self.positions.iter().zip(&self.velocities) {
            let cells: Vec<String> = x.iter().chain(v).map(|x| format!("{x:e}")).collect();
            writeln!(grains, "{}", cells.join(",")).expect("text");
        }
        begun(&parse(&text, &grains), &mut Alone::default())
    }
}

/// A number of the normal distribution: the sum of twelve uniform ones.
fn normal(random: &mut Random) -> f64 {
    (0..12).map(|_| random.unit()).sum::<f64>() - 6.0
}

/// Temperature: the mean square of a component of these velocities [m²/s²].
fn temperature(velocities: &[Vec3]) -> f64 {
    velocities.iter().map(Vec3::norm_squared).sum::<f64>() / (3.0 * velocities.len() as f64)
}

/// Velocities of a gas [m/s], without total momentum, at a temperature of 1 m²/s².
fn velocities(count: i32) -> Vec<Vec3> {
    let mut random = Random::of(7, 0);
    let mut velocities: Vec<Vec3> =
        (0..count).map(|_| Vec3::from_fn(|_, _| normal(&mut random))).collect();
    let mean = velocities.iter().sum::<Vec3>() / f64::from(count);
    for v in &mut velocities {
        *v -= mean;
    }
    let size = temperature(&velocities).sqrt();
    for v in &mut velocities {
        *v /= size;
    }
    velocities
}

/// Smooth inelastic spheres without gravity cool as T = T0/(1 + t/tc)².
fn cooling(effort: Effort, findings: &mut Findings) {
    let per_side = effort.pick(7, 10);
    let count = per_side * per_side * per_side;
    let (radius, solid, e, density) = (1.1e-3, 0.07, 0.9, 2500.0);
    let volume = 4.0 / 3.0 * PI * radius * radius * radius;
    let side = (f64::from(count) * volume / solid).cbrt();
    let spacing = side / f64::from(per_side);
    let place = |k: i32| {
        let cell = [k % per_side, k / per_side % per_side, k / per_side / per_side];
        Vec3::from(cell.map(|n| (f64::from(n) + 0.5) * spacing))
    };
    // A contact takes 60 µs: a fiftieth of the time between two contacts.
    let stiffness = 0.5 * density * volume * (PI / 6e-5f64).powi(2);
    let crowd = Crowd {
        side,
        radius,
        scene: String::new(),
        material: format!(
            "density = {density}\nnormal_stiffness = {stiffness:e}\nrestitution = {e}"
        ),
        dt: 2.5e-6,
        positions: (0..count).map(place).collect(),
        velocities: velocities(count),
    };
    let mut sim = crowd.begun();
    let mut now = || {
        let particles = &sim.particles;
        let point = (sim.time(), temperature(&particles.velocity[..particles.owned]));
        for _ in 0..200 {
            sim.step(&mut Alone::default()).unwrap_or_else(|error| panic!("{error}"));
        }
        point
    };
    let d = 2.0 * radius;
    let g0 = (1.0 - solid / 2.0) / (1.0 - solid).powi(3);
    let n = solid / volume;
    let rate = 4.0 / 3.0 * n * d * d * g0 * PI.sqrt() * (1.0 - e * e);
    let published = 2.0 / rate;
    // The lattice melts first: a few collisions of each sphere.
    let (melted, end) = (0.2 * published, effort.pick(2.5, 5.0) * published);
    let mut points = Vec::new();
    loop {
        let (time, temperature) = now();
        points.push((time, 1.0 / temperature.sqrt()));
        if time > end {
            break;
        }
    }
    let later: Vec<(f64, f64)> = points.iter().copied().filter(|p| p.0 > melted).collect();
    let (_, slope, explained) = least_squares(&later);
    let mut time = Case::new(
        HAFF,
        format!("{count} smooth inelastic spheres cool, solid fraction 0.07, e = 0.9"),
        "slope of 1/sqrt T over time, times the time constant (relative)",
        effort.pick(0.08, 0.05),
        "contacts take time (2 % of that between two), Maxwell's distribution is one of elastic spheres (1 %), few spheres",
    );
    time.relative("slope", 1.0, slope * published);
    let mut line = Case::new(
        HAFF,
        "the same",
        "variance of 1/sqrt T that a line explains",
        1e-3,
        "DIRT asks 0.9997 of 800 spheres",
    );
    line.absolute("least squares", 1.0, explained);
    findings.cases.extend([time, line]);
    let exact = [0.0, end].map(|t| (t, 1.0 + t / published)).to_vec();
    findings.pictures.push(Picture {
        file: "haff",
        axes: ["time (s)", "1/sqrt(T/T0)"],
        is_logarithmic: false,
        curves: vec![Curve::new("Haff", exact), Curve::new("here", points)],
    });
}

/// Frictionless spheres that grow from random places, and shrink again until the pressure vanishes.
fn jamming(effort: Effort, findings: &mut Findings) {
    let (count, side) = (effort.pick(300, 500), 1.0);
    let mut fraction = Case::new(
        JAMMING,
        format!("{count} spheres without friction, grown in a periodic box from random places"),
        "solid fraction where the pressure vanishes",
        effort.pick(0.01, 0.008),
        "0.639 is of infinitely many; packings scatter by 0.1/sqrt N and more, and depend on how they were made",
    );
    let mut contacts = Case::new(
        JAMMING,
        "the same",
        "contacts of a sphere there, rattlers left out",
        0.15,
        "extrapolated along the square root of the pressure",
    );
    let mut curves = Vec::new();
    for seed in 1..=effort.pick(1, 2) {
        let mut random = Random::of(seed, 0);
        let radius =
            |solid: f64| (solid * side * side * side / (count as f64 * 4.0 / 3.0 * PI)).cbrt();
        let positions = apart(count, side, 2.0 * radius(0.3), &mut random);
        // Unit mass and stiffness.
        let crowd = |solid: f64, damping: f64, positions: Vec<Vec3>| {
            let r = radius(solid);
            let density = 1.0 / (4.0 / 3.0 * PI * r * r * r);
            Crowd {
                side,
                radius: r,
                scene: format!("global_damping = {damping:e}"),
                material: format!("density = {density:e}\nnormal_stiffness = 1.0"),
                dt: 0.2,
                velocities: vec![Vec3::zeros(); positions.len()],
                positions,
            }
        };
        let mut packing = relaxed(&crowd(0.4, 1.0, positions), 1000);
        for solid in [0.5, 0.58, 0.64, 0.68] {
            packing = relaxed(&crowd(solid, 1.0, packing.positions), 1000);
        }
        let mut points = Vec::new();
        let mut coordinations = Vec::new();
        let mut solid = 0.66;
        // Towards the point of zero pressure, each time half of the remaining distance.
        for _ in 0..effort.pick(5, 6) {
            packing = relaxed(&crowd(solid, 0.1, packing.positions), effort.pick(5000, 10_000));
            if packing.pressure < 1e-9 {
                break;
            }
            points.push((solid, packing.pressure));
            coordinations.push((packing.pressure.sqrt(), packing.coordination));
            solid -= 0.5 * (solid - vanishing(&points).unwrap_or(solid - 0.02));
        }
        let found = vanishing(&points).expect("it presses twice at least");
        fraction.absolute(format!("seed {seed}"), 0.639, found);
        contacts.absolute(format!("seed {seed}"), 6.0, least_squares(&coordinations).0);
        curves.push(Curve::new(format!("seed {seed}"), points));
    }
    findings.cases.extend([fraction, contacts]);
    findings.pictures.push(Picture {
        file: "jamming",
        axes: ["solid fraction", "pressure (stiffness/length)"],
        is_logarithmic: false,
        curves,
    });
}

/// Random places in a periodic box, chosen one after the other with at least this distance [m].
pub(super) fn apart(count: usize, side: f64, distance: f64, random: &mut Random) -> Vec<Vec3> {
    let mut places: Vec<Vec3> = Vec::new();
    while places.len() < count {
        let place = Vec3::from_fn(|_, _| side * random.unit());
        let near = |other: &Vec3| {
            let r = (place - other).map(|x| x - side * (x / side).round());
            r.norm() < distance
        };
        if !places.iter().any(near) {
            places.push(place);
        }
    }
    places
}

/// Zero of the line through the last two points.
pub(super) fn vanishing(points: &[(f64, f64)]) -> Option<f64> {
    let [(a, p), (b, q)] = points.last_chunk::<2>()?;
    Some(b - q * (a - b) / (p - q))
}

/// A packing at rest.
struct Relaxed {
    positions: Vec<Vec3>,
    /// A third of the sum of force times branch over the volume.
    pressure: f64,
    /// Mean number of contacts of the spheres that have at least four, among themselves.
    coordination: f64,
}

fn relaxed(crowd: &Crowd, steps: usize) -> Relaxed {
    let mut sim = crowd.begun();
    for _ in 0..steps {
        sim.step(&mut Alone::default()).unwrap_or_else(|error| panic!("{error}"));
    }
    let particles = &sim.particles;
    let contacts: Vec<_> = sim.contacts.loaded(&*sim.law, particles).collect();
    let virial: f64 = contacts
        .iter()
        .filter(|contact| contact.normal_force > 0.0)
        .map(|contact| contact.normal_force * (2.0 * crowd.radius - contact.geometry.overlap))
        .sum();
    // A contact with a ghost is listed on either side of the period.
    let id = |slot: dem_mpi::ids::Slot| particles.id[slot.index()].0 as usize;
    let mut pairs: Vec<[usize; 2]> =
        contacts.iter().map(|c| [id(c.pair.a), id(c.pair.b)]).collect();
    let listed = pairs.len() as f64;
    for pair in &mut pairs {
        pair.sort_unstable();
    }
    pairs.sort_unstable();
    pairs.dedup();
    let virial = virial * pairs.len() as f64 / listed.max(1.0);
    let mut caged = vec![true; particles.owned];
    let coordination = loop {
        let mut counts = vec![0; particles.owned];
        for [a, b] in pairs.iter().filter(|[a, b]| caged[*a] && caged[*b]) {
            counts[*a] += 1;
            counts[*b] += 1;
        }
        let loose: Vec<usize> = (0..counts.len()).filter(|&k| caged[k] && counts[k] < 4).collect();
        if loose.is_empty() {
            let left = caged.iter().filter(|is| **is).count();
            break counts.iter().sum::<usize>() as f64 / left.max(1) as f64;
        }
        for k in loose {
            caged[k] = false;
        }
    };
    let mut positions = vec![Vec3::zeros(); particles.owned];
    for slot in 0..particles.owned {
        positions[particles.id[slot].0 as usize] = particles.position[slot];
    }
    Relaxed { positions, pressure: virial / 3.0, coordination }
}
