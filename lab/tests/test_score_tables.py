"""Tables, curves, circuits and spoiled files of a campaign on the disk, against its truth."""

import numpy as np
import pandas as pd
import pytest

from virtual_lab.score import curves, files, missing, modes, tables


@pytest.fixture
def place(tmp_path):
    return files.campaign(tmp_path)


def put(path, rows):
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = pd.DataFrame(rows)
    if path.suffix == ".parquet":
        return rows.to_parquet(path)
    return rows.to_csv(path, index=False, sep="\t" if path.suffix == ".tsv" else ",")


def put_both(place, table, found, true):
    put(place.results / "tables" / f"{table}.csv", found)
    put(place.truth / f"{table}.csv", true)


def one(rows, quantity):
    mine = rows[rows["quantity"] == quantity]
    assert len(mine) == 1, mine
    return mine.iloc[0]


def charge(c_rate, ampere_hour, **more):
    name = {"cell": "a", "test": "t", "direction": "charge"}
    return {**name, "c_rate": c_rate, "capacity_ampere_hour": ampere_hour, **more}


def test_capacities_find_each_other_by_their_rate(place):
    found = [charge(0.998, 4.9), charge(0.334, 5.05), charge(2.9, 4.0)]
    put_both(place, "capacity", found, [charge(1 / 3, 5.0), charge(1.0, 4.8)])
    rows = tables.compare(place, "capacity")
    compared = rows[rows["status"] == "compared"]
    assert sorted(compared["error"]) == pytest.approx([0.05, 0.1])
    assert rows.loc[rows["status"] == "extra", "at"].tolist() == ["charge at 2.9C"]


def test_interval_of_a_mean_is_as_stated_whatever_its_repeats(place):
    """An offset of the ammeter is common to all three: no number of them makes it less."""
    spread = {"capacity_std_ampere_hour": 0.01, "repeats": 3}
    found = [charge(rate, 5.0 + off, **spread) for rate, off in ((1.0, 0.0195), (0.1, 0.0197))]
    put_both(place, "capacity", found, [charge(1.0, 5.0), charge(0.1, 5.0)])
    rows = tables.compare(place, "capacity").set_index("at")["inside_95"]
    assert rows.to_dict() == {"charge at 1C": True, "charge at 0.1C": False}


def test_a_test_that_the_truth_does_not_know_is_not_extra(place):
    put_both(place, "capacity", [charge(1.0, 5.0) | {"test": "other"}], [charge(1.0, 5.0)])
    status = tables.compare(place, "capacity").set_index("test")["status"]
    assert status.to_dict() == {"t": "missing", "other": "no truth"}


def test_a_table_that_was_not_made_is_all_missing(place):
    put(place.truth / "capacity.csv", [charge(1.0, 5.0), charge(0.5, 5.1)])
    assert tables.compare(place, "capacity")["status"].tolist() == ["missing", "missing"]


def test_a_blank_of_the_truth_is_no_error_of_the_results(place):
    """Physics has no constant-phase element: what was fitted has nothing to be compared with."""
    spectrum = {"cell": "a", "test": "t", "r_ohmic_ohm": 0.01, "cpe_t": 1.0}
    other = {"cell": "a", "test": "u", "r_ohmic_ohm": 0.01, "cpe_t": 1.1}
    put_both(place, "eis", [spectrum, other], [spectrum | {"cpe_t": None}, other | {"cpe_t": 1.0}])
    rows = tables.compare(place, "eis").set_index(["quantity", "test"])["status"]
    assert rows["cpe_t"].to_dict() == {"t": "no truth", "u": "compared"}


def pulse(start, ohm, delay=10, **more):
    name = {"cell": "a", "test": "t", "direction": "discharge", "start_time_second": start}
    return {**name, "delay_second": delay, "resistance_ohm": ohm, "soc": 0.5, **more}


def test_pulses_find_each_other_by_their_start_and_delay(place):
    found = [pulse(100.6, 0.021), pulse(115.1, 0.03), pulse(100.6, 0.011, delay=1)]
    true = [pulse(100.0, 0.02), pulse(115.0, 0.03), pulse(100.0, 0.01, delay=1)]
    put_both(place, "resistance", found, true)
    rows = tables.compare(place, "resistance")
    assert (rows["status"] == "compared").all()
    assert rows["quantity"].value_counts().to_dict() == {
        "resistance_ohm, 10 s": 2,
        "resistance_ohm, 1 s": 1,
        "soc": 1,
    }


