//! Makes a simulation from a scene: the only module that names concrete parts.

use super::before::{admit_saved, known_as};
use super::{Scene, packing};
use crate::cell::{AXES, Cell, Shear};
use crate::comm::{Comm, agree};
use crate::contact::{self, ContactRecords, StateColumn};
use crate::contacts::Contacts;
use crate::domain::{Domain, halo_width};
use crate::drive::element::Element;
use crate::drive::free::FreeWalls;
use crate::drive::groups::{self, GroupMotion, Groups};
use crate::drive::inlet::Inlets;
use crate::drive::ledger::Ledger;
use crate::drive::outlet::Outlets;
use crate::drive::rain::RainGauge;
use crate::drive::servo::{Goal, Servos};
use crate::drive::{Drive, DriveError, Observer};
use crate::ids::{GlobalId, ShapeId};
use crate::law::stability::time_step_limit;
use crate::law::{ForceLaw, Sums};
use crate::math::printed_limit;
use crate::measure::Departed;
use crate::motion::Field;
use crate::output::SnapshotError;
use crate::output::header::{Header, ShapeRow, WallRow};
use crate::output::snapshot::Reader;
use crate::particles::columns::Accumulated;
use crate::particles::records::Particle;
use crate::particles::{Group, Particles};
use crate::population::Library;
use crate::search::PairList;
use crate::sim::{Simulation, audit::Auditor, capture, watch::Watch};
use crate::timing::Clock;
use crate::walls::{StageSoFar, Wall, area};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Reason why a snapshot does not fit the scene.
#[derive(Clone, Debug, thiserror::Error, Serialize, Deserialize)]
pub enum StartError {
    /// The snapshot cannot be read.
    #[error(transparent)]
    Snapshot(#[from] SnapshotError),
    /// It has a shape that the scene lacks.
    #[error(
        "{path}: the scene has no shape \"{shape}\" of this form and size, which particles of the snapshot have. Add \
         a [[shape]] of that name and kind \"{kind}\", with semi-axes {semi_axes} and a volume of {volume:e} m3"
    )]
    Shape {
        /// The snapshot.
        path: PathBuf,
        /// The shape's name.
        shape: String,
        /// Its kind.
        kind: String,
        /// Its volume [m³].
        volume: f64,
        /// Its semi-axes [m].
        semi_axes: String,
    },
    /// The stage cannot go on, because the law of the scene needs more state than the snapshot has.
    #[error(
        "{path}: it has no `{column}` of contacts, a state variable of the scene's law: friction or restitution have \
         been added since. Use it for a new stage, as `start` of the scene"
    )]
    Forgotten {
        /// The snapshot.
        path: PathBuf,
        /// Name of the missing column.
        column: String,
    },
    /// A drive of the scene cannot go on from it.
    #[error("{path}: {error}")]
    Drive {
        /// The snapshot.
        path: PathBuf,
        /// Drive and reason.
        error: DriveError,
    },
    /// It has particles of sizes that do not fit the scene's settings.
    #[error(
        "{path}: it has particles of scales {least:?} to {largest:?} of shape \"{shape}\": {problem}"
    )]
    Size {
        /// The snapshot.
        path: PathBuf,
        /// The shape's name.
        shape: String,
        /// Smallest scale of such a particle.
        least: f64,
        /// Largest scale of such a particle.
        largest: f64,
        /// Problem and advice.
        problem: String,
    },
    /// It belongs to another stage or scene.
    #[error(
        "{path}: it belongs to another stage: its scene's `start` is {start}. To begin a stage from the scene's \
         `start`, omit --start; to continue a stage, give it the same `start`"
    )]
    OtherStage {
        /// The snapshot.
        path: PathBuf,
        /// Its `start`.
        start: String,
    },
    /// The area of a servo's wall is unknown, because walls are tilted.
    #[error(
        "{path}: wall \"{wall}\", or an adjacent one, is tilted, so the area of its servo is not known. Turn it back \
         in the stage before, or leave out the servo"
    )]
    Tilted {
        /// The snapshot.
        path: PathBuf,
        /// The wall's name.
        wall: String,
    },
    /// A servo of force would not press on particles.
    #[error(
        "{path}: wall \"{wall}\" is turned: `along` of its servo moves it in its own plane, or away from the \
         particles. Give another `along`, or turn it back in the stage before"
    )]
    Astray {
        /// The snapshot.
        path: PathBuf,
        /// The wall's name.
        wall: String,
    },
    /// A turned wall cannot move freely: its masses along normals hold for another orientation.
    #[error(
        "{path}: wall \"{wall}\" is turned, so it cannot move freely with a `mass`. Turn it back in the stage before, \
         or give the scene another wall, with that orientation"
    )]
    Turned {
        /// The snapshot.
        path: PathBuf,
        /// The wall's name.
        wall: String,
    },
    /// Its images have slid along other axes than the scene's.
    #[error(
        "{path}: the snapshot was sheared along {along} across {across}, by a strain of {strain}. Give the scene the \
         same `along` and `across` in domain.shear; rate = 0 keeps the strain"
    )]
    Sheared {
        /// The snapshot.
        path: PathBuf,
        /// Axis of the shear.
        along: String,
        /// Axis across the shear.
        across: String,
        /// Shear strain.
        strain: f64,
    },
    /// Its cell has been strained by a flow.
    #[error(
        "{path}: its cell has been strained. Give the scene a [cell]: an empty one keeps the strain"
    )]
    Strained {
        /// The snapshot.
        path: PathBuf,
    },
    /// Its domain repeats along other axes or with other lengths.
    #[error(
        "{path}: its periodic axes or their lengths differ from the scene's [domain]: a stage must keep those of the \
         stage before"
    )]
    Period {
        /// The snapshot.
        path: PathBuf,
    },
}

