"""The page of all rules: what each makes and its message, read from workflow/rules."""

import re
from pathlib import Path

WORKFLOW = Path(__file__).resolve().parents[2] / "workflow"
# A rule ends where a line begins at the margin again, a part of it at the next part.
RULE = re.compile(r"^(?:rule|checkpoint) (\w+):\n((?:[ \t]+.*\n|\n)*)", re.M)
PART = re.compile(r"^ {4}(\w+):(.*\n(?: {5,}.*\n|\n)*)", re.M)
STRING = re.compile(r'"((?:[^"\\]|\\.)*)"')
INTRODUCTION = """\
# Rules

A rule makes artefacts of one stage. `./run snakemake --cores 2 RULE` runs a rule without wildcards,
`./run snakemake --cores 2 results/…` makes one file and what it needs. Names in angle brackets
stand for cells, tests and groups of the campaign. Each rule runs the script of its name in the
folder of `scripts/` that has the name of the file of rules.
"""


def text() -> str:
    """The whole page, in Markdown."""
    files = [WORKFLOW / "Snakefile", *sorted((WORKFLOW / "rules").glob("*.smk"))]
    return "\n".join([INTRODUCTION, *filter(None, map(_file, files))])


def rules(path: Path) -> list[tuple[str, str, list[str]]]:
    """Name, message and outputs of every rule in a file of rules, in its order."""
    found = []
    for name, body in RULE.findall(path.read_text(encoding="utf-8") + "\n"):
        parts = {part: STRING.findall(words) for part, words in PART.findall(body)}
        found.append((name, _shown("".join(parts.get("message", []))), _outputs(parts)))
    return found


def _outputs(parts) -> list[str]:
    return [_shown(output) for output in parts.get("output", []) if "/" in output]


def _shown(words: str) -> str:
    """Wildcards as a reader sees them: `{wildcards.cell}` and `{cell}` as `<cell>`."""
    return re.sub(r"\{+(?:\w+\.)*(\w+)[^}]*\}+", r"<\1>", words).replace("\\n", " ")


def _file(path: Path) -> str:
    found = rules(path)
    if not found:
        return ""
    lines = ["| rule | what it does | makes |", "| --- | --- | --- |"]
    for name, message, outputs in found:
        made = "<br>".join(f"`{output}`" for output in outputs)
        words = message.replace("<", "&lt;").replace("|", "\\|")
        lines.append(f"| `{name}` | {words} | {made} |")
    about = re.match(r"# (.+)\n", path.read_text(encoding="utf-8"))
    title = path.relative_to(WORKFLOW).as_posix()
    return "\n".join([f"## {title}\n", f"{about[1] if about else ''}\n", *lines, ""])


if __name__ == "__main__":
    print(text())
