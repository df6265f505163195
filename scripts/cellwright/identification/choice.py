"""Which member of the family a model uses: judged by rows that took no part in the fit.

Identification chooses by blocks left out of linear fits; a finished model is compared once more, as
its members are simulated, see `in_use`.
"""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.circuit import member_named, size_of
from cellwright.identification.messages import say
from cellwright.identification.regression import held_out
from cellwright.identification.validation import FAULT_VOLT, MATERIAL_VOLT, NEAR
from cellwright.numerics.compare import compare
from cellwright.refusal import Refusal

FOLDS = 4
SMALLEST_VOLT2 = 1e-12
CLEAR = 1.0  # standard errors: the one-standard-error rule
SURE = 2.0  # standard errors that are no chance: 95 %
FAR = 2.0  # times the smallest error of a temperature: no member that errs by more is chosen
UNUSABLE_VOLT = 0.1  # error from which on a model is of no use where the voltage counts


class Score(NamedTuple):
    """Mean square error of each block of a record when it was left out.

    square_volt2 : (b,) [V²]. rows : (b,) how many rows the block has.
    """

    square_volt2: np.ndarray
    rows: np.ndarray


class Reason(NamedTuple):
    """Why a member is chosen or not: a code of messages.toml, and the same in words."""

    code: str
    text: str


class Choice(NamedTuple):
    """The chosen member, the rms error of every member [V], and sentences on how clear it is.

    reasons : name of the member → Reason why it was chosen, or why not.
    unsearched : the one that would be chosen without the members that a search has found.
    """

    name: str
    rmse_volt: dict
    words: str
    reasons: dict
    unsearched: str


def not_chosen(code, **fields):
    """Reason why a member is not chosen."""
    return Reason(code, say(f"not_chosen.{code}", **fields))


def left_out(fitted, block):
    """Errors of a fitted member by block, each block predicted without its fold; see `score_of`.

    Every fourth block is left out at once, so that blocks predicted lie between blocks fitted, as
    in use. Time constants and scales are not searched anew.

    Parameters
    ----------
    fitted : identify.Fitted.
    block : (n,) number of the block of each row of its system.

    Returns
    -------
    score : Score.
    """
    numbers, block_index = np.unique(block, return_inverse=True)
    if len(numbers) < 2:
        return score_of(block, np.zeros(len(block)))
    folds = min(FOLDS, len(numbers))
    return score_of(block, held_out(fitted.system, fitted.solution, block_index % folds))


def score_of(block, error_volt):
    """Score of the errors of what was left out; of no blocks where there is one, from which
    nothing can be left out: such a condition is fitted, and tells nothing of the choice.

    Parameters
    ----------
    block : (n,) number of the block of each row. error_volt : (n,) [V].
    """
    numbers, block_index = np.unique(block, return_inverse=True)
    if len(numbers) < 2:
        return Score(np.empty(0), np.empty(0, int))
    rows = np.bincount(block_index)
    return Score(np.bincount(block_index, np.asarray(error_volt) ** 2) / rows, rows)


