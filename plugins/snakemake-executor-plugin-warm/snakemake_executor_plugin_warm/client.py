"""Snakemake's side of the server: which scripts it takes, and how one is run and waited for."""

import json
import os
import socket
import subprocess
import sys
import threading
from contextlib import contextmanager, nullcontext
from contextvars import ContextVar
from pathlib import Path
from typing import NamedTuple

from snakemake.benchmark import benchmarked
from snakemake.logging import logger
from snakemake.script import PythonScript
from snakemake.shell import STDOUT, shell
from snakemake.utils import format as format_command

# Set by Snakemake for every shell command and script; read by these libraries when they are loaded.
THREAD_VARIABLES = (
    "OMP_NUM_THREADS",
    "GOTO_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMEXPR_NUM_THREADS",
)
# Set from the resource `tmpdir`, which may differ from job to job.
FOLDER_VARIABLES = ("TMPDIR", "TMP", "TEMPDIR", "TEMP")
MESSAGE_BYTES = 65536

_server = ContextVar("server of the job that this thread runs", default=None)
_execute_locally = PythonScript.execute_script


@contextmanager
def scripts_start_in(server):
    """Within the block, Python scripts that this thread runs start in processes of `server`."""
    # Snakemake has no interface for how a script's interpreter is started. With this one step
    # replaced, all others (preamble, file, benchmark, errors, cleaning up) stay Snakemake's own.
    PythonScript.execute_script = _execute_script
    token = _server.set(server)
    try:
        yield
    finally:
        _server.reset(token)


def _execute_script(script, path, edit=False):
    """Stands for `PythonScript.execute_script`: the same, by the server where that can be."""
    server = _server.get()
    if server is None or not _is_plain(script) or not server.run(script, path):
        _execute_locally(script, path, edit=edit)


def _is_plain(script) -> bool:
    """Whether the local executor would start Snakemake's own interpreter, with nothing around it.

    Libraries read their number of threads when they are loaded, so that a script of several
    threads needs an interpreter of its own.
    """
    elsewhere = script.container_img, script.conda_env, script.env_modules, script.shadow_dir
    wrapped = shell._process_prefix, shell._process_suffix, script.resources.get("shell_exec")
    return not any(elsewhere) and not any(wrapped) and script.threads == 1


def _environment(resources) -> dict:
    """Environment that a script of one thread gets from Snakemake's `shell` and from bash.

    Where no shell began the run, bash is the first one; it counts itself out again before a script.
    """
    variables = {"SHLVL": "0"} | os.environ | dict.fromkeys(THREAD_VARIABLES, "1")
    if not os.path.isdir(here := variables.get("PWD", "")) or not os.path.samefile(here, "."):
        variables["PWD"] = os.getcwd()
    folder = resources.get("tmpdir")
    return variables | (dict.fromkeys(FOLDER_VARIABLES, folder) if folder else {})


def _shared_by_jobs(environment) -> dict:
    """The part of a job's environment that is to be the server's as well."""
    return {name: value for name, value in environment.items() if name not in FOLDER_VARIABLES}


def _command(path) -> str:
    """The command that the local executor would have run, which its errors name."""
    command = format_command("{python} {path:q}", python=sys.executable, path=path)
    return f"{shell._get_process_prefix()} {command}"


class Fork(NamedTuple):
    """A process that the server has forked and that waits for the permission to begin."""

    process: int
    connection: socket.socket
    permission: int

    def wait(self) -> int:
        """Let it run. Its exit status, negative for a signal; -9 where the server has ended."""
        os.write(self.permission, b"1")
        answer = self.connection.recv(MESSAGE_BYTES)
        return json.loads(answer)["status"] if answer else -9

    def end(self):
        """Ask the server to end it."""
        self.connection.shutdown(socket.SHUT_WR)

    def close(self):
        """Close what connects with it."""
        self.connection.close()
        os.close(self.permission)


class Server:
    """A process that has imported packages and forks one process for each script.

    It is started by the first script. Where it cannot take a script, `run` says so, and the script
    runs as the local executor runs it.

    Parameters
    ----------
    preload : names of modules, in the order in which they are imported
    """

    def __init__(self, preload: list[str]):
        self.preload = preload
        # A process that has threads or Apple's frameworks is not safe to fork on other systems.
        self._usable = sys.platform == "linux"
        self._cancelled = False
        self._lock = threading.Lock()
        self._process = None
        self._control = None
        self._started_with = None
        self._forks = set()

    def run(self, script, path: str) -> bool:
        """Run the file of a script to its end. False where it has to be started in another way.

        Raises subprocess.CalledProcessError where the script fails or is killed.
        """
        with self._lock:
            fork = self._fork(path, _environment(script.resources)) if self._usable else None
        if fork is None:
            return False
        self._forks.add(fork)
        try:
            status = self._finish(fork, script.bench_record)
        finally:
            self._forks.discard(fork)
            fork.close()
        if status:
            raise subprocess.CalledProcessError(status, _command(path))
        return True

    def _finish(self, fork, bench_record) -> int:
        """Exit status of a process that may begin now, measured where a benchmark is wanted."""
        if self._cancelled:
            fork.end()
        measured = bench_record is not None
        with benchmarked(fork.process, bench_record) if measured else nullcontext():
            return fork.wait()

    def _fork(self, path, environment):
        """A process for a script; None where the server cannot make one that fits."""
        surroundings = os.getcwd(), _shared_by_jobs(environment)
        if self._process is None:
            self._launch(environment)
            self._started_with = surroundings
        if not self._usable or surroundings != self._started_with:
            return None
        folders = {name: environment.get(name) for name in FOLDER_VARIABLES}
        answer, connection, permission = self._ask({"path": path, "variables": folders})
        if "process" in answer:
            return Fork(answer["process"], connection, permission)
        connection.close()
        os.close(permission)
        self._give_up(answer["reason"])
        return None

    def _ask(self, request):
        """Answer to a request for a process, the connection to it, the pipe that lets it begin."""
        connection, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        allowed, permission = os.pipe()
        try:
            message = json.dumps(request).encode()
            socket.send_fds(self._control, [message], [theirs.fileno(), allowed])
        except OSError as error:
            return {"reason": str(error)}, connection, permission
        finally:
            theirs.close()
            os.close(allowed)
        answer = connection.recv(MESSAGE_BYTES) or b'{"reason": "their server has ended"}'
        return json.loads(answer), connection, permission

    def _launch(self, environment):
        """Start the server and wait until it has imported what it is to import."""
        self._control, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        program = [sys.executable, str(Path(__file__).with_name("server.py"))]
        with theirs:
            self._process = subprocess.Popen(
                [*program, str(theirs.fileno()), *self.preload],
                pass_fds=[theirs.fileno()],
                env=environment,
                stdout=STDOUT,
            )
        answer = self._control.recv(MESSAGE_BYTES) or b'{"reason": "their server has ended"}'
        ready = json.loads(answer)
        for name, reason in ready.get("failed", {}).items():
            logger.warning(f"Warm start: {name} is not imported beforehand: {reason}")
        if "reason" in ready:
            self._give_up(ready["reason"])

    def _give_up(self, reason):
        """Use the server no more, and say why."""
        self._usable = False
        logger.warning(f"Warm start: scripts start in new interpreters from now on: {reason}")

    def end_scripts(self):
        """End the scripts that run, and those that are about to."""
        self._cancelled = True
        for fork in list(self._forks):
            fork.end()

    def close(self):
        """End the server. It ends whatever it has forked and is still running."""
        if self._process is not None:
            self._control.close()
            self._process.wait()
