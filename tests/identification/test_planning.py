"""A plan of tests: what it expects of a test is what a fit to that test then shows."""

import re
from itertools import pairwise

import numpy as np
import pytest
from one_particle import CAPACITY, GRID, OCV, a_particle
from sheets_facts import cell_facts

from cellwright.circuits.particle import run
from cellwright.identification.particle import fitted, task_of
from cellwright.identification.planning import (
    READY_HOUR,
    Use,
    candidates_of,
    knowledge_from_model,
    knowledge_from_rating,
    knowledge_from_tests,
    plan,
)
from cellwright.numerics.statistics import rms
from cellwright.records.record import record_of
from cellwright.refusal import Refusal

CURVES = [{"soc": GRID, "ocv_volt": OCV, "ambient_temperature_celsius": 25.0}]
CUTOFFS = (3.0, 4.4)
USE = Use((0.0, 25.0), (0.5, 1.5), (0.1, 1.0))
# The same use by hand: each rate for a minute, half of it back for a sixth of that.
MINUTE, PAUSE, BACK = 60, 20, 10


def task_with(records):
    """Task of records of one temperature each, coldest first."""
    conditions = [
        (one.celsius.mean(), [one], [one], [np.zeros(one.used.sum(), int)]) for one in records
    ]
    return task_of(conditions, CURVES, capacity_ampere_hour=CAPACITY)


def candidate(words, celsius):
    """The test of that name at a temperature."""
    known = knowledge_from_rating(CAPACITY, CUTOFFS)
    every = candidates_of(known, [celsius], USE)
    return next(one for one in every if one.words == words)


def measured(cell, test):
    """Record of a candidate test of a cell, a discharge down to the lower cut-off."""
    time, current = test.test_time_second, test.current_ampere
    passed = np.append(0.0, np.cumsum((current[1:] + current[:-1]) / 2 * np.diff(time)))
    soc = 1.0 + passed / 3600.0 / CAPACITY
    volt = run(cell, time, current, soc, test.celsius, capacity_ampere_hour=CAPACITY).voltage_volt
    below = np.append(volt, 0.0) < CUTOFFS[0]
    end = np.flatnonzero(below)[0] if test.kind == "capacity" else len(volt)
    columns = (column[:end] for column in (time, current, volt, soc))
    return record_of(*columns, kind=test.kind, celsius=test.celsius)


def pulses(cell, celsius):
    return measured(cell, candidate("pulses of 0.5C, 1.5C", celsius))


def known_after_pulses(*celsius):
    truth = a_particle(celsius)
    task = task_with([pulses(truth, at) for at in celsius])
    return knowledge_from_tests(task, truth, CUTOFFS)


@pytest.fixture(scope="module")
def warm():
    return known_after_pulses(25.0)


def in_use(cell, celsius):
    """Voltage of a cell over the wanted use, a row a second."""
    cycle = np.concatenate(
        [
            np.repeat([-rate, 0.0, rate / 2, 0.0], [MINUTE, PAUSE, BACK, PAUSE])
            for rate in USE.c_rates
        ]
    )
    passed = -cycle.sum() / 3600.0
    low, high = USE.soc
    current = CAPACITY * np.append(0.0, np.tile(cycle, int(np.ceil((high - low) / passed))))
    time = np.arange(len(current), dtype=float)
    soc = high + np.cumsum(current) / 3600.0 / CAPACITY
    return run(cell, time, current, soc, celsius, capacity_ampere_hour=CAPACITY).voltage_volt


def missed(cell, model):
    """RMS error of a model of a cell over the wanted use [V]."""
    return rms(np.concatenate([in_use(cell, at) - in_use(model, at) for at in USE.celsius]))


def test_the_expected_error_is_what_fits_to_simulated_tests_show(warm):
    """Cells as pulses at 25 °C leave them open; each fitted to its own discharge at 0 °C."""
    one = candidate("discharge at 1C", 0.0)
    (step,), _ = plan(warm, [one], USE, hours=one.hours)
    two = a_particle((0.0, 25.0))
    cold, at_25 = measured(two, one), pulses(two, 25.0)
    task = task_with([cold, at_25])
    open_still = knowledge_from_tests(task._replace(rows=task.rows[1:]), two, CUTOFFS).precision
    root = np.linalg.cholesky(open_still)
    before, after = [], []
    for seed in range(8):
        random = np.random.default_rng(seed)
        off = np.linalg.solve(root.T, random.normal(size=len(root)))
        cell = two._replace(vector=two.vector + off)
        rows = task_with([measured(cell, one), at_25]).rows[0]
        noise = random.normal(size=len(rows.std_volt)) * rows.std_volt / np.sqrt(rows.weight)
        noisy = rows.record.voltage_volt.copy()
        noisy[rows.record.used] += noise
        rows = rows._replace(record=rows.record._replace(voltage_volt=noisy))
        found = fitted(task._replace(rows=[rows], mean=two.vector, precision=open_still)).particle
        before.append(missed(cell, two))
        after.append(missed(cell, found))
    # Cells differ: where the cold is slow a discharge ends early. The plan states geometric means.
    assert 0.5 < np.exp(np.mean(np.log(before))) / step.before_volt < 2.0
    assert 0.5 < np.exp(np.mean(np.log(after))) / step.after_volt < 2.0
    assert step.after_volt < 0.7 * step.before_volt


