"""Plays what dem-post --surfaces exports of several snapshots, with a wall of triangles that turns.

usage: play_exports.py MESH FOLDER SNAPSHOT...
MESH is the OBJ file of the wall `chute` of the scene tests/program/chute.toml, which turns about the y axis through
(0, 0, 0.03) m with 1 rad/s; FOLDER has dem.py and the files of --series --surfaces.
"""

import sys
from pathlib import Path

import numpy as np
import pyvista
import vtk

mesh, folder = Path(sys.argv[1]), Path(sys.argv[2])
sys.path.insert(0, str(folder))
import dem  # noqa: E402

snapshots = [dem.Snapshot(path) for path in sys.argv[3:]]
times = [snapshot.time for snapshot in snapshots]
assert len(times) > 1 and times[0] > 0 and all(np.diff(times) > 0)

rows = [line.split() for line in mesh.read_text().splitlines()]
vertices = np.array([row[1:] for row in rows if row[:1] == ["v"]], dtype=float)
triangles = vertices[np.array([row[1:] for row in rows if row[:1] == ["f"]], dtype=int) - 1]


def in_place(time):
    """The triangles of the file, turned about +y: anticlockwise where that points to the eye."""
    about, angle = np.array([0, 0, 0.03]), 1.0 * time
    sine, cosine = np.sin(angle), np.cos(angle)
    turn = np.array([[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]])
    return about + (triangles - about) @ turn.T


def played(name):
    """What a list shows at each time: by pyvista, whose files VTK's own reader reads."""
    reader = pyvista.get_reader(folder / f"{name}.pvd")
    assert list(reader.time_values) == times, (reader.time_values, times)
    shown = []
    for time in times:
        reader.set_active_time_value(time)
        parts = [data.part for data in reader.active_datasets]
        assert parts == list(range(len(parts))), parts
        shown.append(list(reader.read()))
    return shown


def turned(walls, snapshot):
    """Corners of the triangles of the chute, one after the other."""
    number = list(snapshot.walls["name"]).index("chute")
    corners = [cell.point_ids for cell, wall in zip(walls.cell, walls["wall"]) if wall == number]
    return np.asarray(walls.points)[np.array(corners)]


walls = played("walls")
for snapshot, [shown] in zip(snapshots, walls):
    assert shown.n_cells > len(triangles), "planes stand beside the triangles"
    found = turned(shown, snapshot)
    assert found.shape == triangles.shape, found.shape
    off = np.abs(found - in_place(snapshot.time)).max()
    assert off < 1e-6 * np.abs(triangles).max(), (snapshot.step, off)
first, last = (turned(shown, snapshot) for snapshot, [shown] in ((snapshots[k], walls[k]) for k in (0, -1)))
assert np.abs(last - first).max() > 1e-4, "it has not moved"

# One list shows all.
grains, contacts = played("grains"), played("contacts")
for k, (snapshot, shown) in enumerate(zip(snapshots, played("all"))):
    assert len(shown) == 3 and len(snapshot.particles["id"]) > 0
    assert set(np.unique(shown[0]["id"])) == set(snapshot.particles["id"])
    assert shown[2].n_lines == shown[2].n_cells == len(snapshot.contacts["a"])
    for part, alone in zip(shown, [grains[k][0], walls[k][0], contacts[k][0]]):
        assert part.n_cells == alone.n_cells and np.array_equal(part.points, alone.points)
assert len(snapshots[-1].contacts["a"]) > 0
print(f"good: {len(times)} times, {len(triangles)} triangles that turn, vtk {vtk.VTK_VERSION}, pyvista {pyvista.__version__}")
