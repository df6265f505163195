"""Provenance of artefacts: hashes of input files, of code, of the environment."""

import ast
import hashlib
import json
import os
import re
import sys
import tomllib
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from runtime import kept

SCRIPTS = Path(__file__).resolve().parents[1]
LOCK = SCRIPTS.parent / "environment.lock"
# Packages beside scripts/ that scripts of rules import.
BESIDE = (Path("plugins", "cellwright-fmu"),)
# Where Snakemake lays copies of what is in object storage: below this folder of the campaign.
COPIES = (".snakemake", "storage")


@cache
def sha256_of(path) -> str:
    """SHA-256 of a file's bytes, as hexadecimal digits."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


class Piece(NamedTuple):
    """A module that a script runs; with a name, one function or class of it."""

    path: Path
    name: str = ""


# Folders of modules whose functions and classes are hashed one by one.
PARTED = ("cellwright/api", "cellwright/settings")
STUB = ".pyi"  # of a package whose names are imported from their modules at first use
MESSAGES = ".toml"  # of a module whose sentences stand in the file of its name
IMPORTS = (ast.Import, ast.ImportFrom)


@cache
def code_of(script: str) -> str:
    """Hash of the code that `scripts/<script>.py` runs: itself and all it imports of ours.

    Hashed is the syntax tree without docstrings, so that comments, layout and documentation
    change nothing, and a changed formula in any imported module changes the hash. Of the public
    interface and of the settings only the functions and classes that are used count.
    """
    # Sorted: the order in which imports are walked must not count.
    digests = [digest_of(piece) for piece in sorted(pieces_of(script))]
    return hashlib.sha256("".join(digests).encode()).hexdigest()[:16]


@cache
def digest_of(piece: Piece) -> str:
    """SHA-256 of a piece's place and syntax tree, of C sources of its package, and its messages."""
    digest = hashlib.sha256(f"{_place(piece.path).as_posix()}:{piece.name}".encode())
    digest.update(ast.dump(_tree(piece)).encode())
    package = piece.path.name == "__init__.py"  # it builds the C sources in its folder
    beside = sorted(piece.path.parent.glob("*.[ch]")) if package else []
    for source in [*beside, *filter(Path.is_file, [piece.path.with_suffix(MESSAGES)])]:
        digest.update(source.read_bytes())
    return digest.hexdigest()


def _roots() -> list[Path]:
    """Folders that packages of ours lie in."""
    return [SCRIPTS, *(SCRIPTS.parent / folder for folder in BESIDE)]


def _place(path: Path) -> Path:
    """Path of a module below the folder that its package lies in."""
    return path.relative_to(next(root for root in _roots() if path.is_relative_to(root)))


def codes_of(scripts, folders=None) -> dict[str, str]:
    """`code_of` of each script; the hashes of sources that have not changed are read from a file.

    Parameters
    ----------
    scripts : names as `protocols/ocv`
    folders : where hashes of earlier starts are kept, in files named by the SHA-256 of the bytes of
        all sources that they are of, for all campaigns; the first that can be written to gets those
        that are new. None: the user's cache, else the campaign's records.
    """
    # Named by what it is of: a file of other sources is never read, so none can be out of date.
    name = f"codes-{_sources_digest()}.json"
    files = [Path(folder) / name for folder in folders or _caches()]
    known = next(filter(None, map(kept.read, files)), {})
    codes = {script: known.get(script) or code_of(script) for script in scripts}
    if not codes.items() <= known.items():
        any(kept.write(file, known | codes) for file in files)
    return codes


def _caches():
    """Where hashes may be kept: the user's cache, else the records of the campaign."""
    cached = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return Path(cached, "cellwright"), Path(".snakemake", "cellwright")


def _sources_digest() -> str:
    # Syntax trees of one source differ between versions of Python.
    sources = hashlib.sha256(sys.version.encode())
    found = [
        path
        for root in _roots()
        for kind in ("*.py", "*.pyi", "*.[ch]", f"*{MESSAGES}")
        for path in root.rglob(kind)
    ]
    for path in sorted(found):
        sources.update(f"{_place(path).as_posix()}\n".encode() + path.read_bytes())
    return sources.hexdigest()[:32]


