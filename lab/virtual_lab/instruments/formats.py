"""Each instrument's file format: Arbin, Bitrode, Plett's toolbox, Battery Data Format, Digatron."""

import io

import numpy as np

from virtual_lab.instruments.measurement import Columns
from virtual_lab.instruments.text import (
    UNIX_START_SECOND,
    Written,
    cycles,
    date_texts,
    energy_watt_hour,
    labels_of,
    packed,
    rows_of,
    same,
    signed,
    step_begins,
)


def arbin_csv(columns: Columns, *, discharge_positive: bool = False) -> bytes:
    """An Arbin channel sheet (csv), gzipped; energies and impedance were not logged: zero."""
    time, step = columns["time_second"], columns["step"]
    point, nothing = np.arange(1, time.size + 1), same(0, time.size)
    sheet = [
        Written("Data_Point", point),
        Written("Test_Time(s)", time, 3),
        Written("Date_Time", date_texts(time, day="%m/%d/%Y", clock="%H:%M:%S")),
        Written("Step_Time(s)", time - time[step_begins(step)], 3),
        Written("Step_Index", step),
        Written("Cycle_Index", cycles(columns)),
        Written("Current(A)", signed(columns["current_ampere"], discharge_positive), 3),
        Written("Voltage(V)", columns["voltage_volt"], 4),
        Written("Charge_Capacity(Ah)", columns["charged_ampere_hour"], 5),
        Written("Discharge_Capacity(Ah)", columns["discharged_ampere_hour"], 5),
        Written("Charge_Energy(Wh)", nothing),
        Written("Discharge_Energy(Wh)", nothing),
        Written("dV/dt(V/s)", nothing),
        Written("Internal_Resistance(Ohm)", nothing),
        Written("Is_FC_Data", nothing),
        Written("AC_Impedance(Ohm)", nothing),
        Written("ACI_Phase_Angle(Deg)", nothing),
        Written("Aux_Temperature_1(C)", columns["surface_celsius"], 1),
        Written("Environment_Temperature(C)", columns["ambient_celsius"], 1),
    ]
    return packed(labels_of(sheet) + rows_of(sheet))


IDLE_AMPERE = 0.02


def bitrode_csv(
    columns: Columns, *, discharge_positive: bool = False, header: bool = True
) -> bytes:
    """A Bitrode record (csv), gzipped, with or without the header line.

    Ampere-hours and watt-hours begin again with each step of current. Real files (Nissan Leaf,
    ORNL) have a coarser resolution (0.1 s, 10 mA, 1 mV); short pulses need the digits written
    here.
    """
    time, step, rows = columns["time_second"], columns["step"], columns["step"].size
    current = signed(columns["current_ampere"], discharge_positive)
    one, begin = same(1, rows), step_begins(step)
    mode = _bitrode_modes(columns["current_ampere"], begin)
    charge = columns["charged_ampere_hour"] - columns["discharged_ampere_hour"]
    loaded = mode != "REST"
    sheet = [
        Written("Exclude", same("No", rows)),
        Written("Time(s)", time, 3),
        Written("Cycle", cycles(columns)),
        Written("Loop", one),
        Written("Loop", one),
        Written("Loop", one),
        Written("Step", step),
        Written("StepTime(s)", time - time[begin], 3),
        Written("Current(A)", current, 3),
        Written("Voltage(V)", columns["voltage_volt"], 4),
        Written("Power(W)", np.nan_to_num(columns["voltage_volt"]) * current, 3),
        Written("Capacity(Ah)", _counted_within_step(charge, begin, loaded), 4),
        Written("Energy(Wh)", _counted_within_step(energy_watt_hour(columns), begin, loaded), 4),
        Written("Mode", mode),
        Written("Data", np.where(np.append(np.diff(begin) > 0, True), "S", " ")),  # S: step ends
    ]
    return packed((labels_of(sheet) if header else b"") + rows_of(sheet))


