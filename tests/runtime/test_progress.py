"""The line of progress and the last lines of a run."""

import csv
import io
import logging
from types import SimpleNamespace

import pytest
from snakemake_interface_logger_plugins.common import LogEvent

import snakemake_logger_plugin_progress as progress
from runtime import run_end
from runtime.job_requests import Cost


def job(rule, **wildcards):
    return SimpleNamespace(rule=SimpleNamespace(name=rule), wildcards_dict=wildcards)


COSTS = {"short": Cost("", 1.0, 1.0, 100.0), "long": Cost("", 9.0, 9.0, 100.0)}
PLANNED = [job("short", cell="A", test="t"), job("long", cell="A"), job("long", cell="B")]


def jobs_at(times):
    jobs = progress.Jobs(now=lambda: times["now"])
    jobs.plan(PLANNED, COSTS)
    return jobs


def test_time_left_is_the_cost_ahead_at_the_pace_so_far():
    """19 s of work were measured; a job of 1 s took 2 s, so 18 s will take 36 s on one core."""
    times = {"now": 100.0}
    jobs = jobs_at(times)
    assert jobs.second_left() is None
    jobs.start(1, "short", {"cell": "A"})
    times["now"] = 102.0
    jobs.finish(1)
    assert jobs.second_left() == pytest.approx(36.0)


def test_a_job_that_takes_longer_than_it_was_measured_does_not_double_what_is_left():
    """9 s were measured of a job that runs for 90: the time left goes down by what has passed."""
    times = {"now": 0.0}
    jobs = jobs_at(times)
    jobs.start(1, "short", {"cell": "A"})
    times["now"] = 1.0
    jobs.finish(1)
    jobs.start(2, "long", {"cell": "A"})
    left = []
    for now in (5.0, 10.0, 40.0, 91.0):
        times["now"] = now
        left.append(jobs.second_left())
    assert left[0] == pytest.approx(14.0)
    jobs.finish(2)
    assert jobs.second_left() == pytest.approx(90.0), "the other one takes what this one took"
    jobs.start(3, "long", {"cell": "B"})
    for passed in (30.0, 60.0):
        times["now"] = 91.0 + passed
        assert jobs.second_left() == pytest.approx(90.0 - passed)


def test_the_longest_running_job_ends_last():
    """Two cores were busy; the last job has one for itself."""
    times = {"now": 0.0}
    jobs = jobs_at(times)
    for number, (rule, cell) in enumerate([("long", "A"), ("long", "B")]):
        jobs.start(number, rule, {"cell": cell})
    times["now"] = 9.0
    jobs.finish(0)
    jobs.finish(1)
    jobs.start(2, "short", {"cell": "A"})
    assert jobs.second_left() == pytest.approx(1.0)


def test_a_cell_has_ended_though_its_figures_are_not_drawn():
    jobs = progress.Jobs(now=lambda: 0.0)
    jobs.plan([job("long", cell="A"), job("short", owner="A")], COSTS)
    jobs.start(1, "long", {"cell": "A"})
    jobs.finish(1)
    assert "1 of 1 cells" in jobs.line()


def test_a_cell_is_finished_with_its_last_job():
    times = {"now": 0.0}
    jobs = jobs_at(times)
    for number, (rule, cell) in enumerate([("short", "A"), ("long", "A"), ("long", "B")]):
        jobs.start(number, rule, {"cell": cell})
    times["now"] = 125.0
    assert "0 of 2 cells" in jobs.line()
    assert "longest running: short of A, 2 min" in jobs.line()
    jobs.finish(0)
    jobs.finish(1)
    assert jobs.line().startswith("2 of 3 jobs · 1 of 2 cells")


def test_a_job_that_is_tried_again_counts_once():
    jobs = jobs_at({"now": 0.0})
    jobs.start(1, "short", {"cell": "A"})
    jobs.start(1, "short", {"cell": "A"})
    assert jobs.waiting["short"] == 0


def handler(monkeypatch, **asked):
    """A handler of a run that is not on a terminal, and what it writes."""
    written = io.StringIO()
    monkeypatch.setattr("sys.stderr", written)
    quiet = {"dryrun": False, "verbose": False, "debug_dag": False, "printshellcmds": False}
    common = SimpleNamespace(**quiet | {"quiet": {"reason"}, "stdout": False} | asked)
    made = progress.LogHandler(common, None)
    made.setFormatter(logging.Formatter("%(message)s"))
    return made, written


def record(message, level=logging.INFO, **extra):
    made = logging.LogRecord("snakemake", level, "", 0, message, (), None)
    vars(made).update(extra)
    return made


def test_noise_is_left_out_and_warnings_and_unknown_messages_come_through(monkeypatch):
    shown, written = handler(monkeypatch)
    shown.emit(record("Select jobs to execute..."))
    shown.emit(record("job info", event=LogEvent.JOB_INFO, jobid=7, rule_name="r", wildcards={}))
    shown.emit(record("Nothing to be done (all requested files are present and up to date)."))
    shown.emit(record("Error in rule r", logging.ERROR, event=LogEvent.JOB_ERROR))
    shown.close()
    said = written.getvalue().splitlines()
    assert [line.split()[0] for line in said] == ["Nothing", "Error"]


ROW = {"cell": "A", "capacity_ampere_hour": "2.5", "soh": "0.9", "best_model": "2RC"}


def write(path, rows):
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path, "w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


def test_the_end_names_the_report_exclusions_failed_checks_and_doubts(tmp_path):
    results = tmp_path / "results"
    rows = [ROW | {"doubt": ""}, ROW | {"cell": "B", "best_model": "", "doubt": "sign"}]
    write(results / "summary.csv", rows)
    left_out = [{"cell": "B", "test": "t1", "file": "raw/b.csv", "stage": "ingest"}] * 2
    write(results / "tables/excluded.csv", left_out)
    checks = [("no cell gains charge", "failed"), ("R0 is positive", "passed")]
    write(
        results / "tables/checks.csv",
        [dict(zip(("check", "outcome"), row, strict=True)) for row in checks],
    )
    (told,) = run_end.lines(tmp_path, {}, 0.0)
    assert "excluded.csv" in told, "a part of the run leaves out files in silence"
    (results / "report.html").write_text("")
    said = "\n".join(run_end.lines(tmp_path, run_end.read(tmp_path), 0.0))
    wanted = ("results/report.html", "2, 1 with a model", "doubts about B", "2 (results/tables")
    for words in (*wanted, "B t1", "1 of 2 failed", "no cell gains charge"):
        assert words in said


@pytest.mark.parametrize(
    "foreign", [b"name,value\nA,2\n", b"cell\n", b"\xff\xfe\0", b"", b"cell,soh\nA,good\nB\n"]
)
def test_a_summary_of_another_program_costs_no_run(tmp_path, foreign):
    (tmp_path / "results").mkdir()
    summary = tmp_path / "results/summary.csv"
    summary.write_bytes(foreign)
    before = run_end.read(tmp_path)
    write(summary, [ROW])
    (tmp_path / "results/report.html").write_text("")
    said = "\n".join(run_end.lines(tmp_path, before, 0.0))
    changed = (
        "state of health 'good' → 90 %" if b"good" in foreign else "first run of this campaign"
    )
    assert changed in said


def test_files_that_changed_in_the_run_are_named_at_its_end(tmp_path):
    assert "raw/a.csv" not in "".join(run_end.lines(tmp_path, {}, 0.0))
    said = run_end.lines(tmp_path, {}, 0.0, ["raw/a.csv"])[-1]
    assert said.startswith("Files:    raw/a.csv changed while the run went on")
