"""Settings of a campaign: checked against the schema and completed by its defaults."""

import contextlib
import datetime
import difflib
import math
import os
from pathlib import Path

import yaml

from cellwright import gate
from cellwright.refusal import Refusal

LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
FILE = "config/config.yaml"
DEEPEST = 8  # values within values, twice as many as the settings are
LONGEST_VALUE = 1000  # characters, of a heading or a name


def load(schemas, name: str) -> dict:
    """The schema `name` (config, cells, tests or groups) in the folder `schemas`."""
    text = (Path(schemas) / f"{name}.schema.yaml").read_text(encoding="utf-8")
    return yaml.load(text, Loader=LOADER)


def fault(place: str, value, wanted: str, names=()) -> str:
    """A fault in one line: place, value found, what is allowed, and the nearest allowed name."""
    near = difflib.get_close_matches(str(value), map(str, names), n=1)
    meant = f"; did you mean {near[0]!r}?" if near and near[0] != value else ""
    shown = repr(value) if len(repr(value)) <= 80 else f"{repr(value)[:77]}…"
    return f"{place}: found {shown}, wanted {wanted}{meant}"


def wanted(spec: dict) -> str:
    """Allowed values of one schema entry, in words."""
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


def read(folder, schema: dict, overrides: dict, *, alone=False) -> tuple[dict, list[str]]:
    """Settings of a campaign with all defaults, and a list of their faults.

    `overrides` (Snakemake's --config and --configfile) goes before what the file says. Where it is
    `alone` (the `config:` of a module), the file is not looked at.
    """
    # Snakemake hands values of a section given by --config over as texts.
    overrides = _typed(overrides, schema)
    written, lines, faults = {}, {}, []
    if os.path.lexists(Path(folder) / FILE) and not alone:
        try:
            written, lines, faults = _written(gate.contents(FILE, within=folder))
        except Refusal as reason:
            faults = [f"{reason}; wanted a file of settings, or none"]
    faults += faults_of(written, schema, lambda path: f"{FILE}, line {lines.get(tuple(path), 1)}")
    source = "config of the module" if alone else "--config"
    faults += faults_of(overrides, schema, lambda path: source)
    return ({} if faults else _filled(_merged(written, overrides), schema)), faults


def _typed(value, spec):
    """Numbers instead of the texts that Snakemake's --config makes of all values of a section."""
    if isinstance(value, dict):
        specs = spec.get("properties", {})
        return {name: _typed(entry, specs.get(name, {})) for name, entry in value.items()}
    if isinstance(value, list):
        return [_typed(entry, spec.get("items", {})) for entry in value]
    if isinstance(value, str) and spec.get("type") in ("number", "integer", "boolean"):
        return _number_or_switch(value)
    return value


def _number_or_switch(text):
    for number in (int, float):
        with contextlib.suppress(ValueError):
            return number(text)
    return {"true": True, "false": False}.get(text.lower(), text)


def defaults(schema: dict) -> dict:
    """The settings of a campaign that chooses nothing."""
    return _filled({}, schema)


def of_analysis(config: dict, schema: dict, section: str) -> dict:
    """Settings of a section that reach an analysis; the others decide which jobs there are."""
    keys = schema["properties"][section]["properties"]
    return {name: config[section][name] for name, spec in keys.items() if not spec.get("plans")}


def flat(config: dict, path=()) -> dict:
    """Settings by their dotted keys."""
    dotted = {}
    for name, value in config.items():
        section = isinstance(value, dict)
        dotted |= flat(value, (*path, name)) if section else {".".join([*path, name]): value}
    return dotted


def keys(schema: dict, path=()):
    """(dotted key, its schema) of every key, sections before what is in them."""
    for name, spec in schema["properties"].items():
        yield ".".join([*path, name]), spec
        if "properties" in spec:
            yield from keys(spec, (*path, name))


def _written(data: bytes):
    """Content of the file, the line of each key, and faults that keep it from being read."""
    try:
        text = data.decode("utf-8-sig")
        faults = _tangled(text)
        if faults:
            return {}, {}, faults
        node = yaml.compose(text, Loader=LOADER)
        content = yaml.load(text, Loader=LOADER)
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        return {}, {}, [fault(f"{FILE}, line {line}", data[error.start], "UTF-8")]
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        place = f"{FILE}, line {mark.line + 1}" if mark else FILE
        return {}, {}, [fault(place, getattr(error, "problem", str(error)), "YAML")]
    except ValueError as error:  # such as a date that there is not
        return {}, {}, [fault(FILE, str(error), "YAML")]
    if content is None:
        return {}, {}, []
    if not isinstance(content, dict):
        return {}, {}, [fault(f"{FILE}, line 1", content, "keys with values, `key: value`")]
    lines, faults = {}, []
    _walk(node, (), lines, faults)
    return content, lines, faults


