"""Our circuits and particles against PyBaMM; needs the laboratory's own environment."""

import json

import numpy as np
import pytest

pytest.importorskip("pybamm", reason="the virtual laboratory's environment is not installed")

import pybamm
from one_particle import a_particle, in_use
from thevenin import load, thevenin

from cellwright.circuits.cell import simulate
from cellwright.circuits.circuit import rc_circuit
from cellwright.circuits.exports import pybamm_document
from cellwright.circuits.model_file import simulate_model
from runtime.artefact import plain

CAPACITY, R0, R, TAU = 2.9, 0.025, (0.012, 0.02), (8.0, 180.0)


def volt_at(soc):
    return 3.2 + 0.8 * soc


@pytest.fixture(scope="module")
def drive():
    """Half an hour of a random drive at 1 s, current positive on charge, and the counted SoC."""
    time = np.arange(0.0, 1801.0)
    rng = np.random.default_rng(1)
    current = np.convolve(rng.normal(-1.0, 8.0, len(time) + 4), np.ones(5) / 5, "valid")
    passed = np.concatenate([[0.0], np.cumsum((current[1:] + current[:-1]) / 7200)])
    return time, current, 0.8 + passed / CAPACITY


def peer(time, current):
    """PyBaMM's voltage, stopped at every sample, so that no step of its solver spans a kink."""
    model = pybamm.equivalent_circuit.Thevenin(options={"number of rc elements": 2})
    values = model.default_parameter_values
    values.update(
        {
            "Cell capacity [A.h]": CAPACITY,
            "Initial SoC": 0.8,
            "Current function [A]": pybamm.Interpolant(time, -current, pybamm.t),
            "Open-circuit voltage [V]": volt_at,
            "R0 [Ohm]": R0,
            "Upper voltage cut-off [V]": 9.0,
            "Lower voltage cut-off [V]": 0.0,
        }
    )
    pairs = {f"R{k}": r for k, r in enumerate(R, 1)} | {
        f"C{k}": tau / r for k, (r, tau) in enumerate(zip(R, TAU, strict=True), 1)
    }
    new = {f"{name} [{'Ohm' if name[0] == 'R' else 'F'}]": value for name, value in pairs.items()}
    new["Element-2 initial overpotential [V]"] = 0.0
    values.update(new, check_already_exists=False)
    solver = pybamm.IDAKLUSolver(rtol=1e-9, atol=1e-10)
    solution = pybamm.Simulation(model, parameter_values=values, solver=solver).solve(
        time, t_interp=time
    )
    return solution["Voltage [V]"].entries


def test_same_voltage_as_pybamm_where_the_current_runs_straight(drive):
    time, current, soc = drive
    ours = simulate(rc_circuit(R0, R, TAU), time, current, volt_at(soc), hold="first_order")
    held = simulate(rc_circuit(R0, R, TAU), time, current, volt_at(soc), hold="zero_order")
    theirs = peer(time, current)
    assert np.abs(ours - theirs).max() < 1e-5
    # Its interpolant runs straight between samples: held steps part from it by millivolts.
    assert np.abs(held - theirs).max() > 1e-3


KNOTS = [0.1, 0.3, 0.6, 0.9]
# Parameters of each kind of branch over SoC; all that the export knows, beside one it refuses.
BRANCHES = {
    "RC": {"r_ohm": [0.02, 0.012, 0.01, 0.013], "tau_second": [9.0, 8.0, 8.0, 10.0]},
    "R_two_way": {
        "r_charge_ohm": [0.01, 0.008, 0.008, 0.009],
        "r_discharge_ohm": [0.02, 0.009, 0.008, 0.008],
    },
    "kinetic": {
        "r_ohm": [0.05, 0.03, 0.03, 0.04],
        "tau_second": [0.5] * 4,
        "scale_volt": [0.05] * 4,
    },
    "warburg": {"r_ohm": [0.03, 0.02, 0.02, 0.02], "tau_second": [300.0] * 4},
    "hysteresis": {"m_volt": [0.02, 0.015, 0.01, 0.01], "charge_ampere_hour": [0.05] * 4},
    "switch": {"m_volt": [0.01] * 4},
    "diffusion": {"soc_per_ampere": [0.01] * 4, "tau_second": [900.0] * 4},
}
MEMBERS = {kind: [kind] for kind in BRANCHES} | {
    "simple": [],
    "2RC": ["RC", "RC"],
    "all": ["RC", "R_two_way", "kinetic", "warburg", "hysteresis"],
}
# Ten pairs, as a distribution of relaxation times has them: some are nothing at some SoC.
PAIRS = [
    {"kind": "RC", "r_ohm": [0.0, 0.004, 0.0, 0.003], "tau_second": [tau] * 4}
    for tau in np.geomspace(0.4, 4000, 10)
]


