"""Which numbers a person asks for on the command line of the yardstick's tools."""

import argparse
from pathlib import Path

import pandas as pd

from real_cells import gather, record, truth

ROOT = Path(__file__).resolve().parents[2]
LAST_RUN = ROOT / "real" / "numbers.csv"


def options(about: str) -> argparse.ArgumentParser:
    """The options that say where the numbers come from."""
    asked = argparse.ArgumentParser(description=about)
    source = asked.add_mutually_exclusive_group()
    source.add_argument("--from", dest="folder", help="gather from a folder of finished campaigns")
    source.add_argument(
        "--demo", action="store_true", help="the finished demo campaign, against its truth"
    )
    return asked


def measured(given) -> pd.DataFrame:
    """The numbers that were asked for: of the last `real` run, a folder, or the demo campaign.

    Raises
    ------
    FileNotFoundError
        Where there are none.
    """
    if given.demo:
        return truth.numbers(ROOT)
    if given.folder:
        found = [gather.numbers(campaign) for campaign in gather.campaigns(given.folder)]
        if not found:
            raise FileNotFoundError(
                f"{given.folder}: found no finished campaign (results/tables/checks.csv)"
            )
        rows = pd.concat(found, ignore_index=True)
        return gather.with_published(rows, record.read(record.PUBLISHED))
    if not LAST_RUN.is_file():
        raise FileNotFoundError(
            "real/numbers.csv: found none; run `snakemake --cores 2 real` first"
        )
    return record.read(LAST_RUN)
