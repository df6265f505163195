"""What an artefact was made from: hashes of files, of code, of the environment."""

import ast
import hashlib
import json
import re
from functools import cache
from pathlib import Path

SCRIPTS = Path(__file__).resolve().parents[1]
LOCK = SCRIPTS.parent / "environment.lock"


@cache
def sha256_of(path) -> str:
    """SHA-256 of a file's bytes, as hexadecimal digits."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


@cache
def code_of(script: str) -> str:
    """Hash of the code that `scripts/<script>.py` runs: itself and all it imports from here.

    Hashed is the syntax tree without docstrings, so that comments, layout and documentation
    change nothing, and a changed formula in any imported module changes the hash.
    """
    digest = hashlib.sha256()
    for path in sorted(_closure(SCRIPTS / f"{script}.py", frozenset())):
        digest.update(path.relative_to(SCRIPTS).as_posix().encode())
        digest.update(_tree_dump(path).encode())
        for source in _compiled_by(path):
            digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


def _compiled_by(path: Path) -> list[Path]:
    """C sources that a package builds: those beside its `__init__`."""
    return sorted(path.parent.glob("*.c")) if path.name == "__init__.py" else []


def _closure(path: Path, seen: frozenset) -> frozenset:
    seen = seen | {path}
    for imported in _imports(path) - seen:
        if imported not in seen:
            seen = _closure(imported, seen)
    return seen


@cache
def _imports(path: Path) -> frozenset:
    package = path.parent.relative_to(SCRIPTS).parts
    files = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = list(package[: len(package) - node.level + 1]) if node.level else []
            stem = ".".join([*base, *([node.module] if node.module else [])])
            names = [stem, *(f"{stem}.{alias.name}" for alias in node.names)]
        else:
            continue
        for name in names:
            files |= _files_of(name)
    return frozenset(files)


def _files_of(name: str) -> set[Path]:
    """The module's file and the `__init__` of each package on the way, where they are ours."""
    parts = name.split(".")
    stems = [SCRIPTS.joinpath(*parts[:end]) for end in range(1, len(parts) + 1)]
    files = [stem / "__init__.py" for stem in stems] + [stems[-1].with_suffix(".py")]
    return {file for file in files if file.is_file()}


@cache
def _tree_dump(path: Path) -> str:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list) and body and _is_docstring(body[0]):
            node.body = body[1:]
    return ast.dump(tree)


def _is_docstring(node) -> bool:
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )


def _name(path: str) -> str:
    """Path relative to the campaign, or to the repository for what lies there."""
    absolute = Path(path).resolve()
    roots = [root for root in (Path.cwd(), SCRIPTS.parent) if absolute.is_relative_to(root)]
    return absolute.relative_to(roots[0]).as_posix() if roots else absolute.name


def record(job) -> dict:
    """The provenance block of what this job writes: no date, host or absolute path in it.

    `job` is Snakemake's script object. The same inputs give the same block on any machine, and in
    a workflow that uses this one as a module under other names of rules (`params.rule`).
    """
    own = ("code", "contract", "rule")
    params = {k: value for k, value in job.params.items() if k not in own}
    return {
        "rule": job.params.get("rule", job.rule),
        "wildcards": dict(job.wildcards.items()),
        "params": json.loads(json.dumps(params, default=str, sort_keys=True)),
        "inputs": {_name(path): sha256_of(path) for path in sorted(set(map(str, job.input)))},
        "code": job.params.get("code"),
        "contract": job.params.get("contract"),
        "environment_lock": sha256_of(LOCK),
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
