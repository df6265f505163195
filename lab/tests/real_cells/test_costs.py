"""What rules cost, held against a record: what counts as more, and what jobs ask for by it."""

import csv
import os
import subprocess
import sys

import pytest

from real_cells import calibration, costs
from real_cells.campaigns import ROOT
from real_cells.costs import Cost
from runtime import job_requests

OLD = {"search": Cost(6, 60.0, 30.0, 500.0), "capacity": Cost(20, 0.4, 0.05, 90.0)}


def of_search(**changes):
    return costs.compare(OLD, {"search": OLD["search"]._replace(**changes)})


def test_jobs_are_summed_by_rule_in_units_of_the_calibration():
    jobs = [("search", 2.0, 300.0), ("search", 1.0, 400.0), ("capacity", 0.25, 90.0)]
    found = costs.of_jobs(jobs, 0.5)
    assert list(found) == ["capacity", "search"]
    assert found["search"] == Cost(2, 6.0, 4.0, 400.0)
    assert found["capacity"] == Cost(1, 0.5, 0.5, 90.0)
    assert costs.of_jobs([], 0.5) == {}


@pytest.mark.parametrize(
    ("changes", "more", "other"),
    [
        ({}, "", ""),
        ({"cpu_units": 75.0}, "", ""),
        ({"cpu_units": 77.0}, "CPU in units of the calibration: recorded 60, found 77", ""),
        ({"cpu_units": 40.0}, "", "cheaper"),
        ({"peak_megabyte": 670.0}, "", ""),
        ({"peak_megabyte": 680.0}, "peak memory in MB: recorded 500, found 680", ""),
        ({"peak_megabyte": 300.0}, "", "cheaper"),
        ({"jobs": 3, "cpu_units": 500.0}, "", ""),  # not all were to be made anew
        ({"jobs": 12, "cpu_units": 125.0}, "", ""),  # twice as many, for twice as much
    ],
)
def test_a_rule_may_cost_a_quarter_more_than_recorded(changes, more, other):
    found = of_search(**changes)
    for lines, wanted in zip(found, (more, other), strict=True):
        assert len(lines) == bool(wanted)
        assert all(wanted in line and line.startswith("search") for line in lines)


@pytest.mark.parametrize(("slower", "dear"), [(1.4, 1), (1.6, 12)])
def test_a_rule_is_held_against_the_others_of_its_run(slower, dear):
    """On a machine 1.4 times slower than its calibration says one rule of twelve doubles."""
    rules = [f"rule_{k}" for k in range(12)]
    old = {rule: Cost(1, 10.0, 10.0, 100.0) for rule in rules}
    new = {rule: Cost(1, 10.0 * slower, 10.0, 100.0) for rule in rules}
    new["rule_3"] = Cost(1, 20.0 * slower, 20.0, 100.0)
    more, _ = costs.compare(old, new)
    assert len(more) == dear
    assert any(line.startswith("rule_3") for line in more)


def test_rules_of_milliseconds_may_vary_and_new_ones_are_told():
    dear = {"capacity": OLD["capacity"]._replace(cpu_units=1.4), "new": Cost(1, 9.0, 9.0, 99.0)}
    assert costs.compare(OLD, dear) == ([], ["new: not recorded yet"])


def test_what_is_written_is_read_again_but_not_of_other_code(tmp_path):
    path = tmp_path / "folder" / "costs.csv"
    costs.write(OLD, path, code="abc")
    assert costs.read(path) == costs.read(path, code="abc") == OLD
    assert costs.read(path, code="other") == costs.read(tmp_path / "nowhere.csv") == {}


def test_a_record_is_renewed_by_whole_runs_alone():
    part, whole = Cost(3, 9.0, 4.0, 100.0), Cost(20, 0.3, 0.04, 80.0)
    found = costs.renewed(OLD, {"search": part, "capacity": whole, "new": part})
    assert found == {"search": OLD["search"], "capacity": whole, "new": part}
    assert OLD["search"].or_more(Cost(9, 1.0, 50.0, 100.0)) == Cost(9, 60.0, 50.0, 500.0)


