"""dQ/dV by the adaptive filter of the thesis: stiff in the middle of a charge, less at its ends."""

import numpy as np

from cellwright.protocols.ica.curve import BIN_VOLT, gridded

FIRST_DIVISOR = 5
MARGIN_SHARE = 0.035  # 500 rows of a C/2 charge read twice a second, as the thesis' code adds
LEAST_SPAN = 5


def adaptive_capacity(
    voltage_volt,
    charge_ampere_hour,
    *,
    bin_volt=BIN_VOLT,
    span_share=1 / 20,
    threshold_volt=4e-4,
    end_volt=1e-3,
):
    """dQ/dV of one constant-current charge by the adaptive filter of the thesis.

    1. A Savitzky-Golay filter of degree 2 over a share of the record smooths the voltage. 2. What
    it removed is smoothed over N/100; where that exceeds the threshold, in the first and the last
    half, the filter was too stiff: from there to the end of the record the rows are filtered again
    with spans of N_end/5, N_end/6, … until the mean of what is removed is small. 3. The parts are
    joined, the slope is taken across N/100 rows, inverted, and smoothed once more.

    Parameters
    ----------
    voltage_volt, charge_ampere_hour : (n,) rows of one charge [V], [Ah], the charge by the true
        times of the rows.
    bin_volt : width of a bin of the curve [V].
    span_share : span of the first filter, as a share of the record [1]. threshold_volt : where
        the filter removes more, an end of the charge is filtered again [V]. end_volt : spans at
        the ends shrink until less than this is removed on average [V].

    Returns
    -------
    curve : IncrementalCapacity; dQ/dV of the rows averaged over bins of `bin_volt`.

    Source: thesis 4.4 and appendix A. Erratum: text (N/10, 0.6 mV) and code (N/20, 0.4 mV) differ,
    the code's are the defaults; it multiplies each time by the current of that row, and its limits
    of 10,000 and 500 rows fit one length of record: here halves of the record, and a share of it.
    """
    voltage, charge = np.asarray(voltage_volt, float), np.asarray(charge_ampere_hour, float)
    apart = max(len(voltage) // 100, 1)
    first = _savitzky_golay(voltage, span_share)
    smooth = _refiltered(voltage, first, threshold_volt, end_volt)
    rise = smooth[apart:] - smooth[:-apart]
    passed = charge[apart:] - charge[:-apart]
    slope = np.divide(passed, rise, where=rise > 0, out=np.full(len(rise), np.nan))
    known = np.isfinite(slope)
    middle = (smooth[apart:] + smooth[:-apart])[known] / 2
    height = _savitzky_golay(slope[known], 1 / 100)
    bend = np.sum(np.diff(voltage, 2) ** 2)
    grid, mean = _averaged(middle, height, bin_volt)
    return gridded(
        grid,
        mean,
        bin_volt=float(grid[1] - grid[0]),
        smooth_volt=float(span_share * np.ptp(voltage)),
        scatter_volt=np.sqrt(bend / max(len(voltage) - 2, 1) / 6),
        density=len(voltage) / np.ptp(charge),
        method="adaptive",
    )


def _savitzky_golay(values, share):
    """Values (n,) under a filter of degree 2 whose span is a share of them."""
    from scipy.signal import savgol_filter

    span = max(2 * int(share * len(values) / 2) + 1, LEAST_SPAN)
    return savgol_filter(values, min(span, 2 * ((len(values) - 1) // 2) + 1), 2, mode="interp")


def _refiltered(voltage, smooth, threshold_volt, end_volt):
    """Smoothed voltage with both ends filtered again where too much was removed."""
    rows, margin = len(voltage), int(MARGIN_SHARE * len(voltage))
    joined = smooth.copy()
    much = np.abs(_savitzky_golay(smooth - voltage, 1 / 100)) > threshold_volt
    early = np.flatnonzero(much[: rows // 2])
    late = np.flatnonzero(much[rows // 2 :]) + rows // 2
    if len(early):
        stop = min(early[-1] + margin, rows // 2)
        joined[:stop] = _end(voltage[:stop], end_volt)
    if len(late):
        start = max(late[0] - margin, rows // 2)
        joined[start:] = _end(voltage[start:], end_volt)
    return joined


def _end(voltage, limit):
    """An end of the record, filtered with ever shorter spans until little is removed."""
    smooth = voltage
    for divisor in range(FIRST_DIVISOR, max(len(voltage) // LEAST_SPAN, FIRST_DIVISOR + 1)):
        smooth = _savitzky_golay(voltage, 1 / divisor)
        if np.mean(np.abs(smooth - voltage)) < limit:
            break
    return smooth


def _averaged(voltage, height, width):
    """Uniform grid of voltage and the mean of the rows in each bin; empty bins by interpolation."""
    number = np.floor((voltage - voltage.min()) / width).astype(int)
    rows = np.bincount(number)
    filled = np.flatnonzero(rows)
    grid = voltage.min() + width * (np.arange(len(rows)) + 0.5)
    return grid, np.interp(grid, grid[filled], np.bincount(number, height)[filled] / rows[filled])
