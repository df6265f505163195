"""Capacity of made cycles with known truth, and of measured ones against published numbers."""

import numpy as np
import pandas as pd
import pytest
from counted import NAMES, counted, measured
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from cellwright.protocols.ageing import ageing_cycles
from cellwright.protocols.capacity import capacity
from cellwright.protocols.half_cycles import turns
from cellwright.records.facts import CellFacts, TestFacts
from cellwright.refusal import Refusal
from cellwright.series.cleaning import clean
from cellwright.series.steps import segment


def cycle(*parts, full=2.0, start=1.0, step=10.0, loss=0.0):
    """A cell whose voltage is 3 V + SoC: parts are ampere (run to the end), or (hours, ampere).

    Charges move (1 + loss) times what the cell takes. Half an hour of rest between the parts.
    """
    soc, current, voltage = start, [0.0] * 180, [3.0 + start] * 180
    for part in parts:
        hours, ampere = part if isinstance(part, tuple) else (np.inf, part)
        gain = ampere / full / 3600 * step / (1 + loss if ampere > 0 else 1)
        count = 0
        while count * step < hours * 3600 - 1e-6 and -1e-9 <= soc + gain <= 1 + 1e-9:
            soc, count = soc + gain, count + 1
            current.append(ampere)
            voltage.append(3.0 + soc)
        current += [0.0] * 180
        voltage += [3.0 + soc] * 180
    time = np.arange(len(current)) * step
    current = np.array(current)
    return time, current, np.array(voltage), counted(time, current)


def run(data, *, rated=2.0, lower=3.0, upper=4.0, others=(), **settings):
    """What a record tells; `others`: further columns of it."""
    steps = segment(*data, rated_capacity_ampere_hour=rated)
    series = dict(zip(NAMES, data, strict=True)) | dict(others)
    return capacity(series, steps, CellFacts("A", rated, lower, upper), **settings)


def test_full_cycle_gives_capacity_energy_and_efficiency():
    rows = run(cycle(-1.0, 1.0, loss=0.01)).rows
    assert rows["direction"].tolist() == ["charge", "discharge"]
    assert np.allclose(rows["capacity_ampere_hour"], [2.02, 2.0], atol=0.005)
    assert np.isclose(rows["energy_watt_hour"][1], 2.0 * 3.5, rtol=0.003)
    assert np.allclose(rows["coulombic_efficiency"], 1 / 1.01, atol=0.002)
    assert np.allclose(rows["c_rate"], 0.5)
    share = rows["capacity_std_ampere_hour"] / rows["capacity_ampere_hour"]
    np.testing.assert_allclose(rows["energy_std_watt_hour"] / rows["energy_watt_hour"], share)


def test_rests_beside_a_half_cycle_tell_what_it_moved_between():
    """The first discharge begins a record; half an hour of rest lies around the others."""
    rows = run(cycle(-1.0, 1.0, -1.0, loss=0.01)).rows
    np.testing.assert_allclose(rows["rest_before_volt"], [3.0, 4.0], atol=0.003)
    np.testing.assert_allclose(rows["rest_after_volt"], [4.0, 3.0], atol=0.003)
    np.testing.assert_allclose(rows["rested_ampere_hour"], [2.02, 2.0], atol=0.005)
    short = run(tuple(column[177:] for column in cycle(-1.0))).rows
    assert np.isnan(short["rested_ampere_hour"]).all()


@pytest.mark.parametrize(("others", "largest"), [((), 1.0), ((-2.0, 2.0), 2.0)])
def test_a_capacity_is_no_surer_than_the_ammeter_over_its_range(others, largest):
    """Off by up to a share of the largest current, anywhere, for as long as the discharge took."""
    parts = [run(cycle(-1.0, 1.0, *others), current_accuracy_share=x).rows for x in (0.0, 0.01)]
    without, with_it = (rows["capacity_std_ampere_hour"] for rows in parts)
    found = np.sqrt(with_it**2 - without**2)[-1 if not others else -2]
    assert found == pytest.approx(0.01 * largest * 2.0 / 3**0.5, rel=0.02)


