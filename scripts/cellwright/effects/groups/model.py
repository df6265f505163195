"""The model of cells in parallel that is searched, its free parameters, and its document.

Every branch is its cell (OCV, ohmic resistance, two RC pairs, slow diffusion, with what moves them:
see `branch`) behind a wire, which no temperature moves. Kirchhoff's laws share the current.
"""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.cell import held_on_grid, ocv_and_slope
from cellwright.effects.base import OCV_KNOTS
from cellwright.effects.groups.branch import (
    Branch,
    conditions,
    diffusion_of,
    smooth_shares,
)
from cellwright.effects.library.groups import GROUP_LIBRARY
from cellwright.effects.library.thermal import WARMED
from cellwright.native import array, count, function
from cellwright.numerics.lags import lag_step, lag_weights
from cellwright.numerics.least_squares import Free
from cellwright.packs.network import star
from cellwright.refusal import Refusal

LEAST_OHM = 1e-6
PAIRS, LAGS = 2, 8  # of a branch: both pairs, and with those of slow diffusion at most
FINE_KNOTS = 41  # of the error that the OCVs of all branches share


class GroupFields(NamedTuple):
    """Quantities of a group that is simulated.

    cells : tuple of Branch, for what nothing changes. capacity : (b,) [Ah]. ocv : (b, p) [V].
    r : (b, 1 + LAGS) ohmic, of both pairs, and of the lags of slow diffusion [ohm]. tau : (b, LAGS)
    of each lag, 0 after the last [s]. wire : (b,) [ohm]. energy : beside the cells' own [J/mol].
    soc : (f, b) at the start of each record [1]. warmer : (b,) above the measured temperature [K].
    offset : (b,) [A] and gain : (b,) [1] of the branch's sensor.
    """

    cells: tuple
    capacity: np.ndarray
    ocv: np.ndarray
    r: np.ndarray
    tau: np.ndarray
    wire: np.ndarray
    energy: float
    soc: np.ndarray
    warmer: np.ndarray
    offset: np.ndarray
    gain: np.ndarray


def at_branch(effect, position):
    """An effect of the library in one branch of a group (0 is the first)."""
    return effect._replace(position=position)


class GroupRun(NamedTuple):
    """A simulated group: voltage (n,) [V], branch currents as read (n, b) [A], soc (n, b) [1]."""

    voltage: np.ndarray
    current: np.ndarray
    soc: np.ndarray


OHM, TIME = ("resistance", 5e-3), ("time_constant", 0.02)
LOG_OHMS = ("log_r0", "log_r1", "log_r2", "log_diffusion")
# Free parameters by name: the spread of `known` that they have, and a step for derivatives. Those
# that all branches have in common, and those of each.
COMMON = {
    **dict.fromkeys(LOG_OHMS, OHM),
    **dict.fromkeys(("log_tau1", "log_tau2"), TIME),
    "capacity": ("capacity", 5e-3),
    "energy": ("activation_joule_per_mole", 500.0),
}
OF_BRANCH = {
    "capacity": ("capacity", 5e-3),
    "log_r0": OHM,
    "log_slow": OHM,
    "log_tau": TIME,
    "soc": ("soc", 1e-3),
    "celsius": ("celsius", 0.2),
    "wire": ("wire_ohm", 1e-4),
    "offset": ("current_offset_c_rate", 1e-3),
    "gain": ("current_gain", 1e-3),
}
OF_SENSOR = ("offset", "gain")


def group_names(files, branches):
    """Names of all parameters but those of effects: common ones, then those of each branch."""
    common = [*COMMON, *(f"soc0[{k}]" for k in range(files))]
    of_branch = [*OF_BRANCH, *(f"ocv[{k}]" for k in range(OCV_KNOTS))]
    common += [f"fine[{k}]" for k in range(FINE_KNOTS)]
    return (*common, *(f"{b}.{name}" for b in range(branches) for name in of_branch))


def _with_effects(values, effects):
    """Values of a group whose branches have effects: these go on top of what they replace."""
    values = dict(values)
    for effect in effects:
        ((parameter, size),) = effect.sizes_of(values).items()
        for name in (f"{effect.position}.{replaced}" for replaced in effect.replaces):
            if ".log_" in name:
                values[name] += np.log1p(size)
            elif parameter.endswith("relative"):
                values[name] += size * (1.0 + values[name])
            else:
                values[name] += size
    return values


