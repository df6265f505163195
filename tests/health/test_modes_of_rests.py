"""Degradation modes from rests: known losses in their intervals, which curve counts, refusals."""

import numpy as np
import pytest
from half_cell_lives import LOSSES, life, nmc

import cellwright as cw
from cellwright.health.electrodes.modes import degradation_modes
from cellwright.health.electrodes.slow_curves import check_ups, rest_curve
from cellwright.records import facts
from cellwright.refusal import Refusal

PLACES = np.array([0.05, *np.arange(0.1, 0.95, 0.1)])
CELL = {"cell": "C1", "lower_cutoff_volt": 3.0, "upper_cutoff_volt": 4.15}


def points_of(curve, places=PLACES, direction="discharge"):
    """Rests at some SoC of a check-up, as of stage `ocv_rest_points`."""
    volt = np.interp(places, curve.soc, curve.voltage_volt)
    columns = {"soc": places, "charge_ampere_hour": curve.capacity_ampere_hour * places}
    columns |= {"end_volt": volt - 1e-3, "relaxed_volt": volt}
    size = len(places)
    return columns | {
        "direction": np.full(size, direction),
        "current_ampere": np.full(size, -0.5),
    }


def facts_of(cycle):
    return facts.TestFacts(
        f"hppc_{cycle:.0f}", "hppc", ambient_temperature_celsius=25.0, cycle=cycle
    )


def rests_of(seed, **changes):
    curves = life(seed, shift_volt=0.003, **changes)
    return [rest_curve(points_of(c), facts_of(c.cycle), cell="C1") for c in curves]


@pytest.fixture(scope="module")
def lives():
    """Estimates of six lives from ten rests a check-up; half cells err by 2 and 1 mV."""
    return [degradation_modes(rests_of(seed), nmc()[0]) for seed in range(6)]


@pytest.mark.slow
def test_ten_rests_tell_the_losses_within_their_intervals(lives):
    errors = np.array([found.joint - LOSSES for found in lives])[:, 1:]
    stds = np.array([found.joint_std for found in lives])[:, 1:]
    assert np.sqrt(np.mean(errors**2, axis=(0, 1))).max() < 0.02
    assert 0.88 <= np.mean(np.abs(errors) < 1.96 * stds) <= 1.0
    assert stds.mean() < 0.03, "intervals that hold all are of no use"


def test_a_rest_counts_where_its_exponentials_end():
    curve = life(0)[0]
    points = points_of(curve)
    points["relaxed_volt"][3] = np.nan
    found = rest_curve(points, facts_of(0.0), cell="C1")
    expected = np.interp(PLACES, curve.soc, curve.voltage_volt)
    expected[3] -= 1e-3
    assert found.voltage_volt == pytest.approx(expected)
    assert found.capacity_ampere_hour == pytest.approx(curve.capacity_ampere_hour)
    assert found.branches == "rests"


def test_too_few_rests_are_refused():
    with pytest.raises(Refusal, match="5 rests after discharge over 40% of SoC; 8 over 60%"):
        rest_curve(points_of(life(0)[0], PLACES[1:6]), facts_of(0.0), cell="C1")


def test_rests_count_only_where_more_check_ups_have_them():
    slow, rests = life(0), rests_of(0)
    assert {curve.branches for curve in check_ups([*slow, *rests])[0]} == {"charge"}
    assert {curve.branches for curve in check_ups([*slow[:1], *rests])[0]} == {"rests"}


def test_modes_of_a_cell_without_slow_charges_by_the_public_interface():
    rests = [(facts_of(c.cycle), points_of(c)) for c in life(2, shift_volt=0.003)]
    names = ("graphite_siox_chen", "nmc811_chen")
    found = cw.degradation_modes([], CELL, rests=rests, half_cells=names)
    assert [row["test"] for row in found.rows] == ["hppc_0", "hppc_100", "hppc_200", "hppc_300"]
    last = found.rows[-1]
    assert abs(last["lli"] - LOSSES[-1, 0]) < 1.96 * last["lli_std"] + 0.002
    with pytest.raises(Refusal, match="slow curves or rests of one check-up"):
        cw.degradation_modes([], CELL, rests=rests[:1], half_cells=names)
