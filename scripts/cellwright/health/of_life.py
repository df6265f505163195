"""A life analysed whole: law, knee, remaining cycles, early rise, recovery, efficiency."""

import numpy as np

from cellwright.health import lives
from cellwright.health.fade import IMPOSSIBLE, LEVEL, courses, draws, fade_of, recovery
from cellwright.health.knee import knee_of
from cellwright.health.remaining import remaining_of
from cellwright.health.table import summary_and_columns
from cellwright.records import inputs
from cellwright.result import Result
from cellwright.settings import Health

HEALTH = Health()
DRAWS = 1000  # of laws, by their probability


def fade(records, cell, settings=None, *, check_ups=(), **changes):
    """Fade of a cell over its ageing records, or its check-ups: law, knee, and cycles that remain.

    records : list of (test, result of `ageing_cycles`, temperature): the last the result of
        `ageing_over_temperature`, a pair (summary, columns of its cycles), or None.
    settings : `settings.Health`.
    check_ups : result of `check_ups` or its rows: of a cell without ageing records (`records`
        empty) they are the life.

    Returns columns: one row a discharge [Ah], [Wh], [1]; laws: one row a law; summary: knee,
    remaining cycles and state of health at the last cycle. Raises Refusal: too few comparable
    discharges, or records that do not follow each other. Source: docs/health.md.
    """
    options = inputs.settings_of(Health, settings, changes)
    ready = []
    for test, cycles, temperature in records:
        facts = inputs.test_facts(test)
        columns = inputs.columns(getattr(cycles, "rows", cycles), *lives.COLUMNS)
        pair = summary_and_columns(temperature, "cycles")
        # A room that warms by a few kelvin over a year looks like a cell that ages more slowly.
        shift = {} if pair is None else lives.temperature_shift(*pair)
        about = facts.test, facts.cycle, facts.ambient_temperature_celsius
        ready.append(lives.AgeingRecord(*about, columns, shift))
    if ready:
        rated = inputs.cell_facts(cell).rated_capacity_ampere_hour
        life = lives.life_of(ready, rated_capacity_ampere_hour=rated)
    else:
        life = lives.life_of_check_ups(inputs.entries(getattr(check_ups, "rows", check_ups)))
    columns, laws, summary = analysed(life, **options._asdict())
    return Result({"columns": columns, "laws": laws}, {"summary": summary}, life.notes)


def analysed(life, *, end_of_life=HEALTH.end_of_life):
    """Law of the fade, knee, remaining cycles and what else a life tells.

    Parameters
    ----------
    life : lives.Life. end_of_life : share of the capacity at the start [1].

    Returns
    -------
    columns : (n,) one entry a discharge, as in artefact `fade_course`.
    laws : list of dict, rows of artefact `fade`.
    summary : dict, the row of artefact `life`.

    Raises
    ------
    Refusal : fewer than eight comparable discharges.
    """
    fade = fade_of(life)
    drawn = draws(fade, count=DRAWS)
    knee = knee_of(fade, drawn)
    remaining = remaining_of(fade, drawn, knee, end_of_life=end_of_life)
    chosen = max(fade.log_evidence, key=fade.log_evidence.get)
    summary = {
        "source": life.source,
        "cycles": int(life.used.sum()),
        "left_out": int((~life.used).sum()),
        "last_cycle": float(life.cycle[-1]),
        "throughput_ampere_hour": float(life.throughput_ampere_hour[-1]),
        "law": chosen,
        **_course_numbers(fade, drawn),
        **{name: remaining.pop(name) for name in ("soh", "soh_std")},
        **knee,
        **remaining,
        **_recoveries(fade),
        **_efficiencies(life),
    }
    return _columns(life, fade, drawn), _law_rows(fade, chosen), summary


