"""Labels that the sheet explains: read as it says, refused where the file does not have them."""

import numpy as np
import pytest

from cellwright import formats
from cellwright.refusal import Refusal

TEXT = """Zeit x;I_Kanal;U_Kanal;T_Zelle;Schritt
0,0;-1,5;3700;298,15;1
0,5;-1,5;3600;299,15;2
1,0;-1,5;3500;300,15;2
"""
COLUMNS = ("Zeit x=time h", "I_Kanal=current A", " U_Kanal=voltage mV", "T_Zelle=surface K")


def read(columns=COLUMNS, text=TEXT):
    return formats.read(text.encode(), name="a.csv", columns=columns)


def test_labels_mean_what_the_sheet_says():
    columns = read().columns
    np.testing.assert_allclose(columns["test_time_second"], [0.0, 1800.0, 3600.0])
    np.testing.assert_allclose(columns["voltage_volt"], [3.7, 3.6, 3.5])
    np.testing.assert_allclose(columns["surface_temperature_celsius"], [25.0, 26.0, 27.0])
    assert columns["step_index"].tolist() == [1, 2, 2]  # known by its own label


def test_a_label_that_would_mean_something_else_means_what_the_sheet_says():
    text = TEXT.replace("T_Zelle", "Temperature (degC)").replace("Zeit x", "Time (s)")
    stated = ("Time (s)=time h", *COLUMNS[1:3], "Temperature (degC)=ambient K")
    columns = read(stated, text).columns
    assert columns["test_time_second"][-1] == 3600.0
    assert columns["ambient_temperature_celsius"][0] == pytest.approx(25.0)
    assert "surface_temperature_celsius" not in columns


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ((*COLUMNS, "T_Luft=ambient degC"), "names 'T_Luft'; the file's labels are 'Zeit x', 'I_K"),
        (("Zeit x=time fortnight", *COLUMNS[1:]), "unit 'fortnight' of time; known: s, ms"),
        (("Zeit x=clock s", *COLUMNS[1:]), "quantities: time, current, voltage"),
        (("Zeit x=time", *COLUMNS[1:]), "unit '' of time"),
        (COLUMNS[:2], "labels found: 'Zeit x', 'I_Kanal', 'U_Kanal'"),
    ],
)
def test_what_the_sheet_cannot_mean_is_refused(columns, said):
    with pytest.raises(Refusal, match=said):
        read(columns)


def test_a_file_of_unknown_labels_is_refused_with_the_way_out():
    with pytest.raises(Refusal, match="say what they hold as `columns` in"):
        read(())
