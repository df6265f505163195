"""What others' tools read: catalog of workflows, image, dialect of the schemas, package."""

import ast
import json
import re
import shutil
import subprocess
import sys
import tomllib
from fnmatch import fnmatch
from pathlib import Path

import pytest
import yaml
from jsonschema import Draft202012Validator

sys.path.insert(0, str(Path(__file__).parent))
import starts
import tiny

from runtime import artefact, settings

ROOT = Path(__file__).resolve().parents[2]
SCHEMAS = ROOT / "workflow" / "schemas"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
RECIPE = (ROOT / "container" / "Dockerfile").read_text(encoding="utf-8")
# Where the scripts of each file of rules lie: of the pipeline, and of the laboratory.
SCRIPTS_OF_RULES = {
    f"{folder}/{path.stem}"
    for folder, rules in {"scripts": "workflow/rules", "lab": "lab/rules"}.items()
    for path in (ROOT / rules).glob("*.smk")
}


def test_the_catalog_says_how_packages_are_deployed_as_the_rules_do():
    stack = yaml.safe_load((ROOT / ".snakemake-workflow-catalog.yml").read_text(encoding="utf-8"))[
        "usage"
    ]["software-stack-deployment"]
    texts = [path.read_text(encoding="utf-8") for path in (ROOT / "workflow").rglob("*.smk")]
    directives = set(re.findall(r"^\s*(conda|container|containerized):", "\n".join(texts), re.M))
    assert stack["conda"] is ("conda" in directives)
    assert stack["apptainer"] is bool(directives & {"container", "containerized"})
    # The other two things that the catalog asks of a workflow of standardized usage.
    assert (ROOT / "workflow" / "Snakefile").is_file()
    assert (ROOT / "config" / "README.md").is_file()


def test_the_image_is_made_of_files_that_exist_and_installs_with_hashes():
    copied = re.findall(r"^COPY (\S+) /cellwright/(\S+)$", RECIPE, re.M)
    assert ("environment.lock", "environment.lock") in copied
    assert all(source == target and (ROOT / source).exists() for source, target in copied)
    command = " ".join(re.search(r"pip install(.*?)\|\|", RECIPE, re.S)[1].split())
    assert {"--require-hashes", "--no-deps"} <= set(command.split())
    assert '--requirement "/cellwright/$list"' in command
    assert "for list in build.txt environment.lock" in RECIPE
    assert "://" not in RECIPE
    assert "NOT BUILT" in RECIPE


def test_the_image_has_every_part_of_the_repository_that_rules_name():
    texts = [p.read_text(encoding="utf-8") for p in (ROOT / "workflow" / "rules").glob("*.smk")]
    joined = "\n".join(texts).replace('" / "', "/")
    named = set(re.findall(r"PIPELINE(?:\}/| / \"|, \")([\w/-]+)", joined))
    assert {"scripts", "tests/artefacts", "workflow/report"} <= named
    copied = re.findall(r"^COPY (\S+) /cellwright/", RECIPE, re.M)
    assert not [one for one in named if not any(f"{one}/".startswith(f"{c}/") for c in copied)]


@pytest.mark.slow
def test_the_files_of_the_image_are_enough_to_run_its_command(tmp_path):
    """As the image lays them out, in another place, with the packages of this environment."""
    image = tmp_path / "cellwright"
    for source in re.findall(r"^COPY (\S+) /cellwright/", RECIPE, re.M):
        copy = shutil.copytree if (ROOT / source).is_dir() else shutil.copy
        (image / source).parent.mkdir(parents=True, exist_ok=True)
        copy(ROOT / source, image / source)
    entry = json.loads(re.search(r"^ENTRYPOINT (.*?\])$", RECIPE.replace("\\\n", ""), re.M)[1])
    command = [word.replace("/cellwright", str(image)) for word in entry[1:]]
    campaign = tiny.write(tmp_path / "campaign")
    assert entry[0] == "snakemake"
    artefact_of_b = "results/stages/capacity/B/capacity.parquet"
    asked = {"folder": campaign, "environment": starts.plain()}
    done = starts.anew(*command, "--cores", "1", artefact_of_b, **asked)
    assert done.status == 0, done.said
    assert artefact.read_about(campaign / artefact_of_b)["reason"] is None


