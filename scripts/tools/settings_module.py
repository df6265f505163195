"""Writes scripts/cellwright/settings from the schema; with --check, fails where it differs."""

import sys
import textwrap
from pathlib import Path

from runtime import settings

ROOT = Path(__file__).resolve().parents[2]
SCHEMAS = ROOT / "workflow" / "schemas"
FOLDER = ROOT / "scripts" / "cellwright" / "settings"
MADE = "Made by scripts/tools/settings_module.py from workflow/schemas/config.schema.yaml."
FILES = {
    "tests.py": (
        "Settings of what is read from the tests of a cell, and of the laws over them.",
        [
            *("files", "clean", "segment", "ocv", "instrument", "resistance"),
            *("temperature", "fast_charge", "health", "impedance"),
        ],
    ),
    "models.py": (
        "Settings of equivalent circuits, of filters, and of packs.",
        ["models", "soc", "pack_decisions"],
    ),
    "effects.py": (
        "Settings of the search for missing effects.",
        ["missing_effect"],
    ),
}
TYPES = {"number": "float", "integer": "int", "boolean": "bool", "string": "str"}


def files() -> dict[str, str]:
    """The text of each file of the package, by its name."""
    sections = settings.load(SCHEMAS, "config")["properties"]
    texts = {"__init__.py": _package()}
    for file, (purpose, names) in FILES.items():
        classes = [_class(class_name(name), sections[name]) for name in names]
        head = f'"""{purpose}\n\n{MADE}\nDo not edit.\n"""\n\nfrom typing import NamedTuple\n'
        texts[file] = "\n\n".join([head, *classes])
    return texts


def class_name(section: str) -> str:
    """What the class of a section is called: `fast_charge` → FastCharge."""
    return "".join(word.capitalize() for word in section.split("_"))


def of_science(spec: dict) -> dict:
    """Keys of a section that reach an analysis, with their schemas."""
    return {name: key for name, key in spec["properties"].items() if not key.get("plans")}


def _package() -> str:
    purpose = "Settings of every step as typed values: units, meanings, defaults of a campaign."
    lines = [f'"""{purpose}\n\n{MADE}\nDo not edit.\n"""\n']
    names = []
    for file, (_, sections) in sorted(FILES.items()):
        classes = sorted(class_name(section) for section in sections)
        names += classes
        module = file.removesuffix(".py")
        joined = "".join(f"    {name},\n" for name in classes)
        lines.append(f"from cellwright.settings.{module} import (\n{joined})")
    every = "".join(f'    "{name}",\n' for name in sorted(names))
    return "\n".join(lines) + f"\n\n__all__ = [\n{every}]\n"


def _class(name: str, spec: dict) -> str:
    """The class of a section."""
    keys = of_science(spec)
    about = [*_wrapped(spec["description"]), ""]
    about += [
        line for key, key_spec in keys.items() for line in _wrapped(_meaning(key, key_spec), "    ")
    ]
    fields = [f"{key}: {_type(spec)} = {_value(spec)}" for key, spec in keys.items()]
    about[0] = f'    """{about[0].strip()}'
    body = "\n".join([*about, '    """', "", *(_short(field) for field in fields)])
    return f"class {name}(NamedTuple):\n{body}\n"


def _meaning(key: str, spec: dict) -> str:
    unit = f" [{spec['unit']}]" if "unit" in spec else ""
    source = f" Source: {spec['source']}." if "source" in spec else ""
    return f"{key}{unit} : {spec['description']}{source}"


def _wrapped(text: str, indent: str = "") -> list[str]:
    first, later = "    ", "    " + indent
    return textwrap.wrap(
        text, 97, initial_indent=first, subsequent_indent=later, break_on_hyphens=False
    )


def _type(spec: dict) -> str:
    if spec["type"] == "array":
        return f"tuple[{TYPES[spec['items']['type']]}, ...]"
    return TYPES[spec["type"]]


def _value(spec: dict) -> str:
    if spec["type"] == "array":
        values = [_literal(value, spec["items"]) for value in spec["default"]]
        return f"({', '.join(values)}{',' if len(values) == 1 else ''})"
    return _literal(spec["default"], spec)


def _literal(value, spec) -> str:
    if spec["type"] == "number":
        return repr(float(value))
    return f'"{value}"' if spec["type"] == "string" else repr(value)


def _short(field: str) -> str:
    """A field on one line, or its values on a line each where they are too many for one."""
    if len(field) <= 96:
        return f"    {field}"
    head, _, values = field.partition(" = (")
    inside = "".join(f"        {value},\n" for value in values.rstrip(")").split(", "))
    return f"    {head} = (\n{inside}    )"


if __name__ == "__main__":
    for name, text in files().items():
        path = FOLDER / name
        if sys.argv[1:] == ["--check"]:
            current = path.read_text(encoding="utf-8") if path.is_file() else ""
            if current != text:
                sys.exit(f"{path.relative_to(ROOT)}: run scripts/tools/settings_module.py")
            continue
        FOLDER.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")
