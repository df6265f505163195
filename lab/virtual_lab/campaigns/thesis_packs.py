"""Used cells of the thesis' campaign: fifty alone and in series, 34 in parallel groups."""

from functools import cache, partial
from typing import NamedTuple

import numpy as np

from virtual_lab import protocols, thesis_cells
from virtual_lab.behaviour import Rating
from virtual_lab.campaigns import Cell, Test, seed_of
from virtual_lab.chamber import wobbling
from virtual_lab.instruments import faults
from virtual_lab.instruments.chain import TYPICAL, Chain, with_drawn_gain
from virtual_lab.specimens import Behavioural, BehaviouralGroup, SeriesString

KIND = "D"
PACK_CELLS = 50
RATING = thesis_cells.CELL_TYPES[KIND].rating
# The worst of 50 used cells have lost a third (figure 4.23).
LEAST_AMPERE_HOUR, MOST_AMPERE_HOUR = 20.5, 29.5
# Resistance grows as capacity falls, in a line, with a scatter of a few percent (S14).
GROWTH_PER_LOSS, SCATTER = 2.0, 0.04
PACK_INSTRUMENTS = ("arbin", "bdf", "parquet", "bitrode", "digatron", "plett", "digatron_german")
PACK_SCHEDULES = ("dst", "sftp", "ftp72")
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
PACK = "pack"
SENSOR_EVERY = 5  # cells of the pack from one with a thermometer to the next
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
    "P08": faults.cut_off,
    "P16": faults.emptied,
    "P20": faults.header_only,
    "P26": partial(faults.torn_row, seed=26),
    "P35": partial(faults.damaged, seed=35),
}


def channel_of(cell: str, seed: int, chain: Chain = CHAIN) -> Chain:
    """The channel that a cell is tested on, the same in all its tests."""
    return with_drawn_gain(chain, np.random.default_rng(seed_of(f"ammeter of {cell}", seed)))


class UsedCell(NamedTuple):
    """A used cell, and its capacity [Ah] at C/2."""

    name: str
    capacity_ampere_hour: float
    specimen: Behavioural


@cache
def pack_cells(seed: int) -> tuple[UsedCell, ...]:
    """The fifty cells of a used pack; the first is fresh."""
    random = np.random.default_rng(seed_of("pack", seed))
    capacities = np.append(
        MOST_AMPERE_HOUR,
        random.triangular(LEAST_AMPERE_HOUR, 27.5, MOST_AMPERE_HOUR, PACK_CELLS - 1),
    )
    return tuple(used_cell(f"P{k:02d}", float(q), random) for k, q in enumerate(capacities, 1))


def used_cell(name: str, capacity: float, random: np.random.Generator) -> UsedCell:
    """A cell of a given capacity [Ah]; its losses and its resistance are drawn."""
    lost = max(0.0, 1 - capacity / MOST_AMPERE_HOUR)
    lam_positive = lost * float(random.uniform(0.3, 0.7))
    resistance = (1 + GROWTH_PER_LOSS * lost) * float(np.exp(random.normal(0.0, SCATTER)))
    losses = partial(thesis_cells.worn, KIND, capacity, lam_positive=lam_positive)

    def make():
        return thesis_cells.cell(KIND, resistance=resistance, **losses())

    def known():
        shown = {loss: round(losses().get(loss, 0.0), 6) for loss in LOSSES}
        return {"health": [{"capacity_ampere_hour": round(capacity, 4), **shown}]}

    return UsedCell(name, capacity, Behavioural(make, known=known))


def pack_part(seed: int) -> tuple[list[Cell], list[Test]]:
    """Fifty cells of one used pack, each by itself and all of them in series (S14, S17, S18)."""
    rows = [
        Cell(one.name, "NMC", RATING, one.specimen, one.name == REFERENCE, "of a used pack")
        for one in pack_cells(seed)
    ]
    weakest = min(one.capacity_ampere_hour for one in pack_cells(seed))
    string = protocols.series_drive(RATING, schedule="fuds", ampere_hour=SERIES_SHARE * weakest)
    tests = [
        test
        for k, one in enumerate(pack_cells(seed))
        for test in _pack_cell_tests(one, k, seed, string)
    ]
    return rows, tests + _string_tests(pack_string(seed), string, seed)


