//! dem-post: from snapshots to numbers, plots and one page.

use anyhow::{Context, Result, bail, ensure};
use clap::{CommandFactory, Parser};
use dem_mpi::arguments::{self, About};
use dem_mpi::drive::servo;
use dem_mpi::files;
use dem_mpi::output::SnapshotError;
use dem_mpi::output::report::version;
use dem_mpi::output::snapshot::{LAST, Reader};
use dem_mpi::output::tables::ContactTable;
use dem_mpi::post::compare::Comparison;
use dem_mpi::post::diff::{Difference, State};
use dem_mpi::post::fabric::Among;
use dem_mpi::post::history::History;
use dem_mpi::post::measures::{Requested, Source};
use dem_mpi::post::page::{self, Page, Section};
use dem_mpi::post::picture::side_by_side;
use dem_mpi::post::region::{Bounds, Margin, Region};
use dem_mpi::post::report::{csv, readable};
use dem_mpi::post::series::{self, Analysed, Choice, Snapshot};
use dem_mpi::post::sizes;
use dem_mpi::post::surface::Detail;
use dem_mpi::post::views::Views;
use dem_mpi::post::vtp::{self, Files, PolyData};
use dem_mpi::post::{PostError, Report, Settings, compared, export, lammps, ondem, pieces};
use dem_mpi::text::print_error;
use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Computes stress, coordination, fabric and force distributions from snapshots of dem-mpi.
///
/// Give one snapshot for its numbers and plots, or several of one run also for their evolution. Strains are then relative
/// to the earliest, where a period or walls on both sides end the packing. A directory stands for its newest snapshot, with
/// --series for all. Results go to a folder beside the last snapshot, `post` for one and `post_series` for several:
/// index.html to view, report.csv and report.json for computations, every plot as SVG.
#[derive(Parser)]
#[command(name = "dem-post", version = version(), max_term_width = 100, after_help = EXAMPLES)]
#[expect(clippy::struct_excessive_bools, reason = "switches of a command line")]
struct Arguments {
    /// Particle files (particles_STEP.vtkhdf, each with its contacts file beside it), or directories
    #[arg(required_unless_present = "python", value_name = "SNAPSHOT")]
    snapshots: Vec<PathBuf>,

    /// All snapshots of each directory instead of the newest
    #[arg(long)]
    series: bool,

    /// Output folder [default: `post`, for several snapshots `post_series`, for several runs `post_compare`, beside the last]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,

    /// Measure only particles with their centre in this box, in metres
    #[arg(long, value_name = "x0,x1,y0,y1,z0,z1", allow_hyphen_values = true)]
    region: Option<Bounds>,

    /// Leave out a layer along the sides, in metres (0.004) or particle diameters (1.5d). The sides are walls where they
    /// stand in each snapshot, else the outermost particles
    #[arg(long, value_name = "LENGTH", conflicts_with = "region", allow_hyphen_values = true)]
    margin: Option<Margin>,

    /// Count contacts with walls too in fabric, roses and force distributions
    #[arg(long)]
    fabric_with_walls: bool,

    /// Also write a LAMMPS dump of each snapshot, for OVITO, and type_NUMBER.obj for each shape other than spheres, ellipsoids and
    /// superellipsoids: OVITO draws the true shape once this file is loaded as the shape of the type
    #[arg(long)]
    lammps: bool,

    /// Also write each snapshot as ondem_STEP.vtkhdf, the exchange file of the ON-DEM action: particles with their shapes,
    /// materials, walls and contacts, for other codes and for `[[fill.file]]`
    #[arg(long)]
    ondem: bool,

    /// Also write the true surfaces of all particles and walls of each snapshot, and its contacts as lines:
    /// grains_STEP.vtp, walls_STEP.vtp, contacts_STEP.vtp. Lists with times are grains.pvd, walls.pvd, contacts.pvd, and
    /// all.pvd for all three: for ParaView, pyvista, and through them Blender
    #[arg(long)]
    surfaces: bool,

