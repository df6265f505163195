"""Write the report: one self-contained HTML file."""

from pathlib import Path

from runtime import page

Path(snakemake.output[0]).write_text(page.render(snakemake), encoding="utf-8")
