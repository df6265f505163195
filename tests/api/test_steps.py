"""Steps that neither the page of examples nor the demo campaign goes through."""

from pathlib import Path

import numpy as np

import cellwright as cw

DATA = Path(__file__).resolve().parents[2] / "data" / "C5"
CELL = cw.CellFacts("C5", 5.0, 2.5, 4.2)


def test_the_curve_from_the_rests_of_pulses_is_that_of_the_slow_test():
    slow = cw.clean(cw.read(DATA / "ocv_25C.bdf.csv.gz"))
    capacities = cw.capacity(slow, cw.segment(slow, CELL), CELL, whole_swing=True)
    pulses = cw.clean(cw.read(DATA / "hppc_25C.bdf.csv.gz"))
    of_slow = cw.TestFacts("ocv_25C", "ocv", ambient_temperature_celsius=25.0, soc=1.0)
    of_pulses = cw.TestFacts("hppc_25C", "hppc", ambient_temperature_celsius=25.0, soc=1.0)
    rests = cw.ocv_from_rests(
        pulses,
        cw.segment(pulses, CELL),
        CELL,
        of_pulses,
        [(of_slow, capacities)],
    )
    curve = cw.ocv(slow, CELL).curve
    soc = np.asarray(rests.points["soc"])
    inside = (soc > 0.15) & (soc < 0.95)
    assert inside.sum() >= 5
    expected_volt = np.interp(soc[inside], curve.soc, curve.ocv_volt)
    measured_volt = np.interp(soc[inside], rests.curve.soc, rests.curve.ocv_volt)
    assert np.abs(measured_volt - expected_volt).max() < 0.03
