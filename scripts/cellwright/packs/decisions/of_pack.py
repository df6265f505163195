"""Decisions on one pack: what it gives and how sure that is, which cell to replace, safe window."""

import numpy as np

from cellwright.packs.cells import pack_cells, table_temperatures
from cellwright.packs.decisions.group_use import (
    CURRENT_SPREAD,
    GROUP_C_RATE,
    cells_at,
    discharge_pack,
    safe_window,
)
from cellwright.packs.decisions.matching import replacements
from cellwright.packs.decisions.monte_carlo import pack_draws, string_draws, summary_rows
from cellwright.packs.network import network_of
from cellwright.packs.series.capability import cutoffs_of, discharge_curves, ended_string
from cellwright.packs.series.string import contact_of
from cellwright.packs.uncertainty.draws import draw_cells, uncertainty_of
from cellwright.packs.validate import of_one_activation_energy
from cellwright.packs.wiring import by_member, charge_of, is_string
from cellwright.refusal import Refusal
from cellwright.settings import PackDecisions

SETTINGS = PackDecisions()
MOST_SIMULATED = 200  # cells of a pack of which each is replaced in a simulation: minutes
EMPTY = {"decision": "", "quantity": "", "cell": "", "unit": "", "value": np.nan}
EMPTY |= dict.fromkeys(("p05", "p25", "p50", "p75", "p95"), np.nan)


def pack_decisions(
    wiring,
    models,
    positions,
    cells,
    capacity_std_ampere_hour,
    *,
    celsius,
    settings=SETTINGS,
    thermal=None,
    ambient_celsius=None,
):
    """What is decided about a pack, as rows of pack_decisions.

    Parameters
    ----------
    wiring : Wiring, any. What is said of a string of cells alone is exact for it; any other wiring
        is simulated as a whole.
    models : model dicts in the order of its cells. positions : BranchFacts, cells : CellFacts,
        capacity_std_ampere_hour : (cells,) [Ah] or None, each in that order.
    celsius : of all cells [degC]. settings : PackDecisions.
    thermal : Thermal of the cells in that order, by which those of a pack with parallel cells warm
        in a discharge, from `ambient_celsius` [degC] on; None: they have `celsius`.

    Returns
    -------
    rows : list of dict: decision, quantity, cell, unit, value, and of uncertain ones percentiles.

    Raises
    ------
    Refusal : a cell without cut-offs, more than 200 cells where some are in parallel, or as
        `simulate_pack`.
    """
    stated = [1.0 if row.initial_soc is None else row.initial_soc for row in positions]
    capacity = [model["capacity_ampere_hour"] for model in models]
    start = charged_soc(wiring, stated, capacity)
    known = uncertainty_of(models, capacity_std_ampere_hour)
    # Courses of the OCV that differ from cell to cell drive currents of their own and raise the
    # largest one of every draw: here an error of the voltage is the same at every SoC.
    known = known._replace(ocv=None)
    drawn = draw_cells(known, draws=settings.draws)
    lower, _ = cutoffs_of(cells)
    if is_string(wiring):
        pack = _string(models, positions, lower, drawn, start, celsius, settings)
    else:
        if len(models) > MOST_SIMULATED:
            raise Refusal(
                f"{wiring.name} is not decided on: found {len(models)} cells, wanted at most "
                f"{MOST_SIMULATED} where some are in parallel: each is replaced in a simulation"
            )
        around = {"thermal": thermal, "ambient_celsius": ambient_celsius}
        if thermal is None:
            tables = pack_cells(models, temperature_celsius=celsius)
            around["ambient_celsius"] = None
        else:
            models, _ = of_one_activation_energy(models)
            grid = table_temperatures(models, ambient_celsius)
            tables = pack_cells(models, temperature_celsius=grid)
        pack = _wired(wiring, tables, lower, drawn, start, settings, around)
    use, items, spare_of, draws, window = pack
    first = "weakest cell" if is_string(wiring) else "busiest cell"
    names = [row.cell for row in positions]
    rows = [{"decision": "uncertainty"} | row for row in summary_rows(draws, names, first=first)]
    rows += replacement_rows(use, items, spare_of, capacity, names) + window
    return [EMPTY | row for row in rows]


def charged_soc(wiring, initial_soc, capacity_ampere_hour):
    """SoC of each cell of a pack that is charged, from a start, until it takes no more (cells,).

    Members in series take the same charge until the first is full, so that what they are apart
    stays; members in parallel are all filled. Cells in parallel come to one SoC.

    Parameters
    ----------
    wiring : Wiring. initial_soc, capacity_ampere_hour : (cells,) in the order of its leaves.

    Returns
    -------
    soc : (cells,) [1]; all 1 for cells in parallel alone.
    """
    # ASSUME: Cells in parallel rest at one SoC, whatever their OCVs differ by.
    capacity = np.asarray(capacity_ampere_hour, float)
    lacking = capacity * (1.0 - np.asarray(initial_soc, float))
    charge = charge_of(wiring, lacking)
    return 1.0 - _lacking_after(wiring, lacking, capacity, charge) / capacity


