"""Arbin: the csv of a channel sheet."""

import numpy as np

from virtual_lab.instruments.start import date_texts
from virtual_lab.instruments.text import (
    Written,
    cycles,
    labels_of,
    packed,
    rows_of,
    same,
    signed,
    step_begins,
)
from virtual_lab.measurement import Columns


def arbin_csv(columns: Columns, *, discharge_positive: bool = False) -> bytes:
    """An Arbin channel sheet, gzipped; energies and impedance were not logged and stay zero."""
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
