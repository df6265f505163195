"""The search: a model without effects, then round by round the effect by which it predicts best.

1. Forward: of the effects that the score test shows the best are fitted; that with the largest
   gain in predictive density (`score`) joins the model, if the gain is surely above none.
2. Backward: all are refitted together, and without each; the least that gains less goes again.

What joins need not be a name: that is decided of all together in the end (`verdict`). An effect
that is real and too small to be named belongs in the model as well, or it would be in the sizes of
others; and so does what the vocabulary has no name for.

What is searched is a case: a cell (`case.Case`) or a parallel group (`groups.case.GroupCase`).
Both have these methods and values:

`possible(library)` : dict of Effect by key that its records excite.
`begun()` : free parameters of the healthy model, its first values, and filters of a first noise.
`with_effect(free, effect)` : free parameters beside those of an effect.
`problem(effects, free, filters)` : the fit of a model with effects, `least_squares.Problem`.
`candidates(effects, solution, possible, further)` : what each further effect would change,
    list of `candidates.Candidate`.
`filters_for(residual, filters, earlier)` : whitening by the noise of a residual (`.noise`, `.fit`),
    and the blocks of the records (`.blocks`).
`sharper(trials, filters)` : the same where the trials show another noise, or misfit that
    none of them removes, else None.
`screened(candidates, before, free, possible, filters)` : scores, best first; keys of hidden ones.
`state(effects, solution, filters)` : a fit and its errors on the records that judge, `State`.
`densities(state, filters)` : log predictive density of each block by a fitted model.
`floor(before, free, residual, filters, earlier)` : what no effect can explain, `floor.Floor`.
`denied(trials)`, `ties(trial, tied, denied, possible)` : by measurements outside the fit.
`gates`, `misled(before, trial)` : limits; whether kept derivatives were too far off.
`settled` : fall of the cost that ends a fit. `keeps_derivatives` : whether they serve a refit to
    another noise.
"""

from typing import NamedTuple

import numpy as np

from cellwright.effects.candidates import (
    CHORD_STEPS,
    State,
    Trial,
    compared,
    frees_of,
    most_telling,
    polished,
    residual_with_all,
    scores_to_refit,
    tried,
)
from cellwright.effects.floor import left_volt
from cellwright.effects.library.outside import OUTSIDE
from cellwright.effects.library.vocabulary import in_order
from cellwright.effects.score import difference
from cellwright.numerics.least_squares import fit

POLISH_STEPS, NOISE_STEPS = 4, 3
SHARPENED = 2  # how often at most a round is repeated with another noise


class Round(NamedTuple):
    """One round of the search: the model before it, the trials, and the choice.

    before : State without the choice. filters : whitening of both sides and blocks, by which
    `before` and the trials were fitted and compared. floor : floor.Floor. scores : list of Score,
    best first. trials : list of Trial, best first. chosen : Trial that joins the model, or None.
    hidden : keys of effects that these records cannot show. dropped : keys of effects that gain
    too little once all are refitted together. denied : keys of effects that a measurement outside
    the fit contradicts.
    """

    before: State
    filters: object
    floor: object
    scores: list
    trials: list
    chosen: Trial | None
    hidden: tuple
    dropped: tuple = ()
    denied: frozenset = frozenset()

    @property
    def noise(self):
        """Noise of the readings: noise.Noise, of a group a tuple of them, one a channel."""
        return self.filters.noise

    @property
    def allowed(self):
        """Trials that no measurement contradicts, the best of each effect."""
        kept = {}
        for trial in self.trials:
            if trial.effect.key not in self.denied:
                kept.setdefault(trial.effect.key, trial)
        return list(kept.values())


class Beside(NamedTuple):
    """An effect of a model beside all others in it.

    trial : Trial of the whole model, its gain that of this effect. before : State refitted without
    it. tied : keys of effects that predict as well in its place.
    """

    trial: Trial
    before: State
    tied: tuple = ()

    @property
    def effect(self):
        """The Effect."""
        return self.trial.effect


class Found(NamedTuple):
    """What a search ends with.

    case, possible : what was searched, and its effects by key. rounds : list of Round; the last one
    chose nothing. model, last : with all effects, and its State. beside : tuple of Beside, of each
    effect in it, in order of addition. filters : of the last round.
    """

    case: object
    possible: dict
    rounds: list
    model: object
    last: State
    beside: tuple
    filters: object

    @property
    def first(self):
        """State of the model without effects."""
        return self.rounds[0].before

    @property
    def floor(self):
        """What no effect can explain: floor.Floor."""
        return self.rounds[0].floor

    def with_only(self, effects):
        """State of the model refitted with some of its effects alone."""
        kept = tuple(effect for effect in self.model.effects if effect in effects)
        if kept == self.model.effects:
            return self.last
        model = _refitted(self.case, self.possible, self.model._replace(effects=kept), self.filters)
        return _state(self.case, self.possible, model, self.filters)

    def gain_elsewhere(self, one):
        """What an effect gains elsewhere, over a model without it that the block that tells most of
        the effect does not bend: score.Difference of the other blocks.

        Not in closed form: what an effect takes up, a knee, bends all of a model that lacks it.

        Parameters
        ----------
        one : Beside.
        """
        blocks = self.filters.blocks
        telling = most_telling(self.last, one.effect, blocks)
        others = tuple(effect for effect in self.model.effects if effect is not one.effect)
        unbent = self.model._replace(effects=others, solution=one.before.solution)
        rows = blocks.fitted != telling
        unbent = _refitted(self.case, self.possible, unbent, self.filters, fitted=rows)
        states = self.last, _state(self.case, self.possible, unbent, self.filters)
        ends = [np.delete(self.case.densities(s, self.filters), telling) for s in states]
        return difference(*ends, np.delete(blocks.record, telling))


