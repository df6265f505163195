"""The score of a campaign: one line a quantity, with errors, coverage and what is missing."""

from typing import NamedTuple

import numpy as np
import pandas as pd

from virtual_lab.score import (
    comparison,
    curves,
    files,
    missing,
    modes,
    strings,
    tables,
    verdicts,
)
from virtual_lab.score.missing import COUNTED

# The contract's tables, and the quantities of each that could be scored.
QUANTITIES = {
    "capacity": ("capacity_ampere_hour", "energy_watt_hour", "coulombic_efficiency"),
    "resistance": ("resistance_ohm", "soc"),
    "ocv": ("ocv_volt", "rmse_volt"),
    "eis": ("r_ohmic_ohm", "r_charge_transfer_ohm", "cpe_t", "cpe_p", "warburg_y0"),
    "temperature": ("",),
    "temperature_prediction": ("",),
    "capacity_loss": ("",),
    "ica_temperature": ("",),
    "fast_charge": ("",),
    "ageing": ("",),
    "ica": ("voltage_volt", "height_ampere_hour_per_volt", "area_ampere_hour"),
    "ica_tracks": ("",),
    "health": (
        *("capacity_ampere_hour", "soh", "knee_cycle", "remaining_cycles"),
        *("lli", "lam_negative", "lam_positive"),
    ),
    **dict.fromkeys(("checkups", "resistance_growth", "fade", "fade_laws"), ("",)),
    **dict.fromkeys(("fleet_health", "fleet_health_lines", "protocols"), ("",)),
    "models": ("r0", "r_10s", "r_total"),
    "models_of_checkups": ("",),
    "choice": ("",),
    "soc": ("soc_begin", "soc_end", "capacity_ampere_hour"),
    "validation": ("rmse_volt",),
    "packs": ("group_capacity_ampere_hour", "charge_ampere_hour", "current_max_ampere"),
    "series_packs": ("usable_ampere_hour", "usable_watt_hour"),
    "series_pack_cells": ("capacity_ampere_hour", "soc_at_pack_end", "volt_at_pack_end"),
    **dict.fromkeys(("pack_findings", "pack_spread", "pack_checks", "nested_packs"), ("",)),
    **dict.fromkeys(("pack_decisions", "thermal", "bias"), ("",)),
    "missing_effect": ("",),
    "excluded": ("",),
    **dict.fromkeys(("resistance_definitions", "activation_energies"), ("",)),
    **dict.fromkeys(("capacity_between_rests", "relaxation", "ica_discharge"), ("",)),
    "faults": ("",),
}
TRUTH_OF = {"series_pack_cells": "series_packs"}  # where a table's truth has another name
COLUMNS = [
    *("table", "quantity", "unit", "state", "n_compared", "n_missing", "n_extra", "n_spoiled"),
    *("n_untested", "n_no_truth"),
    *("bias", "rms_error", "relative_rms", "n_interval", "coverage_95", "coverage_low"),
    *("coverage_high", "share", "share_low", "share_high"),
    *("worst_cell", "worst_test", "worst_at", "worst_error"),
]


def summarise(place: files.Campaign, compared: pd.DataFrame, judged: pd.DataFrame) -> pd.DataFrame:
    """One row a quantity, for all tables of the contract."""
    rows = []
    for table, quantities in QUANTITIES.items():
        state = _state(place, table)
        mine = compared[compared["table"] == table].groupby(["quantity", "unit"], sort=False)
        table_rows = [_row(table, *names, state, part) for names, part in mine]
        if table == "missing_effect":
            table_rows = [*_shares(judged, state), *table_rows]
        scored = [row["quantity"] for row in table_rows]
        unscored = [name for name in quantities if not any(one.startswith(name) for one in scored)]
        without = "no truth" if state == "scored" else state
        rows += [
            *table_rows,
            *({"table": table, "quantity": name, "state": without} for name in unscored),
        ]
    return pd.DataFrame(rows, columns=COLUMNS)


def _state(place, table) -> str:
    """Whether the pipeline has made a table, and whether its truth is known, in words."""
    if table == "missing_effect":
        made = (place.results / table).is_dir()
        has_truth = bool(verdicts.hidden_effects(place))
    else:
        flags = (place.results / "stages" / "flags").is_dir()
        made = flags if table == "faults" else files.found(place, table) is not None
        has_truth = files.true(place, TRUTH_OF.get(table, table)) is not None
    if made and has_truth:
        return "scored"
    if has_truth:
        return "not made by the pipeline yet"
    return "no truth" if made else "no truth, and not made by the pipeline yet"


