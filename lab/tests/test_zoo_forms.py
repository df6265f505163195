"""Behavioural cells of the zoo: what they do, how strong their effects are, what is written."""

import json

import numpy as np
import pytest

from effect_benchmark import campaign
from virtual_lab import protocols
from virtual_lab.protocols import Step
from virtual_lab.zoo import (
    cell,
    effects,
    forms,
    half_cells,
    made,
    march,
    metering,
    parts,
    planned,
    strength,
    tests_of_cells,
)


def specimen(seed=1, chemistry="NMC"):
    return cell.healthy(np.random.default_rng(seed), chemistry)


def plain_cell(**changes):
    """A cell whose elements depend on nothing, so that its voltage is known by hand."""
    flat = specimen().cell._replace(
        r=(0.02, 0.01, 0.012, 0.0),
        tau=(8.0, 100.0, 300.0),
        course=(cell.ONE,) * 4,
        energy=(0.0,) * 4,
        core=(1e-9, 60.0),
        can=(1e-9, 60.0),
    )
    return flat._replace(**changes)


def pulse(one, c_rate=-1.0, second=100.0, celsius=25.0):
    """The track of a rest, a constant current and a rest from 90 % SoC."""
    steps = [protocols.rest(60.0), Step("current", c_rate, second, 1.0), protocols.rest(600.0)]
    return march.track(steps, march.fleet_of([one]), np.array([0.9]), celsius, seed=3)


@pytest.mark.parametrize("chemistry", sorted(half_cells.POSITIVE))
def test_ocv_rises_from_cut_off_to_cut_off(chemistry):
    volt = half_cells.open_circuit_volt(chemistry)
    assert np.all(np.diff(volt) > 0)
    assert volt[[0, -1]] == pytest.approx(half_cells.CUTOFFS_VOLT[chemistry], abs=2e-3)


def test_a_pulse_is_the_circuit_by_hand():
    one = plain_cell()
    track = pulse(one)
    ampere = -one.rating.capacity_ampere_hour
    k = np.flatnonzero(track.step[:, 0] == 2)[-1]
    since = 100.0
    over = 0.02 + 0.01 * (1 - np.exp(-since / 8)) + 0.012 * (1 - np.exp(-since / 100))
    soc = 0.9 + ampere * since / 3600 / one.ampere_hour
    ocv = np.interp(soc, half_cells.SOC, one.ocv)
    assert track.soc[k, 0] == pytest.approx(soc, abs=1e-6)
    assert track.volt[k, 0] == pytest.approx(ocv + over * ampere, abs=2e-5)


def test_kinetics_are_those_of_butler_and_volmer():
    one = plain_cell(exchange_ampere=2.0, symmetry=0.35)
    rise = pulse(one).volt[:, 0] - pulse(plain_cell()).volt[:, 0]
    eta = rise[np.flatnonzero(pulse(one).step[:, 0] == 2)[-1]] / half_cells.THERMAL_VOLT
    ampere = 2.0 * (np.exp(0.65 * eta) - np.exp(-0.35 * eta))
    assert ampere == pytest.approx(-one.rating.capacity_ampere_hour, rel=2e-3)


def test_diffusion_settles_at_the_departure_of_a_sphere():
    """Surface minus mean after a constant flux: fifth of R over D; weights are relative to it."""
    rate, weight = march.diffusion_modes()
    assert weight.sum() == pytest.approx(1.0)
    assert np.all(weight >= -1e-12)
    # The slowest mode of a sphere without its mean: the first root of tan x = x, squared.
    assert rate[0] == pytest.approx(4.4934**2, rel=0.03)


def test_a_hold_keeps_its_voltage_until_the_current_has_fallen():
    one = specimen().cell
    steps = [Step("current", 0.5, 20000.0, 20.0, until_volt=1.0)]
    steps += [protocols.hold(tests_of_cells.UNIT, until_c_rate=1 / 50)]
    track = march.track(steps, march.fleet_of([one]), np.array([0.5]), 25.0, seed=1)
    held = track.there[:, 0] & (track.step[:, 0] == 2)
    assert track.volt[held, 0] == pytest.approx(4.2, abs=1e-3)
    last = track.ampere[held, 0][-1] / one.rating.capacity_ampere_hour
    assert last <= 1 / 50 < last * 1.3


