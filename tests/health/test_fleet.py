"""Fleets: the line is found, outliers are named and none invented, protocols told only by proof."""

import numpy as np
import pytest

from cellwright.health.fleet import Fleet, capacity_from_resistance, mean_over_soc, over_shared_soc
from cellwright.health.protocols_compared import LifeOfProtocol, compared
from cellwright.refusal import Refusal

SOCS = np.linspace(0.05, 0.95, 10)


def fleet(seed, count=30, scatter=0.02):
    """Cells of one used pack: mean resistance is a line over capacity."""
    random = np.random.default_rng(seed)
    capacity = random.uniform(20, 30, count)
    ohm = (4.3e-3 - 9.3e-5 * capacity) * (1 + scatter * random.standard_normal(count))
    courses = ohm[:, None] * (1 + 0.3 * np.exp(-SOCS / 0.1))
    courses /= np.mean(1 + 0.3 * np.exp(-SOCS / 0.1))
    names = [f"P{k:02d}" for k in range(count)]
    return Fleet(names, capacity, courses, SOCS, "first sample", {})


def course_moves(seed, count=30):
    """Cells whose mean resistance tells nothing: the rise near empty moves with the capacity."""
    random = np.random.default_rng(seed)
    health = random.uniform(0.6, 1.0, count)
    rise = np.exp(-(SOCS + 0.3 * (health[:, None] - 0.8)) / 0.08)
    ohm = 0.02 * (1 + 0.06 * random.standard_normal((count, 1))) * (1 + 0.8 * rise)
    ohm *= 1 + 0.003 * random.standard_normal(ohm.shape)
    return Fleet([f"U{k}" for k in range(count)], 5 * health, ohm, SOCS, "1 s", {})


def test_the_line_of_a_fleet_is_found_and_its_error_covers():
    slopes, covered = [], []
    for seed in range(25):
        line, _ = capacity_from_resistance(fleet(seed))
        slopes.append(
            (line["slope_ohm_per_ampere_hour"] + 9.3e-5) / line["slope_std_ohm_per_ampere_hour"]
        )
        covered.append(line["covered"])
        assert line["held_out_rms_ampere_hour"] < 1.15 * line["line_held_out_rms_ampere_hour"]
    assert np.mean(np.abs(slopes) < 2.05) >= 0.85
    assert 0.9 <= np.mean(covered) <= 1


def test_how_resistance_goes_over_soc_tells_what_its_mean_does_not():
    covered = []
    for seed in range(10):
        line, _ = capacity_from_resistance(course_moves(seed))
        assert line["held_out_share"] < 0.04
        assert line["line_held_out_rms_ampere_hour"] > 3 * line["held_out_rms_ampere_hour"]
        assert "predicts the capacity" in line["verdict"]
        covered.append(line["covered"])
    assert 0.88 <= np.mean(covered) <= 1


def test_a_cell_of_unknown_capacity_is_predicted_and_takes_no_part():
    cells = course_moves(3)
    unknown = cells.capacity_ampere_hour.copy()
    unknown[4] = np.nan
    line, rows = capacity_from_resistance(cells._replace(capacity_ampere_hour=unknown))
    row = rows[-1]
    assert (row["cell"], line["cells"]) == ("U4", 29)
    assert np.isnan(row["error_ampere_hour"])
    apart = abs(row["predicted_ampere_hour"] - cells.capacity_ampere_hour[4])
    assert apart < 3 * row["predicted_std_ampere_hour"] < 0.6


@pytest.mark.slow
def test_an_outlier_is_named_and_none_invented():
    named = [capacity_from_resistance(fleet(seed))[0]["outliers"] for seed in range(30)]
    assert sum(bool(name) for name in named) <= 4
    cells = fleet(1)
    cells.resistance_ohm[7] *= 1.3
    line, rows = capacity_from_resistance(cells)
    assert line["outliers"] == "P07"
    assert rows[7]["outlier"]
    assert "does not belong" in rows[7]["reason"]
    assert line["held_out_rms_ampere_hour"] < 1.0


def test_resistance_that_tells_nothing_is_said_to():
    told = []
    for seed in range(20):
        random = np.random.default_rng(seed)
        ohm = 0.02 * (1 + 0.05 * random.standard_normal((20, 1))) * np.ones(10)
        ohm *= 1 + 0.005 * random.standard_normal(ohm.shape)
        cells = fleet(seed, 20)._replace(resistance_ohm=ohm)
        told.append("does not tell" not in capacity_from_resistance(cells)[0]["verdict"])
    assert sum(told) <= 1


