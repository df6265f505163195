"""Which behavioural cells a campaign has: kinds, forms, strengths, layouts of tests, faults."""

from itertools import product
from typing import NamedTuple

import numpy as np

from virtual_lab.campaigns import seed_of
from virtual_lab.zoo import effects

STRENGTHS_VOLT = (1.5e-3, 3e-3, 6e-3, 15e-3)
USUAL = ("wide", "cold")  # layouts of tests
SIZES = {
    "healthy": 40,
    "other": 4,
    "simple": 2,
    "two": 12,
    "outside": 3,
    "sheets": 3,
    "unproven": 2,
}


class Wanted(NamedTuple):
    """A cell to be made: kind in the truth, forms, strength [V], layout of its tests, a fault."""

    kind: str
    forms: tuple[str, ...] = ()
    strength_volt: float = 0.0
    layout: str = "wide"
    fault: str = ""


def plan(*, seed, healthy, other, simple, two, outside, sheets, unproven) -> dict[str, Wanted]:
    """Cells by name, in an order that does not show what they have; sizes as of `forms.make`."""
    random = np.random.default_rng(seed_of("plan of other forms", seed))
    wanted = [Wanted("none", layout=_layout(random, USUAL)) for _ in range(healthy)]
    for table, each in ((effects.OTHER, other), (effects.SIMPLE, simple)):
        wanted += _singles(table, each, "single", random)
    wanted += _singles(effects.OUTSIDE, outside, "unknown", random, STRENGTHS_VOLT[2:])
    for _ in range(two):
        names = tuple(random.choice(effects.PAIRED, 2, replace=False).tolist())
        wanted.append(Wanted("two", names, STRENGTHS_VOLT[2], _layout(random, USUAL)))
    for _, name in product(range(sheets), effects.SHEETS):
        layout = _layout(random, USUAL)
        wanted.append(Wanted("sheet", (), 0.0, layout, fault=name))
    # A temperature is only wrong to a cell that shows it.
    warm = [Wanted("single", ("one_energy",), STRENGTHS_VOLT[2], fault="temperature_5_kelvin")]
    wanted += warm * sheets
    wanted += [
        Wanted("single", (name,), STRENGTHS_VOLT[2], "unproven")
        for _, name in product(range(unproven), effects.NEED_TEMPERATURE)
    ]
    order = random.permutation(len(wanted))
    return {f"z{number:04d}": wanted[k] for number, k in enumerate(order, 1)}


def _singles(table, each, kind, random, strengths=STRENGTHS_VOLT):
    """Cells with one form, the strengths in turn."""
    return [
        Wanted(
            kind, (name,), strengths[(k + place) % len(strengths)], _layout(random, form.layouts)
        )
        for place, (name, form) in enumerate(table.items())
        for k in range(each)
    ]


def _layout(random, layouts):
    return str(random.choice(layouts))
