"""Artefacts of one cell for the model of another: OCV curves, capacities, peaks, models."""

from typing import NamedTuple

from cellwright.bias.features import Shown, onset_resistances
from cellwright.bias.ways import Scored
from cellwright.health.peaks.over_temperature import Charge
from cellwright.records.basis import Lender
from cellwright.records.conditions import in_first_checkup
from cellwright.records.facts import CellFacts
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
    test = facts.of_artefact(about)
    return {n: getattr(test, n) for n in ("test", "ambient_temperature_celsius", "cycle")}


def lenders(ocv_paths, capacity_paths, references) -> list[Lender]:
    """Lenders: the cells of the artefacts with their curves and capacities."""
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


def models_without(paths) -> dict:
    """Models that were identified without one temperature, by that temperature [°C]."""
    models = artefact.load_all(paths)
    return {float(about["wildcards"]["celsius"]): model for model, about in models}


def charges(pairs, celsius) -> list[Charge]:
    """Charges for dQ/dV from their curves and peaks; `celsius`: chamber temperature, by test."""
    names = ("voltage_volt", "dq_dv_ampere_hour_per_volt")
    return [
        Charge(test, celsius[test], peaks["c_rate"][0], *[curve[name] for name in names])
        for curve, peaks, about in artefact.load_together(pairs)
        for test in [about["wildcards"]["test"]]
    ]


class ShownPaths(NamedTuple):
    """Paths of what a cell shows: peaks, curves of dQ/dV, onset resistances, capacities."""

    peaks: list
    curves: list
    onset: list
    capacity: list


def shown_paths(inputs, folder="", prefix="") -> ShownPaths:
    """Paths in a job's inputs, of names that begin with `prefix`, of those in `folder`."""
    named = (getattr(inputs, prefix + name) for name in ShownPaths._fields)
    return ShownPaths(*([path for path in paths if folder in path] for paths in named))


def cell_shows(basis_path, model_path, paths, references) -> Shown:
    """What a cell shows at its first check-up; `model_path`: None without a model of its own.

    `paths` : ShownPaths.
    """
    # Without a basis a cell shows nothing: SoC, and with it every feature, refers to it.
    basis = artefact.load(basis_path)
    models = artefact.load_all([model_path] if model_path else [])
    peaks, onset, capacity = (_first_checkup(getattr(paths, name)) for name in SHOWN_TABLES)
    curve_of = dict(zip(map(_name_of, paths.curves), paths.curves, strict=True))
    pairs = [(curve_of[about["wildcards"]["test"]], columns) for columns, about in peaks]
    return Shown(
        cell=basis["cell"],
        marked=basis["cell"] in references,
        capacity_ampere_hour=basis["capacity_ampere_hour"],
        model=models[0][0] if models else None,
        peaks=_rows(peaks),
        onset_ohm=onset_resistances(_rows(onset), "discharge"),
        begin_ohm=onset_resistances(_rows(onset), "charge"),
        capacities=tuple(_rows(capacity)),
        charges=tuple(_charge(path, columns) for path, columns in pairs if len(columns["c_rate"])),
        capacity_std_ampere_hour=basis.get("capacity_std_ampere_hour"),
    )


SHOWN_TABLES = ("peaks", "onset", "capacity")


def _name_of(path):
    return path.rpartition("/")[2].removesuffix(".parquet")


def _first_checkup(paths) -> list:
    """(columns, about) of the artefacts with content of the earliest check-up."""
    loaded = artefact.load_all(paths)
    # Features of an aged cell beside those of a fresh one would tell its age, not its making.
    first = in_first_checkup([facts.of_artefact(about).cycle for _, about in loaded])
    return [one for one, young in zip(loaded, first, strict=True) if young]


def _rows(loaded) -> list[dict]:
    return [_dated(about) | row for columns, about in loaded for row in artefact.rows(columns)]


def _charge(path, peaks) -> dict:
    curve = artefact.load(path)
    names = ("voltage_volt", "charge_ampere_hour")
    return {"c_rate": float(peaks["c_rate"][0])} | {name: curve[name] for name in names}


def peer_paths(inputs):
    """(basis, model, ShownPaths) of each peer that has a model, of `bias_correction`."""
    pairs = zip(inputs.peer_basis, inputs.peer_models, strict=True)
    # A peer without a model cannot be the reference, nor does it calibrate anything.
    usable = [pair for pair in pairs if artefact.read_about(pair[1])["reason"] is None]
    for basis, model in usable:
        folder = f"/{_cell_of(basis)}/"
        yield basis, model, shown_paths(inputs, folder, "peer_")


def _cell_of(path):
    return path.rpartition("/")[2].removesuffix(".json")


def judged_cells(inputs, references, cells) -> list[Scored]:
    """Cells with a model of their own, the model in use, and their tests that no fit has seen.

    `cells` : facts of each, by name.
    """
    own = {_cell_of(path): path for path in inputs.own}
    found = []
    for basis, model, paths in peer_paths(inputs):
        cell = _cell_of(basis)
        series = [path for path in inputs.series if f"/{cell}/" in path]
        # Identified is not finished: without a model in use others have nothing to be judged by.
        in_use = artefact.load_first([own[cell]])
        if in_use is not None:
            shown = cell_shows(basis, model, paths, references)
            tests = tuple(facts.tests(series))
            found.append(Scored(shown, in_use, CellFacts(**cells[cell]), tests))
    return found
