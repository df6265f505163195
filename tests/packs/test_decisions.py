"""Decisions: matching against all possibilities, replacement, safe window, Monte Carlo."""

from itertools import combinations

import numpy as np
import pytest
import strings
import truth
from hypothesis import given, settings
from hypothesis import strategies as st

import cellwright as cw
from cellwright.bias.scaled import scaled_reference
from cellwright.circuits.circuit import KINDS
from cellwright.packs.cells import pack_cells
from cellwright.packs.decisions import fleet, matching, monte_carlo
from cellwright.packs.decisions.fleet import discharges_of, fleet_of, matched_fleet
from cellwright.packs.decisions.group_use import (
    cells_at,
    discharge_groups,
    discharge_pack,
    safe_window,
)
from cellwright.packs.decisions.of_pack import charged_soc, pack_decisions, replacement_rows
from cellwright.packs.series.capability import discharge_string
from cellwright.packs.thermal import Thermal
from cellwright.packs.uncertainty import draws
from cellwright.packs.uncertainty.draws import INITIAL_SOC_STD
from cellwright.packs.wiring import Wiring, star_of
from cellwright.records.facts import BranchFacts, CellFacts
from cellwright.refusal import Refusal
from cellwright.settings import PackDecisions

SETTINGS = PackDecisions(draws=20, string_length=2)
LOWER = strings.LOWER_VOLT


def facts_of(models):
    return [CellFacts(m["cell"], 30.0, LOWER, strings.UPPER_VOLT) for m in models]


def positions_of(models, soc=1.0, wire=3e-4):
    return [BranchFacts(k + 1, m["cell"], wire, soc) for k, m in enumerate(models)]


def discharged(shares, factors, lower=LOWER):
    """Cells in parallel through a discharge at 1C."""
    cells = pack_cells(strings.models(shares, factors), temperature_celsius=25.0)
    total = cells.capacity_ampere_hour.sum()
    star = star_of(cells.names, wire_resistance_ohm=1e-4)
    return discharge_pack(cells, star, lower_cutoff_volt=lower, current_ampere=total)


def partitions(cells, size):
    """All ways to put cells into groups of one size."""
    if not cells:
        yield []
        return
    for others in combinations(cells[1:], size - 1):
        rest = [c for c in cells[1:] if c not in others]
        for more in partitions(rest, size):
            yield [(cells[0], *others), *more]


sizes = st.lists(st.floats(10.0, 30.0), min_size=6, max_size=6)


@settings(max_examples=25, deadline=None)
@given(sizes, st.sampled_from([2, 3]))
def test_sorted_strings_hold_most_of_all_possible_ones(capacity, length):
    capacity = np.array(capacity)
    best = max(
        sum(capacity[list(group)].min() for group in way)
        for way in partitions(list(range(6)), length)
    )
    found = matching.strings_by_capacity(capacity, length=length)
    assert capacity[found].min(axis=1).sum() == pytest.approx(best)


@pytest.mark.parametrize("seed", range(5))
def test_pairs_are_the_cheapest_of_all(seed):
    cost = np.random.default_rng(seed).uniform(0.0, 1.0, (6, 6))
    cost += cost.T
    ways = [sum(cost[a, b] for a, b in way) for way in partitions(list(range(6)), 2)]
    found = matching.pairs_of_least_cost(cost)
    assert sorted(found.ravel().tolist()) == list(range(6))
    assert sum(cost[a, b] for a, b in found) == pytest.approx(min(ways))


def test_of_an_odd_number_one_is_left_alone():
    cost = np.abs(np.subtract.outer([0.0, 5.0, 5.1, 9.0, 9.1], [0.0, 5.0, 5.1, 9.0, 9.1]))
    found = matching.pairs_of_least_cost(cost)
    assert sorted(map(tuple, found.tolist())) == [(1, 2), (3, 4)]


