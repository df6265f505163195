"""The search for what a model lacks: the set of effects by which it predicts best.

1. The plain model is fitted. Noise and the scale of the score, by which all models are compared,
   are made there, and once more at the first model with effects; then they are frozen.
2. About the best model so far a space of further ones is made (`space`). Moves in it lead to the
   set that predicts best (`moves`).
3. That set and its rivals, four at most, are fitted exactly. About the best of all fitted so far
   the next space is made, until no set is better.
4. Each effect of the model is held against exact fits without it, and with others in its place.
   What is not worth its price goes.

What is in the model need not be a name: that is decided in the end (`verdict`). An effect that is
real and too small to be named belongs in the model as well, or it would be in the sizes of others;
and so does what the vocabulary has no name for.

What is searched is a case: a cell (`case.Case`) or a parallel group (`groups.case.GroupCase`).
Both have these methods and values:

`possible(library)` : dict of Effect by key that its records excite.
`begun()` : free parameters of the plain model, its first values, and filters of a first noise.
`with_effect(free, effect)` : free parameters beside those of an effect.
`problem(effects, free, filters)` : the fit of a model with effects, `least_squares.Problem`.
`predict(side, values, effects)` : prediction of the records of a side, "fit" or "validation".
`unsure(values, effects, prediction)` : what is unsure of the validation records, `judge.Unsure`.
`in_volt(rows)` : rows of a prediction as voltages of the channels that errors are told of [V].
`filters_for(residual, filters, first)` : whitening by the noise of a residual (`.noise`, `.fit`,
    `.validation`), and the blocks of the records (`.blocks`).
`state(effects, solution, filters)` : a fit and its errors on both sides, `state.State`.
`floor(state, free, residual, filters)` : what no effect can explain, `floor.Floor`.
`denied(state)`, `ties(effect, state, tied, denied, possible)` : by measurements outside the fit.
`gates`, `settled` : limits, and the fall of the cost that ends a fit.
"""

from typing import NamedTuple

import numpy as np

from cellwright.effects.floor import left_volt
from cellwright.effects.library.outside import OUTSIDE
from cellwright.effects.library.vocabulary import in_order
from cellwright.effects.moves import MANY, best_model, other_forms, rivals
from cellwright.effects.score import difference
from cellwright.effects.space import candidates_beside, space_of
from cellwright.effects.state import State, Yardstick, most_telling, squares_of
from cellwright.numerics.least_squares import STEPS, TWO_STDS, fit, level

EXACT = 4  # models that are fitted exactly from one space
NEAR = 2  # effects beyond the fitted model, up to which its columns are believed
MOST_SPACES = 6
MUCH = 0.25  # of the plain model's error, beyond which the next best models are searched, too
# Nats that a step of a fit must be worth, on trial and in earnest: an effect's price is one.
ROUGHLY, CLOSELY = 0.02, 0.005
TIED = 3  # effects that are fitted exactly in the place of one
SHARE_OF_TIE = 0.5  # of the gain of an effect that another must have in its place
EVEN_STD = 0.95 / 4  # of an even distribution's width: two deviations hold 95 %
LEVELLED = 3  # how often at most a delay's interval is looked for


class Model(NamedTuple):
    """A model that was fitted.

    free : tuple of Free, of its fit. state : State. squares : (b,) see `state.squares_of`.
    """

    free: tuple
    state: State
    squares: np.ndarray

    @property
    def effects(self):
        """Its effects, in the order in which they act."""
        return self.state.effects

    @property
    def keys(self):
        """Keys of its effects, sorted."""
        return tuple(sorted(effect.key for effect in self.effects))


def worth(model, yardstick):
    """What a model is worth, see `state.Yardstick.worth`."""
    density, cost = yardstick.density(model.squares), model.state.solution.cost
    return yardstick.worth(density, cost, len(model.effects))


def _light(model):
    """A model without its derivatives, which are most of its memory."""
    solution = model.state.solution._replace(columns=None, white=None)
    return model._replace(state=model.state._replace(solution=solution))


class Beside(NamedTuple):
    """An effect of a model beside all others in it.

    state : State of the whole model. before : State refitted without the effect. squares : two of
    (b,), of both, see `state.squares_of`. gain : compare.Difference of the two. tied : keys of
    effects that predict as well in its place.
    """

    effect: object
    state: State
    before: State
    squares: tuple
    gain: object
    tied: tuple = ()


