"""`check FOLDER`: what a campaign's sheets and files hold, and what a run will make of each test.

Nothing is fitted: each file is read as the run reads it, and of the steps of the method those are
called that need one test alone.
"""

import shlex
import textwrap
from contextlib import chdir
from pathlib import Path

import numpy as np

import cellwright as cw
from cellwright.messages import Said, listed
from cellwright.protocols.impedance.analysis import doubt_of_size
from cellwright.protocols.resistance import pulse_steps
from cellwright.records.kinds import likely_kinds
from cellwright.refusal import Refusal
from runtime import campaign_check, raw_files, sheets
from runtime.model_plan import ModelPlan
from runtime.plan import CAPACITY_KINDS, FACTS_OF_FILES, PULSE_KINDS, SIZE_KINDS, Plan
from runtime.search_plan import SearchPlan

SCHEMAS = Path(__file__).resolve().parents[2] / "workflow" / "schemas"
SLOWEST_HOUR = 100.0  # no cell is tested below C/100 alone: then its rating is in another unit
SHOWN = 5  # files, or tests, that are named
LETTERS = 160  # of a note; `inspect` shows all of it
NOTHING = "check.nothing"  # code of a sentence on what a test does not give


def check(folder):
    """Lines about a campaign, as they are found: sheets, files, tests, cells, the next command.

    Raises
    ------
    Refusal
        The sheets or settings have faults, all of which it names.
    """
    try:
        campaign, missing = campaign_check.check(folder, SCHEMAS)
    except sheets.CampaignError as faults:
        raise Refusal(str(faults)) from None
    yield f"sheets: {len(campaign.cells)} cells, {len(campaign.tests)} tests, no fault"
    yield from missing
    plan, left_out, without = Plan(campaign), 0, 0
    yield from _of_no_sheet(folder, plan)
    scored = {row["kind"] for row in campaign.tests} - {"eis"}
    models = ModelPlan(plan, scored_kinds=sorted(scored))
    searched = SearchPlan(plan, models, campaign.config["missing_effect"]).searched
    for name, rows in plan.tests_of.items():
        yield f"{name}:"
        largest, noted = 0.0, {}
        for row in rows:
            try:
                said, ampere, notes = _of_test(folder, campaign.config, plan, row)
            except (Refusal, OSError) as reason:
                said, ampere, notes, left_out = [f"left out: {reason}"], 0.0, (), left_out + 1
            largest = max(largest, ampere)
            without += any(getattr(words, "code", "") == NOTHING for words in said)
            for note in dict.fromkeys(notes):
                short = textwrap.shorten(note, LETTERS, placeholder=" … (all of it: inspect)")
                noted.setdefault(short, []).append(row["test"])
            yield f"  {row['test']} ({row['kind']}): {'; '.join(said)}"
        yield from (f"  note on {_named(tests)}: {note}" for note, tests in noted.items())
        if name in plan.cells:
            yield from _of_cell(name, largest, models, searched)
    yield f"{len(campaign.tests)} tests: {left_out} left out, {without} that lack a result"
    yield f"next: ./run snakemake --cores 2 --directory {shlex.quote(str(folder))}"


def _of_no_sheet(folder, plan):
    """A line on files beside those that the sheets name: a campaign may lie in a larger folder."""
    known = {Path(file).as_posix() for file in (*plan.files_of_tests(), *plan.files_of_cells())}
    beside = {_top(file) for file in known if Path(folder, file).exists()}
    others = [file for file in campaign_check.files_below(folder) if file not in known]
    others = [file for file in others if not beside or _top(file) in beside]
    if others:
        more = f" and {len(others) - SHOWN} more" if len(others) > SHOWN else ""
        yield f"files that no sheet names: {', '.join(others[:SHOWN])}{more}"


def _top(file):
    """The outermost folder of a file; "" where it lies in none."""
    return file.partition("/")[0] if "/" in file else ""


