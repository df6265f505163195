"""What one cell lends another: OCV curves, capacities, and what each cell of a type shows."""

from statistics import median

from cellwright.identification.borrowed import Shown
from cellwright.records.basis import Lender
from runtime import artefact, facts


def curves(paths) -> list[dict]:
    """OCV curves of stage `ocv` or `ocv_rests` as plain lists with their facts and test."""
    return [
        _dated(about) | about["facts"] | {name: values.tolist() for name, values in columns.items()}
        for columns, about in artefact.load_all(paths)
    ]


def capacities(paths) -> list[dict]:
    """Rows of stage `capacity` with test, temperature and cycle."""
    loaded = artefact.load_all(paths)
    return [_dated(about) | row for columns, about in loaded for row in artefact.rows(columns)]


def _dated(about) -> dict:
    """Name, temperature and cycle of the test that an artefact is of."""
    known = facts.of_artefact(about)
    return {n: getattr(known, n) for n in ("test", "ambient_temperature_celsius", "cycle")}


def limits(params) -> dict:
    """Of the sheets what places a pulse test on the SoC scale: its start, rating and cut-offs."""
    names = ("rated_capacity_ampere_hour", "lower_cutoff_volt", "upper_cutoff_volt")
    return {name: params.cell[name] for name in names} | {
        "ambient_temperature_celsius": params.test["ambient_temperature_celsius"],
        "soc_at_start": params.test["soc"],
    }


def lenders(ocv_paths, capacity_paths, references) -> list[Lender]:
    """The cells that the artefacts belong to, as lenders."""
    owner = {path: artefact.read_about(path)["wildcards"]["cell"] for path in ocv_paths}
    owner |= {path: artefact.read_about(path)["wildcards"]["cell"] for path in capacity_paths}
    return [
        Lender(
            cell,
            cell in references,
            curves([path for path in ocv_paths if owner[path] == cell]),
            capacities([path for path in capacity_paths if owner[path] == cell]),
        )
        for cell in dict.fromkeys(owner.values())
    ]


def sentences(basis) -> list[str]:
    """What a reader must know of where capacity and OCV come from."""
    said = [f"SoC refers to {basis['capacity_ampere_hour']:.4g} Ah: {basis['capacity_source']}"]
    if basis["borrowed_from"]:
        said.append(f"OCV borrowed from {basis['borrowed_from']}: no usable slow test of its own")
    elif not basis["ocv"]:
        said.append("no OCV: no slow test of its own, and no cell of its type has one")
    tests = [curve["test"] for curve in basis["ocv"] if curve["branches"] == "rests"]
    if tests and not basis["borrowed_from"]:
        said.append(f"OCV from the rests of {', '.join(tests)}: no slow test of its or of its type")
    return said


FULL_SOC = 0.95


def shown(basis_path, model_path, peak_paths, onset_paths, references) -> Shown:
    """What one cell shows, from its artefacts; `model_path` is None for a cell without a model."""
    basis = artefact.load(basis_path)
    models = artefact.load_all([model_path] if model_path else [])
    peaks = [row for columns, _ in artefact.load_all(peak_paths) for row in artefact.rows(columns)]
    return Shown(
        cell=basis["cell"],
        marked=basis["cell"] in references,
        capacity_ampere_hour=basis["capacity_ampere_hour"],
        model=models[0][0] if models else None,
        peaks=peaks,
        onset_ohm=_onset(onset_paths),
    )


def by_cell(inputs):
    """(basis, model, peaks, onset) paths of each peer that has a model, of `bias_correction`."""
    pairs = zip(inputs.peer_basis, inputs.peer_models, strict=True)
    usable = [pair for pair in pairs if artefact.read_about(pair[1])["reason"] is None]
    for basis, model in usable:
        folder = f"/{basis.split('/')[-1].removesuffix('.json')}/"
        peaks = [path for path in inputs.peer_peaks if folder in path]
        yield basis, model, peaks, [path for path in inputs.peer_onset if folder in path]


def _onset(paths) -> dict:
    """Median resistance at the onset of discharges from full, by delay."""
    tables = [artefact.rows(columns) for columns, _ in artefact.load_all(paths)]
    found = {}
    for row in (row for rows in tables for row in rows):
        if row["direction"] == "discharge" and row["soc"] > FULL_SOC:
            found.setdefault(row["delay_second"], []).append(row["resistance_ohm"])
    return {delay: median(values) for delay, values in found.items()}
