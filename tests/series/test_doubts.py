"""What contradicts itself in a record is flagged where it stands; a sound record has no flag."""

import numpy as np
import pytest

from cellwright.refusal import Refusal
from cellwright.series.cleaning import clean
from cellwright.series.doubts import (
    Doubt,
    against_counter,
    beyond_cutoffs,
    counter_digit,
    doubts_said,
    drawn_beyond,
    is_negative_electrode,
    unanswered,
)

RATED, OHM = 3.0, 0.04


@pytest.fixture
def columns():
    """A 3 Ah cell, 10 s a row: rest, discharge at C/2, rest, charge at C/2, rest; 0.1 mV."""
    current = np.repeat([0.0, -1.5, 0.0, 1.5, 0.0], [60, 600, 180, 600, 180])
    time = 10.0 * np.arange(len(current))
    soc = 0.95 + np.cumsum(current) * 10 / 3600 / RATED
    slow = np.zeros(len(current))
    for row in range(1, len(current)):
        slow[row] = (
            slow[row - 1] * np.exp(-10 / 300) + 0.02 * (1 - np.exp(-10 / 300)) * current[row]
        )
    noise = 2e-4 * np.random.default_rng(3).standard_normal(len(current))
    voltage = np.round(3.2 + soc + OHM * current + slow + noise, 4)
    counter = np.concatenate([[0], np.cumsum(0.5 * (current[1:] + current[:-1]) * 10 / 3600)])
    return {
        "test_time_second": time,
        "current_ampere": current,
        "voltage_volt": voltage,
        "net_capacity_ampere_hour": counter,
    }


def doubt_of(columns, **about):
    about = {"rated_capacity_ampere_hour": RATED, "cutoffs_volt": (2.5, 4.3)} | about
    cleaned = clean(columns, **about)
    return cleaned.columns.get("doubt", np.zeros(len(cleaned.columns["voltage_volt"]), int))


def flags(columns, **about):
    return Doubt(int(np.bitwise_or.reduce(doubt_of(columns, **about).astype(int))))


def without_counter(columns):
    return {name: c for name, c in columns.items() if name != "net_capacity_ampere_hour"}


def test_a_sound_record_has_no_doubt(columns):
    assert not flags(columns)
    assert "doubt" not in clean(columns, rated_capacity_ampere_hour=RATED).columns


def test_a_current_beside_another_counter(columns):
    columns["current_ampere"] = columns["current_ampere"] * np.where(np.arange(1620) < 300, 1, 1.05)
    doubt = doubt_of(columns)
    assert not doubt[:290].any()
    assert np.all(doubt[330:600] & Doubt.COUNTER)


@pytest.mark.parametrize("digit", [0.0, 1e-3, 1e-5])
@pytest.mark.parametrize("step", [10.0, 1.0, 0.1])
def test_a_counter_that_moves_little_from_row_to_row_is_no_coarse_one(step, digit):
    """By less than a thousandth of 1 Ah: as read, it tells a gain of the current by 4 %."""
    time = step * np.arange(4000)
    counter = 1.2 * (time - time[-1] / 2).clip(0) / 3600
    read = np.round(counter / digit) * digit if digit else counter
    wanted = digit or 1e-9
    if counter[-1] > 100 * wanted:
        assert counter_digit(np.diff, read, beside=1) == pytest.approx(wanted)
    current = 1.04 * 1.2 * (time > time[-1] / 2)
    told = against_counter(time, current, read, np.zeros(len(time), bool))
    assert told.any() == (counter[-1] > 100 * wanted)
    current = current / 1.04
    assert not against_counter(time, current, read, np.zeros(len(time), bool)).any()


def test_rows_that_are_missing_with_the_clock_closed_up(columns):
    kept = np.r_[0:200, 350:1620]
    gone = {name: c[kept] for name, c in without_counter(columns).items()}
    gone["test_time_second"] = 10.0 * np.arange(len(kept))
    assert np.flatnonzero(doubt_of(gone) & Doubt.VOLTAGE_STEP).tolist() == [200]


def steep(minutes, interval, ends, ohm):
    """A load of 1.5 A whose voltage falls ever steeper to its end, a row each `interval` [s], where
    the tester adds one `ends` seconds after the load began and stopped; then a charge likewise."""
    edges = 60.0 * np.cumsum([0, 10, minutes, 30, minutes, 30])
    time = np.concatenate([np.arange(0.0, edges[-1], interval), edges[1:-1] + ends])
    time = np.unique(np.concatenate([time, edges[1:-1]]))
    level = np.array([0.0, -1.5, 0.0, 1.5, 0.0])
    current = level[np.searchsorted(edges, time, side="left") - 1 + (time == 0)]
    moved = np.concatenate([[0.0], np.cumsum(current[1:] * np.diff(time))]) / 3600
    left = 1.0 + moved / (1.5 * minutes / 60)
    return time, current, 3.2 + 0.4 * left - 0.9 * np.exp(-left / 0.02) + ohm * current


