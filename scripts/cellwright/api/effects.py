"""Missing effects of a cell or of a branch of a parallel group; models of parallel groups."""

from cellwright.api import inputs, results
from cellwright.settings import MissingEffect, MissingEffectGroup, Models

MODELS = Models()


def missing_effect(
    cell,
    basis,
    tests,
    settings=None,
    *,
    references=(),
    model=None,
    simulated=None,
    library=None,
    split_rest_second=MODELS.split_rest_second,
    **changes,
):
    """Effects that a model of a cell lacks, proved on tests that were not fitted.

    Of the plain circuit; of a model of the cell (`model`); or of any other (`simulated`).

    Parameters
    ----------
    cell, basis, tests : as of `identify`, with tests of roles fit, split and validation.
    settings : `settings.MissingEffect`, or its keys as keywords.
    references : (cell, basis, tests) of healthy cells of the type; from three on, the cell is
        compared with them.
    model : result of `finish_model`, or path of its file: what does its chosen member still lack?
    simulated : dict test → (time (n,) [s], voltage (n,) [V]) by any simulator, on the test's own
        clock, or the result of `read_simulated`: what does that one lack? Tests without a simulated
        voltage take no part; one whose simulation does not fit is left out with a note.
    library : effects by id that are tried, None: all of `effects.library.LIBRARY`.
    split_rest_second : shortest rest that cuts a test of role split into blocks [s].

    Returns
    -------
    finding : MissingEffect; its verdict is the document of docs/missing-effect.md.

    Raises
    ------
    Refusal : no OCV, no test to fit, or none for validation.

    Source: docs/missing-effect.md.
    """
    from cellwright.effects.finding import missing_effect as searched
    from cellwright.effects.library import LIBRARY

    finding = searched(
        inputs.cell_facts(cell),
        inputs.basis(basis),
        inputs.tests(tests),
        LIBRARY if library is None else library,
        settings=_search(settings, split_rest_second, changes),
        references=[_reference(reference) for reference in references],
        model=None if model is None else inputs.model(model),
        simulated=None if simulated is None else _simulated(simulated),
    )
    return results.MissingEffect(*finding)


def add_own_effects(model, effects, *, choice=()):
    """A model with the effects that its chosen member lacks; they are used where that is better.

    Parameters
    ----------
    model : result of `finish_model`.
    effects : `model` of the result of `missing_effect(..., model=model)`, or None.
    choice : rows of the choice of the member, where `model` is a document without them.

    Returns
    -------
    model : FinishedModel, with the member `<chosen>+effects` where effects were found.

    Source: docs/models.md.
    """
    from cellwright.circuits.parameters import parameter_rows
    from cellwright.effects.given.member import with_own_effects

    rows = inputs.rows(choice or getattr(model, "choice", ()))
    content, rows = with_own_effects(inputs.model(model), rows, inputs.content(effects))
    notes = (content["choice"],) if rows else ()
    return results.FinishedModel(content, parameter_rows(content), rows, notes)


def missing_effect_stability(
    cell,
    basis,
    tests,
    settings=None,
    *,
    references=(),
    model=None,
    library=None,
    split_rest_second=MODELS.split_rest_second,
    **changes,
):
    """How often each name of a verdict stays when one record is left out of the search.

    Parameters
    ----------
    cell, basis, tests, settings, references, model, library, split_rest_second, changes : as of
        `missing_effect`.

    Returns
    -------
    stability : Stability; one row a name; `repeats`: one row a search.

    Raises
    ------
    Refusal : as `missing_effect`, with all records.

    Source: docs/missing-effect.md.
    """
    from cellwright.effects.library import LIBRARY
    from cellwright.effects.story.stability import repeat_rows, stability

    found = stability(
        inputs.cell_facts(cell),
        inputs.basis(basis),
        inputs.tests(tests),
        LIBRARY if library is None else library,
        settings=_search(settings, split_rest_second, changes),
        references=[_reference(reference) for reference in references],
        model=None if model is None else inputs.model(model),
    )
    return results.Stability(found.rows, repeat_rows(found.repeats))


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
    from cellwright.effects.library import LIBRARY
    from cellwright.effects.witnesses.collected import measured_of
    from cellwright.effects.witnesses.collected import witnesses as held_against

    content, known = inputs.basis(basis), dict(tables)
    verdict, model = inputs.content(verdict), inputs.content(model)
    series = inputs.columns(known.pop("series", {}))
    rows = {name: inputs.rows(table) for name, table in known.items()}
    ambient = ambient_celsius or {}
    measured = measured_of(rows | {"series": series}, content, model, ambient=ambient)
    return results.Table(held_against(verdict, model, measured, library or LIBRARY))


def prepared_case(
    cell, basis, tests, settings=None, *, split_rest_second=MODELS.split_rest_second, **changes
):
    """The records and the plain model of a cell, as the search for missing effects takes them.

    Parameters
    ----------
    cell, basis, tests, settings, split_rest_second : as of `missing_effect`; tests of other kinds
        than those searched are skipped.

    Returns
    -------
    case : `effects.case.Case`.

    Raises
    ------
    Refusal : no OCV, no test to fit, or none for validation.
    """
    from cellwright.effects.finding import settings_of
    from cellwright.effects.preparing import KINDS, SLOW_TEST, prepared

    plain = _search(settings, split_rest_second, changes)
    gates, tolerance = settings_of(plain)
    options = {"tolerance": tolerance, "gates": gates, "settings": plain}
    known = [(inputs.test_facts(facts), series) for facts, series in tests]
    mine = inputs.tests([one for one in known if one[0].kind in (SLOW_TEST, *KINDS)])
    facts = inputs.cell_facts(cell)
    return prepared(facts, inputs.basis(basis), mine, **options).case


