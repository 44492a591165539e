//! Post-processing of snapshots: stress, coordination, fabric, forces, and the page that shows them.
//!
//! Every measure adds up pieces of the tables, so that a snapshot may be larger than memory: only a few
//! bytes per particle are kept (and up to 2³⁰ contacts counted). All sums are exact
//! ([`crate::math::ExactSum`]), so that a report has the same digits for any number of ranks that wrote
//! the snapshot.
//!
//! Three passes follow each other. [`ParticlePass`] finds the region and its particles; [`ContactPass`]
//! finds stress, coordination, fabric and the mean force; [`ForcePass`] finds everything that depends
//! on the mean force or the fabric. [`analyse`] runs them over a file.
//!
//! Numbers are computed in this folder:
//!
//! | file | content |
//! |---|---|
//! | [`region`] | the measured region; volume, solid fraction, strain |
//! | [`stress`] [`coordination`] [`fabric`] [`forces`] | one measure each |
//! | [`report`] `rows` | the numbers of a snapshot, as JSON, as a row of CSV, and as text |
//! | [`series`] | the snapshots of a run, one after the other |
//! | [`history`] | the scalars of a run by time, written by the run |
//! | [`measures`] [`errors`] | measures on request, and the errors that prevent them: |
//! | [`fields`] [`mixing`] [`slope`] [`flow`] | density, velocity and stress on a [`grid`]; Lacey's index; angle of a heap; flow rates |
//! | [`diff`] | comparison of two snapshots, bit for bit |
//! | [`compare`] | several runs side by side |
//! | [`lammps`] | particles for OVITO |
//! | [`ondem`] | the exchange file of the ON-DEM action |
//! | [`surface`] [`export`] [`vtp`] | surfaces of bodies; a snapshot as VTP; its file |
//!
//! Pictures and pages are made in [`shown`]:
//!
//! | file | content |
//! |---|---|
//! | [`draw`] | charts: series, axes, panels |
//! | [`views`] | spatial views: force chains, velocities, averages by height |
//! | [`plots`] [`panels`] [`rose`] [`picture`] | curves, distributions, roses, the packing from the side |
//! | [`form`] | a single shape |
//! | [`sizes`] | sizes of the particles beside the requested distribution |
//! | [`page`] | the page with all numbers and plots |
//! | [`compared`] | the page of several runs |

mod check;
pub mod compare;
pub mod coordination;
pub mod diff;
pub mod errors;
pub mod export;
pub mod fabric;
pub mod fields;
pub mod flow;
pub mod forces;
pub mod grid;
pub mod history;
pub mod lammps;
pub mod means;
pub mod measured;
pub mod measures;
pub mod mixing;
pub mod ondem;
pub mod region;
pub mod report;
mod rows;
pub mod series;
pub mod shown;
pub mod slope;
pub mod stress;
pub mod sums;
pub mod surface;
pub mod vtp;

pub use report::{Report, Summary};
pub use shown::{compared, draw, form, page, panels, picture, plots, rose, sizes, views};

use crate::drive::DriveError;
use crate::ids::GlobalId;
use crate::output::SnapshotError;
use crate::output::header::Header;
use crate::output::snapshot::Reader;
use crate::output::tables::{ContactTable, ParticleTable};
use coordination::CoordinationCount;
use fabric::{Among, Fabric, FabricSum, ForceFabricSum, RoseSum};
use forces::{ForceCount, MeanForceSum};
use picture::Picture;
use region::{Bounds, Extent, Margin, Members, Region, SampledSolid, SolidVolume};
use std::ops::Range;
use std::path::PathBuf;
use stress::StressSum;

