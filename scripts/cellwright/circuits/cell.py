"""A cell: its tables over SoC, its OCV beyond their ends, its lags, and the one voltage of them.

What all rooms mean by the OCV at a SoC: linear between the points of a table; below 0 and above 1
straight on with the slope of the outermost half percent of SoC, where a particle's surface may run
empty before its mean does. All other parameters stay there what they are at the ends.

The voltage is the OCV and what each branch of a circuit adds, exactly for the hold of the current
between samples (`simulate`). A circuit of RC pairs over tables has a compiled twin of that, at a
few nanoseconds a sample (`simulate_counted`).
"""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.circuit import Branch, kind_of, rc_circuit
from cellwright.native import array, count, function, real
from cellwright.numerics.clock import refuse_backward
from cellwright.numerics.hysteresis import preisach
from cellwright.numerics.lags import HOLDS, lag, lag_by_charge, mean_over_steps
from cellwright.refusal import Refusal

MOST_PAIRS = 16  # as in native/simulate.c
TYPES = (count, array, count, count, array, count, count, *[array] * 4, count, array, real)
TYPES = (*TYPES, array, array)
NOT_FINITE = "a current is not finite"
END_SOC = 0.005  # over which the slope is taken with which an OCV goes on beyond its table
STEP = 1e-30  # of a complex step: its square vanishes beside any real part
SOC_STEP = 1e-5  # of the slope of an OCV, which need not take complex numbers


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
    # fmin and fmax, for a SoC that is not a number then has an interval too, and no value.
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
    return ocv_volt[(*cells, below)] + share * rise, rise * (ocv_volt.shape[-1] - 1)


def ocv_on_grid(ocv_volt, soc):
    """OCV as `ocv_and_slope` has it, without the slope [V]."""
    return ocv_and_slope(ocv_volt, soc)[0]


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


def checked_columns(columns):
    """Columns of a record as arrays of numbers (n,), in their order.

    Parameters
    ----------
    columns : dict of (n,), `time` among them.

    Raises
    ------
    Refusal : no sample, other lengths, values that are not finite, or a time that runs back.
    """
    arrays = [np.ascontiguousarray(column, float) for column in columns.values()]
    shapes = [f"{name} {one.shape}" for name, one in zip(columns, arrays, strict=True)]
    if len({one.shape for one in arrays}) != 1 or arrays[0].ndim != 1:
        raise Refusal(f"shapes are {', '.join(shapes)}; all must be (n,)")
    if not len(arrays[0]):
        raise Refusal("the record holds no sample")
    if not all(np.isfinite(one).all() for one in arrays):
        raise Refusal(f"{' or '.join(columns)} holds values that are not finite")
    refuse_backward(arrays[list(columns).index("time")])
    return arrays


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
    slope = (volt_at(surface + SOC_STEP) - volt_at(surface - SOC_STEP)) / (2 * SOC_STEP)
    return shift + 1j * slope * offset.imag


def _check_parameters(branch, shape):
    for name, value in branch.parameters.items():
        if np.ndim(value) and np.shape(value) != shape:
            given = f"{name} of branch {branch.kind} has shape {np.shape(value)}"
            raise Refusal(f"{given}; it must be a scalar or one value per sample, {shape}")
        if not np.isfinite(value).all():
            raise Refusal(f"{name} of branch {branch.kind} is not finite")


class Tables(NamedTuple):
    """A cell's parameters on a uniform grid of SoC from 0 to 1, with p points.

    ocv_volt, r0_ohm : (p,) [V], [ohm]. r_ohm : (pairs, p) [ohm].
    tau_second : (pairs,), or (pairs, p) where it moves with SoC [s].
    """

    ocv_volt: np.ndarray
    r0_ohm: np.ndarray
    r_ohm: np.ndarray
    tau_second: np.ndarray


