"""Time constants end where the SoC stands still no longer; a stretch beyond counting is told."""

import numpy as np
import pytest
import truth
from sheets_facts import cell_facts, measured_test
from synthetic import CAPACITY, hysteresis, measured

from cellwright.identification.cell import identify
from cellwright.identification.identify import data_of, limits_of
from cellwright.records.record import record_of

SLOW_CHARGE = (0.2, 35000.0)  # [A], [s]: all of the SoC at C/10


def course(*parts, step_second=10.0):
    """Time [s] and current [A] of parts (current, duration), a row each ten seconds."""
    counts = [int(second / step_second) for _, second in parts]
    current = np.repeat([ampere for ampere, _ in parts], counts)
    return step_second * np.arange(len(current)), current


def pulses(rest_second, *, charged=True):
    """Nine set points by discharges at C/2, each with a rest and a pulse, after a slow charge."""
    set_point = [(-1.0, 720.0), (0.0, rest_second), (-2.0, 20.0), (0.0, 600.0)]
    before = [SLOW_CHARGE, (0.0, rest_second)] if charged else []
    return course((0.0, 60.0), *before, *(9 * set_point))


def record(time, current, **facts):
    soc = truth.soc_of(time, current, 0.01 if current.max() > 0 else 0.985)
    return record_of(time, current, np.full(len(time), 3.7), soc, **facts)


@pytest.mark.parametrize(
    ("parts", "longest_second"),
    [
        (pulses(3600.0), 3600.0),
        (pulses(7200.0), 7200.0),
        # A rest of half an hour is shorter than the charge takes from knot to knot, a tenth of SoC.
        (pulses(1800.0), 3600.0),
        # Where nothing rests after a load, nothing else is known.
        (course((0.0, 3600.0), (-0.4, 15000.0)), 15000.0),
        (course((0.0, 60.0), (-0.4, 15000.0), (0.0, 100.0)), 15000.0),
        (course((0.0, 60.0), (-0.4, 15000.0), (0.0, 5000.0)), 5000.0),
    ],
)
def test_a_time_constant_is_as_long_as_the_soc_stands_still(parts, longest_second):
    """Not as long as a load that passes all of the SoC: that is a course of the OCV."""
    ready = data_of([record(*parts)], truth.OCV_VOLT, capacity_ampere_hour=CAPACITY, spacing=0.1)
    assert limits_of(ready)[1] == pytest.approx(longest_second, rel=0.02)


def hppc(celsius, scale, rest_second, *, charged, seed):
    """A cell of scaled resistances, whose charge lies 10 mV above its discharge, rest or not."""
    time, current = pulses(rest_second, charged=charged)
    soc = truth.soc_of(time, current, 0.01 if charged else 0.985)
    gap = hysteresis(0.005, 0.2)
    volt = truth.voltage(time, current, soc, extra=(gap,), resistance_factor=scale)
    volt += np.random.default_rng(seed).normal(0, 3e-4, len(time))
    series = {"test_time_second": time, "current_ampere": current, "voltage_volt": volt}
    series["charge_ampere_hour"] = (soc - soc[0]) * CAPACITY
    facts = {"celsius": celsius, "soc": float(soc[0])}
    return measured_test(series, f"hppc_{celsius:g}", "hppc", **facts)


@pytest.fixture(scope="module")
def two_temperatures():
    """The warmer test begins with a slow charge, as one that was empty when it came."""
    curve = {"test": "ocv", "ambient_temperature_celsius": 25.0, "branches": "given"}
    curve |= {"soc": truth.OCV_SOC.tolist(), "ocv_volt": truth.OCV_VOLT.tolist()}
    basis = {"capacity_ampere_hour": CAPACITY, "borrowed_from": None, "ocv": [curve]}
    tests = [
        hppc(10.0, 1.0, 3600.0, charged=False, seed=1),
        hppc(40.0, 0.4, 1800.0, charged=True, seed=2),
    ]
    settings = {"members": ["2RC", "DRT"], "split_rest_second": 120.0}
    return identify(cell_facts(), basis, tests, **settings).content


def conditions(model, member):
    return next(one for one in model["members"] if one["model"] == member)["conditions"]


def steady_ohm(condition):
    return sum((np.array(b["r_ohm"]) for b in condition["branches"]), np.array(condition["r0_ohm"]))


@pytest.mark.parametrize("member", ["2RC", "DRT"])
def test_no_resistance_of_hours_makes_a_warm_cell_resist_more_than_a_cold_one(
    two_temperatures, member
):
    """A pair of ten hours held twice the cell's resistance: the gap of charge and discharge."""
    cold, warm = conditions(two_temperatures, member)
    soc = np.linspace(0.15, 0.85, 15)
    ohm = [np.interp(soc, one["soc"], steady_ohm(one)) for one in (cold, warm)]
    assert (ohm[1] < ohm[0]).all()
    true = np.interp(soc, truth.KNOTS, truth.R0 + truth.R.sum(axis=0))
    np.testing.assert_allclose(ohm[0], true, rtol=0.1)


def test_a_series_ends_at_each_temperature_where_its_rests_end(two_temperatures):
    cold, warm = conditions(two_temperatures, "DRT")
    ends = [one["branches"][-1]["tau_second"][0] for one in (cold, warm)]
    assert ends == pytest.approx([3600.0, 3600.0], rel=0.02)
    assert len(cold["branches"]) == len(warm["branches"])
    assert all(
        f"tau{len(one['branches'])}" in [b["parameter"] for b in one["at_bound"]]
        for one in (cold, warm)
    )
    words = "longest time constant: 3600 s at 10 °C, 3600 s at 40 °C"
    assert any(words in note for note in two_temperatures["notes"])


@pytest.mark.parametrize(("share", "said"), [(0.0, False), (0.06, True)])
def test_a_stretch_beyond_what_is_counted_is_found_and_told(share, said):
    """A capacity that is counted within 2 % and 6 % too large: the rests on the OCV say so."""
    time, current, volt, soc = measured(3)
    series = {"test_time_second": time, "current_ampere": current, "voltage_volt": volt}
    series["charge_ampere_hour"] = (soc - soc[0]) * CAPACITY
    curve = {"test": "ocv", "ambient_temperature_celsius": 25.0, "branches": "given"}
    curve |= {"soc": truth.OCV_SOC.tolist(), "ocv_volt": truth.OCV_VOLT.tolist()}
    size = CAPACITY * (1.0 + share)
    basis = {"capacity_ampere_hour": size, "borrowed_from": None, "ocv": [curve]}
    basis["capacity_std_ampere_hour"] = 0.02 * size
    test = measured_test(series, "drive", "drive", celsius=25.0, soc=1.0)
    model = identify(cell_facts(), basis, [test], members=["2RC"], split_rest_second=120.0).content
    (entry,) = conditions(model, "2RC")
    assert entry["ocv_scale"]["stretch"] == pytest.approx(share, abs=0.015)
    words = (
        "stretches the SoC scale by more than the stated capacity and the counted charge allow: +"
    )
    assert any(words in note for note in model["notes"]) is said