/// Errors of post-processing.
#[derive(Debug, thiserror::Error)]
pub enum PostError {
    /// The file could not be read.
    #[error(transparent)]
    Snapshot(#[from] SnapshotError),
    /// The saved state of a drive does not match its present form.
    #[error(transparent)]
    Drive(#[from] DriveError),
    /// A number is NaN or infinite.
    #[error("{what} is not a finite number: the snapshot is damaged, or the run was unstable")]
    NotFinite {
        /// Name of the number.
        what: String,
    },
    /// The shape of a particle is not listed in the snapshot.
    #[error("particle {id} has shape {shape}, but the snapshot lists {shapes} shapes")]
    UnknownShape {
        /// Id of the particle.
        id: GlobalId,
        /// Shape of the particle.
        shape: u16,
        /// Number of listed shapes.
        shapes: usize,
    },
    /// The id of a particle was never given.
    #[error(
        "the id of particle {id} was never assigned (the next is {next_id}): the snapshot is damaged"
    )]
    UnknownId {
        /// Id of the particle.
        id: GlobalId,
        /// The next id.
        next_id: u64,
    },
    /// Two particles have one id.
    #[error("particle {id} appears twice in the snapshot")]
    TwiceTheSameId {
        /// Their id.
        id: GlobalId,
    },
    /// A contact refers to a particle that does not exist.
    #[error(
        "a contact names particle {id}, which is not in the snapshot: check that the contacts file is of the same run \
         and step"
    )]
    ContactOfNobody {
        /// Id of the particle.
        id: GlobalId,
    },
    /// The folder cannot be listed.
    #[error("cannot list {folder}: {cause}", folder = folder.display())]
    Unlisted {
        /// The folder.
        folder: PathBuf,
        /// Error of the operating system.
        cause: std::io::Error,
    },
    /// The folder has no snapshot.
    #[error(
        "{folder} contains no snapshot: neither last.vtkhdf nor particles_STEP.vtkhdf",
        folder = folder.display()
    )]
    NoSnapshot {
        /// The folder.
        folder: PathBuf,
    },
    /// Two snapshots are of one step, so that their rows and dumps could not be distinguished.
    #[error(
        "{first} and {second} are both of step {step}: leave one out, give one run at a time, or compare them with \
         --compare or --diff",
        first = first.display(),
        second = second.display()
    )]
    SameStep {
        /// The step.
        step: u64,
        /// First file.
        first: PathBuf,
        /// Second file.
        second: PathBuf,
    },
    /// Two snapshots cannot come from one run.
    #[error(
        "{first} and {second} are of different runs: {because}. Give one run at a time, or compare them with --compare or --diff",
        first = first.display(),
        second = second.display()
    )]
    OtherRun {
        /// File of the lower step.
        first: PathBuf,
        /// File of the higher step.
        second: PathBuf,
        /// Change between the snapshots that a run cannot make.
        because: String,
    },
    /// An error, with the name of the file.
    #[error("{file}: {error}")]
    In {
        /// The file.
        file: String,
        /// Error in the file.
        error: Box<PostError>,
    },
    /// A margin was requested, but the packing has no box.
    #[error("the packing has no bounding box from which a margin could be removed")]
    NoBox,
    /// The region has no particles.
    #[error("the region contains no particle centre: make it larger, or the margin smaller")]
    NobodyThere,
    /// The region has no volume.
    #[error("the region has no length along {axis}: from {low} m to {high} m")]
    EmptyRegion {
        /// The axis.
        axis: &'static str,
        /// Its low side [m].
        low: f64,
        /// Its high side [m].
        high: f64,
    },
    /// The region extends beyond the period.
    #[error(
        "the region reaches beyond the periodic domain along {axis}: {low}..{high} m in {period_low}..{period_high} m"
    )]
    RegionBeyondPeriod {
        /// The axis.
        axis: &'static str,
        /// Low side of the region [m].
        low: f64,
        /// High side of the region [m].
        high: f64,
        /// Low side of the domain [m].
        period_low: f64,
        /// High side of the domain [m].
        period_high: f64,
    },
}

impl PostError {
    /// Whether a margin leaves nothing of this snapshot, although it may leave something of another.
    pub(super) const fn is_of_margin(&self) -> bool {
        matches!(self, Self::NoBox | Self::EmptyRegion { .. })
    }
}

/// Choices of the user.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Settings {
    /// Measured region.
    pub region: Region,
    /// Contacts that count in fabric, roses and force distributions.
    pub among: Among,
}

