"""A simulated voltage and its test: joined by the test's clock, or refused with row and value."""

import numpy as np
import pytest
from sheets_facts import measured_test

import cellwright as cw
from cellwright.effects.given.external import COLUMN, Simulated, at_rows, with_simulated
from cellwright.refusal import Refusal

TIME = np.arange(0.0, 600.0, 1.0)
CURRENT = np.where((TIME > 100) & (TIME < 400), -2.0, 0.0)
VOLT = 3.8 + 0.03 * CURRENT
SERIES = {"test_time_second": TIME, "current_ampere": CURRENT, "voltage_volt": VOLT}


def joined(second=TIME, volt=VOLT, series=SERIES):
    return at_rows(Simulated(second, volt, "raw/mine.csv"), series)


def test_the_same_clock_gives_the_same_values():
    assert np.array_equal(joined(), VOLT)


def test_another_sampling_is_read_off_straight_between_its_values():
    second = np.arange(-3.0, 610.0, 0.25)
    assert joined(second, 3.7 + 1e-4 * second) == pytest.approx(3.7 + 1e-4 * TIME, abs=1e-12)


def test_a_long_step_at_rest_is_no_gap():
    kept = (TIME < 420) | (TIME > 590)
    assert joined(TIME[kept], VOLT[kept]) == pytest.approx(VOLT)


def changed(row, value):
    volt = VOLT.copy()
    volt[row] = value
    return volt


@pytest.mark.parametrize(
    ("second", "volt", "words"),
    [
        (TIME[:-50], VOLT[:-50], "simulated from 0 to 549 s, the test has rows from 0 to 599 s"),
        (TIME + 1000.0, VOLT, "simulated from 1000 to 1599 s, the test has rows from 0 to 599 s"),
        (TIME / 3600, VOLT, "simulated from 0 to 0.166389 s, the test has rows from 0 to 599 s"),
        (TIME, VOLT[:-1], "600 times and 599 voltages"),
        (TIME[:1], VOLT[:1], "1 times and 1 voltages"),
        (TIME, changed(7, np.nan), "row 8: the simulated voltage is nan"),
        (TIME, changed(7, np.inf), "row 8: the simulated voltage is inf"),
        (np.r_[TIME[:5], np.nan, TIME[6:]], VOLT, "row 6: the test time is nan"),
        (np.r_[TIME[:5], 1.0, TIME[6:]], VOLT, "row 6: the clock runs back from 4 to 1 s"),
        (TIME, 1e3 * VOLT, "at 0 s 3800 V are simulated and 3.8 V measured"),
        (TIME, VOLT - 3.8, "in the median 3.8 V apart; wanted the voltage of this test in volts"),
    ],
)
def test_what_is_no_simulation_of_the_test_is_refused(second, volt, words):
    with pytest.raises(Refusal, match=r"raw/mine\.csv") as refused:
        joined(second, volt)
    assert words in str(refused.value)


def test_a_gap_in_which_the_current_changes_is_refused():
    kept = (TIME < 380) | (TIME > 450)
    with pytest.raises(
        Refusal, match=r"row 381: no value between 379 and 451 s, where the current"
    ):
        joined(TIME[kept], VOLT[kept])


def measured(*names):
    return [measured_test(SERIES, name) for name in names]


def test_tests_without_a_simulation_take_no_part_and_bad_ones_are_noted():
    curves = {"a": Simulated(TIME, VOLT), "b": Simulated(TIME[:9], VOLT[:9], "raw/b.csv")}
    kept, notes = with_simulated(measured("a", "b", "c"), curves)
    assert [test.facts.test for test in kept] == ["a"]
    assert np.array_equal(kept[0].series[COLUMN], VOLT)
    assert COLUMN not in SERIES
    assert notes[0].startswith("not used: b: raw/b.csv: simulated from 0 to 8 s")


def test_no_simulation_that_can_be_joined_is_refused():
    with pytest.raises(
        Refusal, match="no simulated voltage can be joined to its test; not used: a"
    ):
        with_simulated(measured("a"), {"a": Simulated(TIME, VOLT[:-1])})
    with pytest.raises(Refusal, match="simulated: z, no test that is searched; those are a, b"):
        with_simulated(measured("a", "b"), {"z": Simulated(TIME, VOLT)})


def csv(header, *columns):
    lines = [",".join(f"{value:g}" for value in row) for row in zip(*columns, strict=True)]
    return "\n".join([header, *lines]).encode()


@pytest.mark.parametrize(
    ("header", "columns"),
    [
        ("Test Time / s,Simulated Voltage / V", (TIME, VOLT)),
        ("Test Time / min,Simulated Voltage / mV", (TIME / 60, 1e3 * VOLT)),
        ("test_time_second,simulated_voltage_volt", (TIME, VOLT)),
        ("Test Time / s,Voltage / V", (TIME, VOLT)),
        (
            "Test Time / s,Current / A,Voltage / V,Simulated Voltage / V",
            (TIME, CURRENT, VOLT - 1.0, VOLT),
        ),
    ],
)
def test_a_file_with_the_two_columns_is_read(header, columns):
    second, volt, name = cw.read_simulated(("mine.csv", csv(header, *columns)))
    assert name == "mine.csv"
    assert second == pytest.approx(TIME, abs=1e-3)
    assert volt == pytest.approx(VOLT, abs=1e-4)


@pytest.mark.parametrize(
    ("header", "columns", "words"),
    [
        (
            "Test Time / s,Current / A,Voltage / V",
            (TIME, CURRENT, VOLT),
            "no column 'Simulated Voltage / V'",
        ),
        ("Simulated Voltage / V", (VOLT,), "no column 'Test Time / s'"),
        ("Test Time / s,Simulated Voltage / A", (TIME, VOLT), "unknown unit 'A' of voltage"),
    ],
)
def test_a_file_without_them_is_refused_by_name(header, columns, words):
    with pytest.raises(Refusal, match=r"mine\.csv") as refused:
        cw.read_simulated(("mine.csv", csv(header, *columns)))
    assert words in str(refused.value)


def test_a_measured_voltage_is_never_taken_for_a_simulated_one():
    """A file with a current is a measured one: its own voltage would make a perfect simulator."""
    with pytest.raises(Refusal, match="Simulated Voltage"):
        cw.read_simulated(
            ("drive.csv", csv("Test Time / s,Current / A,Voltage / V", TIME, CURRENT, VOLT))
        )
