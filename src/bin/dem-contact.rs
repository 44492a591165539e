//! dem-contact: overlap, normal and contact point of pairs, one row for each.

use anyhow::{Context, Result, bail, ensure};
use clap::{CommandFactory, Parser, ValueEnum};
use dem_mpi::arguments::{About, ended_by, outlive_limits_of_files, print_or_tell};
use dem_mpi::contact::{Epa, ErodedGjk, Method};
use dem_mpi::ids::MaterialId;
use dem_mpi::output::report::version;
use dem_mpi::pairs::read::read;
use dem_mpi::pairs::{Answer, Pairs, resolve, time, write};
use dem_mpi::scene::Scene;
use dem_mpi::text::{self, Unreadable, print_error};
use std::fs;
use std::io::{BufWriter, Read};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Resolves pairs of bodies: overlap, normal and contact point of each, as CSV on standard output.
///
/// PAIRS is CSV (ellipsoids: id,aA,bA,cA,aB,bB,cB,xA,yA,zA,qwA,qxA,qyA,qzA,xB,..,qzB) or JSON Lines (spheres:
/// id,rA,rB,cA,cB; superellipsoids: id,A,B with abc,e1,e2,c,q; polyhedra: id,VA,FA,VB,FB; unions: id,UA,UB, lists of
/// pieces, each a ball with r,c, a superellipsoid with abc,e1,e2,c,q or a polyhedron with V). Lengths are in metres;
/// quaternions w,x,y,z turn the body into the world and need not be normalised. Other columns are ignored.
///
/// The normal n is a unit vector from A to B, PA and PB are the support points of the bodies along it, C is their middle. A
/// pair that is apart has a negative overlap: minus the clearance, with the direction of the shortest distance, by GJK to
/// rounding for any method (methods only determine that a pair is apart). `solver` names the stage of the method's chain
/// that answered; it and the numbers are empty without an answer. `iterations` counts the directions that all stages tried
/// together. Each takes one support point of each body; closed forms take none. For overlapping polyhedra, `thickness` is
/// that of their common region. A simulation finds the force from it, unless a method is set by name. F, M and energy are
/// the force of A on B, its moment about the centre of A and the energy of the contact for a stiffness of 1 N/m.
///
/// If one of two bodies is a union, there is a row for each place where they touch, as in a simulation: overlap, normal and
/// point of that contact, PA and PB half the overlap before and behind the point, and force, moment and energy. Bodies that
/// are apart have one row, for their nearest pieces.
///
/// Standard error shows the time per pair, medians of the repeats: cold, one by one without a guess; warm, one by one from
/// normals that are off by 1e-4; batched, many at once from the same normals, as in a simulation.
#[derive(Parser)]
#[command(name = "dem-contact", version = version(), max_term_width = 100, args_override_self = true, after_help = EXAMPLES)]
struct Arguments {
    /// File of pairs, `-` for standard input
    #[arg(required = true)]
    pairs: Option<PathBuf>,

    #[command(flatten)]
    about: About,

    /// Contact method; two spheres always have a closed form
    #[arg(long, value_enum, default_value_t = Word::Auto)]
    method: Word,

    /// A setting of the method: erosion_ratio (0.05) and erosion_increment (0.01) of gjk-erosion, tolerance
    /// of gjk-erosion (1e-6) and epa (1e-8), spurious of gjk-erosion (true), polish of epa (true); may be
    /// repeated
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,

    /// Scene whose law gives the force F of A on B in each pair, its moment M about the centre of A and the stored energy,
    /// at rest and without history, in columns law_Fx to law_energy
    #[arg(long, value_name = "SCENE")]
    law: Option<PathBuf>,

    /// Materials of A and B in that scene; optional if it has only one
    #[arg(long, value_name = "A,B", requires = "law", value_delimiter = ',')]
    materials: Vec<String>,

    /// The pairs have touched before: with adhesion = "jkr" they stick across a gap
    #[arg(long, requires = "law")]
    touched: bool,