def model_file():
    """A cell of every kind of member at 25 °C, as a model file."""
    soc = np.linspace(0, 1, 201)
    entry = {
        "ambient_temperature_celsius": 25.0,
        "soc": KNOTS,
        "r0_ohm": [0.04, 0.03, 0.03, 0.031],
        "ocv_shift_volt": [0.0, 0.002, -0.001, 0.0],
        "ocv_scale": {"missing": 0.01, "stretch": 0.02},
    }
    ocv = {"soc": soc, "ocv_volt": volt_at(soc) + 0.1 * np.sin(6 * soc)}
    members = [
        {
            "model": name,
            "conditions": [entry | {"branches": [{"kind": k} | BRANCHES[k] for k in kinds]}],
        }
        for name, kinds in MEMBERS.items()
    ]
    members.append({"model": "DRT", "conditions": [entry | {"branches": PAIRS}]})
    return {
        "cell": "A",
        "capacity_ampere_hour": CAPACITY,
        "ocv": [ocv | {"ambient_temperature_celsius": 25.0}],
        "members": members,
        "chosen": "2RC",
    }


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    path = tmp_path_factory.mktemp("export") / "pybamm_thevenin.json"
    path.write_text(json.dumps(plain(pybamm_document(model_file()))))
    return path


@pytest.mark.parametrize(
    "member", [*(name for name in MEMBERS if name not in ("switch", "diffusion")), "DRT"]
)
def test_pybamm_runs_an_exported_cell_to_our_voltage(exported, drive, member):
    """On a grid so fine that look-ups and kinetics at the samples are those at all times."""
    coarse, levels, _ = drive
    time = np.linspace(0, 200, 8001)
    current = np.interp(time, coarse, levels)
    passed = np.concatenate([[0.0], np.cumsum((current[1:] + current[:-1]) / 2 / 40 / 3600)])
    soc = 0.8 + passed / CAPACITY
    model, values = thevenin(load(exported, member=member, celsius=25.0))
    values["Initial SoC"] = 0.8
    values["Current function [A]"] = pybamm.Interpolant(time, -current, pybamm.t)
    solver = pybamm.IDAKLUSolver(rtol=1e-8, atol=1e-9)
    simulation = pybamm.Simulation(model, parameter_values=values, solver=solver)
    solution = simulation.solve(coarse[:201], t_interp=time)
    ours = simulate_model(model_file(), member, time, current, soc, 25.0).voltage_volt
    off = np.abs(solution["Voltage [V]"].entries - ours)
    assert off.max() < 2e-5


@pytest.mark.parametrize(("member", "reason"), [("switch", "remembers"), ("diffusion", "sheet")])
def test_what_pybamm_cannot_run_is_named(exported, member, reason):
    with pytest.raises(ValueError, match=reason):
        load(exported, member=member, celsius=25.0)
    with pytest.raises(ValueError, match="not at 10"):
        load(exported, celsius=10.0)


def as_particle():
    """The cell with a particle in use whose courses change over SoC and whose charge is scaled."""
    cell = a_particle(
        ocv_shift_volt=np.linspace(0.01, -0.01, 16),
        ocv_volt_per_kelvin=np.linspace(-2e-4, 2e-4, 8),
        diffusion_per_second=np.linspace(-9.0, -7.0, 10),
        transfer_ohm=np.log(np.linspace(0.04, 0.01, 10)),
        hysteresis_volt=np.linspace(0.02, 0.005, 5),
        missing=[0.01, 0.02],
        stretch=[0.03, 0.01],
    )
    return in_use(model_file(), cell)


@pytest.mark.parametrize("celsius", [25.0, -7.0])
def test_pybamm_runs_a_particle_to_our_voltage(tmp_path, drive, celsius):
    """Two lengths of our steps tell where shorter ones lead; the first row is before any step."""
    path, model = tmp_path / "particle.json", as_particle()
    path.write_text(json.dumps(plain(pybamm_document(model))))
    coarse, levels = (column[:201] for column in drive[:2])

    def ours(member, many):
        time = np.linspace(0, 200, 200 * many + 1)
        current = np.interp(time, coarse, levels)
        passed = np.append(0.0, np.cumsum((current[1:] + current[:-1]) / 2 / many / 3600))
        record = time, current, 0.8 + passed / CAPACITY, celsius
        return simulate_model(model, member, *record).voltage_volt[many::many]

    limit = 2 * ours("P", 40) - ours("P", 20)
    particle, values = thevenin(load(path, celsius=celsius))
    values["Initial SoC"] = 0.8
    values["Current function [A]"] = pybamm.Interpolant(coarse, -levels, pybamm.t)
    simulation = pybamm.Simulation(particle, parameter_values=values)
    solution = simulation.solve(coarse, t_interp=coarse)
    assert np.abs(solution["Voltage [V]"].entries[1:] - limit).max() < 1e-4
    assert solution["SoC"].entries[-1] == pytest.approx(drive[2][200], abs=1e-6)
    # What stands in the file is the particle, not the circuit beside it.
    assert np.abs(ours("2RC", 1) - limit).max() > 0.02
