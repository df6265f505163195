"""Truth tables about a test, against arithmetic on known behaviours."""

from types import SimpleNamespace

import numpy as np
import pytest

from virtual_lab import protocols, truth
from virtual_lab.behaviour import Behaviour, Rating
from virtual_lab.protocols import Step

RATING = Rating(10.0, 3.0, 4.0)
CAPACITY_AMPERE_HOUR = 10.0
EMPTY_VOLT, FULL_VOLT = 3.0, 4.0
R_OHM = 0.010
FULL = {"capacity_ampere_hour": CAPACITY_AMPERE_HOUR}


def _run(steps, *, initial_soc=1.0):
    """Through currents and holds, exactly: V = 3 + z + R I, z in 10 Ah."""
    soc, behaviours = initial_soc, []
    for step in steps:
        made = _hold(step, soc) if step.kind == "hold" else _current(step, soc)
        behaviours.append(made)
        soc = float(made.soc(made.duration_second))
    return behaviours


def _current(step, soc):
    begin, ampere = EMPTY_VOLT + soc + R_OHM * step.value, step.value
    rate = ampere / CAPACITY_AMPERE_HOUR / 3600
    second = step.duration_second
    if step.until_volt is not None and rate:
        second = min(second, max((step.until_volt - begin) / rate, 0.0))
    return _behaviour(
        second,
        lambda s: np.full(np.shape(s), ampere),
        lambda s: begin + rate * np.asarray(s),
        lambda s: soc + rate * np.asarray(s),
    )


def _hold(step, soc):
    first = (step.value - EMPTY_VOLT - soc) / R_OHM
    tau = R_OHM * CAPACITY_AMPERE_HOUR * 3600
    second = tau * np.log(abs(first) / step.until_ampere)
    return _behaviour(
        second,
        lambda s: first * np.exp(-np.asarray(s) / tau),
        lambda s: np.full(np.shape(s), step.value),
        lambda s: soc + first * R_OHM * (1 - np.exp(-np.asarray(s) / tau)),
    )


def _behaviour(second, current, voltage, soc):
    return Behaviour(
        duration_second=float(second),
        current=current,
        voltage=voltage,
        temperature=lambda s: np.full(np.shape(s), 25.0),
        soc=soc,
    )


def _constant(value):
    return lambda second: np.full(np.shape(second), float(value))


def _walked(steps, **setting):
    return steps, _run(steps, **setting)


def test_capacity_from_full_to_the_cutoff_and_back():
    rows = truth.capacity_rows(*_walked(protocols.capacity(RATING)), rating=RATING)
    charge, discharge = rows
    # 5 A through 10 mohm hide 0.05 of SoC below; the hold stops 0.5 A, 0.005, short of full.
    assert [discharge["direction"], discharge["c_rate"], discharge["repeats"]] == [
        "discharge",
        0.5,
        3,
    ]
    first, others = 9.5, 9.45
    mean = (first + 2 * others) / 3
    assert discharge["capacity_ampere_hour"] == pytest.approx(mean, abs=1e-5)
    energy = first * 3.475 + 2 * others * (3.0 + 3.945) / 2
    assert discharge["energy_watt_hour"] == pytest.approx(energy / 3, abs=1e-4)
    assert charge["repeats"] == 3
    assert charge["capacity_ampere_hour"] == pytest.approx(9.45, abs=1e-5)


def test_a_held_discharge_empties_further():
    steps = protocols.capacity(RATING, repeats=1, until_c_rate=1 / 50, hold_empty=True)
    _, discharge = truth.capacity_rows(*_walked(steps), rating=RATING)
    assert discharge["capacity_ampere_hour"] == pytest.approx(10 * (1 - 0.2 * R_OHM), abs=1e-5)


def test_a_remainder_is_no_capacity():
    rows = truth.capacity_rows(*_walked(protocols.incremental_capacity(RATING)), rating=RATING)
    assert [(row["direction"], row["c_rate"]) for row in rows] == [
        ("charge", 0.05),
        ("discharge", 0.5),
    ]


def test_what_begins_half_full_is_incomplete():
    down = [protocols.discharge(RATING, 0.5)]
    assert (
        truth.capacity_rows(*_walked(down, initial_soc=0.5), rating=RATING, initial_soc=0.5) == []
    )


def test_a_discharge_stopped_by_time_is_incomplete():
    steps = [protocols.draw(RATING, 3.0), protocols.discharge(RATING, 0.5)]
    assert truth.capacity_rows(*_walked(steps), rating=RATING) == []


