"""Effects of known strength planted in records of real cells, beside the same records unplanted.

An error of an instrument is made in the readings themselves. Of an effect of the cell, added to the
voltage is what it changes in the fast generator's cell of 5 Ah under the current that was measured,
in shares of the capacity; that cell has the open-circuit voltage and the resistance of the records,
and its resistances grow in the cold as usual ones do: an effect that no real cell could have asks
for no name. What a search names in the unplanted copy it names without planting, and is not judged.
"""

import hashlib
import io
import json
from pathlib import Path

import numpy as np
import pandas as pd

from virtual_lab import electrodes
from virtual_lab.campaigns import as_table, seed_of
from virtual_lab.hidden.setup import (
    CHEMISTRY,
    RATING,
    SOC,
    File,
    Setup,
    healthy,
    noise_free_record,
)
from virtual_lab.hidden.specimens import effect_row
from virtual_lab.hidden.strength import accepted, with_effect
from virtual_lab.hidden.vocabulary import EFFECTS, INVISIBLE

KINDS = ("ocv", "capacity", "hppc", "pulse_resistance", "drive")
PLANTED = tuple(name for name in EFFECTS if name not in INVISIBLE)
MOST_ROWS = 4000  # of a record, on which strengths are found
FROM_FULL = 0.5  # of the capacity: a record that moves so much reaches full once
ENERGY_JOULE_PER_MOLE = 30e3  # usual of a cell's resistances
STEP_C_RATE = 0.2  # of the current from row to row, at which a resistance shows
STANDARD_CELSIUS = 25.0
WHOLE_BRANCH = 0.5  # of the SoC that a branch covers at least
SLOW = "ocv"  # kind of the test that tells the open-circuit voltage
LABELS = {
    "test_time_second": "Test Time / s",
    "unix_time_second": "Unix Time / s",
    "current_ampere": "Current / A",
    "voltage_volt": "Voltage / V",
    "ambient_temperature_celsius": "Ambient Temperature / degC",
    "surface_temperature_celsius": "Surface Temperature T1 / degC",
    "cycle_count": "Cycle Count / 1",
}
ABOUT = """# Effects planted in records of real cells

`missing_effect.json`: per copy of a cell its `kind` (`unplanted`: the records as they are, whose
truth nobody knows; `single`), its `control` (the unplanted copy) and the effect. Parameters and
gaps are those of a cell of 5 Ah (lab/virtual_lab/hidden/vocabulary.py) under the measured current.
"""


def make(campaign, out, *, cells=(), effects=PLANTED, millivolts=(6.0,), seed: int = 0) -> int:
    """Make a campaign of planted and unplanted copies of real cells; how many copies.

    Parameters
    ----------
    campaign : folder of a campaign in the input contract whose `results/clean` have been made.
    out : folder that is written. cells : names; all where there are none.
    effects : names of `PLANTED`. millivolts : strengths, see `strength.gap` [mV].
    seed : of signs and further parameters.

    Raises
    ------
    ValueError : a cell without tests to fit and to judge, a start that is not known, or no step of
    the current.
    """
    campaign, out = Path(campaign), Path(out)
    texts = {"sep": "\t", "dtype": {"cell": str, "test": str}, "keep_default_na": False}
    names = ("cells", "tests")
    sheets = [pd.read_csv(campaign / "config" / f"{name}.tsv", **texts) for name in names]
    written = {name: [] for name in ("cells", "tests", "truth")}
    for cell in (row for row in sheets[0].to_dict("records") if not cells or row["cell"] in cells):
        mine = sheets[1][(sheets[1]["cell"] == cell["cell"]) & sheets[1]["kind"].isin(KINDS)]
        records = _records(campaign, cell, mine.to_dict("records"))
        for truth, shown in _copies(cell, records, effects, millivolts, seed):
            written["truth"].append(truth)
            written["cells"].append(cell | {"cell": truth["cell"], "reference": ""})
            written["tests"] += [
                _written(out, truth["cell"], test, series)
                for (test, *_), series in zip(records, shown, strict=True)
            ]
    _write_sheets(out, campaign, written)
    return len(written["truth"])


