"""One linearised model and all that could be in it, so that no further model has to be simulated.

At a fitted model the columns are the derivatives by its parameters, the change of the voltage by
each further effect at each of its starts, and that by taking out each effect that it has (exactly:
no derivative foresees that). Whitened, of both sides, only their products by block are kept,

    Z = [parameters, further effects, effects taken out, residual],  G_b = Z_b' Z_b

For every set of effects they give the fit, and how well it predicts each block left out:

    residual Z a,  a = −x of the columns kept, −1 of effects taken out, 1 of the residual
    x = least of Σ a' G_b a + priors within bounds, over the blocks fitted
    q_b = mean square of Z_b a; of a block that was fitted with the x of the others

Source: R. Cook, S. Weisberg, Residuals and Influence in Regression (1982), 3.6 (deletion of groups
of rows).
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cellwright.effects.columns import candidates, sizes_of
from cellwright.effects.library.vocabulary import in_order
from cellwright.native import array, count, function, integers
from cellwright.numerics.compare import compare
from cellwright.numerics.least_squares import Problem, bounded_minimum, derivatives

RIDGE = 1e-9  # of a column's own square, against rounding
_KERNEL = (array, integers, array, array, array, integers, array, integers, array, array)
PARTS = 10  # of the blocks, each left out at once where only an order is asked for


class Term(NamedTuple):
    """One way in which an effect is in a model.

    candidate : columns.Candidate of a further effect; None: as the fitted model has it.
    columns : (k,) numbers of its columns. form : values of the parameters that no fit moves.
    """

    effect: object
    candidate: object
    columns: np.ndarray
    form: tuple = ()


class Products(NamedTuple):
    """Products of columns (j, j) by block.

    blocks : (b, j, j). rows : (b,) how many each has. loose : (j, j) of rows fitted in no block.
    judges : (b,) bool, blocks that take no part in a fit.
    """

    blocks: np.ndarray
    rows: np.ndarray
    loose: np.ndarray
    judges: np.ndarray


class Space:
    """Models about a fitted one, by the products of its columns.

    terms : tuple of Term, those of its own effects first; inside : numbers of these. A model is a
    set of numbers of terms. visible : per term, whether its effect would show at a plausible size,
    in one of its forms, beside the plain model. The last column is the residual.
    """

    def __init__(self, terms, products, priors, limits, taken_out, yardstick, least_visible):
        self.terms, self.record = terms, yardstick.blocks.record
        self.inside = frozenset(k for k, one in enumerate(terms) if one.candidate is None)
        self._taken_out, self._rows = taken_out, products.rows
        self._yardstick = yardstick
        precision, self._pull = priors
        fitted = products.blocks[~products.judges].sum(axis=0) + products.loose
        count = len(self._pull)
        size = np.ones(len(fitted))
        size[:count] = np.sqrt(np.maximum(np.diag(fitted)[:count] + np.diag(precision), 1e-300))
        self._size = size
        self._blocks = np.ascontiguousarray(products.blocks / np.multiply.outer(size, size))
        self._fitted = fitted / np.multiply.outer(size, size)
        self._prior = precision / np.multiply.outer(size, size)[:count, :count]
        self._whole = self._fitted[:count, :count] + self._prior
        self._pull = self._pull / size[:count]
        self._lower, self._upper = (one * size[:count] for one in limits)
        fits = np.flatnonzero(~products.judges)
        self._part = np.full(len(products.judges), -1)
        self._part[fits] = np.arange(len(fits)) % PARTS
        self._parts = np.array([self._blocks[self._part == k].sum(axis=0) for k in range(PARTS)])
        of_terms = {k for one in terms for k in one.columns}
        self._plain = [k for k in range(count) if k not in of_terms]
        self._hold_still()
        self._densities, self._sums, self._least = {}, {}, {}
        seen = zip(terms, self._chi_squares(), strict=True)
        shown = {one.effect.key for one, chi_square in seen if chi_square >= least_visible}
        self.visible = [one.effect.key in shown for one in terms]

    def _hold_still(self):
        """Take from the slopes what the fit of the model has left of them.

        It ended where no step helped any more. Towards a minimum that the products promise beyond
        that, no model of the space may move, for the errors of the validation records would follow.
        """
        own = [*self._plain, *(k for term in self.inside for k in self.terms[term].columns)]
        slope = self._fitted[own, -1] + self._pull[own]
        outward = (self._lower[own] >= 0.0) & (slope < 0.0) | (self._upper[own] <= 0.0) & (
            slope > 0.0
        )
        self._pull[own] -= np.where(outward, 0.0, slope)

    def squares(self, chosen):
        """Mean square (b,) of the errors of each block, one that was fitted left out of the fit."""
        each = np.where(self._part < 0, -1, np.arange(len(self._part)))
        return self._squares(chosen, self._blocks, each)

    def _squares(self, chosen, of_parts, part):
        at, free = self._minimum(chosen)
        others = np.flatnonzero(at)
        used = np.concatenate([free, others[~np.isin(others, free)]])
        fit = used, len(free), at[used], self._curvature(free)
        return np.maximum(squares_left_out(self._blocks, *fit, of_parts, part), 0.0) / self._rows

    def _curvature(self, free):
        """Products of the free columns over all blocks fitted, with the priors (k, k)."""
        return self._whole[free[:, None], free]

    def density(self, chosen):
        """Log predictive density (b,) of each block by a model."""
        key = frozenset(chosen)
        if key not in self._densities:
            self._densities[key] = self._yardstick.density(self.squares(key))
        return self._densities[key]

    def worth(self, chosen):
        """What a model is worth [nats], see `state.Yardstick.worth`; of two of this space."""
        return self._yardstick.worth(self.density(chosen), self._cost(chosen), len(chosen))

    def roughly(self, chosen):
        """The same as an order of many needs it."""
        key = frozenset(chosen)
        if key not in self._sums:
            density = ()
            if not self._yardstick.by_cost:
                tenths = self._squares(key, self._parts, self._part)
                density = self._yardstick.density(tenths)
            self._sums[key] = self._yardstick.worth(density, self._cost(key), len(key))
        return self._sums[key]

    def _cost(self, chosen):
        """Cost of the fit of a model, beyond a constant of the space."""
        at, x = self._minimum(chosen)[0], -self._minimum(chosen)[0][: len(self._pull)]
        return float(at @ self._fitted @ at + x @ self._prior @ x - 2.0 * self._pull @ x)

    def difference(self, better, worse):
        """How much better a model predicts than another: compare.Difference."""
        return compare(self.density(better), self.density(worse), record=self.record)

    def keys(self, chosen):
        """Keys of the effects of a model, sorted: tuple."""
        return tuple(sorted(self.terms[k].effect.key for k in chosen))

    def label(self, chosen):
        """Keys and forms of the effects of a model, sorted: tuple of (key, form)."""
        return tuple(sorted((self.terms[k].effect.key, self.terms[k].form) for k in chosen))

    def further(self, chosen, barred=()):
        """Terms that may join a model, those that promise the largest fall of chi-square first; of
        each form of an effect the start that promises most.

        Parameters
        ----------
        chosen : numbers of terms. barred : keys of effects that may not.
        """
        used = {*self.keys(chosen), *barred}
        # What the model had is asked in any case: no derivative promises what it is worth.
        own = [k for k in sorted(self.inside) if self.terms[k].effect.key not in used]
        falls, forms = self._falls(chosen, used), {}
        for k in sorted(falls, key=falls.get, reverse=True):
            forms.setdefault((self.terms[k].effect.key, self.terms[k].form), k)
        return [*own, *forms.values()]

    def _falls(self, chosen, barred):
        """Fall of chi-square that each further term promises beside some: dict by number."""
        at, free = self._minimum(chosen)
        terms = [
            k
            for k, term in enumerate(self.terms)
            if k not in self.inside and term.effect.key not in barred and self.visible[k]
        ]
        alone = self._alone(free)
        slopes, falls = self._fitted @ at, {}
        for k in terms:
            columns = self.terms[k].columns
            own, slope = alone[np.ix_(columns, columns)], slopes[columns]
            x = slope / own[0] if len(own) == 1 else np.linalg.solve(own, slope)
            x = np.clip(x, self._lower[columns], self._upper[columns])
            falls[k] = float(2.0 * x @ slope - x @ own @ x)
        return falls

    def term_of(self, effect, beside):
        """Number of the term by which an effect predicts best beside some terms."""
        terms = enumerate(zip(self.terms, self.visible, strict=True))
        mine = [k for k, (one, seen) in terms if seen and one.effect.key == effect.key]
        return max(mine, key=lambda k: self.roughly(beside | {k}))

    def gains(self):
        """What each further effect would gain beside the model that the space was made at.

        Returns
        -------
        gains : list of (Effect, compare.Difference, its leading size, whether it is within its
            limits, fall of chi-square), of those that the records can show.
        """
        falls, found = self._falls(self.inside, ()), []
        further = {self.terms[k].effect.key: self.terms[k].effect for k in falls}
        for effect in further.values():
            k = self.term_of(effect, self.inside)
            column = self.terms[k].columns[0]
            size = -self._minimum(self.inside | {k})[0][column]
            in_range = self._lower[column] < size < self._upper[column]
            (p, _), *_ = sizes_of(effect)
            gain = self.difference(self.inside | {k}, self.inside)
            size = float(p.neutral + size / self._size[column])
            found.append((effect, gain, size, bool(in_range), falls[k]))
        return found

    def changes_by_another(self, names):
        """Changes of the model's parameters where one more effect joins it that predicts better.

        Parameters
        ----------
        names : of its parameters, in the order of its fit.

        Returns
        -------
        changes : list of dict by name, one an effect.
        """
        without, changes = self._minimum(self.inside)[0], []
        for effect, gain, *_ in self.gains():
            if gain.total > 0.0:
                k = self.term_of(effect, self.inside)
                moved = (without - self._minimum(self.inside | {k})[0]) / self._size
                changes.append(dict(zip(names, moved[: len(names)].tolist(), strict=True)))
        return changes

    def values_of(self, chosen, values):
        """Values from which the fit of a model begins.

        Parameters
        ----------
        chosen : numbers of terms. values : dict of the model that the space was made at.
        """
        at = self._minimum(chosen)[0] / self._size
        values = dict(values)
        for term in (self.terms[k] for k in chosen if k not in self.inside):
            values |= term.candidate.start
            for (p, name), k in zip(sizes_of(term.effect), term.columns, strict=True):
                values[name] = float(np.clip(p.neutral - at[k], p.lower, p.upper))
        return values

    def _minimum(self, chosen):
        """Factors (j,) of all columns that make up the residual of a model's fit, and the numbers
        of the columns that are on no bound."""
        key = frozenset(chosen)
        if key not in self._least:
            self._least[key] = self._bounded(key)
        return self._least[key]

    def _bounded(self, chosen):
        kept = [*self._plain, *(k for term in sorted(chosen) for k in self.terms[term].columns)]
        kept = np.array(kept)
        at = np.zeros(len(self._size))
        at[-1] = 1.0
        at[[self._taken_out[k] for k in self.inside - chosen]] = -1.0
        whole = self._curvature(kept)
        whole[np.diag_indices(len(kept))] += RIDGE
        moment = self._fitted[kept] @ at + self._pull[kept]
        lower, upper = self._lower[kept], self._upper[kept]
        x = bounded_minimum(whole, moment, lower, upper)
        at[kept] = -x
        return at, kept[(x > lower) & (x < upper)]

    def _alone(self, free):
        """Products (k, k) of all columns with a factor once the free ones have followed."""
        mixed = self._fitted[free, : len(self._pull)]
        own = self._whole + RIDGE * np.eye(len(self._whole))
        return own - mixed.T @ np.linalg.solve(self._curvature(free), mixed)

    def _chi_squares(self):
        """Chi-square of each term at its plausible size, once the plain model's parameters have
        followed; infinite of those of the model: list."""
        free = np.intersect1d(self._minimum(self.inside)[1], self._plain)
        alone, seen = np.diag(self._alone(free)), []
        for k, term in enumerate(self.terms):
            if k in self.inside:
                seen.append(np.inf)
                continue
            plausible = [p.plausible for p, _ in sizes_of(term.effect)]
            sizes = np.array(plausible) * self._size[term.columns]
            seen.append(float(np.max(sizes**2 * alone[term.columns])))
        return seen


def space_of(case, yardstick, state, free, possible, further):
    """Space about a fitted model.

    Parameters
    ----------
    case : as in `search`. yardstick : search.Yardstick. state : state.State of the model.
    free : tuple of Free of its fit. possible : dict of Effect by key, in whose order effects act.
    further : effects that may join it.
    """
    effects, solution, filters = state.effects, state.solution, yardstick.filters
    judging_at = case.predict("validation", state.values, effects)
    ends = {
        "fit": (solution.values, solution.prediction),
        "validation": (state.values, judging_at),
    }
    lined_up, changes = {}, {}
    for side, (values, at) in ends.items():
        lined_up[side] = candidates_beside(case, side, values, at, effects, possible, further)
        rests = [tuple(e for e in effects if e is not effect) for effect in effects]
        without = [case.predict(side, values, rest) - at for rest in rests]
        changes[side] = [
            *(one.columns for one in lined_up[side]),
            *(change[:, None] for change in without),
        ]
    terms, count = [], len(solution.names)
    for effect in effects:
        own = [k for k, name in enumerate(solution.names) if name in effect.names]
        terms.append(Term(effect, None, np.array(own, int), _form(effect, solution.values)))
    for one in lined_up["fit"]:
        columns = np.arange(count, count + len(one.sizes))
        terms.append(Term(one.effect, one, columns, _form(one.effect, one.start)))
        count += len(one.sizes)
    taken_out = {k: count + k for k in range(len(effects))}
    fit_side = [solution.white, solution.whitened[:, None]]
    if changes["fit"]:
        fit_side.insert(1, filters.fit.apply(np.concatenate(changes["fit"], axis=1)))
    moved = _derivatives(case, state, judging_at, free)
    judging = filters.validation.apply(np.concatenate([moved, *changes["validation"]], axis=1))
    unsure = case.unsure(state.values, effects, judging_at)
    judging = unsure.taken_out_of(judging, filters.validation)
    judging = np.concatenate([judging, state.validation_white[:, None]], axis=1)
    blocks = yardstick.blocks
    fitted, loose, rows = block_products(
        np.concatenate(fit_side, axis=1), blocks.fitted, len(blocks.record)
    )
    judged, _, judging_rows = block_products(judging, blocks.judging, len(blocks.record))
    products = Products(fitted + judged, rows + judging_rows, loose, blocks.judges)
    priors, limits = _priors(solution, free, terms, count)
    return Space(
        tuple(terms), products, priors, limits, taken_out, yardstick, case.gates.visible_chi_square
    )


def _form(effect, values):
    """Values of the parameters of an effect that no fit moves: tuple."""
    pairs = zip(effect.parameters, effect.names, strict=True)
    return tuple(values[name] for p, name in pairs if not p.step)


def candidates_beside(case, side, values, prediction, effects, possible, further):
    """Candidates of further effects beside those of a model: list of columns.Candidate.

    Parameters
    ----------
    case, effects, possible, further : as of `space_of`. side : "fit" or "validation". values : dict
    of the model there. prediction : (n,) by it.
    """

    def predict(moved, effect):
        return case.predict(side, moved, in_order((*effects, effect), possible))

    return candidates(predict, prediction, values, further)


def _derivatives(case, state, prediction, free):
    """Derivatives (m, k) of the validation records by the free parameters; none by the starts of
    the others, for they have starts of their own."""

    def predict(values):
        return case.predict("validation", values, state.effects)

    shared = [k for k, one in enumerate(free) if not one.name.startswith("soc0[")]
    problem = Problem(predict, None, None, tuple(free[k] for k in shared))
    columns = np.zeros((len(prediction), len(free)))
    columns[:, shared] = derivatives(problem, state.values, prediction)
    return columns


def _priors(solution, free, terms, count):
    """Precision (k, k) of all columns' factors, its pull (k,) and their limits, two of (k,).

    Sizes without a prior are known by what is plausible: of what no other block tells it is
    predicted to be absent.
    """
    known = len(solution.names)
    precision, pull = np.zeros((count, count)), np.zeros(count)
    precision[:known, :known] = solution.precision - solution.gram
    pull[:known] = solution.slope - solution.white.T @ solution.whitened
    lower, upper = np.full(count, -np.inf), np.full(count, np.inf)
    values = np.array([solution.values[name] for name in solution.names])
    lower[:known] = np.array([one.lower for one in free]) - values
    upper[:known] = np.array([one.upper for one in free]) - values
    for term in terms:
        inside = term.candidate is None
        of_effect = dict(zip(term.effect.names, term.effect.parameters, strict=True))
        names = solution.names if inside else ()
        sizes = (
            [of_effect[names[k]] for k in term.columns]
            if inside
            else [p for p, _ in sizes_of(term.effect)]
        )
        for k, p in zip(term.columns, sizes, strict=True):
            if not np.isfinite(p.prior_std):
                vague = (p.plausible or p.upper - p.lower) ** -2.0
                precision[k, k] += vague
                pull[k] -= vague * (values[k] - p.neutral) if inside else 0.0
            elif not inside:
                precision[k, k] += p.prior_std**-2.0
            if not inside:
                lower[k], upper[k] = p.lower - p.neutral, p.upper - p.neutral
    return (precision, pull), (lower, upper)


def squares_left_out(blocks, used, free, factors, whole, of_parts, part):
    """Squares (b,) of a fit's errors by block, each by the fit without the part that holds it.

    Parameters
    ----------
    blocks : (b, j, j) products of columns by block. used : (u,) numbers of the columns that make up
    the residual, those with a free factor first. free : how many these are. factors : (u,) of the
    fit. whole : (free, free) its normal equations. of_parts : (p, j, j) products by part.
    part : (b,) number of the part of each block, -1: of none, and predicted by the whole fit.
    """
    kernel = function("squares_left_out", *[count] * 4, *_KERNEL)
    if kernel is not None:
        squares, parts = np.empty(len(blocks)), len(of_parts)
        scratch = np.empty((parts, len(used))), np.zeros(parts, np.int64), np.empty_like(whole)
        shape = len(blocks), blocks.shape[1], len(used), free
        kernel(*shape, blocks, used, factors, whole, of_parts, part, *scratch, squares)
        return squares
    asked = np.unique(part[part >= 0])
    without = of_parts[np.ix_(asked, used, used)]
    left = whole - without[:, :free, :free]
    change = np.zeros((len(blocks), len(used)))
    inside = part >= 0
    moved = np.linalg.solve(left, -(without[:, :free] @ factors)[:, :, None])[:, :, 0]
    change[inside, :free] = moved[np.searchsorted(asked, part[inside])]
    mine = factors - change
    return np.einsum("bij,bi,bj->b", blocks[:, used[:, None], used], mine, mine)


def block_products(columns, block, blocks):
    """Products of columns (n, j) by block: (blocks, j, j); of the rows in none (j, j); rows (b,).

    Parameters
    ----------
    columns : (n, j) whitened. block : (n,) number of each row's block, -1: in none.
    blocks : how many there are.
    """
    order = np.argsort(block, kind="stable")
    sorted_columns = np.ascontiguousarray(columns[order])
    edges = np.searchsorted(block[order], np.arange(-1, blocks + 1))
    parts = [sorted_columns[begin:end] for begin, end in pairwise(edges.tolist())]
    loose, *inside = (part.T @ part for part in parts)
    return np.array(inside), loose, np.diff(edges)[1:]
