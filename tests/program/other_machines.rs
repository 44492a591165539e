//! Identical bits with a platform library whose functions return other last digits.

use super::process::{Call, Launch, dem_mpi, dem_post};
use super::{column, fresh_directory, scene};
use std::path::Path;

/// Compiles `other_mathematics.c`.
fn other_mathematics(folder: &Path) -> String {
    let library = folder.join("other_mathematics.so");
    let source = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/program/other_mathematics.c");
    let words =
        ["-O2", "-fno-builtin", "-shared", "-fPIC", "-o", library.to_str().unwrap(), source];
    Call::new(vec![], "cc", words.into_iter().chain(["-lm", "-ldl"])).succeed();
    library.to_str().unwrap().to_owned()
}

#[test]
fn no_bit_depends_on_the_mathematics_of_the_platform() {
    let folder = fresh_directory("other_machines");
    let library = other_mathematics(&folder);
    for name in ["sticking_balls", "pressed_stones"] {
        let out = |kind: &str| folder.join(format!("{name}_{kind}")).to_str().unwrap().to_owned();
        let (here, there) = (out("here"), out("there"));
        let scene = scene(name);
        dem_mpi(Launch::Alone, [&*scene, "--out", &here]).succeed();
        let launcher = vec!["env".into(), format!("LD_PRELOAD={library}").into()];
        let program = env!("CARGO_BIN_EXE_dem-mpi");
        Call::new(launcher, program, [&*scene, "--out", &there]).succeed();
        let compared = dem_post(["--diff", &here, &there]).succeed();
        assert!(compared.output.starts_with("equal bit for bit"), "{compared}");
        let contacts = column(Path::new(&here), "contacts");
        assert!(contacts.values().any(|&count| count > 10.0), "{contacts:?}");
        if name == "sticking_balls" {
            // The angle of the plate in the table comes from the platform library, so the difference
            // proves that the other one was in use.
            let [turned, elsewhere] =
                [&here, &there].map(|out| column(Path::new(out), "turned_plate_x_rad"));
            assert_ne!(turned, elsewhere);
        }
    }
}
