//! Sums of what happens at walls: the work of moving walls on the particles, and the losses and impulses at walls that
//! wear, by triangle if they have any.
//!
//! Each rank sums the contributions of its own particles, in a [`RoundedSum`] for each number and triangle. The bits do not
//! depend on the number of ranks or on restarts. A contact counts for the triangle nearest to its point, in the axes of the
//! wall.

use super::{DriveError, Observer, Reporter, Restart, Row, SavedColumn, SavedState, View};
use crate::comm::Comm;
use crate::contact::StateColumn;
use crate::law::{OnWall, PressOnWall};
use crate::math::{RoundedSum, Vec3};
use crate::particles::Particles;
use crate::walls::Wall;
use std::collections::HashMap;

/// Name of [`Ledger`] among the observers.
const NAME: &str = "ledger";
/// Wall of a row.
const WALL: StateColumn = StateColumn::new("wall", 1, "1");
/// Triangle of a row; -1 for the wall itself, for contacts near no triangle.
const TRIANGLE: StateColumn = StateColumn::new("triangle", 1, "1");
/// Time over which has been summed.
const TIME: StateColumn = StateColumn::new("time", 1, "s");
/// Work on the particles.
const WORK: StateColumn = StateColumn::new("work", 1, "J");
/// 1 for walls that wear; for others the next three columns are 0.
const WEARS: StateColumn = StateColumn::new("wears", 1, "1");
/// Energy lost at the wall.
const LOST: StateColumn = StateColumn::new("lost", 1, "J");
/// Part of the energy lost that friction took.
const RUBBED: StateColumn = StateColumn::new("rubbed", 1, "J");
/// Force of the particles times time, in the axes of the wall.
const IMPULSE: StateColumn = StateColumn::new("impulse", 3, "N s");
/// Checksum of the wall's triangles; 0 for a wall that has none or does not wear.
const SURFACE: StateColumn = StateColumn::new("surface", 1, "1");
/// All of these sums exactly: three words for each, the lowest first.
const WORDS: StateColumn = StateColumn::new("words", NUMBERS * RoundedSum::WORDS, "2^-140");

/// Numbers of a row: work, energy lost, its part by friction, and an impulse.
const NUMBERS: usize = 6;
type Entry = [RoundedSum; NUMBERS];

/// Sums of one wall.
#[derive(Clone, Debug)]
struct Account {
    name: String,
    works: bool,
    wears: bool,
    /// First of its rows; its own row follows those of its triangles, which it has if it wears.
    first: usize,
    triangles: usize,
    /// See [`SURFACE`].
    surface: u64,
    /// See [`TIME`].
    time: f64,
    /// Work, energy lost and its part by friction, over all ranks at the last row of the history [J].
    totals: [f64; 3],
}

impl Account {
    const fn own_row(&self) -> usize {
        self.first + self.triangles
    }

    fn rows(&self) -> std::ops::RangeInclusive<usize> {
        self.first..=self.own_row()
    }

    /// Row for a contact of particle `a` at a point, given from the particle's centre [m].
    fn row_at(&self, a: usize, point: &Vec3, wall: &Wall, particles: &Particles) -> usize {
        let Some(mesh) = &wall.mesh else { return self.own_row() };
        let frame = wall.frame();
        // At a periodic image of a triangle, the particle is wrapped to the triangle itself.
        let mut place = particles.position[a] + point;
        particles.cell.wrap(&mut place, &mut Vec3::zeros(), &mut [0; 3]);
        let place = frame.tr_mul(&(place - wall.point));
        // Contact points are half the overlap off the surface; at corners of other shapes they may be farther.
        let size = particles.inscribed_radius(a);
        let mut distances = [0.02 * size, 0.2 * size, particles.radius(a)].into_iter();
        let found = distances.find_map(|far| mesh.surface.nearest_triangle(&place, far));
        found.map_or(self.own_row(), |triangle| self.first + triangle)
    }
}

/// Sums of all walls that move, carry particles along or wear.
#[derive(Clone, Debug, Default)]
pub struct Ledger {
    all: Vec<Account>,
    /// Account of each wall.
    of_wall: Vec<Option<usize>>,
    /// Sums over this rank's particles.
    rows: Vec<Entry>,
    warnings: Vec<String>,
}

impl Ledger {
    /// Bytes per triangle on each rank.
    pub const BYTES: usize = size_of::<Entry>();