def pieces_of(script: str) -> set[Piece]:
    """The pieces of code that `scripts/<script>.py` runs, itself among them."""
    reached, waiting = set(), [Piece(SCRIPTS / f"{script}.py")]
    while waiting:
        piece = waiting.pop()
        if piece not in reached:
            reached.add(piece)
            waiting += _needs(piece)
    return reached


@cache
def _parsed(path: Path) -> ast.Module:
    """Syntax tree of a module without docstrings."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list) and body and _is_docstring(body[0]):
            node.body = body[1:]
    return tree


@cache
def _entries(path: Path) -> dict:
    """Statement that defines each top-level name of a module."""
    statements = {}
    for node in _parsed(path).body:
        if isinstance(node, IMPORTS):
            statements |= {alias.asname or alias.name: _only(node, alias) for alias in node.names}
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            statements[node.name] = node
        elif isinstance(node, ast.Assign):
            statements |= {
                target.id: node for target in node.targets if isinstance(target, ast.Name)
            }
    for line in _stub(path).body:
        if isinstance(line, ast.ImportFrom) and line.module != "cellwright":
            statements |= {name.name: _only(line, ast.alias(name.name)) for name in line.names}
    return statements


def _stub(path: Path) -> ast.Module:
    """The stub beside a module, an empty one where there is none."""
    stub = path.with_suffix(STUB)
    return ast.parse(stub.read_text(encoding="utf-8") if stub.exists() else "")


def _only(node, alias):
    """The import statement of one of its names."""
    if isinstance(node, ast.ImportFrom):
        return ast.ImportFrom(node.module, [alias], node.level)
    return ast.Import([alias])


def _tree(piece: Piece) -> ast.AST:
    return _entries(piece.path)[piece.name] if piece.name else _parsed(piece.path)


@cache
def _needs(piece: Piece) -> frozenset:
    """The pieces that a piece imports or, within its own module, uses."""
    nodes, needed = list(ast.walk(_tree(piece))), set()
    if piece.name:
        entries = _entries(piece.path)
        used = {node.id for node in nodes if isinstance(node, ast.Name)} & set(entries)
        needed = {Piece(piece.path, name) for name in used}
        nodes += [entries[name] for name in used if isinstance(entries[name], IMPORTS)]
    package = _place(piece.path).parent.parts
    names = [name for node in nodes for name in _imported(node, package)]
    # `cw.capacity` is an attribute of a module, and names that step alone.
    names += _attributes_of_modules(nodes)
    needed.update(*(_pieces_named(name) for name in names))
    return frozenset(needed - {piece})


def _imported(node, package) -> list[str]:
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    if not isinstance(node, ast.ImportFrom):
        return []
    base = list(package[: len(package) - node.level + 1]) if node.level else []
    stem = ".".join([*base, *([node.module] if node.module else [])])
    return [stem, *(f"{stem}.{alias.name}" for alias in node.names)]


def _attributes_of_modules(nodes) -> list[str]:
    """Dotted names of what is taken from modules that are imported as a whole: `module.name`."""
    modules = {}
    for node in (node for node in nodes if isinstance(node, IMPORTS)):
        stem = f"{node.module}." if isinstance(node, ast.ImportFrom) else ""
        modules |= {alias.asname or alias.name: stem + alias.name for alias in node.names}
    attributes = [node for node in nodes if isinstance(node, ast.Attribute)]
    taken = [node for node in attributes if isinstance(node.value, ast.Name)]
    return [f"{modules[n.value.id]}.{n.attr}" for n in taken if n.value.id in modules]


@cache
def _pieces_named(name: str) -> set[Piece]:
    """The module of a dotted name and each package above it, where they are ours."""
    parts = name.split(".")
    root = next((root for root in _roots() if _holds(root, parts[0])), SCRIPTS)
    stems = [root.joinpath(*parts[:end]) for end in range(1, len(parts) + 1)]
    files = [stem / "__init__.py" for stem in stems] + [stems[-1].with_suffix(".py")]
    pieces = {Piece(file) for file in files if file.is_file() and not _gives_names(file)}
    owners = [stems[-2].with_suffix(".py"), stems[-2] / "__init__.py"] if len(stems) > 1 else []
    holder = next((f for f in owners if f.is_file() and _gives_names(f)), None)
    if holder and parts[-1] in _entries(holder):
        pieces.add(Piece(holder, parts[-1]))
    return pieces


def _holds(root: Path, package: str) -> bool:
    """Whether a package or module of this name lies in a folder."""
    return (root / package).is_dir() or (root / f"{package}.py").is_file()


@cache
def _gives_names(file: Path) -> bool:
    """Whether the names of this file are hashed one by one."""
    return _place(file).parent.as_posix() in PARTED or file.with_suffix(STUB).exists()


def _is_docstring(node) -> bool:
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )


def name_of(path: str) -> str:
    """Path relative to the campaign, or to the repository for what lies there.

    Of what lies in object storage a job reads a copy, which has the name of the original.
    """
    parts = Path(path).parts
    if COPIES in pairwise(parts) and "results" in parts:
        return Path(*parts[parts.index("results") :]).as_posix()
    absolute = Path(path).resolve()
    roots = [root for root in (Path.cwd(), SCRIPTS.parent) if absolute.is_relative_to(root)]
    return absolute.relative_to(roots[0]).as_posix() if roots else absolute.name


def record(job, inputs) -> dict:
    """The provenance block of what this job writes: no date, host or absolute path in it.

    `job` is Snakemake's script object, `inputs` are the paths that it is made from. The same
    inputs give the same block on any machine, and in a workflow that uses this one as a module
    under other names of rules (`params.rule`).
    """
    # Of files of the user's stands what they held when the run was planned, which is what was read.
    planned = {name_of(path): digest for path, (digest, _) in job.params.get("content", {}).items()}
    said_elsewhere = ("code", "contract", "rule", "content")
    params = {k: value for k, value in job.params.items() if k not in said_elsewhere}
    names = {name_of(path): path for path in sorted(set(map(str, inputs)))}
    return {
        "rule": job.params.get("rule", job.rule),
        "wildcards": dict(job.wildcards.items()),
        "params": json.loads(json.dumps(params, default=str, sort_keys=True)),
        "inputs": {n: planned.get(n) or sha256_of(path) for n, path in names.items()},
        "code": job.params.get("code"),
        "contract": job.params.get("contract"),
        "environment_lock": sha256_of(LOCK),
    }


def run_facts() -> dict:
    """Version, commands that make all results, or one, again, SHA-256 of the campaign's sheets."""
    about = SCRIPTS.parent / "pyproject.toml"
    # A copy of the pipeline alone, such as an image, may lack it.
    known = tomllib.loads(about.read_text(encoding="utf-8")) if about.is_file() else {}
    own = Path.cwd() == SCRIPTS.parent
    where = "" if own else " --directory CAMPAIGN"
    sheets = [path for kind in ("*.yaml", "*.tsv") for path in sorted(Path("config").glob(kind))]
    return {
        "version": known.get("project", {}).get("version", "(version not known)"),
        "command": f"./run snakemake --cores all{where}",
        "again": f"./run snakemake --cores 2{where}",
        "sheets": {path.as_posix(): sha256_of(path) for path in sheets if path.is_file()},
    }


def assumptions() -> list[dict]:
    """Every `# ASSUME:` of the code: where it stands and what it says."""
    sentences = []
    for path in sorted(SCRIPTS.glob("cellwright/**/*.py")):
        text = path.read_text(encoding="utf-8")
        for match in re.finditer(r"# ASSUME: (.+(?:\n\s*# (?!ASSUME).+)*)", text):
            sentence = re.sub(r"\s*\n\s*# ", " ", match.group(1)).strip()
            sentences.append({"module": path.relative_to(SCRIPTS).as_posix(), "text": sentence})
    return sentences
