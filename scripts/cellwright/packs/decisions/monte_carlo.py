"""What the uncertainties of its cells leave of the numbers of a pack: Monte Carlo."""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.model_file import member_of, simulate_model
from cellwright.packs.decisions.group_use import RESISTANCES, discharge_pack, with_contacts
from cellwright.packs.series.capability import BEYOND, first_crossing
from cellwright.settings import PackDecisions

SETTINGS = PackDecisions()
STEP_SHARE = 0.005  # of the charge of the largest cell, a step of a drawn discharge
PERCENTILES = (5.0, 25.0, 50.0, 75.0, 95.0)


class Uncertainty(NamedTuple):
    """Standard deviations of what is known of each cell, (cells,) each.

    capacity_relative, resistance_relative : [1]. voltage_volt : what the chosen member misses of
    records left out of its fit [V]. initial_soc : [1].
    """

    capacity_relative: np.ndarray
    resistance_relative: np.ndarray
    voltage_volt: np.ndarray
    initial_soc: np.ndarray


def uncertainty_of(
    models,
    capacity_std_ampere_hour,
    *,
    capacity_relative_std=SETTINGS.capacity_relative_std,
    resistance_relative_std=SETTINGS.resistance_relative_std,
    initial_soc_std=SETTINGS.initial_soc_std,
):
    """Uncertainty of each cell of a pack.

    The capacity's is that of the mean of its repeats, the resistance's that of the sum of the
    model's resistances (their standard deviations, median over SoC), the voltage's the error on
    records left out of the fit; none smaller than the settings say.

    Parameters
    ----------
    models : model dicts. capacity_std_ampere_hour : (cells,), NaN or None where not known [Ah].
    capacity_relative_std, resistance_relative_std : least values [1]. initial_soc_std : [1].

    Returns
    -------
    uncertainty : Uncertainty.
    """
    capacity = np.array([model["capacity_ampere_hour"] for model in models])
    stds = [np.nan if std is None else std for std in capacity_std_ampere_hour]
    relative = np.nan_to_num(np.array(stds, float) / capacity)
    members = [member_of(model) for model in models]
    resistance = np.array([relative_resistance_std(member) for member in members])
    missed = [member.get("left_out_rmse_volt") for member in members]
    return Uncertainty(
        np.maximum(relative, capacity_relative_std),
        np.maximum(np.nan_to_num(resistance), resistance_relative_std),
        np.array([0.0 if volt is None else volt for volt in missed]),
        np.full(len(models), float(initial_soc_std)),
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


class CellDraws(NamedTuple):
    """Cells as they may be, (draws, cells) each: factors of capacity and resistance [1], error of
    the voltage [V], SoC at the start beside what is said [1]."""

    capacity_factor: np.ndarray
    resistance_factor: np.ndarray
    voltage_volt: np.ndarray
    initial_soc: np.ndarray


def draw_cells(uncertainty, *, draws=SETTINGS.draws, seed=SETTINGS.random_seed):
    """Draws of the cells of a pack, independent from cell to cell, normal.

    Parameters
    ----------
    uncertainty : Uncertainty. draws : their number. seed : of the generator.

    Returns
    -------
    drawn : CellDraws; no factor is below a tenth.
    """
    random = np.random.default_rng(seed)
    shape = (draws, len(uncertainty.capacity_relative))
    normal = [random.standard_normal(shape) for _ in uncertainty]
    capacity, resistance, volt, soc = (z * std for z, std in zip(normal, uncertainty, strict=True))
    return CellDraws(np.maximum(1.0 + capacity, 0.1), np.maximum(1.0 + resistance, 0.1), volt, soc)


class PackDraws(NamedTuple):
    """A pack in each draw, (draws,): usable charge [Ah] and energy [Wh]; the cell that ends the
    discharge (of a string), or carries the largest share of current for its capacity (of a parallel
    group); that share [1] (1 in a string); the heat of the hottest cell [W], and which it is."""

    capacity_ampere_hour: np.ndarray
    energy_watt_hour: np.ndarray
    weakest: np.ndarray
    peak_share: np.ndarray
    hottest_watt: np.ndarray
    hottest: np.ndarray


def string_draws(models, drawn, *, lower_cutoff_volt, current_ampere, initial_soc, celsius=25.0):
    """A series string discharged in every draw until its first cell is empty.

    Parameters
    ----------
    models, lower_cutoff_volt, current_ampere, initial_soc, celsius : as of
        `capability.discharge_string`. drawn : CellDraws.

    Returns
    -------
    draws : PackDraws.
    """
    cells, draws = len(models), len(drawn.capacity_factor)
    start = np.broadcast_to(np.asarray(initial_soc, float), (cells,))
    cutoff = np.broadcast_to(np.asarray(lower_cutoff_volt, float), (cells,))
    most = max(model["capacity_ampere_hour"] for model in models)
    charge = np.linspace(0.0, BEYOND * most, int(BEYOND / STEP_SHARE) + 1)
    volt, heat = np.empty((draws, cells, len(charge))), np.empty((draws, cells))
    ends = np.empty((draws, cells))
    for k, model in enumerate(models):
        of_cell = [column[:, k] for column in drawn]
        curves = _cell_curves(model, of_cell, charge, current_ampere, start[k], celsius)
        volt[:, k], heat[:, k] = curves
        at_cutoff = [first_crossing(charge, curve, cutoff[k]) for curve in volt[:, k]]
        held = (start[k] + drawn.initial_soc[:, k]) * drawn.capacity_factor[:, k]
        ends[:, k] = np.fmin(at_cutoff, held * model["capacity_ampere_hour"])
    end = ends.min(axis=1)
    energy = [_energy_until(charge, volt[d].sum(axis=0), end[d]) for d in range(draws)]
    ones, hottest = np.ones(draws), np.argmax(heat, axis=1)
    return PackDraws(
        end, np.array(energy), np.argmin(ends, axis=1), ones, heat.max(axis=1), hottest
    )


def _cell_curves(model, of_cell, charge, current_ampere, start, celsius):
    """Voltage of a discharged cell in each draw (draws, n) [V], and its mean heat (draws,) [W]."""
    second = 3600.0 * charge / current_ampere
    current = np.full(len(charge), -float(current_ampere))
    warm = np.full(len(charge), float(celsius))
    volts, heats = [], []
    for capacity, resistance, error, soc in zip(*of_cell, strict=True):
        course = start + soc - charge / (capacity * model["capacity_ampere_hour"])
        run = simulate_model(model, None, second, current, course, warm, hold="zero_order")
        over = run.overpotential_volt.sum(axis=0)
        volts.append(run.voltage_volt + (resistance - 1.0) * over + error)
        inside = (course > 0.0) & (course < 1.0)
        heats.append(-resistance * over[inside].mean() * current_ampere)
    return np.array(volts), np.abs(heats)


def _energy_until(charge, volt, end):
    kept = charge < end
    at_end = np.interp(end, charge, volt)
    return np.trapezoid(np.append(volt[kept], at_end), np.append(charge[kept], end))


def drawn_cells(cells, drawn, draw):
    """The cells of a pack in one draw; the voltage of all is off by that of the first.

    Parameters
    ----------
    cells : PackCells. drawn : CellDraws of them. draw : index.
    """
    factor = drawn.resistance_factor[draw][:, None, None]
    changed = {name: getattr(cells, name) * factor for name in RESISTANCES}
    return cells._replace(
        ocv_volt=cells.ocv_volt + drawn.voltage_volt[draw, 0],
        capacity_ampere_hour=cells.capacity_ampere_hour * drawn.capacity_factor[draw],
        **changed,
    )


def pack_draws(
    cells,
    wiring,
    drawn,
    *,
    lower_cutoff_volt,
    current_ampere,
    initial_soc=1.0,
    wire_relative_std=SETTINGS.wire_relative_std,
    random_seed=SETTINGS.random_seed,
):
    """A pack with parallel cells discharged to its cut-off in every draw of its cells and wires.

    Cells that rest joined have one voltage: errors of the voltage and of the SoC at the start are
    those of the first cell for all. Drawn apart they would drive currents that no rested group has.

    Parameters
    ----------
    cells, wiring, lower_cutoff_volt, current_ampere, initial_soc : as of
        `group_use.discharge_pack`. drawn : CellDraws. wire_relative_std : of all contacts together
        [1]. random_seed : of their draws.

    Returns
    -------
    draws : PackDraws.
    """
    draws = len(drawn.capacity_factor)
    random = np.random.default_rng([random_seed, 1])
    factors = np.maximum(1.0 + wire_relative_std * random.standard_normal(draws), 0.1)
    rows = []
    for draw in range(draws):
        use = discharge_pack(
            drawn_cells(cells, drawn, draw),
            with_contacts(wiring, factors[draw]),
            lower_cutoff_volt=lower_cutoff_volt,
            current_ampere=current_ampere,
            initial_soc=initial_soc + drawn.initial_soc[draw, 0],
        )
        hot = int(np.argmax(use.loss_watt))
        given = (use.capacity_ampere_hour, use.energy_watt_hour, use.first, use.peak_share)
        rows.append((*given, float(use.loss_watt[hot]), hot))
    return PackDraws(*(np.array(column) for column in zip(*rows, strict=True)))


def summary_rows(draws, names, *, first):
    """Rows quantity, unit, cell and percentiles of a pack's draws.

    Parameters
    ----------
    draws : PackDraws. names : of its cells. first : what its `weakest` is called: "weakest cell" of
        a string, "busiest cell" of a parallel group.

    Returns
    -------
    rows : list of dict: charge, energy, peak share and heat: mean, percentiles 5, 25, 50, 75, 95;
        then of each cell that is the first (hottest) in some draw how often, by falling share.
    """
    quantities = {
        "usable charge": ("Ah", draws.capacity_ampere_hour),
        "usable energy": ("Wh", draws.energy_watt_hour),
        "largest branch current over its share": ("1", draws.peak_share),
        "heat of the hottest cell": ("W", draws.hottest_watt),
    }
    rows = [
        {"quantity": name, "cell": "", "unit": unit, "value": float(values.mean())}
        | {f"p{int(p):02d}": float(np.percentile(values, p)) for p in PERCENTILES}
        for name, (unit, values) in quantities.items()
    ]
    for name, chosen in ((first, draws.weakest), ("hottest cell", draws.hottest)):
        count = np.bincount(chosen, minlength=len(names)) / len(chosen)
        for k in np.argsort(-count, kind="stable")[: np.count_nonzero(count)]:
            rows.append(
                {"quantity": f"probability: {name}", "cell": names[k], "unit": "1"}
                | {"value": float(count[k])}
            )
    return rows
