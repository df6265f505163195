"""The report's page: what is shown of each cell, and the stage's words."""

import base64
from pathlib import Path

import jinja2
import pandas as pd
import yaml

from runtime import artefact

TABLES_OF_CELL = ["capacity", "ica", "eis", "temperature", "validation", "soc"]
SHOWN_ROWS = 60
NAMES = ["validation", "branches", "map", "evidence", "ranking", "confounding"]
PROOFS = [f"effect_{name}" for name in NAMES]
NO_MODEL = {
    "text": "No model, and no simulation: that needs an hppc test, a drive of role fit or split, a "
    "modelled cell of the same chemistry and rating to borrow from, or branch currents of a group.",
    "tests": [],
}


def render(job) -> str:
    """The report as one HTML text, from the inputs and params of rule `report`."""
    inputs, params = job.input, job.params
    tables = {Path(path).stem: _text(path) for path in inputs.tables}
    abouts = {path: artefact.read_about(path) for path in inputs.artefacts}
    known = yaml.safe_load(Path(inputs.captions).read_text(encoding="utf-8"))
    owners = [row["cell"] for row in params.cells]
    effects = {_owner(artefact.read_about(path)): _said(path) for path in inputs.verdicts}
    witnesses = {_owner(artefact.read_about(p)): _witnesses(p) for p in inputs.witnesses}
    cold = {_owner(artefact.read_about(path)): _said(path) for path in inputs.cold}
    groups = list(dict.fromkeys(row["group"] for row in params.groups))
    pages = [_page(name, params, tables, abouts, known) for name in owners + groups]
    for one in pages:
        one["effect"], one["cold"] = effects.get(one["name"]), cold.get(one["name"])
        one["witnesses"] = witnesses.get(one["name"], [])
        one["verdicts"] = _of(tables["missing_effect"], one["name"]).to_dict("records")
    template = Path(inputs.template).read_text(encoding="utf-8")
    environment = jinja2.Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    environment.filters |= {"number": number, "milli": milli}
    return environment.from_string(template).render(
        title=params.title,
        excluded=tables["excluded"].to_dict("records"),
        checks=_text(inputs.checks).to_dict("records"),
        summary=_text(inputs.summary).to_dict("records"),
        overview=[_picture(path, known) for path in params.figures["campaign"]],
        pages=pages,
        assumptions=params.assumptions,
        choices=params.choices,
        environment_lock=next(iter(abouts.values()))["environment_lock"] if abouts else "",
        artefacts=len(abouts),
    )


def _text(path) -> pd.DataFrame:
    """A CSV table as it is written, for people: every cell text."""
    return pd.read_csv(path, dtype=str, keep_default_na=False)


def _of(table, name, column="cell") -> pd.DataFrame:
    return table[table[column] == name]


def milli(text) -> str:
    """Volts as millivolts; a dash for what is not known."""
    return f"{1e3 * float(text):.2f}" if text else "–"


def _said(path) -> dict:
    """The paragraph of an analysis that answers in words, or why it says nothing."""
    reason = artefact.read_about(path)["reason"]
    return {"text": reason or artefact.load(path)["paragraph"], "reason": reason}


def _witnesses(path) -> list[dict]:
    """Rows of the witnesses of a verdict, those that speak first; none without a verdict."""
    if artefact.read_about(path)["reason"] is not None:
        return []
    return sorted(artefact.rows(artefact.load(path)), key=lambda row: row["says"] == "silent")


def number(text) -> str:
    """Four significant digits for people; the tables hold more."""
    try:
        return f"{float(text):.4g}"
    except (TypeError, ValueError):
        return text


def _page(name, params, tables, abouts, known) -> dict:
    facts = next((row for row in params.cells if row["cell"] == name), {})
    branches = [row for row in params.groups if row["group"] == name]
    shown = {table: _of(tables[table], name) for table in TABLES_OF_CELL}
    shown["packs"] = _of(tables["packs"], name, "group")
    pictures = params.figures.get(name, [])
    unmodelled = facts and name not in params.modelled
    return {
        "name": name,
        "facts": {key: value for key, value in facts.items() if value not in (None, "")},
        "branches": branches,
        "tests": [_test(row, abouts) for row in params.tests if row["cell"] == name],
        "proofs": [_picture(path, known) for path in pictures if Path(path).stem in PROOFS],
        "pictures": [_picture(path, known) for path in pictures if Path(path).stem not in PROOFS],
        "choice": _choice(_of(tables["choice"], name)),
        "tables": {table: _short(rows) for table, rows in shown.items() if len(rows)},
        "notes": [*([NO_MODEL] if unmodelled else []), *_notes(name, abouts)],
    }


def _choice(rows) -> dict:
    """Errors of each member by temperature, and why it is the chosen one or not; none: empty."""
    members = {
        model: {
            "chosen": own["chosen"].iloc[0] == "True",
            "reason": own["reason"].iloc[0],
            "errors": own.to_dict("records"),
        }
        for model, own in rows.groupby("model", sort=False)
    }
    celsius = rows["ambient_temperature_celsius"].unique().tolist()
    return {"celsius": celsius, "members": members} if members else {}


def _short(rows) -> dict:
    columns = rows.columns.drop(["cell", "group"], errors="ignore").tolist()
    more = max(len(rows) - SHOWN_ROWS, 0)
    return {"columns": columns, "rows": rows.head(SHOWN_ROWS).to_dict("records"), "more": more}


def _test(row, abouts) -> dict:
    mine = [about for about in abouts.values() if about["wildcards"].get("test") == row["test"]]
    mine = [about for about in mine if _owner(about) == row["cell"]]
    reasons = list(dict.fromkeys(about["reason"] for about in mine if about["reason"]))
    return row | {"reasons": reasons}


def _notes(name, abouts) -> list[dict]:
    notes = {}
    mine = [about for about in abouts.values() if _owner(about) == name]
    said = [(note, one["wildcards"].get("test", "")) for one in mine for note in one["notes"]]
    for note, test in said:
        notes.setdefault(note, set()).add(test)
    return [{"text": text, "tests": sorted(tests - {""})} for text, tests in notes.items()]


def _owner(about):
    return about["wildcards"].get("cell") or about["wildcards"].get("group")


def _picture(path, known) -> dict:
    name = Path(path).stem
    fitting = [kind for kind in known if name == kind or name.startswith(f"{kind}_")]
    kind = max(fitting, key=len, default=None)
    caption = known.get(kind, {"title": name, "read": ""})
    data = base64.b64encode(Path(path).read_bytes()).decode()
    test = name.removeprefix(f"{kind}_") if kind and name != kind else ""
    return {"title": caption["title"], "read": caption["read"], "test": test, "data": data}
