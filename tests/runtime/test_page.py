"""The report: exclusions on top, a page per cell and group, nothing that is not escaped."""

import html as html_module
import itertools
import re
from pathlib import Path

import pandas as pd
from report_text import PACKED, unpacked

from cellwright.refusal import Refusal
from figures import style
from runtime import artefact, page


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
    job.params.cells.append(job.params.cells[0] | {"cell": "B"})
    proof = Path("results/figures/A/effect_map.svg")
    proof.write_text(Path("results/figures/A/validation_udds.svg").read_text())
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


def test_pages_of_a_large_report_are_packed_each_in_its_section(job, monkeypatch):
    monkeypatch.setattr(page, "PLAIN_BYTES", 0)
    html = page.render(job)
    assert html == page.render(job)
    ids = re.findall(r'<section id="([\w-]+)"><script type="application/gzip">', html)
    assert ids == ["cell-A", "cell-pair"]
    assert len(PACKED.findall(html)) == 2
    assert "97 %25" not in html
    assert "raw/bad.csv" in html, "what was excluded is read without unpacking anything"


def test_a_bad_test_shows_its_reason_and_a_note_its_tests(job):
    abouts = {path: artefact.read_about(path) for path in job.input.artefacts}
    columns = ["cell", "group", "model", "ambient_temperature_celsius", "chosen", "sure"]
    names = page.TABLES_OF_PAGE
    tables = {name: pd.DataFrame(columns=columns, dtype=str) for name in names}
    chapters = [{"id": "model", "title": "Model", "tables": ["soc"], "figures": ["validation"]}]
    layout = {"captions": {"validation": {"title": "V", "read": "r"}}, "chapters": chapters}
    found = page._page("A", job.params, tables, list(abouts.values()), layout, {})
    last = [[cell.text for cell in row[-2:]] for row in found["tests"].rows]
    assert last == [["<b>odd</b>", "time & <i>space</i>"], ["", ""]]
    assert found["notes"] == [{"text": "sign found from the data", "tests": ["bad", "good"]}]
    assert found["facts"] == {"cell": "A", "chemistry": "NMC"}
    (chapter,) = found["chapters"]
    ((kind, picture),) = chapter["figures"]
    assert (kind, picture.title, chapter["tables"]) == ("validation", "V: udds", [])


def test_what_is_said_of_many_in_the_same_words_is_said_once():
    notes = ["a, quadratic: no scatter", "b, quadratic: no scatter", "c: other", "alone"]
    of = ["a, quadratic", "b, quadratic", "", ""]
    abouts = [{"notes": notes, "notes_of": of, "wildcards": {"test": "x"}}]
    texts = [note["text"] for note in page._notes(abouts)]
    assert texts == ["a, quadratic; b, quadratic: no scatter", "c: other", "alone"]


def test_errors_of_a_temperature_stand_in_one_column_however_it_was_told():
    names = ["model", "ambient_temperature_celsius", "left_out_rmse_volt", "fit_rmse_volt"]
    rows = [("2RC", "20", ".002", ".001"), ("2RC", "", ".004", ".003")]
    rows += [("2RC+effects", "20.44", ".001", ""), ("1RC", "20", ".005", ".004")]
    frame = pd.DataFrame(rows, columns=names, dtype=str).assign(chosen="False", reason="why")
    found = page._choice(frame.assign(doubt="pulses: its clock jumps"))
    assert found.read.endswith(" In doubt: pulses: its clock jumps.")
    found = page._choice(frame.assign(doubt=""))
    assert "In doubt" not in found.read
    assert found.columns == ["model", "20 °C [mV]", "[mV]", "why, or why not"]
    texts = [[cell.text for cell in row] for row in found.rows]
    assert texts[0] == ["2RC", "2.00 (1.00)", "4.00 (3.00)", "why"]
    assert texts[1:] == [["2RC+effects", "1.00 (–)", "", "why"], ["1RC", "5.00 (4.00)", "", "why"]]


def test_figures_without_a_drawing_are_told_in_one_line(snakemake):
    files = ["figures/A/validation_udds.svg", "figures/A/validation_us06.svg"]
    with artefact.Job(snakemake(*files, wildcards={"cell": "A"})):
        raise Refusal("no OCV <curve>")
    with artefact.Job(snakemake("figures/A/validation_none.svg", wildcards={"cell": "A"})) as job:
        style.save(style.message("Nothing to draw."), job)
    captions = {"validation": {"title": "V", "read": "r"}}
    pictures = [
        page.figure_of(path, captions) for path in [*files, "figures/A/validation_none.svg"]
    ]
    layout = {"chapters": [{"id": "m", "title": "M", "figures": ["validation"]}]}
    (chapter,) = page._chapters({}, pictures, layout)
    assert chapter["figures"] == []
    assert chapter["undrawn"].pop("Nothing to draw.") == ["V: none"]
    assert chapter["undrawn"] == {"no OCV <curve>": ["V: udds", "V: us06"]}


