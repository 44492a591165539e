//! LAMMPS beside this program, if Debian's `lmp` is installed: decks of one body, and its final state.

use super::{Ball, Body};
use dem_mpi::math::{Quat, Vec3};
use nalgebra::Quaternion;
use std::process::{Command, Stdio};

/// Whether LAMMPS is installed.
pub(crate) fn is_there() -> bool {
    let asked = Command::new("lmp").arg("-h").stdout(Stdio::null()).stderr(Stdio::null()).status();
    asked.is_ok_and(|status| status.success())
}

/// Runs a deck that dumps the columns of its only atom to `end`, and returns the last of them.
fn run(deck: &str) -> Vec<f64> {
    let folder = tempfile::tempdir().expect("a folder for LAMMPS");
    std::fs::write(folder.path().join("in"), deck).expect("a deck");
    let output = Command::new("lmp")
        .args(["-in", "in", "-log", "none"])
        .current_dir(folder.path())
        .output()
        .expect("LAMMPS starts");
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "LAMMPS ends well:\n{said}\n{deck}");
    let text = std::fs::read_to_string(folder.path().join("end")).expect("a dump");
    let last = text.lines().last().expect("a line");
    last.split_whitespace().map(|cell| cell.parse().expect("a number")).collect()
}

/// A ball over the floor z = 0 after `steps` steps, with damping of the normal spring that may pull. There is no
/// gravity if `gravity` is zero.
pub(crate) fn ball_on_floor(ball: &Ball, start: &Body, gravity: f64, dt: f64, steps: u64) -> Body {
    let Ball { radius, density, normal, tangential, friction, .. } = ball;
    let (x, v) = (start.position, start.velocity);
    let damping = 2.0 * ball.damping_ratio() * (normal / ball.mass()).sqrt();
    let deck = format!(
        "units si
atom_style sphere
newton off
boundary f f f
region box block -10 10 -1 1 -1 1
create_box 1 box
create_atoms 1 single {:e} {:e} {:e}
set group all diameter {:e}
set group all density {density:e}
velocity all set {:e} {:e} {:e}
pair_style zero {:e}
pair_coeff * *
neighbor {radius:e} bin
timestep {dt:e}
fix move all nve/sphere
fix down all gravity {gravity:e} vector 0 0 -1
fix floor all wall/gran hooke/history {normal:e} {tangential:e} {damping:e} 0 {friction:e} 1 zplane 0.0 NULL
dump end all custom {steps} end x y z vx vy vz omegax omegay omegaz
dump_modify end format float %.17g
thermo {steps}
run {steps}
",
        x.x,
        x.y,
        x.z,
        2.0 * radius,
        v.x,
        v.y,
        v.z,
        4.0 * radius
    );
    let row = run(&deck);
    let vector = |k: usize| Vec3::new(row[k], row[k + 1], row[k + 2]);
    Body { position: vector(0), velocity: vector(3), spin: vector(6), ..start.clone() }
}

/// A free ellipsoid of density 1 with these semi-axes after `steps` steps.
pub(crate) fn free_ellipsoid(semi_axes: &Vec3, start: &Body, dt: f64, steps: u64) -> Body {
    let mass = 4.0 / 3.0 * std::f64::consts::PI * semi_axes.product();
    let squares = semi_axes.component_mul(semi_axes);
    let inertia = (Vec3::repeat(squares.sum()) - squares) * (mass / 5.0);
    let momentum =
        start.orientation * inertia.component_mul(&(start.orientation.inverse() * start.spin));
    let (axes, q) = (semi_axes * 2.0, start.orientation.coords);
    let deck = format!(
        "units si
atom_style ellipsoid
boundary f f f
region box block -50 50 -50 50 -50 50
create_box 1 box
create_atoms 1 single 0 0 0
set group all shape {:e} {:e} {:e}
set group all density 1
set group all quat 1 0 0 0
set group all angmom {:e} {:e} {:e}
pair_style zero 10
pair_coeff * *
timestep {dt:e}
fix move all nve/asphere
compute turned all property/atom quatw quati quatj quatk
dump end all custom {steps} end c_turned[1] c_turned[2] c_turned[3] c_turned[4] angmomx angmomy angmomz
dump_modify end format float %.17g
thermo {steps}
run {steps}
",
        axes.x, axes.y, axes.z, momentum.x, momentum.y, momentum.z
    );
    assert!(q.w == 1.0, "the deck begins upright");
    let row = run(&deck);
    let orientation = Quat::new_normalize(Quaternion::new(row[0], row[1], row[2], row[3]));
    let angular_momentum = Vec3::new(row[4], row[5], row[6]);
    let local = (orientation.inverse() * angular_momentum).component_div(&inertia);
    Body { orientation, angular_momentum, spin: orientation * local, ..start.clone() }
}
