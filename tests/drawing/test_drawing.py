"""Every figure: what was measured is what is drawn, axes say their units, and refusals do not."""

import io

import numpy as np
import pytest

import figure
from cellwright.laws.surface import FORMS
from cellwright.laws.temperature import LAWS
from drawing import (
    arrhenius,
    capacity,
    ica,
    impedance,
    ocv,
    ocv_temperature,
    overview,
    pack,
    parameters,
    polarisation,
    records,
    relaxation,
    relaxation_times,
    resistance,
    surface,
    temperature,
    validation,
)

SOC = np.linspace(0, 1, 11)
TIME = np.arange(0.0, 7200.0, 60.0)


def about(test="t", celsius=25.0, **facts):
    facts = {"ambient_temperature_celsius": celsius, "cycle": None, "soc": None} | facts
    return {"wildcards": {"cell": "A", "test": test}, "params": {"test": facts}}


def drawn(axes):
    """Data of the lines of a panel that hold any."""
    lines = [line.get_xydata() for line in axes.get_lines()]
    return [data for data in lines if len(data)]


def labels(axes):
    return [text.get_text() for text in axes.get_legend().get_texts()]


def panels(canvas):
    """Panels of a figure, after the laws of the house: each axis that is named says its unit."""
    found = canvas.get_axes()
    for panel in found:
        for name in (panel.get_xlabel(), panel.get_ylabel()):
            assert not name or "[" in name or name in FREE, name
    canvas.savefig(io.BytesIO(), format="svg")  # it can be rendered
    return found


FREE = ("all tests", "10 s into a pulse, SoC 44–56 %", "validation tests, chosen model", "cycle")
FREE += ("R", "capacity at 1C")


def capacities(size):
    return {
        "direction": np.array(["discharge", "charge"]),
        "c_rate": np.array([1.0, 0.5]),
        "capacity_ampere_hour": np.array([size, size + 0.1]),
        "capacity_std_ampere_hour": np.array([0.01, np.nan]),
    }


def test_capacity_over_rate_and_over_ageing_only_where_there_is_any():
    (fresh,) = panels(capacity.draw([(capacities(2.0), about())]))
    marks = {tuple(data[0]) for data in drawn(fresh)}
    assert {(1.0, 2.0), (1.0, 1.99), (1.0, 2.01), (0.5, 2.1)} == marks  # with caps of the error bar
    assert labels(fresh) == ["25 °C"]
    tests = [(capacities(2.0), about(cycle=0)), (capacities(1.6), about(cycle=500, celsius=None))]
    rate, age = panels(capacity.draw(tests))
    assert {xy[0, 0] for xy in drawn(age) if len(xy) == 1} == {0, 500}
    assert "temperature not stated" in labels(rate)


def test_ocv_with_one_branch_has_no_gap():
    nothing = np.full(11, np.nan)
    columns = {"soc": SOC, "ocv_volt": 3 + SOC, "discharge_volt": 3 + SOC, "charge_volt": nothing}
    single = columns | {"half_gap_volt": nothing}
    both = columns | {"half_gap_volt": np.full(11, 0.004), "charge_volt": 3.1 + SOC}
    curve, gap = panels(ocv.draw([(single, about("slow"))]))
    assert drawn(gap) == []
    np.testing.assert_allclose(drawn(curve)[-1], np.column_stack([100 * SOC, 3 + SOC]))
    assert labels(curve) == ["slow (25 °C)"]
    _, gap = panels(ocv.draw([(both, about())]))
    np.testing.assert_allclose(drawn(gap)[0][:, 1], 4.0)


def test_resistance_at_the_first_sample_and_near_ten_seconds():
    delays = np.array([0.0, 1.0, 9.0, 60.0])
    columns = {
        "delay_second": delays,
        "direction": np.array(["discharge"] * 4),
        "c_rate": np.ones(4),
        "soc": np.full(4, 0.5),
        "resistance_ohm": np.array([0.01, 0.02, 0.03, 0.04]),
        "resistance_std_ohm": np.array([1e-4, 1e-4, 1e-4, np.nan]),
    }
    first, later = panels(resistance.draw([(columns, about())]))
    assert first.get_title(loc="left") == "Resistance, first sample"
    assert later.get_title(loc="left") == "Resistance, 9 s into the pulse"
    assert any(np.allclose(xy, [[50, 30]]) for xy in drawn(later))
    assert len(panels(resistance.draw([({k: v[:1] for k, v in columns.items()}, about())]))) == 1


