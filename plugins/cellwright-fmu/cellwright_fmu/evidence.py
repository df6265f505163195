"""The page within a unit that says how well its numbers are known: errors of tests, sources."""

from html import escape

from cellwright.packs.artefact import scores_in

BEYOND_KELVIN = 40.0  # tables of units reach so far beyond the measured temperatures
HEAD = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title></head><body>
<h1>{title}</h1>
<p>Current is positive on charge, and held over each communication step. Voltages are those at the
present time and inputs. Outside SoC 0 to 1 nothing was measured: the OCV goes on as steeply as it
ends, all else keeps its value, and a warning is logged. Beyond the temperatures named below
resistances follow the model's laws{beyond}.</p>
"""
CELL_HEAD = (
    "cell",
    "member",
    "capacity / A h",
    "its standard deviation / A h",
    "temperatures identified / °C",
    "error of the fit / mV",
    "error of what was left out / mV",
    "error of tests that took no part (rms / mV, largest / mV)",
)
TEST_HEAD = ("group test", "role", "of", "root mean square errors")


def page(title, entries, tests=None, why_not=None, *, by_tables=True):
    """The page documentation/index.html.

    Parameters
    ----------
    title : of the page. entries : cells of a pack document (`packs.artefact.cell_entry`).
    tests : group tests of a pack document, None of a single cell.
    why_not : why the pack is not validated, or None.
    by_tables : whether its numbers stand in tables over temperature, which end somewhere.

    Returns
    -------
    page : bytes of HTML.
    """
    beyond = f", at most {BEYOND_KELVIN:g} K far" if by_tables else ""
    parts = [HEAD.format(title=escape(title), beyond=beyond), "<h2>Cells</h2>\n"]
    parts.append(_table(CELL_HEAD, [_cell_row(entry) for entry in entries]))
    if tests is not None:
        parts.append("<h2>Pack</h2>\n")
        parts.append(f"<p>Not validated: {escape(why_not)}.</p>\n" if why_not else "")
        rows = [_test_row(test, branch) for test in tests for branch in test["branches"]]
        parts.append(_table(TEST_HEAD, rows) if rows else "")
    return "".join([*parts, "</body></html>\n"]).encode()


def _cell_row(entry):
    scores = [
        f"{row['test']}: {_milli(row['rmse_volt'])}, {_milli(row['max_abs_volt'])}"
        for row in entry["validation"]
    ]
    fits = [row for row in entry["fit"] if row["fit_rmse_volt"] is not None]
    return (
        entry["cell"],
        entry["model"]["chosen"],
        f"{entry['capacity_ampere_hour']:.4g}",
        _number(entry["capacity_std_ampere_hour"]),
        ", ".join(_number(row["ambient_temperature_celsius"]) for row in entry["fit"]),
        ", ".join(_milli(row["fit_rmse_volt"]) for row in fits) or "not known",
        _milli(entry["left_out_rmse_volt"]),
        "; ".join(scores) or f"not validated: {entry['why_not_validated']}",
    )


def _test_row(test, row):
    errors = [f"{name} {value:.3g}" for name, value in scores_in(row).items()]
    named = (row.get("channel"), row.get("branch"), row.get("of") or row.get("cell"))
    return (
        test["test"] + (" (part of it fitted)" if test["fitted"] else ""),
        test["role"],
        " ".join(str(part) for part in named if part is not None),
        f"{', '.join(errors)} {row.get('unit') or ''}".strip() or "not logged",
    )


def _number(value):
    return "not known" if value is None or value != value else f"{value:.3g}"


def _milli(volt):
    return "not known" if volt is None or volt != volt else f"{1e3 * volt:.3g}"


def _table(head, rows):
    def line(tag, cells):
        return "<tr>" + "".join(f"<{tag}>{escape(str(c))}</{tag}>" for c in cells) + "</tr>\n"

    body = "".join(line("td", row) for row in rows)
    return f"<table border='1'>\n{line('th', head)}{body}</table>\n"
