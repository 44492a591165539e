//! Communication without MPI: alone and as threads.

mod cases;
mod threads;
