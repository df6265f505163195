"""Fleets: the line is found, outliers are named and none invented, protocols told only by proof."""

import numpy as np
import pytest

from cellwright.health.fleet import alike_measured, mean_over_soc, resistance_against_capacity
from cellwright.health.protocols_compared import LifeOfProtocol, compared
from cellwright.refusal import Refusal


def fleet(seed, count=30, scatter=0.02):
    random = np.random.default_rng(seed)
    capacity = random.uniform(20, 30, count)
    ohm = (4.3e-3 - 9.3e-5 * capacity) * (1 + scatter * random.standard_normal(count))
    return [(f"P{k:02d}", *pair) for k, pair in enumerate(zip(capacity, ohm, strict=True))]


def test_the_line_of_a_fleet_is_found_and_its_error_covers():
    slopes, covered = [], []
    for seed in range(40):
        line, _ = resistance_against_capacity(fleet(seed))
        slopes.append(
            (line.slope_ohm_per_ampere_hour + 9.3e-5) / line.slope_std_ohm_per_ampere_hour
        )
        covered.append(line.covered)
    assert np.mean(np.abs(slopes) < 2.05) >= 0.85
    assert 0.9 <= np.mean(covered) <= 1


def test_an_outlier_is_named_and_none_invented():
    named = [resistance_against_capacity(fleet(seed))[0].outliers for seed in range(60)]
    assert sum(bool(name) for name in named) <= 8
    cells = fleet(1)
    cells[7] = ("P07", cells[7][1], 1.3 * cells[7][2])
    line, rows = resistance_against_capacity(cells)
    assert line.outliers == "P07"
    assert rows[7].outlier
    assert "does not belong" in rows[7].reason
    assert line.held_out_rms_ampere_hour < 1.0


def test_resistance_that_tells_nothing_is_said_to():
    random = np.random.default_rng(0)
    cells = [(f"P{k}", random.uniform(20, 30), 2e-3 + 1e-4 * random.random()) for k in range(30)]
    assert "does not tell" in resistance_against_capacity(cells)[0].verdict


def test_too_few_and_all_alike_are_refused():
    with pytest.raises(Refusal, match="5 cells"):
        resistance_against_capacity(fleet(0, 5))
    with pytest.raises(Refusal, match="no line"):
        resistance_against_capacity([(f"P{k}", 20.0, 2e-3) for k in range(10)])


def test_first_samples_are_compared_only_where_taken_alike():
    row = {"capacity_ampere_hour": 2.0, "resistance_mean_ohm": 1.0, "resistance_mean_1s_ohm": 1.5}
    alike = [(k, row | {"first_delay_second": d}) for k, d in (("a", 0.01), ("b", 0.015))]
    assert alike_measured(alike)[1] == "first sample"
    cells, delay = alike_measured([*alike, ("c", row | {"first_delay_second": 0.5})])
    assert delay == "1 s"
    assert cells[0] == ("a", 2.0, 1.5)


def test_mean_over_soc():
    soc = np.linspace(0.9, 0.1, 9)
    assert mean_over_soc(soc, 1 + soc) == pytest.approx(1.5)
    assert np.isnan(mean_over_soc(soc[:4], 1 + soc[:4]))


def lives_of(**cycles):
    """Lives that lose 10 % over so many cycles, several cells a protocol."""
    grid = np.linspace(0, 1.2, 61)
    return [
        LifeOfProtocol(f"{name}{k}", name, grid[1:] * length, 1 - 0.1 * grid[1:])
        for name, lengths in cycles.items()
        for k, length in enumerate(lengths)
    ]


def test_protocols_that_differ_beyond_their_cells_are_told():
    (one,) = compared(lives_of(fast=(290, 300, 310), standard=(1180, 1200, 1230)))
    assert one.chance < 1e-3
    assert one.ratio == pytest.approx(4.0, rel=0.02)
    assert one.ratio_lower < 4.0 < one.ratio_upper
    assert "fast wears cells out 4 times as fast as standard" in one.verdict


def test_of_one_cell_under_each_protocol_nothing_is_told():
    (one,) = compared(lives_of(fast=(300,), standard=(1200,)))
    assert np.isnan(one.chance)
    assert "cannot be told" in one.verdict


def test_no_difference_is_invented():
    found = 0
    for seed in range(200):
        random = np.random.default_rng(seed)
        arms = {name: 1000 * np.exp(0.1 * random.standard_normal(3)) for name in ("a", "b", "c")}
        found += any("times as fast" in one.verdict for one in compared(lives_of(**arms)))
    assert found <= 18  # 5 % of 200, and three standard deviations


def test_what_cannot_be_compared_is_refused():
    with pytest.raises(Refusal, match="one protocol only"):
        compared(lives_of(standard=(300, 310)))
    young = LifeOfProtocol("n", "new", np.arange(10.0), np.linspace(1, 0.995, 10))
    with pytest.raises(Refusal, match="n has lost"):
        compared([*lives_of(standard=(300,)), young])
