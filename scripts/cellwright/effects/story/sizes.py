"""Sizes of the effects of a verdict as people use them, with their standard deviations."""

from typing import NamedTuple

import numpy as np

from cellwright.effects.base import LOGARITHMS
from cellwright.effects.witnesses.statement import UNITS

STEP_STDS = 0.01  # of a parameter's deviation, by which a slope is read
LEAST_DEVIATION = 1e-3  # of the value: none that is smaller is written
SIZED = 2.0  # standard deviations from where an effect is absent: 95 %
SHOWN = {unit: UNITS[unit] for unit in ("Ohm", "V", "J/mol")}  # of a size as fitted


class Size(NamedTuple):
    """One size: `name` in words, `value` ± `std` in `unit`; std is NaN, as read from a file None,
    where none is stated."""

    name: str
    value: float
    std: float
    unit: str

    @property
    def text(self):
        """In words: name, value, deviation, and a unit that people write."""
        scale, unit = SHOWN.get(self.unit, (1.0, self.unit))
        number = f"{scale * self.value:.3g}"
        stated = self.std is not None and np.isfinite(self.std)
        if stated and self.std > LEAST_DEVIATION * abs(self.value):
            number += f" ± {float(f'{scale * self.std:.1g}'):g}"
        return f"{self.name} {number} {unit}".strip().replace("-", "−")


class Fitted(NamedTuple):
    """How sure parameters are together: their names, and covariances (p, p) of which the one that
    gives a size the larger variance counts."""

    names: tuple
    covariances: tuple

    @property
    def stds(self):
        """Standard deviations by name: dict."""
        variances = np.max([np.diag(one) for one in self.covariances], axis=0)
        return dict(zip(self.names, np.sqrt(np.maximum(variances, 0.0)).tolist(), strict=True))


def sizes_as_used(effect, parameters, values=None, fitted=None):
    """Sizes of one effect as people use them, with their standard deviations.

    Parameters
    ----------
    effect : Effect. parameters : of the verdict: name → {value, std, unit}.
    values : dict of the model's parameters, with capacity_ampere_hour; what needs them and lacks
        them is given by the effect's own parameters.
    fitted : Fitted of the model, with names as in `values`: knots of one course, or an energy and
        its growth towards the cold, are sure together only. None: a deviation adds up those of the
        effect's parameters, as if they were independent.

    Returns
    -------
    sizes : tuple of Size.
    """
    own = {name: one["value"] for name, one in parameters.items()}
    known = values is not None and all(name in values for name in LOGARITHMS)
    if effect.sizes_in_words is None or not {p.name for p in effect.parameters} <= set(own):
        return _as_fitted(parameters)
    if effect.sizes_need_model and not (known and "capacity_ampere_hour" in values):
        return _as_fitted(parameters)
    fitted = fitted or _independent(effect, parameters)
    sizes = effect.sizes_in_words(effect, own, values or {})
    stds = _deviations(effect, own, values or {}, sizes, fitted)
    if any(p.get("at_bound") for p in parameters.values()):
        stds = np.where(stds > 0, stds, np.nan)  # what hangs on a bound alone states none
    return tuple(
        Size(name, float(value), float(std), unit)
        for (name, value, unit), std in zip(sizes, stds, strict=True)
    )


