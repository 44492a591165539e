//! Integrity of a file: checksums, the seal behind its content, and reserved space on the disk.

#![expect(unsafe_code, reason = "to reserve room and to begin to write have no safe wrapper")]

use super::SnapshotError;
use crate::comm::{Comm, agree};
use std::io::{Read, Seek, SeekFrom, Write};
use std::ops::Range;
use std::os::fd::AsRawFd;
use std::path::Path;
use std::{fs, io};

/// Rows are read and checked in pieces of about this size [bytes].
pub(super) const PIECE: usize = 4 << 20;

/// The whole file is summed in rows of this size [bytes]. They are short, so that a processor sums several at a time.
const BLOCK: usize = 64;

/// Last bytes of a complete file. They follow the length of the HDF5 file and the checksum of its bytes, each 64 bits,
/// little-endian.
const END: &[u8; 16] = b"\ndem-mpi: whole\n";

/// Size of the seal behind the HDF5 file [bytes].
const SEAL: u64 = 16 + END.len() as u64;

/// Position of the file length in the format of HDF5 1.8.
const END_OF_FILE: Range<usize> = 28..36;

/// Checksum of consecutive rows, the first of which is row `first` of the whole dataset.
///
/// The hash of a row starts from its index. For each of its 64-bit words (little-endian, the last one filled with
/// zeros) `h = (h ^ word) * K, h ^= h >> 32`. Every step is invertible, so that a change of one word always changes the
/// hash. The checksum is the sum of all hashes, modulo 2⁶⁴: ranks and readers can sum rows in any order.
pub fn checksum(first: u64, row_bytes: usize, rows: &[u8]) -> u64 {
    const K: u64 = 0x9e37_79b9_7f4a_7c15; // 2⁶⁴ over the golden ratio, odd
    let step = |hash: u64, word: u64| {
        let product = (hash ^ word).wrapping_mul(K);
        product ^ (product >> 32)
    };
    let hash = |index: u64, row: &[u8]| {
        let (words, rest) = row.as_chunks::<8>();
        let mut hash = step(K, index);
        for word in words {
            hash = step(hash, u64::from_le_bytes(*word));
        }
        if !rest.is_empty() {
            let mut word = [0; 8];
            word[..rest.len()].copy_from_slice(rest);
            hash = step(hash, u64::from_le_bytes(word));
        }
        step(hash, 0)
    };
    (first..)
        .zip(rows.chunks_exact(row_bytes))
        .fold(0, |sum, (index, row)| sum.wrapping_add(hash(index, row)))
}

/// Sum of a number over all ranks, modulo 2⁶⁴.
pub(super) fn add_up(comm: &mut dyn Comm, here: u64) -> u64 {
    // In halves: the sum of whole numbers would overflow.
    let mut halves = [(here & 0xffff_ffff) as i64, (here >> 32) as i64];
    comm.sum(&mut halves);
    (halves[0] as u64).wrapping_add((halves[1] as u64) << 32)
}

/// Reserves space for a file from its beginning. Where the file system cannot reserve blocks, zeros are appended
/// instead.
pub(super) fn reserve(mut file: &fs::File, bytes: u64) -> io::Result<()> {
    let length = i64::try_from(bytes).map_err(io::Error::other)?;
    if bytes > largest_file() {
        // HDF5 could not close a file beyond the limit.
        return Err(io::Error::from_raw_os_error(libc::EFBIG));
    }
    // SAFETY: the descriptor is open.
    let answer = unsafe { libc::fallocate(file.as_raw_fd(), libc::FALLOC_FL_KEEP_SIZE, 0, length) };
    let error = io::Error::last_os_error();
    match error.raw_os_error() {
        _ if answer == 0 => Ok(()),
        Some(libc::EOPNOTSUPP | libc::ENOSYS) => {
            let there = file.seek(SeekFrom::End(0))?;
            io::copy(&mut io::repeat(0).take(bytes.saturating_sub(there)), &mut file)?;
            // Some file systems detect a full disk only now.
            file.sync_all()
        }
        _ => Err(error),
    }
}

/// Largest allowed file size of the user, `ulimit -f` [bytes].
fn largest_file() -> u64 {
    let mut limit = libc::rlimit { rlim_cur: libc::RLIM_INFINITY, rlim_max: libc::RLIM_INFINITY };
    // SAFETY: the system fills one limit, which is there.
    unsafe { libc::getrlimit(libc::RLIMIT_FSIZE, &raw mut limit) };
    limit.rlim_cur
}

