"""The report: one HTML file with tables, figures and notes of every cell and group.

A small report is plain HTML, and all of it can be read without a script. In a large one each cell's
page lies compressed and is unpacked in the browser when it is looked at, so that a report of
hundreds of cells opens at once and still is one file to send and to keep.
"""

import base64
import hashlib
import traceback
from pathlib import Path

import jinja2
import pandas as pd
import yaml
from markupsafe import Markup, escape

from cellwright.effects.story.messages import say
from cellwright.effects.story.places import largest_before
from cellwright.effects.story.words import KNOWN, name_of_effect, name_of_key, sentences_by_part
from cellwright.laws.points import level_means
from cellwright.records.conditions import SAME_CELSIUS
from runtime import (
    artefact,
    closer_look,
    compare_page,
    health_page,
    laws_page,
    overview_page,
    pack_page,
    sheets,
    use_page,
)
from runtime.csv_cells import frame_as_written
from runtime.page_tables import (
    Cell,
    duration,
    fact_in_words,
    figure_of,
    link,
    measured,
    packed,
    plain_table,
    table_of,
)

PACK_TABLES = ["packs", "series_packs", "nested_packs"]
TABLES_OF_PAGE = [
    "capacity",
    "capacity_between_rests",
    "ica",
    "ica_discharge",
    "eis",
    "temperature",
    "validation",
    "soc",
]
TABLES_OF_PAGE += [
    "resistance_definitions",
    "activation_energies",
    "choice",
    "missing_effect",
    "pack_checks",
]
TABLES_OF_PAGE += PACK_TABLES
FLEET = (
    "What each effect takes off the error of the plain model on tests that took no part in its "
    "fit, in mV. A question mark: not sure, see the cell's page; or: one name of a tie; n/t: its "
    "tests cannot show it; blank: not shown."
)
TEMPLATES = Path(__file__).resolve().parents[2] / "workflow" / "report"
# Long, and on no page.
UNREAD = {"models", "models_of_checkups", "resistance", "relaxation", "ica_tracks"}
# Of the pulses only what a reader compares, and what tells why a cell has no R0, is read.
OF_PULSES = ["cell", "test", "direction", "ambient_temperature_celsius", "soc", "delay_second"]
OF_PULSES += ["resistance_ohm"]
OF_HEALTH = ("lives", "fleet")  # pictures of the overview that stand in its part on health
# All pages of a report up to this stand in it as they are, and are read without a script: what a
# mail of 25 MB carries, which adds a third to a file. Larger ones are packed, and need the script.
PLAIN_BYTES = 16_000_000


