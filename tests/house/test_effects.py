"""An effect stands in its own entry: no other file of the product names it."""

import ast
from collections import defaultdict

from tree import SCRIPTS, modules, name, nodes

FILES_OF_AN_EFFECT = 3
# Words that are an effect's id and mean something else there: a scenario of a filter, a check of a
# group's channels, a tolerance of a branch's sensor, a column.
HOMONYMS = {
    "capacity_error": {"filters"},
    "current_offset": {"filters", "packs", "settings"},
    "current_gain": {"effects/groups", "packs", "settings"},
    "ocv_shift": {"circuits", "packs", "protocols"},
}


def words_of(path):
    """Names in a module, and its strings but for docstrings."""
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef)
    docs = {
        id(node.body[0].value)
        for node in nodes(path)
        if isinstance(node, documented) and ast.get_docstring(node) is not None
    }
    for node in nodes(path):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docs:
            yield node.value
        for field in ("id", "attr", "name", "arg"):
            if isinstance(word := getattr(node, field, None), str):
                yield word


def files_naming(ids):
    """Modules of the product in which each id stands, alone or before a dot: dict id → set."""
    found = defaultdict(set)
    for path in modules(SCRIPTS):
        for word in {word.partition(".")[0] for word in words_of(path)} & set(ids):
            found[word].add(name(path))
    return found


def known_ids():
    from cellwright.effects.library import known_effects

    return [effect.id for effect in known_effects()]


def named_beside_homonyms():
    found = files_naming(known_ids())
    return {
        effect: {
            path
            for path in paths
            if not any(f"cellwright/{room}/" in path for room in HOMONYMS.get(effect, ()))
        }
        for effect, paths in found.items()
    }


def test_only_the_library_names_an_effect():
    """What others ask of an effect is an attribute of its entry, in few files of it."""
    named = named_beside_homonyms()
    beyond = {
        effect: sorted(path for path in paths if "cellwright/effects/library/" not in path)
        for effect, paths in named.items()
    }
    assert not any(beyond.values()), {e: paths for e, paths in beyond.items() if paths}
    many = {e: sorted(paths) for e, paths in named.items() if len(paths) > FILES_OF_AN_EFFECT}
    assert not many, f"effects named in more than {FILES_OF_AN_EFFECT} files: {many}"


if __name__ == "__main__":
    for effect, paths in sorted(files_naming(known_ids()).items(), key=lambda p: -len(p[1])):
        print(len(paths), effect, *sorted(paths), sep="  ")
