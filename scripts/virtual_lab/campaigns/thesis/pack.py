"""Fifty cells of one used pack, each by itself and all of them in series (S14, S17, S18)."""

from functools import cache, partial
from typing import NamedTuple

import numpy as np

from virtual_lab import ageing, faults, file_faults, protocols, stock
from virtual_lab.chain import TYPICAL, Chain
from virtual_lab.chamber import wobbling
from virtual_lab.plan import Cell, Test, seed_of
from virtual_lab.specimens import Behavioural

KIND = "D"
COUNT = 50
RATING = ageing.KINDS[KIND].rating
# The worst of 50 used cells have lost a third (figure 4.23).
LEAST_AMPERE_HOUR, MOST_AMPERE_HOUR = 20.5, 29.5
# Resistance grows as capacity falls, in a line, with a scatter of a few percent (S14).
GROWTH_PER_LOSS, SCATTER = 2.0, 0.04
INSTRUMENTS = ("arbin", "bdf", "parquet", "bitrode", "digatron", "plett", "digatron_german")
SCHEDULES = ("dst", "sftp", "ftp72")
# Converters settle in 2 ms, a thermocouple under tape in half a minute; both sensors of
# temperature are a little off.
CHAIN = Chain(
    voltage_noise_volt=2e-4,
    current_noise_ampere=5e-3,
    voltage_lag_second=2e-3,
    current_lag_second=2e-3,
    surface_lag_second=30.0,
    surface_offset_celsius=0.2,
    chamber_offset_celsius=-0.3,
)
WOBBLE = {"amplitude_kelvin": 0.3, "period_second": 1500.0, "duration_second": 40 * 3600.0}
SERIES_SHARE = 0.9  # of what the weakest cell holds
REFERENCE = "P01"
LOSSES = ("lli", "lam_negative", "lam_positive")
# What goes wrong in laboratories: in records, and with whole files.
SPOILED = {
    "P03": (partial(faults.spikes, seed=3, count=6, size_volt=0.05),),
    "P09": (partial(faults.gap, begin_second=4000.0, end_second=4900.0),),
    "P14": (partial(faults.no_values, seed=14, channel="surface_celsius"),),
    "P15": (partial(faults.repeats, seed=15, count=6), partial(faults.swapped_rows, seed=15)),
    "P21": (partial(faults.clock_reset, at_second=5000.0),),
    "P27": (partial(faults.lost_records, seed=27, share=0.02),),
    "P33": (partial(faults.noise_bursts, seed=33),),
}
DAMAGED = {
    "P08": file_faults.cut_off,
    "P16": file_faults.emptied,
    "P20": file_faults.header_only,
    "P26": partial(file_faults.torn_row, seed=26),
    "P35": partial(file_faults.damaged, seed=35),
}


class Used(NamedTuple):
    """A used cell, and the capacity [Ah] that it gives at C/2."""

    name: str
    capacity_ampere_hour: float
    specimen: Behavioural


@cache
def cells(seed: int) -> tuple[Used, ...]:
    """All fifty; the first is fresh."""
    random = np.random.default_rng(seed_of("pack", seed))
    capacities = np.append(
        MOST_AMPERE_HOUR, random.triangular(LEAST_AMPERE_HOUR, 27.5, MOST_AMPERE_HOUR, COUNT - 1)
    )
    return tuple(used(f"P{k:02d}", float(q), random) for k, q in enumerate(capacities, 1))


def used(name: str, capacity: float, random: np.random.Generator) -> Used:
    """A cell of a capacity [Ah], its losses and its resistance drawn."""
    lost = max(0.0, 1 - capacity / MOST_AMPERE_HOUR)
    lam_positive = lost * float(random.uniform(0.3, 0.7))
    resistance = (1 + GROWTH_PER_LOSS * lost) * float(np.exp(random.normal(0.0, SCATTER)))
    make = partial(_worn, capacity, lam_positive, resistance)
    return Used(name, capacity, Behavioural(make, known=partial(_losses, capacity, lam_positive)))


def _worn(capacity, lam_positive, resistance):
    losses = stock.worn(KIND, capacity, lam_positive=lam_positive)
    return stock.cell(KIND, resistance=resistance, **losses)


def _losses(capacity, lam_positive):
    losses = stock.worn(KIND, capacity, lam_positive=lam_positive)
    shown = {loss: round(losses.get(loss, 0.0), 6) for loss in LOSSES}
    return {"health": [{"capacity_ampere_hour": round(capacity, 4), **shown}]}


def tests_and_cells(seed: int) -> tuple[list[Cell], list[Test]]:
    """Rows of the sheet and all tests."""
    rows = [
        Cell(one.name, "NMC", RATING, one.specimen, one.name == REFERENCE, "of a used pack")
        for one in cells(seed)
    ]
    weakest = min(one.capacity_ampere_hour for one in cells(seed))
    string = protocols.series_drive(RATING, schedule="fuds", ampere_hour=SERIES_SHARE * weakest)
    tests = [test for k, one in enumerate(cells(seed)) for test in _tests(one, k, seed, string)]
    return rows, tests


def _tests(one, number, seed, string):
    full, instrument = one.capacity_ampere_hour, INSTRUMENTS[number % len(INSTRUMENTS)]
    schedule = SCHEDULES[number % len(SCHEDULES)]
    at = partial(
        Test,
        one.name,
        ambient_celsius=25.0,
        instrument=instrument,
        specimen=one.specimen,
        chain=TYPICAL.get(instrument, CHAIN),
        chamber=wobbling(25.0, **WOBBLE, seed=seed_of(f"chamber of {one.name}", seed)),
        batch=one.name,
        seed_of_campaign=seed,
    )
    found = [
        at("capacity_25C", "capacity", steps=protocols.capacity(RATING)),
        at("pulses_25C", "pulse_resistance", steps=protocols.pulses_on_discharge(RATING, full)),
        at("hppc_25C", "hppc", steps=protocols.hybrid_pulses(RATING, full)),
        at("ica_25C", "ica", steps=_charge_for_peaks()),
        at("series_fuds_25C", "drive", steps=string, note="all fifty cells in series"),
        at(f"{schedule}_25C", "drive", steps=protocols.drive(RATING, full, schedule=schedule)),
    ]
    found += [_spoiled(at, one.name, full)] if one.name in SPOILED | DAMAGED else []
    slow = at("ocv_25C", "ocv", steps=protocols.slow_ocv(RATING, period_second=60.0))
    return [*found, slow] if one.name == REFERENCE else found


def _spoiled(at, name, full):
    """One more drive, on a bad day."""
    test = at("udds_25C", "drive", steps=protocols.drive(RATING, full, schedule="udds"))
    return test._replace(faults=SPOILED.get(name, ()), damage=DAMAGED.get(name))


def _charge_for_peaks():
    """At C/2, as a vehicle would, twice a second (thesis 4.4)."""
    return protocols.incremental_capacity(RATING, c_rate=1 / 2, period_second=0.5)
