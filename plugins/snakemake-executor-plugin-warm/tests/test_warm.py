"""The warm executor beside the local one: the same workflow by both, and what differs."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

import psutil
import pytest
from snakemake.common.tests import TestWorkflowsLocalStorageBase

from snakemake_executor_plugin_warm import ExecutorSettings

PLUGIN = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(PLUGIN.parents[1] / "tests" / "workflow"))
import starts  # noqa: E402

# Every script that a rule of its name runs, and what the local executor makes of it is expected.
SCRIPTS = {
    # What a script sees of its interpreter.
    "surroundings": """
        import inspect, os, re, signal, sys, threading
        late = ".snakemake/pip-deployments"  # appended by Snakemake when it is imported first
        assert sys.path.count(late) == 1
        hidden = {"_"}  # what bash itself ran
        seen = {
            "arguments": [os.path.basename(name)[11:] for name in sys.argv],
            "variables": sorted(item for item in os.environ.items() if item[0] not in hidden),
            "folder": os.getcwd(),
            "path": [re.sub("cache/tmp.{8}", "cache", path) for path in sys.path if path != late],
            "globals": sorted(globals()),
            "main": sys.modules["__main__"].__dict__ is globals(),
            "name": (__name__, __file__, __spec__, type(__loader__).__name__),
            "signals": [str(signal.getsignal(number)) for number in (2, 13, 15, 17)],
            "files": sorted(int(name) for name in os.listdir("/proc/self/fd") if int(name) > 2)[1:],
            "threads": threading.active_count(),
            "stack": len(inspect.stack()) > 0,
        }
        print("said by a script")
        print("said as an error", file=sys.stderr)
        with open(snakemake.log[0], "w") as log:
            print("logged", snakemake.wildcards.name, snakemake.params.number, file=log)
        with open(snakemake.output[0], "w") as file:
            print(*seen.items(), sep="\\n", file=file)
        """,
    # What has to happen at the end of an interpreter.
    "ending": """
        import atexit, tempfile, threading, time
        output = open(snakemake.output[0], "w")
        output.write("never closed; ")
        atexit.register(output.write, "at exit; ")
        temporary = tempfile.NamedTemporaryFile(dir=".", prefix="remains")
        threading.Thread(target=lambda: (time.sleep(0.3), output.write("a thread; "))).start()
        """,
    "raises": """
        open(snakemake.output[0], "w").write("unfinished")
        def inner():
            raise ValueError("a value that is wrong")
        inner()
        """,
    "syntax": "this is no Python",
    "exits_3": "import sys; open(snakemake.output[0], 'w'); sys.exit(3)",
    "exits_0": "import sys; open(snakemake.output[0], 'w'); sys.exit(0)",
    "exits_text": "import sys; sys.exit('the reason')",
    "interrupts": "raise KeyboardInterrupt",
    "killed": "import os; open(snakemake.output[0], 'w'); os.kill(os.getpid(), 9)",
    "crashes": "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)",
    "no_output": "pass",
    # Fails at first; what it left must be gone, and it is run again.
    "second_attempt": """
        import pathlib
        left = pathlib.Path(snakemake.output[0])
        assert not left.exists()
        left.write_text("done")
        mark = pathlib.Path("attempted")
        if not mark.exists():
            mark.touch()
            raise SystemExit(1)
        """,
}
RULE = """
rule {name}:
    output: "out/{{name,{name}}}.txt"
    log: "logs/{{name}}.log"
    benchmark: "benchmarks/{{name}}.tsv"
    params: number=7
    retries: {retries}
    script: "scripts/{name}.py"
"""


class Run(NamedTuple):
    """A workflow's folder, how Snakemake ended, and what it said."""

    folder: Path
    status: int
    said: str


def write(folder: Path, snakefile: str, **scripts: str) -> Path:
    """A workflow with its scripts."""
    (folder / "scripts").mkdir(parents=True)
    (folder / "Snakefile").write_text(snakefile)
    for name, text in scripts.items():
        lines = text.strip("\n").split("\n")
        indent = len(lines[0]) - len(lines[0].lstrip())
        (folder / "scripts" / f"{name}.py").write_text("\n".join(line[indent:] for line in lines))
    return folder


