"""A model file as rows of a table; one cell's model out of a group's."""

import pytest
import truth

from cellwright.circuits.model_file import model_of
from cellwright.circuits.parameters import parameter_rows
from cellwright.refusal import Refusal


def model():
    true_model = truth.model()
    entry = true_model["members"][0]["conditions"][0]
    entry |= {
        "r0_std_ohm": [1e-4] * 5,
        "at_bound": [
            {"parameter": "tau2", "soc": None},
            {"parameter": "r1", "soc": entry["soc"][1]},
        ],
    }
    for branch in entry["branches"]:
        branch |= {"r_std_ohm": [2e-4] * 5, "tau_std_second": [0.5] * 5}
    return true_model


def test_a_group_hands_out_its_cells():
    assert model_of({"cell": "A", "chosen": "1RC"}, "A")["chosen"] == "1RC"
    assert model_of({"models": {"A": 1, "B": 2}}, "B") == 2
    with pytest.raises(Refusal, match="no model of C; it has A, B"):
        model_of({"models": {"A": 1, "B": 2}}, "C")


def test_every_parameter_at_every_soc_is_a_row():
    rows = parameter_rows(model())
    assert len(rows) == 5 * 5
    assert [row["parameter"] for row in rows[::5]] == ["r0", "r1", "tau1", "r2", "tau2"]
    assert {row["unit"] for row in rows if row["parameter"].startswith("tau")} == {"s"}
    assert [row["value"] for row in rows[:5]] == truth.R0.tolist()
    assert rows[5]["std"] == 2e-4
    assert all(row["model"] == "2RC" for row in rows)
    assert all(row["ambient_temperature_celsius"] == 25.0 for row in rows)


def test_r0_says_when_its_samples_lie_and_what_the_fit_misses_there():
    fitted = model()
    entry = fitted["members"][0]["conditions"][0]
    entry |= {"r0_std_ohm": [3e-4] * 4 + [None], "first_sample_second": 0.2}
    entry |= {"first_sample_missed_ohm": [-4e-4] * 5}
    rows = parameter_rows(fitted)
    assert [row["std"] for row in rows[:5]] == [pytest.approx(5e-4)] * 4 + [None]
    (delay,) = (row for row in rows if row["parameter"] == "r0_delay")
    assert (delay["value"], delay["unit"], delay["soc"]) == (0.2, "s", None)


def of_every_kind():
    same = [0.01] * 5
    pair = {"r_ohm": same, "tau_second": [60.0] * 5}
    kinetic = {"kind": "kinetic", "r_ohm": same, "scale_volt": same}
    branches = [
        kinetic | {"tau_second": [1e-3] * 5},
        kinetic | {"tau_second": [2.0] * 5, "r_std_ohm": [3e-3] * 5},
        {"kind": "RC"} | pair,
        {"kind": "diffusion", "soc_per_ampere": same, "tau_second": same},
        {"kind": "hysteresis", "m_volt": same, "charge_ampere_hour": same, "m_std_volt": same},
    ]
    whole = {"ocv_scale": {"missing": 0.02, "stretch": -0.01}, "ocv_shift_volt": same}
    whole |= {"activation_energy_joule_per_mole": 2e4}
    true_model = model()
    entry = true_model["members"][0]["conditions"][0] | whole
    flags = [
        {"parameter": "rct", "soc": entry["soc"][0]},
        {"parameter": "r1", "soc": entry["soc"][1]},
        {"parameter": "m", "soc": entry["soc"][2]},
    ]
    true_model["members"][0]["conditions"] = [entry | {"branches": branches, "at_bound": flags}]
    return parameter_rows(true_model)


def test_every_kind_of_branch_has_its_names_and_units():
    rows = of_every_kind()
    assert list(dict.fromkeys((row["parameter"], row["unit"]) for row in rows)) == [
        *[("r0", "Ohm"), ("rct", "Ohm"), ("tauct", "s"), ("scalect", "V")],
        *[("r1", "Ohm"), ("tau1", "s"), ("scale1", "V"), ("r2", "Ohm"), ("tau2", "s")],
        *[("diffusion_gain", "1/A"), ("diffusion_tau", "s")],
        *[("hysteresis_m", "V"), ("hysteresis_charge", "Ah"), ("ocv_shift", "V")],
        *[("ocv_missing", "1"), ("ocv_stretch", "1"), ("activation_energy", "J/mol")],
    ]
    assert [(row["value"], row["soc"]) for row in rows[-3:]] == [
        *[(0.02, None), (-0.01, None), (2e4, None)]
    ]
    stds = {row["parameter"]: row["std"] for row in rows}
    assert (stds["r1"], stds["hysteresis_m"], stds["rct"]) == (3e-3, 0.01, None)


def test_bounds_find_their_branch_where_charge_transfer_counts_apart():
    """R1 is the first pair that samples resolve, not the first branch."""
    bound = [(row["parameter"], row["soc"]) for row in of_every_kind() if row["at_bound"]]
    names, socs = zip(*bound, strict=True)
    assert names == ("rct", "r1", "hysteresis_m")
    assert socs == pytest.approx((0.1, 0.3, 0.5))


def test_bounds_are_marked_for_a_whole_parameter_or_at_one_soc():
    bound = [(row["parameter"], row["soc"]) for row in parameter_rows(model()) if row["at_bound"]]
    assert bound[0] == ("r1", pytest.approx(0.3))
    assert [name for name, _ in bound[1:]] == ["tau2"] * 5
