"""Peaks, curves and capacities of the charges of a type's cells, from their artefacts."""

import numpy as np

from runtime import artefact, tables

CURVE = ("voltage_volt", "dq_dv_ampere_hour_per_volt")


def peaks(tracks, single, tests):
    """Rows of peaks: of tracked cells, and of those with a single charge; and the tracked cells."""
    followed = tables.rows_of(tracks, tests)
    cells = {row["cell"] for row in followed}
    alone = [row for row in tables.rows_of(single, tests) if row["cell"] not in cells]
    return [*followed, *alone], cells


def capacities(check_ups, lives, tests):
    """Rows of capacities of check-ups, and of the discharges of ageing records."""
    cycled = [row | {"of_a_life": True} for row in tables.rows_of(lives, tests)]
    return [*tables.rows_of(check_ups, tests), *cycled]


def curves(check_ups, lives, tests):
    """Columns of the curves (voltage, dQ/dV) by cell, test and cycle."""
    found = {}
    for columns, about in artefact.load_all(check_ups):
        cell, test = about["wildcards"]["cell"], about["wildcards"]["test"]
        key = cell, test, float(tests[f"{cell}/{test}"]["cycle"] or 0)
        found[key] = {name: columns[name] for name in CURVE}
    for columns, about in artefact.load_all(lives):
        cell, test = about["wildcards"]["cell"], about["wildcards"]["test"]
        for cycle in np.unique(columns["cycle"]):
            of_cycle = columns["cycle"] == cycle
            found[cell, test, float(cycle)] = {name: columns[name][of_cycle] for name in CURVE}
    return found
