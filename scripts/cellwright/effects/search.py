"""The search: a model without effects, then round by round the effect that explains most.

What is searched is a case: a cell (`case.Case`) or a parallel group (`groups.case.GroupCase`).
Both have these methods and values:

`possible(library)` : dict of Effect by key that its records excite.
`begun()` : free parameters of the healthy model, its first values, and filters of a first noise.
`with_effect(free, effect)` : free parameters beside those of an effect.
`problem(effects, free, filters)` : the fit of a model with effects, `least_squares.Problem`.
`candidates(effects, solution, possible, further)` : what each further effect would change,
    list of `candidates.Candidate`.
`filters_for(residual, filters, earlier)` : whitening by the noise of a residual (`.noise`, `.fit`).
`sharper(trials, filters)` : the same where the trials show another noise, or misfit that
    none of them removes, else None.
`screened(candidates, before, free, possible, filters)` : scores, best first; keys of hidden ones.
`state(effects, solution, filters)` : a fit and its errors on the records that judge, `State`.
`floor(before, free, residual, filters, earlier)` : what no effect can explain, `proof.Floor`.
`proof(before, after, filters, inflations)` : how evenly an effect helps; whether records that judge
    can tell.
`inflation(state)`, `falls(before, after)`, `rows_per_record()` : by how much the chi-square of each
    record is too large, its fall, by role; rows of each record fitted.
`matters(first, before, trial, floor, share)` : when the size of an effect counts.
`denied(trials)`, `ties(chosen, tied, denied, possible)` : by measurements outside the fit.
`gates`, `polish_share`, `misled(before, trial)` : limits; which trials go on.
`most_small` : how many effects that are too small for a name may join a model.
`settled` : fall of the cost that ends a fit. `keeps_derivatives` : whether they serve a refit to
    another noise.
"""

from typing import NamedTuple

from cellwright.effects.candidates import (
    State,
    Trial,
    judged,
    polished,
    residual_with_all,
    scores_to_refit,
    trial_of,
    tried,
)
from cellwright.effects.proof import (
    explained,
    followed,
    judged_well,
    left_volt,
    prominent,
    significant,
)
from cellwright.numerics.least_squares import fit

POLISH_STEPS, NOISE_STEPS = 4, 3
SHARPENED = 2  # how often at most a round is repeated with another noise
STAYS = 0.7  # of the size from which an effect counts: with that much, one that was chosen stays
OUTDONE = 0.5  # of the best J: no effect below it is chosen, where the better ones are immaterial


class Round(NamedTuple):
    """One round of the search: the model before it, the trials, and the choice.

    before : State without the choice. filters : whitening of both sides, by which `before` and the
    trials were fitted and judged. floor : proof.Floor. scores : list of Score, best first.
    trials : list of Trial, best first. chosen : Trial, or None. tied : keys that explain as
    much.
    hidden : keys of effects that these records cannot show. dropped : keys of earlier effects that
    do not count any more beside the choice. beside : Without of each name, the choice among them,
    once all were refitted together. small : Trials of effects that are in the model before it
    without a name, too small or too unsure for one. unsure : Trial of what it chose, and what is in
    the model after it without a name, for it is not sure; or None.
    """

    before: State
    filters: object
    floor: object
    scores: list
    trials: list
    chosen: Trial | None
    tied: tuple
    hidden: tuple
    dropped: tuple = ()
    beside: tuple = ()
    small: tuple = ()
    unsure: Trial | None = None

    @property
    def noise(self):
        """Noise of the readings: noise.Noise, of a group a tuple of them, one a channel."""
        return self.filters.noise


def search(case, library):
    """Rounds of the search, until no effect of the library is proven to explain more.

    Parameters
    ----------
    case : of a cell or of a group, see above. library : dict of Effect by id.

    Returns
    -------
    rounds : list of Round; the last one chose nothing, or was the last allowed.
    """
    possible = case.possible(library)
    free, values, filters = case.begun()
    solution = fit(case.problem((), free, filters), values, settled=case.settled)
    model, rounds, looked = _Model(free, (), free, solution), [], False
    while len(rounds) <= case.gates.rounds:
        step, model, filters = _round_beside_small(case, possible, model, filters, rounds)
        rounds.append(step)
        if len(rounds) > case.gates.rounds:
            break
        taken = _taken(case, possible, model, filters, rounds)
        if taken is None and step.chosen is not None:
            # At the edge of what counts. Neither may a rival that explains less take its place, nor
            # is an earlier name needless beside a choice that does not count itself.
            rounds[-1] = step._replace(chosen=None, tied=(), dropped=(step.chosen.effect.key,))
        if taken is None and not looked:
            looked = True
            taken = _looked_ahead(case, possible, model, filters, rounds)
        if taken is None:
            break
        rounds, model, filters, possible = taken
    return rounds