    /// Fineness of curved surfaces, 0 to 5: 20, 80, 320, 1280, 5120 or 20480 triangles for each particle
    #[arg(
        long,
        value_name = "N",
        default_value = "2",
        requires = "surfaces",
        allow_negative_numbers = true
    )]
    detail: Detail,

    /// Also write particles and contacts of each snapshot as particles_STEP.vtp and contacts_STEP.vtp, and lists with times,
    /// particles.pvd and contacts.pvd: for programs without a reader of VTKHDF, such as ParaView before 5.12
    #[arg(long)]
    vtp: bool,

    #[command(flatten)]
    asked: Requested,

    /// Print a module for Python that reads snapshots as numpy arrays and VTK objects, and do nothing else:
    /// dem-post --python > dem.py
    #[arg(long, exclusive = true)]
    python: bool,

    /// Compare two snapshots particle by particle, bit for bit, and write nothing.
    /// Exit status: 0 equal, 1 different, 2 could not compare
    #[arg(long, conflicts_with_all = ["out", "region", "margin", "series", "fabric_with_walls", "lammps", "ondem", "surfaces", "vtp", "Requested"])]
    diff: bool,

    /// Draw two or more runs together, each given by its directory (all its snapshots) or by files: compare.html with a plot
    /// for each quantity that several of them have, and compare.csv. A stage that began from another of the runs continues it
    #[arg(long, conflicts_with_all = ["diff", "lammps", "ondem", "surfaces", "vtp", "Requested"])]
    compare: bool,

    #[command(flatten)]
    about: About,
}

const EXAMPLES: &str = "\
Examples:
  dem-post out/packing                         the newest snapshot of a run
  dem-post out/shear --series                  all its snapshots: stress against strain
  dem-post out/shear --series --margin 1.5d    the same away from the walls, which move
  dem-post out/packing --region 0.01,0.03,0.01,0.03,0.01,0.04
                                               a part of it
  dem-post --diff one_rank/last.vtkhdf four_ranks/last.vtkhdf
                                               same bits on 1 and on 4 ranks?
  dem-post out/loose out/dense --compare       their curves in one page
  dem-post out/packing --lammps                also a file for OVITO
  dem-post out/packing --ondem                 also a file for other codes
  dem-post out/shear --series --surfaces       also true shapes, to be played by ParaView
  dem-post out/drum --series --mixing half:x   how grains of the left and right half mix
  dem-post out/hopper --flow outlet:below --window 0.5,1.5
                                               grains and kilograms per second in a window
  dem-post out/heap --slope radial --fields 1d the angle of the heap, and its density and stress on a grid
  dem-post --python > dem.py                   a reader for Python";

/// Text of `--python`.
const PYTHON: &str = include_str!("../post/dem.py");

fn main() -> ExitCode {
    arguments::outlive_limits_of_files();
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => return ExitCode::from(arguments::ended_by(&error)),
    };
    if let Some(text) = arguments.about.text(Arguments::command()) {
        let printed = arguments::print_or_tell("dem-post", &text);
        return printed.map_or_else(|status| status, |()| ExitCode::SUCCESS);
    }
    match run(&arguments) {
        Ok(code) => code,
        Err(error) => {
            print_error(format_args!("dem-post: {error:#}"));
            ExitCode::from(2)
        }
    }
}

fn run(arguments: &Arguments) -> Result<ExitCode> {
    if arguments.python {
        say(PYTHON)?;
        return Ok(ExitCode::SUCCESS);
    }
    let mut files = particle_files(arguments)?;
    if arguments.diff {
        return diff(&files);
    }
    let mut known = BTreeSet::new();
    files.retain(|file| known.insert(file.clone()));
    if arguments.compare {
        return compare(&files, arguments);
    }
    let snapshots = series::open(&files)?;
    let newest = &snapshots.last().context("no snapshot given")?.path;
    // Several snapshots have plots that a single one lacks, and must not be replaced by it.
    let folder = if snapshots.len() > 1 { "post_series" } else { "post" };
    let out = folder_for(newest, folder, arguments)?;

    if arguments.lammps {
        write_dumps(&out, &snapshots, newest)?;
    }
    if arguments.ondem {
        for Snapshot { path, step } in &snapshots {
            let written =
                ondem::write(&out.join(format!("ondem_{step:09}.vtkhdf")), &Reader::open(path)?);
            written.with_context(|| path.display().to_string())?;
        }
    }
    write_pictures(&out, &snapshots, arguments)?;
    write_results(&out, &snapshots, newest, arguments)
}

