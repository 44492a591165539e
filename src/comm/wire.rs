//! Wire format of irregular and rare data: the scene, migrating particles. (The halo of every step is plain packed `f64`.)
//!
//! Only these two functions use bincode, so that it can be replaced. Its last release that compiles, 2.0.1, is pinned; it
//! is no longer maintained (RUSTSEC-2025-0141). It reads no files: the bytes come from a rank of the same run, and lengths
//! in them are bounded nevertheless.

use bincode::config::standard;
use serde::{Serialize, de::DeserializeOwned};

/// Longest message [bytes]: a larger length is rejected before memory is allocated for it.
const LONGEST: usize = 1 << 36;

/// A value as bytes.
///
/// # Panics
/// Never for the plain data that ranks exchange.
pub fn encode<T: Serialize>(value: &T) -> Vec<u8> {
    bincode::serde::encode_to_vec(value, standard())
        .expect("plain data has no way to fail to encode")
}

/// The value of bytes made by [`encode`] on a rank of the same run.
///
/// # Panics
/// If the bytes are of something else: the ranks are out of step.
pub fn decode<T: DeserializeOwned>(bytes: &[u8]) -> T {
    let (value, used) =
        bincode::serde::decode_from_slice(bytes, standard().with_limit::<LONGEST>())
            .expect("ranks out of step: a message is not what was expected");
    assert_eq!(used, bytes.len(), "ranks out of step: a message is too long");
    value
}

#[cfg(test)]
mod tests {
    use super::{decode, encode};

    /// A text that says it has 2^60 bytes panics without an attempt to take that memory, which would end the process.
    #[test]
    fn lengths_are_bounded() {
        let mut bytes = vec![253];
        bytes.extend((1_u64 << 60).to_le_bytes());
        assert!(std::panic::catch_unwind(|| decode::<String>(&bytes)).is_err());
        assert_eq!(decode::<String>(&encode(&"a")), "a");
    }
}
