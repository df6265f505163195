"""A model from constant-current loads alone, or a reason: the truth back on a drive never seen."""

import numpy as np
import pytest
from sheets_facts import cell_facts, measured_test

import cellwright as cw
from cellwright.refusal import Refusal

CAPACITY = 2.0
SOC = np.linspace(0.0, 1.0, 401)
OCV = 3.0 + 0.35 * (1 - np.exp(-SOC / 0.03)) + 0.75 * SOC + 0.05 * np.sin(8 * SOC)
CUTOFFS = {"lower_cutoff_volt": 3.0, "upper_cutoff_volt": float(OCV[-1])}
CELL = cell_facts(*CUTOFFS.values(), rated=CAPACITY)
SETTINGS = {"members": ["1RC", "2RC", "DRT"]}
OHM = (0.025, 0.012, 0.018)  # R0 and two pairs at 50 % SoC
TAU = (20.0, 400.0)


def resistance(soc):
    """Factor on all resistances over SoC."""
    return 1.0 + 0.8 * np.exp(-np.maximum(soc, 0.0) / 0.15)


def simulated(current, step=5.0):
    """Voltage of R0 and two RC pairs, by exact steps of a held current; it ends at the cut-off."""
    soc, state, rows = 1.0, np.zeros(2), []
    decay = np.exp(-step / np.array(TAU))
    for ampere in current:
        volt = np.interp(soc, SOC, OCV) + OHM[0] * resistance(soc) * ampere + state.sum()
        if ampere < 0 and volt < CUTOFFS["lower_cutoff_volt"]:
            break
        rows.append((ampere, volt, soc))
        gain = np.array(OHM[1:]) * resistance(soc)
        state = decay * state + (1 - decay) * gain * ampere
        soc += ampere * step / 3600.0 / CAPACITY
    ampere, volt, soc = np.array(rows).T
    noise = np.random.default_rng(len(rows)).normal(0, 3e-4, len(rows))
    return {
        "test_time_second": step * np.arange(len(rows)),
        "current_ampere": ampere,
        "voltage_volt": volt + noise,
        "charge_ampere_hour": (soc - 1.0) * CAPACITY,
    }


def load(c_rate, name=None, *, step=5.0, **facts):
    rows = int(3600.0 / step * 1.2 / c_rate)
    current = np.r_[np.zeros(int(120.0 / step)), np.full(rows, -c_rate * CAPACITY)]
    return measured_test(simulated(current, step), name or f"load_{c_rate:g}C", "capacity", **facts)


