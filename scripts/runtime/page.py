"""The report: one HTML file with tables, figures and notes of every cell and group.

Each cell's page lies in it compressed and is unpacked in the browser when it is looked at, so that
a report of a hundred cells opens at once and still is one file to send and to keep.
"""

import base64
import hashlib
import re
import traceback
from pathlib import Path

import jinja2
import pandas as pd
import pyarrow as pa
import yaml
from markupsafe import Markup, escape

from runtime import artefact, health_page, pack_page
from runtime.csv_cells import frame_as_written

TABLES_OF_CELL = ["capacity", "ica", "eis", "temperature", "validation", "soc"]
PACK_TABLES = ["packs", "series_packs", "nested_packs"]
TABLES_OF_PAGE = [*TABLES_OF_CELL, *PACK_TABLES, "pack_checks"]
TABLES_OF_PAGE += ["choice", "missing_effect"]
SHOWN_ROWS = 60
NAMES = ["validation", "branches", "map", "evidence", "ranking", "confounding"]
PROOFS = [f"effect_{name}" for name in NAMES]
OF_HEALTH = ("lives", "fleet")  # pictures of the overview that stand in its part on health


def render(job) -> str:
    """The report as one HTML text, from the inputs and params of rule `report`."""
    inputs, params = job.input, job.params
    tables = {Path(path).stem: _text(path) for path in inputs.tables}
    abouts = {path: artefact.read_about(path) for path in inputs.artefacts}
    captions = yaml.safe_load(Path(inputs.captions).read_text(encoding="utf-8"))
    owners = [row["cell"] for row in params.cells]
    effects = {_owner(artefact.read_about(path)): _paragraph(path) for path in inputs.verdicts}
    witnesses = {_owner(artefact.read_about(p)): _witnesses(p) for p in inputs.witnesses}
    cold = {_owner(artefact.read_about(path)): _paragraph(path) for path in inputs.cold}
    groups = list(dict.fromkeys(row["group"] for row in params.groups))
    # Sorted to their owners once: a look through all artefacts for each page grows with the square.
    abouts_of = {}
    for about in abouts.values():
        abouts_of.setdefault(_owner(about), []).append(about)
    parts = _by_owner(tables, owners + groups)
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(inputs.template).parent),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"number": number, "milli": milli, "digest": digest}
    excluded = tables["excluded"].to_dict("records")
    template = environment.get_template(Path(inputs.page).name)
    campaign, failed = params.figures["the campaign"], []
    checks = _text(inputs.checks).to_dict("records")

    def whole(name):
        """What the template shows of a cell or group, and all of it packed."""
        page = _page(name, params, parts[name], abouts_of.get(name, []), captions)
        page |= {"effect": effects.get(name), "cold": cold.get(name)}
        page["witnesses"] = witnesses.get(name, [])
        page["verdicts"] = parts[name]["missing_effect"].to_dict("records")
        # Packed one by one, or a report of a hundred cells is tens of megabytes when it opens.
        broken = [row for row in checks if row["outcome"] == "failed" and row["cell"] == name]
        html = template.render(page=page, excluded=excluded, broken=broken)
        return page | {"packed": packed(html)}

    def part(what, make, *arguments, otherwise=None):
        """A part of the report; one that cannot be made costs no other, and is told on top."""
        try:
            return make(*arguments)
        except Exception as error:
            failed.append(artefact.failure(error, f"to make {what} of this report"))
            _log(job, error)
            return otherwise

    pages = [
        part(f"the page {name}", whole, name) or _page_that_failed(name, owners, failed[-1])
        for name in owners + groups
    ]
    return environment.get_template(Path(inputs.template).name).render(
        title=params.title,
        excluded=excluded,
        checks=checks,
        summary=_text(inputs.summary).to_dict("records"),
        fleet=part("the comparison of types", fleet_of, tables["fleet"]),
        health=part("the part on health", health_page.section, tables),
        packs=part("the part on packs", pack_page.section, tables, params.groups),
        failed=failed,
        pictures_of_health=[_picture(p, captions) for p in campaign if Path(p).stem in OF_HEALTH],
        overview=[_picture(p, captions) for p in campaign if Path(p).stem not in OF_HEALTH],
        pages=pages,
        assumptions=params.assumptions,
        choices=params.choices,
        environment_lock=next(iter(abouts.values()))["environment_lock"] if abouts else "",
        artefacts=len(abouts),
    )


