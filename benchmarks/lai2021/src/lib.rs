//! Reproduction of Lai, Zhao, Zhao and Huang (2021), *Revisiting the GJK and shape erosion method for contact
//! resolution in DEM*, with dem-mpi: its cases, figures and tables, with each statement beside the number of this
//! code and a verdict.
//!
//! | module | content |
//! |---|---|
//! | [`cases`] | the pairs of section 2 |
//! | [`findings`] | statements, findings, verdicts |
//! | [`single_contact`] | section 2: figures 5 to 8, table 1 |
//! | [`triaxial`] | section 3, from the snapshots of runs: figures 9 to 14 |
//! | [`packed`] | pairs of a packing, resolved alone |
//! | [`sensitivity`] | dependence of the packings of section 3 on the parameters |
//! | [`statements`] | all statements in one table with counts, and the conclusions |
//! | [`spread`] | means and deviations of packings of one kind |
//! | [`simulation`] | runs of dem-mpi under mpirun |
//! | [`record`] | files of a part, with their origin |

pub mod cases;
pub mod findings;
pub mod packed;
pub mod record;
pub mod sensitivity;
pub mod simulation;
pub mod single_contact;
pub mod spread;
pub mod statements;
pub mod triaxial;