    /// Ledger before the first step; `None` if there is nothing to sum.
    pub fn new(walls: &[Wall]) -> Option<Self> {
        let mut new = Self::default();
        for wall in walls {
            let counts = wall.may_work() || wall.wears;
            new.of_wall.push(counts.then_some(new.all.len()));
            if counts {
                let surface = wall.mesh.as_ref().filter(|_| wall.wears);
                let account = Account {
                    name: wall.name.clone(),
                    works: wall.may_work(),
                    wears: wall.wears,
                    first: new.rows.len(),
                    triangles: surface.map_or(0, |mesh| mesh.surface.len()),
                    surface: surface.map_or(0, |mesh| mesh.surface.checksum()),
                    time: 0.0,
                    totals: [0.0; 3],
                };
                new.rows.resize(account.own_row() + 1, Entry::default());
                new.all.push(account);
            }
        }
        (!new.all.is_empty()).then_some(new)
    }

    /// Sums over all ranks. Collective.
    fn of_all_ranks(rows: &[Entry], comm: &mut dyn Comm) -> Vec<Entry> {
        let mut limbs: Vec<[i64; RoundedSum::LIMBS]> =
            rows.iter().flatten().map(RoundedSum::limbs).collect();
        comm.sum(limbs.as_flattened_mut());
        let numbers: Vec<RoundedSum> = limbs.iter().map(RoundedSum::from_limbs).collect();
        numbers.as_chunks().0.to_vec()
    }
}

impl Observer for Ledger {
    fn after_forces(&mut self, &View { moment, particles, sums, .. }: &View) {
        let dt = moment.dt;
        if dt == 0.0 {
            return;
        }
        for account in &mut self.all {
            account.time += dt;
        }
        let presses = sums.presses_on_walls().unwrap_or_default();
        for (k, OnWall { pair, work, lost, rubbed }) in sums.on_walls().iter().enumerate() {
            let Some(number) = particles.wall_of(pair.b) else { continue };
            let Some(account) = self.of_wall[number].map(|account| &self.all[account]) else {
                continue;
            };
            if !account.wears {
                self.rows[account.own_row()][0].add(*work);
                continue;
            }
            let (wall, PressOnWall { point, force }) = (&particles.walls[number], &presses[k]);
            let row = &mut self.rows[account.row_at(pair.a.index(), point, wall, particles)];
            let impulse = wall.frame().tr_mul(force) * dt;
            let terms = [*work, *lost, *rubbed, impulse.x, impulse.y, impulse.z];
            row.iter_mut().zip(terms).for_each(|(sum, term)| sum.add(term));
        }
    }

    fn row(&mut self, _row: &mut Row, comm: &mut dyn Comm) {
        let of_one = |account: &Account| {
            self.rows[account.rows()].iter().fold(Entry::default(), |mut sums, row| {
                sums.iter_mut().zip(row).for_each(|(sum, term)| *sum += *term);
                sums
            })
        };
        let mine: Vec<Entry> = self.all.iter().map(of_one).collect();
        for (account, [work, lost, rubbed, ..]) in
            self.all.iter_mut().zip(Self::of_all_ranks(&mine, comm))
        {
            account.totals = [work, lost, rubbed].map(|sum| sum.value());
        }
    }
}

