"""All spectra of a cell together: one circuit for them, and its arcs over SoC and temperature.

One spectrum alone has many circuits and local minima that follow it about as well, and which of
their arcs is charge transfer is a matter of the one that was found. Together they tell: the circuit
is the one that all of them prefer, each fit also begins where those of its neighbours ended, and an
arc is followed by its time constant from neighbour to neighbour.
"""

from itertools import combinations, pairwise
from typing import NamedTuple

import numpy as np

from cellwright.numerics.ordered import ordered_pairs
from cellwright.protocols.impedance.arcs import contract, slowest_arc_hertz, tops
from cellwright.protocols.impedance.candidates import (
    bent_leads,
    candidate_of,
    compare,
    criterion_of,
    least,
    misses,
    settled,
    widened,
    with_bent_leads,
    with_inductance,
)
from cellwright.protocols.impedance.circuits import BENT_LEADS
from cellwright.protocols.impedance.fit import SAME, fit_circuit
from cellwright.records.conditions import (
    checkups_of,
    same_soc,
    same_temperature,
    stated_or_reference,
)

# ASSUME: From one spectrum to the next in SoC or temperature the time constant of an arc moves by
# less than two decades: more, and it is another arc. Half of it is what one without partner costs.
UNMATCHED = np.log(10.0)
OCCAM = 20.0  # D. Madigan, A. E. Raftery, J. Am. Stat. Assoc. 89 (1994) 1535


class Spectrum(NamedTuple):
    """One spectrum and what it was made at.

    frequency_hertz (n,) [Hz], impedance_ohm (n,) complex [Ω]: points that can be trusted.
    kramers_kronig_rms : of the test [1]. celsius, soc, cycle : as the sheet states them [°C], [1],
    None where it does not.
    """

    frequency_hertz: np.ndarray
    impedance_ohm: np.ndarray
    kramers_kronig_rms: float
    celsius: float | None = None
    soc: float | None = None
    cycle: float | None = None

    @property
    def points(self):
        """Frequency and impedance."""
        return self.frequency_hertz, self.impedance_ohm


def follow(spectra, *, circuit, candidates, choose, fixed, tied):
    """Circuit and arc of charge transfer of each spectrum of a cell.

    spectra : list of Spectrum. circuit, candidates, choose : as in `analyse`. fixed, tied : as in
    `fit_circuit`, of the given circuit.

    Returns followed: for each spectrum its rows of stage `eis_together` without its name, one a
    candidate, the given circuit first. Raises Refusal: as `fit_circuit`.
    """
    options, validate = {"fixed": fixed, "tied": tied}, choose == "cross_validation"
    # A circuit that was asked for is kept, with whatever it does not tell.
    keep = choose == "circuit" or bool(fixed or tied)
    compared = [_compared(one, circuit, candidates, validate, keep, options) for one in spectra]
    preferred, weight = _preferred(compared, "bic" if choose == "circuit" else choose)
    chosen, near = 0 if choose == "circuit" else preferred, neighbours(spectra)
    about, keep = (options, keep) if chosen == 0 else ({}, False)
    met = _met(spectra, [row[chosen].whole for row in compared], near, **about)
    for one, row, whole in zip(spectra, compared, met, strict=True):
        if whole is not row[chosen].whole:
            fit = whole if keep else settled(one.points, whole)
            row[chosen] = candidate_of(one.points, whole, fit, validate, **about)
    fits = [row[chosen].fit for row in compared]
    labels = _followed(fits, near, [one.frequency_hertz for one in spectra])
    said = _off_course(spectra, fits, labels, near)
    return [
        [
            _row(one, hertz, words)
            | {"chosen": k == chosen, "preferred": k == preferred, "weight": float(weight[k])}
            for k, one in enumerate(row)
        ]
        for row, hertz, words in zip(compared, labels, said, strict=True)
    ]


def _row(candidate, hertz, off_course):
    """Row of a candidate of one spectrum."""
    fit, whole = candidate.fit, candidate.whole
    return {
        "candidate": candidate.circuit,
        "circuit": fit.circuit if fit else "",
        "values": [float(value) for value in fit.values] if fit else [],
        "at_bound": ", ".join(whole.at_bound) if whole else "",
        "reason": candidate.reason,
        "charge_transfer_hertz": hertz,
        "off_course": off_course,
    }


