"""Paired mode: healthy cells that the circuit fails in the same way, and one that has more."""

import re
from functools import cache

import numpy as np
import pytest
from small_plant import NOISE_VOLT, Truth, case_of

from cellwright.effects import base, finding, records
from cellwright.effects.case import Case
from cellwright.effects.given import paired as given_paired
from cellwright.effects.given.paired import counterpart_second, paired, part
from cellwright.effects.library import LIBRARY
from cellwright.effects.library.resistance import TOWARDS_EMPTY, TOWARDS_FULL
from cellwright.records.record import record_of
from cellwright.refusal import Refusal

CAPACITY = 5.0
CELL = base.Cell(CAPACITY, 3.2 + 0.9 * np.linspace(0, 1, 101) + 0.05 * np.linspace(0, 1, 101) ** 8)


def steps(effect, towards_empty, towards_full):
    """Course of a resistance over SoC, from knot to knot of the library."""
    knots = (*TOWARDS_EMPTY, *TOWARDS_FULL)
    sizes = zip(knots, (*towards_empty, *towards_full), strict=True)
    return {f"{effect}.step_to_{100 * knot:.0f}_percent": size for knot, size in sizes}


# What no healthy cell of this type is without, and the plain model knows nothing of.
COMMON = {
    **steps("resistance_soc", (0.1, 0.15, 0.3, 0.25, 0.2), (-0.1, -0.05, 0.0, 0.05)),
    **steps("polarisation_soc", (0.0, 0.1, 0.2, 0.2, 0.1), (0.06, 0.06, 0.04, 0.04)),
    "polarisation_soc.excess_of_quicker_pair": 0.0,
}
HIDDEN = {"hysteresis_instant.amplitude_volt": 0.008}
CANDIDATES = ("resistance_soc", "polarisation_soc", "hysteresis_instant", "resistance_asymmetry")


def drive(seed, hours=1.0):
    """Current of a rest, then loads of 10 to 60 s and rests, from full to a third [A]."""
    random = np.random.default_rng(seed)
    loads = np.repeat(
        random.choice([-7.0, -4.0, -2.0, 3.0, 0.0], 400), random.integers(10, 60, 400)
    )
    count = int(3600 * hours)
    return np.concatenate([np.zeros(200), loads[:count], np.zeros(600)])


