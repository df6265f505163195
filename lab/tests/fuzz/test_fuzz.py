"""A few of the records that `fuzz.cases` makes wrong, and all benign changes."""

import numpy as np
import pytest

from fuzz.kinds import BENIGN, KINDS
from fuzz.published import numbers_of, outcome_of, wrong_numbers
from fuzz.record import CURRENT
from fuzz.records import HERE, entries, record_of


@pytest.fixture(scope="module")
def record():
    """The demo's capacity test of C1: cycles with both counters left out."""
    entry = next(e for e in entries() if e[0] == HERE and e[2]["test"] == "capacity_25C")
    return record_of(entry)


@pytest.fixture(scope="module")
def clean(record):
    return numbers_of(outcome_of(record))


@pytest.mark.parametrize("kind", sorted(BENIGN))
def test_a_benign_change_moves_no_number_and_raises_no_doubt(record, clean, kind):
    outcome = outcome_of(BENIGN[kind](record, np.random.default_rng(4)))
    assert not (outcome.refused)
    assert not (outcome.crash)
    assert not wrong_numbers(numbers_of(outcome), clean)
    assert {n.doubt for n in numbers_of(outcome)} <= {n.doubt for n in clean}


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_nothing_crashes(record, kind):
    changed = KINDS[kind](record, np.random.default_rng(6))
    assert changed is None or not outcome_of(changed).crash


TOLD = (
    *("C-rate under A", "mA under A", "current zero in a block", "clock rate"),
    *("counter says otherwise", "second time column", "chamber misstated"),
    *("surface and ambient exchanged", "thermometer off by 40 K", "columns shifted", "two labels"),
    *("9 % gone over a pause of one row", "low range at a tenth", "truncated current"),
)


def test_a_clock_that_drifts_is_told_by_dates_where_a_counter_keeps_the_charge(record, clean):
    for seed in range(4):
        drifts = KINDS["clock drifts"](record, np.random.default_rng(seed))
        numbers = numbers_of(outcome_of(drifts))
        assert not wrong_numbers(numbers, clean)
        assert all("its clock runs otherwise than its dates" in number.doubt for number in numbers)


def test_what_an_offset_counts_lies_in_the_interval(record, clean):
    """Of the efficiency too: rests show it, and nothing tells whether loads hold it."""
    for seed in range(4):
        numbers = numbers_of(outcome_of(KINDS["offset"](record, np.random.default_rng(seed))))
        assert not [(n, true) for n, true in wrong_numbers(numbers, clean) if not n.doubt]
        stds = [[n.std for n in of if n.quantity == "capacity"] for of in (numbers, clean)]
        assert min(stds[0]) > 5 * max(stds[1])


@pytest.mark.parametrize("kind", TOLD)
def test_a_wrong_number_says_so(record, clean, kind):
    changed = 0
    for seed in range(4):
        outcome = outcome_of(KINDS[kind](record, np.random.default_rng(seed)))
        wrong = wrong_numbers(numbers_of(outcome), clean)
        assert outcome.refused or all(number.doubt for number, _ in wrong)
        changed += bool(outcome.refused or wrong)
    assert changed  # else this kind would test nothing


def test_what_a_coarse_digit_hides_lies_in_the_interval(record, clean):
    for seed in range(4):
        changed = KINDS["coarse rounding"](record, np.random.default_rng(seed))
        numbers = numbers_of(outcome_of(changed))
        assert all(number.doubt for number, _ in wrong_numbers(numbers, clean))
        stds = [[n.std for n in of if n.quantity == "capacity"] for of in (numbers, clean)]
        assert min(stds[0]) > 5 * max(stds[1])


def test_the_record_itself_is_one(record):
    assert np.ptp(record.columns[CURRENT]) > 0
