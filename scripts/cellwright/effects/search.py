"""The search: a model without effects, then round by round the effect by which it predicts best.

1. Forward: of the effects that the score test shows the best are fitted; that with the largest
   gain in predictive density (`score`) joins the model, if the gain is surely above none.
2. Backward: all are refitted together, and without each; the least that gains less goes again.
3. Where none joins and much is left, all that the last round tried are fitted together, and go
   backward: of effects that need each other (a course over SoC and slow diffusion) none gains by
   itself. If they predict surely better the search goes on from there.

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
from cellwright.numerics.least_squares import TWO_STDS, fit, level

POLISH_STEPS, NOISE_STEPS, TOGETHER_STEPS = 4, 3, 12
MOST_ROUNDS = 12  # twice the effects that join one by one: before some join together, and after
EVEN_STD = 0.95 / 4  # of an even distribution's width: two deviations hold 95 %
LEVELLED = 3  # how often at most a delay's interval is looked for
SHARPENED = 2  # how often at most a round is repeated with another noise


class Round(NamedTuple):
    """One round of the search: the model before it, the trials, and the choice.

    before : State without the choice. filters : whitening of both sides and blocks, by which
    `before` and the trials were fitted and compared. floor : floor.Floor. scores : list of Score,
    best first. trials : list of Trial, best first. joined : tuple of Trial that join the model, one
    or, where none does by itself, some together.
    hidden : keys of effects that these records cannot show. dropped : keys of effects that gain
    too little once all are refitted together. denied : keys of effects that a measurement outside
    the fit contradicts.
    """

    before: State
    filters: object
    floor: object
    scores: list
    trials: list
    joined: tuple
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


def joins(gain, gates):
    """Whether a gain lets an effect join a model: surely above none, by its sum or by its ranks.

    Of a few blocks that lose much the standard error is their own, and the sum is never sure; what
    the ranks of all blocks would let be a name joins as well.

    Parameters
    ----------
    gain : score.Difference. gates : case.Gates.
    """
    return gain.total > 0.0 and (gain.z >= gates.joins or gain.rank_z >= gates.counts)


class _Model(NamedTuple):
    """The model so far: free parameters without effects, effects in order of addition, its fit.

    level : parameters of effects, Free, of which readings tell an interval alone: see `_levelled`.
    """

    plain: tuple
    effects: tuple
    solution: object
    level: tuple = ()


def search(case, library):
    """Found by the search, until no effect predicts surely better.

    Parameters
    ----------
    case : of a cell or of a group, see above. library : dict of Effect by id.
    """
    possible = case.possible(library)
    free, values, filters = case.begun()
    solution = fit(case.problem((), free, filters), values, settled=case.settled)
    model, rounds, gone, together = _Model(free, (), solution), [], set(), False
    while True:
        step, filters = _round(case, possible, model, gone, filters, rounds)
        rounds.append(step)
        model = model._replace(solution=step.before.solution)
        left = left_volt(step.before, step.floor)
        if left <= case.gates.material_volt or len(rounds) > MOST_ROUNDS:
            break  # what is left could not be material, or too much was tried
        joined, taken, dropped = _taken(case, possible, model, step, filters)
        gone |= set(dropped)
        if not joined and not together and left > case.gates.unknown_volt:
            together = True
            joined, taken = _together(case, possible, model, step, filters)
            gone = set()  # beside others they may gain
        rounds[-1] = step._replace(dropped=tuple(dropped), joined=joined)
        if not joined:
            break
        model = _levelled(case, possible, taken, joined, filters)
    model, beside, _ = _needed(case, possible, model, filters)
    last = _state(case, possible, model, filters)
    beside = _with_ties(case, possible, model, beside, rounds, filters)
    return Found(case, possible, rounds, model, last, beside, filters)


def _taken(case, possible, model, step, filters):
    """Trials of a round that join (one or none), the model with them, and keys of what gains too
    little once all are refitted."""
    dropped = []
    trials = _in_turn(step, case.gates) if len(model.effects) < case.gates.rounds else ()
    for trial in trials:
        if not joins(trial.gain, case.gates) or not pays(step.before, trial.state, case.gates):
            continue
        effects = (*model.effects, trial.effect)
        begun = model._replace(effects=effects, solution=trial.state.solution)
        refitted = _refitted(case, possible, begun, filters)
        known = {trial.effect.key: step.before}
        needed, _, without = _needed(case, possible, refitted, filters, known)
        if trial.effect in needed.effects:
            return (trial,), needed, [*dropped, *without]
        dropped.append(trial.effect.key)
    return (), model, dropped


def _together(case, possible, model, step, filters):
    """Trials of a round that join together, and the model with them; else none, and the model.

    They are those that are needed once all are fitted, if that model predicts surely better.
    """
    trials = []
    for trial in step.allowed:
        tied = any(_exactly_tied(trial.effect, other.effect) for other in trials)
        if trial.effect.id not in OUTSIDE and not tied:
            trials.append(trial)
    if len(trials) < 2:
        return (), model
    sizes = {name: t.state.solution.values[name] for t in trials for name in t.effect.names}
    solution = model.solution._replace(values=model.solution.values | sizes)
    effects = (*model.effects, *(trial.effect for trial in trials))
    begun = model._replace(effects=effects, solution=solution)
    whole = _refitted(case, possible, begun, filters, steps=TOGETHER_STEPS)
    needed, _, _ = _needed(case, possible, whole, filters, closely=False)
    needed = _refitted(case, possible, needed, filters)
    ends = (_state(case, possible, needed, filters), step.before)
    gain = difference(*(case.densities(end, filters) for end in ends), filters.blocks.record)
    if not joins(gain, case.gates):
        return (), model
    return tuple(t for t in trials if t.effect in needed.effects), needed


def _levelled(case, possible, model, joined, filters):
    """The model with each delay that joined, and of which the readings tell an interval alone, in
    its middle.

    There it is as sure as the normal distribution that has as wide a 95 % interval. A fit that
    stood in a step of the likelihood falls by it, and the interval is looked for again.
    """
    for name in (one.effect.names[0] for one in joined if one.effect.hold_imitates):
        others = tuple(one for one in model.level if one.name != name)
        for _ in range(LEVELLED):
            free, before = free_of(case, model._replace(level=others)), model.solution
            problem = case.problem(in_order(model.effects, possible), free, filters)
            ends = None if name in before.at_bound else level(problem, before, name)
            if ends is None:
                break
            known = {"prior": sum(ends) / 2, "std": EVEN_STD * (ends[1] - ends[0])}
            one = next(one for one in free if one.name == name)._replace(**known)
            solution = before._replace(values=before.values | {name: one.prior})
            model = model._replace(level=(*others, one), solution=solution)
            model = _refitted(case, possible, model, filters)
            if before.chi_square - model.solution.chi_square < TWO_STDS:
                break
    return model


def _exactly_tied(one, other):
    """Whether no test tells two effects apart; fitted together they have no sizes."""
    pairs = ((one, other), (other, one))
    return any(tie.exact and tie.partner == b.id for a, b in pairs for tie in a.ties)


def free_of(case, model):
    """Free parameters of a model, tuple of least_squares.Free."""
    free, known = model.plain, {one.name: one for one in model.level}
    for effect in model.effects:
        free = case.with_effect(free, effect)
    return tuple(known.get(one.name, one) for one in free)


def _state(case, possible, model, filters):
    """State of a fitted model."""
    return case.state(in_order(model.effects, possible), model.solution, filters)


def _refitted(case, possible, model, filters, *, fitted=None, steps=POLISH_STEPS):
    """The model fitted with new derivatives, to all rows or those alone that are `fitted` (n,)."""
    effects = in_order(model.effects, possible)
    problem = case.problem(effects, free_of(case, model), filters)
    if fitted is not None:
        whiten = problem.whiten
        problem = problem._replace(whiten=lambda rows: (whiten(rows).T * fitted).T)
    solution = fit(problem, model.solution.values, steps=steps, settled=case.settled)
    return model._replace(solution=solution)


def _needed(case, possible, model, filters, known=None, *, closely=True):
    """The model without effects that gain too little beside all others; Beside of each that is
    left; keys of the others. The least goes first, and those that gain too little are asked anew;
    without it the others gain more, if anything, and are asked again when all of these are.

    known : State without an effect, by its key, of those that were fitted already.
    closely : fit again with new derivatives what kept ones may have misled.
    """
    dropped, asked = [], model.effects
    while asked:
        beside = _beside(case, possible, model, asked, filters, known or {}, closely=closely)
        needless = [one for one in beside if not _stays(one, case.gates)]
        if not needless and asked == model.effects:
            return model, beside, dropped
        asked = ()
        if needless:
            least = min(needless, key=lambda one: one.trial.gain.z)
            dropped.append(least.effect.key)
            others = tuple(effect for effect in model.effects if effect is not least.effect)
            model, known = model._replace(effects=others, solution=least.before.solution), None
            asked = tuple(one.effect for one in needless if one is not least)
        asked = asked or model.effects
    return model, (), dropped


def pays(without, with_it, gates):
    """Whether an effect lowers the cost of the fit by its price; of a cell none is asked.

    without, with_it : State of either model.
    """
    fall = without.solution.cost - with_it.solution.cost
    return gates.price is None or fall > gates.price


def _stays(one, gates):
    """Whether an effect is needed beside all others.

    Where it has a price the cost decides: its twins together may imitate it in the density and be
    far from as good a model, and what remains has to be surely no worse.
    """
    if gates.price is None:
        return joins(one.trial.gain, gates)
    return pays(one.before, one.trial.state, gates)


def _in_turn(step, gates):
    """Trials of a round, best first; those that predict as well by the cost, where it counts."""
    if gates.price is None or not step.allowed:
        return step.allowed
    (best, *others), record = step.allowed, step.filters.blocks.record
    worse = [difference(best.density, t.density, record).z >= gates.apart for t in others]
    alike = [best, *(t for t, surely in zip(others, worse, strict=True) if not surely)]
    behind = [t for t, surely in zip(others, worse, strict=True) if surely]
    return [*sorted(alike, key=lambda t: t.state.solution.cost), *behind]


def _beside(case, possible, model, asked, filters, known, *, closely):
    """Beside of each effect of a model that is asked for: refitted without it."""
    whole = _state(case, possible, model, filters)
    with_all, record = case.densities(whole, filters), filters.blocks.record
    found = []
    for effect in asked:
        before = known.get(effect.key)
        if before is None:
            before = _without(case, possible, model, effect, whole, filters, closely=closely)
        gain = difference(with_all, case.densities(before, filters), record)
        found.append(Beside(Trial(effect, 0.0, whole, gain), before))
    return tuple(found)


def _without(case, possible, model, effect, whole, filters, *, closely):
    """State of a model without one of its effects; its derivatives are kept where they hold."""
    others = model._replace(effects=tuple(one for one in model.effects if one is not effect))
    solution = whole.solution
    gone = {free.name for free in frees_of(effect)}
    kept = [k for k, name in enumerate(solution.names) if name not in gone]
    columns = {"columns": solution.columns[:, kept], "white": solution.white[:, kept]}
    effects = in_order(others.effects, possible)
    problem = case.problem(effects, free_of(case, others), filters)
    if not case.keeps_derivatives:
        return _state(case, possible, _refitted(case, possible, others, filters), filters)
    fitted = fit(problem, solution.values, **columns, steps=CHORD_STEPS)
    state = case.state(effects, fitted, filters)
    if closely and case.misled(whole, Trial(effect, 0.0, state)):
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
        at_last = ((s, t) for s in reversed(rounds) for t in s.joined if t.effect is one.effect)
        step, joined = next(at_last)
        rivals = [t for t in step.allowed if t.effect.key not in inside and not t.at_limit]
        rivals = [t for t in rivals if t.effect.id not in OUTSIDE]
        rivals = [
            t for t in rivals if t.gain.z >= case.gates.joins and _near(step, joined, t, case.gates)
        ]
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


def _near(step, joined, rival, gates):
    """Whether a rival may be tied with what joined in a round: it was not surely worse there."""
    apart = difference(joined.density, rival.density, step.filters.blocks.record)
    return apart.z < gates.counts


def _round(case, possible, model, gone, filters, earlier):
    """The next Round, without a choice, and its filters; repeated while its trials ask for others
    (`sharper`)."""
    effects, solution = in_order(model.effects, possible), model.solution
    free = free_of(case, model)
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
    return Round(before, filters, None, scores, trials, (), hidden)