def record(test, current, seed, hidden=(), warm=25.0, jitter=0.0):
    """A record of one cell; `seed` also draws what is its own."""
    random = np.random.default_rng(seed)
    clock = np.arange(len(current), dtype=float)
    empty = record_of(clock, current, np.zeros(len(clock)), 1.0, test=test, celsius=warm)
    stack = records.stacked([empty], capacity_ampere_hour=CAPACITY)
    names = {name.split(".")[0] for name in (*COMMON, *hidden)}
    effects = [LIBRARY[name] for name in LIBRARY if name in names]
    scatter = np.random.default_rng(seed // 10).normal(size=5)
    values = dict.fromkeys(base.base_names(1), 0.0) | {"soc0[0]": 1.0} | COMMON | dict(hidden)
    logs = np.log([0.02, 0.01, 8.0, 0.012, 130.0]) + 0.1 * scatter
    values |= dict(zip(base.LOGARITHMS, logs, strict=True))
    volt = base.voltage(CELL, stack, values, effects) + 1e-3 * random.normal(size=len(clock))
    return empty._replace(voltage_volt=volt)


def case(number, hidden=(), **changes):
    """A cell's case: two records to fit, one that judges."""
    made = [
        record(test, drive(k) * changes.get(test, 1.0), 10 * number + k, hidden)
        for k, test in enumerate(("mild", "wild", "proof"))
    ]
    stacks = [records.stacked(r, capacity_ampere_hour=CAPACITY) for r in (made[:2], made[2:])]
    return Case(CELL, *stacks)


@cache
def references(count=3):
    return {f"r{k}": case(k) for k in range(1, count + 1)}


def library():
    return {name: LIBRARY[name] for name in CANDIDATES}


def searched(made):
    """(Found, ids of the names) of a search."""
    found, result, *_ = finding.searched(made, library())
    return found, [one.effect.id for one in result.names]


def test_a_healthy_cell_alone_lacks_something_and_beside_others_does_not():
    healthy = case(8)
    assert searched(healthy)[0].last.effects
    found, names = searched(paired(healthy, references()).case)
    assert (found.last.effects, names) == ((), [])


def test_what_a_cell_has_beyond_healthy_ones_is_named_first_and_recovered():
    found, names = searched(paired(case(9, HIDDEN), references()).case)
    assert names[0] == "hysteresis_instant"
    amplitude_volt = found.last.solution.values["hysteresis_instant.amplitude_volt"]
    assert amplitude_volt == pytest.approx(0.008, rel=0.1)


@pytest.mark.slow
def test_the_template_takes_most_of_what_a_plain_model_leaves():
    healthy = case(8)
    plain = searched(healthy)[0].first
    with_template = searched(paired(healthy, references()).case)[0].first
    # Errors of the starts, which both have, are taken out of either.
    assert with_template.validation_rmse_volt < 0.65 * plain.validation_rmse_volt


def test_a_template_that_is_noise_where_it_is_fitted_stands_whole_on_other_records():
    """Its scale there is told by nothing, and says nothing of a record with a large template."""
    alone = case(8)
    read = 1e-3 * np.random.default_rng(5).normal(size=len(alone.fit.file))
    large = 0.02 * np.sin(np.linspace(0.0, 40.0, len(alone.validation.file)))
    fit = alone.fit._replace(template_volt=read)
    measured = alone.validation.voltage_volt + large
    validation = alone.validation._replace(template_volt=large, voltage_volt=measured)
    without, beside = (
        searched(made)[0].first for made in (alone, alone._replace(fit=fit, validation=validation))
    )
    assert abs(beside.solution.values["known"]) < 0.5
    assert beside.validation_rmse_volt == pytest.approx(without.validation_rmse_volt, abs=1e-3)


def test_a_template_is_needed_where_the_circuit_fails_healthy_cells(monkeypatch):
    assert paired(case(8), references()).needed
    monkeypatch.setattr(given_paired, "NEEDED_RATIO", 100.0)
    assert not paired(case(8), references()).needed


def with_contact(stack, ohm):
    """A stack of a cell whose contacts have more resistance."""
    return stack._replace(voltage_volt=stack.voltage_volt + ohm * stack.current_ampere)


def test_resistances_of_the_references_stand_in_the_model_over_soc():
    stack = paired(case(8), references()).case.fit
    low, middle = (
        stack.ohmic_course[(stack.second > at) & (stack.second < at + 60)].mean()
        for at in (3400, 1200)
    )
    columns = (stack.ohmic_course, *stack.slow_courses, stack.tau_course)
    assert {column.shape for column in columns} == {stack.second.shape}
    assert low / middle > 1.02, "the resistance rises towards empty"


@pytest.mark.slow
@pytest.mark.parametrize("ohm", [0.0, 0.006, 0.012])
def test_more_resistance_of_the_contacts_is_no_effect(ohm):
    """It follows neither SoC nor temperature, which the resistance of the references does."""
    healthy = case(8)
    stacks = {role: with_contact(getattr(healthy, role), ohm) for role in ("fit", "validation")}
    found, names = searched(paired(healthy._replace(**stacks), references()).case)
    assert not names
    contact = found.first.solution.values[base.LEAD]
    # What is constant of a resistance that has a course is not known by itself.
    assert 0.0 <= contact <= ohm + 0.008


@pytest.mark.slow
def test_one_or_two_references_serve_with_a_declared_spread():
    few, many = (paired(case(8), references(count)) for count in (1, 3))
    assert few.references == ("r1",)
    assert few.case.gates.material_volt > many.case.gates.material_volt
    assert few.case.tolerance.known > many.case.tolerance.known
    assert not searched(few.case)[1]
    found = searched(paired(case(9, HIDDEN), references(1)).case)[1]
    assert found[0] == "hysteresis_instant"


def test_what_healthy_cells_differ_by_is_not_unknown():
    alike = {name: case(1) for name in ("r1", "r2", "r3")}
    same, other = (paired(case(8), others).case.gates for others in (alike, references()))
    assert same.unknown_volt == pytest.approx(case(8).gates.unknown_volt, rel=1e-6)
    assert other.unknown_volt > same.unknown_volt


def test_no_reference_at_all_is_refused():
    with pytest.raises(Refusal, match="no healthy reference cell ran the same protocol"):
        paired(case(8), {})


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"wild": 1.2}, r"wild: from row \d+ on the current differs .* by 0\.\d+ C"),
        ({"proof": -1.0}, r"proof: from row"),
    ],
)
def test_a_test_with_other_currents_is_not_compared_with_that_reference(change, words):
    others = references() | {"r4": case(4, **change)}
    result = paired(case(8), others)
    told = result.left_out | result.unshared
    assert set(told) == {"r4"}
    assert re.search(words, told["r4"])
    assert not searched(result.case)[1]


def test_references_that_share_little_of_the_fit_are_refused():
    others = {f"r{k}": case(k, mild=1.3, wild=1.3) for k in (1, 2)}
    with pytest.raises(Refusal, match=r"r1: mild: from row \d+ .*; r2: mild: from row"):
        paired(case(8), others)


