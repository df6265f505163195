"""State of charge of a record by coulomb counting, OCV look-up and Kalman filters."""

from typing import NamedTuple

import numpy as np

from cellwright.filters.kalman import acquire, run
from cellwright.filters.plant import (
    ERROR,
    GAIN,
    SLOPE,
    TOTAL,
    Noise,
    drive_at,
    look_at,
    plant_of,
)
from cellwright.numerics.lags import lag
from cellwright.refusal import Refusal

METHODS = ("coulomb", "ocv", "ekf", "aekf", "dual")
PASSES = 3  # of the look-up: resistances need a SoC, the SoC needs resistances
FLAT_VOLT = 1e-9  # a slope of the OCV that tells nothing


class Start(NamedTuple):
    """Estimate before the first sample.

    soc, soc_std : state of charge and its standard deviation [1].
    c_rate : current that may have flowed before, as a rate; its settled relaxations are the
        standard deviations of those at the start [1/h]. 0: the cell had relaxed.
    capacity_error : relative standard deviation of the capacity, where that is a state [1].
    ohmic_error : the same of the ohmic resistance, where that is tracked [1].
    """

    soc: float
    soc_std: float = 0.5
    c_rate: float = 0.0
    capacity_error: float = 0.1
    ohmic_error: float = 0.3


class Estimate(NamedTuple):
    """State of charge (n,) [1] with its standard deviation, innovations and tracked parameters.

    innovation_volt, innovation_std_volt : measured minus predicted voltage, and what its standard
        deviation should be; NaN where a method has none [V].
    capacity_ampere_hour, capacity_std_ampere_hour : NaN but for "dual" [Ah].
    ohmic_scale, ohmic_scale_std : resistance over the model's; NaN where it is not tracked [1].
    """

    soc: np.ndarray
    std: np.ndarray
    innovation_volt: np.ndarray
    innovation_std_volt: np.ndarray
    capacity_ampere_hour: np.ndarray
    capacity_std_ampere_hour: np.ndarray
    ohmic_scale: np.ndarray
    ohmic_scale_std: np.ndarray


def estimate(
    bank,
    test_time_second,
    current_ampere,
    voltage_volt,
    start,
    *,
    method,
    noise=None,
    hold="first_order",
    resistance_factor=1.0,
    track_ohmic=True,
):
    """State of charge over a record (n,) [1] by one method, from a start that may be wrong.

    "coulomb" counts from the stated start (2.21). "ocv" looks each sample up alone: the voltage
    less the model's overpotentials, in the OCV table. "ekf" filters with the stated noise, "aekf"
    matches it to what is seen (table 2.3), "dual" has the capacity as a further state: the two
    filters of appendix B in one covariance, of which the print's recursion dg/dC is the mixed
    entry.

    Parameters
    ----------
    bank : Bank of a member at the record's temperature.
    test_time_second, current_ampere, voltage_volt : (n,) [s], [A] positive on charge, [V].
    start : Start.
    method : one of `METHODS`.
    noise : Noise; None takes its defaults.
    hold : how the current runs between two samples.
    resistance_factor : scalar or (n,) resistance of the cell at each sample over the bank's [1].
    track_ohmic : estimate a scale of the ohmic resistance as well; without, an error of it is taken
        for one of the SoC.

    Returns
    -------
    estimate : Estimate.

    Raises
    ------
    Refusal : an unknown method, a start that is impossible, or as `plant_of`.

    Source: thesis 2.4, table 2.3 and appendix B; docs/soc-filters.md says what was mended.
    """
    # ASSUME: The error of a model at rest keeps its value over about `error_soc` of the charge, the
    # error of its circuit for about `error_second`.
    noise, record = noise or Noise(), (test_time_second, current_ampere, voltage_volt)
    settings = {"hold": hold, "resistance_factor": resistance_factor, "track_ohmic": track_ohmic}
    plant = plant_of(bank, *record, noise, **settings, track_capacity=method == "dual")
    return estimate_on(plant, start, method=method, noise=noise)


