"""One R0 of a cell, and how every other resistance that is called so relates to it."""

import numpy as np

from cellwright.circuits.cell import overpotentials
from cellwright.circuits.circuit import KINDS, kind_of
from cellwright.circuits.model_file import circuit_at, member_of, std_of_r0
from cellwright.health.messages import say
from cellwright.health.summary import reference_resistance
from cellwright.records.conditions import REFERENCE_CELSIUS, same_temperature, stated_or_reference

R0 = "R0"
LATER = "after {:g} s"


def resistances_of_cell(pulses, spectra, model, verdict):
    """R0 of a cell and every other resistance that is called so, each with its definition.

    Parameters
    ----------
    pulses : rows of stage `resistance` of the cell, with SoC, None where a number is not known.
    spectra : rows of stage `eis`, likewise. model : dict of its model file; {} without one.
    verdict : dict of the search; {} without one.

    Returns
    -------
    rows : list of dict: name, resistance_ohm, resistance_std_ohm, over_r0 (ratio to R0), test,
        soc, current_ampere, delay_second, ambient_temperature_celsius, doubt, doubt_codes,
        definition; R0 first.
    """
    pulse = reference_resistance(pulses)
    rows = _of_pulse(pulse, pulses) if pulse else []
    if model:
        rows += _of_model(pulse, rows, member_of(model))
    rows += _of_spectrum(spectra)
    rows += _of_search(verdict)
    first = rows[0]["resistance_ohm"] if pulse else None
    return [row | {"over_r0": row["resistance_ohm"] / first if first else None} for row in rows]


def _row(name, definition, ohm, std=None, **at):
    known = (
        "test",
        "soc",
        "current_ampere",
        "delay_second",
        "ambient_temperature_celsius",
        "doubt",
        "doubt_codes",
    )
    row = {"name": name, "resistance_ohm": ohm, "resistance_std_ohm": std}
    told = {"definition": say(f"resistance.{definition}")}
    return row | {key: at.get(key) for key in known} | told


def _of_pulse(pulse, pulses):
    """The reference pulse at its first sample and at each later delay."""
    same = [
        row
        for row in pulses
        if all(row[name] == pulse[name] for name in ("test", "start_time_second", "direction"))
    ]
    rows = []
    for row in sorted(same, key=lambda row: row["delay_second"]):
        at = {name: row[name] for name in ("test", "soc", "current_ampere")}
        at |= {"delay_second": row["actual_delay_second"]}
        at |= {"ambient_temperature_celsius": row["ambient_temperature_celsius"]}
        at |= {name: row.get(name) for name in ("doubt", "doubt_codes")}
        first = row["delay_second"] == 0
        name, definition = (R0, "first") if first else (LATER.format(row["delay_second"]), "later")
        rows.append(_row(name, definition, row["resistance_ohm"], row["resistance_std_ohm"], **at))
    return rows


def _of_model(pulse, measured, member):
    """The model in use through the reference pulse, and its own R0 there."""
    if not pulse:
        return []
    at = {name: pulse[name] for name in ("soc", "ambient_temperature_celsius")}
    celsius = at["ambient_temperature_celsius"]
    circuit = circuit_at(member["conditions"], np.full(3, at["soc"]), celsius).circuit
    rows = []
    for row in measured:
        ohm = _through_pulse(circuit, row["current_ampere"], row["delay_second"])
        where = at | {name: row[name] for name in ("test", "current_ampere", "delay_second")}
        when = "first sample" if row["name"] == R0 else row["name"]
        rows.append(_row(f"model, {when}", "model", ohm, **where))
    ohmic = float(np.ravel(circuit[0].parameters["r_ohm"])[0])
    at_once = ohmic + sum(
        float(np.ravel(branch.parameters["r_ohm"])[0])
        for branch in circuit[1:]
        if KINDS[branch.kind].of_charge_transfer
        and np.ravel(branch.parameters.get("tau_second", 0.0))[0] <= measured[0]["delay_second"]
    )
    rows.append(_row("model, parameter r0", "ohmic", ohmic, _std_of_r0(member, at), **at))
    if at_once != ohmic:
        rows.append(_row("model at small currents", "small", at_once, **at))
    return rows


def _std_of_r0(member, at):
    """Standard deviation of a member's r0 at a SoC, where it was fitted at that temperature."""
    for condition in member["conditions"]:
        fitted_at = stated_or_reference(condition["ambient_temperature_celsius"])
        stds = std_of_r0(condition)
        if same_temperature(fitted_at, at["ambient_temperature_celsius"]) and None not in stds:
            return float(np.interp(at["soc"], condition["soc"], stds))
    return None


def _through_pulse(circuit, current_ampere, second):
    """Voltage over current of a circuit a time [s] after a constant current sets in [Ohm]."""
    own = [branch for branch in circuit if kind_of(branch).output == "volt"]
    # A hysteresis turns with the charge passed and is no resistance.
    own = tuple(branch for branch in own if "m_volt" not in branch.parameters)
    volt = overpotentials(
        own, np.array([0.0, 0.0, second]), np.array([0.0, 1, 1]) * current_ampere, hold="zero_order"
    )
    return float(volt[:, -1].sum() / current_ampere)


def _of_spectrum(spectra):
    """Resistances of the spectrum at 25 °C nearest 50 % SoC."""
    alike = [
        row
        for row in spectra
        if row["soc"] is not None
        and row["r_ohmic_ohm"] is not None
        and same_temperature(row["ambient_temperature_celsius"], REFERENCE_CELSIUS)
        and abs(row["soc"] - 0.5) <= 0.1
    ]
    if not alike:
        return []
    row = min(alike, key=lambda row: abs(row["soc"] - 0.5))
    at = {name: row[name] for name in ("test", "soc", "ambient_temperature_celsius")}
    at |= {name: row.get(name) for name in ("doubt", "doubt_codes")}
    rows = [_row("spectrum, ohmic", "spectrum", row["r_ohmic_ohm"], row["r_ohmic_ohm_std"], **at)]
    both, std = row["r_before_diffusion_ohm"], row["r_before_diffusion_ohm_std"]
    if both is not None:
        rows.append(_row("spectrum, with charge transfer", "transfer", both, std, **at))
    return rows


def _of_search(verdict):
    """Sizes of the effects of a verdict that are resistances called R0."""
    rows = []
    for one in verdict.get("effects", ()):
        sizes = [size for size in one.get("sizes") or () if size["unit"] == "mΩ"]
        if not sizes or not sizes[0]["name"].startswith(R0):
            continue
        for size in sizes:
            name = f"search, R0 {size['name'].removeprefix(R0).strip()}"
            std = size["std"]
            known = 1e-3 * std if std is not None and np.isfinite(std) else None
            rows.append(_row(name, "search", 1e-3 * size["value"], known))
    return rows
