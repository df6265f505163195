"""Lives of cells with known laws, knees and ends, for the tests of this folder."""

import numpy as np

from cellwright.health import lives

CAPACITY_AMPERE_HOUR = 3.0


def cycles_columns(cycle, share, *, hours=None, rate=1.0):
    """Columns of stage `ageing_cycles` of discharges of these shares of 3 Ah."""
    size, count = CAPACITY_AMPERE_HOUR * np.asarray(share, float), len(cycle)
    hours = 3.0 * np.asarray(cycle, float) if hours is None else hours
    return {
        "cycle": np.asarray(cycle, float),
        "direction": np.full(count, "discharge"),
        "start_time_second": 3600.0 * hours,
        "capacity_ampere_hour": size,
        "energy_watt_hour": 3.6 * size,
        "coulombic_efficiency": np.full(count, np.nan),
        "c_rate": np.full(count, rate),
    }


def record(cycle, share, *, test="life", first=None, celsius=None, **more):
    """An ageing record of such discharges."""
    return lives.AgeingRecord(test, first, celsius, cycles_columns(cycle, share, **more), {})


def life(share, **more):
    """A life of one record, cycles counted from 1."""
    cycle = np.arange(1, len(share) + 1)
    return lives.life_of([record(cycle, share, **more)], rated_capacity_ampere_hour=3.0)


def noise(random, count, *, std=0.001, memory=0.5, growth=0.5):
    """Noise that remembers itself and grows over the life (n,)."""
    drawn = random.standard_normal(count)
    made = np.empty(count)
    made[0] = drawn[0]
    for k in range(1, count):
        made[k] = memory * made[k - 1] + np.sqrt(1 - memory**2) * drawn[k]
    return std * np.exp(growth * np.linspace(-0.5, 0.5, count)) * made


def smooth(kind, count, lost=0.2):
    """Shares of lives without a knee that lose `lost` over `count` cycles."""
    x = np.arange(1, count + 1) / count
    return {
        "straight": 1 - lost * x,
        "root": 1 - lost * np.sqrt(x),
        "power": 1 - lost * x**1.4,
        "rise": 1 + 0.01 * (1 - np.exp(-x / 0.1)) - (lost + 0.01) * x,
    }[kind]


def kinked(count, knee, *, ratio, lost=0.3, width=0.0):
    """Share of a life whose fade turns steeper by `ratio` at `knee`, a share of the life."""
    x = np.arange(1, count + 1) / count
    beyond = (x - knee + np.sqrt((x - knee) ** 2 + width**2)) / 2
    course = x + (ratio - 1) * beyond
    return 1 - lost * course / course[-1]
