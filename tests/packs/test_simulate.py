"""A pack's simulation: a cell alone, Kirchhoff, symmetries, stiff groups, an independent solver."""

import numpy as np
import pytest
import truth
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from wirings import UNEQUAL, WIRINGS, parallel, series

from cellwright.circuits.circuit import KINDS
from cellwright.circuits.model_file import simulate_model
from cellwright.packs import kernel
from cellwright.packs.cells import pack_cells
from cellwright.packs.kernel import Keep
from cellwright.packs.simulate import simulate_pack
from cellwright.packs.wiring import Wiring, cells_of
from cellwright.refusal import Refusal

TIME = np.cumsum(np.random.default_rng(1).exponential(5.0, 300))
LOAD = np.repeat(np.random.default_rng(2).uniform(-6, 4, 15), 20)
THREE = parallel(*"ABC")
ALONE = series("A")


def pack(*models, **settings):
    return pack_cells(models, temperature_celsius=25.0, **settings)


def with_branches(model, *kinds, own=None, **changes):
    """The model with further branches of the kinds, their values of `truth` or as given."""
    member = model["members"][0]
    condition = member["conditions"][0]
    knots = len(condition["soc"])
    more = [
        {"kind": kind}
        | {
            p: [(own or {}).get(kind, changes).get(p, truth.VALUES[p])] * knots
            for p in KINDS[kind].parameters
        }
        for kind in kinds
    ]
    condition = condition | {"branches": [*condition["branches"], *more]}
    return model | {"members": [member | {"conditions": [condition]}]}


@pytest.mark.parametrize("hold", ["first_order", "zero_order"])
@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind not in ("switch", "preisach")])
def test_one_cell_alone_is_the_single_cell_simulation(kind, hold):
    cell = truth.with_branch(kind)
    run = simulate_pack(TIME, LOAD / 3, pack(cell), ALONE, initial_soc=0.6, hold=hold)
    alone = simulate_model(cell, None, TIME, LOAD / 3, run.soc[:, 0], 25.0, hold=hold)
    np.testing.assert_allclose(run.voltage_volt, alone.voltage_volt, rtol=0, atol=1e-12)
    between = LOAD[:-1] if hold == "zero_order" else (LOAD[1:] + LOAD[:-1]) / 2
    counted = 0.6 + np.cumsum(between / 3 * np.diff(TIME)) / 3600 / truth.CAPACITY_AMPERE_HOUR
    np.testing.assert_allclose(run.soc[1:, 0], counted, rtol=0, atol=1e-12)


def test_a_hysteresis_whose_loops_close_forgets_in_a_pack_as_the_one_state_does():
    one, other = (pack(truth.with_branch(kind)) for kind in ("hysteresis", "preisach"))
    runs = [
        simulate_pack(TIME, LOAD / 3, p, ALONE, initial_soc=0.6, hold="zero_order")
        for p in (one, other)
    ]
    np.testing.assert_array_equal(*(run.voltage_volt for run in runs))


def test_a_switch_turns_one_step_after_the_current_has_turned():
    cell, time = truth.with_branch("switch"), 10.0 * np.arange(len(LOAD))
    run = simulate_pack(time, LOAD / 3, pack(cell), ALONE, initial_soc=0.6)
    alone = simulate_model(cell, None, time, LOAD / 3, run.soc[:, 0], 25.0, hold="first_order")
    turned = np.diff(np.sign(LOAD), prepend=0.0) != 0
    loaded = np.abs(LOAD) > 0.01 * np.abs(LOAD).max()
    off = np.abs(run.voltage_volt - alone.voltage_volt)
    assert off[turned].max() > 0.01
    assert off[loaded & ~turned].max() < 1e-5


@settings(deadline=None, max_examples=10)
@given(st.lists(st.floats(0.1, 0.9), min_size=8, max_size=8), st.sampled_from(sorted(WIRINGS)))
def test_kirchhoffs_laws_hold_in_every_wiring_with_kinetics_and_hysteresis(soc, shape):
    wiring = WIRINGS[shape]
    names = cells_of(wiring)
    models = [
        with_branches(UNEQUAL[k % 3], "kinetic", "hysteresis") | {"cell": name}
        for k, name in enumerate(names)
    ]
    rows = slice(0, 60)
    run = simulate_pack(
        TIME[rows], LOAD[rows], pack(*models), wiring, initial_soc=soc[: len(names)]
    )
    by_cell = dict(zip(names, run.cell_current_ampere.T, strict=True))
    assert np.abs(into(wiring, by_cell) - LOAD[rows]).max() < 1e-9


