"""dQ/dV on a grid of voltage: the mean charge in bins, filtered; or rows counted by voltage."""

from typing import NamedTuple

import numpy as np

from cellwright.numerics.linear import SAVITZKY_GOLAY_ORDER, savitzky_golay_weights
from cellwright.numerics.statistics import robust_std
from cellwright.protocols.ica.blocks import rises, tally
from cellwright.refusal import Refusal
from dq_dv.on_grid import gridded

LEAST_ROWS = 50


class _Levels(NamedTuple):
    """Each level of the converter once: voltage [V], how often it was read, mean charge [Ah]."""

    volt: np.ndarray
    rows: np.ndarray
    charge_ampere_hour: np.ndarray


def binned_capacity(
    voltage_volt,
    charge_ampere_hour,
    *,
    bin_volt,
    smooth_volt,
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
    curve : GridCurve, half a window short at each end.

    Raises
    ------
    Refusal : fewer than 50 rows, or a voltage that rises by less than two windows.

    Source: Savitzky & Golay, Anal. Chem. 36 (1964) 1627; dQ/dV: thesis eq. 4.1.
    """
    limits = densest_share, slope_noise
    layout = _laid_out(voltage_volt, charge_ampere_hour, bin_volt, smooth_volt, *limits)
    levels, width, half = layout.levels, layout.bin_volt, layout.half
    grid, mean_charge = _binned(levels, width)
    _wide_enough(grid, layout)
    filters = (savitzky_golay_weights(half, width, derivative)[::-1] for derivative in (0, 1))
    smooth, slope = (np.convolve(mean_charge, filter_, "valid") for filter_ in filters)
    removed = (mean_charge[half:-half] - smooth) / np.maximum(slope, slope.max() / 100)
    rows = np.maximum(slope * width * layout.density, 1.0)
    between_bins = robust_std(removed * np.sqrt(rows))
    return gridded(
        grid[half:-half],
        slope,
        bin_volt=width,
        smooth_volt=(2 * half + 1) * width,
        scatter_volt=max(layout.scatter_volt, between_bins),
        density=layout.density,
    )


def counted_capacity(
    voltage_volt,
    charge_ampere_hour,
    *,
    bin_volt,
    smooth_volt,
    densest_share=0.8,
    slope_noise=0.02,
):
    """dQ/dV by counting: the rows at each voltage, times the charge of a row, over its width.

    At constant current a voltage is read the longer the flatter the curve. Counts in bins of whole
    steps of the converter are smoothed by a Savitzky-Golay filter of order 5 for the value.

    Parameters
    ----------
    voltage_volt, charge_ampere_hour, bin_volt, smooth_volt, densest_share, slope_noise : as for
        `binned_capacity`.

    Returns
    -------
    curve : GridCurve, half a window short at each end.

    Raises
    ------
    Refusal : as `binned_capacity`.

    Source: level evaluation (LEAN): X. Feng et al., eTransportation 3 (2020) 100051.
    """
    limits = densest_share, slope_noise
    layout = _laid_out(voltage_volt, charge_ampere_hour, bin_volt, smooth_volt, *limits)
    levels, width, half = layout.levels, layout.bin_volt, layout.half
    number = np.floor((levels.volt - levels.volt[0]) / width + 0.25).astype(int)
    rows = np.bincount(number, levels.rows)
    grid = levels.volt[0] + width * (np.arange(len(rows)) + 0.25)
    _wide_enough(grid, layout)
    weights = savitzky_golay_weights(half, width, 0)[::-1]
    return gridded(
        grid[half:-half],
        np.convolve(rows / (layout.density * width), weights, "valid"),
        bin_volt=width,
        smooth_volt=(2 * half + 1) * width,
        scatter_volt=layout.scatter_volt,
        density=layout.density,
    )


class _Layout(NamedTuple):
    """Levels of a record, width of a bin [V], half a window in bins, rows per charge [1/Ah].

    scatter_volt : white noise of one row along the axis of voltage [V].
    """

    levels: object
    bin_volt: float
    half: int
    density: float
    scatter_volt: float


def _laid_out(voltage_volt, charge_ampere_hour, bin_volt, smooth_volt, densest_share, slope_noise):
    """Bins and window that noise and sampling of a charge allow."""
    voltage, charge = np.asarray(voltage_volt, float), np.asarray(charge_ampere_hour, float)
    if len(voltage) < LEAST_ROWS:
        raise Refusal(f"{len(voltage)} rows of charge are too few for dQ/dV; 50 are needed")
    levels = _Levels(*tally(voltage, charge))
    rising = np.sort(charge, kind="stable")
    scatter = float(np.sqrt(np.sum(np.diff(voltage, 2) ** 2) / max(len(voltage) - 2, 1) / 6))
    if rising[-1] <= rising[0]:
        raise Refusal(f"no charge was moved in {len(voltage)} rows")
    densest, typical = _spans(voltage, rising, levels)
    density = 0.8 * len(voltage) / typical
    quiet = _quiet_window(scatter, density, slope_noise)
    window = max(min(smooth_volt, densest_share * densest), quiet)
    finest = max(min(bin_volt, window / (2 * SAVITZKY_GOLAY_ORDER + 1)), 2 / density)
    width = _whole_steps(levels, finest)
    half = max(round(window / width / 2), SAVITZKY_GOLAY_ORDER)
    return _Layout(levels, width, half, len(voltage) / (rising[-1] - rising[0]), scatter)


def _wide_enough(grid, layout):
    """Refuse a charge over less than two windows of voltage."""
    if len(grid) < 4 * layout.half:
        raise Refusal(
            f"voltage spans {1e3 * np.ptp(layout.levels.volt):.3g} mV in the charge; at least "
            f"{4e3 * layout.half * layout.bin_volt:.3g} mV are needed at this noise and sampling"
        )


def _spans(voltage, rising, levels):
    """Narrowest range of voltage with a fifth of the charge, and that of its middle 80 % [V]."""
    if not rises(voltage):
        raise Refusal("voltage does not rise in the charge")
    # Both in rising order give the monotone Q(V), whatever noise makes the voltage run back.
    shares = rising[0] + (rising[-1] - rising[0]) * np.linspace(0, 1, 101)
    rank = np.searchsorted(rising, shares, side="right") - 1
    after = np.minimum(rank + 1, len(rising) - 1)
    gap = np.maximum(rising[after] - rising[rank], np.finfo(float).tiny)
    low, high = _volt_at_rank(levels, rank), _volt_at_rank(levels, after)
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
    tenth = (number - 1) // 10
    step = np.partition(np.diff(levels.volt), tenth)[tenth] if number > 1 else 0.0
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


def _volt_at_rank(levels, rank):
    """Voltage at ranks (m,) in the order of rising voltage, from 0 [V]."""
    return levels.volt[np.searchsorted(np.cumsum(levels.rows), rank, side="right")]
