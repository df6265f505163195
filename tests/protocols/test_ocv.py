"""Slow OCV: a known curve behind resistance, hysteresis and losses; A123 against Plett's table."""

import re

import numpy as np
import pytest
from counted import series_of
from hypothesis import given, settings
from hypothesis import strategies as st

from cellwright.numerics.turns import turning_points
from cellwright.protocols.ocv.legs import legs_of
from cellwright.protocols.ocv.slow import joined, slow_ocv, slowest_load
from cellwright.refusal import Refusal

CUTOFFS = {"lower_cutoff_volt": 3.0, "upper_cutoff_volt": 4.2}
CAPACITY, CURRENT, RESISTANCE = 2.0, 0.1, 0.05


def true_ocv(soc):
    return 3.02 + 1.15 * soc + 0.08 * np.sin(3 * np.pi * soc) * soc * (1 - soc)


def ramp(start, stop, *, current=CURRENT, resistance=RESISTANCE, hysteresis=0.0, step_second=60):
    """Current and voltage while the SoC runs from start to stop, one row per step of time."""
    sign = np.sign(stop - start)
    count = round(abs(stop - start) * CAPACITY / current * 3600 / step_second)
    soc = np.linspace(start, stop, count + 1)[1:]
    drop = sign * (current * resistance + hysteresis)
    return np.full(count, sign * current), true_ocv(soc) + drop


def rest(soc, count=30):
    return np.zeros(count), np.full(count, float(true_ocv(soc)))


def record(*pieces, step_second=60):
    """Series as `slow_ocv` takes it, from pieces of (current, voltage)."""
    current = np.concatenate([piece[0] for piece in pieces])
    voltage = np.concatenate([piece[1] for piece in pieces])
    time = step_second * np.arange(len(current), dtype=float)
    return time, current, voltage, np.cumsum(current) * step_second / 3600


def both(**settings):
    down, up = ramp(1, 0, **settings), ramp(0, 1, **settings)
    return record(rest(1), down, rest(0), up, rest(1))


def test_mean_of_the_branches_is_the_truth_behind_resistance_and_hysteresis():
    curve = slow_ocv(series_of(*both(hysteresis=0.01)), **CUTOFFS)
    np.testing.assert_allclose(curve.ocv_volt, true_ocv(curve.soc), atol=2e-3)
    np.testing.assert_allclose(curve.half_gap_volt[5:-5], 0.015, atol=1e-3)
    assert (curve.branches, curve.joined_by, curve.note) == ("both", "mean", "")
    assert curve.capacity_ampere_hour == pytest.approx(CAPACITY, rel=1e-3)
    assert (curve.discharge_current_ampere, curve.charge_current_ampere) == (-CURRENT, CURRENT)
    assert curve.measured_soc == (0, 1)
    assert np.isnan(curve.step_volt), "a minute between two rows: the cell relaxes in it"


def test_what_comes_at_once_as_the_current_starts_and_stops_is_its_resistance():
    down, up = (ramp(*ends, step_second=10) for ends in ((1, 0), (0, 1)))
    columns = record(rest(1), down, rest(0), up, rest(1), step_second=10)
    found = slow_ocv(series_of(*columns), **CUTOFFS).step_volt
    assert found == pytest.approx(CURRENT * RESISTANCE, abs=3e-4)


@pytest.mark.parametrize("missing", ["charge", "discharge", "both"])
@pytest.mark.parametrize("end", [0, -1])
def test_where_a_branch_does_not_reach_the_other_tells_the_end(missing, end):
    """A charge that takes 5 % more than the discharge gave has no voltage at empty."""
    soc = np.linspace(0.0, 1.0, 201)
    branches = {"discharge": true_ocv(soc) - 0.01, "charge": true_ocv(soc) + 0.01}
    for name in branches if missing == "both" else (missing,):
        branches[name][end] = np.nan
    ocv, measured = joined(soc, branches["discharge"], branches["charge"], None, None, "mean")
    edge = end if missing != "both" else 1 if end == 0 else -2
    assert ocv[end] == pytest.approx(true_ocv(soc[edge]), abs=1e-9)
    assert not measured[end]
    assert measured[1:-1].all()