def test_a_capacity_is_no_surer_than_the_clock():
    """Whose error is a share of the charge, whatever the range of the ammeter."""
    parts = [run(cycle(-1.0, 1.0, -2.0, 2.0), clock_error_share=x).rows for x in (0.0, 0.02)]
    without, with_it = (rows["capacity_std_ampere_hour"] for rows in parts)
    shares = np.sqrt(with_it**2 - without**2) / parts[0]["capacity_ampere_hour"]
    np.testing.assert_allclose(shares, 0.02 / 3**0.5, rtol=0.02)


def test_what_rests_read_may_flow_under_load_too():
    """4 mA in the rests of a 2 Ah cell, over a discharge of two hours."""
    time, current, voltage, _ = cycle(-1.0, 1.0)
    right = run((time, current, voltage, counted(time, current))).rows
    off = run((time, current + 0.004, voltage, counted(time, current + 0.004))).rows
    wrong = np.abs(off["capacity_ampere_hour"] - right["capacity_ampere_hour"])
    np.testing.assert_allclose(wrong, 0.008, rtol=0.05)
    assert np.all(wrong < 2 * off["capacity_std_ampere_hour"])


@pytest.mark.parametrize("offset", [-0.006, 0.006])
def test_what_cleaning_took_out_of_rests_may_flow_under_load_too(offset):
    """6 mA that cleaning proves to be the sensor's, over charges and discharges of two hours."""
    time, current, voltage, _ = cycle(*(-1.0, 1.0) * 4)
    chance = np.random.default_rng(1)
    relaxing = lfilter([0.1 * 0.01], [1.0, -0.9], current)  # 10 mOhm, 100 s
    logged = {
        "test_time_second": time,
        "current_ampere": current + offset + 1e-4 * chance.standard_normal(len(time)),
        "voltage_volt": voltage + relaxing + 2e-4 * chance.standard_normal(len(time)),
    }
    series = clean(logged).columns
    np.testing.assert_allclose(series["logged_current_ampere"], logged["current_ampere"])
    data = [series[name] for name in logged] + [series["charge_ampere_hour"]]
    found = run(data, others={"logged_current_ampere": series["logged_current_ampere"]}).rows
    wrong = np.abs(found["capacity_ampere_hour"] - 2.0)
    np.testing.assert_allclose(wrong, 0.012, atol=0.002)
    assert np.all(wrong < 1.96 * found["capacity_std_ampere_hour"])
    steps = segment(*data, rated_capacity_ampere_hour=2.0)
    test, cell = TestFacts("a", "ageing"), CellFacts("A", 2.0, 3.0, 4.0)
    cycles = ageing_cycles(series, steps, test, cell).rows
    wrong = np.abs(cycles["capacity_ampere_hour"] - 2.0)
    assert np.all(wrong < 1.96 * cycles["capacity_std_ampere_hour"])


def test_repeats_are_averaged_and_rates_kept_apart():
    rows = run(cycle(-1.0, 1.0, -1.0, 1.0, -2.0, 1.0)).rows
    assert rows["direction"].tolist() == ["charge", "discharge", "discharge"]
    assert rows["repeats"].tolist() == [3, 2, 1]
    assert np.allclose(rows["c_rate"], [0.5, 0.5, 1.0])
    assert np.isfinite(rows["capacity_std_ampere_hour"][:2]).all()


