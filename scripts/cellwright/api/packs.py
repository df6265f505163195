"""Packs: simulated, held against records, decided upon; the model of a pack for others."""

from collections.abc import Mapping

from cellwright.circuits import inputs as given
from cellwright.records import inputs
from cellwright.result import Result
from cellwright.settings import PackDecisions


def simulate_pack(
    models,
    members,
    current,
    *,
    initial_soc,
    temperature_celsius=25.0,
    thermal=None,
    hold="first_order",
    member=None,
):
    """Currents, voltages, SoC and temperatures of all cells of a pack under a total current.

    members : rows of groups.tsv, or a Wiring.
    current : DataFrame or columns: test_time_second [s], current_ampere [A], of the pack.
    initial_soc : scalar or one a cell in the order of the wiring [1].
    temperature_celsius : of all cells, or with `thermal` of the ambient; scalar or (n,) [°C].
    thermal : `Thermal`, or None: cells do not warm.
    hold : of the current between samples, "first_order" or "zero_order".
    member : as which member of their family all models run; None: each as its chosen one.

    Returns columns, (n,): voltage_volt [V], cell_<k>_current_ampere [A], cell_<k>_voltage_volt [V],
    cell_<k>_soc [1], cell_<k>_temperature_celsius [°C]. Raises Refusal: a wiring that is none, a
    cell without a model, or as `packs.simulate.simulate_pack`. Source: docs/packs.md.
    """
    from cellwright.packs.simulate import simulate_pack as simulated

    wiring, cells = _wired(models, members, temperature_celsius, thermal, member)
    time, total = inputs.quantities(current, ("test_time_second", "current_ampere"))
    around = {"ambient_celsius": temperature_celsius, "thermal": thermal}
    run = simulated(time, total, cells, wiring, initial_soc=initial_soc, hold=hold, **around)
    columns = {"test_time_second": time, "current_ampere": total, "voltage_volt": run.voltage_volt}
    about = {"cells": cells.names, "members": cells.members}
    return Result({"columns": columns | _of_cells(run), "rows": []}, about)


def run_pack_phases(
    models,
    members,
    phases,
    *,
    initial_soc,
    temperature_celsius=25.0,
    thermal=None,
    member=None,
):
    """A pack through phases of current, voltage, power, rest or drive, with limits by cell.

    members, initial_soc, temperature_celsius, thermal, member : as of `simulate_pack`.
    phases : sequence of `Phase`.

    Returns columns as of `simulate_pack` and `phase`; rows: when, why and by which cell each phase
    ended. Raises Refusal: as `simulate_pack`, a phase of an unknown kind or without an end.
    Source: docs/packs.md.
    """
    from cellwright.packs.phases import run_phases

    wiring, cells = _wired(models, members, temperature_celsius, thermal, member)
    around = {"ambient_celsius": temperature_celsius, "thermal": thermal}
    run = run_phases(phases, cells, wiring, initial_soc=initial_soc, **around)
    names = ("test_time_second", "phase", "current_ampere", "voltage_volt")
    columns = {name: getattr(run, name) for name in names} | _of_cells(run)
    about = {"cells": cells.names, "members": cells.members}
    return Result({"columns": columns, "rows": list(run.ends)}, about)


def _wired(models, members, celsius, thermal, member):
    """Wiring and PackCells of a pack."""
    import numpy as np

    from cellwright.packs.cells import pack_cells, table_temperatures
    from cellwright.packs.wiring import Wiring, models_of

    wiring = members if isinstance(members, Wiring) else wiring_of_members(members)[0]
    documents = models_of(wiring, given.models(models))
    if thermal is not None or np.ndim(celsius):  # parameters follow the cells' temperature
        celsius = table_temperatures(documents, celsius)
    return wiring, pack_cells(documents, temperature_celsius=celsius, member=member)


def wiring_of_members(members):
    """Wiring of rows of groups.tsv, BranchFacts of its own members, and those of all its cells."""
    from cellwright.packs.wiring import cells_of, wiring_of

    rows = inputs.rows(members)
    wiring = wiring_of(rows[0].get("group", "the pack"), rows)
    by_name = {row["cell"]: inputs.branch_facts(row) for row in rows}
    own = [by_name[one if isinstance(one, str) else one.name] for one in wiring.members]
    return wiring, own, [by_name[cell] for cell in cells_of(wiring)]


