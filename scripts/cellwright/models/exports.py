"""A cell's model for other tools: tables for PyBaMM's Thevenin model, and a plain look-up table."""

import numpy as np

from cellwright.models.circuit import KINDS
from cellwright.models.lookup import circuit_at, member_of
from cellwright.models.tables import ocv_at
from cellwright.refusal import Refusal

SCHEMA = "cellwright-pybamm/1"
# Of the kinds that are not linear, these are PyBaMM's elements with parameters over the current.
OVER_CURRENT = ("R_two_way", "kinetic", "hysteresis")
NO_ELEMENT = {
    "switch": "none of its elements remembers at rest which way the last current ran",
    "diffusion": "its diffusion element is a plane sheet whose gain its time constant fixes, "
    "not a sphere with a gain of its own",
}


def pybamm_parameters(model, member, temperature_celsius):
    """Tables over SoC of a model's member at one temperature, for PyBaMM's Thevenin model.

    PyBaMM's OCV knows no temperature, so there is one set per temperature. Linear kinds become a
    resistor and RC elements; the kinds of `OVER_CURRENT` keep their parameters, which the loader
    turns into an element whose resistance depends on the current.

    Parameters
    ----------
    model : dict, a model file.
    member : name of a member, or None for the chosen one.
    temperature_celsius : [degC]; NaN where the model has one condition of unknown temperature.

    Returns
    -------
    tables : dict of temperature_celsius, capacity_ampere_hour, soc, ocv_volt, r0_ohm (lists over
        SoC), elements (list of dicts of kind and parameters, lists over SoC), and identified_soc.

    Raises
    ------
    Refusal : a kind that PyBaMM has no element for.

    Source: PyBaMM, pybamm.equivalent_circuit.Thevenin: of an element du/dt = (R·I − u)/(R·C), R and
    C functions of temperature, current and SoC.
    """
    soc, found = _on_grid(model, member, temperature_celsius)
    ocv = ocv_at(model["ocv"], soc, temperature_celsius) + found.ocv_shift_volt
    r0, elements = np.zeros(len(soc)), []
    for branch in found.circuit:
        direct, more = _elements(branch, len(soc))
        r0, elements = r0 + direct, elements + more
    inside = soc[~found.outside_soc]
    return {
        "temperature_celsius": float(temperature_celsius),
        "capacity_ampere_hour": model["capacity_ampere_hour"],
        "identified_soc": [inside.min(), inside.max()],
        "soc": soc,
        "ocv_volt": ocv,
        "r0_ohm": r0,
        "elements": elements,
    }


def pybamm_document(model):
    """All members of a model at all their temperatures, and why any member is not among them.

    Parameters
    ----------
    model : dict, a model file.

    Returns
    -------
    document : dict of schema, cell, chosen, members (list of model and its `tables`, one per
        temperature) and refused (member → reason).
    """
    members, refused = [], {}
    for member in model["members"]:
        name = member["model"]
        try:
            tables = [pybamm_parameters(model, name, t) for t in _temperatures(member)]
            members.append({"model": name, "tables": tables})
        except Refusal as refusal:
            refused[name] = str(refusal)
    about = {"schema": SCHEMA, "cell": model["cell"], "chosen": model["chosen"]}
    return about | {"members": members, "refused": refused}


def plain_member(model):
    """Name of the member for tools that know resistors and capacitors only.

    Parameters
    ----------
    model : dict, a model file.

    Returns
    -------
    name : the chosen member where it is made of a resistor and RC pairs, else the largest such one.

    Raises
    ------
    Refusal : no member is.
    """
    plain = [m for m in model["members"] if all(_is_plain(c) for c in m["conditions"])]
    if not plain:
        raise Refusal(f"no member of the model of {model['cell']} is made of RC pairs alone")
    names = [member["model"] for member in plain]
    if model["chosen"] in names:
        return model["chosen"]
    return max(plain, key=lambda member: len(member["conditions"][0]["branches"]))["model"]


def lookup_table(model, member):
    """A member of RC pairs as columns, one row per temperature and SoC, on one grid of SoC.

    Parameters
    ----------
    model : dict, a model file.
    member : name of a member of RC pairs, see `plain_member`.

    Returns
    -------
    columns : dict of model, ambient_temperature_celsius, soc, ocv_volt, r0_ohm, and of each pair
        r1_ohm, tau1_second, c1_farad, …; `extrapolated` where the SoC was not identified.

    Raises
    ------
    Refusal : a branch that is no RC pair.
    """
    if not all(_is_plain(condition) for condition in member_of(model, member)["conditions"]):
        raise Refusal(f"{member} holds more than RC pairs; a look-up table has no column for it")
    blocks = [
        _lookup_block(model, member, celsius) for celsius in _temperatures(member_of(model, member))
    ]
    return {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}


def _lookup_block(model, member, celsius):
    soc, found = _on_grid(model, member, celsius)
    columns = {
        "model": np.full(len(soc), member),
        "ambient_temperature_celsius": np.full(len(soc), celsius),
        "soc": soc,
        "ocv_volt": ocv_at(model["ocv"], soc, celsius) + found.ocv_shift_volt,
        "extrapolated": found.outside_soc,
        "r0_ohm": found.circuit[0].parameters["r_ohm"],
    }
    for k, branch in enumerate(found.circuit[1:], 1):
        r, tau = branch.parameters["r_ohm"], branch.parameters["tau_second"]
        columns |= {f"r{k}_ohm": r, f"tau{k}_second": tau, f"c{k}_farad": tau / r}
    return columns


def _on_grid(model, member, celsius):
    """Circuit on all knots of SoC that any table of the model has, so that linear is exact."""
    conditions = member_of(model, member)["conditions"]
    knots = [[0.0, 1.0], *(one["soc"] for one in (*conditions, *model["ocv"]))]
    soc = np.unique(np.clip(np.concatenate(knots), 0.0, 1.0))
    return soc, circuit_at(conditions, soc, celsius)


def _temperatures(member):
    known = [one["ambient_temperature_celsius"] for one in member["conditions"]]
    return sorted({np.nan if celsius is None else float(celsius) for celsius in known})


def _is_plain(condition):
    return all(branch.get("kind", "RC") == "RC" for branch in condition["branches"])


def _elements(branch, points):
    """Resistance that acts at once (n,), and the elements, of one branch on a grid of SoC."""
    kind, parameters = KINDS[branch.kind], branch.parameters
    if branch.kind in OVER_CURRENT:
        return np.zeros(points), [{"kind": branch.kind} | parameters]
    if not kind.linear or kind.output != "volt":
        reason = NO_ELEMENT.get(branch.kind, "it has no such element")
        raise Refusal(f"PyBaMM's Thevenin model cannot run {branch.kind}: {reason}")
    gain, lags = kind.drive(np.ones(points), **parameters), kind.lags(**parameters)
    direct = 1.0 - sum(lag.share for lag in lags)
    pairs = [(lag.share * gain, lag.constant + np.zeros(points)) for lag in lags]
    elements = [{"kind": "RC", "r_ohm": r, "tau_second": tau} for r, tau in pairs]
    return direct * gain, elements
