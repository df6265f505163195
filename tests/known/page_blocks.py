"""Blocks of code of the pages, and how a test runs one."""

import ast
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "config/README.md")),
    *sorted((ROOT / "docs").rglob("*.md")),
    *sorted((ROOT / "lab").glob("*.md")),
    *sorted((ROOT / "plugins").glob("*/README.md")),
]
TEXTS = {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in PAGES}


def blocks(page, language="python"):
    """Contents of the blocks of a page in a language, in order."""
    return re.findall(rf"^```{language}\n(.*?)^```", TEXTS[page], re.M | re.S)


def value_of(block, names=None):
    """Run a block as a notebook does; its last expression's value, else None. Fills names."""
    tree, names = ast.parse(block), {} if names is None else names
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, "block", "exec"), names)
    return last and eval(compile(ast.Expression(last.value), "block", "eval"), names)
