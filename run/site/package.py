# Recipe for Spack, in a repository of the site: packages/dem_mpi/package.py (README.md has the commands).

import os

from spack_repo.builtin.build_systems.cargo import CargoPackage

from spack.package import *


class DemMpi(CargoPackage):
    """Distributed-memory discrete element method for non-spherical grains: exact contacts, the same bits on any
    number of MPI ranks."""

    license("MIT OR Apache-2.0")

    # The source is a clone, named by `spack develop --path`.
    version("0.2.0")

    depends_on("c", type="build")
    depends_on("rust@1.90:", type="build")
    depends_on("pkgconfig", type="build")
    # The bindings are made by libclang.
    depends_on("llvm+clang", type="build")
    depends_on("mpi")
    depends_on("hdf5@1.10:+mpi+shared")

    def setup_build_environment(self, env: EnvironmentModifications) -> None:
        # The build asks CRAY_MPICH_DIR before MPICC.
        env.unset("CRAY_MPICH_DIR")
        env.set("MPICC", self.spec["mpi"].mpicc)
        env.set("HDF5_DIR", self.spec["hdf5"].prefix)
        env.set("LIBCLANG_PATH", self.spec["llvm"].prefix.lib)

    @property
    def build_args(self):
        arguments = ["--locked"]
        # Made by `cargo vendor`, for machines without network.
        if os.path.exists(join_path(self.stage.source_path, "target", "vendor.toml")):
            arguments += ["--offline", "--config", "target/vendor.toml"]
        return arguments

    def check(self):
        Executable(join_path(self.prefix.bin, "dem-mpi"))("--self-test")