def _compared(spectrum, circuit, candidates, validate, keep, options):
    """Candidates of one spectrum, the given circuit first, each once; all with the same leads."""
    # Told apart as they are given: the same ones in every spectrum, whatever its leads.
    given, *others = dict.fromkeys((circuit, *candidates))
    points = spectrum.points
    whole = fit_circuit(*points, circuit=with_inductance(given, spectrum.impedance_ohm), **options)
    whole = with_bent_leads(points, whole, spectrum.kramers_kronig_rms, **options)
    fit = whole if keep else settled(points, whole)
    first = candidate_of(points, whole, fit, validate, **options)
    names = [with_inductance(name, spectrum.impedance_ohm) for name in others]
    if whole.circuit.startswith(BENT_LEADS):
        names = [bent_leads(name) for name in names]
    # Constraints are on the parameters of the given circuit.
    return [first, *compare(*points, names, cross_validate=validate)]


def _preferred(compared, criterion):
    """Place of the candidate that all spectra together prefer, and the weight (k,) of each.

    The weights are the candidates' shares in what is known, by their information criteria: two that
    follow the spectra equally well count alike, one that is `OCCAM` times less likely than the best
    no more. Of errors on points left out there are none: the best has all.
    """
    values = np.array([criterion_of(row, criterion) for row in compared])
    # Independent measurements: their criteria add; of errors on points left out the squares do.
    total = (values if criterion == "bic" else values**2).sum(axis=0)
    best = least(total)
    if criterion != "bic":
        return best, np.arange(len(total)) == best
    weight = np.exp(np.nan_to_num(total[best] - total, nan=-np.inf) / 2)
    weight[weight < 1 / OCCAM] = 0.0
    return best, weight / weight.sum()


def neighbours(spectra):
    """Places of the spectra next to each: in SoC at its temperature, in temperature at its SoC.

    spectra : list of Spectrum; one without a SoC has none.

    Returns near: list of sorted lists.
    """
    near = [set() for _ in spectra]
    for run in (*_over_soc(spectra), *_over_temperature(spectra)):
        for one, next_one in pairwise(run):
            near[one].add(next_one)
            near[next_one].add(one)
    return [sorted(places) for places in near]


def _over_soc(spectra):
    """Places of the spectra of each check-up and temperature, by SoC."""
    return _runs(
        spectra,
        lambda one, other: same_temperature(one.celsius, other.celsius),
        lambda one: one.soc,
    )


def _over_temperature(spectra):
    """Places of the spectra of each check-up and SoC, from cold to warm."""
    return _runs(
        spectra,
        lambda one, other: same_soc(one.soc, other.soc),
        lambda one: stated_or_reference(one.celsius),
    )


def _runs(spectra, alike, order):
    """Places of the spectra of one check-up that are alike, in an order; of those with a SoC."""
    known = [k for k, one in enumerate(spectra) if one.soc is not None and np.isfinite(one.soc)]
    ages, runs = checkups_of([one.cycle for one in spectra]), []
    for k in sorted(known, key=lambda k: order(spectra[k])):
        for run in runs:
            if ages[run[0]] == ages[k] and alike(spectra[run[0]], spectra[k]):
                run.append(k)
                break
        else:
            runs.append([k])
    return runs


def _met(spectra, fits, near, **options):
    """Fits that also began where those of their neighbours ended, until none comes closer so."""
    fits, waiting = list(fits), set(range(len(fits)))
    while waiting:
        k = min(waiting)
        waiting.discard(k)
        for n in near[k]:
            if fits[n].circuit != fits[k].circuit:
                continue
            start = dict(zip(fits[n].names, fits[n].values, strict=True))
            about = {"circuit": fits[k].circuit, "starts": 1, "start": start}
            fit = fit_circuit(*spectra[k].points, **about, **options)
            if fit.rms_relative_residual < fits[k].rms_relative_residual * (1 - SAME):
                fits[k] = fit
                waiting.update(near[k])
    return fits


def _followed(fits, near, frequencies):
    """Top [Hz] of the arc of charge transfer of each fit.

    First the slowest that is none of diffusion; where all neighbours' are another one, that.
    """
    labels = [slowest_arc_hertz(fit, used) for fit, used in zip(fits, frequencies, strict=True)]
    for _ in fits:
        before = list(labels)
        for k, fit in enumerate(fits):
            seen = [partner(fits[n], labels[n], fit) for n in near[k]]
            if len(seen) > 1 and len(set(seen)) == 1 and seen[0] == seen[0]:
                labels[k] = seen[0]
        if labels == before:
            break
    return labels


