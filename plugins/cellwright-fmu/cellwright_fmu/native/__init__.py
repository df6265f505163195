"""C sources of functional mock-up units, and their build for this machine.

Cellwright's kernel of packs, pack.c with its headers, is part of them: battery.c includes it.
"""

import os
from pathlib import Path

import cellwright.native
from cellwright.native import compiler_command, library_file

HERE = Path(__file__).parent
KERNELS = Path(cellwright.native.__file__).parent
OF_PACKS = ("pack.c", "pack_network.h", "cell.h")
SOURCES = [*(KERNELS / name for name in OF_PACKS), *sorted(HERE.glob("*.[ch]"))]
COMPILED = ("battery.c", "fmi3.c")
# Of a library that is handed on: no names but those of the interface, nothing of this machine.
FLAGS = (
    *("-O2", "-std=c11", "-fno-math-errno", "-ffp-contract=off", "-shared", "-fPIC"),
    *("-fvisibility=hidden", "-s", "-I", str(KERNELS)),
)
SYSTEMS = {"Linux": ("linux", ".so"), "Darwin": ("darwin", ".dylib")}
MACHINES = {"x86_64": "x86_64", "amd64": "x86_64", "aarch64": "aarch64", "arm64": "aarch64"}


def unit_sources():
    """The C files of a functional mock-up unit: name → bytes."""
    return {path.name: path.read_bytes() for path in SOURCES}


def unit_binary():
    """These files built for this machine: (platform as FMI 3 names it, suffix, bytes), or None."""
    compiler = compiler_command()
    system, machine = SYSTEMS.get(os.uname().sysname), MACHINES.get(os.uname().machine)
    if compiler is None or system is None or machine is None:
        return None
    compiled = [path for path in SOURCES if path.name in COMPILED]
    path = library_file("unit", compiler, FLAGS, compiled, SOURCES)
    return path and (f"{machine}-{system[0]}", system[1], path.read_bytes())
