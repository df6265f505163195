"""Sizes of effects as people use them: kJ/mol, mΩ at three states of charge, mA, % of capacity."""

from typing import NamedTuple

import numpy as np

from cellwright.effects.base import LOGARITHMS
from cellwright.effects.witnesses.probes import PROBES, acted

THIRDS = (0.1, 0.5, 0.9)  # SoC at which a course is told
# Between which the activation energy is told, where those of the records fitted are not known.
WARMED_CELSIUS = (0.0, 25.0)
SMALL_RATE = 0.02  # of the capacity per hour: a current that charge transfer answers in proportion
DAY_HOUR, MINUTE_SECOND = 24.0, 60.0
STEP_STDS = 0.01  # of a parameter's deviation, by which a slope is read
DIFFUSION = "slow_diffusion.resistance_ohm"
LEAST_DEVIATION = 1e-3  # of the value: none that is smaller is written


class Size(NamedTuple):
    """One size: `name` in words, `value` ± `std` in `unit`; std is NaN where none is stated."""

    name: str
    value: float
    std: float
    unit: str

    @property
    def text(self):
        """In words: name, value, deviation, unit."""
        number = f"{self.value:.3g}"
        if np.isfinite(self.std) and self.std > LEAST_DEVIATION * abs(self.value):
            number += f" ± {float(f'{self.std:.1g}'):g}"
        return f"{self.name} {number} {self.unit}".strip().replace("-", "−")


class Fitted(NamedTuple):
    """How sure parameters are together: their names, and covariances (p, p) of which the one that
    gives a size the larger variance counts."""

    names: tuple
    covariances: tuple


def sizes_as_used(effect, parameters, values=None, fitted=None):
    """Sizes of one effect as people use them, with their standard deviations.

    Parameters
    ----------
    effect : Effect. parameters : of the verdict: name → {value, std, unit}.
    values : dict of the model's parameters, with capacity_ampere_hour; what needs them and lacks
        them is told by the effect's own parameters.
    fitted : Fitted of the model, with names as in `values`: knots of one course, or an energy and
        its growth towards the cold, are sure together only. None: a deviation adds up those of the
        effect's parameters, as if they were independent.

    Returns
    -------
    sizes : tuple of Size.
    """
    own = {name: one["value"] for name, one in parameters.items()}
    form = FORMS.get(effect.id)
    known = values is not None and all(name in values for name in LOGARITHMS)
    if form is None or not {p.name for p in effect.parameters} <= set(own):
        return _as_fitted(parameters)
    if effect.id in OF_THE_MODEL and not (known and "capacity_ampere_hour" in values):
        return _as_fitted(parameters)
    fitted = fitted or _independent(effect, parameters)
    told = form(effect, own, values or {})
    stds = _deviations(effect, form, own, values or {}, told, fitted)
    if any(p.get("at_bound") for p in parameters.values()):
        stds = np.where(stds > 0, stds, np.nan)  # what hangs on a bound alone states none
    return tuple(
        Size(name, float(value), float(std), unit)
        for (name, value, unit), std in zip(told, stds, strict=True)
    )


def _independent(effect, parameters):
    """Fitted of the parameters of an effect that state a deviation, as if independent."""
    stds = {f"{effect.id}.{name}": p["std"] for name, p in parameters.items()}
    stds = {name: s for name, s in stds.items() if s is not None and np.isfinite(s)}
    return Fitted(tuple(stds), (np.diag(np.square(list(stds.values()))),))


