"""Peaks gathered from artefacts: check-ups with and without peaks, records that count on."""

import numpy as np
import pytest

from cellwright.refusal import Refusal
from runtime import artefact, contract, peaks

FACTS = {"kind": "ica", "ambient_temperature_celsius": 25.0, "cycle": None, "soc": None}
CURVE = {name: np.array([1.0, 2.0]) for name in contract.stages()["ica_curve"]["columns"]}
PEAK = dict.fromkeys(contract.stages()["ica"]["columns"], 1.0)


@pytest.fixture
def saved(snakemake):
    """Artefacts of three charges: with a peak, without, and one that has no curve."""

    def save(stage, test, content, **facts):
        path = f"results/{stage}/A/{test}.parquet"
        with artefact.Job(snakemake(path, wildcards={"cell": "A", "test": test})) as job:
            if isinstance(content, str):
                raise Refusal(content)
            job.save(content, **facts)
        return path

    return save


def test_a_charge_without_peaks_counts_and_one_without_a_curve_does_not(saved):
    charges = {"one": [PEAK], "flat": "no peaks: flat", "bad": "12 rows of charge are too few"}
    paths = [saved("ica", test, content) for test, content in charges.items()]
    curves = [saved("ica_curve", test, CURVE, c_rate=0.5) for test in ("one", "flat")]
    curves.append(saved("ica_curve", "bad", "12 rows of charge are too few"))
    tests = {f"A/{test}": FACTS | {"cycle": k * 100} for k, test in enumerate(charges)}
    found = peaks.of_check_ups(paths, curves, tests)
    assert [(c.test, c.cycle, c.c_rate, c.reason) for c in found] == [
        ("one", 0.0, 0.5, ""),
        ("flat", 100.0, 0.5, "no peaks: flat"),
    ]
    assert found[1].peaks == {}


def test_records_without_a_stated_cycle_count_on(saved):
    row = dict.fromkeys(contract.stages()["ica_life"]["columns"], 1.0) | {"reason": ""}
    rows = [row | {"cycle": 1.0}, row | {"cycle": 9.0, "peak": 0, "reason": "no peaks: flat"}]
    paths = [saved("ica_life", test, rows) for test in ("first", "second")]
    tests = {f"A/{test}": FACTS for test in ("first", "second")}
    found = peaks.of_lives(paths, tests)
    assert [charge.cycle for charge in found] == [1.0, 9.0, 10.0, 18.0]
    assert [bool(charge.peaks) for charge in found] == [True, False, True, False]
