"""A model's open circuit and resistances over temperature; what was not tested is marked."""

import numpy as np

from cellwright.models.lookup import circuit_at, member_of, open_circuit_volt
from cellwright.models.tables import celsius_of

SOC = np.linspace(0.0, 1.0, 21)
ORIGINS = {"R": "r_ohmic_ohm", "kinetic": "r_kinetic_ohm"}  # every other resistance relaxes
RELAXING = "r_relaxing_ohm"


def temperature_table(model, member, *, step_kelvin=5.0, beyond_kelvin=10.0):
    """What a member says at and between its temperatures, and a little beyond them.

    Parameters
    ----------
    model : dict of schema cellwright-model/2. member : name, or None for the chosen one.
    step_kelvin : of the grid, whose temperatures are multiples of it; the member's own are added.
    beyond_kelvin : how far the grid goes on beyond the member's own temperatures.

    Returns
    -------
    columns : dict of model, temperature_celsius, soc, ocv_volt, r_ohmic_ohm, r_kinetic_ohm,
        r_relaxing_ohm (sums of the branches of a kind), extrapolated_temperature (beyond all
        temperatures that were tested), extrapolated_soc (outside the SoC that was identified). A
        model of one unknown temperature has that one, NaN.
    """
    own = member_of(model, member)
    known = sorted(celsius_of(c["ambient_temperature_celsius"]) for c in own["conditions"])
    blocks = [
        _block(model, own, celsius, known) for celsius in _grid(known, step_kelvin, beyond_kelvin)
    ]
    return {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}


def _grid(known, step, beyond):
    if np.isnan(known).any():
        return [np.nan]
    low, high = np.ceil((known[0] - beyond) / step), np.floor((known[-1] + beyond) / step)
    return np.unique(np.concatenate([np.arange(low, high + 0.5) * step, known]))


def _block(model, member, celsius, known):
    found = circuit_at(member["conditions"], SOC, celsius)
    sums = {name: np.zeros(len(SOC)) for name in (*ORIGINS.values(), RELAXING)}
    for branch in found.circuit:
        sums[ORIGINS.get(branch.kind, RELAXING)] += branch.parameters.get("r_ohm", 0.0)
    return {
        "model": np.full(len(SOC), member["model"]),
        "temperature_celsius": np.full(len(SOC), celsius),
        "soc": SOC,
        "ocv_volt": open_circuit_volt(model, found, celsius),
        **sums,
        "extrapolated_temperature": np.full(len(SOC), not known[0] <= celsius <= known[-1]),
        "extrapolated_soc": found.outside_soc,
    }
