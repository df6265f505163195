"""dQ/dV of a slow charge with a coarse voltage converter, and its peaks."""

from functools import partial

import numpy as np
from dq_dv.adaptive import adaptive_capacity
from dq_dv.binned import binned_capacity, counted_capacity
from dq_dv.on_grid import grid_peaks
from timing import Entry, Goal, Topic, where_importable

from cellwright.protocols.ica.charge import charge_slope
from cellwright.protocols.ica.spline import slope_peaks

ROWS, SEEDS, STEP_VOLT, NOISE_VOLT = 200_000, 20, 3e-4, 5e-5
VOLT = np.linspace(3.2, 4.15, 20_001)
PEAKS = ((3.55, 0.020, 0.8), (3.70, 0.025, 1.0), (3.95, 0.022, 0.6))
WINDOW_VOLT = 0.039
AMPWORKS = "ampworks DqdvSpline, told the noise, 1,000 of the rows"
PROMINENCE = 0.05  # of the highest point, for everyone


def _bell(centre, width, area):
    return area * np.exp(-0.5 * ((VOLT - centre) / width) ** 2) / (width * np.sqrt(2 * np.pi))


SLOPE = 0.5 + sum(_bell(*peak) for peak in PEAKS)
CHARGE = np.append(0, np.cumsum((SLOPE[1:] + SLOPE[:-1]) / 2 * np.diff(VOLT)))
TOPS = np.flatnonzero((SLOPE[1:-1] > SLOPE[:-2]) & (SLOPE[1:-1] > SLOPE[2:])) + 1


def topic():
    """Topic: 200,000 rows in steps of 0.3 mV, three peaks."""
    makers = {
        "**Cellwright**": lambda: _entry("**Cellwright**", _ours, runs=9),
        "binned": lambda: _entry("mean charge of bins, Savitzky-Golay", _by_bins, runs=21),
        "counting": lambda: _entry("rows counted by voltage (LEAN)", _by_counting, runs=21),
        "adaptive": lambda: _entry("adaptive filter of the thesis", _by_thesis, runs=1),
        "interp": lambda: _entry("uniform grid by interpolation, scipy savgol_filter", _by_grid),
        "PyProBE": lambda: _entry("PyProBE, level evaluation (LEAN)", _by_levels, runs=3),
        "cellpy": lambda: _entry("cellpy dqdv_np, its own settings", _by_cellpy, runs=1),
        "ampworks": lambda: _entry(AMPWORKS, _by_ampworks, runs=3),
    }
    needed = {"PyProBE": ("pyprobe", "polars"), "cellpy": ("cellpy",), "ampworks": ("ampworks",)}
    entries, skipped = where_importable(needed, makers)
    return Topic(
        "dQ/dV of a slow charge",
        f"{ROWS:,} rows of a charge read in steps of {1e3 * STEP_VOLT:g} mV, with 0.05 mV of "
        f"noise; windows of {1e3 * WINDOW_VOLT:g} mV, order 5; the time "
        "is that of the curve, without the search for peaks",
        f"over {SEEDS} seeds: RMS error of the peaks' positions, mean error of their heights, "
        "false peaks",
        entries,
        skipped,
        goals=(Goal("**Cellwright**", 1e-3),),
    )


def record(seed):
    """Charge and voltage as the converter shows it; every seed has its own offset of the levels."""
    rng = np.random.default_rng(seed)
    charge = np.linspace(0, CHARGE[-1], ROWS)
    volt = np.interp(charge, CHARGE, VOLT) + NOISE_VOLT * rng.standard_normal(ROWS)
    offset = rng.uniform(0, STEP_VOLT)
    return np.round((volt - offset) / STEP_VOLT) * STEP_VOLT + offset, charge


def _entry(name, curve, runs=5):
    first = record(0)

    def judge(_found):
        return _accuracy([_tops(*curve(*record(seed))) for seed in range(SEEDS)])

    return Entry(name, lambda: curve(*first), judge, runs=runs)


