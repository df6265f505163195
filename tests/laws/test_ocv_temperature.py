"""OCV over temperature: truth found in rests and in slow tests, and what cannot be known is not."""

import numpy as np
import pytest
from counted import series_of

import cellwright as cw
from cellwright.laws.ocv import over_temperature as analysis
from cellwright.laws.ocv.entropy import (
    fit_entropic,
    on_curve,
    slow_readings,
    step_readings,
    zero_crossings,
)
from cellwright.laws.ocv.over_temperature import over_temperature
from cellwright.protocols.ocv.slow import slow_ocv
from cellwright.refusal import Refusal

SOC = np.linspace(0, 1, 201)
CELSIUS = (-20.0, -10.0, 0.0, 10.0, 25.0, 40.0)
CROSSING = 0.4


def entropic(soc):
    """Truth [V/K]: negative below 40 %, positive above."""
    return 3e-4 * np.tanh((np.asarray(soc) - CROSSING) / 0.2)


def ocv(soc, celsius):
    shape = 3.6 + 0.4 * soc + 0.02 * np.log(soc + 2e-3) - 0.02 * np.log(1.002 - soc)
    return shape + entropic(soc) * (celsius - 25)


def slow(celsius, *, skew=0.0, **changes):
    """A slow test whose half gap grows in the cold; `skew` of its growth is in the mean."""
    half = 0.012 + 0.008 * np.exp((25 - celsius) / 18) * (1 + (SOC - 0.5) ** 2)
    volt = ocv(SOC, celsius)
    shown = volt + skew * (half - 0.012)
    return {
        "test": f"ocv_{celsius:g}",
        "cycle": None,
        "ambient_temperature_celsius": celsius,
        "soc": SOC,
        "ocv_volt": shown,
        "half_gap_volt": half,
        "branches": "both",
        "joined_by": "equilibrium",
        "capacity_ampere_hour": 2.0,
        "charge_capacity_ampere_hour": 2.0,
        "closed_capacity_ampere_hour": 2.0,
    } | changes


def slow_tests(**changes):
    return [slow(celsius, **changes) for celsius in CELSIUS]


def rest_rows(levels=(0.1, 0.25, 0.4, 0.55, 0.7, 0.85), noise=3e-5):
    random = np.random.default_rng(3)
    return [
        {
            "rest": number,
            "soc": soc,
            "temperature_celsius": celsius,
            "voltage_volt": ocv(soc, celsius),
            "shift_volt": entropic(soc) * (celsius - 20) + random.normal(0, noise) * (celsius < 20),
            "noise_std_volt": noise,
            "relaxation_std_volt": noise * (celsius < 20),
            "returned": False,
        }
        for number, soc in enumerate(levels, 1)
        for celsius in (20.0, 10.0, 0.0, -10.0, -20.0)
    ]


@pytest.fixture(scope="module")
def rested():
    """A cell with rests in a stepping chamber and one slow test."""
    return over_temperature([slow(25.0)], rest_rows())


def settled(entropic_fit):
    """SoC, estimate and limits where they are known."""
    finite = np.isfinite(entropic_fit.slope)
    names = ("soc", "slope", "slope_lower", "slope_upper")
    return tuple(getattr(entropic_fit, name)[finite] for name in names)


def test_rests_give_sign_size_and_crossing(rested):
    result = rested
    assert result.used == "steps"
    soc, slope, lower, upper = settled(result.entropic["steps"])
    assert np.abs(slope - entropic(soc)).max() < 6e-6
    assert np.mean((lower <= entropic(soc)) & (entropic(soc) <= upper)) > 0.8
    (crossing,) = analysis.crossings(result)
    assert crossing["lower_soc"] <= CROSSING <= crossing["upper_soc"]
    assert crossing["sign_above"] == 1
    assert result.surface.tested_celsius == (-20.0, 20.0)