def has_size(effect, solution, values, fitted):
    """Whether an effect has a size that is told and acted on, and its leading one is on no bound.

    The interval of one of the sizes that people are told leaves out what it is without the effect:
    24.6 ± 0.4, 24.6 ± 0.6 and 26.6 ± 1.2 mΩ over SoC are no change to anyone. So does that of the
    change, for what it is without may be as unsure: 0.003 ± 0.009 mΩ on charge differs from 0.05 on
    discharge by nothing if that is ± 0.2. And one of its parameters is as large as its
    `Parameter.material`.

    Parameters
    ----------
    effect : Effect. solution : least_squares.Solution of a model with it. values, fitted : of that
    model, as in `sizes_as_used`.
    """
    if effect.names[0] in solution.at_bound:
        return False
    own, stds = effect.sizes_of(solution.values), fitted.stds
    free = [(p, n) for p, n in zip(effect.parameters, effect.names, strict=True) if not p.shape]
    if not any(abs(own[p.name] - p.neutral) >= p.material for p, _ in free):
        return False
    if effect.sizes_in_words is None:
        return any(abs(own[p.name] - p.neutral) > SIZED * stds.get(n, np.inf) for p, n in free)
    parameters = {
        p.name: {"value": own[p.name], "std": stds.get(n), "at_bound": n in solution.at_bound}
        for p, n in zip(effect.parameters, effect.names, strict=True)
    }
    words = effect.sizes_in_words
    # The same form of it, which no fit moves: a quicker pair is not held against R0.
    absent = {p.name: p.neutral if p.step else own[p.name] for p in effect.parameters}

    def change(effect, p, values):
        ends = words(effect, p, values), words(effect, absent, values)
        return [
            (name, at - none, unit) for (name, at, unit), (_, none, _) in zip(*ends, strict=True)
        ]

    told, changes = (
        sizes_as_used(effect._replace(sizes_in_words=one), parameters, values, fitted)
        for one in (words, change)
    )
    # A time constant is told, too, and is no size: it stays where the sizes are none.
    shaped = words(effect, own | {p.name: p.neutral for p, _ in free}, values)
    return any(
        size.value != at and abs(moved.value) > SIZED * np.maximum(size.std, moved.std)
        for size, moved, (_, at, _) in zip(told, changes, shaped, strict=True)
    )


def _independent(effect, parameters):
    """Fitted of the parameters of an effect that state a deviation, as if independent."""
    stds = {f"{effect.id}.{name}": p["std"] for name, p in parameters.items()}
    stds = {name: s for name, s in stds.items() if s is not None and np.isfinite(s)}
    return Fitted(tuple(stds), (np.diag(np.square(list(stds.values()))),))


def _deviations(effect, own, values, sizes, fitted):
    """Standard deviation of each size, by its slope over each parameter.

    Slopes and not whole deviations: a share of resistance that is unsure by more than itself, but
    sure together with another parameter, would leave what it can be.
    """
    stds = np.sqrt(np.max([np.diag(one) for one in fitted.covariances], axis=0))
    at, changes = [], []
    for k in np.flatnonzero(stds > 0):
        parameter = fitted.names[k].removeprefix(f"{effect.id}.")
        step = STEP_STDS * (stds[k] if np.isfinite(stds[k]) else 1.0)
        if parameter in own:
            moved = own | {parameter: own[parameter] + step}, values
        elif parameter in values and (parameter in LOGARITHMS or "." in parameter):
            moved = own, values | {parameter: values[parameter] + step}
        else:
            continue
        at.append(k)
        pairs = zip(effect.sizes_in_words(effect, *moved), sizes, strict=True)
        changes.append([(new[1] - old[1]) / step for new, old in pairs])
    if not at:
        return np.full(len(sizes), 0.0 if len(stds) else np.nan)
    variances = [
        np.einsum("ks,kl,ls->s", changes, one[np.ix_(at, at)], changes)
        for one in fitted.covariances
    ]
    variance = np.max(variances, axis=0)
    relative = effect.assumed_relative or (0.0,) * len(sizes)
    assumed = np.multiply(relative, [one[1] for one in sizes])
    return np.sqrt(np.maximum(variance, 0.0) + assumed**2)


def _as_fitted(parameters):
    """Parameters as they are, those with a deviation; of a group's branch the number is no size."""
    return tuple(
        Size(name_of(name, p["unit"]), p["value"], p["std"], "" if p["unit"] == "1" else p["unit"])
        for name, p in parameters.items()
        if p["std"] is not None
    )


def name_of(name, unit):
    """A parameter's name in words, without the unit, which stands behind the number.

    Parameters
    ----------
    name : of the parameter. unit : as in the verdict.
    """
    words = name.split("_")
    spelt = SPELT.get(unit, "").split()
    return " ".join(words[: -len(spelt)] if spelt and words[-len(spelt) :] == spelt else words)


SPELT = {
    "V": "volt",
    "A": "ampere",
    "Ohm": "ohm",
    "s": "second",
    "1/A": "per ampere",
    "K/W": "kelvin per watt",
    "V/K": "volt per kelvin",
    "1/K": "per kelvin",
    "J/mol": "joule per mole",
    "K": "kelvin",
}
