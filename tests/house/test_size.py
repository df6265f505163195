"""Laws of size, for all code of ours: functions, nesting, and the rules' thin scripts."""

import ast
import re

from tree import LABORATORY, ROOT, SCRIPTS, functions, held_by_every, modules, name, parsed

FUNCTION_LINES = 60
NESTING = 2
SCRIPT_LINES = 20
BLOCKS = (ast.For, ast.While, ast.If, ast.With, ast.Try, ast.Match)
RULES = sorted((ROOT / "workflow" / "rules").glob("*.smk"))
RUN_BY_RULES = {
    script for path in RULES for script in re.findall(r"scripts/([\w/]+)\.py\"", path.read_text())
}
OF_THE_LABORATORY = [p for p in modules(LABORATORY) if "tests" not in p.relative_to(ROOT).parts]
OURS = [*modules(SCRIPTS), *modules(ROOT / "plugins"), *OF_THE_LABORATORY]
every_module = held_by_every(OURS)


def body_lines(function) -> int:
    first = function.body[1:2] if ast.get_docstring(function) else function.body[:1]
    return function.end_lineno - first[0].lineno + 1 if first else 0


def depth(node) -> int:
    """Blocks within blocks; an `elif` stands beside its `if`, a function begins anew."""
    deepest = 0
    for field, value in ast.iter_fields(node):
        for child in value if isinstance(value, list) else [value]:
            if not isinstance(child, ast.AST) or isinstance(child, ast.FunctionDef):
                continue
            beside = isinstance(node, ast.If) and field == "orelse" and isinstance(child, ast.If)
            deeper = isinstance(child, BLOCKS) and not beside
            deepest = max(deepest, depth(child) + deeper)
    return deepest


@every_module
def test_functions_are_short(path):
    long = {f.name: body_lines(f) for f in functions(path) if body_lines(f) > FUNCTION_LINES}
    assert not long, f"{name(path)}: more than {FUNCTION_LINES} lines: {long}"


@every_module
def test_nesting_is_shallow(path):
    deep = {f.name: depth(f) for f in functions(path) if depth(f) > NESTING}
    assert not deep, f"{name(path)}: blocks nested deeper than {NESTING}: {deep}"


@held_by_every([SCRIPTS / f"{script}.py" for script in sorted(RUN_BY_RULES)])
def test_a_rules_script_is_thin(path):
    assert path.is_file(), f"{name(path)} is missing"
    count = len(path.read_text(encoding="utf-8").splitlines())
    assert count <= SCRIPT_LINES, f"{name(path)} has {count} lines, at most {SCRIPT_LINES}"
    made = [n for n in ast.walk(parsed(path)) if isinstance(n, ast.FunctionDef | ast.ClassDef)]
    assert not made, f"{name(path)} defines {made[0].name}: that belongs into the science"


def test_every_script_of_a_folder_of_rules_is_run():
    """Folders of scripts bear the name of a file of rules, and hold nothing else."""
    folders = [SCRIPTS / path.stem for path in RULES if (SCRIPTS / path.stem).is_dir()]
    found = {f"{p.parent.name}/{p.stem}" for folder in folders for p in folder.glob("*.py")}
    assert found, "no folder of scripts was found"
    assert not found - RUN_BY_RULES, f"no rule runs {sorted(found - RUN_BY_RULES)}"
    assert not list(SCRIPTS.glob("*.py")), "scripts lie in folders"


def test_the_snakefile_is_short():
    assert len((ROOT / "workflow" / "Snakefile").read_text(encoding="utf-8").splitlines()) <= 60


def test_nesting_is_counted_as_people_see_it():
    """The measure itself: one block, an elif beside it, a block within a block."""
    source = "def f():\n for a in b:\n  if a: pass\n  elif b: pass\n  else:\n   while c: pass\n"
    assert depth(ast.parse(source).body[0]) == 3
    assert depth(ast.parse("def f():\n if a: pass\n elif b: pass\n").body[0]) == 1
