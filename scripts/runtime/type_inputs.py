"""Inputs of jobs about cells of one type: what each shows, its peaks of dQ/dV, and all compared."""

import math
from typing import NamedTuple

import numpy as np

from cellwright.bias.features import Shown, onset_resistances
from cellwright.bias.ways import Scored
from cellwright.health.peaks.over_temperature import Charge
from cellwright.health.peaks.sequences import count_before
from cellwright.health.peaks.tracking import TrackedCharge
from cellwright.records.conditions import in_first_checkup
from cellwright.records.facts import CellFacts
from cellwright.refusal import Refusal
from runtime import artefact, contract, job_inputs

CURVE = ("voltage_volt", "dq_dv_ampere_hour_per_volt")


class ShownPaths(NamedTuple):
    """Paths of what a cell shows: peaks, curves of dQ/dV, onset resistances, capacities."""

    peaks: list
    curves: list
    onset: list
    capacity: list


def shown_paths(inputs, folder="", prefix="") -> ShownPaths:
    """Paths in a job's inputs, of names that begin with `prefix`, of those in `folder`."""
    named = (getattr(inputs, prefix + name) for name in ShownPaths._fields)
    return ShownPaths(*([path for path in paths if folder in path] for paths in named))


def cell_shows(basis_path, model_path, paths, references) -> Shown:
    """What a cell shows at its first check-up; `model_path`: None without a model of its own.

    `paths` : ShownPaths.
    """
    # Without a basis a cell shows nothing: SoC, and with it every feature, refers to it.
    basis = artefact.load(basis_path)
    tables_of = (paths.peaks, paths.onset, paths.capacity)
    peaks, onset, capacity = (_first_checkup(artefact.load_all(part)) for part in tables_of)
    curve_of = {_name_of(path): path for path in paths.curves}
    measured = [(columns, curve_of[about["wildcards"]["test"]]) for columns, about in peaks]
    onsets = job_inputs.dated_rows(onset)
    return Shown(
        cell=basis["cell"],
        marked=basis["cell"] in references,
        capacity_ampere_hour=basis["capacity_ampere_hour"],
        model=artefact.load_first([model_path] if model_path else []),
        peaks=job_inputs.dated_rows(peaks),
        onset_ohm=onset_resistances(onsets, "discharge"),
        begin_ohm=onset_resistances(onsets, "charge"),
        capacities=tuple(job_inputs.dated_rows(capacity)),
        charges=tuple(
            {"c_rate": float(columns["c_rate"][0])}
            | {name: curve[name] for name in ("voltage_volt", "charge_ampere_hour")}
            for columns, path in measured
            if len(columns["c_rate"])
            for curve in [artefact.load(path)]
        ),
        capacity_std_ampere_hour=basis.get("capacity_std_ampere_hour"),
    )


def _first_checkup(loaded) -> list:
    """Those of loaded artefacts that are of the earliest check-up."""
    # Features of an aged cell beside those of a fresh one would tell its age, not its making.
    cycles = [job_inputs.facts_of_artefact(about).cycle for _, about in loaded]
    young = in_first_checkup(cycles)
    return [one for one, is_young in zip(loaded, young, strict=True) if is_young]


def _name_of(path):
    """Cell or test that the artefact of this path is of."""
    return path.rpartition("/")[2].rpartition(".")[0]


def peer_paths(inputs):
    """(basis, model, ShownPaths) of each peer that has a model, of `bias_correction`."""
    pairs = zip(inputs.peer_basis, inputs.peer_models, strict=True)
    # A peer without a model cannot be the reference, nor does it calibrate anything.
    usable = [pair for pair in pairs if artefact.read_about(pair[1])["reason"] is None]
    for basis, model in usable:
        yield basis, model, shown_paths(inputs, f"/{_name_of(basis)}/", "peer_")