/// Creates the requested folder of results, or one of this name beside a snapshot.
fn folder_for(snapshot: &Path, name: &str, arguments: &Arguments) -> Result<PathBuf> {
    let beside = snapshot.parent().unwrap_or(Path::new("."));
    let out = arguments.out.clone().unwrap_or_else(|| beside.join(name));
    ensure!(
        !is_of_run(&out),
        "--out {} is the folder of a run, whose report.json would be replaced. Give another folder, or omit --out",
        out.display()
    );
    fs::create_dir_all(&out).with_context(|| format!("cannot create {}", out.display()))?;
    Ok(out)
}

/// Writes the page, the plots and the table of several runs.
fn compare(files: &[PathBuf], arguments: &Arguments) -> Result<ExitCode> {
    let all = Comparison::of(files, &choice(arguments))?;
    let sections = compared::sections(&all)?;
    let (table, line) = (all.csv()?, arguments::command_line());
    let out = folder_for(files.last().context("no snapshot given")?, "post_compare", arguments)?;
    let write = |name: &str, text: &str| {
        write_file(&out.join(name), |file| file.write_all(text.as_bytes()))
    };
    for plot in sections.iter().flat_map(|section| &section.plots) {
        write(&format!("{}.svg", plot.name), &plot.svg)?;
    }
    write("compare.csv", &table)?;
    write("compare.html", &compared::html(&all, &sections, &line))?;
    for note in &all.notes {
        print_error(format_args!("dem-post: {note}"));
    }
    say(&format!("page: {}\n", out.join("compare.html").display()))?;
    Ok(ExitCode::SUCCESS)
}

/// Analyses all snapshots, makes the requested measures, writes reports and page, and prints the numbers.
fn write_results(
    out: &Path,
    snapshots: &[Snapshot],
    newest: &Path,
    arguments: &Arguments,
) -> Result<ExitCode> {
    let choice = choice(arguments);
    let beside = newest.parent().unwrap_or(Path::new("."));
    let Analysed { mut reports, picture, mut earlier, left_out } =
        series::reports(snapshots, &choice)?;
    let bounds = reports.last().and_then(|r| r.bounds_m);
    if let (false, Some(report)) = (earlier.is_empty(), reports.last()) {
        let time = format!("{} s", readable(report.summary.time_s));
        earlier.push((time, picture.clone(), bounds));
    }
    let earlier = (!earlier.is_empty()).then(|| side_by_side(earlier));
    let drawing = picture.svg(bounds.as_ref());
    let (history, unread) = history_beside(beside);
    let newest = Reader::open(newest)?;
    let header = newest.header();
    let source = Source {
        snapshots,
        history: &history,
        walls: &header.walls,
        choice: &choice,
        as_xml: arguments.vtp,
    };
    let mut measured = arguments.asked.make(source, out);
    measured.notes.splice(0..0, left_out);
    measured.add_to(&mut reports);
    let targets = servo::targets(&header.drives);
    let views = bounds.map(|bounds| Views::of(&newest, &bounds)).transpose()?;
    let mut sections = page::sections(
        &reports,
        earlier,
        drawing,
        views.as_ref(),
        &history,
        &header.walls,
        &targets,
    )?;
    let (of_run, mut warnings) = sizes::beside(beside);
    warnings.extend(unread.iter().cloned());
    warnings.extend(measured.failed.iter().map(|error| format!("dem-post: {error}")));
    let of_sizes = sizes::plots(&of_run)?;
    sections.push(Section { title: "Sizes of particles", plots: of_sizes });
    let page = Page {
        title: &header.title().unwrap_or_else(|| title(beside)),
        command: &arguments::command_line(),
        warnings: &warnings,
        reports: &reports,
        requested: &measured.plots,
        sections: &sections,
    };
    write_all(out, page)?;

    let table = reports.last().map(table).unwrap_or_default();
    say(&format!(
        "{table}{}{}\npage: {}\n",
        measured.notes.concat(),
        measured.text,
        out.join("index.html").display()
    ))?;
    match measured.failed.split_first() {
        None => Ok(ExitCode::SUCCESS),
        Some((first, others)) => {
            for error in others {
                print_error(format_args!("dem-post: {error}"));
            }
            bail!("{first}")
        }
    }
}

