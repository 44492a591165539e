//! Packings in memory, as snapshots; the tests of benchmarks/lai2021 use them, too.

use super::random::Draw;
use dem_mpi::cell::Cell;
use dem_mpi::comm::alone::Alone;
use dem_mpi::contact::ContactRecords;
use dem_mpi::ids::{GlobalId, ShapeId};
use dem_mpi::math::Vec3;
use dem_mpi::measure::Departed;
use dem_mpi::output::header::{Header, ShapeRow, WallRow};
use dem_mpi::output::snapshot;
use dem_mpi::output::tables::{ContactTable, ParticleTable};
use dem_mpi::particles::columns::{Accumulated, Quantity};
use dem_mpi::post::{Analysis, ParticlePass, PostError, Report, Settings};
use dem_mpi::random::Random;
use std::f64::consts::PI;
use std::path::Path;

/// A snapshot in memory.
#[derive(Clone)]
pub(crate) struct Snapshot {
    pub(crate) header: Header,
    pub(crate) particles: ParticleTable,
    pub(crate) contacts: ContactTable,
}

impl Snapshot {
    pub(crate) fn analyse(&self, settings: Settings) -> Result<Analysis, PostError> {
        let mut particles = ParticlePass::new(&self.header, settings)?;
        particles.add(&self.particles)?;
        let mut contacts = particles.finish();
        contacts.add_contacts(&self.contacts)?;
        let mut forces = contacts.finish();
        forces.add_contacts(&self.contacts)?;
        Ok(forces.finish("in memory"))
    }

    pub(crate) fn report(&self) -> Report {
        self.analyse(Settings::default()).expect("a sound snapshot").report
    }
}

pub(crate) fn header(
    low: Vec3,
    high: Vec3,
    periodic: bool,
    semi_axes: Vec3,
    particles: usize,
) -> Header {
    Header {
        triangles: Vec::new(),
        step: 1000,
        time: 0.01,
        dt: 1e-5,
        stage_begin: (0, 0.0),
        stage_shift: 0.0,
        next_id: particles as u64,
        departed: Departed::default(),
        most_moving: 0.0,
        stop: String::new(),
        cell: Cell::new(low, high, [periodic; 3]),
        gravity: Vec3::zeros(),
        walls: Vec::new(),
        drives: Vec::new(),
        shapes: vec![ShapeRow {
            name: "grain".into(),
            kind: "ellipsoid".into(),
            semi_axes,
            volume: 4.0 / 3.0 * PI * semi_axes.product(),
            mass: 1.0,
            inertia: Vec3::repeat(1.0),
            scales: [1.0; 2],
            most: f64::INFINITY,
            geometry: None,
        }],
        scene: String::new(),
    }
}

pub(crate) fn particles_at(position: Vec<Vec3>) -> ParticleTable {
    let n = position.len();
    let mut accumulated = Accumulated::default();
    for quantity in Quantity::ALL {
        accumulated[quantity] = vec![0.0; n];
    }
    ParticleTable {
        id: (0..n as u64).map(GlobalId).collect(),
        shape: vec![ShapeId(0); n],
        position,
        velocity: vec![Vec3::zeros(); n],
        force: vec![Vec3::zeros(); n],
        coordination: vec![0; n],
        rank: vec![0; n],
        accumulated,
        ..ParticleTable::default()
    }
}

/// Adds a contact; `branch` and `point` (from the centre of A) as in [`ContactTable`].
pub(crate) fn push(
    table: &mut ContactTable,
    (a, b): (u64, GlobalId),
    centre: Vec3,
    branch: Vec3,
    point: Vec3,
) {
    table.a.push(GlobalId(a));
    table.b.push(b);
    table.centre.push(centre);
    table.branch.push(branch);
    table.point.push(centre + point);
}

pub(crate) fn push_force(
    table: &mut ContactTable,
    normal: Vec3,
    overlap: f64,
    force: f64,
    shear: Vec3,
) {
    table.normal.push(normal);
    table.overlap.push(overlap);
    table.normal_force.push(force);
    table.shear_force.push(shear);
}

