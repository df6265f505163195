"""Models for other tools: PyBaMM, look-up tables."""

from cellwright.api import inputs, results


def export_model(model, *, validation=()):
    """A model for other tools: as PyBaMM's Thevenin model, and as tables over SoC and temperature.

    Parameters
    ----------
    model : result of `identify` or `finish_model`, or path of its results/models/<cell>.json.
    validation : rows of `validate` of the cell's tests: errors of the member that is exported
        stand beside those of the chosen one, where it is another.

    Returns
    -------
    exported : Result; notes say which member stands for the chosen one, and both errors.

    Source: docs/exports.md.
    """
    from cellwright.circuits.exports import lookup_table, pybamm_document, validation_errors
    from cellwright.circuits.instrument import words_of
    from cellwright.circuits.model_file import plain_member
    from cellwright.identification.compensation import temperature_table

    model, errors = inputs.model(model), validation_errors(inputs.rows(validation))
    document, member = pybamm_document(model, errors), plain_member(model)
    notes = [f"{name} is not exported: {why}" for name, why in document["refused"].items()]
    for entry in model["members"]:
        with_blocks = entry.get("companions", {"with": entry})["with"]
        notes += [f"{entry['model']}, not exported: {words}" for words in words_of(with_blocks)]
    chosen, taken = model["chosen"], document["exported"]
    if taken not in (chosen, None):
        why = f"{chosen} is refused ({_both_errors(errors, taken, chosen)})"
        notes.append(f"PyBaMM's loader takes {taken}: {why}")
    if member != chosen:
        why = f"{chosen} is more than RC pairs ({_both_errors(errors, member, chosen)})"
        notes.append(f"the look-up table holds {member}: {why}")
    tables = (lookup_table(model, member, errors), temperature_table(model, None))
    named = dict(zip(("lookup", "temperature"), tables, strict=True))
    return results.Result(named, {"pybamm": document}, tuple(notes))


def _both_errors(errors, taken, chosen):
    """Validation errors [V] of two members, in words."""
    if taken not in errors or chosen not in errors:
        return "no validation test tells the errors of both"
    both = f"{taken} {1e3 * errors[taken]:.3g} mV, {chosen} {1e3 * errors[chosen]:.3g} mV"
    return f"validation error: {both}"
