"""The demo campaign: five cells by physics, a pair, two over temperature, two for the search.

T1 is the thesis' 30 Ah NCM cell by the fast generator, tested from 25 to −20 °C (S4, S6 to S10);
T2 is the circuit of the thesis' table 3.1 (S5). H1 and H2 are cells of the hidden campaign: one is
healthy, the other has what is in no vocabulary. Some files have faults.
"""

from functools import partial
from typing import NamedTuple

from virtual_lab import fast, protocols, thesis_cells
from virtual_lab.campaigns import Cell, Plan, Test, hidden
from virtual_lab.chamber import room, steady
from virtual_lab.hidden.setup import RATING, slow_task, tasks
from virtual_lab.hidden.specimens import HiddenCell
from virtual_lab.instruments import faults
from virtual_lab.physics import DEMO_CELLS, DEMO_RATING
from virtual_lab.protocols.pulses import THESIS_CELSIUS
from virtual_lab.specimens import Behavioural, Physical, PhysicalPair
from virtual_lab.truth import cycle_rows

PAIR = ("C1", "C2")
PAIR_WIRE_OHM = (0.002, 0.003)
PAIR_INITIAL_VOLT = 3.3
SPECTRUM_SOC = (0.2, 0.5, 0.8)
CONFIG = (
    "# The demo campaign runs on the documented defaults and has a title;"
    " see README.md in this folder for every key.\n"
    'title: "Demo campaign: nine simulated cells and a pair"\n'
)
ABOUT = """# What is true in the demo campaign

Made with the raw files by the virtual laboratory (lab/README.md), without noise. The
pipeline never reads it: tests and the scores do.

Of T1 also: curve and resistances at each of its temperatures (ocv, models), the capacity of each
cycle in the room (cycles) and what it would be at a steady 24 °C (steady_cycles).
"""
# Effects of the search's library that are in every cell by physics. The exchange current depends on
# the filling of the particles: without noise the first sample of a pulse differs by 7 to 11 % over
# SoC, and by less than 1 % between charge and discharge (tests/truth/resistance.csv).
BY_PHYSICS = ("charge_transfer_nonlinearity", "slow_diffusion", "polarisation_soc")
BY_PHYSICS += ("resistance_soc", "resistance_temperature", "self_heating")
OF_T1 = (
    "Circuit of an ohmic resistance and five RC pairs (0.7 to 2,500 s), all over SoC and "
    "temperature; OCV and capacity over temperature; lumped heat"
)
IN_T1 = ("slow_diffusion", "resistance_soc", "polarisation_soc", "resistance_temperature")
IN_T1 += ("entropic_ocv", "self_heating", "capacity_temperature")
# Cells of the campaign of hidden effects: seed, kind, effects, strength [V].
HIDDEN = (
    HiddenCell("H1", 0, "none", (), 0.0),
    HiddenCell("H2", 0, "unknown", ("contact",), 6e-3),
)
HIDDEN_TESTS = ("hppc_25C", "drive_25C", "validation_25C")
NOTE = "by the fast equations"
HIDDEN_WORDS = {
    "none": "Circuit of an ohmic resistance and two RC pairs, as is the model of the search",
    "unknown": "Circuit of an ohmic resistance and two RC pairs, behind a loose contact whose "
    "resistance rises for minutes now and then, which is in no library of effects",
}


def plan() -> Plan:
    """The plan: a job for each test, and one for each cell over temperature."""
    cells = [
        Cell(name, "NMC", DEMO_RATING, Physical(cell), reference=name == "C1", note=cell.note)
        for name, cell in DEMO_CELLS.items()
    ]
    others, over_temperature = cells_over_temperature()
    tests = [
        *check_up("C1", "arbin"),
        *other_climate("C1", 0, scale=0.75, pulse_soc=0.7),
        *other_climate("C1", 40, scale=1.0, pulse_soc=0.8),
        *spectra("C1"),
        *(_with_oddities_of_c2(test) for test in check_up("C2", "bdf")),
        *(_with_oddities_of_c3(test) for test in check_up("C3", "arbin")),
        *_tests_of_c4(),
        *(test for test in check_up("C5", "bdf") if test.test != "udds_25C"),
        _pair_test(),
    ]
    jobs = [test._replace(batch=f"{test.cell}_{test.test}") for test in tests]
    jobs += [test._replace(batch=test.cell) for test in over_temperature]
    jobs += [test for one in HIDDEN for test in _tests_of_hidden(one)]
    placed = tuple(test._replace(folder="data") for test in jobs)
    others += [Cell(h.name, hidden.PHYSICS_CHEMISTRY, RATING, h, note=NOTE) for h in HIDDEN]
    about = {"config": CONFIG, "about": ABOUT, "truth": "tests/truth", "simulated": simulated()}
    return Plan((*cells, *others), placed, {"pair": _pair()}, **about)