def test_jobs_ask_a_cluster_for_what_was_recorded(tmp_path):
    path = tmp_path / "job_costs.csv"
    head = "rule,part,jobs,cpu_second,longest_cpu_second,peak_megabyte"
    path.write_text(f"{head}\nother,models,1,0.5,0.5,85\nsearch,validation,1,2.0,2.0,99\n")
    costs.write_requests(OLD, path)
    rows = {row["rule"]: row for row in csv.DictReader(path.read_text().splitlines())}
    assert list(rows) == ["capacity", "other", "search"]
    assert list(rows["search"].values()) == ["search", "validation", "6", "30.0", "15.0", "500"]
    assert list(rows["other"].values()) == ["other", "models", "1", "0.5", "0.5", "85"]
    asked = job_requests.read(path)
    assert asked["capacity"].longest_cpu_second == 0.1  # of less than is told
    assert job_requests.requests(asked["search"])["mem_mb"](None, 1) == 1000


def test_the_record_of_the_demo_is_what_jobs_ask_for():
    rules = job_requests.read(costs.REQUESTED)
    for rule, cost in costs.read(costs.RECORDED).items():
        assert rules[rule].peak_megabyte == pytest.approx(cost.peak_megabyte, abs=1.0), rule


def test_the_calibration_is_the_geometric_mean_of_its_parts(monkeypatch):
    times = iter([0.8, 0.1, 0.1])
    monkeypatch.setattr(calibration, "_cpu_second", lambda _work: next(times))
    monkeypatch.setattr(calibration, "SIZE", 2)
    monkeypatch.setattr(calibration, "SAMPLES", 2)
    assert calibration.calibration_second() == pytest.approx(0.2)


def test_the_calibrations_load_takes_time(monkeypatch):
    for name, few in {"SIZE": 60, "SAMPLES": 2000, "STEPS": 20_000}.items():
        monkeypatch.setattr(calibration, name, few)
    assert 0 < calibration.calibration_second() < 1.0


@pytest.mark.slow
@pytest.mark.parametrize("executor", ["local", "warm"])
def test_every_script_of_a_run_is_measured(tmp_path, executor):
    """Of either executor, in a run of which one job fails."""
    (tmp_path / "work.py").write_text(
        "from time import process_time\n"
        "held = bytearray(300_000_000)\n"
        "while process_time() < 0.5: pass\n"
        "assert snakemake.wildcards.name != 'bad'\n"
        "open(snakemake.output[0], 'w').close()\n"
    )
    (tmp_path / "Snakefile").write_text(
        "rule all:\n    input: 'a.txt', 'b.txt', 'bad.txt'\n"
        "rule work:\n    output: '{name}.txt'\n    script: 'work.py'\n"
    )
    tool = [sys.executable, str(ROOT / "lab" / "tools" / "job_costs.py"), "costs.csv"]
    options = ["--cores", "1", "--executor", executor, "--keep-going", "--quiet", "all"]
    plugin = ROOT / "plugins" / "snakemake-executor-plugin-warm"
    paths = os.pathsep.join(map(str, (ROOT / "scripts", ROOT / "lab", plugin)))
    environment = {k: v for k, v in os.environ.items() if k != "SNAKEMAKE_PROFILE"}
    environment |= {"PYTHONPATH": paths}
    ran = subprocess.run(
        [*tool, *options], cwd=tmp_path, env=environment, capture_output=True, text=True
    )
    assert ran.returncode == 1, ran.stderr
    assert "3 jobs" in ran.stdout
    (found,) = csv.DictReader((tmp_path / "costs.csv").read_text().splitlines())
    assert (found["rule"], found["jobs"]) == ("work", "3")
    assert 300 < float(found["peak_megabyte"]) < 600
    assert float(found["cpu_units"]) > 1.2 * float(found["longest_cpu_units"]) > 0