def group_fields(cells, soc_at_start, values, effects=()):
    """GroupFields of a set of values.

    Parameters
    ----------
    cells : sequence of Branch. soc_at_start : (f, b) stated SoC [1].
    values : dict by the names of `group_names` and of the effects.
    effects : sequence of Effect, each in its branch.

    Returns
    -------
    fields : GroupFields.
    """
    branches, values = range(len(cells)), _with_effects(values, effects)

    def of_branch(name):
        return np.array([values[f"{b}.{name}"] for b in branches])

    slow = np.exp(of_branch("log_slow")[:, None] + [values[name] for name in LOG_OHMS[1:]])
    factor = np.concatenate([np.exp(of_branch("log_r0") + values["log_r0"])[:, None], slow], axis=1)
    faster = np.exp(of_branch("log_tau")[:, None] + [[values["log_tau1"], values["log_tau2"]]])
    r, tau = np.zeros((len(cells), 1 + LAGS)), np.zeros((len(cells), LAGS))
    for b, cell in enumerate(cells):
        slowest, pairs = diffusion_of(cell), 1 + PAIRS
        lags = pairs + len(slowest.r_ohm)
        r[b, :pairs], tau[b, :PAIRS] = cell.r_ohm * factor[b, :pairs], cell.tau_second * faster[b]
        r[b, pairs:lags], tau[b, PAIRS : lags - 1] = (
            slowest.r_ohm * factor[b, -1],
            slowest.tau_second,
        )
    capacity = np.array([c.capacity_ampere_hour for c in cells])
    shift = np.array([values[f"soc0[{k}]"] for k in range(len(soc_at_start))])
    return GroupFields(
        cells=cells,
        capacity=capacity * (1.0 + values["capacity"]) * (1.0 + of_branch("capacity")),
        ocv=np.array([c.ocv_volt for c in cells]) + _ocv_errors(cells, values),
        r=r,
        tau=tau,
        wire=np.array([c.wire_ohm for c in cells]) + of_branch("wire"),
        energy=values["energy"],
        soc=np.asarray(soc_at_start, float) + shift[:, None] + of_branch("soc"),
        warmer=of_branch("celsius"),
        offset=of_branch("offset"),
        gain=of_branch("gain"),
    )


def _ocv_errors(cells, values):
    knots = [[values[f"{b}.ocv[{k}]"] for k in range(OCV_KNOTS)] for b in range(len(cells))]
    points = len(cells[0].ocv_volt)
    common = smooth_shares(points, FINE_KNOTS) @ [values[f"fine[{k}]"] for k in range(FINE_KNOTS)]
    return common + np.array(knots) @ smooth_shares(points, OCV_KNOTS).T


def group_run(fields, stack):
    """Voltage, branch currents and SoC of a group over a stack of records: GroupRun.

    Between rows the current of each branch moves on a straight line whose end is found implicitly,
    with the slope of the OCV of that moment; at each row the total steps and is shared anew.

    Parameters
    ----------
    fields : GroupFields. stack : records.Stack.

    Returns
    -------
    run : GroupRun.

    Raises
    ------
    Refusal : a branch without any resistance.
    """
    if np.any(fields.r[:, 0] + fields.wire < LEAST_OHM) or np.any(fields.capacity <= 0):
        raise Refusal("a branch of the group has no resistance or no capacity")
    rating = sum(cell.capacity_ampere_hour for cell in fields.cells)
    shares = [cell.capacity_ampere_hour / rating for cell in fields.cells]
    about = zip(fields.cells, shares, fields.warmer.tolist(), strict=True)
    rows = np.array([conditions(c, stack, s, k, fields.energy) for c, s, k in about])
    kernel = function("group_run", *[count] * 4, *[array] * 16)
    current, voltage, soc = (
        _twin(fields, stack, rows) if kernel is None else _compiled(kernel, fields, stack, rows)
    )
    return GroupRun(voltage, current * (1.0 + fields.gain) + fields.offset, soc)


def _tables(fields):
    """OCV, its rise with temperature and courses of three resistances over SoC: (b, 5, p)."""
    constant = np.array([0.0, 1.0, 1.0, 1.0])[:, None] * np.ones(fields.ocv.shape[1])
    courses = [constant if cell.courses is None else cell.courses for cell in fields.cells]
    return np.concatenate([fields.ocv[:, None], courses], axis=1)


