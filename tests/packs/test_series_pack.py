"""Series packs: first empty cell, balancing, power, weakest cells; a laboratory's string."""

import numpy as np
import pytest
import strings
from hypothesis import given, settings
from hypothesis import strategies as st

from cellwright.packs.series.capability import (
    balance_string,
    cutoffs_of,
    discharge_string,
    first_crossing,
    series_pack,
)
from cellwright.packs.series.power import limiting_current, power_of_string, pulse_volt
from cellwright.packs.series.string import simulate_string, string_soc, validate_string
from cellwright.records import record as layout
from cellwright.records.facts import BranchFacts, CellFacts
from cellwright.refusal import Refusal
from cellwright.settings import PackDecisions

SHARES = np.array([1.0, 0.8, 0.95, 0.83])
FACTORS = np.array([1.0, 1.6, 1.1, 1.3])
MODELS = strings.models(SHARES, FACTORS)
AT = {"lower_cutoff_volt": strings.LOWER_VOLT, "current_ampere": 15.0}
FACTS = [CellFacts(model["cell"], 30.0, strings.LOWER_VOLT, strings.UPPER_VOLT) for model in MODELS]


def places(soc=None, wire=None):
    return [BranchFacts(k + 1, model["cell"], wire, soc) for k, model in enumerate(MODELS)]


def record_of(initial_soc, *, current=None, seconds=3000.0, noise=0.0, cells=True, **changes):
    """A record of the true string: ten minutes' rest, then a load."""
    time = np.arange(0.0, seconds, 5.0)
    load = np.where(time < 600.0, 0.0, -15.0) if current is None else current(time)
    run = simulate_string(MODELS, time, load, initial_soc=initial_soc)
    random = np.random.default_rng(4)
    volt = run.cell_voltage_volt + random.normal(0.0, noise, run.cell_voltage_volt.shape)
    record = layout.record_of(time, load, volt.sum(axis=1), np.nan, test="t")
    record = record._replace(cell_voltage_volt=volt if cells else None, **changes)
    return record, run


def test_a_string_is_its_cells_one_by_one():
    time = np.arange(0.0, 900.0, 3.0)
    load = np.where(time % 200 < 100, -20.0, 8.0)
    whole = simulate_string(MODELS, time, load, initial_soc=SHARES * 0.9)
    for k, model in enumerate(MODELS):
        alone = simulate_string([model], time, load, initial_soc=SHARES[k] * 0.9)
        np.testing.assert_array_equal(whole.cell_voltage_volt[:, [k]], alone.cell_voltage_volt)
    charge = np.trapezoid(load, time) / 3600
    moved = (whole.soc[-1] - whole.soc[0]) * strings.FULL_AMPERE_HOUR * SHARES
    np.testing.assert_allclose(moved, charge, rtol=1e-9)


@settings(max_examples=15, deadline=None)
@given(st.lists(st.floats(0.6, 1.0), min_size=2, max_size=5), st.floats(3.0, 40.0))
def test_a_string_gives_what_its_first_cell_gives_alone(shares, current):
    models = strings.models(shares)
    at = AT | {"current_ampere": current, "initial_soc": 1.0}
    alone = [discharge_string([model], **at).capacity_ampere_hour for model in models]
    whole = discharge_string(models, **at)
    # Each runs on its own grid of charge.
    assert whole.capacity_ampere_hour == pytest.approx(min(alone), abs=5e-3)
    assert shares[whole.weakest] == min(shares)
    assert whole.voltage_at_end_volt[whole.weakest] == pytest.approx(strings.LOWER_VOLT, abs=1e-9)
    assert whole.voltage_at_end_volt.min() >= strings.LOWER_VOLT - 1e-9


def test_the_smallest_cell_need_not_be_the_first_to_end():
    """At 3C the cell of the larger capacity and twice the resistance is first."""
    models = strings.models([0.9, 0.93], [1.0, 3.0])
    slow, fast = (
        discharge_string(models, **AT | {"current_ampere": ampere}, initial_soc=1.0)
        for ampere in (1.0, 90.0)
    )
    assert (slow.weakest, fast.weakest) == (0, 1)


def test_a_cell_is_empty_at_soc_0_at_the_latest():
    """Models known from a group's record alone end above the cut-off of the sheet."""
    found = discharge_string(MODELS, **AT | {"lower_cutoff_volt": 1.0}, initial_soc=0.9)
    full = 0.9 * strings.FULL_AMPERE_HOUR * SHARES
    np.testing.assert_allclose(found.end_ampere_hour, full)
    assert found.soc_at_end[1] == pytest.approx(0.0, abs=1e-9)


