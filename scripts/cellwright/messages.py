"""Sentences for people: a room's stand in the `messages.toml` beside its module `messages`.

A result holds codes and numbers; what is said of them is made here, in one place, so that it can be
mended in one place.
"""

import tomllib
from functools import cache
from pkgutil import get_data


def sayer(room):
    """Function that words the codes of a room: `say(code, **fields)` → str.

    Parameters
    ----------
    room : package of the room's module `messages`, its `__package__`; the table stands beside it,
        in messages.toml: tables of texts, with fields in braces as `str.format` takes them. A code
        is "table.name".
    """

    def say(code, **fields):
        table, _, name = code.partition(".")
        return _tables(room)[table][name].format(**fields)

    return say


@cache
def _tables(room):
    return tomllib.loads(get_data(room, "messages.toml").decode())


def listed(names):
    """Names in a sentence: "a", "a and b", "a, b and c".

    Parameters
    ----------
    names : iterable of str.
    """
    names = list(names)
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