def _of_cells(run):
    """Columns of each cell of a pack's run."""
    columns = {}
    for k in range(run.soc.shape[1]):
        columns[f"cell_{k + 1}_current_ampere"] = run.cell_current_ampere[:, k]
        columns[f"cell_{k + 1}_voltage_volt"] = run.cell_voltage_volt[:, k]
        columns[f"cell_{k + 1}_soc"] = run.soc[:, k]
        columns[f"cell_{k + 1}_temperature_celsius"] = run.temperature_celsius[:, k]
    return columns


def simulate_group(
    models, current, *, initial_soc, wire_resistance_ohm=0.0, temperature_celsius=25.0
):
    """Branch currents [A], SoC [1] and voltage [V] of cells in parallel under a total current.

    models : in the order of the branches.
    current : DataFrame or columns: test_time_second [s], current_ampere [A], of the group.
    initial_soc, wire_resistance_ohm : scalar or one a branch [1], [ohm].
    temperature_celsius : of all cells [°C].

    Returns columns, (n,): voltage_volt [V], branch_<k>_current_ampere [A], branch_<k>_soc [1].
    Raises Refusal: no model, or as `packs.simulate.simulate_pack`. Source: docs/packs.md.
    """
    from cellwright.packs.cells import pack_cells
    from cellwright.packs.simulate import simulate_pack
    from cellwright.packs.wiring import star_of

    documents = given.models(models)
    # Models of one cell may stand in several branches, so branches go by their place.
    cells = pack_cells(documents, temperature_celsius=temperature_celsius)
    time, total = inputs.quantities(current, ("test_time_second", "current_ampere"))
    branches = [f"branch {k + 1}" for k in range(len(documents))]
    wiring = star_of(branches, wire_resistance_ohm=wire_resistance_ohm)
    run = simulate_pack(time, total, cells, wiring, initial_soc=initial_soc)
    columns = {"test_time_second": time, "current_ampere": total, "voltage_volt": run.voltage_volt}
    for k in range(len(documents)):
        columns[f"branch_{k + 1}_current_ampere"] = run.cell_current_ampere[:, k]
        columns[f"branch_{k + 1}_soc"] = run.soc[:, k]
    member = ", ".join(dict.fromkeys(cells.members))
    return Result({"columns": columns}, {"member": member})


def identify_branches(series, steps, cells, test):
    """Models of all cells of a group, from the longest charge in the group's record.

    series : with branch_<k>_current_ampere [A]. cells : names, in the order of the branches.

    Returns content: "models", cell → model; rows: one a parameter. Raises Refusal: no branch
    currents, or no charge between two rests. Source: docs/packs.md.
    """
    from cellwright.circuits.parameters import parameter_rows
    from cellwright.packs.identify import group_models

    # Of one slow charge all cells get one time constant: the notes say how far such models reach.
    models = group_models(inputs.measured(test, series), inputs.steps(steps)._asdict(), cells)
    rows = [{"cell": cell} | row for cell, model in models.items() for row in parameter_rows(model)]
    return Result({"rows": rows}, {"models": models})


def check_group(branches, series, test, simulated=None):
    """Checks of a group's record: do its channels agree, and are they where the sheet says.

    series : of the group, with whichever of branch_<k>_current_ampere [A] and cell_<k>_voltage_volt
        [V] were logged.
    simulated : the series of `validate_group`, whose simulated channels tell swapped ones.

    Returns rows, one a check; notes: what was found. Raises Refusal: channels beyond the wiring, or
    a wiring that is none. Source: docs/packs.md.
    """
    from cellwright.packs.checks import channel_findings, swapped_channels
    from cellwright.records.record import group_record

    wiring, own, leaves = wiring_of_members(branches)
    record = group_record(inputs.measured(test, series), own, cells=len(leaves))
    # Sums and signs tell turned or exchanged sensors; only a simulation tells cells read as others.
    findings = channel_findings(record, wiring)
    if simulated is not None:
        findings += swapped_channels(inputs.columns(simulated), wiring, record.test)
    notes = tuple(found.sentence for found in findings if found.found)
    return Result({"rows": [found._asdict() for found in findings]}, notes=notes)


