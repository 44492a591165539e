//! HDF5: the only module that calls the library, but for [`super::foreign`].
//!
//! [`SnapshotFile`] writes columns of rows; each rank writes its own rows, in the order of the ranks. With MPI all ranks open
//! the file and write each dataset in one collective call. HDF5 silently falls back to slow independent writes, so each call
//! checks that the write was collective. Without MPI, rank 0 gathers the rows and writes alone.
//!
//! [`StoredFile`] reads, on any rank by itself and without MPI.
//!
//! Files are in the format of HDF5 1.8. Rows carry a [`checksum`]. Another checksum of all bytes stands behind the HDF5 file,
//! where its readers do not look. HDF5 1.10 crashes on some damaged structures, so no damaged file may reach it.
//!
//! A malicious file can have valid checksums. Links must lead to one place of this file, element types must be those written
//! here, and rows must stand in the file itself; anything else is rejected before it is read. Memory is allocated for the
//! requested amount, and a file with another amount is rejected. Bugs of HDF5 in its handling of malformed structures remain.

#![expect(unsafe_code, reason = "collective transfers and fixed-length text have no safe wrapper")]

use super::order::Order;
use super::seal::{
    PIECE, add_up, check_seal, checksum, reserve, seal, start_writeback, sum_of_file, trim,
};
use super::{SnapshotError, name_of, on_root};
use crate::comm::{Comm, agree};
use crate::contact::StateColumn;
use crate::drive::{SavedColumn, Values};
use crate::files;
use hdf5_metno::file::{FileAccessBuilder, FileCloseDegree};
use hdf5_metno::plist::DatasetCreate;
use hdf5_metno::plist::dataset_create::{FillTime, Layout};
use hdf5_metno::types::{TypeDescriptor, VarLenUnicode};
use hdf5_metno::{
    Dataset, Dataspace, Datatype, Error, File, Group, H5Type, IndexType, IterationOrder, LinkType,
    Location, LocationType,
};
use hdf5_metno_sys::h5::{herr_t, hsize_t};
use hdf5_metno_sys::h5i::hid_t;
use hdf5_metno_sys::{LOCK, h5a, h5d, h5p, h5s};
use std::collections::BTreeMap;
use std::ffi::{CString, c_int};
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Value of `H5D_MPIO_CONTIGUOUS_COLLECTIVE`, as `H5Pget_mpio_actual_io_mode` returns it.
const CONTIGUOUS_COLLECTIVE: c_int = 4;

/// Room for the structures and small tables of a file, besides its rows [bytes].
const STRUCTURE: u64 = 1 << 20;

const CHECKSUM: &str = "checksum";

unsafe extern "C" {
    fn H5Pget_mpio_actual_io_mode(list: hid_t, mode: *mut c_int) -> herr_t;
}

/// A number with the same bytes in memory and in a file.
pub trait Element: H5Type + bytemuck::Pod {
    /// VTK's name of the type.
    const VTK: &'static str;
}

impl Element for f64 {
    const VTK: &'static str = "Float64";
}

impl Element for f32 {
    const VTK: &'static str = "Float32";
}

impl Element for u64 {
    const VTK: &'static str = "UInt64";
}

impl Element for i64 {
    const VTK: &'static str = "Int64";
}

impl Element for i32 {
    const VTK: &'static str = "Int32";
}

impl Element for u16 {
    const VTK: &'static str = "UInt16";
}

impl Element for u8 {
    const VTK: &'static str = "UInt8";
}

/// A dataset: one row per particle, contact, wall, ...
#[derive(Clone, Copy, Debug)]
pub struct Column<'a> {
    /// Path in the file, from `/`.
    pub place: &'a str,
    /// Number of elements in a row.
    pub width: usize,
    /// Unit of the elements, attribute `unit`: `m/s`; `1` for a pure number; empty for none.
    pub unit: &'a str,
}

/// A file that all ranks write. Every call is collective; an error on one rank is returned on all.
pub struct SnapshotFile<'a> {
    comm: &'a mut dyn Comm,
    path: PathBuf,
    /// `None` on a rank that leaves the writing to rank 0.
    file: Option<File>,
    /// Handle of the same file on rank 0, to start writing to the disk early.
    writeback: Option<fs::File>,
    /// Room that was reserved [bytes].
    room: u64,
    collective_writes: usize,
}

impl<'a> SnapshotFile<'a> {
    /// Creates or empties the file, and reserves disk space for the `bytes` of all ranks. A disk that fills up during a
    /// collective write hangs some versions of Open MPI.
    ///
    /// # Errors
    /// [`SnapshotError::Write`] if it cannot be created, or the disk is too full.
    pub fn create(path: &Path, bytes: u64, comm: &'a mut dyn Comm) -> Result<Self, SnapshotError> {
        let mpi = comm.mpi();
        let room = add_up(comm, bytes) + STRUCTURE;
        // Before HDF5 opens the file: HDF5 could not close it on a full disk.
        on_root(path, comm, || reserve(&files::create(path)?, room))?;
        let created = if mpi.is_some() || comm.is_root() {
            File::with_options()
                .with_fapl(|access| as_snapshots_are(access, mpi))
                .with_fcpl(|create| create.obj_track_times(false))
                .create(path)
                .map(Some)
                .map_err(|e| SnapshotError::write(path, comm, &e))
        } else {
            Ok(None)
        };
        let file = agree(comm, created)?;
        // Again, because creating the file has emptied it.
        let mut writeback = None;
        on_root(path, comm, || {
            let opened = fs::File::options().write(true).open(path)?;
            reserve(&opened, room)?;
            writeback = Some(opened);
            Ok(())
        })?;
        Ok(Self { comm, path: path.to_owned(), file, writeback, room, collective_writes: 0 })
    }

