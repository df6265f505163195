"""Which effects records cannot tell apart or cannot show, by structure and by sensitivity."""

from itertools import combinations, pairwise
from typing import NamedTuple

import numpy as np

from cellwright.effects.base import STAGES
from cellwright.effects.records import LOADED_C_RATE
from cellwright.effects.sensitivity import USUAL_NOISE, Model, at_starts_of, information, projected

AT_REST_C_RATE = 2.5 * LOADED_C_RATE  # an offset of the reading must not make a rest a load
STEADY_C_RATE = LOADED_C_RATE / 2  # within a rest, beside its middle
REST_SECOND = 60.0
DECIDED = 9.0  # chi-square between the two readings of a rest
FITTING = 9.0  # chi-square up to which the better of them is believed
SLACK = 0.15  # share of its size by which a fit of an imperfect model may miss an offset
FINEST_C_RATE = 1e-7  # no log resolves less


class Tie(NamedTuple):
    """Two explanations that records of current and voltage cannot tell apart.

    effect : id. partner : id, or the parameter that takes its place, in words. always : no fit
    weighs one against the other. exact : no test of the cell by this instrument ever does.
    same_size : both have one size, so that the bounds of one rule out the other. check : what
    does separate them, for people.
    """

    effect: str
    partner: str
    always: bool
    exact: bool
    same_size: bool
    check: str


STRUCTURAL = (
    Tie(
        *("lead_resistance", "the cell's own ohmic resistance", True, True, False),
        "a four-wire reading, an impedance spectrum, or the resistance against temperature",
    ),
    Tie(
        *("current_gain", "capacity_error", True, True, False),
        "a reference shunt, a second channel, or other cells of the same channel",
    ),
    Tie(
        *("current_offset", "leakage", True, False, True),
        "the logged current at commanded open circuit (free); where it is not logged there, a rest "
        "of 48 h, in which only a leak discharges the cell",
    ),
    Tie(
        *("voltage_offset", "ocv_shift", False, True, False),
        "a voltage reference in place of the cell",
    ),
    Tie(
        *("voltage_offset", "voltage_gain", False, True, False),
        "two voltage references in place of the cell",
    ),
    Tie(
        *("voltage_gain", "ocv_shift", False, True, False),
        "two voltage references in place of the cell",
    ),
)


class RestCurrent(NamedTuple):
    """Logged current at commanded open circuit.

    mean_ampere, std_ampere : and its standard deviation [A], NaN where nothing is told.
    rests : number of rests. told : the log can tell an offset. reason : why not, else "".
    """

    mean_ampere: float
    std_ampere: float
    rests: int
    told: bool
    reason: str


def with_partners(effect, tied, library, values):
    """The tie set of a verdict with the structural partners of all its members.

    Parameters
    ----------
    effect : id that was chosen. tied : ids found as good. library : dict of Effect by id.
    values : dict of the fitted values by id.parameter; a partner of the same size whose bounds
    exclude it (a leak that charges) is no partner.

    Returns
    -------
    tied : tuple of ids without `effect`, those found first.
    """
    found = list(tied)
    for one in (effect, *tied):
        found += _partners(one, library, values)
    return tuple(dict.fromkeys(other for other in found if other != effect))


def tie_of(effect, other=None):
    """The structural tie between two effects, in any order, or None.

    Parameters
    ----------
    effect, other : ids; without `other` the tie that makes an effect invisible.

    Returns
    -------
    tie : Tie or None.
    """
    for tie in STRUCTURAL:
        if {tie.effect, tie.partner} == {effect, other}:
            return tie
        if other is None and tie.effect == effect and tie.always and tie.exact:
            return tie
    return None


def _partners(effect, library, values):
    """Of the ties that no fit weighs; those that records may break are the search's to weigh."""
    pairs = [(t, t.effect, t.partner) for t in STRUCTURAL if t.always]
    pairs += [(t, t.partner, t.effect) for t in STRUCTURAL if t.always]
    found = [(t, other) for t, one, other in pairs if one == effect and other in library]
    return [other for t, other in found if not t.same_size or _may(effect, other, library, values)]


def _may(effect, other, library, values):
    """Whether the partner may have the size that was found."""
    size = values.get(library[effect].names[0])
    bounds = library[other].parameters[0]
    return size is None or bounds.lower <= size <= bounds.upper