def choose(
    scores, *, celsius=None, fitted_volt=None, beyond_volt=None, searched=(), whole_tests=False
):
    """The simplest of the members that predict blocks left out of their fit equally well.

    1. No member is chosen that, simulated through the records fitted, errs far more than the best
    of the family at any temperature: more than `FAR` times, and more than `MATERIAL_VOLT` beyond,
    or by more than `UNUSABLE_VOLT` where another does not; nor one whose rms error on what was left
    out is so far from the smallest, also without the block that speaks most against it; nor one
    whose simulation leaves the range of the measured voltage by more than `FAULT_VOLT`.
    2. Compared is the logarithm of each block's mean square error, so that one block near empty
    does not outvote all others, and every temperature counts alike, however many blocks it has.
    Equal to the best are members whose mean difference from it, block by block, is less than one
    standard error, and all where fewer than three blocks tell none, unless they are worse at one
    temperature beyond chance and by more than a tenth. Of these, those whose rms error over all
    blocks is within a tenth of the smallest, for what fails in one corner is not equal to what does
    not: of one block alone only where the records simulated as in use say the same. The simplest of
    them is chosen, and "clearly" only where it is better than each other by two standard errors and
    no other's rms error is smaller by more than a tenth.
    3. A member of `searched` was found by a search of the same records. It takes that one's
    place if it is better by two standard errors, at no temperature worse by more than a tenth, and
    over whole tests its rms error is not larger. Of blocks one near empty may decide that one, and
    whole tests are asked after them (`in_use.proved`).

    Parameters
    ----------
    scores : dict name of the member → list of Score, one a condition, of the same blocks.
    celsius : temperature of each condition, for the words [degC].
    fitted_volt, beyond_volt : dict name of the member → (conditions,) rms error of its simulation
        over the records fitted, and how far that leaves the range of the measured voltage [V];
        None: not looked at.
    searched : names of the members that a search has found. whole_tests : whether the scores are
        of whole tests that took no part.

    Returns
    -------
    choice : Choice.

    Raises
    ------
    Refusal : no member, or members that were not scored on the same blocks.

    Source: the one-standard-error rule of L. Breiman et al., Classification and Regression Trees
    (1984), 3.4.3.
    """
    blocks = _blocks_of(scores)
    rmse = {name: blocks.rms_volt(name) for name in scores}
    by_condition = {name: np.array([rmse_of(s) for s in parts]) for name, parts in scores.items()}
    faults = _worst_faults(
        _far_from_best(fitted_volt or {}, searched, celsius),
        _outside(beyond_volt or {}, celsius),
    )
    left = _least_faulty([name for name in scores if name not in searched], faults)
    reasons = {name: why for name, (_, why) in faults.items() if name != left}
    sound = [name for name in scores if name not in reasons]
    chosen, equal, other = _simplest(
        [n for n in sound if n not in searched], blocks, fitted_volt or {}, celsius
    )
    reasons |= other
    unsearched = chosen
    for name in (member for member in sound if member in searched):
        against = _against(name, chosen, blocks, rmse if whole_tests else {}, by_condition)
        if against:
            reasons[name] = against
        else:
            reasons[chosen], chosen, equal = not_chosen("beaten", best=name), name, [name]
    excluded = [name for name in scores if name not in sound]
    reasons[chosen] = _how_chosen(chosen, equal, blocks, rmse, excluded)
    sentences = [reasons[chosen].text, *_errors(blocks, rmse, excluded)]
    if chosen == left:
        sentences.append(say("choice.not_reliable", name=chosen, why=faults[left][1].text))
    sentences += _warning(rmse[chosen]) + _worst_temperature(chosen, fitted_volt or {}, celsius)
    return Choice(chosen, rmse, ". ".join(sentences), reasons, unsearched)


def rmse_of(score):
    """Root mean square error over all rows of what was left out [V]; NaN where nothing was.

    Parameters
    ----------
    score : Score.
    """
    if not len(score.rows):
        return np.nan
    return float(np.sqrt(np.average(score.square_volt2, weights=score.rows)))


def worst_of(score):
    """Rms error of the worst block that was left out [V]; NaN where nothing was.

    Parameters
    ----------
    score : Score.
    """
    return float(np.sqrt(score.square_volt2.max())) if len(score.rows) else np.nan


def usual_of(score):
    """Root mean square error over all rows but those of the block that tells most of it [V].

    That block, near empty or full, was predicted from beyond the range that was then fitted, as in
    use nothing is. NaN where there are fewer than three blocks.

    Parameters
    ----------
    score : Score.
    """
    if len(score.rows) < 3:
        return np.nan
    square = score.rows * score.square_volt2
    kept = np.arange(len(square)) != np.argmax(square)
    return float(np.sqrt(square[kept].sum() / score.rows[kept].sum()))


def typical_of(score):
    """Geometric mean of the blocks' rms errors [V]; NaN where nothing was left out.

    Parameters
    ----------
    score : Score.
    """
    if not len(score.rows):
        return np.nan
    return float(np.exp(np.mean(_log_of(score.square_volt2)) / 2))