@pytest.mark.parametrize(("celsius", "repeats"), [((10, 24, 40), [1, 1, 1]), ((24, 26, 28), [3])])
def test_cycles_at_temperatures_that_were_chosen_are_no_repeats(celsius, repeats):
    """A chamber that was set anew between cycles; a cell that its own load warms is no other."""
    data = cycle(*([-1.0, 1.0] * 3))
    begins = (np.diff(data[1]) < -0.5) & (data[1][1:] < 0)
    bounds = np.flatnonzero(begins)
    warm = np.asarray(celsius, float)[
        np.clip(np.searchsorted(bounds, range(len(data[0]))) - 1, 0, 2)
    ]
    rows = run(data, others={"surface_temperature_celsius": warm}).rows
    discharges = rows["direction"] == "discharge"
    assert rows["repeats"][discharges].tolist() == repeats
    if len(repeats) > 1:
        found = sorted(rows["temperature_mean_celsius"][discharges])
        np.testing.assert_allclose(found, celsius, atol=0.05)


def test_mean_and_spread_of_three():
    """The thesis' capacity: the mean of three; here the cell loses 0.02 Ah from one to the next."""
    data = [cycle(-1.0, 1.0, full=full) for full in (2.0, 1.98, 1.96)]
    ends = np.cumsum([0.0] + [part[0][-1] + 10 for part in data])
    time = np.concatenate([part[0] + end for part, end in zip(data, ends, strict=False)])
    current = np.concatenate([part[1] for part in data])
    voltage = np.concatenate([part[2] for part in data])
    rows = run((time, current, voltage, counted(time, current))).rows
    assert rows["repeats"].tolist() == [3, 3]
    assert np.allclose(rows["capacity_ampere_hour"], 1.98, atol=0.005)
    assert np.allclose(rows["capacity_std_ampere_hour"], 0.02, atol=0.002)


def test_incomplete_is_left_out_with_its_reason():
    capacities = run(cycle((1.0, -1.0), 1.0, -1.0))
    assert capacities.rows["direction"].tolist() == ["discharge"]
    assert "ends at 3.5" in capacities.notes[0]
    assert "does not start empty" in capacities.notes[1]


@pytest.mark.parametrize(
    ("loss", "doubted"), [(0.0, False), (0.01, False), (-0.005, False), (-0.03, True), (0.05, True)]
)
def test_a_cycle_between_equal_ends_that_does_not_balance_is_in_doubt(loss, doubted):
    rows = run(cycle(-1.0, 1.0, loss=loss)).rows
    said = [("are unexplained" in words) for words in rows["doubt"]]
    assert said == [doubted] * 2
    # By how much is said and is part of the deviation.
    words = list(filter(None, rows["doubt"]))
    off = np.array([float(one.rpartition("off by ")[2].rstrip("%")) / 100 for one in words])
    assert np.all((off > 0.5 * abs(loss)) & (off < abs(loss)))
    told = rows["capacity_std_ampere_hour"] / rows["capacity_ampere_hour"]
    assert np.all((told > 0.005) == doubted)


def ends_apart(hold_to, loss=0.0):
    """A cycle from full to full whose charge ends at the cut-off by its overpotential, at a SoC of
    `hold_to`: it then rests lower, as after a charge in the cold."""
    part = cycle(-1.0, (2.0 * hold_to, 1.0), loss=loss)
    time, current, voltage, charge = part
    over = np.where(current > 0, 1.0 - hold_to + 1e-6, 0.0)
    return time, current, voltage + over, charge


@pytest.mark.parametrize("share", [0.991, 0.9895, 0.985, 0.97, 0.95])
def test_no_threshold_splits_what_the_ends_of_cycles_explain(share):
    """Discharges give back 1 to 5 % more than charges put in, for these end below full."""
    rows = run(ends_apart(share)).rows
    assert rows["direction"].tolist() == ["charge", "discharge"]
    assert not any(rows["doubt"]), rows["doubt"]
    efficiency, std = rows["coulombic_efficiency"], rows["coulombic_efficiency_std"]
    known = np.isfinite(efficiency)
    np.testing.assert_allclose(efficiency[known], 1 / share, atol=0.003)
    assert np.all(np.abs(efficiency - 1)[known] < 2 * std[known])


