"""Records made wrong in known ways, and what is published of them.

    ./run python -m fuzz.cases --seed 1 --cases 500

Counts by kind: refused, right, wrong and told at the number, told elsewhere only, silent, crashed.
"""

import argparse
import json
import re
from collections import Counter, defaultdict
from functools import partial
from multiprocessing import Pool

import numpy as np

from fuzz.kinds import BENIGN, KINDS
from fuzz.published import Outcome, numbers_of, outcome_of, wrong_numbers
from fuzz.records import HERE, entries, record_of

MOST_OTHERS = 12  # tests of the same cell beside which a record is held
ORDER = ("refused", "right", "told", "elsewhere", "silent", "crash")


def case(seed, only=()):
    """One case: (kind, verdict, what) of a seed; `only` of these kinds, where there are any."""
    kind, entry, changed, clean, own = drawn(seed, only)
    where = f"{entry[0].name} {entry[1]['cell']} {entry[2]['test']}"
    beside = [
        e for e in own if e[1]["cell"] == entry[1]["cell"] and e[2]["test"] != entry[2]["test"]
    ]
    others = [clean_outcome(other) for other in beside[:MOST_OTHERS]]
    return kind, *verdict(outcome_of(changed), clean, others, kind in BENIGN), where


def drawn(seed, only=()):
    """(kind, entry, changed record, clean outcome, entries of its campaign) of a seed."""
    rng = np.random.default_rng(seed)
    kinds = KINDS | BENIGN
    names, listed = sorted(only or kinds), entries()
    # In one order wherever the campaigns lie, so that a seed is the same cases everywhere.
    folders = sorted({entry[0] for entry in listed}, key=lambda f: (f == HERE, f.name))
    while True:
        folder = folders[int(rng.integers(len(folders)))]
        own = [entry for entry in listed if entry[0] == folder]
        entry = own[int(rng.integers(len(own)))]
        record = record_of(entry)
        if record is None:
            continue
        clean = clean_outcome(entry)
        if clean.crash or not clean.rows:
            continue
        kind = names[int(rng.integers(len(names)))]
        record = record._replace(beside=columns_of_another(own, entry, rng))
        changed = kinds[kind](record, rng)
        if changed is not None:
            return kind, entry, changed, clean, own


def columns_of_another(entries_of_campaign, entry, rng):
    """Columns of a record of another test of the campaign; None where that is too long."""
    others = [other for other in entries_of_campaign if other is not entry]
    record = record_of(others[int(rng.integers(len(others)))]) if others else None
    return None if record is None else record.columns


def clean_outcome(entry, known={}):  # noqa: B006 - kept on purpose: it is asked for again and again
    """What an entry publishes unchanged; nothing where it is too long or refused."""
    key = str(entry[0]), entry[1]["cell"], entry[2]["test"]
    if key not in known:
        record = record_of(entry)
        known[key] = Outcome({}, ()) if record is None else outcome_of(record)
    return known[key]


def verdict(outcome, clean, others, benign=False):
    """("right" … "crash", in words) of what a changed record publishes beside the clean one."""
    if outcome.crash:
        return "crash", outcome.crash
    if outcome.refused:
        return "refused", outcome.refused[:160]
    numbers, true_numbers = numbers_of(outcome, others), numbers_of(clean, others)
    wrong = wrong_numbers(numbers, true_numbers)
    if not wrong:
        before = {without_numbers(n.doubt) for n in true_numbers}
        alarm = next((n for n in numbers if without_numbers(n.doubt) not in before), None)
        return "right", f"alarm: {alarm.doubt}" if benign and alarm else ""
    untold = [(n, true) for n, true in wrong if not n.doubt]
    if not untold:
        return "told", wrong[0][0].doubt
    number, true = untold[0]
    found = f"{number.value:.5g} ± {number.std:.2g}, clean {true.value:.5g}"
    words = f"{number.quantity} {number.where}: {found}"
    known = set(map(without_numbers, clean.notes))
    fresh = [note for note in outcome.notes if without_numbers(note) not in known]
    return ("elsewhere", f"{words} | {fresh[0]}") if fresh else ("silent", words)


def without_numbers(words):
    """Words whose numbers do not count: a last digit of one is no other doubt."""
    return re.sub(r"[-\d.]+", "#", words)


def main():
    """Run the cases and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--cases", type=int, default=200)
    parser.add_argument("--cores", type=int, default=2)
    parser.add_argument("--kind", action="append", default=[], help="of this one only; repeatable")
    parser.add_argument("--to", help="a file to which each case is added, as a line of JSON")
    chosen = parser.parse_args()
    seeds = [1_000_000 * chosen.seed + k for k in range(chosen.cases)]
    found = []
    with Pool(chosen.cores) as pool:
        for row in pool.imap_unordered(partial(case, only=chosen.kind), seeds, chunksize=4):
            found.append(row)
            if chosen.to:
                with open(chosen.to, "a", encoding="utf-8") as file:
                    file.write(json.dumps(row) + "\n")
    table, total = defaultdict(Counter), Counter()
    for kind, what, _, _ in found:
        table[kind][what] += 1
        total[what] += 1
    print(f"{'kind':34s}" + "".join(f"{name:>10s}" for name in ORDER))
    for kind in sorted(table):
        print(f"{kind:34s}" + "".join(f"{table[kind][name]:10d}" for name in ORDER))
    print(f"{'all':34s}" + "".join(f"{total[name]:10d}" for name in ORDER))


if __name__ == "__main__":
    main()