/// Results for a snapshot.
#[derive(Clone, Debug)]
pub struct Analysis {
    /// All numbers.
    pub report: Report,
    /// Picture of the packing.
    pub picture: Picture,
}

/// First pass, over particles.
#[derive(Clone, Debug)]
pub struct ParticlePass<'a> {
    header: &'a Header,
    settings: Settings,
    extent: Extent,
    volume: SolidVolume,
    sampled: Option<SampledSolid>,
    members: Members,
    mean_force: MeanForceSum,
    picture: Picture,
}

impl<'a> ParticlePass<'a> {
    /// An empty pass.
    ///
    /// # Errors
    /// If the region cannot be used with this snapshot.
    pub fn new(header: &'a Header, settings: Settings) -> Result<Self, PostError> {
        settings.region.check(header)?;
        Ok(Self {
            header,
            settings,
            extent: Extent::default(),
            volume: SolidVolume::default(),
            sampled: match settings.region {
                Region::Whole => None,
                Region::Box(bounds) => Some(SampledSolid::new(bounds)),
            },
            members: Members::new(settings.region),
            mean_force: MeanForceSum::new(settings.among),
            picture: Picture::of(header, settings.region == Region::Whole),
        })
    }

    /// Adds a piece of the particles.
    ///
    /// # Errors
    /// If the table is invalid.
    pub fn add(&mut self, particles: &ParticleTable) -> Result<(), PostError> {
        check::check_particles(self.header, particles)?;
        self.members.add(self.header, particles)?;
        self.extent.add(self.header, particles);
        self.volume.add(self.header, particles);
        if let Some(sampled) = &mut self.sampled {
            sampled.add(self.header, particles);
        }
        self.mean_force.add(self.header, particles, &self.members)?;
        self.picture.add(self.header, particles, &self.members)
    }

    /// Ends the pass and starts that over contacts.
    pub fn finish(self) -> ContactPass<'a> {
        let packing = self.extent.finish(self.header);
        let bounds = match self.settings.region {
            Region::Whole => packing,
            Region::Box(bounds) => Some(bounds),
        };
        let solid_fraction = match &self.sampled {
            Some(sampled) => Some(sampled.finish()),
            None => bounds.map(|b| self.volume.finish() / b.volume()),
        };
        ContactPass {
            header: self.header,
            settings: self.settings,
            packing,
            inertial_number_times_root_p: packing
                .and_then(|packing| self.volume.inertia_of_strain(self.header, &packing)),
            bounds,
            solid_fraction,
            members: self.members,
            picture: self.picture,
            mean_force: self.mean_force,
            stress: StressSum::default(),
            coordination: CoordinationCount::default(),
            fabric: FabricSum::new(self.settings.among),
            rose: RoseSum::new(self.settings.among),
        }
    }
}

/// Second pass, over contacts.
#[derive(Clone, Debug)]
pub struct ContactPass<'a> {
    header: &'a Header,
    settings: Settings,
    packing: Option<Bounds>,
    inertial_number_times_root_p: Option<f64>,
    bounds: Option<Bounds>,
    solid_fraction: Option<f64>,
    members: Members,
    picture: Picture,
    mean_force: MeanForceSum,
    stress: StressSum,
    coordination: CoordinationCount,
    fabric: FabricSum,
    rose: RoseSum,
}

impl<'a> ContactPass<'a> {
    /// Adds a piece of the contacts.
    ///
    /// # Errors
    /// If the table is invalid.
    pub fn add_contacts(&mut self, contacts: &ContactTable) -> Result<(), PostError> {
        check::check_contacts(contacts)?;
        self.stress.add_contacts(contacts, &self.members)?;
        self.coordination.add_contacts(contacts, &self.members);
        self.fabric.add_contacts(contacts, &self.members)?;
        self.rose.add_contacts(contacts, &self.members)?;
        self.mean_force.add_contacts(contacts, &self.members)
    }

