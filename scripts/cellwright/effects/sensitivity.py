"""What records can show of parameters and effects: information from a model's sensitivities alone.

Nothing measured enters beyond currents, times and temperatures. Records share all parameters but
their SoC at the start, so that the information of several stacks simply adds up: a test that has
not been done yet is weighed by adding that of its planned current.
"""

from typing import NamedTuple

import numpy as np

from cellwright.effects import base, plain
from cellwright.effects.screen import candidates
from cellwright.numerics.least_squares import Free
from cellwright.numerics.noise import Noise, whitening

USUAL_NOISE = Noise(2e-3, 1e-3, 200.0)
WIDE = 10.0  # plausible sizes within which an effect that is in the model may still move


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
    library : sequence of Effect, none of which is in the model. tolerance : plain.Tolerance.
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
    extra = plain.steep_volt(cell, here.soc, tolerance)
    extra = np.hypot(extra, circuit_error * (here.volt - here.ocv))
    white = whitening(spread, stack, extra_volt=extra)
    nuisances = _shared(stack, model, tolerance, asked)
    columns = [_derivative(cell, stack, model, here.volt, {f.name: f.step}) for f in nuisances]
    labels, own = _labelled(candidates(predict, here.volt, model.values, library))
    inside, more = _inside(cell, stack, model, here.volt, asked)
    labels, own = (*inside, *labels), [*more, *own]
    columns = white.apply(np.stack([*columns, *own], axis=1))
    starts = {f"soc0[{k}]": plain.SOC_STEP for k in range(len(stack.first))}
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
    found : Information. tolerance : plain.Tolerance, for what is known of the nuisances.

    Returns
    -------
    projection : Projection.
    """
    size = len(found.nuisances)
    prior = np.diag([f.std**-2.0 for f in found.nuisances])
    prior += plain.coupling(found.nuisances, tolerance)
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
    plains = plain.frees(stack, model.values, tolerance)
    shared = [f for f in plains if not f.name.startswith(("soc0[", "known"))]
    shared.append(Free("known", plain.LOG_STEP, 1.0, tolerance.known))
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
