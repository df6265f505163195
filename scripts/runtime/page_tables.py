"""Tables and figures of the report, each written in one way: words, units, doubts beside them."""

import base64
import json
import re
from math import floor, log10
from pathlib import Path
from typing import NamedTuple
from xml.sax.saxutils import unescape

import numpy as np
import pandas as pd
import pyarrow as pa
from markupsafe import Markup

from cellwright.messages import doubts_in

SHOWN_ROWS = 30  # more than a screen is looked up in the tables, not read
WORST_ROWS = 10  # of a longer table that says by which column its rows are the worse
# Of a shown unit in that of the tables.
SCALES = {"mΩ": 1e3, "mV": 1e3, "mA": 1e3, "%": 1e2, "kJ/mol": 1e-3}
ANSWERS = {"True": "yes", "False": "no"}
DIGITS = 4  # of a number without a standard deviation; the tables hold more


class Cell(NamedTuple):
    """Text of one cell of a table, the number it is sorted by, and how it is marked."""

    text: str
    key: str = ""
    mark: str = ""


class Table(NamedTuple):
    """A table as the report writes it: `rows` of Cell, `more` rows that it leaves to the tables.

    `made` is the artefact that it is read from, which Snakemake makes again by this name.
    """

    id: str
    title: str
    read: str
    columns: list
    rows: list
    more: int = 0
    made: str = ""


def table_of(name, frame, spec) -> Table:
    """The first rows of a table (a frame of text) as people read them.

    `spec` has title, read, and for each column that is shown its name, with the unit in brackets;
    `worst` is the column by which the worst rows of a long table stand for all.
    Columns that are blank in all rows are left out; `only` of it are values that rows must have.
    A doubt that all rows share stands above them once.
    """
    for column, value in spec.get("only", {}).items():
        frame = frame[frame[column] == value]
    read = spec["read"]
    if len(frame) > 1 and "doubt" in spec["columns"] and "doubt" in frame:
        said = [doubts_in({"doubt": words}) for words in frame["doubt"]]
        shared = [one for one in said[0] if all(one in row for row in said)]
        own = ["; ".join(one for one in row if one not in shared) for row in said]
        read += f" All in doubt: {'; '.join(shared)}." if shared else ""
        frame = frame.assign(doubt=own)
    worst = spec.get("worst")
    if worst and len(frame) > SHOWN_ROWS:
        size = pd.to_numeric(frame[worst]).abs().to_numpy()
        frame = frame.iloc[np.argsort(-size, kind="stable")]  # what is not known stands last
        read += f" The {WORST_ROWS} rows with the largest {spec['columns'][worst]}."
    rows = frame.head(WORST_ROWS if worst and len(frame) > SHOWN_ROWS else SHOWN_ROWS)
    rows = rows.to_dict("records")
    known = [key for key in spec["columns"] if any(row.get(key) for row in rows)]
    stds = {key: std_name(key, rows[0]) for key in known} if rows else {}
    labels = [spec["columns"][key] for key in known]
    cells = [
        [_cell(shown(row[key], row.get(stds[key]), spec["columns"][key])) for key in known]
        for row in rows
    ]
    more, made = len(frame) - len(rows), f"results/tables/{name}.csv"
    return Table(name, spec["title"], read, labels, cells, more, made)


def _cell(text):
    """A cell, of which a number is not broken over two lines."""
    return Cell(text, mark="n" if re.match(r"-?\d[\d.e+-]*( ± |$)", text or "") else "")


def plain_table(name, title, read, columns, rows, *, made="") -> Table:
    """A table of texts (or markup) that are as they should be read; `made` as in Table."""
    cells = [[one if isinstance(one, Cell) else Cell(one) for one in row] for row in rows]
    return Table(name, title, read, columns, cells, made=made)


def shown(text, std_text, label) -> str:
    """A cell of a table in the unit that its label states, with its standard deviation."""
    unit = re.search(r"\[(\S+)\]$", label)
    scale = SCALES.get(unit[1], 1.0) if unit else 1.0
    # A test that is called 25 stays as it is called.
    return measured(text, std_text, scale) if unit or std_text else plain_number(text)


def plain_number(text) -> str:
    """A number without a unit with four digits; other texts as they are."""
    if text in ANSWERS:
        return ANSWERS[text]
    fraction = isinstance(text, str) and re.fullmatch(r"-?\d+\.\d+(e[+-]?\d+)?", text)
    return f"{float(text):.{DIGITS}g}" if fraction else text


