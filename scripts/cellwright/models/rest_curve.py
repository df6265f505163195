"""One rest of a test as it is drawn: measured voltage beside its fit."""

from typing import NamedTuple

import numpy as np

MIDDLE_SOC = 0.5
POINTS = 400  # more than a panel shows


class Curve(NamedTuple):
    """Arrays of shape (n,) from the first sample of the rest on; empty where none was fitted.

    soc : of the rest, the same in each row.
    """

    time_second: np.ndarray
    voltage_volt: np.ndarray
    fitted_volt: np.ndarray
    soc: np.ndarray


def example(rows, test_time_second, voltage_volt):
    """Course and fit of the chosen fit nearest 50 % SoC, or of the middle rest without SoC.

    Parameters
    ----------
    rows : rests.RestRows. test_time_second, voltage_volt : (n,) of the test [s], [V].

    Returns
    -------
    Curve
    """
    chosen = np.flatnonzero(rows.chosen)
    if not len(chosen):
        return Curve(*[np.zeros(0)] * len(Curve._fields))
    off = np.abs(rows.soc[chosen] - MIDDLE_SOC)
    k = chosen[np.nanargmin(off)] if np.isfinite(off).any() else chosen[len(chosen) // 2]
    since = np.asarray(test_time_second, float) - rows.start_time_second[k]
    inside = np.flatnonzero((since >= 0) & (since <= rows.rest_second[k] - rows.delay_second[k]))
    # Dense at first, where the voltage moves.
    kept = inside[np.unique(np.geomspace(1, len(inside), POINTS).astype(int)) - 1]
    fitted = np.full(len(kept), rows.ocv_volt[k])
    for volt, tau in (("a_volt", "tau1_second"), ("b_volt", "tau2_second"), _FAST):
        amplitude = np.nan_to_num(getattr(rows, volt)[k])
        fitted += amplitude * np.exp(-since[kept] / np.nan_to_num(getattr(rows, tau)[k], nan=1.0))
    volts = np.asarray(voltage_volt, float)[kept]
    return Curve(since[kept], volts, fitted, np.full(len(kept), rows.soc[k]))


_FAST = ("fast_volt", "fast_tau_second")
