"""How the capacity of a life fades: early course, law by evidence, recovery after rests."""

from typing import NamedTuple

import numpy as np

from cellwright.numerics.lines import whitened
from cellwright.refusal import Refusal

LEAST_CYCLES = 8  # that a law of the fade needs
LEVEL = 0.95  # coverage of the intervals of a life
LEAST_LOSS = 0.02  # of the capacity: of a smaller loss no course is told [1]
IMPOSSIBLE = -1e9  # log evidence of a law that no parameters make
LEAST_NOISE = 5e-4  # of the capacity: no law is known to hold more closely [1]
CORRELATIONS = np.array([0, 0.2, 0.4, 0.6, 0.7, 0.8, 0.85, 0.9, 0.93, 0.95, 0.97, 0.98, 0.99])
SMOOTH = ("linear", "square root", "power", "gradual acceleration")
TWO_STAGE = "two-stage"
LAWS = (*SMOOTH, TWO_STAGE)


class Term(NamedTuple):
    """A function of the life's share x = cycle / last cycle: its kind and parameters."""

    kind: str
    first: float = np.nan
    second: float = np.nan


def column(term, share):
    """Value of a term over the share of the life [1]; an array of the same shape.

    Parameters
    ----------
    term : Term. share : array, not negative; 1 is the last cycle, above 1 the future.

    Source: the two-stage law's bend is the smooth form of D. W. Bacon, D. G. Watts, Biometrika 58
    (1971) 525, with slope 0 before and 1 after it.
    """
    if term.kind == "hinge":
        beyond = share - term.first
        return (beyond + np.sqrt(beyond**2 + term.second**2)) / 2
    if term.kind == "early":
        return np.exp(-share / term.first)
    return share**term.first


CONSTANT, STRAIGHT, ROOT = Term("power", 0.0), Term("power", 1.0), Term("power", 0.5)


def law_at(terms, values, share):
    """Capacity over the scale of a law, terms with one value each, at shares of the life."""
    return sum(value * column(term, share) for value, term in zip(values, terms, strict=True))


def _candidates():
    """Laws as (name, terms), every law with and without an early course.

    Positions, widths and time constants are shares of the life, as dense as data tell them apart.
    """
    early = [Term("early", share) for share in (0.02, 0.04, 0.08, 0.15)]
    laws = [("linear", (CONSTANT, STRAIGHT)), ("square root", (CONSTANT, ROOT))]
    exponents = np.concatenate([np.arange(0.3, 1.0, 0.1), np.arange(1.2, 3.1, 0.2)])
    laws += [("power", (CONSTANT, Term("power", float(p)))) for p in exponents]
    laws += [
        ("gradual acceleration", (CONSTANT, STRAIGHT, Term("power", p)))
        for p in (1.5, 2.0, 3.0, 4.0, 6.0)
    ]
    hinges = [
        Term("hinge", float(place), width)
        for place in np.arange(0.06, 0.975, 0.02)
        for width in (0.005, 0.02, 0.05)
    ]
    before = ((CONSTANT, STRAIGHT), (CONSTANT, STRAIGHT, Term("power", 2.0)))
    two_stage = [(TWO_STAGE, (*terms, hinge)) for terms in before for hinge in hinges]
    found = [(name, (*terms, one)) for name, terms in laws for one in early]
    found += [(name, (*terms, one)) for name, terms in two_stage for one in early[1::2]]
    return [*laws, *two_stage, *found]


class Points(NamedTuple):
    """What laws are fitted to: (n,) cycle, share of the life, capacity, relative noise and pauses.

    scale_ampere_hour : by which capacity was divided. noise : standard deviation over its typical
    one [1]. place : running number of the discharge. since_pause : discharges since each pause
    (n, pauses), infinite before it.
    """

    cycle: np.ndarray
    share: np.ndarray
    capacity: np.ndarray
    noise: np.ndarray
    place: np.ndarray
    since_pause: np.ndarray
    scale_ampere_hour: float


class Candidate(NamedTuple):
    """One law with its parameters found: weight [1] among all, values (p,), covariance (p, p).

    The values belong to the terms, then to the pauses; capacities are over the scale.
    """

    law: str
    terms: tuple
    weight: float
    values: np.ndarray
    covariance: np.ndarray
    correlation: float
    degrees_of_freedom: int


