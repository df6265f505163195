"""How likely each answer of a search is: none, names, or something unknown.

The records are few, and their blocks (a record's band of the SoC) scatter by more than the noise of
their rows. Each draw gives every block a random weight, and the rule of the search chooses anew
among the trials of each round; none is fitted again.
"""

from itertools import product
from typing import NamedTuple

import numpy as np

from cellwright.effects import base
from cellwright.effects.candidates import frees_of
from cellwright.effects.proof import (
    ALIKE,
    block_sums,
    blocks_of,
    can_judge,
    consistency_of,
    excess_volt,
    promised_of,
)
from cellwright.effects.search import allowed, best_of, stays, up_to

DRAWS = 200
LIKELY, SURE = 0.5, 0.9  # from which on an effect is a name, and one that is sure
SEED = 15
# All three are from behavioural cells; docs/missing-effect.md, "How likely".
SPREAD = ALIKE  # blocks that lie side by side err alike: weights scatter as if they were fewer
UNSEEN = 0.05  # searches that all blocks agree on and that are wrong: a form that no effect has
SHARPER = 1.2  # power by which shares of draws, which are too cautious, are told as probabilities


class Side(NamedTuple):
    """Blocks of the records fitted, or of those that judge, with weights of each draw.

    block : (n,) number of the block of each row, -1 where a row does not count. number : (n,) place
    of the block among those present, also of rows that do not count. blocks : how many.
    file : (n,) number of the record. weights : (d, b) [1].
    """

    block: np.ndarray
    number: np.ndarray
    blocks: int
    file: np.ndarray
    weights: np.ndarray

    def sums(self, values, rows=None):
        """Sums of values (n,) over each block (b,), of rows that are marked."""
        values = values if rows is None else values * rows
        return np.bincount(self.number, values, self.blocks)

    def rms(self, residual):
        """Root mean square of a residual [V] over rows that count, in each draw (d,)."""
        rows = self.block >= 0
        return np.sqrt(
            self.weights @ self.sums(residual**2, rows) / (self.weights @ self.sums(1.0 * rows))
        )


def probabilities(case, rounds, result, *, draws=DRAWS, spread=SPREAD, unseen=UNSEEN):
    """Probability of each answer: the share of draws that end in it.

    1. Every block of the records fitted and of those that judge has a weight, of mean one and
       variance `spread`, drawn from a gamma distribution.
    2. In each round gain, harm, sizes and criteria of its trials follow with these weights, and
       the rule of the search (`search.best_of`) chooses.
    3. A draw that chooses as the search did, what is tied with that, or what the search chose
       later, goes on;
       one that chooses another effect ends with it; one that chooses none, or one that the search
       took back, ends with those so far.
    4. Before the last name a draw goes on as well where the name counts beside all others in the
       end: what helps unevenly by itself may do so for the others that are still missing.

    Parameters
    ----------
    case : case.Case. rounds : list of search.Round. result : verdict.Outcome of them.
    draws : how many. spread : variance of the weights [1]. unseen : probability that goes evenly to
    all answers, as blocks cannot show it: "none", "unknown", each name tried last, those drawn.

    Returns
    -------
    probabilities : dict answer → probability, the likeliest first: "none", "unknown", or ids in
    alphabetical order joined by " + ". Ids that no fit tells apart share theirs evenly.

    Source: D. Rubin, Ann. Statist. 9 (1981) 130 (the Bayesian bootstrap).
    """
    random = np.random.default_rng(SEED)
    kept = tuple(step.chosen.effect.id for step in result.steps)
    going, answers = np.arange(draws), [()] * draws
    sides, first, stands = None, None, {}
    refused = {key for step in rounds for key in step.dropped}
    unnamed = {trial.effect.key for step in rounds for trial in step.small}
    for number, step in enumerate(rounds):
        if sides is None:
            sides = _sides(case, step, random.gamma, draws, spread)
            first = _befores(step.before, sides)
            stands = _beside_the_others(case, result, sides, first, rounds[0].floor)
        choices = _choices(case, step, sides, first, going, rounds[0].floor)
        later = {s.chosen.effect.key for s in rounds[number:] if s.chosen}
        later |= set(step.tied) if step.chosen else set()
        chosen = stands.get(step.chosen.effect.key, ()) if step.chosen else ()
        further = [
            draw
            for draw, t in choices.items()
            if draw in chosen or (t is not None and t.effect.key in later)
        ]
        for draw, trial in choices.items():
            answers[draw] = _ended(step, trial, refused, unnamed)
        for draw in further:
            answers[draw] = kept
        going = np.array(further, int)
    shares = _shares(answers, _unknown(result, sides, first, case.gates.unknown_volt), result)
    possible = {*shares, "none", "unknown", *(t.effect.id for t in rounds[-1].trials)}
    even = unseen / len(possible)
    shares = {one: (1.0 - unseen) * shares.get(one, 0.0) + even for one in possible}
    return dict(sorted(shares.items(), key=lambda pair: (-pair[1], pair[0])))


