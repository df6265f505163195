"""Lenders from artefacts: whose curve, whose capacity, and the notes on both."""

import numpy as np
import pytest

from cellwright.api.charge import basis_notes
from cellwright.refusal import Refusal
from runtime import artefact, lending

SOC = np.linspace(0, 1, 5)
OCV = {"soc": SOC, "ocv_volt": 3 + SOC, "discharge_volt": 3 + SOC, "charge_volt": 3 + SOC}
OCV |= {"half_gap_volt": np.full(5, np.nan)}
ROW = {
    "direction": "discharge",
    "c_rate": 1.0,
    "capacity_ampere_hour": 1.9,
    "capacity_std_ampere_hour": np.nan,
    "energy_watt_hour": 7.0,
    "coulombic_efficiency": 0.999,
    "repeats": 1,
    "mean_current_ampere": -2.0,
    "temperature_mean_celsius": np.nan,
    "constant_current_ampere_hour": 1.9,
}
FACTS = {"ambient_temperature_celsius": 25.0, "cycle": 10, "kind": "ocv"}


@pytest.fixture
def paths(snakemake):
    """OCV and capacity artefacts of two cells; one of B's is empty for a reason."""
    plan = [("ocv", "A", "slow", OCV), ("ocv", "B", "slow", None), ("ocv", "B", "again", OCV)]
    plan += [("capacity", "A", "full", [ROW]), ("capacity", "B", "full", [ROW, ROW])]
    found = {"ocv": [], "capacity": []}
    for stage, cell, test, content in plan:
        path = f"results/{stage}/{cell}/{test}.parquet"
        with artefact.Job(
            snakemake(path, wildcards={"cell": cell, "test": test}, test=FACTS)
        ) as job:
            if content is None:
                raise Refusal("not slow")
            facts = {"capacity_ampere_hour": 2.0, "branches": "both"} if stage == "ocv" else {}
            job.save(content, **facts)
        found[stage].append(path)
    return found


def test_curves_are_plain_lists_with_their_facts(paths):
    (curve,) = lending.curves(paths["ocv"][:1])
    assert curve["ocv_volt"] == (3 + SOC).tolist()
    assert (curve["test"], curve["cycle"], curve["ambient_temperature_celsius"]) == (
        "slow",
        10,
        25.0,
    )
    assert (curve["capacity_ampere_hour"], curve["branches"]) == (2.0, "both")


def test_capacities_are_rows_with_their_facts(paths):
    rows = lending.capacities(paths["capacity"])
    assert len(rows) == 3
    assert (rows[0]["test"], rows[0]["cycle"], rows[0]["c_rate"]) == ("full", 10, 1.0)


def test_each_lender_has_its_own(paths):
    first, second = lending.lenders(paths["ocv"], paths["capacity"], ["B"])
    assert (first.cell, first.marked, len(first.curves), len(first.capacities)) == (
        "A",
        False,
        1,
        1,
    )
    assert (second.cell, second.marked, len(second.capacities)) == ("B", True, 2)
    assert [curve["test"] for curve in second.curves] == ["again"]
    assert lending.lenders([], [], []) == []


SLOW, RESTS = [{"test": "ocv", "branches": "both"}], [{"test": "hppc", "branches": "rests"}]


@pytest.mark.parametrize(
    ("borrowed", "ocv", "said"),
    [
        (None, SLOW, None),
        ("R", SLOW, "OCV borrowed from R"),
        (None, RESTS, "OCV from the rests of hppc"),
        (None, [], "no OCV"),
    ],
)
def test_what_is_borrowed_or_missing_is_said(borrowed, ocv, said):
    facts = {"capacity_ampere_hour": 1.98765, "capacity_source": "rating"}
    first, *rest = basis_notes(facts | {"borrowed_from": borrowed, "ocv": ocv})
    assert first == "SoC refers to 1.988 Ah: rating"
    assert len(rest) == (said is not None)
    assert all(sentence.startswith(said) for sentence in rest)