def partner(fit, hertz, other):
    """Top [Hz] of the arc of another fit that is the arc of this one at a top; NaN without any.

    Arcs keep their order: of all ways to pair some of them, the one whose time constants differ
    least counts, an arc without partner costing as much as one decade.
    """
    ours, theirs = (np.log([top for top, _ in tops(one)]) for one in (fit, other))
    _, pairs = ordered_pairs(np.abs(ours[:, None] - theirs), UNMATCHED)
    same = [theirs[b] for a, b in pairs if np.isclose(ours[a], np.log(hertz))]
    return float(np.exp(same[-1])) if same else np.nan


def _off_course(spectra, fits, labels, near):
    """Of each spectrum, in words, why its charge transfer may be another arc; "" where none is."""
    words = [[] for _ in spectra]
    known = [_known(*each) for each in zip(spectra, fits, labels, strict=True)]
    for k, fit in enumerate(fits):
        other = [n for n in near[k] if not _same(partner(fit, labels[k], fits[n]), labels[n])]
        apart = [n for n in near[k] if _apart(known[n], known[k])]
        if 2 * len(other) > len(near[k]):
            words[k].append(
                f"charge transfer at {labels[k]:.3g} Hz is another arc than in the spectra next to "
                f"it in SoC and temperature ({_listed(labels, other)} Hz)"
            )
        elif 2 * len(apart) > len(near[k]):
            words[k].append(
                f"charge transfer at {labels[k]:.3g} Hz, exponent {known[k]['cpe_p']:.2g}, holds "
                "two arcs that the spectra next to it in SoC and temperature have apart "
                f"(exponents {_listed([one['cpe_p'] for one in known], apart)})"
            )
    ohm = [(one["r_charge_transfer_ohm"], one["r_charge_transfer_ohm_std"]) for one in known]
    for run in _over_temperature(spectra):
        for k, n in _falling(spectra, ohm, run):
            words[k].append(
                f"charge transfer would fall in the cold: {1e3 * ohm[k][0]:.3g} mΩ here, "
                f"{1e3 * ohm[n][0]:.3g} mΩ at {stated_or_reference(spectra[n].celsius):g} °C "
                "and this SoC"
            )
    return ["; ".join(said) for said in words]


def _known(spectrum, fit, hertz):
    """Columns of the results of one spectrum, and how many of its arcs are faster."""
    missed = misses(fit, spectrum.kramers_kronig_rms)
    fit = widened(fit, len(spectrum.frequency_hertz)) if missed else fit
    columns = contract(fit, hertz)
    # A plain capacitance has its exponent exactly.
    columns["cpe_p_std"] = np.nan_to_num(columns["cpe_p_std"])
    faster = [top for top, _ in tops(fit) if top > hertz and not _same(top, hertz)]
    return columns | {"faster": len(faster)}


def _apart(there, here):
    """Whether a spectrum has arcs apart that another one has in one: it alone has no faster one,
    and its exponent is below by more than two deviations."""
    slack = 2 * np.hypot(there["cpe_p_std"], here["cpe_p_std"])
    alone = there["faster"] and not here["faster"]
    return bool(alone and here["cpe_p"] + slack < there["cpe_p"])


def _listed(values, places):
    """Values at these places, in words."""
    return " and ".join(dict.fromkeys(f"{values[place]:.3g}" for place in places))


def _falling(spectra, ohm, run):
    """Spectra of one SoC without which charge transfer falls at no step into the cold.

    The best known are kept: each counts by how far its deviation is below its value.

    ohm : charge transfer of all spectra and its deviation. run : places, from cold to warm.

    Returns pairs: of each the place, and that of one it contradicts.
    """
    known = [ohm[k] for k in run]
    agree = np.ones((len(run), len(run)), bool)
    for a, b in combinations(range(len(run)), 2):
        slack = 2 * np.hypot(known[a][1], known[b][1])
        one_chamber = same_temperature(spectra[run[a]].celsius, spectra[run[b]].celsius)
        agree[a, b] = agree[b, a] = one_chamber or not known[b][0] > known[a][0] + slack
    weight = [max(1 - std / value, 0.0) if std < value else 0.0 for value, std in known]
    chains = [[]]
    for k in range(len(run)):
        before = [chain for chain in chains if agree[chain, k].all()]
        chains.append([*max(before, key=lambda chain: sum(weight[c] for c in chain)), k])
    kept = max(chains, key=lambda chain: sum(weight[c] for c in chain))
    for k in sorted(set(range(len(run))) - set(kept)):
        against = [c for c in kept if not agree[c, k]]
        if against:
            yield run[k], run[min(against, key=lambda c: abs(c - k))]


def _same(first, second):
    """Whether two tops [Hz] are one."""
    return bool(np.isclose(first, second)) or (np.isnan(first) and np.isnan(second))
