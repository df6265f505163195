"""Search planted campaigns of real cells, and score the names that are new beside the unplanted.

python scripts/tools/score_planted.py FOLDER ... --page scores.md

Each folder keeps its answers in answers.json; cells that have one are not searched again unless
--anew is given.
"""

import argparse
import json
from pathlib import Path

import pandas as pd

from effect_benchmark import planted

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", nargs="+", type=Path, help="planted campaigns")
    parser.add_argument("--page", type=Path, help="Markdown file that the scores are written to")
    parser.add_argument("--anew", action="store_true", help="search although answers are there")
    given = parser.parse_args()
    tables = []
    for folder in given.folders:
        kept = folder / "answers.json"
        if given.anew or not kept.is_file():
            rows = list(planted.answers_of(folder))
            kept.write_text(json.dumps(rows), encoding="utf-8")
        tables.append(planted.judged(folder, json.loads(kept.read_text(encoding="utf-8"))))
    table = pd.concat(tables, ignore_index=True)
    text = planted.page(table)
    if given.page:
        given.page.write_text(text, encoding="utf-8")
    print(text)
    print(table.to_string(max_colwidth=60))