def _taken(case, possible, model, filters, rounds):
    """Rounds, model, filters and possible effects with the choice of the last round.

    None: it chose nothing, or what does not count once all is refitted.
    """
    *earlier, step = rounds
    if step.chosen is None:
        return None
    with_choice = _with_choice(case, model, step.chosen, filters)
    needed, dropped, beside = _needed(case, with_choice, filters, rounds)
    mine = dropped.get(step.chosen.effect.key)
    if mine is None:
        left = {key: effect for key, effect in possible.items() if key not in dropped}
        last = step._replace(dropped=tuple(dropped), beside=beside)
        return [*earlier, last], needed, filters, left
    if _is_small(case, model, mine):
        # Too small for a name now that all is refitted, and there all the same.
        return earlier, _unnamed(case, with_choice, step.chosen), filters, possible
    cheaper = step.before.solution.cost - needed.solution.cost > case.gates.bic
    if cheaper and _keys(needed.effects) == _keys(model.effects):
        # The round began at a minimum that is not the least: by way of its choice the same model
        # got further. It is asked anew from there.
        return earlier, needed, filters, possible
    return None


def _is_small(case, model, trial):
    """Whether the effect of a trial is there, and there is room for one more without a name."""
    there = significant(case.gates, trial) and not trial.at_limit
    return there and len(model.small) < case.most_small


class _Model(NamedTuple):
    """The model so far, fitted.

    plain : free parameters but those of effects with a name. effects : all in the model.
    free : all free parameters. solution : of the fit. small : Trials of the effects in it that are
    too small for a name.
    """

    plain: tuple
    effects: tuple
    free: tuple
    solution: object
    small: tuple = ()

    @property
    def named(self):
        """Effects that have a name."""
        unnamed = {trial.effect.key for trial in self.small}
        return tuple(e for e in self.effects if e.key not in unnamed)


def _unnamed(case, model, trial):
    """The model with the effect of a trial, which is in it, as one too small for a name."""
    plain = case.with_effect(model.plain, trial.effect)
    return model._replace(plain=plain, small=(*model.small, trial))


def _with_choice(case, model, trial, filters):
    """The model with the effect of a trial, refitted with new derivatives."""
    free, effects = case.with_effect(model.free, trial.effect), trial.state.effects
    problem = case.problem(effects, free, filters)
    values = trial.state.solution.values
    solution = fit(problem, values, steps=POLISH_STEPS, settled=case.settled)
    return model._replace(effects=effects, free=free, solution=solution)


def _round_beside_small(case, possible, model, filters, earlier):
    """The next Round, the model it begins from, and its filters.

    What explains most may be too small for anyone to act on: a healthy cell's resistance falls a
    little with temperature, too. It is there all the same, and what it leaves would count as misfit
    against all others. It joins the model without a name, and the others are tried beside it.
    """
    while True:
        step, filters = _round(case, possible, model, filters, earlier)
        trial = _best_too_small(case, step, earlier) if len(model.small) < case.most_small else None
        if trial is None:
            return step._replace(small=model.small), model, filters
        model = _unnamed(case, _with_choice(case, model, trial, filters), trial)


