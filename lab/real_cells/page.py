"""The page of real cells: numbers by temperature, beside published and earlier ones."""

import re
from pathlib import Path

import pandas as pd

from real_cells import record
from real_cells.measured import KEYS, QUANTITIES, topics

ABOUT = """\
# Real cells

What the pipeline makes of real campaigns, as others measured them, run whole on the documented
defaults. Each number is what the results of the run say; nothing is fitted or chosen here.

{made}

* **published** is what the authors of the data or others found, with its source below the table; a
  number recomputed from the files is a second opinion, no authority. **before** is what an earlier
  state of the pipeline gave, where it was another number.
* Errors of models are on tests that took no part in a fit, between 5 and 95 % SoC: the root mean
  square over the tests of a temperature, and the worst test. The best member is the one with the
  lowest error there, known only afterwards; the chosen one is chosen without these tests.
* Errors of a filter's SoC are over whole tests, from wrong starts. Of campaigns with more than
  eight cells, models and verdicts are summarised over all cells.
* A number may change by what the last column says: more, to the worse side, fails the check. The
  rule stands in [measured.py](../lab/real_cells/measured.py); a tolerance edited in
  recorded.csv stays when the record is renewed, a blank one is filled by the rule.
* Times are those of all jobs, one after the other, on the machine of the record; not checked.
"""
RECORDED = """\
The numbers lie beside this page as data, with tolerances:
[recorded.csv](real-cells/recorded.csv), [published.csv](real-cells/published.csv),
[before.csv](real-cells/before.csv); why they were last renewed:
[renewals](real-cells/renewals.md).

```
./run snakemake -s lab/Snakefile --cores 2 real   # every campaign whole: up to an hour
./run python lab/tools/real_check.py              # fails where a number is worse than recorded
./run python lab/tools/real_record.py --why "…"   # renews the record
```"""
MEASURED = (
    "These are the numbers of the last run, not the record; lab/tools/real_check.py compares them."
)
WORDS = {"recorded": "last renewed", "before": "the state before"}
TEMPERATURE = re.compile(r"^(-?[\d.]+ °C|temperature not known)(?:, |$)")
GLANCE = {
    "error of the chosen member": "chosen, mV",
    "error of the best member": "best member, mV",
    "right verdicts": "right verdicts",
    "left out": "left out",
    "internal errors": "internal errors",
    "time of all jobs": "time, s",
}


def text(numbers: pd.DataFrame, before: pd.DataFrame, *, recorded: bool = True) -> str:
    """The whole page.

    Parameters
    ----------
    numbers : the record, or what was measured.
    before : numbers of an earlier state of the pipeline.
    recorded : whether `numbers` are the record.
    """
    old = before[[*KEYS, "value"]].rename(columns={"value": "before"})
    rows = numbers.merge(old, on=KEYS, how="left").fillna("")
    places = rows["where"].map(lambda where: TEMPERATURE.match(where))
    rows["column"] = [match[1] if match else "" for match in places]
    rows["rest"] = [TEMPERATURE.sub("", where) for where in rows["where"]]
    parts = [ABOUT.format(made=RECORDED if recorded else MEASURED), _glance(rows)]
    parts += [_campaign(name, part) for name, part in rows.groupby("campaign")]
    return "\n".join(parts)


def of_record() -> str:
    """The page of the documentation: of the record, with why it was renewed."""
    reasons = {name: record.last_reason(name) for name in ("recorded", "before")}
    lines = [f"* **{WORDS[name]}**: {reason}\n" for name, reason in reasons.items() if reason]
    whole = text(record.read(record.RECORDED), record.read(record.BEFORE))
    return whole.replace("\n## At a glance", "".join(lines) + "\n## At a glance", 1)


def write(content: str, path):
    """Write the page."""
    Path(path).write_text(content, encoding="utf-8")