def _bitrode_modes(current, begin):
    """Mode of each row's step: charge or discharge by the sign of its charge.

    REST where the mean current is no more than the ammeter's offset.
    """
    first = np.unique(begin)
    flowed = np.add.reduceat(np.nan_to_num(current), first)
    size = np.add.reduceat(np.abs(np.nan_to_num(current)), first)
    idle = size <= IDLE_AMPERE * np.diff(np.append(first, current.size))
    named = np.where(idle, "REST", np.where(flowed > 0, "CHRG", "DCHG"))
    return named[np.searchsorted(first, begin)]


def _counted_within_step(counter, begin, loaded):
    """A counter since the row before the step; a rest shows the last value of the step before."""
    before = counter[np.maximum(begin - 1, 0)]
    within = counter - np.where(begin > 0, before, 0.0)
    last = np.maximum.accumulate(np.where(loaded, np.arange(loaded.size), -1))
    return np.where(last < 0, 0.0, within[np.maximum(last, 0)]) + 0.0


def plett_csv(columns: Columns, *, discharge_positive: bool = True) -> bytes:
    """A dynamic record in the form of G. L. Plett's ESC toolbox (csv), gzipped.

    `time, step, current, voltage, chgAh, disAh`, each with four decimals; current positive on
    discharge. The toolbox is MATLAB's, which writes a missing number as NaN.
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


# Label and decimals of each column, in the file's order.
BDF_COLUMNS = {
    "time_second": ("Test Time / s", 3),
    "current_ampere": ("Current / A", 3),
    "voltage_volt": ("Voltage / V", 4),
    "step": ("Step Count / 1", None),
    "cycle": ("Cycle Count / 1", None),
    "ambient_celsius": ("Ambient Temperature / degC", 1),
    "surface_celsius": ("Surface Temperature T1 / degC", 1),
}
# Columns of which there is one a branch or cell, by their name without its number.
BDF_MEMBERS = {
    ("branch", "current_ampere"): ("Branch {} Current / A", 3),
    ("cell", "voltage_volt"): ("Cell {} Voltage / V", 4),
    ("cell", "temperature_celsius"): ("Cell {} Temperature / degC", 1),
}


def bdf_csv(columns: Columns, *, discharge_positive: bool = False) -> bytes:
    """Battery Data Format as csv, gzipped."""
    shown = _discharge_positive(columns) if discharge_positive else columns
    # Adding zero turns -0.0, which would be written as "-0.000", into 0.0.
    sheet = _bdf_columns(shown | {"current_ampere": shown["current_ampere"] + 0.0})
    return packed(labels_of(sheet) + rows_of(sheet))


def bdf_parquet(columns: Columns, *, discharge_positive: bool = False) -> bytes:
    """Battery Data Format as Parquet, with absolute time."""
    import pyarrow as pa
    from pyarrow import parquet

    sheet = _bdf_columns(_discharge_positive(columns) if discharge_positive else columns)
    named = {column.label: column.values for column in sheet}
    named["Unix Time / s"] = UNIX_START_SECOND + columns["time_second"]
    buffer = io.BytesIO()
    parquet.write_table(pa.table(named), buffer, compression="zstd")
    return buffer.getvalue()


def _discharge_positive(columns) -> Columns:
    """All currents with the sign of discharge positive."""
    currents = [name for name in columns if name.endswith("current_ampere")]
    return columns | {name: 0.0 - columns[name] for name in currents}


def _bdf_columns(columns) -> list[Written]:
    """The columns that the record has; those of branches and cells come last."""
    labels = dict(BDF_COLUMNS)
    for name in columns:
        owner, _, rest = name.partition("_")
        number, _, quantity = rest.partition("_")
        if (owner, quantity) in BDF_MEMBERS:
            label, decimals = BDF_MEMBERS[owner, quantity]
            labels[name] = (label.format(number), decimals)
    return [
        Written(label, columns[name], decimals)
        for name, (label, decimals) in labels.items()
        if name in columns
    ]


DIGATRON_ENGLISH = {"day": "%m/%d/%Y", "clock": "%-I:%M:%S %p"}
DIGATRON_GERMAN = {"day": "%d.%m.%Y", "clock": "%H:%M:%S"}
DIGATRON_ABOUT = """