def render(job) -> str:
    """The report as one HTML text, from the inputs and params of rule `report`."""
    inputs, params = job.input, job.params
    tables = {Path(p).stem: _text(p) for p in inputs.tables if Path(p).stem not in UNREAD}
    for path in (p for p in inputs.tables if Path(p).stem == "resistance"):
        tables["resistance"] = _text(path, OF_PULSES)
    abouts = {path: artefact.read_about(path) for path in inputs.artefacts}
    layout = {"captions": "captions.yaml", "chapters": "chapters.yaml", "specs": "tables.yaml"}
    layout = {name: _yaml(TEMPLATES / file) for name, file in layout.items()}
    owners = [row["cell"] for row in params.cells]
    found = {_owner(artefact.read_about(path)): _verdict(path) for path in inputs.verdicts}
    for columns, about in artefact.load_all(inputs.maps):
        told, sentence = found.get(_owner(about), {}).get("story", {}), largest_before(columns)
        if "names" in told and sentence:
            told["left"] = [sentence, *told.get("left", [])]
    witnesses = {_owner(artefact.read_about(p)): _witnesses(p) for p in inputs.witnesses}
    cold = {_owner(artefact.read_about(path)): _paragraph(path) for path in inputs.cold}
    groups = list(dict.fromkeys(row["group"] for row in params.groups))
    # Sorted to their owners once: a look through all artefacts for each page grows with the square.
    abouts_of = {}
    for about in abouts.values():
        abouts_of.setdefault(_owner(about), []).append(about)
    summary, checks = (_text(path).to_dict("records") for path in (inputs.summary, inputs.checks))
    excluded = tables["excluded"].to_dict("records")
    parts = _by_owner(tables, owners + groups)
    sums = {row["cell"]: row for row in summary}
    environment = environment_of(TEMPLATES)
    environment.globals |= {"fact": fact_in_words, "again": params.run["again"]}
    environment.globals["uplot"] = {
        "script": Markup((TEMPLATES / "uplot/uPlot.iife.min.js").read_text(encoding="utf-8")),
        "style": Markup((TEMPLATES / "uplot/uPlot.min.css").read_text(encoding="utf-8")),
    }
    template, failed = environment.get_template("page.html.j2"), []

    def whole(name):
        """What the template shows of a cell or group, and all of it as HTML."""
        page = _page(name, params, parts[name], abouts_of.get(name, []), layout, looks)
        page |= {"effect": found.get(name), "cold": cold.get(name), "sum": sums.get(name, {})}
        page |= _tables_of_story(_rows(parts[name]["missing_effect"]), witnesses.get(name, []))
        if name in lookups:
            exports = rated[name], lookups[name], pybamm[name]
            page["use"] = part(f"the uses of {name}", use_page.table, name, *exports)
        page["excluded"] = [row for row in excluded if row["cell"] == name]
        page["broken"] = [r for r in checks if r["outcome"] == "failed" and r["cell"] == name]
        return page | {"html": template.render(page=page, number_of=Numbers(name))}

    def part(what, make, *arguments, otherwise=None):
        """A part of the report; one that cannot be made costs no other, and is told on top."""
        try:
            return make(*arguments)
        except Exception as error:
            failed.append(artefact.failure(error, f"to make {what} of this report"))
            _log(job, error)
            return otherwise

    models = _models_in_use(tables["validation"])
    looks = part("the closer looks", _looks, inputs.simulated, inputs.series, models)
    rated = {row["cell"]: row.get("rated_capacity_ampere_hour") for row in params.cells}
    exported = (inputs.lookups, inputs.pybamm)
    lookups, pybamm = ({Path(path).parent.name: path for path in paths} for paths in exported)
    pages = [
        part(f"the page {name}", whole, name) or _page_that_failed(name, owners, failed[-1])
        for name in owners + groups
    ]
    plain = sum(len(page["html"]) for page in pages) <= PLAIN_BYTES
    pages = [
        {key: page[key] for key in ("name", "facts", "warnings", "excluded")}
        | {"plain" if plain else "packed": Markup(page["html"]) if plain else packed(page["html"])}
        for page in pages
    ]
    pictures = [figure_of(path, layout["captions"]) for path in params.figures["the campaign"]]
    overview = part(
        "the overview", overview_page.section, params.cells, summary, tables, checks, otherwise={}
    )
    return environment.get_template("report.html.j2").render(
        title=params.title,
        excluded=excluded,
        exclusions=_exclusions(excluded),
        checks=checks,
        doubted=[row for row in summary if row.get("doubt")],
        overview=overview,
        compare=part(
            "the page Compare",
            compare_page.section,
            *(inputs.curves, inputs.simulated, tables["capacity"], tables.get("resistance")),
            models,
        ),
        fleet=part("the comparison of types", fleet_of, tables["fleet"]),
        health=part("the part on health", health_page.section, tables),
        packs=part("the part on packs", pack_page.section, tables, params.groups),
        health_table=health_page.table_of_section,
        packs_table=pack_page.table_of_section,
        failed=failed,
        pictures_of_health=[one for kind, one in pictures if kind in OF_HEALTH],
        pictures=[one for kind, one in pictures if kind not in OF_HEALTH],
        pages=pages,
        number_of=Numbers(),
        methods=_methods(_yaml(TEMPLATES / "methods.yaml"), tables, params.settings),
        run=params.run,
        assumptions=params.assumptions,
        choices=params.choices,
        environment_lock=next(iter(abouts.values()))["environment_lock"] if abouts else "",
        artefacts=len(abouts),
    )


