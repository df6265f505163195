"""Knee of a life: whether its fade turns steeper within a short part of it, and where."""

import numpy as np

from cellwright.health.fade import LEAST_LOSS, LEVEL, SMOOTH, TWO_STAGE, courses, law_at

LEAST_LOG_EVIDENCE = 5.0  # 150 to 1, that two stages are likelier than every smooth law
LEAST_RATIO = 2.0  # of the fade after a knee to that before it
PLACES = ("knee_cycle", "knee_lower_cycle", "knee_upper_cycle", "knee_chord_cycle")


def knee_of(fade, drawn):
    """Knee of a life, told only by evidence.

    A knee is a place beyond which capacity fades at least twice as fast as before it, within a
    tenth of the life; 2 % of the capacity must be lost before it (else it is where an early rise
    ends) and 2 % beyond it. Two straight (or
    gently bent) stages must be likelier than every smooth law (linear, root, power, gradual
    acceleration), by a log evidence of 5, and 95 % of the two-stage laws that the data allow must
    turn so. A life that bends gradually has no knee.

    Parameters
    ----------
    fade : fade.Fade. drawn : fade.Draws of it.

    Returns
    -------
    knee : dict, columns of the row of artefact `life`; NaN where none is told. knee_cycle,
        knee_lower_cycle, knee_upper_cycle : middle of the bend, and its 95 % interval, which holds
        the bend from 5 to 95 % of its change of slope and the point by the other definition.
        knee_chord_cycle : that point, furthest from the chord of the course (Kneedle). knee_ratio :
        fade after over before. knee_log_evidence : of two stages against the best smooth law.
        knee_reason : why none.

    Source: two lines with a smooth bend: P. Fermín-Cueto et al., Energy and AI 1 (2020) 100006,
    after D. W. Bacon, D. G. Watts, Biometrika 58 (1971) 525; furthest from the chord: V. Satopää
    et al., ICDCS Workshops 2011, 166 (Kneedle); definitions compared: P. M. Attia et al.,
    J. Electrochem. Soc. 169 (2022) 060517.
    """
    smooth = max(fade.log_evidence[name] for name in SMOOTH if name in fade.log_evidence)
    evidence = fade.log_evidence.get(TWO_STAGE, -np.inf) - smooth
    bent = [k for k, law in enumerate(drawn.laws) if law == TWO_STAGE]
    if evidence < LEAST_LOG_EVIDENCE or len(bent) < len(drawn.laws) // 2:
        word = f"two stages are no likelier than a smooth law (log evidence {evidence:.1f})"
        return _none(evidence, word)
    ratios, before, losses = np.array([_turn(drawn.terms[k], drawn.values[k]) for k in bent]).T
    lost = (before >= LEAST_LOSS) & (losses >= LEAST_LOSS)
    # Some of the laws drawn turn little, or where nothing is lost: how many do not?
    certainty = float(np.mean((ratios >= LEAST_RATIO) & lost))
    if certainty < LEVEL:
        ratio = float(np.median(ratios))
        if ratio < LEAST_RATIO:
            word = f"the fade changes by a factor of {ratio:.2g}, less than {LEAST_RATIO:g}"
        elif np.median(before) < LEAST_LOSS:
            word = f"the fade begins there: only {100 * np.median(before):.1f} % lost before"
        elif np.median(losses) < LEAST_LOSS:
            word = f"{100 * np.median(losses):.1f} % lost beyond a possible knee: too early to tell"
        else:
            word = f"only {100 * certainty:.0f} % of the laws that fit turn steeper by two"
        return _none(evidence, word)
    places = np.array([_place(drawn.terms[k]) for k in bent])
    random = np.random.default_rng(0)
    # Of a smooth bend the slope changes from 5 to 95 % within two widths on each side.
    spread = 2 * places[:, 1] + 0.01  # half a step of the positions tried
    at = (places[:, 0] + spread * random.uniform(-1, 1, len(places))) * fade.points.cycle[-1]
    chord = _furthest_from_chord(fade, drawn)
    lower, upper = np.quantile(at, [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    middle, last = float(np.median(places[:, 0]) * fade.points.cycle[-1]), fade.points.cycle[-1]
    found = (middle, float(min(lower, chord)), float(min(max(upper, chord), last)), chord)
    return _row(found, float(np.median(ratios)), evidence, "")


def _none(evidence, reason):
    return _row([np.nan] * len(PLACES), np.nan, evidence, f"no knee: {reason}")


def _row(places, ratio, evidence, reason):
    told = {"knee_ratio": ratio, "knee_log_evidence": float(evidence), "knee_reason": reason}
    return dict(zip(PLACES, places, strict=True)) | told


def _place(terms):
    """Position and width of a law's bend, shares of the life."""
    hinge = next(term for term in terms if term.kind == "hinge")
    return hinge.first, hinge.second


def _turn(terms, values):
    """Fade after the bend over that before it, the loss before it and beyond it [1]."""
    place, _ = _place(terms)
    # A twentieth of the life to both sides the slope is that of the stage, however wide the bend.
    low, high = max(place - 0.05, 1e-3), min(place + 0.05, 1.0)
    at = np.array([0.0, low / 2, low, high, 0.99, 1.0])
    course = law_at(terms, values, at)
    mean = (course[1] - course[-1]) / (1 - low / 2)
    before = (course[1] - course[2]) / (low / 2)
    first, share = (course[3], 1 - high) if high < 0.98 else (course[4], 0.01)
    after = (first - course[-1]) / share
    # Where nearly nothing was lost before, half of the mean fade counts instead: no knee is there.
    size = max(before, 0.5 * mean, 1e-12)
    return after / size, course[0] - course[2], course[2] - course[-1]


def _furthest_from_chord(fade, drawn):
    """Cycle at which the median course lies furthest above its chord."""
    share = np.linspace(fade.points.share[0], 1.0, 400)
    median = np.median(courses(drawn, share), axis=0)
    along = (share - share[0]) / (1 - share[0])
    above = median - (median[0] + along * (median[-1] - median[0]))
    return float(share[np.argmax(above)] * fade.points.cycle[-1])
