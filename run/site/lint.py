"""Checks of the files for sites against Cargo.toml, run/setup and the folder of the project; called by run/site/check.

    python3 run/site/lint.py dockerfile | definition | package | apt
"""

import ast
import re
import subprocess
import sys
import tomllib
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parent.parent
CARGO = tomllib.loads((ROOT / "Cargo.toml").read_text())
VERSION = CARGO["package"]["version"]
RUST = CARGO["workspace"]["package"]["rust-version"]
INSTRUCTIONS = {"ARG", "CMD", "COPY", "ENTRYPOINT", "ENV", "EXPOSE", "FROM", "LABEL", "RUN", "SHELL", "USER", "VOLUME", "WORKDIR"}
SECTIONS = {"environment", "files", "help", "labels", "post", "runscript", "test"}
SHELL_SECTIONS = {"environment", "post", "runscript", "test"}
# All that `cargo install --path .` reads, and the scripts that prepare it.
NEEDED = [".cargo", "Cargo.lock", "Cargo.toml", "benchmarks", "run", "src", "tests"]

faults = []


def expect(holds, fault):
    if not holds:
        faults.append(fault)


def shell(text, where):
    """Parses a text as bash does, without running it."""
    said = subprocess.run(["bash", "-n"], input=text, capture_output=True, text=True)
    expect(said.returncode == 0, f"{where}: {said.stderr.strip()}")


def installed(text):
    """Packages of `apt-get install` in a text of commands."""
    commands = re.sub(r"\\\n", " ", text)
    found = re.findall(r"apt-get install ([^&\n]*)", commands)
    return sorted(word for words in found for word in words.split() if not word.startswith("-"))


def instructions(text):
    """Instructions of a Dockerfile with their words, continued lines joined."""
    lines = [line for line in text.splitlines() if not line.lstrip().startswith("#")]
    joined = re.sub(r"\\\n", " ", "\n".join(lines))
    return [line.strip().partition(" ")[::2] for line in joined.splitlines() if line.strip()]


def dockerfile():
    text = (HERE / "Dockerfile").read_text()
    stages = []
    parts = instructions(text)
    expect(parts and parts[0][0] == "FROM", "Dockerfile: the first instruction is not FROM")
    for name, words in parts:
        expect(name in INSTRUCTIONS, f"Dockerfile: {name} is no instruction")
        if name == "FROM":
            image, _, stage = words.partition(" AS ")
            expect(image in stages or re.fullmatch(r"[a-z]+:[\w.-]+", image), f"Dockerfile: {image}: neither a stage nor an image with its version")
            expect(not image.startswith("rust:") or image.startswith(f"rust:{RUST}-"), f"Dockerfile: {image}, but Cargo.toml has Rust {RUST}")
            stages.append(stage)
        elif name == "RUN":
            shell(words, "Dockerfile: RUN")
        elif name == "COPY" and words.startswith("--from="):
            stage = words.split()[0].removeprefix("--from=")
            expect(stage in stages, f"Dockerfile: there is no stage {stage}")
        elif name == "COPY":
            for source in words.split()[:-1]:
                expect((ROOT / source).exists(), f"Dockerfile: there is no {source}")
    expect(f"image.version={VERSION}" in text, f"Dockerfile: the label has another version than {VERSION}")
    expect("dem-mpi --self-test" in text, "Dockerfile: no self-test")


def sections():
    """Headers and sections of the definition: (stage, name, text)."""
    stage, found = 0, []
    for line in (HERE / "apptainer.def").read_text().splitlines(keepends=True):
        if line.startswith("Bootstrap:"):
            stage += 1
            found.append([stage, "header", ""])
        elif line.startswith("%"):
            found.append([stage, line[1:].split()[0], ""])
            continue
        if found:
            found[-1][2] += line
    return found