def judged_cells(inputs, references, cells) -> list[Scored]:
    """Cells with a model of their own, the model in use, and their tests that no fit has seen.

    `cells` : facts of each, by name.
    """
    own, found = {_name_of(path): path for path in inputs.own}, []
    for basis, model, paths in peer_paths(inputs):
        cell = _name_of(basis)
        series = [path for path in inputs.series if f"/{cell}/" in path]
        # Identified is not finished: without a model in use others have nothing to be judged by.
        in_use = artefact.load_first([own[cell]])
        if in_use is not None:
            shown = cell_shows(basis, model, paths, references)
            facts, tests = CellFacts(**cells[cell]), tuple(job_inputs.tests(series))
            found.append(Scored(shown, in_use, facts, tests))
    return found


def charges(pairs, celsius) -> list[Charge]:
    """Charges for dQ/dV from their curves and peaks; `celsius`: chamber temperature, by test."""
    return [
        Charge(test, celsius[test], peaks["c_rate"][0], *[curve[name] for name in CURVE])
        for curve, peaks, about in artefact.load_together(pairs)
        for test in [about["wildcards"]["test"]]
    ]


def charges_of_check_ups(paths, curves, tests) -> list[TrackedCharge]:
    """Peaks of the charges of tests of kind `ica`, also of those that have none, with the reason.

    Parameters
    ----------
    paths, curves : artefacts of stages `ica` and `ica_curve` of the same tests.
    tests : facts of the sheet by "cell/test". A charge whose curve is refused too is left out.
    """
    found = []
    for path, curve in zip(paths, curves, strict=True):
        about, made = artefact.read_about(path), artefact.read_about(curve)
        # A charge without peaks is a finding, one without a curve was never seen.
        if made["reason"] is None:
            peaks = artefact.load(path) if about["reason"] is None else {}
            facts, rate = _facts(about, tests), float(made["facts"]["c_rate"])
            found.append(_charge(about, facts, facts["cycle"] or 0.0, rate, peaks, about["reason"]))
    return found


def charges_of_lives(paths, tests) -> list[TrackedCharge]:
    """Peaks of the charges of ageing records.

    Parameters
    ----------
    paths : artefacts of stage `ica_life`. tests : facts of the sheet by "cell/test".
    """
    found, last = [], 0.0
    for peaks, about in artefact.load_all(paths):
        facts, cycles = _facts(about, tests), peaks["cycle"]
        # Records that follow each other without a stated cycle count on.
        before = last if facts["cycle"] is None and cycles.min() <= last else 0.0
        for cycle in np.unique(cycles):
            own = {name: column[cycles == cycle] for name, column in peaks.items()}
            reason, rate = str(own["reason"][0]), float(own["c_rate"][0])
            own = {} if reason else own
            found.append(_charge(about, facts, before + cycle, rate, own, reason))
        last = before + float(cycles.max())
    return found


def _facts(about, tests):
    """What the sheet says of the test of an artefact."""
    return tests["/".join(job_inputs.place_of(about))]


def _charge(about, facts, cycle, c_rate, peaks, reason):
    """One charge with its peaks."""
    celsius = facts["ambient_temperature_celsius"]
    return TrackedCharge(
        test=about["wildcards"]["test"],
        cycle=float(cycle),
        c_rate=c_rate,
        temperature_celsius=math.nan if celsius is None else float(celsius),
        peaks=peaks,
        reason=reason or "",
    )


def peaks_of_type(tracks, single, tests):
    """Rows of peaks: of tracked cells, and of those with a single charge; and the tracked cells."""
    followed = job_inputs.rows_of(tracks, tests)
    cells = {row["cell"] for row in followed}
    alone = [row for row in job_inputs.rows_of(single, tests) if row["cell"] not in cells]
    return [*followed, *alone], cells


