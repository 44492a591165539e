//! Particles slide, roll and come to rest on a plane of triangles, each over more than a thousand edges, without any effect of the edges.

use crate::support::{Bench, State, begun, scene};
use crate::walls::meshes::{Triangles, write_obj};
use dem_mpi::comm::{Comm, threads};
use dem_mpi::ids::{GlobalId, ShapeId};
use dem_mpi::math::{Quat, Vec3, rotation_about};
use dem_mpi::particles::Particles;
use dem_mpi::particles::records::Particle;
use dem_mpi::random::Random;
use dem_mpi::scene::Scene;
use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;
use std::fmt::Write;
use std::path::Path;

/// Side of the squares of a sheet [m].
const SQUARE: f64 = 1e-3;
/// Ends of the sheet along x, and its extent to both sides [m].
const ENDS: [f64; 2] = [-0.58, 0.6];
const HALF_WIDTH: f64 = 0.02;
/// Initial speed of the particles [m/s].
const SPEED: f64 = 2.0;
const GRAVITY: f64 = 9.81;
/// Number of steps until all have come to rest.
const STEPS: u64 = 18_000;
/// Number of steps between two comparisons.
const LOOK: u64 = 50;
const NAMES: [&str; 4] = ["box", "rod", "ellipsoid", "ball"];

type Triangle = [[f64; 2]; 3];

/// A sheet in two coordinates, along the path and across.
struct Sheet {
    triangles: Vec<Triangle>,
    /// Indices of the triangles that overlap each square of a grid.
    in_square: BTreeMap<[i64; 2], Vec<usize>>,
}

fn square_of(place: f64) -> i64 {
    (place / SQUARE).floor() as i64
}

impl Sheet {
    /// Squares with random corners, at an angle to the path, cut along either diagonal.
    fn new() -> Self {
        let mut random = Random::of(11, 0);
        let (sine, cosine) = libm::sincos(0.5);
        let reach = (ENDS[1] + HALF_WIDTH) / SQUARE;
        let count = 2 * reach as usize + 1;
        let corners: Vec<[f64; 2]> = (0..count * count)
            .map(|k| {
                let mut at = |k: usize| (k as f64 - reach + 0.24 * random.signed()) * SQUARE;
                let (p, q) = (at(k % count), at(k / count));
                [cosine * p - sine * q, sine * p + cosine * q]
            })
            .collect();
        let is_within =
            |[u, v]: [f64; 2]| (ENDS[0]..=ENDS[1]).contains(&u) && v.abs() <= HALF_WIDTH;
        let mut triangles = Vec::new();
        for k in 0..count * (count - 1) {
            let rises = random.unit() < 0.5;
            let [a, b, c, d] = [k, k + 1, k + 1 + count, k + count]
                .map(|k| corners.get(k).copied().unwrap_or([f64::NAN; 2]));
            if k % count + 1 < count && [a, b, c, d].into_iter().all(is_within) {
                triangles.extend(if rises {
                    [[a, b, c], [a, c, d]]
                } else {
                    [[a, b, d], [b, c, d]]
                });
            }
        }
        let mut in_square: BTreeMap<[i64; 2], Vec<usize>> = BTreeMap::new();
        for (number, triangle) in triangles.iter().enumerate() {
            let squares = |axis: usize| {
                let of = triangle.map(|corner| square_of(corner[axis]));
                of.into_iter().min().unwrap()..=of.into_iter().max().unwrap()
            };
            for i in squares(0) {
                for j in squares(1) {
                    in_square.entry([i, j]).or_default().push(number);
                }
            }
        }
        Self { triangles, in_square }
    }

    /// Index of the triangle that contains a point.
    fn find(&self, point: [f64; 2]) -> Option<usize> {
        let is_in = |triangle: &Triangle| {
            (0..3).all(|k| {
                let ([x, y], [u, v]) = (triangle[k], triangle[(k + 1) % 3]);
                (u - x) * (point[1] - y) - (v - y) * (point[0] - x) >= 0.0
            })
        };
        let near = self.in_square.get(&point.map(square_of))?;
        near.iter().copied().find(|&number| is_in(&self.triangles[number]))
    }
}

/// A plane through the x axis, along which the particles move, so that heights over it have uniform rounding along the path.
#[derive(Clone, Copy)]
struct Floor {
    across: Vec3,
    normal: Vec3,
}

impl Floor {
    fn level() -> Self {
        Self { across: Vec3::y(), normal: Vec3::z() }
    }

