"""Figures of impedance: how spectra share panels, the fit, relaxation times."""

import numpy as np
from figure_panels import SOC, about, drawn, panels

from figures import impedance


def spectrum():
    columns = {
        f"{kind}_{part}_ohm": SOC + 1
        for kind in ("impedance", "fitted")
        for part in ("real", "imaginary")
    }
    test = {f"kramers_kronig_{part}": 0.01 * np.ones(11) for part in ("real", "imaginary")}
    return columns | test | {"frequency_hertz": 10.0 ** (10 * SOC - 5), "in_fit": SOC > 0.15}


STATES = ((25, 0.5), (25, None), (0, 0.2), (None, 0.2))


def test_spectra_of_one_state_of_charge_share_a_panel():
    tests = [(spectrum(), about(celsius=c, soc=s)) for c, s in STATES]
    found = panels(impedance.draw_nyquist(tests))
    titles = [panel.get_title(loc="left") for panel in found if panel.get_title(loc="left")]
    assert titles == ["SoC 20 %", "SoC 50 %", "SoC not stated"]
    points = 1e3 * np.column_stack([SOC + 1, -SOC - 1])
    np.testing.assert_allclose(drawn(found[0])[0], points[2:])
    np.testing.assert_allclose(drawn(found[0])[1], points[:2])  # left out of the fit: crosses
    assert len(drawn(found[0])) == 6


def test_fit_of_spectra_shows_error_and_noise():
    tests = [(spectrum(), about(celsius=c, soc=s)) for c, s in STATES]
    found = panels(impedance.draw_impedance_fit(tests))
    assert len(found) == 6
    error, noise = drawn(found[3])[:2]
    np.testing.assert_allclose(error[:, 1], 0, atol=1e-9)
    np.testing.assert_allclose(noise[:, 1], np.sqrt(2))


def test_relaxation_times_are_drawn_over_frequency_with_their_peaks():
    curve = {"tau_second": 10.0 ** (4 * SOC - 2), "gamma_ohm": 1e-3 * np.sin(np.pi * SOC)}
    peaks = {"frequency_hertz": np.array([0.159, 9.0]), "in_range": np.array([True, False])}
    (found,) = panels(impedance.draw_relaxation_times([(curve, peaks, about(soc=0.5))]))
    line, tops = drawn(found)
    np.testing.assert_allclose(line[:, 1], 1e3 * curve["gamma_ohm"])
    np.testing.assert_allclose(tops, [[0.159, 1.0]], rtol=1e-2)
