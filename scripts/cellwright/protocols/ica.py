"""Incremental capacity dQ/dV of a constant-current charge, and its peaks."""

from typing import NamedTuple

import numpy as np

from cellwright.protocols.ica_peaks import peaks
from cellwright.protocols.savitzky_golay import ORDER, weights
from cellwright.protocols.tally import tally, volt_at_rank
from cellwright.refusal import Refusal


class IncrementalCapacity(NamedTuple):
    """Curve over a uniform grid of voltage, and what tells its noise.

    voltage_volt, dq_dv_ampere_hour_per_volt : (n,). bin_volt, smooth_volt : width of a bin and of
    the smoothing window, as used. scatter_volt : white noise of one row along the axis of voltage.
    rows_per_ampere_hour : density of the record.
    """

    voltage_volt: np.ndarray
    dq_dv_ampere_hour_per_volt: np.ndarray
    bin_volt: float
    smooth_volt: float
    scatter_volt: float
    rows_per_ampere_hour: float


def constant_current_charge(steps, charge_ampere_hour):
    """Rows of the constant-current charge that moves the most charge.

    Parameters
    ----------
    steps : columns kind, first_row, last_row, cv_first_row, current_mean_ampere, (k,) each.
    charge_ampere_hour : (n,) net charge of the record the rows point into [Ah].

    Returns
    -------
    first_row, last_row : inclusive, without the part at constant voltage.
    step : row of `steps` that they come from.

    Raises
    ------
    Refusal : no step of constant current charges the cell.
    """
    charging = np.isin(steps["kind"], ["CC", "CCCV"]) & (steps["current_mean_ampere"] > 0)
    first, held = steps["first_row"], steps["cv_first_row"]
    last = np.where(held > first, held - 1, steps["last_row"])
    moved = np.where(charging, charge_ampere_hour[last] - charge_ampere_hour[first], 0.0)
    if not len(moved) or moved.max() <= 0:
        raise Refusal(f"no constant-current charge among {len(moved)} step(s)")
    step = int(moved.argmax())
    return int(first[step]), int(last[step]), step


def incremental_capacity(
    voltage_volt,
    charge_ampere_hour,
    *,
    bin_volt=1e-3,
    smooth_volt=0.039,
    densest_share=0.8,
    slope_noise=0.02,
):
    """dQ/dV by the mean charge in each bin of voltage and a Savitzky-Golay filter of order 5.

    Averaging all rows of a bin turns the steps of a coarse converter and voltages that run back
    by noise into an estimate of Q(V); only then is it smoothed and differentiated, in one step.

    Parameters
    ----------
    voltage_volt, charge_ampere_hour : (n,) rows of one constant-current charge [V], [Ah].
    bin_volt : wanted width of a bin; more where two rows do not fill it; rounded to whole steps
        of the converter [V].
    smooth_volt : width of the smoothing window [V].
    densest_share : the window is at most this share of the narrowest range of voltage that holds
        a fifth of the charge, so that the flat curve of an LFP cell keeps its peaks [1].
    slope_noise : the window is widened, beyond both, until the noise of dQ/dV is below this
        share of it; coarse and noisy records need that [1].

    Returns
    -------
    curve : IncrementalCapacity, half a window short at each end.

    Raises
    ------
    Refusal : fewer than 50 rows, or a voltage that rises by less than two windows.

    Source: Savitzky & Golay, Anal. Chem. 36 (1964) 1627; dQ/dV: thesis eq. 4.1.
    """
    voltage, charge = np.asarray(voltage_volt, float), np.asarray(charge_ampere_hour, float)
    rising = charge if np.all(charge[1:] >= charge[:-1]) else np.sort(charge)
    if len(voltage) < 50 or rising[-1] <= rising[0]:
        raise Refusal(f"{len(voltage)} rows of charge are too few for dQ/dV; 50 are needed")
    counted = tally(voltage, charge)
    densest, typical = _spans(voltage, rising, counted)
    density = 0.8 * len(voltage) / typical
    quiet = _quiet_window(counted.scatter_volt, density, slope_noise)
    window = max(min(smooth_volt, densest_share * densest), quiet)
    finest = max(min(bin_volt, window / (2 * ORDER + 1)), 2 / density)
    width = _whole_steps(counted, finest)
    half = max(round(window / width / 2), ORDER)
    grid, mean_charge = _binned(counted, width)
    if len(grid) < 4 * half:
        raise Refusal(
            f"voltage spans {1e3 * np.ptp(counted.volt):.3g} mV in the charge; at least "
            f"{4e3 * half * width:.3g} mV are needed at this noise and sampling"
        )
    filters = (weights(half, width, derivative)[::-1] for derivative in (0, 1))
    smooth, slope = (np.convolve(mean_charge, filter_, "valid") for filter_ in filters)
    removed = (mean_charge[half:-half] - smooth) / np.maximum(slope, slope.max() / 100)
    rows_per_ampere_hour = len(voltage) / (rising[-1] - rising[0])
    rows = np.maximum(slope * width * rows_per_ampere_hour, 1.0)
    between_bins = 1.4826 * np.median(np.abs(removed) * np.sqrt(rows))
    return IncrementalCapacity(
        voltage_volt=grid[half:-half],
        dq_dv_ampere_hour_per_volt=slope,
        bin_volt=width,
        smooth_volt=(2 * half + 1) * width,
        scatter_volt=float(max(counted.scatter_volt, between_bins)),
        rows_per_ampere_hour=float(rows_per_ampere_hour),
    )


