"""A group simulated from its cells' models: no error for the truth, Kirchhoff, what is scored."""

from types import SimpleNamespace

import numpy as np
import pytest
import strings
import truth
from sheets_facts import branch_facts, measured_test

from cellwright.bias.scaled import scaled_reference
from cellwright.packs.cells import pack_cells
from cellwright.packs.simulate import simulate_pack
from cellwright.packs.thermal import Thermal
from cellwright.packs.uncertainty.draws import uncertainty_of
from cellwright.packs.validate import _with_energy, of_one_activation_energy, validate_group
from cellwright.packs.wiring import Wiring
from cellwright.refusal import Refusal

MODELS = [
    truth.model("A"),
    scaled_reference(truth.model(), cell="B", capacity=1.6, resistance_ratio=1.7),
]
TIME = np.arange(0.0, 6000.0, 10.0)
TOTAL = np.where(TIME < 100, 0.0, np.where(TIME % 2000 < 1500, -2.0, 1.0))
SOC, WIRE = [0.9, 0.9], [0.01, 0.0]


def branches(soc=SOC, wire=WIRE):
    return branch_facts("AB", soc, wire)


def star(wire=WIRE):
    return Wiring("pair", "parallel", ("A", "B"), tuple(v or 0.0 for v in wire), (0.0, 0.0))


def simulated(wiring, models=MODELS, soc=SOC, total=TOTAL, tables=25.0, first=(0, 1), **around):
    """Run of a pack and its record, the branch currents those of the cells `first`."""
    cells = pack_cells(models, temperature_celsius=tables)
    run = simulate_pack(TIME, total, cells, wiring, **{"initial_soc": soc} | around)
    series = {"test_time_second": TIME, "current_ampere": total, "voltage_volt": run.voltage_volt}
    currents = [run.cell_current_ampere[:, k] for k in first]
    return run, series | {f"branch_{k + 1}_current_ampere": i for k, i in enumerate(currents)}


def record(soc=SOC, wire=WIRE, models=MODELS, total=TOTAL, celsius=25.0, tables=25.0):
    return simulated(star(wire), models, soc, total, tables, ambient_celsius=celsius)[1]


def score(series, rows=None, models=MODELS, wiring=None, *, celsius=25.0, **how):
    test = measured_test(series, "pair", "group", celsius=celsius)
    rows = rows or branches()
    wired = wiring or star([row.wire_resistance_ohm for row in rows])
    tables, notes = validate_group(models, rows, test, wired, **how)
    return SimpleNamespace(**tables, notes=tuple(notes))


def test_the_truth_has_no_error_and_currents_sum_to_the_total():
    scored = score(record(), celsius=None)
    for row, model in zip(scored.rows, MODELS, strict=True):
        assert row["current_rmse_ampere"] < 1e-9
        assert row["voltage_rmse_volt"] < 1e-9
        assert row["kcl_residual_ampere"] < 1e-9
        assert row["samples"] == len(TIME)
        assert row["capacity_ampere_hour"] == model["capacity_ampere_hour"]
    assert [(row["branch"], row["cell"]) for row in scored.rows] == [(1, "A"), (2, "B")]
    assert scored.notes == ()


def test_a_cell_that_is_simulated_at_a_temperature_it_was_not_tested_at_is_told():
    (said,) = [note for note in score(record(), celsius=10.0).notes if "no test tells" in note]
    assert "A, B simulated by the activation energies that cells usually have" in said
    assert said.endswith("the record is at 10 °C")


def test_a_cell_s_own_warming_tells_how_it_is_as_far_as_it_warmed():
    def told(celsius, kelvin):
        energy = {"activation_energy_joule_per_mole": 3e4, "activation_energy_kelvin": kelvin}
        models = [_with_energy(model, energy) for model in MODELS]
        notes = score(record(), models=models, celsius=celsius).notes
        return any("that cells usually have" in note for note in notes)

    assert told(10.0, 8.0)
    assert not told(10.0, 20.0)
    assert not told(10.0, None)


def test_each_cell_runs_as_its_chosen_member():
    entry = MODELS[0]["members"][0]["conditions"][0]
    kinetic = {"kind": "kinetic", "r_ohm": [0.01] * 5, "tau_second": [1.0] * 5}
    kinetic |= {"scale_volt": [0.05] * 5}
    more = {"model": "DRT+K", "conditions": [entry | {"branches": [kinetic]}]}
    models = [MODELS[0] | {"members": [more, *MODELS[0]["members"]], "chosen": "DRT+K"}, MODELS[1]]
    scored = score(record(models=models), models=models)
    assert [row["model"] for row in scored.rows] == ["DRT+K", "2RC"]
    assert scored.rows[0]["current_rmse_ampere"] < 1e-9
    assert score(record(), models=models).rows[0]["current_rmse_ampere"] > 1e-3


