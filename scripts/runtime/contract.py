"""The contract of every artefact, workflow/schemas/artefacts.yaml: columns, units, ranges."""

import hashlib
import json
from functools import cache, lru_cache
from pathlib import Path

import numpy as np

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


def entry_of(path) -> str | None:
    """Entry of the contract for a file below `results`; None for files without one."""
    parts, stem, suffix = Path(path).parts, Path(path).stem, Path(path).suffix
    if "results" not in parts or suffix not in (".parquet", ".csv"):
        return None
    stage = parts[parts.index("results") + 1]
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
        A column that is missing, not in the contract or out of its range: a programming error.
    """
    contracted = stages()[stage]["columns"]
    for name, spec in contracted.items():
        if spec.get("required", True) and "<" not in name and name not in columns:
            raise ValueError(f"{stage}: column {name} is missing; found {sorted(columns)}")
    # branch_<k>_current_ampere stands for as many columns as a group has branches.
    families = {name.split("<")[0]: spec for name, spec in contracted.items() if "<" in name}
    for name, values in columns.items():
        family = next((spec for stem, spec in families.items() if name.startswith(stem)), None)
        spec = contracted.get(name, family)
        if spec is None:
            raise ValueError(
                f"{stage}: column {name} is not in the contract; known: {list(contracted)}"
            )
        if spec.get("range"):
            _check_range(stage, name, np.asarray(values), *spec["range"])


def _check_range(stage, name, values, low, high):
    low, high = -np.inf if low is None else low, np.inf if high is None else high
    outside = np.flatnonzero((values < low) | (values > high))
    if len(outside):
        row = int(outside[0])
        raise ValueError(f"{stage}: {name} row {row} is {values[row]}, wanted {low} … {high}")
