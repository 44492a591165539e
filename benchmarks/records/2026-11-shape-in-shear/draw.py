"""Plots of table.csv: shape.svg and alignment.svg. Python alone is enough; the same table gives the same bytes.

    python3 benchmarks/records/2026-11-shape-in-shear/draw.py
"""

import csv
import math
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))
from plot import BOTTOM, COLOURS, HEIGHT, LEFT, RIGHT, TOP, WIDTH, ticks  # noqa: E402

MARKS = {"flat": "M{x} {y}m-4 0l4 -4l4 4l-4 4z", "long": "M{x} {y}m-4 0a4 4 0 1 0 8 0a4 4 0 1 0 -8 0z", "sphere": "M{x} {y}m-4 -4h8v8h-8z"}


class Axis:
    """Values between two ends as places [px]; `log` for aspect ratios."""

    def __init__(self, label, values, marks=None, log=False):
        self.label, self.log = label, log
        self.marks = marks or ticks(min(values), max(values))
        ends = [min(self.marks), max(self.marks)]
        self.low, self.high = (ends[0] / 1.08, ends[1] * 1.08) if log else ends

    def place(self, value, start, end):
        of = math.log if self.log else float
        return start + (of(value) - of(self.low)) / (of(self.high) - of(self.low)) * (end - start)


def frame(out, across, up, left, top):
    """Axes, grid and labels of a panel; the places of its ends."""
    x0, x1, y0, y1 = left + LEFT, left + WIDTH - RIGHT, top + HEIGHT - BOTTOM, top + TOP
    for value in across.marks:
        x = across.place(value, x0, x1)
        out.append(f'<path d="M{x:.1f} {y0}V{y1}" stroke="#DDDDDD"/>')
        out.append(f'<text x="{x:.1f}" y="{y0 + 16}" text-anchor="middle">{value:.4g}</text>')
    for value in up.marks:
        y = up.place(value, y0, y1)
        out.append(f'<path d="M{x0} {y:.1f}H{x1}" stroke="#DDDDDD"/>')
        out.append(f'<text x="{x0 - 6}" y="{y:.1f}" text-anchor="end" dy="0.35em">{value:.4g}</text>')
    out.append(f'<path d="M{x0} {y1}V{y0}H{x1}" stroke="#000000" fill="none"/>')
    out.append(f'<text x="{(x0 + x1) // 2}" y="{top + HEIGHT - 10}" text-anchor="middle">{across.label}</text>')
    middle = (y0 + y1) // 2
    out.append(f'<text x="{left + 14}" y="{middle}" text-anchor="middle" transform="rotate(-90 {left + 14} {middle})">{up.label}</text>')
    return x0, x1, y0, y1


def form(row):
    ratio = row["aspect_ratio"]
    return "flat" if ratio < 1 else "long" if ratio > 1 else "sphere"


def panel(out, rows, across, up, left, top, joined):
    """Points of rows by friction, with bars of three standard errors; `across` and `up` are (column or function, axis)."""
    x0, x1, y0, y1 = frame(out, across[1], up[1], left, top)
    of = lambda row, what: row[what] if isinstance(what, str) else what(row)
    for k, friction in enumerate(sorted({row["friction"] for row in rows})):
        colour, points = COLOURS[k], []
        for row in (row for row in rows if row["friction"] == friction):
            x, value = across[1].place(of(row, across[0]), x0, x1), of(row, up[0])
            y = up[1].place(value, y0, y1)
            points.append(f"{x:.1f},{y:.1f}")
            error = 3 * row.get(f"{up[0]}_error", 0.0)
            low, high = (up[1].place(value + sign * error, y0, y1) for sign in (-1, 1))
            out.append(f'<path d="M{x:.1f} {low:.1f}V{high:.1f}" stroke="{colour}"/>')
            out.append(f'<path d="{MARKS[form(row)].format(x=f"{x:.1f}", y=f"{y:.1f}")}" fill="#FFFFFF" stroke="{colour}" stroke-width="1.5"/>')
        if joined:
            out.insert(-3 * len(points), f'<polyline points="{" ".join(points)}" fill="none" stroke="{colour}" stroke-width="1.5"/>')


def legend(out, frictions, left, top, forms):
    for k, friction in enumerate(frictions):
        out.append(f'<path d="M{left} {top + 15 * k}h20" stroke="{COLOURS[k]}" stroke-width="2"/>')
        out.append(f'<text x="{left + 26}" y="{top + 15 * k}" dy="0.35em">friction {friction:g}</text>')
    for k, name in enumerate(forms):
        y = top + 15 * (k + len(frictions))
        out.append(f'<path d="{MARKS[name].format(x=left + 10, y=y)}" fill="#FFFFFF" stroke="#000000" stroke-width="1.5"/>')
        out.append(f'<text x="{left + 26}" y="{y}" dy="0.35em">{name}</text>')


def write(path, parts, rows):
    size = f'width="{2 * WIDTH}" height="{rows * HEIGHT}"'
    head = f'<svg {size} viewBox="0 0 {2 * WIDTH} {rows * HEIGHT}" xmlns="http://www.w3.org/2000/svg" font-family="sans-serif" font-size="11">'
    path.write_text("\n".join([head, f'<rect {size} fill="#FFFFFF"/>', *parts, "</svg>", ""]))


def main():
    with open(HERE / "table.csv", newline="") as file:
        rows = [{name: float(text) for name, text in row.items()} for row in csv.DictReader(file)]
    frictions = sorted({row["friction"] for row in rows})
    ratios = sorted({row["aspect_ratio"] for row in rows})
    by_ratio = "aspect_ratio", Axis("aspect ratio", ratios, [r for r in ratios if r not in (0.8, 1.25)], log=True)
    labels = {"stress_ratio": "shear stress over pressure", "solid_fraction": "solid fraction", "contacts": "contacts per grain", "spin": "mean spin over half the shear rate"}
    out = []
    for k, (name, label) in enumerate(labels.items()):
        values = [row[name] + sign * 3 * row[name + "_error"] for row in rows for sign in (-1, 1)]
        panel(out, rows, by_ratio, (name, Axis(label, values)), WIDTH * (k % 2), HEIGHT * (k // 2), True)
    legend(out, frictions, LEFT + 160, TOP + 12, [])
    write(HERE / "shape.svg", out, 2)

    order = Axis("order S2", [0.0, *(row["order"] for row in rows)])
    longer = [row for row in rows if row["aspect_ratio"] != 1.0]
    out = []
    size = (lambda row: abs(math.log(row["aspect_ratio"]))), Axis("|ln aspect ratio|", [0.0, 1.2])
    panel(out, rows, size, ("order", order), 0, 0, False)
    legend(out, frictions, LEFT + 14, TOP + 12, MARKS)
    spin = Axis(labels["spin"], [0.0, *(row["spin"] + 3 * row["spin_error"] for row in rows)])
    panel(out, rows, ("order", order), ("spin", spin), WIDTH, 0, False)
    angle = Axis("angle of the director to the flow (degrees)", [], [0, 30, 60, 90, 120, 150])
    panel(out, longer, by_ratio, ("angle", angle), 0, HEIGHT, False)
    fabric = Axis("anisotropy of contact normals", [0.0, *(row["fabric"] for row in rows)])
    panel(out, rows, by_ratio, ("fabric", fabric), WIDTH, HEIGHT, True)
    write(HERE / "alignment.svg", out, 2)


if __name__ == "__main__":
    main()
