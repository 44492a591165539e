//! Readers of files under mutated input: no panic and no hang, an error or a scene.
//!
//! Every file of `tests/corpus` is read unchanged, then mutated. The corpus has inputs that once ended in a panic, a hang or
//! silence.

use dem_mpi::pairs;
use dem_mpi::random::Random;
use dem_mpi::scene::Scene;
use dem_mpi::scene::doubts::doubts;
use dem_mpi::scene::plan::plan;
use dem_mpi::text;
use std::collections::BTreeMap;
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

/// Mutated inputs of each kind.
const INPUTS: usize = 350;
/// Time limit of one input, which takes some milliseconds on an idle machine.
const LONGEST: Duration = Duration::from_secs(30);

const OF_PARTICLES: &str = "[[fill.file]]\npath = \"FILE\"\n";

/// Kinds of input with the scene text that refers to the file; the corpus has a folder of each name.
const KINDS: [(&str, &str); 9] = [
    ("scene", ""),
    ("csv", OF_PARTICLES),
    ("txt", OF_PARTICLES),
    ("data", OF_PARTICLES),
    ("dump", OF_PARTICLES),
    (
        "motion",
        "[[wall]]\nname = \"lid\"\npoint = [0, 0, 0]\nnormal = [0, 0, 1]\n[[motion]]\nwalls = [\"lid\"]\nalong = [0, 0, 1]\ntable = \"FILE\"\ninterpolation = \"smooth\"\n",
    ),
    (
        "stl",
        "[[wall]]\nname = \"part\"\nmesh = \"FILE\"\n[[shape]]\nname = \"stone\"\nkind = \"polyhedron\"\nfile = \"FILE\"\n",
    ),
    (
        "obj",
        "[[wall]]\nname = \"part\"\nmesh = \"FILE\"\n[[shape]]\nname = \"stone\"\nkind = \"polyhedron\"\nfile = \"FILE\"\n",
    ),
    ("pairs", ""),
];

/// Remaining tables of a scene.
const SCENE: &str = r#"
[domain]
low = [-1, -1, -1]
high = [1, 1, 1]
[[material]]
name = "glass"
density = 2500
normal_stiffness = 1e5
[[shape]]
name = "box"
kind = "polyhedron"
edges = [0.1, 0.1, 0.1]
[time]
step = "auto"
steps = 10
[output]
directory = "out"
"#;

/// Folder of valid scenes.
const SCENES: &str = "scenes/good";

/// Words that change the meaning of their surroundings.
const WORDS: [&str; 40] = [
    "1e308",
    "-1e308",
    "1e-308",
    "1e400",
    "nan",
    "inf",
    "-inf",
    "0",
    "-1",
    "1e18",
    "1e30",
    "-1e30",
    "1e-30",
    "9223372036854775808",
    "4294967297",
    "65537",
    "0.1",
    ".5",
    "1.",
    "[",
    "]",
    "{",
    "}",
    "[[",
    "\"",
    "'",
    "=",
    ",",
    ";",
    "\n",
    "\r",
    "\0",
    "\u{feff}",
    "\u{1b}[31m",
    "#",
    "true",
    "1979-05-27",
    "\\",
    "é",
    " ",
];

struct Mutator(Random);

impl Mutator {
    fn below(&mut self, count: usize) -> usize {
        ((self.0.unit() * count as f64) as usize).min(count.saturating_sub(1))
    }

    fn word(&mut self) -> Vec<u8> {
        WORDS[self.below(WORDS.len())].as_bytes().to_vec()
    }

    /// Range of some bytes of an input.
    fn range(&mut self, bytes: &[u8], most: usize) -> std::ops::Range<usize> {
        let begin = self.below(bytes.len() + 1);
        begin..(begin + self.below(most) + 1).min(bytes.len())
    }

    /// Range of the bytes of a number, or an empty range.
    fn number(&mut self, bytes: &[u8]) -> std::ops::Range<usize> {
        let is_part = |byte: &u8| byte.is_ascii_digit() || b".+-eE".contains(byte);
        let from = self.below(bytes.len() + 1);
        let Some(begin) = bytes[from..].iter().position(u8::is_ascii_digit) else { return 0..0 };
        let begin = from + begin;
        begin..begin + bytes[begin..].iter().take_while(|byte| is_part(byte)).count()
    }

    fn mutated(&mut self, bytes: &[u8], other: &[u8]) -> Vec<u8> {
        let mut bytes = bytes.to_vec();
        for _ in 0..=self.below(4) {
            let range = self.range(&bytes, 30);
            match self.below(8) {
                0..=2 => {
                    let (number, word) = (self.number(&bytes), self.word());
                    drop(bytes.splice(number, word));
                }
                3 => drop(bytes.drain(range)),
                4 => {
                    let word = self.word();
                    drop(bytes.splice(range.start..range.start, word));
                }
                5 => {
                    let piece = bytes[range.clone()].repeat(1 + self.below(30));
                    drop(bytes.splice(range, piece));
                }
                6 => {
                    let piece = self.range(other, 200);
                    drop(bytes.splice(range, other[piece].to_vec()));
                }
                _ if range.is_empty() => bytes.truncate(range.start),
                _ => bytes[range.start] ^= 1 << self.below(8),
            }
        }
        bytes
    }
}

