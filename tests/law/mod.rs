//! Contact laws: closed forms, energies and impacts.

mod adhesion;
mod dashpots;
mod elliptic;
mod hertz;
mod hertz_faces;
mod jkr;
mod law_lanes;
mod laws;
mod other_codes;
mod registers;
mod rolling;
mod sliding_faces;
mod touch_and_end;
mod turning;