def test_cells_run_at_the_temperature_that_was_logged_in_the_group():
    warm = 25.0 + 12.0 * np.minimum(TIME / 3000.0, 1.0)
    active = [strings.with_energy(model, 30e3) for model in MODELS]
    series = record(models=active, celsius=warm, tables=np.arange(25.0, 38.0, 1.0))
    known = score(series | {"surface_temperature_celsius": warm}, models=active)
    unknown = score(series, models=active)
    assert known.rows[0]["voltage_rmse_volt"] < 5e-4 < unknown.rows[0]["voltage_rmse_volt"]
    assert known.notes == ("all cells simulated at the group's measured 25 to 37 °C",)
    # Logged at each cell instead, the cells have the mean.
    at_cells = {"cell_1_temperature_celsius": warm - 2.0, "cell_2_temperature_celsius": warm + 2.0}
    assert score(series | at_cells, models=active).rows[0]["voltage_rmse_volt"] < 5e-4


def test_cells_of_one_temperature_share_an_activation_energy():
    models = [strings.with_energy(MODELS[0], 30e3), strings.with_energy(MODELS[1], 50e3)]
    shared, (words,) = of_one_activation_energy(models)
    energies = [
        m["members"][0]["conditions"][0]["activation_energy_joule_per_mole"] for m in shared
    ]
    assert energies == [40e3, 40e3]
    assert "40 kJ/mol for all cells" in words
    alike = [strings.with_energy(model, 30e3) for model in MODELS]
    assert of_one_activation_energy(alike) == (alike, [])
    assert of_one_activation_energy(MODELS) == (MODELS, [])
    several = models[1]["members"][0] | {"conditions": 2 * models[1]["members"][0]["conditions"]}
    own = [models[0], models[1] | {"members": [several]}]
    assert of_one_activation_energy(own) == (own, [])
    lent, (words,) = of_one_activation_energy([MODELS[0], own[1]])
    energy = lent[0]["members"][0]["conditions"][0]["activation_energy_joule_per_mole"]
    assert (energy, lent[1]) == (50e3, own[1])
    assert "the mean of the group's other cells" in words


DISCHARGE = np.where((TIME < 100) | (TIME >= 4600), 0.0, -2.6)


@pytest.fixture(scope="module")
def discharged():
    return score(record(total=DISCHARGE), models=MODELS)


def test_the_capacity_of_the_group_is_found_again(discharged):
    (finding,) = discharged.findings
    given = 2.6 * 4500.0 / 3600.0
    assert finding["group_capacity_ampere_hour"] == pytest.approx(given, rel=5e-3)
    assert finding["cells_capacity_ampere_hour"] == pytest.approx(3.6)
    assert finding["lost_ampere_hour"] == pytest.approx(3.6 - given, abs=0.02)
    for row in discharged.rows:
        assert abs(row["group_capacity_error"]) < 1e-3
        assert row["charge_ampere_hour"] < given
    assert sum(r["charge_ampere_hour"] for r in discharged.rows) == pytest.approx(given, rel=5e-3)


def test_a_model_of_less_capacity_ends_earlier_and_of_more_later():
    for factor in (0.9, 1.1):
        models = [m | {"capacity_ampere_hour": factor * m["capacity_ampere_hour"]} for m in MODELS]
        (finding,) = score(record(total=DISCHARGE), models=models).findings
        ratio = (
            finding["simulated_group_capacity_ampere_hour"] / finding["group_capacity_ampere_hour"]
        )
        assert ratio == pytest.approx(factor, abs=0.02)


def test_what_is_found_of_the_truth_is_the_same_measured_and_simulated(discharged):
    (finding,) = discharged.findings
    for name in ("peak_share", "spread_above_15_soc", "circulating_ampere"):
        assert finding[f"simulated_{name}"] == pytest.approx(finding[name])
        assert finding[name] > 0
    share = discharged.series["branch_1_current_ampere"][10:460] / -1.3
    assert finding["peak_share"] == pytest.approx(
        np.maximum(share, 2 - share)[1:-1].max(), rel=1e-6
    )
    assert sum(row["samples"] for row in discharged.spread) == 450
    assert all(row["relative_current_rmse"] < 1e-9 for row in discharged.spread)