/// Writes a dump of each snapshot, and meshes of the shapes that a dump cannot describe.
fn write_dumps(out: &Path, snapshots: &[Snapshot], newest: &Path) -> Result<()> {
    let reader = Reader::open(newest)?;
    for (kind, name, mesh) in lammps::meshes(reader.header()) {
        write_file(&out.join(format!("type_{kind}.obj")), |file| file.write_all(mesh.as_bytes()))?;
        print_error(format_args!(
            "dem-post: OVITO draws particles of {name} as the ellipsoids in their boxes until type_{kind}.obj is loaded \
             as the shape of type {kind}"
        ));
    }
    for snapshot in snapshots {
        let reader = Reader::open(&snapshot.path)?;
        write_lammps(out, &reader).with_context(|| snapshot.path.display().to_string())?;
    }
    Ok(())
}

/// Region and contacts to measure.
fn choice(arguments: &Arguments) -> Choice {
    let region = arguments.region.map_or(Region::Whole, Region::Box);
    let among =
        if arguments.fabric_with_walls { Among::ParticlesAndWalls } else { Among::Particles };
    Choice { settings: Settings { region, among }, margin: arguments.margin }
}

/// Does a run write into this folder?
fn is_of_run(folder: &Path) -> bool {
    let is_there = |name: &str| folder.join(name).symlink_metadata().is_ok();
    [LAST, "history.csv", "performance.csv"].into_iter().any(is_there)
        || series::all(folder).is_ok()
}

/// Particle files of the arguments. Contact files, which a pattern such as `*.vtkhdf` also matches, are skipped: they are
/// read with their particles.
fn particle_files(arguments: &Arguments) -> Result<Vec<PathBuf>> {
    let Arguments { snapshots, diff: is_diff, .. } = arguments;
    let whole_series = arguments.series || arguments.compare;
    let (mut files, mut named_before) = (Vec::new(), BTreeSet::new());
    for argument in snapshots {
        let name = argument.file_name().unwrap_or_default().to_string_lossy();
        if name.starts_with("contacts_") && !argument.is_dir() {
            continue;
        }
        let named = match argument.is_dir() {
            true if whole_series => series::all(argument)?,
            true => vec![series::newest(argument)?],
            false => vec![argument.clone()],
        };
        for file in named {
            // `last.vtkhdf` is a link to a particles file.
            let file = file
                .canonicalize()
                .with_context(|| format!("there is no snapshot {}", file.display()))?;
            if !named_before.insert(file.clone()) && !*is_diff && name != LAST {
                print_error(format_args!(
                    "dem-post: {} is named twice, and counts once",
                    file.display()
                ));
            }
            files.push(file);
        }
    }
    ensure!(!files.is_empty(), "only contact files were given; name the particle files instead");
    Ok(files)
}

fn diff(files: &[PathBuf]) -> Result<ExitCode> {
    let [first, second] = files else {
        bail!("--diff takes two snapshots, not {}", files.len());
    };
    let state = |path: &PathBuf| -> Result<(State, Result<ContactTable, SnapshotError>)> {
        let reader = Reader::open(path)?;
        let state = State {
            particles: reader.particles(0..reader.particle_count())?,
            records: reader.contact_records(0..reader.contact_record_count())?,
            contacts: ContactTable::default(),
            header: reader.header().clone(),
        };
        Ok((state, reader.contact_count().and_then(|count| reader.contacts(0..count))))
    };
    let [(mut first, in_first), (mut second, in_second)] = [state(first)?, state(second)?];
    let unread = match (in_first, in_second) {
        (Ok(in_first), Ok(in_second)) => {
            (first.contacts, second.contacts) = (in_first, in_second);
            None
        }
        (in_first, in_second) => in_first.err().or(in_second.err()),
    };
    let difference = Difference::between(&first, &second);
    if let Some(error) = unread {
        if difference.is_empty() {
            bail!("the restart data are equal, but contacts files were not compared: {error}");
        }
        print_error(format_args!("dem-post: contacts files were not compared: {error}"));
    }
    say(&difference.to_string())?;
    Ok(ExitCode::from(u8::from(!difference.is_empty())))
}