/// Reads an input, and processes it like `--plan`.
fn read(kind: &str, extra: &str, bytes: &[u8], folder: &Path) {
    if kind == "pairs" {
        let Ok(text) = text::decode(bytes.to_vec()) else { return };
        let Ok(pairs) = pairs::read::read("pairs", &text) else { return };
        for answer in pairs::resolve(&pairs, &dem_mpi::contact::Method::Auto) {
            if let Ok(touch) = answer.touch {
                let numbers = [touch.overlap].into_iter().chain(touch.normal.iter().copied());
                let mut numbers = numbers.chain(touch.point.iter().copied());
                assert!(numbers.all(f64::is_finite), "{touch:?}");
            }
        }
        return;
    }
    let (text, place) = if kind == "scene" {
        let Ok(text) = text::decode(bytes.to_vec()) else { return };
        (text, Path::new("tests").join(SCENES))
    } else {
        let name = format!("mutated.{kind}");
        fs::write(folder.join(&name), bytes).unwrap();
        let fill = if extra == OF_PARTICLES {
            ""
        } else {
            "[[fill.lattice]]\nshapes = [\"box\"]\nfirst = [0, 0, 0]\ncount = [1, 1, 1]\n"
        };
        (format!("{SCENE}{fill}{}", extra.replace("FILE", &name)), folder.to_path_buf())
    };
    match Scene::parse(&text, "scene.toml", &place, &[]) {
        Ok(scene) => {
            assert!(scene.dt.is_finite() && scene.dt > 0.0, "{}", scene.dt);
            doubts(&scene);
            plan(&scene, 2);
        }
        Err(errors) => {
            let said = errors.to_string();
            assert!(said.lines().count() <= 22 && said.len() < 60_000, "{} bytes", said.len());
            assert!(text::printable(&said) == said, "{said:?}");
        }
    }
}

/// Files of a kind, by name.
fn corpus(kind: &str) -> Vec<Vec<u8>> {
    let tests = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests");
    let mut folders = vec![tests.join("corpus").join(kind)];
    if kind == "scene" {
        folders.push(tests.join(SCENES));
    }
    let entries = folders.iter().flat_map(|folder| fs::read_dir(folder).unwrap());
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    files.retain(|file| kind != "scene" || file.extension().is_some_and(|ending| ending == "toml"));
    files.sort();
    files.iter().map(|file| fs::read(file).unwrap()).collect()
}

/// An input that is about to be read, or the panic of the previous one.
enum Event {
    Begins(&'static str, Vec<u8>),
    Panicked(&'static str, String),
}

/// Reads all inputs of a kind.
fn read_all(kind: &'static str, extra: &str, seed: u64, events: &mpsc::Sender<Event>) {
    let folder = tempfile::tempdir().unwrap();
    let files = corpus(kind);
    let mut mutator = Mutator(Random::of(seed, kind.len() as u64));
    for k in 0..files.len() + INPUTS {
        let bytes = if let Some(file) = files.get(k) {
            file.clone()
        } else {
            let [one, other] = [(); 2].map(|()| mutator.below(files.len()));
            mutator.mutated(&files[one], &files[other])
        };
        events.send(Event::Begins(kind, bytes.clone())).unwrap();
        let result = catch_unwind(AssertUnwindSafe(|| read(kind, extra, &bytes, folder.path())));
        if let Err(panic) = result {
            let text = panic.downcast_ref::<String>().cloned();
            let text = text.or_else(|| Some((*panic.downcast_ref::<&str>()?).to_owned()));
            events.send(Event::Panicked(kind, text.unwrap_or_default())).unwrap();
        }
    }
}

#[test]
fn mutated_files_give_an_error_or_a_scene() {
    let seed: u64 = std::env::var("DEM_MPI_FUZZ_SEED").map_or(1, |seed| seed.parse().unwrap());
    println!("DEM_MPI_FUZZ_SEED={seed}");
    let (sender, events) = mpsc::channel();
    for (kind, extra) in KINDS {
        let sender = sender.clone();
        std::thread::spawn(move || read_all(kind, extra, seed, &sender));
    }
    drop(sender);
    let mut current: BTreeMap<&str, Vec<u8>> = BTreeMap::new();
    let mut failures = Vec::new();
    let mut keep = |kind: &str, bytes: &[u8], why: String| {
        let name = format!("mutated_{}.{kind}", failures.len());
        let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
        fs::write(&file, bytes).unwrap();
        failures.push(format!("{}: {why}", file.display()));
    };
    loop {
        match events.recv_timeout(LONGEST) {
            Ok(Event::Begins(kind, bytes)) => drop(current.insert(kind, bytes)),
            Ok(Event::Panicked(kind, why)) => keep(kind, &current[kind], why),
            Err(RecvTimeoutError::Disconnected) => break,
            Err(RecvTimeoutError::Timeout) => {
                // Finished kinds are among them, too.
                for (kind, bytes) in &current {
                    keep(kind, bytes, "may hang".to_owned());
                }
                break;
            }
        }
    }
    assert!(failures.is_empty(), "{failures:#?}");
}
