"""Functional mock-up units run by FMPy, an independent runner, against our own simulation.

Needs the laboratory's own environment.
"""

import shutil

import numpy as np
import pytest
import truth
from one_particle import CAPACITY, GRID, OCV, in_use
from wirings import WIRINGS, parallel, series

pytest.importorskip("fmpy", reason="the virtual laboratory's environment is not installed")

import fmpy
from fmpy.fmi1 import FMICallException
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu

import cellwright as cw
import cellwright_fmu
from cellwright.bias.scaled import scaled_reference
from cellwright.circuits.circuit import KINDS
from cellwright.packs.artefact import CellInPack, pack_document, read_pack
from cellwright.packs.cells import pack_cells
from cellwright.packs.simulate import simulate_pack
from cellwright.packs.thermal import Thermal
from cellwright.packs.wiring import cells_of
from cellwright_fmu.unit import unit_temperatures

if shutil.which("cc") is None and shutil.which("gcc") is None:
    pytest.skip("no C compiler on this machine: units hold sources only", allow_module_level=True)

CURRENT, AMBIENT, START, LARGEST_STEP, VOLTAGE, SOC = 1, 2, 3, 4, 5, 6
LEAST, MOST, CELSIUS, CELL_CURRENT, CELL_VOLTAGE, CELL_SOC, CELL_CELSIUS = 7, 8, 9, 10, 11, 12, 13
SAME_VOLT = 1e-5  # of cw.simulate: the unit's tables of SoC have another grid
SAME_PARTICLE_VOLT = 1e-9  # it has no tables of its own: the steps are the same
SOLVED_VOLT, SOLVED_AMPERE = 1e-8, 1e-7  # Newton's tolerance of 1e-9 V a cell lets through


class Runner:
    """An instance of a unit in FMPy, and what it logs."""

    def __init__(self, folder, unit, name="one"):
        self.path = folder / f"{name}.fmu"
        self.path.write_bytes(unit.content)
        self.said = []
        self.about = fmpy.read_model_description(self.path)
        self.instance = FMU3Slave(
            guid=self.about.guid,
            unzipDirectory=fmpy.extract(self.path, folder / name),
            modelIdentifier=self.about.coSimulation.modelIdentifier,
            instanceName=name,
        )

    def begin(self, start=None, current=0.0):
        self.instance.instantiate(logMessage=self.log)
        if start is not None:
            self.instance.setFloat64([START], np.atleast_1d(start))
        self.instance.enterInitializationMode(startTime=0.0)
        self.instance.setFloat64([CURRENT], [current])
        self.instance.exitInitializationMode()
        return self

    def log(self, environment, status, category, message):
        self.said.append((status, category.decode(), message.decode()))

    def step(self, time, second, current, celsius=None):
        self.instance.setFloat64([CURRENT], [current])
        if celsius is not None:
            self.instance.setFloat64([AMBIENT], [celsius])
        self.instance.doStep(time, second)

    def read(self, *references, count=None):
        return np.array(self.instance.getFloat64(list(references), count))


def edges(seconds, currents):
    """A held current as a record of edges: time and current, two samples at every change."""
    time = np.concatenate([[0.0], np.cumsum(seconds)])
    return np.repeat(time, 2)[1:-1], np.repeat(currents, 2)


