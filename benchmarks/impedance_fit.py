"""Fit of R-(CPE|(R-W)) to a spectrum of 61 points."""

import numpy as np
from timing import Entry, Topic, where_importable

from cellwright.protocols.impedance.circuits import NAMES as ALL_NAMES
from cellwright.protocols.impedance.circuits import circuit_impedance
from cellwright.protocols.impedance.fit import fit_circuit

FREQUENCY = np.logspace(4, -2, 61)
NOISE = 2e-3
NAMES = ALL_NAMES[:5]  # without the inductance of the leads
TRUE = np.array([0.020, 0.012, 1.5, 0.85, 300.0])


def topic():
    """Topic: one spectrum, errors of 0.2 % of the modulus."""
    true, measured = _spectrum()
    makers = {
        "**Cellwright**": lambda: _ours(measured),
        "scipy": lambda: _scipy(true, measured),
        "lmfit": lambda: _lmfit(true, measured),
    }
    entries, skipped = where_importable({"lmfit": ("lmfit",)}, makers)

    def judge(values):
        return f"{100 * np.max(np.abs(np.asarray(values) / true - 1)):.2f} %"

    return Topic(
        "Impedance fit",
        "R-(CPE|(R-W)), 61 points from 10 kHz to 10 mHz, noise of 0.2 % of the modulus; ours finds "
        "its own starts (several), the others get one within a factor of two",
        "largest error of a parameter",
        [entry._replace(accuracy=judge) for entry in entries],
        skipped,
    )


def _spectrum():
    rng = np.random.default_rng(8)
    error = rng.normal(size=61) + 1j * rng.normal(size=61)
    return TRUE, circuit_impedance(FREQUENCY, *TRUE) * (1 + NOISE * error)


def _ours(measured):
    return Entry("**Cellwright**", lambda: fit_circuit(FREQUENCY, measured).values, None, runs=11)


def _residual(values, measured):
    relative = (circuit_impedance(FREQUENCY, *values) - measured) / np.abs(measured)
    return np.concatenate([relative.real, relative.imag])


def _start(true):
    return true * np.array([1.5, 0.6, 1.6, 0.9, 0.6])


def _scipy(true, measured):
    from scipy.optimize import least_squares

    def run():
        def residual(logs):
            return _residual(np.exp(logs), measured)

        return np.exp(least_squares(residual, np.log(_start(true)), method="lm").x)

    return Entry("scipy least_squares, logarithms", run, None, runs=11)


def _lmfit(true, measured):
    import lmfit

    def run():
        given = lmfit.Parameters()
        for name, value in zip(NAMES, _start(true), strict=True):
            given.add(name, value, min=value / 100, max=value * 100)

        def residual(found):
            return _residual([found[name].value for name in NAMES], measured)

        found = lmfit.minimize(residual, given).params
        return [found[name].value for name in NAMES]

    return Entry("lmfit", run, None)
