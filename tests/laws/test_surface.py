"""Surfaces recover their truth, join where they must, and separability is told from its lack."""

import numpy as np
import pytest
from pulse_rows import pulse

from cellwright.laws.surface import (
    Pulses,
    fit_surfaces,
    law_rows,
    point_rows,
    pulses_of,
    sentences,
    surfaces,
)
from cellwright.laws.surface_forms import fit_form, predict, separability
from cellwright.refusal import Refusal

TEMPERATURES = np.array([-20.0, -10.0, 0.0, 10.0, 20.0])
LEVELS = np.concatenate([np.arange(0.01, 0.1, 0.02), np.arange(0.1, 0.91, 0.1), [0.93, 0.96, 1.0]])
SOC, CELSIUS = (grid.ravel() for grid in np.meshgrid(LEVELS, TEMPERATURES))
THESIS = (2.263e-6, -1.263e-4, 3.776e-3)  # table 3.4: b1, b2, b3
ENDS = 0.8e-3, 30.0, 0.3e-3, 60.0  # rise [ohm] and rate at empty and full


def course(soc, *, middle=-2e-4):
    """The SoC part of a truth, written apart from the code: joined at 10 and 90 % SoC."""
    low, low_rate, high, high_rate = ENDS
    below, above = np.maximum(0.1 - soc, 0), np.maximum(soc - 0.9, 0)
    empty = low * (np.exp(low_rate * below) - 1) / (np.exp(0.1 * low_rate) - 1)
    full = high * (np.exp(high_rate * above) - 1) / (np.exp(0.1 * high_rate) - 1)
    return middle * np.clip(soc, 0.1, 0.9) + empty + full


def additive(soc, celsius):
    return course(soc) + np.polyval(THESIS, celsius)


def multiplicative(soc, celsius):
    energy = 30e3 * (1 / (celsius + 273.15) - 1 / 298.15) / 8.314462618
    return 2e-3 * np.exp(300 * course(soc) + energy)


TRUTHS = {"additive": additive, "multiplicative": multiplicative}


def pulses(truth, noise, seed=1):
    rng = np.random.default_rng(seed)
    ohm = truth(SOC, CELSIUS) * (1 + noise * rng.standard_normal(len(SOC)))
    return Pulses("resistance, first sample", SOC, CELSIUS, ohm)


def rows_of(data, **more):
    about = {"delay": 0.0, "share": 1e-3} | more
    columns = zip(data.soc, data.resistance_ohm, data.temperature_celsius, strict=True)
    return [pulse(*columns_of_one, **about) for columns_of_one in columns]


