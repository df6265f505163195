"""Run one campaign of real cells in a folder of its own, and gather its numbers."""

import sys
from pathlib import Path

from real_cells import campaigns, record

out, params, log = Path(snakemake.output[0]), snakemake.params, snakemake.log[0]
campaigns.copy_campaign(params.campaign, out.parent)
try:
    campaigns.run(out.parent, whole=params.whole, log=log)
except RuntimeError as failure:
    sys.exit(str(failure))
record.write(record.of_campaign(out.parent), out)