def _deviations(effect, form, own, values, told, fitted):
    """Standard deviation of each size, by its slope over each parameter.

    Slopes and not whole deviations: a share of resistance that is unsure by more than itself, but
    sure together with another parameter, would leave what it can be.
    """
    stds = np.sqrt(np.max([np.diag(one) for one in fitted.covariances], axis=0))
    at, changes = [], []
    for k in np.flatnonzero(stds > 0):
        parameter, step = fitted.names[k].removeprefix(f"{effect.id}."), STEP_STDS * stds[k]
        if parameter in own:
            moved = form(effect, own | {parameter: own[parameter] + step}, values)
        elif parameter in values and (parameter in LOGARITHMS or "." in parameter):
            moved = form(effect, own, values | {parameter: values[parameter] + step})
        else:
            continue
        at.append(k)
        changes.append([(new[1] - old[1]) / step for new, old in zip(moved, told, strict=True)])
    if not at:
        return np.full(len(told), 0.0 if len(stds) else np.nan)
    variances = [
        np.einsum("ks,kl,ls->s", changes, one[np.ix_(at, at)], changes)
        for one in fitted.covariances
    ]
    variance = np.max(variances, axis=0)
    assumed = ASSUMED_RELATIVE.get(effect.id, 0.0) * np.array([one[1] for one in told])
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


def _energy(effect, p, values):
    """Of the sum of all resistances: that is what pulses and spectra of other tests tell."""
    low, high = at = values.get("fitted_celsius", WARMED_CELSIUS)
    energy = PROBES["activation_energy"](effect, p, values, at)
    return [(f"activation energy from {low:.0f} to {high:.0f} °C", 1e-3 * energy, "kJ/mol")]


def _over_soc(words, resistance, beside=None):
    """Resistance at three states of charge, with that of another effect of the model by its name.

    What relaxes does so in diffusion, too, where the model has a name for that.
    """

    def told(effect, p, values):
        ohm = resistance(acted(effect, p, values, soc=THIRDS)) + values.get(beside, 0.0)
        sizes = [
            (f"at {100 * soc:.0f} % SoC", 1e3 * one, "mΩ")
            for soc, one in zip(THIRDS, ohm, strict=True)
        ]
        return [(f"{words} {sizes[0][0]}", *sizes[0][1:]), *sizes[1:]]

    return told


def _asymmetry(effect, p, values):
    below = acted(effect, p, values, current=-1.0).r0[0]
    ohm = 1e3 * acted(effect, p, values, soc=THIRDS, current=1.0).r0
    words = [f"at {100 * soc:.0f} % SoC" for soc in THIRDS]
    first = [("R0 on discharge", 1e3 * below, "mΩ"), (f"on charge {words[0]}", ohm[0], "mΩ")]
    return [*first, *((word, one, "mΩ") for word, one in zip(words[1:], ohm[1:], strict=True))]


def _lead(effect, p, values):
    return [("", 1e3 * p["resistance_ohm"], "mΩ")]


def _charge_transfer(effect, p, values):
    rates = np.array([-SMALL_RATE, -1.0, -3.0, 3.0])
    current = rates * values["capacity_ampere_hour"]
    ohm = acted(effect, p, values, current=current).ohmic / current
    names = ("R0 at small currents", "at 1C", "at 3C", "charging at 3C")
    return [(name, 1e3 * one, "mΩ") for name, one in zip(names, ohm, strict=True)]


def _diffusion(effect, p, values):
    minutes = p["time_constant_second"] / MINUTE_SECOND
    return [("", 1e3 * p["resistance_ohm"], "mΩ"), ("time constant", minutes, "min")]


def _hysteresis(effect, p, values):
    sizes = [("half the distance of charge and discharge", 1e3 * p["amplitude_volt"], "mV")]
    if "rate_per_soc" not in p:
        return sizes
    turned = "small turns close their loop, " if p["small_loops_close"] else ""
    return [*sizes, (f"{turned}turned over within", 100 / p["rate_per_soc"], "% of SoC")]


def _heating(effect, p, values):
    minutes = p["time_constant_second"] / MINUTE_SECOND
    warm = p["thermal_resistance_kelvin_per_watt"]
    return [("", warm, "K for each watt"), ("time constant", minutes, "min")]


