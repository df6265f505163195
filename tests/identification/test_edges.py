"""Where the current stepped between rows: fast resistances are right within their intervals."""

import numpy as np
from counted import counted

from cellwright.circuits.circuit import member_named
from cellwright.identification.edges import uncounted_edges, with_share
from cellwright.identification.identify import data_of, identify
from cellwright.records.record import FitRecords, record_of

CAPACITY, R0 = 5.0, 0.020
PAIRS = ((0.006, 1.5), (0.010, 60.0))
OCV_VOLT = np.linspace(3.2, 4.1, 201)
KNOTS = np.arange(0.15, 1.0, 0.1)


def hppc(seed, *, pairs=PAIRS, phase=None, noise=1e-4):
    """Pulses of a linear cell each 10 % SoC, rows each 0.1 s in them and each 10 s in the steps.

    A row lies at each edge and 0.1 s after it; with a phase, function of a generator, the current
    steps by that share of the interval before the first row.
    """
    random, time, current, level = np.random.default_rng(seed), [0.0], [0.0], []
    for _ in range(8):
        for ampere, second, step in (
            (-2.5, 720.0, 10.0),
            (0.0, 1800.0, 10.0),
            (0.0, 5.0, 0.1),
            (-5.0, 10.0, 0.1),
            (0.0, 40.0, 0.1),
            (5.0, 10.0, 0.1),
            (0.0, 300.0, 10.0),
        ):
            after = np.union1d([0.1], step * np.arange(1, round(second / step) + 1))
            time.extend(time[-1] + after)
            current.extend([ampere] * len(after))
            share = 1.0 if phase is None else phase(random)
            level.append((len(current) - len(after), share))
    time, current = np.array(time), np.array(current)
    # What flowed before a first row: part of its interval is the current of before.
    since = np.ones(len(time))
    since[[row for row, _ in level]] = [share for _, share in level]
    volt = simulated(time, current, since, pairs) + random.normal(0.0, noise, len(time))
    soc = 1.0 + counted(time, current) / CAPACITY
    record = record_of(time, current, volt, soc)._replace(kind="hppc")
    return FitRecords(25.0, (record,), True)


def simulated(time, current, since, pairs):
    """Voltage [V] at each row of a cell whose current steps within the intervals before rows."""
    state, charge, volt = np.zeros(len(pairs)), 0.0, np.zeros(len(time))
    ohm, tau = np.transpose(pairs)
    for row in range(len(time)):
        interval = time[row] - time[max(row - 1, 0)]
        parts = (current[max(row - 1, 0)], 1.0 - since[row]), (current[row], since[row])
        for ampere, part in parts:
            kept = np.exp(-part * interval / tau)
            state = kept * state + (1.0 - kept) * ohm * ampere
            charge += ampere * part * interval / 3600.0
        soc = 1.0 + charge / CAPACITY
        volt[row] = 3.2 + 0.9 * soc + R0 * current[row] + state.sum()
    return volt


def data(one):
    settings = {"capacity_ampere_hour": CAPACITY, "knots": KNOTS}
    return data_of(one.records, OCV_VOLT, **settings)


def pulls(condition):
    """(found − true)/stated of R0, and of the faster pair's resistance and time constant."""
    fast = condition.branches[0]
    named = (
        (condition.r0_ohm, R0, condition.r0_std_ohm),
        (fast.values["r_ohm"], PAIRS[0][0], fast.stds["r_ohm"]),
        (fast.values["tau_second"][:1], PAIRS[0][1], fast.stds["tau_second"][:1]),
    )
    return [(np.asarray(found) - true) / std for found, true, std in named]


def fitted(records):
    settings = {"capacity_ampere_hour": CAPACITY, "celsius": 25.0}
    return identify(data(records), member_named("2RC"), **settings).condition


def test_fast_resistances_of_a_linear_cell_are_right_within_their_intervals():
    found = []
    for seed in range(6):
        records = hppc(seed)
        share, words = uncounted_edges([records], data, capacity_ampere_hour=CAPACITY)
        assert (share, words) == (0.0, "")
        found.append(pulls(fitted(with_share(records, share, CAPACITY))))
    for values in zip(*found, strict=True):
        z = np.concatenate(values)
        assert np.mean(np.abs(z) <= 1.96) >= 0.9
        assert abs(np.mean(z)) < 1.0
    # Taken to move evenly between its rows, the current makes R0 too large and R1 too small.
    ohmic, fast, _ = (np.mean(z) for z in pulls(fitted(hppc(0))))
    assert ohmic > 1.5
    assert fast < -1.5


def test_edges_that_pulses_show_between_rows_stay_as_they_are():
    pairs = ((0.006, 0.15), (0.010, 60.0))
    records = hppc(1, pairs=pairs, phase=lambda random: random.uniform(0.05, 0.95))
    share, words = uncounted_edges([records], data, capacity_ampere_hour=CAPACITY)
    assert (share, words) == (None, "")
