"""Blends in an electrode: their shares over life, files of the user, what is refused."""

import numpy as np
import pytest
from half_cell_lives import SOC, curve_of, half_cell_error, window

from cellwright.health.electrodes import alignment
from cellwright.health.electrodes.alignment import Pair, align, cell_volt
from cellwright.health.electrodes.half_cells import at_share, half_cell
from cellwright.health.electrodes.mode_rows import mode_rows
from cellwright.health.electrodes.modes import degradation_modes
from cellwright.health.electrodes.names import half_cell_files, named_parts
from cellwright.health.electrodes.tables import from_table
from cellwright.refusal import Refusal

GRAPHITE, SILICON = 1.0, 0.2  # of the fresh electrode [Ah]
LEFT = np.array([[1.0, 1.0], [0.98, 0.8], [0.95, 0.5], [0.93, 0.3]])  # of graphite and of silicon


def blend_pair():
    return Pair(half_cell("graphite_mohtat+silicon_verbrugge:0.1"), half_cell("nmc811_chen"))


def silicon_life(seed=0, common_volt=0.001):
    """Charges of a cell whose silicon goes first; and the share of silicon at each."""
    rng, pair, curves = np.random.default_rng(seed), blend_pair(), []
    common = half_cell_error(rng, common_volt)
    shares = SILICON * LEFT[:, 1] / (LEFT @ [GRAPHITE, SILICON])
    for k, (left, share) in enumerate(zip(LEFT, shares, strict=True)):
        aged = Pair(at_share(pair.negative, share), pair.positive)
        sizes = float(left @ [GRAPHITE, SILICON]), 1.8
        limits, charge = window(aged, 1.5 * (1 - 0.05 * k), *sizes, 3.0, 4.15)
        volt = cell_volt(aged, np.array([*limits, 0.004, 0.0]), SOC)
        volt = volt + common + half_cell_error(rng, common_volt / 3)
        curves.append(curve_of(SOC, volt, charge, cycle=100.0 * k))
    return curves, shares


@pytest.fixture(scope="module")
def found():
    curves, shares = silicon_life()
    return degradation_modes(curves, blend_pair()), curves, shares


def test_a_share_that_changes_over_life_is_found(found):
    modes, _, shares = found
    assert modes.shares[:, 0] == pytest.approx(shares, abs=0.015)
    assert np.all(np.abs(modes.shares[:, 0] - shares) < 2.5 * modes.shares_std[:, 0])


def test_losses_of_graphite_and_of_silicon_are_told_apart(found):
    modes, curves, _ = found
    errors = modes.materials - (1 - LEFT)
    assert np.all(np.abs(errors) < 2.5 * modes.materials_std + 1e-9)
    assert np.abs(errors).max() < 0.08
    rows = mode_rows(modes, blend_pair(), curves)
    assert rows[-1]["lam_negative_second"] == pytest.approx(0.7, abs=0.08)
    assert rows[-1]["negative_blend_share"] < 0.5 * rows[0]["negative_blend_share"]
    assert np.isnan(rows[-1]["positive_blend_share"])


def test_modes_of_the_whole_electrode_are_right_though_the_share_changes(found):
    modes, _, _ = found
    left = LEFT @ [GRAPHITE, SILICON] / (GRAPHITE + SILICON)
    assert modes.joint[:, 1] == pytest.approx(1 - left, abs=0.015)
    assert modes.joint[:, 0] == pytest.approx(0.05 * np.arange(4), abs=0.01)


def test_derivatives_by_the_share_are_those_of_differences():
    curves, _ = silicon_life()
    pair, errors = blend_pair(), np.linspace(0.001, 0.004, len(SOC))
    limits = np.array([0.031, 0.83, 0.86, 0.28, 0.004, -0.002, 0.17])
    before = alignment._whitened(limits, curves[0], pair, errors)
    slopes = alignment._derivatives(limits, curves[0], pair, errors)
    step = np.where(np.arange(7) == 6, 1e-7, 0.0)
    moved = (alignment._whitened(limits + step, curves[0], pair, errors) - before) / 1e-7
    assert np.mean(np.isclose(slopes[:, 6], moved, rtol=2e-2, atol=0.1)) > 0.97


def test_an_electrode_of_one_material_has_no_share():
    curves, _ = silicon_life()
    pair = Pair(half_cell("graphite_mohtat"), half_cell("nmc811_chen"))
    assert align(curves[0], pair).limits.shape == (6,)


@pytest.mark.parametrize(
    ("text", "share", "words"),
    [
        ("graphite_mohtat+silicon_verbrugge:0.1", 0.1, ""),
        ("graphite_mohtat + silicon_verbrugge : 0.25", 0.25, ""),
        ("graphite_mohtat+silicon_verbrugge", 0.1, ""),
        ("graphite_mohtat+silicon_verbrugge:0.1:0.1", None, "found the share '0.1:0.1'"),
        ("graphite_mohtat+silicon_verbrugge:10", None, "found the share '10'.* a\\+b:0.1"),
        ("graphite_mohtat+silicon", None, "'silicon' is not in the library"),
        ("graphite_mohtat+silicon_verbrugge+lmo_doyle", None, "a blend of 3, wanted two"),
    ],
)
def test_a_blend_is_read_or_refused_with_its_form(text, share, words):
    if share is None:
        with pytest.raises(Refusal, match=words):
            half_cell(text)
    else:
        assert half_cell(text).share == share


def test_files_and_names_of_the_library_may_be_blended():
    lithiation = np.linspace(0.01, 0.99, 300)
    silicon = half_cell("silicon_verbrugge")
    volt = np.interp(lithiation, silicon.lithiation, silicon.potential_volt)
    own = {"half_cells/si.csv": from_table(lithiation, volt, name="half_cells/si.csv")}
    blend = half_cell("graphite_mohtat+half_cells/si.csv:0.2", own)
    library = half_cell("graphite_mohtat+silicon_verbrugge:0.2")
    x = np.linspace(0.05, 0.9, 40)
    found, wanted = (np.interp(x, c.lithiation, c.potential_volt) for c in (blend, library))
    assert found == pytest.approx(wanted, abs=0.003)
    assert blend.source.endswith("half_cells/si.csv")


def test_files_among_the_half_cells_are_named():
    assert half_cell_files("a/g.csv+a/s.CSV:0.1") == ["a/g.csv", "a/s.CSV"]
    assert half_cell_files("graphite_mohtat+s.csv") == ["s.csv"]
    assert half_cell_files("nmc811_chen") == half_cell_files(None) == []
    assert named_parts("nmc811_chen") == (["nmc811_chen"], None)
