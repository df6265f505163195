"""The reference of a filter against the rests of its test."""

import numpy as np
import pytest

from cellwright.filters.reference import reference_doubt
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


def test_a_reference_that_agrees_is_in_no_doubt():
    assert reference_doubt(drive(), CURVE) == (0.0, "")


def test_an_offset_of_the_current_puts_the_reference_in_doubt():
    off, words = reference_doubt(drive(offset=0.5, rest_second=900), CURVE)
    # It rests at 0.5 A: that is no rest.
    assert np.isnan(off)
    assert not words
    off, words = reference_doubt(drive(offset=0.09, rest_second=14_400), CURVE)
    assert off == pytest.approx(0.09 * 5.0 / 5 - 0.02 / 1.2, abs=0.003)
    assert "which tells 0.58 to 0.62" in words


def test_a_rest_between_the_branches_of_a_hysteresis_contradicts_nothing():
    """0.09 of SoC is 108 mV on this curve; a cell of 100 mV each way rests as far off its OCV."""
    record = drive(offset=0.09, rest_second=14_400)
    assert reference_doubt(record, CURVE | {"half_gap_volt": np.full(101, 0.1)}) == (0.0, "")
    assert reference_doubt(record, CURVE | {"half_gap_volt": np.full(101, 0.01)})[1]


def test_without_a_rest_nothing_is_known():
    off, words = reference_doubt(drive(rest_second=300), CURVE)
    assert np.isnan(off)
    assert not words


@pytest.mark.parametrize(("rest_second", "doubted"), [(660, False), (14_400, False)])
def test_a_rest_in_the_cold_is_no_equilibrium_and_contradicts_nothing(rest_second, doubted):
    """After eleven minutes it is 83 mV, 7 % SoC, from where it goes; the counted SoC is right."""
    off, words = reference_doubt(drive(rest_second=rest_second, slow_volt=0.1), CURVE)
    assert (off > 0, bool(words)) == (doubted, doubted)


def test_a_rest_in_the_cold_still_contradicts_what_lies_beyond_its_relaxation():
    off, words = reference_doubt(drive(offset=0.09, rest_second=14_400, slow_volt=0.1), CURVE)
    assert off > 0.05
    assert words