/// `side`³ ellipsoids at random orientations near a lattice in a box with a floor and four sides.
/// Neighbours count as touching, with forces that increase downwards.
pub(crate) fn ellipsoids(side: u32, seed: u64) -> Snapshot {
    let mut dice = Random::of(seed, 0);
    let spacing = 2.6e-3;
    let count = side.pow(3);
    let length = f64::from(side) * spacing;
    let mut position = Vec::new();
    for i in 0..count {
        let cell =
            Vec3::new(f64::from(i % side), f64::from(i / side % side), f64::from(i / side / side));
        let jitter = Vec3::from_fn(|_, _| 0.3 * (dice.unit() - 0.5));
        position.push((cell + jitter).add_scalar(0.5) * spacing);
    }
    let semi_axes = Vec3::new(2.3811e-3, 1.19055e-3, 1.19055e-3);
    let high = Vec3::new(length, length, 2.0 * length);
    let mut header = header(Vec3::zeros(), high, false, semi_axes, position.len());
    for normal in [Vec3::z(), Vec3::x(), -Vec3::x(), Vec3::y(), -Vec3::y()] {
        let point = if normal.sum() > 0.0 { Vec3::zeros() } else { Vec3::repeat(length) };
        header.walls.push(plane_row(format!("{normal:?}"), point, normal));
    }
    let mut particles = particles_at(position.clone());
    particles.quaternion = (0..count)
        .map(|_| {
            // Long axis (local x) near the horizontal.
            let (yaw, pitch) = (PI * dice.unit(), 0.5 * (dice.unit() - 0.5));
            let turn = nalgebra::UnitQuaternion::from_euler_angles(0.0, pitch, yaw);
            [turn.w, turn.i, turn.j, turn.k]
        })
        .collect();
    particles.force = (0..count).map(|_| dice.direction() * 1e-3).collect();
    let mut contacts = ContactTable::default();
    let mut touch = |a: usize, b: GlobalId, branch: Vec3, arm: Vec3, dice: &mut Random| {
        let normal = (branch / branch.norm() + dice.direction() * 0.3).normalize();
        let depth = 1.2 - position[a].z / length;
        let force = -0.08 * depth * (1.0 - dice.unit()).ln() * (1.0 + 0.6 * normal.z * normal.z);
        let side = dice.direction();
        let along = (side - normal * side.dot(&normal)).normalize();
        let shear = along * (force * 0.5 * (1.25 * dice.unit()).min(1.0));
        push(&mut contacts, (a as u64, b), position[a], branch, arm);
        push_force(&mut contacts, normal, 1e-6, force, shear);
        particles.coordination[a] += 1;
        if b.wall_index().is_none() {
            particles.coordination[b.0 as usize] += 1;
        }
    };
    for a in 0..position.len() {
        for b in a + 1..position.len() {
            let branch = position[b] - position[a];
            if branch.norm() < 1.25 * spacing && dice.unit() < 0.95 {
                let arm = branch * (0.4 + 0.2 * dice.unit());
                touch(a, GlobalId(b as u64), branch, arm, &mut dice);
            }
        }
        for (k, wall) in header.walls.iter().enumerate() {
            let distance = (position[a] - wall.point).dot(&wall.normal);
            if distance < 0.6 * spacing {
                let arm = -wall.normal * distance;
                touch(a, GlobalId::wall(k), arm, arm, &mut dice);
            }
        }
    }
    Snapshot { header, particles, contacts }
}

/// 27 particles between a floor, four sides, and a lid at this height [m].
pub(crate) fn closed(height: f64) -> Snapshot {
    with_lid(ellipsoids(3, 9), height)
}

/// 125 particles between walls on all sides, with the lid at this height [m], at this step.
pub(crate) fn boxed(height: f64, step: u64) -> Snapshot {
    let mut snapshot = with_lid(ellipsoids(5, 8), height);
    let header = &mut snapshot.header;
    (header.step, header.time) = (step, step as f64 * header.dt);
    snapshot
}

/// Row of a plane that is not loaded, does not move and has no saved body.
pub(crate) fn plane_row(name: impl Into<String>, point: Vec3, normal: Vec3) -> WallRow {
    let (velocity, force) = (Vec3::zeros(), Vec3::zeros());
    WallRow { name: name.into(), point, normal, velocity, force, body: None }
}

fn with_lid(mut snapshot: Snapshot, height: f64) -> Snapshot {
    snapshot.header.walls.push(plane_row("+z", Vec3::z() * height, -Vec3::z()));
    snapshot
}

/// Creates a folder and writes a snapshot into it.
pub(crate) fn store(folder: &Path, snapshot: &Snapshot) {
    let Snapshot { header, particles, contacts } = snapshot;
    snapshot::write(
        folder,
        header,
        particles,
        contacts,
        &ContactRecords::default(),
        &mut Alone::default(),
    )
    .expect("a snapshot");
}