def test_ica_marks_the_peaks_and_needs_none():
    curve = {"voltage_volt": 3 + SOC, "dq_dv_ampere_hour_per_volt": SOC}
    peaks = {"voltage_volt": [3.5], "height_ampere_hour_per_volt": [0.5]}
    (panel,) = panels(ica.draw([(curve, peaks, about("a")), (curve, {}, about("b"))]))
    assert [text.get_text() for text in panel.texts] == ["3.500 V"]
    assert labels(panel) == ["a", "b"]


def spectrum():
    columns = {
        f"{kind}_{part}_ohm": SOC + 1
        for kind in ("impedance", "fitted")
        for part in ("real", "imaginary")
    }
    test = {f"kramers_kronig_{part}": 0.01 * np.ones(11) for part in ("real", "imaginary")}
    return columns | test | {"frequency_hertz": 10.0 ** (10 * SOC - 5), "in_fit": SOC > 0.15}


STATES = ((25, 0.5), (25, None), (0, 0.2), (None, 0.2))


def test_spectra_of_one_state_of_charge_share_a_panel():
    tests = [(spectrum(), about(celsius=c, soc=s)) for c, s in STATES]
    found = panels(impedance.draw(tests))
    titles = [panel.get_title(loc="left") for panel in found if panel.get_title(loc="left")]
    assert titles == ["SoC 20 %", "SoC 50 %", "SoC not stated"]
    points = 1e3 * np.column_stack([SOC + 1, -SOC - 1])
    np.testing.assert_allclose(drawn(found[0])[0], points[2:])
    np.testing.assert_allclose(drawn(found[0])[1], points[:2])  # left out of the fit: crosses
    assert len(drawn(found[0])) == 6


def test_spectra_of_one_temperature_share_one_panel():
    tests = [(spectrum(), about(celsius=25, soc=s)) for s in (0.2, 0.5)]
    (found,) = panels(impedance.draw(tests))
    assert found.get_title(loc="left") == "25 °C"
    assert labels(found) == ["SoC 20 %", "SoC 50 %"]


def test_of_many_states_of_charge_the_fullest_are_drawn_and_the_rest_is_counted():
    states = [(c, s / 20) for s in range(20) for c in ((0, 25) if s % 2 else (25,))]
    canvas = impedance.draw([(spectrum(), about(celsius=c, soc=s)) for c, s in states])
    assert len(panels(canvas)) == 6
    assert canvas.get_suptitle() == "14 other states not drawn"


def test_fit_of_spectra_shows_error_and_noise():
    tests = [(spectrum(), about(celsius=c, soc=s)) for c, s in STATES]
    found = panels(impedance.draw_fit(tests))
    assert len(found) == 6
    error, noise = drawn(found[3])[:2]
    np.testing.assert_allclose(error[:, 1], 0, atol=1e-9)
    np.testing.assert_allclose(noise[:, 1], np.sqrt(2))


def test_relaxation_times_are_drawn_over_frequency_with_their_peaks():
    curve = {"tau_second": 10.0 ** (4 * SOC - 2), "gamma_ohm": 1e-3 * np.sin(np.pi * SOC)}
    peaks = {"frequency_hertz": np.array([0.159, 9.0]), "in_range": np.array([True, False])}
    (found,) = panels(relaxation_times.draw([(curve, peaks, about(soc=0.5))]))
    line, tops = drawn(found)
    np.testing.assert_allclose(line[:, 1], 1e3 * curve["gamma_ohm"])
    np.testing.assert_allclose(tops, [[0.159, 1.0]], rtol=1e-2)


def law(quantity, name, *values, chosen=False, valid=(-np.inf, np.inf)):
    limits = {"valid_from_celsius": valid[0], "valid_to_celsius": valid[1]}
    return [
        {"quantity": quantity, "law": name, "value": value, "chosen": chosen} | limits
        for value in values
    ]


