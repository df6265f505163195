"""Truth of pulses and peaks against known relaxations and dQ/dV made of known bells."""

import numpy as np
import pytest

from virtual_lab import protocols, truth
from virtual_lab.behaviour import Behaviour
from virtual_lab.protocols import Step
from virtual_lab.rating import Rating

RATING = Rating(10.0, 3.0, 4.0)
FULL = {"capacity_ampere_hour": 10.0}


def _constant(value):
    return lambda second: np.full(np.shape(second), float(value))


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
    rows = truth.resistance_rows(steps, behaviours, **FULL, initial_soc=0.5)
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
    (row,) = truth.resistance_rows(steps, behaviours, **FULL)
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
