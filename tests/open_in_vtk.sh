#!/bin/sh
# Opens snapshots with VTK and h5py, as users do.
# usage: tests/open_in_vtk.sh [PARTICLES...]
#   PARTICLES     particles files, each with its contacts file beside it;
#                 without: made-up ones, written under mpirun on 1, 2 and 4 ranks
#   VTK_VERSION   in the environment: another VTK than the newest, e.g. 9.3.1
# usage: tests/open_in_vtk.sh --exports PARTICLES FOLDER
#   the folder has what dem-post has made of them: VTP files and dem.py
# usage: tests/open_in_vtk.sh --exchange PARTICLES FOLDER
#   the same of the files for other codes
# usage: tests/open_in_vtk.sh --played MESH FOLDER PARTICLES...
#   the same of several snapshots, for the lists with their times; MESH is the file of the wall that moves
# Makes a virtual environment with these and pyvista under target/, once. Exit status 3: they cannot be fetched.
set -eu
cd "$(dirname "$0")/.."
version=${VTK_VERSION:-}
python=target/vtk$version
if ! "$python/bin/python" -c 'import vtk, h5py, pyvista' 2>/dev/null; then
    { python3 -m venv "$python" &&
        "$python/bin/pip" install --quiet "vtk${version:+==$version}" h5py pyvista; } || exit 3
fi
if [ "${1:-}" = --exports ]; then
    exec "$python/bin/python" tests/open_exports.py "$2" "$3"
fi
if [ "${1:-}" = --exchange ]; then
    exec "$python/bin/python" tests/open_exchange.py "$2" "$3"
fi
if [ "${1:-}" = --played ]; then
    shift
    exec "$python/bin/python" tests/play_exports.py "$@"
fi
if [ $# -eq 0 ]; then
    snapshots=$PWD/target/tmp/open_in_vtk
    rm -rf "$snapshots"
    mkdir -p "$snapshots"
    DEM_MPI_KEEP_SNAPSHOTS=$snapshots cargo test --quiet --test ranks -- snapshot_round_trip
    set -- "$snapshots"/*/particles_*.vtkhdf
fi
for particles in "$@"; do
    contacts=$(dirname "$particles")/contacts_${particles##*/particles_}
    "$python/bin/python" tests/open_in_vtk.py "$particles" "$contacts"
done