def alone(current, warm=25.0):
    stack = records.stacked([record("mild", current, 11, warm=warm)], capacity_ampere_hour=CAPACITY)
    return part(stack, "mild", "drive", CAPACITY)


def test_a_missing_test_is_refused_by_name():
    stack = case(1).fit
    with pytest.raises(Refusal, match="hot: no such drive test in this role, found mild, wild"):
        part(stack, "hot", "drive", CAPACITY)


def test_another_temperature_is_refused():
    with pytest.raises(Refusal, match=r"mild: .*25.0 degC .* 28.0 degC; .* 2 K"):
        counterpart_second(alone(drive(0)), alone(drive(0), warm=28.0))


def test_a_drive_with_another_load_in_it_is_refused():
    longer = np.insert(drive(0), 1000, np.full(900, -1.0))
    with pytest.raises(Refusal, match=r"mild: from row \d+ on the current differs"):
        counterpart_second(alone(drive(0)), alone(longer))


def test_a_record_that_ends_early_is_refused():
    with pytest.raises(Refusal, match=r"mild: the reference has \d+ % of the rows, the first"):
        counterpart_second(alone(drive(0)), alone(drive(0)[:1500]))


@pytest.mark.parametrize("cut_second", [-60, 60])
def test_drives_that_met_the_cut_off_a_minute_apart_are_compared_to_the_shorter_end(cut_second):
    whole = drive(0, hours=2.0)
    whole[-900:-600] = -3.0  # the load under which the cut-off is met
    load = len(whole) - 600 - abs(cut_second)
    early = np.concatenate([whole[:load], np.zeros(600)])
    here, there = (whole, early) if cut_second > 0 else (early, whole)
    second = counterpart_second(alone(here), alone(there))
    shorter = np.flatnonzero(np.isfinite(second))
    assert second[shorter[shorter < load]] == pytest.approx(shorter[shorter < load], abs=2)
    rest = len(here) - 300
    assert second[rest] == pytest.approx(len(there) - 300, abs=2)
    assert np.isnan(second[load + 5 : load + 55]).all() == (cut_second > 0)


@pytest.mark.parametrize("offset_ampere", [0.0, CAPACITY / 125, -CAPACITY / 125, CAPACITY / 60])
def test_an_offset_of_the_reading_hides_no_rest(offset_ampere):
    random = np.random.default_rng(1)
    slow = np.concatenate([np.zeros(300), np.full(3000, -2.0), np.zeros(300), np.full(900, 2.0)])
    late = np.concatenate([np.zeros(300), np.full(3100, -2.0), np.zeros(300), np.full(900, 2.0)])
    read = slow + offset_ampere + CAPACITY / 500 * random.normal(size=len(slow))
    second = counterpart_second(alone(read), alone(late))
    assert second[3300] == pytest.approx(3400, abs=2)
    assert second[4000] == pytest.approx(4100, abs=2)


def test_rows_that_a_reference_has_not_are_not_compared():
    others = references(2) | {"r3": shortened(case(3))}
    result = paired(case(8), others).case
    assert not result.fit.used[-100:].any()
    assert result.fit.used[:-201].all()
    assert result.validation.used.all()


def shortened(whole):
    """Without the last 200 rows of the records that are fitted."""
    stack = whole.fit
    keep = np.arange(len(stack.file)) < len(stack.file) - 200
    rows = {n: v[keep] for n, v in stack._asdict().items() if np.shape(v) == keep.shape}
    return whole._replace(fit=stack._replace(**rows))


def test_a_template_is_never_larger_than_it_was_by_more_than_its_prior(monkeypatch):
    monkeypatch.setattr(given_paired, "SCALE_STD", 1e-6)
    result = paired(case(8), references())
    values = searched(result.case)[0].first.solution.values
    assert values["known"] == pytest.approx(1.0, abs=1e-3)


@pytest.mark.slow
def test_a_healthy_cell_has_the_course_of_either_pair_and_of_their_time_constants():
    """With that of the quicker pair for both, and none of time constants, 3.7 mV are left of it."""
    truth = Truth(activation=2.5e4, following=1.0, bend_r1=2.0)
    others = {f"r{seed}": case_of(truth, seed=seed) for seed in (2, 3, 4)}
    pair = paired(case_of(truth, seed=5), others)
    assert pair.needed
    quicker, slower = (course.max() / course.min() for course in pair.case.fit.slow_courses)
    assert quicker > 1.5 * slower
    before = searched(pair.case)[0].first
    assert before.worst_volt < 1.2 * NOISE_VOLT
