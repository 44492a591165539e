//! Symmetries of mechanics over all shapes and laws. A scene is rotated, mirrored, seen from a moving frame, with other ids or in other units, and
//! one without losses is run backwards.

use crate::support::{Bench, scene};
use dem_mpi::ids::{GlobalId, ShapeId};
use dem_mpi::math::{Quat, Vec3};
use dem_mpi::particles::records::Particle;
use dem_mpi::random::Random;

pub(crate) const SHAPES: [&str; 9] = [
    "kind = \"sphere\"\nradius = 0.01",
    "kind = \"ellipsoid\"\nsemi_axes = [0.012, 0.009, 0.007]",
    "kind = \"superellipsoid\"\nsemi_axes = [0.011, 0.009, 0.007]\nexponents = [0.8, 1.2]",
    "kind = \"spherocylinder\"\nlength = 0.012\nradius = 0.005",
    "kind = \"polyhedron\"\nedges = [0.02, 0.016, 0.012]",
    "kind = \"rounded-polyhedron\"\nedges = [0.016, 0.012, 0.01]\nradius = 0.002",
    "kind = \"poly-superellipsoid\"\nsemi_axes_positive = [0.012, 0.009, 0.007]\nsemi_axes_negative = [0.009, 0.01, 0.009]\nexponents = [0.8, 0.9]",
    "kind = \"union\"\npieces = [{ shape = \"end\", at = [-0.004, 0, 0] }, { shape = \"end\", at = [0.004, 0, 0] }]\n\
    [[shape]]\nname = \"end\"\nkind = \"sphere\"\nradius = 0.007",
    "kind = \"union\"\npieces = [{ shape = \"bar\" }, { shape = \"bar\", turn = { axis = [0, 0, 1], angle = 90 } }]\n\
    [[shape]]\nname = \"bar\"\nkind = \"polyhedron\"\nedges = [0.024, 0.009, 0.01]",
];

/// Units larger than SI by powers of 2, for lengths, masses and times.
#[derive(Clone, Copy)]
pub(crate) struct Units {
    length: f64,
    mass: f64,
    time: f64,
}

const SI: Units = Units { length: 1.0, mass: 1.0, time: 1.0 };

/// A law with all its features, or without losses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Law {
    Linear,
    Hertz,
    Dmt,
    Jkr,
    LinearWithoutLosses,
    HertzWithoutLosses,
    /// With friction, and resistance to rolling and twisting.
    LinearWithoutDashpots,
    HertzWithoutDashpots,
}

impl Law {
    fn text(self, unit: Units) -> String {
        let pressure = unit.mass / unit.length / unit.time.powi(2);
        let per_area = unit.mass / unit.time.powi(2);
        let density = format!("density = {:?}", 2500.0 * unit.mass / unit.length.powi(3));
        let friction = "friction = 0.3\nrolling_friction = 0.1\ntwisting_friction = 0.05";
        let losses = format!("{friction}\nrestitution = 0.5");
        let turning = "rolling = \"spring\"\ntwisting = \"spring\"";
        let linear = format!(
            "{density}\nnormal_stiffness = {:?}\ntangential_stiffness = {:?}",
            1e4 * per_area,
            7e3 * per_area
        );
        let hertz =
            format!("{density}\nyoungs_modulus = {:?}\npoisson_ratio = 0.3", 2e6 * pressure);
        let sticky = format!("surface_energy = {:?}", 0.5 * per_area);
        let (law, material) = match self {
            Self::Linear => {
                (turning.to_owned(), format!("{linear}\n{losses}\ntangential_damping_ratio = 0.1"))
            }
            Self::Hertz => (format!("normal = \"hertz\"\n{turning}"), format!("{hertz}\n{losses}")),
            Self::Dmt => (
                format!("normal = \"hertz\"\nadhesion = \"dmt\"\n{turning}"),
                format!("{hertz}\n{losses}\n{sticky}"),
            ),
            Self::Jkr => (
                "normal = \"hertz\"\nadhesion = \"jkr\"".to_owned(),
                format!("{hertz}\nfriction = 0.3\nrestitution = 0.5\n{sticky}"),
            ),
            Self::LinearWithoutDashpots => (turning.to_owned(), format!("{linear}\n{friction}")),
            Self::HertzWithoutDashpots => {
                (format!("normal = \"hertz\"\n{turning}"), format!("{hertz}\n{friction}"))
            }
            Self::LinearWithoutLosses => (String::new(), linear),
            Self::HertzWithoutLosses => {
                ("normal = \"hertz\"\ntangential = \"none\"".to_owned(), hertz)
            }
        };
        format!("[law]\n{law}\n[[material]]\nname = \"m\"\n{material}")
    }
}