def _lacking_after(wiring, lacking, capacity, charge):
    """What each cell lacks of full after a member took a charge (cells,) [Ah]."""
    if isinstance(wiring, str):
        return lacking - charge
    left = charge_of(wiring, lacking) - charge
    if wiring.connection == "parallel" and all(isinstance(m, str) for m in wiring.members):
        # Joined cells settle at one SoC: what they lack is shared by capacity.
        return left * capacity / capacity.sum()
    parts = []
    for member, lacks, full in by_member(wiring, lacking, capacity):
        share = full.sum() / capacity.sum()
        of_member = (
            charge if wiring.connection == "series" else charge_of(member, lacks) - share * left
        )
        parts.append(_lacking_after(member, lacks, full, of_member))
    return np.concatenate(parts)


def _string(models, positions, lower, drawn, start, celsius, settings):
    """Use, items, spares of a string: items are columns of curves, k + cells is cell k in full."""
    capacity, cells = np.array([model["capacity_ampere_hour"] for model in models]), len(models)
    current = settings.c_rate * float(np.median(capacity))
    at = {"current_ampere": current, "celsius": celsius}
    # Each cell as it is and, as a spare, full: one simulation of each, strings by choosing columns.
    both = {"lower_cutoff_volt": np.tile(lower, 2)}
    both["initial_soc"] = np.append(start, np.ones(cells))
    curves = discharge_curves([*models, *models], **both, **at)
    contact = contact_of(positions) * current

    def use(items):
        found = ended_string(curves, items, contact_volt=contact)
        return found.capacity_ampere_hour, found.energy_watt_hour

    draws = string_draws(models, drawn, lower_cutoff_volt=lower, initial_soc=start, **at)
    return use, list(range(cells)), lambda item: item + cells, draws, []


def _wired(wiring, tables, lower, drawn, start, settings, around):
    """Use, items and spares of a pack with parallel cells: items are (index of tables, SoC)."""
    share = network_of(wiring, tables.capacity_ampere_hour).share
    current = GROUP_C_RATE * float((tables.capacity_ampere_hour / share).min())
    at = {"lower_cutoff_volt": lower, "current_ampere": current}

    def use(items):
        index, soc = zip(*items, strict=True)
        warms = around | {"thermal": _put_in(around["thermal"], list(index))}
        start = {"initial_soc": np.array(soc)}
        found = discharge_pack(cells_at(tables, index), wiring, **start, **at, **warms)
        return found.capacity_ampere_hour, found.energy_watt_hour

    about = {"initial_soc": start, **at, **around}
    draws = pack_draws(tables, wiring, drawn, **about)
    window = window_rows(discharge_pack(tables, wiring, **about))
    items = list(enumerate(start))
    return use, items, lambda item: (item[0], 1.0), draws, window


def _put_in(thermal, index):
    """Thermal of a pack in whose places these cells are."""
    if thermal is None:
        return None
    return thermal._replace(
        heat_capacity_joule_per_kelvin=thermal.heat_capacity_joule_per_kelvin[index],
        resistance_kelvin_per_watt=thermal.resistance_kelvin_per_watt[index],
        entropic_volt_per_kelvin=thermal.entropic_volt_per_kelvin[index],
    )


def replacement_rows(use, items, spare_of, capacity, names):
    """Rows on which cell to replace: the gain of each cell, the best and its margin, and in turn.

    Parameters
    ----------
    use, items, spare_of, capacity : as `use`, `cells`, `spare_of` and `capacity_ampere_hour` of
        `matching.replacements`. names : of the cells.
    """
    gains, median, in_turn = replacements(
        use, items, capacity_ampere_hour=capacity, spare_of=spare_of
    )
    energy = gains[:, 1]
    order = np.argsort(-energy, kind="stable")
    best, margin = names[order[0]], energy[order[0]] - energy[order[1]]
    about = {"decision": "replace a cell", "unit": "Wh"}
    found = [
        (f"best, by one as {names[median]} (median)", best, energy[order[0]]),
        ("margin to the second best", best, margin),
        *(("gain in usable energy", names[k], energy[k]) for k in order),
    ]
    rows = [about | {"quantity": q, "cell": cell, "value": float(v)} for q, cell, v in found]
    for turn, (k, charge, left) in enumerate(in_turn, 1):
        done = about | {"cell": names[k], "quantity": f"after {turn} replaced in turn, usable"}
        rows += [done | {"value": left}, done | {"unit": "Ah", "value": charge}]
    return rows


def window_rows(use):
    """Rows on the range of SoC in which the branch currents of a PackUse stay within a spread."""
    values = safe_window(use) | {
        "largest branch current over its share": use.peak_share,
        "charge given over the sum of the cells": use.capacity_ampere_hour / use.cells_ampere_hour,
    }
    about = {"decision": f"safe window, spread below {100 * CURRENT_SPREAD:g} %", "cell": ""}
    return [
        about | {"quantity": quantity, "unit": "1", "value": float(value)}
        for quantity, value in values.items()
    ]
