"""Decisions on one pack: what it gives and how sure that is, which cell to replace, safe window."""

import numpy as np

from cellwright.packs.cells import pack_cells
from cellwright.packs.decisions.group_use import cells_at, discharge_pack, safe_window
from cellwright.packs.decisions.matching import replacements
from cellwright.packs.decisions.monte_carlo import (
    draw_cells,
    pack_draws,
    string_draws,
    summary_rows,
    uncertainty_of,
)
from cellwright.packs.network import network_of
from cellwright.packs.series.capability import (
    contact_of,
    cutoffs_of,
    discharge_curves,
    ended_string,
)
from cellwright.packs.wiring import cells_of, depth
from cellwright.refusal import Refusal
from cellwright.settings import PackDecisions

SETTINGS = PackDecisions()
MOST_CELLS = 200
PERCENTILES = ("p05", "p25", "p50", "p75", "p95")
EMPTY = {"decision": "", "quantity": "", "cell": "", "unit": "", "value": np.nan}
EMPTY |= dict.fromkeys(PERCENTILES, np.nan)


def pack_decisions(
    wiring, models, positions, cells, capacity_std_ampere_hour, *, celsius, settings=SETTINGS
):
    """What is decided about a pack, as rows of pack_decisions.

    Parameters
    ----------
    wiring : Wiring, any. What is said of a string of cells alone is exact for it; any other wiring
        is simulated as a whole.
    models : model dicts in the order of its cells. positions : BranchFacts, cells : CellFacts,
        capacity_std_ampere_hour : (cells,) [Ah] or None, each in that order.
    celsius : of all cells [degC]. settings : PackDecisions.

    Returns
    -------
    rows : list of dict: decision, quantity, cell, unit, value, and of uncertain ones percentiles.

    Raises
    ------
    Refusal : a cell without cut-offs, more than 200 cells where some are in parallel, or as
        `simulate_pack`.
    """
    stated = [1.0 if row.initial_soc is None else row.initial_soc for row in positions]
    start = charged_soc(wiring, stated, [model["capacity_ampere_hour"] for model in models])
    known = uncertainty_of(
        models,
        capacity_std_ampere_hour,
        capacity_relative_std=settings.capacity_relative_std,
        resistance_relative_std=settings.resistance_relative_std,
        initial_soc_std=settings.initial_soc_std,
    )
    drawn = draw_cells(known, draws=settings.draws, seed=settings.random_seed)
    lower, _ = cutoffs_of(cells)
    if wiring.connection == "series" and depth(wiring) == 1:
        pack = _string(models, positions, lower, drawn, start, celsius, settings)
    else:
        pack = _wired(wiring, models, lower, drawn, start, celsius, settings)
    use, items, spare_of, draws, window = pack
    plain = wiring.connection == "series" and depth(wiring) == 1
    first = "weakest cell" if plain else "busiest cell"
    capacity = [model["capacity_ampere_hour"] for model in models]
    names = [row.cell for row in positions]
    rows = [{"decision": "uncertainty"} | row for row in summary_rows(draws, names, first=first)]
    rows += replacement_rows(use, items, spare_of, capacity, names) + window
    return [EMPTY | row for row in rows]


def charged_soc(wiring, initial_soc, capacity_ampere_hour):
    """SoC of each cell of a pack that is charged, from a start, until its first is full (cells,).

    Cells in parallel come to one SoC; members in series keep what they are apart in charge.

    Parameters
    ----------
    wiring : Wiring. initial_soc, capacity_ampere_hour : (cells,) in the order of its leaves.

    Returns
    -------
    soc : (cells,) [1]; all 1 for cells in parallel alone.
    """
    # ASSUME: Cells in parallel rest at one SoC, whatever their OCVs differ by.
    soc, capacity = np.array(initial_soc, float), np.array(capacity_ampere_hour, float)
    if wiring.connection == "parallel":
        return np.ones(len(soc))
    sizes = [len(cells_of(member)) for member in wiring.members]
    parts = [np.arange(end - size, end) for size, end in zip(sizes, np.cumsum(sizes), strict=True)]
    level = [np.average(soc[part], weights=capacity[part]) for part in parts]
    whole = [capacity[part].sum() for part in parts]
    lacking = min((1.0 - z) * full for z, full in zip(level, whole, strict=True))
    charged = [z + lacking / full for z, full in zip(level, whole, strict=True)]
    return np.repeat(charged, sizes)