def simulated() -> tuple[dict, ...]:
    """What each cell was made of, in words, and ids of the effects that the search could name.

    The circuit that a search begins with has none of them.
    """
    rows = [(name, _losses_in_words(cell), BY_PHYSICS) for name, cell in DEMO_CELLS.items()]
    rows += [(T1, OF_T1, IN_T1), (T2, "Spectra of a tabulated circuit, no model to search", ())]
    rows += [(one.name, HIDDEN_WORDS[one.kind], ()) for one in HIDDEN]
    borrowed = {"C4": ("ocv_shift",)}  # has no slow test: its OCV is that of the fresh C1
    return tuple(
        {"cell": cell, "simulated": words, "effects": ";".join((*true, *borrowed.get(cell, ())))}
        for cell, words, true in rows
    )


def _losses_in_words(cell):
    shares = (cell.lli, cell.lam_negative, cell.lam_positive, cell.kinetics)
    lithium, negative, positive, kinetics = (f"{100 * share:.0f} %" for share in shares)
    lost = (
        f"lost {lithium} of the lithium, {negative} of the negative and {positive} of the positive "
        f"material, reacts at {kinetics} of the rate of a fresh cell"
    )
    what = lost if any(shares[:3]) else "fresh"
    contact = f"{1e3 * cell.contact_resistance_ohm:.0f} mΩ of contact"
    return f"Electrochemical cell, particles and electrolyte: {what}, {contact}"


def _tests_of_hidden(one):
    wanted = [slow_task(), *(task for task in tasks() if task.test in HIDDEN_TESTS)]
    tests = [hidden.test_of(one, task, one.name) for task in wanted]
    return [test._replace(instrument="bdf", current_sign=None) for test in tests]


def check_up(name: str, instrument: str) -> list[Test]:
    """The tests at 25 °C of every pulsed cell."""
    full, at = DEMO_CELLS[name].capacity_ampere_hour, _at(name, 25, instrument)
    return [
        at("capacity_25C", "capacity", steps=protocols.capacity(DEMO_RATING)),
        at("ocv_25C", "ocv", steps=protocols.slow_ocv(DEMO_RATING)),
        at("hppc_25C", "hppc", steps=protocols.hybrid_pulses(DEMO_RATING, full)),
        at("ica_25C", "ica", steps=protocols.incremental_capacity(DEMO_RATING)),
        at(
            "udds_25C",
            "drive",
            steps=protocols.drive(DEMO_RATING, full, schedule="udds"),
            role="fit",
        ),
        at("us06_25C", "drive", steps=protocols.drive(DEMO_RATING, full, schedule="us06")),
    ]


def other_climate(name: str, ambient_celsius: int, *, scale: float, pulse_soc: float) -> list[Test]:
    """The tests of a cell at another chamber temperature [°C]."""
    full, at = DEMO_CELLS[name].capacity_ampere_hour, _at(name, ambient_celsius, "bdf")
    pulses = protocols.hybrid_pulses(DEMO_RATING, full, highest_charge_pulse_soc=pulse_soc)
    drive = protocols.drive(DEMO_RATING, full, schedule="us06", scale=scale)
    return [
        at(
            f"capacity_{ambient_celsius}C",
            "capacity",
            steps=protocols.capacity(DEMO_RATING, repeats=1),
        ),
        at(f"hppc_{ambient_celsius}C", "hppc", steps=pulses),
        at(f"us06_{ambient_celsius}C", "drive", steps=drive),
    ]


def spectra(name: str) -> list[Test]:
    """Impedance spectra at several states of charge."""
    at = _at(name, 25, "eis")
    return [
        at(f"eis_25C_soc{round(100 * soc)}", "eis", soc=soc, initial_soc=soc)
        for soc in SPECTRUM_SOC
    ]


def _at(name, ambient_celsius, instrument):
    cell = DEMO_CELLS[name]
    return partial(
        Test,
        name,
        ambient_celsius=ambient_celsius,
        instrument=instrument,
        specimen=Physical(cell),
        cycle=cell.cycle,
    )


def _pair():
    return PhysicalPair(
        PAIR, tuple(DEMO_CELLS[name] for name in PAIR), PAIR_WIRE_OHM, PAIR_INITIAL_VOLT
    )


def _pair_test() -> Test:
    together = sum(DEMO_CELLS[name].capacity_ampere_hour for name in PAIR)
    return Test(
        "pair",
        "drive_25C",
        "group",
        25,
        "bdf",
        _pair(),
        steps=protocols.pair(DEMO_RATING, together),
        soc=None,
        initial_soc=None,
        note=f"{PAIR[0]} and {PAIR[1]} in parallel; surface temperature of {PAIR[0]}",
    )


