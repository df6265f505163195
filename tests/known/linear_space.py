"""A space whose model is linear: every set of effects can be fitted beside it by hand."""

import numpy as np

from cellwright.effects.columns import Candidate
from cellwright.effects.library.vocabulary import Effect, Parameter
from cellwright.effects.score import Blocks
from cellwright.effects.space import Products, Space, Term, block_products
from cellwright.effects.state import Yardstick

BLOCKS, ROWS, JUDGING = 12, 30, 4  # the last ones judge
PRIOR = 0.3


class Filters:
    """Blocks alone: the rows are white."""

    def __init__(self, blocks):
        self.blocks = blocks


def effect(name, *, size=1.0, lower=-10.0, **changes):
    parameter = Parameter("size", "V", 0.0, lower, 10.0, step=0.1, plausible=size)
    made = Effect(name, (parameter,), "reading", lambda fields, stack, p: fields)
    return made._replace(**changes)


class Linear:
    """Rows y = X·b + Σ size·column + noise, in blocks; columns : dict name → (n,), the effects.

    inside : names of effects that the model has, fitted.
    """

    def __init__(self, columns, sizes, *, inside=(), seed=3, noise=1.0, effects=None):
        random = np.random.default_rng(seed)
        n = BLOCKS * ROWS
        self.plain, self.columns = random.normal(size=(n, 3)), columns
        self.block = np.repeat(np.arange(BLOCKS), ROWS)
        self.judges = np.arange(BLOCKS) >= BLOCKS - JUDGING
        self.y = self.plain @ [1.0, -2.0, 0.5] + noise * random.normal(size=n)
        self.y = self.y + sum(sizes[name] * columns[name] for name in sizes)
        self.effects = effects or {name: effect(name) for name in columns}
        self.inside = tuple(inside)
        self.space = self._space()

    def design(self, names, rows):
        return np.column_stack([self.plain, *(self.columns[n] for n in names)])[rows]

    def fitted(self, names, rows):
        """Parameters of a set by least squares with the priors, by hand."""
        X = self.design(names, rows)
        ridge = [PRIOR] * 3 + [1.0] * len(names)
        return np.linalg.solve(X.T @ X + np.diag(ridge), X.T @ self.y[rows])

    def squares(self, names):
        """Mean square of each block, left out where it was fitted, each by a fit of its own."""
        fits = ~self.judges[self.block]
        found = []
        for k in range(BLOCKS):
            rows = fits & (self.block != k)
            b = self.fitted(names, rows)
            mine = self.block == k
            found.append(np.mean((self.y[mine] - self.design(names, mine) @ b) ** 2))
        return np.array(found)

    def _space(self):
        fits = ~self.judges[self.block]
        at = self.fitted(self.inside, fits)
        known = 3 + len(self.inside)
        X = self.design(self.inside, slice(None))
        residual = self.y - X @ at
        further = [name for name in self.columns if name not in self.inside]
        count = known + len(further)
        terms = [Term(self.effects[n], None, np.array([3 + k])) for k, n in enumerate(self.inside)]
        for k, name in enumerate(further):
            one = self.effects[name]
            start = {f"{name}.size": 0.1}
            candidate = Candidate(one, (f"{name}.size",), start, self.columns[name][:, None])
            terms.append(Term(one, candidate, np.array([known + k])))
        gone = [-self.columns[n] * at[3 + k] for k, n in enumerate(self.inside)]
        taken_out = {k: count + k for k in range(len(self.inside))}
        whole = np.column_stack([X, *(self.columns[n] for n in further), *gone, residual])
        products, loose, rows = block_products(whole, self.block, BLOCKS)
        precision = np.diag([PRIOR] * 3 + [1.0] * (count - 3))
        pull = np.zeros(count)
        pull[:known] = -np.diag(precision)[:known] * at
        lower, upper = np.full(count, -np.inf), np.full(count, np.inf)
        for term in terms:
            if term.candidate is not None:
                parameter = term.effect.parameters[0]
                lower[term.columns], upper[term.columns] = parameter.lower, parameter.upper
        blocks = Blocks(None, None, np.zeros(BLOCKS, int), np.arange(BLOCKS), self.judges)
        about = Products(products, rows, loose, self.judges)
        limits, yardstick = (lower, upper), Yardstick(Filters(blocks), scale=1.0)
        return Space(tuple(terms), about, (precision, pull), limits, taken_out, yardstick, 25.0)

    def terms(self, *names):
        """Numbers of the terms of some effects."""
        numbers = {term.effect.id: k for k, term in enumerate(self.space.terms)}
        return frozenset(numbers[name] for name in names)

    def names(self, chosen):
        """Ids of the effects of some terms."""
        return {self.space.terms[k].effect.id for k in chosen}


def random_columns(*names, seed=7):
    """Columns of noise, one a name."""
    random = np.random.default_rng(seed)
    return {name: random.normal(size=BLOCKS * ROWS) for name in names}
