"""`run`: how it installs, recovers and fails. No network: packages come from a folder of wheels."""

import hashlib
import importlib.util
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import pytest

RUN = Path(__file__).resolve().parents[2] / "run"
TOOLS = "sh dirname sha256sum sed cut mkdir df awk grep rm mv cp tail tr cat printf env sleep"


def wheel(folder, name, version="1.0"):
    """A package of one empty module; returns its line of a lock."""
    path = folder / f"{name}-{version}-py3-none-any.whl"
    info = f"{name}-{version}.dist-info"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(f"{name}.py", "")
        archive.writestr(
            f"{info}/METADATA", f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n"
        )
        archive.writestr(f"{info}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: any\n")
        archive.writestr(f"{info}/RECORD", "")
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    return f"{name}=={version} \\\n    --hash=sha256:{digest}\n"


@pytest.fixture(scope="session")
def fresh(tmp_path_factory):
    """An environment with pip alone, this one's, where `python -m venv` takes seconds to unpack."""
    folder = tmp_path_factory.mktemp("fresh") / "venv"
    command = [sys.executable, "-m", "venv", "--without-pip", str(folder)]
    subprocess.run(command, check=True)
    pip = Path(importlib.util.find_spec("pip").origin).parent
    (packages,) = folder.glob("lib/python*/site-packages")
    for part in (pip, *pip.parent.glob("pip-*.dist-info")):
        shutil.copytree(part, packages / part.name)
    return folder


@pytest.fixture(scope="module")
def quick(fresh, tmp_path_factory):
    """A PATH whose python3 copies such an environment instead of making one, and is Python else."""
    real = Path(getattr(sys, "_base_executable", None) or sys.executable).resolve()
    program = f"""#!/bin/sh
case "$*" in
*ensurepip*) echo 3.11; echo "$0" ;;
"-m venv"*) cp -Rp "{fresh}" "$3" ;;
*) exec {real} "$@" ;;
esac
"""
    folder = tmp_path_factory.mktemp("quick")
    (folder / "python3").write_text(program)
    (folder / "python3").chmod(0o755)
    return f"{folder}:{os.environ['PATH']}"


@pytest.fixture
def clone(tmp_path):
    """A folder like a fresh clone, with a lock of two small packages."""
    return cloned(tmp_path)


@pytest.fixture(scope="module")
def installed(tmp_path_factory, quick):
    """A clone whose environment is installed in it, for tests that install no other over it."""
    folder = cloned(tmp_path_factory.mktemp("installed"))
    assert run(folder, "true", path=quick, HOME="").returncode == 0
    return folder


def cloned(place):
    wheels = place / "wheels"
    wheels.mkdir()
    folder = place / "clone with space"
    folder.mkdir()
    (folder / "run").write_bytes(RUN.read_bytes())
    (folder / "run").chmod(0o755)
    (folder / "environment.lock").write_text(wheel(wheels, "setuptools") + wheel(wheels, "tiny"))
    return folder


def command(clone, *arguments, path=None, **variables):
    environment = {
        "PATH": path or os.environ["PATH"],
        "PIP_NO_INDEX": "1",
        "PIP_FIND_LINKS": str(clone.parent / "wheels"),
        "PIP_CONFIG_FILE": "/dev/null",
        **variables,
    }
    return {"args": [str(clone / "run"), *arguments], "env": environment}


def run(clone, *arguments, path=None, **variables):
    call = command(clone, *arguments, path=path, **variables)
    return subprocess.run(**call, capture_output=True, text=True, timeout=120, check=False)


def _cpu_second_of_children():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def bin_with(folder, **programs):
    """A PATH of the plain tools and the programs given as shell texts."""
    folder.mkdir()
    for tool in TOOLS.split():
        found = next((p for d in ("/usr/bin", "/bin") if (p := Path(d) / tool).exists()), None)
        if found:
            (folder / tool).symlink_to(found)
    for name, text in programs.items():
        (folder / name).write_text(f"#!/bin/sh\n{text}\n")
        (folder / name).chmod(0o755)
    return str(folder)


@pytest.mark.slow
def test_installs_once_recovers_from_a_kill_and_waits_for_another(clone):
    call = command(clone, "python", "-c", "import tiny; print('ran')", HOME="")
    killed = subprocess.Popen(**call, start_new_session=True, stderr=subprocess.DEVNULL)
    time.sleep(1.5)
    os.killpg(killed.pid, signal.SIGKILL)
    killed.wait()
    assert not list(clone.glob(".venv-*/complete"))
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    both = [subprocess.Popen(**call, **pipes) for _ in range(2)]
    output = [process.communicate(timeout=120) for process in both]
    assert [out for out, _ in output] == ["ran\n"] * 2, output
    assert sorted("installing 2 packages" in err for _, err in output) == [False, True]
    start = _cpu_second_of_children()
    again = run(clone, "python", "-c", "import tiny, sys; print(sys.prefix)", HOME="")
    assert _cpu_second_of_children() - start < 1.0
    assert Path(again.stdout.strip()).parent == clone
    assert again.stderr == ""
    assert run(clone, "sh", "-c", "exit 7", HOME="").returncode == 7


