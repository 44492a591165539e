//! Identifiers: small integers of distinct types, which cannot be confused.

use serde::{Deserialize, Serialize};

/// Id of a body for its life.
///
/// Particles count from 0, or have the ids of their file. Pieces of unions have higher ids than all particles, in the order of their bodies. Facets of walls have higher ids
/// than these, in the order of the walls, then of the facets of a wall. A facet is thus always the second body of a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct GlobalId(pub u64);

impl GlobalId {
    const FIRST_WALL: u64 = 1 << 62;
    const FIRST_PIECE: u64 = 1 << 61;
    const PIECE_BITS: u32 = 10;
    /// Upper bound of the ids of particles that are unions, whose pieces have ids of their own.
    pub const MOST_OF_PIECES: u64 = 1 << 51;
    /// Bits of the number of a facet within its wall. The number of a wall in a file has as many.
    const FACET_BITS: u32 = 30;
    const FACET: u64 = (1 << Self::FACET_BITS) - 1;

    /// Id of the first facet of the wall with this index in the scene; most walls have no other.
    pub const fn wall(index: usize) -> Self {
        Self::facet(index, 0)
    }

    /// Id of a facet, by the index of its wall in the scene and its own index within the wall.
    pub const fn facet(wall: usize, facet: usize) -> Self {
        Self(Self::FIRST_WALL + ((wall as u64) << Self::FACET_BITS) + facet as u64)
    }

    /// Id of a piece of this particle.
    #[must_use]
    pub const fn piece(self, piece: usize) -> Self {
        Self(Self::FIRST_PIECE + (self.0 << Self::PIECE_BITS) + piece as u64)
    }

    /// Number of the piece, or `None` for a particle or a wall.
    pub const fn piece_index(self) -> Option<usize> {
        if self.0 < Self::FIRST_PIECE || self.0 >= Self::FIRST_WALL {
            return None;
        }
        Some((self.0 & ((1 << Self::PIECE_BITS) - 1)) as usize)
    }

    /// Id of the body to which a piece belongs; the same id for all others.
    #[must_use]
    pub const fn body(self) -> Self {
        match self.piece_index() {
            Some(_) => Self((self.0 - Self::FIRST_PIECE) >> Self::PIECE_BITS),
            None => self,
        }
    }

    /// Index of the wall, or `None` for a particle.
    pub const fn wall_index(self) -> Option<usize> {
        match self.wall_and_facet() {
            Some((wall, _)) => Some(wall),
            None => None,
        }
    }

    /// Index of the wall and of the facet within it, or `None` for a particle.
    pub const fn wall_and_facet(self) -> Option<(usize, usize)> {
        if self.0 < Self::FIRST_WALL {
            return None;
        }
        let number = self.0 - Self::FIRST_WALL;
        Some(((number >> Self::FACET_BITS) as usize, (number & Self::FACET) as usize))
    }

    /// Id in files: particles from 0 up, the first facet of wall `k` as `-(k + 1)`, its facet `f` as `-(k + 1) - 2^30 f`.
    pub const fn to_file(self) -> i64 {
        match self.wall_and_facet() {
            Some((wall, facet)) => -1 - (wall as i64) - ((facet as i64) << Self::FACET_BITS),
            None => self.0 as i64,
        }
    }

    /// Id from a file, the inverse of [`GlobalId::to_file`].
    pub const fn from_file(id: i64) -> Self {
        if id >= 0 {
            return Self(id as u64);
        }
        let number = !id as u64;
        Self::facet((number & Self::FACET) as usize, (number >> Self::FACET_BITS) as usize)
    }
}

impl std::fmt::Display for GlobalId {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.wall_and_facet() {
            Some((wall, 0)) => write!(f, "wall {wall}"),
            Some((wall, facet)) => write!(f, "wall {wall}, facet {facet}"),
            None => match self.piece_index() {
                Some(piece) => write!(f, "{}, piece {}", self.body().0, piece + 1),
                None => write!(f, "{}", self.0),
            },
        }
    }
}

/// Place of a body in the order of space, see [`crate::particles::order`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Standing(pub u64);

impl Standing {
    /// Standing of facets of walls, and of particles that have none yet.
    pub const LAST: Self = Self(u64::MAX);
}

/// Position of a body in this rank's columns.
///
/// It is valid until the next rebuild of the neighbour list, and must not be stored longer.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, bytemuck::Pod, bytemuck::Zeroable,
)]
#[repr(transparent)]
pub struct Slot(pub u32);

impl Slot {
    /// Index into a column.
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}

/// A process of the run, from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Rank(pub u32);

impl Rank {
    /// Index.
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}

/// An entry of the scene's list of shapes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct ShapeId(pub u16);

impl ShapeId {
    /// Index into the library of shapes.
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}

/// An entry of the scene's list of materials.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct MaterialId(pub u16);

impl MaterialId {
    /// Index into the list of materials.
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}

#[cfg(test)]
mod tests {
    use super::GlobalId;

    #[test]
    fn facets_are_ordered_and_come_back_from_files() {
        let ids = [(0, 0), (0, 1), (0, 5), (1, 0), (1, 1), (70_000, 0), (70_000, 70_000)];
        let ids = ids.map(|(wall, facet)| {
            let id = GlobalId::facet(wall, facet);
            assert_eq!(id.wall_and_facet(), Some((wall, facet)));
            assert_eq!(GlobalId::from_file(id.to_file()), id);
            id
        });
        assert!(ids.is_sorted());
        let mut files = ids.map(GlobalId::to_file);
        files.sort_unstable();
        assert!(files.windows(2).all(|two| two[0] < two[1]) && files[6] == -1);
        assert_eq!([GlobalId::wall(0), GlobalId::wall(2)].map(GlobalId::to_file), [-1, -3]);
        assert_eq!(GlobalId::from_file(17).wall_index(), None);
        let piece = GlobalId(17).piece(3);
        assert_eq!((piece.body(), piece.piece_index()), (GlobalId(17), Some(3)));
        assert_eq!((piece.wall_index(), GlobalId::from_file(piece.to_file())), (None, piece));
        assert!(GlobalId(18) < piece && piece < GlobalId(18).piece(0) && piece < ids[0]);
    }
}
