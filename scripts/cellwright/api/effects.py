"""What a model lacks, of a cell or of a branch of a parallel group; parallel groups themselves."""

from cellwright.settings import MissingEffect, MissingEffectGroup, Models

MODELS = Models()


def missing_effect(
    cell,
    basis,
    tests,
    settings=None,
    *,
    references=(),
    library=None,
    split_rest_second=MODELS.split_rest_second,
    **changes,
):
    """Search a cell for what a plain model of it lacks, proved on tests that took no part.

    Parameters
    ----------
    cell, basis, tests : as of `identify`, with tests of roles fit, split and validation.
    settings : `settings.MissingEffect`, or its keys as keywords.
    references : (cell, basis, tests) of healthy cells of the type; from three on, the cell is held
        against them.
    library : effects by id that are tried, None: all of `effects.library.LIBRARY`.
    split_rest_second : shortest rest that cuts a test of role split into blocks [s].

    Returns
    -------
    found : MissingEffect; its verdict is the document of docs/missing-effect.md.

    Raises
    ------
    Refusal
        No OCV, nothing to fit, or nothing that judges.

    Source: docs/missing-effect.md.
    """
    from cellwright.api import given, results
    from cellwright.effects.finding import missing_effect as searched
    from cellwright.effects.library import LIBRARY

    found = searched(
        given.cell_facts(cell),
        given.content(basis),
        given.tests(tests),
        LIBRARY if library is None else library,
        settings=_search(settings, split_rest_second, changes),
        references=[_reference(one) for one in references],
    )
    return results.MissingEffect(**found._asdict())


def witnesses(verdict, model, basis, tables, *, ambient_celsius=None, library=None):
    """Which independent measurements of a cell agree with a verdict, contradict it, or are silent.

    Parameters
    ----------
    verdict, model : of `missing_effect`. basis : as of `identify`.
    tables : rows or DataFrames by name, what is absent was not measured: resistance, eis,
        relaxation, capacity and ocv_entropic, with the test's temperature, SoC and cycle beside
        each row; `series`, that of `missing_effect`.
    ambient_celsius : chamber's temperature by test [°C].
    library : effects by id, None: all of `effects.library.LIBRARY`.

    Returns
    -------
    found : Table; one row a witness: what is measured, what the verdict implies, which it says.

    Source: docs/missing-effect.md.
    """
    from cellwright.api import given, results
    from cellwright.effects.library import LIBRARY
    from cellwright.effects.witnesses.collected import measured_of
    from cellwright.effects.witnesses.collected import witnesses as held_against

    content, known = given.content(basis), dict(tables)
    series = given.columns(known.pop("series", {}))
    rows = {name: given.rows(table) for name, table in known.items()}
    ambient = ambient_celsius or {}
    measured = measured_of(rows | {"series": series}, content, model, ambient=ambient)
    return results.Table(held_against(verdict, model, measured, library or LIBRARY))


def prepared_case(
    cell, basis, tests, settings=None, *, split_rest_second=MODELS.split_rest_second, **changes
):
    """The records and the plain model of one cell, as a search for missing effects takes them.

    Parameters
    ----------
    cell, basis, tests, settings, split_rest_second : as of `missing_effect`; tests of other kinds
        than those searched are left out.

    Returns
    -------
    case : `effects.case.Case`.

    Raises
    ------
    Refusal
        No OCV, nothing to fit, or nothing that judges.
    """
    from cellwright.api import given
    from cellwright.effects import prepare
    from cellwright.effects.finding import settings_of

    plain = _search(settings, split_rest_second, changes)
    gates, tolerance = settings_of(plain)
    options = {"tolerance": tolerance, "gates": gates, "settings": plain}
    known = [(given.test_facts(facts), series) for facts, series in tests]
    mine = given.tests([one for one in known if one[0].kind in prepare.KINDS])
    facts = given.cell_facts(cell)
    return prepare.prepared(facts, given.content(basis), mine, **options).case


def _search(settings, split_rest_second, changes) -> dict:
    from cellwright.api import given

    chosen = given.chosen(MissingEffect, settings, changes)
    return chosen._asdict() | {"split_rest_second": split_rest_second}


def _reference(one):
    """A healthy cell of the type, as the search takes it."""
    from cellwright.api import given
    from cellwright.effects.finding import Reference

    cell, basis, tests = one
    return Reference(given.cell_facts(cell), given.content(basis), given.tests(tests))


