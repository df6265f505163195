"""The contract that every artefact is held against: workflow/schemas/artefacts.yaml."""

from functools import cache
from pathlib import Path

import numpy as np

CONTRACT = Path(__file__).resolve().parent.parent / "workflow" / "schemas" / "artefacts.yaml"


@cache
def stages() -> dict:
    """The contract of all artefacts: stage → column → unit, meaning, range."""
    import yaml

    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    return yaml.load(CONTRACT.read_text(encoding="utf-8"), Loader=loader)


def name_of(stage: str, stem: str) -> str:
    """Entry of a file: `stage/stem` where the stage's files differ from one another, else stage."""
    return f"{stage}/{stem}" if f"{stage}/{stem}" in stages() else stage


def check(stage: str, columns: dict):
    """Hold columns against the contract of their stage.

    Raises
    ------
    ValueError
        A column that is missing, not in the contract or out of its range: a fault of ours.
    """
    known = stages()[stage]["columns"]
    for name, spec in known.items():
        if spec.get("required", True) and "<" not in name and name not in columns:
            raise ValueError(f"{stage}: column {name} is missing; found {sorted(columns)}")
    families = {name.split("<")[0]: spec for name, spec in known.items() if "<" in name}
    for name, values in columns.items():
        family = next((spec for stem, spec in families.items() if name.startswith(stem)), None)
        spec = known.get(name, family)
        if spec is None:
            raise ValueError(f"{stage}: column {name} is not in the contract; known: {list(known)}")
        if spec.get("range"):
            _check_range(stage, name, np.asarray(values), *spec["range"])


def _check_range(stage, name, values, low, high):
    low, high = -np.inf if low is None else low, np.inf if high is None else high
    outside = np.flatnonzero((values < low) | (values > high))
    if len(outside):
        row = int(outside[0])
        raise ValueError(f"{stage}: {name} row {row} is {values[row]}, wanted {low} … {high}")
