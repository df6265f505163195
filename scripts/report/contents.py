"""What lies where in the results."""

from pathlib import Path

from runtime import contents

Path(snakemake.output[0]).write_text(contents.text(**snakemake.params.has), encoding="utf-8")