def environment_of(folder) -> jinja2.Environment:
    """What templates of a folder are written by: all text escaped, numbers as people read them."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(folder),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"number": number, "milli": milli, "digest": digest}
    environment.filters |= {"css_string": css_string}
    environment.filters |= {"measured": measured, "duration": duration}
    environment.filters |= {"in_words": overview_page.model_in_words}
    return environment


class Numbers:
    """Numbers of the figures and tables of a page, as Figure C3.2: none twice in a report."""

    def __init__(self, name=""):
        self.stem = f"{name}." if name else ""
        self.last = {}

    def __call__(self, what) -> str:
        self.last[what] = self.last.get(what, 0) + 1
        return f"{what} {self.stem}{self.last[what]}"


def _exclusions(rows) -> list[dict]:
    """What was left out, each reason once with the cells and tests that it is of."""
    of_reason = {}
    for row in rows:
        of_reason.setdefault((row["test"], row["stage"], row["reason"]), []).append(row)
    return [
        {"of": overview_page.links(row["cell"] for row in same if row["cell"])}
        | {"test": test, "stage": stage, "reason": reason}
        | {"file": "; ".join(dict.fromkeys(row["file"] for row in same if row["file"]))}
        for (test, stage, reason), same in of_reason.items()
    ]


def _yaml(path):
    return yaml.safe_load(Path(path).read_text(encoding="utf-8"))


def _methods(sections, tables, settings) -> list[dict]:
    """Sections of the methods text of which the campaign has results, with their settings."""
    return [
        one | {"settings": {name: settings[name] for name in one["settings"] if name in settings}}
        for one in sections
        if any(len(tables.get(table, ())) for table in one["tables"])
    ]


def _page_that_failed(name, cells, said) -> dict:
    """A page of one sentence, that of a cell with a fact, by which the template tells it."""
    html = f"<h1>{escape(name)}</h1><div class='excluded'>{escape(said)}</div>"
    facts = {"cell": name} if name in cells else {}
    return {"name": name, "facts": facts, "warnings": [], "excluded": [], "html": html}


def _log(job, error):
    for path in getattr(job, "log", []):
        with open(path, "a", encoding="utf-8") as file:
            file.write("".join(traceback.format_exception(error)))


def digest(text: str) -> Markup:
    """A text as the report's security policy names it: the only script and style that it allows."""
    found = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
    return Markup(f"'sha256-{found}'")


def css_string(text: str) -> Markup:
    """A text as a string of a style sheet: nothing in it ends the string or the sheet."""
    safe = "".join(f"\\{ord(one):x} " if one in '\\"<>&' or one < " " else one for one in text)
    return Markup(f'"{safe}"')


def fleet_of(table: pd.DataFrame) -> list[dict]:
    """Each type of tables/fleet: its sentence, and a table with a row a cell, a column an effect.

    A word is the size of an effect in millivolt, with a question mark where it is not sure.
    """
    types = []
    for name, rows in table.groupby("type", sort=False):
        shown = rows[rows["effect"] != ""]
        effects = list(dict.fromkeys(shown["effect"]))
        words = {(row["cell"], row["effect"]): _fleet_word(row) for _, row in shown.iterrows()}
        lines = [
            [link(cell), *(Cell(*words[cell, effect]) for effect in effects)]
            for cell in dict.fromkeys(shown["cell"])
        ]
        columns = ["cell", *map(name_of_effect, effects)]
        about, made = (f"effects-{len(types) + 1}", name, FLEET), "results/tables/fleet.csv"
        matrix = plain_table(*about, columns, lines, made=made)
        sentence = rows["sentence"].iloc[0]
        types.append({"name": name, "sentence": sentence, "matrix": matrix if effects else None})
    return types


def _unsure(rows) -> list:
    """What makes names unsure, in words: the same reasons once, with the names that they are of."""
    names = {}
    for row in rows:
        if row["sure"] == "False":
            names.setdefault(row["doubts"], []).append(_name(row))
    return [f"{', '.join(effects)}: {reasons}" for reasons, effects in names.items()]


def _name(row):
    """An effect of tables/missing_effect in words, of a group with its branch."""
    branch = row["branch"].partition(";")[0]
    return name_of_effect(row["effect"]) + (f" (branch {branch})" if branch else "")


