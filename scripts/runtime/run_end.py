"""What a run says at its end: where the report is, what was left out, and what changed."""

import csv
from pathlib import Path

from runtime import snakemake_state

# Columns of the summary that people compare from run to run, as they call them.
COMPARED = {
    "capacity_ampere_hour": ("capacity", "Ah", 1.0),
    "soh": ("state of health", "%", 100.0),
    "r0_50_25_ohm": ("R0", "mΩ", 1e3),
    "best_model": ("model", "", None),
    "validation_rmse_volt": ("model error", "mV", 1e3),
    "missing_effect": ("missing effect", "", None),
}
LEFT_OUT, CHECKED = ("cell", "test", "file", "stage"), ("check", "outcome")
NAMED = 4


def read(folder) -> dict[str, dict]:
    """The summary of a campaign as it stands, a row by cell.

    Empty before the first run, and where a file of that name is another program's.
    """
    rows = _rows(Path(folder, "results", "summary.csv"), "cell")
    # Without a name what the search said instead: "none" is not "unknown".
    column = "missing_effect"
    return {row["cell"]: row | {column: row.get(column) or row.get("verdict", "")} for row in rows}


def lines(folder, before, started, written_to=()) -> list[str]:
    """The last lines of a run.

    Parameters
    ----------
    folder : of the campaign
    before : its summary before the run, from `read`
    started : start of the run [s since 1970]
    written_to : files of the user's that have changed since
    """
    slow = snakemake_state.slowest(folder, started, count=3)
    took = [f"Longest:  {'; '.join(slow)}"] if slow else []
    if written_to:
        of = "while the run went on; results are of what stood there before: start it again"
        took.append(f"Files:    {_names(written_to)} changed {of}")
    report = Path(folder, "results", "report.html")
    if not report.is_file():
        whole = "snakemake --cores 2 makes it, and results/tables/excluded.csv of what was left out"
        return [f"Report:   none yet: {whole}", *took]
    after, tables = read(folder), Path(folder, "results", "tables")
    return [
        f"Report:   {report.relative_to(folder)} (what lies where: results/README.md)",
        f"Cells:    {_cells(after)}",
        f"Left out: {_left_out(_rows(tables / 'excluded.csv', *LEFT_OUT))}",
        f"Checks:   {_checks(_rows(tables / 'checks.csv', *CHECKED))}",
        f"Changed:  {changes(before, after)}",
        *took,
    ]


def changes(before, after) -> str:
    """What two summaries of a campaign say differently, in words."""
    if not before:
        return "this is the first run of this campaign"
    new, gone = sorted(set(after) - set(before)), sorted(set(before) - set(after))
    found = [f"new: {', '.join(new)}"] * bool(new) + [f"gone: {', '.join(gone)}"] * bool(gone)
    for cell in sorted(set(after) & set(before)):
        words = [
            f"{name} {_shown(old, unit, scale)} → {_shown(now, unit, scale)}"
            for column, (name, unit, scale) in COMPARED.items()
            if (old := before[cell].get(column, "")) != (now := after[cell].get(column, ""))
        ]
        found += [f"{cell}: {', '.join(words)}"] * bool(words)
    more = [f"and {len(found) - NAMED} more cells"] if len(found) > NAMED else []
    return "; ".join(found[:NAMED] + more) or "no number of the summary since the last run"


def _cells(summary) -> str:
    modelled = sum(bool(row.get("best_model")) for row in summary.values())
    named = sum(row.get("verdict") in ("named", "ambiguous") for row in summary.values())
    doubted = sorted(cell for cell, row in summary.items() if row.get("doubt"))
    words = f"{len(summary)}, {modelled} with a model, {named} with a named missing effect"
    return f"{words}; doubts about {_names(doubted)}" if doubted else words


def _left_out(rows) -> str:
    if not rows:
        return "nothing"
    what = [
        " ".join(filter(None, (row["cell"], row["test"]))) or row["file"] or row["stage"]
        for row in rows
    ]
    return f"{len(rows)} (results/tables/excluded.csv): {_names(list(dict.fromkeys(what)))}"


def _checks(rows) -> str:
    failed = [row for row in rows if row["outcome"] != "passed"]
    if not failed:
        return f"all {len(rows)} passed"
    return f"{len(failed)} of {len(rows)} failed (results/tables/checks.csv): {failed[0]['check']}"


def _names(names) -> str:
    return ", ".join(names[:NAMED]) + (", …" if len(names) > NAMED else "")


def _shown(text, unit, scale) -> str:
    if not text:
        return "none"
    try:
        return text if scale is None else f"{float(text) * scale:.4g} {unit}"
    except ValueError:  # what somebody wrote into the summary before this run
        return repr(text)


def _rows(path, *columns) -> list[dict]:
    """Rows of a table; none where there is no such file, or where it lacks one of the columns."""
    if not path.is_file():
        return []
    with open(path, encoding="utf-8", errors="replace", newline="") as file:
        try:
            rows = list(csv.DictReader(file))
        except csv.Error:
            return []
    # Of a row with fewer cells than there are columns the last ones are None.
    return [row for row in rows if all(row.get(column) is not None for column in columns)]
