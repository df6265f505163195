"""Numbers of models, filters and packs: their errors on tests that took no part in a fit."""

import numpy as np
import pandas as pd

from real_cells import reading
from real_cells.words import celsius, where

MILLI, PERCENT = 1e3, 1e2
ERROR = "rmse_volt_soc_5_95"
COUNTING = "coulomb"  # keeps the error of its start: says nothing about the pipeline


def validations(campaign):
    """Error [mV] of the chosen member and of the best in the table, per cell and temperature.

    Between 5 and 95 % SoC: root mean square over the tests, and the worst test. The best member is
    the one with the lowest root mean square at this temperature, of those that have all tests.
    """
    rows = reading.table(campaign, "validation")
    rows = rows[rows[ERROR].notna()]
    keys = ["cell", "ambient_temperature_celsius"]
    for (cell, temperature), group in rows.groupby(keys, dropna=False):
        place, members = celsius(temperature), group.groupby("model")[ERROR]
        complete = members.count() == members.count().max()
        over_tests = members.agg(lambda error: np.sqrt(np.mean(error**2)))[complete]
        best, least = over_tests.idxmin(), over_tests.min()
        chosen = group[group["chosen"].astype(str) == "True"]
        if len(chosen):
            error = np.sqrt(np.mean(chosen[ERROR] ** 2))
            worst = where(place, "worst test")
            yield cell, "chosen member", place, chosen["model"].iloc[0]
            yield cell, "error of the chosen member", place, MILLI * error
            yield cell, "error of the chosen member", worst, MILLI * chosen[ERROR].max()
            yield cell, "error of the chosen member over the best member's", place, error / least
        yield cell, "best member", place, best
        yield cell, "error of the best member", place, MILLI * least


def filters(campaign):
    """Error [% of SoC] of each filter from wrong starts, per cell and temperature: median, worst.

    And the median over the runs with a fault in a sensor or in the capacity.
    """
    rows = reading.table(campaign, "soc")
    rows = rows[rows["rmse_soc"].notna() & (rows["filter"] != COUNTING)]
    nominal = rows["scenario"] == "nominal"
    keys = ["cell", "ambient_temperature_celsius", "filter"]
    for (cell, temperature, name), group in rows[nominal].groupby(keys, dropna=False):
        for word, value in (
            ("median", group["rmse_soc"].median()),
            ("worst", max(group["rmse_soc"])),
        ):
            place = where(celsius(temperature), name, word)
            yield cell, "error of a filter's SoC", place, PERCENT * value
    for (cell, name), group in rows[~nominal].groupby(["cell", "filter"]):
        value = PERCENT * group["rmse_soc"].median()
        yield cell, "error of a filter's SoC, with a fault", where(name, "median"), value


def capacities_of_filters(campaign):
    """Error [%] of the capacity that the dual filter tells, against the basis, per cell."""
    rows = reading.table(campaign, "soc")
    rows = rows[(rows["filter"] == "dual") & (rows["scenario"] == "nominal")]
    basis = reading.documents(campaign, "basis/*.json")
    known = {cell: document["capacity_ampere_hour"] for cell, document in basis.items()}
    rows = rows.assign(basis=rows["cell"].map(known).astype(float))
    error = (rows["capacity_ampere_hour"] / rows["basis"] - 1).abs()
    for cell, part in error.dropna().groupby(rows["cell"]):
        yield cell, "error of the dual filter's capacity", "median", PERCENT * part.median()
        yield cell, "error of the dual filter's capacity", "worst", PERCENT * part.max()


def packs(campaign):
    """Errors of branch currents [mA] and voltage [mV] of each group's tests; capacities [Ah]."""
    rows = reading.table(campaign, "packs")
    for row in rows.to_dict("records"):
        place = where(row["test"], f"branch {row['branch']:g}")
        yield row["cell"], "error of the branch current", place, MILLI * row["current_rmse_ampere"]
        yield row["cell"], "capacity inside the group", place, row["capacity_ampere_hour"]
    for (group, test), part in rows.groupby(["group", "test"]):
        yield group, "error of the group's voltage", test, MILLI * part["voltage_rmse_volt"].max()


def resistances_in_groups(campaign):
    """Direct-current resistance [mohm] of the models of cells in groups, mean over SoC."""
    members = set(reading.table(campaign, "packs")["cell"])
    rows = reading.table(campaign, "models")
    rows = rows[rows["cell"].isin(members) & rows["parameter"].str.fullmatch(r"r\d+")]
    keys = ["cell", "ambient_temperature_celsius"]
    for (cell, temperature), group in rows.groupby(keys, dropna=False):
        total = group.groupby("soc")["value"].sum()
        value = MILLI * float(pd.Series(total).mean())
        yield cell, "resistance of the model, mean over SoC", celsius(temperature), value
