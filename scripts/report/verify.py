"""Compare the artefacts with the manifest; the run ends with what the log then says.

Fails where one is not what the run that made it wrote.
"""

import sys
from pathlib import Path

from runtime import tables

found = tables.changed("results/stages/manifest.tsv")
said = [*found, f"Not as the run wrote them: {len(found)}."] if found else []
said = said or ["Every artefact is as the manifest says."]
Path(snakemake.log[0]).write_text("\n".join(said), encoding="utf-8")
sys.exit(1 if found else 0)
