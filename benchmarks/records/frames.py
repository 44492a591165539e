"""Frames of a run as one picture: grains as ellipsoids in their boxes (exact for spheres and ellipsoids), walls of triangles as they are cut.

    python3 benchmarks/records/frames.py out/drum --times 0.5 1 1.5 --slab y -0.004 0.004 -o frames.jpg
    python3 benchmarks/records/frames.py spheres/flow ellipsoids/flow --times 0 0.06 0.12 --slab y -0.003 0.003 --colour height -o frames.jpg

A folder is a row of frames, of all its snapshots or of those nearest to --times. Snapshots given as files (particles_STEP.vtkhdf) share a row.
Needs h5py, numpy, pillow 10.1 or later.
"""

import argparse
import io
import json
import sys
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

# The reader that `dem-post --python` prints.
sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "src/post"))
import dem

# Okabe and Ito's, by shape.
SHAPES = np.array([[0xD5, 0x5E, 0x00], [0x00, 0x72, 0xB2], [0x00, 0x9E, 0x73], [0xE6, 0x9F, 0x00], [0xCC, 0x79, 0xA7], [0x56, 0xB4, 0xE9]], float)
# From low to high, lighter all the way (viridis).
RAMP = np.array([[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]], float)
NEW = np.array([170.0, 170.0, 170.0])
# To the right, upwards, and towards who looks: seen along y from the front, along x from the right, along z from above.
VIEWS = {"x": ([0, 1, 0], [0, 0, 1], [1, 0, 0]), "y": ([1, 0, 0], [0, 0, 1], [0, -1, 0]), "z": ([1, 0, 0], [0, 1, 0], [0, 0, 1])}
LIGHT = np.array([-0.35, 0.5, 0.79])
FINER = 2


def rows_of(arguments):
    """Lists of snapshots: one of each folder, one of all files."""
    files = [Path(path) for path in arguments.snapshots if not Path(path).is_dir()]
    files = [path for path in files if not path.name.startswith("contacts_")]
    rows = [dem.series(path) for path in arguments.snapshots if Path(path).is_dir()]
    rows += [[dem.Snapshot(path) for path in files]] if files else []
    if not all(rows):
        sys.exit("frames.py: a folder has no particles_*.vtkhdf")
    chosen = []
    for row in rows:
        wanted = arguments.times and [time + arguments.zero for time in arguments.times]
        late = max(wanted) if wanted else row[-1].time
        if late > row[-1].time * (1 + 1e-6):
            print(f"frames.py: {row[-1].path.parent}: the last snapshot is of {row[-1].time - arguments.zero:g} s", file=sys.stderr)
        picked = [min(row, key=lambda one: abs(one.time - time)) for time in wanted] if wanted else row
        chosen.append((row[0], picked))
    return chosen


def ramp(values, low, high):
    place = np.clip((values - low) / max(high - low, 1e-300), 0, 1) * (len(RAMP) - 1)
    return np.stack([np.interp(place, range(len(RAMP)), RAMP[:, k]) for k in range(3)], axis=-1)


def colours(snapshot, first, how, fastest):
    """A colour of each grain: by shape, by its height in the first snapshot of the row, or by speed."""
    here = snapshot.particles
    if how == "shape":
        return SHAPES[here["shape"] % len(SHAPES)]
    if how == "speed":
        return ramp(np.linalg.norm(here["velocity"], axis=1), 0, fastest)
    heights, then = first.particles["position"][:, 2], first.particles["id"]
    rows = np.minimum(np.searchsorted(then, here["id"]), len(then) - 1)
    known = then[rows] == here["id"]
    return np.where(known[:, None], ramp(heights[rows], heights.min(), heights.max()), NEW)


def turned(q):
    x, y, z, w = q
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])


def wall_lines(snapshot, axis, at):
    """Where the plane cuts the triangles of walls, (n, 2, 3) [m]."""
    corners, places = snapshot.walls.get("triangles"), []
    if corners is None:
        return np.zeros((0, 2, 3))
    # Null of a wall of one plane.
    for body in filter(None, map(json.loads, snapshot.walls.get("body", []))):
        if body.get("mesh"):
            count = body["mesh"]["triangles"]
            own, corners = corners[:count].reshape(-1, 3), corners[count:]
            places.append((own @ turned(body["orientation"]).T + body["point"]).reshape(-1, 3, 3))
    lines = []
    for triangle in np.concatenate(places) if places else []:
        above = triangle[:, axis] >= at
        if above.any() and not above.all():
            ends = []
            for a, b in ((0, 1), (1, 2), (2, 0)):
                if above[a] != above[b]:
                    part = (at - triangle[a, axis]) / (triangle[b, axis] - triangle[a, axis])
                    ends.append(triangle[a] + part * (triangle[b] - triangle[a]))
            lines.append(ends)
    return np.array(lines).reshape(-1, 2, 3)


