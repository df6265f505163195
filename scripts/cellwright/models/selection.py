"""Which member of the family: judged by rows that took no part in the fit it is judged by."""

from typing import NamedTuple

import numpy as np

from cellwright.models.members import member_named, size_of
from cellwright.models.regression import held_out
from cellwright.refusal import Refusal

FOLDS = 4
SMALLEST_VOLT2 = 1e-12
NEAR = 1.1  # of rms errors that count as equal
CLEAR = 1.0  # standard errors: the one-standard-error rule


class Score(NamedTuple):
    """Mean square error of each block of a record when it was left out.

    square_volt2 : (b,) [V²]. rows : (b,) how many rows the block has.
    """

    square_volt2: np.ndarray
    rows: np.ndarray


class Choice(NamedTuple):
    """The chosen member, the rms error of every member [V], and in words how clear it is."""

    name: str
    rmse_volt: dict
    words: str


def left_out(fitted, block):
    """Errors of a fitted member by block, each block predicted without its fold.

    Every fourth block is left out together with its like, so that what is predicted lies between
    what was fitted, as in use. Time constants and scales are not searched anew.

    Parameters
    ----------
    fitted : identify.Fitted.
    block : (n,) number of the block of each row of its system.

    Returns
    -------
    score : Score.

    Raises
    ------
    Refusal : fewer than two blocks: nothing can be left out.
    """
    numbers, at = np.unique(block, return_inverse=True)
    if len(numbers) < 2:
        raise Refusal("the data are one block: nothing can be left out to choose a model by")
    folds = min(FOLDS, len(numbers))
    error = held_out(fitted.system, fitted.solution, at % folds)
    rows = np.bincount(at)
    return Score(np.bincount(at, error**2) / rows, rows)


def choose(scores):
    """The simplest member among those that no other predicts what was left out better than.

    Compared is the logarithm of each block's mean square error, so that one block near empty does
    not outvote all others. Equal to the best are members whose mean difference from it, block by
    block, is less than one standard error; of these, those whose rms error over all blocks is
    within a tenth of the smallest, for what fails in one corner is not equal to what does not.

    Parameters
    ----------
    scores : dict name of the member → list of Score, one a condition, of the same blocks.

    Returns
    -------
    choice : Choice.

    Raises
    ------
    Refusal : no member, or members that were not scored on the same blocks.

    Source: the one-standard-error rule of L. Breiman et al., Classification and Regression Trees
    (1984), 3.4.3.
    """
    if not scores:
        raise Refusal("no member of the family could be fitted and scored at every temperature")
    rows = {name: np.concatenate([s.rows for s in parts]) for name, parts in scores.items()}
    if len({tuple(r) for r in rows.values()}) != 1:
        raise Refusal("members of the model were not scored on the same blocks")
    weight = next(iter(rows.values())).astype(float)
    square = {n: np.concatenate([s.square_volt2 for s in parts]) for n, parts in scores.items()}
    rmse = {name: float(np.sqrt(np.average(s, weights=weight))) for name, s in square.items()}
    logs = {name: np.log(np.maximum(s, SMALLEST_VOLT2)) for name, s in square.items()}
    best = min(logs, key=lambda name: logs[name].mean())
    alike = [name for name in logs if _equal(logs[name] - logs[best])]
    smallest = min(rmse[name] for name in alike)
    equal = [name for name in alike if rmse[name] <= NEAR * smallest]
    chosen = min(equal, key=lambda name: (size_of(member_named(name)), logs[name].mean()))
    typical = {name: float(np.exp(log.mean() / 2)) for name, log in logs.items()}
    return Choice(chosen, rmse, _words(chosen, equal, typical, rmse))


def _equal(difference):
    """A mean difference that the scatter between blocks could make by chance."""
    if len(difference) < 3:
        return difference.mean() <= 0
    return difference.mean() <= CLEAR * difference.std(ddof=1) / np.sqrt(len(difference))


def _words(chosen, equal, typical, rmse):
    ranked = sorted(typical, key=typical.get)
    listed = ", ".join(f"{n} {1e3 * typical[n]:.2g} mV ({1e3 * rmse[n]:.2g})" for n in ranked)
    listed = f"Typical error of a block left out of the fit, rms of all in brackets: {listed}"
    same = [name for name in ranked if name in equal and name != chosen]
    if same:
        return f"{chosen} chosen: equal within chance to {', '.join(same)}, and simpler. {listed}"
    second = next((name for name in ranked if name != chosen), None)
    clear = f", clearly before {second}" if second else ", the only one asked for"
    return f"{chosen} chosen{clear}. {listed}"