def _log_of(square_volt2):
    return np.log(np.maximum(square_volt2, SMALLEST_VOLT2))


def standard_errors(scores, others):
    """By how much one model errs more than another in the mean logarithm of the blocks, in which
    each temperature counts alike, over the standard error of that; 0 where too few tell one.

    Parameters
    ----------
    scores, others : list of Score of either, one a temperature, of the same blocks.
    """
    return _blocks_of({0: scores, 1: others}).standard_errors(0, 1)


class _Blocks(NamedTuple):
    """All blocks of the members, of every temperature.

    square_volt2 : dict name → (b,) mean square error [V²]. rows : (b,) how many each has.
    condition : (b,) number of its temperature. share : (b,) its part in a mean over blocks, in
        which each temperature counts alike [1].
    """

    square_volt2: dict
    rows: np.ndarray
    condition: np.ndarray
    share: np.ndarray

    def rms_volt(self, name, *, without=None):
        """Rms error over all rows of a member [V]; `without` the block of that number."""
        rows = self.rows.copy()
        if without is not None:
            rows[without] = 0.0
        return float(np.sqrt(np.average(self.square_volt2[name], weights=rows)))

    def typical_volt(self, name):
        """Geometric mean of the blocks' rms errors [V]: one bad block does not decide it."""
        return float(np.exp(self.share @ _log_of(self.square_volt2[name]) / 2))

    def standard_errors(self, name, other, *, condition=None):
        """By how much a member errs more than another in the mean logarithm of the blocks, over
        the standard error of that; 0 where too few tell one. `condition`: at that one alone."""
        here = slice(None) if condition is None else self.condition == condition
        pair = (_log_of(self.square_volt2[n][here]) for n in (name, other))
        return compare(*pair, share=self.share[here]).z


def _blocks_of(scores):
    """Blocks of all members, which must have been scored on the same ones."""
    if not scores:
        raise Refusal("no member of the family could be fitted and scored at every temperature")
    rows = {name: np.concatenate([s.rows for s in parts]) for name, parts in scores.items()}
    if len({tuple(r) for r in rows.values()}) != 1:
        raise Refusal("members of the model were not scored on the same blocks")
    name, parts = next(iter(scores.items()))
    counts = np.array([len(s.rows) for s in parts])
    condition = np.repeat(np.arange(len(counts)), counts)
    share = 1.0 / (counts[condition] * max(np.sum(counts > 0), 1))
    square = {n: np.concatenate([s.square_volt2 for s in parts]) for n, parts in scores.items()}
    return _Blocks(square, rows[name].astype(float), condition, share)


def _worst_faults(*kinds):
    """The worst fault of each member, by name: (error over the allowed one, Reason)."""
    names = {name: None for kind in kinds for name in kind}
    return {name: max(kind[name] for kind in kinds if name in kind) for name in names}


def _far_from_best(errors, searched, celsius):
    """Faults of members that err far more than the best, by name.

    The best is one of the family: what a search has fitted to the same records says nothing against
    the others before it has been better on what was left out.
    """
    family = [name for name in errors if name not in searched]
    faults = {}
    errors = {name: np.nan_to_num(error, nan=np.inf) for name, error in errors.items()}
    best = np.min([errors[name] for name in family], axis=0) if family else None
    for name, error in errors.items():
        ratio = np.where(error > best + MATERIAL_VOLT, error / np.maximum(best, 1e-9), 1.0)
        # What is of no use at a temperature is far from what is, however near its number.
        useless = (error > UNUSABLE_VOLT) & (best <= UNUSABLE_VOLT) & (ratio > NEAR)
        fault = np.where(useless, np.maximum(ratio / FAR, error / UNUSABLE_VOLT), ratio / FAR)
        if fault.max() > 1.0:
            k = int(np.argmax(fault))
            least = min(family, key=lambda other, k=k: errors[other][k])
            errors_there = {"error": _milli(error[k]), "best": least, "least": _milli(best[k])}
            why = not_chosen("far_fitted", place=_place(celsius, k), **errors_there)
            faults[name] = fault[k], why
    return faults