def _looked_ahead(case, possible, model, filters, rounds):
    """As `_taken`, where the last round chose nothing; None: nothing is found by this either.

    What helps unevenly may do so for another effect that is missing there. Where an error is left
    that somebody would act on, what explains most but for that is taken for a while, and the round
    after it asked. What joins there without a name is in the model before either, and the round is
    repeated; of two names each has to count beside the other, and is told as it does there.
    """
    *earlier, step = rounds
    trial = _uneven(case, (earlier or [step])[0].before, step)
    if trial is None:
        return None
    tied = case.ties(trial, (), case.denied(step.trials), possible)
    first = [*earlier, step._replace(chosen=trial, tied=tied, dropped=())]
    begun = _with_choice(case, model, trial, filters)
    second, beside, later = _round_beside_small(case, possible, begun, filters, first)
    if second.chosen is not None:
        both = _taken(case, possible, beside, later, [*first, second])
        names = {trial.effect.key, second.chosen.effect.key}
        return _told_beside(both, trial) if both and names <= _keys(both[1].named) else None
    joined = beside.small[len(model.small) :]
    if not joined:
        return None
    for one in joined:
        others = tuple(effect for effect in one.state.effects if effect is not trial.effect)
        alone = one._replace(state=one.state._replace(effects=others))
        model = _unnamed(case, _with_choice(case, model, alone, filters), alone)
    again, model, filters = _round_beside_small(case, possible, model, filters, earlier)
    return _taken(case, possible, model, filters, [*earlier, again])


def _keys(effects):
    return {effect.key for effect in effects}


def _told_beside(taken, trial):
    """What `_taken` returned, with a Trial of the round before the last as it counts in the end."""
    (*earlier, step, last), *rest = taken
    beside = next(one.trial for one in last.beside if one.trial.effect is trial.effect)
    judged = ("delta_bic", "delta_validation", "proof", "proven", "inflation")
    chosen = trial._replace(**{name: getattr(beside, name) for name in judged})
    trials = [chosen if one is trial else one for one in step.trials]
    return [*earlier, step._replace(chosen=chosen, trials=trials), last], *rest


def _uneven(case, first, step):
    """The Trial that explains most of what a round left, but for where it harms; None: none.

    first : State of the healthy model.
    """
    if left_volt(step.before, step.floor) <= case.gates.unknown_volt:
        return None
    trials = allowed(case, step)
    shown = (t for t in trials if followed(case.gates, t) and judged_well(case.gates, t))
    sized = (t for t in shown if case.matters(first, step.before, t, step.floor))
    best = next((t for t in sized if t.proof.sized), None)
    return best if best is not None and best.j >= OUTDONE * trials[0].j else None


def _best_too_small(case, step, earlier):
    """The Trial of a round that explains most beyond chance, where nobody would act on it.

    None where it makes no difference: no other effect has a size that matters, and what is left is
    no more than anyone would accept.
    """
    first = earlier[0].before if earlier else step.before
    if explained(case.gates, step.before, step.floor):
        return None
    trials = allowed(case, step)
    best = next((t for t in trials if significant(case.gates, t)), None)
    if best is None or case.matters(first, step.before, best, step.floor):
        return None
    others = (t for t in trials if t is not best)
    rivals = any(case.matters(first, step.before, t, step.floor) for t in others)
    much = left_volt(step.before, step.floor) > case.gates.unknown_volt
    return best if rivals or much else None


def beside_names(case, first, step):
    """The Trial of a round that follows the records fitted best, of those nobody would act on.

    It is no name, so that no proof is asked but that the records that judge are not followed worse:
    what it takes up is not to be in the sizes of names.

    Parameters
    ----------
    case : as in `search`. first : State of the healthy model. step : Round.
    """
    shown = (t for t in allowed(case, step) if followed(case.gates, t) and t.delta_validation >= 0)
    small = (t for t in shown if not case.matters(first, step.before, t, step.floor))
    return max(small, key=lambda t: t.delta_bic, default=None)


def allowed(case, step):
    """Trials of a round that no measurement outside the fit contradicts, of sizes that can be."""
    denied = case.denied(step.trials)
    return [t for t in step.trials if t.effect.key not in denied and not t.at_limit]


def _needed(case, model, filters, rounds):
    """The model without names that count no more, now that all are refitted together; Trials of
    these, by key; Without of each name that is left.

    What a first effect took up may be the work of the next; each is taken out, the rest refitted,
    and held to what would make it a choice beside the others.
    """
    dropped, without = {}, []
    first, floor = rounds[0].before, rounds[0].floor
    while model.named:
        without = [_without(case, model, one, filters) for one in model.named]
        needless = [o for o in without if not stays(case, first, o.before, o.trial, floor)]
        if not needless:
            break
        weakest = min(needless, key=lambda one: one.trial.j)
        dropped[weakest.trial.effect.key] = weakest.trial
        before = weakest.before
        model = model._replace(effects=before.effects, free=weakest.free, solution=before.solution)
        without = []
    return model, dropped, tuple(without)