class Found(NamedTuple):
    """What a search ends with.

    case, possible : what was searched, and its effects by key. yardstick : state.Yardstick.
    plain, model : Model without effects, and with all that predict better. models : dict of every
    Model that was fitted, by its keys. beside : tuple of Beside, of each effect of the model, that
    with the largest gain first. spaces : space.Space about the plain model, and about the last.
    floor : floor.Floor. denied : keys of effects that a measurement outside the fit contradicts.
    level : Free of delays of which the readings tell an interval alone, see `_centre_delays`.
    """

    case: object
    possible: dict
    yardstick: object
    plain: Model
    model: Model
    models: dict
    beside: tuple
    spaces: tuple
    floor: object
    denied: frozenset
    level: tuple = ()

    @property
    def first(self):
        """State of the model without effects."""
        return self.plain.state

    @property
    def last(self):
        """State of the model with all effects."""
        return self.model.state

    @property
    def filters(self):
        """Whitening and blocks by which all models were compared."""
        return self.yardstick.filters

    @property
    def hidden(self):
        """Keys of effects that these records cannot show at a plausible size."""
        space = self.spaces[0]
        shown = {t.effect.key for t, seen in zip(space.terms, space.visible, strict=True) if seen}
        return tuple(dict.fromkeys(t.effect.key for t in space.terms if t.effect.key not in shown))

    @property
    def _about(self):
        return _About(self.case, self.possible, self.plain.free, self.yardstick, self.level)

    def with_only(self, effects):
        """State of the model refitted with some of its effects alone."""
        kept = tuple(effect for effect in self.model.effects if effect in effects)
        keys = tuple(sorted(effect.key for effect in kept))
        if keys in self.models and self.models[keys].state.solution.white is not None:
            return self.models[keys].state
        return _fit_model(self._about, kept, self.last.solution.values).state

    def gain_elsewhere(self, one):
        """What an effect gains elsewhere, over a model without it that the block that tells most of
        the effect does not bend: compare.Difference of the other blocks.

        Not in closed form: what an effect takes up, a knee, bends all of a model that lacks it.

        Parameters
        ----------
        one : Beside.
        """
        blocks = self.yardstick.blocks
        telling = most_telling(self.last, one.effect, blocks)
        rows = blocks.fitted != telling
        unbent = _fit_model(self._about, one.before.effects, one.before.solution.values, rows=rows)
        ends = [self.yardstick.density(model.squares) for model in (self.model, unbent)]
        ends = [np.delete(density, telling) for density in ends]
        return difference(*ends, np.delete(blocks.record, telling))


class _About(NamedTuple):
    """What every fit of a search needs. free : of the plain model. level : Free of delays of which
    the readings tell an interval alone, see `_centre_delays`. most_volt : the largest
    error of a model on the validation records, see `_best`."""

    case: object
    possible: dict
    free: tuple
    yardstick: object
    level: tuple = ()
    most_volt: float = np.inf


def joins(gain, gates):
    """Whether a gain is surely above none, by its sum or by its ranks.

    Of a few blocks that lose much the standard error is their own, and the sum is never sure; what
    the ranks of all blocks would let be a name counts as well.

    Parameters
    ----------
    gain : compare.Difference. gates : case.Gates.
    """
    return gain.total > 0.0 and (gain.z >= gates.joins or gain.rank_z >= gates.counts)


def search(case, library):
    """Found by the search, until no set of effects predicts better.

    Parameters
    ----------
    case : of a cell or of a group, see above. library : dict of Effect by id.
    """
    possible = case.possible(library)
    free, values, filters = case.begun()
    yardstick = Yardstick(filters)
    if case.gates.price is not None:
        yardstick = yardstick._replace(price=case.gates.price / 2.0, by_cost=True)
    about = _About(case, possible, free, yardstick)
    plain = _fit_model(about, (), values)
    for again in (True, False):
        about, residual = _estimate_noise(about, plain, first=again)
    plain = _fit_model(about, (), plain.state.solution.values)
    most_volt = plain.state.validation_rmse_volt + case.gates.material_volt
    about = about._replace(most_volt=most_volt)
    climb = _Climb(_by_scale_of(about, plain), plain)
    climb.floor = climb.floor_of(residual)
    return _conclude(_climb(climb))


