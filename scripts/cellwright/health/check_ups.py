"""Slow curves of a cell, one for each check-up of its life."""

import numpy as np

from cellwright.health.alignment import SlowCurve
from cellwright.protocols.ocv.slow import slow_ocv
from cellwright.refusal import Refusal

SAME_CELSIUS = 3.0  # chamber temperatures this near are one
GROWN = 0.01  # of the capacity: by less than this a cell may gain from lithium of the overhang


def slow_curve(columns, test, *, cell, lower_cutoff_volt, upper_cutoff_volt, least_hour):
    """Voltage over charge of a slow test: the mean of its branches, or the only one.

    Parameters
    ----------
    columns : mapping of a clean series, (n,) each. test : TestFacts. cell : its name.
    lower_cutoff_volt, upper_cutoff_volt : [V].
    least_hour : a branch is slow if it takes longer than this [h].

    Returns
    -------
    curve : SlowCurve.

    Raises
    ------
    Refusal : no branch is slow, full and runs to its cut-off.
    """
    names = ("test_time_second", "current_ampere", "voltage_volt", "charge_ampere_hour")
    found = slow_ocv(
        *(columns[name] for name in names),
        file_index=columns.get("file_index"),
        lower_cutoff_volt=lower_cutoff_volt,
        upper_cutoff_volt=upper_cutoff_volt,
        least_hour=least_hour,
    )
    branch = {"charge": found.charge_volt, "discharge": found.discharge_volt}
    voltage = branch.get(found.branches, found.ocv_volt)
    measured = np.isfinite(voltage)
    currents = np.abs([found.discharge_current_ampere, found.charge_current_ampere])
    celsius = test.ambient_temperature_celsius
    return SlowCurve(
        cell=cell,
        test=test.test,
        cycle=float(test.cycle or 0.0),
        ambient_temperature_celsius=np.nan if celsius is None else float(celsius),
        c_rate=float(np.nanmax(currents) / found.capacity_ampere_hour),
        soc=found.soc[measured],
        voltage_volt=voltage[measured],
        capacity_ampere_hour=found.capacity_ampere_hour,
        branches=found.branches,
    )


def check_ups(curves):
    """One curve for each check-up, in order of age, and what was left out.

    Of several at one cycle that with both branches counts, else the slowest. All are of one
    temperature, that of the first, and where possible of the same branches: what polarisation and
    hysteresis do to one branch they do to the others.

    Parameters
    ----------
    curves : list of SlowCurve in any order.

    Returns
    -------
    chosen : list of SlowCurve. left_out : list of sentences.
    """
    if not curves:
        return [], []
    ordered = sorted(curves, key=lambda c: (c.cycle, c.branches != "both", c.c_rate))
    first, chosen, left_out = ordered[0], {}, []
    for curve in ordered:
        warmer = curve.ambient_temperature_celsius - first.ambient_temperature_celsius
        if abs(warmer) > SAME_CELSIUS:
            left_out.append(
                f"{curve.test}: made at {curve.ambient_temperature_celsius:g} °C, the first "
                f"check-up at {first.ambient_temperature_celsius:g} °C"
            )
        elif curve.cycle not in chosen:
            chosen[curve.cycle] = curve
    return list(chosen.values()), left_out


def growth(curves):
    """A sentence for each check-up whose capacity is more than that of the one before, by 1 %.

    Parameters
    ----------
    curves : list of SlowCurve in the order of age.
    """
    words = []
    for before, after in zip(curves, curves[1:], strict=False):
        share = after.capacity_ampere_hour / before.capacity_ampere_hour - 1
        if share > GROWN and before.cell == after.cell:
            words.append(
                f"{after.test}: capacity grew by {100 * share:.1f} % since {before.test}; is the "
                "order of the cycles right?"
            )
    return words


def need_two(curves, cell):
    """Refuse a life of fewer than two check-ups.

    Parameters
    ----------
    curves : list of SlowCurve. cell : its name.

    Raises
    ------
    Refusal : fewer than two.
    """
    if len(curves) < 2:
        found = ", ".join(f"{curve.test} at cycle {curve.cycle:g}" for curve in curves) or "none"
        raise Refusal(
            f"{cell}: slow curves of one check-up or none ({found}); losses need two, or a fresh "
            "cell of the type marked as reference. Is the column `cycle` of tests.tsv filled?"
        )