def measured(text, std_text=None, scale=1.0, digits=DIGITS) -> str:
    """A number for people, with its standard deviation where one is known; a blank stays blank.

    The deviation has one digit, two where it begins with 1, and the number as many decimals.
    """
    try:
        value = scale * float(text)
    except (TypeError, ValueError):
        return text or ""
    std = scale * float(std_text) if std_text else 0.0
    if value != value or not 0.0 < std < float("inf"):
        return f"{value:.{digits}g}"
    places = -floor(log10(std)) + (std < 2 * 10 ** floor(log10(std)))
    # Not more digits than of a number without: a deviation of a billionth is none that counts.
    size = floor(log10(abs(value))) if value else 0
    places = max(min(places, DIGITS - 1 - size), 0)
    spread = f" ± {std:.{places}f}" if round(std, places) else ""
    return f"{value:.{places}f}{spread}"


def duration(second) -> str:
    """A time [s] in words: milliseconds below a second."""
    value = float(second)
    return f"{1e3 * value:.{DIGITS}g} ms" if value < 1.0 else f"{value:.{DIGITS}g} s"


UNITS = {"volt": "V", "ampere_hour": "Ah", "ampere": "A", "celsius": "°C", "gram": "g"}


def fact_in_words(name, value) -> str:
    """A fact of a sheet as people say it, such as `lower cutoff 2.5 V`."""
    unit = next((unit for unit in UNITS if name.endswith(f"_{unit}")), None)
    words = name.removesuffix(f"_{unit}").replace("_", " ")
    size = f"{value:g}" if isinstance(value, float) else value
    return f"{words} {size} {UNITS[unit]}" if unit else f"{words}: {size}"


def std_name(name, row) -> str | None:
    """Name of the column with the standard deviations of another; None where there is none."""
    parts = name.split("_")
    within = ["_".join([*parts[:k], "std", *parts[k:]]) for k in range(1, len(parts))]
    names = [f"{name}_std", *within, *(["std"] if name == "value" else [])]
    return next((one for one in names if one in row), None)


def link(page, text=None) -> Markup:
    """A link to the page of a cell or group, or to a place on it."""
    return Markup('<a href="#cell-{}">{}</a>').format(page, text or page)


class Figure(NamedTuple):
    """A figure as the report writes it: `data` follows `data:image/svg+xml,`, sizes are its own.

    `reason` says why there is nothing on it, "" where there is.
    """

    id: str
    title: str
    read: str
    data: str
    width: str
    height: str
    made: str = ""  # what Snakemake makes it again by
    lines: str = ""  # what the reader may zoom into, see `closer_look`
    reason: str = ""


def figure_of(path, captions) -> tuple[str, Figure]:
    """Kind of a figure, by which it is captioned, and the figure."""
    name = Path(path).stem
    # Names of tests may themselves have underscores: the longest kind that fits is meant.
    fitting = [kind for kind in captions if name == kind or name.startswith(f"{kind}_")]
    kind = max(fitting, key=len, default="")
    caption = captions.get(kind, {"title": name, "read": ""})
    test = name.removeprefix(f"{kind}_") if kind and name != kind else ""
    svg = Path(path).read_text(encoding="utf-8")
    box = re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', svg)
    title = f"{caption['title']}: {test}" if test else caption["title"]
    width, height = box.groups() if box else ("", "")
    # The figures of a cell or group are made together: their folder is what Snakemake follows.
    folder = Path(path).parent
    made = Path(path) if folder.name == "figures" else folder
    drawing = as_url(svg)
    shown = Figure(name, title, caption["read"], drawing, width, height, made.as_posix())
    return kind, shown._replace(reason=_reason(svg))


def _reason(svg: str) -> str:
    """Why a figure could not be drawn, as the artefact carries it; "" where it was."""
    about = re.search(r"<(desc|dc:description)>(\{.*?\})</\1>", svg, flags=re.S)
    return (json.loads(unescape(about[2])).get("reason") or "") if about else ""


def as_url(svg: str) -> str:
    """A picture as what follows `data:image/svg+xml,`, plain text that compresses well.

    Its provenance stays with the file of the figure: checksums do not compress, and nobody reads
    them in a picture.
    """
    drawing = re.sub(r"<(metadata|desc)>.*?</\1>", "", svg[svg.index("<svg") :], flags=re.S)
    return drawing.replace("%", "%25").replace("#", "%23").replace("\n", "%0A")


def packed(text: str) -> str:
    """A text as gzip in base64, for what the report unpacks when it is looked at.

    By pyarrow's own compressor, whose version the locked environment holds: the same text then has
    the same bytes on any machine, which Python's, built on the system's, does not promise. Level 9
    takes three times as long for 3 % fewer bytes.
    """
    codec = pa.Codec("gzip", compression_level=6)
    return base64.b64encode(codec.compress(text.encode(), asbytes=True)).decode()