def _outside(beyond, celsius):
    """Faults of members that simulate voltages which no cell has, by name."""
    faults = {}
    for name, volt in beyond.items():
        k = int(np.argmax(volt))
        if volt[k] > FAULT_VOLT:
            why = not_chosen("outside", volt=volt[k], place=_place(celsius, k))
            faults[name] = volt[k] / FAULT_VOLT, why
    return faults


def _place(celsius, k):
    return say("choice.place", celsius=celsius[k]) if celsius else ""


def _least_faulty(family, faults):
    """The member of a family that stays where there is something against each; None elsewhere."""
    if not family or not set(family) <= set(faults):
        return None
    return min(family, key=lambda name: faults[name][0])


def _simplest(names, blocks, fitted_volt, celsius):
    """The simplest of the equally good members, all of these, and why each other is not chosen."""
    rmse = {name: blocks.rms_volt(name) for name in names}
    least = min(names, key=rmse.get)
    far = [name for name in names if _larger(name, least, blocks, _is_far)]
    best = min((n for n in names if n not in far), key=blocks.typical_volt)
    near = [n for n in names if n not in far and blocks.standard_errors(n, best) <= CLEAR]
    worse = {name: _worse_at(name, best, blocks, celsius) for name in near}
    alike = [name for name in near if not worse[name]]
    smallest = min(alike, key=rmse.get)
    equal = [name for name in alike if not _cornered(name, smallest, blocks, fitted_volt)]
    chosen = min(equal, key=lambda name: (size_of(member_named(name)), blocks.typical_volt(name)))
    typical = {name: f"{1e3 * blocks.typical_volt(name):.3g}" for name in names}
    of_least = {"best": least, "least": _milli(rmse[least])}
    reasons = {
        name: not_chosen("typical", error=typical[name], best=best, least=typical[best])
        for name in names
    }
    reasons |= {n: not_chosen("far_left_out", error=_milli(rmse[n]), **of_least) for n in far}
    reasons |= {name: why for name, why in worse.items() if why}
    reasons |= dict.fromkeys(alike, not_chosen("cornered", best=best))
    reasons |= dict.fromkeys(equal, not_chosen("not_simpler", best=chosen))
    return chosen, equal, reasons


def _larger(name, least, blocks, differs):
    """Whether the rms error of a member differs from the smallest, whichever block is left out.

    Near empty, a block that is left out is predicted from beyond the range that is then fitted: one
    such decides nothing. differs : function (error, smallest) [V] → bool.
    """
    if not differs(blocks.rms_volt(name), blocks.rms_volt(least)):
        return False
    if len(blocks.rows) < 3:
        return True
    excess = blocks.rows * (blocks.square_volt2[name] - blocks.square_volt2[least])
    return differs(*(blocks.rms_volt(n, without=int(np.argmax(excess))) for n in (name, least)))


def _cornered(name, least, blocks, fitted_volt):
    """Whether a member fails somewhere where the other does not: by its rms error on what was left
    out, of several blocks, or of one where the records simulated as in use say the same."""
    if _larger(name, least, blocks, lambda error, smallest: error > NEAR * smallest):
        return True
    if name not in fitted_volt or blocks.rms_volt(name) <= NEAR * blocks.rms_volt(least):
        return False
    return bool(np.any(_is_worse(fitted_volt[name], fitted_volt[least])))


def _is_worse(error, other):
    """Whether errors [V] are larger by more than a tenth and more than anyone would notice."""
    return error > np.maximum(NEAR * other, other + MATERIAL_VOLT)


def _worse_at(name, best, blocks, celsius):
    """At which temperature a member is worse than the best beyond chance: Reason, else None."""
    for k in np.unique(blocks.condition):
        here = blocks.condition == k
        errors = (
            np.sqrt(np.average(blocks.square_volt2[n][here], weights=blocks.rows[here]))
            for n in (name, best)
        )
        error, of_best = errors
        if _is_worse(error, of_best) and blocks.standard_errors(name, best, condition=k) > SURE:
            volts = {"error": _milli(error), "best": best, "least": _milli(of_best)}
            return not_chosen("worse_there", place=_place(celsius, k), **volts)
    return None