    fn tilted() -> Self {
        Self { across: Vec3::new(0.0, 0.8, 0.6), normal: Vec3::new(0.0, -0.6, 0.8) }
    }

    fn cut(&self, sheet: &Sheet) -> Triangles {
        let place = |[u, v]: [f64; 2]| Vec3::x() * u + self.across * v;
        sheet.triangles.iter().map(|triangle| triangle.map(place)).collect()
    }

    /// Particles just above the floor, with those of longer paths ahead.
    fn grains(&self) -> Vec<Particle> {
        let tilt = rotation_about(&Vec3::x(), libm::atan2(-self.normal.y, self.normal.z));
        let all = [
            (-0.52, 1e-3, rotation_about(&Vec3::z(), 0.5)),
            (-0.46, 8e-3, rotation_about(&Vec3::z(), FRAC_PI_2)),
            (-0.40, 9.1e-3, rotation_about(&Vec3::y(), 0.3)),
            (-0.34, 1e-2, Quat::identity()),
        ];
        let grain = |(k, (along, height, turn)): (u16, (f64, f64, Quat))| {
            let place = Vec3::x() * along + self.normal * (height + 1e-5);
            Particle {
                velocity: Vec3::x() * SPEED,
                quaternion: tilt * turn,
                ..Particle::at_rest(GlobalId(u64::from(k)), ShapeId(k), place)
            }
        };
        (0..).zip(all).map(grain).collect()
    }

    /// Scene of the particles on a wall. Their overlap is about 1 % of their size, to which forces of faces are exact.
    fn scene(&self, wall: &str, folder: &Path) -> Scene {
        let rows = folder.join("grains.csv");
        let mut text = "shape,x,y,z,qw,qx,qy,qz,vx,vy,vz\n".to_owned();
        for (grain, name) in self.grains().iter().zip(NAMES) {
            let (p, q, v) = (&grain.position, &grain.quaternion, &grain.velocity);
            let numbers = [p.x, p.y, p.z, q.w, q.i, q.j, q.k, v.x, v.y, v.z];
            writeln!(text, "{name},{}", numbers.map(|x| format!("{x:?}")).join(",")).unwrap();
        }
        std::fs::write(&rows, text).unwrap();
        let rows = rows.display();
        let [gx, gy, gz]: [f64; 3] = (-self.normal * GRAVITY).into();
        let constants = "normal_stiffness = 1e3\nfriction = 0.35\nrestitution = 0.2\n\
                         tangential_damping_ratio = 0.3\nrolling_friction = 0.18";
        scene(&format!(
            r#"
gravity = [{gx:?}, {gy:?}, {gz:?}]
[domain]
low = [-0.6, -0.1, -0.1]
high = [0.65, 0.1, 0.1]
[[wall]]
name = "floor"
material = "stone"
{wall}
[[material]]
name = "stone"
density = 2500
{constants}
[[material]]
name = "heavy"
density = 40000
{constants}
[[shape]]
name = "box"
material = "heavy"
kind = "polyhedron"
edges = [4e-3, 3e-3, 2e-3]
[[shape]]
name = "rod"
material = "stone"
kind = "spherocylinder"
length = 6e-3
radius = 8e-3
[[shape]]
name = "ellipsoid"
material = "stone"
kind = "ellipsoid"
semi_axes = [9.1e-3, 1.05e-2, 8.9e-3]
[[shape]]
name = "ball"
material = "stone"
kind = "sphere"
radius = 1e-2
[[fill.file]]
path = "{rows}"
[law]
rolling = "spring"
[time]
step = 1e-4
# The limit is that of grains among twelve others; here each has one contact.
allow_unstable = true
[neighbours]
# Cut once: grains come from rank to rank.
imbalance = 100
"#
        ))
    }
}

/// Names of the compared quantities.
const OF: [&str; 6] = ["force", "moment", "place", "velocity", "orientation", "spin"];

/// Deviation of these quantities between two simulations, relative to scales. Force: the plane's force or the weight, whichever is larger;
/// moment: that times the radius. Place: half a metre; velocity: the initial speed; orientation: one; spin: that of rolling at the initial
/// speed.
fn off(one: &Bench, other: &Bench, id: u64) -> [f64; 6] {
    let (p, q) = (&one.sim.particles, &other.sim.particles);
    let (k, l) = (one.slot(id), other.slot(id));
    let force = q.force[l].vector.norm().max(q.mass(l) * GRAVITY);
    let radius = q.radius(l);
    let torque = |p: &Particles, k: usize| p.spin.as_ref().unwrap().torque[k].vector;
    let turn = |p: &Particles, k: usize| p.orientation.as_ref().unwrap().quaternion[k].coords;
    [
        (p.force[k].vector - q.force[l].vector).norm() / force,
        (torque(p, k) - torque(q, l)).norm() / (force * radius),
        (p.position[k] - q.position[l]).norm() / 0.5,
        (p.velocity[k] - q.velocity[l]).norm() / SPEED,
        (turn(p, k) - turn(q, l)).norm(),
        (p.angular_velocity(k) - q.angular_velocity(l)).norm() * radius / SPEED,
    ]
}

