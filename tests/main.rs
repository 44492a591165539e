//! All tests in one binary, in folders named like those of `src`; tests inside MPI are in `ranks`.

mod comm;
mod contact;
mod domain;
mod drive;
mod law;
mod output;
mod post;
mod program;
mod project;
mod scene;
mod shape;
mod sim;
mod support;
mod walls;