def command(executor, *arguments, cores=1):
    program = [sys.executable, "-m", "snakemake", "--profile", "none", "--cores", str(cores)]
    return [*program, "--executor", executor, *arguments]


def environment(folder):
    path = os.pathsep.join([str(PLUGIN), str(folder / "scripts")])
    inherited = {name: v for name, v in os.environ.items() if not name.startswith("MALLOC_")}
    return {**inherited, "PYTHONPATH": path}


def snakemake(folder, *arguments, executor="warm", cores=1, start=starts.forked) -> Run:
    given = command(executor, *arguments, cores=cores)[3:]
    return Run(folder, *start(*given, folder=folder, environment=environment(folder)))


def text(folder, name) -> str:
    return (folder / "out" / f"{name}.txt").read_text()


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    """The workflow of all scripts, run by the local and by the warm executor, in one place."""
    rules = [RULE.format(name=name, retries=int(name == "second_attempt")) for name in SCRIPTS]
    goals = ", ".join(f'"out/{name}.txt"' for name in SCRIPTS)
    runs = {}
    for executor in ("local", "warm"):
        folder = tmp_path_factory.mktemp("both") / "workflow"
        write(folder, f"rule all:\n    input: {goals}\n" + "".join(rules), **SCRIPTS)
        # Names of temporary files in messages are compared, so the folder has to be the same.
        place = folder.parent.parent / "workflow_run_by_both"
        folder.rename(place)
        run = snakemake(
            place, "--keep-going", "--latency-wait", "0", executor=executor, start=starts.anew
        )
        place.rename(folder)
        runs[executor] = run._replace(folder=folder)
    return runs


def comparable(said: str) -> list[str]:
    """Lines of a run's messages without what differs between two runs of the same executor.

    Snakemake prints an empty line before a job unless one was the last thing told, which depends
    on the moment at which another job ends: so empty lines are left out.
    """
    start = said[said.index("Building DAG of jobs...") :]
    for pattern, stands_for in (
        (r"\[\w{3} \w{3} +\d+ [\d:]+ \d{4}\]", "[time]"),
        (r"/tmp\w{8}\.", "/tmpNAME."),
        (r"\d{4}-\d\d-\d\dT\d{6}\.\d+", "TIME"),
        (r"Elapsed time: .*", "Elapsed time"),
        (r"\(?jobid:? \d+\)?|jobid: \d+|Trying to restart job \d+", "job"),
    ):
        start = re.sub(pattern, stands_for, start)
    ours = "snakemake_executor_plugin_warm|, in (__new__|_execute_cmd|execute_script)"
    lines = (line for line in start.splitlines() if line.strip())
    return sorted(line for line in lines if not re.search(ours, line))


def files(folder) -> dict[str, bytes]:
    """Files of a run that are not Snakemake's own; of a benchmark the head."""
    found = {}
    for path in folder.rglob("*"):
        name = path.relative_to(folder).as_posix()
        if path.is_file() and not name.startswith((".snakemake/", "scripts/__pycache__")):
            measured = name.startswith("benchmarks/")
            found[name] = path.read_bytes().splitlines()[:1] if measured else path.read_bytes()
    return found


@pytest.mark.slow
def test_same_files_and_bytes(both):
    local, warm = files(both["local"].folder), files(both["warm"].folder)
    assert local == warm
    made = {name for name in local if name.startswith("out/")}
    assert made == {f"out/{n}.txt" for n in ("surroundings", "ending", "exits_0", "second_attempt")}


@pytest.mark.slow
def test_same_messages_and_exit_status(both):
    assert both["local"].status == both["warm"].status == 1
    assert comparable(both["local"].said) == comparable(both["warm"].said)
    for message in ("a value that is wrong", "the reason", "died with <Signals.SIGKILL: 9>"):
        assert message in both["warm"].said


