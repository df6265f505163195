"""Half cells that a user measured: noise, digits and the number of rows do not count."""

import numpy as np
import pytest
from half_cell_lives import LOSSES, life
from scipy.optimize import differential_evolution

from cellwright.health.electrodes import alignment
from cellwright.health.electrodes.alignment import Pair, align
from cellwright.health.electrodes.half_cells import half_cell
from cellwright.health.electrodes.modes import degradation_modes
from cellwright.health.electrodes.tables import from_table
from cellwright.refusal import Refusal


def readings(name, *, rows=9000, noise_volt=0.0003, digit_volt=0.0002, seed=0):
    """A library's half cell as a cycler logs it: many noisy readings of few digits."""
    curve, rng = half_cell(name), np.random.default_rng(seed)
    whole = (curve.lithiation >= 0) & (curve.lithiation <= 1)
    lithiation = np.linspace(*curve.lithiation[whole][[0, -1]], rows)
    volt = np.interp(lithiation, curve.lithiation[whole], curve.potential_volt[whole])
    volt = volt + noise_volt * rng.standard_normal(rows)
    return lithiation, digit_volt * np.round(volt / digit_volt)


def averaged(table, rows):
    parts = [np.array_split(values, rows) for values in table]
    return tuple(np.array([part.mean() for part in column]) for column in parts)


def pair_of(change):
    """The NMC pair from logged tables, each changed first."""
    names = ("graphite_siox_chen", "nmc811_chen")
    return Pair(*(from_table(*change(readings(name)), name=name) for name in names))


def test_noise_and_digits_are_smoothed_and_steps_of_graphite_stay():
    table = from_table(*readings("graphite_siox_chen", noise_volt=0.001), name="own.csv")
    truth = half_cell("graphite_siox_chen")
    inner = np.linspace(0.05, 0.98, 2000)
    found, wanted = (np.interp(inner, c.lithiation, c.potential_volt) for c in (table, truth))
    assert np.sqrt(np.mean((found - wanted) ** 2)) < 0.00015, "a seventh of the noise"
    slopes = [np.gradient(volt[::20], inner[::20]) for volt in (found, wanted)]
    assert np.sqrt(np.mean((slopes[0] - slopes[1]) ** 2)) < 0.03, "volt, over steps of 1 %"


def test_a_falling_table_of_few_rows_is_kept():
    lithiation = np.linspace(0, 1, 25)
    table = from_table(lithiation, 1.0 - 0.9 * lithiation**2, name="own.csv")
    found = np.interp(lithiation, table.lithiation, table.potential_volt)
    assert found == pytest.approx(1.0 - 0.9 * lithiation**2, abs=1e-4)


def test_single_readings_of_another_curve_do_not_count():
    lithiation, volt = readings("graphite_mohtat")
    stray = volt.copy()
    stray[np.arange(2000, 6000, 37)] -= 0.06
    curves = [from_table(lithiation, one, name="own.csv") for one in (volt, stray)]
    apart = np.abs(curves[0].potential_volt - curves[1].potential_volt)
    assert apart.max() < 0.0005


def test_lithiation_that_is_beyond_its_ends_by_rounding_is_taken():
    lithiation = np.linspace(-1e-7, 1 + 1e-7, 50)
    assert from_table(lithiation, 1.0 - 0.5 * lithiation, name="own.csv").lithiation.size
    with pytest.raises(Refusal, match="does not fall with lithiation"):
        from_table(np.linspace(0, 1, 50), np.full(50, 3.4), name="own.csv")


WAYS = {
    "all": lambda table: table,
    "400": lambda table: averaged(table, 400),
    "100": lambda table: averaged(table, 100),
    "every 40th": lambda table: tuple(column[::40] for column in table),
}


@pytest.fixture(scope="module")
def modes_by_way():
    """Modes of one life by differently sampled tables of the same half cells."""
    curves = life(3, common_volt=0.0, own_volt=0.0005)
    return {way: degradation_modes(curves, pair_of(change)) for way, change in WAYS.items()}


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS)
def test_known_losses_are_found_by_any_number_of_rows(modes_by_way, way):
    found = modes_by_way[way]
    errors = np.abs(found.joint - LOSSES)[1:]
    assert errors.max() < 0.02
    assert np.all(errors < 2.5 * found.joint_std[1:])


@pytest.mark.slow
def test_modes_of_all_rows_are_those_of_few(modes_by_way):
    whole = modes_by_way["all"]
    for way, found in modes_by_way.items():
        apart = np.abs(found.joint - whole.joint)[1:]
        assert np.all(apart < whole.joint_std[1:]), way


@pytest.mark.slow
def test_no_search_without_slopes_ends_lower_than_the_fit():
    """Of the cost that the fit itself minimises, with tables of 9,000 rows in steps of a digit."""
    names = ("graphite_siox_chen", "nmc811_chen")
    tables = [readings(name, noise_volt=2e-5) for name in names]
    pair, curve = Pair(*(from_table(*one, name="own.csv") for one in tables)), life(3)[2]
    found = align(curve, pair)

    def cost(limits):
        whitened = alignment._whitened(limits, found.curve, pair, found.error_volt)
        return 0.5 * np.sum(whitened**2)

    near = np.c_[found.limits - 3 * alignment.STEPS, found.limits + 3 * alignment.STEPS]
    searched = differential_evolution(cost, near, seed=1, popsize=10, maxiter=100, polish=False)
    whole = differential_evolution(cost, np.c_[alignment._bounds(pair)], seed=1, maxiter=60)
    assert cost(found.limits) < min(searched.fun, whole.fun) + 0.02