def test_too_few_and_all_alike_are_refused():
    nothing = over_shared_soc([("a", {"first_delay_second": np.nan}, [])])
    but_one = fleet(0, 8)._replace(capacity_ampere_hour=np.append(np.full(7, 2.0), 1.8))
    alike = fleet(0, 8)._replace(resistance_ohm=np.ones((8, 10)))
    for cells, words in (
        (fleet(0, 5), "6 cells with capacity and pulse tests, 5 of"),
        (nothing, "tests, 0 of its cells"),
        (but_one, "all cells but one have one capacity"),
        (alike, "no line"),
    ):
        with pytest.raises(Refusal, match=words):
            capacity_from_resistance(cells)


def checked(name, socs, *, first_delay=0.01, capacity=2.0, cycle=0.0):
    """A cell as (name, check-up, growth): R is 1 + SoC at the first sample, half more at 1 s."""
    about = {"cycle": cycle, "direction": "discharge"}
    growth = [
        about | {"delay_second": delay, "soc": soc, "resistance_ohm": size * (1 + soc)}
        for soc in socs
        for delay, size in ((0.0, 1.0), (1.0, 1.5))
    ]
    growth += [row | {"cycle": cycle + 100, "resistance_ohm": 9.0} for row in growth]
    row = {"cycle": cycle, "capacity_ampere_hour": capacity, "first_delay_second": first_delay}
    return name, row, growth


def test_first_samples_are_compared_only_where_taken_alike():
    cells = [checked("a", SOCS), checked("b", SOCS, first_delay=0.015, cycle=300.0)]
    found = over_shared_soc(cells)
    assert found.delay == "first sample"
    assert found.resistance_ohm == pytest.approx(np.tile(1 + SOCS, (2, 1)))
    found = over_shared_soc([*cells, checked("c", SOCS, first_delay=0.5)])
    assert found.delay == "1 s"
    assert found.resistance_ohm == pytest.approx(np.tile(1.5 * (1 + SOCS), (3, 1)))


def test_cells_are_compared_over_the_soc_that_they_share():
    cells = [checked(f"a{k}", np.linspace(0.05 + 0.01 * k, 0.5, 10)) for k in range(5)]
    found = over_shared_soc([*cells, checked("short", [0.45, 0.5])])
    assert found.cells == [f"a{k}" for k in range(5)]
    assert found.soc[[0, -1]] == pytest.approx([0.09, 0.5])
    assert found.resistance_ohm == pytest.approx(np.tile(1 + found.soc, (5, 1)))
    assert "45 to 50 % SoC only" in found.left_out["short"]
    nowhere = over_shared_soc([*cells, checked("lost", [np.nan, 0.3 * np.nan])])
    assert "known SoC" in nowhere.left_out["lost"]
    single = over_shared_soc([checked(f"a{k}", [0.5 + 0.001 * k]) for k in range(6)])
    assert single.resistance_ohm.shape == (6, 1)


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
    assert one["chance"] < 1e-3
    assert one["ratio"] == pytest.approx(4.0, rel=0.02)
    assert one["ratio_lower"] < 4.0 < one["ratio_upper"]
    assert "fast wears cells out 4 times as fast as standard" in one["verdict"]


def test_of_one_cell_under_each_protocol_nothing_is_told():
    (one,) = compared(lives_of(fast=(300,), standard=(1200,)))
    assert np.isnan(one["chance"])
    assert "cannot be told" in one["verdict"]


def test_no_difference_is_invented():
    found = 0
    for seed in range(200):
        random = np.random.default_rng(seed)
        arms = {name: 1000 * np.exp(0.1 * random.standard_normal(3)) for name in ("a", "b", "c")}
        found += any("times as fast" in one["verdict"] for one in compared(lives_of(**arms)))
    assert found <= 18  # 5 % of 200, and three standard deviations


def test_what_cannot_be_compared_is_refused():
    with pytest.raises(Refusal, match="one protocol only"):
        compared(lives_of(standard=(300, 310)))
    young = LifeOfProtocol("n", "new", np.arange(10.0), np.linspace(1, 0.995, 10))
    with pytest.raises(Refusal, match="n has lost"):
        compared([*lives_of(standard=(300,)), young])
