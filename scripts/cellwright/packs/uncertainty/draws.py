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
WIRE_RELATIVE_STD = 0.1  # of a connection beside what groups.tsv says: bolted and welded contacts
RESISTANCES = ("r0_ohm", "r_ohm", "kinetic_r_ohm", "charge_ohm", "discharge_ohm")
POINTS = 101  # of SoC, on which an error of the OCV is drawn


class Uncertainty(NamedTuple):
    """Standard deviations of what is known of each cell, (cells,) each.

    capacity_relative, resistance_relative : [1]. voltage_volt : what the chosen member misses of
    records left out of its fit [V]. initial_soc : [1]. ocv : `ocv_error` of each cell, or None
    where an error of the voltage is the same at every SoC.
    """

    capacity_relative: np.ndarray
    resistance_relative: np.ndarray
    voltage_volt: np.ndarray
    initial_soc: np.ndarray
    ocv: tuple | None = None


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
    # Not known: the least values below hold.
    relative = np.nan_to_num(np.array(stds, float) / capacity)
    members = [member_of(model) for model in models]
    resistance = np.array([relative_resistance_std(member) for member in members])
    ocv = tuple(map(ocv_error, members))
    left_out = [member.get("left_out_rmse_volt") for member in members]
    missed = [rms(o[1]) if volt is None else volt for volt, o in zip(left_out, ocv, strict=True)]
    return Uncertainty(
        np.maximum(relative, 0.003),  # repeats of a capacity test on good cyclers
        np.maximum(np.nan_to_num(resistance), 0.02),  # what contacts and temperature change
        np.array(missed),
        np.full(len(models), INITIAL_SOC_STD),
        ocv,
    )


def relative_resistance_std(member):
    """Relative standard deviation of a member's resistance in the long run [1], NaN if unknown.

    Parameters
    ----------
    member : dict, a member of a model file. Median over SoC and conditions; the resistances of one
        SoC are taken as independent.
    """
    shares = []
    for condition in member["conditions"]:
        branches = [b for b in condition["branches"] if "r_ohm" in b]
        values = [condition["r0_ohm"], *(branch["r_ohm"] for branch in branches)]
        stds = [condition.get("r0_std_ohm"), *(branch.get("r_std_ohm") for branch in branches)]
        if any(std is None for std in stds):
            continue
        squares = np.sum(np.square(np.array(stds, float)), axis=0)
        shares += list(np.sqrt(squares) / np.sum(np.array(values, float), axis=0))
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