@pytest.mark.parametrize(
    ("build", "said"),
    [("return True", ""), ("return False", "numpy"), ("raise OSError('no space')", "numpy")],
)
def test_kernels_are_compiled_by_the_install_and_without_them_all_goes_on(
    clone, quick, build, said
):
    native = clone / "scripts" / "cellwright" / "native"
    native.mkdir(parents=True)
    (native.parent / "__init__.py").write_text("")
    (native / "__init__.py").write_text(f"def build():\n    print('built')\n    {build}\n")
    first, second = (run(clone, "echo", "ran", path=quick, HOME="") for _ in range(2))
    assert (first.returncode, first.stdout) == (0, "built\nran\n")
    assert (second.returncode, second.stdout, second.stderr) == (0, "ran\n", "")
    assert ("no compiled kernels" in first.stderr) == bool(said)
    assert said in first.stderr


@pytest.mark.slow
def test_a_home_keeps_the_environment(clone, tmp_path, quick):
    home = tmp_path / "home"
    home.mkdir()
    assert run(clone, "true", path=quick, HOME=str(home)).returncode == 0
    assert len(list(home.glob(".cache/cellwright/*/complete"))) == 1
    assert not list(clone.glob(".venv*"))


@pytest.mark.slow
def test_a_package_that_differs_is_refused(clone, quick):
    lock = clone / "environment.lock"
    head, _, digest = lock.read_text().rpartition("sha256:")
    lock.write_text(f"{head}sha256:{'0' * len(digest.strip())}\n")
    result = run(clone, "true", path=quick)
    assert result.returncode == 1
    assert "differs from the one in environment.lock" in result.stderr
    assert not list(clone.glob(".venv-*/complete"))


@pytest.mark.slow
def test_no_index_that_answers_is_named(clone, quick):
    nobody = {"PIP_NO_INDEX": "0", "PIP_FIND_LINKS": "", "PIP_RETRIES": "0"}
    nobody["PIP_INDEX_URL"] = "http://127.0.0.1:9/simple"
    result = run(clone, "true", path=quick, **nobody)
    assert result.returncode == 1
    assert "no package index answers" in result.stderr


@pytest.mark.slow
def test_a_package_that_the_index_has_not_is_named(clone, quick):
    wheels = clone.parent / "wheels"
    (wheels / "tiny-1.0-py3-none-any.whl").unlink()
    wheel(wheels, "tiny", "2.0")
    said = run(clone, "true", path=quick).stderr
    assert "the package index has no such package for Python 3" in said


@pytest.mark.parametrize(
    ("about", "expected"),
    [
        ("echo 3.9; echo /opt/python3; echo older than 3.11; exit 1", "3.9 older than 3.11"),
        ("echo 3.11; echo /p; echo without its venv module >&2; exit 1", "without its venv"),
    ],
)
def test_an_unfit_python_is_named(clone, tmp_path, about, expected):
    path = bin_with(tmp_path / "bin", python3=about)
    result = run(clone, "true", path=path)
    assert result.returncode == 1
    assert "Python 3.11 or newer with its venv module is needed" in result.stderr
    assert expected in result.stderr
    assert str(tmp_path / "bin" / "python3") in result.stderr


def test_no_python_at_all_is_named(clone, tmp_path):
    result = run(clone, "true", path=bin_with(tmp_path / "bin"))
    assert result.returncode == 1
    assert "no Python at all" in result.stderr


@pytest.mark.slow
def test_a_later_python_is_found_and_the_hash_needs_only_python(clone, tmp_path, quick):
    later = f'exec {quick.partition(":")[0]}/python3 "$@"'
    found = {"python3": "echo 3.9; echo /p; exit 1", "python3.11": later}
    path = bin_with(tmp_path / "bin", **found)
    (tmp_path / "bin" / "sha256sum").unlink()
    assert run(clone, "python", "-c", "import tiny", path=path).returncode == 0
    digest = hashlib.sha256((clone / "environment.lock").read_bytes()).hexdigest()
    assert (clone / f".venv-{digest[:16]}" / "complete").exists()


def test_a_full_disk_is_named_before_anything_is_written(clone, tmp_path):
    full = "echo Filesystem 1024-blocks Used Available; echo d 100 90 10000 90% /"
    tools = {"python3": f'exec {sys.executable} "$@"', "df": full}
    (tmp_path / "bin").mkdir()
    for name, text in tools.items():
        (tmp_path / "bin" / name).write_text(f"#!/bin/sh\n{text}\n")
        (tmp_path / "bin" / name).chmod(0o755)
    result = run(clone, "true", path=f"{tmp_path / 'bin'}:{os.environ['PATH']}")
    assert result.returncode == 1
    assert "disk full" in result.stderr
    assert not list(clone.glob(".venv-*/bin"))


