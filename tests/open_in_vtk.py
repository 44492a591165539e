"""Opens a particles file and its contacts file as users do: with VTK and with h5py.

usage: open_in_vtk.py PARTICLES CONTACTS
Needs vtk (9.3 or later) and h5py; open_in_vtk.sh brings them and makes the files.
"""

import sys

import h5py
import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy

POINT_DATA = "id shape semi_axes quaternion velocity angular_velocity force torque coordination rank"
CELL_DATA = "a b branch point normal overlap normal_force shear_force force"
TEXTS = ("/name", "/kind", "/geometry", "/scene")
WITHOUT_UNIT = ("/NumberOf", "/Offsets", "/Connectivity", *TEXTS)


def parts_of(path):
    """The PolyData of a file: one, in a list of parts from some versions of VTK."""
    problems = []
    reader = vtk.vtkHDFReader()
    reader.AddObserver("ErrorEvent", lambda *_: problems.append("VTK reports an error"))
    assert reader.CanReadFile(path), f"VTK does not know {path}"
    reader.SetFileName(path)
    reader.Update()
    assert not problems, problems
    data = reader.GetOutputDataObject(0)
    if isinstance(data, vtk.vtkPolyData):
        return [data]
    assert isinstance(data, vtk.vtkPartitionedDataSet), type(data)
    parts = (data.GetPartition(i) for i in range(data.GetNumberOfPartitions()))
    return [part for part in parts if part is not None]


def joined(parts, data_of, name):
    """An array of all parts, one after the other."""
    arrays = [data_of(part).GetArray(name) for part in parts if part.GetNumberOfPoints() > 0]
    assert all(array is not None for array in arrays), f"{name} is missing in VTK"
    return np.concatenate([vtk_to_numpy(array) for array in arrays])


def same(parts, file, group, names, data_of):
    """What VTK shows is what h5py reads."""
    for name in names:
        stored = file[f"/VTKHDF/{group}/{name}"][:]
        assert np.array_equal(joined(parts, data_of, name), stored), name


def check_particles(path):
    parts = parts_of(path)
    with h5py.File(path) as file:
        points = file["/VTKHDF/Points"][:]
        count = len(points)
        # One part, whatever the number of ranks, in the order of the ids.
        assert file["/VTKHDF/NumberOfPoints"][:].tolist() == [count] and count > 0
        assert (np.diff(file["/VTKHDF/PointData/id"][:]) > 0).all()
        assert sum(p.GetNumberOfPoints() for p in parts) == count
        assert sum(p.GetNumberOfVerts() for p in parts) == count
        assert sum(p.GetNumberOfCells() for p in parts) == count
        found = [vtk_to_numpy(p.GetPoints().GetData()) for p in parts if p.GetNumberOfPoints() > 0]
        assert np.array_equal(np.concatenate(found), points)
        assert set(file["/VTKHDF/PointData"]) == set(POINT_DATA.split())
        assert file["/VTKHDF/PointData/quaternion"].attrs["order"] == b"w, x, y, z"
        same(parts, file, "PointData", POINT_DATA.split(), lambda part: part.GetPointData())
        assert file["/restart/particles/angular_momentum"].shape == (count, 3)
        check_rest(file)
    print(f"{path}: {count} particles in {len(parts)} parts")


def check_contacts(path):
    parts = parts_of(path)
    with h5py.File(path) as file:
        points = file["/VTKHDF/Points"][:]
        count = len(file["/VTKHDF/CellData/a"])
        assert len(points) == 2 * count > 0
        assert sum(p.GetNumberOfLines() for p in parts) == count
        assert sum(p.GetNumberOfCells() for p in parts) == count
        assert set(file["/VTKHDF/CellData"]) == set(CELL_DATA.split())
        same(parts, file, "CellData", CELL_DATA.split(), lambda part: part.GetCellData())
        ends = [
            [part.GetCell(i).GetPoints().GetPoint(end) for end in (0, 1)]
            for part in parts
            for i in range(part.GetNumberOfCells())
        ]
        branch = file["/VTKHDF/CellData/branch"][:]
        ends = np.array(ends)
        assert np.array_equal(ends.reshape(-1, 3), points)
        assert np.allclose(ends[:, 1] - ends[:, 0], branch, rtol=0, atol=1e-14)
        check_rest(file)
    print(f"{path}: {count} contacts in {len(parts)} parts")


def check_rest(file):
    """Units, checksums, and what stands outside of VTK's group."""

    def check(name, item):
        if isinstance(item, h5py.Dataset):
            assert item.chunks is None, f"{name} is not contiguous"
            assert "checksum" in item.attrs, f"{name} has no checksum"
            unitless = any(part in f"/{name}" for part in WITHOUT_UNIT)
            assert unitless or item.attrs["unit"], f"{name} has no unit"

    file.visititems(check)
    run = file["/run"].attrs
    assert run["program"].startswith(b"dem-mpi ")
    assert run["dt"].shape == () and run["gravity"].shape == (3,)
    assert file["/run/scene"].asstr()[0].strip()
    assert len(file["/walls/name"].asstr()[:]) == len(file["/walls/point"])
    assert len(file["/shapes/name"].asstr()[:]) == len(file["/shapes/semi_axes"])


if __name__ == "__main__":
    check_particles(sys.argv[1])
    check_contacts(sys.argv[2])
    print(f"good: vtk {vtk.VTK_VERSION}, h5py {h5py.__version__}")
