"""Half cells that a user measured: noisy tables of any length, made smooth."""

import numpy as np

from cellwright.health.electrodes.half_cells import CHARGE_STD, POINTS, HalfCell, with_ends
from cellwright.numerics.statistics import rms
from cellwright.refusal import Refusal


def from_table(lithiation, potential_volt, *, name):
    """A half cell measured by the user, smoothed to its own noise.

    Parameters
    ----------
    lithiation, potential_volt : (n,) [1], [V], in any order, of any spacing.
    name : of the file, for messages.

    Raises
    ------
    Refusal : fewer than 20 rows, lithiation outside 0 to 1, or a potential that does not fall with
        it, but for 5 mV of noise.
    """
    lithiation, potential = np.asarray(lithiation, float), np.asarray(potential_volt, float)
    finite = np.isfinite(lithiation) & np.isfinite(potential)
    lithiation, first = np.unique(lithiation[finite], return_index=True)
    potential = potential[finite][first]
    if len(lithiation) < 20:
        raise Refusal(f"{name}: {len(lithiation)} rows of lithiation and potential, at least 20")
    if lithiation[0] < -CHARGE_STD or lithiation[-1] > 1 + CHARGE_STD:
        found = f"{lithiation[0]:.3g} to {lithiation[-1]:.3g}"
        raise Refusal(f"{name}: lithiation runs from {found}, wanted within 0 to 1 (not percent)")
    return with_ends(HalfCell(name, *_smooth(lithiation, potential, name), name))


def _smooth(lithiation, potential, name):
    """Lithiation (4001,) and potential that falls smoothly through a table's readings.

    A median over neighbouring rows, which leaves any falling table as it is, takes out stray
    readings. The falling curve nearest to the rest has steps as wide as noise and digits make
    them: a smooth curve runs through their middles. What is narrower than the charge of a slow
    curve resolves is averaged. So nothing is left to choose, and the number of rows does not count.
    """
    from scipy.interpolate import PchipInterpolator
    from scipy.optimize import isotonic_regression
    from scipy.signal import medfilt

    # Nine rows: up to four neighbouring readings on another curve do not count.
    median = medfilt(np.pad(potential, 4, mode="edge"), 9)[4:-4]
    falling = -isotonic_regression(-median).x
    noise = rms(median - falling)
    steps = np.cumsum(np.diff(falling, prepend=falling[0]) < 0)
    most_noise_volt = 0.005
    if noise > most_noise_volt or falling[0] - falling[-1] < most_noise_volt:
        raise Refusal(
            f"{name}: potential does not fall with lithiation, as it does against lithium: "
            f"{1e3 * noise:.0f} mV off any curve that does. Is the column state of charge instead?"
        )
    middles = np.bincount(steps, lithiation) / np.bincount(steps)
    levels = falling[np.append(True, np.diff(steps) > 0)]
    middles[0], middles[-1] = lithiation[0], lithiation[-1]
    curve = PchipInterpolator(middles, levels)
    grid, charge = np.linspace(*lithiation[[0, -1]], POINTS), curve.antiderivative()
    half_width = np.minimum(np.sqrt(3) * CHARGE_STD, np.minimum(grid - grid[0], grid[-1] - grid))
    averaged, inner = curve(grid), slice(1, -1)
    low, high = (charge(grid[inner] + way * half_width[inner]) for way in (-1, 1))
    # The mean over a width by the difference of the integral at its ends.
    averaged[inner] = (high - low) / (2 * half_width[inner])
    return grid, averaged
