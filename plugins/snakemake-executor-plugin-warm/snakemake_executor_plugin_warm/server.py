"""The server: a process of one thread that imports packages and forks a process for each script.

Snakemake starts it as `python server.py DESCRIPTOR MODULE…`. It reads requests from the socket of
that descriptor: a script's path and variables, and with it a connection of this script's own and a
pipe. It answers with the number of the forked process, and when that has ended with its exit
status. The forked process begins when a byte comes through the pipe. Where Snakemake shuts its end
of a connection, the script is ended; where the socket of requests is closed, because the run is
over or Snakemake was killed, all scripts and the server end.
"""

import contextlib
import ctypes
import gc
import importlib
import json
import os
import pkgutil
import selectors
import signal
import socket
import sys
import threading
import time

import as_main

# What Snakemake writes at the beginning of every script imports these.
PREAMBLE = ("snakemake.logging", "snakemake.iocontainers")
REQUEST_BYTES = 65536
# From the request to end until it is enforced [s], for scripts that clean up behind them.
GRACE_SECOND = 5.0
KILLED = float("inf")  # deadline of a script that was killed: nothing is waited for any more
# A thread that an import has started and that is about to end is waited for so long [s].
THREAD_SECOND = 1.0
SET_PARENT_DEATH_SIGNAL = 1  # PR_SET_PDEATHSIG of Linux' prctl
# Options of glibc's mallopt with the bytes that each is set to: arrays of up to 32 MiB come from
# memory that the process already has, of which up to 128 MiB that nothing uses are kept.
KEPT_MEMORY_BYTES = {-3: 32 << 20, -1: 128 << 20}  # M_MMAP_THRESHOLD, M_TRIM_THRESHOLD
# Sent to all processes of a terminal or a group. Snakemake decides when the server ends.
GROUP_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)


# Told to libraries that otherwise start a thread of their own as soon as they are loaded: the
# allocator jemalloc within pyarrow, which gives memory back now and then.
WITHOUT_THREADS = {"JE_ARROW_MALLOC_CONF": "background_thread:false"}


def keep_freed_memory():
    """Let scripts use memory again that they freed, where it went back to the kernel before.

    numpy frees an array after nearly every operation, and the kernel hands memory out in pages of
    zeros: a fault per page, for scripts of array arithmetic a fifth of their CPU time. Where the C
    library is not glibc, or its user has set one of these options, nothing changes.
    """
    of_user = {"MALLOC_MMAP_THRESHOLD_", "MALLOC_TRIM_THRESHOLD_", "GLIBC_TUNABLES"}
    library = ctypes.CDLL(None)
    if hasattr(library, "gnu_get_libc_version") and not of_user & os.environ.keys():
        for option, size_byte in KEPT_MEMORY_BYTES.items():
            library.mallopt(option, size_byte)


def import_all(names) -> dict[str, str]:
    """Import modules in the order of their names. Those that could not be, with the reason."""
    failed = {}
    for name in names:
        try:
            _import(name)
        except Exception as error:  # a package may fail in any way; scripts need not know it
            failed[name] = f"{type(error).__name__}: {error}"
    return failed


def _import(name):
    """Import a module, or by `package.*` a package and all modules below it."""
    package = importlib.import_module(name.removesuffix(".*"))
    if name.endswith(".*"):
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            importlib.import_module(module.name)


def source_files() -> dict[str, tuple]:
    """Time, size and number of the files of imported modules that are no installed packages."""
    installed = tuple(os.path.join(prefix, "") for prefix in {sys.prefix, sys.base_prefix})
    paths = {getattr(module, "__file__", None) for module in list(sys.modules.values())} - {None}
    return {path: _stamp(path) for path in paths if not path.startswith(installed)}


def _stamp(path):
    """What changes when a file is written; None where there is no file."""
    try:
        about = os.stat(path)
    except OSError:
        return None
    return about.st_mtime_ns, about.st_size, about.st_ino


def threads_left() -> list[str]:
    """Names of this process' threads beside its first, a moment after the last import."""
    others = [thread for thread in threading.enumerate() if thread is not threading.main_thread()]
    for thread in others:
        thread.join(THREAD_SECOND)
    names = [thread.name for thread in others if thread.is_alive()]
    of_libraries = len(os.listdir("/proc/self/task")) - 1 - len(names)
    return names + ["thread of a compiled library"] * of_libraries


def _send(connection, answer: dict):
    """Tell Snakemake, where it still listens."""
    with contextlib.suppress(OSError):
        connection.send(json.dumps(answer).encode())


