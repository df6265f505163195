"""Where a number was measured, in words that are the same in every run."""

import math

RATES = {
    **{f"C/{k}": 1 / k for k in (100, 50, 40, 30, 25, 20, 15, 10, 8, 5, 4, 3, 2)},
    **{f"{k:g}C": k for k in (1, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10, 15, 20)},
}


def rate(c_rate: float) -> str:
    """The customary rate next to this one: C/20, 1C.

    Parameters
    ----------
    c_rate : float [1/h]
        Current over rated capacity, of either sign.
    """
    if not c_rate or math.isnan(c_rate):
        return "rate not known"
    return min(RATES, key=lambda name: abs(math.log(abs(c_rate) / RATES[name])))


def celsius(temperature: float) -> str:
    """A chamber temperature [°C]."""
    return "temperature not known" if math.isnan(temperature) else f"{temperature:g} °C"


def where(*parts: str) -> str:
    """One place out of several parts, those that say nothing left out."""
    return ", ".join(part for part in parts if part)
