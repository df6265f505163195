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


@pytest.fixture
def code(tmp_path, monkeypatch):
    """Hash of job.py after some of its sources were replaced."""

    def hashed(**changes):
        for name, text in (SOURCES | {k.replace("__", "/"): v for k, v in changes.items()}).items():
            path = tmp_path / (name if name.endswith(".py") else f"{name}.py")
            path.parent.mkdir(exist_ok=True)
            path.write_text(text)
        for function in (provenance.code_of, provenance._imports, provenance._tree_dump):
            function.cache_clear()
        return provenance.code_of("job")

    monkeypatch.setattr(provenance, "SCRIPTS", tmp_path)
    yield hashed
    for function in (provenance.code_of, provenance._imports, provenance._tree_dump):
        function.cache_clear()


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
