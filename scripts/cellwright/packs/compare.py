"""A pack's record beside its simulation: where it starts, what passed, how large the errors are."""

import numpy as np

from cellwright.numerics.statistics import rms
from cellwright.records.conditions import at_rest_in_record
from cellwright.refusal import Refusal


def passed_ampere_hour(time_second, ampere):
    """Charge from sample to sample (n − 1, …) [Ah], of currents (n, …) straight between them."""
    steps = np.diff(time_second).reshape(-1, *[1] * (np.ndim(ampere) - 1))
    return steps * (ampere[1:] + ampere[:-1]) / 7200.0


def discharging(current_ampere):
    """Rows (n,) of a record in which it is discharged."""
    return (current_ampere < 0) & ~at_rest_in_record(current_ampere)


def refuse_start_under_load(record, of="in groups.tsv"):
    """Refuse a record that begins under load: its voltages then do not tell the SoC.

    Parameters
    ----------
    record : Record without a stated SoC at its start. of : where it is not stated, in words.
    """
    if not at_rest_in_record(record.current_ampere)[0]:
        raise Refusal(f"initial_soc is not stated {of}, and the record begins under load")


def rested_soc(ocv_volt, volt):
    """SoC at which an open-circuit voltage is met [1].

    Parameters
    ----------
    ocv_volt : (p,) on an even grid of SoC from 0 to 1 [V]; where it falls it counts as flat.
    volt : number [V].
    """
    rising = np.maximum.accumulate(ocv_volt)
    return float(np.interp(volt, rising, np.linspace(0.0, 1.0, len(rising))))


def scores(error):
    """Root mean square, largest, mean and mean absolute value of an error (n,), and its samples.

    Of what is finite; NaN where nothing is.
    """
    known = error[np.isfinite(error)]
    if not len(known):
        return dict.fromkeys(("mean_abs", "rmse", "max_abs", "mean"), np.nan) | {"samples": 0}
    size = np.abs(known)
    found = {"mean_abs": size.mean(), "rmse": rms(known), "max_abs": size.max()}
    found = {name: float(value) for name, value in (found | {"mean": known.mean()}).items()}
    return found | {"samples": len(known)}
