"""A particle is fitted to all temperatures at once, and predicts loads that it has not seen."""

import numpy as np
import pytest
from one_particle import CAPACITY, GRID, OCV, a_particle

from cellwright.circuits.particle import layout, run, to_document
from cellwright.identification.in_use import with_parts
from cellwright.identification.particle import WITHOUT, fitted, left_out, task_of
from cellwright.numerics.statistics import rms
from cellwright.records.blocks import blocks_of_used, parts
from cellwright.records.record import record_of

NOISE_VOLT = 5e-4


def pulses(cell, celsius, seed, ways=(-3.0,)):
    """Pulses of three rates at ten levels of the SoC, with noise: what a laboratory records.

    ways : current from one level to the next [A], for each time that the levels are gone through.
    """
    time, current = [0.0], [0.0]
    for way in np.repeat(ways, 9):
        for ampere, second in ((-1.5, 10), (-6.0, 10), (3.0, 10), (way, 360)):
            for amount, until in ((ampere, second), (0.0, 60 if second == 10 else 1500)):
                ages = np.unique(np.append(np.geomspace(0.1, until, 25), until))
                time.extend(time[-1] + np.append(0.001, ages))
                current.extend([amount] * (len(ages) + 1))
    return measured(cell, np.array(time), np.array(current), celsius, seed)


def drive(cell, celsius, seed):
    random = np.random.default_rng(seed)
    time = np.arange(0.0, 3600.0, 1.0)
    current = np.repeat(np.clip(random.normal(-1.5, 2.5, 720), -8.0, 4.0), 5)
    return measured(cell, time, current, celsius, seed, "drive")


def measured(cell, time, current, celsius, seed, kind="hppc"):
    passed = np.append(0.0, np.cumsum((current[1:] + current[:-1]) / 2 * np.diff(time)))
    soc = 1.0 + passed / 3600.0 / CAPACITY
    volt = run(cell, time, current, soc, celsius, capacity_ampere_hour=CAPACITY).voltage_volt
    volt = volt + np.random.default_rng(seed).normal(0.0, NOISE_VOLT, len(time))
    return record_of(time, current, volt, soc, kind=kind, celsius=celsius)


def a_fit(temperatures, ways=(-3.0,), **numbers):
    truth = a_particle(temperatures, **({"transfer_bend_joule_per_mole": 0.0} | numbers))
    conditions = []
    for number, celsius in enumerate(temperatures):
        record = pulses(truth, celsius, number, ways)
        settings = {"rest_second": 600.0, "rest_ampere": 0.02}
        blocks = blocks_of_used([record], cut=parts, **settings)
        conditions.append((celsius, [record], [record], blocks))
    curves = [{"soc": GRID, "ocv_volt": OCV, "ambient_temperature_celsius": 25.0}]
    task = task_of(conditions, curves, capacity_ampere_hour=CAPACITY)
    return truth, task, fitted(task), conditions


@pytest.fixture(scope="module")
def of_two_temperatures():
    return a_fit((0.0, 25.0))


def test_unseen_drives_are_predicted_between_and_at_the_temperatures(of_two_temperatures):
    truth, _, fit, _ = of_two_temperatures
    for celsius in (0.0, 12.0, 25.0):
        record = drive(truth, celsius, 7)
        columns = record.test_time_second, record.current_ampere, record.soc, record.celsius
        found = run(fit.particle, *columns, capacity_ampere_hour=CAPACITY).voltage_volt
        # A load of 8 A moves this voltage by half a volt.
        assert rms(record.voltage_volt - found) < 3e-3


def test_what_pulses_tell_is_found_within_its_deviation(of_two_temperatures):
    truth, _, fit, _ = of_two_temperatures
    for name in ("transfer_joule_per_mole", "double_layer_farad", "r0_joule_per_mole"):
        place = layout(2)[name]
        off = fit.particle.vector[place] - truth.vector[place]
        assert np.abs(off / fit.std[place]).max() < 3.0, name


def test_a_hysteresis_that_both_ways_show_is_found():
    _, _, fit, _ = a_fit((25.0,), ways=(-3.0, 3.2), hysteresis_volt=0.015)
    place = layout(1)["hysteresis_volt"]
    found, std = fit.particle.vector[place], fit.std[place]
    inner = slice(1, -1)  # no level lies at the ends
    assert found[inner] == pytest.approx(0.015, abs=0.004)
    assert (np.abs(found - 0.015) < 3.0 * std)[inner].all()


def test_a_hysteresis_that_discharges_alone_cannot_show_is_not_claimed():
    """There it is an offset of the OCV: its deviation stays near the 10 mV of its prior."""
    _, _, fit, _ = a_fit((25.0,), hysteresis_volt=0.015)
    place = layout(1)["hysteresis_volt"]
    assert (fit.std[place] > 0.003).all()


def test_each_block_is_predicted_without_its_fold(of_two_temperatures):
    _, task, fit, conditions = of_two_temperatures
    scores = left_out(task, fit, conditions)
    for score, (*_, blocks) in zip(scores, conditions, strict=True):
        assert score.rows.sum() == sum(map(len, blocks))
        # Never better than the noise, and no further off than a fit of nine tenths of the record.
        typical = np.sqrt(np.median(score.square_volt2))
        assert 0.9 * NOISE_VOLT < typical < 4e-3


def test_one_temperature_leaves_the_energies_to_their_priors():
    _, task, fit, _ = a_fit((25.0,))
    place = layout(1)["transfer_joule_per_mole"]
    assert len(fit.basins) == 1
    assert fit.std[place] > 0.9 * task.std[place]


# Either of two cells has the parts that the other lacks.
DYNAMIC = {"diffusion", "kinetics", "temperature"}
COURSED = {
    **{name: value for part in DYNAMIC for name, value in WITHOUT[part].items()},
    "r0_ohm": np.log([0.03, 0.02, 0.014, 0.02]),
    "transfer_ohm": np.log(0.02) + np.linspace(0.8, -0.4, 10),
    "fast_ohm": np.log(0.01) + np.linspace(0.9, -0.6, 6),
    "slow_ohm": np.log(0.008) + np.linspace(0.9, -0.6, 6),
    "ocv_shift_volt": 0.02 * np.sin(np.arange(16.0)),
    "ocv_volt_per_kelvin": 4e-4 * np.cos(np.arange(8.0)),
    "hysteresis_volt": 0.02,
    "missing": np.array([0.06, 0.01]),
    "stretch": np.array([-0.08, 0.03]),
}


@pytest.mark.parametrize(
    ("numbers", "has"),
    [({}, DYNAMIC), (COURSED, set(WITHOUT) - DYNAMIC)],
    ids=["dynamic", "coursed"],
)
def test_a_part_is_worth_something_where_the_cell_has_it_and_nothing_where_not(numbers, has):
    _, task, fit, conditions = a_fit((0.0, 25.0), (-3.0, 3.0), **numbers)
    scores = left_out(task, fit, conditions)
    about = {"left_out": [[score.square_volt2, score.rows] for score in scores]}
    model = {"particle": to_document(fit.particle) | about}
    model, rows = with_parts(model, [], task, conditions)
    parts = model["particle"]["parts"]
    assert {one["part"] for one in parts} == set(WITHOUT)
    assert {one["part"] for one in parts if one["worth"]} == has, parts
    assert [row["model"] for row in rows[:2]] == ["P without diffusion"] * 2