def test_heat_warms_and_play_operators_close_their_loop():
    hot = pulse(plain_cell(core=(5.0, 60.0), can=(3.0, 200.0)))
    assert hot.celsius.max() > 25.5
    looped = pulse(plain_cell(play_volt=(1e-3,) * len(cell.PLAY_SOC))).volt[:, 0]
    change = looped - pulse(plain_cell()).volt[:, 0]
    assert change[0] == pytest.approx(5e-3)  # charged before, as every cell
    assert change.min() < 1e-3


@pytest.fixture(scope="module")
def drive():
    """A specimen and its noise-free records of a drive to fit and one that judges."""
    one = specimen(5)
    steps = [
        protocols.dynamic_load(
            tests_of_cells.UNIT, style=style, seed=2, ampere_hour=0.12, duration_second=500
        )
        for style in ("soft", "harsh")
    ]

    def records(changed):
        fleet, shown = march.fleet_of([changed.cell]), []
        for k, own in enumerate(steps):
            track = march.track(own, fleet, np.array([0.9]), 25.0, seed=k)
            columns = metering.shown(track, 0, changed.meter, faulty=False)
            shown.append(strength.Record(columns, 25.0, k == 1))
        return shown

    return one, records


def test_a_plain_circuit_leaves_nothing_of_a_plain_circuit(drive):
    one, records = drive
    plain = one._replace(cell=plain_cell(ampere_hour=one.cell.ampere_hour), slow_volt=0.0)
    left = strength.left(records(plain), plain, [0.9, 0.9])
    assert left.fit_volt < 3e-5
    assert left.validation_volt < 3e-5


def test_names_explain_their_own_simple_forms_and_no_others(drive):
    one, records = drive
    plain = one._replace(cell=plain_cell(ampere_hour=one.cell.ampere_hour), slow_volt=0.0)
    known = [0.9, 0.9]
    without = strength.left(records(plain), plain, known, names=True)
    for name, size in (("constant_asymmetry", 0.3), ("constant_gap", 3e-3)):
        form = effects.SIMPLE[name]
        left = strength.left(records(form.act(plain, size, {})), plain, known)
        shares = strength.explained(left.rows - without.rows, without.tangent, without.signatures)
        assert shares[form.effect] > 0.9
        assert shares["time_skew"] < 0.3
        assert strength.visible(left, without, 1e-3) is (left.fit_volt > 0.6e-3)


def numbers(one):
    """All numbers of a specimen in a row; of its earlier cell only whether there is one."""
    parts_of = [one.slow_volt, one.start_soc, [one.held, one.earlier is not None]]
    parts_of += [np.ravel(value) for value in (*one.cell[1:], *one.meter) if not _is_text(value)]
    return np.concatenate([np.ravel(np.asarray(part, float)) for part in parts_of])


def _is_text(value):
    return isinstance(value, str)


def test_every_form_changes_the_specimen_and_has_a_layout():
    random = np.random.default_rng(1)
    for name, form in effects.FORMS.items():
        drawn = form.draw(random)
        changed = numbers(form.act(specimen(), form.first, drawn))
        assert not np.array_equal(changed, numbers(specimen())), name
        assert form.parameter
        assert set(form.layouts) <= set(tests_of_cells.LAYOUTS)


def test_the_plan_has_the_numbers_asked_for_and_another_seed_another_order():
    sizes = {"healthy": 7, "other": 2, "simple": 1, "two": 3, "outside": 1, "sheets": 2}
    cells = planned.plan(seed=1, unproven=1, **sizes)
    kinds = [one.kind for one in cells.values()]
    assert kinds.count("none") == 7
    assert kinds.count("two") == 3
    assert kinds.count("unknown") == len(effects.OUTSIDE)
    assert kinds.count("sheet") == 2 * len(effects.SHEETS)
    singles = 2 * len(effects.OTHER) + len(effects.SIMPLE) + 2 + len(effects.NEED_TEMPERATURE)
    assert kinds.count("single") == singles
    assert list(planned.plan(seed=2, unproven=1, **sizes).values()) != list(cells.values())


