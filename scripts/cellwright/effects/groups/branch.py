"""One branch of a group as it is known before the search: the whole model of its cell.

A branch keeps what the search of its cell by itself has found, as far as it is the cell's own and
follows from charge, temperature and current: courses of resistances over SoC and temperature,
kinetics, slow diffusion, an OCV and a capacity that move. What is of the cell's instrument, of its
place in a chamber or of its history stays behind.
"""

from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline, make_smoothing_spline

from cellwright.circuits.circuit import KINDS
from cellwright.effects.base import OCV_KNOTS, STAGES, kept_response
from cellwright.effects.library import LIBRARY
from cellwright.effects.library.overpotential import DIFFUSION_KINDS
from cellwright.effects.library.quantities import MIDDLE_SOC, fields_at
from cellwright.effects.library.thermal import BESIDE, ENERGY, WARMED
from cellwright.records.conditions import REFERENCE_CELSIUS
from cellwright.refusal import Refusal

SMOOTH_SOC = 0.01
USUAL_C_RATE = 0.5  # of the current at which courses over SoC are taken
SECANT_C_RATE = 0.01  # below it a resistance is that of this current: of none it has no secant


class Branch(NamedTuple):
    """One branch as it is known before the search.

    cell : name. capacity_ampere_hour : [Ah]. ocv_volt : (p,) on an even SoC grid from 0 to 1 [V].
    r_ohm : (3,) ohmic and of the two RC pairs at 25 degC and half charge [ohm]. tau_second : (2,)
    [s]. effects : of the cell, each its id and its parameters by name, in the order in which they
    act. courses : (4, p) on the grid: how much the OCV rises with temperature [V/K], and the three
    resistances over those at half charge [1]; None: 0 and 1. wire_ohm : stated resistance of the
    connection [ohm]. own : known from tests of this very cell, not of its type.
    """

    cell: str
    capacity_ampere_hour: float
    ocv_volt: np.ndarray
    r_ohm: tuple
    tau_second: tuple
    effects: tuple = ()
    courses: np.ndarray | None = None
    wire_ohm: float = 0.0
    own: bool = False


def branch_of(cell, model, *, wire_ohm=0.0, own=True):
    """Branch of a group from the model of its cell (`story.result.Finding.model`).

    Parameters
    ----------
    cell : name. model : dict with capacity_ampere_hour, ocv_volt on an even SoC grid, values.
    wire_ohm : stated resistance of its connection [ohm].
    own : the model is of this very cell, not of its type.

    Returns
    -------
    branch : Branch, with all effects of the model that a branch keeps (`Effect.of_branch`).

    Raises
    ------
    Refusal : healthy cells of the type have an effect that no branch keeps.
    """
    # ASSUME: Hysteresis, self-heating, and charge that is lost are alike in all cells of a group,
    # so that they move no current from one branch to another; so is the template of healthy cells.
    values = model["values"] | model.get("joined", {})
    ocv = np.asarray(model["ocv_volt"], float)
    error = smooth_shares(len(ocv), OCV_KNOTS) @ [values[f"ocv[{k}]"] for k in range(OCV_KNOTS)]
    known = (e for e in LIBRARY.values() if e.of_branch and e.names[0] in values)
    effects = [*model.get("healthy", ()), *((e.id, e.sizes_of(values)) for e in known)]
    strange = [key for key, _ in effects if key not in LIBRARY or not LIBRARY[key].of_branch]
    if strange:
        raise Refusal(f"the model of {cell} has {strange[0]}, which no branch of a group keeps")
    branch = Branch(
        cell,
        model["capacity_ampere_hour"] * (1.0 + values["capacity"]),
        ocv + error,
        tuple(float(np.exp(values[f"log_r{k}"])) for k in range(3)),
        tuple(float(np.exp(values[f"log_tau{k}"])) for k in (1, 2)),
        tuple((key, dict(p)) for key, p in sorted(effects, key=_stage)),
        wire_ohm=wire_ohm,
        own=own,
    )
    return _over_soc(branch) if branch.effects else branch


def _stage(effect):
    """Number of the stage at which an effect, its id and parameters, acts."""
    return STAGES.index(LIBRARY[effect[0]].stage)


def _over_soc(branch):
    """A Branch with what its effects make of capacity, OCV and resistances at 25 degC."""
    ampere_hour, soc = branch.capacity_ampere_hour, np.linspace(0.0, 1.0, len(branch.ocv_volt))
    usual = {"current": -USUAL_C_RATE * ampere_hour, "ampere_hour": ampere_hour}
    here, warmer, middle = (
        _with_effects(branch.effects, soc=at, celsius=REFERENCE_CELSIUS + kelvin, **usual)
        for at, kelvin in ((soc, 0.0), (soc, 1.0), (MIDDLE_SOC, 0.0))
    )
    return branch._replace(
        capacity_ampere_hour=float(middle.capacity[0]),
        ocv_volt=branch.ocv_volt + here.ocv,
        courses=np.stack([warmer.ocv - here.ocv, *(_ohms(here) / _ohms(middle))]),
    )


