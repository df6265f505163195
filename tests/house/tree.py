"""What the house's laws are held against: files, parsed once."""

import ast
import subprocess
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SCRIPTS = ROOT / "scripts"
SCIENCE = SCRIPTS / "cellwright"
LABORATORY = ROOT / "lab"


def name(path: Path) -> str:
    """Path as a person names it."""
    return path.relative_to(ROOT).as_posix()


@cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def nodes(path: Path) -> tuple[ast.AST, ...]:
    """All nodes of a file, outer ones first; a walk for each law takes most of the laws' time."""
    return tuple(ast.walk(parsed(path)))


def modules(folder: Path) -> list[Path]:
    return sorted(folder.rglob("*.py"))


def functions(path: Path) -> list[ast.FunctionDef]:
    return [node for node in nodes(path) if isinstance(node, ast.FunctionDef)]


def imports(path: Path) -> set[str]:
    """Dotted names that a module imports; `from a import b` as `a.b`, relative ones resolved."""
    root = LABORATORY if path.is_relative_to(LABORATORY) else SCRIPTS
    package = path.parent.relative_to(root).parts
    found = set()
    for node in nodes(path):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else ()
            stem = ".".join([*base, *filter(None, [node.module])])
            found |= {f"{stem}.{alias.name}" for alias in node.names}
    return found


def committed() -> list[Path]:
    """Files that are, or are about to be, in the repository."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    paths = [ROOT / line for line in listed.splitlines()]
    return [path for path in paths if path.is_file() and not path.is_symlink()]


def held_by_every(paths):
    """Make of a law of one file a test that holds all of these against it, and names each fault."""

    def test_of(law):
        def test():
            faults = []
            for path in paths:
                try:
                    law(path)
                except AssertionError as fault:
                    faults.append(f"{name(path)}: {fault}")
            assert paths, "no files"
            if faults:
                pytest.fail("\n".join(faults), pytrace=False)

        test.__name__, test.__doc__ = law.__name__, law.__doc__
        return test

    return test_of