def test_a_disk_that_fills_up_is_named(clone, tmp_path):
    program = f"""case "$*" in
*ensurepip*) echo 3.11; echo "$0" ;;
*"-m venv"*) mkdir -p "$3/bin"; cp "$0" "$3/bin/python" ;;
*"-m pip"*) echo "OSError: [Errno 28] No space left on device"; exit 1 ;;
*) exec {sys.executable} "$@" ;;
esac"""
    path = bin_with(tmp_path / "bin", python3=program)
    result = run(clone, "true", path=path)
    assert result.returncode == 1
    assert "is full: about 1.5 GB are needed" in result.stderr


def test_nothing_to_run_is_told(clone):
    result = run(clone)
    assert result.returncode == 1
    assert "./run snakemake --cores 2" in result.stderr


@pytest.mark.parametrize("asked", [["--directory", "typo"], ["--directory=typo"], ["-d", "typo"]])
def test_a_folder_that_is_not_there_is_told_before_anything_else(clone, asked):
    """Snakemake would make it, and begin an empty campaign in it."""
    found = run(clone, "snakemake", "--cores", "2", *asked)
    assert found.returncode == 1
    assert "--directory typo: there is no such folder, wanted that of a campaign" in found.stderr
    assert "first start" not in found.stderr


@pytest.mark.slow
def test_a_folder_is_told_of_only_where_it_is_not_there(installed, quick):
    program = installed / "snakemake"
    program.write_text('#!/bin/sh\necho "ran $*"\n')
    program.chmod(0o755)
    path = f"{installed}:{quick}"
    for asked in (["-d", str(installed)], ["-s", "other", "-d", "typo"], ["--cores", "2"]):
        found = run(installed, "snakemake", *asked, path=path, HOME="")
        assert found.stdout == f"ran {' '.join(asked)}\n", found.stderr
    campaign = installed / "campaign"
    campaign.mkdir()
    call = command(installed, "snakemake", "--cores", "2", path=path, HOME="")
    said = subprocess.run(**call, cwd=campaign, capture_output=True, text=True, check=True).stdout
    assert said == f"ran --snakefile {installed}/Snakefile --cores 2\n", "no Snakefile there"


@pytest.mark.slow
def test_the_laboratory_has_an_environment_of_its_own(installed, quick):
    clone, wheels = installed, installed.parent / "wheels"
    lock = wheel(wheels, "setuptools") + wheel(wheels, "simulator")
    (clone / "environment-lab.lock").write_text(lock)
    ran = run(clone, "--lab", "python", "-c", "import simulator; print('ran')", path=quick, HOME="")
    assert ran.stdout == "ran\n", ran.stderr
    assert run(clone, "python", "-c", "import simulator", path=quick, HOME="").returncode == 1


@pytest.mark.slow
def test_scripts_of_a_workflow_start_with_their_packages_unless_a_profile_is_named(
    installed, quick
):
    """By a profile in the environment, which a command line's or the user's own replaces."""
    clone = installed
    said = ["sh", "-c", 'echo "$PYTHONPATH $SNAKEMAKE_PROFILE"']
    ours = f"{clone}/workflow/profiles/warm"
    folders = ("scripts", "lab", "plugins/snakemake-executor-plugin-warm", "plugins/cellwright-fmu")
    paths = ":".join(f"{clone}/{folder}" for folder in folders)
    assert run(clone, *said, path=quick, HOME="").stdout == f"{paths} {ours}\n"
    own = run(clone, *said, path=quick, HOME="", SNAKEMAKE_PROFILE="own")
    assert own.stdout == f"{paths} own\n"
    (clone / "environment-lab.lock").write_text((clone / "environment.lock").read_text())
    lab = run(clone, "--lab", *said, path=quick, HOME="", SNAKEMAKE_PROFILE=ours)
    assert lab.stdout == f"{paths} \n"  # the laboratory's scripts need other packages


@pytest.mark.slow
def test_bytecode_is_kept_in_the_environment_where_the_folders_shall_have_none(installed, quick):
    clone = installed
    said = ["sh", "-c", 'echo "${PYTHONDONTWRITEBYTECODE-none} ${PYTHONPYCACHEPREFIX-none}"']
    usual = run(clone, *said, path=quick, HOME="")
    assert usual.stdout == "none none\n", usual.stderr
    wished = {"HOME": "", "PYTHONDONTWRITEBYTECODE": "1"}
    found = run(clone, *said, path=quick, **wished).stdout
    assert re.fullmatch(rf"none {re.escape(str(clone))}/\.venv-\w+/bytecode\n", found)
    own = run(clone, *said, path=quick, **wished, PYTHONPYCACHEPREFIX="/own")
    assert own.stdout == "none /own\n"
