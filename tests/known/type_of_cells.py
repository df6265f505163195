"""Cells of one type that differ by loss and resistance: what the tests of the room recover."""

import numpy as np
import truth

from cellwright.bias.features import Shown

RATE = 0.5
CURRENT_AMPERE = RATE * truth.CAPACITY_AMPERE_HOUR


def ocv_change(loss, soc):
    """OCV of a cell that lost a share of its capacity, minus that of the fresh one [V]."""
    return loss * (0.2 * np.sin(np.pi * soc) + 0.3 * np.sin(3 * np.pi * soc) * soc)


def model(name, loss, ratio):
    """True model: resistances times `ratio`, OCV changed by the loss."""
    made = truth.model(name, scale=ratio)
    fine = np.linspace(0.02, 1.0, 50)
    entry = made["members"][0]["conditions"][0]
    for part, names in ((entry, ["r0_ohm"]), *((b, list(b)) for b in entry["branches"])):
        part |= {n: np.interp(fine, truth.KNOTS, part[n]).tolist() for n in names}
    entry |= {"soc": fine.tolist(), "ocv_shift_volt": ocv_change(loss, fine).tolist()}
    made["members"][0]["left_out_rmse_volt"] = 1e-3
    return made | {"capacity_ampere_hour": truth.CAPACITY_AMPERE_HOUR * (1 - loss)}


def charge(loss, ratio, noise, random):
    """A slow charge from empty: OCV plus the current times all resistances, by charge."""
    soc = np.linspace(0.0, 0.95, 200)
    total = ratio * sum(np.interp(soc, truth.KNOTS, r) for r in (truth.R0, *truth.R))
    volt = truth.ocv_at(soc) + ocv_change(loss, soc) + CURRENT_AMPERE * total
    volt += noise * random.normal(size=len(soc))
    size = truth.CAPACITY_AMPERE_HOUR * (1 - loss)
    return {"c_rate": RATE, "voltage_volt": volt, "charge_ampere_hour": soc * size}


def capacity_rows(loss, ratio):
    size, total = truth.CAPACITY_AMPERE_HOUR * (1 - loss), 0.09 * ratio
    about = {"c_rate": RATE, "ambient_temperature_celsius": 25.0, "cycle": None}
    about |= {"temperature_mean_celsius": 26.0, "capacity_ampere_hour": size}
    rows = []
    for direction, sign in (("charge", 1), ("discharge", -1)):
        volt = 3.6 + 0.1 * loss + sign * CURRENT_AMPERE * total
        current = {"mean_current_ampere": sign * CURRENT_AMPERE}
        held = {"constant_current_ampere_hour": size * (1 - 0.05 * ratio)}
        energy = {"energy_watt_hour": volt * size}
        rows.append(about | {"direction": direction} | current | held | energy)
    return tuple(rows)


def cell(name, loss, ratio, *, marked=False, noise=2e-4, seed=0, charges=True):
    """A cell as it shows itself, with its true model."""
    random = np.random.default_rng([seed, *name.encode()])
    onset = {10.0: 0.05 * ratio * (1 + 0.01 * random.normal())}
    shown = Shown(
        name,
        marked,
        truth.CAPACITY_AMPERE_HOUR * (1 - loss),
        model(name, loss, ratio),
        [],
        onset,
        {10.0: 0.06 * ratio * (1 + 0.01 * random.normal())},
        capacity_rows(loss, ratio),
    )
    return shown._replace(charges=(charge(loss, ratio, noise, random),)) if charges else shown


def drawn(count, seed=0, **settings):
    """The reference and `count` used cells: loss to a third, resistance that grows with it."""
    random = np.random.default_rng(seed)
    reference = cell("R", 0.0, 1.0, marked=True, seed=seed, **settings)
    losses = random.uniform(0.02, 0.33, count)
    ratios = (1 + 2 * losses) * np.exp(random.normal(0, 0.04, count))
    pairs = zip(losses, ratios, strict=True)
    return reference, [cell(f"C{k}", *p, seed=seed, **settings) for k, p in enumerate(pairs)]
