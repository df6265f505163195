"""Tables over the cells of each type: resistance against capacity, protocols compared."""

import cellwright as cw
from cellwright.refusal import Refusal
from runtime import artefact


def resistance_tables(check_ups, resistances, types) -> tuple[list, list]:
    """Rows of tables/fleet_health and of tables/fleet_health_lines.

    Parameters
    ----------
    check_ups, resistances : artefacts of stages `checkups`, `resistance_growth`. types : cells of
        each type, by its name.
    """
    rated, pulses = (
        {about["wildcards"]["cell"]: artefact.rows(columns) for columns, about in loaded}
        for loaded in map(artefact.load_all, (check_ups, resistances))
    )
    cells, lines = [], []
    for name, names in types.items():
        told = [(cell, rated[cell][0], pulses.get(cell, [])) for cell in names if cell in rated]
        # A type that cannot be compared has its reason in the table, and takes no other type down.
        try:
            found = cw.fleet_resistance(told)
        except Refusal as refusal:
            lines.append({"type": name, "cells": len(told), "verdict": str(refusal)})
            continue
        cells += [{"type": name} | row for row in found.rows]
        lines.append({"type": name} | found.line | {"delay": found.delay})
    return _filled(cells, "tables/fleet_health"), _filled(lines, "tables/fleet_health_lines")


def protocol_table(life_paths, course_paths, types, protocols) -> list:
    """Rows of tables/protocols.

    Parameters
    ----------
    life_paths, course_paths : artefacts of stages `life`, `fade_course`, of the same cells.
    types : cells of each type, by its name. protocols : of each cell, None where not stated.
    """
    lives = {}
    pairs = zip(life_paths, course_paths, strict=True)
    for life_path, course_path in pairs:
        for life, about in artefact.load_all([life_path]):
            course = artefact.load(course_path)
            lives[about["wildcards"]["cell"]] = artefact.rows(life)[0], course
    rows = []
    for name, names in types.items():
        told = [(cell, protocols[cell], lives[cell]) for cell in names if cell in lives]
        try:
            rows += [{"type": name} | row for row in cw.compare_protocols(told).rows]
        except Refusal as refusal:
            rows.append({"type": name, "verdict": str(refusal)})
    return _filled(rows, "tables/protocols")


def _filled(rows, table) -> list:
    """Rows with all columns of the contract; None where a row has none."""
    from runtime import contract

    names = contract.stages()[table]["columns"]
    return [dict.fromkeys(names) | row for row in rows]
