"""Circuits compared on one spectrum: with what its leads need, without what it does not tell."""

import re
from typing import NamedTuple

import numpy as np

from cellwright.numerics.statistics import rms
from cellwright.protocols.impedance.arcs import vaguest_element
from cellwright.protocols.impedance.circuits import BENT_LEADS, LEADS, circuit_impedance
from cellwright.protocols.impedance.fit import SAME, fit_circuit
from cellwright.protocols.impedance.reduced import reduced
from cellwright.refusal import Refusal

CRITERIA = {"bic": "bic", "cross_validation": "cross_validation_residual"}


class Candidate(NamedTuple):
    """A circuit with its fit and criteria; `fit` is None where the `reason` says why.

    circuit : as it was given. whole : CircuitFit of it. fit : CircuitFit without the elements whose
    parameters ended at a limit, `whole` where none did. bic : of `fit`. cross_validation_residual :
    RMS of the relative error of `fit` on points that were left out, NaN where not asked for.
    """

    circuit: str
    whole: object
    fit: object
    bic: float
    cross_validation_residual: float
    reason: str


def with_inductance(circuit, impedance_ohm):
    """Text of the circuit, with the leads' inductance in series where the spectrum shows any."""
    has = "L" in re.findall(r"[A-Z]+", circuit)
    return circuit if has or not (impedance_ohm.imag > 0).any() else f"{LEADS}-{circuit}"


# ASSUME: The residual of the Kramers-Kronig test is the noise of a spectrum; a circuit that leaves
# more than twice as much does not describe the cell.
MISSES = 2.0


def misses(fit, kramers_kronig_rms):
    """How many times more a circuit leaves of a spectrum than the test, 0 where that is noise."""
    ratio = fit.rms_relative_residual / max(kramers_kronig_rms, 1e-12)
    return ratio if ratio > MISSES else 0.0


def with_bent_leads(points, fit, kramers_kronig_rms, **options):
    """The fit with the leads' inductance beside a resistance, where that alone explains a misfit.

    points : frequency [Hz] and impedance [Ω] of the fit. fit : CircuitFit. kramers_kronig_rms : of
    the test. options : as of `fit_circuit`.

    Returns fit: CircuitFit, the same one where its circuit follows the spectrum, has no inductance
    in front, or misses it with bent leads as well.
    """
    if not (misses(fit, kramers_kronig_rms) and fit.circuit.startswith(f"{LEADS}-")):
        return fit
    bent = fit_circuit(*points, circuit=bent_leads(fit.circuit), **options)
    return fit if misses(bent, kramers_kronig_rms) or bent.at_bound else bent


def bent_leads(circuit):
    """Text of a circuit with a resistance beside the inductance in front, where it has one."""
    straight = circuit.startswith(f"{LEADS}-")
    return BENT_LEADS + circuit[len(LEADS) :] if straight else circuit


def widened(fit, points):
    """The fit with deviations for a misfit that is no noise.

    It is smooth: the points tell it no better than as many as the circuit has free parameters, and
    one, would.
    """
    return fit._replace(std=fit.std * np.sqrt(2 * points / (fit.free + 1)))


def settled(points, fit):
    """The fit without what the spectrum does not tell.

    An element whose parameter ended at a limit of its search is taken out; so is one whose size is
    not known, where the spectrum prefers the circuit without it.

    points : frequency [Hz] and impedance [Ω] of the fit. fit : CircuitFit, nothing fixed or tied.

    Returns fit: CircuitFit of what is left, the same one where all is told.
    """
    while fit.at_bound:
        smaller = _without(points, fit)
        if smaller is None:
            return fit
        fit = smaller
    vaguest = vaguest_element(fit)
    smaller = _without(points, fit, vague=(vaguest,)) if vaguest else None
    return settled(points, smaller) if smaller and smaller.bic < fit.bic else fit


def _without(points, fit, **vague):
    """Fit of what `reduced` leaves, from where the whole ended; None where that is nothing."""
    circuit, start = reduced(fit, **vague)
    if circuit is None:
        return None
    return fit_circuit(*points, circuit=circuit, starts=1, start=start)


def compare(frequency_hertz, impedance_ohm, circuits, *, cross_validate=True, **options):
    """Fits of several circuits to the same points, with their criteria.

    frequency_hertz : (n,) [Hz]. impedance_ohm : (n,) complex [Ω]. circuits : texts.
    cross_validate : whether the error on points left out is wanted.
    options : of each fit, see `fit_circuit`.

    Returns candidates: list of Candidate in the order given.

    Source: G. Schwarz, Ann. Statist. 6 (1978) 461 (Bayesian information criterion).
    """
    points, candidates = (frequency_hertz, impedance_ohm), []
    for circuit in circuits:
        try:
            whole = fit_circuit(*points, circuit=circuit, **options)
        except Refusal as refusal:
            candidates.append(Candidate(circuit, None, None, np.nan, np.nan, str(refusal)))
        else:
            # Names of its parameters are told: with others they would be those of another circuit.
            keep = bool(options.get("fixed") or options.get("tied"))
            fit = whole if keep else settled(points, whole)
            about = options if keep else {}
            candidates.append(candidate_of(points, whole, fit, cross_validate, **about))
    return candidates


def candidate_of(points, whole, fit, cross_validate, **options):
    """Candidate of a fit of the whole circuit and of what is left of it; as in `compare`."""
    missed = _cross_validation_error(*points, fit, **options) if cross_validate else np.nan
    return Candidate(whole.circuit, whole, fit, fit.bic, missed, "")


def criterion_of(candidates, criterion):
    """Criterion (k,) of each candidate, the less the better; NaN where it could not be fitted.

    Raises Refusal: an unknown criterion, or none could be fitted.
    """
    if criterion not in CRITERIA:
        raise Refusal(f"criterion {criterion!r}; known: {', '.join(CRITERIA)}")
    if all(candidate.fit is None for candidate in candidates):
        raise Refusal("; ".join(f"{each.circuit}: {each.reason}" for each in candidates))
    return np.array([getattr(candidate, CRITERIA[criterion]) for candidate in candidates])


def least(values):
    """Place of the first of the least values (k,); of one circuit's fits several may be."""
    lowest = np.nanmin(values)
    return int(np.argmax(values <= lowest + SAME * abs(lowest)))


def _cross_validation_error(frequency, impedance, fit, **options):
    """RMS of the relative error [1] on every fifth point in turn, fitted to the others."""
    once = options | {"starts": 1, "start": dict(zip(fit.names, fit.values, strict=True))}
    # Every fifth point by frequency, so that none but the outermost is extrapolated.
    rank, errors = np.argsort(np.argsort(frequency)) % 5, []
    for fold in range(5):
        fitted, predicted = rank != fold, rank == fold
        refit = fit_circuit(frequency[fitted], impedance[fitted], circuit=fit.circuit, **once)
        guess = circuit_impedance(fit.circuit, frequency[predicted], refit.values)
        errors.append(np.abs(guess / impedance[predicted] - 1))
    return rms(np.concatenate(errors))