def charge_peaks(curve, *, c_rate, prominence):
    """Peaks of one charge as the columns of the stage `ica`.

    Parameters
    ----------
    curve : IncrementalCapacity.
    c_rate : rate of the charge [1/h].
    prominence : least rise of a peak, as a share of the highest dQ/dV [1].

    Returns
    -------
    columns : dict of (k,) arrays.

    Raises
    ------
    Refusal : no peaks; a flat curve is typical of an aged cell or a high rate.
    """
    found = peaks(curve, prominence=prominence)
    count = len(found.voltage_volt)
    if not count:
        raise Refusal(f"no peaks: dQ/dV at {c_rate:.3g}C is flat within {prominence:.0%}")
    return {"c_rate": np.full(count, c_rate), "peak": np.arange(1, count + 1)} | found._asdict()


def _spans(voltage, rising, counted):
    """Narrowest range of voltage with a fifth of the charge, and that with its middle 80 %."""
    tenth = max(len(voltage) // 10, 1)
    few = slice(None, None, tenth // 500 + 1)
    if not np.median(voltage[-tenth:][few]) > np.median(voltage[:tenth][few]):
        raise Refusal("voltage does not rise in the charge")
    # Both in rising order give the monotone Q(V), whatever noise makes the voltage run back.
    shares = rising[0] + (rising[-1] - rising[0]) * np.linspace(0, 1, 101)
    rank = np.searchsorted(rising, shares, side="right") - 1
    after = np.minimum(rank + 1, len(rising) - 1)
    gap = np.maximum(rising[after] - rising[rank], np.finfo(float).tiny)
    low, high = volt_at_rank(counted, rank), volt_at_rank(counted, after)
    levels = low + (high - low) * (shares - rising[rank]) / gap
    return (levels[20:] - levels[:-20]).min(), levels[90] - levels[10]


def _quiet_window(scatter, density, slope_noise):
    """Window in which white noise of the rows leaves that relative noise in the slope.

    The noise falls with the window's width to the power 1.5.
    """
    half = 20
    constant = np.linalg.norm(weights(half, 1 / half, 1)) * np.sqrt(half)
    return 2 * (constant * scatter / (slope_noise * np.sqrt(density))) ** (2 / 3)


def _whole_steps(counted, wanted):
    """Bin width near the one wanted that holds whole steps of the converter.

    Bins that hold now three, now four steps would print their own comb into dQ/dV.
    """
    levels, rows = len(counted.volt), counted.rows.sum()
    step = np.quantile(np.diff(counted.volt), 0.1) if levels > 1 else 0.0
    converter = step > 1e-6 and levels < 0.5 * rows
    return float(step * max(round(wanted / step), 1)) if converter else wanted


def _binned(counted, width):
    """Voltages of the bins and the mean charge of the rows in each; empty bins by interpolation."""
    # Edges a quarter of a bin beside the lowest level: no level of the converter falls on one.
    place = np.floor((counted.volt - counted.volt[0]) / width + 0.25).astype(int)
    rows = np.bincount(place, counted.rows)
    filled = np.flatnonzero(rows)
    mean_charge = np.bincount(place, counted.charge_ampere_hour)[filled] / rows[filled]
    mean_voltage = np.bincount(place, counted.rows * counted.volt)[filled] / rows[filled]
    grid = counted.volt[0] + width * (np.arange(len(rows)) + 0.25)
    return grid, np.interp(grid, mean_voltage, mean_charge)
