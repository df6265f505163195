"""The report: exclusions on top, a page per cell and group, nothing that is not escaped."""

import base64
import gzip
import html as html_module
import itertools
import re
import shutil
import subprocess
from pathlib import Path
from types import SimpleNamespace
from urllib.parse import unquote

import numpy as np
import pandas as pd
import pytest
from report_text import PACKED, unpacked

from cellwright.refusal import Refusal
from runtime import artefact, page

ROOT = Path(__file__).resolve().parents[2]
TABLES = ["capacity", "ica", "eis", "temperature", "choice", "validation", "soc", "packs"]
TABLES += ["pack_findings", "pack_checks", "series_packs", "nested_packs"]
TABLES += ["missing_effect", "fleet", "health", "fade", "excluded"]
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


# As the drawing of a figure writes it: a head, provenance, and the drawing.
PICTURE = """<?xml version="1.0"?>
<svg xmlns="http://www.w3.org/2000/svg"><metadata>%s</metadata>
<path fill="#0b6fb8" d="M0 0l5 5"/><text>97 %% &amp; more</text></svg>
""" % ("ab" * 32)


@pytest.fixture
def job(snakemake, saved):
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
        {"group": "pair", "test": "c10", "branch": 1, "cell": "A", "current_rmse_ampere": 0.0123456}
    ]
    contents["pack_checks"] = [
        {"group": "pair", "test": "c10", "found": True, "sentence": "branch 2 < branch 1 & turned"}
    ]
    contents["checks"] = [
        {"check": "No charge from nothing.", "outcome": "failed"}
        | {"cell": "A", "test": "bad", "found": "<3 Ah"}
    ]
    contents["missing_effect"] = [VERDICT]
    kind = {"type": "NMC, 5 Ah", "sentence": "A alone shows self-discharge"}
    shown = {"A": ("sure", 0.00312), "B": ("not testable", None)}
    contents["fleet"] = [
        kind | {"cell": cell, "effect": "leakage", "shown": word, "size_volt": volt}
        for cell, (word, volt) in shown.items()
    ]
    contents["fleet"].append(
        {"type": "LFP, 2 Ah", "sentence": "none of 2 cells shows an effect", "shown": "no"}
        | dict.fromkeys(("cell", "effect", "size_volt"))
    )
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
            snakemake(
                f"results/stages/ingest/A/{test}.parquet", wildcards={"cell": "A", "test": test}
            )
        ) as writing:
            writing.note("sign found from the data")
            if test == "bad":
                raise Refusal("time & <i>space</i>")
            writing.save(
                {"test_time_second": [0.0], "current_ampere": [0.0], "voltage_volt": [3.7]}
            )
    # Of cell B there is the reason why it has none of these.
    search, no_test = "results/missing_effect/{}/", "no validation test"
    verdict = {"cell": "A", "paragraph": "What was missing: time & patience."}
    limit = {"paragraph": "Limited by charge transfer & age."}
    verdicts, heard, cold = (
        [saved(path.format("A"), content), saved(path.format("B"), reason)]
        for path, content, reason in (
            (f"{search}verdict.json", verdict, no_test),
            (f"{search}witnesses.parquet", [WITNESS, HEARD], no_test),
            ("results/stages/cold_limit/{}.json", limit, "neither spectra nor pulses"),
        )
    )
    Path("results/figures/A").mkdir(parents=True)
    Path("results/figures/A/validation_udds.svg").write_text(PICTURE)
    inputs = SimpleNamespace(
        tables=[paths[name] for name in TABLES],
        checks=paths["checks"],
        summary="results/summary.csv",
        artefacts=["results/stages/ingest/A/good.parquet", "results/stages/ingest/A/bad.parquet"],
        verdicts=verdicts,
        witnesses=heard,
        cold=cold,
        template=ROOT / "workflow/report/report.html.j2",
        page=ROOT / "workflow/report/page.html.j2",
        captions=ROOT / "workflow/report/captions.yaml",
    )
    params = SimpleNamespace(
        cells=[CELL],
        tests=[TEST, TEST | {"test": "good", "note": None}],
        groups=[{"group": "pair", "position": k, "cell": c} for k, c in ((1, "A"), (2, "B"))],
        figures={"the campaign": [], "A": ["results/figures/A/validation_udds.svg"]},
        title="Tiny & small",
        choices={"strict": True},
        assumptions=[{"module": "m.py", "text": "Cells are round."}],
    )
    return SimpleNamespace(input=inputs, params=params)


