//! Planes, round walls and triangles: contacts with them and how they move.

mod belts;
mod edges_of_planes;
pub(crate) mod faces_on_meshes;
mod folds;
mod free_walls;
pub(crate) mod meshes;
mod meshes_in_periods;
mod rods_swing;
mod round_walls;
mod sides_on_meshes;
mod sides_on_round_walls;
mod turning_together;
mod turning_walls;
mod wall_motions;
mod walls_everywhere;
mod walls_in_walls;
mod wear;

pub(crate) use turning_walls::the_same_on_any_ranks;
