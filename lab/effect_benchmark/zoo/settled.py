"""Make the test that each verdict advises, in the simulator, search again, and judge the answer.

python -m effect_benchmark.zoo.settled FOLDER TARGET --seed N [--sizes JSON] [--cells a,b]
"""

import argparse
import json
from collections import Counter
from pathlib import Path

import cellwright as cw
from cellwright.effects.planning.planner import planned
from effect_benchmark import campaign
from effect_benchmark.zoo import judging, searching
from virtual_lab.zoo.further import Further, with_further

HPPC = ("hppc", "hppc_warm", "hppc_cold")


def main():
    """Read the arguments; print verdicts before and after the next test of a cell, and shares."""
    parser = argparse.ArgumentParser(prog="effect_benchmark.zoo.settled", description=__doc__)
    parser.add_argument("folder", help="a behavioural campaign, as virtual_lab.zoo.forms makes it")
    parser.add_argument("target", help="folder of the campaigns with one test more, one a cell")
    parser.add_argument("--seed", type=int, required=True, help="that the campaign was made with")
    parser.add_argument("--sizes", default="{}", help="that the campaign was made with, JSON")
    parser.add_argument("--cells", default="", help="names, joined by commas; all if not given")
    asked = parser.parse_args()
    folder, truth = searching.Folder(asked.folder), judging.truth_of(asked.folder)
    asked_of, settled_of = Counter(), Counter()
    options = {"seed": asked.seed} | json.loads(asked.sizes)
    for name in asked.cells.split(",") if asked.cells else campaign.searched(folder.sheets):
        try:
            both = settled(folder, asked.folder, Path(asked.target) / name, name, **options)
        except cw.Refusal as refusal:
            print(f"{name}: {refusal}", flush=True)
            continue
        if both is None:
            continue
        question, well = question_of(both[0]), is_settled(truth[name], both[1])
        asked_of[question] += 1
        settled_of[question] += well
        lines = f"{_line(both[0])}; after {both[0]['next_test_id']}: {_line(both[1])}"
        print(
            f"{name} ({truth[name]['kind']}): {lines}{'' if well else '  NOT SETTLED'}", flush=True
        )
    for question, number in asked_of.items():
        print(f"{question:14s} {settled_of[question]} of {number} settled")


def question_of(verdict: dict) -> str:
    """What a verdict leaves open: "tie", "unproven name", else its word."""
    if verdict["verdict"] == "ambiguous":
        return "tie"
    unproven = any(one["proof"] == "unproven" for one in verdict["effects"])
    return "unproven name" if unproven else verdict["verdict"]


def is_settled(hidden: dict, verdict: dict) -> bool:
    """Whether a verdict is right and leaves nothing open.

    All that is hidden is named alone and proven, and nothing beside it but parts of its form; of a
    cell without an effect, of one outside the vocabulary and of a wrong sheet the word is right.

    Parameters
    ----------
    hidden : row of the truth. verdict : the document of a verdict.
    """
    open_names = any(
        one.get("alternatives") or one.get("proof") == "unproven" for one in verdict["effects"]
    )
    return (
        judging.outcome(hidden, verdict) == "right"
        and not open_names
        and not judging.extra_names(hidden, verdict["effects"])
    )


def settled(folder, source, target, name, *, seed, **sizes):
    """Verdicts of a cell before and after the test that the first advises; None: it advises none.

    Parameters
    ----------
    folder : searching.Folder of the campaign. source : its path. target : of the campaign with one
    test more. name : of the cell. seed, sizes : that the campaign was made with.

    Raises
    ------
    Refusal : the cell cannot be searched.
    """
    before = searching.found_of(folder, name)[0].verdict
    if before["next_test_id"] is None:
        return None
    mine = folder.facts(name), folder.basis(name), folder.records(name)
    case = cw.prepared_case(*mine, folder.of_analysis("missing_effect"))
    test = planned(case, before["next_test_id"])
    # A name that the fitted records show already is to be proven; what is open is to be fitted.
    proof = any(one["proof"] == "unproven" for one in before["effects"])
    further = Further(
        f"next_{test.id}",
        "hppc" if test.id in HPPC else "drive",
        "validation" if proof and before["verdict"] == "named" else "fit",
        float(test.record.celsius[0]),
        test.record.test_time_second,
        test.record.current_ampere / case.cell.capacity_ampere_hour,
    )
    with_further(source, target, name, further, seed=seed, **sizes)
    return before, searching.found_of(searching.Folder(target), name)[0].verdict


def _line(verdict):
    named = [
        "|".join([one["effect"], *one["alternatives"]])
        + (" (unproven)" if one["proof"] == "unproven" else "")
        for one in verdict["effects"]
    ]
    volt = 1e3 * verdict["validation_rmse_volt"]["after"]
    return f"{verdict['verdict']} {' + '.join(named)} {volt:.1f} mV"


if __name__ == "__main__":
    main()
