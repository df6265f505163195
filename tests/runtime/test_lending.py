"""Lenders from artefacts: whose curve, whose capacity, and the notes on both."""

import numpy as np
import pytest
from contract_rows import row_of

from cellwright.records.checkups import basis_in_words
from runtime import job_inputs

SOC = np.linspace(0, 1, 5)
OCV = {"soc": SOC, "ocv_volt": 3 + SOC, "discharge_volt": 3 + SOC, "charge_volt": 3 + SOC}
OCV |= {"half_gap_volt": np.full(5, np.nan)}
ROW = row_of("capacity", direction="discharge", repeats=1)
FACTS = {"ambient_temperature_celsius": 25.0, "cycle": 10, "kind": "ocv"}


@pytest.fixture
def paths(saved):
    """OCV and capacity artefacts of two cells; one of B's is empty for a reason."""
    whole = {"capacity_ampere_hour": 2.0, "branches": "both"}
    plan = {
        "ocv/A/slow": (OCV, whole),
        "ocv/B/slow": ("not slow", {}),
        "ocv/B/again": (OCV, whole),
        "capacity/A/full": ([ROW], {}),
        "capacity/B/full": ([ROW, ROW], {}),
    }
    found = {"ocv": [], "capacity": []}
    for name, (content, facts) in plan.items():
        path = saved(f"results/{name}.parquet", content, {"test": FACTS}, **facts)
        found[name.partition("/")[0]].append(path)
    return found


def test_curves_are_plain_lists_with_their_facts(paths):
    (curve,) = job_inputs.curves(paths["ocv"][:1])
    facts = {"test": "slow", "cycle": 10, "ambient_temperature_celsius": 25.0}
    facts |= {"capacity_ampere_hour": 2.0, "branches": "both", "ocv_volt": (3 + SOC).tolist()}
    assert facts.items() <= curve.items()


def test_capacities_are_rows_with_their_facts(paths):
    rows = job_inputs.capacities(paths["capacity"])
    assert len(rows) == 3
    assert (rows[0]["test"], rows[0]["cycle"], rows[0]["c_rate"]) == ("full", 10, 1.0)


def test_each_lender_has_its_own(paths):
    first, second = job_inputs.lenders(paths["ocv"], paths["capacity"], ["B"])
    assert (first.cell, first.marked) == ("A", False)
    assert (len(first.curves), len(first.capacities)) == (1, 1)
    assert (second.cell, second.marked, len(second.capacities)) == ("B", True, 2)
    assert [curve["test"] for curve in second.curves] == ["again"]
    assert job_inputs.lenders([], [], []) == []


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
    first, *rest = basis_in_words(facts | {"borrowed_from": borrowed, "ocv": ocv})
    assert first == "SoC refers to 1.988 Ah: rating"
    assert len(rest) == (said is not None)
    assert all(sentence.startswith(said) for sentence in rest)