/// Starts the transfer to the disk of what was written so far, while the next dataset is made. `close` waits for all of
/// it and then has less to wait for. Where this is impossible, only time is lost.
pub(super) fn start_writeback(file: &fs::File) {
    // SAFETY: the descriptor is open.
    unsafe { libc::sync_file_range(file.as_raw_fd(), 0, 0, libc::SYNC_FILE_RANGE_WRITE) };
}

/// Frees the space reserved beyond the end of a closed HDF5 file. Returns the length of the file [bytes].
pub(super) fn trim(path: &Path) -> io::Result<u64> {
    let mut file = fs::File::options().read(true).write(true).open(path)?;
    let mut start = [0; END_OF_FILE.end];
    file.read_exact(&mut start)?;
    let mut length = [0; 8];
    length.copy_from_slice(&start[END_OF_FILE]);
    let length = u64::from_le_bytes(length);
    if file.metadata()?.len() < length {
        return Err(io::Error::other("HDF5 did not write the whole file"));
    }
    file.set_len(length)?;
    Ok(length)
}

/// Appends the seal of a complete file, and waits until all of it is on the disk.
pub(super) fn seal(path: &Path, length: u64, sum: u64) -> io::Result<()> {
    let mut file = fs::File::options().append(true).open(path)?;
    file.write_all(&[&length.to_le_bytes()[..], &sum.to_le_bytes(), END].concat())?;
    file.sync_all()
}

/// Checks a file against its seal, each rank a share; all get the same result.
pub(super) fn check_seal(path: &Path, comm: &mut dyn Comm) -> Result<(), SnapshotError> {
    let unreadable = |cause: &str| SnapshotError::unreadable(path, &cause);
    let read = || {
        let mut file = fs::File::open(path).map_err(|e| unreadable(&e.to_string()))?;
        let size = file.metadata().map_err(|e| unreadable(&e.to_string()))?.len();
        let mut seal = [0; SEAL as usize];
        let sealed = size >= SEAL
            && file.seek(SeekFrom::End(-(SEAL as i64))).is_ok()
            && file.read_exact(&mut seal).is_ok()
            && seal.ends_with(END);
        let (numbers, _) = seal.as_chunks::<8>();
        let [length, sum] = [numbers[0], numbers[1]].map(u64::from_le_bytes);
        if !sealed {
            return Err(unreadable("it does not end as a complete snapshot does"));
        }
        if length != size - SEAL {
            return Err(unreadable(&format!("it has {size} bytes, not {length} and {SEAL}")));
        }
        let here = sum_of_file(path, length, comm).map_err(|e| unreadable(&e.to_string()))?;
        Ok((here, sum))
    };
    let read = read();
    let (here, sum) = agree(comm, read)?;
    let same = add_up(comm, here) == sum;
    agree(comm, if same { Ok(()) } else { Err(SnapshotError::damaged(path, "the whole file")) })
}

/// Checksum of this rank's share of the first `length` bytes of a file.
pub(super) fn sum_of_file(path: &Path, length: u64, comm: &dyn Comm) -> io::Result<u64> {
    let (rank, ranks) = (u64::from(comm.rank().0), u64::from(comm.size()));
    let blocks = length.div_ceil(BLOCK as u64);
    let [first, end] = [rank, rank + 1].map(|r| (blocks * r / ranks * BLOCK as u64).min(length));
    let mut file = fs::File::open(path)?;
    let mut sum = 0u64;
    let mut piece = vec![0; PIECE.min((end - first) as usize)];
    let mut at = file.seek(SeekFrom::Start(first))?;
    while at < end {
        let piece = &mut piece[..PIECE.min((end - at) as usize)];
        file.read_exact(piece)?;
        let block = at / BLOCK as u64;
        let (blocks, rest) = piece.split_at(piece.len() / BLOCK * BLOCK);
        sum = sum.wrapping_add(checksum(block, BLOCK, blocks));
        if !rest.is_empty() {
            let last = block + (blocks.len() / BLOCK) as u64;
            sum = sum.wrapping_add(checksum(last, rest.len(), rest));
        }
        at += piece.len() as u64;
    }
    Ok(sum)
}