def estimate_on(plant, start, *, method, noise):
    """As `estimate`, on a record and a bank that are laid out already.

    Parameters
    ----------
    plant : Plant, with the capacity among its states for "dual"; for "coulomb", "ekf" and "aekf"
        where it is in doubt, which their intervals then carry along. start, method : as above.
    noise : Noise that the plant was laid out with.
    """
    if method not in METHODS:
        raise Refusal(f"SoC method {method!r} is unknown; known are {', '.join(METHODS)}")
    if not (0.0 <= start.soc <= 1.0 and start.soc_std > 0.0):
        raise Refusal(
            f"SoC {start.soc:g} ± {start.soc_std:g} at the start; wanted 0 to 1, with some doubt"
        )
    if method == "coulomb":
        return _without_innovations(*_counted(plant, start, noise))
    if method == "ocv":
        return _without_innovations(*_looked_up(plant))
    kind = {"adaptive": method in ("aekf", "dual"), "considered": method != "dual"}
    return _filtered(plant, start, noise._replace(**kind))


# ASSUME: The SoC scale of a model stands at full: what its capacity errs by grows from there.
def with_doubt_of_capacity(estimate, share):
    """The same estimate, its deviation with that of the scale that its SoC stands on.

    The voltages of a model were laid out on the same scale, so no voltage tells an error of it.

    Parameters
    ----------
    estimate : Estimate. share : standard deviation of the capacity over the capacity [1].
    """
    return estimate._replace(std=np.hypot(estimate.std, share * np.abs(1.0 - estimate.soc)))


def _without_innovations(soc, std):
    return Estimate(soc, std, *[np.full(len(soc), np.nan)] * 6)


def _counted(plant, start, noise):
    passed = np.cumsum(plant.charge_ampere_hour) / plant.capacity_ampere_hour
    seconds = np.cumsum(plant.step_second)
    share = start.capacity_error if plant.capacity >= 0 else 0.0
    variance = start.soc_std**2 + noise.soc_walk[0] * seconds + (share * passed) ** 2
    return start.soc + passed, np.sqrt(variance)


def _looked_up(plant):
    """SoC (n,) at which the OCV is the voltage less the overpotentials, and its deviation."""
    grid = plant.soc_first + plant.soc_spacing * np.arange(len(plant.tables))
    inside = (grid > -1e-9) & (grid < 1.0 + 1e-9)
    curve = np.maximum.accumulate(plant.tables[inside, TOTAL])
    soc = np.interp(plant.voltage_volt, curve, grid[inside])
    for _ in range(PASSES):
        over = _overpotential(plant, soc)
        soc = np.interp(plant.voltage_volt - over, curve, grid[inside])
    error = look_at(plant, soc, ERROR)
    volt = np.sqrt(error**2 + plant.slow_variance + plant.white_variance)
    std = volt / np.maximum(look_at(plant, soc, SLOPE), FLAT_VOLT)
    return soc, np.minimum(std, 1.0 / np.sqrt(12.0))


def _overpotential(plant, soc):
    """Voltage over the circuit (n,) along a course of the SoC; what shifts the SoC by the slope."""
    over, samples = np.zeros(len(soc)), np.arange(len(soc))
    slope, drives = look_at(plant, soc, SLOPE), []
    for e, share in enumerate(plant.direct):
        shift = slope if plant.shifts_soc[e] else 1.0
        drives.append(shift * drive_at(plant, e, samples, soc))
        over += share * drives[-1]
    for j, e in enumerate(plant.element):
        column = GAIN + len(drives) + j
        constant = look_at(plant, soc[:-1], column) if plant.moves[j] else plant.tables[0, column]
        held = plant.by_charge[e] or not plant.first_order
        clock = plant.passed_ampere_hour if plant.by_charge[e] else plant.step_second
        driven = np.append(drives[e][1:], 0.0) if plant.by_charge[e] else drives[e]
        hold = "zero_order" if held else "first_order"
        over += plant.share[j] * lag(clock[1:], constant, driven, hold=hold)
    return over


def _filtered(plant, start, noise):
    state, innovation, variance = acquire(plant, start, noise)
    rows = run(plant, noise, state)
    rows[0, 2:4] = innovation, variance
    unknown = np.full(len(rows), np.nan)
    capacity, ohmic = (unknown, unknown), (unknown, unknown)
    if plant.capacity >= 0 and not noise.considered:
        size = plant.capacity_ampere_hour / rows[:, 4]
        capacity = size, size * np.hypot(np.sqrt(rows[:, 5]) / rows[:, 4], noise.capacity_misread)
    if plant.ohmic >= 0:
        ohmic = rows[:, 6], np.sqrt(rows[:, 7])
    return Estimate(
        rows[:, 0],
        np.sqrt(rows[:, 1]),
        rows[:, 2],
        np.sqrt(rows[:, 3]),
        *capacity,
        *ohmic,
    )
