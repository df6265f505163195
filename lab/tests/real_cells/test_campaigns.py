"""Campaigns of real cells: which there are, how they are copied, what a failed run says."""

import pytest

from real_cells import campaigns


@pytest.fixture
def campaign(tmp_path):
    """A campaign in a folder of campaigns, with results of an earlier run."""
    folder = tmp_path / "made_up"
    (folder / "results").mkdir(parents=True)
    (folder / "results/summary.csv").write_text("cell\nA\n")
    (folder / "config").mkdir()
    (folder / "config/tests.tsv").write_text("cell\ttest\nA\tslow\n")
    return folder


def test_a_campaign_is_copied_and_what_is_gone_there_goes_here(campaign, tmp_path):
    target = tmp_path / "real" / "made_up"
    (campaign / "raw").mkdir()
    (campaign / "raw/a.csv").write_text("1")
    (campaign / "raw/b.csv").write_text("2")
    campaigns.copy_campaign(campaign, target)
    assert (target / "raw/b.csv").read_text() == "2"
    assert not (target / "results").exists()
    (target / "results").mkdir()
    (campaign / "raw/a.csv").unlink()
    campaigns.copy_campaign(campaign, target)
    assert [path.name for path in (target / "raw").iterdir()] == ["b.csv"]
    assert (target / "results").is_dir()


def test_campaigns_that_are_not_there_are_named(campaign, tmp_path):
    assert campaigns.wanted(tmp_path, []) == ["made_up"]
    with pytest.raises(FileNotFoundError, match="found no a124, wanted one of"):
        campaigns.wanted(tmp_path, ["a124"])
    with pytest.raises(FileNotFoundError, match=r"real=\{folder: "):
        campaigns.wanted(tmp_path / "nowhere", [])


def test_what_is_not_chosen_has_its_default_and_what_is_mistyped_is_named():
    assert campaigns.options({}) == campaigns.OPTIONS
    chosen = campaigns.options({"names": ["weng"], "to": "tables"})
    assert chosen == {"folder": "../shared/campaigns", "names": ["weng"], "to": "tables"}
    with pytest.raises(ValueError, match="found option name, wanted one of folder, names, to"):
        campaigns.options({"name": ["weng"]})
    with pytest.raises(ValueError, match="found 'weng', wanted a list"):
        campaigns.options({"names": "weng"})
    with pytest.raises(ValueError, match="found 'table', wanted one of report, tables"):
        campaigns.options({"to": "table"})
