"""Reads what dem-mpi writes, as numpy arrays and as objects of VTK and pyvista.

Needs h5py and numpy; vtk or pyvista only for what is to be drawn.

    import dem
    last = dem.Snapshot("out/heap")               # the newest of a run, or a file particles_STEP.vtkhdf
    last.time, last.step                          # s
    last.particles["position"]                    # (n, 3) [m], in the order of the ids
    last.units["velocity"]                        # "m/s"
    last.contacts["normal_force"]                 # (m,) [N]
    last.walls["force"], last.shapes["volume"]
    for snapshot in dem.series("out/heap"): ...   # all of a run, by step
    dem.history("out/heap")["kinetic_J"]          # history.csv
    last.grains()                                 # points, as vtkPolyData; pyvista.wrap(...) takes it
    last.chains()                                 # contacts as lines
    dem.plotter(last).show()                      # grains in their true shapes, by pyvista
"""

import json
import warnings
from functools import cached_property
from pathlib import Path

import h5py
import numpy as np

__all__ = ["Snapshot", "series", "history", "plotter"]


class Snapshot:
    """One snapshot. Tables are read when they are first asked for."""

    def __init__(self, path):
        path = Path(path)
        self.path = (path / "last.vtkhdf" if path.is_dir() else path).resolve()
        with h5py.File(self.path) as file:
            run = file["/run"].attrs
            self.step, self.time, self.dt = int(run["step"]), float(run["time"]), float(run["dt"])
            self.gravity = run["gravity"][:]
            self.program = run["program"].decode()
            self.scene = file["/run/scene"].asstr()[0]
            domain = file["/domain"].attrs
            self.low, self.high = domain["low"][:], domain["high"][:]
            self.periodic = domain["periodic"][:].astype(bool)
            self.walls, self.shapes = _table(file["/walls"]), _table(file["/shapes"])
        if "geometry" in self.shapes:
            self.shapes["geometry"] = [json.loads(text) for text in self.shapes["geometry"]]
        self.units = {}

    def __repr__(self):
        return f"<Snapshot of step {self.step}, {self.time:g} s: {self.path}>"

    @cached_property
    def particles(self):
        """Columns of all particles, in the order of their ids."""
        with h5py.File(self.path) as file:
            columns = {"position": file["/VTKHDF/Points"][:]}
            self.units["position"] = "m"
            columns |= self._columns(file["/VTKHDF/PointData"])
            columns |= self._columns(file["/restart/particles"])
        # Older versions wrote in the order of the ranks.
        return _sorted(columns, [columns["id"]])

    @cached_property
    def contacts(self):
        """Columns of all contacts, in the order of the ids `a`, then `b`; wall `k` is
        `(-b - 1) % 2**30`, its facet `(-b - 1) // 2**30`."""
        with h5py.File(self.contacts_path) as file:
            columns = self._columns(file["/VTKHDF/CellData"])
            columns["centre"] = file["/VTKHDF/Points"][::2]
            self.units["centre"] = "m"
        wall = columns["b"] < 0
        # Walls come last, as in the files.
        return _sorted(columns, [np.where(wall, -columns["b"], columns["b"]), wall, columns["a"]])

    @property
    def contacts_path(self):
        """The file of the contacts, beside that of the particles."""
        name = self.path.name.replace("particles_", "contacts_", 1)
        return self.path.with_name(name)

    def rows(self, ids):
        """Where particles of these ids stand in the tables."""
        here = self.particles["id"]
        rows = np.minimum(np.searchsorted(here, ids), len(here) - 1)
        if not np.array_equal(here[rows], ids):
            raise KeyError("there is no particle of some of these ids")
        return rows

    @cached_property
    def axes(self):
        """Rotations of all particles, (n, 3, 3): columns are the body's axes in the world."""
        if "quaternion" not in self.particles:
            return np.broadcast_to(np.eye(3), (len(self.particles["id"]), 3, 3))
        return _axes(self.particles["quaternion"])

    def grains(self):
        """The particles as points, a vtkPolyData with all columns that a picture shows."""
        data = _polydata(self.particles["position"], 1, "SetVerts")
        _attach(data.GetPointData(), {k: v for k, v in self.particles.items() if k != "position"})
        return _timed(data, self.time)

    def chains(self):
        """The contacts as lines from centre to centre, or to the foot on a wall: a vtkPolyData."""
        centre, branch = self.contacts["centre"], self.contacts["branch"]
        ends = np.stack([centre, centre + branch], axis=1).reshape(-1, 3)
        data = _polydata(ends, 2, "SetLines")
        _attach(data.GetCellData(), self.contacts)
        return _timed(data, self.time)

    def _columns(self, group):
        columns = {}
        for name, column in group.items():
            columns[name] = column[:]
            self.units[name] = _text(column.attrs.get("unit", ""))
        return columns


def series(folder):
    """All snapshots of a run, by step."""
    paths = sorted(Path(folder).glob("particles_*.vtkhdf"), key=lambda p: int(p.stem.split("_")[1]))
    return [Snapshot(path) for path in paths]


def history(folder):
    """The columns of history.csv by name; names end in the unit."""
    table = np.genfromtxt(Path(folder) / "history.csv", delimiter=",", names=True, deletechars="")
    return {name: np.atleast_1d(table[name]) for name in table.dtype.names}


