"""Made-up cells and records: currents only, without a voltage."""

import numpy as np

from cellwright.effects import base
from cellwright.records.record import record_of

CAPACITY = 2.5
SOC = np.linspace(0.0, 1.0, 201)
CELL = base.Cell(CAPACITY, 3.35 + 0.75 * SOC + 0.06 * np.sin(7 * SOC) - 0.2 * np.exp(-SOC / 0.04))
PLAIN = {"log_r0": np.log(0.025), "log_r1": np.log(0.01), "log_r2": np.log(0.012)}
PLAIN |= {"log_tau1": np.log(8.0), "log_tau2": np.log(130.0), "capacity": 0.0, "known": 1.0}
PLAIN |= {f"ocv[{k}]": 0.0 for k in range(base.OCV_KNOTS)}


def record(test, current, *, every=1.0, celsius=25.0, soc=1.0, kind="drive"):
    """A record of a current [A], a row every so many seconds."""
    time = every * np.arange(len(current))
    blank = np.zeros(len(current))
    return record_of(time, current, blank, soc, test=test, kind=kind, celsius=celsius)


def drive(test="drive", *, seed=1, seconds=5400, celsius=25.0, soc=0.95):
    """Random loads of up to 2C with charges and a rest of ten minutes in every half hour."""
    random = np.random.default_rng(seed)
    current = np.repeat(random.uniform(-2.0, 1.2, seconds // 20) * CAPACITY, 20)
    time = np.arange(len(current))
    current[(time % 1800 > 1150) | (time < 60)] = 0.0
    return record(test, current, celsius=celsius, soc=soc)


def capacity_test(celsius=25.0):
    """Discharge at C/3, rest, charge at C/3, rest; a row every 20 s."""
    rest = np.zeros(180)
    half = np.full(int(0.95 * 3 * 180), CAPACITY / 3)
    current = np.concatenate([rest[:6], -half, rest, half, rest])
    return record("capacity", current, every=20.0, celsius=celsius, kind="capacity")
