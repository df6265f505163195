"""Simulation of two RC pairs with parameters over SoC: uniform samples, true time stamps."""

import cell
import numpy as np
from general_solver import solved
from timing import Entry, Goal, Topic, millivolt, where_importable

from cellwright.numerics.lags import lag_weights

SAMPLES = 10_000


def uniform():
    """Topic: 10,000 samples, 1 s apart."""
    step, current = 1.0, cell.drive(SAMPLES)
    time = step * np.arange(SAMPLES)
    return _topic(
        "2-RC simulation, uniform step",
        f"{SAMPLES:,} samples 1 s apart, OCV and three resistances over SoC, SoC counted, the "
        "current on a straight line from sample to sample",
        step,
        time,
        current,
        {
            "scipy lfilter": lambda: _lfilter(step, current),
            "scipy LSODA": lambda: _scipy_solver(time, current),
            "PyBaMM Thevenin, IDAKLU": lambda: _pybamm(time, current),
        },
    )


def long_record():
    """Topic: 200,000 samples: what a call costs by itself no longer shows."""
    step, samples = 1.0, 200_000
    current = cell.drive(samples)
    true = _lfilter(step, current).run()

    time = step * np.arange(samples)

    def ours():
        return cell.simulated(time, current, cell.INITIAL_SOC)[0]

    def judge(found):
        return millivolt(found, true)

    return Topic(
        "2-RC simulation of a long record",
        f"{samples:,} samples {step:g} s apart, a current that stays small, else as above",
        "largest difference to lfilter's voltage",
        [
            Entry("**Cellwright**", ours, judge, runs=11),
            _lfilter(step, current)._replace(accuracy=judge, runs=5),
        ],
        [],
        samples,
        "sample",
        (Goal("**Cellwright**", times=1.0, of="numpy interp, scipy lfilter"),),
    )


def true_steps():
    """Topic: the same, every sample with a step of its own."""
    step = np.random.default_rng(2).uniform(0.5, 1.5, SAMPLES - 1)
    current = cell.drive(SAMPLES)
    time = np.concatenate([[0.0], np.cumsum(step)])
    return _topic(
        "2-RC simulation, true steps",
        "the same with steps between 0.5 and 1.5 s, no two alike (lfilter cannot do that)",
        step,
        time,
        current,
        {
            "numpy and LAPACK": lambda: _lapack(step, current),
            "plain Python": lambda: _python(step, current),
            "PyBaMM Thevenin, IDAKLU": lambda: _pybamm(time, current),
        },
    )


def _topic(title, work, step, time, current, peers):
    true = solved(time, current, relative=1e-11)

    def ours():
        return cell.simulated(time, current, cell.INITIAL_SOC)[0]

    def judge(found):
        return millivolt(found, true)

    entries, skipped = where_importable({"PyBaMM Thevenin, IDAKLU": ("pybamm",)}, peers)
    entries = [entry._replace(accuracy=judge) for entry in entries]
    accuracy = "largest difference to the same cell integrated with a tolerance of 1e-11"
    entries = [Entry("**Cellwright**", ours, judge, runs=21), *entries]
    # What a user would write in its place, on a step alone and on steps of any length.
    usual = "numpy interp, scipy lfilter" if np.ndim(step) == 0 else "numpy, LAPACK's banded solve"
    goals = (Goal("**Cellwright**", times=1.0, of=usual),)
    return Topic(title, work, accuracy, entries, skipped, SAMPLES, "sample", goals)


def _scipy_solver(time, current):
    return Entry("scipy solve_ivp, LSODA", lambda: solved(time, current, relative=1e-6), None)


def _looked_up(step, current):
    between = (current[:-1] + current[1:]) / 2 * step
    size = 3600.0 * cell.CAPACITY_AMPERE_HOUR
    soc = cell.INITIAL_SOC + np.concatenate([[0.0], np.cumsum(between)]) / size
    ocv, r0, *r = (np.interp(soc, cell.GRID, c) for c in (cell.OCV, cell.R0, *cell.R))
    return ocv + r0 * current, [one * current for one in r]


def _lfilter(step, current):
    """The lags as the two-tap filters that they are on a uniform grid."""
    from scipy.signal import lfilter

    def run():
        volt, drives = _looked_up(step, current)
        for drive, tau in zip(drives, cell.TAU, strict=True):
            decay, before, after = (w[0] for w in lag_weights([step], tau, hold="first_order"))
            # The state begins at zero, so the first sample must not drive through `after`.
            start = [-after * drive[0]]
            volt = volt + lfilter([after, before], [1.0, -decay], drive, zi=start)[0]
        return volt

    return Entry("numpy interp, scipy lfilter", run, None, runs=21)


def _lapack(step, current):
    from scipy.linalg.lapack import dtbtrs

    def run():
        volt, drives = _looked_up(step, current)
        for drive, tau in zip(drives, cell.TAU, strict=True):
            decay, before, after = lag_weights(step, tau, hold="first_order")
            band, right = np.ones((2, len(drive)), order="F"), np.zeros((len(drive), 1), order="F")
            band[1, :-1], right[1:, 0] = -decay, before * drive[:-1] + after * drive[1:]
            volt = volt + dtbtrs(band, right, uplo="L")[0][:, 0]
        return volt

    return Entry("numpy, LAPACK's banded solve", run, None, runs=11)


def _python(step, current):
    """A loop over the samples, as one would write it down."""

    def run():
        volt, drives = _looked_up(step, current)
        for drive, tau in zip(drives, cell.TAU, strict=True):
            decay, before, after = (w.tolist() for w in lag_weights(step, tau, hold="first_order"))
            state, found, x = 0.0, [0.0], drive.tolist()
            for k in range(len(decay)):
                state = decay[k] * state + before[k] * x[k] + after[k] * x[k + 1]
                found.append(state)
            volt = volt + np.array(found)
        return volt

    return Entry("numpy, a Python loop for the lags", run, None)


def _pybamm(time, current):
    import thevenin_model

    run = thevenin_model.prepared(time, current, cell.INITIAL_SOC)
    return Entry("PyBaMM Thevenin, IDAKLU", run, None, note="a general solver of equations")