@pytest.mark.slow
def test_an_interpreter_is_ended_as_it_should_be(both):
    assert text(both["warm"].folder, "ending") == "never closed; a thread; at exit; "


@pytest.mark.slow
def test_a_benchmark_measures_the_script_alone(tmp_path):
    """0.6 s of work of a server that has used more before.

    Snakemake looks once, 0.5 s after the start: on a busy machine the script has had any share of
    the processor by then, only never more than its own.
    """
    work = """
        import time
        start = time.process_time()
        while time.process_time() < start + 0.6:
            pass
        open(snakemake.output[0], "w").write(str(start))
        """
    folder = write(tmp_path / "w", RULE.format(name="work", retries=0), work=work)
    assert snakemake(folder, "out/work.txt", "--warm-preload", "snakemake.api").status == 0
    head, values = (folder / "benchmarks/work.tsv").read_text().splitlines()
    measured = dict(zip(head.split("\t"), values.split("\t"), strict=True))
    assert float(text(folder, "work")) < 0.2  # CPU time begins anew
    assert 0.5 < float(measured["s"]) < 60
    assert 0 < float(measured["cpu_time"]) < 0.8


STATE = """
rule all:
    input: "out/after.txt"
rule before:
    output: "out/before.txt"
    script: "scripts/before.py"
rule after:
    input: "out/before.txt"
    output: "out/after.txt"
    script: "scripts/after.py"
"""


# What one script changes, what the next one looks at, and what that has to find.
LEFT_BEHIND = {
    "variable": ("os.environ['LEFT'] = 'behind'", "os.environ.get('LEFT')", "None"),
    "module": ("import json; json.left = 1", "hasattr(__import__('json'), 'left')", "False"),
    "search path": ("sys.path.insert(0, 'left')", "'left' in sys.path", "False"),
    "file mode": ("os.umask(0o070)", "os.umask(0o022)", str(0o022)),
    "style of plots": (
        "import matplotlib; matplotlib.rcParams['font.size'] = 99",
        "__import__('matplotlib').rcParams['font.size']",
        "10.0",
    ),
    "memory": (
        "left = b'1' * 400_000_000",
        "__import__('psutil').Process().memory_info().rss < 300e6",
        "True",
    ),
}
RANDOM = "(__import__('random').random(), __import__('numpy').random.random())"


@pytest.mark.slow
def test_a_script_leaves_nothing_to_the_next(tmp_path):
    changes = [change for change, _, _ in LEFT_BEHIND.values()]
    looks = [f"print({look}, file=out)" for _, look, _ in LEFT_BEHIND.values()]
    start = "import os, sys, numpy\nout = open(snakemake.output[0], 'w')"
    random = f"numpy.random.seed(None)\nprint({RANDOM}, file=out)"
    folder = write(
        tmp_path / "w",
        STATE,
        before="\n".join([start, random, "numpy.random.seed(0)", *changes, *looks]),
        after="\n".join([start, f"print({RANDOM}, file=out)", *looks]),
    )
    previous = os.umask(0o022)
    preloaded = ("json", "matplotlib", "psutil", "numpy.random")
    run = snakemake(folder, "--warm-preload", *preloaded, start=starts.anew)  # inherits the mode
    os.umask(previous)
    assert run.status == 0, run.said
    (before, *changed), (after, *found) = (
        text(folder, n).splitlines() for n in ("before", "after")
    )
    expected = [value for _, _, value in LEFT_BEHIND.values()]
    assert dict(zip(LEFT_BEHIND, found, strict=True)) == dict(
        zip(LEFT_BEHIND, expected, strict=True)
    )
    assert not set(zip(LEFT_BEHIND, changed, strict=True)) & set(
        zip(LEFT_BEHIND, found, strict=True)
    )
    assert not set(eval(before)) & set(eval(after))  # random numbers, of both generators


