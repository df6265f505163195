"""Effects of known size planted in the records of real cells, beside the same records unplanted.

One copy of a cell for each effect and size, all its tests changed alike, and one copy as it is:
what a search names there it names without any planting, so that a new name can be told.
"""

import hashlib
import json
import re
from pathlib import Path
from typing import NamedTuple

import numpy as np

from runtime import sheets
from virtual_lab.campaigns import as_table, seed_of
from virtual_lab.zoo import plain_circuit
from virtual_lab.zoo.equations import EFFECTS, Effect
from virtual_lab.zoo.plain_circuit import Plain, rms
from virtual_lab.zoo.real_records import RealCell, cell_of, cells_with_proof, files_of, laid_out

SCHEMAS = Path(__file__).resolve().parents[3] / "workflow" / "schemas"
SIZES = ("0.5base", "1base", "6mV", "15mV")
# Tests of public campaigns whose sheets name none to judge: another temperature, another rate.
SET_ASIDE = {
    "k2lfp": ("hppc_40C", "capacity_1C_40C"),
    "samsung30q": ("hppc_1C_30C", "hppc_2C_40C"),
}
UNPLANTED = "unplanted"
TOLERANCE, NEAR_ENOUGH = 0.02, 0.1
SAME_SIZE = 1.15
MOST_CHANGE_VOLT = 0.5  # beyond it a record would have ended earlier, or the cell is no such cell
TRIES = 8
FIT_FACTOR, VALIDATION_FACTOR = 1.15, 1.3
# Of the square of what one effect leaves, that another leaves unexplained: the same data.
SAME_DATA = 0.05
ABOUT = """# Effects planted in records of real cells

Made from the campaign {source} (seed {seed}). `missing_effect.json`: per copy of a cell its `kind`
(`unplanted`: the records as they are, whose truth nobody knows; `single`), its `control` (the
unplanted copy), `base_volt` (what a plain circuit leaves of the unplanted records that judge: OCV
table, R0, two RC pairs, starts refitted) and the effect with its parameters (equations in
lab/virtual_lab/zoo/equations.py) and the names that count as right (`accept`: less than 5 % of
the square of what the effect leaves remains beside them). `visible_gap_millivolt`: root mean square
of what is left of the effect on the records that judge when the plain circuit has been refitted to
the planted records; `gap_after_base_fit_millivolt`: the same on the records that are fitted.
`relative_size`: the former over `base_volt`. `visible`: a plain circuit leaves more than 1.3 times
(records that judge) or 1.15 times (fitted) of what it leaves of the unplanted cell.

Not changed: surface temperatures, impedance, and when a test ended at a cut-off.

## Not planted

{lacking}
"""


class Copy(NamedTuple):
    """A copy of a cell: its name, its records, its row of missing_effect.json."""

    name: str
    cell: RealCell
    truth: dict


class Planting(NamedTuple):
    """An effect in a cell: records, its size and further parameters, and what is left of it [V].

    `fit_gap`, `judge_gap`: residuals of the plain circuit refitted to the planted records, minus
    those of the unplanted ones. `plain`: the refitted circuit.
    """

    cell: RealCell
    size: float
    drawn: dict
    plain: Plain
    fit_gap: np.ndarray
    judge_gap: np.ndarray


def make(
    campaign_folder,
    cells,
    out_folder,
    *,
    seed: int,
    effects=tuple(EFFECTS),
    sizes=SIZES,
    proof=None,
) -> list[dict]:
    """Make a campaign of planted and unplanted copies of real cells.

    Parameters
    ----------
    campaign_folder : a campaign in the input contract. cells : names; () for all that have a record
        that judges and one that is fitted.
    out_folder : where the campaign is written: config/, raw/ and truth/missing_effect.json.
    seed : of signs and further parameters. effects : ids of `EFFECTS`.
    sizes : "6mV", or "0.5base" of what a plain circuit leaves of the unplanted records that judge;
        of sizes that are nearly the same the first is planted.
    proof : tests of role fit that are set aside to judge, in all copies; None: those of
        `SET_ASIDE`.

    Returns
    -------
    rows : of truth/missing_effect.json.

    Raises
    ------
    ValueError : as `real_records.cell_of`; an effect or size that is not known.
    runtime.sheets.CampaignError : faults of the sheets.
    """
    if unknown := sorted(set(effects) - set(EFFECTS)):
        raise ValueError(f"no equation for {', '.join(unknown)}; there are {', '.join(EFFECTS)}")
    for size in sizes:
        volt_of(size, 1.0)
    folder, out = Path(campaign_folder), Path(out_folder)
    campaign = sheets.read(folder, SCHEMAS)
    if proof is None:
        proof = SET_ASIDE.get(folder.name, ())
    lacking, written = [], []
    for name in cells or cells_with_proof(campaign, proof) or _every(campaign):
        cell = cell_of(campaign, name, folder, proof=proof)
        for copy in _copies(cell, folder.name, seed, effects, sizes, lacking):
            written.append((copy.name, cell.row, copy.truth, _write_records(copy, out)))
    _write_sheets(written, out, folder)
    about = ABOUT.format(source=folder.name, seed=seed, lacking="\n".join(lacking) or "Nothing.")
    (out / "truth" / "README.md").write_text(about, encoding="utf-8")
    return [truth for _, _, truth, _ in written]


