//! Walls and motions of all kinds, inlets and outlets of all regions, and all size distributions. Bits are identical on any number of ranks and
//! across restarts.

use crate::support::{OnRanks, close, scene};
use std::path::Path;

const MATERIAL: &str = r#"
seed = 7
gravity = [0.2, 0.1, -9.81]
[neighbours]
imbalance = 1.05
[output]
directory = "out"
[[material]]
name = "stone"
density = 2500
friction = 0.4
restitution = 0.5
tangential_damping_ratio = 0.1
"#;

/// Writes a square in the plane z = 0, and tables of a displacement and of a rotation.
fn files(folder: &Path) {
    let square =
        "v -0.03 -0.03 0\nv 0.03 -0.03 0\nv 0.03 0.03 0\nv -0.03 0.03 0\nf 1 2 3\nf 1 3 4\n";
    std::fs::write(folder.join("plate.obj"), square).unwrap();
    std::fs::write(
        folder.join("way.csv"),
        "time_s,displacement_m\n0,0\n0.01,0.001\n0.02,-0.001\n0.04,0\n",
    )
    .unwrap();
    std::fs::write(folder.join("turn.csv"), "time_s,angle_deg\n0,0\n0.01,1\n0.02,-0.5\n").unwrap();
}

fn with_files(text: &str, folder: &Path) -> String {
    let all = ["plate.obj", "way.csv", "turn.csv"];
    all.iter().fold(text.to_owned(), |text, name| {
        text.replace(
            &format!("{name:?}"),
            &format!("{:?}", folder.join(name).display().to_string()),
        )
    })
}

/// An oscillating cone, a tube with a table and a rotating pin among particles. Sizes follow a table, a normal and a Weibull distribution. There
/// are a flat inlet with spin and an axis, a round inlet, and a round outlet.
#[test]
fn a_funnel_fed_by_all_laws_is_the_same_everywhere() {
    let folder = tempfile::tempdir().unwrap();
    files(folder.path());
    let text = format!(
        r#"{MATERIAL}normal_stiffness = 300
[domain]
low = [-0.04, -0.04, -0.05]
high = [0.04, 0.04, 0.09]
[[wall]]
name = "cone"
cone = {{ from = [0, 0, 0], to = [0, 0, 0.03], radius = [0.008, 0.03] }}
wear = true
[[motion]]
walls = ["cone"]
about = [0, 0, 0]
axis = [0, 0, 1]
amplitude = 30
frequency = 20
[[wall]]
name = "tube"
cylinder = {{ from = [0, 0, 0.03], to = [0, 0, 0.09], radius = 0.03 }}
[[motion]]
walls = ["tube"]
along = [1, 0, 0]
table = "way.csv"
[[wall]]
name = "pin"
cylinder = {{ from = [-0.03, 0, 0.02], to = [0.03, 0, 0.02], radius = 0.002 }}
rotation = {{ about = [0, 0, 0.02], axis = [1, 0, 0], rate = 30 }}
[[shape]]
name = "a"
kind = "sphere"
diameter = 1
size = {{ table = [[1.2e-3, 0], [2e-3, 0.4], [2.4e-3, 1]], by = "mass" }}
[[shape]]
name = "b"
kind = "ellipsoid"
semi_axes = [0.0012, 0.0008, 0.0009]
size = {{ normal = {{ mean = 1, deviation = 0.1 }}, limits = [0.8, 1.1] }}
[[shape]]
name = "c"
kind = "spherocylinder"
length = 0.001
radius = 0.0008
size = {{ weibull = {{ scale = 1, shape = 3 }}, limits = [0.8, 1.1] }}
[[inlet]]
name = "flat"
shapes = {{ a = 1, b = 1, c = 1 }}
shares = "mass"
low = [-0.012, -0.012, 0.07]
high = [0.012, 0.012, 0.07]
rate = 20000
count = 300
velocity = [0, 0, -3]
spread = 0.2
spin = 50
every = 20
orientation = {{ axis = [1, 0, 1], spread = 20, own = "x" }}
[[inlet]]
name = "up"
shapes = {{ b = 1, c = 1 }}
axis = [[0.0, -0.005, 0.05], [0.0, 0.005, 0.06]]
radius = 0.006
mass_rate = 0.04
mass = 0.001
begin = 0.003
velocity = [0, 0, -3]
every = 15
orientation = "upright"
[[outlet]]
name = "drain"
axis = [[0, 0, -0.001], [0, 0, 0.006]]
radius = 0.009
every = 5
[time]
step = 4e-6
steps = 12000
"#
    );
    let scene = scene(&with_files(&text, folder.path()));
    let alone = OnRanks::of(&scene).the_same_everywhere(8000, folder.path());
    let counted = ["entered_flat", "entered_up", "left_drain"].map(|name| alone.number(name));
    let touching = alone.number("wall_contacts");
    println!("{counted:?}, {touching} on walls");
    assert!(counted[0] > 100.0 && counted[1] > 10.0 && counted[2] > 0.0, "{counted:?}");
    assert!(touching > 3.0, "{touching}");
}