class _Model(NamedTuple):
    """The model so far: free parameters without effects, effects in order of addition, its fit."""

    plain: tuple
    effects: tuple
    solution: object


def search(case, library):
    """Found by the search, until no effect predicts surely better.

    Parameters
    ----------
    case : of a cell or of a group, see above. library : dict of Effect by id.
    """
    possible = case.possible(library)
    free, values, filters = case.begun()
    solution = fit(case.problem((), free, filters), values, settled=case.settled)
    model, rounds, gone = _Model(free, (), solution), [], set()
    while True:
        step, filters = _round(case, possible, model, gone, filters, rounds)
        rounds.append(step)
        model = model._replace(solution=step.before.solution)
        little = left_volt(step.before, step.floor) <= case.gates.material_volt
        if little or len(rounds) > case.gates.rounds:
            break  # nothing that is left could be material
        taken, dropped = _taken(case, possible, model, step, filters)
        gone |= set(dropped)
        rounds[-1] = step._replace(dropped=tuple(dropped), chosen=taken and taken[0])
        if taken is None:
            break
        model = taken[1]
    model, beside, _ = _needed(case, possible, model, filters)
    last = _state(case, possible, model, filters)
    beside = _with_ties(case, possible, model, beside, rounds, filters)
    return Found(case, possible, rounds, model, last, beside, filters)


def _taken(case, possible, model, step, filters):
    """The Trial of a round that joins, the model with it; or None. And keys of what gains too
    little once all are refitted."""
    dropped = []
    for trial in step.allowed:
        if trial.gain.z < case.gates.joins or trial.gain.total <= 0.0:
            continue
        effects = (*model.effects, trial.effect)
        begun = model._replace(effects=effects, solution=trial.state.solution)
        refitted = _refitted(case, possible, begun, filters)
        known = {trial.effect.key: step.before}
        needed, _, without = _needed(case, possible, refitted, filters, known)
        if trial.effect in needed.effects:
            return (trial, needed), [*dropped, *without]
        dropped.append(trial.effect.key)
    return None, dropped


def _free_of(case, model):
    """Free parameters of a model."""
    free = model.plain
    for effect in model.effects:
        free = case.with_effect(free, effect)
    return free


def _state(case, possible, model, filters):
    """State of a fitted model."""
    return case.state(in_order(model.effects, possible), model.solution, filters)


def _refitted(case, possible, model, filters, *, fitted=None):
    """The model fitted with new derivatives, to all rows or those alone that are `fitted` (n,)."""
    effects = in_order(model.effects, possible)
    problem = case.problem(effects, _free_of(case, model), filters)
    if fitted is not None:
        whiten = problem.whiten
        problem = problem._replace(whiten=lambda rows: (whiten(rows).T * fitted).T)
    solution = fit(problem, model.solution.values, steps=POLISH_STEPS, settled=case.settled)
    return model._replace(solution=solution)


def _needed(case, possible, model, filters, known=None):
    """The model without effects that gain too little beside all others; Beside of each that is
    left; keys of the others. The least goes first, and the rest is asked anew.

    known : State without an effect, by its key, of those that were fitted already.
    """
    dropped = []
    while model.effects:
        beside = _beside(case, possible, model, filters, known or {})
        least = min(beside, key=lambda one: one.trial.gain.z)
        if least.trial.gain.z >= case.gates.joins:
            return model, beside, dropped
        dropped.append(least.effect.key)
        others = tuple(effect for effect in model.effects if effect is not least.effect)
        model, known = model._replace(effects=others, solution=least.before.solution), None
    return model, (), dropped


def _beside(case, possible, model, filters, known):
    """Beside of each effect of a model: refitted without it."""
    whole = _state(case, possible, model, filters)
    with_all, record = case.densities(whole, filters), filters.blocks.record
    found = []
    for effect in model.effects:
        before = known.get(effect.key) or _without(case, possible, model, effect, whole, filters)
        gain = difference(with_all, case.densities(before, filters), record)
        found.append(Beside(Trial(effect, 0.0, whole, gain), before))
    return tuple(found)


