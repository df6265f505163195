"""Curves of the page Compare: what is in them, in their units, and how many points they keep."""

import numpy as np
import pandas as pd

from runtime import compare_page

VOLT = np.linspace(3.0, 4.0, 1001)
CURVE = {"voltage_volt": VOLT, "charge_ampere_hour": VOLT, "dv_dq_volt_per_ampere_hour": 1 / VOLT}
CURVE |= {"dq_dv_ampere_hour_per_volt": np.where(np.arange(1001) == 500, 9.0, 1.0)}
CURVE |= {"dq_dv_std_ampere_hour_per_volt": 0 * VOLT}


def section(paths=(), simulated=(), capacity=None, resistance=None, chosen=None):
    found = compare_page.section(paths, simulated, capacity, resistance, chosen or {})
    return {one["id"]: one["curves"] for one in found.get("quantities", ())}


def test_curves_of_stages_and_tables_have_the_units_of_their_axes(saved):
    soc = np.linspace(0.0, 1.0, 5)
    slow = {"soc": soc, "ocv_volt": 3.0 + soc} | dict.fromkeys(
        ("discharge_volt", "charge_volt", "half_gap_volt"), soc
    )
    paths = [
        saved("results/stages/ocv/A/slow.parquet", slow),
        saved("results/stages/ica_curve/A/ica.parquet", CURVE),
        saved("results/stages/ocv/B/slow.parquet", "no slow test"),
    ]
    pulses = pd.DataFrame(
        {"cell": "A", "test": "hppc", "direction": "discharge", "delay_second": "10"}
        | {"soc": ["0.9", "0.1", ""], "resistance_ohm": ["0.03", "0.05", "0.04"]}
    )
    found = section(paths, resistance=pulses)
    assert [*found] == ["ocv", "dqdv", "resistance"]
    (ocv,) = found["ocv"]
    assert (ocv["cell"], ocv["label"]) == ("A", "slow")
    assert ocv["x"] == [0.0, 25.0, 50.0, 75.0, 100.0]
    assert ocv["y"][-1] == 4.0
    (pulse,) = found["resistance"]
    assert pulse["label"] == "hppc, discharge, 10 s"
    assert (pulse["x"], pulse["y"]) == ([10.0, 90.0], [50.0, 30.0]), "along SoC, in milliohm"


def test_a_thinned_curve_keeps_its_peak(saved):
    path = saved("results/stages/ica_curve/A/ica.parquet", CURVE)
    ((curve,),) = section([path]).values()
    assert len(curve["x"]) <= compare_page.MOST_POINTS + 2
    assert curve["x"][int(np.argmax(curve["y"]))] == 3.5
    assert max(curve["y"]) == 9.0


def test_residuals_are_those_of_the_model_in_use(saved):
    time = np.arange(0.0, 7200.0, 100.0)
    volt = 3.7 + 0 * time
    lines = {"test_time_second": time, "current_ampere": 0 * time, "voltage_volt": volt}
    lines |= {"soc": 0.5 + 0 * time, "scored": time >= 0, "simulated_2RC_volt": volt - 0.002}
    path = saved("results/stages/simulation/A/udds.parquet", lines)
    ((curve,),) = section(simulated=[path], chosen={("A", "udds"): "2RC"}).values()
    assert set(curve["y"]) == {2.0}
    assert curve["x"][-1] < 2.0
    assert section(simulated=[path], chosen={("A", "udds"): "1RC"}) == {}