def _as_good(row):
    """What explains the data as well as an effect of tables/missing_effect, in words."""
    names = [name_of_effect(name) for name in row["alternatives"].split(";") if name]
    return [*names, *(f"branch {branch}" for branch in row["branch"].split(";")[1:])]


def _fleet_word(row) -> tuple:
    """Text, key and mark of one cell of the matrix of effects."""
    if row["shown"] in ("sure", "unsure"):
        size = f"{1e3 * float(row['size_volt']):.2g}"
        return f"{size}{'' if row['shown'] == 'sure' else ' ?'}", size, row["shown"]
    return {"no": ("",), "not testable": ("n/t",), "or another": ("or", "", "unsure")}[row["shown"]]


def _text(path, columns=None) -> pd.DataFrame:
    """A CSV table for people, all of it or some `columns`: every cell text."""
    table = pd.read_csv(path, dtype=str, keep_default_na=False, usecols=columns)
    return frame_as_written(table)


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


def _verdict(path) -> dict:
    """The paragraph of a verdict, its sentences by part of the story, and what else was tried."""
    told = _paragraph(path) | {"story": {}, "against": None}
    verdict = {} if told["reason"] else artefact.load(path)
    named = [one["effect"] for one in verdict.get("effects", ())]
    # Of effects that only a laboratory knows the paragraph says it all.
    if "located_at" not in verdict or not set(named) <= set(KNOWN):
        return told
    for part, sentence in sentences_by_part(verdict, KNOWN):
        told["story"].setdefault(part, []).append(sentence)
    against = (verdict.get("against") or {}).items()
    lines = [
        (name_of_key(one), say(f"against.{code}")) for one, code in against if one not in named
    ]
    if lines:
        read = "Each was added to the model in turn, and is not named for these reasons."
        columns = ["effect", "why it is no name"]
        about = "against", "What else was tried", read
        told["against"] = plain_table(*about, columns, lines, made=Path(path).as_posix())
    return told


def number(text) -> str:
    """Four significant digits for people; the tables hold more."""
    try:
        return f"{float(text):.4g}"
    except (TypeError, ValueError):
        return text


def _models_in_use(validation) -> dict:
    """The model in use by (cell, test), of rows of table `validation`."""
    chosen = validation[validation["chosen"] == "True"]
    return {(row["cell"], row["test"]): row["model"] for row in _rows(chosen)}


def _looks(simulated, series, models) -> dict:
    """What may be zoomed into, by cell and name of the figure."""
    looks = closer_look.looks_of(simulated, series, models)
    return {(cell, f"validation_{test}"): lines for (cell, test), lines in looks.items()}


def _page(name, params, tables, abouts, layout, looks) -> dict:
    """What the template shows of a cell or group, from its own rows of tables and artefacts."""
    facts = next((row for row in params.cells if row["cell"] == name), {})
    branches = [row for row in params.groups if row["group"] == name]
    pictures = [figure_of(path, layout["captions"]) for path in params.figures.get(name, [])]
    pictures = [
        (kind, one._replace(lines=(looks or {}).get((name, one.id), ""))) for kind, one in pictures
    ]
    definitions = tables["resistance_definitions"].to_dict("records")
    return {
        "name": name,
        "type": sheets.type_name(facts),
        "facts": {key: value for key, value in facts.items() if value not in (None, "")},
        "unsure": _unsure(_rows(tables["missing_effect"])),
        "branches": branches,
        "wiring": pack_page.wiring_in_words(name, params.groups) if branches else "",
        "warnings": pack_page.warnings(tables["pack_checks"], abouts),
        "tests": _tests([row for row in params.tests if row["cell"] == name], abouts),
        "chapters": _chapters(tables, pictures, layout),
        "choice": _choice(tables["choice"]),
        "r0": definitions[0] if definitions and definitions[0]["name"] == "R0" else {},
        "energy": _energy_of_r0(tables["activation_energies"]),
        "scored": [row for row in _rows(tables["validation"]) if row["chosen"] == "True"],
        "notes": [*_without_model(abouts), *_notes(abouts)],
    }