@pytest.mark.slow
def test_memory_that_a_script_freed_is_used_again(tmp_path):
    """Ten times five arrays of 20 MiB: the kernel hands out the pages of five, not of fifty."""
    work = """
        import resource
        before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
        for _ in range(10):
            arrays = [bytearray(b"1") * (20 << 20) for _ in range(5)]
            del arrays
        faults = resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before
        open(snakemake.output[0], "w").write(str(faults * resource.getpagesize() >> 20))
        """
    folder = write(tmp_path / "w", RULE.format(name="work", retries=0), work=work)
    assert snakemake(folder, "out/work.txt").status == 0
    assert int(text(folder, "work")) < 150
    assert snakemake(folder, "out/work.txt", "--forceall", executor="local").status == 0
    assert int(text(folder, "work")) > 800


def parent_of_script() -> str:
    return """
        import pathlib, psutil
        pathlib.Path(snakemake.output[0]).write_text(" ".join(psutil.Process().parent().cmdline()))
        """


# Lines of a rule, and whether its script is forked.
RULES = {
    "plain": ("", True),
    "folder": ("resources: tmpdir='elsewhere'", True),
    "threads": ("threads: 2", False),
    "shadow": ("shadow: 'minimal'", False),
    "grouped": ("group: 'one'", True),  # the local executor runs the jobs of a group one by one
}


@pytest.mark.slow
def test_which_scripts_are_forked(tmp_path):
    rules = [
        f'rule {name}:\n    output: "out/{name}.txt"\n    {lines}\n    script: "scripts/one.py"\n'
        for name, (lines, _) in RULES.items()
    ]
    folder = write(tmp_path / "w", "".join(rules), one=parent_of_script())
    run = snakemake(folder, *[f"out/{name}.txt" for name in RULES], cores=2)
    assert run.status == 0, run.said
    forked = {name: "server.py" in text(folder, name) for name in RULES}
    assert forked == {name: expected for name, (_, expected) in RULES.items()}


@pytest.mark.slow
def test_a_prefix_of_all_commands_is_heeded(tmp_path):
    rule = 'shell.prefix("export SET=1; ")\nrule one:\n    output: "out/one.txt"\n'
    look = "import os; open(snakemake.output[0], 'w').write(os.environ['SET'])"
    folder = write(tmp_path / "w", rule + '    script: "scripts/one.py"\n', one=look)
    assert snakemake(folder, "out/one.txt").status == 0


@pytest.mark.slow
def test_a_run_of_few_scripts_needs_no_server(tmp_path):
    folder = write(tmp_path / "w", RULE.format(name="one", retries=0), one=parent_of_script())
    assert snakemake(folder, "out/one.txt", "--warm-least-scripts", "2").status == 0
    assert "server.py" not in text(folder, "one")


@pytest.mark.slow
def test_changed_code_is_seen_by_the_next_run_and_within_one(tmp_path):
    """`before` rewrites a module that was imported beforehand; `after` has to use the new one."""
    change = """
        import helper, pathlib
        pathlib.Path(snakemake.output[0]).write_text(helper.SAID)
        pathlib.Path(helper.__file__).write_text("SAID = 'changed within'")
        """
    use = "import helper; open(snakemake.output[0], 'w').write(helper.SAID)"
    folder = write(tmp_path / "w", STATE, before=change, after=use, helper="SAID = 'first'")
    run = snakemake(folder, "--warm-preload", "helper")
    assert (text(folder, "before"), text(folder, "after")) == ("first", "changed within")
    assert "helper.py was changed during this run" in run.said
    (folder / "scripts/helper.py").write_text("SAID = 'changed between two runs'")
    assert snakemake(folder, "-R", "after", "--warm-preload", "helper").status == 0
    assert text(folder, "after") == "changed between two runs"


@pytest.mark.slow
def test_a_module_that_starts_a_thread_is_not_forked(tmp_path):
    thread = (
        "import threading, time; threading.Thread(target=time.sleep, args=[9], name='N').start()"
    )
    folder = write(
        tmp_path / "w", RULE.format(name="one", retries=0), one=parent_of_script(), threaded=thread
    )
    run = snakemake(folder, "out/one.txt", "--warm-preload", "threaded")
    assert run.status == 0
    assert "importing their packages started N" in run.said
    assert "server.py" not in text(folder, "one")


