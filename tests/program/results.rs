//! Results of runs and of `dem-post`, which stay equal from commit to commit.

use super::fresh_directory;
use super::process::{Launch, dem_mpi, dem_post};
use crate::support::kept;
use std::fs;
use std::path::Path;

/// Scenes with their steps, and with options of `dem-post` that fit them.
const RUNS: [(&str, &str, &str); 7] = [
    ("tests/program/heap.toml", "2000", "--fields 1d --margin 1d"),
    ("tests/program/kinds.toml", "1500", "--surfaces --detail 1 --lammps --fabric-with-walls"),
    ("tests/program/chute.toml", "4000", "--flow -z=0.03 --vtp --surfaces --detail 1"),
    ("run/drum/scene.toml", "4000", "--mixing shape:red --slope x --fields 1d"),
    ("run/triaxial/1-pack.toml", "400", "--fields 1d --weight gauss --mixing half:z"),
    ("tests/scenes/good/unions.toml", "200", "--surfaces --detail 1 --fields 1d"),
    ("tests/scenes/good/strained.toml", "300", "--fabric-with-walls"),
];

/// Shapes that are drawn too, with their scenes.
const DRAWN: [(&str, &str); 2] =
    [("tests/program/kinds.toml", "shard"), ("tests/scenes/good/unions.toml", "ell")];

/// Endings of the files that are text.
const KINDS: [&str; 5] = ["csv", "svg", "json", "vtp", "dump"];

/// Hash of all files of a kind in a folder, without the folder of the run.
fn hash(folder: &Path, kind: &str, run: &Path) -> u64 {
    let mut files: Vec<_> = fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    files.retain(|file| file.extension().is_some_and(|e| e == kind));
    files.sort();
    let texts = files.iter().map(|file| fs::read_to_string(file).unwrap());
    let text: String = texts.collect();
    kept::hash(text.replace(run.to_str().unwrap(), "").as_bytes())
}

#[test]
fn results_are_those_of_the_commit_before() {
    for (scene, steps, options) in RUNS {
        let name = scene.trim_start_matches("tests/program/").replace(['/', '.'], "_");
        let run = fresh_directory(&format!("results_{name}"));
        let out = run.to_str().unwrap();
        let post = run.join("post");
        let short = ["--set", "output.snapshot_every=200", "--set", "output.history_every=50"];
        let words = [scene, "--steps", steps, "--out", out].into_iter().chain(short);
        dem_mpi(Launch::Alone, words).succeed();
        if let Some((_, shape)) = DRAWN.iter().find(|(of, _)| *of == scene) {
            let words = [scene, "--shape", shape, "--out", post.to_str().unwrap()];
            dem_mpi(Launch::Alone, words).succeed();
        }
        let words = [out, "--series", "--out", post.to_str().unwrap()].into_iter();
        dem_post(words.chain(options.split(' '))).succeed();
        let history = fs::read(run.join("history.csv")).unwrap();
        kept::expect(&format!("{name} history"), kept::hash(&history));
        for kind in KINDS {
            kept::expect(&format!("{name} {kind}"), hash(&post, kind, &run));
        }
    }
}
