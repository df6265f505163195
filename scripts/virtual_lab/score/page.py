"""The second report: how good a campaign's results are, for people; and the same as Markdown."""

import base64
from pathlib import Path

import jinja2

from virtual_lab.score import pictures, verdicts, words
from virtual_lab.score.spoiled import COUNTED
from virtual_lab.score.summary import QUANTITIES

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
TITLES = {
    "capacity": "Capacity",
    "resistance": "Pulse resistance",
    "ocv": "Open-circuit voltage",
    "eis": "Impedance",
    "temperature": "Over temperature",
    "temperature_prediction": "Temperatures left out",
    "capacity_loss": "Capacity lost to temperature",
    "ica_temperature": "Peaks over temperature",
    "fast_charge": "Fast charge",
    "ageing": "Ageing records",
    "ica": "Incremental capacity",
    "health": "State of health",
    "models": "Model parameters",
    "choice": "Choice of the model",
    "soc": "State of charge",
    "validation": "Validation of models",
    "packs": "Parallel groups",
    "missing_effect": "Missing effects",
    "excluded": "Spoiled files",
    "faults": "Spoiled samples",
}
ABOUT = {
    "capacity": "Charge and energy of full charges and discharges.",
    "resistance": "Pulse by pulse: the nearest in time, at the same delay. At 0 s the truth is "
    "10 ms after the edge; a first sample that came later than 20 ms is scored by itself.",
    "ocv": "The curve beside the cell's rested voltage, point by point; the ends by themselves.",
    "eis": "Parameters of the fitted circuit, where the physics has such a parameter.",
    "temperature": "Coefficients of the laws over temperature.",
    "temperature_prediction": "Errors are measured against the record, not against a truth.",
    "capacity_loss": "True and false capacity loss at each temperature and rate.",
    "ica_temperature": "What became of each peak at another temperature.",
    "fast_charge": "Charge put in within the time asked for.",
    "ageing": "Slope over temperature, daily cycle and fade of ageing records.",
    "ica": "Peaks of the incremental capacity, each beside the nearest within 50 mV.",
    "health": "State of health, method by method, at the same cycle (within 2).",
    "models": "The chosen circuit's resistance 10 ms (r0), 10 s and long after a step.",
    "choice": "Errors are measured against the records fitted, not against a truth.",
    "soc": "State of charge at the ends of a test: counted, and by the filters from a wrong start.",
    "validation": "Errors of simulations are measured against the record, not against a truth.",
    "packs": "Branches of parallel groups as simulated: the charge of all discharges, the "
    "largest current; and the capacity of the group as recorded.",
    "missing_effect": "What was hidden in a cell, and what was said of it.",
    "excluded": "Files spoiled beyond use on purpose: refused, or taken for good (missing).",
    "faults": "Samples spoiled on purpose: flagged, not seen (missing); other flags are extra.",
}


def render(scored, *, title: str) -> str:
    """The page as one HTML text, from a `work.Score`."""
    settings = {"autoescape": True, "trim_blocks": True, "lstrip_blocks": True}
    environment = jinja2.Environment(undefined=jinja2.StrictUndefined, **settings)
    environment.filters |= {"number": words.number, "percent": words.percent, "plain": words.plain}
    lines = [words.line(row) for row in scored.summary.to_dict("records")]
    return environment.from_string(TEMPLATE.read_text(encoding="utf-8")).render(
        title=title,
        tables=[_table(scored, name, lines) for name in QUANTITIES],
        lines=lines,
        titles=TITLES,
        lost=_lost(scored),
        counts=scored.errors["status"].value_counts().to_dict(),
        coverage=_embedded(pictures.coverage(scored.summary)),
        verdicts=_verdicts(scored.verdicts),
    )