def _entropic(effect, p, values):
    warm, cold = (acted(effect, p, values, soc=THIRDS, celsius=c).ocv for c in (26.0, 25.0))
    names = (f"at {100 * soc:.0f} % SoC" for soc in THIRDS)
    return [(name, 1e3 * one, "mV/K") for name, one in zip(names, warm - cold, strict=True)]


def _capacity_temperature(effect, p, values):
    """Between the temperatures fitted: a capacity falls in the cold and hardly rises in warmth."""
    low, high = values.get("fitted_celsius", WARMED_CELSIUS)
    cold, middle, warm = acted(effect, p, values, celsius=[low, 25.0, high]).capacity
    name = f"from {low:.0f} to {high:.0f} °C"
    return [(name, 100 * (warm - cold) / middle, "% of capacity")]


def _capacity(effect, p, values):
    now, before = (acted(one, p, values).capacity[0] for one in (effect, None))
    sizes = [("", 100 * (now / before - 1), "% of capacity")]
    return [*sizes, ("", now - before, "Ah")] if "capacity_ampere_hour" in values else sizes


def _lost(effect, p, values):
    return [("", 100 * p["lost_share_of_charge"], "% of what is charged")]


def _current(name, sign=1.0):
    def told(effect, p, values):
        sizes = [("", 1e3 * p[name], "mA")]
        if "capacity_ampere_hour" not in values:
            return sizes
        share = 100 * abs(p[name]) * DAY_HOUR / values["capacity_ampere_hour"]
        return [*sizes, ("", share, "% of SoC a day")]

    return told


def _share(name):
    return lambda effect, p, values: [("", 100 * p[name], "% of reading")]


def _volt(effect, p, values):
    return [("", 1e3 * p["offset_volt"], "mV")]


def _skew(effect, p, values):
    return [("voltage behind current by", p["voltage_delay_second"], "s")]


def _moved(effect, p, values):
    volt = acted(effect, p, values, soc=THIRDS).ocv
    names = (f"at {100 * soc:.0f} % SoC" for soc in THIRDS)
    return [(name, 1e3 * one, "mV") for name, one in zip(names, volt, strict=True)]


def _edges(effect, p, values):
    volt = acted(effect, p, values, soc=[0.0, 1.0]).ocv
    names = "when empty", "when full"
    return [(name, 1e3 * one, "mV") for name, one in zip(names, volt, strict=True)]


FORMS = {
    "resistance_temperature": _energy,
    "resistance_soc": _over_soc("R0", lambda fields: fields.r0),
    "polarisation_soc": _over_soc("what relaxes", lambda fields: sum(fields.slow_ohm), DIFFUSION),
    "resistance_asymmetry": _asymmetry,
    "lead_resistance": _lead,
    "charge_transfer_nonlinearity": _charge_transfer,
    "slow_diffusion": _diffusion,
    "hysteresis_instant": _hysteresis,
    "hysteresis_one_state": _hysteresis,
    "self_heating": _heating,
    "entropic_ocv": _entropic,
    "capacity_temperature": _capacity_temperature,
    "capacity_error": _capacity,
    "coulombic_inefficiency": _lost,
    "leakage": _current("leak_ampere"),
    "current_offset": _current("offset_ampere"),
    "current_gain": _share("gain_relative"),
    "voltage_gain": _share("gain_relative"),
    "voltage_offset": _volt,
    "time_skew": _skew,
    "ocv_shift": _moved,
    "ocv_edge": _edges,
}
# Sizes that are changes of the model's own resistances.
OF_THE_MODEL = {
    "resistance_temperature",
    *("resistance_soc", "polarisation_soc", "resistance_asymmetry"),
    "charge_transfer_nonlinearity",
}
# ASSUME: The activation energy by which own heat is told (30 kJ/mol) is sure to four tenths, for
# the resistances of the real cells of docs/temperature.md and docs/missing-effect.md have 13 to 37;
# records of one temperature show its product with the thermal resistance alone.
ASSUMED_RELATIVE = {"self_heating": (0.4, 0.0)}
