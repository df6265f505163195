"""What is said of tests held against each other: `say(code, **fields)`; texts: messages.toml."""

from cellwright.messages import sayer

say = sayer(__package__)