def resume_without(found, ruled_out):
    """Found by the search without some effects, from the models that it has fitted without them.

    Parameters
    ----------
    found : Found. ruled_out : keys of the effects.
    """
    possible = {key: e for key, e in found.possible.items() if key not in ruled_out}
    most_volt = found.first.validation_rmse_volt + found.case.gates.material_volt
    about = _About(found.case, possible, found.plain.free, found.yardstick, (), most_volt)
    climb = _Climb(about, found.plain)
    climb.first, climb.made, climb.floor = found.spaces[0], [()], found.floor
    climb.denied = set(found.denied) | set(ruled_out)
    climb.models = {k: m for k, m in found.models.items() if not climb.denied & set(k)}
    return _conclude(_climb(climb))


def _conclude(climb):
    """What a search has come to once no set of effects predicts better."""
    about, models = climb.about, climb.models
    best = _best(about, models)
    if best.effects:
        best = _fit_model(about, best.effects, best.state.solution.values)
    about, best = _centre_delays(about, best)
    models[best.keys] = best
    best = _drop_worthless(about, best, models)
    last = _space_about(about, best, climb.denied)
    beside = _compare_each(about, best, models, last, climb.denied)
    found = about.case, about.possible, about.yardstick, models[()], best, models, beside
    spaces, denied = (climb.first, last), frozenset(climb.denied)
    return Found(*found, spaces, climb.floor, denied, about.level)


def _best(about, models):
    """The model that predicts best of those that were fitted.

    A model that errs more than the plain one on the validation records, by more than anyone would
    accept (`material_volt`), is not taken: the score has heavy tails, and a few blocks that are
    missed by half a volt, below an empty end, hardly lower it.
    """
    fair = [m for m in models.values() if m.state.validation_rmse_volt <= about.most_volt]
    return _most_worth(about, fair or models.values())


def _most_worth(about, models):
    """The model of the largest worth, however it errs."""
    return max(models, key=lambda model: worth(model, about.yardstick))


def _by_scale_of(about, model):
    """The search with the scale of a model, where that is less."""
    return about._replace(yardstick=about.yardstick.finer(model.squares))


class _Climb:
    """A search on its way: every model that was fitted, by its keys, and the spaces made.

    first : space.Space about the plain model. made : keys of the models about which one was made.
    tried : labels of the models that were fitted, keys and forms.
    """

    def __init__(self, about, plain):
        self.about, self.models = about, {(): plain}
        self.made, self.denied, self.first, self.floor = [], set(), None, None
        self.tried = set()

    def floor_of(self, residual):
        """What no effect can explain, by what all effects together leave (n,)."""
        plain, filters = self.models[()], self.about.yardstick.filters
        return self.about.case.floor(plain.state, plain.free, residual, filters)

    def next_model(self):
        """The model about which the next space is made: the best one about which none was; None
        where the best of all was asked already and leaves little.

        About the plain model little is linear, and about a poor one not much: after it the best
        model with effects is asked, better or not.
        """
        best = _best(self.about, self.models)
        others = {keys: m for keys, m in self.models.items() if keys not in self.made}
        if not others:
            return None
        # It may leave more than anyone would accept, and a fair part of the plain one's error:
        # another way up may lead further.
        was, now = (left_volt(one.state, self.floor) for one in (self.models[()], best))
        much = now > max(self.about.case.gates.unknown_volt, MUCH * was)
        if best.keys in self.made and len(self.made) > 1 and not much:
            return None
        return _most_worth(self.about, others.values())

    def add(self, model):
        """Keep a model, unless a measurement contradicts one of its effects."""
        against = self.about.case.denied(model.state)
        self.denied |= against
        known, yardstick = self.models.get(model.keys), self.about.yardstick
        if not against and (known is None or worth(model, yardstick) > worth(known, yardstick)):
            self.models[model.keys] = _light(model)

    def freeze(self, model):
        """Make the noise anew at the first model with effects, by which all are compared; the model
        fitted by it."""
        self.about, residual = _estimate_noise(self.about, model)
        plain = self.models[()]
        plain = _fit_model(self.about, (), plain.state.solution.values)
        model = _fit_model(self.about, model.effects, model.state.solution.values, roughly=True)
        self.about = _by_scale_of(self.about, model)
        self.models = {(): plain}
        self.floor = self.floor_of(residual)
        return model


def _climb(climb):
    """The search once no further space leads to a better model, or as many were made as may be."""
    while len(climb.made) < MOST_SPACES and (start := climb.next_model()) is not None:
        if start.effects:
            start = _fit_model(climb.about, start.effects, start.state.solution.values)
            climb.models[start.keys] = _light(start)
            climb.about = _by_scale_of(climb.about, start)
        climb.made.append(start.keys)
        space = _space_about(climb.about, start, climb.denied)
        climb.first = climb.first or space
        frozen = len(climb.made) > 1
        climb.tried.add(space.label(space.inside))
        for chosen in _propose(space, climb.about.case.gates, climb.denied, climb.tried):
            climb.tried.add(space.label(chosen))
            effects = [space.terms[k].effect for k in chosen]
            values = space.values_of(chosen, start.state.solution.values)
            model = _fit_model(climb.about, effects, values, roughly=True)
            climb.add(model if frozen else climb.freeze(model))
            frozen = True
    return climb


