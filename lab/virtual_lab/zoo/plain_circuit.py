"""A plain circuit of a real cell: OCV table, ohmic resistance, two RC pairs, by least squares.

Of its own for the planted campaigns: neither the laboratory's cells nor the pipeline's models.
"""

from itertools import product
from typing import NamedTuple

import numpy as np

from virtual_lab.zoo.real_records import RealCell, every_so_many

KNOTS = np.linspace(0.0, 1.0, 41)
STIFF_VOLT = 2e-3  # second difference between knots that weighs as much as one sample's residual
FAST_SECOND, SLOW_SECOND = (4.0, 12.0, 30.0), (90.0, 250.0, 600.0)
LONGEST_EXPONENT = 300.0
MOST_EXPONENT = 40.0
DYNAMIC = ("hppc", "pulse_resistance", "drive", "capacity")


class Plain(NamedTuple):
    """A plain circuit: OCV over `KNOTS` [V], resistances [ohm], time constants [s], residuals [V].

    `pair_ohm`, `tau_second`: of the two RC pairs. `fit_residual`, `judge_residual`: measured minus
    modelled of the compared rows of either role.
    """

    ocv_volt: np.ndarray
    r0_ohm: float
    pair_ohm: tuple[float, float]
    tau_second: tuple[float, float]
    fit_residual: np.ndarray
    judge_residual: np.ndarray

    def volt_at(self, soc):
        """OCV at states of charge [V], continued along the slope of its ends."""
        beyond = np.clip(soc, -0.05, 1.05) - np.clip(soc, 0.0, 1.0)
        return np.interp(soc, KNOTS, self.ocv_volt) + beyond * self.slope_at(soc)

    def slope_at(self, soc):
        """Slope of the OCV over the state of charge [V]."""
        slope = np.gradient(self.ocv_volt, KNOTS)
        return np.interp(soc, KNOTS, slope)


def lag(step_second, value, tau_second):
    """First-order lag (n,) of a value that was held over each step; zero before the first row.

    Exact for uneven steps. Summed in stretches, within which the exponentials stay finite.

    Parameters
    ----------
    step_second, value : (n,). tau_second : time constant [s].
    """
    exponent = np.minimum(np.asarray(step_second) / tau_second, MOST_EXPONENT)
    passed = np.cumsum(exponent)
    driven = -np.expm1(-exponent) * value
    out, state, begin = np.empty(passed.size), 0.0, 0
    while begin < passed.size:
        start = passed[begin - 1] if begin else 0.0
        end = int(np.searchsorted(passed, start + LONGEST_EXPONENT, side="right"))
        end = max(end, begin + 1)
        grown = np.exp(passed[begin:end] - start)
        out[begin:end] = (state + np.cumsum(grown * driven[begin:end])) / grown
        state, begin = out[end - 1], end
    return out


def fitted(cell: RealCell, tau_second: tuple[float, float] | None = None, lags=None) -> Plain:
    """The plain circuit refitted to a cell's records.

    1. The OCV is the mean of both branches of the slow test nearest 25 °C; without a slow test it
    is fitted together with the rest. 2. R0 and two RC pairs, with a first-order change of either
    time constant, and the state of charge at the start of each record, by least squares on the rows
    to fit. 3. On the rows that judge only the starts are fitted.

    Parameters
    ----------
    cell : laid out. tau_second : of the two pairs [s]; None: the best of a grid.
    lags : dict in which lags of the current are kept for the next fit of records with it.
    """
    lags = {} if lags is None else lags
    if tau_second is None:
        plains = [fitted(cell, pair) for pair in product(FAST_SECOND, SLOW_SECOND)]
        return min(plains, key=lambda plain: rms(plain.fit_residual))
    known = _slow_ocv(cell.records[cell.slow]) if cell.slow is not None else None
    fit = [_part(one, one.fits, tau_second, lags) for one in _dynamic(cell)]
    volt, columns, hats = (np.concatenate(x) for x in zip(*fit, strict=True))
    number = np.repeat(np.arange(len(fit)), [one[0].size for one in fit])
    if known is None:
        known, _ = _solved(volt, [columns], hats)
    slope = np.gradient(known, KNOTS)
    start = (hats @ slope)[:, None] * (number[:, None] == np.arange(len(fit)))
    sides = np.hstack([columns, start])
    values = _least(volt - hats @ known, sides)
    judges = [_part(one, one.judges, tau_second, lags) for one in cell.records if one.judges.any()]
    return Plain(
        known,
        values[0],
        (values[1], values[2]),
        tau_second,
        volt - hats @ known - sides @ values,
        np.concatenate([_judged(one, known, slope, values[:5]) for one in judges]),
    )