def test_a_module_that_cannot_be_imported_is_named(tmp_path):
    folder = write(tmp_path / "w", RULE.format(name="one", retries=0), one=parent_of_script())
    run = snakemake(folder, "out/one.txt", "--warm-preload", "nowhere")
    assert "nowhere is not imported beforehand: ModuleNotFoundError" in run.said
    assert "server.py" in text(folder, "one")


@pytest.mark.slow
def test_a_killed_server_takes_its_scripts_along(tmp_path):
    """The script that kills it fails; tried again, it runs without."""
    kill = """
        import os, pathlib, psutil, time
        if "server.py" in " ".join(psutil.Process().parent().cmdline()):
            os.kill(os.getppid(), 9)
            time.sleep(60)
        pathlib.Path(snakemake.output[0]).touch()
        """
    folder = write(tmp_path / "w", RULE.format(name="one", retries=1), one=kill)
    start = time.monotonic()
    run = snakemake(folder, "out/one.txt")
    assert run.status == 0, run.said
    assert "died with <Signals.SIGKILL: 9>" in run.said
    assert "scripts start in new interpreters from now on" in run.said
    assert time.monotonic() < start + 55


SLOW = """
    import os, signal, sys, time
    signal.signal(signal.SIGTERM, {handler})
    output = open(snakemake.output[0], "w")
    open("started", "w").close()
    time.sleep(120)
    """


def start(folder) -> subprocess.Popen:
    """A run whose script `slow` has begun, in a session of its own as a terminal gives it."""
    session = subprocess.Popen(
        command("warm", "out/slow.txt"),
        cwd=folder,
        env=environment(folder),
        start_new_session=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        # Tests that a shell started in the background ignore the interrupt, as a terminal's do not.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    wait_until((folder / "started").exists)
    return session


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "handler"),
    [
        (signal.SIGINT, "signal.SIG_DFL"),
        (signal.SIGINT, "signal.SIG_IGN"),
        (signal.SIGKILL, "signal.SIG_IGN"),
    ],
    ids=["cancelled", "cancelled, and the script does not listen", "killed"],
)
def test_nothing_is_left_of_a_run_that_is_ended(tmp_path, number, handler):
    slow = SLOW.format(handler=handler)
    folder = write(tmp_path / "w", RULE.format(name="slow", retries=0), slow=slow)
    session = start(folder)
    processes = psutil.Process(session.pid).children(recursive=True)
    assert len(processes) == 2  # the server and the script
    session.send_signal(number)
    assert session.wait(timeout=60) != 0
    wait_until(lambda: not any(process.is_running() for process in processes))
    again = snakemake(folder, "out/slow.txt", "-n", "--rerun-incomplete")
    assert "slow" in again.said  # what it left counts as unfinished


def wait_until(fulfilled, second=60.0):
    end = time.monotonic() + second
    while not fulfilled():
        assert time.monotonic() < end
        time.sleep(0.05)


@pytest.mark.slow
def test_the_keyboards_interrupt_reaches_the_script(tmp_path):
    """A terminal sends it to the whole group: to Snakemake, the server and the script."""
    slow = """
        import time
        try:
            open("started", "w").close()
            time.sleep(120)
        except KeyboardInterrupt:
            open("cleaned_up", "w").close()
        """
    folder = write(tmp_path / "w", RULE.format(name="slow", retries=0), slow=slow)
    session = start(folder)
    os.killpg(session.pid, signal.SIGINT)
    assert session.wait(timeout=60) != 0
    assert (folder / "cleaned_up").exists()


@pytest.mark.slow
class TestWorkflowsOfTheInterface(TestWorkflowsLocalStorageBase):
    """Snakemake's own tests of an executor: shell commands, groups, folders, threads."""

    __test__ = True

    def get_executor(self):
        return "warm"

    def get_executor_settings(self):
        return ExecutorSettings()
