"""A cell's data sheet, its behaviour in one step of a protocol, and running integrals over time."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np


class Rating(NamedTuple):
    """Capacity [Ah] of the data sheet, to which C-rates refer, and the two cut-offs [V]."""

    capacity_ampere_hour: float
    lower_cutoff_volt: float
    upper_cutoff_volt: float

    def ampere(self, c_rate: float) -> float:
        """Current [A] of a C-rate."""
        return c_rate * self.capacity_ampere_hour


class Behaviour(NamedTuple):
    """True current, voltage and temperature of a cell in one step, as functions of time.

    Times [s] are counted from the start of the step. The current [A] is positive on charge; of
    cells in parallel `branches` are the currents of each, of cells in series `cell_voltages` and
    `cell_soc` the voltage and state of charge of each, and `cell_temperatures` those that have a
    sensor, by position (1, 2, …). Where the
    generator knows them: `charge`, the charge [Ah] since the start of the step, and `soc`, the true
    state of charge [1] (of several cells, that of the first).
    """

    duration_second: float
    current: Callable[[np.ndarray], np.ndarray]
    voltage: Callable[[np.ndarray], np.ndarray]
    temperature: Callable[[np.ndarray], np.ndarray]
    branches: tuple[Callable[[np.ndarray], np.ndarray], ...] = ()
    charge: Callable[[np.ndarray], np.ndarray] | None = None
    soc: Callable[[np.ndarray], np.ndarray] | None = None
    cell_voltages: tuple[Callable[[np.ndarray], np.ndarray], ...] = ()
    cell_temperatures: dict[int, Callable[[np.ndarray], np.ndarray]] | None = None
    cell_soc: tuple[Callable[[np.ndarray], np.ndarray], ...] = ()


def running_integral(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Integral of values over time from the first sample on, by the trapezoid rule, (n,)."""
    pieces = 0.5 * (values[1:] + values[:-1]) * np.diff(time)
    return np.concatenate([[0.0], np.cumsum(pieces)])