@pytest.mark.parametrize("seed", range(6))
def test_exchanges_come_near_the_best_of_all_groups(seed):
    """Of 280 ways to put nine cells into threes: within a tenth of the range above the best."""
    size = np.random.default_rng(seed).uniform(0.0, 1.0, 9)

    def cost(group):
        return float(np.ptp(size[list(group)]) ** 2)

    ways = [sum(map(cost, way)) for way in partitions(list(range(9)), 3)]
    begin = np.random.default_rng(seed + 50).permutation(9).reshape(3, 3)
    swapped = matching.groups_by_swaps(begin, lambda groups: list(map(cost, groups)))
    found = sum(map(cost, swapped.tolist()))
    assert found <= min(ways) + 0.1 * (max(ways) - min(ways))


@pytest.mark.parametrize("seed", range(6))
def test_even_groups_come_near_the_best_smallest_group(seed):
    size = np.random.default_rng(seed).uniform(20.0, 30.0, 8)
    best = max(min(size[list(g)].sum() for g in way) for way in partitions(list(range(8)), 2))
    found = matching.even_groups(size, size=2)
    assert size[found].sum(axis=1).min() >= best - 0.3
    assert sorted(found.ravel().tolist()) == list(range(8))


def test_the_best_cell_to_replace_is_that_of_trying_all():
    models = strings.models([1.0, 0.8, 0.95, 0.84, 0.97], [1.0, 1.3, 1.0, 1.2, 1.1])

    def use(cells):
        at = {"lower_cutoff_volt": LOWER, "current_ampere": 15.0, "initial_soc": 1.0}
        found = discharge_string(cells, **at)
        return found.capacity_ampere_hour, found.energy_watt_hour

    capacity = [model["capacity_ampere_hour"] for model in models]
    gains, median, in_turn = matching.replacements(use, models, capacity_ampere_hour=capacity)
    spare = sorted(models, key=lambda m: m["capacity_ampere_hour"])[2]
    energies = [use([*models[:k], spare, *models[k + 1 :]])[1] for k in range(5)]
    assert models[median]["cell"] == spare["cell"]
    assert int(np.argmax(energies)) == 1
    np.testing.assert_allclose(gains[:, 1], np.array(energies) - use(models)[1])
    assert [turn[0] for turn in in_turn[:2]] == [1, 3]
    names = [model["cell"] for model in models]
    best, margin, *_ = replacement_rows(use, models, lambda model: model, capacity, names)
    order = np.sort(energies)
    assert (best["cell"], margin["value"]) == ("B", pytest.approx(order[-1] - order[-2]))


def test_equal_cells_share_alike_and_every_soc_is_safe():
    use = discharged([0.9, 0.9], [1.0, 1.0])
    np.testing.assert_allclose(use.branch_share, 1.0, atol=1e-9)
    window = safe_window(use, current_spread=0.01)
    assert window["lowest SoC"] < 0.1
    assert window["highest SoC"] > 0.99
    width = window["highest SoC"] - window["lowest SoC"]
    assert window["share of the charge"] == pytest.approx(width)


def test_a_group_is_empty_when_a_cell_is_at_soc_0_at_the_latest():
    use = discharged([0.9, 0.9], [1.0, 1.0], lower=0.1)
    assert use.capacity_ampere_hour == pytest.approx(1.8 * strings.FULL_AMPERE_HOUR)


def test_unlike_cells_leave_a_window_and_beyond_it_the_spread_is_larger():
    use = discharged([1.0, 0.7], [1.0, 1.5])
    total = (use.branch_share * [1.0, 0.7]).sum(axis=1) / 1.7
    np.testing.assert_allclose(total, 1.0, atol=1e-9)
    limit = 0.6 * np.abs(use.branch_share - 1).max()
    window = safe_window(use, current_spread=limit)
    spread = np.abs(use.branch_share - 1).max(axis=1)
    inside = (use.pack_soc >= window["lowest SoC"]) & (use.pack_soc <= window["highest SoC"])
    assert 0 < inside.mean() < 1
    assert spread[inside].max() == window["largest spread within"] <= limit
    assert window["largest spread of all"] == spread.max() > limit
    assert np.isnan(safe_window(use, current_spread=1e-9)["lowest SoC"])


