"""Curves of records from their tables, in the look of `benchmarks/benchmarking/src/lines.rs`. Python 3.9 alone is enough.

    python3 benchmarks/records/plot.py benchmarks/records/2026-11-drum ...

writes the pictures (*.svg) beside the tables; the same tables give the same bytes.
"""

import csv
import math
import sys
from pathlib import Path

# Okabe and Ito's.
COLOURS = ["#0072B2", "#D55E00", "#009E73", "#E69F00", "#CC79A7", "#56B4E9"]
NAMES = {"dem_mpi": "dem-mpi", "dem_mpi_tenth": "dem-mpi, E/10", "liggghts": "LIGGGHTS", "musen": "MUSEN", "m1": "M1", "m2": "M2"}
# Pixels: a panel with its labels, and what these take on the left, the right, above and below.
WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 480, 300, 70, 14, 12, 46


class Line:
    """A name, times from 0 on and values; without `joined` points stand alone."""

    def __init__(self, name, x, y, joined=True):
        self.name, self.x, self.y, self.joined = name, x, y, joined


class Panel:
    """Lines over time. The legend stands in a corner: `tl`, `tr`, `bl` or `br`."""

    def __init__(self, label, lines, legend="tr"):
        self.label, self.lines, self.legend = label, lines, legend


def ticks(low, high):
    """Round values from at most `low` to at least `high`."""
    rough = (high - low) / 6
    power = 10 ** math.floor(math.log10(rough))
    step = next(m * power for m in (1, 2, 5, 10) if m * power >= rough * (1 - 1e-9))
    return [k * step for k in range(math.floor(low / step + 1e-9), math.ceil(high / step - 1e-9) + 1)]


