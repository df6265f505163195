"""Records as tests of the protocols take them: charge counted, and measured ones read by hand."""

import numpy as np
import pandas as pd

NAMES = ("test_time_second", "current_ampere", "voltage_volt", "charge_ampere_hour")


def series_of(*columns):
    """Time [s], current [A], voltage [V] and, where given, charge [Ah] as columns by name."""
    return dict(zip(NAMES, columns, strict=False))


def counted(time, current):
    """Net charge since the first row (n,) [Ah], by trapezoids."""
    middle = (current[1:] + current[:-1]) / 2
    return np.append(0.0, np.cumsum(middle * np.diff(time)) / 3600)


def measured(path, sign=1):
    """Time, current times `sign`, voltage and charge of a BDF table."""
    read = pd.read_parquet if path.suffix == ".parquet" else pd.read_csv
    table = read(path)
    names = ("Test Time / s", "Current / A", "Voltage / V")
    time, current, voltage = (table[name].to_numpy(float) for name in names)
    return time, sign * current, voltage, counted(time, sign * current)
