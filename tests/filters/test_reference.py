"""The reference of a filter against the rests of its test."""

import numpy as np
import pytest

from cellwright.filters.reference import reference_of
from cellwright.records.record import record_of

CURVE = {"soc": np.linspace(0, 1, 101), "ocv_volt": np.linspace(3.0, 4.2, 101)}


def drive(offset=0.0, rest_second=900, slow_volt=0.0):
    """An hour at 2 A of a cell of 5 Ah, then a rest, as an instrument with an offset reads it.

    slow_volt : polarisation that relaxes with 1 h, as that of a cell in the cold [V].
    """
    current = np.append(np.full(3600, -2.0), np.zeros(rest_second))
    soc = 1.0 + np.cumsum(current) / 3600 / 5
    counted = 1.0 + np.cumsum(current + offset) / 3600 / 5
    volts = np.interp(soc, CURVE["soc"], CURVE["ocv_volt"]) + 0.03 * current
    volts -= slow_volt * np.append(np.ones(3600), np.exp(-np.arange(rest_second) / 3600))
    return record_of(np.arange(len(current)) * 1.0, current + offset, volts, counted)


def told(record, curve):
    reference = reference_of(record, curve)
    return reference.off_soc, reference.words


def test_a_reference_that_agrees_is_in_no_doubt():
    reference = reference_of(drive(), CURVE)
    assert (reference.off_soc, reference.words) == (0.0, "")
    np.testing.assert_array_equal(reference.low, reference.soc)
    np.testing.assert_array_equal(reference.high, reference.soc)


def test_an_offset_of_the_current_puts_the_reference_in_doubt():
    off, words = told(drive(offset=0.5, rest_second=900), CURVE)
    # It rests at 0.5 A: that is no rest.
    assert np.isnan(off)
    assert not words
    off, words = told(drive(offset=0.09, rest_second=14_400), CURVE)
    assert off == pytest.approx(0.09 * 5.0 / 5 - 0.02 / 1.2, abs=0.003)
    assert "which tells 0.58 to 0.62" in words


def test_a_rest_between_the_branches_of_a_hysteresis_contradicts_nothing():
    """0.09 of SoC is 108 mV on this curve; a cell of 100 mV each way rests as far off its OCV."""
    record = drive(offset=0.09, rest_second=14_400)
    assert told(record, CURVE | {"half_gap_volt": np.full(101, 0.1)}) == (0.0, "")
    assert told(record, CURVE | {"half_gap_volt": np.full(101, 0.01)})[1]


def test_without_a_rest_nothing_is_known():
    off, words = told(drive(rest_second=300), CURVE)
    assert np.isnan(off)
    assert not words


@pytest.mark.parametrize(("rest_second", "doubted"), [(660, False), (14_400, False)])
def test_a_rest_in_the_cold_is_no_equilibrium_and_contradicts_nothing(rest_second, doubted):
    """After eleven minutes it is 83 mV, 7 % SoC, from where it goes; the counted SoC is right."""
    off, words = told(drive(rest_second=rest_second, slow_volt=0.1), CURVE)
    assert (off > 0, bool(words)) == (doubted, doubted)


def test_a_rest_in_the_cold_still_contradicts_what_lies_beyond_its_relaxation():
    off, words = told(drive(offset=0.09, rest_second=14_400, slow_volt=0.1), CURVE)
    assert off > 0.05
    assert words


def test_a_contradicted_reference_has_an_interval_that_holds_the_truth():
    """0.056 too high at its end, as of a wrong offset: a filter that is right errs by nothing."""
    record = drive(offset=0.056, rest_second=14_400)
    reference = reference_of(record, CURVE)
    true_soc = np.interp(record.voltage_volt[-1], CURVE["ocv_volt"], CURVE["soc"])
    assert reference.soc[-1] - true_soc == pytest.approx(0.056, abs=1e-3)
    assert reference.low[-1] < true_soc < reference.soc[-1]
    assert reference.low[-1] == pytest.approx(true_soc - 0.02 / 1.2, abs=2e-3)
    np.testing.assert_array_equal(reference.high, reference.soc)
    # A filter that is right is scored as such, one that is wrong by what no rest allows is not.
    estimates = np.array([true_soc, reference.soc[-1], true_soc - 0.1, reference.soc[-1] + 0.1])
    at_end = reference.of_rows(slice(-1, None))
    np.testing.assert_allclose(at_end.beyond(estimates)[[0, 1, 3]], [0.0, 0.0, 0.1])
    assert at_end.beyond(estimates)[2] < -0.06


def test_what_a_late_rest_contradicts_grows_from_the_rest_before_it():
    """Half an hour of rest at the start agrees: an offset that came after it has not moved yet."""
    late = drive(offset=0.09, rest_second=14_400)
    first = 1800
    current = np.append(np.zeros(first), late.current_ampere)
    volts = np.append(np.full(first, CURVE["ocv_volt"][-1]), late.voltage_volt)
    soc = np.append(np.ones(first), late.soc)
    record = record_of(np.arange(len(current)) * 1.0, current, volts, soc)
    reference = reference_of(record, CURVE)
    width = reference.soc - reference.low
    assert width[first - 1] < 1e-3
    assert width[-1] > 0.05
    assert (np.diff(width[first:]) > -1e-12).all()