def test_a_late_first_sample_is_scored_by_itself(place):
    found = [
        pulse(100, 0.02, delay=0, actual_delay_second=0.01),
        pulse(200, 0.025, delay=0, actual_delay_second=0.5),
    ]
    put_both(place, "resistance", found, [pulse(start, 0.02, delay=0) for start in (100, 200)])
    rows = tables.compare(place, "resistance")
    assert one(rows, "resistance_ohm, 0 s")["error"] == 0
    assert one(rows, "resistance_ohm, 0 s, late sample")["error"] == pytest.approx(0.005)


def test_peaks_find_each_other_within_their_rate(place):
    def peak(c_rate, volt):
        name = {"cell": "a", "test": "t", "c_rate": c_rate, "voltage_volt": volt}
        return name | {"height_ampere_hour_per_volt": 6.0}

    found = [peak(0.0501, 3.51), peak(0.0501, 3.8), peak(0.4995, 3.56)]
    put_both(place, "ica", found, [peak(0.05, 3.5), peak(0.5, 3.55), peak(0.5, 3.7)])
    rows = tables.compare(place, "ica")
    rows = rows[rows["quantity"] == "voltage_volt"]
    assert rows["status"].value_counts().to_dict() == {"compared": 2, "missing": 1, "extra": 1}
    assert rows["error"].dropna().tolist() == pytest.approx([0.01, 0.01])


def test_every_method_of_health_is_scored_and_a_knee_once_a_cell(place):
    true = [{"cell": "a", "cycle": c, "soh": 1 - c / 1e4, "knee_cycle": 850} for c in (0, 500)]
    found = [
        {"cell": "a", "cycle": c, "soh": s, "method": m, "knee_cycle": k, "soh_std": 0.01}
        for m, k in (("ocv", 860), ("rate", 900))
        for c, s in ((0, 1.0), (500, 0.96))
    ]
    put_both(place, "health", found, true)
    rows = tables.compare(place, "health")
    errors = rows.groupby("quantity")["error"].apply(list).to_dict()
    assert errors["soh, ocv"] == pytest.approx([0.0, 0.01])
    assert errors["knee_cycle, ocv"] == [10]
    assert errors["knee_cycle, rate"] == [50]


def test_degradation_modes_are_scored_with_their_intervals_but_not_the_fresh_state(place):
    def row(cycle, **losses):
        fresh = {"cell": "a", "test": f"ica_{cycle}", "cycle": cycle, "fresh_state": "a/ica_0"}
        values = dict.fromkeys(modes.MODES, 0.0) | losses
        return fresh | values | {f"{mode}_std": 0.01 for mode in modes.MODES}

    truth = dict.fromkeys(modes.MODES, 0.0) | {"cell": "a"}
    put(place.truth / "health.csv", [truth | {"cycle": c, "lli": c / 5000} for c in (0, 500)])
    found = [row(0), row(501, lli=0.11, lam_negative=0.05, lam_positive=np.nan)]
    put(place.results / "stages" / "degradation_modes" / "a.parquet", found)
    rows = modes.compare(place)
    lithium = one(rows, "lli, half cells aligned")
    assert (lithium["error"], lithium["inside_95"]) == (pytest.approx(0.01), True)
    assert one(rows, "lam_negative, half cells aligned")["inside_95"] is False
    assert one(rows, "lam_positive, half cells aligned")["status"] == "missing"


def test_laws_are_scored_coefficient_by_coefficient(place):
    law = {"cell": "a", "quantity": "capacity at 1C", "law": "arrhenius"}
    true = [{**law, "parameter": "activation_energy", "value": 2e4, "unit": "J/mol"}]
    found = [true[0] | {"value": 2.1e4, "std": 1e3}, true[0] | {"law": "quadratic"}]
    put_both(place, "temperature", found, true)
    rows = tables.compare(place, "temperature")
    row = rows[rows["status"] == "compared"].iloc[0]
    assert (row["error"], row["unit"], row["inside_95"]) == (pytest.approx(1e3), "J/mol", True)
    assert rows["status"].tolist() == ["compared", "no truth"]


SOC = np.linspace(0, 1, 101)


def curve(cell="a"):
    name = {"cell": cell, "ambient_temperature_celsius": 25}
    return [{**name, "soc": soc, "ocv_volt": 3 + soc} for soc in SOC]


