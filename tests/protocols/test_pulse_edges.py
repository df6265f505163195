"""Where the edge of a pulse was: made cells with closed-form truth, and measured ones."""

import numpy as np
import pandas as pd
import pytest
from counted import counted, measured, series_of

from cellwright.protocols.pulse_edges import (
    AT_A_ROW,
    BETWEEN,
    NOT_SETTLED,
    UNKNOWN,
    clock_tells,
    rises_with_rate,
)
from cellwright.protocols.resistance import pulse_resistance
from cellwright.series.steps import segment

RATED = 5.0
FAST = ((0.006, 0.15), (0.008, 60.0))  # resistance [ohm] and time constant [s] of each pair


def truth(delay, pairs=FAST, ohmic=0.010):
    """Resistance of the made cell at a delay after the edge, in closed form [ohm]."""
    return ohmic + sum(ohm * -np.expm1(-delay / tau) for ohm, tau in pairs)


def record(levels, *, pairs=FAST, apart=0.1, phase=None, noise=1e-4, seed=1, seconds=10.0):
    """Pulses of a linear cell from rest, rows `apart` [s]; each edge a phase before its first row.

    phase : None: a row lies at each edge; else function of a generator, share of `apart`. pairs :
    of the cell, or function of the current.
    """
    random = np.random.default_rng(seed)
    begin = 60.0 + np.arange(len(levels)) * (seconds + 600.0)
    time = np.arange(0.0, begin[-1] + seconds + 60.0, apart)
    current, voltage = np.zeros((2, len(time)))
    for level, start in zip(levels, begin, strict=True):
        of_level = pairs(level) if callable(pairs) else pairs
        for edge, jump in ((start, level), (start + seconds, -level)):
            since = time - edge + apart * (1.0 if phase is None else phase(random))
            on = since > 1e-9
            current += jump * on
            voltage += jump * np.where(on, truth(np.maximum(since, 0.0), of_level), 0.0)
    return time, np.round(current, 9), 3.7 + voltage + random.normal(0.0, noise, len(time))


def measure(time, current, voltage, *, soc=0.8, delays=(0, 1.0), rated=RATED):
    steps = segment(time, current, voltage, counted(time, current), rated_capacity_ampere_hour=5.0)
    soc = np.broadcast_to(soc, len(time))
    about = {"rated_capacity_ampere_hour": rated, "delay_second": delays}
    return pulse_resistance(series_of(time, current, voltage), soc, steps, **about)


def anywhere(random):
    return random.uniform(0.05, 0.95)


def held(rows, wanted=0, pairs=FAST):
    """Share of the 95 % intervals at a delay that hold the truth at the stated delay."""
    chosen = rows["delay_second"] == wanted
    error = rows["resistance_ohm"] - truth(rows["actual_delay_second"], pairs)
    return np.mean(np.abs(error[chosen]) <= 1.96 * rows["resistance_std_ohm"][chosen])


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("apart", "tau"), [(0.1, 0.05), (0.1, 0.15), (0.5, 0.4), (1.0, 1.5)])
def test_edges_anywhere_between_rows_stay_within_the_stated_interval(apart, tau, seed):
    pairs = ((0.006, tau), (0.008, 60.0))
    made = record([-5.0, 5.0] * 10, pairs=pairs, apart=apart, phase=anywhere, seed=seed, seconds=20)
    rows = measure(*made, delays=(0, 4 * apart)).rows
    assert set(rows["edge"]) == {BETWEEN}
    assert np.allclose(rows["actual_delay_second"], np.tile([apart, 4 * apart], 20))
    assert held(rows, 0, pairs) >= 0.9
    assert held(rows, 4 * apart, pairs) >= 0.9
    # The mean of twenty is no more biased than what the rows cannot tell.
    first = rows["delay_second"] == 0
    assert np.isclose(rows["resistance_ohm"][first].mean(), truth(apart, pairs), rtol=0.05)
    assert not any(rows["doubt"])


def test_a_row_at_each_edge_changes_nothing():
    rows = [measure(*record([-5.0, 5.0] * 10, seed=seed)).rows for seed in range(20)]
    found = {name: np.concatenate([one[name] for one in rows]) for name in rows[0]}
    assert set(found["edge"]) == {AT_A_ROW}
    assert not any(found["doubt"])
    assert np.allclose(found["actual_delay_second"], np.tile([0.1, 1.0], 400))
    assert 0.9 <= held(found) <= 0.98
    assert np.mean(found["resistance_std_ohm"]) < 5e-5


def test_one_pulse_on_a_clock_that_runs_on_tells_no_edge_and_says_so():
    lone = measure(*record([-5.0], phase=anywhere)).rows
    assert set(lone["edge"]) == {UNKNOWN}
    assert held(lone) == 1.0
    # A row at the end of the rest, or another pace, tells it.
    time, current, voltage = record([-5.0])
    kept = (time >= 59.95) | (np.arange(len(time)) % 100 == 0)
    told = measure(time[kept], current[kept], voltage[kept]).rows
    assert set(told["edge"]) == {AT_A_ROW}
    assert np.allclose(told["resistance_ohm"], lone["resistance_ohm"], rtol=0.3)
    assert told["resistance_std_ohm"][0] < 0.2 * lone["resistance_std_ohm"][0]
    # Where a process is slow beside the rows its edge does not matter.
    slow = measure(*record([-5.0], pairs=((0.01, 30.0),))).rows
    assert slow["resistance_std_ohm"][0] < 1e-4


