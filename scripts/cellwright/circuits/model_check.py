"""Whether a model file can be simulated: what it lacks, and numbers that no cell has.

A model comes from a file that anybody can write to: a resistance below zero lets a cell rise under
a discharge, and no simulation would say so.
"""

import math
from collections.abc import Mapping
from numbers import Real

import numpy as np

from cellwright.circuits.circuit import KINDS
from cellwright.circuits.particle import of_document
from cellwright.refusal import Refusal

SMALLEST, LARGEST = 1e-6, 1e6  # Ah, as config/cells.tsv allows for a rating
LARGEST_OHM, LARGEST_VOLT = 1e6, 1e4
ENERGIES = {
    "activation_energy_joule_per_mole": (-1e6, 1e6),
    "activation_energy_kelvin": (0.0, 1e4),
}
# Names of parameters of branches that begin or end so: least and largest value.
RANGES = {
    "r_": (0.0, LARGEST_OHM),
    "m_volt": (-LARGEST_VOLT, LARGEST_VOLT),
    "charge_coefficient": (0.0, 1.0),
}
POSITIVE = ("_second", "_ampere_hour", "_ampere", "scale_volt")


def refuse_unusable(model: Mapping, cell: str | None = None) -> None:
    """Refuse a model that cannot be simulated.

    Parameters
    ----------
    model : dict of schema cellwright-model/2. cell : which it is to be of; None: as it says itself.

    Raises
    ------
    Refusal
        A capacity, resistance, time constant or voltage that is no number or that no cell has,
        lists of different lengths, a branch of an unknown kind, no member or condition. The message
        names the cell, the place in the file, what was found and what is wanted.
    """
    name = f"model of {model['cell'] if cell is None else cell}"
    needs(name, model, "cell", "capacity_ampere_hour", "ocv", "members", "chosen")
    refuse_beyond(f"{name}: capacity_ampere_hour", model["capacity_ampere_hour"], SMALLEST, LARGEST)
    for place, table in each(f"{name}: ocv", model["ocv"]):
        _columns(place, table, {"ocv_volt": (-LARGEST_VOLT, LARGEST_VOLT)})
    if model.get("particle"):
        of_document(model["particle"])
    for place, member in each(f"{name}: members", model["members"]):
        needs(place, member, "model", "conditions")
        for where, condition in each(f"{place}.conditions", member["conditions"]):
            _refuse_unusable_condition(where, condition)


def _refuse_unusable_condition(place, condition):
    _columns(place, condition, {"r0_ohm": RANGES["r_"]})
    needs(place, condition, "branches")
    for name, (low, high) in ENERGIES.items():
        if condition.get(name) is not None:
            refuse_beyond(f"{place}.{name}", condition[name], low, high)
    for where, branch in each(f"{place}.branches", condition["branches"], least=0):
        kind = branch.get("kind", "RC")
        if kind not in KINDS:
            raise Refusal(f"{where}.kind is {kind!r}, wanted one of {', '.join(KINDS)}")
        ranges = {name: _range_of(name) for name in KINDS[kind].parameters}
        _columns(where, branch, ranges, len(condition["soc"]))


def _range_of(name):
    if name.endswith(POSITIVE) and not name.startswith("m_"):
        return math.ulp(0.0), math.inf
    found = (limits for start, limits in RANGES.items() if name.startswith(start))
    return next(found, (-math.inf, math.inf))


def each(place, entries, *, least=1):
    """Place and entry of each of a list of mappings; refused where it is no such list."""
    if not isinstance(entries, list | tuple) or len(entries) < least:
        raise Refusal(f"{place} is {_shown(entries)}, wanted a list of {least} entries or more")
    for number, entry in enumerate(entries):
        needs(f"{place}[{number}]", entry)
        yield f"{place}[{number}]", entry


def needs(place, entry, *names):
    """Refuse what is no mapping with these names."""
    if not isinstance(entry, Mapping):
        raise Refusal(f"{place} is {_shown(entry)}, wanted keys with values")
    lacking = [name for name in names if name not in entry]
    if lacking:
        raise Refusal(f"{place} lacks {', '.join(lacking)}")


def _columns(place, entry, ranges, length=None):
    """Refuse lists of numbers over SoC that lack, have other lengths, or leave their ranges."""
    needs(place, entry, *([] if length else ["soc"]), *ranges)
    soc = entry["soc"] if length is None else None
    lists = ({} if soc is None else {"soc": (-1.0, 2.0)}) | ranges
    length = length or (len(soc) if hasattr(soc, "__len__") else 0)
    for name, (low, high) in lists.items():
        values = entry[name]
        if not hasattr(values, "__len__") or isinstance(values, str) or len(values) != length:
            wanted = "a list" if name == "soc" else f"a list of {length} numbers, one an SoC"
            raise Refusal(f"{place}.{name} is {_shown(values)}, wanted {wanted}")
        array = np.asarray(values)
        within = array.dtype.kind in "fiu" and np.all((array >= low) & (array <= high))
        if within and np.isfinite(array).all():  # the common case, a hundredth of the time
            continue
        for number, value in enumerate(values):
            refuse_beyond(f"{place}.{name}[{number}]", value, low, high)
    if soc is not None and np.any(np.diff(soc) <= 0):
        raise Refusal(f"{place}.soc does not rise from each entry to the next")


def refuse_beyond(place, value, low, high):
    """Refuse what is no number from a least to a largest one."""
    if not _is_within(value, low, high):
        limits = "a number" + (f" of {low:g} or more" if math.isfinite(low) else "")
        limits += f", {high:g} at most" if math.isfinite(high) else ""
        raise Refusal(f"{place} is {_shown(value)}, wanted {limits}")


def _is_within(value, low, high):
    if not isinstance(value, Real) or isinstance(value, bool):
        return False
    return low <= value <= high and abs(value) < math.inf


def _shown(value):
    shown = repr(value)
    return shown if len(shown) <= 40 else f"{shown[:39]}…"