def into(wiring, by_cell):
    """Current into a group, which all members of a series share."""
    inner = [by_cell[m] if isinstance(m, str) else into(m, by_cell) for m in wiring.members]
    if wiring.connection == "series":
        np.testing.assert_allclose(np.ptp(inner, axis=0), 0.0, rtol=0, atol=1e-9)
        return inner[0]
    return np.sum(inner, axis=0)


@pytest.mark.parametrize("link", [0.0, 1e-8])
def test_the_currents_of_a_thousand_cells_sum_to_the_total(link):
    names = tuple(map(str, range(1002)))
    wiring = Wiring("p", "parallel", names, (0.0,) * 1002, (0.0,) + (link,) * 1001)
    run = simulate_pack(TIME[:60], 1000 * LOAD[:60], pack(*UNEQUAL * 334), wiring, initial_soc=0.5)
    total = run.cell_current_ampere.sum(axis=1)
    np.testing.assert_allclose(total, 1000 * LOAD[:60], rtol=0, atol=1e-9)


def test_cells_on_one_bar_have_one_voltage_in_whatever_order():
    soc, order = np.array([0.4, 0.5, 0.6]), [2, 0, 1]
    run = simulate_pack(TIME, LOAD, pack(*UNEQUAL), THREE, initial_soc=soc)
    assert np.ptp(run.cell_voltage_volt, axis=1).max() < 1e-12
    cells = pack(*(UNEQUAL[k] for k in order))
    turned = simulate_pack(TIME, LOAD, cells, THREE, initial_soc=soc[order])
    currents = run.cell_current_ampere[:, order]
    np.testing.assert_allclose(turned.cell_current_ampere, currents, atol=1e-9)
    contact = np.array([0.001, 0.02, 0.0])
    wiring = THREE._replace(contact_ohm=tuple(contact))
    run = simulate_pack(TIME, LOAD, pack(*UNEQUAL), wiring, initial_soc=[0.4, 0.5, 0.6])
    at_bar = run.cell_voltage_volt + contact * run.cell_current_ampere
    assert np.ptp(at_bar, axis=1).max() < 1e-12
    np.testing.assert_allclose(at_bar[:, 0], run.voltage_volt, rtol=0, atol=1e-12)


def test_voltage_is_that_of_the_sensed_member():
    contact = (0.01, 0.02, 0.03)
    wiring = THREE._replace(contact_ohm=contact, sense=1)
    run = simulate_pack(TIME, LOAD, pack(*UNEQUAL), wiring, initial_soc=0.5)
    np.testing.assert_allclose(run.voltage_volt, run.cell_voltage_volt[:, 1], rtol=0, atol=1e-12)
    pair, single = parallel("A", "B", name="pair"), series("C", name="single")
    strings = parallel(pair, single, contact=0.01)._replace(sense=0)
    run = simulate_pack(TIME, LOAD, pack(*UNEQUAL), strings, initial_soc=0.5)
    np.testing.assert_allclose(run.voltage_volt, run.cell_voltage_volt[:, 0], rtol=0, atol=1e-12)
    assert np.abs(run.voltage_volt - run.cell_voltage_volt[:, 2]).max() > 1e-3


@pytest.mark.parametrize(("soc", "direction"), [(0.98, 1.0), (0.02, -1.0), (0.5, 0.0)])
def test_hysteresis_begins_where_the_model_says_that_the_cell_was_led(soc, direction):
    cell = truth.with_branch("hysteresis")
    member = cell["members"][0] | {"history": {"near_end_soc": 0.05}}
    cell = cell | {"members": [member]}
    time, load = np.arange(0.0, 600.0, 5.0), np.repeat([0.0, -0.4], 60)
    run = simulate_pack(time, load, pack(cell), ALONE, initial_soc=soc)
    alone = simulate_model(cell, None, time, load, run.soc[:, 0], 25.0, hold="first_order")
    np.testing.assert_allclose(run.voltage_volt, alone.voltage_volt, rtol=0, atol=1e-6)
    curve = truth.ocv_at(soc) + direction * truth.VALUES["m_volt"]
    assert run.voltage_volt[0] == pytest.approx(curve, abs=1e-9)


