"""Lives of cells as jobs read them: ageing records with their temperature, what methods found."""

from runtime import artefact, facts, tables


def records(cycles_paths, summary_paths, compensated_paths) -> list[tuple]:
    """(facts of the test, cycles, temperature or None) of each ageing record with content."""
    triples = zip(cycles_paths, summary_paths, compensated_paths, strict=True)
    found = [
        (facts.of_artefact(about), cycles, _temperature(summary_path, compensated_path))
        for cycles_path, summary_path, compensated_path in triples
        for cycles, about in artefact.load_all([cycles_path])
    ]
    # None has content: the first reason is the one to pass on.
    if not found:
        artefact.load_some(cycles_paths)
    return found


def _temperature(summary_path, compensated_path):
    """(row, columns) of what temperature does in a record, None where that could not be told."""
    told = artefact.load_all([summary_path, compensated_path])
    # Both are made by one job, so that either both have content or neither has.
    if len(told) < 2:
        return None
    (summary, _), (compensated, _) = told
    return artefact.rows(summary)[0], compensated


def check_up_rows(paths, tests) -> list[list[dict]]:
    """Rows of the capacities and of the resistances of a cell, two lists of paths.

    Raises
    ------
    Passed
        With the first reason, where all were refused.
    """
    found = [tables.rows_of(part, tests) for part in paths]
    if not any(found):
        artefact.load_some([path for part in paths for path in part])
    return found


def throughputs(paths) -> list[tuple]:
    """(cycle, charge discharged up to there) over a cell's life, where it has one."""
    course = artefact.load_first(paths)
    if course is None:
        return []
    return list(
        zip(course["cycle"].tolist(), course["throughput_ampere_hour"].tolist(), strict=True)
    )


def found(inputs) -> dict:
    """What each method found on a cell, as `cw.state_of_health` takes it; the inputs by name.

    Raises
    ------
    Passed
        With the first reason, where no method found anything.
    """
    paths = dict(inputs.items())
    loaded = {name: next(iter(artefact.load_all([path])), None) for name, path in paths.items()}
    if not any(loaded.values()):
        artefact.load(next(iter(paths.values())))
    course = loaded.pop("course", None)
    told = {
        name: [{"doubt": tables.doubt_in_words(about)} | row for row in artefact.rows(content)]
        for name, (content, about) in filter(lambda one: one[1] is not None, loaded.items())
    }
    life = told.pop("life", None)
    return told if life is None else told | {"fade": (life[0], course[0])}


def with_sheet(check_ups, sheet) -> list[dict]:
    """Rows of check-ups beside what config/checkups.tsv says of the same cycle."""
    # Any column with its unit: a laboratory measures thickness, mass or gas, as it likes.
    quantities = [name for name in (sheet[0] if sheet else {}) if name not in ("cell", "cycle")]
    by_cycle = {row["cycle"]: row for row in sheet}
    return [
        row | {f"sheet_{name}": by_cycle.get(row["cycle"], {}).get(name) for name in quantities}
        for row in check_ups
    ]
