"""The figure of the four ways: every cell by every way, the curve over the calibrating cells."""

import numpy as np
import pytest

from figures import bias


def row(cell, way, rmse_volt, count=0):
    return {"cell": cell, "way": way, "calibrating_cells": count, "rmse_volt": rmse_volt}


def rows(few=(0, 3)):
    made = []
    for k in range(5):
        for way, volt in (("reference", 0.04), ("scaled", 0.02), ("bias", 0.004), ("own", 0.003)):
            made.append(row(f"C{k}", way, volt * (1 + k / 10), 4 if way == "bias" else 0))
        made += [row(f"C{k}", "bias_of_few", 0.02 / (1 + count), count) for count in few]
    return made


def test_errors_are_over_all_tests_of_a_cell():
    two = [row("A", "own", 0.003), row("A", "own", 0.004), row("B", "bias", 1.0)]
    assert bias.errors_of(two, "own") == {"A": pytest.approx(np.sqrt(12.5))}


def test_both_panels_of_each_type_are_drawn():
    figure = bias.draw_bias([("NMC 30 Ah", rows()), ("LFP 5 Ah", rows(few=()))])
    assert len(figure.axes) == 4
    labels = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert "corrected: mean 4.8 mV" in labels
    line = figure.axes[1].containers[0].lines[0]
    np.testing.assert_allclose(line.get_xdata().astype(float), [0, 3, 4])
    np.testing.assert_allclose(line.get_ydata().astype(float), [20.0, 5.0, 4.8])
    alone = figure.axes[3].containers[0].lines[0]
    np.testing.assert_allclose(alone.get_xdata().astype(float), [4])
