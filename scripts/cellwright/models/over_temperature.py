"""A model's open circuit and resistances over temperature; what was not tested is marked."""

import numpy as np

from cellwright.models.compensation import with_laws
from cellwright.models.lookup import circuit_at, member_of, open_circuit_volt
from cellwright.models.tables import celsius_of
from cellwright.models.temperature_laws import LAWS, Laws

SOC = np.linspace(0.0, 1.0, 21)
ORIGINS = {"R": "r_ohmic_ohm", "kinetic": "r_kinetic_ohm"}  # every other resistance relaxes
RELAXING = "r_relaxing_ohm"
KINDS = {"r_ohmic_ohm": "ohmic", "r_kinetic_ohm": "kinetic", RELAXING: "relaxing"}


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


def laws_beyond(model):
    """Laws over temperature that may go on beyond the temperatures a model was identified at.

    A parabola through the logarithms of resistances turns somewhere. It is not offered where a
    sum of resistances of one kind then rises with temperature, at any SoC within the 10 K that
    `temperature_table` goes on for, and held to the slope of the last two temperatures does not.

    Parameters
    ----------
    model : dict of schema cellwright-model/2, identified at all its temperatures.

    Returns
    -------
    offered : tuple of names of `temperature_laws.LAWS`.
    words : str, which is not offered and why, or "".
    """
    rising = {name: _rising(with_laws(model, Laws(beyond=name))) for name in LAWS}
    turned = {name: sorted(found - rising[LAWS[0]]) for name, found in rising.items()}
    offered = tuple(name for name in LAWS if not turned[name])
    words = [
        f"{name} is not offered beyond the tested temperatures: by it the {KINDS[kind]} resistance "
        f"at {100 * soc:.0f} % SoC would rise with temperature at {celsius:g} °C"
        for name, ((celsius, kind, soc), *_) in ((n, t) for n, t in turned.items() if t)
    ]
    return offered, "; ".join(words)


def _rising(model):
    """(temperature, kind of resistance, SoC) beyond the tested range where a kelvin adds ohms."""
    table = temperature_table(model, None, step_kelvin=1.0)
    celsius = np.unique(table["temperature_celsius"])
    outside = table["extrapolated_temperature"].reshape(len(celsius), -1)[:, 0]
    found = set()
    for kind in KINDS:
        rises = np.diff(table[kind].reshape(len(celsius), -1), axis=0) > 0
        rises &= (outside[1:] | outside[:-1])[:, None]
        found |= {(celsius[k], kind, SOC[s]) for k, s in np.argwhere(rises)}
    return found


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
