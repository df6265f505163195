"""Shift of the OCV since the first check-up: the mean of charge and discharge, with its doubt."""

import numpy as np
import pytest
from counted import NAMES

from cellwright.protocols.ocv.shift import ocv_shift, ocv_shifts
from cellwright.records.checkups import basis
from cellwright.records.facts import CellFacts, TestFacts
from cellwright.refusal import Refusal
from cellwright.series.steps import segment

STEP = 20.0


def fresh(soc):
    return 3.4 + 0.6 * soc + 0.15 * soc**8 - 0.4 * np.exp(-soc / 0.02)


def aged(soc):
    return fresh(soc) + 0.02 * np.sin(3 * soc) - 0.01


def record(ocv, size, ohm, *, ampere=1.0, noise=0.0, seed=0, charge_ohm=None, limits=(3.0, 4.2)):
    """Discharge from full to the lower cut-off, rest, charge with a hold to C/20, rest."""
    soc, current, volt = 1.0, [0.0] * 30, [ocv(1.0)] * 30
    while ocv(soc) - ampere * ohm > limits[0]:
        soc -= ampere * STEP / 3600 / size
        current.append(-ampere)
        volt.append(ocv(soc) - ampere * ohm)
    current, volt = current + [0.0] * 90, volt + [ocv(soc)] * 90
    ohm = charge_ohm or ohm
    now = ampere
    while now > size / 20:
        now = min(ampere, max((limits[1] - ocv(soc)) / ohm, 0))
        soc += now * STEP / 3600 / size
        current.append(now)
        volt.append(ocv(soc) + now * ohm)
    current, volt = current + [0.0] * 30, volt + [ocv(soc)] * 30
    current, volt = np.array(current), np.array(volt)
    volt = volt + np.random.default_rng(seed).normal(0, noise, len(volt))
    time = STEP * np.arange(len(current))
    charge = np.append(0, np.cumsum(current[1:])) * STEP / 3600
    steps = segment(time, current, volt, charge, rated_capacity_ampere_hour=2.0)
    return current, volt, charge, steps


@pytest.mark.parametrize("seed", range(5))
def test_shift_is_found_though_the_resistance_has_doubled(seed):
    old = record(fresh, 2.0, 0.04, noise=5e-4, seed=seed)
    found = ocv_shift(old, record(aged, 1.7, 0.08, noise=5e-4, seed=seed + 50))
    inner = (found["soc"] > 0.1) & (found["soc"] < 0.9)
    true = aged(found["soc"]) - fresh(found["soc"])
    off = np.abs(found["shift_volt"] - true)[inner]
    assert off.max() < 0.006
    assert np.mean(off < 1.96 * np.hypot(found["shift_std_volt"], 1e-3)[inner]) > 0.9


def test_a_polarisation_that_grows_in_one_direction_is_in_the_doubt():
    old = record(fresh, 2.0, 0.04)
    found = ocv_shift(old, record(fresh, 2.0, 0.04, charge_ohm=0.10))
    middle = np.abs(found["soc"] - 0.5) < 0.3
    assert np.all(np.abs(found["shift_volt"][middle]) < 2 * found["shift_std_volt"][middle])
    assert found["shift_std_volt"][middle].min() > 0.01


def test_other_rates_and_half_records_are_refused():
    old = record(fresh, 2.0, 0.04)
    with pytest.raises(Refusal, match=r"0\.5 A and 1 A are not one rate"):
        ocv_shift(old, record(fresh, 2.0, 0.04, ampere=0.5))
    current, volt, charge, _ = old
    last = int(np.flatnonzero(current < 0)[-1]) + 10
    half = (current[:last], volt[:last], charge[:last])
    time = STEP * np.arange(last)
    with pytest.raises(Refusal, match="no charge at one current"):
        ocv_shift(old, (*half, segment(time, *half, rated_capacity_ampere_hour=2.0)))


def test_check_up_without_rests_carries_the_shifted_curve():
    records = {"c_0": record(fresh, 2.0, 0.04), "c_9": record(aged, 1.7, 0.08)}
    records["slow"] = record(aged, 1.7, 0.08, ampere=1.5)
    cycles = {"c_0": None, "c_9": 300.0, "slow": 300.0}
    found = ocv_shifts(
        (
            TestFacts(test, "capacity", cycle=cycles[test]),
            dict(zip(NAMES, (STEP * np.arange(len(one[0])), *one[:3]), strict=True)),
            one[3],
        )
        for test, one in records.items()
    )
    rows = found.rows
    assert "OCV shift of slow: 1.5 A and 1 A are not one rate" in found.notes
    soc = np.linspace(0, 1, 101)
    curve = {"test": "ocv", "ambient_temperature_celsius": 25.0, "cycle": None}
    curve |= {"soc": soc.tolist(), "ocv_volt": fresh(soc).tolist(), "branches": "both"}
    sizes = ("capacity", "charge_capacity", "closed_capacity")
    curve |= {f"{name}_ampere_hour": 2.0 for name in sizes}
    sized = [
        {"test": name, "cycle": cycle, "ambient_temperature_celsius": 25.0, "c_rate": 0.5}
        | {"direction": "discharge", "capacity_ampere_hour": size}
        | {"capacity_std_ampere_hour": np.nan}
        for name, cycle, size in (("c_0", 0.0, 2.0), ("c_9", 300.0, 1.7))
    ]
    later = basis(CellFacts("A"), [curve], sized, [], shifts=rows).checkups[1]
    assert "carried over from cycle 0 with its shift since, ± " in later["ocv_source"]
    inner = slice(10, 91)
    assert later["ocv"][0]["ocv_volt"][inner] == pytest.approx(aged(soc[inner]), abs=0.008)
