"""Relaxation of the voltage after a load: one or two exponentials, or why there are none."""

from typing import NamedTuple

import numpy as np

from cellwright.numerics.clock import checked_columns
from cellwright.numerics.exponentials import UNDETERMINED, Normal, best_of_grid, levenberg
from cellwright.numerics.noise import least_digit
from cellwright.numerics.statistics import is_white, parameter_covariance, white_noise_of
from cellwright.protocols.half_cycles import weighted_median
from cellwright.refusal import Refusal

FEWEST = 8  # samples of a rest


class Relaxation(NamedTuple):
    """V(t) = OCV + Σ a_j·exp(−t/tau_j), t from the first sample; pairs by ascending tau.

    ocv_volt, ocv_std_volt : the end that is extrapolated [V]. amplitude_volt, tau_second : (m,)
    and their _std; amplitudes are negative where the voltage rises, after a discharge. Deviations
    are widened where residuals are coloured; NaN where not told. ahead_volt : OCV minus the
    fitted voltage at the last sample: what is extrapolated [V]. drift_volt : OCV minus the OCV that
    the first half of the rest alone would give [V]; NaN where that half is too short. sse_volt2,
    r_squared, rmse_volt : of the fit, the RMSE with the degrees of freedom (as in table 2.2).
    samples. passes : over them, of this fit. verdict : what the rest does not
    tell, in words; empty where it tells two exponentials.
    """

    ocv_volt: float
    ocv_std_volt: float
    amplitude_volt: np.ndarray
    amplitude_std_volt: np.ndarray
    tau_second: np.ndarray
    tau_std_second: np.ndarray
    ahead_volt: float
    drift_volt: float
    sse_volt2: float
    r_squared: float
    rmse_volt: float
    samples: int
    passes: int
    verdict: str


def fit_relaxation(time_second, voltage_volt, *, most=2):
    """Exponentials of the voltage of a rest: two, or one where the data do not determine two.

    They are determined where every amplitude and every time constant has a 95 % interval that
    excludes zero (relative standard deviation up to 0.51) and none lies at a limit of its search: a
    quarter of the shortest step, and three times the length of the rest. Samples closer than the
    usual step are averaged first. The OCV's deviation holds only if the rest is exponential to its
    end: real ones have slower tails, and twice `drift_volt` is the better measure of how far off
    the OCV may be.

    time_second : (n,) of a rest at zero current, from its first sample on [s].
    voltage_volt : (n,) [V].
    most : exponentials to try; of three, the fastest is charge transfer or what a logger smears.

    Returns relaxation: Relaxation. Raises Refusal: lengths differ, not finite, fewer than 8
    samples, time runs back or stands still, a gap (more than 0.6 of the rest between two samples),
    a voltage that does not move.

    Source: thesis sec. 2.3, table 2.2; (3.16).
    """
    # ASSUME: A rest relaxes by at most two or three exponentials; what is slower counts as OCV.
    time, voltage = np.asarray(time_second, float), np.asarray(voltage_volt, float)
    _check(time, voltage)
    time, voltage = evened(time - time[0], voltage)
    whole, half = _best(time, voltage, most), time <= time[-1] / 2
    if half.sum() < FEWEST or voltage[half].max() == voltage[half].min():
        return whole
    part = _best(time[half], voltage[half], most)
    drift = whole.ocv_volt - part.ocv_volt
    whole = whole._replace(drift_volt=drift)
    # Beyond three deviations of the less sure OCV the difference is no chance.
    if not abs(drift) > 3.0 * part.ocv_std_volt:
        return whole
    slower_tail = f"the first half alone gives an OCV {1e3 * abs(drift):.2f} mV away: a slower tail"
    return whole._replace(verdict="; ".join(filter(None, [whole.verdict, slower_tail])))


def _best(time, voltage, most):
    """Fit of the most exponentials that the data determine; at least one, with what they do not."""
    fit, undetermined = _fitted(time, voltage, most)
    if not undetermined:
        return fit
    if most > 2:
        return _best(time, voltage, most - 1)
    single, single_undetermined = _fitted(time, voltage, 1)
    verdict = f"two exponentials cannot be told ({undetermined}): one is given"
    addition = f"; of that, {single_undetermined}" if single_undetermined else ""
    return single._replace(verdict=verdict + addition)


