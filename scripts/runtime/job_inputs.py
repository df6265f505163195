"""Inputs of a job as the science takes them: artefacts with what the sheets say of them."""

from cellwright.messages import Said, doubt_columns, doubts_in
from cellwright.records.basis import Lender
from cellwright.records.facts import CellFacts, MeasuredTest, TestFacts
from cellwright.refusal import Refusal
from runtime import artefact, contract, raw_files

# Facts of a row that is computed from several tests, in a table of rows of single tests.
OF_NO_TEST = {"test": "", "cycle": None, "ambient_temperature_celsius": None, "soc": None}
MEASUREMENTS = ("eis", "resistance", "relaxation", "capacity", "ocv_entropic")


def facts_of_job(snakemake) -> tuple[TestFacts, CellFacts]:
    """Facts of the test and of the cell of a job."""
    params = snakemake.params
    return TestFacts(snakemake.wildcards.test, **params.test), CellFacts(**params.cell)


def facts_of_artefact(about) -> TestFacts:
    """Facts of the test that an artefact is of, as the sheet gave them to its job."""
    # As its job was told, not as the sheet says now: an artefact that is not made anew stays true.
    return TestFacts(about["wildcards"]["test"], **about["params"]["test"])


def place_of(about) -> tuple[str, str]:
    """Cell and test of an artefact."""
    return about["wildcards"]["cell"], about["wildcards"]["test"]


def tests(paths) -> list[MeasuredTest]:
    """Facts of each test and the columns of its artefact, of those that have content."""
    loaded = artefact.load_all(paths)
    return [MeasuredTest(facts_of_artefact(about), columns) for columns, about in loaded]


def tests_with_steps(steps_paths, series_paths) -> list[tuple[TestFacts, dict, dict]]:
    """Each test with its clean series and its steps, where both could be made."""
    loaded = artefact.load_together(zip(steps_paths, series_paths, strict=True))
    return [(facts_of_artefact(about), series, steps) for steps, series, about in loaded]


def rows_of_tests(paths) -> list[dict]:
    """Rows of all artefacts with content, each with cell or group, test and what the sheet says."""
    return [
        dict(about["wildcards"]) | about["params"].get("test", {}) | row
        for columns, about in artefact.load_all(paths)
        for row in artefact.rows(columns)
    ]


def rows_of(paths, tests, *, of_models=False) -> list[dict]:
    """Rows of all artefacts with content, each with its cell, test and facts of the sheet.

    A row that has no `doubt` of its own has that of the tests that move it; where rows are many of
    one model (`of_models`), that of its own test alone: what moves a model moves all of it, and
    stands once in table `choice`, which has a row for it.
    """
    table_rows = []
    doubts = own_doubts if of_models else doubts_behind
    loaded = [(path, *one) for path in paths for one in artefact.load_all([path])]
    for path, columns, about in loaded:
        wildcards = dict(about["wildcards"])
        facts_without_test = {} if "test" in wildcards else OF_NO_TEST
        facts = tests.get(
            f"{wildcards.get('cell') or wildcards.get('group')}/{wildcards.get('test')}",
            facts_without_test,
        )
        rows, stage = artefact.rows(columns), contract.stage_of(path)
        own = {row["test"] for row in rows if row.get("test")}
        table_rows += [
            wildcards
            | facts
            | row
            | _doubts_of_row(row, doubts(about, own - {row.get("test")}), stage)
            for row in rows
        ]
    # Stages that share a table may have columns that the others lack: not known there.
    # In the order in which they are first seen, so that the same results give the same table.
    names = dict.fromkeys(name for row in table_rows for name in row)
    return [dict.fromkeys(names) | row for row in table_rows]


def _doubts_of_row(row, behind, stage):
    """Columns `doubt` and `doubt_codes` of a table's row: its own, else those behind it."""
    if "doubt" in row:
        return doubt_columns(doubts_in(row, stage))
    return doubt_columns(behind)


def doubts_behind(about, of_other_rows=frozenset()) -> list:
    """What speaks against the numbers of an artefact: its own doubts, and those that move it.

    Doubts of other tests, which it does not stand on, are in the cell's row of the summary.
    of_other_rows : tests of which the artefact has rows, but not this one. Returns list of Said.
    """
    own, doubts = artefact.owner_of(about), about.get("doubts", {})
    moving = {own, *about.get("moved_by", doubts)}
    return [
        one if of == own else Said(f"{of.strip()}: {one}", one.code)
        for of in doubts
        if of in moving and of.partition(" ")[2] not in of_other_rows
        for one in artefact.doubts_about(about, of)
    ]


def own_doubts(about, of_other_rows=frozenset()) -> list:
    """What speaks against an artefact itself and the test that it is of, and nothing behind it."""
    return doubts_behind(about | {"moved_by": ()}, of_other_rows)


def rows_of_cell(columns, cell) -> list[dict]:
    """Rows of one cell among columns of several.

    Raises
    ------
    Refusal
        None is of this cell.
    """
    rows = [row for row in artefact.rows(columns) if row["cell"] == cell]
    if not rows:
        raise Refusal(f"nothing is known of {cell}: none of its charges could be used")
    return rows


def fresh_cell(cells, paths):
    """Facts and tests of the cell that lends its fresh state; None where none does."""
    # Of several cells marked fresh the first of the sheet, so that a run is the same every time.
    return (CellFacts(**cells[0]), tests(paths)) if cells else None