def _table(scored, name, lines) -> dict:
    mine = scored.errors[scored.errors["table"] == name]
    lines = [row for row in lines if row["table"] == name]
    states = [row["state"] for row in lines]
    numbers = mine[mine["unit"] != COUNTED]
    return {
        "name": name,
        "title": TITLES[name],
        "about": ABOUT[name],
        "lines": [row for row in lines if row["state"] == "scored"],
        "rest": _rest(lines),
        "state": "scored" if "scored" in states else (states or ["no truth"])[0],
        "picture": _embedded(pictures.of_table(numbers)) if len(numbers) else None,
        "worst": _worst(numbers),
        "alone": [_alone(mine, status) for status in ("missing", "extra", "spoiled", "untested")],
    }


def _lost(scored) -> int:
    """Rows of the truth that were not found in tables that were made."""
    made = scored.summary.loc[scored.summary["state"] == "scored", "table"]
    errors = scored.errors
    return int(((errors["status"] == "missing") & errors["table"].isin(made)).sum())


def _rest(lines) -> dict:
    """What could not be scored, by the reason."""
    rest = {}
    for row in lines:
        if row["state"] != "scored":
            rest.setdefault(row["state"], []).append(row["quantity"])
    # Each law once, without its coefficients.
    short = {state: [name.split(":")[0] for name in names] for state, names in rest.items()}
    return {state: list(dict.fromkeys(filter(None, names))) for state, names in short.items()}


def _worst(rows) -> list[dict]:
    """Of each quantity the largest error, then by how it compares with the others of its kind."""
    rows = rows[rows["status"] == "compared"]
    size = rows["error"].abs()
    usual = rows.groupby("quantity")["error"].transform(lambda error: (error**2).mean() ** 0.5)
    order = (size / usual.where(usual > 0)).sort_values(ascending=False, kind="stable").index
    rows = rows.loc[order[:SHOWN_ROWS]].to_dict("records")
    return [row | {"error": words.with_unit(row["error"], row["unit"])} for row in rows]


def _alone(rows, status) -> dict:
    rows = rows[rows["status"] == status]
    named = rows.groupby(["quantity", "cell", "test"], dropna=False, sort=False)
    shown = [
        {
            "who": " ".join(part for part in key[1:] if isinstance(part, str) and part),
            "quantity": words.plain(key[0]),
            "number": len(part),
            "at": "; ".join(part["at"].dropna().astype(str).unique()[:3]),
            "reason": "; ".join(part["reason"].dropna().astype(str).unique()[:2]),
        }
        for key, part in named
    ]
    return {"status": status, "number": len(rows), "rows": shown[: 2 * SHOWN_ROWS]}


def _verdicts(judged) -> dict | None:
    if not len(judged):
        return None
    tables = {"outcomes": verdicts.confusion(judged), "answers": verdicts.answers(judged)}
    return {
        "rows": judged.to_dict("records"),
        **{
            name: {"columns": list(table), "rows": [(k, list(v)) for k, *v in table.itertuples()]}
            for name, table in tables.items()
        },
    }


def _embedded(svg) -> str | None:
    return base64.b64encode(svg.encode()).decode() if svg else None


def markdown(scored) -> str:
    """The summary as a Markdown table, ready for a page of the documents."""
    lines = [words.line(row) for row in scored.summary.to_dict("records")]
    rows = [row for row in lines if row["state"] == "scored"]
    shown = [name for name in MARKDOWN if any(row[name] for row in rows)]
    text = [f"| {' | '.join(MARKDOWN[name] for name in shown)} |", f"|{' --- |' * len(shown)}"]
    text += [f"| {' | '.join(row[name].replace('|', '/') for name in shown)} |" for row in rows]
    return "\n".join([*text, *_rest_in_words(lines)]) + "\n"


def _rest_in_words(lines) -> list[str]:
    said = {}
    for table in QUANTITIES:
        rest = _rest([row for row in lines if row["table"] == table])
        for state, names in rest.items():
            shown = f"{table} ({', '.join(names)})" if names else table
            said.setdefault(state, []).append(shown)
    return [
        f"\n{state[0].upper()}{state[1:]}: {'; '.join(shown)}." for state, shown in said.items()
    ]
