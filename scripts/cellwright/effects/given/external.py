"""Base of the search whose voltage was simulated elsewhere, by any model: `external`.

A simulation is joined to its test by the test's own clock, at every row of the test, before the
rows are thinned: so it is averaged over the same bins as the measured voltage.
"""

from typing import NamedTuple

import numpy as np

from cellwright.effects.given.case import Given, given_case
from cellwright.refusal import Refusal

COLUMN = "simulated_voltage_volt"
GAP_STEPS, GAP_SECOND = 10.0, 30.0  # of the simulated clock: more between two values is a gap
GAP_SHARE = 0.05  # of the test's largest current, by which it may change within a gap
FAR_VOLT = 0.5  # median difference from the measured voltage, beyond which it is another quantity


class Simulated(NamedTuple):
    """A voltage that was simulated for a test.

    test_time_second, voltage_volt : (n,) on the clock of the test [s], [V].
    source : name of the file, for messages.
    """

    test_time_second: np.ndarray
    voltage_volt: np.ndarray
    source: str = "the simulation"


def with_simulated(tests, simulated):
    """Tests with the voltage that was simulated for them; the others take no part.

    Parameters
    ----------
    tests : list of MeasuredTest. simulated : dict test → Simulated.

    Returns
    -------
    tests : list of MeasuredTest, their series with the column `simulated_voltage_volt`.
    notes : list of str, which simulation could not be joined and why.

    Raises
    ------
    Refusal : a simulation of a test that there is not; none that can be joined.
    """
    known = [test.facts.test for test in tests]
    strange = [name for name in simulated if name not in known]
    if strange:
        raise Refusal(
            f"simulated: {', '.join(strange)}, no test that is searched; those are "
            f"{', '.join(known)}"
        )
    joined, notes = [], []
    for test in (test for test in tests if test.facts.test in simulated):
        name = test.facts.test
        try:
            volt = at_rows(simulated[name], test.series)
            joined.append(test._replace(series=dict(test.series) | {COLUMN: volt}))
        except Refusal as refusal:
            notes.append(f"not used: {name}: {refusal}")
    if not joined:
        raise Refusal(f"no simulated voltage can be joined to its test; {'; '.join(notes)}")
    return joined, notes


def at_rows(simulated, series):
    """A simulated voltage at the rows of a test, straight between its values: (n,) [V].

    Parameters
    ----------
    simulated : Simulated. series : dict of (n,) columns of the test.

    Raises
    ------
    Refusal : columns of different lengths, a value that is not finite, a clock that runs back, does
        not cover the test or leaves a gap in which the current of the test changes, or a quantity
        that cannot be the voltage of this test; with file, row and value.
    """
    second, volt = (np.asarray(column, float) for column in simulated[:2])
    _check_columns(simulated.source, second, volt)
    wanted = np.asarray(series["test_time_second"], float)
    _check_clock(simulated.source, second, wanted)
    _check_gaps(simulated.source, second, wanted, np.asarray(series["current_ampere"], float))
    found = np.interp(wanted, second, volt)
    apart = np.abs(found - series["voltage_volt"])
    if np.median(apart) > FAR_VOLT:
        row = int(np.argmax(apart))
        raise Refusal(
            f"{simulated.source}: at {wanted[row]:g} s {found[row]:g} V are simulated and "
            f"{series['voltage_volt'][row]:g} V measured, in the median {np.median(apart):.2g} V "
            f"apart; wanted the voltage of this test in volts, within {FAR_VOLT:g} V"
        )
    return found


def _check_columns(source, second, volt):
    """Refuse a simulation whose columns are no course of a voltage over time."""
    if len(second) != len(volt) or len(second) < 2:
        raise Refusal(
            f"{source}: {len(second)} times and {len(volt)} voltages; as many of each, two at "
            "least, were wanted"
        )
    for name, column in (("test time", second), ("simulated voltage", volt)):
        wrong = np.flatnonzero(~np.isfinite(column))
        if len(wrong):
            count = f", one of {len(wrong)}" if len(wrong) > 1 else ""
            raise Refusal(
                f"{source}: row {wrong[0] + 1}: the {name} is {column[wrong[0]]}{count}; wanted a "
                "number"
            )
    back = np.flatnonzero(np.diff(second) < 0)
    if len(back):
        row = back[0] + 1
        raise Refusal(
            f"{source}: row {row + 1}: the clock runs back from {second[row - 1]:g} to "
            f"{second[row]:g} s"
        )


def _check_clock(source, second, wanted):
    """Refuse a simulation that does not cover its test, by more than a step of either clock."""
    slack = max(_usual_step(second), _usual_step(wanted))
    if second[0] > wanted[0] + slack or second[-1] < wanted[-1] - slack:
        raise Refusal(
            f"{source}: simulated from {second[0]:g} to {second[-1]:g} s, the test has rows from "
            f"{wanted[0]:g} to {wanted[-1]:g} s; wanted the whole test on the test's own clock"
        )


def _check_gaps(source, second, wanted, current):
    """Refuse a gap of the simulated clock within which the current of the test changes."""
    limit = max(GAP_STEPS * _usual_step(second), GAP_SECOND)
    least = GAP_SHARE * np.abs(current).max(initial=0.0)
    for row in np.flatnonzero(np.diff(second) > limit):
        begin, end = second[row], second[row + 1]
        inside = current[(wanted > begin) & (wanted < end)]
        if len(inside) and np.ptp(inside) > least:
            raise Refusal(
                f"{source}: row {row + 2}: no value between {begin:g} and {end:g} s, where the "
                f"current of the test runs from {inside.min():g} to {inside.max():g} A"
            )


def _usual_step(second):
    return float(np.median(np.diff(second))) if len(second) > 1 else 0.0


def external_case(prepared):
    """Case of what any model lacks whose voltage was simulated elsewhere.

    Parameters
    ----------
    prepared : preparing.Prepared of the plain circuit, of tests from `with_simulated`.

    Returns
    -------
    case : case.Case.
    """
    sides = (
        Given(np.concatenate([record.simulated_volt for record in records]))
        for records in prepared.records
    )
    return given_case(prepared.case, *sides)
