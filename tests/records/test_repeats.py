"""The same measurement in two tests counts once; what is only alike counts in each."""

import numpy as np
import pytest
from sheets_facts import cell_facts, facts_of

import cellwright as cw
from cellwright.records.facts import MeasuredTest
from cellwright.records.record import laid_out, records_by_temperature
from cellwright.records.repeats import counted_once, repeats


def pulses(levels, *, seed=1, grain=1e-5, noise=2e-4):
    """Time, current and voltage of 10 s pulses between rests, read with a noise and a grain."""
    time = np.arange(0, 40.0 * len(levels), 0.1)
    current = np.zeros(len(time))
    for k, level in enumerate(levels):
        current[(time > 40 * k + 10) & (time <= 40 * k + 20)] = level
    slow = np.convolve(current, np.exp(-np.arange(300) / 80) / 80)[: len(time)]
    rng = np.random.default_rng(seed)
    volt = 3.8 + 0.02 * current + 0.015 * slow + rng.normal(0, noise, len(time))
    return (
        time,
        current + np.where(current, rng.normal(0, 1e-3, len(time)), 0),
        grain * np.rint(volt / grain),
    )


def test_of(name, columns, **facts):
    time, current, voltage = (np.array(column) for column in columns)
    charge = np.append(0, np.cumsum((current[1:] + current[:-1]) / 2 * np.diff(time)) / 3600)
    series = {"test_time_second": time, "current_ampere": current, "voltage_volt": voltage}
    about = facts_of()._replace(test=name, kind="hppc", soc=0.8, **facts)
    return MeasuredTest(about, series | {"charge_ampere_hour": charge})


test_of.__test__ = False
LONG = pulses([-3.0, 1.0, -6.0])


def cut(columns, first, last, *, later=0.0):
    return [column[first:last] + (later if k == 0 else 0.0) for k, column in enumerate(columns)]


@pytest.mark.parametrize("later", [0.0, 1234.567, -7.03])
def test_a_pulse_in_a_file_of_its_own_counts_there(later):
    short = test_of("alone", cut(LONG, 0, 400, later=later))
    found = repeats([test_of("train", LONG), short])
    assert (found.rows.test.tolist(), found.rows.of.tolist()) == (["train"], ["alone"])
    assert (found.rows.first_row[0], found.rows.last_row[0]) == (0, 399)
    (words,) = found.notes
    assert words.startswith("train from 0 to 39.9 s is the same measurement as alone from ")
    swapped = repeats([short, test_of("train", LONG)])
    assert swapped.rows.test.tolist() == ["train"]


def test_a_repeated_time_and_the_charge_of_the_file_change_nothing():
    double = [np.insert(column, 250, column[250]) for column in cut(LONG, 0, 400)]
    found = repeats([test_of("train", LONG), test_of("alone", double)])
    assert set(found.rows.test) == {"train"}
    assert np.sum(found.rows.last_row - found.rows.first_row + 1) >= 395


def test_what_may_be_fitted_keeps_what_a_validation_test_repeats():
    judge = test_of("judge", cut(LONG, 0, 400), role="validation")
    tests = [test_of("train", LONG), judge]
    assert (
        repeats(tests).rows.test.tolist()
        == repeats(tests, ["validation"]).rows.test.tolist()
        == ["judge"]
    )
    assert len(repeats(tests, ["fit"]).rows.test) == 0


def test_a_clock_that_jitters_tells_a_pulse_that_a_coarse_reading_foretells():
    """As the Samsung 30T's, in steps of 0.17 mV: on a clock without jitter it may be chance."""
    _, current, voltage = pulses([-3.0, -3.0], noise=0.0, grain=1.7e-4)
    current = np.round(current)
    clocks = [np.cumsum(np.random.default_rng(k).uniform(0.09, 0.11, 800)) for k in range(2)]
    long = clocks[0], current, voltage
    alone = [column[:400] for column in long]
    assert repeats([test_of("long", long), test_of("alone", alone)]).rows.test.tolist() == ["long"]
    done_again = clocks[1][:400], *alone[1:]
    assert len(repeats([test_of("long", long), test_of("again", done_again)]).rows.test) == 0
    regular = 0.1 * np.arange(800), current, voltage
    even = [column[:400] for column in regular]
    assert len(repeats([test_of("long", regular), test_of("even", even)]).rows.test) == 0


