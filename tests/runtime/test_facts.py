"""Facts of a job and of artefacts, typed as the science takes them."""

import pytest

from cellwright.records.facts import BranchFacts, CellFacts
from cellwright.refusal import Refusal
from runtime import artefact, facts

SHEET = {"kind": "drive", "ambient_temperature_celsius": 5.0, "cycle": 10, "soc": 0.9}
SHEET |= {"role": "split"}
CELL = {"cell": "A", "rated_capacity_ampere_hour": 2.0}
CELL |= {"lower_cutoff_volt": 3.0, "upper_cutoff_volt": None}


NUMBERS = ("c_rate", "capacity_ampere_hour", "capacity_std_ampere_hour", "energy_watt_hour")
NUMBERS += ("coulombic_efficiency", "mean_current_ampere", "temperature_mean_celsius")
NUMBERS += ("constant_current_ampere_hour",)


@pytest.fixture
def job(snakemake):
    def make(path, test):
        wildcards = {"cell": "A", "test": test}
        return snakemake(path, wildcards=wildcards, test=SHEET, cell=CELL)

    return make


def test_a_job_knows_its_test_and_its_cell(job):
    test, cell = facts.of_job(job("results/capacity/A/cold.parquet", "cold"))
    assert (test.test, test.kind, test.role) == ("cold", "drive", "split")
    assert (test.ambient_temperature_celsius, test.cycle, test.soc) == (5.0, 10, 0.9)
    assert cell == CellFacts("A", 2.0, 3.0, None)


def test_branches_are_typed_whatever_else_their_sheet_says():
    row = {"group": "pair", "position": 2, "cell": "B", "note": "left"}
    row |= {"wire_resistance_ohm": 0.01, "initial_soc": None}
    assert facts.branches([row]) == [BranchFacts(2, "B", 0.01, None)]


def test_tests_carry_the_facts_that_their_artefacts_were_made_with(job):
    """What is empty for a reason is no test; the columns are those of any series of an artefact."""
    row = dict.fromkeys(NUMBERS, 1.9) | {"direction": "discharge", "repeats": 1}
    paths = [f"results/capacity/A/{name}.parquet" for name in ("cold", "empty")]
    with artefact.Job(job(paths[0], "cold")) as made:
        made.save([row])
    with artefact.Job(job(paths[1], "empty")):
        raise Refusal("nothing in it")
    (test,) = facts.tests(paths)
    assert test.facts == facts.of_job(job(paths[0], "cold"))[0]
    assert test.series["capacity_ampere_hour"].tolist() == [1.9]


def test_tests_with_steps_pair_the_series_of_a_test_with_its_steps(job):
    """A test without one of the two is left out."""
    row = dict.fromkeys(NUMBERS, 1.9) | {"direction": "discharge", "repeats": 1}
    paths = [f"results/capacity/A/{name}.parquet" for name in ("cold", "empty")]
    with artefact.Job(job(paths[0], "cold")) as made:
        made.save([row])
    with artefact.Job(job(paths[1], "empty")):
        raise Refusal("nothing in it")
    ((test, series, steps),) = facts.tests_with_steps(paths, paths)
    assert (test.test, test.kind) == ("cold", "drive")
    assert series["capacity_ampere_hour"].tolist() == steps["capacity_ampere_hour"].tolist()
