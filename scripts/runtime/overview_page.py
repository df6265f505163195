"""The report's first screen: which cells, how healthy, how well modelled, what to look at first."""

from markupsafe import Markup, escape

from cellwright.circuits.circuit import OPTIONS
from cellwright.effects.story.words import name_of_effect
from runtime import sheets
from runtime.page_tables import DIGITS, Cell, duration, link, measured, plain_table, std_name

# What makes a cell one to look at, the gravest first; the rest are the extremes of its type.
FAILED, DOUBTED, LEFT_OUT, LEAST_HEALTHY, LEAST_ACCURATE, MOST_RESISTANT, NOTHING = range(7)
FIRST = 6  # so many cells are listed above the table; the table marks all
LATE_SECOND = 1.0  # by then a cell answers with its resistance, and begins to polarise
FEW = 34  # letters of a reason that fit beside the numbers of a cell
# Column of the summary, whether its largest or smallest is the worst, what is then said, also in
# few words, and its unit.
EXTREMES = {
    LEAST_HEALTHY: ("soh", min, "lowest state of health", "lowest SoH", "%", 1e2),
    LEAST_ACCURATE: (
        "validation_rmse_volt",
        max,
        "largest model error",
        "largest error",
        "mV",
        1e3,
    ),
    MOST_RESISTANT: ("r0_50_25_ohm", max, "highest R0", "highest R0", "mΩ", 1e3),
}
COLUMNS = ["cell", "type", "capacity [Ah]", "SoH [%]", "R0 [mΩ]", "model error [mV]"]
COLUMNS += ["SoC error [%]", "model lacks", "to look at"]
READ = (
    "First what fails a check, is in doubt or was left out; then the worst of each type (▲); then "
    "by state of health. ± is a standard deviation, blank not known, ? not sure. R0: first sample "
    "of a pulse at 50 % SoC, 25 °C. Model error: RMS of the tests not fitted, and its range."
)
BASES = {"DRT": "resistances on a series of time constants"}


def model_in_words(name) -> str:
    """A member of the family in words, such as `two RC pairs, hysteresis`."""
    base, *options = name.split("+")
    words = [BASES.get(base) or base.replace("RC", " RC pairs").replace("1 RC pairs", "1 RC pair")]
    words += [OPTIONS.get(one, f"{one} that were found") for one in options]
    return ", ".join(words)


def section(cells, summary, tables, checks) -> dict:
    """What the overview shows: digest (name, words), first (cells to look at), table.

    `cells` are rows of cells.tsv, `summary` and `checks` rows of the tables so named, as text,
    `tables` frames of text by name.
    """
    types = {row["cell"]: sheets.type_name(row) for row in cells}
    reasons = reasons_by_cell(summary, tables["excluded"].to_dict("records"), checks, types)
    about = ("validation", "missing_effect", "resistance_definitions")
    told = {name: _by_cell(tables[name].to_dict("records")) for name in about}
    order = sorted(summary, key=lambda row: _rank(row, reasons.get(row["cell"], ())))
    rows = []
    for row in order:
        name = row["cell"]
        parts = [told[one].get(name, []) for one in about]
        rows.append(_row(row, types.get(name, ""), reasons.get(name, []), *parts))
    of_why = {}
    for row in order:
        if row["cell"] in reasons:
            why = "; ".join(text for _, text, _ in reasons[row["cell"]])
            of_why.setdefault(why, []).append(row["cell"])
    first = [{"link": links(cells), "why": why} for why, cells in of_why.items()]
    return {
        "types": sorted(set(types.values()) - {""}),
        "first": first[:FIRST],
        "more": max(len(first) - FIRST, 0),
        "digest": digest(summary, types, tables["excluded"], checks),
        "table": plain_table(
            *("cells", "Cells, what to look at first on top", READ, COLUMNS, rows),
            made="results/summary.csv",
        ),
        "marks": [{"type": types.get(r["cell"], ""), "look": r["cell"] in reasons} for r in order],
    }


def links(cells) -> Markup:
    """Links to the pages of cells of which one thing is said, all in a line."""
    return Markup(", ").join(map(link, cells))


def reasons_by_cell(summary, excluded, checks, types) -> dict:
    """Why each cell is one to look at: lists of (gravity, words, few words), the gravest first."""
    found = {}

    def add(cell, gravity, words, few=None):
        found.setdefault(cell, []).append((gravity, words, few or _shortened(words)))

    for cell, rows in _by_cell([row for row in checks if row["outcome"] == "failed"]).items():
        add(cell, FAILED, f"a check fails: {rows[0]['found']}{_more(rows)}")
    for row in summary:
        if row.get("doubt"):
            add(row["cell"], DOUBTED, f"in doubt: {row['doubt']}")
    for cell, rows in _by_cell(excluded).items():
        test = f"{rows[0]['test']}: " if rows[0]["test"] else ""
        add(cell, LEFT_OUT, f"left out: {test}{rows[0]['reason']}{_more(rows)}")
    for gravity, (column, worst_of, words, few, unit, scale) in EXTREMES.items():
        for kind, rows in _by_type(summary, types, column).items():
            worst = worst_of(rows, key=lambda row: float(row[column]))
            if len({row[column] for row in rows}) > 1:
                size = measured(worst[column], worst.get(std_name(column, worst)), scale)
                said = f"{words}{f' of {kind}' if kind else ''}: {size} {unit}"
                add(worst["cell"], gravity, said, few)
    return found


