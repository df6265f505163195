"""What was simulated beside each verdict: for readers alone, and only of simulated cells."""

from pathlib import Path

import pytest
from report_text import unpacked

from runtime import page, simulated_page

ROOT = Path(__file__).resolve().parents[2]
HEAD = "cell,simulated,effects\n"


@pytest.fixture
def known(tmp_path):
    file = tmp_path / "simulated.csv"
    lines = [
        "A,fresh,slow_diffusion;self_heating",
        "B,a loose contact,",
        "Z,untried,leakage",
    ]
    file.write_text(HEAD + "\n".join(lines) + "\n", encoding="utf-8")
    return simulated_page.known([file])


def named(cell, effect, alternatives=""):
    return {"cell": cell, "effect": effect, "alternatives": alternatives}


def texts(known, verdicts, effects):
    summary = [{"cell": cell, "verdict": verdict} for cell, verdict in verdicts.items()]
    rows = simulated_page.table(known, summary, effects).rows
    return [[cell.text for cell in row] for row in rows]


def test_a_name_is_right_wrong_or_lacking_by_what_is_in_the_cell(known):
    verdicts = {"A": "named", "B": "unknown"}
    effects = [named("A", "slow_diffusion"), named("A", "leakage"), named("B", "")]
    a, b, z = texts(known, verdicts, effects)
    assert a[1:] == ["named", "slow diffusion", "self-discharge", "self-heating", "fresh"]
    assert b[1:] == ["something without a name", "", "", "", "a loose contact"]
    assert z[1:] == ["not searched", "", "", "self-discharge", "untried"]


def test_a_tie_is_right_where_one_of_its_names_is(known):
    (row, *_) = texts(known, {"A": "ambiguous"}, [named("A", "leakage", "self_heating")])
    assert row[2:5] == ["self-discharge or self-heating", "", "slow diffusion"]


def test_a_real_campaign_has_no_such_table(job):
    assert simulated_page.table({}, [], []) is None
    assert "What was simulated" not in unpacked(page.render(job))


def test_the_report_shows_it_on_the_overview_and_on_the_page(job, tmp_path):
    file = tmp_path / "simulated.csv"
    file.write_text(HEAD + "A,two pairs & no <more>,slow_diffusion\n", encoding="utf-8")
    job.input.truth = [str(file)]
    html = unpacked(page.render(job))
    assert html.count("two pairs &amp; no &lt;more&gt;") == 2
    assert "<dt>What was simulated</dt><dd>two pairs" in html


def test_no_rule_but_the_report_reads_it():
    """What scores a fit must not reach it."""
    rules = (ROOT / "workflow").rglob("*.smk")
    reading = [path.name for path in rules if "simulated.csv" in path.read_text(encoding="utf-8")]
    assert reading == ["report.smk"]
    code = (path for path in (ROOT / "scripts").rglob("*.py"))
    reading = [path.name for path in code if "simulated.csv" in path.read_text(encoding="utf-8")]
    assert reading == ["simulated_page.py"], "which names it in a sentence"