def _simulated(simulated) -> dict:
    """Simulated voltages by test, from pairs or triples (time, voltage, name of the file)."""
    from cellwright.effects.given.external import Simulated

    return {test: Simulated(*curve) for test, curve in simulated.items()}


def _search(settings, split_rest_second, changes) -> dict:

    search = inputs.settings_of(MissingEffect, settings, changes)
    return search._asdict() | {"split_rest_second": split_rest_second}


def _reference(reference):
    """A healthy cell of the type, as the search takes it."""
    from cellwright.effects.finding import Reference

    cell, basis, tests = reference
    return Reference(inputs.cell_facts(cell), inputs.basis(basis), inputs.tests(tests))


def missing_group_effect(group, branches, known_cells, tests, settings=None, **changes):
    """Effects that one branch of a parallel group has and the others have not.

    Parameters
    ----------
    group : its name. branches : rows of groups.tsv in order of position.
    known_cells : `effects.groups.finding.KnownCell` of each branch.
    tests : (test, clean series with branch currents) each.
    settings : `settings.MissingEffectGroup`, or its keys as keywords.

    Returns
    -------
    finding : MissingEffect, with empty residual_map, evidence, confounding and menu.

    Raises
    ------
    Refusal : a branch without a model, no test to fit, or none for validation.

    Source: docs/missing-effect.md.
    """
    from cellwright.effects.groups.finding import missing_group_effect as searched

    search = inputs.settings_of(MissingEffectGroup, settings, changes)
    plain = {
        name: value._asdict() if hasattr(value, "_asdict") else value
        for name, value in search._asdict().items()
    }
    rows = [inputs.branch_facts(branch) for branch in branches]
    known = [one._replace(model=inputs.content(one.model)) for one in known_cells]
    return results.MissingEffect(*searched(group, rows, known, inputs.tests(tests), settings=plain))


def identify_branches(series, steps, cells, test):
    """Models of all cells of a group, from the longest charge in the group's record.

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
    Refusal : No branch currents, or no charge between two rests.

    Source: docs/packs.md.
    """
    from cellwright.circuits.parameters import parameter_rows
    from cellwright.packs.identify import group_models
    from cellwright.records.facts import MeasuredTest

    measured = MeasuredTest(inputs.test_facts(test), inputs.columns(series, *inputs.NAMES))
    models = group_models(measured, inputs.steps(steps)._asdict(), cells)
    rows = [{"cell": cell} | row for cell, model in models.items() for row in parameter_rows(model)]
    return results.Document({"models": models}, (), rows)


def simulate_group(
    models, current, *, initial_soc, wire_resistance_ohm=0.0, temperature_celsius=25.0
):
    """Branch currents [A], SoC [1] and voltage [V] of cells in parallel under a total current.

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
    Refusal : no model, or as `packs.simulate.simulate_pack`.

    Source: docs/packs.md.
    """
    import numpy as np

    from cellwright.packs.cells import pack_cells
    from cellwright.packs.simulate import simulate_pack
    from cellwright.packs.wiring import Wiring

    documents = inputs.models(models)
    cells = pack_cells(documents, temperature_celsius=temperature_celsius)
    time, total = inputs.quantities(current, ("test_time_second", "current_ampere"))
    wire = np.broadcast_to(np.asarray(wire_resistance_ohm, float), len(documents))
    branches = tuple(f"branch {k + 1}" for k in range(len(documents)))
    wiring = Wiring("the group", "parallel", branches, tuple(wire), (0.0,) * len(documents))
    run = simulate_pack(time, total, cells, wiring, initial_soc=initial_soc)
    columns = {"test_time_second": time, "current_ampere": total, "voltage_volt": run.voltage_volt}
    for k in range(len(documents)):
        columns[f"branch_{k + 1}_current_ampere"] = run.cell_current_ampere[:, k]
        columns[f"branch_{k + 1}_soc"] = run.soc[:, k]
    return results.Simulation(columns, ", ".join(dict.fromkeys(cells.members)))


def check_group(branches, series, test, simulated=None):
    """Checks of a group's record: do its channels agree, and are they where the sheet says.

    Parameters
    ----------
    branches : rows of groups.tsv, of the group and of all groups in it.
    series : clean series of the group, (n,) columns, with whichever of branch_<k>_current_ampere
        [A] and cell_<k>_voltage_volt [V] were logged. test : TestFacts or mapping.
    simulated : the series of `validate_group`, whose simulated channels tell swapped ones.

    Returns
    -------
    checks : Table; a row a check, notes what was found.

    Raises
    ------
    Refusal : channels beyond the wiring, or a wiring that is none.

    Source: docs/packs.md.
    """
    from cellwright.packs.checks import channel_findings, swapped_channels
    from cellwright.packs.wiring import cells_of, wiring_of
    from cellwright.records.facts import MeasuredTest
    from cellwright.records.record import group_record

    rows = inputs.rows(branches)
    group = rows[0].get("group", "the group")
    wiring = wiring_of(group, rows)
    own = sorted((r for r in rows if r.get("group", group) == group), key=lambda r: r["position"])
    measured = MeasuredTest(inputs.test_facts(test), inputs.columns(series, *inputs.NAMES))
    facts = [inputs.branch_facts(row) for row in own]
    record = group_record(measured, facts, cells=len(cells_of(wiring)))
    findings = channel_findings(record, wiring)
    if simulated is not None:
        findings += swapped_channels(inputs.columns(simulated), wiring, record.test)
    notes = tuple(found.sentence for found in findings if found.found)
    return results.Table([found._asdict() for found in findings], notes)