def test_clock_tells_a_row_at_the_edge_by_its_course():
    assert not clock_tells(np.array([0.0, 1.0, 2.0, 3.0, 4.0]), 3)
    assert not clock_tells(np.array([0.0, 0.101, 0.2, 0.297, 0.4]), 3)
    assert clock_tells(np.array([0.0, 1.0, 1.2, 2.2, 3.2]), 3)  # written when the rest ended
    assert clock_tells(np.array([0.0, 10.0, 20.0, 20.1, 20.2]), 3)  # another pace
    assert clock_tells(np.array([0.0, 0.1]), 1)  # the record begins there


def falling(level):
    """Pairs of a cell whose charge transfer costs less at large currents."""
    return (0.006 / (1.0 + abs(level) / 10.0), 0.05), (0.008, 60.0)


def lagging(time, voltage, current, second):
    """The voltage as a slow channel reads it, in steps of no more than 6 A only."""
    read, state = voltage.copy(), voltage[0]
    large = np.abs(current) > 6.0
    for row in range(1, len(time)):
        state += (voltage[row] - state) * -np.expm1(-(time[row] - time[row - 1]) / second)
        state = voltage[row] if large[row] else state
        read[row] = state
    return read


@pytest.mark.parametrize("seed", range(3))
def test_first_rows_that_a_faster_pulse_shows_not_to_have_settled_are_left_out(seed):
    levels = np.tile([-2.5, -5.0, -10.0], 6)
    time, current, voltage = record(levels, pairs=falling, seed=seed)
    clean = measure(time, current, voltage, delays=(0, 0.1, 1.0)).rows
    assert set(clean["edge"]) == {AT_A_ROW}
    assert not any(clean["doubt"])
    found = measure(time, current, lagging(time, voltage, current, 0.2), delays=(0, 0.1, 1.0))
    rows = found.rows
    small = np.abs(rows["current_ampere"]) < 6.0
    assert set(rows["edge"][small]) == {NOT_SETTLED}
    assert set(rows["edge"][~small]) == {BETWEEN}
    assert np.allclose(rows["actual_delay_second"][small & (rows["delay_second"] == 0)], 0.2)
    # 0.1 s would need the row that is left out.
    assert not np.any(small & (rows["delay_second"] == 0.1))
    said = " ".join(found.notes)
    assert "12 × first row of a pulse had not settled" in said
    assert "12 × first settled sample of the pulse later than 0.1 s" in said


def test_a_resistance_that_rises_with_the_rate_is_told_at_both_pulses():
    def rising(level):
        return (0.006 * (1.0 + abs(level) / 4.0), 2.0), (0.008, 60.0)

    rows = measure(*record(np.tile([-2.5, -10.0], 3), pairs=rising), delays=(1.0, 5.0)).rows
    doubted = np.char.find(rows["doubt"], "rises with the rate, from ") >= 0
    assert np.array_equal(doubted, rows["delay_second"] == 1.0)
    assert "at 0.5C to" in rows["doubt"][0]
    # Diffusion, and what a pulse moves, may rise.
    assert not any(rows["doubt"][rows["delay_second"] == 5.0])


def test_a_rise_that_the_course_over_soc_explains_is_none():
    soc, rate = np.array([0.12, 0.10, 0.08, 0.11, 0.09, 0.07]), np.repeat([0.5, 2.0], 3)
    ohm = 0.02 / soc
    kind, std, delay = np.full(6, "discharge"), np.full(6, 1e-4), np.full(6, 0.1)
    assert not rises_with_rate(soc, kind, rate, ohm, std, delay)
    ohm[rate > 1] *= 1.3
    pairs = rises_with_rate(soc, kind, rate, ohm, std, delay)
    assert {fast for _, fast in pairs} == {3, 4, 5}
    assert {slow for slow, _ in pairs} == {0, 1, 2}
    # Another direction, a later delay or a wide interval tell nothing.
    kind[rate > 1] = "charge"
    assert not rises_with_rate(soc, kind, rate, ohm, std, delay)


def test_published_edge_in_between(shared):
    """Twenty equal pulses: 12.93 mohm at 0.1 s, whenever their edges were."""
    path = shared / "cases/models/edge_in_between/raw/pulses.csv.gz"
    rows = measure(*measured(path)[:3], delays=(0, 0.1)).rows
    assert set(rows["edge"]) == {BETWEEN}
    discharge = rows["direction"] == "discharge"
    assert discharge.sum() == 40
    error = np.abs(rows["resistance_ohm"] - truth(0.1))[discharge]
    assert np.mean(error <= 1.96 * rows["resistance_std_ohm"][discharge]) >= 0.9
    assert np.all(rows["resistance_std_ohm"] < 0.001)


# Right: R(0.1 s) of its spectra at 50 % SoC [mohm], at small currents; kinetics take more off 6C in
# the cold.
@pytest.mark.parametrize(
    ("place", "spectrum", "within"), [("25C", 27.9, 0.05), ("10C", 41.6, 0.14)]
)
def test_published_panasonic_first_samples_agree_over_the_rates(shared, place, spectrum, within):
    path = shared / f"campaigns/panasonic/raw/hppc/hppc_{place}.parquet"
    soc = 1 + pd.read_parquet(path)["Net Capacity / Ah"].to_numpy() / 2.9  # it has holes
    rows = measure(*measured(path)[:3], soc=soc, rated=2.9, delays=(0,)).rows
    half = np.abs(rows["soc"] - 0.485) < 0.03
    assert half.sum() == 5
    assert set(rows["edge"][half & (rows["c_rate"] < 3)]) == {NOT_SETTLED}
    milliohm, std = (1e3 * rows[name][half] for name in ("resistance_ohm", "resistance_std_ohm"))
    assert np.all(np.abs(milliohm / spectrum - 1) <= within)
    assert np.all(1.96 * std > 0.02 * milliohm)
    assert not any(rows["doubt"][half])
