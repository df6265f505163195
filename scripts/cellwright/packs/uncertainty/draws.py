"""Cells of a pack as they may be: how sure their models are, and draws within that."""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.model_file import member_of
from cellwright.numerics.linear import hats
from cellwright.numerics.statistics import rms
from cellwright.settings import PackDecisions

SETTINGS = PackDecisions()
SEED = 17  # of all draws
INITIAL_SOC_STD = 0.005  # of a cell at the start beside what the sheet says: good balancing
LEAST_CAPACITY = 0.003  # standard deviation: repeats of a capacity test on good cyclers [1]
LEAST_BINS = 10  # of SoC and way of load, by which cells are compared
WIRE_RELATIVE_STD = 0.1  # of a connection beside what groups.tsv says: bolted and welded contacts
RESISTANCES = ("r0_ohm", "r_ohm", "kinetic_r_ohm", "charge_ohm", "discharge_ohm")
POINTS = 101  # of SoC, on which an error of the OCV is drawn


class OwnMisfit(NamedTuple):
    """What is off in one cell and not alike in all, (cells,) each.

    volt : what lasts of the misfit [V]. share : of the whole misfit [1]. capacity_relative : as
    its repeats state it [1].
    """

    volt: np.ndarray
    share: np.ndarray
    capacity_relative: np.ndarray


class Uncertainty(NamedTuple):
    """Standard deviations of what is known of each cell, (cells,) each.

    capacity_relative, resistance_relative : [1]. voltage_volt : what the chosen member misses of
    records left out of its fit [V]. initial_soc : [1]. ocv : `ocv_error` of each cell, or None
    where an error of the voltage is the same at every SoC. own : OwnMisfit; None: not known.
    """

    capacity_relative: np.ndarray
    resistance_relative: np.ndarray
    voltage_volt: np.ndarray
    initial_soc: np.ndarray
    ocv: tuple | None = None
    own: OwnMisfit | None = None


def uncertainty_of(models, capacity_std_ampere_hour):
    """How sure it is what is known of each cell of a pack: Uncertainty.

    The capacity's is that of the mean of its repeats, the resistance's that of the sum of the
    model's resistances (their standard deviations, median over SoC), none smaller than good
    cyclers repeat them. The voltage's is the error on records left out of the fit, else what the
    model states of its OCV.

    Parameters
    ----------
    models : model dicts. capacity_std_ampere_hour : (cells,), NaN or None where not known [Ah].
    """
    capacity = np.array([model["capacity_ampere_hour"] for model in models])
    stds = [np.nan if std is None else std for std in capacity_std_ampere_hour]
    relative = np.array(stds, float) / capacity
    missed_alone = own_misfit(models)
    members = [member_of(model) for model in models]
    resistance = np.array([relative_resistance_std(member) for member in members])
    ocv = tuple(map(ocv_error, members))
    left_out = [member.get("left_out_rmse_volt") for member in members]
    missed = [rms(o[1]) if volt is None else volt for volt, o in zip(left_out, ocv, strict=True)]
    return Uncertainty(
        # Where nothing is known the least values hold.
        np.maximum(np.nan_to_num(relative), LEAST_CAPACITY),
        np.maximum(np.nan_to_num(resistance), 0.02),  # what contacts and temperature change
        np.array(missed),
        np.full(len(models), INITIAL_SOC_STD),
        ocv,
        missed_alone and OwnMisfit(*missed_alone, np.where(relative > 0, relative, LEAST_CAPACITY)),
    )


def own_misfit(models):
    """What each chosen member misses that is not the same in all cells; None: not known.

    Cells of one type that were tested alike are missed alike, at one SoC under one way of load.
    What all have in common moves no current between them; what is each one's own and lasts does.

    Parameters
    ----------
    models : model dicts, whose `intervals` state what was missed (`misfit_volt`).

    Returns
    -------
    volt, share : (cells,) own misfit, by as much more as blocks left out were missed than those of
        the fit [V]; and its share of the whole misfit [1].
    """
    missed = [
        entry.get("misfit_volt")
        for model in models
        for entry in model.get("intervals", ())
        if entry["model"] == model["chosen"]
    ]
    if len(models) < 2 or len(missed) < len(models) or None in missed:
        return None
    volt = np.array(missed, float).reshape(len(models), -1)
    volt = volt[:, np.isfinite(volt).all(axis=0)]
    if volt.shape[1] < LEAST_BINS or not volt.any(axis=1).all():
        return None
    # The mean of few cells has taken part of what is each one's own.
    own = (volt - volt.mean(axis=0)) * np.sqrt(len(models) / (len(models) - 1))
    own, whole = (np.sqrt(np.mean(part**2, axis=1)) for part in (own, volt))
    members = [member_of(model) for model in models]
    in_fit = [rms([c["fit_rmse_volt"] for c in one["conditions"]]) for one in members]
    left_out = [one["left_out_rmse_volt"] for one in members]
    grown = np.array([out / fit for out, fit in zip(left_out, in_fit, strict=True)])
    return own * np.maximum(grown, 1.0), np.minimum(own / whole, 1.0)


def of_currents(uncertainty):
    """What of an Uncertainty moves currents between cells: their OCVs and resistances are off by
    what the models miss of each cell alone, where that is known."""
    if uncertainty.own is None or uncertainty.ocv is None:
        return uncertainty
    volt, share, capacity = uncertainty.own
    ocv = tuple(
        (soc, np.full(len(soc), own)) for (soc, _), own in zip(uncertainty.ocv, volt, strict=True)
    )
    resistance = uncertainty.resistance_relative * share
    known = {"capacity_relative": capacity, "resistance_relative": resistance, "ocv": ocv}
    return uncertainty._replace(**known)