def pack_string(seed: int, *, cells: int = PACK_CELLS) -> SeriesString:
    """The first `cells` of the used pack in series, all full; every fifth has a thermometer."""
    members = pack_cells(seed)[:cells]
    return SeriesString(
        tuple(one.name for one in members),
        tuple(one.specimen for one in members),
        tuple(_place(one.name, seed) for one in members),
        (1.0,) * cells,
        tuple(range(1, cells + 1, SENSOR_EVERY)),
    )


def _place(name, seed):
    """Temperature around a cell, the same in all its tests."""
    return wobbling(25.0, **WOBBLE, seed=seed_of(f"chamber of {name}", seed))


def _string_tests(string, drive, seed):
    """The drive of the single cells, and a discharge at C/2 to the first cell's cut-off."""
    at = partial(
        Test,
        PACK,
        kind="group",
        ambient_celsius=25.0,
        instrument="parquet",
        specimen=string,
        chamber=_place(PACK, seed),
        chain=CHAIN,
        soc=None,
        initial_soc=None,
        role="validation",
        batch=PACK,
        seed_of_campaign=seed,
    )
    still = protocols.rest(10 * protocols.MINUTE, period_second=5.0)
    down = protocols.discharge(RATING, 1 / 2, period_second=5.0)
    return [
        at("series_fuds_25C", steps=drive, note="as the single cells' series_fuds_25C"),
        at("discharge_C2", steps=[still, down, still], note="until the first cell is empty"),
    ]


def _pack_cell_tests(one, number, seed, string):
    full, instrument = one.capacity_ampere_hour, PACK_INSTRUMENTS[number % len(PACK_INSTRUMENTS)]
    schedule = PACK_SCHEDULES[number % len(PACK_SCHEDULES)]
    at = partial(
        Test,
        one.name,
        ambient_celsius=25.0,
        instrument=instrument,
        specimen=one.specimen,
        chain=channel_of(one.name, seed, TYPICAL.get(instrument, CHAIN)),
        chamber=_place(one.name, seed),
        batch=one.name,
        seed_of_campaign=seed,
    )
    # At C/2, as in a vehicle, sampled twice a second (thesis 4.4).
    charge = protocols.incremental_capacity(RATING, c_rate=1 / 2, period_second=0.5)
    tests = [
        at("capacity_25C", "capacity", steps=protocols.capacity(RATING)),
        at("pulses_25C", "pulse_resistance", steps=protocols.pulses_on_discharge(RATING, full)),
        at("hppc_25C", "hppc", steps=protocols.hybrid_pulses(RATING, full)),
        at("ica_25C", "ica", steps=charge),
        at("series_fuds_25C", "drive", steps=string, note="all fifty cells in series"),
        at(f"{schedule}_25C", "drive", steps=protocols.drive(RATING, full, schedule=schedule)),
    ]
    if one.name in SPOILED | DAMAGED:  # one more drive, with faults in its file
        test = at("udds_25C", "drive", steps=protocols.drive(RATING, full, schedule="udds"))
        faulty = {"faults": SPOILED.get(one.name, ()), "damage": DAMAGED.get(one.name)}
        tests.append(test._replace(**faulty))
    slow = at("ocv_25C", "ocv", steps=protocols.slow_ocv(RATING, period_second=60.0))
    return [*tests, slow] if one.name == REFERENCE else tests


GROUP_CELLS, GROUPS = 34, 27
WIRE_OHM = 3e-4
# Table 5.2 [Ah]; where it gives a cell twice, what it says first.
TABLE_5_2_AMPERE_HOUR = {
    2: 24.9, 3: 29.8, 4: 31.5, 5: 28.7, 6: 22.7, 11: 31.1, 13: 31.7, 14: 29.7, 15: 31.7, 16: 30.2,
    18: 29.4, 19: 31.2, 20: 24.9, 24: 21.2, 25: 27.3, 26: 29.4, 27: 26.3, 31: 30.1, 33: 18.7,
}  # fmt: skip
TABLE_5_2_GROUPS = (
    (15, 19), (13, 24), (6, 13, 25), (14, 15, 31), (4, 11, 20), (5, 6, 13, 27), (14, 15, 16, 31),
    (2, 3, 18, 26),
)  # fmt: skip
OTHERS_AMPERE_HOUR = (22.0, 31.0)


