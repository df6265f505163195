"""Packs: simulated, what a series string can give, decisions on a pack, cells put together."""

from cellwright.api import inputs, results
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

    Parameters
    ----------
    models : of its cells, in any order; each runs as its chosen member, or as `member`.
    members : rows of groups.tsv of the pack and of the groups in it, or a Wiring.
    current : DataFrame or columns: test_time_second [s], current_ampere [A], of the pack.
    initial_soc : scalar or one a cell in the order of the wiring [1].
    temperature_celsius : of all cells, or with `thermal` of the ambient; scalar or (n,) [°C].
    thermal : `Thermal`, or None: cells do not warm.
    hold : of the current between samples, "first_order" or "zero_order".
    member : name of a member of all models, or None.

    Returns
    -------
    simulation : Result; (n,) columns: voltage_volt [V], cell_<k>_current_ampere [A],
        cell_<k>_voltage_volt [V], cell_<k>_soc [1], cell_<k>_temperature_celsius [°C].

    Raises
    ------
    Refusal : a wiring that is none, a cell without a model, or as `packs.simulate.simulate_pack`.

    Source: docs/packs.md.
    """
    from cellwright.packs.simulate import simulate_pack as simulated

    wiring, cells = _wired(models, members, temperature_celsius, thermal, member)
    time, total = inputs.quantities(current, ("test_time_second", "current_ampere"))
    around = {"ambient_celsius": temperature_celsius, "thermal": thermal}
    run = simulated(time, total, cells, wiring, initial_soc=initial_soc, hold=hold, **around)
    columns = {"test_time_second": time, "current_ampere": total, "voltage_volt": run.voltage_volt}
    about = {"cells": cells.names, "members": cells.members}
    return results.Result({"columns": columns | _of_cells(run), "rows": []}, about)


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

    Parameters
    ----------
    models, members, initial_soc, thermal, member : as of `simulate_pack`.
    phases : sequence of `Phase`.
    temperature_celsius : of all cells, or with `thermal` of the ambient [°C].

    Returns
    -------
    simulation : Result; columns as of `simulate_pack` and `phase`; rows say when, why and
        by which cell each phase ended.

    Raises
    ------
    Refusal : as `simulate_pack`, a phase of an unknown kind or without an end.

    Source: docs/packs.md.
    """
    from cellwright.packs.phases import run_phases

    wiring, cells = _wired(models, members, temperature_celsius, thermal, member)
    around = {"ambient_celsius": temperature_celsius, "thermal": thermal}
    run = run_phases(phases, cells, wiring, initial_soc=initial_soc, **around)
    names = ("test_time_second", "phase", "current_ampere", "voltage_volt")
    columns = {name: getattr(run, name) for name in names} | _of_cells(run)
    ends = [end._asdict() for end in run.ends]
    about = {"cells": cells.names, "members": cells.members}
    return results.Result({"columns": columns, "rows": ends}, about)


def _wired(models, members, celsius, thermal, member):
    """Wiring and PackCells of a pack."""
    import numpy as np

    from cellwright.packs.cells import pack_cells, table_temperatures
    from cellwright.packs.wiring import Wiring, models_of, wiring_of

    wiring = members
    if not isinstance(members, Wiring):
        rows = inputs.rows(members)
        wiring = wiring_of(rows[0].get("group", "the pack"), rows)
    documents = models_of(wiring, inputs.models(models))
    if thermal is None and np.ndim(celsius) == 0:
        return wiring, pack_cells(documents, temperature_celsius=celsius, member=member)
    grid = table_temperatures(documents, celsius)
    return wiring, pack_cells(documents, temperature_celsius=grid, member=member)


def _of_cells(run):
    """Columns of each cell of a pack's run."""
    columns = {}
    for k in range(run.soc.shape[1]):
        columns[f"cell_{k + 1}_current_ampere"] = run.cell_current_ampere[:, k]
        columns[f"cell_{k + 1}_voltage_volt"] = run.cell_voltage_volt[:, k]
        columns[f"cell_{k + 1}_soc"] = run.soc[:, k]
        columns[f"cell_{k + 1}_temperature_celsius"] = run.temperature_celsius[:, k]
    return columns


