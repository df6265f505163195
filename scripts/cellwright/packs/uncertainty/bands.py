"""How sure the currents and the voltage of a simulated pack are: cells as they may be as well.

All draws are simulated in one run (`copies`).
"""

import numpy as np

from cellwright.packs.uncertainty.copies import copies_at_once, simulate_copies
from cellwright.packs.wiring import member_currents, with_contacts

DRAWS = 50  # tell a standard deviation to a tenth: 1/√(2·50)
WITHIN_90_PERCENT = 1.6449  # standard deviations of a normal error


def band_of(
    run,
    cells,
    wiring,
    copy_of,
    *,
    time_second,
    total_ampere,
    ambient_celsius,
    starts,
    factors,
    thermal=None,
):
    """How far currents and voltage of a pack may be off, for what is not known of its cells.

    Each draw is the pack with other capacities, resistances, OCVs, SoC at the start and contacts;
    the deviation is the root mean square of what the draws are away from the pack as its models
    say. What differs from cell to cell moves the currents: the OCV of each as far as its own fit
    knows it. What models miss of a voltage that they have not seen may be the same in all cells; it
    then moves no current, shows in the voltage in full, and is the caller's to add.

    Parameters
    ----------
    run : PackRun of the pack as its models say, through the same record. cells : PackCells.
    wiring : Wiring. copy_of : function (draw) → PackCells of it, all with the same elements.
    time_second, total_ampere : (n,) [s], [A]. ambient_celsius : (n,) or scalar, of all cells.
    starts : (draws, cells) SoC at the start in each draw [1]. factors : (draws,) of the contacts.
    thermal : Thermal of the cells, or None: they have the ambient's temperature.

    Returns
    -------
    member_ampere, voltage_volt : (n, members), (n,) standard deviations [A], [V].
    """
    at_once = copies_at_once(cells, len(time_second))
    squares, squares_volt = 0.0, np.zeros(len(time_second))
    known = member_currents(wiring, run.cell_current_ampere)
    for first in range(0, len(factors), at_once):
        chosen = range(first, min(first + at_once, len(factors)))
        runs = simulate_copies(
            time_second,
            total_ampere,
            [copy_of(k) for k in chosen],
            [with_contacts(wiring, factors[k]) for k in chosen],
            initial_soc=starts[chosen],
            ambient_celsius=ambient_celsius,
            thermal=thermal,
        )
        for one in runs:
            squares = squares + (member_currents(wiring, one.cell_current_ampere) - known) ** 2
            squares_volt += (one.voltage_volt - run.voltage_volt) ** 2
    # About the pack as its models say, not about the mean of the draws: a shift is an error too.
    draws = len(factors)
    return np.sqrt(squares / draws), np.sqrt(squares_volt / draws)