def test_without_a_whole_discharge_no_capacity_is_told():
    (finding,) = score(record()).findings
    assert np.isnan(finding["group_capacity_ampere_hour"])
    assert np.isnan(finding["peak_share"])
    assert finding["branches"] == 2


def test_errors_above_and_below_15_percent_are_told_apart(discharged):
    series = record(total=DISCHARGE)
    low = discharged.series["soc"] <= 0.15
    series["branch_1_current_ampere"] = series["branch_1_current_ampere"] + 0.13 * low
    first = score(series, models=MODELS).rows[0]
    assert first["mean_branch_current_ampere"] == pytest.approx(1.3)
    assert first["relative_current_rmse_below_15_soc"] == pytest.approx(0.1)
    assert first["relative_current_rmse_above_15_soc"] < 1e-9


def test_offsets_of_the_sensors_are_read_at_the_start_where_the_group_is_at_equilibrium():
    long = np.where(TIME < 600, 0.0, TOTAL)
    series = record(total=long)
    series["branch_1_current_ampere"] = series["branch_1_current_ampere"] + 0.02
    first, second = score(series, branches(soc=[None, None])).rows
    assert first["sensor_offset_ampere"] == pytest.approx(0.02, abs=1e-3)
    assert second["sensor_offset_ampere"] == pytest.approx(0.0, abs=1e-3)
    assert score(series).rows[0]["sensor_offset_ampere"] == 0.0


def test_an_error_of_one_sensor_is_that_branch_alone():
    series = record()
    series["branch_2_current_ampere"] = series["branch_2_current_ampere"] + 0.05
    first, second = score(series).rows
    assert first["current_rmse_ampere"] < 1e-9
    assert second["current_rmse_ampere"] == pytest.approx(0.05)
    assert second["current_max_ampere"] == pytest.approx(0.05)


def fitted(start, stop, test="pair"):
    span = {"test": test, "from_second": start, "to_second": stop}
    return [MODELS[0] | {"fitted": span}, MODELS[1]]


def test_what_a_model_was_fitted_to_is_not_scored():
    series = record()
    seen = (TIME >= 1000.0) & (TIME <= 3000.0)
    series["branch_1_current_ampere"] = series["branch_1_current_ampere"] + seen
    series["branch_2_current_ampere"] = series["branch_2_current_ampere"] - seen
    scored = score(series, models=fitted(1000.0, 3000.0))
    np.testing.assert_array_equal(scored.series["scored"], ~seen)
    assert scored.rows[0]["current_max_ampere"] < 1e-9
    assert scored.rows[0]["samples"] == (~seen).sum()
    assert scored.notes == (f"{seen.mean():.0%} of the record was fitted, and is not scored",)
    other = score(series, models=fitted(1000.0, 3000.0, test="another"))
    assert other.series["scored"].all()
    with pytest.raises(Refusal, match="nothing is left to score"):
        score(series, models=fitted(0.0, 6000.0))


def test_models_of_a_group_from_before_their_sensors_noise_was_stated_still_serve():
    span = fitted(1000.0, 3000.0)[0]["fitted"] | {"sensor_offset_ampere": 0.02}
    models = [model | {"fitted": span} for model in MODELS]
    rows = score(record(), branches(soc=[0.8, 0.9]), models=models).rows
    assert [row["sensor_offset_ampere"] for row in rows] == [0.02, 0.02]


def test_soc_at_the_start_is_found_from_the_rest_voltage_where_not_stated():
    scored = score(record(), branches(soc=[None, None]))
    assert scored.notes[0] == "SoC at the start read from the group's rest voltage"
    assert scored.rows[0]["current_rmse_ampere"] < 2e-3
    mixed = score(record(soc=[0.8, 0.9]), branches(soc=[0.8, None]))
    assert mixed.series["simulated_voltage_volt"][0] == pytest.approx(
        record([0.8, 0.9])["voltage_volt"][0], abs=0.03
    )
    loaded = record() | {"current_ampere": TOTAL - 1.0}
    with pytest.raises(Refusal, match="initial_soc is not stated"):
        score(loaded, branches(soc=[0.9, None]))


def test_wires_that_are_not_stated_are_none_and_it_is_said():
    scored = score(record(wire=[0.01, 0.0]), branches(wire=[0.01, None]))
    assert scored.rows[0]["current_rmse_ampere"] < 1e-9
    assert scored.notes == ("wire resistances are not stated: taken as none beyond the cells' own",)


