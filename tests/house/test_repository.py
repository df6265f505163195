"""Laws of what is committed: no machine's path, no package host, free licences, whole hashes."""

import importlib.metadata
import re
import subprocess

import pytest
from tree import ROOT, committed, name

MACHINE = re.compile(r"(?<![\w.:])/(home|root|work|Users|opt|mnt)/\w|/tmp/w\b")
HOST = re.compile(r"pypi\.org|pythonhosted|anaconda\.(org|com)|--(extra-)?index-url|--find-links")
TEXT = re.compile(r"\.(py|smk|sh|md|ya?ml|toml|lock|in|cff|tsv|csv|j2|html)$|(^|/)(run|Snakefile)$")
LOCK = (ROOT / "environment.lock").read_text(encoding="utf-8")
LOCKED = re.findall(r"^([a-z0-9][\w.-]*)==([^ ;\\]+)", LOCK, re.M)


def readable():
    """Texts of ours; tests may name machines and hosts in order to forbid them."""
    for path in committed():
        if TEXT.search(name(path)) and not name(path).startswith(("tests/", "lab/tests/", "data/")):
            yield path, path.read_text(encoding="utf-8", errors="replace")


@pytest.fixture(scope="module", autouse=True)
def _in_a_repository():
    try:
        committed()
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("not a git repository")


def test_no_path_of_a_machine_and_no_package_host():
    for path, text in readable():
        for number, line in enumerate(text.splitlines(), 1):
            where = f"{name(path)}:{number}: {line.strip()[:90]}"
            assert not MACHINE.search(line), f"path of a machine: {where}"
            assert not HOST.search(line), f"package host: {where}"


def test_no_large_file():
    large = {name(p): p.stat().st_size for p in committed() if p.stat().st_size > 2_000_000}
    assert not large


def test_every_locked_package_has_hashes_and_no_address():
    blocks = re.split(r"^(?=[a-z0-9])", LOCK, flags=re.M)[1:]
    assert len(blocks) == len(LOCKED)
    assert all("--hash=sha256:" in block for block in blocks)
    assert "://" not in LOCK


def versions(lock):
    """Versions of each package of a lock; more than one where it depends on the platform."""
    text = (ROOT / lock).read_text(encoding="utf-8")
    assert "://" not in text
    assert text.count("--hash=sha256:") > text.count("==")
    found = {}
    for package, version in re.findall(r"^([a-z0-9][\w.-]*)==([^ ;\\]+)", text, re.M):
        found.setdefault(package, set()).add(version)
    return found


# The client of object storage needs an older one.
OTHER_VERSIONS = {
    "environment-cluster.lock": set(),
    "environment-cloud.lock": {"python-dateutil"},
    "environment-docs.lock": set(),
}


@pytest.mark.parametrize("lock", OTHER_VERSIONS)
def test_jobs_elsewhere_compute_with_the_same_versions(lock):
    here, there = versions("environment.lock"), versions(lock)
    assert {package for package in here if there.get(package) != here[package]} == (
        OTHER_VERSIONS[lock]
    )


def test_the_lock_holds_what_is_asked_for():
    lines = (ROOT / "environment.in").read_text(encoding="utf-8").splitlines()
    asked = {re.match(r"[\w.-]+", line)[0] for line in lines if line and not line.startswith("#")}
    assert asked <= {package for package, _ in LOCKED}


def licences(package: str) -> list[str]:
    """What a package says of its licence, its choices apart."""
    about = importlib.metadata.metadata(package)
    classifiers = [c for c in about.get_all("Classifier", []) if c.startswith("License")]
    if about.get("License-Expression"):
        return re.split(r" OR ", about["License-Expression"])
    return classifiers or [about.get("License", "").split("\n")[0]]


@pytest.mark.parametrize("package", sorted({package for package, _ in LOCKED}))
def test_no_locked_package_is_under_the_gpl(package):
    """Where a package offers a choice, one free choice is enough; the LGPL does not bind us."""
    try:
        offered = licences(package)
    except importlib.metadata.PackageNotFoundError:
        pytest.skip("for other platforms only")
    bound = [bool(re.search(r"(?<!L)GPL|(?<!Lesser )General Public", text)) for text in offered]
    assert not all(bound), f"{package}: {offered}"


def test_run_is_a_plain_shell_script():
    subprocess.run(["sh", "-n", ROOT / "run"], check=True)
    assert (ROOT / "run").stat().st_mode & 0o111
