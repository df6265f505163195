"""Files of a campaign from its plan: the only place of the laboratory that writes them."""

import csv
import hashlib
import io
import json
from collections.abc import Iterable
from pathlib import Path

from virtual_lab import instruments, truth
from virtual_lab.campaigns import Plan, Test, as_table, cells_sheet, tests_sheet
from virtual_lab.instruments import faults, measurement

PARTS = ".virtual_lab"
SIMULATED = "data/simulated.csv"  # where the report looks for it


def make_batch(plan: Plan, batch: str, folder: Path) -> None:
    """Simulate and measure the tests of one job; write their files, and a part of the truth."""
    tests = plan.batches()[batch]
    parts: list[dict] = []
    checksums = {}
    for test in tests:
        content, rows = made(test)
        checksums[test.file] = hashlib.sha256(content).hexdigest()
        _write(folder / test.file, content)
        parts.append(rows)
    # Facts about a specimen come with its first test of all.
    specimens = {cell.name: cell.specimen for cell in plan.cells} | plan.groups
    first = {test.cell: test for test in reversed(plan.tests)}
    names = [name for name in dict.fromkeys(test.cell for test in tests) if first[name] in tests]
    parts += [specimens[name].facts(name) for name in names]
    _write(folder / PARTS / f"{batch}.json", _json({"files": checksums, "truth": _merged(parts)}))


def make_sheets(plan: Plan, folder: Path) -> None:
    """Write the campaign's sheets and its truth from the parts that the jobs have written."""
    parts = [
        json.loads((folder / PARTS / f"{batch}.json").read_text(encoding="utf-8"))
        for batch in plan.batches()
    ]
    checksums = {file: digest for part in parts for file, digest in part["files"].items()}
    truth_tables = _merged(part["truth"] for part in parts)
    truth_tables = plan.compared(truth_tables) if plan.compared else truth_tables
    groups = truth_tables.pop("groups", [])
    sheets = {"cells": cells_sheet(plan), "tests": tests_sheet(plan, checksums)}
    sheets |= {"groups": groups} if groups else {}
    for name, rows in sheets.items():
        _write(folder / "config" / f"{name}.tsv", as_table(rows, separator="\t").encode())
    _write(folder / "config" / "config.yaml", plan.config.encode())
    for name, rows in truth_tables.items():
        nested = any(isinstance(value, list | dict) for row in rows for value in row.values())
        suffix, content = ("json", _json(rows)) if nested else ("csv", _csv(rows))
        _write(folder / plan.truth / f"{name}.{suffix}", content)
    _write(folder / plan.truth / "README.md", plan.about.encode())
    if plan.simulated:
        _write(folder / SIMULATED, _csv(plan.simulated))


def made(test: Test) -> tuple[bytes, dict[str, list[dict]]]:
    """One test's file, as its instrument writes it, and rows of truth tables about it."""
    if callable(test.steps):
        test = test._replace(steps=test.steps())
    columns, rows = _spectrum(test) if test.steps is None else _record(test)
    columns, spoiled = faults.spoiled(columns, test.faults) if test.faults else (columns, [])
    options = {"discharge_positive": True} if test.discharge_positive else {}
    content = instruments.WRITERS[test.instrument](columns, **options)
    if spoiled:
        rows["faults"] = [
            {k: float(f"{v:.9g}") if isinstance(v, float) else v for k, v in row.items()}
            for row in spoiled
        ]
    if test.damage:
        content, did = test.damage(content)
        rows = {"excluded": [{"file": test.file, "reason": did[0]["fault"]}]}
    named = {"cell": test.cell, "test": test.test}
    return content, {table: [named | row for row in of_test] for table, of_test in rows.items()}


def _record(test):
    behaviours = test.specimen.run(test.steps, chamber=test.around, initial_soc=test.initial_soc)
    chain = test.chain or test.specimen.chain
    ideal = measurement.record(
        behaviours,
        periods_second=[step.period_second for step in test.steps],
        chamber=test.around,
        seed=test.seed,
        chain=chain,
    )
    shown = measurement.measured(ideal, seed=test.seed + 1, chain=chain)
    return shown, truth.rows(test, behaviours)


def _spectrum(test):
    celsius = float(test.around.celsius[0])
    setting = {"celsius": celsius, "soc": test.initial_soc}
    frequency = getattr(test.specimen, "frequency_hertz", measurement.FREQUENCY_HERTZ)
    true = test.specimen.spectrum(frequency, **setting)
    columns = measurement.measured_spectrum(
        true, ambient_celsius=celsius, seed=test.seed, frequency_hertz=frequency
    )
    return columns, {"eis": [test.specimen.circuit(**setting)]}


def _merged(parts: Iterable[dict[str, list[dict]]]) -> dict[str, list[dict]]:
    """Tables of several parts, one below the other."""
    tables: dict[str, list[dict]] = {}
    for part in parts:
        for name, rows in part.items():
            tables.setdefault(name, []).extend(rows)
    return tables


def _csv(rows) -> bytes:
    text = io.StringIO()
    names = list(dict.fromkeys(name for row in rows for name in row))
    writer = csv.DictWriter(text, names, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue().encode()


def _json(content) -> bytes:
    return (json.dumps(content, indent=1, allow_nan=False) + "\n").encode()


def _write(path: Path, content: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