/// A cloud of particles that meet each other and a plane.
#[derive(Clone)]
pub(crate) struct Cloud {
    pub(crate) shape: String,
    pub(crate) law: Law,
    unit: Units,
    /// A point of the plane and its normal, or no plane.
    plane: Option<[Vec3; 2]>,
    pub(crate) gravity: Vec3,
    pub(crate) grains: Vec<Particle>,
}

const STEP: f64 = 2e-5;

impl Cloud {
    pub(crate) fn new(shape: &str, law: Law) -> Self {
        let mut random = Random::of(20_261_127, 9);
        let grain = |k: u64| {
            let side = |bit: u64| if k >> bit & 1 == 0 { -1.0 } else { 1.0 };
            let noise = Vec3::new(random.signed(), random.signed(), random.signed());
            let corner = Vec3::new(side(0), side(1), side(2));
            Particle {
                velocity: (noise * 0.2 - corner) * 0.4,
                quaternion: random.rotation(),
                ..Particle::at_rest(GlobalId(k), ShapeId(0), corner * 0.0148)
            }
        };
        Self {
            shape: shape.to_owned(),
            law,
            unit: SI,
            plane: Some([-Vec3::z() * 0.031, Vec3::new(0.0, 0.1, 1.0)]),
            gravity: Vec3::new(30.0, -20.0, -200.0),
            grains: (0..8).map(grain).collect(),
        }
    }

    pub(crate) fn text(&self) -> String {
        let Self { shape, law, unit, plane, gravity, .. } = self;
        let numbers = |v: Vec3| format!("[{:?}, {:?}, {:?}]", v.x, v.y, v.z);
        let all = |x: f64| numbers(Vec3::repeat(x * unit.length));
        let wall = plane.map_or_else(String::new, |[point, normal]| {
            format!(
                "[[wall]]\nname = \"plane\"\npoint = {}\nnormal = {}\n",
                numbers(point),
                numbers(normal)
            )
        });
        format!(
            "gravity = {}\n[domain]\nlow = {}\nhigh = {}\n{wall}{}\n[[shape]]\nname = \"grain\"\n{shape}\n[time]\nstep = {:?}\n",
            numbers(*gravity),
            all(-1.0),
            all(1.0),
            law.text(*unit),
            STEP * unit.time
        )
    }

    /// All particles after a number of steps in the order of their ids, and the summed counts of contacts between particles and on the plane.
    fn after(&self, steps: u32) -> (Vec<Particle>, [u64; 2]) {
        let scene = scene(&self.text());
        let mut bench = Bench::of(&scene, &self.grains);
        let mut met = [0; 2];
        for _ in 0..steps {
            bench.step();
            let measures = bench.measure();
            met[0] += measures.contacts;
            met[1] += measures.wall_contacts;
        }
        let particles = &bench.sim.particles;
        let mut grains: Vec<Particle> =
            (0..particles.owned).map(|slot| particles.owned_particle(slot)).collect();
        grains.sort_by_key(|grain| grain.id);
        (grains, met)
    }
}

/// Combinations of shapes and laws.
pub(crate) fn cases() -> Vec<Cloud> {
    let mut cases = Vec::new();
    for (k, shape) in SHAPES.into_iter().enumerate() {
        cases.push(Cloud::new(shape, Law::Linear));
        cases.push(Cloud::new(shape, Law::Hertz));
        if k == 0 {
            cases.extend([Law::Dmt, Law::Jkr].map(|law| Cloud::new(shape, law)));
        }
    }
    cases
}

