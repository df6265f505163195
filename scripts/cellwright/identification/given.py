"""The model of a cell that a user knows as a table: OCV and resistance over state of charge."""

import numpy as np

from cellwright.circuits.parameters import model_result
from cellwright.identification.cell import SCHEMA
from cellwright.records import inputs
from cellwright.records.conditions import stated_or_reference
from cellwright.refusal import Refusal

MEMBER = "0RC"  # a resistance, without pairs
KNOTS = np.linspace(0.0, 1.0, 101)
GRID = np.linspace(0.0, 1.0, 201)
REACH = 0.02  # of SoC that a table may lack at each end


def model_of_table(
    cell,
    table,
    *,
    capacity_ampere_hour,
    ambient_temperature_celsius=None,
    source="table",
):
    """Model of a cell that is known as a table of OCV [V] and resistance [ohm] over SoC.

    What relaxes is in the resistance, which acts at once: such a model is one of slow loads.

    cell : its name. table : DataFrame or columns: soc (0 to 1), ocv_volt, resistance_ohm.
    capacity_ampere_hour : charge from SoC 0 to 1 [Ah].
    ambient_temperature_celsius : at which the table holds [°C]; None: 25.
    source : name of the table, for the notes.

    Returns as `identify`, kind "given", of one member "0RC". Raises Refusal: no capacity, values
    that are not finite, a SoC in percent or that does not go from empty to full, an OCV that falls,
    a resistance below zero. Source: docs/packs.md.

    >>> import cellwright as cw
    >>> table = {"soc": [0.0, 1.0], "ocv_volt": [3.0, 4.2], "resistance_ohm": [0.02, 0.02]}
    >>> cw.model_of_table("A", table, capacity_ampere_hour=2.0).content["chosen"]
    '0RC'
    """
    given = inputs.quantities(table, ("soc", "ocv_volt", "resistance_ohm"))
    columns = [np.asarray(values, float) for values in given]
    soc, ocv, ohm = (values[np.argsort(columns[0])] for values in columns)
    _check(cell, soc, ocv, ohm, capacity_ampere_hour, source)
    celsius = stated_or_reference(ambient_temperature_celsius)
    unknown = [None] * len(KNOTS)
    condition = {
        "ambient_temperature_celsius": celsius,
        "soc": KNOTS.tolist(),
        "r0_ohm": np.interp(KNOTS, soc, ohm).tolist(),
        "r0_std_ohm": unknown,
        "branches": [],
        "ocv_shift_volt": [0.0] * len(KNOTS),
        "ocv_scale": {"missing": 0.0, "stretch": 0.0},
        "activation_energy_joule_per_mole": 0.0,
        "at_bound": [],
        "tests": [],
    }
    curve = {"ambient_temperature_celsius": celsius, "soc": GRID.tolist(), "branches": "given"}
    curve["ocv_volt"] = np.interp(GRID, soc, ocv).tolist()
    member = {"model": MEMBER, "left_out_rmse_volt": None, "conditions": [condition]}
    content = {
        "schema": SCHEMA,
        "cell": cell,
        "capacity_ampere_hour": float(capacity_ampere_hour),
        "borrowed_from": None,
        "ocv": [curve],
        "members": [member],
        "chosen": MEMBER,
        "kind": "given",
        "notes": [f"OCV and resistance over SoC as given in {source}, {len(soc)} points"],
    }
    return model_result(content)


def _check(cell, soc, ocv, ohm, capacity, source):
    place = f"{source} of {cell}"
    if not (capacity and capacity > 0):
        wanted = "wanted its capacity in Ah above zero, in model_capacity_ampere_hour"
        raise Refusal(f"{place}: found {capacity}, {wanted}")
    for name, values in (("soc", soc), ("ocv_volt", ocv), ("resistance_ohm", ohm)):
        if len(values) < 2 or not np.isfinite(values).all():
            raise Refusal(f"{place}: {name} holds fewer than two values, or one that is no number")
    if soc[0] > REACH or abs(soc[-1] - 1.0) > REACH or soc[0] < -REACH:
        raise Refusal(f"{place}: SoC runs from {soc[0]:g} to {soc[-1]:g}, wanted from 0 to 1")
    if np.any(np.diff(ocv) < 0):
        k = int(np.argmin(np.diff(ocv)))
        fall = f"falls from {ocv[k]:.4g} to {ocv[k + 1]:.4g} V after SoC {soc[k]:.3g}"
        raise Refusal(f"{place}: the OCV {fall}, wanted one that rises")
    if np.any(ohm < 0):
        k = int(np.argmin(ohm))
        raise Refusal(f"{place}: resistance {ohm[k]:.3g} ohm at SoC {soc[k]:.3g}, below zero")