@pytest.mark.parametrize("name", ["cells", "tests", "groups", "checkups", "config"])
def test_a_schema_names_its_dialect_and_is_valid_in_it(name):
    schema = settings.load(SCHEMAS, name)
    assert schema["$schema"] == Draft202012Validator.META_SCHEMA["$id"]
    Draft202012Validator.check_schema(schema)
    assert next(iter(schema)) == "$schema"


# What a wheel would hold by pyproject.toml, without building one. In a process of its own, for
# setuptools does not know a distutils that anything else has imported before.
LISTED = """
import sys
from setuptools import Distribution
from setuptools.config.pyprojecttoml import apply_configuration
distribution = Distribution({"script_name": "setup.py"})
apply_configuration(distribution, "pyproject.toml")
build = distribution.get_command_obj("build_py")
build.build_lib = sys.argv[1]
build.ensure_finalized()
data = [f"{folder}/{file}" for _, folder, _, names in build.data_files for file in names]
print("\\n".join([*build.get_source_files(), *data]))
"""


@pytest.fixture(scope="module")
def packaged(tmp_path_factory):
    """Files below scripts/ that a wheel would hold."""
    command = [sys.executable, "-c", LISTED, str(tmp_path_factory.mktemp("wheel"))]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    files = [(ROOT / line).resolve() for line in done.stdout.splitlines()]
    return {file.relative_to(ROOT / "scripts").as_posix() for file in files}


def test_the_package_is_the_whole_science_and_nothing_else(packaged):
    science = ROOT / "scripts" / "cellwright"
    wanted = {
        path.relative_to(ROOT / "scripts").as_posix()
        for path in science.rglob("*")
        if path.suffix in (".py", ".pyi", ".typed", ".c", ".h", ".toml")
    }
    assert len([file for file in wanted if file.endswith(".c")]) >= 6
    assert packaged == wanted


def test_the_package_asks_for_what_it_imports(packaged):
    asked = PROJECT["project"]["dependencies"]
    assert set(asked) <= set((ROOT / "environment.in").read_text(encoding="utf-8").splitlines())
    trees = [ast.parse((ROOT / "scripts" / f).read_bytes()) for f in packaged if f.endswith(".py")]
    nodes = [node for tree in trees for node in ast.walk(tree)]
    imported = {a.name.split(".")[0] for n in nodes if isinstance(n, ast.Import) for a in n.names}
    imported |= {
        n.module.split(".")[0] for n in nodes if isinstance(n, ast.ImportFrom) and n.module
    }
    foreign = imported - set(sys.stdlib_module_names) - {"cellwright"}
    known = {re.match(r"[\w-]+", one)[0].replace("-", "_") for one in asked}
    assert {"numpy", "scipy"} <= foreign <= known


def test_only_scripts_of_rules_may_use_a_name_that_nobody_defines():
    ignored = PROJECT["tool"]["ruff"]["lint"]["per-file-ignores"]
    assert all(codes == ["F821"] for codes in ignored.values())
    paths = [path for folder in ("scripts", "lab") for path in (ROOT / folder).rglob("*.py")]
    scripts = [path.relative_to(ROOT).as_posix() for path in paths]
    scripts_of_rules = [s for s in scripts if "/".join(s.split("/")[:2]) in SCRIPTS_OF_RULES]
    for pattern in ignored:
        matched = [script for script in scripts if fnmatch(script, pattern)]
        assert matched, f"{pattern} matches no script: remove it"
        assert set(matched) <= set(scripts_of_rules), f"{pattern} matches more than rules run"
    assert scripts_of_rules
    for script in scripts_of_rules:
        assert any(fnmatch(script, pattern) for pattern in ignored), f"{script} is not named"