@pytest.mark.parametrize("rest", [True, False])
def test_a_charge_without_a_hold_from_which_a_cell_rests_lower_puts_the_discharge_in_no_doubt(rest):
    """On a plateau 20 mV are most of the charge: at 1C it ends at its cut-off after a third."""
    time, current, voltage, charge = ends_apart(0.35)
    bare = voltage - np.where(current > 0, 0.65 + 1e-6, 0.0) - 3.0
    level = 3.3 + 0.03 * bare + 0.17 * np.exp((bare - 1) / 0.01) - 0.3 * np.exp(-bare / 0.01)
    over = np.where(current > 0, 3.5 - (3.3 + 0.03 * 0.35), 0.0)
    rows = slice(None if rest else np.flatnonzero(current > 0)[-1] + 1)
    data = [column[rows] for column in (time, current, level + over, charge)]
    found = run(data, upper=3.5, lower=3.0).rows
    of_discharge = found["direction"] == "discharge"
    assert found["doubt"][of_discharge].tolist() == [""]
    assert found["capacity_ampere_hour"][of_discharge] == pytest.approx(2.0, abs=0.005)
    assert np.all(found["capacity_std_ampere_hour"][of_discharge] < 0.02)
    # At C/24 no overpotential ends a charge after a third.
    if not rest:
        found = run((12 * data[0], data[1] / 12, *data[2:]), upper=3.5, lower=3.0).rows
        assert all("are unexplained" in words for words in found["doubt"])


@pytest.mark.parametrize("share", [0.99, 0.95])
def test_what_the_ends_do_not_explain_is_told_beside_what_they_do(share):
    """They explain up to twice the mean slope: 3 % more is beyond the one, 8 % beyond the other."""
    rows = run(ends_apart(share, loss=-(1.03 - share) * 1.5)).rows
    assert all("are unexplained" in words for words in rows["doubt"]), rows["doubt"]


@pytest.mark.parametrize("hold", ["power", "resistance", "current", "drift"])
def test_a_constant_power_is_a_mode_and_no_drift(hold):
    """From 4 to 3 V: the same charge whatever is held; a gain that drifts holds nothing."""
    soc, current, voltage, step = 1.0, [0.0] * 180, [4.0] * 180, 10.0
    while soc > 0:
        volt = 3.0 + soc
        held = {"power": 4.0 / volt, "resistance": volt / 3.0, "current": 1.0, "drift": 1.0}[hold]
        soc -= held * step / 3600 / 2.0
        current.append(-held * (1.0 + 0.1 * soc if hold == "drift" else 1.0))
        voltage.append(3.0 + soc)
    current, voltage = np.array(current + [0.0] * 180), np.array(voltage + [voltage[-1]] * 180)
    time = np.arange(len(current)) * step
    found = run((time, current, voltage, counted(time, current)))
    level = {"power": 4.0, "resistance": 3.0}.get(hold)
    notes = [note for note in found.notes if f"at a constant {hold} of" in note]
    assert len(notes) == (level is not None)
    if level:
        assert float(notes[0].split()[-2]) == pytest.approx(level, rel=0.002)
    assert ("current drifts" in found.rows["doubt"][0]) is (hold == "drift")
    if hold != "drift":
        assert found.rows["capacity_ampere_hour"][0] == pytest.approx(2.0, abs=0.005)


@pytest.mark.parametrize("limits", [(0.005, 1.5), (0.005, 2.0), (0.01, 3.0)])
def test_the_first_efficiency_of_a_negative_electrode_is_charge_over_discharge(limits):
    """Three cycles of a half cell; the first insertion takes 25 % more than comes out."""
    window = limits[1] - limits[0]
    time, current, voltage, _ = cycle(*(-1.0, 1.0) * 3)
    first = np.flatnonzero((current < 0) & (time < 10_000))
    current[first] *= 1.25
    voltage = limits[0] + window * (voltage - 3.0)
    data = time, current, voltage, counted(time, current)
    rows = run(data, lower=limits[0], upper=limits[1]).rows
    np.testing.assert_allclose(rows["first_coulombic_efficiency"][0], 0.8, atol=0.003)
    assert not any("are unexplained" in words for words in rows["doubt"])


