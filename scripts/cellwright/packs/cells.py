"""Cells of a pack as look-up tables over SoC and temperature, each of its chosen member."""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.cell import POINTS
from cellwright.circuits.circuit import KINDS
from cellwright.circuits.model_file import (
    SMALLEST_RESISTANCE_OHM,
    capacity_of,
    circuit_at,
    member_of,
    open_circuit_volt,
    standing_in,
)
from cellwright.records.conditions import REFERENCE_CELSIUS
from cellwright.refusal import Refusal


class PackCells(NamedTuple):
    """Look-up tables of a pack's cells on one uniform grid of SoC from 0 to 1, with p points.

    names, members : of the cells, tuples of str. capacity_ampere_hour, near_end_soc : (cells,)
    [Ah], [1]; near_end_soc : how near full or empty a start has hysteresis from what led there.
    temperature_celsius : (temperatures,) rising [degC]; one where the tables know one.
    tables : dict of `TABLES`, each (temperatures, cells, entries, p), the entries of a cell that
    has fewer filled with elements without resistance:
    ocv_volt : one entry; at the counted SoC. ocv_shift_volt : one entry; what of it belongs to the
    counted SoC where diffusion takes the OCV at another.
    r0_ohm : one entry. r_ohm, tau_second : RC pairs and Warburg elements.
    kinetic_r_ohm, kinetic_tau_second, kinetic_scale_volt : with arcsinh over the current; a time
    constant of 0 acts at once.
    charge_ohm, discharge_ohm, way_tau_second : resistances that differ by the direction of the
    current; a time constant of 0 acts at once.
    hysteresis_volt, hysteresis_ampere_hour : goal, and the charge after which 1/e is left.
    soc_per_ampere, soc_tau_second : lags by which the surface's SoC leads the mean.
    """

    names: tuple
    members: tuple
    capacity_ampere_hour: np.ndarray
    near_end_soc: np.ndarray
    temperature_celsius: np.ndarray
    tables: dict


# In the order of native/pack.c.
TABLES = (
    *("ocv_volt", "ocv_shift_volt", "r0_ohm", "r_ohm", "kinetic_r_ohm", "kinetic_scale_volt"),
    *("charge_ohm", "discharge_ohm", "soc_per_ampere", "hysteresis_volt", "hysteresis_ampere_hour"),
    *("tau_second", "kinetic_tau_second", "way_tau_second", "soc_tau_second"),
)
# What an entry holds that a cell does not have: elements without effect, constants above zero.
FILL = dict.fromkeys((*TABLES[-4:], "kinetic_scale_volt", "hysteresis_ampere_hour"), 1.0)


def pack_cells(models, *, temperature_celsius=None, member=None, points=POINTS):
    """Stack the models of a pack's cells on one grid of SoC, each as its chosen member.

    Parameters
    ----------
    models : sequence of model dicts, in the order of the leaves of the wiring.
    temperature_celsius : scalar, or (t,) rising ones between which parameters follow the cells'
        temperature [degC]; None only for models of one condition.
    member : name of a member for all cells, a sequence of one name a cell, or None for the chosen
        ones; of a cell whose chosen one warms by a law of its own, which a pack does not run, that
        of the smallest error of what was left out of its fit. `members` says which they are.
    points : size of the SoC grid; knots of a model that lie on it are met exactly.

    Raises
    ------
    Refusal : no model, no member but those that warm by a law of their own, or such a one named,
        temperatures that do not rise, or as `model_file.circuit_at`.
    """
    # ASSUME: Within a pack side reactions and leaks of single cells do not matter.
    if not models:
        raise Refusal("a pack without models cannot be simulated")
    celsius = _temperatures(temperature_celsius)
    names = [member] * len(models) if member is None or isinstance(member, str) else list(member)
    if len(names) != len(models):
        raise Refusal(f"{len(names)} names of members for {len(models)} cells; one each is wanted")
    entries = [
        member_in_pack(model) if name is None else member_of(model, name)
        for model, name in zip(models, names, strict=True)
    ]
    return _of_entries(models, entries, celsius, points)