def _milli(volt):
    """Millivolts to two digits, or whole ones from a hundred on."""
    return f"{1e3 * volt:.2g}" if volt < 0.0995 else f"{1e3 * volt:.0f}"


def _is_far(error, least):
    return error > max(FAR * least, least + MATERIAL_VOLT)


def _against(name, chosen, blocks, rmse, by_condition):
    """Reason against a member that a search has found, None where there is none."""
    sure = blocks.standard_errors(chosen, name)
    if sure <= SURE:
        return not_chosen("not_better", best=chosen, sure=sure, wanted=SURE)
    if rmse and rmse[name] > rmse[chosen]:
        volts = {"error": _milli(rmse[name]), "best": chosen, "least": _milli(rmse[chosen])}
        return not_chosen("larger", **volts)
    candidate, incumbent = by_condition[name], by_condition[chosen]
    if np.any(_is_worse(candidate, incumbent)):
        return not_chosen("worse_somewhere", best=chosen)
    return None


def _errors(blocks, rmse, excluded):
    """Sentences on the errors of all members, the smallest first, and on those left out."""
    typical = {name: blocks.typical_volt(name) for name in rmse}
    listed = ", ".join(
        say("choice.error", name=name, typical=_milli(typical[name]), rms=_milli(rmse[name]))
        for name in sorted(typical, key=typical.get)
    )
    sentences = [say("choice.errors", listed=listed)]
    return sentences + [say("choice.excluded", names=", ".join(excluded))] * bool(excluded)


def _warning(rmse_volt):
    """A sentence on an error that is too large for use, else none."""
    if rmse_volt <= UNUSABLE_VOLT:
        return []
    return [say("choice.unusable", rms=1e3 * rmse_volt, limit=1e3 * UNUSABLE_VOLT)]


def _worst_temperature(chosen, fitted_volt, celsius):
    """A sentence on the temperature at which a member errs most over the records that it was fitted
    to, where there are several; with what to do where that is too much for use."""
    errors = fitted_volt.get(chosen, ())
    if len(errors) < 2 or not celsius:
        return []
    k = int(np.argmax(np.nan_to_num(errors, nan=np.inf)))
    least = min(np.nan_to_num(of[k], nan=np.inf) for of in fitted_volt.values())
    code = "choice.worst" if errors[k] <= UNUSABLE_VOLT else "choice.worst_unusable"
    fields = {"place": _place(celsius, k), "error": _milli(errors[k]), "least": _milli(least)}
    return [say(code, **fields)]


def _how_chosen(chosen, equal, blocks, rmse, excluded):
    """Reason for a member: how it compares with the rival that comes nearest."""
    ranked = sorted(rmse, key=blocks.typical_volt)
    equals = [name for name in ranked if name in equal and name != chosen]
    rivals = [name for name in ranked if name != chosen and name not in excluded]
    code, fields = "equal", {"others": ", ".join(equals)}
    if not equals:
        code, fields = _before(chosen, rivals, blocks, rmse) if rivals else ("only", {})
    return Reason(code, say(f"chosen.{code}", name=chosen, **fields))


def _before(chosen, rivals, blocks, rmse):
    """Code of how clearly a member is better than its rivals, and the fields of its sentence."""
    sure = {name: blocks.standard_errors(name, chosen) for name in rivals}
    smaller = [name for name in rivals if NEAR * rmse[name] < rmse[chosen]]
    near = [name for name in rivals if not _is_far(rmse[name], rmse[chosen])]
    second = min(near or rivals, key=sure.get)
    if smaller:
        return "most_blocks", {"other": min(smaller, key=rmse.get)}
    if sure[second] > SURE:
        return "clear", {"other": second}
    if not near:
        return "far_rival", {"other": second, "times": rmse[second] / rmse[chosen]}
    if sure[second] <= CLEAR:
        return "rms", {"other": second}
    return "unclear", {"other": second, "sure": sure[second]}
