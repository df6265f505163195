"""Figures of ageing: peaks joined by identity, modes with what is not told, protocols apart."""

import numpy as np
import pytest

from figures import degradation


def charge(cycle, c_rate=0.5, celsius=25.0):
    volt = np.linspace(3.3, 4.1, 200)
    places = 3.5 + 1e-4 * cycle, 3.8
    slope = sum(20 * np.exp(-(((volt - at) / 0.03) ** 2)) for at in places)
    facts = {"test": f"ica_{cycle:g}", "cycle": cycle, "c_rate": c_rate, "celsius": celsius}
    return facts | {"voltage_volt": volt, "dq_dv": slope}


def track(cycle, identity, volt, event=""):
    place = {"test": f"ica_{cycle:g}", "cycle": cycle, "identity": identity, "event": event}
    return place | {"voltage_volt": volt, "height_ampere_hour_per_volt": 20.0}


def lines(panel, marker):
    return [line for line in panel.lines if line.get_marker() == marker]


def test_the_waterfall_joins_what_is_one_peak_and_marks_its_end():
    charges = [charge(cycle) for cycle in (0, 100, 200)]
    tracks = [track(c, "P1", 3.5 + 1e-4 * c) for c in (0, 100, 200)]
    tracks += [track(0, "P2", 3.8), track(100, "P2", 3.8), track(200, "P2", np.nan, "vanished")]
    figure = degradation.draw_waterfall(charges, tracks)
    (panel,) = figure.axes
    ways = lines(panel, "o")
    assert [len(way.get_xdata()) for way in ways] == [3, 2]
    assert ways[0].get_ydata()[2] > ways[0].get_ydata()[0]
    (end,) = lines(panel, "x")
    assert end.get_xdata()[0] == pytest.approx(3.8)
    assert [text.get_text() for text in panel.get_legend().get_texts()] == ["P1", "P2"]


def test_the_waterfall_has_a_panel_for_each_rate_and_temperature():
    charges = [charge(c, rate, t) for c in (0, 50) for rate, t in ((0.5, 25), (0.05, 25), (0.5, 0))]
    titles = [axes.get_title(loc="left") for axes in degradation.draw_waterfall(charges, []).axes]
    assert sorted(titles) == ["0.05C, 25 °C", "0.5C, 0 °C", "0.5C, 25 °C"]


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
