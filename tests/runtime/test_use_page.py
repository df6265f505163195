"""What a cell's page says of using its model."""

import json

import pytest

from runtime import use_page


@pytest.fixture
def exported(tmp_path):
    """Paths of a look-up table and of tables for PyBaMM, none of which holds the model in use."""

    def write(**changes):
        lookup, pybamm = tmp_path / "lookup.csv", tmp_path / "pybamm_thevenin.json"
        lookup.write_text("model,chosen\n2RC,DRT+D\n")
        member = {"model": "DRT", "validation_rmse_volt": 0.0052}
        member["tables"] = [{"temperature_celsius": 25.0}]
        document = {"chosen": "DRT+D", "exported": "DRT", "members": [member]}
        document |= {"refused": {"DRT+D": "it cannot run diffusion"}}
        document |= {"refused_validation_rmse_volt": {"DRT+D": 0.0034, "2RC": None}}
        pybamm.write_text(json.dumps(document | changes))
        return lookup, pybamm

    return write


def test_each_export_says_what_it_holds_and_what_that_costs(exported):
    rows = use_page.table("C3", 5.0, *exported()).rows
    holds = {row[0].text: row[2].text for row in rows}
    in_use = "the model in use, DRT+D, 3.4 mV"
    assert holds["Python"] == holds["FMI 3.0 masters"] == "DRT+D, 3.4 mV"
    assert holds["PyBaMM"] == f"DRT, 5.2 mV; {in_use}. it cannot run diffusion."
    assert holds["Simulink and other tables"] == f"2RC, not validated; {in_use}"
    assert '"current_ampere": [-2.5, -2.5]' in rows[0][3].text
    for row in rows[:2]:  # lines of Python and of PyBaMM are whole programs
        names = set(compile(row[3].text, "page", "exec").co_names)
        assert {"simulate"} <= names or {"pybamm", "Simulation", "solve"} <= names