def _without(case, possible, model, effect, whole, filters):
    """State of a model without one of its effects; its derivatives are kept where they hold."""
    others = model._replace(effects=tuple(one for one in model.effects if one is not effect))
    solution = whole.solution
    gone = {free.name for free in frees_of(effect)}
    kept = [k for k, name in enumerate(solution.names) if name not in gone]
    columns = {"columns": solution.columns[:, kept], "white": solution.white[:, kept]}
    effects = in_order(others.effects, possible)
    problem = case.problem(effects, _free_of(case, others), filters)
    if not case.keeps_derivatives:
        return _state(case, possible, _refitted(case, possible, others, filters), filters)
    fitted = fit(problem, solution.values, **columns, steps=CHORD_STEPS)
    state = case.state(effects, fitted, filters)
    if case.misled(whole, Trial(effect, 0.0, state)):
        others = others._replace(solution=fitted)
        return _state(case, possible, _refitted(case, possible, others, filters), filters)
    return state


def _with_ties(case, possible, model, beside, rounds, filters):
    """Beside of each effect, with what predicts as well in its place.

    A rival is refitted in its place. It is tied if its own gain would let it join, and the two are
    less apart than `apart` standard errors. A rival without a name ties with none: it stands for
    whatever the vocabulary lacks, and has to predict better.
    """
    inside, record = {effect.key for effect in model.effects}, filters.blocks.record
    known = []
    for one in beside:
        step = next(s for s in rounds if s.chosen and s.chosen.effect is one.effect)
        rivals = [t for t in step.allowed if t.effect.key not in inside and not t.at_limit]
        rivals = [t for t in rivals if t.effect.id not in OUTSIDE]
        rivals = [t for t in rivals if t.gain.z >= case.gates.joins and _near(step, t, case.gates)]
        both = (one.trial.state, one.before) if rivals else ()
        with_all, without = [case.densities(s, filters) for s in both] or (None, None)
        tied = []
        for rival in rivals:
            names = {name: rival.state.solution.values[name] for name in rival.effect.names}
            values = one.before.solution.values | names
            others = (other for other in model.effects if other is not one.effect)
            begun = model.solution._replace(values=values)
            begun = model._replace(effects=(*others, rival.effect), solution=begun)
            fitted = _refitted(case, possible, begun, filters)
            there = case.densities(_state(case, possible, fitted, filters), filters)
            apart = difference(with_all, there, record).z
            shown = difference(there, without, record).z >= case.gates.joins
            tied += [rival.effect.key] if shown and apart < case.gates.apart else []
        tied = case.ties(one.trial, tuple(tied), step.denied, possible)
        known.append(one._replace(tied=tied))
    return tuple(known)


def _near(step, rival, gates):
    """Whether a rival may be tied with the choice of a round: it was not surely worse there."""
    apart = difference(step.chosen.density, rival.density, step.filters.blocks.record)
    return apart.z < gates.counts


def _round(case, possible, model, gone, filters, earlier):
    """The next Round, without a choice, and its filters; repeated while its trials ask for others
    (`sharper`)."""
    effects, solution = in_order(model.effects, possible), model.solution
    free = _free_of(case, model)
    further = {
        key: effect for key, effect in possible.items() if effect not in effects and key not in gone
    }
    candidates = case.candidates(effects, solution, possible, tuple(further.values()))
    residual = residual_with_all(solution, candidates, filters.fit)
    filters = case.filters_for(residual, filters, earlier)
    trials, sharper = (), filters
    for again in range(SHARPENED, -1, -1):
        filters = sharper
        step = _tested(case, possible, effects, free, solution, filters, candidates, trials)
        solution, trials = step.before.solution, step.trials
        sharper = case.sharper(trials, filters) if trials and again else None
        if sharper is None:
            break
    floor = case.floor(step.before, free, residual, filters, earlier)
    denied = frozenset(case.denied(step.trials))
    return step._replace(floor=floor, denied=denied), filters


def _tested(case, possible, effects, free, solution, filters, candidates, earlier):
    """A Round without a choice: refit to the noise, screen, try the best.

    earlier : Trials of the same round with another noise; a trial begins where it ended there.
    """
    problem = case.problem(effects, free, filters)
    columns = solution.columns if case.keeps_derivatives else None
    steps = {"steps": NOISE_STEPS, "settled": case.settled}
    solution = fit(problem, solution.values, columns=columns, **steps)
    before = case.state(effects, solution, filters)
    scores, hidden = case.screened(candidates, before, free, possible, filters)
    ends = {trial.effect.key: trial.state for trial in reversed(earlier)}
    trials = [
        tried(case, possible, free, before, score, filters, ends.get(score.candidate.effect.key))
        for score in scores_to_refit(scores, ends, case.gates.refits)
    ]
    trials = compared(case, before, trials, filters)
    trials = polished(case, free, before, trials, filters)
    return Round(before, filters, None, scores, trials, None, hidden)