def _propose(space, gates, denied, tried):
    """Models of a space that are worth an exact fit.

    The best by moves near the fitted model, whose columns hold there, also with its new effects in
    their other forms; the best of all; and rivals. tried : labels of the models that were fitted.
    """
    begun = dict.fromkeys((space.inside, frozenset()))
    about = {"barred": denied, "fitted": tried - {space.label(space.inside)}}
    ends = [best_model(space, begun, gates, most=most, **about) for most in (NEAR, MANY)]
    wanted = {space.label(one): one for one in ends if space.label(one) not in tried}
    further = rivals(space, ends[0], gates, barred=denied, fitted={*tried, *wanted})
    first = [*wanted.values(), *further][:1]
    forms = [
        one for model in first for one in other_forms(space, model, barred=denied, fitted=tried)
    ]
    models = [*wanted.values(), *further][:EXACT]
    return [*models, *(one for one in forms if one not in models)]


def _space_about(about, model, denied):
    """Space about a fitted model, of all effects that no measurement contradicts."""
    further = [e for e in about.possible.values() if e not in model.effects and e.key not in denied]
    return space_of(about.case, about.yardstick, model.state, model.free, about.possible, further)


def _fit_model(about, effects, values, *, rows=None, roughly=False):
    """Model of some effects, fitted from some values.

    rows : (n,) bool, those that are fitted; None: all. roughly : for a first comparison.
    """
    case, yardstick = about.case, about.yardstick
    effects, free = in_order(effects, about.possible), about.free
    for effect in effects:
        free = case.with_effect(free, effect)
    known = {one.name: one for one in about.level}
    free = tuple(known.get(one.name, one) for one in free)
    problem = case.problem(effects, free, yardstick.filters)
    if rows is not None:
        whiten = problem.whiten
        problem = problem._replace(whiten=lambda columns: (whiten(columns).T * rows).T)
    settled = (ROUGHLY if roughly else CLOSELY) * yardstick.cost_of_nat
    # Of a delay even rows tell an interval over which the cost is level: that takes its minimum.
    delayed = any(effect.hold_imitates for effect in effects)
    settled = case.settled if delayed else max(settled, case.settled)
    solution = fit(problem, values, steps=STEPS, settled=settled)
    state = case.state(effects, solution, yardstick.filters)
    return Model(free, state, squares_of(state, yardstick.blocks))


def _estimate_noise(about, model, *, first=False):
    """The search with its noise by what all effects together leave about a model, without a scale,
    and what they leave (n,)."""
    case, solution = about.case, model.state.solution
    further = [effect for effect in about.possible.values() if effect not in model.effects]
    of_fit = "fit", solution.values, solution.prediction
    lined_up = candidates_beside(case, *of_fit, model.effects, about.possible, further)
    residual = _residual_with_all(solution, lined_up, about.yardstick.filters.fit)
    filters = case.filters_for(residual, about.yardstick.filters, first)
    yardstick = about.yardstick._replace(filters=filters, scale=np.inf)
    return about._replace(yardstick=yardstick), residual


def _residual_with_all(solution, lined_up, whitening):
    """Residual (n,), not whitened, with all candidates in the model, by ridge regression on what
    each would change."""
    if not lined_up:
        return solution.residual
    solution = solution.inside
    many = np.concatenate([c.columns for c in lined_up], axis=1)
    both = np.concatenate([solution.white, whitening.apply(many)], axis=1)
    gram = both.T @ both
    ridge = np.diag(1e-6 * np.diag(gram) + 1e-12)
    k = len(solution.precision)
    ridge[:k, :k] = solution.precision - gram[:k, :k]
    # Scaled to one on the diagonal: columns of a millivolt beside some of hundreds of volts (a leak
    # that an iron-phosphate cell's steep end turns into voltage) are else singular to rounding.
    size = np.sqrt(np.maximum(np.diag(gram + ridge), 1e-300))
    moment = both.T @ whitening.apply(solution.residual)
    scaled = (gram + ridge) / np.outer(size, size)
    # Least norm: where little of the records has weight, columns may be one and the same.
    change = np.linalg.lstsq(scaled, moment / size, rcond=None)[0] / size
    return solution.residual - np.concatenate([solution.columns, many], axis=1) @ change


