"""The report: exclusions on top, a page per cell and group, nothing that is not escaped."""

import base64
from pathlib import Path
from types import SimpleNamespace

import pandas as pd
import pytest

from cellwright.refusal import Refusal
from runtime import artefact, page

ROOT = Path(__file__).resolve().parents[2]
TABLES = ["capacity", "ica", "eis", "temperature", "choice", "validation", "soc", "packs"]
TABLES += ["missing_effect", "excluded"]
CELL = {"cell": "A", "chemistry": "NMC", "note": None}
TEST = {
    "cell": "A",
    "test": "bad",
    "kind": "capacity",
    "ambient_temperature_celsius": 0.0,
    "cycle": None,
    "soc": None,
    "role": "fit",
    "note": "<b>odd</b>",
}


VERDICT = {
    "cell": "A",
    "verdict": "ambiguous",
    "effect": "slow_diffusion",
    "alternatives": "leakage;current_offset",
    "validation_before_volt": 0.004214,
    "validation_after_volt": 0.000987,
    "gap_closed": 0.973,
    "floor_volt": 0.0008,
    "sure": False,
    "doubts": "another explains it as well",
    "in_one_line": "shows slow diffusion",
}
WITNESS = {"name": "relaxations", "effect": "slow_diffusion", "named": True, "says": "silent"}
WITNESS |= {
    "measured": 0.0,
    "implied": 0.0,
    "unit": "Ohm",
    "std": 0.0,
    "shown": False,
    "text": "no long rest",
}
HEARD = WITNESS | {"name": "pulses", "effect": "resistance_soc", "named": False}
HEARD |= {"says": "contradicts", "text": "not named, although < 3"}


def write_witnesses(snakemake):
    """Witnesses of cell A, and of cell B the reason why there is no verdict."""
    paths = [f"results/missing_effect/{cell}/witnesses.parquet" for cell in "AB"]
    with artefact.Job(snakemake(paths[0], wildcards={"cell": "A"})) as writing:
        writing.save([WITNESS, HEARD])
    with artefact.Job(snakemake(paths[1], wildcards={"cell": "B"})):
        raise Refusal("no validation test")
    return paths


def write_verdicts(snakemake):
    """A verdict of cell A, and of cell B the reason why there is none."""
    paths = [f"results/missing_effect/{cell}/verdict.json" for cell in "AB"]
    with artefact.Job(snakemake(paths[0], wildcards={"cell": "A"})) as writing:
        writing.save({"cell": "A", "paragraph": "What was missing: time & patience."})
    with artefact.Job(snakemake(paths[1], wildcards={"cell": "B"})):
        raise Refusal("no validation test")
    return paths


def write_cold(snakemake):
    """What limits cell A in the cold, and of cell B why that is not known."""
    paths = [f"results/cold_limit/{cell}.json" for cell in "AB"]
    with artefact.Job(snakemake(paths[0], wildcards={"cell": "A"})) as writing:
        writing.save({"paragraph": "Limited by charge transfer & age."})
    with artefact.Job(snakemake(paths[1], wildcards={"cell": "B"})):
        raise Refusal("neither spectra nor pulses")
    return paths


@pytest.fixture
def job(snakemake):
    """The inputs of rule `report` for one cell with a good and a bad test, and one group."""
    contents = dict.fromkeys(TABLES, ())
    capacity = {
        "cell": "A",
        "test": "good",
        "direction": "discharge",
        "capacity_ampere_hour": 1.987654321,
    }
    contents["capacity"] = [capacity] * 70
    contents["excluded"] = [
        {
            "cell": "A",
            "test": "bad",
            "file": "raw/bad.csv",
            "stage": "ingest",
            "reason": "time & <i>space</i>",
        }
    ]
    contents["packs"] = [
        {"group": "pair", "branch": 1, "cell": "A", "current_rmse_ampere": 0.0123456}
    ]
    contents["checks"] = [
        {"check": "No charge from nothing.", "outcome": "failed", "found": "A: 3 Ah"}
    ]
    contents["missing_effect"] = [VERDICT]
    at = {"ambient_temperature_celsius": 25.0, "blocks": 9, "typical_volt": 0.001}
    at |= {"cell": "A", "worst_volt": 0.03, "fit_rmse_volt": 0.00234}
    contents["choice"] = [
        at | {"model": "2RC", "left_out_rmse_volt": 0.0123, "chosen": True, "reason": "2RC chosen"},
        at | {"model": "1RC", "left_out_rmse_volt": 0.0456, "chosen": False, "reason": "far & off"},
    ]
    paths = {}
    for name, rows in contents.items():
        paths[name] = f"results/tables/{name}.csv"
        with artefact.Job(snakemake(paths[name])) as writing:
            writing.save(list(rows))
    with artefact.Job(snakemake("results/summary.csv")) as writing:
        writing.save([{"cell": "A", "soh": 0.987654321, "notes": "as new"}])
    for test in ("good", "bad"):
        with artefact.Job(
            snakemake(f"results/ingest/A/{test}.parquet", wildcards={"cell": "A", "test": test})
        ) as writing:
            writing.note("sign found from the data")
            if test == "bad":
                raise Refusal("time & <i>space</i>")
            writing.save(
                {"test_time_second": [0.0], "current_ampere": [0.0], "voltage_volt": [3.7]}
            )
    verdicts = write_verdicts(snakemake)
    Path("results/figures/A").mkdir(parents=True)
    Path("results/figures/A/validation_udds.svg").write_text("<svg>picture</svg>")
    inputs = SimpleNamespace(
        tables=[paths[name] for name in TABLES],
        checks=paths["checks"],
        summary="results/summary.csv",
        artefacts=["results/ingest/A/good.parquet", "results/ingest/A/bad.parquet"],
        verdicts=verdicts,
        witnesses=write_witnesses(snakemake),
        cold=write_cold(snakemake),
        template=ROOT / "workflow/report/report.html.j2",
        captions=ROOT / "workflow/report/captions.yaml",
    )
    params = SimpleNamespace(
        cells=[CELL],
        tests=[TEST, TEST | {"test": "good", "note": None}],
        groups=[{"group": "pair", "position": 1, "cell": "A"}],
        figures={"campaign": [], "A": ["results/figures/A/validation_udds.svg"]},
        modelled=["A"],
        title="Tiny & small",
        choices={"strict": True},
        assumptions=[{"module": "m.py", "text": "Cells are round."}],
    )
    return SimpleNamespace(input=inputs, params=params)


