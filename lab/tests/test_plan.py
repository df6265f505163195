"""Campaigns on paper: what the sheets will say is in the contract, for every campaign."""

import hashlib
import re
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from runtime import settings
from runtime import sheets as campaign
from virtual_lab import campaigns, instruments
from virtual_lab.campaigns import thesis_packs
from virtual_lab.chamber import temperature_at
from virtual_lab.hidden.groups import GROUP_EFFECTS
from virtual_lab.hidden.vocabulary import EFFECTS, INVISIBLE
from virtual_lab.specimens import branch_rows

SCHEMAS = Path(__file__).resolve().parents[2] / "workflow" / "schemas"
FEW = {"cells": 1, "healthy": 3, "unknown": 4, "two": 3, "physics": 4, "groups": 1}
CHOSEN = {"demo": {}, "thesis": {}, "hidden": FEW, "scale": {"cells": 3}}
every_campaign = pytest.mark.parametrize("name", CHOSEN)


@pytest.fixture(scope="module")
def plans():
    return {name: campaigns.plan(name, **chosen) for name, chosen in CHOSEN.items()}


def _test(**changes):
    return campaigns.Test("A", "t", "drive", 25.0, "bdf", None)._replace(**changes)


def _branches(specimens):
    return [
        row
        for name, group in specimens.items()
        for row in branch_rows(name, group.names, *([value] * len(group.names) for value in (0, 1)))
    ]


def _stand_in(file):
    """What the checksum of a file will look like."""
    return hashlib.sha256(file.encode()).hexdigest()


def test_seeds_are_of_the_name_and_the_campaign_alone():
    first_bytes = hashlib.sha256(b"A/t").digest()[:4]
    assert _test().seed == int.from_bytes(first_bytes, "big")
    other_kind = _test(kind="hppc", ambient_celsius=0.0, steps=[], batch="b", soc=0.5, note="n")
    assert other_kind.seed == _test().seed
    seeds = {_test(**c).seed for c in ({}, {"cell": "B"}, {"test": "u"}, {"seed_of_campaign": 1})}
    assert len(seeds) == 4


@pytest.mark.parametrize(("name", "fewer", "more"), [("scale", 3, 5), ("hidden", 1, 2)])
def test_a_test_is_what_it_is_however_many_there_are(name, fewer, more):
    """Named alike, made alike: seeds, chambers, starts."""
    small, large = (
        campaigns.plan(name, **CHOSEN[name] | {"cells": cells}) for cells in (fewer, more)
    )
    known = {(test.cell, test.test): test for test in large.tests}
    for test in small.tests[:20]:
        same = known[test.cell, test.test]
        assert (same.seed, same.initial_soc) == (test.seed, test.initial_soc)
        second = np.arange(0.0, 9000.0, 7.0)
        np.testing.assert_array_equal(
            temperature_at(same.around, second), temperature_at(test.around, second)
        )


def test_another_seed_is_another_campaign(plans):
    again, other = (campaigns.plan("thesis", seed=seed) for seed in (0, 1))
    told = [[t.seed for t in p.tests] for p in (plans["thesis"], again, other)]
    assert told[0] == told[1]
    assert not set(told[0]) & set(told[2])
    capacities = [[g.names for g in p.groups.values()] for p in (again, other)]
    assert capacities[0][:8] == capacities[1][:8]
    assert capacities[0][8:] != capacities[1][8:]


