"""Every figure of a cell or group, drawn from the artefacts that the workflow names for it."""

from functools import cache
from pathlib import Path
from types import SimpleNamespace

from figures import (
    ageing,
    campaign,
    capacity,
    degradation,
    effects,
    health,
    impedance,
    models,
    ocv,
    packs,
    peaks,
    relaxation,
    resistance,
    temperature,
    wiring,
)
from runtime import artefact, provenance
from runtime.artefact import load, load_some


def part_of(job, name, drawn):
    """The part of a job that makes one figure, in the form of Snakemake's script object.

    So a figure carries the provenance of its own artefacts alone, and a reason why it could not be
    drawn is its own. `drawn` is what `params.figures` of the rule says of the figure.
    """
    parts = drawn["inputs"].values()
    paths = [path for part in parts for path in ([part] if isinstance(part, str) else part)]
    wildcards = {job.params.owner_kind: job.wildcards.owner}
    # A figure of a whole cell has no test, and its provenance names none.
    wildcards |= {"test": drawn["test"]} if drawn["test"] else {}
    shared = {
        key: value for key, value in job.params.items() if key in ("code", "contract", "rule")
    }
    return SimpleNamespace(
        rule=job.rule,
        wildcards=wildcards,
        input=paths,
        output=[str(Path(job.output[0]) / f"{name}.svg")],
        params=shared | {"figure": drawn["kind"]} | drawn["settings"],
        log=job.log,
    )


def located(drawn, inputs):
    """The same figure, drawn from copies where its artefacts lie in object storage."""
    copies = _by_name(tuple(inputs))
    parts = {
        name: copies[part] if isinstance(part, str) else [copies[path] for path in part]
        for name, part in drawn["inputs"].items()
    }
    return drawn | {"inputs": parts}


@cache
def _by_name(paths):
    return {provenance.name_of(path): path for path in paths}


def draw(drawn):
    """The figure of its kind.

    Raises
    ------
    Passed
        Where what it is drawn from is empty for a reason.
    """
    named = drawn["inputs"] | drawn["settings"] | {"test": drawn["test"]}
    return DRAW[drawn["kind"]](SimpleNamespace(**named))


def _rows(path):
    return artefact.rows(load(path))


def _together(first, second):
    return artefact.load_together(zip(first, second, strict=True))


def _ica_tracks(of):
    tracks = load(of.tracks)
    loaded = artefact.load_all(of.curves), artefact.load_all(of.lives)
    return peaks.draw_ica_tracks(tracks, peaks.curves_by_charge(*loaded, tracks))


def _ocv_temperature(of):
    columns = [load(path) for path in (of.bias, of.entropic, of.surface)]
    return ocv.draw_ocv_temperature(*columns, _rows(of.functions))


def _fast_charge(of):
    charges = [
        (load(series), load(steps), *pair)
        for series, steps, path in zip(of.series, of.steps, of.numbers, strict=True)
        for pair in artefact.load_all([path])
    ]
    if not charges:
        load(of.numbers[0])
    return ageing.draw_fast_charge(charges)


def _wiring(of):
    found = [content for content, _ in artefact.load_all(of.models)]
    return wiring.draw_wiring(of.rows[0]["group"], of.rows, found)


def _ways(of):
    rows = [row for columns, _ in load_some(of.ways) for row in artefact.rows(columns)]
    return packs.draw_ways(rows, of.cells)


# Each kind of figure, of its inputs and settings, and of the test if it is of one.
DRAW = {
    "records": lambda of: campaign.draw_records(_together(of.series, of.steps), of.total),
    "capacity": lambda of: capacity.draw_capacity(load_some(of.capacity)),
    "ocv": lambda of: ocv.draw_ocv(load_some(of.curves)),
    "resistance": lambda of: resistance.draw_resistance(load_some(of.pulses)),
    "ica": lambda of: capacity.draw_ica(
        _together(of.curves, of.peaks), _together(of.discharges, of.discharge_peaks)
    ),
    "ica_tracks": _ica_tracks,
    "impedance": lambda of: impedance.draw_nyquist(load_some(of.spectra)),
    "impedance_fit": lambda of: impedance.draw_impedance_fit(load_some(of.spectra)),
    "drt": lambda of: impedance.draw_relaxation_times(_together(of.curves, of.peaks)),
    "temperature": lambda of: temperature.draw_temperature_laws(load(of.points), _rows(of.laws)),
    "ocv_temperature": _ocv_temperature,
    "capacity_loss": lambda of: capacity.draw_capacity_loss(load(of.losses)),
    "ica_temperature": lambda of: capacity.draw_ica_temperature(
        load(of.curves), load(of.peaks), _rows(of.matches)
    ),
    "fast_charge": _fast_charge,
    "ageing": lambda of: ageing.draw_ageing(load(of.cycles), load(of.periods), *_rows(of.summary)),
    "fade": lambda of: health.draw_fade(load(of.course), *_rows(of.life)),
    "resistance_growth": lambda of: health.draw_resistance_growth(load(of.growth)),
    "arrhenius": lambda of: temperature.draw_arrhenius(_rows(of.points), _rows(of.laws)),
    "degradation_modes": lambda of: degradation.draw_modes(load(of.modes)),
    "health_from_peaks": lambda of: degradation.draw_peak_health(load(of.calibration), of.cell),
    "surface": lambda of: resistance.draw_resistance_surface(load(of.points), _rows(of.laws)),
    "relaxation": lambda of: relaxation.draw_relaxation(artefact.load_all(of.rests)),
    "polarisation": lambda of: relaxation.draw_polarisation(_rows(of.points), _rows(of.laws)),
    "parameters": lambda of: models.draw_parameters(load(of.model)),
    "compensation": lambda of: models.draw_compensation(_rows(of.fitted), _rows(of.proof)),
    "validation": lambda of: models.draw_validation(load(of.series), _rows(of.scores), of.test),
    "soc": lambda of: models.draw_soc(load(of.series), _rows(of.scores), of.test),
    "pack": lambda of: packs.draw_pack(load(of.series), _rows(of.scores), of.test),
    "wiring": _wiring,
    "pack_spread": lambda of: packs.draw_pack_spread(load(of.spread), *_rows(of.findings), of.test),
    "series_pack": lambda of: packs.draw_series_pack(_rows(of.waterfall), _rows(of.cells), of.test),
    "weakest": lambda of: packs.draw_weakest(load(of.series), of.test),
    "nested_pack": lambda of: packs.draw_nested_pack(load(of.series), _rows(of.scores), of.test),
    "ways": _ways,
    "effect_validation": lambda of: effects.draw_effect_validation(
        load(of.verdict), load(of.series)
    ),
    "effect_map": lambda of: effects.draw_residual_map(load(of.residuals)),
    "effect_evidence": lambda of: effects.draw_evidence(load(of.evidence)),
    "effect_ranking": lambda of: effects.draw_ranking(load(of.ranking)),
    "effect_branches": lambda of: effects.draw_effect_branches(load(of.verdict), load(of.series)),
    "effect_group_ranking": lambda of: effects.draw_group_ranking(load(of.ranking)),
}