def _course_numbers(fade, drawn):
    """Capacity at the start, fade now, early rise, each with its error."""
    scale, last = fade.points.scale_ampere_hour, fade.points.cycle[-1]
    share = np.linspace(fade.points.share[0], 1.0, 101)
    course = courses(drawn, share)
    # Over the last twentieth of the life: where it stands now.
    pace = 100 * (course[:, -6] - course[:, -1]) / course[:, 0] / (share[-1] - share[-6])
    per_hundred = pace * 100 / last
    rise = course.max(axis=1) / course[:, 0] - 1
    told = np.quantile(rise, (1 - LEVEL) / 2) > 5e-4  # of the capacity: a smaller rise is none
    top = share[np.argmax(course, axis=1)] * last
    return {
        "start_ampere_hour": float(scale * np.median(course[:, 0])),
        "start_std_ampere_hour": float(scale * np.std(course[:, 0])),
        "now_ampere_hour": float(scale * np.median(course[:, -1])),
        "fade_percent_per_100_cycles": float(np.median(per_hundred)),
        "fade_std_percent_per_100_cycles": float(np.std(per_hundred)),
        "early_rise_percent": float(100 * np.median(rise)) if told else 0.0,
        "early_rise_std_percent": float(100 * np.std(rise)),
        "early_rise_cycle": float(np.median(top)) if told else np.nan,
    }


def _recoveries(fade):
    """How many rests brought capacity back, by how much at most, and for how many cycles."""
    returned = recovery(fade)
    told = np.isfinite(fade.recovery_cycles)
    return {
        "pauses": int(fade.points.since_pause.shape[1]),
        "recovery_percent": float(100 * returned.max()) if told else 0.0,
        "recovery_cycles": fade.recovery_cycles,
        "recovery_log_evidence": fade.recovery_evidence,
    }


def _efficiencies(life):
    """Energy and efficiencies over the first and the last twentieth of a life."""
    used = np.flatnonzero(life.used)
    some = max(len(used) // 20, 3)
    ends = {"start": used[:some], "end": used[-some:]}
    found = {}
    for name in ("energy_watt_hour", "energy_efficiency", "coulombic_efficiency"):
        values = getattr(life, name)
        for end, rows in ends.items():
            known = values[rows][np.isfinite(values[rows])]
            found[f"{name}_{end}"] = float(np.median(known)) if len(known) else np.nan
    return found


def _columns(life, fade, drawn):
    """One entry a discharge: measured, and the law at its cycle with an interval."""
    points = fade.points
    share = life.cycle / points.cycle[-1]
    scale = points.scale_ampere_hour
    low, middle, high = np.quantile(
        courses(drawn, share), [(1 - LEVEL) / 2, 0.5, (1 + LEVEL) / 2], axis=0
    )
    columns = {name: getattr(life, name) for name in life._fields[:-2]}
    return columns | {
        "law_ampere_hour": scale * middle,
        "law_lower_ampere_hour": scale * low,
        "law_upper_ampere_hour": scale * high,
        "recovered_ampere_hour": scale * np.interp(life.cycle, points.cycle, recovery(fade)),
    }


def _law_rows(fade, chosen):
    """One row a law: its log evidence against the best, and the terms of its best candidate."""
    best = max(fade.log_evidence.values())
    total = sum(np.exp(value - best) for value in fade.log_evidence.values())
    rows = []
    for name, value in fade.log_evidence.items():
        mine = [one for one in fade.candidates if one.law == name]
        top = max(mine, key=lambda one: one.weight) if mine else None
        rows.append(
            {
                "law": name,
                "chosen": name == chosen,
                "log_evidence": float(max(value - best, IMPOSSIBLE)),
                "probability": float(np.exp(value - best) / total),
                "formula": _formula(top, fade.points) if top else "",
                "noise_correlation": float(top.correlation) if top else np.nan,
                "early_course_log_evidence": fade.early,
            }
        )
    return rows


def _formula(candidate, points):
    """A law in words of its terms: capacity [Ah] over cycle n."""
    scale, last = points.scale_ampere_hour, points.cycle[-1]
    parts = []
    for term, value in zip(candidate.terms, candidate.values, strict=False):
        size = f"{scale * value:+.5g}"
        if term.kind == "hinge":
            width = f"{term.second * last:.3g}"
            parts.append(f"{size} bend((n - {term.first * last:.4g})/{last:.4g}, width {width})")
        elif term.kind == "early":
            parts.append(f"{size} exp(-n/{term.first * last:.3g})")
        elif term.first == 0:
            parts.append(f"{scale * value:.5g}")
        else:
            parts.append(f"{size} (n/{last:.4g})^{term.first:.2g}")
    return " ".join(parts)
