"""What the uncertainties of its cells leave of the numbers of a pack: Monte Carlo."""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.model_file import simulate_model
from cellwright.packs.decisions.group_use import STEPS, discharge_seconds, use_of
from cellwright.packs.series.capability import BEYOND, first_crossing
from cellwright.packs.uncertainty.copies import copies_at_once, simulate_copies
from cellwright.packs.uncertainty.draws import drawn_cells, wire_factors
from cellwright.packs.wiring import with_contacts


class PackDraws(NamedTuple):
    """A pack in each draw, (draws,): usable charge [Ah] and energy [Wh]; the cell that ends the
    discharge (of a string), or carries the largest share of current for its capacity (of a parallel
    group); that share [1] (1 in a string); the heat of the hottest cell [W], and which it is."""

    capacity_ampere_hour: np.ndarray
    energy_watt_hour: np.ndarray
    weakest: np.ndarray
    peak_share: np.ndarray
    hottest_watt: np.ndarray
    hottest: np.ndarray


def string_draws(models, drawn, *, lower_cutoff_volt, current_ampere, initial_soc, celsius=25.0):
    """A series string discharged in every draw until its first cell is empty: PackDraws.

    Parameters
    ----------
    models, lower_cutoff_volt, current_ampere, initial_soc, celsius : as of
        `capability.discharge_string`. drawn : CellDraws.
    """
    cells, draws = len(models), len(drawn.capacity_factor)
    start = np.broadcast_to(np.asarray(initial_soc, float), (cells,))
    cutoff = np.broadcast_to(np.asarray(lower_cutoff_volt, float), (cells,))
    most = max(model["capacity_ampere_hour"] for model in models)
    charge = np.linspace(0.0, BEYOND * most, int(BEYOND * 200) + 1)  # 200 steps a draw
    volt, heat = np.empty((draws, cells, len(charge))), np.empty((draws, cells))
    ends = np.empty((draws, cells))
    for k, model in enumerate(models):
        of_cell = [column[:, k] for column in drawn[:4]]
        curves = _cell_curves(model, of_cell, charge, current_ampere, start[k], celsius)
        volt[:, k], heat[:, k] = curves
        at_cutoff = [first_crossing(charge, curve, cutoff[k]) for curve in volt[:, k]]
        # Beyond SoC 0 of the model nothing was measured.
        full = (start[k] + drawn.initial_soc[:, k]) * drawn.capacity_factor[:, k]
        ends[:, k] = np.fmin(at_cutoff, full * model["capacity_ampere_hour"])
    end = ends.min(axis=1)
    energy = []
    for whole, last in zip(volt.sum(axis=1), end, strict=True):
        kept = charge < last
        at_end = np.interp(last, charge, whole)
        energy.append(np.trapezoid(np.append(whole[kept], at_end), np.append(charge[kept], last)))
    ones, hottest = np.ones(draws), np.argmax(heat, axis=1)
    return PackDraws(
        end, np.array(energy), np.argmin(ends, axis=1), ones, heat.max(axis=1), hottest
    )


def _cell_curves(model, of_cell, charge, current_ampere, start, celsius):
    """Voltage of a discharged cell in each draw (draws, n) [V], and its mean heat (draws,) [W]."""
    second = 3600.0 * charge / current_ampere
    current = np.full(len(charge), -float(current_ampere))
    warm = np.full(len(charge), float(celsius))
    volts, heats = [], []
    for capacity, resistance, error, soc in zip(*of_cell, strict=True):
        course = start + soc - charge / (capacity * model["capacity_ampere_hour"])
        run = simulate_model(model, None, second, current, course, warm, hold="zero_order")
        over = run.overpotential_volt.sum(axis=0)
        volts.append(run.voltage_volt + (resistance - 1.0) * over + error)
        # Heat within the cell's SoC; beyond it the overpotential is extrapolated.
        inside = (course > 0.0) & (course < 1.0)
        heats.append(-resistance * over[inside].mean() * current_ampere)
    return np.array(volts), np.abs(heats)


