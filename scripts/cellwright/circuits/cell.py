"""A cell: its tables over SoC, its OCV beyond their ends, its lags, and the one voltage of them.

What all rooms mean by the OCV at a SoC: linear between the points of a table; below 0 and above 1
straight on with the slope of the outermost half percent of SoC, where a particle's surface may run
empty before its mean does. All other parameters stay there what they are at the ends.

A SoC that is no number has no OCV, slope or parameter: looked up it gives NaN, and raises nothing;
a record with it is refused where it is simulated.

The voltage is the OCV and what each branch of a circuit adds, exactly for the hold of the current
between samples (`simulate`). native/cell.h says the same of a table and a lag in C, for the kernels
of packs, groups and filters.
"""

import numpy as np

from cellwright.circuits.circuit import Branch, kind_of
from cellwright.numerics.clock import checked_columns
from cellwright.numerics.hysteresis import preisach
from cellwright.numerics.lags import lag, lag_by_charge, mean_over_steps
from cellwright.refusal import Refusal

POINTS = 201  # of a table over SoC
END_SOC = 1 / (POINTS - 1)  # over which the slope is taken that an OCV has beyond its table
SIDE_SOC = 0.005  # to either side, over which a fit takes its slope
STEP = 1e-30  # of a complex step: its square vanishes beside any real part


def place(soc, points, *, first=0.0, spacing=None):
    """Where SoC lie on an even grid: the point below, and the share of the way to the next one.

    Beyond the ends the outermost interval is kept, with a share below 0 or above 1.

    Parameters
    ----------
    soc : number or array [1]. points : of the grid, two or more. first : of these [1].
    spacing : of the points [1]; None: the last one lies at 1.

    Returns
    -------
    below : int, shape of soc. share : shape of soc [1].
    """
    above = np.asarray(soc, float) - first
    spot = above * ((points - 1) / (1.0 - first)) if spacing is None else above / spacing
    # By fmin and fmax: a SoC that is no number has an interval to look at, and NaN for its share.
    below = np.fmax(np.fmin(spot, points - 2), 0).astype(int)
    return below, spot - below


def ocv_and_slope(ocv_volt, soc):
    """OCV of a table on an even grid from 0 to 1, straight on beyond it, and its slope over SoC.

    The grid's outermost interval is the slope there: half a percent of SoC on 201 points.

    Parameters
    ----------
    ocv_volt : (p,), or (cells, p) for one SoC a cell [V]. soc : number or array [1].

    Returns
    -------
    volt, slope_volt : shape of soc [V].
    """
    below, share = place(soc, ocv_volt.shape[-1])
    cells = () if ocv_volt.ndim == 1 else (np.arange(len(ocv_volt)),)
    rise = ocv_volt[(*cells, below + 1)] - ocv_volt[(*cells, below)]
    slope = np.where(np.isnan(share), np.nan, rise) * (ocv_volt.shape[-1] - 1)
    return ocv_volt[(*cells, below)] + share * rise, slope


def ocv_on_grid(ocv_volt, soc):
    """OCV as `ocv_and_slope` has it, without the slope, a third of its time [V]."""
    if ocv_volt.ndim > 1:
        return ocv_and_slope(ocv_volt, soc)[0]
    below, share = place(soc, len(ocv_volt))
    volt = ocv_volt[below]
    return volt + share * (ocv_volt[below + 1] - volt)


def usual_slope(ocv_volt, soc):
    """Slope of an OCV over one percent of SoC about each SoC [V]; of the shape of soc.

    What a fit takes for the slope: that of one interval follows the noise of a table.

    Parameters
    ----------
    ocv_volt, soc : as in `ocv_and_slope`.
    """
    above, below = (ocv_on_grid(ocv_volt, soc + side) for side in (SIDE_SOC, -SIDE_SOC))
    return (above - below) / (2 * SIDE_SOC)


def held_on_grid(values, soc):
    """Values (p,) on an even grid from 0 to 1 at SoC, linear between, flat beyond; unit of both.

    All but the OCV goes on so: resistances, time constants, errors of an OCV.
    """
    below, share = place(np.clip(soc, 0.0, 1.0), len(values))
    return values[below] + share * (values[below + 1] - values[below])


def continued(volt_at, soc):
    """OCV at any SoC by a look-up that knows those from 0 to 1, straight on beyond them [V].

    Parameters
    ----------
    volt_at : function of SoC (n,), within 0 to 1 [1], and of a mask (n,) of the samples that they
        belong to → (m,) [V]. soc : (n,) [1].
    """
    soc = np.asarray(soc, float)
    volt = volt_at(np.clip(soc, 0.0, 1.0), np.ones(soc.shape, bool))
    for end, inner, beyond in ((0.0, END_SOC, soc < 0.0), (1.0, 1.0 - END_SOC, soc > 1.0)):
        if beyond.any():
            at_end, inside = (volt_at(np.full(beyond.sum(), at), beyond) for at in (end, inner))
            volt[beyond] += (soc[beyond] - end) * (at_end - inside) / (end - inner)
    return volt