def _of_test(folder, config, plan, row):
    """What a test holds and its steps give, sentences; its largest current [A]; notes."""
    largest, spectrum = config["files"]["largest_megabyte"], row["kind"] == "eis"
    how = {name: row[name] for name in FACTS_OF_FILES}
    with chdir(folder):
        files = raw_files.contents(how.pop("file"), how.pop("sha256"), largest)
    group = plan.branches.get(row["cell"])
    if group:
        how |= {"members": len(group), "cells": len(plan.leaves[row["cell"]])}
    kind = "impedance" if spectrum else "series"
    raw = cw.read(files, kind=kind, **how, largest_megabyte=largest)
    if spectrum:
        hertz = raw.columns["frequency_hertz"]
        said = f"a spectrum of {len(hertz)} points, {min(hertz):.3g} to {max(hertz):.3g} Hz"
        ohm = raw.columns["impedance_real_ohm"] + 1j * raw.columns["impedance_imaginary_ohm"]
        rated = plan.cells.get(row["cell"], {}).get("rated_capacity_ampere_hour")
        doubts = filter(None, (raw.content["doubt"], doubt_of_size(ohm, rated)))
        return [said, *(f"in doubt: {words}" for words in doubts)], 0.0, raw.notes
    cell = plan.facts_of(row["cell"])
    series = cw.clean(raw, config["clean"], cell=None if group else cell, test=row)
    steps = cw.segment(series, cell, config["segment"])
    time, current = (series.columns[n] for n in ("test_time_second", "current_ampere"))
    said = [f"{len(time)} rows, {np.ptp(time) / 3600:.3g} h"]
    said += [] if group else _yields(series, steps, cell, row, config)
    return said, float(np.abs(current).max()), (*raw.notes, *series.notes)


def _yields(series, steps, cell, row, config) -> list[Said]:
    """What the steps of the method give of one test of a cell, or why they give nothing."""
    kind, kinds = row["kind"], [name for name, _ in likely_kinds(steps.rows._asdict())]
    said = []
    if kind in CAPACITY_KINDS:
        whole, instrument = kind == "ocv", config["instrument"]
        said += _tried(
            "capacity",
            lambda: _capacities(
                cw.capacity(series, steps, cell, instrument, whole_swing=whole, test=row)
            ),
        )
    if kind == "ocv":
        hour = config["ocv"]["least_hour"]
        said += _tried(
            "open-circuit voltage",
            lambda: f"{len(cw.ocv(series, cell, least_hour=hour, test=row).curve.soc)} points",
        )
    if kind == "ageing":
        said += _tried(
            "cycles",
            lambda: (
                f"{len(cw.ageing_cycles(series, steps, row, cell).to_frame())} half cycles counted"
            ),
        )
    if kind == "ica":
        said += _tried("dQ/dV", lambda: f"a charge at {cw.ica(series, steps).c_rate:.3g} C")
    if kind in PULSE_KINDS:
        said.append(_pulses(steps.rows))
    if kinds and kind not in kinds and any(words.code == NOTHING for words in said):
        said.append(Said(f"its steps look like those of kind {' or '.join(kinds)}"))
    return said


def _pulses(steps) -> Said:
    """How many loads of a record tell a resistance."""
    number = len(pulse_steps(steps))
    if not number:
        return Said("no pulse, and no load from rest", NOTHING)
    brief = np.any(steps.kind == "pulse")
    return Said(f"pulses: {number}" if brief else f"no pulse; loads from rest: {number}")


def _tried(what, step) -> list[Said]:
    """What a step gives, or why it gives nothing."""
    try:
        return [Said(f"{what}: {step()}")]
    except Refusal as reason:
        return [Said(f"no {what}: {reason}", NOTHING)]


def _capacities(found):
    rows = found.to_frame()
    return ", ".join(
        f"{row.capacity_ampere_hour:.4g} Ah {row.direction} at {row.c_rate:.3g} C"
        + (f" (in doubt: {row.doubt})" if row.doubt else "")
        for row in rows.itertuples()
    )


def _named(tests):
    return listed(tests) if len(tests) <= SHOWN else f"{len(tests)} tests, {tests[0]} the first"


def _of_cell(name, largest_ampere, models, searched):
    """What a cell's tests give together, and what they lack, a line each."""
    plan = models.plan
    rated = plan.cells[name]["rated_capacity_ampere_hour"]
    if rated and largest_ampere and rated / largest_ampere > SLOWEST_HOUR:
        yield (
            f"  config/cells.tsv: found a rating of {rated:g} Ah beside currents of "
            f"{largest_ampere:.3g} A at most; in mAh? Write {rated / 1000:g}"
        )
    if not plan.rows(name, *SIZE_KINDS, "ageing"):
        yield "  no capacity of its own: needs a test of kind capacity or ocv"
    sources = {
        "its pulses and fitted drives": models.excited,
        "its table": models.given,
        "its type's reference": models.biased,
        "its long loads": models.loaded,
        "its group": models.grouped,
    }
    source = next((words for words, cells in sources.items() if name in cells), None)
    if source is None:
        yield "  no model: needs an hppc test, a drive of role fit, or ocv and capacity tests"
        return
    tests = [row["test"] for row in models.scored.get(name, ())]
    held = f"validated on {_named(tests)}" if tests else "not validated: no test of role validation"
    yield f"  a model of {source}, {held}"
    if name not in searched:
        yield "  no search for a missing effect: needs tests to fit and one of role validation"
