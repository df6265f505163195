"""Both laws recover their truth; the thesis' table gives the activation energies it must."""

import numpy as np
import pytest
from arrhenius import arrhenius_law

from cellwright.laws.law import value_of
from cellwright.laws.points import Point
from cellwright.laws.temperature import (
    FORMS,
    drawn_pieces,
    falling_range,
    fit_laws,
    is_usable,
    law_rows,
)
from cellwright.messages import Said
from cellwright.numerics.lines import fit_line, inverse_temperature
from cellwright.numerics.statistics import r_squared
from cellwright.refusal import Refusal

CELSIUS = np.array([-20.0, -10.0, 0.0, 10.0, 25.0, 40.0])

# Thesis table 3.1: charge-transfer resistance at 20, 10, 5, 0, −10 °C, and kJ/mol by the digest,
# of the plain Arrhenius law and of the thesis' form with the factor T (eq. 3.5).
THESIS_CELSIUS = np.array([20.0, 10.0, 5.0, 0.0, -10.0])
THESIS = [
    ([9.33e-4, 2.22e-3, 3.91e-3, 6.64e-3, 2.46e-2], 70.2, 72.5),
    ([6.48e-4, 1.63e-3, 2.76e-3, 4.86e-3, 1.74e-2], 70.5, 72.8),
    ([6.80e-4, 1.56e-3, 2.60e-3, 4.48e-3, 1.60e-2], 67.7, 70.0),
]


def laws(celsius, value, **settings):
    return {law.law: law for law in fit_laws(celsius, value, unit="ohm", **settings)}


@pytest.mark.parametrize(("resistance", "plain", "with_t"), THESIS)
def test_activation_energies_of_the_thesis(resistance, plain, with_t):
    fitted = laws(THESIS_CELSIUS, resistance)
    assert fitted["arrhenius"].values[1] / 1000 == pytest.approx(plain, abs=0.05)
    assert fitted["arrhenius_t"].values[1] / 1000 == pytest.approx(with_t, abs=0.05)
    assert not fitted["quadratic"].chosen
    weighted = laws(THESIS_CELSIUS, resistance, std=0.018 * np.array(resistance))["arrhenius"]
    assert weighted.values[1] / 1000 == pytest.approx(plain, abs=0.05)  # stated error: 1.8 %
    assert weighted.lower[1] < 1000 * plain < weighted.upper[1]


@pytest.mark.parametrize(("resistance", "plain", "with_t"), THESIS)
def test_the_printed_sign_of_the_temperatures_is_worse(resistance, plain, with_t):
    right = laws(THESIS_CELSIUS, resistance)["arrhenius"]
    printed = laws(-THESIS_CELSIUS, resistance)["arrhenius"]
    of_right, of_printed = (
        r_squared(np.log(resistance), np.log(arrhenius_law(sign * THESIS_CELSIUS, *law.values)))
        for sign, law in ((1, right), (-1, printed))
    )
    assert 0.995 <= round(of_right, 3) <= 0.998
    assert 0.970 <= round(of_printed, 3) <= 0.986
    assert printed.values[1] < 0 < right.values[1]


def test_the_quadratic_of_the_thesis():
    """Table 3.4's b1, b2, b3: 2.16, 3.78 and 7.21 mΩ at 20, 0, −20 °C."""
    milliohm = 1e3 * value_of(
        FORMS["quadratic"], [20.0, 0.0, -20.0], (2.263e-6, -1.263e-4, 3.776e-3)
    )
    np.testing.assert_allclose(milliohm, [2.16, 3.78, 7.21], atol=0.006)


@pytest.mark.parametrize(
    ("law", "truth"),
    [
        pytest.param("quadratic", (2.263e-6, -1.263e-4, 3.776e-3), marks=pytest.mark.slow),
        ("arrhenius", (2e-3, 35e3)),
        pytest.param("arrhenius_t", (2e-3, 35e3), marks=pytest.mark.slow),
    ],
)
def test_truth_is_chosen_and_lies_inside_its_intervals(law, truth):
    rng = np.random.default_rng(5)
    inside, chosen = [], []
    for _ in range(100):
        value = value_of(FORMS[law], CELSIUS, truth) * (
            1 + 0.005 * rng.standard_normal(len(CELSIUS))
        )
        fitted = laws(CELSIUS, value)
        inside.append((fitted[law].lower < truth) & (fitted[law].upper > truth))
        chosen.append([form.law for form in fitted.values() if form.chosen])
    assert np.mean(inside) == pytest.approx(0.95, abs=0.04)
    # Which form of Arrhenius it is half a per cent of noise does not tell; that it is one, it does.
    assert {name.split("_")[0] for (name,) in chosen} == {law.split("_")[0]}


