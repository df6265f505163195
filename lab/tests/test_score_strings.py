"""Scores of series packs: which rows are compared, and that a wrong number shows."""

import pandas as pd
import pytest

from virtual_lab.score import files, strings

TRUTH = pd.DataFrame(
    {
        "cell": ["A", "B", "A", "B"],
        "test": ["c2", "c2", "fuds", "fuds"],
        "group": "pack",
        "position": [1, 2, 1, 2],
        "capacity_ampere_hour": [30.0, 22.0, 30.0, 22.0],
        "soc_at_end_of_discharge": [0.3, 0.02, 0.35, 0.1],
        "volt_at_end_of_discharge": [3.5, 3.0, 3.55, 3.3],
        "discharged_ampere_hour": [21.0, 21.0, 19.0, 19.0],
        "discharged_watt_hour": [150.0, 150.0, 140.0, 140.0],
    }
)


@pytest.fixture
def place(tmp_path):
    found = files.campaign(tmp_path)
    (found.results / "tables").mkdir(parents=True)
    found.truth.mkdir()
    TRUTH.to_csv(found.truth / "series_packs.csv", index=False)
    packs = pd.DataFrame(
        {"group": "pack", "test": ["c2", "fuds"], "measured_ended_by": ["B", ""]}
        | {"usable_ampere_hour": [21.2, 21.4], "usable_watt_hour": [151.0, 152.0]}
    )
    packs.to_csv(found.results / "tables" / "series_packs.csv", index=False)
    cells = TRUTH[["group", "test", "cell", "position"]].assign(
        capacity_ampere_hour=[30.1, 22.0, 30.1, 22.0],
        soc_at_pack_end=[0.31, 0.02, 0.2, 0.0],
        volt_at_pack_end=[3.51, 3.0, 3.4, 3.0],
    )
    cells.to_csv(found.results / "tables" / "series_pack_cells.csv", index=False)
    return found


def test_only_a_discharge_to_the_cut_off_is_compared_with_what_a_pack_gives(place):
    compared = strings.series_packs(place)
    assert set(compared["status"]) == {"compared"}
    charge = compared[compared["quantity"] == "usable_ampere_hour"]
    assert charge["test"].tolist() == ["c2"]
    assert charge["error"].tolist() == pytest.approx([0.2])
    ends = compared[compared["quantity"] == "volt_at_pack_end"]
    assert sorted(ends["test"].unique()) == ["c2"]
    assert sorted(ends["error"]) == pytest.approx([0.0, 0.01])
    assert len(compared[compared["quantity"] == "capacity_ampere_hour"]) == 4


def test_without_results_all_is_missing_and_without_truth_there_is_nothing(place):
    (place.results / "tables" / "series_pack_cells.csv").unlink()
    compared = strings.series_packs(place)
    of_cells = compared[compared["table"] == "series_pack_cells"]
    assert set(of_cells["status"]) == {"missing"}
    (place.truth / "series_packs.csv").unlink()
    assert not len(strings.series_packs(place))