def cycles_before(life_curves, peaks) -> dict:
    """Cycles that the tracks count before the records that count on, by (cell, test).

    Parameters
    ----------
    life_curves : artefacts of stage `ica_life_curve`. peaks : rows as of `peaks_of_type`.
    """
    tracked, found = {}, {}
    for row in peaks:
        tracked.setdefault((row["cell"], row["test"]), set()).add(float(row["cycle"] or 0.0))
    for columns, about in artefact.load_all(life_curves):
        place = job_inputs.place_of(about)
        found[place] = count_before(np.unique(columns["cycle"]), tracked.get(place, set()))
    return found


def capacities_of_type(check_ups, lives, tests, before):
    """Rows of capacities of check-ups, and of the discharges of ageing records.

    `before` : as of `cycles_before`.
    """
    cycled = [
        row | {"of_a_life": True, "cycle": row["cycle"] + before.get((row["cell"], row["test"]), 0)}
        for row in job_inputs.rows_of(lives, tests)
    ]
    return [*job_inputs.rows_of(check_ups, tests), *cycled]


def curves_of_type(check_ups, lives, tests, before):
    """Columns of the curves (voltage, dQ/dV) by cell, test and cycle; `before` as there."""
    found = {}
    for columns, about in artefact.load_all(check_ups):
        key = *job_inputs.place_of(about), float(_facts(about, tests)["cycle"] or 0)
        found[key] = {name: columns[name] for name in CURVE}
    for columns, about in artefact.load_all(lives):
        place = job_inputs.place_of(about)
        for cycle in np.unique(columns["cycle"]):
            of_cycle = columns["cycle"] == cycle
            key = *place, float(cycle + before[place])
            found[key] = {name: columns[name][of_cycle] for name in CURVE}
    return found


def rows_by_cell(paths) -> dict[str, list]:
    """Rows of each artefact of a cell that has content, by that cell."""
    loaded = artefact.load_all(paths)
    return {about["wildcards"]["cell"]: artefact.rows(columns) for columns, about in loaded}


def fleet_tables(check_ups, resistances, types, compared) -> tuple[list, list]:
    """Rows of tables/fleet_health and of tables/fleet_health_lines.

    Parameters
    ----------
    check_ups, resistances : artefacts of stages `checkups`, `resistance_growth`. types : cells of
        each type, by its name. compared : `cw.fleet_resistance`.
    """
    rated, pulses = rows_by_cell(check_ups), rows_by_cell(resistances)
    cells, lines = [], []
    for name, names in types.items():
        told = [(cell, rated[cell][0], pulses.get(cell, [])) for cell in names if cell in rated]
        # A type that cannot be compared has its reason in the table, and takes no other type down.
        try:
            found = compared(told)
        except Refusal as refusal:
            lines.append({"type": name, "cells": len(told), "verdict": str(refusal)})
            continue
        cells += [{"type": name} | row for row in found.rows]
        lines.append({"type": name} | found.line | {"delay": found.delay})
    return _filled(cells, "tables/fleet_health"), _filled(lines, "tables/fleet_health_lines")


def protocol_table(life_paths, course_paths, types, protocols, compared) -> list:
    """Rows of tables/protocols.

    Parameters
    ----------
    life_paths, course_paths : artefacts of stages `life`, `fade_course`, of the same cells.
    types : cells of each type, by its name. protocols : of each cell, None where not stated.
    compared : `cw.compare_protocols`.
    """
    lives, rows = rows_by_cell(life_paths), []
    courses = {about["wildcards"]["cell"]: one for one, about in artefact.load_all(course_paths)}
    for name, names in types.items():
        told = [
            (cell, protocols[cell], (lives[cell][0], courses[cell]))
            for cell in names
            if cell in lives
        ]
        try:
            rows += [{"type": name} | row for row in compared(told).rows]
        except Refusal as refusal:
            rows.append({"type": name, "verdict": str(refusal)})
    return _filled(rows, "tables/protocols")


def _filled(rows, table) -> list:
    """Rows with all columns of the contract; None where a row has none."""
    names = contract.stages()[table]["columns"]
    return [dict.fromkeys(names) | row for row in rows]
