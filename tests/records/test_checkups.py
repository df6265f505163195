"""Basis of a cell that ages: each check-up its capacity and OCV, and what lies between them."""

import numpy as np
import pytest

from cellwright.records.basis import at_cycle, soc_of
from cellwright.records.checkups import basis
from cellwright.records.facts import CellFacts, TestFacts

CELL = CellFacts("A", 2.0, 3.0, 4.2)


def row(size, cycle, rate=0.5, *, celsius=25.0, std=np.nan, direction="discharge"):
    return {
        "test": f"capacity_{cycle or 0}_{celsius:g}",
        "ambient_temperature_celsius": celsius,
        "cycle": cycle,
        "direction": direction,
        "c_rate": rate,
        "capacity_ampere_hour": size,
        "capacity_std_ampere_hour": std,
    }


def curve(size, cycle, *, name="ocv", celsius=25.0, branches="both", shift=0.0):
    return {
        "test": f"{name}_{cycle or 0}",
        "ambient_temperature_celsius": celsius,
        "cycle": cycle,
        "branches": branches,
        "capacity_ampere_hour": size,
        "charge_capacity_ampere_hour": size,
        "closed_capacity_ampere_hour": size,
        "capacity_source": "rating",
        "discharge_current_ampere": -1.0,
        "charge_current_ampere": None,
        "measured_soc": [0.0, 1.0],
        "soc": [0.0, 0.5, 1.0],
        "ocv_volt": [3.0 + shift, 3.6 + shift, 4.2 + shift],
    }


def life(capacities, curves=(), rests=()):
    return basis(CellFacts("A"), list(curves), capacities, [], rests=list(rests)).content


def test_each_check_up_has_its_own_capacity():
    content = life([row(2.0, None), row(1.8, 200), row(1.5, 400)])
    assert content["capacity_ampere_hour"] == 2.0
    sizes = [checkup["capacity_ampere_hour"] for checkup in content["checkups"]]
    assert sizes == pytest.approx([2.0, 1.8, 1.5])
    assert at_cycle(content, 203)["capacity_ampere_hour"] == pytest.approx(1.8)
    assert "capacity_400_25 at 0.5C, 0.7500 of that of" in at_cycle(content, 400)["capacity_source"]


def test_a_slow_capacity_falls_as_the_discharge_of_the_check_ups():
    content = life([row(2.0, None), row(1.8, 200)], curves=[curve(2.2, None)])
    assert content["capacity_ampere_hour"] == 2.2
    assert at_cycle(content, 200)["capacity_ampere_hour"] == pytest.approx(2.2 * 0.9)
    own = life([row(2.0, None), row(1.8, 200)], curves=[curve(2.2, None), curve(2.1, 200)])
    assert at_cycle(own, 200)["capacity_ampere_hour"] == pytest.approx(2.1)


def test_a_slow_charge_tells_the_capacity_of_its_check_up():
    slow = {"rate": 0.05, "direction": "charge"}
    rows = [row(2.0, None), row(2.1, None, **slow), row(1.5, 300), row(1.9, 300, **slow)]
    assert at_cycle(life(rows), 300)["capacity_ampere_hour"] == pytest.approx(1.9)


@pytest.mark.parametrize(("cycle", "size", "std"), [(260, 1.74, 0.06), (320, 1.68, 0.08)])
def test_between_check_ups_it_is_a_line_with_its_doubt(cycle, size, std):
    content = life([row(2.0, None), row(1.8, 200), row(1.6, 400)])
    found = at_cycle(content, cycle)
    assert found["capacity_ampere_hour"] == pytest.approx(size)
    assert found["capacity_std_ampere_hour"] == pytest.approx(std / np.sqrt(3), rel=1e-6)
    assert "lies between the check-ups at 200 and 400" in found["capacity_source"]


def test_after_the_last_check_up_the_doubt_grows():
    content = life([row(2.0, None), row(1.8, 200)])
    near, far = (at_cycle(content, cycle) for cycle in (240, 400))
    assert near["capacity_ampere_hour"] == far["capacity_ampere_hour"] == pytest.approx(1.8)
    assert far["capacity_std_ampere_hour"] > 4 * near["capacity_std_ampere_hour"]
    assert "after the last check-up at 200" in far["capacity_source"]


def test_the_doubt_covers_fades_that_bend():
    """Fades of many shapes between two check-ups: 1.5 standard deviations hold nearly all."""
    seeds, held = np.random.default_rng(1), []
    for _ in range(300):
        power, knee, size = seeds.uniform(0.5, 2), seeds.uniform(0, 800), seeds.uniform(0.05, 0.4)

        def lost(cycle, power=power, knee=knee, size=size):
            return size * (cycle / 800) ** power + 3e-4 * max(cycle - knee, 0)

        rows = [row(2 - lost(cycle), cycle) for cycle in (0, 200, 400, 600, 800)]
        cycle = float(seeds.uniform(10, 790))
        found = at_cycle(life(rows), cycle)
        off = abs(found["capacity_ampere_hour"] - (2 - lost(cycle)))
        held.append(off <= 1.5 * (found["capacity_std_ampere_hour"] or 0) + 1e-3)
    assert np.mean(held) > 0.95


def test_tests_at_other_temperatures_make_no_check_up():
    """A fresh cell's tests carry cycle numbers too; the cold does not make it an aged one."""
    rows = [row(2.0, None), row(1.5, 8, celsius=0.0), row(2.05, 16, celsius=40.0)]
    curves = [curve(2.2, None), curve(1.9, 8, celsius=0.0)]
    content = life(rows, curves)
    assert content["checkups"] == []
    assert content["ocv"] == curves
    assert at_cycle(content, 8)["capacity_ampere_hour"] == 2.2


def test_ocv_of_a_check_up_is_its_own_else_carried_over():
    rows = [row(2.0, None), row(1.8, 200), row(1.6, 400)]
    rests = [
        curve(2.0, None, name="hppc", branches="rests"),
        curve(1.8, 200, name="hppc", branches="rests", shift=0.02),
    ]
    content = life(rows, rests=rests)
    sources = [checkup["ocv_source"] for checkup in content["checkups"]]
    assert sources[1] == "rests of hppc_200"
    assert sources[2] == "carried over from cycle 200; its shift since is not known"
    assert at_cycle(content, 400)["ocv"][0]["ocv_volt"][1] == pytest.approx(3.62)
    sources = [checkup["ocv_source"] for checkup in life(rows)["checkups"]]
    assert sources[1:] == ["none, nor at any check-up before it"] * 2


def test_soc_refers_to_the_capacity_of_the_check_up():
    content = life([row(2.0, None), row(1.0, 200)])
    series = {
        "charge_ampere_hour": np.array([0.0, -0.5, -1.0]),
        "current_ampere": np.array([0.0, -1.0, -1.0]),
        "voltage_volt": np.array([4.2, 3.6, 3.0]),
    }
    for cycle, end in ((None, 0.5), (200, 0.0), (100, 1 / 3)):
        anchored = soc_of(series, content, TestFacts("t", "hppc", 25.0, cycle, 1.0), CELL)
        assert anchored.soc[-1] == pytest.approx(end)
        assert "of " in anchored.anchor