def plotter(snapshot, scalars="coordination", **options):
    """A pyvista plotter with the surfaces of all grains. Curved ones have some 500 triangles each.

    Finer, and with walls: `dem-post --surfaces`, then `pyvista.read("grains_STEP.vtp")`.
    """
    import pyvista

    ball = pyvista.Sphere(radius=1, theta_resolution=16, phi_resolution=16)
    particles, shapes = snapshot.particles, snapshot.shapes
    geometries = shapes.get("geometry", [None] * len(shapes["name"]))
    plot = pyvista.Plotter(**options)
    for shape, (name, geometry) in enumerate(zip(shapes["name"], geometries)):
        grains = np.flatnonzero(particles["shape"] == shape)
        if not len(grains):
            continue
        surface = _surface(geometry, ball.points, ball.regular_faces)
        if surface is None:
            warnings.warn(f"shape {name} is not known: its grains are drawn as ellipsoids")
            surface = ball.points * shapes["semi_axes"][shape], ball.regular_faces
        points, faces = surface
        scales = particles.get("scale", np.ones(len(particles["id"])))[grains]
        turns = snapshot.axes[grains] * scales[:, None, None]
        places = np.einsum("nij,pj->npi", turns, points) + particles["position"][grains, None]
        members = faces[None] + len(points) * np.arange(len(grains))[:, None, None]
        mesh = pyvista.PolyData.from_regular_faces(places.reshape(-1, 3), members.reshape(-1, 3))
        mesh[scalars] = np.repeat(particles[scalars][grains], len(points), axis=0)
        has_edges = not {"Polyhedron", "Union"}.isdisjoint(geometry or {})
        plot.add_mesh(mesh, scalars=scalars, smooth_shading=True, split_sharp_edges=has_edges)
    return plot


def _surface(geometry, normals, faces):
    """Points and triangles of a shape about its centre, along its axes, from those of a unit sphere; None if it is not known."""
    ((kind, of),) = (geometry or {"": None}).items()
    if kind == "Sphere":
        return normals * of["radius"], faces
    if kind == "Ellipsoid":
        return normals * of["semi_axes"], faces
    if kind == "Polyhedron":
        return np.array(of["hull"]["vertices"]), np.array([t["corners"] for t in of["hull"]["triangles"]])
    if kind == "RoundedPolyhedron":
        return _rolled(np.array(of["core"]["vertices"]), of["radius"], normals), faces
    if kind == "Spherocylinder":
        return _rolled(np.outer([-0.5, 0.5], [of["length"], 0, 0]), of["radius"], normals), faces
    if kind == "Superellipsoid":
        return _powers(normals, of["exponents"]) * of["semi_axes"], faces
    if kind == "PolySuperellipsoid":
        axes = np.where(normals < 0, of["negative"], of["positive"])
        points = _powers(normals, of["exponents"]) * axes - of["centre"]
        # Columns one after the other.
        return points @ np.reshape(of["axes"], (3, 3)).T, faces
    if kind == "Union":
        return _joined([(piece, _surface(piece["shape"], normals, faces)) for piece in of["pieces"]])
    return None


def _joined(pieces):
    """Points and triangles of all pieces of a union in its axes; None if one is not known."""
    all_points, all_faces, first = [], [], 0
    for piece, surface in pieces:
        if surface is None:
            return None
        points, faces = surface
        turn = _axes(np.roll([piece["rotation"]], 1, axis=1))[0]
        all_points.append(points @ turn.T + piece["centre"])
        all_faces.append(faces + first)
        first += len(points)
    return np.concatenate(all_points), np.concatenate(all_faces)


def _axes(quaternions):
    """Rotation matrices of quaternions (w, x, y, z)."""
    w, x, y, z = np.transpose(quaternions)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def _rolled(corners, radius, normals):
    """Where a sphere that rolls around a convex body touches planes with these normals."""
    return corners[np.argmax(normals @ corners.T, axis=1)] + radius * normals


def _powers(directions, exponents):
    """Points of a superellipsoid of unit semi-axes."""
    x, y, z = directions.T
    around = np.hypot(x, y)
    turn = np.divide(directions[:, :2], around[:, None], where=around[:, None] > 0, out=np.zeros((len(x), 2)))
    power = lambda number, exponent: np.sign(number) * np.abs(number) ** exponent
    wide = power(turn, exponents["across"]) * (around ** exponents["along"])[:, None]
    return np.column_stack([wide, power(z, exponents["along"])])


def _text(value):
    return value.decode() if isinstance(value, bytes) else value


def _table(group):
    return {
        name: list(column.asstr()[:]) if column.dtype.kind == "S" else column[:]
        for name, column in group.items()
    }


def _sorted(columns, keys):
    order = np.lexsort(keys)
    return {name: column[order] for name, column in columns.items()}


def _polydata(points, each, put):
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray

    data = vtk.vtkPolyData()
    places = vtk.vtkPoints()
    places.SetData(numpy_to_vtk(np.ascontiguousarray(points), deep=True))
    data.SetPoints(places)
    cells = vtk.vtkCellArray()
    ends = np.arange(0, len(points) + 1, each, dtype=np.int64)
    members = np.arange(len(points), dtype=np.int64)
    cells.SetData(numpy_to_vtkIdTypeArray(ends, True), numpy_to_vtkIdTypeArray(members, True))
    getattr(data, put)(cells)
    return data


def _attach(to, columns):
    from vtk.util.numpy_support import numpy_to_vtk

    for name, column in columns.items():
        array = numpy_to_vtk(np.ascontiguousarray(column), deep=True)
        array.SetName(name)
        to.AddArray(array)


def _timed(data, time):
    from vtk.util.numpy_support import numpy_to_vtk

    array = numpy_to_vtk(np.array([time]), deep=True)
    array.SetName("TimeValue")
    data.GetFieldData().AddArray(array)
    return data
