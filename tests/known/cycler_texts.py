"""Made-up records of a 2 Ah cell, and the text that a cycler writes of one."""

import numpy as np
import pandas as pd

HOUR = 3600.0


def record(*stretches, step=10.0, capacity=2.0):
    """Time [s], current [A] and voltage [V] of stretches (current, hours) of a 2 Ah cell."""
    current = np.concatenate([np.full(int(hours * HOUR / step), amps) for amps, hours in stretches])
    time = step * np.arange(len(current))
    soc = 1 + np.cumsum(current) * step / HOUR / capacity
    return time, current, 3.0 + 1.2 * np.clip(soc, 0, 1) + 0.05 * current


def text_of(time, current, voltage):
    frame = {"Time (s)": time, "Current (A)": current, "Voltage (V)": voltage}
    return pd.DataFrame(frame).to_csv(index=False)


RECORDS = {
    "capacity": record((0, 0.5), (-2, 0.99), (0, 0.5), (1, 1.95), (0, 0.5)),
    "ocv": record((0, 0.5), (-0.1, 19.8), (0, 0.5), (0.1, 19.5), (0, 0.5), step=60.0),
    "ageing": record((0, 0.2), *[(-2, 0.99), (0, 0.1), (2, 0.98), (0, 0.1)] * 6),
    "relaxation": record((0, 3.0)),
}
