//! The wire format of what is ragged and rare: the scene, migrating particles. (The halo of every
//! step is plain packed `f64`.) bincode stands behind these two functions and nowhere else, so that
//! it can be replaced.

use serde::{Serialize, de::DeserializeOwned};

/// A value as bytes.
///
/// # Panics
/// Never for the plain data that ranks exchange.
pub fn encode<T: Serialize>(value: &T) -> Vec<u8> {
    bincode::serde::encode_to_vec(value, bincode::config::standard())
        .expect("plain data has no way to fail to encode")
}

/// The value that [`encode`] made these bytes of, on a rank of the same run.
///
/// # Panics
/// If the bytes are of something else: the ranks are out of step.
pub fn decode<T: DeserializeOwned>(bytes: &[u8]) -> T {
    let (value, used) = bincode::serde::decode_from_slice(bytes, bincode::config::standard())
        .expect("ranks out of step: a message is not what was expected");
    assert_eq!(used, bytes.len(), "ranks out of step: a message is too long");
    value
}