def test_what_is_kept_of_the_cells_is_what_was_asked_for():
    whole = simulate_pack(TIME, LOAD, pack(*UNEQUAL), THREE, initial_soc=0.5)
    some = simulate_pack(
        TIME, LOAD, pack(*UNEQUAL), THREE, initial_soc=0.5, keep=Keep(7, extremes=True)
    )
    np.testing.assert_array_equal(some.row, np.arange(0, len(TIME), 7))
    np.testing.assert_array_equal(some.soc, whole.soc[::7])
    np.testing.assert_array_equal(some.voltage_volt, whole.voltage_volt)
    np.testing.assert_array_equal(some.extremes[:, 4], whole.soc.min(axis=1))
    np.testing.assert_array_equal(some.extremes[:, 7], whole.cell_current_ampere.max(axis=1))
    none = simulate_pack(TIME, LOAD, pack(*UNEQUAL), THREE, initial_soc=0.5, keep=Keep(0))
    assert none.soc.shape == (0, 3)
    np.testing.assert_array_equal(none.voltage_volt, whole.voltage_volt)


def test_refusals():
    def run(time=TIME, load=LOAD, wiring=THREE, **changes):
        return simulate_pack(time, load, pack(*UNEQUAL), wiring, **{"initial_soc": 0.5} | changes)

    with pytest.raises(Refusal, match="the clock runs back after row 0"):
        run(time=TIME[::-1])
    with pytest.raises(Refusal, match="not finite"):
        run(load=LOAD * np.nan)
    with pytest.raises(Refusal, match=r"current \(299,\)"):
        run(load=LOAD[1:])
    with pytest.raises(Refusal, match="hold of the current is 'second'"):
        run(hold="second")
    with pytest.raises(Refusal, match="p has 2 cells, but 3 have models"):
        run(wiring=parallel(*"AB"))
    with pytest.raises(Refusal, match="wanted one, or one for each of 3 cells"):
        run(initial_soc=[0.5, 0.5])
    with pytest.raises(Refusal, match="2 names of members for 3 cells"):
        pack(*UNEQUAL, member=["2RC", "2RC"])
    with pytest.raises(Refusal, match="without models"):
        pack()


@pytest.mark.parametrize("kinds", [(), ("kinetic", "hysteresis"), ("diffusion",)])
def test_two_identical_cells_are_one_of_double_capacity_and_half_resistance(kinds):
    cell = with_branches(truth.model("A"), *kinds)
    one = simulate_pack(TIME, LOAD / 2, pack(cell), ALONE, initial_soc=0.6)
    two = simulate_pack(TIME, LOAD, pack(cell, cell), parallel(*"AB"), initial_soc=0.6)
    np.testing.assert_allclose(two.voltage_volt, one.voltage_volt, rtol=0, atol=1e-9)
    np.testing.assert_allclose(two.cell_current_ampere[:, 1], LOAD / 2, rtol=0, atol=1e-9)
    string = simulate_pack(TIME, LOAD / 2, pack(cell, cell), series(*"AB"), initial_soc=0.6)
    np.testing.assert_allclose(string.voltage_volt, 2 * one.voltage_volt, rtol=0, atol=1e-9)


def test_unequal_cells_equalise_at_rest():
    time = np.linspace(0, 3e5, 1000)
    cells = pack(*UNEQUAL)
    run = simulate_pack(time, 0 * time, cells, THREE, initial_soc=[0.3, 0.5, 0.7])
    assert run.cell_current_ampere[0, 0] > 0.1 > -0.1 > run.cell_current_ampere[0, 2]
    np.testing.assert_allclose(run.cell_current_ampere[-1], 0, atol=1e-4)
    stored = (run.soc[-1] - [0.3, 0.5, 0.7]) @ cells.capacity_ampere_hour
    assert stored == pytest.approx(0, abs=1e-9)
    assert np.ptp(run.soc[-1]) < 1e-3


def stiff(r0=1e-3):
    """Milliohm cells with a straight, steep OCV, and no relaxation."""
    knots = [0.0, 1.0]
    condition = {"soc": knots, "r0_ohm": [r0, r0], "branches": []}
    condition |= {"ambient_temperature_celsius": 25.0}
    ocv = {"soc": knots, "ocv_volt": [3.0, 4.2], "ambient_temperature_celsius": 25.0}
    member = {"model": "0RC", "conditions": [condition]}
    return truth.model("S") | {"ocv": [ocv], "members": [member], "chosen": "0RC"}


