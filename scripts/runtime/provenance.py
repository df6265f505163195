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


def files_of(folder) -> dict[str, str]:
    """SHA-256 of each file below a folder of the clone, by its path there; no bytecode."""
    files = sorted(path for path in Path(folder).rglob("*") if path.is_file())
    kept_files = [path for path in files if path.suffix != ".pyc"]
    return {path.relative_to(folder).as_posix(): sha256_of(path) for path in kept_files}


PUBLIC = re.compile(r"from (\S+) import \(?\s*(\w+)")  # a line of the stub of a package
MESSAGES = ".toml"  # of a module whose sentences stand in the file of its name
IMPORTS = (ast.Import, ast.ImportFrom)


@cache
def code_of(script: str) -> str:
    """Hash of the code that `scripts/<script>.py` runs: itself and all it imports of ours.

    Hashed is the syntax tree without docstrings, so that comments, layout and documentation
    change nothing, and a changed formula in any imported module changes the hash.
    """
    # Sorted: the order in which imports are walked must not count.
    digests = [digest_of(path) for path in sorted(modules_of(script))]
    return hashlib.sha256("".join(digests).encode()).hexdigest()[:16]


@cache
def digest_of(path: Path) -> str:
    """SHA-256 of a module's place and syntax tree, its package's C sources, and its messages."""
    digest = hashlib.sha256(_place(path).as_posix().encode())
    digest.update(ast.dump(_parsed(path)).encode())
    package = path.name == "__init__.py"  # it builds the C sources in its folder
    beside = sorted(path.parent.glob("*.[ch]")) if package else []
    for source in [*beside, *filter(Path.is_file, [path.with_suffix(MESSAGES)])]:
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


def modules_of(script: str) -> set[Path]:
    """The modules that `scripts/<script>.py` runs, itself among them."""
    reached, waiting = set(), [SCRIPTS / f"{script}.py"]
    while waiting:
        path = waiting.pop()
        if path not in reached:
            reached.add(path)
            waiting += _needs(path)
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
def _needs(path: Path) -> frozenset:
    """The modules of ours that a module imports, at once or in a function."""
    nodes, package = list(ast.walk(_parsed(path))), _place(path).parent.parts
    names = [name for node in nodes for name in _imported(node, package)]
    # `cw.capacity` is an attribute of a package, and names the module of that step alone.
    names += _attributes_of_modules(nodes)
    return frozenset(module for name in names for module in _modules_named(name)) - {path}


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
def _modules_named(name: str) -> frozenset:
    """The module of a dotted name and each package above it, where they are ours."""
    parts = name.split(".")
    root = next((root for root in _roots() if _holds(root, parts[0])), SCRIPTS)
    stems = [root.joinpath(*parts[:end]) for end in range(1, len(parts) + 1)]
    files = [stem / "__init__.py" for stem in stems] + [stems[-1].with_suffix(".py")]
    found = frozenset(file for file in files if file.is_file())
    public = _public(stems[-2]).get(parts[-1]) if len(stems) > 1 else None
    return found | _modules_named(public) if public else found


@cache
def _public(package: Path) -> dict[str, str]:
    """Module of each name that a package takes from its modules at first use, by its stub."""
    stub = package / "__init__.pyi"
    text = stub.read_text(encoding="utf-8") if stub.exists() else ""
    # What it takes from itself are modules, found by their place.
    return {name: module for module, name in PUBLIC.findall(text) if module != package.name}


def _holds(root: Path, package: str) -> bool:
    """Whether a package or module of this name lies in a folder."""
    return (root / package).is_dir() or (root / f"{package}.py").is_file()


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
