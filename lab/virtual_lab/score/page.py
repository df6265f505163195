"""The score as files for people: an HTML page with pictures, CSV tables, a Markdown table."""

import math
from pathlib import Path

import jinja2

from virtual_lab.score import files, verdicts
from virtual_lab.score.missing import COUNTED
from virtual_lab.score.summary import QUANTITIES, Score, score

SHOWN = {
    "V": (1e3, "mV"),
    "Ohm": (1e3, "mΩ"),
    "Ah": (1e3, "mAh"),
    "A": (1e3, "mA"),
    "1": (1, ""),
    "J/mol": (1e-3, "kJ/mol"),
}
SUFFIXES = ("_ampere_hour_per_volt", "_ampere_hour", "_watt_hour", "_ampere", "_volt", "_ohm")
STATISTICS = ("bias", "rms_error", "worst_error")
SMALL_SAMPLE = 10


def plain_name(quantity: str) -> str:
    """A quantity without its unit and underscores."""
    head, comma, rest = str(quantity).partition(",")
    suffix = next((one for one in SUFFIXES if head.endswith(one)), "")
    return f"{head.removesuffix(suffix)}{comma}{rest}".replace("_", " ")


def shown_unit(unit) -> tuple[float, str]:
    """Factor and unit in which errors of a unit are shown."""
    return SHOWN.get(unit, (1.0, unit if isinstance(unit, str) else ""))


