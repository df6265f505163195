"""Pulses of a finished campaign identified by each method: `compare_methods.py [CAMPAIGN]`.

Writes CAMPAIGN/results/methods/: identification_methods.csv, one row a pulse and method, and a
figure of each cell. Without a folder it is the demo.
"""

import argparse
import sys
from pathlib import Path

from cellwright.refusal import Refusal
from pulse_methods import of_campaign

if __name__ == "__main__":
    asked = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    asked.add_argument("campaign", type=Path, nargs="?", default=Path(), help="default: this one")
    campaign = asked.parse_args().campaign
    try:
        notes = of_campaign.compare_campaign(campaign)
    except (FileNotFoundError, Refusal) as fault:
        sys.exit(str(fault))
    print("\n".join([*notes, f"{campaign / of_campaign.RESULTS / of_campaign.TABLE}"]))
