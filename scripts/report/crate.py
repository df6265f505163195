"""The run as a Provenance Run Crate, with the workflow as it ran."""

import json
import shutil
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

import snakemake as engine

from runtime import crate, provenance, snakemake_state

output, params = snakemake.output, snakemake.params
ours = shutil.ignore_patterns("profiles", "report", "*.csv")
shutil.copytree(provenance.SCRIPTS.parent / "workflow", output.workflow, ignore=ours)
workflow = [path for path in Path(output.workflow).rglob("*") if path.is_file()]
listed = Path(snakemake.input.manifest).read_text(encoding="utf-8").splitlines()
digests = dict(line.split("\t")[::-1] for line in listed)
digests |= {path.as_posix(): provenance.sha256_of(path) for path in workflow}
# A crate is published on a day, of jobs that have ended; nothing else in the results has a date.
about = {"published": datetime.now(UTC).date().isoformat(), "snakemake": engine.__version__}
about["ended"] = partial(snakemake_state.ended, Path.cwd())
document = crate.crate(digests, params.rules, about | params.about)
Path(output.crate).write_text(json.dumps(document, indent=1, ensure_ascii=False), encoding="utf-8")
