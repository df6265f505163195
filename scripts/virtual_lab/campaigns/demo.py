"""The committed campaign: five cells by physics, a pair in parallel, faults in some files.

Two more over temperature: see `demo_over_temperature`.
"""

from functools import partial

from virtual_lab import faults, protocols
from virtual_lab.campaigns import demo_over_temperature
from virtual_lab.cells import CELLS, RATING
from virtual_lab.plan import Cell, Plan, Test
from virtual_lab.specimens import Physical, PhysicalPair

PAIR = ("C1", "C2")
PAIR_WIRE_OHM = (0.002, 0.003)
PAIR_INITIAL_VOLT = 3.3
SPECTRUM_SOC = (0.2, 0.5, 0.8)
CONFIG = (
    "# The demo campaign runs on the documented defaults;"
    " see README.md in this folder for every key.\n"
)
ABOUT = """# What is true in the demo campaign

Made with the raw files by the virtual laboratory (docs/virtual-laboratory.md), without noise. The
pipeline never reads it: tests and the scores do.

Of T1 also: curve and resistances at each of its temperatures (ocv, models), the capacity of each
cycle in the room (cycles) and what it would be at a steady 24 °C (steady_cycles).
"""


def plan() -> Plan:
    """All tests; a job for each, and one for each cell over temperature."""
    cells = [
        Cell(name, "NMC", RATING, Physical(cell), reference=name == "C1", note=cell.note)
        for name, cell in CELLS.items()
    ]
    others, over_temperature = demo_over_temperature.tests_and_cells()
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
    placed = tuple(test._replace(folder="data") for test in jobs)
    return Plan((*cells, *others), placed, {"pair": _pair()}, CONFIG, ABOUT, truth="tests/truth")


def check_up(name: str, instrument: str) -> list[Test]:
    """The tests at 25 °C that every pulsed cell goes through."""
    full, at = CELLS[name].capacity_ampere_hour, _at(name, 25, instrument)
    return [
        at("capacity_25C", "capacity", steps=protocols.capacity(RATING)),
        at("ocv_25C", "ocv", steps=protocols.slow_ocv(RATING)),
        at("hppc_25C", "hppc", steps=protocols.hybrid_pulses(RATING, full)),
        at("ica_25C", "ica", steps=protocols.incremental_capacity(RATING)),
        at("udds_25C", "drive", steps=protocols.drive(RATING, full, schedule="udds"), role="fit"),
        at("us06_25C", "drive", steps=protocols.drive(RATING, full, schedule="us06")),
    ]


def other_climate(name: str, ambient_celsius: int, *, scale: float, pulse_soc: float) -> list[Test]:
    """The tests of a cell at another chamber temperature."""
    full, at = CELLS[name].capacity_ampere_hour, _at(name, ambient_celsius, "bdf")
    pulses = protocols.hybrid_pulses(RATING, full, highest_charge_pulse_soc=pulse_soc)
    drive = protocols.drive(RATING, full, schedule="us06", scale=scale)
    return [
        at(f"capacity_{ambient_celsius}C", "capacity", steps=protocols.capacity(RATING, repeats=1)),
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
    cell = CELLS[name]
    return partial(
        Test,
        name,
        ambient_celsius=ambient_celsius,
        instrument=instrument,
        specimen=Physical(cell),
        cycle=cell.cycle,
    )


def _pair():
    return PhysicalPair(PAIR, tuple(CELLS[name] for name in PAIR), PAIR_WIRE_OHM, PAIR_INITIAL_VOLT)


def _pair_test() -> Test:
    together = sum(CELLS[name].capacity_ampere_hour for name in PAIR)
    return Test(
        "pair",
        "drive_25C",
        "group",
        25,
        "bdf",
        _pair(),
        steps=protocols.pair(RATING, together),
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
    """Signs turned, with and without a word of it; rows twice and ten minutes missing."""
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