def test_temperature_draws_the_laws_over_the_points_and_dots_what_was_not_tested():
    celsius = np.array([0.0, 25.0, 40.0])
    points = {
        "quantity": np.array(["R"] * 3 + ["R far"] * 3 + ["capacity at 1C"] * 3),
        "unit": np.array(["Ohm"] * 6 + ["Ah"] * 3),
        "temperature_celsius": np.tile(celsius, 3),
        "value": np.array([3.0, 2.0, 1.5, 9.0, 9.0, 9.0, 1.0, 1.1, 1.2]),
        "family": np.array(["R"] * 6 + ["capacity"] * 3),
        "soc": np.array([0.5] * 3 + [0.9] * 3 + [np.nan] * 3),
    }
    laws = law("R", "quadratic", 0.0, -0.0375, 3.0) + law("R", "arrhenius", 2.0, 1e4, chosen=True)
    first, second, *empty = panels(temperature.draw(points, laws))
    assert labels(first) == ["measured", "quadratic", "arrhenius (chosen)"]
    np.testing.assert_allclose(drawn(first)[0], np.column_stack([celsius, [3.0, 2.0, 1.5]]))
    np.testing.assert_allclose(drawn(first)[2][0], [0.0, 3.0])
    assert [line.get_linestyle() for line in first.get_lines()[1:4]] == [":", "-", ":"]
    assert [line.get_xdata()[-1] for line in first.get_lines()[1:4]] == [0, 40, 45]
    assert labels(second) == ["measured"]
    assert (first.get_ylabel(), second.get_ylabel()) == ("[Ohm]", "[Ah]")
    assert empty == []


def test_a_quadratic_that_turns_says_where_and_is_dotted_from_there():
    points = {
        "quantity": np.array(["R"] * 3),
        "unit": np.array(["Ohm"] * 3),
        "temperature_celsius": np.array([0.0, 25.0, 40.0]),
        "value": np.array([3.0, 2.0, 1.9]),
        "family": np.array(["R"] * 3),
        "soc": np.array([0.5] * 3),
    }
    laws = law("R", "quadratic", 1e-3, -0.06, 3.0, valid=(-np.inf, 30.0))
    (panel,) = panels(temperature.draw(points, laws))
    assert labels(panel) == ["measured", "quadratic (turns upward at 30 °C)"]
    drawn_to = [(x.get_linestyle(), x.get_xdata()[-1]) for x in panel.get_lines()[1:]]
    assert drawn_to == [(":", 0.0), ("-", 30.0), (":", 40.0), (":", 45.0)]


def test_arrhenius_lines_have_their_residuals_beneath():
    name, celsius = "resistance at 50 % SoC, 10 s", np.array([0.0, 25.0, 40.0])
    value = LAWS["arrhenius"](celsius, 0.02, 2e4) * np.array([1.0, 1.01, 1.0])
    points = [
        {"quantity": name, "family": "resistance, 10 s", "soc": 0.5, "std": 1e-4}
        | {"temperature_celsius": c, "value": v}
        for c, v in zip(celsius, value, strict=True)
    ]
    capacity_point = {"quantity": "capacity at 1C", "family": "capacity", "soc": np.nan}
    canvas = arrhenius.draw([*points, capacity_point], law(name, "arrhenius", 0.02, 2e4))
    upper, lower = panels(canvas)
    assert labels(upper) == ["50 % SoC"]
    assert [tick.get_text() for tick in lower.get_xticklabels()] == ["0", "25", "40"]
    residual = next(xy for xy in drawn(lower) if len(xy) == 3)
    np.testing.assert_allclose(residual[:, 1], [0, 1, 0], atol=1e-9)
    assert "No resistance" in arrhenius.draw([capacity_point], []).axes[0].texts[0].get_text()