@pytest.mark.parametrize("wiring", ["series", "parallel"])
def test_intervals_hold_a_pack_drawn_from_the_stated_uncertainties(wiring):
    """Nine in ten of 60 packs, whose cells differ from their models as stated, are within."""
    shares, factors = np.array([1.0, 0.85, 0.9]), np.array([1.0, 1.3, 1.1])
    models = strings.models(shares, factors)
    known = draws.Uncertainty(*(np.full(3, std) for std in (0.01, 0.05, 0.003, 0.004)))
    drawn, truth = (draws.draw_cells(known, draws=n, seed=s) for n, s in ((200, 1), (60, 2)))
    given = []
    for sample in (drawn, truth):
        if wiring == "series":
            at = {"lower_cutoff_volt": LOWER, "current_ampere": 15.0, "initial_soc": 0.95}
            found = monte_carlo.string_draws(models, sample, **at)
        else:
            cells = pack_cells(models, temperature_celsius=25.0)
            at = {"lower_cutoff_volt": LOWER, "current_ampere": 80.0, "initial_soc": 0.95}
            found = monte_carlo.pack_draws(
                cells, star_of(cells.names, wire_resistance_ohm=3e-4), sample, **at
            )
        given.append(found.capacity_ampere_hour)
    low, high = np.percentile(given[0], [5, 95])
    assert 0.78 <= np.mean((given[1] >= low) & (given[1] <= high)) <= 0.99


def test_a_drawn_string_is_the_string_of_so_changed_models():
    """One draw against models that are made with its capacity, resistances and shift."""
    shares, factors = np.array([1.0, 0.85]), np.array([1.0, 1.3])
    draw = draws.CellDraws(
        np.array([[1.02, 0.97]]), np.array([[0.9, 1.2]]), np.array([[0.004, -0.003]]),
        np.array([[-0.02, 0.0]]),
    )  # fmt: skip
    at = {"lower_cutoff_volt": LOWER, "current_ampere": 20.0}
    found = monte_carlo.string_draws(strings.models(shares, factors), draw, **at, initial_soc=0.98)
    changed = [
        strings.model(name, share, factor, shift)
        for name, share, factor, shift in zip(
            "AB", shares * draw.capacity_factor[0], factors * draw.resistance_factor[0],
            draw.voltage_volt[0], strict=True,
        )
    ]  # fmt: skip
    direct = discharge_string(changed, **at, initial_soc=0.98 + draw.initial_soc[0])
    assert found.capacity_ampere_hour[0] == pytest.approx(direct.capacity_ampere_hour, rel=1e-3)
    assert found.energy_watt_hour[0] == pytest.approx(direct.energy_watt_hour, rel=1e-3)
    assert found.weakest[0] == direct.weakest


