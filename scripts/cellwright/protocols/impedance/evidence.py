"""Which circuit a spectrum calls for: candidates side by side."""

import re
from typing import NamedTuple

import numpy as np

from cellwright.protocols.impedance.circuits import circuit_impedance
from cellwright.protocols.impedance.fit import fit_circuit
from cellwright.refusal import Refusal

FOLDS = 5
CRITERIA = {"bic": "bic", "cross_validation": "cross_validation_residual"}


class Candidate(NamedTuple):
    """A circuit and how it does; `fit` is None where it could not be fitted, for the `reason`.

    cross_validation_residual : RMS of the relative error on points that were left out.
    """

    circuit: str
    fit: object
    bic: float
    cross_validation_residual: float
    reason: str


def with_inductance(circuit, impedance_ohm):
    """The circuit with the leads' inductance in front, where the spectrum shows any."""
    has = "L" in re.findall(r"[A-Z]+", circuit)
    return circuit if has or not (impedance_ohm.imag > 0).any() else f"L-{circuit}"


def compare(frequency_hertz, impedance_ohm, circuits, *, starts):
    """Fit every circuit to the same points.

    Parameters
    ----------
    frequency_hertz : (n,) [Hz]. impedance_ohm : (n,) complex [Ω]. circuits : texts.
    starts : of each fit, see `fit_circuit`.

    Returns
    -------
    candidates : list of Candidate in the order given.

    Source: G. Schwarz, Ann. Statist. 6 (1978) 461 (Bayesian information criterion).
    """
    return [_candidate(frequency_hertz, impedance_ohm, one, starts) for one in circuits]


def best(candidates, *, criterion):
    """The candidate with the least criterion ("bic" or "cross_validation") among those fitted whose
    parameters stay within their limits, or among all fitted where none does.

    Raises
    ------
    Refusal : none could be fitted, or an unknown criterion.
    """
    if criterion not in CRITERIA:
        raise Refusal(f"criterion {criterion!r}; known: {', '.join(CRITERIA)}")
    fitted = [one for one in candidates if one.fit is not None]
    if not fitted:
        raise Refusal("; ".join(f"{one.circuit}: {one.reason}" for one in candidates))
    inside = [one for one in fitted if not one.fit.at_bound]
    return min(inside or fitted, key=lambda one: getattr(one, CRITERIA[criterion]))


def _candidate(frequency, impedance, circuit, starts):
    try:
        fit = fit_circuit(frequency, impedance, circuit=circuit, starts=starts)
    except Refusal as refusal:
        return Candidate(circuit, None, np.nan, np.nan, str(refusal))
    missed = _left_out(frequency, impedance, fit)
    return Candidate(circuit, fit, fit.bic, missed, "")


def _left_out(frequency, impedance, fit):
    """Error on every fifth point, fitted to the others from the optimum of all."""
    start = dict(zip(fit.names, fit.values, strict=True))
    place, errors = np.argsort(np.argsort(frequency)) % FOLDS, []
    for fold in range(FOLDS):
        rest, out = place != fold, place == fold
        found = fit_circuit(
            frequency[rest], impedance[rest], circuit=fit.circuit, starts=1, start=start
        )
        guess = circuit_impedance(fit.circuit, frequency[out], found.values)
        errors.append(np.abs(guess / impedance[out] - 1) ** 2)
    return float(np.sqrt(np.mean(np.concatenate(errors))))
