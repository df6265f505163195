"""The ratchet: what the code base holds grows only with a reason."""

from tools import house_counts


def test_nothing_grows_without_a_reason():
    grown = house_counts.grown(house_counts.counts(), house_counts.recorded())
    record = 'if it has to be so: ./run python scripts/tools/house_counts.py --why "…"'
    assert not grown, "\n".join([*grown, record])


def test_growth_is_more_than_a_few():
    before = {"code lines of laws": 1000, "settings": 60}
    assert not house_counts.grown({"code lines of laws": 1015, "settings": 65}, before)
    assert house_counts.grown({"code lines of laws": 1016, "settings": 60}, before) == [
        "code lines of laws: 1016, recorded 1000"
    ]
    assert house_counts.grown({"a new room": 6}, before) == ["a new room: 6, recorded 0"]


def test_docstrings_comments_and_blank_lines_are_no_code(tmp_path):
    path = tmp_path / "module.py"
    path.write_text(
        '"""What it is for.\n\nMore."""\n\nONE = 1  # one\n\n# two\nTEXT = """a\nb"""\n'
    )
    assert house_counts.code_lines(path) == 3