def _ours(volt, charge):
    curve, slope = charge_slope(volt, charge)
    found = partial(slope_peaks, slope)
    return curve.voltage_volt, curve.dq_dv_ampere_hour_per_volt, found


def _on_grid(method, volt, charge):
    curve = method(volt, charge, bin_volt=3e-3, smooth_volt=WINDOW_VOLT)
    found = partial(grid_peaks, curve)
    return curve.voltage_volt, curve.dq_dv_ampere_hour_per_volt, found


_by_bins, _by_counting = (partial(_on_grid, of) for of in (binned_capacity, counted_capacity))


def _by_thesis(volt, charge):
    curve = adaptive_capacity(volt, charge)
    found = partial(grid_peaks, curve)
    return curve.voltage_volt, curve.dq_dv_ampere_hour_per_volt, found


def _by_grid(volt, charge):
    """Sorted, interpolated at every millivolt, smoothed and differentiated by scipy."""
    from scipy.signal import savgol_filter

    levels, first = np.unique(volt, return_index=True)
    grid = np.arange(levels[0], levels[-1], 1e-3)
    slope = savgol_filter(np.interp(grid, levels, charge[first]), 39, 5, deriv=1, delta=1e-3)
    return grid, slope, None


def _by_levels(volt, charge):
    """PyProBE counts how often a voltage level was read, and smooths over five levels."""
    import polars
    from pyprobe.analysis.differentiation import differentiate_lean
    from pyprobe.result import Result

    names = ("Capacity [Ah]", "Voltage [V]")
    frame = polars.DataFrame(dict(zip(names, (charge, volt), strict=True)))
    record_of = Result(lf=frame, info={})
    found = differentiate_lean(record_of, *names, gradient="dxdy")
    slope = next(name for name in found.columns if name.startswith("d("))
    return found.get(names[1]), found.get(slope), None


def _by_cellpy(volt, charge):
    """Without its last step, which scales the curve to the charge of the half cycle."""
    from cellpy.utils.ica import dqdv_np

    grid, slope = dqdv_np(volt, charge, post_normalization=False)
    return np.asarray(grid), np.asarray(slope), None


def _by_ampworks(volt, charge):
    """Its smoothing is a sum of squared residuals that the user gives: that of noise and steps.

    All rows would take it a minute; of 1,000 rows its peaks are nearer than of 4,000.
    """
    import ampworks

    frame = ampworks.Dataset({"Ah": charge - charge[0], "Volts": volt})
    frame = frame.downsample(n=1000, ignore_index=True)
    square = NOISE_VOLT**2 + STEP_VOLT**2 / 12
    spline = ampworks.dqdv.DqdvSpline().fit(frame, s=len(frame) * square)
    share = np.linspace(0.002, 0.998, 4001)
    return spline.volts_(share), spline.dqdv_(share) * np.ptp(charge), None


def _tops(volt, slope, found):
    """(position, height) of the peaks: by the method's own search where it has one."""
    if found is not None:
        tops = found(prominence=PROMINENCE)
        return tops.voltage_volt, tops.height_ampere_hour_per_volt
    from scipy.signal import find_peaks

    at, _ = find_peaks(slope, prominence=PROMINENCE * np.nanmax(slope))
    return volt[at], slope[at]


def _accuracy(found):
    """Each true peak takes the nearest found one; what is left over is false."""
    false = sum(max(len(volt) - len(TOPS), 0) for volt, _ in found) / len(found)
    position, height = [], []
    for volt, tall in found:
        nearest = [int(np.argmin(np.abs(volt - one))) for one in VOLT[TOPS]]
        position.append(volt[nearest] - VOLT[TOPS])
        height.append(tall[nearest] / SLOPE[TOPS] - 1)
    rms = 1e3 * np.sqrt(np.mean(np.square(position)))
    bias = 100 * np.abs(np.mean(height, axis=0)).max()
    return f"{rms:.2f} mV, {bias:.1f} %, {false:.1f} false"