def _with_oddities_of_c2(test: Test) -> Test:
    if test.test == "us06_25C":
        return test._replace(instrument="parquet")
    if test.test == "udds_25C":
        return test._replace(faults=(partial(faults.spikes, seed=test.seed),))
    return test


def _with_oddities_of_c3(test: Test) -> Test:
    """Current signs reversed, with and without a note of it; repeated rows; ten minutes missing."""
    if test.test == "hppc_25C":
        return test._replace(discharge_positive=True, current_sign="discharge_positive")
    if test.test == "us06_25C":
        return test._replace(discharge_positive=True)
    if test.test == "ocv_25C":
        missing = partial(faults.gap, begin_second=30_000, end_second=30_600)
        return test._replace(faults=(partial(faults.repeats, seed=3), missing))
    return test


def _tests_of_c4() -> list[Test]:
    """No pulses and no slow OCV; drives for validation only."""
    wanted = ("capacity_25C", "ica_25C", "udds_25C", "us06_25C")
    tests = [test._replace(role=None) for test in check_up("C4", "bdf") if test.test in wanted]
    tests[1] = tests[1]._replace(discharge_positive=True, current_sign="discharge_positive")
    return tests


T1, T1_TYPE = "T1", "D"
T1_SHEET = thesis_cells.CELL_TYPES[T1_TYPE]
T1_RATING = T1_SHEET.rating
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

T2, T2_RATING = "T2", thesis_cells.CELL_TYPES["E"].rating

ROOM_CYCLES, ROOM_CELSIUS, ROOM_SWING_KELVIN, ROOM_DRIFT_KELVIN = 29, 24.0, 4.0, 0.3
LITHIUM_LOST_PER_CYCLE = 3e-4
LONGEST_CYCLE_SECOND = 5 * 3600.0


class CellInRoom(NamedTuple):
    """T1 losing lithium cycle by cycle; each begins in the state the last one ended in."""

    rating = T1_RATING
    full_ampere_hour = property(lambda self: self.at(0).capacity_ampere_hour)
    capacity_per_kelvin = thesis_cells.CIRCUITS[T1_TYPE].capacity_per_kelvin

    def at(self, cycle: int) -> fast.Cell:
        """The cell after a number of cycles."""
        return thesis_cells.cell(T1_TYPE, lli=LITHIUM_LOST_PER_CYCLE * cycle)

    def run(self, steps, *, chamber, initial_soc=1.0):
        """Simulate a first rest and the cycles, each of as many steps."""
        of_one = len(_cycles(1)) - 1
        starts = range(1, len(steps), of_one)
        cycles = [(steps[k : k + of_one], self.at(n)) for n, k in enumerate(starts)]
        parts = [(steps[:1], self.at(0)), *cycles]
        return fast.run_changing(parts, chamber=chamber, initial_soc=initial_soc)


def cells_over_temperature() -> tuple[list[Cell], list[Test]]:
    """Cells T1 and T2 and their tests; a job for each of the two."""
    celsius = {*PULSE_CELSIUS, *CAPACITY_CELSIUS, *SLOW_CELSIUS, *DRIVE_CELSIUS}
    temperatures = tuple(float(one) for one in sorted(celsius, reverse=True))
    specimen = Behavioural(partial(thesis_cells.cell, T1_TYPE), temperatures, _known_of_t1)
    cells = [
        Cell(T1, T1_SHEET.chemistry, T1_RATING, specimen, note="over temperature"),
        Cell(
            T2, "LMO", T2_RATING, thesis_cells.Tabulated(), note="spectra of the thesis' table 3.1"
        ),
    ]
    at = partial(Test, T1, instrument="bdf", specimen=specimen)
    tests = [
        *_pulse_tests(at),
        *_charge_tests(at, specimen),
        *_rest_tests(at),
        *_drive_tests(at),
        _room_test(),
    ]
    return cells, [*tests, *_tabulated_spectra()]


def _capacity_at(celsius):
    """Capacity [Ah] as the laboratory has measured it at a temperature [°C]."""
    share = 1 + CellInRoom.capacity_per_kelvin * (celsius - 25.0)
    return share * T1_SHEET.fresh_ampere_hour