/// Copies the state of all particles from another simulation. The contact memory stays.
fn take_over(bench: &mut Bench, other: &Bench) {
    for id in 0..NAMES.len() as u64 {
        let (slot, from) = (bench.slot(id), other.slot(id));
        let (to, of) = (&mut bench.sim.particles, &other.sim.particles);
        to.position[slot] = of.position[from];
        to.velocity[slot] = of.velocity[from];
        to.force[slot] = of.force[from];
        if let (Some(to), Some(of)) = (&mut to.spin, &of.spin) {
            to.angular_momentum[slot] = of.angular_momentum[from];
            to.angular_velocity[slot] = of.angular_velocity[from];
            to.torque[slot] = of.torque[from];
        }
        if let (Some(to), Some(orientation)) = (&mut to.orientation, &of.orientation) {
            let shape = &of.library.shapes[of.shape[from].index()];
            to.set(slot, orientation.quaternion[from], shape, 1.0);
        }
    }
}

/// Counts of the edges that each particle has crossed.
struct Edges<'a> {
    sheet: &'a Sheet,
    floor: Floor,
    under: [Option<usize>; NAMES.len()],
    crossed: [usize; NAMES.len()],
}

impl Edges<'_> {
    /// Follows all particles in steps that are short compared with a triangle; each new triangle counts as one edge.
    fn follow(&mut self, bench: &Bench) {
        for id in 0..NAMES.len() {
            let (particles, slot) = (&bench.sim.particles, bench.slot(id as u64));
            let step = particles.velocity[slot] * bench.sim.dt;
            for part in [0.75, 0.5, 0.25, 0.0] {
                let centre = particles.position[slot] - step * part;
                // Between two triangles, rounding can place it in none.
                let foot = [centre.x, centre.dot(&self.floor.across)];
                let Some(now) = self.sheet.find(foot) else { continue };
                let before = self.under[id].replace(now);
                self.crossed[id] += usize::from(before.is_some_and(|before| before != now));
            }
        }
    }
}

fn raise(worst: &mut [f64], by: &[f64]) {
    worst.iter_mut().zip(by).for_each(|(worst, by)| *worst = worst.max(*by));
}

