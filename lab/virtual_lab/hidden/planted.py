"""Effects of known strength planted in records of real cells, beside the same records unplanted.

Added to the voltage of all tests of a cell is what an effect of the hidden campaign changes in the
fast generator's cell of 5 Ah under the current that was measured, in shares of the capacity. What
a search names in the unplanted copy it names without planting, and is not judged.
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
    ValueError : a cell without tests to fit and to judge, or a start that is not known.
    """
    campaign, out = Path(campaign), Path(out)
    texts = {"sep": "\t", "dtype": {"cell": str, "test": str}, "keep_default_na": False}
    names = ("cells", "tests")
    sheets = [pd.read_csv(campaign / "config" / f"{name}.tsv", **texts) for name in names]
    written = {name: [] for name in ("cells", "tests", "truth")}
    for cell in (row for row in sheets[0].to_dict("records") if not cells or row["cell"] in cells):
        mine = sheets[1][(sheets[1]["cell"] == cell["cell"]) & sheets[1]["kind"].isin(KINDS)]
        records = _records(campaign, cell, mine.to_dict("records"))
        for truth, changes in _copies(cell, records, effects, millivolts, seed):
            pairs = zip(records, changes, strict=True)
            written["truth"].append(truth)
            written["cells"].append(cell | {"cell": truth["cell"], "reference": ""})
            written["tests"] += [
                _written(out, truth["cell"], *one[:2], volt) for one, volt in pairs
            ]
    _write_sheets(out, campaign, written)
    return len(written["truth"])


def _records(campaign, cell, tests) -> list[tuple[dict, pd.DataFrame, File]]:
    """Row of tests.tsv, clean series and file of each test of a cell."""
    rated, records = float(cell["rated_capacity_ampere_hour"]), []
    for test in tests:
        path = campaign / "results" / "stages" / "clean" / cell["cell"] / f"{test['test']}.parquet"
        series = pd.read_parquet(path) if path.is_file() else pd.DataFrame()
        if len(series):
            records.append((test, series, _file(test, series, RATING.capacity_ampere_hour / rated)))
    splits = [k for k, one in enumerate(records) if one[0]["role"] == "split"]
    if splits and not any(file.is_validation for *_, file in records):
        test, series, file = records[splits[-1]]  # one of those that are fitted and judged alike
        records[splits[-1]] = test, series, file._replace(is_validation=True)
    if {file.is_validation for *_, file in records} != {True, False}:
        raise ValueError(f"{cell['cell']} needs a test to fit and one to judge in results/clean")
    return records


def _file(test, series, shares) -> File:
    """A test as one of the generator's cell, which takes this many times the current."""
    second = series["test_time_second"].to_numpy(float)
    later = np.diff(second, prepend=second[0] - 1.0) > 0
    counted = shares * series["charge_ampere_hour"].to_numpy(float) / RATING.capacity_ampere_hour
    if not test["soc"] and np.ptp(counted) < FROM_FULL:
        raise ValueError(f"{test['cell']}/{test['test']}: the sheet states no `soc` at its start")
    return File(
        [],
        float(test["ambient_temperature_celsius"] or 25.0),
        test["kind"],
        test["role"] == "validation",
        (second[later] - second[0], shares * series["current_ampere"].to_numpy(float)[later]),
        float(test["soc"]) if test["soc"] else 1.0 + counted[0] - counted.max(),
    )


def _copies(cell, records, effects, millivolts, seed):
    """Row of the truth and changes of the voltage [V], one array a test, of each copy."""
    control, files = f"{cell['cell']}_u", [file for *_, file in records]
    thinned = [_thinned(file) for file in files]
    silent = {"kind": "unplanted", "visible": False, "effects": []}
    yield {"cell": control, **silent}, [0.0] * len(files)
    plain = _healthy(cell, seed)
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
            yield truth, [_change(file, hidden.setup, plain) for file in files]


def _thinned(file) -> File:
    """The file with fewer rows; a strength needs no more."""
    every = max(1, -(-file.measured[0].size // MOST_ROWS))
    return file._replace(measured=tuple(values[::every] for values in file.measured))


def _healthy(cell, seed) -> Setup:
    """A healthy cell of 5 Ah with the open-circuit voltage of its chemistry, else of NMC."""
    plain = healthy(np.random.default_rng(seed_of(f"planted {cell['cell']}", seed)))
    chemistry = cell["chemistry"] if cell["chemistry"] in electrodes.CHEMISTRIES else CHEMISTRY
    usual = electrodes.usual_rating(chemistry, RATING.capacity_ampere_hour)
    window = electrodes.window(chemistry, usual)
    return plain.with_cell(ocv_volt=electrodes.open_circuit_volt(chemistry, window, SOC))


def _change(file, setup, plain):
    return noise_free_record(file, setup).volt - noise_free_record(file, plain).volt


def _written(out, name, test, series, change) -> dict:
    """Write one test of a copy as a BDF file; its row of tests.tsv."""
    second = series["test_time_second"].to_numpy(float)
    if np.ndim(change):
        later = np.diff(second, prepend=second[0] - 1.0) > 0
        change = np.interp(second, second[later], change)
    shown = series.assign(voltage_volt=series["voltage_volt"] + change)
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