def test_a_point_of_large_error_weighs_less():
    value = arrhenius_law(CELSIUS, 2e-3, 3e4)
    std = 0.01 * value
    value[2] *= 1.5
    std[2] *= 50
    fitted = laws(CELSIUS, value, std=std)["arrhenius"]
    assert fitted.values[1] == pytest.approx(3e4, rel=0.01)
    stated = std[0] / value[0] / np.ptp(inverse_temperature(CELSIUS))
    assert fitted.std[1] < 2 * stated  # no scatter beyond the stated errors is found
    unknown = laws(CELSIUS, value, std=[*std[:-1], np.nan])["arrhenius"]
    plain = laws(CELSIUS, value)["arrhenius"]
    np.testing.assert_array_equal(unknown.values, plain.values)


@pytest.mark.parametrize(
    ("excess", "stated"),
    [
        pytest.param(0.3, 0.1, marks=pytest.mark.slow),
        pytest.param(0.0, 0.1, marks=pytest.mark.slow),
        (0.3, 0.0),
    ],
)
def test_scatter_beyond_the_stated_errors_is_found(excess, stated):
    """Intervals hold what they say: 95 % with excess scatter, and no less where there is none."""
    rng, x = np.random.default_rng(3), np.linspace(-1, 1, 6)
    columns, std = np.stack([np.ones(6), x], axis=1), stated * np.linspace(0.5, 2, 6)
    inside, estimated = [], []
    for _ in range(150):
        noise = np.hypot(excess, std) * rng.standard_normal(6)
        line = fit_line(columns, 1 + 2 * x + noise, std)
        lower, upper = line.interval()
        inside.append(lower[1] <= 2 <= upper[1])
        estimated.append(line.excess_std)
    assert 0.92 <= np.mean(inside) <= 1
    assert np.median(estimated) == pytest.approx(excess, abs=0.05)


def test_three_temperatures_leave_the_quadratic_unproven():
    fitted = laws([0, 20, 40], [3.0, 2.0, 1.9])
    quadratic = fitted["quadratic"]
    assert quadratic.r_squared == pytest.approx(1)
    assert np.isnan(quadratic.std).all()
    assert np.isnan(quadratic.cross_validation_rmse)
    assert quadratic.reason.startswith("as many data as parameters")
    assert fitted["arrhenius"].chosen or fitted["arrhenius_t"].chosen
    assert np.isfinite(fitted["arrhenius"].std).all()


def test_rows_without_a_temperature_are_left_out():
    value = arrhenius_law(CELSIUS, 2e-3, 3e4)
    fitted = laws([*CELSIUS, np.nan], [*value, 77.0])["arrhenius"]
    np.testing.assert_allclose(fitted.values, [2e-3, 3e4], rtol=1e-9)


@pytest.mark.parametrize(
    ("celsius", "value", "words"),
    [([20, 20, 30], [1, 1, 2], "2 temperature"), ([0, 10, 20], [1, 0, 2], "not positive")],
)
def test_too_few_temperatures_and_values_that_are_not_positive_are_refused(celsius, value, words):
    with pytest.raises(Refusal, match=words):
        fit_laws(celsius, value, unit="ohm")


def test_a_quadratic_that_turns_upward_in_the_heat_is_no_law_of_a_resistance():
    """The thesis' b1, b2, b3 turn at 27.9 °C: a law for tests to 20 °C, none for tests to 25."""
    truth, wider = (2.263e-6, -1.263e-4, 3.776e-3), np.array([-20.0, -10, 0, 10, 25])
    for celsius, chosen in ((THESIS_CELSIUS, True), (wider, False)):
        fitted = laws(celsius, np.polyval(truth, celsius), falling=True)["quadratic"]
        assert fitted.chosen is chosen
        assert fitted.valid_celsius[1] == pytest.approx(27.9, abs=0.05)
    among = np.array([-10.0, 0.0, 10.0, 25.0, 40.0, 50.0])
    value = np.polyval(truth, among)
    assert laws(among, value, falling=True)["quadratic"].rises_surely
    assert laws(among, value)["quadratic"].chosen  # of a capacity it may have a maximum, too