    /// Ends the pass and starts that of measures that depend on the fabric or the mean force.
    pub fn finish(self) -> ForcePass<'a> {
        let among = self.settings.among;
        let fabric = self.fabric.finish();
        let mean = self.mean_force.mean_normal_force();
        ForcePass {
            fabric,
            force_fabric: fabric.map(|fabric| ForceFabricSum::new(among, &fabric)),
            forces: mean.map(|mean| ForceCount::new(among, mean)),
            before: self,
        }
    }
}

/// Third pass, over contacts again.
#[derive(Clone, Debug)]
pub struct ForcePass<'a> {
    before: ContactPass<'a>,
    fabric: Option<Fabric>,
    force_fabric: Option<ForceFabricSum>,
    forces: Option<ForceCount>,
}

impl ForcePass<'_> {
    /// Adds a piece of the contacts.
    ///
    /// # Errors
    /// If the table is invalid.
    pub fn add_contacts(&mut self, contacts: &ContactTable) -> Result<(), PostError> {
        if let Some(force_fabric) = &mut self.force_fabric {
            force_fabric.add_contacts(contacts, &self.before.members)?;
        }
        if let Some(forces) = &mut self.forces {
            forces.add_contacts(contacts, &self.before.members)?;
        }
        Ok(())
    }

    /// All results. `snapshot` is the name of the source in the report.
    pub fn finish(self, snapshot: &str) -> Analysis {
        let ContactPass { header, settings, bounds, solid_fraction, members, picture, .. } =
            self.before;
        let parts = report::Parts {
            header,
            region: settings.region,
            among: settings.among,
            packing: self.before.packing,
            inertial_number_times_root_p: self.before.inertial_number_times_root_p,
            bounds,
            solid_fraction,
            stress: bounds.map(|b| self.before.stress.finish(b.volume())),
            coordination: self.before.coordination.finish(&members),
            fabric: self.fabric,
            force_fabric: self.force_fabric.and_then(|sum| sum.finish()),
            rose: self.before.rose.finish(),
            forces: self.forces.map(ForceCount::finish),
            mean_normal_force: self.before.mean_force.mean_normal_force(),
            unbalanced_ratio: self.before.mean_force.unbalanced_ratio(),
        };
        Analysis { report: Report::of(parts, snapshot), picture }
    }
}

/// Number of rows read at a time: some tens of megabytes.
const PIECE: usize = 1 << 17;

/// Ranges of rows in which a table of this length is read.
pub fn pieces(rows: usize) -> impl Iterator<Item = Range<usize>> {
    (0..rows).step_by(PIECE).map(move |first| first..(first + PIECE).min(rows))
}

/// Computes all results from the files of a snapshot, in pieces. `name` is the name of the source in
/// the report.
///
/// # Errors
/// If files cannot be read or are invalid, or the region does not fit.
pub fn analyse(reader: &Reader, name: &str, settings: Settings) -> Result<Analysis, PostError> {
    let mut particles = ParticlePass::new(reader.header(), settings)?;
    for rows in pieces(reader.particle_count()) {
        particles.add(&reader.particles(rows)?)?;
    }
    let mut contacts = particles.finish();
    for rows in pieces(reader.contact_count()?) {
        contacts.add_contacts(&reader.contacts(rows)?)?;
    }
    let mut forces = contacts.finish();
    for rows in pieces(reader.contact_count()?) {
        forces.add_contacts(&reader.contacts(rows)?)?;
    }
    Ok(forces.finish(name))
}

/// Box of the packing without a layer along its sides. The sides are at walls, and at the outermost
/// particles where there are none. A periodic axis has no sides.
///
/// # Errors
/// If the file cannot be read, or the margin leaves nothing of the packing.
pub fn inside(reader: &Reader, margin: Margin) -> Result<Region, PostError> {
    let header = reader.header();
    let mut extent = Extent::default();
    for rows in pieces(reader.particle_count()) {
        let particles = reader.particles(rows)?;
        check::check_particles(header, &particles)?;
        extent.add(header, &particles);
    }
    let bounds = extent.finish(header).ok_or(PostError::NoBox)?;
    let region = Region::Box(bounds.shrunk(header, margin.metres(reader)?));
    region.check(header).map(|()| region)
}
