"""The thesis' campaign: a used pack, parallel groups, ageing, temperature, spectra."""

from functools import partial
from typing import NamedTuple

import numpy as np

from virtual_lab import fast, physics, protocols, thesis_cells
from virtual_lab.campaigns import Cell, Plan, Test, seed_of
from virtual_lab.campaigns.thesis_packs import (
    PACK,
    channel_of,
    group_part,
    group_specimens,
    pack_part,
    pack_string,
)
from virtual_lab.chamber import room, steady
from virtual_lab.protocols.pulses import THESIS_CELSIUS
from virtual_lab.specimens import Behavioural, Physical
from virtual_lab.thesis_cells import REPEATS, Tabulated, conditions

CONFIG = """# The thesis' own circuits: with all nine members a run would take many hours.
title: The thesis' campaign, from the virtual laboratory
models:
  members: [1RC, 2RC, 2RC+H]
soc:
  filters: [coulomb, aekf]
  initial_soc: []
  scenarios: []
"""
ABOUT = """# What is true in this campaign

Tables without noise, in the columns of the results contract as far as they are defined; see
lab/README.md. P01 to P50: the cells of one pack (S14, S17, S18). G01 to G34: the cells
of the parallel groups (S20, S21; groups 1 to 8 are those of table 5.2). A1 to E2: ageing (S12, S13,
S16). E3, E4: one cell over temperature (S5 to S10), by the fast equations and by physics. E5: the
circuit of table 3.1. C6: 29 cycles in a room with a daily swing (S4).
"""


def plan(*, seed: int) -> Plan:
    """The plan of all parts."""
    parts = [pack_part(seed), group_part(seed), ageing_part(seed), temperature_part(seed)]
    parts.append(spectra_part(seed))
    cells = tuple(cell for of_part, _ in parts for cell in of_part)
    tests = tuple(test for _, of_part in parts for test in of_part)
    groups = group_specimens(seed) | {PACK: pack_string(seed)}
    return Plan(cells, tests, groups, CONFIG, ABOUT)


COLD_KIND = "E"
COLD_RATING = thesis_cells.CELL_TYPES[COLD_KIND].rating
CAPACITY_CELSIUS = (25, 10, 0, -10, -20)
PULSE_CELSIUS = (20, 10, 0, -10, -20)
SLOW_CELSIUS = (20, 0, -20)
STEP_SOC = (0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1)
ROOM_KIND, ROOM_CYCLES, ROOM_CELSIUS, ROOM_SWING_KELVIN = "C", 29, 24.0, 4.0
COLD_SHARE = 0.75  # of the capacity is pulsed: in the cold a discharge at C/3 ends early


def temperature_part(seed: int) -> tuple[list[Cell], list[Test]]:
    """One 32 Ah LMO cell from 25 to −20 °C (S6 to S10), and 29 cycles in a room (S4).

    E3 by the fast generator, E4 by physics, C6 in the room.
    """
    behavioural = _behavioural()
    physical = Physical(_fresh_porous_cell())
    in_room = Behavioural(partial(thesis_cells.cell, ROOM_KIND))
    rows = [
        Cell("E3", "LMO", COLD_RATING, behavioural, reference=True, note="temperature"),
        Cell("E4", "LMO", COLD_RATING, physical, note="temperature, slow charges by physics"),
        Cell(
            "C6",
            "NMC",
            thesis_cells.CELL_TYPES[ROOM_KIND].rating,
            in_room,
            note="29 cycles in a room",
        ),
    ]
    tests = [*_of_fast_cell(behavioural, seed), *_slow_charges(physical, seed)]
    return rows, [*tests, _room_test(in_room, seed)]


def _behavioural():
    circuit = thesis_cells.CIRCUITS[COLD_KIND]
    energy = {"parameter": "activation_energy", "law": "arrhenius", "unit": "J/mol"}
    first = "resistance at 50 % SoC, first sample"
    truth_tables = {"temperature": [{"quantity": first, **energy, "value": circuit.ohmic}]}
    temperatures = tuple(float(celsius) for celsius in PULSE_CELSIUS)
    return Behavioural(partial(thesis_cells.cell, COLD_KIND), temperatures, lambda: truth_tables)


