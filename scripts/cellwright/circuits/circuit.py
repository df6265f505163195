"""Equivalent circuits as data: branches in series with the OCV, their kinds, the family's members.

Every branch is one thing: a drive (a static function of the current), of which a share acts at
once and the rest through first-order lags. Its voltage in time, its sensitivities and its states
in a filter all follow from that one definition. A new effect is a new entry in
`KINDS`, which holds all that any room must know of it: what a room does with a branch follows from
this entry and from the names of its parameters, never from a list of kinds of its own.

A member of the family that is identified is named by one grammar, `member_named`.
"""

import re
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from cellwright.native import array, count, function, real
from cellwright.numerics.sphere import sphere_roots
from cellwright.records.conditions import at_rest_in_record
from cellwright.refusal import Refusal

MODES = 5
UNRESOLVED_SECOND = 1e-3  # of a lag that is over before the next sample
TRANSFER_STEPS = 3  # of Halley's method, to rounding up to a hundred times the exchange current


class Branch(NamedTuple):
    """One element of a circuit: its kind and its parameters, scalars or one value per sample."""

    kind: str
    parameters: dict


class Lag(NamedTuple):
    """A first-order state: constant·ds/dp = drive − s, where p runs with the clock.

    clock : "second", or "ampere_hour": charge passed, whichever way (hysteresis).
    constant : time constant [s] or charge constant [Ah].
    share : what part of the drive goes through it [1].
    """

    clock: str
    constant: float
    share: float


class Kind(NamedTuple):
    """Definition of a kind of branch: parameters, drive and lags.

    parameters : names; their values come as keywords.
    drive : function (current_ampere, **parameters) → drive [V] (or [1]); turned, with the
        parameters of both ways exchanged, it is the negative.
    lags : function (**parameters) → tuple of Lag; what their shares leave acts at once.
    output : "volt", or "soc": an offset of the SoC at which the OCV is taken.
    linear : the drive is proportional to the current, so the branch has an impedance.
    closes : a turn of less charge than the last closes its loop (`numerics.hysteresis.preisach`);
        the lag is that of a whole branch, by which what knows only lags takes it.
    over_current : PyBaMM's Thevenin model has an element with these parameters, its resistance a
        function of the current. no_element : why that model has none, in words; "": it has one.
    """

    parameters: tuple
    drive: Callable
    lags: Callable
    output: str = "volt"
    linear: bool = True
    closes: bool = False
    over_current: bool = False
    no_element: str = ""

    @property
    def follows_charge(self):
        """Whether its voltage follows the charge that passed, not the current: a hysteresis."""
        return "m_volt" in self.parameters

    @property
    def of_charge_transfer(self):
        """Whether its resistance is that of charge transfer, which falls with the current."""
        return "r_ohm" in self.parameters and not self.linear


def _no_lag(**_parameters):
    return ()


def _one_lag(*, tau_second, **_parameters):
    return (Lag("second", tau_second, 1.0),)


def _modes(shares, constants, *, mean):
    """The first lags of a series, and one that stands for all later ones, as (constant, share).

    That one makes the sum of the shares 1 and their mean time constant what it is over the whole
    series, so that the steady state and the charge that flows in after a step are exact.
    """
    rest = 1.0 - shares.sum()
    return np.array(
        [*zip(constants, shares, strict=True), ((mean - shares @ constants) / rest, rest)]
    )


# Diffusion through a plane sheet: tanh(√s)/√s = Σ 2/(s + (n − ½)²π²) = 1 − s/3 + …
_PLANE = ((np.arange(MODES) + 0.5) * np.pi) ** 2
PLANE_MODES = _modes(2.0 / _PLANE, 1.0 / _PLANE, mean=1.0 / 3.0)
# Diffusion in a sphere under constant flux (Crank, The Mathematics of Diffusion, 6.45): surface
# minus mean, Σ 10/λₙ² = 1 and Σ 10/λₙ⁴ = 1/35 over the roots of tan λ = λ.
_SPHERE = sphere_roots(MODES) ** 2
SPHERE_MODES = _modes(10.0 / _SPHERE, 1.0 / _SPHERE, mean=1.0 / 35.0)


def _plane(*, tau_second, **_parameters):
    return tuple(Lag("second", tau_second * c, share) for c, share in PLANE_MODES)


def _sphere(*, tau_second, **_parameters):
    return tuple(Lag("second", tau_second * c, share) for c, share in SPHERE_MODES)


def _charge_lag(*, charge_ampere_hour, **_parameters):
    return (Lag("ampere_hour", charge_ampere_hour, 1.0),)


