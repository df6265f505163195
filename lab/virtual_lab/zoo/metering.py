"""What the meter shows of a cell's track: systematic errors first, then noise and resolution."""

import numpy as np

from virtual_lab.zoo.cell import Meter
from virtual_lab.zoo.march import Track

VOLT_STEP, AMPERE_STEP, CELSIUS_STEP = 0.3e-3, 1e-3, 0.1
AMPERE_NOISE, CELSIUS_NOISE = 1.5e-3, 0.08
WINDOW_SECOND = 1.0  # over which a meter averages the change of the current
# One drive has the faults of a single file: the first that judges, by its number among the drives.
FAULTY_DRIVE = 4


def shown(track: Track, k: int, meter: Meter, *, faulty: bool) -> dict[str, np.ndarray]:
    """Columns of one cell without noise: time_second, step, current_ampere, voltage_volt, celsius.

    Parameters
    ----------
    track : of several cells. k : place of the cell among them. meter : its errors. faulty :
        whether this is the file that the faults of a single file concern.
    """
    rows = track.there[:, k]
    second, ampere, volt = (column[rows, k] for column in (track.second, track.ampere, track.volt))
    if meter.skew_second:
        volt = np.interp(second - meter.skew_second, second, volt)
    fading = meter.warm_share * np.exp(-second / meter.warm_second)
    past = np.interp(second - WINDOW_SECOND, second, ampere)
    size, period = meter.ripple
    turned = 2 * np.pi * second / period
    volt = volt * (1 + meter.gain_volt) + meter.offset_volt + size * np.sin(turned)
    volt = volt + meter.drift_volt * second / second[-1] + meter.file_volt * faulty
    volt = volt + meter.inductive_volt * (ampere - past) / WINDOW_SECOND
    return {
        "time_second": second,
        "step": track.step[rows, k],
        "current_ampere": ampere + meter.offset_ampere * (1 + fading),
        "voltage_volt": volt,
        "surface_celsius": track.celsius[rows, k],
    }


def noisy(columns: dict, meter: Meter, *, celsius: float, surface: bool, seed: int) -> dict:
    """Columns as they are logged: noise, resolution, time to a millisecond, chamber temperature.

    Parameters
    ----------
    columns : of `shown`. celsius : of the chamber, true. surface : whether the cell has a sensor;
        without one the file holds no temperature at all.
    """
    random = np.random.default_rng(seed)
    rows = columns["time_second"].size

    def logged(values, noise, step):
        return np.round((values + random.normal(0.0, noise, rows)) / step) * step

    second = np.maximum.accumulate(np.round(columns["time_second"], 3))
    kept = np.append(True, np.diff(second) > 0)
    told = {
        "time_second": second,
        "step": columns["step"],
        "current_ampere": logged(columns["current_ampere"], AMPERE_NOISE, AMPERE_STEP),
        "voltage_volt": logged(columns["voltage_volt"], meter.white_volt, VOLT_STEP),
    }
    if surface:
        around = np.full(rows, celsius)
        told["surface_celsius"] = logged(columns["surface_celsius"], CELSIUS_NOISE, CELSIUS_STEP)
        told["ambient_celsius"] = logged(around, CELSIUS_NOISE, CELSIUS_STEP)
    return {name: values[kept] for name, values in told.items()}
