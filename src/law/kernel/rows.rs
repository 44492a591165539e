//! Conversion between the state values of contacts and eight lanes.

use super::MOST_STATE_OF_MOMENTS;
use super::patches::Memory;
use crate::contact::{Geometry, Previous};
use crate::lanes::{Eight, Row, WIDTH};
use crate::math::Vec3;

/// Geometry of a contact that did not touch at the last step.
static NEW: Geometry = Geometry { normal: Vec3::new(0.0, 0.0, 0.0), overlap: 0.0 };
static NO_STATE: [f64; MOST_STATE_OF_MOMENTS + Memory::WIDTH] =
    [0.0; MOST_STATE_OF_MOMENTS + Memory::WIDTH];

/// Reads the state of eight consecutive contacts, column by column. It needs one bounds check where [`read_state`] checks
/// each row, with which a packing's forces take up to a third longer.
#[inline(always)]
pub(super) fn read_states_in_a_row<L: Eight>(all: &[f64], start: usize, columns: &mut [L]) {
    if let Ok(columns) = <&mut [L; 4]>::try_from(&mut *columns) {
        *columns = L::columns_of_4(&eight_rows(all.as_chunks().0, start));
    } else if let [column] = columns {
        // Values stored one by one would have to reach memory before they could be loaded as eight.
        *column = L::load(all[start..].first_chunk().expect("eight numbers"));
    } else {
        read_state(&rows_of(all, columns.len(), start), columns);
    }
}

/// Reads the state of eight contacts, column by column. Columns are read four at a time, which is faster than one by one;
/// the last four may overlap those before.
#[inline(always)]
pub(super) fn read_state<L: Eight>(rows: &[&[f64]; WIDTH], columns: &mut [L]) {
    let width = columns.len();
    if width >= 4 {
        let mut at = 0;
        loop {
            let four = pieces::<4>(rows, at).expect("rows are as wide as columns");
            columns[at..at + 4].copy_from_slice(&L::columns_of_4(&four));
            if at + 4 >= width {
                return;
            }
            at = (at + 4).min(width - 4);
        }
    }
    if width == 3 {
        let three = pieces::<3>(rows, 0).expect("rows are as wide as columns");
        columns.copy_from_slice(&L::columns_of_3(&three));
        return;
    }
    for (at, column) in columns.iter_mut().enumerate() {
        let mut numbers = [0.0; WIDTH];
        for (number, row) in numbers.iter_mut().zip(rows) {
            *number = row[at];
        }
        *column = L::load(&numbers);
    }
}

/// `N` values of each row from `at` on; `None` if rows are too short.
#[inline(always)]
pub(super) fn pieces<'a, const N: usize>(
    rows: &[&'a [f64]; WIDTH],
    at: usize,
) -> Option<[&'a [f64; N]; WIDTH]> {
    let mut pieces = [rows[0].get(at..)?.first_chunk::<N>()?; WIDTH];
    for (piece, row) in pieces.iter_mut().zip(rows) {
        *piece = row.get(at..)?.first_chunk::<N>()?;
    }
    Some(pieces)
}

/// Writes the state of the first `count` of eight contacts, in the layout of [`read_state`].
#[inline(always)]
pub(super) fn write_state<L: Eight>(
    all: &mut [f64],
    width: usize,
    first: usize,
    count: usize,
    columns: &[L],
) {
    let rows = &mut all[first * width..(first + count) * width];
    if let Ok(columns) = <&[L; 4]>::try_from(columns) {
        let block = L::rows_of_4(*columns);
        for (row, numbers) in rows.as_chunks_mut().0.iter_mut().zip(&block) {
            numbers.write(row);
        }
        return;
    }
    if let ([column], Ok(eight)) = (columns, <&mut [f64; WIDTH]>::try_from(&mut *rows)) {
        *eight = column.store();
        return;
    }
    if width > 4 {
        let mut at = 0;
        loop {
            let four = columns[at..].first_chunk().expect("four columns");
            let block = L::rows_of_4(*four);
            for (row, numbers) in rows.chunks_exact_mut(width).zip(&block) {
                numbers.write(row[at..].first_chunk_mut().expect("rows are as wide as columns"));
            }
            if at + 4 >= width {
                return;
            }
            at = (at + 4).min(width - 4);
        }
    }
    for (at, column) in columns.iter().enumerate() {
        for (row, number) in rows.chunks_exact_mut(width).zip(column.store()) {
            row[at] = number;
        }
    }
}