def overpotentials(circuit, test_time_second, current_ampere, *, hold, open_circuit=None):
    """Voltage over each branch of a circuit that starts from rest.

    Parameters
    ----------
    circuit : tuple of Branch; parameters are scalars or (n,) values looked up per sample.
    test_time_second : (n,) never falling [s]; equal stamps are an edge of the current.
    current_ampere : (n,) positive on charge [A].
    hold : "zero_order" or "first_order": how the current runs between two samples.
    open_circuit : OCV over SoC (function of (n,) [1] → (n,) [V]) and the counted SoC (n,) [1], for
        circuits with a branch that shifts the SoC (diffusion).

    Returns
    -------
    overpotential_volt : (branches, n) [V].

    Raises
    ------
    Refusal : no sample, time runs back, values or parameters are not finite, lengths differ, an
        unknown hold or branch, or a branch that shifts the SoC without an OCV to shift.

    Source: exact solution of tau·du/dt = R·I − u between samples; thesis (2.8), (2.12), with the
    time step of each sample instead of one constant; of hysteresis (2.6), (2.16) with the sign of
    the current, which the print leaves out.
    """
    time, current = checked_columns({"time": test_time_second, "current": current_ampere})
    over_volt = []
    for branch in circuit:
        _check_parameters(branch, current.shape)
        output = _response(branch, np.diff(time), current, hold)
        over_volt.append(
            _shifted(output, open_circuit) if kind_of(branch).output == "soc" else output
        )
    return np.array(over_volt)


def simulate(circuit, test_time_second, current_ampere, ocv_volt, *, hold, open_circuit=None):
    """Terminal voltage: open-circuit voltage plus the voltage over every branch.

    Parameters
    ----------
    circuit, test_time_second, current_ampere, hold, open_circuit : as in `overpotentials`.
    ocv_volt : scalar or (n,) open-circuit voltage at each sample [V].

    Returns
    -------
    voltage_volt : (n,) [V].
    """
    # ASSUME: Every simulated record starts from rest: all its relaxation voltages begin at zero.
    settings = {"hold": hold, "open_circuit": open_circuit}
    return ocv_volt + overpotentials(circuit, test_time_second, current_ampere, **settings).sum(0)


def sensitivities(circuit, test_time_second, current_ampere, *, hold, open_circuit=None):
    """Derivative of the terminal voltage by every parameter of a circuit.

    By complex steps: the circuit is simulated once a parameter with an imaginary part of 1e-30 on
    it, whose imaginary output is the derivative, exact to rounding. So no derivative is written by
    hand, and every kind has its own.

    Parameters
    ----------
    circuit, test_time_second, current_ampere, hold, open_circuit : as in `overpotentials`.

    Returns
    -------
    sensitivity : dict (index of the branch, name of the parameter) → (n,) [V per its unit]. A
        parameter given per sample is moved as a whole.

    Source: W. Squire, G. Trapp, SIAM Review 40 (1998) 110.
    """
    settings = {"hold": hold, "open_circuit": open_circuit}
    derivatives = {}
    for index, branch in enumerate(circuit):
        for name in kind_of(branch).parameters:
            shifted = branch.parameters | {name: branch.parameters[name] + 1j * STEP}
            single = (Branch(branch.kind, shifted),)
            run = overpotentials(single, test_time_second, current_ampere, **settings)
            derivatives[index, name] = run[0].imag / STEP
    return derivatives


def _response(branch, steps, current, hold):
    """Output of a branch (n,) [V] or [1]: the share that acts at once plus its lags."""
    kind = kind_of(branch)
    if kind.closes:
        return closing(branch, steps, current, hold)
    lags = kind.lags(**branch.parameters)
    drive = kind.drive(current, **branch.parameters)
    if any(lagged.clock == "ampere_hour" for lagged in lags):
        return _by_charge(kind, branch.parameters, lags, steps, current, hold)
    output = (1.0 - sum(lagged.share for lagged in lags)) * drive
    for lagged in lags:
        output = output + lagged.share * lag(steps, _at_start(lagged.constant), drive, hold=hold)
    return output


def _by_charge(kind, parameters, lags, steps, current, hold):
    """Sum of the lags that move with the charge passed, each step with its mean current."""
    between = mean_over_steps(current, hold)
    drive = kind.drive(between, **{name: _at_start(value) for name, value in parameters.items()})
    passed = np.abs(between) * steps / 3600.0
    return sum(
        lagged.share * lag_by_charge(passed, _at_start(lagged.constant), drive) for lagged in lags
    )


def closing(branch, steps, current, hold, *, start=0.0):
    """Voltage (n,) of a hysteresis whose small loops close [V].

    Parameters
    ----------
    branch : Branch of such a kind. steps : (n−1,) [s]. current : (n,) [A]. hold : see
    `overpotentials`. start : state before the first sample, −1 to 1.
    """
    charge = _at_start(branch.parameters["charge_ampere_hour"])
    moved = mean_over_steps(current, hold) * steps / 3600.0 / charge
    fresh = np.eye(1, len(current))[0]
    state = preisach(np.append(0.0, moved), np.full(len(current), float(start)), fresh)
    return branch.parameters["m_volt"] * state


def _at_start(value):
    """Value at the start of each step; a scalar stays a scalar."""
    return value if np.ndim(value) == 0 else np.asarray(value)[:-1]


def _shifted(offset, open_circuit):
    if open_circuit is None:
        raise Refusal("a branch shifts the SoC, but no OCV over SoC is given")
    volt_at, soc = open_circuit
    surface = soc + np.real(offset)
    shift = volt_at(surface) - volt_at(soc)
    if not np.iscomplexobj(offset):
        return shift
    # An OCV need not take complex numbers.
    slope = (volt_at(surface + 1e-5) - volt_at(surface - 1e-5)) / 2e-5
    return shift + 1j * slope * offset.imag


def _check_parameters(branch, shape):
    for name, value in branch.parameters.items():
        if np.ndim(value) and np.shape(value) != shape:
            given = f"{name} of branch {branch.kind} has shape {np.shape(value)}"
            raise Refusal(f"{given}; it must be a scalar or one value per sample, {shape}")
        if not np.isfinite(value).all():
            raise Refusal(f"{name} of branch {branch.kind} is not finite")
