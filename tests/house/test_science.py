"""Laws of scripts/cellwright: pure, documented, and imports that run one way."""

import ast
import inspect
import re
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType

from tree import (
    LABORATORY,
    SCIENCE,
    SCRIPTS,
    functions,
    held_by_every,
    imports,
    modules,
    name,
    nodes,
    parsed,
)

import cellwright

# Which rooms a room may import besides itself; docs/architecture.md says what each is for.
ROOMS = {
    "numerics": set(),
    "formats": set(),
    "series": {"numerics", "formats"},
    "records": {"numerics", "series"},
    "protocols": {"numerics", "series", "records"},
    "laws": {"numerics", "protocols", "records"},
    "circuits": {"numerics", "series", "records"},
    "health": {"numerics", "protocols", "laws", "series", "records", "circuits"},
    "identification": {"numerics", "records", "protocols", "circuits"},
    "bias": {"numerics", "records", "protocols", "circuits", "health", "identification"},
    "filters": {"numerics", "records", "circuits"},
    "packs": {"numerics", "records", "circuits", "identification"},
    "effects": {
        *("numerics", "series", "records", "protocols", "circuits", "identification", "packs"),
    },
}
# The public interface stands on all rooms, and no room on it.
ROOMS["api"] = set(ROOMS)
GROUND = {"refusal", "native", "settings", "gate", "messages", "result"}
IMPURE = {
    *("matplotlib", "pathlib", "logging", "time", "os", "sys", "subprocess", "shutil", "tempfile"),
    *("random", "pandas", "snakemake", "socket", "urllib", "requests", "warnings", "glob"),
}
IMPURE_CALLS = {
    *("open", "print", "input", "exec", "eval", "now", "today", "utcnow", "read_text"),
    *("read_bytes", "write_text", "write_bytes", "savetxt", "tofile", "memmap"),
}
every_module = held_by_every(modules(SCIENCE))


def called_name(call) -> str:
    """Last part of the name of what is called."""
    return getattr(call.func, "id", getattr(call.func, "attr", ""))


def rooms_imported(path):
    parts = [imported.split(".") for imported in imports(path)]
    return {part[1] for part in parts if part[0] == "cellwright" and len(part) > 1}


@every_module
def test_imports_run_back_only(path):
    room = path.relative_to(SCIENCE).parts[0].removesuffix(".py")
    forward = rooms_imported(path) - ROOMS.get(room, set()) - {room} - GROUND
    assert not forward, f"{name(path)} may not import {sorted(forward)}"


MADE_ALIKE = re.compile(
    r"^(SAME|ALIKE|NEAR|CLOSE)_(C_)?(RATE|CELSIUS|KELVIN|CHECK_?UP)"
    r"|^(((AT_)?REST|START|LOADED)_(C_RATE|SHARE)|(LEAST|LOW)_C_RATE)\b",
    re.M,
)


@every_module
def test_what_is_made_alike_is_said_once(path):
    """One rate, temperature, check-up and rest: all rooms take them from `records.conditions`."""
    if path.name != "conditions.py":
        found = MADE_ALIKE.findall(path.read_text(encoding="utf-8"))
        assert not found, f"{name(path)} says by itself when tests were made alike, or rest"


@every_module
def test_the_robust_deviation_is_said_once(path):
    if path.name != "statistics.py":
        assert "1.4826" not in path.read_text(encoding="utf-8"), name(path)


def test_rooms_stand_in_one_order():
    """What a room may import stands above it in the list, so that no circle is possible."""
    order = list(ROOMS)
    for room, allowed in ROOMS.items():
        assert allowed <= set(order[: order.index(room)]), room
    assert set(order) | GROUND == {
        path.stem
        for path in SCIENCE.iterdir()
        if path.suffix in ("", ".py") and path.stem not in ("__init__", "__pycache__")
    }


