//! Results of all scenes in a folder, in one table.

use anyhow::Context;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::Instant;

/// For every scene below a folder, prints its exit status and parts of the report and of the
/// program's messages.
pub(crate) fn run(folder: &Path, out: &Path) -> anyhow::Result<()> {
    let mut scenes = Vec::new();
    find(folder, &mut scenes)?;
    scenes.sort();
    anyhow::ensure!(!scenes.is_empty(), "{} has no scenes (*.toml)", folder.display());
    println!(
        "| scene | time [s] | status | steps | missing of the energy moved | says |\n|---|---|---|---|---|---|"
    );
    for scene in scenes {
        let name = scene.strip_prefix(folder)?.with_extension("");
        let name = name.display().to_string().replace('/', "-");
        let out = out.join("outside").join(&name);
        let begin = Instant::now();
        let Output { status, stderr, .. } = Command::new(env!("CARGO_BIN_EXE_dem-mpi"))
            .current_dir(scene.parent().unwrap_or(folder))
            .arg(scene.file_name().unwrap_or_default())
            .args(["--overwrite", "--out"])
            .arg(&out)
            .output()
            .context("cannot start dem-mpi")?;
        let time = begin.elapsed().as_secs_f64();
        let report: Value = std::fs::read(out.join("report.json"))
            .ok()
            .and_then(|text| serde_json::from_slice(&text).ok())
            .unwrap_or_default();
        let number = |of: &Value| of.as_f64().map_or("–".to_owned(), |x| format!("{x:.3e}"));
        let code = status.code().map_or("killed".to_owned(), |code| code.to_string());
        let said = String::from_utf8_lossy(&stderr);
        let telling = |line: &&str| line.contains("warning") || !status.success();
        let said: Vec<&str> = said.lines().filter(telling).take(3).collect();
        println!(
            "| {name} | {time:.1} | {code} | {} | {} | {} |",
            report["run"]["steps"],
            number(&report["energy"]["missing_over_moved"]),
            said.join(" ").chars().take(200).collect::<String>().replace('|', "/")
        );
    }
    Ok(())
}

fn find(folder: &Path, into: &mut Vec<PathBuf>) -> anyhow::Result<()> {
    let entries = folder.read_dir().with_context(|| format!("cannot read {}", folder.display()))?;
    for entry in entries {
        let path = entry?.path();
        if path.is_dir() {
            find(&path, into)?;
        } else if path.extension().is_some_and(|of| of == "toml") {
            into.push(path.canonicalize()?);
        }
    }
    Ok(())
}