def _glance(rows) -> str:
    """One line a campaign: the range over its cells and temperatures."""
    lines = []
    for name, part in rows.groupby("campaign"):
        # Places with a detail, such as "worst test" or a stage, stand below.
        part = part[(part["rest"] == "") | part["quantity"].eq("right verdicts")]
        lines.append([name, *(_range(part[part["quantity"] == quantity]) for quantity in GLANCE)])
    head = ["campaign", *GLANCE.values()]
    sentence = "From the lowest to the highest over cells and temperatures."
    return f"## At a glance\n\n{sentence}\n\n{_table(head, lines)}"


def _range(rows) -> str:
    values = sorted(rows.loc[rows["value"] != "", "value"].astype(float))
    if not values:
        return ""
    ends = dict.fromkeys([short(str(values[0])), short(str(values[-1]))])
    return " – ".join(ends)


def _campaign(name, rows) -> str:
    parts = [f"## {name}\n"]
    for topic in topics():
        of_topic = rows[[QUANTITIES[quantity].topic == topic for quantity in rows["quantity"]]]
        if len(of_topic):
            parts.append(f"### {topic} of {name}\n\n{_topic(of_topic)}")
    sources = rows.loc[rows["published_source"] != "", ["quantity", "published_source"]]
    lines = [f"* {quantity}: {source}" for quantity, source in sources.drop_duplicates().values]
    if lines:
        parts.append("Sources of the published numbers:\n\n" + "\n".join(lines) + "\n")
    return "\n".join(parts)


def _topic(rows) -> str:
    """Rows: a cell, quantity and place; columns: temperatures."""
    columns = sorted(rows["column"].unique(), key=_degrees)
    keys = ["cell", "quantity", "rest"]
    lines = []
    for (cell, quantity, rest), part in rows.groupby(keys, sort=False):
        entries = {row["column"]: _entry(row) for row in part.to_dict("records")}
        label = f"{quantity}, {rest}" if rest else quantity
        unit = part["unit"].iloc[0].replace("word", "").removeprefix("1")
        entries = [entries.get(column, "") for column in columns]
        lines.append([cell, label, unit, *entries, _tolerance(part.iloc[0])])
    heads = ["value" if columns == [""] else column or "all" for column in columns]
    return _table(["cell", "quantity", "unit", *heads, "may change by"], lines)


def _degrees(column: str) -> tuple:
    """Order of the columns: without a temperature, by temperature, not known."""
    number = re.match(r"-?[\d.]+", column)
    return (1, float(number[0])) if number else (0 if column == "" else 2, 0.0)


def _entry(row) -> str:
    digits = 5 if row["unit"] in ("V", "Ah") else 4
    value, before = (short(row[name], digits) for name in ("value", "before"))
    parts = [value or "not found"]
    if row["published"]:
        parts.append(f"published {row['published']}")
    if before not in ("", value):
        parts.append(f"before {before}")
    return "<br>".join(parts)


def short(value: str, digits: int = 4) -> str:
    """A number with so many digits, those before the point all; a word as it is."""
    try:
        number = float(value)
    except ValueError:
        return value
    return f"{number:.0f}" if abs(number) >= 1000 else f"{number:.{digits}g}"


def _tolerance(row) -> str:
    if row["better"] == "shown":
        return "not checked"
    relative, absolute = float(row["tolerance_relative"]), float(row["tolerance_absolute"])
    unit = "" if row["unit"] in ("1", "count", "word") else f" {row['unit']}"
    parts = [f"{100 * relative:g} %"] if relative else []
    parts += [f"{absolute:g}{unit}"] if absolute else []
    sides = {"lower": "more", "higher": "less"}
    side = sides.get(row["better"], "")
    if not parts:
        return f"no {side}" if side else "nothing"
    return f"{side}: {' + '.join(parts)}".removeprefix(": ")


def _table(head, lines) -> str:
    rows = [head, ["---"] * len(head), *lines]
    cells = [[str(cell).replace("|", "\\|") for cell in line] for line in rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in cells)