/// A plate that oscillates and rotates by a table, a roller that keeps a force, and a free cone: all of them press on particles.
#[test]
fn a_plate_a_roller_and_a_free_cone_are_the_same_everywhere() {
    let folder = tempfile::tempdir().unwrap();
    files(folder.path());
    let text = format!(
        r#"{MATERIAL}normal_stiffness = 6000
[domain]
low = [-0.03, -0.03, -0.02]
high = [0.03, 0.03, 0.05]
walls = ["-x", "+x", "-y", "+y"]
[[wall]]
name = "floor"
mesh = "plate.obj"
wear = true
[[motion]]
walls = ["floor"]
along = [0, 0, 1]
amplitude = 0.0003
frequency = 60
[[motion]]
walls = ["floor"]
about = [0, 0, 0]
axis = [0, 1, 0]
table = "turn.csv"
interpolation = "smooth"
[[wall]]
name = "roll"
cylinder = {{ from = [-0.03, 0, 0.0205], to = [0.03, 0, 0.0205], radius = 0.01 }}
velocity = [0.05, 0, 0]
[[servo]]
walls = ["roll"]
force = 0.5
along = [0, 0, -1]
max_speed = 0.2
[[wall]]
name = "plug"
cone = {{ from = [-0.02, 0.019, 0.0175], to = [0.02, 0.019, 0.0175], radius = [0.003, 0.0065] }}
velocity = [0, 0, -0.1]
[[motion]]
walls = ["plug"]
along = [0, 0, 1]
mass = 0.02
force = -0.3
[[shape]]
name = "a"
kind = "sphere"
radius = 0.0018
[[shape]]
name = "b"
kind = "ellipsoid"
semi_axes = [0.0022, 0.0016, 0.0018]
[[shape]]
name = "c"
kind = "poly-superellipsoid"
semi_axes_positive = [0.0022, 0.0016, 0.0018]
semi_axes_negative = [0.0018, 0.0015, 0.002]
exponents = [0.8, 0.9]
[[fill.lattice]]
shapes = {{ a = 1, b = 1, c = 1 }}
low = [-0.03, -0.03, 0.001]
high = [0.03, 0.03, 0.01]
orientation = {{ axis = [1, 0, 0], spread = 30, own = "x" }}
[time]
step = 6e-6
steps = 10000
"#
    );
    let scene = scene(&with_files(&text, folder.path()));
    let alone = OnRanks::of(&scene).the_same_everywhere(7000, folder.path());
    // Work by triangles, planes, a cylinder and a cone, some controlled by forces.
    let received = alone.number("received") - OnRanks::of(&scene).run(1, 0).number("received");
    close(alone.work_of_walls(), received, 1e-9, "work");
    let forces = alone.numbers("force");
    println!("{forces:?}");
    // These walls follow the four sides.
    for (wall, name) in ["floor", "roll"].iter().enumerate() {
        let force = &forces[3 * (4 + wall)..][..3];
        assert!(force.iter().any(|f| f.abs() > 1e-3), "{name}: {force:?}");
    }
    // It may be in the air; in free fall it would be 0.026 m lower than at the start.
    let plug = alone.numbers("place of plug")[2];
    assert!(plug > 0.0175 - 0.015, "{plug}");
}
