"""A test of a parallel group laid out: total current, voltage, and the currents of its branches."""

from typing import NamedTuple

import numpy as np

from cellwright.records.record import cell_temperature
from cellwright.refusal import Refusal


class GroupRecord(NamedTuple):
    """One test of a group.

    test : its name. celsius : (n,) temperature around the cells [degC].
    branch_current_ampere : (n, branches), + on charge, or None where it was not logged [A].
    initial_soc : (branches,) stated at its start [1], or None.
    """

    test: str
    test_time_second: np.ndarray
    current_ampere: np.ndarray
    voltage_volt: np.ndarray
    celsius: np.ndarray
    branch_current_ampere: np.ndarray | None = None
    initial_soc: np.ndarray | None = None


def group_record(test, branches):
    """A test of a group as a record.

    Parameters
    ----------
    test : MeasuredTest of a group. branches : list of BranchFacts, in order of position.

    Returns
    -------
    record : GroupRecord, without branch currents where none were logged.

    Raises
    ------
    Refusal : another number of branch currents than of branches.
    """
    facts, series = test
    currents = branch_currents(series)
    if currents is not None and currents.shape[1] != len(branches):
        logged = f"{currents.shape[1]} branch currents"
        raise Refusal(f"{facts.test} has {logged} for {len(branches)} branches of groups.tsv")
    initial_soc = stated_soc(facts, branches)
    return GroupRecord(
        facts.test,
        series["test_time_second"],
        series["current_ampere"],
        series["voltage_volt"],
        cell_temperature(facts, series, as_read=True)[0],
        currents,
        None if None in initial_soc else np.array(initial_soc, float),
    )


def branch_currents(series):
    """Measured branch currents (n, branches) of a group's series [A], None where not logged.

    Parameters
    ----------
    series : dict of (n,) columns, those of the branches named branch_<k>_current_ampere.
    """
    names = [name for name in series if name.startswith("branch_")]
    names.sort(key=lambda name: int(name.split("_")[1]))  # branch 10 comes after 9, not after 1
    return np.column_stack([series[name] for name in names]) if names else None


def stated_soc(facts, branches):
    """SoC of each branch at the start of a test [1]: the test's, else the branch's; None: neither.

    Parameters
    ----------
    facts : TestFacts. branches : list of BranchFacts.
    """
    return [row.initial_soc if facts.soc is None else facts.soc for row in branches]