def load(rng, count=300, ampere=4.0):
    """Steps of uneven lengths and a current held in each."""
    held = np.repeat(rng.uniform(-ampere, 0.7 * ampere, count // 10), 10)
    return rng.choice([0.25, 0.5, 1.0], count), held


def run_through(runner, seconds, currents, *references, count=None, celsius=None):
    """Values at the end of every step (n, values)."""
    time, rows = 0.0, []
    for second, current in zip(seconds, currents, strict=True):
        runner.step(time, second, current, celsius)
        time += second
        rows.append(runner.read(*references, count=count))
    return np.array(rows)


def warm_and_cold():
    """A cell with parameters at two temperatures."""
    warm, cold = truth.stated(), truth.stated(celsius=0.0, scale=2.5)
    conditions = [document["members"][0]["conditions"][0] for document in (cold, warm)]
    return warm | {"members": [warm["members"][0] | {"conditions": conditions}]}


@pytest.fixture(scope="module")
def unit():
    return cellwright_fmu.cell_fmu(truth.with_branch("kinetic"), initial_soc=0.6)


def as_particle(**settings):
    """A cell whose particle is in use, its capacity that of the particle."""
    model = in_use(truth.stated()) | {"capacity_ampere_hour": CAPACITY}
    return model, cellwright_fmu.cell_fmu(model, **settings)


def begun(runner, celsius):
    """A runner that starts at a temperature of the surroundings."""
    runner.instance.instantiate(logMessage=runner.log)
    runner.instance.setFloat64([AMBIENT], [celsius])
    runner.instance.enterInitializationMode(startTime=0.0)
    runner.instance.exitInitializationMode()
    return runner


def pack_of(wiring, *, kind="kinetic", start=0.6, **known):
    reference = truth.with_branch(kind)
    spread = np.linspace(-0.05, 0.05, len(cells_of(wiring)))
    cells = {
        name: CellInPack(
            scaled_reference(
                reference, cell=name, capacity=2.0 - k / 10, resistance_ratio=1 + k / 5
            ),
            start + float(spread[k]),
            **known,
        )
        for k, name in enumerate(cells_of(wiring))
    }
    return read_pack(pack_document(wiring, cells))


def test_fmpy_finds_no_fault(unit, tmp_path):
    for name, one in (("cell", unit), ("pack", cellwright_fmu.pack_fmu(pack_of(parallel(*"ABC"))))):
        path = tmp_path / f"{name}.fmu"
        path.write_bytes(one.content)
        assert validate_fmu(str(path)) == []
        assert fmpy.read_model_description(path).coSimulation is not None


def test_fmpy_runs_a_cell_as_anyone_would(unit, tmp_path):
    path = tmp_path / "cell.fmu"
    path.write_bytes(unit.content)
    kind = [("time", float), ("current_ampere", float), ("ambient_temperature_celsius", float)]
    signal = np.array([(0.0, -2.0, 25.0), (600.0, -2.0, 25.0)], kind)
    result = fmpy.simulate_fmu(
        path, start_time=0, stop_time=600, output_interval=1.0, input=signal,
        start_values={"initial_soc": 0.8}, output=["voltage_volt", "soc"],
    )  # fmt: skip
    assert result["soc"][-1] == pytest.approx(0.8 - 2.0 * 600 / 3600 / truth.CAPACITY_AMPERE_HOUR)
    time = np.arange(601.0)
    record = {"test_time_second": time, "current_ampere": np.full(601, -2.0)}
    ours = cw.simulate(truth.with_branch("kinetic"), record, initial_soc=0.8)
    np.testing.assert_allclose(
        result["voltage_volt"][1:], ours.columns["voltage_volt"][1:], rtol=0, atol=SAME_VOLT
    )


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind not in ("switch", "preisach")])
def test_every_kind_of_branch_is_what_our_simulation_gives(kind, tmp_path):
    model = truth.with_branch(kind)
    seconds, currents = load(np.random.default_rng(5))
    runner = Runner(tmp_path, cellwright_fmu.cell_fmu(model, initial_soc=0.6)).begin()
    volt, soc = run_through(runner, seconds, currents, VOLTAGE, SOC).T
    time, held = edges(seconds, currents)
    record = {"test_time_second": time, "current_ampere": held}
    ours = cw.simulate(model, record, initial_soc=0.6).columns
    np.testing.assert_allclose(volt, ours["voltage_volt"][1::2], rtol=0, atol=SAME_VOLT)
    np.testing.assert_allclose(soc, ours["soc"][1::2], rtol=0, atol=1e-12)


@pytest.mark.parametrize("celsius", [0.0, 11.3, 25.0])
def test_parameters_follow_the_temperature_of_the_surroundings(celsius, tmp_path):
    model = warm_and_cold()
    seconds, currents = load(np.random.default_rng(6))
    runner = Runner(tmp_path, cellwright_fmu.cell_fmu(model, initial_soc=0.6)).begin()
    volt = run_through(runner, seconds, currents, VOLTAGE, celsius=celsius)[:, 0]
    time, held = edges(seconds, currents)
    record = {"test_time_second": time, "current_ampere": held}
    ours = cw.simulate(model, record, initial_soc=0.6, temperature_celsius=celsius).columns
    np.testing.assert_allclose(volt, ours["voltage_volt"][1::2], rtol=0, atol=SAME_VOLT)
    assert runner.read(CELSIUS)[0] == celsius


@pytest.mark.parametrize("celsius", [-20.0, 11.3, 40.0])
def test_a_particle_is_what_our_simulation_gives(celsius, tmp_path):
    model, unit = as_particle(initial_soc=0.8)
    seconds, currents = load(np.random.default_rng(10))
    runner = begun(Runner(tmp_path, unit), celsius)
    assert validate_fmu(str(runner.path)) == []
    volt, soc = run_through(runner, seconds, currents, VOLTAGE, SOC, celsius=celsius).T
    time, held = edges(seconds, currents)
    record = {"test_time_second": time, "current_ampere": held}
    ours = cw.simulate(model, record, initial_soc=0.8, temperature_celsius=celsius)
    assert ours.member == "P"
    expected = ours.columns["voltage_volt"][1::2]
    np.testing.assert_allclose(volt, expected, rtol=0, atol=SAME_PARTICLE_VOLT)
    np.testing.assert_allclose(soc, ours.columns["soc"][1::2], rtol=0, atol=1e-12)


