"""Opens what dem-post exports as users do, and reads the same snapshot with dem.py.

usage: open_exports.py SNAPSHOT FOLDER
FOLDER has dem.py, from `dem-post --python`, and the files of --surfaces, --vtp and --fields.
"""

import sys
import warnings
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pyvista
import vtk
from vtk.util.numpy_support import vtk_to_numpy

snapshot, folder = Path(sys.argv[1]), Path(sys.argv[2])
sys.path.insert(0, str(folder))
import dem  # noqa: E402

here = dem.Snapshot(snapshot)
step = f"{here.step:09}"


def read(name):
    """A file of VTP by VTK's own reader, whose time is that of the snapshot."""
    problems = []
    reader = vtk.vtkXMLPolyDataReader()
    reader.AddObserver("ErrorEvent", lambda *_: problems.append("VTK reports an error"))
    reader.SetFileName(str(folder / f"{name}_{step}.vtp"))
    reader.Update()
    assert not problems, problems
    data = reader.GetOutput()
    assert data.GetFieldData().GetArray("TimeValue").GetValue(0) == here.time
    [listed] = ElementTree.parse(folder / f"{name}.pvd").getroot().iter("DataSet")
    assert listed.get("file") == f"{name}_{step}.vtp" and float(listed.get("timestep")) == here.time
    return data


def same(data, columns):
    """What the file has is what dem.py reads from the snapshot."""
    for k in range(data.GetNumberOfArrays()):
        name = data.GetArrayName(k)
        assert np.array_equal(vtk_to_numpy(data.GetArray(k)), columns[name]), name
    return data.GetNumberOfArrays()


ids = here.particles["id"]
assert len(ids) > 0 and np.array_equal(ids, np.sort(ids))
assert here.units["velocity"] == "m/s" and here.time > 0 and "title" in here.scene

points = read("particles")
assert points.GetNumberOfVerts() == len(ids)
assert np.array_equal(vtk_to_numpy(points.GetPoints().GetData()), here.particles["position"])
assert same(points.GetPointData(), here.particles) >= 9
lines = read("contacts")
assert lines.GetNumberOfLines() == len(here.contacts["a"]) > 0
assert same(lines.GetCellData(), here.contacts) >= 9

# The surfaces are closed, face outwards, and hold the volume of the bodies but for what triangles cut off.
grains = pyvista.read(folder / f"grains_{step}.vtp")
assert set(np.unique(grains["id"])) == set(ids)
volume = here.shapes["volume"][here.particles["shape"]] * here.particles.get("scale", np.ones(len(ids))) ** 3
for row in range(0, len(ids), max(1, len(ids) // 40)):
    grain = grains.extract_points(grains["id"] == ids[row], adjacent_cells=False)
    grain = grain.extract_surface(algorithm=None).clean().triangulate()
    assert grain.n_open_edges == 0, ids[row]
    assert 0.93 < grain.volume / volume[row] < 1 + 1e-5, (ids[row], grain.volume / volume[row])
    centre = here.particles["position"][row]
    # In the axes of dem.py the grain fills the box of its semi-axes; an ellipsoid lies on its surface.
    local = (grain.points - centre) @ here.axes[row] / here.particles["semi_axes"][row]
    assert (np.abs(local) < 1 + 1e-4).all() and (np.abs(local).max(axis=0) > 0.9).all(), ids[row]
    if here.shapes["kind"][here.particles["shape"][row]] == "ellipsoid":
        assert np.allclose(np.linalg.norm(local, axis=1), 1, atol=1e-4), ids[row]
    outwards = np.einsum("ij,ij->i", grain.points - centre, np.asarray(grain["Normals"]))
    assert (outwards > 0).all(), ids[row]
assert np.array_equal(grains["velocity"][-1], here.particles["velocity"][-1].astype(np.float32))
walls = read("walls")
assert walls.GetNumberOfPolys() == len(here.walls["name"])
assert all(walls.GetCellData().HasArray(name) for name in ["wall", "velocity", "wall_force"])

# Fields: an image in VTKHDF and the same in XML, with all the mass.
problems, images = [], []
for reader, ending in [(vtk.vtkHDFReader(), "vtkhdf"), (vtk.vtkXMLImageDataReader(), "vti")]:
    reader.AddObserver("ErrorEvent", lambda *_: problems.append("VTK reports an error"))
    reader.SetFileName(str(folder / f"fields_{step}.{ending}"))
    reader.Update()
    images.append(reader.GetOutput())
assert not problems, problems
image, xml = images
assert image.GetDimensions() == xml.GetDimensions() and image.GetBounds() == xml.GetBounds()
assert image.GetCellData().GetNumberOfArrays() == xml.GetCellData().GetNumberOfArrays() == 6
for k in range(6):
    name = image.GetCellData().GetArrayName(k)
    one, other = (vtk_to_numpy(data.GetCellData().GetArray(name)) for data in images)
    assert np.array_equal(one, other), name
density = vtk_to_numpy(image.GetCellData().GetArray("density"))
mass = here.shapes["mass"][here.particles["shape"]] * volume / here.shapes["volume"][here.particles["shape"]]
assert abs(density.sum() * np.prod(image.GetSpacing()) / mass.sum() - 1) < 1e-12

# What dem.py makes for VTK and pyvista.
assert pyvista.wrap(here.grains()).n_points == len(ids)
assert pyvista.wrap(here.chains()).n_lines == len(here.contacts["a"])
assert np.allclose(np.linalg.det(here.axes), 1.0)
assert (here.rows(ids[::-1]) == np.arange(len(ids))[::-1]).all()
of_run = dem.series(snapshot.parent)
assert [s.step for s in of_run] == sorted(s.step for s in of_run) and of_run[-1].step == here.step
# Grains are drawn in their true shapes: of the ellipsoids in their boxes a shard has four times too much.
with warnings.catch_warnings():
    warnings.simplefilter("error")
    drawn = dem.plotter(here, off_screen=True).meshes
shape = here.particles["shape"]
solid = here.shapes["volume"][shape] * here.particles.get("scale", np.ones(len(shape))) ** 3
for mesh, k in zip(drawn, np.unique(shape), strict=True):
    assert 0.94 < mesh.volume / solid[shape == k].sum() < 1.0001, here.shapes["name"][k]
history = dem.history(snapshot.parent)
assert history["particles"][-1] == len(ids) and (np.diff(history["time_s"]) > 0).all()
print(f"good: {len(ids)} grains, vtk {vtk.VTK_VERSION}, pyvista {pyvista.__version__}")