def test_report_holds_everything_escaped_and_in_order(job):
    html = page.render(job)
    assert html == page.render(job)
    wanted = ["1 exclusion: what could not be used", "time &amp; &lt;i&gt;space", "raw/bad.csv"]
    wanted += ["1 of 1 checks of the results failed", "No charge from nothing.", "0.9877"]
    wanted += ['<section id="cell-A">', "&lt;b&gt;odd&lt;/b&gt;", "1.988", "and 10 more rows"]
    wanted += ['<section id="cell-pair">', "branch 1: A", "0.01235", "Cells are round.", "strict"]
    places = [html.find(text) for text in wanted]
    assert -1 not in places, dict(zip(wanted, places, strict=True))
    assert places == sorted(places)
    assert "Tiny &amp; small" in html
    assert "<i>space" not in html


def test_a_page_begins_with_the_verdict_its_reading_and_its_proof(job):
    job.params.cells = [CELL, CELL | {"cell": "B"}]
    proof = Path("results/figures/A/effect_map.svg")
    proof.write_text("<svg>map</svg>")
    job.params.figures["A"].append(str(proof))
    html = page.render(job)
    wanted = ['<section id="cell-A">', "A shows slow diffusion.", "<strong>ambiguous</strong>"]
    wanted += ["unsure: another explains it as well", "leakage, current offset", "4.21 → 0.99"]
    wanted += [
        "time &amp; patience",
        "What other measurements say of it",
        "resistance soc (not named)",
    ]
    wanted += ["contradicts</strong>", "although &lt; 3", "relaxations", "no long rest"]
    wanted += ["Where the model errs", "<h2>Tests</h2>", "Model over measurement: udds"]
    wanted += ['<section id="cell-B">', "No verdict: no validation test"]
    places = [html.find(text) for text in wanted]
    assert -1 not in places, dict(zip(wanted, places, strict=True))
    assert places == sorted(places)


def test_what_limits_in_the_cold_stands_beside_the_plots(job):
    job.params.cells = [CELL, CELL | {"cell": "B"}]
    html = page.render(job)
    wanted = ["<h2>What limits it in the cold</h2>", "charge transfer &amp; age"]
    wanted += ["Model over measurement: udds", '<section id="cell-B">', "Not known: neither"]
    places = [html.find(text) for text in wanted]
    assert -1 not in places, dict(zip(wanted, places, strict=True))
    assert places == sorted(places)


def test_every_member_says_why_it_is_the_chosen_one_or_not(job):
    html = page.render(job)
    wanted = ["<h2>Why this model</h2>", "<th>25 °C</th>", "<strong>2RC</strong>"]
    wanted += ["12.30 (2.34)", "2RC chosen", "45.60 (2.34)", "far &amp; off"]
    places = [html.find(text) for text in wanted]
    assert -1 not in places, dict(zip(wanted, places, strict=True))
    assert places == sorted(places)


def test_report_is_one_file_with_its_pictures_inside(job):
    html = page.render(job)
    picture = base64.b64encode(b"<svg>picture</svg>").decode()
    assert f"data:image/svg+xml;base64,{picture}" in html
    assert "http://" not in html
    assert "https://" not in html


def test_a_bad_test_shows_its_reason_and_a_note_its_tests(job):
    abouts = {path: artefact.read_about(path) for path in job.input.artefacts}
    columns = ["cell", "group", "model", "ambient_temperature_celsius"]
    tables = {name: pd.DataFrame(columns=columns, dtype=str) for name in TABLES}
    found = page._page("A", job.params, tables, abouts, {"validation": {"title": "V", "read": "r"}})
    assert [row["reasons"] for row in found["tests"]] == [["time & <i>space</i>"], []]
    assert found["notes"] == [{"text": "sign found from the data", "tests": ["bad", "good"]}]
    assert found["facts"] == {"cell": "A", "chemistry": "NMC"}
    (picture,) = found["pictures"]
    assert (picture["title"], picture["test"]) == ("V", "udds")
    assert found["tables"] == {}


@pytest.mark.parametrize(
    ("text", "shown"), [("1.23456789", "1.235"), ("", ""), (None, None), ("1RC", "1RC"), (2, "2")]
)
def test_numbers_have_four_digits(text, shown):
    assert page.number(text) == shown


def test_a_cell_without_a_model_is_told_what_it_lacks(job):
    assert "No model, and no simulation" not in page.render(job)
    job.params.modelled = []
    assert "No model, and no simulation: that needs an hppc test" in page.render(job)
