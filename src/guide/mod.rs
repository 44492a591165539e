//! The guide: how to use dem-mpi.
//!
//! | page | what it is for |
//! |---|---|
//! | [`start`] | from nothing to a first scene of one's own |
//! | [`scenes`] | what a scene is made of: grains, walls, servos, shear, stages |
//! | [`models`] | shapes, contact methods, laws, walls, servos: formulas, units, sources |
//! | [`forms`] | particles of any form: a jack, a stone from a scan, a rough wall |
//! | [`walls`] | planes and surfaces of triangles: what a grain touches, what a file must have |
//! | [`laws`] | rolling, twisting, adhesion, and where energy goes |
//! | [`choose`] | time step, contact method, stiffness: what the studies found |
//! | [`parallel`] | ranks, clusters, restarts, and how to look for a fault |
//! | [`outputs`] | the files of a run, in ParaView, Python and OVITO |
//! | [`from_others`] | files and commands of LAMMPS, LIGGGHTS, Yade and MercuryDPM beside ours |
//! | [`extend`] | a law, a shape, a wall, a column of one's own |
//! | [`changes`] | what changed |
//!
//! All keys of a scene: [`crate::scene`], or `dem-mpi --keys`. How the program is built: the [crate's front page](crate).
//!
//! `tests/project/guide.rs` reads every scene in these pages as the program would.

#[doc = include_str!("start.md")]
pub mod start {}

#[doc = include_str!("scenes.md")]
pub mod scenes {}

#[doc = include_str!("models.md")]
pub mod models {}

#[doc = include_str!("forms.md")]
pub mod forms {}

#[doc = include_str!("walls.md")]
pub mod walls {}

#[doc = include_str!("laws.md")]
pub mod laws {}

#[doc = include_str!("choose.md")]
pub mod choose {}

#[doc = include_str!("outputs.md")]
pub mod outputs {}

#[doc = include_str!("from_others.md")]
pub mod from_others {}

#[doc = include_str!("parallel.md")]
pub mod parallel {}

#[doc = include_str!("extend.md")]
pub mod extend {}

#[doc = include_str!("changes.md")]
pub mod changes {}