def series_pack(models, members, cells, series, test, settings=None, **changes):
    """A series pack simulated through a record; its charge, energy, power, limits and balancing.

    Parameters
    ----------
    models : of its cells, in any order. members : rows of groups.tsv of the pack. cells :
        CellFacts or mappings of its cells, in any order.
    series : clean series of the pack, (n,) columns, with cell_<k>_voltage_volt where logged.
    test : TestFacts or mapping.
    settings : `settings.PackDecisions`, or its keys as keywords.

    Returns
    -------
    pack : Result; one row of the pack, rows of its cells, of its power and of its charge.

    Raises
    ------
    Refusal : a wiring that is not cells in series, a cell without a model or cut-offs, no SoC at
        the start.

    Source: docs/series-packs.md.
    """
    from cellwright.packs.series.capability import series_pack as analysed
    from cellwright.packs.wiring import depth, described
    from cellwright.records.facts import MeasuredTest
    from cellwright.records.record import group_record
    from cellwright.refusal import Refusal

    wiring, documents, positions, facts = _pack(models, members, cells)
    if wiring.connection != "series" or depth(wiring) != 1:
        raise Refusal(f"{wiring.name}: found {described(wiring)}, wanted cells in series")
    measured = MeasuredTest(inputs.test_facts(test), inputs.columns(series, *inputs.NAMES))
    record = group_record(measured, positions, cells=len(positions))
    chosen = inputs.settings_of(PackDecisions, settings, changes)
    tables, notes = analysed(documents, positions, facts, record, chosen)
    return results.Result(tables, notes=tuple(notes))


def validate_group(
    models, branches, series, test, capacities=None, settings=None, *, thermal=(), **changes
):
    """Errors of a parallel group simulated through its record: branch currents [A], voltage [V].

    Parameters
    ----------
    models : of the cells, in the order of the branches. branches : rows of groups.tsv, of the group
        and of all groups in it.
    series : clean series with branch_<k>_current_ampere [A], (n,) columns.
    test : TestFacts or mapping.
    capacities : rows of the capacity stage of its cells, with cell and test, by whose standard
        deviations intervals are told; () where there is none; None: no intervals are told.
    settings : `settings.PackDecisions`, or its keys as keywords: least standard deviations.
    thermal : documents of `thermal_constants`: where no temperature was logged in the group and
        those of all cells are known, the cells warm by their own heat.

    Returns
    -------
    validation : Result; one row a branch: errors of current [A] and voltage [V], and how wide
        their intervals of 90 % are.

    Raises
    ------
    Refusal : Other branch currents than branches, a cell without a model, or no SoC at the start.

    Source: docs/packs.md.
    """
    from cellwright.packs.uncertainty.draws import uncertainty_of
    from cellwright.packs.validate import validate_group as validated
    from cellwright.packs.wiring import cells_of, models_of, wiring_of
    from cellwright.records.facts import MeasuredTest

    measured = MeasuredTest(inputs.test_facts(test), inputs.columns(series, *inputs.NAMES))
    rows = inputs.rows(branches)
    group = rows[0].get("group", "the group")
    wiring = wiring_of(group, rows)
    documents = models_of(wiring, inputs.models(models))
    own = [row for row in rows if row.get("group", group) == group]
    members = sorted(own, key=lambda row: row["position"])
    facts = [inputs.branch_facts(row) for row in members]
    by_cell = {row["cell"]: inputs.branch_facts(row) for row in rows}
    leaves = [by_cell[cell] for cell in cells_of(wiring)]
    known = None
    if capacities is not None:
        chosen = inputs.settings_of(PackDecisions, settings, changes)
        known = uncertainty_of(
            documents,
            _capacity_stds(capacities, cells_of(wiring)),
            initial_soc_std=chosen.initial_soc_std,
            wire_relative_std=chosen.wire_relative_std,
        )
    warms = _thermal_of(thermal, cells_of(wiring))
    how = {"leaves": leaves, "uncertainty": known, "thermal": warms}
    tables, notes = validated(documents, facts, measured, wiring, **how)
    return results.Result(tables, notes=tuple(notes))


