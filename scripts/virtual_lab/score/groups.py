"""Shares of parallel cells beside the truth."""

import numpy as np
import pandas as pd

from virtual_lab.score import comparison, files
from virtual_lab.score.comparison import errors

KEYS = ["group", "test", "branch"]
UNITS = {"group_capacity_ampere_hour": "Ah", "charge_ampere_hour": "Ah", "current_max_ampere": "A"}
LEAST_SHARE = 0.02


def compare(place: files.Campaign) -> pd.DataFrame:
    """Each branch as simulated: charge given in all discharges together, and largest current.

    Beside them the group's capacity, its largest discharge, as counted in the record.
    """
    true = files.true(place, "packs")
    if true is None or not len(true):
        return comparison.nothing()
    shares = pd.concat([_shares(place, *test) for test in _tests(true)], ignore_index=True)
    options = {"keys": KEYS, "columns": list(UNITS)}
    rows = comparison.side_by_side(shares, true, **options)
    rows = rows.assign(cell=rows["group"], at=[f"branch {number}" for number in rows["branch"]])
    wanted = [name for name in UNITS if name in true and true[name].notna().any()]
    return comparison.gathered(_quantity(rows, name) for name in wanted)


def _tests(true):
    return true[["group", "test"]].drop_duplicates().itertuples(index=False)


def _quantity(rows, name):
    rows = rows.rename(columns={name: "true", f"{name}_found": "found"})
    if name != "group_capacity_ampere_hour":
        return errors("packs", name, UNITS[name], rows)
    # The group has one, whatever its branch.
    rows = rows.drop_duplicates(["group", "test"]).assign(at="the group")
    return errors("packs", name, UNITS[name], rows)


def _shares(place, group, test) -> pd.DataFrame:
    """What each branch of a test was found to have done; no rows without a simulation."""
    series = files.artefact(place, "pack_series", group, test)
    if series is None:
        return pd.DataFrame(columns=[*KEYS, *UNITS])
    hour = series["test_time_second"].to_numpy(float) / 3600
    total = counted(hour, series["current_ampere"].to_numpy(float))
    runs = discharges(total, least=LEAST_SHARE * np.ptp(total))
    given = [total[first] - total[last] for first, last in runs]
    rows, branch = [], 1
    while (name := f"simulated_branch_{branch}_current_ampere") in series:
        ampere = series[name].to_numpy(float)
        flowed = counted(hour, ampere)
        row = {"group": group, "test": test, "branch": branch}
        row |= {"group_capacity_ampere_hour": max(given, default=np.nan)}
        row |= {"charge_ampere_hour": sum(flowed[first] - flowed[last] for first, last in runs)}
        rows.append(row | {"current_max_ampere": np.nanmax(np.abs(ampere))})
        branch += 1
    return pd.DataFrame(rows)


def counted(hour, ampere) -> np.ndarray:
    """Charge [Ah] that has flowed since the first sample; times [h], currents [A], all (n,)."""
    steps = 0.5 * (ampere[1:] + ampere[:-1]) * np.diff(hour)
    return np.concatenate([[0.0], np.cumsum(steps)])


def discharges(charge, *, least) -> list[tuple[int, int]]:
    """First and last sample of each stretch in which the charge falls.

    Parameters
    ----------
    charge : flowed in since the first sample [Ah], shape (n,).
    least : a rise or fall [Ah] that is smaller belongs to the stretch around it (recuperation).
    """
    runs, high, low, falls = [], 0, 0, False
    for now, flowed in enumerate(charge):
        if falls and flowed < charge[low]:
            low = now
        elif falls and flowed > charge[low] + least:
            runs, high, falls = [*runs, (high, low)], now, False
        elif not falls and flowed >= charge[high]:
            high = now
        elif not falls and flowed < charge[high] - least:
            low, falls = now, True
    return [*runs, (high, low)] if falls else runs
