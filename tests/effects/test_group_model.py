"""The group's model: kernel and twin agree, Kirchhoff holds, another integration says the same."""

import numpy as np
import pytest
from group_pair import CELLS, record

from cellwright.effects.groups import model
from cellwright.effects.groups.model import group_fields, group_names, group_run
from cellwright.effects.records import group_stacked

HOLDS = pytest.mark.parametrize("hold", ["zero_order", "first_order"])


def run(monkeypatch, hold, *, compiled):
    if not compiled:
        monkeypatch.setattr(model, "function", lambda *_, **__: None)
    stack = group_stacked([record("a", 1), record("b", 2, celsius=5.0)], branches=2, hold=hold)
    values = dict.fromkeys(group_names(2, 2), 0.0) | {"0.capacity": -0.1, "1.soc": 0.02}
    return stack, group_run(group_fields(CELLS, np.full((2, 2), 0.9), values), stack)


@HOLDS
def test_kernel_and_twin_agree(monkeypatch, hold):
    _, fast = run(monkeypatch, hold, compiled=True)
    _, slow = run(monkeypatch, hold, compiled=False)
    for compiled, twin in zip(fast, slow, strict=True):
        assert compiled == pytest.approx(twin, abs=1e-10)


@HOLDS
def test_branch_currents_add_up_to_the_total(monkeypatch, hold):
    stack, simulated = run(monkeypatch, hold, compiled=True)
    assert simulated.current.sum(axis=1) == pytest.approx(stack.current_ampere, abs=1e-9)


def test_another_integration_says_the_same():
    measured = record("a", 1)
    stack = group_stacked([measured], branches=2)
    values = dict.fromkeys(group_names(1, 2), 0.0)
    simulated = group_run(group_fields(CELLS, np.full((1, 2), 0.9), values), stack)
    assert np.std(simulated.voltage - measured.voltage_volt) < 1.1e-3
    assert np.std(simulated.current - measured.branch_current_ampere) < 3e-3
