"""A forked process runs a script as a new interpreter would, from `__main__` to its exit status."""

import atexit
import builtins
import gc
import importlib
import importlib.machinery
import io
import os
import signal
import sys
import threading
import types


def run(path: str, variables: dict[str, str | None]) -> int:
    """Run a script as `python path` would, as far as to the end of the interpreter. Exit status.

    Parameters
    ----------
    path : the script's file
    variables : of the environment; None where a variable is not to be set
    """
    _renew(variables)
    status = _execute(path)
    _finish_as_an_interpreter()
    try:
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
    except (OSError, ValueError):
        status = status or 120  # as of an interpreter whose output cannot be written
    return status


def _renew(variables):
    """What a new interpreter has of its own, and a forked one inherits."""
    for name, value in variables.items():
        os.environ.pop(name, None)
        os.environ.update({name: value} if value is not None else {})
    if "tempfile" in sys.modules:
        sys.modules["tempfile"].tempdir = None
    # Python seeds its own generator again in a forked process, numpy does not.
    if "numpy.random" in sys.modules:
        sys.modules["numpy.random"].seed()
    importlib.invalidate_caches()


def _execute(path) -> int:
    """Run the file as `__main__`; what it raises is shown as an interpreter shows it."""
    file = os.path.abspath(path)
    sys.argv = [path]
    sys.path[:] = [*([] if sys.flags.safe_path else [os.path.dirname(file)]), *sys.path]
    main = types.ModuleType("__main__")
    main.__dict__.update(__builtins__=builtins, __file__=file, __cached__=None, __annotations__={})
    main.__loader__ = importlib.machinery.SourceFileLoader("__main__", file)
    sys.modules["__main__"] = main
    try:
        with open(file, "rb") as source:
            code = compile(source.read(), file, "exec", dont_inherit=True)
        exec(code, main.__dict__)
    except SystemExit as end:
        return _status(end.code)
    except BaseException as error:
        error = error.with_traceback(error.__traceback__.tb_next)  # without this function's line
        sys.excepthook(type(error), error, error.__traceback__)
        return _interrupted() if isinstance(error, KeyboardInterrupt) else 1
    return 0


def _status(code) -> int:
    """Exit status of a `SystemExit`."""
    if code is None or isinstance(code, int):
        return (code or 0) & 0xFF
    print(code, file=sys.stderr)
    return 1


def _interrupted():
    """End as an interpreter does that was interrupted: by the signal, so that its parent knows."""
    _finish_as_an_interpreter()
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    os.kill(os.getpid(), signal.SIGINT)


def _finish_as_an_interpreter():
    """Wait for the script's threads, run what is to run at the end, close and write its files.

    The packages that were there before the script are not taken apart, which would take longer
    than most scripts.
    """
    threading._shutdown()
    atexit._run_exitfuncs()
    sys.modules["__main__"].__dict__.clear()
    gc.collect()
    for file in gc.get_objects():
        if isinstance(file, io.TextIOWrapper | io.BufferedWriter) and not file.closed:
            _flush(file)


def _flush(file):
    """Write what a file that is still open has not written; one opened for reading has nothing."""
    try:
        file.flush()
    except (OSError, ValueError) as error:
        print(f"Exception ignored in: {file!r}: {error}", file=sys.stderr)
