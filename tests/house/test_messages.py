"""Sentences stand in tables of messages: each is used, and each that is used is there."""

import re
import string
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2] / "scripts" / "cellwright"
TABLES = sorted(ROOT.rglob("messages.toml"))
# What may word the codes of a room: itself, and the jobs that write tables and the report.
OUTSIDE = Path(__file__).resolve().parents[2] / "scripts" / "runtime"


def codes_of(table):
    texts = tomllib.loads(table.read_text(encoding="utf-8"))
    return {f"{head}.{name}": text for head, part in texts.items() for name, text in part.items()}


def sources_of(table):
    room = table.parent.rglob("*.py")
    return "\n".join(path.read_text(encoding="utf-8") for path in [*room, *OUTSIDE.glob("*.py")])


@pytest.mark.parametrize("table", TABLES, ids=lambda path: path.parent.name)
def test_every_message_is_used_and_every_code_that_is_used_has_one(table):
    codes, source = codes_of(table), sources_of(table)
    literal = set(re.findall(r'"([a-z_]+\.[a-z_]+)"', source))
    made = set(re.findall(r'f"([a-z_]+)\.[a-z_]*\{', source))
    unused = {c for c in codes if c not in literal and c.partition(".")[0] not in made}
    heads = {code.partition(".")[0] for code in codes}
    said = {c for c in re.findall(r'\bsay\(\s*"([a-z_.]+)"', source) if c.split(".")[0] in heads}
    assert unused == set()
    assert said - codes.keys() == set()


@pytest.mark.parametrize("table", TABLES, ids=lambda path: path.parent.name)
def test_every_message_names_its_fields_and_no_internal_id(table):
    for code, text in codes_of(table).items():
        fields = [name for _, name, _, _ in string.Formatter().parse(text) if name is not None]
        assert all(re.fullmatch(r"[a-z_]+", name) for name in fields), code
        bare = re.sub(r"\{[^}]*\}", "", text)
        assert re.search(r"[a-z]_[a-z]", bare) is None, code
