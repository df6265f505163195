"""Figures of health draw what the artefact says."""

import numpy as np

from figures import health

COLUMNS = {
    "cycle": [0.0, 100.0, 200.0],
    "lli": [0.0, 0.05, 0.1],
    "lli_std": [0.0, 0.001, 0.002],
    "lli_single": [0.0, 0.05, 0.1],
    "lam_negative": [0.0, 0.02, 0.04],
    "lam_negative_std": [0.0, 0.004, 0.004],
    "lam_negative_single": [0.0, 0.02, 0.04],
    "lam_positive": [0.0, np.nan, 0.03],
    "lam_positive_std": [0.0, np.nan, 0.01],
    "lam_positive_single": [0.0, 0.07, 0.03],
}


def test_a_mode_that_is_not_known_is_a_hollow_point():
    axes = health.draw_degradation_modes(COLUMNS).axes
    hollow = [
        line.get_xydata().tolist()
        for line in axes[1].lines
        if line.get_markerfacecolor() == "white" and len(line.get_xdata())
    ]
    assert np.allclose(hollow, [[[100.0, 7.0]]])


def test_lines_are_in_percent_and_the_stack_has_all_three():
    axes = health.draw_degradation_modes(COLUMNS).axes
    assert axes[1].lines[0].get_ydata().tolist() == [0.0, 5.0, 10.0]
    assert len(axes[0].collections) == 3
