"""Candidates for the missing effect: the score test of each, and its trial beside the model so far.

A case, as `search` says, gives the problem of a fit, its errors on the records that judge, and the
limits beyond which kept derivatives mislead.
"""

from functools import partial
from typing import NamedTuple

import numpy as np

from cellwright.effects import base, beginning
from cellwright.effects.library.vocabulary import in_order
from cellwright.effects.score import densities, difference, left_out, mean_squares
from cellwright.numerics.least_squares import Free, cost_of, derivatives, fit, inverse

CHORD_STEPS, ANEW_STEPS = 6, 4
POLISHED = 3  # how many trials at most
REDERIVED = 3  # how often at most a trial is refitted with new derivatives


class Candidate(NamedTuple):
    """An effect at one of its starts.

    sizes : names (id.parameter) of the parameters that are zero while it is absent.
    start : dict of first values of all its parameters; sizes are those of the secants.
    columns : (n, k) change of the prediction per unit of each size.
    """

    effect: object
    sizes: tuple
    start: dict
    columns: np.ndarray

    @property
    def form(self):
        """The form of the effect: see `form_of`."""
        return form_of(self.effect, self.start)

    @property
    def absent(self):
        """The first values with its sizes at zero: the effect in this form, but absent."""
        return self.start | dict.fromkeys(self.sizes, 0.0)


def form_of(effect, values):
    """Values of the parameters of an effect without a step, which no fit moves: its form."""
    pairs = zip(effect.parameters, effect.names, strict=True)
    return tuple(values[name] for p, name in pairs if not p.step)


def candidates(predict, prediction, values, library):
    """Candidates: every effect at every one of its starts.

    Parameters
    ----------
    predict : function (values, effect) → (n,) prediction with one more effect.
    prediction : (n,) without it. values : dict of the model as it is.
    library : sequence of Effect.

    Returns
    -------
    candidates : list of Candidate.
    """
    return [
        _candidate(predict, prediction, values, effect, start)
        for effect in library
        for start in effect.starts
    ]


def neutral(effect):
    """Values of an effect that is absent: dict by key.parameter."""
    return dict(zip(effect.names, (p.neutral for p in effect.parameters), strict=True))


def _candidate(predict, prediction, values, effect, start):
    names = dict(zip((p.name for p in effect.parameters), effect.names, strict=True))
    first = neutral(effect) | {names[name]: value for name, value in start.items()}
    sizes = [p for p in effect.parameters if not p.shape]
    absent = first | {names[p.name]: p.neutral for p in sizes}
    columns = []
    for p in sizes:
        step = start.get(p.name, p.step)
        moved = predict(values | absent | {names[p.name]: p.neutral + step}, effect)
        columns.append((moved - prediction) / step)
    sized = tuple(names[p.name] for p in sizes)
    return Candidate(effect, sized, first, np.stack(columns, axis=1))


class Score(NamedTuple):
    """Result of the score test of a candidate.

    chi_square : expected fall of chi-square by the candidate, the nuisances having followed.
    estimate : (k,) its sizes there. information : (k, k) of the sizes, nuisances projected out.
    visible : chi-square of a plausible size. values : first values of a refit.
    """

    candidate: Candidate
    chi_square: float
    estimate: np.ndarray
    information: np.ndarray
    visible: float
    values: dict


def scored(candidates, white, residual, columns, precision, values):
    """Score (Lagrange multiplier) test of each candidate, the nuisances projected out.

    Parameters
    ----------
    candidates : list of Candidate. white : (n, m) columns of all of them, whitened.
    residual : (n,) whitened residual of the model at its optimum.
    columns : (n, k) whitened derivatives by the nuisances. precision : (k, k), priors included.
    values : dict of the model at its optimum.

    Returns
    -------
    scores : list of Score.

    Source: C. R. Rao, Proc. Camb. Phil. Soc. 44 (1948) 50.
    """
    mixed = columns.T @ white
    whole = white.T @ white
    information = whole - mixed.T @ inverse(precision) @ mixed
    slope = white.T @ residual
    scores, first = [], 0
    for candidate in candidates:
        part = slice(first, first + len(candidate.sizes))
        first = part.stop
        blocks = information[part, part], whole[part, part], slope[part]
        scores.append(_score(candidate, *blocks, values))
    return scores


