"""Intervals of a simulated pack: packs drawn from the stated uncertainties lie within them."""

import numpy as np
import pytest
import strings

from cellwright.packs.cells import pack_cells
from cellwright.packs.simulate import simulate_pack
from cellwright.packs.thermal import Thermal
from cellwright.packs.uncertainty.bands import WITHIN_90_PERCENT, band_of
from cellwright.packs.uncertainty.copies import pack_voltage, simulate_copies
from cellwright.packs.uncertainty.draws import (
    Uncertainty,
    draw_cells,
    drawn_cells,
    is_known,
    ocv_error,
    of_currents,
    own_misfit,
    uncertainty_of,
    wire_factors,
)
from cellwright.packs.wiring import Wiring, star_of

MODELS = strings.models([1.0, 0.85, 0.9], [1.0, 1.3, 1.1])
CELLS = pack_cells(MODELS, temperature_celsius=25.0)
TIME = np.arange(0.0, 3000.0, 10.0)
LOAD = np.where(TIME < 100, 0.0, np.where(TIME % 600 < 400, -60.0, 20.0))
KNOWN = Uncertainty(
    *(np.full(3, std) for std in (0.01, 0.05, 0.003, 0.004)),
    ((np.linspace(0, 1, 11), np.full(11, 0.002)),) * 3,
)


def ladder(terminals="same_end", sense=None):
    links = (0.0, 2e-4, 3e-4)
    return Wiring("l", "parallel", ("A", "B", "C"), (1e-4, 2e-4, 3e-4), links, terminals, sense)


PAIR = star_of(("A", "B"), wire_resistance_ohm=[1e-4, 3e-4])
WIRINGS = [
    star_of(("A", "B", "C"), wire_resistance_ohm=3e-4),
    ladder(),
    ladder("opposite_ends"),
    ladder(sense=1),
    Wiring("s", "series", (PAIR, "C"), (2e-4, 1e-4), (0.0, 0.0)),
]


@pytest.mark.parametrize("wiring", WIRINGS)
def test_the_voltage_of_a_pack_follows_from_its_cells(wiring):
    run = simulate_pack(TIME, LOAD, CELLS, wiring, initial_soc=0.9)
    volt = pack_voltage(wiring, run.cell_voltage_volt, run.cell_current_ampere)
    np.testing.assert_allclose(volt, run.voltage_volt, atol=1e-9)


@pytest.mark.parametrize("warms", [False, True])
def test_packs_simulated_together_are_those_simulated_alone(warms):
    wiring, drawn = WIRINGS[4], draw_cells(KNOWN, draws=3)
    cells = pack_cells(MODELS, temperature_celsius=[25.0, 35.0]) if warms else CELLS
    thermal = Thermal(np.array([40.0, 50.0, 60.0]), np.full(3, 8.0), 0.0, None, np.full(3, 1e-4))
    how = {"thermal": thermal if warms else None, "ambient_celsius": 25.0}
    copies = [drawn_cells(cells, drawn, k, 0.9) for k in range(3)]
    short = slice(0, 60)
    starts = 0.9 + drawn.initial_soc
    runs = simulate_copies(
        TIME[short], LOAD[short], copies, [wiring] * 3, initial_soc=starts, **how
    )
    for copy, start, run in zip(copies, starts, runs, strict=True):
        alone = simulate_pack(TIME[short], LOAD[short], copy, wiring, initial_soc=start, **how)
        for name in ("cell_current_ampere", "voltage_volt", "soc", "temperature_celsius"):
            np.testing.assert_allclose(getattr(run, name), getattr(alone, name), atol=1e-7)


@pytest.mark.parametrize("wiring", [WIRINGS[0], WIRINGS[2]])
def test_packs_drawn_from_the_uncertainties_lie_within_nine_times_in_ten(wiring):
    run = simulate_pack(TIME, LOAD, CELLS, wiring, initial_soc=0.9)
    record = {"time_second": TIME, "total_ampere": LOAD, "ambient_celsius": 25.0}
    drawn, true = (draw_cells(KNOWN, draws=60, seed=seed) for seed in (1, 2))
    starts = 0.9 + np.repeat(drawn.initial_soc[:, :1], 3, axis=1)
    more = {"starts": starts, "factors": wire_factors(60)}
    ampere, volt = band_of(
        run, CELLS, wiring, lambda k: drawn_cells(CELLS, drawn, k, 0.9), **record, **more
    )
    assert ampere.shape == run.cell_current_ampere.shape
    inside = []
    for k in range(60):
        cells = drawn_cells(CELLS, true, k, 0.9)
        start = np.full(3, 0.9 + true.initial_soc[k, 0])
        one = simulate_pack(TIME, LOAD, cells, wiring, initial_soc=start)
        off = np.abs(one.cell_current_ampere - run.cell_current_ampere)
        inside.append(
            [(off[10:] <= WITHIN_90_PERCENT * ampere[10:]).mean()]
            + [(np.abs(one.voltage_volt - run.voltage_volt) <= WITHIN_90_PERCENT * volt).mean()]
        )
    assert 0.83 < np.mean(inside, axis=0)[0] < 0.96
    assert 0.80 < np.mean(inside, axis=0)[1] < 0.97


