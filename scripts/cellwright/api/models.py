"""Equivalent circuits and state of charge: basis, identification, simulation, validation."""

from cellwright.api import inputs, results
from cellwright.settings import Models, Soc

MODELS = Models()


def identify(
    cell, basis, tests, *, members=MODELS.members, split_rest_second=MODELS.split_rest_second
):
    """Equivalent circuits of a cell from its own tests, at every temperature it was tested at.

    Parameters
    ----------
    cell : CellFacts or mapping.
    basis : result of `basis`.
    tests : (test, clean series) each, roles fit or split.
    members : of the family that are identified, such as "2RC" or "DRT+H".
    split_rest_second : shortest rest that cuts a test of role split into blocks [s].

    Returns
    -------
    model : Result; content: schema cellwright-model/2; its table: one row a parameter.

    Raises
    ------
    Refusal : No OCV, or no test that can be fitted; the reasons are named.

    Source: docs/models.md, docs/identification.md.
    """
    from cellwright.identification.cell import cell_model

    measured = (inputs.cell_facts(cell), inputs.basis(basis), inputs.tests(tests))
    return _model(cell_model(*measured, members=members, split_rest_second=split_rest_second))


def _model(content):
    from cellwright.circuits.parameters import parameter_rows

    return results.Result({"parameters": parameter_rows(content)}, content, tuple(content["notes"]))


def identify_without(
    cell, whole, basis, tests, *, celsius, split_rest_second=MODELS.split_rest_second
):
    """The chosen member of a model, identified without the tests of one temperature.

    Parameters
    ----------
    cell, basis, tests : as of `identify`.
    whole : the model of all temperatures.
    celsius : temperature that is left out [°C].
    split_rest_second : shortest rest that cuts a test of role split into blocks [s].

    Returns
    -------
    model : Result, as of `identify`.

    Raises
    ------
    Refusal : No test is left, or none that can be fitted.

    Source: docs/compensation.md.
    """
    from cellwright.identification.cell import cell_model
    from cellwright.identification.compensation import without

    rest = without(inputs.basis(basis), inputs.tests(tests), celsius=celsius)
    members = [inputs.model(whole)["chosen"]]
    facts = inputs.cell_facts(cell)
    return _model(cell_model(facts, *rest, members=members, split_rest_second=split_rest_second))


def compare_temperature_laws(
    cell, whole, reduced, tests, *, split_rest_second=MODELS.split_rest_second
):
    """Errors [V] of each law over temperature at temperatures left out of the fit, the best chosen.

    Parameters
    ----------
    cell, tests : as of `identify`.
    whole : the model of all temperatures. reduced : temperature [°C] → model without it.
    split_rest_second : shortest rest that cuts a test of role split into blocks [s].

    Returns
    -------
    laws : Result; one row a test and law: errors [V], chosen.

    Raises
    ------
    Refusal : Nothing was predicted.

    Source: docs/compensation.md.
    """
    from cellwright.identification.compensation import choose_laws, laws_beyond, predicted

    whole = inputs.model(whole)
    models = {celsius: inputs.model(model) for celsius, model in reduced.items()}
    measured = (inputs.cell_facts(cell), inputs.tests(tests))
    rows, notes = predicted(whole, models, *measured, split_rest_second=split_rest_second)
    offered, refused = laws_beyond(whole)
    choice = choose_laws(rows, beyond=offered)
    marked = [row | {"chosen": row["law"] == choice.laws[row["beyond"]]} for row in rows]
    notes = (choice.words, *filter(None, [refused]), *notes)
    return results.Result({"rows": marked}, notes=notes)


def predict_left_out(
    cell, whole, reduced, laws, tests, *, split_rest_second=MODELS.split_rest_second
):
    """Errors [V] on validation tests at temperatures that the predicting model was not fitted to.

    Parameters
    ----------
    cell, whole, reduced, split_rest_second : as of `compare_temperature_laws`.
    laws : its result, which law is kept. tests : (test, clean series) each, for validation.

    Returns
    -------
    predictions : Result; one row a test: errors [V].
    """
    from cellwright.identification.compensation import laws_kept, predicted

    models = {celsius: inputs.model(model) for celsius, model in reduced.items()}
    rows, notes = predicted(
        inputs.model(whole),
        models,
        inputs.cell_facts(cell),
        inputs.tests(tests),
        laws=laws_kept(inputs.rows(laws)),
        proof=True,
        split_rest_second=split_rest_second,
    )
    return results.Result({"rows": rows}, notes=tuple(notes))