def test_open_circuit_voltage_is_read_off_at_the_truths_points(place):
    put_both(
        place, "ocv", [{"cell": "a", "test": "t", "ambient_temperature_celsius": 25.4}], curve()
    )
    put(place.results / "stages/ocv/a/t.parquet", {"soc": SOC[::2], "ocv_volt": 3.002 + SOC[::2]})
    rows = curves.ocv(place)
    assert rows["error"].to_numpy() == pytest.approx(0.002)
    assert rows["quantity"].value_counts().to_dict() == {
        "ocv_volt, SoC 5–95 %": 91,
        "ocv_volt, the ends": 10,
    }


def test_a_curve_that_no_test_could_give_is_untested_not_missing(place):
    put_both(place, "ocv", [], [*curve("a"), *curve("b")])
    slow = {"cell": "a", "test": "t", "kind": "ocv", "ambient_temperature_celsius": 25}
    put(place.config / "tests.tsv", [slow])
    status = curves.ocv(place).groupby("cell")["status"].unique().map(list).to_dict()
    assert status == {"a": ["missing"], "b": ["untested"]}


def test_state_of_charge_is_taken_at_the_ends_of_the_record(place):
    true = [{"cell": "a", "test": "t", "soc_begin": 1, "soc_end": 0.2, "capacity_ampere_hour": 5}]
    run = {"cell": "a", "test": "t", "filter": "dual", "scenario": "nominal"}
    found = [
        run | {"capacity_ampere_hour": 5.1, "capacity_std_ampere_hour": 0.06},
        run | {"scenario": "current_offset", "capacity_ampere_hour": 6.0},
    ]
    put_both(place, "soc", found, true)
    series = {"soc": [1.0, 0.5, 0.21], "estimated_ekf_soc": [0.7, 0.5, 0.23]}
    series |= {"std_ekf_soc": [0.5, 0.1, 0.01]}
    put(place.results / "stages/soc_series/a/t.parquet", series)
    rows = curves.soc(place)
    assert one(rows, "soc_end, counted")["error"] == pytest.approx(0.01)
    assert one(rows, "soc_end, ekf")["inside_95"] == False  # noqa: E712
    assert one(rows, "soc_end, aekf")["status"] == "missing"
    assert one(rows, "capacity_ampere_hour, dual")["inside_95"] == True  # noqa: E712


def test_shares_of_a_group_are_integrals_of_its_simulated_branches(place):
    name = {"group": "g", "test": "t", "branch": 1, "cell": "a"}
    put(
        place.truth / "packs.csv",
        [
            name
            | {"charge_ampere_hour": 4.0, "current_max_ampere": 3.0}
            | {"capacity_ampere_hour": 4.2, "group_capacity_ampere_hour": 8}
        ],
    )
    second = np.arange(0.0, 14401.0, 10.0)
    down, up = (second < 3600) | (second >= 10800), (second >= 3600) & (second < 7200)
    ampere = np.where(down, -2.0, np.where(up, 4.0, 0.0))
    series = {"test_time_second": second, "current_ampere": 2 * ampere}
    put(
        place.results / "stages/pack_series/g/t.parquet",
        series | {"simulated_branch_1_current_ampere": ampere},
    )
    rows = curves.packs(place)
    assert one(rows, "charge_ampere_hour")["found"] == pytest.approx(4.0, abs=0.02)
    assert one(rows, "current_max_ampere")["error"] == pytest.approx(1.0)
    assert one(rows, "group_capacity_ampere_hour")["found"] == pytest.approx(4.0, abs=0.02)


def test_the_simulated_capacity_and_the_errors_of_a_group_are_scored(place):
    name = {"group": "g", "test": "t"}
    truth = {"charge_ampere_hour": 4.0, "current_max_ampere": 3.0, "capacity_ampere_hour": 4.2}
    truth |= {"group_capacity_ampere_hour": 8.0}
    scores = {"relative_current_rmse_above_15_soc": 0.01, "voltage_rmse_volt": 0.002}
    scores |= {"relative_current_rmse_below_15_soc": np.nan, "group_capacity_ampere_hour": 8.1}
    branches = [{"branch": 1, "cell": "a"}, {"branch": 2, "cell": "b"}]
    put(place.truth / "packs.csv", [name | branch | truth for branch in branches])
    put(place.results / "tables/packs.csv", [name | branch | scores for branch in branches])
    rows = curves.packs(place)
    assert one(rows, "group_capacity_ampere_hour, simulated")["error"] == pytest.approx(0.1)
    assert one(rows, "voltage_rmse_volt")["error"] == pytest.approx(0.002)
    above = rows[rows["quantity"] == "relative_current_rmse_above_15_soc"]
    assert list(above["at"]) == ["branch 1", "branch 2"]
    assert not (rows["quantity"] == "relative_current_rmse_below_15_soc").any()