def _with_effects(effects, *, ampere_hour, **conditions):
    """Fields of a cell of one ohm in each resistance, its effects on them: base.Fields, (n,)."""
    known = ((LIBRARY[key], p) for key, p in effects)
    # Diffusion is not over at once: the group steps its lags.
    acting = [(effect, p) for effect, p in known if effect.stage != "diffusion"]
    return fields_at({"capacity_ampere_hour": ampere_hour}, acting, **conditions)


def _ohms(fields):
    """Resistances (3, n), the ohmic one as a secant at the current, and of both pairs [ohm]."""
    return np.stack([fields.ohmic / fields.current, *fields.slow_ohm])


def conditions(branch, stack, share, warmer, energy):
    """What the rows of a stack make of a branch: (n, 6), kept as long as nothing moves it.

    Columns: factors of the ohmic resistance and of either pair's; how fast time runs for the pairs;
    one over the factor of the capacity [1]; and how far it is above 25 degC [K].

    Parameters
    ----------
    branch : Branch. stack : records.Stack of the group. share : of its current that the branch
    takes by its capacity [1]: kinetics and both ways of a resistance are those of this current.
    warmer : than measured [K]. energy : beside the cell's own activation energy [J/mol].
    """
    columns, sizes = (stack.celsius, stack.current_ampere, branch.effects), (share, warmer, energy)
    return kept_response(
        stack, columns, (conditions, *sizes), lambda: _conditions(branch, stack, *sizes)
    )


def _conditions(branch, stack, share, warmer, energy):
    ampere_hour, inside = branch.capacity_ampere_hour, stack.celsius + warmer
    least, current = SECANT_C_RATE * ampere_hour, share * stack.current_ampere
    effects = ((WARMED, BESIDE | {ENERGY: energy}), *branch.effects)
    current = np.where(np.abs(current) < least, -least, current)
    middle = {"soc": MIDDLE_SOC, "ampere_hour": ampere_hour}
    here, usual = (
        _with_effects(effects, celsius=at, current=ampere, **middle)
        for at, ampere in ((inside, current), (REFERENCE_CELSIUS, -least))
    )
    rate = np.broadcast_to(1.0 / here.tau_factor, inside.shape)
    above = inside - REFERENCE_CELSIUS
    return np.stack([*_ohms(here), rate, usual.capacity / here.capacity, above], axis=1)


class Diffusion(NamedTuple):
    """Slow diffusion of a branch: r_ohm : (m,) of each lag [ohm]; tau_second : (m,) [s].
    log_diffusivity_to_full : [1]. leads : it moves the SoC at which the OCV is, a volt by one."""

    r_ohm: np.ndarray
    tau_second: np.ndarray
    log_diffusivity_to_full: float = 0.0
    leads: bool = False


def diffusion_of(branch):
    """Slow diffusion of a branch: Diffusion, of no lag where it has none."""
    p = next((p for key, p in branch.effects if LIBRARY[key].stage == "diffusion"), None)
    if p is None:
        return Diffusion(np.zeros(0), np.zeros(0))
    kind = KINDS[DIFFUSION_KINDS[int(p["finite_length"])]]
    lags = kind.lags(tau_second=p["time_constant_second"])
    return Diffusion(
        p["resistance_ohm"] * np.array([lag.share for lag in lags]),
        np.array([lag.constant for lag in lags]),
        p["log_diffusivity_to_full"],
        kind.output == "soc",
    )


def smooth_ocv(ocv_volt):
    """An OCV table (p,) on an even grid without what is shorter than `SMOOTH_SOC` of SoC [V].

    Cells at slightly different SoC are pulled apart by every wiggle of a measured table.
    Source: cubic smoothing spline, its bandwidth after B. W. Silverman, Ann. Stat. 12 (1984) 898.
    """
    grid = np.linspace(0.0, 1.0, len(ocv_volt))
    return make_smoothing_spline(grid, ocv_volt, lam=len(grid) * SMOOTH_SOC**4)(grid)


@cache
def smooth_shares(points, knots):
    """Share of each knot of an OCV error at each point of an even SoC grid: (points, knots).

    Smooth between knots: cells in parallel are pulled apart by the slopes of their OCV.
    """
    spline = CubicSpline(np.linspace(0.0, 1.0, knots), np.eye(knots))
    return spline(np.linspace(0.0, 1.0, points))
