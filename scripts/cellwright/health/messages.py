"""What is said of the health of a cell: `say(code, **fields)`; the sentences: messages.toml."""

from cellwright.messages import sayer

say = sayer(__package__)
