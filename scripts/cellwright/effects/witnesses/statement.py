"""What a measurement says of a quantity, and the rule by which it agrees with a verdict."""

from typing import NamedTuple

import numpy as np

from cellwright.records.conditions import stated_or_reference

AGREES, CONTRADICTS, SILENT = "agrees", "contradicts", "silent"
DEVIATIONS = 2.0  # combined standard deviations up to which two stated sizes are the same
FACTOR = 1.5  # up to which two sizes of one sign are the same where deviations are not stated
LEAST_VOLT = 5e-3  # of voltage at the rated current, below which nobody acts on a resistance
LEAST_SHARE = 0.02  # of the capacity, below which nobody acts on it
FEWEST = 3  # readings whose spread is a deviation


class Measured(NamedTuple):
    """What one kind of measurement reads of a quantity, before it is held against a verdict.

    name : of the measurement. quantity : what it reads, a name in `quantities.QUANTITIES`: effects
    of that `Effect.quantity` would show in it. words : the quantity in words. at : the conditions
    under which it was measured. value, std : as measured, the deviation NaN where it is
    not stated. unit : "1" of a factor. neutral : the value where the effect is absent. material :
    whether the difference is large enough for somebody to act on. reason : why it tells nothing,
    else "".
    """

    name: str
    quantity: str
    words: str = ""
    at: tuple = ()
    value: float = np.nan
    std: float = np.nan
    unit: str = "1"
    neutral: float = 0.0
    material: bool = False
    reason: str = ""


class Witness(NamedTuple):
    """An independent measurement beside the verdict on one effect.

    name : of the measurement. effect : id. named : whether the verdict names it. says : "agrees",
    "contradicts" or "silent". measured, implied : the same quantity as measured and as the verdict
    has it [unit]; for an effect that is not named, implied is its value without the effect.
    std : combined standard deviation, NaN where none is stated. shown : whether the measurement by
    itself shows the effect, large enough for somebody to act on and in the verdict's direction: it
    may do so with another size than the verdict's. text : one sentence.
    """

    name: str
    effect: str
    named: bool
    says: str
    measured: float
    implied: float
    unit: str
    std: float
    shown: bool
    text: str


def silent(name, quantity, reason):
    """A measurement that tells nothing of a quantity, and why."""
    return Measured(name, quantity, reason=reason)


def same(measured, implied, std, *, neutral=0.0):
    """Whether two sizes of one quantity are the same.

    With a stated deviation: within two of them. Without: both on one side of `neutral`, and their
    sizes within a factor of 1.5; the size of a factor (neutral 1) is its logarithm.

    Parameters
    ----------
    measured, implied : in one unit. std : combined standard deviation, or NaN.
    neutral : value where there is no effect.
    """
    if np.isfinite(std) and std > 0:
        return bool(abs(measured - implied) <= DEVIATIONS * std)
    ours, theirs = (size_of(value, neutral) for value in (measured, implied))
    if ours * theirs <= 0:
        return False
    return bool(1 / FACTOR <= ours / theirs <= FACTOR)


def rules_out(measured, value, std):
    """Whether a measurement rules an effect out, and not only the size that a search found for it.

    1. Measurement and search both state how sure they are, and they differ by more than two
       combined standard deviations.
    2. The measurement by itself, within two of its deviations, is what it would be without the
       effect, or on the other side of that. A measurement that shows the effect with another size
       leaves it its name.

    Parameters
    ----------
    measured : Measured. value, std : of the same quantity by the search; std NaN where not stated.
    """
    if not np.isfinite([measured.std, value, std]).all() or not measured.std > 0:
        return False
    if abs(measured.value - value) <= DEVIATIONS * np.hypot(measured.std, std):
        return False
    along = size_of(measured.value, measured.neutral) * size_of(value, measured.neutral) > 0
    absent = abs(measured.value - measured.neutral) <= DEVIATIONS * measured.std
    return bool(absent or not along)


def size_of(value, neutral):
    """Signed distance from the value without an effect; of a factor the logarithm."""
    return float(np.log(max(value, 1e-9))) if neutral == 1.0 else value - neutral


def is_material(factor, volt):
    """Whether somebody acts on a change of a resistance: more than a factor of 1.5, and 5 mV.

    Parameters
    ----------
    factor : of the resistance. volt : change of the voltage at 1C [V].
    """
    return bool(abs(np.log(factor)) > np.log(FACTOR) and abs(volt) > LEAST_VOLT)


def celsius_of(row, name="ambient_temperature_celsius"):
    """Temperature of a row of a table [degC].

    Parameters
    ----------
    row : dict. name : of its column.
    """
    return float(stated_or_reference(row.get(name)))


def cycle_of(row):
    """Number of the check-up of a row; a test without one was made on the fresh cell."""
    cycle = row.get("cycle")
    return 0.0 if cycle is None or not np.isfinite(cycle) else float(cycle)


def spread(values):
    """Standard deviation of three or more readings; of fewer it is not known (NaN)."""
    known = np.asarray(values, float)
    known = known[np.isfinite(known)]
    return float(np.std(known, ddof=1)) if len(known) >= FEWEST else np.nan


UNITS = {
    "J/mol": (1e-3, "kJ/mol"),
    "Ohm": (1e3, "mΩ"),
    "V": (1e3, "mV"),
    "A": (1e3, "mA"),
    "V/K": (1e3, "mV/K"),
    "1/K": (1e2, "%/K"),
    "share": (1e2, "%"),
    "1": (1.0, ""),
}


def in_words(value, unit, std=np.nan):
    """A number as people read it: value, deviation where it is known, unit.

    Parameters
    ----------
    value, std : in `unit`, one of `UNITS` or any other, which then stands as it is. unit : str.
    """
    times, name = UNITS.get(unit, (1.0, unit))
    number = f"{times * value:.3g}"
    if std is not None and np.isfinite(std) and std > 0:
        number += f" ± {times * std:.2g}"
    return f"{number} {name}".strip().replace("-", "−")