def _fresh_porous_cell():
    sheet = thesis_cells.CELL_TYPES[COLD_KIND]
    return physics.Cell(
        lli=0.0,
        lam_negative=0.0,
        lam_positive=0.0,
        contact_resistance_ohm=0.3 * sheet.fresh_ohm,
        kinetics=1.0,
        capacity_ampere_hour=sheet.fresh_ampere_hour,
        cycle=None,
        note="fresh",
        chemistry=sheet.chemistry,
        rating=sheet.rating,
        entropy=1.0,
    )


def _test_of(name, specimen, seed):
    return partial(
        Test,
        name,
        instrument="parquet",
        specimen=specimen,
        chain=channel_of(name, seed),
        batch=name,
        seed_of_campaign=seed,
    )


def _of_fast_cell(specimen, seed):
    at, full = _test_of("E3", specimen, seed), thesis_cells.CELL_TYPES[COLD_KIND].fresh_ampere_hour
    rests, chamber = protocols.temperature_steps(COLD_RATING, full, soc=STEP_SOC)
    tests = [
        at("ocv_25C", "ocv", 25.0, steps=protocols.slow_ocv(COLD_RATING, period_second=60.0)),
        at("ocv_steps", "ocv_temperature", THESIS_CELSIUS[0], steps=rests, chamber=chamber),
    ]
    for celsius in CAPACITY_CELSIUS:
        half = protocols.capacity(COLD_RATING, repeats=1)
        quick = partial(_fast_charge, specimen, celsius)
        tests += [
            at(f"capacity_{celsius}C", "capacity", celsius, steps=half),
            at(f"fast_charge_{celsius}C", "fast_charge", celsius, steps=quick),
        ]
    for celsius in PULSE_CELSIUS:
        on_discharge = protocols.pulses_on_discharge(COLD_RATING, COLD_SHARE * full)
        pulses = protocols.hybrid_pulses(COLD_RATING, full, highest_charge_pulse_soc=0.6)
        tests += [
            at(f"pulses_{celsius}C", "pulse_resistance", celsius, steps=on_discharge),
            at(f"hppc_{celsius}C", "hppc", celsius, steps=pulses),
            at(
                f"rests_{celsius}C",
                "relaxation",
                celsius,
                steps=protocols.relaxations(COLD_RATING, full),
            ),
            at(
                f"udds_{celsius}C",
                "drive",
                celsius,
                steps=protocols.drive(
                    COLD_RATING, full, schedule="udds", scale=0.5, deepest_soc=0.2
                ),
            ),
        ]
    return tests


def _fast_charge(specimen, celsius):
    """2C to the upper cut-off, held for what is left of half an hour."""
    return protocols.fast_charge(COLD_RATING, run=partial(specimen.run, chamber=steady(celsius)))


def _slow_charges(specimen, seed):
    """Charges at C/30, at which the capacity missing in the cold is a true loss (S9)."""
    at = _test_of("E4", specimen, seed)
    steps = protocols.incremental_capacity(
        COLD_RATING, c_rate=1 / 30, emptying_c_rate=1 / 30, period_second=30.0
    )
    return [
        at(f"ica_{celsius}C", "ica", celsius, steps=steps, batch=f"E4_{celsius}".replace("-", "m"))
        for celsius in SLOW_CELSIUS
    ]


def _room_test(specimen, seed):
    rating = thesis_cells.CELL_TYPES[ROOM_KIND].rating
    steps = protocols.ageing_cycles(rating, "standard", cycles=ROOM_CYCLES, period_second=20.0)
    around = room(
        ROOM_CELSIUS,
        swing_kelvin=ROOM_SWING_KELVIN,
        duration_second=5 * 3600.0 * ROOM_CYCLES,
        drift_kelvin=0.3,
        seed=seed,
    )
    at = _test_of("C6", specimen, seed)
    return at("room", "ageing", ROOM_CELSIUS, steps=steps, chamber=around)