@pytest.mark.parametrize("celsius", [(25.0,), (10.0, 25.0)])
def test_first_comes_one_discharge_in_the_cold_to_the_cutoff(celsius):
    """What a modeller asks for whose pulses are all warm."""
    known, use = known_after_pulses(*celsius), Use((-10.0, 10.0, 25.0), (0.5, 1.5), (0.05, 1.0))
    steps, ranked = plan(known, candidates_of(known, use.celsius, use), use, hours=12)
    assert steps[0].kind == "capacity"
    assert steps[0].ambient_temperature_celsius == -10.0
    assert steps[0].test in {"discharge at C/5", "discharge at C/2", "discharge at 1C"}
    assert ranked[0] == steps[0]
    # The other end of the list: what a slow test adds an hour that a faster one does not.
    assert ranked[-1].test == "discharge at C/20"


def test_where_the_cold_is_known_and_not_wanted_it_is_not_measured_again():
    known, use = known_after_pulses(-10.0), Use((25.0,), (0.5, 1.5), (0.05, 1.0))
    candidates = candidates_of(known, (-10.0, 25.0), use)
    (first, *_), _ = plan(known, candidates, use, hours=12)
    assert first.ambient_temperature_celsius == 25.0


def test_each_test_lowers_the_error_once_and_within_the_hours(warm):
    use = USE._replace(celsius=(0.0,))
    candidates = candidates_of(warm, use.celsius, use)
    steps, _ = plan(warm, candidates, use, hours=20)
    assert sum(step.hours for step in steps) <= 20
    assert len({step.test for step in steps}) == len(steps) > 1
    for step, following in pairwise(steps):
        assert step.after_volt == pytest.approx(following.before_volt)
    for step in steps:
        assert step.after_volt < step.before_volt
        assert step.after_low_volt <= step.after_volt <= step.after_high_volt


def test_drives_are_chosen_from_only_where_they_may_be_fitted(warm):
    kinds = [
        {one.kind for one in candidates_of(warm, [0.0], USE, drives=drives)}
        for drives in (False, True)
    ]
    assert kinds == [{"capacity", "hppc"}, {"capacity", "hppc", "drive"}]


def test_by_rating_and_cutoffs_alone_a_night_makes_a_twin():
    """The prior scales with the capacity: so does nothing of the plan."""
    use, plans = Use((-10.0, 25.0), (0.2, 1.0), (0.05, 1.0)), []
    for capacity in (2.0, 60.0):
        known = knowledge_from_rating(capacity, (2.5, 4.2))
        candidates = candidates_of(known, use.celsius, use)
        plans.append(plan(known, candidates, use, hours=12)[0])
    assert [step.test for step in plans[0]] == [step.test for step in plans[1]]
    assert plans[0][0].ambient_temperature_celsius == -10.0
    assert plans[0][0].before_volt == pytest.approx(plans[1][0].before_volt, rel=1e-3)
    assert plans[0][-1].after_volt < 0.3 * plans[0][0].before_volt


@pytest.mark.parametrize(
    ("use", "hours", "said"),
    [
        (USE, 4.5, "4.5 h: no test fits; the shortest, discharge at 1C at 0 °C, takes 5.0 h"),
        (USE._replace(soc=(0.9, 0.2)), 12, "SoC from 0.9 to 0.2; wanted two rising numbers"),
        (USE._replace(soc=(5.0, 95.0)), 12, "SoC from 5 to 95; wanted two rising numbers"),
        (USE._replace(c_rates=(-1.0,)), 12, "wanted at least one of each, rates above 0"),
        (USE._replace(c_rates=(40.0,)), 12, "at 0 °C a load of 40C from SoC 1 on ends at the cut"),
    ],
)
def test_refused_is_a_use_or_a_time_that_allows_no_plan(warm, use, hours, said):
    candidates = candidates_of(warm, [0.0], USE)
    with pytest.raises(Refusal, match=re.escape(said)):
        plan(warm, candidates, use, hours=hours)


def test_refused_are_ratings_and_models_that_tell_no_particle():
    with pytest.raises(Refusal, match=re.escape("rated capacity 0 Ah; wanted more")):
        knowledge_from_rating(0.0, (2.5, 4.2))
    with pytest.raises(Refusal, match=re.escape("cut-offs 4.2 and 2.5 V; wanted the lower")):
        knowledge_from_rating(2.9, (4.2, 2.5))
    model = {"cell": "A", "particle": None}
    with pytest.raises(Refusal, match="the model of A has no particle; wanted one"):
        knowledge_from_model(model, None, cell_facts(), [], split_rest_second=120)
    model["particle"] = {"celsius": [25.0]}
    unstated = cell_facts(None, None)
    with pytest.raises(Refusal, match=re.escape("states the cut-offs (None, None); wanted both")):
        knowledge_from_model(model, None, unstated, [], split_rest_second=120)
    known = knowledge_from_rating(2.9, (2.5, 4.2))
    with pytest.raises(Refusal, match="no test to choose from"):
        plan(known, [], USE, hours=12)
    assert READY_HOUR < 12
