"""The page of the public interface, from the signatures and docstrings of `cellwright`."""

import importlib
import inspect
import itertools
import re
import sys

import cellwright

INTRODUCTION = """\
# Python interface

Every public name of `import cellwright as cw`, made from the docstrings; `help(cw.capacity)` shows
the same. [The steps as a library](api.md) has worked examples.
"""
LONGEST_DEFAULT = 40  # characters of a default value that are shown


def text() -> str:
    """The whole page, in Markdown."""
    parts, module = [INTRODUCTION, _arguments()], None
    for name in names():
        found = getattr(cellwright, name)
        if found.__module__ != module:
            module = found.__module__
            parts.append(f"## {module}\n\n{_first_paragraph(sys.modules[module])}\n")
        parts.append(_entry(name, found))
    return "\n".join(parts)


def _arguments() -> str:
    """What the arguments mean that steps have in common, from the docstring of the interface."""
    about = inspect.getdoc(importlib.import_module("cellwright.api"))
    _, _, shared = about.partition("docs/api.md shows them.\n")
    return f"## Arguments\n\n{_markdown(shared)}\n"


def names() -> list[str]:
    """Public names, those of one module together, in the order of the interface."""
    public = list(cellwright.__all__)
    modules = list(dict.fromkeys(getattr(cellwright, name).__module__ for name in public))
    return sorted(public, key=lambda name: modules.index(getattr(cellwright, name).__module__))


def _first_paragraph(found) -> str:
    return " ".join((inspect.getdoc(found) or "").partition("\n\n")[0].split())


def _entry(name: str, found) -> str:
    call = f"cw.{name}" if isinstance(found, type) and issubclass(found, Exception) else None
    call = call or _signature(f"cw.{name}", found)
    return f"### {name}\n\n```python\n{call}\n```\n\n{_markdown(inspect.getdoc(found) or '')}\n"


def _signature(name: str, found) -> str:
    """A call with the names and defaults of its arguments, on one line or one an argument."""
    arguments, keyword_only = [], False
    for argument in inspect.signature(found).parameters.values():
        if argument.kind is argument.KEYWORD_ONLY and not keyword_only:
            arguments.append("*")
            keyword_only = True
        keyword_only |= argument.kind is argument.VAR_POSITIONAL
        arguments.append(_argument(argument))
    line = f"{name}({', '.join(arguments)})"
    if len(line) <= 88:
        return line
    return f"{name}(\n" + "".join(f"    {argument},\n" for argument in arguments) + ")"


def _argument(argument) -> str:
    stars = {argument.VAR_POSITIONAL: "*", argument.VAR_KEYWORD: "**"}.get(argument.kind, "")
    if argument.default is argument.empty:
        return stars + argument.name
    value = repr(argument.default)
    return f"{argument.name}={value if len(value) <= LONGEST_DEFAULT else '…'}"


def _markdown(docstring: str) -> str:
    """A docstring as Markdown: sections under a bold name, `name : meaning` as a list entry."""
    lines, out, listed = docstring.splitlines(), [], False
    for line, under in itertools.zip_longest(lines, lines[1:], fillvalue=""):
        entry = re.match(r"([\w*]+(?:, [\w*]+)*) : ?(.*)", line)
        if re.fullmatch(r"-{3,}", line):
            continue
        if line and re.fullmatch(r"-{3,}", under):
            out += [f"**{line}**", ""]
        elif entry:
            out.append(f"* `{entry[1]}`: {entry[2]}")
        else:
            out.append(f"    {line.strip()}" if listed and line.startswith(" ") else line)
        listed = bool(entry) or (listed and bool(line))
    return re.sub(r"(?<!`)<(\w+)>(?!`)", r"&lt;\1&gt;", "\n".join(out))


if __name__ == "__main__":
    print(text())