/// Smallest part of the automatic step to which a stage shortens it: stiffness grows with the root of the overlap, which is
/// less than the radius.
const MOST_SHORTENED: f64 = 1e-3;

/// Way in which a run continues from a snapshot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Continuation {
    /// In the same stage, as if it had never stopped.
    SameStage,
    /// A new stage begins with the snapshot's particles.
    NewStage,
}

/// Simulation of the scene, without particles.
pub fn assemble(scene: &Scene, comm: &dyn Comm) -> Simulation {
    assemble_with(scene, scene.force_law(), comm)
}

/// Simulation with another law in place of the scene's, without particles.
pub fn assemble_with(scene: &Scene, law: Box<dyn ForceLaw>, comm: &dyn Comm) -> Simulation {
    let needs = scene.needs_with(&*law);
    let reach = law.about().reach(&scene.library);
    let halo = halo_width(&scene.library, scene.skin, reach);
    let mut kinds = scene.particle_kinds();
    kinds.extend(scene.facet_kinds());
    let mut found = contact::Found::default();
    found.contacts.without_points = !needs.orientation;
    found.contacts.with_patches = needs.patches;
    let table = if needs.patches { contact::table_with_patches } else { contact::table };
    let mut cell = scene.domain;
    if let Some(control) = &scene.cell {
        Element::begin(control, &mut cell, scene.dt);
    }
    let mut particles = Particles::new(needs, scene.library.clone(), scene.walls.clone(), cell);
    particles.groups = scene.groups.iter().map(group).collect();
    Simulation {
        particles,
        pairs: PairList::default(),
        contacts: Contacts::of(law.state()),
        sums: Sums::default(),
        domain: Domain::new(&scene.domain, halo, comm),
        resolvers: table(&scene.method, &kinds),
        law,
        field: Field { gravity: scene.gravity, damping: scene.global_damping },
        drives: drives(scene),
        observers: Ledger::new(&scene.walls)
            .map(|ledger| -> Box<dyn Observer> { Box::new(ledger) })
            .into_iter()
            .collect(),
        watch: Watch::new(scene.library.least_inscribed_radius()),
        found,
        active: Vec::new(),
        dt: scene.dt,
        step: 0,
        stage_begin: (0, 0.0),
        stage_shift: 0.0,
        next_id: 0,
        departed: Departed::default(),
        most_moving: 0.0,
        skin: scene.skin,
        reach,
        imbalance: scene.imbalance,
        order_every: scene.order_every,
        lists_since_cut: 0,
        audit: Auditor::new(scene.audit),
        clock: Clock::new(),
    }
}

/// Data of a group for the particles.
fn group(group: &groups::Group) -> Group {
    let about = match &group.what {
        GroupMotion::Held(path) => path.course.turn.as_ref().map(|_| path.about),
        GroupMotion::Pushed(_) => None,
    };
    Group { name: group.name.clone(), about }
}