@settings(max_examples=15, deadline=None)
@given(st.floats(0, 3e-3), st.integers(0, 2**32 - 1))
def test_noise_never_makes_the_table_fall(noise, seed):
    time, current, voltage, charge = both()
    voltage = voltage + noise * np.random.default_rng(seed).standard_normal(len(voltage))
    curve = slow_ocv(series_of(time, current, voltage, charge), **CUTOFFS)
    assert (np.diff(curve.ocv_volt) > 0).all()
    assert curve.moved_volt < 10 * noise + 2e-6
    assert np.abs(curve.ocv_volt - true_ocv(curve.soc))[2:-2].max() < 3e-3 + 2 * noise


def test_discharge_alone_keeps_its_overpotential_for_the_models():
    curve = slow_ocv(series_of(*record(rest(1), ramp(1, 0), rest(0))), **CUTOFFS)
    expected = true_ocv(curve.soc) - CURRENT * RESISTANCE
    np.testing.assert_allclose(curve.ocv_volt, expected, atol=2e-3)
    assert (curve.branches, curve.joined_by) == ("discharge", "single")
    assert np.isnan(curve.charge_volt).all()
    assert np.isnan(curve.half_gap_volt).all()


def test_charge_alone():
    curve = slow_ocv(series_of(*record(rest(0), ramp(0, 1), rest(1))), **CUTOFFS)
    assert curve.branches == "charge"
    assert curve.capacity_ampere_hour == pytest.approx(CAPACITY, rel=1e-3)
    assert np.isnan(curve.discharge_current_ampere)


def test_charge_that_ends_at_a_hold_is_extended_by_the_gap():
    """As in the Leaf record: leads of high resistance, the charge is held from 60 % on."""
    hold = 0.5 * CURRENT * np.ones(960), np.full(960, 4.2)
    down, up = ramp(1, 0, resistance=5.0), ramp(0, 0.6, resistance=5.0)
    series = record(rest(1), down, rest(0), up, hold, rest(1))
    curve = slow_ocv(series_of(*series), lower_cutoff_volt=2.52, upper_cutoff_volt=4.2)
    np.testing.assert_allclose(curve.ocv_volt, true_ocv(curve.soc), atol=4e-3)
    assert curve.measured_soc == pytest.approx((0, 0.6), abs=0.006)
    assert np.isnan(curve.charge_volt[curve.soc > 0.61]).all()


def test_four_files_count_the_remainder_but_show_only_the_slow_voltages():
    """Cold test: both branches end early and are completed at room temperature."""
    fast = {"current": 0.5, "resistance": 0.0}
    files = [
        (rest(1), ramp(1, 0.1, hysteresis=0.02)),
        (rest(0.1), ramp(0.1, 0, **fast), rest(0)),
        (rest(0), ramp(0, 0.9, hysteresis=0.02)),
        (rest(0.9), ramp(0.9, 1, **fast), rest(1)),
    ]
    series = record(*(piece for pieces in files for piece in pieces))
    lengths = [sum(len(piece[0]) for piece in pieces) for pieces in files]
    settings = {"lower_cutoff_volt": 3.1, "upper_cutoff_volt": 4.1}
    curve = slow_ocv(series_of(*series) | {"file_index": np.repeat(range(4), lengths)}, **settings)
    assert curve.joined_by == "equilibrium"
    assert curve.capacity_ampere_hour == pytest.approx(CAPACITY, rel=1e-3)
    assert np.isnan(curve.discharge_volt[curve.soc < 0.09]).all()
    assert np.isnan(curve.charge_volt[curve.soc > 0.91]).all()
    assert curve.ocv_volt[100] == pytest.approx(true_ocv(0.5), abs=2e-3)
    np.testing.assert_allclose(curve.ocv_volt, true_ocv(curve.soc), atol=0.025)
    mean = slow_ocv(
        series_of(*series), **settings
    )  # as one file: no branch is known to be conditioned
    np.testing.assert_allclose(mean.ocv_volt, true_ocv(mean.soc), atol=3e-3)