/// Largest deviation between particles, over their size, speed and spin.
fn off(found: &[Particle], expected: &[Particle]) -> f64 {
    let of_one = |(found, expected): (&Particle, &Particle)| {
        assert_eq!(found.id, expected.id);
        let place = (found.position - expected.position).norm() / 0.01;
        let speed = (found.velocity - expected.velocity).norm();
        let spin = (found.angular_velocity - expected.angular_velocity).norm() / 100.0;
        place.max(speed).max(spin)
    };
    assert_eq!(found.len(), expected.len());
    found.iter().zip(expected).map(of_one).fold(0.0, f64::max)
}

const STEPS: u32 = 1200;
/// Tolerance: collisions amplify rounding.
const ROUNDED: f64 = 1e-6;

/// Checks in each case that a changed, run and reverted scene gives the particles of the unchanged run.
fn holds(
    name: &str,
    change: impl Fn(&Cloud) -> Cloud,
    back: impl Fn(&[Particle]) -> Vec<Particle>,
) {
    for cloud in cases() {
        let (expected, met) = cloud.after(STEPS);
        assert!(met.iter().all(|&met| met > 100), "{:?} {}: {met:?}", cloud.law, cloud.shape);
        let (found, _) = change(&cloud).after(STEPS);
        let off = off(&back(&found), &expected);
        println!("{name} {:?} {}: {off:.1e}", cloud.law, cloud.shape.replace('\n', " "));
        assert!(off < ROUNDED, "{name} {:?} {}: {off:e}", cloud.law, cloud.shape);
    }
}

fn mapped(grains: &[Particle], map: impl Fn(Particle) -> Particle) -> Vec<Particle> {
    grains.iter().cloned().map(map).collect()
}

#[test]
fn a_turned_scene_is_the_same_turned() {
    let turn = Quat::from_scaled_axis(Vec3::new(0.4, -1.1, 2.0));
    let turned = |grain: Particle, turn: &Quat| Particle {
        position: turn * grain.position,
        velocity: turn * grain.velocity,
        quaternion: turn * grain.quaternion,
        angular_velocity: turn * grain.angular_velocity,
        ..grain
    };
    let change = |cloud: &Cloud| Cloud {
        plane: cloud.plane.map(|plane| plane.map(|vector| turn * vector)),
        gravity: turn * cloud.gravity,
        grains: mapped(&cloud.grains, |grain| turned(grain, &turn)),
        ..cloud.clone()
    };
    holds("turned", change, |found| mapped(found, |grain| turned(grain, &turn.inverse())));
}

/// All but the last shape are their own mirror images.
#[test]
fn a_mirrored_scene_is_the_mirror_image() {
    let mirror = |v: Vec3| Vec3::new(-v.x, v.y, v.z);
    let mirrored = |grain: Particle| {
        let turn = grain.quaternion.into_inner();
        Particle {
            position: mirror(grain.position),
            velocity: mirror(grain.velocity),
            quaternion: Quat::from_quaternion([turn.i, -turn.j, -turn.k, turn.w].into()),
            angular_velocity: -mirror(grain.angular_velocity),
            ..grain
        }
    };
    let change = |cloud: &Cloud| {
        if cloud.shape == SHAPES[6] {
            return cloud.clone();
        }
        Cloud {
            plane: cloud.plane.map(|plane| plane.map(mirror)),
            gravity: mirror(cloud.gravity),
            grains: mapped(&cloud.grains, mirrored),
            ..cloud.clone()
        }
    };
    for cloud in cases() {
        let (expected, _) = cloud.after(STEPS);
        let changed = change(&cloud);
        let (found, _) = changed.after(STEPS);
        let found = if cloud.shape == SHAPES[6] { found } else { mapped(&found, mirrored) };
        let off = off(&found, &expected);
        println!("mirrored {:?} {}: {off:.1e}", cloud.law, cloud.shape.replace('\n', " "));
        assert!(off < ROUNDED, "{:?} {}: {off:e}", cloud.law, cloud.shape);
    }
}

