"""Laws of scripts/cellwright: pure, short, documented, and imports that run one way."""

import ast

import pytest
from tree import SCIENCE, functions, imports, modules, name, parsed

ROOMS = ["formats", "series", "protocols", "laws", "models", "effects"]
GROUND = {"uncertainty", "refusal", "native"}
IMPURE = {
    *("matplotlib", "pathlib", "logging", "time", "os", "sys", "subprocess", "shutil", "tempfile"),
    *("random", "pandas", "snakemake", "socket", "urllib", "requests", "warnings", "glob"),
}
IMPURE_CALLS = {
    *("open", "print", "input", "exec", "eval", "now", "today", "utcnow", "read_text"),
    *("read_bytes", "write_text", "write_bytes", "savetxt", "tofile", "memmap"),
}
every_module = pytest.mark.parametrize("path", modules(SCIENCE), ids=name)


def rooms_imported(path):
    parts = [imported.split(".") for imported in imports(path)]
    return {part[1] for part in parts if part[0] == "cellwright" and len(part) > 1}


@every_module
def test_imports_run_back_only(path):
    room = path.relative_to(SCIENCE).parts[0].removesuffix(".py")
    allowed = set(ROOMS[: ROOMS.index(room) + 1]) if room in ROOMS else set()
    forward = rooms_imported(path) - allowed - GROUND
    assert not forward, f"{name(path)} may not import {sorted(forward)}"


# The room that builds the compiled kernels has to touch a compiler and a cache; none else may.
BUILDER = "native/__init__.py"


@pytest.mark.parametrize("path", [m for m in modules(SCIENCE) if BUILDER not in str(m)], ids=name)
def test_no_file_plot_log_or_clock(path):
    impure = {imported for imported in imports(path) if imported.split(".")[0] in IMPURE}
    calls = [node for node in ast.walk(parsed(path)) if isinstance(node, ast.Call)]
    names = {getattr(call.func, "id", getattr(call.func, "attr", "")) for call in calls}
    assert not impure, f"{name(path)} imports {sorted(impure)}"
    assert not names & IMPURE_CALLS, f"{name(path)} calls {sorted(names & IMPURE_CALLS)}"


@every_module
def test_no_global_no_hidden_randomness_no_caught_everything(path):
    for node in ast.walk(parsed(path)):
        where = f"{name(path)}:{getattr(node, 'lineno', 0)}"
        assert not isinstance(node, ast.Global), f"{where}: global"
        assert not isinstance(node, ast.Assert), f"{where}: assert; raise Refusal instead"
        if isinstance(node, ast.ExceptHandler):
            caught = ast.unparse(node.type) if node.type else "everything"
            assert caught not in ("everything", "Exception", "BaseException"), f"{where}: catches"
        if isinstance(node, ast.Call) and ast.unparse(node.func).endswith("random.default_rng"):
            assert node.args or node.keywords, f"{where}: a generator without a seed"


@every_module
def test_what_is_public_is_documented(path):
    assert ast.get_docstring(parsed(path)), f"{name(path)} has no docstring"
    for node in parsed(path).body:
        if not isinstance(node, ast.FunctionDef | ast.ClassDef) or node.name.startswith("_"):
            continue
        about = ast.get_docstring(node)
        assert about, f"{name(path)}:{node.lineno} {node.name} has no docstring"
        if isinstance(node, ast.FunctionDef) and "Parameters\n" in about:
            arguments = {a.arg for a in (*node.args.args, *node.args.kwonlyargs)}
            missing = sorted(a for a in arguments if a not in about)
            assert not missing, f"{name(path)}:{node.lineno} {node.name} does not explain {missing}"


@every_module
def test_a_class_is_a_result_a_refusal_or_an_enumeration(path):
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.ClassDef):
            bases = {ast.unparse(base) for base in node.bases}
            known = bases & {"NamedTuple", "Refusal", "ValueError", "IntFlag", "StrEnum"}
            assert known, f"{name(path)}:{node.lineno} {node.name} is none of these"


def test_settings_are_keyword_only():
    for path in modules(SCIENCE):
        for node in functions(path):
            if node.name.startswith("_"):
                continue
            defaults = dict(
                zip(reversed(node.args.args), reversed(node.args.defaults), strict=False)
            )
            numbers = [
                argument.arg
                for argument, default in defaults.items()
                if isinstance(default, ast.Constant) and isinstance(default.value, int | float)
            ]
            assert not numbers, f"{name(path)}:{node.lineno} {node.name}: {numbers} before the *"
