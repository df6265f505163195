"""A cell or a pack as a functional mock-up unit: its tables, its files, the archive of them."""

import hashlib
import io
import struct
import zipfile
from typing import NamedTuple

import numpy as np

from cellwright.circuits import particle
from cellwright.circuits.model_file import capacity_of, member_of
from cellwright.circuits.temperature import celsius_of
from cellwright.packs.artefact import OF_CELL
from cellwright.packs.cells import TABLES, pack_cells
from cellwright.packs.kernel import STRAIGHT, Keep, kernel_sizes, work_room
from cellwright.packs.network import network_of
from cellwright.packs.simulate import TOLERANCE_VOLT, sensed_element
from cellwright.packs.steps import SAME_SOC
from cellwright.packs.wiring import Wiring
from cellwright.records.conditions import REFERENCE_CELSIUS
from cellwright.refusal import Refusal
from cellwright_fmu.description import (
    build_description,
    identifier_of,
    model_description,
    variables_of_cell,
    variables_of_pack,
)
from cellwright_fmu.evidence import BEYOND_KELVIN
from cellwright_fmu.native import OF_PACKS, OF_PARTICLES, unit_code

MAGIC = b"cellwright-fmu/1"
NAME_BYTES = 32
UNKNOWN_SOC = 0.5  # what a unit starts at where no start is stated; its description says so
BETWEEN_KELVIN = 2.0  # largest distance of two temperatures of the tables between measured ones
BEYOND_STEPS = 3  # so many tables beyond either end, where resistances follow an Arrhenius law
ZIP_DATE = (1980, 1, 1, 0, 0, 0)


class Unit(NamedTuple):
    """A functional mock-up unit.

    files : dict, path within the archive → bytes. token : its instantiation token.
    identifier : of the model in C. binary : the platform it is built for, None of sources only.
    variables : tuple of Variable.
    notes : sentences on what was left out or assumed.
    """

    files: dict
    token: str
    identifier: str
    binary: str | None
    variables: tuple
    notes: tuple


def single(model):
    """A wiring of one cell.

    Parameters
    ----------
    model : dict of schema cellwright-model/2.
    """
    return Wiring(model["cell"], "series", (model["cell"],), (0.0,), (0.0,))


def unit_temperatures(models):
    """Temperatures of the tables of some cells [degC], None where parameters know no temperature.

    The measured ones, and so many between and beyond them that a linear course over 1/T of the
    logarithm of each parameter follows the models' own laws.

    Parameters
    ----------
    models : list of dict of schema cellwright-model/2.
    """
    conditions = [c for model in models for c in member_of(model)["conditions"]]
    curves = [table for model in models for table in model["ocv"]]
    stated = {celsius_of(c["ambient_temperature_celsius"]) for c in (*conditions, *curves)}
    measured = sorted(value for value in stated if np.isfinite(value))
    if not measured:
        return None
    energies = [condition.get("activation_energy_joule_per_mole") for condition in conditions]
    reach = [condition.get("activation_energy_kelvin") for condition in conditions]
    if len(measured) == 1 and set(energies) == {0.0} and set(reach) == {None}:
        return measured
    warmed = max(kelvin or 0.0 for kelvin in reach)
    near = (measured[0] - warmed, measured[-1] + warmed)
    inner = np.arange(measured[0], measured[-1], BETWEEN_KELVIN)
    ends = [
        *np.linspace(measured[0] - BEYOND_KELVIN, measured[0], BEYOND_STEPS, endpoint=False),
        *np.linspace(measured[-1] + BEYOND_KELVIN, measured[-1], BEYOND_STEPS, endpoint=False),
    ]
    return sorted({round(float(value), 6) for value in (*measured, *near, *inner, *ends)})