    /// Measurements of each time, for the median; 0: none
    #[arg(long, default_value_t = 5, allow_negative_numbers = true)]
    repeats: usize,
}

const EXAMPLES: &str = "\
Examples:
  dem-contact pairs.csv                               the common normal of every pair
  dem-contact pairs.csv --method gjk-erosion --set erosion_ratio=0.02 --set tolerance=1e-8
  dem-contact pairs.csv --method epa --repeats 0      answers only, no times
  dem-contact pairs.csv --law scene.toml              with forces and energies by the law of a scene
  some-program | dem-contact - > answers.csv          pairs from standard input

Exit status: 0 every pair has an answer; 1 some have none; 2 the file or an argument is wrong.";

#[derive(Clone, Copy, ValueEnum)]
enum Word {
    Auto,
    CommonNormal,
    GjkErosion,
    Epa,
}

/// Some pairs have no answer.
const INCOMPLETE: u8 = 1;
/// The file or an argument is wrong.
const WRONG_INPUT: u8 = 2;

fn main() -> ExitCode {
    outlive_limits_of_files();
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => return ExitCode::from(ended_by(&error)),
    };
    if let Some(text) = arguments.about.text(Arguments::command()) {
        let printed = print_or_tell("dem-contact", &text);
        return printed.map_or_else(|status| status, |()| ExitCode::SUCCESS);
    }
    match run(&arguments) {
        Ok(code) => code,
        Err(error) if is_closed_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            print_error(format_args!("dem-contact: {error:#}"));
            ExitCode::from(WRONG_INPUT)
        }
    }
}

/// A reader that stops early, such as `head`, is no error.
fn is_closed_pipe(error: &anyhow::Error) -> bool {
    let kind = match error.downcast_ref::<csv::Error>().map(csv::Error::kind) {
        Some(csv::ErrorKind::Io(error)) => Some(error.kind()),
        _ => None,
    };
    kind == Some(std::io::ErrorKind::BrokenPipe)
}

fn run(arguments: &Arguments) -> Result<ExitCode> {
    let to = BufWriter::new(std::io::stdout().lock());
    let method = method(arguments.method, &arguments.set)?;
    let pairs = arguments.pairs.as_deref().context("no pairs given")?;
    let (file, text) = text(pairs)?;
    let pairs = read(&file, &text)?;
    let mut answers = resolve(&pairs, &method);
    for (index, answer) in answers.iter_mut().enumerate() {
        if pairs.has_union(index) && answer.touch.is_ok() {
            let [a, b] = pairs.bodies_of(index);
            let places = Scene::places_by(&method, [&a, &b]);
            answer.places = places.with_context(|| format!("pair {}", pairs.name(index)))?;
        }
    }
    let by_law = match &arguments.law {
        Some(scene) => Some(by_law(scene, arguments, &pairs, &mut answers)?),
        None => None,
    };
    write::answers(&pairs, &answers, by_law.as_deref(), to)?;
    // No method resolves unions; their pieces are resolved instead.
    let any_convex = (0..pairs.len()).any(|pair| !pairs.has_union(pair));
    if arguments.repeats > 0 && any_convex {
        let times = time(&pairs, &answers, &method, arguments.repeats);
        print_error(format_args!(
            "{} pairs, {}: {:.1} ns cold, {:.1} ns warm, {:.1} ns batched (per pair, median of {})",
            pairs.len(),
            method.name(),
            times.cold,
            times.warm,
            times.batched,
            arguments.repeats
        ));
    }
    let complete = all_answered(&pairs, &answers);
    Ok(if complete { ExitCode::SUCCESS } else { ExitCode::from(INCOMPLETE) })
}