def test_recuperation_belongs_to_the_discharge_around_it():
    charge = np.array([0.0, 0.0, -1.0, -0.9, -2.0, -2.0, 1.0, 1.0, 0.5, 0.6])
    assert curves.discharges(charge, least=0.3) == [(1, 4), (7, 8)]


def knots(**parameters):
    return pd.DataFrame({name: np.atleast_1d(value) for name, value in parameters.items()})


@pytest.mark.parametrize("after", [0.01, 10.0, np.inf])
def test_resistance_of_a_circuit_is_its_step_response(after):
    values = knots(r0=0.02, r1=0.01, tau1=5.0, rct=0.03, tauct=1e-3)
    found, _ = curves.resistance(values, knots(r0=0.001), after_second=after)
    arrived = [1 - np.exp(-after / tau) for tau in (5.0, 1e-3)]
    assert found == pytest.approx(0.02 + 0.01 * arrived[0] + 0.03 * arrived[1])


def test_kinetics_share_one_asinh():
    """V = s asinh((R1 + R2) I / s) in all, once it has arrived."""
    scale, current = 0.0514, 10.0
    values = knots(r0=0.0, r1=0.01, tau1=1.0, scale1=scale, r2=0.02, tau2=2.0, scale2=scale)
    found, _ = curves.resistance(values, knots(r0=0.0), after_second=np.inf, current_ampere=current)
    assert found * current == pytest.approx(scale * np.arcsinh(0.03 * current / scale))


def test_the_chosen_model_is_scored_and_only_where_it_was_identified(place):
    name = {"cell": "a", "ambient_temperature_celsius": 25}
    found = [
        {**name, "model": model, "soc": soc, "parameter": "r0", "value": ohm, "std": 0.001}
        for model, ohm in (("1RC", 0.05), ("2RC", 0.021))
        for soc in (0.2, 0.8)
    ]
    true = [{**name, "soc": s, "parameter": "r0", "value": 0.02} for s in (0.1, 0.5)]
    put_both(place, "models", found, true)
    put(place.results / "summary.csv", [{"cell": "a", "best_model": "2RC"}])
    rows = curves.circuits(place).set_index("at")
    assert rows["status"].tolist() == ["missing", "compared"]
    assert rows["error"].iloc[1] == pytest.approx(0.001)
    assert rows["inside_95"].iloc[1] == True  # noqa: E712


def test_r0_of_a_model_is_compared_at_its_first_samples(place):
    """R0 + R1 (1 − exp(−t/τ)) of both, 0.2 s after a step; the deviation is that of R0."""
    name = {"cell": "a", "ambient_temperature_celsius": 25.0}
    values = {"r0": 0.021, "r1": 0.01, "tau1": 5.0}
    found = [
        {**name, "model": "1RC", "soc": soc, "parameter": one, "value": value, "std": 0.001}
        for one, value in values.items()
        for soc in (0.2, 0.8)
    ]
    found.append({**name, "model": "1RC", "soc": np.nan, "parameter": "r0_delay", "value": 0.2})
    true = {"r0": 0.02, "r_0.1s": 0.0205, "r_0.4s": 0.0215, "r_10s": 0.03, "r_total": 0.031}
    rows = [{**name, "soc": 0.5, "parameter": one, "value": ohm} for one, ohm in true.items()]
    put_both(place, "models", found, rows)
    row = one(curves.circuits(place), "r0")
    assert row["true"] == pytest.approx(0.021)  # 0.2 s lies midway in the logarithm
    assert row["found"] == pytest.approx(0.021 + 0.01 * -np.expm1(-0.2 / 5.0))
    assert row["std"] == 0.001


def test_a_model_is_not_missed_at_a_temperature_without_tests(place):
    name = {"cell": "a", "parameter": "r0", "soc": 0.5, "value": 0.02}
    true = [{**name, "ambient_temperature_celsius": celsius} for celsius in (0, 25)]
    put_both(place, "models", [], true)
    drive = {"cell": "a", "test": "t", "kind": "drive", "ambient_temperature_celsius": 24}
    put(place.config / "tests.tsv", [drive])
    rows = curves.circuits(place).set_index("at")["status"]
    assert rows.to_dict() == {"0 °C, SoC 0.5": "untested", "25 °C, SoC 0.5": "missing"}


