"""Impedance spectra: Battery Data Format, and Digatron's table in milliohm."""

import numpy as np

from virtual_lab.instruments.digatron import ENGLISH, clock_texts, whole_file
from virtual_lab.instruments.start import date_texts
from virtual_lab.instruments.text import Written, same
from virtual_lab.measurement import Columns

LABELS = {
    "frequency_hertz": ("Frequency / Hz", "%.6g"),
    "real_ohm": ("Real Impedance / ohm", "%.7f"),
    "imaginary_ohm": ("Imaginary Impedance / ohm", "%.7f"),
    "surface_celsius": ("Surface Temperature T1 / degC", "%.1f"),
}
DELIMITER = ";"
MEASURED_PERIODS = 3
SETTLING_SECOND = 10.0
WANTED_MILLIVOLT = 5.0
MOST_AMPERE = 2.0
UNITS = {"Voltage": "V", "Current": "A", "AhAccu": "Ah", "Energy": "Wh", "Temp1": "C1"}
ANALYSER = ("SetFreq", "mvIdeal", "Zreal1", "Zimg1", "ActFreq", "VRelativ", "AAmplitude")
UNITS |= dict.fromkeys((*ANALYSER, "Betrag", "Phase"), "EIS")


def spectrum_csv(columns: Columns) -> bytes:
    """An impedance spectrum in the Battery Data Format."""
    named = {name: how for name, how in LABELS.items() if name in columns}
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
        Written("Time Stamp", date_texts(time, **ENGLISH)),
        Written("Step", one),
        Written("Status", same("EIS", time.size)),
        Written("Prog Time", clock_texts(time)),
        Written("Step Time", clock_texts(time)),
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
    return whole_file(sheet, UNITS, section="EIS00001", delimiter=DELIMITER)
