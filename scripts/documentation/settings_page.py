"""The page of all sheet columns and config keys, from the schemas; run by hand, it prints them.

./run python scripts/documentation/settings_page.py
"""

import json
from pathlib import Path

from runtime import settings
from runtime.settings import wanted

ROOT = Path(__file__).resolve().parents[2]
SCHEMAS = ROOT / "workflow" / "schemas"
INTRODUCTION = """\
# Sheet columns and config keys

Facts stand in tab-separated sheets, choices in `config.yaml`. UTF-8, one header row, columns in
any order, blank = not known. Unknown columns, ids, kinds and keys are faults; all faults of all
files are reported at once, before anything runs. This page is made from
[workflow/schemas](../workflow/schemas).
"""


def text() -> str:
    """The whole page, in Markdown."""
    sheets = [
        _sheet(settings.load(SCHEMAS, name)) for name in ("cells", "tests", "groups", "checkups")
    ]
    return "\n".join([INTRODUCTION, *sheets, _config(settings.load(SCHEMAS, "config"))])


def _sheet(spec: dict) -> str:
    rows = []
    for name, column in spec["properties"].items():
        needed = "value" if column.get("filled") else "column" if name in spec["required"] else ""
        rows.append([f"`{name}`", wanted(column), needed, _default(column), *_about(column)])
    head = ["column", "value", "needed", "default", "unit", "meaning"]
    return f"## `{spec['title']}`\n\n{spec['description']}\n\n{_table(head, rows)}"


def _config(spec: dict) -> str:
    parts = [f"## `{spec['title']}`\n\n{spec['description']}\n"]
    head = ["key", "value", "default", "unit", "meaning"]
    top = {n: s for n, s in spec["properties"].items() if not s.get("properties")}
    sections = {n: s for n, s in spec["properties"].items() if s.get("properties")}
    parts.append(_table(head, [_key(name, key) for name, key in top.items()]))
    for name, section in sections.items():
        rows = [_key(key, value) for key, value in settings.keys(section)]
        parts.append(f"### `{name}`\n\n{section['description']}\n\n{_table(head, rows)}")
    return "\n".join(parts)


def _key(name: str, spec: dict) -> list[str]:
    return [f"`{name}`", wanted(spec), _default(spec), *_about(spec)]


def _default(spec: dict) -> str:
    if "default" not in spec:
        return ""
    special = spec.get("default_of_kind", {})
    others = "".join(f"; `{value}` for kind `{kind}`" for kind, value in special.items())
    return f"`{json.dumps(spec['default']).strip(chr(34))}`{others}"


def _about(spec: dict) -> list[str]:
    source = f" Source: {spec['source']}." if "source" in spec else ""
    return [spec.get("unit", ""), spec["description"] + source]


def _table(head: list[str], rows: list[list[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    cells = [[cell.replace("|", "\\|") for cell in line] for line in lines]
    return "".join(f"| {' | '.join(line)} |\n" for line in cells)


if __name__ == "__main__":
    print(text())
