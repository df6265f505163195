"""What records can show of parameters and effects: information from a model's sensitivities alone.

Nothing measured enters beyond currents, times and temperatures. Records share all parameters but
their SoC at the start, so that the information of several stacks adds up: a test that has not been
done yet is weighed by adding that of its planned current.
"""

from itertools import combinations
from typing import NamedTuple

import numpy as np

from cellwright.effects import base
from cellwright.effects.columns import candidates
from cellwright.numerics.least_squares import Free
from cellwright.numerics.noise import FIRST, whitening

WIDE = 10.0  # plausible sizes within which an effect that is in the model may still move
SAME_CLASS = 0.95  # canonical correlation above which two effects are one class
SHOWN = 1.0  # chi-square of a direction at plausible size, below which it is no part of an effect


class Model(NamedTuple):
    """Point of the sensitivities: values of all parameters by name, and effects in the model."""

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
    """Information of a stack of records about nuisances and effects.

    nuisances : tuple of least_squares.Free, shared by all records. labels : tuple of Label.
    matrix : (k, k) information of the nuisances, then of the labels; SoC at starts marginal.
    """

    nuisances: tuple
    labels: tuple
    matrix: np.ndarray

    def with_more(self, other):
        """Information of both stacks together."""
        return self._replace(matrix=self.matrix + other.matrix)