@pytest.mark.parametrize(("interval", "ohm"), [(60.0, 0.006), (60.0, 0.01)])
def test_a_steep_end_is_no_resistance_and_hides_no_answer(interval, ohm):
    """In rows a minute apart an empty cell moves by far more than its resistance makes."""
    time, current, voltage = steep(60, interval, 2.0, ohm)
    rows, found = unanswered(time, current, voltage, np.zeros(len(time), bool))
    assert not len(rows)
    assert np.isnan(found) or ohm <= found < 3 * ohm


def test_a_load_that_falls_on_until_it_stops_between_two_rows_was_answered(columns):
    """By 100 mV from row to row at its end, and by 95 mV in the row in which it stops."""
    columns = without_counter(columns)
    fall = np.zeros(len(columns["voltage_volt"]))
    fall[650:660] = 0.1 * np.arange(1, 11)
    fall[660:] = fall[659] + 0.095
    columns["voltage_volt"] = columns["voltage_volt"] - fall * (np.arange(len(fall)) < 840)
    assert Doubt.NO_ANSWER not in flags(columns, cutoffs_volt=(None, None))


def test_a_load_that_reads_zero(columns):
    columns = without_counter(columns)
    columns["current_ampere"][300:400] = 0.0
    found = doubt_of(columns)
    assert found[300] & Doubt.NO_ANSWER
    assert np.all(found[310:390] & Doubt.AT_REST)


@pytest.mark.parametrize("rows", [6, 15, 60])
def test_a_load_that_reads_zero_where_no_step_shows_the_resistance(columns, rows):
    """Over a block of zeros the voltage goes on as far as the slopes beside it say."""
    load = {name: c[100:600].copy() for name, c in without_counter(columns).items()}
    assert not flags(load)
    load["current_ampere"][200 : 200 + rows] = 0.0
    found = doubt_of(load) & Doubt.AT_REST
    assert np.flatnonzero(found).tolist() == list(range(200, 200 + rows))


@pytest.mark.parametrize("rows", [6, 15, 60])
def test_a_load_that_pauses_is_a_rest(columns, rows):
    load = {name: c[100:600] for name, c in without_counter(columns).items()}
    rest = load["voltage_volt"][199] + 1.5 * OHM + 0.02 * (1 - np.exp(-np.arange(rows) / 30))
    pauses = {"current_ampere": np.zeros(rows), "voltage_volt": rest}
    columns = {n: np.insert(load[n], 200, values) for n, values in pauses.items()}
    columns["test_time_second"] = 10.0 * np.arange(500 + rows)
    assert not flags(columns)


def test_single_rows_of_the_current_that_drop_out(columns):
    columns = without_counter(columns)
    rows = [150, 350, 1000]
    columns["current_ampere"][rows] = 0.0
    assert np.flatnonzero(doubt_of(columns) & Doubt.NO_ANSWER).tolist() == rows


@pytest.mark.parametrize("factor", [1000.0, 1e-3])
def test_a_current_in_another_unit(columns, factor):
    columns = without_counter(columns)
    columns["current_ampere"] = columns["current_ampere"] * factor
    assert flags(columns) & Doubt.SIZE


def test_a_voltage_that_rests_beyond_its_cutoff(columns):
    assert flags(columns, cutoffs_volt=(2.5, 4.0)) == Doubt.BEYOND


@pytest.mark.parametrize(("ampere", "drawn"), [(-0.3, True), (-1.5, False)])
def test_no_tester_draws_slowly_on_below_the_cutoff(ampere, drawn):
    current, volt = np.full(60, ampere), np.linspace(3.0, 2.2, 60)
    assert drawn_beyond(current, volt, 2.5, RATED) == drawn
    assert not drawn_beyond(current, volt + 0.25, 2.5, RATED)


def test_first_rows_may_still_be_raised_by_a_charge_before_the_record():
    """NASA B0047 begins two rows after a charge, 47 mV above its cut-off."""
    current, volt = np.r_[np.zeros(2), np.full(30, -1.0)], np.linspace(4.0, 3.9, 32)
    begun = np.r_[4.247, 4.247, volt[2:]]
    assert not len(beyond_cutoffs(current, begun, (2.5, 4.2)))
    assert len(beyond_cutoffs(np.zeros(32), np.full(32, 4.247), (2.5, 4.2)))


def test_flags_are_said_in_words_of_the_rows_they_touch():
    doubt = np.array([0, Doubt.CLOCK, 0, Doubt.SIGN | Doubt.CLOCK])
    assert doubts_said(doubt, slice(0, 1)) == doubts_said(None) == []
    assert [one.code for one in doubts_said(doubt)] == ["row.clock", "row.sign"]


