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


def part_of(job, name, drawn):
    """The part of a job that makes one figure, in the form of Snakemake's script object.

    So a figure carries the provenance of its own artefacts alone, and a reason why it could not be
    drawn is its own. `drawn` is what `params.figures` of the rule says of the figure.
    """
    paths = [path for part in drawn["inputs"].values() for path in _listed(part)]
    wildcards = {job.params.owner_kind: job.wildcards.owner}
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


def _listed(part):
    return [part] if isinstance(part, str) else part


def draw(drawn):
    """The figure of its kind.

    Raises
    ------
    Passed
        Where what it is drawn from is empty for a reason.
    """
    return DRAW[drawn["kind"]](
        SimpleNamespace(**drawn["inputs"], **drawn["settings"]), drawn["test"]
    )


def _table(path):
    return artefact.rows(artefact.load(path))


def _records(of, _):
    records = artefact.load_together(zip(of.series, of.steps, strict=True))
    return campaign.draw_records(records, of.total)


def _ica(of, _):
    return capacity.draw_ica(artefact.load_together(zip(of.curves, of.peaks, strict=True)))


def _ica_tracks(of, _):
    tracks = artefact.load(of.tracks)
    loaded = artefact.load_all(of.curves), artefact.load_all(of.lives)
    return peaks.draw_ica_tracks(tracks, peaks.curves_by_charge(*loaded, tracks))


def _drt(of, _):
    pairs = artefact.load_together(zip(of.curves, of.peaks, strict=True))
    return impedance.draw_relaxation_times(pairs)


def _ica_temperature(of, _):
    curves, peaks = artefact.load(of.curves), artefact.load(of.peaks)
    return capacity.draw_ica_temperature(curves, peaks, _table(of.matches))


def _ocv_temperature(of, _):
    columns = [artefact.load(path) for path in (of.bias, of.entropic, of.surface)]
    return ocv.draw_ocv_temperature(*columns, _table(of.functions))


def _fast_charge(of, _):
    charges = [
        (artefact.load(series), artefact.load(steps), *pair)
        for series, steps, path in zip(of.series, of.steps, of.numbers, strict=True)
        for pair in artefact.load_all([path])
    ]
    if not charges:
        artefact.load(of.numbers[0])
    return ageing.draw_fast_charge(charges)


def _ageing(of, _):
    (summary,) = _table(of.summary)
    return ageing.draw_ageing(artefact.load(of.cycles), artefact.load(of.periods), summary)


def _health_from_peaks(of, _):
    return degradation.draw_peak_health(artefact.load(of.calibration), of.cell)


def _fade(of, _):
    (life,) = _table(of.life)
    return health.draw_fade(artefact.load(of.course), life)


def _surface(of, _):
    return resistance.draw_resistance_surface(artefact.load(of.points), _table(of.laws))


def _validation(of, test):
    return models.draw_validation(artefact.load(of.series), _table(of.scores), test)


def _soc(of, test):
    return models.draw_soc(artefact.load(of.series), _table(of.scores), test)


def _pack(of, test):
    return packs.draw_pack(artefact.load(of.series), _table(of.scores), test)


def _wiring(of, _):
    found = [content for content, _ in artefact.load_all(of.models)]
    return wiring.draw_wiring(of.rows[0]["group"], of.rows, found)


def _pack_spread(of, test):
    (findings,) = _table(of.findings)
    return packs.draw_pack_spread(artefact.load(of.spread), findings, test)


def _series_pack(of, test):
    return packs.draw_series_pack(_table(of.waterfall), _table(of.cells), test)


def _nested_pack(of, test):
    return packs.draw_nested_pack(artefact.load(of.series), _table(of.scores), test)


def _ways(of, _):
    rows = [row for columns, _ in artefact.load_some(of.ways) for row in artefact.rows(columns)]
    return packs.draw_ways(rows, of.cells)


def _effect_validation(of, _):
    return effects.draw_effect_validation(artefact.load(of.verdict), artefact.load(of.series))


def _effect_branches(of, _):
    return effects.draw_effect_branches(artefact.load(of.verdict), artefact.load(of.series))


# Each kind of figure: of its inputs (and settings) and the test, if it is of one.
DRAW = {
    "records": _records,
    "capacity": lambda of, _: capacity.draw_capacity(artefact.load_some(of.capacity)),
    "ocv": lambda of, _: ocv.draw_ocv(artefact.load_some(of.curves)),
    "resistance": lambda of, _: resistance.draw_resistance(artefact.load_some(of.pulses)),
    "ica": _ica,
    "ica_tracks": _ica_tracks,
    "impedance": lambda of, _: impedance.draw_nyquist(artefact.load_some(of.spectra)),
    "impedance_fit": lambda of, _: impedance.draw_impedance_fit(artefact.load_some(of.spectra)),
    "drt": _drt,
    "temperature": lambda of, _: temperature.draw_temperature_laws(
        artefact.load(of.points), _table(of.laws)
    ),
    "ocv_temperature": _ocv_temperature,
    "capacity_loss": lambda of, _: capacity.draw_capacity_loss(artefact.load(of.losses)),
    "ica_temperature": _ica_temperature,
    "fast_charge": _fast_charge,
    "ageing": _ageing,
    "fade": _fade,
    "resistance_growth": lambda of, _: health.draw_resistance_growth(artefact.load(of.growth)),
    "arrhenius": lambda of, _: temperature.draw_arrhenius(_table(of.points), _table(of.laws)),
    "degradation_modes": lambda of, _: degradation.draw_modes(artefact.load(of.modes)),
    "health_from_peaks": _health_from_peaks,
    "surface": _surface,
    "relaxation": lambda of, _: relaxation.draw_relaxation(artefact.load_all(of.rests)),
    "polarisation": lambda of, _: relaxation.draw_polarisation(_table(of.points), _table(of.laws)),
    "parameters": lambda of, _: models.draw_parameters(artefact.load(of.model)),
    "compensation": lambda of, _: models.draw_compensation(_table(of.laws), _table(of.proof)),
    "validation": _validation,
    "soc": _soc,
    "pack": _pack,
    "wiring": _wiring,
    "pack_spread": _pack_spread,
    "series_pack": _series_pack,
    "weakest": lambda of, test: packs.draw_weakest(artefact.load(of.series), test),
    "nested_pack": _nested_pack,
    "ways": _ways,
    "effect_validation": _effect_validation,
    "effect_map": lambda of, _: effects.draw_residual_map(artefact.load(of.residuals)),
    "effect_evidence": lambda of, _: effects.draw_evidence(artefact.load(of.evidence)),
    "effect_ranking": lambda of, _: effects.draw_ranking(artefact.load(of.ranking)),
    "effect_confounding": lambda of, _: effects.draw_confounding(artefact.load(of.confounding)),
    "effect_branches": _effect_branches,
    "effect_group_ranking": lambda of, _: effects.draw_group_ranking(artefact.load(of.ranking)),
}