/// Force, moment and stored energy of each pair by the law of a scene.
fn by_law(
    scene: &Path,
    arguments: &Arguments,
    pairs: &Pairs,
    answers: &mut [Answer],
) -> Result<Vec<[f64; 7]>> {
    let scene = Scene::read(scene, &[])?;
    let Arguments { materials, touched, .. } = arguments;
    let materials = match &materials[..] {
        [] if scene.materials.len() == 1 => [MaterialId(0); 2],
        [one] => [scene.material(one)?; 2],
        [a, b] => [scene.material(a)?, scene.material(b)?],
        _ => bail!("--materials A,B: write the names of two materials of the scene"),
    };
    let of_pair = |(index, answer): (usize, &mut Answer)| {
        let [a, b] = pairs.bodies_of(index);
        let name = || format!("--law, pair {}", pairs.name(index));
        if !answer.places.is_empty() {
            let places = scene.places([&a, &b], materials).with_context(name)?;
            ensure!(
                places.len() == answer.places.len(),
                "{}: the scene's method is {}, this one {}: give the same --method",
                name(),
                places.len(),
                answer.places.len()
            );
            for (place, (_, acting)) in answer.places.iter_mut().zip(places) {
                place.by_law = Some(acting.numbers());
            }
        }
        let acting = scene.acting([&a, &b], materials, *touched).with_context(name)?;
        Ok(acting.numbers())
    };
    answers.iter_mut().enumerate().map(of_pair).collect()
}

/// Warns of pairs without an answer; true if all have one.
fn all_answered(pairs: &Pairs, answers: &[Answer]) -> bool {
    let mut unanswered =
        (0..).zip(answers).filter_map(|(k, answer)| Some((k, answer.touch.err()?)));
    let Some((first, why)) = unanswered.next() else { return true };
    let count = 1 + unanswered.count();
    print_error(format_args!(
        "dem-contact: {count} pairs have no answer, the first is {}: {why:?}",
        pairs.name(first)
    ));
    false
}

fn method(word: Word, settings: &[String]) -> Result<Method> {
    let mut erosion = ErodedGjk::default();
    let mut epa = Epa::default();
    for setting in settings {
        let (key, value) =
            setting.split_once('=').with_context(|| format!("--set {setting}: write KEY=VALUE"))?;
        let flag = || value.parse().with_context(|| format!("--set {setting}"));
        let place = match (word, key) {
            (Word::GjkErosion, "erosion_ratio") => &mut erosion.ratio,
            (Word::GjkErosion, "erosion_increment") => &mut erosion.increment,
            (Word::GjkErosion, "tolerance") => &mut erosion.tolerance,
            (Word::Epa, "tolerance") => &mut epa.tolerance,
            (Word::GjkErosion, "spurious") => {
                erosion.spurious = flag()?;
                continue;
            }
            (Word::Epa, "polish") => {
                epa.polish = flag()?;
                continue;
            }
            _ => {
                bail!(
                    "--set {setting}: the settings are erosion_ratio, erosion_increment, tolerance and spurious of \
                     gjk-erosion, tolerance and polish of epa; the method here is {}",
                    word.to_possible_value().expect("no word is hidden").get_name()
                )
            }
        };
        *place = value.parse().with_context(|| format!("--set {setting}"))?;
        ensure!(*place > 0.0 && *place < 1.0, "--set {setting}: must lie between 0 and 1");
        let least = ErodedGjk::LEAST_INCREMENT;
        ensure!(erosion.increment >= least, "--set {setting}: must be at least {least}");
    }
    Ok(match word {
        Word::Auto => Method::Auto,
        Word::CommonNormal => Method::CommonNormal,
        Word::GjkErosion => Method::GjkErosion(erosion),
        Word::Epa => Method::Epa(epa),
    })
}

/// Name of the file in messages, and its text.
fn text(path: &Path) -> Result<(String, String)> {
    let (name, bytes) = if path == Path::new("-") {
        let mut bytes = Vec::new();
        let read = std::io::stdin().read_to_end(&mut bytes);
        ("standard input".to_owned(), read.map(|_| bytes))
    } else {
        (path.display().to_string(), fs::read(path))
    };
    let text = bytes.map_err(Unreadable::File).and_then(text::decode);
    let text = text.with_context(|| name.clone())?;
    Ok((name, text))
}