def alike_cells(models, *, temperature_celsius):
    """Cells that the fit of a group allows as well as those of its models.

    Parameters
    ----------
    models : sequence of model dicts of one group, each with as many `alike`, drawn together.
    temperature_celsius : as of `pack_cells`.

    Returns
    -------
    drawn : list of PackCells, one a draw, all with the same elements.
    """
    count, draws = len(models), len(models[0]["alike"])
    entries = [
        member_of(model) | {"conditions": [model["alike"][k]]}
        for k in range(draws)
        for model in models
    ]
    celsius = _temperatures(temperature_celsius)
    whole = _of_entries(list(models) * draws, entries, celsius, POINTS)
    parts = [slice(k * count, (k + 1) * count) for k in range(draws)]
    return [
        PackCells(
            *(column[part] for column in whole[:4]),
            whole.temperature_celsius,
            {name: table[:, part] for name, table in whole.tables.items()},
        )
        for part in parts
    ]


def _of_entries(models, entries, celsius, points):
    """PackCells of one entry of a member a model."""
    grid = np.linspace(0.0, 1.0, points)
    tables = [
        [_tables(model, entry, grid, value) for value in celsius]
        for model, entry in zip(models, entries, strict=True)
    ]
    known = np.array([REFERENCE_CELSIUS if value is None else value for value in celsius])
    # A cell has one capacity in a pack: that of the middle temperature.
    middle = celsius[len(celsius) // 2]
    sizes = [capacity_of(m, e, middle) for m, e in zip(models, entries, strict=True)]
    return PackCells(
        tuple(model.get("cell", f"cell {k + 1}") for k, model in enumerate(models)),
        tuple(entry["model"] for entry in entries),
        np.array(sizes),
        np.array([entry.get("history", {}).get("near_end_soc", 0.0) for entry in entries]),
        known,
        {name: _stacked(tables, name) for name in TABLES},
    )


def rc_cells(ocv_volt, r0_ohm, r_ohm, tau_second, capacity_ampere_hour):
    """Cells given as tables of a circuit of RC pairs, at one temperature.

    Parameters
    ----------
    ocv_volt, r0_ohm : (cells, p) on a uniform grid of SoC from 0 to 1 [V], [ohm].
    r_ohm, tau_second : (cells, pairs, p) [ohm], [s]. capacity_ampere_hour : (cells,) [Ah].

    Returns
    -------
    cells : PackCells, named "cell 1", "cell 2" and so on.
    """
    cells, pairs, points = np.shape(r_ohm)
    none = np.zeros((1, cells, 0, points))
    found = dict.fromkeys(TABLES, none)
    found["ocv_shift_volt"] = np.zeros((1, cells, 1, points))
    found["ocv_volt"] = np.array(ocv_volt, float)[None, :, None]
    found["r0_ohm"] = np.array(r0_ohm, float)[None, :, None]
    found["r_ohm"] = np.array(r_ohm, float)[None]
    found["tau_second"] = np.array(tau_second, float)[None]
    return PackCells(
        tuple(f"cell {k + 1}" for k in range(cells)),
        (f"{pairs}RC",) * cells,
        np.array(capacity_ampere_hour, float),
        np.zeros(cells),
        np.array([REFERENCE_CELSIUS]),
        found,
    )


def table_temperatures(models, celsius):
    """Temperatures to look models up at, where cells warm or their ambient changes (t,) [degC].

    At least every 5 K from the coldest ambient to 40 K over the warmest, and the temperatures that
    the models know in between: on these the tables say what the models say.

    Parameters
    ----------
    models : sequence of model dicts. celsius : scalar or (n,) of the ambient [degC].
    """
    # Room for a cell's own heat; beyond the warmest table its parameters stay as they are there.
    low, high = np.min(celsius), np.max(celsius) + 40.0
    known = [
        condition["ambient_temperature_celsius"]
        for model in models
        for member in model["members"]
        for condition in member["conditions"]
    ]
    inside = [value for value in known if value is not None and low < value < high]
    steps = int(np.ceil((high - low) / 5.0))
    return np.unique(np.round([*np.linspace(low, high, steps + 1), *inside], 6))


def _temperatures(temperature_celsius):
    if temperature_celsius is None:
        return [None]
    celsius = np.atleast_1d(np.asarray(temperature_celsius, float))
    if np.any(np.diff(celsius) <= 0):
        raise Refusal(f"temperatures of tables are {celsius.tolist()} °C; they have to rise")
    return celsius.tolist()


def member_in_pack(model):
    """Member of a model as a pack runs it: the chosen one where a pack's cell can be that.

    Of one that warms by a law of its own another one, see `model_file.standing_in`.
    """
    able = [member["model"] for member in model["members"] if "own_heat" not in member]
    return member_of(model, standing_in(model, able) if able else None)


def _tables(model, entry, grid, celsius):
    """Tables of one cell at one temperature: name → (entries, p)."""
    if "own_heat" in entry:
        raise Refusal(
            f"{entry['model']} of {model['cell']} warms by a law of its own, which a pack does not "
            "run; name another member, and the thermal state of the pack"
        )
    temperature = np.nan if celsius is None else celsius
    sampled = circuit_at(entry["conditions"], grid, temperature)
    # The model's OCV with its shift, at the counted SoC.
    volt = open_circuit_volt(model, sampled, temperature)
    # How much of the model's own SoC passes per counted SoC.
    stretch = np.gradient(sampled.table_soc, grid)
    found = {name: [] for name in TABLES}
    found["ocv_volt"], found["ocv_shift_volt"] = [volt], [sampled.ocv_shift_volt]
    # Ohmic branches add to it below.
    found["r0_ohm"] = [np.zeros(len(grid))]
    for branch in sampled.circuit:
        full = {k: np.broadcast_to(v, grid.shape) for k, v in branch.parameters.items()}
        for entry in _entries(branch.kind, full, model["capacity_ampere_hour"], stretch):
            found["r0_ohm"][0] = found["r0_ohm"][0] + entry.pop("r0_ohm", 0.0)
            for name, values in entry.items():
                found[name].append(values)
    return found


def _stacked(tables, name):
    """(temperatures, cells, entries, p) of one quantity."""
    most = max(len(found[name]) for cell in tables for found in cell)
    points = len(tables[0][0]["ocv_volt"][0])
    out = np.full((len(tables[0]), len(tables), most, points), FILL.get(name, 0.0))
    for c, cell in enumerate(tables):
        for t, found in enumerate(cell):
            out[t, c, : len(found[name])] = np.reshape(found[name], (len(found[name]), points))
    return out


def _entries(kind, p, capacity_ampere_hour, stretch):
    """Entries that a branch with parameters p adds to a cell's tables: dicts, name → (points,)."""
    at_once = np.zeros(len(stretch))
    lags = [(lag.share, lag.constant) for lag in KINDS[kind].lags(**p)]
    if KINDS[kind].output == "soc":
        gain = [share * p["soc_per_ampere"] / stretch for share, _ in lags]
        return [
            {"soc_per_ampere": ahead, "soc_tau_second": tau}
            for ahead, (_, tau) in zip(gain, lags, strict=True)
        ]
    if "m_volt" in p:
        # ASSUME: In a pack a short reversal of the current leaves the hysteresis off the branch it
        # came from; along a whole charge or discharge this makes no difference. A zero-state
        # one turns within a fifty-thousandth of the capacity: at once under any load, and yet with
        # a slope for Newton's method.
        charge = p.get("charge_ampere_hour", at_once + 2e-5 * capacity_ampere_hour)
        return [{"hysteresis_volt": p["m_volt"], "hysteresis_ampere_hour": charge}]
    if "r_charge_ohm" in p:
        ways = {"charge_ohm": p["r_charge_ohm"], "discharge_ohm": p["r_discharge_ohm"]}
        return [ways | {"way_tau_second": p.get("tau_second", at_once)}]
    if KINDS[kind].linear:
        pairs = [{"r_ohm": share * p["r_ohm"], "tau_second": tau} for share, tau in lags]
        return pairs or [{"r0_ohm": p["r_ohm"]}]
    if "exchange_ampere" in p:
        # ASSUME: In a pack charge transfer has equal coefficients for charge and discharge.
        # arcsinh of Butler–Volmer with equal coefficients: 2RT/F = 2·i0·r.
        scale = 2.0 * p["exchange_ampere"] * np.maximum(p["r_ohm"], SMALLEST_RESISTANCE_OHM)
        p = p | {"tau_second": at_once, "scale_volt": scale}
    kinetic = {f"kinetic_{name}": p[name] for name in ("r_ohm", "tau_second", "scale_volt")}
    return [kinetic]
