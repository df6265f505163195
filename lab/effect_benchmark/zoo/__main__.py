"""Search the cells of one folder and judge the answers: a line a cell, and the totals.

python -m effect_benchmark.zoo FOLDER [--cells a,b] [--jobs 1] [--wrong] [--answers FILE]
"""

import argparse
import json
import os
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

# Before numpy is loaded: several searches with threads of their own slow each other down fivefold.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from effect_benchmark import campaign
from effect_benchmark.scoring import Share
from effect_benchmark.zoo import judging, searching

REASON = 120  # letters of why there is no verdict


def main():
    """Read the arguments, search, and print."""
    asked = _arguments()
    sheets = campaign.read(asked.folder)
    truth = judging.truth_of(asked.folder)
    names = asked.cells.split(",") if asked.cells else campaign.searched(sheets)
    rows = []
    for row in _answers(asked.folder, names, asked.jobs):
        rows.append(row)
        for one in judging.judged("", {row["cell"]: truth[row["cell"]]}, rows):
            print(line(one), flush=True)
        _keep(rows, asked.answers)
    # A planted copy may have come before the unplanted one that it is judged beside.
    judged = judging.judged("", {row["cell"]: truth[row["cell"]] for row in rows}, rows)
    for one in judging.shares(judged):
        print(f"{one.name:40s} {_measured(one)}")
    for one in judging.wrong(judged) if asked.wrong else []:
        print(f"\n{one.cell} ({one.hidden}, {one.outcome}): {one.sentence}")


def _keep(rows, path):
    """Write the verdicts so far, so that a run that is stopped leaves them."""
    if path:
        Path(path).write_text(json.dumps(rows, indent=1), encoding="utf-8")


def line(row: judging.Judged) -> str:
    """One cell in a line: kind, hidden, strength, verdict, names, errors, outcome, time."""
    shown = f"{row.hidden} ({row.form})" if row.form else row.hidden
    sizes = f"{row.strength_millivolt:4.1f} mV{' ' if row.visible else '·'}"
    gap = f"{row.before_millivolt:5.1f} → {row.after_millivolt:5.1f} mV"
    extra = f" +{row.extra} extra" if row.extra else ""
    mark = "ok   " if row.content and not row.extra else "WRONG"
    why = "" if row.verdict else f"  ({row.sentence[:REASON]})"
    return (
        f"{row.cell:10s} {row.kind:8s} {shown:44s} {sizes} {row.verdict or '–':9s} "
        f"{row.said or '–':36s} {gap} floor {row.floor_millivolt:4.1f}  {mark} "
        f"{row.outcome}{extra}  {row.cpu_second:.1f} s{why}"
        f"{'  <- ' + row.against if row.against else ''}"
    )


def _arguments():
    parser = argparse.ArgumentParser(prog="effect_benchmark.zoo", description=__doc__)
    parser.add_argument("folder", help="a campaign with truth/missing_effect.json")
    parser.add_argument("--cells", default="", help="names, joined by commas; all if not given")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--wrong", action="store_true", help="print what wrong verdicts say")
    parser.add_argument("--answers", default="", help="file for the verdicts, JSON")
    return parser.parse_args()


def _answers(folder, names, jobs):
    """Rows of answers as they come, in the order of the names."""
    if jobs <= 1:
        mine = searching.Folder(folder)
        for name in names:
            yield from searching.answers(mine, [name])
        return
    with ProcessPoolExecutor(jobs) as pool:
        yield from pool.map(partial(_alone, folder), names)


def _alone(folder, name):
    if folder not in _FOLDERS:
        _FOLDERS[folder] = searching.Folder(folder)
    return searching.answers(_FOLDERS[folder], [name])[0]


_FOLDERS = {}  # of this process


def _measured(one):
    if not one.of:
        return "–"
    if isinstance(one, Share):
        low, high = one.interval
        return (
            f"{one.hits} of {one.of} = {100 * one.share:.0f} % ({100 * low:.0f}–{100 * high:.0f})"
        )
    return f"{one.value:.2f} of {one.of}"


if __name__ == "__main__":
    main()