@pytest.mark.parametrize("form", TRUTHS)
def test_each_form_recovers_its_truth_without_noise(form):
    truth = TRUTHS[form]
    surface = fit_form(form, SOC, CELSIUS, truth(SOC, CELSIUS))
    at = np.linspace(0.01, 1, 41)
    np.testing.assert_allclose(predict(surface, at, 5.0), truth(at, 5.0), rtol=2e-3)
    values = dict(zip(surface.names, surface.values, strict=True))
    if form == "additive":
        np.testing.assert_allclose([values["b1"], values["b2"]], THESIS[:2], rtol=1e-3)
    else:
        assert values["activation_energy"] == pytest.approx(30e3, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("form", TRUTHS)
def test_truth_lies_within_the_stated_uncertainty(form):
    name, truth = {"additive": ("b1", THESIS[0]), "multiplicative": ("activation_energy", 30e3)}[
        form
    ]
    off = []
    for seed in range(40):
        surface = fit_form(form, *pulses(TRUTHS[form], 0.01, seed)[1:], polish=False)
        k = surface.names.index(name)
        off.append((surface.values[k] - truth) / surface.std[k])
    assert np.sqrt(np.mean(np.square(off))) == pytest.approx(1, abs=0.5)


@pytest.mark.parametrize("form", TRUTHS)
def test_the_pieces_join_at_ten_and_ninety_per_cent(form):
    surface = fit_form(form, *pulses(TRUTHS[form], 0.02)[1:])
    for joint in (0.1, 0.9):
        below, right = predict(surface, [joint - 1e-9, joint + 1e-9], -5.0)
        assert below == pytest.approx(right, rel=1e-6)


@pytest.mark.parametrize("form", TRUTHS)
def test_the_true_form_predicts_temperatures_left_out_best(form):
    fitted = fit_surfaces(pulses(TRUTHS[form], 0.005))
    assert [fit.law.law for fit in fitted if fit.law.chosen] == [form]
    for law in (fit.law for fit in fitted):
        soc_rmse = law.values[law.names.index("left_out_soc_rmse")]
        assert np.isfinite([soc_rmse, law.cross_validation_rmse]).all()


def test_an_additive_form_that_turns_upward_in_the_heat_is_not_chosen():
    """The same truth tested to 30 °C, beyond the minimum of the thesis' quadratic at 27.9 °C."""
    wider = np.array([-20.0, -10.0, 0.0, 10.0, 30.0])
    soc, celsius = (grid.ravel() for grid in np.meshgrid(LEVELS, wider))
    data = Pulses("resistance, 10 s", soc, celsius, additive(soc, celsius))
    fitted = fit_surfaces(data)
    additive_law, multiplicative_law = fitted[0].law, fitted[1].law
    assert additive_law.law == "additive"
    assert additive_law.cross_validation_rmse < multiplicative_law.cross_validation_rmse
    assert not additive_law.chosen
    assert additive_law.valid_celsius[1] == pytest.approx(27.9, abs=0.1)
    (text,) = sentences([(data, fitted, ())])
    assert "The additive form is not offered: it turns upward at 28 °C." in text


def test_a_table_is_exact_at_its_nodes_and_straight_in_between():
    ohm = multiplicative(SOC, CELSIUS)
    table = fit_form("table", SOC, CELSIUS, ohm)
    np.testing.assert_allclose(predict(table, SOC, CELSIUS), ohm, rtol=1e-12)
    # Arrhenius is a line in 1/T: between and beyond the nodes nothing is lost.
    for celsius in (-35.0, 5.0, 45.0):
        expected = multiplicative(LEVELS, celsius)
        np.testing.assert_allclose(predict(table, LEVELS, celsius), expected, rtol=1e-9)


def test_an_end_gets_the_exponentials_that_its_pulses_bear():
    def rates(low, high):
        soc = np.concatenate([low, np.linspace(0.1, 0.9, 9), high])
        soc, celsius = (grid.ravel() for grid in np.meshgrid(soc, TEMPERATURES))
        end_rates = fit_form("additive", soc, celsius, additive(soc, celsius), polish=False).rates
        return [len(end) for end in end_rates], [0.0 in end for end in end_rates]

    assert rates([], [0.95]) == ([0, 1], [False, True])
    assert rates([0.02, 0.06], [0.93, 0.96, 1.0]) == ([1, 1], [False, False])
    assert rates([0.01, 0.03, 0.05, 0.07], []) == ([2, 0], [False, False])


def test_as_many_temperatures_as_parameters_leave_their_errors_unknown():
    few = np.isin(CELSIUS, TEMPERATURES[:3])
    data = pulses(additive, 0.01)
    surface = fit_form("additive", SOC[few], CELSIUS[few], data.resistance_ohm[few])
    assert np.isnan(surface.std[:3]).all()
    assert np.isfinite(surface.std[surface.names.index("a3")])


@pytest.mark.slow
def test_what_all_pulses_of_a_temperature_share_widens_the_activation_energy():
    """Chambers off by a common part: 13 pulses at each are not 13 witnesses."""
    rng, off = np.random.default_rng(4), []
    for _ in range(60):
        shift = dict(zip(TEMPERATURES, 0.05 * rng.standard_normal(5), strict=True))
        ohm = multiplicative(SOC, CELSIUS) * np.exp([shift[c] for c in CELSIUS])
        surface = fit_form("multiplicative", SOC, CELSIUS, ohm, polish=False)
        off.append((surface.values[1] - 30e3) / surface.std[1])
    assert np.median(np.abs(off)) == pytest.approx(0.76, abs=0.35)  # of a t, 3 degrees of freedom


def test_separability_keeps_its_level_and_finds_what_does_not_separate():
    rejected = {name: [0, 0] for name in TRUTHS}
    for name, seed in ((name, seed) for name in TRUTHS for seed in range(100)):
        for k, test in enumerate(separability(*pulses(TRUTHS[name], 0.02, seed)[1:])):
            rejected[name][k] += test["p_value"] < 0.05
    assert rejected["additive"][0] <= 12
    assert rejected["multiplicative"][1] <= 12
    assert rejected["additive"][1] >= 95
    assert rejected["multiplicative"][0] >= 95


def test_the_size_of_an_interaction_is_a_share_of_the_resistance():
    """A course that tilts by ±10 % from the coldest to the warmest temperature."""

    def tilted(soc, celsius):
        return multiplicative(soc, celsius) * np.exp(0.2 * (soc - 0.5) * celsius / 20)

    _, product = separability(*pulses(tilted, 0.005)[1:])
    tilt = 0.2 * (SOC - SOC.mean()) * (CELSIUS - CELSIUS.mean()) / 20
    assert product["interaction_net"] == pytest.approx(np.sqrt(np.mean(tilt**2)), rel=0.1)
    assert 0.004 < product["scatter"] < 0.015  # noise, and what bends between the knots
    assert product["p_value"] < 1e-6


def test_pulses_of_one_rate_known_well_make_a_surface():
    good = rows_of(pulses(additive, 0.01))
    other = rows_of(pulses(additive, 0.01)._replace(resistance_ohm=SOC + 9), rate=4.0)[:12]
    vague = rows_of(pulses(additive, 0.01), share=1.0)
    chosen = pulses_of([*good, *other, *vague], direction="discharge", delay_second=0.0)
    assert len(chosen.soc) == len(good)
    assert chosen.resistance_ohm.max() < 1


def test_too_few_temperatures_or_levels_are_refused_by_name():
    rows = rows_of(pulses(additive, 0.01))
    two = [row for row in rows if row["ambient_temperature_celsius"] < -5]
    with pytest.raises(Refusal, match=r"at 2 temperature\(s\); a surface needs three"):
        pulses_of(two, direction="discharge", delay_second=0.0)
    middle = [row for row in rows if 0.45 < row["soc"] < 0.65]
    with pytest.raises(Refusal, match="4 states of charge at 0 temperature"):
        surfaces(middle)
    with pytest.raises(Refusal, match="too few to test"):
        separability([0.1, 0.5, 0.9] * 2, [0.0] * 3 + [20.0] * 3, [1.0] * 6)
    with pytest.raises(Refusal, match="separability needs two"):
        separability(LEVELS, np.zeros(len(LEVELS)), np.ones(len(LEVELS)))


def test_rows_and_words_of_a_surface():
    fits, reasons = surfaces(rows_of(pulses(multiplicative, 0.01)))
    rows = law_rows(fits)
    name = "resistance over SoC and temperature, first sample"
    assert {row["quantity"] for row in rows} == {name}
    assert next(row["law"] for row in rows if row["chosen"]) == "multiplicative"
    energy = next(row for row in rows if row["parameter"] == "activation_energy")
    assert energy["lower"] < 30e3 < energy["upper"]
    assert {(row["tested_from_celsius"], row["tested_to_celsius"]) for row in rows} == {(-20, 20)}
    assert len(point_rows(fits)) == len(SOC)
    (text,) = sentences(fits)
    assert "plus one of temperature (thesis eq. 3.11) does not describe" in text
    assert "times one of temperature describes the resistance" in text
    assert "The multiplicative form predicts temperatures left out best" in text
    assert len(reasons) == 3