def _records(campaign, cell, tests) -> list[tuple[dict, pd.DataFrame, File]]:
    """Row of tests.tsv, clean series and file of each test of a cell."""
    found = []
    for test in tests:
        path = campaign / "results" / "stages" / "clean" / cell["cell"] / f"{test['test']}.parquet"
        series = pd.read_parquet(path) if path.is_file() else pd.DataFrame()
        if len(series):
            found.append((test, series))
    slow = _nearest_standard(found, SLOW)
    capacity = np.ptp(slow[1]["charge_ampere_hour"]) if slow else cell["rated_capacity_ampere_hour"]
    shares = RATING.capacity_ampere_hour / float(capacity)
    records = [(*one, _file(*one, shares, has_slow=slow is not None)) for one in found]
    splits = [k for k, one in enumerate(records) if one[0]["role"] == "split"]
    if splits and not any(file.is_validation for *_, file in records):
        test, series, file = records[splits[-1]]  # one of those that are fitted and judged alike
        records[splits[-1]] = test, series, file._replace(is_validation=True)
    if {file.is_validation for *_, file in records} != {True, False}:
        raise ValueError(f"{cell['cell']} needs a test to fit and one to judge in results/clean")
    return records


def _nearest_standard(records, *kinds):
    """Of the records of some kinds that whose chamber is nearest 25 degC, None where none is."""
    some = [one for one in records if one[0]["kind"] in kinds]
    return min(some, key=lambda one: abs(_celsius(one[0]) - STANDARD_CELSIUS), default=None)


def _celsius(test):
    return float(test["ambient_temperature_celsius"] or STANDARD_CELSIUS)


def _file(test, series, shares, *, has_slow) -> File:
    """A test as one of the generator's cell, which takes this many times the current.

    has_slow : whether a slow test tells the capacity; later tests may find another.
    """
    second = series["test_time_second"].to_numpy(float)
    later = np.diff(second, prepend=second[0] - 1.0) > 0
    counted = shares * series["charge_ampere_hour"].to_numpy(float) / RATING.capacity_ampere_hour
    if not test["soc"] and np.ptp(counted) < FROM_FULL:
        raise ValueError(f"{test['cell']}/{test['test']}: the sheet states no `soc` at its start")
    kind = test["kind"]
    if has_slow and kind != "drive":
        kind = "capacity" if kind == SLOW else "recharge"
    return File(
        [],
        _celsius(test),
        kind,
        test["role"] == "validation",
        (second[later] - second[0], shares * series["current_ampere"].to_numpy(float)[later]),
        float(test["soc"]) if test["soc"] else 1.0 + counted[0] - counted.max(),
    )


def _copies(cell, records, effects, millivolts, seed):
    """Row of the truth and series of all tests of each copy."""
    control, files = f"{cell['cell']}_u", [file for *_, file in records]
    thinned = [_thinned(file) for file in files]
    silent = {"kind": "unplanted", "visible": False, "effects": []}
    yield {"cell": control, **silent}, [series for _, series, _ in records]
    plain = _healthy(cell, records, seed)
    drives = any(file.kind == "drive" and not file.is_validation for file in files)
    for effect in (name for name in effects if drives or not EFFECTS[name].on_drives):
        for millivolt in millivolts:
            random = np.random.default_rng(seed_of(f"{cell['cell']}/{effect}", seed))
            hidden = with_effect(plain, effect, 1e-3 * millivolt, thinned, random)
            names = accepted(hidden, plain, int(random.integers(2**31)))
            truth = {"cell": f"{cell['cell']}_{effect}_{millivolt:g}", "kind": "single"}
            truth |= {"control": control, "visible": bool(hidden.visible)}
            truth |= {"none_acceptable": not hidden.visible}
            truth |= {"effects": [effect_row(hidden, names, 1e-3 * millivolt)]}
            yield truth, [_shown(series, file, hidden.setup, plain) for _, series, file in records]


