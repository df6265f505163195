"""Compiled kernels: the C sources beside this file, built once on this machine, loaded by ctypes.

`./run` builds them as it installs (`build`); where a source has changed since, its first use does.

Every kernel has a twin in numpy that says the same in more time; where no C compiler is, or
CELLWRIGHT_NATIVE=0, `function` gives None and the caller takes the twin. Fast-math is off: kernel
and twin agree to rounding. This room alone touches files and processes, to build what it loads.
"""

import ctypes
import fcntl
import hashlib
import os
import shutil
import signal
import subprocess
import tempfile
import warnings
from collections.abc import Callable
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

SOURCES = sorted(Path(__file__).parent.glob("*.c"))
HEADERS = sorted(Path(__file__).parent.glob("*.h"))
FLAGS = ("-O3", "-std=c11", "-fno-math-errno", "-ffp-contract=off", "-shared", "-fPIC")


class Argument(NamedTuple):
    """Type of a kernel's argument; ctypes asks its `from_param` for what is handed on."""

    from_param: Callable


def _pointer(dtype):
    """Type of a contiguous array argument, checked at every call as numpy's ndpointer does.

    A call of that takes 1 to 4 microseconds for each array, more than some kernels themselves; the
    buffer interface, which refuses what is not contiguous, takes a sixth. What it cannot hand on,
    such as an array that must not be written to, goes the way of ndpointer.
    """
    checked = np.ctypeslib.ndpointer(dtype=dtype, flags="C_CONTIGUOUS")
    own, buffer, address = np.dtype(dtype), ctypes.c_char * 0, ctypes.byref

    def from_param(values):
        """Address of the values, which the call keeps alive; TypeError for another array."""
        if type(values) is not np.ndarray or values.dtype is not own:
            return checked.from_param(values)
        try:
            return address(buffer.from_buffer(values))
        except TypeError:
            return checked.from_param(values)

    return Argument(from_param)


array, integers = _pointer(np.float64), _pointer(np.int64)
real, count = ctypes.c_double, ctypes.c_int64


@cache
def function(name, *types, result=None):
    """A kernel by its C name, ready to be called, or None where kernels cannot be built.

    Parameters
    ----------
    name : name of the C function.
    types : type of each argument: `array`, `integers`, `real` or `count`.
    result : type of what it returns; None for nothing.
    """
    library = _library()
    if library is None:
        return None
    # By key, which makes a function of its own; by attribute all callers would share one's types.
    kernel = library[name]
    kernel.argtypes, kernel.restype = types, result
    return kernel


def build():
    """Compile the kernels of this version where they are not yet: whether they serve now."""
    return _library() is not None


@cache
def _library():
    compiler = compiler_command()
    if compiler is None:
        return None
    path = library_file("kernels", compiler, FLAGS, SOURCES, HEADERS)
    return path and ctypes.CDLL(str(path))


def library_file(kind, compiler, flags, sources, included=()):
    """A library of these sources, built where it is not there yet; None where it cannot be.

    Parameters
    ----------
    kind : begin of its name. compiler : command. flags : of the compiler.
    sources : paths of the C files. included : of those that they include.
    """
    digest = hashlib.sha256(repr((flags, os.uname().machine, os.uname().sysname)).encode())
    for source in (*sources, *included):
        digest.update(source.read_bytes())
    for home, others in _homes():
        path = home / f"{kind}-{digest.hexdigest()[:16]}.so"
        if _is_own(home, others) and (_serves(path) or _built(compiler, path, flags, sources)):
            return path
    return None


def compiler_command():
    """Command of a C compiler, None where there is none or kernels are not wanted."""
    compiler = next((c for c in (os.environ.get("CC"), "cc", "gcc", "clang") if _found(c)), None)
    return None if os.environ.get("CELLWRIGHT_NATIVE") == "0" else compiler


def _found(command):
    return bool(command) and shutil.which(command.split()[0]) is not None


def _homes():
    """Where the library may lie: the user's cache, else a folder that ends with the machine.

    And what others may be allowed there [mode]: in the one that anybody could have made, nothing.
    """
    cached = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    yield Path(cached) / "cellwright", 0o077
    yield Path(tempfile.gettempdir()) / f"cellwright-{os.getuid()}", 0


def _is_own(folder, others):
    """Whether a folder is this user's, with no more than that allowed to others.

    What lies in it is loaded into the process: whoever can write there runs what they like.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        about = os.stat(folder)
    except OSError:  # a folder that cannot be made, of which the next one takes the place
        return False
    if about.st_uid == os.getuid() and not about.st_mode & 0o077 & ~others:
        return True
    found = f"user {about.st_uid}'s, with mode {about.st_mode & 0o777:o}"
    wanted = f"this user's ({os.getuid()}), with mode {0o700 | others:o} at most"
    said = f"no kernels are kept in {folder}: it is {found}, wanted {wanted}"
    warnings.warn(said, RuntimeWarning, stacklevel=2)
    return False


def _serves(path):
    """Whether a library is there, and this user's own."""
    return path.exists() and os.stat(path).st_uid == os.getuid()


def _built(compiler, path, flags, sources):
    """Build beside the target and move it there, so that no other job sees half a library.

    Jobs that begin at once wait for the first one. Where it fails the twins serve, tens of times
    slower: said once, in the compiler's words.
    """
    try:
        with _alone(path):
            _compiled(compiler.split(), path, flags, sources)
    except (OSError, subprocess.SubprocessError) as error:
        reason = getattr(error, "stderr", None) or str(error).encode()
        warnings.warn(
            f"no compiled kernels: {reason.decode()[:2000]}", RuntimeWarning, stacklevel=2
        )
        return False
    return True


@contextmanager
def _alone(path):
    """One process at a time, where the disk knows locks."""
    with open(path.with_suffix(".lock"), "wb") as lock:
        with suppress(OSError):
            fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def _compiled(compiler, path, flags, sources):
    """All sources at once, then the library of them, where another process has not built it."""
    if _serves(path):
        return
    of_parts = [flag for flag in flags if flag != "-shared"]
    with tempfile.TemporaryDirectory(dir=path.parent) as folder:
        made = Path(folder) / path.name
        parts = [str(Path(folder) / f"{number}.o") for number in range(len(sources))]
        pairs = zip(sources, parts, strict=True)
        _finished([[*compiler, *of_parts, "-c", str(s), "-o", part] for s, part in pairs])
        _finished([[*compiler, *flags, *parts, "-o", str(made), "-lm"]])
        made.replace(path)


def _finished(commands):
    """Run commands side by side; CalledProcessError with the words of the first that fails.

    However long they take on a busy machine: the twins would take longer. None is left behind, nor
    what it has started, as a compiler does its passes.
    """
    running = []
    try:
        for command in commands:
            running.append(subprocess.Popen(command, stderr=subprocess.PIPE, process_group=0))
        said = [process.communicate()[1] for process in running]
    finally:
        for process in (one for one in running if one.poll() is None):
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
    for process, words in zip(running, said, strict=True):
        if process.returncode:
            raise subprocess.CalledProcessError(process.returncode, process.args, stderr=words)
