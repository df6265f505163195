"""What each effect would change of a model's prediction: secants at every start of every effect."""

from typing import NamedTuple

import numpy as np

from cellwright.numerics.least_squares import Free


class Candidate(NamedTuple):
    """An effect at one of its starts.

    sizes : names (key.parameter) of the parameters that are zero while it is absent.
    start : dict of first values of all its parameters; sizes are those of the secants.
    columns : (n, k) change of the prediction per unit of each size.
    """

    effect: object
    sizes: tuple
    start: dict
    columns: np.ndarray


def neutral(effect):
    """Values of an effect that is absent: dict by key.parameter."""
    return dict(zip(effect.names, (p.neutral for p in effect.parameters), strict=True))


def sizes_of(effect):
    """Parameters of an effect that are zero while it is absent: (Parameter, key.parameter) each."""
    pairs = zip(effect.parameters, effect.names, strict=True)
    return [(p, name) for p, name in pairs if not p.shape]


def frees_of(effect):
    """Free parameters of an effect; those without a step are set by its starts, not fitted."""
    pairs = zip(effect.parameters, effect.names, strict=True)
    return tuple(
        Free(name, p.step, p.neutral, p.prior_std, p.lower, p.upper) for p, name in pairs if p.step
    )


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
    found = []
    for effect, start in [(one, start) for one in library for start in one.starts]:
        first = neutral(effect) | {f"{effect.key}.{name}": size for name, size in start.items()}
        sizes = sizes_of(effect)
        absent = first | {name: p.neutral for p, name in sizes}
        columns = []
        for p, name in sizes:
            step = start.get(p.name, p.step)
            moved = predict(values | absent | {name: p.neutral + step}, effect)
            columns.append((moved - prediction) / step)
        names = tuple(name for _, name in sizes)
        found.append(Candidate(effect, names, first, np.stack(columns, axis=1)))
    return found
