"""Activation energies of a cell: one for each quantity, and what contradicts it."""

import numpy as np
import pytest

from cellwright.health.energies import energies_of_cell


def law(quantity, joule_per_mole, half=2000.0, **other):
    row = {"quantity": quantity, "law": "arrhenius", "parameter": "activation_energy"}
    row |= {"value": joule_per_mole, "std": half / 4, "doubt": None}
    row |= {"lower": joule_per_mole - half, "upper": joule_per_mole + half}
    return row | {"tested_from_celsius": -10.0, "tested_to_celsius": 25.0} | other


FIRST = "resistance at {} % SoC, first sample"
SURFACE = "resistance over SoC and temperature, first sample"


def search(kilojoule, std):
    size = {"name": "activation energy from -10 to 25 °C", "unit": "kJ/mol"}
    return {"effects": [{"sizes": [size | {"value": kilojoule, "std": std}]}]}


def one(rows, quantity):
    (row,) = [row for row in rows if (row["quantity"], row["name"]) == (quantity, "reconciled")]
    return row


def test_sources_of_one_quantity_are_one_number_no_surer_than_the_surest():
    laws = [law(FIRST.format(20), 21e3), law(FIRST.format(50), 23e3, 1000.0)]
    laws.append(law(SURFACE, 22e3, law="multiplicative", tested_to_celsius=40.0))
    rows = energies_of_cell(laws, {}, {})
    assert [row["name"] for row in rows[1:]] == [one["quantity"] for one in laws]
    found = one(rows, "R0")
    weight = np.array([1.0, 4.0, 1.0])
    assert found["energy_joule_per_mole"] == pytest.approx(weight @ [21e3, 23e3, 22e3] / 6)
    assert 1000 / 1.96 < found["energy_std_joule_per_mole"] < 2000 / 1.96
    assert (found["sources"], found["doubt"]) == (3, "")
    assert (found["tested_from_celsius"], found["tested_to_celsius"]) == (-10.0, 40.0)


def test_a_source_that_contradicts_the_others_is_named_with_both_numbers():
    laws = [law(FIRST.format(soc), 22e3 + 50 * soc, 300.0) for soc in (20, 50)]
    laws += [law("charge " + FIRST.format(soc), 22e3 + 50 * soc, 300.0) for soc in (20, 50, 80)]
    laws.append(law(FIRST.format(80), 60e3, 9000.0))
    found = one(energies_of_cell(laws, {}, {}), "R0")
    assert found["energy_joule_per_mole"] == pytest.approx(24.5e3, abs=1500)
    assert "resistance at 80 % SoC, first sample: 60 kJ/mol contradicts 24" in found["doubt"]


def test_other_quantities_stand_apart_in_order_each_with_what_it_is():
    laws = [
        law("polarisation a, median over SoC", 25e3),
        law("charge-transfer resistance at 50 % SoC, impedance", 60e3),
        law("ohmic resistance at 50 % SoC, impedance", 5e3),
        law("resistance at 50 % SoC, 10 s", 26e3),
        law("resistance at 50 % SoC, 2 s", 24e3),
        law(FIRST.format(50), 22e3),
        law("capacity at 1C", -700.0),
        law("resistance at 50 % SoC, first sample", 24e3, law="arrhenius_t"),
        law(SURFACE, 0.02, parameter="value_at_25_celsius"),
    ]
    condition = {"ambient_temperature_celsius": 25.0, "activation_energy_joule_per_mole": 15e3}
    model = {"chosen": "1RC", "members": [{"model": "1RC", "conditions": [condition]}]}
    rows = energies_of_cell(laws, model, search(28.0, 2.0))
    reconciled = [row for row in rows if row["name"] == "reconciled"]
    assert [row["quantity"] for row in reconciled] == [
        "R0",
        "resistance after 2 s",
        "resistance after 10 s",
        "ohmic resistance of spectra",
        "charge transfer of spectra",
        "faster part of what relaxes",
        "quick resistances, model in use",
        "all resistances, search",
    ]
    assert all(row["definition"] and not row["doubt"] for row in reconciled)
    assert one(rows, "all resistances, search")["energy_joule_per_mole"] == 28e3
    of_model = one(rows, "quick resistances, model in use")
    assert (of_model["energy_joule_per_mole"], of_model["energy_std_joule_per_mole"]) == (
        15e3,
        None,
    )


def test_a_cell_without_any_has_no_row():
    assert energies_of_cell([], {}, {}) == []