def dated(about) -> dict:
    """Name, temperature and cycle of the test that an artefact is of."""
    test = facts_of_artefact(about)
    return {n: getattr(test, n) for n in ("test", "ambient_temperature_celsius", "cycle")}


def dated_rows(loaded) -> list[dict]:
    """Rows of loaded artefacts, (columns, about) each, with test, temperature and cycle."""
    return [dated(about) | row for columns, about in loaded for row in artefact.rows(columns)]


def curves(paths) -> list[dict]:
    """OCV curves of stage `ocv` or `ocv_rests` as plain lists with their facts and test."""
    return [
        dated(about) | about["facts"] | {name: values.tolist() for name, values in columns.items()}
        for columns, about in artefact.load_all(paths)
    ]


def capacities(paths) -> list[dict]:
    """Rows of stage `capacity` with test, temperature and cycle."""
    return dated_rows(artefact.load_all(paths))


def paths_by_cell(paths) -> dict[str, list]:
    """Paths of artefacts by the cell that they are of."""
    found = {}
    for path in paths:
        found.setdefault(artefact.read_about(path)["wildcards"]["cell"], []).append(path)
    return found


def lenders(ocv_paths, capacity_paths, references) -> list[Lender]:
    """Lenders: the cells of the artefacts with their curves and capacities."""
    slow, sizes = paths_by_cell(ocv_paths), paths_by_cell(capacity_paths)
    return [
        Lender(
            cell, cell in references, curves(slow.get(cell, [])), capacities(sizes.get(cell, []))
        )
        for cell in slow | sizes
    ]


def models_without(paths) -> dict:
    """Models that were identified without one temperature, by that temperature [°C]."""
    models = artefact.load_all(paths)
    return {float(about["wildcards"]["celsius"]): model for model, about in models}


def ageing_records(cycles_paths, summary_paths, compensated_paths) -> list[tuple]:
    """(facts of the test, cycles, temperature) of each ageing record with content.

    temperature : (row, columns) of what it does in the record, None where that was not told.
    """
    found = []
    for path, *pair in zip(cycles_paths, summary_paths, compensated_paths, strict=True):
        told = [content for content, _ in artefact.load_all(pair)]
        # Both are made by one job, so that either both have content or neither has.
        temperature = (artefact.rows(told[0])[0], told[1]) if told else None
        found += [(test.facts, test.series, temperature) for test in tests([path])]
    # None has content: the first reason is the one to pass on.
    if not found:
        artefact.load_some(cycles_paths)
    return found


def check_up_rows(paths, facts_of_tests) -> list[list[dict]]:
    """Rows of the capacities and of the resistances of a cell, two lists of paths.

    Raises
    ------
    Passed
        With the first reason, where all were refused.
    """
    found = [rows_of(part, facts_of_tests) for part in paths]
    if not any(found):
        artefact.load_some([path for part in paths for path in part])
    return found


def throughputs(paths) -> list[tuple]:
    """(cycle, charge discharged up to there) over a cell's life, where it has one."""
    course = artefact.load_first(paths)
    if course is None:
        return []
    columns = course["cycle"].tolist(), course["throughput_ampere_hour"].tolist()
    return list(zip(*columns, strict=True))


def told_of_health(inputs) -> dict:
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
        name: [doubt_columns(doubts_behind(about)) | row for row in artefact.rows(content)]
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


def known_cells(branches, lenders, paths) -> list[tuple]:
    """The model of the cell in each branch of a group, None where there is none, and its cell.

    Parameters
    ----------
    branches : rows of groups.tsv. lenders : cell whose model stands for a cell without one.
    paths : of the models.
    """
    models = {about["wildcards"]["cell"]: model for model, about in artefact.load_all(paths)}
    # A cell without pulses of its own is known by its type, which the verdict says.
    sources = [lenders.get(row["cell"], row["cell"]) for row in branches]
    return [(models.get(source), source) for source in sources]


def references(rows, basis_paths, series_paths) -> list[tuple]:
    """Healthy cells of the type: facts, basis and tests of each."""
    series = paths_by_cell(series_paths)
    bases = {basis["cell"]: basis for basis, _ in artefact.load_all(basis_paths)}
    known = [row for row in rows if row["cell"] in bases]
    return [(row, bases[row["cell"]], tests(series[row["cell"]])) for row in known]


def measurements(inputs, facts_of_tests) -> dict:
    """Rows of each kind of measurement of a cell by itself, with what the sheet says of its test.

    Parameters
    ----------
    inputs : of a job, with the artefacts of `MEASUREMENTS` by name.
    facts_of_tests : as of `tables.rows_of`.
    """
    return {stage: rows_of(getattr(inputs, stage), facts_of_tests) for stage in MEASUREMENTS}


def simulated(files, measured, read, content=None) -> tuple[dict, list[str]]:
    """Simulated voltages by test, and notes on those that could not be read.

    Parameters
    ----------
    files : dict test → path relative to the campaign. measured : list of MeasuredTest there are.
    read : function of one file, `cw.read_simulated`. content : as of `raw_files.contents`.

    Raises
    ------
    Refusal
        None of them could be read.
    """
    found, notes = {}, []
    # A simulation of a test that could not be read has nothing to be compared with.
    for test in (name for name in files if name in {one.facts.test for one in measured}):
        try:
            (named,) = raw_files.contents([files[test]], None, content=content)
            found[test] = read(named)
        except Refusal as refusal:
            notes.append(f"not used: {test}: {refusal}")
    if not found:
        raise Refusal("; ".join(["no simulated voltage of a test of the cell", *notes]))
    return found, notes
