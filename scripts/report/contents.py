"""What lies where in the results, and what reads the tables for PyBaMM."""

import shutil
from pathlib import Path

from runtime import contents, provenance

thevenin = provenance.SCRIPTS.parent / "docs" / "examples" / "thevenin.py"
shutil.copyfile(thevenin, snakemake.output.thevenin)

Path(snakemake.output[0]).write_text(contents.text(**snakemake.params.has), encoding="utf-8")
