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
        return Said(_tables(room)[table][name].format(**fields), code)

    return say


class Said(str):
    """A sentence that keeps the stable code it was made of, by which programs know it.

    of : what it is said of, which stands before it with a colon; "" where nothing does.
    """

    def __new__(cls, text, code="", of=""):
        said = super().__new__(cls, text)
        said.code, said.of = code, of
        return said


def said_of(subject, words):
    """A sentence about one of many: what is said of several in the same words is shown once.

    Parameters
    ----------
    subject : str, what it is said of. words : str or Said.

    Returns
    -------
    Said, `subject: words`.
    """
    return Said(f"{subject}: {words}", getattr(words, "code", ""), str(subject))


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


def doubt_columns(said):
    """Columns `doubt` and `doubt_codes` of a row: what speaks against it, and the codes of that.

    Parameters
    ----------
    said : iterable of Said, in the order in which they are told; each is told once.

    Returns
    -------
    dict: the sentences joined with "; ", which is in none of them, and as many codes, with ";".
    """
    alone = dict.fromkeys(Said(one.replace("; ", ", "), one.code) for one in said if one)
    return {"doubt": "; ".join(alone), "doubt_codes": ";".join(one.code for one in alone)}


def doubts_in(row, code=""):
    """List of Said, what speaks against a row by its columns `doubt` and `doubt_codes`.

    Parameters
    ----------
    row : mapping. code : of sentences that have none beside them.
    """
    words = row.get("doubt")
    if not isinstance(words, str) or not words:
        return []
    sentences, codes = words.split("; "), row.get("doubt_codes")
    codes = codes.split(";") if isinstance(codes, str) and codes else [code] * len(sentences)
    return [Said(one, code) for one, code in zip(sentences, codes, strict=True)]
