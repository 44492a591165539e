"""Means of sheared spheroids from the folders of a sweep: table.csv. Needs numpy and h5py.

    python3 measure.py out/shape_in_shear_sweep FIRST LAST > table.csv

FIRST and LAST are the shear strains between which the means are taken. The errors are standard errors
of the means of five equal intervals of strain.
"""

import csv
import json
import re
import sys
from pathlib import Path

import h5py
import numpy as np

RATE = 10.0  # 1/s, of the scene
PARTS = 5
COLUMNS = ["friction", "aspect_ratio", "stress_ratio", "solid_fraction", "contacts", "spin", "order", "angle", "fabric", "overlap"]


def mean(strain, value, first, last):
    """Mean over the strains and its standard error, from intervals of equal length."""
    edges = np.linspace(first, last, PARTS + 1)
    parts = [value[(strain > low) & (strain <= high)].mean() for low, high in zip(edges, edges[1:])]
    return np.mean(parts), np.std(parts, ddof=1) / np.sqrt(PARTS)


def history(folder):
    """Columns of history.csv by name."""
    with open(folder / "history.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


def axes(quaternions):
    """Own x axes of the particles, (n, 3), from quaternions w, x, y, z."""
    w, x, y, z = quaternions.T
    return np.stack([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)], axis=1)


def order(tensor):
    """S2, the largest eigenvalue of <3/2 nn - 1/2>, and the angle of its axis from the flow towards the gradient, 0 to 180 degrees."""
    values, vectors = np.linalg.eigh(1.5 * tensor - 0.5 * np.eye(3))
    director = vectors[:, -1]
    return values[-1], np.degrees(np.arctan2(director[1], director[0])) % 180.0


def snapshots(folder):
    """Of each snapshot: strain, mean spin over half the shear rate, <nn> of the own x axes, <cc> of the contact normals."""
    rows = []
    for path in sorted(folder.glob("particles_*.vtkhdf")):
        with h5py.File(path) as file:
            time = float(file["/run"].attrs["time"])
            spin = file["/VTKHDF/PointData/angular_velocity"][:, 2].mean() / (-RATE / 2)
            n = axes(file["/VTKHDF/PointData/quaternion"][:])
        with h5py.File(path.with_name(path.name.replace("particles", "contacts"))) as file:
            c = file["/VTKHDF/CellData/normal"][:]
        rows.append((RATE * time, spin, n.T @ n / len(n), c.T @ c / max(len(c), 1)))
    strain, spin, nn, cc = zip(*rows)
    return np.array(strain), np.array(spin), np.array(nn), np.array(cc)


def fabric(cc):
    """Anisotropy of contact normals: 15/2 of the deviator of <cc>, its norm sqrt(3/2 a:a)."""
    a = 7.5 * (cc - np.trace(cc) / 3 * np.eye(3))
    return np.sqrt(1.5 * np.sum(a * a))


def row(folder, first, last):
    """All measures of a run, as name: (mean, standard error)."""
    of = history(folder)
    strain = -of["strain_xy"]
    stress = {k: of[f"contact_stress_{k}_Pa"] + of[f"kinetic_stress_{k}_Pa"] for k in ["xx", "yy", "zz", "xy"]}
    ratio = -stress["xy"] / np.maximum((stress["xx"] + stress["yy"] + stress["zz"]) / 3, 1e-9)
    taken = {"stress_ratio": ratio, "solid_fraction": of["solid_fraction"], "contacts": of["coordination"]}
    found = {name: mean(strain, value, first, last) for name, value in taken.items()}
    strain, spin, nn, cc = snapshots(folder)
    found["spin"] = mean(strain, spin, first, last)
    found["order"] = mean(strain, np.array([order(t)[0] for t in nn]), first, last)
    # Angles are those of the mean tensor of an interval, against the angle of the whole.
    among = (strain > first) & (strain <= last)
    whole = order(nn[among].mean(axis=0))[1]
    edges = np.linspace(first, last, PARTS + 1)
    parts = [order(nn[(strain > low) & (strain <= high)].mean(axis=0))[1] for low, high in zip(edges, edges[1:])]
    off = [(part - whole + 90) % 180 - 90 for part in parts]
    found["angle"] = whole, np.std(off, ddof=1) / np.sqrt(PARTS)
    found["fabric"] = mean(strain, np.array([fabric(t) for t in cc]), first, last)
    found["overlap"] = of["largest_overlap"].max(), 0.0
    return found


def main():
    out = csv.writer(sys.stdout, lineterminator="\n")
    out.writerow([*COLUMNS[:2], *(name for column in COLUMNS[2:-1] for name in (column, column + "_error")), COLUMNS[-1]])
    first, last = float(sys.argv[2]), float(sys.argv[3])
    rows = []
    for folder in Path(sys.argv[1]).iterdir():
        report = folder / "report.json"
        if report.is_file() and json.loads(report.read_text())["run"]["ended"] == "all_steps_done":
            keys = [float(re.search(name + r"=([0-9.]+)", folder.name)[1].rstrip(".")) for name in COLUMNS[:2]]
            rows.append((*keys, row(folder, first, last)))
    for friction, ratio, found in sorted(rows, key=lambda r: r[:2]):
        values = [text for name in COLUMNS[2:-1] for text in (f"{found[name][0]:.4g}", f"{found[name][1]:.1g}")]
        out.writerow([f"{friction:g}", f"{ratio:g}", *values, f"{found['overlap'][0]:.2g}"])


if __name__ == "__main__":
    main()
