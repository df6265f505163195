"""Diffusion in a sphere, from the rest after a constant current: its time R²/D with a deviation.

While current flows the surface of a particle leads its mean; in the rest the two even out. How that
goes with time, whatever its size, tells R²/D; its size over what the open-circuit voltage moved by
tells it once more.
"""

from typing import NamedTuple

import numpy as np

from cellwright.numerics.exponentials import UNDETERMINED
from cellwright.numerics.sphere import sphere_roots
from cellwright.numerics.statistics import parameter_covariance
from cellwright.protocols.relaxation import evened
from cellwright.refusal import Refusal

TERMS = 150  # of the series at most: what is beyond is 0.7 % of the first rows at most
EIGENVALUES = sphere_roots(TERMS)
GRID, FAST_GRID, GRID_ROWS = 40, 12, 100  # times and rows that the search starts from
FEWEST = 12  # samples of a rest
VERY_STRONG = 10.0  # of a criterion's difference (Kass, Raftery, J. Am. Stat. Assoc. 90 (1995) 773)


class Diffusion(NamedTuple):
    """second, std_second : R²/D and its standard deviation [s]. by_size_second : what the size of
    the relaxation says of it alone [s], NaN where the voltage before the load was none of a rest.
    rmse_volt : left of the fit [V]. fast_second : time constant of what relaxes beside it [s], NaN
    where nothing is told.
    """

    second: float
    std_second: float
    by_size_second: float
    rmse_volt: float
    fast_second: float


class _Fit(NamedTuple):
    """logs : ln of the times [s], the diffusion's first. linear : OCV, sizes [V]. std : of linear,
    then of the logs. power : sum of squares [V²]. samples."""

    logs: np.ndarray
    linear: np.ndarray
    std: np.ndarray
    power: float
    samples: int

    @property
    def criterion(self):
        """Bayesian information criterion."""
        return _criterion(self.power, self.samples, len(self.std))


# ASSUME: What is slowest in a rest is diffusion in spheres of one size, on a straight piece of the
# open-circuit voltage.
def diffusion_of_rest(
    second, voltage_volt, exponentials, *, load_second, current_ampere, before_volt=np.nan
):
    """R²/D from the rest after a constant current that began at equilibrium.

    V = V∞ + a·x(t) + b·exp(−t/τ), x = Σ 2/λ² (1 − exp(−λ² d/T)) exp(−λ² t/T), tan λ = λ, T = R²/D,
    d the length of the load; b only where the rest tells it. a = T/3d·ΔV, ΔV by which the load
    moved the open-circuit voltage, says T once more: by what the two differ, as of even odds, the
    deviation is widened.

    second, voltage_volt : (n,) since the load ended [s], [V]. exponentials : Relaxation that is
        fitted to the same rows. load_second, current_ampere : of the load [s], [A] positive on
        charge. before_volt : voltage of the rest before it [V], NaN without.

    Returns diffusion: Diffusion. Raises Refusal: too few samples, T beyond what the rest tells, a
    voltage that relaxes against its load, exponentials that fit better than a sphere, or a T that
    is no surer than by half.

    Source: J. Crank, The Mathematics of Diffusion (1975), eq. 6.45; W. Weppner, R. A. Huggins, J.
    Electrochem. Soc. 124 (1977) 1569.
    """
    begin = second[0]
    time, voltage = evened(np.asarray(second, float) - begin, np.asarray(voltage_volt, float))
    time = time + begin
    if len(time) < FEWEST:
        raise Refusal(f"rest has {len(time)} samples, wanted {FEWEST} for diffusion")
    # Of exponentials without diffusion: that the sphere has to fit better than.
    others = _criterion(
        exponentials.sse_volt2, exponentials.samples, 1 + 2 * len(exponentials.tau_second)
    )
    grid = _grid(time, load_second)
    fit = _fitted(time, voltage, load_second, grid, fast=False)
    if fit.criterion > others:
        with_fast = _fitted(time, voltage, load_second, grid, fast=True)
        fit = with_fast if _told(with_fast) and with_fast.criterion < fit.criterion else fit
    diffusion, std = float(np.exp(fit.logs[0])), float(fit.std[len(fit.linear)])
    moved = fit.linear[0] - before_volt
    by_size = 3.0 * fit.linear[1] * load_second / moved if np.isfinite(moved) and moved else np.nan
    _refuse(fit, time, current_ampere, others)
    apart = np.nan_to_num(np.log(by_size / diffusion)) if by_size > 0 else 0.0
    share = float(np.hypot(std, apart / np.sqrt(3.0)))
    # Half as much again or less: beyond, it is not told (as a parameter of a fit).
    if not share <= UNDETERMINED:
        raise Refusal(
            f"its shape says R²/D = {diffusion:.3g} s, its size {by_size:.3g} s: no diffusion in "
            f"spheres alone, within {UNDETERMINED:.0%}"
        )
    rmse = float(np.sqrt(fit.power / (fit.samples - len(fit.std))))
    fast = float(np.exp(fit.logs[1])) if len(fit.logs) > 1 else np.nan
    return Diffusion(diffusion, diffusion * share, float(by_size), rmse, fast)


def surface_excess(second, load_second, diffusion_second):
    """By how much the surface still leads the mean (n,) [1], and its derivative by ln(R²/D).

    In units of flux·R/D; a third of it times R²/D is the lead in state of charge of a current that
    moves one unit of charge a second. second : (n,) since the load ended [s]. load_second,
    diffusion_second : length of the load, R²/D [s].
    """
    # What has decayed to 1e-5 by the first row is in none of them.
    most = np.sqrt(12.0 * diffusion_second / second[0]) / np.pi
    squares = EIGENVALUES[: int(min(most + 2.0, TERMS))] ** 2
    rates, sizes = squares / diffusion_second, 2.0 / squares
    decays, older = np.exp(np.outer(second, -rates)), np.exp(-rates * load_second)
    slope = second * (decays @ (sizes * rates * (1.0 - older)))
    slope -= decays @ (sizes * rates * load_second * older)
    return decays @ (sizes * (1.0 - older)), slope