def draw_grains(pixels, centres, roots, colour, low, scale):
    """Ellipsoids by their depth in each pixel. Centres and axes are in those of the picture, `roots` their axes as columns times their lengths."""
    height, width = pixels.shape[:2]
    depths = np.full((height, width), -np.inf)
    light = LIGHT / np.linalg.norm(LIGHT)
    squares = roots @ np.swapaxes(roots, 1, 2)
    reach = np.sqrt(squares[:, [0, 1], [0, 1]])
    forms = np.linalg.inv(squares)
    for centre, form, (du, dv), rgb in zip(centres, forms, reach, colour):
        u, v = (centre[:2] - low) * scale
        left, right = max(0, int(u - du * scale)), min(width, int(u + du * scale) + 2)
        bottom, top = max(0, int(v - dv * scale)), min(height, int(v + dv * scale) + 2)
        if left >= right or bottom >= top:
            continue
        x = ((np.arange(left, right) + 0.5 - u) / scale)[None, :]
        y = ((np.arange(bottom, top) + 0.5 - v) / scale)[:, None]
        # form of (x, y, w) is 1 on the surface: a quadratic equation for w, of which the nearer root is seen.
        half = form[0, 2] * x + form[1, 2] * y
        rest = form[0, 0] * x * x + 2 * form[0, 1] * x * y + form[1, 1] * y * y - 1
        root = half * half - form[2, 2] * rest
        w = (np.sqrt(np.maximum(root, 0)) - half) / form[2, 2]
        depth = depths[bottom:top, left:right]
        seen = (root > 0) & (centre[2] + w > depth)
        normal = np.stack([form[k, 0] * x + form[k, 1] * y + form[k, 2] * w for k in range(3)])
        shade = np.maximum(0, np.tensordot(light, normal, 1) / np.linalg.norm(normal, axis=0))
        depth[seen] = (centre[2] + w)[seen]
        pixels[bottom:top, left:right][seen] = (rgb * (0.45 + 0.55 * shade)[..., None])[seen]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("snapshots", nargs="+", help="folders of runs, or files")
    parser.add_argument("--times", nargs="+", type=float, help="of the frames [s]; default: all snapshots")
    parser.add_argument("--zero", type=float, default=0.0, help="the run's time that counts as 0 [s]")
    parser.add_argument("--slab", nargs=3, metavar=("AXIS", "LOW", "HIGH"), help="only grains whose centres are between, seen along the axis [m]")
    parser.add_argument("--view", choices=VIEWS, default="y", help="seen along this axis, without --slab")
    parser.add_argument("--colour", choices=["shape", "height", "speed"], default="shape", help="height: that in the first snapshot of the row")
    parser.add_argument("--height", type=int, default=300, help="of a frame [pixels]")
    parser.add_argument("--bytes", type=int, default=240_000, help="the picture takes at most so many")
    parser.add_argument("-o", "--out", default="frames.jpg")
    arguments = parser.parse_args()
    name, *limits = arguments.slab or [arguments.view, "-inf", "inf"]
    if name not in VIEWS:
        parser.error(f"--slab {name}: the axes are x, y, z")
    low, high = map(float, limits)
    axis, view = "xyz".index(name), np.array(VIEWS[name], float)

    rows, shown = rows_of(arguments), []
    fastest = 0.0
    for first, picked in rows:
        frames = []
        for snapshot in picked:
            place = snapshot.particles["position"]
            inside = (place[:, axis] >= low) & (place[:, axis] <= high)
            at = (low + high) / 2 if arguments.slab else (snapshot.low[axis] + snapshot.high[axis]) / 2
            frames.append((snapshot, inside, wall_lines(snapshot, axis, at) @ view[:2].T))
            fastest = max(fastest, np.quantile(np.linalg.norm(snapshot.particles["velocity"], axis=1), 0.99))
        shown.append((first, frames))
    ends = [lines.reshape(-1, 2) for _, frames in shown for *_, lines in frames]
    for _, frames in shown:
        for snapshot, inside, _ in frames:
            reach = snapshot.particles["semi_axes"][inside].max(axis=1, initial=0)[:, None]
            flat = snapshot.particles["position"][inside] @ view[:2].T
            ends += [flat - reach, flat + reach]
    ends = np.concatenate(ends)
    if not len(ends):
        sys.exit("frames.py: no grain is in the slab")
    corner, size = ends.min(axis=0), np.ptp(ends, axis=0)
    margin = 0.02 * size.max()
    corner, size = corner - margin, size + 2 * margin
    scale = FINER * arguments.height / size[1]
    wide, tall = round(size[0] * scale), FINER * arguments.height

    gap, above = 6, 18
    columns = max(len(frames) for _, frames in shown)
    sheet = Image.new("RGB", (columns * (wide // FINER + gap) - gap, len(shown) * (arguments.height + above + gap) - gap), "white")
    write = ImageDraw.Draw(sheet)
    font = ImageFont.load_default(size=13)
    for j, (first, frames) in enumerate(shown):
        for k, (snapshot, inside, lines) in enumerate(frames):
            pixels = np.full((tall, wide, 3), 255.0)
            picture = Image.fromarray(pixels.astype(np.uint8))
            pen = ImageDraw.Draw(picture)
            for line in (lines - corner) * scale:
                pen.line([tuple(end) for end in line], fill=(90, 90, 90), width=2 * FINER)
            pixels = np.asarray(picture).astype(float)
            here = snapshot.particles
            roots = view @ (snapshot.axes[inside] * here["semi_axes"][inside][:, None, :])
            colour = colours(snapshot, first, arguments.colour, fastest)[inside]
            draw_grains(pixels, here["position"][inside] @ view.T, roots, colour, corner, scale)
            # Upwards is downwards in files.
            frame = Image.fromarray(np.round(pixels[::-1]).astype(np.uint8)).resize((wide // FINER, arguments.height), Image.LANCZOS)
            left, top = k * (wide // FINER + gap), j * (arguments.height + above + gap)
            sheet.paste(frame, (left, top + above))
            write.text((left + 4, top + 2), f"{round(snapshot.time - arguments.zero, 9):.3g} s", fill="black", font=font)
    for quality in range(92, 20, -4):
        data = io.BytesIO()
        sheet.save(data, "JPEG", quality=quality, optimize=True)
        if data.tell() <= arguments.bytes:
            break
    Path(arguments.out).write_bytes(data.getvalue())
    print(f"{arguments.out}: {sheet.width} x {sheet.height}, {data.tell()} bytes, quality {quality}")


if __name__ == "__main__":
    main()