def _fitted(time, voltage, pairs):
    """Fit of a number of exponentials, and which of its parameters are not determined, in words."""
    steps = np.diff(time)
    # What decays in less than a quarter of a step is in one sample only.
    limits = 0.25 * float(steps[steps > 0].min()), 3.0 * float(time[-1])
    anywhere = np.full(1 + pairs, -np.inf), np.full(1 + pairs, np.inf)
    # The grid only finds the valley; some hundred samples are enough for that.
    every = slice(None, None, max(1, len(time) // 800))
    # Taken from its mean, the voltage keeps all its digits in sums of squares.
    level = voltage.mean()

    def on_grid(tau):
        return _normal(_columns(time[every], tau), np.zeros(1 + len(tau)), voltage[every] - level)

    def normal_at(log_tau, linear):
        columns = _columns(time, np.exp(log_tau), sloped=True)
        return _normal(columns, linear, voltage - level)

    tau, linear = best_of_grid(on_grid, 1, [limits] * pairs, anywhere)
    logs = np.log(limits)[:, None] * np.ones(pairs)
    optimum, passes = levenberg(normal_at, np.log(tau), linear, (logs, anywhere), samples=len(time))
    order = np.argsort(optimum.log_tau)
    linear, tau = optimum.linear[[0, *(1 + order)]], np.exp(optimum.log_tau[order])
    std, residual = _deviations(time, voltage - level, linear, tau)
    lost = _lost(linear, tau, std, limits)
    return _result(linear, tau, std, residual, voltage, level, time[-1], passes), lost


def _deviations(time, voltage, linear, tau):
    """Standard deviations of OCV, amplitudes [V], time constants [s]; residuals (n,) [V]."""
    columns = _columns(time, tau, sloped=True)
    residual = voltage - linear @ columns[: len(linear)]
    columns[len(linear) :] *= linear[1:, None] / tau[:, None]
    gram, power = columns @ columns.T, residual @ residual
    series = {"sensitivity": columns, "residual": residual}
    # White residuals need no widening, which costs transforms of every column.
    if is_white(residual[1:] @ residual[:-1], power, len(time)):
        series = {}
    covariance = parameter_covariance(gram, power, len(time), **series)
    return np.sqrt(np.diag(covariance)), residual


def _lost(linear, tau, std, limits):
    """Which parameters the data do not determine, in words; empty where they determine all."""
    names = [f"amplitude{j + 1}_volt" for j in range(len(tau))]
    names += [f"tau{j + 1}_second" for j in range(len(tau))]
    values = np.concatenate([linear[1:], tau])
    vague = ~(std[1:] <= UNDETERMINED * np.abs(values))
    reasons = [f"{name} is not told" for name, lost in zip(names, vague, strict=True) if lost]
    if tau[-1] >= limits[1] * (1 - 1e-6):
        reasons.insert(0, f"tau{len(tau)}_second is longer than the rest tells, {limits[1]:.3g} s")
    if tau[0] <= limits[0] * (1 + 1e-6):
        reasons.insert(0, f"tau1_second is no longer than {limits[0]:.3g} s, a quarter of a step")
    return ", ".join(reasons)


def _result(linear, tau, std, residual, voltage, level, last, passes):
    """Relaxation from fitted parameters; `level` is what was taken off the voltage [V]."""
    power, freedom = float(residual @ residual), len(voltage) - len(std)
    moved = voltage - level
    return Relaxation(
        ocv_volt=float(level + linear[0]),
        ocv_std_volt=float(std[0]),
        amplitude_volt=linear[1:],
        amplitude_std_volt=std[1 : len(linear)],
        tau_second=tau,
        tau_std_second=std[len(linear) :],
        drift_volt=np.nan,
        ahead_volt=float(-linear[1:] @ np.exp(-last / tau)),
        sse_volt2=power,
        r_squared=1.0 - power / float(moved @ moved),
        rmse_volt=float(np.sqrt(power / freedom)),
        samples=len(voltage),
        passes=passes,
        verdict="",
    )


def evened(time, voltage):
    """Time and voltage with samples averaged that are closer than the usual step.

    The usual step is that in which half of the time passes. So a burst of samples after the load
    does not outweigh the hours that determine the OCV; but a few of it stay, each a quarter older
    than the one before, for they alone determine the fast part.
    """
    steps = np.diff(time)
    usual = weighted_median(steps, steps)
    # A quarter of a step keeps samples of a steady clock, whose stamps jitter, each by itself.
    bins = np.floor(time / usual + 0.25).astype(int)
    # Within the first step a burst keeps a sample in each quarter of its age, for what is fast.
    early = np.log(np.maximum(time, steps[steps > 0].min()) / usual) / np.log(1.25)
    bins = np.where(bins < 1, np.floor(np.minimum(early, -1)).astype(int), bins)
    first = np.flatnonzero(np.diff(bins, prepend=bins[0] - 1))
    if len(first) < FEWEST:
        return time, voltage
    count = np.diff(np.append(first, len(time)))
    return np.add.reduceat(time, first) / count, np.add.reduceat(voltage, first) / count


def _columns(time, tau, *, sloped=False):
    """Rows 1, exp(−t/tau_j) and, where `sloped`, their derivatives by ln tau_j."""
    ratio = time / tau[:, None]
    decays = np.exp(-ratio)
    slopes = [ratio * decays] if sloped else []
    return np.vstack([np.ones(len(time)), decays, *slopes])


def _normal(columns, linear, target):
    """Normal equations of the rows at given linear parameters."""
    residual = target - linear @ columns[: len(linear)]
    near = float(residual[1:] @ residual[:-1])
    return Normal(columns @ columns.T, columns @ residual, float(residual @ residual), near)


def _check(time, voltage):
    """Refuse what is no rest: see `fit_relaxation`."""
    checked_columns({"time": time, "voltage": voltage})
    if len(time) < FEWEST:
        raise Refusal(f"rest has {len(time)} sample(s); two exponentials take {FEWEST} or more")
    if time[-1] <= time[0]:
        raise Refusal("the clock of the rest stands still")
    longest, whole = np.diff(time).max(), time[-1] - time[0]
    if longest > 0.6 * whole:
        raise Refusal(f"{longest:.4g} of the rest's {whole:.4g} s pass between two samples: a gap")
    if voltage.max() == voltage.min():
        raise Refusal(f"voltage stays at {voltage[0]:g} V: nothing relaxes")


def noise_volt(voltage_volt):
    """Standard deviation of one sample in the second half of a rest [V].

    From second differences, so that a slope is none; not below that of the logger's grain.
    """
    late = np.asarray(voltage_volt)[len(voltage_volt) // 2 :]
    return max(white_noise_of(late), least_digit(voltage_volt) / np.sqrt(12))


def reasons_against(two, three, voltage_volt, *, limit, grain, noise):
    """Reasons against two exponentials, or for an R² below the limit, in words.

    two, three : Relaxation, of at most two and three exponentials.
    voltage_volt : (n,) of the rest [V].
    limit : R² that is asked for.
    grain, noise : of the logger, of a sample [V].

    Returns words: sentences joined by "; ", the most telling first; empty where nothing stands
    against.
    """
    best = three if len(three.tau_second) == 3 else two
    short, single, moved = best.r_squared < limit, len(two.tau_second) < 2, np.ptp(voltage_volt)
    reasons = []
    # Twenty levels, or ten noises, are the least that two exponentials were told from.
    if (short or single) and moved < 20.0 * grain and noise < grain:
        reasons.append(f"quantised: {_mv(moved)} in steps of {_mv(grain)}")
    elif (short or single) and moved < 10.0 * noise:
        moves = f"it moves {_mv(moved)}, the noise is {_mv(noise)}"
        reasons.append(f"too small for the noise: {moves}")
    if best is three:
        taus = ", ".join(f"{tau:.3g}" for tau in three.tau_second)
        better = f"R² {three.r_squared:.4f} against {two.r_squared:.4f} of two"
        reasons.append(f"three time constants are visible ({taus} s): {better}")
    if single:
        reasons.append(f"two time constants are not told: {two.verdict}")
    if short and best.rmse_volt <= 1.2 * noise:  # nothing is left to explain
        ceiling = 1 - noise**2 / max(float(np.var(voltage_volt)), noise**2)
        reasons.append(f"the noise of {_mv(noise)} allows no R² above {ceiling:.3f}")
    elif short:
        excess = f"{_mv(best.rmse_volt)} are left where the noise is {_mv(noise)}"
        count = len(best.tau_second)
        reasons.append(f"more than {count} time constants, or a step within: {excess}")
    if len(best.tau_second) > 1 and best.verdict:
        reasons.append(f"still drifting: {best.verdict}")
    return "; ".join(reasons)


def _mv(volt):
    return f"{1e3 * abs(volt):.2g} mV"
