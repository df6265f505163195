"""A discharge as the mirror image of a charge, for dQ/dV of both by one method."""

import numpy as np

from cellwright.protocols.ica.curve import IncrementalCapacity, Peaks
from cellwright.records.conditions import SAME_RATE
from cellwright.refusal import Refusal

NO_CURVE = IncrementalCapacity(*np.zeros((len(IncrementalCapacity._fields), 0)))
NO_PEAKS = {
    **{"c_rate": np.zeros(0), "peak": np.zeros(0, int)},
    **dict.fromkeys(Peaks._fields, np.zeros(0)),
    "doubt": np.zeros(0, str),
}


def mirrored(columns, steps):
    """A record in which discharges are charges: current, voltage and charge of the other sign.

    columns : time [s], current [A], voltage [V], charge [Ah], (n,) each. steps : columns of Steps.

    Returns columns, steps : as those given.
    """
    time, *others = columns
    turned = {"current_mean_ampere": -np.asarray(steps["current_mean_ampere"])}
    return [time, *(-np.asarray(column) for column in others)], steps | turned


def refuse_faster(c_rate, steps):
    """Refuse a discharge that is faster than the fullest charge of its record.

    c_rate : of the discharge [1/h]. steps : Steps of the record. A record without a charge at
    constant current has none that is slower.
    """
    charging = np.isin(steps.kind, ["CC", "CCCV"]) & (steps.current_mean_ampere > 0)
    if not charging.any():
        return
    main = np.argmax(np.where(charging, steps.charge_ampere_hour, 0.0))
    if c_rate > SAME_RATE * steps.c_rate[main]:
        raise Refusal(
            f"at {c_rate:.3g}C it is faster than the charge of the test, {steps.c_rate[main]:.3g}C"
        )