def test_cycles_are_counted_one_by_one():
    steps = protocols.ageing_cycles(RATING, "standard", cycles=4)
    rows = truth.cycle_rows(*_walked(steps), rating=RATING)
    assert [row["cycle"] for row in rows] == [1, 2, 3, 4]
    expected = [9.0, 8.95, 8.95, 8.95]
    assert [row["capacity_ampere_hour"] for row in rows] == pytest.approx(expected, abs=1e-5)


def test_soc_as_the_generator_knows_it_or_from_the_charge():
    _, behaviours = _walked([protocols.rest(60.0), protocols.draw(RATING, 2.0)])
    blind = [behaviour._replace(soc=None) for behaviour in behaviours]
    for known in (behaviours, blind):
        (row,) = truth.soc_rows(known, **FULL)
        assert row["soc_begin"] == 1.0
        assert row["soc_end"] == pytest.approx(0.8, abs=1e-6)


def test_all_pulses_of_a_protocol_have_the_resistance_of_the_cell():
    steps = protocols.pulses_on_discharge(RATING, CAPACITY_AMPERE_HOUR, every_second=150.0)
    rows = truth.resistance_rows(*_walked(steps), **FULL)
    assert len(rows) == sum(step.duration_second == 0.015 for step in steps)
    assert [row["resistance_ohm"] for row in rows] == pytest.approx([R_OHM] * len(rows), rel=0.01)
    soc = [row["soc"] for row in rows]
    assert soc == sorted(soc, reverse=True)
    assert soc[-1] > 0.05


def test_a_straight_voltage_has_no_peaks():
    assert truth.ica_rows(*_walked(protocols.capacity(RATING)), rating=RATING) == []


def _group(second, total, share):
    return Behaviour(
        duration_second=second,
        current=_constant(total),
        voltage=lambda s: np.where(np.asarray(s) < second, 3.5, 3.0),
        temperature=_constant(25.0),
        branches=(_constant(share), _constant(total - share)),
    )


def test_shares_of_a_group():
    steps = [
        Step("current", -10.0, 7200.0, 1.0, 3.0),
        protocols.rest(600.0),
        Step("current", 5.0, 3600.0, 1.0),
    ]
    behaviours = [_group(3600.0, -10.0, -6.5), _group(600.0, 0.0, 1.5), _group(3600.0, 5.0, 2.0)]
    rows = truth.group_rows(steps, behaviours, names=("a", "b"), capacities_ampere_hour=(6.0, None))
    assert [row["cell"] for row in rows] == ["a", "b"]
    assert [row["branch"] for row in rows] == [1, 2]
    assert [row["charge_ampere_hour"] for row in rows] == pytest.approx([6.5, 3.5])
    assert [row["current_max_ampere"] for row in rows] == pytest.approx([6.5, 3.5])
    assert [row["capacity_ampere_hour"] for row in rows] == [6.0, None]
    assert {row["group_capacity_ampere_hour"] for row in rows} == {10.0}


def _test_of(kind, steps, **specimen):
    known = {"rating": RATING, "full_ampere_hour": 10.0} | specimen
    return SimpleNamespace(
        cell="x",
        kind=kind,
        steps=steps,
        initial_soc=1.0,
        ambient_celsius=25.0,
        specimen=SimpleNamespace(**known),
    )


@pytest.mark.parametrize(
    ("kind", "tables"),
    [
        ("drive", {"soc"}),
        ("relaxation", {"soc"}),
        ("hppc", {"soc", "resistance"}),
        ("ocv", {"soc", "capacity"}),
        ("capacity", {"soc", "capacity"}),
        ("ica", {"soc", "ica"}),
        ("ageing", {"soc", "cycles"}),
    ],
)
def test_each_kind_has_its_tables(kind, tables):
    steps, behaviours = _walked(protocols.capacity(RATING, repeats=1))
    assert set(truth.rows(_test_of(kind, steps), behaviours)) == tables


def test_a_group_has_its_name_in_its_rows():
    steps = [Step("current", -10.0, 3600.0, 1.0, 3.0)]
    test = _test_of("group", steps, names=("a", "b"), capacities_ampere_hour=(6.0, 5.0))
    rows = truth.rows(test, [_group(3600.0, -10.0, -6.5)])["packs"]
    assert [row["group"] for row in rows] == ["x", "x"]
    assert [row["capacity_ampere_hour"] for row in rows] == [6.0, 5.0]


def test_a_specimen_without_a_rating_is_refused():
    steps, behaviours = _walked(protocols.capacity(RATING, repeats=1))
    with pytest.raises(ValueError, match="no rating"):
        truth.rows(_test_of("capacity", steps, rating=None), behaviours)


