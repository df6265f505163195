"""Checks of a group's channels: planted faults are named, sound records pass, errors are honest."""

from functools import cache

import numpy as np
import pytest

import cellwright as cw
from cellwright.numerics.statistics import rms
from cellwright.packs.checks import (
    channel_findings,
    refuse_contradiction,
    swapped,
    swapped_channels,
)
from cellwright.packs.wiring import Wiring
from cellwright.records.record import record_of
from cellwright.refusal import Refusal

CAPACITY = np.array([30.0, 29.0, 27.5, 31.0])
RESISTANCE = np.array([2.0e-3, 2.3e-3, 2.1e-3, 1.9e-3])
NOISE_AMPERE = 0.006
SEEDS = range(12)


def load(seed, rows=3000):
    """A drive of the group between two rests [A]."""
    levels = np.random.default_rng(seed).normal(-40.0, 40.0, rows // 10)
    total = np.repeat(levels, 10)
    total[:300] = total[-300:] = 0.0
    return total


@cache
def shared(seed, members=4):
    """Currents (n, members) of cells of one linear OCV in parallel, a second a row [A]."""
    total = load(seed)
    soc, slope = np.full(members, 0.9), 0.8
    resistance, capacity = RESISTANCE[:members], CAPACITY[:members]
    currents = np.empty((len(total), members))
    for row, ampere in enumerate(total):
        ocv = 3.0 + slope * soc
        voltage = (ampere + (ocv / resistance).sum()) / (1.0 / resistance).sum()
        currents[row] = (voltage - ocv) / resistance
        soc = soc + currents[row] / 3600.0 / capacity
    return currents


def measured(seed, members=4):
    """True currents of a group, and those that noisy sensors of three digits read."""
    true = shared(seed, members).copy()
    noise = np.random.default_rng(seed + 100).normal(0.0, NOISE_AMPERE, true.shape)
    return true, np.round(true + noise, 3)


def record(read, total, cells=None, volt=None):
    volt = np.full(len(total), 3.6) if volt is None else volt
    time = np.arange(float(len(total)))
    made = record_of(time, total, volt, np.nan, test="t")
    return made._replace(member_current_ampere=read, cell_voltage_volt=cells)


def parallel(members=4):
    names = tuple("ABCD"[:members])
    return Wiring("g", "parallel", names, (0.0,) * members, (0.0,) * members)


def series(contact_ohm=1e-4):
    return Wiring("g", "series", tuple("ABC"), (contact_ohm,) * 3, (0.0,) * 3)


def found(read, total, wiring=None):
    findings = channel_findings(record(read, total), wiring or parallel(read.shape[1]))
    return [finding for finding in findings if finding.found]


@pytest.mark.parametrize("members", [2, 3, 4])
def test_sound_records_raise_no_alarm(members):
    for seed in SEEDS:
        true, read = measured(seed, members)
        assert found(read, np.round(true.sum(axis=1), 3)) == []


def test_offset_and_gain_lie_within_their_deviations():
    errors = {"sum_offset": [], "sum_gain": []}
    for seed in range(25):
        true, read = measured(seed, 3)
        read = 1.01 * read + 0.2
        for one in channel_findings(record(read, true.sum(axis=1)), parallel(3))[:2]:
            truth = 0.6 if one.check == "sum_offset" else 0.01
            errors[one.check].append((one.value - truth) / one.std)
    for name, scaled in errors.items():
        within = np.mean(np.abs(scaled) < 1.96)
        assert within >= 0.85, (name, within)
        assert 0.4 < rms(np.array(scaled)) < 1.5, name


@pytest.mark.parametrize("gain", [0.01, -0.02, 0.03])
def test_a_branch_that_reads_too_much_is_named_with_its_gain(gain):
    named = []
    for seed in SEEDS:
        true, read = measured(seed, 3)
        read[:, seed % 3] *= 1.0 + gain
        (one,) = found(read, true.sum(axis=1))
        assert one.check == "sum_gain"
        if one.branch is not None:
            named.append(one.branch == seed % 3 + 1)
            assert abs(one.value - gain) < 5 * one.std
    assert all(named)
    assert len(named) >= 6


def test_an_offset_is_told_in_ampere():
    true, read = measured(1, 3)
    read[:, 1] += 0.5
    (one,) = found(read, true.sum(axis=1))
    assert one.check == "sum_offset"
    assert abs(one.value - 0.5) < 5 * one.std
    assert "+0.5 A more than the total" in one.sentence


@pytest.mark.parametrize(
    ("factor", "words"), [(-1.0, "sign is turned"), (1000.0, "in mA what"), (0.001, "in A what")]
)
def test_a_sensor_in_another_sign_or_unit_is_named_and_refused(factor, words):
    for seed in SEEDS:
        true, read = measured(seed, 4)
        read[:, seed % 4] *= factor
        total = true.sum(axis=1)
        (one,) = found(read, total)
        assert (one.check, one.branch, one.value) == ("unit", seed % 4 + 1, factor)
        assert words in one.sentence
        held = record(read, total)
        with pytest.raises(Refusal, match=f"miss the total by .*branch {seed % 4 + 1} alone"):
            refuse_contradiction(held, parallel())


def test_a_dead_sensor_and_an_open_branch_are_told_apart():
    true, read = measured(3)
    read[:, 2] = np.random.default_rng(0).normal(0.0, NOISE_AMPERE, len(read))
    (dead,) = found(read, true.sum(axis=1))
    assert (dead.check, dead.branch) == ("silent", 3)
    assert "its sensor is dead" in dead.sentence
    (open_one,) = found(read, true.sum(axis=1) - true[:, 2])
    assert (open_one.check, open_one.branch) == ("absent", 3)
    assert "its cell is missing" in open_one.sentence


def test_a_member_without_a_channel_is_absent_where_the_others_carry_all():
    true, read = measured(4)
    read[:, 1] = np.nan
    (untold,) = channel_findings(record(read, true.sum(axis=1)), parallel())
    assert not untold.found
    assert "current of branch 2 was not logged" in untold.sentence
    (absent,) = found(read, true.sum(axis=1) - true[:, 1])
    assert (absent.check, absent.branch) == ("absent", 2)


@pytest.mark.parametrize("members", [2, 4])
def test_a_computed_branch_is_said(members):
    true, read = measured(5, members)
    total = np.round(true.sum(axis=1), 3)
    read[:, 0] = total - read[:, 1:].sum(axis=1)
    (one,) = found(read, total)
    assert one.check == "dependent"
    words = "errors of the two branches are the same number" if members == 2 else "only 3 of 4"
    assert words in one.sentence


def test_a_small_contradiction_is_scored_and_a_large_one_refused():
    true, read = measured(6)
    total = true.sum(axis=1)
    refuse_contradiction(record(None, total), parallel())
    refuse_contradiction(record(1.03 * read, total), parallel())
    with pytest.raises(Refusal, match=r"t: its branch currents miss the total by .* more than the"):
        refuse_contradiction(record(1.1 * read, total), parallel())


def test_a_record_without_branches_or_without_a_load_tells_nothing():
    true, read = measured(7)
    assert channel_findings(record(None, true.sum(axis=1)), parallel()) == []
    (one,) = channel_findings(record(0 * read, np.zeros(len(read))), parallel())
    assert not one.found
    assert "too few rows with a current" in one.sentence


def swap(read, pair):
    order = np.arange(read.shape[1])
    order[list(pair)] = order[list(reversed(pair))]
    return read[:, order]


def test_swapped_branches_are_found_by_their_models_and_sound_ones_pass():
    for seed in SEEDS:
        true, read = measured(seed)
        share = rms(true.sum(axis=1)) / 4
        # models that are 1 % off, each in its own way
        wrong = 1.0 + 0.01 * np.random.default_rng(seed + 7).standard_normal(4)
        simulated = shared(seed) * wrong
        assert swapped(read, simulated, share, test="t") == []
        (one,) = swapped(swap(read, (0, 1)), simulated, share, test="t")
        assert (one.check, one.branch) == ("swapped", 1)
        assert "branch 1 fits the model of branch 2, branch 2 fits the model of branch 1" in (
            one.sentence
        )


def test_three_branches_in_a_circle_are_one_finding():
    true, read = measured(2)
    share = rms(true.sum(axis=1)) / 4
    (one,) = swapped(read[:, [1, 3, 2, 0]], true, share, test="t")
    assert "branch 1 fits the model of branch 2, branch 2 fits the model of branch 4" in (
        one.sentence
    )


def test_cells_too_alike_for_their_models_are_not_told_apart():
    true, read = measured(3, 2)
    alike = true.mean(axis=1, keepdims=True) * np.array([1.0005, 0.9995])
    assert swapped(alike[:, ::-1] + read - true, alike, rms(alike), test="t") == []


def test_channels_are_found_by_name_in_a_series_of_scores():
    true, read = measured(4, 2)
    columns = {"current_ampere": true.sum(axis=1)}
    for k in range(2):
        columns[f"branch_{k + 1}_current_ampere"] = read[:, 1 - k]
        columns[f"simulated_branch_{k + 1}_current_ampere"] = true[:, k]
    (one,) = swapped_channels(columns, parallel(2), "t")
    assert one.check == "swapped"
    del columns["simulated_branch_2_current_ampere"]
    assert swapped_channels(columns, parallel(2), "t") == []


def string(seed, contact_ohm=1e-4):
    """A series record: total, cell voltages, the pack's with its contacts."""
    total = load(seed)
    noise = np.random.default_rng(seed)
    cells = 3.6 + total[:, None] * RESISTANCE[:3] + noise.normal(0.0, 2e-4, (len(total), 3))
    pack = cells.sum(axis=1) + 3 * contact_ohm * total + noise.normal(0.0, 1e-3, len(total))
    return total, cells, pack


def test_cells_in_series_add_up_to_the_pack_and_its_contacts():
    for seed in SEEDS:
        total, cells, pack = string(seed)
        offset, contacts = channel_findings(record(None, total, cells, pack), series())
        assert not offset.found
        assert not contacts.found
        assert abs(contacts.value - 3e-4) < 5 * contacts.std
    bad = channel_findings(record(None, total, cells, pack + 0.1), series())
    assert [(one.check, one.found) for one in bad] == [("voltage_sum", True), ("contacts", False)]
    _, other = channel_findings(record(None, total, cells, pack), series(contact_ohm=5e-4))
    assert other.found
    assert "groups.tsv states 1.5 mΩ" in other.sentence


def test_a_cell_voltage_that_is_not_there_leaves_no_sum():
    total, cells, pack = string(1)
    cells[:, 1] = np.nan
    (one,) = channel_findings(record(None, total, cells, pack), series())
    assert not one.found
    assert "the voltage of cell 2 was not logged" in one.sentence


def test_currents_of_members_in_series_are_the_total():
    total, _, _ = string(2)
    noise = np.random.default_rng(0).normal(0.0, NOISE_AMPERE, (len(total), 3))
    read = total[:, None] * [1.0, 1.02, 1.0] + [0.0, 0.0, 0.5] + noise
    wrong = found(read, total, series())
    assert [(one.check, one.branch) for one in wrong] == [
        ("current_gain", 2),
        ("current_offset", 3),
    ]


PAIR = [{"group": "pair", "position": k, "cell": f"c{k}"} for k in (1, 2)]
GROUP_TEST = {"test": "parallel_C10", "kind": "group"}


@pytest.fixture(scope="module")
def weng(shared):
    """The clean record of two real cells in parallel."""
    raw = cw.read(str(shared / "campaigns/weng/raw/parallel_C10.csv.gz"), members=2)
    return cw.clean(raw).columns


def test_the_branch_currents_of_two_real_cells_are_one_measurement(weng):
    checks = cw.check_group(PAIR, weng, GROUP_TEST)
    assert [row["check"] for row in checks.rows if row["found"]] == ["dependent"]
    (note,) = checks.notes
    assert "the errors of the two branches are the same number" in note


def test_a_turned_branch_of_two_real_cells_is_named(weng):
    turned = weng | {"branch_2_current_ampere": -weng["branch_2_current_ampere"]}
    (row,) = [row for row in cw.check_group(PAIR, turned, GROUP_TEST).rows if row["found"]]
    assert (row["check"], row["branch"], row["value"]) == ("unit", 2, -1.0)


def test_a_real_branch_that_is_not_in_the_sheet_is_refused(weng):
    beyond = weng | {"branch_3_current_ampere": weng["branch_2_current_ampere"]}
    with pytest.raises(Refusal, match=r"found Branch 3 Current / A; groups\.tsv wires 2 members"):
        cw.check_group(PAIR, beyond, GROUP_TEST)