def read(html):
    """What a reader of the report sees: a line a text or row of a table, equal ones counted."""
    shown = re.sub(
        r"<(script|style)\b.*?</\1>", "", unpacked(html).partition("<body")[2], flags=re.S
    )
    shown = re.sub(r"<img\b[^>]*>", "[picture]", re.sub(r"\s+", " ", shown))
    shown = re.sub(r"</t[dh]> *(?=<t[dh])", " | ", shown)
    shown = re.sub(r"</?(strong|em|code|a|td|th|span)\b[^>]*>", "", shown)
    shown = re.sub(r"\b[0-9a-f]{64}\b", "(SHA-256)", re.sub(r"<[^>]*>", "\n", shown))
    texts = [html_module.unescape(text).strip() for text in shown.splitlines()[1:] if text.strip()]
    counted = [(text, len(list(same))) for text, same in itertools.groupby(texts)]
    return "".join(f"{text}{f'  ({n} times)' if n > 1 else ''}\n" for text, n in counted)


def test_the_report_reads_as_recorded(job, tmp_path):
    """Where the change is wanted, the text that the test has written is the new record."""
    job.params.cells = [CELL, CELL | {"cell": "B"}]
    proof = Path("results/figures/A/effect_map.svg")
    proof.write_text(PICTURE)
    job.params.figures["A"].append(str(proof))
    found = tmp_path / "report.txt"
    found.write_text(read(page.render(job)), encoding="utf-8")
    recorded = Path(__file__).with_name("report.txt")
    assert found.read_text(encoding="utf-8") == recorded.read_text(encoding="utf-8"), found


def test_what_files_and_sheets_say_is_escaped(job):
    html = unpacked(page.render(job))
    assert "time &amp; &lt;i&gt;space&lt;/i&gt;" in html
    assert "&lt;b&gt;odd&lt;/b&gt;" in html
    assert "Tiny &amp; small" in html
    assert not re.search("<i>space|<b>odd|Tiny & small", html)


def test_a_page_or_a_part_that_cannot_be_made_costs_no_other(job, monkeypatch):
    usual = page._page

    def failing(name, *arguments):
        return usual(name, *arguments) | ({} if name == "pair" else {"tests": 1 / 0})

    monkeypatch.setattr(page, "_page", failing)
    monkeypatch.setattr(page.health_page, "section", lambda tables: {}["soh"])
    html = unpacked(page.render(job))
    assert "itself failed to make the page A of this report (ZeroDivisionError" in html
    assert "itself failed to make the part on health of this report (KeyError" in html
    assert "A || B" in html, "the other page, and the part on packs"


def test_what_does_not_hold_of_a_cell_stands_on_its_page(job):
    html = unpacked(page.render(job))
    assert html.count("bad: &lt;3 Ah. ") == 1
    assert '<a href="#cell-A">A</a> bad: &lt;3 Ah' in html


def test_report_is_one_file_with_its_pictures_inside(job):
    html = unpacked(page.render(job))
    links = [html_module.unescape(link) for link in re.findall(r'(?:src|href)="([^"]*)"', html)]
    assert all(link.startswith(("#", "data:")) for link in links)
    (picture,) = [unquote(link) for link in links if link.startswith("data:image/svg+xml,")]
    drawn = '<path fill="#0b6fb8" d="M0 0l5 5"/><text>97 % &amp; more</text></svg>'
    assert picture.partition(",")[2].split("\n")[1:3] == [drawn, ""]
    assert "abababab" not in picture, "provenance stays with the file of the figure"


def test_pages_are_packed_each_in_its_section_and_the_same_bytes_every_time(job):
    html = page.render(job)
    assert html == page.render(job)
    ids = re.findall(r'<section id="([\w-]+)"><script type="application/gzip">', html)
    assert ids == ["cell-A", "cell-pair"]
    assert len(PACKED.findall(html)) == 2
    assert "97 %25" not in html
    assert "raw/bad.csv" in html, "what was excluded is read without unpacking anything"


def test_a_packed_page_has_no_time_in_it_and_is_a_tenth_of_a_drawing():
    steps = np.cumsum(np.random.default_rng(1).integers(-9, 9, 2000))
    page_text = "".join(f"<path d='M0 0l{k}-{k}'/>" for k in steps % 7)
    raw = base64.b64decode(page.packed(page_text))
    assert raw[:3] == b"\x1f\x8b\x08"
    assert raw[4:8] == bytes(4)
    assert gzip.decompress(raw).decode() == page_text
    assert len(raw) < 0.1 * len(page_text)


