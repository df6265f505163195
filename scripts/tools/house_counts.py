"""Counts of the code base that tell whether it can still be held in the head, one a line.

Run: python scripts/tools/house_counts.py
"""

import ast
import re
import tokenize
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SCIENCE = ROOT / "scripts" / "cellwright"
LABORATORY = ROOT / "lab"


def python_files(*folders):
    """Python files below folders, sorted, of those that exist."""
    return sorted(
        path
        for folder in folders
        for path in folder.rglob("*.py")
        if "__pycache__" not in path.parts
    )


def lines_of(paths) -> int:
    return sum(len(path.read_text(encoding="utf-8").splitlines()) for path in paths)


def nodes_of(paths):
    """All nodes of the syntax trees of files."""
    for path in paths:
        yield from ast.walk(ast.parse(path.read_text(encoding="utf-8")))


def classes(paths):
    """Names of all classes."""
    trees = [ast.parse(path.read_text(encoding="utf-8")) for path in paths]
    return [
        node.name for tree in trees for node in ast.walk(tree) if isinstance(node, ast.ClassDef)
    ]


def functions(paths) -> int:
    return sum(isinstance(node, ast.FunctionDef) for node in nodes_of(paths))


def is_number(node) -> bool:
    """Whether an expression is made of numbers alone."""
    if isinstance(node, ast.Constant):
        return isinstance(node.value, int | float) and not isinstance(node.value, bool)
    if isinstance(node, ast.Tuple | ast.List):
        return bool(node.elts) and all(map(is_number, node.elts))
    if isinstance(node, ast.BinOp):
        return is_number(node.left) and is_number(node.right)
    return isinstance(node, ast.UnaryOp) and is_number(node.operand)


def numeric_constants(paths) -> int:
    """Names in capitals at the top of modules that hold numbers."""
    statements = [node for path in paths for node in ast.parse(path.read_text()).body]
    return sum(map(numbers_named, statements))


def numbers_named(node) -> int:
    """How many names a statement gives to numbers; several at once count each."""
    if not isinstance(node, ast.Assign) or len(node.targets) != 1:
        return 0
    target, value = node.targets[0], node.value
    if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
        return sum(map(is_number, value.elts))
    return int(isinstance(target, ast.Name) and target.id.isupper() and is_number(value))


def comment_share(paths) -> float:
    """Lines that are or end with a comment, over all lines [%]."""
    comments = 0
    for path in paths:
        with tokenize.open(path) as text:
            comments += sum(
                token.type == tokenize.COMMENT for token in tokenize.generate_tokens(text.readline)
            )
    return 100.0 * comments / lines_of(paths)


def settings_keys() -> int:
    """Keys of config.yaml that a campaign may set, as the schema lists them."""
    import yaml

    def leaves(schema):
        parts = schema.get("properties")
        return sum(map(leaves, parts.values())) if parts else 1

    text = (ROOT / "workflow/schemas/config.schema.yaml").read_text(encoding="utf-8")
    return leaves(yaml.safe_load(text))


def most_files_of_one_effect() -> tuple[str, int]:
    """The effect of the library that most files of the product name, and how many do."""
    library = python_files(SCIENCE / "effects" / "library")
    product = python_files(ROOT / "scripts")
    texts = [path.read_text(encoding="utf-8") for path in product]
    ids = {
        name
        for path in library
        for name in re.findall(r'\b(?:Effect|effect)\(\s*(?:id=)?"(\w+)"', path.read_text())
    }
    counts = {name: sum(f'"{name}"' in text for text in texts) for name in ids}
    return max(counts.items(), key=lambda item: item[1], default=("none found", 0))


def in_rules() -> int:
    """Functions and lambdas in rules."""
    rules = (ROOT / "workflow").rglob("*.smk")
    return sum(len(re.findall(r"^\s*def |\blambda\b", path.read_text(), re.M)) for path in rules)


def words_by_hand() -> int:
    """Words of the documentation in the repository, README and CHANGELOG apart."""
    pages = [*sorted((ROOT / "docs").rglob("*.md")), ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
    return sum(len(page.read_text(encoding="utf-8").split()) for page in pages if page.exists())


def main():
    science = python_files(SCIENCE)
    product = python_files(ROOT / "scripts")
    effect, files = most_files_of_one_effect()
    results = classes([SCIENCE / "api" / "results.py"])
    for what, count in {
        "lines of scripts/cellwright": lines_of(science),
        "lines of all product code": lines_of(product),
        "lines of the laboratory": lines_of(
            [p for p in python_files(LABORATORY) if "tests" not in p.parts]
        ),
        "lines of tests": lines_of(python_files(ROOT / "tests", ROOT / "lab" / "tests")),
        "types in scripts/cellwright": len(classes(science)),
        "functions in scripts/cellwright": functions(science),
        "result types of the public interface": len(results),
        "numeric module constants": numeric_constants(science),
        "settings": settings_keys(),
        "functions and lambdas in rules": in_rules(),
        f"files that name one effect ({effect})": files,
        "words of documentation": words_by_hand(),
        "comments, % of lines": round(comment_share(science), 1),
    }.items():
        print(f"{count:>9} {what}")


if __name__ == "__main__":
    main()
