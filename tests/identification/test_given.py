"""The model of a cell from a table: the same voltage as the table says, and what is refused."""

import numpy as np
import pytest

import cellwright as cw
from cellwright.circuits.model_file import simulate_model
from cellwright.identification.given import model_of_table
from cellwright.refusal import Refusal

SOC = np.linspace(0.0, 1.0, 51)
TABLE = {"soc": SOC, "ocv_volt": 3.0 + 1.1 * SOC, "resistance_ohm": 0.5 - 0.2 * SOC}


def given(capacity=2.0, **changes):
    return model_of_table(
        "A", TABLE | changes, capacity_ampere_hour=capacity, source="a.csv"
    ).content


def test_the_voltage_is_ocv_and_resistance_of_the_table():
    time, current = np.arange(0.0, 3600.0, 10.0), np.full(360, -1.0)
    soc = 0.9 - time / 7200.0
    run = simulate_model(given(), None, time, current, soc, 25.0)
    expected = np.interp(soc, SOC, TABLE["ocv_volt"]) - np.interp(soc, SOC, TABLE["resistance_ohm"])
    np.testing.assert_allclose(run.voltage_volt, expected, atol=1e-9)


def test_what_the_model_says_of_itself():
    model = given()
    assert (model["kind"], model["chosen"], model["capacity_ampere_hour"]) == ("given", "0RC", 2.0)
    assert model["notes"] == ["OCV and resistance over SoC as given in a.csv, 51 points"]
    turned = given(**{name: values[::-1] for name, values in TABLE.items()})
    assert turned == model
    assert cw.model_of_table("A", TABLE, capacity_ampere_hour=2.0, source="a.csv").content == model


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"capacity": None}, "wanted its capacity in Ah above zero"),
        ({"soc": 100 * SOC}, "SoC runs from 0 to 100, wanted from 0 to 1"),
        ({"soc": 0.1 + 0.9 * SOC}, "SoC runs from 0.1 to 1"),
        ({"ocv_volt": 4.0 - SOC}, "wanted one that rises"),
        ({"resistance_ohm": 0.1 - SOC}, "resistance -0.9 ohm at SoC 1, below zero"),
        ({"ocv_volt": np.where(SOC > 0.5, np.nan, 3.5)}, "ocv_volt holds"),
    ],
)
def test_refusals(changes, message):
    with pytest.raises(Refusal, match=f"a.csv of A: .*{message}"):
        given(**changes)
