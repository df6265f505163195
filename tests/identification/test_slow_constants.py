"""Time constants end where the SoC stands still no longer, and the stretch where counting ends."""

import numpy as np
import pytest
import truth
from sheets_facts import cell_facts, measured_test
from synthetic import CAPACITY, data, fit, hysteresis, measured

from cellwright.circuits.parameters import parameter_rows
from cellwright.identification.cell import cell_model
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
    return cell_model(cell_facts(), basis, tests, **settings)


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
    assert all(f"tau{len(one['branches'])}" in one["at_bound"] for one in (cold, warm))
    words = "time constants end at 3600 s at 10 °C, 3600 s at 40 °C"
    assert any(words in note for note in two_temperatures["notes"])


def counted(stretch, **settings):
    """A drive whose SoC is counted over a capacity that is too large by so much."""
    time, current, volt, soc = measured(3)
    return data(time, current, volt, 1.0 - (1.0 - soc) / (1.0 + stretch), **settings)


def stretch_row(condition):
    from cellwright.circuits.model_file import condition_entry

    entry = condition_entry(condition, ambient_temperature_celsius=25.0, tests=["drive"])
    model = {"members": [{"model": "2RC", "conditions": [entry]}]}
    return next(row for row in parameter_rows(model) if row["parameter"] == "ocv_stretch")


def test_a_stretch_within_what_the_tests_count_is_found():
    fitted = fit(counted(0.012, capacity_std_ampere_hour=0.01 * CAPACITY))
    assert fitted.condition.stretch == pytest.approx(0.012, abs=0.008)
    assert not stretch_row(fitted.condition)["at_bound"]


@pytest.mark.parametrize(("lacking", "std"), [((), 0.01), ((0.06, 0.08), 0.036), ((-0.01,), 0.01)])
def test_capacity_tests_that_count_less_than_the_capacity_leave_it_open(lacking, std):
    """Of 6 and 8 % less at two rates the smaller, over √3, beside 1 % of the capacity."""
    time, current = course((0.0, 60.0), (-1.0, 7000.0))
    soc = truth.soc_of(time, current, 1.0)
    drive = record_of(time, current, np.full(len(time), 3.7), soc)
    ends = [
        record_of(
            time,
            current,
            np.linspace(4.1, truth.OCV_VOLT[0], len(time)),
            1.0 - (1.0 - soc) * (1.0 - share) / np.ptp(soc),
            kind="capacity",
        )
        for share in lacking
    ]
    sizes = {"capacity_ampere_hour": CAPACITY, "capacity_std_ampere_hour": 0.01 * CAPACITY}
    ready = data_of([drive, *ends], truth.OCV_VOLT, **sizes)
    assert ready.stretch_std == pytest.approx(std, rel=0.02)


def test_no_stretch_contradicts_what_the_tests_count():
    """A capacity that is counted within 0.5 % is not 5 % smaller, whatever a fit would gain."""
    ready = counted(0.05, capacity_std_ampere_hour=0.005 * CAPACITY)
    assert 0.005 < ready.stretch_std < 0.006
    fitted, free = fit(ready), fit(counted(0.05))
    assert free.condition.stretch > 0.03
    assert fitted.condition.stretch == pytest.approx(2 * ready.stretch_std)
    row = stretch_row(fitted.condition)
    assert row["at_bound"]
    assert row["value"] == fitted.condition.stretch
