"""Restitution of a body that lands flat on several balls at once, by this program and by LIGGGHTS: land.csv.

    python3 land.py > land.csv

Needs `dem-mpi` and `liggghts` on the path.
"""

import csv
import math
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
# File of balls, balls of the template, volume of the body [m3] by `dem-mpi land.toml --shape body`.
BODIES = [
    ("ball", 2, 4.188790204786e-9),
    ("row2_1", 2, 7.068583470577e-9),
    ("row3_1", 3, 9.948376736368e-9),
    ("row2_3", 2, 8.377580409573e-9),
    ("row3_3", 3, 1.256637061436e-8),
]
# Damping ratios for a restitution of 0.5: dashpots that never pull (by `dem-mpi --plan`), and those that may.
RATIOS = {"yes": 0.2553, "no": math.log(2) / math.hypot(math.pi, math.log(2))}


def ours(name, limited, folder):
    """Restitution by dem-mpi."""
    settings = [f'shape.body.file="{name}.txt"', f"law.limit_damping={'true' if limited == 'yes' else 'false'}"]
    arguments = [word for setting in settings for word in ("--set", setting)]
    subprocess.run(["dem-mpi", HERE / "land.toml", *arguments, "--out", folder], check=True, capture_output=True)
    with open(Path(folder) / "history.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    if float(rows[-1]["rotation_J"]) > 1e-6 * float(rows[0]["kinetic_J"]):
        sys.exit(f"land.py: {name} turns")
    return math.sqrt(float(rows[-1]["kinetic_J"]) / float(rows[0]["kinetic_J"]))


def theirs(name, balls, volume, limited):
    """Restitution by LIGGGHTS: mean velocity of the balls after over 0.1 m/s before."""
    dashpot = 2 * RATIOS[limited] * math.sqrt(5e3 / (2500 * volume))
    # A template has two balls at least: that of one ball has a smaller one within it.
    file = HERE / ("ball_liggghts.txt" if name == "ball" else f"{name}.txt")
    given = {"file": file, "n": balls, "gw": dashpot, "limit": "on" if limited == "yes" else "off"}
    words = [word for key, value in given.items() for word in ("-var", key, value)]
    command = ["liggghts", "-in", HERE / "land_liggghts.in", "-log", "none", *map(str, words)]
    text = subprocess.run(command, check=True, capture_output=True, text=True, stdin=subprocess.DEVNULL).stdout
    rows = [line.split() for line in text.splitlines()]
    return [float(row[2]) for row in rows if len(row) == 5 and row[0] == "800001"][-1] / 0.1


def main():
    out = csv.writer(sys.stdout, lineterminator="\n")
    out.writerow(["body", "dashpots_limited", "union", "multisphere"])
    for limited in RATIOS:
        for name, balls, volume in BODIES:
            with tempfile.TemporaryDirectory() as folder:
                union = ours(name, limited, folder + "/out")
            out.writerow([name, limited, f"{union:.4f}", f"{theirs(name, balls, volume, limited):.4f}"])
            sys.stdout.flush()


if __name__ == "__main__":
    main()
