#!/bin/sh
# Writes snapshots under mpirun and opens them with VTK and h5py.
# usage: tests/open_in_vtk.sh [version of vtk, e.g. 9.3.1]
# Makes a virtual environment with them under target/, once.
set -eu
cd "$(dirname "$0")/.."
version=${1:-}
python=target/vtk$version
if ! "$python/bin/python" -c 'import vtk, h5py' 2>/dev/null; then
    python3 -m venv "$python"
    "$python/bin/pip" install --quiet "vtk${version:+==$version}" h5py
fi
snapshots=$PWD/target/tmp/open_in_vtk
rm -rf "$snapshots"
mkdir -p "$snapshots"
DEM_MPI_KEEP_SNAPSHOTS=$snapshots cargo test --quiet --test ranks -- snapshot_round_trip
for ranks in 1 2 4; do
    for step in 000000003 000000004; do
        "$python/bin/python" tests/open_in_vtk.py \
            "$snapshots/$ranks/particles_$step.vtkhdf" "$snapshots/$ranks/contacts_$step.vtkhdf"
    done
done
