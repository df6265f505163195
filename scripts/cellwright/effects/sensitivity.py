"""What records can show of parameters and effects: information from a model's sensitivities alone.

Nothing measured enters beyond currents, times and temperatures. Records share all parameters but
their SoC at the start, so that the information of several stacks simply adds up: a test that has
not been done yet is weighed by adding that of its planned current.
"""

from itertools import combinations
from typing import NamedTuple

import numpy as np

from cellwright.effects import base
from cellwright.effects.screen import candidates
from cellwright.numerics.least_squares import Free
from cellwright.numerics.noise import Noise, whitening

USUAL_NOISE = Noise(2e-3, 1e-3, 200.0)
WIDE = 10.0  # plausible sizes within which an effect that is in the model may still move
SAME_CLASS = 0.95  # canonical correlation above which two effects are one class
SHOWN = 1.0  # chi-square of a direction at plausible size, below which it is no part of an effect


class Model(NamedTuple):
    """Where sensitivities are taken: values of all parameters by name, and effects in the model."""

    values: dict
    effects: tuple = ()


class Label(NamedTuple):
    """A column of an effect: its id, the number of its start, a size, and the unit it is in.

    unit : plausible size; a chi-square for one unit is that of the effect at its plausible size.
    """

    effect: str
    start: int
    size: str
    unit: float


class Information(NamedTuple):
    """What a stack of records tells.

    nuisances : tuple of problem.Free, shared by all records. labels : tuple of Label.
    matrix : (k, k) information of the nuisances, then of the labels; SoC at starts marginal.
    """

    nuisances: tuple
    labels: tuple
    matrix: np.ndarray

    def with_more(self, other):
        """That of both stacks together."""
        return self._replace(matrix=self.matrix + other.matrix)


class Projection(NamedTuple):
    """Information of the labels once the nuisances have followed.

    left : (m, m) chi-square left per unit of each label. follow : (k + m, m) how nuisances and
    labels move per unit of each label when a fit lets the nuisances follow.
    """

    left: np.ndarray
    follow: np.ndarray


def information(
    cell, stack, model, library, *, tolerance, spread=USUAL_NOISE, circuit_error=0.0, asked=None
):
    """Information of records about the nuisances and about every effect at all its starts.

    Parameters
    ----------
    cell : base.Cell. stack : records.Stack; its voltage is not looked at.
    model : Model; where it holds no SoC for the starts of this stack, see `at_starts_of`.
    library : sequence of Effect, none of which is in the model. tolerance : base.Tolerance.
    spread : noise.Noise of the readings. circuit_error : share of the overpotential by which a
    circuit errs; rows under a large load tell the less. asked : id of an effect in the model whose
    sizes are labels, in units of their values, in the place of nuisances.

    Returns
    -------
    information : Information.
    """

    def predict(values, effect):
        return base.voltage(cell, stack, values, (*model.effects, effect))

    model = model._replace(values={"known": 1.0} | model.values)
    here = base.fields_of(cell, stack, model.values, model.effects)
    extra = base.steep_volt(cell, here.soc, tolerance)
    extra = np.hypot(extra, circuit_error * (here.volt - here.ocv))
    white = whitening(spread, stack, extra_volt=extra)
    nuisances = _shared(stack, model, tolerance, asked)
    columns = [_derivative(cell, stack, model, here.volt, {f.name: f.step}) for f in nuisances]
    labels, own = _labelled(candidates(predict, here.volt, model.values, library))
    inside, more = _inside(cell, stack, model, here.volt, asked)
    labels, own = (*inside, *labels), [*more, *own]
    columns = white.apply(np.stack([*columns, *own], axis=1))
    starts = {f"soc0[{k}]": base.SOC_STEP for k in range(len(stack.first))}
    begun = white.apply(_derivative(cell, stack, model, here.volt, starts))
    matrix = _marginal(columns, begun, stack.first, tolerance.soc)
    return Information(nuisances, labels, matrix)


def at_starts_of(model, stack):
    """The model with the stated SoC at the starts of a stack."""
    starts = {f"soc0[{k}]": float(soc) for k, soc in enumerate(stack.soc_at_start)}
    return model._replace(values=model.values | starts)


def projected(found, tolerance):
    """Project the nuisances out of the information of the labels.

    Parameters
    ----------
    found : Information. tolerance : base.Tolerance, for what is known of the nuisances.

    Returns
    -------
    projection : Projection.
    """
    size = len(found.nuisances)
    prior = np.diag([f.std**-2.0 for f in found.nuisances])
    prior += base.coupling(found.nuisances, tolerance)
    mixed = found.matrix[:size, size:]
    moved = -np.linalg.solve(found.matrix[:size, :size] + prior, mixed)
    left = found.matrix[size:, size:] + mixed.T @ moved
    return Projection((left + left.T) / 2, np.vstack([moved, np.eye(len(found.labels))]))


def _inside(cell, stack, model, volt, asked):
    """Labels of an effect in the model, and its columns: derivatives times the sizes it has.

    Derivatives, for the rivals beside it are such too: a secant would tell two effects apart by
    the curvature of the OCV alone.
    """
    effect = next((e for e in model.effects if e.id == asked), None)
    sizes = [p for p in effect.parameters if not p.shape] if effect else []
    labels, columns = [], []
    for p in sizes:
        name = f"{asked}.{p.name}"
        units = model.values[name] - p.neutral
        labels.append(Label(asked, 0, name, units))
        columns.append(units * _derivative(cell, stack, model, volt, {name: p.step}))
    return labels, columns


def _shared(stack, model, tolerance, asked):
    """Nuisances that all records have in common; effects in the model may move widely."""
    plains = base.frees(stack, model.values, tolerance)
    shared = [f for f in plains if not f.name.startswith(("soc0[", "known"))]
    shared.append(Free("known", base.LOG_STEP, 1.0, tolerance.known))
    inside = [
        Free(f"{e.id}.{p.name}", p.step, std=WIDE * max(p.plausible, p.step))
        for e in model.effects
        for p in e.parameters
        if p.step and e.id != asked
    ]
    return (*shared, *inside)


def _derivative(cell, stack, model, volt, steps):
    """Change of the prediction per unit of parameters that step together."""
    values = model.values | {name: model.values[name] + step for name, step in steps.items()}
    moved = base.voltage(cell, stack, values, model.effects)
    return (moved - volt) / next(iter(steps.values()))


def _labelled(found):
    """Labels of candidates, and their columns at plausible size."""
    labels, columns, seen = [], [], {}
    for one in found:
        units = {f"{one.effect.id}.{p.name}": p.plausible or p.step for p in one.effect.parameters}
        number = seen[one.effect.id] = seen.get(one.effect.id, -1) + 1
        for size, column in zip(one.sizes, one.columns.T, strict=True):
            labels.append(Label(one.effect.id, number, size, units[size]))
            columns.append(column * units[size])
    return tuple(labels), columns


def _marginal(columns, begun, first, soc_std):
    """Information of the columns with one unknown SoC per record taken out."""
    shared = np.add.reduceat(begun[:, None] * columns, first, axis=0)
    alone = np.add.reduceat(begun**2, first) + soc_std**-2.0
    return columns.T @ columns - shared.T @ (shared / alone[:, None])


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
    case : search.Case. library : dict of Effect by id. model : Model, with the SoC at
    the starts of the records of the fit. spread : noise.Noise.

    Returns
    -------
    shown : Shown.
    """
    inside = {one.id for one in model.effects}
    lacking = [e for e in library.values() if e.id not in inside and e.stage in base.STAGES]
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
