//! Text from files and to terminals: encodings, line numbers, values in messages.

use crate::files;
use std::borrow::Cow;
use std::fmt::{self, Display};
use std::io::Write;
use std::path::Path;

// --- from files ---

/// Reason why a file gives no text.
#[derive(Debug, thiserror::Error)]
pub enum Unreadable {
    /// The system cannot read it.
    #[error("cannot be read: {0}")]
    File(std::io::Error),
    /// The file is not UTF-8.
    #[error("line {line}: the byte 0x{byte:02x} is not UTF-8; save the file as UTF-8")]
    Encoding {
        /// Line number, from 1.
        line: usize,
        /// First invalid byte.
        byte: u8,
    },
    /// The file has the mark of UTF-16, but is damaged.
    #[error("is damaged UTF-16; save the file as UTF-8")]
    Utf16,
    /// A binary file, or UTF-16 without a mark.
    #[error(
        "line {0}: has the character NUL, as in binary files and UTF-16 without a byte order mark; save the file as \
         UTF-8 text"
    )]
    Nul(usize),
}

// Without a source, because the message already contains its words.
impl From<std::io::Error> for Unreadable {
    fn from(error: std::io::Error) -> Self {
        Self::File(error)
    }
}

/// Reads the bytes of a regular file.
///
/// # Errors
/// If there is no such file.
pub fn bytes(path: &Path) -> Result<Vec<u8>, Unreadable> {
    Ok(files::read(path)?)
}

/// Reads the text of a regular file.
///
/// # Errors
/// If there is no such file, or its content is not text.
pub fn read(path: &Path) -> Result<String, Unreadable> {
    decode(bytes(path)?)
}

/// Decodes UTF-8, or UTF-16 with a byte order mark. The mark is removed, and a carriage return alone ends a line.
///
/// # Errors
/// If the bytes have another encoding.
pub fn decode(bytes: Vec<u8>) -> Result<String, Unreadable> {
    let text = match utf16(&bytes) {
        Some(text) => text.map_err(|_| Unreadable::Utf16)?,
        None => String::from_utf8(bytes).map_err(|error| {
            let (at, bytes) = (error.utf8_error().valid_up_to(), error.as_bytes());
            let breaks = bytes[..at].split(|&byte| byte == b'\n').count() - 1;
            Unreadable::Encoding { line: 1 + breaks, byte: bytes[at] }
        })?,
    };
    if let Some(at) = text.find('\0') {
        return Err(Unreadable::Nul(Lines::of(&text).at(at)));
    }
    Ok(tidy(text))
}

/// Largest number of user-defined names in a message.
pub const MOST_NAMED: usize = 20;

/// Names with commas between them, up to `most`; the others are counted.
pub fn listed<T: AsRef<str>>(names: impl IntoIterator<Item = T>, most: usize) -> String {
    let mut names = names.into_iter();
    let mut list = String::new();
    for (name, place) in names.by_ref().take(most).zip(0..) {
        list.extend([if place > 0 { ", " } else { "" }, name.as_ref()]);
    }
    match names.count() {
        0 => list,
        more => format!("{list} and {more} more"),
    }
}

/// A number of things: `1 rank`, `2 ranks`.
pub fn counted(count: impl Into<u64>, noun: &str) -> String {
    let count = count.into();
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}

/// Same as [`decode`], with U+FFFD for invalid text, for files whose names and comments do not matter.
pub fn lossy(bytes: &[u8]) -> String {
    tidy(match utf16(bytes) {
        Some(Ok(text)) => text,
        _ => String::from_utf8_lossy(bytes).into_owned(),
    })
}

/// Decodes UTF-16; `None` without its mark.
fn utf16(bytes: &[u8]) -> Option<Result<String, std::string::FromUtf16Error>> {
    let (unit, rest): (fn([u8; 2]) -> u16, _) = match bytes {
        [0xff, 0xfe, rest @ ..] => (u16::from_le_bytes, rest),
        [0xfe, 0xff, rest @ ..] => (u16::from_be_bytes, rest),
        _ => return None,
    };
    // Half a unit at the end is not a character.
    let cut = (rest.len() % 2 == 1).then_some(0xd800);
    let units: Vec<u16> =
        rest.chunks_exact(2).map(|two| unit([two[0], two[1]])).chain(cut).collect();
    Some(String::from_utf16(&units))
}

fn tidy(mut text: String) -> String {
    if text.starts_with('\u{feff}') {
        text.drain(..'\u{feff}'.len_utf8());
    }
    let alone = |(at, _): (usize, &str)| text.as_bytes().get(at + 1) != Some(&b'\n');
    if text.match_indices('\r').any(alone) {
        text = text.replace("\r\n", "\n").replace('\r', "\n");
    }
    text
}

/// Begins of the lines of a text [bytes].
#[derive(Clone, Debug)]
pub struct Lines(Vec<usize>);

impl Lines {
    /// Finds the lines in one pass over the text.
    pub fn of(text: &str) -> Self {
        Self([0].into_iter().chain(text.match_indices('\n').map(|(at, _)| at + 1)).collect())
    }

    /// Line of a byte, from 1.
    pub fn at(&self, byte: usize) -> usize {
        self.0.partition_point(|&begin| begin <= byte)
    }
}

// --- to terminals ---

/// Largest number of characters of a value in a message.
const LONGEST: usize = 200;

/// Whether a terminal obeys a character, or changes the direction of text by it.
fn is_obeyed(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// Text for a terminal, without control characters except line ends and tabs: others are written as `\u{1b}`.
pub fn printable(text: &str) -> Cow<'_, str> {
    let is_shown = |c: char| !is_obeyed(c) || matches!(c, '\n' | '\t');
    if text.chars().all(is_shown) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::new();
    for c in text.chars() {
        if is_shown(c) { shown.push(c) } else { shown.extend(c.escape_default()) }
    }
    Cow::Owned(shown)
}

/// Prints to standard error, as by [`printable`] and in one piece, so that output of other programs cannot come between.
///
/// A closed standard error is ignored.
pub fn print_error(text: impl Display) {
    let text = format!("{text}\n");
    let _ = std::io::stderr().write_all(printable(&text).as_bytes());
}

/// A value in a message: on one line, as by [`printable`], and at most 200 characters of it.
pub fn shown(value: impl Display) -> String {
    let mut short = Short { text: String::new(), left: LONGEST };
    // The rest of a long value is not written.
    let _ = fmt::Write::write_fmt(&mut short, format_args!("{value}"));
    short.text
}

struct Short {
    text: String,
    left: usize,
}

impl fmt::Write for Short {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for c in text.chars() {
            if self.left == 0 {
                self.text.push_str("...");
                return Err(fmt::Error);
            }
            self.left -= 1;
            if is_obeyed(c) { self.text.extend(c.escape_default()) } else { self.text.push(c) }
        }
        Ok(())
    }
}