def _energy_of_r0(energies) -> dict:
    """Reconciled activation energy of R0, {} where nothing tells it."""
    of_r0 = (row for row in _rows(energies) if row["quantity"] == "R0")
    return next((row for row in of_r0 if row["name"] == "reconciled"), {})


def _chapters(tables, pictures, layout) -> list[dict]:
    """Chapters of a page with their tables and figures, in the order of chapters.yaml."""
    placed = {kind for one in layout["chapters"] for kind in one.get("figures", ())}
    chapters = []
    for one in layout["chapters"]:
        shown = {
            place: [
                laws_page.table(tables[name])
                if name == "temperature"
                else table_of(name, tables[name], layout["specs"][name])
                for name in one.get(place, ())
                if len(tables[name])
            ]
            for place in ("first", "tables")
        }
        kinds = one.get("figures", ())
        # A figure of no chapter is shown too, in the last one that has any.
        own = [(kind, p) for kind, p in pictures if kind in kinds]
        own += [(k, p) for k, p in pictures if k not in placed] if one["id"] == "records" else []
        undrawn = {}
        for _, picture in own:
            if picture.reason:
                undrawn.setdefault(picture.reason, []).append(picture.title)
        own = [(kind, picture) for kind, picture in own if not picture.reason]
        about = {"id": one["id"], "title": one["title"], "figures": own, "undrawn": undrawn}
        chapters.append(about | {place: list(filter(None, shown[place])) for place in shown})
    return chapters


def _rows(frame):
    return frame.to_dict("records")


def _choice(rows):
    """Table of the errors of each member by temperature and the reason of the choice, or None."""
    if not len(rows):
        return None
    # Members with effects go by the temperature that was measured, others by the sheet's.
    stated, lines = rows["ambient_temperature_celsius"], []
    levels = level_means(map(float, filter(None, stated)), apart=SAME_CELSIUS)
    rows = rows.assign(at=[levels[float(one)] if one else one for one in stated])
    celsius = dict(zip(rows["at"][::-1], stated[::-1], strict=True))  # of each level the first
    celsius = {at: celsius[at] for at in rows["at"]}
    for model, part in rows.groupby("model", sort=False):
        found = {
            one["at"]: f"{milli(one['left_out_rmse_volt'])} ({milli(one['fit_rmse_volt'])})"
            for one in _rows(part)
        }
        errors = [found.get(at, "") for at in celsius]
        mark = "chosen" if part["chosen"].iloc[0] == "True" else ""
        lines.append([Cell(model, mark=mark), *errors, part["reason"].iloc[0]])
    heads = (f"{number(one)} °C [mV]" if one else "[mV]" for one in celsius.values())
    columns = ["model", *heads, "why, or why not"]
    read = (
        "RMS error of blocks left out of the fit at each temperature; in brackets of the finished "
        "model through the records it was fitted to, SoC 5–95 %. Tests for validation took no "
        "part. Members compare by the geometric mean over blocks, which one bad block does not "
        "decide."
    )
    doubts = dict.fromkeys(one for one in rows["doubt"] if one)
    read += f" In doubt: {'; '.join(doubts)}." if doubts else ""
    made = "results/tables/choice.csv"
    return plain_table("choice", "Why this model", read, columns, lines, made=made)


def _tests(rows, abouts):
    """Table of the tests of a cell or group, with the reasons why some could not be used; or None.

    `rows` are of tests.tsv, `abouts` what the artefacts say of themselves.
    """
    reasons = {}
    for about in abouts:
        if about["reason"]:
            reasons.setdefault(about["wildcards"].get("test"), {})[about["reason"]] = None
    names = ("test", "kind", "ambient_temperature_celsius", "cycle", "soc", "role")
    lines = []
    for row in rows:
        why = list(reasons.get(row["test"], ()))
        told = row | {"soc": None if row["soc"] is None else 100 * row["soc"]}
        told = ["" if told[name] is None else told[name] for name in names]
        values = [f"{value:g}" if isinstance(value, float) else str(value) for value in told]
        lines.append([*values, row["note"] or "", Cell("; ".join(why), mark="wrong")])
    columns = ["test", "kind", "chamber [°C]", "cycle", "SoC at start [%]", "role", "note"]
    columns += ["could not be used"]
    if not any(line[-1].text for line in lines):
        columns, lines = columns[:-1], [line[:-1] for line in lines]
    read = "As tests.tsv states them; in red why a test, or a part of it, could not be used."
    return plain_table("tests", "Tests", read, columns, lines) if rows else None


