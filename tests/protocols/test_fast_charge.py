"""Fast charge: what went in, when, and what limited it."""

import numpy as np
import pytest
from counted import NAMES, counted

import cellwright as cw
from cellwright.laws.points import fast_charge_points
from cellwright.protocols.fast_charge import fast_charge
from cellwright.records.facts import CellFacts
from cellwright.refusal import Refusal
from cellwright.series.steps import segment
from runtime import artefact

HELD_SOC = 0.6


def series(*, ampere=4.0, soc=0.0, full=2.0, minutes=30.0, held=HELD_SOC, begin_full=False):
    """2C to 4.2 V at the held SoC, then a current that halves every 6 min; 4.2 V = limit."""
    step, current, voltage = 5.0, [0.0] * 30, [4.2 if begin_full else 3.0 + soc] * 30
    if begin_full:
        current += [-1.0] * 1440
        voltage += list(np.linspace(4.1, 3.0, 1440))
        current += [0.0] * 30
        voltage += [3.0] * 30
    start = soc
    for k in range(int(minutes * 60 / step)):
        over = max(0.0, k * step / 60 - (held - start) * full / ampere * 60)
        now = ampere * 0.5 ** (over / 6)
        soc += now * step / 3600 / full
        current.append(now)
        voltage.append(4.2 if over > 0 else 3.1 + soc)
    current += [0.0] * 30
    voltage += [4.1] * 30
    time, current = np.arange(len(current)) * step, np.array(current)
    return {
        "test_time_second": time,
        "current_ampere": current,
        "voltage_volt": np.array(voltage),
        "charge_ampere_hour": counted(time, current),
        "surface_temperature_celsius": 20 + 10 * np.arange(len(current)) / len(current),
    }


BASIS = {"capacity_ampere_hour": 2.0, "ocv": []}


def run(columns, *, upper=4.2, **settings):
    """Row and notes of a charge."""
    steps = segment(*[columns[name] for name in NAMES], rated_capacity_ampere_hour=2.0)
    cell = CellFacts("A", 2.0, 3.0, upper)
    found = fast_charge(columns, steps, BASIS, cell, **settings)
    return found.rows[0], list(found.notes)


def test_charge_shares_and_times():
    charged, notes = run(series(begin_full=True))
    # 0.6 at 2C in 18 min; then 4 A · 6/ln 2 min · (1 − 2^(−12/6)).
    held = 4 * 6 / np.log(2) / 60 * (1 - 0.25) / 2
    assert charged["share"] == pytest.approx(0.6 + held, abs=0.01)
    assert charged["constant_current_share"] == pytest.approx(0.6 / (0.6 + held), abs=0.01)
    assert charged["constant_current_share"] + charged["constant_voltage_share"] == pytest.approx(1)
    assert charged["minutes_constant_current"] == pytest.approx(18, abs=0.2)
    over = -6 * np.log2(1 - 0.2 * 2 * 60 * np.log(2) / 24)
    assert charged["minutes_to_80"] == pytest.approx(18 + over, abs=0.3)
    assert charged["c_rate"] == pytest.approx(2)
    assert charged["warming_kelvin"] > 0
    assert charged["from_empty"]
    assert not notes


def test_the_time_is_a_setting_and_a_shorter_charge_says_so():
    charged, _ = run(series(begin_full=True), minutes=9.0)
    assert charged["share"] == pytest.approx(0.3, abs=0.01)
    short, notes = run(series(begin_full=True, minutes=10.0))
    assert short["share"] == pytest.approx(1 / 3, abs=0.01)
    assert np.isnan(short["minutes_to_80"])
    assert any("ends after 10.0 min, before 30 min" in note for note in notes)
    assert any("80 % is not reached" in note for note in notes)


def test_a_charge_from_half_full_has_no_time_to_80():
    charged, notes = run(series(soc=0.3))
    assert not charged["from_empty"]
    assert np.isnan(charged["minutes_to_80"])
    assert any("not known to be empty" in note for note in notes)


def test_in_the_cold_the_limit_is_met_at_once():
    charged, _ = run(series(begin_full=True, held=0.001))
    assert charged["constant_current_share"] < 0.02
    assert charged["c_rate"] == pytest.approx(2, rel=0.05)


def test_refusals_by_name():
    with pytest.raises(Refusal, match="upper cut-off is not stated"):
        run(series(), upper=None)
    still = series()
    still = still | {"charge_ampere_hour": 0 * still["charge_ampere_hour"]}
    with pytest.raises(Refusal, match="no charge of at least 2 %"):
        run(still)


def test_points_over_temperature_of_one_rate_as_the_contract_allows(tmp_path):
    row = run(series(begin_full=True))[0]
    rows = [
        row | {"ambient_temperature_celsius": celsius, "cycle": None, "share": share}
        for celsius, share in ((25.0, 0.9), (0.0, 0.6), (-20.0, 0.2))
    ]
    points = fast_charge_points([*rows, rows[0] | {"from_empty": False}])
    shares = [p.value for p in points if p.quantity.startswith("share charged")]
    ratios = [p.value for p in points if p.quantity.startswith("charged over")]
    assert shares == [0.9, 0.6, 0.2]
    assert ratios == pytest.approx([9, 1.5, 0.25])
    assert len({p.quantity for p in points}) == 4
    points = cw.fast_charge_laws(rows).points
    path = tmp_path / "results" / "fast_charge_points" / "T1.parquet"
    artefact.write(path, points, {"reason": None})
    assert list(artefact.load(path)["quantity"]) == [row["quantity"] for row in points]
