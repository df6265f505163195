"""Equivalent circuits: identification, simulation, validation, state of charge, other tools."""

from cellwright.api import inputs, results
from cellwright.settings import Models, Soc

MODELS = Models()


def identify(
    cell, basis, tests, *, members=MODELS.members, split_rest_second=MODELS.split_rest_second
):
    """Equivalent circuits of a cell from its own tests, at every temperature it was tested at.

    tests : of roles fit or split.
    members : of the family that are identified, such as "2RC" or "DRT+H".

    Returns content: schema cellwright-model/2; parameters: one row each. Raises Refusal: no OCV, or
    no test that can be fitted; the reasons are named. Source: docs/models.md,
    docs/identification.md.
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

    whole : the model of all temperatures.
    celsius : temperature that is left out [°C].

    Returns as `identify`. Raises Refusal: no test is left, or none that can be fitted.
    Source: docs/temperature.md.
    """
    from cellwright.identification.cell import cell_model
    from cellwright.identification.compensation import without

    # Its OCV at that temperature goes too: it would tell what is to be predicted.
    rest = without(inputs.basis(basis), inputs.tests(tests), celsius=celsius)
    # Other members would cost as much time and are not used.
    content = inputs.model(whole)
    members = [content["chosen"]]
    facts = inputs.cell_facts(cell)
    found = _model(cell_model(facts, *rest, members=members, split_rest_second=split_rest_second))
    # Told apart from the notes of the model of all temperatures, where numbers differ.
    of_all, without_it = set(content["notes"]), f"fitted without the tests at {celsius:g} °C"
    notes = (note if note in of_all else f"{without_it}: {note}" for note in found.notes)
    return found._replace(notes=tuple(notes))


def compare_temperature_laws(
    cell, whole, reduced, tests, *, split_rest_second=MODELS.split_rest_second
):
    """Errors [V] of each law over temperature at temperatures left out of the fit, the best chosen.

    whole : the model of all temperatures. reduced : temperature [°C] → model without it.

    Returns rows, one a test and law: errors [V], chosen. Raises Refusal: nothing was predicted.
    Source: docs/temperature.md.
    """
    from cellwright.identification.compensation import choose_laws, laws_beyond, predicted

    whole = inputs.model(whole)
    models = {celsius: inputs.model(model) for celsius, model in reduced.items()}
    measured = (inputs.cell_facts(cell), inputs.tests(tests))
    rows, notes = predicted(whole, models, *measured, split_rest_second=split_rest_second)
    # Beyond the tests a law by which resistance rises with temperature again is not offered.
    offered, refused = laws_beyond(whole)
    laws, words = choose_laws(rows, beyond=offered)
    marked = [row | {"chosen": row["law"] == laws[row["beyond"]]} for row in rows]
    notes = (words, *filter(None, [refused]), *notes)
    return results.Result({"rows": marked}, notes=notes)


def predict_left_out(
    cell, whole, reduced, laws, tests, *, split_rest_second=MODELS.split_rest_second
):
    """Errors [V] on validation tests at temperatures that the predicting model was not fitted to.

    whole, reduced : as of `compare_temperature_laws`. laws : its result, which law is kept.
    tests : for validation.

    Returns rows, one a test: errors [V]. Source: docs/temperature.md.
    """
    from cellwright.identification.compensation import laws_kept, predicted

    rows, notes = predicted(
        inputs.model(whole),
        {celsius: inputs.model(model) for celsius, model in reduced.items()},
        inputs.cell_facts(cell),
        inputs.tests(tests),
        laws=laws_kept(inputs.rows(laws)),
        # Validation tests, which took part neither in the fits nor in the choice of the law.
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
    left_out=(),
    laws=(),
    effects=None,
    split_rest_second=MODELS.split_rest_second,
):
    """A model ready for use: its law over temperature, the effects found, its member chosen.

    model : result of `identify`, of `borrow_model` or of `identify_branches`, or path of its file.
    basis, tests : only for a model of the cell's own tests.
    left_out : whole tests for validation; a member with effects is chosen only if it wins there.
    The chosen member learns the noise of the filters from `tests` (docs/soc-filters.md).
    laws : results of `compare_temperature_laws`.
    effects : `model` of the result of `missing_effect`, or None.

    Returns content: schema cellwright-model/2; parameters, choice. Raises Refusal: a group's
    document that has no model of the cell. Source: docs/models.md.
    """
    from cellwright.effects.member import finished
    from cellwright.filters.learnt import with_learnt_noise
    from cellwright.identification.compensation import laws_kept, with_laws
    from cellwright.identification.in_use import fitted_records, proved

    facts = inputs.cell_facts(cell)
    content = inputs.model(model, cell=facts.cell)
    # The law first: whether an effect helps is judged with the temperatures as they will be used.
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
    proof = inputs.tests(left_out), facts
    rest = {"split_rest_second": split_rest_second}
    content, choice = proved(content, choice, *proof, **rest)
    if content.get("left_out"):
        measured = inputs.basis(basis), facts, inputs.tests(tests)
        fitted = fitted_records(content, *measured, **rest)
        records = [[one.record for one in condition] for condition in fitted]
        content = with_learnt_noise(content, records)
    return _with_choice(content, choice)