def finish_model(
    cell,
    model,
    basis=None,
    tests=(),
    *,
    laws=(),
    effects=None,
    split_rest_second=MODELS.split_rest_second,
):
    """A model ready for use: its law over temperature, the effects found, its member chosen.

    Parameters
    ----------
    cell, basis, tests : as of `identify`; basis and tests only for a model of the cell's own tests.
    model : result of `identify`, of `borrow_model` or of `identify_branches`, or path of its file.
    laws : results of `compare_temperature_laws`.
    effects : `model` of the result of `missing_effect`, or None.
    split_rest_second : shortest rest that cuts a test of role split into blocks [s].

    Returns
    -------
    model : Result; content: schema cellwright-model/2.

    Raises
    ------
    Refusal : A group's document that has no model of the cell.
    """
    from cellwright.circuits.parameters import parameter_rows
    from cellwright.effects.member import finished
    from cellwright.identification.compensation import laws_kept, with_laws

    facts = inputs.cell_facts(cell)
    content = inputs.model(model, cell=facts.cell)
    for law in laws:
        content = with_laws(content, laws_kept(inputs.rows(law)))
    content, choice = finished(
        content,
        None if basis is None else inputs.basis(basis),
        facts,
        inputs.tests(tests),
        inputs.content(effects),
        split_rest_second=split_rest_second,
    )
    notes = (content["choice"],) if choice else ()
    tables = {"parameters": parameter_rows(content), "choice": choice}
    return results.Result(tables, content, notes)


def refuse_model(tests, *, fit_kinds=("hppc", "drive", "capacity"), lent_curve=False):
    """Say what is missing for a model of a cell of which no test may be fitted.

    Parameters
    ----------
    tests : of the cell. fit_kinds : kinds that models are fitted to. lent_curve : an OCV is lent.

    Raises
    ------
    Refusal : Always, with what is missing.
    """
    from cellwright.identification import lacking

    raise lacking.no_model([*map(inputs.test_facts, tests)], fit_kinds=fit_kinds, lent=lent_curve)


def model_of_table(
    cell, table, *, capacity_ampere_hour, ambient_temperature_celsius=None, source="table"
):
    """Model of a cell that is known as a table of OCV [V] and resistance [ohm] over SoC.

    Parameters
    ----------
    cell : its name. table : DataFrame or columns: soc (0 to 1), ocv_volt, resistance_ohm.
    capacity_ampere_hour : charge from SoC 0 to 1 [Ah].
    ambient_temperature_celsius : at which the table holds [°C]; None: 25.
    source : name of the table, for the notes.

    Returns
    -------
    model : Result, as of `identify`.

    Raises
    ------
    Refusal : A table that does not go from empty to full, an OCV that falls, no capacity.

    Source: docs/packs.md.
    """
    from cellwright.identification import given

    columns = inputs.quantities(table, ("soc", "ocv_volt", "resistance_ohm"))
    settings = {"capacity_ampere_hour": capacity_ampere_hour, "source": source}
    settings["ambient_temperature_celsius"] = ambient_temperature_celsius
    return _model(given.model_of_table(cell, *columns, **settings))


def borrow_model(cell, peers):
    """Model of a cell without pulses, borrowed from the reference cell of its type.

    Parameters
    ----------
    cell : `bias.features.Shown`, what its tests show. peers : the same of modelled cells.

    Returns
    -------
    model : Result, as of `identify`.

    Raises
    ------
    Refusal : No peer has a model, or the cell shows too little.

    Source: thesis 4.5; docs/bias.md.
    """
    from cellwright.bias.corrected import borrowed_model

    return _model(borrowed_model(_shown(cell), [_shown(peer) for peer in peers]))


def _shown(cell):
    """`Shown` with its model read, where it has one."""
    return cell if cell.model is None else cell._replace(model=inputs.model(cell.model))


def _scored(cells):
    """`Scored` each with its models read."""
    return [c._replace(shown=_shown(c.shown), own=inputs.model(c.own)) for c in cells]


def compare_bias_ways(cells, *, split_rest_second=MODELS.split_rest_second):
    """Voltage errors [V] of cells by the reference's model, scaled, corrected, and their own.

    Parameters
    ----------
    cells : `bias.ways.Scored` of one type, each with its own model and tests not fitted to.
    split_rest_second : shortest rest that cuts a test of role split into blocks [s].

    Returns
    -------
    ways : Result; one row a cell, way and test: rmse_volt, mean_abs_volt, max_abs_volt,
        half_interval_volt [V], share_within, relative errors of resistances [1].

    Raises
    ------
    Refusal : Fewer than two cells, or no test could be compared.

    Source: thesis 4.5; docs/bias.md.
    """
    from cellwright.bias.ways import compare_ways

    rows, notes = compare_ways(_scored(cells), split_rest_second=split_rest_second)
    return results.Result({"rows": rows}, notes=tuple(notes))


def worst_corrected(rows):
    """The cell of which the corrected model errs most beyond what the cell's own model does.

    Parameters
    ----------
    rows : result of `compare_bias_ways`, or its rows.

    Returns
    -------
    worst : `bias.worst.Worst`: cell, rmse_volt and own_rmse_volt over all its tests [V], words.

    Raises
    ------
    Refusal : No corrected model was scored.
    """
    from cellwright.bias.worst import worst_cell

    return worst_cell(inputs.rows(rows))