def test_contacts_cost_energy_and_no_charge():
    plain = discharge_string(MODELS, **AT, initial_soc=1.0)
    wired = discharge_string(MODELS, **AT, initial_soc=1.0, contact_ohm=0.01)
    assert wired.capacity_ampere_hour == plain.capacity_ampere_hour
    lost = 15.0 * 0.01 * plain.capacity_ampere_hour
    assert plain.energy_watt_hour - wired.energy_watt_hour == pytest.approx(lost, rel=1e-9)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_balancing_brings_the_string_to_its_smallest_cell(seed):
    soc = 1.0 - np.random.default_rng(seed).uniform(0.0, 0.1, 4)
    found = balance_string(MODELS, initial_soc=soc, **AT)
    full = strings.FULL_AMPERE_HOUR * SHARES
    lacking = (1 - soc) * full
    np.testing.assert_allclose(found.top_ampere_hour, lacking.max() - lacking, atol=1e-12)
    balanced = found.balanced_at_top.capacity_ampere_hour
    assert balanced >= found.as_it_is.capacity_ampere_hour - 1e-6
    assert balanced == pytest.approx(found.balanced_at_bottom.capacity_ampere_hour, rel=5e-3)
    assert found.level_ampere_hour > balanced
    # Having taken out what is asked for and charged again, nothing is left to be taken out.
    bled = soc - found.top_ampere_hour / full
    again = balance_string(MODELS, initial_soc=bled, **AT)
    np.testing.assert_allclose(again.top_ampere_hour, 0.0, atol=1e-9)
    assert again.as_it_is.capacity_ampere_hour == pytest.approx(balanced, rel=1e-6)


def test_a_string_balanced_at_the_bottom_is_empty_at_once():
    found = balance_string(MODELS, initial_soc=1.0, **AT)
    np.testing.assert_allclose(found.balanced_at_bottom.voltage_at_end_volt, 3.0, atol=0.03)
    now = balance_string(MODELS, initial_soc=1.0, **AT).as_it_is
    np.testing.assert_allclose(
        found.bottom_ampere_hour, now.end_ampere_hour - now.capacity_ampere_hour, atol=1e-9
    )


def test_a_pulse_of_the_limiting_current_ends_at_the_limit():
    soc = np.linspace(0.15, 0.9, 6)
    for sign, limit in ((-1, strings.LOWER_VOLT), (1, strings.UPPER_VOLT)):
        at = {"celsius": 25.0, "pulse_second": 10.0}
        ampere = limiting_current(MODELS[1], soc, limit, sign=sign, **at)
        volt = pulse_volt(MODELS[1], soc, sign * ampere, **at)
        np.testing.assert_allclose(volt, limit, atol=2e-4)
    beyond = limiting_current(MODELS[1], np.array([1.02]), strings.UPPER_VOLT, sign=1, **at)
    assert beyond == 0.0


def test_power_is_limited_by_the_first_cell_or_by_the_allowed_current():
    now = discharge_string(MODELS, **AT, initial_soc=1.0)
    cutoffs = (strings.LOWER_VOLT, strings.UPPER_VOLT)
    free, held = (
        power_of_string(MODELS, now, initial_soc=1.0, cutoffs_volt=cutoffs, largest_c_rate=rate)
        for rate in (99.0, 1.0)
    )
    assert free[-1]["discharge_watt"] < 0.1 * free[0]["discharge_watt"]
    # Along the discharge the cell of most resistance limits first, at the end the empty one.
    assert free[0]["limiting_discharge"] == "B"
    assert free[0]["charge_watt"] == 0.0
    assert free[-1]["charge_watt"] > free[5]["charge_watt"]
    largest = 1.0 * np.median(SHARES) * strings.FULL_AMPERE_HOUR
    assert held[0]["discharge_ampere"] == pytest.approx(largest)
    assert held[0]["limiting_discharge"] == ""


def test_validation_is_exact_for_the_true_string_and_names_its_weakest():
    record, run = record_of(SHARES * 0 + 0.97)
    pack = validate_string(MODELS, places(soc=0.97), record)[0]["pack"]
    assert pack["voltage_rmse_volt"] < 1e-9
    assert pack["cell_max_abs_volt"] < 1e-9
    assert pack["lowest_cell_found_share"] == 1.0
    end = np.flatnonzero(record.current_ampere < 0)[-1]
    lowest = MODELS[int(np.argmin(run.cell_voltage_volt[end]))]["cell"]
    assert pack["weakest_by_voltage"] == lowest == "B"
    assert pack["soc_spread_end"] == pytest.approx(np.ptp(run.soc[-1]))


def test_lowest_voltage_and_lowest_soc_may_be_two_cells():
    """C has the least charge left, B the largest drop."""
    start = np.array([0.9, 0.9, 0.86, 0.9])
    record, _ = record_of(start, seconds=900.0, current=lambda t: np.where(t < 60, 0.0, -60.0))
    positions = [p._replace(initial_soc=s) for p, s in zip(places(), start, strict=True)]
    found, _ = validate_string(MODELS, positions, record)
    assert found["pack"]["weakest_by_voltage"] == "B"
    assert found["series"]["least_soc_cell"][0] == "C"
    assert found["series"]["lowest_cell"][-1] == "B"


