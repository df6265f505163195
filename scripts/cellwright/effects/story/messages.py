"""What is said of verdicts: `say(code, **fields)`; the sentences stand in messages.toml."""

from cellwright.messages import sayer

say = sayer(__package__)