def test_every_figure_and_table_names_the_artefact_that_makes_it_again(job):
    """Figures of a cell are made together: Snakemake knows their folder, not each of them."""
    html = unpacked(page.render(job))
    commands = re.findall(r'<details class="again">.*?<code>(.*?)</code>', html)
    assert all(one.startswith("./run snakemake --cores 2 results/") for one in commands)
    made = {one.rpartition(" ")[2] for one in commands}
    assert {"results/figures/A", "results/summary.csv", "results/tables/capacity.csv"} <= made
    shown = re.findall(r'<(?:figure|div class="table") id="[^"/]*/([^"]*)"', html)
    # Of the tables only that of the tests is a sheet, which nothing makes.
    assert len(commands) == len(shown) - shown.count("table-tests")


def test_every_address_is_of_one_place(job):
    """A chapter, a figure and a table may be of one subject, such as capacity."""
    capacity = Path("results/figures/A/capacity.svg")
    capacity.write_text(Path("results/figures/A/validation_udds.svg").read_text())
    job.params.figures["A"].append(str(capacity))
    html = unpacked(page.render(job))
    found = re.findall(r' id="([^"]+)"', html)
    assert len(found) == len(set(found))
    assert {"cell-A/capacity", "cell-A/table-capacity", "cell-A/chapter-capacity"} <= set(found)
    inside = set(re.findall(r'href="#([^"]*/[^"]*)"', html))
    assert inside <= set(found)


def test_a_group_tells_its_missing_effect_as_a_story_with_a_verdict_on_top(job, saved):
    size = {"excess_ohm": {"value": 0.002, "std": 1e-4, "unit": "Ohm", "at_bound": False}}
    both = {"before": 0.004, "after": 0.001}
    wire = {"effect": "branch_wire_resistance", "branch": 2, "cell": "B", "parameters": size}
    wire |= {"alternatives": [], "branch_alternatives": [], "validation_rmse_volt": both}
    verdict = {"cell": "pair", "verdict": "named", "effects": [wire], "located_at": None}
    verdict |= {"branch_currents": True, "floor_volt": 0.0008, "validation_rmse_volt": both}
    verdict |= {"next_test": None, "against": {"branch_capacity[0]": "small"}, "paragraph": ""}
    job.input.verdicts.append(saved("results/missing_effect/pair/verdict.json", verdict))
    rows = pd.read_csv("results/tables/missing_effect.csv", dtype=str, keep_default_na=False)
    own = {"cell": "pair", "effect": "branch_wire_resistance", "branch": "2", "alternatives": ""}
    own |= {"in_one_line": "shows wire resistance (branch 2)", "sure": "True", "doubts": ""}
    rows = pd.concat([rows, rows.assign(**own)])
    rows.to_csv("results/tables/missing_effect.csv", index=False)
    text = read(page.render(job))
    assert "pair shows wire resistance (branch 2)." in text
    for said in ("The gap, before and after", "What it changes for you", "capacity of branch 1"):
        assert said in text
    assert "in branch currents (each times its cell's resistance)" in text


def test_what_is_left_out_of_many_cells_for_one_reason_is_one_line():
    row = {"test": "", "file": "", "stage": "models", "reason": "no pulses"}
    rows = [row | {"cell": cell} for cell in "AB"] + [row | {"cell": "", "reason": "<odd>"}]
    first, second = page._exclusions(rows)
    assert first["of"] == '<a href="#cell-A">A</a>, <a href="#cell-B">B</a>'
    assert (first["reason"], second["of"], second["reason"]) == ("no pulses", "", "<odd>")


def test_a_reason_that_makes_several_names_unsure_is_said_once():
    rows = [
        {"sure": "False", "branch": "", "effect": "leakage", "doubts": "beside others; at a limit"}
    ]
    rows += [rows[0] | {"effect": "self_heating", "doubts": "beside others"}]
    rows += [rows[0] | {"effect": "time_skew", "sure": "True", "doubts": ""}]
    found = page._unsure(rows)
    assert found == ["beside others (self-discharge, self-heating)", "at a limit (self-discharge)"]


def test_of_many_tests_those_that_could_not_be_used_stand_first(job):
    rows = [job.params.tests[0] | {"test": f"t{k}", "note": None} for k in range(70)]
    about = {"reason": "torn", "wildcards": {"test": "t69"}}
    found = page._tests(rows, [about])
    assert [row[0].text for row in found.rows][:2] == ["t69", "t0"]
    assert (len(found.rows), found.more) == (30, 40)
