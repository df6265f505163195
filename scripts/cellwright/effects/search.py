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
`measured(side)` : the rows that it predicts, as measured.
`started(effects, solution)` : values of a fit, with the starts of the records that judge.
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
from cellwright.effects.space import candidates_beside, space_of
from cellwright.effects.state import State, Yardstick, most_telling, squares_of, state_of
from cellwright.numerics.compare import compare
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


class Search(NamedTuple):
    """A search: what its fits need, and what it has come to, in the end what it has found.

    case, possible : what is searched, and its effects by key. free : of the plain model.
    yardstick : state.Yardstick. models : dict of every Model that was fitted, by its keys. denied :
    set of keys of effects that a measurement outside the fit contradicts. made : list of keys of
    the models about which a space was made. tried : set of labels of the models that were fitted,
    keys and forms. level : Free of delays of which the readings tell an interval alone, see
    `_centre_delays`. most_volt : the largest error of a model on the records that judge, see
    `_best`. floor : floor.Floor. spaces : space.Space about the plain model, and at the end about
    the last. model : in the end the Model of all that predicts better. beside : tuple of Beside, of
    each effect of it, that with the largest gain first.
    """

    case: object
    possible: dict
    free: tuple
    yardstick: object
    models: dict
    denied: set
    made: list
    tried: set
    level: tuple = ()
    most_volt: float = np.inf
    floor: object = None
    spaces: tuple = ()
    model: Model | None = None
    beside: tuple = ()

    @property
    def plain(self):
        """The model without effects."""
        return self.models[()]

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

    def with_only(self, effects):
        """State of the model refitted with some of its effects alone."""
        kept = tuple(effect for effect in self.model.effects if effect in effects)
        keys = tuple(sorted(effect.key for effect in kept))
        if keys in self.models and self.models[keys].state.solution.white is not None:
            return self.models[keys].state
        return _fit_model(self, kept, self.last.solution.values).state

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
        unbent = _fit_model(self, one.before.effects, one.before.solution.values, rows=rows)
        ends = [self.yardstick.density(model.squares) for model in (self.model, unbent)]
        ends = [np.delete(density, telling) for density in ends]
        return compare(*ends, record=np.delete(blocks.record, telling))


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
    """Search, until no set of effects predicts better.

    Parameters
    ----------
    case : of a cell or of a group, see above. library : dict of Effect by id.
    """
    possible = case.possible(library)
    free, values, filters = case.begun()
    yardstick = Yardstick(filters)
    if case.gates.price is not None:
        yardstick = yardstick._replace(price=case.gates.price / 2.0, by_cost=True)
    found = Search(case, possible, free, yardstick, {}, set(), [], set())
    plain = _fit_model(found, (), values)
    for again in (True, False):
        found, residual = _estimate_noise(found, plain, first=again)
    found = _begin(found, plain.state.solution.values, residual)
    most_volt = found.first.validation_rmse_volt + case.gates.material_volt
    return _conclude(_climb(_by_scale_of(found, found.plain)._replace(most_volt=most_volt)))


def resume_without(found, ruled_out):
    """Search without some effects, from the models that were fitted without them.

    Parameters
    ----------
    found : Search. ruled_out : keys of the effects.
    """
    denied = found.denied | set(ruled_out)
    found = found._replace(
        possible={key: e for key, e in found.possible.items() if key not in ruled_out},
        models={keys: m for keys, m in found.models.items() if not denied & set(keys)},
        most_volt=found.first.validation_rmse_volt + found.case.gates.material_volt,
        denied=denied,
        made=[()],
        tried=set(),
        level=(),
    )
    return _conclude(_climb(found))


def _begin(found, values, residual):
    """The search with the plain model alone, fitted by the noise as it is, and with its floor by
    what all effects together leave (n,)."""
    plain = _fit_model(found, (), values)
    case, filters = found.case, found.yardstick.filters
    floor = case.floor(plain.state, plain.free, residual, filters)
    return found._replace(models={(): plain}, floor=floor)


