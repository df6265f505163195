"""Base of the search whose voltage was simulated elsewhere, by any model: `external`."""

import numpy as np

from cellwright.effects.given.case import Given, given_case
from cellwright.refusal import Refusal


def external_case(prepared, simulated):
    """Case of what any model lacks whose voltage was simulated elsewhere.

    Parameters
    ----------
    prepared : case.Prepared of the plain circuit, of the tests that were simulated.
    simulated : dict test → (time (n,) of the test [s], voltage (n,) [V]).

    Returns
    -------
    case : case.Case.

    Raises
    ------
    Refusal : a voltage that is not finite, a clock that runs back, or a simulation that does not
        cover its test; with the test.
    """
    sides = (
        Given(np.concatenate([_read_off(record, simulated[record.test]) for record in records]))
        for records in prepared.records
    )
    return given_case(prepared.case, *sides)


def _read_off(record, curve):
    """A simulated voltage at the rows of a record (n,) [V]."""
    second, volt = (np.asarray(column, float) for column in curve)
    if len(second) != len(volt) or not np.isfinite(volt).all() or np.any(np.diff(second) < 0):
        raise Refusal(
            f"{record.test}: the simulated voltage has {len(volt)} values at {len(second)} times; "
            "as many finite values as times that do not run back were wanted"
        )
    wanted = record.test_time_second
    slack = np.median(np.diff(wanted)) if len(wanted) > 1 else 0.0
    if second[0] > wanted[0] + slack or second[-1] < wanted[-1] - slack:
        raise Refusal(
            f"{record.test}: simulated from {second[0]:g} to {second[-1]:g} s, the test has rows "
            f"from {wanted[0]:g} to {wanted[-1]:g} s"
        )
    return np.interp(wanted, second, volt)
