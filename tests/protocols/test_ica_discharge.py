"""dQ/dV of a discharge: the peaks of its charge, lower by what the current takes of the voltage."""

import numpy as np
import pytest

import cellwright as cw

CELL = {"cell": "A", "rated_capacity_ampere_hour": 4.0, "lower_cutoff_volt": 3.2}
CELL |= {"upper_cutoff_volt": 4.15}
VOLT = np.linspace(3.2, 4.15, 20_001)
PEAKS = ((3.55, 0.020, 0.8), (3.70, 0.025, 1.0), (3.95, 0.022, 0.6))
DENSITY = 0.8 + sum(
    area * np.exp(-0.5 * ((VOLT - at) / width) ** 2) / (width * np.sqrt(2 * np.pi))
    for at, width, area in PEAKS
)
CHARGE = np.append(0, np.cumsum((DENSITY[1:] + DENSITY[:-1]) / 2 * np.diff(VOLT)))
OHM = 0.05


def record(charge_ampere, discharge_ampere, *, pause=False):
    """Discharge from full, half an hour of rest, charge; a linear cell of OHM, rows each 20 s."""
    whole, parts = CHARGE[-1], []
    for ampere in (-discharge_ampere, charge_ampere):
        moved = np.arange(0, whole, abs(ampere) * 20 / 3600)
        held = moved if ampere > 0 else whole - moved
        volt = np.interp(held, CHARGE, VOLT) + OHM * ampere
        rest = np.interp(held[-1], CHARGE, VOLT)
        parts += [(np.full(len(moved), ampere), volt), (np.zeros(90), np.full(90, rest))]
    if pause:  # ten minutes at 40 % of the discharge, after which the linear cell goes on
        (ampere, volt), cut = parts[0], len(parts[0][0]) * 2 // 5
        rest = np.full(30, volt[cut] + OHM * discharge_ampere)
        parts[0] = [np.concatenate([ampere[:cut], np.zeros(30), ampere[cut:]])]
        parts[0].append(np.concatenate([volt[:cut], rest, volt[cut:]]))
    ampere, volt = (np.concatenate([part[k] for part in parts]) for k in range(2))
    time = 20.0 * np.arange(len(ampere))
    volt = volt + 1e-4 * np.random.default_rng(1).standard_normal(len(volt))
    charge = np.append(0, np.cumsum(ampere[1:])) * 20 / 3600
    names = ("test_time_second", "current_ampere", "voltage_volt", "charge_ampere_hour")
    return dict(zip(names, (time, ampere, volt, charge), strict=True))


def found(series, **options):
    return cw.ica_discharge(series, cw.segment(series, CELL), **options)


def test_the_peaks_of_both_directions_lie_apart_by_twice_the_drop():
    series = record(0.2, 0.2)
    steps = cw.segment(series, CELL)
    charge = cw.ica_peaks(cw.ica(series, steps)).rows
    discharge = cw.ica_discharge(series, steps)
    rows = discharge.rows
    assert len(rows["peak"]) == len(charge["peak"]) == 3
    assert rows["peak"].tolist() == [1, 2, 3]
    apart = charge["voltage_volt"] - rows["voltage_volt"]
    assert apart == pytest.approx([2 * OHM * 0.2] * 3, abs=2e-3)
    assert rows["voltage_volt"] == pytest.approx([p[0] - OHM * 0.2 for p in PEAKS], abs=2e-3)
    height = "height_ampere_hour_per_volt"
    assert rows[height] == pytest.approx(charge[height], rel=0.05)
    area = "area_ampere_hour"
    assert rows[area] == pytest.approx(charge[area], rel=0.05)
    assert discharge.c_rate == pytest.approx(0.05, rel=0.01)
    curve = discharge.curve
    assert np.all(np.diff(curve.voltage_volt) > 0)
    assert np.all(np.diff(curve.charge_ampere_hour) > 0)
    assert curve.dq_dv_ampere_hour_per_volt.min() > 0


def test_an_interrupted_discharge_is_one_and_says_so_in_its_own_words():
    result = found(record(0.2, 0.2, pause=True))
    assert len(result.rows["peak"]) == 3
    (words,) = result.notes
    assert words.startswith("the discharge was interrupted 1 × (")
    assert " at 3." in words
    assert set(result.rows["doubt"]) == {words}


def test_a_discharge_faster_than_the_charge_is_none_unless_the_whole_test_is_slow():
    series = record(0.2, 2.0)
    result = found(series)
    assert len(result.rows["peak"]) == len(result.curve.voltage_volt) == 0
    assert result.notes == (
        "no dQ/dV of a discharge: at 0.5C it is faster than the charge of the test, 0.05C",
    )
    assert len(found(series, slow=True).rows["peak"])


def test_a_charge_alone_has_none_and_a_discharge_alone_needs_no_charge():
    series = record(0.2, 0.2)
    charging = series["current_ampere"] >= 0
    discharging = ~charging | (series["test_time_second"] == 0)
    alone = {name: column[charging] for name, column in series.items()}
    (words,) = found(alone).notes
    assert "no constant-current discharge among" in words
    out = {name: column[discharging] for name, column in series.items()}
    assert len(found(out).rows["peak"]) == 3
    with pytest.raises(cw.Refusal, match="no constant-current charge"):
        cw.ica(out, cw.segment(out, CELL))
    with pytest.raises(cw.Refusal, match="no constant-current discharge"):
        cw.ica(alone, cw.segment(alone, CELL), direction="discharge")
    with pytest.raises(cw.Refusal, match="direction is 'both'"):
        cw.ica(out, cw.segment(out, CELL), direction="both")
