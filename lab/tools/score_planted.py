"""Search planted campaigns of real cells, and score the names that are new beside the unplanted.

python lab/tools/score_planted.py FOLDER ... --sizes 0.5base 1base --page scores.md

Each folder keeps its answers in answers.jsonl, one line a cell; a cell that has one is not searched
again unless --anew is given. With --run own (or plain) nothing is searched: the verdicts of that
base are read from the folder's results, after `snakemake --directory FOLDER missing_effect`.
"""

import argparse
import json
from pathlib import Path

import pandas as pd

from effect_benchmark import planted


def answers(folder: Path, sizes, anew: bool) -> list[dict]:
    """Answers of a folder, those that are kept and those that are not there yet."""
    kept = folder / "answers.jsonl"
    if anew:
        kept.unlink(missing_ok=True)
    text = kept.read_text(encoding="utf-8") if kept.is_file() else ""
    rows = [json.loads(line) for line in text.splitlines()]
    with kept.open("a", encoding="utf-8") as file:
        for row in planted.answers_of(folder, sizes, {row["cell"] for row in rows}):
            print(json.dumps(row), file=file, flush=True)
            rows.append(row)
    return rows


def judged(folder: Path, given) -> pd.DataFrame:
    """Judged copies of a folder: searched here, or by a run of the pipeline in it."""
    if given.run:
        members = planted.members_of_run(folder) if given.run == "own" else None
        return planted.judged(
            folder, planted.answers_of_run(folder, given.run), given.sizes, members
        )
    return planted.judged(folder, answers(folder, given.sizes, given.anew), given.sizes)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", nargs="+", type=Path, help="planted campaigns")
    parser.add_argument("--sizes", nargs="*", help="of the copies, as 1base; all if not given")
    parser.add_argument("--page", type=Path, help="Markdown file that the scores are written to")
    parser.add_argument("--anew", action="store_true", help="search although answers are there")
    parser.add_argument("--run", choices=planted.FOLDERS, help="base whose verdicts are read")
    given = parser.parse_args()
    table = pd.concat([judged(folder, given) for folder in given.folders], ignore_index=True)
    text = planted.page(table)
    if given.page:
        given.page.write_text(text, encoding="utf-8")
    print(text)
    print(table.to_string(max_colwidth=60))
