//! Pictures, curves and the page of a snapshot. Numbers come from the files of [`crate::post`].

pub mod compared;
pub mod draw;
pub mod form;
pub mod page;
pub mod panels;
pub mod picture;
pub mod plots;
pub mod rose;
mod side;
pub mod sizes;
pub mod views;
mod walls;
