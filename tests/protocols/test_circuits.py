"""Circuits as data: text to tree, impedance against formulas, slopes against differences."""

import numpy as np
import pytest
from spectra import FREQUENCY, NAMES, THESIS, thesis_impedance

from cellwright.protocols.impedance.circuits import circuit_impedance, circuit_slopes, parse
from cellwright.refusal import Refusal

S = 2j * np.pi * FREQUENCY
FORMULAS = {
    "R": ((2.0,), np.full(61, 2 + 0j)),
    "C": ((3.0,), 1 / (3 * S)),
    "L": ((3.0,), 3 * S),
    "CPE": ((2.0, 0.7), 1 / (2 * S**0.7)),
    "W": ((5.0,), 1 / (5 * np.sqrt(S))),
    "FLW": ((2.0, 3.0), 2 * np.tanh(np.sqrt(3 * S)) / np.sqrt(3 * S)),
    "FSW": ((2.0, 3.0), 2 / np.tanh(np.sqrt(3 * S)) / np.sqrt(3 * S)),
    "G": ((2.0, 3.0), 2 / np.sqrt(1 + 3 * S)),
}
CIRCUITS = ["L-R-(CPE|(R-W))", "R-(C|(R-FLW))-(CPE|R)", "R-(CPE|(R-FSW))", "(R|C|L)-G-C", "R"]


@pytest.mark.parametrize("text", FORMULAS)
def test_an_element_has_the_impedance_of_its_formula(text):
    values, expected = FORMULAS[text]
    np.testing.assert_allclose(circuit_impedance(text, FREQUENCY, values), expected, rtol=1e-12)


def test_the_thesis_circuit_is_its_equation_under_the_contracts_names():
    tree = parse("L - R - (CPE | (R - W))")
    assert tree.text == "L-R-(CPE|(R-W))"
    named = dict(zip(NAMES, THESIS, strict=True))
    values = [named.get(name, 2e-6) for name in tree.names]
    np.testing.assert_allclose(
        circuit_impedance(tree, FREQUENCY, values), thesis_impedance(THESIS, henry=2e-6), rtol=1e-12
    )


def test_parameters_of_other_circuits_are_numbered_by_element():
    names = parse("R-(CPE|R)-(CPE|(R-FSW))").names
    assert names[:4] == ("r1_ohm", "cpe1_t", "cpe1_p", "r2_ohm")
    assert names[4:] == ("cpe2_t", "cpe2_p", "r3_ohm", "fsw1_ohm", "fsw1_second")


@pytest.mark.parametrize("text", CIRCUITS)
def test_slopes_are_the_derivatives_by_the_logarithms(text):
    tree = parse(text)
    values = np.random.default_rng(1).uniform(0.3, 1, len(tree.names))
    impedance, slopes = circuit_slopes(tree, FREQUENCY, values)
    step = 1e-5
    for k in range(len(values)):
        moved = [values * np.exp(sign * step * (np.arange(len(values)) == k)) for sign in (1, -1)]
        up, down = (circuit_impedance(tree, FREQUENCY, one) for one in moved)
        assert np.max(np.abs((up - down) / (2 * step) - slopes[k]) / np.abs(impedance)) < 1e-8


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("R-(CPE|(R-W)", "not closed"),
        ("R-C)", "should end"),
        ("R-C|L", "mixes"),
        ("R-X", "'X' where an element"),
        ("R-", "its end where an element"),
        ("R-c", "no element, bracket"),
        ("", "no element"),
    ],
)
def test_what_is_no_circuit_is_refused_by_name(text, reason):
    with pytest.raises(Refusal, match=reason):
        parse(text)