def test_where_a_quadratic_may_be_read():
    assert falling_range(1.0, -40.0, 900.0) == (-np.inf, 20.0)
    assert falling_range(1.0, -40.0, 300.0) == (-np.inf, 10.0)  # its zero
    assert falling_range(-1.0, 40.0, 500.0) == pytest.approx((20.0, 20 + np.sqrt(900)))
    assert falling_range(0.0, -1.0, 5.0) == (-np.inf, np.inf)
    assert not is_usable(falling_range(0.0, 1.0, 5.0), (0.0, 20.0))
    pieces = drawn_pieces((0.0, 40.0), (-np.inf, 30.0))
    assert pieces == [(-5, 0, False), (0, 30, True), (30, 40, False), (40, 45, False)]


@pytest.mark.parametrize(
    ("values", "how"),
    [
        ((1e-3, -0.03, 3.0), "turns upward at 15 °C"),
        ((-1e-3, -0.03, 4.0), "has a maximum at -15 °C"),
        ((1e-3, -0.2, 5.9), "is below zero from 36 °C on"),
    ],
)
def test_what_ends_a_resistances_quadratic_is_said_once_a_family(values, how):
    points = [
        Point(f"R{k}", "Ohm", celsius, np.polyval(values, celsius), family="resistance, 10 s")
        for k in (1, 2)
        for celsius in (-20.0, -10.0, 0.0, 10.0, 20.0, 34.0)
    ]
    rows, reasons = law_rows(points)
    (said,) = reasons
    assert "resistance, 10 s: 2 of 2 quadratic laws are not offered" in said
    assert how in said
    assert not any(row["chosen"] for row in rows if row["law"] == "quadratic")
    assert {row["valid_to_celsius"] for row in rows if row["law"] == "arrhenius"} == {np.inf}


def test_rows_hold_all_laws_of_each_quantity_and_say_what_is_missing():
    points = [Point("R", "Ohm", celsius, 1 + (celsius - 60) ** 2) for celsius in CELSIUS]
    points += [Point("Q", "Ah", celsius, 2.0 + celsius / 100) for celsius in (0, 10, 20)]
    points += [Point("short", "Ah", celsius, 2.0) for celsius in (0, 10)]
    rows, reasons = law_rows(points)
    assert [row["parameter"] for row in rows if row["quantity"] == "R"] == [
        "b1",
        "b2",
        "b3",
        *["value_at_25_celsius", "activation_energy"] * 2,
    ]
    assert rows[0]["unit"] == "Ohm/degC^2"
    assert rows[0]["chosen"]
    assert {(row["tested_from_celsius"], row["tested_to_celsius"]) for row in rows} == {
        (-20.0, 40.0),
        (0.0, 20.0),
    }
    assert [reason.split(":")[0] for reason in reasons] == ["Q, quadratic law", "short"]


def test_no_quantity_at_all_is_refused():
    with pytest.raises(Refusal, match="no quantity is known at three temperatures"):
        law_rows([])


def test_a_law_that_errs_more_than_the_mean_of_its_points_is_not_offered():
    value = [0.05, 0.9, 0.02, 0.85, 0.03, 0.8]
    points = [Point("share", "1", at, v) for at, v in zip(CELSIUS, value, strict=True)]
    points += [Point("Q", "Ah", celsius, 2.0 + celsius / 100) for celsius in CELSIUS]
    rows, reasons = law_rows(points)
    assert {row["quantity"] for row in rows if row["chosen"]} == {"Q"}
    assert any(reason.startswith("share: no law is offered") for reason in reasons)


def test_a_law_has_the_doubts_of_its_own_points_alone():
    points = [
        Point("R", "Ohm", at, 2.0 - at / 50, doubts=(Said("a: drifts", "capacity.drifts"),))
        for at in (0.0, 25.0, 40.0)
    ]
    points += [Point("Q", "Ah", celsius, 2.0 + celsius / 100) for celsius in CELSIUS]
    rows, _ = law_rows(points)
    assert {(row["quantity"], row["doubt"]) for row in rows} == {("R", "a: drifts"), ("Q", "")}


def test_a_capacity_has_no_activation_energy():
    points = [Point("Q", "Ah", c, 2.0 + c / 100, family="capacity") for c in (0, 10, 20, 30)]
    rows, _ = law_rows(points)
    assert {row["law"] for row in rows} == {"linear", "quadratic"}
    assert {row["law"] for row in rows if row["chosen"]} == {"linear"}