def validate_group(models, branches, series, test, capacities=None, *, thermal=()):
    """Errors of a parallel group simulated through its record: branch currents [A], voltage [V].

    series : with branch_<k>_current_ampere [A].
    capacities : rows of the capacity stage of its cells, with cell and test, by whose standard
        deviations intervals are told; () where there is none; None: no intervals are told.
    thermal : documents of `thermal_constants`: where no temperature was logged in the group and
        those of all cells are known, the cells warm by their own heat.

    Returns rows, one a branch: errors of current [A] and voltage [V], and how wide their intervals
    of 90 % are; findings, spread, series. Raises Refusal: other branch currents than branches, a
    cell without a model, or no SoC at the start. Source: docs/packs.md.
    """
    from cellwright.packs.uncertainty.draws import uncertainty_of
    from cellwright.packs.validate import validate_group as validated
    from cellwright.packs.wiring import models_of

    wiring, own, leaves = wiring_of_members(branches)
    documents = models_of(wiring, given.models(models))
    names, known = [leaf.cell for leaf in leaves], None
    # Intervals need to know how sure the models are; a record is validated without them as well.
    if capacities is not None:
        known = uncertainty_of(documents, capacity_stds(capacities, names))
    how = {"leaves": leaves, "uncertainty": known, "thermal": thermal_of(thermal, names)}
    tables, notes = validated(documents, own, inputs.measured(test, series), wiring, **how)
    return Result(tables, notes=tuple(notes))


def nested_pack(models, members, series, test):
    """A pack of groups in groups simulated through its record, against what was logged of it.

    series : of the pack, with whichever of branch_<k>_current_ampere [A] and cell_<k>_voltage_volt
        [V] were logged.

    Returns rows, one a channel: errors of the pack's voltage, of branch currents, of cell voltages;
    series. Raises Refusal: a wiring that is none, a cell without a model, no SoC at the start, or
    branch currents that contradict the total. Source: docs/packs.md.
    """
    from cellwright.packs.checks import refuse_contradiction
    from cellwright.packs.series.nested import nested_pack as scored
    from cellwright.packs.wiring import models_of
    from cellwright.records.record import group_record

    wiring, own, leaves = wiring_of_members(members)
    documents = models_of(wiring, given.models(models))
    record = group_record(inputs.measured(test, series), own, cells=len(leaves))
    # Before anything is scored: against currents that do not add up no error means anything.
    refuse_contradiction(record, wiring)
    tables, notes = scored(documents, wiring, leaves, record)
    return Result(tables, notes=tuple(notes))


def series_pack(models, members, cells, series, test, settings=None, **changes):
    """A series pack simulated through a record; its charge, energy, power, limits and balancing.

    series : of the pack, with cell_<k>_voltage_volt [V] where logged.
    settings : `settings.PackDecisions`.

    Returns cells, one row each; pack, one row; power, waterfall, series. Raises Refusal: a wiring
    that is not cells in series, a cell without a model or cut-offs, no SoC at the start.
    Source: docs/packs.md.
    """
    from cellwright.packs.series.capability import series_pack as analysed
    from cellwright.packs.wiring import depth, described, models_of
    from cellwright.records.record import group_record
    from cellwright.refusal import Refusal

    wiring, _, positions = wiring_of_members(members)
    documents = models_of(wiring, given.models(models))
    facts = facts_of(cells, positions)
    if wiring.connection != "series" or depth(wiring) != 1:
        raise Refusal(f"{wiring.name}: found {described(wiring)}, wanted cells in series")
    # Cells in series carry one current, so the record has no branches to read.
    record = group_record(inputs.measured(test, series), positions, cells=len(positions))
    chosen = inputs.settings_of(PackDecisions, settings, changes)
    tables, notes = analysed(documents, positions, facts, record, chosen)
    return Result(tables, notes=tuple(notes))


