"""The part of a cell's page on using its model: what each export holds, and how to run it."""

import json
from pathlib import Path

from runtime import artefact
from runtime.page_tables import Cell, measured, plain_table

READ = (
    "Each file holds the model in use, or the best that it can hold; errors are RMS over the tests "
    "that took no part in the fit. Paths are those of the campaign's folder."
)
COLUMNS = ["for", "file", "holds", "to run it"]
PYTHON = """import cellwright as cw  # in ./run python
drive = {{"test_time_second": [0.0, 600.0], "current_ampere": [{ampere:g}, {ampere:g}]}}
cw.simulate("results/models/{cell}.json", drive, initial_soc=0.9).to_frame()"""
PYBAMM = """import pybamm
from thevenin import load, thevenin  # results/models/thevenin.py, copied beside your script
model, values = thevenin(load("results/models/{cell}/pybamm_thevenin.json", celsius={celsius:g}))
values.update({{"Initial SoC": 0.9, "Current function [A]": {discharge:g}}})  # of discharge
solution = pybamm.Simulation(model, parameter_values=values).solve([0, 600])"""
LOOKUP = """import pandas as pd
pd.read_csv("results/models/{cell}/lookup.csv").query("not extrapolated")"""
UNIT = """./run snakemake --cores 2 results/models/{cell}.fmu
fmpy simulate results/models/{cell}.fmu"""


def table(cell, rated_ampere_hour, lookup, pybamm):
    """The table of exports of a cell; None without a model.

    Parameters
    ----------
    cell : its name. rated_ampere_hour : by which the example's current is half of 1C [Ah].
    lookup, pybamm : paths of its look-up table and of its tables for PyBaMM.
    """
    document = json.loads(Path(pybamm).read_text(encoding="utf-8"))
    if not document.get("members"):
        return None
    rows = artefact.load_table(lookup)
    chosen = document["chosen"]
    errors = {one["model"]: one["validation_rmse_volt"] for one in document["members"]}
    errors |= document["refused_validation_rmse_volt"]
    celsius = document["members"][0]["tables"][0]["temperature_celsius"]
    ampere = -(rated_ampere_hour or 1.0) / 2
    said = {"cell": cell, "ampere": ampere, "discharge": -ampere, "celsius": celsius}
    lines = [
        ["Python", f"results/models/{cell}.json", _held(chosen, chosen, errors), PYTHON],
        ["FMI 3.0 masters", f"results/models/{cell}.fmu", _held(chosen, chosen, errors), UNIT],
    ]
    if document["exported"] is not None and celsius is not None:
        held = _held(document["exported"], chosen, errors)
        why = document["refused"].get(chosen, "")
        file = f"results/models/{cell}/pybamm_thevenin.json"
        lines.insert(1, ["PyBaMM", file, f"{held}. {why}".rstrip(". ") + ".", PYBAMM])
    if rows:
        held = _held(rows[0]["model"], chosen, errors)
        lines.append(
            ["Simulink and other tables", f"results/models/{cell}/lookup.csv", held, LOOKUP]
        )
    lines = [[*what, Cell(how.format(**said), mark="code")] for *what, how in lines]
    made = f"results/models/{cell}/lookup.csv"
    return plain_table("use", "Use this model", READ, COLUMNS, lines, made=made)


def _held(member, chosen, errors) -> str:
    """A member and its error, beside those of the model in use where it is another."""
    size = f"{member}, {_millivolt(errors.get(member))}"
    if member == chosen:
        return size
    return f"{size}; the model in use, {chosen}, {_millivolt(errors.get(chosen))}"


def _millivolt(volt) -> str:
    return "not validated" if volt is None else f"{measured(volt, None, 1e3, 3)} mV"