def test_a_particle_goes_on_from_a_kept_state_and_cuts_long_steps(tmp_path):
    _, unit = as_particle(initial_soc=0.8)
    runner, whole = (begun(Runner(tmp_path, unit, name), 5.0) for name in ("fine", "whole"))
    run_through(runner, np.ones(40), np.full(40, -3.0), VOLTAGE)
    kept = runner.instance.serializeFMUState(runner.instance.getFMUState())
    run_through(whole, [40.0], [-3.0], VOLTAGE)
    assert whole.read(VOLTAGE)[0] == pytest.approx(runner.read(VOLTAGE)[0], abs=1e-12)
    other = begun(Runner(tmp_path, unit, "other"), 5.0)
    other.instance.setFMUState(other.instance.deserializeFMUState(kept))
    for one in (runner, other):
        one.step(40.0, 1.0, 2.0)
    assert other.read(VOLTAGE)[0] == runner.read(VOLTAGE)[0]


def test_a_particle_warms_by_its_own_losses(tmp_path):
    """A slow load of an hour: it ends as warm as its loss against the OCV of its charge has it."""
    _, unit = as_particle(initial_soc=0.8, thermal=(10.0, 20.0))
    runner = begun(Runner(tmp_path, unit), 25.0)
    run_through(runner, np.full(60, 60.0), np.full(60, -1.0), VOLTAGE)
    volt, soc, celsius = runner.read(VOLTAGE, SOC, CELSIUS)
    loss = np.interp(soc, GRID, OCV) - volt
    assert loss > 0.02
    assert celsius - 25.0 == pytest.approx(20.0 * loss, rel=0.02)


@pytest.mark.parametrize("shape", sorted(WIRINGS))
def test_a_pack_in_any_wiring_is_what_simulate_pack_gives(shape, tmp_path):
    wiring = WIRINGS[shape]
    pack = pack_of(wiring)
    count = len(pack.models)
    seconds, currents = load(np.random.default_rng(7), 150)
    runner = Runner(tmp_path, cellwright_fmu.pack_fmu(pack)).begin()
    arrays = (VOLTAGE, CELL_CURRENT, CELL_VOLTAGE, CELL_SOC, LEAST, MOST, SOC)
    found = run_through(runner, seconds, currents, *arrays, count=4 + 3 * count)
    time, held = edges(seconds, currents)
    cells = pack_cells(pack.models, temperature_celsius=unit_temperatures(pack.models))
    ours = simulate_pack(
        time, held, cells, wiring, initial_soc=pack.initial_soc, ambient_celsius=25.0
    )
    shown = (ours.cell_current_ampere, ours.cell_voltage_volt, ours.voltage_volt, ours.soc)
    rows = [column[1::2] for column in shown]
    np.testing.assert_allclose(found[:, 0], rows[2], rtol=0, atol=SOLVED_VOLT)
    if shape.startswith(("star", "ladder")):
        total = found[:, 1 : 1 + count].sum(axis=1)
        np.testing.assert_allclose(total, currents, rtol=0, atol=1e-9)
    for k, row in ((0, 0), (1, 1), (2, 3)):
        part = found[:, 1 + k * count : 1 + (k + 1) * count]
        np.testing.assert_allclose(part, rows[row], rtol=0, atol=SOLVED_AMPERE)
    np.testing.assert_allclose(found[:, -3], rows[3].min(axis=1), rtol=0, atol=1e-12)
    np.testing.assert_allclose(found[:, -2], rows[3].max(axis=1), rtol=0, atol=1e-12)
    np.testing.assert_allclose(found[:, -1], rows[3].mean(axis=1), rtol=0, atol=1e-12)


def test_cells_with_thermal_constants_warm_by_their_own_heat(tmp_path):
    constants = Thermal(40.0, 5.0)
    pack = pack_of(series(*"AB"), kind="RC", thermal=constants)
    seconds, currents = np.full(600, 1.0), np.full(600, -4.0)
    runner = Runner(tmp_path, cellwright_fmu.pack_fmu(pack)).begin()
    found = run_through(runner, seconds, currents, CELL_CELSIUS, CELSIUS, count=3)
    cells = pack_cells(pack.models, temperature_celsius=unit_temperatures(pack.models))
    time, held = edges(seconds, currents)
    ours = simulate_pack(
        *(time, held, cells, pack.wiring),
        **{"initial_soc": pack.initial_soc, "ambient_celsius": 25.0},
        thermal=constants,
    )
    assert found[-1, 0] > 27.0
    np.testing.assert_allclose(found[:, :2], ours.temperature_celsius[1::2], rtol=0, atol=1e-9)
    assert found[-1, 2] == found[-1, :2].max()