    /// Number of datasets that HDF5 has reported as written collectively.
    pub fn collective_writes(&self) -> usize {
        self.collective_writes
    }

    /// Creates a group.
    ///
    /// # Errors
    /// [`SnapshotError::Write`].
    pub fn group(&mut self, place: &str) -> Result<(), SnapshotError> {
        self.everywhere(|file| {
            file.create_group_builder().obj_track_times(false).create(place).map(drop)
        })
    }

    /// Adds numbers to a group as an attribute: one as a scalar, several as a vector.
    ///
    /// # Errors
    /// [`SnapshotError::Write`].
    pub fn numbers<T: Element>(
        &mut self,
        group: &str,
        name: &str,
        values: &[T],
    ) -> Result<(), SnapshotError> {
        self.everywhere(|file| attach_numbers(&*file.group(group)?, name, values))
    }

    /// Adds a text to a group as an attribute.
    ///
    /// # Errors
    /// [`SnapshotError::Write`].
    pub fn text(&mut self, group: &str, name: &str, text: &str) -> Result<(), SnapshotError> {
        self.everywhere(|file| attach_text(&*file.group(group)?, name, text))
    }

    /// Adds a text to a dataset as an attribute.
    ///
    /// # Errors
    /// [`SnapshotError::Write`].
    pub fn note(&mut self, dataset: &str, name: &str, text: &str) -> Result<(), SnapshotError> {
        self.everywhere(|file| attach_text(&*file.dataset(dataset)?, name, text))
    }

    /// Writes a dataset of the rows of all ranks; `values` are those of this rank, one after the other.
    ///
    /// # Errors
    /// [`SnapshotError::Write`], also if HDF5 did not write collectively.
    ///
    /// # Panics
    /// If `values` are not whole rows.
    pub fn rows<T: Element>(&mut self, column: &Column, values: &[T]) -> Result<(), SnapshotError> {
        self.dataset(column, &T::type_descriptor(), bytemuck::cast_slice(values))
    }

    /// Writes a dataset of rows that other ranks may write; `values` are the rows that this rank has.
    ///
    /// # Errors
    /// See [`SnapshotFile::rows`].
    ///
    /// # Panics
    /// See [`SnapshotFile::rows`].
    pub fn rows_in<T: Element>(
        &mut self,
        order: &Order,
        column: &Column,
        values: &[T],
    ) -> Result<(), SnapshotError> {
        let moved = order.moved(values, column.width, self.comm);
        self.rows(column, &moved)
    }

    /// Communicator of the ranks that write the file.
    pub(super) fn comm(&mut self) -> &mut dyn Comm {
        self.comm
    }

    /// Writes numbers of the cells of an image in VTK's order, x fastest. The values of rank 0 are taken.
    ///
    /// # Errors
    /// [`SnapshotError::Write`], also if there are not as many values as cells.
    pub fn image(
        &mut self,
        column: &Column,
        cells: [usize; 3],
        values: &[f64],
    ) -> Result<(), SnapshotError> {
        let [x, y, z] = cells;
        let shape = if column.width == 1 { vec![z, y, x] } else { vec![z, y, x, column.width] };
        self.array(column.place, column.unit, &shape, values)
    }

    /// Writes an array of any shape, without a checksum; a shape of no lengths is a scalar. The values of rank 0 are taken.
    ///
    /// # Errors
    /// [`SnapshotError::Write`], also if the values do not fill the shape.
    pub fn array<T: Element>(
        &mut self,
        place: &str,
        unit: &str,
        shape: &[usize],
        values: &[T],
    ) -> Result<(), SnapshotError> {
        self.everywhere(|file| {
            let dataset = create_dataset(file, place, &T::type_descriptor(), shape)?;
            if unit.is_empty() { Ok(()) } else { attach_text(&dataset, "unit", unit) }
        })?;
        let values = if self.comm.is_root() { Some(values) } else { None };
        self.everywhere(|file| {
            values.map_or(Ok(()), |values| file.dataset(place)?.write_raw(values))
        })
    }

