"""Put the benchmark's record and figures into the repository: `publish_benchmark.py CAMPAIGN`.

CAMPAIGN is the folder in which `snakemake missing_effect_benchmark` has run. The record is
benchmarks/missing_effect.md; docs/missing-effect-benchmark.md says by hand what it shows.
"""

import shutil
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

if __name__ == "__main__":
    made = Path(sys.argv[1]) / "results" / "effect_scores"
    text = (made / "benchmark.md").read_text(encoding="utf-8")
    written = text.replace("](effect-", "](../docs/pictures/effect-")
    written = written.replace("](virtual-laboratory.md)", "](../docs/virtual-laboratory.md)")
    (ROOT / "benchmarks" / "missing_effect.md").write_text(written, encoding="utf-8")
    for picture in made.glob("effect-*.svg"):
        shutil.copyfile(picture, ROOT / "docs" / "pictures" / picture.name)
