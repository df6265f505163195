"""R0 of a cell and its kin: each by its definition, from a circuit that is known."""

import numpy as np
import pytest

from cellwright.health.resistances import resistances_of_cell

R0, RCT, SCALE, R1, TAU = 0.010, 0.020, 0.05, 0.004, 5.0
AMPERE = -5.0


def behind_kinetics(second, *, ampere=AMPERE):
    """Voltage over current of the known circuit, its charge transfer over within a sample."""
    transfer = SCALE * np.arcsinh(RCT * ampere / SCALE) / ampere
    return R0 + transfer + R1 * -np.expm1(-second / TAU)


def pulse(delay, soc=0.5, **other):
    row = {"test": "hppc", "soc": soc, "direction": "discharge", "delay_second": delay}
    row |= {"actual_delay_second": delay or 0.01, "current_ampere": AMPERE, "c_rate": 1.0}
    row |= {"ambient_temperature_celsius": 25.0, "cycle": None, "start_time_second": 100 * soc}
    row |= {"resistance_ohm": behind_kinetics(delay or 0.01), "resistance_std_ohm": 1e-4}
    return row | other


def model():
    soc = [0.0, 1.0]
    branches = [
        {"kind": "kinetic", "r_ohm": [RCT] * 2, "tau_second": [1e-3] * 2, "scale_volt": [SCALE] * 2}
        | dict.fromkeys(("r_std_ohm", "tau_std_second", "scale_std_volt"), [None] * 2),
        {"kind": "RC", "r_ohm": [R1] * 2, "tau_second": [TAU] * 2}
        | dict.fromkeys(("r_std_ohm", "tau_std_second"), [None] * 2),
    ]
    condition = {"ambient_temperature_celsius": 25.0, "soc": soc, "branches": branches}
    condition |= {"r0_ohm": [R0] * 2, "r0_std_ohm": [0.001, 0.002]}
    member = {"model": "1RC+K", "conditions": [condition]}
    return {"cell": "A", "chosen": "1RC+K", "members": [member]}


def by_name(rows):
    return {row["name"]: row for row in rows}


def test_the_true_model_gives_the_measured_resistances_at_the_pulses_own_current():
    rows = resistances_of_cell([pulse(0), pulse(10), pulse(0, soc=0.9)], [], model(), {})
    found = by_name(rows)
    assert rows[0]["name"] == "R0"
    assert found["R0"]["soc"] == 0.5
    for when in ("first sample", "after 10 s"):
        measured = found["R0" if when == "first sample" else when]["resistance_ohm"]
        assert found[f"model, {when}"]["resistance_ohm"] == pytest.approx(measured, rel=1e-4)
    assert found["model, parameter r0"]["resistance_ohm"] == pytest.approx(R0)
    assert found["model, parameter r0"]["resistance_std_ohm"] == pytest.approx(0.0015)
    assert found["model at small currents"]["resistance_ohm"] == pytest.approx(R0 + RCT)
    ratio = behind_kinetics(10) / behind_kinetics(0.01)
    assert found["after 10 s"]["over_r0"] == pytest.approx(ratio)
    assert all(row["definition"] for row in rows)


def test_a_doubt_of_the_pulse_stays_with_r0():
    found = by_name(
        resistances_of_cell([pulse(0, doubt="did the voltage answer?")], [], model(), {})
    )
    assert found["R0"]["doubt"] == "did the voltage answer?"
    assert found["model, first sample"]["doubt"] is None


def test_spectra_and_the_search_stand_beside_it():
    spectrum = {"test": "eis", "soc": 0.52, "ambient_temperature_celsius": 25.0}
    spectrum |= {"r_ohmic_ohm": 0.008, "r_ohmic_ohm_std": 3e-4}
    # With 2 mΩ of a faster arc; what one has less the other has more.
    spectrum |= {"r_before_diffusion_ohm": 0.027, "r_before_diffusion_ohm_std": 5e-4}
    cold = spectrum | {"ambient_temperature_celsius": 0.0, "r_ohmic_ohm": 0.02}
    sizes = [
        {"name": "R0 at small currents", "value": 30.0, "std": 0.5, "unit": "mΩ"},
        {"name": "at 1C", "value": 26.0, "std": float("nan"), "unit": "mΩ"},
    ]
    other = [{"name": "time constant", "value": 3.0, "std": 1.0, "unit": "s"}]
    verdict = {"effects": [{"sizes": sizes}, {"sizes": other}, {}]}
    found = by_name(resistances_of_cell([pulse(0)], [cold, spectrum], {}, verdict))
    assert found["spectrum, ohmic"]["resistance_ohm"] == 0.008
    both = found["spectrum, with charge transfer"]
    assert (both["resistance_ohm"], both["resistance_std_ohm"]) == pytest.approx((0.027, 5e-4))
    assert found["search, R0 at small currents"]["resistance_std_ohm"] == pytest.approx(5e-4)
    assert found["search, R0 at 1C"]["resistance_ohm"] == pytest.approx(0.026)
    assert found["search, R0 at 1C"]["resistance_std_ohm"] is None
    assert len(found) == 5


def test_without_a_pulse_there_is_no_r0_and_nothing_is_set_against_it():
    assert resistances_of_cell([], [], model(), {}) == []
    far = pulse(0, soc=0.9)
    assert resistances_of_cell([far], [], model(), {}) == []
    cold = pulse(0, ambient_temperature_celsius=0.0)
    assert resistances_of_cell([cold], [], {}, {}) == []