def _conclude(found):
    """What a search has come to once no set of effects predicts better."""
    models, best = found.models, _best(found)
    if best.effects:
        best = _fit_model(found, best.effects, best.state.solution.values)
    found, best = _centre_delays(found, best)
    models[best.keys] = best
    best = _drop_worthless(found, best)
    spaces = found.spaces[0], _space_about(found, best)
    found = found._replace(spaces=spaces, model=best)
    return found._replace(beside=_compare_each(found))


def _best(found):
    """The model that predicts best of those that were fitted.

    A model that errs more than the plain one on the validation records, by more than anyone would
    accept (`material_volt`), is not taken: the score has heavy tails, and a few blocks that are
    missed by half a volt, below an empty end, hardly lower it.
    """
    models = found.models.values()
    fair = [m for m in models if m.state.validation_rmse_volt <= found.most_volt]
    return _most_worth(found, fair or models)


def _most_worth(found, models):
    """The model of the largest worth, however it errs."""
    return max(models, key=lambda model: worth(model, found.yardstick))


def _by_scale_of(found, model):
    """The search with the scale of a model, where that is less."""
    return found._replace(yardstick=found.yardstick.finer(model.squares))


def _next_model(found):
    """The model about which the next space is made: the best one about which none was; None where
    the best of all was asked already and leaves little.

    About the plain model little is linear, and about a poor one not much: after it the best model
    with effects is asked, better or not.
    """
    best = _best(found)
    others = [m for keys, m in found.models.items() if keys not in found.made]
    if not others:
        return None
    # It may leave more than anyone would accept, and a fair part of the plain one's error: another
    # way up may lead further.
    was, now = (left_volt(one.state, found.floor) for one in (found.plain, best))
    much = now > max(found.case.gates.unknown_volt, MUCH * was)
    if best.keys in found.made and len(found.made) > 1 and not much:
        return None
    return _most_worth(found, others)


def _keep(found, model):
    """Keep a model, unless a measurement contradicts one of its effects."""
    against = found.case.denied(model.state)
    found.denied.update(against)
    known, yardstick = found.models.get(model.keys), found.yardstick
    if not against and (known is None or worth(model, yardstick) > worth(known, yardstick)):
        found.models[model.keys] = _light(model)


def _freeze(found, model):
    """The search with its noise made anew at the first model with effects, by which all are
    compared; and the model fitted by it."""
    found, residual = _estimate_noise(found, model)
    found = _begin(found, found.plain.state.solution.values, residual)
    model = _fit_model(found, model.effects, model.state.solution.values, roughly=True)
    return _by_scale_of(found, model), model


def _climb(found):
    """The search once no further space leads to a better model, or as many were made as may be."""
    while len(found.made) < MOST_SPACES and (start := _next_model(found)) is not None:
        if start.effects:
            start = _fit_model(found, start.effects, start.state.solution.values)
            found.models[start.keys] = _light(start)
            found = _by_scale_of(found, start)
        found.made.append(start.keys)
        space = _space_about(found, start)
        found = found._replace(spaces=found.spaces or (space,))
        frozen = len(found.made) > 1
        found.tried.add(space.label(space.inside))
        for chosen in _propose(space, found.case.gates, found.denied, found.tried):
            found.tried.add(space.label(chosen))
            effects = [space.terms[k].effect for k in chosen]
            values = space.values_of(chosen, start.state.solution.values)
            model = _fit_model(found, effects, values, roughly=True)
            if not frozen:
                found, model = _freeze(found, model)
            frozen = True
            _keep(found, model)
    return found


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


def _space_about(found, model):
    """Space about a fitted model, of all effects that no measurement contradicts."""
    others = (e for e in found.possible.values() if e not in model.effects)
    further = [e for e in others if e.key not in found.denied]
    return space_of(found.case, found.yardstick, model.state, model.free, found.possible, further)


def _fit_model(found, effects, values, *, rows=None, roughly=False):
    """Model of some effects, fitted from some values.

    rows : (n,) bool, those that are fitted; None: all. roughly : for a first comparison.
    """
    case, yardstick = found.case, found.yardstick
    effects, free = in_order(effects, found.possible), found.free
    for effect in effects:
        free = case.with_effect(free, effect)
    known = {one.name: one for one in found.level}
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
    state = state_of(case, effects, solution, yardstick.filters)
    return Model(free, state, squares_of(state, yardstick.blocks))


