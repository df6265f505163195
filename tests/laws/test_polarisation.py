"""Lines over temperature and SoC, the rests that compare, and what is said of them."""

import numpy as np
import pytest
from arrhenius import arrhenius_law

from cellwright.laws.polarisation import (
    comparable_rests,
    law_rows,
    laws_of,
    over_temperature,
    paragraph,
    soc_lines,
    temperature_lines,
)
from cellwright.refusal import Refusal

CELSIUS = np.array([-20.0, -10, 0, 10, 20])


def test_a_line_is_found_and_chosen():
    line, arrhenius = temperature_lines(CELSIUS, 100 - 1.5 * CELSIUS, unit="s")
    assert line.values[:2] == pytest.approx([-1.5, 62.5])
    assert line.r_squared == pytest.approx(1)
    assert (line.chosen, arrhenius.chosen) == (True, False)
    assert line.names == ("slope", "value_at_25_celsius", "slope_p_value")
    assert line.units == ("s/K", "s", "1")


def test_arrhenius_is_found_and_chosen():
    line, arrhenius = temperature_lines(CELSIUS, arrhenius_law(CELSIUS, 0.01, 35e3), unit="V")
    assert arrhenius.values == pytest.approx([0.01, 35e3])
    assert arrhenius.chosen
    assert not line.chosen
    assert line.cross_validation_rmse > arrhenius.cross_validation_rmse


@pytest.mark.slow
def test_slopes_are_covered_and_p_values_are_honest():
    """Without a slope p < 0.05 in 5 %; with one, its interval holds it in 95 %."""
    rng = np.random.default_rng(0)
    flat = [temperature_lines(CELSIUS, 100 + rng.normal(size=5), unit="s")[0] for _ in range(250)]
    assert np.mean([law.values[2] < 0.05 for law in flat]) == pytest.approx(0.05, abs=0.025)
    assert np.mean([law.lower[0] < 0 < law.upper[0] for law in flat]) == pytest.approx(
        0.95, abs=0.03
    )


def test_proportional_to_soc_or_not():
    soc = np.array([0.1, 0.2, 0.3, 0.4, 0.5])
    noise = 1e-4 * np.array([1, -1, 0.5, -1, 1])
    free, tied = soc_lines(soc, 0.1 * soc + noise, unit="V")
    assert tied.chosen
    assert tied.values[0] == pytest.approx(0.1, rel=0.01)
    assert free.values[free.names.index("zero_p_value")] > 0.05
    free, tied = soc_lines(soc, 0.05 + 0.1 * soc + noise, unit="V")
    assert free.chosen
    assert free.values[free.names.index("zero_p_value")] < 0.001


@pytest.mark.parametrize(
    ("fit", "axis", "value", "message"),
    [
        (temperature_lines, [0, 0, 10], [1, 1, 1], "2 temperature"),
        (temperature_lines, [0, 10, 20], [1, -1, 1], "not positive"),
        (temperature_lines, [0, 10, 20], [1, np.nan, 1], "not positive"),
        (soc_lines, [0.1, 0.2, 0.3], [1, 1, 1], "3 value"),
        (soc_lines, [0.2] * 4, [1, 2, 3, 4], "4 value"),
    ],
)
def test_refusals(fit, axis, value, message):
    with pytest.raises(Refusal, match=message):
        fit(axis, value, unit="V")


def row(celsius, soc, *, exponentials=3, current=-16.0, rest=0, grows=1.0, **other):
    """A row of stage `relaxation` of a cell whose polarisation grows with 30 kJ/mol."""
    factor = arrhenius_law(celsius, 1.0, 30e3) ** grows
    shape = 1.0 if exponentials == 3 else 0.5
    return {
        "test": f"rests_{celsius:g}C",
        "cycle": None,
        "ambient_temperature_celsius": celsius,
        "rest": rest,
        "soc": soc,
        "direction": "discharge" if current < 0 else "charge",
        "load": "CC",
        "current_before_ampere": current,
        "load_second": 720.0,
        "rest_second": 2400.0,
        "samples": 483,
        "exponentials": exponentials,
        "r_squared": 0.995,
        "a_volt": np.sign(current) * 0.01 * factor,
        "a_std_volt": 1e-4,
        "b_volt": np.sign(current) * 0.008 * factor,
        "b_std_volt": 1e-4,
        "tau1_second": shape * (60 - celsius),
        "tau1_std_second": 1.0,
        "tau2_second": 900.0 - 10 * celsius,
        "tau2_std_second": 9.0,
    } | other