class Fade(NamedTuple):
    """Laws of a life weighed against each other.

    candidates : list of Candidate whose weights sum to 1, none below a thousandth of the best.
    log_evidence : of each law [1]; early : log evidence for an early course beside the law.
    recovery_cycles : in which what a rest brought back is lost; NaN where none is told.
    recovery_evidence : log evidence for recovery. points : Points.
    """

    candidates: list
    log_evidence: dict
    early: float
    recovery_cycles: float
    recovery_evidence: float
    points: Points


def fade_of(life):
    """Law of the fade of a life, by evidence.

    Capacity over cycle is a law plus noise. Laws: linear; square root (growth of a layer); power;
    gradual acceleration (straight line plus power above 1); two-stage (two straight lines and
    their bend); each with or without an early course that decays (a rise, or a fall). Rests
    bring back part of the capacity for some cycles: one amplitude for each pause, its decay
    common, where evidence tells it. Noise may grow or shrink over the life, and remembers itself
    exponentially from one discharge to the next; each memory is a candidate of its own, so that
    noise that wanders is not taken for a trend. The evidence of a candidate is its likelihood
    with the Bayesian information criterion's price for each coefficient, that of a law the mean
    over its exponents, positions and memories (so that many positions to choose from are no
    advantage).

    Parameters
    ----------
    life : lives.Life.

    Returns
    -------
    fade : Fade.

    Raises
    ------
    Refusal : fewer than eight comparable discharges.

    Source: G. Schwarz, Annals of Statistics 6 (1978) 461 (criterion); I. Bloom et al., J. Power
    Sources 101 (2001) 238 (power of time); for √ of cycles: H. J. Ploehn, P. Ramadass,
    R. E. White, J. Electrochem. Soc. 151 (2004) A456.
    """
    points = points_of(life)
    found, recovery, gain = _weighed(points, np.inf), np.nan, np.nan
    if points.since_pause.shape[1]:
        # Cycles in which what a rest brought back is lost again.
        options = {tau: _weighed(points, tau) for tau in (2.0, 5.0, 12.0, 25.0)}
        best = max(options, key=lambda tau: _best_evidence(options[tau]))
        gain = _best_evidence(options[best]) - _best_evidence(found)
        if gain >= 3.0:  # of log evidence, 20 : 1
            found, recovery = options[best], best
    candidates, log_evidence, early = found
    most = max(one.weight for one in candidates)
    kept = [one for one in candidates if one.weight >= 1e-3 * most]
    total = sum(one.weight for one in kept)
    kept = [one._replace(weight=one.weight / total) for one in kept]
    return Fade(kept, log_evidence, early, recovery, gain, points)


def _best_evidence(weighed):
    return max(weighed[1].values())