def _beside_the_others(case, result, sides, first, floor):
    """Draws in which a name counts beside all others in the end: sets by key, the last name not."""
    if len(result.steps) < 2:
        return {}
    counts, last = {}, result.steps[-1]
    for one in last.beside:
        befores = _befores(one.before, sides)
        weighed = _weighed(case, one.before, one.trial, sides)
        about = zip(first, befores, weighed, strict=True)
        counts[one.trial.effect.key] = {
            draw
            for draw, (healthy, before, trial) in enumerate(about)
            if stays(case, healthy, before, trial, floor)
        }
    counts.pop(last.chosen.effect.key, None)
    return counts


def _ended(step, trial, refused, unnamed):
    """Ids of a draw that ends in a round with a choice (candidates.Trial) or with None."""
    so_far = tuple(e.id for e in step.before.effects if e.key not in unnamed)
    none = trial is None or trial.effect.key in refused
    return so_far if none else (*so_far, trial.effect.id)


def _sides(case, step, gamma, draws, spread):
    """Both sides with blocks by the SoC of the model before a round."""
    state, sides = step.before, []
    both = (
        (case.fit, state.solution.values, step.filters.fit_rows),
        (case.validation, state.values, step.filters.validation_rows),
    )
    for stack, values, rows in both:
        soc = base.fields_of(case.cell, stack, values, state.effects).soc
        number = np.unique(blocks_of(stack, soc, np.ones_like(rows)), return_inverse=True)[1]
        blocks = int(number.max()) + 1
        weights = gamma(1.0 / spread, spread, (draws, blocks))
        sides.append(Side(np.where(rows, number, -1), number, blocks, stack.file, weights))
    return sides


def _befores(state, sides):
    """A state with its errors as each draw weighs the blocks: list of candidates.State."""
    errors = sides[0].rms(state.solution.residual), sides[1].rms(state.validation)
    return [
        state._replace(rmse_volt=fit, validation_rmse_volt=judging)
        for fit, judging in zip(*(e.tolist() for e in errors), strict=True)
    ]


def _choices(case, step, sides, first, going, floor):
    """What each draw chooses in a round: dict draw → candidates.Trial of the search, or None."""
    befores = _befores(step.before, sides)
    weighed = [_weighed(case, step.before, trial, sides) for trial in allowed(case, step)]
    choices = {}
    for draw in going.tolist():
        trials = sorted((t[draw] for t in weighed), key=lambda t: -t.j)
        chosen, _ = best_of(case, first[draw], befores[draw], trials, floor)
        choices[draw] = chosen
    return choices


def _weighed(case, before, trial, sides):
    """A trial as each draw weighs the blocks: list of candidates.Trial."""
    fit, judging = sides
    fall = before.solution.whitened**2 - trial.state.solution.whitened**2
    fall = fall / trial.inflation["fit"][fit.file]
    delta_bic = trial.delta_bic + (fit.weights - 1.0) @ fit.sums(fall)
    fall = before.validation_white**2 - trial.state.validation_white**2
    fall = fall / trial.inflation["validation"][judging.file]
    delta_validation = trial.delta_validation + (judging.weights - 1.0) @ judging.sums(fall)
    promised = promised_of(before, trial.state, judging.file, trial.inflation["validation"])
    proofs = zip(
        _proofs(case, judging, before.validation, trial.state.validation),
        _proofs(case, fit, before.solution.residual, trial.state.solution.residual),
        (judging.weights @ judging.sums(promised)).tolist(),
        strict=True,
    )
    columns = delta_bic.tolist(), delta_validation.tolist(), _befores(trial.state, sides)
    weighed = []
    for (shown, fitted, much), bic, judged, state in zip(proofs, *columns, strict=True):
        proven = can_judge(case.gates, shown, fitted, much)
        now = {"delta_bic": bic, "delta_validation": judged, "state": state, "proven": proven}
        weighed.append(trial._replace(**now, proof=shown if proven else fitted))
    return weighed


def _proofs(case, side, before, after):
    """Consistency of a change of the residual on one side, in each draw: list."""
    sums = block_sums(before, after, side.block, side.file)
    present = np.unique(side.block[side.block >= 0])
    limit = {"material_volt": case.gates.material_volt}
    return consistency_of(sums, side.weights[:, present], **limit)