Measurement ID{d}1001
Battery Name{d}simulated
Battery Type{d}Li-ion
Circuit{d}Circuit001
Program{d}Cellwright virtual laboratory
Start Time{d}{start}
End Time{d}{end}
Test section{d}{section}
Comment{d}no real cell
OrderNo{d}
Producer{d} none
Type{d} Li-ion
Nominal Voltage{d} 0
Nominal Current{d} 0
Nominal Capacity{d} 0
Cells{d} 1
Maximum Voltage{d} 0
Gassing Voltage{d} 0
Break Voltage{d} 0
Charge Factor{d} 0
Impedance{d} 0
Cold Cranking Current{d} 0
Energy Density{d} 0
Comment{d}simulated, not measured


"""
DIGATRON_UNITS = {
    "Voltage": "V",
    "Current": "A",
    "Temperature": "C",
    "Capacity": "Ah",
    "WhAccu": "Wh",
}


def digatron_csv(columns: Columns, *, discharge_positive: bool = False) -> bytes:
    """A series as an English Digatron writes it, gzipped; `Capacity` is its signed counter.

    Lines about the test, a line of names, one of units, then rows, ended by carriage return and
    line feed. English files have commas and a twelve-hour clock, German ones semicolons and
    dd.mm.yyyy.
    """
    return _digatron_series(columns, discharge_positive, DIGATRON_ENGLISH, ",")


def digatron_german_csv(columns: Columns, *, discharge_positive: bool = False) -> bytes:
    """A series as a German Digatron writes it, gzipped; see `digatron_csv`."""
    return _digatron_series(columns, discharge_positive, DIGATRON_GERMAN, ";")


def _digatron_series(columns, discharge_positive, form, delimiter) -> bytes:
    time, step, rows = columns["time_second"], columns["step"], columns["step"].size
    net = columns["charged_ampere_hour"] - columns["discharged_ampere_hour"]
    ampere = np.nan_to_num(columns["current_ampere"])
    sheet = [
        Written("Time Stamp", date_texts(time, **form)),
        Written("Step", step),
        Written("Status", np.where(ampere > 0, "CHA", np.where(ampere < 0, "DCH", "PAU"))),
        Written("Prog Time", _elapsed_texts(time)),
        Written("Step Time", _elapsed_texts(time - time[step_begins(step)])),
        Written("Cycle", cycles(columns)),
        Written("Cycle Level", same(0, rows)),
        Written("Procedure", same("Cellwright", rows)),
        Written("Voltage", columns["voltage_volt"], 5),
        Written("Current", signed(columns["current_ampere"], discharge_positive), 5),
        Written("Temperature", columns["surface_celsius"], 5),
        Written("Capacity", net + 0.0, 5),
        Written("WhAccu", energy_watt_hour(columns) + 0.0, 5),
        Written("", same("", rows)),
    ]
    return packed(_digatron_file(sheet, DIGATRON_UNITS, section="Series", delimiter=delimiter))


def _digatron_file(
    sheet: list[Written], units: dict[str, str], *, section: str, delimiter: str
) -> bytes:
    """Lines about the test, names, units and rows; the first column holds the dates."""
    dates = sheet[0].values
    about = DIGATRON_ABOUT.format(d=delimiter, start=dates[0], end=dates[-1], section=section)
    shown = [f"[{units[column.label]}]" if column.label in units else "" for column in sheet]
    head = about.encode() + labels_of(sheet, delimiter=delimiter)
    head += (delimiter.join(shown) + "\n").encode()
    return (head + rows_of(sheet, delimiter=delimiter)).replace(b"\n", b"\r\n")


def _elapsed_texts(time: np.ndarray):
    """Times [s] as hh:mm:ss.mmm, hours beyond 24."""
    import pyarrow as pa
    import pyarrow.compute as pc

    total = np.rint(np.asarray(time) * 1000).astype(np.int64)
    parts = (total // 3_600_000, total // 60_000 % 60, total // 1000 % 60, total % 1000)
    texts = [
        pc.utf8_lpad(pc.cast(pa.array(part), pa.string()), width=width, padding="0")
        for part, width in zip(parts, (2, 2, 2, 3), strict=True)
    ]
    clock = pc.binary_join_element_wise(*texts[:3], ":")
    return pc.binary_join_element_wise(clock, texts[3], ".")


BDF_SPECTRUM_COLUMNS = {
    "frequency_hertz": ("Frequency / Hz", "%.6g"),
    "real_ohm": ("Real Impedance / ohm", "%.7f"),
    "imaginary_ohm": ("Imaginary Impedance / ohm", "%.7f"),
    "surface_celsius": ("Surface Temperature T1 / degC", "%.1f"),
}
SPECTRUM_DELIMITER = ";"
MEASURED_PERIODS = 3
SETTLING_SECOND = 10.0
WANTED_MILLIVOLT = 5.0
MOST_AMPERE = 2.0
DIGATRON_SPECTRUM_UNITS = {
    "Voltage": "V",
    "Current": "A",
    "AhAccu": "Ah",
    "Energy": "Wh",
    "Temp1": "C1",
}
ANALYSER = ("SetFreq", "mvIdeal", "Zreal1", "Zimg1", "ActFreq", "VRelativ", "AAmplitude")
DIGATRON_SPECTRUM_UNITS |= dict.fromkeys((*ANALYSER, "Betrag", "Phase"), "EIS")


def spectrum_csv(columns: Columns) -> bytes:
    """An impedance spectrum in the Battery Data Format."""
    named = {name: how for name, how in BDF_SPECTRUM_COLUMNS.items() if name in columns}
    form = ",".join(how for _, how in named.values())
    rows = zip(*[columns[name] for name in named], strict=True)
    header = ",".join(label for label, _ in named.values())
    return "\n".join([header, *[form % row for row in rows], ""]).encode()


def digatron_spectrum_csv(columns: Columns) -> bytes:
    """An impedance spectrum as Digatron writes it.

    `Zreal1` and `Zimg1` are in milliohm; each row's own amplitudes prove it:
    Betrag = VRelativ × mvIdeal / AAmplitude. The current is chosen for 5 mV, at most 2 A.
    """
    frequency = columns["frequency_hertz"]
    real, imaginary = 1000 * columns["real_ohm"], 1000 * columns["imaginary_ohm"]
    size = np.hypot(real, imaginary)
    ampere = np.minimum(WANTED_MILLIVOLT / size, MOST_AMPERE)
    time = np.cumsum(SETTLING_SECOND + MEASURED_PERIODS / frequency)
    celsius = columns.get("surface_celsius", same(np.nan, time.size))
    volt = columns.get("voltage_volt", same(np.nan, time.size))
    one, none = same(1, time.size), same(0.0, time.size)
    sheet = [
        Written("Time Stamp", date_texts(time, **DIGATRON_ENGLISH)),
        Written("Step", one),
        Written("Status", same("EIS", time.size)),
        Written("Prog Time", _elapsed_texts(time)),
        Written("Step Time", _elapsed_texts(time)),
        Written("Cycle", one),
        Written("Cycle Level", one),
        Written("Procedure", same("Cellwright", time.size)),
        Written("Voltage", volt, 5),
        Written("Current", none, 5),
        Written("AhAccu", none, 5),
        Written("Energy", same("", time.size)),
        Written("SetFreq", frequency, 5),
        Written("mvIdeal", same(WANTED_MILLIVOLT, time.size), 5),
        Written("Zreal1", real, 5),
        Written("Zimg1", imaginary, 5),
        Written("ActFreq", frequency, 5),
        Written("VRelativ", size * ampere / WANTED_MILLIVOLT, 5),
        Written("AAmplitude", ampere, 5),
        Written("Betrag", size, 5),
        Written("Phase", np.degrees(np.arctan2(imaginary, real)), 5),
        Written("Temp1", celsius, 5),
        Written("", same("", time.size)),
    ]
    return _digatron_file(
        sheet, DIGATRON_SPECTRUM_UNITS, section="EIS00001", delimiter=SPECTRUM_DELIMITER
    )
