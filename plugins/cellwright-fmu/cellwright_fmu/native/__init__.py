"""C sources of functional mock-up units, and their build for this machine.

Cellwright's kernels are part of them: battery.c includes that of packs, particle_cell.c that of a
particle. Both are a battery as battery.h has it; a unit holds one of them.
"""

import os
from pathlib import Path

import cellwright.native
from cellwright.native import compiler_command, library_file

HERE = Path(__file__).parent
KERNELS = Path(cellwright.native.__file__).parent
FACE = ("battery.h", *sorted(path.name for path in HERE.glob("fmi3*.[ch]")))
OF_PACKS = ("battery.c", "pack.c", "pack_network.h", "cell.h")
OF_PARTICLES = ("particle_cell.c", "particle.c", "cell.h")
# Of a library that is handed on: no names but those of the interface, nothing of this machine.
FLAGS = (
    *("-O2", "-std=c11", "-fno-math-errno", "-ffp-contract=off", "-shared", "-fPIC"),
    *("-fvisibility=hidden", "-s", "-I", str(KERNELS)),
)
SYSTEMS = {"Linux": ("linux", ".so"), "Darwin": ("darwin", ".dylib")}
MACHINES = {"x86_64": "x86_64", "amd64": "x86_64", "aarch64": "aarch64", "arm64": "aarch64"}


def unit_code(files):
    """The code of a functional mock-up unit: sources (name → bytes), names of those that are
    compiled, and what they are built to for this machine (platform as FMI 3 names it, suffix,
    bytes), or None.

    Parameters
    ----------
    files : OF_PACKS or OF_PARTICLES.
    """
    paths = [path if path.exists() else KERNELS / path.name for path in map(HERE.joinpath, files)]
    paths += [HERE / name for name in FACE]
    compiled = (files[0], "fmi3.c")
    return {path.name: path.read_bytes() for path in paths}, compiled, _binary(paths, compiled)


def _binary(sources, compiled):
    compiler = compiler_command()
    system, machine = SYSTEMS.get(os.uname().sysname), MACHINES.get(os.uname().machine)
    if compiler is None or system is None or machine is None:
        return None
    built = [path for path in sources if path.name in compiled]
    path = library_file("unit", compiler, FLAGS, built, sources)
    return path and (f"{machine}-{system[0]}", system[1], path.read_bytes())
