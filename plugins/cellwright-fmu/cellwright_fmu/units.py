"""A cell or a pack as a functional mock-up unit: the package's two functions and their result."""

from typing import NamedTuple

from cellwright.api.packs import pack_model
from cellwright.circuits import inputs as given
from cellwright.circuits import particle
from cellwright.circuits.model_file import in_use
from cellwright.packs.artefact import CellInPack, PackModel, cell_entry
from cellwright.packs.thermal import Thermal
from cellwright.records import inputs
from cellwright.records.checkups import repeat_std
from cellwright.result import frame
from cellwright_fmu.evidence import page
from cellwright_fmu.unit import archive, single, unit_of


class Fmu(NamedTuple):
    """A functional mock-up unit of a cell or a pack.

    content : bytes of a .fmu file. token : instantiation token, the hash of what it is made of.
    platform : that its binary is built for as FMI 3 names it, None where it holds sources only.
    variables : `cellwright_fmu.description.Variable` each.
    """

    content: bytes
    token: str
    platform: str | None
    variables: tuple
    notes: tuple

    def to_frame(self):
        """One row a variable."""
        return frame(self.variables)


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
    """A cell as an FMI 3.0 unit for co-simulation: what `cw.simulate` runs, its particle where that
    predicts better than the chosen circuit.

    Parameters
    ----------
    model : result of `identify` or `finish_model`, or path of its results/models/<cell>.json.
    initial_soc : at the start, until a simulator sets another [1].
    capacities, validation : rows of `capacity` and `validate` of its tests, with test and role:
        their errors stand in the unit's documentation.
    thermal : (heat capacity [J/K], resistance to the surroundings [K/W]) of the cell, or None.
    points : size of the SoC grid of a circuit's tables.
    largest_step_second : longest internal step [s].

    Returns
    -------
    unit : Fmu; content: the bytes of a .fmu file, the same for the same model.

    Raises
    ------
    Refusal : A start that is not within 0 to 1, or a member that cannot be run in steps.

    Source: FMI 3.0; docs/exports.md.
    """
    content = given.model(model)
    heat = None if thermal is None else Thermal(*thermal)
    known = {"capacities": capacities, "validation": validation}
    cell = CellInPack(content, initial_soc, heat, **_known_errors(content, **known))
    as_particle = in_use(content) == particle.NAME
    entry = _particle_entry(cell) if as_particle else cell_entry(content["cell"], cell)
    shown = page(f"Cell {content['cell']}", [entry], by_tables=not as_particle)
    pack = PackModel(single(content), (entry["model"],), (initial_soc,), (heat,), {})
    unit = _unit(pack, shown, points, largest_step_second, alone=True)
    if entry["instead_of"]:
        without = f"it runs as {entry['model']['chosen']} instead of {entry['instead_of']}"
        return unit._replace(notes=(*unit.notes, without))
    return unit


def _particle_entry(cell):
    """Entry of a CellInPack that runs as its particle, see `packs.artefact.cell_entry`."""
    document = cell.model["particle"]
    conditions = [{"ambient_temperature_celsius": celsius} for celsius in document["celsius"]]
    member = {"model": particle.NAME, "conditions": conditions}
    member["left_out_rmse_volt"] = document["left_out_rmse_volt"]
    model = cell.model | {"chosen": particle.NAME, "members": [member]}
    entry = cell_entry(model["cell"], cell._replace(model=model))
    return entry | {"model": entry["model"] | {"particle": document}}


def _known_errors(model, *, capacities, validation):
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
    unit : Fmu, as of `cell_fmu`.

    Raises
    ------
    Refusal : As `pack_model`, or a member that cannot be run in a pack.

    Source: FMI 3.0; docs/exports.md.
    """
    read = pack if isinstance(pack, PackModel) else pack_model(pack)
    document = read.document
    errors = document["cells"], document["tests"], document["why_not_validated"]
    shown = page(f"Pack {read.wiring.name}", *errors)
    return _unit(read, shown, points, largest_step_second, alone=False)


def _unit(pack, shown, points, largest_step_second, *, alone):
    unit = unit_of(
        pack,
        alone=alone,
        points=points,
        largest_step_second=largest_step_second,
        documents={"documentation/index.html": shown},
    )
    return Fmu(archive(unit.files), unit.token, unit.binary, unit.variables, unit.notes)
