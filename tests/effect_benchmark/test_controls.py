"""Control terms: what stays the same under another order, what a random term is, who sees truth."""

import numpy as np

from cellwright.effects import base, records
from cellwright.effects.library import LIBRARY
from cellwright.records.record import record_of
from effect_benchmark import controls
from runtime import provenance

CELL = base.Cell(5.0, np.linspace(3.0, 4.2, 101))


def stack():
    time = np.arange(2000.0)
    current = np.where((time // 300) % 2 == 0, -2.0, 1.0)
    volt = np.full(2000, 3.7)
    pair = [record_of(time, current, volt, 0.8, test=name) for name in "ab"]
    return records.stacked(pair, capacity_ampere_hour=5.0)


def values(many):
    names = base.base_names(len(many.first))
    known = {"log_r0": np.log(0.02), "log_r1": np.log(0.01), "log_tau1": np.log(10.0)}
    return dict.fromkeys(names, 0.0) | known | {"log_r2": np.log(0.01), "log_tau2": np.log(100.0)}


def test_another_order_keeps_the_charge_of_each_record():
    many = stack()
    mixed = controls._mixed(many, 3)
    assert not np.array_equal(mixed.current_ampere, many.current_ampere)
    for k in range(2):
        rows = many.file == k
        assert mixed.current_ampere[rows].sum() == many.current_ampere[rows].sum()


def test_a_permuted_effect_is_nothing_where_the_effect_is_nothing():
    many, effect = stack(), LIBRARY["hysteresis_instant"]
    plain = values(many)
    mixed = controls.permuted(effect, CELL, plain, 3)
    absent = {f"{mixed.id}.{p.name}": p.neutral for p in mixed.parameters}
    present = {f"{mixed.id}.{p.name}": 10 * p.step for p in mixed.parameters}
    before = base.voltage(CELL, many, plain)
    assert np.allclose(base.voltage(CELL, many, plain | absent, (mixed,)), before)
    true = {f"{effect.id}.{p.name}": 10 * p.step for p in effect.parameters}
    change = base.voltage(CELL, many, plain | present, (mixed,)) - before
    right = base.voltage(CELL, many, plain | true, (effect,)) - before
    assert abs(np.corrcoef(change, right)[0, 1]) < 0.5


def test_a_random_term_has_the_size_that_it_is_given():
    many = stack()
    term = controls.random_term(2, 5.0, np.random.default_rng(1))
    plain = values(many)
    sizes = {f"{term.id}.size0": 1e-3, f"{term.id}.size1": 0.0}
    before = base.voltage(CELL, many, plain)
    change = base.voltage(CELL, many, plain | sizes, (term,)) - before
    assert 0.0 < np.sqrt(np.mean(change**2)) < 4e-3
    again = controls.random_term(2, 5.0, np.random.default_rng(1))
    assert np.array_equal(base.voltage(CELL, many, plain | sizes, (again,)) - before, change)


def test_what_searches_never_imports_the_laboratory():
    seen = provenance._closure(provenance.SCRIPTS / "benchmark/effect_answers.py", frozenset())
    assert not [path for path in seen if "virtual_lab" in path.parts]