def _pulse_tests(at) -> list[Test]:
    """HPPC, and short pulses once a minute on a C/3 discharge."""
    hybrid = partial(protocols.hybrid_pulses, highest_charge_pulse_soc=0.6, points=PULSE_SOC)
    short = partial(protocols.pulses_on_discharge, every_second=60.0)
    return [
        *[
            at(f"hppc_{t}C", "hppc", t, steps=hybrid(T1_RATING, _capacity_at(t)))
            for t in PULSE_CELSIUS
        ],
        *[
            at(f"pulses_{t}C", "pulse_resistance", t, steps=short(T1_RATING, _capacity_at(t)))
            for t in DISCHARGE_CELSIUS
        ],
    ]


def _charge_tests(at, specimen) -> list[Test]:
    """Capacity at 1C and at C/30, charges for dQ/dV at C/30, fast charges at 2C."""
    hard = protocols.capacity(T1_RATING, repeats=1, c_rate=1.0)
    slow = protocols.slow_ocv(T1_RATING, c_rate=SLOW_RATE, period_second=60.0)
    peaks = protocols.incremental_capacity(
        T1_RATING, c_rate=SLOW_RATE, emptying_c_rate=SLOW_RATE, period_second=30.0
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
    return protocols.fast_charge(T1_RATING, run=run, period_second=5.0)


def _rest_tests(at) -> list[Test]:
    """Relaxations at each temperature, and rests during steps of the chamber temperature."""
    first = THESIS_CELSIUS[0]
    rests, chamber = protocols.temperature_steps(T1_RATING, _capacity_at(first), soc=STEP_SOC)
    relaxations = partial(protocols.relaxations, share=REST_SHARE)
    return [
        *[
            at(f"rests_{t}C", "relaxation", t, steps=relaxations(T1_RATING, _capacity_at(t)))
            for t in PULSE_CELSIUS
        ],
        at("ocv_steps", "ocv_temperature", first, steps=rests, chamber=chamber),
    ]


def _drive_tests(at) -> list[Test]:
    load = partial(protocols.drive, schedule="udds", scale=0.75, deepest_soc=0.2)
    return [
        at(f"udds_{t}C", "drive", t, steps=load(T1_RATING, _capacity_at(t))) for t in DRIVE_CELSIUS
    ]


def _cycles(count):
    return protocols.ageing_cycles(T1_RATING, "standard", cycles=count, period_second=30.0)


def _room_test() -> Test:
    around = room(
        ROOM_CELSIUS,
        swing_kelvin=ROOM_SWING_KELVIN,
        duration_second=LONGEST_CYCLE_SECOND * ROOM_CYCLES,
        drift_kelvin=ROOM_DRIFT_KELVIN,
        seed=0,
    )
    steps = _cycles(ROOM_CYCLES)
    return Test(
        T1, "room", "ageing", ROOM_CELSIUS, "bdf", CellInRoom(), steps=steps, chamber=around
    )


def _tabulated_spectra() -> list[Test]:
    return [
        Test(
            T2,
            f"eis_{celsius:.0f}C_soc{100 * soc:.0f}",
            "eis",
            celsius,
            "eis",
            thesis_cells.Tabulated(),
            soc=soc,
            initial_soc=soc,
        )
        for soc, celsius in thesis_cells.conditions()
    ]


def _known_of_t1():
    """Truth of T1: the fresh cell, activation energies, capacities of cycles at steady 24 °C."""
    whole = round(CellInRoom().full_ampere_hour, 5)
    losses = {"lli": 0.0, "lam_negative": 0.0, "lam_positive": 0.0}
    energy = {"law": "arrhenius", "parameter": "activation_energy", "unit": "J/mol"}
    ohmic = {"quantity": FIRST_SAMPLE, **energy, "value": thesis_cells.CIRCUITS[T1_TYPE].ohmic}
    return {
        "health": [{"cycle": None, "capacity_ampere_hour": whole, **losses}],
        "temperature": [ohmic, _slope()],
        "steady_cycles": [{"test": "room", **row} for row in _in_steady_room(ROOM_CELSIUS)],
    }


def _slope():
    """Relative growth of a fresh cell's 1C discharge with the room's temperature [%/K]."""
    colder, mean, warmer = (
        _in_steady_room(ROOM_CELSIUS + kelvin, cycles=2)[-1]["capacity_ampere_hour"]
        for kelvin in (-1.0, 0.0, 1.0)
    )
    value = round(100 * (warmer - colder) / 2 / mean, 5)
    law = {"quantity": "capacity in room", "law": "linear", "parameter": "slope"}
    return {**law, "unit": "%/K", "value": value}


def _in_steady_room(celsius, cycles=ROOM_CYCLES):
    """Capacities of the same cycles at one constant temperature [°C]."""
    steps = _cycles(cycles)
    behaviours = CellInRoom().run(steps, chamber=steady(celsius))
    return cycle_rows(steps, behaviours, rating=T1_RATING)
