"""How well the charge of a record is counted, by the instrument and by steps between its rows."""

import numpy as np

from cellwright.records.conditions import at_rest
from cellwright.series.edges import edge_variance
from cellwright.settings.tests import Instrument

INSTRUMENT = Instrument()
SOC_STD = 0.003  # of the SoC of a row, where models are fitted and where they are used


def counted_std_share(
    record, *, capacity_ampere_hour, accuracy_share=INSTRUMENT.current_accuracy_share
):
    """Standard deviation of the SoC that a record counts, over the SoC that it passes [1].

    Under load the current may be off by up to a share of its range (a uniform distribution), which
    holds at least the largest current of the record; rests show what a zero reads. That may be read
    under load as well, or not at all: nothing tells which. Steps of the current between two rows
    lie anywhere between them.

    Parameters
    ----------
    record : Record.
    capacity_ampere_hour : that its SoC refers to [Ah].
    accuracy_share : `current_accuracy_share` of `settings.Instrument` [1].

    Returns
    -------
    share : [1]; infinite where the SoC stands.
    """
    time, current = record.test_time_second, record.current_ampere
    rests = at_rest(current, capacity_ampere_hour)
    interval_hour = np.diff(time) / 3600.0
    loaded_hour = interval_hour[~(rests[1:] & rests[:-1])].sum()
    at_zero_ampere = np.median(current[rests]) if rests.any() else 0.0
    most = (
        accuracy_share * np.abs(current).max() * loaded_hour,
        at_zero_ampere * interval_hour.sum(),
    )
    edges = edge_variance(time, current, record.soc * capacity_ampere_hour).sum()
    std_ampere_hour = np.hypot(np.linalg.norm(most) / np.sqrt(3.0), np.sqrt(edges))
    passed_ampere_hour = np.ptp(record.soc) * capacity_ampere_hour
    return float(std_ampere_hour / passed_ampere_hour) if passed_ampere_hour > 0 else np.inf