@pytest.mark.parametrize(("slope", "doubted"), [(0.0, False), (0.1, True)])
def test_a_current_that_fades_at_its_cutoff_is_held_there_and_one_that_fades_before_drifts(
    slope, doubted
):
    """Behind a hold the voltage of A123 goes on by 10 mV, in a dither of the same sign."""
    time, current, voltage, _ = cycle(-1.0, 1.0)
    charge = np.flatnonzero(current > 0)
    current[charge] *= 1.0 - slope * np.linspace(0, 1, len(charge))
    hold, dither = np.arange(80) * 10.0, np.sin(np.linspace(0.0, 2.5, 30))
    fades = 0.9 * np.exp(-hold / 200)
    current = np.r_[current[: charge[-1] + 1], fades, fades[-1] + 0.02 * dither, [0.0] * 60]
    voltage = np.r_[voltage[: charge[-1] + 1], 4.0 + 0 * hold, 4.0 + 0.01 * dither, [4.0] * 60]
    time = np.arange(len(current)) * 10.0
    doubts = run((time, current, voltage, counted(time, current))).rows["doubt"]
    assert any("current drifts" in doubt for doubt in doubts) is doubted, doubts


def test_remainder_counts_only_in_the_whole_swing():
    data = cycle((1.9, -1.0), -0.2, 1.0)
    data[2][(data[0] > 7800) & (data[0] < 9000)] -= 0.05  # cold: the cut-off comes early
    one, whole = run(data).rows, run(data, whole_swing=True).rows
    assert np.isclose(one["capacity_ampere_hour"][1], 1.9, atol=0.01)
    assert np.isclose(whole["capacity_ampere_hour"][1], 2.0, atol=0.01)
    assert np.isclose(whole["c_rate"][1], 0.5)


def test_temperature_is_the_mean_over_the_step():
    data = cycle(-1.0)
    warm = np.where(data[1] < 0, 31.0, 25.0)
    rows = run(data, others={"surface_temperature_celsius": warm}).rows
    assert np.isclose(rows["temperature_mean_celsius"][0], 31.0, atol=0.05)


@settings(max_examples=15, deadline=None)
@given(st.floats(0.05, 200.0))
def test_capacity_scales_with_the_cell(size):
    time, current, voltage, charge = cycle(-1.0, 1.0, step=60.0)
    rows = run((time, size * current, voltage, size * charge), rated=2.0 * size).rows
    assert np.allclose(rows["capacity_ampere_hour"] / size, 2.0, atol=0.04)
    assert np.allclose(rows["c_rate"], 0.5)


@pytest.mark.parametrize(
    ("parts", "start", "limits", "reason"),
    [
        (((1.0, -1.0),), 1.0, {}, "before the cut-off of 3 V"),
        (
            (-1.0,),
            0.6,
            {},
            "may not start full: after a rest at 3.600 V it may lack 65% of its charge",
        ),
        ((1.0,), 0.3, {}, "may not start empty"),
        ((1.0,), 0.0, {"upper": None}, "upper cut-off is not stated"),
        (((0.02, -1.0),), 1.0, {}, r"none begins: time × current moves 0.022 Ah in all, 0.011 of"),
        (((0.02, 0.0),), 1.0, {}, "the current reads 0 A in all rows"),
    ],
)
def test_refusals(parts, start, limits, reason):
    with pytest.raises(Refusal, match=reason):
        run(cycle(*parts, start=start), **limits)


