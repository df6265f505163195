"""Which effects the records of a case cannot tell apart, and which they cannot show at all."""

from itertools import combinations
from typing import NamedTuple

import numpy as np

from cellwright.effects.effect import STAGES
from cellwright.effects.sensitivity import (
    USUAL_NOISE,
    Model,
    at_starts_of,
    information,
    projected,
)

SAME_CLASS = 0.95  # canonical correlation above which two effects are one class
SHOWN = 1.0  # chi-square of a direction at plausible size, below which it is no part of an effect


class Visibility(NamedTuple):
    """Chi-square that each effect leaves at its plausible size, the nuisances having followed.

    fit, validation : dict by id: on the records of the fit; on those of the validation, where
    only the SoC at the start follows. unseen : ids below a gate on either side: not testable.
    """

    fit: dict
    validation: dict
    unseen: tuple


class Shown(NamedTuple):
    """Sensitivities of a case: Information of both stacks, Projection on that of the fit.

    held : ids of the effects whose starts are each a direction of its own: no straight line in
    their size, or several forms.
    """

    fit: object
    validation: object
    projection: object
    held: tuple


def shown(case, library, model, *, spread=USUAL_NOISE):
    """What the records of a case can show of each effect of a library.

    Parameters
    ----------
    case : search.Case. library : dict of Effect by id. model : sensitivity.Model, with the SoC at
    the starts of the records of the fit. spread : noise.Noise.

    Returns
    -------
    shown : Shown.
    """
    inside = {one.id for one in model.effects}
    lacking = [e for e in library.values() if e.id not in inside and e.stage in STAGES]
    facts = {"tolerance": case.tolerance, "spread": spread}
    fit = information(case.cell, case.fit, model, lacking, **facts)
    other = at_starts_of(model, case.validation)
    validation = information(case.cell, case.validation, other, lacking, **facts)
    held = tuple(e.id for e in lacking if e.held or e.bends)
    return Shown(fit, validation, projected(fit, case.tolerance), held)


def model_of(state):
    """Model of a state of the search: its values and effects."""
    return Model(state.solution.values, state.effects)


def confounding(seen):
    """Canonical correlation of each pair of effects on the records of the fit.

    Each effect spans the directions of its sizes and starts that show at plausible size; one of
    `held` has a span for each start, and is like another where all of them are.

    Parameters
    ----------
    seen : Shown.

    Returns
    -------
    columns : dict of lists effect_a, effect_b, correlation [1], same_class (bool), a row per pair.

    Source: H. Hotelling, Biometrika 28 (1936) 321.
    """
    left = seen.projection.left
    ids = list(dict.fromkeys(label.effect for label in seen.fit.labels))
    spans = [_spans(seen, one) for one in ids]
    pairs = list(combinations(range(len(ids)), 2))
    found = [_alike(left, spans[a], spans[b]) for a, b in pairs]
    return {
        "effect_a": [ids[a] for a, _ in pairs],
        "effect_b": [ids[b] for _, b in pairs],
        "correlation": found,
        "same_class": [one > SAME_CLASS for one in found],
    }


def classes_of(columns):
    """Classes of effects that a case cannot tell apart: connected components of its pairs.

    Parameters
    ----------
    columns : of `confounding`.

    Returns
    -------
    classes : list of tuples of ids, in the order of the library; an effect alone is its own class.
    """
    ids = list(dict.fromkeys([*columns["effect_a"], *columns["effect_b"]]))
    place = {one: k for k, one in enumerate(ids)}
    names = ("effect_a", "effect_b", "same_class")
    for a, b, same in zip(*(columns[name] for name in names), strict=True):
        if same:
            low, high = sorted((place[a], place[b]))
            place = {one: low if k == high else k for one, k in place.items()}
    return [tuple(one for one in ids if place[one] == k) for k in sorted(set(place.values()))]


def visibility(seen, gates, *, rows):
    """Chi-square of each effect at plausible size, and the effects that stay below a gate.

    Parameters
    ----------
    seen : Shown. gates : search.Gates. rows : number of rows of the fit, for the price of a
    parameter.

    Returns
    -------
    visibility : Visibility.
    """
    follow = seen.projection.follow
    judged = np.diag(follow.T @ seen.validation.matrix @ follow)
    fit, validation, unseen = {}, {}, []
    for one in dict.fromkeys(label.effect for label in seen.fit.labels):
        at = _rows(seen.fit.labels, one)
        best = at[np.argmax(np.minimum(np.diag(seen.projection.left)[at], judged[at]))]
        fit[one] = float(max(seen.projection.left[best, best], 0.0))
        validation[one] = float(max(judged[best], 0.0))
        price = gates.bic + len({seen.fit.labels[k].size for k in at}) * np.log(rows)
        if fit[one] <= price or validation[one] <= gates.validation_chi_square:
            unseen.append(one)
    return Visibility(fit, validation, tuple(unseen))


def _rows(labels, effect):
    return np.array([k for k, label in enumerate(labels) if label.effect == effect])


def _spans(seen, effect):
    labels = seen.fit.labels
    at = _rows(labels, effect)
    starts = sorted({labels[k].start for k in at}) if effect in seen.held else [None]
    parts = [[k for k in at if start is None or labels[k].start == start] for start in starts]
    return [_span(seen.projection.left, np.array(part)) for part in parts]


def _span(left, at):
    """Orthonormal directions (m, r), in the metric `left`, of the rows that show anything."""
    size, ways = np.linalg.eigh(left[np.ix_(at, at)])
    kept = size > max(SHOWN, 1e-8 * size[-1])
    found = np.zeros((len(left), int(kept.sum())))
    found[at] = ways[:, kept] / np.sqrt(size[kept])
    return found


def _alike(left, ours, theirs):
    """Correlation of two effects: of the one with more spans, that of the span least matched."""
    table = np.array([[_largest(p.T @ left @ q) for q in theirs] for p in ours])
    return float(table.max(axis=1 if len(ours) >= len(theirs) else 0).min())


def _largest(mixed):
    """Largest canonical correlation; 0 where one of the two shows nothing."""
    if 0 in mixed.shape:
        return 0.0
    return float(min(np.linalg.svd(mixed, compute_uv=False)[0], 1.0))
