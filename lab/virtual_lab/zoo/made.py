"""A cell of the campaign as it was made, and its row of the truth."""

from typing import NamedTuple

import numpy as np

from virtual_lab.zoo import effects, march, metering, strength, tests_of_cells
from virtual_lab.zoo.cell import COURSE, Specimen
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

    @property
    def has_sensor(self) -> bool:
        """Every other cell has a sensor; where the sheet's temperature is wrong there is none."""
        return int(self.name[1:]) % 2 == 0 and not self.specimen.meter.sheet_kelvin


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
        "sizes": [None if size is None else _short(size) for size in sizes_of(made, effect)],
    }


def sizes_of(made: Made, effect: Effect) -> list:
    """What an effect comes to in the cell, as people use it; None where a form has no such number.

    A form's own parameters are those of its equation: the amplitude of two waves of entropy is no
    entropic coefficient. Numbers and order are those that a verdict tells of the effect: kJ/mol of
    all resistances between the coldest and the warmest record that is fitted; mV/K, or mΩ, at 10,
    50 and 90 % SoC; mΩ on discharge, and on charge there; K/W between what was logged and the core;
    mA; s; mV; % of a reading; % of capacity, lost or between these temperatures; mΩ, minutes of a
    pair.
    """
    told = SIZES.get(effect.form.effect)
    return told(made, effect) if told else []


def _fitted_celsius(made):
    fitted, _ = tests_of_cells.LAYOUTS[made.wanted.layout]
    return min(fitted), max(fitted)


def _at_thirds(course):
    return np.interp(THIRDS, COURSE, course)


def _energy(made, effect):
    cell = made.specimen.cell
    inverse = 1 / (march.GAS * (np.array(_fitted_celsius(made)) + 273.15))
    factors = np.exp(np.outer(cell.energy, inverse - inverse.mean()))
    cold, warm = np.array(cell.r) @ factors
    return [1e-3 * np.log(cold / warm) / (inverse[0] - inverse[1])]


def _ohmic(made, effect):
    cell = made.specimen.cell
    return list(1e3 * cell.r[0] * _at_thirds(cell.course[0]))


def _relaxing(made, effect):
    cell = made.specimen.cell
    pairs = zip(cell.r[1:], cell.course[1:], strict=True)
    return list(1e3 * sum(r * _at_thirds(course) for r, course in pairs))


def _both_directions(made, effect):
    cell = made.specimen.cell
    ohm = 1e3 * cell.r[0] * cell.course[0]
    return [ohm.mean(), *_at_thirds(ohm * (1 + cell.on_charge))]


def _inside(made, effect):
    """A sensor shows the can: what is left is the core above it."""
    cell = made.specimen.cell
    return [cell.core[0] if made.has_sensor else cell.core[0] + cell.can[0], None]


def _bend(made, effect):
    share, kelvin = made.specimen.cell.ampere_hour_bend
    beside = (np.array(_fitted_celsius(made)) - 25.0) / kelvin
    return [100 * share * np.diff(np.tanh(beside))[0]]


def _pair(made, effect):
    if effect.name != "third_pair":
        return [None, None]
    return [1e3 * effect.size, effect.drawn["time_constant_second"] / 60]


THIRDS = (0.1, 0.5, 0.9)  # SoC at which a verdict tells a course
SIZES = {
    "resistance_temperature": _energy,
    "entropic_ocv": lambda made, effect: list(1e3 * _at_thirds(made.specimen.cell.entropy)),
    "resistance_soc": _ohmic,
    "polarisation_soc": _relaxing,
    "resistance_asymmetry": _both_directions,
    "self_heating": _inside,
    "capacity_temperature": _bend,
    "slow_diffusion": _pair,
    "leakage": lambda made, effect: [1e3 * made.specimen.cell.leak.mean(), None],
    "current_offset": lambda made, effect: [1e3 * effect.size, None],
    "hysteresis_instant": lambda made, effect: [1e3 * effect.size],
    "hysteresis_one_state": lambda made, effect: [1e3 * effect.size, None],
    "capacity_error": lambda made, effect: [100 * effect.size, None],
    "voltage_gain": lambda made, effect: [100 * effect.size],
    "time_skew": lambda made, effect: [effect.size],
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