def digest(summary, types, excluded, checks) -> list:
    """The campaign in a few numbers: (name, words)."""
    kinds, verdicts = len(set(types.values())), [row["verdict"] for row in summary]
    sought = [word for word in verdicts if word]
    laws = {row["check"] for row in checks}
    failed = {row["check"] for row in checks if row["outcome"] == "failed"}
    named = sum(word in ("named", "ambiguous") for word in sought)
    unknown = sum(word == "unknown" for word in sought)
    found = f"named in {named} of {len(sought)} cells, unknown in {unknown}"
    doubted = sum(bool(row.get("doubt")) for row in summary)
    return [
        ("cells", f"{len(summary)}" + (f" of {kinds} types" if kinds > 1 else "")),
        ("state of health", _span(summary, "soh", 1e2, "%")),
        ("model error", _span(summary, "validation_rmse_volt", 1e3, "mV")),
        ("missing effects", found if sought else "not searched"),
        ("left out", f"{len(excluded)}, see below" if len(excluded) else "nothing"),
        ("in doubt", f"{doubted} of {len(summary)} cells"),
        ("checks by physics", f"{len(laws) - len(failed)} of {len(laws)} hold"),
    ]


def _span(rows, column, scale, unit) -> str:
    known = [scale * float(row[column]) for row in rows if row.get(column)]
    if not known:
        return "not known"
    ends = dict.fromkeys(f"{one:.3g}" for one in (min(known), max(known)))
    of_all = f" ({len(known)} of {len(rows)} known)" if len(known) < len(rows) else ""
    return f"{' to '.join(ends)} {unit}{of_all}"


def _row(row, kind, reasons, scored, effects, definitions) -> list:
    """Cells of the table of one cell."""
    marked = {gravity for gravity, *_ in reasons}
    return [
        Cell(link(row["cell"]), row["cell"]),
        Cell(kind, kind),
        _number(row, "capacity_ampere_hour", 1.0),
        _number(row, "soh", 1e2, LEAST_HEALTHY in marked),
        _number(row, "r0_50_25_ohm", 1e3, MOST_RESISTANT in marked, _when(definitions)),
        _number(row, "validation_rmse_volt", 1e3, LEAST_ACCURATE in marked, _range_of(scored)),
        _number(row, "soc_rmse", 1e2),
        Cell(*_effects(row, effects)),
        Cell(_why(row, reasons), str(min(marked, default=NOTHING))),
    ]


def _number(row, column, scale, worst=False, beside="") -> Cell:
    text = row.get(column) or ""
    # Of an error three digits are more than anyone compares; of a capacity four are usual.
    digits = DIGITS if column in ("capacity_ampere_hour", "soh") else DIGITS - 1
    size = measured(text, row.get(std_name(column, row)), scale, digits)
    words = f"{size}{' ▲' if worst else ''}{f' {beside}' if beside and size else ''}"
    return Cell(words, str(scale * float(text)) if text else "", "worst" if worst else "")


def _when(definitions):
    """How late the pulse's first sample is, where polarisation makes up much of it by then."""
    late = [r for r in definitions if r["name"] == "R0" and float(r["delay_second"]) > LATE_SECOND]
    return f"after {duration(late[0]['delay_second'])}" if late else ""


def _range_of(scored):
    """The range of errors over the tests of the model in use [mV], where there are several."""
    rms = [1e3 * float(r["rmse_volt"]) for r in scored if r["chosen"] == "True" and r["rmse_volt"]]
    if len(rms) < 2:
        return ""
    low, high = (float(f"{one:.2g}") for one in (min(rms), max(rms)))
    return f"({low:g}–{high:g})"


def _effects(row, effects):
    """Names of what a cell's model lacks, the unsure with a question mark, and what to sort by."""
    named = [one for one in effects if one["effect"]]
    words = [
        f"{name_of_effect(one['effect'])}{'' if one.get('sure') == 'True' else ' ?'}"
        for one in named
    ]
    if not words:
        said = {"none": "nothing", "unknown": "something without a name"}
        return said.get(row["verdict"], ""), ""
    more = f" + {len(words) - 1}" if len(words) > 1 else ""
    return f"{words[0]}{more}", ", ".join(words)


def _why(row, reasons) -> Markup:
    """The gravest reason in few words, and all of them and the verdict behind a click."""
    verdict = row.get("in_one_line") or ""
    texts = [text for _, text, _ in reasons] + ([f"{row['cell']} {verdict}."] if verdict else [])
    if not texts:
        return Markup("")
    lines = Markup("").join(Markup("<p>{}</p>").format(text) for text in texts)
    summary = escape(reasons[0][2] if reasons else "verdict")
    return Markup("<details><summary>{}</summary>{}</details>").format(summary, lines)


def _shortened(text):
    return text if len(text) < FEW else f"{text[: FEW - 2].rsplit(' ', 1)[0]} …"


def _rank(row, reasons):
    soh = float(row["soh"]) if row.get("soh") else float("inf")
    return min((gravity for gravity, *_ in reasons), default=NOTHING), soh


def _more(rows):
    return f" (and {len(rows) - 1} more)" if len(rows) > 1 else ""


def _by_cell(rows) -> dict:
    found = {}
    for row in rows:
        if row.get("cell"):
            found.setdefault(row["cell"], []).append(row)
    return found


def _by_type(summary, types, column) -> dict:
    found = {}
    for row in summary:
        if row.get(column):
            found.setdefault(types.get(row["cell"], ""), []).append(row)
    return found
