"""A cell's model for other tools, with the errors of the member that stands for the best one."""

from cellwright.circuits import inputs as given
from cellwright.circuits.exports import lookup_table, pybamm_document, validation_errors
from cellwright.circuits.instrument import words_of
from cellwright.circuits.model_file import in_use, plain_member
from cellwright.circuits.particle import NAME as PARTICLE
from cellwright.identification.compensation import temperature_table
from cellwright.identification.messages import say
from cellwright.messages import said_of
from cellwright.records import inputs
from cellwright.result import Result


def export_model(model, *, validation=()):
    """A model for other tools: for PyBaMM, and as tables over SoC and temperature.

    validation : rows of `validate` of the cell's tests: errors of the member that is exported
        stand beside those of what predicts best, where it is another.

    Returns content: pybamm; lookup, temperature; notes say which member stands for what predicts
    best, and both errors. Source: docs/exports.md.
    """
    model, errors = given.model(model), validation_errors(inputs.rows(validation))
    document, member = pybamm_document(model, errors), plain_member(model)
    notes = [said_of(f"{name} is not exported", why) for name, why in document["refused"].items()]
    for entry in model["members"]:
        with_blocks = entry.get("companions", {"with": entry})["with"]
        notes += [f"{entry['model']}, not exported: {words}" for words in words_of(with_blocks)]
    # Other tools know RC pairs only: what stands in for the best must say what it costs.
    chosen, taken = in_use(model), document["exported"]
    if chosen == PARTICLE:
        notes.append(say("exports.particle", name=chosen))
        costs = _both_errors(errors, model["chosen"], chosen)
        fields = {"chosen": model["chosen"], "name": chosen, "costs": costs}
        notes.append(say("exports.over_temperature", **fields))
    if taken not in (chosen, None):
        why = f"{chosen} is refused ({_both_errors(errors, taken, chosen)})"
        notes.append(f"PyBaMM's loader takes {taken}: {why}")
    if member != chosen:
        why = f"{chosen} is more than RC pairs ({_both_errors(errors, member, chosen)})"
        notes.append(f"the look-up table holds {member}: {why}")
    tables = {"lookup": lookup_table(model, member, errors)}
    tables["temperature"] = temperature_table(model, None)
    return Result(tables, {"pybamm": document}, tuple(notes))


def _both_errors(errors, taken, chosen):
    """Validation errors [V] of two members, in words."""
    if taken not in errors or chosen not in errors:
        return "no validation test tells the errors of both"
    both = f"{taken} {1e3 * errors[taken]:.3g} mV, {chosen} {1e3 * errors[chosen]:.3g} mV"
    return f"validation error: {both}"
