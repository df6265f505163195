"""Open-circuit voltage of a cell between its rests, from its own long steady loads.

A curve that is borrowed from another cell, or drawn through rests, is right at the rests of the
cell's own pulse test and only as alike between them as the two cells are. Where electrodes have
moved against each other, steps of the graphite stand at other SoC, and the curve is wrong by up to
10 mV there. A slow discharge and charge of the cell itself pass all of the SoC.
"""

import numpy as np

from cellwright.circuits.temperature import table_soc
from cellwright.identification.columns import columns_of, ocv_of, used_column
from cellwright.identification.regression import (
    FIRST_FACTOR,
    SCALES,
    shift_precision,
    system_of,
    weight_of,
)
from cellwright.numerics.linear import hats, solve
from cellwright.records.thinning import edges, thin, without_edges

FINE_SOC = np.unique(np.append(np.arange(0.0, 0.1, 0.005), np.arange(0.1, 1.005, 0.01)))
STEADY_SHARE = 0.3  # of the SoC, passed by one steady load: it shows the course of the OCV


def shape_records(records, *, capacity_ampere_hour):
    """Records whose steady loads pass a good part of the SoC, with rows all along it.

    Parameters
    ----------
    records : sequence of Record. capacity_ampere_hour : what their SoC refers to [Ah].

    Returns
    -------
    dense : list of Record, a row kept at each half per cent of the SoC; empty where no long load
        goes down or none goes up: from one way OCV and resistance cannot be told apart.
    """
    step = max(np.abs(np.diff(r.current_ampere)).max() for r in records) / 20
    ways = [_long_ways(r, step, capacity_ampere_hour) for r in records]
    if len(set().union(*ways)) < 2:
        return []
    sizes = {"step_ampere": step / 10, "capacity_ampere_hour": capacity_ampere_hour}
    passing = [record for record, way in zip(records, ways, strict=True) if way]
    return [without_edges(thin(r, **sizes), step_ampere=step) for r in passing]


def _long_ways(record, step_ampere, capacity_ampere_hour):
    """Signs of the steady loads that pass `STEADY_SHARE` of the SoC, not too fast."""
    marks = np.unique(np.r_[0, edges(record, step_ampere=step_ampere), len(record.soc) - 1])
    passed = np.diff(record.soc[marks])
    # A faster load warms the cell, and shows its resistance more than its OCV.
    slow = np.abs(record.current_ampere[marks[:-1]]) <= 1.2 * capacity_ampere_hour
    return set(np.sign(passed[slow & (np.abs(passed) >= STEADY_SHARE)]))


def ocv_from_loads(data, dense, *, held):
    """OCV table on the cell's own SoC from its long steady loads, beside the rests of its pulses.

    With the time constants of a plain circuit (a series of them) that was fitted about the given
    table, OCV over fine SoC, resistances over the usual SoC and the rows of the long loads are
    solved for at once: what charge and discharge have in common is OCV, what is between them
    resistance.

    Parameters
    ----------
    data : columns.Data with the given table. dense : list of Record, from `shape_records`.
    held : columns.Held of that circuit.

    Returns
    -------
    ocv_volt : (p,) OCV on the grid of `data.ocv_volt` [V]; rising.

    Raises
    ------
    Refusal : as `regression.system_of`.
    """
    # ASSUME: A cell's OCV differs from its reference's by some tens of millivolts, smoothly.
    names = {record.test for record in dense}
    kept = [record for record in data.records if record.test not in names]
    of_all = data._replace(records=(*kept, *dense), kept={})
    system = system_of(columns_of(of_all, held), data.knots)
    count = len(data.knots)
    fine = hats(used_column(of_all, "soc"), FINE_SOC) * system.weight[:, None]
    matrix = np.hstack([fine, system.matrix[:, count + SCALES :]])
    shift = _shift(matrix, system, shift_precision(FINE_SOC), count + SCALES)
    soc = np.linspace(0.0, 1.0, len(data.ocv_volt))
    given = ocv_of(data, table_soc(soc, held.missing, held.stretch))
    return np.maximum.accumulate(given + np.interp(soc, FINE_SOC, shift))


def _shift(matrix, system, prior_of_shift, first):
    """Shift of the OCV at the fine SoC (k,) [V], the data weighted by what is left of them."""
    fine, size = len(prior_of_shift), matrix.shape[1]
    prior = np.zeros((size, size))
    prior[:fine, :fine] = prior_of_shift
    prior[fine:, fine:] = system.prior[first:, first:]
    gram, moment, factor = matrix.T @ matrix, matrix.T @ system.target, FIRST_FACTOR
    for _ in range(3):  # by then the weight, found from what is left, moves no more
        vector = solve(factor * gram + prior, factor * moment, fine)
        factor = weight_of(system.target - matrix @ vector)
    return vector[:fine]
