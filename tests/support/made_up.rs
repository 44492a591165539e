//! Invented tables in which all numbers differ, so that any mix-up shows.

use dem_mpi::cell::Cell;
use dem_mpi::contact::{ContactRecord, ContactRecords, Geometry, StateColumn};
use dem_mpi::drive::{SavedColumn, SavedState, Values};
use dem_mpi::ids::{GlobalId, ShapeId};
use dem_mpi::math::Vec3;
use dem_mpi::measure::Departed;
use dem_mpi::output::header::{Header, ShapeRow, WallRow};
use dem_mpi::output::tables::{ContactTable, ParticleTable};
use dem_mpi::particles::columns::Quantity;
use dem_mpi::shape::{Shape, Sphere};
use dem_mpi::walls::Wall;
use std::ops::Range;

/// Tables for the writer, of one rank or of all ranks in order.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Tables {
    pub(crate) particles: ParticleTable,
    pub(crate) contacts: ContactTable,
    pub(crate) records: ContactRecords,
}

/// Numbers without a short decimal form, all different.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        f64::from_bits((self.0 >> 12) | 0x3ff0_0000_0000_0000) - 1.5
    }

    fn vector(&mut self) -> Vec3 {
        Vec3::new(self.next(), self.next(), self.next())
    }
}

pub(crate) fn header(step: u64) -> Header {
    let mut n = Numbers(step);
    Header {
        triangles: Vec::new(),
        step,
        time: n.next(),
        dt: n.next(),
        stage_begin: (step / 2, n.next()),
        stage_shift: n.next(),
        next_id: u64::MAX / 3,
        most_moving: 2.5e-3,
        departed: Departed {
            received: n.next(),
            dissipated: n.next(),
            channels: std::array::from_fn(|_| n.next()),
        },
        stop: if step.is_multiple_of(2) { "rest = 1e-6".to_owned() } else { String::new() },
        cell: Cell::new(n.vector(), n.vector().add_scalar(2.0), [true, false, true]),
        gravity: n.vector(),
        walls: ["floor", "left wall, très loin", "lid"]
            .map(|name| WallRow {
                name: name.to_owned(),
                point: n.vector(),
                normal: n.vector(),
                velocity: n.vector(),
                force: n.vector(),
                // Only one wall has a saved body.
                body: Wall::of_planes(name.to_owned(), n.vector(), &[(n.vector(), n.vector())])
                    .saved()
                    .filter(|_| name == "lid"),
            })
            .to_vec(),
        drives: drives(&mut n),
        shapes: [("ball", "sphere"), ("egg", "ellipsoid")]
            .map(|(name, kind)| ShapeRow {
                name: name.to_owned(),
                kind: kind.to_owned(),
                semi_axes: n.vector(),
                volume: n.next(),
                mass: n.next(),
                inertia: n.vector(),
                scales: [n.next(), n.next()],
                most: n.next(),
                geometry: Some(Shape::Sphere(Sphere { radius: n.next() })),
            })
            .to_vec(),
        scene: "# a scene, with µ in a comment\n[contact]\nmethod = \"auto\"\n".repeat(20),
    }
}

/// Two drives in the order of their names, in which a file is read. One has a column of each type, wide columns, and texts
/// of different lengths.
fn drives(n: &mut Numbers) -> Vec<SavedState> {
    let column =
        |name, width, unit, values| SavedColumn::new(StateColumn::new(name, width, unit), values);
    let limbs = (0..402).map(|k| k - 100).collect();
    let walls = ["floor", "left wall, très loin"].map(str::to_owned);
    let columns = vec![
        column("course", 160, "1", Values::Reals((0..320).map(|_| n.next()).collect())),
        column("force_steps", 1, "1", Values::Counts(vec![u64::MAX / 7, 1])),
        column("force_sum", 201, "2^(32 k - 1074) N", Values::Integers(limbs)),
        column("speed", 1, "m/s", Values::Reals(vec![n.next(), n.next()])),
        column("wall", 1, "", Values::Texts(walls.to_vec())),
    ];
    let fallen = vec![column("fallen", 1, "1", Values::Counts(vec![70]))];
    vec![
        SavedState { drive: "rain".to_owned(), columns: fallen },
        SavedState { drive: "walls that press".to_owned(), columns },
    ]
}

/// A table of particles for the given rows. It has all columns if `spinning`, otherwise only the required ones.
pub(crate) fn particles(rank: i32, rows: Range<u64>, spinning: bool) -> ParticleTable {
    let mut table = ParticleTable::default();
    for id in rows {
        let mut n = Numbers(id + 1000);
        table.id.push(GlobalId(id * 3 + 1));
        table.shape.push(ShapeId((id % 2) as u16));
        table.position.push(n.vector());
        table.velocity.push(n.vector());
        table.force.push(n.vector());
        table.coordination.push(id as i32 % 13);
        table.rank.push(rank);
        for quantity in Quantity::ALL {
            table.accumulated[quantity].push(n.next());
        }
        if spinning {
            table.image.push([id as i32, -1, 2]);
            table.quaternion.push([n.next(), n.next(), n.next(), n.next()]);
            table.angular_momentum.push(n.vector());
            table.angular_velocity.push(n.vector());
            table.torque.push(n.vector());
        }
    }
    table
}