def _ohmic(current, *, r_ohm, **_parameters):
    return r_ohm * current


def _one_way(current, *, r_charge_ohm, r_discharge_ohm, **_parameters):
    return np.where(current.real > 0, r_charge_ohm, r_discharge_ohm) * current


def _kinetic(current, *, r_ohm, scale_volt, **_parameters):
    return scale_volt * np.arcsinh(r_ohm * current / scale_volt)


def _transfer(current, *, r_ohm, exchange_ampere, charge_coefficient):
    scale_volt, over_exchange = exchange_ampere * r_ohm, current / exchange_ampere
    if np.all(np.equal(charge_coefficient, 0.5)):
        return 2.0 * scale_volt * np.arcsinh(over_exchange / 2.0)
    return scale_volt * butler_volmer(over_exchange, charge_coefficient)


def butler_volmer(over_exchange, charge_coefficient):
    """Overpotential x of i = exp(a·x) − exp((a − 1)·x), over the thermal voltage [1].

    Parameters
    ----------
    over_exchange : i, (n,) current over the exchange current; complex for a derivative [1].
    charge_coefficient : a, scalar or (n,) transfer coefficient of charge, above 0 and below 1 [1].
    """
    kernel = function("transfer", count, count, real, array, array)
    one_for_all = np.ndim(charge_coefficient) == 0 and np.ndim(over_exchange) == 1
    if not kernel or not one_for_all or np.iscomplexobj(over_exchange + charge_coefficient):
        return _butler_volmer_twin(over_exchange, charge_coefficient)
    over_exchange = np.ascontiguousarray(over_exchange, float)
    x = np.empty(len(over_exchange))
    kernel(len(x), TRANSFER_STEPS, float(charge_coefficient), over_exchange, x)
    return x


def _butler_volmer_twin(over_exchange, charge_coefficient):
    sign = np.where(over_exchange.real < 0, -1.0, 1.0)
    own, size = 0.5 + sign * (charge_coefficient - 0.5), sign * over_exchange
    # From what it is where i is small, i, and where the first exponential rules, ln(1 + i)/a.
    x = np.log1p(size * (own + size) / (1.0 + size)) / own
    for _ in range(TRANSFER_STEPS):
        up, down = np.exp(own * x), np.exp((own - 1.0) * x)
        error, slope = up - down - size, own * up + (1.0 - own) * down
        x = x - error / (slope - 0.5 * error * (own**2 * up - (1.0 - own) ** 2 * down) / slope)
    return sign * x


def _last_sign(current, *, m_volt):
    """Sign of the current; at rest that of the last current, before the first one zero."""
    # ASSUME: A current below a hundredth of a record's largest is rest, not a turn of the load.
    sign = np.where(at_rest_in_record(current.real), 0.0, np.sign(current.real))
    last = np.maximum.accumulate(np.where(sign != 0, np.arange(len(sign)), 0))
    return m_volt * sign[last]


def _sign(current, *, m_volt, **_parameters):
    return m_volt * np.sign(current.real)


def _gain(current, *, soc_per_ampere, **_parameters):
    return soc_per_ampere * current


