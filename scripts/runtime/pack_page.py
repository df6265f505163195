"""Packs in the report: one line of each in the overview, and what to know of its records."""

from cellwright.packs.wiring import described, rows_below, wiring_of
from runtime.page_tables import link, plain_table

# In the sentences of a simulation that its reader must know: of swapped cells, and of cells whose
# resistance no test tells at the temperature that they are simulated at.
GRAVE = ("swapped channels?", "no test tells how resistance")
TABLES = (
    "packs",
    "pack_findings",
    "series_packs",
    "nested_packs",
    "pack_checks",
)  # whose rows are of groups


def section(tables, groups) -> list[dict]:
    """A line of each group with tests: its wiring, its worst errors, what it gives of its cells.

    `tables` are frames of text by name, `groups` the rows of groups.tsv.
    """
    lines = []
    missing = tables.get("missing_effect", {"cell": (), "in_one_line": ()})
    shown = dict(zip(missing["cell"], missing["in_one_line"], strict=True))
    for group in dict.fromkeys(row["group"] for row in groups):
        line = _line({name: _of(tables, name, group) for name in TABLES})
        line["verdict"] = shown.get(group, "")
        if any(line.values()):
            lines.append({"group": group, "wiring": wiring_in_words(group, groups)} | line)
    return lines


def table_of_section(lines, warned):
    """The lines of `section` as a table; `warned`: how many warnings the page of a group has."""
    read = (
        "Of each group the largest error of a branch current and of the voltage over its tests, "
        "the most that it loses of its cells' charge, what one of its branches has of its own, and "
        "how many checks of its records found something."
    )
    columns = ["group", "wiring", "worst branch current", "voltage", "gives", "verdict", "to know"]
    rows = [
        [
            link(line["group"]),
            *(line[name] for name in ("wiring", "current", "voltage", "charge", "verdict")),
            f"{warned[line['group']]} on its page" if warned.get(line["group"]) else "",
        ]
        for line in lines
    ]
    return plain_table("packs", "Packs", read, columns, rows, made="results/tables/packs.csv")


def wiring_in_words(group, groups) -> str:
    """The wiring of a group, such as `series of 3 x parallel of 4 cells (P01 to P12)`."""
    return described(wiring_of(group, rows_below(group, groups)))


def warnings(checks, abouts) -> list[str]:
    """What the checks of a group's records found, on the group's page above all else.

    `checks` are its rows of tables/pack_checks, `abouts` what its artefacts say of themselves: of a
    series pack the simulation itself tells swapped cells.
    """
    found = [row["sentence"] for row in checks.to_dict("records") if row["found"] == "True"]
    # Strings have no row of checks of their own: their simulation finds what is to be known.
    said = (note for about in abouts for note in about["notes"])
    notes = [note for note in said if any(words in note for words in GRAVE)]
    return list(dict.fromkeys([*found, *notes]))


def _of(tables, name, group):
    frame = tables.get(name)
    if frame is None or not len(frame):
        return []
    return frame[frame["group"] == group].to_dict("records")


def _line(rows) -> dict:
    """Texts of the columns of the overview, blank where nothing is known."""
    return {
        "current": _worst_branch(rows["packs"]) or _worst_channel(rows["nested_packs"], "A"),
        "voltage": _voltage(rows["packs"], rows["series_packs"])
        or _worst_channel(rows["nested_packs"], "V"),
        "charge": _charge(rows["pack_findings"], rows["series_packs"]),
    }


def _largest(rows, name):
    """The row with the largest value of a column among those that have one; None without."""
    known = [row for row in rows if row.get(name)]
    return max(known, key=lambda row: abs(float(row[name])), default=None)


def _worst_branch(scores):
    worst = _largest(scores, "current_rmse_ampere")
    if worst is None:
        return ""
    text = f"{_size(worst['current_rmse_ampere'], 'A')} RMS, {worst['cell']}"
    share = worst.get("relative_current_rmse_above_15_soc")
    above = f" ({100 * float(share):.2g} % above 15 % SoC)" if share else ""
    return f"{text} in {worst['test']}{above}"


def _worst_channel(channels, unit):
    worst = _largest([row for row in channels if row["unit"] == unit], "rmse")
    if worst is None:
        return ""
    return f"{_size(worst['rmse'], unit)} RMS, {worst['of']} in {worst['test']}"


def _size(text, unit):
    """A size with three digits, in thousandths of the unit where it is below one."""
    value = float(text)
    return f"{1e3 * value:.3g} m{unit}" if abs(value) < 0.9995 else f"{value:.3g} {unit}"


def _voltage(scores, strings):
    worst = _largest(strings, "cell_worst_mean_abs_volt")
    if worst is not None:
        mean, largest = (
            1e3 * float(worst[name]) for name in ("cell_mean_abs_volt", "cell_worst_mean_abs_volt")
        )
        return f"cells {mean:.3g} mV in the mean, {worst['cell_worst']} {largest:.3g} mV"
    worst = _largest(strings, "voltage_rmse_volt") or _largest(scores, "voltage_rmse_volt")
    return "" if worst is None else f"{1e3 * float(worst['voltage_rmse_volt']):.3g} mV RMS"


def _charge(findings, strings):
    lost = _largest(findings, "lost_share")
    if lost is not None:
        given, cells = (
            float(lost[name])
            for name in ("group_capacity_ampere_hour", "cells_capacity_ampere_hour")
        )
        rate = f"{float(lost['current_c_rate']):.2g}C"
        return f"{given:.4g} of {cells:.4g} Ah of its cells at {rate} ({given / cells - 1:+.1%})"
    # Of several records the one in which the string gave least: what its user can count on.
    least = min(
        (row for row in strings if row.get("usable_ampere_hour")),
        key=lambda row: float(row["usable_ampere_hour"]),
        default=None,
    )
    if least is None:
        return ""
    usable, mean = float(least["usable_ampere_hour"]), least.get("charge_moved_ampere_hour")
    of_mean = f" of {float(mean):.4g} Ah of its mean cell" if mean else " Ah"
    return f"{usable:.4g}{of_mean}, ended by {least['ended_by']}"
