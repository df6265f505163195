"""What whole runs are measured with: each second of CPU once, at the work that it was spent on."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = """
import sys
import time

from figures import style
from runtime import artefact

def spend(second, call):
    end = time.process_time() + second
    while time.process_time() < end:
        call()

spend(0.6 * float(sys.argv[1]), lambda: style.evenly_spread(100_000, 50))
spend(0.3 * float(sys.argv[1]), lambda: artefact.plain({"numbers": list(range(2000))}))
"""


@pytest.fixture
def measured(tmp_path):
    """Record of a script, run as Snakemake runs one."""
    return recorded(tmp_path / "busy", 1)


@pytest.fixture
def idle(tmp_path):
    """As `measured`, of a script that imports the same and spends nothing."""
    return recorded(tmp_path / "idle", 0)


def recorded(folder, share):
    """Record of `SCRIPT` that spends this share of its seconds."""
    scripts, records = folder / ".snakemake" / "scripts", folder / "records"
    scripts.mkdir(parents=True)
    records.mkdir()
    script = scripts / "tmp1234.capacity.py"
    script.write_text(SCRIPT, encoding="utf-8")
    paths = [ROOT / "benchmarks" / "sampled", ROOT / "scripts"]
    variables = {"PYTHONPATH": os.pathsep.join(map(str, paths)), "WHOLE_RUN_RECORDS": str(records)}
    command = [sys.executable, str(script), str(share)]
    subprocess.run(command, env=os.environ | variables, check=True)
    (record,) = records.iterdir()
    return json.loads(record.read_text(encoding="utf-8"))


@pytest.mark.slow
def test_a_script_is_named_by_its_rule_and_its_seconds_add_up(measured, idle):
    assert (measured["process"], measured["name"]) == ("script", "capacity")
    assert measured["memory_megabyte"] > 20
    seconds = measured["seconds"]
    assert sum(seconds.values()) == pytest.approx(measured["cpu_second"], rel=0.1, abs=0.05)
    # What the imports of its own modules cost counts with a part: it is no work of the script.
    # Where other processes ran, some of it is counted late.
    imported = idle["seconds"]
    spent = {part: seconds[part] - imported.get(part, 0.0) for part in ("figures", "files")}
    assert spent == pytest.approx({"figures": 0.6, "files": 0.3}, abs=0.25)
    assert seconds["import"] > 0.05
    assert seconds.get("numerics", 0.0) < 0.1


def test_other_processes_of_a_measured_run_leave_no_record(tmp_path):
    paths = [ROOT / "benchmarks" / "sampled", ROOT / "scripts"]
    variables = {"PYTHONPATH": os.pathsep.join(map(str, paths)), "WHOLE_RUN_RECORDS": str(tmp_path)}
    subprocess.run([sys.executable, "-c", "1"], env=os.environ | variables, check=True)
    assert not list(tmp_path.iterdir())


def test_the_parts_of_a_run_are_its_whole(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    from whole_run_page import KINDS, parts

    script = {"process": "script", "cpu_second": 3.0} | dict.fromkeys(KINDS, 0.0)
    rules = {
        "identify": script | {"numerics": 2.0, "import": 0.5},
        "imports": {"process": "server", "cpu_second": 2.5},
        "Snakemake itself": {"process": "snakemake", "cpu_second": 4.0},
    }
    found = parts({"rules": rules})
    assert found["numerics"] == 2.0
    assert found["other"] == 0.5
    assert (found["server"], found["snakemake"]) == (2.5, 4.0)
    assert sum(found.values()) == 9.5
