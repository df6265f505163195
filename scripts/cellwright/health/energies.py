"""Activation energies of a cell: one for each quantity, of all that tell it, and where they differ.

What is called the activation energy of a cell is that of one resistance or another: of the ohmic
part, of charge transfer, of diffusion, or of all of them after some time. Those of one quantity are
one number; those of others need not agree, and each says what it is of.
"""

import re

import numpy as np

from cellwright.circuits.model_file import member_of
from cellwright.health.messages import say
from cellwright.numerics.statistics import NORMAL_95
from cellwright.records.conditions import REFERENCE_CELSIUS, stated_or_reference

ENERGY, RECONCILED = "activation_energy", "reconciled"
LAWS = ("arrhenius", "multiplicative")
R0 = "R0"
SEARCH, MODEL = "all resistances, search", "quick resistances, model in use"
# Quantity of a law, by the name of what it is of. The delay of a pulse is part of the quantity.
QUANTITIES = (
    (r"(charge )?resistance (at|over) .*, first sample", R0),
    (r"(charge )?resistance (at|over) .*, (?P<delay>[\d.]+ s)", "resistance after {delay}"),
    (r"ohmic resistance .*, impedance", "ohmic resistance of spectra"),
    (r"charge-transfer resistance .*, impedance", "charge transfer of spectra"),
    (r"polarisation a, .*over SoC", "faster part of what relaxes"),
    (r"polarisation b, .*over SoC", "slower part of what relaxes"),
)
# Code of what each quantity is, by how its name begins, in the order of the table.
KINDS = {
    R0: "first",
    "resistance after": "later",
    "ohmic resistance of spectra": "ohmic",
    "charge transfer of spectra": "transfer",
    "faster part of what relaxes": "faster",
    "slower part of what relaxes": "slower",
    MODEL: "model",
    SEARCH: "search",
}


def energies_of_cell(laws, model, verdict):
    """Activation energies of a cell: of each quantity the reconciled one, then its sources.

    The reconciled one is their mean, weighted by their deviations; it is no surer than the surest
    of them, which stand on the same pulses and temperatures, nor than they scatter.

    Parameters
    ----------
    laws : rows of `tables/temperature` of the cell, None where a number is not known.
    model : dict of its model file; {} without one. verdict : dict of the search; {} without one.

    Returns
    -------
    rows : list of dict: quantity, name, energy_joule_per_mole, energy_std_joule_per_mole, sources,
        tested_from_celsius, tested_to_celsius, doubt, definition; R0 first.
    """
    sources = [*_of_laws(laws), *_of_search(verdict), *_of_model(model)]
    quantities = sorted({row["quantity"] for row in sources}, key=_place)
    rows = []
    for quantity in quantities:
        own = [row for row in sources if row["quantity"] == quantity]
        rows += [_reconciled(own), *own]
    return [row | {"definition": say(f"energy.{KINDS[_kind(row['quantity'])]}")} for row in rows]


TESTED = ("tested_from_celsius", "tested_to_celsius")


def _row(quantity, name, energy, std, known=None):
    """A row of `energies_of_cell`; known : dict that has its temperatures and its doubt."""
    row = {"quantity": quantity, "name": name, "energy_joule_per_mole": energy}
    row |= {"energy_std_joule_per_mole": std, "sources": 1}
    return row | {key: (known or {}).get(key) for key in (*TESTED, "doubt")}


def _of_laws(laws):
    """Rows of the laws that have an activation energy, of a quantity that is a resistance."""
    for law in laws:
        quantity = _quantity(law["quantity"])
        if quantity is None or law["parameter"] != ENERGY or law["law"] not in LAWS:
            continue
        std = law.get("std")
        if law.get("lower") is not None and law.get("upper") is not None:
            # Of few temperatures the interval is wider than its deviation says.
            std = (law["upper"] - law["lower"]) / 2 / NORMAL_95
        if std:
            yield _row(quantity, law["quantity"], law["value"], std, law)


def _quantity(name):
    """Quantity that a law of this name is of; None: no resistance."""
    for pattern, quantity in QUANTITIES:
        if found := re.fullmatch(pattern, name):
            return quantity.format(**found.groupdict())
    return None


def _of_search(verdict):
    """Activation energy that the search for missing effects named."""
    for effect in verdict.get("effects", ()):
        for size in effect.get("sizes") or ():
            std = size["std"]
            if size["unit"] == "kJ/mol" and std is not None and np.isfinite(std) and std > 0:
                yield _row(SEARCH, f"search, {size['name']}", 1e3 * size["value"], 1e3 * std)


def _of_model(model):
    """Activation energy of the model in use at its temperature nearest 25 °C."""
    if not model:
        return
    conditions = member_of(model)["conditions"]
    nearest = min(
        conditions,
        key=lambda one: abs(
            stated_or_reference(one["ambient_temperature_celsius"]) - REFERENCE_CELSIUS
        ),
    )
    energy = nearest.get("activation_energy_joule_per_mole")
    if energy:
        yield _row(MODEL, "model in use, near 25 °C", energy, None)


def _reconciled(sources):
    """The one number of the sources of a quantity, and in words which of them contradict it."""
    sure = [row for row in sources if row["energy_std_joule_per_mole"]] or sources
    values, stds = (
        np.array([row[name] or np.nan for row in sure], float)
        for name in ("energy_joule_per_mole", "energy_std_joule_per_mole")
    )
    weight = np.where(np.isfinite(stds), stds, 1.0) ** -2.0
    mean = float(weight @ values / weight.sum())
    scatter = float(np.sqrt(weight @ (values - mean) ** 2 / weight.sum()))
    std = float(np.hypot(np.nanmin(stds), scatter)) if np.isfinite(stds).any() else None
    ends = [[row[name] for row in sources if row[name] is not None] for name in TESTED]
    known = {"doubt": "; ".join(_contradictions(sources, mean, std))}
    known |= {TESTED[0]: min(ends[0], default=None), TESTED[1]: max(ends[1], default=None)}
    return _row(sources[0]["quantity"], RECONCILED, mean, std, known) | {"sources": len(sources)}


def _contradictions(sources, mean, std):
    """A sentence for each source that lies two deviations and more from the reconciled number."""
    for row in sources:
        own, off = row["energy_std_joule_per_mole"], row["energy_joule_per_mole"] - mean
        if std is not None and abs(off) > 2.0 * np.hypot(own or 0.0, std):
            yield (
                f"{row['name']}: {1e-3 * row['energy_joule_per_mole']:.3g} kJ/mol contradicts "
                f"{1e-3 * mean:.3g} ± {1e-3 * std:.2g}"
            )


def _kind(quantity):
    (kind,) = [kind for kind in KINDS if quantity.startswith(kind)]
    return kind


def _place(quantity):
    """Order of the quantities: by their kinds, delays by their length."""
    delay = re.search(r"([\d.]+) s$", quantity)
    return list(KINDS).index(_kind(quantity)), float(delay.group(1)) if delay else 0.0