def _dynamic(cell):
    return [one for one in cell.records if one.row["kind"] in DYNAMIC and one.fits.any()]


def _part(record, rows, tau_second, lags):
    """(volt, columns, hats) of some rows of a record."""
    key = (id(record.mean_ampere), tau_second)
    if key not in lags:
        # The current is kept beside its lags, so that no other array takes its place in memory.
        lags[key] = (record.mean_ampere, np.column_stack(list(_lags(record, tau_second))))
    columns = np.column_stack([record.ampere, lags[key][1]])
    return record.volt[rows], columns[rows], hat_functions(record.soc[rows])


def _lags(record, tau_second):
    """The current behind both lags [A], then how either changes with ln τ: see `fitted`."""
    first = [lag(record.step_second, record.mean_ampere, tau) for tau in tau_second]
    yield from first
    for tau, once in zip(tau_second, first, strict=True):
        # d(lag)/d(ln tau) is the lag of the lag minus the lag, but for its sign.
        yield lag(record.step_second, once, tau) - once


def hat_functions(soc) -> np.ndarray:
    """Hat functions over the knots of the OCV, one row a state of charge."""
    return np.clip(1 - np.abs(np.clip(soc, 0, 1)[:, None] - KNOTS) / KNOTS[1], 0.0, None)


def _slow_ocv(record):
    """OCV over the knots [V] from a slow test: what is left without an even resistance."""
    rows = every_so_many(record)
    ampere = record.ampere[rows]
    both = ampere.min() < -0.3 * np.ptp(ampere) and ampere.max() > 0.3 * np.ptp(ampere)
    sides = [ampere[:, None]] if both else []
    return _solved(record.volt[rows], sides, hat_functions(record.soc[rows]))[0]


def _solved(volt, sides, hats):
    """OCV over the knots, kept smooth where no row lies, and the values of the other columns."""
    stiff = np.diff(np.eye(KNOTS.size), 2, axis=0) * 1e-3 / STIFF_VOLT
    matrix = np.hstack([hats, *sides])
    below = np.hstack([stiff, np.zeros((len(stiff), matrix.shape[1] - KNOTS.size))])
    values = _least(np.append(volt, np.zeros(len(stiff))), np.vstack([matrix, below]))
    return values[: KNOTS.size], values[KNOTS.size :]


def _judged(part, ocv, slope, values):
    """Residual of rows that judge, the state of charge at the start of their record fitted."""
    volt, columns, hats = part
    residual = volt - hats @ ocv - columns @ values
    start = hats @ slope
    return residual - start * (start @ residual) / max(start @ start, 1e-12)


def _least(target, matrix):
    """Least squares by the normal equations, columns brought to one size first."""
    size = np.maximum(np.sqrt((matrix**2).sum(axis=0)), 1e-12)
    scaled = matrix / size
    square = scaled.T @ scaled + 1e-9 * np.eye(size.size)
    return np.linalg.solve(square, scaled.T @ target) / size


def rms(volt) -> float:
    """Root mean square [V]."""
    return float(np.sqrt(np.mean(np.square(volt))))
