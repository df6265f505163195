"""The report's first screen: which cells, how healthy, how well modelled, what to look at first."""

import re

from markupsafe import Markup, escape

from cellwright.circuits import particle
from cellwright.circuits.circuit import OPTIONS
from cellwright.effects.story.words import name_of_effect
from cellwright.laws.points import level_means
from cellwright.records.conditions import (
    REFERENCE_CELSIUS,
    SAME_CELSIUS,
    same_temperature,
    stated_or_reference,
)
from runtime import sheets
from runtime.page_tables import DIGITS, Cell, duration, link, measured, plain_table, std_name

# What makes a cell one to look at, the gravest first; the rest are the extremes of its type.
FAILED, DOUBTED, LEFT_OUT, UNFIT, LEAST_HEALTHY, LEAST_ACCURATE, MOST_RESISTANT, NOTHING = range(8)
FIRST = 8  # so many findings are listed above the table; the table marks all
NAMED_TESTS, NAMED_CELLS = 3, 6  # of a finding, the others are counted
LATE_SECOND = 1.0  # by then a cell answers with its resistance, and begins to polarise
FEW = 34  # letters of a reason that fit beside the numbers of a cell
SAME_CAPACITY = 1e-4  # relative: a model counts in the capacity of a test, as it is written
# A number of a sentence, none within a name such as `ocv_C20_25C` or `2RC`.
NUMBER = re.compile(r"(?<![\w.])[-+−]?\d+(?:\.\d+)?(?!\.?\w)")
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
TO_DO = {
    FAILED: "Do not use these numbers before you have seen the record.",
    DOUBTED: "Check the record and its row of tests.tsv; numbers of other tests stand.",
    LEFT_OUT: "Add or correct the test if you need this; all else was computed.",
    UNFIT: "Run the next test that the cell's page names before you act on them.",
    LEAST_HEALTHY: "Compare its capacity and dQ/dV with the others.",
    LEAST_ACCURATE: "See where its model errs, under Model and its errors.",
    MOST_RESISTANT: "Compare its pulses with the others; check its contacts.",
}
COLUMNS = ["cell", "type", "capacity [Ah]", "SoH [%]", "R0 [mΩ]", "model error [mV]"]
COLUMNS += ["SoC error [%]", "model lacks", "to look at"]
READ = (
    "First what fails a check, is in doubt or was left out; then the worst of each type (▲); then "
    "by state of health. ± is a standard deviation, ? not sure. SoH: capacity at the rate beside "
    "it over that of the first check-up, or over the rating where there is none. R0: first sample "
    "of a pulse at 50 % SoC, 25 °C. Model error: RMS of the tests not fitted, and its range."
)
BASES = {"DRT": "resistances on a series of time constants"}
BASES |= {particle.NAME: "one particle with diffusion and charge transfer"}


def model_in_words(name) -> str:
    """A member of the family in words, such as `two RC pairs, hysteresis`."""
    base, *options = name.split("+")
    words = [BASES.get(base) or base.replace("RC", " RC pairs").replace("1 RC pairs", "1 RC pair")]
    words += [OPTIONS.get(one, f"{one} that were found") for one in options]
    return ", ".join(words)