def _with_choice(content, choice):
    """Result of a model whose member was chosen: rows of the choice, none where there was none."""
    from cellwright.circuits.parameters import parameter_rows

    tables = {"parameters": parameter_rows(content), "choice": choice}
    return results.Result(tables, content, (content["choice"],) if choice else ())


def refuse_model(tests, *, fit_kinds=("hppc", "drive", "capacity"), lent_curve=False):
    """Raise a Refusal that says what is missing for a model of a cell without a test to fit.

    tests : TestFacts or mappings. fit_kinds : kinds that models are fitted to.
    lent_curve : an OCV is lent.
    """
    from cellwright.identification import lacking

    raise lacking.no_model([*map(inputs.test_facts, tests)], fit_kinds=fit_kinds, lent=lent_curve)


def model_of_table(
    cell, table, *, capacity_ampere_hour, ambient_temperature_celsius=None, source="table"
):
    """Model of a cell that is known as a table of OCV [V] and resistance [ohm] over SoC.

    cell : its name. table : DataFrame or columns: soc (0 to 1), ocv_volt, resistance_ohm.
    capacity_ampere_hour : charge from SoC 0 to 1 [Ah].
    ambient_temperature_celsius : at which the table holds [°C]; None: 25.
    source : name of the table, for the notes.

    Returns as `identify`. Raises Refusal: a table that does not go from empty to full, an OCV that
    falls, no capacity. Source: docs/packs.md.
    """
    from cellwright.identification import given

    columns = inputs.quantities(table, ("soc", "ocv_volt", "resistance_ohm"))
    settings = {"capacity_ampere_hour": capacity_ampere_hour, "source": source}
    settings["ambient_temperature_celsius"] = ambient_temperature_celsius
    return _model(given.model_of_table(cell, *columns, **settings))


def borrow_model(cell, peers):
    """Model of a cell without pulses, borrowed from the reference cell of its type.

    cell : `bias.features.Shown`, what its tests show. peers : the same of modelled cells.

    Returns as `identify`. Raises Refusal: no peer has a model, or the cell shows too little.
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

    cells : `bias.ways.Scored` of one type, each with its own model and tests not fitted to.

    Returns rows, one a cell, way and test: rmse_volt, mean_abs_volt, max_abs_volt,
    half_interval_volt [V], share_within, relative errors of resistances [1]. Raises Refusal: fewer
    than two cells, or no test could be compared. Source: thesis 4.5; docs/bias.md.
    """
    from cellwright.bias.ways import compare_ways

    rows, notes = compare_ways(_scored(cells), split_rest_second=split_rest_second)
    return results.Result({"rows": rows}, notes=tuple(notes))


def worst_corrected(rows):
    """The cell of which the corrected model errs most beyond what the cell's own model does.

    rows : result of `compare_bias_ways`, or its rows.

    Returns dict: cell, rmse_volt and own_rmse_volt over all its tests [V], words.
    Raises Refusal: no corrected model was scored. Source: docs/bias.md.
    """
    from cellwright.bias.worst import worst_cell

    return worst_cell(inputs.rows(rows))


def corrected_voltages(cells, name, tests, *, split_rest_second=MODELS.split_rest_second):
    """Voltage of a cell's corrected model on its tests, the cell left out of the calibration.

    cells : as of `compare_bias_ways`. name : of the cell among them. tests : of that cell.

    Returns dict test → (time [s], voltage [V]), (n,) each, as `missing_effect` takes them. Raises
    Refusal: the cell is not among them, or a test cannot be laid out. Source: docs/bias.md.
    """
    from cellwright.bias.worst import corrected_voltages as simulated

    measured = inputs.tests(tests)
    return simulated(_scored(cells), name, measured, split_rest_second=split_rest_second)


def simulate(model, current, *, initial_soc, temperature_celsius=25.0, member=None):
    """Terminal voltage of a model under a current.

    current : DataFrame or columns: test_time_second [s], current_ampere [A], positive on charge.
    initial_soc : state of charge at the first sample [1].
    temperature_celsius : of the cell, scalar or (n,) [°C].
    member : of the family; None: the chosen one.

    Returns columns, (n,): soc [1], ocv_volt, voltage_volt [V]. Raises Refusal: the model has no
    such member, or the SoC at the start is not within 0 to 1. Source: docs/circuits.md.
    """
    import numpy as np

    from cellwright.circuits.model_file import member_of, simulate_model
    from cellwright.refusal import Refusal
    from cellwright.series.cleaning import net_charge

    model = inputs.model(model)
    # Only the start: a current that goes beyond empty or full is the simulation's to show.
    if not 0.0 <= initial_soc <= 1.0:
        raise Refusal(f"SoC {initial_soc:g} at the start; wanted 0 to 1")
    time, ampere = inputs.quantities(current, ("test_time_second", "current_ampere"))
    # From the current that is simulated, not from a counter that an instrument has logged.
    charge = net_charge(time, ampere)
    soc = initial_soc + (charge - charge[0]) / model["capacity_ampere_hour"]
    celsius = np.broadcast_to(np.asarray(temperature_celsius, float), time.shape)
    run = simulate_model(model, member, time, ampere, soc, celsius)
    columns = {"test_time_second": time, "current_ampere": ampere, "soc": soc}
    columns |= {"ocv_volt": run.ocv_volt, "voltage_volt": run.voltage_volt}
    return results.Result({"columns": columns}, {"member": member_of(model, member)["model"]})


