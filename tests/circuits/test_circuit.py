"""The family of circuits: one set of properties that every kind and every member has to hold."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.optimize import brentq

from cellwright.circuits import circuit
from cellwright.circuits.cell import overpotentials, sensitivities, simulate
from cellwright.circuits.circuit import (
    KINDS,
    PLANE_MODES,
    SPHERE_MODES,
    Branch,
    rc_circuit,
)
from cellwright.circuits.circuit import butler_volmer as butler_volmer_of
from cellwright.numerics.hysteresis import WIDTHS, preisach
from cellwright.numerics.lags import HOLDS

SLOPE = 0.8
EXAMPLES = {
    "R": {"r_ohm": 0.02},
    "R_two_way": {"r_charge_ohm": 0.02, "r_discharge_ohm": 0.03},
    "RC": {"r_ohm": 0.01, "tau_second": 40.0},
    "RC_two_way": {"r_charge_ohm": 0.02, "r_discharge_ohm": 0.01, "tau_second": 40.0},
    "kinetic": {"r_ohm": 0.03, "tau_second": 2.0, "scale_volt": 0.05},
    "charge_transfer": {"r_ohm": 0.03, "exchange_ampere": 0.8, "charge_coefficient": 0.35},
    "warburg": {"r_ohm": 0.02, "tau_second": 300.0},
    "warburg_sphere": {"r_ohm": 0.02, "tau_second": 300.0},
    "hysteresis": {"m_volt": 0.015, "charge_ampere_hour": 0.05},
    "preisach": {"m_volt": 0.015, "charge_ampere_hour": 0.05},
    "switch": {"m_volt": 0.01},
    "diffusion": {"soc_per_ampere": 0.01, "tau_second": 900.0},
}


def settled(modes):
    """Step response of a series of lags of unit gain, over time in units of their time constant."""
    return lambda x: 1.0 - np.exp(-np.divide.outer(x, modes[:, 0])) @ modes[:, 1]


def butler_volmer(current, charge):
    """Voltage in units of r·I0 at a current in units of I0: a root of the law itself."""
    law = lambda x: np.exp(charge * x) - np.exp((charge - 1.0) * x) - current  # noqa: E731
    return brentq(law, -60.0, 60.0, xtol=1e-14)


def within(moved):
    """Mean of stops that began at zero, after a charge in units of the charge constant."""
    return np.minimum(np.divide.outer(moved, WIDTHS), 1.0).mean(axis=-1)


PLANE, SPHERE = settled(PLANE_MODES), settled(SPHERE_MODES)
# Voltage of each kind at a constant current, from its definition: the oracle of the simulation.
CLOSED = {
    "R": lambda i, t, r_ohm: r_ohm * i + 0 * t,
    "R_two_way": lambda i, t, r_charge_ohm, r_discharge_ohm: (
        (r_charge_ohm if i > 0 else r_discharge_ohm) * i + 0 * t
    ),
    "RC": lambda i, t, r_ohm, tau_second: -r_ohm * i * np.expm1(-t / tau_second),
    "RC_two_way": lambda i, t, r_charge_ohm, r_discharge_ohm, tau_second: (
        (r_charge_ohm if i > 0 else r_discharge_ohm) * -i * np.expm1(-t / tau_second)
    ),
    "kinetic": lambda i, t, r_ohm, tau_second, scale_volt: (
        -scale_volt * np.arcsinh(r_ohm * i / scale_volt) * np.expm1(-t / tau_second)
    ),
    "charge_transfer": lambda i, t, r_ohm, exchange_ampere, charge_coefficient: (
        exchange_ampere * r_ohm * butler_volmer(i / exchange_ampere, charge_coefficient) + 0 * t
    ),
    "warburg": lambda i, t, r_ohm, tau_second: r_ohm * i * PLANE(t / tau_second),
    "warburg_sphere": lambda i, t, r_ohm, tau_second: r_ohm * i * SPHERE(t / tau_second),
    "hysteresis": lambda i, t, m_volt, charge_ampere_hour: (
        -m_volt * np.sign(i) * np.expm1(-abs(i) * t / 3600 / charge_ampere_hour)
    ),
    "preisach": lambda i, t, m_volt, charge_ampere_hour: (
        m_volt * np.sign(i) * within(abs(i) * t / 3600 / charge_ampere_hour)
    ),
    "switch": lambda i, t, m_volt: m_volt * np.sign(i) + 0 * t,
    "diffusion": lambda i, t, soc_per_ampere, tau_second: (
        SLOPE * soc_per_ampere * i * SPHERE(t / tau_second)
    ),
}


def member(kinds):
    return tuple(Branch(kind, EXAMPLES[kind]) for kind in kinds)


SINGLE = {kind: (kind,) for kind in KINDS}
# The thesis' six (chapter 2.2), and what else stands in series in models of ours.
SERIES = {
    "simple": ("R",),
    "zero_state_hysteresis": ("R", "switch"),
    "one_state_hysteresis": ("R", "hysteresis", "RC", "RC"),
    "1RC": ("R", "RC"),
    "2RC": ("R", "RC", "RC"),
    "1RC_hysteresis": ("R", "RC", "hysteresis"),
    "1RC_two_way": ("R_two_way", "RC"),
    "warburg": ("R", "RC", "warburg"),
    "kinetic_diffusion_hysteresis": ("R", "kinetic", "diffusion", "hysteresis"),
    "everything": tuple(KINDS),
}
CIRCUITS = {name: member(kinds) for name, kinds in (SINGLE | SERIES).items()}
LINEAR = [name for name, one in CIRCUITS.items() if all(KINDS[b.kind].linear for b in one)]
UNSWITCHED = [name for name, one in CIRCUITS.items() if all(b.kind != "switch" for b in one)]
every_circuit = pytest.mark.parametrize("name", CIRCUITS)
both_holds = pytest.mark.parametrize("hold", HOLDS)


def over(circuit, time, current, hold="first_order", volt_at=lambda soc: 3.0 + SLOPE * soc):
    """Voltage over each branch, of a cell at half charge."""
    time = np.asarray(time, float)
    curve = volt_at, np.full(len(time), 0.5)
    return overpotentials(circuit, time, current, hold=hold, open_circuit=curve)


def staircase(rng, levels=12):
    """Stamps and levels of a current that jumps, each level held over several uneven samples."""
    current = np.repeat(rng.uniform(-4, 4, levels), 7)
    current[rng.random(len(current) // 7).repeat(7) < 0.2] = 0.0
    return np.cumsum(rng.exponential(20.0, len(current))), current


def test_every_kind_has_an_example_and_a_closed_form():
    assert set(EXAMPLES) == set(CLOSED) == set(KINDS)
    assert all(set(EXAMPLES[kind]) == set(KINDS[kind].parameters) for kind in KINDS)


@both_holds
@pytest.mark.parametrize("current", [2.0, -3.0])
@every_circuit
def test_constant_current_is_the_closed_form(name, current, hold):
    time = np.cumsum(np.random.default_rng(1).exponential(3.0, 500))
    over_volt = over(CIRCUITS[name], time, np.full(500, current), hold)
    expected = [CLOSED[b.kind](current, time - time[0], **b.parameters) for b in CIRCUITS[name]]
    np.testing.assert_allclose(over_volt, expected, rtol=0, atol=1e-13)


@settings(deadline=None, max_examples=10)
@given(
    current=arrays(float, 30, elements=st.floats(-5, 5)),
    steps=arrays(float, 29, elements=st.floats(0, 100)),
    hold=st.sampled_from(HOLDS),
)
@every_circuit
def test_the_other_way_round_is_the_negative(name, current, steps, hold):
    """A two-way resistor or a charge transfer turns into the one with its ways exchanged."""
    swapped = {
        kind: EXAMPLES[kind]
        | {"r_charge_ohm": EXAMPLES[kind]["r_discharge_ohm"]}
        | {"r_discharge_ohm": EXAMPLES[kind]["r_charge_ohm"]}
        for kind in ("R_two_way", "RC_two_way")
    }
    transfer = EXAMPLES["charge_transfer"]
    transfer = transfer | {"charge_coefficient": 1.0 - transfer["charge_coefficient"]}
    swapped["charge_transfer"] = transfer
    circuit = CIRCUITS[name]
    mirror = [Branch(b.kind, swapped.get(b.kind, b.parameters)) for b in circuit]
    time = np.concatenate([[0.0], np.cumsum(steps)])
    expected = -over(circuit, time, current, hold)
    np.testing.assert_allclose(over(mirror, time, -current, hold), expected, atol=1e-14)


@settings(deadline=None, max_examples=10)
@given(
    currents=arrays(float, (2, 30), elements=st.floats(-5, 5)),
    steps=arrays(float, 29, elements=st.floats(0, 100)),
    hold=st.sampled_from(HOLDS),
)
@pytest.mark.parametrize("name", LINEAR)
def test_responses_of_linear_circuits_add_up(name, currents, steps, hold):
    time = np.concatenate([[0.0], np.cumsum(steps)])
    first, second, both = (
        over(CIRCUITS[name], time, current, hold) for current in (*currents, currents.sum(axis=0))
    )
    np.testing.assert_allclose(first + second, both, atol=1e-12)


@both_holds
@every_circuit
def test_a_finer_grid_changes_nothing_while_the_current_is_constant(name, hold):
    time, current = staircase(np.random.default_rng(2))
    between = (time[1:] + time[:-1]) / 2
    steady = current[1:] == current[:-1]
    place = np.flatnonzero(steady) + 1
    fine = np.insert(time, place, between[steady])
    finer = over(CIRCUITS[name], fine, np.insert(current, place, current[1:][steady]), hold)
    kept = np.delete(finer, place + np.arange(len(place)), axis=1)
    np.testing.assert_allclose(kept, over(CIRCUITS[name], time, current, hold), atol=1e-13)


@every_circuit
def test_equal_stamps_are_edges(name):
    """A staircase held until the next sample, and the same one with its edges written out."""
    time, current = staircase(np.random.default_rng(3))
    edges = np.repeat(time, 2)[1:]
    levels = np.repeat(current, 2)[:-1]
    held = over(CIRCUITS[name], time, current, "zero_order")
    drawn = over(CIRCUITS[name], edges, levels, "first_order")
    np.testing.assert_allclose(drawn[:, ::2], held, atol=1e-13)


@every_circuit
def test_parameters_per_sample_that_do_not_move_are_scalars(name):
    time, current = staircase(np.random.default_rng(4))
    many = [
        Branch(b.kind, {key: np.full(len(time), value) for key, value in b.parameters.items()})
        for b in CIRCUITS[name]
    ]
    expected = over(CIRCUITS[name], time, current)
    np.testing.assert_allclose(over(many, time, current), expected, rtol=1e-12, atol=1e-15)


def curved(soc):
    return 3.2 + 0.8 * soc + 0.1 * np.sin(6 * soc)


@both_holds
@every_circuit
def test_sensitivities_are_finite_differences(name, hold):
    time, current = staircase(np.random.default_rng(5))
    curve = curved, np.full(len(time), 0.5)
    derivatives = sensitivities(CIRCUITS[name], time, current, hold=hold, open_circuit=curve)
    for (index, key), derivative in derivatives.items():
        branch = CIRCUITS[name][index]
        value, step = branch.parameters[key], 1e-5 * branch.parameters[key]
        low, high = (
            over(
                [Branch(branch.kind, branch.parameters | {key: moved})], time, current, hold, curved
            )
            for moved in (value - step, value + step)
        )
        expected = (high - low)[0] / (2 * step)
        np.testing.assert_allclose(derivative, expected, atol=1e-7 * np.abs(expected).max())


def sheet(over):
    """Finite-length Warburg element over its resistance, of s·τ."""
    return np.tanh(np.sqrt(over)) / np.sqrt(over)


def ball(over):
    """Surface minus mean of a sphere under an alternating flux over its steady state, of s·τ."""
    root = np.sqrt(over)
    return 5 * (1 / (root / np.tanh(root) - 1) - 3 / over)


# Impedance at small currents: hysteresis follows the charge, a switch has no such limit.
OF_BOOKS = {
    "R": lambda s, r_ohm: r_ohm,
    "R_two_way": lambda s, r_charge_ohm, r_discharge_ohm: (r_charge_ohm + r_discharge_ohm) / 2,
    "RC": lambda s, r_ohm, tau_second: r_ohm / (1 + s * tau_second),
    "RC_two_way": lambda s, r_charge_ohm, r_discharge_ohm, tau_second: (
        (r_charge_ohm + r_discharge_ohm) / 2 / (1 + s * tau_second)
    ),
    "kinetic": lambda s, r_ohm, tau_second, scale_volt: r_ohm / (1 + s * tau_second),
    "charge_transfer": lambda s, r_ohm, exchange_ampere, charge_coefficient: r_ohm,
    "warburg": lambda s, r_ohm, tau_second: r_ohm * sheet(s * tau_second),
    "warburg_sphere": lambda s, r_ohm, tau_second: r_ohm * ball(s * tau_second),
    "hysteresis": lambda s, m_volt, charge_ampere_hour: m_volt / (3600 * charge_ampere_hour * s),
    "preisach": lambda s, m_volt, charge_ampere_hour: (
        m_volt * np.mean(1 / WIDTHS) / (3600 * charge_ampere_hour * s)
    ),
    "diffusion": lambda s, soc_per_ampere, tau_second: (
        SLOPE * soc_per_ampere * ball(s * tau_second)
    ),
}


@pytest.mark.parametrize("name", UNSWITCHED)
def test_a_small_sine_meets_the_impedance_of_the_books(name):
    """To 4 %, which six lags in place of diffusion leave."""
    time = np.arange(0, 3000, 0.05)
    wave = np.exp(2j * np.pi * 0.02 * time)
    last = slice(len(time) // 3 * 2, None)
    run = over(CIRCUITS[name], time, 1e-3 * wave.real).sum(axis=0)[last]
    measured = 2e3 * np.mean((run - run.mean()) * wave[last].conj())
    expected = sum(OF_BOOKS[b.kind](2j * np.pi * 0.02, **b.parameters) for b in CIRCUITS[name])
    diffusive = {"warburg", "warburg_sphere", "diffusion"} & {b.kind for b in CIRCUITS[name]}
    assert measured == pytest.approx(expected, rel=0.04 if diffusive else 2e-3)


@pytest.mark.parametrize(("modes", "area"), [(PLANE_MODES, 1 / 3), (SPHERE_MODES, 1 / 35)])
def test_modes_end_at_one_with_the_right_charge(modes, area):
    constants, shares = modes.T
    assert shares.sum() == pytest.approx(1.0, abs=1e-14)
    assert shares @ constants == pytest.approx(area, rel=1e-14)
    assert (np.diff(constants) < 0).all()


def test_noise_at_rest_turns_no_switch():
    current = np.array([0.0, -2.0, -2.0, 0.004, -0.003, 0.004, 1.0, 1e-3])
    run = over(member(["switch"]), np.arange(8.0), current)[0]
    np.testing.assert_array_equal(run, 0.01 * np.array([0, -1, -1, -1, -1, -1, 1, 1]))


def test_hysteresis_forgets_with_charge_not_with_time():
    time, current = np.array([0.0, 3600.0, 3600.0, 1e6, 1e6, 1e6 + 360]), [1, 1, 0, 0, -1, -1]
    run = over(member(["hysteresis"]), time, np.array(current, float))[0]
    full = 0.015 * -np.expm1(-1 / 0.05)
    assert run[1] == run[3] == pytest.approx(full)
    assert run[5] == pytest.approx((full + 0.015) * np.exp(-0.1 / 0.05) - 0.015)


def moved_along(*charges, start=-1.0):
    """State after each of several charges one after the other, in units of the charge constant."""
    fresh = np.eye(1, len(charges) + 1)[0]
    return preisach(np.array([0.0, *charges]), np.full(len(fresh), start), fresh)[1:]


def test_from_branch_to_branch_stops_are_the_one_state_hysteresis():
    steps = np.full(400, 0.01)
    expected = 1.0 - 2.0 * np.exp(-np.cumsum(steps))
    np.testing.assert_allclose(moved_along(*steps), expected, atol=0.02)
    np.testing.assert_allclose(moved_along(*-steps, start=1.0), -expected, atol=0.02)


@given(arrays(float, 20, elements=st.floats(-1, 1)), st.floats(0.01, 1.0), st.floats(0.01, 0.99))
def test_a_small_loop_closes_where_it_began(charges, out, share):
    """Back by as much as it went: the state is what it was, and the branch goes on as without."""
    loop = (-share * out, share * out)
    for further in ((), (0.3,)):
        once, twice = (
            moved_along(*charges, out, *further),
            moved_along(*charges, out, *loop, *further),
        )
        assert twice[-1] == pytest.approx(once[-1], abs=1e-12)


def test_a_load_that_gives_a_little_back_stays_on_its_branch():
    """Half is given back: the one-state hysteresis ends at a third of it, stops at their end."""
    current = np.tile([-2.0, 1.0], 600)
    time = 10.0 * np.arange(len(current))
    runs = [over(member([kind]), time, current, HOLDS[0])[0] for kind in ("hysteresis", "preisach")]
    last = [run[-2:].mean() / 0.015 for run in runs]
    np.testing.assert_allclose(last, [-1 / 3, -1.0], atol=0.12)


def test_compiled_stops_are_their_twin(monkeypatch):
    from cellwright.numerics import hysteresis

    rng = np.random.default_rng(8)
    moved, fresh = rng.normal(size=900) * 0.3, np.isin(np.arange(900), (0, 400)) * 1.0
    start = np.where(np.arange(900) < 400, -1.0, 0.4)
    run = preisach(moved, start, fresh)
    monkeypatch.setattr(hysteresis, "function", lambda *_: None)
    np.testing.assert_allclose(preisach(moved, start, fresh), run, atol=1e-13)


def test_zero_order_hold_is_scipys_filter_on_a_uniform_grid():
    from scipy.signal import lfilter

    current = np.random.default_rng(2).normal(size=20_000)
    time = 0.1 * np.arange(20_000)
    run = simulate(rc_circuit(0.02, [0.01, 0.03], [5.0, 200.0]), time, current, 3.7, hold=HOLDS[0])
    expected = 3.7 + 0.02 * current
    for r, tau in ((0.01, 5.0), (0.03, 200.0)):
        decay = np.exp(-0.1 / tau)
        expected = expected + lfilter([0.0, r * (1 - decay)], [1.0, -decay], current)
    np.testing.assert_allclose(run, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("gain", [0.003, -0.002])
def test_the_thesis_low_pass_is_an_rc_pair_of_either_sign(gain):
    """g·f with f' = α·f + I, discharge positive, is R = −g/(1 − α), tau = −step/ln α."""
    current, step, decay = np.random.default_rng(6).normal(size=400), 2.0, 0.97
    f = np.zeros(400)
    for k in range(399):
        f[k + 1] = decay * f[k] - current[k]
    pair = {"r_ohm": -gain / (1 - decay), "tau_second": -step / np.log(decay)}
    over_volt = over((Branch("RC", pair),), step * np.arange(400), current, HOLDS[0])
    np.testing.assert_allclose(over_volt[0], gain * f, atol=1e-13)


