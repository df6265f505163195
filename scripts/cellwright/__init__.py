"""Characterisation of lithium-ion cells: `import cellwright as cw`; docs/api.md shows each step.

Importing the package loads nothing else: a step's module is loaded when the step is first used.
What there is stands in `__init__.pyi`, where editors find each definition.
"""

from importlib import import_module

# Lines of the stub: from MODULE import NAME as NAME.
STUB = __loader__.get_data(__file__ + "i").decode().splitlines()
MODULE_OF = {
    words[3]: words[1]
    for words in map(str.split, STUB)
    if words[:1] == ["from"] and words[1] != "cellwright"
}

__all__ = list(MODULE_OF)


def __getattr__(name: str):
    """The step or type of this name, its module loaded now."""
    if name in ("api", "settings"):
        return import_module(f"cellwright.{name}")
    if name not in MODULE_OF:
        raise AttributeError(f"cellwright has no {name!r}; it has {', '.join(MODULE_OF)}")
    return getattr(import_module(MODULE_OF[name]), name)


def __dir__():
    return sorted([*globals(), *MODULE_OF])
