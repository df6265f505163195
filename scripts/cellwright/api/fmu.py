"""Models for other tools: functional mock-up units (FMI 3.0), PyBaMM, look-up tables."""

from cellwright.api import inputs, results


def cell_fmu(
    model,
    *,
    initial_soc=1.0,
    capacities=(),
    validation=(),
    thermal=None,
    points=4001,
    largest_step_second=1.0,
):
    """A cell's chosen member as an FMI 3.0 unit for co-simulation.

    Parameters
    ----------
    model : result of `identify` or `finish_model`, or path of its results/models/<cell>.json.
    initial_soc : at the start, until a simulator sets another [1].
    capacities, validation : rows of `capacity` and `validate` of its tests, with test and role:
        their errors stand in the unit's documentation.
    thermal : (heat capacity [J/K], resistance to the surroundings [K/W]) of the cell, or None.
    points : size of the SoC grid of its tables.
    largest_step_second : longest internal step [s].

    Returns
    -------
    unit : Result; content: the bytes of a .fmu file, the same for the same model.

    Raises
    ------
    Refusal : A start that is not within 0 to 1, or a member that cannot be run in steps.

    Source: FMI 3.0; docs/exports.md.
    """
    from cellwright.fmu.evidence import page
    from cellwright.fmu.unit import single
    from cellwright.packs.artefact import CellInPack, PackModel, ThermalConstants, cell_entry

    content = inputs.model(model)
    heat = None if thermal is None else ThermalConstants(*thermal)
    known = {"capacities": capacities, "validation": validation}
    cell = CellInPack(content, initial_soc, heat, **_known_errors(content, **known))
    entry = cell_entry(content["cell"], cell)
    shown = page(f"Cell {content['cell']}", [entry])
    pack = PackModel(single(content), (entry["model"],), (initial_soc,), (heat,), {})
    unit = _unit(pack, shown, points, largest_step_second, alone=True)
    if entry["instead_of"]:
        without = f"it runs as {entry['model']['chosen']} instead of {entry['instead_of']}"
        return unit._replace(notes=(*unit.notes, without))
    return unit


def _known_errors(model, *, capacities, validation):
    from cellwright.records.checkups import repeat_std

    discharges = [row for row in inputs.rows(capacities) if row["direction"] == "discharge"]
    std = repeat_std(discharges, model["capacity_ampere_hour"])
    return {"capacity_std_ampere_hour": std, "validation": tuple(inputs.rows(validation))}


def pack_fmu(pack, *, points=201, largest_step_second=1.0):
    """A pack as an FMI 3.0 unit for co-simulation.

    Parameters
    ----------
    pack : result of `assemble_pack` or `pack_model`, or what `pack_model` reads.
    points, largest_step_second : as of `cell_fmu`.

    Returns
    -------
    unit : Result, as of `cell_fmu`.

    Raises
    ------
    Refusal : As `pack_model`, or a member that cannot be run in a pack.

    Source: FMI 3.0; docs/exports.md.
    """
    from cellwright.api.pack_model import pack_model
    from cellwright.fmu.evidence import page
    from cellwright.packs.artefact import PackModel

    read = pack if isinstance(pack, PackModel) else pack_model(pack)
    document = read.document
    errors = document["cells"], document["tests"], document["why_not_validated"]
    shown = page(f"Pack {read.wiring.name}", *errors)
    return _unit(read, shown, points, largest_step_second, alone=False)


def _unit(pack, shown, points, largest_step_second, *, alone):
    from cellwright.fmu.unit import archive, unit_of
    from cellwright.native.fmu import COMPILED, unit_binary, unit_sources

    unit = unit_of(
        pack,
        unit_sources(),
        COMPILED,
        unit_binary(),
        alone=alone,
        points=points,
        largest_step_second=largest_step_second,
        documents={"documentation/index.html": shown},
    )
    about = {"archive": archive(unit.files), "token": unit.token, "platform": unit.binary}
    return results.Result({"variables": unit.variables}, about, unit.notes)


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