def nested_pack(models, members, series, test):
    """A pack of groups in groups simulated through its record, against what was logged of it.

    Parameters
    ----------
    models : of its cells, in any order. members : rows of groups.tsv of the pack and of all groups
        in it.
    series : clean series of the pack, (n,) columns, with whichever of branch_<k>_current_ampere [A]
        and cell_<k>_voltage_volt [V] were logged. test : TestFacts or mapping.

    Returns
    -------
    pack : Result; a row a channel: errors of the pack's voltage, of branch currents, of cell
        voltages.

    Raises
    ------
    Refusal : a wiring that is none, a cell without a model, no SoC at the start, or branch currents
        that contradict the total.

    Source: docs/pack-records.md.
    """
    from cellwright.packs.checks import refuse_contradiction
    from cellwright.packs.series.nested import nested_pack as scored
    from cellwright.packs.wiring import cells_of, models_of, wiring_of
    from cellwright.records.facts import MeasuredTest
    from cellwright.records.record import group_record

    rows = inputs.rows(members)
    group = rows[0].get("group", "the pack")
    wiring = wiring_of(group, rows)
    documents = models_of(wiring, inputs.models(models))
    by_name = {row["cell"]: inputs.branch_facts(row) for row in rows}
    own = [part if isinstance(part, str) else part.name for part in wiring.members]
    measured = MeasuredTest(inputs.test_facts(test), inputs.columns(series, *inputs.NAMES))
    leaves = cells_of(wiring)
    record = group_record(measured, [by_name[name] for name in own], cells=len(leaves))
    refuse_contradiction(record, wiring)
    tables, notes = scored(documents, wiring, [by_name[name] for name in leaves], record)
    return results.Result(tables, notes=tuple(notes))


def pack_decisions(
    models,
    members,
    cells,
    capacities=(),
    settings=None,
    *,
    temperature_celsius=25.0,
    thermal=(),
    **changes,
):
    """What is decided about a pack: Monte Carlo, which cell to replace, safe window of SoC.

    Parameters
    ----------
    models, members, cells, settings : as of `series_pack`; also of cells in a star of parallel
        branches.
    capacities : rows of the capacity stage of its cells, with cell and test: of their standard
        deviations, and of the temperature of cells under such a load (temperature_mean_celsius).
    temperature_celsius : around the cells [°C]; they are as warm as in their discharges within
        2.5 K of it, where those tell.
    thermal : documents of `thermal_constants`: where those of all cells are known, the cells of a
        pack with parallel ones warm by their own heat instead.

    Returns
    -------
    decisions : Result; rows of decision, quantity, cell, unit, value and percentiles.

    Raises
    ------
    Refusal : another wiring, a cell without a model or cut-offs.

    Source: docs/pack-decisions.md.
    """
    from cellwright.packs.decisions.of_pack import pack_decisions as decided
    from cellwright.packs.wiring import depth

    wiring, documents, positions, facts = _pack(models, members, cells)
    stds = _capacity_stds(capacities, [row.cell for row in positions])
    chosen = inputs.settings_of(PackDecisions, settings, changes)
    warm = _loaded_celsius(capacities, [row.cell for row in positions], temperature_celsius)
    warms = _thermal_of(thermal, [row.cell for row in positions])
    around = {"thermal": warms, "ambient_celsius": float(temperature_celsius)}
    about = (wiring, documents, positions, facts, stds)
    rows = decided(*about, celsius=warm, settings=chosen, **around)
    string = wiring.connection == "series" and depth(wiring) == 1
    how = f"cells at {warm:.1f} °C"
    if warms is not None and not string:
        how = f"cells warm by their own heat from {temperature_celsius:.1f} °C"
    notes = [how, *_borrowed(documents)]
    return results.Result({"rows": rows}, notes=tuple(notes))


