"""The demo's cells over temperature: T1 from 25 to −20 °C (S4, S6 to S10), spectra of T2 (S5).

T1 is the thesis' 30 Ah NCM cell by the fast equations, T2 the circuit of its table 3.1.
"""

from functools import partial
from typing import NamedTuple

from virtual_lab import ageing, fast, protocols, stock, tabulated
from virtual_lab.chamber import room, steady
from virtual_lab.plan import Cell, Test
from virtual_lab.protocols.rests import THESIS_CELSIUS
from virtual_lab.specimens import Behavioural
from virtual_lab.truth.charges import cycle_rows

NAME, KIND = "T1", "D"
SHEET = ageing.KINDS[KIND]
RATING = SHEET.rating
PULSE_CELSIUS = (25, 10, 0, -10)
DISCHARGE_CELSIUS = (25, 0, -10)
CAPACITY_CELSIUS = (25, 10, 0, -20)
SLOW_CELSIUS, SLOW_RATE = (25, 0, -20), 1 / 30
PEAKS_CELSIUS = (25, -20)
FAST_CELSIUS = (25, 0, -20)
DRIVE_CELSIUS = (25, 5)  # no other test is at 5 °C: a model over temperature must get there
PULSE_SOC = (1.0, 0.9, 0.75, 0.6, 0.45, 0.3, 0.2, 0.1)
STEP_SOC = (0.9, 0.7, 0.5, 0.3, 0.1)
REST_SHARE = 0.18  # five rests from full to a tenth
FIRST_SAMPLE = "resistance at 50 % SoC, first sample"

SPECTRA_NAME, SPECTRA_RATING = "T2", ageing.KINDS["E"].rating

ROOM_CYCLES, ROOM_CELSIUS, ROOM_SWING_KELVIN, ROOM_DRIFT_KELVIN = 29, 24.0, 4.0, 0.3
LITHIUM_LOST_PER_CYCLE = 3e-4
LONGEST_CYCLE_SECOND = 5 * 3600.0


class InRoom(NamedTuple):
    """The cell as it loses lithium from cycle to cycle: each begins as the one before left it."""

    rating = RATING
    full_ampere_hour = property(lambda self: self.at(0).capacity_ampere_hour)
    capacity_per_kelvin = stock.CIRCUITS[KIND].capacity_per_kelvin

    def at(self, cycle: int) -> fast.Cell:
        """The cell after so many cycles."""
        return stock.cell(KIND, lli=LITHIUM_LOST_PER_CYCLE * cycle)

    def run(self, steps, *, chamber, initial_soc=1.0):
        """Through a first rest and its cycles, of as many steps each."""
        of_one = len(_cycles(1)) - 1
        starts = range(1, len(steps), of_one)
        cycles = [(steps[k : k + of_one], self.at(n)) for n, k in enumerate(starts)]
        parts = [(steps[:1], self.at(0)), *cycles]
        return fast.run_changing(parts, chamber=chamber, initial_soc=initial_soc)


def tests_and_cells() -> tuple[list[Cell], list[Test]]:
    """Rows of the sheets; a job for each of the two cells."""
    specimen = Behavioural(partial(stock.cell, KIND), _all_celsius(), _known)
    cells = [
        Cell(NAME, SHEET.chemistry, RATING, specimen, note="over temperature"),
        Cell(
            SPECTRA_NAME,
            "LMO",
            SPECTRA_RATING,
            tabulated.Tabulated(),
            note="spectra of the thesis' table 3.1",
        ),
    ]
    at = partial(Test, NAME, instrument="bdf", specimen=specimen)
    tests = [*_pulsed(at), *_charged(at, specimen), *_rested(at), *_drives(at), _room_test()]
    return cells, [*tests, *_spectra()]


def _all_celsius():
    found = {*PULSE_CELSIUS, *CAPACITY_CELSIUS, *SLOW_CELSIUS, *DRIVE_CELSIUS}
    return tuple(float(celsius) for celsius in sorted(found, reverse=True))


def _told(celsius):
    """What the laboratory has measured as capacity [Ah] at a temperature."""
    share = 1 + InRoom.capacity_per_kelvin * (celsius - 25.0)
    return share * SHEET.fresh_ampere_hour


def _pulsed(at) -> list[Test]:
    """HPPC, and short pulses once a minute on a C/3 discharge."""
    hybrid = partial(protocols.hybrid_pulses, highest_charge_pulse_soc=0.6, points=PULSE_SOC)
    return [
        at(f"hppc_{celsius}C", "hppc", celsius, steps=hybrid(RATING, _told(celsius)))
        for celsius in PULSE_CELSIUS
    ] + [
        at(
            f"pulses_{celsius}C",
            "pulse_resistance",
            celsius,
            steps=protocols.pulses_on_discharge(RATING, _told(celsius), every_second=60.0),
        )
        for celsius in DISCHARGE_CELSIUS
    ]