def _unknown(result, sides, first, unknown_volt):
    """Draws in which the plain model leaves more than anyone would accept (d,) bool."""
    floor = result.floor
    return [
        max(
            excess_volt(state.rmse_volt, floor.fit_volt),
            excess_volt(state.validation_rmse_volt, floor.validation_volt),
        )
        > unknown_volt
        for state in first
    ]


def _shares(answers, unknown, result):
    """Shares of the draws that end in each answer; what no fit tells apart shares evenly."""
    same = {step.chosen.effect.id: (step.chosen.effect.id, *step.tied) for step in result.steps}
    shares = {}
    for names, lost in zip(answers, unknown, strict=True):
        alike = product(*(same.get(name, (name,)) for name in names))
        said = [" + ".join(sorted(set(one))) for one in alike]
        said = said if names else ["unknown" if lost else "none"]
        for one in said:
            shares[one] = shares.get(one, 0.0) + 1.0 / len(said) / len(answers)
    return shares


def sharpened(shares, *, sharper=SHARPER):
    """Probabilities as a report states them: shares of the draws to a power, in sum one.

    A rule that asks for even help is passed by a weak right effect in few draws.

    Parameters
    ----------
    shares : from `probabilities`. sharper : the power [1].
    """
    powers = {answer: share**sharper for answer, share in shares.items()}
    whole = sum(powers.values())
    return {answer: power / whole for answer, power in powers.items()}


def without_name(shares, names):
    """Probabilities of answers, where some names are shown to be none: what is left of each answer.

    Parameters
    ----------
    shares : dict: answer → probability, as told. names : ids of the effects.

    Returns
    -------
    shares : the same, the likeliest first; what had no other name is "unknown".
    """
    left = {}
    for answer, share in shares.items():
        kept = " + ".join(one for one in answer.split(" + ") if one not in names) or "unknown"
        left[kept] = left.get(kept, 0.0) + share
    return dict(sorted(left.items(), key=lambda pair: (-pair[1], pair[0])))


def probability_of(shares, names):
    """Probability that a cell shows one of some effects, whatever else it shows [1].

    Parameters
    ----------
    shares : dict: answer → probability, as told. names : ids of the effects.
    """
    return sum(p for answer, p in shares.items() if set(names) & set(answer.split(" + ")))


def likely(rounds, result, shares):
    """Rounds of a search up to the first name that is less likely than not.

    Parameters
    ----------
    rounds : list of search.Round. result : verdict.Outcome of them. shares : from `probabilities`.

    Returns
    -------
    rounds : list of search.Round; the last one chose nothing where a name was refused.
    refused : search.Round that chose the name that is refused, or None.
    """
    answers = {tuple(answer.split(" + ")): share for answer, share in shares.items()}
    for number, step in enumerate(result.steps, 1):
        wanted = [{s.chosen.effect.id, *s.tied} for s in result.steps[:number]]
        with_all = [names for names in answers if all(set(names) & one for one in wanted)]
        if sum(answers[names] for names in with_all) < LIKELY:
            return up_to(rounds, step), step
    return rounds, None


def _bends(effect):
    """Whether a fit moves more than one number of an effect."""
    return len(frees_of(effect)) > 1


def sure_beside(rounds, result, shares):
    """Rounds in which beside the likeliest name only those that are sure, or of one number, are.

    What another choice of the parts leaves out is seldom right beside a name that explains more: a
    course over SoC, or a shape with a size, bends to what the first name's own form leaves. One
    number (an offset, a leak) cannot, and has to be likely only. What is no name stays in the model
    without one.

    Parameters
    ----------
    rounds : list of search.Round. result : verdict.Outcome of them. shares : probabilities as told.

    Returns
    -------
    rounds : list of search.Round.
    """
    odds = [probability_of(shares, (s.chosen.effect.id, *s.tied)) for s in result.steps]
    likeliest = max(odds, default=1.0)
    pairs = zip(result.steps, odds, strict=True)
    unsure = {id(s) for s, p in pairs if p < min(SURE, likeliest) and _bends(s.chosen.effect)}
    for place in [n for n, step in enumerate(rounds) if id(step) in unsure]:
        step = rounds[place]
        dropped = (*step.dropped, step.chosen.effect.key)
        later = [s._replace(small=(*s.small, step.chosen)) for s in rounds[place + 1 :]]
        nameless = step._replace(chosen=None, tied=(), dropped=dropped, unsure=step.chosen)
        rounds = [*rounds[:place], nameless, *later]
    return rounds
