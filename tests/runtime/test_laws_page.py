"""Laws over temperature as people read them: a row a law, words for names, mΩ and kJ/mol."""

import pandas as pd

from runtime import laws_page

NAMES = ("quantity", "law", "parameter", "value", "unit", "lower", "upper", "std", "chosen")


def frame(*rows):
    table = pd.DataFrame([dict(zip(NAMES, row, strict=True)) for row in rows])
    about = {"r_squared": "0.9964", "tested_from_celsius": "0", "tested_to_celsius": "40"}
    return table.assign(**about, doubt="pulse_0C: drifts")


def test_a_law_is_one_row_with_its_limits_in_units_that_people_write():
    rows = [
        ("R", "arrhenius", "value_at_25_celsius", "0.0239", "Ohm", "0.0185", "0.0309", "", "True"),
        ("R", "arrhenius", "activation_energy", "12331.8", "J/mol", "1653", "23011", "", "True"),
        ("R", "quadratic", "b3", "0.0373", "Ohm", "", "", "", "False"),
        ("OCV", "linear", "entropic_coefficient", "-0.000152", "V/K", "", "", "3e-06", "True"),
        ("loss", "split", "at -20 degC", "5.29", "%", "", "", "0.4", "True"),
    ]
    found = laws_page.table(frame(*rows))
    assert found.columns == ["quantity", "law", "parameters", "R²", "tested [°C]", "doubt"]
    texts = [[cell.text for cell in row] for row in found.rows]
    both = "at 25 °C 23.9 (18.5 to 30.9) mΩ; activation energy 12.3 (1.65 to 23) kJ/mol"
    assert texts[0] == ["R", "Arrhenius", both, "0.996", "0 to 40", "pulse_0C: drifts"]
    assert texts[1][2] == "entropic coefficient -0.152 ± 0.003 mV/K"
    assert texts[2][2] == "at -20 °C 5.3 ± 0.4 %"


def test_without_a_chosen_law_there_is_no_table():
    row = ("R", "quadratic", "b3", "0.0373", "Ohm", "", "", "", "False")
    assert laws_page.table(frame(row)) is None


def test_of_many_laws_those_that_fit_worst_stand_for_all():
    quantities = [f"R at {soc} %" for soc in range(40)]
    about = ("arrhenius", "activation_energy", "2e4", "J/mol", "1e4", "3e4", "", "True")
    table = frame(*[(quantity, *about) for quantity in quantities])
    table["r_squared"] = [f"{0.5 + 0.01 * k:.2f}" for k in range(40)]
    found = laws_page.table(table)
    assert [row[0].text for row in found.rows] == quantities[:10]
    assert (found.more, found.made) == (30, "results/tables/temperature.csv")
    assert found.read.endswith("The 10 with the lowest R².")