def test_long_communication_steps_are_cut_into_short_ones(unit, tmp_path):
    fine = Runner(tmp_path, unit, "fine").begin()
    coarse = Runner(tmp_path, unit, "coarse").begin()
    run_through(fine, np.ones(120), np.full(120, -3.0), VOLTAGE)
    run_through(coarse, [50.0, 0.5, 69.5], np.full(3, -3.0), VOLTAGE)
    assert coarse.read(VOLTAGE)[0] == pytest.approx(fine.read(VOLTAGE)[0], abs=SAME_VOLT)
    assert coarse.read(SOC)[0] == pytest.approx(fine.read(SOC)[0], abs=1e-12)


def test_reset_begins_anew_and_two_instances_do_not_touch_each_other(unit, tmp_path):
    first, second = (Runner(tmp_path, unit, name).begin() for name in ("first", "second"))
    seconds, currents = load(np.random.default_rng(8), 50)
    once = run_through(first, seconds, currents, VOLTAGE)
    assert second.read(SOC)[0] == 0.6
    run_through(second, seconds, -currents, VOLTAGE)
    first.instance.reset()
    first.instance.enterInitializationMode(startTime=0.0)
    first.instance.exitInitializationMode()
    np.testing.assert_array_equal(run_through(first, seconds, currents, VOLTAGE), once)
    for runner in (first, second):
        runner.instance.terminate()
        runner.instance.freeInstance()


def test_a_kept_state_goes_on_as_before_also_in_another_instance(unit, tmp_path):
    seconds, currents = load(np.random.default_rng(9), 60)
    runner = Runner(tmp_path, unit).begin()
    run_through(runner, seconds[:30], currents[:30], VOLTAGE)
    state = runner.instance.getFMUState()
    kept = runner.instance.serializeFMUState(state)
    time = seconds[:30].sum()

    def go_on(one):
        rows = []
        for k in range(30, 60):
            one.step(time + seconds[30:k].sum(), seconds[k], currents[k])
            rows.append(one.read(VOLTAGE)[0])
        return rows

    once = go_on(runner)
    runner.instance.setFMUState(state)
    assert go_on(runner) == once
    other = Runner(tmp_path, unit, "other").begin()
    other.instance.setFMUState(other.instance.deserializeFMUState(kept))
    assert go_on(other) == once
    runner.instance.freeFMUState(state)


def test_to_read_changes_nothing_and_shows_the_jump_of_the_current(unit, tmp_path):
    runner, silent = (Runner(tmp_path, unit, name).begin() for name in ("read", "silent"))
    rest = runner.read(VOLTAGE)[0]
    runner.instance.setFloat64([CURRENT], [-2.0])
    ohmic = np.interp(0.6, truth.KNOTS, truth.R0)
    assert runner.read(VOLTAGE)[0] == pytest.approx(rest - 2.0 * ohmic, abs=1e-6)
    for one in (runner, silent):
        one.step(0.0, 1.0, -1.0)
    assert runner.read(VOLTAGE)[0] == silent.read(VOLTAGE)[0]


@pytest.mark.parametrize(
    ("reference", "value", "words"),
    [
        (CURRENT, np.nan, "current_ampere is nan, wanted a finite number"),
        (CURRENT, np.inf, "current_ampere is inf"),
        (AMBIENT, 500.0, "ambient_temperature_celsius is 500"),
        (AMBIENT, np.nan, "wanted -100 to 200"),
        (START, 0.5, "before the first step only"),
        (LARGEST_STEP, 0.0, "largest_step_second is 0"),
        (VOLTAGE, 3.0, "value reference 5 cannot be set"),
        (99, 1.0, "no variable has the value reference 99"),
    ],
)
def test_bad_values_are_errors_with_words_and_leave_the_unit_as_it_was(
    reference, value, words, unit, tmp_path
):
    runner = Runner(tmp_path, unit).begin(current=-1.0)
    before = runner.read(VOLTAGE, SOC)
    with pytest.raises(FMICallException):
        runner.instance.setFloat64([reference], [value])
    status, category, message = runner.said[-1]
    assert (status, category) == (3, "error")
    assert words in message
    np.testing.assert_array_equal(runner.read(VOLTAGE, SOC), before)
    runner.step(0.0, 1.0, -1.0)


