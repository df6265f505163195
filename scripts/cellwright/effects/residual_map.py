"""Where a model and the measurement disagree: by record, SoC, rate and sign, and temperature."""

import numpy as np

BANDS = 10  # of the SoC
LOW_C_RATE, HIGH_C_RATE = 0.05, 0.7
RATES = ("rest", "discharge_low", "discharge_high", "charge_low", "charge_high")
LEAST_ROWS = 5


def rate_of(current_ampere, capacity_ampere_hour):
    """Number of the class of RATES of each row."""
    rate = np.asarray(current_ampere) / capacity_ampere_hour
    size = np.abs(rate)
    high = (size > HIGH_C_RATE).astype(int)
    return np.where(size <= LOW_C_RATE, 0, np.where(rate < 0, 1 + high, 3 + high))


def residual_map(stack, role, soc, before, after, capacity_ampere_hour, rows):
    """RMS and mean of what two models leave, over record, band of the SoC and class of the rate.

    Parameters
    ----------
    stack : records.Stack. role : "fit" or "validation". soc : (n,) [1].
    before, after : (n,) residuals [V]. capacity_ampere_hour : [Ah].
    rows : (n,) bool, rows that count.

    Returns
    -------
    found : dict of lists, one entry a class that holds five rows or more.
    """
    band = np.clip((soc * BANDS).astype(int), 0, BANDS - 1)
    rate = rate_of(stack.current_ampere, capacity_ampere_hour)
    key = (stack.file * BANDS + band) * len(RATES) + rate
    entries = []
    for number in np.unique(key[rows]):
        here = rows & (key == number)
        if here.sum() < LEAST_ROWS:
            continue
        file, rest = divmod(int(number), BANDS * len(RATES))
        low, kind = divmod(rest, len(RATES))
        entries.append(
            {
                "role": role,
                "test": stack.tests[file],
                "soc_low": low / BANDS,
                "soc_high": (low + 1) / BANDS,
                "rate": RATES[kind],
                "temperature_celsius": float(stack.celsius[here].mean()),
                "rows": int(here.sum()),
                "before_rms_volt": float(np.sqrt(np.mean(before[here] ** 2))),
                "before_mean_volt": float(before[here].mean()),
                "after_rms_volt": float(np.sqrt(np.mean(after[here] ** 2))),
                "after_mean_volt": float(after[here].mean()),
            }
        )
    return {name: [entry[name] for entry in entries] for name in entries[0]} if entries else {}


def joined(maps):
    """Several maps as one."""
    maps = [one for one in maps if one]
    return {name: [v for one in maps for v in one[name]] for name in maps[0]} if maps else {}


def worst(found, floor_volt):
    """The class that holds the largest share of what is left beyond the floor, or None.

    Parameters
    ----------
    found : dict of lists, from `residual_map`. floor_volt : [V].

    Returns
    -------
    place : dict with file, soc, current, temperature_celsius and share, as in the contract.
    """
    if not found:
        return None
    excess = np.array(found["rows"]) * np.maximum(
        np.square(found["after_rms_volt"]) - floor_volt**2, 0.0
    )
    if excess.sum() <= 0:
        return None
    k = int(np.argmax(excess))
    return {
        "file": found["test"][k],
        "soc": [found["soc_low"][k], found["soc_high"][k]],
        "current": found["rate"][k],
        "temperature_celsius": [found["temperature_celsius"][k]],
        "share": float(excess[k] / excess.sum()),
    }