    /// Writes texts of any length as an array, without a checksum; a shape of no lengths is a scalar. For one rank.
    ///
    /// # Errors
    /// [`SnapshotError::Write`], also for a text with a zero byte.
    pub fn words(
        &mut self,
        place: &str,
        shape: &[usize],
        texts: &[&str],
    ) -> Result<(), SnapshotError> {
        self.everywhere(|file| {
            let words = texts.iter().map(|text| text.parse::<VarLenUnicode>());
            let words: Vec<_> = words.collect::<Result<_, _>>().map_err(|e| e.to_string())?;
            let builder = file.new_dataset::<VarLenUnicode>().obj_track_times(false);
            builder.shape(shape).create(place)?.write_raw(&words)
        })
    }

    /// Writes a dataset that all ranks have; the values of rank 0 are taken.
    ///
    /// # Errors
    /// See [`SnapshotFile::rows`].
    ///
    /// # Panics
    /// See [`SnapshotFile::rows`].
    pub fn table<T: Element>(
        &mut self,
        column: &Column,
        values: &[T],
    ) -> Result<(), SnapshotError> {
        let mine = if self.comm.is_root() { values } else { &[] };
        self.rows(column, mine)
    }

    /// Writes a dataset of texts that all ranks have, with the fixed length of the longest.
    ///
    /// # Errors
    /// See [`SnapshotFile::rows`].
    pub fn texts(&mut self, column: &Column, texts: &[&str]) -> Result<(), SnapshotError> {
        let length = texts.iter().map(|t| t.len()).max().unwrap_or(0).max(1);
        let mut bytes = Vec::new();
        if self.comm.is_root() {
            for text in texts {
                bytes.extend_from_slice(text.as_bytes());
                bytes.resize(bytes.len() + length - text.len(), 0);
            }
        }
        self.dataset(column, &TypeDescriptor::FixedUnicode(length), &bytes)
    }

    /// Writes a dataset of a group that all ranks have, of any type; the values of rank 0 are taken.
    ///
    /// # Errors
    /// See [`SnapshotFile::rows`].
    ///
    /// # Panics
    /// See [`SnapshotFile::rows`].
    pub fn saved(&mut self, group: &str, saved: &SavedColumn) -> Result<(), SnapshotError> {
        let StateColumn { name, unit, width } = &saved.column;
        let column = Column { place: &format!("{group}/{name}"), width: *width, unit };
        match &saved.values {
            Values::Texts(texts) => {
                self.texts(&column, &texts.iter().map(|text| &**text).collect::<Vec<_>>())
            }
            Values::Reals(values) => self.table(&column, values),
            Values::Integers(values) => self.table(&column, values),
            Values::Counts(values) => self.table(&column, values),
        }
    }

    /// Closes the file, frees unused room, and seals it with the checksum of all its bytes. Returns when everything is on the
    /// disk.
    ///
    /// # Errors
    /// [`SnapshotError::Write`].
    pub fn close(mut self) -> Result<(), SnapshotError> {
        let room = self.room;
        self.everywhere(|file| {
            debug_assert!(file.size() <= room, "room for {room} bytes, not for {}", file.size());
            file.flush()
        })?;
        let closed = self.file.take().map_or(Ok(()), File::close);
        self.agree(closed)?;
        let mut length = 0;
        on_root(&self.path, self.comm, || {
            length = trim(&self.path)?;
            Ok(())
        })?;
        let length = add_up(self.comm, length);
        let summed = sum_of_file(&self.path, length, self.comm)
            .map_err(|e| SnapshotError::write(&self.path, self.comm, &e));
        let sum = agree(self.comm, summed)?;
        let sum = self.sum_of_all(sum);
        on_root(&self.path, self.comm, || seal(&self.path, length, sum))
    }

    fn dataset(
        &mut self,
        column: &Column,
        element: &TypeDescriptor,
        bytes: &[u8],
    ) -> Result<(), SnapshotError> {
        let row_bytes = element.size() * column.width;
        assert!(bytes.len().is_multiple_of(row_bytes), "{} was given half a row", column.place);
        let here = bytes.len() / row_bytes;
        let (before, total) = self.share(here);
        let sum = self.sum_of_all(checksum(before as u64, row_bytes, bytes));
        let shape = shape_of(total, column.width);
        self.everywhere(|file| {
            let dataset = create_dataset(file, column.place, element, &shape)?;
            if !column.unit.is_empty() {
                attach_text(&dataset, "unit", column.unit)?;
            }
            attach_numbers(&dataset, CHECKSUM, &[sum])
        })?;
        if total == 0 {
            return Ok(());
        }
        if self.comm.mpi().is_some() {
            self.everywhere(|file| {
                let list = TransferList::collective()?;
                let dataset = file.dataset(column.place)?;
                transfer(&dataset, before..before + here, list.0, Buffer::Write(bytes))?;
                list.was_collective()
            })?;
            self.collective_writes += 1;
        } else {
            let gathered = match self.comm.size() {
                1 => None,
                _ => Some(self.comm.gather(bytes.to_vec()).unwrap_or_default().concat()),
            };
            let all = gathered.as_deref().unwrap_or(bytes);
            self.everywhere(|file| {
                let dataset = file.dataset(column.place)?;
                transfer(&dataset, 0..total, h5p::H5P_DEFAULT, Buffer::Write(all))
            })?;
        }
        self.writeback.as_ref().inspect(|file| start_writeback(file));
        Ok(())
    }