FULL_AMPERE_HOUR = {"capacity_ampere_hour": 10.0}


def _relaxing(ampere, before=0.0, *, duration, r0=0.002, r1=0.003, tau=5.0):
    """A step of the current on a cell with one RC pair at rest, far from its ends."""
    return Behaviour(
        duration_second=duration,
        current=_constant(ampere),
        voltage=lambda s: (
            3.7
            + ampere * r0
            + (ampere - before) * r1 * (1 - np.exp(-np.asarray(s) / tau))
            + before * r1
        ),
        temperature=_constant(25.0),
    )


@pytest.mark.parametrize(("ampere", "direction"), [(-20.0, "discharge"), (7.0, "charge")])
def test_resistance_of_a_pulse_from_rest(ampere, direction):
    steps = [protocols.rest(60.0), Step("current", ampere, 10.0, 0.5), protocols.rest(60.0)]
    durations = [60.0, 10.0, 60.0]
    behaviours = [
        _relaxing(step.value, duration=d) for step, d in zip(steps, durations, strict=True)
    ]
    rows = truth.resistance_rows(steps, behaviours, **FULL_AMPERE_HOUR, initial_soc=0.5)
    assert [row["delay_second"] for row in rows] == [0.0, 1.0, 10.0]
    seconds = np.array([0.01, 1.0, 10.0])
    expected = 0.002 + 0.003 * (1 - np.exp(-seconds / 5.0))
    np.testing.assert_allclose([row["resistance_ohm"] for row in rows], expected, rtol=1e-5)
    assert {row["direction"] for row in rows} == {direction}
    assert {row["start_time_second"] for row in rows} == {60.0}
    assert {row["soc"] for row in rows} == {0.5}


def test_resistance_of_a_pulse_on_a_running_discharge():
    steps = [Step("current", -3.0, 15.0, 1.0), Step("current", -20.0, 0.015, 0.015)]
    behaviours = [
        _relaxing(-3.0, before=-3.0, duration=15.0),
        _relaxing(-20.0, before=-3.0, duration=0.015),
    ]
    (row,) = truth.resistance_rows(steps, behaviours, **FULL_AMPERE_HOUR)
    expected = 0.002 + 0.003 * (1 - np.exp(-0.01 / 5.0))
    assert row["resistance_ohm"] == pytest.approx(expected, rel=1e-5)
    assert row["delay_second"] == 0.0


def _charged(centres_volt, widths_volt, shares, *, duration=7200.0, ampere=5.0):
    """A charge whose dQ/dV is a sum of bells (derivatives of the logistic) on a low ground."""
    volt = np.linspace(3.0, 4.2, 200_001)
    bells = 1 / (1 + np.exp(-(volt[:, None] - centres_volt) / widths_volt))
    total = ampere * duration / 3600
    charge = bells @ shares + 0.05 * (volt - 3.0)
    second = duration * (charge - charge[0]) / (charge[-1] - charge[0])
    scale = total / (charge[-1] - charge[0])
    behaviour = Behaviour(
        duration_second=duration,
        current=_constant(ampere),
        voltage=lambda s: np.interp(s, second, volt),
        temperature=_constant(25.0),
    )
    return behaviour, scale


def test_peaks_stand_where_they_were_put():
    centres, widths, shares = np.array([3.5, 3.7, 4.0]), 0.015, np.array([0.3, 0.4, 0.2])
    behaviour, scale = _charged(centres, widths, shares)
    steps = [Step("current", 5.0, 7200.0, 10.0)]
    rows = truth.ica_rows(steps, [behaviour], rating=RATING)
    assert [row["peak"] for row in rows] == [1, 2, 3]
    np.testing.assert_allclose([row["voltage_volt"] for row in rows], centres, atol=5e-4)
    heights = scale * (shares / widths / 4 + 0.05)
    found = [row["height_ampere_hour_per_volt"] for row in rows]
    np.testing.assert_allclose(found, heights, rtol=0.005)


def test_a_plateau_of_millivolts_is_a_peak_of_its_height():
    behaviour, scale = _charged(np.array([3.35]), 0.001, np.array([0.9]))
    (row,) = truth.ica_rows([Step("current", 5.0, 7200.0, 10.0)], [behaviour], rating=RATING)
    assert row["voltage_volt"] == pytest.approx(3.35, abs=2e-4)
    expected = scale * (0.9 / 0.001 / 4 + 0.05)
    assert row["height_ampere_hour_per_volt"] == pytest.approx(expected, rel=0.005)