@pytest.mark.parametrize("hold", ["first_order", "zero_order"])
def test_a_stiff_group_with_long_steps_stays_calm(hold):
    """Steps of ten minutes beside an equalisation of ten seconds, where others swing."""
    time = np.arange(0.0, 20000.0, 600.0)
    cells = pack(stiff(), stiff())
    run = simulate_pack(time, 0 * time, cells, parallel(*"AB"), initial_soc=[0.4, 0.6], hold=hold)
    assert np.all(np.diff(np.abs(run.cell_current_ampere[:, 0])) <= 1e-9)
    np.testing.assert_allclose(run.soc[-1], 0.5, atol=1e-6)


def test_cells_without_ohmic_resistance_run_from_rest_where_their_lags_resist():
    time = np.arange(0.0, 600.0, 2.0)
    bare = [with_branches(stiff(0.0), "RC"), with_branches(stiff(0.0), "RC", r_ohm=0.04)]
    load = np.where(time < 10, 0.0, -2.0)
    run = simulate_pack(time, load, pack(*bare), parallel(*"AB"), initial_soc=0.5)
    np.testing.assert_allclose(run.cell_current_ampere.sum(axis=1), load, rtol=0, atol=1e-9)
    assert run.cell_current_ampere[-1, 0] < run.cell_current_ampere[-1, 1] < 0
    with pytest.raises(Refusal, match=r"member \d of p has no resistance"):
        simulate_pack(time, load - 1.0, pack(*bare), parallel(*"AB"), initial_soc=0.5)
    with pytest.raises(Refusal, match=r"member \d of p has no resistance"):
        simulate_pack(time, load, pack(*bare), parallel(*"AB"), initial_soc=0.5, hold="zero_order")


class Independent:
    """Two cells on a bar by scipy: an ODE in the states, the bar's voltage found at every moment.

    Each cell: OCV, ohmic resistance, an RC pair, kinetics with a lag, hysteresis over the charge.
    """

    CAPACITY = np.array([2.0, 1.6]) * 3600.0
    R0, CONTACT = np.array([0.012, 0.02]), np.array([0.001, 0.003])
    R, TAU = np.array([0.02, 0.03]), np.array([60.0, 90.0])
    KINETIC, KINETIC_TAU, SCALE = np.array([0.04, 0.07]), 2.0, 0.03
    M, CHARGE = np.array([0.01, 0.015]), 0.05 * 3600.0

    def ocv(self, soc):
        return np.interp(soc, truth.OCV_SOC, truth.OCV_VOLT)

    def divided(self, states, total):
        soc, relaxed, kinetic, hysteresis = states.reshape(4, 2)
        source, ohm = self.ocv(soc) + relaxed + kinetic + hysteresis, self.R0 + self.CONTACT
        volt = brentq(lambda v: ((v - source) / ohm).sum() - total, 0.0, 10.0, xtol=1e-14)
        return (volt - source) / ohm, volt

    def rates(self, states, total):
        current, _ = self.divided(states, total)
        _, relaxed, kinetic, hysteresis = states.reshape(4, 2)
        drive = self.SCALE * np.arcsinh(self.KINETIC * current / self.SCALE)
        to_goal = np.abs(current) * (self.M * np.sign(current) - hysteresis) / self.CHARGE
        parts = current / self.CAPACITY, (self.R * current - relaxed) / self.TAU
        return np.concatenate([*parts, (drive - kinetic) / self.KINETIC_TAU, to_goal])

    def run(self, edges, levels, time, soc):
        """Branch currents (n, 2) and voltage (n,) under a staircase of the total current."""
        states, found = np.concatenate([soc, np.zeros(6)]), []
        for begin, end, level in zip(edges[:-1], edges[1:], levels, strict=True):
            at = time[(time >= begin) & (time < end)]
            solution = solve_ivp(
                lambda _, y, i=level: self.rates(y, i),
                (begin, end),
                states,
                "LSODA",
                t_eval=np.append(at, end),
                rtol=1e-9,
                atol=1e-11,
                max_step=5.0,
            )
            found += [self.divided(y, level) for y in solution.y.T[:-1]]
            states = solution.y[:, -1]
        return np.array([c for c, _ in found]), np.array([v for _, v in found])

    def models(self):
        models = []
        for k in range(2):
            pair = {"r_ohm": self.R[k], "tau_second": self.TAU[k]}
            kinetic = {"r_ohm": self.KINETIC[k], "tau_second": self.KINETIC_TAU}
            charge = {"m_volt": self.M[k], "charge_ampere_hour": self.CHARGE / 3600}
            kinds = {"RC": pair, "kinetic": kinetic | {"scale_volt": self.SCALE}}
            kinds["hysteresis"] = charge
            bare = stiff(self.R0[k]) | {"ocv": truth.model()["ocv"]}
            models.append(
                with_branches(bare, *kinds, own=kinds)
                | {"capacity_ampere_hour": self.CAPACITY[k] / 3600}
            )
        return models


