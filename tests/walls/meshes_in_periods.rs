//! Walls of triangles and cylinders in periodic domains act like their unbounded counterparts.

use crate::support::{Bench, MATERIAL, OnRanks, scene};
use crate::walls::faces_on_meshes;
use crate::walls::meshes::{self, Triangles};
use dem_mpi::ids::{GlobalId, ShapeId};
use dem_mpi::math::{Quat, Vec3};
use dem_mpi::particles::records::Particle;
use dem_mpi::scene::Scene;
use std::f64::consts::TAU;
use std::path::Path;

/// Length of the period [m].
const WIDTH: f64 = 0.06;

/// Bumps that repeat along x and y over a number of periods from the middle of the first, cut into squares.
fn bumps(periods: [usize; 2]) -> Triangles {
    const COUNT: usize = 12;
    // A corner and its image have identical digits.
    let place = |k: usize| WIDTH * ((k / COUNT) as f64 + (k % COUNT) as f64 / COUNT as f64 - 0.5);
    let wave = |k: usize| libm::cos(TAU * (k % COUNT) as f64 / COUNT as f64);
    let at = |i: usize, j: usize| Vec3::new(place(i), place(j), 2e-3 * wave(i) * wave(j));
    let mut triangles = Vec::new();
    for j in 0..periods[1] * COUNT {
        for i in 0..periods[0] * COUNT {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    triangles
}

/// A border at a period counts even if STL's seven digits do not represent it exactly. A plane continues through it without a seam.
#[test]
fn a_plane_from_stl_goes_on_through_a_period() {
    let folder = tempfile::tempdir().unwrap();
    for half in [0.012_f64, 0.013, 0.015, 0.0417, 0.06215, 0.3] {
        let path = folder.path().join("plane.stl");
        let corner = |x: f64, y: f64| format!("vertex {:e} {:e} 0.01\n", x as f32, y as f32);
        let [a, b, c, d] =
            [(-0.05, -half), (0.05, -half), (0.05, half), (-0.05, half)].map(|(x, y)| corner(x, y));
        let facet =
            |all: String| format!("facet normal 0 0 1\nouter loop\n{all}endloop\nendfacet\n");
        let text = format!(
            "solid plane\n{}{}endsolid plane\n",
            facet(format!("{a}{b}{c}")),
            facet(format!("{a}{c}{d}"))
        );
        std::fs::write(&path, text).unwrap();
        let domain = format!(
            "low = [-0.06, -{half:?}, 0]\nhigh = [0.06, {half:?}, 0.1]\nperiodic = [false, true, false]"
        );
        let scene = one_grain(
            "kind = \"sphere\"\nradius = 0.002",
            &format!("mesh = {:?}", path.display().to_string()),
            &domain,
        );
        let place = Vec3::new(0.001, half - 1e-4, 0.01195);
        let mut bench = Bench::of(&scene, &[Particle::at_rest(GlobalId(0), ShapeId(0), place)]);
        let m = bench.measure();
        let force = m.wall_forces[0];
        println!("{half}: {} contacts, {force}", m.wall_contacts);
        assert_eq!(m.wall_contacts, 1, "{half}");
        assert!(force.x == 0.0 && force.y == 0.0 && force.z < 0.0, "{half}: {force}");
    }
}

const SHAPES: [&str; 4] = [
    "kind = \"sphere\"\nradius = 0.006",
    "kind = \"ellipsoid\"\nsemi_axes = [0.008, 0.006, 0.005]",
    "kind = \"polyhedron\"\nedges = [0.012, 0.01, 0.008]",
    "kind = \"spherocylinder\"\nlength = 0.006\nradius = 0.005",
];

fn one_grain(shape: &str, surface: &str, domain: &str) -> Scene {
    scene(&format!(
        r#"
gravity = [20.0, 15.0, -98.1]
[domain]
{domain}
[[wall]]
name = "wall"
{surface}
{MATERIAL}
[[shape]]
name = "grain"
{shape}
"#
    ))
}

/// Steps both scenes for several periods. Returns their largest distance, the displacement, and the number of steps with contact.
fn apart(scenes: [Scene; 2], start: &Particle, steps: usize) -> (f64, Vec3, usize) {
    let mut benches = scenes.map(|scene| Bench::of(&scene, std::slice::from_ref(start)));
    let (mut worst, mut touching) = (0.0_f64, 0);
    for step in 0..steps {
        benches.iter_mut().for_each(Bench::step);
        let [one, other] = [0, 1].map(|k| benches[k].sim.particles.position[0]);
        let mut off = one - other;
        for axis in 0..2 {
            off[axis] -= WIDTH * (off[axis] / WIDTH).round();
        }
        worst = worst.max(off.norm());
        let [one, other] = [0, 1].map(|k| benches[k].sim.contacts.len());
        assert_eq!(one, other, "contacts in step {step}");
        touching += one;
    }
    (worst, benches[1].sim.particles.position[0] - start.position, touching)
}

#[test]
fn bumps_of_a_period_are_bumps_without_an_end() {
    let folder = tempfile::tempdir().unwrap();
    let [one, many] = ["one", "many"].map(|name| folder.path().join(format!("{name}.obj")));
    meshes::write_obj(&bumps([1, 1]), &one);
    meshes::write_obj(&bumps([5, 5]), &many);
    for shape in SHAPES {
        let scenes = [
            one_grain(
                shape,
                &format!("mesh = {one:?}"),
                "low = [-0.03, -0.03, -0.01]\nhigh = [0.03, 0.03, 0.1]\nperiodic = [true, true, false]",
            ),
            one_grain(
                shape,
                &format!("mesh = {many:?}"),
                "low = [-0.03, -0.03, -0.01]\nhigh = [0.27, 0.27, 0.1]",
            ),
        ];
        let start = Particle {
            quaternion: Quat::from_euler_angles(0.3, 0.4, 0.5),
            velocity: Vec3::new(0.6, 0.4, -0.3),
            ..Particle::at_rest(GlobalId(0), ShapeId(0), Vec3::new(0.0, 0.0, 0.02))
        };
        let (off, way, touching) = apart(scenes, &start, 14_000);
        println!(
            "{shape:?}: off by {off:e} m on ({:.3}, {:.3}) m, {touching} touches",
            way.x, way.y
        );
        assert!(way.x > WIDTH && way.y > 0.5 * WIDTH && touching > 5000, "{way} {touching}");
        // Every impact amplifies rounding.
        assert!(off < 1e-9 * WIDTH, "{off:e}");
    }
}

/// A drum of triangles or an exact one, through the period, with a crowd.
fn drum(folder: &Path, is_exact: bool) -> Scene {
    let file = folder.join("drum.obj");
    meshes::write_obj(&faces_on_meshes::drum(0.02, 0.01, 40), &file);
    let (surface, brick) = if is_exact {
        (
            "cylinder = { from = [0, -0.01, 0], to = [0, 0.01, 0], radius = 0.02 }".to_owned(),
            "kind = \"sphere\"\nradius = 0.0014",
        )
    } else {
        (
            format!("mesh = \"{}\"", file.display()),
            "kind = \"polyhedron\"\nedges = [0.003, 0.0024, 0.002]",
        )
    };
    scene(&format!(
        r#"
seed = 4
gravity = [1.0, 8.0, -98.1]
[domain]
low = [-0.025, -0.01, -0.025]
high = [0.025, 0.01, 0.025]
periodic = [false, true, false]
[[wall]]
name = "drum"
{surface}
rotation = {{ about = [0.0, 0.0, 0.0], axis = [0, 1, 0], rate = 20.0 }}
{MATERIAL}
[[shape]]
name = "long"
kind = "ellipsoid"
diameter = 0.0026
aspect_ratio = 2.0
[[shape]]
name = "brick"
{brick}
[[fill.lattice]]
shapes = {{ long = 1, brick = 1 }}
low = [-0.013, -0.01, -0.015]
high = [0.013, 0.01, 0.006]
spacing = 0.0045
velocity = [0.0, 0.5, -0.5]
"#
    ))
}

#[test]
fn a_crowd_in_a_drum_through_a_period_is_the_same_everywhere() {
    for is_exact in [false, true] {
        let folder = tempfile::tempdir().unwrap();
        let scene = drum(folder.path(), is_exact);
        let state = OnRanks::of(&scene).the_same_everywhere(2500, &folder.path().join("saved"));
        assert!(state.number("wall_contacts") > 20.0, "{}", state.number("wall_contacts"));
        // No particle has left.
        let count = state.bits.len();
        assert!(count > 60, "{count}");
    }
}
