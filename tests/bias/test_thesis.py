"""The thesis' bias functions: the worked example, recovery of known coefficients, refusals."""

import numpy as np
import pytest

from cellwright.bias import thesis
from cellwright.refusal import Refusal

SOC = np.linspace(0.1, 0.9, 9)
SHIFT = np.array([0.02, 0.05, 0.09, 0.15])
TRUE = np.array([0.5, 0.03, 0.01, -0.02])


def published(a2):
    """Coefficients of table 4.5, resistance in milliohm."""
    return [23.0, a2 * 0.507, a2 * 0.0107, -a2 * 5.87e-4]


@pytest.mark.parametrize(("a2", "milliohm"), [(0.17, 0.829282), (1.7, 0.976610)])
def test_worked_example_of_the_thesis(a2, milliohm):
    """Eq. 4.6 gives 0.82927 with a2 = 0.17; table 4.5 prints 1.7 (erratum)."""
    assert thesis.quadratic_bias(0.188, 0.5, published(a2)) == pytest.approx(milliohm, abs=6e-6)


def changes(noise=0.0):
    random = np.random.default_rng(1)
    true = np.array([thesis.quadratic_bias(shift, SOC, TRUE) for shift in SHIFT])
    return true + noise * random.normal(size=true.shape)


def test_the_coefficients_are_recovered():
    coefficients, left_out = thesis.quadratic_function(SHIFT, SOC, changes())
    np.testing.assert_allclose(coefficients, TRUE, atol=1e-9)
    assert np.abs(left_out).max() < 1e-9
    slow, _ = thesis.linear_function(SHIFT, np.outer(SHIFT, np.full(9, 0.27)))
    assert slow == pytest.approx([0.27])


def test_the_left_out_error_tells_the_noise():
    noisy = np.outer(SHIFT, np.full(9, 0.27)) + changes(noise=1e-3) - changes()
    errors = thesis.linear_function(SHIFT, noisy)[1]
    assert 0.6e-3 < np.sqrt(np.mean(errors**2)) < 1.5e-3


@pytest.mark.parametrize(
    ("shifts", "reason"), [([0.1, 0.2], "2 cell.s. beside"), ([0.1, 0.1, 0.1], "too much alike")]
)
def test_what_cannot_be_fitted_is_refused(shifts, reason):
    with pytest.raises(Refusal, match=reason):
        thesis.quadratic_function(shifts, SOC, np.zeros((len(shifts), 9)))
    if len(shifts) < 3:
        with pytest.raises(Refusal, match=reason):
            thesis.linear_function(shifts, np.zeros((len(shifts), 9)))


def test_the_main_shift_is_that_of_the_highest_peak_of_the_reference():
    rows = [
        {"voltage_volt": volt, "height_ampere_hour_per_volt": height}
        for volt, height in [(3.5, 1.0), (3.7, 9.0), (3.53, 8.0), (3.75, 2.0)]
    ]
    main, mean = thesis.peak_shift([(1, rows[0], rows[2]), (2, rows[1], rows[3])])
    assert (main, mean) == (pytest.approx(0.05), pytest.approx(0.04))
