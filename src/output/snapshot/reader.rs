//! Reading of snapshots.

use super::folder::candidates;
use super::header::read_header;
use super::{
    LAST, POINTS, RECORD_A, RECORD_B, RECORD_NORMAL, RECORD_OVERLAP, RECORDS, column, vectors,
};
use crate::comm::alone::Alone;
use crate::comm::{Comm, agree, wire};
use crate::contact::{ContactRecord, ContactRecords, Geometry, StateColumn};
use crate::ids::GlobalId;
use crate::math::Vec3;
use crate::output::columns::Value as _;
use crate::output::hdf5::{Column, Piece, StoredFile};
use crate::output::header::Header;
use crate::output::tables::{CONTACT_COLUMNS, ContactTable, PARTICLE_COLUMNS, ParticleTable};
use crate::output::{SnapshotError, name_of};
use std::cell::OnceCell;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Number of particles whose scales are read at a time.
const PARTICLES_AT_ONCE: usize = 1 << 20;

/// An opened snapshot, read serially: any rank, or a program without MPI, opens it independently.
///
/// Opening checks all bytes of a file against the checksum at its end. A read of all rows of a dataset checks them again, by the
/// checksum that was made before they were written. Ranks that restart use [`Reader::open_together`].
pub struct Reader {
    particles: StoredFile,
    /// Opened at the first access, so that a damaged contacts file does not prevent a restart.
    contacts: OnceCell<Result<StoredFile, SnapshotError>>,
    header: Header,
    particle_count: usize,
    contact_record_count: usize,
    passed_over: Vec<SnapshotError>,
}

/// Smallest and largest scale of particles [-], and their number.
pub type Sizes = ([f64; 2], u64);

impl Reader {
    /// Opens a particles file, or the newest usable snapshot of a directory: the one of [`LAST`], otherwise the next before it.
    ///
    /// # Errors
    /// [`SnapshotError::Missing`], [`SnapshotError::Unreadable`], [`SnapshotError::Damaged`],
    /// [`SnapshotError::NoneGood`].
    pub fn open(path: &Path) -> Result<Self, SnapshotError> {
        Self::open_among(path, &mut Alone::default(), |_, _| Ok(()))
    }

    /// Opens a snapshot on all ranks for a restart, like [`Reader::open`]. Each rank checks a share of the particles file, which
    /// has all data of a restart. Collective.
    ///
    /// # Errors
    /// See [`Reader::open`]; the same on every rank.
    pub fn open_together(path: &Path, comm: &mut dyn Comm) -> Result<Self, SnapshotError> {
        Self::open_among(path, comm, |file, comm| file.verify(comm))
    }

    fn open_among(
        path: &Path,
        comm: &mut dyn Comm,
        check: impl Fn(&StoredFile, &mut dyn Comm) -> Result<(), SnapshotError>,
    ) -> Result<Self, SnapshotError> {
        // Only rank 0 reads the directory: other ranks may see changes late.
        let mut listed = wire::encode(&path.is_dir().then(|| candidates(path)));
        comm.broadcast(&mut listed);
        let mut open = |file: &Path| {
            let opened = Self::open_file(file, comm)?;
            check(&opened.particles, comm).map(|()| opened)
        };
        let Some(candidates) = wire::decode::<Option<Vec<PathBuf>>>(&listed) else {
            return open(path);
        };
        let mut passed_over = Vec::new();
        for file in candidates {
            match open(&file) {
                Ok(reader) => return Ok(Self { passed_over, ..reader }),
                Err(error) => passed_over.push(error),
            }
        }
        if passed_over.is_empty() {
            return open(&path.join(LAST));
        }
        let causes = passed_over.iter().map(SnapshotError::to_string).collect();
        Err(SnapshotError::NoneGood { path: name_of(path), causes })
    }

    fn open_file(path: &Path, comm: &mut dyn Comm) -> Result<Self, SnapshotError> {
        // The link is resolved, so that the contacts file is found beside the real file.
        let real = path
            .canonicalize()
            .map_err(|e| SnapshotError::Missing { path: name_of(path), cause: e.to_string() });
        let real = agree(comm, real)?;
        let particles = StoredFile::open(&real, comm)?;
        let read = || {
            if !particles.has("/VTKHDF/PointData/id") {
                let cause = "it has no particles; name particles_<step>.vtkhdf, not the contacts file of the snapshot";
                return Err(SnapshotError::unreadable(&real, &cause));
            }
            let counts = (particles.count(POINTS.place)?, particles.count(RECORD_A.place)?);
            Ok((read_header(&particles)?, counts))
        };
        let read = read();
        let (header, (particle_count, contact_record_count)) = agree(comm, read)?;
        let (contacts, passed_over) = (OnceCell::new(), Vec::new());
        Ok(Self { particles, contacts, header, particle_count, contact_record_count, passed_over })
    }