@pytest.mark.parametrize("skew", [-0.6, 0.0, 0.6])
def test_overpotential_that_grows_in_the_cold_does_not_pass_for_entropy(skew):
    soc, slope, lower, upper = settled(fit_entropic(slow_readings(slow_tests(skew=skew))))
    inside = (lower <= entropic(soc)) & (entropic(soc) <= upper)
    assert inside.mean() > 0.95
    middle = (soc > 0.1) & (soc < 0.9)
    naive = np.polyfit(CELSIUS, np.stack([c["ocv_volt"] for c in slow_tests(skew=skew)]), 1)[0]
    away = np.abs(slope - entropic(soc))[middle].max()
    assert away <= np.abs(naive - entropic(SOC)).max() + 2e-5
    if skew:
        assert away < 0.5 * np.abs(naive - entropic(SOC))[20:-20].max()


def test_slow_tests_find_the_crossing_with_its_range():
    fit = fit_entropic(slow_readings(slow_tests()))
    (crossing,) = zero_crossings(
        fit.soc, fit.slope, fit.slope_std, fit.slope_lower, fit.slope_upper
    )
    assert crossing["lower_soc"] <= CROSSING <= crossing["upper_soc"]
    assert crossing["soc"] == pytest.approx(CROSSING, abs=0.02)


def test_one_branch_is_named_and_left_out():
    tests = [*slow_tests()[:2], slow(25.0, branches="discharge")]
    with pytest.raises(
        Refusal, match=r"at 2 temperature\(s\).*ocv_25: discharge branch only"
    ) as why:
        over_temperature(tests, [])
    assert "not knowable from one branch" in str(why.value)


def test_nothing_is_refused_and_so_are_rests_without_soc():
    with pytest.raises(Refusal, match="neither slow tests nor rests"):
        over_temperature([], [])
    unknown = [row | {"soc": np.nan} for row in rest_rows()]
    with pytest.raises(Refusal, match="state of charge of no rest is known"):
        step_readings(unknown)
    with pytest.raises(Refusal, match=r"2 rest\(s\) through all temperatures"):
        on_curve(step_readings(rest_rows((0.3, 0.6))), slow(25.0))


def test_age_does_not_pass_for_temperature():
    aged = [slow(celsius, cycle=500) for celsius in (-10.0, 10.0, 40.0)]
    young = [slow(celsius, cycle=0) for celsius in (0.0, 25.0)]
    with pytest.raises(Refusal, match=r"2 temperature\(s\)"):
        slow_readings([*young, *aged])


def test_soc_is_counted_from_full_where_the_remainder_stayed_inside():
    """A test that ended early holds its own ampere-hours only: its SoC is put back."""
    share = 0.9
    own_soc = 1 - share * (1 - SOC)
    short = slow(-20.0, joined_by="mean", capacity_ampere_hour=1.8)
    short |= {"charge_capacity_ampere_hour": 1.8, "ocv_volt": ocv(own_soc, -20.0)}
    others = [slow(celsius, joined_by="mean") for celsius in CELSIUS[1:]]
    readings = slow_readings([short, *others])
    column = readings.celsius[0].tolist().index(-20.0)
    finite = np.isfinite(readings.ocv_volt[:, column])
    assert readings.soc[finite].min() == pytest.approx(0.1, abs=0.006)
    error = readings.ocv_volt[finite, column] - ocv(readings.soc[finite], -20.0)
    assert np.abs(error).max() < 2e-3
    assert any("counted from full over 2 Ah" in note for note in readings.notes)


def test_what_charge_and_discharge_differ_widens_the_interval():
    exact, loose = (
        slow_readings(slow_tests(charge_capacity_ampere_hour=back)) for back in (2.0, 2.1)
    )
    spread = [np.nanmedian(fit_entropic(source).slope_std) for source in (exact, loose)]
    assert spread[1] > 2 * spread[0]
    assert any("uncertain by ±2.5 %" in note for note in loose.notes)


def test_surface_is_chosen_over_functions_and_the_control(rested):
    functions = rested.functions
    errors = {f["function"]: f["cross_validation_rmse_volt"] for f in functions}
    assert sum(f["chosen"] for f in functions) == 1
    assert errors["surface"] < errors["isothermal"] / 5
    assert errors["surface"] < min(errors[name] for name in ("log", "polynomial", "inverse"))