@pytest.mark.parametrize(
    ("stated", "told"), [(25.0, False), (20.0, False), (-20.0, True), (None, False)]
)
def test_a_chamber_that_the_thermometer_never_comes_near_is_told(columns, stated, told):
    columns["surface_temperature_celsius"] = np.linspace(27.0, 31.0, len(columns["voltage_volt"]))
    found = flags(columns, ambient_temperature_celsius=stated)
    assert (Doubt.CHAMBER in found) == told


def test_a_thermometer_that_shows_zero_for_a_stretch_shows_nothing(columns):
    celsius = np.full(len(columns["voltage_volt"]), 27.8)
    celsius[200:500] = 0.0
    columns["surface_temperature_celsius"] = celsius
    cleaned = clean(columns).columns
    assert np.nanmean(cleaned["surface_temperature_celsius"]) == pytest.approx(27.8)
    (told,) = doubts_said(cleaned["doubt"], slice(100, 600))
    assert told.endswith("for a while (60% of the rows)")
    assert not doubts_said(cleaned["doubt"], slice(0, 190))


def test_a_zero_beside_a_cold_cell_is_told_by_how_long_it_stands(columns):
    celsius = np.full(len(columns["voltage_volt"]), 2.8)
    celsius[200:500] = 0.0
    celsius[700] = 0.0
    columns["surface_temperature_celsius"] = celsius
    cleaned = clean(columns).columns["surface_temperature_celsius"]
    assert np.isnan(cleaned[200:500]).all()
    assert cleaned[700] == 0.0


def test_a_cell_that_cools_through_zero_keeps_its_temperature(columns):
    rows = len(columns["voltage_volt"])
    columns["surface_temperature_celsius"] = np.round(np.linspace(20.0, -20.0, rows))
    assert np.isfinite(clean(columns).columns["surface_temperature_celsius"]).all()
    assert not flags(columns, ambient_temperature_celsius=-20.0)


def test_a_thermometer_read_every_few_rows_is_in_no_doubt(columns):
    celsius = np.full(len(columns["voltage_volt"]), np.nan)
    celsius[::30] = 25.0
    columns["surface_temperature_celsius"] = celsius
    assert not flags(columns)


@pytest.mark.parametrize(("factor", "said"), [(60, "minutes"), (3600, "hours"), (86400, "days")])
def test_a_clock_in_another_unit_is_told_by_rating_and_cut_offs(columns, factor, said):
    slower = without_counter(columns) | {"test_time_second": columns["test_time_second"] / factor}
    low, high = columns["voltage_volt"].min(), columns["voltage_volt"].max()
    about = {"rated_capacity_ampere_hour": 2.5, "cutoffs_volt": (low, high)}
    with pytest.raises(Refusal, match=f"{said} read as seconds"):
        clean(slower, **about)
    assert not flags(columns, **about)


@pytest.mark.parametrize("limits", [(0.005, 1.5), (0.005, 2.0), (0.01, 3.0)])
def test_a_half_cell_begins_above_its_cutoff_but_rests_there_no_second_time(limits):
    """Nothing was ever inserted: it begins at its open circuit, above any limit of its cycles."""
    high, still = limits[1], np.zeros(40)
    current = np.r_[still, np.full(40, -1.0), still, np.full(40, 1.0), still]
    down, up = np.linspace(high, limits[0], 40), np.linspace(limits[0], high, 40)
    voltage = np.r_[still + high + 0.5, down, still + limits[0], up, still + high - 0.02]
    assert not len(beyond_cutoffs(current, voltage, limits))
    voltage[-20:] = high + 0.5
    assert np.all(beyond_cutoffs(current, voltage, limits) >= 180)
    assert len(beyond_cutoffs(current, voltage, limits))


@pytest.mark.parametrize(
    ("limits", "is_one"),
    [((0.005, 1.5), True), ((0.005, 2.0), True), ((0.01, 2.5), True), ((0.0, 3.0), True)]
    + [((1.5, 2.8), False), ((2.5, 4.2), False), ((0.0, 3.95), False), ((None, 4.2), False)],
)
def test_a_negative_electrode_against_a_metal_is_told_by_its_window(limits, is_one):
    assert is_negative_electrode(limits) is is_one


def test_a_load_in_the_cold_that_reaches_both_cut_offs_is_no_wrong_unit():
    """1C for a minute from full to the lower cut-off: a 60th of the rating, as of minutes in s."""
    time = np.arange(2400.0)
    current = np.where((time >= 600) & (time < 660), -3.0, 0.0)
    voltage = 4.18 + 0.55 * current + 0.98 / 3600 / RATED * np.cumsum(current)
    cold = {"test_time_second": time, "current_ampere": current, "voltage_volt": voltage}
    about = {"rated_capacity_ampere_hour": RATED, "cutoffs_volt": (2.5, 4.2)}
    assert len(clean(cold, **about).columns["voltage_volt"]) == len(time)
