"""Cells known only from inside their group: the true ones back, from the charge alone."""

import gzip

import numpy as np
import pytest
from sheets_facts import branch_facts, measured_test

from cellwright.packs.cells import FILL, pack_cells, rc_cells
from cellwright.packs.identify import group_models, identify_branches, rest_offset
from cellwright.packs.simulate import simulate_pack
from cellwright.packs.uncertainty.bands import WITHIN_90_PERCENT
from cellwright.packs.uncertainty.copies import simulate_copies
from cellwright.packs.uncertainty.draws import uncertainty_of
from cellwright.packs.validate import validate_group
from cellwright.packs.wiring import star_of
from cellwright.records.record import branch_currents
from cellwright.refusal import Refusal

GRID = np.linspace(0, 1, 201)
TRUE = rc_cells(
    ocv_volt=np.array([3.2 + 0.9 * GRID + 0.2 * np.tanh(8 * GRID)] * 2),
    r0_ohm=np.array([0.30 - 0.1 * GRID, 0.15 + 0.0 * GRID]),
    r_ohm=np.array([[0.10 + 0 * GRID], [0.05 + 0 * GRID]]),
    tau_second=np.full((2, 1, 201), 300.0),
    capacity_ampere_hour=np.array([1.7, 1.9]),
)
OFFSET = np.array([0.02, -0.01])
# Rest, charge at 0.5 A and at a held voltage, rest, discharge, rest: rows of each.
SPANS = {"rest": 60, "charge": 2700, "rest after": 300, "discharge": 1200, "last rest": 60}


def record(celsius=None, *, cells=TRUE, load=-0.8):
    """The pair's record and steps; the sensors of the branches have offsets."""
    ends = np.cumsum(list(SPANS.values()))
    row = np.arange(ends[-1])
    charge = 0.5 * np.minimum(1.0, np.exp((2400.0 - row) / 150.0))
    total = np.select(
        [row < ends[0], row < ends[1], row < ends[2], row < ends[3]], [0, charge, 0, load], 0.0
    )
    time = 10.0 * row
    run = simulate_pack(time, total, cells, star_of(cells.names), initial_soc=0.0)
    measured = run.cell_current_ampere + OFFSET
    series = {"test_time_second": time, "current_ampere": total, "voltage_volt": run.voltage_volt}
    series |= {f"branch_{k + 1}_current_ampere": measured[:, k] for k in range(2)}
    first, last = np.append(0, ends[:-1]), ends - 1
    steps = {
        "kind": np.array(["rest", "CCCV", "rest", "CC", "rest"]),
        "first_row": first,
        "last_row": last,
        "current_mean_ampere": np.array(
            [total[a : b + 1].mean() for a, b in zip(first, last, strict=True)]
        ),
        "charge_ampere_hour": np.array(
            [total[a : b + 1].sum() / 360 for a, b in zip(first, last, strict=True)]
        ),
    }
    return measured_test(series, "pair", "group", celsius=celsius), steps


@pytest.fixture(scope="module")
def models_of_group():
    return group_models(*record(), ["A", "B"])


def test_capacities_are_the_charges_received_without_the_offsets_of_the_sensors(models_of_group):
    """Over the 8 h of the charge an offset of 20 mA would be a tenth of the capacity."""
    test, steps = record()
    series = test.series
    before, after = steps["last_row"][0], steps["last_row"][2]
    current = branch_currents(series)[before : after + 1] - OFFSET
    received = (current[1:] + current[:-1]).sum(axis=0) * 10.0 / 7200.0
    assert list(models_of_group) == ["A", "B"]
    sizes = [model["capacity_ampere_hour"] for model in models_of_group.values()]
    np.testing.assert_allclose(sizes, received, rtol=2e-3)


def test_the_models_predict_the_discharge_that_they_have_not_seen(models_of_group):
    test, steps = record()
    series = test.series
    rows = slice(steps["first_row"][3], None)
    time, total = series["test_time_second"][rows], series["current_ampere"][rows]
    cells = pack_cells(list(models_of_group.values()), temperature_celsius=25.0)
    run = simulate_pack(time, total, cells, star_of(cells.names), initial_soc=1.0)
    error = run.cell_current_ampere - (branch_currents(series)[rows] - OFFSET)
    assert np.sqrt(np.mean(error**2)) < 0.03
    assert np.sqrt(np.mean((run.voltage_volt - series["voltage_volt"][rows]) ** 2)) < 0.03


