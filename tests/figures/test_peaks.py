"""Figure of peaks over a life: a panel a rate, a line a peak, curves of records that count on."""

import numpy as np

from figures import peaks


def tracks(rates=(0.05, 0.5), cycles=(0.0, 100.0, 200.0)):
    rows = [(c, r, name) for r in rates for c in cycles for name in ("P1", "P2")]
    cycle, rate, identity = (np.array(column) for column in zip(*rows, strict=True))
    place = np.where(identity == "P1", 3.5, 3.9)
    return {
        "test": np.array([f"t{r}" for r in rate]),
        "cycle": cycle,
        "c_rate": rate,
        "ambient_temperature_celsius": np.full(len(rows), np.nan),
        "identity": identity,
        "voltage_volt": np.where((identity == "P2") & (cycle > 150), np.nan, place),
        "height_ampere_hour_per_volt": np.where(identity == "P1", 5.0, 8.0),
    }


def curve(cycle, shift=0.0):
    volt = np.linspace(3.2, 4.2, 50)
    return {
        "cycle": np.repeat(cycle, 50),
        "voltage_volt": np.tile(volt, len(cycle)),
        "dq_dv_ampere_hour_per_volt": np.tile(np.ones(50) + shift, len(cycle)),
    }


def test_a_panel_a_rate_and_a_line_a_peak():
    figure = peaks.draw_ica_tracks(tracks(), {("t0.05", 0.0): (np.arange(3), np.ones(3))})
    assert [panel.get_title(loc="left") for panel in figure.axes] == [
        "dQ/dV at 0.05C, temperature not stated",
        "dQ/dV at 0.5C, temperature not stated",
    ]
    lines = {line.get_label(): line for line in figure.axes[0].lines}
    assert lines["P1"].get_xdata().tolist() == [3.5] * 3
    assert np.isnan(lines["P2"].get_xdata()[-1])
    alone = peaks.draw_ica_tracks(
        tracks(rates=(0.05,)), {("t0.05", 0.0): (np.arange(3), np.ones(3))}
    )
    assert [panel.axison for panel in alone.axes] == [True, False]


def test_a_rate_with_one_charge_has_no_panel_for_nothing_moves():
    assert peaks.draw_ica_tracks(tracks(cycles=(0.0,)), {}).not_drawn == peaks.TOO_FEW


def test_curves_of_a_record_that_counts_on_take_the_cycles_of_the_tracks():
    about = {"wildcards": {"cell": "C", "test": "t0.05"}}
    own = tracks(rates=(0.05,), cycles=(300.0, 350.0))
    found = peaks.curves_by_charge([], [(curve([1.0, 51.0]), about)], own)
    assert sorted(found) == [("t0.05", 300.0), ("t0.05", 350.0)]


def test_curves_of_check_ups_have_the_cycle_of_their_test():
    about = {"wildcards": {"cell": "C", "test": "t0.05"}}
    columns = {name: column for name, column in curve([0.0]).items() if name != "cycle"}
    found = peaks.curves_by_charge([(columns, about)], [], tracks(rates=(0.05,), cycles=(200.0,)))
    assert list(found) == [("t0.05", 200.0)]
