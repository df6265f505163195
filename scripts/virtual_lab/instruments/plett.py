"""Dynamic records in the form of G. L. Plett's ESC toolbox, current positive on discharge."""

from virtual_lab.instruments.text import Written, labels_of, packed, rows_of, signed
from virtual_lab.measurement import Columns


def plett_csv(columns: Columns, *, discharge_positive: bool = True) -> bytes:
    """`time, step, current, voltage, chgAh, disAh`, each with four decimals, gzipped.

    The toolbox is MATLAB's, which writes a missing number as NaN.
    """
    sheet = [
        Written("time", columns["time_second"], 4),
        Written("step", columns["step"], 4),
        Written("current", signed(columns["current_ampere"], discharge_positive), 4),
        Written("voltage", columns["voltage_volt"], 4, missing="NaN"),
        Written("chgAh", columns["charged_ampere_hour"], 4),
        Written("disAh", columns["discharged_ampere_hour"], 4),
    ]
    return packed((labels_of(sheet) + rows_of(sheet)).replace(b",", b", "))
