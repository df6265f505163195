"""A cell of the campaign as it was made, and its row of the truth."""

from typing import NamedTuple

import numpy as np

from virtual_lab.zoo import effects, metering, strength
from virtual_lab.zoo.cell import Specimen
from virtual_lab.zoo.planned import Wanted

TOLD = 3  # names of which the truth says how much they explain


class Effect(NamedTuple):
    """One form in one cell: signed size, drawn parameters."""

    name: str
    size: float
    drawn: dict

    @property
    def form(self) -> effects.Form:
        return effects.FORMS[self.name]

    def act(self, specimen: Specimen) -> Specimen:
        return self.form.act(specimen, self.size, self.drawn)


class Made(NamedTuple):
    """A cell of the campaign: name, what was wanted, the healthy specimen, its effects."""

    name: str
    wanted: Wanted
    plain: Specimen
    effects: tuple[Effect, ...]

    @property
    def specimen(self) -> Specimen:
        """With all effects, and with the fault of its sheet or sensor."""
        specimen = self.plain
        for effect in self.effects:
            specimen = effect.act(specimen)
        if self.wanted.fault:
            form = effects.SHEETS[self.wanted.fault]
            specimen = form.act(specimen, form.first, {})
        return specimen


def truth_row(made: Made, without: strength.Left, together: strength.Left, gaps: list) -> dict:
    """Row of missing_effect.json.

    Parameters
    ----------
    made : the cell. without, together : what a plain circuit leaves without and with all effects.
    gaps : of each effect by itself, what is left, and the shares that names explain of it.
    """
    meter = made.plain.meter
    noise = float(np.hypot(meter.white_volt, metering.VOLT_STEP / np.sqrt(12)))
    entries = [
        _entry(made, effect, left, without, shares)
        for effect, (left, shares) in zip(made.effects, gaps, strict=True)
    ]
    if made.wanted.kind == "sheet":
        entries = [_fault_entry(made.wanted.fault)]
    shown = bool(made.effects) and any(strength.visible(left, without, noise) for left, _ in gaps)
    return {
        "cell": made.name,
        "kind": made.wanted.kind,
        "zoo": "forms",
        "visible": bool(shown),
        "none_acceptable": not shown,
        "unproven": made.wanted.layout == "unproven",
        "floor_volt": round(noise, 6),
        "base_volt": {
            "fit": _short(without.fit_volt),
            "validation": _short(without.validation_volt),
        },
        "left_volt": {
            "fit": _short(together.fit_volt),
            "validation": _short(together.validation_volt),
        },
        "chemistry": made.plain.cell.chemistry,
        "layout": made.wanted.layout,
        "fault": made.wanted.fault,
        "slow_charge_held": made.plain.held,
        "effects": entries,
    }


def _entry(made, effect, left, without, shares):
    form, target = effect.form, 1e3 * made.wanted.strength_volt
    best = sorted(shares, key=shares.get, reverse=True)
    same = [name for name in best if shares[name] >= 1 - strength.SAME_DATA]
    own = [] if effect.name in effects.OUTSIDE else [form.effect]
    fit = float(np.sqrt(max(left.fit_volt**2 - without.fit_volt**2, 0.0)))
    judging = float(np.sqrt(max(left.validation_volt**2 - without.validation_volt**2, 0.0)))
    drawn = {name: _short(value) for name, value in effect.drawn.items()}
    return {
        "effect": form.effect,
        "form": effect.name,
        "parameters": {form.parameter: _short(effect.size), **drawn},
        "target_gap_millivolt": round(target, 3),
        "visible_gap_millivolt": round(1e3 * fit, 3),
        "validation_gap_millivolt": round(1e3 * judging, 3),
        "accept": own + [name for name in same if name != form.effect],
        "parts": list(form.parts),
        "explained": {name: round(shares[name], 3) for name in best[:TOLD]},
    }


def _fault_entry(name):
    form = effects.SHEETS[name]
    return {
        "effect": form.effect,
        "form": name,
        "parameters": {form.parameter: form.first},
        "accept": [form.effect],
    }


def _short(value):
    return float(f"{value:.5g}")