def _score(candidate, information, whole, slope, values):
    ridge = 1e-6 * np.diag(np.maximum(np.diag(whole), 1e-300))
    limits = np.array([(p.lower, p.upper) for p in candidate.effect.parameters if not p.shape])
    # One-sided effects cannot take the wrong sign.
    estimate = np.clip(np.linalg.solve(information + ridge, slope), *limits.T)
    gain = 2 * slope @ estimate - estimate @ information @ estimate
    likely = [p.plausible for p in candidate.effect.parameters if not p.shape]
    visible = float(np.max(np.square(likely) * np.diag(information)))
    sizes = dict(zip(candidate.sizes, estimate.tolist(), strict=True))
    first = values | candidate.start | sizes
    return Score(candidate, float(gain), estimate, information, visible, first)


def residual_with_all(solution, candidates, whitening):
    """Residual with all candidates in the model, by ridge regression on what each would change.

    Parameters
    ----------
    solution : least_squares.Solution of the model without them. candidates : list of Candidate.
    whitening : that of the fit.

    Returns
    -------
    residual : (n,) not whitened.
    """
    if not candidates:
        return solution.residual
    solution = solution.inside
    many = np.concatenate([c.columns for c in candidates], axis=1)
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


def screened(case, candidates, before, possible, filters):
    """Scores of the effects of a cell, and the effects that its records cannot show.

    Parameters
    ----------
    case : case.Case. candidates : list of Candidate. before : candidates.State without them.
    possible : dict of Effect by key, in whose order effects act. filters : case.Filters.

    Returns
    -------
    scores : list of Score, best first, the best start of each form. hidden : tuple of keys.
    """
    if not candidates:
        return [], ()
    solution, best, hidden = before.solution, {}, {}
    residual = filters.fit.apply(solution.residual)
    many = filters.fit.apply(np.concatenate([c.columns for c in candidates], axis=1))
    regressed = beginning.regressed(case.cell, case.fit, solution.values, before.effects)
    without = chi_square_of(case, regressed, before.effects, filters)
    inside = solution.inside
    slopes = inside.white, inside.precision, solution.values
    for score in scored(candidates, many, residual, *slopes):
        candidate = score.candidate
        if candidate.effect.needs_restart:
            score = _score_by_regression(case, before, possible, score, filters, without)
        visible = score.visible >= case.gates.visible_chi_square
        kept, name = best if visible else hidden, (candidate.effect.key, candidate.form)
        if name not in kept or score.chi_square > kept[name].chi_square:
            kept[name] = score
    shown = {name for name, _ in best}
    invisible = tuple(dict.fromkeys(name for name, _ in hidden if name not in shown))
    return sorted(best.values(), key=lambda s: -s.chi_square), invisible


def _score_by_regression(case, before, possible, score, filters, without):
    """Score of an effect without which resistances and time constants are fitted far off.

    Where they are, no derivative shows the effect. With the effect at each of its starts they are
    estimated again by linear regression; its chi-square is compared with that without the effect.
    What is smaller than every start has bent nothing, and its derivative stands.
    """
    candidate = score.candidate
    effects = in_order((*before.effects, candidate.effect), possible)
    given = candidate.effect.set_by_starts(candidate.start)
    sizes = dict(zip(candidate.sizes, score.estimate, strict=True))
    if given & sizes.keys() and all(abs(sizes[n]) < abs(candidate.start[n]) for n in given):
        return score
    free = tuple(name for name in candidate.sizes if name not in given)
    first = before.solution.values | candidate.start
    values = beginning.regressed(case.cell, case.fit, first, effects, free)
    sizes = np.array([values[name] for name in candidate.sizes])
    fall = without - chi_square_of(case, values, effects, filters)
    return score._replace(chi_square=fall, estimate=sizes, values=values)