def _compiled(kernel, fields, stack, rows):
    cells, count_rows, _ = rows.shape
    results = np.empty((count_rows, cells)), np.empty(count_rows), np.empty((count_rows, cells))
    slowest = [diffusion_of(cell) for cell in fields.cells]
    given = (stack.step_second, stack.fresh, stack.current_ampere, _tables(fields))
    given += ([cell.courses is not None for cell in fields.cells], fields.r, fields.tau)
    given += ([d.leads for d in slowest], [d.log_diffusivity_to_full for d in slowest])
    given += (fields.wire, 3600.0 * fields.capacity, rows, fields.soc)
    given = [np.ascontiguousarray(values, float) for values in given]
    first_order = stack.hold == "first_order"
    kernel(count_rows, cells, fields.ocv.shape[1], first_order, *given, *results)
    return results


def _twin(fields, stack, rows):
    cells, count_rows, _ = rows.shape
    current, voltage = np.empty((count_rows, cells)), np.empty(count_rows)
    soc, total = np.empty((count_rows, cells)), stack.current_ampere
    held = total if stack.hold == "first_order" else np.roll(total, 1)
    tau, tables = np.where(fields.tau > 0.0, fields.tau, 1.0), _tables(fields)
    leads = np.array([diffusion_of(cell).leads for cell in fields.cells])
    leading = leads[:, None] & (np.arange(LAGS) >= PAIRS)
    z = volts = drive = None
    for k in range(count_rows):
        row = rows[:, k]
        if stack.fresh[k]:
            z, volts = fields.soc[stack.file[k]], np.zeros((cells, LAGS))
        else:
            begin = current[k - 1]
            charge = stack.step_second[k] / (3600.0 * fields.capacity) * row[:, 4] / 2.0
            foreseen = z + charge * begin
            clocks = stack.step_second[k] * _rates(fields, row, foreseen, leads)
            weights = lag_weights(clocks, tau, hold="first_order")
            volts = lag_step(weights, volts, drive, 0.0)
            ohms, source, slope = _looked_up(fields, tables, row, foreseen, volts, leads)
            after = weights[2] * ohms[:, 1:]
            behind = (after * np.where(leading, slope[:, None], 1.0)).sum(axis=1) + slope * charge
            end = _shared(source, ohms[:, 0] + fields.wire + behind, held[k])[1]
            z, volts = z + charge * (begin + end), volts + after * end[:, None]
        ohms, source, _ = _looked_up(fields, tables, row, z, volts, leads)
        voltage[k], current[k] = _shared(source, ohms[:, 0] + fields.wire, total[k])
        drive, soc[k] = ohms[:, 1:] * current[k][:, None], z
    return current, voltage, soc


def _shared(source, ohm, total):
    """Voltage [V] and branch currents [A] of sources behind resistances, by Kirchhoff's laws."""
    whole = star(source, ohm)
    volt = whole[0] + whole[1] * total
    return volt, (volt - source) / ohm


def _rates(fields, row, soc, leads):
    """How fast time runs for each lag at a SoC and a row (b, LAGS) [1]."""
    to_full = np.array([diffusion_of(cell).log_diffusivity_to_full for cell in fields.cells])
    slowest = np.exp(to_full * (np.clip(soc, 0.0, 1.0) - 0.5)) * np.where(leads, row[:, 3], 1.0)
    return np.stack([row[:, 3]] * PAIRS + [slowest] * (LAGS - PAIRS), axis=1)


def _looked_up(fields, tables, row, soc, volts, leads):
    """Of branches at a SoC, a row and voltages of their lags (b, LAGS): resistances, ohmic and of
    each lag (b, 1 + LAGS) [ohm], voltage behind the ohmic one (b,) [V], slope of the OCV (b,) [V].
    """
    each = zip(tables, soc, strict=True)
    entropic, *courses = np.array([[held_on_grid(t, z) for t in of[1:]] for of, z in each]).T
    ohms = fields.r.copy()
    ohms[:, : 1 + PAIRS] *= row[:, : 1 + PAIRS] * np.transpose(courses)
    ohms[:, 1 + PAIRS :] /= _rates(fields, row, soc, leads)[:, PAIRS:]
    slowest = volts[:, PAIRS:].sum(axis=1)
    ocv, slope = ocv_and_slope(fields.ocv, soc + np.where(leads, slowest, 0.0))
    source = ocv + entropic * row[:, 5] + volts[:, :PAIRS].sum(axis=1)
    return ohms, source + np.where(leads, 0.0, slowest), np.maximum(slope, 0.0)


VOLT_STEP = 1e-3
OWN_KNOT = 0.1
TABLES = ("ocv_volt", "courses")  # of a Branch, arrays


