"""What `help` of a public step shows: its words, arguments that steps share, keys of settings."""

import inspect
import re

PAGES = re.compile(r"(?:[;,] )?docs/[\w-]+\.md(?:#[\w-]+)?")  # which no wheel has
ENTRY = re.compile(r"^(\w+(?:, \w+)*) : (.*(?:\n    .*)*)", re.MULTILINE)


def completed(step, about_all, settings) -> str:
    """The docstring of a step, complete without documentation beside it.

    Parameters
    ----------
    step : function. about_all : docstring with entries `name, name : meaning` of shared arguments.
    settings : module with the classes of settings.
    """
    own = PAGES.sub("", inspect.cleandoc(step.__doc__))
    own = re.sub(r"\s*Source: *[.,;]?\s*(?=\n|$)", "", own).replace("Source: ; ", "Source: ")
    told = {name for names, _ in ENTRY.findall(own) for name in names.split(", ")}
    names = [name for name in inspect.signature(step).parameters if name not in told]
    parts = [own]
    for shared, meaning in ENTRY.findall(inspect.cleandoc(about_all)):
        if [name for name in names if name in shared.split(", ")]:
            parts.append(f"{shared} : {meaning}")
    for name in dict.fromkeys(re.findall(r"`settings\.(\w+)`", own)):
        kind = getattr(settings, name)
        keys = inspect.cleandoc(kind.__doc__).partition("\n\n")[2].rstrip()
        defaults = ", ".join(f"{key} = {value!r}" for key, value in kind._field_defaults.items())
        parts.append(f"Keys of `cw.settings.{name}`, which can be given by name:\n\n{keys}")
        parts.append(f"Defaults: {defaults}")
    return "\n\n".join(parts)