def test_pulses_that_are_only_alike_and_rests_are_no_repeats():
    """The same protocol done again, read to a millivolt, and two hours of rest at one voltage."""
    again = [test_of(f"t{seed}", pulses([-3.0, 1.0], seed=seed, grain=1e-3)) for seed in range(6)]
    time = np.arange(7200.0)
    rest = [test_of(name, (time, 0 * time, 0 * time + 3.7)) for name in ("a", "b")]
    ramp = [test_of(n, (time, 0 * time - 1, 4.2 - 1e-4 * time)) for n in ("c", "d")]
    # A logger that writes ever more rarely keeps a program's times, not its own.
    seldom = np.cumsum(np.geomspace(0.1, 60, 60) // 0.1 * 0.1)
    slow = [test_of(n, (seldom, 0 * seldom, np.round(3.7 - 0.01 / (1 + seldom), 3))) for n in "ef"]
    short = test_of("short", cut(LONG, 0, 5))
    assert len(repeats([*again, *rest, *ramp, *slow, short]).rows.test) == 0
    assert len(repeats([]).rows.test) == len(repeats(again[:1]).rows.test) == 0


def test_another_pace_is_another_measurement():
    slower = [2 * LONG[0], *LONG[1:]]
    assert len(repeats([test_of("one", LONG), test_of("two", slower)]).rows.test) == 0


BASIS = {"capacity_ampere_hour": 3.0, "borrowed_from": None, "ocv": [], "capacity_source": ""}


def test_repeated_rows_drive_a_record_and_are_not_compared():
    train, alone = test_of("train", LONG), test_of("alone", cut(LONG, 0, 400))
    (marked, kept), words = counted_once([train, alone])
    assert len(words) == 1
    record = laid_out(marked, BASIS, cell_facts(), split_rest_second=120.0)
    assert len(record.test_time_second) == len(LONG[0])
    assert np.array_equal(record.used, np.arange(len(LONG[0])) >= 400)
    assert laid_out(kept, BASIS, cell_facts(), split_rest_second=120.0).used.all()
    (at,), notes = records_by_temperature(
        [train, alone], BASIS, cell_facts(), split_rest_second=120.0
    )
    assert sum(record.used.sum() for record in at.records) < len(LONG[0]) + 10
    assert words[0] in notes
    alone.series["voltage_volt"][300] = np.nan
    (at,), notes = records_by_temperature(
        [train, alone], BASIS, cell_facts(), split_rest_second=120.0
    )
    assert [record.used.all() for record in at.records] == [True]
    assert [note.partition(":")[0] for note in notes] == ["not fitted"]


def test_resistance_of_a_repeated_pulse_is_in_one_table_only():
    tests = [test_of("train", LONG), test_of("alone", cut(LONG, 0, 400))]
    found, cell = cw.repeats(tests), cell_facts()
    train, alone = (
        cw.resistance(series, cw.segment(series, cell), BASIS, about, cell, repeats=found)
        for about, series in tests
    )
    assert len(set(train.rows["start_time_second"])) == 2
    assert len(set(alone.rows["start_time_second"])) == 1
    assert "1 × pulse of the same measurement as in alone" in train.notes


def test_rows_that_a_split_test_fits_are_not_compared_in_a_validation_test():
    """The shorter of the two would else keep them, and be scored on what was fitted."""
    judge = test_of("judge", cut(LONG, 0, 400), role="validation")
    found = repeats([test_of("split", LONG, role="split"), judge])
    assert (found.rows.test.tolist(), found.rows.of.tolist()) == (["judge"], ["split"])


def test_discharges_that_are_only_read_coarsely_are_no_repeats():
    """Four cells' worth of one flat discharge, each read to a millivolt with a noise below it."""
    soc = np.linspace(1, 0, 7000)
    flat = 3.30 + 0.15 * np.exp(-(1 - soc) * 60) - 0.6 * np.exp(-soc * 25) + 0.03 * soc
    made = []
    for seed in range(4):
        read = flat + np.random.default_rng(seed).normal(0, 1.5e-4, 7000)
        made += [test_of(f"t{seed}", (np.arange(7000.0), 0 * soc - 2.5, np.round(read, 3)))]
    assert len(repeats(made).rows.test) == 0
