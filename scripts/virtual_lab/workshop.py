"""From the plan to files: the only place of the laboratory that touches the disk."""

import hashlib
import json
from pathlib import Path

import numpy as np

from virtual_lab import campaign, instruments, measurement, truth
from virtual_lab.cells import CELLS

ROOT = Path(__file__).resolve().parents[2]
FRAGMENTS = ROOT / ".virtual_lab"
WRITERS = {
    "arbin": instruments.arbin_csv,
    "bdf": instruments.bdf_csv,
    "parquet": instruments.bdf_parquet,
    "eis": instruments.spectrum_csv,
}


def make_test(cell: str, test: str) -> None:
    """Simulate and measure one test of the plan; write its file and its truth."""
    wanted = next(row for row in campaign.plan() if (row.cell, row.test) == (cell, test))
    kinds = {"eis": _spectrum, "group": _pair}
    columns, facts = kinds.get(wanted.kind, _record)(wanted)
    options = {"discharge_positive": True} if wanted.discharge_positive else {}
    _write(ROOT / wanted.file, WRITERS[wanted.instrument](columns, **options))
    _write(FRAGMENTS / f"{wanted.file}.json", _json(facts))


def make_sheets() -> None:
    """Write the campaign's sheets; a test whose file is not there is left out."""
    files = [test.file for test in campaign.plan() if (ROOT / test.file).is_file()]
    checksums = {file: hashlib.sha256((ROOT / file).read_bytes()).hexdigest() for file in files}
    sheets = {"cells": campaign.cells_sheet(), "tests": campaign.tests_sheet(checksums)}
    sheets["groups"] = campaign.groups_sheet(_pair_initial_soc())
    for name, rows in sheets.items():
        _write(ROOT / "config" / f"{name}.tsv", campaign.as_tsv(rows).encode())


def make_truth() -> None:
    """Gather what is true about cells and tests."""
    from virtual_lab import physics

    known = {
        "cells": {name: physics.cell_facts(cell) for name, cell in CELLS.items()},
        "tests": {
            f"{test.cell}/{test.test}": json.loads((FRAGMENTS / f"{test.file}.json").read_text())
            for test in campaign.plan()
        },
    }
    _write(ROOT / "tests" / "truth" / "truth.json", _json(known))


def _record(test):
    from virtual_lab import physics, simulate

    cell = CELLS[test.cell]
    behaviours = simulate.run(test.steps, cell, ambient_celsius=test.ambient_celsius)
    capacity = physics.full_charge_ampere_hour(cell)
    facts = truth.facts(test.steps, behaviours, capacity_ampere_hour=capacity)
    return _noted(test, behaviours), facts


def _spectrum(test):
    from virtual_lab import impedance

    setting = {"ambient_celsius": test.ambient_celsius, "soc": test.soc}
    frequency = np.append(impedance.OHMIC_FREQUENCY_HERTZ, impedance.FREQUENCY_HERTZ)
    true = impedance.spectrum(CELLS[test.cell], frequency, **setting)
    columns = impedance.measured_spectrum(
        true[1:], ambient_celsius=test.ambient_celsius, seed=test.seed
    )
    return columns, impedance.facts(true[1:], ohmic_ohm=true[0].real)


def _pair(test):
    from virtual_lab import parallel

    pair = tuple(CELLS[name] for name in campaign.PAIR)
    behaviours = parallel.run(
        test.steps,
        pair,
        wire_ohm=campaign.PAIR_WIRE_OHM,
        initial_soc=_pair_initial_soc(),
        ambient_celsius=test.ambient_celsius,
    )
    return _noted(test, behaviours), truth.pair_facts(behaviours)


def _noted(test, behaviours):
    """The record as the instrument shows it, faults included."""
    ideal = measurement.record(
        behaviours,
        periods_second=[step.period_second for step in test.steps],
        ambient_celsius=test.ambient_celsius,
        seed=test.seed,
    )
    shown = measurement.measured(ideal, seed=test.seed + 1)
    return test.fault(shown) if test.fault else shown


def _pair_initial_soc() -> list[float]:
    """Both cells rested at one voltage; as precise as the sheet says it."""
    from virtual_lab import physics

    volt = campaign.PAIR_INITIAL_VOLT
    return [round(physics.soc_at(CELLS[name], volt), 4) for name in campaign.PAIR]


def _json(content) -> bytes:
    return (json.dumps(content, indent=1, sort_keys=True, allow_nan=False) + "\n").encode()


def _write(path: Path, content: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