def unit_of(pack, *, alone, points, largest_step_second, documents):
    """The unit of a cell or of a pack, each cell as its chosen member.

    Parameters
    ----------
    pack : PackModel; a cell alone may be chosen to be its particle.
    alone : whether the unit is of a single cell, with scalars instead of arrays.
    points : size of the SoC grid of its tables. largest_step_second : longest internal step [s].
    documents : dict, path within the archive → bytes, laid beside.

    Returns
    -------
    unit : Unit.

    Raises
    ------
    Refusal : a start that is not within 0 to 1, an internal step that is not above zero, or as
        `packs.cells.pack_cells` and `packs.network.network_of`.
    """
    if not 0 < largest_step_second < np.inf:
        raise Refusal(f"longest internal step is {largest_step_second:g} s, wanted above zero")
    start = [UNKNOWN_SOC if soc is None else float(soc) for soc in pack.initial_soc]
    if not all(0.0 <= soc <= 1.0 for soc in start):
        raise Refusal(f"SoC at the start is {start}, wanted 0 to 1")
    is_particle = alone and pack.models[0]["chosen"] == particle.NAME
    if is_particle:
        code, arrays = unit_code(OF_PARTICLES), arrays_of_particle(pack)
        celsius = arrays["temperature_celsius"].tolist()
    else:
        celsius = unit_temperatures(pack.models)
        cells = pack_cells(pack.models, temperature_celsius=celsius, points=points)
        code, arrays = unit_code(OF_PACKS), arrays_of(pack, cells)
    ambient = _ambient(celsius)
    tables = arrays | {
        "initial_soc": np.array(start, float),
        "settings": np.array([ambient, largest_step_second], float),
    }
    about = {"ambient_celsius": ambient, "largest_step_second": largest_step_second}
    if alone:
        warm = pack.thermal[0] is not None
        variables = variables_of_cell(initial_soc=start[0], cell_is_warm=warm, **about)
    else:
        variables = variables_of_pack(initial_soc=start, cells=pack.cells, **about)
    files, token = _files(pack, variables, tables, code, alone)
    binary, notes = code[-1], tuple(_notes(pack, celsius, code[-1], is_particle))
    identifier = identifier_of(pack.wiring.name)
    return Unit(files | documents, token, identifier, binary and binary[0], tuple(variables), notes)


def _files(pack, variables, tables, code, alone):
    """Files of the unit, and its token: the hash of what it is described by and made of."""
    sources, compiled, binary = code
    name, sentence, body = pack.wiring.name, _sentence(pack, alone), _body(tables)
    plain = model_description(name, "", variables, description=sentence)
    parts = [plain, body, *(content for _, content in sorted(sources.items()))]
    token = hashlib.sha256(b"\0".join(parts)).hexdigest()
    files = {
        "modelDescription.xml": model_description(name, token, variables, description=sentence),
        "resources/battery.bin": MAGIC + token.encode() + body,
        "sources/buildDescription.xml": build_description(name, compiled),
        **{f"sources/{source}": content for source, content in sources.items()},
    }
    if binary:
        platform, suffix, content = binary
        files[f"binaries/{platform}/{identifier_of(name)}{suffix}"] = content
    return files, token


def arrays_of(pack, cells):
    """What the C code knows of a pack, as native/fmu/battery.c reads it, by name.

    Parameters
    ----------
    pack : PackModel. cells : PackCells of its models.

    Returns
    -------
    arrays : dict, name → array of float. `tables`: all look-up tables one after the other;
        `quantities`: (3, q), where in them each quantity begins, how far it is from cell to cell,
        and 1 where it is linear in 1/T.
    """
    network = network_of(pack.wiring, cells.capacity_ampere_hour)
    sensed = sensed_element(pack.wiring, network)
    tables = [np.ascontiguousarray(cells.tables[name]) for name in TABLES]
    begin = np.cumsum([0, *(table.size for table in tables)])
    places = [
        (first + entry * table.shape[3], table.shape[2] * table.shape[3], name in STRAIGHT)
        for first, table, name in zip(begin, tables, TABLES, strict=False)
        for entry in range(table.shape[2])
    ]
    wired = ("connection", "first", "member", "contact_ohm", "link_ohm", "share")
    of_cells = ("temperature_celsius", "capacity_ampere_hour", "near_end_soc")
    return {
        "sizes": kernel_sizes(cells, network, "first_order", sensed, Keep()).astype(float),
        "room": np.array([work_room(cells, network)], float),
        "tolerances": np.array([TOLERANCE_VOLT, SAME_SOC]),
        "quantities": np.array(places, float).T,
        "tables": np.concatenate([table.ravel() for table in tables]),
        **{name: np.asarray(getattr(cells, name), float) for name in of_cells},
        **{name: np.asarray(getattr(network, name), float) for name in wired},
        **_thermal(pack.thermal),
    }


