"""Half cells: published curves, tables of the user, blends."""

import numpy as np
import pytest

from cellwright.health.electrodes.half_cells import (
    CHEMISTRIES,
    LIBRARY,
    blended,
    half_cell,
)
from cellwright.health.electrodes.tables import from_table
from cellwright.refusal import Refusal

every_curve = pytest.mark.parametrize("name", LIBRARY)


@every_curve
def test_potential_falls_with_lithiation_over_the_whole_table(name):
    curve = half_cell(name)
    assert np.all(np.diff(curve.lithiation) > 0)
    assert np.all(np.diff(curve.potential_volt) <= 0)
    assert np.isfinite(curve.potential_volt).all()
    assert "(" in curve.source or "SAE" in curve.source


def test_lg_m50_has_its_cut_offs_where_the_paper_says():
    """Chen et al. 2020: 2.5 V at x = 0.0263, y = 0.8540, 4.2 V at x = 0.9106, y = 0.2638."""
    negative, positive = half_cell("graphite_siox_chen"), half_cell("nmc811_chen")
    for x, y, volt in ((0.0263, 0.8540, 2.5), (0.9106, 0.2638, 4.2)):
        up = np.interp(y, positive.lithiation, positive.potential_volt)
        un = np.interp(x, negative.lithiation, negative.potential_volt)
        assert up - un == pytest.approx(volt, abs=0.003)


def test_plateau_of_lfp_is_where_every_text_book_has_it():
    for name in ("lfp_afshar", "lfp_safari"):
        curve = half_cell(name)
        middle = np.interp(0.5, curve.lithiation, curve.potential_volt)
        assert middle == pytest.approx(3.42, abs=0.03)


def test_blend_of_a_material_with_itself_is_the_material():
    one = half_cell("graphite_mohtat")
    blend = blended(one, one, share=0.3)
    x = np.linspace(0.02, 0.95, 50)
    found = np.interp(x, blend.lithiation, blend.potential_volt)
    assert found == pytest.approx(np.interp(x, one.lithiation, one.potential_volt), abs=1e-6)


def test_capacities_of_a_blend_add_at_equal_potential():
    graphite, silicon = half_cell("graphite_mohtat"), half_cell("silicon_verbrugge")
    blend = blended(graphite, silicon, share=0.2)
    for volt in (0.1, 0.2, 0.4):
        holds = [np.interp(-volt, -c.potential_volt, c.lithiation) for c in (graphite, silicon)]
        found = np.interp(-volt, -blend.potential_volt, blend.lithiation)
        assert found == pytest.approx(0.8 * holds[0] + 0.2 * holds[1], abs=1e-4)


def test_every_chemistry_names_curves_of_the_library():
    for negatives, positives in CHEMISTRIES.values():
        assert all(half_cell(name).lithiation.size > 1000 for name in (*negatives, *positives))


def test_unknown_name_is_refused_with_those_there_are():
    with pytest.raises(Refusal, match="'graphit' is not in the library: graphite_ecker"):
        half_cell("graphit")


def test_table_of_a_user_is_taken_in_any_order():
    x = np.linspace(0.0, 1.0, 50)[::-1]
    curve = from_table(x, 1.0 - 0.9 * x, name="own.csv")
    assert np.interp(0.5, curve.lithiation, curve.potential_volt) == pytest.approx(0.55)


@pytest.mark.parametrize(
    ("lithiation", "potential", "words"),
    [
        (np.linspace(0, 1, 10), np.linspace(1, 0, 10), "own.csv: 10 rows .* at least 20"),
        (np.linspace(0, 100, 50), np.linspace(1, 0, 50), "not percent"),
        (np.linspace(0, 1, 50), np.linspace(0, 1, 50), "Is the column state of charge instead"),
    ],
)
def test_table_that_is_no_half_cell_is_refused(lithiation, potential, words):
    with pytest.raises(Refusal, match=words):
        from_table(lithiation, potential, name="own.csv")