def test_start_from_the_cells_voltages_where_nothing_is_stated():
    start = np.array([0.9, 0.85, 0.8, 0.95])
    record, _ = record_of(start)
    np.testing.assert_allclose(string_soc(MODELS, places(), record, []), start, atol=2e-3)
    stated = places()
    stated[2] = stated[2]._replace(initial_soc=0.81)
    assert string_soc(MODELS, stated, record, [])[2] == 0.81


def test_start_without_cell_voltages_is_one_for_all():
    record, _ = record_of(np.full(4, 0.7), cells=False)
    notes = []
    np.testing.assert_allclose(string_soc(MODELS, places(), record, notes), 0.7, atol=2e-3)
    assert "the same for all cells" in notes[0]


def test_the_record_of_a_discharge_to_the_cut_off_is_held_against_the_prediction():
    ended = discharge_string(MODELS, **AT, initial_soc=1.0)
    second = 600.0 + 3600.0 * ended.capacity_ampere_hour / 15.0
    record, _ = record_of(np.ones(4), seconds=second, noise=2e-4)
    found, _ = series_pack(MODELS, places(soc=1.0), FACTS, record)
    (row,) = found["pack"]
    assert row["measured_ended_by"] == row["ended_by"] == "B"
    assert row["measured_ampere_hour"] == pytest.approx(row["usable_ampere_hour"], rel=2e-3)
    assert row["measured_watt_hour"] == pytest.approx(row["usable_watt_hour"], rel=2e-3)
    assert row["discharge_ampere"] == pytest.approx(15.0)
    assert found["waterfall"][-1]["ampere_hour"] == row["usable_ampere_hour"]
    assert [cell["margin_ampere_hour"] > 0 for cell in found["cells"]] == [True, False, True, True]


def test_a_drive_is_no_capacity_test():
    record, _ = record_of(np.full(4, 0.9), current=lambda t: -15.0 * (t % 100 < 60))
    row = series_pack(MODELS, places(soc=0.9), FACTS, record)[0]["pack"][0]
    assert row["measured_ended_by"] == ""
    assert np.isnan(row["measured_ampere_hour"])
    median = np.median(SHARES) * strings.FULL_AMPERE_HOUR
    assert row["discharge_ampere"] == pytest.approx(PackDecisions().c_rate * median)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: simulate_string([], [0.0], [0.0], initial_soc=1.0), "without models"),
        (
            lambda: simulate_string(MODELS, [0, 1, 0], [0, 0, 0], initial_soc=1.0),
            "the clock runs back",
        ),
        (lambda: cutoffs_of([FACTS[0], CellFacts("X")]), "no cut-offs are stated for X"),
        (
            lambda: string_soc(
                MODELS, places(), record_of(np.ones(4), current=np.ones_like)[0], []
            ),
            "begins under load",
        ),
    ],
)
def test_refusals(call, message):
    with pytest.raises(Refusal, match=message):
        call()


def test_crossings():
    charge, volt = np.arange(4.0), np.array([4.0, 3.5, 2.5, 2.0])
    assert first_crossing(charge, volt, 3.0) == pytest.approx(1.5)
    assert first_crossing(charge, volt, 5.0) == 0.0
    assert np.isnan(first_crossing(charge, volt, 1.0))


def test_the_laboratorys_string_ends_where_the_models_say():
    """Another simulator, another integration: capacity within 0.1 %, balancing's gain as well."""
    pytest.importorskip("numba")
    from virtual_lab import protocols
    from virtual_lab.chamber import steady
    from virtual_lab.specimens import Behavioural, SeriesString

    cells = [strings.of_laboratory(*pair) for pair in zip(SHARES, FACTORS, strict=True)]
    members = tuple(Behavioural(lambda cell=cell: cell) for cell in cells)
    string = SeriesString(tuple("ABCD"), members, (steady(25.0),) * 4, (1.0,) * 4)
    steps = [protocols.discharge(cells[0].rating, 1 / 2)]
    start = np.array([0.97, 1.0, 0.93, 0.95])
    given = []
    for soc in (start, np.ones(4)):
        (behaviour,) = string.run(steps, chamber=steady(25.0), initial_soc=tuple(soc))
        given.append(15.0 * behaviour.duration_second / 3600.0)
    # The laboratory's discharge begins as it is: B is full, so that no charge comes before.
    found = balance_string(MODELS, initial_soc=start, **AT)
    assert found.as_it_is.capacity_ampere_hour == pytest.approx(given[0], rel=1e-3)
    assert found.balanced_at_top.capacity_ampere_hour == pytest.approx(given[1], rel=1e-3)
