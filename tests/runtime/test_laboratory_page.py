"""The test report of a laboratory: only where it states something, and what is lacking is said."""

from pathlib import Path

from report_text import unpacked

from runtime import laboratory_page, page, settings
from runtime.laboratory_page import FIELDS

WHOLE = {name: f"stated {name}" for name in FIELDS}
CELLS = [{"cell": "A", "chemistry": "NMC", "note": "dented"}]
SUMMARY = [
    {"cell": "A", "capacity_ampere_hour": "2.0", "capacity_std_ampere_hour": "0.01"}
    | {"soh": "0.9", "soh_std": "", "r0_50_25_ohm": "", "doubt": ""}
]


def section(stated, excluded=()):
    return laboratory_page.section(stated, CELLS, SUMMARY, list(excluded), "1.2")


def test_nothing_stated_no_page():
    assert section({}) is None
    assert section(None) is None
    assert section({"laboratory": " "}) is None


def test_what_the_clause_asks_for_and_is_not_stated_is_named():
    found = section({"laboratory": "L", "customer": "C"})
    needed = [name for name, (_, _, asked) in FIELDS.items() if asked]
    lacking = [f"test_report.{name}" for name in needed if name not in ("laboratory", "customer")]
    assert found["missing"].endswith(f"config.yaml lacks {', '.join(lacking)}.")
    assert section(WHOLE)["missing"] == ""
    assert len(found["lines"]) == len(needed)
    assert len(section(WHOLE)["lines"]) == len(FIELDS)


def test_results_have_units_and_the_expanded_uncertainty_or_say_that_there_is_none():
    rows = [[cell.text for cell in row[1:]] for row in section(WHOLE)["results"].rows]
    assert rows == [
        ["capacity", "2.00 ± 0.02", "Ah", ""],
        ["state of health", "90", "%", "uncertainty not known"],
    ]


def test_items_and_exclusions_come_from_the_campaign():
    excluded = [{"cell": "A", "test": "bad", "reason": "no time"}]
    lines = {what: texts for _, what, texts in section(WHOLE, excluded)["lines"]}
    assert ["stated items", "A (NMC, dented)"] in lines.values()
    assert ["stated deviations", "Excluded: A bad: no time."] in lines.values()


def test_the_report_has_the_page_escaped_and_closed(job):
    assert 'id="test-report"' not in unpacked(page.render(job))
    job.params.laboratory = {"laboratory": "Tests & <i>Sons</i>", "number": "7/26"}
    html = unpacked(page.render(job))
    assert "Tests &amp; &lt;i&gt;Sons&lt;/i&gt;" in html
    assert "The results relate only to the items tested." in html
    assert "End of test report 7/26." in html


def test_the_schema_knows_the_fields_and_no_others():
    schema = settings.load(Path(__file__).parents[2] / "workflow/schemas", "config")
    assert schema["properties"]["test_report"]["propertyNames"]["enum"] == list(FIELDS)
    stated = {"test_report": {"laboratory": "L"}}
    assert settings.faults_of(stated, schema) == []
    (wrong,) = settings.faults_of({"test_report": {"labratory": "L"}}, schema)
    assert "'labratory'" in wrong
    assert "laboratory" in wrong