def match_cells(models, cells, capacities=(), settings=None, **changes):
    """Cells of one type put together, and what that brings beside random assemblies.

    Parameters
    ----------
    models : of the cells. cells : CellFacts or mappings, in any order. capacities, settings : as of
        `pack_decisions`.

    Returns
    -------
    matching : Result; rows of what is gained, rows of who is put where.

    Raises
    ------
    Refusal : too few cells, too many, or one without cut-offs.

    Source: docs/pack-decisions.md.
    """
    from cellwright.packs.decisions.fleet import fleet_of, matched_fleet
    from cellwright.packs.series.capability import cutoffs_of

    documents = inputs.models(models)
    names = [model["cell"] for model in documents]
    facts = _facts_of(cells, names)
    cutoffs_of(facts)
    chosen = inputs.settings_of(PackDecisions, settings, changes)
    fleet = fleet_of(documents, facts, _capacity_stds(capacities, names), chosen)
    rows, assembly = matched_fleet(fleet, chosen)
    return results.Result({"rows": rows, "assembly": assembly})


def _pack(models, members, cells):
    """Wiring, models, BranchFacts and CellFacts of a pack, in the order of its cells."""
    from cellwright.packs.wiring import cells_of, models_of, wiring_of

    rows = inputs.rows(members)
    wiring = wiring_of(rows[0].get("group", "the pack"), rows)
    names = cells_of(wiring)
    documents = models_of(wiring, inputs.models(models))
    by_cell = {row["cell"]: inputs.branch_facts(row) for row in rows}
    return wiring, documents, [by_cell[name] for name in names], _facts_of(cells, names)


def _borrowed(documents):
    """Sentences on models that are not of a cell's own pulses and drives."""
    words = {
        "group": "known from one slow record of the group: at other currents they are extrapolated",
        "bias": "the reference's, corrected by what was measured of the cell",
        "scaled": "the reference's, scaled",
    }
    for kind, meaning in words.items():
        names = [model["cell"] for model in documents if model.get("kind") == kind]
        if names:
            yield f"models of {', '.join(names)}: {meaning}"


def _thermal_of(documents, names):
    """Thermal of a pack's cells, None where one cell's constants are not known."""
    from cellwright.identification.thermal import thermal_columns
    from cellwright.packs.thermal import Thermal

    known = {content["cell"]: content for content in map(inputs.content, documents)}
    columns = thermal_columns([known.get(name) for name in names])
    return None if columns is None else Thermal(**columns)


def _facts_of(cells, names):
    known = {facts.cell: facts for facts in map(inputs.cell_facts, cells)}
    return [known[name] for name in names]


def _capacity_stds(capacities, names):
    """Standard deviation of each cell's capacity: of the mean of its slowest repeated cycles.

    Of charge and discharge the one that repeats better tells it: a discharge also differs by how
    full the one before has left the cell, which says nothing of the cell.
    """
    from cellwright.records.conditions import same_rate

    found = {}
    for row in inputs.rows(capacities):
        std, repeats = row["capacity_std_ampere_hour"], row["repeats"]
        if std is not None and std > 0 and repeats > 1:
            found.setdefault(row["cell"], []).append((row["c_rate"], std / repeats**0.5))
    slowest = {cell: min(rates)[0] for cell, rates in found.items()}
    return [
        min(
            (std for rate, std in found.get(name, ()) if same_rate(rate, slowest[name])),
            default=None,
        )
        for name in names
    ]


def _loaded_celsius(capacities, names, around):
    """Median temperature of cells in their discharges at a chamber temperature, else that [°C]."""
    found = [
        row["temperature_mean_celsius"]
        for row in inputs.rows(capacities)
        if row["cell"] in names and row["direction"] == "discharge" and _near(row, around)
    ]
    warm = sorted(celsius for celsius in found if celsius is not None and celsius == celsius)
    return float(warm[len(warm) // 2]) if warm else float(around)


def _near(row, around):
    from cellwright.records.conditions import same_temperature

    stated = row.get("ambient_temperature_celsius")
    return stated is None or same_temperature(stated, around)