    /// Calls `act` on every rank that has the file open; all ranks fail if one fails.
    fn everywhere(
        &mut self,
        act: impl FnOnce(&File) -> hdf5_metno::Result<()>,
    ) -> Result<(), SnapshotError> {
        let done = self.file.as_ref().map_or(Ok(()), act);
        self.agree(done)
    }

    fn agree(&mut self, here: hdf5_metno::Result<()>) -> Result<(), SnapshotError> {
        let here = here.map_err(|e| SnapshotError::write(&self.path, self.comm, &e));
        agree(self.comm, here)
    }

    /// Number of rows of the ranks before this one, and of all ranks.
    pub(super) fn share(&mut self, here: usize) -> (usize, usize) {
        let rank = self.comm.rank().index();
        let mut rows = vec![0; self.comm.size() as usize];
        rows[rank] = here as i64;
        self.comm.sum(&mut rows);
        (rows[..rank].iter().sum::<i64>() as usize, rows.iter().sum::<i64>() as usize)
    }

    fn sum_of_all(&mut self, here: u64) -> u64 {
        add_up(self.comm, here)
    }
}

/// Access settings of snapshots opened for writing.
fn as_snapshots_are(
    access: &mut FileAccessBuilder,
    mpi: Option<mpi::ffi::MPI_Comm>,
) -> &mut FileAccessBuilder {
    access.libver_v18().fclose_degree(FileCloseDegree::Strong);
    match mpi {
        Some(comm) => access.mpio(comm, None).coll_metadata_write(true),
        None => access,
    }
}

fn shape_of(rows: usize, width: usize) -> Vec<usize> {
    if width == 1 { vec![rows] } else { vec![rows, width] }
}

/// Creates a contiguous dataset without fill values.
fn create_dataset(
    file: &File,
    place: &str,
    element: &TypeDescriptor,
    shape: &[usize],
) -> hdf5_metno::Result<Dataset> {
    let element = Datatype::from_descriptor(element)?;
    let space = Dataspace::try_new(shape)?;
    let create =
        DatasetCreate::build().obj_track_times(false).fill_time(FillTime::Never).finish()?;
    let name = CString::new(place).map_err(|e| e.to_string())?;
    let _lock = LOCK.lock();
    // SAFETY: all ids are alive; the new id is closed here and the dataset opened again by name.
    unsafe {
        let id = h5d::H5Dcreate2(
            file.id(),
            name.as_ptr(),
            element.id(),
            space.id(),
            h5p::H5P_DEFAULT,
            create.id(),
            h5p::H5P_DEFAULT,
        );
        check(id)?;
        check(h5d::H5Dclose(id))?;
    }
    file.dataset(place)
}

fn attach_numbers<T: Element>(to: &Location, name: &str, values: &[T]) -> hdf5_metno::Result<()> {
    let new = to.new_attr::<T>();
    match values {
        [one] => new.create(name)?.write_scalar(one),
        several => new.shape(several.len()).create(name)?.write_raw(several),
    }
}

/// The inverse of [`attach_numbers`], of exactly `N` numbers of exactly this type.
fn attached_numbers<T: Element, const N: usize>(
    to: &Location,
    name: &str,
) -> hdf5_metno::Result<[T; N]> {
    let attribute = to.attr(name)?;
    let (kind, space) = (attribute.dtype()?, attribute.space()?);
    let is_shaped = if N == 1 { space.is_scalar() } else { space.shape() == [N] };
    if !is_shaped || !is_of(&kind, &T::type_descriptor()) {
        return Err(format!("it is not {N} numbers of type {}", T::VTK).into());
    }
    let mut numbers = [T::zeroed(); N];
    attribute.read_into_raw(&mut numbers)?;
    Ok(numbers)
}

/// Longest text of an attribute that is read, such as a unit or the name of a format [bytes].
const LONGEST_NOTE: usize = 1 << 10;

/// The inverse of [`attach_text`].
fn attached_text(to: &Location, name: &str) -> hdf5_metno::Result<String> {
    let attribute = to.attr(name)?;
    let kind = attribute.dtype()?;
    if !(attribute.space()?.is_scalar() && is_text(&kind) && kind.size() <= LONGEST_NOTE) {
        return Err(format!("{name} is not one text of at most {LONGEST_NOTE} bytes").into());
    }
    let mut bytes = vec![0_u8; kind.size()];
    let _lock = LOCK.lock();
    // SAFETY: the attribute was found to be one element of this type, whose bytes are the text itself, and HDF5 writes one
    // element of the type of memory, which is the same and has the size of the room.
    check(unsafe { h5a::H5Aread(attribute.id(), kind.id(), bytes.as_mut_ptr().cast()) })?;
    Ok(String::from_utf8_lossy(&bytes).trim_end_matches('\0').to_owned())
}

/// True if the type in the file is the expected one, byte order included.
fn is_of(kind: &Datatype, expected: &TypeDescriptor) -> bool {
    Datatype::from_descriptor(expected).is_ok_and(|expected| *kind == expected)
}

