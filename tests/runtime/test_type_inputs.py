"""What a cell shows of itself, from its artefacts."""

import numpy as np
import pytest
from contract_rows import row_of

from runtime import type_inputs

PEAK = row_of("ica", c_rate=0.1)


def pulse(ohm, delay=10.0, soc=0.99, direction="discharge"):
    known = {"soc": soc, "direction": direction, "delay_second": delay, "resistance_ohm": ohm}
    return row_of("resistance", actual_delay_second=delay, **known)


FACTS = {"kind": "capacity", "ambient_temperature_celsius": 25.0, "cycle": None, "role": "fit"}
TEST = {"ambient_temperature_celsius": 25.0, "cycle": None}


CURVE = {name: [0.0, 1.0] for name in row_of("ica_curve")}
NOTHING = type_inputs.ShownPaths([], [], [], [])


@pytest.fixture
def write(saved):
    def write(path, content, cycle=None):
        return saved(path, content, {"test": FACTS | {"cycle": cycle}})

    return write


def test_only_discharges_from_full_tell_the_onset(write):
    """Median of 0.03, 0.04 and 0.09 at 10 s; a charge or half charge does not count there."""
    onset = [
        write(
            "results/stages/onset/A/a.parquet", [pulse(0.03), pulse(0.09), pulse(0.02, delay=0.0)]
        ),
        write(
            "results/stages/onset/A/b.parquet",
            [
                pulse(0.04),
                pulse(0.5, soc=0.5),
                pulse(9.0, direction="charge"),
                pulse(0.07, soc=0.02, direction="charge"),
            ],
        ),
        write("results/stages/onset/A/c.parquet", "no pulse"),
    ]
    basis = write("results/stages/basis/A.json", {"cell": "A", "capacity_ampere_hour": 2.0})
    peaks = [
        write("results/stages/ica/A/t.parquet", [PEAK]),
        write("results/stages/ica/A/u.parquet", "no charge"),
    ]
    curves = [write(f"results/stages/ica_curve/A/{name}.parquet", CURVE) for name in "tu"]
    model = write("results/stages/identify/A.json", {"chosen": "1RC"})
    paths = type_inputs.ShownPaths(peaks, curves, onset, [])
    found = type_inputs.cell_shows(basis, model, paths, ["A"])
    assert found.onset_ohm == {10.0: 0.04, 0.0: 0.02}
    assert found.begin_ohm == {10.0: 0.07}
    assert found.peaks == [{"test": "t", **TEST, **PEAK}]
    assert [charge["c_rate"] for charge in found.charges] == [0.1]
    assert found.charges[0]["charge_ampere_hour"].tolist() == [0.0, 1.0]
    assert (found.cell, found.marked, found.capacity_ampere_hour) == ("A", True, 2.0)
    assert found.model == {"chosen": "1RC"}


def test_a_cell_is_shown_as_at_its_first_check_up(write):
    """At cycle 300 its resistance had doubled: its model is of cycle 0."""
    onset = [
        write("results/stages/onset/A/old.parquet", [pulse(0.08)], cycle=300.0),
        write("results/stages/onset/A/new.parquet", [pulse(0.04)]),
    ]
    basis = write("results/stages/basis/A.json", {"cell": "A", "capacity_ampere_hour": 2.0})
    found = type_inputs.cell_shows(basis, None, NOTHING._replace(onset=onset), [])
    assert found.onset_ohm == {10.0: 0.04}


def test_a_cell_without_a_model_of_its_own(write):
    basis = write("results/stages/basis/A.json", {"cell": "A", "capacity_ampere_hour": 2.0})
    assert type_inputs.cell_shows(basis, None, NOTHING, []).model is None
    refused = write("results/stages/identify/B.json", "no OCV curve")
    found = type_inputs.cell_shows(basis, refused, NOTHING, ["B"])
    assert (found.model, found.marked, found.onset_ohm) == (None, False, {})
    assert np.array_equal(found.peaks, [])


def test_paths_of_each_peer_stay_together_and_peers_without_a_model_are_left_out(write):
    for cell in ("A", "AB"):
        write(f"results/stages/identify/{cell}.json", {"chosen": "1RC"})
    write("results/stages/identify/C.json", "no OCV curve")

    class Inputs:
        peer_basis = tuple(f"results/stages/basis/{cell}.json" for cell in ("A", "C", "AB"))
        peer_models = tuple(f"results/stages/identify/{cell}.json" for cell in ("A", "C", "AB"))
        peer_peaks = ("results/stages/ica/AB/x.parquet", "results/stages/ica/A/x.parquet")
        peer_onset = ("results/stages/onset/AB/A.parquet",)
        peer_curves = peer_capacity = ()

    first, second = type_inputs.peer_paths(Inputs)
    assert first[:2] == ("results/stages/basis/A.json", "results/stages/identify/A.json")
    assert first[2] == NOTHING._replace(peaks=["results/stages/ica/A/x.parquet"])
    of_second = {
        "peaks": ["results/stages/ica/AB/x.parquet"],
        "onset": ["results/stages/onset/AB/A.parquet"],
    }
    assert second[2] == NOTHING._replace(**of_second)


def test_cells_that_are_judged_have_a_model_in_use(write):
    """The model of J1 is in use; that of J2 could not be made, and J2 is left out."""
    for cell in ("J1", "J2"):
        write(f"results/stages/basis/{cell}.json", {"cell": cell, "capacity_ampere_hour": 2.0})
        write(f"results/stages/identify/{cell}.json", {"chosen": "1RC"})
    write("results/models/J1.json", {"chosen": "2RC"})
    write("results/models/J2.json", "no member")

    class Inputs:
        peer_basis = ("results/stages/basis/J1.json", "results/stages/basis/J2.json")
        peer_models = ("results/stages/identify/J1.json", "results/stages/identify/J2.json")
        peer_peaks = peer_curves = peer_onset = peer_capacity = series = ()
        own = ("results/models/J1.json", "results/models/J2.json")

    (found,) = type_inputs.judged_cells(Inputs, [], {name: {"cell": name} for name in ("J1", "J2")})
    assert (found.shown.model, found.own) == ({"chosen": "1RC"}, {"chosen": "2RC"})
    assert (found.facts.cell, found.tests) == ("J1", ())
