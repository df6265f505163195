"""Run one campaign of real cells in a folder of its own, and gather its numbers."""

import sys
from pathlib import Path

from real_cells import gather, nested, record

out, params, log = Path(snakemake.output[0]), snakemake.params, snakemake.log[0]
nested.lay_out(params.campaign, out.parent)
try:
    nested.run(out.parent, whole=params.whole, log=log)
except RuntimeError as failure:
    sys.exit(str(failure))
record.write(gather.numbers(out.parent), out)