def _page_that_failed(name, cells, said) -> dict:
    """A page of one sentence, that of a cell with a fact, by which the template tells it."""
    html = f"<h1>{escape(name)}</h1><div class='excluded'>{escape(said)}</div>"
    facts = {"cell": name} if name in cells else {}
    return {"name": name, "facts": facts, "warnings": [], "packed": packed(html)}


def _log(job, error):
    for path in getattr(job, "log", []):
        with open(path, "a", encoding="utf-8") as file:
            file.write("".join(traceback.format_exception(error)))


def digest(text: str) -> Markup:
    """A text as the report's security policy names it: the only script and style that it allows."""
    found = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
    return Markup(f"'sha256-{found}'")


def fleet_of(table: pd.DataFrame) -> list[dict]:
    """Each type of tables/fleet as a matrix, a row a cell and a column an effect, and its sentence.

    A word is the size of an effect in millivolt, with a question mark where it is not sure.
    """
    types = []
    for name, rows in table.groupby("type", sort=False):
        shown = rows[rows["effect"] != ""]
        effects = list(dict.fromkeys(shown["effect"]))
        words = {(row["cell"], row["effect"]): _fleet_word(row) for _, row in shown.iterrows()}
        cells = [
            {"cell": cell, "words": [words[cell, effect] for effect in effects]}
            for cell in dict.fromkeys(shown["cell"])
        ]
        sentence = rows["sentence"].iloc[0]
        types.append({"name": name, "sentence": sentence, "effects": effects, "rows": cells})
    return types


def _fleet_word(row) -> str:
    if row["shown"] in ("sure", "unsure"):
        return f"{1e3 * float(row['size_volt']):.2g}{'' if row['shown'] == 'sure' else ' ?'}"
    return {"no": "", "not testable": "n/t", "or another": "or"}[row["shown"]]


def packed(html: str) -> str:
    """A page as gzip in base64.

    By pyarrow's own compressor, whose version the locked environment holds: the same page then has
    the same bytes on any machine, which Python's, built on the system's, does not promise. Level 9
    takes three times as long for 3 % fewer bytes.
    """
    codec = pa.Codec("gzip", compression_level=6)
    return base64.b64encode(codec.compress(html.encode(), asbytes=True)).decode()


def _text(path) -> pd.DataFrame:
    """A CSV table for people: every cell text."""
    return frame_as_written(pd.read_csv(path, dtype=str, keep_default_na=False))


def _by_owner(tables, owners) -> dict:
    """Rows of each table for each cell and group.

    A table is divided once: a look through it for each page would take a time that grows with the
    square of the number of cells.
    """
    parts = {
        name: dict(iter(tables[name].groupby(_owned_by(name), sort=False)))
        for name in TABLES_OF_PAGE
    }
    return {
        owner: {name: part.get(owner, tables[name].iloc[:0]) for name, part in parts.items()}
        for owner in owners
    }


def _owned_by(table):
    return "group" if table in pack_page.TABLES else "cell"


def milli(text) -> str:
    """Volts as millivolts; a dash for what is not known."""
    return f"{1e3 * float(text):.2f}" if text else "–"


def _witnesses(path) -> list[dict]:
    """Rows of the witnesses of a verdict, those that speak first; none without a verdict."""
    if artefact.read_about(path)["reason"] is not None:
        return []
    return sorted(artefact.rows(artefact.load(path)), key=lambda row: row["says"] == "silent")


def _paragraph(path) -> dict:
    """The paragraph of an analysis, or the reason why it has none."""
    reason = artefact.read_about(path)["reason"]
    return {"text": reason or artefact.load(path)["paragraph"], "reason": reason}


def number(text) -> str:
    """Four significant digits for people; the tables hold more."""
    try:
        return f"{float(text):.4g}"
    except (TypeError, ValueError):
        return text