/// Every fourth contact is with a wall.
fn partner(k: u64) -> GlobalId {
    if k.is_multiple_of(4) { GlobalId::wall(k as usize % 3) } else { GlobalId(k + 5) }
}

pub(crate) fn contacts(rows: Range<u64>) -> ContactTable {
    let mut table = ContactTable::default();
    for k in rows {
        let mut n = Numbers(k + 2000);
        table.a.push(GlobalId(k));
        table.b.push(partner(k));
        table.centre.push(n.vector());
        table.branch.push(n.vector());
        table.point.push(n.vector());
        table.normal.push(n.vector());
        table.overlap.push(n.next());
        table.normal_force.push(n.next());
        table.shear_force.push(n.vector());
    }
    table
}

pub(crate) fn records(rows: Range<u64>) -> ContactRecords {
    // Columns are in the order of their names, in which a file is read.
    let mut table = ContactRecords::of(&[
        StateColumn::new("bond", 1, "1"),
        StateColumn::new("spring", 3, "m"),
        StateColumn::new("turned", 2, "rad"),
    ]);
    for k in rows {
        let mut n = Numbers(k + 3000);
        let geometry = Geometry { normal: n.vector(), overlap: n.next() };
        let state: [f64; 6] = std::array::from_fn(|_| n.next());
        table.push(&ContactRecord { a: GlobalId(k), b: partner(k), geometry, state: &state });
    }
    table
}

/// Tables that rank `rank` of `size` writes. Rank 1 has no rows, and the other ranks differ in their number of rows.
pub(crate) fn of_rank(rank: u32, size: u32, spinning: bool) -> Tables {
    let before = |r: u32| (0..r).filter(|&r| r != 1).map(|r| u64::from(r) * 3 + 11).sum();
    let rows: Range<u64> = if rank < size { before(rank)..before(rank + 1) } else { 0..0 };
    Tables {
        particles: particles(rank as i32, rows.clone(), spinning),
        contacts: contacts(rows.start * 2..rows.end * 2),
        records: records(rows),
    }
}

/// Tables of all ranks in order.
pub(crate) fn of_all(size: u32, spinning: bool) -> Tables {
    let mut all = Tables::default();
    for rank in 0..size {
        let Tables { particles, contacts, records } = of_rank(rank, size, spinning);
        all.particles.append(particles);
        all.contacts.append(contacts);
        if rank == 0 {
            all.records = records;
        } else {
            all.records.append(&records);
        }
    }
    all
}

/// All 67 rows, dealt to `size` ranks out of order. Rank 1 gets none, and the rank column is 0.
pub(crate) fn dealt(rank: u32, size: u32) -> Tables {
    let takers = if size > 1 { u64::from(size) - 1 } else { 1 };
    let place = match rank {
        0 => Some(0),
        1 => None,
        rank => Some(u64::from(rank) - 1),
    };
    let mut mine = Tables { records: records(0..0), ..Tables::default() };
    // 5 and 67 have no common divisor, so each row occurs once.
    for row in (0..67).map(|k| 5 * k % 67).filter(|row| Some(row * row % takers) == place) {
        mine.particles.append(particles(0, row..row + 1, true));
        mine.contacts.append(contacts(row..row + 1));
        mine.records.append(&records(row..row + 1));
    }
    mine
}

/// Appends one table to another.
trait Append {
    fn append(&mut self, other: Self);
}

impl Append for ParticleTable {
    fn append(&mut self, other: Self) {
        self.id.extend(other.id);
        self.shape.extend(other.shape);
        self.position.extend(other.position);
        self.velocity.extend(other.velocity);
        self.force.extend(other.force);
        self.coordination.extend(other.coordination);
        self.rank.extend(other.rank);
        for quantity in Quantity::ALL {
            self.accumulated[quantity].extend(&other.accumulated[quantity]);
        }
        self.image.extend(other.image);
        self.quaternion.extend(other.quaternion);
        self.angular_momentum.extend(other.angular_momentum);
        self.angular_velocity.extend(other.angular_velocity);
        self.torque.extend(other.torque);
    }
}

impl Append for ContactTable {
    fn append(&mut self, other: Self) {
        self.a.extend(other.a);
        self.b.extend(other.b);
        self.centre.extend(other.centre);
        self.branch.extend(other.branch);
        self.point.extend(other.point);
        self.normal.extend(other.normal);
        self.overlap.extend(other.overlap);
        self.normal_force.extend(other.normal_force);
        self.shear_force.extend(other.shear_force);
    }
}