def drive(seed, seconds=5000, **facts):
    """A staircase of discharge and charge that never rests."""
    rng = np.random.default_rng(seed)
    current = np.repeat(rng.uniform(-4.0, 1.5, seconds // 20), 4)
    current[np.abs(current) < 0.1] = 0.1
    return measured_test(simulated(np.r_[0.0, current]), f"drive_{seed}", "drive", **facts)


def slow_basis():
    """Basis from a true OCV curve, as a slow test both ways would give it."""
    curve = {"soc": SOC.tolist(), "ocv_volt": OCV.tolist(), "branches": "both", "test": "ocv"}
    curve |= {"ambient_temperature_celsius": 25.0, "discharge_current_ampere": None}
    curve |= {"half_gap_volt": np.full(len(SOC), 0.002).tolist(), "discharge_volt": OCV.tolist()}
    return {"capacity_ampere_hour": CAPACITY, "borrowed_from": None, "ocv": [curve]}


def own_basis(loads):
    """Basis of a cell that has nothing slower than these loads."""
    facts = [test.facts._replace(soc=None) for test in loads]
    curves = [
        (of, cw.ocv_from_load(test.series, CELL, of)) for of, test in zip(facts, loads, strict=True)
    ]
    return cw.basis(CELL, rests=curves)


def identified(basis, tests):
    model = cw.identify(CELL, basis, tests, **SETTINGS)
    return cw.finish_model(CELL, model, basis, tests)


def chosen(model):
    """The chosen member."""
    members = {member["model"]: member for member in model.content["members"]}
    return members[model.content["chosen"]]


def steady(model):
    """SoC, steady resistance and its deviation of the chosen member [ohm]."""
    rows = [
        row
        for row in model.parameters
        if row["model"] == model.content["chosen"] and row["parameter"] == "steady_resistance"
    ]
    return np.array([[row[name] for name in ("soc", "value", "std")] for row in rows], float).T


def error(model, test):
    """Error of the chosen member over 5 to 95 % SoC [V]."""
    scores = cw.validate(*cw.held_out(model, test.series, test.facts, CELL))
    (row,) = [row for row in scores.rows if row["chosen"]]
    return row["rmse_volt_soc_5_95"]


def test_loads_at_three_rates_beside_an_ocv_give_the_total_resistance():
    model = identified(slow_basis(), [load(rate) for rate in (0.5, 1.0, 2.0)])
    assert model.content["kind"] == "capacity"
    soc, value, std = steady(model)
    inner = (soc > 0.2) & (soc < 0.85)
    true = sum(OHM) * resistance(soc)
    np.testing.assert_allclose(value[inner], true[inner], rtol=0.05)
    assert (np.abs(value - true)[inner] < 3 * std[inner]).all()
    assert std[inner].max() < 0.1 * true[inner].min()
    assert error(model, drive(1, role="validation", soc=1.0)) < 0.008


def test_rows_a_minute_apart_tell_the_sum_of_resistances_and_not_its_parts():
    """R0 and the pair of 20 s have both settled by the first row of a load."""
    slow = [load(rate, step=60.0) for rate in (0.5, 1.0, 2.0)]
    model = identified(slow_basis(), slow)
    (entry,) = chosen(model)["conditions"]
    inner = (np.array(entry["soc"]) > 0.2) & (np.array(entry["soc"]) < 0.85)
    parts = [entry["r0_std_ohm"], *(branch["r_std_ohm"] for branch in entry["branches"])]
    worst = np.nanmax(np.array(parts, float)[:, inner])
    assert worst > 3 * np.max(np.array(entry["steady_std_ohm"])[inner])


def test_the_slowest_load_stands_for_an_ocv_that_nothing_tells():
    loads = [load(rate) for rate in (0.2, 1.0, 2.0)]
    basis = own_basis(loads)
    (curve,) = basis.content["ocv"]
    assert (curve["test"], curve["branches"]) == ("load_0.2C", "discharge")
    assert basis.content["capacity_source"] == "long load load_0.2C"
    model = identified(basis, loads)
    soc, value, _ = steady(model)
    inner = (soc > 0.25) & (soc < 0.85)
    true = sum(OHM) * resistance(1 - (1 - soc) * basis.content["capacity_ampere_hour"] / CAPACITY)
    np.testing.assert_allclose(value[inner], true[inner], rtol=0.12)
    assert error(model, drive(1, role="validation", soc=1.0)) < 0.02


def test_loads_at_one_rate_are_refused_where_one_of_them_is_the_ocv():
    loads = [load(1.0, "first"), load(1.0, "second")]
    with pytest.raises(Refusal, match="one rate cannot tell OCV and resistance apart; wanted"):
        cw.identify(CELL, own_basis(loads), loads, **SETTINGS)


def test_of_one_load_beside_a_slow_test_the_deviation_says_how_little_it_tells():
    """A resistance and an OCV that is off change the voltage of one steady load alike."""
    model = identified(slow_basis(), [load(1.0)])
    soc, value, std = steady(model)
    inner = (soc > 0.25) & (soc < 0.75)
    true = sum(OHM) * resistance(soc)
    assert (np.abs(value - true)[inner] < 2 * std[inner]).all()
    assert std[inner].min() > 0.3 * true[inner].max()
    assert error(model, drive(1, role="validation", soc=1.0)) < 0.015


@pytest.mark.parametrize("role", ["fit", "split"])
def test_a_drive_that_never_rests_gives_a_model(role):
    own = drive(2, role=role, soc=1.0)
    model = identified(slow_basis(), [own])
    (entry,) = chosen(model)["conditions"]
    soc = np.array(entry["soc"])
    inner = (soc > 0.25) & (soc < 0.85)
    fast = np.array(entry["r0_ohm"])[inner]
    np.testing.assert_allclose(fast, OHM[0] * resistance(soc[inner]), rtol=0.2)
    assert error(model, drive(1, role="validation", soc=1.0)) < 0.006
    if role == "split":
        assert error(model, own) < 0.006


def test_a_drive_without_an_ocv_or_a_start_is_refused_in_words():
    bare = {"capacity_ampere_hour": CAPACITY, "borrowed_from": None, "ocv": []}
    with pytest.raises(Refusal, match="no OCV curve: no slow test of the cell or its type"):
        cw.identify(CELL, bare, [drive(2, soc=1.0)], **SETTINGS)
    moving = drive(2)
    rows = slice(5, None)
    moving = moving._replace(series={name: c[rows] for name, c in moving.series.items()})
    with pytest.raises(Refusal, match="not fitted: drive_2: no state of charge: none is stated"):
        cw.identify(CELL, slow_basis(), [moving], **SETTINGS)


def test_a_model_that_misses_what_was_left_out_by_far_says_so():
    from cellwright.identification.choice import Score, choose

    bad = choose({"1RC": [Score(np.full(4, 0.15**2), np.full(4, 10))]})
    assert "by 150 mV RMS, more than 100 mV: do not use it" in bad.words
    fair = choose({"1RC": [Score(np.full(4, 0.05**2), np.full(4, 10))]})
    assert "do not use it" not in fair.words


def test_of_a_discharge_and_a_slower_charge_the_charge_alone_stands_for_the_ocv():
    """The mean of legs at two rates would be off by half of what the rates differ by."""
    down = np.full(690, -CAPACITY)
    up = np.full(7000, 0.1 * CAPACITY)
    record = simulated(np.r_[np.zeros(24), down, np.zeros(24), up])
    full = np.flatnonzero(record["voltage_volt"] >= CUTOFFS["upper_cutoff_volt"])
    end = full[full > 800][0] + 1
    record = {name: column[:end] for name, column in record.items()}
    curve = cw.ocv_from_load(record, CELL, {"test": "both", "kind": "ica"}).curve
    assert (curve.branches, curve.charge_current_ampere) == ("charge", pytest.approx(0.2))