def group_frees(cells, files, spread, shared, *, sensors):
    """Free parameters of a healthy group, in the order of `group_names`.

    Parameters
    ----------
    cells : sequence of Branch. files : number of records. spread, shared :
    known.Spread, known.Shared.
    sensors : bool; the branch currents were logged.

    Returns
    -------
    free : tuple of least_squares.Free. Without branch currents their sensors are not among them.
    """

    def bounded(name, step, std):
        far = spread.widest * std
        return Free(name, step, 0.0, std, -far, far)

    def knots(name, count, volt):
        """Free knots of an OCV error; their correlation is that of `group_coupling`."""
        far = spread.widest * volt
        names = [f"{name}[{k}]" for k in range(count)]
        return [Free(name, VOLT_STEP, 0.0, np.inf, -far, far) for name in names]

    tested = all(cell.own for cell in cells)
    # The activation energy of a cell never tested over temperature is not known.
    warmed = tested and all(WARMED in dict(cell.effects) for cell in cells)
    free = []
    for name, (known, step) in COMMON.items():
        free.append(
            bounded(name, step, _std(shared, known, warmed if name == "energy" else tested))
        )
    free += [bounded(f"soc0[{k}]", OF_BRANCH["soc"][1], shared.soc) for k in range(files)]
    free += knots("fine", FINE_KNOTS, shared.ocv_volt)
    for b, cell in enumerate(cells):
        for name, (known, step) in OF_BRANCH.items():
            if sensors or name not in OF_SENSOR:
                of_size = cell.capacity_ampere_hour if name == "offset" else 1.0
                free.append(bounded(f"{b}.{name}", step, _std(spread, known, cell.own) * of_size))
        free += knots(f"{b}.ocv", OCV_KNOTS, _std(spread, "ocv_volt", cell.own))
    return tuple(free)


def _std(known, name, own):
    """Standard deviation out of `known.Spread` or `Shared`, of a cell's own tests or its type's."""
    std = getattr(known, name)
    return std if own else getattr(known, f"type_{name}", std)


def group_coupling(free, cells, spread, shared):
    """Prior precision of the errors of all OCV curves, smooth over SoC: (k, k)."""
    precision = np.zeros((len(free), len(free)))
    names = [parameter.name for parameter in free]
    at = [k for k, name in enumerate(names) if name.startswith("fine[")]
    precision[np.ix_(at, at)] = _smooth(FINE_KNOTS, shared.ocv_soc) / shared.ocv_volt**2
    shape = _smooth(OCV_KNOTS, spread.ocv_soc)
    for b, cell in enumerate(cells):
        at = [k for k, name in enumerate(names) if name.startswith(f"{b}.ocv[")]
        precision[np.ix_(at, at)] = shape / _std(spread, "ocv_volt", cell.own) ** 2
    return precision


def _smooth(knots, length):
    """Precision of a curve of unit size, smooth over a length of SoC."""
    soc = np.linspace(0.0, 1.0, knots)
    near = np.exp(-0.5 * (np.subtract.outer(soc, soc) / length) ** 2)
    return np.linalg.inv(near + OWN_KNOT**2 * np.eye(knots))


def document(case, state):
    """Model of a group as a document, from which `fields_of` and `group_run` simulate it.

    Parameters
    ----------
    case : case.GroupCase. state : state.State.

    Returns
    -------
    model : dict: branches (each as Branch), values (of group_names and effects by name), effects
    (effect and branch, from 1), initial_soc (f, b) of the records fitted [1], hold.
    """
    return {
        "branches": [
            {
                name: np.asarray(v).tolist() if name in TABLES else v
                for name, v in cell._asdict().items()
            }
            for cell in case.cells
        ],
        "values": {name: float(value) for name, value in state.solution.values.items()},
        "effects": [{"effect": e.id, "branch": e.position + 1} for e in state.effects],
        "initial_soc": case.fit.soc_at_start.tolist(),
        "hold": case.fit.hold,
    }


def fields_of(model, library=GROUP_LIBRARY):
    """GroupFields of a document, at the starts of its records.

    Parameters
    ----------
    model : dict, of `document`. library : dict of Effect by id.

    Returns
    -------
    fields : GroupFields.
    """
    cells = tuple(
        Branch(**{n: np.asarray(v, float) if n in TABLES and v else v for n, v in branch.items()})
        for branch in model["branches"]
    )
    effects = [at_branch(library[e["effect"]], e["branch"] - 1) for e in model["effects"]]
    return group_fields(cells, np.asarray(model["initial_soc"], float), model["values"], effects)
