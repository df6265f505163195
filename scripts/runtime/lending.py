"""Artefacts of one cell for the model of another: OCV curves, capacities, peaks, models."""

from statistics import median

from cellwright.identification.borrowed import Shown
from cellwright.laws.peaks import Charge
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


FULL_SOC = 0.95


def cell_shows(basis_path, model_path, peak_paths, onset_paths, references) -> Shown:
    """Basis, model, peaks and onset resistance of a cell; `model_path`: None without a model."""
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


def peer_paths(inputs):
    """(basis, model, peaks, onset) paths of each peer that has a model, of `bias_correction`."""
    pairs = zip(inputs.peer_basis, inputs.peer_models, strict=True)
    usable = [pair for pair in pairs if artefact.read_about(pair[1])["reason"] is None]
    for basis, model in usable:
        folder = f"/{basis.split('/')[-1].removesuffix('.json')}/"
        peaks = [path for path in inputs.peer_peaks if folder in path]
        yield basis, model, peaks, [path for path in inputs.peer_onset if folder in path]


def _onset(paths) -> dict:
    """Median resistance [ohm] at the onset of discharges from full, by delay [s]."""
    tables = [artefact.rows(columns) for columns, _ in artefact.load_all(paths)]
    by_delay = {}
    for row in (row for rows in tables for row in rows):
        if row["direction"] == "discharge" and row["soc"] > FULL_SOC:
            by_delay.setdefault(row["delay_second"], []).append(row["resistance_ohm"])
    return {delay: median(values) for delay, values in by_delay.items()}