/// True if the type in the file is that of the fixed-length texts written here.
fn is_text(kind: &Datatype) -> bool {
    let size = kind.size();
    [TypeDescriptor::FixedAscii(size), TypeDescriptor::FixedUnicode(size)]
        .iter()
        .any(|text| is_of(kind, text))
}

/// True if the type in the file is one of those written here. Their elements consist of their bytes alone and refer to no
/// other place.
fn is_known(kind: &Datatype) -> bool {
    let numbers = [
        f64::type_descriptor(),
        f32::type_descriptor(),
        u64::type_descriptor(),
        i64::type_descriptor(),
        i32::type_descriptor(),
        u16::type_descriptor(),
        u8::type_descriptor(),
    ];
    is_text(kind) || numbers.iter().any(|number| is_of(kind, number))
}

fn attach_text(to: &Location, name: &str, text: &str) -> hdf5_metno::Result<()> {
    // HDF5 has no text type of length zero.
    let text = if text.is_empty() { "\0" } else { text };
    let kind = if text.is_ascii() {
        TypeDescriptor::FixedAscii(text.len())
    } else {
        TypeDescriptor::FixedUnicode(text.len())
    };
    let attribute = to.new_attr_builder().empty_as(&kind).create(name)?;
    let kind = Datatype::from_descriptor(&kind)?;
    let _lock = LOCK.lock();
    // SAFETY: the attribute has the size of `text`.
    check(unsafe { h5a::H5Awrite(attribute.id(), kind.id(), text.as_ptr().cast()) }).map(drop)
}

