"""What every step of the public interface gives: tables, a document, notes."""

from html import escape
from typing import Any, NamedTuple

MOST_ROWS = 10  # of a table in a notebook
# How the name of a column ends: its unit. The longer end first.
UNITS = {
    "_ampere_hour_per_volt": "Ah/V",
    "_ampere_hour": "Ah",
    "_watt_hour": "Wh",
    "_ampere": "A",
    "_second": "s",
    "_hour": "h",
    "_volt": "V",
    "_celsius": "°C",
    "_kelvin": "K",
    "_ohm": "Ω",
    "_hertz": "Hz",
    "_watt": "W",
    "c_rate": "1/h",
}


class Result(NamedTuple):
    """What a step of the method gives.

    tables : dict by name; columns of equal length (a dict or a NamedTuple of arrays) or rows (dicts
        or NamedTuples). The first is the step's own, which `to_frame()` shows.
    content : dict: the document as it is written to a JSON file, or single values; None where the
        step has only tables.
    notes : sentences on what was left out, assumed or doubted.

    Each table, and each value of the content, is an attribute as well: `found.growth`.
    """

    tables: dict
    content: Any = None
    notes: tuple = ()

    def __getattr__(self, name):
        """The table, or the value of the content, of this name."""
        values = self.content if isinstance(self.content, dict) else {}
        for named in (self.tables, values):
            if name in named:
                return named[name]
        known = ", ".join(map(str, [*self.tables, *values]))
        raise AttributeError(f"this result has no {name!r}; it has {known}")

    def __dir__(self):
        """Names for completion: fields, tables and values."""
        return [*object.__dir__(self), *self.tables, *(self.content or {})]

    def to_frame(self, table=None):
        """A pandas DataFrame of the first table, or of the one named; else of the content."""
        if table is None and not self.tables:
            return frame(self.content)
        return frame(self.tables[next(iter(self.tables)) if table is None else table])

    def _repr_html_(self):
        """Notes, the first rows of each table under units, and single values: for a notebook."""
        parts = [f"<li>{escape(note)}</li>" for note in self.notes]
        parts = ["<ul>", *parts, "</ul>"] if parts else []
        for name, table in self.tables.items():
            shown = frame(table)
            parts.append(f"<p><b>{escape(str(name))}</b>: {len(shown)} rows</p>")
            parts.append(_with_units(shown.head(MOST_ROWS)).to_html(index=False))
        values = self.content if isinstance(self.content, dict) else {}
        single = {k: v for k, v in values.items() if isinstance(v, str | int | float)}
        if single:
            parts.append(_with_units(frame([single])).to_html(index=False))
        return "\n".join(parts)


def _with_units(shown):
    """A frame with the unit of each column below its name, where the name ends in one."""
    units = {
        column: next((unit for end, unit in UNITS.items() if str(column).endswith(end)), "")
        for column in shown
    }
    return shown.rename(columns={c: f"{c} [{unit}]" for c, unit in units.items() if unit})


def frame(table):
    """A pandas DataFrame of columns, of rows, or of a NamedTuple of arrays.

    Facts of one value each are repeated in every row; what has neither rows nor columns is one row.
    """
    import numpy as np
    import pandas as pd

    if hasattr(table, "_asdict"):
        table = table._asdict()
    if not isinstance(table, dict):
        rows = [row._asdict() if hasattr(row, "_asdict") else row for row in table]
        return pd.DataFrame(rows)
    # Empty lists beside others are facts as well: of a record in which nothing was left out.
    sizes = {len(v) for v in table.values() if isinstance(v, np.ndarray | list) and len(v)}
    if len(sizes) != 1:
        no_rows = table and all(isinstance(v, np.ndarray | list) for v in table.values())
        return pd.DataFrame(table if no_rows and not sizes else [table])
    (size,) = sizes
    fits = {k: v for k, v in table.items() if not hasattr(v, "__len__") or isinstance(v, str)}
    fits |= {k: v for k, v in table.items() if hasattr(v, "__len__") and len(v) == size}
    return pd.DataFrame(fits, index=range(size))