def _row(table, quantity, unit, state, part) -> dict:
    """Row of the summary: one quantity."""
    counts = part["status"].value_counts()
    row = {"table": table, "quantity": quantity, "unit": unit, "state": state}
    names = ("compared", "missing", "extra", "spoiled", "untested", "no truth")
    row |= {f"n_{name.replace(' ', '_')}": int(counts.get(name, 0)) for name in names}
    if row["n_no_truth"] == len(part):
        return row | {"state": "no truth"}
    if unit == COUNTED:
        return row | _share(row["n_compared"], row["n_compared"] + row["n_missing"])
    return row | _errors(part[part["status"] == "compared"])


def _errors(part) -> dict:
    """Bias, RMS error, coverage and the worst of the compared rows."""
    if not len(part):
        return {}
    error, true = (part[name].to_numpy(float) for name in ("error", "true"))
    # Shares and states of charge are relative already.
    relative = np.zeros(0) if part["unit"].iloc[0] == "1" else error[true != 0] / true[true != 0]
    worst = part.iloc[int(np.argmax(np.abs(error)))]
    inside = part["inside_95"].dropna().astype(bool)
    low, high = wilson(int(inside.sum()), len(inside))
    return {
        "bias": error.mean(),
        "rms_error": rms(error),
        "relative_rms": rms(relative) if len(relative) else np.nan,
        "n_interval": len(inside),
        "coverage_95": inside.mean() if len(inside) else np.nan,
        "coverage_low": low,
        "coverage_high": high,
        **{f"worst_{name}": worst[name] for name in ("cell", "test", "at", "error")},
    }


def _shares(judged, state) -> list[dict]:
    """Rows of the summary: shares of verdicts by their outcome, and closed gaps."""
    row = {"table": "missing_effect", "unit": COUNTED, "state": state}
    given = int(judged["verdict"].notna().sum())
    rates = [("verdict given", given, len(judged)), *verdicts.rates(judged)]
    counts = [
        {**row, "quantity": name, "n_compared": of, **_share(hits, of)}
        for name, hits, of in rates
        if of
    ]
    gaps = [
        {**row, "quantity": name, "n_compared": of, "share": value}
        for name, value, of in verdicts.gaps(judged)
    ]
    return [*counts, *gaps]


def _share(hits, of) -> dict:
    low, high = wilson(hits, of)
    return {"share": hits / of if of else np.nan, "share_low": low, "share_high": high}


def rms(values) -> float:
    """Root mean square of an array."""
    return float(np.sqrt(np.mean(np.square(values))))


def wilson(hits: int, of: int) -> tuple[float, float]:
    """95 % interval of a share (E. B. Wilson, J. Am. Stat. Assoc. 22, 1927, 209)."""
    if not of:
        return np.nan, np.nan
    z, share = comparison.NORMAL_95, hits / of
    middle = share + z**2 / (2 * of)
    half = z * np.sqrt(share * (1 - share) / of + z**2 / (4 * of**2))
    low, high = ((middle + side * half) / (1 + z**2 / of) for side in (-1, 1))
    return max(float(low), 0.0), min(float(high), 1.0)


class Score(NamedTuple):
    """Tables of a score: errors (one row a comparison), summary (a quantity), verdicts (a cell)."""

    errors: pd.DataFrame
    summary: pd.DataFrame
    verdicts: pd.DataFrame


def score(place: files.Campaign) -> Score:
    """Compare all tables of a campaign's results with its truth."""
    parts = [tables.compare(place, name) for name in tables.SPECS]
    parts += [curves.ocv(place), curves.circuits(place), curves.soc(place), curves.packs(place)]
    parts += [
        strings.series_packs(place),
        modes.compare(place),
        verdicts.parameters(place),
        missing.refused_files(place),
        missing.flagged_samples(place),
    ]
    compared = missing.mark(place, comparison.gathered(parts))
    judged = verdicts.compare(place)
    return Score(compared, summarise(place, compared, judged), judged)