/// Drives of the scene.
fn drives(scene: &Scene) -> Vec<Box<dyn Drive>> {
    let mut drives: Vec<Box<dyn Drive>> = Vec::new();
    if let Some(rain) = &scene.rain {
        drives.push(Box::new(RainGauge::new(rain.clone(), scene.seed)));
    }
    if !scene.inlets.is_empty() {
        drives.push(Box::new(Inlets::new(scene.inlets.clone(), scene.seed)));
    }
    if !scene.outlets.is_empty() {
        drives.push(Box::new(Outlets::new(scene.outlets.clone())));
    }
    if !scene.servos.is_empty() {
        drives.push(Box::new(Servos::new(scene.servos.clone(), &scene.walls)));
    }
    if let Some(control) = &scene.cell {
        drives.push(Box::new(Element::new(control.clone())));
    }
    if !scene.free_walls.is_empty() {
        drives.push(Box::new(FreeWalls::new(scene.free_walls.clone(), &scene.walls)));
    }
    if !scene.groups.is_empty() {
        drives.push(Box::new(Groups::new(scene.groups.clone())));
    }
    drives
}

/// Information from the snapshot from which a run continues.
#[derive(Clone, Debug)]
pub struct RestartInfo {
    /// Errors of newer snapshots that were passed over.
    pub passed_over: Vec<SnapshotError>,
    /// The `[stop]` that held when it was written; empty if none did.
    pub stop: String,
    /// Walls that the previous stage left elsewhere than in the scene: name, and largest distance along the normal within
    /// the domain [m]. Only for a stage that begins.
    pub walls_elsewhere: Vec<(String, f64)>,
    /// Walls whose surface differs from that of the same name in the snapshot. They stand where the scene puts them.
    pub other_walls: Vec<String>,
    /// Names of state columns of its contacts that the scene's law does not have.
    pub forgotten: Vec<String>,
}

/// Adds the scene's particles to a simulation that has none.
pub fn fill(sim: &mut Simulation, scene: &Scene, comm: &dyn Comm) {
    sim.particles.strip_to_owned();
    for mut particle in packing::initial(scene) {
        sim.next_id = particle.id.0 + 1;
        particle.velocity += scene.domain.flow_at(&particle.position);
        groups::join(&scene.groups, &mut particle, &scene.library, &scene.domain);
        if sim.domain.owner(&particle.position) == comm.rank() {
            sim.insert(&particle);
        }
    }
}

/// Simulation with the particles of a snapshot, and what became of them, or else with those of the scene's fill. Collective.
///
/// # Errors
/// See [`take_up`].
pub fn started(
    scene: &Scene,
    from: Option<(&Path, Continuation)>,
    comm: &mut dyn Comm,
) -> Result<(Simulation, Option<RestartInfo>), StartError> {
    let mut sim = assemble(scene, comm);
    let Some((path, continuation)) = from else {
        fill(&mut sim, scene, comm);
        return Ok((sim, None));
    };
    let taken = take_up(&mut sim, scene, path, continuation, comm)?;
    Ok((sim, Some(taken)))
}

/// The snapshot with which a run begins: one within the stage, or the start of the stage.
pub fn first_snapshot<'a>(
    scene: &'a Scene,
    within: Option<&'a Path>,
) -> Option<(&'a Path, Continuation)> {
    let before = scene.start.as_deref().map(|path| (path, Continuation::NewStage));
    within.map(|path| (path, Continuation::SameStage)).or(before)
}