def _limits(time):
    """Least and most R²/D that a rest tells [s]: its slowest part fits in, three times the rest."""
    steps = np.diff(time)
    slowest = EIGENVALUES[0] ** 2
    return 0.25 * slowest * float(steps[steps > 0].min()), 3.0 * slowest * float(time[-1])


def _columns(time, load_second, logs):
    """Rows 1, x(t) and, of two logs, an exponential; and their derivatives by the logs."""
    excess, slope = surface_excess(time, load_second, np.exp(logs[0]))
    rows, slopes = [np.ones(len(time)), excess], [slope]
    if len(logs) > 1:
        ratio = time / np.exp(logs[1])
        rows.append(np.exp(-ratio))
        slopes.append(ratio * rows[-1])
    return np.array(rows), np.array(slopes)


def _fitted(time, voltage, load_second, grid, *, fast):
    """Least squares of the sphere, with an exponential beside it where `fast`, as `_Fit`."""
    from scipy.optimize import least_squares

    level = float(voltage.mean())
    low, high = np.log(_limits(time))
    fastest = np.log(0.25 * np.diff(time).min()), np.log(time[-1])
    best = _start(time, voltage - level, grid, fastest if fast else None)

    def solved(logs):
        rows, slopes = _columns(time, load_second, logs)
        return rows, slopes, np.linalg.lstsq(rows.T, voltage - level, rcond=None)[0]

    def left(logs):
        rows, _, linear = solved(logs)
        return voltage - level - linear @ rows

    def slope(logs):
        # What the linear parameters take up again is no change (L. Kaufman, BIT 15 (1975) 49).
        rows, slopes, linear = solved(logs)
        moved = (linear[1:, None] * slopes).T
        return rows.T @ np.linalg.lstsq(rows.T, moved, rcond=None)[0] - moved

    bounds = np.array([[low, high], fastest][: len(best)]).T
    logs = least_squares(left, best, slope, bounds=bounds).x
    rows, slopes, linear = solved(logs)
    residual = voltage - level - linear @ rows
    sensitivity = np.concatenate([rows, linear[1:, None] * slopes])
    power = float(residual @ residual)
    covariance = parameter_covariance(
        sensitivity @ sensitivity.T, power, len(time), sensitivity=sensitivity, residual=residual
    )
    linear[0] += level
    return _Fit(logs, linear, np.sqrt(np.diag(covariance)), power, len(time))


def _some(time):
    """Rows of a rest that the search starts from."""
    return slice(None, None, max(1, len(time) // GRID_ROWS))


def _grid(time, load_second):
    """Logs of R²/D that the search starts from, and x(t) of each at some rows."""
    logs = np.linspace(*np.log(_limits(time)), GRID + 2)[1:-1]
    rows = time[_some(time)]
    return [(log, surface_excess(rows, load_second, np.exp(log))[0]) for log in logs]


def _start(time, moved, grid, fastest):
    """Logs of the times that fit best of a grid, by some rows of the rest."""
    time, moved = time[_some(time)], moved[_some(time)]
    logs = np.array([log for log, _ in grid])
    shape, moved = (_about_mean(rows) for rows in (np.array([x for _, x in grid]), moved))
    of_shape, size = shape @ moved, np.sum(shape**2, axis=1)
    if fastest is None:
        return logs[[np.argmax(of_shape**2 / size)]]
    fast = np.linspace(*fastest, FAST_GRID + 2)[1:-1]
    decay = _about_mean(np.exp(-time / np.exp(fast)[:, None]))
    of_decay, length, both = decay @ moved, np.sum(decay**2, axis=1), shape @ decay.T
    # What both together take off the sum of squares, for each pair.
    alone = size[:, None] * length - both**2
    taken = of_shape[:, None] ** 2 * length + of_decay**2 * size[:, None]
    taken = (taken - 2 * of_shape[:, None] * of_decay * both) / np.maximum(alone, 1e-300)
    alike = alone <= 1e-9 * size[:, None] * length  # two shapes that are one tell nothing apart
    k, j = np.unravel_index(np.argmax(np.where(alike, -np.inf, taken)), taken.shape)
    return np.array([logs[k], fast[j]])


def _about_mean(rows):
    return rows - rows.mean(axis=-1, keepdims=True)


def _told(fit):
    """Whether the fast part has a size and a time constant that exclude zero."""
    size, std = abs(fit.linear[2]), fit.std[2]
    return bool(std <= UNDETERMINED * size and fit.std[-1] <= UNDETERMINED)


def _refuse(fit, time, current, others):
    """Refuse a fit that does not tell R²/D; others : criterion of exponentials without it."""
    found, (least, most) = float(np.exp(fit.logs[0])), _limits(time)
    if not 1.02 * least < found < 0.98 * most:
        raise Refusal(f"R²/D lies beyond what the rest tells, {least:.3g} to {most:.3g} s")
    if fit.linear[1] * current <= 0:
        raise Refusal("its slow part relaxes away from the open-circuit voltage: no diffusion")
    if others < fit.criterion - VERY_STRONG:
        raise Refusal("exponentials fit it better than diffusion in a sphere does")
    if not fit.std[len(fit.linear)] <= UNDETERMINED:
        raise Refusal(f"R²/D of {found:.3g} s is no surer than by half")


def _criterion(power, samples, count):
    """Bayesian information criterion of a sum of squares [V²] with so many parameters."""
    return samples * np.log(power / samples) + count * np.log(samples)