SPECTRA_CELL = "E5"


def spectra_part(seed: int) -> tuple[list[Cell], list[Test]]:
    """45 spectra of the circuit of table 3.1; every third in an analyser's own format."""
    cell = Cell(
        SPECTRA_CELL,
        "LMO",
        thesis_cells.CELL_TYPES["E"].rating,
        Tabulated(),
        note="circuit of table 3.1",
    )
    tests = [
        Test(
            SPECTRA_CELL,
            f"eis_{celsius:.0f}C_soc{100 * soc:.0f}_{repeat}",
            "eis",
            celsius,
            "digatron_eis" if repeat == REPEATS else "eis",
            Tabulated(),
            soc=soc,
            initial_soc=soc,
            batch=SPECTRA_CELL,
            seed_of_campaign=seed,
        )
        for soc, celsius in conditions()
        for repeat in range(1, REPEATS + 1)
    ]
    return [cell], tests


# Tables 4.2 and 4.3: which cell went through what.
LIVES = {
    "A1": ("A", "standard"), "B1": ("B", "standard"), "B2": ("B", "standard"),
    "C1": ("C", "high_power"), "C2": ("C", "high_power"), "C3": ("C", "standard"),
    "C4": ("C", "fast_charge"), "C5": ("C", "fast_charge"), "D1": ("D", "standard"),
    "E1": ("E", "high_power"), "E2": ("E", "standard"),
}  # fmt: skip
BY_PHYSICS = ("B1", "C3", "E2")  # whose slow charges are solved as porous electrodes
CHECK_UPS = 5
KINETICS = {"C": 3.0}  # a 20 Ah NCM cell has 2 mohm; the set scaled to its size has thrice as much
STRIDE = 5  # cycles between changes of the cell's parameters
RESTED = {"rest_second": 600.0, "period_second": 60.0}


class Life(NamedTuple):
    """A cell over all its ageing cycles; each begins in the state the last one ended in."""

    kind: str
    protocol: str
    spread: float  # it ages this many times faster than its type

    @property
    def rating(self):
        """Data sheet."""
        return thesis_cells.CELL_TYPES[self.kind].rating

    @property
    def full_ampere_hour(self) -> float:
        """Charge [Ah] of the fresh cell."""
        return thesis_cells.cell(self.kind).capacity_ampere_hour

    @property
    def cycles(self) -> int:
        """Number of cycles until the end of the test."""
        return int(thesis_cells.last_cycle(self.kind, self.protocol) / self.spread)

    def at(self, cycle: float) -> fast.Cell:
        """The cell after a number of cycles."""
        return thesis_cells.aged(self.kind, self.protocol, cycle * self.spread)

    def measured_ampere_hour(self, cycle: float) -> float:
        """Capacity [Ah] that the laboratory has measured after a number of cycles."""
        share = thesis_cells.capacity_share(self.kind, self.protocol, cycle * self.spread)
        return share * thesis_cells.CELL_TYPES[self.kind].fresh_ampere_hour

    def run(self, steps, *, chamber, initial_soc=1.0):
        """Simulate the ageing test: a first rest, then cycles of as many steps each."""
        of_one = (len(steps) - 1) // self.cycles
        parts = [(steps[:1], self.at(0))]
        for cycle in range(0, self.cycles, STRIDE):
            part = steps[1 + cycle * of_one : 1 + (cycle + STRIDE) * of_one]
            parts.append((part, self.at(cycle)))
        return fast.run_changing(parts, chamber=chamber, initial_soc=initial_soc)

    def facts(self, name: str) -> dict[str, list[dict]]:
        """Truth: losses at the check-ups, and the knee."""
        knee = thesis_cells.knee_cycle(self.kind, self.protocol)
        fresh = self.full_ampere_hour
        rows = []
        for cycle in check_up_cycles(self):
            state = thesis_cells.ageing_state(self.kind, self.protocol, cycle * self.spread)
            capacity = self.at(cycle).capacity_ampere_hour
            row = {"cell": name, "cycle": cycle, "capacity_ampere_hour": round(capacity, 5)}
            row |= {"soh": round(capacity / fresh, 5)}
            losses = thesis_cells.losses_of(state)
            row |= {loss: round(value, 6) for loss, value in losses.items()}
            rows.append(row | {"knee_cycle": round(knee / self.spread) if knee else None})
        return {"health": rows}