def _tables_of_story(verdicts, witnesses) -> dict:
    """Tables of what was named and how sure it is, and of what other measurements say; or None."""
    found = {"named": None, "witnesses": None}
    if verdicts:
        names = ("next_test", "in_one_line", "of_model_in_use")
        found |= {name: verdicts[0][name] for name in names}
    if any(one["effect"] for one in verdicts):
        sure = {"True": "sure", "False": "unsure: {}"}
        lines = [
            [
                _name(one),
                sure.get(one["sure"], "–").format(one["doubts"]),
                ", ".join(_as_good(one)),
                f"{milli(one['rmse_before_volt'])} → {milli(one['rmse_after_volt'])}",
                f"{milli(one['validation_before_volt'])} → {milli(one['validation_after_volt'])}",
                f"{milli(one['without_part_volt'])} → {milli(one['with_part_volt'])}",
            ]
            for one in verdicts
            if one["effect"]
        ]
        columns = ["effect", "how sure", "as good", "tests fitted [mV]", "tests not fitted [mV]"]
        read = "RMS error of the model without the effect → with it, beside all others."
        in_use, ends = verdicts[0]["in_use"], ("in_use_fit_volt", "validation_member_volt")
        if in_use:
            end = [f"model in use: {in_use}", "", "", *(milli(verdicts[0][one]) for one in ends)]
            lines.append([*end, ""])
            read += " Last the model in use on the same tests."
        if any(one["part"] for one in verdicts):
            columns += ["part of the model in use [mV]"]
            read += " Of the part of it that an effect is: on blocks left out of its fit."
        lines = [line[: len(columns)] for line in lines]
        about, made = ("named", "What was named", read), "results/tables/missing_effect.csv"
        found["named"] = plain_table(*about, columns, lines, made=made)
    if witnesses:
        lines = [
            [
                row["name"],
                f"{name_of_effect(row['effect'])}{'' if row['named'] else ' (not named)'}",
                Cell(row["says"], mark="wrong" if row["says"] == "contradicts" else ""),
                row["text"],
            ]
            for row in witnesses
        ]
        read = (
            "Each is made without the search. It agrees where its number and the verdict's lie "
            "within two standard deviations, or, where none is stated, have one sign and sizes "
            "within a factor of 1.5."
        )
        title = "What other measurements say of it"
        columns = ["measurement", "effect", "says", "why"]
        made = "results/tables/missing_effect.csv"
        found["witnesses"] = plain_table("witnesses", title, read, columns, lines, made=made)
    return found


def _without_model(abouts) -> list[dict]:
    """What a cell lacks for a model and a simulation, where it has none."""
    reasons = [about["reason"] for about in abouts if about["rule"] == "no_model"]
    return [{"text": f"{reason[0].upper()}{reason[1:]}.", "tests": []} for reason in reasons]


def _notes(abouts) -> list[dict]:
    """Notes of artefacts: what is said of many quantities, tests or models in the same words once.

    `notes_of` of an artefact says what each of its notes is said of, "" where of nothing.
    """
    tests_of = {}
    for about in abouts:
        subjects = about.get("notes_of") or [""] * len(about["notes"])
        for note, of in zip(about["notes"], subjects, strict=True):
            said = of, note.removeprefix(f"{of}: ")
            tests_of.setdefault(said, set()).add(about["wildcards"].get("test", ""))
    alike = {}
    for (of, words), tests in tests_of.items():
        alike.setdefault((words, *sorted(tests - {""})), []).append(of)
    return [
        {"text": f"{'; '.join(filter(None, of))}: {words}" if any(of) else words, "tests": tests}
        for (words, *tests), of in alike.items()
    ]


def _owner(about):
    return about["wildcards"].get("cell") or about["wildcards"].get("group")
