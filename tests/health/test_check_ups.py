"""Slow curves by check-up: like with like, order, what is left out and said."""

import numpy as np
import pytest
from half_cell_lives import SOC, curve_of

import cellwright as cw
from cellwright.health.electrodes.slow_curves import check_ups, growth, need_two, slow_curve
from cellwright.refusal import Refusal

VOLT = 3.0 + SOC
LIMITS = {"lower_cutoff_volt": 3.0, "upper_cutoff_volt": 4.0}


def made(cycle, **changes):
    return curve_of(SOC, VOLT, 2.0 - cycle / 1000, cycle=cycle, **changes)


def test_cycles_in_any_order_come_out_by_age():
    chosen, left_out = check_ups([made(200.0), made(0.0), made(100.0)])
    assert [curve.cycle for curve in chosen] == [0.0, 100.0, 200.0]
    assert not left_out


def test_like_is_compared_with_like():
    """An OCV test with both branches only when fresh, slow charges at every check-up."""
    both = made(0.0, test="ocv", branches="both", current_ampere=0.1)
    charges = [made(cycle) for cycle in (0.0, 100.0, 200.0)]
    chosen, left_out = check_ups([both, *charges])
    assert {curve.branches for curve in chosen} == {"charge"}
    assert not left_out


def test_another_temperature_is_left_out_and_named():
    cold = made(100.0, ambient_temperature_celsius=5.0)
    chosen, left_out = check_ups([made(0.0), made(200.0), cold])
    assert [curve.cycle for curve in chosen] == [0.0, 200.0]
    assert len(left_out) == 1
    assert "slow_100" in left_out[0]
    assert "at 5 °C" in left_out[0]


def test_an_aged_curve_without_its_cycle_is_asked_about():
    """A blank cycle means fresh: two curves of one cycle that differ by 20 % cannot both be."""
    lost = made(0.0, test="late")._replace(capacity_ampere_hour=1.6)
    chosen, left_out = check_ups([made(0.0), lost, made(100.0)])
    assert [curve.test for curve in chosen] == ["slow_0", "slow_100"]
    assert left_out == [
        "late: a second curve at cycle 0, whose capacity is -20.0 % off slow_0; is its cycle "
        "missing in tests.tsv?"
    ]


def test_one_check_up_is_refused_with_what_was_found():
    with pytest.raises(Refusal, match=r"C1: .*slow_0 at cycle 0.* column `cycle`"):
        need_two([made(0.0)], "C1")
    with pytest.raises(Refusal, match="none"):
        need_two([], "C1")


def test_a_capacity_that_grows_is_said():
    grown = made(100.0)._replace(capacity_ampere_hour=2.2)
    assert "grew by 10.0 %" in growth([made(0.0), grown])[0]
    assert not growth([made(0.0), made(100.0)])


def record(rate, *, charge_only=False):
    """A discharge from full and a charge back at a rate [1/h], 20 mV of polarisation each."""
    seconds = np.linspace(0, 3600 / rate, 1000)
    soc = np.append(1 - seconds * rate / 3600, seconds * rate / 3600)
    sign = np.repeat([-1.0, 1.0], 1000)
    ends = np.array([0, *np.flatnonzero(np.diff(sign)), len(soc) - 1])
    volt = np.clip(3.0 + soc + 0.02 * sign, 3.0, 4.0)
    volt[ends[1] :: 1000][:1] = 3.0
    time = np.append(seconds, seconds[-1] + 10 + seconds)
    keep = slice(1000, None) if charge_only else slice(None)
    names = ("test_time_second", "current_ampere", "voltage_volt", "charge_ampere_hour")
    values = (time, 2.0 * rate * sign, volt, 2.0 * soc)
    return {name: value[keep] for name, value in zip(names, values, strict=True)}


def test_faster_branches_count_where_both_are_there():
    test = cw.TestFacts("ica", "ica", 25.0, 100.0)
    hours = {"least_hour": 8.0, "mean_hour": 1.2}
    curve = slow_curve(record(0.5), test, cell="C1", **hours, **LIMITS)
    assert curve.branches == "both"
    assert curve.cycle == 100.0
    middle = np.interp([0.3, 0.5, 0.7], curve.soc, curve.voltage_volt)
    assert middle == pytest.approx([3.3, 3.5, 3.7], abs=0.003)


def test_a_fast_charge_alone_is_refused():
    test = cw.TestFacts("ica", "ica", 25.0, 100.0)
    with pytest.raises(Refusal):
        slow_curve(
            record(0.5, charge_only=True), test, cell="C1", least_hour=8.0, mean_hour=1.2, **LIMITS
        )
