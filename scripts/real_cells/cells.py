"""Numbers of the cells themselves: capacities, resistances, open-circuit voltages, spectra."""

import numpy as np
import pandas as pd

from real_cells import reading
from real_cells.words import celsius, rate, where

MILLI = 1e3
NEAR_SOC = 0.05  # how far from the wanted one a measured one may lie
LATE_SECOND = 1.0  # a sample that is later than this says nothing about the wanted moment
RESISTANCE_DELAYS_SECOND = (0, 0.1, 1, 10)
SPECTRA_SOC = (0.2, 0.5, 1.0)
SPECTRUM = {
    "r_zero_crossing_ohm": "spectrum: real part where it crosses the axis",
    "r_ohmic_ohm": "spectrum: ohmic resistance",
    "r_charge_transfer_ohm": "spectrum: charge-transfer resistance",
}


def capacities(campaign):
    """Capacity [Ah] per cell, temperature, direction and rate: median of the tests.

    Where a cell was tested at several ages: that of the first and of the last.
    """
    rows = reading.table(campaign, "capacity")
    rows = rows[rows["capacity_ampere_hour"].notna()].assign(rate=rows["c_rate"].map(rate))
    keys = ["cell", "ambient_temperature_celsius", "direction", "rate"]
    for (cell, temperature, direction, at), group in rows.groupby(keys, dropna=False):
        for age, part in ages(group):
            place = where(celsius(temperature), direction, at, age)
            yield cell, "capacity", place, part["capacity_ampere_hour"].median()


def ages(group: pd.DataFrame):
    """(word for the age, its rows): first and last by `cycle`, one part where all are alike."""
    cycle = group["cycle"].astype(float).fillna(0.0)
    if cycle.nunique() < 2:
        return [("", group)]
    return [("first", group[cycle == cycle.min()]), ("last", group[cycle == cycle.max()])]


def resistances(campaign):
    """Pulse resistance [mohm] at half charge per cell, temperature and delay.

    Of the first check-up, of the pulses next to 1C, those of a discharge where there are any.
    """
    rows = reading.table(campaign, "resistance")
    in_time = rows["actual_delay_second"] <= rows["delay_second"] + LATE_SECOND
    wanted = rows["delay_second"].isin(RESISTANCE_DELAYS_SECOND) & in_time
    rows = rows[wanted & rows["resistance_ohm"].notna()]
    rows = rows.assign(rate=rows["c_rate"].map(rate))
    keys = ["cell", "ambient_temperature_celsius", "delay_second"]
    for (cell, temperature, delay), group in rows.groupby(keys, dropna=False):
        _, group = ages(group)[0]
        discharge = group[group["direction"] == "discharge"]
        group = discharge if len(discharge) else group
        next_to_1c = group["c_rate"].abs().map(np.log).abs().idxmin()
        group = group[group["rate"] == group["rate"][next_to_1c]]
        value = _at_half(group["soc"], group["resistance_ohm"])
        place = where(celsius(temperature), "50 % SoC", _delay(delay))
        yield cell, "pulse resistance", place, MILLI * value


def _delay(second: float) -> str:
    return f"after {second:g} s" if second else "first sample"


def _at_half(soc, value) -> float:
    """Value at 50 % SoC between the measured points, NaN where none lies near on one side."""
    points = pd.DataFrame({"soc": soc, "value": value}).dropna().groupby("soc").median()
    below, above = points[points.index <= 0.5 + NEAR_SOC], points[points.index >= 0.5 - NEAR_SOC]
    if not len(below) or not len(above):
        return np.nan
    return float(np.interp(0.5, points.index, points["value"]))


def open_circuit_voltages(campaign):
    """Open-circuit voltage [V] at 10 to 90 % SoC of the slow test nearest to 25 °C, per cell."""
    sheet = reading.tests(campaign).set_index(["cell", "test"])
    found = reading.curves(campaign, "ocv")
    facts = sheet.loc[sheet.index.intersection(list(found))].reset_index()
    facts = facts.assign(
        off=(facts["ambient_temperature_celsius"].astype(float) - 25).abs(),
        age=facts["cycle"].astype(float).fillna(0.0),
    )
    for cell, group in facts.groupby("cell"):
        first = group.sort_values(["age", "off"]).iloc[0]
        curve = found[cell, first["test"]]
        temperature = celsius(float(first["ambient_temperature_celsius"]))
        for soc in np.arange(0.1, 0.95, 0.1):
            value = np.interp(soc, curve["soc"], curve["ocv_volt"], left=np.nan, right=np.nan)
            yield (
                cell,
                "open-circuit voltage",
                where(temperature, f"{soc * 100:.0f} % SoC"),
                float(value),
            )


def spectra(campaign):
    """Resistances [mohm] of the spectra at 20, 50 and 100 % SoC, per cell and temperature."""
    rows = reading.table(campaign, "eis")
    sheet = reading.tests(campaign)[["cell", "test", "cycle"]]
    rows = rows.merge(sheet, on=["cell", "test"], how="left")
    wanted = {soc: (rows["soc"] - soc).abs() for soc in SPECTRA_SOC}
    for soc, off in wanted.items():
        near = rows[off <= NEAR_SOC].assign(off=off)
        keys = ["cell", "ambient_temperature_celsius"]
        for (cell, temperature), group in near.groupby(keys, dropna=False):
            yield from _spectra_of(
                cell, where(celsius(temperature), f"{soc * 100:.0f} % SoC"), group
            )


def _spectra_of(cell, place, group):
    for age, part in ages(group):
        nearest = part[part["off"] == part["off"].min()]
        for column, quantity in SPECTRUM.items():
            yield cell, quantity, where(place, age), MILLI * nearest[column].median()
