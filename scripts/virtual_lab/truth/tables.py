"""Which truth tables a test has rows in, by its kind."""

from virtual_lab.rating import Rating
from virtual_lab.truth import charges, groups, peaks, resistances

PULSED = ("hppc", "pulse_resistance")
REFERENCE_CELSIUS = 25.0
CYCLED = ("capacity", "ocv", "fast_charge")


def rows(test, behaviours: list) -> dict[str, list[dict]]:
    """Rows of truth tables about a test, without the keys cell and test.

    Parameters
    ----------
    test : with `kind`, `steps`, `initial_soc` and a `specimen`, as in `plan.Test`. The specimen
        says its `full_ampere_hour` and its `rating` (or that of its `cell`); that of a group the
        `names` of its cells and their `capacities_ampere_hour`.
    behaviours : one per step.

    Returns
    -------
    Tables by name: packs for a group; else soc and, by the kind, capacity, resistance and ica; of
    an ageing test cycles, since a mean over a life says nothing.
    """
    if test.kind == "group":
        return {"packs": _group_rows(test, behaviours)}
    full = {
        "capacity_ampere_hour": _full_ampere_hour(test),
        "initial_soc": test.initial_soc,
    }
    found = {"soc": charges.soc_rows(behaviours, **full)}
    if test.kind in PULSED:
        found["resistance"] = resistances.resistance_rows(test.steps, behaviours, **full)
    if test.kind in CYCLED:
        found["capacity"] = charges.capacity_rows(test.steps, behaviours, **_rated(test))
    if test.kind == "ageing":
        found["cycles"] = charges.cycle_rows(test.steps, behaviours, **_rated(test))
    if test.kind == "ica":
        rating = rating_of(test.specimen)
        found["ica"] = peaks.ica_rows(test.steps, behaviours, rating=rating)
    return found


def _full_ampere_hour(test):
    """Charge of the full cell at the temperature of the test."""
    per_kelvin = getattr(test.specimen, "capacity_per_kelvin", 0.0)
    warmer = test.ambient_celsius - REFERENCE_CELSIUS
    return test.specimen.full_ampere_hour * (1 + per_kelvin * warmer)


def _rated(test):
    return {"rating": rating_of(test.specimen), "initial_soc": test.initial_soc}


def rating_of(specimen) -> Rating:
    """Data sheet of a specimen, its own or that of its cell.

    Raises
    ------
    ValueError : it has neither.
    """
    for holder in (specimen, getattr(specimen, "cell", None)):
        if isinstance(rating := getattr(holder, "rating", None), Rating):
            return rating
    raise ValueError(f"{type(specimen).__name__} has no rating, to which C-rates could refer")


def _group_rows(test, behaviours):
    names, capacities = test.specimen.names, test.specimen.capacities_ampere_hour
    shown = groups.group_rows(
        test.steps, behaviours, names=names, capacities_ampere_hour=capacities
    )
    return [{"group": test.cell, **row} for row in shown]