def facts_of(cells, positions):
    """CellFacts of the cells at these positions, in their order."""
    from cellwright.refusal import Refusal

    known = {facts.cell: facts for facts in map(inputs.cell_facts, cells)}
    lacking = [row.cell for row in positions if row.cell not in known]
    if lacking:
        raise Refusal(f"no facts of {', '.join(lacking)}; there are {', '.join(known) or 'none'}")
    return [known[row.cell] for row in positions]


def thermal_of(documents, names):
    """Thermal of a pack's cells, None where one cell's constants are not known."""
    from cellwright.identification.thermal import thermal_columns
    from cellwright.packs.thermal import Thermal

    known = {content["cell"]: content for content in map(inputs.content, documents)}
    # One unknown cell would take or give heat that nobody knows, so all cells keep the ambient.
    columns = thermal_columns([known.get(name) for name in names])
    return None if columns is None else Thermal(**columns)


def capacity_stds(capacities, names):
    """Standard deviation of each cell's capacity: of the mean of its slowest repeated cycles.

    Of charge and discharge the one that repeats better tells it: a discharge also differs by how
    full the one before has left the cell, which says nothing of the cell.
    """
    from cellwright.records.conditions import same_rate

    found = {name: [] for name in names}
    for row in inputs.rows(capacities):
        std, repeats = row["capacity_std_ampere_hour"], row["repeats"]
        # A single cycle has no scatter, and tells nothing of how sure its capacity is.
        if row["cell"] in found and std is not None and std > 0 and repeats > 1:
            found[row["cell"]].append((row["c_rate"], std / repeats**0.5))
    return [
        min((std for rate, std in rates if same_rate(rate, min(rates)[0])), default=None)
        for rates in map(found.get, names)
    ]


def assemble_pack(group, rows, models, *, capacities=(), validation=(), group_tests=(), thermal=()):
    """The model of a pack as one document: wiring, cells, start, and every number's error.

    group : name of the pack. rows : rows of groups.tsv of it and of all groups in it.
    capacities, validation : rows of `capacity` with cell, of `validate` with cell, test, role, of
        the cells' tests.
    group_tests : rows of `validate_group`, each with test, role.
    thermal : documents of `thermal_constants`; or mapping, cell → (heat capacity [J/K], resistance
        to the ambient [K/W]), where known.

    Returns content: schema cellwright-pack/1; lookup: its tables in long form. Raises Refusal:
    wiring that is none, or a cell without a model. Source: docs/exports.md.
    """
    from cellwright.identification.thermal import constants_of
    from cellwright.packs.artefact import CellInPack, pack_document, pack_lookup
    from cellwright.packs.thermal import Thermal
    from cellwright.packs.wiring import wiring_of
    from cellwright.records.checkups import repeat_std

    # By name: rows of the sheet and models may come in any order.
    documents = {model["cell"]: model for model in given.models(models)}
    start = {row["cell"]: row.get("initial_soc") for row in rows}
    known = thermal if isinstance(thermal, Mapping) else constants_of(map(inputs.content, thermal))
    heat = {cell: Thermal(*values) for cell, values in known.items()}

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
    reasons = {f"pack {group}": document["why_not_validated"]}
    reasons |= {entry["cell"]: entry["why_not_validated"] for entry in document["cells"]}
    notes = [f"{name} is not validated: {why}" for name, why in reasons.items() if why]
    notes += [
        f"{entry['cell']} runs as {entry['model']['chosen']} instead of {entry['instead_of']}"
        for entry in document["cells"]
        if entry["instead_of"]
    ]
    return Result({"lookup": pack_lookup(document)}, document, tuple(notes))


def pack_model(source):
    """A pack model that can be simulated, from the file that a campaign writes.

    source : path of a `results/pack_models/<group>.json`, its content, or what `assemble_pack`
        returns.

    Returns `packs.artefact.PackModel`: wiring, models, initial_soc, thermal, document. Raises
    Refusal: another schema, or a document whose cells and wiring do not belong together; of an
    artefact without content the reason that it carries. Source: docs/exports.md.
    """
    from cellwright.packs.artefact import read_pack
    from cellwright.refusal import Refusal

    content = inputs.content(source)
    reason = content.get("provenance", {}).get("reason") if isinstance(content, dict) else None
    if reason:
        raise Refusal(reason)
    return read_pack(content)