def test_in_equilibrium_at_the_start_no_draw_drives_a_current():
    """Cells that rest joined have one voltage, however their OCVs are off elsewhere."""
    drawn = draw_cells(KNOWN, draws=5)
    for k in range(5):
        cells = drawn_cells(CELLS, drawn, k, 0.9)
        run = simulate_pack(TIME[:5], 0.0 * TIME[:5], cells, WIRINGS[0], initial_soc=0.9)
        assert np.abs(run.cell_current_ampere).max() < 1e-6


def test_between_two_soc_an_ocv_is_as_uncertain_as_at_them():
    drawn = draw_cells(KNOWN, draws=4000)
    np.testing.assert_allclose(drawn.ocv_volt.std(axis=0), 0.002, rtol=0.08)


def test_what_is_known_of_an_ocv_is_stated_or_what_was_left_out():
    member = strings.model("A")["members"][0]
    assert not is_known(strings.model("A"))
    assert is_known(strings.model("A", r_std=0.1))
    np.testing.assert_allclose(ocv_error(member | {"left_out_rmse_volt": 0.003})[1], 0.003)
    entry = member["conditions"][0] | {"ocv_shift_std_volt": [0.001, None, 0.002]}
    _, stated = ocv_error(member | {"conditions": [entry], "left_out_rmse_volt": 0.003})
    np.testing.assert_allclose(stated, [0.001, 0.003, 0.002])
    # With nothing left out a model is as sure as its stated OCV.
    model = strings.model("A")
    model["members"][0]["conditions"][0]["ocv_shift_std_volt"] = [0.001] * 3
    assert uncertainty_of([model], [None]).voltage_volt == pytest.approx([0.001])


def with_misfit(cell, volt):
    """A model that states its misfit (60,) on discharge, at rest and on charge."""
    model = strings.model(cell, r_std=0.1)
    entry = {"model": model["chosen"], "misfit_volt": np.reshape(volt, (3, 20)).tolist()}
    members = [m | {"left_out_rmse_volt": 0.004} for m in model["members"]]
    members = [
        m | {"conditions": [c | {"fit_rmse_volt": 0.002} for c in m["conditions"]]} for m in members
    ]
    return model | {"intervals": [entry], "members": members}


def test_what_all_models_miss_alike_moves_no_current():
    random = np.random.default_rng(3)
    alike, own = 3e-3 * random.standard_normal(60), 3e-4 * random.standard_normal((4, 60))
    models = [with_misfit(name, alike + one) for name, one in zip("ABCD", own, strict=True)]
    volt, share = own_misfit(models)
    # Twice as much, as blocks left out were missed twice as far as those of the fit.
    np.testing.assert_allclose(volt, 2 * 3e-4, rtol=0.3)
    np.testing.assert_allclose(share, 0.1, rtol=0.35)
    known = uncertainty_of(models, [0.0002 * models[0]["capacity_ampere_hour"]] * 4)
    moving = of_currents(known)
    np.testing.assert_allclose(moving.ocv[0][1], volt[0])
    np.testing.assert_allclose(moving.resistance_relative, known.resistance_relative * share)
    np.testing.assert_allclose(moving.capacity_relative, 0.0002)
    assert (known.capacity_relative == 0.003).all()
    np.testing.assert_array_equal(moving.voltage_volt, known.voltage_volt)
    # Models that miss nothing alike keep all of it.
    apart = [with_misfit(name, 3e-3 * random.standard_normal(60)) for name in "ABCD"]
    np.testing.assert_allclose(own_misfit(apart)[1], 1.0, atol=0.15)


def test_what_cannot_be_compared_is_taken_as_each_cell_s_own():
    models = [with_misfit(name, np.full(60, 1e-3)) for name in "AB"]
    assert own_misfit(models[:1]) is None
    assert own_misfit([models[0], strings.model("B")]) is None
    few = np.where(np.arange(60) < 9, 1e-3, np.nan)
    assert own_misfit([models[0], with_misfit("B", few)]) is None
    plain = uncertainty_of([models[0], strings.model("B")], [None, None])
    assert of_currents(plain) is plain
