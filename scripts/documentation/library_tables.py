"""Tables made from the entries of the libraries: effects of a cell and a branch, half cells."""

import re
from itertools import groupby

import numpy as np

from cellwright.effects.library import LIBRARY
from cellwright.effects.library.groups import GROUP_LIBRARY
from cellwright.effects.library.vocabulary import why_no_part
from cellwright.effects.records import FACTORS
from cellwright.health.electrodes import half_cells
from cellwright.identification.messages import say
from cellwright.identification.particle import WITHOUT

NUMBERED = re.compile(r"_\d+_")  # of a name that a whole family of parameters shares


def of_cell() -> str:
    """Markdown table of the effects of a cell: parameters, needed records, test that shows it."""
    rows = [
        (f"`{effect.id}`", _parameters(effect), _needed(effect), effect.shows)
        for effect in LIBRARY.values()
    ]
    return table(("id", "parameters: bounds (prior)", "needed", "test that shows it"), rows)


def parts() -> str:
    """Markdown table of the effects of a cell as parts of a particle, and why others are none."""
    rows = [
        (f"`{effect.id}`", _part(effect.in_particle) or f"none: {why_no_part(effect)}")
        for effect in LIBRARY.values()
    ]
    return table(("effect", "part of the particle"), rows)


def _part(name):
    """A part of a particle and the parameters that it is; "" of none."""
    names = dict.fromkeys(re.sub(r".+_joule", "…_joule", one) for one in WITHOUT.get(name, ()))
    parameters = ", ".join(f"`{one}`" for one in names)
    return name and f"`{name}`: {say(f'part.{name}')} ({parameters})"


def of_branch() -> str:
    """Markdown table of the effects of a branch of a parallel group, one parameter each."""
    rows = [
        (f"`{effect.id}`", effect.sentence, _parameters(effect), _material(effect), effect.shows)
        for effect in GROUP_LIBRARY.values()
    ]
    return table(("id", "what", "parameter: bounds", "named from", "what shows it"), rows)


def ties() -> str:
    """Markdown table of the effects that voltage and current cannot tell from another."""
    rows = [
        (f"`{effect.id}`", _partner(tie.partner), _when(tie), tie.check)
        for effect in (*LIBRARY.values(), *GROUP_LIBRARY.values())
        for tie in effect.ties
    ]
    return table(("effect", "not separable from", "when", "what separates them"), rows)


def of_half_cells() -> str:
    """Markdown table of the published half cells: name, range of lithiation, paper."""
    rows = [
        (f"`{name}`", f"{lowest:g} to {highest:g}", source)
        for name, (_, lowest, highest, source) in half_cells.LIBRARY.items()
    ]
    return table(("name", "lithiation", "source"), rows)


def table(heads, rows) -> str:
    """Markdown table of rows of texts below its heads."""
    lines = ["| " + " | ".join(row) + " |" for row in (heads, ["---"] * len(heads), *rows)]
    return "\n".join(lines)


def _parameters(effect):
    """Parameters of an effect in words; those that differ by a number in their names as one."""
    alike = groupby(effect.parameters, lambda one: NUMBERED.sub("_…_", one.name))
    families = ((name, next(family)) for name, family in alike)
    return "; ".join(f"`{name}` {_values(one, effect.starts)}" for name, one in families)


def _values(parameter, starts):
    """Bounds of a parameter and its prior; of one that is not fitted the values that are tried."""
    if not parameter.step:
        tried = {start.get(parameter.name, parameter.neutral) for start in starts}
        return _in_words(" or ".join(f"{value:g}" for value in sorted(tried)), parameter)
    ends = _in_words(f"{parameter.lower:g} to {parameter.upper:g}", parameter)
    if np.isinf(parameter.prior_std):
        return ends
    return f"{ends} ({parameter.neutral:g} ± {parameter.prior_std:g})"


def _in_words(numbers, parameter):
    unit = "" if parameter.unit == "1" else f" {parameter.unit}".replace("Ohm", "Ω")
    return numbers.replace("-", "−") + unit


def _needed(effect):
    return "; ".join(FACTORS[name][1] for name in effect.needs) or "–"


def _material(effect):
    (parameter,) = effect.parameters
    return _in_words(f"{parameter.material:g}", parameter)


def _partner(partner):
    return f"`{partner}`" if partner in (LIBRARY | GROUP_LIBRARY) else partner


def _when(tie):
    if tie.one_temperature:
        return "all records are at one temperature"
    if tie.one_order:
        return "the tests were made in the order of their temperatures"
    if tie.exact:
        return "always, exactly" if tie.always else "always, nearly"
    return "always"