def section(cells, summary, tables, checks) -> dict:
    """What the overview shows: heading, digest (name, words), findings, table.

    `cells` are rows of cells.tsv, `summary` and `checks` rows of the tables so named, as text,
    `tables` frames of text by name.
    """
    types = {row["cell"]: sheets.type_name(row) for row in cells}
    excluded = tables["excluded"].to_dict("records")
    reasons = reasons_by_cell(summary, excluded, checks, types)
    about = ("validation", "missing_effect", "resistance_definitions", "resistance")
    about += ("capacity", "checkups")
    told = {name: _by_cell(tables[name].to_dict("records")) for name in about if name in tables}
    order = sorted(summary, key=lambda row: _rank(row, reasons.get(row["cell"], ())))
    rows = []
    for row in order:
        name = row["cell"]
        parts = {one: told[one].get(name, []) for one in told}
        rows.append(_row(row, types.get(name, ""), reasons.get(name, []), parts))
    effects = tables["missing_effect"].to_dict("records")
    found = findings(summary, excluded, checks, types, effects)
    return {
        "types": sorted(set(types.values()) - {""}),
        "heading": _heading(types),
        "first": found[:FIRST],
        "more": found[FIRST:],
        "digest": digest(summary, types, excluded, checks, effects),
        "table": plain_table(
            *("cells", "Cells, what to look at first on top", READ, COLUMNS, rows),
            made="results/summary.csv",
        ),
        "marks": [{"type": types.get(r["cell"], ""), "look": r["cell"] in reasons} for r in order],
    }


def _heading(types) -> str:
    """A campaign without a title of its own, by its cells."""
    kinds = sorted(set(types.values()) - {""})
    count = f"{len(types)} cell{'s' if len(types) != 1 else ''}"
    return f"{count}: {'; '.join(kinds)}" if kinds else count


def findings(summary, excluded, checks, types, effects=()) -> list[dict]:
    """What to look at first, one line each, the gravest first: link, words, tests, do.

    The same sentence of several cells and tests is one line, with the range of its numbers.
    """
    told = [
        (FAILED, row["cell"], [row.get("test")], row["found"])
        for row in checks
        if row["outcome"] == "failed"
    ]
    for row in summary:
        told += [(DOUBTED, row["cell"], *one) for one in doubts_of(row.get("doubt"))]
    told += [(LEFT_OUT, row["cell"], [row["test"]], row["reason"]) for row in excluded]
    alike = {}
    for gravity, cell, tests, words in told:
        alike.setdefault((gravity, NUMBER.sub("#", words)), []).append((cell, tests, words))
    lines = [
        {
            "link": links(dict.fromkeys(cell for cell, *_ in same if cell), NAMED_CELLS),
            "words": _ranged([words for *_, words in same]),
            "tests": _tests_in_words([test for _, tests, _ in same for test in tests if test]),
            "do": TO_DO[gravity],
            "grave": gravity <= DOUBTED,
        }
        for (gravity, _), same in sorted(alike.items(), key=lambda one: one[0][0])
    ]
    lines += _unfit_names(effects)
    for gravity, cell, words, _ in _extremes(summary, types):
        line = {"link": links([cell]), "words": words, "tests": "", "do": TO_DO[gravity]}
        lines.append(line | {"grave": False})
    return lines


def doubts_of(text) -> list[tuple]:
    """Sentences of a doubt of the summary, each once: (tests, words).

    What is said of a test is not said again of the other half of its cycle, whose sentence ends
    with the same words.
    """
    found = []
    for part in (text or "").split("; "):
        tests, said, words = part.partition(": ")
        names, words = (tests.split(", "), words) if said else ([], part)
        if words:
            found.append((names, words))
    kept = []
    for names, words in found:
        shorter = {
            name
            for others, said in found
            if said != words and words.endswith(f" {said}")
            for name in others
        }
        left = [name for name in names if name not in shorter]
        if left or not names:
            kept.append((left, words))
    return kept


def _ranged(sentences) -> str:
    """Sentences that differ in numbers alone as one, a range for each number that differs."""
    numbers = [NUMBER.findall(one) for one in sentences]
    spans = iter([_span_of(column) for column in zip(*numbers, strict=True)])
    return NUMBER.sub(lambda _: next(spans), sentences[0])


def _span_of(numbers):
    ends = sorted(set(numbers), key=lambda one: float(one.replace("−", "-")))
    return " to ".join(dict.fromkeys((ends[0], ends[-1])))