def test_rows_hold_what_tables_want(rested):
    result = rested
    laws = analysis.law_rows(result)
    assert {row["law"] for row in laws} == {"linear", "quadratic"}
    line = next(
        r for r in laws if r["parameter"] == "entropic_coefficient" and "30 %" in r["quantity"]
    )
    assert line["value"] == pytest.approx(entropic(0.3), abs=1e-5)
    assert line["chosen"]
    assert line["r_squared"] > 0.99
    bias = analysis.map_columns(result)
    assert not bias["tested"][bias["soc"] < 0.09].any()
    expected = entropic(bias["soc"]) * (bias["temperature_celsius"] - 20)
    assert np.abs(bias["bias_volt"] - expected)[bias["tested"]].max() < 1e-3
    table = analysis.surface_columns(result)
    assert np.array_equal(table["ocv_volt"], result.surface.ocv_volt)
    assert (table["soc"][table["tested"]][[0, -1]] == result.surface.tested_soc).all()
    assert all(row["tested_to_celsius"] == 20.0 for row in analysis.function_rows(result))
    assert set(analysis.entropic_columns(result)["source"]) == {"steps"}


def a123(folder, name, celsius):
    """One slow test of the measured A123 cell, as stage `ocv` leaves it."""
    import pandas

    parts, offset = [], (0.0, 0.0)
    for script in (1, 2, 3, 4):
        frame = pandas.read_csv(folder / f"A123_OCV_{name}_S{script}.csv.gz")
        time = frame["Test_Time(s)"].to_numpy()
        charge = (frame["Charge_Capacity(Ah)"] - frame["Discharge_Capacity(Ah)"]).to_numpy()
        columns = [time - time[0] + offset[0], frame["Current(A)"], frame["Voltage(V)"]]
        parts.append([*columns, charge - charge[0] + offset[1], np.full(len(time), script - 1)])
        offset = parts[-1][0][-1] + 3600, parts[-1][3][-1]
    *series, files = (np.concatenate(column) for column in zip(*parts, strict=True))
    curve = slow_ocv(
        series_of(*series) | {"file_index": files}, lower_cutoff_volt=2.0, upper_cutoff_volt=3.6
    )
    facts = {"test": name, "cycle": None, "ambient_temperature_celsius": celsius}
    return curve._asdict() | facts


def test_a123_has_the_small_coefficient_of_an_lfp_cell_with_its_signs(shared):
    """LFP on graphite: negative at low SoC, positive above, below 0.5 mV/K throughout."""
    folder = shared / "campaigns/a123/raw/ocv"
    names = {"N25": -25.0, "N05": -5.0, "P05": 5.0, "P25": 25.0, "P45": 45.0}
    fit = fit_entropic(slow_readings([a123(folder, *name) for name in names.items()]))
    at = {soc: round(200 * soc) for soc in (0.25, 0.4, 0.5, 0.6)}
    inside = (fit.soc >= 0.1) & (fit.soc <= 0.9)
    assert np.abs(fit.slope[inside]).max() < 5e-4
    assert fit.slope[at[0.25]] < 0
    assert all(fit.slope_lower[at[soc]] > 0 for soc in (0.4, 0.5, 0.6))
    limits = (fit.slope - fit.slope_std, fit.slope + fit.slope_std)
    crossings = zero_crossings(fit.soc, fit.slope, fit.slope_std, *limits)
    assert any(
        0.3 < crossing["soc"] < 0.37 and crossing["sign_above"] == 1 for crossing in crossings
    )


def test_the_public_interface_gives_these_tables(rested, monkeypatch):
    monkeypatch.setattr(analysis, "over_temperature", lambda *tests, **settings: rested)
    result = cw.ocv_over_temperature([slow(25.0)], rest_rows())
    np.testing.assert_equal(result.rows, analysis.law_rows(rested))
    np.testing.assert_equal(result.functions, analysis.function_rows(rested))
    for table in ("map", "entropic", "surface"):
        made = getattr(analysis, f"{table}_columns")(rested)
        np.testing.assert_equal(getattr(result, table), made)