def test_strings_in_parallel_are_scored_by_string():
    def string(name, *cells):
        return Wiring(name, "series", cells, (0.0, 0.0), (0.0, 0.0))

    wiring = Wiring(
        "pair", "parallel", (string("s", "A", "B"), string("t", "C", "D")), (0.01, 0.0), (0.0, 0.0)
    )
    models, soc = [*MODELS, *MODELS[::-1]], [0.9, 0.8, 0.85, 0.9]
    _, series = simulated(wiring, models, soc, first=(0, 2))
    about = series, branch_facts("st", [None, None]), models, wiring
    scored = score(*about, leaves=branch_facts("ABCD", soc))
    assert [row["cell"] for row in scored.rows] == ["s", "t"]
    for row in scored.rows:
        assert row["current_rmse_ampere"] < 1e-9
        assert row["capacity_ampere_hour"] == 1.6
    with pytest.raises(Refusal, match="does not tell the SoC of each cell"):
        score(*about)


def test_refuses_other_wirings():
    chain = star()._replace(connection="series")
    with pytest.raises(Refusal, match=r"found A \+ B, wanted members in parallel"):
        score(record(), wiring=chain)


def test_a_branch_that_was_not_logged_is_the_total_less_the_others():
    series = record()
    lacking = {k: v for k, v in series.items() if k != "branch_2_current_ampere"}
    scored = score(lacking)
    assert scored.rows[1]["current_rmse_ampere"] < 1e-9
    words = "current of B not logged: taken as the total minus the other branches"
    assert words in scored.notes
    alone = {k: v for k, v in lacking.items() if k != "branch_1_current_ampere"}
    scored = score(alone)
    assert np.isnan(scored.rows[0]["current_rmse_ampere"])
    assert scored.rows[0]["voltage_rmse_volt"] < 1e-9
    assert scored.notes == ("no branch current was logged: the voltage alone is scored",)


def test_branch_currents_that_contradict_the_total_are_not_scored():
    turned = record()
    turned["branch_2_current_ampere"] = -turned["branch_2_current_ampere"]
    with pytest.raises(Refusal, match=r"miss the total by .*branch 2 alone explains .* sign"):
        score(turned)


def test_a_cell_beyond_its_calibration_is_said_with_its_name():
    beyond = MODELS[1] | {"notes": ["outside the calibration, its interval is wider: capacity"]}
    notes = score(record(), models=[MODELS[0], beyond]).notes
    assert "B: outside the calibration, its interval is wider: capacity" in notes


BODY = {"heat_capacity_joule_per_kelvin": [30.0, 30.0], "resistance_kelvin_per_watt": [9.0, 9.0]}


def test_where_no_temperature_was_logged_cells_warm_by_their_own_heat():
    """Two cells whose resistances halve within 20 K."""
    models = [strings.with_energy(model, 30e3) for model in MODELS]
    thermal = Thermal(*map(np.array, BODY.values()), 0.0, None, np.zeros((2, 3)))
    around = {"ambient_celsius": 25.0, "thermal": thermal}
    run, series = simulated(star(), models, SOC, 2.0 * TOTAL, np.arange(25.0, 70.0, 5.0), **around)
    assert np.ptp(run.temperature_celsius) > 3.0
    plain, warm = (score(series, models=models, thermal=how) for how in (None, thermal))
    assert warm.rows[0]["voltage_rmse_volt"] < 0.1 * plain.rows[0]["voltage_rmse_volt"]
    assert any("own heat" in note for note in warm.notes)
    logged = series | {"surface_temperature_celsius": run.temperature_celsius.mean(axis=1)}
    notes = score(logged, models=models, thermal=thermal).notes
    assert not any("own heat" in note for note in notes)


def test_branch_currents_have_intervals_where_it_is_known_how_sure_the_cells_are():
    found = score(record(), uncertainty=uncertainty_of(MODELS, [None, None]))
    assert "no intervals: the error of the model of A, B is not known" in found.notes
    assert np.isnan(found.rows[0]["current_interval_ampere"])
    known = [with_left_out(model) for model in MODELS]
    found = score(record(), models=known, uncertainty=uncertainty_of(known, [None, None]))
    for row in found.rows:
        assert row["current_interval_ampere"] > 0
        assert row["current_inside_interval"] == row["voltage_inside_interval"] == 1.0
    assert found.rows[0]["voltage_interval_volt"] > 1.64 * 0.002
    assert found.series["branch_2_current_std_ampere"].shape == TIME.shape


def with_left_out(model):
    return model | {"members": [m | {"left_out_rmse_volt": 0.002} for m in model["members"]]}
