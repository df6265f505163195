"""Checksums of every artefact."""

from pathlib import Path

from runtime import tables

Path(snakemake.output[0]).write_text(tables.manifest(snakemake.input), encoding="utf-8")