def test_the_first_of_several_cycles_is_taken():
    pieces = [rest(1), ramp(1, 0), rest(0), ramp(0, 1), rest(1)]
    worse = [ramp(1, 0, hysteresis=0.03), rest(0), ramp(0, 1, hysteresis=0.03), rest(1)]
    once, twice = (
        slow_ocv(series_of(*record(*pieces)), **CUTOFFS),
        slow_ocv(series_of(*record(*pieces, *worse)), **CUTOFFS),
    )
    np.testing.assert_allclose(once.discharge_volt, twice.discharge_volt)
    np.testing.assert_allclose(once.charge_volt, twice.charge_volt)


def test_an_offset_of_the_current_is_noted_and_does_not_shift_the_branches():
    time, current, voltage, _ = both()
    read = np.where(current == 0, 0.0, current - 0.005)
    charge = np.cumsum(read) / 60
    curve = slow_ocv(series_of(time, read, voltage, charge), **CUTOFFS)
    np.testing.assert_allclose(curve.ocv_volt, true_ocv(curve.soc), atol=2e-3)
    assert "an offset of -5 mA" in curve.note
    assert "capacity then 2 Ah" in curve.note
    assert "self-discharge" not in curve.note  # which takes from the cell, and gives nothing


def leaking(leak, *, hold_hour=10.0, first_soc=1.0):
    """A slow discharge, charge and hold of a cell that leaks: the log counts what the leads carry.

    At the end the hold feeds nothing but the leak.
    """
    down = ramp(first_soc, 0, current=CURRENT + leak)
    up = ramp(0, 1, current=CURRENT - leak)
    count = round(hold_hour * 60)
    legs = [
        (np.full(len(down[0]), -CURRENT), down[1]),
        rest(0),
        (np.full(len(up[0]), CURRENT), up[1]),
        (np.full(count, leak), np.full(count, up[1][-1])),
    ]
    return record(rest(first_soc), *legs, rest(1))


@pytest.mark.parametrize("leak", [0.004, 0.015])
def test_a_leak_shifts_neither_the_branches_nor_the_capacity(leak):
    """With 15 % of the slow current the discharge gives two thirds of what the charge takes."""
    curve = slow_ocv(series_of(*leaking(leak)), **CUTOFFS)
    assert curve.branches == "both"
    assert curve.capacity_ampere_hour < 0.97 * CAPACITY < 1.03 * CAPACITY
    assert curve.charge_capacity_ampere_hour > 1.03 * CAPACITY
    assert curve.closed_capacity_ampere_hour == pytest.approx(CAPACITY, rel=2e-3)
    np.testing.assert_allclose(curve.ocv_volt[1:-1], true_ocv(curve.soc)[1:-1], atol=2e-3)
    said = re.search(r"offset of \+([\d.]+) mA in .*, or as much self-discharge,", curve.note)
    assert float(said[1]) == pytest.approx(1e3 * leak, rel=0.01)


def test_a_discharge_that_did_not_begin_full_is_no_branch_of_a_leaking_cell():
    curve = slow_ocv(series_of(*leaking(0.0, hold_hour=0.0, first_soc=0.7)), **CUTOFFS)
    assert curve.branches == "charge"
    assert curve.closed_capacity_ampere_hour == curve.capacity_ampere_hour
    assert curve.capacity_ampere_hour == pytest.approx(CAPACITY, rel=1e-3)