fn write_lammps(out: &Path, reader: &Reader) -> Result<()> {
    let path = out.join(format!("particles_{:09}.dump", reader.header().step));
    write_file(&path, |file| {
        lammps::write_header(file, reader.header(), reader.particle_count())?;
        for rows in pieces(reader.particle_count()) {
            let particles = reader.particles(rows).map_err(io::Error::other)?;
            lammps::write_particles(file, reader.header(), &particles)?;
        }
        Ok(())
    })
}

/// Writes the requested surfaces, points and lines.
fn write_pictures(out: &Path, snapshots: &[Snapshot], arguments: &Arguments) -> Result<()> {
    let Arguments { surfaces, vtp: points, detail, .. } = *arguments;
    if points {
        write_vtp(out, snapshots, "particles", export::particles)?;
    }
    if !(surfaces || points) {
        return Ok(());
    }
    let contacts = write_vtp(out, snapshots, "contacts", export::contacts)?;
    if surfaces {
        let grains = write_vtp(out, snapshots, "grains", |reader| export::grains(reader, detail))?;
        let walls = write_vtp(out, snapshots, "walls", export::walls)?;
        write_list(out, "all", &[grains, walls, contacts])?;
    }
    Ok(())
}

/// Writes a file for each snapshot, and returns the list of them with their times, which it also writes.
fn write_vtp(
    out: &Path,
    snapshots: &[Snapshot],
    name: &str,
    of: impl Fn(&Reader) -> Result<PolyData, PostError>,
) -> Result<Files> {
    let mut files = Files::new();
    for Snapshot { path, step } in snapshots {
        let data = of(&Reader::open(path)?).with_context(|| path.display().to_string())?;
        let file = format!("{name}_{step:09}.vtp");
        write_file(&out.join(&file), |file| data.write(file))?;
        files.push((file, data.time));
    }
    write_list(out, name, std::slice::from_ref(&files))?;
    Ok(files)
}

fn write_list(out: &Path, name: &str, parts: &[Files]) -> Result<()> {
    write_file(&out.join(format!("{name}.pvd")), |file| vtp::write_list(file, parts))
}

fn write_file(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<()> {
    let written = files::replace(path, write).map(drop);
    written.with_context(|| format!("cannot write {}", path.display()))
}

/// Scalars of the run, if there are any. A damaged table is ignored, with a warning.
fn history_beside(directory: &Path) -> (History, Option<String>) {
    let path = directory.join("history.csv");
    let Ok(file) = files::open(&path) else { return (History::default(), None) };
    match History::read(file) {
        Ok(history) => (history, None),
        Err(error) => {
            let warning = format!("dem-post: {} is left out: {error}", path.display());
            print_error(format_args!("{warning}"));
            (History::default(), Some(warning))
        }
    }
}

/// Title of a run without one: the name of its folder.
fn title(directory: &Path) -> String {
    let name = directory.file_name().map(|n| n.to_string_lossy().into_owned());
    name.unwrap_or_else(|| "Snapshot".into())
}

fn write_all(out: &Path, page: Page) -> Result<()> {
    let write = |name: &str, text: &str| {
        write_file(&out.join(name), |file| file.write_all(text.as_bytes()))
    };
    write("report.json", &(serde_json::to_string_pretty(page.reports)? + "\n"))?;
    write("report.csv", &csv(page.reports.iter().map(|report| &report.summary))?)?;
    for plot in page.plots() {
        write(&format!("{}.svg", plot.name), &plot.svg)?;
    }
    write("index.html", &page.html())
}

/// Results in text form for a terminal.
fn table(report: &Report) -> String {
    let summary = &report.summary;
    let mut lines =
        vec![report.snapshot.clone(), format!("step {}, t = {} s", summary.step, summary.time_s)];
    for group in report.groups() {
        lines.push(format!("\n{}", group.title));
        lines.extend(group.rows.iter().map(|row| {
            let line = format!("  {:<32} {:>12} {}", row.label, row.value, row.unit);
            line.trim_end().to_string()
        }));
    }
    lines.extend(report.doubts.iter().map(|doubt| format!("\nwarning: {doubt}")));
    lines.join("\n") + "\n"
}

/// Prints to standard output.
fn say(text: &str) -> Result<()> {
    arguments::print(text).context("cannot write to standard output")
}
