"""Opens what dem-post writes for other codes: the file of ON-DEM, and the dump with its meshes.

usage: open_exchange.py SNAPSHOT FOLDER
FOLDER has dem.py, from `dem-post --python`, and the files of --ondem, --lammps and --surfaces.
Where the Python module of OVITO is installed it opens the dump and the meshes, too.
"""

import sys
import warnings
from math import gamma, pi
from pathlib import Path

import h5py
import numpy as np
import pyvista
import vtk
from vtk.util.numpy_support import vtk_to_numpy

snapshot, folder = Path(sys.argv[1]), Path(sys.argv[2])
sys.path.insert(0, str(folder))
import dem  # noqa: E402

here = dem.Snapshot(snapshot)
step = f"{here.step:09}"
own = here.particles
count = len(own["id"])
scale = own.get("scale", np.ones(count))
kinds = np.array(here.shapes["kind"])[own["shape"]]
volume = here.shapes["volume"][own["shape"]] * scale**3
zeros = np.zeros((count, 3))
turns = own.get("quaternion", np.tile([1.0, 0, 0, 0], (count, 1)))
turns = np.roll(turns, -1, axis=1)


def close(found, expected, tolerance=1e-12):
    assert np.allclose(found, expected, rtol=tolerance, atol=0), (found, expected)


def convex_volume(points):
    return pyvista.PolyData(points).delaunay_3d().volume


def superellipsoid(axes, e1, e2):
    beta = lambda a, b: gamma(a) * gamma(b) / gamma(a + b)
    return 2 * np.prod(axes) * e1 * e2 * beta(e1 / 2 + 1, e1) * beta(e2 / 2, e2 / 2)