/// Restores the state of a snapshot, or of the newest good one of a directory. Collective.
///
/// # Errors
/// On all ranks, if any of them could not read its part, or if the snapshot does not fit the scene.
pub fn take_up(
    sim: &mut Simulation,
    scene: &Scene,
    path: &Path,
    continuation: Continuation,
    comm: &mut dyn Comm,
) -> Result<RestartInfo, StartError> {
    let reader = Reader::open_together(path, comm)?;
    let read = read_part(&reader, reader.path(), scene, comm);
    let (header, mut particles, records) = agree(comm, read)?;
    let goes_on = continuation == Continuation::SameStage;
    if goes_on {
        check_stage(sim, scene, (&header, reader.path()), &records)?;
        let shortened = MOST_SHORTENED * scene.dt..scene.dt;
        if scene.own_step && shortened.contains(&header.dt) {
            sim.dt = header.dt;
        }
    }
    sim.particles.cell = cell_of(scene, &header, reader.path(), continuation)?;
    sim.domain.follow(&sim.particles.cell);
    let mut library = sim.particles.library.clone();
    for particle in &mut particles {
        if goes_on {
            groups::take_shape(&scene.groups, particle, &library);
        } else {
            groups::join(&scene.groups, particle, &library, &scene.domain);
        }
    }
    if goes_on {
        admit_saved(&mut library, &header);
    }
    admit_sizes(sim, scene, reader.path(), (library, &particles), comm)?;
    set_clock(sim, &header, goes_on);
    if !goes_on {
        // Replaces the old flow by the present one.
        let flows = [&header.cell, &sim.particles.cell];
        for particle in &mut particles {
            particle.accumulated = Accumulated::default();
            let [before, now] = flows.map(|cell| cell.flow_at(&particle.position));
            particle.velocity += now - before;
        }
    }
    let (walls_elsewhere, other_walls) = take_up_walls(sim, scene, &header, goes_on);
    check_steered(sim, scene, reader.path())?;
    let of_law = sim.law.state();
    let is_forgotten = |column: &&StateColumn| !of_law.contains(column);
    let forgotten = records.columns().iter().filter(is_forgotten);
    let forgotten = forgotten.map(|column| column.name.to_string()).collect();
    let resumed = sim.resume_drives(&header.drives, !goes_on, comm);
    resumed.map_err(|error| StartError::Drive { path: reader.path().to_owned(), error })?;
    sim.take_up(&particles, &records, comm);
    if !goes_on {
        sim.count_free_energy();
    } else if header.dt != sim.dt || header.gravity != sim.field.gravity {
        sim.change_step_or_gravity(header.dt, header.gravity);
    }
    let passed_over = reader.passed_over().to_vec();
    Ok(RestartInfo { passed_over, stop: header.stop, walls_elsewhere, other_walls, forgotten })
}

/// Checks that a snapshot is of the same stage, and has the whole state of the law and of groups: a new stage finds its forces anew, a
/// continued one does not.
fn check_stage(
    sim: &Simulation,
    scene: &Scene,
    (header, path): (&Header, &Path),
    records: &ContactRecords,
) -> Result<(), StartError> {
    let path = path.to_owned();
    if start_of(&scene.text) != start_of(&header.scene) {
        let start = start_of(&header.scene).unwrap_or_else(|| "none".to_owned());
        return Err(StartError::OtherStage { path, start });
    }
    let is_known = |wanted: &&StateColumn| records.columns().contains(wanted);
    if let Some(column) = sim.law.state().iter().find(|column| !is_known(column)) {
        return Err(StartError::Forgotten { path, column: column.name.to_string() });
    }
    if scene.groups.is_empty() && header.drives.iter().any(|s| s.drive == groups::NAME) {
        return Err(StartError::Drive { path, error: groups::other_groups("some") });
    }
    Ok(())
}

/// Sets the steps, times and counts of a simulation, which goes on in the same stage or begins a new one.
fn set_clock(sim: &mut Simulation, header: &Header, goes_on: bool) {
    sim.next_id = header.next_id;
    sim.step = header.step;
    if !goes_on {
        sim.stage_begin = (header.step, header.time);
        return;
    }
    (sim.stage_begin, sim.stage_shift) = (header.stage_begin, header.stage_shift);
    sim.departed = header.departed;
    sim.most_moving = header.most_moving;
    let steps = (header.step - header.stage_begin.0) as f64;
    if header.dt != sim.dt {
        sim.stage_shift += steps * (header.dt - sim.dt);
    }
}

/// Puts walls where they were. Returns the walls of a new stage that the scene has elsewhere, with their distances [m], and the walls of
/// another form.
fn take_up_walls(
    sim: &mut Simulation,
    scene: &Scene,
    header: &Header,
    goes_on: bool,
) -> (Vec<(String, f64)>, Vec<String>) {
    let (mut elsewhere, mut others) = (Vec::new(), Vec::new());
    let has_same_step = goes_on && header.dt == sim.dt;
    let room = scene.domain.corners();
    let before = StageSoFar { dt: header.dt, time: header.time - header.stage_begin.1 };
    let now = (header.step, goes_on.then_some(before));
    let Particles { walls, library, .. } = &mut sim.particles;
    for wall in walls {
        if let Some(row) = header.walls.iter().find(|row| row.name == wall.name) {
            // A wall keeps its place from stage to stage; the scene determines whether it moves.
            let surface = (row.point, row.normal);
            match wall.go_on(&surface, row.body.as_ref(), has_same_step, now, library, &room) {
                None => others.push(wall.name.clone()),
                Some(off) if !goes_on && off > 0.0 => elsewhere.push((wall.name.clone(), off)),
                Some(_) => {}
            }
        }
    }
    (elsewhere, others)
}

