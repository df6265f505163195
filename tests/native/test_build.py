"""Kernels are built once, by whoever loads them, and leave no process behind."""

import os
import signal
import subprocess
import sys
import time

import psutil
import pytest

from cellwright import native

SOURCE = "double twice(double x) { return 2 * x; }\n"
COMPILER = native.compiler_command()
FLAGS = ("-O1", "-shared", "-fPIC")

pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C compiler")


@pytest.fixture
def source(tmp_path, monkeypatch):
    """A C file; the user's cache cannot be made, and the machine's folder is the test's own."""
    path = tmp_path / "twice.c"
    path.write_text(SOURCE)
    (tmp_path / "no_folder").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "no_folder"))
    monkeypatch.setattr(native.tempfile, "gettempdir", lambda: str(tmp_path))
    return path


def built(source):
    return native.library_file("test", COMPILER, FLAGS, [source])


def test_a_library_lies_where_nobody_else_can_write(source):
    path = built(source)
    assert path.exists()
    assert path.parent.stat().st_mode & 0o777 == 0o700
    made = path.stat().st_mtime_ns
    assert (built(source), path.stat().st_mtime_ns) == (path, made)


@pytest.mark.parametrize("mode", [0o777, 0o770, 0o755])
def test_a_folder_that_others_may_enter_is_not_loaded_from(source, mode):
    folder = built(source).parent
    folder.chmod(mode)
    with pytest.warns(RuntimeWarning, match=f"with mode {mode:o}, wanted this user's"):
        assert built(source) is None


def test_a_folder_of_another_user_is_not_loaded_from(source, monkeypatch):
    built(source)
    own, folder = os.getuid(), source.parent / f"cellwright-{os.getuid()}"
    monkeypatch.setattr(native.os, "getuid", lambda: own + 1)
    folder.rename(folder.with_name(f"cellwright-{own + 1}"))
    with pytest.warns(RuntimeWarning, match=f"it is user {own}'s"):
        assert built(source) is None


def test_the_cache_of_a_user_may_be_read_by_others(source, monkeypatch):
    cache = source.parent / "cache"
    monkeypatch.setenv("XDG_CACHE_HOME", str(cache))
    path = built(source)
    assert path.parent == cache / "cellwright"
    path.parent.chmod(0o775)
    assert built(source) == path


def test_an_interrupted_build_leaves_no_process_behind(tmp_path):
    """The compiler's own passes too: they are killed with it."""
    nap = "sleep 60 & wait"
    # Tests that a shell runs in the background do not hear an interrupt, nor does what they begin.
    heard = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"
    told = f"{heard}; from cellwright import native; native._finished(2 * [['sh', '-c', {nap!r}]])"
    with subprocess.Popen([sys.executable, "-c", told], stderr=subprocess.PIPE) as building:
        napping = psutil.Process(building.pid)
        while len(children := napping.children(recursive=True)) < 4:
            time.sleep(0.05)
        building.send_signal(signal.SIGINT)
        assert b"KeyboardInterrupt" in building.communicate(timeout=30)[1]
    _, left = psutil.wait_procs(children, timeout=10)
    # One that nobody has fetched yet from among the dead has ended, too.
    assert [one for one in left if one.status() != psutil.STATUS_ZOMBIE] == []


def test_a_command_that_fails_says_why_and_the_others_are_stopped():
    start = time.monotonic()
    with pytest.raises(subprocess.CalledProcessError) as failed:
        native._finished([["sh", "-c", "echo no such file >&2; exit 3"], ["true"]])
    assert (failed.value.returncode, failed.value.stderr) == (3, b"no such file\n")
    with pytest.raises(FileNotFoundError):
        native._finished([["sleep", "60"], ["/no/such/compiler"]])
    assert time.monotonic() - start < 20