def information(
    cell, stack, model, library, *, tolerance, spread=FIRST, circuit_error=0.0, asked=None
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
    fields = base.fields_of(cell, stack, model.values, model.effects)
    extra = base.steep_volt(cell, fields.soc, tolerance)
    extra = np.hypot(extra, circuit_error * (fields.volt - fields.ocv))
    white = whitening(spread, stack, extra_volt=extra)
    nuisances = _shared(stack, model, tolerance, asked)
    columns = [_derivative(cell, stack, model, fields.volt, {f.name: f.step}) for f in nuisances]
    inside, of_inside = _inside(cell, stack, model, fields.volt, asked)
    absent, of_absent = _labelled(candidates(predict, fields.volt, model.values, library))
    columns = white.apply(np.stack([*columns, *of_inside, *of_absent], axis=1))
    starts = dict.fromkeys(base.start_names(len(stack.first)), base.SOC_STEP)
    begun = white.apply(_derivative(cell, stack, model, fields.volt, starts))
    matrix = _marginal(columns, begun, stack.first, tolerance.soc)
    return Information(nuisances, (*inside, *absent), matrix)


def at_starts_of(model, stack):
    """The model with the stated SoC at the starts of a stack."""
    return model._replace(values=model.values | base.stated_starts(stack))


def projected(information, tolerance):
    """Chi-square that labels leave once the nuisances have followed, per unit of each: (m, m) [1].

    Parameters
    ----------
    information : Information. tolerance : base.Tolerance, for what is known of the nuisances.
    """
    size = len(information.nuisances)
    prior = np.diag([free.std**-2.0 for free in information.nuisances])
    prior += base.coupling(information.nuisances, tolerance)
    mixed = information.matrix[:size, size:]
    moved = -np.linalg.solve(information.matrix[:size, :size] + prior, mixed)
    chi_square = information.matrix[size:, size:] + mixed.T @ moved
    return (chi_square + chi_square.T) / 2


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
    shared = [f for f in plains if not f.name.startswith(("soc0[", "known", base.LEAD))]
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


def _labelled(absent):
    """Labels of candidates, and their columns at plausible size."""
    labels, columns, starts = [], [], {}
    for candidate in absent:
        effect = candidate.effect
        units = {f"{effect.id}.{p.name}": p.plausible or p.step for p in effect.parameters}
        number = starts[effect.id] = starts.get(effect.id, -1) + 1
        for size, column in zip(candidate.sizes, candidate.columns.T, strict=True):
            labels.append(Label(effect.id, number, size, units[size]))
            columns.append(column * units[size])
    return tuple(labels), columns


def _marginal(columns, begun, first, soc_std):
    """Information of the columns with one unknown SoC per record taken out."""
    shared = np.add.reduceat(begun[:, None] * columns, first, axis=0)
    alone = np.add.reduceat(begun**2, first) + soc_std**-2.0
    return columns.T @ columns - shared.T @ (shared / alone[:, None])


class Shown(NamedTuple):
    """Chi-square matrix of the effects on the records fitted.

    labels : tuple of Label. chi_square : (m, m) see `projected`. held : ids of the effects whose
    starts are each a direction of its own: what they change is no straight line in their size, or
    they have several forms.
    """

    labels: tuple
    chi_square: np.ndarray
    held: tuple


def shown(case, library, model, *, spread=FIRST):
    """Chi-square matrix of every effect of a library on the records of a case that are fitted.

    Parameters
    ----------
    case : case.Case. library : dict of Effect by id. model : Model, with the SoC at
    the starts of the records of the fit. spread : noise.Noise.

    Returns
    -------
    shown : Shown.
    """
    inside = {effect.id for effect in model.effects}
    absent = [e for e in library.values() if e.id not in inside and e.stage in base.STAGES]
    total = information(case.cell, case.fit, model, absent, tolerance=case.tolerance, spread=spread)
    held = tuple(e.id for e in absent if e.nonlinear or e.needs_restart)
    return Shown(total.labels, projected(total, case.tolerance), held)


def confounding(shown):
    """Canonical correlation of each pair of effects on the records of the fit.

    Each effect spans the directions of its sizes and starts that show at plausible size; one of
    `held` has a span for each start, and is like another where all of them are.

    Parameters
    ----------
    shown : Shown.

    Returns
    -------
    columns : dict of lists effect_a, effect_b, correlation [1], same_class (bool), a row per pair.

    Source: H. Hotelling, Biometrika 28 (1936) 321.
    """
    ids = list(dict.fromkeys(label.effect for label in shown.labels))
    spans = [_spans(shown, effect) for effect in ids]
    pairs = list(combinations(range(len(ids)), 2))
    correlation = [_correlation(shown.chi_square, spans[a], spans[b]) for a, b in pairs]
    return {
        "effect_a": [ids[a] for a, _ in pairs],
        "effect_b": [ids[b] for _, b in pairs],
        "correlation": correlation,
        "same_class": [value > SAME_CLASS for value in correlation],
    }


def _spans(shown, effect):
    """Directions of an effect: of each of its starts apart where it is held, else of all."""
    labels = shown.labels
    rows = [k for k, label in enumerate(labels) if label.effect == effect]
    starts = sorted({labels[k].start for k in rows}) if effect in shown.held else [None]
    parts = [[k for k in rows if start is None or labels[k].start == start] for start in starts]
    return [_span(shown.chi_square, np.array(part)) for part in parts]


def _span(chi_square, rows):
    """Orthonormal directions (m, r), in the metric `chi_square`, of rows that show anything."""
    size, vectors = np.linalg.eigh(chi_square[np.ix_(rows, rows)])
    kept = size > max(SHOWN, 1e-8 * size[-1])
    span = np.zeros((len(chi_square), int(kept.sum())))
    span[rows] = vectors[:, kept] / np.sqrt(size[kept])
    return span


def _correlation(chi_square, spans_a, spans_b):
    """Correlation of two effects: of the one with more spans, that of the span least matched."""
    table = np.array([[_largest(p.T @ chi_square @ q) for q in spans_b] for p in spans_a])
    return float(table.max(axis=1 if len(spans_a) >= len(spans_b) else 0).min())


def _largest(mixed):
    """Largest canonical correlation; 0 where one of the two shows nothing."""
    if 0 in mixed.shape:
        return 0.0
    return float(min(np.linalg.svd(mixed, compute_uv=False)[0], 1.0))