def rest_current(stack, *, capacity_ampere_hour):
    """Mean logged current during rests.

    1. A rest is a stretch of 60 s or more within C/200 of its middle, itself below C/40.
    2. The mean of each rest is one reading; their spread is the uncertainty, with the resolution
       of the log beneath it.
    3. A rest that reads exactly zero throughout has its reading switched off, or resolves nothing
       so small: it does not count. Where no other is left, the log cannot tell.

    Parameters
    ----------
    stack : records.Stack. capacity_ampere_hour : of the cell [Ah].

    Returns
    -------
    found : RestCurrent.
    """
    rests = [stack.current_ampere[b:e] for b, e in _rests(stack, capacity_ampere_hour)]
    logged = [one for one in rests if np.any(one)]
    if not logged:
        zero = "the log reads exactly zero in every rest: switched off, or not resolved"
        reason = zero if rests else "no rest of a minute in the records"
        return RestCurrent(np.nan, np.nan, len(rests), False, reason)
    means = np.array([one.mean() for one in logged])
    weights = np.array([len(one) for one in logged], float)
    mean = float(np.average(means, weights=weights))
    spread = np.sqrt(np.average((means - mean) ** 2, weights=weights) / max(len(means) - 1, 1))
    own = np.sqrt(sum(one.var() * len(one) for one in logged)) / weights.sum()
    finest = max(_resolution(stack.current_ampere), FINEST_C_RATE * capacity_ampere_hour)
    std = float(np.sqrt(spread**2 + own**2 + finest**2 / 12.0))
    return RestCurrent(mean, std, len(logged), True, "")


def offset_or_leak(rest, *, size_ampere, std_ampere):
    """Which of the two it is, by the logged current at commanded open circuit.

    An offset of the reading stands in the log of a rest; a leak does not: it passes the ammeter by.

    Parameters
    ----------
    rest : RestCurrent. size_ampere : size of the offset, or of the leak, that explains the records
    [A]; either has the same sign. std_ampere : its standard deviation [A].

    Returns
    -------
    effect : "current_offset", "leakage" or None: it cannot be told. sentence : why.
    """
    if not rest.told:
        return None, f"the logged current at rest does not tell them apart: {rest.reason}"
    # ASSUME: the fit's size of an offset is right within 15 %.
    spread = np.sqrt(rest.std_ampere**2 + std_ampere**2 + (SLACK * size_ampere) ** 2)
    as_leak = (rest.mean_ampere / rest.std_ampere) ** 2
    as_offset = ((rest.mean_ampere - size_ampere) / spread) ** 2
    small = abs(rest.mean_ampere) < abs(size_ampere) / 4
    at = f"the log reads {1e3 * rest.mean_ampere:.3g} ± {1e3 * rest.std_ampere:.2g} mA at rest"
    if as_leak - as_offset > DECIDED and as_offset <= FITTING:
        return "current_offset", f"{at}: the reading itself is off"
    if as_offset > DECIDED and small:
        return "leakage", f"{at}: the charge passes the ammeter by"
    missing = f"{1e3 * size_ampere:.3g} mA that the records ask for"
    return None, f"{at}, which settles nothing about the {missing}"


def _rests(stack, capacity):
    """First and last-plus-one rows of steady stretches near zero."""
    low = np.abs(stack.current_ampere) <= AT_REST_C_RATE * capacity
    edges = np.flatnonzero(np.diff(np.r_[0, low.astype(int), 0]))
    starts = np.flatnonzero(stack.fresh)
    found = []
    for begin, end in edges.reshape(-1, 2):
        cuts = [begin, *starts[(starts > begin) & (starts < end)], end]
        found += list(pairwise(cuts))
    return [pair for pair in found if _steady(stack, *pair, capacity)]


def _steady(stack, begin, end, capacity):
    logged, second = stack.current_ampere[begin:end], stack.second[begin:end]
    near = np.abs(logged - np.median(logged)) <= STEADY_C_RATE * capacity
    return second[-1] - second[0] >= REST_SECOND and bool(near.mean() > 0.95)


def _resolution(logged):
    """Smallest step between two readings [A]."""
    steps = np.diff(np.unique(np.round(logged, 9)))
    return float(steps.min(initial=np.inf)) if len(steps) else 0.0


SAME_CLASS = 0.95  # canonical correlation above which two effects are one class
SHOWN = 1.0  # chi-square of a direction at plausible size, below which it is no part of an effect


class Visibility(NamedTuple):
    """Chi-square that each effect leaves at its plausible size, the nuisances having followed.

    fit, validation : dict by id: on the records of the fit; on those of the validation, where
    only the SoC at the start follows. unseen : ids below a gate on either side: not testable.
    """

    fit: dict
    validation: dict
    unseen: tuple


class Shown(NamedTuple):
    """Sensitivities of a case: Information of both stacks, Projection on that of the fit.

    held : ids of the effects whose starts are each a direction of its own: no straight line in
    their size, or several forms.
    """

    fit: object
    validation: object
    projection: object
    held: tuple