def missing_group_effect(group, branches, known, tests, settings=None, **changes):
    """Search a parallel group for what one of its branches has of its own.

    Parameters
    ----------
    group : its name. branches : rows of groups.tsv in order of position.
    known : `effects.groups.finding.KnownCell` of each branch.
    tests : (test, clean series with branch currents) each.
    settings : `settings.MissingEffectGroup`, or its keys as keywords.

    Returns
    -------
    found : MissingEffect, with empty residual_map, evidence, confounding and menu.

    Raises
    ------
    Refusal
        A branch without a model, nothing to fit, or nothing that judges.

    Source: docs/missing-effect.md.
    """
    from cellwright.api import given, results
    from cellwright.effects.groups.finding import missing_group_effect as searched

    chosen = given.chosen(MissingEffectGroup, settings, changes)
    plain = {
        name: value._asdict() if hasattr(value, "_asdict") else value
        for name, value in chosen._asdict().items()
    }
    rows = [given.branch_facts(branch) for branch in branches]
    found = searched(group, rows, known, given.tests(tests), settings=plain)
    empty = {key: {} for key in ("residual_map", "evidence", "confounding", "menu")}
    return results.MissingEffect(**empty, **found._asdict())


def identify_branches(series, steps, cells, test):
    """Models of all cells of a group from the longest charge in its own record.

    Parameters
    ----------
    series : clean series with branch_<k>_current_ampere [A], (n,) columns; steps : its steps.
    cells : names of the cells, in the order of the branches.
    test : TestFacts or mapping.

    Returns
    -------
    models : Document; content: "models", cell → model.

    Raises
    ------
    Refusal
        No branch currents, or no charge between two rests.

    Source: docs/packs.md.
    """
    from cellwright.api import given, results
    from cellwright.circuits.model_file import parameter_rows
    from cellwright.packs.group import group_models
    from cellwright.records.facts import MeasuredTest

    measured = MeasuredTest(given.test_facts(test), given.columns(series, *given.NAMES))
    models = group_models(measured, given.steps(steps)._asdict(), cells)
    rows = [{"cell": cell} | row for cell, one in models.items() for row in parameter_rows(one)]
    return results.Document({"models": models}, (), rows)


def simulate_group(
    models, current, *, initial_soc, wire_resistance_ohm=0.0, temperature_celsius=25.0
):
    """Branch currents and voltage of cells in parallel under a total current.

    Parameters
    ----------
    models : of the cells, in the order of the branches.
    current : DataFrame or columns: test_time_second [s], current_ampere [A], of the group.
    initial_soc, wire_resistance_ohm : scalar or one a branch [1], [ohm].
    temperature_celsius : of all cells [°C].

    Returns
    -------
    simulation : Simulation; (n,) columns: voltage_volt [V], branch_<k>_current_ampere [A],
        branch_<k>_soc [1].

    Raises
    ------
    Refusal
        No model, or one that no member of RC pairs stands for.

    Source: docs/packs.md.
    """
    import numpy as np

    from cellwright.api import given, results
    from cellwright.packs.parallel import group_of, simulate_parallel

    documents = [given.content(model) for model in models]
    group = group_of(documents, temperature_celsius=temperature_celsius)
    time, total = given.quantities(current, ("test_time_second", "current_ampere"))
    start, wire = (
        np.broadcast_to(np.asarray(value, float), len(documents))
        for value in (initial_soc, wire_resistance_ohm)
    )
    run = simulate_parallel(time, total, group, initial_soc=start, wire_resistance_ohm=wire)
    columns = {"test_time_second": time, "current_ampere": total, "voltage_volt": run.voltage_volt}
    for k in range(len(documents)):
        columns[f"branch_{k + 1}_current_ampere"] = run.branch_current_ampere[:, k]
        columns[f"branch_{k + 1}_soc"] = run.soc[:, k]
    return results.Simulation(columns, "the members of RC pairs")


def validate_group(models, branches, series, test):
    """A parallel group simulated through its record, its branch currents scored.

    Parameters
    ----------
    models : of the cells, in the order of the branches. branches : rows of groups.tsv.
    series : clean series with branch_<k>_current_ampere [A], (n,) columns.
    test : TestFacts or mapping.

    Returns
    -------
    validation : Scored; one row a branch: errors of current [A] and voltage [V].

    Raises
    ------
    Refusal
        Other branch currents than branches, or no SoC at the start.

    Source: docs/packs.md.
    """
    from cellwright.api import given, results
    from cellwright.packs.group import validate_group as validated
    from cellwright.records.facts import MeasuredTest

    measured = MeasuredTest(given.test_facts(test), given.columns(series, *given.NAMES))
    rows = [given.branch_facts(branch) for branch in branches]
    found = validated([given.content(model) for model in models], rows, measured)
    return results.Scored(found.rows, found.series, tuple(found.notes))
