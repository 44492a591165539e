//! Files for sites (`run/site`) have the version of Cargo.toml and the packages of run/setup, their page the figures of the records.

use std::fs;
use std::process::Command;

const IMAGES: [&str; 2] = ["run/site/Dockerfile", "run/site/apptainer.def"];

fn read(path: &str) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// Value of the first line `key = "value"` of Cargo.toml.
fn cargo(key: &str) -> String {
    let text = read("Cargo.toml");
    let begin = format!("{key} = \"");
    let value = text.lines().find_map(|line| line.strip_prefix(&*begin)?.strip_suffix('"'));
    value.unwrap_or_else(|| panic!("Cargo.toml has no {key}")).to_owned()
}

/// Packages that `run/setup --mpi mpich` installs for MPI and HDF5.
fn development() -> Vec<String> {
    let text = read("run/setup");
    let list = text.lines().find_map(|line| line.strip_prefix("mpich) packages+=("));
    let list = list.and_then(|rest| rest.split(')').next()).expect("a list for MPICH");
    list.split_whitespace().map(str::to_owned).collect()
}

/// Packages of `apt-get install` in a file.
fn installed(path: &str) -> Vec<String> {
    let text = read(path);
    let commands = text.lines().filter_map(|line| line.split("apt-get install ").nth(1));
    let words = commands.flat_map(|rest| rest.trim_end_matches('\\').split_whitespace());
    words.filter(|word| !word.starts_with('-')).map(str::to_owned).collect()
}

#[test]
fn versions_are_those_of_cargo_toml() {
    let (version, rust) = (cargo("version"), cargo("rust-version"));
    let wanted = [
        (IMAGES[0], format!("FROM rust:{rust}-slim-bookworm AS tools\n")),
        (IMAGES[0], format!("org.opencontainers.image.version={version}\n")),
        (IMAGES[1], format!("\nFrom: rust:{rust}-slim-bookworm\n")),
        (IMAGES[1], format!("\n    Version {version}\n")),
        ("run/site/package.py", format!("version(\"{version}\")\n")),
        ("run/site/package.py", format!("depends_on(\"rust@{rust}:\", type=\"build\")\n")),
        ("run/site/modulefile", format!("\nset version {version}\n")),
        ("run/site/README.md", format!("/opt/modules/dem-mpi/{version} ")),
        ("src/guide/site.md", format!("\n| Rust | {rust} or newer ")),
    ];
    for (path, line) in wanted {
        assert!(read(path).contains(&line), "{path} has no {line:?}");
    }
}

/// The stage that builds calls `run/setup`; the one that runs has the libraries of its packages.
#[test]
fn packages_of_the_images_are_those_of_setup() {
    let development = development();
    assert!(development.iter().any(|name| name == "libhdf5-mpich-dev"), "{development:?}");
    let readme = read("run/site/README.md");
    for path in IMAGES {
        assert!(read(path).contains("./run/setup --mpi mpich\n"), "{path}");
        let installed = installed(path);
        assert_eq!(installed.len(), 2, "{path}: {installed:?}");
        for package in installed {
            // Runtime libraries end with the version of their interface: libhdf5-mpich-103-1.
            let base = package.trim_end_matches(|c: char| c == '-' || c.is_ascii_digit());
            let known = [package.clone(), format!("{base}-dev")];
            assert!(known.iter().any(|name| development.contains(name)), "{path}: {package}");
            assert!(readme.contains(&format!("`{package}`")), "README.md: {package}");
        }
    }
}

/// Figures of the page stand in the tables that it names.
#[test]
fn figures_of_the_page_are_those_of_the_tables() {
    let page = read("src/guide/site.md");
    let rows = |begin: &str, end: &str| -> Vec<String> {
        let (_, rest) = page.split_once(begin).unwrap_or_else(|| panic!("{begin}"));
        let table = rest.split(end).next().unwrap_or_default();
        table.lines().filter(|line| line.starts_with("| ")).skip(1).map(str::to_owned).collect()
    };
    let (speed, benchmarks) = (read("README.md"), read("benchmarks/README.md"));
    let memory = rows("## Memory and time\n", "\nEach rank");
    let cases = rows("Million particle-steps", "\nThe time");
    assert!(memory.len() == 3 && cases.len() == 3, "{memory:?} {cases:?}");
    for row in memory {
        assert!(benchmarks.lines().any(|line| line == row), "benchmarks/README.md: {row}");
    }
    for row in cases {
        assert!(speed.lines().any(|line| line.starts_with(&row)), "README.md: {row}");
    }
    let efficiencies: Vec<String> = rows("## Particles per rank\n", "\nScenes of")
        .iter()
        .filter(|row| row.contains("model"))
        .map(|row| row.split(" | ").nth(2).unwrap_or_default().to_owned())
        .collect();
    let record = read("benchmarks/records/2026-11-scaling/README.md");
    let modelled = efficiencies.join(" / ");
    assert!(record.contains(&format!("| 100,000 | {modelled}; ")), "{modelled}");
}

/// `run/site/check` finds no fault, and names the checks that this machine cannot run.
#[test]
fn the_files_hold_their_checks() {
    let output = Command::new("run/site/check").output().expect("run/site/check starts");
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{said}{}", String::from_utf8_lossy(&output.stderr));
    for part in ["Dockerfile", "apptainer.def", "package.py", "chain"] {
        let line = format!("checked: {part}: ");
        assert!(said.lines().any(|other| other.starts_with(&line)), "{part}: {said}");
    }
    assert!(said.contains("\nnot checked: pbs, lsf: in a queue: "), "{said}");
}
