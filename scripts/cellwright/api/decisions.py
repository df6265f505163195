"""What is decided about packs and fleets of cells."""

from cellwright.api.packs import capacity_stds, facts_of, thermal_of, wiring_of_members
from cellwright.circuits import inputs as given
from cellwright.records import inputs
from cellwright.result import Result
from cellwright.settings import PackDecisions


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

    members : of cells in series, or in a star of parallel branches.
    capacities : rows of the capacity stage of its cells, with cell and test: of their standard
        deviations, and of the temperature of cells under such a load (temperature_mean_celsius).
    settings : `settings.PackDecisions`.
    temperature_celsius : around the cells [°C]; they are as warm as in their discharges within
        2.5 K of it, where those tell.
    thermal : documents of `thermal_constants`: where those of all cells are known, the cells of a
        pack with parallel ones warm by their own heat instead.

    Returns rows of decision, quantity, cell, unit, value and percentiles. Raises Refusal: another
    wiring, a cell without a model or cut-offs. Source: docs/packs.md.
    """
    from cellwright.packs.decisions.of_pack import pack_decisions as decided
    from cellwright.packs.wiring import depth, models_of

    wiring, _, positions = wiring_of_members(members)
    documents = models_of(wiring, given.models(models))
    facts, names = facts_of(cells, positions), [row.cell for row in positions]
    stds = capacity_stds(capacities, names)
    chosen = inputs.settings_of(PackDecisions, settings, changes)
    # Cells under load are warmer than the chamber, and resistance falls with that.
    warm = _loaded_celsius(capacities, names, temperature_celsius)
    warms = thermal_of(thermal, names)
    around = {"thermal": warms, "ambient_celsius": float(temperature_celsius)}
    about = (wiring, documents, positions, facts, stds)
    rows = decided(*about, celsius=warm, settings=chosen, **around)
    how = f"cells at {warm:.1f} °C"
    # Decisions on a string are made at one temperature: it has no currents that heat would share.
    if warms is not None and not (wiring.connection == "series" and depth(wiring) == 1):
        how = f"cells warm by their own heat from {temperature_celsius:.1f} °C"
    return Result({"rows": rows}, notes=(how, *_borrowed(documents)))


def match_cells(models, cells, capacities=(), settings=None, **changes):
    """Cells of one type put together, and what that brings beside random assemblies.

    capacities, settings : as of `pack_decisions`.

    Returns rows of what is gained; assembly: who is put where. Raises Refusal: too few cells, too
    many, or one without cut-offs. Source: docs/packs.md.
    """
    from cellwright.packs.decisions.fleet import fleet_of, matched_fleet
    from cellwright.packs.series.capability import cutoffs_of
    from cellwright.records.facts import BranchFacts

    documents = given.models(models)
    names = [model["cell"] for model in documents]
    facts = facts_of(cells, [BranchFacts(k, name) for k, name in enumerate(names, 1)])
    # Refused before the draws, which take minutes.
    cutoffs_of(facts)
    chosen = inputs.settings_of(PackDecisions, settings, changes)
    fleet = fleet_of(documents, facts, capacity_stds(capacities, names), chosen)
    rows, assembly = matched_fleet(fleet, chosen)
    return Result({"rows": rows, "assembly": assembly})


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


def _loaded_celsius(capacities, names, around):
    """Median temperature of cells in their discharges at a chamber temperature, else that [°C]."""
    from cellwright.records.conditions import same_temperature

    warm = []
    for row in inputs.rows(capacities):
        stated = row.get("ambient_temperature_celsius")
        near = stated is None or same_temperature(stated, around)
        if row["cell"] in names and row["direction"] == "discharge" and near:
            warm.append(row["temperature_mean_celsius"])
    # The median: a test whose sensor fell off must not decide.
    warm = sorted(celsius for celsius in warm if celsius is not None and celsius == celsius)
    return float(warm[len(warm) // 2]) if warm else float(around)