def _estimate_noise(found, model, *, first=False):
    """The search with its noise by what all effects together leave about a model, without a scale,
    and what they leave (n,)."""
    case, solution = found.case, model.state.solution
    further = [effect for effect in found.possible.values() if effect not in model.effects]
    of_fit = "fit", solution.values, solution.prediction
    lined_up = candidates_beside(case, *of_fit, model.effects, found.possible, further)
    residual = _residual_with_all(solution, lined_up, found.yardstick.filters.fit)
    filters = case.filters_for(residual, found.yardstick.filters, first)
    yardstick = found.yardstick._replace(filters=filters, scale=np.inf)
    return found._replace(yardstick=yardstick), residual


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


def _drop_worthless(found, model):
    """The model without effects that are not worth their price once all are fitted exactly."""
    models = found.models
    while model.effects:
        values = model.state.solution.values
        for effect in model.effects:
            others = tuple(one for one in model.effects if one is not effect)
            keys = tuple(sorted(one.key for one in others))
            if keys not in models:
                models[keys] = _light(_fit_model(found, others, values, roughly=True))
        ahead = _best(found)
        if worth(ahead, found.yardstick) <= worth(model, found.yardstick):
            break
        model = _fit_model(found, ahead.effects, ahead.state.solution.values)
        models[model.keys] = model
    return model


def _compare_each(found):
    """Beside of each effect of the model, that with the largest gain first."""
    case, model, each = found.case, found.model, []
    for number, effect in enumerate(model.effects):
        keys = tuple(key for key in model.keys if key != effect.key)
        before = found.models[keys]
        gain = found.yardstick.difference(model.squares, before.squares)
        tied = ()
        if gain.rank_z >= case.gates.counts and effect.id not in OUTSIDE:
            tied = _tied_rivals(found, before, number)
        tied = case.ties(effect, model.state, tied, found.denied, found.possible)
        squares = model.squares, before.squares
        each.append(Beside(effect, model.state, before.state, squares, gain, tied))
    return tuple(sorted(each, key=lambda one: -one.gain.total))


def _tied_rivals(found, before, number):
    """Keys of effects that predict as well in the place of one of the model, by exact fits.

    One is tied if its own gain would let it join, and the two are less apart than `apart` standard
    errors. What has no name ties with none: it stands for whatever the vocabulary lacks, and has to
    predict better.
    """
    gates, yardstick, models = found.case.gates, found.yardstick, found.models
    model, space = found.model, found.spaces[-1]
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
            models[keys] = _light(_fit_model(found, effects, values, roughly=True))
    for keys, there in models.items():
        (*others,) = set(keys) - set(before.keys)
        if len(others) != 1 or set(before.keys) - set(keys) or keys == model.keys:
            continue
        if found.possible[others[0]].id in OUTSIDE:
            continue
        apart = yardstick.difference(model.squares, there.squares).z
        shown = yardstick.difference(there.squares, before.squares).z >= gates.joins
        tied += others if shown and apart < gates.apart else []
    return tuple(tied)


def _centre_delays(found, model):
    """The search and the model with each delay, of which the readings tell an interval alone, in
    its middle.

    There it is as sure as the normal distribution that has as wide a 95 % interval. A fit that
    stood in a step of the likelihood falls by it, and the interval is looked for again.
    """
    for effect in (one for one in model.effects if one.hold_imitates):
        name = effect.names[0]
        # The delay as its effect has it.
        own = {one.name: one for one in found.case.with_effect((), effect)}
        others = tuple(one for one in found.level if one.name != name)
        for _ in range(LEVELLED):
            before = model.state.solution
            free = tuple(own.get(one.name, one) for one in model.free)
            problem = found.case.problem(model.effects, free, found.yardstick.filters)
            ends = None if name in before.at_bound else level(problem, before, name)
            if ends is None:
                break
            known = {"prior": sum(ends) / 2, "std": EVEN_STD * (ends[1] - ends[0])}
            one = next(one for one in free if one.name == name)._replace(**known)
            found = found._replace(level=(*others, one))
            values = before.values | {name: one.prior}
            model = _fit_model(found, model.effects, values)
            if before.chi_square - model.state.solution.chi_square < TWO_STDS:
                break
    return found, model