def test_uncertainty_is_what_the_models_and_tests_say_and_never_less_than_the_least():
    models = [strings.model("A", r_std=0.1), strings.model("B")]
    models[0]["members"][0]["left_out_rmse_volt"] = 0.004
    known = draws.uncertainty_of(models, [0.6, None])
    np.testing.assert_allclose(known.capacity_relative, [0.02, 0.003])
    whole = strings.R0_OHM + sum(strings.R_OHM)
    stated = 0.1 * strings.R0_OHM * np.sqrt(3) / whole
    np.testing.assert_allclose(known.resistance_relative, [stated, 0.02])
    np.testing.assert_allclose(known.voltage_volt, [0.004, 0.0])


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_groups_discharged_side_by_side_are_each_discharged_alone(kind):
    """Of every kind of element: unlike groups, cells in several of them, one group of one rate."""
    cell = truth.with_branch(kind) | {"cell": "A"}
    models = [cell, *(
        scaled_reference(cell, cell=name, capacity=capacity, resistance_ratio=ratio)
        for name, capacity, ratio in (("B", 1.6, 1.7), ("C", 2.3, 0.8))
    )]  # fmt: skip
    cells = pack_cells(models, temperature_celsius=25.0)
    groups = [(0, 1), (2, 1), (0, 2)]
    current = 0.5 * cells.capacity_ampere_hour[np.array(groups)].sum(axis=1)
    ends = {"lower_cutoff_volt": 3.1, "current_ampere": current}
    found = discharge_groups(cells, groups, contact_ohm=2e-3, **ends)
    for k, group in enumerate(groups):
        part = cells_at(cells, group)
        star = star_of(part.names, wire_resistance_ohm=2e-3)
        alone = discharge_pack(part, star, **(ends | {"current_ampere": current[k]}))
        one = (alone.capacity_ampere_hour, alone.peak_share, alone.loss_watt.max())
        np.testing.assert_allclose([column[k] for column in found], one, rtol=1e-6)
        assert 0.3 < alone.capacity_ampere_hour / part.capacity_ampere_hour.sum() <= 1.0


def test_a_fleet_in_pairs_has_less_above_its_share_than_at_random():
    random = np.random.default_rng(3)
    models = strings.models(random.uniform(0.7, 1.0, 10), random.uniform(1.0, 1.8, 10))
    cells = fleet_of(models, facts_of(models), [None] * 10, SETTINGS)
    rows, assembly = matched_fleet(cells, SETTINGS)
    by_name = {(row["decision"], row["quantity"]): row for row in rows}
    mean = by_name["parallel groups of 2", "largest branch current over its share, mean"]
    assert mean["value"] < mean["random_p05"]
    assert mean["gain_p95"] < 0
    assert mean["better_share"] >= 0.9
    strung = by_name["strings of 2", "usable charge of all strings"]
    assert strung["value"] >= strung["random_p95"]
    # Every cell of each way of putting them together is somewhere once.
    for decision in {row["decision"] for row in assembly}:
        placed = [row["cell"] for row in assembly if row["decision"] == decision]
        assert len(placed) == len(set(placed))


def test_a_large_fleet_is_paired_among_cells_that_are_alike(monkeypatch):
    """Each cell only with its next ones: no pair less, and nearly as good as the best of all."""
    random = np.random.default_rng(4)
    models = strings.models(random.uniform(0.7, 1.0, 24), random.uniform(1.0, 1.8, 24))
    cells = fleet_of(models, facts_of(models), [None] * 24, SETTINGS)
    uses = discharges_of(cells, 1.0)
    best = uses(fleet.parallel_groups(cells, uses, 2)).peak_share.mean()
    at_random = uses(random.permutation(24).reshape(12, 2)).peak_share.mean()
    monkeypatch.setattr(fleet, "EVERY_PAIR", 10)
    monkeypatch.setattr(fleet, "NEXT_ONES", 4)
    pairs = fleet.parallel_groups(cells, uses, 2)
    assert sorted(pairs.ravel().tolist()) == list(range(24))
    assert best <= uses(pairs).peak_share.mean() <= best + 0.1 * (at_random - best)