/// Writes the first three values of eight rows. The fourth of each is overwritten by the next row, which takes fewer
/// instructions than writing three.
#[inline(always)]
pub(super) fn write_threes<R: Row>(all: &mut [Vec3], rows: &[R; WIDTH]) {
    let eight = all.first_chunk_mut::<WIDTH>().expect("eight places");
    let numbers: &mut [f64] = bytemuck::cast_slice_mut(eight);
    let [rows @ .., last] = rows;
    for (row, place) in rows.iter().zip(0..) {
        row.write(numbers[3 * place..].first_chunk_mut().expect("a row follows"));
    }
    eight[WIDTH - 1] = last.first_three().into();
}

/// Rows of eight consecutive contacts.
#[inline(always)]
fn rows_of(all: &[f64], width: usize, start: usize) -> [&[f64]; WIDTH] {
    let eight = &all[start * width..][..WIDTH * width];
    let mut rows = [&eight[..width]; WIDTH];
    for (lane, row) in rows.iter_mut().enumerate() {
        *row = &eight[lane * width..][..width];
    }
    rows
}

/// Rows of eight contacts at any places; zeros for those without a place.
#[inline(always)]
pub(super) fn rows_at<'a>(
    all: &'a [f64],
    width: usize,
    places: &[Previous; WIDTH],
) -> [&'a [f64]; WIDTH] {
    let mut rows = [&NO_STATE[..width]; WIDTH];
    for (row, place) in rows.iter_mut().zip(places) {
        if *place != Previous::NONE {
            *row = &all[place.index() * width..][..width];
        }
    }
    rows
}

/// Geometries of contacts at the last step; zero for those that did not touch.
#[inline(always)]
pub(super) fn geometries_at<'a>(
    all: &'a [Geometry],
    places: &[Previous; WIDTH],
) -> [&'a Geometry; WIDTH] {
    let mut rows = [&NEW; WIDTH];
    for (row, place) in rows.iter_mut().zip(places) {
        *row = all.get(place.index()).unwrap_or(&NEW);
    }
    rows
}

/// Eight rows from a place on.
#[inline(always)]
pub(super) fn eight_rows<T>(all: &[T], first: usize) -> [&T; WIDTH] {
    let [a, b, c, d, e, f, g, h] = &all[first..][..WIDTH] else { unreachable!("eight are eight") };
    [a, b, c, d, e, f, g, h]
}

/// Eight rows from a place on; if there are fewer, the last one repeats.
#[inline(always)]
pub(super) fn eight_from_rows<T>(all: &[T], first: usize, count: usize) -> [&T; WIDTH] {
    if count == WIDTH {
        return eight_rows(all, first);
    }
    let mut rows = [&all[first]; WIDTH];
    for (lane, row) in rows.iter_mut().enumerate() {
        *row = &all[first + lane.min(count - 1)];
    }
    rows
}

/// Eight values from a place on; if there are fewer, the last one repeats.
#[inline(always)]
fn eight_from<T: Copy>(all: &[T], first: usize, count: usize) -> [T; WIDTH] {
    if let Some(eight) = all[first..].first_chunk::<WIDTH>() {
        return *eight;
    }
    let mut eight = [all[first]; WIDTH];
    for (lane, one) in eight.iter_mut().enumerate() {
        *one = all[first + lane.min(count - 1)];
    }
    eight
}

/// Place of the first of eight contacts at the last step, if all touched and stood in the same order.
#[inline(always)]
pub(super) fn stood_in_a_row(from: &[Previous], first: usize, count: usize) -> Option<usize> {
    if from.is_empty() {
        return if count == WIDTH { Some(first) } else { None };
    }
    let places = from[first..].first_chunk::<WIDTH>()?;
    let start = places[0].index();
    let mut in_a_row = true;
    for (lane, place) in places.iter().enumerate() {
        in_a_row &= place.index() == start + lane;
    }
    if in_a_row { Some(start) } else { None }
}

/// Places of up to eight contacts at the last step.
#[inline(always)]
pub(super) fn places_before(from: &[Previous], first: usize, count: usize) -> [Previous; WIDTH] {
    if !from.is_empty() {
        return eight_from(from, first, count);
    }
    let mut places = [Previous::NONE; WIDTH];
    for (lane, place) in places.iter_mut().enumerate() {
        *place = Previous::at(first + lane.min(count - 1));
    }
    places
}
