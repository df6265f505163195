"""Identification methods compared: each finds the truth, which pulses are taken, and refusals."""

import numpy as np
import pytest
from sheets_facts import cell_facts, facts_of

from cellwright.circuits.cell import simulate
from cellwright.circuits.circuit import rc_circuit
from cellwright.series.steps import segment
from pulse_methods.comparison import (
    METHODS,
    NAMES,
    compare_methods,
    identify_pulse,
)
from pulse_methods.of_cell import compare_identification_methods
from pulse_methods.pulse_records import PulseTest, pulse_records

TRUE = np.array([0.020, 0.010, 0.015, 3.0, 40.0])
CAPACITY = 5.0
FULL = cell_facts(3.0, 4.2)
SLOPE = 1.0  # of the OCV over SoC [V]
CURVE = {"soc": [0.0, 1.0], "ocv_volt": [3.2, 4.2], "ambient_temperature_celsius": 25.0}
BASIS = {"capacity_ampere_hour": CAPACITY, "ocv": [CURVE]}
SETTINGS = {"pulses_per_cell": 24, "samples": 200, "rest_lengths": 30.0}
PULSE = ((-5.0, 10.0), (0.0, 300.0))
PORTION = ((-5.0, 360.0), (0.0, 900.0))


def pulse_test(loads, *, noise=0.0, step=0.5, name="hppc", facts=None, basis_volt=4.2):
    """A test of (current [A], length [s]) after 600 s of rest, of a cell of constant parameters."""
    pieces = [np.zeros(round(600 / step))]
    pieces += [np.full(round(seconds / step), ampere) for ampere, seconds in loads]
    current = np.concatenate(pieces)
    time = step * np.arange(len(current))
    charge = np.concatenate([[0.0], np.cumsum(current[:-1]) * step / 3600])
    ocv = basis_volt + SLOPE * charge / CAPACITY
    volt = simulate(rc_circuit(TRUE[0], TRUE[1:3], TRUE[3:]), time, current, ocv, hold="zero_order")
    volt = volt + noise * np.random.default_rng(3).normal(size=len(time))
    steps = segment(time, current, volt, charge, rated_capacity_ampere_hour=CAPACITY)
    series = {
        "test_time_second": time,
        "current_ampere": current,
        "voltage_volt": volt,
        "charge_ampere_hour": charge,
    }
    known = facts_of(name, "hppc", soc=1.0)._replace(**facts or {})
    return PulseTest(known, series, steps)


def records_of(*tests, basis=BASIS, **settings):
    return pulse_records(tests, basis, FULL, **SETTINGS | settings)


# Relative error that each method may have at a noise [V]: R0, R1, R2, tau1, tau2. The
# autoregressive form is biased by noise, so that it is held to the truth without any.
ALLOWED = {
    "genetic": (1e-4, [0.05, 0.2, 0.1, 0.4, 0.25]),
    "autoregressive": (0.0, [1e-4, 1e-3, 1e-3, 1e-3, 1e-3]),
    "rest_exponentials": (2e-5, [0.02, 0.05, 0.05, 0.08, 0.05]),
    "lmfit": (1e-4, [0.005, 0.03, 0.03, 0.06, 0.06]),
    "separable": (1e-4, [0.005, 0.03, 0.03, 0.06, 0.06]),
}


@pytest.mark.parametrize("method", METHODS)
def test_every_method_finds_the_circuit(method):
    noise, allowed = ALLOWED[method]
    (record,) = records_of(pulse_test(PULSE, noise=noise)).records
    identified = identify_pulse(record, method)
    assert identified.reason == ""
    assert (np.abs(identified.values / TRUE - 1) < allowed).all(), identified.values
    assert identified.evaluations > 0


@pytest.mark.parametrize("method", ["lmfit", "separable"])
def test_stated_deviations_hold_the_truth(method):
    (record,) = records_of(pulse_test(PULSE, noise=3e-4)).records
    identified = identify_pulse(record, method)
    assert (np.abs(identified.values - TRUE) < 4 * identified.std).all()
    assert (identified.std < 0.2 * TRUE).all()


def test_the_profile_holds_the_slower_time_constant():
    (record,) = records_of(pulse_test(PULSE, noise=3e-4)).records
    lower, upper = identify_pulse(record, "separable").tau2_interval_second
    assert lower < TRUE[4] < upper < 2 * TRUE[4]
    (short,) = records_of(pulse_test(PULSE, noise=1e-3), rest_lengths=1.0).records
    assert np.isnan(identify_pulse(short, "separable").tau2_interval_second[1])


def test_lmfit_and_separable_least_squares_find_one_optimum():
    for seconds in (20.0, 60.0, 300.0):
        (record,) = records_of(pulse_test(((-5.0, 10.0), (0.0, seconds)), noise=3e-4)).records
        one, other = (identify_pulse(record, method) for method in ("lmfit", "separable"))
        apart = np.abs(one.values - other.values) / np.where(other.std > 0, other.std, np.inf)
        assert apart.max() < 0.1