/// Checks that walls that forces move stand as they must.
fn check_steered(sim: &Simulation, scene: &Scene, path: &Path) -> Result<(), StartError> {
    let Particles { walls, cell, .. } = &sim.particles;
    let path = path.to_owned();
    if let Some(wall) = walls.iter().find(|wall| wall.mass.is_finite() && wall.is_turned()) {
        return Err(StartError::Turned { path, wall: wall.name.clone() });
    }
    let has_area =
        |wall: &Wall| wall.across().and_then(|own| area(walls, cell, own.axis)).is_some();
    let steered =
        scene.servos.iter().flat_map(|servo| servo.walls.iter().map(|&k| (servo.goal, &walls[k])));
    for (goal, wall) in steered {
        let name = &wall.name;
        match goal {
            Goal::Stress(_) if !has_area(wall) => {
                return Err(StartError::Tilted { path, wall: name.clone() });
            }
            Goal::Force { .. } if !wall.leads(&goal.along(wall)) && !wall.may_turn() => {
                return Err(StartError::Astray { path, wall: name.clone() });
            }
            _ => {}
        }
    }
    Ok(())
}

/// Value of `start` in the text of a scene.
fn start_of(scene: &str) -> Option<String> {
    Some(scene.parse::<toml::Table>().ok()?.get("start")?.to_string())
}

/// The scene's cell, with its images as in the snapshot.
fn cell_of(
    scene: &Scene,
    header: &Header,
    path: &Path,
    continuation: Continuation,
) -> Result<Cell, StartError> {
    match (header.cell.strained(), &scene.cell) {
        (Some(_), Some(_)) if continuation == Continuation::SameStage => return Ok(header.cell),
        (Some(_), Some(control)) => {
            let mut cell = header.cell;
            Element::begin(control, &mut cell, scene.dt);
            return Ok(cell);
        }
        (None, Some(control)) if header.cell.shear().is_none() => {
            let mut cell = scene.domain;
            Element::begin(control, &mut cell, scene.dt);
            return Ok(cell);
        }
        _ => {}
    }
    let (now, before) = (scene.domain.shear(), header.cell.shear());
    let Some(Shear { along, across, strain, .. }) = before else { return Ok(scene.domain) };
    let goes_on = now.filter(|now| (now.along, now.across) == (along, across));
    let cell = goes_on.and_then(|now| scene.domain.with_shear(Shear { strain, ..now }));
    cell.ok_or_else(|| StartError::Sheared {
        path: path.to_owned(),
        along: AXES[along].to_owned(),
        across: AXES[across].to_owned(),
        strain,
    })
}

/// Extends the library to the sizes and numbers of these particles. A scene that names its snapshot has done it already;
/// another one may not know them. Collective.
fn admit_sizes(
    sim: &mut Simulation,
    scene: &Scene,
    path: &Path,
    (mut library, particles): (Library, &[Particle]),
    comm: &mut dyn Comm,
) -> Result<(), StartError> {
    for particle in particles {
        library.admit(particle.shape, particle.scale);
    }
    let mut counts = vec![0_i64; library.shapes.len()];
    for particle in particles {
        counts[particle.shape.index()] += 1;
    }
    comm.sum(&mut counts);
    for (most, count) in library.most.iter_mut().zip(counts) {
        *most = most.max(count as f64);
    }
    let bounds = library.scales.iter().flat_map(|[least, largest]| [-least, *largest]);
    let mut bounds: Vec<f64> = bounds.collect();
    comm.max(&mut bounds);
    for (scales, bounds) in library.scales.iter_mut().zip(bounds.chunks_exact(2)) {
        *scales = [-bounds[0], bounds[1]];
    }
    if library == sim.particles.library {
        return Ok(());
    }
    let wrong = |shape: ShapeId, problem: String| {
        let [least, largest] = library.scales[shape.index()];
        let shape = library.names[shape.index()].clone();
        Err(StartError::Size { path: path.to_owned(), shape, least, largest, problem })
    };
    if let Some(limit) = time_step_limit(&library, &*sim.law)
        && scene.dt > limit.dt
        && !scene.allow_unstable
    {
        let dt = printed_limit(limit.dt);
        return wrong(
            limit.shape,
            format!(
                "time.step is over their stable limit of {dt:.2e} s; use a shorter step, or set time.allow_unstable = \
                 true"
            ),
        );
    }
    let reach = sim.law.about().reach(&library);
    let halo = halo_width(&library, scene.skin, reach);
    if let Some((axis, width)) = scene.domain.thin(2.0 * halo).next() {
        let radius = |&(shape, scale): &(ShapeId, f64)| library.radius[shape.index()] * scale;
        let largest = library.extremes().max_by(|a, b| radius(a).total_cmp(&radius(b)));
        return wrong(
            largest.map_or(ShapeId(0), |(shape, _)| shape),
            format!(
                "a period must be at least {:.4e} m, twice the largest bounding diameter and the skin; along {axis} \
                 it is {width:?} m",
                2.0 * halo,
            ),
        );
    }
    sim.particles.strip_to_owned();
    let farthest = library.longest_with_faces();
    if farthest > sim.particles.library.longest_with_faces() {
        for wall in &mut sim.particles.walls {
            wall.deepen_cells(farthest, &mut library);
        }
    }
    sim.particles.needs.scale = library.has_sizes();
    sim.watch = Watch::new(library.least_inscribed_radius());
    sim.particles.library = library;
    sim.reach = reach;
    sim.domain.widen(halo);
    Ok(())
}

