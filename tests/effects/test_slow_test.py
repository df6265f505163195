"""The slow test that an OCV is from, the row that a SoC is counted from, and a wrong capacity."""

from functools import partial

import numpy as np
import pytest
from small_plant import CAPACITY, CELL, HEALTHY, Truth, case, drive, measured, ocv, slow_discharge

import cellwright as cw
from cellwright.effects import base, beginning, preparing
from cellwright.effects.columns import neutral
from cellwright.effects.finding import of_case
from cellwright.effects.library import LIBRARY
from cellwright.effects.preparing import MEASURED_SOC
from cellwright.effects.records import stacked
from cellwright.records.record import record_of
from cellwright.records.thinning import averaged_to

SHEET = {"cell": "A", "lower_cutoff_volt": 2.5, "upper_cutoff_volt": 4.4}
GRID = np.linspace(0.0, 1.0, 201)
CURVE = {"soc": GRID, "ocv_volt": ocv(GRID), "test": "slow", "branches": "both"}
CURVE |= {"ambient_temperature_celsius": 25.0, "half_gap_volt": np.zeros(201)}
CURVE |= {"discharge_current_ampere": -CAPACITY / 5, "charge_current_ampere": CAPACITY / 5}
BASIS = {"cell": "A", "capacity_ampere_hour": CAPACITY, "capacity_source": "slow", "ocv": [CURVE]}
SLOW_SECOND = 20.0
HYSTERESIS = Truth(hysteresis=0.012)


def both_branches():
    """Rest, C/5 down from full to empty, rest, C/5 up, rest [A]."""
    rest, branch = np.zeros(60), np.full(round(5 * 3600 / SLOW_SECOND), CAPACITY / 5)
    return np.concatenate([rest, -branch, rest, branch, rest])


def discharging(seed):
    """A drive that hardly charges [A]."""
    return drive(seed, highest=0.1)[:1000]


def as_test(record, *, kind=None, role="fit", cycle=None):
    """A record as a measured test: (facts, series)."""
    passed = np.cumsum(
        np.append(0.0, record.current_ampere[:-1] * np.diff(record.test_time_second))
    )
    facts = {"cell": "A", "test": record.test, "kind": kind or record.kind, "role": role}
    facts |= {"soc": float(record.soc[0]), "cycle": cycle, "ambient_temperature_celsius": 25.0}
    series = {
        "test_time_second": record.test_time_second,
        "current_ampere": record.current_ampere,
        "voltage_volt": record.voltage_volt,
        "charge_ampere_hour": passed / 3600.0,
    }
    return facts, series


def made_tests(truth, *, cycle=None):
    """A slow test, a discharge and two drives; the last judges. None charges but the slow test."""
    slow = measured("slow", both_branches(), 25.0, 1.0, truth, seed=1, every=SLOW_SECOND)
    dynamic = [
        measured("down", slow_discharge(), 25.0, 1.0, truth, seed=2, kind="capacity"),
        measured("fitted", discharging(3), 25.0, 0.95, truth, seed=3),
    ]
    proof = measured("proof", discharging(4), 25.0, 0.95, truth, seed=4)
    yield as_test(slow, kind="ocv", cycle=cycle)
    yield from (as_test(record) for record in dynamic)
    yield as_test(proof, role="validation")


def prepared(tests):
    return cw.prepared_case(SHEET, BASIS, list(tests))


def test_the_slow_test_is_fitted_where_its_branches_measure_the_ocv():
    made = prepared(made_tests(HEALTHY))
    assert made.fit.tests == ("slow", "down", "fitted")
    assert made.validation.tests == ("proof",)
    rows = made.fit.part([0])
    soc = base.fields_of(made.cell, made.fit, beginning.first_values(made.cell, made.fit)).soc
    assert soc[rows].min() == pytest.approx(0.0, abs=0.005)
    used = soc[rows & made.fit.used]
    assert used.min() > MEASURED_SOC[0] - 0.01
    assert used.max() < MEASURED_SOC[1] + 0.01


def test_a_slow_test_of_another_checkup_or_of_another_curve_is_not_fitted():
    assert prepared(made_tests(HEALTHY, cycle=500)).fit.tests == ("down", "fitted")
    renamed = BASIS | {"ocv": [CURVE | {"test": "another"}]}
    for other in (renamed, BASIS | {"borrowed_from": "B"}):
        made = cw.prepared_case(SHEET, other, list(made_tests(HEALTHY)))
        assert made.fit.tests == ("down", "fitted")


