"""Several thermometers: each by its name, and none that is dead in the place of one that lives."""

from io import BytesIO

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

from cellwright import formats

ROWS = 60
SERIES = {"Test Time / s": 10.0 * np.arange(ROWS), "Current / A": np.ones(ROWS)}
SERIES |= {"Voltage / V": np.linspace(3.5, 3.6, ROWS)}
WARM = np.linspace(28.0, 32.8, ROWS)
NAME = "surface_temperature_celsius"
SECOND = "surface_temperature_2_celsius"


def read(data, name="file"):
    return formats.read(data, name=name)


def bdf(channels):
    return read(pd.DataFrame(SERIES | channels).to_csv(index=False).encode())


def structure(fields):
    """A file of MATLAB with one structure of arrays."""
    plain = {"Time": SERIES["Test Time / s"], "Current": np.ones(ROWS)}
    plain |= {"Voltage": SERIES["Voltage / V"]}
    file = BytesIO()
    savemat(file, {"meas": plain | fields})
    return read(file.getvalue())


FORMS = {
    "bdf": (bdf, "Temperature T1 / degC", "Temperature T2 / degC"),
    "matlab": (structure, "Temp_1", "Temp_2"),
}


@pytest.mark.parametrize("form", FORMS)
def test_each_keeps_its_name_and_values(form):
    make, first, second = FORMS[form]
    columns = make({first: WARM, second: WARM + 3}).columns
    np.testing.assert_allclose(columns[NAME], WARM)
    np.testing.assert_allclose(columns[SECOND], WARM + 3)


@pytest.mark.parametrize("dead", [25.0, 0.0])
@pytest.mark.parametrize("form", FORMS)
def test_a_dead_one_gives_its_place_to_the_next_and_both_are_said(form, dead):
    make, first, second = FORMS[form]
    reading = make({first: np.full(ROWS, dead), second: WARM})
    assert reading.columns[NAME].mean() == pytest.approx(30.4)
    assert SECOND not in reading.columns
    said = " ".join(reading.notes)
    assert f"{NAME} shows {dead:.4g} °C in all rows" in said
    assert "the temperature on the cell is that of its thermometer 2" in said


@pytest.mark.parametrize("form", FORMS)
def test_a_blank_or_impossible_one_is_left_out_with_a_note(form):
    make, first, second = FORMS[form]
    for shown, said in ((np.nan, "shows no number in any row"), (-4000.0, "reads -4000 °C")):
        reading = make({first: np.full(ROWS, shown), second: WARM})
        np.testing.assert_allclose(reading.columns[NAME], WARM)
        assert any(note.startswith(f"{NAME} {said}") for note in reading.notes)


def test_thermometers_that_stand_still_together_or_read_whole_degrees_live():
    still = bdf(
        {"Temperature T1 / degC": np.full(ROWS, 25.0), "Temperature T2 / degC": [24.0] * ROWS}
    )
    coarse = bdf({"Temperature T1 / degC": np.full(ROWS, 25.0), "Temperature T2 / degC": WARM / 4})
    for reading in (still, coarse):
        assert reading.columns[NAME].mean() == 25.0
        assert SECOND in reading.columns
        assert reading.notes == ()


def test_a_surface_that_is_dead_beside_the_first_channel():
    reading = bdf({"Surface Temperature / degC": [25.0] * ROWS, "Temperature T1 / degC": WARM})
    assert reading.columns[NAME].mean() == pytest.approx(30.4)


def test_a_chamber_that_is_not_connected_is_said():
    reading = bdf({"Ambient Temperature / degC": [0.0] * ROWS, "Temperature T1 / degC": WARM})
    assert "ambient_temperature_celsius shows 0 °C in all rows" in reading.notes[0]


def test_what_a_structure_of_matlab_holds_beside_is_named():
    reading = structure({"Wall_Temp": WARM})
    assert "columns that are not read: Wall_Temp" in reading.notes
