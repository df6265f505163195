"""Methods compared on a campaign that the pipeline has run: the table, the figure, refusals."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import tiny

from cellwright.refusal import Refusal
from pulse_methods import of_campaign
from pulse_methods.comparison import METHODS

ROOT = Path(__file__).resolve().parents[3]
STAGES = ("results/stages/basis/A.json", "results/stages/segment/A/hppc.parquet")


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A campaign of which A, the cell with pulses, was run as far as the comparison needs it."""
    folder = tiny.write(tmp_path_factory.mktemp("run") / "tiny")
    start = [sys.executable, "-m", "snakemake", "--snakefile", ROOT / "Snakefile", "--cores", "1"]
    environment = {k: v for k, v in os.environ.items() if k != "SNAKEMAKE_PROFILE"}
    said = subprocess.run(
        [*start, "--directory", folder, *STAGES], env=environment, capture_output=True, text=True
    )
    assert said.returncode == 0, said.stderr[-4000:]
    return folder


def test_each_method_tells_the_resistance_that_the_cell_has(finished):
    """The one pair of the truth is told whatever the method."""
    of_campaign.compare_campaign(finished)
    rows = pd.read_csv(finished / "results/methods/identification_methods.csv")
    cell = tiny.TRUTH["A"]
    moved = (tiny.ocv(0.55) - tiny.ocv(0.45)) / 0.1 * 10 / 3600 / cell.capacity_ampere_hour
    grown = tiny.R1_OHM * -np.expm1(-10 / tiny.TAU_SECOND)
    assert {*zip(rows["cell"], rows["test"], strict=True)} == {("A", "hppc")}
    assert {*rows["method"]} == {*METHODS}
    for _, mine in rows.groupby("method"):
        assert len(mine) == 9
        told = mine[mine["r0_ohm"].notna()]
        assert len(told) >= 5 or mine["reason"].notna().all()
        end = told["pulse_resistance_ohm"].median()
        assert end == pytest.approx(cell.r0_ohm + grown + moved, rel=0.03)
    fitted = rows.loc[rows["method"] == "separable", "r0_ohm"]
    assert fitted.median() == pytest.approx(cell.r0_ohm, rel=0.02)
    assert "separable least squares" in (finished / "results/methods/A.svg").read_text()


def test_a_campaign_that_was_not_run_or_has_no_pulses_is_named(tmp_path):
    folder = tiny.write(tmp_path / "tiny")
    with pytest.raises(FileNotFoundError, match=r"clean/A/hppc.parquet: there is no such file"):
        of_campaign.compare_campaign(folder)
    sheet = folder / "config/tests.tsv"
    sheet.write_text(sheet.read_text().replace("\thppc\traw", "\trelaxation\traw"))
    with pytest.raises(Refusal, match="no test of kind hppc or pulse_resistance with role fit"):
        of_campaign.compare_campaign(folder)
