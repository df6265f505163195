"""What is said of records of one test: `say(code, **fields)`; the sentences: messages.toml."""

from cellwright.messages import sayer

say = sayer(__package__)