KINDS = {
    # Ohmic resistance.
    "R": Kind(("r_ohm",), _ohmic, _no_lag),
    # Ohmic resistance that differs by the direction of the current (thesis, appendix B).
    "R_two_way": Kind(
        *(("r_charge_ohm", "r_discharge_ohm"), _one_way, _no_lag), linear=False, over_current=True
    ),
    # RC pair (thesis 2.7–2.13). A state of the low-pass of (2.5), f' = α·f + I, is one with
    # r_ohm = −g/(1 − α), of either sign, and tau_second = −Δt/ln α.
    "RC": Kind(("r_ohm", "tau_second"), _ohmic, _one_lag),
    # RC pair whose resistance differs by the direction of the current.
    "RC_two_way": Kind(
        *(("r_charge_ohm", "r_discharge_ohm", "tau_second"), _one_way, _one_lag),
        linear=False,
        over_current=True,
    ),
    # Charge transfer by the Butler–Volmer equation with equal transfer coefficients, then an RC's
    # lag: resistance r_ohm at small currents; scale_volt is 2RT/F for one electrode.
    "kinetic": Kind(
        *(("r_ohm", "tau_second", "scale_volt"), _kinetic, _one_lag),
        linear=False,
        over_current=True,
    ),
    # The same without a lag, by its exchange current: V = r·I0·x, I/I0 = exp(a·x) − exp((a − 1)·x),
    # a the transfer coefficient of charge; 2·r·I0·asinh(I/2I0) at one half. Where r_ohm changes
    # with temperature or SoC, its scale in volts goes with it.
    "charge_transfer": Kind(
        *(("r_ohm", "exchange_ampere", "charge_coefficient"), _transfer, _no_lag),
        linear=False,
        no_element="its kinetics here have no lag, and a resistor that no element holds",
    ),
    # Finite-length Warburg element: r_ohm·tanh(√(jωτ))/√(jωτ).
    "warburg": Kind(("r_ohm", "tau_second"), _ohmic, _plane),
    # Diffusion in a sphere, as a voltage: its series from Crank 6.45.
    "warburg_sphere": Kind(("r_ohm", "tau_second"), _ohmic, _sphere),
    # One-state hysteresis (thesis 2.5, 2.16): relaxes to ±m_volt with the charge passed.
    "hysteresis": Kind(
        *(("m_volt", "charge_ampere_hour"), _sign, _charge_lag), linear=False, over_current=True
    ),
    # The same along a whole charge or discharge, but small loops close: stops of many widths.
    "preisach": Kind(
        *(("m_volt", "charge_ampere_hour"), _sign, _charge_lag),
        linear=False,
        closes=True,
        no_element="none of its elements remembers where the charge turned",
    ),
    # Zero-state hysteresis (thesis 2.3–2.4): ±m_volt by the sign of the last current, not of noise.
    "switch": Kind(
        *(("m_volt",), _last_sign, _no_lag),
        linear=False,
        no_element="none of its elements remembers at rest which way the last current ran",
    ),
    # Diffusion in the particles of the electrode that limits: the OCV is taken at the surface's
    # SoC, which leads the mean by soc_per_ampere·I in the steady state.
    "diffusion": Kind(
        *(("soc_per_ampere", "tau_second"), _gain, _sphere),
        output="soc",
        no_element="its diffusion element is a plane sheet, whose time constant also sets its "
        "size; here it is a sphere with both",
    ),
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


def kind_of(branch):
    """Kind of a branch, refused where unknown or where its parameters do not fit the kind."""
    if branch.kind not in KINDS:
        raise Refusal(f"branch kind {branch.kind!r} is unknown; known are {', '.join(KINDS)}")
    kind = KINDS[branch.kind]
    if set(branch.parameters) != set(kind.parameters):
        given, expected = ", ".join(branch.parameters), ", ".join(kind.parameters)
        raise Refusal(f"branch {branch.kind} has parameters {given}; it takes {expected}")
    return kind


OPTIONS = {"H": "hysteresis", "K": "kinetics", "D": "diffusion in the particles"}


class Member(NamedTuple):
    """Elements of one member of the family beside OCV and ohmic resistance.

    pairs : number of RC pairs with fitted time constants; None: a resistance on each of a fixed
        series of time constants ("DRT", distribution of relaxation times).
    hysteresis : a one-state hysteresis whose size depends on SoC.
    kinetic : the fast part of the resistance follows the Butler–Volmer equation.
    diffusion : the OCV is taken at the surface of the particles of one electrode.
    """

    name: str
    pairs: int | None
    hysteresis: bool
    kinetic: bool
    diffusion: bool


def member_named(name):
    """Member by its name: "0RC" … "4RC" or "DRT", then any of "+H", "+K", "+D".

    H is hysteresis, K kinetics, D diffusion. Of the thesis' six (chapter 2.2) "0RC" is the simple
    model, "1RC" and "2RC" are themselves, "1RC+H" is (2.14), and "2RC+H" is one-state hysteresis
    with its second-order low-pass (2.5), whose states are RC pairs. Zero-state hysteresis (2.3) is
    kind "switch" in series with a resistor, and has no name: it is not identified.

    Raises
    ------
    Refusal : another name.
    """
    base, *options = name.split("+")
    pairs = re.fullmatch(r"([0-4])RC|DRT", base)
    if not pairs or len(set(options)) != len(options) or not set(options) <= set(OPTIONS):
        raise Refusal(f"model {name!r} is unknown; allowed are 0RC … 4RC or DRT, then +H, +K, +D")
    number = None if pairs[1] is None else int(pairs[1])
    return Member(name, number, *(letter in options for letter in OPTIONS))


def size_of(member):
    """Number of courses over SoC and single parameters of a member, to prefer the simpler one.

    Parameters
    ----------
    member : Member.
    """
    pairs = 10 if member.pairs is None else member.pairs
    return 2 * pairs + 2 * member.hysteresis + 2 * member.kinetic + member.diffusion