    /// Path of the particles file.
    pub fn path(&self) -> &Path {
        self.particles.path()
    }

    /// Errors of newer snapshots of the directory that were skipped, the newest first.
    pub fn passed_over(&self) -> &[SnapshotError] {
        &self.passed_over
    }

    /// Header of the snapshot.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// Number of particles.
    pub fn particle_count(&self) -> usize {
        self.particle_count
    }

    /// Particles, in the order of their ids.
    ///
    /// # Errors
    /// [`SnapshotError::Beyond`], [`SnapshotError::Unreadable`], [`SnapshotError::Damaged`].
    pub fn particles(&self, rows: Range<usize>) -> Result<ParticleTable, SnapshotError> {
        self.columns(rows, |_| true)
    }

    /// Particles with some of the columns, selected by name; the others stay empty.
    fn columns(
        &self,
        rows: Range<usize>,
        is_wanted: impl Fn(&str) -> bool,
    ) -> Result<ParticleTable, SnapshotError> {
        let table = Piece { file: &self.particles, total: self.particle_count, rows };
        let mut particles = ParticleTable::default();
        for column in PARTICLE_COLUMNS.iter().filter(|column| is_wanted(column.name)) {
            column.read(&mut particles, &table)?;
        }
        self.check_names(&particles)?;
        Ok(particles)
    }

    /// Checks that every shape is in the header, and every id was given to a particle.
    fn check_names(&self, particles: &ParticleTable) -> Result<(), SnapshotError> {
        let (shapes, next_id) = (self.header.shapes.len(), self.header.next_id);
        let unlisted = particles.shape.iter().find(|shape| shape.index() >= shapes);
        let strange = particles.id.iter().find(|id| id.wall_index().is_some() || id.0 >= next_id);
        let cause = match (unlisted, strange) {
            (Some(shape), _) => {
                format!("a particle has shape {}, but only {shapes} are listed", shape.0)
            }
            (None, Some(id)) => format!("the id of particle {id} was never assigned"),
            (None, None) => return Ok(()),
        };
        Err(SnapshotError::unreadable(self.path(), &cause))
    }

    /// Smallest and largest scale of the particles of each shape [-], and their number; `None` for a shape without particles.
    /// Only some of the particles are in memory at a time.
    ///
    /// # Errors
    /// See [`Reader::particles`].
    pub fn sizes(&self) -> Result<Vec<Option<Sizes>>, SnapshotError> {
        let mut sizes: Vec<Option<Sizes>> = vec![None; self.header.shapes.len()];
        for first in (0..self.particle_count).step_by(PARTICLES_AT_ONCE) {
            let rows = first..(first + PARTICLES_AT_ONCE).min(self.particle_count);
            let table = self.columns(rows, |name| ["shape", "scale"].contains(&name))?;
            for (row, shape) in table.shape.iter().enumerate() {
                let scale = table.scale_of(row);
                // An invalid shape is reported when the particles are read.
                let Some(known) = sizes.get_mut(shape.index()) else { continue };
                let ([least, largest], count) = known.unwrap_or(([scale; 2], 0));
                *known = Some(([least.min(scale), largest.max(scale)], count + 1));
            }
        }
        Ok(sizes)
    }

    /// Number of contacts.
    ///
    /// # Errors
    /// If the contacts file cannot be opened.
    pub fn contact_count(&self) -> Result<usize, SnapshotError> {
        self.contacts_file()?.count(CONTACT_COLUMNS[0].place)
    }

    /// Contacts, in the order of the ids of A, then of B.
    ///
    /// # Errors
    /// See [`Reader::particles`]; also if the contacts file cannot be opened.
    pub fn contacts(&self, rows: Range<usize>) -> Result<ContactTable, SnapshotError> {
        let file = self.contacts_file()?;
        let total = file.count(CONTACT_COLUMNS[0].place)?;
        let twice = |r: &Range<usize>| r.start.saturating_mul(2)..r.end.saturating_mul(2);
        let ends = Piece { file, total: 2 * total, rows: twice(&rows) };
        let table = Piece { file, total, rows };
        let mut contacts = ContactTable {
            centre: read_vectors(&ends, &POINTS)?.into_iter().step_by(2).collect(),
            ..ContactTable::default()
        };
        for column in &CONTACT_COLUMNS {
            column.read(&mut contacts, &table)?;
        }
        Ok(contacts)
    }