def test_a_surface_shows_the_chosen_form_and_every_forms_error_left_out():
    celsius, soc = np.repeat([0.0, 25.0], 3), np.tile([0.2, 0.5, 0.8], 2)
    ohm = np.repeat([0.04, 0.02], 3)
    points = {
        "quantity": np.array(["resistance, 10 s"] * 6),
        "soc": soc,
        "temperature_celsius": celsius,
        "resistance_ohm": ohm,
        **{f"{form}_ohm": ohm for form in FORMS},
        **{f"{form}_left_out_ohm": 1.1 * ohm for form in FORMS},
    }
    points["additive_left_out_ohm"] = np.full(6, np.nan)
    laws = law("resistance over SoC and temperature, 10 s", "table", 6.0, chosen=True)
    fitted, shape, additive, _, table = panels(surface.draw(points, laws))[:5]
    assert shape.get_title(loc="left") == "surface: table"
    assert labels(fitted) == ["0 °C", "25 °C"]
    assert "too few temperatures" in additive.texts[0].get_text()
    np.testing.assert_allclose([xy[:, 1] for xy in drawn(table) if len(xy) == 3], 10.0)
    assert table.get_title(loc="left") == "left out: table ★"


def pair(r, tau, std, kind="RC"):
    branch = {"kind": kind, "r_ohm": [r] * 11, "r_std_ohm": std}
    return branch | {"tau_second": [tau] * 11, "tau_std_second": std}


def one_member(name, branches, std=(None,) * 11):
    entry = {"soc": SOC.tolist(), "r0_ohm": [0.05] * 11, "r0_std_ohm": list(std)}
    entry |= {"branches": branches, "ocv_shift_volt": [0.002] * 11}
    conditions = [entry | {"ambient_temperature_celsius": celsius} for celsius in (0.0, None)]
    return {"chosen": name, "members": [{"model": name, "conditions": conditions}]}


@pytest.mark.parametrize("std", [[0.001] * 11, [None] * 11])
def test_parameters_with_and_without_uncertainty(std):
    model = one_member("1RC", [pair(0.02, 30.0, std)], std)
    r0, ten, hundred, settled, spread, shift = panels(parameters.draw(model))
    assert all(np.allclose(xy[:, 1], 50.0) for xy in drawn(r0) if len(xy) == 11 and not std[0])
    assert labels(r0) == ["0 °C", "temperature not stated"]
    expected = [50 + 20 * (1 - np.exp(-10 / 30)), 50 + 20 * (1 - np.exp(-100 / 30)), 70.0]
    for panel, value in zip((ten, hundred, settled), expected, strict=True):
        np.testing.assert_allclose(drawn(panel)[0][:, 1], value)
    assert any(np.allclose(xy, [[30.0, 20.0]]) for xy in drawn(spread))
    np.testing.assert_allclose(drawn(shift)[0][:, 1], 2.0)


def test_parameters_of_a_distribution_with_kinetics_hysteresis_and_diffusion():
    """Charge transfer that is not resolved has a panel of its own, not a place among the pairs."""
    none, taus = [None] * 11, np.geomspace(10, 2000, 10)
    hysteresis = {"kind": "hysteresis", "m_volt": [0.012] * 11, "m_std_volt": none}
    others = [{"kind": "diffusion", "soc_per_ampere": none, "tau_second": none}, hysteresis]
    transfer = pair(0.15, 1e-3, none, "kinetic"), pair(0.02, 1.0, none, "kinetic")
    branches = [*transfer, *(pair(0.001 * k, tau, none) for k, tau in enumerate(taus)), *others]
    found = panels(parameters.draw(one_member("DRT+H+K+D", branches)))
    assert [panel.get_title(loc="left") for panel in found] == [
        *("R0", "Charge transfer", "Resistance after 10 s", "Resistance after 100 s"),
        *("Resistance settled", "RC pairs at 50 % SoC", "Correction of the OCV"),
        "Hysteresis, either way",
    ]
    for place, value in ((1, 170.0), (4, 50 + 170 + 45), (7, 12.0)):
        np.testing.assert_allclose(drawn(found[place])[0][:, 1], value)
    line = next(xy for xy in drawn(found[5]) if len(xy) == 10)
    np.testing.assert_allclose(line, np.column_stack([taus, np.arange(10.0)]))
    kinetic = panels(parameters.draw(one_member("1RC+K", [transfer[0], branches[2]])))
    assert [panel.axison for panel in kinetic] == [True] * 7 + [False]