@cache
def group_cells(seed: int) -> tuple[UsedCell, ...]:
    """The 34 cells of the parallel groups."""
    random = np.random.default_rng(seed_of("parallel cells", seed))
    cells = []
    for number in range(1, GROUP_CELLS + 1):
        drawn = round(float(random.uniform(*OTHERS_AMPERE_HOUR)), 1)
        capacity = TABLE_5_2_AMPERE_HOUR.get(number, drawn)
        cells.append(used_cell(_name(number), capacity, random))
    return tuple(cells)


@cache
def group_members(seed: int) -> dict[str, tuple[UsedCell, ...]]:
    """The cells of each group, by its name."""
    random = np.random.default_rng(seed_of("parallel groups", seed))
    chosen = list(TABLE_5_2_GROUPS)
    while len(chosen) < GROUPS:
        size = int(random.integers(2, 5))
        chosen.append(tuple(sorted((random.permutation(GROUP_CELLS)[:size] + 1).tolist())))
    by_name = {one.name: one for one in group_cells(seed)}
    return {
        f"group{k:02d}": tuple(by_name[_name(number)] for number in numbers)
        for k, numbers in enumerate(chosen, 1)
    }


def _name(number):
    return f"G{number:02d}"


def group_specimens(seed: int) -> dict[str, BehaviouralGroup]:
    """Parallel groups by name: all cells full, behind wires of one resistance."""
    groups = {}
    for name, cells in group_members(seed).items():
        names, specimens = (
            tuple(getattr(c, field) for c in cells) for field in ("name", "specimen")
        )
        same = [(value,) * len(cells) for value in (WIRE_OHM, 1.0)]
        groups[name] = BehaviouralGroup(names, specimens, *same)
    return groups


def group_part(seed: int) -> tuple[list[Cell], list[Test]]:
    """27 groups of two to four cells (S20, S21; 1 to 8 are of table 5.2), and each cell alone."""
    rows = [
        Cell(one.name, "NMC", RATING, one.specimen, note="for groups") for one in group_cells(seed)
    ]
    tests = [test for one in group_cells(seed) for test in _alone(one, seed)]
    specimens = group_specimens(seed)
    for name, of_group in group_members(seed).items():
        full = sum(one.capacity_ampere_hour for one in of_group)
        tests += _together(name, specimens[name], full, seed)
    return rows, tests


def _alone(one, seed):
    at = partial(
        Test,
        one.name,
        ambient_celsius=25.0,
        instrument="parquet",
        specimen=one.specimen,
        chain=channel_of(one.name, seed),
        batch=one.name,
        seed_of_campaign=seed,
    )
    pulses = protocols.hybrid_pulses(RATING, one.capacity_ampere_hour)
    return [
        at("capacity_25C", "capacity", steps=protocols.capacity(RATING)),
        at("hppc_25C", "hppc", steps=pulses),
    ]


def _together(name, group, full, seed):
    """Discharges at 1C (of pairs at 2C too) to the cut-off, and a drive; all for validation."""
    rating = Rating(len(group.names) * RATING.capacity_ampere_hour, *RATING[1:])
    at = partial(
        Test,
        name,
        kind="group",
        ambient_celsius=25.0,
        instrument="parquet",
        specimen=group,
        chain=CHAIN,
        soc=None,
        initial_soc=None,
        role="validation",
        batch=name,
        seed_of_campaign=seed,
    )
    rates = (1.0, 2.0) if len(group.names) == 2 else (1.0,)
    tests = [
        at(f"discharge_{rate:.0f}C", steps=protocols.group_capacity(rating, c_rate=rate))
        for rate in rates
    ]
    return [*tests, at("udds_25C", steps=protocols.group_drive(rating, full, schedule="udds"))]