class Without(NamedTuple):
    """A model refitted without one of its effects.

    before : State without it. free : of that fit. trial : Trial of the effect beside the others.
    """

    before: State
    free: tuple
    trial: Trial


def stays(case, first, before, trial, floor):
    """Whether an effect still counts beside all others, and is no small part of what they leave.

    Parameters
    ----------
    case : as in `search`. first, before : State of the healthy model, and of the model without the
    effect. trial : Trial of it with its proof. floor : proof.Floor.
    """
    counts = significant(case.gates, trial) and not trial.at_limit
    sized = case.matters(first, before, trial, floor, share=STAYS)
    return counts and sized and prominent(before, trial, floor)


def _without(case, model, effect, filters):
    others = tuple(e for e in model.effects if e is not effect)
    free = model.plain
    for one in model.named:
        free = free if one is effect else case.with_effect(free, one)
    problem = case.problem(others, free, filters)
    refitted = fit(problem, model.solution.values, steps=POLISH_STEPS, settled=case.settled)
    before = case.state(others, refitted, filters)
    trial = trial_of(case, before, effect, model.effects, 0.0, model.solution, filters)
    return Without(before, free, judged(case, before, [trial], filters)[0])


def _round(case, possible, model, filters, earlier):
    """The next Round and its filters; repeated while its trials ask for others (`sharper`)."""
    effects, free, solution = model.effects, model.free, model.solution
    further = {key: effect for key, effect in possible.items() if effect not in effects}
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
    first = earlier[0].before if earlier else step.before
    chosen, tied = best_of(case, first, step.before, allowed(case, step), floor)
    if chosen is not None:
        tied = case.ties(chosen, tied, case.denied(step.trials), possible)
    return step._replace(floor=floor, chosen=chosen, tied=tied), filters


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
    trials = judged(case, before, polished(case, free, before, trials, filters), filters)
    return Round(before, filters, None, scores, trials, None, (), hidden)


def against(case, first, before, trial, floor):
    """What speaks against a trial as a choice, in words: tuple of str, empty for nothing.

    Parameters
    ----------
    case : as in `search`. first, before : State of the healthy model, and of the model so far.
    trial : Trial with its proof. floor : proof.Floor.
    """
    asked = (
        ("no better fit than its parameters alone would give", followed(case.gates, trial)),
        ("the records that judge are not followed better", judged_well(case.gates, trial)),
        ("too small for anyone to act on", case.matters(first, before, trial, floor)),
    )
    return (*(words for words, well in asked if not well), *trial.proof.against)


def best_of(case, first, before, trials, floor):
    """The best trial that counts, and the keys of those that explain as much.

    Parameters
    ----------
    case : as in `search`. first, before : State of the healthy model, and of the model so far.
    trials : list of Trial, best first. floor : proof.Floor.
    """
    if explained(case.gates, before, floor):
        return None, ()
    shown = [t for t in trials if significant(case.gates, t)]
    passed = [t for t in shown if case.matters(first, before, t, floor)]
    if not passed or passed[0].j < OUTDONE * shown[0].j:
        return None, ()
    best = passed[0]
    within = max(case.gates.tie_absolute, case.gates.tie_relative * best.j)
    near = [t.effect.key for t in passed[1:] if best.j - t.j <= within]
    return best, tuple(dict.fromkeys(key for key in near if key != best.effect.key))


def up_to(rounds, refused):
    """Rounds of a search up to one whose choice is refused, and which then chose nothing.

    Effects of its model that were dropped beside that choice or later do not come back by this.

    Parameters
    ----------
    rounds : list of Round. refused : the Round of them.
    """
    place = next(number for number, step in enumerate(rounds) if step is refused)
    gone = {key for step in rounds[place:] for key in step.dropped}
    chose = [step.chosen.effect.key if step.chosen else None for step in rounds]
    place = min([place, *(n for n, key in enumerate(chose[:place]) if key in gone)])
    step = rounds[place]
    dropped = (*step.dropped, step.chosen.effect.key)
    return [*rounds[:place], step._replace(chosen=None, tied=(), dropped=dropped)]
