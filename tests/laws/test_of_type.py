"""Across cells: the published 10 s resistances of 24 LG M50 cells, and cells made by law."""

import numpy as np
import pytest
from arrhenius import arrhenius_law
from pulse_rows import pulse

from cellwright.laws.of_type import points_of_type, sentences_of_type
from cellwright.laws.temperature import law_rows

# 10 s resistance at 50 % SoC in mΩ, six cells at each temperature, recomputed from the records;
# 1.5C but for 0 °C, where it is 0.5C. The third at 45 °C is cell 9, which stands apart.
M50 = {
    25: [36.2, 33.9, 31.7, 37.4, 32.4, 33.2],
    45: [30.6, 29.4, 47.2, 34.3, 28.6, 28.7],
    10: [42.5, 38.6, 38.4, 39.9, 38.1, 38.4],
    0: [50.2, 49.5, 50.4, 50.6, 50.1, 53.7],
}


def rows(table, rate):
    cells = iter(range(1, 100))
    return [
        pulse(0.5, ohm, celsius, rate=rate(celsius), cell=f"Cell{next(cells)}")
        for celsius, values in table.items()
        for ohm in values
    ]


def test_cells_of_a_type_give_one_law_and_one_stands_apart():
    milliohm = {c: [1e-3 * v for v in values] for c, values in M50.items()}
    points, notes = points_of_type(rows(milliohm, lambda celsius: 1.5 if celsius else 0.5))
    assert notes == ["discharge, 10 s: no pulse at 1.5C at 0 °C, left out"]
    assert len(points) == 18
    laws, _ = law_rows(points)
    energy = next(r for r in laws if r["law"] == "arrhenius" and r["parameter"][0] == "a")
    assert energy["lower"] > 0  # the trend is sure even with the cell that stands apart
    (text,) = sentences_of_type(points)
    assert "18 cells" in text
    assert "Cell9 stands apart, without: activation energy 5.6 kJ/mol" in text


@pytest.mark.slow
def test_the_interval_holds_the_scatter_between_cells():
    rng, inside = np.random.default_rng(2), []
    for _ in range(100):
        table = {
            c: arrhenius_law(np.full(6, float(c)), 0.03, 2e4)
            * np.exp(0.05 * rng.standard_normal(6))
            for c in (0, 10, 25, 45)
        }
        laws, _ = law_rows(points_of_type(rows(table, lambda celsius: 1.0))[0])
        energy = next(r for r in laws if r["law"] == "arrhenius" and r["parameter"][0] == "a")
        inside.append(energy["lower"] < 2e4 < energy["upper"])
    assert np.mean(inside) == pytest.approx(0.95, abs=0.05)
    assert points_of_type([]) == ([], [])
