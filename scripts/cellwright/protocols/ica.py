"""Incremental capacity dQ/dV of a constant-current charge, and its peaks."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cellwright.native import array, count, function
from cellwright.numerics.linear import SAVITZKY_GOLAY_ORDER, savitzky_golay_weights
from cellwright.refusal import Refusal
from cellwright.settings import Ica

ICA = Ica()

ROOM = 32768  # levels; half of the slots in ica.c


class Tally(NamedTuple):
    """Number of rows and charge at each distinct voltage of a record, in rising order (k,).

    volt [V], rows [1], charge_ampere_hour: sum over the rows [Ah]. scatter_volt: white noise of
    one row along the axis of voltage, from the second differences [V].
    """

    volt: np.ndarray
    rows: np.ndarray
    charge_ampere_hour: np.ndarray
    scatter_volt: float


def tally(voltage_volt, charge_ampere_hour):
    """Number of rows and charge at each distinct voltage, compiled where that is possible.

    Parameters
    ----------
    voltage_volt, charge_ampere_hour : (n,) [V], [Ah].

    Returns
    -------
    tally : Tally.
    """
    types = (count, array, array, count, array, array, array, array)
    kernel = function("tally", *types, result=count)
    room = min(ROOM, len(voltage_volt) // 2)
    if kernel is None or not room:
        return _tally_by_sorting(voltage_volt, charge_ampere_hour)
    rows = (
        np.ascontiguousarray(voltage_volt, float),
        np.ascontiguousarray(charge_ampere_hour, float),
    )
    volt, sums, bend = np.empty(room), np.zeros((2, 2, room)), np.empty(1)
    levels = kernel(len(rows[0]), *rows, room, volt, *sums, bend)
    if levels < 0:
        return _tally_by_sorting(*rows)
    order = volt[:levels].argsort()
    sums = (sums[:, 0, :levels] + sums[:, 1, :levels])[:, order]
    return Tally(volt[order], *sums, _scatter(bend[0], len(rows[0])))


def volt_at_rank(levels, rank):
    """Voltage at ranks in the order of rising voltage [V].

    Parameters
    ----------
    levels : Tally.
    rank : (m,) places from 0 [1].

    Returns
    -------
    voltage_volt : (m,) [V].
    """
    return levels.volt[np.searchsorted(np.cumsum(levels.rows), rank, side="right")]


def _tally_by_sorting(voltage, charge):
    """Tally without a compiler, with the same result."""
    volt, level = np.unique(voltage, return_inverse=True)
    bend = np.sum(np.diff(voltage, 2) ** 2)
    return Tally(
        volt, np.bincount(level) + 0.0, np.bincount(level, charge), _scatter(bend, len(voltage))
    )


def _scatter(bend, rows):
    """White noise of one row [V], from the sum of squared second differences [V²]."""
    return float(np.sqrt(bend / max(rows - 2, 1) / 6))


class Peaks(NamedTuple):
    """Peaks in order of voltage; empty where the curve has none, which is a result (k,)."""

    voltage_volt: np.ndarray
    voltage_std_volt: np.ndarray
    height_ampere_hour_per_volt: np.ndarray
    area_ampere_hour: np.ndarray


def peaks(curve, *, prominence=ICA.prominence, noise_factor=5.0):
    """Peaks of dQ/dV that stand out of their surroundings and of the noise.

    Parameters
    ----------
    curve : IncrementalCapacity.
    prominence : least height of a peak above the higher of the two valleys that part it from
        higher ones, as a share of the highest dQ/dV [1].
    noise_factor : the same, in standard deviations of the noise of dQ/dV.

    Returns
    -------
    peaks : Peaks. The position is the vertex of a parabola about the highest point; its standard
        deviation follows from the noise of the rows by the delta method. The area is the charge
        from valley to valley.
    """
    height = curve.dq_dv_ampere_hour_per_volt
    half = round(curve.smooth_volt / curve.bin_volt) // 2
    slope = savitzky_golay_weights(half, curve.bin_volt, 1)
    rows = np.maximum(height * curve.bin_volt * curve.rows_per_ampere_hour, 1.0)
    noise = np.maximum(height, 0) * curve.scatter_volt / np.sqrt(rows)
    threshold = np.maximum(prominence * height.max(), noise_factor * noise * np.linalg.norm(slope))
    # Beside a peak narrower than the window the filter rings by up to a tenth of its height.
    padded = np.pad(height, 2 * half, mode="edge")
    near = np.lib.stride_tricks.sliding_window_view(padded, 4 * half + 1)
    threshold = np.maximum(threshold, 0.1 * near.max(axis=1))
    tops = np.flatnonzero((height[1:-1] > height[:-2]) & (height[1:-1] >= height[2:])) + 1
    tops = tops[_steps_down(height, tops) > threshold[tops]]
    tops = np.array([top for top in tops if _prominence(height, top) > threshold[top]], int)
    # A parabola by least squares through a third of the window about the highest point.
    reach = max(half // 3, 1)
    offsets = np.arange(-reach, reach + 1) * curve.bin_volt
    _, steepness, bend = np.linalg.pinv(offsets[:, None] ** [0, 1, 2])
    heights = height[np.clip(tops[:, None] + np.arange(-reach, reach + 1), 0, len(height) - 1)]
    farthest = reach * curve.bin_volt
    shift = np.clip(-heights @ steepness / (2 * heights @ bend), -farthest, farthest)
    steepness_noise = noise[tops] * np.linalg.norm(np.convolve(slope, steepness))
    edges = [0, *(a + height[a:b].argmin() for a, b in pairwise(tops)), len(height) - 1]
    inside = (height[1:] + height[:-1]) / 2 * curve.bin_volt
    area = [inside[a:b].sum() for a, b in pairwise(edges)]
    return Peaks(
        voltage_volt=curve.voltage_volt[tops] + shift,
        voltage_std_volt=steepness_noise / np.abs(2 * heights @ bend),
        height_ampere_hour_per_volt=height[tops],
        area_ampere_hour=np.array(area if len(tops) else []),
    )


def _steps_down(height, tops):
    """Upper bound of each prominence: the drop to the next valley before a higher top.

    With it nearly all ripples need no search over the whole curve.
    """
    if len(tops) < 2:
        return np.full(len(tops), np.inf)
    valley = np.minimum.reduceat(height, tops)[:-1]
    first, second = height[tops[:-1]], height[tops[1:]]
    to_right = np.append(np.where(second > first, first - valley, np.inf), np.inf)
    to_left = np.append(np.inf, np.where(first > second, second - valley, np.inf))
    return np.minimum(to_left, to_right)


def _prominence(height, top):
    """Height of a peak above the higher of the two valleys between it and higher peaks."""
    higher = np.flatnonzero(height > height[top])
    from_row = higher[higher < top].max(initial=-1) + 1
    to_row = higher[higher > top].min(initial=len(height))
    return height[top] - max(height[from_row : top + 1].min(), height[top:to_row].min())


class IncrementalCapacity(NamedTuple):
    """dQ/dV over a uniform grid of voltage, with the noise and density of its rows.

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
    bin_volt=ICA.bin_volt,
    smooth_volt=ICA.smooth_volt,
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
    levels = tally(voltage, charge)
    densest, typical = _spans(voltage, rising, levels)
    density = 0.8 * len(voltage) / typical
    quiet = _quiet_window(levels.scatter_volt, density, slope_noise)
    window = max(min(smooth_volt, densest_share * densest), quiet)
    finest = max(min(bin_volt, window / (2 * SAVITZKY_GOLAY_ORDER + 1)), 2 / density)
    width = _whole_steps(levels, finest)
    half = max(round(window / width / 2), SAVITZKY_GOLAY_ORDER)
    grid, mean_charge = _binned(levels, width)
    if len(grid) < 4 * half:
        raise Refusal(
            f"voltage spans {1e3 * np.ptp(levels.volt):.3g} mV in the charge; at least "
            f"{4e3 * half * width:.3g} mV are needed at this noise and sampling"
        )
    filters = (savitzky_golay_weights(half, width, derivative)[::-1] for derivative in (0, 1))
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
        scatter_volt=float(max(levels.scatter_volt, between_bins)),
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
    columns = peaks(curve, prominence=prominence)._asdict()
    count = len(columns["voltage_volt"])
    if not count:
        raise Refusal(f"no peaks: dQ/dV at {c_rate:.3g}C is flat within {prominence:.0%}")
    return {
        "c_rate": np.full(count, c_rate),
        "peak": np.arange(1, count + 1),
    } | columns