@pytest.mark.parametrize(
    ("name", "given", "message"),
    [
        ("thesi", {}, "no campaign 'thesi'; there are demo, thesis, hidden, scale"),
        ("thesis", {"sed": 1}, "thesis has no option sed; it has seed"),
        ("demo", {"cells": 1}, "demo has no option cells; it has none"),
        ("scale", {"cells": "many"}, "option cells: 'many' is not int"),
        ("scale", {"cells": None}, "option cells: None is not int"),
    ],
)
def test_what_is_not_there_is_refused(name, given, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        campaigns.plan(name, **given)


def test_options_are_read_from_text_and_the_workflows_own_are_left():
    given = {"campaign": "scale", "folder": "x", "cells": "7"}
    assert campaigns.options("scale", given) == {"seed": 0, "cells": 7}
    assert set(campaigns.FOLDERS) == set(campaigns.OPTIONS)


@every_campaign
def test_sheets_have_the_columns_of_the_contract(plans, name):
    found = plans[name]
    checksums = {test.file: _stand_in(test.file) for test in found.tests}
    sheets = {
        "cells": campaigns.cells_sheet(found),
        "tests": campaigns.tests_sheet(found, checksums),
    }
    if found.groups:
        sheets["groups"] = _branches(found.groups)
    for sheet, rows in sheets.items():
        known = settings.load(SCHEMAS, sheet)
        assert {column for row in rows for column in row} <= set(known["properties"]), sheet
        for column in known["required"]:
            assert all(row.get(column) is not None for row in rows), (sheet, column)


@every_campaign
def test_the_pipeline_takes_the_campaign(plans, name, tmp_path):
    """Its own check of the sheets: kinds, roles, ids, owners, leaks, config."""
    found = plans[name]
    (tmp_path / "config").mkdir()
    checksums = {test.file: _stand_in(test.file) for test in found.tests}
    sheets = {
        "cells": campaigns.cells_sheet(found),
        "tests": campaigns.tests_sheet(found, checksums),
    }
    sheets |= {"groups": _branches(found.groups)} if found.groups else {}
    for sheet, rows in sheets.items():
        text = campaigns.as_table(rows, separator="\t")
        (tmp_path / "config" / f"{sheet}.tsv").write_text(text, encoding="utf-8")
    (tmp_path / "config" / "config.yaml").write_text(found.config, encoding="utf-8")
    read = campaign.read(tmp_path, SCHEMAS)
    assert [row["cell"] for row in read.cells] == [cell.name for cell in found.cells]
    assert [(r["cell"], r["test"]) for r in read.tests] == [(t.cell, t.test) for t in found.tests]
    assert [row["sha256"] for row in read.tests] == [[_stand_in(t.file)] for t in found.tests]


@every_campaign
def test_files_have_names_of_their_own(plans, name):
    tests = plans[name].tests
    files = [test.file.lower() for test in tests]  # as some disks see them
    assert len(set(files)) == len(files)
    assert len({test.seed for test in tests}) == len(tests)


@every_campaign
def test_instruments_are_known(plans, name):
    used = {test.instrument for test in plans[name].tests}
    assert used <= set(campaigns.SUFFIX)
    assert used <= set(instruments.WRITERS)
    for test in plans[name].tests:
        assert (test.instrument in ("eis", "digatron_eis")) == (test.kind == "eis"), test.file


@every_campaign
def test_every_cell_and_branch_is_in_the_sheet_and_in_a_test(plans, name):
    """What is true of a specimen is told by the job that makes its first test."""
    found = plans[name]
    cells = {cell.name for cell in found.cells}
    assert {test.cell for test in found.tests} == cells | set(found.groups)
    assert not cells & set(found.groups)
    for group, specimen in found.groups.items():
        assert set(specimen.names) <= cells, group
        assert len(set(specimen.names)) == len(specimen.names) > 1, group


@every_campaign
def test_batches_are_all_of_the_tests_each_once(plans, name):
    found = plans[name]
    batches = found.batches()
    assert sorted(t.file for b in batches.values() for t in b) == sorted(
        t.file for t in found.tests
    )
    # A name of a rule and of a file.
    assert all(re.fullmatch("[A-Za-z0-9_]+", batch) for batch in batches)


@every_campaign
def test_steps_end_and_stay_within_the_data_sheet(plans, name):
    ratings = {cell.name: cell.rating for cell in plans[name].cells}
    for test in plans[name].tests:
        rating = ratings.get(test.cell)
        steps = test.steps() if callable(test.steps) else test.steps or []
        for step in steps if rating else []:
            assert step.period_second > 0
            assert 0 < step.duration_second < 1e6
            limits = (None, rating.lower_cutoff_volt, rating.upper_cutoff_volt)
            assert step.until_volt in limits, test.file
            assert step.kind != "hold" or step.value in limits, test.file


def test_sheet_leaves_out_what_was_not_made():
    tests = (_test(), _test(test="u", steps=[]))
    rows = campaigns.tests_sheet(campaigns.Plan((), tests, {}, "", ""), {tests[1].file: "0" * 64})
    assert [row["test"] for row in rows] == ["u"]


def test_table_has_the_columns_in_order_and_blanks_where_nothing_is_known():
    rows = [{"b": 1, "a": None}, {"b": 2.5, "c": "x"}]
    assert campaigns.as_table(rows, separator=";") == "b;a;c\n1;;\n2.5;;x\n"


def test_thesis_has_the_cells_of_the_thesis(plans):
    """S12, S14, S20: 50 cells of a pack, 34 in 27 groups of 2 to 4, five types aged."""
    found = plans["thesis"]
    names = [cell.name for cell in found.cells]
    assert sum(bool(re.fullmatch(r"P\d\d", name)) for name in names) == 50
    assert sum(bool(re.fullmatch(r"G\d\d", name)) for name in names) == 34
    parallel = {name: one for name, one in found.groups.items() if name != "pack"}
    assert len(parallel) == 27
    assert found.groups["pack"].names == tuple(f"P{k:02d}" for k in range(1, 51))
    assert {len(group.names) for group in parallel.values()} == {2, 3, 4}
    aged = {test.cell for test in found.tests if test.kind == "ageing" and test.test == "life"}
    assert {name[0] for name in aged} == set("ABCDE")
    assert sum(cell.reference for cell in found.cells) >= 1


def test_thesis_has_45_spectra_of_fifteen_conditions(plans):
    spectra = [test for test in plans["thesis"].tests if test.kind == "eis"]
    assert len(spectra) == 45
    conditions = {(test.soc, test.ambient_celsius) for test in spectra}
    celsius = (20.0, 10.0, 5.0, 0.0, -10.0)
    assert conditions == {(soc, t) for soc in (0.05, 0.5, 1.0) for t in celsius}
    assert all(test.initial_soc == test.soc for test in spectra)


def test_first_eight_groups_are_those_of_table_5_2(plans):
    """Cells and capacities [Ah] as the table has them."""
    table = [
        {15: 31.7, 19: 31.2},
        {13: 31.7, 24: 21.2},
        {6: 22.7, 13: 31.7, 25: 27.3},
        {14: 29.7, 15: 31.7, 31: 30.1},
        {4: 31.5, 11: 31.1, 20: 24.9},
        {5: 28.7, 6: 22.7, 13: 31.7, 27: 26.3},
        {14: 29.7, 15: 31.7, 16: 30.2, 31: 30.1},
        {2: 24.9, 3: 29.8, 18: 29.4, 26: 29.4},
    ]
    told = {one.name: one.capacity_ampere_hour for one in thesis_packs.group_cells(0)}
    for group, cells in zip(plans["thesis"].groups.values(), table, strict=False):
        assert {int(name[1:]): told[name] for name in group.names} == cells
    assert min(told.values()) == 18.7
    assert max(told.values()) == 31.7


def test_fast_charges_take_half_an_hour_at_every_temperature(plans):
    """S10: what constant current leaves of it the voltage is held for."""
    tests = [test for test in plans["thesis"].tests if test.kind == "fast_charge"]
    assert [test.ambient_celsius for test in tests] == [25, 10, 0, -10, -20]
    constant = []
    for test in tests:
        steps = test.steps()
        *_, current, hold, _ = test.specimen.run(steps, chamber=test.around, initial_soc=1.0)
        assert current.duration_second + hold.duration_second == pytest.approx(1800.0, abs=1.0)
        constant.append(current.duration_second)
    # Ever less of it in the cold, down to nothing.
    assert constant == sorted(constant, reverse=True)
    assert constant[0] > 1200 > 60 > constant[-1]


def test_ageing_is_followed_from_fresh_to_the_end(plans):
    """Check-ups at the first and the last cycle; no cycle is blank but that of the fresh cell."""
    tests = [test for test in plans["thesis"].tests if test.test.startswith("hppc_")]
    for name in {test.cell for test in tests if test.cell[0] in "ABCD"}:
        cycles = [test.cycle for test in tests if test.cell == name]
        assert cycles[0] is None
        assert all(np.diff(cycles[1:]) > 0)
        life = next(t for t in plans["thesis"].tests if (t.cell, t.kind) == (name, "ageing"))
        assert life.specimen.cycles == cycles[-1]


def test_hidden_campaign_fits_and_validates_on_different_tests(plans):
    groups = set(plans["hidden"].groups)
    cells = {c.name for c in plans["hidden"].cells if c.specimen.kind in ("none", "single")}
    for name in (min(groups), min(cells), max(cells)):
        tests = [test for test in plans["hidden"].tests if test.cell == name]
        roles = {test.role for test in tests}
        assert roles == {"fit", "validation"}, name
        profiles = {
            role: {s.value.tobytes() for t in tests if t.role == role for s in t.steps
                   if s.kind == "profile"} for role in roles
        }  # fmt: skip
        assert not profiles["fit"] & profiles["validation"]


def test_names_of_hidden_cells_tell_nothing(plans):
    """Neither what is in a cell nor how strong goes with its place in the sheet."""
    kinds = [cell.specimen.kind for cell in campaigns.plan("hidden").cells if cell.name[0] == "h"]
    assert len({*kinds[:100]}) >= len({*kinds}) - 1  # the three references may come later
    halves = [sum(kind == "none" for kind in half) for half in (kinds[::2], kinds[1::2])]
    assert min(halves) > 0.35 * sum(halves)
    first, last = kinds[: len(kinds) // 2], kinds[len(kinds) // 2 :]
    assert 0.6 < first.count("single") / last.count("single") < 1.6


def test_hidden_campaign_is_as_large_as_the_goals_ask():
    """missing-effect.md: each effect at 1, 2.5 and 6 mV in ten cells, 200 healthy cells."""
    found = campaigns.plan("hidden")
    counts = Counter(
        (*cell.specimen.effects, cell.specimen.strength_volt)
        for cell in found.cells
        if cell.specimen.kind == "single" and cell.chemistry == "NMC"
    )
    visible = {key: count for key, count in counts.items() if key[0] not in INVISIBLE}
    assert set(visible) == {
        (e, v) for e in set(EFFECTS) - set(INVISIBLE) for v in (1e-3, 2.5e-3, 6e-3)
    }
    assert min(visible.values()) >= 10
    healthy = [cell for cell in found.cells if cell.specimen.kind == "none"]
    assert sum(cell.name.startswith("h") for cell in healthy) >= 200
    assert sum(cell.reference for cell in found.cells if cell.chemistry == "NMC") >= 3
    in_groups = {(group.effect, group.strength_volt) for group in found.groups.values()}
    assert {effect for effect, _ in in_groups} == {*GROUP_EFFECTS, None}