def _thinned(file) -> File:
    """The file with fewer rows; a strength needs no more."""
    every = max(1, -(-file.measured[0].size // MOST_ROWS))
    return file._replace(measured=tuple(values[::every] for values in file.measured))


def _healthy(cell, records, seed) -> Setup:
    """A healthy cell of 5 Ah as the records show theirs: its OCV and resistance, near 25 degC."""
    plain = healthy(np.random.default_rng(seed_of(f"planted {cell['cell']}", seed)))
    slow = _nearest_standard(records, SLOW)
    chemistry = cell["chemistry"] if cell["chemistry"] in electrodes.CHEMISTRIES else CHEMISTRY
    usual = electrodes.usual_rating(chemistry, RATING.capacity_ampere_hour)
    window = electrodes.window(chemistry, usual)
    ocv = _measured_ocv(slow[1]) if slow else electrodes.open_circuit_volt(chemistry, window, SOC)
    scale = _measured_ohm(records) / plain.cell.r0_ohm
    pairs = tuple(scale * ohm for ohm in plain.cell.pair_r_ohm)
    return plain.with_cell(
        ocv_volt=ocv,
        capacity_ampere_hour=RATING.capacity_ampere_hour,
        r0_ohm=scale * plain.cell.r0_ohm,
        pair_r_ohm=pairs,
        r0_activation_joule_per_mole=ENERGY_JOULE_PER_MOLE,
        pair_activation_joule_per_mole=(ENERGY_JOULE_PER_MOLE,) * len(pairs),
    )


def _measured_ocv(series) -> np.ndarray:
    """Mean of both branches of a slow test [V] at each `SOC`, or the only one."""
    charge = series["charge_ampere_hour"].to_numpy(float)
    soc = 1.0 + (charge - charge.max()) / np.ptp(charge)
    ampere, volt = (series[name].to_numpy(float) for name in ("current_ampere", "voltage_volt"))
    branches = []
    for sign in (-1.0, 1.0):
        rows = sign * ampere > 0
        band = np.round(100 * soc[rows]).astype(int)
        count = np.bincount(band, minlength=101)
        if (count > 0).mean() > WHOLE_BRANCH:
            mean = np.bincount(band, volt[rows], 101)[count > 0] / count[count > 0]
            branches.append(np.interp(SOC, np.flatnonzero(count) / 100, mean))
    return np.mean(branches, axis=0)


def _measured_ohm(records) -> float:
    """Resistance of the cell of 5 Ah [Ohm] from steps of the current near 25 degC."""
    kinds = {test["kind"] for test, *_ in records} - {SLOW}
    _, series, file = _nearest_standard(records, *kinds)
    ampere, volt = file.measured[1], series["voltage_volt"].to_numpy(float)
    second = series["test_time_second"].to_numpy(float)
    volt = volt[np.diff(second, prepend=second[0] - 1.0) > 0]
    step = np.diff(ampere)
    sharp = np.abs(step) > STEP_C_RATE * RATING.capacity_ampere_hour
    if not sharp.any():
        raise ValueError(f"no step of the current by {STEP_C_RATE:g}C tells the cell's resistance")
    return float(np.median(np.diff(volt)[sharp] / step[sharp]))


def _shown(series, file, setup, plain) -> pd.DataFrame:
    """The series as it would be with the effect: of the cell, and of its instruments."""
    second = series["test_time_second"].to_numpy(float)
    ampere, volt = (series[name].to_numpy(float) for name in ("current_ampere", "voltage_volt"))
    if setup.cell is not plain.cell:
        hidden = setup._replace(chain=plain.chain)
        change = noise_free_record(file, hidden).volt - noise_free_record(file, plain).volt
        later = np.diff(second, prepend=second[0] - 1.0) > 0
        volt = volt + np.interp(second, second[later], change)
    chain = setup.chain
    if chain.voltage_delay_second != 0.0:
        volt = np.interp(second - chain.voltage_delay_second, second, volt)
    volt = volt * (1 + chain.voltage_gain) + chain.voltage_offset_volt
    shares = _times_the_current(series, file)
    ampere = ampere * (1 + chain.current_gain) + chain.current_offset_ampere / shares
    return series.assign(current_ampere=ampere, voltage_volt=volt)


def _times_the_current(series, file) -> float:
    """How many times the current the generator's cell takes [1]."""
    return float(np.abs(file.measured[1]).max() / np.abs(series["current_ampere"]).max())


def _written(out, name, test, shown) -> dict:
    """Write one test of a copy as a BDF file; its row of tests.tsv."""
    shown = shown[[column for column in LABELS if column in shown]].rename(columns=LABELS)
    content = io.BytesIO()
    shown.to_parquet(content, index=False, compression="zstd")
    file = f"raw/{name}/{test['test']}.bdf.parquet"
    (out / file).parent.mkdir(parents=True, exist_ok=True)
    (out / file).write_bytes(content.getvalue())
    changed = {"cell": name, "file": file, "instrument": "", "current_sign": "charge_positive"}
    return test | changed | {"sha256": hashlib.sha256(content.getvalue()).hexdigest()}


def _write_sheets(out, campaign, written):
    for part in ("config", "truth"):
        (out / part).mkdir(parents=True, exist_ok=True)
    for name in ("cells", "tests"):
        text = as_table(written[name], separator="\t")
        (out / "config" / f"{name}.tsv").write_text(text, encoding="utf-8")
    chosen = campaign / "config" / "config.yaml"
    text = chosen.read_text(encoding="utf-8") if chosen.is_file() else "# All defaults.\n"
    (out / "config" / "config.yaml").write_text(text, encoding="utf-8")
    truth = json.dumps(written["truth"], indent=1, allow_nan=False)
    (out / "truth" / "missing_effect.json").write_text(truth + "\n", encoding="utf-8")
    (out / "truth" / "README.md").write_text(ABOUT, encoding="utf-8")
