"""Equivalent circuits as data: a circuit is a tuple of branches in series with the OCV.

A new effect (hysteresis, diffusion) is a new kind in `KINDS`; nothing else needs to know it.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from cellwright.models.kernels import lag
from cellwright.refusal import Refusal


class Excitation(NamedTuple):
    """What drives the branches of a circuit."""

    step_second: np.ndarray
    current_ampere: np.ndarray
    hold: str


class Branch(NamedTuple):
    """One element of a circuit: its kind and its parameters, scalars or one value per sample."""

    kind: str
    parameters: dict


class Kind(NamedTuple):
    """What a branch of a kind does in time and in frequency."""

    parameters: tuple
    voltage: Callable
    impedance: Callable


def _resistor_voltage(excitation, *, r_ohm):
    return r_ohm * excitation.current_ampere


def _resistor_impedance(angular_frequency, *, r_ohm):
    return np.full(len(angular_frequency), r_ohm, dtype=complex)


def _rc_voltage(excitation, *, r_ohm, tau_second):
    tau = tau_second if np.ndim(tau_second) == 0 else np.asarray(tau_second)[:-1]
    drive = r_ohm * excitation.current_ampere
    return lag(excitation.step_second, tau, drive, hold=excitation.hold)


def _rc_impedance(angular_frequency, *, r_ohm, tau_second):
    return r_ohm / (1.0 + 1j * angular_frequency * tau_second)


KINDS = {
    "R": Kind(("r_ohm",), _resistor_voltage, _resistor_impedance),
    "RC": Kind(("r_ohm", "tau_second"), _rc_voltage, _rc_impedance),
}


def rc_circuit(r0_ohm, r_ohm, tau_second):
    """Circuit of a resistor and any number of RC pairs (thesis 2.7–2.13).

    Parameters
    ----------
    r0_ohm : scalar or (n,) series resistance [ohm].
    r_ohm, tau_second : sequences, one entry per pair, each a scalar or (n,) [ohm], [s].

    Returns
    -------
    circuit : tuple of Branch.
    """
    pairs = zip(r_ohm, tau_second, strict=True)
    rcs = [Branch("RC", {"r_ohm": r, "tau_second": tau}) for r, tau in pairs]
    return (Branch("R", {"r_ohm": r0_ohm}), *rcs)


def impedance(circuit, frequency_hertz):
    """Impedance of a circuit with scalar parameters.

    Parameters
    ----------
    circuit : tuple of Branch with scalar parameters.
    frequency_hertz : (m,) [Hz].

    Returns
    -------
    impedance_ohm : (m,) complex [ohm]; the imaginary part is negative for a capacitive arc.

    Raises
    ------
    Refusal : a branch of an unknown kind, or with other parameters than its kind has.
    """
    angular = 2.0 * np.pi * np.asarray(frequency_hertz, dtype=float)
    return sum(kind_of(b).impedance(angular, **b.parameters) for b in circuit)


def kind_of(branch):
    """Kind of a branch, refused where unknown or where its parameters do not fit the kind."""
    if branch.kind not in KINDS:
        raise Refusal(f"branch kind {branch.kind!r} is unknown; known are {', '.join(KINDS)}")
    kind = KINDS[branch.kind]
    if set(branch.parameters) != set(kind.parameters):
        found, wanted = ", ".join(branch.parameters), ", ".join(kind.parameters)
        raise Refusal(f"branch {branch.kind} has parameters {found}; it takes {wanted}")
    return kind
