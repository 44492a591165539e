//! Results that stay equal from commit to commit, bit for bit: `tests/kept.txt` has a hash of each.
//!
//! A commit that moves them says which rounding moved and why, and renews the rows:
//! `DEM_KEPT=write cargo test --test main`. Rows of results that no test has any more stay until the file is removed before.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// Hashes by result.
type Kept = BTreeMap<String, u64>;

/// Results of this process that were written.
static WRITTEN: Mutex<Kept> = Mutex::new(Kept::new());

/// Hash of Fowler, Noll and Vo (FNV-1a, 64 bits), the same on every machine.
pub(crate) fn hash(bytes: &[u8]) -> u64 {
    let mix = |hash: u64, byte: &u8| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, mix)
}

fn file() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/kept.txt")
}

fn read() -> Kept {
    let text = fs::read_to_string(file()).unwrap_or_default();
    let row = |line: &str| {
        let (hash, name) = line.split_once(' ').expect("a hash and a name");
        (name.to_owned(), u64::from_str_radix(hash, 16).expect("a hash"))
    };
    text.lines().map(row).collect()
}

/// Panics unless a result has the hash that is kept under its name.
pub(crate) fn expect(name: &str, hash: u64) {
    if std::env::var("DEM_KEPT").is_ok_and(|what| what == "write") {
        let mut written = WRITTEN.lock().unwrap();
        let before = written.insert(name.to_owned(), hash);
        assert!(before.is_none_or(|before| before == hash), "two results are called {name}");
        let mut kept = read();
        kept.extend(written.clone());
        let mut text = String::new();
        for (name, hash) in &kept {
            writeln!(text, "{hash:016x} {name}").unwrap();
        }
        fs::write(file(), text).unwrap();
        return;
    }
    let kept = read().get(name).copied();
    assert!(
        kept == Some(hash),
        "{name}: {hash:016x}, but tests/kept.txt has {kept:016x?}; see tests/support/kept.rs"
    );
}