def corrected_voltages(cells, name, tests, *, split_rest_second=MODELS.split_rest_second):
    """Voltage of a cell's corrected model on its tests, the cell left out of the calibration.

    Parameters
    ----------
    cells : as of `compare_bias_ways`. name : of the cell among them.
    tests : (test, clean series) each, of the cell.
    split_rest_second : shortest rest that cuts a test of role split into blocks [s].

    Returns
    -------
    voltages : dict test → (time [s], voltage [V]), (n,) each, as `missing_effect` takes them.

    Raises
    ------
    Refusal : The cell is not among them, or a test cannot be laid out.

    Source: docs/bias.md.
    """
    from cellwright.bias.worst import corrected_voltages as simulated

    measured = inputs.tests(tests)
    return simulated(_scored(cells), name, measured, split_rest_second=split_rest_second)


def simulate(model, current, *, initial_soc, temperature_celsius=25.0, member=None):
    """Terminal voltage of a model under a current.

    Parameters
    ----------
    model : result of `identify` or `finish_model`, or path of its results/models/<cell>.json.
    current : DataFrame or columns: test_time_second [s], current_ampere [A], positive on charge.
    initial_soc : state of charge at the first sample [1].
    temperature_celsius : of the cell, scalar or (n,) [°C].
    member : of the family; None: the chosen one.

    Returns
    -------
    simulation : Result; (n,) columns: soc [1], ocv_volt, voltage_volt [V].

    Raises
    ------
    Refusal : The model has no such member, or the SoC at the start is not within 0 to 1.

    Source: docs/circuits.md.
    """
    import numpy as np

    from cellwright.circuits.model_file import member_of, simulate_model
    from cellwright.refusal import Refusal
    from cellwright.series.cleaning import net_charge

    model = inputs.model(model)
    if not 0.0 <= initial_soc <= 1.0:
        raise Refusal(f"SoC {initial_soc:g} at the start; wanted 0 to 1")
    time, ampere = inputs.quantities(current, ("test_time_second", "current_ampere"))
    charge = net_charge(time, ampere)
    soc = initial_soc + (charge - charge[0]) / model["capacity_ampere_hour"]
    celsius = np.broadcast_to(np.asarray(temperature_celsius, float), time.shape)
    run = simulate_model(model, member, time, ampere, soc, celsius)
    columns = {"test_time_second": time, "current_ampere": ampere, "soc": soc}
    columns |= {"ocv_volt": run.ocv_volt, "voltage_volt": run.voltage_volt}
    return results.Result({"columns": columns}, {"member": member_of(model, member)["model"]})


def validate(
    model, series, test, cell, *, split_rest_second=MODELS.split_rest_second, repeats=None
):
    """Errors [V] of every member of a model, simulated through a test it was not fitted to.

    Parameters
    ----------
    model : result of `identify` or `finish_model`, or path of its results/models/<cell>.json.
    series : DataFrame or columns of a clean series, (n,) each.
    test, cell : TestFacts, CellFacts or mappings.
    split_rest_second : shortest rest that cuts a test of role split into blocks [s].
    repeats : result of `repeats` of the cell's tests: rows that were fitted in another test, or
        score there, do not score here; None: all do.

    Returns
    -------
    validation : Result; one row a member: rmse_volt, max_abs_volt [V] and others.

    Raises
    ------
    Refusal : No SoC at the start can be known, or nothing is left to score.

    Source: docs/models.md.
    """
    from cellwright.identification.validation import validate as validated
    from cellwright.records.basis import at_cycle
    from cellwright.records.repeats import with_repeated

    (measured,) = inputs.tests([(test, series)])
    found = inputs.repeats(repeats)
    measured = measured if found is None else with_repeated(measured, found)
    scores = validated(
        at_cycle(inputs.model(model), measured.facts.cycle),
        inputs.cell_facts(cell),
        measured,
        split_rest_second=split_rest_second,
    )
    tables = {"rows": scores.rows, "series": scores.series}
    return results.Result(tables, notes=tuple(scores.notes))


def estimate_soc(
    model,
    series,
    test,
    cell,
    settings=None,
    *,
    split_rest_second=MODELS.split_rest_second,
    **changes,
):
    """State of charge [1] over a test by every filter, from wrong starts, with its error.

    Parameters
    ----------
    model, series, test, cell, split_rest_second : as of `validate`.
    settings : `settings.Soc`, or its keys as keywords, such as filters and initial_soc_error.

    Returns
    -------
    estimates : Result; one row a filter, start and scenario: rmse_soc, max_abs_soc [1],
        convergence_second [s]; series: (n,) estimates of the first start.

    Raises
    ------
    Refusal : No SoC at the start can be known, nothing is left to score, or an unknown filter.

    Source: thesis 2.4; docs/soc-filters.md.
    """
    from cellwright.filters.evaluate import soc_runs
    from cellwright.records.basis import at_cycle

    (measured,) = inputs.tests([(test, series)])
    rows, series, notes = soc_runs(
        at_cycle(inputs.model(model), measured.facts.cycle),
        inputs.cell_facts(cell),
        measured,
        settings=inputs.settings_of(Soc, settings, changes),
        split_rest_second=split_rest_second,
    )
    return results.Result({"rows": rows, "series": series}, notes=notes)