def test_bad_steps_are_errors_with_words(unit, tmp_path):
    runner = Runner(tmp_path, unit).begin()
    for time, second, words in [
        (0.0, 0.0, "communication step is 0 s"),
        (0.0, -1.0, "communication step is -1 s"),
        (0.0, np.nan, "communication step is nan s"),
        (5.0, 1.0, "step from 5 s, but the time is 0 s"),
    ]:
        with pytest.raises(FMICallException):
            runner.instance.doStep(time, second)
        assert words in runner.said[-1][2]
    runner.step(0.0, 1.0, -1.0)
    fresh = Runner(tmp_path, unit, "fresh")
    fresh.instance.instantiate(logMessage=fresh.log)
    for start, words in (([1.5], "is 1.5"), ([np.nan], "is nan"), ([0.5, 0.5], "wanted 1")):
        with pytest.raises(FMICallException):
            fresh.instance.setFloat64([START], start)
        assert words in fresh.said[-1][2]


def test_calls_in_a_wrong_mode_are_errors(unit, tmp_path):
    runner = Runner(tmp_path, unit)
    runner.instance.instantiate(logMessage=runner.log)
    with pytest.raises(FMICallException):
        runner.instance.doStep(0.0, 1.0)
    assert "fmi3DoStep is not allowed in instantiated mode" in runner.said[-1][2]
    runner.instance.enterInitializationMode(startTime=0.0)
    with pytest.raises(FMICallException):
        runner.instance.enterInitializationMode(startTime=0.0)
    runner.instance.exitInitializationMode()
    with pytest.raises(FMICallException):
        runner.instance.enterEventMode()
    assert "event mode is not part of this FMU" in runner.said[-1][2]


def test_an_empty_cell_is_warned_of_once(unit, tmp_path):
    runner = Runner(tmp_path, unit).begin(start=0.01)
    run_through(runner, np.full(30, 10.0), np.full(30, -2.0), VOLTAGE)
    warnings = [message for status, _, message in runner.said if status == 1]
    assert len(warnings) == 1
    assert "outside 0 to 1 the model is not known" in warnings[0]
    assert np.isfinite(runner.read(VOLTAGE)).all()


@pytest.mark.parametrize("cut", [0, 10, 90, 200, 3000, -8])
def test_a_damaged_unit_is_refused(cut, unit, tmp_path):
    runner = Runner(tmp_path, unit)
    path = tmp_path / "one" / "resources" / "battery.bin"
    path.write_bytes(path.read_bytes()[:cut])
    with pytest.raises(Exception, match="Failed to instantiate"):
        runner.instance.instantiate(logMessage=runner.log)
    assert str(path) in runner.said[-1][2]


def test_another_token_or_no_tables_are_refused(unit, tmp_path):
    runner = Runner(tmp_path, unit)
    runner.instance.guid = "another"
    with pytest.raises(Exception, match="Failed to instantiate"):
        runner.instance.instantiate(logMessage=runner.log)
    assert "instantiation token is another, wanted" in runner.said[-1][2]
    (tmp_path / "one" / "resources" / "battery.bin").unlink()
    runner.instance.guid = unit.token
    with pytest.raises(Exception, match="Failed to instantiate"):
        runner.instance.instantiate(logMessage=runner.log)
    assert "cannot be opened" in runner.said[-1][2]


@pytest.mark.parametrize("particle", [False, True])
@pytest.mark.parametrize("seed", range(5))
def test_tables_of_nonsense_are_refused_and_never_crash(seed, particle, unit, tmp_path):
    """Sizes and places of the tables, each replaced by a random number, in turn."""
    rng, unit = np.random.default_rng(seed), as_particle()[1] if particle else unit
    runner = Runner(tmp_path, unit)
    path = tmp_path / "one" / "resources" / "battery.bin"
    whole = bytearray(path.read_bytes())
    arrays = int.from_bytes(whole[80:88], "little")
    begin = 88 + 40 * arrays
    for _ in range(10):
        broken = bytearray(whole)
        place = begin + 8 * int(rng.integers(0, 60))
        broken[place : place + 8] = np.float64(
            rng.choice([-1.0, 1e6, 1e300, 7.0, np.nan])
        ).tobytes()
        path.write_bytes(broken)
        try:
            runner.begin()
            run_through(runner, [1.0], [-1.0], VOLTAGE)
        except Exception as error:  # FMPy raises no class of its own here
            assert "Failed" in str(error) or "fmi3" in str(error)  # noqa: PT017
