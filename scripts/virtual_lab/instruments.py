"""Files as instruments write them, and the same bytes each time."""

import gzip
import io
from datetime import datetime, timedelta

import numpy as np

from virtual_lab.measurement import Columns

START = datetime(2024, 3, 4, 8, 0, 0)
UNIX_START_SECOND = 1_709_539_200.0
# Text of a column: label, how its numbers are written.
BDF = {
    "time_second": ("Test Time / s", "%.3f"),
    "current_ampere": ("Current / A", "%.3f"),
    "voltage_volt": ("Voltage / V", "%.4f"),
    "step": ("Step Count / 1", "%d"),
    "ambient_celsius": ("Ambient Temperature / degC", "%.1f"),
    "surface_celsius": ("Surface Temperature T1 / degC", "%.1f"),
    "branch_1_current_ampere": ("Branch 1 Current / A", "%.3f"),
    "branch_2_current_ampere": ("Branch 2 Current / A", "%.3f"),
}
SPECTRUM = {
    "frequency_hertz": ("Frequency / Hz", "%.6g"),
    "real_ohm": ("Real Impedance / ohm", "%.7f"),
    "imaginary_ohm": ("Imaginary Impedance / ohm", "%.7f"),
    "surface_celsius": ("Surface Temperature T1 / degC", "%.1f"),
}
ARBIN = (
    "Data_Point,Test_Time(s),Date_Time,Step_Time(s),Step_Index,Cycle_Index,Current(A),Voltage(V),"
    "Charge_Capacity(Ah),Discharge_Capacity(Ah),Charge_Energy(Wh),Discharge_Energy(Wh),dV/dt(V/s),"
    "Internal_Resistance(Ohm),Is_FC_Data,AC_Impedance(Ohm),ACI_Phase_Angle(Deg),"
    "Aux_Temperature_1(C),Environment_Temperature(C)"
)
ARBIN_ROW = "%d,%.3f,%s,%.3f,%d,1,%.3f,%.4f,%.5f,%.5f,0,0,0,0,0,0,0,%.1f,%.1f"


def arbin_csv(columns: Columns, *, discharge_positive: bool = False) -> bytes:
    """An Arbin channel sheet, gzipped; energies and impedance were not logged and stay zero."""
    time, step = columns["time_second"], columns["step"]
    first = np.concatenate([[True], np.diff(step) > 0])
    begin = time[np.flatnonzero(first)][np.cumsum(first) - 1]
    date = [
        (START + timedelta(seconds=int(second))).strftime("%m/%d/%Y %H:%M:%S") for second in time
    ]
    names = ["current_ampere", "voltage_volt", "charged_ampere_hour", "discharged_ampere_hour"]
    shown = [columns[name] for name in [*names, "surface_celsius", "ambient_celsius"]]
    shown[0] = _signed(shown[0], discharge_positive)
    point = range(1, time.size + 1)
    rows = zip(point, time, date, time - begin, step, *shown, strict=True)
    return _gzipped("\n".join([ARBIN, *[ARBIN_ROW % row for row in rows], ""]))


def bdf_csv(columns: Columns, *, discharge_positive: bool = False) -> bytes:
    """Battery Data Format as csv, gzipped."""
    current = _signed(columns["current_ampere"], discharge_positive)
    return _gzipped(_csv(columns | {"current_ampere": current}, BDF))


def bdf_parquet(columns: Columns) -> bytes:
    """Battery Data Format as Parquet, with absolute time."""
    import pyarrow as pa
    from pyarrow import parquet

    named = {BDF[name][0]: columns[name] for name in BDF if name in columns}
    named["Unix Time / s"] = UNIX_START_SECOND + columns["time_second"]
    buffer = io.BytesIO()
    parquet.write_table(pa.table(named), buffer, compression="zstd")
    return buffer.getvalue()


def spectrum_csv(columns: Columns) -> bytes:
    """An impedance spectrum in the Battery Data Format."""
    return _csv(columns, SPECTRUM).encode()


def _csv(columns, labels) -> str:
    named = {name: how for name, how in labels.items() if name in columns}
    form = ",".join(how for _, how in named.values())
    rows = zip(*[columns[name] for name in named], strict=True)
    header = ",".join(label for label, _ in named.values())
    return "\n".join([header, *[form % row for row in rows], ""])


def _signed(current, discharge_positive):
    # Adding zero turns -0.0 into 0.0, which would be written as "-0.000".
    return (-current if discharge_positive else current) + 0.0


def _gzipped(text: str) -> bytes:
    """Packed without name and time, so that equal content gives equal bytes."""
    return gzip.compress(text.encode(), compresslevel=9, mtime=0)
