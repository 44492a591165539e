//! State of servos in snapshots: a row for each wall with a servo. Coupled walls share their state; it stands in each of
//! their rows.

use super::law::{Goal, State};
use super::{Running, Servos};
use crate::comm::Comm;
use crate::contact::StateColumn;
use crate::drive::errors::{Course, Errors, PARTS};
use crate::drive::{DriveError, Restart, SavedColumn, SavedState, load};
use crate::math::ExactSum;
use crate::walls::Wall;

/// Name of [`Servos`] among the drives.
pub(super) const NAME: &str = "servos";

/// The wall's name in the scene.
const WALL: StateColumn = StateColumn::new("wall", 1, "");
/// Target stress, compression positive; 0 for a servo of force.
const TARGET: StateColumn = StateColumn::new("target", 1, "Pa");
/// [`State::speed`].
const SPEED: StateColumn = StateColumn::new("speed", 1, "m/s");
/// [`State::stiffness`].
const STIFFNESS: StateColumn = StateColumn::new("stiffness", 1, "N/m");
/// Errors since the last check of `[stop]`.
const RECENT: StateColumn = StateColumn::new("recent", 4, "1");
/// Errors since the stage began; parts without steps are zero.
const COURSE: StateColumn = StateColumn::new("course", 4 * PARTS, "1");
/// Exact sum of the forces on the wall since the last row of the history: limbs along x, y, z.
const FORCE_SUM: StateColumn =
    StateColumn::new("force_sum", 3 * ExactSum::LIMBS, "2^(32 k - 1074) N");
/// Number of steps in that sum.
const FORCE_STEPS: StateColumn = StateColumn::new("force_steps", 1, "1");
// Further columns if there is a servo of force:
/// Target force; 0 for a servo of stress.
const TARGET_FORCE: StateColumn = StateColumn::new("target_force", 1, "N");
/// [`super::Goal::along`].
const ALONG: StateColumn = StateColumn::new("along", 3, "");
/// Exact sum over all ranks of the forces against the directions of the servo's walls.
const PRESSING: StateColumn = StateColumn::new("pressing", ExactSum::LIMBS, "2^(32 k - 1074) N");

/// Target stress of a wall.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    /// The wall's name.
    pub wall: String,
    /// Target, compression positive [Pa].
    pub stress: f64,
}

/// Targets of all walls with a servo of stress, from the saved states of the drives.
pub fn targets(saved: &[SavedState]) -> Vec<Target> {
    let read = || {
        let saved = saved.iter().find(|saved| saved.drive == NAME)?;
        let (walls, stresses) = (saved.texts(&WALL).ok()?, saved.reals(&TARGET).ok()?);
        let target = |(wall, &stress): (&String, &f64)| Target { wall: wall.clone(), stress };
        let of_stress = |target: &Target| target.stress > 0.0;
        Some(walls.iter().zip(stresses).map(target).filter(of_stress).collect())
    };
    read().unwrap_or_default()
}