def _tangled(text):
    """Faults of values within values without end, or that stand for others many times over.

    Looked at before anything is built: nine lines can stand for a milliard of values.
    """
    depth = 0
    for event in yaml.parse(text, Loader=LOADER):
        place = f"{FILE}, line {event.start_mark.line + 1}"
        if isinstance(event, yaml.AliasEvent):
            return [fault(place, f"*{event.anchor}", "the value itself; no *name stands for one")]
        if len(getattr(event, "value", "")) > LONGEST_VALUE:
            found = f"a value of {len(event.value)} characters"
            return [f"{place}: found {found}, wanted {LONGEST_VALUE} at most"]
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        if depth > DEEPEST:
            return [f"{place}: found {depth} values within values, wanted {DEEPEST} at most"]
    return []


def _walk(node, path, lines, faults):
    """Note the line of each key and element; YAML itself lets a key stand twice."""
    if isinstance(node, yaml.MappingNode):
        parts = [(key.value, key.start_mark, value) for key, value in node.value]
    elif isinstance(node, yaml.SequenceNode):
        parts = [(index, value.start_mark, value) for index, value in enumerate(node.value)]
    else:
        return
    for name, mark, value in parts:
        if (*path, name) in lines:
            place = f"{FILE}, line {mark.line + 1}, {'.'.join(map(str, path))}"
            faults.append(fault(place, name, f"each key once (also line {lines[*path, name]})"))
        lines[*path, name] = mark.line + 1
        _walk(value, (*path, name), lines, faults)


def _validator(schema):
    """A validator of JSON Schema to which infinity and NaN are no numbers."""
    from jsonschema import Draft202012Validator, validators

    types = Draft202012Validator.TYPE_CHECKER.redefine("number", _is_number)
    whole = types.is_type
    types = types.redefine("integer", lambda _, value: _fits(value) and whole(value, "integer"))
    return validators.extend(Draft202012Validator, type_checker=types)(schema)


def _is_number(checker, value) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and _fits(value)


def _fits(value) -> bool:
    """Whether a number can be computed with: not infinite, and not of hundreds of digits."""
    try:
        return not isinstance(value, int | float) or math.isfinite(value)
    except OverflowError:
        return False


def faults_of(content, schema, place=lambda path: "config") -> list[str]:
    """Faults of settings, one line each; `place` gives the place of a path of keys in the file."""
    # A section whose keys are all commented out is None, and means the defaults.
    content, faults = _without_blanks(content, schema), []
    if not content:  # the common case, which need not wait for jsonschema
        return []
    for error in _validator(schema).iter_errors(content):
        path = list(error.absolute_path)
        if error.validator == "additionalProperties":
            unknown = [k for k in error.instance if k not in error.schema["properties"]]
            faults += [
                _unknown(place([*path, key]), path, key, schema, error.schema) for key in unknown
            ]
        else:
            where = f"{place(path)}, {'.'.join(map(str, path))}"
            faults.append(fault(where, error.instance, wanted(error.schema) + _hint(error)))
    return list(dict.fromkeys(faults))


def _unknown(place, path, key, schema, section) -> str:
    dotted = ".".join(map(str, [*path, key]))
    fixed = {
        name: now
        for name, now in schema.get("fixed", {}).items()
        if f"{name}.".startswith(f"{dotted}.")
    }
    if fixed:
        said = ", ".join(f"{name} is fixed now at {now}" for name, now in fixed.items())
        return f"{place}: found {dotted}, wanted no such key: {said}; take it out"
    names = list(section["properties"])
    elsewhere = [name for name, _ in keys(schema) if name.split(".")[-1] == str(key)]
    meant = f"; did you mean {elsewhere[0]!r}?" if elsewhere else ""
    where = f"key of {'.'.join(map(str, path))}" if path else "key"
    return fault(place, key, f"a known {where}: {', '.join(names) or 'it has none'}", names) + meant


def _hint(error) -> str:
    """Hint for what YAML reads otherwise: 1e-3 must be written 1.0e-3, a date in quotes."""
    if isinstance(error.instance, datetime.date):
        return f'; write "{error.instance}" in quotes'
    try:
        number = float(error.instance if isinstance(error.instance, str) else "")
    except ValueError:
        return ""
    if not math.isfinite(number):
        return ""
    return f"; write {int(number) if number.is_integer() else number}"


def _without_blanks(content: dict, schema: dict) -> dict:
    """Content without empty sections (all keys commented out): they are no fault."""
    sections = [name for name, spec in schema["properties"].items() if spec["type"] == "object"]
    return {k: v for k, v in content.items() if v is not None or k not in sections}


def _merged(written: dict, overrides: dict) -> dict:
    merged = dict(written)
    for key, value in overrides.items():
        both = isinstance(value, dict) and isinstance(written.get(key), dict)
        merged[key] = _merged(written[key], value) if both else value
    return merged


def _filled(content: dict, schema: dict) -> dict:
    filled = {}
    for name, spec in schema["properties"].items():
        value = content.get(name)
        if "properties" in spec:
            filled[name] = _filled(value or {}, spec)
        else:
            filled[name] = spec.get("default") if name not in content else value
    return filled
