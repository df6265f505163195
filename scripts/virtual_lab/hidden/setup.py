"""A healthy cell on a healthy channel, and what an effect may change about either."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from virtual_lab import electrodes, fast
from virtual_lab.measurement import Chain
from virtual_lab.rating import Rating

RATING = Rating(5.0, 2.5, 4.2)
CHEMISTRY = "NMC"
SOC = np.linspace(0.0, 1.0, 1001)
# As the study of missing-effect.md had it: noise of the voltage and spread between healthy cells.
CHAIN = Chain(
    voltage_noise_volt=1.5e-3,
    voltage_slow_noise_volt=0.5e-3,
    voltage_slow_noise_second=250.0,
    voltage_resolution_volt=0.3e-3,
    current_noise_ampere=2e-3,
    current_resolution_ampere=1e-3,
    temperature_noise_celsius=0.1,
    rest_is_open=False,
    clock="jittery",
)
NOISE_VOLT = float(np.hypot(1.5e-3, 0.5e-3))
OCV_SPREAD_VOLT = 1e-3
CAPACITY_SPREAD = 0.05
RESISTANCE_SPREAD = 0.18
TIME_SPREAD = 0.2


class Setup(NamedTuple):
    """A cell and its channel.

    `at_capacity_test` is the cell as it was then, where it was not as later. `disturbance` adds to
    the voltage [V] at times [s] and currents [A] of a record.
    """

    cell: fast.Cell
    chain: Chain = CHAIN
    at_capacity_test: fast.Cell | None = None
    disturbance: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None

    def with_cell(self, **changes) -> "Setup":
        """The cell changed."""
        return self._replace(cell=self.cell._replace(**changes))

    def with_chain(self, **changes) -> "Setup":
        """The channel changed."""
        return self._replace(chain=self.chain._replace(**changes))


def healthy(random: np.random.Generator) -> Setup:
    """A healthy cell: an OCV, an ohmic resistance and two RC pairs, the same everywhere.

    Capacity, resistances and time constants differ from cell to cell, and so does the OCV, smoothly
    over SoC, by 1 mV (root mean square).
    """
    window = electrodes.window(CHEMISTRY, RATING)
    ocv = electrodes.open_circuit_volt(CHEMISTRY, window, SOC) + ocv_error(random)
    spread = np.exp(random.normal(0.0, [RESISTANCE_SPREAD] * 3 + [TIME_SPREAD] * 2))
    r0, r1, r2, tau1, tau2 = spread * [0.020, 0.010, 0.012, 7.0, 125.0]
    return Setup(
        fast.Cell(
            rating=RATING,
            ocv_volt=ocv,
            capacity_ampere_hour=RATING.capacity_ampere_hour
            * (1 + CAPACITY_SPREAD * random.normal()),
            r0_ohm=r0,
            pair_r_ohm=(r1, r2),
            pair_tau_second=(tau1, tau2),
        )
    )


def ocv_error(random: np.random.Generator) -> np.ndarray:
    """What a cell's OCV [V] has of its own: five waves over SoC, weaker the shorter they are."""
    wave = np.arange(1, 6)
    size = random.normal(0.0, 1 / wave)
    error = size @ np.cos(np.pi * np.outer(wave, SOC) + random.uniform(0, 2 * np.pi, (5, 1)))
    return OCV_SPREAD_VOLT * error / np.sqrt(np.mean(error**2))