impl Reporter for Ledger {
    fn name(&self) -> &'static str {
        NAME
    }

    fn counted(&self) -> Vec<(String, f64)> {
        let of_one = |account: &Account| {
            let Account { name, works, wears, totals: [work, lost, rubbed], .. } = account;
            [
                (*works, format!("work_{name}_J"), *work),
                (*wears, format!("lost_at_{name}_J"), *lost),
                (*wears, format!("rubbed_at_{name}_J"), *rubbed),
            ]
        };
        let all = self.all.iter().flat_map(of_one);
        all.filter(|(counts, ..)| *counts).map(|(_, name, number)| (name, number)).collect()
    }

    fn warnings(&mut self) -> Vec<String> {
        std::mem::take(&mut self.warnings)
    }

    fn save(&self, _walls: &[Wall], comm: &mut dyn Comm) -> Vec<SavedColumn> {
        let rows = Self::of_all_ranks(&self.rows, comm);
        let accounts = || self.all.iter().flat_map(|account| account.rows().map(move |_| account));
        let numbers = |which: std::ops::Range<usize>| {
            rows.iter().flat_map(move |row| row[which.clone()].iter().map(RoundedSum::value))
        };
        let triangle = |account: &Account, row: usize| {
            if row == account.own_row() { -1 } else { (row - account.first) as i64 }
        };
        let triangles = accounts().enumerate().map(|(row, account)| triangle(account, row));
        let words = rows.iter().flatten().flat_map(RoundedSum::words);
        vec![
            SavedColumn::texts(WALL, accounts().map(|account| account.name.clone())),
            SavedColumn::integers(TRIANGLE, triangles),
            SavedColumn::reals(TIME, accounts().map(|account| account.time)),
            SavedColumn::counts(WEARS, accounts().map(|account| u64::from(account.wears))),
            SavedColumn::counts(SURFACE, accounts().map(|account| account.surface)),
            SavedColumn::reals(WORK, numbers(0..1)),
            SavedColumn::reals(LOST, numbers(1..2)),
            SavedColumn::reals(RUBBED, numbers(2..3)),
            SavedColumn::reals(IMPULSE, numbers(3..6)),
            SavedColumn::integers(WORDS, words),
        ]
    }

    /// A new stage counts from 0. The losses of a wall that did not wear before, or has other triangles, start again; its
    /// work continues.
    fn resume(&mut self, restart: &Restart, _walls: &mut [Wall]) -> Result<(), DriveError> {
        let &Restart { saved, is_new_stage, is_root, .. } = restart;
        if is_new_stage {
            return Ok(());
        }
        let (names, times) = (saved.texts(&WALL)?, saved.reals(&TIME)?);
        let (wears, surfaces) = (saved.counts(&WEARS)?, saved.counts(&SURFACE)?);
        let words = saved.integers(&WORDS)?.as_chunks().0;
        let numbers = words.iter().map(RoundedSum::from_words).collect::<Vec<_>>();
        let rows: &[Entry] = numbers.as_chunks().0;
        for account in &mut self.all {
            let theirs = names.iter().zip(0..).filter(|(name, _)| **name == account.name);
            let theirs: Vec<usize> = theirs.map(|(_, row)| row).collect();
            let is_as_it_was = |&first: &usize| {
                theirs.len() == account.triangles + 1
                    && account.wears == (wears[first] == 1)
                    && account.surface == surfaces[first]
            };
            let goes_on = theirs.first().copied().filter(is_as_it_was);
            if let Some(first) = goes_on {
                account.time = times[first];
            } else if theirs.is_empty() {
                self.warnings.push(begins(&account.name));
            } else if account.wears {
                self.warnings.push(format!(
                    "wall \"{}\" had no wear before this restart, or other triangles: its wear is summed from here on",
                    account.name
                ));
            }
            if !is_root {
                continue;
            }
            if goes_on.is_some() {
                for (now, &before) in account.rows().zip(&theirs) {
                    self.rows[now] = rows[before];
                }
            } else {
                for &before in &theirs {
                    self.rows[account.own_row()][0] += rows[before][0];
                }
            }
        }
        Ok(())
    }

    fn joins(&mut self) -> Result<(), DriveError> {
        let warnings = self.all.iter().map(|account| begins(&account.name));
        self.warnings.extend(warnings);
        Ok(())
    }
}

fn begins(name: &str) -> String {
    format!("the snapshot has no sums for wall \"{name}\": they start at this restart")
}

/// Sums of one triangle of a wall that wears.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Worn {
    /// Time over which has been summed [s].
    pub time: f64,
    /// Energy lost at the triangle [J].
    pub lost: f64,
    /// Part of it that friction took [J].
    pub rubbed: f64,
    /// Force of the particles times time, in the axes of the wall [N s].
    pub impulse: Vec3,
}

/// Saved sums of the triangles of walls that wear, by the name of the wall and the number of the triangle.
///
/// # Errors
/// If another version has saved them.
pub fn worn(drives: &[SavedState]) -> Result<HashMap<(&str, usize), Worn>, DriveError> {
    let Some(saved) = drives.iter().find(|saved| saved.drive == NAME) else {
        return Ok(HashMap::new());
    };
    let (names, triangles) = (saved.texts(&WALL)?, saved.integers(&TRIANGLE)?);
    let (time, lost) = (saved.reals(&TIME)?, saved.reals(&LOST)?);
    let (rubbed, impulse) = (saved.reals(&RUBBED)?, saved.reals(&IMPULSE)?);
    let of_one = |row: usize| {
        let triangle = usize::try_from(triangles[row]).ok()?;
        let impulse = Vec3::from_column_slice(&impulse[3 * row..][..3]);
        let worn = Worn { time: time[row], lost: lost[row], rubbed: rubbed[row], impulse };
        Some(((&*names[row], triangle), worn))
    };
    Ok((0..names.len()).filter_map(of_one).collect())
}
