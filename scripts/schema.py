"""A schema in words: what is wanted, and how a fault is told. One wording for sheets and config."""

import difflib
from pathlib import Path

import yaml

LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


def load(schemas, name: str) -> dict:
    """The schema `name` (config, cells, tests or groups) in the folder `schemas`."""
    text = (Path(schemas) / f"{name}.schema.yaml").read_text(encoding="utf-8")
    return yaml.load(text, Loader=LOADER)


def fault(place: str, found, wanted: str, known=()) -> str:
    """One line: where, what was found, what is wanted, and what was probably meant."""
    near = difflib.get_close_matches(str(found), map(str, known), n=1)
    meant = f"; did you mean {near[0]!r}?" if near and near[0] != found else ""
    shown = repr(found) if len(repr(found)) <= 80 else f"{repr(found)[:77]}…"
    return f"{place}: found {shown}, wanted {wanted}{meant}"


def wanted(spec: dict) -> str:
    """What the schema of one value allows, in words."""
    if "enum" in spec:
        return f"one of {', '.join(map(str, spec['enum']))}"
    if "wanted" in spec:
        return spec["wanted"]
    kind = spec.get("type", "value")
    if kind == "array":
        return _wanted_list(spec)
    names = {"number": "a number", "integer": "a whole number", "boolean": "true or false"}
    names |= {"string": "a text", "object": "keys with values below it"}
    return names.get(kind, kind) + _range(spec)


def _wanted_list(spec) -> str:
    joined = f"joined with {spec['separator']}" if "separator" in spec else "as a list [a, b]"
    unique = ", all different" if spec.get("uniqueItems") else ""
    return f"one or more values, each {wanted(spec['items'])}, {joined}{unique}"


def _range(spec) -> str:
    low, high = spec.get("minimum"), spec.get("maximum")
    if low is not None and high is not None:
        return f" from {low:g} to {high:g}"
    words = {"minimum": "at least", "exclusiveMinimum": "above", "maximum": "at most"}
    return "".join(f" {word} {spec[key]:g}" for key, word in words.items() if key in spec)
