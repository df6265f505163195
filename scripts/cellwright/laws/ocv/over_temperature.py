"""The open-circuit voltage of one cell over temperature, from whichever tests it has."""

from typing import NamedTuple

import numpy as np

from cellwright.laws.ocv.entropy import fit_entropic
from cellwright.laws.ocv.functions import COLUMNS, LINE, PARABOLA, compare
from cellwright.laws.ocv.readings import on_curve, slow_readings, step_readings
from cellwright.laws.ocv.surface import surface_from
from cellwright.laws.points import fresh
from cellwright.refusal import Refusal


class OverTemperature(NamedTuple):
    """What is known of a cell.

    entropic : dict, source ("steps", "slow") → `ocv_entropy.Entropic`. used : the source of all
    else. readings : of that source over an even grid of SoC. fitted : Entropic of these.
    functions : list of `ocv_compare.Function`. surface : `ocv_surface.Surface`. notes : sentences.
    """

    entropic: dict
    used: str
    readings: object
    fitted: object
    functions: list
    surface: object
    notes: tuple


def over_temperature(
    curves,
    step_rows,
    *,
    reference_celsius=25.0,
    largest_std_volt=0.02,
    voltage_std_volt=1e-3,
    step_std_volt=1e-4,
):
    """Entropic coefficient, functions and surface of a cell.

    Parameters
    ----------
    curves : list of dict, slow tests as `ocv_readings.slow_readings` takes them.
    step_rows : list of dict, rows of stage `ocv_step`.
    reference_celsius : what is compared against; the tested temperature nearest to it [degC].
    largest_std_volt : readings less certain take no part in the choice of a function [V].
    voltage_std_volt, step_std_volt : how well voltages of slow tests, of plateaus, compare [V].

    Returns
    -------
    found : OverTemperature. Where both kinds of test were made, the one with the smaller standard
        deviation of the entropic coefficient is used; both are reported.

    Raises
    ------
    Refusal : neither kind of test suffices; with the reasons of both.
    """
    sources, notes = _sources(curves, step_rows, voltage_std_volt, step_std_volt)
    if not sources:
        raise Refusal("; ".join(notes))
    entropic = {}
    for name, readings in sources.items():
        means = np.nanmean(readings.celsius, axis=0)
        nearest = np.round(means[np.argmin(np.abs(means - reference_celsius))], 1)
        entropic[name] = fit_entropic(readings, reference_celsius=float(nearest))
    std = {name: one.slope_std[np.isfinite(one.slope_std)] for name, one in entropic.items()}
    used = min(std, key=lambda name: np.median(std[name]) if len(std[name]) else np.inf)
    reference = entropic[used].reference_celsius
    away = [abs(one["ambient_temperature_celsius"] - reference) for one in fresh(curves)]
    curve = fresh(curves)[int(np.argmin(away))] if away else None
    readings = sources[used] if used == "slow" else on_curve(sources[used], curve)
    fitted, functions = fit_entropic(readings, reference_celsius=reference), []
    try:
        functions = compare(
            readings, reference_celsius=reference, largest_std_volt=largest_std_volt
        )
    except Refusal as refusal:
        notes.append(f"functions over temperature not compared: {refusal}")
    notes += [note for one in sources.values() for note in one.notes]
    notes += _bent(functions) if used == "slow" else []
    return OverTemperature(
        entropic,
        used,
        readings,
        fitted,
        functions,
        surface_from(
            _coefficients(fitted, functions, largest_std_volt),
            readings,
            reference,
            None if curve is None else np.asarray(curve["ocv_volt"], float),
        ),
        tuple(notes),
    )


def _sources(curves, step_rows, voltage_std, step_std):
    """Readings of each kind of test, and why there are none."""
    found, reasons = {}, []
    for name, read, content, std in (
        ("slow", slow_readings, curves, voltage_std),
        ("steps", step_readings, step_rows, step_std),
    ):
        try:
            found[name] = read(content, voltage_std_volt=std)
        except Refusal as refusal:
            reasons += [str(refusal)] if content else []
    return found, reasons or ["neither slow tests nor rests in a stepping chamber"] * (not found)


def _coefficients(fitted, functions, largest):
    """Of the tables the one that predicts best; a line where none was compared.

    Where the bias is less certain than the limit at the ends of what was tested, nothing.
    """
    tables = [one for one in functions if one.function in COLUMNS]
    best = min(
        tables,
        key=lambda one: np.nan_to_num(one.cross_validation_rmse_volt, nan=np.inf),
        default=None,
    )
    line = np.stack([fitted.ocv_volt, fitted.slope], axis=1)
    if best is not None and best.function != LINE:
        line = fitted.parabola if best.function == PARABOLA else line * [1.0, 0.0]
    sure = fitted.slope_std * fitted.reach_kelvin <= largest
    return np.where(sure[:, None], line, np.nan) if sure.any() else line


def _bent(functions):
    chosen = [one.function for one in functions if one.chosen]
    if chosen == [PARABOLA]:
        yield (
            "the table bends over temperature: overpotential of the slow current that grows in the "
            "cold does that, an entropic coefficient of its own hardly; which, only rests can tell"
        )