def panel_svg(panel, left, top):
    out = []
    end = max(max(line.x) for line in panel.lines)
    xs = [value for value in ticks(0, end) if value <= end * (1 + 1e-9)]
    low, high = (limit(limit(line.y) for line in panel.lines) for limit in (min, max))
    # From zero, if that does not hide what is to be seen.
    ys = ticks(0 if 0 <= low < 0.5 * high else low, high)
    x0, x1, y0, y1 = left + LEFT, left + WIDTH - RIGHT, top + HEIGHT - BOTTOM, top + TOP

    def place(x, y):
        across = x0 + x / end * (x1 - x0)
        return f"{across:.1f}", f"{y0 + (y - ys[0]) / (ys[-1] - ys[0]) * (y1 - y0):.1f}"

    def text(x, y, words, more):
        out.append(f'<text x="{x}" y="{y}" {more}>{words}</text>')

    for value in xs:
        x = place(value, ys[0])[0]
        out.append(f'<path d="M{x} {y0}V{y1}" stroke="#DDDDDD"/>')
        text(x, y0 + 16, f"{value:.10g}", 'text-anchor="middle"')
    for value in ys:
        y = place(xs[0], value)[1]
        out.append(f'<path d="M{x0} {y}H{x1}" stroke="#DDDDDD"/>')
        text(x0 - 6, y, f"{value:,.10g}", 'text-anchor="end" dy="0.35em"')
    out.append(f'<path d="M{x0} {y1}V{y0}H{x1}" stroke="#000000" fill="none"/>')
    text((x0 + x1) // 2, top + HEIGHT - 10, "time (s)", 'text-anchor="middle"')
    middle = (y0 + y1) // 2
    text(left + 14, middle, panel.label, f'text-anchor="middle" transform="rotate(-90 {left + 14} {middle})"')
    at_right, at_bottom = panel.legend[1] == "r", panel.legend[0] == "b"
    first_x = x1 - 110 if at_right else x0 + 12
    first_y = y0 - 8 - 15 * len(panel.lines) if at_bottom else y1 + 8
    legend = [f'<rect x="{first_x - 6}" y="{first_y - 2}" width="112" height="{15 * len(panel.lines) + 4}" fill="#FFFFFF" opacity="0.8"/>']
    for k, line in enumerate(panel.lines):
        colour = COLOURS[k % len(COLOURS)]
        places = [place(x, y) for x, y in zip(line.x, line.y)]
        if line.joined and len(places) > 1:
            points = " ".join(",".join(point) for point in places)
            out.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="2"/>')
        elif line.joined:
            out += [f'<circle cx="{x}" cy="{y}" r="3" fill="{colour}"/>' for x, y in places]
        else:
            # Open, so that what is below them is seen; crosses where there are circles already.
            circles = k == 0 or panel.lines[k - 1].joined
            mark = (lambda x, y: f'<circle cx="{x}" cy="{y}" r="3.5" fill="none" stroke="{colour}" stroke-width="1.5"/>') if circles else (
                lambda x, y: f'<path d="M{x} {y}m-3 -3l6 6m0 -6l-6 6" stroke="{colour}" stroke-width="1.5"/>')
            out += [mark(x, y) for x, y in places]
        y = first_y + 15 * k + 8
        if line.joined:
            legend.append(f'<path d="M{first_x} {y}h20" stroke="{colour}" stroke-width="2"/>')
        else:
            legend.append(mark(first_x + 10, y))
        legend.append(f'<text x="{first_x + 26}" y="{y}" dy="0.35em">{line.name}</text>')
    return out + legend


def draw(path, panels):
    """Panels in two columns."""
    rows = (len(panels) + 1) // 2
    size = f'width="{2 * WIDTH}" height="{rows * HEIGHT}"'
    out = [f'<svg {size} viewBox="0 0 {2 * WIDTH} {rows * HEIGHT}" xmlns="http://www.w3.org/2000/svg" font-family="sans-serif" font-size="11">',
           f'<rect {size} fill="#FFFFFF"/>']
    for k, panel in enumerate(panels):
        out += panel_svg(panel, WIDTH * (k % 2), HEIGHT * (k // 2))
    path.write_text("\n".join([*out, "</svg>", ""]))


def table(path, **wanted):
    """Columns by name, of the rows that have these texts."""
    with open(path, newline="") as file:
        rows = [row for row in csv.DictReader(file) if all(row[name] == text for name, text in wanted.items())]
    if not rows:
        sys.exit(f"plot.py: {path}: no rows with {wanted}")
    return {name: [row[name] for row in rows] for name in rows[0]}


def line(name, columns, y, x="time_s", joined=True):
    """A line of two columns, without the rows that have no value."""
    points = [(float(a), float(b)) for a, b in zip(columns[x], columns[y]) if b]
    return Line(name, *zip(*points), joined)


def values(columns, name):
    """The values of a column: each once, in their order."""
    return list(dict.fromkeys(columns[name]))


def rates(of, every, until=math.inf):
    """The same line as rates in intervals of at least this length [s], without the first, in which the flow begins."""
    middles, found, last = [], [], None
    for k, time in enumerate(of.x):
        if time > until * (1 + 1e-9):
            break
        if last is None or time - of.x[last] > every * (1 - 1e-9):
            if last is not None and of.x[last] > every * (1 - 1e-9):
                middles.append((time + of.x[last]) / 2)
                found.append((of.y[last] - of.y[k]) / (time - of.x[last]))
            last = k
    return Line(of.name, middles, found, of.joined)


def discharge(path, lines, every, until=math.inf, legend="bl"):
    """Grains left, and the rate in intervals of a length [s]."""
    draw(path, [Panel("grains left", lines), Panel("grains per second", [rates(one, every, until) for one in lines], legend)])


def drum(folder):
    columns = table(folder / "drum.csv")
    panels = []
    for count, legend in [("zone1_m1", "tr"), ("zone2_m1", "tr"), ("zone1_m2", "br"), ("zone2_m2", "br")]:
        zone, material = count.split("_")
        codes = [name.removeprefix(count + "_") for name in columns if name.startswith(count)]
        lines = [line(NAMES.get(code, code), columns, f"{count}_{code}", joined=code.startswith("dem_mpi")) for code in codes]
        panels.append(Panel(f"grains of {NAMES[material]} in zone {zone[-1]}", lines, legend))
    draw(folder / "drum.svg", panels)


def shape_in_drum(folder):
    shapes = values(table(folder / "drum.csv"), "grains")
    of_shapes = [(shape, table(folder / "drum.csv", grains=shape)) for shape in shapes]
    labels = {
        "m1_zone_1": ("grains of M1 in zone 1", "tr"),
        "m1_zone_2": ("grains of M1 in zone 2", "tr"),
        "m2_zone_1": ("grains of M2 in zone 1", "br"),
        "m2_zone_2": ("grains of M2 in zone 2", "br"),
        "mixing_index": ("mixing (Lacey's index)", "tl"),
        "surface_degrees": ("angle of the surface (degrees)", "br"),
    }
    draw(folder / "drum.svg", [Panel(label, [line(shape, columns, name) for shape, columns in of_shapes], legend)
                               for name, (label, legend) in labels.items()])


def silo(folder):
    stiff = {"1e7": "dem-mpi, E/100", "1e8": "dem-mpi, E/10", "1e9": "dem-mpi"}
    moduli = values(table(folder / "silo.csv"), "youngs_modulus_Pa")
    ours = [line(stiff[modulus], table(folder / "silo.csv", youngs_modulus_Pa=modulus), "grains_left") for modulus in moduli]
    large, small = (table(folder / "others.csv", orifice=orifice) for orifice in ("large", "small"))
    codes = ["liggghts", "musen"]
    # Then it runs empty.
    discharge(folder / "silo.svg", ours + [line(NAMES[code], large, code, joined=False) for code in codes], 0.1, until=4.0)
    half = table(folder / "half.csv")
    discharge(folder / "half.svg", [line("dem-mpi", half, "grains_left"), line("LIGGGHTS", half, "grains_left_liggghts")], 0.1)
    ours = line("dem-mpi, E/100", table(folder / "small.csv"), "grains_left")
    discharge(folder / "small.svg", [ours, line("MUSEN", small, "musen", joined=False)], 0.1)


def shape_in_silo(folder):
    shapes = values(table(folder / "silo.csv"), "grains")
    discharge(folder / "silo.svg", [line(shape, table(folder / "silo.csv", grains=shape), "grains_left") for shape in shapes], 0.02, legend="br")


RECORDS = {"drum": drum, "silo": silo, "shape-in-drum": shape_in_drum, "shape-in-silo": shape_in_silo}

if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__.strip())
    for argument in sys.argv[1:]:
        folder = Path(argument).resolve()
        # Without the month.
        name = folder.name[len("2026-11-"):]
        if name not in RECORDS:
            sys.exit(f"plot.py: {argument}: it draws records of {', '.join(RECORDS)}")
        RECORDS[name](folder)