/// Three runs side by side: on the plane, on the triangles, and on the triangles with the state copied from the plane at each step. The last has
/// its own contact memory and gives the forces at equal poses, however the differences would grow.
fn nothing_shows_on(floor: Floor, of_box: f64) {
    let folder = tempfile::tempdir().unwrap();
    let (file, sheet) = (folder.path().join("sheet.obj"), Sheet::new());
    write_obj(&floor.cut(&sheet), &file);
    let [x, y, z]: [f64; 3] = floor.normal.into();
    let [mesh, plane] = [
        format!("mesh = \"{}\"", file.display()),
        format!("point = [0, 0, 0]\nnormal = [{x:?}, {y:?}, {z:?}]"),
    ]
    .map(|wall| floor.scene(&wall, folder.path()));
    let grains = floor.grains();
    let [mut plane, mut held, mut free] =
        [&plane, &mesh, &mesh].map(|scene| Bench::of(scene, &grains));
    let mut edges = Edges { sheet: &sheet, floor, under: [None; 4], crossed: [0; 4] };
    let (mut at_equal_poses, mut of_itself) = ([[0.0_f64; 6]; 4], [[0.0_f64; 6]; 4]);
    let (mut on_wall, mut touching) = (0.0_f64, 0);
    let weight: f64 = (0..4).map(|slot| plane.sim.particles.mass(slot) * GRAVITY).sum();
    for step in 1..=STEPS {
        take_over(&mut held, &plane);
        for bench in [&mut plane, &mut held, &mut free] {
            bench.step();
        }
        assert_eq!(held.sim.contacts.len(), plane.sim.contacts.len(), "contacts at step {step}");
        touching += plane.sim.contacts.len();
        edges.follow(&plane);
        for (worst, id) in at_equal_poses.iter_mut().zip(0..) {
            // All other quantities are copied.
            raise(&mut worst[..2], &off(&held, &plane, id)[..2]);
        }
        if step % LOOK == 0 {
            for (worst, id) in of_itself.iter_mut().zip(0..) {
                raise(worst, &off(&free, &plane, id));
            }
            let [found, expected] =
                [&mut held, &mut plane].map(|bench| bench.measure().wall_forces[0]);
            on_wall = on_wall.max((found - expected).norm() / expected.norm().max(weight));
        }
    }
    println!("force on the wall off by {on_wall:.1e}");
    for (id, name) in NAMES.iter().enumerate() {
        let [force, moment, ..] = at_equal_poses[id];
        let each: Vec<String> =
            OF.iter().zip(of_itself[id]).map(|(of, off)| format!("{of} {off:.1e}")).collect();
        println!(
            "{name}: {} edges; at equal poses force off by {force:.1e}, moment by {moment:.1e}; of itself {}",
            edges.crossed[id],
            each.join(", ")
        );
    }
    for (id, name) in NAMES.iter().enumerate() {
        let (p, slot) = (&plane.sim.particles, plane.slot(id as u64));
        let (speed, spin) = (p.velocity[slot].norm(), p.angular_velocity(slot).norm());
        assert!(edges.crossed[id] >= 1000, "{name}: {} edges", edges.crossed[id]);
        assert!(
            speed + spin * p.radius(slot) < 1e-4 * SPEED,
            "{name} does not rest: {speed:e} m/s, {spin:e} rad/s"
        );
        let worst = at_equal_poses[id][0].max(at_equal_poses[id][1]);
        let most = if *name == "box" { of_box } else { 1e-12 };
        assert!(worst < most, "{name} at equal poses: {worst:e}");
        for (of, off) in OF.iter().zip(of_itself[id]) {
            // Errors in the forces of the box accumulate along its path.
            let most = match (of.contains("force"), *name) {
                (false, "box") => 1e-10,
                // The rod rocks.
                (_, "rod") => 1e-11,
                (true, _) => most,
                (false, _) => 1e-12,
            };
            assert!(off < most, "{of} of the {name}, by itself: {off:e}");
        }
    }
    assert!(on_wall < 1e-12, "force on the wall: {on_wall:e}");
    assert!(touching as u64 > 3 * STEPS, "{touching} touches in {STEPS} steps");
}

#[test]
fn a_thousand_edges_of_a_level_plane_are_not_felt() {
    nothing_shows_on(Floor::level(), 1e-12);
}

#[test]
fn a_thousand_edges_of_a_tilted_plane_are_not_felt() {
    // Corners 0.6 m from the origin are rounded to 1e-16 m, and the overlap of a box is about 3e-5 m: two such roundings.
    nothing_shows_on(Floor::tilted(), 8e-12);
}

/// The sheet crosses all cuts, and the particles roll from rank to rank on it.
#[test]
fn over_a_thousand_edges_bits_are_the_same_on_any_number_of_ranks() {
    let folder = tempfile::tempdir().unwrap();
    let (file, floor) = (folder.path().join("sheet.obj"), Floor::tilted());
    write_obj(&floor.cut(&Sheet::new()), &file);
    let scene = floor.scene(&format!("mesh = \"{}\"", file.display()), folder.path());
    let run = |ranks: u32| {
        let parts = threads::run(ranks, |comm| {
            let mut sim = begun(&scene, comm);
            let mut owned = Vec::new();
            while sim.step < STEPS {
                sim.step(comm).unwrap();
                if sim.step.is_multiple_of(LOOK) {
                    let ids = &sim.particles.id[..sim.particles.owned];
                    owned.extend(ids.iter().map(|id| (id.0, sim.step, comm.rank().0)));
                }
            }
            (owned, State::of(&sim, comm))
        });
        let (owned, states): (Vec<_>, Vec<_>) = parts.into_iter().unzip();
        let mut owned = owned.concat();
        owned.sort_unstable();
        let passed = |two: &&[(u64, u64, u32)]| two[0].0 == two[1].0 && two[0].2 != two[1].2;
        (State::joined(states), owned.windows(2).filter(passed).count())
    };
    let (alone, _) = run(1);
    for ranks in [2, 3, 8] {
        let (state, passed) = run(ranks);
        assert!(state == alone, "{ranks} ranks");
        assert!(passed >= 3, "only {passed} times a grain came to another of {ranks} ranks");
    }
}
