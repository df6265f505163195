"""A further test of a cell of a behavioural campaign, as its maker would have measured it."""

import csv
import hashlib
import io
import json
import shutil
from pathlib import Path
from typing import NamedTuple

import numpy as np

from virtual_lab import instruments
from virtual_lab.campaigns import as_table, seed_of
from virtual_lab.protocols import Step
from virtual_lab.zoo import forms, march, metering
from virtual_lab.zoo.made import Made
from virtual_lab.zoo.planned import SIZES, plan

RUN_ROWS = 3  # rows of one current, on average, from which a course is one of steps
FULL = 1.0


class Further(NamedTuple):
    """A test to be made: id, kind, role, chamber temperature [°C], course of the current.

    second, c_rate : (n,) instants [s] and current from each to the next, + on charge [1/h].
    """

    test: str
    kind: str
    role: str
    celsius: float
    second: np.ndarray
    c_rate: np.ndarray


def with_further(folder, target, name, further, *, seed, **sizes):
    """Write a campaign of one cell of another, with one test more.

    Parameters
    ----------
    folder : campaign of `forms.make`. target : where. name : of the cell. further : Further.
    seed, sizes : those that the campaign was made with.

    Raises
    ------
    KeyError : the campaign has no such cell.
    """
    folder, target = Path(folder), Path(target)
    truth = json.loads((folder / "truth" / "missing_effect.json").read_text(encoding="utf-8"))
    row = {one["cell"]: one for one in truth}[name]
    made = made_again(row, seed=seed, **sizes)
    shutil.copytree(folder / "raw" / name, target / "raw" / name)
    _write(target / "config" / "config.yaml", (folder / "config" / "config.yaml").read_bytes())
    _write(target / "truth" / "missing_effect.json", json.dumps([row], indent=1).encode())
    content = instruments.WRITERS["parquet"](_columns(made, further, seed))
    file = f"raw/{name}/{further.test}.bdf.parquet"
    _write(target / file, content)
    told = {"cell": name, "test": further.test, "kind": further.kind, "file": file}
    told |= {"ambient_temperature_celsius": further.celsius, "current_sign": "charge_positive"}
    told |= {"soc": FULL, "role": further.role, "sha256": hashlib.sha256(content).hexdigest()}
    for sheet, more in (("cells", []), ("tests", [told])):
        rows = [one for one in _rows(folder / "config" / f"{sheet}.tsv") if one["cell"] == name]
        table = as_table([*rows, *more], separator="\t")
        _write(target / "config" / f"{sheet}.tsv", table.encode())


def made_again(row, *, seed, **sizes) -> Made:
    """A cell of a campaign, its effects as large as the truth says."""
    wanted = plan(seed=seed, **(SIZES | sizes))[row["cell"]]
    made = forms.drawn(row["cell"], wanted, seed)
    entries = row["effects"] if made.effects else ()
    sized = [
        effect._replace(size=entry["parameters"][effect.form.parameter])
        for effect, entry in zip(made.effects, entries, strict=True)
    ]
    return made._replace(effects=tuple(sized))


def _columns(made, further, seed):
    """What the cell's instrument logs of the test."""
    specimen = made.specimen
    track = march.track(
        steps_of(further.second, further.c_rate),
        march.fleet_of([specimen.cell], aged=1.0),
        np.array([specimen.start_soc[-1]]),
        np.array([further.celsius]),
        seed=seed_of(f"clock of {further.test} of {made.name}", seed),
    )
    columns = metering.shown(track, 0, specimen.meter, faulty=False)
    noise = seed_of(f"noise of {further.test} of {made.name}", seed)
    own = {"celsius": further.celsius, "surface": made.has_sensor, "seed": noise}
    return metering.noisy(columns, specimen.meter, **own)


def steps_of(second, c_rate) -> list[Step]:
    """Steps of a course of the current; of one that never rests at a value, a profile.

    Parameters
    ----------
    second, c_rate : (n,) as of `Further`.
    """
    first = np.flatnonzero(np.diff(c_rate, prepend=np.nan) != 0)
    last = np.append(first[1:], len(second) - 1)
    if len(second) < RUN_ROWS * len(first):
        period = float(np.median(np.diff(second)))
        return [Step("profile", np.stack([second, c_rate], axis=1), float(second[-1]), period)]
    steps = []
    for begin, end in zip(first, last, strict=True):
        lasting = float(second[end] - second[begin])
        if lasting > 0:
            gap = float(np.diff(second[begin : end + 1]).max())
            limit = {-1.0: 0.0, 1.0: 1.0}.get(float(np.sign(c_rate[begin])))
            steps.append(Step("current", float(c_rate[begin]), lasting, gap, until_volt=limit))
    return steps


def _rows(path):
    text = path.read_text(encoding="utf-8")
    rows = csv.DictReader(io.StringIO(text), delimiter="\t")
    return [{name: value or None for name, value in row.items()} for row in rows]


def _write(path, content):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
