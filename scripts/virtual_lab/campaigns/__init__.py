"""The campaigns that the laboratory can make, by name, and their options."""

from importlib import import_module
from typing import Any

from virtual_lab.plan import Plan

# Options with their defaults; `seed` 0 is the one that committed and documented campaigns have.
OPTIONS: dict[str, dict[str, Any]] = {
    "demo": {},
    "thesis": {"seed": 0},
    "hidden": {
        "seed": 0,
        "cells": 10,
        "healthy": 200,
        "unknown": 40,
        "two": 60,
        "physics": 12,
        "groups": 2,
    },
    "scale": {"seed": 0, "cells": 1000},
}
OF_THE_WORKFLOW = {"campaign", "folder", "real"}  # what else its --config may hold
FOLDERS = {"demo": "."} | {name: f"virtual/{name}" for name in OPTIONS if name != "demo"}


def options(name: str, given: dict[str, Any]) -> dict[str, Any]:
    """A campaign's options, the defaults for what is not given.

    Raises
    ------
    ValueError : no such campaign, no such option, or a value that is not of the default's kind.
    """
    if name not in OPTIONS:
        raise ValueError(f"no campaign {name!r}; there are {', '.join(OPTIONS)}")
    found = dict(OPTIONS[name])
    if unknown := sorted(given.keys() - found.keys() - OF_THE_WORKFLOW):
        known = ", ".join(found) or "none"
        raise ValueError(f"{name} has no option {', '.join(unknown)}; it has {known}")
    for key in found.keys() & given.keys():
        kind = type(found[key])
        try:
            found[key] = kind(given[key])
        except (TypeError, ValueError):
            raise ValueError(f"option {key}: {given[key]!r} is not {kind.__name__}") from None
    return found


def plan(name: str, **chosen: Any) -> Plan:
    """All tests of a campaign on paper."""
    full = options(name, chosen)
    return import_module(f"virtual_lab.campaigns.{name}").plan(**full)
