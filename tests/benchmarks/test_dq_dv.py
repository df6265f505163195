"""Rival methods of dQ/dV, which benchmarks compare: each finds the peaks of a known curve."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))
from capacity_slope import SLOPE, TOPS, VOLT, record
from dq_dv.adaptive import Adaptive, adaptive_capacity
from dq_dv.binned import binned_capacity, counted_capacity
from dq_dv.on_grid import grid_peaks

from cellwright.refusal import Refusal

WIDTHS = {"bin_volt": 3e-3, "smooth_volt": 0.039}
METHODS = {
    "binned": lambda *rows: binned_capacity(*rows, **WIDTHS),
    "counting": lambda *rows: counted_capacity(*rows, **WIDTHS),
    "adaptive": adaptive_capacity,
}


def every_tenth(seed):
    return [column[::10] for column in record(seed)]


@pytest.mark.parametrize("method", METHODS)
def test_every_method_finds_the_peaks(method):
    curve = METHODS[method](*every_tenth(3))
    found = grid_peaks(curve, prominence=0.02)
    nearest = np.abs(found.voltage_volt[:, None] - VOLT[TOPS]).argmin(axis=0)
    np.testing.assert_allclose(found.voltage_volt[nearest], VOLT[TOPS], atol=5e-3)
    tall = found.height_ampere_hour_per_volt[nearest]
    np.testing.assert_allclose(tall, SLOPE[TOPS], rtol=0.02)


@pytest.mark.parametrize("method", METHODS)
def test_a_straight_charge_has_no_peaks(method):
    rng = np.random.default_rng(0)
    voltage = np.linspace(3.2, 4.2, 20_000) + 2e-4 * rng.standard_normal(20_000)
    found = grid_peaks(METHODS[method](voltage, np.linspace(0, 2, 20_000)), prominence=0.02)
    assert all(len(column) == 0 for column in found)


def test_the_thesis_variants_of_text_and_code_differ():
    text = Adaptive(span_share=0.1, threshold_volt=6e-4)
    heights = [
        adaptive_capacity(*every_tenth(3), settings=one).dq_dv_ampere_hour_per_volt.max()
        for one in (text, Adaptive())
    ]
    assert heights[0] < heights[1]


@pytest.mark.parametrize("method", ["binned", "counting"])
def test_a_charge_over_too_little_voltage_is_refused(method):
    voltage = 3.3 + np.tile([0, 1e-3], 300) + np.linspace(0, 1e-3, 600)
    with pytest.raises(Refusal, match="spans"):
        METHODS[method](voltage, np.arange(600.0))
