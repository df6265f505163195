"""Both laws recover their truth; the thesis' table gives the activation energies it must."""

from typing import NamedTuple

import numpy as np
import pytest

from cellwright.laws.temperature import arrhenius_law, fit_laws, law_rows, quadratic_law
from cellwright.refusal import Refusal

CELSIUS = np.array([-20.0, -10.0, 0.0, 10.0, 25.0, 40.0])

# Thesis table 3.1: charge-transfer resistance at 20, 10, 5, 0, −10 °C, and kJ/mol by the digest.
THESIS_CELSIUS = np.array([20.0, 10.0, 5.0, 0.0, -10.0])
THESIS = [
    ([9.33e-4, 2.22e-3, 3.91e-3, 6.64e-3, 2.46e-2], 70.2),
    ([6.48e-4, 1.63e-3, 2.76e-3, 4.86e-3, 1.74e-2], 70.5),
    ([6.80e-4, 1.56e-3, 2.60e-3, 4.48e-3, 1.60e-2], 67.7),
]


def laws(celsius, value):
    return {law.law: law for law in fit_laws(celsius, value, unit="ohm")}


@pytest.mark.parametrize(("resistance", "energy"), THESIS)
def test_activation_energies_of_the_thesis(resistance, energy):
    found = laws(THESIS_CELSIUS, resistance)["arrhenius"]
    assert found.values[1] / 1000 == pytest.approx(energy, abs=0.05)


@pytest.mark.parametrize(("resistance", "energy"), THESIS)
def test_the_printed_sign_of_the_temperatures_is_worse(resistance, energy):
    right = laws(THESIS_CELSIUS, resistance)["arrhenius"]
    printed = laws(-THESIS_CELSIUS, resistance)["arrhenius"]
    assert right.r_squared > printed.r_squared


@pytest.mark.parametrize(
    ("law", "truth"),
    [("quadratic", (2.263e-6, -1.263e-4, 3.776e-3)), ("arrhenius", (2e-3, 35e3))],
)
def test_truth_is_chosen_and_lies_inside_its_intervals(law, truth):
    function = {"quadratic": quadratic_law, "arrhenius": arrhenius_law}[law]
    rng = np.random.default_rng(5)
    inside = []
    for _ in range(200):
        value = function(CELSIUS, *truth) * (1 + 0.005 * rng.standard_normal(len(CELSIUS)))
        found = laws(CELSIUS, value)
        inside.append((found[law].lower < truth) & (found[law].upper > truth))
        assert found[law].chosen
        assert sum(one.chosen for one in found.values()) == 1
    assert np.mean(inside) == pytest.approx(0.95, abs=0.04)


def test_three_temperatures_leave_the_quadratic_unproven():
    found = laws([0, 20, 40], [3.0, 2.0, 1.9])
    quadratic = found["quadratic"]
    assert quadratic.r_squared == pytest.approx(1)
    assert np.isnan(quadratic.std).all()
    assert np.isnan(quadratic.cross_validation_rmse)
    assert quadratic.reason.startswith("as many data as parameters")
    assert found["arrhenius"].chosen
    assert np.isfinite(found["arrhenius"].std).all()


def test_rows_without_a_temperature_are_left_out():
    value = arrhenius_law(CELSIUS, 2e-3, 3e4)
    found = laws([*CELSIUS, np.nan], [*value, 77.0])["arrhenius"]
    np.testing.assert_allclose(found.values, [2e-3, 3e4], rtol=1e-9)


def test_two_temperatures_are_refused():
    with pytest.raises(Refusal, match=r"2 temperature\(s\)"):
        fit_laws([20, 20, 30], [1, 1, 2], unit="ohm")


def test_a_value_that_is_not_positive_is_refused():
    with pytest.raises(Refusal, match="not positive"):
        fit_laws([0, 10, 20], [1, 0, 2], unit="ohm")


class Point(NamedTuple):
    quantity: str
    unit: str
    temperature_celsius: float
    value: float


def test_rows_hold_both_laws_of_each_quantity_and_say_what_is_missing():
    points = [Point("R", "Ohm", celsius, 1.0 + celsius**2) for celsius in CELSIUS]
    points += [Point("Q", "Ah", celsius, 2.0 + celsius / 100) for celsius in (0, 10, 20)]
    points += [Point("short", "Ah", celsius, 2.0) for celsius in (0, 10)]
    rows, reasons = law_rows(points)
    assert [row["parameter"] for row in rows if row["quantity"] == "R"] == [
        "b1",
        "b2",
        "b3",
        "value_at_25_celsius",
        "activation_energy",
    ]
    assert rows[0]["unit"] == "Ohm/degC^2"
    assert rows[0]["chosen"]
    assert [reason.split(":")[0] for reason in reasons] == ["Q, quadratic law", "short"]


def test_no_quantity_at_all_is_refused():
    with pytest.raises(Refusal, match="no quantity is known at three temperatures"):
        law_rows([])