def _page(name, params, tables, abouts, captions) -> dict:
    """What the template shows of a cell or group, from its own rows of tables and artefacts."""
    facts = next((row for row in params.cells if row["cell"] == name), {})
    branches = [row for row in params.groups if row["group"] == name]
    shown = {table: tables[table] for table in [*TABLES_OF_CELL, *PACK_TABLES]}
    pictures = params.figures.get(name, [])
    return {
        "name": name,
        "facts": {key: value for key, value in facts.items() if value not in (None, "")},
        "branches": branches,
        "wiring": pack_page.wiring_in_words(name, params.groups) if branches else "",
        "warnings": pack_page.warnings(tables["pack_checks"], abouts),
        "tests": [_test(row, abouts) for row in params.tests if row["cell"] == name],
        "proofs": [_picture(path, captions) for path in pictures if Path(path).stem in PROOFS],
        "pictures": [
            _picture(path, captions) for path in pictures if Path(path).stem not in PROOFS
        ],
        "choice": _choice(tables["choice"]),
        "tables": {table: _short(rows) for table, rows in shown.items() if len(rows)},
        "notes": [*_without_model(abouts), *_notes(abouts)],
    }


def _choice(rows) -> dict:
    """Errors of each member by temperature and the reason of the choice; empty without members."""
    members = {
        model: {
            "chosen": part["chosen"].iloc[0] == "True",
            "reason": part["reason"].iloc[0],
            "errors": part.to_dict("records"),
        }
        for model, part in rows.groupby("model", sort=False)
    }
    celsius = rows["ambient_temperature_celsius"].unique().tolist()
    return {"celsius": celsius, "members": members} if members else {}


def _short(rows) -> dict:
    # The page is of one cell or group: its name in every row would only take room.
    columns = rows.columns.drop(["cell", "group"], errors="ignore").tolist()
    more = max(len(rows) - SHOWN_ROWS, 0)
    return {"columns": columns, "rows": rows.head(SHOWN_ROWS).to_dict("records"), "more": more}


def _test(row, abouts) -> dict:
    of_test = [about for about in abouts if about["wildcards"].get("test") == row["test"]]
    reasons = list(dict.fromkeys(about["reason"] for about in of_test if about["reason"]))
    return row | {"reasons": reasons}


def _without_model(abouts) -> list[dict]:
    """What a cell lacks for a model and a simulation, where it has none."""
    reasons = [about["reason"] for about in abouts if about["rule"] == "no_model"]
    return [{"text": f"{reason[0].upper()}{reason[1:]}.", "tests": []} for reason in reasons]


def _notes(abouts) -> list[dict]:
    notes = {}
    texts = [
        (note, about["wildcards"].get("test", "")) for about in abouts for note in about["notes"]
    ]
    for note, test in texts:
        notes.setdefault(note, set()).add(test)
    return [{"text": text, "tests": sorted(tests - {""})} for text, tests in notes.items()]


def _owner(about):
    return about["wildcards"].get("cell") or about["wildcards"].get("group")


def _picture(path, captions) -> dict:
    name = Path(path).stem
    # Names of tests may themselves have underscores: the longest kind that fits is meant.
    fitting = [kind for kind in captions if name == kind or name.startswith(f"{kind}_")]
    kind = max(fitting, key=len, default=None)
    caption = captions.get(kind, {"title": name, "read": ""})
    data = _as_url(Path(path).read_text(encoding="utf-8"))
    test = name.removeprefix(f"{kind}_") if kind and name != kind else ""
    return {"title": caption["title"], "read": caption["read"], "test": test, "data": data}


def _as_url(svg: str) -> str:
    """A picture as what follows `data:image/svg+xml,`, plain text that compresses well.

    Its provenance stays with the file of the figure: checksums do not compress, and nobody reads
    them in a picture.
    """
    drawing = re.sub(r"<(metadata|desc)>.*?</\1>", "", svg[svg.index("<svg") :], flags=re.S)
    return drawing.replace("%", "%25").replace("#", "%23").replace("\n", "%0A")