def relative_resistance_std(member):
    """Relative standard deviation of a member's resistance in the long run [1], NaN if unknown.

    Parameters
    ----------
    member : dict, a member of a model file. Median over SoC and conditions. Where it does not state
        that of the sum of all resistances, those of one SoC are taken as independent.
    """
    shares = []
    for condition in member["conditions"]:
        branches = [b for b in condition["branches"] if "r_ohm" in b]
        values = [condition["r0_ohm"], *(branch["r_ohm"] for branch in branches)]
        stds = [condition.get("r0_std_ohm"), *(branch.get("r_std_ohm") for branch in branches)]
        if any(std is None for std in stds):
            continue
        steady = condition.get("steady_std_ohm")
        if steady is None:
            steady = np.sqrt(np.sum(np.square(np.array(stds, float)), axis=0))
        shares += list(np.array(steady, float) / np.sum(np.array(values, float), axis=0))
    shares = [share for share in shares if np.isfinite(share)]
    return float(np.median(shares)) if shares else np.nan


def ocv_error(member):
    """How sure a member's open-circuit voltage is, at the SoC of its first condition.

    Parameters
    ----------
    member : dict, a member of a model file.

    Returns
    -------
    soc, std_volt : (m,) [1], [V]: what it states (`ocv_shift_std_volt`), else its error on records
        left out of its fit, else 0.
    """
    # ASSUME: Errors of the OCV at two SoC of a model are independent: each was fitted to rows of
    # its own.
    condition = member["conditions"][0]
    missed = member.get("left_out_rmse_volt") or 0.0
    soc = np.asarray(condition["soc"], float)
    stated = condition.get("ocv_shift_std_volt") or [np.nan] * len(soc)
    std = np.asarray(stated, float)
    return soc, np.where(np.isfinite(std), std, missed)


def is_known(model):
    """Whether anything tells how sure a model is: deviations, or an error on what was left out."""
    member = member_of(model)
    return bool(np.isfinite(relative_resistance_std(member)) or ocv_error(member)[1].any())


class CellDraws(NamedTuple):
    """Cells as they may be, (draws, cells) each: factors of capacity and resistance [1], error of
    the voltage [V], SoC at the start beside what is said [1].

    ocv_volt : (draws, cells, POINTS) error of the OCV over SoC from 0 to 1 [V], or None.
    """

    capacity_factor: np.ndarray
    resistance_factor: np.ndarray
    voltage_volt: np.ndarray
    initial_soc: np.ndarray
    ocv_volt: np.ndarray | None = None


def draw_cells(uncertainty, *, draws=SETTINGS.draws, seed=SEED):
    """Draws of the cells of a pack, independent from cell to cell, normal.

    Parameters
    ----------
    uncertainty : Uncertainty. draws : their number. seed : of the generator.

    Returns
    -------
    drawn : CellDraws; no factor is below a tenth, which keeps resistances and capacities positive.
    """
    random = np.random.default_rng(seed)
    shape = (draws, len(uncertainty.capacity_relative))
    normal = [random.standard_normal(shape) for _ in range(4)]
    pairs = zip(normal, uncertainty[:4], strict=True)
    capacity, resistance, volt, soc = (z * std for z, std in pairs)
    courses = None
    if uncertainty.ocv is not None:
        courses = np.stack([_courses(*error, draws, random) for error in uncertainty.ocv], axis=1)
    factors = (np.maximum(1.0 + z, 0.1) for z in (capacity, resistance))
    return CellDraws(*factors, volt, soc, courses)


def _courses(soc, std_volt, draws, random):
    """Errors of an OCV over SoC (draws, POINTS) [V], between two SoC as uncertain as at them."""
    between = hats(np.linspace(0.0, 1.0, POINTS), soc)
    # A straight line between two independent errors varies less than they do: scaled back up.
    between /= np.linalg.norm(between, axis=1, keepdims=True)
    return (random.standard_normal((draws, len(soc))) * std_volt) @ between.T


def wire_factors(draws):
    """Factors (draws,) of all contacts of a pack together [1]."""
    random = np.random.default_rng([SEED, 1])
    return np.maximum(1.0 + WIRE_RELATIVE_STD * random.standard_normal(draws), 0.1)


def drawn_cells(cells, drawn, draw, initial_soc):
    """The cells of a pack in one draw, joined at rest before the start.

    The voltage of all is off by that of the first at the start, where they are in equilibrium; from
    there on the OCV of each is off by its own course.

    Parameters
    ----------
    cells : PackCells. drawn : CellDraws of them. draw : index. initial_soc : scalar or (cells,),
        where they were joined [1].
    """
    factor = drawn.resistance_factor[draw][:, None, None]
    tables = cells.tables
    changed = {name: tables[name] * factor for name in RESISTANCES}
    shift = drawn.voltage_volt[draw, 0]
    if drawn.ocv_volt is not None:
        points = np.linspace(0.0, 1.0, tables["ocv_volt"].shape[-1])
        grid = np.linspace(0.0, 1.0, POINTS)
        start = np.broadcast_to(np.asarray(initial_soc, float), (len(cells.names),))
        rows = [
            np.interp(points, grid, course) - np.interp(soc, grid, course)
            for course, soc in zip(drawn.ocv_volt[draw], start, strict=True)
        ]
        shift = shift + np.array(rows)[:, None, :]
    return cells._replace(
        capacity_ampere_hour=cells.capacity_ampere_hour * drawn.capacity_factor[draw],
        tables=tables | changed | {"ocv_volt": tables["ocv_volt"] + shift},
    )
