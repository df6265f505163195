"""The code's hash follows what the code does, not how it is written down."""

import pytest

from runtime import provenance

SOURCES = {
    "job.py": '"""A job."""\nimport helper\n\nprint(helper.f(1))\n',
    "helper.py": "from room import deep\n\ndef f(x):\n    return deep.g(x)\n",
    "room/__init__.py": "",
    "room/deep.py": "from . import deeper\n\ndef g(x):\n    return x + deeper.ONE\n",
    "room/deeper.py": "ONE = 1\n",
    "other.py": "TWO = 2\n",
}
# A job that calls one step of the public interface, whose module alone counts.
PUBLIC = SOURCES | {
    "job.py": "import cellwright as cw\nprint(cw.first(1))\n",
    "cellwright/__init__.py": "",
    "cellwright/__init__.pyi": (
        "from cellwright.steps.one import first as first\n"
        "from cellwright.steps.two import (\n    second as second,\n)\n"
    ),
    "cellwright/steps/__init__.py": "",
    "cellwright/steps/one.py": (
        "from cellwright.steps import inputs\n"
        "def first(x):\n    from room import deep\n    return deep.g(inputs.take(x))\n"
    ),
    "cellwright/steps/two.py": "def second(x):\n    import other\n    return x\n",
    "cellwright/steps/inputs.py": "def take(x):\n    return x\n",
}


def file_of(key):
    """`room__deeper` as room/deeper."""
    return "/__init__".join(part.replace("__", "/") for part in key.split("____init__"))


def forget():
    """Files are read anew."""
    for function in vars(provenance).values():
        if hasattr(function, "cache_clear") and function is not provenance.sha256_of:
            function.cache_clear()


@pytest.fixture
def code(tmp_path, monkeypatch):
    """Hash of job.py after some of its sources were replaced."""

    def hashed(sources=SOURCES, **changes):
        for name, text in (sources | {file_of(k): v for k, v in changes.items()}).items():
            path = tmp_path / "scripts" / (name if ".py" in name else f"{name}.py")
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        forget()
        return provenance.code_of("job")

    monkeypatch.setattr(provenance, "SCRIPTS", tmp_path / "scripts")
    yield hashed
    forget()


def test_comments_and_docstrings_change_nothing(code):
    before = code()
    assert code(job='"""Other words."""\n# why\nimport helper\nprint(helper.f( 1 ))\n') == before


@pytest.mark.parametrize("change", [{"helper": "f = abs\n"}, {"room__deeper": "ONE = 2\n"}])
def test_a_changed_import_changes_the_hash(code, change):
    assert code(**change) != code()


def test_what_is_not_imported_does_not_count(code):
    assert code(other="TWO = 3\n") == code()


def test_every_assumption_is_found_with_its_place():
    found = provenance.assumptions()
    assert found
    assert all(one["text"] and one["module"].startswith("cellwright/") for one in found)


def test_a_package_beside_the_scripts_counts(code, tmp_path):
    job = {"job": "import cellwright_fmu\n"}
    package = tmp_path / "plugins" / "cellwright-fmu" / "cellwright_fmu"
    package.mkdir(parents=True)
    module = package / "__init__.py"
    module.write_text("ONE = 1\n")
    before = code(**job)
    module.write_text("ONE = 2\n")
    assert code(**job) != before
    (package / "unit.c").write_text("int one;\n")
    assert code(**job) not in (before, code())


FIRST = PUBLIC["cellwright/steps/one.py"]
SECOND = PUBLIC["cellwright/steps/two.py"]


@pytest.mark.parametrize(
    "change",
    [
        {"cellwright__steps__one": FIRST.replace("deep.g", "-deep.g")},
        {"cellwright__steps__inputs": "def take(x):\n    return +x\n"},
        {"room__deeper": "ONE = 2\n"},
    ],
    ids=["the step", "a module it takes names from", "the science below"],
)
def test_what_a_used_step_of_the_interface_runs_counts(code, change):
    assert code(PUBLIC, **change) != code(PUBLIC)


@pytest.mark.parametrize(
    "change",
    [
        {"cellwright__steps__two": SECOND.replace("return x", "return -x")},
        {"other": "TWO = 3\n"},
        {"cellwright/__init__.pyi": PUBLIC["cellwright/__init__.pyi"].replace("second", "third")},
    ],
    ids=["another step", "the science of another", "a public name"],
)
def test_what_other_steps_of_the_interface_run_does_not_count(code, change):
    assert code(PUBLIC, **change) == code(PUBLIC)


def test_a_step_in_parentheses_of_the_stub_is_found(code):
    job = {"job": "import cellwright as cw\nprint(cw.second(1))\n"}
    assert code(PUBLIC, **job, other="TWO = 3\n") != code(PUBLIC, **job)


def test_hashes_are_kept_until_a_source_changes(code, tmp_path):
    folders = [tmp_path / "kept"]
    first = {"job": code()}
    assert provenance.codes_of(["job"], folders) == first
    forget()
    (kept,) = folders[0].iterdir()
    before = kept.stat().st_mtime_ns
    assert provenance.codes_of(["job"], folders) == first
    assert provenance._parsed.cache_info().misses == 0
    assert kept.stat().st_mtime_ns == before
    changed = code(helper="f = abs\n")
    forget()
    assert provenance.codes_of(["job"], folders) == {"job": changed} != first
    forget()
    assert code() == first["job"]
    forget()
    assert provenance.codes_of(["job"], folders) == first
    assert provenance._parsed.cache_info().misses == 0, "earlier sources are known as well"


@pytest.mark.parametrize("content", ["", "{", "{}", "[]"])
def test_a_file_of_hashes_that_cannot_be_read_is_replaced(code, tmp_path, content):
    wanted = code()
    provenance.codes_of(["job"], [tmp_path / "kept"])
    (kept,) = (tmp_path / "kept").iterdir()
    kept.write_text(content)
    assert provenance.codes_of(["job"], [tmp_path / "kept"]) == {"job": wanted}
    assert wanted in kept.read_text()