class Server:
    """Forks, watches and ends the processes of scripts.

    Parameters
    ----------
    control : socket of requests
    signals : how each signal was handled when this process began, for the scripts
    """

    def __init__(self, control: socket.socket, signals: dict):
        self.control = control
        self.signals = signals
        self.files = source_files()
        self.number = os.getpid()
        self.connections = {}
        self.deadlines = {}
        self.selector = selectors.DefaultSelector()
        self.ended, self.wake = socket.socketpair()
        self.wake.setblocking(False)
        self.interrupted = False
        signal.signal(signal.SIGINT, self._note_interrupt)
        signal.signal(signal.SIGCHLD, lambda number, frame: None)
        signal.set_wakeup_fd(self.wake.fileno(), warn_on_full_buffer=False)
        self.selector.register(control, selectors.EVENT_READ, self._fork)
        self.selector.register(self.ended, selectors.EVENT_READ, self._report)

    def serve(self) -> tuple[dict, int]:
        """Answer requests. Returns in forked processes only: the request and its pipe."""
        mine = None
        while mine is None:
            waiting = (one for one in self.deadlines.values() if one < KILLED)
            patience = min(waiting, default=None)
            events = self.selector.select(patience and max(0.0, patience - time.monotonic()))
            for key, _ in events[:1]:  # each may end what the next is about
                mine = key.data(key.fileobj)
            self._kill_overdue()
        return mine

    def _fork(self, control):
        """Fork for the next request; where there will be none, end."""
        message, descriptors, _, _ = socket.recv_fds(control, REQUEST_BYTES, 2)
        if not message:
            self._end()
        connection, pipe = socket.socket(fileno=descriptors[0]), descriptors[1]
        try:
            process = None if self._changed() else os.fork()
            answer = {"process": process} if process else {"reason": self._changed()}
        except OSError as error:
            process, answer = None, {"reason": f"no process could be made: {error}"}
        if process == 0:
            self._leave(connection)
            return json.loads(message), pipe
        os.close(pipe)
        _send(connection, answer)
        if process is None:
            connection.close()
            return None
        self.connections[process] = connection
        self.selector.register(connection, selectors.EVENT_READ, self._terminate)
        return None

    def _changed(self) -> str | None:
        """Which imported file is not what it was, for scripts have to see the new one."""
        changed = (path for path, stamp in self.files.items() if _stamp(path) != stamp)
        path = next(changed, None)
        return path and f"{path} was changed during this run"

    def _leave(self, connection):
        """In a forked process: cut what connects it with the server, and end when that ends."""
        ctypes.CDLL(None).prctl(SET_PARENT_DEATH_SIGNAL, signal.SIGKILL, 0, 0, 0)
        if os.getppid() != self.number:
            os._exit(1)
        signal.set_wakeup_fd(-1)
        self.selector.close()
        for other in (self.control, self.ended, self.wake, connection, *self.connections.values()):
            other.close()
        for number, handler in self.signals.items():
            signal.signal(number, handler)

    def _report(self, ended):
        """Tell the exit status of every process that has ended."""
        ended.recv(REQUEST_BYTES)
        while self.connections:
            process, status = os.waitpid(-1, os.WNOHANG)
            if process == 0:
                break
            connection = self.connections.pop(process)
            if self.deadlines.pop(process, None) is None:
                self.selector.unregister(connection)
            _send(connection, {"status": os.waitstatus_to_exitcode(status)})
            connection.close()

    def _note_interrupt(self, number, frame):
        """The keyboard's interrupt reaches this process and the scripts alike."""
        self.interrupted = True

    def _terminate(self, connection):
        """Ask a script to end whose connection Snakemake has shut, unless the keyboard did."""
        self.selector.unregister(connection)
        process = next(n for n, other in self.connections.items() if other is connection)
        self.deadlines[process] = time.monotonic() + GRACE_SECOND
        if not self.interrupted:
            os.kill(process, signal.SIGTERM)

    def _kill_overdue(self):
        """Kill what was asked to end and has not."""
        for process, deadline in self.deadlines.items():
            if time.monotonic() >= deadline:
                self.deadlines[process] = KILLED
                os.kill(process, signal.SIGKILL)

    def _end(self):
        """End all scripts that still run, then this process."""
        for process in self.connections:
            os.kill(process, signal.SIGKILL)
        for process in self.connections:
            os.waitpid(process, 0)
        os._exit(0)


def main():
    """The server; in a forked process the script, whose exit status becomes the process'."""
    handled = (*GROUP_SIGNALS, signal.SIGCHLD)
    signals = {number: signal.getsignal(number) for number in handled}
    for number in GROUP_SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    control = socket.socket(fileno=int(sys.argv[1]))
    control.set_inheritable(False)
    if not sys.flags.safe_path:
        del sys.path[0]  # this file's folder
    keep_freed_memory()
    environment = dict(os.environ)
    os.environ.update(WITHOUT_THREADS | environment)
    failed = import_all([*PREAMBLE, *sys.argv[2:]])
    for name in WITHOUT_THREADS.keys() - environment.keys():
        del os.environ[name]
    threads = ", ".join(threads_left())
    refusal = {"reason": f"importing their packages started {threads}"} if threads else {}
    _send(control, {"failed": failed, **refusal})
    gc.collect()
    gc.freeze()  # what collections in scripts then leave alone stays shared memory
    request, pipe = Server(control, signals).serve()
    if os.read(pipe, 1):
        os.close(pipe)
        os._exit(as_main.run(request["path"], request["variables"]))
    os._exit(1)


if __name__ == "__main__":
    main()