@pytest.mark.parametrize("connection", ["series", "parallel"])
def test_rows_of_a_pack(connection):
    models = strings.models([1.0, 0.8, 0.9], [1.0, 1.4, 1.1])
    wiring = Wiring("p", connection, ("A", "B", "C"), (3e-4,) * 3, (0.0,) * 3)
    rows = pack_decisions(
        wiring, models, positions_of(models), facts_of(models), [None] * 3, celsius=25.0,
        settings=SETTINGS,
    )  # fmt: skip
    assert len({tuple(row) for row in rows}) == 1
    of = {(row["decision"], row["quantity"], row["cell"]): row for row in rows}
    charge = of["uncertainty", "usable charge", ""]
    assert charge["p05"] < charge["p50"] < charge["p95"]
    first = "weakest" if connection == "series" else "busiest"
    shares = [r["value"] for r in rows if r["quantity"] == f"probability: {first} cell"]
    assert sum(shares) == pytest.approx(1.0)
    best = next(row for row in rows if row["quantity"].startswith("best"))
    assert best["cell"] == "B"
    windows = [row for row in rows if row["decision"].startswith("safe window")]
    assert bool(windows) == (connection == "parallel")


def test_a_string_of_groups_is_decided_on_as_a_whole():
    """Its weakest group limits it: a cell of that group is the one to replace."""
    models = strings.models([1.0, 0.98, 0.8, 0.78])
    pairs = [Wiring(name, "parallel", cells, (1e-4, 1e-4), (0, 0)) for name, cells in
             (("p", ("A", "B")), ("q", ("C", "D")))]  # fmt: skip
    wiring = Wiring("s", "series", tuple(pairs), (1e-4, 1e-4), (0, 0))
    facts, places = facts_of(models), positions_of(models)
    rows = pack_decisions(
        wiring, models, places, facts, [None] * 4, celsius=25.0, settings=SETTINGS
    )
    best = next(row for row in rows if row["quantity"].startswith("best"))
    assert best["cell"] == "D"
    charge = next(row for row in rows if row["quantity"] == "usable charge")
    assert charge["p50"] == pytest.approx(1.58 * strings.FULL_AMPERE_HOUR, rel=0.03)


PAIR = strings.models([1.0, 0.9])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: matching.strings_by_capacity([1.0], length=2), "1 cells, wanted at least the 2"),
        (lambda: matching.pairs_of_least_cost(np.zeros((1, 1))), "1 cell, wanted two or more"),
        (lambda: matching.pairs_of_least_cost(np.full((2, 2), np.nan)), "is no number"),
        (lambda: matching.pairs_of_least_cost(np.full((2, 2), np.inf)), "no matching of 2 cells"),
        (
            lambda: matching.replacements(None, [1], capacity_ampere_hour=[1.0]),
            "a pack of one cell",
        ),
        (
            lambda: pack_decisions(
                Wiring("huge", "parallel", ("A",) * 201, (0,) * 201, (0,) * 201),
                PAIR[:1] * 201, positions_of(PAIR[:1]) * 201, facts_of(PAIR[:1]) * 201,
                [None] * 201, celsius=25.0, settings=SETTINGS,
            ),
            "huge is not decided on: found 201 cells, wanted at most 200",
        ),
        (
            lambda: matched_fleet(fleet_of(PAIR, facts_of(PAIR), [None] * 2, SETTINGS), SETTINGS),
            "2 cells, wanted at least two groups of 2",
        ),
    ],
)  # fmt: skip
def test_refusals(call, message):
    with pytest.raises(Refusal, match=message):
        call()


def test_a_pack_is_judged_from_full_and_a_string_keeps_what_its_cells_differ_by():
    capacity = np.array([2.0, 4.0, 2.0, 2.0])
    pair = Wiring("pair", "parallel", ("A", "B"), (0.0, 0.0), (0.0, 0.0))
    string = Wiring("string", "series", (pair, "C", "D"), (0.0,) * 3, (0.0,) * 3)
    plain = Wiring("s", "series", ("A", "B"), (0, 0), (0, 0))
    np.testing.assert_allclose(charged_soc(plain, [0.5, 0.4], [30.0, 20.0]), [0.9, 1.0])
    soc = np.array([0.1, 0.1, 0.2, 0.4])
    full = charged_soc(string, soc, capacity)
    np.testing.assert_allclose(full[3], 1.0)
    np.testing.assert_allclose(full[2], 0.8)
    taken = capacity * (full - soc)
    np.testing.assert_allclose([taken[:2].sum(), *taken[2:]], 1.2)
    np.testing.assert_allclose(full[0], full[1])
    np.testing.assert_allclose(charged_soc(pair, np.array([0.1, 0.5]), capacity[:2]), 1.0)
    np.testing.assert_allclose(charged_soc(pair, np.ones(2), capacity[:2]), 1.0)
    strings = Wiring("strings", "parallel", (string, "E"), (0.0, 0.0), (0.0, 0.0))
    both = charged_soc(strings, np.append(soc, 0.3), np.append(capacity, 5.0))
    np.testing.assert_allclose(both, np.append(full, 1.0))