def test_the_table_has_a_row_a_pulse_and_method():
    test = pulse_test([*PULSE, *PORTION, *PULSE, *PORTION, *PULSE], noise=1e-4)
    rows = compare_methods([test], BASIS, FULL, **SETTINGS).rows
    assert len(rows.soc) == 3 * len(METHODS)
    soc = rows.soc[rows.method == "separable"]
    np.testing.assert_allclose(soc, [1.0, 0.897, 0.794], atol=2e-3)
    assert (rows.direction == "discharge").all()
    told = ~np.isnan(rows.r0_ohm)
    assert told.sum() >= 3 * (len(METHODS) - 1)
    end = TRUE[0] + TRUE[1:3] @ -np.expm1(-10.0 / TRUE[3:]) + SLOPE * 10.0 / 3600 / CAPACITY
    mine = told & (rows.method != "autoregressive")
    np.testing.assert_allclose(rows.pulse_resistance_ohm[mine], end, rtol=0.02)
    np.testing.assert_allclose(rows.rmse_volt[rows.method == "separable"], 1e-4, rtol=0.3)
    inner = rows.r0_spread_ohm[rows.method == "separable"]
    assert np.isfinite(inner).tolist() == [False, True, False]
    assert inner[1] < 1e-4


def test_what_a_method_cannot_identify_has_a_reason_and_no_values():
    """A rest of three samples has no exponentials; the other methods go on."""
    test = pulse_test(((-5.0, 20.0), (0.0, 6.0)), step=2.0, noise=1e-4)
    rows = compare_methods([test], BASIS, FULL, **SETTINGS).rows
    (place,) = np.flatnonzero(rows.method == "rest_exponentials")
    assert "8 or more" in rows.reason[place]
    assert np.isnan([getattr(rows, name)[place] for name in NAMES]).all()
    assert rows.evaluations[place] == 0
    assert np.isfinite(rows.r0_ohm[rows.method == "separable"]).all()


def test_a_negative_resistance_is_no_circuit(monkeypatch):
    (record,) = records_of(pulse_test(PULSE)).records
    good = identify_pulse(record, "separable")
    wrong = good._replace(values=good.values * [1, -1, 1, 1, 1])
    monkeypatch.setitem(METHODS, "separable", lambda _: wrong)
    identified = identify_pulse(record, "separable")
    assert identified.reason.startswith("r1_ohm is -0.01")
    assert np.isnan(identified.values).all()


def test_pulses_are_taken_evenly_over_soc_and_tests():
    loads = [part for _ in range(8) for part in (*PULSE, *PORTION)]
    warm, cold = (pulse_test(loads, step=2.0, name=name) for name in ("warm", "cold"))
    taken = records_of(warm, cold, pulses_per_cell=6).records
    assert [one.test for one in taken] == ["warm"] * 3 + ["cold"] * 3
    soc = np.array([one.soc for one in taken[:3]])
    whole = [one.soc for one in records_of(warm).records]
    assert (soc[0], soc[2]) == (max(whole), min(whole))
    assert abs(soc[1] - np.mean(soc[[0, 2]])) < 0.06


def test_only_pulses_of_one_rate_and_from_rest_are_taken():
    """After 40 s of rest the pulse before still decays; a stronger pulse has other parameters."""
    soon = ((-5.0, 10.0), (0.0, 40.0), (3.0, 10.0), (0.0, 900.0))
    loads = [*soon, *PORTION, *soon, *PORTION, (-10.0, 10.0), (0.0, 900.0)]
    pulses = records_of(pulse_test(loads))
    assert [round(one.level_ampere) for one in pulses.records] == [-5, -5]
    assert pulses.left_out == ("hppc: 2 pulses at 1C of 3 in all",)


def test_the_ocv_moves_with_the_charge_of_the_pulse():
    (record,) = records_of(pulse_test(PULSE)).records
    moved = record.ocv_volt[-1] - record.ocv_volt[0]
    assert moved == pytest.approx(-SLOPE * 50 / 3600 / CAPACITY, rel=1e-6)
    (still,) = records_of(pulse_test(PULSE), basis=BASIS | {"ocv": []}).records
    assert (still.ocv_volt == still.ocv_volt[0]).all()


def test_the_curve_of_the_test_temperature_is_taken_also_at_zero_celsius():
    cold = CURVE | {"ambient_temperature_celsius": 0.0, "ocv_volt": [3.0, 4.2]}
    test = pulse_test(PULSE, facts={"ambient_temperature_celsius": 0.0})
    (record,) = records_of(test, basis=BASIS | {"ocv": [CURVE, cold]}).records
    moved = record.ocv_volt[-1] - record.ocv_volt[0]
    assert moved == pytest.approx(-1.2 * 50 / 3600 / CAPACITY, rel=1e-6)


def test_a_cell_without_such_pulses_has_no_row_and_the_reason():
    comparison = compare_methods(
        [pulse_test(((-5.0, 600.0), (0.0, 900.0)))], BASIS, FULL, **SETTINGS
    )
    assert {len(column) for column in comparison.rows} == {0}
    assert comparison.rows.method.dtype.kind == "U"
    (reason,) = comparison.left_out
    assert reason.startswith("hppc: no pulse of 4 samples with a rest after it and, before it,")


def test_the_step_of_the_interface_gives_the_same_rows():
    test = pulse_test(PULSE)
    comparison = compare_methods([test], BASIS, FULL, **SETTINGS)
    step = compare_identification_methods(FULL, BASIS, [tuple(test)], pulses_per_cell=24)
    columns = comparison.rows._asdict()
    assert step.notes == comparison.left_out
    for name, values in step.rows._asdict().items():
        np.testing.assert_array_equal(values, columns[name])