#[test]
fn a_frame_that_moves_sees_the_same() {
    let drift = Vec3::new(0.3, -0.7, 0.5);
    let without_plane =
        |cloud: &Cloud| Cloud { plane: None, gravity: Vec3::zeros(), ..cloud.clone() };
    for cloud in cases() {
        let cloud = without_plane(&cloud);
        let (expected, _) = cloud.after(STEPS);
        let moving = Cloud {
            grains: mapped(&cloud.grains, |grain| Particle {
                velocity: grain.velocity + drift,
                ..grain
            }),
            ..cloud.clone()
        };
        let way = drift * (STEP * f64::from(STEPS));
        let found = mapped(&moving.after(STEPS).0, |grain| Particle {
            position: grain.position - way,
            velocity: grain.velocity - drift,
            ..grain
        });
        let off = off(&found, &expected);
        println!("moving {:?} {}: {off:.1e}", cloud.law, cloud.shape.replace('\n', " "));
        assert!(off < ROUNDED, "{:?} {}: {off:e}", cloud.law, cloud.shape);
    }
}

#[test]
fn ids_are_names() {
    let renamed = |grains: &[Particle]| {
        let mut grains = mapped(grains, |grain| Particle { id: GlobalId(7 - grain.id.0), ..grain });
        grains.sort_by_key(|grain| grain.id);
        grains
    };
    let change = |cloud: &Cloud| Cloud { grains: renamed(&cloud.grains), ..cloud.clone() };
    holds("renamed", change, renamed);
}

/// Units that are larger by powers of 2 change no digit.
#[test]
fn units_are_names() {
    let unit = Units { length: 1.0 / 4096.0, mass: 4096.0, time: 64.0 };
    let velocity = unit.length / unit.time;
    // Unions have their lengths in tables and are left out.
    for cloud in cases().into_iter().filter(|cloud| !cloud.shape.contains("union")) {
        let mut shape = cloud.shape.clone();
        for line in cloud
            .shape
            .lines()
            .filter(|line| !line.starts_with("kind") && !line.starts_with("exponents"))
        {
            let (key, value) = line.split_once(" = ").unwrap();
            let times =
                |number: &str| format!("{:?}", number.trim().parse::<f64>().unwrap() * unit.length);
            let value = match value.strip_prefix('[') {
                None => times(value),
                Some(list) => {
                    let list: Vec<String> =
                        list.trim_end_matches(']').split(',').map(times).collect();
                    format!("[{}]", list.join(", "))
                }
            };
            shape = shape.replace(line, &format!("{key} = {value}"));
        }
        let other = Cloud {
            shape,
            unit,
            plane: cloud.plane.map(|[point, normal]| [point * unit.length, normal]),
            gravity: cloud.gravity * (velocity / unit.time),
            grains: mapped(&cloud.grains, |grain| Particle {
                position: grain.position * unit.length,
                velocity: grain.velocity * velocity,
                ..grain
            }),
            ..cloud.clone()
        };
        let expected = cloud.after(STEPS).0;
        for (found, expected) in other.after(STEPS).0.iter().zip(&expected) {
            let case = || format!("{:?} {}: {found:?} {expected:?}", cloud.law, cloud.shape);
            assert_eq!(found.position, expected.position * unit.length, "{}", case());
            assert_eq!(found.velocity, expected.velocity * velocity, "{}", case());
            assert_eq!(found.quaternion, expected.quaternion, "{}", case());
        }
    }
}

/// Without losses all particles return along their paths.
#[test]
fn what_has_no_losses_runs_backwards() {
    for (k, shape) in SHAPES.into_iter().enumerate() {
        for law in [Law::LinearWithoutLosses, Law::HertzWithoutLosses] {
            if k >= 3 && law == Law::HertzWithoutLosses {
                continue;
            }
            let cloud = Cloud::new(shape, law);
            let (there, met) = cloud.after(STEPS);
            assert!(met.iter().all(|&met| met > 100), "{law:?} {shape}: {met:?}");
            let back = Cloud {
                grains: mapped(&there, |grain| Particle {
                    velocity: -grain.velocity,
                    angular_velocity: -grain.angular_velocity,
                    angular_momentum: -grain.angular_momentum,
                    ..grain
                }),
                ..cloud.clone()
            };
            let found = mapped(&back.after(STEPS).0, |grain| Particle {
                velocity: -grain.velocity,
                angular_velocity: -grain.angular_velocity,
                ..grain
            });
            let off = off(&found, &cloud.grains);
            println!("reversed {law:?} {}: {off:.1e}", shape.replace('\n', " "));
            assert!(off < 1e-6, "{law:?} {shape}: {off:e}");
        }
    }
}