def _tests_in_words(tests) -> str:
    """How many tests, and which: `5 tests (a, b, c and 2 more)`; a single one by its name."""
    names = list(dict.fromkeys(tests))
    if len(names) < 2:
        return names[0] if names else ""
    more = len(names) - NAMED_TESTS
    shown = ", ".join(names[:NAMED_TESTS]) + (f" and {more} more" if more > 0 else "")
    return f"{len(names)} tests ({shown})"


def links(cells, most=None) -> Markup:
    """Links to the pages of cells of which one thing is said, in a line; `most` of them."""
    cells = list(cells)
    shown = Markup(", ").join(map(link, cells[:most]))
    return shown + (f" and {len(cells) - most} more cells" if most and len(cells) > most else "")


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
    for gravity, cell, words, few in _extremes(summary, types):
        add(cell, gravity, words, few)
    return found


def _extremes(summary, types):
    """The worst cell of each type: (gravity, cell, words, few words)."""
    for gravity, (column, worst_of, words, few, unit, scale) in EXTREMES.items():
        for kind, rows in _by_type(summary, types, column).items():
            worst = worst_of(rows, key=lambda row: float(row[column]))
            if len({row[column] for row in rows}) > 1:
                size = measured(worst[column], worst.get(std_name(column, worst)), scale)
                said = f"{words}{f' of {kind}' if kind else ''}: {size} {unit}"
                yield gravity, worst["cell"], said, few


def digest(summary, types, excluded, checks, effects=()) -> list:
    """The campaign in a few numbers: (name, words). `effects` are rows of missing_effect."""
    kinds = len(set(types.values()))
    laws = {row["check"] for row in checks}
    failed = {row["check"] for row in checks if row["outcome"] == "failed"}
    doubted = sum(bool(row.get("doubt")) for row in summary)
    return [
        ("cells", f"{len(summary)}" + (f" of {kinds} types" if kinds > 1 else "")),
        ("state of health", _span(summary, "soh", 1e2, "%")),
        ("model error", _span(summary, "validation_rmse_volt", 1e3, "mV")),
        ("missing effects", _searched(summary, effects)),
        ("left out", f"{len(excluded)}, see below" if len(excluded) else "nothing"),
        ("in doubt", f"{doubted} of {len(summary)} cells"),
        ("checks by physics", f"{len(laws) - len(failed)} of {len(laws)} hold"),
    ]


def _searched(summary, effects) -> str:
    """Cells with a name that stands, of those searched; what speaks against the other names."""
    sought = [row["verdict"] for row in summary if row["verdict"]]
    if not sought:
        return "not searched"
    named = [row for row in effects if row.get("effect")]
    standing = [row for row in named if not against_name(row)]
    cells = {row["cell"] for row in standing}
    words = f"named in {sum(row['cell'] in cells for row in summary)} of {len(sought)} cells"
    if len(standing) < len(named):
        words += f"; {len(standing)} of {len(named)} names stand"
    unknown = sought.count("unknown")
    return words + (f"; no name in {unknown}" if unknown else "")


def _unfit_names(effects) -> list[dict]:
    """One line of the names that do not stand, with their cells; none where all do."""
    named = [row for row in effects if row.get("effect")]
    of_cell = _by_cell([row for row in named if against_name(row)])
    if not of_cell:
        return []
    said = "; ".join(
        f"{cell}: {', '.join(name_of_effect(row['effect']) for row in rows)}"
        for cell, rows in list(of_cell.items())[:NAMED_TESTS]
    )
    more = len(of_cell) - NAMED_TESTS
    words = (
        f"{sum(map(len, of_cell.values()))} of {len(named)} names do not count: another "
        "measurement contradicts them, or their size ended at a limit of the fit"
    )
    words += f" ({said}{f' and {more} more cells' if more > 0 else ''})"
    line = {"link": links(of_cell, NAMED_CELLS), "words": words, "tests": "", "do": TO_DO[UNFIT]}
    return [line | {"grave": False}]


def against_name(row) -> bool:
    """Whether a measurement contradicts an effect of missing_effect, or its size is at a limit."""
    contradicted = row.get("witnesses_contradict") or "0"
    return float(contradicted) > 0 or "at_bound" in (row.get("doubt_codes") or "").split(";")


