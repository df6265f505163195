"""The validated model of a pack: put together, written for others, read again."""

from collections.abc import Mapping

from cellwright.api import inputs, results


def assemble_pack(group, rows, models, *, capacities=(), validation=(), group_tests=(), thermal=()):
    """The model of a pack as one document: wiring, cells, start, and every number's error.

    Parameters
    ----------
    group : name of the pack. rows : rows of groups.tsv of it and of all groups in it.
    models : result of `finish_model` of each cell, in any order.
    capacities : rows of `capacity` of the cells' tests, each with its `cell`.
    validation : rows of `validate` of the cells' tests, each with cell, test, role.
    group_tests : rows of `validate_group`, each with test, role.
    thermal : documents of `thermal_constants`; or mapping, cell → (heat capacity [J/K], resistance
        to the ambient [K/W]), where known.

    Returns
    -------
    pack : Result; content: schema cellwright-pack/1, lookup: its tables in long form.

    Raises
    ------
    Refusal : Wiring that is none, or a cell without a model.

    Source: docs/exports.md.
    """
    from cellwright.identification.thermal import constants_of
    from cellwright.packs.artefact import CellInPack, ThermalConstants, pack_document, pack_lookup
    from cellwright.packs.wiring import wiring_of
    from cellwright.records.checkups import repeat_std

    documents = {model["cell"]: model for model in inputs.models(models)}
    start = {row["cell"]: row.get("initial_soc") for row in rows}
    told = thermal if isinstance(thermal, Mapping) else constants_of(map(inputs.content, thermal))
    heat = {cell: ThermalConstants(*values) for cell, values in told.items()}

    def discharges(cell):
        return [r for r in capacities if r["cell"] == cell and r["direction"] == "discharge"]

    cells = {
        cell: CellInPack(
            model=model,
            initial_soc=start.get(cell),
            thermal=heat.get(cell),
            capacity_std_ampere_hour=repeat_std(discharges(cell), model["capacity_ampere_hour"]),
            validation=tuple(row for row in validation if row["cell"] == cell),
        )
        for cell, model in documents.items()
    }
    document = pack_document(wiring_of(group, rows), cells, group_tests)
    notes = [
        f"{name} is not validated: {why}"
        for name, why in [
            (f"pack {group}", document["why_not_validated"]),
            *((entry["cell"], entry["why_not_validated"]) for entry in document["cells"]),
        ]
        if why
    ]
    notes += [
        f"{entry['cell']} runs as {entry['model']['chosen']} instead of {entry['instead_of']}"
        for entry in document["cells"]
        if entry["instead_of"]
    ]
    return results.Result({"lookup": pack_lookup(document)}, document, tuple(notes))


def pack_model(source):
    """A pack model that can be simulated, from the file that a campaign writes.

    Parameters
    ----------
    source : path of a `results/pack_models/<group>.json`, its content, or what `assemble_pack`
        returns.

    Returns
    -------
    pack : `packs.artefact.PackModel`: wiring, models, initial_soc, thermal, document.

    Raises
    ------
    Refusal : Another schema, or a document whose cells and wiring do not belong together; of an
        artefact without content the reason that it carries.

    Source: docs/exports.md.
    """
    from cellwright.packs.artefact import read_pack
    from cellwright.refusal import Refusal

    content = inputs.content(source)
    reason = content.get("provenance", {}).get("reason") if isinstance(content, dict) else None
    if reason:
        raise Refusal(reason)
    return read_pack(content)