def chi_square_of(case, values, effects, filters):
    """Chi-square of the fitted records by a model [1]."""
    volt = base.voltage(case.cell, case.fit, values, effects)
    white = filters.fit.apply(case.fit.voltage_volt - volt)
    return float(white @ white)


class State(NamedTuple):
    """A fitted model: its effects, and its errors on the records fitted and those that judge.

    values : of the validation records, with their own starts. validation : residual (m,), errors of
    the starts taken out. validation_white : the same whitened. rmse_volt, validation_rmse_volt : of
    a cell's voltage, of a group's branch currents times their cells' ohmic resistance [V].
    """

    effects: tuple
    solution: object
    values: dict
    validation: np.ndarray
    validation_white: np.ndarray
    rmse_volt: float
    validation_rmse_volt: float

    @property
    def worst_volt(self):
        """The larger of both rms errors [V]."""
        return max(self.rmse_volt, self.validation_rmse_volt)


class Trial(NamedTuple):
    """A candidate refitted, compared with the model without it.

    score : fall of chi-square that the screen expected. state : State with it. gain :
    score.Difference from the model without it; density : (b,) of each block. None as long as they
    were not asked.
    """

    effect: object
    score: float
    state: State
    gain: object = None
    density: np.ndarray | None = None

    @property
    def at_limit(self):
        """Whether its leading size ended on a bound, beyond which no cell has it."""
        return self.effect.names[0] in self.state.solution.at_bound


def densities_of(state, blocks):
    """Log predictive density of each block by a fitted model (b,), see `score`.

    A block of the records fitted is predicted by the fit without it.

    Parameters
    ----------
    state : State. blocks : score.Blocks.
    """
    seen = mean_squares(state.validation_white, blocks.judging, len(blocks.record))
    return densities(np.where(blocks.judges, seen, _left_out(state, blocks).squares))


def most_telling(state, effect, blocks):
    """Number of the block of the records fitted without which the sizes of an effect move most.

    Parameters
    ----------
    state : State of a model with the effect. effect : Effect. blocks : score.Blocks.

    Source: Cook's distance of a subset of the parameters: R. Cook, S. Weisberg, Residuals and
    Influence in Regression (1982), 3.5.
    """
    solution = state.solution.inside
    mine = [k for k, name in enumerate(solution.names) if name in effect.names]
    change = _left_out(state, blocks).change[:, mine]
    covariance = inverse(solution.precision)[np.ix_(mine, mine)]
    return int(np.argmax(np.einsum("bk,kj,bj->b", change, inverse(covariance), change)))


def _left_out(state, blocks):
    """Fits without each block, score.LeftOut, of a state's parameters that are on no bound."""
    solution = state.solution.inside
    fitted = solution.white, solution.whitened, solution.precision, solution.slope
    vague = _vague(state.effects, solution)
    return left_out(*fitted, blocks.fitted, len(blocks.record), vague=vague)


def _vague(effects, solution):
    """Precision of parameters that have no prior, by their bounds, and their distance from absent.

    Without it what a single block tells of would not be predicted there at all.
    """
    known, away = np.zeros(len(solution.names)), np.zeros(len(solution.names))
    place = {name: k for k, name in enumerate(solution.names)}
    for effect in effects:
        for p, name in zip(effect.parameters, effect.names, strict=True):
            if name in place and not np.isfinite(p.prior_std):
                known[place[name]] = (p.plausible or p.upper - p.lower) ** -2.0
                away[place[name]] = solution.values[name] - p.neutral
    return known, away


def scores_to_refit(scores, ends, most):
    """Scores of the best so many effects, each in all its forms: no form takes another's place.

    Further those beside which resistances and time constants have to be fitted again: beside misfit
    the score of a regression is none of theirs (of slow diffusion in an iron-phosphate cell it was
    below zero, and the fit took a third off the error).

    ends : State by key of effects that were tried by another noise: each in its best form, for
        another noise does not make another form the better one.
    """
    restart = {s.candidate.effect.key: s.candidate.effect.needs_restart for s in scores}
    keys = [key for n, (key, needed) in enumerate(restart.items()) if n < most or needed]
    chosen = []
    for score in scores:
        effect, end = score.candidate.effect, ends.get(score.candidate.effect.key)
        as_before = end is None or score.candidate.form == form_of(effect, end.values)
        chosen += [score] if effect.key in keys and as_before else []
    return chosen


