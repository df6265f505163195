"""Unit strings of instruments → the house's units, by a fixed table: no unit is ever guessed."""

import numpy as np

from ..refusal import Refusal

# Factor to the house's unit of the quantity: s, A, V, Ah, degC, ohm, Hz, 1.
UNITS = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "min": 60.0, "h": 3600.0, "d": 86400.0},
    "current": {"A": 1.0, "mA": 1e-3, "uA": 1e-6, "µA": 1e-6},
    "voltage": {"V": 1.0, "mV": 1e-3, "uV": 1e-6, "µV": 1e-6},
    "charge": {"Ah": 1.0, "A.h": 1.0, "mAh": 1e-3, "mA.h": 1e-3, "As": 1 / 3600, "C": 1 / 3600},
    "temperature": {"degC": 1.0, "°C": 1.0, "C": 1.0, "K": 1.0},
    "impedance": {"ohm": 1.0, "Ohm": 1.0, "Ω": 1.0, "mohm": 1e-3, "mOhm": 1e-3, "mΩ": 1e-3},
    "frequency": {"Hz": 1.0, "mHz": 1e-3, "kHz": 1e3},
    "count": {"1": 1.0, "": 1.0},
}
OFFSET = {"K": -273.15}
# Units as words, for labels such as test_time_millisecond.
WORDS = {
    "second": "s", "millisecond": "ms", "minute": "min", "hour": "h", "ampere": "A",
    "milliampere": "mA", "volt": "V", "millivolt": "mV", "ampere_hour": "Ah", "ah": "Ah",
    "celsius": "degC", "kelvin": "K", "ohm": "ohm", "hertz": "Hz", "dimensionless": "1",
}  # fmt: skip


def in_house_unit(values: np.ndarray, *, quantity: str, unit: str, label: str) -> np.ndarray:
    """Convert `values` [unit] of a quantity to the house's unit.

    Raises
    ------
    Refusal
        The unit is not one of those known for the quantity.
    """
    known = UNITS[quantity]
    if unit not in known:
        allowed = ", ".join(name or "none" for name in known)
        raise Refusal(f"column {label!r}: unknown unit {unit!r} of {quantity}; known: {allowed}")
    factor, offset = known[unit], OFFSET.get(unit, 0.0) if quantity == "temperature" else 0.0
    return values if factor == 1.0 and offset == 0.0 else values * factor + offset