def pack_draws(
    cells,
    wiring,
    drawn,
    *,
    lower_cutoff_volt,
    current_ampere,
    initial_soc=1.0,
    thermal=None,
    ambient_celsius=None,
):
    """A pack with parallel cells discharged to its cut-off in every draw of its cells and wires.

    Cells that rest joined have one voltage: at the start errors of the voltage and of the SoC are
    those of the first cell for all. Drawn apart they would drive currents that no rested group has.
    From there on that error stays the same; only where the draws hold a course of the OCV over SoC
    (`CellDraws.ocv_volt`, which `of_pack.pack_decisions` leaves out) does each cell's go astray.

    Parameters
    ----------
    cells, wiring, lower_cutoff_volt, current_ampere, initial_soc, thermal, ambient_celsius : as of
        `group_use.discharge_pack`. drawn : CellDraws.

    Returns
    -------
    draws : PackDraws.
    """
    draws = len(drawn.capacity_factor)
    factors = wire_factors(draws)
    ends = {"lower_cutoff_volt": lower_cutoff_volt, "current_ampere": current_ampere}
    count, at_once, uses = len(cells.names), copies_at_once(cells, STEPS), []
    for first in range(0, draws, at_once):
        chosen = range(first, min(first + at_once, draws))
        known = [drawn_cells(cells, drawn, draw, initial_soc) for draw in chosen]
        wired = [with_contacts(wiring, factors[draw]) for draw in chosen]
        time = max((discharge_seconds(c, wiring, current_ampere) for c in known), key=np.max)
        starts = [initial_soc + np.zeros(count) + drawn.initial_soc[k, 0] for k in chosen]
        load = np.full(len(time), -float(current_ampere))
        around = {"thermal": thermal, "ambient_celsius": ambient_celsius, "hold": "zero_order"}
        runs = simulate_copies(time, load, known, wired, initial_soc=starts, **around)
        for run, *one in zip(runs, known, wired, strict=True):
            uses.append(use_of(run, time, *one, **ends))
    hottest = [int(np.argmax(use.loss_watt)) for use in uses]
    return PackDraws(
        np.array([use.capacity_ampere_hour for use in uses]),
        np.array([use.energy_watt_hour for use in uses]),
        np.array([use.first for use in uses]),
        np.array([use.peak_share for use in uses]),
        np.array([use.loss_watt.max() for use in uses]),
        np.array(hottest),
    )


def summary_rows(draws, names, *, first):
    """Rows quantity, unit, cell and percentiles of a pack's draws.

    Charge, energy, peak share and heat: mean, percentiles 5, 25, 50, 75, 95; then of each cell that
    is the first (hottest) in some draw how often, by falling share.

    Parameters
    ----------
    draws : PackDraws. names : of its cells. first : what its `weakest` is called: "weakest cell" of
        a string, "busiest cell" of a parallel group.
    """
    quantities = {
        "usable charge": ("Ah", draws.capacity_ampere_hour),
        "usable energy": ("Wh", draws.energy_watt_hour),
        "largest branch current over its share": ("1", draws.peak_share),
        "heat of the hottest cell": ("W", draws.hottest_watt),
    }
    rows = [
        {"quantity": name, "cell": "", "unit": unit, "value": float(values.mean())}
        | {f"p{p:02d}": float(np.percentile(values, p)) for p in (5, 25, 50, 75, 95)}
        for name, (unit, values) in quantities.items()
    ]
    for name, chosen in ((first, draws.weakest), ("hottest cell", draws.hottest)):
        count = np.bincount(chosen, minlength=len(names)) / len(chosen)
        for k in np.argsort(-count, kind="stable")[: np.count_nonzero(count)]:
            rows.append(
                {"quantity": f"probability: {name}", "cell": names[k], "unit": "1"}
                | {"value": float(count[k])}
            )
    return rows