def _string(models, positions, lower, drawn, start, celsius, settings):
    """Use, items, spares of a string: items are columns of curves, k + cells is cell k in full."""
    capacity, cells = np.array([model["capacity_ampere_hour"] for model in models]), len(models)
    current = settings.c_rate * float(np.median(capacity))
    at = {"current_ampere": current, "celsius": celsius}
    twice = {
        "lower_cutoff_volt": np.tile(lower, 2),
        "initial_soc": np.append(start, np.ones(cells)),
    }
    curves = discharge_curves([*models, *models], **twice, **at)
    contact = contact_of(positions) * current

    def use(items):
        found = ended_string(curves.of(items), contact_volt=contact)
        return found.capacity_ampere_hour, found.energy_watt_hour

    draws = string_draws(models, drawn, lower_cutoff_volt=lower, initial_soc=start, **at)
    return use, list(range(cells)), lambda item: item + cells, draws, []


def _wired(wiring, models, lower, drawn, start, celsius, settings):
    """Use, items and spares of a pack with parallel cells: items are (index of tables, SoC)."""
    if len(models) > MOST_CELLS:
        raise Refusal(
            f"{wiring.name} is not decided on: found {len(models)} cells, wanted at most "
            f"{MOST_CELLS} where some are in parallel: each is replaced in a simulation of its own"
        )
    tables = pack_cells(models, temperature_celsius=celsius)
    share = network_of(wiring, tables.capacity_ampere_hour).share
    current = settings.group_c_rate * float((tables.capacity_ampere_hour / share).min())
    at = {"lower_cutoff_volt": lower, "current_ampere": current}

    def use(items):
        index, soc = zip(*items, strict=True)
        found = discharge_pack(cells_at(tables, index), wiring, initial_soc=np.array(soc), **at)
        return found.capacity_ampere_hour, found.energy_watt_hour

    draws = pack_draws(
        tables,
        wiring,
        drawn,
        initial_soc=start,
        wire_relative_std=settings.wire_relative_std,
        random_seed=settings.random_seed,
        **at,
    )
    nominal = discharge_pack(tables, wiring, initial_soc=start, **at)
    window = window_rows(nominal, settings.current_spread)
    items = list(enumerate(start))
    return use, items, lambda item: (item[0], 1.0), draws, window


def replacement_rows(use, items, spare_of, capacity, names):
    """Rows on which cell to replace: the gain of each cell, the best and its margin, and in turn.

    Parameters
    ----------
    use, items : as `cells` of `matching.replacements`. spare_of : function, item → the same cell as
        it is put in. capacity : (cells,) [Ah]. names : of the cells.
    """
    found = replacements(use, items, capacity_ampere_hour=capacity, spare_of=spare_of)
    about = {"decision": "replace a cell", "unit": "Wh"}
    rows = [
        about | {"quantity": "gain in usable energy", "cell": name, "value": float(gain)}
        for name, gain in zip(names, found.gain_watt_hour, strict=True)
    ]
    rows.sort(key=lambda row: -row["value"])
    spare = names[found.median]
    best = {"cell": names[found.best], "value": float(found.gain_watt_hour[found.best])}
    rows.insert(0, about | {"quantity": f"best, by one as {spare} (median)"} | best)
    margin = {"cell": names[found.best], "value": found.margin_watt_hour}
    rows.insert(1, about | {"quantity": "margin to the second best"} | margin)
    for turn, (k, charge, energy) in enumerate(found.in_turn, 1):
        done = {"cell": names[k], "quantity": f"after {turn} replaced in turn, usable"}
        rows.append(about | done | {"value": energy})
        rows.append(about | done | {"unit": "Ah", "value": charge})
    return rows


def window_rows(use, current_spread):
    """Rows on the range of SoC in which the branch currents stay within a spread.

    Parameters
    ----------
    use : PackUse. current_spread : [1].
    """
    window = safe_window(use, current_spread=current_spread)
    values = {
        "lowest SoC": window.lower_soc,
        "highest SoC": window.upper_soc,
        "share of the charge": window.charge_share,
        "largest spread within": window.spread,
        "largest spread of all": window.worst_spread,
        "SoC of the largest spread": window.worst_soc,
        "largest branch current over its share": use.peak_share,
        "charge given over the sum of the cells": use.capacity_ampere_hour / use.cells_ampere_hour,
    }
    about = {"decision": f"safe window, spread below {100 * current_spread:g} %", "cell": ""}
    return [
        about | {"quantity": quantity, "unit": "1", "value": float(value)}
        for quantity, value in values.items()
    ]