@pytest.mark.slow
def test_a_slow_test_of_several_cycles_is_not_fitted_and_told():
    """Its count drifts from cycle to cycle, and no single end is the curve's empty."""
    tests = list(made_tests(HEALTHY))
    twice = np.concatenate([both_branches(), both_branches()])
    slow = measured("slow", twice, 25.0, 1.0, HEALTHY, seed=1, every=SLOW_SECOND)
    found = cw.missing_effect(SHEET, BASIS, [as_test(slow, kind="ocv"), *tests[1:]])
    assert found.notes[0] == (
        "not used: slow: it moves 4.0 times the capacity: more than one slow cycle"
    )


def test_the_slow_test_is_never_what_judges():
    tests = [
        *made_tests(HEALTHY),
        as_test(measured("more", discharging(5), 25.0, 0.95, HEALTHY, seed=5)),
    ]
    tests = [(facts | {"role": "fit"}, series) for facts, series in tests]
    made = prepared(tests)
    assert "slow" in made.fit.tests
    assert made.validation.tests


def test_a_slow_test_alone_is_no_record_to_fit():
    tests = list(made_tests(HEALTHY))
    with pytest.raises(cw.Refusal, match="no test can be fitted"):
        prepared([tests[0], tests[-1]])


@pytest.mark.slow
def test_a_hysteresis_that_drives_alone_would_leave_to_the_ocv_shows_in_the_slow_test():
    tests = list(made_tests(HYSTERESIS))
    finding = of_case("A", prepared(tests), LIBRARY)
    found = finding.verdict
    named = [one["effect"] for one in found["effects"]]
    assert named
    assert set(named) <= {"hysteresis_one_state", "hysteresis_instant"}
    _shows_what_it_was_chosen_by(finding)
    without = of_case("A", prepared(tests[1:]), LIBRARY).verdict
    assert not without["effects"]


def test_an_offset_of_the_current_that_the_slow_test_had_not_is_told():
    slow, *_ = made_tests(HEALTHY)
    _, *others = made_tests(Truth(offset=0.06))
    verdict = of_case("A", prepared([slow, *others]), LIBRARY).verdict
    (entry,) = verdict["effects"]
    assert entry["effect"] == "current_offset"
    assert entry["parameters"]["in_slow_test"]["value"] == 0.0
    size = entry["parameters"]["offset_ampere"]
    assert size["value"] == pytest.approx(0.06, abs=max(3 * size["std"], 0.003))
    assert verdict["gap_closed"] > 0.9


@pytest.mark.slow
@pytest.mark.parametrize("noise_ampere", [0.0, 0.002 * CAPACITY])
def test_noise_is_no_step_and_edges_stay_where_a_long_test_is_thinned(monkeypatch, noise_ampere):
    """Pulses of a minute with rests of an hour: what noise would keep would blunt their edges."""
    pulses = np.tile(np.r_[np.full(30, -CAPACITY), np.zeros(1770)], 8)
    tests = []
    for seed, (name, role) in enumerate([("fitted", "fit"), ("proof", "validation")]):
        record = measured(name, np.r_[np.zeros(30), pulses], 25.0, 0.9, seed=seed)
        read = noise_ampere * np.random.default_rng(seed).normal(size=len(record.soc))
        noisy = record._replace(current_ampere=record.current_ampere + read)
        tests.append(as_test(noisy, role=role))
    monkeypatch.setattr(preparing, "averaged_to", partial(averaged_to, most_rows=1500))
    made = cw.prepared_case(SHEET, BASIS, tests)
    stack = made.fit
    moved = np.abs(np.diff(stack.current_ampere)) > CAPACITY / 2
    assert 300 < len(stack.second) <= 1500
    assert np.count_nonzero(moved) == 16
    np.testing.assert_allclose(stack.step_second[1:][moved], 2.0)


def _shows_what_it_was_chosen_by(finding):
    """The parts of the evidence give the numbers of the verdict's first effect."""
    first = finding.verdict["effects"][0]
    parts = {name: np.array(values) for name, values in finding.evidence.items()}
    mine = parts["effect"] == first["effect"]
    rows, change, missing = (
        parts[name][mine] for name in ("rows", "sensitivity_volt", "residual_volt")
    )
    assert set(parts["role"][mine]) == {"fit", "validation"}
    share = np.sum(rows * missing) / np.sum(rows * change)
    assert share == pytest.approx(1.0, abs=0.2)