def arrays_of_particle(pack):
    """What the C code knows of a cell that is a particle, as native/particle_cell.c reads it.

    Parameters
    ----------
    pack : PackModel of one cell.

    Returns
    -------
    arrays : dict, name → array of float.
    """
    (model,) = pack.models
    cell = particle.of_document(model["particle"])
    return {
        **particle.kernel_arrays(cell),
        "temperature_celsius": cell.celsius,
        "capacity_ampere_hour": np.array([model["capacity_ampere_hour"]]),
        **_thermal(pack.thermal),
    }


def _thermal(constants):
    """Thermal constants of all cells; none where one cell has none."""
    if None in constants:
        return {}
    return {name: np.array([getattr(one, name) for one in constants]) for name in OF_CELL}


def _ambient(celsius):
    """What a unit starts at: 25 °C, or the nearest temperature of its tables."""
    if celsius is None or len(celsius) == 1:
        return REFERENCE_CELSIUS if celsius is None else celsius[0]
    return float(np.clip(REFERENCE_CELSIUS, celsius[0], celsius[-1]))


def _sentence(pack, alone):
    if alone:
        model = pack.models[0]
        size = capacity_of(model, member_of(model))
        kind = "equivalent circuit"
        if model["chosen"] == particle.NAME:
            kind = "one particle with charge transfer,"
        return (
            f"Lithium-ion cell {model['cell']}, {size:.4g} Ah, {kind} "
            f"{model['chosen']}; current positive on charge"
        )
    return (
        f"Pack {pack.wiring.name} of {len(pack.models)} lithium-ion cells; "
        "current positive on charge"
    )


def _notes(pack, celsius, binary, is_particle):
    unknown = [c for c, soc in zip(pack.cells, pack.initial_soc, strict=True) if soc is None]
    if unknown:
        yield f"no start is stated of {', '.join(unknown)}: initial_soc is {UNKNOWN_SOC:g}, set it"
    if is_particle:
        yield (
            "it runs as P, one particle; how its OCV lies on the SoC is that of the temperature at "
            "the start"
        )
    elif celsius is None or len(celsius) == 1:
        yield "the model knows one temperature: that of the surroundings changes nothing"
    if binary is None:
        yield "no C compiler was found: the unit holds sources only"


def _body(tables):
    """Arrays as the C code reads them: number, name and size of each, then all numbers."""
    parts = [struct.pack("<q", len(tables))]
    for name, values in tables.items():
        if len(name) >= NAME_BYTES:
            raise Refusal(f"the name {name} of a table is too long")
        parts.append(name.encode().ljust(NAME_BYTES, b"\0") + struct.pack("<q", np.size(values)))
    parts += [np.ascontiguousarray(values, "<f8").tobytes() for values in tables.values()]
    return b"".join(parts)


def archive(files):
    """The bytes of a .fmu file: the same for the same files.

    Parameters
    ----------
    files : dict, path within the archive → bytes.
    """
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, compresslevel=6) as packed:
        for path, content in sorted(files.items()):
            entry = zipfile.ZipInfo(path, ZIP_DATE)
            entry.compress_type, entry.create_system = zipfile.ZIP_DEFLATED, 3
            entry.external_attr = 0o644 << 16
            packed.writestr(entry, content)
    return buffer.getvalue()
