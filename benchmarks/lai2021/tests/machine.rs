//! A stand-in for mpirun and dem-mpi that leaves prepared snapshots.

use crate::packings::{boxed, store};
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::PathBuf;
use std::process::{Command, Output};

/// A folder with its own `mpirun`.
pub(crate) struct Machine(tempfile::TempDir);

impl Machine {
    /// `last` is the command that mpirun runs at the end of a call.
    pub(crate) fn new(last: &str) -> Self {
        let machine = Self(tempfile::tempdir().unwrap());
        // The last two strains are on the plateau.
        let states = [
            ("packing", 100, 0.021),
            ("consolidation", 200, 0.02),
            ("shear", 200, 0.02),
            ("shear", 300, 0.019),
            ("shear", 400, 0.0155),
            ("shear", 500, 0.0145),
        ];
        for (stage, step, height) in states {
            store(&machine.path(&format!("prepared/{stage}")), &boxed(height, step));
        }
        let mpirun = machine.path("mpirun");
        let script = format!(
            "#!/bin/sh\n\
             echo \"$*\" >>'{here}/calls'\n\
             while [ \"$1\" != --out ]; do shift; done\n\
             cp -r '{here}/prepared/'$(basename \"$2\")/. \"$2\"\n\
             echo said\n\
             {last}\n",
            here = machine.0.path().display()
        );
        fs::write(&mpirun, script).unwrap();
        fs::set_permissions(&mpirun, fs::Permissions::from_mode(0o755)).unwrap();
        machine
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub(crate) fn text(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    /// Arguments of the calls of mpirun, without the paths of the checkout.
    pub(crate) fn calls(&self) -> Vec<String> {
        let text = self.text("calls").replace(self.0.path().to_str().unwrap(), "HERE");
        let call = |line: &str| {
            let (ranks, rest) = line.split_once(" /").unwrap();
            format!("{ranks} {}", rest.split_once("/dem-mpi ").unwrap().1)
        };
        text.lines().map(call).collect()
    }

    pub(crate) fn command(&self, part: &str, words: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_lai2021"));
        command.arg(part).args(words).arg("--out").arg(self.path("out"));
        command.env("MPIRUN", self.path("mpirun"));
        command
    }

    pub(crate) fn run(&self, part: &str, words: &[&str]) -> (Option<i32>, String) {
        let Output { status, stderr, .. } = self.command(part, words).output().unwrap();
        (status.code(), String::from_utf8(stderr).unwrap())
    }
}