def charged(soc_at_start, anchor_row):
    """A C/2 charge by a tenth and a rest; the SoC is known in one of its rows."""
    current = np.concatenate([np.zeros(10), np.full(72, CAPACITY / 2), np.zeros(50)])
    clock = 10.0 * np.arange(len(current))
    record = record_of(clock, current, np.full(len(current), 3.8), soc_at_start)
    return record._replace(anchor_second=None if anchor_row is None else clock[anchor_row])


@pytest.mark.parametrize("anchor_row", [None, 0, 90])
def test_the_soc_stays_where_it_is_known_and_the_start_moves(anchor_row):
    stack = stacked([charged(0.5, anchor_row)], capacity_ampere_hour=CAPACITY)
    values = beginning.first_values(CELL, stack)
    soc = base.fields_of(CELL, stack, values).soc
    larger = base.fields_of(CELL, stack, values | {"capacity": 0.25}).soc
    known = anchor_row or 0
    assert larger[known] == pytest.approx(soc[known], abs=1e-12)
    assert np.ptp(larger) == pytest.approx(np.ptp(soc) / 1.25)


def test_an_offset_of_the_current_moves_the_start_as_well():
    stack = stacked([charged(0.5, 90)], capacity_ampere_hour=CAPACITY)
    values = beginning.first_values(CELL, stack)
    offset = LIBRARY["current_offset"]
    wrong = values | neutral(offset) | {offset.names[0]: 0.05}
    soc = base.fields_of(CELL, stack, values).soc
    moved = base.fields_of(CELL, stack, wrong, (offset,)).soc
    assert moved[90] == pytest.approx(soc[90], abs=1e-12)
    assert moved[0] - soc[0] == pytest.approx(0.05 * 900 / 3600 / CAPACITY, rel=0.02)
    assert base.starts_of(CELL, stack, wrong, (offset,)) == {"": pytest.approx(moved[0])}


@pytest.mark.slow
@pytest.mark.parametrize("wrong", [0.88, 1.0, 1.12])
def test_a_capacity_that_is_declared_wrongly_is_found_and_told(wrong):
    cell = CELL._replace(capacity_ampere_hour=wrong * CAPACITY)
    declared = case(HEALTHY)._replace(cell=cell)
    begin = beginning.first_capacity(cell, declared.fit)
    assert begin == pytest.approx(1 / wrong - 1, abs=0.03)
    verdict = of_case("A", declared._replace(first_capacity=begin), LIBRARY).verdict
    assert not {one["effect"] for one in verdict["effects"]} - {"capacity_error"}
    assert verdict["rmse_volt"]["after"] < 4e-3
    told = {one["name"]: one["value"] for one in verdict["nuisances"]}
    if wrong != 1.0:
        # The tolerance of 0.3 % pulls it back; the rest is in the OCV, within its own.
        assert 0.5 < told["capacity"] / (1 / wrong - 1) < 1.05


def test_of_branches_joined_from_their_ends_the_search_takes_the_mean():
    """A gap that grows within a few percent would leave a fifth of it in the OCV."""
    half = 0.02 * (1 - np.exp(-GRID / 0.02)) * (1 - np.exp(-(1 - GRID) / 0.02))
    branches = {"discharge_volt": ocv(GRID) - half, "charge_volt": ocv(GRID) + half}
    bent = ocv(GRID) + 0.01 * np.sin(2 * np.pi * GRID)
    for joined_by, expected in (("equilibrium", ocv(GRID)), ("mean", bent)):
        curve = CURVE | branches | {"ocv_volt": bent, "joined_by": joined_by}
        made = cw.prepared_case(SHEET, BASIS | {"ocv": [curve]}, list(made_tests(HEALTHY)))
        np.testing.assert_allclose(made.cell.ocv_at(GRID), expected, atol=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["voltage_offset", "voltage_gain", "ocv_shift"])
def test_what_moves_the_ocv_or_its_reading_shows_since_the_slow_test(name):
    """The OCV is what the slow test read, with whatever the reading was off by."""
    stack = prepared(made_tests(HEALTHY)).fit
    effect, values = LIBRARY[name], beginning.first_values(CELL, stack)
    without = base.voltage(CELL, stack, values)
    sized = values | neutral(effect) | {effect.names[0]: 0.01}
    moved = base.voltage(CELL, stack, sized, (effect,)) - without
    slow = np.array(stack.kinds)[stack.file] == "ocv"
    assert slow.any()
    assert not moved[slow].any()
    assert np.abs(moved[~slow]).max() > 0.005