def test_no_circle_of_modules():
    """Two modules that need each other are one module, or a third is missing."""
    needs = {}
    for path in modules(SCIENCE):
        dotted = ".".join(path.relative_to(SCIENCE.parent).with_suffix("").parts)
        needs[dotted.removesuffix(".__init__")] = imports(path)
    while needs:
        free = {m for m, n in needs.items() if not any(m != o and within(o, n) for o in needs)}
        assert free, f"circles among {sorted(needs)}"
        needs = {module: n for module, n in needs.items() if module not in free}


def within(module, imported) -> bool:
    """Whether one of the imported names is this module or stands directly in it."""
    return any(one == module or one.rpartition(".")[0] == module for one in imported)


@held_by_every(sorted({p.parent for p in modules(SCIENCE)}))
def test_a_room_says_what_it_is_for(room):
    assert ast.get_docstring(parsed(room / "__init__.py")), f"{name(room)} does not say its purpose"


# What builds compiled kernels has to touch a compiler and a cache; none else may.
BUILDERS = ("native/__init__.py",)


# What the public interface alone may: make DataFrames; and the gate: open a file of a user.
# Programs and libraries of others that read a path alone get the bytes in a folder of a moment.
OF_OTHERS = {"formats/outside.py": {"logging", "pathlib", "tempfile", "warnings"}}
OF_ARCHIVES = "formats/container.py"  # opens parts of an archive that is in memory
OF_THE_INTERFACE = {"result.py": ({"pandas"}, set()), "gate.py": ({"os"}, {"open"})}


@held_by_every([m for m in modules(SCIENCE) if not str(m).endswith(BUILDERS)])
def test_no_file_plot_log_or_clock(path):
    packages, opened = OF_THE_INTERFACE.get(path.relative_to(SCIENCE).parts[0], (set(), set()))
    banned = IMPURE - packages - OF_OTHERS.get(path.relative_to(SCIENCE).as_posix(), set())
    impure = {imported for imported in imports(path) if imported.split(".")[0] in banned}
    calls = [node for node in nodes(path) if isinstance(node, ast.Call)]
    names = {called_name(call) for call in calls}
    assert not impure, f"{name(path)} imports {sorted(impure)}"
    written = {"write_bytes"} if path.relative_to(SCIENCE).as_posix() in OF_OTHERS else set()
    parts = {"open"} if path.relative_to(SCIENCE).as_posix() == OF_ARCHIVES else set()
    called = names & (IMPURE_CALLS - opened - written - parts)
    assert not called, f"{name(path)} calls {sorted(called)}"


def test_a_literal_default_is_no_setting():
    """Defaults of settings stand in the schema; the science takes them from `settings`."""
    from cellwright import settings

    keys = {n for k in vars(settings).values() if hasattr(k, "_fields") for n in k._fields}
    found = set()
    for path in modules(SCIENCE):
        room = path.relative_to(SCIENCE).parts[0]
        for node in functions(path) if room in SETTLED else []:
            pairs = zip(node.args.kwonlyargs, node.args.kw_defaults, strict=True)
            literal = [
                a.arg for a, d in pairs if isinstance(d, ast.Constant) and d.value is not None
            ]
            found |= {f"{room}: {node.name}: {n}" for n in literal if n in keys}
    assert not found, f"defaults beside the schema's: {sorted(found)}"


SETTLED = ("api", "series", "protocols", "laws", "filters", "identification")


@every_module
def test_no_global_no_hidden_randomness_no_caught_everything(path):
    checked = ast.Global | ast.Assert | ast.ExceptHandler | ast.Call
    for node in (node for node in nodes(path) if isinstance(node, checked)):
        where = f"{name(path)}:{node.lineno}"
        assert not isinstance(node, ast.Global), f"{where}: global"
        assert not isinstance(node, ast.Assert), f"{where}: assert; raise Refusal instead"
        if isinstance(node, ast.ExceptHandler):
            caught = ast.unparse(node.type) if node.type else "everything"
            assert caught not in ("everything", "Exception", "BaseException"), f"{where}: catches"
        if isinstance(node, ast.Call) and called_name(node) == "default_rng":
            assert node.args or node.keywords, f"{where}: a generator without a seed"