def check_up_cycles(life: Life) -> list[int]:
    """Cycles of the check-ups, evenly spaced from the first to the last."""
    return [int(c) for c in np.linspace(0, life.cycles, CHECK_UPS).round()]


def lives(seed: int) -> dict[str, Life]:
    """Ageing cells by name; two of a type under one protocol differ in pace."""
    ageing_cells = {}
    for name, what in LIVES.items():
        random = np.random.default_rng(seed_of(f"pace of {name}", seed))
        ageing_cells[name] = Life(*what, spread=float(1 + 0.04 * random.uniform(0.0, 1.0)))
    return ageing_cells


def ageing_part(seed: int) -> tuple[list[Cell], list[Test]]:
    """Five types of cell aged under three protocols, with check-ups (S12, S13, S16)."""
    rows, tests = [], []
    for name, life in lives(seed).items():
        chemistry = thesis_cells.CELL_TYPES[life.kind].chemistry
        about = {"note": f"{life.protocol} ageing", "ageing_protocol": life.protocol}
        rows.append(Cell(name, chemistry, life.rating, life, **about))
        tests.append(_life_test(name, life, seed))
        for cycle in check_up_cycles(life):
            tests += _check_up_tests(name, life, cycle, seed)
    return rows, tests


def _life_test(name, life, seed):
    steps = protocols.ageing_cycles(life.rating, life.protocol, cycles=life.cycles, **RESTED)
    longest = 4 * 3600.0 * life.cycles
    return Test(
        name,
        "life",
        "ageing",
        25.0,
        "parquet",
        life,
        steps=steps,
        chamber=room(25.0, swing_kelvin=2.0, duration_second=longest),
        chain=channel_of(name, seed),
        batch=f"{name}_life",
        seed_of_campaign=seed,
    )


def _check_up_tests(name, life, cycle, seed):
    full, rating = life.measured_ampere_hour(cycle), life.rating
    at = partial(
        Test,
        name,
        ambient_celsius=25.0,
        instrument="parquet",
        specimen=Behavioural(partial(life.at, cycle)),
        chain=channel_of(name, seed),
        cycle=cycle or None,
        batch=f"{name}_checks",
        seed_of_campaign=seed,
    )
    quick = protocols.incremental_capacity(rating, c_rate=1 / 2, period_second=2.0)
    slow = protocols.incremental_capacity(rating, c_rate=1 / 20)
    tests = [
        at(f"capacity_{cycle}", "capacity", steps=protocols.capacity(rating, repeats=1)),
        at(f"hppc_{cycle}", "hppc", steps=protocols.hybrid_pulses(rating, full)),
        at(f"ica_c2_{cycle}", "ica", steps=quick),
        at(f"ica_c20_{cycle}", "ica", steps=slow),
    ]
    if name in BY_PHYSICS:
        physical = Physical(_aged_porous_cell(life, cycle))
        tests[-1] = tests[-1]._replace(specimen=physical, batch=f"{name}_physics_{cycle}")
    return tests


def _aged_porous_cell(life, cycle):
    """The same state of the cell as a porous-electrode cell."""
    sheet = thesis_cells.CELL_TYPES[life.kind]
    state = thesis_cells.ageing_state(life.kind, life.protocol, cycle * life.spread)
    return physics.Cell(
        **thesis_cells.losses_of(state),
        contact_resistance_ohm=0.3 * sheet.fresh_ohm * state.resistance_factor,
        kinetics=KINETICS.get(life.kind, 1.0) * state.kinetics,
        capacity_ampere_hour=life.measured_ampere_hour(cycle),
        cycle=cycle or None,
        note=f"{life.protocol} ageing",
        chemistry=sheet.chemistry,
        rating=sheet.rating,
    )