def definition():
    found = sections()
    stages = [text for _, name, text in found if name == "header"]
    expect(len(stages) == 2, f"apptainer.def: {len(stages)} stages")
    for text in stages:
        keys = dict(line.split(": ") for line in text.splitlines() if ": " in line)
        expect(set(keys) == {"Bootstrap", "From", "Stage"}, f"apptainer.def: header {sorted(keys)}")
        image = f"FROM {keys.get('From')} "
        expect(image in (HERE / "Dockerfile").read_text(), f"apptainer.def: {image}is no image of the Dockerfile")
    for stage, name, text in found:
        expect(name == "header" or name in SECTIONS, f"apptainer.def: %{name} is no section")
        if name in SHELL_SECTIONS:
            shell(text, f"apptainer.def: %{name}")
        if name == "files" and stage == 1:
            copied = [line.split() for line in text.splitlines() if line.strip()]
            expect(sorted(words[0] for words in copied) == sorted(NEEDED), f"apptainer.def: %files has {copied}")
            expect(all(to == f"/source/{source}" for source, to in copied), "apptainer.def: %files")
    whole = (HERE / "apptainer.def").read_text()
    expect(re.findall(r"^ *Version (.*)$", whole, re.M) == [VERSION], f"apptainer.def: the label has another version than {VERSION}")
    expect(installed(whole) == installed((HERE / "Dockerfile").read_text()), "apptainer.def and Dockerfile install other packages")
    for command in ["./run/setup --mpi mpich", "cargo install --locked --path . --root /opt/dem-mpi", "dem-mpi --self-test",
                    "ln -s /host/mpi/libmpi.so.12 /opt/host-mpi/libmpich.so.12"]:
        for file in ["apptainer.def", "Dockerfile"]:
            expect(command in (HERE / file).read_text(), f"{file}: no `{command}`")


def calls():
    """Directives of the recipe: (name, positional words, keywords)."""
    [recipe] = [node for node in ast.parse((HERE / "package.py").read_text()).body if isinstance(node, ast.ClassDef)]
    expect(recipe.name == "DemMpi", f"package.py: the class of dem-mpi is DemMpi, not {recipe.name}")
    found = [node.value for node in recipe.body if isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)]
    described = " ".join((ast.get_docstring(recipe) or "").split()).rstrip(".")
    expect(described == CARGO["package"]["description"], "package.py: the text is not the description of Cargo.toml")
    return [(call.func.id, [word.value for word in call.args], {k.arg: ast.literal_eval(k.value) for k in call.keywords}) for call in found]


def package():
    found = calls()
    versions = [words for name, words, _ in found if name == "version"]
    expect(versions == [[VERSION]], f"package.py: versions {versions}, not {VERSION}")
    licenses = [words for name, words, _ in found if name == "license"]
    expect(licenses == [[CARGO["workspace"]["package"]["license"]]], f"package.py: {licenses}")
    needs = {re.split(r"[@+]", words[0])[0]: (words[0], keys.get("type")) for name, words, keys in found if name == "depends_on"}
    expect(needs.get("rust") == (f"rust@{RUST}:", "build"), f"package.py: {needs.get('rust')}, not Rust {RUST}")
    for crate, need in [("mpi", "mpi"), ("hdf5-metno", "hdf5")]:
        expect((crate in CARGO["dependencies"]) == (need in needs), f"package.py and Cargo.toml differ about {need}")
        expect(needs.get(need, (None, 1))[1] is None, f"package.py: {need} is needed at run time, too")
    if "mpio" in CARGO["dependencies"]["hdf5-metno"]["features"]:
        expect("+mpi" in needs.get("hdf5", ("", None))[0], "package.py: an HDF5 without MPI")
    # The MPI and HDF5 of run/setup, a linker, and its libclang and pkg-config.
    expect(set(needs) == {"c", "hdf5", "llvm", "mpi", "pkgconfig", "rust"}, f"package.py: {sorted(needs)}")


def apt():
    """Packages of the images exist in this Debian, and are those of run/setup or the libraries of those."""
    setup = (ROOT / "run/setup").read_text()
    development = re.search(r"^mpich\) packages\+=\((.*?)\)", setup, re.M)[1].split()
    for name in installed((HERE / "Dockerfile").read_text()):
        shown = subprocess.run(["apt-cache", "show", name], capture_output=True, text=True)
        expect(shown.returncode == 0, f"{name} is no package of this Debian")
        asked = subprocess.run(["apt-cache", "depends", *development], capture_output=True, text=True, check=True)
        expect(name in development or f"Depends: {name}\n" in asked.stdout, f"run/setup installs no {name}")


{"dockerfile": dockerfile, "definition": definition, "package": package, "apt": apt}[sys.argv[1]]()
for fault in faults:
    print(f"run/site/check: {fault}", file=sys.stderr)
sys.exit(1 if faults else 0)
