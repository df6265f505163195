"""One number of a cell out of many tests, each chosen among rows that would mislead."""

import numpy as np
from pulse_rows import pulse

from cellwright.health.summary import (
    latest_health,
    reference_resistance,
    slowest_capacity,
    surest_late,
)


def capacity(direction, c_rate, cycle, ampere_hour):
    names = ("direction", "c_rate", "cycle", "capacity_ampere_hour")
    return dict(zip(names, (direction, c_rate, cycle, ampere_hour), strict=True))


def test_the_capacity_is_that_of_the_slowest_discharge_of_the_first_cycle():
    rows = [capacity("charge", 0.1, None, 9.0), capacity("discharge", 0.5, 40.0, 3.5)]
    rows += [capacity("discharge", 0.51, None, 4.0), capacity("discharge", 1.0, None, 3.0)]
    assert slowest_capacity(rows)["capacity_ampere_hour"] == 4.0
    assert slowest_capacity(rows[:1])["capacity_ampere_hour"] == 9.0
    assert slowest_capacity([capacity("discharge", None, None, 2.0)])["capacity_ampere_hour"] == 2.0
    assert slowest_capacity([]) is None


def test_the_resistance_is_that_at_half_charge_and_the_reference_temperature():
    first = {"delay": 0.0}
    rows = [pulse(0.5, 1.0, 20.0, **first), pulse(0.7, 2.0, **first), pulse(0.5, 3.0)]
    rows += [pulse(0.5, 4.0, direction="charge", **first), pulse(0.5, 5.0, cycle=90.0, **first)]
    assert reference_resistance(rows[:4]) is None
    rows += [pulse(0.52, 6.0, rate=3.0, **first), pulse(0.52, 7.0, None, **first)]
    rows.append(pulse(0.58, 8.0, 24.0, **first))
    assert reference_resistance(rows)["resistance_ohm"] == 7.0


def health(cycle, method, soh, std=None):
    return {"cycle": cycle, "method": method, "soh": soh, "soh_std": std}


def test_a_counted_capacity_of_the_last_check_up_is_the_latest_health():
    rows = [health(0.0, "check-up", 1.0), health(300.0, "ageing cycles", 0.8)]
    rows += [health(300.0, "check-up", 0.9), health(400.0, "dQ/dV peaks", 0.7)]
    rows += [health(500.0, "check-up", np.nan)]
    assert latest_health(rows)["soh"] == 0.9
    assert latest_health(rows[3:])["soh"] == 0.7
    assert latest_health(rows[:1]) is None


def test_of_the_last_cycles_the_surest_row_counts():
    rows = [health(10.0, "", 0.99, 0.001), health(960.0, "", 0.9, 0.01), health(1000.0, "", 0.8)]
    assert surest_late(rows)["soh"] == 0.9