def held_out(model, series, test, cell, *, split_rest_second=MODELS.split_rest_second):
    """A test that took no part in a model's fit, laid out to be predicted by it.

    Returns (model at the age of the test, `Record` on its SoC scale): what `validate` and
    `estimate_soc` take. Raises Refusal: no SoC at the start can be known. Source: docs/models.md.
    """
    from cellwright.records.basis import at_cycle
    from cellwright.records.record import laid_out

    measured = inputs.measured(test, series, inputs.COUNTED)
    model, facts = at_cycle(inputs.model(model), measured.facts.cycle), inputs.cell_facts(cell)
    how = {"split_rest_second": split_rest_second, "proof": True}
    return model, laid_out(measured, model, facts, **how)


def validate(model, record, *, repeats=None):
    """Errors [V] of every member of a model, simulated through a test it was not fitted to.

    model, record : of `held_out`.
    repeats : rows that were fitted in another test, or score there, do not score here; None: all
        do.

    Returns rows, one a member: rmse_volt, max_abs_volt [V] and others; series. Raises Refusal:
    nothing is left to score. Source: docs/models.md.
    """
    from cellwright.identification.validation import validate as validated
    from cellwright.records.repeats import rows_repeated

    found = inputs.repeats(repeats)
    if found is not None:
        elsewhere = rows_repeated(found, record.test, len(record.used))
        record = record._replace(used=record.used & ~elsewhere)
    rows, series, notes = validated(inputs.model(model), record)
    return results.Result({"rows": rows, "series": series}, notes=notes)


def estimate_soc(model, record, settings=None, **changes):
    """State of charge [1] over a test by every filter, from wrong starts, with its error.

    model, record : of `held_out`.
    settings : `settings.Soc`, its keys such as filters and initial_soc_error.

    Returns rows, one a filter, start and scenario: rmse_soc, max_abs_soc [1], convergence_second
    [s]; series: (n,) estimates of the first start. Raises Refusal: nothing is left to score, or an
    unknown filter. Source: thesis 2.4; docs/soc-filters.md.
    """
    from cellwright.filters.evaluate import soc_runs

    settings = inputs.settings_of(Soc, settings, changes)
    rows, columns, notes = soc_runs(inputs.model(model), record, settings=settings)
    return results.Result({"rows": rows, "series": columns}, notes=tuple(notes))


def export_model(model, *, validation=()):
    """A model for other tools: as PyBaMM's Thevenin model, and as tables over SoC and temperature.

    validation : rows of `validate` of the cell's tests: errors of the member that is exported
        stand beside those of the chosen one, where it is another.

    Returns content: pybamm; lookup, temperature; notes say which member stands for the chosen one,
    and both errors. Source: docs/exports.md.
    """
    from cellwright.circuits.exports import lookup_table, pybamm_document, validation_errors
    from cellwright.circuits.instrument import words_of
    from cellwright.circuits.model_file import plain_member
    from cellwright.identification.compensation import temperature_table

    model, errors = inputs.model(model), validation_errors(inputs.rows(validation))
    document, member = pybamm_document(model, errors), plain_member(model)
    notes = [f"{name} is not exported: {why}" for name, why in document["refused"].items()]
    for entry in model["members"]:
        notes += [f"{entry['model']}, not exported: {words}" for words in words_of(entry)]
    # Other tools know RC pairs only: what stands in for the chosen member must say what it costs.
    chosen, taken = model["chosen"], document["exported"]
    if taken not in (chosen, None):
        why = f"{chosen} is refused ({_both_errors(errors, taken, chosen)})"
        notes.append(f"PyBaMM's loader takes {taken}: {why}")
    if member != chosen:
        why = f"{chosen} is more than RC pairs ({_both_errors(errors, member, chosen)})"
        notes.append(f"the look-up table holds {member}: {why}")
    tables = {"lookup": lookup_table(model, member, errors)}
    tables["temperature"] = temperature_table(model, None)
    return results.Result(tables, {"pybamm": document}, tuple(notes))


def _both_errors(errors, taken, chosen):
    """Validation errors [V] of two members, in words."""
    if taken not in errors or chosen not in errors:
        return "no validation test tells the errors of both"
    both = f"{taken} {1e3 * errors[taken]:.3g} mV, {chosen} {1e3 * errors[chosen]:.3g} mV"
    return f"validation error: {both}"
