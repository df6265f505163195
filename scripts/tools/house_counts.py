"""What the code base holds, counted: code lines by room, types, constants, settings, words of docs.

Run: python scripts/tools/house_counts.py [--why "…"]

Prints each count beside the recorded one; --why records them, with the reason of those that grew.
"""

import argparse
import ast
import csv
import io
import re
import tokenize
from functools import cache
from pathlib import Path

import yaml

ROOT = Path(__file__).resolve().parents[2]
SCIENCE = ROOT / "scripts" / "cellwright"
RECORDED = ROOT / "tests" / "house" / "counts.csv"
# A fix of a few lines may come without a word.
GROWTH_SHARE, GROWTH = 0.01, 5
NO_CODE = {
    *(tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT),
    *(tokenize.ENCODING, tokenize.ENDMARKER),
}


def counts() -> dict[str, int]:
    """Each count by its name."""
    science, product = python_files(SCIENCE), python_files(ROOT / "scripts")
    rooms = {path.relative_to(SCIENCE).parts[0] for path in science if path.parent != SCIENCE}
    found = {f"code lines of {room}": _code_lines(SCIENCE / room) for room in sorted(rooms)}
    return found | {
        "code lines of scripts/cellwright": _code_lines(SCIENCE),
        "code lines of scripts/runtime": _code_lines(ROOT / "scripts" / "runtime"),
        "code lines of scripts/figures": _code_lines(ROOT / "scripts" / "figures"),
        "code lines of scripts": _code_lines(ROOT / "scripts"),
        "types in scripts/cellwright": _nodes(science, ast.ClassDef),
        "numeric constants in scripts/cellwright": sum(map(_numbers_named, _statements(science))),
        "settings": _settings(),
        "functions and lambdas in rules": _in_rules(),
        "files that name one effect": _files_of_one_effect(product),
        "words of documentation": _words(),
    }


def grown(found: dict[str, int], recorded: dict[str, int]) -> list[str]:
    """Counts that are larger than recorded by more than a few, each in words."""
    return [
        f"{name}: {found[name]}, recorded {recorded.get(name, 0)}"
        for name in found
        if found[name] > recorded.get(name, 0) * (1 + GROWTH_SHARE) + GROWTH
    ]


def recorded() -> dict[str, int]:
    """Counts as they were last recorded."""
    with RECORDED.open(encoding="utf-8") as text:
        return {row["what"]: int(row["count"]) for row in csv.DictReader(text)}


def python_files(folder):
    """Python files below a folder, sorted."""
    return sorted(p for p in folder.rglob("*.py") if "__pycache__" not in p.parts)


@cache
def _tree(path):
    return ast.parse(path.read_text(encoding="utf-8"))


def _code_lines(folder):
    return sum(code_lines(path) for path in python_files(folder))


@cache
def code_lines(path) -> int:
    """Lines of a file that hold a token, without docstrings, comments and blank lines."""
    documented = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef
    words = set()
    for node in ast.walk(_tree(path)):
        if isinstance(node, documented) and ast.get_docstring(node) is not None:
            words.update(range(node.body[0].lineno, node.body[0].end_lineno + 1))
    lines = set()
    text = io.StringIO(path.read_text(encoding="utf-8"))
    for token in tokenize.generate_tokens(text.readline):
        if token.type not in NO_CODE:
            lines.update(range(token.start[0], token.end[0] + 1))
    return len(lines - words)


def _nodes(paths, kind):
    return sum(isinstance(node, kind) for path in paths for node in ast.walk(_tree(path)))


def _statements(paths):
    return [node for path in paths for node in _tree(path).body]


def _is_number(node):
    """Whether an expression is made of numbers alone."""
    if isinstance(node, ast.Constant):
        return isinstance(node.value, int | float) and not isinstance(node.value, bool)
    if isinstance(node, ast.Tuple | ast.List):
        return bool(node.elts) and all(map(_is_number, node.elts))
    if isinstance(node, ast.BinOp):
        return _is_number(node.left) and _is_number(node.right)
    return isinstance(node, ast.UnaryOp) and _is_number(node.operand)


def _numbers_named(node):
    """How many names in capitals a statement gives to numbers; several at once count each."""
    if not isinstance(node, ast.Assign) or len(node.targets) != 1:
        return 0
    target, value = node.targets[0], node.value
    if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
        return sum(map(_is_number, value.elts))
    return int(isinstance(target, ast.Name) and target.id.isupper() and _is_number(value))


def _settings():
    """Keys of config.yaml that a campaign may set, as the schema lists them."""

    def leaves(schema):
        parts = schema.get("properties")
        return sum(map(leaves, parts.values())) if parts else 1

    text = (ROOT / "workflow/schemas/config.schema.yaml").read_text(encoding="utf-8")
    return leaves(yaml.safe_load(text))


def _files_of_one_effect(product):
    """How many files name the effect of the library that most do."""
    texts = [path.read_text(encoding="utf-8") for path in product]
    library = python_files(SCIENCE / "effects" / "library")
    names = {
        name
        for path in library
        for name in re.findall(r'\b(?:Effect|effect)\(\s*(?:id=)?"(\w+)"', path.read_text())
    }
    return max(sum(f'"{name}"' in text for text in texts) for name in names)


def _in_rules():
    rules = (ROOT / "workflow").rglob("*.smk")
    return sum(len(re.findall(r"^\s*def |\blambda\b", path.read_text(), re.M)) for path in rules)


def _words():
    """Words of the documentation by hand; the changelog grows by nature."""
    from documentation.pages import by_hand

    files = [*(ROOT / "docs").rglob("*.md"), ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
    return sum(len(by_hand(file).split()) for file in files)


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--why", default="", help="record these counts, for this reason")
    why, found, before = parser.parse_args().why, counts(), recorded()
    for name, count in found.items():
        print(f"{count:>7} {before.get(name, 0):>7} {name}")
    if not why:
        return
    with RECORDED.open(encoding="utf-8") as text:
        reasons = {row["what"]: row["why"] for row in csv.DictReader(text)}
    with RECORDED.open("w", encoding="utf-8", newline="") as text:
        table = csv.writer(text, lineterminator="\n")
        table.writerow(["what", "count", "why"])
        for name, count in found.items():
            reason = why if count > before.get(name, 0) else reasons.get(name, "")
            table.writerow([name, count, reason])


if __name__ == "__main__":
    main()