def _every(campaign):
    return [row["cell"] for row in campaign.cells]


def volt_of(size: str, base_volt: float) -> float:
    """Volts of a size such as "6mV" or "0.5base"."""
    number = re.fullmatch(r"(\d+(?:\.\d+)?)(mV|base)", size)
    if not number or float(number[1]) <= 0:
        raise ValueError(f"size {size!r}; allowed are millivolts (6mV) and shares (0.5base)")
    return float(number[1]) * (1e-3 if number[2] == "mV" else base_volt)


class Base(NamedTuple):
    """An unplanted cell, its plain circuit, and the lags of its current (see `fitted`)."""

    cell: RealCell
    plain: Plain
    lags: dict


def base_of(cell: RealCell) -> Base:
    """A cell with the plain circuit that fits it best."""
    chosen, lags = plain_circuit.fitted(cell), {}
    return Base(cell, plain_circuit.fitted(cell, chosen.tau_second, lags), lags)


_SILENT = {"visible": False, "none_acceptable": True, "effects": []}


def _copies(cell, source, seed, effects, sizes, lacking):
    """Copies of a cell, one at a time; what cannot be planted is told in `lacking`."""
    base, name_of_cell = base_of(cell), cell.row["cell"]
    volt, control = rms(base.plain.judge_residual), f"{name_of_cell}_u"
    known = {"zoo": "planted", "campaign": source, "base_volt": _short(volt)}
    known["base_fit_volt"] = _short(rms(base.plain.fit_residual))
    yield Copy(control, cell, {"cell": control, "kind": UNPLANTED, **known, **_SILENT})
    first, unlike = {}, _unlike(sizes, volt)
    for name in EFFECTS:
        try:
            first[name] = _first(base, name, seed)
        except ValueError as reason:  # a current that is off may leave no charge to begin at
            lacking.append(f"- {name_of_cell}, {name}: {reason}")
    now = dict(first)
    for name, size in ((name, size) for name in effects if name in first for size in unlike):
        wanted = volt_of(size, volt)
        try:
            now[name] = _sized(base, EFFECTS[name], now[name], wanted)
        except ValueError as reason:
            lacking.append(f"- {name_of_cell}, {name}, {size} ({1e3 * wanted:.1f} mV): {reason}")
            continue
        left = rms(now[name].judge_gap)
        most = _largest_change(cell, now[name].cell)
        if abs(left / wanted - 1) > NEAR_ENOUGH or most > MOST_CHANGE_VOLT:
            told = f"{EFFECTS[name].parameter} {now[name].size:.3g} leaves {1e3 * left:.2f} mV"
            told += f", at most {1e3 * most:.0f} mV in a row"
            lacking.append(f"- {name_of_cell}, {name}, {size} ({1e3 * wanted:.1f} mV): {told}")
            continue
        tag = size.replace("mV", "").replace("base", "b").replace(".", "")
        facts = {"cell": f"{name_of_cell}_{EFFECTS[name].short}_{tag}", "kind": "single"}
        facts |= {"control": control, **known, "size": size}
        facts |= _truth(name, now[name], base.plain, wanted, accepted(name, first))
        yield Copy(facts["cell"], now[name].cell, facts)


def _largest_change(cell, changed):
    """Largest change of a voltage reading [V], but for a thousandth of the rows of each record."""
    pairs = zip(changed.records, cell.records, strict=True)
    return max(float(np.percentile(np.abs(a.volt - b.volt), 99.9)) for a, b in pairs)


def _unlike(sizes, base_volt):
    """Sizes without those that are nearly the same as an earlier one."""
    kept = {}
    for size in sizes:
        volt = volt_of(size, base_volt)
        if all(max(volt / v, v / volt) > SAME_SIZE for v in kept.values()):
            kept[size] = volt
    return list(kept)


def _first(base, name, seed):
    """The effect at the size that the search for a size begins with, its sign included."""
    random = np.random.default_rng(seed_of(f"{base.cell.row['cell']}/{name}", seed))
    effect = EFFECTS[name]
    drawn = effect.draw(random)
    sign = float(random.choice([-1.0, 1.0])) if effect.either_sign else 1.0
    size = sign * effect.first * effect.scale(base.cell, base.plain)
    return planted(base, effect, size, drawn)