/// This rank's share of the rows of a snapshot.
fn read_part(
    reader: &Reader,
    path: &Path,
    scene: &Scene,
    comm: &dyn Comm,
) -> Result<(Header, Vec<Particle>, ContactRecords), StartError> {
    let header = reader.header().clone();
    if header.cell.strained().is_some() && scene.cell.is_none() {
        return Err(StartError::Strained { path: path.to_owned() });
    }
    if header.cell.repeats_otherwise(&scene.domain) {
        return Err(StartError::Period { path: path.to_owned() });
    }
    let known = |row: &ShapeRow| {
        known_as(&scene.library, row).ok_or_else(|| StartError::Shape {
            path: path.to_owned(),
            shape: row.name.clone(),
            kind: row.kind.clone(),
            volume: row.volume,
            semi_axes: format!("[{}, {}, {}] m", row.semi_axes.x, row.semi_axes.y, row.semi_axes.z),
        })
    };
    let shapes: Vec<Result<ShapeId, StartError>> = header.shapes.iter().map(known).collect();
    let share = |count: usize| {
        let (rank, size) = (comm.rank().index(), comm.size() as usize);
        count * rank / size..count * (rank + 1) / size
    };
    let table = reader.particles(share(reader.particle_count()))?;
    let records = reader.contact_records(share(reader.contact_record_count()))?;
    let records = records.renamed(|id| {
        let Some((wall, facet)) = id.wall_and_facet() else { return Some(id) };
        // The order of walls may have changed, and a wall may be missing or different.
        let is = |wall: &Wall, WallRow { name, point, normal, body, .. }: &WallRow| {
            wall.name == *name && wall.is_same(&(*point, *normal), body.as_ref())
        };
        let before = header.walls.get(wall)?;
        let now = scene.walls.iter().position(|wall| is(wall, before))?;
        Some(GlobalId::facet(now, facet))
    });
    if let Some(row) = table.scale.iter().position(|scale| !(scale.is_finite() && *scale > 0.0)) {
        let (scale, shape) = (table.scale[row], &header.shapes[table.shape[row].index()]);
        return Err(StartError::Size {
            path: path.to_owned(),
            shape: shape.name.clone(),
            least: scale,
            largest: scale,
            problem: "a scale must be a number greater than 0; use another snapshot".to_owned(),
        });
    }
    // A shape without particles may be missing.
    let mut used: Vec<ShapeId> = table.shape.clone();
    used.sort_unstable();
    used.dedup();
    for shape in used {
        shapes[shape.index()].as_ref().map_err(StartError::clone)?;
    }
    let now = |shape: ShapeId| *shapes[shape.index()].as_ref().expect("looked at above");
    let mut particles = capture::particles_of(&table, now);
    for (particle, before) in particles.iter_mut().zip(&table.shape) {
        // The density may have changed: velocity and angular velocity stay.
        let mass = scene.library.mass[particle.shape.index()];
        particle.angular_momentum *= mass / header.shapes[before.index()].mass;
    }
    Ok((header, particles, records))
}