@pytest.mark.parametrize("charge", [0.2, 0.4, 0.5, 0.65, 0.8])
def test_charge_transfer_is_the_law_at_any_current(charge):
    """Small currents by the resistance, large ones by each direction's own logarithm."""
    over_exchange = np.concatenate([[-100.0, -3.0, -1e-3, 0.0], np.geomspace(1e-3, 100.0, 9)])
    size = {"r_ohm": 0.02, "exchange_ampere": 2.0, "charge_coefficient": charge}
    volt = KINDS["charge_transfer"].drive(2.0 * over_exchange, **size)
    expected = [0.04 * butler_volmer(one, charge) for one in over_exchange]
    np.testing.assert_allclose(volt, expected, rtol=1e-8, atol=1e-12)


@pytest.mark.parametrize("charge", [0.2, 0.35, 0.5, 0.8])
def test_the_kernel_of_charge_transfer_is_its_twin_and_the_law_itself(monkeypatch, charge):
    """From a billionth of the exchange current to a thousand of it; rows that fill no register."""
    size = np.geomspace(1e-9, 1e3, 101)
    current = np.concatenate([-size, [0.0], size])
    compiled = butler_volmer_of(current, charge)
    monkeypatch.setattr(circuit, "function", lambda *_, **__: None)
    # How exp is rounded is the processor's: of one exchange current, nothing.
    twin = butler_volmer_of(current, charge)
    np.testing.assert_allclose(compiled, twin, rtol=1e-12, atol=1e-15)
    within = np.abs(current) <= 100.0
    exact = [butler_volmer(i, charge) for i in current[within]]
    np.testing.assert_allclose(compiled[within], exact, rtol=1e-12, atol=1e-12)


def test_a_current_that_is_no_number_has_no_overpotential():
    found = butler_volmer_of(np.array([1.0, np.nan, -1.0, 2.0, 3.0]), 0.4)
    assert np.isnan(found).tolist() == [False, True, False, False, False]
