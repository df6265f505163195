"""When the current stepped between two rows where nothing counts it: the voltage decides."""

import numpy as np

from cellwright.circuits.circuit import member_named
from cellwright.identification.choice import NEAR
from cellwright.identification.identify import SHORTEST_SECOND, identify
from cellwright.numerics.statistics import rms
from cellwright.protocols.pulse_edges import BETWEEN, NOT_SETTLED, edges_of, first_rows
from cellwright.records.conditions import REFERENCE_CELSIUS
from cellwright.records.filled import uncounted_are_paced, with_edges
from cellwright.refusal import Refusal

PLAIN = member_named("DRT")
# ASSUME: Where the rows do not tell otherwise a tester stores the end of a step, as it does where
# their pace tells (`series.edges`): no part of the interval lies before the step.
AT_ROW_BEFORE = 0.0


def uncounted_edges(by_temperature, data_of_records, *, capacity_ampere_hour):
    """Where the current stepped at edges of which neither charge nor pace tells.

    Between two rows a current that steps somewhere may be taken to move evenly, which is right in
    the mean and wrong at each: a fast resistance is then too small by half an interval over its
    time constant, R0 too large, and by no scatter of the voltage. So it steps at the row before
    where a plain circuit follows the records better by more than a tenth; and, unless it follows
    worse by as much, where there are pulses, none of which show edges between rows (`pulse_edges`).

    Parameters
    ----------
    by_temperature : list of FitRecords. data_of_records : function (FitRecords) → columns.Data.
    capacity_ampere_hour : [Ah].

    Returns
    -------
    share : of each such interval that lies before the step [1]; None: as counted. words : sentence
        on it, "" where there is no such edge.
    """
    near = sorted(by_temperature, key=lambda one: abs(one.celsius - REFERENCE_CELSIUS))
    moved = [with_share(one, AT_ROW_BEFORE, capacity_ampere_hour) for one in near]
    pairs = zip(near, moved, strict=True)
    given = next(((one, other) for one, other in pairs if other is not one), None)
    if given is None:
        return None, ""

    def misfit(records):
        settings = {"capacity_ampere_hour": capacity_ampere_hour, "celsius": records.celsius}
        try:
            fit = identify(data_of_records(records), PLAIN, **settings)
        except Refusal:
            return np.inf
        return rms(fit.solution.residual_volt)

    even, stepped = (misfit(records) for records in given)
    if not stepped * NEAR < even:
        at_rows = stepped <= even * NEAR and _at_rows(by_temperature, capacity_ampere_hour)
        return (AT_ROW_BEFORE if at_rows else None), ""
    volts = f"{1e3 * even:.2g} to {1e3 * stepped:.2g} mV"
    said = "the later current flowed from the row before, by the voltage: a plain circuit errs by"
    return AT_ROW_BEFORE, f"steps of the current between two rows: {said} {volts}"


def _at_rows(by_temperature, capacity_ampere_hour):
    """Whether all uncounted edges are at the pace of the rows after, and no pulse says else.

    Where there are pulses whose rows are no closer than the shortest time constant: else it does
    not matter, or long loads alone would be fitted by rows that a few pairs do not follow.
    """
    records = [record for one in by_temperature for record in one.records]
    size = {"capacity_ampere_hour": capacity_ampere_hour}
    pulses = [
        first_rows(
            record.test_time_second,
            record.current_ampere,
            record.voltage_volt,
            record.soc,
            least_digit_volt=record.least_digit_volt,
            **size,
        )
        for record in records
        if record.kind == "hppc"
    ]
    apart = [pulse.apart_second for of_record in pulses for pulse in of_record]
    if not (apart and np.median(apart) > SHORTEST_SECOND):
        return False
    between = any(np.isin(edges_of(rows), (BETWEEN, NOT_SETTLED)).any() for rows in pulses)
    return not between and all(uncounted_are_paced(record, **size) for record in records)


def with_share(fit_records, share, capacity_ampere_hour):
    """FitRecords whose uncounted edges lie after this share of their interval; None: as they are.

    Parameters
    ----------
    fit_records : FitRecords. share : [1] or None. capacity_ampere_hour : [Ah].
    """
    if share is None:
        return fit_records
    about = {"capacity_ampere_hour": capacity_ampere_hour, "uncounted": share}
    records = tuple(with_edges(record, **about) for record in fit_records.records)
    same = all(a is b for a, b in zip(records, fit_records.records, strict=True))
    return fit_records if same else fit_records._replace(records=records)