/// Columns over all ranks. Collective.
pub(super) fn saved(servos: &Servos, walls: &[Wall], comm: &mut dyn Comm) -> Vec<SavedColumn> {
    let sums = servos.means.of_all_ranks(comm);
    let rows = || {
        let of_wall = |wall: usize| Some((wall, &servos.all[servos.of_wall(wall)?]));
        sums.keys().filter_map(move |&wall| of_wall(wall))
    };
    let targets = |of_force: bool| {
        let target =
            move |goal: Goal| if goal.is_force() == of_force { goal.target().2 } else { 0.0 };
        rows().map(move |(_, running)| target(running.servo.goal))
    };
    let axes = sums.values().flat_map(|sum| &sum.axes);
    let mut columns = vec![
        SavedColumn::texts(WALL, rows().map(|(wall, _)| walls[wall].name.clone())),
        SavedColumn::reals(TARGET, targets(false)),
        SavedColumn::reals(SPEED, rows().map(|(_, running)| running.state.speed)),
        SavedColumn::reals(STIFFNESS, rows().map(|(_, running)| running.state.stiffness)),
        SavedColumn::reals(RECENT, rows().flat_map(|(_, running)| running.record.recent.numbers())),
        SavedColumn::reals(COURSE, rows().flat_map(|(_, running)| running.record.course.numbers())),
        SavedColumn::integers(FORCE_SUM, axes.flat_map(|axis| *axis.limbs())),
        SavedColumn::counts(FORCE_STEPS, sums.values().map(|sum| sum.steps)),
    ];
    if servos.has_force() {
        let nothing = ExactSum::default();
        let pressing = servos.all.iter().map(|running| running.pressing.as_ref());
        let pressing = load::of_all_ranks(pressing.map(|sum| sum.unwrap_or(&nothing)), comm);
        let along = |(wall, running): (usize, &Running)| running.servo.goal.along(&walls[wall]);
        let numbers = sums.keys().filter_map(|&wall| servos.of_wall(wall));
        columns.extend([
            SavedColumn::reals(TARGET_FORCE, targets(true)),
            SavedColumn::reals(ALONG, rows().map(along).flat_map(<[f64; 3]>::from)),
            SavedColumn::integers(PRESSING, numbers.flat_map(|k| *pressing[k].limbs())),
        ]);
    }
    columns
}

/// Restores the state of the walls of the same names. In a new stage only the state of the control law is kept, along
/// another direction with its component.
pub(super) fn resume(
    servos: &mut Servos,
    restart: &Restart,
    walls: &[Wall],
) -> Result<(), DriveError> {
    let saved = restart.saved;
    let names = saved.texts(&WALL)?;
    let (speeds, stiffnesses) = (saved.reals(&SPEED)?, saved.reals(&STIFFNESS)?);
    let recents: &[[f64; 4]] = saved.reals(&RECENT)?.as_chunks().0;
    let courses = saved.reals(&COURSE)?.as_chunks::<4>().0.as_chunks::<PARTS>().0;
    let force_sums: &[[i64; ExactSum::LIMBS]] = saved.integers(&FORCE_SUM)?.as_chunks().0;
    let force_steps = saved.counts(&FORCE_STEPS)?;
    // Snapshots with servos of stress alone have no directions: those were the normals.
    let lines: Option<&[[f64; 3]]> = saved.reals(&ALONG).ok().map(|lines| lines.as_chunks().0);
    let pressing = saved.integers(&PRESSING).ok().zip(saved.reals(&TARGET_FORCE).ok());
    let row_of = |wall: usize| names.iter().position(|name| *name == walls[wall].name);
    for running in &mut servos.all {
        let Some(&wall) = running.servo.walls.first() else { continue };
        let Some(row) = row_of(wall) else { continue };
        let goal = running.servo.goal;
        let along = goal.along(&walls[wall]);
        let before = lines.map_or_else(|| walls[wall].surface().1, |lines| lines[row].into());
        let part = if before == along { 1.0 } else { before.dot(&along) };
        running.state = State { speed: speeds[row] * part, stiffness: stiffnesses[row] };
        if restart.is_new_stage {
            continue;
        }
        if let Some((limbs, targets)) = pressing
            && goal.is_force()
            && targets[row] != 0.0
            && before == along
        {
            let limbs = &limbs[ExactSum::LIMBS * row..][..ExactSum::LIMBS];
            running.pressing = Some(restart.sum(limbs));
        }
        running.record.recent = Errors::of(&recents[row]);
        running.record.course = Course::of(&courses[row]);
    }
    if restart.is_new_stage {
        return Ok(());
    }
    for (&wall, forces) in &mut servos.means.0 {
        let Some(row) = row_of(wall) else { continue };
        forces.steps = force_steps[row];
        forces.axes = std::array::from_fn(|axis| restart.sum(&force_sums[3 * row + axis]));
    }
    Ok(())
}
