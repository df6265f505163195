"""OCV between the rests from long loads: a lent curve is mended where its shape is wrong."""

import numpy as np
import pytest
import truth
from quick import slow_but
from sheets_facts import cell_facts, measured_test

from cellwright.circuits.model_file import circuit_at, member_of, open_circuit_volt
from cellwright.identification.cell import identify
from cellwright.identification.ocv_shape import shape_records
from cellwright.records.record import record_of

CELL = cell_facts()
CAPACITY = truth.CAPACITY_AMPERE_HOUR


def wrong(soc):
    """What a lender's curve differs by: steps of its electrodes stand elsewhere [V]."""
    return 0.010 * np.exp(-(((soc - 0.55) / 0.03) ** 2)) - 0.008 * np.exp(
        -(((soc - 0.36) / 0.025) ** 2)
    )


def basis(borrowed_from="lender", branches="both", off=1.0):
    curve = {"test": "ocv", "ambient_temperature_celsius": 25.0, "branches": branches}
    curve |= {"soc": truth.OCV_SOC.tolist(), "discharge_current_ampere": None}
    curve["ocv_volt"] = (truth.OCV_VOLT + off * wrong(truth.OCV_SOC)).tolist()
    return {"capacity_ampere_hour": CAPACITY, "borrowed_from": borrowed_from, "ocv": [curve]}


def measured(name, kind, current, seed):
    time = np.arange(0.0, len(current))
    soc = truth.soc_of(time, current, 1.0)
    noise = np.random.default_rng(seed).normal(0, 3e-4, len(time))
    series = {"test_time_second": time, "current_ampere": current}
    series["voltage_volt"] = truth.voltage(time, current, soc) + noise
    series["charge_ampere_hour"] = (soc - 1.0) * CAPACITY
    return measured_test(series, name, kind, soc=1.0)


def pulses(seed):
    cycle = np.zeros(1900)
    cycle[:720], cycle[1600:1630], cycle[1750:1780] = -1.0, -3.0, 2.0
    return measured("hppc", "hppc", np.concatenate([np.zeros(60), np.tile(cycle, 8)]), seed)


def loads(seed, *, back=True):
    there, rest = np.full(6800, -1.0), np.zeros(1800)
    parts = [np.zeros(60), there, rest] + ([-there, rest] if back else [])
    return measured("capacity", "capacity", np.concatenate(parts), seed)


def error(model, soc):
    """OCV of the model as identified, with its shift over SoC, less the true one [V]."""
    sampled = circuit_at(member_of(model, "2RC")["conditions"], soc, 25.0)
    return open_circuit_volt(model, sampled, 25.0) - truth.ocv_at(soc)


def identified(tests, **curve):
    settings = {"members": ["2RC"], "split_rest_second": 120.0}
    return identify(CELL, basis(**curve), tests, **settings).content


SOC = np.linspace(0.15, 0.95, 161)


@pytest.mark.parametrize("seed", slow_but([1], [1, 2, 3]))
def test_a_lent_curve_is_mended_between_the_rests(seed):
    mended = identified([pulses(seed), loads(seed)])
    lent = identified([pulses(seed), loads(seed, back=False)])
    assert np.abs(error(lent, SOC)).max() > 4e-3
    assert np.abs(error(mended, SOC)).max() < 1.5e-3
    assert any(n.startswith("OCV between the rests from capacity") for n in mended["notes"])


def test_a_lent_curve_that_is_right_is_not_made_worse():
    right = identified([pulses(1), loads(1)], off=0.0)
    assert np.abs(error(right, SOC)).max() < 1e-3


def test_what_the_pulses_contradict_is_not_taken_from_the_long_loads():
    """The capacity test was made with a voltmeter that bends: 10 mV in the middle of the SoC."""
    test = loads(1)
    soc = 1.0 + test.series["charge_ampere_hour"] / CAPACITY
    bent = test.series["voltage_volt"] + wrong(soc)
    false = test._replace(series=test.series | {"voltage_volt": bent})
    model = identified([pulses(1), false], off=0.0)
    assert any(n.startswith("OCV between the rests not from capacity") for n in model["notes"])
    assert np.abs(error(model, SOC)).max() < 4e-3


def test_a_curve_of_the_cell_itself_stays_as_it_is():
    own = identified([pulses(1), loads(1)], borrowed_from=None)
    np.testing.assert_allclose(
        own["ocv"][0]["ocv_volt"],
        np.interp(
            np.array(own["ocv"][0]["soc"]), truth.OCV_SOC, truth.OCV_VOLT + wrong(truth.OCV_SOC)
        ),
    )
    rests = identified([pulses(1), loads(1)], borrowed_from=None, branches="rests")
    assert np.abs(error(rests, SOC)).max() < 1.5e-3


def test_loads_that_are_short_fast_or_go_one_way_show_no_shape():
    def record(*loads):
        current = np.concatenate([np.r_[np.full(s, a), np.zeros(600)] for s, a in loads])
        time = np.arange(0.0, len(current))
        return record_of(time, current, 3.5 + 0 * time, truth.soc_of(time, current, 0.9))

    def dense(*loads):
        return shape_records([record(*loads)], capacity_ampere_hour=CAPACITY)

    assert len(dense((4000, -1.0), (4000, 1.0))) == 1
    assert dense((4000, -1.0)) == []
    assert dense((1000, -1.0), (1000, 1.0)) == []
    assert dense((1400, -3.0), (1400, 3.0)) == []
    (kept,) = dense((4000, -1.0), (4000, 1.0))
    assert np.abs(np.diff(kept.soc)).max() < 0.006