def test_a_bad_test_shows_its_reason_and_a_note_its_tests(job):
    abouts = {path: artefact.read_about(path) for path in job.input.artefacts}
    columns = ["cell", "group", "model", "ambient_temperature_celsius"]
    tables = {name: pd.DataFrame(columns=columns, dtype=str) for name in TABLES}
    captions = {"validation": {"title": "V", "read": "r"}}
    found = page._page("A", job.params, tables, list(abouts.values()), captions)
    assert [row["reasons"] for row in found["tests"]] == [["time & <i>space</i>"], []]
    assert found["notes"] == [{"text": "sign found from the data", "tests": ["bad", "good"]}]
    assert found["facts"] == {"cell": "A", "chemistry": "NMC"}
    (picture,) = found["pictures"]
    assert (picture["title"], picture["test"]) == ("V", "udds")
    assert found["tables"] == {}


def test_an_effect_of_a_fleet_is_told_by_its_size_or_why_it_has_none(job):
    nmc, lfp = page.fleet_of(page._text("results/tables/fleet.csv"))
    assert nmc["rows"] == [{"cell": "A", "words": ["3.1"]}, {"cell": "B", "words": ["n/t"]}]
    assert lfp["effects"] == []


@pytest.mark.parametrize(
    ("text", "shown"), [("1.23456789", "1.235"), ("", ""), (None, None), ("1RC", "1RC"), (2, "2")]
)
def test_numbers_have_four_digits(text, shown):
    assert page.number(text) == shown


def test_a_cell_without_a_model_is_told_what_it_lacks(job, snakemake):
    assert "No model" not in unpacked(page.render(job))
    asked = snakemake("results/models/A.json", wildcards={"cell": "A"})
    asked.rule = "no_model"
    with artefact.Job(asked):
        raise Refusal("no model: it has no pulses")
    job.input.artefacts.append("results/models/A.json")
    assert "No model: it has no pulses." in unpacked(page.render(job))


def seen_by_a_browser(text, folder, page_id):
    """The document as Chromium has it once its scripts have run."""
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if not browser:
        pytest.skip("no Chromium here to open the report with")
    report = folder / "report.html"
    report.write_text(text, encoding="utf-8")
    command = [browser, "--headless", "--no-sandbox", "--disable-gpu", "--dump-dom"]
    command += ["--disable-background-networking", f"--user-data-dir={folder / 'profile'}"]
    command += ["--virtual-time-budget=5000", f"file://{report}#{page_id}"]
    return subprocess.run(command, capture_output=True, text=True, check=True, timeout=120).stdout


@pytest.mark.parametrize(("page_id", "seen"), [("cell-A", 1), ("all", 1), ("overview", 0)])
def test_a_browser_unpacks_the_page_that_is_looked_at_without_a_server(
    job, tmp_path, page_id, seen
):
    shown = seen_by_a_browser(page.render(job), tmp_path, page_id)
    assert f'data-shown="{page_id}"' in shown
    assert shown.count("data:image/svg+xml,") == seen
    assert ("<h1>A</h1>" in shown) is bool(seen)
    packed = set(re.findall(r'id="cell-(\w+)"[^>]*><script', shown))
    assert packed == {"cell-A": {"pair"}, "all": set(), "overview": {"A", "pair"}}[page_id]


SMUGGLED = (
    "<script>document.body.dataset.first = 1</script>"
    "<img src=x onerror='document.body.dataset.second = 1'>"
)


def test_what_would_be_smuggled_into_the_report_does_not_run(job, tmp_path):
    """The policy holds where escaping should ever fail; the report's own script and style run."""
    text = page.render(job)
    style, script = (
        re.search(f"<{tag}>(.+?)</{tag}>", text, re.S)[1] for tag in ("style", "script")
    )
    for own in (style, script):
        assert f"-src {page.digest(own)}" in text
    assert "default-src 'none'" in text
    open_text = text.replace("<nav>", f"{SMUGGLED}<nav>")
    shown = seen_by_a_browser(open_text, tmp_path, "overview")
    assert 'data-shown="overview"' in shown
    assert "data-first" not in shown
    assert "data-second" not in shown
    free = re.sub("<meta http-equiv[^>]+>", "", open_text)
    shown = seen_by_a_browser(free, tmp_path, "overview")
    assert "data-first" in shown, "without the policy it would have run"
    assert "data-second" in shown