def _charged(at, specimen) -> list[Test]:
    """Capacity at 1C and at C/30, charges for dQ/dV at C/30, fast charges at 2C."""
    hard = protocols.capacity(RATING, repeats=1, c_rate=1.0)
    slow = protocols.slow_ocv(RATING, c_rate=SLOW_RATE, period_second=60.0)
    peaks = protocols.incremental_capacity(
        RATING, c_rate=SLOW_RATE, emptying_c_rate=SLOW_RATE, period_second=30.0
    )
    return [
        *[at(f"capacity_{t}C", "capacity", t, steps=hard) for t in CAPACITY_CELSIUS],
        *[at(f"ocv_{t}C", "ocv", t, steps=slow) for t in SLOW_CELSIUS],
        *[at(f"ica_{t}C", "ica", t, steps=peaks) for t in PEAKS_CELSIUS],
        *[
            at(f"fast_charge_{t}C", "fast_charge", t, steps=partial(_fast_charge, specimen, t))
            for t in FAST_CELSIUS
        ],
    ]


def _fast_charge(specimen, celsius):
    """2C to the upper cut-off, held for what is left of half an hour."""
    run = partial(specimen.run, chamber=steady(celsius))
    return protocols.fast_charge(RATING, run=run, period_second=5.0)


def _rested(at) -> list[Test]:
    """Relaxations at each temperature, and rests in a chamber that steps."""
    rests, chamber = protocols.temperature_steps(RATING, _told(THESIS_CELSIUS[0]), soc=STEP_SOC)
    found = [
        at(
            f"rests_{celsius}C",
            "relaxation",
            celsius,
            steps=protocols.relaxations(RATING, _told(celsius), share=REST_SHARE),
        )
        for celsius in PULSE_CELSIUS
    ]
    first = THESIS_CELSIUS[0]
    return [*found, at("ocv_steps", "ocv_temperature", first, steps=rests, chamber=chamber)]


def _drives(at) -> list[Test]:
    load = partial(protocols.drive, schedule="udds", scale=0.75, deepest_soc=0.2)
    return [
        at(f"udds_{celsius}C", "drive", celsius, steps=load(RATING, _told(celsius)))
        for celsius in DRIVE_CELSIUS
    ]


def _cycles(count):
    return protocols.ageing_cycles(RATING, "standard", cycles=count, period_second=30.0)


def _room_test() -> Test:
    around = room(
        ROOM_CELSIUS,
        swing_kelvin=ROOM_SWING_KELVIN,
        duration_second=LONGEST_CYCLE_SECOND * ROOM_CYCLES,
        drift_kelvin=ROOM_DRIFT_KELVIN,
        seed=0,
    )
    steps = _cycles(ROOM_CYCLES)
    return Test(NAME, "room", "ageing", ROOM_CELSIUS, "bdf", InRoom(), steps=steps, chamber=around)


def _spectra() -> list[Test]:
    return [
        Test(
            SPECTRA_NAME,
            f"eis_{celsius:.0f}C_soc{100 * soc:.0f}",
            "eis",
            celsius,
            "eis",
            tabulated.Tabulated(),
            soc=soc,
            initial_soc=soc,
        )
        for soc, celsius in tabulated.conditions()
    ]


def _known():
    """Rows of truth tables: the fresh cell, activation energies, what a cycle gives at 24 °C."""
    whole = round(InRoom().full_ampere_hour, 5)
    losses = {"lli": 0.0, "lam_negative": 0.0, "lam_positive": 0.0}
    energy = {"law": "arrhenius", "parameter": "activation_energy", "unit": "J/mol"}
    ohmic = {"quantity": FIRST_SAMPLE, **energy, "value": stock.CIRCUITS[KIND].ohmic}
    return {
        "health": [{"cycle": None, "capacity_ampere_hour": whole, **losses}],
        "temperature": [ohmic, _slope()],
        "steady_cycles": [{"test": "room", **row} for row in _in_steady_room(ROOM_CELSIUS)],
    }


def _slope():
    """By what share a fresh cell's 1C discharge grows with the room's temperature."""
    colder, mean, warmer = (
        _in_steady_room(ROOM_CELSIUS + kelvin, cycles=2)[-1]["capacity_ampere_hour"]
        for kelvin in (-1.0, 0.0, 1.0)
    )
    value = round(100 * (warmer - colder) / 2 / mean, 5)
    told = {"quantity": "capacity in room", "law": "linear", "parameter": "slope"}
    return {**told, "unit": "%/K", "value": value}


def _in_steady_room(celsius, cycles=ROOM_CYCLES):
    """The same cycles where the temperature stays."""
    steps = _cycles(cycles)
    behaviours = InRoom().run(steps, chamber=steady(celsius))
    return cycle_rows(steps, behaviours, rating=RATING)