def _span(rows, column, scale, unit) -> str:
    known = [scale * float(row[column]) for row in rows if row.get(column)]
    if not known:
        return "not known"
    ends = dict.fromkeys(f"{one:.3g}" for one in (min(known), max(known)))
    of_all = f" ({len(known)} of {len(rows)} known)" if len(known) < len(rows) else ""
    return f"{' to '.join(ends)} {unit}{of_all}"


def _row(row, kind, reasons, parts) -> list:
    """Cells of the table of one cell, of its own rows of tables."""
    marked = {gravity for gravity, *_ in reasons}
    capacities = [*parts.get("checkups", []), *parts.get("capacity", [])]
    when = _when(parts["resistance_definitions"])
    r0 = _number(row, "r0_50_25_ohm", 1e3, MOST_RESISTANT in marked, when)
    rate = rate_of_health(row, capacities)
    return [
        Cell(link(row["cell"]), row["cell"]),
        Cell(kind, kind),
        _number(row, "capacity_ampere_hour", 1.0),
        _number(row, "soh", 1e2, LEAST_HEALTHY in marked, rate and f"at {rate}"),
        r0 if r0.text else Cell(why_no_r0(parts.get("resistance", [])), mark="quiet"),
        _number(
            *(row, "validation_rmse_volt", 1e3, LEAST_ACCURATE in marked),
            _range_of(parts["validation"]),
        ),
        _number(row, "soc_rmse", 1e2),
        Cell(*_effects(row, parts["missing_effect"])),
        Cell(_why(row, reasons), str(min(marked, default=NOTHING))),
    ]


def rate_of_health(row, capacities) -> str:
    """C-rate at which the state of health of a cell was measured, such as `C/25`; "" not known.

    `capacities` are rows of `checkups` and `capacity`: the one with this state of health, or with
    the cell's capacity where it was not aged.
    """
    for one in capacities:
        aged = row.get("soh_cycle") and one.get("soh") == row.get("soh")
        fresh = not row.get("soh_cycle") and _close(one, row, "capacity_ampere_hour")
        if one.get("c_rate") and (aged or fresh):
            return rate_in_words(float(one["c_rate"]))
    return ""


def rate_in_words(rate) -> str:
    """A C-rate as people say it: `2C`, `C/25`."""
    return f"{rate:.2g}C" if rate > 0.95 else f"C/{1 / rate:.2g}"


def _close(one, other, column):
    if not one.get(column) or not other.get(column):
        return False
    return abs(float(one[column]) / float(other[column]) - 1.0) < SAME_CAPACITY


def why_no_r0(pulses) -> str:
    """Why a cell has no R0, the first sample of a discharge pulse near 50 % SoC at 25 °C.

    `pulses` are its rows of table `resistance`, as text; what they lack first is said.
    """
    known = [row for row in pulses if row.get("soc")]
    if not known:
        return "SoC of its pulses not known" if pulses else "no pulses found"
    if not (known := [row for row in known if row["direction"] == "discharge"]):
        return "charge pulses only"
    warm = [
        row
        for row in known
        if same_temperature(_celsius(row["ambient_temperature_celsius"]), REFERENCE_CELSIUS)
    ]
    if not warm:
        celsius = [_celsius(row["ambient_temperature_celsius"]) for row in known]
        levels = sorted(set(level_means(celsius, apart=SAME_CELSIUS).values()))
        return f"pulses at {', '.join(f'{one:.3g}' for one in levels)} °C only"
    socs = sorted({round(100 * float(row["soc"])) for row in warm})
    if not any(abs(one - 50) <= 10 for one in socs):
        return f"pulses at {' to '.join(f'{one}' for one in (socs[0], socs[-1]))} % SoC only"
    return "first samples of the pulses are missing"


def _celsius(text):
    return stated_or_reference(float(text) if text else None)


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
