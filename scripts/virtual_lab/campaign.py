"""The demo campaign: which cell goes through which test, on which instrument, and its sheets."""

import hashlib
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from virtual_lab import cells, measurement, protocols
from virtual_lab.cells import CELLS
from virtual_lab.measurement import Columns
from virtual_lab.protocols import Step

PAIR = ("C1", "C2")
PAIR_WIRE_OHM = (0.002, 0.003)
PAIR_INITIAL_VOLT = 3.3
SPECTRUM_SOC = (0.2, 0.5, 0.8)
SUFFIX = {"arbin": ".csv.gz", "bdf": ".bdf.csv.gz", "parquet": ".bdf.parquet", "eis": ".bdf.csv"}


class Test(NamedTuple):
    """One test of the plan; `steps` is None for spectra.

    `current_sign` is what the sheet says; `discharge_positive` what the file really holds.
    `fault` spoils the record as instruments do. Blank (None) stays blank in the sheet.
    """

    cell: str
    test: str
    kind: str
    ambient_celsius: int
    instrument: str
    steps: list[Step] | None = None
    current_sign: str | None = None
    discharge_positive: bool = False
    soc: float | None = 1.0
    role: str | None = None
    fault: Callable[[Columns], Columns] | None = None
    note: str | None = None

    @property
    def file(self) -> str:
        """Path in the campaign."""
        return f"data/{self.cell}/{self.test}{SUFFIX[self.instrument]}"

    @property
    def seed(self) -> int:
        """Seed of the test's noise, the same on any machine."""
        digest = hashlib.sha256(f"{self.cell}/{self.test}".encode()).digest()
        return int.from_bytes(digest[:4], "big")


def check_up(name: str, instrument: str, *, fit_drive: bool = True) -> list[Test]:
    """The tests at 25 °C that every pulsed cell goes through."""
    cell = CELLS[name]
    at = partial(Test, name, ambient_celsius=25, instrument=instrument)
    return [
        at("capacity_25C", "capacity", steps=protocols.capacity()),
        at("ocv_25C", "ocv", steps=protocols.slow_ocv()),
        at("hppc_25C", "hppc", steps=protocols.hybrid_pulses(cell)),
        at("ica_25C", "ica", steps=protocols.incremental_capacity()),
        at("udds_25C", "drive", steps=protocols.drive(cell, schedule="udds"), role="fit"),
        at("us06_25C", "drive", steps=protocols.drive(cell, schedule="us06")),
    ]


def other_climate(name: str, ambient_celsius: int, *, scale: float, pulse_soc: float) -> list[Test]:
    """The tests of a cell at another chamber temperature."""
    cell = CELLS[name]
    at = partial(Test, name, ambient_celsius=ambient_celsius, instrument="bdf")
    pulses = protocols.hybrid_pulses(cell, highest_charge_pulse_soc=pulse_soc)
    drive = protocols.drive(cell, schedule="us06", scale=scale)
    return [
        at(f"capacity_{ambient_celsius}C", "capacity", steps=protocols.capacity(repeats=1)),
        at(f"hppc_{ambient_celsius}C", "hppc", steps=pulses),
        at(f"us06_{ambient_celsius}C", "drive", steps=drive),
    ]


def spectra(name: str) -> list[Test]:
    """Impedance spectra at several states of charge."""
    return [
        Test(name, f"eis_25C_soc{round(100 * soc)}", "eis", 25, "eis", soc=soc)
        for soc in SPECTRUM_SOC
    ]


def plan() -> list[Test]:
    """All tests of the campaign."""
    return [
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


def _pair_test() -> Test:
    together = sum(CELLS[name].capacity_ampere_hour for name in PAIR)
    note = f"{PAIR[0]} and {PAIR[1]} in parallel; surface temperature of {PAIR[0]}"
    steps = protocols.pair(together)
    return Test("pair", "drive_25C", "group", 25, "bdf", steps=steps, soc=None, note=note)


def _with_oddities_of_c2(test: Test) -> Test:
    if test.test == "us06_25C":
        return test._replace(instrument="parquet")
    if test.test == "udds_25C":
        return test._replace(fault=partial(measurement.with_spikes, seed=test.seed))
    return test


def _with_oddities_of_c3(test: Test) -> Test:
    if test.test == "hppc_25C":
        return test._replace(discharge_positive=True, current_sign="discharge_positive")
    if test.test == "us06_25C":
        return test._replace(discharge_positive=True)
    return test._replace(fault=_interrupted) if test.test == "ocv_25C" else test


def _interrupted(columns: Columns) -> Columns:
    """Four rows written twice, ten minutes of the slow discharge not written at all."""
    return measurement.with_gap(
        measurement.with_repeats(columns, seed=3), begin_second=30_000, end_second=30_600
    )


def _tests_of_c4() -> list[Test]:
    """No pulses and no slow OCV; drives for validation only."""
    wanted = ("capacity_25C", "ica_25C", "udds_25C", "us06_25C")
    tests = [test._replace(role=None) for test in check_up("C4", "bdf") if test.test in wanted]
    tests[1] = tests[1]._replace(discharge_positive=True, current_sign="discharge_positive")
    return tests


def cells_sheet() -> list[dict]:
    """Rows of cells.tsv."""
    return [
        {
            "cell": name,
            "chemistry": "NMC",
            "rated_capacity_ampere_hour": cells.RATED_CAPACITY_AMPERE_HOUR,
            "lower_cutoff_volt": cells.LOWER_CUTOFF_VOLT,
            "upper_cutoff_volt": cells.UPPER_CUTOFF_VOLT,
            "reference": "yes" if name == "C1" else None,
            "note": cell.note,
        }
        for name, cell in CELLS.items()
    ]


def tests_sheet(checksums: dict[str, str]) -> list[dict]:
    """Rows of tests.tsv; `checksums` gives the SHA-256 of each file."""
    return [
        {
            "cell": test.cell,
            "test": test.test,
            "kind": test.kind,
            "file": test.file,
            "ambient_temperature_celsius": test.ambient_celsius,
            "instrument": None,
            "current_sign": test.current_sign,
            "cycle": CELLS[test.cell].cycle if test.cell in CELLS else None,
            "soc": test.soc,
            "role": test.role,
            "sha256": checksums[test.file],
            "note": test.note,
        }
        for test in plan()
        if test.file in checksums
    ]


def groups_sheet(initial_soc: list[float]) -> list[dict]:
    """Rows of groups.tsv."""
    branches = zip(PAIR, PAIR_WIRE_OHM, initial_soc, strict=True)
    return [
        {
            "group": "pair",
            "position": position,
            "cell": name,
            "wire_resistance_ohm": wire,
            "initial_soc": soc,
        }
        for position, (name, wire, soc) in enumerate(branches, 1)
    ]


def as_tsv(rows: list[dict]) -> str:
    """Tab-separated text, blank where nothing is known."""
    lines = [list(rows[0]), *[["" if v is None else f"{v}" for v in row.values()] for row in rows]]
    return "\n".join(["\t".join(line) for line in lines]) + "\n"