def simulate_counted(
    tables, step_second, current_ampere, *, initial_soc, capacity_ampere_hour, hold
):
    """Voltage of a cell from rest, its SoC counted from the current.

    Parameters
    ----------
    tables : Tables; linear in SoC between the points. Outside 0…1 the OCV goes on as steeply as it
        ends, all else stays what it is.
    step_second : scalar for uniform samples, which is the fastest, or (n−1,) true steps [s]; zero
        is allowed (an edge of the current).
    current_ampere : (n,) positive on charge [A].
    initial_soc : state of charge at the first sample [1].
    capacity_ampere_hour : charge from SoC 0 to 1 [Ah].
    hold : "zero_order" (the current keeps its value until the next sample) or "first_order" (it
        moves on a straight line to the next sample).

    Returns
    -------
    voltage_volt, soc : (n,) each [V], [1].

    Raises
    ------
    Refusal : tables of different lengths, an unknown hold, a step below zero, values that are not
        finite, a time constant or a capacity that is not positive.

    Source: exact solution of tau·du/dt = R·I − u between samples, with R·I held as the current is;
    thesis (2.8), (2.12) and (2.21). R moves with SoC at the samples, tau from sample to sample.
    """
    if not capacity_ampere_hour > 0:
        raise Refusal(f"capacity is {capacity_ampere_hour} Ah; it has to be positive")
    if not np.isfinite(initial_soc):
        raise Refusal(f"SoC at the first sample is {initial_soc}")
    tables, current, step = _checked_tables(tables, step_second, current_ampere, hold)
    soc, ampere_second = np.empty(len(current)), 3600.0 * capacity_ampere_hour
    soc[0] = initial_soc
    kernel = function("simulate", *TYPES, result=count)
    if kernel is None or len(tables.r_ohm) > MOST_PAIRS:
        if not np.isfinite(current).all():
            raise Refusal(NOT_FINITE)
        return _by_branches(tables, step, current, soc, hold, ampere_second), soc
    (pairs, points), moves = tables.r_ohm.shape, tables.tau_second.ndim == 2
    voltage, rows = np.empty(len(current)), np.empty(2 * (points - 1) * (2 + pairs + moves * pairs))
    settings = (len(step) != len(current) - 1, hold == "first_order")
    cell = (pairs, points - 1, *tables, moves, rows, ampere_second)
    if not kernel(len(current), step, *settings, current, *cell, soc, voltage):
        raise Refusal(NOT_FINITE)
    return voltage, soc


def _by_branches(tables, step, current, soc, hold, ampere_second):
    """The kernel's result by the branches of `overpotentials`, their parameters looked up."""
    steps = np.broadcast_to(step, len(current) - 1)
    moved = steps * mean_over_steps(current, hold) / ampere_second
    soc[:] = np.cumsum(np.append(soc[0], moved))
    grid = np.linspace(0.0, 1.0, len(tables.ocv_volt))
    r0, r, tau = (
        [values if np.ndim(values) == 0 else np.interp(soc, grid, values) for values in columns]
        for columns in ([tables.r0_ohm], tables.r_ohm, tables.tau_second)
    )
    over = [_response(branch, steps, current, hold) for branch in rc_circuit(r0[0], r, tau)]
    return ocv_on_grid(tables.ocv_volt, soc) + sum(over)


def _checked_tables(tables, step_second, current_ampere, hold):
    """Tables and current as contiguous arrays, and the step: one value where all are alike.

    That every current is finite is looked at by the kernel on its way.
    """
    current = np.ascontiguousarray(current_ampere, float)
    ocv, r0, r, tau = (np.asarray(column, float) for column in tables)
    points = len(ocv)
    shapes = {r0.shape, r.shape[1:], tau.shape[1:]}
    if points < 2 or not shapes <= {(points,), ()}:
        raise Refusal(f"tables of {points} points of OCV, but of shapes {shapes} of the others")
    if not (tau > 0).all():
        raise Refusal("a time constant is zero, negative or not a number")
    if hold not in HOLDS:
        raise Refusal(f"hold of the current is {hold!r}; allowed are {', '.join(HOLDS)}")
    step = np.ascontiguousarray(step_second, float)  # a single one as well has one axis
    if len(current) < 1 or (np.ndim(step_second) and len(step) != len(current) - 1):
        raise Refusal(f"{len(step)} steps for {len(current)} currents; one less is needed")
    shortest, longest = (step.min(), step.max()) if len(step) > 1 else (step.sum(), step.sum())
    if not (shortest >= 0 and longest < np.inf):
        raise Refusal("a step is below zero or not finite")
    whole = (ocv, r0 if r0.ndim else np.full(points, r0), r, tau)
    tables = Tables(*map(np.ascontiguousarray, whole))
    return tables, current, step[:1] if shortest == longest else step
