"""The contract of every artefact, workflow/schemas/artefacts.yaml: columns, units, ranges."""

import hashlib
import json
from functools import cache, lru_cache
from pathlib import Path

import numpy as np

from cellwright.refusal import Refusal

SAME = "same_as "  # begins a line of columns that an earlier stage has
CONTRACT = Path(__file__).resolve().parents[2] / "workflow" / "schemas" / "artefacts.yaml"


def stages() -> dict:
    """The contract of all artefacts: stage → column → unit, meaning, range."""
    about = CONTRACT.stat()
    return _stages_of_file(about.st_mtime_ns, about.st_size, about.st_ino)


@lru_cache(maxsize=1)
def _stages_of_file(*version) -> dict:
    """Content of the file, read anew where its time, size or inode is another than before."""
    import yaml

    # Several times as fast, where PyYAML was built with libyaml.
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    return expanded(yaml.load(CONTRACT.read_text(encoding="utf-8"), Loader=loader))


def expanded(written: dict) -> dict:
    """The contract with each column in full, where it says once what several stages have.

    `c_rate: {same_as: capacity.c_rate}` is that column of an earlier stage; `same_as capacity:
    [direction, c_rate]` are those columns of it, in this order; `same_as capacity: all` are all.

    Raises
    ------
    ValueError
        Columns of what is no earlier stage, or that it does not have.
    """
    stages = {}
    for stage, spec in written.items():
        columns = {}
        for name, about in spec["columns"].items():
            columns |= _in_full(stages, name, about, stage)
        stages[stage] = spec | {"columns": columns}
    return stages


def _in_full(stages, name, about, stage):
    """Columns of one line of the contract; `stages` are those that stand before it."""
    if name.startswith(SAME):
        return _columns_of(stages, name.removeprefix(SAME), about, stage)
    if "same_as" in about:
        source, _, column = about["same_as"].rpartition(".")
        return {name: _columns_of(stages, source, [column], stage)[column]}
    return {name: about}


def _columns_of(stages, source, names, stage):
    """Columns of an earlier stage, or all of them."""
    columns = stages.get(source, {}).get("columns", {})
    wanted = columns if names == "all" else names
    if not columns or (unknown := [name for name in wanted if name not in columns]):
        found = f"column {unknown[0]} of {source}" if columns else f"columns of {source}"
        raise ValueError(f"{stage}: same as {found}, wanted those of an earlier stage")
    return {name: columns[name] for name in wanted}


def name_of(stage: str, stem: str) -> str:
    """Entry of the contract: `stage/stem` where the files of a stage differ, else the stage."""
    return f"{stage}/{stem}" if f"{stage}/{stem}" in stages() else stage


def stage_of(path) -> str:
    """Stage of an artefact: the folder below `results/stages`, or below `results` for what people
    look for (tables, models, figures, missing effects)."""
    parts = Path(path).parts
    below = parts[parts.index("results") + 1 :]
    return below[1] if below[0] == "stages" else below[0]


def entry_of(path) -> str | None:
    """Entry of the contract for a file below `results`; None for files without one."""
    parts, stem, suffix = Path(path).parts, Path(path).stem, Path(path).suffix
    if "results" not in parts or suffix not in (".parquet", ".csv"):
        return None
    stage = stage_of(path)
    if suffix == ".csv":
        return "summary" if stem == "summary" else f"{stage}/{stem}"
    return name_of(stage, stem)


@cache
def fingerprint(*paths: str) -> str:
    """Hash of the contract of some files: names, order, ranges of columns, and which may be absent.

    Units and meanings are words for people and leave it as it is, and so does every other entry.
    """
    # A file without an entry, such as a model, is held against nothing: its hash stays empty.
    entries = [stages().get(entry, {}).get("columns") for entry in map(entry_of, paths) if entry]
    held = [
        [(name, spec.get("range"), spec.get("required", True)) for name, spec in columns.items()]
        for columns in entries
        if columns
    ]
    return hashlib.sha256(json.dumps(held).encode()).hexdigest()[:16] if held else ""


def check(stage: str, columns: dict):
    """Check columns against the contract of their stage.

    Raises
    ------
    ValueError
        A column that is missing or not in the contract: a programming error.
    Refusal
        A value out of its range: what it was made of is beyond what the method is for.
    """
    for name, spec in _ranges(stage, columns):
        rows = _rows_beyond(columns[name], *spec["range"])
        if len(rows):
            found = _in_words(columns, rows[0], name, spec)
            raise Refusal(f"{stage}: {found}; none of it is published")


def admitted(stage: str, columns: dict) -> tuple[dict, list[str]]:
    """Columns without the rows that break the contract, where each row is a result of its own.

    Returns
    -------
    columns : those that `check` lets pass. left_out : a sentence on each column that is broken.

    Raises
    ------
    ValueError, Refusal
        As `check`, also where no row is left.
    """
    if not stages()[stage].get("rows_apart"):
        check(stage, columns)
        return columns, []
    dropped, left_out = set(), []
    for name, spec in _ranges(stage, columns):
        rows = _rows_beyond(columns[name], *spec["range"])
        if len(rows):
            dropped |= set(rows.tolist())
            count = f"{len(rows)} rows, the first: " if len(rows) > 1 else ""
            left_out.append(
                f"left out of {stage}: {count}{_in_words(columns, rows[0], name, spec)}"
            )
    if not dropped:
        return columns, []
    kept = [row for row in range(len(next(iter(columns.values())))) if row not in dropped]
    if not kept:
        raise Refusal(f"{left_out[0]}; no row is left")
    return {name: _taken(values, kept) for name, values in columns.items()}, left_out


def _taken(values, rows):
    return values[rows] if isinstance(values, np.ndarray) else [values[row] for row in rows]


def _ranges(stage, columns):
    """(column, its entry) of each column that has a range; a column too many or too few raises."""
    contracted = stages()[stage]["columns"]
    for name, spec in contracted.items():
        if spec.get("required", True) and "<" not in name and name not in columns:
            raise ValueError(f"{stage}: column {name} is missing; found {sorted(columns)}")
    # branch_<k>_current_ampere stands for as many columns as a group has branches.
    families = {name.split("<")[0]: spec for name, spec in contracted.items() if "<" in name}
    ranged = []
    for name in columns:
        family = next((spec for stem, spec in families.items() if name.startswith(stem)), None)
        spec = contracted.get(name, family)
        if spec is None:
            raise ValueError(
                f"{stage}: column {name} is not in the contract; known: {list(contracted)}"
            )
        ranged += [(name, spec)] if spec.get("range") else []
    return ranged


def _rows_beyond(values, low, high):
    """Numbers of the rows whose value is out of range."""
    low, high = -np.inf if low is None else low, np.inf if high is None else high
    values = np.asarray(values, float)
    return np.flatnonzero((values < low) | (values > high))


def _in_words(columns, row, name, spec):
    """What a row has and what its column wants, such as `row 3: soc is 1.5, wanted 0 to 1`."""
    low, high = spec["range"]
    unit = spec.get("unit", "1").replace("1", "")
    value = f"{columns[name][row]:.6g} {unit}".strip()
    words = {(True, False): "at most {1}", (False, True): "at least {0}"}
    wanted = words.get((low is None, high is None), "{0} to {1}").format(low, high)
    return f"row {row + 1}: {name} is {value}, wanted {wanted}"
