"""When the current stepped between two rows where nothing counts it: the voltage decides."""

import numpy as np

from cellwright.circuits.circuit import member_named
from cellwright.identification.choice import NEAR
from cellwright.identification.identify import identify
from cellwright.numerics.statistics import rms
from cellwright.records.conditions import REFERENCE_CELSIUS
from cellwright.records.filled import with_edges
from cellwright.refusal import Refusal

PLAIN = member_named("DRT")
# Share of the interval that lies before the step: a tester that stores the end of a step and then
# counts anew, and one that stores a step's beginning.
SHARES = {0.0: "the later current flowed from the row before", 1.0: "the earlier one to the next"}


def uncounted_edges(by_temperature, data_of_records, *, capacity_ampere_hour):
    """Where the current stepped at edges of which neither charge nor pace tells, by the voltage.

    Between two rows a current that steps somewhere is taken to move evenly, which is right in the
    mean and wrong at each: what is fitted to fast pulses and slow steps of one record then differs,
    and looks like kinetics or hysteresis. Of the two ends where a tester may have stored its rows,
    one counts where a plain circuit follows the records better with it by more than a tenth.

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
    given = next(
        (one for one in near if with_share(one, 0.0, capacity_ampere_hour) is not one), None
    )
    if given is None:
        return None, ""

    def misfit(share):
        records = with_share(given, share, capacity_ampere_hour)
        settings = {"capacity_ampere_hour": capacity_ampere_hour, "celsius": given.celsius}
        try:
            fit = identify(data_of_records(records), PLAIN, **settings)
        except Refusal:
            return np.inf
        return rms(fit.solution.residual_volt)

    errors = {share: misfit(share) for share in (None, *SHARES)}
    best = min(SHARES, key=errors.get)
    if errors[best] * NEAR < errors[None]:
        volts = f"{1e3 * errors[None]:.2g} to {1e3 * errors[best]:.2g} mV"
        said = f"{SHARES[best]}, by the voltage: a plain circuit errs by {volts}"
        return best, f"steps of the current between two rows: {said}"
    return None, ""


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