def test_records_colour_each_step_and_say_how_many_are_not_shown():
    series = {"test_time_second": TIME, "voltage_volt": 3 + TIME / 7200}
    steps = {"kind": np.array(["rest", "CC"]), "first_row": np.array([0, 60])}
    steps["last_row"] = np.array([59, 119])
    tests = [(series, steps, about(f"t{k}")) for k in range(5)]
    canvas = records.draw(tests, 7)
    found = panels(canvas)
    assert "(5 of 7 records)" in canvas.get_suptitle()
    assert [panel.get_title(loc="left") for panel in found[:5]] == ["t0", "t1", "t2", "t3", "t4"]
    assert [panel.axison for panel in found] == [True] * 5 + [False] * 3
    rest, constant = (np.isfinite(xy[:, 1]).sum() for xy in drawn(found[1])[:2])
    assert (rest, constant) == (60, 61)
    assert "records)" not in records.draw(tests, 5).get_suptitle()


def test_validation_shows_the_chosen_member_the_errors_of_all_and_greys_what_is_not_scored():
    series = {"test_time_second": TIME, "current_ampere": TIME * 0, "voltage_volt": 3.7 + TIME * 0}
    series |= {"simulated_1RC_volt": 3.69 + TIME * 0, "simulated_2RC_volt": 3.7 + TIME * 0}
    scores = [
        {"model": "1RC", "rmse_volt": 0.01, "chosen": False},
        {"model": "2RC", "rmse_volt": 0.0, "chosen": True},
    ]
    for scored, patches in ((TIME >= 0, 0), (TIME > 3600, 1), ((TIME // 1800) % 2 == 0, 2)):
        canvas = validation.draw(series | {"scored": scored}, scores, "udds")
        voltage, residual, _, members = panels(canvas)
        assert len(residual.patches) == patches
    assert labels(voltage) == ["measured", "2RC: RMSE 0.0 mV"]
    np.testing.assert_allclose(drawn(residual)[-1][:, 1], 0.0)
    assert [text.get_text() for text in members.get_yticklabels()] == ["1RC", "2RC (chosen)"]
    np.testing.assert_allclose([bar.get_width() for bar in members.patches], [10.0, 0.0])


def test_pack_draws_branches_measured_and_simulated():
    series = {"test_time_second": TIME, "voltage_volt": 3.7 + 0 * TIME, "scored": TIME > 3600}
    series["simulated_voltage_volt"] = 3.71 + 0 * TIME
    for k in (1, 2):
        series[f"branch_{k}_current_ampere"] = k + 0 * TIME
        series[f"simulated_branch_{k}_current_ampere"] = k - 0.02 + 0 * TIME
    scores = [{"branch": k, "current_rmse_ampere": 0.02, "voltage_rmse_volt": 0.01} for k in (1, 2)]
    current, residual, _ = panels(pack.draw(series, scores, "discharge"))
    assert labels(current) == ["branch 1: RMSE 20 mA", "branch 2: RMSE 20 mA"]
    np.testing.assert_allclose(np.concatenate(drawn(residual)[:2])[:, 1], 20.0)


def test_overview_has_a_line_for_every_cell():
    facts = {"cell": "A", "ambient_temperature_celsius": "25"}
    sizes = [facts | {"capacity_ampere_hour": "2.0", "direction": "discharge"}]
    late = facts | {"resistance_ohm": "0.03", "direction": "charge"}
    ohms = [
        late | {"soc": soc, "delay_second": s}
        for soc, s in (("0.5", "10"), ("0.9", "10"), ("0.5", "0"))
    ]
    errors = [facts | {"rmse_volt": "0.004", "ambient_temperature_celsius": "", "chosen": "True"}]
    errors.append(facts | {"rmse_volt": "0.009", "chosen": "False"})
    size, ohm, error = panels(overview.draw(["A", "B"], sizes, ohms, errors))
    assert [text.get_text() for text in size.get_yticklabels()] == ["A", "B"]
    np.testing.assert_allclose(np.concatenate(drawn(size)), [[2.0, 2]])
    np.testing.assert_allclose(np.concatenate(drawn(ohm)), [[30.0, 2]])
    np.testing.assert_allclose(np.concatenate(drawn(error)), [[4.0, 2]])
    assert labels(error) == ["25 °C", "temperature not stated"]
    panels(overview.draw([], [], [], []))


def test_a_figure_is_never_a_global():
    """Figures are made without pyplot: nothing piles up over many of them."""
    assert "pyplot" not in vars(figure)


def test_ocv_over_temperature_shows_bias_coefficient_and_functions():
    levels = np.repeat([-10.0, 25.0, 40.0], len(SOC))
    bias = {
        "temperature_celsius": levels,
        "soc": np.tile(SOC, 3),
        "bias_volt": 1e-4 * (np.tile(SOC, 3) - 0.5) * (levels - 25),
        "measured_bias_volt": 1e-4 * (np.tile(SOC, 3) - 0.5) * (levels - 25),
        "tested": np.abs(np.tile(SOC, 3) - 0.5) < 0.45,
    }
    value = np.linspace(-0.05, 0.05, len(SOC))
    entropic = {
        "source": np.array(["steps"] * len(SOC)),
        "used": np.ones(len(SOC), bool),
        "soc": SOC,
        "entropic_millivolt_per_kelvin": value,
        "lower_millivolt_per_kelvin": value - 0.01,
        "upper_millivolt_per_kelvin": value + 0.01,
    }
    errors = {"rmse_volt": 1e-3, "cross_validation_rmse_volt": 2e-3}
    functions = [
        {"function": f"{name}(T)", "chosen": name == "surface", **errors}
        for name in ("log", "surface")
    ]
    canvas = ocv_temperature.draw(
        bias, entropic, {"reference_celsius": np.full(3, 25.0)}, functions
    )
    first, _, third, fourth = panels(canvas)[:4]
    assert labels(first) == ["-10 °C", "25 °C", "40 °C"]
    assert labels(third) == ["steps (used)"]
    assert drawn(third)[0][:, 1] == pytest.approx(value)
    assert [text.get_text() for text in fourth.get_yticklabels()] == ["log", "surface ★"]
    ocv_temperature.draw(bias, entropic, {"reference_celsius": np.full(3, 25.0)}, [])


def test_polarisation_over_soc_and_temperature():
    """Medians in the lower row are those of the points, and both laws run through them."""
    points = [
        {"quantity": name, "unit": unit, "temperature_celsius": t, "soc": z, "value": size - t / 10}
        | {"std": 0.1}
        for name, unit, size in (("a", "V", 9.0), ("tau1", "s", 60.0))
        for t in (0.0, 10.0, 20.0)
        for z in (0.2, 0.5, 0.8)
    ]
    law = {"quantity": "polarisation tau1, median over SoC", "law": "linear", "chosen": True}
    laws = [law | {"value": -0.1}, law | {"value": 57.5}]
    found = panels(polarisation.draw(points, laws))
    assert [panel.get_title(loc="left") for panel in found][:2] == ["a over SoC", "tau1 over SoC"]
    median, line = drawn(found[3])
    assert median[:, 1].tolist() == [60, 59, 58]
    assert np.interp(10, line[:, 0], line[:, 1]) == pytest.approx(59)
    assert found[1].get_ylabel() == "tau1 [s]"
    assert len(panels(polarisation.draw([], []))) == 1


def test_relaxation_shows_one_rest_of_each_temperature():
    time = np.arange(0.0, 100.0, 5.0)
    columns = {"time_second": time, "voltage_volt": 3.7 - 0.01 * np.exp(-time / 20)}
    columns |= {"fitted_volt": columns["voltage_volt"] - 1e-3, "soc": np.full(20, 0.5)}
    empty = {name: np.zeros(0) for name in columns}
    tests = [(columns, about("warm", 25.0)), (columns, about("again", 25.0))]
    tests += [(columns, about("cold", -10.0)), (empty, about("none", 0.0))]
    found = panels(relaxation.draw(tests))
    assert len(found) == 4
    assert found[0].get_title(loc="left") == "-10 °C, SoC 50 %"
    assert drawn(found[2])[0][:, 1] == pytest.approx(np.ones(20))
    assert len(panels(relaxation.draw([(empty, about("none", 0.0))]))) == 1
