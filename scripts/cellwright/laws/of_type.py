"""Pulse resistance over temperature across cells of one type, each tested at few temperatures."""

from itertools import product
from typing import NamedTuple

import numpy as np

from cellwright.laws.points import (
    first_check_up,
    grouped,
    preferred_rate,
    pulses_of_kind,
    rate_classes,
    resistance_points,
    with_enough_temperatures,
    without_rate,
)
from cellwright.laws.temperature import fit_laws, fitted_laws
from cellwright.numerics.statistics import robust_std
from cellwright.records import inputs
from cellwright.settings import Temperature

TEMPERATURE = Temperature()


class CellPoint(NamedTuple):
    """A `points.Point` with the cell that it is of."""

    member: str
    quantity: str
    unit: str
    temperature_celsius: float
    value: float
    std: float
    family: str
    soc: float
    doubts: tuple


def temperature_laws_of_type(resistances, settings=None, **changes):
    """Laws of pulse resistance over temperature across cells of one type.

    resistances : rows with cell too. settings : `settings.Temperature`.

    Returns rows and points as of `temperature_laws`. Raises Refusal: no quantity is known at three
    temperatures. Source: docs/temperature.md.
    """
    options = inputs.settings_of(Temperature, settings, changes)
    compared, left_out = points_of_type(inputs.rows(resistances), **options._asdict())
    # Points stay apart here: how cells differ is what the interval of the type's law tells.
    points = with_enough_temperatures(compared)
    return fitted_laws(points, (*left_out, *sentences_of_type(points)))


def points_of_type(rows, *, delay_second=TEMPERATURE.delay_second, soc=TEMPERATURE.soc):
    """One point of pulse resistance for each cell and temperature, all at one rate [ohm].

    Cells of a type differ by more than a pulse errs: the scatter of the law is that between cells,
    and a pulse's own error, far smaller, is not used as a weight.

    Parameters
    ----------
    rows : list of dict, rows of stage `resistance` of several cells, each with its `cell`.
    delay_second, soc : as in `points.resistance_points`.

    Returns
    -------
    points : list of CellPoint. notes : list of sentences on temperatures without a pulse of the
        rate.
    """
    # ASSUME: Which cell of a type was tested at which temperature is chance.
    points, notes, young = [], [], first_check_up(rows)
    for direction, delay in product(("discharge", "charge"), delay_second):
        kept, note = _one_class(pulses_of_kind(young, direction, delay))
        notes += [f"{direction}, {delay:g} s: {note}"] if note else []
        for cell, cell_rows in grouped(kept, lambda row: row["cell"]).items():
            found, _ = resistance_points(cell_rows, delay_second=(delay,), soc=soc)
            points += [_across_cells(cell, point) for point in found]
    return points, notes


def _across_cells(cell, point):
    """A cell's point among those of its type; its own error is no weight."""
    quantity, family = (f"{name}, across cells" for name in (point.quantity, point.family))
    return CellPoint(cell, *point._replace(quantity=quantity, family=family, std=np.nan))


def _one_class(rows):
    """Rows of the rate that most temperatures have, and a note on temperatures without it."""
    classes = rate_classes(rows)
    if not classes:
        return [], ""
    reached = {rate: _temperatures(same_rate) for rate, same_rate in classes.items()}
    rate = preferred_rate(reached)
    return classes[rate], without_rate(rate, sorted(_temperatures(rows) - reached[rate]))


def _temperatures(rows):
    return {row["ambient_temperature_celsius"] for row in rows}


def sentences_of_type(points):
    """Spread of the cells of a type, outliers, the law without them; one sentence a quantity."""
    return [_sentence(*entry) for entry in grouped(points, lambda p: p.quantity).items()]


def _sentence(quantity, points):
    """Spread, outliers and activation energy of one quantity in words."""
    celsius = np.array([point.temperature_celsius for point in points])
    value = np.array([point.value for point in points])
    # Cells of a type differ by factors: in size, in contact.
    off = np.log(value)
    for level in np.unique(celsius):
        off[celsius == level] -= np.median(off[celsius == level])
    spread = robust_std(off)
    # Four standard deviations: of some tens of sound cells none lies so far off by chance.
    apart = (np.abs(off) > 4.0 * spread) & (spread > 0)
    text = (
        f"{quantity}: {len({p.member for p in points})} cells that differ by {100 * spread:.1f} % "
        f"at one temperature; {_energy(celsius, value)}"
    )
    names = sorted({p.member for p, out in zip(points, apart, strict=True) if out})
    if not names:
        return text
    stand = "stands" if len(names) == 1 else "stand"
    without = _energy(celsius[~apart], value[~apart])
    return f"{text}; {', '.join(names)} {stand} apart, without: {without}"


def _energy(celsius, value):
    """Activation energy with its interval in words [kJ/mol]."""
    law = next(law for law in fit_laws(celsius, value, unit="Ohm") if law.law == "arrhenius")
    value, lower, upper = (1e-3 * limit[1] for limit in (law.values, law.lower, law.upper))
    return f"activation energy {value:.1f} kJ/mol ({lower:.1f} to {upper:.1f})"