/// Direction of a transfer, with its memory.
enum Buffer<'a> {
    Read(&'a mut [u8]),
    Write(&'a [u8]),
}

/// Moves rows between a dataset and memory, both of the dataset's type. An empty range is valid: by it a rank joins a
/// collective transfer.
fn transfer(
    dataset: &Dataset,
    rows: Range<usize>,
    list: hid_t,
    buffer: Buffer,
) -> hdf5_metno::Result<()> {
    let element = dataset.dtype()?;
    let in_file = dataset.space()?;
    let mut shape = dataset.shape();
    let Some(whole) = shape.first_mut() else { return Err("a scalar has no rows".into()) };
    let inside = rows.start <= rows.end && rows.end <= *whole;
    *whole = rows.len();
    let bytes = shape.iter().try_fold(element.size(), |bytes, &length| bytes.checked_mul(length));
    let room = match &buffer {
        Buffer::Read(to) => to.len(),
        Buffer::Write(from) => from.len(),
    };
    if !inside || bytes != Some(room) || !is_known(&element) {
        return Err("rows do not fit the dataset".into());
    }
    let in_memory = Dataspace::try_new(&shape[..])?;
    let mut start = vec![0; shape.len()];
    start[0] = rows.start as hsize_t;
    let count: Vec<hsize_t> = shape.iter().map(|&n| n as hsize_t).collect();
    let _lock = LOCK.lock();
    // SAFETY: all ids are alive; `start` and `count` have an entry per dimension; the buffer was found to
    // have the size of the selection, in elements of the dataset's own type, whose bytes are all that HDF5 moves.
    unsafe {
        if rows.is_empty() {
            check(h5s::H5Sselect_none(in_file.id()))?;
            check(h5s::H5Sselect_none(in_memory.id()))?;
        } else {
            check(h5s::H5Sselect_hyperslab(
                in_file.id(),
                h5s::H5S_SELECT_SET,
                start.as_ptr(),
                std::ptr::null(),
                count.as_ptr(),
                std::ptr::null(),
            ))?;
        }
        let (data, kind) = (dataset.id(), element.id());
        let (in_memory, in_file) = (in_memory.id(), in_file.id());
        check(match buffer {
            Buffer::Read(to) => {
                h5d::H5Dread(data, kind, in_memory, in_file, list, to.as_mut_ptr().cast())
            }
            Buffer::Write(from) => {
                h5d::H5Dwrite(data, kind, in_memory, in_file, list, from.as_ptr().cast())
            }
        })?;
    }
    Ok(())
}

/// Property list of a transfer; it holds the requested mode and afterwards the actual one.
struct TransferList(hid_t);

impl TransferList {
    /// A list that requests a collective transfer.
    fn collective() -> hdf5_metno::Result<Self> {
        let _lock = LOCK.lock();
        // SAFETY: the class exists once a file is open; the list is closed when dropped.
        unsafe {
            let list = Self(check(h5p::H5Pcreate(*h5p::H5P_CLS_DATASET_XFER))?);
            let mode = h5p::H5FD_mpio_xfer_t::H5FD_MPIO_COLLECTIVE;
            check(h5p::H5Pset_dxpl_mpio(list.0, mode))?;
            Ok(list)
        }
    }

    /// Error unless the transfer made with this list was collective.
    fn was_collective(&self) -> hdf5_metno::Result<()> {
        let mut mode = 0;
        let _lock = LOCK.lock();
        // SAFETY: the list is alive, and HDF5 writes one C int.
        check(unsafe { H5Pget_mpio_actual_io_mode(self.0, &raw mut mode) })?;
        if mode == CONTIGUOUS_COLLECTIVE {
            Ok(())
        } else {
            Err(format!("HDF5 did not write collectively (mode {mode})").into())
        }
    }
}

impl Drop for TransferList {
    fn drop(&mut self) {
        let _lock = LOCK.lock();
        // SAFETY: the list is alive and closed once.
        unsafe { h5p::H5Pclose(self.0) };
    }
}

/// The return value of an HDF5 call, or the error of HDF5.
fn check<T: Copy + Into<i64>>(answer: T) -> hdf5_metno::Result<T> {
    if answer.into() < 0 { Err(Error::query().unwrap_or_else(|e| e)) } else { Ok(answer) }
}

/// A file opened for reading by this rank alone.
pub struct StoredFile {
    path: PathBuf,
    file: File,
    /// Length of the file [bytes].
    size: u64,
    /// Paths of all datasets.
    places: Vec<String>,
}

impl StoredFile {
    /// Checks all bytes of a file, each rank a share, and opens it on every rank. Collective.
    ///
    /// # Errors
    /// On every rank alike: [`SnapshotError::Missing`], [`SnapshotError::Unreadable`] if it is truncated or was never
    /// complete, or [`SnapshotError::Damaged`] if a byte has changed.
    pub fn open(path: &Path, comm: &mut dyn Comm) -> Result<Self, SnapshotError> {
        let size = match fs::metadata(path) {
            Ok(metadata) if metadata.is_file() => Ok(metadata.len()),
            Ok(_) => Err(SnapshotError::unreadable(path, &"it is not a regular file")),
            Err(e) => Err(SnapshotError::Missing { path: name_of(path), cause: e.to_string() }),
        };
        let size = agree(comm, size)?;
        check_seal(path, comm)?;
        let opened = File::open(path).and_then(|file| {
            let mut places = Vec::new();
            list_datasets(&file, "", size, &mut places)?;
            Ok(Self { path: path.to_owned(), file, size, places })
        });
        agree(comm, opened.map_err(|e| SnapshotError::unreadable(path, &e)))
    }

    /// Path of the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Error: a column has another number of rows than it should.
    pub fn uneven(&self, column: &Column) -> SnapshotError {
        SnapshotError::unreadable(&self.path, &format!("{} has another length", column.place))
    }

    /// Error: the content of a group is invalid.
    pub fn damaged(&self, place: &str) -> SnapshotError {
        SnapshotError::damaged(&self.path, place)
    }

    /// True if the file has a dataset at this path.
    pub fn has(&self, place: &str) -> bool {
        self.places.iter().any(|other| other == place)
    }

    /// Names of the datasets of a group, in alphabetical order.
    ///
    /// # Errors
    /// [`SnapshotError::Unreadable`].
    pub fn members(&self, group: &str) -> Result<Vec<String>, SnapshotError> {
        let names = self.file.group(group).and_then(|group| group.member_names());
        let mut names = names.map_err(|e| self.wrong(&format!("{group}: {e}")))?;
        names.sort_unstable();
        Ok(names)
    }

    /// Number of elements in a row of a dataset, and their unit.
    ///
    /// # Errors
    /// [`SnapshotError::Unreadable`].
    pub fn width_and_unit(&self, place: &str) -> Result<(usize, String), SnapshotError> {
        let stored = self.stored(place)?;
        let unit = attached_text(&stored.dataset, "unit");
        Ok((stored.width, unit.map_err(|e| self.wrong(&format!("{place}: {e}")))?))
    }

    /// True if the group has an attribute of this name.
    pub fn has_attribute(&self, group: &str, name: &str) -> bool {
        self.file.group(group).is_ok_and(|group| group.attr(name).is_ok())
    }

    /// Number of rows of a dataset.
    ///
    /// # Errors
    /// [`SnapshotError::Unreadable`] if there is no such dataset.
    pub fn count(&self, place: &str) -> Result<usize, SnapshotError> {
        Ok(self.stored(place)?.rows)
    }

    /// Reads rows, one after the other. If all rows are requested, their checksum is verified.
    ///
    /// # Errors
    /// [`SnapshotError::Unreadable`], [`SnapshotError::Beyond`], [`SnapshotError::Damaged`].
    pub fn rows<T: Element>(
        &self,
        column: &Column,
        rows: Range<usize>,
    ) -> Result<Vec<T>, SnapshotError> {
        let stored = self.stored(column.place)?;
        if stored.width != column.width || !is_of(&stored.kind, &T::type_descriptor()) {
            return Err(self.wrong(&format!("{} has another type or width", column.place)));
        }
        if rows.start > rows.end || rows.end > stored.rows {
            return Err(SnapshotError::Beyond {
                path: name_of(&self.path),
                dataset: column.place.to_owned(),
                first: rows.start,
                end: rows.end,
                rows: stored.rows,
            });
        }
        let mut values = vec![T::zeroed(); rows.len() * column.width];
        self.fill(&stored, rows, bytemuck::cast_slice_mut(&mut values))?;
        Ok(values)
    }

    /// Reads a dataset of texts and verifies its checksum.
    ///
    /// # Errors
    /// [`SnapshotError::Unreadable`], [`SnapshotError::Damaged`].
    pub fn texts(&self, column: &Column) -> Result<Vec<String>, SnapshotError> {
        let stored = self.stored(column.place)?;
        if stored.width != 1 || !is_text(&stored.kind) {
            return Err(self.wrong(&format!("{} is not a list of texts", column.place)));
        }
        let mut bytes = vec![0; stored.rows * stored.row_bytes];
        self.fill(&stored, 0..stored.rows, &mut bytes)?;
        bytes
            .chunks_exact(stored.row_bytes)
            .map(|text| {
                let end = text.iter().rposition(|&b| b != 0).map_or(0, |last| last + 1);
                let text = std::str::from_utf8(&text[..end]);
                text.map(str::to_owned).map_err(|e| self.wrong(&format!("{}: {e}", column.place)))
            })
            .collect()
    }

    /// Reads all datasets of a group, of any type, in alphabetical order.
    ///
    /// # Errors
    /// [`SnapshotError::Unreadable`], [`SnapshotError::Damaged`].
    pub fn saved(&self, group: &str) -> Result<Vec<SavedColumn>, SnapshotError> {
        let read = |name: String| {
            let place = &*format!("{group}/{name}");
            let Stored { dataset, rows, width, kind, .. } = self.stored(place)?;
            let unit = if dataset.attr("unit").is_ok() {
                attached_text(&dataset, "unit").map_err(|e| self.wrong(&format!("{place}: {e}")))?
            } else {
                String::new()
            };
            let column = Column { place, width, unit: &unit };
            let values = if is_text(&kind) {
                Values::Texts(self.texts(&column)?)
            } else if is_of(&kind, &f64::type_descriptor()) {
                Values::Reals(self.rows(&column, 0..rows)?)
            } else if is_of(&kind, &i64::type_descriptor()) {
                Values::Integers(self.rows(&column, 0..rows)?)
            } else {
                Values::Counts(self.rows(&column, 0..rows)?)
            };
            let column = StateColumn { name: name.into(), unit: unit.into(), width };
            Ok(SavedColumn::new(column, values))
        };
        self.members(group)?.into_iter().map(read).collect()
    }

    /// Reads an attribute of `N` numbers.
    ///
    /// # Errors
    /// [`SnapshotError::Unreadable`].
    pub fn numbers<T: Element, const N: usize>(
        &self,
        group: &str,
        name: &str,
    ) -> Result<[T; N], SnapshotError> {
        let values = self.file.group(group).and_then(|group| attached_numbers(&group, name));
        values.map_err(|e| self.wrong(&format!("{group}, {name}: {e}")))
    }

    /// Verifies the checksum of every dataset, each rank of `comm` on a share of the rows. Every rank must have opened the
    /// file; all ranks get the same result.
    ///
    /// # Errors
    /// [`SnapshotError::Damaged`] with the first dataset that has changed, or
    /// [`SnapshotError::Unreadable`].
    pub fn verify(&self, comm: &mut dyn Comm) -> Result<(), SnapshotError> {
        let checksums = agree(comm, self.checksums())?;
        for (place, expected) in checksums {
            let (rank, ranks) = (comm.rank().index(), comm.size() as usize);
            let checked = self.stored(&place).and_then(|stored| {
                let rows = stored.rows * rank / ranks..stored.rows * (rank + 1) / ranks;
                self.sum_of(&stored, rows)
            });
            let here = agree(comm, checked)?;
            let same = add_up(comm, here) == expected;
            agree(
                comm,
                if same { Ok(()) } else { Err(SnapshotError::damaged(&self.path, &place)) },
            )?;
        }
        Ok(())
    }

    /// Paths of all datasets, with the stored checksums of their rows.
    ///
    /// # Errors
    /// [`SnapshotError::Unreadable`].
    pub fn checksums(&self) -> Result<BTreeMap<String, u64>, SnapshotError> {
        let checksum = |place: &String| {
            let expected = self.expected(&self.stored(place)?)?;
            Ok((place.clone(), expected))
        };
        self.places.iter().map(checksum).collect()
    }

    fn stored(&self, place: &str) -> Result<Stored, SnapshotError> {
        let dataset = self.file.dataset(place).map_err(|e| self.wrong(&format!("{place}: {e}")))?;
        let (rows, width) = match dataset.shape()[..] {
            [rows] => (rows, 1),
            [rows, width] => (rows, width),
            _ => return Err(self.wrong(&format!("{place} is not a list of rows"))),
        };
        let kind = dataset.dtype().map_err(|e| self.wrong(&format!("{place}: {e}")))?;
        if !is_known(&kind) {
            return Err(self.wrong(&format!("{place} has elements of an unknown type")));
        }
        let row_bytes = kind.size().saturating_mul(width);
        let bytes = row_bytes.checked_mul(rows).filter(|&b| b as u64 <= self.size);
        if row_bytes == 0 || bytes.is_none() {
            return Err(self.wrong(&format!("{place} claims more rows than the file holds")));
        }
        // Chunked rows may be compressed, and rows of other layouts may come from any other file.
        let create = dataset.create_plist().map_err(|e| self.wrong(&format!("{place}: {e}")))?;
        let external = create.get_external().map_or(1, |files| files.len());
        if external > 0 || !create.get_layout().is_ok_and(|layout| layout == Layout::Contiguous) {
            return Err(self.wrong(&format!("{place} does not stand in the file in one piece")));
        }
        Ok(Stored { dataset, place: place.to_owned(), rows, width, row_bytes, kind })
    }

    /// Reads rows into `bytes`; verifies the checksum if they are all rows.
    fn fill(
        &self,
        stored: &Stored,
        rows: Range<usize>,
        bytes: &mut [u8],
    ) -> Result<(), SnapshotError> {
        let whole = rows.len() == stored.rows;
        if !rows.is_empty() {
            transfer(&stored.dataset, rows, h5p::H5P_DEFAULT, Buffer::Read(bytes))
                .map_err(|e| self.wrong(&format!("{}: {e}", stored.place)))?;
        }
        if whole && checksum(0, stored.row_bytes, bytes) != self.expected(stored)? {
            return Err(SnapshotError::damaged(&self.path, &stored.place));
        }
        Ok(())
    }

    fn sum_of(&self, stored: &Stored, rows: Range<usize>) -> Result<u64, SnapshotError> {
        let step = (PIECE / stored.row_bytes).max(1);
        let mut sum = 0u64;
        for first in rows.clone().step_by(step) {
            let piece = first..(first + step).min(rows.end);
            let mut bytes = vec![0; piece.len() * stored.row_bytes];
            transfer(&stored.dataset, piece, h5p::H5P_DEFAULT, Buffer::Read(&mut bytes))
                .map_err(|e| self.wrong(&format!("{}: {e}", stored.place)))?;
            sum = sum.wrapping_add(checksum(first as u64, stored.row_bytes, &bytes));
        }
        Ok(sum)
    }

    fn expected(&self, stored: &Stored) -> Result<u64, SnapshotError> {
        attached_numbers(&stored.dataset, CHECKSUM)
            .map(|[sum]| sum)
            .map_err(|e| self.wrong(&format!("{} has no checksum: {e}", stored.place)))
    }

    fn wrong(&self, cause: &str) -> SnapshotError {
        SnapshotError::unreadable(&self.path, &cause)
    }
}

/// Largest depth of nested groups below the root: `/VTKHDF/PointData`.
const GROUPS_DEEP: usize = 2;

/// Fewest bytes of an object in a file: its header and the link to it.
const OBJECT: u64 = 32;

/// Adds the paths of all datasets of a group and of its subgroups. A file with soft or external links is rejected: a link that
/// is followed may lead anywhere. The limits on depth and number stop circular hard links.
fn list_datasets(
    group: &Group,
    place: &str,
    size: u64,
    places: &mut Vec<String>,
) -> hdf5_metno::Result<()> {
    let (mut groups, mut links) = (Vec::new(), 0);
    for (name, link) in group.links(IndexType::Name, IterationOrder::Native)? {
        let place = format!("{place}/{name}");
        if link.link_type != LinkType::Hard {
            return Err(format!("{place} is a link to another place").into());
        }
        match group.loc_type_by_name(&name)? {
            LocationType::Dataset => places.push(place),
            LocationType::Group => groups.push((name, place)),
            LocationType::NamedDatatype => {}
        }
        links += 1;
    }
    if (places.len() as u64).max(links) > size / OBJECT {
        return Err("it claims more datasets than it holds".into());
    }
    for (name, place) in groups {
        if place.matches('/').count() > GROUPS_DEEP {
            return Err(format!("groups are nested too deep: {place}").into());
        }
        list_datasets(&group.group(&name)?, &place, size, places)?;
    }
    Ok(())
}

/// A dataset of a file, with its stored layout.
struct Stored {
    dataset: Dataset,
    place: String,
    rows: usize,
    width: usize,
    row_bytes: usize,
    kind: Datatype,
}

/// Rows of a file whose columns have `total` rows.
pub struct Piece<'a> {
    /// The file.
    pub file: &'a StoredFile,
    /// Number of rows of each column.
    pub total: usize,
    /// The range of rows.
    pub rows: Range<usize>,
}

impl Piece<'_> {
    /// True if the file has a dataset at this path.
    pub fn has(&self, place: &str) -> bool {
        self.file.has(place)
    }

    /// Elements of these rows in a column.
    ///
    /// # Errors
    /// [`SnapshotError::Unreadable`] if the column has another length; see also [`StoredFile::rows`].
    pub fn read<T: Element>(&self, column: &Column) -> Result<Vec<T>, SnapshotError> {
        if self.file.count(column.place)? != self.total {
            return Err(self.file.uneven(column));
        }
        self.file.rows(column, self.rows.clone())
    }
}
