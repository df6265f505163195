"""What is said of rows of a record: `say(code, **fields)`; the sentences: messages.toml."""

from cellwright.messages import sayer

say = sayer(__package__)
