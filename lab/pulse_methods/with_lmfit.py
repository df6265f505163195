"""Fit of any circuit by lmfit, with parameters that a user may fix, bound, tie or add."""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.cell import sensitivities, simulate
from cellwright.circuits.circuit import KINDS, Branch, kind_of
from cellwright.numerics.statistics import is_white, parameter_covariance
from cellwright.refusal import Refusal

POSITIVE = ("r", "tau", "charge", "scale")  # first words of parameters that start at zero
OFFSET = "ocv_offset_volt"
LIMIT = 1e-6  # distance from a bound, in units of the parameter's size, that counts as on it


class LmfitFit(NamedTuple):
    """A circuit fitted by lmfit.

    names : of the parameters that were varied. values, std : (p,); std is NaN for a parameter at a
    bound (lmfit itself gives it a finite error there) or not told. at_bound : names of those.
    circuit : tuple of Branch with the fitted values. rmse_volt [V]. result : lmfit's own, with its
    report; its errors take residuals to be white.
    """

    names: tuple
    values: np.ndarray
    std: np.ndarray
    at_bound: tuple
    circuit: tuple
    rmse_volt: float
    result: object


def lmfit_parameters(circuit):
    """Parameters of a circuit for lmfit, named after branch and meaning: "r_ohm_0", "tau_second_1".

    All vary from their values in the circuit; resistances, time constants and scales from zero up.
    "ocv_offset_volt" is there, fixed at zero; set `vary` to free it. To tie two, give one an
    `expr`; to add one, `add` it and use it in an expression.

    Parameters
    ----------
    circuit : tuple of Branch with scalar parameters.

    Returns
    -------
    parameters : lmfit.Parameters.

    Raises
    ------
    Refusal : a branch of an unknown kind, or parameters that are not scalars.
    """
    from lmfit import Parameters

    parameters = Parameters()
    for index, branch in enumerate(circuit):
        names = kind_of(branch).parameters
        moving = [name for name in names if np.ndim(branch.parameters[name])]
        if moving:
            raise Refusal(f"{moving[0]} of branch {index} varies by sample; lmfit fits scalars")
        for name in names:
            low = 0.0 if name.split("_")[0] in POSITIVE else -np.inf
            parameters.add(f"{name}_{index}", value=float(branch.parameters[name]), min=low)
    parameters.add(OFFSET, value=0.0, vary=False)
    return parameters


def circuit_with(circuit, parameters):
    """The circuit with the values that lmfit's parameters have now.

    Parameters
    ----------
    circuit : tuple of Branch.
    parameters : lmfit.Parameters with the names of `lmfit_parameters`.
    """
    return tuple(
        Branch(b.kind, {name: parameters[f"{name}_{i}"].value for name in KINDS[b.kind].parameters})
        for i, b in enumerate(circuit)
    )


def fit_by_lmfit(circuit, parameters, record, *, hold):
    """Levenberg–Marquardt by lmfit, its Jacobian from the circuit's sensitivities.

    Parameters
    ----------
    circuit : tuple of Branch: which kinds in which order.
    parameters : lmfit.Parameters from `lmfit_parameters`, changed as the user likes.
    record : (test_time_second, current_ampere, voltage_volt, ocv_volt), as in `simulate`.
    hold : as in `simulate`.

    Returns
    -------
    fit : LmfitFit.

    Raises
    ------
    Refusal : as `simulate`; a voltage that is not finite or of another length; nothing varies.
    """
    from lmfit import Minimizer

    time, current, voltage, ocv = (np.asarray(column, float) for column in record)
    if voltage.shape != time.shape or not np.isfinite(voltage).all():
        raise Refusal(f"voltage has shape {voltage.shape}, time {time.shape}, or is not finite")
    if not any(p.vary for p in parameters.values()):
        raise Refusal("no parameter varies: all are fixed or tied")

    def residual(current_parameters):
        built = circuit_with(circuit, current_parameters)
        return (
            simulate(built, time, current, ocv, hold=hold)
            + current_parameters[OFFSET].value
            - voltage
        )

    def jacobian(current_parameters):
        by_own = sensitivities(circuit_with(circuit, current_parameters), time, current, hold=hold)
        columns = {f"{name}_{index}": column for (index, name), column in by_own.items()}
        return _chained(current_parameters, columns | {OFFSET: np.ones(len(time))})

    result = Minimizer(residual, parameters).leastsq(Dfun=jacobian)
    return _summary(circuit, result, residual(result.params), jacobian(result.params))


def _chained(parameters, columns):
    """Derivatives by the varied parameters (n, p), through the expressions of tied ones."""
    varied = [name for name, p in parameters.items() if p.vary]
    tied = [name for name in columns if parameters[name].expr]
    columns_varied = []
    for name in varied:
        total = columns.get(name, 0.0)
        for other, slope in _slopes(parameters, name, tied):
            total = total + slope * columns[other]
        columns_varied.append(np.broadcast_to(total, columns[OFFSET].shape))
    return np.column_stack(columns_varied)


def _slopes(parameters, name, tied):
    """Derivative of each tied parameter by one that varies, by central differences."""
    if not tied:
        return ()
    value = parameters[name].value
    step = 1e-5 * (abs(value) or 1.0)
    ends = []
    for shifted in (value + step, value - step):
        # Past a bound lmfit would clip the value, and with it the difference.
        inside = np.clip(shifted, parameters[name].min, parameters[name].max)
        parameters[name].value = inside
        parameters.update_constraints()
        ends.append([inside, *(parameters[other].value for other in tied)])
    parameters[name].value = value
    parameters.update_constraints()
    slope = np.subtract(*ends)
    return tuple(zip(tied, slope[1:] / slope[0], strict=True))


def _summary(circuit, result, residual, jacobian):
    names = tuple(result.var_names)
    values = np.array([result.params[name].value for name in names])
    limited = np.array([_at_bound(result.params[name]) for name in names])
    std = np.full(len(names), np.nan)
    free = ~limited & (np.abs(jacobian).max(axis=0) > 0)
    columns, power, lag_product = (
        jacobian[:, free].T,
        residual @ residual,
        residual[1:] @ residual[:-1],
    )
    series = {"sensitivity": columns, "residual": residual}
    series = {} if is_white(lag_product, power, len(residual)) else series
    spread = parameter_covariance(columns @ columns.T, power, len(residual), **series)
    std[free] = np.sqrt(np.diag(spread))
    return LmfitFit(
        names=names,
        values=values,
        std=std,
        at_bound=tuple(name for name, at in zip(names, limited, strict=True) if at),
        circuit=circuit_with(circuit, result.params),
        rmse_volt=float(np.sqrt(power / len(residual))),
        result=result,
    )


def _at_bound(parameter):
    size = max(abs(parameter.value), abs(parameter.init_value or 0.0))
    gap = min(parameter.value - parameter.min, parameter.max - parameter.value)
    return bool(gap <= LIMIT * size)
