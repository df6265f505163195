"""Put the benchmark's page and figures into docs/: `publish_benchmark.py CAMPAIGN`.

CAMPAIGN is the folder in which `snakemake missing_effect_benchmark` has run.
"""

import shutil
import sys
from pathlib import Path

DOCS = Path(__file__).resolve().parents[2] / "docs"

if __name__ == "__main__":
    made = Path(sys.argv[1]) / "results" / "effect_scores"
    text = (made / "benchmark.md").read_text(encoding="utf-8")
    written = text.replace("](effect-", "](pictures/effect-")
    (DOCS / "missing-effect-benchmark.md").write_text(written, encoding="utf-8")
    for picture in made.glob("effect-*.svg"):
        shutil.copyfile(picture, DOCS / "pictures" / picture.name)
