"""Tests of artefacts with the facts of the sheet, typed as the science takes them."""

from contract_rows import row_of

import cellwright as cw
from runtime import job_inputs

SHEET = {"kind": "drive", "ambient_temperature_celsius": 5.0, "cycle": 10, "soc": 0.9}
SHEET |= {"role": "split"}
ROW = row_of("capacity", direction="discharge", capacity_ampere_hour=1.9)


def test_tests_carry_the_facts_that_their_artefacts_were_made_with(saved):
    """What is empty for a reason is no test, and has neither rows nor steps."""
    cold = saved("results/stages/capacity/A/cold.parquet", [ROW], {"test": SHEET})
    paths = [
        cold,
        saved("results/stages/capacity/A/empty.parquet", "no discharge", {"test": SHEET}),
    ]
    (test,) = job_inputs.tests(paths)
    assert test.facts == cw.TestFacts("cold", **SHEET)
    assert test.series["capacity_ampere_hour"].tolist() == [1.9]
    ((found, series, steps),) = job_inputs.tests_with_steps(paths, paths)
    assert (found.test, found.kind) == ("cold", "drive")
    assert series["capacity_ampere_hour"].tolist() == steps["capacity_ampere_hour"].tolist()
    assert job_inputs.rows_of_tests(paths) == [{"cell": "A", "test": "cold"} | SHEET | ROW]