def planted(base: Base, effect: Effect, size: float, drawn: dict) -> Planting:
    """An effect of a size in all records of a cell, and what a refitted plain circuit leaves."""
    cell, plain = base.cell, base.plain
    changed = laid_out(cell.row, effect.act(cell, plain, size, drawn))
    refitted = plain_circuit.fitted(changed, plain.tau_second, dict(base.lags))
    return Planting(
        changed,
        size,
        drawn,
        refitted,
        refitted.fit_residual - plain.fit_residual,
        refitted.judge_residual - plain.judge_residual,
    )


def _sized(base, effect, now, wanted):
    """The Planting that leaves the wanted volts, or the nearest that is still plausible.

    Parameters
    ----------
    now : Planting of another size, to begin with.
    """
    most = effect.most * effect.scale(base.cell, base.plain)
    before = None
    for _ in range(TRIES):
        volt = rms(now.judge_gap)
        ratio = wanted / max(volt, 1e-7)
        if abs(ratio - 1) < TOLERANCE or (abs(now.size) >= most and ratio > 1):
            break
        slope = 1.0
        if before and before[0] != abs(now.size):
            slope = np.log(volt / before[1]) / np.log(abs(now.size) / before[0])
        before = (abs(now.size), volt)
        step = np.clip(ratio ** (1 / np.clip(slope, 0.3, 3.0)), 0.02, 50.0)
        size = np.sign(now.size) * min(abs(now.size) * step, most)
        now = planted(base, effect, size, now.drawn)
    return now


def accepted(name: str, plantings: dict[str, Planting]) -> list[str]:
    """Effects that explain the same data in this cell, by what they leave; the name itself first.

    Parameters
    ----------
    name : of the planted effect. plantings : every effect in the same cell, of any size.
    """
    mine = _left(plantings[name])
    names = [name]
    for other, planting in plantings.items():
        left = _left(planting)
        power, along = left @ left, left @ mine
        if other == name or power < 1e-12 or (along < 0 and not EFFECTS[other].either_sign):
            continue
        if 1 - along**2 / (power * (mine @ mine)) < SAME_DATA:
            names.append(other)
    return names


def _left(planting):
    return np.concatenate([planting.fit_gap, planting.judge_gap])


def _truth(name, planting, plain, wanted, accept):
    """What the truth says of a planted copy."""
    fit, judge = rms(planting.plain.fit_residual), rms(planting.plain.judge_residual)
    visible = judge > VALIDATION_FACTOR * rms(plain.judge_residual)
    visible = bool(visible or fit > FIT_FACTOR * rms(plain.fit_residual))
    left = rms(planting.judge_gap)
    effect = {
        "effect": name,
        "parameters": {EFFECTS[name].parameter: _short(planting.size), **planting.drawn},
        "target_gap_millivolt": round(1e3 * wanted, 3),
        "visible_gap_millivolt": round(1e3 * left, 3),
        "gap_after_base_fit_millivolt": round(1e3 * rms(planting.fit_gap), 3),
        "validation_gap_millivolt": round(1e3 * left, 3),
        "accept": accept,
    }
    return {
        "visible": visible,
        "none_acceptable": not visible,
        "relative_size": _short(left / rms(plain.judge_residual)),
        "effects": [effect],
    }


def _write_records(copy, out):
    """Write the raw files of a copy; its rows of tests.tsv."""
    rows = []
    for record in copy.cell.records:
        contents = files_of(record)
        stem = f"raw/{copy.name}/{record.row['test']}"
        names = [f"{stem}_{k}.bdf.parquet" for k in range(1, len(contents) + 1)]
        for name, content in zip(names, contents, strict=True):
            (out / name).parent.mkdir(parents=True, exist_ok=True)
            (out / name).write_bytes(content)
        sums = [hashlib.sha256(content).hexdigest() for content in contents]
        changed = {"cell": copy.name, "file": ";".join(names), "sha256": ";".join(sums)}
        changed |= {"instrument": None, "current_sign": "charge_positive"}
        rows.append(record.row | changed)
    return rows


def _write_sheets(written, out, folder):
    cells = [row | {"cell": name, "reference": None} for name, row, _, _ in written]
    tests = [row for *_, rows in written for row in rows]
    for part in ("config", "truth"):
        (out / part).mkdir(parents=True, exist_ok=True)
    for name, rows in {"cells": cells, "tests": tests}.items():
        text = as_table(rows, separator="\t")
        (out / "config" / f"{name}.tsv").write_text(text, encoding="utf-8")
    chosen = folder / "config" / "config.yaml"
    text = chosen.read_text(encoding="utf-8") if chosen.is_file() else "# All defaults.\n"
    (out / "config" / "config.yaml").write_text(text, encoding="utf-8")
    truth = json.dumps([truth for _, _, truth, _ in written], indent=1, allow_nan=False)
    (out / "truth" / "missing_effect.json").write_text(truth + "\n", encoding="utf-8")


def _short(value):
    """A number with six digits."""
    return float(f"{value:.6g}")
