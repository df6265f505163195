"""How half cycles begin: by the half before, by the test before, else by their rest, with doubt."""

import re

import numpy as np
import pytest
from counted import NAMES

from cellwright.protocols.ageing import ageing_cycles
from cellwright.protocols.capacity import capacity
from cellwright.protocols.course import course
from cellwright.records.facts import CellFacts, TestFacts
from cellwright.refusal import Refusal
from cellwright.series.cleaning import net_charge
from cellwright.series.steps import segment

HOUR = 3600.0
CELL = CellFacts("A", 2.0, 3.0, 4.2)
AGED_OHM = 0.08


def ocv(soc):
    """Open-circuit voltage over SoC, steepest at its ends."""
    return 3.45 + 0.55 * soc + 0.2 * soc**12 - 0.45 * np.exp(-soc / 0.03)


def life(*parts, soc=1.0, size=2.0, ohm=AGED_OHM, lost=(), start_second=0.0):
    """Record of a cell with a resistance: parts are (ampere, cut-off), with rests between.

    Parts with a number in `lost` are lived but not logged.
    """
    columns, second = {name: [] for name in NAMES[:3]}, start_second

    def log(ampere, limit, seconds, kept):
        nonlocal soc, second
        for _ in range(int(seconds // 10)):
            second, soc = second + 10, soc + ampere * 10 / HOUR / size
            row = (second, ampere, ocv(soc) + ampere * ohm)
            for name, value in zip(NAMES[:3], row, strict=True):
                columns[name] += [value] if kept else []
            if ampere and np.sign(ampere) * (row[2] - limit) >= 0:
                return

    for number, (ampere, limit) in enumerate(parts):
        log(0.0, None, 1800, True)
        log(ampere, limit, 20 * HOUR, number not in lost)
    log(0.0, None, 1800, True)
    columns = {name: np.array(values) for name, values in columns.items()}
    gaps = np.flatnonzero(np.diff(columns[NAMES[0]]) > 600) + 1
    columns[NAMES[3]] = net_charge(columns[NAMES[0]], columns[NAMES[1]], gap_rows=gaps)
    return columns


def steps_of(columns):
    return segment(*[columns[name] for name in NAMES], rated_capacity_ampere_hour=2.0)


def cycles_of(columns):
    return ageing_cycles(columns, steps_of(columns), TestFacts("a", "ageing"), CELL)


def capacity_of(columns, *, cell=CELL, state_before="", soc=None, curve=None):
    """What a record tells that begins so, as the test before it and the sheet say."""
    curves = [] if curve is None else [curve | {"ambient_temperature_celsius": 25.0}]
    about = {"test": TestFacts("a", "capacity", soc=soc), "curves": curves}
    course = [{"test": "a", "state_at_begin": state_before}]
    return capacity(columns, steps_of(columns), cell, course=course, **about)


CYCLE = [(-1.0, 3.0), (1.0, 4.2)]


def test_discharges_count_though_most_charges_were_not_logged():
    parts = CYCLE * 12
    lost = [k for k in range(1, 24, 2) if k not in (5, 15)]
    whole, ageing = cycles_of(life(*parts)), cycles_of(life(*parts, lost=lost))
    found = ageing.rows["direction"] == "discharge"
    assert ageing.rows["cycle"][found].tolist() == list(range(1, 13))
    true = whole.rows["capacity_ampere_hour"][whole.rows["direction"] == "discharge"]
    assert ageing.rows["capacity_ampere_hour"][found] == pytest.approx(true, rel=2e-3)
    assert "9 of 12 discharges counted by their rest" in ageing.notes[0]
    assert "as before cycles that start full" in ageing.notes[0]
    assert not ageing.left_out


def test_what_a_start_may_lack_is_its_uncertainty():
    """An aged cell, its charge in no file: it rests lower, by the drop at the end of its charge."""
    columns = life((-1.0, 3.0), soc=0.97)
    assert 4.0 < columns["voltage_volt"][0] < 4.2 - 0.05 * 1.2
    found = capacity_of(columns)
    true = 2.0 * (1 - 0.97)
    assert found.rows["capacity_std_ampere_hour"][0] == pytest.approx(true, rel=0.7)
    assert "how full it starts is known from its rest voltage alone" in found.notes[0]


def test_the_test_before_tells_that_it_starts_full():
    found = capacity_of(life((-1.0, 3.0), soc=0.97), state_before="full")
    assert found.rows["capacity_std_ampere_hour"][0] < 1e-3 * 2.0  # the ammeter's alone
    assert not found.notes
    with pytest.raises(Refusal, match="may not start full: after a rest at"):
        capacity_of(life((-1.0, 3.0), soc=0.8))


def test_a_charge_cut_short_is_not_made_full_by_its_rest():
    ageing = cycles_of(life((-1.0, 3.0), (1.0, 4.12), (-1.0, 3.0), (1.0, 4.2), (-1.0, 3.0)))
    discharges = ageing.rows["direction"] == "discharge"
    assert ageing.rows["cycle"][discharges].tolist() == [1, 3]
    assert any("what came before was cut short" in words for words in ageing.left_out)


def test_a_second_slower_discharge_is_not_a_new_one():
    """What a slow discharge still takes out after a fast one belongs to the same half cycle."""
    ageing = cycles_of(life((-4.0, 3.0), (-0.2, 3.0), (1.0, 4.2), (-1.0, 3.0)))
    discharges = ageing.rows["direction"] == "discharge"
    assert ageing.rows["cycle"][discharges].tolist() == [1, 2]


def dated(name, columns, begin_second):
    columns = columns | {"unix_time_second": columns["test_time_second"] + begin_second}
    return TestFacts(name, "capacity"), columns, steps_of(columns)


def moved(found, direction, column="capacity_ampere_hour"):
    return found.rows[column][found.rows["direction"] == direction]


def test_a_charge_that_begins_under_load_at_the_cut_off_begins_empty():
    """A C/30 charge without a rest before it: under load the voltage is no lower than at rest."""
    columns = life((0.12, 4.2), soc=-0.002, ohm=0.02)
    cut = {
        name: values[180:] - values[180] * (name == NAMES[0]) for name, values in columns.items()
    }
    assert cut["current_ampere"][0] > 0
    assert cut["voltage_volt"][0] < 3.0 + 0.01
    assert moved(capacity_of(cut), "charge") == pytest.approx(2.0, rel=0.01)
    later = {name: values[1000:] for name, values in columns.items()}
    with pytest.raises(Refusal, match="from an unknown state of charge"):
        capacity_of(later)
    assert moved(capacity_of(later, soc=0.0), "charge") > 0


def lfp(soc):
    """A flat curve: a full cell rests far below its cut-off."""
    return 3.25 + 0.08 * soc + 0.14 * np.exp((soc - 1) / 0.01) - 0.4 * np.exp(-soc / 0.02)


FLAT = CELL._replace(lower_cutoff_volt=2.5, upper_cutoff_volt=3.65)


def test_a_full_cell_of_a_flat_curve_is_full_where_the_sheet_says_so(monkeypatch):
    monkeypatch.setitem(globals(), "ocv", lfp)
    columns = life((-1.0, 2.5))
    with pytest.raises(Refusal, match=r"after a rest at 3.470 V it may lack"):
        capacity_of(columns, cell=FLAT)
    found = capacity_of(columns, cell=FLAT, soc=1.0)
    assert found.rows["capacity_ampere_hour"] == pytest.approx([2.0], rel=0.02)
    assert not found.notes
    soc = np.linspace(0, 1, 201)
    curve = {"soc": soc, "ocv_volt": lfp(soc)}
    found = capacity_of(columns, cell=FLAT, soc=1.0, curve=curve)
    assert found.rows["capacity_ampere_hour"] == pytest.approx([2.0], rel=0.02)


def test_a_stated_full_that_the_rest_contradicts_is_said():
    soc = np.linspace(0, 1, 201)
    curve = {"soc": soc, "ocv_volt": ocv(soc)}
    with pytest.raises(Refusal, match=r"the stated SoC of 1 is not used: a rest at 3.7"):
        capacity_of(life((-1.0, 3.0), soc=0.6), soc=1.0, curve=curve)
    with pytest.raises(Refusal, match=r"it does not start full: the sheet states an SoC of 0.6"):
        capacity_of(life((-1.0, 3.0), soc=0.6), soc=0.6, curve=curve)
    with pytest.raises(Refusal, match=r"no such cell between 3 and 4.2 V"):
        capacity_of(life((1.0, 4.2), soc=0.88), soc=0.0)


def test_a_stated_state_that_the_half_cycles_contradict_is_said():
    found = capacity_of(life(*CYCLE, soc=1.0), soc=0.5)
    assert moved(found, "discharge") == pytest.approx(2.0, rel=0.1)
    assert "the stated SoC of 0.5 is not used: it starts full" in found.notes[0]


@pytest.mark.parametrize("begun", [0.02, 0.12, 0.5])
def test_the_discharge_after_a_first_charge_tells_what_it_already_held(begun):
    """A lab's file often begins with the charge of whatever was left in the cell."""
    columns = life((0.5, 4.2), (-0.5, 3.0), soc=begun, ohm=0.01)
    found = capacity_of(columns)
    if begun < 0.03:
        lacking = moved(found, "discharge") - moved(found, "charge")
        # Beside it stands what the steps of the current between two rows leave open.
        std = moved(found, "charge", "capacity_std_ampere_hour")
        assert std == pytest.approx(lacking, rel=1e-3)
        return
    assert moved(found, "charge").size == 0
    held = float(re.search(r"already held ([\d.]+)%", found.notes[0])[1])
    assert held == pytest.approx(100 * begun, abs=1.0)


def test_an_offset_of_the_current_is_not_taken_for_a_start_that_is_not_full():
    """Discharge and charge differ by 6 %, and the rest before them is at the upper cut-off."""
    columns = life(*CYCLE, ohm=0.01)
    columns["current_ampere"] = columns["current_ampere"] + 0.03 * (columns["current_ampere"] != 0)
    columns[NAMES[3]] = net_charge(columns[NAMES[0]], columns[NAMES[1]])
    found = capacity_of(columns)
    ratio = moved(found, "discharge") / moved(found, "charge")
    assert ratio == pytest.approx(0.97 / 1.03, abs=0.01)


@pytest.mark.parametrize("share", [0.025, 0.035, 0.045])
def test_an_aged_cell_that_rests_lower_has_a_capacity_with_its_doubt(share):
    """From 4.09 V down: what the discharge may lack is its doubt, not a reason to refuse it."""
    found = capacity_of(life((-1.0, 3.0), soc=1 - share, ohm=0.15))
    true = 2.0 - 0.15 / 0.55 * 0.02
    lacked = true - found.rows["capacity_ampere_hour"][0]
    assert found.rows["capacity_std_ampere_hour"][0] > 0.5 * lacked


def run_course(*tests):
    return course(tests, CELL).rows


def test_course_follows_dates_not_the_order_given():
    charge = dated("charge", life((1.0, 4.2), soc=0.02), 0.0)
    discharge = dated("discharge", life((-1.0, 3.0), soc=0.96), 20 * HOUR)
    found = run_course(discharge, charge)
    assert found["test_before"] == ["charge", ""]
    assert found["state_at_begin"] == ["full", ""]
    assert found["words"][1] == "no test before it has dates"


REFUSALS = {
    "no dates": ([("a", CYCLE, 1.0, None), ("b", CYCLE, 1.0, None)], "no dates"),
    "overlap": ([("a", CYCLE, 1.0, 0.0), ("b", CYCLE, 1.0, HOUR)], "runs at the same time"),
    "too long": ([("a", CYCLE, 1.0, 0.0), ("b", CYCLE, 1.0, 3000 * HOUR)], "days earlier"),
    "no cut-off": (
        [("a", [(-1.0, 3.6)], 1.0, 0.0), ("b", CYCLE, 0.5, 30 * HOUR)],
        "does not end at a cut-off",
    ),
    "contradiction": (
        [("a", CYCLE, 1.0, 0.0), ("b", [(1.0, 4.2)], 0.05, 30 * HOUR)],
        "ended full at .* but it begins at 3",
    ),
}


@pytest.mark.parametrize("what", REFUSALS)
def test_course_says_why_nothing_is_known(what):
    tests, words = REFUSALS[what]
    dated_tests = [
        dated(name, life(*parts, soc=soc), np.nan if begin is None else begin)
        for name, parts, soc, begin in tests
    ]
    found = run_course(*dated_tests)
    assert found["state_at_begin"][1] == ""
    assert re.search(words, found["words"][1])


@pytest.mark.parametrize("share", [0.0, 0.005, 0.015])
def test_a_rest_close_to_the_cut_off_needs_no_proof(share):
    soc = 1 - share
    found = capacity_of(life((-1.0, 3.0), soc=soc))
    std = found.rows["capacity_std_ampere_hour"][0]
    assert std < 1e-3 * 2.0 if ocv(soc) >= 4.19 else std > 0.3 * share * 2.0