@pytest.mark.parametrize("offset", [-0.004, 0.004])
def test_what_an_offset_counts_at_rest_is_no_half_cycle(offset):
    """A rest of weeks at an offset of C/500 counts as much as turns the charge."""
    time, current, voltage, _ = cycle(-1.0, 1.0)
    rest = np.arange(1, 60 * 360) * 10.0 * 5
    time = np.append(time, time[-1] + rest)
    current = np.append(current, np.zeros(len(rest))) + offset
    voltage = np.append(voltage, np.full(len(rest), voltage[-1]))
    made = run((time, current, voltage, counted(time, current)), lower=2.99, upper=4.01)
    # Upwards it goes on with the charge before it, and turns nothing.
    assert [("at rest" in words) for words in made.notes] == [True] * (offset < 0)
    assert np.allclose(made.rows["capacity_ampere_hour"], 2.0, atol=0.03)


def test_several_currents_are_no_rate():
    with pytest.raises(Refusal, match="moved at one rate"):
        run(cycle((1.0, -1.0), -0.5))


def test_dither_is_no_turn():
    charge = np.array([0.0, -1.0, -0.99, -1.01, 1.0, 0.99])
    steps = segment(*cycle(-1.0), rated_capacity_ampere_hour=2.0)._replace(last_row=np.arange(1, 6))
    assert turns(charge, steps, least_ampere_hour=0.1) == [(-1, 0, 2), (1, 3, 3)]


@pytest.mark.parametrize(
    ("path", "sign", "rated", "published"),
    [
        ("panasonic/raw/capacity/25C_start_1_discharge.parquet", 1, 2.9, 2.802),
        ("panasonic/raw/capacity/25C_end_2_discharge.parquet", 1, 2.9, 2.358),
        ("panasonic/raw/ocv/C20_25C.parquet", 1, 2.9, 2.997),
        ("lgm50/raw/rate/0C_C10.parquet", 1, 5.0, 4.43),
        ("lgm50/raw/rate/25C_C10.parquet", 1, 5.0, 4.94),
        ("lgm50/raw/rate/45C_C10.parquet", 1, 5.0, 4.95),
        ("dmegc/raw/R1/ocv_C20.csv.gz", -1, 2.6, 2.752),
        ("dmegc/raw/R2/discharge_2C.csv.gz", -1, 2.6, 2.498),
        ("samsung30q/raw/discharge/S001_1C.csv.gz", 1, 3.0, 2.957),
        ("samsung30q/raw/discharge/S001_4C.csv.gz", 1, 3.0, 2.899),
    ],
)
def test_published_capacities(shared, path, sign, rated, published):
    data = measured(shared / "campaigns" / path, sign)
    rows = run(data, rated=rated, lower=2.5, upper=4.2).rows
    discharges = rows["capacity_ampere_hour"][rows["direction"] == "discharge"]
    assert np.isclose(discharges[0], published, rtol=0.01)


def test_published_swing_of_a123(shared):
    """Scripts 1 and 2 are one discharge at −25 °C and its remainder at 25 °C."""
    folder = shared / "campaigns/a123/raw/ocv"
    tables = [pd.read_csv(folder / f"A123_OCV_N25_S{k}.csv.gz") for k in (1, 2, 3, 4)]
    files = np.repeat(np.arange(4), [len(part) for part in tables])
    joined = pd.concat(tables)
    time = joined["Test_Time(s)"].to_numpy() + 1e6 * files
    current = joined["Current(A)"].to_numpy()
    apart = np.append(0, np.diff(files)) == 0
    moved = np.diff(counted(time, current), prepend=0) * apart
    data = (time, current, joined["Voltage(V)"].to_numpy(), np.cumsum(moved))
    steps = segment(*data, rated_capacity_ampere_hour=2.3, file_index=files)
    series = dict(zip(NAMES, data, strict=True))
    rows = capacity(series, steps, CellFacts("A", 2.3, 2.0, 3.6), whole_swing=True).rows
    assert np.isclose(rows["capacity_ampere_hour"][1], 2.0677, rtol=0.01)
    assert np.isclose(rows["coulombic_efficiency"][1], 0.9933, atol=0.005)
