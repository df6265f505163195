"""One job of the virtual laboratory, as lab/Snakefile calls it.

python lab/tools/make_campaign.py thesis virtual/thesis '{"seed": 0}' P01     files of one job
python lab/tools/make_campaign.py thesis virtual/thesis '{"seed": 0}'         sheets and truth
"""

import json
import sys
from pathlib import Path

from virtual_lab import campaigns
from virtual_lab.campaigns import making

if __name__ == "__main__":
    campaign, folder, options, *batch = sys.argv[1:]
    plan = campaigns.plan(campaign, **json.loads(options))
    if batch:
        making.make_batch(plan, *batch, Path(folder))
    else:
        making.make_sheets(plan, Path(folder))
