"""Figures of ageing: modes with what is not told, capacity from peaks, protocols apart."""

import numpy as np
import pytest

from figures import degradation


def lines(panel, marker):
    return [line for line in panel.lines if line.get_marker() == marker]


def modes(told):
    cycle = np.array([0.0, 100.0, 200.0])
    shares = {"lli": 0.05, "lam_negative": 0.02, "lam_positive": 0.03}
    columns = {}
    for name, share in shares.items():
        columns[name] = np.where(told, share * cycle / 200, np.nan)
        columns[f"{name}_std"] = np.where(told, 0.004, np.nan)
        columns[f"{name}_single"] = share * cycle / 200
    return columns | {"cycle": cycle, "capacity_ampere_hour": np.array([20.0, 19.4, 18.8])}


def test_modes_add_up_and_have_bands():
    stacked, banded = degradation.draw_modes(modes([True] * 3)).axes
    top = max(part.get_paths()[0].vertices[:, 1].max() for part in stacked.collections)
    assert top == pytest.approx(10.0)
    band = banded.collections[0].get_paths()[0].vertices[:, 1]
    assert band.max() == pytest.approx(5 + 1.96 * 0.4)
    (lost,) = [line for line in banded.lines if line.get_label() == "capacity lost"]
    assert lost.get_ydata()[-1] == pytest.approx(6.0)


def test_a_mode_that_is_not_identifiable_is_a_hollow_point():
    _, banded = degradation.draw_modes(modes([True, True, False])).axes
    hollow = [one for one in banded.lines if one.get_markerfacecolor() == "white"]
    assert [one.get_xdata().tolist() for one in hollow] == [[200.0]] * 3
    assert [one.get_ydata().tolist() for one in hollow] == [[5.0], [2.0], [3.0]]


def peak_rows():
    columns = {
        "cell": np.array(["C1", "C1", "C2"]),
        "cycle": np.array([0.0, 100.0, 0.0]),
        "c_rate": np.array([0.5, 0.5, 0.5]),
        "measured_ampere_hour": np.array([20.0, 19.0, 20.2]),
        "capacity_ampere_hour": np.array([20.2, 18.8, 20.0]),
        "capacity_lower_ampere_hour": np.array([19.8, np.nan, 19.5]),
        "capacity_upper_ampere_hour": np.array([20.6, np.nan, 20.5]),
        "fresh_ampere_hour": np.array([20.0, 20.0, 20.2]),
    }
    soh = columns["capacity_ampere_hour"] / columns["fresh_ampere_hour"]
    error = soh - columns["measured_ampere_hour"] / columns["fresh_ampere_hour"]
    return columns | {"soh": soh, "soh_std": np.full(3, 0.01), "left_out_error": error}


def test_capacity_from_peaks_is_held_against_the_measured_one():
    panel, over = degradation.draw_peak_health(peak_rows(), "C1").axes
    assert panel.get_title(loc="left") == "From peaks: 1 % RMS"
    others = next(line for line in panel.lines if line.get_label() == "cells of the type")
    assert others.get_xdata().tolist() == [20.2]
    measured = next(line for line in over.lines if line.get_label() == "measured")
    assert measured.get_ydata().tolist() == [100.0, 95.0]
    untold = peak_rows() | {"capacity_ampere_hour": np.full(len(peak_rows()["cell"]), np.nan)}
    assert [p.axison for p in degradation.draw_peak_health(untold, "C1").axes] == [False, True]


def test_lives_stand_by_their_protocol():
    cycle = np.array([100.0, 0.0])
    base = {"cycle": cycle, "soh": np.array([0.9, 1.0]), "knee_cycle": np.nan, "peaks": []}
    lives = [
        base | {"cell": "A", "protocol": "fast_charge", "knee_cycle": 50.0},
        base | {"cell": "B", "protocol": "", "peaks": [(100.0, 0.91)]},
    ]
    unknown, fast = degradation.draw_lives(lives).axes
    assert fast.get_title(loc="left") == "fast charge"
    assert lines(fast, "D")[0].get_ydata()[0] == pytest.approx(95.0)
    assert lines(unknown, "+")[0].get_ydata().tolist() == [91.0]
    assert not lines(unknown, "D")