def short_number(value) -> str:
    """Three significant digits; blank where not known."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    if isinstance(value, str):
        return value
    if abs(value) >= 1000:
        return f"{value:,.0f}".replace(",", " ")
    whole = float(value).is_integer()
    return f"{value:.0f}" if whole else f"{value:.3g}"


def with_unit(value, unit) -> str:
    """An error in a unit in which it is easy to read."""
    factor, name = shown_unit(unit)
    if not short_number(value):
        return ""
    return f"{short_number(float(value) * factor)} {name}".strip()


def percent(value) -> str:
    """A share in per cent; blank where not known."""
    return f"{short_number(round(100 * float(value), 4))} %" if short_number(value) else ""


def summary_line(row: dict) -> dict:
    """One row of the summary for people: every statistic as text with its unit."""
    counts = {
        f"n_{name}": short_number(row[f"n_{name}"]) for name in ("compared", "missing", "extra")
    }
    worst = [row[name] for name in ("worst_cell", "worst_test", "worst_at")]
    return {
        "table": row["table"],
        "quantity": plain_name(row["quantity"]),
        "state": row["state"],
        **counts,
        **{name: with_unit(row[name], row["unit"]) for name in STATISTICS},
        "relative_rms": percent(row["relative_rms"]),
        "share": _between(row, "share", "share") or _between(row, "coverage_95", "coverage"),
        "worst": " ".join(part for part in worst if isinstance(part, str) and part),
        "remark": remark(row),
    }


def _between(row, name, stem):
    low, high = (row[f"{stem}_{side}"] for side in ("low", "high"))
    if not short_number(low):
        return percent(row[name])
    return f"{percent(row[name])} ({100 * low:.0f}–{100 * high:.0f})"


def remark(row: dict) -> str:
    """Warnings for the reader: intervals that do not hold, and rows that are missing on purpose."""
    said = []
    if short_number(row["coverage_95"]) and row["n_interval"] >= SMALL_SAMPLE:
        said += ["intervals too narrow"] if row["coverage_high"] < 0.95 else []
        said += ["intervals too wide"] if row["coverage_low"] > 0.95 else []
    counts = {"spoiled": "spoiled on purpose", "untested": "without such a test"}
    said += [f"{int(row[f'n_{k}'])} {v}" for k, v in counts.items() if row[f"n_{k}"] > 0]
    return "; ".join(said)


TEMPLATE = Path(__file__).with_name("score.html.j2")
SHOWN_ROWS = 12
MARKDOWN = {
    "table": "table",
    "quantity": "quantity",
    "n_compared": "compared",
    "n_missing": "missing",
    "n_extra": "extra",
    "bias": "bias",
    "rms_error": "RMS error",
    "relative_rms": "relative",
    "share": "in the 95 % interval, or found",
    "worst_error": "worst",
    "worst": "where",
    "remark": "remark",
}
# Title and meaning of the tables that can be scored; of others the name is enough.
ABOUT = {
    "capacity": ("Capacity", "Charge and energy of full charges and discharges."),
    "resistance": (
        "Pulse resistance",
        "Pulse by pulse: the nearest in time, at the same delay. At 0 s the truth is 10 ms "
        "after the edge; a first sample that came later than 20 ms is scored by itself.",
    ),
    "ocv": (
        "Open-circuit voltage",
        "The curve beside the cell's rested voltage, point by point; the ends by themselves.",
    ),
    "eis": (
        "Impedance",
        "Parameters of the fitted circuit, where the physics has such a parameter.",
    ),
    "temperature": ("Over temperature", "Coefficients of the laws over temperature."),
    "ica": (
        "Incremental capacity",
        "Peaks of the incremental capacity, each beside the nearest within 50 mV.",
    ),
    "health": (
        "State of health",
        "State of health, method by method, at the same cycle (within 2).",
    ),
    "models": (
        "Model parameters",
        "The chosen circuit's resistance 10 ms (r0), 10 s and long after a step.",
    ),
    "soc": (
        "State of charge",
        "State of charge at the ends of a test: counted, and by the filters from a wrong start.",
    ),
    "packs": (
        "Parallel groups",
        "Branches of parallel groups as simulated: the charge of all discharges, the largest "
        "current; the capacity of the group as recorded and simulated; errors of current "
        "(over the mean branch current) and voltage against the record.",
    ),
    "series_packs": (
        "Series packs",
        "Usable charge and energy of strings, where a cell's cut-off ended the record.",
    ),
    "series_pack_cells": (
        "Cells of series packs",
        "How each cell stands when the string has ended, and its full charge.",
    ),
    "missing_effect": ("Missing effects", "What was hidden in a cell, and what was said of it."),
    "excluded": (
        "Spoiled files",
        "Files spoiled beyond use on purpose: refused, or taken for good (missing).",
    ),
    "faults": (
        "Spoiled samples",
        "Samples spoiled on purpose: flagged, not seen (missing); other flags are extra.",
    ),
}


def render(scored, *, title: str) -> str:
    """The page as one HTML text, from a `summary.Score`."""
    settings = {"autoescape": True, "trim_blocks": True, "lstrip_blocks": True}
    environment = jinja2.Environment(undefined=jinja2.StrictUndefined, **settings)
    environment.filters |= {"number": short_number, "percent": percent, "plain": plain_name}
    lines = [summary_line(row) for row in scored.summary.to_dict("records")]
    # Rows of the truth are lost only where the pipeline has made the table.
    made = scored.summary.loc[scored.summary["state"] == "scored", "table"]
    in_made_tables = scored.errors["table"].isin(made)
    return environment.from_string(TEMPLATE.read_text(encoding="utf-8")).render(
        title=title,
        tables=[_page_table(scored, name, lines) for name in QUANTITIES],
        lines=lines,
        titles={name: _about(name)[0] for name in QUANTITIES},
        lost=int(((scored.errors["status"] == "missing") & in_made_tables).sum()),
        counts=scored.errors["status"].value_counts().to_dict(),
        verdicts=_verdict_tables(scored.verdicts),
    )


def _about(name) -> tuple[str, str]:
    """Title of a table, and what it has."""
    return ABOUT.get(name) or (name.replace("_", " ").capitalize(), "")


def _page_table(scored, name, lines) -> dict:
    title, about = _about(name)
    mine = scored.errors[scored.errors["table"] == name]
    lines = [row for row in lines if row["table"] == name]
    states = [row["state"] for row in lines]
    numbers = mine[mine["unit"] != COUNTED]
    return {
        "name": name,
        "title": title,
        "about": about,
        "lines": [row for row in lines if row["state"] == "scored"],
        "rest": _unscored(lines),
        "state": "scored" if "scored" in states else (states or ["no truth"])[0],
        "worst": _worst(numbers),
        "alone": [
            _unpaired_rows(mine, status) for status in ("missing", "extra", "spoiled", "untested")
        ],
    }


def _unscored(lines) -> dict:
    """Quantities that could not be scored, by the reason."""
    rest = {}
    for row in lines:
        if row["state"] != "scored":
            rest.setdefault(row["state"], []).append(row["quantity"])
    # Each law once, without its coefficients.
    short = {state: [name.split(":")[0] for name in names] for state, names in rest.items()}
    return {state: list(dict.fromkeys(filter(None, names))) for state, names in short.items()}


def _worst(rows) -> list[dict]:
    """The largest error of each quantity first, then by size relative to others of the quantity."""
    rows = rows[rows["status"] == "compared"]
    size = rows["error"].abs()
    usual = rows.groupby("quantity")["error"].transform(lambda error: (error**2).mean() ** 0.5)
    order = (size / usual.where(usual > 0)).sort_values(ascending=False, kind="stable").index
    rows = rows.loc[order[:SHOWN_ROWS]].to_dict("records")
    return [row | {"error": with_unit(row["error"], row["unit"])} for row in rows]


def _unpaired_rows(rows, status) -> dict:
    rows = rows[rows["status"] == status]
    named = rows.groupby(["quantity", "cell", "test"], dropna=False, sort=False)
    shown = [
        {
            "who": " ".join(part for part in key[1:] if isinstance(part, str) and part),
            "quantity": plain_name(key[0]),
            "number": len(part),
            "at": "; ".join(part["at"].dropna().astype(str).unique()[:3]),
            "reason": "; ".join(part["reason"].dropna().astype(str).unique()[:2]),
        }
        for key, part in named
    ]
    return {"status": status, "number": len(rows), "rows": shown[: 2 * SHOWN_ROWS]}


def _verdict_tables(judged) -> dict | None:
    if not len(judged):
        return None
    tables = {
        "outcomes": verdicts.confusion(judged),
        "answers": verdicts.answers(judged),
        "power": verdicts.power(judged),
    }
    return {
        "rows": judged.to_dict("records"),
        **{
            name: {"columns": list(table), "rows": [(k, list(v)) for k, *v in table.itertuples()]}
            for name, table in tables.items()
        },
    }


def markdown(scored) -> str:
    """The summary as a Markdown table."""
    lines = [summary_line(row) for row in scored.summary.to_dict("records")]
    rows = [row for row in lines if row["state"] == "scored"]
    shown = [name for name in MARKDOWN if any(row[name] for row in rows)]
    text = [f"| {' | '.join(MARKDOWN[name] for name in shown)} |", f"|{' --- |' * len(shown)}"]
    text += [f"| {' | '.join(row[name].replace('|', '/') for name in shown)} |" for row in rows]
    return "\n".join([*text, *_unscored_text(lines)]) + "\n"


def _unscored_text(lines) -> list[str]:
    said = {}
    for table in QUANTITIES:
        rest = _unscored([row for row in lines if row["table"] == table])
        for state, names in rest.items():
            shown = f"{table} ({', '.join(names)})" if names else table
            said.setdefault(state, []).append(shown)
    return [
        f"\n{state[0].upper()}{state[1:]}: {'; '.join(shown)}." for state, shown in said.items()
    ]


def write(place: files.Campaign, *, title: str) -> Score:
    """Score a campaign into `results/score/`: tables, and the page for people."""
    scored = score(place)
    folder = place.results / "score"
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("errors", "summary", "verdicts"):
        path = folder / ("score.csv" if name == "summary" else f"{name}.csv")
        table = getattr(scored, name)
        path.write_text(table.to_csv(index=False, float_format="%.9g"), encoding="utf-8")
    (folder / "score.html").write_text(render(scored, title=title), encoding="utf-8")
    return scored