def test_only_the_charge_between_its_rests_is_seen(models_of_group):
    test, steps = record()
    series = test.series
    for name in series:
        if name != "test_time_second":
            series[name] = series[name].copy()
            series[name][steps["first_row"][3] :] *= 0.7
    steps["charge_ampere_hour"] = steps["charge_ampere_hour"].copy()
    assert group_models(test, steps, ["A", "B"]) == models_of_group
    fitted = models_of_group["A"]["fitted"]
    assert fitted["test"] == "pair"
    assert fitted["from_second"] == 10.0 * (SPANS["rest"] // 2)
    assert fitted["sensor_offset_ampere"] == pytest.approx(OFFSET[0], abs=1e-3)
    assert fitted["to_second"] == 10.0 * (SPANS["rest"] + SPANS["charge"] + SPANS["rest after"] - 1)


def test_what_the_models_say_of_themselves(models_of_group):
    model = models_of_group["B"]
    (entry,) = model["members"][0]["conditions"]
    assert (model["cell"], model["kind"], model["chosen"]) == ("B", "group", "1RC")
    assert entry["ambient_temperature_celsius"] == 25.0
    assert len(entry["r0_ohm"]) == len(entry["soc"]) == 21
    assert "identified inside its group from the charge" in model["notes"][0]
    cold = group_models(*record(0.0), ["A", "B"])
    assert cold["A"]["ocv"][0]["ambient_temperature_celsius"] == 0.0


def test_refusals():
    test, steps = record()
    series = test.series
    alone = {name: values for name, values in series.items() if name != "branch_2_current_ampere"}
    with pytest.raises(Refusal, match="no currents of two or more branches"):
        group_models(test._replace(series=alone), steps, ["A", "B"])
    down = steps | {"current_mean_ampere": -np.abs(steps["current_mean_ampere"])}
    with pytest.raises(Refusal, match="no charge between two rests"):
        group_models(test, down, ["A", "B"])
    with pytest.raises(Refusal, match="2 branch currents for 3 cells"):
        group_models(test, steps, ["A", "B", "C"])
    time, currents = np.arange(300.0), np.ones((300, 2)) * 0.1
    with pytest.raises(Refusal, match="at least two cells"):
        identify_branches(time, currents[:, :1], time)
    with pytest.raises(Refusal, match="branch 2 is not charged"):
        identify_branches(time, currents * [1, -1], time)
    with pytest.raises(Refusal, match="not finite"):
        identify_branches(time, currents, time * np.nan)
    with pytest.raises(Refusal, match="no rest"):
        rest_offset(currents, currents.sum(axis=1), rest_ampere=0.01)


NOISE_AMPERE = 0.01
CHARGE = slice(SPANS["rest"] - 30, SPANS["rest"] + SPANS["charge"] + SPANS["rest after"])


def noisy(seed):
    """Time, branch currents and voltage of the charge; a branch is the total less the other."""
    series = record()[0].series
    columns = [series[f"branch_{k}_current_ampere"] for k in (1, 2)]
    current = np.column_stack(columns) - OFFSET
    noise = NOISE_AMPERE * np.random.default_rng(seed).standard_normal(len(current))
    current = current + np.column_stack([noise, -noise])
    return [values[CHARGE] for values in (series["test_time_second"], current)], (
        series["voltage_volt"][CHARGE]
    )


def whole(fit):
    """Resistance in the long run of each cell (cells, p) [ohm]."""
    return fit.cells.tables["r0_ohm"][0, :, 0] + fit.cells.tables["r_ohm"][0, :, 0]


@pytest.mark.parametrize("seed", range(3))
def test_noise_of_the_sensors_does_not_make_resistances_smaller(seed):
    (time, current), volt = noisy(seed)
    true = (TRUE.tables["r0_ohm"][0, :, 0] + TRUE.tables["r_ohm"][0, :, 0]).mean()
    plain, told = (
        whole(identify_branches(time, current, volt, tau_second=(300.0,), noise_ampere=noise))
        for noise in (0.0, NOISE_AMPERE)
    )
    assert plain.mean() < 0.93 * true
    assert told.mean() == pytest.approx(true, rel=0.03)


def test_the_models_of_a_group_say_how_sure_they_are():
    for model in group_models(*record(), ["A", "B"]).values():
        entry = model["members"][0]["conditions"][0]
        for stds in (entry["r0_std_ohm"], entry["ocv_shift_std_volt"]):
            assert len(stds) == len(entry["soc"])
            assert np.nanmin(np.array(stds, float)) > 0


def test_measured_pair(shared):
    """Weng's pair: fitted on the charge, scored on the discharge. Published: 18 mA, 32 mV."""
    with gzip.open(shared / "campaigns/weng/raw/parallel_C10.csv.gz") as file:
        time, total, volt, *branch = np.loadtxt(file, delimiter=",", skiprows=1).T
    branch = np.column_stack(branch)
    rest, fit = (time > 2000) & (time < 2990), (time > 2950) & (time < 33370)
    branch -= rest_offset(branch[rest], total[rest], rest_ampere=0.01)
    identified = identify_branches(time[fit], branch[fit], volt[fit])
    cells = identified.cells
    np.testing.assert_allclose(cells.capacity_ampere_hour, [1.83, 1.93], rtol=0.06)
    rows = slice(fit.argmax(), None, 2)
    run = simulate_pack(time[rows], total[rows], cells, star_of(cells.names), initial_soc=0.0)
    score = ((time > 33370) & (time < 59770))[rows]
    current_error = (run.cell_current_ampere - branch[rows])[score]
    assert np.sqrt(np.mean(current_error**2)) < 0.018
    assert np.sqrt(np.mean((run.voltage_volt - volt[rows])[score] ** 2)) < 0.032
    wirings = [star_of(cells.names)] * len(identified.alike)
    start = np.zeros((len(wirings), 2))
    same = [with_both_pairs(one) for one in identified.alike]
    copies = simulate_copies(time[rows], total[rows], same, wirings, initial_soc=start)
    away = [one.cell_current_ampere - run.cell_current_ampere for one in copies]
    sensors = branch[rest].std(axis=0)
    half = WITHIN_90_PERCENT * np.hypot(np.sqrt(np.mean(np.square(away), axis=0)), sensors)
    assert 0.80 < np.mean(np.abs(current_error) <= half[score]) < 0.95


def with_both_pairs(cells):
    """The same cells with an RC pair and a kinetic one, one of them without resistance."""
    shape = (1, len(cells.names), 1, len(GRID))
    filled = {
        name: np.full(shape, FILL.get(name, 0.0)) for name, t in cells.tables.items() if not t.size
    }
    return cells._replace(tables=cells.tables | filled)


KINETIC_OHM, SCALE_VOLT = [[0.6], [0.25]], 0.0514


def of_charge_transfer():
    """The pair with charge transfer instead of its RC pairs: its resistance falls with the load."""
    ohm = np.broadcast_to(np.array(KINETIC_OHM)[None, :, :, None], (1, 2, 1, len(GRID)))
    tables = {name: table[:, :, :0] for name, table in TRUE.tables.items() if "tau" in name}
    tables |= {"r_ohm": TRUE.tables["r_ohm"][:, :, :0], "kinetic_r_ohm": ohm}
    tables |= {"kinetic_scale_volt": np.full(ohm.shape, SCALE_VOLT)}
    tables |= {"kinetic_tau_second": np.full(ohm.shape, 300.0)}
    return TRUE._replace(tables=TRUE.tables | tables)


def test_a_load_that_the_charge_did_not_show_lies_within_the_intervals():
    """Of cells whose resistance falls with the load a plain pair says too much at 2.5 times it."""
    true = of_charge_transfer()
    models = list(group_models(*record(cells=true), ["A", "B"]).values())
    faster = record(cells=true, load=-2.0)[0]
    faster = faster._replace(facts=faster.facts._replace(test="faster"))
    rows = branch_facts("AB", [None, None], [0.0, 0.0])
    sure = uncertainty_of(models, [None, None])
    wiring = star_of(("A", "B"))
    tables, _ = validate_group(models, rows, faster, wiring, uncertainty=sure)
    (row, _), seen = tables["rows"], tables["series"]
    assert row["model"] == "1RC"
    load = (seen["current_ampere"] < -1.0) & (seen["soc"] > 0.05)
    error = seen["branch_1_current_ampere"] - seen["simulated_branch_1_current_ampere"]
    half = WITHIN_90_PERCENT * seen["branch_1_current_std_ampere"]
    assert np.sqrt(np.mean(error[load] ** 2)) > 0.02
    assert np.mean(np.abs(error[load]) <= half[load]) > 0.8
    assert half[load].mean() < 0.25
