"""The wiring's currents and voltages against a dense solve of Kirchhoff's equations."""

import numpy as np
import pytest
from wirings import WIRINGS, parallel, series

from cellwright.packs.network import currents, network_of, reduced
from cellwright.packs.wiring import cells_of
from cellwright.refusal import Refusal


class Dense:
    """All nodes and branches of a wiring as one matrix; node 0 is the plus lead, 1 the minus."""

    def __init__(self, wiring, source, resistance):
        self.nodes, self.branches = 2, []
        self.cells = iter(zip(source, resistance, strict=True))
        self.group(wiring, 0, 1)

    def node(self):
        self.nodes += 1
        return self.nodes - 1

    def branch(self, plus, minus, ohm, volt=None):
        self.branches.append((plus, minus, ohm, volt))

    def member(self, member, plus, minus, contact):
        inside = self.node()
        self.branch(plus, inside, contact)
        if isinstance(member, str):
            volt, ohm = next(self.cells)
            self.branch(inside, minus, ohm, volt)
        else:
            self.group(member, inside, minus)

    def group(self, wiring, plus, minus):
        count = len(wiring.members)
        if wiring.connection == "series":
            ends = [plus, *(self.node() for _ in range(count - 1)), minus]
            tops, bottoms = ends[:-1], ends[1:]
        else:
            tops = [plus, *(self.node() for _ in range(count - 1))]
            bottoms = [minus, *(self.node() for _ in range(count - 1))]
            if wiring.terminals == "opposite_ends":
                bottoms = bottoms[::-1]
            for k in range(1, count):
                self.branch(tops[k - 1], tops[k], 0.5 * wiring.link_ohm[k])
                self.branch(bottoms[k], bottoms[k - 1], 0.5 * wiring.link_ohm[k])
        for k, member in enumerate(wiring.members):
            self.member(member, tops[k], bottoms[k], wiring.contact_ohm[k])

    def solved(self, total):
        """Currents (cells,) and voltage of the pack."""
        size = self.nodes + len(self.branches)
        matrix, right = np.zeros((size, size)), np.zeros(size)
        for row, (plus, minus, ohm, volt) in enumerate(self.branches, self.nodes):
            matrix[row, [plus, minus, row]] = 1.0, -1.0, -ohm
            matrix[plus, row], matrix[minus, row] = 1.0, -1.0
            right[row] = volt or 0.0
        right[0] = total
        matrix[1], matrix[1, 1], right[1] = 0.0, 1.0, 0.0
        found = np.linalg.solve(matrix, right)
        rows = [k for k, b in enumerate(self.branches, self.nodes) if b[3] is not None]
        return found[rows], found[0]


def drawn(wiring, seed):
    rng, count = np.random.default_rng(seed), len(cells_of(wiring))
    uneven = wiring._replace(link_ohm=tuple(link * rng.uniform(0.5, 2) for link in wiring.link_ohm))
    source, resistance = rng.uniform(3.2, 4.1, count), 10 ** rng.uniform(-4, -1, count)
    return uneven, source, resistance, rng.uniform(-50, 30)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("shape", WIRINGS)
def test_currents_and_voltages_are_those_of_a_dense_solve(shape, seed):
    wiring, source, resistance, total = drawn(WIRINGS[shape], seed)
    network = network_of(wiring, np.ones(len(source)))
    lines = reduced(network, source, resistance)
    current = currents(network, lines, total)[: len(source)]
    true, volt = Dense(wiring, source, resistance).solved(total)
    np.testing.assert_allclose(current, true, rtol=0, atol=1e-9)
    at_cells = source + resistance * current
    np.testing.assert_allclose(at_cells, source + resistance * true, rtol=0, atol=1e-11)
    assert lines.source_volt[-1] + lines.resistance_ohm[-1] * total == pytest.approx(
        volt, abs=1e-11
    )


@pytest.mark.parametrize("shape", ["star", "ladder", "leads at opposite ends"])
def test_voltages_are_equal_to_a_dense_solve_to_rounding(shape):
    """Cells as they are: some volts behind some ten milliohms."""
    for seed in range(20):
        wiring, source, _, total = drawn(WIRINGS[shape], seed)
        resistance = np.random.default_rng(seed).uniform(0.01, 0.06, len(source))
        network = network_of(wiring, np.ones(len(source)))
        current = currents(network, reduced(network, source, resistance), total)[: len(source)]
        true, _ = Dense(wiring, source, resistance).solved(total)
        np.testing.assert_allclose(resistance * (current - true), 0.0, rtol=0, atol=1e-12)
        assert abs(current.sum() - total) < 1e-12


def test_the_share_of_a_cell_is_its_capacity_at_every_division():
    wiring = parallel(series("A", "B"), "C", series(parallel(*"DE"), "F"))
    network = network_of(wiring, np.array([2.0, 3.0, 2.0, 1.0, 3.0, 5.0]))
    np.testing.assert_allclose(network.share, [0.25, 0.25, 0.25, 0.125, 0.375, 0.5])


def test_refusals():
    with pytest.raises(Refusal, match="p has 2 cells, but 3 have models"):
        network_of(parallel("A", "B"), np.ones(3))
    with pytest.raises(Refusal, match="names a cell twice: A"):
        network_of(parallel("A", "B", "A"), np.ones(3))
    with pytest.raises(Refusal, match=r"contact or link of -0\.1 ohm"):
        network_of(parallel("A", "B", contact=-0.1), np.ones(2))
    with pytest.raises(Refusal, match="connected as 'bridge'"):
        network_of(parallel("A", "B")._replace(connection="bridge"), np.ones(2))
    with pytest.raises(Refusal, match="1 members, 1 contacts and 2 links"):
        network_of(series("A")._replace(link_ohm=(0.0, 0.0)), np.ones(1))
    network = network_of(parallel("A", "B"), np.ones(2))
    with pytest.raises(Refusal, match="member 2 of p has no resistance"):
        reduced(network, np.ones(2), np.array([0.01, 0.0]))