def _spans(voltage, rising, levels):
    """Narrowest range of voltage with a fifth of the charge, and that of its middle 80 % [V]."""
    tenth = max(len(voltage) // 10, 1)
    sampled = slice(None, None, tenth // 500 + 1)
    if not np.median(voltage[-tenth:][sampled]) > np.median(voltage[:tenth][sampled]):
        raise Refusal("voltage does not rise in the charge")
    # Both in rising order give the monotone Q(V), whatever noise makes the voltage run back.
    shares = rising[0] + (rising[-1] - rising[0]) * np.linspace(0, 1, 101)
    rank = np.searchsorted(rising, shares, side="right") - 1
    after = np.minimum(rank + 1, len(rising) - 1)
    gap = np.maximum(rising[after] - rising[rank], np.finfo(float).tiny)
    low, high = volt_at_rank(levels, rank), volt_at_rank(levels, after)
    share_volt = low + (high - low) * (shares - rising[rank]) / gap
    return (share_volt[20:] - share_volt[:-20]).min(), share_volt[90] - share_volt[10]


def _quiet_window(scatter, density, slope_noise):
    """Width of the window in which the noise of dQ/dV is the given share of it [V].

    The noise falls with the window's width to the power 1.5.
    """
    half = 20
    constant = np.linalg.norm(savitzky_golay_weights(half, 1 / half, 1)) * np.sqrt(half)
    return 2 * (constant * scatter / (slope_noise * np.sqrt(density))) ** (2 / 3)


def _whole_steps(levels, wanted):
    """Bin width nearest the wanted one that holds whole steps of the converter [V].

    Bins that hold three steps here and four there would make a comb of dQ/dV.
    """
    number, rows = len(levels.volt), levels.rows.sum()
    step = np.quantile(np.diff(levels.volt), 0.1) if number > 1 else 0.0
    converter = step > 1e-6 and number < 0.5 * rows
    return float(step * max(round(wanted / step), 1)) if converter else wanted


def _binned(levels, width):
    """Voltages of the bins and the mean charge of the rows in each; empty bins by interpolation."""
    # Edges a quarter of a bin beside the lowest level: no level of the converter falls on one.
    bin_number = np.floor((levels.volt - levels.volt[0]) / width + 0.25).astype(int)
    rows = np.bincount(bin_number, levels.rows)
    filled = np.flatnonzero(rows)
    mean_charge = np.bincount(bin_number, levels.charge_ampere_hour)[filled] / rows[filled]
    mean_voltage = np.bincount(bin_number, levels.rows * levels.volt)[filled] / rows[filled]
    grid = levels.volt[0] + width * (np.arange(len(rows)) + 0.25)
    return grid, np.interp(grid, mean_voltage, mean_charge)
