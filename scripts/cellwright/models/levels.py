"""How large the voltages over a circuit are under a load: what a filter doubts of them."""

import numpy as np

from cellwright.models.bank import NODES
from cellwright.models.kernels import lag


def levels_of(bank, current_ampere, curved):
    """RMS of every element's drive at half charge under a load.

    One level for the whole record: were the noise to follow the current, an error of a resistance
    would be heard at rest and not under load, and drive the SoC away, cycle by cycle.

    Parameters
    ----------
    bank : Bank.
    current_ampere : (n,) [A].
    curved : dict, index of an element that is not linear → its drives (n, nodes).

    Returns
    -------
    level_volt : (E,) [V].
    """
    half, levels = _half(bank), np.zeros(len(bank.elements))
    slope = (bank.ocv_volt[half + 1] - bank.ocv_volt[half - 1]) / (bank.soc[2] - bank.soc[0])
    for k, element in enumerate(bank.elements):
        middle = len(NODES) // 2
        drive = curved[k][:, middle] if k in curved else element.gain[half] * current_ampere
        levels[k] = np.sqrt(np.mean(drive**2)) * (slope if element.output == "soc" else 1.0)
    return levels


def edges_of(bank, level_volt, step_second, current_ampere, skew_second, *, hold):
    """Variance of the voltage that a change of the current leaves unknown for a while.

    Into and out of a load alike, so that it favours neither; a record that starts under load starts
    with a step.

    Parameters
    ----------
    bank : Bank.
    level_volt : (E,) from `levels_of` [V].
    step_second, current_ampere : (n,) [s], [A].
    skew_second : time by which the voltage may follow the current later than it was read [s].
    hold : how the current runs between two samples.

    Returns
    -------
    variance : (n,) [V²].
    """
    # ASSUME: Voltage and current are not read in the same moment, nor through the same filter: for
    # `skew_second` after a step the voltage may still be that of the current before.
    power = np.mean(current_ampere**2)
    if skew_second <= 0.0 or power == 0.0:
        return np.zeros(len(current_ampere))
    at_once = np.array([e.direct for e in bank.elements])
    for one in bank.lags:
        within = skew_second / (skew_second + one.constant[_half(bank)])
        at_once[one.element] += one.share * within * (one.clock == "second")
    behind = current_ampere - lag(step_second[1:], skew_second, current_ampere, hold=hold)
    return (level_volt @ at_once) ** 2 / power * behind**2


def _half(bank):
    return int(np.argmin(np.abs(bank.soc - 0.5)))