FULL = tests_of_cells.tests.__wrapped__


def shortened(layout, *, held):
    """The tests of a layout in a few minutes each, so that a whole campaign is made at once."""
    load = {"style": "soft", "ampere_hour": 0.08, "duration_second": 320}
    full = FULL(layout, held=held)
    steps = {
        "capacity": protocols.capacity(tests_of_cells.UNIT, repeats=1, c_rate=1, period_second=90),
        "ocv": [*next(test.steps for test in full if test.kind == "ocv")],
        "hppc": protocols.hybrid_pulses_below_full(
            tests_of_cells.UNIT, 1.0, points=(0.9, 0.8), rest_second=300.0, period_second=30.0
        ),
    }
    return tuple(
        test._replace(
            steps=tuple(
                steps.get(test.kind)
                or protocols.dynamic_load(tests_of_cells.UNIT, seed=number, **load)
            )
        )
        for number, test in enumerate(full)
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A small campaign of shortened tests: one cell of each kind."""
    place = tmp_path_factory.mktemp("zoo")
    patch = pytest.MonkeyPatch()
    patch.setattr(tests_of_cells, "tests", shortened)
    wanted = {
        "z0001": planned.Wanted("none"),
        "z0002": planned.Wanted("single", ("charge_asymmetry_over_soc",), 6e-3),
        "z0003": planned.Wanted("two", ("late_voltage", "charge_asymmetry_over_soc"), 6e-3),
        "z0004": planned.Wanted("unknown", ("opening_contact",), 6e-3, "cold"),
        "z0005": planned.Wanted("sheet", fault="rating_10_percent"),
        "z0006": planned.Wanted("sheet", fault="temperature_5_kelvin"),
    }
    patch.setattr(forms, "plan", lambda **sizes: wanted)
    forms.make(place, seed=4)
    patch.undo()
    return place


def test_sheets_are_valid_and_files_are_read(folder):
    sheets = campaign.read(folder)
    assert campaign.searched(sheets) == [f"z000{k}" for k in range(1, 7)]
    steps = campaign.Steps(None, {}, 10.0)
    rows = sheets.tests["z0002"]
    assert [row["kind"] for row in rows] == ["capacity", "ocv", "hppc", *["drive"] * 5]
    assert [row["role"] for row in rows][-2:] == ["validation"] * 2
    records = campaign.tests_of(sheets, "z0002", steps)
    assert all(np.all(np.diff(columns["test_time_second"]) > 0) for _, columns in records)


def test_the_truth_says_what_was_wanted(folder):
    truth = {row["cell"]: row for row in read_truth(folder)}
    assert [truth[name]["kind"] for name in sorted(truth)] == [
        *("none", "single", "two", "unknown", "sheet", "sheet")
    ]
    mine = truth["z0002"]["effects"][0]
    assert mine["validation_gap_millivolt"] == pytest.approx(6.0, rel=0.15)
    assert mine["accept"][0] == "resistance_asymmetry"
    assert truth["z0002"]["visible"] is True
    assert [one["effect"] for one in truth["z0003"]["effects"]] == [
        *("time_skew", "resistance_asymmetry")
    ]
    assert truth["z0004"]["effects"][0]["accept"] == []
    discharge, *charge = mine["sizes"]
    excess = mine["parameters"]["charge_resistance_excess"]
    over_soc = 1 + 0.6 * np.cos(np.pi * np.array([0.1, 0.5, 0.9]))
    assert np.array(charge) / discharge == pytest.approx(1 + excess * over_soc, rel=0.02)
    assert truth["z0003"]["effects"][0]["sizes"] == [
        truth["z0003"]["effects"][0]["parameters"]["voltage_delay_second"]
    ]
    assert not truth["z0001"]["effects"]


def sizes_of(form, size=None, name="z0001", layout="wide"):
    """What a form comes to in a cell, as people use it."""
    wanted = planned.Wanted("single", (form,), 6e-3, layout)
    one = forms.drawn(name, wanted, seed=3)
    effect = one.effects[0]._replace(size=one.effects[0].size if size is None else size)
    return made.sizes_of(one._replace(effects=(effect,)), effect), effect


def test_sizes_of_the_truth_are_those_of_the_cell_and_not_of_its_formula():
    (energy,), _ = sizes_of("one_energy", 20e3)
    assert energy == pytest.approx(20.0, rel=1e-6), "one energy is that of the sum"
    (mixed,), _ = sizes_of("three_energies", 20e3)
    assert 0.4 * 20 < mixed < 1.5 * 20
    entropy, waves = sizes_of("entropy_waves", 1e-3)
    angle = 2 * np.pi * (np.array([0.1, 0.5, 0.9]) + waves.drawn["phase_soc"])
    assert entropy == pytest.approx(np.sin(angle) + 0.6 * np.cos(2 * angle), rel=1e-3)
    (lost,), _ = sizes_of("capacity_bend", 0.03)
    assert lost == pytest.approx(3 * (np.tanh(15 / 9) + np.tanh(17 / 9)))
    without, _ = sizes_of("two_node_heat", 10.0, "z0001")
    sensed, _ = sizes_of("two_node_heat", 10.0, "z0002")
    assert (without[0], sensed[0]) == pytest.approx((10.0, 6.0)), "a sensor shows the can"
    (leak, _), _ = sizes_of("leak_over_soc", 0.02)
    assert leak == pytest.approx(20 * (1 - np.exp(-2.5)) / 2.5, rel=0.01)
    assert sizes_of("finite_volumes")[0] == [None, None]
    assert sizes_of("symmetric_kinetics")[0] == []


def test_a_wrong_sheet_is_wrong_where_it_says(folder):
    sheets = campaign.read(folder)
    kind = cell.KINDS[sheets.cells["z0005"]["chemistry"]]
    rated = sheets.cells["z0005"]["rated_capacity_ampere_hour"]
    assert rated == pytest.approx(1.1 * kind.ampere_hour, rel=1e-3)
    told = [row["ambient_temperature_celsius"] for row in sheets.tests["z0006"]]
    assert told[-2:] == [30.0, 15.0]  # 25 and 15 °C are true


def test_the_same_seed_gives_the_same_bytes(folder, tmp_path):
    patch = pytest.MonkeyPatch()
    patch.setattr(tests_of_cells, "tests", shortened)
    patch.setattr(forms, "plan", lambda **sizes: {"z0001": planned.Wanted("none")})
    forms.make(tmp_path, seed=4)
    patch.undo()
    for file in sorted((tmp_path / "raw").rglob("*.parquet")):
        twin = folder / file.relative_to(tmp_path)
        assert twin.stat().st_size > 1000
        assert file.read_bytes()[:4] == b"PAR1"
    again = read_truth(tmp_path)[0]["base_volt"]["fit"]
    assert again == pytest.approx(read_truth(folder)[0]["base_volt"]["fit"], rel=1e-6)


def test_unknown_sizes_and_cells_are_refused(tmp_path):
    with pytest.raises(TypeError, match="no size cells_of"):
        forms.make(tmp_path, seed=1, cells_of=3)
    with pytest.raises(ValueError, match="no cell h1"):
        forms.make(tmp_path, seed=1, cells=["h1"])


def test_a_part_that_cannot_be_made_says_why(tmp_path):
    why = parts.make_part("planted", tmp_path, seed=1, real=str(tmp_path), names=["a123"])
    assert "no " in why


def read_truth(folder):
    return json.loads((folder / "truth" / "missing_effect.json").read_text())
