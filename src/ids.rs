//! Names of things: small integers that cannot be mixed up.

use serde::{Deserialize, Serialize};

/// A body's name for life. Particles count from 0; walls stand above all particles, so that a
/// wall is always the second body of a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct GlobalId(pub u64);

impl GlobalId {
    const FIRST_WALL: u64 = 1 << 62;

    /// The id of the wall with this index in the scene.
    pub const fn wall(index: usize) -> Self {
        Self(Self::FIRST_WALL + index as u64)
    }

    /// The wall's index, or `None` for a particle.
    pub const fn wall_index(self) -> Option<usize> {
        if self.0 >= Self::FIRST_WALL { Some((self.0 - Self::FIRST_WALL) as usize) } else { None }
    }

    /// As files have it: particles from 0 up, wall `k` as `-(k + 1)`.
    pub const fn to_file(self) -> i64 {
        match self.wall_index() {
            Some(k) => -(k as i64) - 1,
            None => self.0 as i64,
        }
    }

    /// The inverse of [`GlobalId::to_file`].
    pub const fn from_file(id: i64) -> Self {
        if id < 0 { Self::wall((-(id + 1)) as usize) } else { Self(id as u64) }
    }
}

impl std::fmt::Display for GlobalId {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.wall_index() {
            Some(k) => write!(f, "wall {k}"),
            None => write!(f, "{}", self.0),
        }
    }
}

/// Where a body stands in this rank's columns. Dies at each rebuild of the neighbour list: never
/// store one beyond it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Slot(pub u32);

impl Slot {
    /// As an index into a column.
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}

/// A process of the run, from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Rank(pub u32);

impl Rank {
    /// As an index.
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}

/// An entry of the scene's list of shapes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct ShapeId(pub u16);

impl ShapeId {
    /// As an index into the library of shapes.
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}

/// An entry of the scene's list of materials.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct MaterialId(pub u16);

impl MaterialId {
    /// As an index into the list of materials.
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}