def rows(**settings):
    socs = np.linspace(0.1, 0.9, 9)
    return [
        row(t, soc, rest=k, exponentials=n, **settings)
        for t in CELSIUS
        for k, soc in enumerate(socs)
        for n in (2, 3)
    ]


def test_three_exponentials_are_compared_where_told():
    rests = comparable_rests(rows())
    assert rests.exponentials == 3
    assert len(rests.points) == 4 * 45
    fewer = [
        rest
        for rest in rows()
        if rest["exponentials"] == 2 or rest["ambient_temperature_celsius"] > -5
    ]
    assert comparable_rests(fewer).exponentials == 2
    assert rests.protocol == "discharge of 16 A for 720 s, rests of 2400 s"


def test_rests_after_other_loads_are_apart():
    other = rows(current=8.0, load_second=60.0)[:20]
    rests = comparable_rests([*other, *rows()])
    assert len(rests.points) == 4 * 45
    assert all(point["value"] > 0 for point in rests.points)


def test_laws_of_a_made_cell():
    points = comparable_rests(rows()).points
    laws, reasons = laws_of(points)
    assert not reasons
    line, arrhenius = laws["polarisation a, median over SoC"]
    assert arrhenius.chosen
    assert arrhenius.values == pytest.approx([0.01, 30e3], rel=1e-3)
    line, _ = laws["polarisation tau1, median over SoC"]
    assert line.chosen
    assert line.values[0] == pytest.approx(-1.0)
    table = law_rows(laws)
    assert {row["parameter"] for row in table} >= {"slope", "slope_p_value", "activation_energy"}
    names = "quantity law parameter value std unit r_squared cross_validation_rmse chosen"
    assert set(names.split()) <= set(table[0])
    assert table[0]["tested_from_celsius"] < table[0]["tested_to_celsius"]


def test_the_paragraph_says_what_grows_and_by_which_law():
    rests = comparable_rests(rows())
    words = paragraph(rests, laws_of(rests.points)[0])
    assert "45 rests after a discharge of 16 A for 720 s" in words
    assert "left out are predicted better by Arrhenius" in words
    assert "left out are predicted better by the line" in words
    assert "must grow" not in words


def test_what_does_not_grow_in_the_cold_is_said():
    rests = comparable_rests(rows(grows=-0.3))
    words = paragraph(rests, laws_of(rests.points)[0])
    assert "Polarisation must grow in the cold: here it does not" in words


def test_the_ends_of_the_scale_are_out_of_the_median():
    rests = comparable_rests([*rows(), row(20.0, 0.02, rest=9, a_volt=-5.0)])
    celsius, value = over_temperature(rests.points)["a"]
    assert celsius.tolist() == CELSIUS.tolist()
    assert value[-1] == pytest.approx(0.01 * arrhenius_law(20.0, 1.0, 30e3))


@pytest.mark.parametrize("change", [{"exponentials": 1}, {"soc": np.nan}, {"load": "CCCV"}])
def test_nothing_to_compare_is_an_answer(change):
    rests = comparable_rests([rest | change for rest in rows()])
    assert not rests.points
    assert laws_of(rests.points) == ({}, [])
    assert paragraph(rests, {}).startswith("Polarisation is not known: no rest after a steady load")


def test_one_temperature_is_said_once():
    points = comparable_rests(
        [rest for rest in rows() if rest["ambient_temperature_celsius"] == 0]
    ).points
    laws, reasons = laws_of(points)
    assert reasons == ["polarisation over temperature: 1 temperature(s), a law needs three"]
    assert all("below 50 % SoC at 0 °C" in name for name in laws)


def test_age_does_not_pass_for_temperature():
    aged = [rest | {"cycle": 200, "a_volt": -1.0, "rest": rest["rest"] + 50} for rest in rows()]
    assert (
        max(p["value"] for p in comparable_rests([*rows(), *aged]).points if p["quantity"] == "a")
        < 0.1
    )