@pytest.mark.parametrize(("short_of", "branches"), [(0.01, "both"), (0.1, "charge")])
def test_a_discharge_that_ends_before_its_cut_off_is_the_way_back_of_a_full_charge(
    short_of, branches
):
    """It ends 45 mV above the cut-off; what the charge then takes says whether it was empty."""
    down, up = ramp(1, short_of), ramp(0.0, 1)
    cutoffs = CUTOFFS | {"lower_cutoff_volt": down[1][-1] - 0.045}
    curve = slow_ocv(series_of(*record(rest(1), down, rest(short_of), up, rest(1))), **cutoffs)
    assert curve.branches == branches


def test_turning_points_ignore_a_dither():
    course = np.concatenate([np.linspace(0, -2, 50), -2 + 0.01 * (-1.0) ** np.arange(20)])
    course = np.concatenate([course, np.linspace(-2, 1, 50)])
    rows = turning_points(course, least=0.1)
    assert len(rows) == 3
    np.testing.assert_allclose(course[rows], [0, -2.01, 1])


@pytest.mark.parametrize(
    ("pieces", "reason"),
    [
        ((rest(1), ramp(1, 0, current=0.5)), "2 Ah at -0.5 A"),
        ((rest(1), ramp(1, 0.3), rest(0.3)), "to 3.36"),
        ((rest(1), rest(1)), "found no current"),
    ],
)
def test_what_is_no_slow_full_branch_is_refused(pieces, reason):
    with pytest.raises(Refusal, match=reason):
        slow_ocv(series_of(*record(*pieces)), **CUTOFFS)


def test_branches_that_do_not_overlap_are_refused():
    """The charge is held from 30 % on: no charge voltage at half."""
    taper = CURRENT * np.exp(-np.arange(6000) / 840)  # 1.4 Ah
    pieces = rest(1), ramp(1, 0), rest(0), ramp(0, 0.3), (taper, np.full(6000, 3.38)), rest(1)
    with pytest.raises(Refusal, match="do not overlap at 50 %"):
        slow_ocv(series_of(*record(*pieces)), lower_cutoff_volt=3.01, upper_cutoff_volt=3.38)
    time, current, voltage, charge = record(*pieces)
    leg = legs_of(time, current, voltage, charge, np.zeros(len(time), int))[0]
    soc, nothing = np.linspace(0, 1, 201), np.full(201, np.nan)
    with pytest.raises(Refusal, match="do not overlap at 50 %"):
        joined(soc, true_ocv(soc), nothing, leg, leg, "equilibrium")


def read_a123(folder, temperature):
    import pandas

    parts, offset = [], (0.0, 0.0)
    for script in (1, 2, 3, 4):
        frame = pandas.read_csv(folder / f"A123_OCV_{temperature}_S{script}.csv.gz")
        time = frame["Test_Time(s)"].to_numpy()
        charge = (frame["Charge_Capacity(Ah)"] - frame["Discharge_Capacity(Ah)"]).to_numpy()
        columns = [time - time[0] + offset[0], frame["Current(A)"], frame["Voltage(V)"]]
        parts.append([*columns, charge - charge[0] + offset[1], np.full(len(time), script - 1)])
        offset = parts[-1][0][-1] + 3600, parts[-1][3][-1]
    return [np.concatenate(column) for column in zip(*parts, strict=True)]


def test_a123_at_25_degrees_meets_the_published_table(shared):
    *series, files = read_a123(shared / "campaigns/a123/raw/ocv", "P25")
    curve = slow_ocv(
        series_of(*series) | {"file_index": files}, lower_cutoff_volt=2.0, upper_cutoff_volt=3.6
    )
    soc = np.linspace(0.1, 0.9, 9)
    published = [3.1810, 3.2453, 3.2869, 3.2992, 3.3051, 3.3090, 3.3195, 3.3377, 3.3437]
    np.testing.assert_allclose(np.interp(soc, curve.soc, curve.ocv_volt), published, atol=5e-3)
    assert curve.capacity_ampere_hour == pytest.approx(2.0726, rel=0.01)