def tried(case, possible, free, before, score, filters, end=None):
    """Trial of a candidate: refitted from where the cost is least.

    That is where its score test estimates, or without the effect; in a repeated round where the fit
    by another noise ended.

    Parameters
    ----------
    case : as in `search`. possible : dict of Effect by key, in whose order effects act.
    free : tuple of Free without the effect. before : State without it. score : candidates.Score.
    filters : of the round. end : State of the effect by another noise, or None.

    Returns
    -------
    trial : Trial.
    """
    candidate, effect = score.candidate, score.candidate.effect
    effects = in_order((*before.effects, effect), possible | {effect.key: effect})
    problem = case.problem(effects, case.with_effect(free, effect), filters)
    starts = [score.values, *([end.solution.values] if end else [])]
    if not effect.needs_restart and not effect.set_by_starts(candidate.sizes):
        # An offset that the OCV has to follow costs much where it is estimated: kept derivatives
        # end beside the minimum. Not where nothing shows next to none, as the effect's starts say.
        starts.append(before.solution.values | candidate.absent)
    start = min(starts, key=partial(cost_of, problem))
    how = {"steps": CHORD_STEPS}
    if end and start is end.solution.values:
        how |= {"columns": end.solution.columns, "renew": effect.names}
    elif effect.needs_restart:
        how = {"steps": ANEW_STEPS}
    else:
        how |= {name: getattr(before.solution, name) for name in ("columns", "white", "gram")}
    solution = fit(problem, start, **how)
    return Trial(effect, score.chi_square, case.state(effects, solution, filters))


def compared(case, before, trials, filters):
    """Trials with what they gain over the model without them, best first.

    Parameters
    ----------
    case : as in `search`. before : State without the trials. trials : list of Trial.
    filters : of the round.
    """
    without, record = case.densities(before, filters), filters.blocks.record
    known = []
    for trial in trials:
        density = case.densities(trial.state, filters)
        gain = difference(density, without, record)
        known.append(trial._replace(gain=gain, density=density))
    return sorted(known, key=lambda t: -t.gain.total)


def polished(case, free, before, trials, filters):
    """Trials, best first, the best of them refitted with new derivatives where kept ones mislead.

    Parameters
    ----------
    case, free, before, filters : as in `tried`. trials : list of Trial, from `compared`.
    """
    again = [
        n < POLISHED and trial.gain.total > 0.0 and case.misled(before, trial)
        for n, trial in enumerate(trials)
    ]
    refitted = [
        _refitted(case, free, before, trial, filters)
        for trial, misled in zip(trials, again, strict=True)
        if misled
    ]
    others = [trial for trial, misled in zip(trials, again, strict=True) if not misled]
    known = compared(case, before, refitted, filters) if refitted else []
    return sorted([*known, *others], key=lambda t: -t.gain.total)


def _refitted(case, free, before, trial, filters):
    """A Trial refitted with derivatives made where it is, and anew where it ends far from there."""
    effect, effects = trial.effect, trial.state.effects
    problem = case.problem(effects, case.with_effect(free, effect), filters)
    for _ in range(REDERIVED):
        origin, end = trial.state, trial.state.solution
        kept = {"columns": derivatives(problem, end.values, end.prediction), "renew": effect.names}
        solution = fit(problem, end.values, **kept, steps=CHORD_STEPS)
        trial = trial._replace(state=case.state(effects, solution, filters))
        if not case.misled(origin, trial):
            break
    return trial


def frees_of(effect):
    """Free parameters of an effect; those without a step are set by its starts, not fitted."""
    pairs = zip(effect.parameters, effect.names, strict=True)
    return tuple(
        Free(name, p.step, p.neutral, p.prior_std, p.lower, p.upper) for p, name in pairs if p.step
    )
