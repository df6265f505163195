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
# A job that calls one function of the public interface, of which each counts for itself.
PUBLIC = SOURCES | {
    "job.py": "import cellwright as cw\nprint(cw.first(1))\n",
    "cellwright/__init__.py": "",
    "cellwright/__init__.pyi": (
        "from cellwright.api.steps import first as first\n"
        "from cellwright.api.steps import second as second\n"
    ),
    "cellwright/api/__init__.py": "",
    "cellwright/api/steps.py": (
        "from cellwright.api import inputs\n"
        "from cellwright.settings import One, Two\nONE = One()\n"
        "def shared(x):\n    return x\n"
        "def first(x, *, size=ONE.size):\n    from room import deep\n"
        "    return shared(deep.g(inputs.take(x)))\n"
        "def second(x):\n    import other\n    return x, Two()\n"
    ),
    "cellwright/api/inputs.py": "def take(x):\n    return x\ndef name(x):\n    return str(x)\n",
    "cellwright/settings/__init__.py": "from cellwright.settings.all import One, Two\n",
    "cellwright/settings/all.py": "class One:\n    size = 1\nclass Two:\n    size = 2\n",
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


STEPS = PUBLIC["cellwright/api/steps.py"]
INPUTS = PUBLIC["cellwright/api/inputs.py"]
SETTINGS = PUBLIC["cellwright/settings/all.py"]


@pytest.mark.parametrize(
    "change",
    [
        {"cellwright__api__steps": STEPS.replace("shared(deep", "abs(deep")},
        {"cellwright__api__steps": STEPS.replace("return x\n", "return -x\n")},
        {"cellwright__api__inputs": INPUTS.replace("return x\n", "return +x\n")},
        {"cellwright__settings__all": SETTINGS.replace("size = 1", "size = 3")},
        {"room__deeper": "ONE = 2\n"},
    ],
    ids=[
        "the function",
        "its helper",
        "a module it takes names from",
        "its settings",
        "the science below",
    ],
)
def test_what_a_used_function_of_the_interface_runs_counts(code, change):
    assert code(PUBLIC, **change) != code(PUBLIC)


@pytest.mark.parametrize(
    "change",
    [
        {"cellwright__api__steps": STEPS.replace("return x, Two()", "return x, Two(), 1")},
        {"cellwright__api__inputs": INPUTS.replace("str(x)", "repr(x)")},
        {"cellwright__settings__all": SETTINGS.replace("size = 2", "size = 3")},
        {"other": "TWO = 3\n"},
        {"cellwright____init__": PUBLIC["cellwright/__init__.py"].replace("second", "third")},
    ],
    ids=[
        "another function",
        "what it takes",
        "settings of another",
        "the science of another",
        "a public name",
    ],
)
def test_what_other_functions_of_the_interface_run_does_not_count(code, change):
    assert code(PUBLIC, **change) == code(PUBLIC)


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