def test_a123_in_the_cold_has_gaps_in_its_branches_but_none_in_its_ocv(shared):
    *series, files = read_a123(shared / "campaigns/a123/raw/ocv", "N25")
    curve = slow_ocv(
        series_of(*series) | {"file_index": files}, lower_cutoff_volt=2.0, upper_cutoff_volt=3.6
    )
    assert curve.capacity_ampere_hour == pytest.approx(2.0677, rel=0.01)
    assert np.isnan(curve.charge_volt[-1])
    assert (np.diff(curve.ocv_volt) > 0).all()


@pytest.mark.parametrize(
    ("lower", "upper", "named"),
    [(3.0, None, "the upper"), (None, 4.2, "the lower"), (None, None, "the lower cut-off and the")],
)
def test_a_cutoff_that_is_not_stated_is_named(lower, upper, named):
    with pytest.raises(Refusal, match=f"{named} .*is not stated, so no slow curve"):
        slow_ocv(series_of(*both()), lower_cutoff_volt=lower, upper_cutoff_volt=upper)


def test_a_discharge_that_does_not_start_full_is_no_branch():
    """From 90 % down, then a full charge: which is right, the charge after it tells."""
    columns = record(rest(0.9), ramp(0.9, 0), rest(0), ramp(0, 1), rest(1))
    curve = slow_ocv(series_of(*columns), **CUTOFFS)
    assert curve.branches == "charge"
    assert curve.closed_capacity_ampere_hour == pytest.approx(CAPACITY, rel=1e-3)
    assert "its first discharge: it does not start full: it lacked 10.0%" in curve.note


def test_a_branch_that_the_sheet_starts_elsewhere_is_no_full_one():
    columns = record(rest(0.4), ramp(0.4, 1), rest(1))
    with pytest.raises(Refusal, match=r"its first charge: .* after a rest at"):
        slow_ocv(series_of(*columns), **CUTOFFS)
    assert slow_ocv(series_of(*columns), **CUTOFFS, state_before="empty").branches == "charge"
    with pytest.raises(Refusal, match=r"its first charge: .* the sheet states an SoC of 0\.4"):
        slow_ocv(series_of(*columns), **CUTOFFS, soc_at_start=0.4)


def test_a_test_between_two_other_voltages_gives_no_scale():
    """Its charge moves what its discharge does, and both leave out the highest tenth."""
    columns = record(rest(0.9), ramp(0.9, 0), rest(0), ramp(0, 0.9), rest(0.9))
    with pytest.raises(Refusal, match=r"its first discharge: .* may not start full"):
        slow_ocv(series_of(*columns), **CUTOFFS)
    with pytest.raises(Refusal, match=r"the sheet states an SoC of 0\.9"):
        slow_ocv(series_of(*columns), **CUTOFFS, soc_at_start=0.9)


def turned(rates):
    """Discharges and charges between both ends, one after the other, at these rates [1/h]."""
    pieces, soc = [rest(1)], 1.0
    for rate in rates:
        end = 0.0 if rate < 0 else 1.0
        pieces += [ramp(soc, end, current=abs(rate) * CAPACITY, step_second=20), rest(end)]
        soc = end
    return record(*pieces, step_second=20)


@pytest.mark.parametrize(
    ("rates", "wanted"),
    [
        ((-0.5, 0.5, -0.1, 0.1), (-0.1, 0.1)),
        ((-0.1, 0.1, -0.5, 0.5), (-0.1, 0.1)),
        ((-1.0, 0.5, -0.2, 0.5), (-0.2, np.nan)),
        ((-0.2, 0.5, -0.1, 0.5), (-0.1, np.nan)),
        ((-0.5, 0.5), (-0.5, 0.5)),
    ],
)
def test_the_slowest_load_of_a_rate_test_is_the_slowest(rates, wanted):
    """And its opposite only where both have one rate."""
    curve = slowest_load(series_of(*turned(rates)), **CUTOFFS)
    found = curve.discharge_current_ampere, curve.charge_current_ampere
    np.testing.assert_allclose(found, np.array(wanted) * CAPACITY, rtol=1e-6)
