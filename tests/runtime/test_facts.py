"""Tests of artefacts with the facts of the sheet, typed as the science takes them."""

import pytest

import cellwright as cw
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


def test_tests_carry_the_facts_that_their_artefacts_were_made_with(job):
    """What is empty for a reason is no test; the columns are those of any series of an artefact."""
    row = dict.fromkeys(NUMBERS, 1.9) | {"direction": "discharge", "repeats": 1}
    paths = [f"results/capacity/A/{name}.parquet" for name in ("cold", "empty")]
    with artefact.Job(job(paths[0], "cold")) as made:
        made.save([row])
    with artefact.Job(job(paths[1], "empty")):
        raise Refusal("nothing in it")
    (test,) = facts.tests(paths)
    assert test.facts == cw.TestFacts("cold", **SHEET)
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


def test_rows_of_tests_carry_the_facts_of_their_tests_and_empty_ones_none(job):
    path, refused = (f"results/capacity/A/{test}.parquet" for test in ("one", "two"))
    row = dict.fromkeys(NUMBERS, 1.0) | {"direction": "discharge", "repeats": 1}
    with artefact.Job(job(path, "one")) as work:
        work.save([row])
    with artefact.Job(job(refused, "two")):
        raise Refusal("no complete discharge")
    (found,) = facts.rows_of_tests([path, refused])
    assert found == {"cell": "A", "test": "one"} | SHEET | row