def test_two_cells_with_kinetics_and_hysteresis_agree_with_an_independent_solver():
    """9 A shared by unequal cells at unequal SoC: the error falls with the step, as first order."""
    true = Independent()
    edges = np.array([0.0, 60.0, 300.0, 420.0, 600.0, 900.0])
    levels, begin = np.array([0.0, -9.0, 5.0, -2.0, 0.0]), np.array([0.62, 0.55])
    wiring = parallel(*"AB")._replace(contact_ohm=tuple(true.CONTACT))
    errors = []
    for step in (1.0, 0.25):
        time = np.arange(0.0, 900.0, step)
        current, volt = true.run(edges, levels, time, begin)
        load = levels[np.searchsorted(edges, time, side="right") - 1]
        cells = pack(*true.models(), points=401)
        run = simulate_pack(time, load, cells, wiring, initial_soc=begin, hold="zero_order")
        off = run.cell_current_ampere - current
        volts = np.sqrt(np.mean((run.voltage_volt - volt) ** 2))
        errors.append((np.sqrt(np.mean(off**2)), np.abs(off).max(), volts))
    assert errors[0][0] < 3e-3
    assert errors[0][2] < 1e-5
    assert errors[1][0] < 0.4 * errors[0][0]
    assert errors[1][1] < 0.4 * errors[0][1]


def with_fields(points=51, cells=4, seed=1):
    """Cells that differ in everything, time constants that move with SoC."""
    rng, knots = np.random.default_rng(seed), len(truth.KNOTS)
    models = []
    for k in range(cells):
        scale = rng.uniform(0.6, 1.6)
        kinds = [kind for kind in KINDS if kind != "R"]
        model = with_branches(truth.model(f"c{k}", scale=scale), *kinds)
        for branch in model["members"][0]["conditions"][0]["branches"]:
            for name in set(branch) - {"kind"}:
                branch[name] = (np.array(branch[name]) * rng.uniform(0.7, 1.4, knots)).tolist()
        models.append(model | {"capacity_ampere_hour": float(rng.uniform(1.5, 2.5))})
    return models


def numpy_alone(monkeypatch):
    monkeypatch.setattr(kernel, "function", lambda *_types, **_result: None)


@pytest.mark.parametrize("hold", ["first_order", "zero_order"])
@pytest.mark.parametrize("shape", ["three deep", "star", "leads at opposite ends", "one"])
@pytest.mark.parametrize("plain", [True, False])
def test_compiled_and_numpy_agree(monkeypatch, plain, shape, hold):
    """Also beyond the ends of the tables, where a step repeats and where one lasts long."""
    wiring = WIRINGS[shape]
    names = cells_of(wiring)
    models = with_fields(cells=len(names))
    if plain:
        pairs = ("R", "RC", "warburg")
        for model in models:
            condition = model["members"][0]["conditions"][0]
            condition["branches"] = [
                b for b in condition["branches"] if b.get("kind", "RC") in pairs
            ]
    time = np.cumsum(np.repeat([0.0, 1.0, 4.0, 0.5, 60.0], 16))
    load = np.repeat(np.random.default_rng(3).uniform(-5, 2, 16), 5) * len(names) ** 0.5
    begin = np.random.default_rng(4).uniform(0.1, 0.9, len(names))
    setting = {"initial_soc": begin, "hold": hold, "keep": Keep(3, extremes=True)}
    cells = pack(*models, points=51)
    run = simulate_pack(time, load, cells, wiring, **setting)
    numpy_alone(monkeypatch)
    for one, other in zip(run, simulate_pack(time, load, cells, wiring, **setting), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9)