@pytest.mark.parametrize("charge_std", [0.003, 3.0])
def test_a_capacity_is_as_sure_as_the_direction_that_repeats_better(charge_std):
    """A discharge also differs by how full the one before has left the cell."""
    models = strings.models([1.0, 0.9])
    rows = [
        {"cell": model["cell"], "direction": direction, "c_rate": rate, "repeats": 3}
        | {"capacity_std_ampere_hour": std, "temperature_mean_celsius": 25.0}
        for model in models
        for direction, rate, std in (("discharge", 0.5, 1.5), ("charge", 0.50002, charge_std))
    ]
    wired = [
        {"group": "pair", "position": k, "cell": m["cell"], "wire_resistance_ohm": 3e-4}
        for k, m in enumerate(models, 1)
    ]
    about = (models, wired, facts_of(models), rows, PackDecisions(draws=60))
    decided = cw.pack_decisions(*about).to_frame().set_index("quantity")
    charge = decided.loc["usable charge"]
    half = 0.5 * (charge["p95"] - charge["p05"]) / charge["value"]
    # Beside the capacity the SoC at the start is known to half a per cent.
    known = np.hypot(max(0.003, min(charge_std, 1.5) / 3**0.5 / 30.0), INITIAL_SOC_STD)
    assert half == pytest.approx(1.64 * known / 2**0.5, rel=0.35)


def test_cells_that_warm_share_a_discharge_more_evenly():
    """Of warm cells the resistances are smaller, by one activation energy for all."""
    models = [strings.with_energy(m) for m in strings.models([1.0, 0.8], [1.0, 1.6])]
    star = star_of(("A", "B"), wire_resistance_ohm=1e-4)
    thermal = Thermal(np.full(2, 300.0), np.full(2, 3.0), 0.0, None, np.zeros((2, 3)))
    cold, warm = (
        discharge_pack(
            pack_cells(models, temperature_celsius=tables),
            star,
            lower_cutoff_volt=LOWER,
            current_ampere=108.0,
            thermal=how,
            ambient_celsius=25.0,
        )
        for how, tables in ((None, 25.0), (thermal, np.arange(25.0, 80.0, 5.0)))
    )
    assert warm.capacity_ampere_hour > cold.capacity_ampere_hour
    assert (warm.loss_watt < cold.loss_watt).all()
    assert (warm.loss_watt > 0.5 * cold.loss_watt).all()


def test_larger_groups_are_matched_too():
    models = strings.models([1.0, 0.7, 0.98, 0.72, 0.99, 0.71], [1.0, 1.8, 1.1, 1.7, 1.05, 1.75])
    changed = SETTINGS._replace(group_size=3, string_length=9)
    cells = fleet_of(models, facts_of(models), [None] * 6, changed)
    uses = discharges_of(cells, 1.0)
    ways = [uses(way).peak_share.sum() for way in partitions(list(range(6)), 3)]
    rows, assembly = matched_fleet(cells, changed)
    assert rows[1]["value"] == pytest.approx(min(ways) / 2)
    together = {row["cell"] for row in assembly if row["group"] == 1}
    assert together in ({"A", "C", "E"}, {"B", "D", "F"})
