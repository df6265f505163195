"""MATLAB's .mat (up to version 7): a structure, or variables, of equally long arrays."""

import io
import zlib

import numpy as np

from cellwright.formats.fields import (
    SERIES,
    converted,
    require,
)
from cellwright.formats.makers import GENERIC
from cellwright.formats.table import unread
from cellwright.formats.text_table import UNTOLD, fields_of, meaning_of
from cellwright.refusal import Refusal

NAME = "matlab"
# How the parser fails on damaged bytes.
FAULTS = (ArithmeticError, LookupError, NameError, OSError, TypeError, ValueError, EOFError)
FAULTS = (*FAULTS, RuntimeError, zlib.error)
MARK = b"MATLAB 5.0 MAT-file"


def recognises(head: bytes) -> bool:
    """The mark of versions 5 to 7."""
    return head.startswith(MARK)


def read(data: bytes) -> tuple[dict[str, np.ndarray], list[str]]:
    """Columns of the one structure or set of variables that has time, current and voltage.

    Raises
    ------
    Refusal
        The file is cut off or damaged, holds no arrays of such names or several sets of them, or
        a table, which MATLAB alone can read.
    """
    content = _loaded(data)
    sets = {name: arrays for name, arrays in _sets(content).items() if _is_series(arrays)}
    if not sets:
        _refuse_objects(content)
    if len(sets) != 1:
        found = ", ".join(sets) if sets else "none"
        raise Refusal(f"one set of arrays of time, current and voltage is wanted; found: {found}")
    arrays = next(iter(sets.values()))
    fields = [field for field in fields_of(GENERIC, arrays) if field.column not in UNTOLD]
    require(fields, SERIES, dict.fromkeys(SERIES, "an array"))
    columns = converted({f.label: np.asarray(arrays[f.label], float) for f in fields}, fields)
    note = "arrays do not say their units: seconds, ampere and volt are taken where no name does"
    return columns, [note, *unread(arrays, [field.label for field in fields])]


def _loaded(data):
    from scipy.io import loadmat

    try:
        return loadmat(io.BytesIO(data), squeeze_me=True, struct_as_record=False)
    except FAULTS as fault:
        raise Refusal(f"the MATLAB file is cut off or damaged: {fault}") from None


def _refuse_objects(content):
    """Refuse a file whose variables are objects, such as tables: only MATLAB knows their layout."""
    from scipy.io.matlab import MatlabOpaque

    # Of each: its name, the system that made it, its class.
    objects = [value.item() for value in content.values() if isinstance(value, MatlabOpaque)]
    for name, _, kind, *_ in objects:
        name, kind = (x.decode("latin-1") if isinstance(x, bytes) else x for x in (name, kind))
        way = {
            "table": f"writetable({name}, 'file.csv'), or as a structure of arrays, "
            f"s = table2struct({name}, 'ToScalar', true)",
            "timetable": f"writetimetable({name}, 'file.csv')",
        }.get(kind, "such as with writetable")
        raise Refusal(
            f"variable {name!r} is a {kind} of MATLAB, which MATLAB alone can read: save its "
            f"columns there as csv, {way}"
        )


def _sets(content):
    """Arrays by name: those of the file itself, and those of each structure in it."""
    sets = {"the file": {k: v for k, v in content.items() if _is_column(v)}}
    for name, value in content.items():
        inside = {k: getattr(value, k) for k in getattr(value, "_fieldnames", ())}
        sets[name] = {k: v for k, v in inside.items() if _is_column(v)}
    return sets


def _is_column(value):
    return isinstance(value, np.ndarray) and value.ndim == 1 and value.dtype.kind in "fiu"


def _is_series(arrays):
    known = [meaning_of(GENERIC, name) for name in arrays]
    return {field.column for field in known if field} >= set(SERIES)