@held_by_every(modules(SCRIPTS))
def test_zero_degrees_and_an_empty_cell_are_no_blanks(path):
    """`celsius or 25.0` takes 0 °C for a blank; `stated_or_reference` does not."""
    for node in nodes(path):
        if not isinstance(node, ast.BoolOp) or not isinstance(node.op, ast.Or):
            continue
        *asked, last = node.values
        number = isinstance(last, ast.Name | ast.Attribute) or (
            isinstance(last, ast.Constant) and isinstance(last.value, int | float) and last.value
        )
        written = [ast.unparse(one).rstrip("]'\")") for one in asked]
        taken = [one for one in written if one.endswith(("celsius", "soc", "kelvin"))]
        assert not (number and taken), f"{name(path)}:{node.lineno}: {taken} may be 0"


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


def test_every_argument_of_a_step_is_explained():
    """By the step itself, or for all steps in the docstring of the interface."""
    shared = ast.get_docstring(parsed(SCIENCE / "api" / "__init__.py"))
    for public in cellwright.__all__:
        step = getattr(cellwright, public)
        if inspect.isfunction(step):
            about = f"{shared}\n{inspect.getdoc(step)}"
            entries = re.findall(r"(?:^|\. )(\w+(?:, \w+)*) : ", about, re.M)
            unsaid = {*inspect.signature(step).parameters} - set(", ".join(entries).split(", "))
            assert not unsaid, f"{public} does not explain {unsaid}"


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


# What only examines the product: packages of the laboratory, which stand on the product.
EXAMINERS = ("real_cells", "pulse_methods", "fuzz")
PACKAGES = ("cellwright", "cellwright_fmu", "runtime", "figures", *EXAMINERS)
OF_EXAMINERS = [LABORATORY / room for room in (*EXAMINERS, "real", "tools")]


@held_by_every([m for folder in (SCRIPTS, *OF_EXAMINERS) for m in modules(folder)])
def test_what_is_taken_from_a_module_of_ours_exists(path):
    """Also where it is imported within a function, which no import of the module itself shows."""
    for imported in imports(path):
        holder, _, taken = imported.rpartition(".")
        if imported.split(".")[0] not in PACKAGES or not holder:
            continue
        assert hasattr(import_module(holder), taken) or find_spec(imported), f"no {imported}"
    for scope in [parsed(path), *functions(path)]:
        of_ours = whole_modules(scope)
        for node in ast.walk(scope) if of_ours else ():
            called = getattr(node.value, "id", "") if isinstance(node, ast.Attribute) else ""
            if called in of_ours:
                where = f"{name(path)}:{node.lineno}"
                assert hasattr(of_ours[called], node.attr), f"{where}: no {called}.{node.attr}"


def whole_modules(scope) -> dict:
    """Modules of ours that a file or function imports whole, by what it calls them.

    A name that is bound to something else within the scope as well is not among them.
    """
    imported = {}
    for node in scope.body:
        if not isinstance(node, ast.ImportFrom) or node.module.split(".")[0] not in PACKAGES:
            continue
        holder = import_module(node.module)
        for alias in node.names:
            value = getattr(holder, alias.name, None)
            if value is None and find_spec(f"{node.module}.{alias.name}"):
                value = import_module(f"{node.module}.{alias.name}")
            if isinstance(value, ModuleType):
                imported[alias.asname or alias.name] = value
    within = list(ast.walk(scope)) if imported else []
    bound = {n.id for n in within if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}
    bound |= {node.arg for node in within if isinstance(node, ast.arg)}
    return {called: value for called, value in imported.items() if called not in bound}