path = str(folder / f"ondem_{step}.vtkhdf")
with h5py.File(path) as file:
    assert file.attrs["file_format"] == b"ON-DEM VTKHDF"
    assert file["VTKHDF"].attrs["Type"] == b"PolyData" and file["VTKHDF"].attrs["Version"].tolist() == [2, 0]
    points = {name: column[:] for name, column in file["VTKHDF/PointData"].items()}
    rows = len(points["body_id"])
    integers = ["body_id", "material_id", "clump_id"]
    widths = {"position": 3, "velocity": 3, "angular_velocity": 3, "orientation": 4, "inertia": 9}
    for name in ["mass", "volume", "radius", *integers, *widths]:
        kind = np.int32 if name in integers else np.float64
        shape = (rows, widths[name]) if name in widths else (rows,)
        assert points[name].dtype == kind and points[name].shape == shape, name
    # Particles come first, to the last bit, then the pieces of unions.
    assert np.array_equal(points["body_id"][:count], own["id"])
    assert len(set(points["body_id"])) == rows
    for name in ["position", "velocity"]:
        assert np.array_equal(points[name][:count], own[name]), name
    assert np.array_equal(points["angular_velocity"][:count], own.get("angular_velocity", zeros))
    assert np.array_equal(points["orientation"][:count], turns)
    assert np.array_equal(file["VTKHDF/Points"], points["position"])
    close(points["volume"][:count], volume)
    close(points["mass"][:count], here.shapes["mass"][own["shape"]] * scale**3)
    moments = here.shapes["inertia"][own["shape"]] * scale[:, None] ** 5
    close(points["inertia"][:count, ::4], moments)
    assert not np.delete(points["inertia"], [0, 4, 8], axis=1).any()
    close(points["radius"] ** 3 * 4 / 3 * pi, points["volume"])
    unions = kinds == "union"
    assert np.array_equal(points["clump_id"][:count], np.where(unions, own["id"], -1))
    pieces = np.arange(count, rows)
    assert set(points["clump_id"][pieces]) == set(own["id"][unions])
    for row in pieces:
        body = here.rows([points["clump_id"][row]])[0]
        arm = points["position"][row] - own["position"][body]
        turning = np.cross(own["angular_velocity"][body], arm)
        assert np.allclose(points["velocity"][row], own["velocity"][body] + turning, rtol=1e-12, atol=1e-12)

    scene = file["ONDEM/Scene"]
    assert scene.attrs["time"] == here.time and scene.attrs["timestep"] == here.dt
    assert np.array_equal(scene["gravity"], here.gravity)
    assert scene["units"][:].tolist() == [b"second", b"meter", b"kilogram"]
    materials = file["ONDEM/Materials"]
    for name, group in materials.items():
        assert int(group["id"][()]) == int(name) and group["label"][()].decode()
        assert all(column.shape == () for column in group.values())
        close(np.tan(group["friction_angle_rad"][()]), group["friction_coefficient"][()])
    densities = np.array([materials[str(k)]["density"][()] for k in points["material_id"][:count]])
    close(densities * volume, points["mass"][:count], 1e-9)

    # The parameters of a kind give the volume of each body.
    seen = []
    for name, group in file["ONDEM/Bodies"].items():
        if name in ["Walls", "Planes", "Facets"]:
            assert not set(group["body_id"]) & set(points["body_id"])
            assert len(group["position"]) == group.attrs["count"]
            continue
        bodies = np.searchsorted(points["body_id"], group["body_id"])
        seen += group["body_id"][:].tolist()
        assert np.array_equal(points["material_id"][bodies], group["material_id"])
        of = {key: column[:] for key, column in group.items()}
        expected = points["volume"][bodies]
        if name == "Sphere":
            assert np.array_equal(of["radius"], points["radius"][bodies])
        elif name == "Ellipsoid":
            close(4 / 3 * pi * np.prod(of["semi_axes"], axis=1), expected)
        elif name == "Superellipsoid":
            volumes = [superellipsoid(a, *e) for a, e in zip(of["semi_axes"], of["exponents"])]
            close(volumes, expected, 1e-9)
        elif name == "PolySuperellipsoid":
            octants = 0
            for signs in np.ndindex(2, 2, 2):
                axes = np.where(signs, of["semi_axes_negative"], of["semi_axes_positive"])
                octants += np.array([superellipsoid(a, *e) for a, e in zip(axes, of["exponents"])]) / 8
            close(octants, expected, 1e-9)
            close(np.linalg.det(of["axes"].reshape(-1, 3, 3)), 1)
        elif name == "Spherocylinder":
            close(pi * of["radius"] ** 2 * (of["length"] + 4 / 3 * of["radius"]), expected)
        elif name == "Clump":
            assert np.array_equal(np.sort(of["body_id"]), own["id"][unions])
        else:
            assert name in ["Polyhedron", "RoundedPolyhedron"], name
            ends = of["vertex_offsets"]
            assert len(ends) == len(bodies) + 1 and ends[0] == 0 and ends[-1] == len(of["vertices"])
            for k in range(0, len(bodies), 7):
                inner = convex_volume(of["vertices"][ends[k] : ends[k + 1]])
                if name == "Polyhedron":
                    close(inner, expected[k], 1e-6)
                else:
                    assert 0.1 * expected[k] < inner < expected[k] - 4 / 3 * pi * of["radius"][k] ** 3
    assert sorted(seen) == sorted(points["body_id"])

    # Forces on bodies add up to those of the snapshot: traction is positive, from body 1 on body 2.
    pair = file["ONDEM/Interactions"]
    assert pair.attrs["count"] == len(here.contacts["a"]) > 0
    assert np.array_equal(pair["normal_force"], -here.contacts["normal_force"])
    force = pair["shear_force"][:] - pair["normal"][:] * pair["normal_force"][:][:, None]
    sums = {body: np.zeros(3) for body in [*pair["id1"], *pair["id2"]]}
    for first, second, of_pair in zip(pair["id1"], pair["id2"], force):
        sums[first] -= of_pair
        sums[second] += of_pair
    largest = np.abs(own["force"]).max()
    for body, total in zip(own["id"], own["force"]):
        assert np.allclose(sums.get(body, np.zeros(3)), total, rtol=0, atol=1e-9 * largest), body
    walls = {body for name in file["ONDEM/Bodies"] if name in ["Walls", "Planes", "Facets"]
             for body in file[f"ONDEM/Bodies/{name}/body_id"]}
    assert set(sums) <= set(own["id"]) | walls

problems = []
reader = vtk.vtkHDFReader()
reader.AddObserver("ErrorEvent", lambda *_: problems.append("VTK reports an error"))
reader.SetFileName(path)
reader.Update()
assert not problems, problems
data = reader.GetOutputDataObject(0)
if isinstance(data, vtk.vtkPartitionedDataSet):
    data = data.GetPartition(0)
