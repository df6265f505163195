"""What a cell shows of itself, from its artefacts."""

import numpy as np
import pytest

from cellwright.refusal import Refusal
from runtime import artefact, lending

PEAK = {
    "c_rate": 0.1,
    "peak": 1,
    "voltage_volt": 3.5,
    "voltage_std_volt": 0.001,
    "height_ampere_hour_per_volt": 4.0,
    "height_std_ampere_hour_per_volt": 0.02,
    "area_ampere_hour": 0.5,
    "area_std_ampere_hour": 0.01,
    "width_volt": 0.05,
    "width_std_volt": 0.001,
    "position_height_covariance_ampere_hour": 1e-6,
    "prominence": 0.5,
}


def pulse(ohm, delay=10.0, soc=0.99, direction="discharge"):
    return {
        "soc": soc,
        "direction": direction,
        "delay_second": delay,
        "actual_delay_second": delay,
        "resistance_ohm": ohm,
        "resistance_std_ohm": 1e-4,
        "current_ampere": -2.0,
        "c_rate": 1.0,
        "voltage_before_volt": 4.1,
        "start_time_second": 0.0,
    }


@pytest.fixture
def write(snakemake):
    def write(path, content):
        with artefact.Job(snakemake(path)) as job:
            if isinstance(content, str):
                raise Refusal(content)
            job.save(content)
        return path

    return write


def test_only_discharges_from_full_tell_the_onset(write):
    """Median of 0.03, 0.04 and 0.09 at 10 s; a charge or half charge does not count."""
    onset = [
        write("results/onset/A/a.parquet", [pulse(0.03), pulse(0.09), pulse(0.02, delay=0.0)]),
        write(
            "results/onset/A/b.parquet",
            [pulse(0.04), pulse(0.5, soc=0.5), pulse(9.0, direction="charge")],
        ),
        write("results/onset/A/c.parquet", "no pulse"),
    ]
    basis = write("results/basis/A.json", {"cell": "A", "capacity_ampere_hour": 2.0})
    peaks = [
        write("results/ica/A/t.parquet", [PEAK]),
        write("results/ica/A/u.parquet", "no charge"),
    ]
    model = write("results/identify/A.json", {"chosen": "1RC"})
    found = lending.cell_shows(basis, model, peaks, onset, ["A"])
    assert found.onset_ohm == {10.0: 0.04, 0.0: 0.02}
    assert found.peaks == [PEAK]
    assert (found.cell, found.marked, found.capacity_ampere_hour) == ("A", True, 2.0)
    assert found.model == {"chosen": "1RC"}


def test_a_cell_without_a_model_of_its_own(write):
    basis = write("results/basis/A.json", {"cell": "A", "capacity_ampere_hour": 2.0})
    assert lending.cell_shows(basis, None, [], [], []).model is None
    refused = write("results/identify/B.json", "no OCV curve")
    found = lending.cell_shows(basis, refused, [], [], ["B"])
    assert (found.model, found.marked, found.onset_ohm) == (None, False, {})
    assert np.array_equal(found.peaks, [])


def test_paths_of_each_peer_stay_together_and_peers_without_a_model_are_left_out(write):
    for cell in ("A", "AB"):
        write(f"results/identify/{cell}.json", {"chosen": "1RC"})
    write("results/identify/C.json", "no OCV curve")

    class Inputs:
        peer_basis = tuple(f"results/basis/{cell}.json" for cell in ("A", "C", "AB"))
        peer_models = tuple(f"results/identify/{cell}.json" for cell in ("A", "C", "AB"))
        peer_peaks = ("results/ica/AB/x.parquet", "results/ica/A/x.parquet")
        peer_onset = ("results/onset/AB/A.parquet",)

    first, second = lending.peer_paths(Inputs)
    assert first == (
        *[f"results/{s}/A.json" for s in ("basis", "identify")],
        ["results/ica/A/x.parquet"],
        [],
    )
    assert second[2:] == (["results/ica/AB/x.parquet"], ["results/onset/AB/A.parquet"])
