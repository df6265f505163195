"""The family of equivalent circuits by name: each member a tuple of branch kinds.

A member says what it is made of and nothing else; `circuit.KINDS` says what each kind does. A new
member is a new line here.
"""

import numpy as np

from cellwright.models.circuit import KINDS, Branch
from cellwright.refusal import Refusal

# Thesis chapter 2.2, in its order. Its low-pass states (2.5) are RC pairs: see `low_pass`.
THESIS_MEMBERS = {
    "simple": ("R",),
    "zero_state_hysteresis": ("R", "switch"),
    "one_state_hysteresis": ("R", "hysteresis", "RC", "RC"),
    "1RC": ("R", "RC"),
    "2RC": ("R", "RC", "RC"),
    "1RC_hysteresis": ("R", "RC", "hysteresis"),
}

MEMBERS = THESIS_MEMBERS | {
    "3RC": ("R", "RC", "RC", "RC"),
    "2RC_hysteresis": ("R", "RC", "RC", "hysteresis"),
    "1RC_two_way": ("R_two_way", "RC"),
    "warburg": ("R", "RC", "warburg"),
    "kinetic": ("R", "kinetic", "RC"),
    "diffusion": ("R", "RC", "diffusion"),
    "kinetic_diffusion": ("R", "kinetic", "diffusion"),
    "kinetic_diffusion_hysteresis": ("R", "kinetic", "diffusion", "hysteresis"),
}


def kinds_of(name):
    """Branch kinds of a member by its name.

    Parameters
    ----------
    name : name of a member, as "2RC".

    Returns
    -------
    kinds : tuple of names of `circuit.KINDS`.

    Raises
    ------
    Refusal : no member of that name.
    """
    if name not in MEMBERS:
        raise Refusal(f"member {name!r} is unknown; known are {', '.join(MEMBERS)}")
    return MEMBERS[name]


def parameter_names(name):
    """Names of a member's parameters, in the order of `member_circuit`.

    Parameters
    ----------
    name : name of a member.

    Returns
    -------
    names : tuple of (index of the branch, name of the parameter).
    """
    kinds = kinds_of(name)
    return tuple((index, one) for index, kind in enumerate(kinds) for one in KINDS[kind].parameters)


def member_circuit(name, values):
    """Circuit of a member from a flat sequence of its parameters.

    Parameters
    ----------
    name : name of a member.
    values : one entry per `parameter_names`, each a scalar or (n,), in the unit its name says.

    Returns
    -------
    circuit : tuple of Branch.

    Raises
    ------
    Refusal : no such member, or another number of values than it has parameters.
    """
    kinds, names = kinds_of(name), parameter_names(name)
    if len(values) != len(names):
        raise Refusal(f"{name} has {len(names)} parameters, but {len(values)} values are given")
    parameters = [{} for _ in kinds]
    for (index, one), value in zip(names, values, strict=True):
        parameters[index][one] = value
    return tuple(Branch(kind, given) for kind, given in zip(kinds, parameters, strict=True))


def low_pass(gain_ohm, decay, *, step_second):
    """One state of the thesis' low-pass as an RC pair.

    The thesis adds g·f to the voltage, with f' = α·f + I at every sample and I > 0 discharging. On
    a constant step that is an RC pair with R = −g/(1 − α) and τ = −Δt/ln α, current positive on
    charge and held until the next sample; unlike g and α these keep their meaning when the step
    changes. R is negative where g is positive.

    Parameters
    ----------
    gain_ohm : g [ohm].
    decay : α, between 0 and 1 [1].
    step_second : Δt for which both are meant [s].

    Returns
    -------
    branch : Branch of kind RC.

    Raises
    ------
    Refusal : a decay that is not between 0 and 1.

    Source: thesis (2.5).
    """
    if not 0.0 < decay < 1.0:
        raise Refusal(f"decay of a low-pass state is {decay:g}; it must lie between 0 and 1")
    tau_second = -step_second / np.log(decay)
    return Branch("RC", {"r_ohm": -gain_ohm / (1.0 - decay), "tau_second": tau_second})