def test_spoiled_files_are_refused_taken_or_refused_besides(place):
    def refusal(cell, test):
        return {"cell": cell, "test": test, "file": "f", "stage": "ingest", "reason": "cut off"}

    true = [{"cell": "a", "test": t, "file": "f", "reason": "cut off"} for t in ("t", "u")]
    found = [refusal("a", "t"), refusal("b", "good"), refusal("a", None)]
    put_both(place, "excluded", found, true)
    rows = missing.refused_files(place).set_index(["cell", "test"])["status"].to_dict()
    assert rows == {("a", "t"): "compared", ("a", "u"): "missing", ("b", "good"): "extra"}


def test_what_is_missing_of_a_spoiled_file_is_not_held_against_the_pipeline(place):
    put(place.truth / "capacity.csv", [charge(1.0, 5.0), charge(1.0, 5.0) | {"test": "u"}])
    put_both(
        place,
        "excluded",
        [{"cell": "a", "test": "t", "file": "f", "stage": "ingest", "reason": "no voltage"}],
        [{"cell": "a", "test": "t", "file": "f", "reason": "cut off"}],
    )
    rows = missing.mark(place, tables.compare(place, "capacity")).set_index("test")
    assert rows["status"].to_dict() == {"t": "spoiled", "u": "missing"}
    assert rows.loc["t", "reason"] == "no voltage"


def test_spoiled_samples_are_flagged_within_a_row(place):
    fault = {"cell": "a", "test": "t", "fault": "spike", "value": 4.0}
    put(place.truth / "faults.csv", [fault | {"row": row} for row in (10, 50)])
    put(place.results / "stages/flags/a/t.parquet", {"row": [11, 70], "flag": ["spike", "gap"]})
    put(place.results / "stages/flags/b/t.parquet", {"row": [10], "flag": ["spike"]})
    rows = missing.flagged_samples(place)
    found = rows.groupby(["quantity", "status"]).size().to_dict()
    assert found == {
        ("spike", "compared"): 1,
        ("spike", "missing"): 1,
        ("flag gap", "extra"): 1,
        ("flag spike", "extra"): 1,
    }


def test_nothing_of_a_refused_test_is_taken_for_good(place):
    put(place.truth / "faults.csv", [{"cell": "a", "test": "t", "fault": "frozen", "row": 9}])
    refusal = {"cell": "a", "test": "t", "file": "f", "stage": "clean", "reason": "voltage frozen"}
    put(place.results / "tables/excluded.csv", [refusal])
    row = missing.flagged_samples(place).iloc[0]
    assert (row["status"], row["reason"]) == ("compared", "the test was refused")


def test_one_flag_answers_for_two_swapped_rows(place):
    swapped = {"cell": "a", "test": "t", "fault": "swapped", "value": 1.0}
    put(place.truth / "faults.csv", [swapped | {"row": row} for row in (20, 21, 40, 41)])
    flags = {"row": [21, 40], "flag": ["out_of_place", "out_of_place"]}
    put(place.results / "stages/flags/a/t.parquet", flags)
    assert missing.flagged_samples(place)["status"].tolist() == ["compared", "compared"]


def test_what_no_table_is_made_from_is_untested_not_missing(place):
    rows = [charge(1.0, 5.0) | {"test": test} for test in ("cap", "drive", "unlisted")]
    put(place.truth / "capacity.csv", rows)
    kinds = [
        {"cell": "a", "test": t, "kind": k} for t, k in (("cap", "capacity"), ("drive", "drive"))
    ]
    put(place.config / "tests.tsv", kinds)
    rows = missing.mark(place, tables.compare(place, "capacity")).set_index("test")["status"]
    assert rows.to_dict() == {"cap": "missing", "drive": "untested", "unlisted": "missing"}


def test_filters_are_asked_of_validation_tests_only(place):
    true = {"cell": "a", "soc_begin": 1.0, "soc_end": 0.5}
    put(place.truth / "soc.csv", [true | {"test": test} for test in ("drive", "fit", "cap")])
    kinds = {"drive": ("drive", None), "fit": ("drive", "fit"), "cap": ("capacity", None)}
    sheet = [{"cell": "a", "test": t, "kind": k, "role": r} for t, (k, r) in kinds.items()]
    put(place.config / "tests.tsv", sheet)
    rows = missing.mark(place, curves.soc(place)).groupby("test")["status"].unique().map(list)
    assert rows.to_dict() == {"drive": ["missing"], "fit": ["untested"], "cap": ["untested"]}
