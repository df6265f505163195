"""Sizes of effects as people use them: mΩ at three states of charge, mA, % of capacity.

Each is a function (effect, p, values) → list of (name, value, unit), as `Effect.sizes_in_words`.
"""

from cellwright.effects.library.quantities import QUANTITIES, fields_with

THIRDS = (0.1, 0.5, 0.9)  # SoC at which a course is stated
# Between which the activation energy is stated, where those of the records fitted are not known.
WARMED_CELSIUS = (0.0, 25.0)
DAY_HOUR, MINUTE_SECOND = 24.0, 60.0


def at_thirds():
    """Names of the three states of charge at which a course is stated."""
    return [f"at {100 * soc:.0f} % SoC" for soc in THIRDS]


def over_soc(words, resistance, beside=None):
    """Resistance at three states of charge, with that of another effect of the model.

    Parameters
    ----------
    words : what it is a resistance of. resistance : function (fields) → (n,) [ohm].
    beside : name within the model of a resistance that adds to it, where the model has it.
    """

    def sizes(effect, p, values):
        ohm = resistance(fields_with(effect, p, values, soc=THIRDS)) + values.get(beside, 0.0)
        first, *others = zip(at_thirds(), ohm, strict=True)
        sizes = [(f"{words} {first[0]}", first[1]), *others]
        return [(name, 1e3 * one, "mΩ") for name, one in sizes]

    return sizes


def energy(effect, p, values):
    """Of the sum of all resistances: that is what pulses and spectra of other tests tell."""
    low, high = at = values.get("fitted_celsius", WARMED_CELSIUS)
    size = QUANTITIES["activation_energy"](effect, p, values, at)
    return [(f"activation energy from {low:.0f} to {high:.0f} °C", 1e-3 * size, "kJ/mol")]


def resistance_by_direction(effect, p, values):
    """The resistance that differs, on discharge, and on charge at three states of charge."""
    quicker = p["in_quicker_pair"]

    def ohm(current, soc):
        fields = fields_with(effect, p, values, soc=soc, current=current)
        return 1e3 * (fields.slow_ohm[0] if quicker else fields.r0)

    below, above = ohm(-1.0, 0.5)[0], ohm(1.0, THIRDS)
    first, *others = zip(at_thirds(), above, strict=True)
    name = "the quicker pair" if quicker else "R0"
    sizes = [(f"{name} on discharge", below), (f"on charge {first[0]}", first[1]), *others]
    return [(name, one, "mΩ") for name, one in sizes]


def as_is(parameter, unit, *, factor=1.0, name=""):
    """One parameter in another unit.

    Parameters
    ----------
    parameter : name. unit : in words. factor : of that unit over the parameter's. name : in words.
    """
    return lambda effect, p, values: [(name, factor * p[parameter], unit)]


def with_minutes(parameter, unit, *, factor=1.0):
    """One parameter as by `as_is`, and the time constant of its effect."""

    def sizes(effect, p, values):
        minutes = p["time_constant_second"] / MINUTE_SECOND
        return [("", factor * p[parameter], unit), ("time constant", minutes, "min")]

    return sizes


def current(parameter):
    """A current, and what of the capacity it moves in a day.

    parameter : its name.
    """

    def sizes(effect, p, values):
        sizes = [("", 1e3 * p[parameter], "mA")]
        if "capacity_ampere_hour" not in values:
            return sizes
        share = 100 * abs(p[parameter]) * DAY_HOUR / values["capacity_ampere_hour"]
        return [*sizes, ("", share, "% of SoC a day")]

    return sizes


def ocv(soc, names):
    """Change of the OCV.

    Parameters
    ----------
    soc : SoC at which it is stated [1]. names : of each, in words.
    """

    def sizes(effect, p, values):
        volt = fields_with(effect, p, values, soc=soc).ocv
        return [(name, 1e3 * one, "mV") for name, one in zip(names, volt, strict=True)]

    return sizes