    /// Number of records of touching contacts.
    pub fn contact_record_count(&self) -> usize {
        self.contact_record_count
    }

    /// Records of touching contacts, in the order of [`Reader::contacts`].
    ///
    /// # Errors
    /// See [`Reader::particles`].
    pub fn contact_records(&self, rows: Range<usize>) -> Result<ContactRecords, SnapshotError> {
        let table = Piece { file: &self.particles, total: self.contact_record_count, rows };
        let (a, b) = (ids(&table, &RECORD_A)?, ids(&table, &RECORD_B)?);
        let normal = read_vectors(&table, &RECORD_NORMAL)?;
        let overlap: Vec<f64> = table.read(&RECORD_OVERLAP)?;
        let remembered = self.remembered()?;
        let mut states: Vec<Vec<f64>> = Vec::new();
        for StateColumn { name, unit, width } in &remembered {
            states.push(table.read(&column(&format!("{RECORDS}/{name}"), *width, unit))?);
        }
        let mut records = ContactRecords::of(&remembered);
        let mut state = Vec::new();
        for k in 0..a.len() {
            state.clear();
            for (StateColumn { width, .. }, numbers) in remembered.iter().zip(&states) {
                state.extend_from_slice(&numbers[k * width..][..*width]);
            }
            let geometry = Geometry { normal: normal[k], overlap: overlap[k] };
            records.push(&ContactRecord { a: a[k], b: b[k], geometry, state: &state });
        }
        Ok(records)
    }

    /// Columns of the contact law's state in the records.
    ///
    /// # Errors
    /// [`SnapshotError::Unreadable`].
    pub fn remembered(&self) -> Result<Vec<StateColumn>, SnapshotError> {
        let geometry = [RECORD_A, RECORD_B, RECORD_NORMAL, RECORD_OVERLAP];
        let mut remembered = Vec::new();
        for name in self.particles.members(RECORDS)? {
            let place = format!("{RECORDS}/{name}");
            if geometry.iter().all(|column| column.place != place) {
                let (width, unit) = self.particles.width_and_unit(&place)?;
                remembered.push(StateColumn { name: name.into(), unit: unit.into(), width });
            }
        }
        Ok(remembered)
    }

    /// Checks every dataset of both files against its checksum.
    ///
    /// # Errors
    /// [`SnapshotError::Damaged`] with the first dataset that has changed, or an error of reading.
    pub fn verify(&self) -> Result<(), SnapshotError> {
        self.particles.verify(&mut Alone::default())?;
        self.contacts_file()?.verify(&mut Alone::default())
    }

    fn contacts_file(&self) -> Result<&StoredFile, SnapshotError> {
        let open = || open_contacts(self.particles.path(), &self.header);
        self.contacts.get_or_init(open).as_ref().map_err(Clone::clone)
    }
}

/// Opens the contacts file beside a particles file, and checks that both belong to one snapshot.
fn open_contacts(particles: &Path, header: &Header) -> Result<StoredFile, SnapshotError> {
    let name = particles.file_name().and_then(|n| n.to_str()).unwrap_or_default();
    let Some(rest) = name.strip_prefix("particles_") else {
        let cause = "its name does not begin with particles_, so its contacts file is unknown";
        return Err(SnapshotError::unreadable(particles, &cause));
    };
    let path = particles.with_file_name(format!("contacts_{rest}"));
    let file = StoredFile::open(&path, &mut Alone::default())?;
    // Bits are compared: a saved number that is not a number equals nothing.
    if wire::encode(&read_header(&file)?) == wire::encode(header) {
        Ok(file)
    } else {
        Err(SnapshotError::unreadable(&path, &"it belongs to another snapshot than the particles"))
    }
}

fn ids(piece: &Piece, column: &Column) -> Result<Vec<GlobalId>, SnapshotError> {
    Ok(GlobalId::from_elements(piece.read(column)?))
}

fn read_vectors(piece: &Piece, column: &Column) -> Result<Vec<Vec3>, SnapshotError> {
    Ok(vectors(&piece.read(column)?))
}
