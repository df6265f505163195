"""Characterisation of lithium-ion cells: `import cellwright as cw`, then `help(cw.capacity)`.

Importing the package loads nothing else: a step's module is loaded when the step is first used.
What there is stands in `__init__.pyi`, where editors find each definition.
"""

import re
from importlib import import_module

# The stub has of each name: from MODULE import NAME as NAME, in parentheses where that is long.
STUB = __loader__.get_data(__file__ + "i").decode()
MODULE_OF = {
    name: module for module, name in re.findall(r"from (cellwright\.\S+) import \(?\s*(\w+)", STUB)
}

__all__ = list(MODULE_OF)
SHOWN = set()  # steps whose docstring has what all of them share by now


def __getattr__(name: str):
    """The step or type of this name, its module loaded now."""
    if name == "__version__":
        return _version()
    if name in ("api", "settings"):
        return import_module(f"cellwright.{name}")
    if name not in MODULE_OF:
        from difflib import get_close_matches

        close = get_close_matches(name, MODULE_OF, 1)
        what = f"did you mean {close[0]}?" if close else f"it has {', '.join(MODULE_OF)}"
        raise AttributeError(f"cellwright has no {name!r}; {what}")
    found = getattr(import_module(MODULE_OF[name]), name)
    if name not in SHOWN and callable(found) and not isinstance(found, type):
        api, settings, shown = (
            import_module(f"cellwright.{room}") for room in ("api", "settings", "api.stand_alone")
        )
        SHOWN.add(name)
        found.__doc__ = shown.completed(found, api.__doc__, settings)
    return found


def _version() -> str:
    """Of the clone that this is; of an installed package what it was installed as."""
    from importlib.metadata import version

    try:
        project = __loader__.get_data(f"{__path__[0]}/../../pyproject.toml").decode()
    except OSError:  # no clone
        return version(__name__)
    about = re.search(r'^name = "cellwright"\nversion = "(.+)"', project, re.MULTILINE)
    return about[1] if about else version(__name__)


def __dir__():
    return sorted([*globals(), *MODULE_OF, "__version__"])
