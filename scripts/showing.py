"""What each cell of a type shows of itself, for the model of one that was never pulsed."""

from statistics import median

import artefact
from cellwright.models.borrowed import Shown

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