assert data.GetNumberOfPoints() == data.GetNumberOfVerts() == rows
for name, column in points.items():
    assert np.array_equal(vtk_to_numpy(data.GetPointData().GetArray(name)), column), name

# The dump: columns by name, and meshes of the types that it cannot describe.
with open(folder / f"particles_{step}.dump") as file:
    lines = file.read().splitlines()
names = lines[8].split()[2:]
dump = dict(zip(names, np.array([line.split() for line in lines[9:]], dtype=float).T))
columns = lambda *names: np.stack([dump[name] for name in names], axis=1)
assert np.array_equal(dump["type"] - 1, own["shape"])
assert np.array_equal(columns("quati", "quatj", "quatk", "quatw"), turns)
for name, written in [("angular_velocity", "omega"), ("angular_momentum", "angmom")]:
    found = columns(*(written + axis for axis in "xyz"))
    assert np.array_equal(found, own.get(name, zeros)), name
close(dump["radius"] ** 3 * 4 / 3 * pi, volume)
roundness = columns("SuperquadricRoundness.Phi", "SuperquadricRoundness.Theta")
for row in np.flatnonzero(np.isin(kinds, ["ellipsoid", "superellipsoid"])):
    axes = columns("shapex", "shapey", "shapez")[row] / 2
    # Phi is the exponent east-west, across z.
    close(superellipsoid(axes, roundness[row, 1], roundness[row, 0]), volume[row], 1e-9)
assert (roundness[kinds != "superellipsoid"] == 1).all()
meshes = {int(path.stem[5:]): path for path in folder.glob("type_*.obj")}
described = ["sphere", "ellipsoid", "superellipsoid"]
assert sorted(meshes) == [k + 1 for k, kind in enumerate(here.shapes["kind"]) if kind not in described]
with warnings.catch_warnings():
    warnings.simplefilter("error")
    drawn = dict(zip(np.unique(own["shape"]), dem.plotter(here, off_screen=True).meshes))
grains = pyvista.read(folder / f"grains_{step}.vtp")
for kind, path in meshes.items():
    mesh = pyvista.read(path).triangulate().clean()
    first = np.flatnonzero(own["shape"] == kind - 1)[:1]
    for row in first:
        # A particle of the mesh, turned and enlarged as OVITO does, is that of --surfaces.
        corners = mesh.points @ here.axes[row].T * dump["radius"][row] + own["position"][row]
        surface = grains.points[grains["id"] == own["id"][row]]
        size = np.ptp(surface, axis=0)
        for end in [np.min, np.max]:
            assert (np.abs(end(corners, axis=0) - end(surface, axis=0)) < 0.03 * size).all(), path
    if here.shapes["kind"][kind - 1] != "union":
        assert mesh.n_open_edges == 0 and 0.98 < mesh.volume / (4 / 3 * pi) < 1.0001, path
for shape, mesh in drawn.items():
    surface = grains.points[np.isin(grains["id"], own["id"][own["shape"] == shape])]
    for end in [np.min, np.max]:
        largest = 2 * own["semi_axes"][own["shape"] == shape].max()
        difference = end(mesh.points, axis=0) - end(surface, axis=0)
        assert (np.abs(difference) < 0.05 * largest).all(), here.shapes["name"][shape]

try:
    import ovito
    from ovito.io import import_file
except ImportError:
    said = "ovito is not installed: the dump was read by its columns"
else:
    source = import_file(str(folder / f"particles_{step}.dump")).source
    frame = source.compute(0)
    close(frame.particles["Aspherical Shape"], columns("shapex", "shapey", "shapez") / 2, 1e-6)
    close(frame.particles["Superquadric Roundness"], roundness, 1e-6)
    close(frame.particles["Radius"], dump["radius"], 1e-6)
    assert np.allclose(frame.particles["Orientation"], turns, rtol=0, atol=1e-6)
    close(frame.particles["Angular Velocity"], own.get("angular_velocity", zeros))
    close(frame.particles["Angular Momentum"], own.get("angular_momentum", zeros))
    types = source.data.particles_.particle_types_
    for kind, path in meshes.items():
        types.type_by_id_(kind).load_shape(str(path))
        assert types.type_by_id(kind).mesh.face_count > 0, path
    said = f"ovito {ovito.version_string}"
print(f"good: {count} particles and {rows - count} pieces for others, {said}")