def points_of(life):
    """Comparable discharges of a `life`, averaged where there are many, and their noise.

    Raises
    ------
    Refusal : fewer than eight, or all at one cycle.
    """
    used = np.flatnonzero(life.used)
    if len(used) < LEAST_CYCLES:
        raise Refusal(f"{len(used)} comparable discharges; a law of the fade needs {LEAST_CYCLES}")
    capacity = life.at_reference_ampere_hour[used]
    # One odd first discharge must not set the scale.
    scale = float(np.median(capacity[: max(len(capacity) // 20, 3)]))
    paused = life.pause_hour != 0
    stretch = np.cumsum(paused)[used]
    starts = [np.searchsorted(used, place) for place in np.flatnonzero(paused)]
    bins = _bins(stretch, -(-len(used) // 160))  # as many points as a law needs, for speed
    count = np.bincount(bins)
    number = np.arange(len(used), dtype=float)
    cycle, value, place = (
        np.bincount(bins, one) / count for one in (life.cycle[used], capacity / scale, number)
    )
    if cycle[-1] <= cycle[0]:
        raise Refusal("all discharges have one cycle number; wanted rising ones")
    since = (
        place[:, None] - np.array(starts, float)[None, :] if starts else np.empty((len(cycle), 0))
    )
    # An averaged point that begins with the pause stands half a discharge before it.
    since = np.where(since >= -0.5, since, np.inf)
    noise = _noise_course(cycle, value)
    return Points(cycle, cycle / cycle[-1], value, noise, place, since, scale)


def _bins(stretch, size):
    """Number of the bin of each discharge: `size` neighbours without a pause between."""
    bins, last, count = np.zeros(len(stretch), int), 0, 0
    for k in range(1, len(stretch)):
        count += 1
        if stretch[k] != stretch[k - 1] or count >= size:
            last, count = last + 1, 0
        bins[k] = last
    return bins


# ASSUME: The scatter of a capacity grows or shrinks exponentially over a life.
def _noise_course(cycle, value):
    """Standard deviation of each point over the typical one [1], 1 where no course is told.

    From how far points lie off the line between their neighbours.
    """
    if len(value) < 4 * LEAST_CYCLES:
        return np.ones(len(value))
    share = (cycle[1:-1] - cycle[:-2]) / (cycle[2:] - cycle[:-2])
    off = np.abs(value[1:-1] - (1 - share) * value[:-2] - share * value[2:])
    logarithm = np.log(np.maximum(off, LEAST_NOISE / 10))
    x = cycle[1:-1] / cycle[-1]
    centred = x - x.mean()
    slope = centred @ logarithm / (centred @ centred)
    std = np.std(logarithm - slope * centred) / np.sqrt(centred @ centred)
    if abs(slope) < 3 * std:
        return np.ones(len(value))
    return np.exp(np.clip(slope, -4, 4) * (cycle / cycle[-1] - x.mean()))


def _recovery_columns(points, tau):
    """What each pause brings back over the discharges after it (n, pauses); none for tau = ∞."""
    if not np.isfinite(tau):
        return np.empty((len(points.cycle), 0))
    columns = np.exp(-points.since_pause / tau)
    # A pause that no or only one point follows says nothing beside the law.
    return columns[:, (columns > 0.05).sum(axis=0) > 1]


def _weighed(points, tau):
    """Candidates with recovery of one time constant, log evidence of each law, of an early course.

    A candidate is a law at one memory of the noise.
    """
    laws = [(name, terms) for name, terms in _candidates() if _supported(terms, points)]
    extra = _recovery_columns(points, tau)
    terms = list(dict.fromkeys(term for _, parts in laws for term in parts))
    place_of = {term: k for k, term in enumerate(terms)}
    table = np.column_stack([*(column(term, points.share) for term in terms), extra])
    shared = list(range(len(terms), table.shape[1]))
    chosen = [[*(place_of[term] for term in parts), *shared] for _, parts in laws]
    solved = [_solved(points, table, chosen, correlation) for correlation in CORRELATIONS]
    score = np.array([[one[0] for one in at] for at in solved])
    for n, (name, _) in enumerate(laws):
        # A power that slows the fade instead is no gradual acceleration.
        if name == "gradual acceleration":
            score[[at[n][1][2] > 0 for at in solved], n] = -np.inf
    weight = np.exp(score - score.max())
    candidates = [
        Candidate(
            *laws[n], float(weight[m, n]), *solved[m][n][1:3], CORRELATIONS[m], solved[m][n][3]
        )
        for m, n in zip(*np.nonzero(weight > 1e-6), strict=True)
    ]
    evidence, early = _evidences(laws, score)
    # Weights of laws, not of candidates: a law with many positions is no likelier for that.
    share = {name: np.exp(evidence[name] - max(evidence.values())) for name in evidence}
    total = {name: sum(c.weight for c in candidates if c.law == name) or 1.0 for name in evidence}
    candidates = [c._replace(weight=c.weight * share[c.law] / total[c.law]) for c in candidates]
    return candidates, evidence, early


def _supported(terms, points):
    """Whether points lie on both sides of a bend, and some within an early course."""
    # Beside a bend with few points any slope would do, and win by chance.
    for term in terms:
        if (
            term.kind == "hinge"
            and min(np.sum(points.share < term.first), np.sum(points.share > term.first))
            < LEAST_CYCLES // 2
        ):
            return False
        first = points.share[0]
        if term.kind == "early" and np.sum(points.share - first < 2 * term.first) < LEAST_CYCLES:
            return False
    return True


def _evidences(laws, score):
    """Log evidence of each law, and that for an early course: means over what they leave open."""
    names = np.array([name for name, _ in laws])
    early = np.array([terms[-1].kind == "early" for _, terms in laws])

    def mean(rows):
        part = score[:, rows]
        if not np.isfinite(part).any():
            return IMPOSSIBLE
        return float(part.max() + np.log(np.mean(np.exp(part - part.max()))))

    evidence = {
        name: np.logaddexp(mean((names == name) & ~early), mean((names == name) & early))
        for name in LAWS
        if (names == name).any()
    }
    with_it = [mean((names == name) & early) for name in evidence]
    without = [mean((names == name) & ~early) for name in evidence]
    return evidence, float(max(with_it) - max(without))


def _solved(points, table, chosen, correlation):
    """(log evidence, values, covariance, degrees of freedom) of each choice of columns."""
    stacked = np.column_stack([table, points.capacity]) / points.noise[:, None]
    white, logarithm = whitened(stacked, points.place, correlation)
    logarithm += float(np.log(points.noise).sum())
    gram, rows, found = white.T @ white, len(white), [None] * len(chosen)
    for size in {len(places) for places in chosen}:
        alike = [n for n, places in enumerate(chosen) if len(places) == size]
        solved = _alike_solved(gram, np.array([chosen[n] for n in alike]), rows, logarithm)
        for n, one in zip(alike, zip(*solved, strict=True), strict=True):
            found[n] = (*one, rows - size)
    return found


def _alike_solved(gram, places, rows, logarithm):
    """Choices of equally many columns (m, p), solved from the products of all columns.

    Returns log evidence (m,), values (m, p) and covariance (m, p, p).
    """
    count = places.shape[1]
    inner, outer = gram[places[:, :, None], places[:, None, :]], gram[places, -1]
    if rows <= count + 2:
        return np.full(len(places), -np.inf), outer, inner
    size = np.sqrt(np.maximum(np.diagonal(inner, axis1=1, axis2=2), np.finfo(float).tiny))
    both = size[:, :, None] * size[:, None, :]
    # A ridge far below rounding of the data, against columns that are one.
    inverse = np.linalg.inv(inner / both + 1e-12 * np.eye(count)) / both
    values = np.einsum("mij,mj->mi", inverse, outer)
    left = gram[-1, -1] - 2 * np.einsum("mi,mi->m", outer, values)
    left += np.einsum("mi,mij,mj->m", values, inner, values)
    # A law that goes through all points is no better known than a cycler reads.
    squares = np.maximum(left, rows * LEAST_NOISE**2)
    likelihood = -0.5 * rows * np.log(squares / rows) - logarithm
    evidence = likelihood - 0.5 * count * np.log(rows)
    return evidence, values, inverse * (squares / (rows - count))[:, None, None]


class Draws(NamedTuple):
    """Laws drawn from a Fade, lists of one entry a draw; recovery after rests left out.

    laws : names. terms, values : of each. last : by how much the last point lies off the law, over
    the scale [1]. correlation : of the noise of neighbours. noise : its standard deviation where
    the life ends, over the scale [1].
    """

    laws: list
    terms: list
    values: list
    last: np.ndarray
    correlation: np.ndarray
    noise: np.ndarray


def draws(fade, *, count):
    """Laws of a fade drawn by their weight, coefficients by their errors (Student's t).

    Parameters
    ----------
    fade : Fade. count : how many; equal counts give equal draws.

    Returns
    -------
    draws : Draws.
    """
    random = np.random.default_rng(0)
    weight = np.array([one.weight for one in fade.candidates])
    picked = random.choice(len(weight), count, p=weight / weight.sum())
    laws, terms, values, last, noise = [], [], [], [], []
    roots = {}
    bare = fade.points.capacity - recovery(fade)
    for k in picked:
        one = fade.candidates[k]
        if k not in roots:
            level, basis = np.linalg.eigh(one.covariance)
            roots[k] = basis * np.sqrt(np.maximum(level, 0.0))
        # Student's t: the scatter is an estimate as well.
        spread = np.sqrt(one.degrees_of_freedom / random.chisquare(one.degrees_of_freedom))
        drawn = one.values + spread * (roots[k] @ random.standard_normal(len(one.values)))
        laws.append(one.law)
        terms.append(one.terms)
        values.append(drawn[: len(one.terms)])
        law = law_at(terms[-1], values[-1], fade.points.share)
        last.append(float(bare[-1] - law[-1]))
        noise.append(float(np.std((bare - law) / fade.points.noise) * fade.points.noise[-1]))
    correlation = np.array([fade.candidates[k].correlation for k in picked])
    return Draws(laws, terms, values, np.array(last), correlation, np.array(noise))


def courses(drawn, share):
    """Capacity over the scale of each drawn law (draws, n) at shares of the life (n,)."""
    share = np.asarray(share, float)
    table = {term: column(term, share) for term in {t for terms in drawn.terms for t in terms}}
    return np.array(
        [
            sum(factor * table[term] for factor, term in zip(factors, terms, strict=True))
            for terms, factors in zip(drawn.terms, drawn.values, strict=True)
        ]
    )


def recovery(fade):
    """Mean of what each point owes to rests before it, over the scale (n,)."""
    columns = _recovery_columns(fade.points, fade.recovery_cycles)
    total = np.zeros(len(fade.points.cycle))
    for one in fade.candidates if columns.shape[1] else ():
        total += one.weight * (columns @ one.values[len(one.terms) :])
    return total