def shown(case, library, model, *, spread=USUAL_NOISE):
    """What the records of a case can show of each effect of a library.

    Parameters
    ----------
    case : search.Case. library : dict of Effect by id. model : sensitivity.Model, with the SoC at
    the starts of the records of the fit. spread : noise.Noise.

    Returns
    -------
    shown : Shown.
    """
    inside = {one.id for one in model.effects}
    lacking = [e for e in library.values() if e.id not in inside and e.stage in STAGES]
    facts = {"tolerance": case.tolerance, "spread": spread}
    fit = information(case.cell, case.fit, model, lacking, **facts)
    other = at_starts_of(model, case.validation)
    validation = information(case.cell, case.validation, other, lacking, **facts)
    held = tuple(e.id for e in lacking if e.held or e.bends)
    return Shown(fit, validation, projected(fit, case.tolerance), held)


def model_of(state):
    """Model of a state of the search: its values and effects."""
    return Model(state.solution.values, state.effects)


def confounding(seen):
    """Canonical correlation of each pair of effects on the records of the fit.

    Each effect spans the directions of its sizes and starts that show at plausible size; one of
    `held` has a span for each start, and is like another where all of them are.

    Parameters
    ----------
    seen : Shown.

    Returns
    -------
    columns : dict of lists effect_a, effect_b, correlation [1], same_class (bool), a row per pair.

    Source: H. Hotelling, Biometrika 28 (1936) 321.
    """
    left = seen.projection.left
    ids = list(dict.fromkeys(label.effect for label in seen.fit.labels))
    spans = [_spans(seen, one) for one in ids]
    pairs = list(combinations(range(len(ids)), 2))
    found = [_alike(left, spans[a], spans[b]) for a, b in pairs]
    return {
        "effect_a": [ids[a] for a, _ in pairs],
        "effect_b": [ids[b] for _, b in pairs],
        "correlation": found,
        "same_class": [one > SAME_CLASS for one in found],
    }


def classes_of(columns):
    """Classes of effects that a case cannot tell apart: connected components of its pairs.

    Parameters
    ----------
    columns : of `confounding`.

    Returns
    -------
    classes : list of tuples of ids, in the order of the library; an effect alone is its own class.
    """
    ids = list(dict.fromkeys([*columns["effect_a"], *columns["effect_b"]]))
    place = {one: k for k, one in enumerate(ids)}
    names = ("effect_a", "effect_b", "same_class")
    for a, b, same in zip(*(columns[name] for name in names), strict=True):
        if same:
            low, high = sorted((place[a], place[b]))
            place = {one: low if k == high else k for one, k in place.items()}
    return [tuple(one for one in ids if place[one] == k) for k in sorted(set(place.values()))]


def visibility(seen, gates, *, rows):
    """Chi-square of each effect at plausible size, and the effects that stay below a gate.

    Parameters
    ----------
    seen : Shown. gates : search.Gates. rows : number of rows of the fit, for the price of a
    parameter.

    Returns
    -------
    visibility : Visibility.
    """
    follow = seen.projection.follow
    judged = np.diag(follow.T @ seen.validation.matrix @ follow)
    fit, validation, unseen = {}, {}, []
    for one in dict.fromkeys(label.effect for label in seen.fit.labels):
        at = _rows(seen.fit.labels, one)
        best = at[np.argmax(np.minimum(np.diag(seen.projection.left)[at], judged[at]))]
        fit[one] = float(max(seen.projection.left[best, best], 0.0))
        validation[one] = float(max(judged[best], 0.0))
        price = gates.bic + len({seen.fit.labels[k].size for k in at}) * np.log(rows)
        if fit[one] <= price or validation[one] <= gates.validation_chi_square:
            unseen.append(one)
    return Visibility(fit, validation, tuple(unseen))


def _rows(labels, effect):
    return np.array([k for k, label in enumerate(labels) if label.effect == effect])


def _spans(seen, effect):
    labels = seen.fit.labels
    at = _rows(labels, effect)
    starts = sorted({labels[k].start for k in at}) if effect in seen.held else [None]
    parts = [[k for k in at if start is None or labels[k].start == start] for start in starts]
    return [_span(seen.projection.left, np.array(part)) for part in parts]


def _span(left, at):
    """Orthonormal directions (m, r), in the metric `left`, of the rows that show anything."""
    size, ways = np.linalg.eigh(left[np.ix_(at, at)])
    kept = size > max(SHOWN, 1e-8 * size[-1])
    found = np.zeros((len(left), int(kept.sum())))
    found[at] = ways[:, kept] / np.sqrt(size[kept])
    return found


def _alike(left, ours, theirs):
    """Correlation of two effects: of the one with more spans, that of the span least matched."""
    table = np.array([[_largest(p.T @ left @ q) for q in theirs] for p in ours])
    return float(table.max(axis=1 if len(ours) >= len(theirs) else 0).min())


def _largest(mixed):
    """Largest canonical correlation; 0 where one of the two shows nothing."""
    if 0 in mixed.shape:
        return 0.0
    return float(min(np.linalg.svd(mixed, compute_uv=False)[0], 1.0))