def _drop_worthless(about, model, models):
    """The model without effects that are not worth their price once all are fitted exactly."""
    while model.effects:
        values = model.state.solution.values
        for effect in model.effects:
            others = tuple(one for one in model.effects if one is not effect)
            keys = tuple(sorted(one.key for one in others))
            if keys not in models:
                models[keys] = _light(_fit_model(about, others, values, roughly=True))
        ahead = _best(about, models)
        if worth(ahead, about.yardstick) <= worth(model, about.yardstick):
            break
        model = _fit_model(about, ahead.effects, ahead.state.solution.values)
        models[model.keys] = model
    return model


def _compare_each(about, model, models, space, denied):
    """Beside of each effect of a model, that with the largest gain first."""
    gates, found = about.case.gates, []
    for number, effect in enumerate(model.effects):
        keys = tuple(key for key in model.keys if key != effect.key)
        before = models[keys]
        gain = about.yardstick.difference(model.squares, before.squares)
        tied = ()
        if gain.rank_z >= gates.counts and effect.id not in OUTSIDE:
            tied = _tied_rivals(about, model, before, number, models, space)
        tied = about.case.ties(effect, model.state, tied, denied, about.possible)
        squares = model.squares, before.squares
        found.append(Beside(effect, model.state, before.state, squares, gain, tied))
    return tuple(sorted(found, key=lambda one: -one.gain.total))


def _tied_rivals(about, model, before, number, models, space):
    """Keys of effects that predict as well in the place of one of a model, by exact fits.

    One is tied if its own gain would let it join, and the two are less apart than `apart` standard
    errors. What has no name ties with none: it stands for whatever the vocabulary lacks, and has to
    predict better.
    """
    gates, yardstick = about.case.gates, about.yardstick
    rest = space.inside - {number}
    least = SHARE_OF_TIE * space.difference(space.inside, rest).total
    near = [rest | {k} for k in space.further(rest) if k != number]
    near = [
        one
        for one in near
        if not {space.terms[k].effect.id for k in one - rest} & OUTSIDE.keys()
        and space.difference(space.inside, one).z < gates.apart
        and space.difference(one, rest).total >= least
    ]
    near = sorted(near, key=lambda one: -space.density(one).sum())
    of_effect = {}
    for one in near:
        of_effect.setdefault(space.keys(one), one)
    tied = []
    for keys, one in list(of_effect.items())[:TIED]:
        if keys not in models:
            effects = [space.terms[k].effect for k in one]
            values = space.values_of(one, model.state.solution.values)
            models[keys] = _light(_fit_model(about, effects, values, roughly=True))
    for keys, there in models.items():
        (*others,) = set(keys) - set(before.keys)
        if len(others) != 1 or set(before.keys) - set(keys) or keys == model.keys:
            continue
        if about.possible[others[0]].id in OUTSIDE:
            continue
        apart = yardstick.difference(model.squares, there.squares).z
        shown = yardstick.difference(there.squares, before.squares).z >= gates.joins
        tied += others if shown and apart < gates.apart else []
    return tuple(tied)


def _centre_delays(about, model):
    """The search and the model with each delay, of which the readings tell an interval alone, in
    its middle.

    There it is as sure as the normal distribution that has as wide a 95 % interval. A fit that
    stood in a step of the likelihood falls by it, and the interval is looked for again.
    """
    for effect in (one for one in model.effects if one.hold_imitates):
        name = effect.names[0]
        # The delay as its effect has it.
        own = {one.name: one for one in about.case.with_effect((), effect)}
        others = tuple(one for one in about.level if one.name != name)
        for _ in range(LEVELLED):
            before = model.state.solution
            free = tuple(own.get(one.name, one) for one in model.free)
            problem = about.case.problem(model.effects, free, about.yardstick.filters)
            ends = None if name in before.at_bound else level(problem, before, name)
            if ends is None:
                break
            known = {"prior": sum(ends) / 2, "std": EVEN_STD * (ends[1] - ends[0])}
            one = next(one for one in free if one.name == name)._replace(**known)
            about = about._replace(level=(*others, one))
            values = before.values | {name: one.prior}
            model = _fit_model(about, model.effects, values)
            if before.chi_square - model.state.solution.chi_square < TWO_STDS:
                break
    return about, model
