"""dQ/dV over an ageing record: which charges are taken, their rate, and what has no peaks."""

import numpy as np
import pytest
from counted import NAMES

from cellwright.protocols.ica.life import ica_life
from cellwright.refusal import Refusal
from cellwright.result import Result
from cellwright.series.steps import Steps

ROWS, CYCLES = 1500, 12


def life(peak_share=1.0):
    """Twelve charges over 1.5 h of 1 A with a held end, whose peak moves up by 2 mV a cycle."""
    volt = np.linspace(3.4, 4.1, 4001)
    current, voltage, steps, cycles = [], [], [], []
    for k in range(CYCLES):
        rise = peak_share * 1.2 * np.exp(-0.5 * ((volt - 3.7 - 0.002 * k) / 0.03) ** 2) / 0.03
        charge = np.append(0, np.cumsum((10 + rise)[1:] * np.diff(volt)))
        even = np.linspace(0, charge[-1], ROWS)
        rows = np.concatenate([np.interp(even, charge, volt), np.full(300, 4.1), np.full(200, 3.9)])
        first = k * len(rows)
        begin = first * 3.6
        voltage.append(rows)
        current.append(np.concatenate([np.ones(ROWS), np.linspace(0.98, 0.05, 300), np.zeros(200)]))
        steps.append(("CCCV", first, first + ROWS + 299, first + ROWS + 5, begin, 0.8, 0.4))
        steps.append(
            ("rest", first + ROWS + 300, first + 1999, -1, begin + 3.6 * (ROWS + 300), 0, 0)
        )
        cycles.append((k + 1, "charge", begin))
    voltage, current = np.concatenate(voltage), np.concatenate(current)
    voltage += 1e-4 * np.random.default_rng(0).standard_normal(len(voltage))
    names = ("kind", "first_row", "last_row", "cv_first_row", "start_time_second")
    names += ("current_mean_ampere", "c_rate")
    table = {n: np.array(c) for n, c in zip(names, zip(*steps, strict=True), strict=True)}
    named = ("cycle", "direction", "start_time_second")
    rows = {n: np.array(c) for n, c in zip(named, zip(*cycles, strict=True), strict=True)}
    table["end_time_second"] = np.append(table["start_time_second"][1:], len(current) * 3.6)
    time = np.arange(len(current)) * 3.6
    columns = (time, current, voltage, np.cumsum(current) * 3.6 / 3600)
    unread = dict.fromkeys(set(Steps._fields) - set(table), np.zeros(len(table["kind"])))
    return dict(zip(NAMES, columns, strict=True)), Steps(**table, **unread), rows


def test_charges_lie_evenly_over_the_life_with_the_rate_of_their_constant_current():
    found = ica_life(*life(), most=4)
    rows, curves = found.rows, found.curves
    assert [row["cycle"] for row in rows] == [1, 5, 8, 12]
    assert [row["c_rate"] for row in rows] == pytest.approx([0.5] * 4)
    wanted = [3.7 + 0.002 * (row["cycle"] - 1) for row in rows]
    np.testing.assert_allclose([row["voltage_volt"] for row in rows], wanted, atol=1e-3)
    assert sorted(set(curves["cycle"])) == [1, 5, 8, 12]


def test_a_charge_without_peaks_says_so():
    rows = ica_life(*life(peak_share=0), most=2).rows
    assert [row["peak"] for row in rows] == [0, 0]
    assert {row["reason"] for row in rows} == {"no peaks: the curve is flat"}


def test_a_record_without_a_complete_charge_is_refused():
    series, steps, cycles = life()
    cycles["direction"] = np.full(CYCLES, "discharge")
    with pytest.raises(Refusal, match="no complete charge in the ageing record"):
        ica_life(series, steps, cycles, most=4)


def test_it_takes_the_result_of_ageing_cycles_as_it_is():
    series, steps, cycles = life()
    found = ica_life(series, steps, Result({"rows": cycles}), most=2)
    assert found.rows == ica_life(series, steps, cycles, most=2).rows
